"""Accessories that are switched on and off: a compressor takes the same power whenever it is on.

A torque that is reported at the crank counts it as traction, and so does engine load. In its
clutch's time, a quarter of a minute, it looks like a hill.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, TypeVar

import numpy as np

from weighbridge.balance.law import accessory_column
from weighbridge.balance.table import ForceTable
from weighbridge.estimators.joint.problem import Problem
from weighbridge.kernels import disturbance, switched
from weighbridge.signals import Floats
from weighbridge.signals.minimum import lowest_by_simplex
from weighbridge.vehicle import Vehicle

Value = TypeVar("Value", float, Floats)

TURN_TIME: Final = 20.0
"""How long a compressor stays on, and off, in the mean [s]."""

USUAL_POWER: Final = 1.0
"""Power of what is switched, over the mass of the vehicle [W/kg]: the compressor of a car's air
conditioning takes 1 to 3 kW, that of a truck's brakes 4 to 8 kW, its fan as much again."""

POWER_SPREAD: Final = 0.6
"""Standard deviation of its logarithm [-]."""

KNOWN_SPREAD: Final = 0.15
"""The same where the calibration has shown the power [-]: 39 that drives of eight simulated
vehicles showed with a good sensor are within 0.07 (RMS) of the median of their vehicle, 0.21 at
most."""

TRIED: Final = (-1.0, 0.0, 1.0)
"""Powers that are tried first, in standard deviations [-]."""

CALMER: Final = (1.0, 0.5)
"""Levels of the disturbance tried with each, over that without a switch [-]."""

HOPELESS: Final = -25.0
"""A logarithm of the likelihood that is so much worse in all of these ends the search."""

SMALL: Final = -1.5
"""A search that comes to so small a power, in standard deviations, and gains nothing by it ends:
switches that were shown ended at -0.8 or more [-]."""

CLOSE: Final = 0.05
"""A search ends where what is sought, and the logarithm of the likelihood, differ by less [-]."""

STEPS: Final[Floats] = np.array([0.2, -0.3, 0.4])
"""First steps of what is sought [-]."""

SURE: Final = 6.0
"""Gain of the logarithm of the likelihood, prior included, that shows a switch: 50 drives of a
second model without one had 0.4 at most, those with one 10 to 150."""

SURE_KNOWN: Final = 0.0
"""The same of a power that the calibration has shown: the likelier of the two counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Switched:
    """Power that the engine gives to something beside the wheels, on and off.

    Attributes
    ----------
    power : while it is on [W]
    time : (m,) of the windows [s]
    on : (m,) probability that it is on [-]
    gain : of the logarithm of the likelihood by it
    """

    power: float
    time: Floats
    on: Floats
    gain: float

    def force(self, table: ForceTable, vehicle: Vehicle) -> Floats:
        """Traction that it would be at each row of a table (n,) [N]."""
        on = np.interp(table.time, self.time, self.on)
        return np.asarray(self.power * on * accessory_column(table, vehicle))


def switch_params(filter_params: disturbance.DisturbanceParams) -> switched.SwitchParams:
    """Say how what is switched stays on and off, beside states that move so."""
    return switched.SwitchParams(filter_params, TURN_TIME, TURN_TIME)


def find_switched(
    problem: Problem,
    column: Floats,
    added: Floats,
    levels: tuple[float, float],
    known: float | None = None,
) -> Switched | None:
    """Find the power that is switched, and when it was on; None where nothing gives it.

    Parameters
    ----------
    problem
    column : (m,) means of `weighbridge.balance.law.accessory_column` over the windows [N/W]
    added : (m, k) variance by which states jump where the load changes
    levels : of fast noise and of the disturbance, as found without a switch [-]
    known : power that the calibration has shown, None where it has shown none [W]
    """
    if not np.any(column > 0.0):
        return None

    def filtered(level: Floats, power: float) -> tuple[Floats, float]:
        start, noise, params = problem.kernel_input(*np.exp(level[:2]))
        how = switch_params(params)
        return switched.run(  # type: ignore[no-any-return]
            switched.initial_state(start, how),  # type: ignore[no-untyped-call]
            problem.time, problem.rows, problem.y, noise, power * column, added, how,
        )  # fmt: skip

    usual, spread, sure = problem.states.std[0] * USUAL_POWER, POWER_SPREAD, SURE
    if known is not None:
        usual, spread, sure = known, KNOWN_SPREAD, SURE_KNOWN

    def power_of(size: float) -> float:
        return float(usual * np.exp(spread * size))

    def misfit(level: Floats) -> float:
        _, fit = filtered(level, power_of(level[2]))
        return -fit + 0.5 * float(np.sum(np.square(level)))

    noise = np.log(levels)
    without = -filtered(noise, 0.0)[1] + 0.5 * float(np.sum(noise**2))
    tried = [
        np.array([noise[0], noise[1] + np.log(calmer), size]) for size in TRIED for calmer in CALMER
    ]
    scores = [misfit(each) for each in tried]
    best = int(np.argmin(scores))
    if without - scores[best] < HOPELESS:
        return None

    def is_small(level: Floats, score: float) -> bool:
        return level[2] < SMALL and without - score < sure

    level, score = lowest_by_simplex(misfit, tried[best], STEPS, close=CLOSE, done=is_small)
    gain = without - score
    if gain < sure:
        return None
    power = power_of(float(level[2]))
    on, _ = filtered(level, power)
    return Switched(power=power, time=problem.time, on=on, gain=gain)


def without_switched(problem: Problem, column: Floats, found: Switched) -> Problem:
    """Take out what is switched; where it is uncertain whether it was on is noise."""
    force = found.power * column
    return replace(
        problem,
        y=problem.y - force * found.on,
        variance=problem.variance + doubt_variance(force, found.on),
    )


def doubt_variance(force: Value, on: Value) -> Value:
    """Variance of a force that is on with a probability [N^2]."""
    return force**2 * on * (1.0 - on)
