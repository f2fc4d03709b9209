"""The delay search."""

import numpy as np
import pytest

from weighbridge.balance.delay import best_delay


def test_the_lowest_point_is_found_between_grid_points():
    assert best_delay(lambda d: (d - 0.137) ** 2) == pytest.approx(0.137, abs=1e-6)
    assert best_delay(lambda d: abs(d - 0.213) ** 1.5) == pytest.approx(0.213, abs=0.005)


def test_no_delay_is_told_at_an_end_or_without_rows():
    assert np.isnan(best_delay(lambda d: d))
    assert np.isnan(best_delay(lambda d: float("nan")))
