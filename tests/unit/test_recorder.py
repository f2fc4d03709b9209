"""Recording live samples: what is read back, also after the process was killed."""

import os
import signal
import subprocess
import sys
from threading import Event

import numpy as np
import polars as pl
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import error

from weighbridge import DriveError, DriveInfo, read_drive
from weighbridge.io import join_parts, read_table, write_drive
from weighbridge.live import Recorder, Recordings

BEGIN = 1_790_000_000.25


def second(k, rate=50, begin=BEGIN):
    """One second of an inertial sensor and of OBD, values that tell their instant."""
    t = begin + k + np.arange(rate) / rate
    slow = begin + k + np.array([0.1, 0.6])
    return {
        **{f"accel_{a}": (t, np.sin(t - begin) + n) for n, a in enumerate("xyz")},
        "vehicle_speed": (slow, 10.0 + np.cos(slow - begin)),
        "engine_speed": (slow + 0.2, 200.0 + (slow - begin)),
    }


class Clock:
    """A clock that is set."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def record(folder, seconds, clock, **kwargs):
    recorder = Recorder(folder, clock=clock, **kwargs)
    for k in range(seconds):
        clock.now = float(k)
        recorder.put(second(k))
    return recorder


def parts(folder):
    """Parts of the inertial table of a recording, oldest first."""
    return sorted((folder / "drive" / "imu.parts").glob("*.parquet"))


def assert_holds(drive, seconds):
    """The signals of ``seconds``, as far as they go."""
    for name in ("accel_x", "vehicle_speed", "engine_speed"):
        t = np.concatenate([second(k)[name][0] for k in range(seconds)])
        v = np.concatenate([second(k)[name][1] for k in range(seconds)])
        s = drive.signals[name]
        assert_allclose(s.time, t[: len(s)] - np.floor(BEGIN), atol=1e-6)
        assert_allclose(s.values, v[: len(s)], rtol=1e-12)


def test_a_recording_is_a_canonical_drive(tmp_path):
    info = DriveInfo(vehicle="Van", mass=2100.0)
    # A name that would be a pattern.
    with record(tmp_path / "drive [2]", 200, Clock(), info=info):
        pass
    (tmp_path / "drive [2]").rename(tmp_path / "drive")
    assert sorted(f.name for f in (tmp_path / "drive").iterdir()) == [
        "drive.toml", "imu.parquet", "obd.parquet",
    ]  # fmt: skip
    assert "vehicle_speed_kmh" in read_table(tmp_path / "drive" / "obd.parquet")
    drive = read_drive(tmp_path / "drive")
    assert drive.problems == ()
    assert drive.info.start_time == "2026-09-21T14:13:20+00:00"
    assert (drive.info.vehicle, drive.info.mass) == ("Van", 2100.0)
    assert len(drive.signals["accel_x"]) == 200 * 50
    assert_holds(drive, 200)


def test_parts_are_written_on_the_way_and_read_as_a_drive(tmp_path):
    recorder = record(tmp_path / "drive", 100, Clock())
    recorder._writer.submit(int).result()
    assert len(parts(tmp_path)) == 3
    drive = read_drive(tmp_path / "drive")
    assert_holds(drive, 100)
    assert drive.duration > 85.0
    assert [p.id for p in drive.problems] == ["file.recording_cut"] * 2
    assert not any(p.serious for p in drive.problems)
    recorder.close()


def test_late_samples_of_a_part_before_come_to_their_place(tmp_path):
    clock = Clock()
    recorder = Recorder(tmp_path / "drive", clock=clock, period=10.0)
    blocks = [second(k) for k in range(60)]
    rng = np.random.default_rng(1)
    # Every tenth second comes three seconds late, backwards.
    order = sorted(range(60), key=lambda k: k + (3.5 if k % 10 == 9 else 0.0))
    for n, k in enumerate(order):
        clock.now = float(n)
        turned = rng.permutation(50)
        recorder.put({name: (t, v) for name, (t, v) in blocks[k].items() if t.size < 50})
        recorder.put({n: (t[turned], v[turned]) for n, (t, v) in blocks[k].items() if t.size == 50})
    recorder._flush()
    recorder._writer.submit(int).result()
    broken = read_drive(tmp_path / "drive")
    recorder.close()
    whole = read_drive(tmp_path / "drive")
    for drive in (broken, whole):
        assert len(drive.signals["accel_z"]) == 60 * 50
        assert_holds(drive, 60)
    frame = pl.read_parquet(tmp_path / "drive" / "imu.parquet")
    assert frame["time_s"].is_sorted()
    assert not frame["time_s"].is_duplicated().any()


def test_signals_that_begin_late_or_share_a_stamp_across_parts_get_a_column(tmp_path):
    clock = Clock()
    recorder = Recorder(tmp_path / "drive", clock=clock, period=1.0)
    for k, samples in enumerate(
        (
            {"vehicle_speed": (np.array([5.0]), np.array([1.0]))},
            {"throttle": (np.array([5.0]), np.array([0.5]))},
            {"vehicle_speed": (np.array([6.0, 6.0]), np.array([2.0, 3.0]))},
        )
    ):
        clock.now = 2.0 * k + 2.0
        recorder.put(samples)
    recorder.close()
    frame = pl.read_parquet(tmp_path / "drive" / "obd.parquet")
    assert frame["time_s"].to_list() == [5.0, 6.0]
    drive = read_drive(tmp_path / "drive")
    assert_allclose(drive.signals["vehicle_speed"].values, [1.0, 3.0])
    assert_allclose(drive.signals["throttle"].values, [0.5])
    assert drive.info.start_time is None


def test_what_is_not_finite_or_not_known_is_left_out_and_told_once(tmp_path, caplog):
    with Recorder(tmp_path / "drive", clock=Clock()) as recorder:
        for k in range(3):
            t = 10.0 * k + np.arange(3.0)
            recorder.put({"gnss_speed": (t, np.array([1.0, np.nan, 2.0]))})
            recorder.put({"fuel_taste": (t, t), "hdop": (t * np.nan, t)})
    assert [r.message.split()[0] for r in caplog.records] == ["fuel_taste"]
    drive = read_drive(tmp_path / "drive")
    assert set(drive.signals) == {"gnss_speed"}
    assert_array_equal(drive.signals["gnss_speed"].values, [1.0, 2.0] * 3)


def test_arrays_that_the_caller_fills_again_are_kept(tmp_path):
    t, values = np.arange(2.0), np.ones(2)
    with Recorder(tmp_path / "drive", clock=Clock()) as recorder:
        recorder.put({"gear": (t, values)})
        values[:] = 4.0
    assert_array_equal(read_drive(tmp_path / "drive").signals["gear"].values, [1.0, 1.0])


def test_samples_wait_no_longer_when_no_more_come(tmp_path):
    clock = Clock()
    recorder = Recorder(tmp_path / "drive", clock=clock)
    recorder.put(second(0))
    clock.now = 31.0
    recorder.tick()
    recorder._writer.submit(int).result()
    assert len(read_drive(tmp_path / "drive").signals["accel_x"]) == 50
    recorder.close()


def test_a_flood_is_written_before_its_time(tmp_path):
    recorder = Recorder(tmp_path / "drive", clock=Clock())
    t = np.arange(700_000) * 1e-3
    recorder.put({f"accel_{a}": (t, t) for a in "xyz"})
    assert recorder._held == 0
    recorder.close()
    assert len(read_drive(tmp_path / "drive").signals["accel_x"]) == t.size


def test_a_recording_replaces_nothing(tmp_path, brief_drive):
    write_drive(brief_drive, tmp_path / "drive")
    before = {f.name: f.read_bytes() for f in (tmp_path / "drive").iterdir()}
    with error(DriveError, "drive"):
        Recorder(tmp_path / "drive")
    assert {f.name: f.read_bytes() for f in (tmp_path / "drive").iterdir()} == before
    with error(DriveError, "obd.csv"):
        Recorder(tmp_path / "drive" / "obd.csv")


def test_two_recordings_into_one_folder_do_not_mix(tmp_path):
    first, second_one = (Recorder(tmp_path / "drive", clock=Clock()) for _ in range(2))
    first.put(second(0))
    first.close()
    second_one.put(second(1))
    second_one._flush()
    second_one._writer.submit(int).result()
    # The tables are joined, so that the parts of the other may lie beside and are not read.
    assert_holds(read_drive(tmp_path / "drive"), 1)
    second_one._problem = second_one._problem or "left"
    second_one.close()


FULL = """
import resource, signal, sys
from weighbridge.live.recorder import Recorder, free_folder
from tests.unit.test_recorder import Clock, second
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
clock = Clock()
recorder = Recorder(sys.argv[1], clock=clock)
for k in range(300):
    clock.now = float(k)
    if k == 100:
        recorder._writer.submit(int).result()
        resource.setrlimit(resource.RLIMIT_FSIZE, (2000, resource.RLIM_INFINITY))
    recorder.put(second(k))
    recorder._writer.submit(int).result()
    if k == 200:
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)
recorder.close()
print(recorder.problem)
"""


def run(code, *words, root):
    path = os.pathsep.join((os.environ.get("PYTHONPATH", ""), str(root)))
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, words)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": path},
    )


def test_a_full_disk_ends_the_recording_with_one_sentence(tmp_path, pytestconfig):
    ran = run(FULL, tmp_path / "drive", root=pytestconfig.rootpath)
    assert ran.returncode == 0, ran.stderr
    assert "cannot be written" in ran.stdout
    assert "recording has ended, what was written before is kept" in ran.stdout
    assert ran.stderr.count("recording has ended") == 1
    drive = read_drive(tmp_path / "drive")
    assert_holds(drive, 300)
    assert 85.0 < drive.duration < 125.0


def test_a_disk_that_fills_up_at_the_end_leaves_the_parts(tmp_path, monkeypatch):
    recorder = record(tmp_path / "drive", 100, Clock())

    def full(*_):
        raise DriveError("the disk is full")

    monkeypatch.setattr("weighbridge.live.recorder.join_parts", full)
    recorder.close()
    assert "the parts of" in recorder.problem
    drive = read_drive(tmp_path / "drive")
    assert len(drive.signals["accel_x"]) == 5000
    assert_holds(drive, 100)


def test_a_disk_that_hangs_ends_the_recording(tmp_path, monkeypatch):
    monkeypatch.setattr("weighbridge.live.recorder._PATIENCE", 0.01)
    answers = Event()
    monkeypatch.setattr(Recorder, "_write", lambda *_: answers.wait() and None)
    recorder = record(tmp_path / "drive", 400, Clock())
    assert "cannot be written as fast as samples come: recording has ended" in recorder.problem
    assert recorder._held == 0
    answers.set()
    recorder.close()


KILLED = """
import os, signal, sys
from weighbridge.live.recorder import Recorder, free_folder
from tests.unit.test_recorder import Clock, second
clock = Clock()
recorder = Recorder(sys.argv[1], clock=clock)
for k in range(635):
    clock.now = float(k)
    recorder.put(second(k))
    # At this pace the disk keeps up, as in a vehicle.
    recorder._writer.submit(int).result()
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_recording_lacks_at_most_its_last_minute(tmp_path, pytestconfig):
    ran = run(KILLED, tmp_path / "drive", root=pytestconfig.rootpath)
    assert ran.returncode == -signal.SIGKILL, ran.stderr
    drive = read_drive(tmp_path / "drive")
    assert_holds(drive, 635)
    assert drive.duration > 635.0 - 60.0


FOREVER = """
import sys
from itertools import count
from threading import Event
from weighbridge.live.recorder import Recorder, free_folder
from tests.unit.test_recorder import Clock, second
clock = Clock()
recorder = Recorder(sys.argv[1], clock=clock)
for k in count():
    clock.now = float(k)
    recorder.put(second(k))
    recorder._writer.submit(int).result()
    print(k, flush=True)
"""


@pytest.mark.parametrize("after", [95, 151, 333])
def test_a_recording_killed_while_it_writes_is_read(tmp_path, pytestconfig, after):
    path = os.pathsep.join((os.environ.get("PYTHONPATH", ""), str(pytestconfig.rootpath)))
    words = [sys.executable, "-c", FOREVER, str(tmp_path / "drive")]
    env = {**os.environ, "PYTHONPATH": path}
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=env) as child:
        for _ in zip(range(after), child.stdout, strict=False):
            pass
        child.kill()
    drive = read_drive(tmp_path / "drive")
    assert drive.duration > after - 60.0
    assert_holds(drive, after + 5000)


def test_a_part_that_is_no_table_is_left_out_and_told(tmp_path):
    recorder = record(tmp_path / "drive", 100, Clock())
    recorder._writer.submit(int).result()
    parts(tmp_path)[1].write_bytes(b"PAR1 torn")
    drive = read_drive(tmp_path / "drive")
    assert any(
        p.id == "file.part_damaged" and p.values["part"] == "000002.parquet" for p in drive.problems
    )
    assert len(drive.signals["accel_x"]) < len(drive.signals["vehicle_speed"]) * 25
    recorder._problem = "left"
    recorder.close()


def test_joining_again_or_nothing_changes_nothing(tmp_path):
    with record(tmp_path / "drive", 70, Clock()):
        pass
    before = read_drive(tmp_path / "drive")
    for table in ("imu", "gnss"):
        join_parts(tmp_path / "drive", table)
    assert_array_equal(
        read_drive(tmp_path / "drive").signals["accel_y"].values, before.signals["accel_y"].values
    )


def test_tables_joined_before_the_process_was_killed_are_read_once(tmp_path):
    recorder = record(tmp_path / "drive", 100, Clock())
    recorder._flush()
    recorder._writer.submit(int).result()
    kept = [(p, p.read_bytes()) for p in parts(tmp_path)]
    join_parts(tmp_path / "drive", "imu")
    for path, data in kept:
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(data)
    drive = read_drive(tmp_path / "drive")
    assert len(drive.signals["accel_x"]) == 5000
    assert_holds(drive, 100)
    recorder._problem = "left"
    recorder.close()


def test_a_drive_is_not_written_over_the_parts_of_another(tmp_path, brief_drive):
    recorder = record(tmp_path / "drive", 70, Clock())
    recorder._writer.submit(int).result()
    with error(DriveError, "drive imu.parts"):
        write_drive(brief_drive, tmp_path / "drive")
    recorder._problem = "left"
    recorder.close()


def test_memory_does_not_grow_with_the_drive(tmp_path):
    clock = Clock()
    recorder = Recorder(tmp_path / "drive", clock=clock)
    held = []
    for k in range(400):
        clock.now = float(k)
        recorder.put(second(k))
        held.append(recorder._held)
    # 154 samples a second, for half a minute.
    assert max(held) <= 31 * 154
    recorder.close()


def test_a_recording_goes_on_beside_one_that_is_there(tmp_path):
    """A service that starts again after a power cut keeps what was recorded."""
    asked = tmp_path / "drive"
    for k, name in enumerate(("drive", "drive-2", "drive-3")):
        with Recordings(asked) as recordings:
            recordings.put(second(k))
        assert recordings.folders == [tmp_path / name]
    starts = [read_drive(tmp_path / n).info.start_time for n in ("drive", "drive-2", "drive-3")]
    assert len(set(starts)) == 3


def test_a_folder_that_was_made_for_nothing_goes(tmp_path):
    with Recorder(tmp_path / "drive"):
        pass
    assert not (tmp_path / "drive").exists()
    (tmp_path / "there").mkdir()
    with Recorder(tmp_path / "there"):
        pass
    assert (tmp_path / "there").exists()
