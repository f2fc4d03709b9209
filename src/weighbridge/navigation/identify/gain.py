"""The accelerometer's scale along the vehicle, by what the speed changes by."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.constants import GRAVITY, INDEPENDENT, SAMPLES_AT_ONCE
from weighbridge.limits import FEWEST_BLOCKS, MOVES, SURE
from weighbridge.navigation.axes import Axes
from weighbridge.navigation.identify.steps import fitted
from weighbridge.navigation.motion import Motion
from weighbridge.signals import Floats, Signal, moving_mean, resolution, spread

_STEP: Final = 0.25
"""Faster speeds are thinned to it [s]."""

_SPAN: Final = 6.0
"""Changes of the speed are compared over so long [s]: over less its rounding counts, over more the
filter takes an error of the scale for grade."""

_LEVEL: Final = 30.0
"""Means over so long are taken off: they are grade and bias [s]."""

_SURE_TWICE: Final = 2.0
"""The same where gravity shows the scale too [-]."""

_LEAST: Final = 0.012
"""A smaller error of the scale is left [-]: undamaged simulated drives of five vehicles showed up
to 0.009, and the mass is off by the same share."""

_LEFT: Final = 0.002
"""What is left of an error that was found, above which a further round is worth it [-]."""

_MOST: Final = 0.35
"""A larger one is another fault's [-]."""

_BY_SQUAT: Final = 0.12
"""A smaller error of the scale may be one of the squat instead, which gyro and heights find [-]: it
passed for up to 0.080 in 120 undamaged drives of twenty vehicles of the second model, and a mass
that was corrected by it came out 12 % heavy. It is believed where gravity, which the same sensor
reads, shows it too."""

_UNUPHELD: Final = 0.03
"""Standard deviation of a scale that gravity does not show, for a part of it may be squat [-]."""

_GRAVITY_OFF: Final = 0.045
"""Gravity is read so much off by a scale [-]; biases of 0.15 m/s^2 make 0.015 of it, and a large
one beside an error of the squat would pass for a scale."""

_VARIES: Final = 0.02
_GRAVITY_VARYING: Final = 0.025
"""Where what is read of gravity varies by so much over the drive [-], it is no bias, and a smaller
error shows."""

_SHARE: Final = (0.35, 2.0)
"""Share of gravity's error that the speed shows [-]: 0.5 to 0.9 where it is the scale, for the
filter takes the rest for grade."""

_SHORT: Final = 3.0
_LONG: Final = 12.0
_SMOOTHED: Final = 1.7
"""A scale is off alike over `_SHORT` and over `_LONG` [s], 0.9 to 1.3 times in four vehicles; a
speed that is smoothed over 0.7 to 3 s by 2.0 to 3.4 times."""

_CHANGE_SURE: Final = 25.0
"""Squared error that a change of the scale must explain, over its variance [-]."""

_FLOOR: Final = 0.005
"""No block shows its scale better than so [-]."""


@dataclass(frozen=True, slots=True)
class Gain:
    """Specific force along the vehicle per rate of change of its speed, over time.

    Attributes
    ----------
    time, value : (k,) instants [s] and gain at them [-]; linear between them, even outside
    std : standard deviation of its mean [-]
    sure : it is the sensor's scale; else it may be an error of the squat, or a speed that is
        smoothed
    """

    time: Floats
    value: Floats
    std: float
    sure: bool = True

    @property
    def off(self) -> float:
        """Largest distance from 1 [-]."""
        return float(np.max(np.abs(self.value - 1.0)))

    def at(self, time: Floats) -> Floats:
        """Return the gain (n,) at the instants [-]."""
        return np.interp(time, self.time, self.value)


def gravity_read(time: Floats, accel: Axes) -> tuple[Floats, Floats]:
    """Return what an accelerometer reads of gravity, as means over blocks of a minute.

    Parameters
    ----------
    time : (n,) [s]
    accel : specific force [m/s^2]

    Returns
    -------
    time : (k,) of the blocks [s]
    part : (k,) of gravity [-]
    """
    starts = _starts(time)
    count = np.diff(np.append(starts, time.size))
    sums = np.column_stack([np.add.reduceat(x, starts) for x in accel.columns])
    mean = sums / count[:, None]
    part = np.linalg.norm(mean, axis=1) / GRAVITY
    return np.add.reduceat(time, starts) / count, part


def _starts(time: Floats) -> NDArray[np.intp]:
    """First sample of each block of a minute that has any; looks at a part after another."""
    found = [np.zeros(1, dtype=np.intp)]
    for first in range(0, time.size, SAMPLES_AT_ONCE):
        block = np.floor((time[first : first + SAMPLES_AT_ONCE + 1] - time[0]) / INDEPENDENT)
        found.append(first + 1 + np.flatnonzero(np.diff(block)))
    return np.concatenate(found)


def find_gain(
    motion: Motion, speed: Signal, gravity: tuple[Floats, Floats], *, again: bool = False
) -> Gain | None:
    """Find the scale of the accelerometer along the vehicle where it is off.

    Changes of the speed are regressed on the integral of the acceleration over the same time.
    The integral has next to no noise, the speed that of its rounding.

    Parameters
    ----------
    motion : found with the scale as it is
    speed : of the wheels, as recorded
    gravity : of `gravity_read`
    again : an error was found and corrected before, and this is what is left of it

    Returns
    -------
    None where the scale is right, or where the drive does not say.
    """
    pairs = changes_of_speed(motion, speed, _SPAN)
    if pairs is None:
        return None
    time, force, shown = pairs
    block = ((time - time[0]) / INDEPENDENT).astype(np.int64)
    square = np.bincount(block, force**2)
    common = np.bincount(block, force * shown)
    strong = square > 0.05 * float(np.max(square))
    square, common = square[strong], common[strong]
    at = np.bincount(block, time)[strong] / np.bincount(block)[strong]
    if at.size < FEWEST_BLOCKS:
        return None
    # Weighed by what each block shows, so that quiet ones do no harm.
    inverse, weight = common / square, square / float(np.mean(square))
    mean = float(common.sum() / square.sum())
    curve = np.full(2, mean)
    ends = at[[0, -1]]
    step = fitted(at, inverse, weight, _FLOOR, like=1.0) if at.size >= 2 * FEWEST_BLOCKS else None
    if step is not None and step.sureness > _CHANGE_SURE and abs(step.size) > _LEAST:
        half = 0.5 * max(step.length, 1.0)
        ends = np.array([step.center - half, step.center + half])
        curve = step.level + np.array([0.0, step.size])
    inverse_then = np.interp(at, ends, curve)
    left = weight * (inverse - inverse_then)
    std = float(np.sqrt(left @ left * at.size / (at.size - 1))) / float(weight.sum())
    off = np.abs(1.0 / inverse_then - 1.0)
    error = (np.interp(time, ends, curve) * force - shown) ** 2
    # Noise of the force passes for scale; that of the speed's rounding, of two ends, does not.
    rounding = resolution(speed.values) ** 2 / 6.0
    noise = max(float(np.mean(error)) - rounding, 0.0) / float(np.mean(shown**2))
    found = Gain(ends, 1.0 / curve, std)
    upheld = not again and _upheld(found, gravity)
    least = _LEFT if again else max(_LEAST, (_SURE_TWICE if upheld else SURE) * std)
    if float(np.average(off, weights=weight)) < least + noise or float(np.max(off)) > _MOST:
        return None
    if again or upheld:
        return found
    if _smoothed(motion, speed):
        return None
    sure = float(np.max(off)) > _BY_SQUAT
    return replace(found, sure=sure, std=float(np.hypot(std, _UNUPHELD)))


def _upheld(gain: Gain, gravity: tuple[Floats, Floats]) -> bool:
    """Say whether gravity is read wrong too, and by about as much."""
    time, part = gravity
    sides = (time <= gain.time[0], time >= gain.time[1])
    if gain.value[0] == gain.value[1] or not all(s.any() for s in sides):
        sides = (np.ones(time.size, dtype=bool),) * 2
    worst = int(np.argmax(np.abs(gain.value - 1.0)))
    felt = float(np.median(part[sides[worst]])) - 1.0
    low, high = _SHARE
    varies = float(np.ptp(np.percentile(part, [10.0, 90.0]))) > _VARIES
    return (
        abs(felt) > (_GRAVITY_VARYING if varies else _GRAVITY_OFF)
        and low < float(gain.value[worst] - 1.0) / felt < high
    )


def _smoothed(motion: Motion, speed: Signal) -> bool:
    """Say whether the speed lacks what is fast in it: then the scale is not off."""
    off = []
    for span in (_SHORT, _LONG):
        pairs = changes_of_speed(motion, speed, span)
        if pairs is None:
            return False
        _, force, shown = pairs
        off.append(abs(float(force @ force / (force @ shown)) - 1.0))
    return off[0] > _SMOOTHED * off[1]


def changes_of_speed(
    motion: Motion, speed: Signal, span: float
) -> tuple[Floats, Floats, Floats] | None:
    """Compare changes of the speed by the accelerometer with those that are shown.

    Parameters
    ----------
    motion : whose acceleration is summed
    speed : of the wheels, as recorded
    span : over which the speed changes [s]

    Returns
    -------
    time : (n,) middles of the spans, which overlap [s]
    force, shown : (n,) changes by the one and by the other, less their means around [m/s]
    None where too few spans are whole.
    """
    stride = max(1, round(_STEP / speed.period))
    stamps = speed.time[::stride] - motion.speed_delay
    values = speed.values[::stride] / (motion.speed_scale or 1.0)
    period = float(np.median(np.diff(stamps))) if stamps.size > 1 else math.inf
    ahead = round(span / period)
    if ahead < 2 or stamps.size < 4 * ahead:
        return None
    clock = float(motion.time[1] - motion.time[0])
    total = np.concatenate(([0.0], np.cumsum(0.5 * (motion.accel[1:] + motion.accel[:-1]))))
    total *= clock
    place = np.clip(np.searchsorted(motion.time, stamps), 0, motion.time.size - 1)
    useless = ~motion.valid | (motion.speed < MOVES)
    lost = np.concatenate(([0], np.cumsum(useless)))[place]
    force = np.interp(stamps, motion.time, total)
    whole = lost[ahead:] == lost[:-ahead]
    whole &= np.abs(stamps[ahead:] - stamps[:-ahead] - span) < 0.5
    whole &= (stamps[:-ahead] > motion.time[0]) & (stamps[ahead:] < motion.time[-1])
    width = max(3, round(_LEVEL / period))
    share = moving_mean(whole.astype(np.float64), width, "constant")

    def change(y: Floats) -> Floats:
        step = np.where(whole, y[ahead:] - y[:-ahead], 0.0)
        mean = moving_mean(step, width, "constant") / np.maximum(share, 1e-9)
        return np.asarray(step - mean)

    by_force, by_speed = change(force), change(values)
    use = whole & (share > 0.8)
    if use.sum() < 4 * ahead:
        return None
    error = np.abs(by_force - by_speed)
    use &= error < 6.0 * spread(error[use]) + 0.1
    return (0.5 * (stamps[ahead:] + stamps[:-ahead]))[use], by_force[use], by_speed[use]
