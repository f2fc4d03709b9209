"""Fleets of tiny drives: real ones, that are read, checked and weighed within milliseconds."""

import shutil
from dataclasses import replace
from pathlib import Path

import polars as pl

from weighbridge.io import write_drive
from weighbridge.vehicle import Known, describe

# What differs between two runs of the same drive.
RUN = ("weighed_at",)


def tiny_fleet(home: Path, count: int, vehicles: int = 3) -> tuple[Path, Path]:
    """Write drives of a few samples, and a file per vehicle; return both folders."""
    cars, drives = home / "vehicles", home / "drives"
    cars.mkdir(parents=True)
    for k in range(vehicles):
        described = describe(Known(name=f"van {k}", kind="van", tare=2000.0, torque="percent"))
        described.vehicle.save(cars / f"van{k}.toml")
    for k in range(count):
        tiny_drive(drives / f"van{k % vehicles}" / f"trip-{k:04d}", k)
    return drives, cars


def tiny_drive(folder: Path, number: int) -> Path:
    """Write one drive whose content no other number has."""
    folder.mkdir(parents=True)
    rows = "".join(f"{t},{10 + number % 50 + t}\n" for t in range(5))
    (folder / "obd.csv").write_text("time_s,vehicle_speed_kmh\n" + rows)
    begin = f"2026-05-{1 + number % 5:02d}T06:{number % 60:02d}:00Z"
    (folder / "drive.toml").write_text(f'start_time = "{begin}"\nnotes = "{number}"\n')
    return folder


def real_fleet(home: Path, drive, car, count: int) -> tuple[Path, Path]:
    """Write parts of a drive, each a drive of its own, and its vehicle."""
    cars, drives = home / "vehicles", home / "drives"
    cars.mkdir(parents=True)
    car.save(cars / "car.toml")
    for k in range(count):
        part = drive.between(drive.start + 20.0 * k, drive.end)
        info = replace(part.info, start_time=f"2026-05-0{1 + k % 5}T06:00:00+00:00")
        write_drive(replace(part, info=info), drives / "car" / f"trip-{k}", "parquet")
    return drives, cars


def compared(frame: pl.DataFrame) -> pl.DataFrame:
    """Rows in an order that no run changes, without what one does."""
    return frame.drop(RUN).sort("source", "part")


def copy_of(folder: Path, other: Path) -> Path:
    """Copy a folder."""
    return Path(shutil.copytree(folder, other))
