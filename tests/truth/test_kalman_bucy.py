"""The Kalman-Bucy filters against their differential equations and against least squares."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import cumulative_trapezoid, solve_ivp
from scipy.stats import truncnorm

from weighbridge import InertiaFilter, InertiaSettings
from weighbridge.inertia import RideSamples, estimate, fixed_params
from weighbridge.kernels import inertia as kernel
from weighbridge.kernels import kalman_bucy
from weighbridge.papers.nguyen2024 import suspension_of
from weighbridge.simulation import TRUCK, RideSensors

RIDE = suspension_of(TRUCK, RideSensors(body_noise=(0.05, 0.05, 0.05)))
SETTINGS = InertiaSettings(process=(1e-3, 0.3))
PHASE = np.array([0.0, 0.7, 1.9, 2.6])


def travel(t):
    return 0.01 * np.sin(9.0 * t + PHASE) + 0.003 * np.cos(14.0 * t - PHASE)


def rate(t):
    return 0.09 * np.cos(9.0 * t + PHASE) - 0.042 * np.sin(14.0 * t - PHASE)


def measured(t):
    return np.array([0.1 * np.sin(8.0 * t), 0.08 * np.cos(9.0 * t), 0.05 * np.sin(7.0 * t + 1.0)])


def accelerations(t):
    """Accelerations of the vehicle file's body, written out wheel by wheel."""
    force = -(
        np.repeat((RIDE.front_stiffness, RIDE.rear_stiffness), 2) * travel(t)
        + np.repeat((RIDE.front_damping, RIDE.rear_damping), 2) * rate(t)
    )
    fl, fr, rl, rr = force
    return np.array(
        [
            (fl + fr + rl + rr) / RIDE.sprung_mass,
            (0.5 * RIDE.front_track * (fl - fr) + 0.5 * RIDE.rear_track * (rl - rr))
            / RIDE.roll_inertia,
            (RIDE.front_axle * (fl + fr) - RIDE.rear_axle * (rl + rr)) / RIDE.pitch_inertia,
        ]
    )


START = np.diag((0.01, 0.01, 0.01, 1.0, 1.0, 1.0))


def twin(form, params, end):
    """Integrate state and Riccati equation of eq. 9 with the Jacobian of the form."""
    inverse_noise = np.diag(1.0 / params.noise)
    c = np.eye(3, 6)

    def slope(t, y):
        x, p = y[:6], y[6:].reshape(6, 6)
        a, phi = np.zeros((6, 6)), accelerations(t)
        if form == kalman_bucy.INVERSE:
            a[:3, 3:], drift = np.diag(phi), phi * x[3:]
        else:
            drift = phi / x[3:]
            if form == kalman_bucy.EXTENDED:
                a[:3, 3:] = np.diag(-phi / x[3:] ** 2)
        gain = p @ c.T @ inverse_noise
        dx = np.concatenate((drift, np.zeros(3))) + gain @ (measured(t) - x[:3])
        dp = a @ p + p @ a.T - gain @ c @ p + params.process
        return np.concatenate((dx, dp.ravel()))

    begin = np.concatenate(([0, 0, 0, 1, 1, 1], START.ravel()))
    found = solve_ivp(slope, (0.0, end), begin, rtol=1e-9, atol=1e-12, method="LSODA")
    return found.y[:6, -1], found.y[6:, -1].reshape(6, 6)


def filtered(method, hz, end):
    """Run the kernel from the same start; return its parameters, mean and covariance."""
    # The density of the noise stays what it is at 1000 Hz, whatever the rate.
    params = fixed_params(RIDE, 1e-3, method, SETTINGS)._replace(longest=0.1)
    if method == "inverse":
        params = params._replace(lowest=-1e9, highest=1e9)
    time = np.arange(round(end * hz) + 1) / hz
    state = kalman_bucy.initial_state([0, 0, 0, 1, 1, 1], START)
    # Begin with the state known at time zero, as the differential equation does.
    begin = np.array([accelerations(0.0), np.full(3, np.nan)])
    state = state._replace(time=0.0, phi=begin)
    inputs = [np.array([f(t) for t in time[1:]]) for f in (travel, rate, measured)]
    state, *_ = kalman_bucy.run(state, time[1:], *inputs, params)
    return params, state.mean, state.cov


@pytest.mark.parametrize("method", ["inverse", "extended"])
def test_filter_converges_to_the_differential_equations(method):
    end = 1.0
    errors = []
    for hz in (500, 1000, 2000):
        params, mean, cov = filtered(method, hz, end)
        true_mean, true_cov = twin(params.form, params, end)
        std = np.sqrt(np.diag(true_cov))
        of_cov = np.abs(cov - true_cov) / np.outer(std, std)
        errors.append(max(np.max(np.abs(mean - true_mean) / std), np.max(of_cov)))
    assert errors[-1] < 0.02
    order = np.log2(errors[0] / errors[1]), np.log2(errors[1] / errors[2])
    assert_allclose(order, 1.0, atol=0.25)


def test_filter_as_printed_never_moves_its_parameters():
    _, mean, cov = filtered("printed", 1000, 1.0)

    assert_array_equal(mean[3:], 1.0)
    assert_array_equal(cov[:3, 3:], 0.0)
    assert np.all(np.abs(mean[:3]) > 0.0)


def jump_params(**changes):
    made = kernel.InertiaParams(
        spring=np.eye(3, 4),
        damper=np.zeros((3, 4)),
        push_var=np.zeros(3),
        noise_var=np.full(3, 0.04),
        alpha_drift=0.0,
        beta_drift=0.0,
        jump_std=1.0,
        beta_std=np.full(3, 2.0),
        lowest=1e-9,
        highest=1e9,
        jump_rate=1e-4,
        spawn=np.inf,
        push_drift=np.zeros(3),
        push_rate=0.1,
        longest=1.0,
    )
    return made._replace(**changes)


def test_filter_without_jumps_is_least_squares():
    # A force that grows evenly is integrated exactly by chord and parabola alike.
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.uniform(0.005, 0.02, 300))
    slope, start = np.array([3.0, -2.0, 1.0]), np.array([-1.0, 2.0, 0.5])
    phi = start + slope * (time[:, None] - time[0])
    truth = np.array([[0.3, 1.4, -0.5], [0.1, 0.7, 0.2], [-0.2, 2.0, 1.0]])
    past = time - time[0]
    integral = start * past[:, None] + 0.5 * slope * past[:, None] ** 2
    velocity = np.empty((time.size, 3))
    for j in range(3):
        design = np.column_stack((np.ones(time.size), integral[:, j], past))
        velocity[:, j] = design @ truth[j] + rng.normal(scale=0.2, size=time.size)
    params = jump_params()
    travel = np.column_stack((-phi, np.zeros(time.size)))

    state = kernel.initial_state(np.full(3, 1.5), params, 4)
    state, samples = kernel.run(state, time, travel, np.zeros((time.size, 4)), velocity, params)

    for j in range(3):
        # The velocity at the start is measured alone; after it, all is linear.
        design = np.column_stack((np.ones(time.size), integral[:, j], past))
        prior = np.diag((1.0 / kernel.VELOCITY_STD**2, 1.0 / 1.5**2, 1.0 / 2.0**2))
        information = design.T @ design / 0.04 + prior
        right = design.T @ velocity[:, j] / 0.04 + prior @ [velocity[0, j], 1.0, 0.0]
        expected = np.linalg.solve(information, right)
        assert_allclose(samples.alpha[-1, j], expected[1], rtol=1e-7)
        assert_allclose(samples.beta[-1, j], expected[2], rtol=1e-7, atol=1e-9)
        assert_allclose(
            samples.alpha_std[-1, j], np.sqrt(np.linalg.inv(information)[1, 1]), rtol=1e-7
        )


def test_integral_is_exact_for_parabolas():
    for old_step, step in ((0.01, 0.01), (0.02, 0.01), (0.01, 0.025)):
        at = np.array([-old_step, 0.0, step])
        f = 2.0 - 30.0 * at + 700.0 * at**2
        exact = 2.0 * step - 15.0 * step**2 + 700.0 / 3.0 * step**3
        assert_allclose(kernel.integral(*f, old_step, step), exact, rtol=1e-12)
    assert kernel.integral(np.nan, 1.0, 3.0, 0.0, 0.5) == 1.0


def test_range_truncates_a_gaussian():
    for mean, std in ((0.2, 0.5), (-0.4, 0.6), (9.0, 2.0), (1.0, 0.01)):
        a, b = (0.125 - mean) / std, (8.0 - mean) / std
        expected = truncnorm(a, b, loc=mean, scale=std)
        assert_allclose(
            kernel.within(mean, std, 0.125, 8.0), (expected.mean(), expected.std()), rtol=1e-6
        )


def rough_ride(hz, seconds, seed):
    """Return filtered noise as a ride, with gaps, missing velocities and jitter."""
    rng = np.random.default_rng(seed)
    n = int(hz * seconds)
    time = (np.arange(n) + rng.uniform(-0.2, 0.2, n)) / hz
    time = np.delete(time, slice(n // 3, n // 3 + int(0.3 * hz)))
    n = time.size
    travel = 0.01 * np.cumsum(rng.normal(size=(n, 4)), axis=0) / np.sqrt(hz)
    rate = 0.1 * rng.normal(size=(n, 4))
    velocity = 0.05 * np.cumsum(rng.normal(size=(n, 3)), axis=0) / np.sqrt(hz)
    velocity[rng.random((n, 3)) < 0.1] = np.nan
    return RideSamples(time=time, travel=travel, rate=rate, velocity=velocity)


@pytest.mark.parametrize("hz", [100, 333, 1000])
def test_covariance_stays_positive_definite(hz):
    ride = rough_ride(hz, 20.0, seed=hz)
    live = InertiaFilter(RIDE, 1.0 / hz)
    for k in range(ride.time.size):
        live.update(ride.time[k], ride.travel[k], ride.rate[k], ride.velocity[k])
        if k % 500 == 0 or k == ride.time.size - 1:
            for j in range(3):
                for cov in live.state.cov[j, : live.state.count[j]]:
                    assert_array_equal(cov, cov.T)
                    np.linalg.cholesky(cov)


def test_sample_by_sample_equals_batch_to_the_last_bit():
    ride = rough_ride(200, 10.0, seed=5)
    settings = InertiaSettings()
    batch = estimate(ride, RIDE, settings=settings)
    live = InertiaFilter(RIDE, ride.period, settings)
    for k in range(ride.time.size):
        one = live.update(ride.time[k], ride.travel[k], ride.rate[k], ride.velocity[k])
        assert_array_equal(one.alpha, batch.alpha[k])
        assert_array_equal(one.alpha_std, batch.alpha_std[k])
        assert_array_equal(one.velocity, batch.velocity[k])


def test_printed_and_fixed_filters_step_as_they_run():
    ride = rough_ride(200, 5.0, seed=6)
    params = fixed_params(RIDE, ride.period, "extended", SETTINGS)
    begin = kalman_bucy.initial_state([0, 0, 0, 1, 1, 1], START)
    inputs = (ride.time, ride.travel, ride.rate, ride.velocity)
    _, mean, _ = kalman_bucy.run(begin, *inputs, params)
    state = begin
    for k in range(ride.time.size):
        state = kalman_bucy.step(state, *(a[k] for a in inputs), params)
        assert_array_equal(state.mean, mean[k])
    np.linalg.cholesky(state.cov)


@pytest.mark.parametrize("hz", [100, 200, 500, 1000])
@pytest.mark.parametrize("method", ["inverse", "extended"])
def test_fixed_filters_are_stable_at_the_rates_of_loggers(hz, method):
    # Forces of a body of 1.3 times the parameters, so that the truth is known.
    fine = np.arange(4001) * 1e-3
    accel = np.array([accelerations(t) for t in fine]) / 1.3
    velocity = cumulative_trapezoid(accel, fine, axis=0, initial=0.0)
    params = fixed_params(RIDE, 1.0 / hz, method, InertiaSettings())
    state = kalman_bucy.initial_state(np.repeat((0.0, 1.0), 3), START)
    for k in range(0, fine.size, 1000 // hz):
        state = kalman_bucy.step(
            state, fine[k], travel(fine[k]), rate(fine[k]), velocity[k], params
        )
        if k % 100 == 0:
            np.linalg.cholesky(state.cov)
    expected = 1.0 / 1.3 if method == "inverse" else 1.3
    assert_allclose(state.mean[3:], expected, rtol=0.02)
    assert_array_equal(state.cov, state.cov.T)


def test_change_between_two_hypotheses_leaves_an_honest_error():
    # Hypotheses are 100 ms apart: the load changes in the middle between two, and velocities are
    # known far better than what these 50 ms of another load make of them.
    time = np.arange(1200) * 2e-3
    phi = np.column_stack([np.cos(9.0 * time + p) for p in (0.0, 1.0, 2.0)]) * 5.0
    truth = np.where(time < 1.05, 1.0, 0.6)
    mid = 0.5 * (time[1:] + time[:-1])
    accel = np.where(mid < 1.05, 1.0, 0.6)[:, None] * 0.5 * (phi[1:] + phi[:-1])
    velocity = np.vstack((np.zeros(3), np.cumsum(accel * 2e-3, axis=0)))
    velocity = velocity + np.random.default_rng(4).normal(scale=1e-3, size=velocity.shape)
    params = jump_params(
        noise_var=np.full(3, 1e-6), beta_std=np.zeros(3), spawn=0.1, jump_rate=1e-2
    )
    state = kernel.initial_state(np.full(3, 1.0), params, 16)
    travel = np.column_stack((-phi, np.zeros(time.size)))
    _, samples = kernel.run(state, time, travel, np.zeros((time.size, 4)), velocity, params)

    late = time > 1.15
    error = (samples.alpha - truth[:, None]) / samples.alpha_std
    assert np.max(np.abs(error[late])) < 5.0
    assert np.all(np.abs(samples.jumped[late] - 1.05) < 0.06)


def test_spike_of_a_velocity_moves_little():
    ride = rough_ride(500, 4.0, seed=8)
    velocity = np.nan_to_num(ride.velocity)
    clean = RideSamples(time=ride.time, travel=0 * ride.travel, rate=0 * ride.rate,
                        velocity=0 * velocity)  # fmt: skip
    spiked = 0 * velocity
    spiked[1000] = 5.0
    settings = InertiaSettings()
    still = estimate(clean, RIDE, settings=settings)
    hit = estimate(
        RideSamples(time=ride.time, travel=clean.travel, rate=clean.rate, velocity=spiked),
        RIDE,
        settings=settings,
    )
    assert np.max(np.abs(hit.velocity - still.velocity)) < 0.2
