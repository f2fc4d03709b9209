"""``weighbridge inspect`` end to end."""

import re
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.noted import named, says

from weighbridge import Signal, inspect_drive, read_drive
from weighbridge.io import write_drive

GOLDEN = Path(__file__).resolve().parents[1] / "golden"


@pytest.fixture
def run(weighbridge):
    def invoke(*words):
        ran = weighbridge("inspect", *words)
        assert (ran.code, ran.err) == (0, "")
        return ran.out

    return invoke


def test_canonical_folder(run):
    out = run(GOLDEN / "csv")
    assert "vehicle_speed" in out
    assert "kmh" in out
    assert "IMU with speed and torque in N m" in out


def test_mapping_and_vehicle_file(run, tmp_path):
    car = tmp_path / "car.toml"
    car.write_text(
        f'[vehicle]\nmapping = "{(GOLDEN / "foreign.toml").as_posix()}"\n'
        "[driveline]\ngearings_per_m = [40.0]\n",
        encoding="utf-8",
    )
    out = run(GOLDEN / "foreign.csv", "--vehicle", car)
    assert "longitudinal_accel" in out
    assert "No way to weigh by this drive" in out
    assert "engine_torque" in out


def test_problems_are_listed(run, tmp_path):
    rows = "\n".join(f"{t},{t % 7},-9.81,0" for t in range(200))
    (tmp_path / "imu.csv").write_text(
        f"time_s,accel_x_mps2,accel_y_mps2,[odd]\n{rows}\n", encoding="utf-8"
    )
    out = run(tmp_path)
    assert "serious: imu" in out
    assert "'[odd]'" in out
    # Where the clock cannot be right nothing else is looked at.
    assert not says(out, "range.stuck")
    rows = "\n".join(f"{0.05 * t:.2f},{t % 7},-9.81,0" for t in range(800))
    (tmp_path / "imu.csv").write_text(
        f"time_s,accel_x_mps2,accel_y_mps2,accel_z_mps2\n{rows}\n", encoding="utf-8"
    )
    table = re.sub(r"[\s│]+", " ", run(tmp_path))
    assert says(table, "range.stuck", signal="accel_y", value="-9.81 mps2")


def test_every_way_on_request(run):
    short, long = run(GOLDEN / "csv"), run(GOLDEN / "csv", "--all")
    assert len(re.findall(r"air\s+flow|and air ", long)) >= 4
    assert "air flow" not in short
    assert "lacks" in long
    assert "lacks" not in short


def test_what_cannot_be_read_is_one_error(weighbridge, tmp_path):
    ran = weighbridge("inspect", tmp_path / "nowhere")
    assert ran.code == 2
    assert named(ran.err, "nowhere")


def test_help_has_an_example(run):
    assert "Example: weighbridge inspect drive/" in run("--help")


def test_one_sample_has_no_rate(run, tmp_path):
    (tmp_path / "obd.csv").write_text(
        "time_s,vehicle_speed_kmh,reference_torque_nm\n0,10,400\n1,11,\n2,12,\n"
    )
    row = next(line for line in run(tmp_path).splitlines() if "reference_torque" in line)
    assert "nan" not in row
    assert row.count("400") == 2


def test_brackets_stay_in_tables_of_several_drives(weighbridge, tmp_path):
    for name in ("run[a]", "logs[b]"):
        shutil.copytree(GOLDEN / "csv", tmp_path / name)
    car = tmp_path / "car.toml"
    car.write_text("[vehicle]\nname = 'x'\n")
    words = ("weigh", tmp_path / "run[a]", tmp_path / "logs[b]", "--vehicle", car)
    out = weighbridge(*words).out + weighbridge(*words, "--compare").out
    assert out.count("run[a]") == out.count("logs[b]") == 2


def test_the_next_command_stands_at_the_end(run, weighbridge, loaded, car):
    last = weighbridge("inspect", loaded.folder).out.strip().splitlines()[-1]
    assert last == f"next: weighbridge calibrate {loaded.folder} --mass KG -o vehicle.toml"
    last = weighbridge("inspect", loaded.folder, "--vehicle", car).out.strip().splitlines()[-1]
    assert last == f"next: weighbridge weigh {loaded.folder} --vehicle {car}"


def next_lines(weighbridge, drive, place, *words):
    """Return the commands that inspecting a drive as the folder ``day`` ends with."""
    write_drive(drive, place / "day")
    out = weighbridge("inspect", "day", *words).out.strip().splitlines()
    return [line for line in out if line.startswith(("next: ", "then: "))]


def test_a_log_with_a_retarder_leads_to_a_truck_file(weighbridge, loaded, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    drive = read_drive(loaded.folder)
    (only,) = next_lines(weighbridge, drive, tmp_path)
    assert only == "next: weighbridge calibrate day --mass KG -o vehicle.toml"
    time = drive.speed.time
    truck = drive.with_signals(Signal("retarder_torque", time, -0.1 * (time % 7.0)))
    first, then = next_lines(weighbridge, truck, tmp_path)
    assert first.startswith("next: weighbridge vehicle new --class truck -o base")
    assert then.startswith("then: weighbridge calibrate day --mass KG -o vehicle.toml")
    assert then.endswith("--vehicle base.toml")


@pytest.fixture
def percent_drive(loaded):
    """A drive of a truck that tells its torque in percent, and nothing else of it."""
    drive = read_drive(loaded.folder)
    load = drive.signals["engine_load"]
    drive = drive.without("engine_load", "mass_air_flow", "engine_torque")
    return drive.with_signals(
        Signal("engine_torque_fraction", load.time, load.values),
        Signal("retarder_torque", load.time, 0.0 * load.time),
    )


def test_percent_torque_without_its_reference_is_what_is_nearest(
    weighbridge, percent_drive, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    way = inspect_drive(percent_drive).ways[0]
    assert way.torque == "percent"
    assert way.needs == ("reference_torque (or reference_torque_nm in the vehicle file)",)
    first, then = next_lines(weighbridge, percent_drive, tmp_path)
    assert first.startswith(
        "next: weighbridge vehicle new --class truck --torque percent --reference-torque NM "
        "-o base.toml"
    )
    assert then == "then: weighbridge inspect day --vehicle base.toml"
    new = ("vehicle", "new", "--class", "truck", "--torque", "percent", "-o", "truck.toml")
    assert weighbridge(*new).code == 0
    (only,) = next_lines(weighbridge, percent_drive, tmp_path, "--vehicle", "truck.toml")
    assert "reference_torque_nm" in only
    assert "truck.toml" in only
    assert weighbridge(*new, "--reference-torque", 1800, "--force").code == 0
    lines = next_lines(weighbridge, percent_drive, tmp_path, "--vehicle", "truck.toml")
    assert lines[0] == "next: weighbridge weigh day --vehicle truck.toml"


def test_the_torque_in_percent_goes_into_the_next_command(
    weighbridge, percent_drive, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    reference = Signal("reference_torque", np.array([percent_drive.start]), np.array([1800.0]))
    drive = percent_drive.with_signals(reference)
    first, then = next_lines(weighbridge, drive, tmp_path)
    assert "vehicle new --class truck --torque percent -o base.toml" in first
    assert then.startswith("then: weighbridge calibrate day")
    # A file that weighs by a torque that the drive lacks leads to no weighing.
    new = ("vehicle", "new", "--class", "truck", "--torque", "measured", "-o", "truck.toml")
    assert weighbridge(*new).code == 0
    (only,) = next_lines(weighbridge, drive, tmp_path, "--vehicle", "truck.toml")
    assert "weighbridge weigh" not in only
    assert "--torque percent" in only


def test_warnings_of_several_drives_are_a_few_lines(weighbridge, percent_drive, tmp_path):
    car = tmp_path / "car.toml"
    words = ("--class", "truck", "--torque", "percent", "--reference-torque", "1800")
    assert weighbridge("vehicle", "new", *words, "-o", car).code == 0
    for k in (1, 2):
        write_drive(percent_drive.between(0.0, 100.0 + 20.0 * k), tmp_path / f"day{k}")
    out = weighbridge("weigh", tmp_path / "day1", tmp_path / "day2", "--vehicle", car).out
    notes = re.findall(r"note: (every drive|day\d): (.*)", out)
    shared = [text for of, text in notes if of == "every drive"]
    assert shared
    assert all(out.count(text) == 1 for text in shared)
    assert all(0 < sum(of == name for of, _ in notes) <= 4 for name in ("day1", "day2"))


def test_the_way_by_wheel_torque_is_named_where_the_driven_axles_are_all_it_lacks(
    weighbridge, tmp_path
):
    time = np.arange(0.0, 400.0, 0.1)
    speed = 12.0 + 6.0 * np.sin(time / 20.0)
    accel = np.gradient(speed, time) + 9.81 * 0.02 * np.sin(time / 60.0)
    rear = np.round(400.0 * accel)
    table = {"time_s": time, "vehicle_speed_mps": speed, "longitudinal_accel_mps2": accel}
    table |= {"wheel_torque_rl_nm": rear, "wheel_torque_rr_nm": rear}
    pl.DataFrame(table).write_csv(tmp_path / "t.csv")
    ran = weighbridge("inspect", tmp_path / "t.csv")
    text = " ".join(ran.out.split())
    assert "--torque wheel_torque --driven AXLES" in text
    assert "engine_torque" not in text
