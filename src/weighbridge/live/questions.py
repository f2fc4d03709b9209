"""What a live scale questions by the way its samples come, in sentences."""

from __future__ import annotations

import math
from typing import Final

from weighbridge.estimators.judging import STOP
from weighbridge.live.on_the_move import FIRST
from weighbridge.live.records import Records
from weighbridge.live.weighing import KerbState
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
