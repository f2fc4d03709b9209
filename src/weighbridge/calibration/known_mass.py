"""Can the mass that a calibration is told be true? By tare, gross, class and torque."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.errors import ConfigError, DriveError
from weighbridge.signals import Drive
from weighbridge.vehicle.classes import VEHICLE_CLASSES
from weighbridge.vehicle.data_sheet import scale_std, usual_efficiency
from weighbridge.vehicle.model import Vehicle
from weighbridge.vehicle.torque import source_of

POUND: Final = 0.45359237
"""[kg], by definition."""

LIGHTEST: Final = 0.9
"""Least mass over the tare [-]: an empty tank, no driver's 75 kg, and what was taken out."""

OVERLOAD: Final = 1.25
"""Largest mass over the permitted one [-]."""

SURE: Final = 0.3
"""Scale of a measured torque that is off by more is the mass's fault [-]: makers allow torque
5 %, and their reference torques were found 15 % off."""

DOUBTFUL: Final = 3.0
"""Standard deviations from which such a scale is told [-]."""


def check_mass(drive: Drive, kg: float, base: Vehicle) -> None:
    """Refuse a mass that the vehicle cannot have.

    Parameters
    ----------
    drive, kg : a drive of the calibration and its mass [kg]
    base : what is known of the vehicle: class, tare, gross

    Raises
    ------
    ConfigError
        The sentence says what is plausible, and what the number would be from pounds.
    """
    (low, high), untowed = base.of_class.mass_range, base.of_class.untowed
    heavier = list(VEHICLE_CLASSES)[::-1]
    other = (
        f"of a {heavier[0]} (or {', '.join(k for k in heavier[1:] if k != base.kind)}) write its "
        f"file first, weighbridge vehicle new --class {heavier[0]} -o base.toml, and give it by "
        "--vehicle base.toml"
    )
    why = f"is no {base.kind}'s, which is between {low:g} and {high:g} kg"
    remedy = f"{other}; else give the mass in kg"
    if base.tare is not None or base.gross is not None:
        low = LIGHTEST * base.tare if base.tare is not None else low
        if base.gross is not None:
            high = OVERLOAD * base.gross
        elif base.tare is not None:
            high = base.of_class.loaded * base.tare
        known = [f"tare {base.tare:g} kg"] if base.tare is not None else []
        known += [f"gross {base.gross:g} kg"] if base.gross is not None else []
        why = f"is not between {low:.0f} and {high:.0f} kg, as {' and '.join(known)} have it"
        remedy = (
            "give the mass in kg, correct tare_kg, or state gross_kg (of a trailer, too) under "
            "[vehicle] of --vehicle"
        )
    elif untowed is not None and untowed < kg <= high:
        high = untowed
        why = f"is more than the {high:g} kg a {base.kind} may have without a trailer"
        remedy = f"{other}; else give the mass in kg, or state tare_kg and gross_kg under [vehicle]"
    if low <= kg <= high:
        return
    pounds = kg * POUND
    stated = drive.info.mass
    likely = low <= pounds <= high if stated is None else abs(pounds / stated - 1.0) < 0.05
    hint = f"; {kg:g} lb are {pounds:.0f} kg" if likely and kg > high else ""
    raise ConfigError(
        f"{drive.name}: taken for a {base.kind}, and a mass of {kg:g} kg {why}{hint}; {remedy}"
    )


def scale_doubt(vehicle: Vehicle, masses: list[float], names: str) -> str:
    """Compare the scale that a calibration gives a torque in N m or percent with a data sheet's.

    Parameters
    ----------
    vehicle : calibrated
    masses : it was calibrated with [kg]
    names : of the drives

    Returns
    -------
    What is doubted, one sentence; empty where nothing is

    Raises
    ------
    DriveError
        No torque is so far off.
    """
    model = vehicle.torque
    if not source_of(vehicle).signed or len(model.coefficients) < 2:
        return ""
    slope = model.coefficients[1] + (float(np.mean(model.knot_slopes)) if model.knots else 0.0)
    ratio = slope / usual_efficiency(vehicle)[0]
    std = scale_std(vehicle)
    if abs(ratio - 1.0) <= DOUBTFUL * std:
        return ""
    listed = " and ".join(f"{kg:.0f}" for kg in masses)
    likely = " and ".join(f"{kg / ratio:.0f}" for kg in masses)
    text = (
        f"with {listed} kg the torque of {names} would read {1.0 / ratio:.2f} of what it is; by "
        f"data sheets, which are good to {200.0 * std:.0f} %, {likely} kg are plausible"
    )
    if abs(np.log(ratio)) > SURE:
        pounds = " and ".join(f"{kg * POUND:.0f}" for kg in masses)
        hint = f" (the same number of pounds is {pounds} kg)" if 1.9 < ratio < 2.5 else ""
        raise DriveError(
            f"{text}{hint}; give the mass in kg, and check gearings, wheel radius and the "
            "torque's unit"
        )
    return f"{text}: check the mass"
