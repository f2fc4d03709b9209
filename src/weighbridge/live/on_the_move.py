"""How long a vehicle has been on the move, and when all records are looked at for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.balance import WINDOW
from weighbridge.estimators.joint import JointSettings
from weighbridge.estimators.joint.possible import enough_windows
from weighbridge.limits import STANDS
from weighbridge.signals import Drive

GAP: Final = 1.0
"""Of the time between two readings of the speed no more counts [s]."""

FIRST: Final = 30.0
"""Time on the move after which a drive is looked at for the first time [s]."""

AGAIN: Final = 15.0
"""It is looked at again after so long on the move at the earliest [s],"""

SLOWER: Final = 1.1
"""while there is no mass, not before so many times as much since the last long stop [-],"""

GROWTH: Final = 1.5
"""and with a mass so many times as much [-]."""

FOLLOWED: Final = enough_windows(JointSettings()) * WINDOW
"""A look shows what was loaded at a stop after so long on the move [s]."""

PERIOD: Final = 600.0
"""At the latest it is looked at after so long on the move [s]."""

REST: Final = 30.0
"""It is looked at too when the vehicle has stood for so long [s]: most such stops end a drive."""


@dataclass(slots=True)
class OnTheMove:
    """Time on the move so far, and looks at all records by it.

    Attributes
    ----------
    driven : time on the move [s]
    this_load : part of it with the load of now [s]
    before : what it was when all signals were silent the last time [s]
    looked_at, look_at : what it was at the last look, and is at the next [s]
    stood : the vehicle has stood for so long [s]
    rested : longest stop after which no look has seen enough of the driving [s]
    anew : time on the move until it [s]; looks are more often from there
    rests : with the last step it has stood for `REST`
    """

    driven: float = 0.0
    this_load: float = 0.0
    before: float = 0.0
    looked_at: float = 0.0
    look_at: float = FIRST
    stood: float = 0.0
    rested: float = 0.0
    anew: float = 0.0
    rests: bool = False

    def go_on(self, step: float, *, moved: bool) -> None:
        """Take a step of so long [s], in which the vehicle moved or stood."""
        if moved:
            self.driven += step
            self.this_load += step
            self.stood, self.rests = 0.0, False
        else:
            self.rests = self.stood < REST <= self.stood + step
            self.stood += step

    @property
    def is_due(self) -> bool:
        """Whether to look at all records now."""
        rests = self.rests and self.driven >= self.looked_at + FIRST
        return self.driven >= self.look_at or rests

    def looks(self, *, weighed: bool) -> None:
        """Take it that they are looked at now, and that there is a mass already, or none."""
        self.looked_at, since = self.driven, self.driven - self.anew
        if since >= FOLLOWED:
            self.rested = 0.0
        wait = max(((GROWTH if weighed else SLOWER) - 1.0) * since, AGAIN)
        self.look_at = self.driven + min(wait, PERIOD)

    def look_soon(self, stood: float) -> None:
        """Take it that the load may be another after a stop [s], which only a look shows."""
        self.rested, self.anew = max(self.rested, stood), self.driven
        self.look_at = min(self.look_at, self.driven + FIRST)

    def begin_anew(self) -> None:
        """Take it that nothing shows this load yet, as after a start."""
        self.looked_at, self.look_at = self.driven, self.driven + FIRST

    @property
    def left(self) -> float:
        """Time on the move until the next look [s]."""
        return max(self.look_at - self.driven, 0.0)

    @property
    def part(self) -> float:
        """Part of the driving until the next look that is done [-]."""
        part = (self.driven - self.looked_at) / (self.look_at - self.looked_at)
        return min(max(part, 0.0), 1.0)


def time_on_the_move(drive: Drive, since: float) -> float:
    """Time on the move since an instant, gaps left out [s]."""
    speed = drive.speed
    if speed is None:
        return 0.0
    moved = (speed.values[1:] > STANDS) & (speed.time[1:] > since)
    return float(np.minimum(np.diff(speed.time), GAP)[moved].sum())


def moves(drive: Drive, at: float) -> bool:
    """Whether the vehicle moves at an instant [s], by the last speed before it."""
    speed = drive.speed
    return speed is not None and float(speed.held(np.array([at]))[0]) > STANDS
