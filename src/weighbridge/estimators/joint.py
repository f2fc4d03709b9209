"""Mass beside the slow errors that look like it: disturbance, wind, resistance, cold."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import minimize

from weighbridge.balance import ForceBalance, Reason
from weighbridge.balance.averaging import Windows, windows
from weighbridge.balance.force_balance import highest_torque
from weighbridge.balance.table import MergedView
from weighbridge.estimators.confounded import inertia_relative_std
from weighbridge.estimators.considered import force_columns, open_std, sensitivity
from weighbridge.estimators.judging import (
    HIDDEN_BRAKE_STD,
    OTHER_METHOD_STD,
    STOP,
    Evidence,
    converged_at,
    judge,
    lacks_accelerometer,
    nothing,
)
from weighbridge.estimators.noisy_motion import LEVEL_STD, drawn
from weighbridge.estimators.slow_errors import (
    LASTING,
    SlowErrors,
    design,
    filter_params,
    motion_variance,
    noise_variance,
    prior_std,
    usable_rows,
)
from weighbridge.estimators.squat import Lean, lean
from weighbridge.estimators.track import FilterInput, MassTrack, Segment
from weighbridge.kernels import disturbance, load_change
from weighbridge.navigation.motion import MotionSource
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle.data_sheet import scale_std
from weighbridge.vehicle.fuel import FUEL_STD
from weighbridge.vehicle.model import Vehicle

GATE: Final = 5.0
"""Windows with a larger normalised innovation are left out [-]."""

FEWEST_WINDOWS: Final = 8
"""Fewer usable windows carry no mass, after a stop no change of it."""

SETTLE: Final = 40
"""Windows before the gate closes."""

CHANGE_STD: Final = 0.25
"""Standard deviation of a change of load at a stop, over mass [-]."""

CHANGE_ODDS: Final = -3.0
"""Logarithm of the odds that the load changes at a stop of `STOP`: one stop in twenty, for
most are at traffic lights."""

SHORTEST: Final = 8.0
"""In shorter stops no load changes [s]: a parcel is handed out in ten. Of 68 drives of two other
simulators, without a change of load, one was said to have one, with `STOP` in its place three."""

OPENED: Final = 3.0
"""Nobody gets on or off so soon after the vehicle stands [s]."""

LOADED: Final = 0.025
"""Part of the mass that a second beyond `OPENED` loads or unloads at most, in a stop shorter than
`STOP` [1/s]: 45 kg of a car, two and a half times what buses board."""

MOST_LOADED: Final = 0.3
"""The same of the whole stop [-]."""

CHANGE_RISE: Final = 1.6
"""Growth of that logarithm with the logarithm of the standstill: at two minutes it is even."""

LOAD_LEAN_STD: Final = 0.03
"""Standard deviation of what a change of load adds to the slow resistance, over mass [m/s^2]:
the body leans with its load, and the accelerometer with it; 240 kg in the boot of a simulated car
make 0.27 deg, 0.046 m/s^2."""

BEYOND_STD: Final = 0.015
"""Relative standard deviation of a mass per unit of the logarithm by which it lies beyond
those of the calibration [-]: torque is used where its fit has seen little."""

MOTION_STD: Final[dict[MotionSource, float]] = {
    "inertial": 0.0,
    "longitudinal_accel": 0.01,
    "speed_grade": 0.025,
    "speed": 0.025,
}
"""Relative standard deviation of a mass by how the motion was found [-]: ten simulated drives
weighed by speed, with vehicle files made with an inertial sensor, scattered by 2.2 %."""

OTHER_MOTION_STD: Final[dict[MotionSource, float]] = {"speed_grade": 0.04, "speed": 0.09}
"""The same where the vehicle file was made with an accelerometer [-]: eight drives of another
simulator came out 3.4 % (RMS) light with heights, and 10 % without."""

UNMODELLED: Final = 1.6
"""Errors of the mass over what the filter says of them [-]: simulated drives of one
calibration scatter so around their mean, after five minutes as after an hour."""


def first_guess(phi: Floats, y: Floats) -> float:
    """Robust slope of force on specific force: where the filter starts [kg].

    The filter is linear, so the start only has to be of the right size.
    """
    strong = np.abs(phi) >= np.median(np.abs(phi))
    return _sensible(float(np.median(y[strong] / phi[strong])))


def _sensible(mass: float) -> float:
    return float(np.clip(mass, 200.0, 60_000.0)) if np.isfinite(mass) else 2000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Problem:
    """What the kernels need, one row per window."""

    time: Floats
    rows: Floats
    y: Floats
    odds: Floats
    variance: Floats
    std: Floats

    @property
    def guess(self) -> float:
        return float(self.std[0])

    def kernel_input(
        self, fast: float, slow: float
    ) -> tuple[disturbance.DisturbanceState, Floats, disturbance.DisturbanceParams]:
        """State to start from, noise variance and parameters at a level of noise."""
        std = self.std.copy()
        std[1] *= slow
        begin = np.zeros(std.size)
        begin[0] = self.guess
        start = disturbance.initial_state(  # type: ignore[no-untyped-call]
            begin, np.diag(std**2), self.time[0]
        )
        return start, fast**2 * self.variance, filter_params(std, GATE, SETTLE)

    @property
    def jump_var(self) -> Floats:
        """Variance (n,) by which each state may jump where the load changes."""
        std = np.zeros(self.std.size)
        std[0] = CHANGE_STD * self.guess
        std[2] = LOAD_LEAN_STD * self.guess
        return std**2

    def likeliest(self) -> tuple[float, float]:
        """Levels of fast noise and of the disturbance, over their usual sizes [-].

        A weak prior keeps them within a factor of about three.
        """

        def misfit(level: Floats) -> float:
            fast, slow = np.exp(level)
            state, *_ = self.changes(float(fast), float(slow))
            return float(-state.same.log_likelihood + 0.5 * np.sum(level**2))

        found = minimize(misfit, np.zeros(2), method="Nelder-Mead", options={"maxiter": 40})
        fast, slow = np.exp(found.x)
        return float(fast), float(slow)

    def filtered(self) -> float:
        """Mass after all windows, as if the load had never changed [kg]."""
        start, noise, params = self.kernel_input(1.0, 1.0)
        none = np.zeros(self.rows.shape)
        state, *_ = disturbance.run(start, self.time, self.rows, self.y, noise, none, params)
        return float(state.x[0])

    def changes(
        self, fast: float, slow: float
    ) -> tuple[load_change.LoadState, Floats, Floats, Bools]:
        """Run both hypotheses of the load over the drive."""
        start, noise, params = self.kernel_input(fast, slow)
        return load_change.run(  # type: ignore[no-any-return]
            load_change.initial_state(start),  # type: ignore[no-untyped-call]
            self.time,
            self.rows,
            self.y,
            noise,
            self.odds,
            load_change.LoadParams(
                filter=params,
                jump_var=self.jump_var,
                temper=1.0 / UNMODELLED**2,
                fewest=FEWEST_WINDOWS,
            ),
        )


def estimate(balance: ForceBalance, vehicle: Vehicle, *, load_changes: bool = True) -> MassTrack:
    """Weigh by a Kalman filter of the mass and the slow errors of `slow_errors`.

    Usable rows, braking and overrun aside, are averaged over windows of
    `weighbridge.balance.averaging.WINDOW`, both sides over the same rows. The
    levels of fast noise and of the disturbance are those of highest
    likelihood. After every stop a second filter tries whether the load has
    changed; the running mass is the mean of both. The final answer is that of
    the whole drive smoothed, at its end: the fuel burnt by then is taken off,
    and where the load has changed, it is the mass after the last change; the
    segments tell those before.

    Parameters
    ----------
    balance, vehicle
    load_changes : the load may change at stops; not where the mass is known

    References
    ----------
    Kalman filter with Gauss-Markov disturbances and maximum likelihood for
    their levels: Gelb, Applied Optimal Estimation, 1974, ch. 3, 4; Schweppe,
    IEEE Trans. Information Theory 11, 1965. Parameters that no data of the
    drive can improve are considered, not estimated: Schmidt, 1966.
    """
    view = balance.merged
    rows, y = design(view, vehicle, grade_open=balance.motion.grade_open)
    usable = usable_rows(view, rows, y)
    cut = windows(view.time, usable)
    reason = view.reason.copy()
    reason[view.usable] = Reason.NO_MOTION
    reason[usable] = Reason.TOO_SHORT
    reason[cut.index] = Reason.USED
    if cut.count.size < FEWEST_WINDOWS:
        return nothing("joint", balance, vehicle, reason, int(cut.count.size))

    time = cut.mean(view.time)
    stood = stood_before(view, time)
    odds = change_odds(stood) if load_changes else np.full(time.size, np.nan)
    rough = first_guess(cut.mean(rows[:, 0]), cut.mean(y))

    def problem_of(mass: float | None) -> tuple[_Problem, Lean, Floats, Floats]:
        """State the problem; squat and levels of noise are told in terms of a mass [kg]."""
        body = lean(balance, vehicle, mass or rough)
        leaned = body.leaned(view.accel)
        rows, y = design(view, vehicle, leaned=leaned, grade_open=balance.motion.grade_open)
        means, sums = np.ascontiguousarray(cut.mean(rows)), cut.mean(y)
        sizes = _sizes(balance, vehicle, cut, mass or first_guess(means[:, 0], sums))
        return _Problem(time=time, rows=means, y=sums, odds=odds, **sizes), body, rows, y

    # They should not hang on the guess.
    problem, body, rows, y = problem_of(None)
    problem, body, rows, y = problem_of(_sensible(problem.filtered()))
    fast, slow = problem.likeliest()
    start, noise, params = problem.kernel_input(fast, slow)
    while True:
        _, running, running_var, begins = problem.changes(fast, slow)
        added = np.where(begins[:, None], problem.jump_var, 0.0)
        x, var, taken, weight = disturbance.smooth(
            start, time, problem.rows, problem.y, noise, added, params
        )
        hasty = too_hasty(begins, stood, x[:, 0])
        if not hasty.any():
            break
        problem = replace(problem, odds=np.where(hasty, np.nan, problem.odds))
    # More noise than usual is more likely the torque's; less is less on both sides.
    shown = np.full(time.size, min(fast, 1.0) ** 2 * motion_variance(balance.motion))
    low = drawn(weight, shown, var[:, 0], begins)

    left_out = np.zeros(view.time.size, dtype=bool)
    left_out[cut.index] = ~taken[cut.window]
    reason[left_out] = Reason.BAD_FIT
    used = reason == Reason.USED
    burnt = view.fuel_burnt
    smoothed, running = x[:, 0] * (1.0 + low), running * (1.0 + low)
    mass, bound = float(smoothed[-1] - burnt[-1]), float(np.sqrt(var[-1, 0]))
    columns = cut.mean(force_columns(balance, vehicle, float(smoothed[-1])))
    moved = sensitivity(columns, time, problem.rows, noise, added, taken, start, params)
    left = math.hypot(
        _left_open(balance, vehicle, mass),
        body.relative_std(view.accel, rows[:, 0], used),
        inertia_relative_std(vehicle, mass, view.accel, rows[:, 0], used),
        UNMODELLED * open_std(vehicle, moved, mass),
        LEVEL_STD * float(low[-1]),
    )
    std = float(np.hypot(UNMODELLED * bound, mass * left))
    last = np.searchsorted(time, view.time, side="right") - 1
    track = np.where(last >= 0, running[np.maximum(last, 0)] - burnt, np.nan)
    track_std = UNMODELLED * np.sqrt(running_var)[np.maximum(last, 0)]
    status, why = judge(
        Evidence(
            view=view,
            used=used,
            phi=rows[:, 0],
            mass=mass,
            std=std,
            blocks=cut.count.size,
            left=mass * left,
        ),
        vehicle,
    )
    return MassTrack(
        method="joint",
        balance=balance,
        running_mass=track,
        running_std=np.where(last >= 0, np.hypot(track_std, track * left), np.nan),
        residual=np.where(used, y - _explained(rows, x[np.maximum(last, 0)]), np.nan),
        reason=reason,
        mass=mass,
        std=std,
        left_std=mass * left,
        degrees_of_freedom=float("inf"),
        bound_std=bound,
        sensitivity=moved,
        converged_at=converged_at(view.time, track, mass, used),
        status=status,
        why=why,
        segments=_segments(view, time, begins, smoothed, np.sqrt(var[:, 0]), left),
        slow_errors=SlowErrors.from_states(time, x, var, running_var, problem.rows[:, 1]),
        filtered=FilterInput(
            start=start,
            params=params,
            time=time,
            rows=problem.rows,
            y=problem.y,
            noise=noise,
            added=added,
            stood=stood,
            traction=problem.rows[:, 0] * x[:, 0] + cut.mean(view.traction_force - y),
        ),
    )


def _explained(rows: Floats, x: Floats) -> Floats:
    """Force of the mass and of what lasts as long as the drive (n,) [N].

    Disturbance, slow resistance and wind stay in the residual.
    """
    return np.asarray(rows[:, 0] * x[:, 0] + np.sum(rows[:, LASTING:] * x[:, LASTING:], axis=1))


def _left_open(balance: ForceBalance, vehicle: Vehicle, mass: float) -> float:
    """Relative standard deviation that no row of this drive can take away [-]."""
    made = vehicle.provenance
    scale = made.mass_scale_std if made.mass_scale_std is not None else scale_std(vehicle)
    left = math.hypot(
        scale,
        MOTION_STD[balance.motion.source],
        balance.motion.specific_force_scale_std,
        balance.coarse_std,
    )
    if balance.brake_hidden:
        left = float(np.hypot(left, HIDDEN_BRAKE_STD))
    if lacks_accelerometer(vehicle, balance.motion):
        left = float(np.hypot(left, OTHER_MOTION_STD[balance.motion.source]))
    if made.fit is not None and made.fit.torque and not made.fit.refined:
        left = float(np.hypot(left, OTHER_METHOD_STD))
    if not mass > 0.0:
        return left
    # When the rows weigh, half of the fuel is gone, in the mean.
    fuel = 0.5 * float(balance.merged.fuel_burnt[-1]) / mass
    left = float(np.hypot(left, FUEL_STD * fuel))
    if made.masses:
        above, below = np.log(mass / max(made.masses)), np.log(min(made.masses) / mass)
        left = float(np.hypot(left, BEYOND_STD * max(above, below, 0.0)))
    return left


def _sizes(
    balance: ForceBalance, vehicle: Vehicle, cut: Windows, guess: float
) -> dict[str, Floats]:
    """What of a problem is told in terms of a rough mass [kg]: noise and states."""
    torque = highest_torque(balance.merged.torque[cut.index])
    return {
        "variance": noise_variance(balance.merged, cut, guess, balance.motion),
        "std": prior_std(vehicle, guess, torque, grade_open=balance.motion.grade_open),
    }


def stood_before(view: MergedView, time: Floats) -> Floats:
    """How long the vehicle stood between each window and the one before it (m,) [s].

    A gap in the log counts as standing: what happened in it is not known. Of several stops
    between two windows the longest tells.

    Parameters
    ----------
    view
    time : (m,) instants of the windows [s]
    """
    standing = ~(np.nan_to_num(view.speed) > 0.5)
    gap = np.diff(view.time, append=view.time[-1])
    # Rows near in time stand for the time until the next; a long gap stands for itself.
    still = np.cumsum(np.where(standing | (gap > STOP), gap, 0.0))
    moved = np.flatnonzero(~standing)
    stood = np.zeros(time.size)
    if moved.size < 2:
        return stood
    rest = still[moved[1:] - 1] - np.where(moved[:-1] > 0, still[moved[:-1] - 1], 0.0)
    at = np.searchsorted(time, view.time[moved[1:]])
    within = (at > 0) & (at < time.size) & (rest > 0.0)
    np.maximum.at(stood, at[within], rest[within])
    return stood


def change_odds(stood: Floats) -> Floats:
    """Logarithm of the odds that the load changed between each window and the one before it.

    NaN where the vehicle did not stand for `SHORTEST` between them.

    Parameters
    ----------
    stood : (m,) how long it stood there [s]
    """
    odds = np.full(stood.size, np.nan)
    stops = stood >= SHORTEST
    odds[stops] = CHANGE_ODDS + CHANGE_RISE * np.log(stood[stops] / STOP)
    return odds


def too_hasty(begins: Bools, stood: Floats, mass: Floats) -> Bools:
    """Mark changes of load that are too large for the time the vehicle stood (m,).

    Parameters
    ----------
    begins : (m,) windows before which the load changed
    stood : (m,) how long the vehicle stood before each [s]
    mass : (m,) of the windows [kg]
    """
    change = np.abs(np.diff(mass, prepend=mass[:1])) / np.abs(mass)
    most = np.minimum(LOADED * np.maximum(stood - OPENED, 0.0), MOST_LOADED)
    return np.asarray(begins & (stood < STOP) & (change > most))


def _segments(
    view: MergedView, time: Floats, begins: Bools, mass: Floats, bound: Floats, left: float
) -> tuple[Segment, ...]:
    """Stretches of one load: the mass at the end of each, smoothed over the whole drive."""
    first = np.concatenate(([0], np.flatnonzero(begins)))
    last = np.concatenate((first[1:], [time.size])) - 1
    edges = [float(view.time[0])]
    moving = np.nan_to_num(view.speed) > 0.5
    for k in first[1:]:
        # The load changed while the vehicle stood: the segment begins as it drives off.
        between = (view.time > time[k - 1]) & (view.time <= time[k])
        rests = np.flatnonzero(between & ~moving)
        edges.append(float(view.time[rests[-1]]) if rests.size else float(time[k]))
    edges.append(float(view.time[-1]))
    burnt = np.interp(edges[1:], view.time, view.fuel_burnt)
    return tuple(
        Segment(
            start=edges[j],
            end=edges[j + 1],
            mass=float(mass[k] - burnt[j]),
            std=float(np.hypot(UNMODELLED * bound[k], mass[k] * left)),
        )
        for j, k in enumerate(last)
    )
