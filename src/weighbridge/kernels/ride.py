"""A linear vehicle on a road, stepped exactly."""

import numpy as np

from weighbridge.kernels._jit import kernel


@kernel
def run(state, transition, old_road, new_road, part, road, push, every):
    """Step ``x' = A x + B q`` with a road that is linear in time within a step.

    Parameters
    ----------
    state : (n,) float64
        At the first row of the road.
    transition : (p, n, n) float64
        State transition of one step, for each set of parameters.
    old_road, new_road : (p, n, w) float64
        What the road at the start and at the end of a step adds.
    part : (m,) int64
        Set of parameters that holds in the step which begins at each row.
    road : (m, w) float64
        Height under the wheels [m].
    push : (m, n) float64
        Added to the state after each step: process noise.
    every : int
        Rows kept: each ``every``-th.

    Returns
    -------
    (ceil(m / every), n) float64
    """
    rows = (road.shape[0] + every - 1) // every
    out = np.empty((rows, state.size))
    for k in range(road.shape[0]):
        if k % every == 0:
            out[k // every] = state
        if k + 1 < road.shape[0]:
            j = part[k]
            state = (
                transition[j] @ state + old_road[j] @ road[k] + new_road[j] @ road[k + 1] + push[k]
            )
    return out
