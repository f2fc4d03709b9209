"""Attenuation bias by noise of the motion: regressors that are themselves measured."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from weighbridge.balance import Windows
from weighbridge.balance.table import ForceBalance, ForceTable
from weighbridge.estimators.joint.slow_errors import MOTION_WINDOW_STD, motion_variance
from weighbridge.estimators.regression import regression
from weighbridge.limits import CREEPS, PARTS, SOME
from weighbridge.messages import Problem
from weighbridge.navigation import BY_SPEED
from weighbridge.navigation.motion import noise_level
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle import Vehicle

USUAL_STD: Final = 0.5
"""Standard deviation of the variance by the noise of samples, over it [-]: what a window keeps of
that noise is by typical sizes, see `weighbridge.estimators.joint.slow_errors.MOTION_SHARE`."""

SHORTEST: Final = 1.0
"""Windows whose rows reach less far show no change of the speed [s]."""

APART: Final = 4.0
"""Windows further apart are not beside each other [s]."""

FULL_TORQUE: Final = 0.8
"""Part of the highest torque of a drive from which on power is short [-]: chosen. With 0.85 of the
highest at that engine speed the noise of thirteen recordings of three trucks, as a part of
the information, is the same within 0.01."""

UNANSWERED_STD: Final = 0.2
"""Standard deviation of the noise that no driver answers, over it [-]: five drives of another
simulator's truck by data sheet come out 3.7 % heavy in the mean, which is a sixth of that noise."""


class MotionNoise(NamedTuple):
    """Noise in the mean specific force of a window.

    Attributes
    ----------
    variance, std : its variance and the standard deviation of that [m^2/s^4]
    learnt : the drive shows it; else it is what is usual
    """

    variance: float
    std: float
    learnt: bool


def learnt_noise(balance: ForceBalance, vehicle: Vehicle, cut: Windows) -> MotionNoise:
    """Find the noise of the motion.

    Three readings show how the motion changes from one window to the next: accelerometer, torque
    and speed. The noise of each is its own, so what one has and shares with neither is its noise.
    The noise of the samples is what is usual, and counts beside it.

    Parameters
    ----------
    balance : with the speed of the wheels as recorded
    vehicle
    cut : windows

    References
    ----------
    Triple collocation: Stoffelen, J. Geophys. Res. 103, 1998; a third reading as instrument:
    Fuller, Measurement Error Models, 1987, ch. 1.4.
    """
    usual = motion_variance(balance.motion)
    std = USUAL_STD * usual
    if balance.wheel_speed is None or balance.motion.source in BY_SPEED:
        return MotionNoise(usual, std, learnt=False)
    changes = _changes(balance, vehicle, cut)
    if changes.shape[1] < SOME:
        return MotionNoise(usual, std, learnt=False)
    accel, force, speed = changes
    number = np.arange(accel.size) * PARTS // accel.size

    def noise(sums: Floats) -> Floats:
        own, with_force, with_speed, between = sums
        return np.asarray(0.5 * (own - with_force * with_speed / between))

    products = np.array([accel**2, accel * force, accel * speed, force * speed])
    parts = np.array([np.bincount(number, p, PARTS) for p in products])
    count = np.bincount(number, minlength=PARTS)
    if not parts[3].sum() > 0.0:
        return MotionNoise(usual, std, learnt=False)
    shown = float(noise(parts.sum(axis=1) / accel.size))
    left_out = noise((parts.sum(axis=1)[:, None] - parts) / (accel.size - count))
    error = float(np.sqrt((PARTS - 1) / PARTS * np.sum((left_out - np.mean(left_out)) ** 2)))
    if not (np.isfinite(error) and error > 0.0):
        return MotionNoise(usual, std, learnt=False)
    weight = std**2 / (std**2 + error**2)
    found = usual + weight * (shown - usual)
    variance = max(found, MOTION_WINDOW_STD**2)
    return MotionNoise(variance, float(np.sqrt(weight) * error), learnt=True)


def _changes(balance: ForceBalance, vehicle: Vehicle, cut: Windows) -> Floats:
    """Changes from window to window of specific force, force and acceleration by speed (3, k)."""
    table, speed = balance.table, balance.wheel_speed
    assert speed is not None
    last = np.cumsum(cut.count) - 1
    first, last = cut.index[last - cut.count + 1], cut.index[last]
    lasted = table.time[last] - table.time[first]
    with np.errstate(invalid="ignore", divide="ignore"):
        gained = (speed[last] - speed[first]) / lasted
    phi, force = regression(table, vehicle)
    # As if no fuel were burnt: the mass is then one all along.
    force = np.nan_to_num(force + phi * table.fuel_burnt)
    rows = np.array([cut.mean(phi), cut.mean(force), gained])
    known = (lasted > SHORTEST) & np.isfinite(rows).all(axis=0)
    beside = known[1:] & known[:-1] & (np.diff(cut.mean(table.time)) < APART)
    return np.asarray(np.diff(rows, axis=1)[:, beside])


def unmeasured_noise(
    weight: Floats,
    fast_var: Floats,
    torque_var: Floats,
    short: Bools,
    grade_std: Floats,
    mass: float,
    mass_var: float,
) -> Floats:
    """Variance of the noise in a specific force that no accelerometer measured (m,) [m^2/s^4].

    A driver who answers a hill that heights smooth away moves the pedal: only the force scatters,
    and no mass is too low by that. A hill of a few seconds is over before, and one that takes all
    the power that there is cannot be answered: the vehicle slows down, force and true specific
    force stay, and the measured one falls. That is noise of the regressor: what scatters from
    window to window, and all of the scatter where power is short, but none that is the torque's,
    and no more than the grade is uncertain by.

    Parameters
    ----------
    weight : (m,) diagonal of the inverse covariance of the force [1/N^2]; 0 where left out
    fast_var : (m,) variance of the force that is another one in each window [N^2]
    torque_var : (m,) part of it that is noise of the torque [N^2]
    short : (m,) `short_of_power`
    grade_std : (m,) of the specific force, by the grade [m/s^2]
    mass : [kg]
    mass_var : of it, by the whole drive [kg^2]

    References
    ----------
    Fuller, Measurement Error Models, 1987, ch. 1; noise of the true value about the measured one:
    Berkson, J. Am. Stat. Assoc. 45, 1950.
    """
    with np.errstate(divide="ignore"):
        whole = np.where(weight > 0.0, 1.0 / weight, 0.0)
    scatter = np.maximum(np.where(short, whole, fast_var) - torque_var, 0.0)
    part = np.minimum(scatter / mass**2, grade_std**2)
    return np.asarray(part / (1.0 + mass_var * float(np.sum(weight * part))))


OF_A_WALK: Final = 0.5
"""Part of the variance of a random walk that the mean of a torque has about straight lines [-]: a
driver and a controller change it by ramps. In windows of four trucks of two simulators it is 0.1 to
0.4 at 2 Hz and 0.3 to 0.9 at 1 Hz."""


def between_samples(time: Floats, force: Floats, usable: Bools) -> float:
    """Variance of the mean force from one sample to the next, over their straight line [N^2].

    A force that walks at random by ``d`` from sample to sample has a mean between both with the
    variance ``d^2 / 12`` about that of the straight line (Brownian bridge). Samples that shifts,
    brakes or gaps part are left out.

    Parameters
    ----------
    time : (n,) [s]
    force : (n,) [N]
    usable : (n,)

    References
    ----------
    Brownian bridge: Karatzas and Shreve, Brownian Motion and Stochastic Calculus, 1991, ch. 5.6.
    """
    step, change = np.diff(time), np.diff(np.nan_to_num(force))
    beside = usable[1:] & usable[:-1]
    if not beside.any():
        return 0.0
    beside &= step < 2.0 * np.median(step[beside])
    return float(np.mean(change[beside] ** 2)) / 12.0


def short_of_power(torque: Floats) -> Bools:
    """Windows with so much torque that no more can answer a hill (m,).

    Parameters
    ----------
    torque : (m,) of the windows [N m]
    """
    return np.asarray(torque >= FULL_TORQUE * np.quantile(torque, 0.99))


def attenuation(weight: Floats, variance: Floats, mass_var: Floats, begins: Bools) -> Floats:
    """By what part of it the mass of each load is too low (m,) [-], the same all along a load.

    Least squares of y on phi + n, weighted by W, comes out as ``phi W y / (phi W phi + n W n)``.
    Of the information in the denominator, the trace of W times the variances of n is noise:
    times the variance of the mass it is the part that is missing.

    Parameters
    ----------
    weight : (m,) diagonal of the inverse covariance of the force [1/N^2]
    variance : (m,) of the noise of the specific force [m^2/s^4]
    mass_var : (m,) of the mass by the whole drive [kg^2]
    begins : (m,) windows before which the load changed

    References
    ----------
    Fuller, Measurement Error Models, 1987, ch. 1, 2.
    """
    load = np.cumsum(begins)
    return too_low(mass_var * np.bincount(load, weight * variance)[load])


def too_low(noise: Floats) -> Floats:
    """By what part of it a mass is too low, of whose information so much is noise (m,) [-]."""
    return np.asarray(1.0 / (1.0 - np.minimum(noise, MOSTLY)) - 1.0)


def left_open(low: float, unsure: float) -> float:
    """Standard deviation of a mass that was raised by a part of itself, over it [-].

    Parameters
    ----------
    low : by which it was raised [-]
    unsure : standard deviation of the noise, over it [-]

    Returns
    -------
    One where most of the information is noise: then nothing shows how much of it is not.
    """
    return unsure * low if low < too_low(np.full(1, MOSTLY))[0] else 1.0


MOSTLY: Final = 0.5
"""Part of the information that counts as noise, at most [-]: beyond nothing is left to be shown."""

LEAST: Final = 0.01
"""Less is nothing [-]: undamaged drives have 0.002 to 0.004."""

MOST: Final = 0.07
"""Above this a method that takes the motion as exact gives no mass [-]."""


def row_noise_std(table: ForceTable, phi: Floats, used: Bools, share: float) -> float:
    """Relative standard deviation of a mass by a method that takes the motion as exact [-].

    White noise of 0.5 to 2 m/s^2 in simulated drives of nine vehicles took 1.5 to 3.2 times the
    noise's part of the rows' mean square off by rls, 1 to 2.5 times by robust-rls, and moved the
    others either way. Rows show more noise than white noise is between them, for navigation
    smooths it.

    Parameters
    ----------
    table : the rows
    phi : (n,) regressor of the mass [m/s^2]
    used : (n,)
    share : error of the method's mass over the noise's part of the rows' mean square [-]
    """
    moving = table.specific_force[np.isfinite(table.specific_force) & (table.speed > CREEPS)]
    if not used.any() or moving.size < 10:
        return 0.0
    part = noise_level(moving) ** 2 / float(np.mean(phi[used] ** 2))
    std = share * part
    return std if std > LEAST else 0.0


def too_noisy(std: float) -> Problem | None:
    """Say that the motion is too noisy for such a method; None if not."""
    if std <= MOST:
        return None
    return Problem.of("imu.too_noisy", share=100.0 * min(std, 1.0))
