"""Motion without smoother, step by step: each row from what is known soon after it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.errors import DriveError
from weighbridge.kernels.ins_model import (
    E_SCALE,
    E_SQUAT,
    PITCH0,
    SCALE,
    SHOWN,
    SQUAT,
    YAW0,
    Z_STILL,
)
from weighbridge.kernels.rotation import euler_to_matrix
from weighbridge.messages import refused
from weighbridge.navigation.aiding import Imu, read_fixes, read_imu, speed_from_fixes
from weighbridge.navigation.axes import Axes
from weighbridge.navigation.even import Even, evenly
from weighbridge.navigation.filter import Block, Nodes, run
from weighbridge.navigation.identify.setup import Setup
from weighbridge.navigation.layout import (
    LONGEST_AIDED,
    SQUAT_WIDTH,
    Constants,
    Found,
    accel_along,
    along_body,
    averaged,
    laid_out,
    level_trust,
    mounting_of,
    pose_at,
    scale_is_found,
    travel_angle,
)
from weighbridge.navigation.motion import Motion
from weighbridge.navigation.rows import (
    AHEAD,
    measurements,
    open_mounting,
    place_nodes,
    still_state,
)
from weighbridge.navigation.sources import Sources, undelayed
from weighbridge.navigation.state import State
from weighbridge.signals import BEHIND, Bools, Drive, Floats, Signal, recent, step_ends
from weighbridge.signals.catalogue import IMU_SIGNALS

LAID_OUT: Final = 0.25
"""A row is laid out so long after its instant [s]: half of `SQUAT_WIDTH` and a node."""


IMU_BEHIND: Final = 6.0
"""Inertial samples are cleaned beside those of so long before [s]."""

NODES: Final = 40
"""So many nodes are kept that were folded before."""


class Level(NamedTuple):
    """Mean grade of the way so far.

    Attributes
    ----------
    way : travelled [m]
    moved : sum of the speeds [m/s]
    lifted : sum of grade times speed [m/s]
    """

    way: float = 0.0
    moved: float = 0.0
    lifted: float = 0.0


class NavigationState(NamedTuple):
    """What the stage goes on from.

    Attributes
    ----------
    filter : after the last sample that was folded
    folded : samples up to this instant were [s]
    nodes : the last ones
    motion : rows of the last `BEHIND` seconds; None before the first
    row : number of the next row on the even clock
    level : of the way so far, for drives without heights
    """

    filter: State
    folded: float
    nodes: Nodes
    motion: Motion | None
    row: int
    level: Level


def begin(setup: Setup, start: float) -> NavigationState:
    """Return the state before the first sample, which comes at ``start`` [s] or later."""
    nothing = Nodes(np.empty(0), np.empty((0, SHOWN)), np.empty(0))
    row = math.ceil(start * setup.rate)
    return NavigationState(setup.start, -math.inf, nothing, None, row, Level())


def lateness(setup: Setup) -> float:
    """Time that a row waits for what shows it [s]: delays of the sources, and look-ahead."""
    return max(0.0, setup.clocks.speed_delay, setup.clocks.gnss_delay) + AHEAD + LAID_OUT


def step(
    state: NavigationState, records: Drive, until: float, setup: Setup
) -> tuple[NavigationState, Motion | None]:
    """Fold what came since the last step, and lay the rows out that it makes known.

    A row knows its records up to `AHEAD` past its instant, delays taken off, and what the setup
    took from a whole drive: mounting, delays, noise levels, changes of mounting, scale of the
    accelerometer. Where nothing comes the rows go on, not valid.

    Parameters
    ----------
    state : before it
    records : those of `weighbridge.signals.recent.recent`, up to ``until``
    until : instant up to which records are complete [s]
    setup : of `weighbridge.navigation.identify.identify`

    Returns
    -------
    state : after it
    rows : that became known; None without any
    """
    horizon = until - lateness(setup) + LAID_OUT
    sources = _gather(_unfolded(records, state.folded), setup)
    found = None if sources is None else _prepared(sources, setup)
    after, nodes = state.filter, state.nodes
    if found is not None:
        first, last = found.block.time.searchsorted([state.folded, horizon], side="right")
        after, new = run(state.filter, found.block.part(first, last), setup)
        nodes = _followed(nodes, new)
    state = state._replace(filter=after, folded=horizon, nodes=nodes)
    ahead = math.floor(horizon * setup.rate + 1e-6) + 1
    end = math.floor((horizon - LAID_OUT) * setup.rate + 1e-6) + 1
    if not nodes.time.size:
        return state._replace(row=max(state.row, end)), None
    row = max(state.row, math.ceil(nodes.time[0] * setup.rate))
    if row > state.row:
        # Before the first sample, or after a silence: the even clock begins anew.
        state = state._replace(motion=None)
    if row >= end:
        return state._replace(row=row), None
    return _laid_out(state._replace(row=row), found, (end, ahead), setup)


def _unfolded(records: Drive, folded: float) -> Drive:
    """Leave inertial samples out that were folded long ago."""
    cut = {}
    for name in IMU_SIGNALS:
        s = records.get(name)
        if s is not None:
            first = int(s.time.searchsorted(folded - IMU_BEHIND))
            cut[name] = Signal(name, s.time[first:], s.values[first:])
    return records.with_signals(*cut.values())


def _followed(nodes: Nodes, new: Nodes) -> Nodes:
    """Append new nodes to the last of the old ones, unless they come after a long silence."""
    if not new.time.size:
        return nodes
    if nodes.time.size and new.time[0] - nodes.time[-1] > BEHIND:
        return new
    return Nodes(*(np.concatenate([a[-NODES:], b]) for a, b in zip(nodes, new, strict=True)))


def _laid_out(
    state: NavigationState, found: Found | None, ends: tuple[int, int], setup: Setup
) -> tuple[NavigationState, Motion]:
    """Lay out the rows from ``state.row`` up to the first of ``ends``; the second is known."""
    nodes, before = state.nodes, state.motion
    numbers = np.arange(state.row, ends[1])
    count = ends[0] - state.row
    time = numbers / setup.rate
    pose = pose_at(time, nodes, longest=AHEAD)
    squat = nodes.states[:, SQUAT] * float(setup.use_squat)
    constants = Constants(
        *(
            np.interp(time, nodes.time, y)
            for y in (nodes.states[:, PITCH0], nodes.states[:, YAW0], squat)
        )
    )
    grid = Even(time, _values_at(found, numbers, setup.rate))
    known = accel_along(grid, pose, constants, setup)
    half = round(0.5 * SQUAT_WIDTH * setup.rate)
    none = np.empty(0)
    last, tilt = (before.accel[-half:], before.pitch[-half:]) if before else (none, none)
    accel = held(known, float(last[-1]) if last.size else 0.0)
    read = along_body(np.concatenate([last, accel]), np.concatenate([tilt, pose.pitch]))
    force = averaged(1.0 / setup.rate, read)[last.size :]
    grade = pose.pitch - travel_angle(force, constants)
    least_std: Floats | float = setup.settings.body_pitch_std
    level = state.level
    pose = type(pose)(*(y[:count] for y in pose))
    time, known, accel, grade = time[:count], known[:count], accel[:count], grade[:count]
    if not setup.has_height:
        moved = np.hypot(pose.velocity[:, 0], pose.velocity[:, 1])
        level, grade, rest_std = _levelled_so_far(level, grade, moved, setup)
        least_std = np.hypot(least_std, rest_std)
    end_std = np.sqrt(np.maximum(np.diag(state.filter.cov), 0.0))
    end = state.filter.x
    has_scale = scale_is_found(end_std, setup)
    turn = euler_to_matrix(0.0, float(end[PITCH0]), -float(end[YAW0]))
    mounting, mounting_std = mounting_of(turn, end_std, setup)
    rows = laid_out(
        pose,
        setup,
        time=time,
        accel=accel,
        specific_force=accel + GRAVITY * np.sin(grade),
        grade=grade,
        valid=np.isfinite(known) & _aided(found, time),
        specific_force_std=setup.specific_force_std,
        specific_force_scale_std=setup.scale_std,
        grade_std=np.hypot(_grade_std_at(time, nodes), least_std),
        speed_scale=float(end[SCALE]) if has_scale else None,
        speed_scale_std=float(end_std[E_SCALE]) if has_scale else None,
        squat=float(end[SQUAT]) if setup.use_squat else None,
        squat_std=float(end_std[E_SQUAT]) if setup.use_squat else None,
        mounting=mounting,
        mounting_std=mounting_std,
        notes=setup.notes,
    )
    motion = rows
    if before is not None:
        step_way = 0.5 * (abs(before.speed[-1]) + abs(rows.speed[0])) / setup.rate
        rows = replace(rows, distance=rows.distance + before.distance[-1] + step_way)
        motion = joined([before, rows], last=round(BEHIND * setup.rate))
    return state._replace(motion=motion, row=ends[0], level=level), rows


def forward_axis(state: NavigationState, setup: Setup) -> Floats:
    """Forward axis of the vehicle in sensor axes (3,), as the mounting is known now."""
    x = state.filter.x
    turn = euler_to_matrix(0.0, float(x[PITCH0]), -float(x[YAW0]))
    return np.asarray((turn @ setup.rot_bs)[0])


def joined(parts: list[Motion], last: int | None = None) -> Motion:
    """Put successive rows together, the ``last`` of them if so many are asked for."""
    keep = slice(None if last is None else -last, None)
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])[keep]
        for name in ("time", "speed", "accel", "specific_force", "grade", "pitch", "roll",
                     "heading", "distance", "altitude", "valid", "grade_std")
    }  # fmt: skip
    return replace(parts[-1], **columns)


def forward_motion(drive: Drive, setup: Setup) -> Motion:
    """Fold a drive step by step, without smoother.

    The single numbers of the result are those at the end of the pass.

    Parameters
    ----------
    drive : the drive, or its beginning, that the setup was identified from
    setup : of `weighbridge.navigation.identify.identify`

    Raises
    ------
    DriveError
        Signals are missing.
    """
    state, parts = begin(setup, drive.start), []
    for until in step_ends(drive):
        state, rows = step(state, recent(drive, until), until, setup)
        if rows is not None:
            parts.append(rows)
    if not parts:
        raise refused("imu.nothing", drive=drive.name)
    return joined(parts)


def _gather(records: Drive, setup: Setup) -> Sources | None:
    """Gather inertial samples and what aids them; None without samples."""
    try:
        imu = read_imu(records)
    except DriveError:
        return None
    fixes = None
    if setup.origin is not None:
        fixes = read_fixes(records, -math.inf, float(imu.time[-1]), setup.origin)
    name = "vehicle_speed" if setup.has_wheel else "gnss_speed"
    reference = records.get(name)
    if reference is None and not setup.has_wheel and fixes is not None:
        reference = speed_from_fixes(fixes)
    if reference is None:
        reference = Signal(name, np.empty(0), np.empty(0))
    return Sources(records, imu, fixes, reference if setup.has_wheel else None, reference)


def _prepared(sources: Sources, setup: Setup) -> Found | None:
    """Correct the samples, place the nodes and lay the measurements out, none known too early."""
    imu, fixes, clocks = sources.imu, sources.fixes, setup.clocks
    sure = setup.is_sure(imu.time)
    if np.count_nonzero(sure) < 2:
        return None
    time = imu.time[sure]
    accel, gyro = setup.corrected(time, imu.accel[sure], imu.gyro[sure])
    first = math.ceil(time[0] * setup.rate)
    imu = Imu(time, Axes.of(accel), Axes.of(gyro), imu.period)
    grid = evenly(imu, setup.rate, first)
    reference = undelayed(sources.reference, clocks.speed_delay)
    fix_times = fixes.time - clocks.gnss_delay if fixes is not None else np.empty(0)
    nodes = place_nodes(time, fix_times, setup.rate, setup.settings.max_gap, causal=True)
    at = time[nodes]
    speed = None if sources.speed is None else reference
    z = measurements(
        at, sources.drive, speed, fixes, clocks, setup.settings,
        has_height=setup.has_height, causal=True,
    )  # fmt: skip
    wheel = reference if sources.wheel is not None else None
    z[:, Z_STILL] = still_state(at, grid, setup.rot_bs, wheel, reference, causal=True)
    open_mounting(z, at, setup.moved_time, setup.moved_var)
    return Found(Block(time, accel, gyro, nodes, z), grid, reference, fixes)


def _values_at(found: Found | None, numbers: np.ndarray, rate: float) -> Floats:
    """Low-passed samples (n, 6) of rows on the even clock; NaN where there are none."""
    values = np.full((numbers.size, 6), np.nan)
    if found is not None:
        at = numbers - round(float(found.grid.time[0]) * rate)
        inside = (at >= 0) & (at < found.grid.time.size)
        values[inside] = found.grid.values[at[inside]]
    return values


def held(y: Floats, before: float) -> Floats:
    """Hold the last value (n,) where it is NaN; ``before`` ahead of the first."""
    known = np.isfinite(y)
    last = np.maximum.accumulate(np.where(known, np.arange(y.size), -1))
    return np.where(last >= 0, y[np.maximum(last, 0)], before)


def _grade_std_at(time: Floats, nodes: Nodes) -> Floats:
    """Standard deviation of the grade (n,) at the last node [rad]."""
    place = np.searchsorted(nodes.time, time, side="right") - 1
    return np.asarray(nodes.grade_std[np.maximum(place, 0)])


def _levelled_so_far(
    level: Level, grade: Floats, moved: Floats, setup: Setup
) -> tuple[Level, Floats, Floats]:
    """Take the mean grade of the way so far off; return it and what is left of it as std (n,)."""
    way = level.way + np.cumsum(moved) / setup.rate
    total = level.moved + np.cumsum(moved)
    lifted = level.lifted + np.cumsum(grade * moved)
    trust, rest_std = level_trust(np.maximum(way, 1.0), setup)
    after = Level(float(way[-1]), float(total[-1]), float(lifted[-1]))
    return after, grade - trust * lifted / np.maximum(total, 1e-9), rest_std


def _aided(found: Found | None, time: Floats) -> Bools:
    """Return the instants (n,) not long after a speed or fix."""
    near: Bools = np.zeros(time.size, dtype=bool)
    if found is None:
        return near
    stamps = [found.reference.time] + ([found.fixes.time] if found.fixes is not None else [])
    for t in stamps:
        if t.size:
            place = np.searchsorted(t, time + AHEAD, side="right") - 1
            near |= (place >= 0) & (time - t[np.maximum(place, 0)] < LONGEST_AIDED)
    return near
