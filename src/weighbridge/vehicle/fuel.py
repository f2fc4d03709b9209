"""The fuel that a drive burns, which the vehicle no longer carries."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from weighbridge.constants import PETROL_HEATING_VALUE, PETROL_STOICHIOMETRIC_RATIO
from weighbridge.signals import Drive, Floats, Signal
from weighbridge.vehicle.model import Vehicle

DENSITY: Final = 790.0
"""Of fuel [kg/m^3]: the middle of petrol, 720 to 775 (EN 228), and diesel, 820 to 845 (EN 590)."""

INDICATED_EFFICIENCY: Final = 0.36
"""Work on the pistons over the energy of the fuel by `PETROL_HEATING_VALUE` [-]: 0.38 (Heywood,
Internal Combustion Engine Fundamentals, 1988, ch. 5 and 15) by the lower 43 MJ/kg of his app. D."""

FRICTION: Final = 0.1
"""Friction torque of a warm engine over its torque at full load [-] (Heywood 1988, ch. 13)."""

FUEL_STD: Final = 0.3
"""Relative standard deviation of the fuel burnt, the way by work included [-]."""

SEEN: Final = 10.0
"""Of a longer gap between two rows no more is counted [s]: the engine may have stood."""


def fuel_flow(
    drive: Drive,
    vehicle: Vehicle,
    time: Floats,
    torque: Floats,
    engine_speed: Floats,
    full_torque: float | None = None,
) -> Floats:
    """Mass flow of the fuel (n,) [kg/s].

    From the fuel rate, else from air flow and air-fuel ratio, else from the
    work of the engine and its friction. A vehicle with one fixed gear is
    electric and burns none.

    Parameters
    ----------
    drive, vehicle
    time : (n,) stamps as recorded, not falling [s]
    torque : (n,) at the engine's shaft [N m]; NaN where unknown
    engine_speed : (n,) [rad/s]; NaN where unknown
    full_torque : of the engine, whose friction is a part of it; that of the rows when None [N m]
    """
    if vehicle.driveline.single_speed:
        return np.zeros(time.size)
    flow = np.full(time.size, np.nan)
    rate, air, ratio = drive.get("fuel_rate"), drive.get("mass_air_flow"), drive.get("lambda_1")
    if rate is not None and len(rate):
        flow = DENSITY * _near(rate, time)
    elif air is not None and len(air) and ratio is not None and len(ratio):
        equivalence_ratio = np.maximum(_near(ratio, time), 0.5)
        flow = _near(air, time) / (PETROL_STOICHIOMETRIC_RATIO * equivalence_ratio)
    full = full_load_torque(torque) if full_torque is None else full_torque
    return np.where(np.isfinite(flow), flow, _by_work(torque, engine_speed, full))


class Burnt(NamedTuple):
    """Fuel until an instant.

    Attributes
    ----------
    time : the instant [s]
    flow : then [kg/s]
    mass : burnt by then [kg]
    """

    time: float
    flow: float
    mass: float


def fuel_burnt(time: Floats, flow: Floats, since: Burnt | None = None) -> Floats:
    """Mass of the fuel burnt since the first row (n,) [kg].

    Parameters
    ----------
    time : (n,) not falling [s]
    flow : (n,) [kg/s]
    since : of an earlier row, to go on from; rows until then count backwards from it
    """
    burnt = np.concatenate(([0.0], np.cumsum(_parts(time, flow))))[: time.size]
    if since is None:
        return burnt
    done = int(np.searchsorted(time, since.time, side="right"))
    before = since.mass + (burnt[:done] - burnt[max(done - 1, 0)])
    parts = _parts(
        np.concatenate(([since.time], time[done:])), np.concatenate(([since.flow], flow[done:]))
    )
    return np.concatenate((before, np.cumsum(np.concatenate(([since.mass], parts)))[1:]))


def _parts(time: Floats, flow: Floats) -> Floats:
    """Fuel that is burnt from each row to the next (n - 1,) [kg]."""
    span = np.clip(np.diff(time), 0.0, SEEN)
    return np.asarray(span * np.maximum(0.5 * (flow[1:] + flow[:-1]), 0.0))


def _near(signal: Signal, time: Floats) -> Floats:
    """Values at ``time``; NaN where no sample is near."""
    return np.where(signal.age(time) <= SEEN, signal.at(time), np.nan)


def full_load_torque(torque: Floats) -> float:
    """Torque (n,) that a drive hardly exceeds [N m]; 0 where none is known."""
    known = torque[np.isfinite(torque)]
    return max(float(np.percentile(known, 98.0)), 0.0) if known.size else 0.0


def _by_work(torque: Floats, engine_speed: Floats, full: float) -> Floats:
    """Fuel flow of an engine by its work and its friction (n,) [kg/s]."""
    if not np.isfinite(torque).any():
        return np.zeros(torque.size)
    indicated = np.nan_to_num(torque) + FRICTION * full
    power = np.maximum(indicated, 0.0) * np.maximum(np.nan_to_num(engine_speed), 0.0)
    return np.asarray(power / (INDICATED_EFFICIENCY * PETROL_HEATING_VALUE))
