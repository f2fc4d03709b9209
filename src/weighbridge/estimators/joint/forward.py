"""The joint estimator run forward: one window after another, by sizes known beforehand."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from weighbridge.estimators.joint.load_stops import CHANGE_ODDS, change_odds
from weighbridge.estimators.joint.possible import averaged, enough_windows
from weighbridge.estimators.joint.problem import (
    FilterInput,
    JointSizes,
    first_state,
    load_params,
)
from weighbridge.estimators.joint.slow_errors import window_noise
from weighbridge.estimators.joint.switched import doubt_variance, switch_params
from weighbridge.estimators.judging import STOP
from weighbridge.estimators.noisy_motion import too_low
from weighbridge.kernels import disturbance, load_change, switched
from weighbridge.signals import Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSetup(JointSizes):
    """What the filter is given from outside before it runs forward.

    Attributes
    ----------
    attenuating_var : noise of the motion that attenuates the mass, for the weight that the filter
        gives a window before it is seen [m^2/s^4]
    """

    attenuating_var: float


def identify_joint(given: FilterInput, sizes: JointSizes) -> JointSetup:
    """Set up a forward run by what the smoother was given, and the sizes it found.

    Windows weigh more once later ones are known: their noise counts as much more.
    """
    before = given.weight()
    known = {f.name: getattr(sizes, f.name) for f in fields(sizes)}
    return JointSetup(**known, attenuating_var=sizes.noise_information / before)


class JointState(NamedTuple):
    """Filter after some windows.

    Attributes
    ----------
    load : both hypotheses of the load; None before the first window
    switch : both of what is switched; None before the first window, and where nothing is
    total : weight of all windows so far [1/N^2]
    total_at_load : the same when the load of the mass began
    total_at_trial : the same when the change of load that is tried began
    windows : seen
    mass : running, the fuel burnt since the first row not taken off; NaN before the first [kg]
    var : variance of the filter [kg^2]
    """

    load: load_change.LoadState | None = None
    switch: switched.SwitchState | None = None
    total: float = 0.0
    total_at_load: float = 0.0
    total_at_trial: float = 0.0
    windows: int = 0
    mass: float = np.nan
    var: float = np.nan

    def std(self, sizes: JointSizes) -> float:
        """Standard deviation of the running mass [kg]."""
        own = sizes.std_factor * np.sqrt(self.var)
        return float(np.hypot(own, self.mass * sizes.systematic_std))


def resumed(given: FilterInput, setup: JointSetup, until: float) -> JointState:
    """Return the state after the windows of a drive that was weighed as a whole.

    Its motion was smoothed, and its changes of load are those found with hindsight. One at a stop
    with too little driving after it is neither found nor excluded, and is tried on.

    Parameters
    ----------
    given : what the smoother was given
    setup : of `identify_joint`, from the same
    until : later windows are left out [s]
    """
    seen = int(given.time.searchsorted(until, side="right"))
    if not seen:
        return JointState()
    part = given.first(seen)
    open_from = _open_from(part, setup)
    known = part.first(open_from)
    end, same, _ = averaged(known, setup.states, setup.settings, setup.std_factor)
    total = part.weight()
    jumps = np.flatnonzero(known.added.any(axis=1))
    before = part.first(int(jumps[-1])).weight() if jumps.size else 0.0
    load = load_change.initial_state(end)._replace(rows=open_from)  # type: ignore[no-untyped-call]
    mass, var = end.x[0], end.cov[0, 0]
    weighed = load_params(given.params, setup.states, setup.settings)
    for k in range(open_from, seen):
        odds = part.odds[k] if k == open_from else np.nan
        load, mass, var, _ = load_change.step(
            load, part.time[k], part.rows[k], part.y[k], part.noise[k], odds, weighed
        )
        same = load.same
    low = too_low(same.cov[0, 0] * setup.attenuating_var * (total - before))
    return JointState(
        load=load,
        switch=_first_switch(load.same._replace(rows=seen), given.params, setup),
        total=total,
        total_at_load=before,
        total_at_trial=known.weight() if open_from < seen else before,
        windows=seen,
        mass=float(mass * (1.0 + low)),
        var=float(var),
    )


def _open_from(given: FilterInput, setup: JointSetup) -> int:
    """Return the window from which another load is still tried; the number of windows if none."""
    count = given.time.size
    changed = np.asarray(np.any(given.added > 0.0, axis=1))
    stops = np.flatnonzero((given.odds >= CHANGE_ODDS) | changed)
    followed = count - enough_windows(setup.settings)
    return int(stops[-1]) if stops.size and stops[-1] > followed else count


class Window(NamedTuple):
    """Means of the rows of one window.

    Attributes
    ----------
    time : [s]
    row : (k,) of the states
    y : force that is left for them [N]
    torque_var : variance of its noise that is the torque's [N^2]
    stood : how long the vehicle stood before it [s]
    accessory : of `weighbridge.balance.law.accessory_column` [N/W]
    """

    time: float
    row: Floats
    y: float
    torque_var: float
    stood: float
    accessory: float = 0.0


def step(state: JointState, window: Window, setup: JointSetup) -> JointState:
    """Fold in one window.

    The load may change at stops of `STOP` and longer; whether so much can be loaded in a shorter
    one is judged of a whole drive only. The mass is raised by what noise of the
    motion draws it down, as far as the windows until then can.

    Parameters
    ----------
    state : before it
    window : accessories of the power that the setup shows are taken out of it as far as the
        windows until then show that they are on
    setup

    References
    ----------
    As of `weighbridge.estimators.joint.estimate`; attenuation: Fuller, Measurement Error
    Models, 1987, ch. 1, 2.
    """
    start, params = first_state(setup.states, setup.slow, window.time, setup.settings)
    load, at_load, at_trial = state.load, state.total_at_load, state.total_at_trial
    switch = state.switch
    if load is None:
        load = load_change.initial_state(start)  # type: ignore[no-untyped-call]
        switch = _first_switch(start, params, setup)
    noise = setup.fast**2 * window_noise(window.torque_var, setup.mass, setup.motion_var)
    y = window.y
    if switch is not None:
        force, none = setup.switched_power * window.accessory, np.zeros(window.row.size)
        switch = switched.step(
            switch, window.time, window.row, y, noise, force, none, switch_params(params)
        )
        on = float(switch.share[1])
        y -= force * on
        noise += setup.fast**2 * doubt_variance(force, on)
    long = state.windows > 0 and window.stood >= STOP
    odds = float(change_odds(np.array([window.stood]))[0]) if long else np.nan
    weight = disturbance.weight(load.same, window.time, window.row, noise, params)
    trial_row = load.trial_row
    weighed = load_params(params, setup.states, setup.settings)
    load, mass, var, changed = load_change.step(
        load, window.time, window.row, y, noise, odds, weighed
    )
    if changed >= 0:
        at_load = at_trial
        if switch is not None:
            switch = _with_load(switch, load.same)
    if load.open and load.trial_row != trial_row:
        at_trial = state.total
    total = state.total + weight
    # While a change is tried, the spread between both hypotheses is no noise that attenuates.
    low = too_low(load.same.cov[0, 0] * setup.attenuating_var * (total - at_load))
    return JointState(
        load=load,
        switch=switch,
        total=total,
        total_at_load=at_load,
        total_at_trial=at_trial,
        windows=state.windows + 1,
        mass=float(mass * (1.0 + low)),
        var=float(var),
    )


def _first_switch(
    state: disturbance.DisturbanceState, params: disturbance.DisturbanceParams, setup: JointSetup
) -> switched.SwitchState | None:
    """Begin to find when accessories are on; None where none are switched."""
    if not setup.switched_power > 0.0:
        return None
    return switched.initial_state(  # type: ignore[no-any-return,no-untyped-call]
        state, switch_params(params)
    )


def _with_load(
    switch: switched.SwitchState, load: disturbance.DisturbanceState
) -> switched.SwitchState:
    """Go on with the states of another load, off or on as it was."""
    return switch._replace(x=np.array([load.x, load.x]), cov=np.array([load.cov, load.cov]))
