"""Rides of the reproduction of Nguyen 2024, against what was true."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from weighbridge.inertia import InertiaTrack
from weighbridge.signals import Floats
from weighbridge.simulation import RideSensors, RideVehicle, SimulatedRide
from weighbridge.vehicle import Ride


@dataclass(frozen=True, slots=True, kw_only=True)
class RideResult:
    """One run against its truth; arrays (3,) are of the three axes.

    Attributes
    ----------
    rmse : [kg], [kg m^2]
    mape : [-]
    settled, near : (3, 3) time after the start and each change (rows) from which the estimate
        stays within 5 % and within 10 % until the next change [s]
    velocity_rmse : [m/s], [rad/s]
    velocity_mape : [-]
    """

    rmse: Floats
    mape: Floats
    settled: Floats
    near: Floats
    velocity_rmse: Floats
    velocity_mape: Floats


def suspension_of(truck: RideVehicle, sensors: RideSensors, start: float = 1.0) -> Ride:
    """Say what is known of a simulated vehicle: all but its load.

    Parameters
    ----------
    truck
    sensors : whose noise is known
    start : where the estimate begins, over the truck's parameters [-]
    """
    vertical, roll, pitch = sensors.body_noise
    return Ride(
        front_stiffness=truck.stiffness[0],
        rear_stiffness=truck.stiffness[2],
        front_damping=truck.damping[0],
        rear_damping=truck.damping[2],
        front_track=truck.track[0],
        rear_track=truck.track[1],
        front_axle=truck.axle_distance[0],
        rear_axle=truck.axle_distance[1],
        front_unsprung=truck.unsprung_mass[0],
        rear_unsprung=truck.unsprung_mass[1],
        sprung_mass=start * truck.sprung_mass,
        roll_inertia=start * truck.roll_inertia,
        pitch_inertia=start * truck.pitch_inertia,
        force_std=0.0,
        travel_noise=sensors.travel_noise,
        rate_noise=sensors.rate_noise,
        vertical_velocity_noise=vertical,
        roll_rate_noise=roll,
        pitch_rate_noise=pitch,
    )


def judge(made: SimulatedRide, track: InertiaTrack) -> RideResult:
    """Compare a run with its truth, eq. 10."""
    error = track.parameters - made.inertias
    relative = np.abs(error / made.inertias)
    slip = track.velocity - made.velocities
    return RideResult(
        rmse=np.sqrt(np.mean(error**2, axis=0)),
        mape=np.mean(relative, axis=0),
        settled=_settled(made, track.time, relative, 0.05),
        near=_settled(made, track.time, relative, 0.10),
        velocity_rmse=np.sqrt(np.mean(slip**2, axis=0)),
        velocity_mape=np.mean(np.abs(slip / made.velocities), axis=0),
    )


def _settled(made: SimulatedRide, time: Floats, relative: Floats, band: float) -> Floats:
    """Time after the start and each change from which errors (n, 3) stay within a band (3, 3)."""
    edges = np.searchsorted(time, (0.0, *(t for t, _ in made.scenario.changes), np.inf))
    settled = np.zeros((3, 3))
    for k in range(3):
        a, b = edges[k], edges[k + 1]
        outside = relative[a:b] > band
        # Samples until the last one outside, that one counted.
        count = np.where(outside.any(axis=0), b - a - np.argmax(outside[::-1], axis=0), 0)
        settled[k] = count / made.scenario.sensors.rate
    return settled
