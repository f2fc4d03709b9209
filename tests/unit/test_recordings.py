"""A recording in several drives: nothing is lost between them, and only old ones go."""

import os
import signal
from functools import partial

import numpy as np
import pytest
from tests.unit.test_recorder import Clock, run, second

from weighbridge import read_drive
from weighbridge.live import Recordings

DAY = 86_400.0
HOUR = 3600.0
SECONDS = 200


def named(tmp_path):
    return sorted(f.name for f in tmp_path.iterdir())


def fed(recordings, clock, seconds, begin=0):
    for k in range(begin, begin + seconds):
        clock.now = float(k)
        recordings.put(second(k))
        # At this pace the disk keeps up, as in a vehicle.
        recordings._recorder._writer.submit(int).result()
        for _, joined in recordings._closing:
            joined.result()


def instants(folder, name="accel_x"):
    """Instants of a signal since the beginning of all, from any drive."""
    drive = read_drive(folder)
    begun = np.datetime64(drive.info.start_time.removesuffix("+00:00")).astype("datetime64[s]")
    return drive.signals[name].time + begun.astype(float)


def test_a_new_drive_begins_where_one_is_large_and_no_sample_is_lost(tmp_path):
    clock = Clock()
    with Recordings(tmp_path / "trip", split=30e3, clock=clock) as recordings:
        fed(recordings, clock, SECONDS)
    folders = recordings.folders
    assert len(folders) > 3
    assert [f.name for f in folders] == [
        "trip",
        *(f"trip-{k + 2}" for k in range(len(folders) - 1)),
    ]
    for name in ("accel_x", "vehicle_speed"):
        found = np.concatenate([instants(f, name) for f in folders])
        expected = np.concatenate([second(k)[name][0] for k in range(SECONDS)])
        assert found == pytest.approx(expected, abs=1e-5)
    # Each is whole: no parts are left.
    assert all(read_drive(f).problems == () for f in folders)


KILLED = """
import os, signal, sys
from pathlib import Path
from weighbridge.live import Recordings
from tests.unit.test_recorder import Clock
from tests.unit.test_recordings import fed
clock = Clock()
recordings = Recordings(Path(sys.argv[1]), split=30e3, clock=clock)
fed(recordings, clock, 200)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_series_lacks_at_most_its_last_minute_and_goes_on(tmp_path, pytestconfig):
    ran = run(KILLED, tmp_path / "trip", root=pytestconfig.rootpath)
    assert ran.returncode == -signal.SIGKILL, ran.stderr
    folders = sorted(tmp_path.iterdir(), key=lambda f: int(f.name.partition("-")[2] or 1))
    assert len(folders) > 3
    kept = [f for f in folders if any(f.iterdir())]
    found = np.concatenate([instants(f) for f in kept])
    expected = np.concatenate([second(k)["accel_x"][0] for k in range(SECONDS)])
    assert found == pytest.approx(expected[: found.size], abs=1e-5)
    assert found.size > expected.size - 60 * 50
    clock = Clock()
    with Recordings(tmp_path / "trip", clock=clock) as recordings:
        fed(recordings, clock, 2)
    assert recordings.folders == [tmp_path / f"trip-{len(kept) + 1}"]


def aged(folder, date):
    for file in folder.rglob("*"):
        os.utime(file, (date, date))


@pytest.fixture
def old(tmp_path):
    """Make a series of four drives, and folders of others that are as old."""
    clock = Clock()
    for k in range(4):
        with Recordings(tmp_path / "trip", clock=clock) as recordings:
            fed(recordings, clock, 2, 10 * k)
    (tmp_path / "trip-3" / "notes.txt").write_text("mine")
    for name in ("trips", "other", "trip-x"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "obd.parquet").write_bytes(b"")
    now = 1_790_000_000.0
    for folder in tmp_path.iterdir():
        aged(folder, now - 40.0 * DAY)
    aged(tmp_path / "trip-4", now - 20.0 * DAY)
    return now


def test_old_drives_of_the_series_go_and_nothing_else(tmp_path, old):
    clock = Clock()
    with Recordings(
        tmp_path / "trip", keep=30.0 * DAY, clock=clock, date=lambda: old
    ) as recordings:
        fed(recordings, clock, 2, 100)
        # trip-3 holds something of its owner.
        rest = ["other", "trip-3", "trip-4", "trip-5", "trip-x", "trips"]
        assert named(tmp_path) == rest
        assert recordings.folders == [tmp_path / "trip-5"]
        aged(tmp_path / "trip-4", old - 31.0 * DAY)
        clock.now += HOUR
        recordings.tick()
        assert named(tmp_path) == [n for n in rest if n != "trip-4"]


def test_nothing_goes_unless_it_is_asked_for_or_where_no_clock_was_set(tmp_path, old):
    before = named(tmp_path)
    with Recordings(tmp_path / "trip", date=lambda: old):
        pass
    assert named(tmp_path) == before
    keep = partial(Recordings, tmp_path / "trip", keep=30.0 * DAY)
    with keep(date=lambda: 1000.0):
        pass
    assert named(tmp_path) == before
    aged(tmp_path / "trip", 1000.0)
    with keep(date=lambda: old):
        pass
    assert named(tmp_path) == [n for n in before if n != "trip-2"]
