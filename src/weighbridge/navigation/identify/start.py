"""The first state of the navigation filter."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.kernels.ins_model import (
    BA,
    BG,
    E_ATT,
    E_BA,
    E_BG,
    E_LEVER,
    E_PITCH0,
    E_SCALE,
    E_SQUAT,
    E_V,
    E_YAW0,
    ERRORS,
    LAST,
    LEVER,
    PITCH0,
    SCALE,
    SQUAT,
    STATES,
    TIME,
    YAW0,
    P,
    Q,
    V,
)
from weighbridge.kernels.rotation import euler_to_matrix, euler_to_quaternion, rotate_body
from weighbridge.navigation.aiding import Fixes
from weighbridge.navigation.identify.alignment import Alignment
from weighbridge.navigation.settings import NavigationSettings
from weighbridge.navigation.state import State
from weighbridge.signals import Bools, Floats

_LEVEL_TIME = 2.0
"""The first level is that of the first seconds [s]."""

_RECTIFIED = 120.0
"""Without rest, pitch and roll are taken to come back to where they were in so long [s]."""


class Begin(NamedTuple):
    """Low-passed samples of a drive, in body axes, for its first state.

    Attributes
    ----------
    time : (n,) even [s]
    accel, gyro : (n, 3) [m/s^2, rad/s]
    speed : (n,) NaN where unknown [m/s]
    rest : (n,) the body rests
    """

    time: Floats
    accel: Floats
    gyro: Floats
    speed: Floats
    rest: Bools


def first_state(
    begin: Begin, aligned: Alignment, fixes: Fixes | None, settings: NavigationSettings,
    free_scale: bool,
) -> State:  # fmt: skip
    """Set the first state: level and speed from the first seconds, heading from GNSS.

    Parameters
    ----------
    begin : of the whole drive
    aligned : sensor axes and their uncertainty
    fixes : of GNSS
    settings : priors
    free_scale : the scale of the indicated speed is not known
    """
    x, std = np.zeros(STATES), np.zeros(ERRORS)
    known = np.isfinite(begin.speed) & np.isfinite(begin.accel).all(axis=1)
    x[TIME] = math.nan
    x[SCALE] = 1.0
    x[LAST : LAST + 3] = begin.gyro[int(np.argmax(np.isfinite(begin.gyro).all(axis=1)))]
    _set_constants(x, std, aligned, settings, free_scale)
    bias, bias_std = _gyro_bias(begin, known, aligned.yaw_rate_bias, settings)
    x[BG : BG + 3] = bias

    # level of the first seconds: what is left of specific force without what speed and
    # turning explain
    period = float(begin.time[1] - begin.time[0])
    place = int(np.argmax(known)) if known.any() else 0
    head = slice(place, place + max(4, round(_LEVEL_TIME / period)))
    f = np.nanmean(begin.accel[head], axis=0)
    v = begin.speed[head]
    rate = 0.0
    if np.isfinite(v).sum() > 3:
        ok = np.isfinite(v)
        rate = float(np.polyfit(begin.time[head][ok], v[ok], 1)[0])
    v0 = float(np.nan_to_num(begin.speed[place]))
    turn = float(np.nanmean(begin.gyro[head, 2]) - bias[2]) * v0
    pitch = math.asin(float(np.clip((f[0] - rate) / GRAVITY, -0.3, 0.3)))
    roll = math.asin(float(np.clip(-(f[1] - turn) / GRAVITY, -0.3, 0.3)))
    heading, heading_std = _first_heading(
        begin.time, begin.gyro[:, 2] - bias[2], begin.speed, fixes
    )
    x[Q : Q + 4] = euler_to_quaternion(roll, pitch, heading)
    x[V] = v0 * math.cos(heading)
    x[V + 1] = v0 * math.sin(heading)
    if fixes is not None:
        x[P : P + 2] = fixes.ned[0, :2]
        gone = min(float(fixes.time[0]) - float(begin.time[0]), 30.0)
        std[0:2] = 10.0 + v0 * max(gone, 0.0)
        std[2] = 10.0
    else:
        std[0:3] = 0.1
    if fixes is None or not fixes.has_height:
        std[2] = 0.1
    std[E_V : E_V + 2] = 0.5 + 0.1 * v0
    std[E_V + 2] = 0.3 + 0.05 * v0
    std[E_ATT : E_ATT + 2] = 0.02 if v0 < 0.1 else 0.03
    std[E_ATT + 2] = heading_std
    std[E_BA : E_BA + 3] = settings.accel_bias_std
    std[E_BG : E_BG + 3] = bias_std
    return State(x, np.diag(std**2))


def _set_constants(
    x: Floats, std: Floats, aligned: Alignment, settings: NavigationSettings, free_scale: bool
) -> None:
    """Set mounting, squat, scale of the speed and lever, and their standard deviations."""
    given = aligned.given
    x[SQUAT] = settings.squat
    std[E_SQUAT] = settings.squat_std
    if given is not None and given.squat is not None:
        x[SQUAT] = given.squat
        std[E_SQUAT] = max(given.squat_std or 0.0, 2e-4)
    coarse_std = settings.mounting_std if given is None else 0.0
    std[E_PITCH0] = math.hypot(aligned.tilt_std, coarse_std)
    std[E_YAW0] = math.hypot(aligned.yaw_std, coarse_std)
    std[E_SCALE] = settings.speed_scale_std if free_scale else 1e-6
    x[LEVER], std[E_LEVER] = settings.lever, settings.lever_std


def _gyro_bias(
    begin: Begin, known: Bools, yaw_rate_bias: float, settings: NavigationSettings
) -> tuple[Floats, Floats]:
    """Find the gyro's bias from rest, and its standard deviation.

    Else pitch and roll come back to where they were, and the yaw rate follows from lateral force.
    """
    period = float(begin.time[1] - begin.time[0])
    std = np.full(3, settings.gyro_bias_std)
    if begin.rest.sum() * period > 2.0:
        rest = begin.rest & known
        bias = np.median(begin.gyro[rest], axis=0) if rest.any() else np.zeros(3)
        std[:] = 0.002
        return bias, std
    window = known & (begin.time < begin.time[0] + _RECTIFIED)
    span = max(1.0, float(window.sum() * period))
    bias = np.mean(begin.gyro[window], axis=0) if window.any() else np.zeros(3)
    std[:2] = min(0.03, 0.003 + 0.1 / span)
    bias[2] = yaw_rate_bias if math.isfinite(yaw_rate_bias) else 0.0
    std[2] = 0.02
    return bias, std


def _first_heading(
    grid: Floats, yaw_rate: Floats, speed: Floats, fixes: Fixes | None
) -> tuple[float, float]:
    """Find the first heading by turning a dead-reckoned track onto the first fixes.

    The paper takes the chord of two fixes (sec. 7.1), which fails in bends.
    """
    if fixes is None:
        return 0.0, 0.05
    period = float(grid[1] - grid[0])
    v = np.nan_to_num(speed)
    heading = np.cumsum(np.nan_to_num(yaw_rate)) * period
    track = np.cumsum(v * np.exp(1j * heading)) * period
    travelled = np.cumsum(v) * period
    begin = int(np.searchsorted(grid, fixes.time[0]))
    if begin >= grid.size:
        return 0.0, math.pi
    end = int(np.searchsorted(travelled, travelled[begin] + 60.0))
    end = min(max(end, begin + 1), grid.size - 1)
    use = (fixes.time >= grid[begin]) & (fixes.time <= grid[end])
    if use.sum() < 2:
        return 0.0, math.pi
    t = fixes.time[use]
    seen = fixes.ned[use, 0] + 1j * fixes.ned[use, 1]
    dead = np.interp(t, grid, track.real) + 1j * np.interp(t, grid, track.imag)
    cross = np.sum((seen - seen.mean()) * np.conj(dead - dead.mean()))
    size = float(np.sqrt(np.sum(np.abs(dead - dead.mean()) ** 2)))
    if size < 1.0:
        return 0.0, math.pi
    return float(np.angle(cross)), min(0.1 + 3.0 / size, 1.0)


def restarted(rot_bs: Floats, start: State, end: State) -> tuple[Floats, State]:
    """Move the start to the constants a pass has found, uncertain as they were.

    The linearisation profits, and nothing is counted twice.

    Returns
    -------
    rot_bs : (3, 3) sensor to body axes
    start : in these axes
    """
    x, found = start.x.copy(), end.x
    # direction of travel in body axes is (1, yaw0, pitch0)
    turn = euler_to_matrix(0.0, float(found[PITCH0]), -float(found[YAW0]))
    x[SQUAT], x[SCALE], x[LEVER] = found[SQUAT], found[SCALE], found[LEVER]
    x[BG : BG + 3] = turn @ found[BG : BG + 3]
    x[BA : BA + 3] = turn @ found[BA : BA + 3]
    rotate_body(x[Q : Q + 4], 0.0, -float(found[PITCH0]), float(found[YAW0]))
    return turn @ rot_bs, State(x, start.cov)
