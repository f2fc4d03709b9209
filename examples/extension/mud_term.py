"""A term of the longitudinal law: a drag that grows with the speed, as in mud or slush."""

import numpy as np

from weighbridge.estimators.joint.terms import Term

USUAL = 0.01  # of the mass [1/s]: 20 m/s take 2 % of the weight


def column(table, vehicle, unmeasured_grade):
    """Return the traction that one N s/m of it takes at each row [m/s]."""
    return np.nan_to_num(table.speed)


def std(vehicle, sizes):
    """Return how large it may be before the drive has shown [N s/m]."""
    return USUAL * sizes.mass


mud = Term(
    name="mud",
    title="drag of mud, above the vehicle file's",
    unit="N s/m",
    column=column,
    std=std,
    time_constant=300.0,
)
