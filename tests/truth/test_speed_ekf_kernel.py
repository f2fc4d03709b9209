"""The filter of speed alone against a plain twin, differences and closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from weighbridge.kernels import speed_ekf as kernel

PARAMS = kernel.SpeedEkfParams(
    sample_time=7.0,
    force_gain=19.83,
    drag=0.918,
    gravity=9.81,
    rotating_mass=71.0,
    corrections=np.array([0.7, -0.6, 0.05, 0.01, -2.0, 0.08, 1.1]),
    process_var=np.array([0.1, 1e-10, 0.005]),
    speed_var=1e-4,
)


def samples(n=200, seed=3):
    rng = np.random.default_rng(seed)
    speed = 18.0 + np.cumsum(rng.normal(0.0, 0.6, n)) * 0.5
    on = rng.random(n) > 0.1
    return np.maximum(speed, 1.0), on


def twin(speed, on, params, mass, slope):
    """Eqs. 11-26 as printed, with numerical derivatives and P = (I - K H) P."""
    p1, p2, p3, p4, p5, p6, p7 = params.corrections

    def f(x, before):
        a1 = params.force_gain + p1 + p2 * before
        a2 = params.drag + p3 + p4 * before
        a3 = params.gravity + p5 + p6 * before
        pull = x[1] * (p7 * before * a1 - 0.5 * a2 * x[0] ** 2) - a3 * x[2]
        return np.array(
            [
                x[0] + params.sample_time * pull / (1.0 + x[1] * params.rotating_mass),
                x[1],
                x[2],
            ]
        )

    x, cov = np.array([0.0, 1.0 / mass, slope]), np.diag(params.process_var)
    before, masses = None, []
    for v, use in zip(speed, on, strict=True):
        if use and before is None:
            x[0] = v
            cov[0], cov[:, 0] = 0.0, 0.0
            cov[0, 0] = params.process_var[0]
        elif use:
            scale = np.array([1e-4, 1e-9, 1e-6])
            moved = [
                (f(x + d, before) - f(x - d, before)) / (2.0 * d.sum()) for d in np.diag(scale)
            ]
            a = np.column_stack(moved)
            x = f(x, before)
            cov = a @ cov @ a.T + np.diag(params.process_var)
            h = np.array([[1.0, 0.0, 0.0]])
            gain = cov @ h.T / (h @ cov @ h.T + params.speed_var)
            x = x + gain[:, 0] * (v - x[0])
            cov = (np.eye(3) - gain @ h) @ cov
        before = v if use else None
        masses.append(1.0 / x[1])
    return np.array(masses), cov


def test_equals_the_printed_equations():
    speed, on = samples()
    state = kernel.initial_state(1500.0, 0.01, PARAMS)
    last, x, *_ = kernel.run(state, speed, on, PARAMS)
    mass, cov = twin(speed, on, PARAMS, 1500.0, 0.01)
    assert_allclose(1.0 / x[:, 1], mass, rtol=1e-7)
    scale = np.sqrt(np.outer(np.diag(cov), np.diag(cov)))
    assert_allclose(last.cov / scale, cov / scale, atol=1e-5)


def test_batch_equals_sample_by_sample_to_the_last_bit():
    speed, on = samples()
    state = kernel.initial_state(1500.0, 0.01, PARAMS)
    last, x, var, innovation, innovation_var = kernel.run(state, speed, on, PARAMS)
    for k in range(speed.size):
        state, e, s = kernel.step(state, speed[k], on[k], PARAMS)
        assert_array_equal(state.x, x[k])
        assert_array_equal(np.diag(state.cov), var[k])
        assert_array_equal([e, s], [innovation[k], innovation_var[k]])
    assert_array_equal(state.cov, last.cov)


def test_off_holds_mass_and_slope_and_takes_the_speed_up_anew():
    speed, on = samples()
    on[80:90] = False
    state = kernel.initial_state(1500.0, 0.01, PARAMS)
    _, x, _, innovation, _ = kernel.run(state, speed, on, PARAMS)
    assert_array_equal(x[80:91, 1:], np.broadcast_to(x[79, 1:], (11, 2)))
    assert np.isnan(innovation[80:91]).all()
    first = 90 + int(np.argmax(on[90:]))
    assert x[first, 0] == speed[first]


def test_finds_the_mass_where_speed_does_carry_it():
    # Torque really follows the speed, the road is level and known: then the rate of
    # return to the steady speed is the mass.
    params = PARAMS._replace(process_var=np.array([1e-8, 0.0, 0.0]), speed_var=1e-6)
    truth = np.array([14.0, 1.0 / 1200.0, 0.02])
    speed = np.empty(120)
    for k in range(speed.size):
        if k % 15 == 0:
            truth[0] = 14.0 + k / 30.0
        speed[k] = truth[0]
        accel, _ = kernel.acceleration(truth, truth[0], params)
        truth[0] += params.sample_time * accel
    on = np.arange(120) % 15 != 0
    start = kernel.initial_state(1500.0, 0.02, params)
    start.cov[1, 1] = 1e-7
    _, x, *_ = kernel.run(start, speed, on, params)
    assert 1.0 / x[-1, 1] == pytest.approx(1200.0, rel=1e-3)


def test_derivatives_by_differences():
    x, before = np.array([17.0, 1.0 / 1100.0, 0.013]), 16.4
    _, by_state = kernel.acceleration(x, before, PARAMS)
    for i, d in enumerate((1e-4, 1e-8, 1e-6)):
        up, down = x.copy(), x.copy()
        up[i] += d
        down[i] -= d
        high, low = (kernel.acceleration(at, before, PARAMS)[0] for at in (up, down))
        assert by_state[i] == pytest.approx((high - low) / (2.0 * d), rel=1e-6)
