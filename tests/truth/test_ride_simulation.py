"""The simulated ride against its equations, its road against the standard."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad, solve_ivp
from scipy.signal import csd, welch

from weighbridge import ConfigError
from weighbridge.simulation import TRUCK, RideScenario, RideSensors, simulate_ride
from weighbridge.simulation.ride import BAND, ROUGHNESS, coherence, draw_road

SETTLING = 6.0
"""The road begins so long before the first sample [s]."""

QUIET = RideSensors(rate=500.0, travel_noise=0.0, rate_noise=0.0, body_noise=(0.0, 0.0, 0.0))


def test_road_has_the_spectrum_and_the_likeness_of_its_class():
    road = draw_road("D", 30_000.0, 1.6, np.random.default_rng(4))
    at = np.arange(0.0, 30_000.0, 0.1)
    left, right = road.left(at), road.right(at)
    n, spectrum = welch(left, fs=10.0, nperseg=8192)
    _, other = welch(right, fs=10.0, nperseg=8192)
    _, cross = csd(left, right, fs=10.0, nperseg=8192)
    for low, high in ((0.03, 0.1), (0.1, 0.3), (0.3, 1.0), (1.0, 2.5)):
        band = (n > low) & (n < high)
        expected = 1024e-6 * (n[band] / 0.1) ** -2.0
        assert_allclose(np.mean(spectrum[band] / expected), 1.0, atol=0.07)
        assert_allclose(np.mean(other[band] / expected), 1.0, atol=0.07)
        alike = np.sum(cross.real[band]) / np.sum(spectrum[band])
        assert_allclose(
            alike, np.sum(coherence(n[band], 1.6) * expected) / np.sum(expected), atol=0.07
        )
    beyond = n > 1.1 * BAND[1]
    assert np.max(spectrum[beyond]) < 1e-3 * np.min(spectrum[(n > 1.0) & (n < 2.0)])


def test_likeness_is_that_of_an_isotropic_surface():
    # Kamash and Robson give x K_1(x), here with the integral that defines K_1.
    for n in (0.02, 0.1, 0.5):
        x = 2.0 * np.pi * n * 1.6
        k1 = quad(lambda t, x=x: np.exp(-x * np.cosh(t)) * np.cosh(t), 0.0, 12.0)[0]
        assert_allclose(coherence(np.array([n]), 1.6)[0], x * k1, rtol=1e-8)


def test_classes_are_four_times_as_rough_each():
    assert list(ROUGHNESS) == list("ABCDEFGH")
    assert_allclose(ROUGHNESS["A"], 16e-6)
    assert_allclose(ROUGHNESS["H"], 262144e-6)


def test_ride_solves_the_seven_equations():
    truck = replace(
        TRUCK, stiffness=(150e3, 177e3, 190e3, 200e3), damping=(7000.0, 7733.0, 9804.0, 5000.0)
    )
    scenario = RideScenario(vehicle=truck, duration=1.0, speed=15.0, sensors=QUIET, seed=9)
    made = simulate_ride(scenario)
    seeds = np.random.SeedSequence(9).spawn(3)
    base = sum(truck.axle_distance)
    end = SETTLING + 1.0
    step = 1.0 / (500.0 * 4)
    rows = round(end / step) + 1
    road = draw_road("C", 15.0 * rows * step + base, 1.6, np.random.default_rng(seeds[0]))
    tf, tr = 0.5 * truck.track[0], 0.5 * truck.track[1]
    lf, lr = truck.axle_distance
    c, k, cu = truck.stiffness, truck.damping, truck.tyre_stiffness
    muf, mur = truck.unsprung_mass
    juf, jur = truck.axle_inertia

    def slope(t, y):
        z, roll, pitch, zf, zr, rf, rr = y[:7]
        vz, vroll, vpitch, vzf, vzr, vrf, vrr = y[7:]
        here = 15.0 * t
        q = (road.left(here + base), road.right(here + base), road.left(here), road.right(here))
        body = (z + tf * roll + lf * pitch, z - tf * roll + lf * pitch,
                z + tr * roll - lr * pitch, z - tr * roll - lr * pitch)  # fmt: skip
        speed = (vz + tf * vroll + lf * vpitch, vz - tf * vroll + lf * vpitch,
                 vz + tr * vroll - lr * vpitch, vz - tr * vroll - lr * vpitch)  # fmt: skip
        wheel = (zf + tf * rf, zf - tf * rf, zr + tr * rr, zr - tr * rr)
        hop = (vzf + tf * vrf, vzf - tf * vrf, vzr + tr * vrr, vzr - tr * vrr)
        s = [k[i] * (speed[i] - hop[i]) + c[i] * (body[i] - wheel[i]) for i in range(4)]
        u = [cu[i] * (wheel[i] - q[i]) for i in range(4)]
        return [
            *y[7:],
            -sum(s) / truck.sprung_mass,
            -(tf * (s[0] - s[1]) + tr * (s[2] - s[3])) / truck.roll_inertia,
            -(lf * (s[0] + s[1]) - lr * (s[2] + s[3])) / truck.pitch_inertia,
            (s[0] + s[1] - u[0] - u[1]) / muf,
            (s[2] + s[3] - u[2] - u[3]) / mur,
            tf * (s[0] - s[1] - u[0] + u[1]) / juf,
            tr * (s[2] - s[3] - u[2] + u[3]) / jur,
        ]

    at = SETTLING + made.time[::50]
    found = solve_ivp(slope, (0.0, end), np.zeros(14), t_eval=at, rtol=1e-6, atol=1e-8,
                      method="DOP853", max_step=1e-2)  # fmt: skip
    # The road is linear within the simulation's steps of half a millisecond, smooth here.
    assert_allclose(made.velocities[::50], found.y[7:10].T, atol=2e-5)


def test_load_rests_on_the_springs():
    # The smoothest road leaves the weight alone to be seen.
    loaded = TRUCK.loaded(1.5)
    made = simulate_ride(
        RideScenario(
            vehicle=loaded, road_class="A", speed=1.0, duration=20.0, zero_mass=5394.0,
            sensors=QUIET, seed=2,
        )
    )  # fmt: skip
    lift = -made.inputs[:, :4] @ TRUCK.stiffness
    assert_allclose(np.mean(lift), 0.5 * 5394.0 * 9.81, rtol=2e-3)


def test_parameters_change_on_their_sample():
    made = simulate_ride(
        RideScenario(duration=2.0, changes=((0.5, 1.5), (1.0, 0.5)), sensors=QUIET, seed=3)
    )
    factor = made.inertias[:, 0] / TRUCK.sprung_mass
    assert_allclose(factor[made.time < 0.4999], 1.0)
    assert_allclose(factor[(made.time > 0.4999) & (made.time < 0.9999)], 1.5)
    assert_allclose(factor[made.time > 0.9999], 0.5)
    # Newton's law with the mass of each moment, by differences.
    force = -(made.inputs[:, :4] @ TRUCK.stiffness + made.inputs[:, 4:] @ TRUCK.damping)
    accel = np.gradient(made.velocities[:, 0], made.time)
    inside = np.abs(made.time[:, None] - [0.5, 1.0]).min(axis=1) > 0.01
    inside[[0, -1]] = False
    assert_allclose(accel[inside], (force / made.inertias[:, 0])[inside], atol=0.05)


def test_same_seed_gives_the_same_ride():
    one, two = (simulate_ride(RideScenario(duration=1.0, seed=7)) for _ in range(2))
    assert all(np.array_equal(one.drive.signals[n].values, two.drive.signals[n].values)
               for n in one.drive.signals)  # fmt: skip


def test_impossible_rides_are_refused():
    with pytest.raises(ConfigError, match="got 'J'"):
        simulate_ride(RideScenario(road_class="J", duration=1.0))
    with pytest.raises(ConfigError, match="speed"):
        RideScenario(speed=0.0)
    with pytest.raises(ConfigError, match="rate"):
        RideScenario(sensors=RideSensors(rate=5.0))
