"""Which weighings go to an output that takes fewer than there are."""

from __future__ import annotations

import math

from weighbridge.live.weighing import LiveStatus, LiveWeighing

News = tuple[LiveStatus, bool, bool, tuple[bool, ...]]


def news(weighing: LiveWeighing) -> News:
    """Return what is reported at once where it changes.

    That is the status, parked or not, whether the tilt shows a change of load, and alerts.
    """
    tilts = math.isfinite(weighing.kerb.change)
    alerts = tuple(alert.active for alert in weighing.alerts)
    return weighing.status, weighing.parked, tilts, alerts


def due(weighing: LiveWeighing, last: float, period: float) -> bool:
    """Return whether samples came for so long since the last weighing that was reported.

    A clock that falls begins anew.

    Parameters
    ----------
    weighing
    last : instant of the newest sample of that one [s]; NaN where none had come
    period : [s]
    """
    if math.isnan(weighing.newest):
        return False
    return not 0.0 <= weighing.newest - last < period
