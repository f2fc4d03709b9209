"""Digits of the accelerometer that are cut off towards zero."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.limits import MANY, MOVES
from weighbridge.signals import Bools, Drive, Floats, Problem, Signal, resolution
from weighbridge.signals.catalogue import IMU_SIGNALS
from weighbridge.signals.interpolation import interpolate

COARSEST_CUT: Final = 0.12
"""Steps up to which half a digit corrects what was cut off [m/s^2]: it leaves 0.3 to 0.6 % of the
mass at 0.1 m/s^2, 2 to 4 % at 0.2 m/s^2. Uncorrected, 0.1 m/s^2 made masses 11 to 15 % heavy."""

TWICE: Final = 1.6
"""Samples at zero over the mean of both neighbours from which its step is twice as wide [-]: 1.8 to
2.7 where digits are cut, 1.1 at most where they are rounded."""

FLAT: Final = 1.8
"""Samples at the first steps over those at the second ones: more are a peak of their own [-]."""


def with_half_digits(drive: Drive) -> Drive:
    """Add half a digit to an accelerometer whose digits are cut off towards zero.

    Such digits make every push smaller by half a digit, whichever way it goes: the sensor is dead
    about zero. It shows in a step at zero that is twice as wide as the others.
    """
    axes = [s for name in IMU_SIGNALS[:3] if (s := drive.get(name)) is not None and len(s) > MANY]
    steps = {s.name: resolution(s.values) for s in axes}
    step = float(np.median(list(steps.values()))) if steps else 0.0
    if step <= 0.0:
        return drive
    alike = [s for s in axes if abs(steps[s.name] / step - 1.0) < 0.01]
    moving: dict[int, Bools] = {}
    for s in alike:
        if id(s.time) not in moving:
            moving[id(s.time)] = _moving(s.time, drive.speed)
    if not any(_cut(s.values[moving[id(s.time)]], step) for s in alike):
        return drive
    if step > COARSEST_CUT:
        return drive.with_problems(
            Problem.of("imu.digits_dead", "accel_x", step=step, serious=True)
        )
    more = (Signal(s.name, s.time, s.values + 0.5 * step * np.sign(s.values)) for s in alike)
    return drive.with_signals(*more).with_problems(
        Problem.of("imu.digits_cut", "accel_x", step=step)
    )


def _moving(time: Floats, speed: Signal | None) -> Bools:
    """Instants (n,) at which an axis may not rest at zero; all of them without a speed."""
    if speed is None or len(speed) < 2:
        return np.ones(time.size, dtype=bool)
    return np.asarray(interpolate(time, speed.time, np.abs(speed.values)) > MOVES)


def _cut(values: Floats, step: float) -> bool:
    """Say whether the step of an axis (n,) at zero is twice as wide as those beside it."""
    place = np.rint(values / step)
    second, first, zero, next_first, next_second = (
        np.count_nonzero(place == k) for k in (-2, -1, 0, 1, 2)
    )
    if min(first, next_first) < MANY:
        return False
    beside = first + next_first
    return bool(2.0 * zero > TWICE * beside and beside < FLAT * (second + next_second))
