"""No command overwrites or deletes what it reads, nor what is no earlier result of its own."""

import os
import shutil
from pathlib import Path

import polars as pl
import pytest
from tests.noted import named

GOLDEN = Path(__file__).parent.parent / "golden"
VEHICLE = "[vehicle]\nname = 'x'\n"
REPORT = "<!DOCTYPE html>\n<html></html>"


def contents(*paths: Path) -> dict[str, bytes]:
    files = [f for p in paths for f in (sorted(p.rglob("*")) if p.is_dir() else [p])]
    return {str(f): f.read_bytes() for f in files if f.is_file()}


@pytest.fixture
def drive(tmp_path) -> Path:
    return Path(shutil.copytree(GOLDEN / "csv", tmp_path / "drive"))


@pytest.fixture
def car(tmp_path) -> Path:
    path = tmp_path / "car.toml"
    path.write_text(VEHICLE)
    return path


def refused(ran, *words):
    assert ran.code == 2, ran.err
    assert ran.out == ""
    assert ran.err.count("\n") == 1
    for word in words:
        assert named(ran.err, word)


def test_convert_into_the_folder_of_its_table(weighbridge, drive):
    before = contents(drive)
    refused(weighbridge("convert", drive / "imu.csv", drive, "--force"), "imu.csv")
    assert contents(drive) == before


def test_convert_of_links_to_the_tables_of_the_target(weighbridge, drive, tmp_path):
    linked = tmp_path / "linked"
    linked.mkdir()
    for file in drive.iterdir():
        (linked / file.name).symlink_to(file)
    before = contents(drive)
    refused(weighbridge("convert", linked, drive, "--force"), linked / "drive.toml")
    (tmp_path / "log.csv").symlink_to(drive / "imu.csv")
    refused(weighbridge("convert", tmp_path / "log.csv", drive, "--force"), "log.csv")
    assert contents(drive) == before


def test_convert_onto_its_own_log_by_another_name(weighbridge, tmp_path):
    log = Path(shutil.copy(GOLDEN / "log.mf4", tmp_path / "log.mf4"))
    os.link(log, tmp_path / "same.mf4")
    before = contents(log)
    for name in ("log.mf4", "same.mf4"):
        refused(weighbridge("convert", log, tmp_path / name, "--force"), tmp_path / name)
    assert contents(log) == before


def test_convert_keeps_the_folder_s_other_files(weighbridge, drive, tmp_path):
    out = Path(shutil.copytree(GOLDEN / "csv", tmp_path / "out"))
    (out / "ride.pq").write_text("of the old drive")
    for name in ("notes.txt", "map.toml", "extra.csv"):
        (out / name).write_text("mine")
    ran = weighbridge("convert", drive, out, "--force", "--format", "parquet")
    assert ran.code == 0, ran.err
    kept = {"notes.txt", "map.toml", "extra.csv", "drive.toml"}
    assert {p.name for p in out.iterdir()} == kept | {
        f"{t}.parquet" for t in ("imu", "obd", "gnss")
    }
    assert (out / "extra.csv").read_text() == "mine"


def test_convert_over_what_is_no_mf4(weighbridge, drive, tmp_path):
    notes = tmp_path / "notes.mf4"
    notes.write_text("mine")
    refused(weighbridge("convert", drive, notes, "--force"), "notes.mf4 MF4 OUT")
    assert notes.read_text() == "mine"
    refused(weighbridge("convert", drive, tmp_path / "notes", "--force", "--dbc", "x"), "x")


def test_calibrate_over_a_table_and_over_its_base(weighbridge, drive, car):
    before = contents(drive, car)
    out = drive / "imu.csv"
    words = ("--mass", "1500", "--force")
    refused(weighbridge("calibrate", drive, "-o", out, *words), "folder of a drive that is read")
    refused(weighbridge("calibrate", drive, "--vehicle", car, "-o", car, *words), "is an input")
    assert contents(drive, car) == before


def test_calibrate_over_another_drive_s_table(weighbridge, drive, tmp_path):
    other = Path(shutil.copytree(GOLDEN / "csv", tmp_path / "other"))
    before = contents(other)
    for name in ("imu.csv", "drive.toml"):
        ran = weighbridge("calibrate", drive, "-o", other / name, "--mass", "1500", "--force")
        refused(ran, other / name, "--output")
    assert contents(other) == before


@pytest.mark.parametrize("command", [("demo", "--no-open", "-o"), ("reproduce", "all", "--report")])
def test_reports_over_a_vehicle_file(weighbridge, car, command):
    if command[0] == "reproduce":
        car = car.rename(car.with_stem("car-galvao"))
        refused(weighbridge(*command, car.with_stem("car")), "car-galvao.toml --report")
    else:
        refused(weighbridge(*command, car), "car.toml --output")
    assert car.read_text() == VEHICLE


def test_simulate_onto_a_file(weighbridge, car):
    refused(weighbridge("simulate", "car-short", "-o", car, "--force"), "car.toml .mf4")
    assert car.read_text() == VEHICLE


INPUTS = ("vehicle", "mapping", "dbc", "bus dbc", "mapped dbc", "table")
HOWS = ("same", "hard", "soft")


# Each pair of input, name and option once.
@pytest.mark.parametrize(
    ("how", "what", "option"),
    [
        (how, what, ("--json", "--report", "--track")[(h + k) % 3])
        for h, how in enumerate(HOWS)
        for k, what in enumerate(INPUTS)
    ],
)
def test_results_over_inputs_by_any_name(weighbridge, drive, car, tmp_path, how, what, option):
    mapping = tmp_path / "map.toml"
    names = "dbc = '1:bus.dbc'\n" if what == "mapped dbc" else ""
    mapping.write_text(names + "[time]\noffset_s = 0\n[signals.accel_x]\ncolumn = 'x'\n")
    dbc = Path(shutil.copy(GOLDEN / "golden.dbc", tmp_path / "bus.dbc"))
    read = {"vehicle": car, "mapping": mapping, "table": drive / "imu.csv"}.get(what, dbc)
    out = read
    if how != "same":
        out = tmp_path / "link.csv"
        os.link(read, out) if how == "hard" else out.symlink_to(read)
    before = contents(drive, car, mapping, dbc)
    named = f"1:{dbc}" if what == "bus dbc" else dbc
    given = () if what == "mapped dbc" else ("--dbc", named)
    words = ("--vehicle", car, "--mapping", mapping, *given, option, out)
    for command in ("weigh", "inertia"):
        ran = weighbridge(command, drive, *words)
        if option == "--track" and out.suffix != ".csv":
            refused(ran, ".csv or .parquet")
        else:
            refused(ran, "is " if how == "same" else "is an input")
    assert contents(drive, car, mapping, dbc) == before


def test_the_mapping_a_vehicle_file_names(weighbridge, drive, car, tmp_path):
    mapping = tmp_path / "map.toml"
    mapping.write_text("[time]\noffset_s = 0\n[signals.accel_x]\ncolumn = 'x'\n")
    car.write_text(VEHICLE + "mapping = 'map.toml'\n")
    before = contents(mapping)
    refused(weighbridge("weigh", drive, "--vehicle", car, "--json", mapping), "is an input")
    assert contents(mapping) == before


def test_two_results_in_one_file(weighbridge, drive, car, tmp_path):
    out = tmp_path / "x"
    words = ("weigh", drive, "--vehicle", car, "--json", out, "--report")
    refused(weighbridge(*words, out), "--report --json", out)
    refused(weighbridge(*words, tmp_path / "sub" / ".." / "x"), tmp_path / "sub" / "..")
    (tmp_path / "sub").mkdir()
    refused(weighbridge(*words, tmp_path / "sub" / ".." / "x"), "--report --json")
    (tmp_path / "y").symlink_to("x")
    refused(weighbridge(*words, tmp_path / "y"), "--report --json")
    out.write_text("")
    os.link(out, tmp_path / "z")
    refused(weighbridge(*words, tmp_path / "z"), "--report --json")


@pytest.fixture
def taken(weighbridge, drive, car):
    """Return whether a command takes a place for what it writes; its name is among its words."""

    def check(path, *words):
        weigh = ("weigh", drive, "--vehicle", car)
        ran = weighbridge(*(words if words[0] in ("calibrate", "convert") else (*weigh, *words)))
        return not (ran.code == 2 and named(ran.err, path.name))

    return check


def test_earlier_results_of_the_same_kind_are_replaced(taken, drive, tmp_path):
    texts = {
        "r.html": (REPORT, ("--report",)),
        "r.json": ('{"drive": "x"}\n', ("--json",)),
        "c.toml": (
            "# mine\n\n[driveline]\n",
            ("calibrate", drive, "--mass", 1500, "--force", "-o"),
        ),
        "d.mf4": ("MDF     4.10", ("convert", drive, "--force")),
    }
    for name, (text, words) in texts.items():
        path = tmp_path / name
        for old in (text, ""):
            path.write_text(old)
            assert taken(path, *words, path), name
        for other in {t for t, _ in texts.values()} - {text} | {"notes"}:
            path.write_text(other)
            assert not taken(path, *words, path), (name, other)
            assert path.read_text() == other
    track = pl.DataFrame({"time_s": [0.0], "mass_kg": [1.0], "std_kg": [1.0]})
    for name in ("t.csv", "t.parquet"):
        path = tmp_path / name
        for frame, own in ((track, True), (track.drop("std_kg"), False)):
            frame.write_csv(path) if name == "t.csv" else frame.write_parquet(path)
            assert taken(path, "--track", path) is own


def test_devices_and_new_files_are_free(taken, drive, tmp_path):
    null = Path("/dev/null")
    assert taken(null, "--report", null, "--json", null)
    assert taken(drive / "new.csv", "--track", drive / "new.csv")
    assert taken(tmp_path / "a", "--report", tmp_path / "a", "--json", "-")
    assert taken(tmp_path / "new", "convert", drive, tmp_path / "new")
    assert taken(drive / "sub", "convert", drive, drive / "sub")
    assert any(p.stem == "imu" for p in (drive / "sub").iterdir())
    assert not taken(drive, "convert", drive, drive)


def test_results_that_would_be_tables(weighbridge, drive, car, tmp_path):
    before = contents(drive)
    words = ("weigh", drive, "--vehicle", car, "--track")
    (tmp_path / "link.csv").symlink_to(drive / "ride.csv")
    for out in (drive / "ride.csv", drive / "imu.parquet", tmp_path / "link.csv"):
        refused(weighbridge(*words, out), out)
    assert contents(drive) == before
    logs = tmp_path / "logs"
    logs.mkdir()
    shutil.copy(GOLDEN / "can.blf", logs)
    track = logs / "track.csv"
    refused(weighbridge("weigh", logs, "--vehicle", car, "--track", track), track)


def test_times_beside_an_array_are_inputs(weighbridge, car, tmp_path):
    for name in ("value.npy", "t.npy"):
        (tmp_path / name).write_bytes(b"")
    times = tmp_path / "t.npy"
    refused(weighbridge("weigh", tmp_path / "value.npy", "--vehicle", car, "--json", times), times)
    assert times.read_bytes() == b""
