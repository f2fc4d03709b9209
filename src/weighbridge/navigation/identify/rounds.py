"""Identification of a drive in rounds: the motion shows the accelerometer's scale."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.kernels.ins_model import Z_STILL
from weighbridge.kernels.rotation import euler_to_matrix
from weighbridge.messages import Problem, phrase
from weighbridge.navigation.aiding import Imu, interpolated
from weighbridge.navigation.axes import Axes
from weighbridge.navigation.even import Even, coarsely, evenly
from weighbridge.navigation.filter import Block, run
from weighbridge.navigation.identify.alignment import (
    COARSE_PERIOD,
    FINE_RATE,
    Alignment,
    align,
    gnss_delay,
)
from weighbridge.navigation.identify.gain import Gain, find_gain, gravity_read
from weighbridge.navigation.identify.remounting import (
    Change,
    find_changes,
    openings,
    remounting_notes,
    undo,
    unsure,
)
from weighbridge.navigation.identify.setup import Setup, scaled
from weighbridge.navigation.identify.start import Begin, first_state, restarted, with_heading
from weighbridge.navigation.layout import Found, smoothed_motion
from weighbridge.navigation.motion import Motion
from weighbridge.navigation.rows import (
    find_clocks,
    measurements,
    open_mounting,
    place_nodes,
    still_state,
)
from weighbridge.navigation.settings import NavigationSettings
from weighbridge.navigation.sources import Sources, undelayed
from weighbridge.vehicle import Mounting

_LOG = logging.getLogger(__name__)

_FIRST_PASS: Final = 900.0
"""The first pass, which only finds the constants, ends after so long [s]."""

_SCALE_ROUNDS: Final = 4
"""A wrong scale also bends the attitude: each round finds most of what is left."""

_OPEN: Final = 0.75
"""Part of a gain that may be scale or squat that stays uncertain in the mass [-], so that an
interval of 95 % holds where all of it is scale: axes 5 and 10 % off in a car, a van and an
electric car showed 0.6 to 0.9 of it, and masses were off by 1.1 to 1.8 times the gain, 1.4 in the
median."""

_OPEN_TYRES: Final = 0.8
"""The same where no GNSS shows the speed's scale, and it may be one of the tyres [-]: an electric
car on tyres 5 % smaller read 3.4 % of it and weighed 5.6 % light."""

_CLOSER: Final = 0.6
"""A round that finds more than so much of what the one before found leads nowhere [-]."""

_FALSE_REPORTED: Final = 1e-3
"""A smaller part of false samples is left out without a note [-]."""


def navigate(
    sources: Sources, mounting: Mounting | None, settings: NavigationSettings, rate: float
) -> tuple[Setup, Motion]:
    """Identify a drive; its smoothed motion, which shows the accelerometer's scale, comes with it.

    Parameters
    ----------
    sources : of the whole drive
    mounting : known mounting and squat
    settings : noise levels and priors
    rate : of nodes and motion [Hz]
    """
    found = _identified(sources, mounting, settings, rate, _Scale())
    gravity = gravity_read(sources.imu.time, sources.imu.accel)
    before = math.inf
    for _ in range(_SCALE_ROUNDS if sources.wheel is not None else 0):
        setup, motion = found
        gain = find_gain(motion, sources.reference, gravity, again=setup.scale_std > 0.0)
        if gain is None or motion.mounting is None:
            break
        if not gain.sure:
            return _uncertain(setup, motion, gain)
        if gain.off > _CLOSER * before:
            break
        before = gain.off
        scale = _Scale(
            (*setup.gains, gain),
            euler_to_matrix(*motion.mounting)[0].copy(),
            max(gain.std, setup.scale_std),
        )
        found = _identified(sources, mounting, settings, rate, scale)
    setup, motion = found
    if setup.scale_std == 0.0:
        return found
    scale_note = _scale_note(setup, sources)
    motion = replace(
        motion,
        specific_force_scale_std=setup.scale_std,
        notes=(*motion.notes, scale_note),
    )
    return replace(setup, notes=motion.notes), motion


@dataclass(frozen=True, slots=True)
class _Scale:
    """Errors of the accelerometer's scale found so far, as in `Setup`."""

    gains: tuple[Gain, ...] = ()
    axis: np.ndarray | None = None
    std: float = 0.0


def _uncertain(setup: Setup, motion: Motion, gain: Gain) -> tuple[Setup, Motion]:
    """Report a gain that may be the sensor's scale or the squat, and widen by a part of it."""
    mean = float(np.mean(gain.value))
    alone = setup.origin is None
    tyres = phrase("or_tyres") if alone else ""
    std = (_OPEN_TYRES if alone else _OPEN) * gain.off
    note = Problem.of("imu.gain_unsure", gain=mean, tyres=tyres, std=100.0 * std)
    notes = (*motion.notes, note)
    return (
        replace(setup, scale_std=std, notes=notes),
        replace(motion, specific_force_scale_std=std, uncertain_gain=mean, notes=notes),
    )


def _scale_note(setup: Setup, sources: Sources) -> Problem:
    """Say how far the accelerometer's scale was off."""
    gain = np.ones(sources.imu.time.size)
    for part in setup.gains:
        gain = gain * part.at(sources.imu.time)
    low, high = float(np.min(gain)), float(np.max(gain))
    size = (
        f"{high:.3f}"
        if high - low < 0.005
        else phrase("gain_from_to", first=gain[0], last=gain[-1])
    )
    return Problem.of("imu.scale_corrected", gain=size)


@dataclass(frozen=True, slots=True)
class _Mounted:
    """Sensor in one mounting, aligned."""

    imu: Imu
    fine: Even
    aligned: Alignment
    changes: tuple[Change, ...]
    notes: tuple[Problem, ...]


def _mounted(sources: Sources, mounting: Mounting | None, scale: _Scale) -> _Mounted:
    """Align the sensor; where it was moved on the way, turn its later samples back first.

    Samples during which it may or may not have been moved are left out.
    """
    imu = sources.imu
    notes: tuple[Problem, ...] = ()
    if imu.false > _FALSE_REPORTED:
        notes = (Problem.of("imu.false_samples", share=100.0 * imu.false),)
    if scale.axis is not None:
        accel = scaled(imu.time, imu.accel[:], scale.gains, scale.axis)
        imu = replace(imu, accel=Axes.of(accel))
    fine = evenly(imu, FINE_RATE)
    coarse = coarsely(fine, COARSE_PERIOD)
    aligned, align_notes = align(fine, coarse, sources.reference, mounting)
    shifted = undelayed(sources.reference, aligned.speed_delay)
    altitude = sources.drive.get("altitude")
    changes = find_changes(coarse, shifted, aligned.rot_bs, altitude)
    if not changes:
        return _Mounted(imu, fine, aligned, (), (*notes, *align_notes))
    keep = ~unsure(imu.time, changes)
    time = imu.time[keep]
    values = undo(time, np.hstack([imu.accel[keep], imu.gyro[keep]]), changes)
    imu = Imu(time, Axes.of(values[:, :3]), Axes.of(values[:, 3:]), imu.period)
    fine = evenly(imu, FINE_RATE)
    coarse = coarsely(fine, COARSE_PERIOD)
    aligned, align_notes = align(fine, coarse, sources.reference, mounting)
    moved = remounting_notes(changes, float(time[0]), float(time[-1]))
    return _Mounted(imu, fine, aligned, tuple(changes), (*notes, *moved, *align_notes))


def _identified(
    sources: Sources, mounting: Mounting | None, settings: NavigationSettings, rate: float,
    scale: _Scale,
) -> tuple[Setup, Motion]:  # fmt: skip
    """Align, find the start, let a first pass find the constants; then smooth the drive."""
    mounted = _mounted(sources, mounting, scale)
    imu, aligned, fixes = mounted.imu, mounted.aligned, sources.fixes
    delay = aligned.speed_delay
    late = delay
    if sources.wheel is not None:
        late = gnss_delay(sources.drive, mounted.fine, fixes, aligned.rot_bs)
    _LOG.debug("vehicle speed late by %.3f s, GNSS by %.3f s", delay, late)
    grid = mounted.fine if rate == FINE_RATE else evenly(imu, rate)
    reference = undelayed(sources.reference, delay)
    fix_times = fixes.time - late if fixes is not None else np.empty(0)
    nodes = place_nodes(imu.time, fix_times, rate, settings.max_gap)
    node_time = imu.time[nodes]
    wheel = reference if sources.wheel is not None else None
    speed = None if sources.speed is None else reference
    clocks = find_clocks(sources.drive, speed, fixes, (delay, late), node_time)
    still = still_state(node_time, grid, aligned.rot_bs, wheel, reference)
    has_height = fixes is not None and fixes.has_height
    z = measurements(
        node_time, sources.drive, speed, fixes, clocks, settings, has_height=has_height
    )
    z[:, Z_STILL] = still
    moved_time, moved_var = openings(imu.time, mounted.changes)
    open_mounting(z, node_time, moved_time, moved_var)
    found = Found(Block(imu.time, imu.accel, imu.gyro, nodes, z), grid, reference, fixes)
    del z
    free_scale = sources.wheel is not None and fixes is not None
    begin = Begin(
        grid.time,
        grid.values[:, :3] @ aligned.rot_bs.T,
        grid.values[:, 3:] @ aligned.rot_bs.T,
        interpolated(reference, grid.time, 3.0),
        np.interp(grid.time, node_time, still) > 1.9,
    )
    setup = Setup(
        settings=settings,
        rate=rate,
        rot_bs=aligned.rot_bs,
        clocks=clocks,
        noise=settings.noise(),
        start=first_state(begin, aligned, fixes, settings, free_scale),
        given=aligned.given,
        changes=mounted.changes,
        moved_time=moved_time,
        moved_var=moved_var,
        gains=scale.gains,
        gain_axis=scale.axis,
        scale_std=scale.std,
        origin=fixes.frame if fixes is not None else None,
        has_height=has_height,
        has_wheel=sources.wheel is not None,
        notes=mounted.notes,
    )
    if fixes is not None:
        way = np.cumsum(np.nan_to_num(begin.speed)) * float(grid.time[1] - grid.time[0])
        due = replace(fixes, time=fix_times)
        start = with_heading(
            setup.start, found.block, setup, np.interp(node_time, grid.time, way), due
        )
        setup = replace(setup, start=start)
    cut = int(np.searchsorted(node_time, float(sources.imu.time[0]) + _FIRST_PASS)) + 1
    end, _ = run(setup.start, found.block.part(0, int(nodes[min(nodes.size, cut) - 1]) + 1), setup)
    rot_bs, start = restarted(setup.rot_bs, setup.start, end)
    setup = replace(setup, rot_bs=rot_bs, start=start)
    # Smoothing a day takes what memory there is.
    del still, node_time
    motion = smoothed_motion(found, setup)
    return (
        replace(
            setup,
            use_squat=motion.squat is not None,
            specific_force_std=motion.specific_force_std,
            notes=motion.notes,
        ),
        motion,
    )
