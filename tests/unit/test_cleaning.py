"""Cleaning: what is left out is counted, and what is left is what was recorded."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import has

from weighbridge.signals import clean_columns, clean_signal, spread_rows


def test_clean_table_shares_its_arrays():
    time = np.arange(10.0)
    values = np.sin(time)
    signals, problems = clean_columns(time, [("accel_x", values), ("accel_y", values)], "imu.csv")
    assert problems == []
    assert all(s.time is time for s in signals)
    assert signals[0].values is values


def test_columns_with_the_same_rows_share_one_clock():
    time = np.arange(10.0)
    holes = np.where(time % 2 == 0, np.nan, time)
    signals, _ = clean_columns(time, [("accel_x", holes), ("accel_y", -holes)], "imu.csv")
    assert signals[0].time is signals[1].time
    assert_array_equal(signals[0].time, [1.0, 3.0, 5.0, 7.0, 9.0])
    assert_array_equal(signals[1].values, [-1.0, -3.0, -5.0, -7.0, -9.0])


def kept(time, source="obd.csv"):
    """Instants and rows that are kept of a clock, and what is said of the others."""
    rows = np.arange(len(time), dtype=np.float64)
    signal, problems = clean_signal("odometer", np.asarray(time), rows, source)
    if signal is None:
        return np.empty(0), np.empty(0), problems
    return signal.time, signal.values, problems


def test_repeated_stamp_keeps_the_first_row():
    _, rows, (problem,) = kept([0.0, 1.0, 1.0, 2.0])
    assert_array_equal(rows, [0, 1, 3])
    assert problem.id == "clock.repeated"
    assert (problem.values["count"], problem.values["rows"]) == (1, 4)


def test_rows_of_whole_seconds_are_spread_over_the_second():
    true = 100.5 + 0.25 * np.arange(400)
    speed = np.sin(0.1 * true)
    signals, problems = clean_columns(np.floor(true), [("vehicle_speed", speed)], "obd.csv")
    assert len(signals[0]) == 400
    assert_allclose(signals[0].time, true, atol=1e-9)
    assert_array_equal(signals[0].values, speed)
    assert [p.id for p in problems] == ["clock.coarse"]
    assert has(problems, "clock.coarse", source="obd.csv", step=1.0)


def test_rows_that_come_unevenly_stay_in_their_second():
    rng = np.random.default_rng(4)
    true = np.cumsum(rng.uniform(0.1, 0.5, 300))
    true = true[(true < 30.0) | (true > 47.0)]
    spread, step = spread_rows(np.floor(true))
    assert step == 1.0
    assert (np.diff(spread) > 0.0).all()
    assert_array_equal(np.floor(spread), np.floor(true))
    assert float(np.abs(spread - true).max()) < 0.5
    assert float(np.std(spread - true)) < 0.15


def test_a_few_repeated_rows_are_no_coarse_clock():
    time = np.sort(np.concatenate([np.arange(100.0), np.arange(0.0, 100.0, 10.0)]))
    assert spread_rows(time) is None
    assert len(clean_signal("vehicle_speed", time, np.ones(110), "obd.csv")[0]) == 100


def test_values_read_together_one_to_a_row_keep_their_stamp():
    time = np.repeat(np.arange(0.0, 30.0), 2)
    first, second = np.tile([1.0, np.nan], 30), np.tile([np.nan, 2.0], 30)
    signals, problems = clean_columns(
        time, [("vehicle_speed", first), ("engine_speed", second)], "obd.csv"
    )
    assert problems == []
    assert [s.name for s in signals] == ["vehicle_speed", "engine_speed"]
    for signal in signals:
        assert_array_equal(signal.time, np.arange(30.0))


@pytest.mark.parametrize("order", ["reversed", "shuffled", "as text", "in blocks"])
def test_rows_out_of_order_are_sorted(order):
    time = 0.02 * np.arange(20_000)
    rows = {
        "reversed": np.arange(time.size)[::-1],
        "shuffled": np.random.default_rng(1).permutation(time.size),
        "as text": np.array(sorted(range(time.size), key=lambda k: f"{time[k]:.2f}")),
        "in blocks": np.arange(time.size).reshape(-1, 50)[:, ::-1].ravel(),
    }[order]
    signals, problems = clean_columns(time[rows], [("vehicle_speed", np.sin(time[rows]))], "x.csv")
    assert_array_equal(signals[0].time, time)
    assert_array_equal(signals[0].values, np.sin(time))
    assert [p.id for p in problems] == ["clock.sorted"]
    assert has(problems, "clock.sorted", source="x.csv", by="not in the order of their time")


@pytest.mark.parametrize("falling", [False, True])
def test_a_table_sorted_by_another_column_is_put_in_the_order_of_time(falling):
    """Signals that are polled in turn lie one to a row, and empty cells come first."""
    time = 0.1 * np.arange(6000)
    speed, revs = 15.0 + 10.0 * np.sin(0.05 * time), 200.0 + 50.0 * np.cos(0.03 * time)
    speed = np.where(np.arange(time.size) % 2 == 0, np.round(speed, 1), np.nan)
    revs = np.where(np.arange(time.size) % 2 == 1, revs, np.nan)
    key = np.nan_to_num(-speed if falling else speed, nan=-99.0)
    rows = np.argsort(key, kind="stable")
    table = [("vehicle_speed", speed[rows]), ("engine_speed", revs[rows])]
    signals, problems = clean_columns(time[rows], table, "x.csv")
    assert_array_equal(signals[0].time, time[::2])
    assert_array_equal(signals[0].values, speed[::2])
    assert_array_equal(signals[1].time, time[1::2])
    assert [p.id for p in problems] == ["clock.sorted"]
    assert has(problems, "clock.sorted", source="x.csv", by="sorted by vehicle_speed, not by time")


def test_an_odometer_that_rises_does_not_sort_a_clock_that_is_set_back():
    time = np.concatenate([95.0 * k + 0.1 * np.arange(1000) + 0.003 * k for k in range(12)])
    _, problems = clean_columns(time, [("odometer", np.arange(time.size))], "x.csv")
    assert problems[0].id == "clock.backwards"


def test_a_clock_that_is_set_back_is_not_sorted():
    # Twelve recordings of which each begins 5 s before the last ended.
    pieces = [95.0 * k + 0.1 * np.arange(1000) + 0.003 * k for k in range(12)]
    time = np.concatenate(pieces)
    signals, problems = clean_columns(time, [("vehicle_speed", time)], "x.csv")
    assert len(signals[0]) < time.size - 500
    assert problems[0].id == "clock.backwards"


def test_one_late_stamp_costs_one_row():
    time, _, (problem,) = kept([0.0, 1.0, 2.0, 0.5, 3.0, 4.0])
    assert_array_equal(time, [0.0, 1.0, 2.0, 3.0, 4.0])
    assert problem.id == "clock.backwards"
    assert (problem.values["lost"], problem.values["rows"]) == (1, 6)


def test_one_stamp_far_ahead_costs_one_row():
    time, *_ = kept([0.0, 1.0, 9e9, 3.0, 4.0, 5.0])
    assert_array_equal(time, [0.0, 1.0, 3.0, 4.0, 5.0])


def test_restarted_clock_keeps_the_longer_part():
    time, _, (problem,) = kept(np.concatenate([np.arange(100.0), np.arange(40.0)]))
    assert_array_equal(time, np.arange(100.0))
    assert problem.id == "clock.backwards"
    assert (problem.values["lost"], problem.values["rows"]) == (40, 140)


def test_missing_stamps_are_counted():
    time, _, (problem,) = kept([0.0, np.nan, np.inf, 3.0], "gnss.csv")
    assert_array_equal(time, [0.0, 3.0])
    assert problem.id == "clock.no_time"
    assert (problem.values["missing"], problem.values["rows"]) == (2, 4)


def test_infinite_values_are_counted():
    signal, problems = clean_signal(
        "accel_x", np.arange(4.0), np.array([1.0, np.inf, -np.inf, 2.0]), "imu.csv"
    )
    assert signal is not None
    assert_array_equal(signal.values, [1.0, 2.0])
    assert (problems[0].id, problems[0].signal) == ("file.infinite", "accel_x")
    assert (problems[0].values["count"], problems[0].values["samples"]) == (2, 4)


def test_column_without_values_is_told():
    signal, problems = clean_signal("gear", np.arange(3.0), np.full(3, np.nan), "obd.csv")
    assert signal is None
    assert problems[0].id == "file.empty_column"


@settings(max_examples=60, deadline=None)
@given(
    hnp.arrays(
        np.float64,
        st.integers(0, 40),
        elements=st.one_of(
            st.integers(0, 15).map(float), st.sampled_from([np.nan, np.inf, -np.inf])
        ),
    )
)
def test_clock_only_rises(time):
    found, rows, _ = kept(time)
    assert np.all(np.isfinite(found))
    assert np.all(np.diff(found) > 0.0)
    assert_array_equal(time[rows.astype(int)], found)
    assert found.size > 0 or not np.isfinite(time).any()


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(0, 12).map(float), min_size=1, max_size=14))
def test_rising_matches_a_plain_loop(stamps):
    front, highest = [], -np.inf
    for t in stamps:
        front.append(t > highest)
        highest = max(highest, t)
    back, lowest = [], np.inf
    for t in reversed(stamps):
        back.append(t < lowest)
        lowest = min(lowest, t)
    back.reverse()
    mask = front if sum(front) >= sum(back) else back
    assert_array_equal(kept(stamps)[0], np.array(stamps)[mask])
