"""Are the axes of the inertial sensor in SI, complete and right-handed?

Any fixed mounting is allowed: only what no rotation can explain is a problem.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from weighbridge.checks import windows
from weighbridge.constants import GRAVITY
from weighbridge.navigation.frozen import without_frozen
from weighbridge.signals import Bools, Drive, Floats, Problem, Signal, resolution
from weighbridge.signals.catalogue import IMU_SIGNALS
from weighbridge.vehicle import Vehicle

# Samples enough for a median; more would only take time.
_SAMPLES: Final = 20_000
# Long enough for fixes a metre off to show a bend [s].
_TURN_WINDOW: Final = 5.0
_WINDOW: Final = 2.0  # [s]
# Correlation of the turns by gyro and course from which one scale may part them [-].
_TURN_TOGETHER: Final = 0.5
# No road vehicle rolls or pitches by 11 degrees within 2 s: what turns faster, yaws [rad/s].
_YAWS: Final = 0.1
# Windows enough for a correlation of 0.3 to be no chance.
_MANY: Final = 150
_SOME: Final = 100
# Sane drives tie tilt and gravity by 0.3 to 0.8, quiet motorways by 0 to 0.3; a mirrored axis turns
# the sign. Of n windows that are tied by nothing the correlation scatters by about 1 / sqrt(n), the
# mean of two by less.
_AGAINST: Final = 0.12
_CHANCE: Final = 2.4

# A gyro of larger steps shows no tilt any more [rad/s]: rounded to 0.01 it does, cut to 0.02 not.
_COARSE_RATE: Final = 0.015

# Specific force per change of speed above which the speed is in another unit [-].
_STEEPEST: Final = 1.3


def check_imu(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Compare the inertial sensor with gravity, with the course and with itself."""
    drive = without_frozen(drive, IMU_SIGNALS)
    accel = _axes(drive, "accel")
    gyro = _axes(drive, "gyro")
    if gyro is not None and not any(np.ptp(s.values) > 0.0 for s in gyro):
        gyro = None  # It is stuck, and reported so.
    fine = True
    if accel is not None:
        for problem in _check_gravity(accel):
            fine = False
            yield problem
    if gyro is not None:
        for problem in _check_rate(drive, gyro):
            fine = False
            yield problem
    if not fine or accel is None or gyro is None:
        return
    yield from _check_axes(drive, accel, gyro)


def _axes(drive: Drive, kind: str) -> tuple[Signal, Signal, Signal] | None:
    x, y, z = (drive.get(f"{kind}_{a}") for a in "xyz")
    if x is None or y is None or z is None or min(len(x), len(y), len(z)) < 100:
        return None
    return x, y, z


def _norm(axes: tuple[Signal, Signal, Signal]) -> Floats:
    time = axes[0].time[:: max(1, len(axes[0]) // _SAMPLES)]
    norm = np.sqrt(sum(s.at(time) ** 2 for s in axes))
    return np.asarray(norm[np.isfinite(norm)])


def _check_gravity(accel: tuple[Signal, Signal, Signal]) -> Iterator[Problem]:
    norm = _norm(accel)
    usual = float(np.median(norm)) if norm.size else GRAVITY
    if 8.0 < usual < 12.0:
        return
    if 0.8 < usual < 1.25:
        which = "imu.accel_in_g"
    elif 78.0 < usual < 118.0:
        which = "imu.accel_in_mps2"
    elif usual < 3.0:
        which = "imu.no_gravity"
    else:
        which = "imu.gravity"
    yield Problem.of(which, "accel_x", usual=usual, gravity=GRAVITY, serious=True)


def _check_rate(drive: Drive, gyro: tuple[Signal, Signal, Signal]) -> Iterator[Problem]:
    norm = _norm(gyro)
    high = float(np.percentile(norm, 99.0)) if norm.size else 0.0
    if high > 4.0:
        yield Problem.of("imu.gyro_degrees", "gyro_x", serious=True, high=high)
        return
    turns = _turns(drive)
    if turns is None:
        return
    time, change = turns
    rate, full = _window_means(gyro, time)
    step = np.diff(time)
    turning = full & (np.abs(change) > np.radians(8.0)) & (np.abs(change) < np.radians(120.0))
    if np.count_nonzero(turning) < 5:
        return
    bias = np.median(rate[full], axis=0)
    angle = np.linalg.norm(rate - bias, axis=1) * step
    # Positions that scatter turn as well. Their turns are not the gyro's, so the gyro weights them.
    ratio = float(angle[turning] @ angle[turning] / (angle[turning] @ np.abs(change[turning])))
    if ratio > 15.0:
        unit, said = "deg/s", "gyro_x_degps"
    elif ratio < 1.0 / 15.0:
        unit, said = "rad/s", "gyro_x_radps"
    else:
        return
    if np.corrcoef(angle[full], np.abs(change[full]))[0, 1] < _TURN_TOGETHER:
        return
    yield Problem.of("imu.gyro_unit", "gyro_x", serious=True, ratio=ratio, unit=unit, column=said)


def _turns(drive: Drive) -> tuple[Floats, Floats] | None:
    """Changes of the course between windows in motion: edges [s], changes [rad]."""
    found = windows.track(drive, _TURN_WINDOW)
    if found is None or found[0].size < 10:
        return None
    time, north, east = found
    way = np.hypot(north, east) / np.diff(time)
    bearing = np.arctan2(east, north)
    change = (np.diff(bearing) + np.pi) % (2.0 * np.pi) - np.pi
    slow = (way[1:] < 4.0) | (way[:-1] < 4.0) | (np.diff(time)[1:] > 2.0 * _TURN_WINDOW)
    change[slow] = 0.0
    # The bearing of a piece holds at its middle.
    return 0.5 * (time[1:] + time[:-1]), change


def _window_means(axes: tuple[Signal, Signal, Signal], at: Floats) -> tuple[Floats, Bools]:
    out = np.empty((at.size - 1, 3))
    full = np.ones(at.size - 1, dtype=bool)
    for k, s in enumerate(axes):
        out[:, k], ok = windows.means(s, at)
        full &= ok
    return out, full


def _check_axes(
    drive: Drive, accel: tuple[Signal, Signal, Signal], gyro: tuple[Signal, Signal, Signal]
) -> Iterator[Problem]:
    """In a bend the lateral acceleration is speed times yaw rate, about one right-handed system."""
    speed = drive.speed
    turns = _turns(drive)
    sides: tuple[Signal, ...] = (*accel, *gyro)
    if speed is not None and len(speed) > 20:
        sides = (*sides, speed)
    start = max(float(s.time[0]) for s in sides)
    end = min(float(s.time[-1]) for s in sides)
    if end - start < 30 * _WINDOW:
        return
    at = windows.edges(start, end, _WINDOW)
    force, full = _window_means(accel, at)
    rate, ok = _window_means(gyro, at)
    full &= ok
    if np.count_nonzero(full) < 30:
        return
    down = -np.mean(force[full], axis=0)
    down /= np.linalg.norm(down)
    bias = np.median(rate[full], axis=0)
    found = _not_about_vertical(rate - bias, full, down)
    if found is None and turns is not None:
        found = _against_course(gyro, turns, bias, down)
    if found is None and speed is not None and len(speed) > 20:
        found = _against_speed(speed, at, force, rate, full, down)
        if found is not None and found.id == "imu.gyro_sign":
            step = max(resolution(s.values) for s in gyro)
            if step > _COARSE_RATE:
                found = Problem.of("imu.gyro_coarse", found.signal, step=step)
    if found is not None:
        yield found


def _not_about_vertical(rate: Floats, full: Bools, down: Floats) -> Problem | None:
    """Compare the axis of fast turns, of windows (n, 3), with the vertical."""
    turned = np.linalg.norm(rate, axis=1)
    fast = full & (turned > _YAWS)
    if np.count_nonzero(fast) < 4:
        return None
    upright = float(np.median(np.abs(rate[fast] @ down) / turned[fast]))
    if upright >= 0.6:
        return None
    return Problem.of("imu.axes_differ", "gyro_z", serious=True, upright=100.0 * upright)


def _against_course(
    gyro: tuple[Signal, Signal, Signal], turns: tuple[Floats, Floats], bias: Floats, down: Floats
) -> Problem | None:
    """Compare the turns by gyro with those of the course."""
    time, change = turns
    along, good = _window_means(gyro, time)
    yaw = (along - bias) @ down
    course_rate = change / np.diff(time)
    bend = good & (np.abs(change) > np.radians(8.0)) & (np.abs(change) < np.radians(120.0))
    if np.count_nonzero(bend) < 8:
        return None
    agreement = float(np.corrcoef(yaw[bend], course_rate[bend])[0, 1])
    if agreement < -0.6:
        return Problem.of("imu.gyro_against_course", "gyro_z", serious=True, agreement=agreement)
    size = np.linalg.norm(along - bias, axis=1)[bend]
    total = np.abs(course_rate[bend])
    upright = float(yaw[bend] @ course_rate[bend]) / float(size @ total)
    if upright >= 0.6 or not _alike(size, total):
        return None
    return Problem.of("imu.axes_differ_course", "gyro_z", serious=True)


def _against_speed(
    speed: Signal, at: Floats, force: Floats, rate: Floats, full: Bools, down: Floats
) -> Problem | None:
    """Compare the axes with the acceleration and the bends that the speed shows."""
    v, _ = windows.means(speed, at)
    near = (speed.age(at) < 1.0)[1:] & (speed.age(at) < 1.0)[:-1]
    accel_along = np.diff(speed.at(at)) / _WINDOW
    full = full & near & np.isfinite(v) & np.isfinite(accel_along)
    if np.count_nonzero(full) < 30:
        return None
    forward, agreement, slope = _forward(accel_along[full], force[full], down)
    # A speed in another unit would pass for gravity across the vehicle.
    if forward is None or agreement < 0.7 or slope > _STEEPEST:
        return None
    right = np.cross(down, forward)
    bias = np.median(rate[full], axis=0)
    centripetal = v[full] * ((rate[full] - bias) @ down)
    lateral = force[full] @ right
    seen = min(float(np.std(centripetal)), float(np.std(lateral))) >= 0.08
    agreement = float(np.corrcoef(lateral, centripetal)[0, 1]) if seen else 0.0
    if agreement < -0.6:
        return Problem.of("imu.axes_swapped", "accel_y", serious=True, agreement=agreement)
    usual, crossed, pitch = _ties(force, rate, full, forward, right)
    if crossed > 0.3 and crossed > 2.5 * usual:
        return Problem.of("imu.gyro_axes_swapped", "gyro_x", serious=True)
    against = -max(_AGAINST, _CHANCE / math.sqrt(max(int(np.count_nonzero(_inner(full))), 1)))
    felt = _tilt_tie(force @ forward - accel_along, rate @ right, full)
    if (0.5 * (pitch + felt) if pitch else felt) < against:
        return _mirrored("gyro_y", "nose down", "nose up")
    if _tilt_tie(v * ((rate - bias) @ down) - force @ right, rate @ forward, full) < against:
        return _mirrored("gyro_x", "right side down", "right side up")
    return None


def _inner(full: Bools) -> Bools:
    """Windows whose neighbours have no gap either (n - 2,)."""
    return np.asarray(full[1:-1] & full[2:] & full[:-2])


def _mirrored(name: str, said: str, felt: str) -> Problem:
    return Problem.of("imu.gyro_sign", name, said=said, felt=felt, serious=True)


def _tilt_tie(gravity: Floats, rate: Floats, full: Bools) -> float:
    """Correlate a rate of tilt with the change of what gravity adds to the specific force.

    Along the vehicle the specific force is acceleration and gravity times the sine of pitch, across
    it speed times yaw rate less gravity times the sine of roll, be it by the springs, a hill or the
    banking of a bend: what is left of it changes as the vehicle tilts.

    Parameters
    ----------
    gravity : (n,) specific force without the acceleration, of windows [m/s^2]
    rate : (n,) rate of tilt that makes it grow [rad/s]
    full : (n,) windows without gaps

    Returns
    -------
    1 at best; 0 where there are too few windows to judge
    """
    inner = _inner(full)
    if np.count_nonzero(inner) < _SOME:
        return 0.0
    change = (gravity[2:] - gravity[:-2])[inner]
    # Kerbs and gaps of the speed are no tilt.
    usual = np.abs(change) <= np.percentile(np.abs(change), 98.0)
    x, y = change[usual], rate[1:-1][inner][usual]
    if float(np.std(x)) < 0.02 or float(np.std(y)) < 1e-3:
        return 0.0
    return float(np.corrcoef(x, y)[0, 1])


def _ties(
    force: Floats, rate: Floats, full: Bools, forward: Floats, right: Floats
) -> tuple[float, float, float]:
    """Correlate roll and pitch rate with the change of force along and across the vehicle.

    Gravity and the springs tie pitch to what is felt along and roll to what is
    felt across, whatever the road. A nose that rises is always felt as force
    forward; how a roll is felt depends on the banking of the bends, see `_tilt_tie`.

    Returns
    -------
    usual, crossed : size of the ties as they should be, and with the axes swapped
    pitch : of pitch rate and force along
    All 0 where there are too few windows to judge.
    """
    inner = _inner(full)
    if np.count_nonzero(inner) < _MANY:
        return 0.0, 0.0, 0.0
    change = (force[2:] - force[:-2])[inner]
    turn = rate[1:-1][inner]

    def tie(axis: Floats, direction: Floats) -> float:
        a, b = turn @ axis, change @ direction
        spread = float(np.std(a) * np.std(b))
        return float(np.mean((a - a.mean()) * (b - b.mean()))) / spread if spread > 0.0 else 0.0

    pitch = tie(right, forward)
    usual = float(np.hypot(pitch, tie(forward, right)))
    return usual, float(np.hypot(tie(forward, forward), tie(right, right))), pitch


def _alike(a: Floats, b: Floats) -> bool:
    return float(np.corrcoef(a, b)[0, 1]) > 0.8


def _forward(accel: Floats, force: Floats, down: Floats) -> tuple[Floats | None, float, float]:
    """Horizontal direction whose specific force follows the change of speed.

    Returns
    -------
    forward : (3,); None where there is none
    agreement : their correlation
    slope : specific force per change of speed; noise of the speed makes it smaller than 1
    """
    x = accel - np.mean(accel)
    y = force - np.mean(force, axis=0)
    spread = float(x @ x)
    if spread / x.size < 0.15**2:
        return None, 0.0, 0.0
    slope = x @ y / spread
    slope = slope - (slope @ down) * down
    size = float(np.linalg.norm(slope))
    if size < 0.2:
        return None, 0.0, 0.0
    forward = slope / size
    return forward, float(np.corrcoef(y @ forward, x)[0, 1]), size
