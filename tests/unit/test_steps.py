"""Steps of the torque's reading: another factor, unit or filter than in the calibration shows."""

from dataclasses import replace

import numpy as np
import pytest

from weighbridge.checks.steps import check_steps, reading_step
from weighbridge.signals import Signal
from weighbridge.simulation import make_scenario, simulate_car
from weighbridge.vehicle.model import TorqueModel, Vehicle

POUND_FOOT = 9.80665 * 0.45359237 * 0.3048


def driven(name, seed):
    return simulate_car(replace(make_scenario(name, seed=seed), duration=600.0)).drive


@pytest.fixture(scope="module")
def car():
    return driven("car", 41), Vehicle(
        torque=TorqueModel(source="load", coefficients=(-20.0, 300.0), reading_step=1.0 / 255.0)
    )


@pytest.fixture(scope="module")
def electric():
    drive = driven("electric", 42)
    step = reading_step(drive.signals["engine_torque"].values)
    return drive, Vehicle(torque=TorqueModel(source="measured", reading_step=step))


def with_values(drive, name, change):
    s = drive.signals[name]
    return drive.with_signals(Signal(name, s.time, change(s.values)))


def test_the_steps_of_a_control_unit_are_found(car, electric):
    drive, vehicle = car
    load = drive.signals["engine_load"].values
    assert reading_step(load) == pytest.approx(1.0 / 255.0, rel=1e-4)
    assert reading_step(load[:100]) == 0.0
    assert electric[1].torque.reading_step > 0.0
    for undamaged, of in (car, electric):
        assert not list(check_steps(undamaged, of))
    assert not list(check_steps(drive, Vehicle(torque=replace(vehicle.torque, reading_step=None))))


@pytest.mark.parametrize("factor", [0.8, 0.9, 0.97, 1.1, 1.5])
def test_a_factor_is_told(car, factor):
    drive, vehicle = car
    (found,) = check_steps(with_values(drive, "engine_load", lambda x: factor * x), vehicle)
    assert f"multiplied by {factor:.3g} after it was sent" in found.text
    assert not found.serious


@pytest.mark.parametrize("factor", [1.0 / POUND_FOOT, POUND_FOOT])
def test_pound_feet_are_refused(electric, factor):
    drive, vehicle = electric
    (found,) = check_steps(with_values(drive, "engine_torque", lambda x: factor * x), vehicle)
    assert found.serious
    assert "pound-feet" in found.text


def test_a_filter_or_a_gain_that_drifts_leaves_no_steps(car):
    drive, vehicle = car

    def ramp(x):
        return x * np.linspace(1.0, 0.8, x.size)

    def mean(x):
        return np.convolve(x, np.full(20, 0.05), "same")

    for change in (ramp, mean):
        (found,) = check_steps(with_values(drive, "engine_load", change), vehicle)
        assert "lies between them here" in found.text


@pytest.mark.parametrize("digit", [0.0001, 0.001, 0.01])
def test_a_logger_with_fewer_digits_is_no_fault(car, digit):
    drive, vehicle = car
    rounded = with_values(drive, "engine_load", lambda x: np.round(x / digit) * digit)
    assert not list(check_steps(rounded, vehicle))


def test_false_cells_hide_no_steps(car):
    drive, vehicle = car
    rng = np.random.default_rng(3)

    def struck(x):
        return np.where(rng.random(x.size) < 0.1, rng.random(x.size), x)

    assert not list(check_steps(with_values(drive, "engine_load", struck), vehicle))
