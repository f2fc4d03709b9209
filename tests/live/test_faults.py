"""Faults in mid-drive: the mass stays right, or it is withdrawn, and the fault is shown."""

import copy
from dataclasses import replace
from threading import Event

import numpy as np
import pytest

import weighbridge as wb
from weighbridge import LiveStatus
from weighbridge.errors import SourceError
from weighbridge.live import Feed, Outputs, Replay, Session
from weighbridge.signals import LONGEST_STEP

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
    value = 8.0 if s.name.startswith("gyro") else 80.0
    return replace(s, values=np.where(hit, value, s.values))


def later(s, at):
    keep = s.time > at
    return replace(s, time=s.time[keep], values=s.values[keep])


def held(s, at):
    """The last value for a minute and a half, as receivers do in a tunnel."""
    values = s.values.copy()
    first, last = s.time.searchsorted([at, at + 90.0])
    values[first:last] = values[first]
    return replace(s, values=values)


def saturated(s, at):
    limit = 0.1 if s.name.startswith("gyro") else 1.0
    return replace(s, values=np.where(s.time > at, np.clip(s.values, -limit, limit), s.values))


def never(s, at):
    """Such signals are left out."""


def elsewhere(s, at):
    away = (s.time > at) & (s.time < at + 30.0)
    return replace(s, values=np.where(away, s.values + 1e-3, s.values))


def less(s, at):
    """Read 0.8 times as much, in the steps in which a load is sent."""
    low = np.round(0.8 * 255.0 * s.values) / 255.0
    return replace(s, values=np.where(s.time > at, low, s.values))


def begins(drive):
    return drive.start + 0.55 * drive.duration


def faulty(drive, names, fault):
    at = begins(drive)
    present = [drive.signals[n] for n in names if n in drive.signals]
    if fault is never:
        return drive.without(*(s.name for s in present))
    return drive.with_signals(*(fault(s, at) for s in present))


def fed(scale, drive, start, end):
    """Every weighing on the way, by the step of a quick replay."""
    for at in np.arange(start, end, 2.0):
        part = drive.between(at, np.nextafter(min(at + 2.0, end), -np.inf))
        scale.update_block({n: (s.time, s.values) for n, s in part.signals.items()})
        yield scale.weighing()


@pytest.fixture(scope="module")
def until_the_fault(car, loaded):
    """A scale that has heard the whole drive until a fault begins, and what it told."""
    drive = loaded.drive
    scale = wb.LiveScale(car, info=drive.info, step=LONGEST_STEP)
    return scale, list(fed(scale, drive, drive.start, begins(drive)))


class Unplugged:
    """An adapter that is pulled out in mid-drive, and found again at the fifth try."""

    name = "elm:/dev/ttyUSB0"
    patient = True

    def __init__(self, *parts):
        self._parts, self._tries = parts, 0

    def run(self, put, stop):
        self._tries += 1
        if self._tries in (1, 5):
            Replay(self._parts[self._tries > 1], float("inf")).run(put, stop)
        if self._tries < 5:
            raise SourceError("/dev/ttyUSB0 is gone")


class Shown:
    name = "test"

    def __init__(self):
        self.weighings = []

    def show(self, weighing):
        self.weighings.append(weighing)

    def close(self):
        pass


def test_an_adapter_that_is_pulled_out_is_told_once(short, middle, half_driven, loaded, caplog):
    parts = short.between(middle, middle + 20.0), short.between(middle + 32.0, short.end)
    scale, shown = half_driven, Shown()
    with Outputs([shown]) as outputs, Feed([Unplugged(*parts)], pauses=(0.02, 0.05)) as feed:
        last = Session(feed=feed, scale=scale, outputs=outputs).run(Event())
    said = [r.getMessage() for r in caplog.records]
    assert [("is gone" in s, "is back" in s) for s in said] == [(True, False), (False, True)]
    true = float(loaded.truth.mass[-1])
    known = [w for w in shown.weighings if np.isfinite(w.mass) and w.status is LiveStatus.WEIGHED]
    assert known
    assert max(abs(w.mass - true) / w.std for w in [*known, last]) < 2.5
    assert scale.recorded().end == pytest.approx(short.end, abs=1.0)


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
    ("GNSS never", GNSS, never),
    ("GNSS on midway", GNSS, later),
    ("tunnel", GNSS, held),
    ("gyro gone", IMU[3:], gone),
    ("gyro frozen", IMU[3:], frozen),
    ("gyro spikes", IMU[3:], spiky),
    ("gyro saturated", IMU[3:], saturated),
    ("accelerometer saturated", IMU[:2], saturated),
]


@pytest.mark.parametrize(
    ("names", "fault"),
    [
        *(pytest.param(names, fault, id=name) for name, names, fault in QUICK),
        *(pytest.param(n, f, id=name, marks=pytest.mark.slow) for name, n, f in MORE),
    ],
)
def test_a_fault_in_mid_drive_is_survived_or_withdraws_the_mass(
    car, loaded, until_the_fault, names, fault
):
    drive, start = faulty(loaded.drive, names, fault), begins(loaded.drive)
    if fault in (never, later):
        scale, before = wb.LiveScale(car, info=drive.info, step=LONGEST_STEP), []
        start = drive.start
    else:
        scale, before = copy.deepcopy(until_the_fault)
    readings = [*before, *fed(scale, drive, start, loaded.drive.end)]
    scale.finish()
    readings.append(scale.weighing())
    found, true = readings[-1], float(loaded.truth.mass[-1])
    weighed = [w for w in readings if w.status is LiveStatus.WEIGHED]
    assert weighed
    if fault is less:
        # A withdrawn mass stays withdrawn over a power cut, and with another load.
        again = wb.LiveScale.restore(car, scale.checkpoint())
        for told in (found, again.weighing()):
            assert told.status is LiveStatus.INCONSISTENT
            assert np.isnan(told.mass)
            assert told.reason_id == "load.change_moving"
        again.load_changed()
        assert again.weighing().status is LiveStatus.INCONSISTENT
        # Nor does it come back with the few records of after a restart.
        again = wb.LiveScale.restore(car, scale.checkpoint())
        few = loaded.drive.between(start, start + 12.0)
        gone_by = loaded.drive.end + 60.0 - start
        again.update_block({n: (s.time + gone_by, s.values) for n, s in few.signals.items()})
        again.finish()
        assert again.weighing().reason_id == "motion.few_rows"
        assert np.isnan(again.weighing().mass)
        return
    assert max(abs(w.mass - true) / w.std for w in weighed) < 2.5
    if fault in (frozen, saturated) and set(names) <= set(IMU):
        shown = " ".join((found.reason, *found.notes))
        assert "inertial sensor" in shown or any(name in shown for name in names)
    if found.status is LiveStatus.INCONSISTENT:
        # What failed is named, and no unit is blamed.
        assert found.reason_id.startswith(("imu.", "frozen."))
        return
    assert abs(found.mass - true) < 2.5 * found.std
    left_out = any(p.id == "imu.left_out" for p in found.problems)
    assert found.std < (0.06 if left_out else 0.02) * true
    lost = [s.name for s in found.signals if s.needed and not s.fresh]
    ended = {n for n in names if fault is gone and n not in GNSS}
    assert set(lost) == ended & {s.name for s in found.signals if s.needed}
    if lost:
        assert found.status is LiveStatus.LEARNING
        assert all(name in found.reason for name in lost)


def shaken(s):
    noise = np.random.default_rng(11).normal(0.0, 3.0, len(s))
    return replace(s, values=s.values + noise)


def at_limit(s):
    return replace(s, values=np.clip(s.values, -0.2, 0.2))


@pytest.mark.parametrize(
    ("names", "fault", "tare", "problem"),
    [
        pytest.param(IMU[:3], shaken, True, "imu.left_out", id="sensor left out"),
        pytest.param(IMU[3:], at_limit, True, "imu.gyro_clipped", id="gyro at its limit"),
        pytest.param((), None, False, "mass.unbacked", id="calibration without a tare"),
        pytest.param(IMU, None, True, "motion.grade_by_height", id="no inertial sensor"),
    ],
)
def test_at_its_end_live_shows_what_a_weighing_does(car, loaded, names, fault, tare, problem):
    vehicle = car if tare else replace(car, tare=None)
    drive = loaded.drive.between(loaded.drive.start, loaded.drive.start + 420.0)
    drive = (
        drive.with_signals(*(fault(drive.signals[n]) for n in names))
        if fault
        else drive.without(*names)
    )
    recorded = wb.weigh(drive, vehicle)
    scale = wb.LiveScale(vehicle, info=drive.info, step=LONGEST_STEP)
    scale.update_block({n: (s.time, s.values) for n, s in drive.signals.items()})
    scale.finish()
    found = scale.weighing()
    seen = [p.id for p in found.problems if not p.id.startswith("live.")]
    assert seen == [p.id for p in recorded.problems]
    assert problem in seen
    assert found.mass == pytest.approx(recorded.mass, rel=1e-3)
    assert found.std == pytest.approx(recorded.std, rel=0.02)
