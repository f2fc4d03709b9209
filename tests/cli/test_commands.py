"""The commands end to end: what they print, write and exit with."""

import json
import subprocess
import sys
from dataclasses import replace

import polars as pl
import pytest
from tests.noted import named, says

from weighbridge import Vehicle, __version__, read_drive
from weighbridge.cli.calibrate import own_masses
from weighbridge.estimators import ESTIMATORS
from weighbridge.papers import jensen2022
from weighbridge.simulation import make_scenario, simulate_car
from weighbridge.vehicle import Driveline

COMMANDS = ("demo", "inspect", "calibrate", "weigh", "simulate", "reproduce")

FIELDS = [
    "drive", "vehicle", "start", "method", "status", "reason", "reason_id", "mass_kg", "std_kg",
    "interval95_kg", "payload_kg", "duration_s", "used_s", "converged_at_s", "bound_std_kg",
    "maker_mass_kg", "trailer_connected", "segments", "problems", "warnings",
]  # fmt: skip


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example(weighbridge, command):
    ran = weighbridge(command, "--help")
    assert ran.code == 0
    assert f"Example: weighbridge {command}" in " ".join(ran.out.split())


def test_a_short_option_prints_the_same_help(weighbridge):
    assert weighbridge("weigh", "-h").out == weighbridge("weigh", "--help").out


@pytest.mark.parametrize("group", ["vehicle", "fleet"])
def test_a_group_alone_prints_no_empty_error(weighbridge, group):
    ran = weighbridge(group)
    assert ran.code == 2
    assert "weighbridge: ;" not in ran.err


def test_version(weighbridge):
    assert weighbridge("--version").out == f"weighbridge {__version__}\n"


def test_help_in_a_process_of_its_own_loads_no_arrays():
    script = (
        "import sys\n"
        "sys.argv = ['weighbridge', '--help']\n"
        "from weighbridge.cli.main import run\n"
        "try:\n"
        "    run()\n"
        "finally:\n"
        "    heavy = {'numpy', 'scipy', 'numba', 'polars', 'plotly'} & set(sys.modules)\n"
        "    print('loaded:', sorted(heavy), file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0
    assert all(command in done.stdout for command in COMMANDS)
    assert done.stderr == "loaded: []\n"


def test_a_weighing_loads_no_slow_library(car, loaded):
    words = ["weigh", str(loaded.folder), "--vehicle", str(car), "--quiet"]
    script = (
        "import sys\n"
        f"sys.argv = ['weighbridge', *{words!r}]\n"
        "from weighbridge.cli.main import run\n"
        "try:\n"
        "    run()\n"
        "finally:\n"
        "    slow = {'scipy.linalg', 'scipy.optimize', 'scipy.signal', 'scipy.special', 'plotly'}\n"
        "    print('loaded:', sorted(slow & set(sys.modules)), file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0
    assert "kg, 95 %" in done.stdout
    assert done.stderr == "loaded: []\n"


def test_unknown_option_is_status_2(weighbridge):
    assert weighbridge("weigh", "--nonsense").code == 2


def test_calibrate_writes_a_vehicle_file(car, known):
    vehicle = Vehicle.load(car)
    assert vehicle.torque.source == "load"
    assert vehicle.tare == 1580.0
    assert 5 <= len(vehicle.driveline.gearings) <= 7
    assert vehicle.provenance.drives == (known.folder.name,)
    assert vehicle.provenance.r_squared > 0.95


def test_calibrate_refuses_to_overwrite(weighbridge, car, known):
    before = car.read_text()
    ran = weighbridge("calibrate", known.folder, "-o", car)
    assert ran.code == 2
    assert "--force" in ran.err
    assert car.read_text() == before


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--mass", "1.58"], "1.58 kg"),
        (["--mass", "1580", "--mass", "1600"], "2 1 --mass"),
        (["--mass", "1580,1600"], "repeat --mass, as --mass 1580 --mass 1600"),
        (["--mass", "1580,5"], "give a number of kg"),
        (["--torque", "measured"], "engine_torque"),
        (["--torque", "guess"], "--torque must be "),
        (["--vehicle", "nowhere.toml"], "nowhere.toml"),
    ],
)
def test_calibrate_refuses(weighbridge, known, tmp_path, words, said):
    ran = weighbridge("calibrate", known.folder, "-o", tmp_path / "car.toml", *words)
    assert ran.code == 2
    assert named(ran.err, said)
    assert ran.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_calibration_weighs_its_own_drives(weighbridge, car, known):
    drive = read_drive(known.folder)
    own = own_masses(Vehicle.load(car), [drive])
    first, told, *notes = own.lines
    assert "no proof" in first
    ran = weighbridge("weigh", known.folder, "--vehicle", car, "--json", "-")
    weighed = json.loads(ran.out)
    percent = 100.0 * (weighed["mass_kg"] / 1580.0 - 1.0)
    assert f"{known.folder.name}: {weighed['mass_kg']:.0f} kg, {percent:+.1f} % of the 1580" in told
    assert [n.removeprefix("    note: ") for n in notes] == weighed["warnings"]
    assert own.doubt is None


def test_what_weigh_would_note_of_a_drive_of_a_calibration_is_told(car, known):
    drive = read_drive(known.folder)
    later = replace(drive.signals["engine_load"], time=drive.signals["engine_load"].time + 0.3)
    own = own_masses(Vehicle.load(car), [drive.with_signals(later)])
    assert any(says(line, "torque.clock_moved") for line in own.lines)


def test_weigh_in_words(weighbridge, car, loaded):
    ran = weighbridge("weigh", loaded.folder, "--vehicle", car)
    assert ran.code == 0
    assert "95 % between" in ran.out
    assert "over a tare of 1580 kg" in ran.out
    assert ran.err == ""


def test_weigh_to_standard_output_is_json_alone(weighbridge, car, loaded):
    ran = weighbridge("weigh", loaded.folder, loaded.folder, "--vehicle", car, "--json", "-")
    lines = ran.out.splitlines()
    assert len(lines) == 2
    assert lines[0] == lines[1]
    result = json.loads(lines[0])
    assert list(result) == FIELDS
    assert result["mass_kg"] == pytest.approx(loaded.mass, rel=0.05)
    assert result["payload_kg"] == pytest.approx(result["mass_kg"] - 1580.0, abs=1e-3)


def test_weigh_writes_everything(weighbridge, car, loaded, tmp_path):
    outputs = {k: tmp_path / f"out{k}" for k in (".json", ".csv", ".parquet", ".html")}
    words = ("weigh", loaded.folder, "--vehicle", car)
    ran = weighbridge(
        *words, "--json", outputs[".json"], "--track", outputs[".csv"], "--report", outputs[".html"]
    )
    assert ran.code == 0
    for suffix in (".json", ".csv", ".html"):
        assert f"written: {outputs[suffix]}" in ran.out.splitlines()
    ran = weighbridge(*words, "--track", outputs[".parquet"], "--json", "-")
    assert ran.code == 0
    assert json.loads(ran.out)["status"] == "converged"
    layout = tmp_path / "out.parquet.plotjuggler.xml"
    assert ran.err == f"written: {outputs['.parquet']}\nwritten: {layout}\n"
    csv, parquet = pl.read_csv(outputs[".csv"]), pl.read_parquet(outputs[".parquet"])
    assert csv.columns == parquet.columns == [
        "time_s", "mass_kg", "std_kg", "used", "speed_mps", "accel_mps2", "specific_force_mps2",
        "grade_rad", "pitch_rad", "gear", "traction_force_n", "reason", "low95_kg", "high95_kg",
        "residual_n",
    ]  # fmt: skip
    assert csv.height == parquet.height > 1000
    result = json.loads(outputs[".json"].read_text())
    assert result["status"] == "converged"
    assert f"{result['mass_kg']:.0f}" in outputs[".html"].read_text().replace(" ", "")


def test_weigh_compares_every_method(weighbridge, car, loaded, tmp_path):
    page = tmp_path / "out.html"
    words = ("weigh", loaded.folder, "--vehicle", car, "--compare")
    ran = weighbridge(*words, "--report", page)
    assert ran.code == 0
    rows = {line.split("│")[1].strip(): line for line in ran.out.splitlines() if "│" in line}
    assert {m for m in ESTIMATORS if ESTIMATORS[m].compared} == set(rows) & {*ESTIMATORS}
    assert "converged" in rows["hybrid"]
    assert "missing_signals" in rows["speed-ekf"]
    note = (
        "calibrated for joint: rls, robust-rls, ekf, hybrid, speed-torque-ekf were run with the "
        "torque of another"
    )
    assert note in ran.out
    alone = json.loads(weighbridge(*words[:-1], "--method", "hybrid", "--json", "-").out)
    assert f"{alone['mass_kg']:.0f}" in rows["hybrid"]
    assert "All methods on this drive" in page.read_text(encoding="utf-8")
    told = weighbridge(*words, "--json", "-").out.splitlines()
    assert [json.loads(line)["method"] for line in told] == ["joint"]


def test_one_broken_drive_of_two(weighbridge, car, loaded, tmp_path):
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "obd.parquet").write_bytes(b"PAR1 and nothing more")
    words = ("weigh", loaded.folder, broken, "--vehicle", car)
    ran = weighbridge(*words, "--json", "-")
    assert ran.code == 2
    good, bad = (json.loads(line) for line in ran.out.splitlines())
    assert good["mass_kg"] == pytest.approx(loaded.mass, rel=0.05)
    assert bad["drive"] == "broken"
    assert bad["mass_kg"] is None
    assert "obd.parquet" in bad["reason"]
    assert list(bad) == FIELDS
    assert "unreadable" in weighbridge(*words).out


def test_one_drive_without_a_mass_is_status_1(weighbridge, car, loaded, changed):
    parked = changed(
        obd=lambda f: f.filter(pl.col("time_s") < 20.0),
        imu=lambda f: f.filter(pl.col("time_s") < 20.0),
        gnss=lambda f: f.filter(pl.col("time_s") < 20.0),
    )
    ran = weighbridge("weigh", loaded.folder, parked, "--vehicle", car)
    assert ran.code == 1
    assert "converged" in ran.out
    assert "not_excited" in ran.out


@pytest.mark.parametrize("option", ["--json", "--track", "--report"])
def test_weigh_into_a_folder_that_is_not_there(weighbridge, car, loaded, tmp_path, option):
    ran = weighbridge("weigh", loaded.folder, "--vehicle", car, option, tmp_path / "no" / "out.csv")
    assert ran.code == 2
    assert ran.out == ""
    assert named(ran.err, tmp_path / "no")


@pytest.mark.parametrize("option", ["--json", "--report"])
def test_weigh_never_replaces_what_it_reads(weighbridge, car, loaded, option):
    for path in (car, next(loaded.folder.glob("obd.*")), loaded.folder / "drive.toml"):
        before = path.read_bytes()
        ran = weighbridge("weigh", loaded.folder, "--vehicle", car, option, path)
        assert ran.code == 2
        assert ran.out == ""
        assert f"{path}: is " in ran.err
        assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--method", "guess"], "guess joint rls"),
        (["--method", "jiont"], "did you mean joint?"),
        (["--track", "track.xlsx"], ".csv or .parquet"),
        (["--mapping", "nowhere.toml"], "nowhere.toml"),
    ],
)
def test_weigh_refuses(weighbridge, car, loaded, words, said):
    ran = weighbridge("weigh", loaded.folder, "--vehicle", car, *words)
    assert ran.code == 2
    assert named(ran.err, said)
    assert ran.err.count("\n") == 1


def test_weigh_shows_pounds_and_writes_kilograms(weighbridge, car, loaded, tmp_path):
    out = tmp_path / "w.json"
    ran = weighbridge("weigh", loaded.folder, "--vehicle", car, "--units", "us", "--json", out)
    assert ran.code == 0
    mass = json.loads(out.read_text())["mass_kg"]
    assert f"{mass / 0.45359237:.0f} lb" in ran.out
    assert " kg" not in ran.out
    # The next command begins anew.
    assert f"{mass:.0f} kg" in weighbridge("weigh", loaded.folder, "--vehicle", car).out


def test_calibrate_into_a_folder_that_is_not_there(weighbridge, known, tmp_path):
    ran = weighbridge("calibrate", known.folder, "-o", tmp_path / "no" / "car.toml")
    assert ran.code == 2
    assert named(ran.err, tmp_path / "no")


def vehicle_file(path, text):
    path.write_text("[vehicle]\nname = 'other'\n" + text, encoding="utf-8")
    return path


def test_vehicle_file_of_another_car_gives_no_mass(weighbridge, car, loaded, tmp_path):
    own = Vehicle.load(car)
    gearings = (51.3, 27.7, 17.4, 12.9, 10.2, 8.2)
    other = tmp_path / "other.toml"
    replace(own, driveline=Driveline(gearings=gearings)).save(other)
    ran = weighbridge("weigh", loaded.folder, "--vehicle", other, "--json", "-")
    assert ran.code == 1
    result = json.loads(ran.out)
    assert result["status"] == "inconsistent"
    assert result["mass_kg"] is None
    assert result["reason_id"] == "gear.foreign"
    assert all(s["mass_kg"] is None for s in result["segments"])


def test_vehicle_file_for_load_and_a_drive_with_torque_only(weighbridge, car, loaded, changed):
    def only_torque(frame):
        return frame.rename({"engine_load_pct": "engine_torque_nm"}).drop("mass_air_flow_gps")

    ran = weighbridge("weigh", changed(obd=only_torque), "--vehicle", car, "--json", "-")
    assert ran.code == 1
    told = json.loads(ran.out)
    assert told["reason_id"] == "torque.other_source"
    assert says(told["reason"], "torque.other_source", other="measured")


def test_data_sheet_without_gearings_is_told_to_be_uncalibrated(weighbridge, tmp_path):
    folder = tmp_path / "drive"
    made = replace(make_scenario("electric", seed=5), duration=600.0)
    simulate_car(replace(made, payload=1900.0 - made.car.mass)).write(folder)
    sheet = vehicle_file(tmp_path / "sheet.toml", "[torque]\nsource = 'measured'\n")
    ran = weighbridge("weigh", folder, "--vehicle", sheet, "--json", "-")
    assert ran.code == 0
    result = json.loads(ran.out)
    assert result["mass_kg"] == pytest.approx(1900.0, rel=0.15)
    assert any(p["id"] == "vehicle.uncalibrated_std" for p in result["problems"])


def test_a_fleet_is_simulated_once(weighbridge, tmp_path):
    words = ("simulate", "fleet", "-o", tmp_path / "fleet", "--vehicles", 1, "--days", 1,
             "--drives", 1, "--minutes", 2, "--seed", 169112, "--workers", 1)  # fmt: skip
    ran = weighbridge(*words)
    assert (ran.code, "1 drives of 1 vehicles" in ran.out) == (0, True)
    assert len(list((tmp_path / "fleet" / "drives" / "truck001").iterdir())) == 1
    again = weighbridge(*words)
    assert again.code == 2
    assert named(again.err, tmp_path / "fleet")
    assert weighbridge("simulate", "fleet", "--help").code == 0


def test_simulate_writes_a_folder_once(weighbridge, tmp_path):
    folder = tmp_path / "new" / "drive"
    words = ("simulate", "car-short", "-o", folder, "--mass", 1700, "--format", "csv")
    ran = weighbridge(*words)
    assert ran.code == 0
    assert "1700 kg" in ran.out
    names = {f.name for f in folder.iterdir()}
    assert names == {"imu.csv", "obd.csv", "gnss.csv", "truth.csv", "drive.toml"}
    again = weighbridge(*words)
    assert again.code == 2
    assert "--force" in again.err
    assert weighbridge(*words, "--force").code == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["moon"], "moon car-short"),
        (["hihgway"], "did you mean highway?"),
        (["fleets"], "Did you mean 'fleet'?"),
        (["car-short", "--without", "friction"], "friction tyre_speed"),
        (["car-short", "--without", "sqat"], "did you mean squat?"),
        (["car-short", "--format", "xlsx"], "parquet or csv"),
        (["car-short", "--format", "parket"], "did you mean parquet?"),
    ],
)
def test_simulate_refuses(weighbridge, tmp_path, words, said):
    ran = weighbridge("simulate", *words, "-o", tmp_path / "drive")
    assert ran.code == 2
    assert named(ran.err, said)
    assert list(tmp_path.iterdir()) == []


def test_reproduce_refuses_unknown_papers(weighbridge):
    ran = weighbridge("reproduce", "newton1687")
    assert ran.code == 2
    assert "jensen2022" in ran.err


def test_rows_of_table_b_1_are_as_printed():
    rows = jensen2022.TABLE_B1
    assert len(rows) == 18
    assert [row.number for row in rows] == list(range(1, 19))
    first = jensen2022.scenario(rows[0], seed=1)
    again = jensen2022.scenario(rows[0], seed=2)
    assert first.mass == again.mass
    assert first.seed != again.seed


@pytest.mark.slow
def test_demo(weighbridge, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("weighbridge.cli.demo.DURATION", 700.0)
    ran = weighbridge("demo", "--no-open", "-o", "demo.html")
    assert ran.code == 0
    errors = [float(line.split("│")[-2]) for line in ran.out.splitlines() if " kg │" in line]
    assert len(errors) == 3
    assert max(abs(e) for e in errors) < 5.0
    page = (tmp_path / "demo.html").read_text(encoding="utf-8").replace("\u00a0", " ")
    assert len(page) > 100_000
    assert page.count("of 2060 kg, within it:") == 3
    assert page.count("fuel burnt on the way taken off") == 3
