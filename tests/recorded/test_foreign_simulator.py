"""Half-hour drives of another simulator, with truth, and no brake switch: whole masses."""

import functools

import numpy as np
import polars as pl
import pytest
from numba import config

import weighbridge as wb
from weighbridge.pipeline.setup import identify

pytestmark = pytest.mark.skipif(
    bool(config.DISABLE_JIT), reason="whole drives take minutes without the compiler"
)

VEHICLES = ("hatchback", "wagon")
THREE = ("calibration-1", "calibration-2", "calibration-3")
DRIVES = ("drive-1", "drive-2", "drive-3", "drive-4")


def truth(foreign_simulator, vehicle, name):
    return pl.read_parquet(foreign_simulator / vehicle / name / "truth.parquet")


@pytest.fixture(scope="module")
def calibrated(foreign_simulator):
    @functools.cache
    def make(vehicle, names):
        return wb.calibrate([wb.read_drive(foreign_simulator / vehicle / n) for n in names])

    return make


@pytest.mark.parametrize(
    ("names", "most"),
    [(THREE, 0.95), (("calibration-1",), 1.1), (("brisk-calibration",), 1.1)],
    ids=["three", "one", "brisk"],
)
def test_masses_of_vehicles_of_another_simulator(foreign_simulator, calibrated, names, most):
    errors, scaled = [], []
    for vehicle in VEHICLES:
        for name in DRIVES:
            found = wb.weigh(
                wb.read_drive(foreign_simulator / vehicle / name), calibrated(vehicle, names)
            )
            mass = truth(foreign_simulator, vehicle, name)["mass_kg"][-1]
            errors.append(100.0 * (found.mass / mass - 1.0))
            scaled.append((found.mass - mass) / found.std)
    assert np.sqrt(np.mean(np.square(errors))) < most
    assert np.max(np.abs(scaled)) < 1.96


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_differences_of_load_are_what_they_are(foreign_simulator, calibrated, vehicle):
    found, true = [], []
    for name in DRIVES:
        weighing = wb.weigh(
            wb.read_drive(foreign_simulator / vehicle / name), calibrated(vehicle, THREE)
        )
        found.append(weighing.mass)
        true.append(truth(foreign_simulator, vehicle, name)["mass_kg"][-1])
    assert np.polyfit(true, found, 1)[0] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_next_to_no_row_that_weighs_is_braked(foreign_simulator, calibrated, vehicle):
    drive = wb.read_drive(foreign_simulator / vehicle / "drive-3")
    balance = identify(drive, calibrated(vehicle, THREE[:1])).balance
    known = truth(foreign_simulator, vehicle, "drive-3")
    table = balance.table
    brake = np.interp(table.time, known["time_s"], known["brake_n"])
    assert np.mean(brake[table.speed > 1.5] > 5.0) > 0.05
    assert np.mean(brake[table.usable] > 5.0) < 0.01
