"""A value that is repeated because nothing new came is one measurement."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.limits import SOME
from weighbridge.messages import Problem
from weighbridge.signals.catalogue import QUANTITIES
from weighbridge.signals.drive import Drive
from weighbridge.signals.signal import Bools, Floats, Signal

DEVICES: Final = ("gnss", "imu")
"""Tables of one device: a row is new where any of its values is."""

_OFTEN: Final = 0.8
"""With a larger part of the samples changed, each is new [-]."""

_SHORTEST: Final = 1.5
"""Changes as near to each other come with every sample, in its periods [-]."""

_EVEN: Final = 0.8
"""Mean cosine of the times between changes on the circle of their period above which they come by a
clock [-]: 1 where they do, 0.86 for rows at 4.8 times its rate, and below 0.5 for a coarse signal
that changes when it will."""

_SLOW: Final = 0.4
"""Renewed at longer times, a signal is late enough to say so [s]."""


def renewed(time: Floats, changed: Bools) -> tuple[Bools, float]:
    """Find the samples that are new where a slower source is repeated until it is renewed.

    A source that is renewed by a clock of its own changes at multiples of its period only; a coarse
    signal that stays changes at any time.

    Parameters
    ----------
    time : (n,) stamps, rising [s]
    changed : (n,) the value differs from the one before

    Returns
    -------
    new : (n,) all True where each sample may be new
    period : of the renewal [s]; 0 where each sample may be new
    """
    every = np.ones(time.size, dtype=bool)
    first = np.flatnonzero(changed)
    if first.size < SOME or first.size > _OFTEN * time.size:
        return every, 0.0
    between = np.diff(time[first])
    shortest = float(np.percentile(between, 5.0))
    if shortest < _SHORTEST * float(np.median(np.diff(time))):
        return every, 0.0
    near = between[between < 5.5 * shortest]
    period = float(np.mean(near[near < 1.5 * shortest]))
    period = float(np.sum(near) / np.sum(np.round(near / period)))
    if float(np.mean(np.cos(2.0 * np.pi * near / period))) < _EVEN:
        return every, 0.0
    run = np.maximum(np.searchsorted(first, np.arange(time.size), side="right") - 1, 0)
    since = time - time[first[run]]
    # In the middle between two stamps a renewal that changes nothing is not missed.
    half = 0.5 * float(np.median(np.diff(time)))
    number = np.floor((since + half) / period).astype(np.int64)
    new = np.concatenate(([True], (number[1:] != number[:-1]) | changed[1:]))
    return np.asarray(new), period


def without_repeats(drive: Drive) -> Drive:
    """Keep of each signal the samples that are new; see `renewed`.

    Signals that a person vouches for (``drive.info.trusted``) stay as they are.
    """
    together: dict[tuple[str, bytes, int], list[Signal]] = {}
    for name, signal in drive.signals.items():
        if len(signal) < 2 or name in drive.info.trusted:
            continue
        table = QUANTITIES[name].table
        span = signal.time[[0, -1]].tobytes() if table in DEVICES else b""
        together.setdefault((table if span else name, span, len(signal)), []).append(signal)
    kept: list[Signal] = []
    problems: list[Problem] = []
    for signals in together.values():
        time = signals[0].time
        changed = np.zeros(time.size, dtype=bool)
        changed[0] = True
        for signal in signals:
            changed[1:] |= signal.values[1:] != signal.values[:-1]
        new, period = renewed(time, changed)
        if period == 0.0:
            continue
        clock = time[new]
        kept += [Signal(s.name, clock, s.values[new]) for s in signals]
        if period > _SLOW and len(signals) == 1:
            name = signals[0].name
            problems.append(
                Problem.of("range.repeats", name, period=signals[0].period, renewed=period)
            )
    return drive.with_signals(*kept).with_problems(*problems) if kept else drive
