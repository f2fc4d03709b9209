"""What the filter of the joint estimator is asked, and with which sizes of its states."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.estimators.joint.settings import JointSettings
from weighbridge.estimators.joint.slow_errors import filter_params
from weighbridge.estimators.squat import ResidualSquat
from weighbridge.kernels import disturbance, load_change
from weighbridge.signals import Bools, Floats
from weighbridge.signals.minimum import lowest_by_simplex

UNMODELLED: Final = 1.6
"""Errors of the mass over what the filter says of them, where no calibration has shown it [-]:
simulated drives of one calibration scatter so around their mean, after five minutes as after an
hour."""

_STEPS: Final[Floats] = np.array([0.2, -1.0])
"""First steps of the search for the likeliest logarithms of the levels [-]."""

_CLOSE: Final = 0.03
"""It ends where they, and the logarithm of the likelihood, differ by less [-]."""


def first_state(
    std: Floats, slow: float, time: float, settings: JointSettings
) -> tuple[disturbance.DisturbanceState, disturbance.DisturbanceParams]:
    """State to start from and parameters of the filter.

    Parameters
    ----------
    std : (k,) of the states before the drive has shown; that of the mass is its guess as well
    slow : level of the disturbance over its usual size [-]
    time : of the first window [s]
    settings
    """
    std = std.copy()
    std[1] *= slow
    begin = np.zeros(std.size)
    begin[0] = std[0]
    start = disturbance.initial_state(  # type: ignore[no-untyped-call]
        begin, np.diag(std**2), time
    )
    # No change of load is believed sooner.
    params = filter_params(std, settings.gate, settings.settle_windows, settings.fewest_windows)
    return start, params


def jump_variance(std: Floats, settings: JointSettings) -> Floats:
    """Variance (k,) by which each state of ``std`` may jump where the load changes."""
    jump = np.zeros(std.size)
    jump[0] = settings.change_std * std[0]
    jump[2] = settings.load_pitch_std * std[0]
    return jump**2


def load_params(
    params: disturbance.DisturbanceParams, std: Floats, settings: JointSettings
) -> load_change.LoadParams:
    """How the hypotheses of the load are weighed, by the sizes of the states (k,)."""
    return load_change.LoadParams(
        filter=params,
        jump_var=jump_variance(std, settings),
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
    std : (k,) of the states before the drive has shown; that of the mass is its guess as well
    settings
    """

    time: Floats
    rows: Floats
    y: Floats
    odds: Floats
    variance: Floats
    std: Floats
    settings: JointSettings

    def kernel_input(
        self, fast: float, slow: float
    ) -> tuple[disturbance.DisturbanceState, Floats, disturbance.DisturbanceParams]:
        """State to start from, noise variance and parameters at a level of noise."""
        start, params = first_state(self.std, slow, float(self.time[0]), self.settings)
        return start, fast**2 * self.variance, params

    @property
    def jump_var(self) -> Floats:
        """Variance (n,) by which each state may jump where the load changes."""
        return jump_variance(self.std, self.settings)

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
            load_params(params, self.std, self.settings),
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
    std : (k,) of the states; that of the mass is its guess as well
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

    std: Floats
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
        return float(self.std[0])
