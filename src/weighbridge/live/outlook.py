"""How far a mass has come, what would make it surer, and what its samples leave uncertain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from scipy.special import ndtri

from weighbridge.estimators.judging import STOP
from weighbridge.live.on_the_move import FIRST
from weighbridge.live.records import Records
from weighbridge.live.weighing import KerbState, LiveStatus
from weighbridge.messages import Problem, phrase
from weighbridge.report.text import duration
from weighbridge.signals.catalogue import IMU_SIGNALS
from weighbridge.signals.instants import instant

PROVED: Final = 120.0
"""A mass of before a silence is proved by so long on the move [s]: another load shows in less."""


def of_before(
    records: Records, *, driven_since: float, goes_on: bool, ask: bool = False
) -> Problem | None:
    """Say that a mass is of before a silence, and not yet of what was driven since; None if not.

    Parameters
    ----------
    records
    driven_since : time on the move since all signals were silent the last time [s]
    goes_on : whether the mass is still that of before
    ask : ask for a report where the load has changed
    """
    if not (goes_on and records.silence >= STOP and driven_since < PROVED):
        return None
    silence = (
        phrase("for_time", time=duration(records.silence))
        if math.isfinite(records.silence)
        else phrase("for_unknown_time")
    )
    return Problem.of(
        "live.load_unknown" if ask else "live.of_before",
        start=records.resumed,
        end=records.resumed,
        silence=silence,
        at=instant(records.resumed),
        proved=PROVED,
    )


def doubts(
    records: Records, *, driven: float, anew: float, driven_since: float, goes_on: bool
) -> tuple[Problem, ...]:
    """Say what is uncertain.

    Parameters
    ----------
    records
    driven : time on the move [s]
    anew : instant from which all is weighed as a new drive, for a sensor began anew [s]; -inf
        where none did
    driven_since : time on the move since all signals were silent the last time [s]
    goes_on : whether the mass is still that of before
    """
    found = []
    if math.isfinite(anew):
        found.append(Problem.of("live.anew", start=anew, end=anew, at=instant(anew)))
    elif why := of_before(records, driven_since=driven_since, goes_on=goes_on, ask=True):
        found.append(why)
    if driven >= FIRST and set(IMU_SIGNALS).isdisjoint(records.names()):
        found.append(Problem.of("live.no_inertial"))
    if jumps := records.jumps:
        times = phrase("once") if jumps == 1 else phrase("times_in_all", count=jumps)
        found.append(Problem.of("live.clock_jumps", times=times, by=records.offset))
    return tuple(found)


def by_tilt(kerb: KerbState) -> tuple[Problem, ...]:
    """Say that the load has changed, where the tilt of the parked vehicle shows it."""
    if not math.isfinite(kerb.change):
        return ()
    low, high = kerb.interval
    change = f"{kerb.change:+.0f}"
    return (Problem.of("live.by_tilt", change=change, low=low, high=high),)


GOOD, BETTER = 0.05, 0.02
"""Half widths of the 95 % interval over the mass that are asked for [-]."""

_REACH: Final = float(ndtri(0.975))
"""Half width of the 95 % interval in standard deviations [-]."""

LONGEST: Final = 16_200.0
"""Driving on for longer is no remedy [s]: 4.5 h, after which a driver rests (EU 561/2006)."""

CALIBRATE: Final = "a calibration on more drives of several masses narrows the interval"
"""What helps where driving on does not."""

ADVICE: Final = (
    "starts, hills and changes of speed help most; steady driving and braking help little"
)
"""Which driving helps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outlook:
    """What a mass is worth and still needs; see `weighbridge.live.weighing.LiveWeighing`."""

    status: LiveStatus
    reason: Problem | None = None
    progress: float = 0.0
    progress_to_5: float = math.nan
    reach: float = math.nan
    minutes_to_5: float = math.nan
    minutes_to_2: float = math.nan
    advice: str = ""


class UnfollowedStop(NamedTuple):
    """A stop after which the vehicle drives on, and nothing of that is in the mass yet.

    Attributes
    ----------
    stood : how long the vehicle stood [s]; 0 where there is no such stop
    std : relative standard deviation of the mass by a change of load there [-]
    """

    stood: float = 0.0
    std: float = 0.0


NO_STOP: Final = UnfollowedStop()
"""All that was driven is in the mass."""


def outlook(
    mass: float,
    std: float,
    floor: float,
    *,
    driven: float,
    reason: Problem | None,
    silent: Sequence[str],
    first: float,
    std_found: float = math.nan,
    stop: UnfollowedStop = NO_STOP,
    unproved: Problem | None = None,
    since: float = 0.0,
    wait: float = 0.0,
) -> Outlook:
    """Judge a mass by its interval, and show how much more driving it takes.

    Noise falls as one over the time on the move; what vehicle file and equipment leave does not.

    Parameters
    ----------
    mass, std : [kg]; NaN where there is none
    floor : part of ``std`` that no driving takes away, relative to the mass [-]
    driven : time on the move that the mass was made from, or what was looked at [s]
    reason : why there is none; None where nothing says
    silent : signals that are needed and do not come
    first : time on the move before which nothing is weighed [s]
    std_found : standard deviation over the mass that the last look had, shown or not [-]; NaN
        before the first
    stop : of which the mass knows nothing yet
    unproved : why the mass is not yet one of what is driven now; None where it is
    since : time on the move since then, which no look has seen yet [s]
    wait : time on the move until it will [s]
    """
    if math.isnan(mass):
        if reason is None:
            reason = (
                Problem.of("live.first_mass", driven=driven + since, first=first)
                if driven + since < first
                else Problem.of("live.first_look", driven=driven + since)
            )
        return Outlook(
            status=LiveStatus.LEARNING,
            reason=_missing(silent, reason) if silent else reason,
            progress_to_5=_progress(GOOD, _REACH * std_found),
            advice=ADVICE,
        )
    half = _REACH * std / mass
    noise = max(std**2 - (floor * mass) ** 2, 0.0)
    to_good, to_better = (
        _later(_minutes(part, mass, noise, floor, driven), since, wait) for part in (GOOD, BETTER)
    )
    good = half <= GOOD
    if not good:
        reason = Problem.of("live.wide", share=100.0 * half)
        reason = _missing(silent, reason) if silent else reason
    elif silent:
        reason = _missing(silent)
    elif _REACH * math.hypot(std / mass, stop.std) > GOOD:
        reason = Problem.of("live.after_stop", stood=duration(stop.stood))
    else:
        reason = unproved
    return Outlook(
        status=LiveStatus.LEARNING if reason else LiveStatus.WEIGHED,
        reason=reason,
        progress=_progress(BETTER, half),
        progress_to_5=_progress(GOOD, half),
        reach=_reach(mass, noise, floor, driven),
        minutes_to_5=to_good,
        minutes_to_2=to_better,
        advice=_advice(to_good, to_better),
    )


def _progress(wanted: float, half: float) -> float:
    """Part of the way to an interval [-]: the variance that is allowed over that now.

    Parameters
    ----------
    wanted, half : half widths over the mass, wanted and now [-]; NaN where unknown
    """
    return half if math.isnan(half) else min(1.0, (wanted / half) ** 2)


def _missing(silent: Sequence[str], beside: Problem | None = None) -> Problem:
    """Say that signals do not come, before what is to be said beside."""
    verb = "does" if len(silent) == 1 else "do"
    found = Problem.of("live.silent", silent[0], names=", ".join(silent), verb=verb)
    return found if beside is None else replace(found, text=f"{found.text}; {beside.text}")


def _advice(to_good: float, to_better: float) -> str:
    """Say what helps, by the minutes until 5 and 2 %."""
    if to_better == 0.0:
        return ""
    return CALIBRATE if math.isinf(to_better) and to_good in (0.0, math.inf) else ADVICE


def _reach(mass: float, noise: float, floor: float, driven: float) -> float:
    """Half width of the interval over the mass after `LONGEST` more of driving [-]."""
    left = noise * driven / (driven + LONGEST) if math.isfinite(noise) else 0.0
    return _REACH * math.hypot(floor, math.sqrt(left) / mass)


def _later(minutes: float, since: float, wait: float) -> float:
    """Take off what was driven meanwhile; the interval is no narrower before the next look [min].

    Parameters
    ----------
    minutes : as of the last look
    since, wait : time on the move since it, and until the next [s]
    """
    if not 0.0 < minutes < math.inf:
        return minutes
    return max(minutes - since / 60.0, wait / 60.0)


def _minutes(half: float, mass: float, noise: float, floor: float, driven: float) -> float:
    """Time on the move until the interval is as narrow [min].

    NaN where there is no interval, infinite where `LONGEST` does not do.
    """
    if math.isinf(noise):
        return math.nan
    # Variance of the noise with which the interval is as narrow [kg^2]; negative if never.
    allowed = (half * mass / _REACH) ** 2 - (floor * mass) ** 2
    if noise <= allowed:
        return 0.0
    longest = driven * (noise / allowed - 1.0) if allowed > 0.0 else math.inf
    return longest / 60.0 if longest < LONGEST else math.inf
