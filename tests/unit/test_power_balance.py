"""Battery power against shaft power: the scale of a motor's torque without a calibration."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import weighbridge as wb
from weighbridge import Drive, Signal, Vehicle, inspect_drive
from weighbridge.simulation import ELECTRIC, Sensors, make_scenario, simulate_car
from weighbridge.vehicle import (
    TORQUE_SOURCES,
    VEHICLE_CLASSES,
    Driveline,
    Provenance,
    RoadLoad,
    TorqueModel,
    by_power,
    find_power_balance,
    scale_std,
)

VOLTS = 370.0


def sheet(car=ELECTRIC):
    """The vehicle file of a data sheet."""
    mean, _ = VEHICLE_CLASSES["car"].road_prior(single_speed=True)
    return Vehicle(
        name="electric",
        tare=car.mass,
        driveline=Driveline(
            gearings=(car.gear_ratios[0] * car.final_drive / car.wheel_radius,),
            engine_inertia=float(mean[2]),
            wheel_inertia=float(mean[3]),
            wheel_radius=car.wheel_radius,
        ),
        torque=TorqueModel(source="measured"),
        road_load=RoadLoad(drag_area=car.drag_area, rolling_coefficient=float(mean[1])),
    )


@pytest.fixture(scope="module")
def made():
    scenario = replace(
        make_scenario("electric", seed=33), duration=1000.0, sensors=Sensors(imu_rate=50.0)
    )
    return simulate_car(scenario)


def electrified(made, *, reads=1.0, one_way=0.5, sign=1.0, power=1.0, seed=3):
    """A drive that records battery power, and a torque that reads ``reads`` of the motor's.

    Losses are 500 W and 0.5 W per rad/s, and more of the torque squared driving than
    recuperating; a heater takes 3 kW for minutes.
    """
    time = made.truth.time[::2]
    torque = made.truth.engine_torque[::2]
    speed = made.truth.engine_speed[::2]
    copper = np.where(torque >= 0.0, one_way, 1.0 - one_way) * 0.12 * torque**2
    heater = 3000.0 * (np.sin(2.0 * np.pi * time / 700.0) > 0.0)
    watts = torque * speed + 500.0 + 0.5 * speed + 0.015 * np.abs(torque * speed) + copper + heater
    noise = np.random.default_rng(seed).normal(0.0, 1.5, time.size)
    amps = sign * power * watts / VOLTS + noise
    read = made.drive.signals["engine_torque"]
    # The simulated control unit has a scale of its own.
    reads *= np.polyfit(read.values, np.interp(read.time, time, torque), 1)[0]
    return made.drive.with_signals(
        Signal("engine_torque", read.time, reads * read.values),
        Signal("battery_voltage", time, np.full(time.size, VOLTS)),
        Signal("battery_current", time, amps),
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_scale_and_losses_are_found_whatever_the_heater_takes(made, sign):
    found = find_power_balance(electrified(made, reads=1.1, sign=sign), sheet())
    assert found.scale == pytest.approx(1.1, abs=0.01)
    assert found.charging_positive == (sign < 0.0)
    assert found.possible
    # No surer than the meters of voltage and current.
    assert 0.015 < found.std < 0.03
    # Neither way gives more than it takes: the scale lies between the two.
    assert found.driving < 1.1 < 1.0 / found.recuperating


@pytest.mark.parametrize(
    ("late", "found"), [(-0.5, True), (0.7, True), (-4.0, False), (2.0, False), (8.0, False)]
)
def test_a_battery_on_another_clock_shows_nothing(made, late, found):
    """Some tenths of a second are lateness, and found; a farther clock makes no scale."""
    drive = electrified(made, reads=1.1)
    meters = [drive.signals[name] for name in ("battery_voltage", "battery_current")]
    drive = drive.with_signals(*(Signal(s.name, s.time + late, s.values) for s in meters))
    balance = find_power_balance(drive, sheet())
    if found:
        assert balance.scale == pytest.approx(1.1, abs=0.02)
    else:
        assert balance is None


def test_losses_that_differ_both_ways_stay_in_the_interval(made):
    for one_way in (0.2, 0.8):
        found = find_power_balance(electrified(made, reads=0.97, one_way=one_way), sheet())
        assert abs(found.scale - 0.97) < 2.0 * found.std


def test_a_torque_ten_percent_off_is_weighed_right(made):
    mass = made.scenario.mass
    blind = Drive("d", dict(electrified(made, reads=1.1).signals))
    for name in ("battery_voltage", "battery_current"):
        del blind.signals[name]
    without = wb.weigh(blind, sheet())
    told = wb.weigh(electrified(made, reads=1.1), sheet())
    assert without.mass > 1.06 * mass
    assert abs(told.mass / mass - 1.0) < 0.4 * abs(without.mass / mass - 1.0)
    low, high = told.interval(0.95)
    assert low < mass < high
    assert any(n.id == "battery.unusual" for n in told.problems)


def test_the_interval_narrows_and_the_torque_moves_within_it(made):
    car = sheet()
    narrowed, notes = by_power(electrified(made, reads=1.02), car)
    assert len(notes) == 1
    assert narrowed.torque.scale_std < 0.75 * TORQUE_SOURCES["measured"].motor_scale_std
    assert scale_std(narrowed) < scale_std(car)
    offset, slope = narrowed.torque.coefficients
    assert offset == 0.0
    assert 1.0 / 1.02 - 0.005 < slope < 1.0
    # Once told, it is not told again.
    assert by_power(electrified(made), narrowed) == (narrowed, ())


def test_a_current_of_something_else_is_not_believed(made):
    car = sheet()
    drive = electrified(made)
    other = drive.signals["battery_current"]
    shaft = drive.signals["engine_torque"].at(other.time)
    wild = drive.with_signals(replace(other, values=np.abs(np.nan_to_num(shaft))))
    same, notes = by_power(wild, car)
    assert same == car
    assert all(n.id == "battery.impossible" for n in notes)
    assert find_power_balance(made.drive, car) is None
    # Half the current: far from any data sheet, so the doubt is left in the interval.
    doubted, notes = by_power(electrified(made, power=0.5), car)
    assert notes[0].id == "battery.unusual"
    assert doubted.torque.scale_std > 10.0 * TORQUE_SOURCES["measured"].motor_scale_std


def test_what_was_calibrated_or_stated_is_left_alone(made):
    drive = electrified(made)
    for provenance in (
        Provenance(method="joint", masses=(1500.0,)),
        Provenance(mass_scale_std=0.1),
    ):
        car = replace(sheet(), provenance=provenance)
        assert by_power(drive, car) == (car, ())


def test_inspect_tells_it(made):
    drive = electrified(made, reads=0.99)
    found = inspect_drive(drive, sheet())
    assert any(p.id.startswith("battery.") and not p.serious for p in found.problems)
    assert not any(p.id.startswith("battery.") for p in inspect_drive(drive).problems)
    plain = inspect_drive(made.drive, sheet())
    assert not any(p.id.startswith("battery.") for p in plain.problems)


def test_one_second_and_polled_late_is_enough(made):
    drive = electrified(made, reads=1.05)
    slow = {
        name: Signal(name, s.time[:: max(1, round(1.0 / s.period))] + late,
                     s.values[:: max(1, round(1.0 / s.period))])
        for name, s in drive.signals.items()
        for late in ((0.4,) if name.startswith("battery") else (0.0,))
    }  # fmt: skip
    found = find_power_balance(replace(drive, signals=slow), sheet())
    assert found.scale == pytest.approx(1.05, abs=0.02)
    assert_allclose(found.std, 0.02, atol=0.012)
