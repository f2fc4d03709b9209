"""Several drives in one recording: where it is parted, and where it is not."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import weighbridge as wb
from weighbridge import Signal, read_drives
from weighbridge.checks import check_drive, correct_drive
from weighbridge.io import write_table
from weighbridge.signals import find_splices, longest_part, parted
from weighbridge.simulation import make_scenario, simulate_car

LONG = 400.0

PAUSE, STANDING = 300.0, 600.0
"""Where nothing is recorded, or the vehicle means, so long a drive ends [s]."""

KEPT = 60.0
"""So much of such a stop the drives to both sides keep [s]."""


@pytest.fixture(scope="module")
def trips():
    """Three drives, cut out of simulated ones while the vehicle moves or stands."""
    found = []
    for seed in (21, 22, 23):
        scenario = replace(make_scenario("car-short", seed=seed), duration=LONG)
        found.append(simulate_car(scenario).drive)
    return found


def behind(trips, gap):
    """Put drives one behind another, ``gap`` seconds apart; names of all signals."""
    at, parts = 0.0, {}
    for trip in trips:
        for name, s in trip.signals.items():
            parts.setdefault(name, []).append((s.time - trip.start + at, s.values))
        at += trip.duration + gap
    signals = {
        name: Signal(name, *(np.concatenate(x) for x in zip(*pieces, strict=True)))
        for name, pieces in parts.items()
    }
    return wb.Drive("day", signals)


def test_pauses_part_a_day(trips):
    day = behind(trips, PAUSE + 60.0)
    parts = parted(day)
    assert [p.name for p in parts] == [f"day part {k} of 3" for k in (1, 2, 3)]
    for part, trip in zip(parts, trips, strict=True):
        assert part.duration == pytest.approx(trip.duration, abs=0.1)
        assert part.signals.keys() == trip.signals.keys()
        np.testing.assert_array_equal(
            part.signals["vehicle_speed"].values, trip.signals["vehicle_speed"].values
        )
        assert part.problems[-1].id == "file.part"
        assert part.problems[-1].values["parts"] == 3
        assert part.problems[-1].text.endswith(f"{part.start:.0f} to {part.end:.0f} s")
    assert parted(parts[0])[0] is parts[0]
    assert len(parted(behind(trips, PAUSE - 60.0))) == 1


def test_a_position_held_through_a_tunnel_is_no_splice(trips):
    drive = trips[0]
    latitude, longitude = drive.signals["latitude"], drive.signals["longitude"]
    speed = drive.signals["vehicle_speed"]
    starts = np.arange(latitude.time[0], drive.end - 90.0, 5.0)
    begin = max(starts, key=lambda t: np.mean(speed.at(t + np.arange(60.0))))
    tick = np.arange(latitude.time[0], drive.end, 0.02)
    known = np.where((tick > begin) & (tick < begin + 60.0), begin, tick)
    second = np.maximum(np.floor(known), tick[0])
    held = [Signal(s.name, tick, s.at(second)) for s in (latitude, longitude)]
    moved = np.hypot(*(np.abs(np.diff(s.values)).max() for s in held)) * 6.37e6
    assert moved > 600.0
    assert not find_splices(drive.with_signals(*held))
    elsewhere = [Signal(s.name, tick, s.values + 0.01 * (tick > begin + 60.0)) for s in held]
    assert [c.why for c in find_splices(drive.with_signals(*elsewhere))] == [
        "jumps of the position"
    ]


def test_a_long_stop_parts_a_day_and_a_short_one_does_not(trips):
    trip = trips[0]
    speed = trip.signals["vehicle_speed"]
    for stands, many in ((STANDING - 60.0, 1), (STANDING + 300.0, 2)):
        at = np.arange(0.0, stands, 0.5)
        end = speed.time[-1] + 1.0
        time = np.concatenate([speed.time, end + at, speed.time + end + at[-1] + 1.0])
        still = np.zeros(at.size)
        values = np.concatenate([speed.values, still, speed.values])
        day = wb.Drive("day", {"vehicle_speed": Signal("vehicle_speed", time, values)})
        parts = parted(day)
        assert len(parts) == many
        for a, b in pairwise(parts):
            assert b.start - a.end == pytest.approx(stands - 2.0 * KEPT, abs=40.0)


def test_a_clock_set_while_moving_on_parts_nothing(trips):
    trip = trips[0]
    speed = trip.signals["vehicle_speed"].values
    k = int(np.argmax(speed))
    at = trip.signals["vehicle_speed"].time[k]
    later = [
        Signal(s.name, np.where(s.time > at, s.time + 7200.0, s.time), s.values)
        for s in trip.signals.values()
    ]
    assert len(parted(trip.with_signals(*later))) == 1


def test_a_splice_on_one_clock_is_found(trips):
    # Each trip ends and begins on the road, at speeds and places of its own.
    cut = []
    for trip, shift in zip(trips, (0.0, 0.1, 0.2), strict=True):
        begin, end = trip.start + 100.0, trip.start + 300.0
        signals = {}
        for name, s in trip.signals.items():
            rows = (s.time >= begin) & (s.time < end)
            values = s.values[rows] + (shift if name == "latitude" else 0.0)
            signals[name] = Signal(name, s.time[rows], values)
        cut.append(replace(trip, signals=signals))
    day = behind(cut, 0.05)
    parts = parted(day)
    assert len(parts) == 3
    assert [p.duration for p in parts] == pytest.approx([200.0] * 3, abs=1.5)
    assert not any(find_splices(p) for p in parts)
    assert not any(find_splices(t) for t in trips)


@pytest.mark.parametrize("factor", [1.0 / 1.609344, 1.609344])
def test_a_speed_that_changes_its_scale_while_the_engine_goes_on_is_no_splice(trips, factor):
    drive = trips[0].without("latitude", "longitude", "altitude", "gnss_speed", "gnss_course")
    speed, engine = drive.signals["vehicle_speed"], drive.signals["engine_speed"]
    steady = np.abs(np.gradient(engine.values)) + 20.0 * (speed.at(engine.time) < 19.0)
    at = float(engine.time[50 + np.argmin(np.convolve(steady, np.ones(15), "same")[50:-50])])
    # A speed that stays the same may be old.
    new = speed.values + 0.01 * (np.arange(len(speed)) % 2)
    scaled = np.where(speed.time < at, 1.0, factor) * new
    changed = drive.with_signals(Signal("vehicle_speed", speed.time, scaled))
    assert not find_splices(changed)
    # Where the engine speed jumps as well, another recording begins.
    jumped = np.where(engine.time < at, 1.0, 0.7) * engine.values
    spliced = changed.with_signals(Signal("engine_speed", engine.time, jumped))
    assert [c.why for c in find_splices(spliced)] == ["jumps of the speed"]


def test_of_joined_recordings_read_as_one_drive_the_longest_is_used(trips):
    cut = []
    for trip, shift, length in zip(trips, (0.0, 0.1, 0.2), (200.0, 300.0, 250.0), strict=True):
        signals = {}
        for name, s in trip.signals.items():
            rows = (s.time >= trip.start + 100.0) & (s.time < trip.start + 100.0 + length)
            values = s.values[rows] + (shift if name == "latitude" else 0.0)
            signals[name] = Signal(name, s.time[rows], values)
        cut.append(replace(trip, signals=signals))
    day = behind(cut, 0.05)
    kept = longest_part(day)
    assert [p.id for p in kept.problems] == ["clock.splices"]
    assert kept.duration == pytest.approx(300.0, abs=1.5)
    assert correct_drive(day).duration == pytest.approx(kept.duration, abs=1.5)
    assert longest_part(kept) is kept
    # A person may vouch for what jumps.
    jumping = ("vehicle_speed", "gnss_speed", "latitude", "longitude", "altitude")
    vouched = replace(day, info=replace(day.info, trusted=jumping))
    assert longest_part(vouched) is vouched
    assert len(parted(vouched)) == 1


@pytest.mark.parametrize(("period", "least"), [(0.25, 20.0), (0.5, 25.0), (1.0, 36.0)])
def test_a_splice_of_steady_speeds_is_found_from_what_tyres_can_do_on(period, least):
    time = np.arange(0.0, 600.0, period)
    wave = 4.0 * np.sin(0.05 * time) / 3.6
    for jump, found in ((least, True), (-least, period < 0.5), (0.5 * least, False)):
        values = 60.0 / 3.6 + wave + np.where(time < 300.0, 0.0, jump / 3.6)
        cuts = find_splices(wb.Drive("d", {"vehicle_speed": Signal("vehicle_speed", time, values)}))
        assert bool(cuts) == found, (period, jump)
        assert all(c.begin == 300.0 for c in cuts)


def test_a_held_speed_that_catches_up_is_no_splice():
    time = np.arange(0.0, 600.0, 1.0)
    values = np.clip(0.1 * (time - 20.0), 2.0, 30.0)
    held = (time >= 150.0) & (time < 170.0)
    steep = np.where(time > 160.0, 12.0, 0.0)
    truth = values + steep
    values = np.where(held, truth[150], truth)
    assert np.abs(np.diff(values)).max() > 13.0
    drive = wb.Drive("d", {"vehicle_speed": Signal("vehicle_speed", time, values)})
    assert not find_splices(drive)


@pytest.mark.parametrize(("higher", "found"), [(0.0, False), (18.0, True)])
def test_a_step_of_speed_and_height_at_once_is_a_splice(higher, found):
    time = np.arange(0.0, 600.0, 0.25)
    # In whole km/h, and the same for seconds before: by itself the step may be an honest one.
    speed = np.round(np.where(time < 300.0, 100.0, 74.0) + 3.0 * np.sin(0.02 * (time - 300.0)))
    second = np.floor(time)
    height = 40.0 + 5.0 * np.sin(0.02 * second) + np.where(time < 300.0, 0.0, higher)
    signals = {"vehicle_speed": Signal("vehicle_speed", time, speed / 3.6)}
    signals["altitude"] = Signal("altitude", time, height)
    cuts = find_splices(wb.Drive("d", signals))
    assert [c.begin for c in cuts] == ([300.0] if found else [])


def test_speed_that_freezes_or_drops_out_is_no_splice(trips):
    speed = trips[0].signals["vehicle_speed"]
    top = int(np.argmax(speed.values))
    for held in (0.0, float(speed.values[top])):
        rows = slice(top, top + 40)
        values = speed.values.copy()
        values[rows] = held
        drive = trips[0].with_signals(replace(speed, values=values))
        assert not find_splices(drive)


def test_what_is_sent_rarely_goes_on_to_hold(trips):
    once = Signal("reference_torque", np.array([5.0]), np.array([250.0]))
    day = behind(trips, 2.0 * PAUSE).with_signals(once)
    for part in parted(day):
        assert part.signals["reference_torque"].values.tolist() == [250.0]
        assert part.start <= part.signals["reference_torque"].time[0] <= part.end


def test_a_table_whose_clock_begins_anew_holds_several_drives(trips, tmp_path):
    columns = {"time_s": [], "vehicle_speed_kmh": [], "engine_speed_rpm": []}
    for trip in trips:
        speed = trip.signals["vehicle_speed"]
        columns["time_s"].append(speed.time - speed.time[0])
        columns["vehicle_speed_kmh"].append(3.6 * speed.values)
        columns["engine_speed_rpm"].append(1000.0 + 50.0 * speed.values)
    path = tmp_path / "day.csv"
    write_table({k: np.concatenate(v) for k, v in columns.items()}, path)
    parts = read_drives(path)
    assert [p.name for p in parts] == [f"day part {k} of 3" for k in (1, 2, 3)]
    for part, trip in zip(parts, trips, strict=True):
        assert part.duration == pytest.approx(trip.signals["vehicle_speed"].duration, abs=0.1)
        assert not any(p.id == "clock.backwards" for p in part.problems)
    assert any(p.id == "clock.backwards" for p in wb.read_drive(path).problems)


def test_rows_out_of_order_are_no_drives(trips, tmp_path):
    speed = trips[0].signals["vehicle_speed"]
    time = speed.time.copy()
    time[50:60] += 200.0
    path = tmp_path / "trip.csv"
    write_table({"time_s": time, "vehicle_speed_kmh": 3.6 * speed.values}, path)
    assert len(read_drives(path)) == 1


def test_a_few_spikes_are_left_out_and_told(trips):
    trip = trips[0]
    speed = trip.signals["vehicle_speed"]
    places = np.linspace(50, len(speed) - 50, 4).astype(int)
    values = speed.values.copy()
    values[places] = np.where(values[places] < 20.0, 55.0, 1.0)
    bad = trip.with_signals(replace(speed, values=values))
    told = check_drive(bad)
    assert not any(p.serious for p in told)
    assert any(p.id == "range.spikes" and p.values["count"] == 4 for p in told)
    assert not any(p.id == "range.spikes" for p in check_drive(trip))
    # What stays is a step, and no spike.
    values = speed.values + np.where(np.arange(len(speed)) > len(speed) // 2, 20.0, 0.0)
    assert not any(
        p.id == "range.spikes"
        for p in check_drive(trip.with_signals(replace(speed, values=values)))
    )


def test_zeros_where_no_value_was_are_left_out(trips):
    speed = trips[0].signals["vehicle_speed"]
    lost = (np.random.default_rng(3).random(len(speed)) < 0.05) & (speed.values > 8.0)
    zeros = replace(speed, values=np.where(lost, 0.0, speed.values))
    kept = correct_drive(trips[0].with_signals(zeros))
    assert len(kept.signals["vehicle_speed"]) == len(speed) - np.count_nonzero(lost)
    assert (kept.signals["vehicle_speed"].values == speed.values[~lost]).all()
    spikes = [p for p in kept.problems if p.id == "range.spikes"]
    assert [p.signal for p in spikes] == ["vehicle_speed"]


def from_standstill(trips, *names):
    """Recordings that each begin at standstill and end amid driving, on one clock."""
    cut = []
    for trip in trips:
        speed = trip.signals["vehicle_speed"]
        fast = speed.time[(speed.values > 15.0) & (speed.time > trip.start + 120.0)]
        signals = {
            n: Signal(n, s.time[s.time < fast[10]], s.values[s.time < fast[10]])
            for n, s in trip.signals.items()
            if n in names
        }
        cut.append(replace(trip, signals=signals))
    return behind(cut, 0.25), cut


def test_recordings_that_begin_at_standstill_are_parted(trips):
    day, cut = from_standstill(trips, "vehicle_speed", "engine_speed", "engine_load")
    cuts = find_splices(day)
    assert [c.why for c in cuts] == ["starts from standstill amid driving"] * 2
    ends = np.cumsum([trip.duration + 0.25 for trip in cut])[:2]
    assert [c.begin for c in cuts] == pytest.approx(ends, abs=1.0)
    assert [p.name for p in parted(day)] == [f"day part {k} of 3" for k in (1, 2, 3)]
    # Nothing else tells a splice from a speed that drops out.
    alone, _ = from_standstill(trips, "vehicle_speed")
    assert not find_splices(alone)


@pytest.mark.parametrize("lasts", [3.0, 20.0, 60.0])
def test_a_speed_that_drops_out_is_no_splice(trips, lasts):
    for trip in trips:
        speed = trip.signals["vehicle_speed"]
        for start in trip.start + np.arange(60.0, 400.0, 20.0):
            gone = (speed.time >= start) & (speed.time < start + lasts)
            dropped = Signal("vehicle_speed", speed.time, np.where(gone, 0.0, speed.values))
            assert not find_splices(trip.with_signals(dropped))
