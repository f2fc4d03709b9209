"""A parked vehicle that is loaded: its tilt shows the change before it drives on."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from weighbridge.estimators import tilt
from weighbridge.estimators.tilt import Learnt, Stand, TiltChange, TiltMap
from weighbridge.live.outlook import PROVED
from weighbridge.live.weighing import KerbState
from weighbridge.signals import Drive, Floats

LIGHTS: Final = 60.0
"""Shorter stops are at traffic lights [s],"""

STILL: Final = 2e-3
"""if the tilt changes by less [rad]: as in 97 of 100 stops of two recorded cars."""

STANDS: Final = 0.1
"""A vehicle that stands is no faster [m/s]: an electric car crept at less than 0.5 m/s, and its
pitch seemed to change by up to 11 mrad."""

FEWEST: Final = 3
"""Samples of the specific force that a step needs."""

CHANGE_STD: Final = 0.01
"""Standard deviation of a change that the motion weighed, beside the noise of both masses [-]: the
mounting and the noise are found anew between them."""


class Weighed(NamedTuple):
    """A mass that the motion weighed.

    Attributes
    ----------
    mass : [kg]
    var : of its noise: what no driving takes away is the same before and after a stop [kg^2]
    """

    mass: float
    var: float


class Loaded(NamedTuple):
    """A stop whose change of load the motion weighs next.

    Attributes
    ----------
    pitch, var : change of the pitch there [rad], and its known variance
    before : mass before it
    """

    pitch: float
    var: float
    before: Weighed


@dataclass(slots=True)
class Kerb:
    """Follows the tilt from stop to stop.

    Attributes
    ----------
    map : what stops have shown
    stand : the stop that goes on; None on the move
    mass : of the stop that goes on, or of the last one; None where there was none
    loaded : stop whose change is weighed next; None without one
    moved : time on the move since it [s]
    found : change that the last stop shows; None for none
    """

    map: TiltMap = field(default_factory=TiltMap)
    stand: Stand | None = None
    mass: Weighed | None = None
    loaded: Loaded | None = None
    moved: float = 0.0
    found: TiltChange | None = None

    def begin_anew(self) -> None:
        """Take it that another drive begins; what was learnt stays."""
        self.stand = self.mass = self.loaded = self.found = None
        self.moved = 0.0

    def move(self, length: float, forward: Floats | None) -> None:
        """Take a step on the move.

        Parameters
        ----------
        length : of the step [s]
        forward : (3,) axis of the vehicle, in sensor axes; None where it is not known
        """
        if self.stand is not None:
            self._set_off(self.stand, forward)
        self.stand = None
        self.moved += length
        if self.moved >= PROVED:
            self.found = None

    def stay(
        self, seen: Drive, until: float, length: float,
        *, forward: Floats | None, mass: Weighed | None,
    ) -> None:  # fmt: skip
        """Take a step in which the vehicle stands.

        Parameters
        ----------
        seen : samples, up to ``until``
        until, length : of the step [s]
        forward : (3,) axis of the vehicle, in sensor axes; None where it is not known
        mass : that the motion has weighed; None where there is none
        """
        if self.stand is None:
            self.stand, self.found = tilt.begin(until), None
        if mass is not None:
            self.mass = mass
        force = _mean_force(seen, until - length, until)
        if force is None:
            return
        self.stand = tilt.step(self.stand, until, force)
        change = None if forward is None else tilt.tilt(self.stand, forward)
        if change is not None:
            self._read(change)

    def state(self) -> KerbState:
        """Return what is shown."""
        found, mass = self.found, self.mass
        if found is None or mass is None:
            return KerbState(follows=self.map.follows, weighed=self.map.weighed)
        return KerbState(
            follows=self.map.follows,
            weighed=self.map.weighed,
            change=found.change * mass.mass,
            std=found.std * mass.mass,
        )

    def _read(self, change: tilt.Tilt) -> None:
        found = self.map.read(change.pitch, change.var, change.stood)
        self.found = found if found is not None and found.sure else None

    def _set_off(self, stand: Stand, forward: Floats | None) -> None:
        """Take it that a stop is over."""
        change = None if forward is None else tilt.tilt(stand, forward, ends=True)
        if change is None:
            return
        self._read(change)
        if change.stood < LIGHTS and abs(change.pitch) < STILL:
            return
        loaded, mass = self.loaded, self.mass
        if loaded is not None and mass is not None and self.moved >= PROVED:
            self.map = self.map.with_stop(_learnt(loaded, mass))
            loaded = None
        if loaded is not None:
            # Nothing weighed what changed there: both stops count as one.
            pitch, var = loaded.pitch + change.pitch, loaded.var + change.var
            self.loaded = Loaded(pitch, var, loaded.before)
        elif mass is not None:
            self.loaded = Loaded(change.pitch, change.var, mass)
        self.moved = 0.0


def stands(seen: Drive, at: float) -> bool:
    """Whether the vehicle stands at an instant [s], by the last speed before it."""
    speed = seen.speed
    return speed is not None and float(speed.held(np.array([at]))[0]) <= STANDS


def _learnt(loaded: Loaded, after: Weighed) -> Learnt:
    before = loaded.before
    return Learnt(
        pitch=loaded.pitch,
        pitch_var=loaded.var,
        change=after.mass / before.mass - 1.0,
        change_var=(before.var + after.var) / before.mass**2 + CHANGE_STD**2,
    )


def _mean_force(seen: Drive, start: float, end: float) -> Floats | None:
    """Mean specific force (3,) between two instants [m/s^2]; None with too few samples."""
    means = []
    for axis in "xyz":
        signal = seen.get(f"accel_{axis}")
        if signal is None:
            return None
        first, last = signal.time.searchsorted([start, end])
        if last - first < FEWEST:
            return None
        means.append(float(np.mean(signal.values[first:last])))
    force = np.array(means)
    return force if math.isfinite(float(force.sum())) and force.any() else None
