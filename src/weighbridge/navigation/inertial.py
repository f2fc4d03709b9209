"""Motion from an inertial sensor, vehicle speed and GNSS (Jensen 2022, sec. 5)."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.errors import DriveError
from weighbridge.kernels.ins import (
    BA,
    BG,
    ERRORS,
    LAST,
    LEVER,
    PITCH0,
    SCALE,
    SHOWN,
    SQUAT,
    STATES,
    YAW0,
    Noise,
    P,
    Q,
    V,
    new_log,
    new_work,
    run,
    smooth,
)
from weighbridge.kernels.rotation import (
    euler_to_matrix,
    euler_to_quaternion,
    matrix_to_euler,
    quaternions_to_euler,
    rotate_body,
)
from weighbridge.navigation.aiding import (
    Fixes,
    Imu,
    interpolated,
    measurements,
    place_nodes,
    read_fixes,
    read_imu,
    resample,
    speed_from_fixes,
    still_state,
)
from weighbridge.navigation.even import Even, coarsely, evenly
from weighbridge.navigation.gain import Gain, find_gain, gravity_read
from weighbridge.navigation.motion import Motion, bridged, noise_level
from weighbridge.navigation.mounting import TooLittleMotionError, coarse_mounting
from weighbridge.navigation.remounting import Change, find_changes, loosened, told, undo, unsure
from weighbridge.navigation.settings import NavigationSettings
from weighbridge.navigation.timing import estimate_speed_delay
from weighbridge.signals import Bools, Drive, Floats, Ints, Signal
from weighbridge.vehicle.model import Mounting

_LOG = logging.getLogger(__name__)

_COARSE_PERIOD = 0.5
"""Clock of the coarse alignment [s]."""

_STRETCH = 512
"""Nodes the backward pass holds at a time: bounds its memory."""

_FIRST_PASS = 900.0
"""The first pass, which only finds the constants, ends after so long [s]."""


_SQUAT_TIME = 60.0
"""One start alone shows anything but squat: it takes so much driving [s]."""

_SCALE_ROUNDS = 4
"""A wrong scale also bends the attitude: each round finds most of what is left."""

_OPEN = 0.4
"""Part of a gain that may be scale or squat that is left open in the mass [-]."""

_CLOSER = 0.6
"""A round that finds more than so much of what the one before found leads nowhere [-]."""

_FALSE_TOLD = 1e-3
"""A smaller part of false samples is left out without a word [-]."""

_FINE_RATE = 20.0
"""Clock of the delays [Hz]."""


MOST_MOVED = 0.2
"""A mounting further from the one given is another one [rad],"""

_MOVED_SURE = 4.0
"""if it is by so many standard deviations: a steady drive hardly shows where ahead is [-]."""


_Alignment: TypeAlias = tuple[Floats, float, float, float, float, Mounting | None]


@dataclass(frozen=True, slots=True)
class _Start:
    """Where the filter begins.

    Attributes
    ----------
    x : (30,) nominal state
    cov : (20, 20)
    """

    x: Floats
    cov: Floats


@dataclass(frozen=True, slots=True)
class Solution:
    """What the filter found, at its nodes.

    Attributes
    ----------
    time : (m,) [s]
    states : (m, 24) see `weighbridge.kernels.ins`
    stds : (m,) standard deviation of the grade in the forward pass [rad]
    last : (30,) nominal state at the end of the forward pass
    last_cov : (20, 20) its covariance
    """

    time: Floats
    states: Floats
    stds: Floats
    last: Floats
    last_cov: Floats


def inertial_motion(
    drive: Drive,
    mounting: Mounting | None = None,
    *,
    settings: NavigationSettings | None = None,
    rate: float = 20.0,
) -> Motion:
    """Find how the vehicle moved from its inertial sensor, aided by speed and GNSS.

    The mounting is found from the drive, or refined where given. The filter
    runs forward twice, first to find the constants, then from these with
    their uncertainty as it was, and once backward.

    The specific force is low-passed without delay at 0.4 of ``rate`` before it is taken to the
    even clock, so that road and engine vibration does not fold.

    Parameters
    ----------
    drive : with ``accel_x..z`` and ``gyro_x..z`` and at least one of
        ``vehicle_speed``, ``gnss_speed`` and ``latitude`` with ``longitude``
    mounting : known mounting and squat
    settings : noise levels and priors
    rate : of the result [Hz]

    Raises
    ------
    DriveError
        Signals are missing, the drive is too short or too quiet, or units or axes of the
        inertial sensor do not fit together.

    References
    ----------
    Jensen et al., Mech. Syst. Signal Process. 171, 2022, sec. 5.2-5.4.
    """
    settings = settings or NavigationSettings()
    imu = read_imu(drive)
    start, end = float(imu.time[0]), float(imu.time[-1])
    fixes = read_fixes(drive, start, end)
    wheel = _usable(drive.get("vehicle_speed"), start, end)
    reference = wheel or _usable(drive.get("gnss_speed"), start, end)
    if reference is None and fixes is not None:
        reference = speed_from_fixes(fixes)
    if reference is None or len(reference) < 10:
        raise DriveError(
            f"{drive.name}: inertial navigation lacks vehicle_speed, gnss_speed or latitude and "
            "longitude: with the inertial sensor alone the motion drifts away"
        )
    motion = _solved(drive, imu, fixes, wheel, reference, mounting, settings, rate)
    scale = np.ones(imu.time.size)
    scale_std, before = 0.0, math.inf
    gravity = gravity_read(imu.time, imu.accel)
    for _ in range(_SCALE_ROUNDS if wheel is not None else 0):
        gain = find_gain(motion, reference, gravity, again=scale_std > 0.0)
        if gain is None or motion.mounting is None:
            break
        if not gain.sure:
            return _doubted(motion, gain)
        if gain.off > _CLOSER * before:
            break
        before = gain.off
        scale /= gain.at(imu.time)
        scale_std = gain.std
        scaled = _scaled(imu, euler_to_matrix(*motion.mounting)[0], scale)
        motion = _solved(drive, scaled, fixes, wheel, reference, mounting, settings, rate)
    if scale_std == 0.0:
        return motion
    return replace(
        motion,
        specific_force_scale_std=scale_std,
        notes=(*motion.notes, _scale_note(1.0 / scale)),
    )


def _doubted(motion: Motion, gain: Gain) -> Motion:
    """Tell of a gain that may be the sensor's scale or the squat, and widen by a part of it."""
    mean = float(np.mean(gain.value))
    note = (
        f"the accelerometer reads {mean:.3f} times what the speed changes by along the vehicle, "
        "and gravity does not show it: the scale of that axis is off, or the lean of the body is "
        f"not known so well; {100.0 * _OPEN * gain.off:.1f} % of the mass, as standard deviation, "
        "are in the interval for it"
    )
    std = _OPEN * gain.off
    return replace(motion, specific_force_scale_std=std, notes=(*motion.notes, note))


def _scaled(imu: Imu, forward: Floats, scale: Floats) -> Imu:
    """Multiply the specific force along the vehicle (3,) by a scale (n,)."""
    along = imu.accel @ forward
    accel = imu.accel + ((scale - 1.0) * along)[:, None] * forward
    return replace(imu, accel=np.ascontiguousarray(accel))


def _scale_note(gain: Floats) -> str:
    low, high = float(np.min(gain)), float(np.max(gain))
    size = f"{high:.3f}" if high - low < 0.005 else f"{gain[0]:.3f} to {gain[-1]:.3f}"
    return (
        f"the accelerometer reads {size} times what the speed changes by along the vehicle: its "
        "scale is off, and was corrected"
    )


def _solved(
    drive: Drive, imu: Imu, fixes: Fixes | None, wheel: Signal | None, reference: Signal,
    mounting: Mounting | None, settings: NavigationSettings, rate: float,
) -> Motion:  # fmt: skip
    """Align the sensor, run the filter and lay its solution out."""
    notes: list[str] = []
    if imu.false > _FALSE_TOLD:
        notes.append(
            f"{100.0 * imu.false:.1f} % of the inertial samples are zeros, spikes or at a limit "
            "of the sensor, and were left out"
        )
    start = float(imu.time[0])
    imu, fine, aligned, changes = _settled(imu, reference, drive, mounting, notes)
    rot_bs, tilt_std, yaw_std, yaw_bias, delay, mounting = aligned
    reference = Signal(reference.name, reference.time - delay, reference.values)
    gnss_delay = delay if wheel is None else _gnss_delay(drive, fine, fixes, rot_bs)
    speed = reference if wheel is not None or drive.has("gnss_speed") else None

    even = fine if rate == _FINE_RATE else evenly(imu, rate)
    grid, sensor = even.time, even.values
    accel, gyro = sensor[:, :3] @ rot_bs.T, sensor[:, 3:] @ rot_bs.T

    _LOG.debug("vehicle speed late by %.3f s, GNSS by %.3f s", delay, gnss_delay)
    fix_times = fixes.time - gnss_delay if fixes is not None else np.empty(0)
    nodes = place_nodes(imu.time, fix_times, rate, settings.max_gap)
    node_time = imu.time[nodes]
    slow = ~(interpolated(reference, grid, 3.0) > 0.7)
    still = still_state(node_time, wheel and reference, grid, accel, gyro, slow)
    z = measurements(
        node_time, settings, speed=speed, fixes=fixes, drive=drive, gnss_delay=gnss_delay,
        still=still,
    )  # fmt: skip

    noise = settings.noise()
    begin = _begin(
        grid, accel, gyro, reference, fixes, still, node_time, settings, mounting,
        tilt_std=tilt_std, yaw_std=yaw_std, yaw_bias=yaw_bias,
        free_scale=wheel is not None and fixes is not None,
    )  # fmt: skip
    first_end = min(nodes.size, int(np.searchsorted(node_time, start + _FIRST_PASS)) + 1)
    loose = _loose_nodes(node_time, changes)
    found = _filter(imu, rot_bs, nodes[:first_end], z[:first_end], begin, noise, False, loose)
    rot_bs, begin = _restart(rot_bs, begin, found)
    solution = _filter(imu, rot_bs, nodes, z, begin, noise, settings.smooth, loose)
    return _motion(
        drive, imu, grid, sensor, rot_bs, solution, fixes, reference, wheel is not None, delay,
        settings, mounting, notes, begin, bool(loose),
    )  # fmt: skip


def _settled(
    imu: Imu, reference: Signal, drive: Drive, mounting: Mounting | None, notes: list[str]
) -> tuple[Imu, Even, _Alignment, list[Change]]:
    """Align the sensor; where it was moved on the way, turn its later samples back first.

    Samples during which it may or may not have been moved are left out.
    """
    fine = evenly(imu, _FINE_RATE)
    first_notes: list[str] = []
    aligned = _align(fine, reference, mounting, first_notes)
    shifted = Signal(reference.name, reference.time - aligned[4], reference.values)
    coarse = coarsely(fine, _COARSE_PERIOD)
    changes = find_changes(coarse, shifted, aligned[0], drive.get("altitude"))
    if not changes:
        notes += first_notes
        return imu, fine, aligned, changes
    keep = ~unsure(imu.time, changes)
    time = imu.time[keep]
    values = undo(time, np.hstack([imu.accel[keep], imu.gyro[keep]]), changes)
    imu = Imu(
        time,
        np.ascontiguousarray(values[:, :3]),
        np.ascontiguousarray(values[:, 3:]),
        imu.period,
    )
    notes += told(changes, float(imu.time[0]), float(imu.time[-1]))
    fine = evenly(imu, _FINE_RATE)
    return imu, fine, _align(fine, reference, mounting, notes), changes


def _usable(signal: Signal | None, start: float, end: float) -> Signal | None:
    """Return the signal if it has samples enough beside the inertial ones."""
    if signal is None or len(signal) < 10:
        return None
    inside = (signal.time > start - 1.0) & (signal.time < end + 1.0)
    return signal if inside.sum() >= 10 else None


def _align(
    fine: Even, reference: Signal, mounting: Mounting | None, notes: list[str]
) -> _Alignment:
    """Find sensor to body axes, their uncertainty, the yaw rate's bias and the speed's delay.

    The last value is the mounting given, or None where the sensor was moved since.
    """
    coarse_imu = coarsely(fine, _COARSE_PERIOD)
    grid, data = coarse_imu.time, coarse_imu.values

    delay = 0.0
    rot = np.eye(3) if mounting is None else euler_to_matrix(
        mounting.roll, mounting.pitch, mounting.yaw
    )  # fmt: skip
    tilt_std, yaw_std, yaw_bias = 0.01, 0.02, math.nan
    if mounting is not None and mounting.std is not None:
        tilt_std = max(mounting.std[0], mounting.std[1], 0.003)
        yaw_std = max(mounting.std[2], 0.005)
    for _ in range(2):
        shifted = Signal(reference.name, reference.time - delay, reference.values)
        coarse_speed = _coarse_speed(shifted, grid)
        try:
            coarse = coarse_mounting(
                data[:, :3], data[:, 3:], coarse_speed, _COARSE_PERIOD, coarse_speed < 0.05
            )
        except TooLittleMotionError:
            if mounting is None:
                raise
            coarse = None
        if coarse is not None:
            yaw_bias = coarse.yaw_rate_bias
            if mounting is None:
                rot, tilt_std, yaw_std = coarse.rot_bs, coarse.tilt_std, coarse.yaw_std
            else:
                angle = math.acos(np.clip(0.5 * (np.trace(rot @ coarse.rot_bs.T) - 1.0), -1, 1))
                unsure = math.hypot(coarse.yaw_std, coarse.tilt_std, tilt_std, yaw_std)
                if angle > max(MOST_MOVED, _MOVED_SURE * unsure):
                    notes.append(
                        f"the sensor sits {math.degrees(angle):.0f} deg from the mounting given: "
                        "it was moved, and its mounting is found from this drive alone"
                    )
                    rot, tilt_std, yaw_std = coarse.rot_bs, coarse.tilt_std, coarse.yaw_std
                    mounting = None
        delay, delay_std = estimate_speed_delay(fine.time, fine.values[:, :3] @ rot[0], reference)
        if not delay_std < 0.1:
            delay = 0.0
    if coarse is not None and reference.name == "vehicle_speed":
        margin = 4.0 * coarse.forward_gain_std
        low = max(coarse.forward_gain + margin, coarse.forward_gain_most) < 0.75
        if coarse.forward_gain - margin > 1.3 or low:
            raise DriveError(
                f"{reference.name} changes by {1.0 / coarse.forward_gain:.2f} of what the "
                "accelerometer shows: set its unit (kmh, mph or mps) in the mapping"
            )
    if delay == 0.0:
        notes.append("the drive does not show how late its vehicle speed is; taken as 0 s")
    return rot, tilt_std, yaw_std, yaw_bias, delay, mounting


def _gnss_delay(drive: Drive, fine: Even, fixes: Fixes | None, rot_bs: Floats) -> float:
    """Find how late GNSS is, from its speed or that between fixes; 0 where not shown [s]."""
    if fixes is None:
        return 0.0
    start, end = float(fine.time[0]), float(fine.time[-1])
    speed = _usable(drive.get("gnss_speed"), start, end) or speed_from_fixes(fixes)
    delay, std = estimate_speed_delay(fine.time, fine.values[:, :3] @ rot_bs[0], speed)
    return delay if std < 0.05 else 0.0


def _coarse_speed(speed: Signal, grid: Floats) -> Floats:
    """Take the speed to the coarse clock in the band of the coarse inertial samples."""
    longest = max(2.0, 3.0 * speed.period)
    at = interpolated(speed, grid, longest)
    if speed.period < 0.3 * _COARSE_PERIOD:
        smooth_speed = resample(
            speed.time, speed.values[:, None], float(grid[0]), _COARSE_PERIOD, grid.size
        )[:, 0]
        return np.where(np.isfinite(at) & (at > 0.05), smooth_speed, at)
    return at


def _begin(
    grid: Floats, accel: Floats, gyro: Floats, reference: Signal, fixes: Fixes | None,
    still: Floats, node_time: Floats, settings: NavigationSettings, mounting: Mounting | None,
    *, tilt_std: float, yaw_std: float, yaw_bias: float, free_scale: bool,
) -> _Start:  # fmt: skip
    """Set the first state: level and speed from the first seconds, heading from GNSS."""
    x = np.zeros(STATES)
    std = np.zeros(ERRORS)
    speed = interpolated(reference, grid, 3.0)
    known = np.isfinite(speed) & np.isfinite(accel).all(axis=1)
    x[SCALE] = 1.0
    x[LAST : LAST + 3] = gyro[int(np.argmax(np.isfinite(gyro).all(axis=1)))]
    x[SQUAT] = settings.squat
    std[17] = settings.squat_std
    if mounting is not None and mounting.squat is not None:
        x[SQUAT] = mounting.squat
        std[17] = max(mounting.squat_std or 0.0, 2e-4)
    std[15] = math.hypot(tilt_std, settings.mounting_std if mounting is None else 0.0)
    std[16] = math.hypot(yaw_std, settings.mounting_std if mounting is None else 0.0)
    std[18] = settings.speed_scale_std if free_scale else 1e-6
    x[LEVER], std[19] = settings.lever, settings.lever_std

    # gyro bias: from rest; else pitch and roll come back to where they were
    # and the yaw rate follows from lateral force
    rest = np.interp(grid, node_time, still) > 1.9
    bias_std = np.full(3, settings.gyro_bias_std)
    if rest.sum() * (grid[1] - grid[0]) > 2.0:
        bias = np.median(gyro[rest & known], axis=0) if (rest & known).any() else np.zeros(3)
        bias_std[:] = 0.002
    else:
        window = known & (grid < grid[0] + 120.0)
        span = max(1.0, float(window.sum() * (grid[1] - grid[0])))
        bias = np.mean(gyro[window], axis=0) if window.any() else np.zeros(3)
        bias_std[:2] = min(0.03, 0.003 + 0.1 / span)
        bias[2] = yaw_bias if math.isfinite(yaw_bias) else 0.0
        bias_std[2] = 0.02
    x[BG : BG + 3] = bias

    # level of the first two seconds: what is left of specific force without
    # what speed and turning explain
    place = int(np.argmax(known)) if known.any() else 0
    head = slice(place, place + max(4, round(2.0 / (grid[1] - grid[0]))))
    f = np.nanmean(accel[head], axis=0)
    v = speed[head]
    rate = 0.0
    if np.isfinite(v).sum() > 3:
        ok = np.isfinite(v)
        rate = float(np.polyfit(grid[head][ok], v[ok], 1)[0])
    v0 = float(np.nan_to_num(speed[place]))
    turn = float(np.nanmean(gyro[head, 2]) - bias[2]) * v0
    pitch = math.asin(float(np.clip((f[0] - rate) / GRAVITY, -0.3, 0.3)))
    roll = math.asin(float(np.clip(-(f[1] - turn) / GRAVITY, -0.3, 0.3)))
    heading, heading_std = _first_heading(grid, gyro[:, 2] - bias[2], speed, fixes)
    x[Q : Q + 4] = euler_to_quaternion(roll, pitch, heading)
    x[V] = v0 * math.cos(heading)
    x[V + 1] = v0 * math.sin(heading)
    if fixes is not None:
        x[P : P + 2] = fixes.ned[0, :2]
        gone = min(float(fixes.time[0]) - float(grid[0]), 30.0)
        std[0:2] = 10.0 + v0 * max(gone, 0.0)
        std[2] = 10.0
    else:
        std[0:3] = 0.1
    if fixes is None or not fixes.has_height:
        std[2] = 0.1
    std[3:5] = 0.5 + 0.1 * v0
    std[5] = 0.3 + 0.05 * v0
    std[6:8] = 0.02 if v0 < 0.1 else 0.03
    std[8] = heading_std
    std[9:12] = settings.accel_bias_std
    std[12:15] = bias_std
    return _Start(x, np.diag(std**2))


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


def _loose_nodes(time: Floats, changes: list[Change]) -> dict[int, Floats]:
    """Nodes before which the mounting may have changed, with variances of pitch and yaw (2,)."""
    loose: dict[int, Floats] = {}
    if changes:
        at, variance = loosened(time, changes)
        for node, var in zip(np.searchsorted(time, at), variance, strict=True):
            loose[int(node)] = loose.get(int(node), np.zeros(2)) + var
    return loose


def _restart(rot_bs: Floats, begin: _Start, found: Solution) -> tuple[Floats, _Start]:
    """Move the beginning to the constants a pass has found, uncertain as they were.

    The linearisation profits, and nothing is counted twice.
    """
    x = begin.x.copy()
    end = found.last
    # direction of travel in body axes is (1, yaw0, pitch0)
    turn = euler_to_matrix(0.0, float(end[PITCH0]), -float(end[YAW0]))
    x[SQUAT], x[SCALE], x[LEVER] = end[SQUAT], end[SCALE], end[LEVER]
    x[BG : BG + 3] = turn @ end[BG : BG + 3]
    x[BA : BA + 3] = turn @ end[BA : BA + 3]
    rotate_body(x[Q : Q + 4], 0.0, -float(end[PITCH0]), float(end[YAW0]))
    return turn @ rot_bs, _Start(x, begin.cov)


def _filter(
    imu: Imu, rot_bs: Floats, nodes: Ints, z: Floats, begin: _Start, noise: Noise, backward: bool,
    loose: dict[int, Floats],
) -> Solution:  # fmt: skip
    """Run forward over the nodes and, if asked, backward.

    Before the nodes ``loose`` the mounting may have changed, by these variances of pitch and yaw.
    """
    x, cov, work = begin.x.copy(), begin.cov.copy(), new_work()
    count = nodes.size
    states = np.empty((count, SHOWN))
    stds = np.empty(count)
    empty = new_log(0)
    kept = []
    edges = sorted({*range(0, count, _STRETCH), *(k for k in loose if 0 < k < count), count})
    for first, last in pairwise(edges):
        if first in loose:
            cov[[15, 16], [15, 16]] += loose[first]
            cov[[6, 7, 8], [6, 7, 8]] += loose[first][1]
        if backward:
            kept.append((x.copy(), cov.copy()))
        run(
            x, cov, work, imu.time, imu.accel, imu.gyro, rot_bs, nodes, first, last, z, noise,
            empty, states, stds,
        )  # fmt: skip
    end, end_cov = x.copy(), cov.copy()
    if backward:
        # one stretch after another is run again from where it began: the
        # covariances of a whole drive would fill the memory
        adjoint = np.zeros(ERRORS)
        log = new_log(_STRETCH)
        for first, last in reversed(list(pairwise(edges))):
            x, cov = kept.pop()
            run(
                x, cov, work, imu.time, imu.accel, imu.gyro, rot_bs, nodes, first, last, z, noise,
                log, states, stds,
            )  # fmt: skip
            smooth(log, last - first, adjoint, states, first)
    return Solution(imu.time[nodes], states, stds, end, end_cov)


def _motion(
    drive: Drive, imu: Imu, grid: Floats, sensor: Floats, rot_bs: Floats, solution: Solution,
    fixes: Fixes | None, reference: Signal, has_wheel: bool, delay: float,
    settings: NavigationSettings, mounting: Mounting | None, notes: list[str], begin: _Start,
    remounted: bool,
) -> Motion:  # fmt: skip
    """Lay the solution out on the even clock."""
    time, states, stds = solution.time, solution.states, solution.stds
    end = states[-1] if settings.smooth else solution.last
    end_std = np.sqrt(np.maximum(np.diag(solution.last_cov), 0.0))

    angles = np.empty((time.size, 3))
    quaternions_to_euler(np.ascontiguousarray(states[:, Q : Q + 4]), angles)

    def on_grid(y: Floats) -> Floats:
        return np.interp(grid, time, y)

    roll, pitch = on_grid(angles[:, 0]), on_grid(angles[:, 1])
    heading = on_grid(np.unwrap(angles[:, 2]))
    bias = np.column_stack([on_grid(states[:, BA + i]) for i in range(3)])
    velocity = np.column_stack([on_grid(states[:, V + i]) for i in range(3)])
    position = np.column_stack([on_grid(states[:, P + i]) for i in range(3)])

    # constants: the smoothed ones do not change over the drive
    pitch0, yaw0, squat = float(end[PITCH0]), float(end[YAW0]), float(end[SQUAT])
    going = float(np.sum(np.diff(time)[states[1:, V] ** 2 + states[1:, V + 1] ** 2 > 4.0]))
    shown = end_std[17] < settings.squat_found_std and going > _SQUAT_TIME
    given = mounting is not None and mounting.squat is not None
    use_squat = squat if shown or given else 0.0

    force = sensor[:, :3] @ rot_bs.T - bias
    cp, sp = np.cos(pitch), np.sin(pitch)
    body_accel = force + GRAVITY * np.column_stack([-sp, cp * np.sin(roll), cp * np.cos(roll)])
    pitched: Floats | float = on_grid(states[:, PITCH0]) if remounted else pitch0
    yawed: Floats | float = on_grid(states[:, YAW0]) if remounted else yaw0
    accel = body_accel[:, 0] + yawed * body_accel[:, 1] + pitched * body_accel[:, 2]
    held = bridged(grid, accel)
    width = max(1, round(0.3 / (grid[1] - grid[0]))) | 1
    lean = np.convolve(np.pad(held, width // 2, mode="edge"), np.full(width, 1.0 / width), "valid")
    grade = pitch - pitched - use_squat * lean
    floor = settings.body_pitch_std
    if fixes is None or not fixes.has_height:
        # without heights a bias of the accelerometer passes for a hill, but a
        # drive does not end far above or below where it began
        moved = np.hypot(velocity[:, 0], velocity[:, 1])
        length = float(np.sum(moved)) * float(grid[1] - grid[0])
        length = max(length, 1.0)
        level_std = settings.hill_std * math.sqrt(length / 1e3) / length
        mean = float(np.sum(grade * moved) / max(np.sum(moved), 1e-9))
        trust = settings.blind_grade_std**2 / (settings.blind_grade_std**2 + level_std**2)
        grade = grade - trust * mean
        pitch0 += trust * mean
        floor = math.hypot(floor, level_std * math.sqrt(trust))
    specific_force = accel + GRAVITY * np.sin(grade)

    horizontal = np.hypot(velocity[:, 0], velocity[:, 1])
    ahead = velocity[:, 0] * np.cos(heading) + velocity[:, 1] * np.sin(heading)
    speed = np.copysign(np.hypot(horizontal, velocity[:, 2]), ahead)
    speed = np.where(np.abs(speed) < 0.02, 0.0, speed)

    near = np.searchsorted(imu.time, grid)
    near = np.clip(near, 1, imu.time.size - 1)
    valid: Bools = (
        (imu.time[near] - imu.time[near - 1] <= settings.max_gap)
        & np.isfinite(accel)
        & (grid >= imu.time[0])
    )
    aided = reference.age(grid)
    if fixes is not None:
        right = np.clip(np.searchsorted(fixes.time, grid), 1, fixes.time.size - 1)
        away = np.minimum(np.abs(grid - fixes.time[right]), np.abs(grid - fixes.time[right - 1]))
        aided = np.minimum(aided, away)
    valid &= aided < 10.0
    # A line across gaps, which are not valid: zeros would leak out of them through later filters.
    accel, specific_force = bridged(grid, accel), bridged(grid, specific_force)

    nothing = np.full(grid.size, np.nan)
    latitude, longitude, altitude = nothing, nothing, nothing
    if fixes is not None:
        latitude, longitude, altitude = fixes.frame.to_geodetic(position)
        if not fixes.has_height:
            altitude = nothing
            notes.append("without GNSS height the grade may be off by a constant")
    else:
        heading = nothing
        notes.append(
            "without GNSS the heading is unknown, the speed's scale is taken as 1 and the grade "
            "may be off by a constant"
        )
    if not shown and not given:
        notes.append("the drive does not show the squat: pitch of the body is taken as grade")

    rot_vs = euler_to_matrix(0.0, pitch0, -yaw0) @ rot_bs
    found_scale = has_wheel and fixes is not None and end_std[18] < 0.02
    slow_std = float(np.median(stds)) * GRAVITY
    _LOG.debug("squat %.4f +- %.4f rad per m/s^2, slow std %.3f", squat, end_std[17], slow_std)
    return Motion(
        source="inertial",
        time=grid,
        speed=speed,
        accel=accel,
        specific_force=specific_force,
        grade=grade,
        pitch=pitch,
        roll=roll,
        heading=np.mod(heading, 2.0 * math.pi),
        distance=np.concatenate(
            [[0.0], np.cumsum(0.5 * np.abs(speed[1:] + speed[:-1]) * np.diff(grid))]
        ),
        altitude=altitude,
        latitude=latitude,
        longitude=longitude,
        valid=valid,
        specific_force_std=noise_level(specific_force[valid]),
        grade_std=np.hypot(on_grid(stds), floor),
        speed_scale=float(end[SCALE]) if found_scale else None,
        speed_scale_std=float(end_std[18]) if found_scale else None,
        speed_delay=delay,
        squat=squat if shown or given else None,
        squat_std=float(end_std[17]) if shown or given else None,
        mounting=tuple(float(a) for a in matrix_to_euler(rot_vs)),  # type: ignore[arg-type]
        mounting_std=(
            float(math.sqrt(begin.cov[15, 15])), float(end_std[15]), float(end_std[16])
        ),
        notes=tuple(dict.fromkeys(notes)),
    )  # fmt: skip
