"""The backward pass of the navigation filter, over the rows its forward pass kept.

References
----------
Bierman, Fixed interval smoothing with discrete measurements, Int. J. Control 18, 1973.
"""

import numpy as np

from weighbridge.kernels._jit import fast_kernel
from weighbridge.kernels.ins_model import ERRORS
from weighbridge.kernels.ins_rows import correct


@fast_kernel
def smooth(log, count, adjoint, states, first):
    """Go backward over one stretch of nodes (Bierman 1973, modified Bryson-Frazier).

    Parameters
    ----------
    log : Rows
        Of the nodes ``first .. first + count - 1``.
    count : int
    adjoint : (20,) float64
        From the stretch after this one, zero at the end of the drive; changed
        in place, for the stretch before.
    states : (m, 24) float64
        Filter states after each node; corrected in place.
    first : int
    """
    dx = np.empty(ERRORS)
    for k in range(count - 1, -1, -1):
        for i in range(ERRORS):
            total = 0.0
            for j in range(ERRORS):
                total += log.cov[k, i * ERRORS + j] * adjoint[j]
            dx[i] = -total
        correct(states[first + k], dx)
        for row in range(log.row_count[k] - 1, -1, -1):
            back = log.innovation[k, row]
            for i in range(ERRORS):
                back += log.ph[k, row * ERRORS + i] * adjoint[i]
            back /= log.innovation_var[k, row]
            for i in range(ERRORS):
                adjoint[i] -= log.h[k, row * ERRORS + i] * back
        tr = log.transition[k]
        dt, sx, sy, sz = tr[0], tr[1], tr[2], tr[3]
        v0, v1, v2 = adjoint[3], adjoint[4], adjoint[5]
        t0, t1, t2 = adjoint[6], adjoint[7], adjoint[8]
        for i in range(3):
            adjoint[9 + i] -= tr[4 + i] * v0 + tr[7 + i] * v1 + tr[10 + i] * v2
            adjoint[12 + i] -= tr[4 + i] * t0 + tr[7 + i] * t1 + tr[10 + i] * t2
        adjoint[6] = t0 + sy * v2 - sz * v1
        adjoint[7] = t1 + sz * v0 - sx * v2
        adjoint[8] = t2 + sx * v1 - sy * v0
        for i in range(3):
            adjoint[3 + i] += dt * adjoint[i]
