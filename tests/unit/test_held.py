"""A value that is repeated because nothing new came is one measurement."""

import numpy as np
import pytest

from weighbridge import Drive, Signal
from weighbridge.checks import correct_drive


def held(time, period, values, rng=None):
    """Repeat values of a clock of ``period`` in the rows at ``time``, as a logger does."""
    last = np.floor(time / period + 1e-9).astype(int)
    return values[last]


def judged(signal):
    """Return what is kept of a signal."""
    return correct_drive(Drive("d", {signal.name: signal})).signals[signal.name]


def changes(x):
    return np.concatenate(([True], x[1:] != x[:-1]))


@pytest.mark.parametrize(("row", "period"), [(0.1, 0.5), (0.1, 0.2), (0.208, 1.0), (0.05, 1.0)])
@pytest.mark.parametrize("step", [0.0, 0.5])
def test_repeats_of_a_slower_source_are_one_value_each(row, period, step):
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 600.0, row)
    source = np.cumsum(rng.normal(size=3002)) * period
    if step:
        source = step * np.round(source / step)
    x = held(time, period, source / np.ptp(source))
    kept = judged(Signal("altitude", time, x))
    assert kept.duration / (len(kept) - 1) == pytest.approx(period, rel=0.02)
    assert len(kept) == pytest.approx(600.0 / period, rel=0.03)
    # Nothing is lost: each change of the values is there.
    assert np.isin(time[changes(x)], kept.time).all()


@pytest.mark.parametrize("step", [1e-6, 1.0])
@pytest.mark.parametrize("pull", [0.3, 1.0, 3.0])
def test_a_coarse_speed_is_no_repeated_one(step, pull):
    """Whole km/h of a vehicle that speeds up slowly stay for many rows, at any time."""
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 900.0, 0.1)
    slow = np.interp(time, np.arange(0.0, 910.0, 10.0), rng.normal(size=91)) * pull
    speed = np.clip(40.0 + 3.6 * np.cumsum(slow) * 0.1, 0.0, None)
    x = step * np.round(speed / step)
    assert len(judged(Signal("vehicle_speed", time, x / 3.6))) == time.size


def test_fixes_in_a_fast_table_are_left_once_with_all_they_say():
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 300.0, 0.2)
    fixes = {
        "latitude": 0.8 + 1e-6 * np.cumsum(rng.normal(size=301)),
        "longitude": np.full(301, 0.2),
        "altitude": np.round(np.cumsum(rng.normal(size=301)), 0),
    }
    signals = {n: Signal(n, time, held(time, 1.0, v)) for n, v in fixes.items()}
    speed = Signal("vehicle_speed", time, np.abs(np.cumsum(rng.normal(size=time.size))))
    drive = correct_drive(Drive("held", {**signals, "vehicle_speed": speed}))
    for name, values in fixes.items():
        assert np.array_equal(drive.signals[name].values, values[:300]), name
        assert np.array_equal(drive.signals[name].time, np.arange(300.0)), name
    assert len(drive.signals["vehicle_speed"]) == time.size
    assert not any(p.id == "range.repeats" for p in drive.problems)


def test_a_torque_that_is_renewed_slowly_is_reported(short_drive):
    load = short_drive.drive.signals["engine_load"]
    time = np.arange(load.time[0], load.time[-1], 0.1)
    fast = Signal(
        "engine_load", time, load.at(load.time[0] + np.floor((time - time[0]) / 0.9) * 0.9)
    )
    drive = correct_drive(short_drive.drive.with_signals(fast))
    (found,) = (p for p in drive.problems if p.id == "range.repeats")
    assert found.signal == "engine_load"
    assert found.values["renewed"] == pytest.approx(0.9, abs=0.02)
    assert drive.signals["engine_load"].period == pytest.approx(0.9, abs=0.02)
