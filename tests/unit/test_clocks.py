"""Drives of several files whose clocks differ."""

import numpy as np
import polars as pl
import pytest
from tests.noted import refused, says
from tests.unit.test_alignment import road_speed

from weighbridge import ConfigError, read_drive
from weighbridge.messages import phrase

WHEEL = np.arange(0.0, 600.0, 0.25)
FIX = np.arange(100.0, 500.0, 1.0)


def obd(folder, start=0.0, name="obd.csv", speed=None):
    v = road_speed(WHEEL) if speed is None else speed
    frame = {"time_s": WHEEL + start, "vehicle_speed_kmh": 3.6 * v, "engine_speed_rpm": 100.0 * v}
    pl.DataFrame(frame).write_csv(folder / name)
    return folder / name


def gnss(folder, offset=0.0, name="fixes.csv"):
    """Speed over ground on a clock that lags by ``offset``."""
    noise = np.random.default_rng(4).normal(scale=0.1, size=FIX.size)
    frame = {"time_s": FIX - offset, "gnss_speed_mps": np.maximum(road_speed(FIX) + noise, 0.0)}
    pl.DataFrame(frame).write_csv(folder / name)
    return folder / name


def gpx(folder, offset=0.0, begin="2021-03-05T10:00:00"):
    """A winding track at 60 degrees north, without speeds: points alone must give them."""
    start = np.datetime64(begin, "ms")
    fine = np.arange(100.0, 500.0, 0.01)
    step = 0.01 * road_speed(fine + 0.005)
    heading = 2.0 * np.pi * fine / 150.0
    places = []
    for part, stretch in ((np.cos(heading), 1.0), (np.sin(heading), 2.0)):
        way = np.concatenate([[0.0], np.cumsum(step * part)])
        arc = np.interp(FIX, 100.0 + 0.01 * np.arange(way.size), way) / 6_371_008.8
        places.append(stretch * np.degrees(arc))
    points = "".join(
        f'<trkpt lat="{60.0 + n:.9f}" lon="{11.0 + e:.9f}"><time>'
        f"{start + np.timedelta64(round(1000 * (t - offset)), 'ms')}Z</time></trkpt>"
        for t, n, e in zip(FIX, *places, strict=True)
    )
    path = folder / "track.gpx"
    path.write_text(f'<gpx version="1.1" creator="t"><trk><trkseg>{points}</trkseg></trk></gpx>')
    return path


def told(drive):
    return [p for p in drive.problems if p.id in ("clock.aligned", "clock.align_offered")]


def moved_by(drive):
    """Offset and the standard deviation of its fit as the note tells them."""
    note = told(drive)[0]
    # Sensors may be late by tenths of a second, and are here by none.
    assert says(note.text, "offset_with_std", clocks=np.hypot(note.values["std"], 0.3))
    return note.values["by"], note.values["std"]


def test_a_file_the_mapping_names_is_aligned(tmp_path):
    obd(tmp_path)
    gnss(tmp_path, 33.3)
    mapping = {"tables": {"gps": {"files": "fixes.csv", "time": {"align": True}}}}
    drive = read_drive([tmp_path / "obd.csv", tmp_path / "fixes.csv"], mapping)
    offset, std = moved_by(drive)
    assert abs(offset - 33.3) < 4.0 * std + 0.01
    assert abs(drive.signals["gnss_speed"].time[0] - 100.0) < 4.0 * std + 0.01
    assert drive.signals["vehicle_speed"].time[0] == 0.0
    assert not any(p.serious for p in drive.problems)


def test_without_the_mapping_clocks_that_overlap_are_believed(tmp_path):
    drive = read_drive([obd(tmp_path), gnss(tmp_path, 33.3)])
    assert told(drive) == []
    assert abs(drive.signals["gnss_speed"].time[0] - 66.7) < 1e-9


def test_files_that_share_no_time_are_aligned(tmp_path):
    drive = read_drive([obd(tmp_path), gnss(tmp_path, -40_000.0)])
    offset, std = moved_by(drive)
    assert abs(offset + 40_000.0) < 4.0 * std + 0.01
    assert abs(drive.signals["gnss_speed"].time[0] - 100.0) < 4.0 * std + 0.01


def test_parts_of_one_recording_are_not_moved(tmp_path):
    drive = read_drive([obd(tmp_path), obd(tmp_path, 1000.0, "more.csv")])
    assert told(drive) == []
    assert drive.duration == pytest.approx(1599.75)


@pytest.mark.parametrize("offset", [0.0, 17.5])
def test_seconds_are_put_onto_dates(tmp_path, offset):
    drive = read_drive([obd(tmp_path), gpx(tmp_path, offset)])
    assert drive.info.start_time is not None
    speed, lat = drive.signals["vehicle_speed"], drive.signals["latitude"]
    assert abs((lat.time[0] - speed.time[0]) - 100.0) < 0.1
    note = told(drive)[0].values
    assert "track.gpx" in (note["group"], note["fixed"])


def test_dates_that_disagree_by_minutes_are_a_serious_doubt(tmp_path):
    path = obd(tmp_path)
    text = path.read_text().splitlines()
    rows = [r.split(",") for r in text[1:]]
    start = np.datetime64("2021-03-05T10:02:00", "ms")
    stamps = [start + np.timedelta64(round(1000 * float(r[0])), "ms") for r in rows]
    body = [f"{t}Z,{r[1]}" for t, r in zip(stamps, rows, strict=True)]
    path.write_text("\n".join(["when,v", *body]))
    mapping = {
        "time": {"column": "when", "format": "iso"},
        "signals": {"vehicle_speed": {"column": "v", "unit": "kmh"}},
    }
    files = [path, gpx(tmp_path)]
    drive = read_drive(files, mapping)
    assert [p.serious for p in told(drive)] == [True]
    assert told(drive)[0].values["by"] == pytest.approx(120.0, abs=0.01)
    assert read_drive([path, gpx(tmp_path, -120.0)], mapping).problems == ()


def test_nothing_in_common_is_refused(tmp_path):
    (tmp_path / "imu.csv").write_text("time_s,accel_x_mps2\n0,1\n1,2\n")
    with refused("clock.nothing_shared"):
        read_drive([tmp_path / "imu.csv", gpx(tmp_path)])


def test_an_ambiguous_offset_is_refused(tmp_path):
    wave = 15.0 + 5.0 * np.sin(2 * np.pi * WHEEL / 40.0)
    obd(tmp_path, speed=wave)
    v = 15.0 + 5.0 * np.sin(2 * np.pi * FIX / 40.0)
    frame = pl.DataFrame({"time_s": FIX - 40_000.0, "gnss_speed_mps": v})
    frame.write_csv(tmp_path / "fixes.csv")
    files = [tmp_path / "obd.csv", tmp_path / "fixes.csv"]
    drive = read_drive(files)
    assert [p.serious for p in drive.problems] == [True]
    assert drive.problems[0].id == "clock.not_aligned"
    assert drive.signals["gnss_speed"].time[0] == FIX[0] - 40_000.0
    mapping = {"tables": {"gps": {"files": "fixes.csv", "time": {"align": True}}}}
    with refused("clock.not_aligned"):
        read_drive(files, mapping)


def test_a_gyroscope_is_aligned_by_turning(tmp_path):
    """A gyroscope of unknown mounting against the course over ground."""
    t = np.arange(0.0, 600.0, 0.02)
    rng = np.random.default_rng(0)
    turn = 0.1 * (road_speed(t, 5) - 15.0)
    axis = np.array([0.2, -0.9, 0.4]) / np.linalg.norm([0.2, -0.9, 0.4])
    rates = turn[:, None] * axis + rng.normal(scale=0.02, size=(t.size, 3)) + [0.01, 0.0, -0.02]
    imu = {"time_s": t + 5000.0, **{f"gyro_{a}_radps": rates[:, k] for k, a in enumerate("xyz")}}
    pl.DataFrame(imu).write_csv(tmp_path / "imu.csv")
    course = np.interp(FIX, t, np.cumsum(turn) * 0.02) % (2 * np.pi)
    frame = {"time_s": FIX, "speed_mps": np.full(FIX.size, 12.0), "course_rad": course}
    pl.DataFrame(frame).write_csv(tmp_path / "gnss.csv")
    drive = read_drive([tmp_path / "imu.csv", tmp_path / "gnss.csv"])
    offset, std = moved_by(drive)
    assert abs(offset - 5000.0) < 4.0 * std + 0.02
    assert told(drive)[0].id == "clock.aligned"


def test_the_clock_alone_may_stand_in_a_mapping(tmp_path):
    gnss(tmp_path)
    mapping = {"tables": {"gps": {"files": "*.csv", "time": {"offset_s": 7.0}}}}
    drive = read_drive(tmp_path / "fixes.csv", mapping)
    assert drive.signals["gnss_speed"].time[0] == 107.0


@pytest.mark.parametrize("time", [{}, {"column": "t"}, {"align": False}])
def test_a_mapping_without_signals_and_clock_is_refused(tmp_path, time):
    gnss(tmp_path)
    with pytest.raises(ConfigError, match="is missing: name at least one column"):
        read_drive(tmp_path / "fixes.csv", {"tables": {"gps": {"files": "*.csv", "time": time}}})


CLOCK_MAP = """
[tables.obd]
files = "obd.csv"
[tables.obd.time]
column = "time"
format = "clock"
[tables.obd.signals.engine_load]
column = "load"
unit = "pct"

[tables.gps]
files = "gps.csv"
[tables.gps.time]
column = "t"
unit = "s"
[tables.gps.signals.latitude]
column = "lat"
unit = "deg"
[tables.gps.signals.longitude]
column = "lon"
unit = "deg"
"""


def on_the_clock(folder, zone, minutes):
    """A table of clock times of a zone [h] beside one with epoch stamps, both of one drive."""
    start = 1_700_000_000.0
    time = np.arange(0.0, 60.0 * minutes, 0.5)
    day = (start + 12.0 + time + 3600.0 * zone) % 86_400.0
    stamps = [f"{int(s // 3600):02d}:{int(s // 60 % 60):02d}:{s % 60.0:06.3f}" for s in day]
    rows = [f"{s},{50 + k % 20}" for k, s in enumerate(stamps)]
    (folder / "obd.csv").write_text("time,load\n" + "\n".join(rows) + "\n")
    rows = [f"{start + t:.1f},{47 + 1e-5 * t:.6f},{8 + 1e-5 * t:.6f}" for t in time]
    (folder / "gps.csv").write_text("t,lat,lon\n" + "\n".join(rows) + "\n")
    (folder / "map.toml").write_text(CLOCK_MAP)
    return [folder / "obd.csv", folder / "gps.csv"], folder / "map.toml"


@pytest.mark.parametrize("zone", [0.0, 2.0, -7.0, 5.5, 13.0])
def test_times_of_day_are_put_on_the_day_of_dates(tmp_path, zone):
    drive = read_drive(*on_the_clock(tmp_path, zone, 20.0))
    shift = drive.signals["engine_load"].time[0] - drive.signals["latitude"].time[0]
    assert shift == pytest.approx(12.0, abs=0.01)
    note = next(p for p in drive.problems if p.id == "clock.day_found")
    assert "2023-11-1" in str(note.values["day"])
    assert not any(p.serious for p in drive.problems)


def test_times_of_day_that_fit_twice_are_refused(tmp_path):
    with refused("clock.day_ambiguous", many=phrase("several_half_hours")) as caught:
        read_drive(*on_the_clock(tmp_path, 1.0, 120.0))
    assert len(str(caught.value).splitlines()) == 1


MOVING_MAP = """
[tables.obd]
files = "obd.csv"
[tables.obd.time]
column = "time"
format = "clock"
[tables.obd.signals.vehicle_speed]
column = "v"
unit = "kmh"
"""


def clock_and_track(folder, apart, extra=""):
    """Wheel speeds by an hour ahead of UTC and ``apart`` [s] beside a track with dates."""
    day = 11.0 * 3600.0 + WHEEL + apart
    stamps = [f"{int(s // 3600):02d}:{int(s // 60 % 60):02d}:{s % 60.0:06.3f}" for s in day]
    rows = [f"{s},{3.6 * v:.3f}" for s, v in zip(stamps, road_speed(WHEEL), strict=True)]
    (folder / "obd.csv").write_text("time,v\n" + "\n".join(rows) + "\n")
    text = MOVING_MAP.replace('format = "clock"', f'format = "clock"\n{extra}')
    (folder / "map.toml").write_text(text)
    return read_drive([folder / "obd.csv", gpx(folder)], folder / "map.toml")


@pytest.mark.parametrize("apart", [-2.0, -0.55, -0.3, 0.0, 0.3, 0.55, 0.65])
def test_times_of_day_are_aligned_however_little_they_are_apart(tmp_path, apart):
    drive = clock_and_track(tmp_path, apart)
    _, std = moved_by(drive)
    first = drive.signals["latitude"].time[0] - drive.signals["vehicle_speed"].time[0]
    assert abs(first - 100.0) < 4.0 * std + 0.02
    assert not any(p.serious for p in drive.problems)


def test_times_of_day_stay_where_a_mapping_puts_them(tmp_path):
    drive = clock_and_track(tmp_path, 0.3, "offset_s = -0.1")
    first = drive.signals["latitude"].time[0] - drive.signals["vehicle_speed"].time[0]
    assert abs(first - 99.8) < 0.001


@pytest.mark.parametrize(("apart", "told_of"), [(0.3, []), (1.0, [False]), (3.0, [True])])
def test_dates_that_disagree_by_a_second_are_told(tmp_path, apart, told_of):
    start = np.datetime64("2021-03-05T10:00:00", "ms")
    stamps = [start + np.timedelta64(round(1000 * (t + apart)), "ms") for t in WHEEL]
    rows = [f"{t}Z,{3.6 * v:.3f}" for t, v in zip(stamps, road_speed(WHEEL), strict=True)]
    (tmp_path / "obd.csv").write_text("time,v\n" + "\n".join(rows) + "\n")
    (tmp_path / "map.toml").write_text(MOVING_MAP.replace("clock", "iso"))
    drive = read_drive([tmp_path / "obd.csv", gpx(tmp_path)], tmp_path / "map.toml")
    assert [p.serious for p in told(drive)] == told_of
