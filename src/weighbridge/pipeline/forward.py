"""The mass while a drive goes on: stages that look a second ahead, set up from outside.

A whole drive shows mounting, delays, levels of noise and floors once (`identify_forward`). Then
the drive is taken in short steps (`step`): navigation by the filter alone, force balance,
windows, and the joint filter, each from its state and the last seconds of the records. A recorded
drive is folded with the same steps (`forward_weigh`), so that a vehicle which is weighed on the
way gets the same numbers to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from weighbridge.arguments import check_number
from weighbridge.balance import WINDOW, window_params
from weighbridge.balance import forward as force_rows
from weighbridge.balance.force_balance import ForceState
from weighbridge.balance.instants import REACH
from weighbridge.balance.law import accessory_column
from weighbridge.balance.table import ForceTable
from weighbridge.errors import ConfigError, DriveError
from weighbridge.estimators.joint import forward as joint_forward
from weighbridge.estimators.joint.forward import (
    JointSetup,
    JointState,
    Window,
    identify_joint,
    resumed,
)
from weighbridge.estimators.joint.slow_errors import usable_rows
from weighbridge.estimators.joint.terms import design
from weighbridge.estimators.judging import STOP
from weighbridge.kernels import window_means
from weighbridge.kernels.ins_model import E_SQUAT, SQUAT
from weighbridge.navigation import forward
from weighbridge.navigation.select import scaled_for_navigation
from weighbridge.signals import (
    STEP,
    STEPS,
    ClockShift,
    Drive,
    Floats,
    recent,
    shifted,
    step_ends,
)
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.torque import reading_battery

if TYPE_CHECKING:
    from weighbridge.balance.table import ForceSetup
    from weighbridge.navigation.identify.setup import Setup
    from weighbridge.pipeline.weighing import Weighing

AHEAD: Final = REACH
"""The force side looks so far past a row at the motion, and twice as far at the readings [s]. What
the motion itself looks at is `weighbridge.navigation.forward.lateness`."""


HURRY: Final = 0.5
"""A look ahead waits so much less for what comes after a row [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ForwardSetup:
    """What the stages are given from outside.

    Attributes
    ----------
    vehicle : as the weighing took it
    navigation, force, joint : of the stages
    delay : lateness of the torque [s]
    period : between its readings [s]
    step : in which the records are taken [s], one of `weighbridge.signals.recent.STEPS`
    shifts : which bring the records of a table onto the clock of the others, by table

    Raises
    ------
    ConfigError
        The step is none of them.
    """

    vehicle: Vehicle
    navigation: Setup
    force: ForceSetup
    joint: JointSetup
    delay: float
    period: float
    step: float = STEP
    shifts: Mapping[str, ClockShift] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_step(self.step)

    @property
    def reach(self) -> float:
        """Time by which the records of one table lie off those of the others, in whole seconds."""
        return float(math.ceil(max((abs(s.by) for s in self.shifts.values()), default=0.0)))

    def complete(self, until: float) -> float:
        """Instant up to which records are complete where those as they come are until one [s]."""
        return min([until, *(float(s.onto(np.asarray(until))) for s in self.shifts.values())])


def check_step(step: float) -> None:
    """Refuse a step that is none of `weighbridge.signals.recent.STEPS`.

    Raises
    ------
    ConfigError
        The sentence names those there are.
    """
    check_number("step", step)
    if step not in STEPS:
        known = ", ".join(f"{s:g}" for s in STEPS)
        raise ConfigError(f"a step of {step:g} s is none that sums without rounding: take {known}")


@dataclass(frozen=True, slots=True)
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


def identify_forward(weighing: Weighing, step: float = STEP) -> ForwardSetup:
    """Take from a weighing by ``joint`` what a forward pass of the same vehicle needs.

    Parameters
    ----------
    weighing : with a mass, of a drive with an inertial sensor
    step : in which records will be taken [s]

    Raises
    ------
    ConfigError
        The weighing is by another method, or has no mass.
    DriveError
        The drive has no inertial sensor that can be navigated by.
    """
    result = weighing.result
    force = None if result is None else result.balance.setup
    if result is None or force is None or result.sizes is None or result.filter_input is None:
        raise ConfigError(
            f"{weighing.drive.name}: a forward pass is set up by a weighing of method joint that "
            f"found a mass, not by one of {weighing.method}: {weighing.reason or 'no sizes'}"
        )
    drive, vehicle, motion = weighing.drive, weighing.seen, result.balance.motion
    navigation = result.balance.navigation
    if navigation is None:
        raise DriveError(
            f"{drive.name}: a forward pass needs accel_x..z and gyro_x..z, and this drive was "
            f"weighed by {motion.source}"
        )
    time = result.balance.table.time
    return ForwardSetup(
        vehicle=reading_battery(vehicle, drive),
        navigation=_holding(navigation, motion.squat),
        force=replace(force, foot=replace(force.foot, ahead=AHEAD)),
        # What a finding leaves uncertain is uncertain on the way as well.
        joint=replace(
            identify_joint(result.filter_input, result.sizes),
            systematic_std=result.systematic_std / result.mass,
        ),
        delay=result.balance.delay,
        period=float(np.median(np.diff(time))),
        step=step,
        shifts=drive.shifts,
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


class ForwardState(NamedTuple):
    """What the stages go on from.

    Attributes
    ----------
    motion : of the navigation
    force : of the rows
    windows : of the means of rows
    joint : of the filter of the mass
    set_off : instant at which the vehicle first moved; None before [s]
    """

    motion: forward.NavigationState
    force: ForceState
    windows: window_means.WindowState
    joint: JointState
    set_off: float | None


class Running(NamedTuple):
    """The mass after some windows, one row each.

    Attributes
    ----------
    time : (m,) middle of each window [s]
    mass, std : (m,) after it, fuel burnt by then taken off [kg]
    """

    time: Floats
    mass: Floats
    std: Floats


NO_WINDOWS: Final = Running(np.empty(0), np.empty(0), np.empty(0))
"""Output of a step in which no window became complete."""


def begin(setup: ForwardSetup, start: float) -> ForwardState:
    """Return the state before the first record, which comes at ``start`` [s] or later."""
    columns = 4 + setup.joint.states.std.size
    return ForwardState(
        motion=forward.begin(setup.navigation, start),
        windows=window_means.initial_state(columns),  # type: ignore[no-untyped-call]
        force=force_rows.begin(),
        joint=JointState(),
        set_off=None,
    )


def unloaded(state: ForwardState) -> ForwardState:
    """Forget the mass, for the load has changed; motion and windows go on."""
    return state._replace(joint=JointState())


def resume(weighing: Weighing, until: float, setup: ForwardSetup) -> ForwardState:
    """Return the state after a drive that was weighed as a whole, to go on from.

    Motion and open window are those of the stages, the mass that of the weighing.

    Parameters
    ----------
    weighing : of the records
    until : instant up to which they are complete [s]
    setup : of `identify_forward`, from the weighing
    """
    drive = weighing.drive
    state, _ = _stepped(begin(setup, drive.start), drive, setup.complete(until), setup)
    load, result = state.joint.load, weighing.result
    if load is None or result is None or result.filter_input is None:
        return state
    # What was recorded after the last whole window is in the open one.
    last = load.same.time + 0.5 * WINDOW
    return state._replace(joint=resumed(result.filter_input, setup.joint, last))


def too_wide(state: ForwardState | None, setup: ForwardSetup | None) -> float:
    """Standard deviation over the mass that is too wide to be shown [-]; 0 where it is not.

    A recorded drive that leaves as much has no mass either.
    """
    if state is None or setup is None or not state.joint.windows:
        return 0.0
    joint, sizes = state.joint, setup.joint
    std = joint.std(sizes) / abs(joint.mass)
    return std if std > sizes.settings.widest else 0.0


def unfollowed_stop(state: ForwardState, *, moved: bool) -> float:
    """Longest stop after which no window is in the mass yet [s].

    With ``moved`` the vehicle drives on by now, and a stop that the state is still in counts.
    """
    windows = state.windows
    stood = max(windows.longest, windows.stood if windows.rows else 0.0)
    return float(max(stood, windows.rest) if moved else stood)


def lateness(setup: ForwardSetup) -> float:
    """Time that a row waits for what shows it [s]: delays, and look-ahead of the stages."""
    by_motion = forward.lateness(setup.navigation) + setup.force.ahead
    late = max(setup.delay, setup.force.engine_delay)
    return max(by_motion, late + setup.force.readings_ahead) - setup.complete(0.0)


def step(
    state: ForwardState, records: Drive, until: float, setup: ForwardSetup
) -> tuple[ForwardState, Running]:
    """Weigh by what came since the last step.

    Parameters
    ----------
    state : before it
    records : those of `weighbridge.signals.recent.recent`, up to ``until``, as they came; with
        `ForwardSetup.reach` more of them
    until : instant up to which records are complete [s]
    setup : of `identify_forward`

    Returns
    -------
    state : after it
    running : mass after each window that became complete
    """
    return _stepped(state, shifted(records, setup.shifts), setup.complete(until), setup)


def _stepped(
    state: ForwardState, records: Drive, until: float, setup: ForwardSetup
) -> tuple[ForwardState, Running]:
    """Weigh as `step` does, by records on one clock."""
    vehicle = setup.vehicle
    positions = setup.navigation.origin is not None
    seen = scaled_for_navigation(records, vehicle, positions=positions)
    moved, _ = forward.step(state.motion, seen, until, setup.navigation)
    state = state._replace(motion=moved)
    if moved.motion is None or moved.motion.time.size < 2:
        return state, NO_WINDOWS
    force, table, new = force_rows.step(
        state.force, records, moved.motion, until, vehicle, setup.delay, setup.force
    )
    state = state._replace(force=force)
    if table is None or new.stop <= new.start:
        return state, NO_WINDOWS
    return _folded(state, table, new, setup)


def looked_ahead(
    state: ForwardState, records: Drive, newest: float, setup: ForwardSetup
) -> ForwardState:
    """Return a copy of a state with all that came since, as far as it is known already.

    It is to look at, never to go on from: samples may be missing that still come, rows have
    `HURRY` less to look ahead, and the open window counts as `with_open` says.

    Parameters
    ----------
    state : of the stages, which is left as it is
    records : those of `step`, and those since
    newest : instant of the last of them [s]
    setup : of `identify_forward`
    """
    ahead, _ = step(state, records, newest + HURRY, setup)
    return ahead._replace(joint=with_open(ahead, setup))


def with_open(state: ForwardState, setup: ForwardSetup) -> JointState:
    """Return the filter of the mass as if the open window were over.

    The noise of its motion is that of a mean over its own, shorter time, between two ends. The
    first window after a stop tries another load, of which a part of it shows nothing: it waits.
    """
    windows, sizes = state.windows, setup.joint
    if not windows.rows or windows.stood >= STOP:
        return state.joint
    mean = windows.sums / windows.rows
    part = min(windows.rows * setup.period / WINDOW, 1.0)
    window = Window(
        time=float(mean[0]), row=mean[4:], y=float(mean[1]), accessory=float(mean[3]),
        torque_var=float(mean[2] / windows.rows), stood=windows.stood,
    )  # fmt: skip
    noisier = replace(sizes, motion_var=sizes.motion_var / part**2)
    return joint_forward.step(state.joint, window, noisier)


def _folded(
    state: ForwardState, table: ForceTable, new: slice, setup: ForwardSetup
) -> tuple[ForwardState, Running]:
    """Fold new rows of the table into windows, and complete windows into the filter."""
    sizes = setup.joint
    burnt, moving = table.fuel_burnt, table.moving
    set_off = state.set_off
    if set_off is None and moving[new].any():
        set_off = float(table.time[new][np.argmax(moving[new])])
    table = replace(table, set_off=set_off)
    squat_accel = sizes.body.squat_accel(table.specific_force)
    rows, y = design(table, setup.vehicle, sizes.states.names, squat_accel=squat_accel)
    beside = accessory_column(table, setup.vehicle)
    values = np.column_stack([table.time, y, table.force_std**2, beside, rows])
    windows, means, count, stood = window_means.run(
        state.windows,
        np.ascontiguousarray(table.time[new]),
        usable_rows(table, rows, y)[new],
        moving[new],
        values[new],
        window_params(setup.period, long_gap=STOP),
    )
    joint, mass, std = state.joint, np.empty(len(means)), np.empty(len(means))
    for k, (mean, many) in enumerate(zip(means, count, strict=True)):
        window = Window(
            time=float(mean[0]), row=mean[4:], y=float(mean[1]), accessory=float(mean[3]),
            torque_var=float(mean[2] / many), stood=stood[k],
        )  # fmt: skip
        joint = joint_forward.step(joint, window, sizes)
        mass[k], std[k] = joint.mass, joint.std(sizes)
    light = np.interp(means[:, 0], table.time, burnt)
    after = state._replace(
        windows=windows,
        joint=joint,
        set_off=set_off,
    )
    return after, Running(means[:, 0], mass - light, std)


def forward_weigh(drive: Drive, setup: ForwardSetup) -> ForwardTrack:
    """Weigh a drive, or the beginning of one, as it would have been weighed on the way.

    Parameters
    ----------
    drive : as corrected for the weighing of ``setup``
    setup : of `identify_forward`
    """
    state, parts = begin(setup, drive.start), [NO_WINDOWS]
    for until in step_ends(drive, setup.step):
        state, running = _stepped(state, recent(drive, until, setup.step), until, setup)
        parts.append(running)
    time, mass, std = (np.concatenate(rows) for rows in zip(*parts, strict=True))
    return ForwardTrack(time, mass, std, state.joint)
