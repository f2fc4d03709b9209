"""Drives and a vehicle file that the commands are tried on, made once."""

import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import polars as pl
import pytest

from weighbridge.cli import main
from weighbridge.simulation import Sensors, make_scenario, simulate_car


class Made(NamedTuple):
    """A simulated drive on disk."""

    folder: Path
    mass: float


def _made(
    folder: Path, name: str, seed: int, payload: float, duration: float | None, rate: float = 50.0
) -> Made:
    # A warm engine: a cold one needs more torque than a calibration knows of.
    scenario = make_scenario(name, payload=payload, seed=seed, without=("warm_up",))
    # Inertial samples as often as of a phone.
    sensors = Sensors(imu_rate=rate)
    made = simulate_car(replace(scenario, duration=duration, sensors=sensors))
    made.write(folder)
    return Made(folder, float(made.truth.mass.mean()))


@pytest.fixture(scope="session")
def known(tmp_path_factory) -> Made:
    """Return a calibration drive with its mass in drive.toml."""
    return _made(tmp_path_factory.mktemp("known") / "known", "car-calibration", 101, 0.0, 900.0)


@pytest.fixture(scope="session")
def loaded(tmp_path_factory) -> Made:
    """Return a drive of the same car with 150 kg more."""
    return _made(tmp_path_factory.mktemp("loaded") / "loaded", "car-short", 102, 150.0, None)


@pytest.fixture(scope="session")
def often(tmp_path_factory) -> Made:
    """Return the loaded drive with an inertial sensor of 200 Hz, which shows faults of its axes."""
    folder = tmp_path_factory.mktemp("often") / "loaded"
    return _made(folder, "car-short", 102, 150.0, None, rate=200.0)


@pytest.fixture(scope="session")
def car(known, tmp_path_factory) -> Path:
    """Return the vehicle file that the command ``calibrate`` makes of the known drive."""
    path = tmp_path_factory.mktemp("car") / "car.toml"
    words = ["calibrate", str(known.folder), "-o", str(path), "--tare", "1580"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["weighbridge", *words])
        with pytest.raises(SystemExit) as leaving:
            main.run()
    assert leaving.value.code in (0, None)
    return path


def _copies(drive: Path, tmp_path: Path) -> Callable[..., Path]:
    def copy(**tables: Callable[[pl.DataFrame], pl.DataFrame] | None) -> Path:
        folder = tmp_path / "changed"
        shutil.copytree(drive, folder)
        for table, change in tables.items():
            path = folder / f"{table}.parquet"
            frame = pl.read_parquet(path)
            path.unlink()
            if change is not None:
                change(frame).write_parquet(path)
        return folder

    return copy


@pytest.fixture
def changed(loaded, tmp_path) -> Callable[..., Path]:
    """Copy the loaded drive with some of its tables changed; None leaves a table out."""
    return _copies(loaded.folder, tmp_path)


@pytest.fixture
def changed_often(often, tmp_path) -> Callable[..., Path]:
    """Copy the drive with the quick inertial sensor likewise."""
    return _copies(often.folder, tmp_path)
