"""What a long drive takes of the memory, and that its stretches are as the whole."""

import tracemalloc
from dataclasses import replace

import numpy as np
import polars as pl
from numpy.testing import assert_array_equal

from weighbridge import read_drive
from weighbridge.navigation import find_motion
from weighbridge.simulation import make_scenario, simulate_car


def test_lowpass_in_stretches_is_that_of_the_whole_to_the_last_bit(monkeypatch):
    drive = simulate_car(replace(make_scenario("car", seed=5), duration=200.0)).drive
    imu = [s for n, s in drive.signals.items() if n.startswith(("accel", "gyro"))]
    keep = (imu[0].time < 100.0) | (imu[0].time > 111.0)
    gapped = drive.with_signals(
        *(replace(s, time=s.time[keep], values=s.values[keep]) for s in imu)
    )
    whole = find_motion(gapped)
    monkeypatch.setattr("weighbridge.navigation.aiding._AT_ONCE", 37)
    parts = find_motion(gapped)
    assert_array_equal(parts.specific_force, whole.specific_force)
    assert_array_equal(parts.grade, whole.grade)


def bytes_per_sample(duration):
    """Bytes that navigation takes at most for each inertial sample of a drive [B]."""
    scenario = make_scenario("car", seed=5)
    drive = simulate_car(replace(scenario, duration=duration)).drive
    tracemalloc.start()
    try:
        find_motion(drive)
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


def test_a_table_read_in_stretches_is_the_table(tmp_path):
    """More than a million rows, of which some cells are empty, and some no numbers."""
    count = (1 << 20) + 1000
    values = np.random.default_rng(2).uniform(10.0, 20.0, count)
    values[[5, count - 500]] = np.nan
    empty = np.arange(count) % 7 == 0
    table = pl.DataFrame({"time_s": 0.01 * np.arange(count), "vehicle_speed_mps": values})
    gaps = pl.when(pl.lit(pl.Series(empty))).then(None).otherwise(pl.col("vehicle_speed_mps"))
    table.with_columns(gnss_speed_mps=gaps).write_parquet(tmp_path / "log.parquet")
    drive = read_drive(tmp_path / "log.parquet")
    for name, known in (
        ("vehicle_speed", np.isfinite(values)),
        ("gnss_speed", np.isfinite(values) & ~empty),
    ):
        assert_array_equal(drive.signals[name].time, 0.01 * np.flatnonzero(known))
        assert_array_equal(drive.signals[name].values, values[known])
    assert "file.cells_nan" in {note.id for note in drive.problems}
