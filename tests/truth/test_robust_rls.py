"""Robust least squares against normal equations, and what outliers do to it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from weighbridge.kernels import robust_rls


def params(**changed):
    chosen = {
        "window": 0.5,
        "period": 0.1,
        "pause": 0.8,
        "forgetting": 0.98,
        "kept_information": 0.0,
        "threshold": np.inf,
        "threshold_force": 0.0,
        "weight_information": True,
        "scale_windows": 100.0,
        "settle_windows": 10,
        "offset_std": 0.0,
        "offset_forgetting": 1.0,
        "noise_floor": 1e-4,
        "dependence": 1.0,
    }
    return robust_rls.RobustRlsParams(**(chosen | changed))


def rows(n, seed, mass=10_000.0, noise=300.0):
    rng = np.random.default_rng(seed)
    phi = 0.6 + 0.5 * np.sin(np.arange(n) * 0.01) + rng.normal(0.0, 0.05, n)
    return np.arange(n) * 0.1, phi, mass * phi + rng.normal(0.0, noise, n)


def start():
    return robust_rls.initial_state(0.0, 1e-9)


def test_equals_weighted_least_squares_of_the_window_means():
    time, phi, y = rows(600, 1)
    state, theta, _, information, mean_phi, mean_y, weight = robust_rls.run(
        start(), time, phi, y, np.ones(600, bool), params()
    )
    folded = np.flatnonzero(np.isfinite(mean_phi))
    assert_allclose(folded, np.arange(4, 600, 5))
    assert_allclose(mean_phi[folded], phi.reshape(-1, 5).mean(axis=1), rtol=1e-12)
    assert_allclose(weight[folded], 1.0)
    decay = 0.98 ** np.arange(120)[::-1]
    power = np.sum(decay * mean_phi[folded] ** 2)
    assert_allclose(state.mass, np.sum(decay * (mean_phi * mean_y)[folded]) / power, rtol=1e-9)
    assert_allclose(information[-1], power, rtol=1e-9)
    assert theta[3] == 0.0


def test_outliers_move_it_little():
    time, phi, y = rows(6000, 2)
    rng = np.random.default_rng(3)
    for k in rng.choice(1200, 90, replace=False):
        y[5 * k : 5 * k + 5] -= 6000.0
    valid = np.ones(6000, bool)
    plain = robust_rls.run(start(), time, phi, y, valid, params(forgetting=1.0))[0]
    robust = robust_rls.run(start(), time, phi, y, valid, params(forgetting=1.0, threshold=1.5))[0]
    assert plain.mass < 9600.0
    assert robust.mass == pytest.approx(10_000.0, abs=0.3 * (10_000.0 - plain.mass))


def test_an_outlier_counts_less_in_the_information_too():
    state = start()._replace(mass=10_000.0, information=50.0, noise_var=100.0**2, windows=30)
    after, weight = robust_rls.fold(state, 0.5, 5000.0 + 3000.0, params(threshold=1.5))
    assert weight == pytest.approx(1.5 * 100.0 * np.sqrt(1.0 + 0.25 / 50.0) / 3000.0)
    assert after.information == pytest.approx(0.98 * 50.0 + weight * 0.25)
    assert after.mass == pytest.approx(10_000.0 + weight * 0.5 * 3000.0 / after.information)


def test_a_start_from_nothing_is_no_outlier():
    time, phi, y = rows(300, 4)
    found = robust_rls.run(start(), time, phi, y, np.ones(300, bool), params(threshold=1.5))
    assert np.all(np.abs(found[1][20:] - 10_000.0) < 500.0)


def test_the_noise_level_is_found_although_outliers_are_clipped():
    time, phi, y = rows(20_000, 5)
    state = robust_rls.run(
        start(), time, phi, y, np.ones(time.size, bool), params(threshold=1.5, forgetting=0.999)
    )[0]
    assert np.sqrt(state.noise_var) == pytest.approx(300.0 / np.sqrt(5.0), rel=0.2)


def test_a_cruise_forgets_nothing_that_it_does_not_replace():
    time, phi, y = rows(6000, 6)
    phi[1000:] *= 0.02
    y[1000:] = 10_000.0 * phi[1000:] + 150.0  # a little drag more than the model has
    valid = np.ones(time.size, bool)
    paper = robust_rls.run(start(), time, phi, y, valid, params())[0]
    kept = robust_rls.run(start(), time, phi, y, valid, params(kept_information=20.0))[0]
    assert paper.mass > 14_000.0
    assert kept.mass == pytest.approx(10_000.0, rel=0.05)


def test_an_interrupted_window_is_not_folded():
    time, phi, y = rows(20, 7)
    valid = np.ones(20, bool)
    valid[3] = False
    late = time.copy()
    late[12:] += 5.0
    mean_phi = robust_rls.run(start(), late, phi, y, valid, params())[4]
    assert np.flatnonzero(np.isfinite(mean_phi)).tolist() == [8, 16]
    assert mean_phi[8] == pytest.approx(phi[4:9].mean())


def test_the_offset_is_told_from_the_mass_and_held_by_its_prior():
    time, phi, y = rows(3000, 9, noise=100.0)
    y += 400.0
    valid = np.ones(3000, bool)
    still = {"forgetting": 1.0, "noise_floor": 0.005}
    plain = robust_rls.run(start(), time, phi, y, valid, params(**still))[0]
    found = robust_rls.run(start(), time, phi, y, valid, params(offset_std=0.1, **still))[0]
    held = robust_rls.run(start(), time, phi, y, valid, params(offset_std=1e-5, **still))[0]
    assert plain.mass > 10_300.0
    assert found.mass == pytest.approx(10_000.0, abs=40.0)
    assert found.offset == pytest.approx(400.0, abs=40.0)
    assert held.mass == pytest.approx(plain.mass, rel=1e-3)


def test_an_offset_that_changes_is_forgotten():
    time, phi, y = rows(6000, 11, noise=100.0)
    y += np.where(time < 300.0, 400.0, -400.0)
    chosen = {"offset_std": 0.1, "noise_floor": 0.005}
    stale, fresh = (
        robust_rls.run(
            start(), time, phi, y, np.ones(6000, bool), params(offset_forgetting=kept, **chosen)
        )[0]
        for kept in (1.0, 0.98)
    )
    assert stale.offset > 0.0
    assert fresh.offset == pytest.approx(-400.0, abs=80.0)
    assert abs(fresh.mass - 10_000.0) < 0.3 * abs(stale.mass - 10_000.0)


def test_with_an_offset_equals_ridge_regression():
    time, phi, y = rows(600, 10)
    chosen = params(forgetting=1.0, offset_std=0.05, noise_floor=0.5)
    begin = start()._replace(mass=10_000.0, information=1e-6)
    state, *_, mean_phi, mean_y, _ = robust_rls.run(begin, time, phi, y, np.ones(600, bool), chosen)
    mean_phi, mean_y = (x[np.isfinite(x)] for x in (mean_phi, mean_y))
    design = np.column_stack([mean_phi, np.ones_like(mean_phi)])
    # The floor sets the noise: the prior weighs as (0.5 / 0.05)^2 windows.
    ridge = np.diag([1e-6, 100.0])
    right = design.T @ mean_y + [1e-6 * 10_000.0, 0.0]
    expected = np.linalg.solve(design.T @ design + ridge, right)
    assert_allclose([state.mass, state.offset], expected, rtol=1e-3, atol=2.0)
    inverse = np.linalg.inv(design.T @ design + ridge)
    floor = (0.5 * state.mass) ** 2
    assert robust_rls.variance(state, chosen) == pytest.approx(floor * inverse[0, 0], rel=1e-3)


def test_batch_equals_sample_by_sample_to_the_last_bit():
    time, phi, y = rows(3000, 8)
    valid = np.arange(3000) % 61 > 3
    y[500:520] += 9000.0
    phi[~valid] = np.nan
    chosen = params(threshold=1.5, kept_information=5.0, offset_std=0.03)
    last, theta, var, information, *means = robust_rls.run(start(), time, phi, y, valid, chosen)
    state = start()
    for k in range(3000):
        state, *told = robust_rls.step(state, time[k], phi[k], y[k], valid[k], chosen)
        assert state.mass == theta[k]
        assert robust_rls.variance(state, chosen) == var[k]
        assert state.information == information[k]
        assert np.array_equal(told, [m[k] for m in means], equal_nan=True)
    assert state == last


def test_hubers_weight_stays_out_of_the_covariance_as_in_eq_20():
    begin = robust_rls.RobustRlsState(
        10_000.0, 0.0, 50.0, 0.0, 0.0, 300.0**2, 100, 0, 0.0, 0.0, 0.0, 0.0
    )
    found = []
    for counts in (True, False):
        how = params(
            weight_information=counts,
            forgetting=0.99,
            threshold=1.345,
        )
        found.append(robust_rls.fold(begin, 0.8, 14_000.0, how))
    (counted, weight), (printed, same) = found
    assert weight == same
    assert 0.05 < weight < 0.2
    assert counted.information == pytest.approx(0.99 * 50.0 + weight * 0.64)
    assert printed.information == pytest.approx(0.99 * 50.0 + 0.64)
    # Eq. 20: gain of the plain filter, times the weight.
    gain = 0.8 / 50.0 / (0.99 + 0.64 / 50.0)
    assert printed.mass == pytest.approx(10_000.0 + gain * weight * 6000.0)
