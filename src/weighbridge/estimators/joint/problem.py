"""What the filter of the joint estimator is asked, and with which sizes of its states."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from weighbridge.estimators.joint.settings import JointSettings
from weighbridge.estimators.joint.terms import Sizes, terms_of
from weighbridge.estimators.squat import ResidualSquat
from weighbridge.kernels import disturbance, load_change
from weighbridge.signals import Bools, Floats
from weighbridge.signals.minimum import lowest_by_simplex
from weighbridge.vehicle import Vehicle

UNMODELLED: Final = 1.6
"""Errors of the mass over what the filter says of them, where no calibration has shown it [-]:
simulated drives of one calibration scatter so around their mean, after five minutes as after an
hour."""

_STEPS: Final[Floats] = np.array([0.2, -1.0])
"""First steps of the search for the likeliest logarithms of the levels [-]."""

_CLOSE: Final = 0.03
"""It ends where they, and the logarithm of the likelihood, differ by less [-]."""


class States(NamedTuple):
    """The states of a drive, as the kernels read them.

    Attributes
    ----------
    names : (k,) of their terms
    std : (k,) before the drive has shown; that of the mass is its guess as well
    time_constant : (k,) [s]
    jump_std : (k,) by which they may jump where the load changes
    levelled : (k,) whether the drive shows how large they are
    """

    names: tuple[str, ...]
    std: Floats
    time_constant: Floats
    jump_std: Floats
    levelled: Bools

    def params(self, slow: float, settings: JointSettings) -> disturbance.DisturbanceParams:
        """Parameters of the filter, at a level of what the drive shows the size of [-]."""
        std = self.at_level(slow)
        return disturbance.DisturbanceParams(
            time_constant=self.time_constant,
            std=np.where(np.isfinite(self.time_constant), std, 0.0),
            gate=settings.gate,
            settle_rows=settings.settle_windows,
            # No change of load is believed sooner.
            jump_rows=settings.fewest_windows,
        )

    def at_level(self, slow: float) -> Floats:
        """Standard deviations (k,) at a level of what the drive shows the size of [-]."""
        return np.where(self.levelled, slow * self.std, self.std)

    def std_of(self, name: str) -> float:
        """Standard deviation of one of them; 0 where it is none."""
        return float(self.std[self.names.index(name)]) if name in self.names else 0.0


def states_of(vehicle: Vehicle, sizes: Sizes, settings: JointSettings) -> States:
    """Return the states of the terms that settings pick, before the drive has shown.

    Parameters
    ----------
    vehicle : its drag area, rolling resistance and inertias are as uncertain as its ``road`` says
    sizes : of the drive
    settings
    """
    terms = terms_of(vehicle, settings.terms)
    return States(
        names=tuple(term.name for term in terms),
        std=np.array([term.std(vehicle, sizes) for term in terms]),
        time_constant=np.array([term.time_constant for term in terms]),
        jump_std=np.array([term.jump(settings) * sizes.mass for term in terms]),
        levelled=np.array([term.levelled for term in terms]),
    )


def first_state(
    states: States, slow: float, time: float, settings: JointSettings
) -> tuple[disturbance.DisturbanceState, disturbance.DisturbanceParams]:
    """State to start from and parameters of the filter.

    Parameters
    ----------
    states : of which that of the mass is its guess as well
    slow : level of the disturbance over its usual size [-]
    time : of the first window [s]
    settings
    """
    std = states.at_level(slow)
    begin = np.zeros(std.size)
    begin[0] = std[0]
    start = disturbance.initial_state(  # type: ignore[no-untyped-call]
        begin, np.diag(std**2), time
    )
    return start, states.params(slow, settings)


def load_params(
    params: disturbance.DisturbanceParams, states: States, settings: JointSettings
) -> load_change.LoadParams:
    """How the hypotheses of the load are weighed, by the jumps of the states."""
    return load_change.LoadParams(
        filter=params,
        jump_var=states.jump_std**2,
        temper=1.0 / UNMODELLED**2,
        fewest=settings.fewest_windows,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """What the kernels need, one row per window.

    Attributes
    ----------
    time : (m,) [s]
    rows : (m, k) of the states
    y : (m,) force that is left for them [N]
    odds : (m,) logarithm of the odds that the load changed before a window; NaN where it cannot
    variance : (m,) of the usual fast noise of ``y`` [N^2]
    states : before the drive has shown; that of the mass is its guess as well
    settings
    """

    time: Floats
    rows: Floats
    y: Floats
    odds: Floats
    variance: Floats
    states: States
    settings: JointSettings

    def kernel_input(
        self, fast: float, slow: float
    ) -> tuple[disturbance.DisturbanceState, Floats, disturbance.DisturbanceParams]:
        """State to start from, noise variance and parameters at a level of noise."""
        start, params = first_state(self.states, slow, float(self.time[0]), self.settings)
        return start, fast**2 * self.variance, params

    def likeliest(self) -> tuple[float, float]:
        """Levels of fast noise and of the disturbance, over their usual sizes [-].

        A weak prior keeps them within a factor of about three.
        """

        def misfit(level: Floats) -> float:
            fast, slow = np.exp(level)
            state, *_ = self.changes(float(fast), float(slow))
            return float(-state.same.log_likelihood + 0.5 * np.sum(level**2))

        level, _ = lowest_by_simplex(misfit, np.zeros(2), _STEPS, close=_CLOSE)
        fast, slow = np.exp(level)
        return float(fast), float(slow)

    def mass_unchanged(self) -> float:
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
            load_params(params, self.states, self.settings),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterInput:
    """What the filter of the joint estimator was given, one row per window.

    Attributes
    ----------
    start, params : first state and parameters of `weighbridge.kernels.disturbance`
    time : (m,) [s]
    rows : (m, k) of the states; the mass is the first
    y, noise : (m,) force [N] and its noise variance [N^2]
    added : (m, k) variance by which states jump where the load changes
    stood : (m,) how long the vehicle stood before each window [s]
    odds : (m,) logarithm of the odds that the load changed before a window; NaN where it cannot
    traction : (m,) what the whole model says of the force at the wheels [N]
    """

    start: disturbance.DisturbanceState
    params: disturbance.DisturbanceParams
    time: Floats
    rows: Floats
    y: Floats
    noise: Floats
    added: Floats
    stood: Floats
    odds: Floats
    traction: Floats

    def first(self, count: int) -> FilterInput:
        """Return the first so many windows."""
        by_row = ("time", "rows", "y", "noise", "added", "stood", "odds", "traction")
        return replace(self, **{name: getattr(self, name)[:count] for name in by_row})

    def end(self) -> disturbance.DisturbanceState:
        """State after the last window."""
        return disturbance.run(  # type: ignore[no-any-return]
            self.start, self.time, self.rows, self.y, self.noise, self.added, self.params
        )[0]

    def with_term(self, column: Floats, std: float) -> FilterInput:
        """Return the same with a hypothesis: one more constant beside the mass, as the last state.

        Its likelihood over that without, both of `end`, says how much speaks for it.

        Parameters
        ----------
        column : (m,) traction that one unit of it takes [N]
        std : of the constant before the drive has shown

        References
        ----------
        A bias of known shape as a further state: Friedland, IEEE Trans. Automatic Control 14, 1969.
        """
        count = self.start.x.size
        cov = np.zeros((count + 1, count + 1))
        cov[:count, :count], cov[count, count] = self.start.cov, std**2
        nothing = np.zeros_like(column)
        return replace(
            self,
            start=self.start._replace(x=np.append(self.start.x, 0.0), cov=cov),
            params=self.params._replace(
                time_constant=np.append(self.params.time_constant, np.inf),
                std=np.append(self.params.std, 0.0),
            ),
            rows=np.column_stack([self.rows, column]),
            added=np.column_stack([self.added, nothing]),
        )

    def weight(self) -> float:
        """Sum of the weights of all windows, each given those before it [1/N^2]."""
        return float(
            disturbance.weights(
                self.start, self.time, self.rows, self.y, self.noise, self.added, self.params
            )
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSizes:
    """Sizes of noise and states, from the whole drive.

    Attributes
    ----------
    states : of which that of the mass is its guess as well
    fast, slow : levels of the noise over their usual sizes [-]
    body : squat that rows and torque do not have in common
    motion_var : variance of the specific force of a window [m^2/s^4]
    noise_information : trace of the windows' information times the noise of the motion in them,
        which times the variance of the mass is the part that it is too low by [1/kg^2]
    systematic_std : relative standard deviation of the mass that no row takes away [-]
    std_factor : errors of the mass over what the filter says of them [-]
    switched_power : of accessories that go on and off; 0 without [W]
    settings : of the estimator
    """

    states: States
    fast: float
    slow: float
    body: ResidualSquat
    motion_var: float
    noise_information: float
    systematic_std: float
    std_factor: float
    switched_power: float
    settings: JointSettings

    @property
    def mass(self) -> float:
        """Guess of the mass [kg]."""
        return float(self.states.std[0])
