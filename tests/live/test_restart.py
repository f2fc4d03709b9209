"""Devices that are turned off and on again, with clocks that begin anew."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import weighbridge as wb
from tests.live.senders import HOST, Senders
from tests.noted import says
from weighbridge import LiveStatus
from weighbridge.live.records import Records
from weighbridge.signals import LONGEST_STEP


class Heard:
    """A scale that hears the senders, as a session lets it."""

    def __init__(self, car, senders):
        self.scale, self.told = wb.LiveScale(car, step=LONGEST_STEP), []
        self._senders, self._renewed, self._due = senders, 0, 0.0

    def put(self, samples):
        self.scale.update_block(samples)
        if self._senders.lines.renewed > self._renewed:
            self._renewed = self._senders.lines.renewed
            self.scale.renew()
        if self._senders.now >= self._due:
            self._due = self._senders.now + 5.0
            self.told.append(self.scale.weighing())


def test_after_all_devices_began_anew_a_new_drive_is_weighed(car, loaded):
    drive, senders = loaded.drive, Senders()
    heard = Heard(car, senders)
    senders.play(drive, drive.start, drive.start + 70.0, heard.put)
    assert heard.told[-1].driven > 10.0
    senders.nothing(40.0)
    senders.play(drive, drive.start, drive.start + 12.0, heard.put)
    records, told = heard.scale.recorded(), heard.scale.weighing()
    assert heard.scale.newest == pytest.approx(HOST + 122.0, abs=0.1)
    assert records.start >= HOST + 110.0
    assert told.driven < 10.0
    assert [n for n in told.problems if n.id == "live.anew" and "e+" not in n.text]
    assert not [n for n in told.notes if "jumped" in n]
    # The sensor's stamps are where its lines came, to a tick.
    for name in ("accel_x", "vehicle_speed"):
        time = records.signals[name].time
        assert time[0] == pytest.approx(HOST + 110.0, abs=0.5)
        assert np.diff(time).max() < 1.5


def test_a_sensor_that_begins_anew_alone_is_of_the_same_drive(car, loaded):
    drive, senders = loaded.drive, Senders()
    heard = Heard(car, senders)
    senders.play(drive, drive.start, drive.start + 70.0, heard.put)
    at = [heard.scale.newest]
    # Its clock begins at 0 again while the bus goes on.
    senders.play(drive, drive.start, drive.start + 10.0, heard.put)
    assert senders.lines.renewed == 1
    told, records = heard.scale.weighing(), heard.scale.recorded()
    assert not [p for p in told.problems if p.id.startswith("live.")]
    assert told.driven > 10.0
    assert records.start == pytest.approx(HOST, abs=0.5)
    imu = records.signals["accel_x"].time
    assert np.diff(imu[imu > at[0] - 1.0]).max() < 0.1
    assert next(s for s in told.signals if s.name == "accel_x").unfit == 2


@pytest.mark.parametrize("restarted", [False, True])
def test_after_a_silence_it_is_said_that_the_mass_is_that_of_before(
    short, weighing, middle, half_driven, restarted
):
    """Until the vehicle was driven for two minutes, or somebody says that the load has changed."""
    scale = half_driven

    def feed(start, end, later=0.0):
        for at in np.arange(start, end, 1.0):
            part = short.between(at, min(at + 1.0, end))
            scale.update_block({n: (s.time + later, s.values) for n, s in part.signals.items()})
            yield scale.weighing()

    before = scale.weighing()
    assert before.mass > 0.0
    assert not before.notes
    if restarted:
        scale = wb.LiveScale.restore(weighing.vehicle, scale.checkpoint())
    told = list(feed(middle, short.end, 100.0))
    began = [w.driven - told[3].driven < 55.0 for w in told]
    noted = [any(n.id == "live.load_unknown" for n in w.problems) for w in told]
    masses = [math.isfinite(w.mass) for w in told]
    assert any(noted[3:])
    for k in range(3, len(told)):
        if noted[k]:
            assert masses[k]
            assert told[k].status is LiveStatus.LEARNING
            assert told[k].reason
        elif began[k]:
            assert not masses[k]
    assert not noted[-1] or told[-1].driven - told[3].driven < 121.0
    scale.load_changed()
    assert not scale.weighing().notes


def test_after_a_clock_was_set_back_the_mass_is_that_of_before_until_it_is_proved(
    short, weighing, middle, half_driven
):
    before = half_driven.weighing()
    assert before.mass > 0.0
    scale = wb.LiveScale.restore(weighing.vehicle, half_driven.checkpoint())
    back = 7200.0
    scale.clock_set_back(middle - back)
    told = []
    for at in np.arange(middle, short.end, 1.0):
        part = short.between(at, at + 1.0)
        scale.update_block({n: (s.time - back, s.values) for n, s in part.signals.items()})
        told.append(scale.weighing())
    unproved = [w for w in told[5:] if w.driven - before.driven < 110.0]
    assert unproved
    assert all(w.status is LiveStatus.LEARNING for w in unproved)
    said = [p.text for w in told for p in w.problems if p.id == "live.load_unknown"]
    assert said
    assert "e+" not in said[0]
    assert all(sum(n.id == "live.clock_jumps" for n in w.problems) == 1 for w in told)


@pytest.mark.slow
@pytest.mark.parametrize(("first", "gap"), [(250.0, 40.0), (400.0, 8.0)])
def test_the_mass_is_right_or_withdrawn_after_all_began_anew(car, loaded, first, gap):
    drive, senders = loaded.drive, Senders()
    heard = Heard(car, senders)
    senders.play(drive, drive.start, drive.start + first, heard.put)
    senders.nothing(gap)
    senders.play(drive, drive.start, drive.end, heard.put)
    true = float(loaded.truth.mass[-1])
    weighed = [w for w in heard.told if w.status is LiveStatus.WEIGHED]
    assert weighed
    assert max(abs(w.mass - true) / w.std for w in weighed) < 2.5


def block(names, time):
    return {name: (time, np.ones(time.size)) for name in names}


def test_strange_stamps_of_one_source_move_no_clock():
    """A sensor whose clock began anew sends a hundred samples between two of the bus."""
    records = Records()
    for k in range(200):
        host = HOST + 0.1 * k
        records.add_block(block(("vehicle_speed",), np.array([host])))
        strange = host - (250.0 if k > 100 else 0.0) + 1e-3 * np.arange(20)
        records.add_block(block(("accel_x", "accel_y", "accel_z"), strange))
    assert (records.jumps, records.offset) == (0, 0.0)
    assert records.newest == pytest.approx(HOST + 19.9)
    assert records.unfit == dict.fromkeys(("accel_x", "accel_y", "accel_z"), 99 * 20)


def test_a_jump_of_all_is_brought_back_with_the_gap_of_what_was_left_out():
    records = Records()
    time = HOST + 0.01 * np.arange(2000)
    for k in range(0, 2000, 5):
        moved = time[k : k + 5] - (5000.0 if k >= 1000 else 0.0)
        records.add_block(block(("vehicle_speed", "accel_x"), moved))
    assert records.jumps == 1
    assert records.newest == pytest.approx(time[-1], abs=0.1)


def test_a_drive_with_no_inertial_sensor_says_what_it_costs(car, loaded):
    """And the reason why there is no mass yet goes on while the vehicle drives."""
    # By a calibration without the sensor there would be one at the first look.
    scale = wb.LiveScale(replace(car, without_accelerometer=None))
    imu = [n for n in loaded.drive.signals if n.startswith(("accel", "gyro"))]
    drive = loaded.drive.without(*imu)
    reasons, notes, looks = [], [], []
    for start in np.arange(drive.start, drive.start + 150.0, 2.0):
        part = drive.between(start, start + 2.0)
        scale.update_block({n: (s.time, s.values) for n, s in part.signals.items()})
        told = scale.weighing()
        reasons.append(told.reason)
        looks.append((told.driven, told.look))
        notes.append([n for n in told.problems if n.id == "live.no_inertial"])
    assert not notes[0]
    assert len(notes[-1]) == 1
    again = {r for r in reasons if r and says(r, "looked_at_after")}
    assert len(again) > 3
    # The bar of the next look moves with the driving, and begins anew at a look.
    steps = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(looks)]
    assert all(rise > 0.0 for far, rise in steps if far > 0.0 and rise > -0.5)
    assert all(rise == 0.0 for far, rise in steps if far == 0.0)
    assert 1 <= sum(rise < -0.5 for _, rise in steps) <= 8
