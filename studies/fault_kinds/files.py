"""Faults of written files, read as a user's are, and wrong masses given to a calibration."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from fault_kinds.shaping import Fault

STAMPS = "stamps in files"
STAMPS_WORDS = (
    r"\bclocks?\b|time stamps?|1970|spread evenly|rows .*(left out|sorted)|samples? every"
)
CELLS = "cells in files"
CELLS_WORDS = r"values? of \w+ (is|are) (outside|infinite)|samples of \w+ jump|inertial samples are"
MASSES = "mass of a calibration"
MASSES_WORDS = (
    r"by the calibration, more|kg the torque of|has a drag area of|against its \d+ kg"
    r"|no engine does|from the masses given"
)

Rng = np.random.Generator
DATE = 1_614_936_600.0
"""2021-03-05 as seconds since 1970."""


def _edit(
    folder: Path, table: str, column: str, change: Callable[[list[str]], dict[int, str]]
) -> None:
    """Change cells of a column as text: ``change(cells)`` returns the new ones by their row."""
    path = folder / f"{table}.csv"
    head, *lines = path.read_text(encoding="utf-8").splitlines()
    at = head.split(",").index(column)
    cells = [line.split(",", at + 1)[at] for line in lines]
    for row, text in change(cells).items():
        whole = lines[row].split(",")
        whole[at] = text
        lines[row] = ",".join(whole)
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")


def _stamps(folder: Path, table: str, change: Callable[[np.ndarray], np.ndarray]) -> None:
    """Change the times of a table; whole numbers of them are written in full."""

    def rewrite(cells: list[str]) -> dict[int, str]:
        before = np.array(cells, dtype=float)
        after = change(before.copy())
        rows = np.flatnonzero(after != before)
        texts = map(repr, after[rows].tolist())
        return dict(zip(rows.tolist(), texts, strict=True))

    _edit(folder, table, "time_s", rewrite)


def _put(folder: Path, table: str, column: str, text: str, places: Sequence[float]) -> None:
    """Write a text into cells of a column, at parts of the table."""

    def rewrite(cells: list[str]) -> dict[int, str]:
        filled = [row for row, cell in enumerate(cells) if cell]
        return {filled[int(part * (len(filled) - 1))]: text for part in places}

    _edit(folder, table, column, rewrite)


def imu_clock_from_1970(folder: Path, severity: float, rng: Rng) -> None:
    """A part of the sensor's rows is stamped from 1970, the rest with the date [-]."""

    def jump(time: np.ndarray) -> np.ndarray:
        return np.where(np.arange(time.size) < severity * time.size, time, DATE + time)

    _stamps(folder, "imu", jump)


def all_clocks_from_1970(folder: Path, severity: float, rng: Rng) -> None:
    """The clock of all tables is set to the date at a part of the drive [-]."""
    for path in sorted(folder.glob("*.csv")):
        _stamps(
            folder,
            path.stem,
            lambda t: np.where(t < severity * 1500.0, t, DATE + t),
        )


def one_stamp(folder: Path, severity: float, rng: Rng) -> None:
    """One row in the middle of the sensor's table has this stamp [s]."""

    def spoil(time: np.ndarray) -> np.ndarray:
        time[time.size // 2] = severity
        return time

    _stamps(folder, "imu", spoil)


def last_bus_stamp(folder: Path, severity: float, rng: Rng) -> None:
    """The last row of the bus has this stamp [s]."""

    def spoil(time: np.ndarray) -> np.ndarray:
        time[-1] = severity
        return time

    _stamps(folder, "obd", spoil)


def first_fix_stamp(folder: Path, severity: float, rng: Rng) -> None:
    """The first fix has this stamp [s]."""

    def spoil(time: np.ndarray) -> np.ndarray:
        time[0] = severity
        return time

    _stamps(folder, "gnss", spoil)


def bus_stamps_rounded(folder: Path, severity: float, rng: Rng) -> None:
    """Stamps of the bus are cut off to steps of this [s]."""
    _stamps(folder, "obd", lambda t: np.floor(t / severity) * severity)


def imu_stamps_rounded(folder: Path, severity: float, rng: Rng) -> None:
    """Stamps of the sensor are cut off to steps of this [s]."""
    _stamps(folder, "imu", lambda t: np.floor(t / severity) * severity)


def stamps_shuffled(folder: Path, severity: float, rng: Rng) -> None:
    """A share of neighbouring stamps of the sensor is swapped [-]."""

    def swap(time: np.ndarray) -> np.ndarray:
        at = np.flatnonzero(rng.random(time.size - 1) < severity)
        time[at], time[at + 1] = time[at + 1].copy(), time[at].copy()
        return time

    _stamps(folder, "imu", swap)


def accel_cell(folder: Path, severity: float, rng: Rng) -> None:
    """One cell of the accelerometer holds this [m/s^2]."""
    _put(folder, "imu", "accel_x_mps2", repr(severity), (0.4,))


def two_accel_cells(folder: Path, severity: float, rng: Rng) -> None:
    """Two cells of the accelerometer hold this [m/s^2]."""
    _put(folder, "imu", "accel_x_mps2", repr(severity), (0.3, 0.7))


def gyro_cell(folder: Path, severity: float, rng: Rng) -> None:
    """One cell of the gyro holds this [rad/s]."""
    _put(folder, "imu", "gyro_y_radps", repr(severity), (0.6,))


def speed_cell(folder: Path, severity: float, rng: Rng) -> None:
    """One cell of the speed holds this [km/h]."""
    _put(folder, "obd", "vehicle_speed_kmh", repr(severity), (0.5,))


def engine_speed_cell(folder: Path, severity: float, rng: Rng) -> None:
    """One cell of the engine speed holds this [rpm]."""
    _put(folder, "obd", "engine_speed_rpm", repr(severity), (0.5,))


def altitude_cell(folder: Path, severity: float, rng: Rng) -> None:
    """One cell of the altitude holds this [m]."""
    _put(folder, "gnss", "altitude_m", repr(severity), (0.5,))


def latitude_cell(folder: Path, severity: float, rng: Rng) -> None:
    """One cell of the latitude holds this [deg]."""
    _put(folder, "gnss", "latitude_deg", repr(severity), (0.5,))


def calibration_mass_scale(masses: list[float], severity: float) -> list[float]:
    """All masses given to the calibration are multiplied by this [-]."""
    return [severity * mass for mass in masses]


def one_calibration_mass_scale(masses: list[float], severity: float) -> list[float]:
    """The mass of one of three drives is multiplied by this [-]."""
    return [masses[0], severity * masses[1], masses[2]]


TWO = ("car", "electric")
FAULTS = (
    Fault(STAMPS, imu_clock_from_1970, (0.001, 0.02, 0.4), STAMPS_WORDS, TWO, "files"),
    Fault(STAMPS, all_clocks_from_1970, (0.001, 0.02, 0.4), STAMPS_WORDS, TWO, "files"),
    Fault(STAMPS, one_stamp, (1e7, 1e12, 1e15, 1e300, -1e9), STAMPS_WORDS, TWO, "files"),
    Fault(STAMPS, last_bus_stamp, (1e5, 1e12), STAMPS_WORDS, TWO, "files"),
    Fault(STAMPS, first_fix_stamp, (-1e9, 1e12), STAMPS_WORDS, TWO, "files"),
    Fault(STAMPS, bus_stamps_rounded, (0.1, 0.5, 1.0), STAMPS_WORDS, stage="files"),
    Fault(STAMPS, imu_stamps_rounded, (0.1, 1.0), STAMPS_WORDS, TWO, "files"),
    Fault(STAMPS, stamps_shuffled, (0.001, 0.1), STAMPS_WORDS, TWO, "files"),
    Fault(CELLS, accel_cell, (1e4, 1e100, 1e300), CELLS_WORDS, TWO, "files"),
    Fault(CELLS, two_accel_cells, (1e6, 1e100), CELLS_WORDS, stage="files"),
    Fault(CELLS, gyro_cell, (1e3, 1e200), CELLS_WORDS, TWO, "files"),
    Fault(CELLS, speed_cell, (1e4, 1e300), CELLS_WORDS, TWO, "files"),
    Fault(CELLS, engine_speed_cell, (1e6, 1e155), CELLS_WORDS, TWO, "files"),
    Fault(CELLS, altitude_cell, (1e5, 1e300), CELLS_WORDS, TWO, "files"),
    Fault(CELLS, latitude_cell, (80.0, 1e308), CELLS_WORDS, TWO, "files"),
    Fault(
        MASSES, calibration_mass_scale, (0.4536, 0.8, 1.2, 2.2046), MASSES_WORDS,
        stage="calibration",
    ),
    Fault(
        MASSES, one_calibration_mass_scale, (0.8, 2.2046), MASSES_WORDS, stage="calibration",
    ),
)  # fmt: skip
