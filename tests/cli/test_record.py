"""``weighbridge record``, from datagrams to a drive."""

import json
import math
import signal
import socket
import subprocess
import sys
import threading
from contextlib import contextmanager

import pytest
from tests.noted import named

from weighbridge import read_drive


@contextmanager
def sending(heard=None):
    """Send samples to a port of this machine as a device would; yields the port.

    The event ``heard`` is set once somebody has listened for half a second.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    stop = threading.Event()

    def send():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            out.connect(("127.0.0.1", port))
            k = arrived = 0
            while not stop.wait(0.01):
                row = {
                    **{f"accel_{a}_mps2": 0.1 * k for a in "xyz"},
                    **{f"gyro_{a}_radps": 0.0 for a in "xyz"},
                }
                if k % 10 == 0:
                    speed = 10.0 + math.sin(0.01 * k)
                    row |= {"vehicle_speed_mps": speed, "engine_speed_rpm": 2000.0}
                    row |= {"engine_load_pct": 40.0, "latitude_deg": 48.0, "longitude_deg": 11.0}
                try:
                    out.send(json.dumps(row).encode() + b"\n")
                    arrived += 1
                except ConnectionRefusedError:
                    arrived = 0
                if heard is not None and arrived > 50:
                    heard.set()
                k += 1

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield port
    finally:
        stop.set()
        thread.join()


def test_a_series_goes_on_beside_what_was_recorded(weighbridge, tmp_path):
    with sending() as port:
        words = ("--source", f"lines:udp:{port}", "-o", tmp_path / "trip", "--check", "0")
        for _ in range(2):
            ran = weighbridge("record", *words, "--duration", "0.5", "--split-mb", "5")
            assert ran.code == 0, ran.err
    assert sorted(f.name for f in tmp_path.iterdir()) == ["trip", "trip-2"]
    assert read_drive(tmp_path / "trip-2").has("accel_x")


def test_samples_of_a_source_become_a_drive(weighbridge, tmp_path):
    with sending() as port:
        words = ("--source", f"lines:udp:{port}", "-o", tmp_path / "drive", "--duration", "1")
        ran = weighbridge("record", *words, "--check", "0.5")
        again = weighbridge("record", *words)
    assert ran.code == 0, ran.err
    assert ran.err == ""
    assert "11 signals" in ran.out
    drive = read_drive(tmp_path / "drive")
    assert drive.problems == ()
    assert drive.has("accel_x", "gyro_z", "vehicle_speed", "engine_load", "latitude")
    assert 9.0 < drive.signals["vehicle_speed"].values.mean() < 11.0
    assert drive.info.start_time is not None
    assert again.code == 2
    assert named(again.err, tmp_path / "drive")


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_recording_and_the_drive_is_whole(tmp_path, number):
    words = [sys.executable, "-m", "weighbridge", "record", "-o", str(tmp_path / "drive")]
    heard = threading.Event()
    with sending(heard) as port:
        words += ["--source", f"lines:udp:{port}", "--check", "0"]
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as child:
            assert heard.wait(60.0)
            child.send_signal(number)
            out = child.stdout.read()
    assert child.returncode == 0
    assert "written:" in out
    assert sorted(f.suffix for f in (tmp_path / "drive").iterdir()) == [".parquet"] * 3 + [".toml"]
    assert len(read_drive(tmp_path / "drive").signals["accel_x"]) > 10


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--source", "telepathy:x"), "telepathy:x gpsd"),
        (("--source", "obd:virtual:a", "--listen-only"), "obd:virtual:a --listen-only"),
        ((), "--source"),
    ],
)
def test_sources_that_cannot_be_are_refused_and_no_folder_is_made(
    weighbridge, tmp_path, words, said
):
    ran = weighbridge("record", *words, "-o", tmp_path / "drive")
    assert ran.code == 2
    assert named(ran.err, said)
    assert not (tmp_path / "drive").exists()


@pytest.mark.parametrize(
    ("check", "says"),
    [("0.3", "0.3 --check"), ("0", "drive")],
)
def test_a_source_that_says_nothing_is_told(weighbridge, tmp_path, check, says):
    words = ("--check", check, "--duration", "0.3")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    ran = weighbridge("record", "--source", f"lines:udp:{port}", *words, "-o", tmp_path / "drive")
    assert ran.code == 2
    assert named(ran.err, says)
    assert not (tmp_path / "drive").exists()


def test_a_source_that_is_out_of_reach_ends_it(weighbridge, tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    words = ("--source", f"elm:tcp:127.0.0.1:{port}", "--check", "0.5", "-o", tmp_path / "drive")
    ran = weighbridge("record", *words)
    assert ran.code == 2
    assert named(ran.err.splitlines()[-1], f"elm:tcp:127.0.0.1:{port} 0.5 --check")
    assert "Traceback" not in ran.err
    assert not (tmp_path / "drive").exists()
