"""The Kalman filter of speed, grade and mass against matrices, differences and a known drive."""

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

from weighbridge.kernels import hybrid_mass, mass_ekf, robust_rls

PARAMS = mass_ekf.MassEkfParams(
    gravity=9.81,
    rolling=0.007,
    rolling_speed=4e-5,
    speed_density=4e-4,
    grade_density=1.6e-5,
    accel_walk=2.5e-3,
    grade_walk=1e-5,
    mass_walk=25.0,
    load_walk=1e4,
    start_speed_var=1e4,
    start_grade_var=4e-3,
    offset_var=1e-5,
    offset_walk=1e-8,
    gate=5.0,
    pause=0.8,
    lightest=1500.0,
    heaviest=45_000.0,
)
MASS = 11_000.0


def drive(seed, n=6000, period=0.02, noise=1.0):
    """Two pulls on a hilly road with a coast between: forces, and the speed they make."""
    rng = np.random.default_rng(seed)
    own = mass_ekf.Columns(*(column.copy() for column in driven(n, period)))
    return own._replace(
        speed=own.speed + noise * rng.normal(0.0, 0.05, n),
        grade=own.grade + noise * rng.normal(0.0, 0.02, n),
    )


@cache
def driven(n, period):
    """The drive without noise."""
    time = np.arange(n) * period
    grade = 0.02 * np.sin(time / 15.0)
    traction = 9000.0 * (1.0 + 0.5 * np.sin(time / 7.0))
    traction[n // 2 : n // 2 + 800] = 0.0
    rotating = np.full(n, 300.0)
    speed = np.empty(n)
    v = 3.0
    # Ten steps of the simulation between two rows, the force straight between them.
    for k in range(n):
        speed[k] = v
        after = min(k + 1, n - 1)
        for part in np.arange(10) / 10.0:
            force = traction[k] + part * (traction[after] - traction[k])
            slope = grade[k] + part * (grade[after] - grade[k])
            rolling = MASS * 9.81 * np.cos(slope) * (0.007 + 4e-5 * v)
            drag = 3.3 * (v + 1.5) * abs(v + 1.5)
            net = force - drag - rolling - MASS * 9.81 * np.sin(slope)
            v += net / (MASS + 300.0) * period / 10.0
    return mass_ekf.Columns(
        time=time,
        traction=traction,
        drag=np.full(n, 3.3),
        headwind=np.full(n, 1.5),
        rotating=rotating,
        speed=speed,
        grade=grade,
        driven=np.ones(n, bool),
        standing=np.zeros(n, bool),
        regressor=np.full(n, np.nan),
    )


def test_derivatives_are_those_of_differences():
    row = mass_ekf.Row(0.0, 9000.0, 3.3, -2.0, 250.0, 12.0, 0.03, True, False, np.nan)
    at = np.array([14.0, 0.03, MASS])
    accel, *derivatives = mass_ekf.acceleration(*at, row, PARAMS)
    weight = 9.81 * (np.sin(0.03) + (0.007 + 4e-5 * 14.0) * np.cos(0.03))
    assert accel == pytest.approx((9000.0 - 3.3 * 12.0**2 - MASS * weight) / (MASS + 250.0))
    for k, small in enumerate((1e-4, 1e-6, 0.1)):
        up, down = at.copy(), at.copy()
        up[k] += small
        down[k] -= small
        slope = (
            mass_ekf.acceleration(*up, row, PARAMS)[0]
            - mass_ekf.acceleration(*down, row, PARAMS)[0]
        ) / (2.0 * small)
        assert derivatives[k] == pytest.approx(slope, rel=1e-6)


def test_equals_the_filter_in_matrices():
    table = drive(1, n=1500)
    state = mass_ekf.initial_state(9000.0, 1000.0**2, mass_ekf.row_at(table, 0), PARAMS)
    x, cov = np.array([0.0, 0.0, 9000.0, 0.0]), state.cov
    measures = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 1.0]])
    for k in range(1, 1500):
        state, innovation, taken = mass_ekf.step(state, mass_ekf.row_at(table, k), PARAMS)
        assert taken
        span = table.time[k] - table.time[k - 1]
        mean = [0.5 * (c[k - 1] + c[k]) for c in table[:5]]
        row = mass_ekf.Row(*mean, 0.0, 0.0, True, False, np.nan)
        accel, *slopes = mass_ekf.acceleration(*x[:3], row, PARAMS)
        transition = np.eye(4)
        transition[0, :3] += span * np.array(slopes)
        x = x + span * np.array([accel, 0.0, 0.0, 0.0])
        # What walks does so before the speed is predicted, so its walk passes through.
        cov = cov + span * np.diag([0.0, PARAMS.grade_walk, PARAMS.mass_walk, PARAMS.offset_walk])
        cov = transition @ cov @ transition.T
        cov[0, 0] += span * PARAMS.accel_walk
        total = measures @ cov @ measures.T + np.diag(
            [PARAMS.speed_density / span, PARAMS.grade_density / span]
        )
        residual = np.array([table.speed[k], table.grade[k]]) - measures @ x
        assert innovation == pytest.approx(residual[0] / np.sqrt(total[0, 0]), abs=1e-6)
        gain = cov @ measures.T @ np.linalg.inv(total)
        x = x + gain @ residual
        cov = cov - gain @ measures @ cov
        assert_allclose(state.x, x, rtol=1e-6, atol=1e-9)
    assert_allclose(state.cov, cov, rtol=1e-4, atol=1e-12)


def test_finds_the_mass_of_a_known_drive_and_how_sure_it_is():
    errors, spreads = [], []
    for seed in range(40):
        table = drive(100 + seed, n=2500)
        start = mass_ekf.initial_state(
            MASS * 0.85, (0.15 * MASS) ** 2, mass_ekf.row_at(table, 0), PARAMS
        )
        # The noise of the rows is white: 0.05 m/s and 0.02 rad at 50 Hz.
        known = PARAMS._replace(
            speed_density=0.05**2 * 0.02,
            grade_density=0.02**2 * 0.02,
            accel_walk=1e-7,
            mass_walk=0.0,
        )
        state = mass_ekf.run(start, table, 0, known)[0]
        errors.append(state.x[2] - MASS)
        spreads.append(np.sqrt(state.cov[2, 2]))
    scaled = np.array(errors) / np.array(spreads)
    assert np.mean(spreads) < 0.01 * MASS
    # Two-sided 99.9 % bounds of chi2(40) / 40.
    assert 0.39 < np.mean(scaled**2) < 2.0


def test_tells_the_offset_of_the_measured_grade_from_the_grade():
    table = drive(9, n=6000)
    table.grade[:] += 0.01
    start = mass_ekf.initial_state(MASS, (0.2 * MASS) ** 2, mass_ekf.row_at(table, 0), PARAMS)
    known = PARAMS._replace(accel_walk=1e-6, offset_var=1e-4, mass_walk=0.0)
    state = mass_ekf.run(start, table, 0, known)[0]
    assert state.x[3] == pytest.approx(0.01, abs=0.001)
    assert state.x[2] == pytest.approx(MASS, rel=0.02)
    fixed = known._replace(offset_var=0.0, offset_walk=0.0)
    start = mass_ekf.initial_state(MASS, (0.2 * MASS) ** 2, mass_ekf.row_at(table, 0), fixed)
    assert abs(mass_ekf.run(start, table, 0, fixed)[0].x[2] / MASS - 1.0) > 0.03


def test_a_brake_that_nobody_tells_is_gated_and_one_that_is_told_costs_nothing():
    table = drive(3, noise=0.0)
    table.speed[3000:] -= 4.0
    start = mass_ekf.initial_state(MASS, 500.0**2, mass_ekf.row_at(table, 0), PARAMS)
    _, mass, _, innovation, taken = mass_ekf.run(start, table, 0, PARAMS)
    assert not taken[3000]
    assert abs(innovation[3000]) > PARAMS.gate
    assert taken[3001:].all()
    assert abs(mass[3000] - mass[2999]) < 1.0
    table.driven[2990:3010] = False
    told = mass_ekf.run(start, table, 0, PARAMS)
    assert np.isnan(told[3][2991:3010]).all()
    assert np.ptp(told[1][2995:3010]) < 20.0


def test_missing_rows_leave_finite_numbers():
    table = drive(4)
    table.speed[500:700] = np.nan
    table.grade[600:900] = np.nan
    table.traction[1000:1100] = np.nan
    table.driven[500:700] = False
    table.driven[1000:1100] = False
    begin = mass_ekf.initial_state(0.8 * MASS, (0.2 * MASS) ** 2, mass_ekf.row_at(table, 0), PARAMS)
    mass = mass_ekf.run(begin, table, 0, PARAMS)[1]
    assert np.ptp(mass[995:1105]) < 100.0
    keep = np.ones(table.time.size, bool)
    keep[2000:2300] = False
    table = mass_ekf.Columns(*(c[keep] for c in table))
    start = mass_ekf.initial_state(0.8 * MASS, (0.2 * MASS) ** 2, mass_ekf.row_at(table, 0), PARAMS)
    state, mass, var, *_ = mass_ekf.run(start, table, 0, PARAMS)
    assert np.isfinite(mass).all()
    assert (var > 0.0).all()
    assert state.x[2] == pytest.approx(MASS, rel=0.02)


def test_a_change_of_load_at_a_stop_is_followed():
    params = PARAMS._replace(load_walk=(0.01 * MASS) ** 2)
    first, second = drive(5), drive(6)
    n, gap = first.time.size, 1500
    table = mass_ekf.Columns(
        *(np.concatenate((a, a[:gap], b)) for a, b in zip(first, second, strict=True))
    )
    time = np.arange(2 * n + gap) * 0.02
    speed, traction = table.speed.copy(), table.traction.copy()
    speed[n : n + gap] = 0.0
    # A fifth less of everything that pulls and drags is a vehicle a fifth lighter.
    traction[n + gap :] *= 0.8
    drag, rotating = table.drag.copy(), table.rotating.copy()
    drag[n + gap :] *= 0.8
    rotating[n + gap :] *= 0.8
    driven, standing = table.driven.copy(), table.standing.copy()
    driven[n : n + gap] = False
    standing[n : n + gap] = True
    table = table._replace(
        time=time, speed=speed, traction=traction, drag=drag, rotating=rotating,
        driven=driven, standing=standing,
    )  # fmt: skip
    start = mass_ekf.initial_state(MASS, (0.1 * MASS) ** 2, mass_ekf.row_at(table, 0), PARAMS)
    mass = mass_ekf.run(start, table, 0, params)[1]
    assert mass[n - 1] == pytest.approx(MASS, rel=0.02)
    assert mass[-1] == pytest.approx(0.8 * MASS, rel=0.02)


def hybrid_params(blend=hybrid_mass.SPEED):
    return hybrid_mass.HybridParams(
        rls=robust_rls.RobustRlsParams(
            0.5, 0.02, 0.8, 0.95, 20.0, 1.5, 0.0, True, 100.0, 10, 0.03, 1.0, 0.03, 10.0
        ),
        ekf=PARAMS,
        first_information=2.0,
        start_mass=0.0,
        start_std=0.1,
        blend=blend,
        blend_speed=8.0,
        blend_width=1.5,
        share=0.4,
        correlation=0.7,
        forgetting=0.98,
        caution=10.0,
    )


def mixed(seed):
    """Rows with stops, gaps and outliers, and the regression of the least squares."""
    table = drive(seed)
    table.driven[1000:1100] = False
    table.standing[1040:1060] = True
    table.speed[2000:2003] += 9.0
    table.speed[2500:2510] = np.nan
    table.driven[2500:2510] = False
    accel = np.gradient(np.nan_to_num(table.speed), table.time)
    phi = accel + 9.81 * np.sin(table.grade)
    y = table.traction - table.drag * (table.speed + table.headwind) ** 2
    return table, np.convolve(phi, np.full(25, 0.04), "same"), y


def test_batch_equals_sample_by_sample_to_the_last_bit():
    table, phi, y = mixed(7)
    start = mass_ekf.initial_state(9000.0, 1e6, mass_ekf.row_at(table, 0), PARAMS)
    last, mass, var, innovation, taken = mass_ekf.run(start, table, 0, PARAMS)
    state = start
    for k in range(1, table.time.size):
        state, seen, passed = mass_ekf.step(state, mass_ekf.row_at(table, k), PARAMS)
        assert state.x[2] == mass[k]
        assert state.cov[2, 2] == var[k]
        assert np.array_equal(seen, innovation[k], equal_nan=True)
        assert (passed and np.isfinite(seen)) == taken[k]
    assert np.array_equal(state.cov, last.cov)

    params = hybrid_params(hybrid_mass.INNOVATIONS)
    begin = hybrid_mass.initial_state(robust_rls.initial_state(0.0, 1e-9), params)
    last, *tracks = hybrid_mass.run(begin, table, phi, y, params)
    mass, var, share, rls_mass, ekf_mass, *means, taken = tracks
    state = begin
    for k in range(table.time.size):
        state, *told, passed = hybrid_mass.step(
            state, mass_ekf.row_at(table, k), phi[k], y[k], params
        )
        assert np.array_equal(
            [state.mass, state.var, state.share], [mass[k], var[k], share[k]], equal_nan=True
        )
        assert np.array_equal(told, [m[k] for m in means], equal_nan=True)
        assert passed == taken[k]
    assert state.ekf.x[2] == ekf_mass[-1]
    assert state.rls.mass == rls_mass[-1]


def test_the_blend_is_of_the_two_filters_run_alone():
    table, phi, y = mixed(8)
    params = hybrid_params()
    begin = hybrid_mass.initial_state(robust_rls.initial_state(0.0, 1e-9), params)
    _, mass, _, share, rls_mass, ekf_mass, *_ = hybrid_mass.run(begin, table, phi, y, params)
    _, theta, _, information, *_ = robust_rls.run(
        robust_rls.initial_state(0.0, 1e-9), table.time, phi, y, table.driven, params.rls
    )
    k = int(np.flatnonzero(information >= params.first_information)[0])
    start = mass_ekf.initial_state(
        theta[k], (params.start_std * theta[k]) ** 2, mass_ekf.row_at(table, k), params.ekf
    )
    alone = mass_ekf.run(start, table, k, params.ekf)[1]
    assert np.array_equal(ekf_mass, alone, equal_nan=True)
    assert np.array_equal(rls_mass[k:], theta[k:])
    assert np.isnan(mass[:k]).all()
    known = np.isfinite(table.speed)
    known[:k] = False
    curve = 1.0 / (1.0 + np.exp((table.speed - 8.0) / 1.5))
    assert_allclose(share[known], curve[known], rtol=1e-12)
    assert_allclose(mass[k:], (share * rls_mass + (1.0 - share) * ekf_mass)[k:], rtol=1e-12)


def test_the_share_falls_smoothly_from_one_to_nothing():
    speed = np.linspace(0.0, 30.0, 301)
    share = np.array([hybrid_mass.share_at(v, 8.0, 1.5) for v in speed])
    assert share[0] > 0.99
    assert share[-1] < 0.01
    assert np.all(np.diff(share) < 0.0)
    assert np.abs(np.diff(share, 2)).max() < 1e-3


def test_shares_by_variances_are_those_of_two_correlated_measurements():
    nothing = hybrid_mass.Rivals(0.0, 0.0, 0.0, 0.0, 0.0)

    def share(blend, first, second):
        params = hybrid_params(blend)
        return hybrid_mass.share_of_rls(0.3, 10.0, first, second, nothing, params)

    # Generalised least squares of one number, measured twice with errors of correlation 0.7.
    for first, second in ((8.0, 9.0), (9.0, 5.0)):
        common = 0.7 * np.sqrt(first * second)
        inverse = np.linalg.inv([[first, common], [common, second]])
        best = inverse.sum(axis=0)[0] / inverse.sum()
        assert 0.0 < best < 1.0
        assert share(hybrid_mass.COVARIANCE, first, second) == pytest.approx(best)
    # Where the better one is better than the correlation, it has all.
    assert share(hybrid_mass.COVARIANCE, 100.0, 4.0) == 0.0
    assert share(hybrid_mass.VARIANCE, 1.0, 3.0) == pytest.approx(0.75)
    assert share(hybrid_mass.INTERSECTION, 1.0, 3.0) == 1.0
    assert share(hybrid_mass.INTERSECTION, 3.0, 1.0) == 0.0
    assert share(hybrid_mass.SHARE, 3.0, 1.0) == 0.4


def test_the_share_by_innovations_is_that_which_would_have_foretold_best():
    rng = np.random.default_rng(5)
    phi, mass, heavy, light = rng.uniform(0.1, 1.0, 400), 10_000.0, 10_600.0, 9900.0
    y = phi * mass + rng.normal(0.0, 300.0, 400)
    # Offset of the Kalman filter's grade: 0.001 rad of a heavier mass.
    kalman = y - (phi - 9.81 * 0.001) * heavy
    least = y - phi * light
    for caution in (0.0, 10.0):
        params = hybrid_params(hybrid_mass.INNOVATIONS)._replace(forgetting=1.0, caution=caution)
        rivals = hybrid_mass.Rivals(heavy, 0.001, 0.0, 0.0, 0.0)
        for k in range(400):
            rivals = hybrid_mass.compare(rivals, phi[k], y[k], least[k], params)
        share = hybrid_mass.share_of_rls(0.0, 10.0, 1.0, 1.0, rivals, params)
        apart = kalman - least
        best = np.linalg.lstsq(apart[:, None], kalman, rcond=None)[0][0]
        if caution == 0.0:
            assert share == pytest.approx(best, rel=1e-9)
        else:
            shrunk = kalman @ apart / (apart @ apart + caution * rivals.noise_var)
            assert share == pytest.approx(shrunk, rel=1e-9)
            assert share < best
    assert 0.7 < best < 1.0
    assert np.sqrt(rivals.noise_var) == pytest.approx(np.sqrt(np.mean(kalman**2)), rel=0.3)
