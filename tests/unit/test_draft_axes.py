"""Axes of a sensor: one unit for all of them, and what the name of the file says of bare ones."""

import numpy as np
import polars as pl
import pytest

from weighbridge import read_drives
from weighbridge.io import draft_table, mapping_text

T = np.arange(0.0, 60.0, 0.05)


def gyro(path, size, names=("gyroX", "gyroY", "gyroZ")):
    heights = (0.1 * size, 0.08 * size, size)
    columns = {n: h * np.sin(T) for n, h in zip(names, heights, strict=True)}
    pl.DataFrame({"Time (s)": T} | columns).write_csv(path)
    return draft_table(path)


@pytest.mark.parametrize(("size", "unit"), [(35.0, "degps"), (0.6, "radps")])
def test_a_gyroscope_has_one_unit_by_its_largest_axis(tmp_path, size, unit):
    found = gyro(tmp_path / "phone.csv", size)
    assert [(c.quantity, c.unit) for c in found.known] == [(f"gyro_{a}", unit) for a in "xyz"]
    assert len(found.all_questions) == 3


def test_a_stated_unit_is_that_of_the_other_axes(tmp_path):
    names = ("gyroX", "gyroY", "gyroZ (deg/s)")
    assert {c.unit for c in gyro(tmp_path / "phone.csv", 2.0, names).known} == {"degps"}


def test_a_quiet_day_takes_the_unit_of_a_lively_one(weighbridge, tmp_path):
    paths = [tmp_path / f"{size}.csv" for size in (2.0, 35.0)]
    drafts = [gyro(path, float(path.stem)) for path in paths]
    assert [{c.unit for c in one.known} for one in drafts] == [{"radps"}, {"degps"}]
    assert weighbridge("map", *paths, "-o", tmp_path / "map.toml").code == 0
    text = (tmp_path / "map.toml").read_text(encoding="utf-8")
    assert text.count('unit = "degps"') == 3


@pytest.mark.parametrize(
    ("file", "unit", "quantities"),
    [
        ("Accelerometer.csv", "m/s^2", ["accel_x", "accel_y", "accel_z"]),
        ("Gyroscope.csv", "rad/s", ["gyro_x", "gyro_y", "gyro_z"]),
    ],
)
def test_of_bare_axes_the_file_name_says_what_they_are(tmp_path, file, unit, quantities):
    columns = {f"{a} ({unit})": 0.1 * np.sin(T) + 9.0 * (a == "Z") for a in "XYZ"}
    pl.DataFrame({"Time (s)": T} | columns).write_csv(tmp_path / file)
    found = draft_table(tmp_path / file)
    assert [c.quantity for c in found.known] == quantities
    assert all(c.stated for c in found.known)


def test_a_clock_that_begins_anew_is_told_as_it_is_read(tmp_path):
    time, wheel = np.tile(np.arange(0.0, 400.0, 0.25), 2), np.full(3200, 50.0)
    log = tmp_path / "two.csv"
    pl.DataFrame({"Time (s)": time, "Vehicle speed (km/h)": wheel}).write_csv(log)
    found = draft_table(log)
    assert any("the clock begins anew" in d and "2 recordings" in d for d in found.questions)
    (tmp_path / "map.toml").write_text(mapping_text([found]), encoding="utf-8")
    assert len(read_drives(log, tmp_path / "map.toml")) == 2
