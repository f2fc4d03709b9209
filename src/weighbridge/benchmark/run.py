"""Weigh the drives of a benchmark with a method of this program."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import polars as pl

from weighbridge.arguments import suggestion
from weighbridge.benchmark.make import DRIVE_COLUMNS, DRIVES, SHEET, read_csv
from weighbridge.calibration import CalibrationSettings, calibrate
from weighbridge.errors import ConfigError, WeighbridgeError
from weighbridge.estimators import ESTIMATORS, Status
from weighbridge.io import read_drive
from weighbridge.pipeline.weighing import compare, weigh
from weighbridge.vehicle import Vehicle

if TYPE_CHECKING:
    from weighbridge.results.weighing import MassResult

RESULT_COLUMNS: Final = {
    "drive": pl.String(),
    "mass_kg": pl.Float64(),
    "std_kg": pl.Float64(),
    "low_kg": pl.Float64(),
    "high_kg": pl.Float64(),
    "reason": pl.String(),
}
"""Columns of a file of results; the first two are needed, and an empty mass is a refusal."""

_BY_JOINT: Final = ("method.contradicted", "method.joint_refuses")
"""Refusals of a mass because the joint estimator finds another, or none."""


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

    A mass is the method's own: what `weigh` refuses because ``joint`` finds another mass is kept.

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
    by_fit: dict[str, list[str]] = {}
    for method in methods:
        if method not in ESTIMATORS:
            raise ConfigError(f"unknown method {method!r}{suggestion(method, ESTIMATORS)}")
        by_fit.setdefault(ESTIMATORS[method].fits[0], []).append(method)
    for (name,), drives in read_drives(folder).group_by("vehicle", maintain_order=True):
        for fit, group in by_fit.items():
            car = _calibrated(folder / str(name), fit)
            for drive in drives["drive"]:
                for method, found in _weighed(folder / drive, car, group).items():
                    yield {"method": method} | _row(drive, found)


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
    drive: Path, car: Vehicle | WeighbridgeError, methods: Sequence[str]
) -> Mapping[str, MassResult | WeighbridgeError]:
    """Weigh a drive with methods that take the same vehicle."""
    try:
        if isinstance(car, WeighbridgeError):
            raise car
        first = weigh(read_drive(drive), car, methods[0])
        return {found.method: found for found in compare(first, methods)}
    except WeighbridgeError as error:
        return dict.fromkeys(methods, error)


def _row(drive: str, found: MassResult | WeighbridgeError) -> dict[str, Any]:
    empty = dict.fromkeys(RESULT_COLUMNS) | {"drive": drive}
    if isinstance(found, WeighbridgeError):
        return empty | {"reason": str(found)}
    if found.reason_id in _BY_JOINT:
        found = replace(found, status=Status.CONVERGED, refusal=None)
    if found.reason_id is not None:
        return empty | {"reason": found.reason}
    low, high = found.interval()
    numbers = {"mass_kg": found.mass, "std_kg": found.std, "low_kg": low, "high_kg": high}
    return empty | {name: round(value, 2) for name, value in numbers.items()}
