"""Files that read alike, and what columns of one log tell of each other."""

import tomllib
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import weighbridge as wb
from weighbridge.io import draft_table

TIME = np.arange(0.0, 20.0, 0.1)


def day(path: Path, **columns) -> Path:
    pl.DataFrame({"t_s": TIME} | columns).write_parquet(path)
    return path


@pytest.fixture
def days(tmp_path):
    slow, fast = np.linspace(0.0, 20.0, TIME.size), np.linspace(0.0, 90.0, TIME.size)
    return [
        day(tmp_path / "2024-03-11.parquet", wheel_spd=slow, eng_rpm=40.0 * slow + 600.0),
        day(tmp_path / "2024-03-12.parquet", wheel_spd=fast, eng_rpm=10.0 * fast + 600.0),
    ]


def mapped(weighbridge, output, *paths):
    """Return the mapping that the command drafts of some files."""
    assert weighbridge("map", *paths, "-o", output, "--force").code == 0
    return tomllib.loads(output.read_text(encoding="utf-8"))


def test_days_of_one_logger_get_one_mapping_that_fits_other_days(weighbridge, days, tmp_path):
    mapping = tmp_path / "map.toml"
    # Alone the slow day would be taken for m/s.
    alone = mapped(weighbridge, mapping, days[0])
    assert alone["signals"]["vehicle_speed"]["unit"] == "mps"
    one = mapped(weighbridge, mapping, *days)
    assert "tables" not in one
    assert one["signals"]["vehicle_speed"]["unit"] == "kmh"
    for path, top in zip(days, (20.0, 90.0), strict=True):
        read = wb.read_drive(path, mapping)
        assert read.signals["vehicle_speed"].values.max() == pytest.approx(top / 3.6)
    third = day(tmp_path / "another.parquet", wheel_spd=TIME, eng_rpm=TIME + 600.0)
    assert wb.read_drive(third, mapping).signals["engine_speed"].duration > 19.0


def test_files_of_other_columns_or_stated_units_are_not_alike(weighbridge, days, tmp_path):
    other = day(tmp_path / "b.parquet", speed_kmh=TIME, eng_rpm=TIME + 600.0)
    assert len(mapped(weighbridge, tmp_path / "map.toml", days[0], other)["tables"]) == 2


@pytest.mark.parametrize(
    ("high", "reference", "quantity", "unit"),
    [
        (104.0, 1100.0, "engine_torque_fraction", "pct"),
        (1.04, 1100.0, "engine_torque_fraction", "ratio"),
        (900.0, 1100.0, "engine_torque", "nm"),
        (104.0, None, "engine_torque", "nm"),
    ],
)
def test_a_torque_without_unit_is_a_percent_beside_its_reference(
    tmp_path, high, reference, quantity, unit
):
    columns = {"trq_act": np.linspace(-0.1 * high, high, TIME.size), "eng_rpm": TIME + 900.0}
    if reference is not None:
        columns["trq_ref"] = np.full(TIME.size, reference)
    known = {c.name: c for c in draft_table(day(tmp_path / "a.parquet", **columns)).known}
    assert (known["trq_act"].quantity, known["trq_act"].unit) == (quantity, unit)
    assert "states no unit" in known["trq_act"].question
