"""The fit of the reading on the motion, against a map that is known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from weighbridge.balance import WINDOW, ForceTable
from weighbridge.calibration.inverse import (
    DriveRows,
    FitSettings,
    InverseFit,
    _confounded,
    fit,
    fit_with_gusts,
)
from weighbridge.vehicle import (
    TORQUE_SOURCES,
    VEHICLE_CLASSES,
    Driveline,
    RoadLoad,
    TorqueModel,
    TorqueTerms,
    Vehicle,
    torque_rows,
)

TRUCK_AREA, TRUCK_ROLLING = 8.0, 0.008
MASS, DRAG_AREA, ROLLING, ENGINE_INERTIA, WHEEL_INERTIA, RADIUS = 1400.0, 0.62, 0.01, 0.15, 5.0, 0.3
OFFSET, SCALE, LEAN = -20.0, 150.0, 0.12


def growing(engine):
    """Full-load torque that grows with engine speed [N m]."""
    return SCALE + LEAN * engine


def sagging(engine):
    """The same, which sags in the middle as that of a small engine does [N m]."""
    return growing(engine) * (1.0 - 0.12 * np.exp(-(((engine - 150.0) / 35.0) ** 2)))


def made(rng, motion_noise, n=4800, *, mass=MASS, full=growing, unmeasured_grade=0.008):
    """One drive at 2 Hz whose reading is the share of a full-load torque."""
    time = 0.5 * np.arange(n)
    stretch = (time // 12.0).astype(int)
    found = np.maximum(rng.normal(0.3, 0.25, stretch[-1] + 1), 0.0)[stretch]
    # What was found is a conditional mean: its error is in the truth and not in it.
    accel = found + rng.normal(0.0, motion_noise, n)
    speed = 8.0 + 12.0 * rng.random(stretch[-1] + 1)[stretch]
    gearing = rng.choice([14.0, 10.0, 7.5], stretch[-1] + 1)[stretch]
    engine = gearing * speed
    zero, one = np.zeros(n), np.ones(n)
    rotating = WHEEL_INERTIA / RADIUS**2 + ENGINE_INERTIA * gearing**2
    force = (mass + rotating) * accel + mass * 9.80665 * ROLLING + 0.6 * DRAG_AREA * speed**2
    load = (force / gearing - OFFSET) / full(engine) + rng.normal(0.0, 0.03, n)
    table = ForceTable(
        time=time, traction_force=force, force_std=zero, torque=force / gearing,
        engine_speed=engine, speed=speed, accel=found, specific_force=found, grade=zero,
        pitch=zero, heading=zero, gear=np.ones(n, dtype=np.int64), gearing=gearing,
        air_speed=speed, air_density=1.2 * one, fuel_burnt=zero, reason=np.zeros(n, dtype=np.uint8),
    )  # fmt: skip
    motion = SimpleNamespace(
        source="speed", specific_force_std=motion_noise, unmeasured_grade=unmeasured_grade,
        mean_accel_std=lambda length: motion_noise / np.sqrt(2.0 * length),
    )  # fmt: skip
    return DriveRows(
        table=table, regressor=load, engine_speed=engine,
        usable=np.append(np.diff(stretch) == 0, True), mass=mass, motion=motion,
    )  # fmt: skip


def known(of_class, source, radius):
    """A vehicle of a class whose road load stands beside the fit as if it were known."""
    area, rolling = of_class.road_prior(single_speed=False)[0][:2]
    return Vehicle(
        kind=of_class.name,
        driveline=Driveline(wheel_radius=radius),
        torque=TorqueModel(source=source, coefficients=(0.0, 1.0)),
        road_load=RoadLoad(
            drag_area=area, rolling_coefficient=rolling,
            drag_area_std=0.0, rolling_coefficient_std=0.0,
        ),
    )  # fmt: skip


def settings_of_load(*, knots=(), knot=0.0):
    return FitSettings(
        source=TORQUE_SOURCES["load"], order=2, curved=True, knots=knots, torque_noise=5.0,
        bounds=TorqueTerms(offset=0.5, growth=0.5, speed_growth=1.0, bend=0.5, knot=knot),
        vehicle=known(VEHICLE_CLASSES["car"], "load", RADIUS),
        prior=VEHICLE_CLASSES["car"].road_prior(single_speed=False),
    )  # fmt: skip


@pytest.mark.parametrize("motion_noise", [0.02, 0.2])
def test_the_map_is_found_where_the_motion_is_noisy(motion_noise):
    drive = made(np.random.default_rng(1), motion_noise)
    found = fit([drive], settings_of_load())
    _, scale, _, _, lean, bend = found.coefficients
    load, engine = 0.6, 120.0
    slope = scale + lean * engine + 2.0 * bend * load
    # A reading that stands on both sides explains itself and leaves nothing to the motion.
    assert slope == pytest.approx(SCALE + LEAN * engine, rel=0.05)
    assert found.road[0] == pytest.approx(DRAG_AREA, abs=0.2)


@pytest.mark.parametrize("known", [False, True])
def test_noise_of_a_measured_motion_is_not_taken_for_information(known):
    rng = np.random.default_rng(5)
    noise, drives = 0.08, []
    for _ in range(2):
        drive = made(rng, 0.0)
        seen = drive.table.specific_force + rng.normal(0.0, noise, drive.table.time.size)
        table = replace(drive.table, specific_force=seen, accel=seen)
        per_window = noise**2 * 0.5 / WINDOW if known else 0.0
        drives.append(replace(drive, table=table, motion_noise=per_window))
    settings = replace(settings_of_load(), order=0, curved=False)
    straight = np.polyfit(drives[0].table.engine_speed, growing(drives[0].table.engine_speed), 0)
    slope = fit(drives, settings).coefficients[1] / straight[0]
    if known:
        assert slope == pytest.approx(1.0, abs=0.03)
    else:
        assert slope > 1.1


def test_masses_far_apart_pin_the_rolling_resistance():
    truth = np.array([DRAG_AREA, ROLLING, ENGINE_INERTIA, WHEEL_INERTIA])
    stds = []
    for masses in ((MASS,) * 3, (MASS, 2.0 * MASS, 3.0 * MASS)):
        rng = np.random.default_rng(4)
        drives = [made(rng, 0.05, mass=mass, unmeasured_grade=0.0) for mass in masses]
        found = fit(drives, settings_of_load())
        road = np.array(found.road)
        stds.append(found.stds[-4:])
        assert np.all(np.abs(road - truth) < 3.0 * stds[-1])
    one, three = stds
    # Loads of a car, a third of its mass, leave it as open as one mass does.
    assert three[1] < 0.7 * one[1]


def test_knots_follow_a_torque_that_sags_at_some_engine_speeds():
    knots = (60.0, 95.0, 130.0, 165.0, 200.0, 240.0)
    drives = [made(np.random.default_rng(k), 0.05, full=sagging) for k in range(2)]
    low, high, engine = 0.1, 0.6, np.linspace(80.0, 220.0, 30)
    errors = []
    for settings in (settings_of_load(), settings_of_load(knots=knots, knot=0.1)):
        found = fit(drives, settings)
        at_high, at_low = (
            torque_rows(np.full(30, x), engine, 2, curved=True, knots=settings.knots)
            for x in (high, low)
        )
        rise = (at_high - at_low) @ found.coefficients
        errors.append(rise / ((high - low) * sagging(engine)) - 1.0)
    without, with_knots = np.sqrt(np.mean(np.square(errors), axis=1))
    assert with_knots < 0.015
    assert with_knots < 0.35 * without


def gusty(rng, mass):
    """A truck on the flat at the end of its power: a gust slows it down, for most of a minute."""
    step, n, gearing = 0.25, 14_400, 6.0
    gust = np.zeros(n)
    keep = np.exp(-step / 15.0)
    for k in range(1, n):
        gust[k] = keep * gust[k - 1] + 2.0 * np.sqrt(1.0 - keep**2) * rng.standard_normal()
    time = step * np.arange(n)
    # Full power, which is another every hundred seconds [W].
    power = mass * rng.uniform(6.0, 23.0, n // 400)[np.arange(n) // 400]
    speed, accel = np.zeros(n), np.zeros(n)
    now = 18.0
    for k in range(n):
        force = power[k] / now
        drag = 0.6 * TRUCK_AREA * (now + gust[k]) ** 2
        accel[k] = (force - drag - mass * 9.80665 * TRUCK_ROLLING) / mass
        speed[k] = now
        now += step * accel[k]
    force = power / speed
    zero, one = np.zeros(n), np.ones(n)
    table = ForceTable(
        time=time, traction_force=force, force_std=zero, torque=force / gearing,
        engine_speed=gearing * speed, speed=speed, accel=accel, specific_force=accel, grade=zero,
        pitch=zero, heading=zero, gear=np.ones(n, dtype=np.int64), gearing=gearing * one,
        air_speed=speed, air_density=1.2 * one, fuel_burnt=zero, reason=np.zeros(n, dtype=np.uint8),
    )  # fmt: skip
    motion = SimpleNamespace(
        source="inertial",
        specific_force_std=0.01,
        unmeasured_grade=0.0,
        mean_accel_std=lambda _: 0.0,
    )
    return DriveRows(
        table=table, regressor=force / gearing, engine_speed=gearing * speed,
        usable=np.ones(n, dtype=bool), mass=mass, motion=motion,
    )  # fmt: skip


def test_what_gusts_confound_stays_open():
    settings = FitSettings(
        source=TORQUE_SOURCES["percent"], order=0, curved=False, knots=(), torque_noise=5.0,
        bounds=TorqueTerms(offset=0.05, growth=0.02, speed_growth=0.03, bend=0.05, knot=0.012),
        vehicle=known(VEHICLE_CLASSES["truck"], "percent", 0.5),
        prior=VEHICLE_CLASSES["truck"].road_prior(single_speed=False),
    )  # fmt: skip
    told = {fit: [], fit_with_gusts: []}
    for seed in range(3):
        rng = np.random.default_rng(seed)
        drives = [gusty(rng, mass) for mass in (8000.0, 12000.0, 15000.0)]
        for how, errors in told.items():
            found = how(drives, settings)
            errors.append((found.road[1] - TRUCK_ROLLING) / found.stds[-3])
    # Speed answers to the gusts, and the drag that is missing passes for rolling resistance.
    assert min(told[fit]) > 2.0
    assert max(np.abs(told[fit_with_gusts])) < 1.8


def test_a_drag_area_below_zero_meets_the_prior_again():
    cov = np.diag([4.0, 1e-4, 0.02**2, 1e-6, 1e-4, 0.25])
    cov[0, 2] = cov[2, 0] = 0.5 * 2.0 * 0.02
    plain = InverseFit(
        coefficients=np.array([1.0, 1.0]), road=np.array([-0.3, 0.012, 0.03, 4.0]),
        stds=np.sqrt(np.diag(cov)), cov=cov, log_likelihood=0.0, windows=400,
    )  # fmt: skip
    apart = np.array([-6.0, 0.0, 1.2, -1e-3, 0.0, 0.0])
    found = _confounded(plain, apart, 0.65, 0.25)
    # The same by information: noise and bias of the drives, then the class.
    told = 1.0 / (1.0 / 0.02**2 - 1.0 / 0.25**2)
    widened = told + (1.2 * told / 0.02**2) ** 2
    at = told * (-0.3 / 0.02**2 - 0.65 / 0.25**2)
    after = 1.0 / (1.0 / widened + 1.0 / 0.25**2)
    assert_allclose(found.road[0], after * (at / widened + 0.65 / 0.25**2), rtol=1e-9)
    assert_allclose(found.stds[2] ** 2, after, rtol=1e-9)
    assert 0.5 < found.road[0] < 0.65
    # The offset follows the drag area along the difference of the two fits.
    assert_allclose((found.coefficients[0] - 1.0) / (found.road[0] + 0.3), -5.0, rtol=0.02)
    above = replace(plain, road=np.array([0.3, 0.012, 0.03, 4.0]))
    kept = _confounded(above, apart, 0.65, 0.25)
    assert_allclose(kept.road, above.road)
    assert_allclose(kept.cov, cov + np.outer(apart, apart))
