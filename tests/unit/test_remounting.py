"""A sensor that was moved since the calibration, an axis with a gap of its own, wind in both."""

from dataclasses import replace

import numpy as np
import pytest

from weighbridge import Signal, Vehicle
from weighbridge.balance import force_balance
from weighbridge.balance.law import drag_force
from weighbridge.calibration import build_rows
from weighbridge.navigation import find_motion
from weighbridge.simulation import make_scenario, simulate_car
from weighbridge.vehicle import Driveline, Mounting, TorqueModel


@pytest.fixture(scope="module")
def made():
    return simulate_car(replace(make_scenario("car-short", seed=71), duration=400.0))


@pytest.mark.parametrize("degrees", [90.0, 180.0])
def test_a_moved_sensor_is_found_anew(made, degrees):
    drive = made.drive
    plain = find_motion(drive)
    known = Mounting(
        roll=plain.mounting[0],
        pitch=plain.mounting[1],
        yaw=plain.mounting[2],
        std=(0.01, 0.001, 0.001),
    )
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turned = []
    for kind in ("accel", "gyro"):
        x, y = drive.signals[f"{kind}_x"], drive.signals[f"{kind}_y"]
        turned.append(Signal(f"{kind}_x", x.time, c * x.values - s * y.values))
        turned.append(Signal(f"{kind}_y", x.time, s * x.values + c * y.values))
    motion = find_motion(drive.with_signals(*turned), Vehicle(mounting=known))
    assert any(note.id == "imu.mounting_moved" for note in motion.notes)
    error = np.interp(motion.time, plain.time, plain.specific_force) - motion.specific_force
    assert np.sqrt(np.mean(error[plain.speed[: error.size] > 2.0] ** 2)) < 0.05


def test_an_axis_with_a_gap_is_not_invented(made):
    drive = made.drive
    x = drive.signals["accel_x"]
    hole = (x.time > 100.0) & (x.time < 160.0)
    holed = drive.with_signals(Signal("accel_x", x.time[~hole], x.values[~hole]))
    other = drive.with_signals(
        *(
            Signal(name, drive.signals[name].time[~hole], drive.signals[name].values[~hole])
            for name in ("accel_y",)
        )
    )
    for changed in (holed, other):
        motion = find_motion(changed)
        inside = (motion.time > 102.0) & (motion.time < 158.0)
        assert not motion.valid[inside].any()


def test_known_speed_scale_is_taken_off_where_gnss_gives_speed_alone(made):
    drive = made.drive.without("latitude", "longitude", "altitude")
    car = Vehicle(driveline=Driveline(speed_scale=1.1))
    fast = find_motion(drive)
    true = find_motion(drive, car)
    moving = fast.speed > 5.0
    assert np.median(fast.speed[moving] / true.speed[moving]) == pytest.approx(1.1, abs=0.01)


def test_calibration_sees_the_reported_wind(made):
    drive = made.drive
    motion = find_motion(drive)
    car = Vehicle(
        driveline=Driveline(gearings=made.scenario.car.gearings),
        torque=TorqueModel(source="load", coefficients=(0.0, 900.0)),
    )
    columns = []
    for speed in (0.0, 10.0):
        told = replace(drive, info=replace(drive.info, wind_speed=speed, wind_from=3.0))
        balance = force_balance(told, car, motion)
        rows = balance.table.usable & np.isfinite(balance.table.engine_speed)
        made_rows = build_rows(
            balance.table,
            drive.signals["engine_load"].values,
            balance.table.engine_speed,
            mass=1580.0,
            wheel_radius=0.319,
            order=1,
            curved=False,
            rows=rows,
        )
        columns.append(made_rows.design[:, -4])
        drag = drag_force(balance.table, car)[rows] / balance.table.gearing[rows]
        assert made_rows.design[:, -4] * car.road.drag_area.value == pytest.approx(-drag)
    calm, windy = columns
    assert abs(calm.mean() - windy.mean()) > 0.05 * abs(calm.mean())
