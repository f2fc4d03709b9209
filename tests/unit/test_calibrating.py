"""Calibration on simulated drives: what it finds, what it refuses."""

import re
import tomllib
from dataclasses import replace
from functools import cache
from html import unescape
from types import SimpleNamespace

import numpy as np
import pytest
from numba import config
from tests.noted import error, refused, says
from tests.unit.test_report import written

from weighbridge import CalibrationSettings, ConfigError, Signal, Vehicle, calibrate, weigh
from weighbridge.balance import force_balance
from weighbridge.balance.law import force_on_mass, mass_column
from weighbridge.calibration import (
    TrainingSettings,
    run_calibration,
    run_speed_calibration,
    self_weighing,
)
from weighbridge.cli.calibrate import speed_table, table
from weighbridge.simulation import (
    Scenario,
    Sensors,
    jensen_route,
    make_scenario,
    random_habits,
    random_vehicle,
    simulate_car,
    usual_polling,
)
from weighbridge.vehicle import TORQUE_SOURCES, Driveline, TorqueModel

pytestmark = pytest.mark.skipif(
    bool(config.DISABLE_JIT), reason="a whole drive takes minutes without the compiler"
)


DURATION = 700.0
"""Of the drives of the petrol car [s]."""


def short(seed, payload=0.0):
    scenario = make_scenario("car-short", payload=payload, seed=seed, without=("warm_up",))
    return simulate_car(replace(scenario, sensors=Sensors(imu_rate=50.0), duration=DURATION))


@pytest.fixture(scope="module")
def empty():
    return short(31)


@pytest.fixture(scope="module")
def part(empty):
    """The first minutes of the empty car, for what is refused."""
    return empty.drive.between(empty.drive.start, empty.drive.start + 450.0)


@pytest.fixture(scope="module")
def loaded():
    return short(32, 300.0)


@pytest.fixture(scope="module")
def electric():
    scenario = replace(make_scenario("electric", seed=33), sensors=Sensors(imu_rate=50.0))
    return simulate_car(replace(scenario, duration=700.0)).drive


def with_torque(made):
    truth = made.truth
    torque = Signal("engine_torque", truth.time[::5].copy(), truth.engine_torque[::5].copy())
    return made.drive.with_signals(torque)


@pytest.fixture(scope="module")
def fitted(empty):
    """Calibrate on the empty car by a method, once."""
    return cache(
        lambda method: run_calibration(empty.drive, settings=CalibrationSettings(method=method))
    )


@pytest.fixture(scope="module")
def car(fitted):
    return fitted("joint").vehicle


@pytest.fixture(scope="module")
def measured(empty):
    return calibrate(with_torque(empty))


@pytest.fixture(scope="module")
def motor(electric):
    return calibrate(electric)


def test_one_drive_by_load(car, empty):
    assert car.torque.source == "load"
    assert car.name == empty.drive.info.vehicle
    assert car.provenance.r_squared > 0.95
    made = empty.scenario.car
    true = np.array(made.gear_ratios) * made.final_drive / made.wheel_radius
    nearest = [np.abs(true / g - 1.0).min() for g in car.driveline.gearings]
    assert max(nearest) < 0.02


def test_the_engine_speed_at_standstill_is_the_idle_speed(car, empty):
    assert car.driveline.idle_speed == pytest.approx(empty.scenario.car.idle_speed, rel=0.03)


def test_a_motor_that_stands_has_no_idle_speed(motor):
    assert motor.driveline.idle_speed == 0.0


def test_it_weighs_its_own_drive_and_another(car, empty, loaded):
    assert 0.0 <= car.timing.torque_lag <= 0.3
    assert car.provenance.method == "joint"
    own = weigh(empty.drive, car)
    assert own.method == "joint"
    assert own.mass == pytest.approx(empty.truth.mass.mean(), rel=0.005)
    other, truth = weigh(loaded.drive, car), float(loaded.truth.mass.mean())
    low, high = other.interval(0.95)
    assert low < truth < high
    assert other.mass == pytest.approx(truth, rel=0.03)


def test_drives_of_different_mass_together(empty, loaded):
    drives, masses = [empty.drive, loaded.drive], [empty.scenario.mass, loaded.scenario.mass]
    both = calibrate(drives, masses)
    assert both.provenance.drives == ("car-short", "car-short")
    for made in (empty, loaded):
        assert weigh(made.drive, both).mass == pytest.approx(made.truth.mass.mean(), rel=0.03)
    # The masses in the drives' own files say the same.
    assert calibrate(drives).torque.coefficients == both.torque.coefficients


def test_measured_torque_is_preferred_and_better(measured):
    assert measured.torque.source == "measured"
    offset, scale = measured.torque.coefficients
    # Torque at the clutch; the driveline takes a few percent of it.
    assert 0.85 < scale < 1.02
    assert abs(offset) < 15.0
    assert measured.provenance.r_squared > 0.97


def test_torque_from_air_flow(empty, loaded):
    settings = CalibrationSettings(source="air_flow")
    known = Vehicle(name="car", tare=float(empty.truth.mass[0]))
    car = calibrate(empty.drive, vehicle=known, settings=settings)
    assert car.torque.source == "air_flow"
    weighing = weigh(loaded.drive, car)
    assert weighing.std < 0.06 * weighing.mass
    assert abs(weighing.mass - loaded.truth.mass[-1]) < 2.0 * weighing.std


def test_a_source_without_a_floor_has_the_range_of_its_readings(empty, monkeypatch, tmp_path):
    every = replace(TORQUE_SOURCES["air_flow"], floor=TORQUE_SOURCES["measured"].floor)
    monkeypatch.setitem(TORQUE_SOURCES._own, "air_flow", every)
    settings = CalibrationSettings(source="air_flow", method="rls")
    car = calibrate(empty.drive, settings=settings)
    car.save(tmp_path / "car.toml")
    kept = Vehicle.load(tmp_path / "car.toml").torque
    flow = empty.drive.signals["mass_air_flow"]
    reading = every.reading(empty.drive, flow.time, kept)
    low, high = kept.load_range
    assert np.nanmin(reading) <= low < 0.5 * np.nanmax(reading)
    assert high < 1.05 * np.nanmax(reading)


@pytest.mark.parametrize("limits", [(0.30, 1.00, 0.05), (0.40, 0.50, 0.02)])
def test_the_training_as_printed_ends_on_its_grid(empty, limits):
    chosen = TrainingSettings(grid_drag_area=limits)
    settings = CalibrationSettings(grid=True, method="rls", training=chosen)
    found = calibrate(empty.drive, settings=settings)
    low, high, step = limits
    steps = (found.road_load.drag_area - low) / step
    assert low - 1e-9 <= found.road_load.drag_area <= high + 1e-9
    assert steps == pytest.approx(round(steps), abs=1e-6)
    assert found.provenance.masses == (empty.drive.info.mass,)


def test_the_training_as_printed_is_on_one_drive(empty, loaded):
    settings = CalibrationSettings(grid=True, method="rls")
    with pytest.raises(ConfigError, match="is on one drive, got 2"):
        calibrate([empty.drive, loaded.drive], settings=settings)
    with pytest.raises(ConfigError, match="training is that of the grid"):
        CalibrationSettings(method="rls", training=TrainingSettings(order=3))


def test_what_lies_on_a_bound_is_told_with_what_it_means():
    # Of an air that brakes nothing the least drag area is still too much.
    slow = replace(make_scenario("car-short", seed=31).car, drag_area=0.02)
    scenario = replace(make_scenario("car-short", seed=31, without=("warm_up",)), car=slow)
    made = simulate_car(replace(scenario, sensors=Sensors(imu_rate=50.0), duration=DURATION))
    done = run_calibration(made.drive, settings=CalibrationSettings(method="rls"))
    assert "drag_area" in done.held
    held = next(p for p in done.problems if p.id == "calibration.held")
    assert held.values["names"] == ", ".join(done.held)
    assert held.text in done.vehicle.provenance.notes


def test_straight_regression_has_no_curvature(empty):
    settings = CalibrationSettings(order=1, curved=False, method="rls")
    car = calibrate(empty.drive, settings=settings)
    assert len(car.torque.coefficients) == 3
    assert car.torque.curvature == ()


def test_single_speed_electric_car(electric, motor):
    assert motor.torque.source == "measured"
    assert motor.driveline.single_speed
    found = weigh(electric, motor)
    assert found.mass == pytest.approx(electric.info.mass, rel=0.01)


def test_a_motor_that_is_warmer_next_time_is_in_every_mass(electric, motor, monkeypatch):
    left = motor.provenance.mass_scale_std
    # Once for the drive of the calibration, once for the one that is weighed.
    source = replace(TORQUE_SOURCES["measured"], motor_between_std=None)
    monkeypatch.setitem(TORQUE_SOURCES._own, "measured", source)
    without = calibrate(electric).provenance.mass_scale_std
    assert left == pytest.approx(np.hypot(without, np.sqrt(2.0) * 0.006), rel=0.02)


def test_single_speed_without_engine_speed(electric, motor):
    known = Vehicle(driveline=Driveline(gearings=motor.driveline.gearings))
    car = calibrate(electric.without("engine_speed"), vehicle=known)
    assert car.provenance.r_squared > 0.97


@pytest.mark.parametrize("more", [False, True])
def test_measured_gear_signal(empty, more):
    truth = empty.truth
    told = np.where(truth.phase == 0.0, truth.gear, 0.0)
    highest = np.flatnonzero(told == 6.0)
    told[highest[: highest.size // 2]] += more
    # So few rows name none.
    told[:5] = 9.0
    drive = empty.drive.with_signals(Signal("gear", truth.time[::5].copy(), told[::5].copy()))
    car = calibrate(drive, settings=CalibrationSettings(method="rls"))
    assert weigh(drive, car).mass == pytest.approx(truth.mass.mean(), rel=0.02)
    assert says(car.provenance.notes, "calibration.gears") == more
    assert says(car.provenance.notes, "calibration.gears", named=7, found=6) == more


def test_gear_ratios_of_another_vehicle_are_refused(empty, car):
    of_another = tuple(1.25 * g for g in (*car.driveline.gearings[:3], 17.5))
    base = Vehicle(driveline=Driveline(gearings=of_another))
    with refused("calibration.foreign_gears") as found:
        calibrate(empty.drive, vehicle=base)
    # It says which ratio was seen and which was expected.
    told = found.value.problem.values
    at_cruise = 100.0 / 3.6 * 30.0 / np.pi
    assert min(abs(told["seen"] / at_cruise / g - 1.0) for g in car.driveline.gearings) < 0.02
    assert min(abs(told["expected"] / at_cruise / g - 1.0) for g in of_another) < 1e-6


def test_percent_of_a_reference_torque(empty, measured, tmp_path):
    torque = with_torque(empty).signals["engine_torque"]
    drive = empty.drive.with_signals(
        Signal("engine_torque_fraction", torque.time, torque.values / 250.0)
    )
    settings = CalibrationSettings(source="percent")
    with refused("torque.no_reference"):
        calibrate(drive, settings=settings)
    known = Vehicle(torque=TorqueModel(source="percent", reference_torque=250.0))
    car = calibrate(drive, vehicle=known, settings=settings)
    assert car.torque.coefficients == pytest.approx(
        measured.torque.coefficients, rel=1e-3, abs=0.05
    )
    assert car.torque.reported_reference_torque is None
    told = Signal("reference_torque", np.arange(0.0, 60.0, 5.0), np.full(12, 250.0))
    quick = CalibrationSettings(source="percent", method="rls")
    car = calibrate(drive.with_signals(told), settings=quick)
    assert car.torque.reported_reference_torque == 250.0
    car.save(tmp_path / "car.toml")
    text = (tmp_path / "car.toml").read_text()
    earlier = text.replace("reported_reference_torque_nm", "told_reference_torque_nm")
    (tmp_path / "earlier.toml").write_text(earlier)
    again = Vehicle.load(tmp_path / "earlier.toml")
    assert earlier != text
    assert again.torque.reported_reference_torque == 250.0


def test_the_steps_of_the_reading_are_kept(car):
    assert car.torque.reading_step == pytest.approx(1.0 / 255.0, rel=1e-4)


def test_known_speed_scale_stays_where_the_drive_shows_none(empty):
    alone = empty.drive.without(
        *(n for n in empty.drive.signals if n.startswith(("gnss", "lat", "lon", "alt")))
    )
    quick = CalibrationSettings(method="rls")
    known = Vehicle(driveline=Driveline(speed_scale=1.02))
    assert calibrate(alone, vehicle=known, settings=quick).driveline.speed_scale == 1.02
    assert calibrate(alone, settings=quick).driveline.speed_scale == 1.0


@pytest.mark.parametrize("mass", [1.58, 158.0, 1.58e6, -1580.0, float("nan")])
def test_a_mass_no_car_has(empty, mass):
    with pytest.raises(ConfigError, match="no car's"):
        calibrate(empty.drive, mass)


def test_masses_that_do_not_fit_the_drives(empty):
    with error(ConfigError, "2 1"):
        calibrate([empty.drive], [1500.0, 1600.0])
    with error(ConfigError):
        calibrate([])
    unknown = replace(empty.drive, info=replace(empty.drive.info, mass=None))
    with error(ConfigError, "car-short --mass mass_kg drive.toml"):
        calibrate(unknown)


@pytest.mark.parametrize(
    ("source", "missing"), [("measured", "engine_torque"), ("percent", "engine_torque_fraction")]
)
def test_a_source_the_drive_lacks(empty, source, missing):
    with refused("calibration.no_torque", source=source, missing=missing):
        calibrate(empty.drive, settings=CalibrationSettings(source=source))


def test_settings_are_checked():
    with pytest.raises(ConfigError, match="source must be "):
        CalibrationSettings(source="guess")
    with pytest.raises(ConfigError, match="order"):
        CalibrationSettings(order=5)


def test_too_little_to_calibrate_by(empty):
    with refused("calibration.no_source"):
        calibrate(empty.drive.without("engine_load", "mass_air_flow"))
    with refused("calibration.few_samples"):
        calibrate(empty.drive.between(0.0, 90.0))


def test_a_source_that_says_nothing_is_refused(part):
    load = part.signals["engine_load"]
    noise = np.random.default_rng(4).uniform(0.3, 0.55, load.values.size)
    useless = part.with_signals(Signal("engine_load", load.time, noise))
    with refused("calibration.no_slope", reading="engine_load"):
        calibrate(useless, settings=CalibrationSettings(source="load"))


@pytest.mark.parametrize(
    ("engine", "why"),
    [("diesel", "calibration.diesel_air"), (None, "calibration.no_slope")],
)
def test_the_air_flow_of_a_diesel_is_refused_by_its_cause(part, engine, why):
    # Without a throttle each turn of the engine takes in the same air.
    speed = part.signals["engine_speed"]
    air = Signal("mass_air_flow", speed.time, 3e-4 * speed.values)
    drive = part.with_signals(air)
    with refused(why):
        calibrate(
            drive, vehicle=Vehicle(engine=engine), settings=CalibrationSettings(source="air_flow")
        )


def test_an_order_for_measured_torque_is_refused(electric):
    with error(ConfigError, "measured --order 1"):
        calibrate(electric, settings=CalibrationSettings(order=1))


def test_a_cold_or_short_calibration_widens_every_mass(empty, car):
    start = empty.drive.start
    brief = calibrate(empty.drive.between(start, start + 420.0))
    assert brief.provenance.mass_scale_std > car.provenance.mass_scale_std
    assert brief.provenance.mass_scale_std > 0.04
    assert says(brief.provenance.notes, "calibration.few")


def test_rolling_resistance_of_a_single_gear_is_not_fitted(electric):
    base = Vehicle(
        driveline=Driveline(gearings=make_scenario("electric").car.gearings),
    )
    found = calibrate(electric, vehicle=base, settings=CalibrationSettings(method="rls"))
    assert found.road_load.rolling_coefficient == pytest.approx(
        base.road.rolling_coefficient.value, rel=1e-3
    )
    assert found.driveline.engine_inertia_std is None


@pytest.mark.parametrize("method", ["joint", "rls"])
def test_an_inertia_stated_counts_though_engines_of_cars_have_it(electric, method):
    gearings = make_scenario("electric").car.gearings
    known = Vehicle(driveline=Driveline(gearings=gearings, engine_inertia=0.15))
    found = calibrate(electric, vehicle=known, settings=CalibrationSettings(method=method))
    # One gear tells nothing of it, so that it stays what was stated, within its class.
    assert found.driveline.engine_inertia == pytest.approx(0.15, abs=0.02)


def test_a_calibration_with_which_nothing_could_be_weighed_is_refused(part, monkeypatch):
    monkeypatch.setattr(self_weighing, "TRANSFER_STD", (0.3, 0.003))
    with refused("calibration.useless"):
        calibrate(part)


def test_a_mass_given_against_the_one_a_drive_states_is_noted(empty, car):
    stated = empty.drive.info.mass
    assert not says(car.provenance.notes or "", "calibration.other_mass")
    quick = CalibrationSettings(method="rls")
    heavier = calibrate(empty.drive, mass=1.1 * stated, settings=quick)
    assert says(heavier.provenance.notes, "calibration.other_mass", stated=stated)


def test_a_drive_without_the_accelerometer_of_its_calibration_says_so(empty, car):
    blind = empty.drive.with_signals()
    blind = replace(
        blind, signals={n: s for n, s in blind.signals.items() if n[:5] not in ("accel", "gyro_")}
    )
    found = weigh(blind, replace(car, without_accelerometer=None))
    assert any(text.id == "motion.no_accelerometer" for text in found.problems)
    assert found.result.std > 0.04 * found.result.mass
    assert not any(t.id == "motion.no_accelerometer" for t in weigh(empty.drive, car).problems)


def test_drive_and_file_are_weighed_by_the_sensors_both_have(empty, loaded, car, tmp_path):
    def blind(drive):
        return drive.without(*(n for n in drive.signals if n[:5] in ("accel", "gyro_")))

    alike = calibrate(blind(empty.drive), vehicle=Vehicle(name="known", tare=car.tare))
    car.save(tmp_path / "car.toml")
    loaded_car = Vehicle.load(tmp_path / "car.toml")
    expected = weigh(blind(loaded.drive), alike)
    found = weigh(blind(loaded.drive), loaded_car)
    assert found.mass == pytest.approx(expected.mass, abs=0.05 * expected.std)
    assert found.std == pytest.approx(expected.std, rel=0.01)
    assert not any(p.id == "motion.no_accelerometer" for p in found.problems)
    assert found.vehicle == loaded_car
    assert alike.without_accelerometer is None
    with_one = weigh(loaded.drive, alike)
    assert with_one.mass == pytest.approx(expected.mass, abs=0.05 * expected.std)
    assert any(p.id == "imu.file_without" for p in with_one.problems)


def test_a_torque_at_another_rate_than_in_the_calibration_widens_the_interval(empty, car):
    signals = empty.drive.signals.items()
    blind = replace(
        empty.drive, signals={n: s for n, s in signals if n[:5] not in ("accel", "gyro_")}
    )
    period = car.provenance.torque_period
    found = []
    for then in (period, 5.0 * period):
        made = replace(car.provenance, motion="speed_grade", torque_period=then)
        old = replace(car, kind="truck", provenance=made, without_accelerometer=None)
        found.append(weigh(blind, old))
    same, other = found
    assert not any(p.id == "torque.other_rate" for p in same.problems)
    said = next(p for p in other.problems if p.id == "torque.other_rate")
    assert said.values["now"] == pytest.approx(period, rel=0.05)
    wider = np.sqrt(other.result.std**2 - same.result.std**2)
    assert wider == pytest.approx(0.04 * other.result.mass, rel=0.02)


def test_thirds_of_the_drives_show_how_masses_scatter(monkeypatch, car, loaded):
    """Errors of three, three and no standard deviations, beside what is expected beforehand."""
    balance = weigh(loaded.drive, car).result.balance
    left = 2000.0
    mass = left + float(balance.table.fuel_burnt[-1])
    parts, errors = [], iter((1.03, 0.97, 1.0))

    def estimate(part, _, load_changes):
        parts.append(part.table.usable)
        return SimpleNamespace(
            mass=next(errors) * left,
            bound_std=0.01 * left,
            sensitivity=np.zeros(1),
            shape_sensitivity=np.zeros(18),
        )

    monkeypatch.setattr(self_weighing.joint, "estimate", estimate)
    monkeypatch.setattr(self_weighing, "rebalanced", lambda problem, car: [balance])
    factor = self_weighing.part_scatter(SimpleNamespace(masses=[mass], recordings=()), car)
    assert factor == pytest.approx(np.sqrt((6.0 * 1.6**2 + 2.0 * 3.0**2) / (6.0 + 2.0)))
    np.testing.assert_array_equal(np.sum(parts, axis=0), balance.table.usable)
    counts = np.sum(parts, axis=1)
    assert np.ptp(counts) <= 1


def test_what_scatters_more_in_the_calibration_is_less_sure_later(car, loaded):
    def own_std(factor):
        made = replace(car.provenance, std_factor=factor)
        found = weigh(loaded.drive, replace(car, provenance=made)).result
        return np.sqrt(found.std**2 - found.systematic_std**2)

    assert car.provenance.std_factor == pytest.approx(1.4, abs=0.4)
    assert own_std(2.0) == pytest.approx(2.0 * own_std(1.0), rel=0.02)


UNBURNT = SimpleNamespace(
    table=SimpleNamespace(fuel_burnt=np.zeros(2), torque=np.ones(2), usable=np.ones(2, dtype=bool))
)


def test_a_mass_that_jumps_with_the_scale_does_not_mislead_the_calibration(monkeypatch):
    """Levels of noise fall into another optimum at some scales, and the mass jumps."""
    base = Vehicle(torque=TorqueModel(source="measured", coefficients=(0.0, 1.0)))

    def estimate(_, car, load_changes):
        scale = car.torque.coefficients[1]
        jump = 60.0 if 1.1 < scale < 1.2 else 0.0
        mass = 6800.0 + 1.3 * 6800.0 * (scale - 1.0) - jump
        return SimpleNamespace(
            mass=mass, bound_std=30.0, sensitivity=np.zeros(1), shape_sensitivity=None
        )

    monkeypatch.setattr(self_weighing.joint, "estimate", estimate)
    problem = SimpleNamespace(masses=[8400.0], source=TORQUE_SOURCES["measured"])
    monkeypatch.setattr(self_weighing, "rebalanced", lambda problem, car: [UNBURNT])
    monkeypatch.setattr(self_weighing, "part_scatter", lambda problem, car: 1.6)
    scaled = self_weighing.self_weighed(problem, base, None, self_weighing.BY_JOINT)
    assert estimate(None, scaled, False).mass == pytest.approx(8400.0, rel=1e-3)
    assert scaled.provenance.mass_scale_std < 0.015

    def stuck(_, car, load_changes):
        return SimpleNamespace(
            mass=6800.0, bound_std=30.0, sensitivity=np.zeros(1), shape_sensitivity=None
        )

    monkeypatch.setattr(self_weighing.joint, "estimate", stuck)
    lost = self_weighing.self_weighed(problem, base, None, self_weighing.BY_JOINT)
    # What the scale cannot mend is in the interval.
    assert lost.provenance.mass_scale_std > 0.15


@pytest.mark.parametrize(("count", "left"), [(1, 0.0170), (4, 0.0134)])
def test_a_battery_leaves_open_what_differs_from_drive_to_drive(monkeypatch, count, left):
    base = Vehicle(torque=TorqueModel(source="battery", coefficients=(0.0, 1.0)))
    known = SimpleNamespace(
        mass=1500.0, bound_std=1e-9, sensitivity=np.zeros(1), shape_sensitivity=None
    )
    monkeypatch.setattr(self_weighing.joint, "estimate", lambda *_, **__: known)
    monkeypatch.setattr(self_weighing, "rebalanced", lambda problem, car: [UNBURNT] * count)
    monkeypatch.setattr(self_weighing, "part_scatter", lambda problem, car: 1.6)

    def made(source):
        problem = SimpleNamespace(masses=[1500.0] * count, source=TORQUE_SOURCES[source])
        done = self_weighing.self_weighed(problem, base, None, self_weighing.BY_JOINT)
        return done.provenance.mass_scale_std

    # The drive that is weighed differs, and so does each of the calibration.
    between = 0.012 * np.sqrt(1.0 + 1.0 / count)
    assert made("battery") == pytest.approx(np.hypot(made("measured"), between))
    assert made("battery") == pytest.approx(left, abs=5e-4)


def test_a_saved_file_weighs_as_the_fit_does(car, loaded, tmp_path):
    car.save(tmp_path / "car.toml")
    told = Vehicle.load(tmp_path / "car.toml")
    assert told.torque.coefficients != car.torque.coefficients
    exact, rounded = (weigh(loaded.drive, c) for c in (car, told))
    assert abs(rounded.mass - exact.mass) < 0.1 * exact.std
    assert rounded.std == pytest.approx(exact.std, rel=0.01)


def cells(shown):
    return list(zip(*(column._cells for column in shown.columns), strict=True))


FILE_KEYS = {
    "drag area C_d A (m²)": ("road_load", "drag_area_m2", "drag_area_std_m2"),
    "rolling coefficient C_r": ("road_load", "rolling_coefficient", "rolling_coefficient_std"),
    "engine inertia (kg m²)": ("driveline", "engine_inertia_kgm2", "engine_inertia_std_kgm2"),
    "wheel inertia (kg m²)": ("driveline", "wheel_inertia_kgm2", "wheel_inertia_std_kgm2"),
    "torque delay (s)": ("timing", "torque_delay_s", "torque_delay_std_s"),
    "torque noise (N m)": ("torque", "noise_nm", None),
    "torque fit R²": ("provenance", "r_squared", None),
    "torque fit residual (N m)": ("provenance", "residual_std_nm", None),
    "samples": ("provenance", "samples", None),
}


@pytest.mark.parametrize("method", ["joint", "rls"])
def test_report_terminal_and_file_tell_the_same(fitted, tmp_path, method):
    done = fitted(method)
    done.vehicle.save(tmp_path / "car.toml")
    saved = tomllib.loads((tmp_path / "car.toml").read_text(encoding="utf-8"))
    page = written(tmp_path, [], calibration=done)
    report = {
        unescape(k): unescape(v) for k, v in re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", page)
    }
    shown = {name: (value, std) for name, value, std in cells(table(done))}
    told = {**{k: v for k, v in saved["torque"].items() if k == "coefficients"}}
    for name, (section, key, std_key) in FILE_KEYS.items():
        value, std = shown[name]
        last_digit = 10.0 ** -len(value.partition(".")[2])
        # A file is rounded to a small part of its standard deviations.
        rounding = 0.51 * last_digit + 0.02 * (saved[section].get(std_key) or 0.0)
        assert float(value) == pytest.approx(saved[section][key], abs=rounding), name
        if std[:1].isdigit():
            stated = saved[section][std_key]
            assert float(std) == pytest.approx(stated, abs=rounding), name
        else:
            assert not saved[section].get(std_key), name
        assert report[name].startswith(value)
        assert std in report[name]
    for k, w in enumerate(told["coefficients"]):
        value, std = shown[f"torque w{k}"]
        assert float(value) == pytest.approx(w, rel=1e-4, abs=0.02 * float(std))
        assert report[f"torque w{k}"] == f"{value} (std {std})"
    scale = 100.0 * saved["provenance"]["mass_scale_std"]
    assert float(shown["left in every mass (%)"][0]) == pytest.approx(scale, abs=0.0051)


@pytest.mark.parametrize("method", ["joint", "rls"])
def test_the_rows_shown_are_those_of_the_vehicle_saved(empty, fitted, tmp_path, method):
    done = fitted(method)
    done.vehicle.save(tmp_path / "car.toml")
    balance = force_balance(
        empty.drive, Vehicle.load(tmp_path / "car.toml"), done.balances[0].motion
    )
    table = balance.table
    index = np.searchsorted(table.time - table.time[0], done.rows.time - 1e-6)
    np.testing.assert_allclose(
        done.rows.source_torque, balance.table.torque[index], rtol=5e-4, atol=0.02
    )
    saved = Vehicle.load(tmp_path / "car.toml")
    phi, rest = mass_column(table, saved), force_on_mass(table, saved)
    mass = empty.drive.info.mass - table.fuel_burnt
    taken = (mass * phi + table.traction_force - rest) / table.gearing
    np.testing.assert_allclose(done.rows.motion_torque, taken[index], rtol=5e-4, atol=0.05)
    residual = taken[index] - balance.table.torque[index]
    std = 1.4826 * np.median(np.abs(residual))
    assert done.vehicle.provenance.residual_std == pytest.approx(std, rel=5e-3)


def test_terminal_and_file_tell_the_same_speed_model(empty, tmp_path):
    done = run_speed_calibration(empty.drive)
    done.vehicle.save(tmp_path / "car.toml")
    saved = tomllib.loads((tmp_path / "car.toml").read_text(encoding="utf-8"))["speed_model"]
    shown = dict(cells(speed_table(done)))
    for k, p in enumerate(saved["corrections"], 1):
        assert float(shown[f"correction p{k}"]) == pytest.approx(p, rel=1e-4)
    assert float(shown["R² of the change of speed"]) == pytest.approx(saved["r_squared"], abs=6e-4)
    assert shown["steps of 7 s"] == str(saved["samples"])


def test_torque_on_another_clock_is_refused_with_what_to_add(empty):
    load = empty.drive.signals["engine_load"]
    early = empty.drive.with_signals(Signal("engine_load", load.time - 1.8, load.values))
    with refused("calibration.torque_clock", reading="engine_load") as told:
        calibrate(early)
    assert told.value.problem.values["by"] == pytest.approx(1.65, abs=0.3)


def test_cars_without_an_inertial_sensor_calibrate_by_load():
    """Cold cars in the wind, whose load bends with engine speed: a curve cannot be the motion."""
    inertias, rolling = [], []
    for seed, kind in ((5, "petrol_dct"), (15, "petrol_dct"), (16, "petrol_manual")):
        rng = np.random.default_rng(seed)
        simulated = random_vehicle(rng, kind)
        scenario = Scenario(
            name="cold", car=simulated, route=jensen_route(1500 + seed), seed=seed,
            habits=random_habits(np.random.default_rng(seed)), polling=usual_polling(simulated),
            sensors=Sensors(imu_rate=10.0), duration=800.0, wind_speed=6.0,
            ambient_temperature=272.0,
        )  # fmt: skip
        made = simulate_car(scenario)
        imu = [name for name in made.drive.signals if name.startswith(("accel", "gyro"))]
        known = Vehicle(driveline=Driveline(wheel_radius=simulated.wheel_radius))
        found = calibrate(made.drive.without(*imu), float(made.truth.mass[0]), vehicle=known)
        inertias.append(found.driveline.engine_inertia / simulated.engine_inertia)
        rolling.append(found.road_load.rolling_coefficient / simulated.rolling_coefficient)
    assert np.mean(inertias) < 2.0
    assert np.mean(rolling) < 2.1
