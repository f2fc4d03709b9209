"""The mass while a drive goes on: stages that look a second ahead, set up from outside.

A whole drive tells mounting, delays, levels of noise and floors once (`identify_forward`). Then
each stage reads what was recorded until soon after its instant, and no more: navigation by the
filter alone, force balance, windows, and the joint filter. What the stages tell of an instant
does not change with what comes more than `AHEAD` after it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from weighbridge.balance import force_balance
from weighbridge.balance.averaging import FEWEST, PAUSE, WINDOW
from weighbridge.errors import ConfigError, DriveError
from weighbridge.estimators import joint_forward
from weighbridge.estimators.joint_forward import JointSetup, JointState, Window, identify_joint
from weighbridge.estimators.judging import STOP
from weighbridge.estimators.slow_errors import design, usable_rows
from weighbridge.kernels import window_means
from weighbridge.kernels.ins_model import E_SQUAT, SQUAT
from weighbridge.navigation.forward import forward_motion
from weighbridge.navigation.identify import identify
from weighbridge.navigation.select import scaled_for_navigation
from weighbridge.signals import Drive, Floats
from weighbridge.vehicle.model import Vehicle

if TYPE_CHECKING:
    from weighbridge.balance.table import ForceSetup
    from weighbridge.navigation.identify.setup import Setup
    from weighbridge.pipeline.weighing import Weighing

AHEAD: Final = 1.0
"""Each stage reads so much past the instant that it tells of, at most [s]; the stages together
twice as much."""

MOVING: Final = 0.5
"""Slower a vehicle stands [m/s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ForwardSetup:
    """What the stages are given from outside.

    Attributes
    ----------
    navigation, force, joint : of the stages
    delay : lateness of the torque [s]
    period : between its readings [s]
    """

    navigation: Setup
    force: ForceSetup
    joint: JointSetup
    delay: float
    period: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ForwardTrack:
    """Running mass of a forward pass, one row per window.

    Attributes
    ----------
    time : (m,) middle of each window [s]
    mass, std : (m,) after it, fuel burnt by then taken off [kg]
    state : of the joint filter after the last window
    """

    time: Floats
    mass: Floats
    std: Floats
    state: JointState


def identify_forward(weighing: Weighing) -> ForwardSetup:
    """Take from a weighing by ``joint`` what a forward pass of the same vehicle needs.

    Parameters
    ----------
    weighing : with a mass, of a drive with an inertial sensor

    Raises
    ------
    ConfigError
        The weighing is by another method, or has no mass.
    DriveError
        The drive has no inertial sensor that can be navigated by.
    """
    result = weighing.result
    force = None if result is None else result.balance.setup
    if result is None or force is None or result.sizes is None or result.filtered is None:
        raise ConfigError(
            f"{weighing.drive.name}: a forward pass is set up by a weighing of method joint that "
            f"found a mass, not by one of {weighing.method}: {weighing.reason or 'no sizes'}"
        )
    drive, vehicle, motion = weighing.drive, weighing.vehicle, result.balance.motion
    if motion.source != "inertial":
        raise DriveError(
            f"{drive.name}: a forward pass needs accel_x..z and gyro_x..z, and this drive was "
            f"weighed by {motion.source}"
        )
    time = result.balance.merged.time
    navigation = identify(scaled_for_navigation(drive, vehicle), vehicle.mounting)
    return ForwardSetup(
        navigation=_holding(navigation, motion.squat),
        force=replace(force, foot=replace(force.foot, ahead=AHEAD)),
        joint=identify_joint(result.filtered, result.sizes),
        delay=result.balance.delay,
        period=float(np.median(np.diff(time))),
    )


def _holding(setup: Setup, squat: float | None) -> Setup:
    """Hold the squat that the weighing took out of the grade, which the filter would refine."""
    if squat is None:
        return replace(setup, use_squat=False)
    x, cov = setup.start.x.copy(), setup.start.cov.copy()
    x[SQUAT] = squat
    cov[E_SQUAT, :] = 0.0
    cov[:, E_SQUAT] = 0.0
    return replace(setup, use_squat=True, start=setup.start._replace(x=x, cov=cov))


def forward_weigh(drive: Drive, vehicle: Vehicle, setup: ForwardSetup) -> ForwardTrack:
    """Weigh a drive, or the beginning of one, as it would have been weighed on the way.

    Parameters
    ----------
    drive : as settled for the weighing of ``setup``
    vehicle
    setup : of `identify_forward`

    Raises
    ------
    DriveError
        The drive lacks signals that the setup has.
    """
    motion = forward_motion(scaled_for_navigation(drive, vehicle), setup.navigation)
    balance = force_balance(drive, vehicle, motion, delay=setup.delay, setup=setup.force)
    view = balance.merged
    sizes = setup.joint
    rows, y = design(view, vehicle, leaned=sizes.body.leaned(view.accel))
    values = np.column_stack([view.time, y, view.force_std**2, rows])
    begin = window_means.initial_state(values.shape[1])  # type: ignore[no-untyped-call]
    _, means, count, stood = window_means.run(
        begin,
        view.time,
        usable_rows(view, rows, y),
        np.nan_to_num(view.speed) > MOVING,
        values,
        window_means.WindowParams(
            length=WINDOW,
            pause=max(PAUSE, 2.5 * setup.period),
            enough=max(2, int(FEWEST * WINDOW / setup.period)),
            long_gap=STOP,
        ),
    )
    state, mass, std = JointState(), np.empty(len(means)), np.empty(len(means))
    for k, (mean, many) in enumerate(zip(means, count, strict=True)):
        window = Window(float(mean[0]), mean[3:], float(mean[1]), float(mean[2] / many), stood[k])
        state = joint_forward.step(state, window, sizes)
        mass[k], std[k] = state.mass, state.std(sizes)
    burnt = np.interp(means[:, 0], view.time, view.fuel_burnt)
    return ForwardTrack(time=means[:, 0], mass=mass - burnt, std=std, state=state)
