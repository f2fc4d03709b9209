"""Heights on another clock than speed and torque, without an inertial sensor."""

import re
from dataclasses import replace

import numpy as np
import pytest

from weighbridge import Drive, Signal
from weighbridge.constants import GRAVITY
from weighbridge.navigation import find_motion

TIME = np.arange(0.0, 1500.0, 0.25)
W = 2.0 * np.pi / 90.0
SPEED = 20.0 + 4.0 * np.sin(W * TIME)
ACCEL = 4.0 * W * np.cos(W * TIME)
DISTANCE = np.cumsum(SPEED) * 0.25


def slope(steep):
    return steep * np.sin(2.0 * np.pi * DISTANCE / 1700.0)


def driven(late=0.0, *, steep=0.04, name="altitude", torque_late=0.0, noise=1.0, rate=4.0):
    """Drive over hills whose heights, or grade, come late, and so may the torque."""
    rng = np.random.default_rng(5)
    grade = slope(steep)
    force = 1500.0 * (ACCEL + GRAVITY * np.sin(np.arctan(grade))) + 0.4 * SPEED**2 + 200.0
    torque = force * 0.3 / 3.5 + rng.normal(0.0, noise * 8.0, TIME.size)
    height = np.cumsum(grade * SPEED) * 0.25 + rng.normal(0.0, 0.4, TIME.size)
    hills = height if name == "altitude" else np.arctan(grade)
    every = slice(None, None, round(4.0 / rate))
    return Drive("d", {
        "vehicle_speed": Signal("vehicle_speed", TIME[every], SPEED[every]),
        "engine_speed": Signal("engine_speed", TIME[every], (SPEED * 3.5 / 0.3)[every]),
        "engine_torque": Signal("engine_torque", TIME[every] + torque_late, torque[every]),
        name: Signal(name, TIME[::4] + late, hills[::4]),
    })  # fmt: skip


def of_height(motion):
    return [note for note in motion.notes if note.id == "altitude.late"]


@pytest.mark.parametrize("rate", [4.0, 1.0])
@pytest.mark.parametrize("late", [-5.0, 2.5, 6.0, 17.0])
def test_late_heights_are_moved_to_their_hills(late, rate):
    motion = find_motion(driven(late, rate=rate))
    (note,) = of_height(motion)
    size, side = re.search(r"altitude shows hills ([.0-9]+) s (\w+)", note.text).groups()
    assert float(size) == pytest.approx(abs(late), abs=0.6)
    assert side == ("later" if late > 0.0 else "earlier")
    inner = (motion.time > 30.0) & (motion.time < 1450.0)
    true = np.interp(motion.time, TIME, np.arctan(slope(0.04)))
    assert np.sqrt(np.mean((motion.grade - true)[inner] ** 2)) < 0.008


def test_a_late_grade_is_moved_too():
    assert len(of_height(find_motion(driven(4.0, name="grade")))) == 1


@pytest.mark.parametrize(
    "how",
    [
        {}, {"late": 0.8}, {"late": -0.8}, {"torque_late": 1.2}, {"noise": 6.0}, {"steep": 0.0},
        {"late": 4.0, "steep": 0.0},
    ],
    ids=["sound", "late", "early", "torque-late", "noise", "flat", "flat-late"],
)  # fmt: skip
def test_heights_are_left_where_they_are_sound_or_nothing_shows_hills(how):
    assert not of_height(find_motion(driven(**how)))


def test_without_a_torque_heights_are_taken_as_they_are():
    drive = driven(6.0).without("engine_torque")
    assert not of_height(find_motion(drive))


def test_a_torque_of_few_minutes_shows_no_lag():
    drive = driven(6.0)
    torque = drive.signals["engine_torque"]
    short = drive.with_signals(replace(torque, time=torque.time[:400], values=torque.values[:400]))
    assert not of_height(find_motion(short))
