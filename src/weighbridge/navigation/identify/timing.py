"""How late a speed signal is against the accelerometer."""

from __future__ import annotations

import math

import numpy as np

from weighbridge.kernels.interpolation import moved_changes
from weighbridge.signals import Floats, Signal
from weighbridge.signals.correlation import inner
from weighbridge.signals.lag import STEP, find_lag, lag_std_at

_SPAN = 1.5
"""Speed changes are compared over this time [s]: longer lets grade in, shorter noise."""


def estimate_speed_delay(
    time: Floats,
    forward: Floats,
    speed: Signal,
    *,
    low: float = -0.6,
    high: float = 1.6,
) -> tuple[float, float]:
    """Estimate the lateness of a speed signal by comparing its changes with integrated force.

    Changes of speed over a span are regressed on the integral of the forward
    specific force over the same span, moved by a trial delay; grade and bias are
    taken up by a slowly varying offset. The delay of the smallest residual
    is refined by a parabola.

    Parameters
    ----------
    time : (n,) instants of the forward specific force, even [s]
    forward : (n,) specific force along the vehicle [m/s^2]
    speed : the speed signal; resampled to at most 10 Hz
    low, high : delays tried first [s]

    Returns
    -------
    delay : stamp minus the instant the value was true [s]; 0 where the drive
        does not show it
    std : its standard deviation [s]; infinite where the drive does not show it
    """
    ok = np.isfinite(forward)
    if ok.sum() < 50 or len(speed) < 20:
        return 0.0, np.inf
    force = np.where(ok, forward, 0.0)
    step = np.diff(time)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * step)])
    holes = np.concatenate([[0.0], np.cumsum(~ok)])[: time.size]

    stride = max(1, round(0.1 / max(speed.period, 1e-3)))
    stamps, values = speed.time[::stride], speed.values[::stride]
    inside = (stamps > time[0] + 2 - low) & (stamps < time[-1] - 2 - high)
    stamps, values = stamps[inside], values[inside]
    if stamps.size < 20:
        return 0.0, np.inf
    ahead = max(1, round(_SPAN / float(np.median(np.diff(stamps)))))
    if stamps.size < 4 * ahead + 10:
        return 0.0, np.inf
    a, b = stamps[:-ahead], stamps[ahead:]
    change = values[ahead:] - values[:-ahead]
    span = b - a
    whole = (
        (span < 2.0 * _SPAN)
        & (np.interp(b, time, holes) - np.interp(a, time, holes) < 0.5)
        & ((values[ahead:] > 0.5) | (values[:-ahead] > 0.5))
    )
    if whole.sum() < 20 or np.std(change[whole]) < 0.05:
        return 0.0, np.inf
    width = max(3, 10 * ahead) | 1

    def high_passed(y: Floats) -> Floats:
        # the moving mean over about 15 s is grade and bias
        pad = np.pad(y, width // 2, mode="edge")
        total = np.concatenate([[0.0], np.cumsum(pad)])
        return np.asarray(y - (total[width:] - total[:-width]) / width)

    target = high_passed(np.where(whole, change, 0.0))[whole]

    def residual(delay: float) -> float:
        model = moved_changes(a, b, delay, time, integral, whole, width)
        gain = inner(model, target) / max(inner(model, model), 1e-12)
        left = target - gain * model if gain > 0.0 else target
        return inner(left, left)

    delay = find_lag(residual, low, high, farthest=high + STEP)
    if math.isnan(delay) or residual(delay) > 0.7 * inner(target, target):
        return 0.0, np.inf
    # Overlapping spans repeat the same noise.
    return delay, lag_std_at(residual, delay, target.size / ahead)
