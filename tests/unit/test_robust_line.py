"""Robust lines against least squares of NumPy, weighed anew in the same way."""

import numpy as np
from numpy.testing import assert_allclose

from weighbridge.balance.witness import ROUNDS, robust_fit
from weighbridge.kernels.robust_line import lines_without_parts, robust_line


def test_robust_lines_are_those_of_least_squares_weighed_anew_without_a_part():
    rng = np.random.default_rng(8)
    x = rng.uniform(0.0, 10.0, 400)
    y = 3.0 * x + 5.0 + 0.1 * rng.standard_t(2.0, size=400)
    y[100:150] += 8.0
    for size in (50, 33):
        begins = np.array([0, 100, 400 - size])
        for begin, found in zip(
            begins, lines_without_parts(x, y, begins, size, ROUNDS), strict=True
        ):
            part = slice(begin, begin + size)
            left, right = np.delete(x, part), np.delete(y, part)
            expected = robust_fit(np.column_stack([left, np.ones_like(left)]), right)
            assert_allclose(found, expected, rtol=1e-9)
    expected = robust_fit(np.column_stack([x, np.ones_like(x)]), y)
    assert_allclose(robust_line(x, y, 0, 0, ROUNDS), expected, rtol=1e-9)
