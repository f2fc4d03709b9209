"""Are values possible, alive and in the unit their name says?"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from weighbridge.checks.needed import MOTION, moves, needed, of_torque, show
from weighbridge.signals import QUANTITIES, Drive, Problem
from weighbridge.signals.catalogue import IMU_SIGNALS
from weighbridge.vehicle import Vehicle

_PERCENT: Final = (
    "engine_load",
    "engine_torque_fraction",
    "indicated_torque_fraction",
    "demanded_torque",
    "absolute_load",
    "throttle",
    "accelerator_pedal",
    "relative_pedal",
)
"""Signals in percent that a drive takes far beyond `_LEAST_PERCENT`."""

# No drive that gets anywhere stays below: 0 to 1 under a percent name ends near 1 %, of a torque
# with its boost below 2 %.
_LEAST_PERCENT: Final = 0.02

_RETARDS: Final = 0.05
"""Retarder torque over its reference that is no noise about zero [-]."""


def check_stuck(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find signals that never change."""
    moving = moves(drive)
    made_of, judged = needed(drive, vehicle), MOTION | of_torque()
    for s in drive.signals.values():
        if s.name not in judged or s.name == "grade" or len(s) < 50 or s.duration < 20.0:
            continue
        value = float(s.values[0])
        if bool(np.all(s.values == value)):
            standing = s.name in ("vehicle_speed", "gnss_speed", "latitude", "longitude")
            if (standing or s.name not in IMU_SIGNALS) and not moving:
                continue
            if _along_an_axis(drive, s.name):
                continue
            yield Problem.of(
                "range.stuck", s.name, serious=s.name in made_of, value=show(s.name, value)
            )


def _along_an_axis(drive: Drive, name: str) -> bool:
    """Say whether the course lets a latitude or longitude stay, as on a road due east."""
    part = {"latitude": np.cos, "longitude": np.sin}.get(name)
    course = drive.get("gnss_course")
    if part is None or course is None or not len(course):
        return False
    return bool(np.percentile(np.abs(part(course.values)), 90) < 0.02)


def check_load(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find parts of one under a percent name."""
    if not moves(drive):
        return
    made_of = needed(drive, vehicle)
    for name in _PERCENT:
        s = drive.get(name)
        if s is None or len(s) < 50:
            continue
        highest = float(np.max(np.abs(s.values)))
        if 0.0 < highest <= _LEAST_PERCENT and np.unique(s.values).size > 5:
            column = QUANTITIES[name].stem
            yield Problem.of(
                "range.ratio",
                name,
                serious=name in made_of,
                highest=100 * highest,
                full="1" if highest <= 0.0102 else f"{100 * highest:.2f}",
                column=column,
            )


def check_retarder(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find a retarder's torque that counts braking positive: its rows would pass for unbraked."""
    s = drive.get("retarder_torque")
    if s is None or not len(s):
        return
    if float(np.min(s.values)) < 0.0 or float(np.max(s.values)) < _RETARDS:
        return
    yield Problem.of(
        "retarder.sign", s.name, serious=True, value=show(s.name, float(np.max(s.values)))
    )
