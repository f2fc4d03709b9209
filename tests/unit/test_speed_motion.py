"""Motion from speed, with grade and height where they are, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.noted import refused

import weighbridge as wb
from weighbridge import Drive, Signal, Vehicle
from weighbridge.balance import force_balance
from weighbridge.constants import GRAVITY
from weighbridge.estimators.judging import Evidence
from weighbridge.messages import phrase
from weighbridge.navigation import find_motion
from weighbridge.signals import QUANTITIES
from weighbridge.vehicle import Driveline

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
    motion = find_motion(made(vehicle_speed=SPEED))
    k = inner(motion)
    assert motion.source == "speed"
    assert_allclose(motion.speed[k], np.interp(motion.time, TIME, SPEED)[k], atol=0.02)
    assert_allclose(motion.accel[k], np.interp(motion.time, TIME, ACCEL)[k], atol=0.02)
    assert_allclose(motion.specific_force, motion.accel)
    assert_allclose(motion.distance[k], np.interp(motion.time, TIME, DISTANCE)[k], atol=5.0)
    assert [note.id for note in motion.notes] == ["motion.level"]


def test_grade_from_height_over_distance():
    slope = 0.05
    motion = find_motion(made(vehicle_speed=SPEED, altitude=100.0 + slope * DISTANCE))
    k = inner(motion)
    assert motion.source == "speed_grade"
    assert_allclose(motion.grade[k], np.arctan(slope), atol=0.002)
    assert_allclose(
        motion.specific_force[k], motion.accel[k] + GRAVITY * np.sin(np.arctan(slope)), atol=0.02
    )


def test_a_measured_grade_comes_before_height():
    motion = find_motion(
        made(vehicle_speed=SPEED, grade=np.full(TIME.size, -0.03), altitude=0.1 * DISTANCE)
    )
    assert_allclose(motion.grade, -0.03)


def test_gaps_are_not_valid():
    keep = (TIME < 80.0) | (TIME > 95.0)
    gap = Drive("d", {"vehicle_speed": Signal("vehicle_speed", TIME[keep], SPEED[keep])})
    motion = find_motion(gap)
    assert not motion.valid[(motion.time > 82.0) & (motion.time < 93.0)].any()
    assert motion.valid[(motion.time < 79.0) | (motion.time > 96.0)].all()


def test_whole_kmh_once_a_second():
    time = np.arange(0.0, 300.0)
    true = 15.0 + 5.0 * np.sin(W * time)
    coarse = Signal("vehicle_speed", time, np.round(true * 3.6) / 3.6)
    motion = find_motion(Drive("d", {"vehicle_speed": coarse}))
    k = (motion.time > 10.0) & (motion.time < 290.0)
    error = motion.accel - 5.0 * W * np.cos(W * motion.time)
    assert float(np.std(error[k])) < 0.12


@pytest.mark.parametrize("count", [0, 5, 30])
def test_too_little_speed(count):
    drive = Drive("d", {"vehicle_speed": Signal("vehicle_speed", TIME[:count], SPEED[:count])})
    with refused("speed.few", "speed.short"):
        find_motion(drive)


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
    with refused("speed.missing"):
        find_motion(made(engine_speed=SPEED))


def thinned(drive, period, *, gnss):
    """The drive as a dongle without an accelerometer has it: slow, in whole km/h."""
    kept = {}
    for name, s in drive.signals.items():
        table = QUANTITIES[name].table
        if table == "imu" or (table == "gnss" and not gnss):
            continue
        if table == "obd":
            k = np.unique(np.searchsorted(s.time, np.arange(s.time[0], s.time[-1], period)))
            values = s.values[k]
            if name == "vehicle_speed":
                values = np.round(3.6 * values) / 3.6
            s = Signal(name, s.time[k], values)
        kept[name] = s
    return replace(drive, signals=kept)


@pytest.mark.parametrize("method", ["joint", "rls"])
@pytest.mark.parametrize("gnss", [True, False])
def test_a_refusal_names_the_slow_speed_that_is_its_cause(short_drive, short_car, method, gnss):
    weighed = wb.weigh(thinned(short_drive.drive, 3.0, gnss=gnss), short_car, method)
    assert weighed.status is wb.Status.NOT_EXCITED
    cause = weighed.refusal.values["cause"]
    assert "0.33 " in cause
    assert phrase("in_steps", step=1.0) in cause
    assert weighed.reason_id in (
        "motion.slow_speed",
        "motion.few_rows",
        "motion.short",
        "motion.wide",
    )


def test_a_slow_cruise_lacks_starts_and_hills(short_drive, short_car):
    slow = thinned(short_drive.drive, 1.0, gnss=True)
    speed = slow.signals["vehicle_speed"]
    # A cruise at 90 km/h that a driver holds within 1 km/h.
    cruise = Signal(speed.name, speed.time, 25.0 + np.round(np.sin(speed.time / 20.0)) / 3.6)
    motion = find_motion(slow.with_signals(cruise).without("altitude"))
    evidence = Evidence(
        table=force_balance(slow, short_car, motion).table,
        used=np.ones(1, dtype=bool), phi=np.ones(1), mass=1.0, std=1.0, blocks=1, motion=motion,
    )  # fmt: skip
    assert motion.recorded_speed.slow_text
    assert evidence.slow_speed == ""


def test_a_fast_speed_is_no_cause():
    assert find_motion(made(vehicle_speed=SPEED)).recorded_speed.slow_text == ""
