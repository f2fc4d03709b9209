"""Weigh the drives of a benchmark with a method of this program."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import polars as pl

from weighbridge.arguments import suggestion
from weighbridge.benchmark.make import DRIVE_COLUMNS, DRIVES, SHEET, read_csv
from weighbridge.calibration.run import calibrate
from weighbridge.calibration.settings import CalibrationSettings
from weighbridge.errors import ConfigError, WeighbridgeError
from weighbridge.estimators import ESTIMATORS
from weighbridge.io import read_drive
from weighbridge.pipeline.weighing import weigh
from weighbridge.vehicle.model import Vehicle

if TYPE_CHECKING:
    from weighbridge.results.weighing import MassResult

RESULT_COLUMNS = {
    "drive": pl.String(),
    "mass_kg": pl.Float64(),
    "std_kg": pl.Float64(),
    "low_kg": pl.Float64(),
    "high_kg": pl.Float64(),
    "reason": pl.String(),
}
"""Columns of a file of results; the first two are needed, and an empty mass is a refusal."""


def read_drives(folder: Path) -> pl.DataFrame:
    """Read the list of drives to weigh.

    Raises
    ------
    ConfigError
        The folder is no benchmark, or its list is damaged.
    """
    path = folder / DRIVES
    if not path.is_file():
        raise ConfigError(
            f"{folder}: is no benchmark, {DRIVES} is missing; make one with weighbridge benchmark "
            "make"
        )
    return read_csv(path, DRIVE_COLUMNS)


def run_benchmark(folder: Path, methods: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Weigh every drive with each method, on a vehicle calibrated for it.

    Parameters
    ----------
    folder : of the benchmark; its truth is not read
    methods : names of `weighbridge.estimators.ESTIMATORS`

    Yields
    ------
    dict
        `RESULT_COLUMNS` and ``method`` of one drive; no mass, but a reason, where it is refused or
        cannot be weighed.

    Raises
    ------
    ConfigError
        A method is not known, or the folder is no benchmark.
    """
    for method in methods:
        if method not in ESTIMATORS:
            raise ConfigError(f"unknown method {method!r}{suggestion(method, ESTIMATORS)}")
    for (name,), drives in read_drives(folder).group_by("vehicle", maintain_order=True):
        cars: dict[str, Vehicle | WeighbridgeError] = {}
        for drive in drives["drive"]:
            for method in methods:
                fit = ESTIMATORS[method].fits[0]
                if fit not in cars:
                    cars[fit] = _calibrated(folder / str(name), fit)
                yield {"method": method} | _weighed(folder, drive, cars[fit], method)


def _calibrated(folder: Path, fit: str) -> Vehicle | WeighbridgeError:
    """Calibrate a vehicle with its drives of known mass; its data sheet where it has none."""
    try:
        known = [read_drive(path) for path in sorted(folder.glob("calibration-*"))]
        if not known:
            return Vehicle.load(folder / SHEET)
        settings = CalibrationSettings(method=fit)
        return calibrate(known, vehicle=folder / SHEET, settings=settings)
    except WeighbridgeError as error:
        return error


def _weighed(
    folder: Path, drive: str, car: Vehicle | WeighbridgeError, method: str
) -> dict[str, Any]:
    empty = dict.fromkeys(RESULT_COLUMNS) | {"drive": drive}
    try:
        if isinstance(car, WeighbridgeError):
            raise car
        found: MassResult = weigh(read_drive(folder / drive), car, method)
    except WeighbridgeError as error:
        return empty | {"reason": str(error)}
    if found.reason_id is not None:
        return empty | {"reason": found.reason}
    low, high = found.interval()
    numbers = {"mass_kg": found.mass, "std_kg": found.std, "low_kg": low, "high_kg": high}
    return empty | {name: round(value, 2) for name, value in numbers.items()}
