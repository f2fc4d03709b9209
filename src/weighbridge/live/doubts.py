"""What a live scale doubts by the way its samples come, in sentences."""

from __future__ import annotations

import math
from typing import Final

from weighbridge.estimators.judging import STOP
from weighbridge.live.on_the_move import FIRST
from weighbridge.live.records import Records
from weighbridge.report.text import duration
from weighbridge.signals.catalogue import IMU_SIGNALS
from weighbridge.signals.instants import instant

PROVED: Final = 120.0
"""A mass of before a silence is proved by so long on the move [s]: another load shows in less."""


def of_before(records: Records, *, driven_since: float, goes_on: bool) -> str:
    """Say that a mass is of before a silence, and not yet of what was driven since; empty if not.

    Parameters
    ----------
    records
    driven_since : time on the move since all signals were silent the last time [s]
    goes_on : whether the mass is still that of before
    """
    if not (goes_on and records.silence >= STOP and driven_since < PROVED):
        return ""
    silence = (
        f"for {duration(records.silence)}"
        if math.isfinite(records.silence)
        else "for a time that nobody knows"
    )
    return (
        f"nothing came {silence} until {instant(records.resumed)}: the load "
        f"may have changed, and a mass takes {PROVED:.0f} s on the move"
    )


def doubts(
    records: Records, *, driven: float, anew: float, driven_since: float, goes_on: bool
) -> tuple[str, ...]:
    """Tell what is doubted.

    Parameters
    ----------
    records
    driven : time on the move [s]
    anew : instant from which all is weighed as a new drive, for a sensor began anew [s]; -inf
        where none did
    driven_since : time on the move since all signals were silent the last time [s]
    goes_on : whether the mass is still that of before
    """
    told = []
    if math.isfinite(anew):
        told.append(
            f"all signals were silent until {instant(anew)} and a sensor began anew: "
            "weighed from there as a new drive"
        )
    elif why := of_before(records, driven_since=driven_since, goes_on=goes_on):
        told.append(f"{why}; where it has changed, say so (l)")
    if driven >= FIRST and set(IMU_SIGNALS).isdisjoint(records.names()):
        told.append(
            "no inertial sensor comes: without one a mass is some 3 % light with GNSS heights "
            "and 10 % without, by a vehicle file that was made with one"
        )
    if jumps := records.jumps:
        times = "once" if jumps == 1 else f"{jumps} times, in all"
        told.append(f"the clock of the samples jumped {times} by {records.offset:.0f} s")
    return tuple(told)
