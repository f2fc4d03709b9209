"""The search for delay and lag."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.signal import lfilter

import weighbridge as wb
from weighbridge.calibration.joint import USUAL_DELAY, USUAL_LAG, find_timing
from weighbridge.kernels.first_order import even_lag, fading, first_order
from weighbridge.simulation import Sensors, make_scenario, simulate_car


@pytest.mark.parametrize(("delay", "lag"), [(-1.4, 0.3), (-0.1, 0.2), (1.6, 0.1)])
def test_delay_and_lag_are_found_far_off_too(delay, lag):
    def misfits(pairs):
        return np.array(
            [1e5 * ((d + x - delay - lag) ** 2 + 0.5 * (x - lag) ** 2) for d, x in pairs]
        )

    found, found_lag, told, _ = find_timing(misfits)
    assert told
    assert found_lag == pytest.approx(lag, abs=0.005)
    assert found + found_lag == pytest.approx(delay + lag, abs=0.005)


def test_a_lag_that_the_drives_do_not_show_is_the_usual_one():
    _, lag, told, _ = find_timing(lambda pairs: np.array([1e4 * (d + x) ** 2 for d, x in pairs]))
    assert told
    assert lag == pytest.approx(USUAL_LAG, abs=0.005)


def test_a_search_that_ends_at_its_end_says_so():
    found, lag, told, _ = find_timing(lambda pairs: np.array([d + x for d, x in pairs]))
    assert not told
    assert found + lag < USUAL_DELAY


@pytest.mark.parametrize("lag", [0.02, 0.3])
def test_an_uneven_lag_answers_a_ramp_as_the_equation_says(lag):
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.0, 0.3, 200))
    ramp = 2.0 + 3.0 * (time - time[0])
    expected = ramp - 3.0 * lag * (1.0 - np.exp(-(time - time[0]) / lag))
    assert first_order(time, ramp, lag) == pytest.approx(expected, abs=1e-9)


def test_an_uneven_lag_begins_anew_where_nothing_is_known():
    values = np.array([1.0, 1.0, np.nan, 5.0, 5.0])
    out = first_order(0.1 * np.arange(5), values, 0.2)
    assert out == pytest.approx([1.0, 1.0, np.nan, 5.0, 5.0], nan_ok=True)


@pytest.mark.parametrize("lag", [0.02, 0.3])
def test_an_even_lag_is_the_filter_of_scipy_to_the_last_bit(lag):
    values = np.random.default_rng(7).normal(0.0, 1e3, 500)
    keep = float(np.exp(-1.0 / (100.0 * lag)))
    told, _ = lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * 3.0])
    assert_array_equal(even_lag(values, keep, 3.0), told)


def test_what_fades_is_the_sum_of_what_came_before():
    values, keep = np.random.default_rng(8).normal(size=40), 0.8
    apart = np.subtract.outer(np.arange(40), np.arange(40))
    weights = np.where(apart > 0, keep ** np.maximum(apart, 0), 0.0)
    assert_allclose(fading(values, keep), weights @ values, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("smoothing", [0.1, 0.3])
def test_noise_of_the_motion_does_not_pass_for_a_smoothed_reading(smoothing):
    scenario = make_scenario("car-calibration", seed=88103)
    smoothed = replace(scenario.car, load_smoothing=smoothing)
    sensors = Sensors(imu_rate=50.0)
    known = simulate_car(replace(scenario, car=smoothed, sensors=sensors, duration=1800.0))
    timing = wb.calibrate([known.drive], mass=float(known.truth.mass.mean())).timing
    assert timing.torque_lag == pytest.approx(smoothing, abs=0.08)
