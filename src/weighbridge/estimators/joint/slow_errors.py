"""What a drive shows beside its mass, and the fast noise of its windows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, NamedTuple, TypeVar

import numpy as np

from weighbridge.balance import WINDOW, Windows, law
from weighbridge.balance.table import ForceTable
from weighbridge.estimators.joint.problem import States
from weighbridge.estimators.joint.terms import A_DRIVE
from weighbridge.estimators.squat import share_of_accel
from weighbridge.navigation import BY_SPEED, Motion
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle import Vehicle, by_data_sheet

Variance = TypeVar("Variance", float, Floats)

UNMEASURED_NOISE: Final = 0.03
"""Noise of one sample of a specific force that no accelerometer measured [m/s^2]."""

MOTION_SHARE: Final = 0.25
"""What of that noise the mean of a window keeps [-]: in 58 drives of three simulators, vibration,
rough roads and vehicles of all classes, noise of one sample from 0.010 to 0.113 m/s^2,
`motion_variance` meets the true error of the mean of a window within a quarter (RMS); how much a
window keeps depends on how fast the noise is, and on rough roads of one simulator it was twice as
much."""

MOTION_WINDOW_STD: Final = 0.007
"""Fast error of the mean of a window without such noise [m/s^2]."""


class Found(NamedTuple):
    """What one state came out as, one row per window.

    Attributes
    ----------
    value, std : (m,)
    lasting : whether it stays the same all along the drive
    """

    value: Floats
    std: Floats
    lasting: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowErrors:
    """What stood beside the mass, smoothed over the whole drive, one row per window.

    Attributes
    ----------
    time : (m,) [s]
    mass_bound : (m,) standard deviation of the mass as known at each window, by the noise
        of this drive alone [kg]
    found : each state by the name of its `weighbridge.estimators.joint.terms.Term`, in its unit;
        the ``disturbance`` as a force at the window, gusts and all
    """

    time: Floats
    mass_bound: Floats
    found: dict[str, Found]

    @property
    def constants(self) -> dict[str, tuple[float, float]]:
        """Value at the end and standard deviation of the states that last as long as the drive."""
        return {
            name: (float(x.value[-1]), float(x.std[-1]))
            for name, x in self.found.items()
            if x.lasting
        }

    def of(self, name: str) -> Found:
        """What a state came out as; zeros where the estimator had none of that name."""
        nothing = np.zeros(self.time.size)
        return self.found.get(name, Found(nothing, nothing, lasting=False))

    @classmethod
    def from_states(
        cls, time: Floats, states: States, x: Floats, var: Floats, mass_var: Floats, rows: Floats
    ) -> SlowErrors:
        """Name the states of the filter.

        Parameters
        ----------
        time : (m,) of the windows [s]
        states : which they are
        x, var : (m, k) smoothed, and their variances
        mass_var : (m,) variance of the mass as known at each window [kg^2]
        rows : (m, k) of the windows: a fast disturbance is a force by its own
        """
        found = {}
        for k, name in enumerate(states.names[1:], start=1):
            unit = rows[:, k] if states.levelled[k] else 1.0
            std = np.abs(unit) * np.sqrt(var[:, k])
            found[name] = Found(unit * x[:, k], std, bool(states.time_constant[k] > A_DRIVE))
        return cls(time=time, mass_bound=np.sqrt(mass_var), found=found)


def usable_rows(table: ForceTable, rows: Floats, y: Floats) -> Bools:
    """Rows without a reason against them and with finite numbers."""
    return np.asarray(table.usable & np.isfinite(y) & np.isfinite(rows).all(axis=1))


def noise_variance(
    table: ForceTable, cut: Windows, mass: float, motion: Motion, length: float = WINDOW
) -> Floats:
    """Variance of the fast noise of each window's mean force (m,) [N^2], both sides.

    Parameters
    ----------
    table, cut
    mass : [kg]
    motion
    length : of a window [s]
    """
    torque_var = cut.mean(table.force_std**2) / cut.count
    return window_noise(torque_var, mass, window_motion_variance(motion, length))


def window_noise(torque_var: Variance, mass: float, motion_var: float) -> Variance:
    """Variance of the fast noise of a window's mean force, both sides [N^2].

    Parameters
    ----------
    torque_var : part of it that is the torque's [N^2]
    mass : that the noise of the motion moves [kg]
    motion_var : `window_motion_variance` [m^2/s^4]
    """
    return torque_var + mass**2 * motion_var


def window_motion_variance(motion: Motion, length: float = WINDOW) -> float:
    """Variance of a window's mean specific force by its samples and by its ends [m^2/s^4]."""
    return motion_variance(motion, length) + motion.mean_accel_std(length) ** 2


def motion_variance(motion: Motion, length: float = WINDOW) -> float:
    """Variance of the noise in the mean specific force over ``length`` [s] [m^2/s^4].

    The drive shows it by the noise of the samples of its accelerometer. The slope of a
    smoothed speed is a conditional mean, and what is unknown of it no such noise.
    """
    level = motion.specific_force_std
    if motion.source in BY_SPEED or not np.isfinite(level):
        level = UNMEASURED_NOISE
    # Over any length it is not above that of one sample.
    share = min(MOTION_SHARE**2 * WINDOW / length, 1.0)
    return MOTION_WINDOW_STD**2 + share * level**2


def with_variance(motion: Motion, variance: float) -> Motion:
    """Return a motion whose `motion_variance` over a window is this [m^2/s^4]."""
    level = np.sqrt(max(variance - MOTION_WINDOW_STD**2, 0.0)) / MOTION_SHARE
    return replace(motion, specific_force_std=float(level))


def inertia_relative_std(
    vehicle: Vehicle, mass: float, accel: Floats, phi: Floats, used: Bools
) -> float:
    """Relative standard deviation of a mass by the inertias of a data sheet with one gear [-].

    With one gear the rotating mass is the same all the time. Only hills, which accelerate
    nothing, separate it from the mass, and they do so no better than the accelerometer's
    scale and lean are known. So it is considered (Schmidt, 1966), not estimated. With
    several gears it is a state.

    Parameters
    ----------
    vehicle
    mass : [kg]
    accel, phi : (n,) acceleration and regressor of the mass [m/s^2]
    used : (n,)
    """
    line = vehicle.driveline
    if not (by_data_sheet(vehicle) and line.single_speed) or not mass > 0.0:
        return 0.0
    engine, wheels = vehicle.road.engine_inertia, vehicle.road.wheel_inertia
    turns = float(law.engine_inertia_column(line.gearings[0], 1.0))
    rolls = float(law.wheel_inertia_column(1.0, line.wheel_radius))
    rotating = math.hypot(engine.std * turns, wheels.std * rolls)
    return rotating / mass * share_of_accel(accel, phi, used)
