"""Windows row by row against windows of a whole drive."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from weighbridge.balance import window_params, windows
from weighbridge.kernels import window_means

PARAMS = window_params(0.1, long_gap=20.0)


def drive(seed, rows=1500):
    """Rows at 10 Hz with gaps, stretches that are not usable and stops."""
    random = np.random.default_rng(seed)
    step = np.where(random.random(rows) < 0.005, 3.0, 0.1) * random.uniform(0.95, 1.05, rows)
    time = np.cumsum(step)
    usable = np.repeat(random.random(rows // 25) < 0.7, 25) & (random.random(rows) < 0.97)
    moving = np.repeat(random.random(rows // 150) < 0.7, 150) | usable
    return time, usable, moving, random.normal(size=(rows, 3))


def run(pieces, values):
    state = window_means.initial_state(values.shape[1])
    found = []
    for time, usable, moving, part in pieces:
        state, means, count, stood = window_means.run(state, time, usable, moving, part, PARAMS)
        found.append((means, count, stood))
    end = np.array([time[-1] + 100.0])
    no = np.zeros(1, dtype=bool)
    _, means, count, stood = window_means.run(state, end, no, no, values[:1], PARAMS)
    found.append((means, count, stood))
    return [np.concatenate(parts) for parts in zip(*found, strict=True)]


@pytest.mark.parametrize("seed", range(5))
def test_windows_are_those_of_the_whole_drive(seed):
    time, usable, moving, values = drive(seed)
    means, count, _ = run([(time, usable, moving, values)], values)
    whole = windows(time, usable)
    assert whole.count.size > 10
    assert_array_equal(count, whole.count)
    assert_array_equal(means, whole.mean(values))


@given(st.lists(st.integers(1, 1499), max_size=40), st.integers(0, 5))
@settings(max_examples=30, deadline=None)
def test_blocks_change_no_bit(cuts, seed):
    time, usable, moving, values = drive(seed)
    edges = [0, *sorted(set(cuts)), time.size]
    parts = [(time[a:b], usable[a:b], moving[a:b], values[a:b]) for a, b in pairwise(edges)]
    for one, many in zip(run([(time, usable, moving, values)], values), run(parts, values),
                         strict=True):  # fmt: skip
        assert_array_equal(one, many)


def test_a_standstill_is_told_to_the_window_after_it():
    time = np.arange(0.0, 60.0, 0.1)
    moving = (time < 20.0) | (time > 50.0)
    usable = moving & (time > 5.0) & ((time < 18.0) | (time > 50.5))
    _, _, stood = run([(time, usable, moving, time[:, None])], time[:, None])
    assert np.count_nonzero(stood > 1.0) == 1
    assert stood.max() == pytest.approx(30.1, abs=0.11)
