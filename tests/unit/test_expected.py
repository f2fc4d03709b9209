"""What `inspect` says to expect of a drive, beside what docs/accuracy.md has as measured."""

import re
from pathlib import Path

import numpy as np
import pytest

from weighbridge import Drive, Signal, Vehicle
from weighbridge.pipeline.expected import (
    ENOUGH,
    EXPECTED,
    MOTIONS,
    chance,
    excitation,
    expected,
)
from weighbridge.vehicle import Provenance

HOME = Path(__file__).parents[2]
PAGE = (HOME / "docs" / "accuracy.md").read_text("utf-8")


def measured(row):
    """Percents of a row of the page's table (low, high), less what it says in brackets."""
    line = next(x for x in PAGE.splitlines() if x.startswith(f"| {row}"))
    cell = re.sub(r"\(.*?\)", "", line.split("|")[2])
    found = re.findall(r"([\d.]+)(?:–([\d.]+))? %", cell)
    return [(float(a), float(b or a)) for a, b in found]


@pytest.mark.parametrize("motion", MOTIONS)
def test_the_page_has_what_inspect_tells(motion):
    fast, slow = (EXPECTED[motion, f] for f in (True, False))
    row = f"| {MOTIONS[motion]} | {fast[0]:g}–{fast[1]:g} % | {slow[0]:g}–{slow[1]:g} % |"
    assert row in PAGE.splitlines()


@pytest.mark.parametrize(
    ("row", "ways"),
    [
        ("IMU, OBD speed, engine speed", [("inertial", True)] * 2),
        ("the same, one calibration drive", [("inertial", True)] * 2),
        ("the same, five minutes of driving", [("inertial", True)]),
        ("OBD at 1 Hz with an IMU", [("inertial", False)]),
        ("OBD at 4 Hz with GNSS, no IMU", [("speed_grade", True)]),
        ("OBD at 1 Hz with GNSS, no IMU", [("speed_grade", False)]),
        ("a truck: speed, torque in percent", [("speed_grade", True)]),
        ("OBD at 2 Hz alone", [("speed", False)]),
    ],
)
def test_what_was_measured_is_within_what_inspect_tells(row, ways):
    told = measured(row)
    assert len(told) == len(ways)
    for (low, high), way in zip(told, ways, strict=True):
        best, worst, _ = EXPECTED[way]
        assert expected(way[0], fast=way[1]) == (best, worst)
        assert best <= low <= high <= worst


def test_a_calibrated_file_promises_no_more_than_it_leaves():
    def promised(scale):
        made = Vehicle(provenance=Provenance(mass_scale_std=scale))
        return expected("speed_grade", fast=True, vehicle=made)

    assert promised(None) == expected("speed_grade", fast=True)
    # 1.2 % of the motion beside it, of 1.6 % and of 6 %.
    ends = np.array([promised(0.016), promised(0.06)])
    assert ends[1] / ends[0] == pytest.approx(np.hypot(6.0, 1.2) / np.hypot(1.6, 1.2), rel=0.03)
    low, high = ends[0]
    assert low < np.hypot(1.6, 1.2) < high


def cosine(duration, rise):
    """Drive whose speed is a cosine with a period of 60 s."""
    time = np.arange(0.0, duration + 0.1, 0.25)
    speed = 15.0 + rise * np.cos(2.0 * np.pi * time / 60.0)
    return Drive("d", {"vehicle_speed": Signal("vehicle_speed", time, speed)})


def test_excitation_is_the_integral_of_the_squared_acceleration():
    found = excitation(cosine(1200.0, 8.0))
    assert found.energy == pytest.approx(0.5 * 1200.0 * (2.0 * np.pi * 8.0 / 60.0) ** 2, rel=0.01)
    assert found.driven == pytest.approx(1200.0, abs=4.0)
    parked = Signal("vehicle_speed", np.arange(600.0), np.zeros(600))
    assert excitation(Drive("d", {"vehicle_speed": parked})) == (0.0, 0.0)
    assert excitation(Drive("d", {})) == ENOUGH


@pytest.mark.parametrize("motion", MOTIONS)
def test_less_driving_promises_less(motion):
    car = Vehicle(provenance=Provenance(mass_scale_std=0.01))
    drives = [excitation(cosine(1200.0, rise)) for rise in (8.0, 4.0, 1.0, 0.0)]
    for vehicle in (None, car):
        ends = [expected(motion, fast=True, vehicle=vehicle, drive=d) for d in drives[:3]]
        assert ends == sorted(ends)
        assert len(set(ends)) == 3
    assert [chance(motion, d) for d in (drives[0], drives[-1])] == ["sure", "none"]
    assert chance(motion, excitation(cosine(100.0, 8.0))) == "unsure"


@pytest.mark.parametrize("fast", [True, False])
def test_a_better_motion_promises_more(fast):
    worst = [EXPECTED[motion, fast][1] for motion in MOTIONS]
    assert worst == sorted(worst)
    assert len(set(worst)) == len(worst)
