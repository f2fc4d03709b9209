"""Searches for the lowest point of a function."""

import numpy as np
import pytest

from weighbridge.signals import lowest_by_simplex, lowest_by_slopes


def bent(x):
    """Valley that turns, lowest at (1, 1): Rosenbrock's, flatter."""
    return float((1.0 - x[0]) ** 2 + 10.0 * (x[1] - x[0] ** 2) ** 2)


def test_the_end_of_a_bent_valley_is_found():
    by_slopes = lowest_by_slopes(bent, np.zeros(2), close=1e-9, farthest=5.0)
    by_simplex, value = lowest_by_simplex(bent, np.zeros(2), np.full(2, 0.2), close=1e-4)
    assert by_slopes == pytest.approx([1.0, 1.0], abs=1e-2)
    assert by_simplex == pytest.approx([1.0, 1.0], abs=1e-2)
    assert value == bent(by_simplex)


def test_numbers_of_unlike_slopes_are_found_together():
    goal, weight = np.array([0.7, -1.2, 0.1]), np.array([1.0, 300.0, 8.0])

    def misfit(x):
        return float(weight @ (x - goal) ** 2)

    by_slopes = lowest_by_slopes(misfit, np.zeros(3), close=1e-6, farthest=5.0)
    by_simplex, _ = lowest_by_simplex(misfit, np.zeros(3), np.full(3, 0.3), close=1e-4)
    assert by_slopes == pytest.approx(goal, abs=2e-3)
    assert by_simplex == pytest.approx(goal, abs=1e-2)


def test_steps_of_a_function_do_not_mislead_the_simplex():
    def stepped(x):
        return float(20.0 * (x[0] - 1.5) ** 2) + 3.0 * (int(40.0 * x[0]) % 2)

    x, _ = lowest_by_simplex(stepped, np.zeros(1), np.full(1, 0.2), close=0.01)
    assert x[0] == pytest.approx(1.5, abs=0.15)


def test_numbers_stay_within_what_is_allowed():
    x = lowest_by_slopes(lambda x: float(np.sum(np.exp(-x))), np.zeros(2), close=1e-4, farthest=2.0)
    assert x == pytest.approx([2.0, 2.0])


def test_a_search_by_a_simplex_ends_where_it_is_said_to():
    x, value = lowest_by_simplex(
        bent, np.zeros(2), np.full(2, 0.2), close=1e-6, done=lambda x, value: value < 0.5
    )
    assert 0.01 < value < 0.5
    assert value == bent(x)
