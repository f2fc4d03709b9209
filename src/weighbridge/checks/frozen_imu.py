"""Did an axis of the inertial sensor stop to read on the way, or is it at its limit?"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.navigation.frozen import frozen_stretches
from weighbridge.signals import Drive, Problem, Signal
from weighbridge.signals.catalogue import IMU_SIGNALS
from weighbridge.signals.instants import instant
from weighbridge.vehicle.model import Vehicle

_TOLD: Final = 5.0
"""Frozen for less in all is left out without a word [s]."""

_AT_LIMIT: Final = 0.05
"""With a larger part of its samples at one extreme value an axis is clipped [-]."""

_LEAST: Final = 120.0
"""What is left must be as long to show how the sensor sits and what moved [s]."""


def check_frozen(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Name the frozen stretches of the inertial axes, which navigation leaves out.

    Serious only where too little is left.
    """
    speed = drive.speed
    alike: dict[bytes, list[str]] = {}
    for name in IMU_SIGNALS:
        s = drive.get(name)
        if s is None or len(s) < 50 or s.duration < 20.0 or not np.any(s.values != s.values[0]):
            continue
        stretches = frozen_stretches(s, speed)
        if float(np.sum(stretches[:, 1] - stretches[:, 0])) >= _TOLD:
            alike.setdefault(np.round(stretches).tobytes(), []).append(name)
    for names in alike.values():
        yield _told(names, drive.signals[names[0]], speed)


def _told(names: list[str], axis: Signal, speed: Signal | None) -> Problem:
    """Tell of axes that froze together, such as ``axis``."""
    stretches = frozen_stretches(axis, speed)
    lengths = stretches[:, 1] - stretches[:, 0]
    total = float(lengths.sum())
    k = int(np.argmax(lengths))
    verb = "repeats" if len(names) == 1 else "repeat"
    since = instant(stretches[k, 0])
    who = f"{', '.join(names)} {verb} one value"
    if set(names) == set(IMU_SIGNALS):
        who = "the inertial sensor repeats its values"
    text = f"{who} for {lengths[k]:.1f} s from {since}"
    if lengths.size > 1:
        text += f", and in {lengths.size} stretches for {total:.1f} s in all"
    left = axis.duration - total
    too_little = left < min(_LEAST, 0.5 * axis.duration)
    remedy = (
        f"only {left:.0f} s are left: record it again, or leave its columns out"
        if too_little
        else "the inertial sensor is left out there"
    )
    return Problem(names[0], f"{text}; {remedy}", serious=too_little)


def check_limit(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find an accelerometer whose range is too small for gravity and the road's shaking."""
    for name in IMU_SIGNALS[:3]:
        s = drive.get(name)
        if s is None or len(s) < 50:
            continue
        for limit in (float(s.values.min()), float(s.values.max())):
            share = float(np.mean(s.values == limit))
            if _AT_LIMIT < share < 0.9 and 0.5 * GRAVITY < abs(limit) < 2.0 * GRAVITY:
                yield Problem(
                    name,
                    f"{name} lies at {limit:.4g} m/s^2, its extreme, in {100.0 * share:.0f} % of "
                    "the samples: its range is too small and its mean is bent; record it with a "
                    "range of 2 g or more",
                    serious=True,
                )
