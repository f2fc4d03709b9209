"""What a long drive takes of the memory, and that its stretches are as the whole."""

import tracemalloc
from dataclasses import replace

import numpy as np
import polars as pl
from numpy.testing import assert_array_equal

from weighbridge.io import parquet
from weighbridge.navigation import aiding
from weighbridge.navigation.aiding import resample
from weighbridge.navigation.inertial import inertial_motion
from weighbridge.simulation import make_scenario, simulate_car


def test_lowpass_in_stretches_is_that_of_the_whole_to_the_last_bit(monkeypatch):
    rng = np.random.default_rng(3)
    time = np.sort(rng.uniform(0.0, 60.0, 12_000))
    time = time[(time < 20.0) | (time > 31.0)]
    axes = rng.normal(size=(3, time.size))
    whole = resample(time, axes, 0.3, 0.05, 1190)
    monkeypatch.setattr(aiding, "_AT_ONCE", 37)
    assert_array_equal(resample(time, axes, 0.3, 0.05, 1190), whole)
    assert np.isnan(whole).any()


def bytes_per_sample(duration):
    """Bytes that navigation takes at most for each inertial sample of a drive [B]."""
    scenario = make_scenario("car", seed=5)
    drive = simulate_car(replace(scenario, duration=duration)).drive
    tracemalloc.start()
    try:
        inertial_motion(drive)
        return tracemalloc.get_traced_memory()[1] / len(drive.signals["accel_x"])
    finally:
        tracemalloc.stop()


def test_memory_grows_with_the_samples_and_slowly():
    # What is compiled and imported on the way is no part of it.
    bytes_per_sample(200.0)
    # Columns of doubles: the inertial signals themselves are seven, beside these.
    long = bytes_per_sample(2000.0)
    assert long < 8 * 10
    assert long < 1.05 * bytes_per_sample(1000.0)


def test_a_table_read_in_stretches_is_the_table(tmp_path, monkeypatch):
    values = np.random.default_rng(2).normal(size=1000)
    values[[5, 500]] = np.nan
    cells = pl.Series("b", values).to_frame().with_row_index("n")
    cells = cells.with_columns(a=pl.when(pl.col("n") % 7 == 0).then(None).otherwise(pl.col("b")))
    cells.write_parquet(tmp_path / "log.parquet", row_group_size=300)
    monkeypatch.setattr(parquet, "_ROWS", 64)
    read = parquet.read_parquet(tmp_path / "log.parquet")
    assert read.names == ("n", "b", "a")
    assert read.rows == 1000
    found, notes = read.numbers(1)
    assert_array_equal(found, values)
    assert [note.id for note in notes] == ["file.cells_nan"]
    gaps, notes = read.numbers(2)
    assert_array_equal(np.isnan(gaps), np.isnan(values) | (np.arange(1000) % 7 == 0))
    assert [note.id for note in notes] == ["file.cells_nan"]
    assert_array_equal(read.numbers(0)[0], np.arange(1000.0))
