"""Motion without smoother: each row from what is known soon after it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.kernels.ins_model import (
    E_SCALE,
    E_SQUAT,
    PITCH0,
    S_GRADE,
    SCALE,
    SQUAT,
    YAW0,
    Z_STILL,
)
from weighbridge.kernels.rotation import euler_to_matrix
from weighbridge.navigation.even import evenly
from weighbridge.navigation.filter import Block, Nodes, run
from weighbridge.navigation.identify.setup import Setup
from weighbridge.navigation.layout import (
    LONGEST_AIDED,
    Constants,
    Found,
    accel_along,
    averaged,
    laid_out,
    level_trust,
    mounting_of,
    pose_at,
    scale_is_found,
)
from weighbridge.navigation.motion import Motion
from weighbridge.navigation.rows import (
    AHEAD,
    measurements,
    open_mounting,
    place_nodes,
    still_state,
)
from weighbridge.navigation.sources import Sources, read_sources, undelayed
from weighbridge.signals import Bools, Drive, Floats


def forward_motion(drive: Drive, setup: Setup) -> Motion:
    """Fold a drive and lay the forward pass out on the even clock, without smoother.

    A row knows the drive up to 0.3 s past its instant at 20 Hz, and what the setup took from the
    whole drive: mounting, delays, noise levels, changes of mounting, scale of the accelerometer.
    A record that is late by a delay is taken to come so much earlier. The single numbers of the
    result are those at the end of the pass.

    Parameters
    ----------
    drive : the drive, or its beginning, that the setup was identified from
    setup : of `weighbridge.navigation.identify.identify`

    Raises
    ------
    DriveError
        Signals are missing.
    """
    found = _prepared(read_sources(drive), setup)
    state, nodes = run(setup.start, found.block, setup)
    time = found.grid.time
    pose = pose_at(time, nodes, longest=AHEAD)
    squat = nodes.states[:, SQUAT] * float(setup.use_squat)
    constants = Constants(
        *(
            np.interp(time, nodes.time, y)
            for y in (nodes.states[:, PITCH0], nodes.states[:, YAW0], squat)
        )
    )
    known = accel_along(found.grid, pose, constants, setup)
    accel = held(known)
    grade = pose.pitch - constants.pitch0 - constants.squat * averaged(time, accel)
    floor: Floats | float = setup.settings.body_pitch_std
    if not setup.has_height:
        moved = np.hypot(pose.velocity[:, 0], pose.velocity[:, 1])
        grade, left = _levelled_so_far(grade, moved, float(time[1] - time[0]), setup)
        floor = np.hypot(floor, left)
    end_std = np.sqrt(np.maximum(np.diag(state.cov), 0.0))
    has_scale = scale_is_found(end_std, setup)
    turn = euler_to_matrix(0.0, float(state.x[PITCH0]), -float(state.x[YAW0]))
    mounting, mounting_std = mounting_of(turn, end_std, setup)
    return laid_out(
        pose,
        setup,
        time=time,
        accel=accel,
        specific_force=accel + GRAVITY * np.sin(grade),
        grade=grade,
        valid=np.isfinite(known) & (time >= found.block.time[0]) & _aided(found),
        specific_force_std=setup.specific_force_std,
        specific_force_scale_std=setup.scale_std,
        grade_std=np.hypot(_at(time, nodes, S_GRADE), floor),
        speed_scale=float(state.x[SCALE]) if has_scale else None,
        speed_scale_std=float(end_std[E_SCALE]) if has_scale else None,
        squat=float(state.x[SQUAT]) if setup.use_squat else None,
        squat_std=float(end_std[E_SQUAT]) if setup.use_squat else None,
        mounting=mounting,
        mounting_std=mounting_std,
        notes=setup.notes,
    )


def _prepared(sources: Sources, setup: Setup) -> Found:
    """Correct the samples, place the nodes and lay the measurements out, none known too early."""
    imu, fixes, clocks = sources.imu, sources.fixes, setup.clocks
    sure = setup.is_sure(imu.time)
    time = imu.time[sure]
    accel, gyro = setup.corrected(time, imu.accel[sure], imu.gyro[sure])
    grid = evenly(replace(imu, time=time, accel=accel, gyro=gyro), setup.rate)
    reference = undelayed(sources.reference, clocks.speed_delay)
    fix_times = fixes.time - clocks.gnss_delay if fixes is not None else np.empty(0)
    nodes = place_nodes(time, fix_times, setup.rate, setup.settings.max_gap, causal=True)
    at = time[nodes]
    speed = None if sources.speed is None else reference
    z = measurements(at, sources.drive, speed, fixes, clocks, setup.settings, causal=True)
    wheel = reference if sources.wheel is not None else None
    z[:, Z_STILL] = still_state(at, grid, setup.rot_bs, wheel, reference, causal=True)
    open_mounting(z, at, setup.moved_time, setup.moved_var)
    return Found(Block(time, accel, gyro, nodes, z), grid, reference, fixes)


def held(y: Floats) -> Floats:
    """Hold the last value (n,) where it is NaN; 0 before the first."""
    known = np.isfinite(y)
    last = np.maximum.accumulate(np.where(known, np.arange(y.size), -1))
    return np.where(last >= 0, y[np.maximum(last, 0)], 0.0)


def _at(time: Floats, nodes: Nodes, std: int) -> Floats:
    """Standard deviation (n,) of the last node."""
    place = np.searchsorted(nodes.time, time, side="right") - 1
    return np.asarray(nodes.stds[np.maximum(place, 0), std])


def _levelled_so_far(
    grade: Floats, moved: Floats, period: float, setup: Setup
) -> tuple[Floats, Floats]:
    """Take the mean grade of the way so far off; return it and what is left of it as std (n,)."""
    way = np.maximum(np.cumsum(moved) * period, 1.0)
    mean = np.cumsum(grade * moved) / np.maximum(np.cumsum(moved), 1e-9)
    trust, left = level_trust(way, setup)
    return grade - trust * mean, left


def _aided(found: Found) -> Bools:
    """Tell the instants (n,) not long after a speed or fix."""
    time = found.grid.time
    stamps = [found.reference.time] + ([found.fixes.time] if found.fixes is not None else [])
    near: Bools = np.zeros(time.size, dtype=bool)
    for t in stamps:
        place = np.searchsorted(t, time + AHEAD, side="right") - 1
        near |= (place >= 0) & (time - t[np.maximum(place, 0)] < LONGEST_AIDED)
    return near
