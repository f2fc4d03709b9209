"""The three methods of Du 2025 on made-up force balances."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.noted import error

from weighbridge import ConfigError, Status, Vehicle
from weighbridge.balance import ForceBalance, ForceTable, Reason
from weighbridge.constants import GRAVITY
from weighbridge.estimators import ESTIMATORS
from weighbridge.kernels import mass_ekf as kernel
from weighbridge.vehicle import Driveline, Provenance, RoadLoad, TorqueModel

METHODS = ("robust-rls", "ekf", "hybrid")
robust_rls, ekf, hybrid = (ESTIMATORS[method] for method in METHODS)
BUS = Vehicle(
    kind="bus",
    tare=7000.0,
    # Rotating parts that act like 300 kg, known to some 30 kg.
    driveline=Driveline(
        gearings=(10.0,),
        wheel_radius=0.5,
        wheel_inertia=75.0,
        wheel_inertia_std=4.0,
        engine_inertia=0.0,
        engine_inertia_std=0.25,
    ),
    torque=TorqueModel(source="measured"),
    road_load=RoadLoad(drag_area=5.4, rolling_coefficient=0.0075, rolling_speed_coefficient=4e-5),
    provenance=Provenance(mass_scale_std=0.01),
)


def balance(mass=10_000.0, *, seed=1, minutes=6.0, grade=0.01, swing=1.0, offset=0.0, rate=20.0):
    """Rows of a bus that speeds up and slows down; ``swing`` 0 is a cruise."""
    rng = np.random.default_rng(seed)
    n = int(60.0 * minutes * rate)
    time = np.arange(n) / rate
    slope = grade * np.sin(time / 20.0)
    speed = 14.0 - swing * 12.0 * np.cos(time / 15.0)
    accel = swing * 0.8 * np.sin(time / 15.0)
    rotating = np.full(n, 300.0)
    drag = 0.5 * 1.2 * 5.4 * speed**2
    rolling = mass * 9.81 * np.cos(slope) * (0.0075 + 4e-5 * speed)
    force = (mass + rotating) * accel + drag + rolling + mass * 9.81 * np.sin(slope)
    reason = np.where(speed < 3.0, Reason.STANDING, Reason.USED).astype(np.uint8)
    braking = force < -2000.0
    reason[braking] = Reason.BRAKING
    noise = 0.02 * rng.normal(size=n)
    table = ForceTable(
        time=time,
        traction_force=force + rng.normal(0.0, 200.0, n),
        force_std=np.full(n, 200.0),
        torque=force / 10.0,
        engine_speed=10.0 * speed,
        speed=speed + rng.normal(0.0, 0.01, n),
        accel=accel,
        specific_force=accel + 9.81 * np.sin(slope) + offset + noise,
        grade=slope + (offset + noise) / 9.81,
        pitch=slope,
        heading=np.zeros(n),
        gear=np.ones(n, dtype=np.int64),
        gearing=np.full(n, 10.0),
        air_speed=speed,
        air_density=np.full(n, 1.2),
        fuel_burnt=np.zeros(n),
        reason=reason,
    )
    motion = SimpleNamespace(
        source="inertial",
        unmeasured_grade=0.0,
        recorded_speed=None,
        specific_force_scale_std=0.0,
        specific_force_std=0.02,
    )
    return ForceBalance(motion=motion, table=table)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rate", [4.0, 20.0, 100.0])
def test_finds_the_mass_at_any_rate(method, rate):
    track = ESTIMATORS[method].track(balance(rate=rate), BUS)
    assert track.method == method
    assert track.status is Status.CONVERGED
    assert track.mass == pytest.approx(10_000.0, rel=0.015)
    assert abs(track.mass - 10_000.0) < 3.0 * track.std
    known = np.isfinite(track.running_mass)
    late = track.time > 60.0
    assert known[late].all()
    assert np.abs(track.running_mass[late] / 10_000.0 - 1.0).max() < 0.05
    assert not known[0]
    assert (track.running_std[known] > 0.0).all()
    assert track.bound_std < track.std
    assert len(track.segments) == 1


@pytest.mark.parametrize("method", METHODS)
def test_a_cruise_carries_no_mass(method):
    track = ESTIMATORS[method].track(balance(swing=0.0, grade=0.0), BUS)
    assert track.status is Status.NOT_EXCITED
    assert track.reason.id in ("motion.not_excited", "motion.wide")


@pytest.mark.parametrize("method", METHODS)
def test_no_usable_row_is_no_mass_and_no_error(method):
    made = balance(minutes=1.0)
    none = replace(made, table=replace(made.table, reason=np.full_like(made.table.reason, 3)))
    track = ESTIMATORS[method].track(none, BUS)
    assert track.status is Status.NOT_EXCITED
    assert np.isnan(track.mass)


@pytest.mark.parametrize("method", METHODS)
def test_missing_numbers_are_left_out(method):
    made = balance()
    table = made.table
    broken = {
        name: getattr(table, name).copy()
        for name in ("traction_force", "specific_force", "grade", "speed", "air_speed")
    }
    for k, name in enumerate(broken):
        broken[name][1000 + 150 * k : 1100 + 150 * k] = np.nan
    track = ESTIMATORS[method].track(replace(made, table=replace(table, **broken)), BUS)
    assert track.status is Status.CONVERGED
    assert track.mass == pytest.approx(10_000.0, rel=0.02)
    assert np.isfinite(track.running_mass[2000:]).all()
    gap = slice(1000, 1100)
    assert (track.row_reason[gap] != Reason.USED).all()


@pytest.mark.parametrize("method", METHODS)
def test_an_offset_of_the_accelerometer_is_told_from_the_mass(method):
    found = ESTIMATORS[method].track(balance(offset=0.04, minutes=10.0), BUS).mass
    assert found == pytest.approx(10_000.0, rel=0.02)


def test_without_an_offset_the_paper_is_biased_by_one():
    settings = robust_rls.settings(offset_std=0.0)
    found = robust_rls.track(balance(offset=0.04, minutes=10.0), BUS, settings).mass
    assert found < 9800.0


def test_noise_of_force_draws_up_and_noise_of_the_motion_down_but_not_at_their_mean():
    found = {0.0: [], 0.1: [], 2.0: []}
    for seed in range(2):
        made = balance(minutes=12.0, rate=10.0, seed=seed)
        table, rng = made.table, np.random.default_rng(7 + seed)
        # Forces that nobody measures, and the driver's answer to them: the speed is as it was.
        shocks = lfilter([1500.0 * 0.71], [1.0, -0.7], rng.normal(size=table.time.size))
        read = table.specific_force + 0.5 * rng.normal(size=table.time.size)
        noisy = replace(table, traction_force=table.traction_force + shocks, specific_force=read)
        for window, masses in found.items():
            settings = ekf.settings(jacobian_window=window)
            masses.append(ekf.track(replace(made, table=noisy), BUS, settings).mass / 10_000.0)
    by_model, by_rows, by_mean = (np.mean(masses) for masses in found.values())
    assert by_model > 1.08
    assert abs(by_mean - 1.0) < 0.015
    assert by_rows < by_mean - 0.004


def test_the_noise_of_the_motion_that_is_known_does_not_draw_the_final_mass_down():
    found = {True: [], False: []}
    for seed in range(3):
        made = balance(minutes=12.0, seed=seed)
        noise = 0.5 * np.random.default_rng(40 + seed).normal(size=made.table.time.size)
        table = replace(made.table, specific_force=made.table.specific_force + noise)
        # What the motion says of one sample: of its square, windows keep five sixteenths.
        made.motion.specific_force_std = 0.5 / np.sqrt(10.0 * 0.3125)
        for allowed, masses in found.items():
            settings = robust_rls.settings(noisy_motion=allowed)
            masses.append(robust_rls.track(replace(made, table=table), BUS, settings).mass)
    assert abs(np.mean(found[True]) / 10_000.0 - 1.0) < 0.01
    assert np.mean(found[False]) < 9500.0


def filtered(made, settings):
    """Errors of the Kalman filter's running mass over the standard deviation it has itself."""
    table, road = made.table, BUS.road_load
    rolling = road.rolling_coefficient + road.rolling_speed_coefficient * table.speed
    phi = table.specific_force + GRAVITY * rolling * np.cos(table.grade)
    mean = np.ones(1 + round(settings.jacobian_window / 0.1))
    rows = kernel.Columns(
        time=table.time,
        traction=table.traction_force,
        drag=0.5 * table.air_density * road.drag_area,
        headwind=np.zeros(table.time.size),
        rotating=np.full(table.time.size, 300.0),
        speed=table.speed,
        grade=table.grade,
        driven=table.usable,
        standing=table.speed < 1.0,
        regressor=np.convolve(phi, mean / mean.size, mode="same"),
    )
    params = kernel.MassEkfParams(
        gravity=GRAVITY,
        rolling=road.rolling_coefficient,
        rolling_speed=road.rolling_speed_coefficient,
        speed_density=settings.speed_noise**2,
        grade_density=settings.grade_noise**2,
        accel_walk=settings.accel_walk**2,
        grade_walk=settings.grade_walk**2,
        mass_walk=(settings.mass_walk * BUS.tare) ** 2,
        load_walk=(settings.load_walk * BUS.tare) ** 2,
        start_speed_var=settings.start_speed_std**2,
        start_grade_var=settings.start_grade_std**2,
        offset_var=settings.grade_offset**2,
        offset_walk=settings.offset_walk**2,
        gate=settings.gate,
        pause=0.8,
        lightest=5000.0,
        heaviest=20_000.0,
    )
    start = kernel.initial_state(10_000.0, 1000.0**2, kernel.row_at(rows, 0), params)
    _, mass, var, *_ = kernel.run(start, rows, 0, params)
    return ((mass - 10_000.0) / np.sqrt(var))[table.time > 60.0]


def test_the_kalman_filter_is_as_sure_as_torque_errors_that_last_allow():
    keep = np.exp(-0.1 / 5.0)  # errors of 0.03 m/s^2 that last 5 s, in rows of 0.1 s
    usual, white = [], []
    for seed in range(6):
        made = balance(seed=seed, rate=10.0)
        table = made.table
        shocks = np.random.default_rng([seed, 5]).normal(size=table.time.size)
        error = 300.0 * lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], shocks)
        made = replace(made, table=replace(table, traction_force=table.traction_force + error))
        usual.append(filtered(made, ekf.settings()))
        white.append(filtered(made, ekf.settings(accel_walk=0.02)))
    assert np.mean(np.abs(np.concatenate(usual)) < 1.96) > 0.93
    assert np.sqrt(np.mean(np.concatenate(usual) ** 2)) > 0.4
    assert np.mean(np.abs(np.concatenate(white)) < 1.96) < 0.8


def test_counting_the_grade_twice_makes_a_climbing_bus_light():
    made = balance(swing=0.4, grade=0.0)
    table = made.table
    steep = np.full_like(table.grade, 0.03)
    climbing = replace(
        table,
        grade=steep,
        specific_force=table.specific_force + 9.81 * np.sin(steep),
        traction_force=table.traction_force + 10_000.0 * 9.81 * np.sin(steep),
    )
    made = replace(made, table=climbing)
    once = robust_rls.settings(offset_std=0.0)
    assert robust_rls.track(made, BUS, once).mass == pytest.approx(10_000.0, rel=0.01)
    twice = replace(once, count_grade_twice=True)
    phi = (climbing.specific_force + 9.81 * (0.0075 + 4e-5 * table.speed))[table.usable]
    more = phi + 9.81 * np.sin(0.03)
    expected = 10_000.0 * np.sum(phi * more) / np.sum(more**2)
    assert expected < 8000.0
    assert robust_rls.track(made, BUS, twice).mass == pytest.approx(expected, rel=0.03)


def test_the_ekf_alone_is_the_one_of_the_blend():
    made = balance()
    fast = hybrid.settings(blend="speed", blend_speed=-1e3)
    alone, blended = ekf.track(made, BUS), hybrid.track(made, BUS, fast)
    assert np.array_equal(alone.running_mass, blended.running_mass, equal_nan=True)
    slow = hybrid.settings(blend="speed", blend_speed=1e3)
    least, blended = robust_rls.track(made, BUS), hybrid.track(made, BUS, slow)
    told = np.isfinite(least.running_mass)
    assert np.array_equal(told, np.isfinite(blended.running_mass))
    assert np.array_equal(least.running_mass[told], blended.running_mass[told])


def test_every_row_by_itself_with_a_factor_is_the_textbooks_recursion():
    made = balance(minutes=2.0)
    settings = robust_rls.settings(
        window=0.0, forgetting=0.999, kept_information=0.0, offset_std=0.0, threshold=1e9
    )
    found = robust_rls.track(made, BUS, settings).running_mass
    table, road = made.table, BUS.road_load
    rolling = road.rolling_coefficient + road.rolling_speed_coefficient * table.speed
    phi = table.specific_force + GRAVITY * rolling * np.cos(table.grade)
    drag = 0.5 * table.air_density * road.drag_area * table.air_speed**2
    y = table.traction_force - drag - 300.0 * table.accel
    valid = table.reason == Reason.USED
    # Du et al. 2025, eq. 15, in the order of print; P starts without knowledge.
    mass, cov = 0.0, 1e9
    for k in np.flatnonzero(valid):
        gain = cov * phi[k] / (0.999 + phi[k] ** 2 * cov)
        mass += gain * (y[k] - phi[k] * mass)
        cov *= (1.0 - gain * phi[k]) / 0.999
    assert found[-1] == pytest.approx(mass, rel=1e-6)
    # A cruise forgets what told the mass; the mass stays told.
    assert np.isfinite(found[np.flatnonzero(np.isfinite(found))[0] :]).all()


@pytest.mark.parametrize("method", METHODS)
def test_a_rolling_coefficient_too_low_makes_a_bus_heavy(method):
    within = {"robust-rls": "", "ekf": "start.", "hybrid": "ekf.start."}[method]
    made = balance(grade=0.0)
    estimator = ESTIMATORS[method]
    alone = {f"{within}offset_std": 0.0}
    if method != "robust-rls":
        before = within.removesuffix("start.")
        alone |= {f"{before}grade_offset": 0.0, f"{before}offset_walk": 0.0}
    low = estimator.settings_of(alone | {f"{within}rolling_coefficient": 0.0005})
    right = estimator.settings_of(alone)
    assert estimator.track(made, BUS, right).mass == pytest.approx(10_000.0, rel=0.01)
    assert estimator.track(made, BUS, low).mass > 10_300.0


def test_what_a_sensor_ahead_reads_in_bends_is_taken_off():
    made = balance(minutes=10.0)
    table = made.table
    # Bends of 0.3 rad/s wherever the bus pulls hard, and a sensor 4 m ahead of the rear axle.
    rate = np.where(table.accel > 0.4, 0.3, 0.0)
    heading = np.mod(np.cumsum(rate) / 20.0, 2.0 * np.pi)
    read = table.specific_force - 4.0 * rate**2
    bent = replace(made, table=replace(table, heading=heading, specific_force=read))
    straight = robust_rls.track(bent, BUS, robust_rls.settings())
    ahead = robust_rls.track(bent, BUS, robust_rls.settings(sensor_ahead=4.0))
    assert straight.mass > 12_000.0
    assert ahead.mass == pytest.approx(10_000.0, rel=0.02)


def test_a_start_mass_is_held_by_what_it_is_worth():
    made = balance(minutes=2.0)
    first = {}
    for worth in (0.0, 1.0, 100.0):
        settings = robust_rls.settings(
            start_mass=8000.0, start_information=worth, first_information=0.1
        )
        track = robust_rls.track(made, BUS, settings)
        first[worth] = track.running_mass[track.time > 20.0][0]
    assert 8000.0 < first[100.0] < first[1.0] < first[0.0] * 1.001
    assert first[100.0] < 9500.0
    assert first[0.0] == pytest.approx(10_000.0, rel=0.03)


@pytest.mark.parametrize("method", ["ekf", "hybrid"])
def test_the_kalman_filter_starts_from_a_given_mass_at_once(method):
    name = {"ekf": "start_mass", "hybrid": "ekf.start_mass"}[method]
    estimator = ESTIMATORS[method]
    track = estimator.track(balance(), BUS, estimator.settings_of({name: 12_000}))
    assert track.running_mass[0] == 12_000.0
    assert track.running_mass[-1] == pytest.approx(10_000.0, rel=0.03)


@pytest.mark.parametrize("blend", list(type(hybrid.settings().blend)))
def test_every_blend_lies_between_both_filters(blend):
    made = balance()
    blended = hybrid.track(made, BUS, hybrid.settings(blend=blend)).running_mass
    least = robust_rls.track(made, BUS).running_mass
    kalman = ekf.track(made, BUS).running_mass
    told = np.isfinite(blended)
    assert told.sum() > 1000
    low, high = np.minimum(least, kalman)[told], np.maximum(least, kalman)[told]
    assert np.all(blended[told] >= low - 1e-6)
    assert np.all(blended[told] <= high + 1e-6)
    if blend.value == "share":
        assert blended[told] == pytest.approx(0.5 * (low + high))
    # A command gives the name as a word.
    assert ESTIMATORS["hybrid"].settings_of({"blend": blend.value}).blend is blend


@pytest.mark.parametrize(
    ("settings", "bad", "said"),
    [
        (robust_rls.settings, {"memory": 0.0}, "memory 0.0"),
        (robust_rls.settings, {"offset_std": -1.0}, "offset_std -1.0"),
        (ekf.settings, {"speed_noise": np.nan}, "speed_noise nan"),
        (ekf.settings, {"mass_walk": -1.0}, "mass_walk -1.0"),
        (hybrid.settings, {"blend_width": 0.0}, "blend_width 0.0"),
        (hybrid.settings, {"blend": "wind"}, "speed wind"),
        (hybrid.settings, {"blend_share": 2.0}, "blend_share -1 1 2"),
        (robust_rls.settings, {"forgetting": 0.5}, "0.9 1 0.5"),
        (robust_rls.settings, {"rolling_coefficient": -0.1}, "rolling_coefficient -0.1"),
        (ekf.settings, {"start_mass": 0.0}, "start_mass 0.0"),
    ],
)
def test_impossible_settings_are_refused(settings, bad, said):
    with error(ConfigError, said):
        settings(**bad)


def test_the_final_mass_of_the_hybrid_is_the_mean_of_both_parts():
    made = balance(minutes=10.0, seed=4)
    rng = np.random.default_rng(9)
    table = made.table
    shocks = lfilter([900.0], [1.0, -0.7], rng.normal(size=table.time.size))
    made = replace(made, table=replace(table, traction_force=table.traction_force + shocks))
    masses = [ESTIMATORS[m].track(made, BUS).mass for m in ("robust-rls", "ekf", "hybrid")]
    assert abs(masses[1] - masses[0]) > 1.0
    assert masses[2] == pytest.approx(0.5 * (masses[0] + masses[1]), rel=1e-6)
