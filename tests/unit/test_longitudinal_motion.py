"""Motion from one accelerometer along the vehicle, against closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.noted import refused

from weighbridge import Drive, DriveError, Signal
from weighbridge.constants import GRAVITY
from weighbridge.navigation import find_motion

TIME = np.arange(0.0, 600.0, 0.1)
W = 2.0 * np.pi / 25.0
# Hills slower than the accelerations: how the two are told apart.
GRADE = 0.03 * np.sin(2.0 * np.pi * TIME / 150.0)


def speed(time):
    return 15.0 + 5.0 * np.sin(W * time)


ACCEL = 5.0 * W * np.cos(W * TIME)
FORCE = ACCEL + GRAVITY * np.sin(GRADE)
HEIGHT = np.cumsum(speed(TIME) * np.sin(GRADE)) * 0.1


def made(offset=0.0, late=0.0, height=True):
    signals = {
        "longitudinal_accel": FORCE + offset,
        "vehicle_speed": speed(TIME - late),
    }
    if height:
        signals["altitude"] = 50.0 + HEIGHT
    return Drive("d", {k: Signal(k, TIME, v) for k, v in signals.items()})


def inner(motion):
    return (motion.time > 30.0) & (motion.time < 570.0)


@pytest.mark.parametrize("height", [True, False])
@pytest.mark.parametrize("offset", [0.0, 0.4, -0.3])
def test_offset_is_found_from_the_energy(offset, height):
    motion = find_motion(made(offset=offset, height=height))
    k = inner(motion)
    assert motion.source == "longitudinal_accel"
    assert_allclose(motion.specific_force[k], np.interp(motion.time, TIME, FORCE)[k], atol=0.06)
    assert np.mean(motion.specific_force[k] - np.interp(motion.time, TIME, FORCE)[k]) == (
        pytest.approx(0.0, abs=0.02)
    )
    assert any(note.id == "motion.no_altitude" for note in motion.notes) is not height


def test_grade_and_acceleration_are_told_apart():
    motion = find_motion(made(offset=0.2))
    k = inner(motion)
    assert_allclose(motion.grade[k], np.interp(motion.time, TIME, GRADE)[k], atol=0.004)
    assert_allclose(motion.accel[k], np.interp(motion.time, TIME, ACCEL)[k], atol=0.08)


@pytest.mark.parametrize("late", [0.0, 0.35])
def test_lateness_of_the_speed(late):
    motion = find_motion(made(late=late))
    assert motion.speed_delay == pytest.approx(late, abs=0.03)
    k = inner(motion)
    assert_allclose(motion.speed[k], speed(motion.time)[k], atol=0.1)


def test_gaps_are_not_valid():
    drive = made()
    keep = (TIME < 200.0) | (TIME > 230.0)
    s = drive.signals["longitudinal_accel"]
    motion = find_motion(drive.with_signals(Signal(s.name, TIME[keep], s.values[keep])))
    assert not motion.valid[(motion.time > 202.0) & (motion.time < 228.0)].any()
    assert motion.valid[motion.time < 198.0].all()


def test_what_is_missing_or_short_is_told():
    drive = made()
    with pytest.raises(DriveError, match="vehicle_speed"):
        find_motion(drive.without("vehicle_speed"))
    with refused("motion.overlap"):
        find_motion(drive.between(0.0, 15.0))


def test_it_is_preferred_to_speed_alone():
    assert find_motion(made()).source == "longitudinal_accel"
    assert find_motion(made().without("longitudinal_accel")).source == "speed_grade"
