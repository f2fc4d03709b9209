"""Mass beside the slow errors that look like it: disturbance, wind, resistance, cold."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.balance import ForceBalance, Reason, Windows, windows
from weighbridge.balance.force_balance import highest_torque
from weighbridge.balance.law import accessory_column, traction_gain
from weighbridge.balance.table import ForceTable
from weighbridge.constants import GRAVITY
from weighbridge.estimators.considered import fit_consider_std, force_columns, sensitivity
from weighbridge.estimators.joint.bend import KNEE, above_knee, torque_bend
from weighbridge.estimators.joint.load_stops import (
    change_odds,
    stood_before,
    unseen_std,
)
from weighbridge.estimators.joint.possible import averaged
from weighbridge.estimators.joint.problem import (
    UNMODELLED,
    FilterInput,
    JointSizes,
    Problem,
    States,
    states_of,
)
from weighbridge.estimators.joint.settings import JointSettings
from weighbridge.estimators.joint.slow_errors import (
    SlowErrors,
    inertia_relative_std,
    noise_variance,
    usable_rows,
    window_motion_variance,
    with_variance,
)
from weighbridge.estimators.joint.switched import Switched, find_switched, without_switched
from weighbridge.estimators.joint.terms import A_DRIVE, Sizes, design
from weighbridge.estimators.judging import (
    HIDDEN_BRAKE_STD,
    OTHER_METHOD_STD,
    Evidence,
    converged_at,
    judge,
    lacks_accelerometer,
    nothing,
    sampled_otherwise,
)
from weighbridge.estimators.noisy_motion import (
    OF_A_WALK,
    UNANSWERED_STD,
    MotionNoise,
    attenuation,
    between_samples,
    learnt_noise,
    left_open,
    short_of_power,
    unmeasured_noise,
)
from weighbridge.estimators.squat import ResidualSquat, residual_squat
from weighbridge.estimators.torque_shape import shape_columns, shape_std
from weighbridge.estimators.track import MassTrack, Segment
from weighbridge.kernels import disturbance
from weighbridge.navigation import BY_SPEED, MotionSource
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle import FUEL_STD, Vehicle, by_data_sheet, scale_std

BEYOND_STD: Final = 0.015
"""Relative standard deviation of a mass per unit of the logarithm by which it lies beyond
those of the calibration [-]: torque is used where its fit has seen little."""

JOINT_MOTION_STD: Final[dict[MotionSource, float]] = {
    "inertial": 0.0,
    "longitudinal_accel": 0.01,
    "speed_grade": 0.012,
    "speed": 0.025,
}
"""Relative standard deviation of a mass by how the motion was found [-]. By speed and heights, 116
drives of 29 simulated vehicles are likeliest with 0, and so are 13 of a third simulator; their
receivers are of one quality. By speed alone, ten simulated drives scattered by 2.2 %."""

OTHER_MOTION_STD: Final[dict[MotionSource, float]] = {"speed_grade": 0.04, "speed": 0.09}
"""The same where the vehicle file was made with an accelerometer [-]: eight drives of another
simulator came out 3.4 % (RMS) light with heights, and 10 % without."""


UNCALIBRATED_MOTION_STD: Final[dict[MotionSource, float]] = {"speed_grade": 0.05, "speed": 0.09}
"""The same where a data sheet is all there is, beside `JOINT_MOTION_STD`, of classes whose noise
of the motion is not known [-]."""

OTHER_RATE_STD: Final = 0.04
"""The same where the torque of the calibration came at another rate, see `sampled_otherwise` [-]:
of ten trucks of two simulators, 1 Hz with a file of 5 Hz and the other way round."""

UNREPORTED_RETARDER_STD: Final = 0.08
"""The same of a data sheet alone where a retarder may work that nothing reports [-]: nine drives
of a simulated truck and bus at 1 Hz came out 9 % light with their retarder logged, 13 % without."""


def first_guess(phi: Floats, y: Floats) -> float:
    """Robust slope of force on specific force: where the filter starts [kg].

    The filter is linear, so the start only has to be of the right size.
    """
    strong = np.abs(phi) >= np.median(np.abs(phi))
    return _sensible(float(np.median(y[strong] / phi[strong])))


def _sensible(mass: float) -> float:
    return float(np.clip(mass, 50.0, 60_000.0)) if np.isfinite(mass) else 2000.0


def estimate(
    balance: ForceBalance,
    vehicle: Vehicle,
    settings: JointSettings | None = None,
    *,
    load_changes: bool = True,
) -> MassTrack:
    """Weigh by a Kalman filter of the mass and the slow errors of `slow_errors`.

    Usable rows, braking and overrun aside, are averaged over windows of
    `weighbridge.balance.averaging.WINDOW`, both sides over the same rows. The
    levels of fast noise and of the disturbance are those of highest
    likelihood. After every stop a second filter tries whether the load has
    changed; the running mass is the mean of both. The final answer is that of
    the whole drive smoothed, at its end: the fuel burnt by then is taken off,
    and where the load has changed, it is the mass after the last change; the
    segments show those before.

    Parameters
    ----------
    balance, vehicle
    settings : the defaults when None
    load_changes : the load may change at stops; not where the mass is known

    References
    ----------
    Kalman filter with Gauss-Markov disturbances and maximum likelihood for
    their levels: Gelb, Applied Optimal Estimation, 1974, ch. 3, 4; Schweppe,
    IEEE Trans. Information Theory 11, 1965. Parameters that no data of the
    drive can improve are considered, not estimated: Schmidt, 1966.
    """
    settings = settings or JointSettings()
    table = balance.table
    grade = balance.motion.unmeasured_grade
    rows, y = design(table, vehicle, settings.terms, unmeasured_grade=grade)
    usable = usable_rows(table, rows, y)
    cut = windows(table.time, usable)
    row_reason = table.reason.copy()
    row_reason[table.usable] = Reason.NO_MOTION
    row_reason[usable] = Reason.TOO_SHORT
    row_reason[cut.index] = Reason.USED
    if cut.count.size < settings.fewest_windows:
        return nothing("joint", balance, vehicle, row_reason, int(cut.count.size), settings)
    noise = learnt_noise(balance, vehicle, cut)
    given = balance
    if noise.learnt:
        balance = replace(balance, motion=with_variance(balance.motion, noise.variance))
    rough = first_guess(cut.mean(rows[:, 0]), cut.mean(y))
    asked = _ask(balance, vehicle, cut, rough, settings)
    if not load_changes:
        problem = replace(asked.problem, odds=np.full(asked.stood.size, np.nan))
        asked = replace(asked, problem=problem)
    solved = _solve(asked)
    found = None
    if balance.motion.source not in BY_SPEED:
        # Hills that nothing measures look alike.
        column = cut.mean(accessory_column(table, vehicle))
        levels, known = (solved.fast, solved.slow), vehicle.provenance.switched_power
        found = find_switched(asked.problem, column, solved.added, levels, known)
    if found is not None:
        asked = replace(
            asked,
            problem=without_switched(asked.problem, column, found),
            y=asked.y - found.force(table, vehicle),
            switched=found,
        )
        solved = _solve(asked)
    track = _track(balance, vehicle, cut, row_reason, asked, solved, noise)
    # Weighed again, it is learnt again.
    return replace(track, balance=given)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Asked:
    """The problem of a drive and what it was made from.

    Attributes
    ----------
    problem
    body : squat that rows and torque do not have in common
    rows, y : (n, k), (n,) of `weighbridge.estimators.joint.slow_errors.design`
    stood : (m,) how long the vehicle stood before each window [s]
    switched : what is switched on and off, taken out of problem and ``y``; None where nothing is
    """

    problem: Problem
    body: ResidualSquat
    rows: Floats
    y: Floats
    stood: Floats
    switched: Switched | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Solved:
    """What the filter and its smoother found, one row per window.

    Attributes
    ----------
    fast, slow : levels of the noise over their usual sizes [-]
    start, noise, params, added : what they were given
    running, running_var : (m,) mass by the windows until then, and its variance
    begins : (m,) windows from which the load is another
    x, var, taken, weight : of `weighbridge.kernels.disturbance.smooth`
    """

    fast: float
    slow: float
    start: disturbance.DisturbanceState
    noise: Floats
    params: disturbance.DisturbanceParams
    added: Floats
    running: Floats
    running_var: Floats
    begins: Bools
    x: Floats
    var: Floats
    taken: Bools
    weight: Floats


def _ask(
    balance: ForceBalance, vehicle: Vehicle, cut: Windows, rough: float, settings: JointSettings
) -> _Asked:
    """State the problem of a drive whose mass is ``rough`` [kg]."""
    table = balance.table
    time = cut.mean(table.time)
    stood = stood_before(table, time)

    def of(mass: float | None) -> _Asked:
        """Squat and levels of noise are relative to a mass [kg]."""
        body = residual_squat(balance, vehicle, mass or rough)
        squat_accel = body.squat_accel(table.specific_force)
        rows, y = design(
            table,
            vehicle,
            settings.terms,
            squat_accel=squat_accel,
            unmeasured_grade=balance.motion.unmeasured_grade,
        )
        means, sums = np.ascontiguousarray(cut.mean(rows)), cut.mean(y)
        guess = mass or first_guess(means[:, 0], sums)
        problem = Problem(
            time=time,
            rows=means,
            y=sums,
            odds=change_odds(stood, by_speed=balance.motion.source in BY_SPEED),
            variance=noise_variance(table, cut, guess, balance.motion),
            states=_states(balance, vehicle, cut, guess, settings),
            settings=settings,
        )
        return _Asked(problem=problem, body=body, rows=rows, y=y, stood=stood)

    # They should not depend on the guess.
    return of(_sensible(of(None).problem.mass_unchanged()))


def _solve(asked: _Asked) -> _Solved:
    """Find the levels of noise, the changes of load and the smoothed states."""
    problem = asked.problem
    fast, slow = problem.likeliest()
    start, noise, params = problem.kernel_input(fast, slow)
    _, running, running_var, begins = problem.changes(fast, slow)
    added = np.where(begins[:, None], problem.states.jump_std**2, 0.0)
    x, var, taken, weight = disturbance.smooth(
        start, problem.time, problem.rows, problem.y, noise, added, params
    )
    return _Solved(
        fast=fast,
        slow=slow,
        start=start,
        noise=noise,
        params=params,
        added=added,
        running=running,
        running_var=running_var,
        begins=begins,
        x=x,
        var=var,
        taken=taken,
        weight=weight,
    )


def _track(
    balance: ForceBalance,
    vehicle: Vehicle,
    cut: Windows,
    row_reason: NDArray[np.uint8],
    asked: _Asked,
    solved: _Solved,
    noise: MotionNoise,
) -> MassTrack:
    """Lay out the running mass and judge the final one."""
    table, problem, time = balance.table, asked.problem, asked.problem.time
    by_speed = balance.motion.source in BY_SPEED
    attenuating, unsure = _attenuating(balance, vehicle, cut, solved, noise)
    low = attenuation(solved.weight, attenuating, solved.var[:, 0], solved.begins)

    left_out = np.zeros(table.time.size, dtype=bool)
    left_out[cut.index] = ~solved.taken[cut.window]
    row_reason[left_out] = Reason.BAD_FIT
    used = row_reason == Reason.USED
    burnt = table.fuel_burnt
    smoothed, running = solved.x[:, 0] * (1.0 + low), solved.running * (1.0 + low)
    made = vehicle.provenance
    factor = made.std_factor or UNMODELLED
    given = _given(asked, solved, cut.mean(table.traction_force - asked.y))
    end, _, possible = averaged(given, problem.states, problem.settings, factor)
    stds = np.sqrt(solved.var[:, 0])
    smoothed[-1], stds[-1] = end.x[0] * (1.0 + low[-1]), np.sqrt(end.cov[0, 0])
    mass, bound = float(smoothed[-1] - burnt[-1]), float(np.sqrt(solved.var[-1, 0]))
    torque_of = np.nan_to_num(table.torque)
    torque = cut.mean(table.torque)
    bends = shape_columns(table, vehicle, made.highest_torque or float(np.max(torque)))
    columns = force_columns(balance, vehicle, float(smoothed[-1]))
    moved = _moved(problem, solved, cut.mean(np.hstack([columns, bends])))
    moved, shape_moved = np.split(moved, [columns.shape[1]])
    knee = KNEE * float(np.quantile(torque, 0.995))
    bend = None
    if balance.motion.source not in BY_SPEED:
        gain = np.nan_to_num(traction_gain(vehicle, torque_of, np.nan_to_num(table.gearing)))
        above = above_knee(torque_of, gain, knee)
        bend = torque_bend(given, cut.mean(above), cut.mean(gain), knee)
    phi = asked.rows[:, 0]
    systematic = math.hypot(
        _systematic_std(balance, vehicle, mass),
        unseen_std(asked.stood, vehicle.of_class.boarding_std) if by_speed else 0.0,
        asked.body.relative_std,
        _air_std(balance, problem, solved, cut) / max(mass, 1.0),
        inertia_relative_std(vehicle, mass, table.accel, phi, used),
        factor * fit_consider_std(vehicle, moved, mass),
        factor * shape_std(shape_moved / mass, made.torque_use) if mass > 0.0 else 0.0,
        left_open(float(low[-1]), unsure),
    )
    std = float(np.hypot(factor * stds[-1], mass * systematic))
    last = np.searchsorted(time, table.time, side="right") - 1
    seen = np.maximum(last, 0)
    track = np.where(last >= 0, running[seen] - burnt, np.nan)
    track_std = factor * np.sqrt(solved.running_var)[seen]
    evidence = Evidence(
        table=table, used=used, phi=phi, mass=mass, std=std, blocks=cut.count.size,
        systematic_std=mass * systematic, motion=balance.motion, gate=problem.settings,
    )  # fmt: skip
    status, reason = judge(evidence, vehicle)
    return MassTrack(
        method="joint",
        balance=balance,
        running_mass=track,
        running_std=np.where(last >= 0, np.hypot(track_std, track * systematic), np.nan),
        residual=np.where(used, asked.y - _explained(asked, solved.x[seen]), np.nan),
        row_reason=row_reason,
        mass=mass,
        std=std,
        systematic_std=mass * systematic,
        degrees_of_freedom=float("inf"),
        bound_std=bound,
        sensitivity=moved,
        shape_sensitivity=shape_moved,
        converged_at=converged_at(table.time, track, mass, used),
        status=status,
        reason=reason,
        segments=_segments(table, time, solved.begins, smoothed, factor * stds, systematic),
        slow_errors=SlowErrors.from_states(
            time, problem.states, solved.x, solved.var, solved.running_var, problem.rows
        ),
        filter_input=given,
        possible_change=possible,
        bend=bend,
        switched=asked.switched,
        sizes=_sizes(balance, asked, solved, attenuating, systematic, factor),
    )


def _attenuating(
    balance: ForceBalance, vehicle: Vehicle, cut: Windows, solved: _Solved, noise: MotionNoise
) -> tuple[Floats, float]:
    """Noise of the motion by window (m,) [m^2/s^4], and how unsure its size is [-]."""
    table, motion = balance.table, balance.motion
    if motion.source not in BY_SPEED or not vehicle.of_class.underpowered:
        # More noise than usual is more likely the torque's; less is less on both sides.
        shown = noise.variance if noise.learnt else min(solved.fast, 1.0) ** 2 * noise.variance
        return np.full(cut.count.size, shown), noise.std / noise.variance
    found = unmeasured_noise(
        np.where(solved.taken, solved.weight, 0.0),
        solved.noise,
        OF_A_WALK * between_samples(table.time, table.traction_force, table.usable) / cut.count,
        short_of_power(cut.mean(np.nan_to_num(table.torque))),
        GRAVITY * np.interp(cut.mean(table.time), motion.time, motion.grade_std),
        float(solved.x[-1, 0]),
        float(solved.var[-1, 0]),
    )
    # The drives of a calibration are as low, so that its scale contains how low all are.
    return found, UNANSWERED_STD if by_data_sheet(vehicle) else 0.0


def _moved(problem: Problem, solved: _Solved, columns: Floats) -> Floats:
    """How far one unit of each of the columns (m, k) moves the mass at the end (k,) [kg]."""
    return sensitivity(
        columns, problem.time, problem.rows, solved.noise, solved.added, solved.taken,
        solved.start, solved.params,
    )  # fmt: skip


def _air_std(balance: ForceBalance, problem: Problem, solved: _Solved, cut: Windows) -> float:
    """Standard deviation of the mass by what the air leaves open of the torque [kg]."""
    if balance.air_std == 0.0:
        return 0.0
    column = cut.mean(np.nan_to_num(balance.table.traction_force))
    return balance.air_std * abs(float(_moved(problem, solved, column[:, None])[0]))


def _sizes(
    balance: ForceBalance,
    asked: _Asked,
    solved: _Solved,
    attenuating: Floats,
    systematic: float,
    factor: float,
) -> JointSizes:
    """Keep what the drive shows of noise; ``attenuating`` is that of the motion [m^2/s^4]."""
    return JointSizes(
        states=asked.problem.states,
        fast=solved.fast,
        slow=solved.slow,
        body=asked.body,
        motion_var=window_motion_variance(balance.motion),
        noise_information=float(np.sum(attenuating * solved.weight)),
        systematic_std=systematic,
        std_factor=factor,
        switched_power=0.0 if asked.switched is None else asked.switched.power,
        settings=asked.problem.settings,
    )


def _given(asked: _Asked, solved: _Solved, beside: Floats) -> FilterInput:
    """Keep what the filter was given; ``beside`` (m,) is the force that is no row's [N]."""
    problem = asked.problem
    return FilterInput(
        start=solved.start,
        params=solved.params,
        time=problem.time,
        rows=problem.rows,
        y=problem.y,
        noise=solved.noise,
        added=solved.added,
        stood=asked.stood,
        odds=problem.odds,
        traction=problem.rows[:, 0] * solved.x[:, 0] + beside,
    )


def _explained(asked: _Asked, x: Floats) -> Floats:
    """Force of the mass and of what lasts as long as the drive, by states (n, k) (n,) [N].

    Disturbance, slow resistance and wind stay in the residual.
    """
    rows, lasting = asked.rows, asked.problem.states.time_constant > A_DRIVE
    lasting[0] = False
    return np.asarray(rows[:, 0] * x[:, 0] + np.sum((rows * x)[:, lasting], axis=1))


def _systematic_std(balance: ForceBalance, vehicle: Vehicle, mass: float) -> float:
    """Relative standard deviation that no row of this drive can take away [-]."""
    made = vehicle.provenance
    scale = made.mass_scale_std if made.mass_scale_std is not None else scale_std(vehicle)
    left = math.hypot(
        scale,
        JOINT_MOTION_STD[balance.motion.source],
        balance.motion.specific_force_scale_std,
        balance.coarse_std,
    )
    if balance.brake_hidden:
        left = float(np.hypot(left, HIDDEN_BRAKE_STD))
    if lacks_accelerometer(vehicle, balance.motion):
        left = float(np.hypot(left, OTHER_MOTION_STD[balance.motion.source]))
    if sampled_otherwise(vehicle, balance) is not None:
        left = float(np.hypot(left, OTHER_RATE_STD))
    if by_data_sheet(vehicle) and balance.motion.source in BY_SPEED:
        if not vehicle.of_class.underpowered:
            left = float(np.hypot(left, UNCALIBRATED_MOTION_STD[balance.motion.source]))
        if balance.retarder_unreported:
            left = float(np.hypot(left, UNREPORTED_RETARDER_STD))
    if made.fit is not None and made.fit.torque and not made.fit.refined:
        left = float(np.hypot(left, OTHER_METHOD_STD))
    if not mass > 0.0:
        return left
    # When the rows weigh, half of the fuel is gone, in the mean.
    fuel = 0.5 * float(balance.table.fuel_burnt[-1]) / mass
    left = float(np.hypot(left, FUEL_STD * fuel))
    if made.masses:
        above, below = np.log(mass / max(made.masses)), np.log(min(made.masses) / mass)
        left = float(np.hypot(left, BEYOND_STD * max(above, below, 0.0)))
    return left


def _states(
    balance: ForceBalance, vehicle: Vehicle, cut: Windows, guess: float, settings: JointSettings
) -> States:
    """Return the states before the drive has shown, of a rough mass [kg]."""
    torque = highest_torque(balance.table.torque[cut.index])
    return states_of(vehicle, Sizes(guess, torque, balance.motion.unmeasured_grade), settings)


def _segments(
    table: ForceTable, time: Floats, begins: Bools, mass: Floats, own: Floats, systematic: float
) -> tuple[Segment, ...]:
    """Stretches of one load: the mass at the end of each, smoothed over the whole drive."""
    first = np.concatenate(([0], np.flatnonzero(begins)))
    last = np.concatenate((first[1:], [time.size])) - 1
    edges = [float(table.time[0])]
    for k in first[1:]:
        # The load changed while the vehicle stood: the segment begins as it drives off.
        between = (table.time > time[k - 1]) & (table.time <= time[k])
        rests = np.flatnonzero(between & ~table.moving)
        edges.append(float(table.time[rests[-1]]) if rests.size else float(time[k]))
    edges.append(float(table.time[-1]))
    burnt = np.interp(edges[1:], table.time, table.fuel_burnt)
    return tuple(
        Segment(
            start=edges[j],
            end=edges[j + 1],
            mass=float(mass[k] - burnt[j]),
            std=float(np.hypot(own[k], mass[k] * systematic)),
        )
        for j, k in enumerate(last)
    )
