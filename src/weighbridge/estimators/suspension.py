"""Does the suspension do what the vehicle file says? Found from the same ride."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.signal import butter, sosfilt

from weighbridge.estimators.inertia import (
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
from weighbridge.vehicle.model import Ride

BAND: Final = (0.5, 10.0)
"""Frequencies of the body that are looked at [Hz]: below, offsets drift; above, axles hop and
differences of velocities are noise."""

BLOCK: Final = 0.5
"""Rows within so long count as dependent [s]."""

SHORTEST: Final = 10.0
"""A ride of less does not tell eight parts apart [s]."""

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
    misfit : (3,) part of the accelerations' power that other factors explain [-]
    """

    factor: Floats
    std: Floats
    misfit: Floats

    @property
    def off(self) -> Floats:
        """(8,) how far each is off, beyond doubt and by enough to matter; else 0 [-]."""
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
        suspension's

    Returns
    -------
    None where the ride is too short to tell.
    """
    if samples.time.size < 2 or samples.time[-1] - samples.time[0] < SHORTEST:
        return None
    lately = samples.since(samples.time[-1] - LONGEST)
    calm = None if pushed is None else ~pushed[samples.time.size - lately.time.size :]
    rows = _banded(lately, calm)
    if rows is None:
        return None
    accel, parts, _, block = rows
    force = -parts * np.concatenate((stiffness(ride), damping(ride)))
    arms = np.vstack((corners(ride), corners(ride))) * (alpha / reference(ride))
    before = accel - force @ arms
    # Rows weigh by what is left of them, so that no unit counts.
    scale = 1.0 / np.maximum(np.std(before, axis=0), 1e-12)
    design = np.stack([force * arms[:, j] * scale[j] for j in range(3)])
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
    misfit = (np.mean((before * scale) ** 2, axis=0) - np.mean(left**2, axis=1)) / power
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
    if ride.zero_mass is None or samples.time.size < 2:
        return math.nan, math.nan
    lift = -samples.travel @ stiffness(ride) / gravity
    block = ((samples.time - samples.time[0]) / (4.0 * BLOCK)).astype(np.int64)
    count = np.bincount(block)
    means = np.bincount(block, weights=lift)[count > 0] / count[count > 0]
    if means.size < 4:
        return math.nan, math.nan
    return ride.zero_mass + float(np.mean(lift)), float(np.std(means) / math.sqrt(means.size))
