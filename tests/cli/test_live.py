"""The command ``live`` on recorded drives."""

import json
import math
import os
import threading

import polars as pl
import pytest
from tests.noted import named

import weighbridge as wb
from weighbridge.io import write_drive


def a_minute_later(table):
    """The first minute of a table, a quarter of an hour later."""
    return table.filter(pl.col("time_s") < 60.0).with_columns(pl.col("time_s") + 900.0)


@pytest.fixture(scope="module")
def minutes(loaded, tmp_path_factory):
    """The first five minutes of the loaded drive."""
    drive = wb.read_drive(loaded.folder)
    folder = tmp_path_factory.mktemp("minutes") / "minutes"
    write_drive(drive.between(drive.start, drive.start + 300.0), folder)
    return folder


@pytest.fixture(scope="module")
def brief(loaded, tmp_path_factory):
    """The first four minutes of it: enough for a calibration, and a poor one."""
    drive = wb.read_drive(loaded.folder)
    folder = tmp_path_factory.mktemp("brief") / "brief"
    write_drive(drive.between(drive.start, drive.start + 240.0), folder)
    return folder


def test_a_replay_ends_with_a_mass(weighbridge, loaded, minutes, car, changed, tmp_path):
    lines, kept = tmp_path / "lines.jsonl", tmp_path / "kept"
    ran = weighbridge(
        "live", "--vehicle", car, "--replay", minutes, "--rate", "max",
        "--json", lines, "--record", kept, "--state", tmp_path / "car.state", "--every", 5,
    )  # fmt: skip
    assert ran.code == 0, ran.err
    assert "with 95 % probability" in ran.out
    told = [json.loads(line) for line in lines.read_text().splitlines()]
    assert {t["status"] for t in told} >= {"learning"}
    assert told[0]["mass_kg"] is None
    last = told[-1]
    assert last["interval95_kg"][0] < loaded.mass < last["interval95_kg"][1]
    assert last["mass_kg"] == pytest.approx(wb.weigh(minutes, car).mass, rel=0.015)
    assert last["payload_kg"] == pytest.approx(last["mass_kg"] - 1580.0)
    assert (tmp_path / "car.state").exists()
    drive = wb.read_drive(kept)
    assert len(drive.signals["accel_x"]) == len(wb.read_drive(minutes).signals["accel_x"])
    # Where the state stays, the next run begins with it; what was recorded stays as it is.
    later = dict.fromkeys(("imu", "obd", "gnss"), a_minute_later)
    words = ("--rate", "max", "--state", tmp_path / "car.state", "--json", "-", "--record", kept)
    again = weighbridge("live", "--vehicle", car, "--replay", changed(**later), *words)
    assert "going on from" in again.err
    assert "kept-2" in again.err
    assert wb.read_drive(kept).duration == drive.duration
    first = json.loads(again.out.splitlines()[0])
    assert math.isclose(first["mass_kg"], last["mass_kg"], rel_tol=0.005)


def test_no_mass_is_exit_1(weighbridge, loaded, car, changed):
    brief = changed(
        imu=lambda t: t.filter(pl.col("time_s") < 40.0),
        obd=lambda t: t.filter(pl.col("time_s") < 40.0),
        gnss=lambda t: t.filter(pl.col("time_s") < 40.0),
    )
    ran = weighbridge("live", "--vehicle", car, "--replay", brief, "--rate", "max")
    assert ran.code == 1
    assert "learning" in ran.err
    assert ran.out == ""


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((), "--source --replay"),
        (("--replay", "d", "--rate", "fast"), "--rate fast"),
        (("--replay", "d", "--rate", "0"), "--rate 0"),
        (("--replay", "d", "-o", "new.toml"), "-o new.toml --ticket"),
        (("--replay", "d", "--every", "0"), "--every 0"),
        (("--replay", "d", "--above", "-5"), "-5 kg"),
        (("--replay", "d", "--keep-days", "9"), "--keep-days --record"),
        (("--replay", "d", "--page", "here"), "--page here"),
        (("--source", "warp:core"), "warp:core gpsd"),
        (("--source", "elm:/dev/nothing", "--listen-only"), "elm:/dev/nothing --listen-only"),
    ],
)
def test_wrong_usage_is_one_sentence(weighbridge, loaded, car, words, says):
    words = [str(loaded.folder) if w == "d" else w for w in words]
    ran = weighbridge("live", "--vehicle", car, "--state", "none", *words)
    assert ran.code == 2
    assert named(ran.err, says)


def test_nothing_that_is_read_is_replaced(weighbridge, loaded, car):
    for words in (
        ("--json", car),
        ("--json", loaded.folder / "imu.parquet"),
        ("--ticket", 1700, "-o", car),
        ("--state", car),
        ("--state", loaded.folder / "drive.toml"),
    ):
        before = car.read_bytes()
        ran = weighbridge("live", "--vehicle", car, "--replay", loaded.folder, *words)
        assert ran.code == 2
        assert car.read_bytes() == before


def test_a_ticket_calibrates(weighbridge, loaded, brief, car, tmp_path):
    """Beside the vehicle file that contradicts it, under a name that is not there yet."""
    there, out = tmp_path / "car.toml", tmp_path / "car-ticket-2.toml"
    there.write_bytes(car.read_bytes())
    (tmp_path / "car-ticket.toml").touch()
    ran = weighbridge(
        "live", "--vehicle", there, "--replay", brief, "--rate", "max",
        "--ticket", f"{1.2 * loaded.mass:.0f}",
    )  # fmt: skip
    assert ran.code in (0, 1), ran.err
    assert "the vehicle file before says " in ran.err
    assert "written" in ran.err
    assert wb.Vehicle.load(out).provenance.masses == pytest.approx((1.2 * loaded.mass,), abs=1.0)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")
def test_orders_come_by_a_pipe(weighbridge, loaded, car, tmp_path):
    pipe = tmp_path / "orders"
    os.mkfifo(pipe)
    words = "tare\nturn back\nend\n"
    threading.Thread(target=pipe.write_text, args=(words,), daemon=True).start()
    ran = weighbridge(
        "live", "--vehicle", car, "--replay", loaded.folder, "--rate", 10, "--orders", pipe
    )
    assert ran.code == 1
    assert "'turn back' is no order: there are tare, load, end" in ran.err
    assert pipe.exists()


def test_a_ticket_of_a_short_drive_makes_no_worse_file(weighbridge, loaded, brief, car, tmp_path):
    out = tmp_path / "worse.toml"
    words = ("--replay", brief, "--rate", "max", "--ticket", f"{loaded.mass:.0f}")
    ran = weighbridge("live", "--vehicle", car, *words, "-o", out)
    assert ran.code == 0, ran.err
    assert f"{out} is not written: made of this drive alone it would leave ± " in ran.err
    assert "drive half an hour or more" in ran.err
    assert not out.exists()
