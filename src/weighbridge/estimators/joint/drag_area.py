"""What one drive shows of the vehicle's drag area."""

from __future__ import annotations

import math
from typing import NamedTuple

from weighbridge.estimators.track import MassTrack


class DragArea(NamedTuple):
    """C_d A above that of the vehicle file, and its standard deviation [m^2]."""

    value: float
    std: float


def shown_drag_area(track: MassTrack | None) -> DragArea | None:
    """Return the drag area as the drive alone shows it, without what the file expects.

    The estimator's state is a mean of the file, with its standard deviation, and of the drive,
    weighted by their information. That of the file is taken out, so that drives of one vehicle can
    be compared.

    Parameters
    ----------
    track : of the joint estimator; None where there is none

    Returns
    -------
    None where another method weighed, or the drive adds nothing
    """
    if track is None or track.slow_errors is None or track.sizes is None:
        return None
    value, std = track.slow_errors.constants.get("drag_area", (0.0, 0.0))
    before = track.sizes.states.std_of("drag_area")
    # A hundredth of the information is rounding.
    if not 0.0 < std < 0.995 * before:
        return None
    own = std**-2 - before**-2
    return DragArea(value * std**-2 / own, math.sqrt(1.0 / own))
