"""Faults of loggers: sources that take turns, packets stamped as they arrive, one row alone."""

from dataclasses import replace

import numpy as np
import pytest
from tests.noted import refused

import weighbridge as wb
from weighbridge.checks import check_drive, correct_drive
from weighbridge.messages import phrase
from weighbridge.signals import QUANTITIES
from weighbridge.simulation import MIDSIZE, Scenario, Sensors, jensen_route, simulate_car


@pytest.fixture(scope="module")
def made():
    scenario = Scenario(name="logger", car=MIDSIZE, route=jensen_route(1456), seed=9456)
    return simulate_car(replace(scenario, duration=900.0, sensors=Sensors(imu_rate=100.0)))


@pytest.fixture(scope="module")
def car(made):
    return wb.calibrate([made.drive], mass=made.scenario.mass)


def of_speed(drive, change):
    s = drive.signals["vehicle_speed"]
    return drive.with_signals(replace(s, values=change(s.time, s.values)))


def with_inertial(drive, change):
    """Change stamps of the inertial sensor, or leave rows out where they are NaN."""
    imu = [s for s in drive.signals.values() if QUANTITIES[s.name].table == "imu"]
    time = change(imu[0].time)
    there = np.isfinite(time)
    time = time[there]
    return drive.with_signals(*(replace(s, time=time, values=s.values[there]) for s in imu))


def test_a_speed_whose_rows_are_in_two_units_in_turn_is_refused(made, car):
    mixed = of_speed(made.drive, lambda t, v: np.where(np.arange(v.size) % 2, v / 1.609344, v))
    with refused("speed.jumps", signal="vehicle_speed", why=phrase("jump_turns")):
        wb.weigh(mixed, car)


def test_wheels_that_spin_now_and_then_are_no_two_sources(made):
    spinning = of_speed(
        made.drive, lambda t, v: np.where((t % 300.0 < 3.0) & (v > 9.0), 1.7 * v, v)
    )
    found = [p for p in check_drive(spinning) if p.id == "speed.jumps"]
    assert [p.serious for p in found] == [False]


def test_packets_stamped_as_they_arrive_are_refused_by_their_cause(made, car):
    """Fifty samples, half a second of them, within five milliseconds."""

    def arrive(time):
        row = np.arange(time.size)
        return time[np.minimum(row // 50 * 50 + 49, time.size - 1)] + 1e-4 * (row % 50)

    with refused("clock.packets"):
        wb.weigh(with_inertial(made.drive, arrive), car)


def test_a_sensor_recorded_in_turns_comes_in_no_packets(made):
    turns = with_inertial(made.drive, lambda t: np.where(t % 40.0 < 3.0, t, np.nan))
    assert not any(p.id == "clock.packets" for p in correct_drive(turns).problems)


def test_a_torque_polled_every_four_seconds_is_told_so(made, car):
    s = made.drive.signals["engine_load"]
    sparse = made.drive.with_signals(replace(s, time=s.time[::16], values=s.values[::16]))
    weighing = wb.weigh(sparse, car)
    assert weighing.status == "not_excited"
    assert weighing.reason_id == "motion.few_rows"
    assert phrase("slow_torque", period=4.0) in weighing.refusal.values["cause"]


def test_a_speed_of_one_row_breaks_nothing(made, car):
    s = made.drive.signals["vehicle_speed"]
    weighing = wb.weigh(
        made.drive.with_signals(replace(s, time=s.time[-1:], values=s.values[-1:])), car
    )
    assert any(warning.id == "file.begins_late" for warning in weighing.problems)
