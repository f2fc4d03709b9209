"""Windows of usable rows."""

import numpy as np
from numpy.testing import assert_allclose

from weighbridge.balance import windows


def test_windows_never_cross_an_unusable_row_or_a_pause():
    time = np.arange(80) * 0.25
    usable = np.ones(80, dtype=bool)
    usable[[7, 8, 9, 10]] = False
    cut = windows(time, usable, length=2.0)
    for k in range(cut.count.size):
        members = cut.index[cut.window == k]
        assert np.all(np.diff(members) == 1)
        assert time[members[-1]] - time[members[0]] < 2.0
    assert not np.isin([7, 8, 9, 10], cut.index).any()


def test_means_are_means_of_the_same_rows_on_both_sides():
    rng = np.random.default_rng(1)
    time = np.sort(rng.uniform(0.0, 100.0, 400))
    usable = rng.random(400) < 0.9
    values = rng.normal(size=(400, 3))
    cut = windows(time, usable, length=2.5)
    expected = np.array(
        [values[cut.index[cut.window == k]].mean(axis=0) for k in range(cut.count.size)]
    )
    assert_allclose(cut.mean(values), expected)
    assert_allclose(cut.mean(values[:, 1]), expected[:, 1])
    assert cut.count.size > 20


def test_too_few_rows_make_no_window():
    assert windows(np.arange(5.0), np.zeros(5, dtype=bool)).count.size == 0
    lonely = np.zeros(40, dtype=bool)
    lonely[::8] = True
    assert windows(np.arange(40) * 0.25, lonely).count.size == 0
