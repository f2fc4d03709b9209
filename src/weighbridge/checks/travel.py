"""Does the speed go forward, without jumps and long standstills?"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from weighbridge.checks.needed import show
from weighbridge.signals import Bools, Drive, Problem, Signal
from weighbridge.signals.instants import instant
from weighbridge.signals.runs import marked_runs
from weighbridge.signals.words import counted
from weighbridge.vehicle.model import Vehicle

IN_TURN: Final = 0.1
"""Part of the samples in motion from which jumps are no cuts [-]: wheels that spin as often as a
driver can make them jump in 0.01 of them."""


def check_standstill(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Tell of long standstills and cuts, which spoil no mass, and of a speed of two sources."""
    s = drive.speed
    if s is None or len(s) < 2:
        return
    standing = np.abs(s.values) < 0.3
    if float(np.max(np.abs(s.values))) < 1.0:
        yield Problem(
            s.name,
            f"the vehicle stands all the time ({s.duration:.0f} s): there is nothing to weigh by",
        )
        return
    length, start = _longest_time(s, standing)
    if length > 600.0:
        yield Problem(
            s.name,
            f"the vehicle stands for {length / 60.0:.0f} min from {instant(start)}; "
            "if it was loaded there, look at the mass of each segment",
        )
    # No car brakes or accelerates at 1.5 g: a piece of the recording is missing there.
    step, jump = np.diff(s.time), np.abs(np.diff(s.values))
    cut = (jump > 15.0 * step + 1.5) & (step < 1.0)
    if count := int(np.count_nonzero(cut)):
        k = int(np.argmax(np.where(cut, jump, 0.0)))
        in_turn = count > IN_TURN * max(int(np.count_nonzero(~standing)), 1)
        why = (
            "two sources or units take turns in it; map one of them"
            if in_turn
            else "a piece may be cut out of the recording there"
        )
        yield Problem(
            s.name,
            f"{s.name} jumps {counted(count, 'time')}, as from "
            f"{show(s.name, float(s.values[k]))} to {show(s.name, float(s.values[k + 1]))} "
            f"within {step[k]:.2g} s at {instant(s.time[k])}; {why}",
            serious=in_turn,
        )


def _longest_time(s: Signal, mask: Bools) -> tuple[float, float]:
    """Duration and start of the longest run of True [s]."""
    starts, ends = marked_runs(mask)
    if starts.size == 0:
        return 0.0, 0.0
    lengths = s.time[ends - 1] - s.time[starts]
    k = int(np.argmax(lengths))
    return float(lengths[k]), float(s.time[starts[k]])


def check_sign(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find a speed counted backwards."""
    s = drive.get("vehicle_speed")
    if s is None:
        return
    moving = np.abs(s.values) > 1.0
    backwards = int(np.count_nonzero(s.values[moving] < 0.0))
    if backwards > 0.5 * np.count_nonzero(moving):
        yield Problem(
            s.name,
            f"vehicle_speed is negative in {backwards} of {np.count_nonzero(moving)} samples in "
            "motion; if forward is negative there, set factor = -1 in the mapping",
            serious=True,
        )
