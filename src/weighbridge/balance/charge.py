"""With which power of the air's density the torque at one load grows, by what else is measured.

Air flow and the pressure in the manifold are of the charge itself; a calculated load is a part of
the highest charge there (SAE J1979), or of one that never changes. Where a drive is in other air
than the calibration, the two part by that power.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from weighbridge.balance.second_signal import (
    BY_SIGNAL,
    air_of,
    compare,
    means,
    predicted_by,
    ranges_of,
    rows_of,
)
from weighbridge.limits import SOME
from weighbridge.signals import Drive
from weighbridge.vehicle import Vehicle


def in_this_air(drive: Drive, vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with the power of the charge that the drive's second signals show.

    Parameters
    ----------
    drive
    vehicle : itself where its reading does not change with the air, or no second signal shows

    References
    ----------
    Kalman's update of one constant, from what is usual of the source: Gelb, Applied Optimal
    Estimation, 1974, ch. 4.
    """
    exponent, std = vehicle.torque.in_thin_air
    if vehicle.torque.charge is None or std == 0.0:
        return vehicle
    variance = std**2
    for relation in vehicle.witnesses:
        second_signal = BY_SIGNAL[relation.signal]
        by_pressure, by_heat = second_signal.air
        if second_signal.enriched or by_pressure != (0.0, 0.0):
            continue
        rows = rows_of(drive, vehicle, second_signal)
        if rows is None or relation.pressure is None or relation.temperature is None:
            continue
        part = means(rows, second_signal, ranges_of(relation))
        if part.time.size < SOME:
            continue
        found = compare(part.reading, predicted_by(relation, part))
        pressure, temperature = air_of(drive, float(part.time[0]), float(part.time[-1]))
        warmer = float(np.log(temperature / relation.temperature))
        denser = float(np.log(pressure / relation.pressure)) - 0.5 * warmer
        if not (found.scale > 0.0 and np.isfinite(denser)):
            continue
        # The reading over the second signal falls by this power of the charge.
        off = np.log(found.scale) + exponent * denser + np.mean(by_heat) * warmer
        noise = float(np.hypot(found.scale_std, relation.scale_std))
        noise = float(np.hypot(noise, np.ptp(by_heat) * warmer))
        gain = -denser * variance / (denser**2 * variance + noise**2)
        exponent, variance = exponent + gain * off, variance * (1.0 + gain * denser)
    if variance == std**2:
        return vehicle
    torque = replace(
        vehicle.torque,
        charge_exponent=float(np.clip(exponent, -1.0, 2.0)),
        charge_exponent_std=float(np.sqrt(variance)),
    )
    return replace(vehicle, torque=torque)
