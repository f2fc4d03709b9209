"""Motion on the even clock from what the filter found at its nodes."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.errors import LostError
from weighbridge.kernels.ins_model import (
    BA,
    E_PITCH0,
    E_SCALE,
    E_SQUAT,
    E_YAW0,
    LOST_GNSS,
    MEASUREMENTS,
    PITCH0,
    SCALE,
    SQUAT,
    YAW0,
    Z_N,
    P,
    Q,
    V,
)
from weighbridge.kernels.rotation import euler_to_matrix, matrix_to_euler, quaternions_to_euler
from weighbridge.limits import CERTAIN
from weighbridge.messages import Problem
from weighbridge.navigation.aiding import Fixes
from weighbridge.navigation.even import Even
from weighbridge.navigation.filter import Block, Nodes, run, run_smoothed
from weighbridge.navigation.identify.setup import Setup
from weighbridge.navigation.motion import Motion, bridged, noise_level
from weighbridge.signals import Bools, Floats, Signal
from weighbridge.signals.interpolation import interpolate

_LOG = logging.getLogger(__name__)

SQUAT_WIDTH: Final = 0.3
"""The body leans to the acceleration averaged over so long [s]."""

LONGEST_AIDED: Final = 10.0
"""A motion that nothing aided for longer is not valid [s]."""

_SQUAT_TIME: Final = 60.0
"""One start alone shows anything but squat: it takes so much driving [s]."""

_SCALE_FOUND: Final = 0.02
"""Below this standard deviation the drive has shown the scale of its speed [-]."""

_REFUSED: Final = 0.5
"""A larger part of fixes refused is that of a lost filter, or of another drive's fixes [-]."""

_STANDS: Final = 0.02
"""Slower is standing [m/s]."""

_AT_ONCE: Final = 1 << 16
"""Nodes whose angles are found at a time."""


@dataclass(slots=True)
class Found:
    """Samples and measurements of a drive, prepared for the filter.

    Attributes
    ----------
    block : samples, nodes and measurements; without measurements once `smoothed_motion` has
        folded them, since those of a day take 200 MB
    grid : low-passed inertial samples on the even clock, sensor axes
    reference : a speed without its delay
    fixes : of GNSS; None without
    """

    block: Block
    grid: Even
    reference: Signal
    fixes: Fixes | None


class Pose(NamedTuple):
    """Attitude and movement on the even clock: angles (n,) [rad], others (n, 3)."""

    roll: Floats
    pitch: Floats
    heading: Floats
    bias: Floats
    velocity: Floats
    position: Floats


class Constants(NamedTuple):
    """Constants of the layout: of the whole drive, or (n,) over time.

    Attributes
    ----------
    pitch0, yaw0 : of the body axes over the direction of travel [rad]
    squat : pitch of the body per specific force, taken out of the grade [rad per m/s^2]
    """

    pitch0: Floats | float
    yaw0: Floats | float
    squat: Floats | float


SQUAT_NOISE: Final = 0.27
"""Standard deviation of the squat by vibration that a sensor aliases, over the square of its noise
[rad per m/s^2 / (m^2/s^4)]: 180 drives of sixteen simulated vehicles at 50, 20 and 10 Hz differ
from the same at 100 Hz by 0.0009, 0.0024 and 0.0034 (RMS), and so by 0.26 to 0.28 of it."""


def smoothed_motion(found: Found, setup: Setup) -> Motion:
    """Fold a whole drive, smooth it and lay it out on the even clock.

    Without `NavigationSettings.smooth` the states are those of the forward pass, the constants
    those at its end.

    Raises
    ------
    LostError
        The filter failed.
    """
    fold = run_smoothed if setup.settings.smooth else run
    fixed = np.isfinite(found.block.z[:, Z_N])
    state, nodes = fold(setup.start, found.block, setup)
    found.block = found.block._replace(z=np.empty((0, MEASUREMENTS)))
    end = nodes.states[-1].copy() if setup.settings.smooth else state.x
    end_std = np.sqrt(np.maximum(np.diag(state.cov), 0.0))
    _check_found(float(state.x[SCALE]), nodes, fixed, setup)
    time = found.grid.time
    pose = pose_at(time, nodes)
    shown = _shows_squat(nodes, end_std, setup)
    known = setup.given is not None and setup.given.squat is not None
    squat = float(end[SQUAT])
    constants = Constants(float(end[PITCH0]), float(end[YAW0]), squat if shown or known else 0.0)
    if setup.moved_time.size:
        constants = constants._replace(
            pitch0=np.interp(time, nodes.time, nodes.states[:, PITCH0]),
            yaw0=np.interp(time, nodes.time, nodes.states[:, YAW0]),
        )
    grade_std = np.interp(time, nodes.time, nodes.grade_std)
    # As large as the motion that is made of it.
    del nodes
    accel = accel_along(found.grid, pose, constants, setup)
    read = along_body(bridged(time, accel), pose.pitch)
    grade = pose.pitch - travel_angle(averaged(float(time[1] - time[0]), read), constants)
    mounting_pitch, floor = float(end[PITCH0]), setup.settings.body_pitch_std
    if not setup.has_height:
        grade, taken, floor = _levelled(time, grade, pose, setup)
        mounting_pitch += taken
    valid = _valid(found, accel, setup)
    # A line across gaps, which are not valid: zeros would leak out of them through later filters.
    force = bridged(time, accel + GRAVITY * np.sin(grade))
    noise = _noise(found.block.time, time, force[valid])
    squat_std = float(np.hypot(end_std[E_SQUAT], SQUAT_NOISE * noise**2))
    turn = euler_to_matrix(0.0, mounting_pitch, -float(end[YAW0]))
    found_scale = scale_is_found(end_std, setup)
    mounting, mounting_std = mounting_of(turn, end_std, setup)
    _LOG.debug("squat %.4f +- %.4f rad per m/s^2", squat, squat_std)
    return laid_out(
        pose,
        setup,
        time=time,
        accel=bridged(time, accel),
        specific_force=force,
        grade=grade,
        valid=valid,
        specific_force_std=noise,
        grade_std=np.hypot(grade_std, floor),
        speed_scale=float(end[SCALE]) if found_scale else None,
        speed_scale_std=float(end_std[E_SCALE]) if found_scale else None,
        squat=squat if shown or known else None,
        squat_std=squat_std if shown or known else None,
        mounting=mounting,
        mounting_std=mounting_std,
        position=None if setup.origin is None else (setup.origin, pose.position),
        notes=_notes(setup, shown or known),
    )


def _noise(sampled: Floats, time: Floats, force: Floats) -> float:
    """Noise level of the specific force (n,), by samples as far apart as the sensor's own [m/s^2].

    Between the samples of a slow sensor the even clock ``time`` shows lines, and no noise.
    """
    period = float(np.median(np.diff(sampled))) / float(time[1] - time[0])
    return noise_level(force[:: max(1, round(period))])


def _check_found(scale: float, nodes: Nodes, fixed: Bools, setup: Setup) -> None:
    """Refuse a motion whose filter failed.

    Parameters
    ----------
    scale : of the speed, at the end of the forward pass [-]
    nodes : what the filter found
    fixed : (m,) nodes with a fix
    setup : of the drive
    """
    if setup.origin is None:
        return
    off = abs(scale - 1.0) / setup.settings.speed_scale_std
    if off > CERTAIN:
        raise Problem.of("gnss.scale", "latitude", scale=scale, off=off).error(LostError)
    refused = nodes.states[fixed, LOST_GNSS] > 0.0
    if refused.size and np.mean(refused) > _REFUSED:
        part = 100.0 * float(np.mean(refused))
        raise Problem.of("gnss.contradicts", "latitude", part=part).error(LostError)


def laid_out(pose: Pose, setup: Setup, **rows: object) -> Motion:
    """Complete a motion by what the pose shows alone: speed, distance, angles and height."""
    time = rows["time"]
    assert isinstance(time, np.ndarray)
    velocity, heading = pose.velocity, pose.heading
    ahead = velocity[:, 0] * np.cos(heading) + velocity[:, 1] * np.sin(heading)
    size = np.hypot(np.hypot(velocity[:, 0], velocity[:, 1]), velocity[:, 2])
    speed = np.where(size < _STANDS, 0.0, np.copysign(size, ahead))
    nothing, frame = np.full(time.size, np.nan), setup.origin
    way = np.cumsum(0.5 * np.abs(speed[1:] + speed[:-1]) * np.diff(time))
    return Motion(
        source="inertial",
        speed=speed,
        pitch=pose.pitch,
        roll=pose.roll,
        heading=nothing if frame is None else np.mod(heading, 2.0 * math.pi),
        distance=np.concatenate([[0.0], way]),
        altitude=frame.height(pose.position) if frame and setup.has_height else nothing,
        speed_delay=setup.speed_delay,
        **rows,  # type: ignore[arg-type]
    )


def pose_at(time: Floats, nodes: Nodes, *, longest: float = math.inf) -> Pose:
    """Attitude, bias, velocity and position at instants (n,), linear between the nodes.

    Between nodes further apart than ``longest`` [s] it is that of the node before.
    """
    if math.isfinite(longest):
        time = _held_time(time, nodes.time, longest)

    def three(first: int) -> Floats:
        out = np.empty((time.size, 3))
        for i in range(3):
            out[:, i] = interpolate(time, nodes.time, nodes.states[:, first + i])
        return out

    return Pose(*_angles_at(time, nodes), three(BA), three(V), three(P))


def _angles_at(time: Floats, nodes: Nodes) -> tuple[Floats, Floats, Floats]:
    """Roll, pitch and heading at instants (n,) [rad]."""
    angles = np.empty((nodes.time.size, 3))
    for first in range(0, nodes.time.size, _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        quaternions_to_euler(np.ascontiguousarray(nodes.states[part, Q : Q + 4]), angles[part])
    roll, pitch = (interpolate(time, nodes.time, angles[:, k]) for k in range(2))
    return roll, pitch, interpolate(time, nodes.time, np.unwrap(angles[:, 2]))


def _held_time(time: Floats, nodes: Floats, longest: float) -> Floats:
    """Set instants between nodes that are further apart back to the node before."""
    place = np.maximum(np.searchsorted(nodes, time, side="right") - 1, 0)
    gap = nodes[np.minimum(place + 1, nodes.size - 1)] - nodes[place]
    return np.where(gap > longest, nodes[place], time)


def accel_along(grid: Even, pose: Pose, constants: Constants, setup: Setup) -> Floats:
    """Acceleration (n,) along the direction of travel [m/s^2]; NaN in gaps."""
    x, y, z = grid.values[:, 0], grid.values[:, 1], grid.values[:, 2]
    r = setup.rot_bs
    sine, cosine = np.sin(pose.pitch), np.cos(pose.pitch)
    forward = r[0, 0] * x + r[0, 1] * y + r[0, 2] * z - pose.bias[:, 0] - GRAVITY * sine
    right = r[1, 0] * x + r[1, 1] * y + r[1, 2] * z - pose.bias[:, 1]
    right += GRAVITY * cosine * np.sin(pose.roll)
    down = r[2, 0] * x + r[2, 1] * y + r[2, 2] * z - pose.bias[:, 2]
    down += GRAVITY * cosine * np.cos(pose.roll)
    return np.asarray(forward + constants.yaw0 * right + constants.pitch0 * down)


def along_body(accel: Floats, pitch: Floats) -> Floats:
    """Specific force (n,) that an accelerometer along the body reads [m/s^2]."""
    return np.asarray(accel + GRAVITY * np.sin(pitch))


def travel_angle(force: Floats, constants: Constants) -> Floats:
    """Pitch of the body over its direction of travel (n,): mounting and squat [rad].

    The moment of the traction about the axles pitches the body: a hill as much as an
    acceleration (load transfer, Gillespie 1992, eqs. 1-7 to 1-10). ``force`` is that along the
    body [m/s^2], which the squat ``k`` itself makes ``1 + g k`` times the one along the road.
    """
    lean = constants.pitch0 + constants.squat * force
    return np.asarray(lean / (1.0 + GRAVITY * constants.squat))


def averaged(period: float, y: Floats) -> Floats:
    """Mean of a series (n,) of a period [s] over `SQUAT_WIDTH` around each instant, ends held."""
    width = max(1, round(SQUAT_WIDTH / period)) | 1
    padded = np.pad(y, width // 2, mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), "valid")


def _shows_squat(nodes: Nodes, end_std: Floats, setup: Setup) -> bool:
    """Say whether the drive has shown its squat."""
    moving = nodes.states[1:, V] ** 2 + nodes.states[1:, V + 1] ** 2 > 4.0
    going = float(np.sum(np.diff(nodes.time)[moving]))
    return bool(end_std[E_SQUAT] < setup.settings.squat_found_std and going > _SQUAT_TIME)


def level_trust(way: Floats | float, setup: Setup) -> tuple[Floats, Floats]:
    """Trust in a drive that ends as high as it began, and what is then left of its mean grade.

    Parameters
    ----------
    way : travelled, positive [m]

    Returns
    -------
    trust : part of the mean grade that is an error of the level [-]
    std : of what is left of it [rad]
    """
    settings = setup.settings
    level_std = settings.hill_std * np.sqrt(np.asarray(way) / 1e3) / way
    trust = settings.blind_grade_std**2 / (settings.blind_grade_std**2 + level_std**2)
    return trust, level_std * np.sqrt(trust)


def _levelled(time: Floats, grade: Floats, pose: Pose, setup: Setup) -> tuple[Floats, float, float]:
    """Take the mean grade of a drive without heights off; return it and the grade's least std.

    Without heights a bias of the accelerometer passes for a hill, but a drive does not end far
    above or below where it began.
    """
    moved = np.hypot(pose.velocity[:, 0], pose.velocity[:, 1])
    way = max(float(np.sum(moved)) * float(time[1] - time[0]), 1.0)
    mean = float(np.sum(grade * moved) / max(np.sum(moved), 1e-9))
    trust, rest_std = level_trust(way, setup)
    taken = float(trust) * mean
    return grade - taken, taken, math.hypot(setup.settings.body_pitch_std, float(rest_std))


def _valid(found: Found, accel: Floats, setup: Setup) -> Bools:
    """Return the instants (n,) at which there were samples, and aid not long ago."""
    grid, stamps, fixes = found.grid.time, found.block.time, found.fixes
    near = np.clip(np.searchsorted(stamps, grid), 1, stamps.size - 1)
    valid: Bools = (
        (stamps[near] - stamps[near - 1] <= setup.settings.max_gap)
        & np.isfinite(accel)
        & (grid >= stamps[0])
    )
    aided = found.reference.age(grid)
    if fixes is not None:
        right = np.clip(np.searchsorted(fixes.time, grid), 1, fixes.time.size - 1)
        away = np.minimum(np.abs(grid - fixes.time[right]), np.abs(grid - fixes.time[right - 1]))
        aided = np.minimum(aided, away)
    return valid & (aided < LONGEST_AIDED)


def scale_is_found(end_std: Floats, setup: Setup) -> bool:
    """Say whether the drive has shown the scale of its speed."""
    with_both = setup.has_wheel and setup.origin is not None
    return bool(with_both and end_std[E_SCALE] < _SCALE_FOUND)


Angles: TypeAlias = tuple[float, float, float]


def mounting_of(turn: Floats, end_std: Floats, setup: Setup) -> tuple[Angles, Angles]:
    """Roll, pitch and yaw of the sensor after a turn (3, 3) of the body axes, and their stds.

    Roll is as uncertain as at the start: no row shows it.
    """
    roll, pitch, yaw = matrix_to_euler(turn @ setup.rot_bs)
    roll_std = math.sqrt(setup.start.cov[E_PITCH0, E_PITCH0])
    return (
        (float(roll), float(pitch), float(yaw)),
        (roll_std, float(end_std[E_PITCH0]), float(end_std[E_YAW0])),
    )


def _notes(setup: Setup, squat_known: bool) -> tuple[Problem, ...]:
    """Say what the drive does not show, after the notes of the setup."""
    notes = list(setup.notes)
    if setup.origin is None:
        notes.append(Problem.of("gnss.none"))
    elif not setup.has_height:
        notes.append(Problem.of("gnss.no_height"))
    if not squat_known:
        notes.append(Problem.of("motion.no_squat"))
    return tuple(dict.fromkeys(notes))
