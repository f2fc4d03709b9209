"""Does the suspension do what the vehicle file says? Found from the same ride."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.inertia.filter import (
    RideSamples,
    body_noise,
    corners,
    damping,
    longest_step,
    push_var,
    reference,
    stiffness,
)
from weighbridge.signals import Bools, Floats, Ints
from weighbridge.vehicle import Ride

BAND: Final = (0.5, 10.0)
"""Frequencies of the body that are looked at [Hz]: below, offsets drift; above, axles hop and
differences of velocities are noise."""

BLOCK: Final = 0.5
"""Rows within so long count as dependent [s]."""

STILL: Final = 2.0
"""Travels count as dependent within so long, three periods of the body [s]."""

SHORTEST: Final = 10.0
"""A ride of less does not show eight parts apart [s]."""

LONGEST: Final = 300.0
"""More adds nothing [s]."""

PARTS: Final = tuple(
    f"{wheel} {part}"
    for part in ("spring", "damper")
    for wheel in ("front left", "front right", "rear left", "rear right")
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """How accelerations follow the suspension's forces, and rates the travels.

    Attributes
    ----------
    slope : (3,) acceleration over that of the vehicle file's parameters, by least
        squares; negative where a sign is wrong [-]
    correlation : (3,) of the two [-]
    rate_slope : (4,) derivative of the travel over the rate of each wheel [-]
    rate_correlation : (4, 4) of the travel's derivative of each wheel with the rate of
        each [-]
    """

    slope: Floats
    correlation: Floats
    rate_slope: Floats
    rate_correlation: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class SuspensionCheck:
    """Each spring and damper against the vehicle file, given the masses found.

    Attributes
    ----------
    factor, std : (8,) of four springs and four dampers, over the vehicle file's [-]; what
        they have in common is in the mass and cannot be seen
    misfit : (3,) part of the accelerations' power that other factors explain; 0 for axes
        that were not looked at [-]
    """

    factor: Floats
    std: Floats
    misfit: Floats

    @property
    def off(self) -> Floats:
        """(8,) how far each is off, surely and by enough to matter; else 0 [-]."""
        wrong = np.abs(self.factor - 1.0)
        return np.where(wrong > np.maximum(0.05, 4.0 * self.std), wrong, 0.0)


def _banded(
    samples: RideSamples, calm: Bools | None = None
) -> tuple[Floats, Floats, Floats, Ints] | None:
    """Even rows of both sides of the balance within `BAND`.

    The mean of a force over two steps by Simpson's rule goes with the difference of the
    velocity over them, so that neither is smoothed more than the other.

    Parameters
    ----------
    samples
    calm : (n,) samples to keep; all when None

    Returns
    -------
    accel : (m, 3)
    parts : (m, 8) mean travels and rates
    travel_rate : (m, 4) derivative of the travel
    block : (m,) number of the block
    """
    time = samples.time
    known = np.isfinite(samples.velocity).all(axis=1)
    if np.count_nonzero(known) < 100:
        return None
    step = samples.period
    high = min(BAND[1], 0.3 / step)
    if high <= 2.0 * BAND[0]:
        return None
    grid = np.arange(time[known][0], time[known][-1], step)
    columns = [np.interp(grid, time, c) for c in (*samples.travel.T, *samples.rate.T)]
    columns += [np.interp(grid, time[known], c[known]) for c in samples.velocity.T]
    inputs, velocity = np.column_stack(columns[:8]), np.column_stack(columns[8:])
    mean = (inputs[:-2] + 4.0 * inputs[1:-1] + inputs[2:]) / 6.0
    accel = (velocity[2:] - velocity[:-2]) / (2.0 * step)
    travel_rate = (inputs[2:, :4] - inputs[:-2, :4]) / (2.0 * step)
    from scipy.signal import butter, sosfilt  # Slow to load.

    sections = butter(2, (BAND[0], high), "bandpass", fs=1.0 / step, output="sos")
    both = sosfilt(sections, np.hstack((accel, mean, travel_rate)), axis=0)
    # The filter needs a period of its lowest frequency to forget that it began, and after
    # a gap that was bridged.
    at = grid[1:-1]
    edges = np.append(time[:1], time[1:][np.diff(time) > longest_step(step)])
    began = edges[np.maximum(np.searchsorted(edges, at, side="right") - 1, 0)]
    upcoming = np.append(edges, np.inf)[np.searchsorted(edges, at, side="right")]
    gap_before = np.interp(upcoming, time[1:], np.diff(time), right=0.0)
    keep = (at > began + 1.0 / BAND[0]) & (at < upcoming - gap_before)
    if calm is not None:
        # What the filter saw before and after a push has it in it, too.
        near = np.convolve(~calm, np.ones(2 * round(1.0 / (BAND[0] * step)) + 1), "same") > 0.0
        keep &= np.interp(at, time, near.astype(np.float64)) == 0.0
    block = ((at - at[0]) / BLOCK).astype(np.int64)
    if np.count_nonzero(keep) < 100:
        return None
    both, block = both[keep], block[keep]
    return both[:, :3], both[:, 3:11], both[:, 11:], block


def response(samples: RideSamples, ride: Ride) -> Response | None:
    """Compare accelerations with forces and travels with rates; None for too short a ride."""
    rows = _banded(samples)
    if rows is None:
        return None
    accel, parts, travel_rate, _ = rows
    force = -parts * np.concatenate((stiffness(ride), damping(ride)))
    modelled = force @ np.vstack((corners(ride), corners(ride))) / reference(ride)
    rate = parts[:, 4:]
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = np.sum(accel * modelled, axis=0) / np.sum(modelled**2, axis=0)
        size = np.sqrt(np.sum(accel**2, axis=0) * np.sum(modelled**2, axis=0))
        correlation = np.sum(accel * modelled, axis=0) / size
        rate_slope = np.sum(travel_rate * rate, axis=0) / np.sum(rate**2, axis=0)
        sizes = np.sqrt(np.outer(np.sum(travel_rate**2, axis=0), np.sum(rate**2, axis=0)))
        rate_correlation = travel_rate.T @ rate / sizes
    return Response(
        slope=slope,
        correlation=correlation,
        rate_slope=rate_slope,
        rate_correlation=rate_correlation,
    )


def check_suspension(
    samples: RideSamples, ride: Ride, alpha: Floats, pushed: Bools | None = None
) -> SuspensionCheck | None:
    """Fit a factor to each spring and damper.

    Parameters
    ----------
    samples : of one load
    ride : what the vehicle file says
    alpha : (3,) inverse parameters found, over those of the vehicle file
    pushed : (n,) samples during braking, starting or turning, whose forces are not the
        suspension's: left out where enough remains, else the heave alone is looked at

    Returns
    -------
    None where the ride is too short.
    """
    if samples.duration < SHORTEST:
        return None
    lately = samples.between(samples.time[-1] - LONGEST)
    axes, rows = 3, None
    if pushed is not None:
        rows = _banded(lately, ~pushed[samples.time.size - lately.time.size :])
        # Pushes every few seconds leave too little, and may be the very fault that is looked
        # for: they do not move the heave.
        axes = 1 if rows is None else 3
    if rows is None:
        rows = _banded(lately)
    if rows is None:
        return None
    accel, parts, _, block = rows
    accel = accel[:, :axes]
    force = -parts * np.concatenate((stiffness(ride), damping(ride)))
    arms = (np.vstack((corners(ride), corners(ride))) * (alpha / reference(ride)))[:, :axes]
    before = accel - force @ arms
    # Rows weigh by what is left of them, so that no unit counts.
    scale = 1.0 / np.maximum(np.std(before, axis=0), 1e-12)
    design = np.stack([force * arms[:, j] * scale[j] for j in range(axes)])
    target = (accel * scale).T
    hessian = np.einsum("jni,jnk->ik", design, design)
    if not np.linalg.cond(hessian) < 1e12:
        return None
    right = np.einsum("jni,jn->i", design, target)
    factor = np.linalg.solve(hessian, right)
    left = target - design @ factor
    # What is left of neighbouring rows is alike: blocks of it, not rows, are independent.
    scores = np.einsum("jni,jn->ni", design, left)
    sums = np.array([np.bincount(block, weights=scores[:, i]) for i in range(8)]).T
    inverse = np.linalg.inv(hessian)
    std = np.sqrt(np.diag(inverse @ (sums.T @ sums) @ inverse))
    power = np.mean(target**2, axis=1)
    misfit = np.zeros(3)
    misfit[:axes] = (np.mean((before * scale) ** 2, axis=0) - np.mean(left**2, axis=1)) / power
    return SuspensionCheck(factor=factor, std=std, misfit=misfit)


def attenuation(samples: RideSamples, ride: Ride, noise_factor: float, alpha: Floats) -> Floats:
    """(3,) part by which noise of the suspension signals may lower the inverse parameters [-].

    Noise of a regressor draws its coefficient to zero by its share of the regressor's power.
    The filter averages it over as many samples as noise of the force needs to grow to that
    of one measured velocity. Half of the share is taken, as an average over the band.
    """
    force = -np.hstack((samples.travel, samples.rate)) * np.concatenate(
        (stiffness(ride), damping(ride))
    )
    phi = force @ np.vstack((corners(ride), corners(ride))) / reference(ride)
    noise = push_var(ride) * noise_factor**2
    walk = np.abs(alpha) * np.sqrt(noise) * samples.period
    with np.errstate(divide="ignore", invalid="ignore"):
        averaged = np.maximum(body_noise(ride) / walk, 1.0)
        share = noise / averaged / np.maximum(np.var(phi, axis=0), 1e-12)
    return np.asarray(np.where(np.isfinite(share), np.minimum(0.5 * share, 1.0), 1.0))


def static_mass(samples: RideSamples, ride: Ride, gravity: float) -> tuple[float, float]:
    """Sprung mass that the mean travel carries, and its standard deviation [kg].

    NaN where the vehicle file does not say with which mass the sensors read zero.
    """
    if ride.zero_mass is None:
        return math.nan, math.nan
    mean, std = _mean(samples.time, -samples.travel @ stiffness(ride) / gravity)
    return ride.zero_mass + mean, std


def body_tilt(samples: RideSamples, ride: Ride) -> tuple[float, float, float]:
    """Angles by which the mean travel says the body leans over the front and the rear axle.

    A stiff body leans alike over both, whatever its load and the turns it takes, but for the
    tyres' give: the rest is an offset of a travel sensor.

    Returns
    -------
    front, rear : right side down [rad]; NaN where the ride is too short
    std : standard deviation of their difference [rad]
    """
    x = samples.travel
    front = (x[:, 0] - x[:, 1]) / ride.front_track
    rear = (x[:, 2] - x[:, 3]) / ride.rear_track
    return (
        _mean(samples.time, front)[0],
        _mean(samples.time, rear)[0],
        _mean(samples.time, front - rear)[1],
    )


def _mean(time: Floats, values: Floats) -> tuple[float, float]:
    """Mean of a part of a ride and its standard deviation, by blocks; NaN below four blocks."""
    if time.size < 2:
        return math.nan, math.nan
    block = ((time - time[0]) / STILL).astype(np.int64)
    count = np.bincount(block)
    means = np.bincount(block, weights=values)[count > 0] / count[count > 0]
    if means.size < 4:
        return math.nan, math.nan
    return float(np.mean(values)), float(np.std(means) / math.sqrt(means.size))
