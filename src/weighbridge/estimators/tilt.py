"""Change of load of a parked vehicle, by the tilt of its body.

A load presses the springs, and an accelerometer sees the body pitch. How much it pitches by a
change of the mass depends on springs and on where the load lies: one number shows no two unknowns.
So a vehicle's own stops, whose change the motion weighed afterwards, show the pitch by a change,
how much that scatters with the place of the load, and what the pitch does without a change:

    pitch = (c + p e1) x + q e2,

with the change x relative to the mass. All values of c, p and q that the stops leave possible count
by their probability. A body that comes back to its height has c near 0: it shows nothing. Roll does
not count: left and right are alike, and people who lean, doors and wind roll the body most.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from weighbridge.estimators.joint.load_stops import change_odds
from weighbridge.limits import SIGNIFICANT
from weighbridge.signals import Floats

SETTLED: Final = 2.0
"""After the vehicle stands its body swings for so long [s]."""

BEFORE: Final = 4.0
"""The tilt before is a mean over so long after that [s]: doors open later."""

HOLD: Final = 20.0
"""The tilt while it stands is the median over so long [s]: who leans for less than half of it does
not count."""

LAST: Final = 5.0
"""The tilt at the end is the median over so long [s], the last `LAUNCH` left out."""

LAUNCH: Final = 2.0
"""So long before the speed shows it, a launch may press the body down [s]."""

DRIFT: Final = 2e-6
"""Change of the offset of an accelerometer by temperature, as a tilt, standard deviation
[rad/s]: 0.2 mg/K, and a tenth of a kelvin a minute."""

LARGEST: Final = 0.08
"""No load tilts a body further [rad]: the sensor was moved."""

LEAST: Final = 0.03
"""Smaller changes are not reported, relative to the mass [-]: those of fuel and persons."""

UNLOADED_STD: Final = 0.012
"""Change at a stop without a change of load, standard deviation [-]."""

LOADED: Final = 0.12
"""Change at a stop with one, mean of its size [-]: small ones are more frequent."""

PROBABLE: Final = 0.95
"""A change that is so probable is reported [-]: none of 256 quiet stops of 32 simulated vehicles
had one by it, and 3 by 0.9."""

SIDED: Final = 0.9
"""Its sign is then so probable [-]."""

FEWEST: Final = 2
"""Changes that the motion has weighed, without which nothing is reported."""

CLEAR: Final = 0.1
"""A change of so much of the mass must stand out of what the pitch does beside [-]."""

MOST: Final = 40
"""Stops that are kept, the last ones."""

OFTEN: Final = 0.9
WIDER: Final = 4.0
"""What the pitch does beside is Gaussian so often [-], else so many times as wide [-]: people sit
on the sill, a door stays open."""


def _grid() -> tuple[Floats, Floats, Floats, Floats]:
    """Values of c, p [rad] and q [rad] (n,), and the logarithm of their prior probabilities.

    A load over the rear axle of a car of 1.3 Hz has c = 0.1 rad, one between axles 0; scatter by
    the place is a third of that.
    """
    bend = np.linspace(-3.4, 4.4, 32)
    c = 5e-3 * np.sinh(bend)
    p = np.geomspace(0.004, 0.13, 7)
    q = np.geomspace(0.12e-3, 1.6e-3, 7)
    log_c = -0.5 * ((c - 0.05) / 0.08) ** 2 + np.log(np.cosh(bend))
    log_p = -0.5 * (np.log(p / 0.03) / 0.8) ** 2
    log_q = -0.5 * (np.log(q / 0.4e-3) / 0.5) ** 2
    c, p, q = (a.ravel() for a in np.meshgrid(c, p, q, indexing="ij"))
    log = log_c[:, None, None] + log_p[:, None] + log_q
    return c, p, q, log.ravel()


_C, _P, _Q, _PRIOR = _grid()
_X: Final = np.linspace(-0.5, 0.5, 101)
"""Changes of load that are looked at, relative to the mass [-]."""


class Learnt(NamedTuple):
    """One stop, and what the motion weighed after it.

    Attributes
    ----------
    pitch, pitch_var : change of the pitch [rad], and variance known beside that of `TiltMap`
    change, change_var : of the mass, relative, by the motion [-], and its variance
    """

    pitch: float
    pitch_var: float
    change: float
    change_var: float


@dataclass(frozen=True, slots=True)
class TiltChange:
    """Change of the load that the tilt shows.

    Attributes
    ----------
    change, std : relative to the mass before, given that it is more than `LEAST` [-]
    probability : that it is [-]
    sided : probability of its sign then [-]
    """

    change: float
    std: float
    probability: float
    sided: float

    @property
    def sure(self) -> bool:
        """Whether it is reported."""
        return self.probability >= PROBABLE and self.sided >= SIDED


@dataclass(frozen=True)
class TiltMap:
    """What the stops of a vehicle have shown so far.

    Attributes
    ----------
    stops : the last ones, whose change was weighed
    """

    stops: tuple[Learnt, ...] = ()

    def with_stop(self, stop: Learnt) -> TiltMap:
        """Return the map with one more stop."""
        return TiltMap((*self.stops, stop)[-MOST:])

    @property
    def weighed(self) -> int:
        """Changes that the motion has weighed."""
        return sum(abs(s.change) > SIGNIFICANT * math.sqrt(s.change_var) for s in self.stops)

    @cached_property
    def _nodes(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Values of c, p and q that are still possible, and their probabilities (n,)."""
        log = _PRIOR.copy()
        for s in self.stops:
            var = s.pitch_var + _P**2 * (s.change**2 + s.change_var) + _C**2 * s.change_var
            log += np.log(_density(s.pitch - _C * s.change, var, _Q**2) + 1e-30)
        weight = np.exp(log - log.max())
        weight /= weight.sum()
        order = np.argsort(-weight, kind="stable")
        many = int(np.searchsorted(np.cumsum(weight[order]), 0.99)) + 1
        kept = order[:many]
        return _C[kept], _P[kept], _Q[kept], weight[kept] / weight[kept].sum()

    @property
    def follows(self) -> bool | None:
        """Whether the pitch follows the load; None before `FEWEST` changes were weighed.

        It does not where the suspension levels itself, and where load lies between the axles: the
        place of the load then counts more than its mass.
        """
        if self.weighed < FEWEST:
            return None
        c, p, q, weight = self._nodes
        pitch = float(weight @ c)
        return pitch > float(weight @ p) and CLEAR * pitch > 2.0 * float(weight @ q)

    def read(self, pitch: float, var: float, stood: float) -> TiltChange | None:
        """Read a change of the pitch; None where it does not follow the load.

        Parameters
        ----------
        pitch : since the vehicle stands [rad]
        var : known variance of it [rad^2]
        stood : how long it has stood [s]
        """
        if not self.follows or not abs(pitch) < LARGEST:
            return None
        c, p, q, weight = (a[:, None] for a in self._nodes)
        seen = _density(pitch - c * _X, var + (p * _X) ** 2, q**2)
        likelihood = (weight * seen).sum(axis=0)
        share = 1.0 / (1.0 + np.exp(-_odds(stood)))
        prior = (1.0 - share) * _normal(_X, UNLOADED_STD) + share * np.exp(-np.abs(_X) / LOADED) / (
            2.0 * LOADED
        )
        found = likelihood * prior
        large = found * (np.abs(_X) > LEAST)
        total = large.sum()
        mean = float((large * _X).sum() / total)
        std = math.sqrt(float((large * (_X - mean) ** 2).sum() / total))
        more = float(large[_X > 0.0].sum() / total)
        return TiltChange(mean, std, float(total / found.sum()), max(more, 1.0 - more))


def _odds(stood: float) -> float:
    odds = float(change_odds(np.array([stood]))[0])
    return odds if math.isfinite(odds) else -10.0


def _normal(x: Floats, std: float) -> Floats:
    return np.asarray(np.exp(-0.5 * (x / std) ** 2) / (std * math.sqrt(2.0 * math.pi)))


def _density(residual: Floats, var: Floats, beside_var: Floats) -> Floats:
    """Density of a pitch, but for a constant, with what it does beside."""
    narrow, wide = var + beside_var, var + WIDER**2 * beside_var
    often = OFTEN * np.exp(-0.5 * residual**2 / narrow) / np.sqrt(narrow)
    seldom = (1.0 - OFTEN) * np.exp(-0.5 * residual**2 / wide) / np.sqrt(wide)
    return np.asarray(often + seldom)


class Stand(NamedTuple):
    """A stop that goes on: means of the specific force in sensor axes.

    Attributes
    ----------
    since : the vehicle stands [s]
    before : (k, 4) instant and mean direction of gravity, of the beginning
    recent : (k, 4) the same of the last `HOLD` seconds
    """

    since: float
    before: Floats
    recent: Floats


def begin(since: float) -> Stand:
    """Return a stop that begins."""
    return Stand(since, np.empty((0, 4)), np.empty((0, 4)))


def step(stand: Stand, until: float, force: Floats) -> Stand:
    """Take one more mean of the specific force.

    Parameters
    ----------
    stand : before it
    until : its instant [s]
    force : (3,) mean over the last second or so, along any axes that are fixed [m/s^2]
    """
    row = np.append(until, force / np.linalg.norm(force))[None]
    after = until - stand.since
    if after <= SETTLED:
        return stand
    before = np.concatenate([stand.before, row]) if after <= SETTLED + BEFORE else stand.before
    recent = np.concatenate([stand.recent[stand.recent[:, 0] > until - HOLD], row])
    return Stand(stand.since, before, recent)


class Tilt(NamedTuple):
    """Change of the pitch within a stop.

    Attributes
    ----------
    pitch : [rad]
    var : variance that it has by spread and drift [rad^2]
    stood : how long the vehicle has stood [s]
    """

    pitch: float
    var: float
    stood: float


def tilt(stand: Stand, forward: Floats, *, ends: bool = False) -> Tilt | None:
    """Return the change of the pitch since the vehicle stands; None where too little is known.

    Parameters
    ----------
    stand
    forward : (3,) axis of the vehicle, in those of the specific force
    ends : the vehicle sets off
    """
    before, recent = stand.before, stand.recent
    if before.shape[0] < 2 or not recent.shape[0]:
        return None
    end = float(recent[-1, 0])
    if ends:
        recent = recent[(recent[:, 0] > end - LAUNCH - LAST) & (recent[:, 0] <= end - LAUNCH)]
    elif end - stand.since < SETTLED + BEFORE + 0.5 * HOLD:
        return None
    recent = recent[recent[:, 0] > before[-1, 0]]
    if recent.shape[0] < 2:
        return None
    first, last = before[:, 1:] @ forward, recent[:, 1:] @ forward
    now = float(np.median(last))
    pitch = now - float(np.median(first))
    spread = np.median(np.abs(last - now)) ** 2 + np.median(np.abs(first - np.median(first))) ** 2
    apart = float(np.median(recent[:, 0])) - float(before[-1, 0])
    return Tilt(pitch, float(spread) + (DRIFT * apart) ** 2, end - stand.since)
