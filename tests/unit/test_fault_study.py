"""The study of faults puts in what it says, judges as it says, and outlives what it stops."""

import math
import os
import re
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numba
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "studies"))

from fault_cases import Case, all_cases, injected, pairs, run_case, subset, telling, through_files
from fault_kinds import FAULTS, Fault
from fault_subjects import METHODS, build
from fault_workers import done_apart
from tests.noted import noted

from weighbridge import Signal, read_drive

needs_compiler = pytest.mark.skipif(
    numba.config.DISABLE_JIT, reason="half a million steps need compiled code"
)


@pytest.fixture(scope="module")
def car():
    (subject,) = build("car", 8300, duration=450.0)
    return subject


def kinds_of(outcomes):
    return {o.method: o.kind for o in outcomes}


def one(apply, **more):
    return Case(((Fault("test", apply, (1.0,), **more), 1.0),), "car")


def untouched(drive, severity, rng):
    return drive


def named(drive, severity, rng):
    return drive.with_problems(noted("the sensor has gone soft"))


def without_speed(drive, severity, rng):
    return drive.without("vehicle_speed", "gnss_speed", "latitude", "longitude")


def of_two_lengths(drive, severity, rng):
    s = drive.signals["accel_x"]
    torn = Signal(s.name, s.time, s.values)
    object.__setattr__(torn, "values", s.values[:-7])
    return drive.with_signals(torn)


@needs_compiler
def test_undamaged_drive_is_right_by_every_method(car):
    outcomes = run_case(one(untouched, harmless=True), car)
    assert kinds_of(outcomes) == dict.fromkeys(METHODS, "right")
    assert all(np.isfinite(o.error) and o.std > 0.0 for o in outcomes)


@needs_compiler
def test_wrong_mass_is_silent_unless_a_warning_names_the_fault(car):
    # What is undamaged weighs half of what this subject is said to weigh.
    heavy = replace(
        car,
        mean=2.0 * car.mean,
        final=2.0 * car.final,
        undamaged={m: 2.0 * x for m, x in car.undamaged.items()},
    )
    assert set(kinds_of(run_case(one(untouched), heavy)).values()) == {"silent"}
    assert set(kinds_of(run_case(one(named), heavy)).values()) == {"silent"}
    outcomes = run_case(one(named, words="soft"), heavy)
    assert set(kinds_of(outcomes).values()) == {"reported"}
    assert {o.text for o in outcomes} == {"the sensor has gone soft"}
    assert outcomes[0].error == pytest.approx(-0.5, abs=0.05)


@needs_compiler
def test_of_a_pair_each_fault_that_spoils_the_mass_must_be_named(car):
    heavy = replace(
        car,
        mean=2.0 * car.mean,
        final=2.0 * car.final,
        undamaged={m: 2.0 * x for m, x in car.undamaged.items()},
    )
    soft, quiet = Fault("test", named, (1.0,), "soft"), Fault("other", untouched, (1.0,), "torque")
    both = Case(((soft, 1.0), (quiet, 1.0)), "car")
    assert set(kinds_of(run_case(both, heavy)).values()) == {"silent"}
    meek = replace(quiet, harmless=True)
    assert set(kinds_of(run_case(Case(((soft, 1.0), (meek, 1.0)), "car"), heavy)).values()) == {
        "reported"
    }
    # The one that is not named leaves the mass alone right: it is none of the reasons.
    assert telling(both, car, ["the sensor has gone soft"], "joint") == "the sensor has gone soft"


SAID = {
    "leans": "perhaps when the vehicle accelerates, the sensor tilts by 0.63° per m/s² "
    "(calibration 0.25°): its mount is loose, or the springs are others; the interval "
    "contains this",
    "reads": "the accelerometer reads 0.913 times the change of speed, and gravity does not show "
    "this; the interval contains a standard deviation of 3.5 % for it",
    "payload": "with a probability of 43 % the load changed at a stop, most likely before 200 s; "
    "mass and interval contain this",
    "delay": "torque delay +0.21 s found from this drive",
    "drift": "the clock of obd drifts by +496 ppm against that of imu, by the motion that both "
    "show; they were aligned (by up to 0.58 s)",
    "stands": "the vehicle stands still for 14 min from 300 s; if it was loaded there, look at the "
    "mass of each segment",
    "air": "engine_load reads 0.91 times as much as mass_air_flow shows by the calibration of car: "
    "one of the two, or engine_speed, is wrong; a mass from it is off by the same share",
    "masses": "with 1763 kg the torque of drive 1 reads 0.81 of its value; by data sheets "
    "(std 7 %) 1428 kg are plausible; check the mass",
    "squat": "the drive does not show how the body pitches under acceleration; its pitch is read "
    "as grade",
    "level": "no grade and no altitude; the road is assumed to be level",
    "noisy": "the gyro is noisy: it reads 0.3 rad/s while the vehicle stands",
    "splice": "there are jumps of the position, once, at 449 s: several recordings seem to be "
    "joined; weighbridge weigh splits them, and read_drives in Python",
    "step": "engine_torque had steps of 0.5 N m in the calibration, and has values between them",
}
"""Sentences of the program."""

NAMED_BY = {
    "pitches_in_mid_drive": {"leans"},
    "accel_scale_x": {"reads"},
    "gyro_scale": {"noisy"},
    "gyro_noise": {"noisy"},
    "accel_noise": set(),
    "imu_rate": set(),
    "torque_scale": {"air", "step", "masses"},
    "torque_scale_ramps": {"air", "step", "masses"},
    "torque_late": {"delay", "drift"},
    "imu_clock_drift": {"drift"},
    "engine_speed_scale": {"air"},
    "speed_scale": set(),
    "speed_freezes": set(),
    "followed_by_another": {"splice"},
    "calibration_mass_scale": {"masses"},
    "two_accel_cells": set(),
    "one_stamp": {"drift"},
}


def test_a_fault_is_named_by_what_tells_of_its_signal_or_its_cause_alone():
    words = {f.name: f.words for f in FAULTS if not f.harmless}
    for fault, expected in NAMED_BY.items():
        found = {k for k, text in SAID.items() if re.search(words[fault], text, re.IGNORECASE)}
        assert found == expected, fault


@needs_compiler
def test_what_must_be_told_and_is_not_is_silent(car):
    assert set(kinds_of(run_case(one(untouched, must_tell=True), car)).values()) == {"silent"}
    told = run_case(one(named, must_tell=True, words="soft"), car)
    assert set(kinds_of(told).values()) == {"right"}


@needs_compiler
def test_refusals_and_tracebacks_are_told_apart(car):
    refused = run_case(one(without_speed), car)
    assert set(kinds_of(refused).values()) == {"refused"}
    assert all(o.text for o in refused)
    broken = run_case(one(of_two_lengths), car)
    assert set(kinds_of(broken).values()) == {"traceback"}
    assert "Error" in broken[0].text


@needs_compiler
def test_every_fault_damages_its_drive_and_leaves_signals(car, tmp_path):
    short = replace(car, drive=car.drive.between(60.0, 180.0), other=car.other.between(60.0, 180.0))
    cases = {
        c.faults[0][0].name: c
        for c in all_cases()
        if c.vehicle == "car" and c.faults[0][0].stage in ("drive", "splice")
    }
    del cases["undamaged"], cases["cut_short"], cases["tail_alone"]
    for case in cases.values():
        drive = injected(case, short)
        same = [
            np.array_equal(s.values, short.drive.signals[s.name].values)
            and np.array_equal(s.time, short.drive.signals[s.name].time)
            for s in drive.signals.values()
        ]
        assert not all(same) or len(same) < len(short.drive.signals), case.name
        for s in drive.signals.values():
            assert s.time.size == s.values.size > 0, case.name
            assert np.isfinite(s.values).all(), case.name
            assert (np.diff(s.time) > 0.0).all(), case.name


@needs_compiler
def test_faults_of_files_reach_the_reader(car, tmp_path):
    drive = car.drive.between(60.0, 120.0)
    case = next(c for c in all_cases() if c.name == "two_accel_cells@1e+06/car")
    assert through_files(case, drive, tmp_path / "drive")
    read = read_drive(tmp_path / "drive")
    assert np.count_nonzero(np.abs(read.signals["accel_x"].values) > 1e5) in (0, 2)
    text = (tmp_path / "drive" / "imu.csv").read_text()
    assert text.count("1000000.0") == 2


def test_cases_are_many_named_once_and_seeded():
    cases = all_cases()
    names = [c.name for c in cases]
    assert len(set(names)) == len(names) >= 300
    assert {c.name for c in pairs(20, 1)} == {c.name for c in pairs(20, 1)}
    assert {c.name for c in pairs(20, 1)} != {c.name for c in pairs(20, 2)}
    assert all(not c.harmless for c in pairs(20, 1))
    usual = {f.name for f in FAULTS if set(f.vehicles) & {"car", "van", "electric"}}
    assert {c.faults[0][0].name for c in subset(cases, 1)} == usual


def doing(job):
    what, amount = job
    if what == "sleep":
        time.sleep(amount)
    elif what == "compute":
        until = time.process_time() + amount
        while time.process_time() < until:
            pass
    elif what == "hold":
        held = np.ones(int(amount))
        time.sleep(2.0)
        return held.size
    elif what == "tell":
        return held_now()
    elif what == "end":
        os._exit(int(amount))
    elif what == "fail":
        raise ValueError("no")
    return amount


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_cases_that_hang_die_or_fill_memory_are_stopped_and_the_rest_is_done():
    jobs = [
        ("return", 1),
        ("compute", 30.0),
        ("end", 3),
        ("hold", 2.0e7),
        ("fail", 0),
        ("sleep", 60.0),
        ("return", 2),
    ]
    # A forked process holds less than its parent: pages of files are not copied.
    ((_, idle),) = done_apart(doing, [("tell", 0)], most=math.inf)
    run = partial(done_apart, doing, jobs, workers=2, longest=1.0)
    found = dict(run(most=5e7 + idle.result))
    assert {job: d.stopped for job, d in found.items()} == {
        ("return", 1): "",
        ("compute", 30.0): "hang",
        ("end", 3): "died",
        ("hold", 2.0e7): "memory",
        ("fail", 0): "",
        ("sleep", 60.0): "hang",
        ("return", 2): "",
    }
    assert found["return", 2].result == 2
    assert found["fail", 0].failure == "ValueError: no"


def held_now():
    pages = Path("/proc/self/statm").read_text().split()[1]
    return int(pages) * os.sysconf("SC_PAGE_SIZE")
