"""Stamps no recording makes and values no vehicle has: left out and told, or refused at once."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from tests.unit.test_checks import CAR, GNSS, make_drive, shifted

from weighbridge import Drive, Signal, inspect_drive, read_drive
from weighbridge.checks import check_drive, correct_drive
from weighbridge.io import write_drive
from weighbridge.signals import clean_columns

IMU = tuple(f"{kind}_{a}" for kind in ("accel", "gyro") for a in "xyz")
OBD = ("vehicle_speed", "engine_speed", "engine_load")


@pytest.fixture(scope="module")
def sane():
    return make_drive()


def stamped(drive, names, k, stamp):
    """Give sample ``k`` of some signals another stamp; those of one clock go on sharing it."""
    clocks = {}
    for name in names:
        time = drive.signals[name].time
        if id(time) not in clocks:
            clocks[id(time)] = time.copy()
            clocks[id(time)][k] = stamp
    moved = [drive.signals[n] for n in names]
    return drive.with_signals(*(replace(s, time=clocks[id(s.time)]) for s in moved))


def ids(problems):
    return {p.id for p in problems}


@pytest.mark.parametrize("stamp", [1e12, 1e300, -1e12, -1e300, 5e4])
@pytest.mark.parametrize("names", [IMU, OBD, GNSS, ("vehicle_speed",), None])
def test_a_stray_stamp_is_left_out_without_asking_for_memory(sane, names, stamp):
    names = names or tuple(sane.signals)
    k = -1 if stamp > 0.0 else 0
    tracemalloc.start()
    settled = correct_drive(stamped(sane, names, k, stamp), CAR)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e8
    assert not any(p.serious for p in settled.problems)
    assert ids(settled.problems) & {"clock.jump_cut", "clock.stray"}
    for name in names:
        s = sane.signals[name]
        assert_array_equal(settled.signals[name].values, np.delete(s.values, k))


def test_a_stray_stamp_in_mid_table_needs_no_rising_clock(sane):
    settled = correct_drive(stamped(sane, IMU, 700, 1e12), CAR)
    assert not any(p.serious for p in settled.problems)
    assert len(settled.signals["accel_x"]) == len(sane.signals["accel_x"]) - 1


@pytest.mark.parametrize("names", [IMU, OBD, None])
def test_a_clock_that_starts_in_1970_leaves_the_longer_part(sane, names):
    dated = sane.with_signals(*(replace(s, time=s.time + 1.7e9) for s in sane.signals.values()))
    early = [dated.signals[n] for n in names or sane.signals]
    faulty = dated.with_signals(
        *(
            replace(s, time=np.where(s.time < 1.7e9 + 200.0, s.time - 1.7e9, s.time))
            for s in early
            # At a speed not yet as before, no one knows how long the jump took.
            if names or s.name != "vehicle_speed"
        )
    )
    settled = correct_drive(faulty, CAR)
    assert not any(p.serious for p in settled.problems)
    assert "clock.jump_cut" in ids(settled.problems)
    assert settled.duration < 1000.0
    assert settled.signals["accel_x"].duration > 600.0


def test_parts_of_two_recordings_are_not_joined(sane):
    """Standing at the jump, they may be of two days and loads."""
    v = sane.signals["vehicle_speed"]
    stops = np.interp(v.time, [0.0, 380.0, 400.0, 420.0, 900.0], [1.0, 1.0, 0.0, 1.0, 1.0])
    drive = sane.with_signals(replace(v, values=v.values * stops))
    settled = correct_drive(shifted(drive, drive.signals, 400.0, 1e6), CAR)
    (found,) = [p for p in settled.problems if p.id == "clock.jump_cut"]
    assert (found.values["side"], found.values["length"]) == (
        "after",
        pytest.approx(500.0, abs=0.5),
    )


def test_many_hours_without_samples_are_cut_before_they_cost_memory():
    """Stamps five hours apart, each nearer than any pause that parts a drive."""
    time = np.concatenate([np.arange(0.0, 600.0, 0.1), 600.0 + 18_000.0 * np.arange(1, 200)])
    rng = np.random.default_rng(3)
    s = Signal("vehicle_speed", time, 10.0 + rng.normal(0.0, 0.1, time.size))
    settled = correct_drive(Drive("d", {s.name: s}))
    assert settled.duration == pytest.approx(600.0, abs=1.0)


def test_tables_of_other_days_end_the_checks_at_once(sane):
    late = [replace(s, time=s.time + 1e12) for n, s in sane.signals.items() if n in GNSS]
    problems = check_drive(sane.with_signals(*late), CAR)
    assert all(p.serious and p.id == "clock.apart" for p in problems)
    assert len(problems) == 2


def test_nanoseconds_end_the_checks_at_once(sane):
    ns = sane.with_signals(*(replace(s, time=s.time * 1e9) for s in sane.signals.values()))
    problems = check_drive(ns, CAR)
    assert all(p.id == "clock.milliseconds" and p.serious for p in problems)
    assert inspect_drive(ns).problems == problems


@pytest.mark.parametrize(
    ("row", "stamp"), [(500, 1e12), (500, -1e12), (0, -1e300), (0, -1e12), (-1, 1e12)]
)
def test_a_stray_stamp_in_a_file_leaves_the_rest(tmp_path, sane, row, stamp):
    write_drive(sane, tmp_path, "csv")
    path = tmp_path / "obd.csv"
    lines = path.read_text(encoding="utf-8").splitlines()
    row = row if row < 0 else row + 1
    lines[row] = f"{stamp:g}," + lines[row].split(",", 1)[1]
    lines[300] = "-7e13," + lines[300].split(",", 1)[1]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    settled = correct_drive(read_drive(tmp_path), CAR)
    assert not any(p.serious for p in settled.problems)
    assert len(settled.signals["vehicle_speed"]) == len(sane.signals["vehicle_speed"]) - 2


def test_dates_with_a_stray_year_count_from_the_recording(tmp_path):
    rows = [f"2024-05-01T10:00:{k // 10:02d}.{k % 10},{k}" for k in range(300)]
    rows[0] = "1970-01-01T00:00:00.0,0"
    (tmp_path / "obd.csv").write_text("time,vehicle_speed_mps\n" + "\n".join(rows) + "\n")
    mapping = {
        "time": {"column": "time", "format": "iso"},
        "signals": {"vehicle_speed": {"column": "vehicle_speed_mps", "unit": "mps"}},
    }
    drive = read_drive(tmp_path / "obd.csv", mapping)
    assert drive.info.start_time.startswith("2024-05-01T10:00:00")


def test_of_rows_with_one_stamp_an_empty_first_is_filled():
    time = np.array([0.0, 1.0, 1.0, 1.0, 2.0, 3.0])
    nan = np.nan
    columns = [
        ("vehicle_speed", np.array([0.0, nan, 1.0, 9.0, 2.0, 3.0])),
        ("engine_speed", np.array([5.0, 6.0, 7.0, nan, nan, 8.0])),
    ]
    signals, problems = clean_columns(time, columns, "obd.csv")
    speed, engine = signals
    assert_array_equal(speed.values, [0.0, 1.0, 2.0, 3.0])
    assert_array_equal(engine.values, [5.0, 6.0, 8.0])
    (found,) = [p for p in problems if p.id == "clock.repeated"]
    assert (found.values["count"], found.values["rows"]) == (2, 6)


@pytest.mark.parametrize("value", [1e6, 1e100, -1e300, 1e308])
@pytest.mark.parametrize(
    "name", ["accel_x", "gyro_z", "vehicle_speed", "engine_speed", "engine_load", "altitude"]
)
def test_cells_no_vehicle_has_are_left_out(sane, name, value):
    s = sane.signals[name]
    values = s.values.copy()
    values[[100, 333]] = value
    settled = correct_drive(sane.with_signals(replace(s, values=values)), CAR)
    assert_array_equal(settled.signals[name].values, np.delete(s.values, [100, 333]))
    (problem,) = settled.problems
    assert problem.values["count"] == 2
    assert not problem.serious


def test_many_cells_no_vehicle_has_stay_serious(sane):
    s = sane.signals["vehicle_speed"]
    values = s.values.copy()
    values[::20] = 1e200
    problems = check_drive(sane.with_signals(replace(s, values=values)), CAR)
    assert problems[0].serious
    assert (problems[0].id, problems[0].signal) == ("range.outside", "vehicle_speed")


def test_a_drive_made_of_broken_signals_is_mended(sane):
    """Signals made in Python may hold NaN and stamps out of order."""
    s = sane.signals["vehicle_speed"]
    time, values = s.time.copy(), s.values.copy()
    time[[50, 51]] = time[[51, 50]]
    values[70] = np.nan
    settled = correct_drive(sane.with_signals(replace(s, time=time, values=values)), CAR)
    found = settled.signals["vehicle_speed"]
    assert np.isfinite(found.values).all()
    assert (np.diff(found.time) > 0.0).all()
    assert len(found) == len(s) - 2


def test_a_drive_made_with_whole_seconds_is_spread(sane):
    """Stamps that repeat are no rate without end."""
    floored = [replace(sane.signals[n], time=np.floor(sane.signals[n].time)) for n in OBD]
    settled = correct_drive(sane.with_signals(*floored), CAR)
    assert not any(p.serious for p in settled.problems)
    found = settled.signals["vehicle_speed"]
    assert len(found) == len(sane.signals["vehicle_speed"])
    assert np.abs(found.time - sane.signals["vehicle_speed"].time).max() < 0.3
