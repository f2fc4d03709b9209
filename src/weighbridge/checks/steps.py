"""Steps of the torque's reading: those in which the control unit sent it in the calibration?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np

from weighbridge.balance.disagreement import Finding
from weighbridge.checks.needed import show
from weighbridge.messages import phrase
from weighbridge.signals import UNITS, Drive, Floats, Problem, resolution
from weighbridge.signals.instants import span
from weighbridge.vehicle import Vehicle

SAME: Final = 0.003
"""Steps that differ by less are the same [-]: what is written with few digits."""

FARTHEST: Final = 1.9
"""Steps this factor wider are those of another logger, which rounds more; as much finer, they are
no steps any more [-]."""

NEAR: Final = 0.1
"""Part of a step within which a value lies on it [-]: of any values a fifth do."""

OFF: Final = 0.5
"""Part of the values on the steps below which they are none of the values' [-]: false cells are
few."""

FEWEST: Final = 500
"""Fewer samples show no steps."""

PARTS: Final = 8
"""A drive is looked at in so many parts at most."""

FEWEST_OF_PART: Final = 250
"""Samples of a part at least: of random values 0.2 +- 0.03 lie on steps then [-]."""

IN_A_ROW: Final = 2
"""So many parts off the steps, one after another, are no chance."""

MATTERS: Final = 0.03
"""A factor farther from one moves a mass by more than weighing is worth [-]: there is no mass
then, unless a second signal of the torque agrees with the reading."""


def reading_step(values: Floats) -> float:
    """Step in which a reading was sent [SI], 0 where none shows."""
    return resolution(values) if values.size >= FEWEST else 0.0


def check_steps(
    drive: Drive, vehicle: Vehicle | None, witnesses: Sequence[Finding] = ()
) -> Iterator[Problem]:
    """Compare the steps of the torque's reading with those of the calibration.

    A control unit sends whole steps. Where they are others, the reading was multiplied after it was
    sent: by the factor of a mapping, a DBC or an app, or by a unit. Where it lies between them, it
    was filtered or worked out anew. What the control unit itself reads wrong has steps as before.

    Parameters
    ----------
    drive, vehicle
    witnesses : what the second signals of the torque say of the reading
    """
    known = None if vehicle is None else vehicle.torque.reading_step
    if vehicle is None or known is None:
        return
    name = vehicle.torque.of_source.found(drive)[0]
    signal = drive.get(name)
    if signal is None or len(signal) < FEWEST:
        return
    first, last = _off_steps(signal.values, known)
    if last == first:
        return
    step = reading_step(signal.values[first:last])
    ratio = step / known
    part = last - first < len(signal)
    begin, end = np.round(signal.time[[first, last - 1]])
    at: dict[str, Any] = {"start": float(begin), "end": float(end)} if part else {}
    quoted: dict[str, Any] = {
        "known": show(name, known),
        "when": phrase("from_span", span=span(float(begin), float(end))) if part else "",
    }
    if ratio < 1.0 / FARTHEST:
        yield Problem.of("torque.steps_filtered", name, **at, **quoted)
    elif abs(ratio - 1.0) > SAME and ratio < FARTHEST:
        unit = _unit(ratio) if name == "engine_torque" else ""
        serious = abs(ratio - 1.0) > MATTERS and not _cleared(ratio, witnesses)
        yield Problem.of(
            "torque.steps",
            name,
            **at,
            **quoted,
            serious=(serious or bool(unit)) and name not in drive.info.trusted,
            step=show(name, step),
            ratio=ratio,
            unit=unit,
            settled=phrase("settled") if serious else "",
        )


def _cleared(ratio: float, witnesses: Sequence[Finding]) -> bool:
    """Say whether a second signal has the reading nearer to what it was than to so much of it."""
    return any(
        f.verdict == "agrees" and abs(f.scale - 1.0) < abs(f.scale - ratio) for f in witnesses
    )


def _off_steps(values: Floats, step: float) -> tuple[int, int]:
    """First and last sample, exclusive, from and to which values lie on no steps."""
    if _on_steps(values, step) <= OFF:
        return 0, values.size
    parts = min(PARTS, values.size // FEWEST_OF_PART)
    if parts <= IN_A_ROW:
        return 0, 0
    edges = np.linspace(0, values.size, parts + 1).astype(int)
    off = [_on_steps(values[a:b], step, FEWEST_OF_PART // 2) <= OFF for a, b in pairwise(edges)]
    best = (0, 0)
    begin = 0
    for k, is_off in enumerate([*off, False]):
        if is_off:
            continue
        if k - begin >= max(IN_A_ROW, best[1] - best[0] + 1):
            best = (begin, k)
        begin = k + 1
    return int(edges[best[0]]), int(edges[best[1]])


def _on_steps(values: Floats, step: float, fewest: int = FEWEST) -> float:
    """Part of the values that lie on the steps [-]; zeros lie on any."""
    place = values[values != 0.0] / step
    if place.size < fewest:
        return 1.0
    return float(np.mean(np.abs(place - np.rint(place)) < NEAR))


def _unit(ratio: float) -> str:
    """Which unit a torque is in or is taken for, in words; empty where it is none."""
    if abs(ratio * UNITS["lbft"].factor - 1.0) < SAME:
        return phrase("as_pound_feet")
    if abs(ratio / UNITS["lbft"].factor - 1.0) < SAME:
        return phrase("as_newton_metres")
    return ""
