"""A derivative of the speed is no accelerometer, by its name and by what it shows."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from weighbridge import Drive, DriveInfo, Signal
from weighbridge.checks import correct_drive
from weighbridge.io import draft_table

NAME = "longitudinal_accel"
TIME = np.arange(0.0, 1200.0, 0.1)
SPEED = 15.0 + 9.0 * np.sin(TIME / 23.0) + 3.0 * np.sin(TIME / 7.0)
ACCEL = np.gradient(SPEED, TIME)


def made(accel, *, speed=SPEED, name="vehicle_speed", trusted=()):
    signals = {name: Signal(name, TIME, speed), NAME: Signal(NAME, TIME, accel)}
    return Drive("made", signals, DriveInfo(trusted=trusted))


def smoothed(values, count):
    return np.convolve(values, np.ones(count) / count, mode="same")


@pytest.mark.parametrize("name", ["vehicle_speed", "gnss_speed"])
@pytest.mark.parametrize(
    "accel", [ACCEL, np.diff(SPEED, prepend=SPEED[0]) / 0.1, smoothed(ACCEL, 15)]
)
def test_a_derivative_is_left_out(name, accel):
    found = correct_drive(made(accel, name=name))
    assert not found.has(NAME)
    assert [p.id for p in found.problems if p.signal == NAME] == ["imu.derived"]


def test_a_derivative_of_whole_kilometres_per_hour_is_left_out():
    shown = np.round(3.6 * SPEED) / 3.6
    assert not correct_drive(made(ACCEL, speed=shown)).has(NAME)


@pytest.mark.parametrize(
    "accel",
    [
        ACCEL + 9.81 * 0.003 * np.sin(TIME / 90.0),  # hills of 0.3 %
        ACCEL + 0.02,  # leans by 0.1 degrees
        0.98 * ACCEL + 9.81 * 0.01 * np.sin(TIME / 200.0),
    ],
)
def test_what_feels_gravity_stays(accel):
    drive = made(accel + 0.05 * np.random.default_rng(1).normal(size=TIME.size))
    assert np.array_equal(correct_drive(drive).signals[NAME].values, drive.signals[NAME].values)


def test_what_a_person_vouches_for_stays():
    drive = made(ACCEL)
    assert correct_drive(replace(drive, info=DriveInfo(trusted=(NAME,)))).has(NAME)


@pytest.mark.parametrize(
    "name", ["Longitudinal acceleration (G) *calc", "long accel calculated (m/s^2)"]
)
def test_a_name_tells_that_it_was_calculated(tmp_path, name):
    table = {"Time (s)": TIME, "Speed (km/h)": 3.6 * SPEED, "RPM": 900 + 50 * SPEED, name: ACCEL}
    pl.DataFrame(table).write_csv(tmp_path / "t.csv")
    found = draft_table(tmp_path / "t.csv")
    assert NAME not in {c.quantity for c in found.known}
    assert any("calculated" in doubt for doubt in found.all_questions)
