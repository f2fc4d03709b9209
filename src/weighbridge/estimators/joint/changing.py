"""Does the scale of the torque change while the vehicle drives, where no load can change?"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.estimators.joint.load_stops import loadable
from weighbridge.estimators.joint.problem import FilterInput
from weighbridge.limits import CERTAIN
from weighbridge.messages import Problem, phrase
from weighbridge.navigation import MotionSource
from weighbridge.signals import Floats
from weighbridge.signals.instants import instant, span

STEPS: Final = 20
"""Instants at which a step is tried; ramps begin at every fourth of them."""

ENDS: Final = 24
"""Windows at the beginning and end in which no change is looked for: a launch from cold passed for
another scale in a recorded electric car."""

MOST_STOPS: Final = 40
"""Stops that are tried, the longest first."""

MOST_JUMPS: Final = 4
"""Jumps of the mass that are looked for beside those the estimator found."""

SURE: Final = 8.0
"""Gain of likelihood from which the scale changed [-]: in 43 drives of three simulators, of all
classes, it was at most 2; a step or a ramp by a fifth in mid-drive gave 20 to 280."""

DOUBTFUL: Final = 5.0
"""The same from which a change is reported as possible, and the mass is given [-]."""

LEAST: Final = 0.08
"""Smaller changes of the scale are not reported [-]: two of 118 undamaged motorways of the accuracy
study showed one of 0.07."""

LAUNCH: Final = 1e6
"""Variance of the first window after a stop over that of the others [-]: it shows nothing."""

SCALE_STD: Final = 0.3
"""Standard deviation of a change of scale before the drive has shown [-]."""

ALIKE_BY_SPEED: Final[dict[MotionSource, str]] = {
    "speed_grade": "load.change_by_heights",
    "speed": "load.change_by_speed",
}
"""What looks alike where speed alone shows a change of the torque's scale, by what is beside it."""


@dataclass(frozen=True, slots=True)
class ScaleChange:
    """The likeliest change of the torque's scale within a drive.

    Attributes
    ----------
    start, end : of the change; the same for a step [s]
    change, std : of the scale, relative to before, and its standard deviation [-]
    gain : logarithm of the likelihood over that of no such change, loads at stops allowed [-]
    over_one : the same over that of the loads that were found alone, mostly one [-]
    """

    start: float
    end: float
    change: float
    std: float
    gain: float
    over_one: float = 0.0

    @property
    def sure(self) -> bool:
        """Whether no undamaged drive shows such a change."""
        return self._large and self.gain > SURE

    @property
    def doubt(self) -> Problem | None:
        """What may be wrong where a change is likely and not sure; else None."""
        if not self._large or self.sure:
            return None
        if self.gain > DOUBTFUL:
            return self._found("load.change_doubtful")
        return self._found("load.change_or_stop") if self.over_one > SURE else None

    @property
    def doubt_std(self) -> float:
        """What the doubt leaves open of the mass, relative [-]; 0 without one."""
        return 0.0 if self.doubt is None else abs(self.change)

    def refusal(self, motion: MotionSource) -> Problem:
        """What is wrong where it is sure, and what looks alike by that source of the motion."""
        return self._found(ALIKE_BY_SPEED.get(motion, "load.change_moving"))

    @property
    def _large(self) -> bool:
        return abs(self.change) > max(LEAST, CERTAIN * self.std)

    def _found(self, id: str) -> Problem:
        when = (
            phrase("at_instant", at=instant(self.start))
            if self.end == self.start
            else phrase("from_to", span=span(self.start, self.end))
        )
        return Problem.of(id, start=self.start, end=self.end, change=100.0 * self.change, when=when)


def largest(given: FilterInput) -> ScaleChange | None:
    """Find the change of scale, a step or a ramp, that explains a drive best.

    What the model says of the traction is one more column from the change on. Jumps of the
    mass at stops stay free in both hypotheses, or are given up for the change.

    Parameters
    ----------
    given : of the joint estimator

    Returns
    -------
    ScaleChange
        None of drives too short for one.

    References
    ----------
    Generalised likelihood ratio of a change: Willsky, Jones, IEEE Trans. Automatic
    Control 21, 1976.
    """
    given = _without_launches(given)
    time = given.time
    if time.size < 4 * STEPS:
        return None
    # Even in what the windows weigh, so that each part can show.
    information = np.cumsum(given.rows[:, 0] ** 2 / given.noise)
    instants = np.interp((np.arange(STEPS - 1) + 1) / STEPS, information / information[-1], time)
    instants = instants[(instants >= time[ENDS]) & (instants <= time[-ENDS])]
    if not instants.size:
        return None
    shapes = [(float(t), float(t), (time >= t).astype(np.float64)) for t in instants]
    end = float(time[-1])
    shapes += [(float(t), end, np.clip((time - t) / (end - t), 0.0, 1.0)) for t in instants[3:-4:4]]
    none = np.zeros_like(time)
    same, *_ = _run(given, none, given.added)
    jumps = [given.added]
    if given.added.any():
        jumps.append(np.zeros_like(given.added))
    best: ScaleChange | None = None
    for begin, until, shape in shapes:
        for added in jumps:
            likelihood, change, std = _run(given, shape, added)
            if best is None or likelihood - same > best.gain:
                best = ScaleChange(begin, until, change, std, likelihood - same)
    if best is None or not best.sure:
        return best
    return replace(best, gain=best.gain + same - _with_stops(given, same), over_one=best.gain)


def _without_launches(given: FilterInput) -> FilterInput:
    """Leave out the first window after each stop, whose clutch may slip.

    The engine's inertia is then not the vehicle's to accelerate, and in the first gear of a truck
    it weighs as much as the load: one launch is short of half its force, the next has it over.
    """
    launch = given.stood > 0.0
    return replace(given, noise=np.where(launch, LAUNCH * given.noise, given.noise))


def _with_stops(given: FilterInput, same: float) -> float:
    """Log-likelihood with jumps of the mass at the stops that explain most, short ones too."""
    size = loadable(given.stood)
    stops = np.flatnonzero(size > 0.0)
    stops = stops[np.argsort(-size[stops], kind="stable")][:MOST_STOPS]
    added, best = given.added, same
    for _ in range(MOST_JUMPS):
        tried = []
        for k in stops:
            more = added.copy()
            more[k, 0] = max(more[k, 0], (size[k] * given.start.x[0]) ** 2)
            tried.append((_run(given, np.zeros_like(given.time), more)[0], more))
        if not tried or max(t[0] for t in tried) < best + 1.0:
            break
        best, added = max(tried, key=lambda t: t[0])
    return best


def _run(given: FilterInput, shape: Floats, added: Floats) -> tuple[float, float, float]:
    """Log-likelihood with a column of this shape, and the change with its standard deviation."""
    state = replace(given, added=added).with_term(given.traction * shape, SCALE_STD).end()
    return float(state.log_likelihood), float(state.x[-1]), float(np.sqrt(state.cov[-1, -1]))
