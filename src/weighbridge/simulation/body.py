"""From the drive along the road to the pose of the body in space, every 5 ms."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pymap3d import rcurve
from scipy import signal as dsp

from weighbridge.constants import GRAVITY
from weighbridge.signals import Floats
from weighbridge.simulation.longitudinal import DT, Trajectory
from weighbridge.simulation.route import STEP

if TYPE_CHECKING:
    from weighbridge.simulation.scenario import Scenario

ROAD_ROUGHNESS = 48.0e-6
"""Displacement spectral density at 0.1 cycles/m, the better half of class B of
ISO 8608 (32e-6 to 128e-6) [m^3]."""


class Pose(NamedTuple):
    """Where the body is and how it is turned; the point at the rear axle."""

    grade: Floats
    course: Floats  # of the road [rad]
    pitch: Floats  # of the body, nose up [rad]
    roll: Floats  # right side down [rad]
    heading: Floats  # of the body [rad]
    velocity_n: Floats  # (3, n) north, east, down [m/s]
    altitude: Floats
    latitude: Floats
    longitude: Floats


def second_order(values: Floats, frequency: float, damping: float, *, zero: bool) -> Floats:
    """Pass through a spring-mass-damper of unit static gain.

    Parameters
    ----------
    values : (n,) float64
        Every 5 ms.
    frequency, damping : float
        Undamped [Hz], ratio [-].
    zero : bool
        Whether the damper passes the input on too, as a base excitation.

    Returns
    -------
    (n,) float64
    """
    w = 2.0 * math.pi * frequency
    numerator = [2.0 * damping * w, w * w] if zero else [w * w]
    b, a = dsp.bilinear(numerator, [1.0, 2.0 * damping * w, w * w], fs=1.0 / DT)
    start = dsp.lfilter_zi(b, a) * values[0]
    return np.asarray(dsp.lfilter(b, a, values, zi=start)[0])


def _road_shake(
    amplitude: Floats, rng: np.random.Generator, frequency: float, damping: float
) -> Floats:
    """Body motion over an uneven road: white vertical velocity, tyre, body."""
    # One-sided density of a white series at rate f_s is variance over f_s / 2.
    velocity = rng.standard_normal(amplitude.size) * amplitude * math.sqrt(0.5 / DT)
    tyre = second_order(velocity, 11.0, 0.35, zero=False)
    rate = second_order(tyre, frequency, damping, zero=True)
    motion = np.cumsum(rate) * DT
    # The slow part of the road is the route's own profile.
    b, a = dsp.butter(2, 0.25, btype="high", fs=1.0 / DT)
    return np.asarray(dsp.lfilter(b, a, motion))


def simulate_pose(scenario: Scenario, drive: Trajectory, rng: np.random.Generator) -> Pose:
    """Put the body on the road.

    Parameters
    ----------
    scenario : Scenario
    drive : Trajectory
    rng : numpy.random.Generator
        Of the road's unevenness.

    Returns
    -------
    Pose

    Notes
    -----
    Squat follows the specific force along the road through a damped second-order system: a hill
    moves load between the axles as an acceleration does (Gillespie 1992, eqs. 1-7 to 1-10). The
    position is carried over the ellipsoid with the local radii of curvature, so
    that altitude is height above it and the grade is against the local level;
    Earth rotation and transport rate are left out, as is gravity's change.
    """
    car, route, effects = scenario.car, scenario.route, scenario.effects
    grid = np.arange(route.grade.size) * STEP
    s, v = drive.distance, drive.speed
    grade = np.interp(s, grid, route.grade)
    course = np.interp(s, grid, route.heading)
    lateral = second_order(v * v * np.interp(s, grid, route.curvature), 3.0, 0.9, zero=False)
    accel = np.gradient(v, DT)
    payload = scenario.payload + (drive.loaded if scenario.loading else 0.0)
    # A coupling pulls lower than a load on the bed, and its own load is far behind the axle.
    pulled, pitching = payload, payload
    if (trailer := scenario.trailer) is not None:
        pulled = payload + trailer.hitch_pull * trailer.mass
        pitching = payload + trailer.hitch_pitch * trailer.hitch_load * trailer.mass
    lever = car.squat * effects.squat * (1.0 + car.squat_load * pulled / car.mass)
    force = accel + GRAVITY * np.sin(grade)
    squat = second_order(force * lever, car.pitch_frequency, 0.45, zero=False)
    body_roll = second_order(
        lateral * (-car.roll_gain * effects.roll), car.roll_frequency, 0.35, zero=False
    )
    pitch = grade + squat + car.load_pitch * pitching * effects.load_pitch
    roll = second_order(np.interp(s, grid, route.bank), 3.0, 0.7, zero=False) + body_roll
    heave = np.zeros_like(s)
    if effects.roughness > 0.0:
        uneven = np.interp(s, grid, route.roughness) * np.sqrt(
            (2.0 * math.pi * 0.1) ** 2 * ROAD_ROUGHNESS * np.maximum(v, 0.0)
        )
        uneven *= effects.roughness
        heave = _road_shake(0.75 * uneven, rng, car.heave_frequency, 0.3)
        pitch = pitch + _road_shake(uneven / car.wheelbase, rng, car.pitch_frequency, 0.35)
        roll = roll + _road_shake(0.7 * uneven / car.track, rng, car.roll_frequency, 0.3)
    heading = course + car.side_slip * effects.side_slip * lateral

    climb = np.gradient(heave, DT)
    level = v * np.cos(grade)
    velocity_n = np.stack(
        (level * np.cos(course), level * np.sin(course), -v * np.sin(grade) - climb)
    )
    altitude = route.altitude + np.interp(s, grid, route.height) + heave
    north = _integrate(velocity_n[0])
    # One pass for the latitude, one more with the radii it gives.
    latitude = route.latitude + north / float(rcurve.meridian(route.latitude, deg=False))
    radius = np.interp(latitude, *_radii(latitude, rcurve.meridian)) + altitude
    latitude = route.latitude + _integrate(velocity_n[0] / radius)
    radius = np.interp(latitude, *_radii(latitude, rcurve.transverse)) + altitude
    longitude = route.longitude + _integrate(velocity_n[1] / (radius * np.cos(latitude)))
    return Pose(grade, course, pitch, roll, heading, velocity_n, altitude, latitude, longitude)


def _integrate(rate: Floats) -> Floats:
    out = np.empty_like(rate)
    out[0] = 0.0
    np.cumsum(0.5 * DT * (rate[1:] + rate[:-1]), out=out[1:])
    return out


def _radii(latitude: Floats, function: object) -> tuple[Floats, Floats]:
    """Tabulate a radius of curvature over the latitudes driven."""
    at = np.linspace(latitude.min() - 1e-6, latitude.max() + 1e-6, 65)
    assert callable(function)
    return at, np.asarray(function(at, deg=False), dtype=np.float64)
