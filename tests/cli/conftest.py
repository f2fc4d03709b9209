"""Drives and a vehicle file that the commands are tried on, made once."""

import contextlib
import os
import pty
import shutil
import sys
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import polars as pl
import pytest

from weighbridge import cli
from weighbridge.simulation import Sensors, make_scenario, simulate_car

TERMINAL = {"TERM": "xterm-256color", "COLUMNS": "90"}

SHORT = 480.0
"""Of the drives that are weighed again and again [s]."""


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
    return _made(tmp_path_factory.mktemp("loaded") / "loaded", "car-short", 102, 150.0, SHORT)


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
            cli.run()
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


def written_to(terminal, written):
    """Collect what is written to a terminal until its other end is closed."""
    with contextlib.suppress(OSError):
        while block := os.read(terminal, 65536):
            written.append(block)
    os.close(terminal)


@pytest.fixture
def on_a_terminal(weighbridge, monkeypatch):
    """Run a command on a terminal of its own; return its exit status and all it wrote."""

    def run(*words, **environment):
        ours, its = pty.openpty()
        written = []
        reader = threading.Thread(target=written_to, args=(ours, written))
        reader.start()
        with monkeypatch.context() as patch, open(its, "w", encoding="utf-8") as terminal:  # noqa: PTH123
            for name in ("NO_COLOR", "FORCE_COLOR"):
                patch.delenv(name, raising=False)
            for name, value in {**TERMINAL, **environment}.items():
                patch.setenv(name, value)
            for name in ("stdin", "stdout", "stderr"):
                patch.setattr(sys, name, terminal)
            patch.setattr(sys, "argv", ["weighbridge", *map(str, words)])
            with pytest.raises(SystemExit) as leaving:
                cli.run()
        reader.join(60.0)
        return leaving.value.code, b"".join(written).decode()

    return run
