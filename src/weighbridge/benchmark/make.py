"""Make the benchmark: drives of the simulator as files, and the true masses in a file apart."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from string import Template
from typing import Any, Final

import numpy as np
import polars as pl
import tomlkit

from weighbridge.benchmark.plan import (
    CALIBRATIONS,
    CLASSES,
    EQUIPMENT,
    ROUTES,
    BenchmarkSettings,
    PlannedVehicle,
    plan,
)
from weighbridge.data import text_of
from weighbridge.errors import ConfigError
from weighbridge.io import PARSE_ERRORS, first_line
from weighbridge.io.write import write_drive, write_frame
from weighbridge.signals import Drive, DriveInfo
from weighbridge.signals.shown import plural
from weighbridge.simulation.simulate import SimulatedDrive, simulate_car
from weighbridge.vehicle import Known, describe, save_vehicle
from weighbridge.vehicle.known import Described
from weighbridge.version import VERSION
from weighbridge.whole import whole_folder, write_whole

SETTINGS: Final = "benchmark.toml"
DRIVES: Final = "drives.csv"
TRUTH: Final = "truth.csv"
SHEET: Final = "vehicle.toml"
"""Files of a benchmark; the last is in the folder of each vehicle."""

DRIVE_COLUMNS: Final = {
    "drive": pl.String(),
    "vehicle": pl.String(),
    "class": pl.String(),
    "equipment": pl.String(),
    "calibration": pl.String(),
    "route": pl.String(),
}
TRUTH_COLUMNS: Final = DRIVE_COLUMNS | {
    "kind": pl.String(),
    "mass_kg": pl.Float64(),
    "start_mass_kg": pl.Float64(),
    "tare_kg": pl.Float64(),
    "wind_mps": pl.Float64(),
    "ambient_temperature_degc": pl.Float64(),
}
"""Columns of ``drives.csv`` and ``truth.csv``; ``mass_kg`` is that at the end of the drive."""

_DRAG_COEFFICIENT: Final = {"car": 0.3, "electric": 0.25, "van": 0.35, "truck": 0.6, "bus": 0.65}
_SHEET_DRAG_STD: Final = 0.03
"""Error of a data sheet's drag area, relative [-]."""

_LICENCE: Final = """CC0 1.0 Universal

To the extent possible under law, the makers of these files have waived all copyright and related
or neighbouring rights to them: https://creativecommons.org/publicdomain/zero/1.0/
"""


def make_benchmark(
    folder: Path,
    settings: BenchmarkSettings,
    *,
    tell: Callable[[int, int], None] | None = None,
) -> int:
    """Make a benchmark, or go on with one that was interrupted.

    ::

        FOLDER/drives.csv                          the drives to weigh: name, vehicle, slice
        FOLDER/truck-imu-50hz-one-1/vehicle.toml   data sheet of a vehicle
        FOLDER/truck-imu-50hz-one-1/calibration-1/ a drive of known mass
        FOLDER/truck-imu-50hz-one-1/drive-1/       a drive to weigh
        FOLDER/truth.csv                           the masses that are asked for

    Parameters
    ----------
    folder : new, empty, or holding a part of the same benchmark
    settings
    tell : is given the vehicles done and in all, after each

    Returns
    -------
    int
        Drives to weigh.

    Raises
    ------
    ConfigError
        The folder holds something else, or cannot be written.
    """
    vehicles = list(plan(settings))
    rows = _begun(folder, settings, vehicles)
    finished = set(rows["vehicle"])
    for done, vehicle in enumerate(vehicles, start=1):
        if vehicle.name not in finished:
            # Without a row in the truth the folder may be from an interrupted run.
            shutil.rmtree(folder / vehicle.name, ignore_errors=True)
            made = pl.DataFrame(_write_vehicle(folder, vehicle), TRUTH_COLUMNS, orient="row")
            rows = pl.concat([rows, made])
            write_frame(rows, folder / TRUTH, ConfigError)
        if tell is not None:
            tell(done, len(vehicles))
    return rows.height


def _begun(
    folder: Path, settings: BenchmarkSettings, vehicles: list[PlannedVehicle]
) -> pl.DataFrame:
    """Write what is known before the drives; return the truth of those that are there."""
    stated = tomlkit.dumps({"weighbridge": VERSION} | asdict(settings))
    file = folder / SETTINGS
    if file.is_file():
        if file.read_text(encoding="utf-8") != stated:
            raise ConfigError(
                f"{file}: is of another benchmark or version; name another folder, or give the "
                "same options to go on with it"
            )
    elif folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigError(f"{folder}: is not empty and no benchmark; name another folder")
    else:
        folder.mkdir(parents=True, exist_ok=True)
        drives = [
            {"drive": f"{vehicle.name}/{drive}"} | _slice(vehicle) | {"route": route}
            for vehicle in vehicles
            for drive, route in vehicle.routes().items()
        ]
        write_frame(pl.DataFrame(drives, DRIVE_COLUMNS), folder / DRIVES, ConfigError)
        write_whole(folder / "LICENSE", _LICENCE)
        write_whole(folder / "README.md", _readme(settings, len(drives)))
        write_whole(file, stated)
    if (folder / TRUTH).is_file():
        return read_csv(folder / TRUTH, TRUTH_COLUMNS)
    return pl.DataFrame(schema=TRUTH_COLUMNS)


def read_csv(path: Path, columns: Mapping[str, pl.DataType]) -> pl.DataFrame:
    """Read a table of a benchmark.

    Raises
    ------
    ConfigError
        It cannot be read, or has other columns.
    """
    try:
        found = pl.read_csv(path, infer_schema=False)
        return found.select(pl.col(name).cast(kind) for name, kind in columns.items())
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from None
    except PARSE_ERRORS as error:
        raise ConfigError(
            f"{path}: is damaged ({first_line(error)}); make the benchmark again in another folder"
        ) from None


def _slice(vehicle: PlannedVehicle) -> dict[str, str]:
    return {
        "vehicle": vehicle.name,
        "class": vehicle.of_class,
        "equipment": vehicle.equipment,
        "calibration": vehicle.calibration,
    }


def _write_vehicle(folder: Path, vehicle: PlannedVehicle) -> list[dict[str, Any]]:
    """Write a vehicle with its drives; return their truth."""
    rows = []
    with whole_folder(folder / vehicle.name, (), ConfigError) as part:
        sheet = data_sheet(vehicle)
        save_vehicle(sheet.vehicle, part / SHEET, sheet.origins)
        for scenario in vehicle.known():
            made = simulate_car(scenario)
            mass = float(round(made.truth.mass[0]))
            write_drive(_recorded(made, vehicle.name, mass), part / scenario.name, "parquet")
        routes = vehicle.routes()
        for scenario in vehicle.weighed():
            made = simulate_car(scenario)
            write_drive(_recorded(made, vehicle.name, None), part / scenario.name, "parquet")
            rows.append(
                {"drive": f"{vehicle.name}/{scenario.name}"}
                | _slice(vehicle)
                | {
                    "route": routes[scenario.name],
                    "kind": vehicle.kind,
                    "mass_kg": round(float(made.truth.mass[-1]), 1),
                    "start_mass_kg": round(float(made.truth.mass[0]), 1),
                    "tare_kg": round(vehicle.car.mass, 1),
                    "wind_mps": round(scenario.wind_speed, 1),
                    "ambient_temperature_degc": round(scenario.ambient_temperature - 273.15, 1),
                }
            )
    return rows


def data_sheet(vehicle: PlannedVehicle) -> Described:
    """Return what an owner knows of a vehicle, rounded as papers have it."""
    car, kind = vehicle.car, vehicle.of_class
    error = np.random.default_rng([vehicle.seed, 77]).normal(1.0, _SHEET_DRAG_STD)
    coefficient = _DRAG_COEFFICIENT[kind]
    sheet = vehicle.calibration == "sheet"
    return describe(
        Known(
            name=vehicle.name,
            kind=car.kind,
            engine=car.engine,
            tare=round(car.mass),
            gross=vehicle.gross,
            radius=round(car.wheel_radius, 3),
            gear_ratios=tuple(round(ratio, 3) for ratio in car.gear_ratios),
            final_drive=round(car.final_drive, 3),
            torque=("measured" if car.electric else "percent") if sheet else None,
            drag_coefficient=coefficient,
            frontal_area=round(float(error * car.drag_area / coefficient), 2),
        )
    )


def _recorded(made: SimulatedDrive, vehicle: str, mass: float | None) -> Drive:
    """Return a drive that states no more than a logger would: no weather, no notes."""
    info = DriveInfo(start_time=made.drive.info.start_time, vehicle=vehicle, mass=mass)
    return replace(made.drive, info=info)


def _readme(settings: BenchmarkSettings, count: int) -> str:
    def listed(names: dict[str, Any], text: Callable[[Any], str]) -> str:
        return "\n".join(f"- `{name}`: {text(value)}" for name, value in names.items())

    return Template(text_of("benchmark", "readme.md")).substitute(
        drives=plural(count, "drive"),
        version=VERSION,
        seed=settings.seed,
        equipment=listed(EQUIPMENT, str),
        calibrations=listed(CALIBRATIONS, lambda n: f"{plural(n, 'drive')} of known mass"),
        classes=", ".join(CLASSES),
        routes=", ".join(ROUTES),
    )
