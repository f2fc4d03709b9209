"""From an emulated dongle to a mass, as docs/live.md says: two programs, and sockets between."""

import json
import shlex
import signal
import subprocess
import sys
import time

import pytest
from tests.noted import named
from tests.ports import free_ports

from weighbridge import read_drive
from weighbridge.io import write_drive

RATE = 8.0
PROGRAM = (sys.executable, "-m", "weighbridge")


def newest(lines):
    """Return the last whole weighing of a file; none where there is none."""
    text = lines.read_text() if lines.exists() else ""
    whole = [line for line in text.splitlines(keepends=True) if line.endswith("\n")]
    return json.loads(whole[-1]) if whole else {}


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_from_an_emulated_dongle_to_a_mass(loaded, car, tmp_path):
    drive = read_drive(loaded.folder)
    set_off = float(drive.speed.time[drive.speed.values > 0.0][0])
    write_drive(drive.between(set_off - 5.0, drive.end), tmp_path / "moving")
    elm, nmea, lines = free_ports().values()
    told = tmp_path / "live.jsonl"
    emulate = [*PROGRAM, "emulate", str(tmp_path / "moving"), "--rate", f"{RATE:g}"]
    emulate += ["--elm", f"{elm}", "--nmea", f"{nmea}", "--lines", f"{lines}"]
    with subprocess.Popen(emulate, stdout=subprocess.PIPE, text=True) as devices:
        try:
            # What it prints is what is to be typed.
            words = shlex.split(devices.stdout.readline().replace("VEHICLE.toml", str(car)))
            assert words[:2] == ["weighbridge", "live"]
            assert f"elm:tcp:127.0.0.1:{elm}" in words
            live = [*PROGRAM, *words[1:], "--json", str(told), "--state", "none"]
            with subprocess.Popen(
                live, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            ) as scale:
                until = time.monotonic() + 90.0
                while newest(told).get("mass_kg") is None and time.monotonic() < until:
                    assert scale.poll() is None, scale.stderr.read()
                    time.sleep(0.2)
                scale.send_signal(signal.SIGINT)
                out, err = scale.communicate(timeout=30.0)
        finally:
            devices.kill()
    assert scale.returncode == 0, err
    assert "only emulated sources do" in err
    last = newest(told)
    low, high = last["interval95_kg"]
    # A busy machine shifts stamps by so many times its own delay: more than the interval knows.
    assert last["mass_kg"] == pytest.approx(loaded.mass, rel=0.06)
    # The first mass is shown once it is known within 15 %.
    assert low < last["mass_kg"] < high < 1.15 / 0.85 * low
    assert f"{last['mass_kg']:.0f} kg" in out
    rates = {s["name"]: s["rate_hz"] for s in last["signals"]}
    assert rates["accel_x"] > 40.0
    assert rates["vehicle_speed"] > 1.0


def test_a_drive_that_no_dongle_has(weighbridge, changed):
    without = changed(obd=lambda t: t.drop("vehicle_speed_kmh"))
    ran = weighbridge("emulate", without)
    assert ran.code == 2
    assert named(ran.err, "changed vehicle_speed OBD-II")


@pytest.mark.parametrize("rate", ["0", "max", "fast"])
def test_sources_have_a_rate(weighbridge, car, rate):
    ran = weighbridge(
        "live", "--vehicle", car, "--source", "elm:tcp:127.0.0.1:1", "--rate", rate,
        "--state", "none",
    )  # fmt: skip
    assert ran.code == 2
    assert f"--rate {rate}" in ran.err
