"""The search for delay and lag."""

import numpy as np
import pytest

from weighbridge.balance.delay import FARTHEST, best_delay
from weighbridge.calibration.joint import USUAL_DELAY, find_timing


def test_the_lowest_point_is_found_between_grid_points():
    assert best_delay(lambda d: (d - 0.137) ** 2) == pytest.approx(0.137, abs=1e-6)
    assert best_delay(lambda d: abs(d - 0.213) ** 1.5) == pytest.approx(0.213, abs=0.005)


def test_no_delay_is_told_at_an_end_or_without_rows():
    assert np.isnan(best_delay(lambda d: d))
    assert np.isnan(best_delay(lambda d: float("nan")))


@pytest.mark.parametrize("true", [-1.37, -0.55, 1.83])
def test_the_search_goes_on_beyond_an_end(true):
    assert best_delay(lambda d: (d - true) ** 2) == pytest.approx(true, abs=1e-6)


def test_the_search_goes_no_farther_than_its_farthest():
    tried = []
    assert np.isnan(best_delay(lambda d: tried.append(d) or d))
    assert min(tried) == pytest.approx(-FARTHEST)


@pytest.mark.parametrize(("delay", "lag"), [(-1.4, 0.3), (-0.1, 0.2), (1.6, 0.1)])
def test_delay_and_lag_are_found_far_off_too(delay, lag):
    def misfits(pairs):
        return np.array([(d + x - delay - lag) ** 2 + 0.5 * (x - lag) ** 2 for d, x in pairs])

    found, found_lag, told, _ = find_timing(misfits)
    assert told
    assert found_lag == lag
    assert found == pytest.approx(delay, abs=0.01)


def test_a_search_that_ends_at_its_end_says_so():
    found, lag, told, _ = find_timing(lambda pairs: np.array([d + x for d, x in pairs]))
    assert not told
    assert found + lag < USUAL_DELAY
