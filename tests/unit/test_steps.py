"""Steps of the torque's reading: another factor, unit or filter than in the calibration shows."""

from dataclasses import replace

import numpy as np
import pytest
from tests.noted import refused

from weighbridge import Signal, Vehicle, weigh
from weighbridge.checks import check_drive
from weighbridge.messages import phrase
from weighbridge.simulation import make_scenario, simulate_car
from weighbridge.vehicle import TorqueModel

POUND_FOOT = 9.80665 * 0.45359237 * 0.3048


def steps_told(drive, vehicle):
    found = check_drive(drive, vehicle)
    return [p for p in found if p.id in ("torque.steps", "torque.steps_filtered")]


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
    step = np.unique(np.diff(np.unique(drive.signals["engine_torque"].values)).round(9))[0]
    return drive, Vehicle(torque=TorqueModel(source="measured", reading_step=step))


def with_values(drive, name, change):
    s = drive.signals[name]
    return drive.with_signals(Signal(name, s.time, change(s.values)))


def test_the_steps_of_a_control_unit_are_found(car, electric, short_car):
    drive, vehicle = car
    assert short_car.torque.reading_step == pytest.approx(1.0 / 255.0, rel=1e-4)
    assert electric[1].torque.reading_step > 0.0
    for undamaged, of in (car, electric):
        assert not list(steps_told(undamaged, of))
    assert not list(steps_told(drive, Vehicle(torque=replace(vehicle.torque, reading_step=None))))


@pytest.mark.parametrize("factor", [0.8, 0.9, 0.96, 0.98, 1.02, 1.1, 1.5])
def test_a_factor_is_told_and_one_that_matters_gives_no_mass(car, factor):
    drive, vehicle = car
    (found,) = steps_told(with_values(drive, "engine_load", lambda x: factor * x), vehicle)
    assert found.id == "torque.steps"
    assert f"{found.values['ratio']:.3g}" == f"{factor:.3g}"
    assert found.serious == (abs(factor - 1.0) > 0.03)
    assert bool(found.values["settled"]) == found.serious


def test_a_person_clears_a_factor(car):
    drive, vehicle = car
    scaled = with_values(drive, "engine_load", lambda x: 0.8 * x)
    trusted = replace(scaled, info=replace(drive.info, trusted=("engine_load",)))
    (found,) = steps_told(trusted, vehicle)
    assert not found.serious


@pytest.mark.parametrize("factor", [0.8, 0.9, 1.1])
def test_a_factor_from_the_middle_on_is_told_with_its_time(car, factor):
    drive, vehicle = car
    middle = 0.5 * (drive.start + drive.end)
    load = drive.signals["engine_load"]
    late = load.time >= middle
    made = drive.with_signals(
        Signal("engine_load", load.time, np.where(late, factor, 1.0) * load.values)
    )
    (found,) = steps_told(made, vehicle)
    assert found.id == "torque.steps"
    assert found.values["ratio"] == pytest.approx(factor, rel=5e-3)
    assert found.serious
    assert found.start == pytest.approx(middle, abs=0.1 * drive.duration)
    assert found.end == pytest.approx(drive.end, abs=1.0)


def test_an_offset_or_a_filter_from_the_middle_on_is_told(car):
    drive, vehicle = car
    late = np.arange(len(drive.signals["engine_load"])) > 0.5 * len(drive.signals["engine_load"])
    (found,) = steps_told(with_values(drive, "engine_load", lambda x: x + 0.1313 * late), vehicle)
    assert found.id == "torque.steps_filtered"
    assert not found.serious


def test_one_part_off_the_steps_is_no_change(car):
    drive, vehicle = car
    size = len(drive.signals["engine_load"])
    early = np.arange(size) < size // 10
    assert not list(
        steps_told(with_values(drive, "engine_load", lambda x: x + 0.0017 * early), vehicle)
    )


def test_weigh_refuses_a_factor(car):
    drive, vehicle = car
    scaled = with_values(drive, "engine_load", lambda x: 0.8 * x)
    with refused("torque.steps"):
        weigh(scaled, vehicle)


@pytest.mark.parametrize("factor", [1.0 / POUND_FOOT, POUND_FOOT])
def test_pound_feet_are_refused(electric, factor):
    drive, vehicle = electric
    (found,) = steps_told(with_values(drive, "engine_torque", lambda x: factor * x), vehicle)
    assert found.serious
    assert found.values["unit"] in (phrase("as_pound_feet"), phrase("as_newton_metres"))


def test_a_filter_or_a_gain_that_drifts_leaves_no_steps(car):
    drive, vehicle = car

    def ramp(x):
        return x * np.linspace(1.0, 0.8, x.size)

    def mean(x):
        return np.convolve(x, np.full(20, 0.05), "same")

    for change in (ramp, mean):
        (found,) = steps_told(with_values(drive, "engine_load", change), vehicle)
        assert found.id == "torque.steps_filtered"


@pytest.mark.parametrize("digit", [0.0001, 0.001, 0.01])
def test_a_logger_with_fewer_digits_is_no_fault(car, digit):
    drive, vehicle = car
    rounded = with_values(drive, "engine_load", lambda x: np.round(x / digit) * digit)
    assert not list(steps_told(rounded, vehicle))


def test_false_cells_hide_no_steps(car):
    drive, vehicle = car
    rng = np.random.default_rng(3)

    def struck(x):
        return np.where(rng.random(x.size) < 0.1, rng.random(x.size), x)

    assert not list(steps_told(with_values(drive, "engine_load", struck), vehicle))
