"""Faults in mid-drive: the mass stays right, or it is withdrawn, and the fault is shown."""

from dataclasses import replace

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.live.weighing import LiveStatus

IMU = tuple(f"{kind}_{axis}" for kind in ("accel", "gyro") for axis in "xyz")
GNSS = ("latitude", "longitude", "altitude", "gnss_speed", "gnss_course", "hdop", "gnss_accuracy")
BUS = ("vehicle_speed", "engine_speed", "engine_load", "throttle")


def gone(s, at):
    keep = s.time < at
    return replace(s, time=s.time[keep], values=s.values[keep])


def silent(s, at):
    keep = (s.time < at) | (s.time > at + 60.0)
    return replace(s, time=s.time[keep], values=s.values[keep])


def frozen(s, at):
    values = s.values.copy()
    first = int(s.time.searchsorted(at))
    values[first:] = values[first]
    return replace(s, values=values)


def spiky(s, at):
    hit = (np.random.default_rng(1).random(len(s)) < 0.002) & (s.time > at)
    return replace(s, values=np.where(hit, 80.0, s.values))


def elsewhere(s, at):
    away = (s.time > at) & (s.time < at + 30.0)
    return replace(s, values=np.where(away, s.values + 1e-3, s.values))


def less(s, at):
    return replace(s, values=np.where(s.time > at, 0.8 * s.values, s.values))


def faulty(drive, names, fault):
    at = drive.start + 0.55 * drive.duration
    present = [drive.signals[n] for n in names if n in drive.signals]
    return drive.with_signals(*(fault(s, at) for s in present))


def told(car, drive, end):
    scale = wb.LiveScale(car, info=drive.info)
    for start in np.arange(drive.start, end, 2.0):
        part = drive.between(start, start + 2.0)
        scale.update_block({n: (s.time, s.values) for n, s in part.signals.items()})
    scale.finish()
    return scale.weighing()


QUICK = [("accelerometer frozen", IMU[:3], frozen), ("load times 0.8", ("engine_load",), less)]
MORE = [
    ("GNSS off midway", GNSS, gone),
    ("GNSS jumps 6 km", ("latitude",), elsewhere),
    ("accelerometer gone", IMU[:3], gone),
    ("sensor silent", IMU, silent),
    ("spikes", IMU[:3], spiky),
    ("bus silent", BUS, silent),
    ("speed frozen", BUS[:1], frozen),
    ("load frozen", ("engine_load",), frozen),
]


@pytest.mark.parametrize(
    ("names", "fault"),
    [
        *(pytest.param(names, fault, id=name) for name, names, fault in QUICK),
        *(pytest.param(n, f, id=name, marks=pytest.mark.slow) for name, n, f in MORE),
    ],
)
def test_a_fault_in_mid_drive_is_survived_or_withdraws_the_mass(car, loaded, names, fault):
    drive = faulty(loaded.drive, names, fault)
    found = told(car, drive, loaded.drive.end)
    if fault is less:
        assert found.status is LiveStatus.INCONSISTENT
        assert np.isnan(found.mass)
        assert "engine_load reads 0." in found.reason
        return
    true = float(loaded.truth.mass[-1])
    assert abs(found.mass - true) < 2.5 * found.std
    assert found.std < 0.02 * true
    lost = [s.name for s in found.signals if s.needed and not s.fresh]
    ended = {n for n in names if fault is gone and n not in GNSS}
    assert set(lost) == ended & {s.name for s in found.signals if s.needed}
    if lost:
        assert found.status is LiveStatus.LEARNING
        assert all(name in found.reason for name in lost)
