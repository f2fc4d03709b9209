"""Plausibility of a drive: wrong units, stuck or swapped signals, clocks that disagree.

A serious problem is one that would make a mass wrong without any other sign;
`weigh` refuses then. Thresholds leave room for real sensors: what a sane drive
can show never counts as serious.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

from weighbridge.checks.clocks import check_long_gaps, check_overlap, check_pauses, check_rates
from weighbridge.checks.engine import check_engine_speed, check_friction, check_whole_torque
from weighbridge.checks.frozen import check_frozen, check_limit
from weighbridge.checks.inertial import check_imu
from weighbridge.checks.speed import check_scales
from weighbridge.checks.travel import check_sign, check_standstill
from weighbridge.checks.values import check_load, check_pressure, check_range, check_stuck
from weighbridge.checks.vehicle import check_vehicle
from weighbridge.signals import Drive, Problem
from weighbridge.vehicle.model import Vehicle

__all__ = ["check_drive"]

_Check = Callable[[Drive, "Vehicle | None"], Iterator[Problem]]

_CHECKS: Final[tuple[_Check, ...]] = (
    check_rates,
    check_overlap,
    check_long_gaps,
    check_pauses,
    check_stuck,
    check_frozen,
    check_limit,
    check_load,
    check_pressure,
    check_whole_torque,
    check_friction,
    check_engine_speed,
    check_sign,
    check_scales,
    check_imu,
    check_vehicle,
    check_range,
    check_standstill,
)


def check_drive(drive: Drive, vehicle: Vehicle | None = None) -> tuple[Problem, ...]:
    """Look for what cannot be so in a drive.

    Parameters
    ----------
    drive : the drive as read
    vehicle : its gearings help to judge the speed's unit

    Returns
    -------
    What was found, serious problems first. The drive's own ``problems`` (from
    reading it) are not repeated. What is wrong with a signal that a person vouches for
    (``drive.info.trusted``) is never serious.
    """
    problems = [
        replace(p, serious=False) if p.signal in drive.info.trusted else p
        for check in _CHECKS
        for p in check(drive, vehicle)
    ]
    return tuple(sorted(problems, key=lambda p: not p.serious))
