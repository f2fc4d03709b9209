"""Short stretches and cruises of another simulator's drives: no wrong mass with confidence."""

import numpy as np
import polars as pl
import pytest

import weighbridge as wb
from weighbridge import WeighbridgeError

METHODS = ("joint", "rls", "robust-rls", "ekf", "hybrid")


@pytest.fixture(scope="module")
def wagon(foreign_simulator):
    return foreign_simulator / "wagon"


@pytest.fixture(scope="module")
def car(wagon):
    return wb.calibrate([wb.read_drive(wagon / "calibration-1")])


@pytest.fixture(scope="module")
def drive(wagon):
    return wb.read_drive(wagon / "drive-4")


@pytest.fixture(scope="module")
def steady(wagon):
    """Where the steadiest stretches of five minutes begin [s]."""
    truth = pl.read_parquet(wagon / "drive-4" / "truth.parquet")
    force = truth["accel_mps2"].to_numpy() + 9.81 * np.sin(truth["grade_rad"].to_numpy())
    speed, time = truth["speed_mps"].to_numpy(), truth["time_s"].to_numpy()
    starts = np.arange(0, time.size - 1200, 300)
    spread = [
        force[k : k + 1200].std() if speed[k : k + 1200].min() > 10.0 else np.inf for k in starts
    ]
    best = starts[np.argsort(spread)[:3]]
    return [float(time[k]) for k in best]


def by_all_methods(drive, car):
    """Weigh a drive once by each method; nothing where it is refused."""
    try:
        return {w.method: w for w in wb.weigh(drive, car).compare() if w.method in METHODS}
    except WeighbridgeError:
        return {}


def test_a_stretch_of_eighteen_seconds_carries_no_mass_and_one_of_forty_no_wrong_one(
    wagon, drive, car
):
    truth = pl.read_parquet(wagon / "drive-4" / "truth.parquet")
    for begin in (300.0, 700.0, 1100.0):
        found = by_all_methods(drive.between(begin, begin + 18.0), car)
        assert not any(w.status == "converged" for w in found.values())
        mass = np.interp(begin + 40.0, truth["time_s"], truth["mass_kg"])
        for weighing in by_all_methods(drive.between(begin, begin + 40.0), car).values():
            if weighing.status == "converged":
                low, high = weighing.interval(0.95)
                assert low < mass < high, weighing.method


def test_intervals_of_steady_stretches_hold_or_there_is_none(wagon, drive, car, steady):
    truth = pl.read_parquet(wagon / "drive-4" / "truth.parquet")
    for begin in steady:
        mass = np.interp(begin + 300.0, truth["time_s"], truth["mass_kg"])
        for weighing in by_all_methods(drive.between(begin, begin + 300.0), car).values():
            if weighing.status == "converged":
                low, high = weighing.interval(0.99)
                assert low < mass < high, weighing.method


def test_the_whole_drive_is_weighed(drive, car):
    found = by_all_methods(drive, car)
    assert set(found) == set(METHODS)
    for weighing in found.values():
        assert weighing.status == "converged"
        low, high = weighing.interval(0.99)
        assert low < 2155.4 < high, weighing.method
