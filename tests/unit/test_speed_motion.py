"""Motion from speed, with grade and height where they are, against closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from weighbridge.constants import GRAVITY
from weighbridge.errors import DriveError
from weighbridge.navigation.select import find_motion
from weighbridge.navigation.speed import speed_motion
from weighbridge.signals import Drive, Signal
from weighbridge.vehicle.model import Driveline, Vehicle

TIME = np.arange(0.0, 200.0, 0.25)
W = 2.0 * np.pi / 40.0
SPEED = 15.0 + 5.0 * np.sin(W * TIME)
ACCEL = 5.0 * W * np.cos(W * TIME)
DISTANCE = 15.0 * TIME + 5.0 / W * (1.0 - np.cos(W * TIME))


def made(**values):
    return Drive("d", {k: Signal(k, TIME, np.asarray(v, dtype=float)) for k, v in values.items()})


def inner(motion):
    return (motion.time > 10.0) & (motion.time < 190.0)


def test_acceleration_on_the_level():
    motion = speed_motion(made(vehicle_speed=SPEED))
    k = inner(motion)
    assert motion.source == "speed"
    assert_allclose(motion.speed[k], np.interp(motion.time, TIME, SPEED)[k], atol=0.02)
    assert_allclose(motion.accel[k], np.interp(motion.time, TIME, ACCEL)[k], atol=0.02)
    assert_allclose(motion.specific_force, motion.accel)
    assert_allclose(motion.distance[k], np.interp(motion.time, TIME, DISTANCE)[k], atol=5.0)
    assert motion.notes == ("no grade and no altitude: the road is taken as level",)


def test_grade_from_height_over_distance():
    slope = 0.05
    motion = speed_motion(made(vehicle_speed=SPEED, altitude=100.0 + slope * DISTANCE))
    k = inner(motion)
    assert motion.source == "speed_grade"
    assert_allclose(motion.grade[k], np.arctan(slope), atol=0.002)
    assert_allclose(
        motion.specific_force[k], motion.accel[k] + GRAVITY * np.sin(np.arctan(slope)), atol=0.02
    )


def test_a_measured_grade_comes_before_height():
    motion = speed_motion(
        made(vehicle_speed=SPEED, grade=np.full(TIME.size, -0.03), altitude=0.1 * DISTANCE)
    )
    assert_allclose(motion.grade, -0.03)


def test_gaps_are_not_valid():
    keep = (TIME < 80.0) | (TIME > 95.0)
    gap = Drive("d", {"vehicle_speed": Signal("vehicle_speed", TIME[keep], SPEED[keep])})
    motion = speed_motion(gap)
    assert not motion.valid[(motion.time > 82.0) & (motion.time < 93.0)].any()
    assert motion.valid[(motion.time < 79.0) | (motion.time > 96.0)].all()


def test_whole_kmh_once_a_second():
    time = np.arange(0.0, 300.0)
    true = 15.0 + 5.0 * np.sin(W * time)
    coarse = Signal("vehicle_speed", time, np.round(true * 3.6) / 3.6)
    motion = speed_motion(Drive("d", {"vehicle_speed": coarse}))
    k = (motion.time > 10.0) & (motion.time < 290.0)
    error = motion.accel - 5.0 * W * np.cos(W * motion.time)
    assert float(np.std(error[k])) < 0.12


@pytest.mark.parametrize("count", [0, 5, 30])
def test_too_little_speed(count):
    drive = Drive("d", {"vehicle_speed": Signal("vehicle_speed", TIME[:count], SPEED[:count])})
    with pytest.raises(DriveError, match="20"):
        speed_motion(drive)


def test_known_scale_of_the_speed_is_taken_off():
    vehicle = Vehicle(driveline=Driveline(speed_scale=1.05))
    motion = find_motion(made(vehicle_speed=1.05 * SPEED), vehicle)
    k = inner(motion)
    assert_allclose(motion.speed[k], np.interp(motion.time, TIME, SPEED)[k], atol=0.02)


def test_gnss_speed_has_no_scale():
    vehicle = Vehicle(driveline=Driveline(speed_scale=1.05))
    motion = find_motion(made(gnss_speed=SPEED), vehicle)
    k = inner(motion)
    assert_allclose(motion.speed[k], np.interp(motion.time, TIME, SPEED)[k], atol=0.02)


def test_nothing_moves_without_a_speed():
    with pytest.raises(DriveError, match="no vehicle_speed and no GNSS"):
        find_motion(made(engine_speed=SPEED))
