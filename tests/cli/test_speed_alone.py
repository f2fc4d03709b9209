"""Calibrating and weighing by speed alone, end to end."""

import json

import numpy as np
import polars as pl
import pytest
from tests.noted import named, says


def speeds(seed, seconds=1200):
    """Speed over time that rises and falls without braking [km/h]."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 0.5)
    waves = sum(
        rng.uniform(0.5, 1.0) * np.sin(2.0 * np.pi * time / period + rng.uniform(0.0, 6.0))
        for period in (97.0, 143.0, 211.0, 307.0)
    )
    return time, np.round(65.0 + 6.0 * waves)


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    folder = tmp_path_factory.mktemp("known")
    time, speed = speeds(1)
    pl.DataFrame({"time_s": time, "vehicle_speed_kmh": speed}).write_csv(folder / "obd.csv")
    grade = 0.01 * np.sin(time / 47.0)
    pl.DataFrame({"time_s": time, "grade_rad": grade}).write_csv(folder / "gnss.csv")
    return folder


@pytest.fixture
def car(known, tmp_path, weighbridge):
    path = tmp_path / "car.toml"
    done = weighbridge("calibrate", known, "--mass", 1092, "--method", "speed-ekf", "-o", path)
    assert done.code == 0
    assert "gives back" in " ".join(done.out.split())
    return path


@pytest.fixture
def alone(tmp_path):
    """Return a drive of which only the speed was recorded."""
    path = tmp_path / "alone.csv"
    time, speed = speeds(2)
    pl.DataFrame({"time_s": time, "vehicle_speed_kmh": speed}).write_csv(path)
    return path


def test_speed_alone_is_weighed_and_says_why_there_is_no_mass(weighbridge, car, alone, tmp_path):
    track, report = tmp_path / "track.csv", tmp_path / "report.html"
    done = weighbridge(
        "weigh", alone, "--vehicle", car, "--method", "speed-ekf",
        "--json", "-", "--track", track, "--report", report,
    )  # fmt: skip
    assert done.code == 1
    said = json.loads(done.out)
    assert (said["status"], said["mass_kg"]) == ("not_excited", None)
    assert said["reason_id"] == "speed.no_mass"
    assert says(said["reason"], "speed.no_mass", first=1092.0)
    assert said["used_s"] > 900.0
    page = report.read_text(encoding="utf-8")
    assert "No road grade" in page
    assert "No drive helps, however long or hilly" in page
    assert "firm accelerations" not in page
    assert "Do not read a mass off this line" in page
    assert "Trust a running mass" not in page
    assert "Force over specific force" not in page
    running = pl.read_csv(track)["mass_kg"].drop_nulls().to_numpy()
    assert running[-1] == pytest.approx(1092.0, rel=0.02)


def test_other_methods_still_ask_for_torque(weighbridge, car, alone):
    assert 'method = "speed-ekf"' in car.read_text(encoding="utf-8")
    for method in ("rls", "ekf"):
        done = weighbridge("weigh", alone, "--vehicle", car, "--method", method)
        assert done.code == 1
        assert says(done.out, "vehicle.no_torque_fit", fit="speed-ekf")


def test_vehicle_without_a_speed_model(weighbridge, alone, tmp_path):
    path = tmp_path / "other.toml"
    path.write_text('[vehicle]\nname = "other"\n', encoding="utf-8")
    done = weighbridge("weigh", alone, "--vehicle", path, "--method", "speed-ekf")
    assert done.code == 2
    assert named(done.err, "other [speed_model] speed-ekf")


@pytest.mark.parametrize("option", [("--torque", "load"), ("--order", 1), ("--straight",)])
def test_options_about_torque_are_refused(weighbridge, known, tmp_path, option):
    done = weighbridge(
        "calibrate", known, "--mass", 1092, "--method", "speed-ekf", *option,
        "-o", tmp_path / "car.toml",
    )  # fmt: skip
    assert done.code == 2
    assert named(done.err, option[0], "--method speed-ekf")


def test_calibration_without_grade_says_so(weighbridge, alone, tmp_path):
    done = weighbridge(
        "calibrate", alone, "--mass", 1092, "--method", "speed-ekf", "-o", tmp_path / "car.toml"
    )
    assert done.code == 2
    assert says(done.err, "calibration.no_grade")


def test_inspect_lists_the_way_and_promises_no_mass(weighbridge, alone):
    done = weighbridge("inspect", alone)
    assert "No way to weigh by this drive" in done.out
    assert "speed-ekf" in done.out
    assert "no mass" in done.out


def test_inspect_expects_no_mass_of_speed_alone(weighbridge, alone):
    done = weighbridge("inspect", alone)
    way = next(line for line in done.out.splitlines() if "speed-ekf" in line)
    assert "none" in way
    assert "±" not in way


def test_a_poor_fit_is_told(weighbridge, known, tmp_path):
    drive = tmp_path / "other"
    drive.mkdir()
    time, speed = speeds(1)
    pl.DataFrame({"time_s": time, "vehicle_speed_kmh": speed}).write_csv(drive / "obd.csv")
    # A grade that the speed answers: uphill it falls. The other has nothing to do with it.
    kmh = 65.0 + np.convolve(speed - 65.0, np.ones(20) / 20.0, "same")
    grade = -np.gradient(kmh / 3.6, time) / 9.81
    pl.DataFrame({"time_s": time, "grade_rad": grade}).write_csv(drive / "gnss.csv")
    for folder, told in ((known, True), (drive, False)):
        path = tmp_path / f"{folder.name}.toml"
        done = weighbridge("calibrate", folder, "--mass", 1092, "--method", "speed-ekf", "-o", path)
        assert done.code == 0
        text = " ".join(done.out.split())
        assert ("note: " in text and says(text, "calibration.speed_poor")) is told
