"""Acceleration from polled speeds and grade from heights, as conditional means."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.kernels import rts
from weighbridge.signals import Floats, Ints, Signal, resolution
from weighbridge.signals.minimum import lowest_by_slopes

ACCEL_TIME: Final = 3.0
"""How long a driver keeps an acceleration before the drive has shown [s]."""

ACCEL_STD: Final = 0.5
"""Standard deviation of the acceleration of a drive before it has shown [m/s^2]."""

SPEED_NOISE: Final = 0.03
"""Noise of a vehicle speed beside its resolution, before the drive has shown [m/s]."""

GRADE_STD: Final = 0.02
"""Standard deviation of the grade of roads before the drive has shown [-]."""

GRADE_LENGTH: Final = 300.0
"""Length over which a grade lasts, before the drive has shown [m]."""

GRADE_NOISE: Final = 0.01
"""Noise of a measured grade beside its resolution, before the drive has shown [rad]."""

HEIGHT_NOISE: Final = 1.0
"""Noise of heights from fix to fix before the drive has shown [m]."""

HEIGHT_WALK: Final = 4.0
"""Slow error of GNSS heights before the drive has shown [m]."""

HEIGHT_TIME: Final = 100.0
"""How long the slow error of heights lasts, before the drive has shown [s]."""

THINNED: Final = 0.1
"""The sizes are found from samples at least so far apart [s]."""

LEVEL_STD: Final = 1.0
"""Standard deviation of the logarithms of these values before the drive has shown [-]."""

_FARTHEST: Final = 4.0 * LEVEL_STD
"""Logarithms are sought up to here [-]. Of values that never change the likeliest noise is none,
and a filter divides by it."""

_CLOSE: Final = 0.01
"""The search ends where a step gains less of the logarithm of the likelihood [-]."""


def _stride(time: Floats) -> int:
    """Take every how-many-th sample, so that they are `THINNED` apart."""
    return max(1, round(THINNED * (time.size - 1) / max(float(time[-1] - time[0]), THINNED)))


def _merged(stamps: Floats, values: Floats, time: Floats) -> tuple[Floats, Floats, Ints]:
    """Join measurements and instants asked for: clock, measurements on it, places of the latter."""
    clock = np.unique(np.concatenate([stamps, time]))
    z = np.full(clock.size, np.nan)
    z[np.searchsorted(clock, stamps)] = values
    return clock, z, np.searchsorted(clock, time).astype(np.int64)


def _smooth_likeliest(
    usual: Floats,
    row: Floats,
    measured: tuple[Floats, Floats],
    time: Floats,
    *,
    way: Floats,
    begins: tuple[float, float | None],
) -> tuple[Floats, Floats]:
    """Smooth measurements of an integrated Gauss-Markov process by the sizes that are likeliest.

    Parameters
    ----------
    usual : (3,) or (5,) standard deviation and length of the process, standard deviation of the
        noise, and of an error that lasts its standard deviation and time
    row : (3,) what is measured of integral, process and that error
    measured : stamps [s] and values (j,)
    time : (n,) instants asked for, rising [s]
    way : (n,) what the process is integrated over, there
    begins : first value of the integral and its variance; that of the noise when None

    Returns
    -------
    x, var : (n, 2) or (n, 3) states and their variances
    """
    stamps, values = measured
    stride = _stride(stamps)
    thin = np.ascontiguousarray(values[::stride])
    begin, opened = begins

    def steps(clock: Floats) -> tuple[Floats, Floats]:
        at = clock if way is time else np.interp(clock, time, way)
        return np.diff(at, prepend=at[0]), np.diff(clock, prepend=clock[0])

    def sizes(level: Floats) -> tuple[float, float, float, float, float]:
        found = np.exp(np.log(usual) + level).tolist()
        return (*found, 0.0, 1.0)[:5]

    step, span = steps(stamps[::stride])

    def misfit(level: Floats) -> float:
        size = sizes(level)
        first = size[2] ** 2 if opened is None else opened
        likelihood = rts.log_likelihood(step, span, row, thin, size, begin, first)
        return float(-likelihood + 0.5 * np.sum((level / LEVEL_STD) ** 2))

    found = lowest_by_slopes(misfit, np.zeros(usual.size), close=_CLOSE, farthest=_FARTHEST)
    std, length, noise, walk, lasting = sizes(found)
    clock, z, at = _merged(stamps, values, time)
    step, span = steps(clock)
    states = 2 if usual.size == 3 else 3
    transition, cov = np.zeros((2, clock.size, states, states))
    transition[:, :2, :2], cov[:, :2, :2] = rts.gauss_markov(step, length, std)
    if states == 3:
        keep = np.exp(-span / lasting)
        transition[:, 2, 2], cov[:, 2, 2] = keep, walk**2 * (1.0 - keep**2)
    first = noise**2 if opened is None else opened
    spread = np.diag([first, std**2, walk**2][:states])
    start = np.array([begin, 0.0, 0.0][:states])
    variance = np.full(clock.size, noise**2)
    x, var = rts.smooth(transition, cov, row[:states], z, variance, start, spread)
    return x[at], var[at]


def smooth_speed(speed: Signal, time: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Smooth a polled speed into speed and acceleration.

    The acceleration is a first-order Gauss-Markov process; its size, how long
    it lasts and the noise of the speed are those of highest likelihood. What
    comes out is the mean given all samples: regressing on it is not drawn by
    its error, as that is independent of it (Berkson errors).

    Parameters
    ----------
    speed : the samples
    time : (n,) instants asked for, rising [s]

    Returns
    -------
    speed, accel : (n,) [m/s], [m/s^2]
    speed_std, accel_std : (n,) their standard deviations [m/s], [m/s^2]

    References
    ----------
    Singer, IEEE Trans. Aerospace and Electronic Systems 6(4), 1970, 473-483.
    Carroll et al., Measurement Error in Nonlinear Models, 2nd ed., 2006, ch. 1.
    """
    quantum = resolution(speed.values)
    x, var = _smooth_likeliest(
        np.array([ACCEL_STD, ACCEL_TIME, np.hypot(SPEED_NOISE, quantum / np.sqrt(12.0))]),
        np.array([1.0, 0.0, 0.0]),
        (speed.time, speed.values),
        time,
        way=time,
        begins=(float(speed.values[0]), None),
    )
    std = np.sqrt(np.maximum(var, 0.0))
    return x[:, 0], x[:, 1], std[:, 0], std[:, 1]


def smooth_height(
    altitude: Signal, time: Floats, distance: Floats
) -> tuple[Floats, Floats, Floats]:
    """Smooth heights into height and grade along the way.

    The grade is a first-order Gauss-Markov process over the distance. Heights
    have noise from fix to fix and an error that lasts; the sizes of all are
    those of highest likelihood.

    Parameters
    ----------
    altitude : heights on their own clock
    time : (n,) instants asked for, rising [s]
    distance : (n,) travelled [m]

    Returns
    -------
    height : (n,) [m]
    slope : (n,) rise over the distance [-]
    slope_std : (n,) its standard deviation [-]
    """
    inside = (altitude.time >= time[0]) & (altitude.time <= time[-1])
    stamps, values = altitude.time[inside], altitude.values[inside]
    quantum = resolution(values)
    noise = np.hypot(HEIGHT_NOISE, quantum / np.sqrt(12.0))
    x, var = _smooth_likeliest(
        np.array([GRADE_STD, GRADE_LENGTH, noise, HEIGHT_WALK, HEIGHT_TIME]),
        np.array([1.0, 0.0, 1.0]),
        (stamps, values),
        time,
        way=distance,
        begins=(float(values[0]), 1e4),
    )
    return x[:, 0], x[:, 1], np.sqrt(np.maximum(var[:, 1], 0.0))


def smooth_grade(measured: Signal, time: Floats, distance: Floats) -> tuple[Floats, Floats]:
    """Smooth a measured grade along the way.

    Parameters
    ----------
    measured : grades on their own clock [rad]
    time : (n,) instants asked for, rising [s]
    distance : (n,) travelled [m]

    Returns
    -------
    grade : (n,) [rad]
    grade_std : (n,) its standard deviation [rad]; of a grade that never changes, whose noise
        cannot be seen, that of any grade
    """
    quantum = resolution(measured.values)
    if not np.ptp(measured.values) > 0.0:
        return np.full(time.size, measured.values[0]), np.full(time.size, GRADE_NOISE)
    x, var = _smooth_likeliest(
        np.array([GRADE_STD, GRADE_LENGTH, np.hypot(GRADE_NOISE, quantum / np.sqrt(12.0))]),
        np.array([0.0, 1.0, 0.0]),
        (measured.time, measured.values),
        time,
        way=distance,
        begins=(0.0, 0.0),
    )
    return x[:, 1], np.sqrt(np.maximum(var[:, 1], 0.0))
