"""Can the masses that a calibration is given be true, each by itself and one beside another?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.calibration.uncertain_motion import uncertain_gains
from weighbridge.constants import PETROL_HEATING_VALUE
from weighbridge.errors import ConfigError
from weighbridge.estimators import joint
from weighbridge.estimators.joint.problem import UNMODELLED
from weighbridge.limits import SIGNIFICANT, SURE
from weighbridge.messages import Problem, phrase, refused
from weighbridge.signals import Drive, Floats
from weighbridge.vehicle import VEHICLE_CLASSES, Vehicle, scale_std, source_of
from weighbridge.vehicle.data_sheet import usual_efficiency
from weighbridge.vehicle.fuel import SEEN

POUND: Final = 0.45359237
"""[kg], by definition."""

LIGHTEST: Final = 0.9
"""Least mass over the tare [-]: an empty tank, no driver's 75 kg, and what was taken out."""

OVERLOAD: Final = 1.25
"""Largest mass over the permitted one [-]."""

FAR: Final = 0.3
"""Scale of a measured torque that is off by more is the mass's fault [-]: makers allow torque
5 %, and their reference torques were found 15 % off."""

BEST_DIESEL, BEST_PETROL = 0.45, 0.38
"""Work at the wheels over the energy of the fuel that no drive reaches [-], by fuel rate and by air
flow and its ratio: the best engines have as much at their best point, and nothing of it is lost."""

DRAG_FAR: Final = 2.5
"""Standard deviations of the class from which a drag area is reported [-]."""

UNCERTAIN: Final = 0.06
"""A drive that weighs so much more or less than the others, by the file made of all, is reported
[-]: of nine simulated vehicles the farthest of three drives was 0.03 off, with one mass of three
20 % off 0.21 to 0.32."""

OVER: Final = 1.02
"""Mass over the permitted one from which it is reported [-]."""


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


def scale_by_mass(vehicle: Vehicle) -> float:
    """Scale that a calibration gives a torque in N m or percent over a data sheet's [-].

    1 where the torque has no scale of its own. More than 1 is a mass that is too heavy, or a torque
    that reads too low.
    """
    model = vehicle.torque
    if not source_of(vehicle).signed or len(model.coefficients) < 2:
        return 1.0
    slope = model.coefficients[1] + (float(np.mean(model.knot_slopes)) if model.knots else 0.0)
    return slope / usual_efficiency(vehicle)[0]


def scale_finding(vehicle: Vehicle, masses: list[float], names: str) -> Problem | None:
    """Compare the scale that a calibration gives a torque in N m or percent with a data sheet's.

    Parameters
    ----------
    vehicle : calibrated
    masses : it was calibrated with [kg]
    names : of the drives

    Returns
    -------
    What is uncertain; None where nothing is

    Raises
    ------
    DriveError
        No torque is so far off.
    """
    ratio, std = scale_by_mass(vehicle), scale_std(vehicle)
    if abs(ratio - 1.0) <= SIGNIFICANT * std:
        return None
    listed = " and ".join(f"{kg:.0f}" for kg in masses)
    likely = " and ".join(f"{kg / ratio:.0f}" for kg in masses)
    found: dict[str, Any] = {
        "masses": listed,
        "drives": names,
        "ratio": 1.0 / ratio,
        "std": 200.0 * std,
        "likely": likely,
    }
    if abs(np.log(ratio)) > FAR:
        pounds = " and ".join(f"{kg * POUND:.0f}" for kg in masses)
        hint = phrase("as_pounds", pounds=pounds) if 1.9 < ratio < 2.5 else ""
        raise refused("calibration.scale_wrong", **found, hint=hint)
    return Problem.of("calibration.scale", **found)


def fuel_finding(drive: Drive, balance: ForceBalance, kg: float) -> Problem | None:
    """Compare the work that a mass makes of the torque with the fuel that was burnt for it.

    Parameters
    ----------
    drive, balance : of the calibration, by the file that was made
    kg : mass it was calibrated with [kg]

    Returns
    -------
    What is wrong; None where the work is possible, or no fuel was recorded
    """
    by_rate = drive.has("fuel_rate")
    if not (by_rate or (drive.has("mass_air_flow") and drive.has("lambda_1"))):
        return None
    best = BEST_DIESEL if by_rate else BEST_PETROL
    table = balance.table
    power = np.maximum(np.nan_to_num(table.traction_force * table.speed), 0.0)
    span = np.minimum(np.diff(table.time), SEEN)
    work = float(np.sum(span * 0.5 * (power[1:] + power[:-1])))
    energy = PETROL_HEATING_VALUE * float(table.fuel_burnt[-1])
    if not energy > 0.0 or work <= best * energy:
        return None
    return Problem.of(
        "calibration.fuel",
        mass=kg,
        drive=drive.name,
        share=100.0 * work / energy,
        pounds=kg * POUND,
    )


def drag_finding(vehicle: Vehicle, masses: list[float]) -> Problem | None:
    """Compare the air drag that a scale by mass alone gives a vehicle with that of its class.

    Parameters
    ----------
    vehicle : calibrated
    masses : it was calibrated with [kg]

    Returns
    -------
    What is wrong; None where the drag is usual, or the torque has a scale of its own
    """
    if source_of(vehicle).signed:
        return None
    (usual, std), area = vehicle.of_class.drag_area, vehicle.road.drag_area.value
    if abs(area - usual) <= DRAG_FAR * std:
        return None
    listed = " and ".join(f"{kg:.0f}" for kg in masses)
    heavy = "heavy" if area > usual else "light"
    return Problem.of(
        "calibration.drag",
        masses=listed,
        vehicle=vehicle.name,
        area=area,
        kind=vehicle.kind,
        usual=usual,
        std=std,
        word=heavy,
    )


def questionable_masses(
    vehicle: Vehicle, balances: Sequence[ForceBalance], masses: Sequence[float]
) -> list[Problem]:
    """Say which masses of a calibration are uncertain, or motions.

    Parameters
    ----------
    vehicle : calibrated; with the permitted mass, where it is known
    balances : of its drives
    masses : they were calibrated with [kg]
    """
    names, gross = vehicle.provenance.drives, vehicle.gross
    contradictions = [
        Problem.of("calibration.above_gross", drive=name, mass=kg, gross=gross)
        for name, kg in zip(names, masses, strict=True)
        if gross is not None and kg > OVER * gross
    ]
    contradictions += uncertain_gains(names, [b.motion for b in balances])
    fit = vehicle.provenance.fit
    if fit is None or not fit.refined or len(masses) < 2:
        return contradictions
    tracks = [joint.estimate(b, vehicle, load_changes=False) for b in balances]
    left = np.array(masses) - np.array([float(b.table.fuel_burnt[-1]) for b in balances])
    ratios = np.array([t.mass for t in tracks]) / left
    stds = UNMODELLED * np.array([t.bound_std for t in tracks]) / left
    return contradictions + contradicting(names, masses, ratios, stds)


def refuse_too_heavy(vehicle: Vehicle, masses: Sequence[float], doubts: Sequence[Problem]) -> None:
    """Refuse masses that are too heavy by two signs: the permitted mass, and what the drives show.

    Parameters
    ----------
    vehicle : calibrated
    masses : it was calibrated with [kg]
    doubts : that say that the masses are too heavy; a single sign is reported and kept

    Raises
    ------
    DriveError
        Both are there.
    """
    gross = vehicle.gross
    if gross is None or not doubts or max(masses) <= OVER * gross:
        return
    name = vehicle.provenance.drives[int(np.argmax(masses))]
    raise refused(
        "calibration.too_heavy", drive=name, mass=max(masses), gross=gross, doubt=doubts[0].text
    )


def contradicting(
    names: Sequence[str], masses: Sequence[float], ratios: Floats, stds: Floats
) -> list[Problem]:
    """Say which drive weighs otherwise than the others, by the file that was made of all.

    Parameters
    ----------
    names : of the drives
    masses : they were calibrated with [kg]
    ratios : weighed mass over it (n,) [-]; NaN where a drive was not weighed
    stds : standard deviations of the ratios (n,) [-]
    """
    known = np.flatnonzero(np.isfinite(ratios) & np.isfinite(stds) & (stds > 0.0))
    if known.size < 2:
        return []
    off = np.zeros(ratios.size)
    for k in known:
        others = known[known != k]
        weight = 1.0 / stds[others] ** 2
        mean = float(np.average(ratios[others], weights=weight))
        std = float(np.hypot(stds[k], 1.0 / np.sqrt(weight.sum())))
        apart = float(ratios[k]) / mean - 1.0
        off[k] = apart if abs(apart) > SURE * std else 0.0
    worst = int(np.argmax(np.abs(off)))
    if abs(off[worst]) <= UNCERTAIN:
        return []
    # Of two it may be either.
    return [
        Problem.of(
            "calibration.may_contradict",
            drive=names[worst],
            off=100.0 * off[worst],
            mass=masses[worst],
            which=phrase("mass_of_several" if known.size > 2 else "mass_of_two"),
        )
    ]


def unbacked_scale(vehicle: Vehicle) -> list[Problem]:
    """Ask for tare and permitted mass where nothing else backs the masses of a calibration.

    A torque in N m or percent has a scale of its own. What a load or an air flow is worth comes
    by the masses alone: times any factor, the fit is as good.
    """
    if source_of(vehicle).signed or vehicle.tare is not None or vehicle.gross is not None:
        return []
    return [
        Problem.of(
            "calibration.unbacked",
            source=source_of(vehicle).title,
            missing=phrase("masses_missing"),
        )
    ]


def tared(vehicle: Vehicle, tare: float) -> Vehicle:
    """Give a calibrated vehicle its mass without payload [kg]: its note no longer asks for it."""
    made = vehicle.provenance
    notes = made.notes and made.notes.replace(phrase("masses_missing"), phrase("gross_missing"))
    return replace(vehicle, tare=tare, provenance=replace(made, notes=notes))


def with_findings(vehicle: Vehicle, doubts: Sequence[Problem]) -> Vehicle:
    """Keep in the vehicle file what is to be reported of its masses at each weighing."""
    made = vehicle.provenance
    return replace(vehicle, provenance=replace(made, doubts=tuple(d.line for d in doubts)))
