"""Does the speed go forward, without jumps and long standstills?"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from weighbridge.checks.needed import show
from weighbridge.messages import phrase
from weighbridge.signals import Bools, Drive, Problem, Signal
from weighbridge.signals.instants import instant
from weighbridge.signals.runs import marked_runs
from weighbridge.signals.words import counted
from weighbridge.vehicle import Vehicle

IN_TURN: Final = 0.1
"""Part of the samples in motion from which jumps are no cuts [-]: wheels that spin as often as a
driver can make them jump in 0.01 of them."""
UNITS: Final = (
    (1.609344, "km/h to mph"),
    (1.0 / 1.609344, "mph to km/h"),
    (3.6, "km/h to m/s"),
    (1.0 / 3.6, "m/s to km/h"),
    (1.852, "km/h to knots"),
    (1.0 / 1.852, "knots to km/h"),
    (2.236936, "mph to m/s"),
    (1.0 / 2.236936, "m/s to mph"),
)
"""Speed before over speed after a change of unit [-], and its name."""
OF_UNIT: Final = 0.015
"""How far from a change of unit a jump may lie, besides its resolution [-]."""
STEADY: Final = 0.08
"""Change of the engine's speed over a jump that only the unit of the vehicle's explains [-]."""


def check_standstill(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Report long standstills and cuts, which spoil no mass, and a speed of two sources."""
    s = drive.speed
    if s is None or len(s) < 2:
        return
    standing = np.abs(s.values) < 0.3
    if float(np.max(np.abs(s.values))) < 1.0:
        yield Problem.of("speed.stands", s.name, duration=s.duration)
        return
    length, start = _longest_time(s, standing)
    if length > 600.0:
        yield Problem.of(
            "speed.standstill",
            s.name,
            start=start,
            end=start + length,
            minutes=length / 60.0,
            at=instant(start),
        )
    # No car brakes or accelerates at 1.5 g: a piece of the recording is missing there.
    step, jump = np.diff(s.time), np.abs(np.diff(s.values))
    cut = (jump > 15.0 * step + 1.5) & (step < 1.0)
    if count := int(np.count_nonzero(cut)):
        k = int(np.argmax(np.where(cut, jump, 0.0)))
        in_turn = count > IN_TURN * max(int(np.count_nonzero(~standing)), 1)
        unit = "" if in_turn else _unit_changes(drive, s, k)
        if in_turn:
            why = phrase("jump_turns")
        elif unit:
            why = phrase("jump_unit", unit=unit)
        else:
            why = phrase("jump_cut")
        yield Problem.of(
            "speed.jumps",
            s.name,
            serious=in_turn or bool(unit),
            start=s.time[k],
            end=s.time[k],
            times=counted(count, "time"),
            before=show(s.name, float(s.values[k])),
            after=show(s.name, float(s.values[k + 1])),
            step=step[k],
            at=instant(s.time[k]),
            why=why,
        )


def _unit_changes(drive: Drive, s: Signal, k: int) -> str:
    """Which change of unit the jump after sample k is, in words; empty where it is none.

    A unit that changes leaves the engine's speed as it is. Where GNSS shows the speed, it judges.
    """
    engine = drive.get("engine_speed")
    if engine is None or len(engine) < 2 or drive.get("gnss_speed") is not None:
        return ""
    before, after = np.abs(s.values[k : k + 2])
    turned = np.abs(engine.at(s.time[k : k + 2]))
    if min(before, after, *turned) <= 0.0 or abs(np.log(turned[1] / turned[0])) > STEADY:
        return ""
    moves = np.abs(np.diff(s.values))
    resolution = float(np.min(moves[moves > 0.0]))
    near = OF_UNIT + resolution / min(before, after)
    return next((name for ratio, name in UNITS if abs(before / after / ratio - 1.0) < near), "")


def _longest_time(s: Signal, mask: Bools) -> tuple[float, float]:
    """Duration and start of the longest run of True [s]."""
    starts, ends = marked_runs(mask)
    if starts.size == 0:
        return 0.0, 0.0
    lengths = s.time[ends - 1] - s.time[starts]
    k = int(np.argmax(lengths))
    return float(lengths[k]), float(s.time[starts[k]])
