"""Tables and figures in numbers of the reproduction of Jensen et al. 2022."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from weighbridge.estimators import RlsSettings, run_in_turn
from weighbridge.papers.jensen2022_judged import DriveResult
from weighbridge.papers.jensen2022_reproduction import (
    HighwayResult,
    Reproduction,
    perturbed,
)
from weighbridge.report.table import Table
from weighbridge.results import Calibration
from weighbridge.signals import Floats, scalar_from_si, scalar_to_si
from weighbridge.simulation import MIDSIZE
from weighbridge.vehicle import Vehicle

PAPER_R_SQUARED: Final = 0.972
"""Of the torque fit (Table 6)."""

PAPER_ROAD: Final = ("0.70", "0.008", "0.14", "7.0")
"""C_d A, C_r, I_e and I_w in `ROAD_UNITS`, as Table 6 prints them."""

PAPER_WEIGHTS: Final = ("-17.85", "9.64", "2.5e-3", "-1.44e-6")
"""w0 to w3 in `WEIGHT_UNITS`, as Table 6 prints them."""

ROAD: Final = ("C_d A", "C_r", "I_e", "I_w")
"""Names of the road parameters."""

ROAD_UNITS: Final = ("m²", "", "kg m²", "kg m²")
"""Of the road parameters; C_r has none."""

WEIGHT_UNITS: Final = ("N m", "N m/%", "N m/rpm", "N m/rpm²", "N m/rpm³", "N m/rpm⁴")
"""Of the coefficients of eq. 49: load in percent, engine speed in rpm."""

PERTURBED_DRIVE: Final = 7
"""Drive of figs. 17-19: the captions say 6 with 240 kg, which by Table B.1 is 7."""

HIGHWAY_SPEED: Final = 25.0
"""Faster is on the highway [m/s]."""


def drives_table(done: Reproduction) -> Table:
    """One row a drive: by the paper's rules and by ours."""
    rows = []
    for print_, d in zip(done.printed, done.drives, strict=True):
        low, high = d.weighing.interval(0.95) if d.weighing is not None else (0.0, 0.0)
        rows.append(
            (
                f"{d.drive.number}  {d.drive.kind}",
                f"{d.true_mass:.0f}",
                f"{100.0 * print_.worst:.2f}",
                f"{100.0 * print_.inside:.0f}",
                degrees(print_.pitch_largest),
                f"| {100.0 * d.worst:.2f}",
                f"{100.0 * d.inside:.0f}",
                f"{d.track.mass:.0f} ± {0.5 * (high - low):.0f}",
                f"{100.0 * d.error:+.2f}",
                degrees(d.pitch_largest),
            )
        )
    return Table(
        "Drives of Table B.1: the paper's own rules | ours, wind unknown (worst and inside: "
        "running mass in the last two thirds)",
        ("drive", "true kg", "worst %", "inside ±5 %", "pitch max °", "| worst %", "inside ±5 %",
         "mass kg ± 95 %", "error %", "pitch max °"),
        tuple(rows),
    )  # fmt: skip


def highway_table(done: Reproduction) -> Table:
    """Trips of fig. 16 by our default method, which finds the wind beside the mass."""
    rows = tuple(
        (h.trip.wind, h.trip.speeds, f"{100.0 * (h.joint / h.true_mass - 1.0):+.1f}")
        for h in done.highways
    )
    return Table(
        "Fig. 16 by `joint`, which finds the wind: mass of each whole trip",
        ("wind", "speed km/h", "error %"),
        rows,
    )


def ways(
    done: Reproduction,
) -> tuple[tuple[str, tuple[DriveResult, ...], Vehicle, RlsSettings], ...]:
    """The two ways of weighing: name, drives, vehicle and settings of the filter."""
    return (
        ("printed", done.printed, done.printed_car.vehicle, done.settings.printed.rls),
        ("ours", done.drives, done.car, done.settings.rls),
    )


def in_turn(
    done: Reproduction, drives: Sequence[DriveResult], car: Vehicle, rls: RlsSettings
) -> dict[float, tuple[Floats, ...]]:
    """Running mass of drives 4-8 one after another, by forgetting factor (fig. 13)."""
    loaded = [d for d in drives if 4 <= d.drive.number <= 8]
    return {
        f: run_in_turn([d.balance for d in loaded], car, replace(rls, forgetting=f))
        for f in done.settings.forgettings
        if loaded
    }


def perturbations(
    done: Reproduction, drives: Sequence[DriveResult], car: Vehicle, rls: RlsSettings
) -> dict[str, dict[float, Floats]]:
    """Running mass of the loaded drive with a perturbed model, by kind and size (figs. 17-19)."""
    chosen = next((d for d in drives if d.drive.number == PERTURBED_DRIVE), drives[0])
    wind_from, balance = chosen.drive.wind_from, chosen.balance
    s = done.settings
    return {
        "wind": {v: perturbed(balance, car, rls, wind_speed=v, wind_from=wind_from)
                 for v in s.winds},
        "drag": {f: perturbed(balance, car, rls, drag=f) for f in s.drags},
        "rolling": {f: perturbed(balance, car, rls, rolling=f) for f in s.rollings},
    }  # fmt: skip


def highways(done: Reproduction, way: str, wind: str) -> tuple[HighwayResult, ...]:
    """Trips of one wind by one way of weighing (fig. 16)."""
    every = done.printed_highways if way == "printed" else done.highways
    return tuple(h for h in every if h.trip.wind == wind)


def unweighted(calibration: Calibration) -> float:
    """R² of a torque fit with each row counted once, as the paper's [-]."""
    rows = calibration.rows
    total = np.sum((rows.motion_torque - np.mean(rows.motion_torque)) ** 2)
    return float(1.0 - np.sum((rows.motion_torque - rows.source_torque) ** 2) / total)


def passes(drives: Sequence[DriveResult]) -> tuple[float, float]:
    """Mean error of the running mass on the motorway, southward and northward [%]."""
    south, north = [], []
    for d in drives:
        table = d.balance.table
        off = 100.0 * (d.track.running_mass / d.true_mass - 1.0)
        fast = (table.speed > HIGHWAY_SPEED) & np.isfinite(off)
        along = table.direction(0)
        south.append(off[fast & (along < -0.5)])
        north.append(off[fast & (along > 0.5)])
    return float(np.concatenate(south).mean()), float(np.concatenate(north).mean())


def pitch(drives: Sequence[DriveResult]) -> str:
    """Largest error of the pitch, and the share of time within a degree."""
    share = float(np.mean([d.pitch_within for d in drives]))
    return f"{degrees(max(d.pitch_largest for d in drives))}°; {100.0 * share:.2f} % within 1°"


def slope(drives: Sequence[DriveResult]) -> str:
    """The same of the slope of the road."""
    share = float(np.mean([d.grade_within for d in drives]))
    largest = max(d.grade_largest for d in drives)
    return f"{degrees(largest)}°; {100.0 * share:.2f} % within 1°"


def fitted(car: Vehicle) -> tuple[float, float, float, float]:
    """C_d A, C_r, I_e and I_w of a vehicle."""
    road, line = car.road, car.driveline
    return (
        road.drag_area.value,
        road.rolling_coefficient.value,
        line.engine_inertia or 0.0,
        line.wheel_inertia or 0.0,
    )


def truth() -> tuple[float, float, float, float]:
    """C_d A, C_r, I_e and I_w of the simulated car."""
    car = MIDSIZE
    return car.drag_area, car.rolling_coefficient, car.engine_inertia, car.wheel_inertia


def parameters_table(done: Reproduction) -> Table:
    """Table 6: the paper's car, both fits to the simulated one, and what that one truly has."""
    cars = (done.printed_car.vehicle, done.control.vehicle, done.car)
    found = [[f"{w:.3g}" for w in _in_papers_units(car)] for car in cars]
    fits = (*(fitted(car) for car in cars), truth())
    rows = [
        (f"{name} {unit}".strip(), theirs, *(f"{fit[k]:{form}}" for fit in fits))
        for k, (name, unit, theirs, form) in enumerate(
            zip(ROAD, ROAD_UNITS, PAPER_ROAD, (".3f", ".4f", ".3f", ".1f"), strict=True)
        )
    ]
    rows += [
        (f"w{k} {unit}", theirs, *(each[k] for each in found), "")
        for k, (unit, theirs) in enumerate(zip(WEIGHT_UNITS, PAPER_WEIGHTS, strict=False))
        if all(k < len(each) for each in found)
    ]
    rows.append(
        ("R², each row counted once", f"{PAPER_R_SQUARED}", f"{done.printed_car.r_squared:.3f}",
         f"{done.control.r_squared:.3f}", f"{unweighted(done.calibration):.3f}", "")
    )  # fmt: skip
    return Table(
        "Table 6: the paper's is another car; the simulated one has no torque of this form",
        (
            "parameter",
            "paper's car",
            "paper's rules",
            "paper's rules, eq. 1 alone",
            "ours",
            "truly, simulated car",
        ),
        tuple(rows),
    )


def _in_papers_units(car: Vehicle) -> list[float]:
    rpm = scalar_to_si(1.0, "rpm")
    scales = (1.0, 0.01, *(rpm**k for k in range(1, 5)))
    return [w * s for w, s in zip(car.torque.coefficients, scales, strict=False)]


def weights(car: Vehicle) -> str:
    """w0 to w3 of eq. 49 in the paper's units: load in percent, engine speed in rpm."""
    return with_units([f"{w:.3g}" for w in _in_papers_units(car)], WEIGHT_UNITS)


def with_units(values: Sequence[str], units: Sequence[str]) -> str:
    """Write values with their units, one after another."""
    return ", ".join(f"{value} {unit}".strip() for value, unit in zip(values, units, strict=False))


def percent(part: float) -> str:
    """A part as "1.23 %"."""
    return f"{100.0 * part:.2f} %"


def degrees(angle: float) -> str:
    """An angle [rad] in degrees."""
    return f"{scalar_from_si(angle, 'deg'):.3f}"
