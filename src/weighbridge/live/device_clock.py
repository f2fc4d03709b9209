"""From a device's clock to the host's: the message with the shortest way shows the difference."""

from __future__ import annotations

import math
from typing import Final

# The shortest way of the last two spells counts. A clock that drifts by 50 ppm is 1 ms off then.
_SPELL: Final = 10.0
# A message that is later than the others by more was held up, or the device's clock was set back.
_LATE: Final = 1.0
# Late for so long, and it was the clock [s].
_PATIENCE: Final = 2.0
# So many stamps in succession that fell behind the newest, and the clock has begun anew.
_FALLEN: Final = 3


class DeviceClock:
    """Turns instants of a device's clock into those of the host's clock that never jumps.

    A message is never early: of the differences between arrival and stamp the smallest is nearest
    to the truth. The stamps keep their spacing, which arrivals over a serial line do not.

    A device that was turned on anew, or whose clock was set back, sends stamps that fall. What it
    sends is believed from its third message on.

    Parameters
    ----------
    period : after which the device counts from 0 again, such as a day [s]; infinite for never

    Attributes
    ----------
    renewed : how often the device's clock has begun anew
    """

    def __init__(self, period: float = math.inf) -> None:
        self.renewed = 0
        self._period = period
        self._reported = -math.inf
        self._turns = 0
        self._best = math.inf
        self._before = math.inf
        self._begun = -math.inf
        self._late_since = math.inf
        self._newest = -math.inf
        self._fallen = 0
        self._fallen_to = math.nan

    def host(self, stamp: float, arrived: float) -> float:
        """Return when something was measured, by the host's clock [s].

        NaN while it is not known whether the device's clock has begun anew.

        Parameters
        ----------
        stamp : by the device's clock [s]
        arrived : when its message came, by the host's clock [s]
        """
        stamp = self._running(stamp)
        difference = arrived - stamp
        if not math.isfinite(difference):
            return arrived
        if self._falls(stamp):
            return math.nan
        if difference > min(self._best, self._before) + _LATE:
            self._late_since = min(self._late_since, arrived)
            if arrived - self._late_since > _PATIENCE:
                self._best = self._before = math.inf
        else:
            self._late_since = math.inf
        if arrived - self._begun > _SPELL:
            self._before, self._best, self._begun = self._best, math.inf, arrived
        self._best = min(self._best, difference)
        return stamp + min(self._best, self._before)

    def _falls(self, stamp: float) -> bool:
        """Say whether a stamp has fallen; take a clock that goes on from there as a new one."""
        if not stamp < self._newest - _LATE:
            self._newest, self._fallen = max(self._newest, stamp), 0
            return False
        # One that was overtaken on its way through a network falls alone.
        goes_on = self._fallen > 0 and abs(stamp - self._fallen_to) < _PATIENCE
        self._fallen = self._fallen + 1 if goes_on else 1
        self._fallen_to = stamp
        if self._fallen < _FALLEN:
            return True
        self._best = self._before = self._late_since = math.inf
        self._newest, self._fallen = stamp, 0
        self.renewed += 1
        return False

    def _running(self, stamp: float) -> float:
        """Let a stamp go on where the device counts from 0 again [s]."""
        if math.isinf(self._period):
            return stamp
        self._turns += stamp - self._reported < -0.5 * self._period
        self._reported = stamp
        return stamp + self._turns * self._period
