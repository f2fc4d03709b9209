import re
from dataclasses import fields, replace

import numpy as np
import polars as pl
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.ndimage import uniform_filter1d
from tests.noted import error

from weighbridge import ConfigError, read_drive
from weighbridge.signals import QUANTITIES
from weighbridge.simulation import (
    ABOUT,
    BUS,
    COMPACT,
    DIESEL_AUTOMATIC,
    ELECTRIC,
    MIDSIZE,
    SCENARIOS,
    TRUCK18,
    VAN,
    Braking,
    Effects,
    Habits,
    Loading,
    Polling,
    Sensors,
    flat_route,
    jensen_route,
    make_scenario,
    mixed_route,
    random_car,
    random_habits,
    random_vehicle,
    simulate_car,
    usual_polling,
)


def short(seed=5, duration=80.0, **changes):
    made = replace(make_scenario("car-short", seed=seed), duration=duration, start_rest=4.0)
    return replace(made, **changes)


@pytest.fixture(scope="module")
def made():
    return simulate_car(short())


def test_same_scenario_is_the_same_drive(made):
    again = simulate_car(short())
    for f in fields(made.truth):
        assert_array_equal(getattr(made.truth, f.name), getattr(again.truth, f.name))
    for name, s in made.drive.signals.items():
        assert_array_equal(s.values, again.drive.signals[name].values)
        assert_array_equal(s.time, again.drive.signals[name].time)


def test_another_seed_is_another_drive_on_the_same_road(made):
    other = simulate_car(short(seed=6))
    n = min(other.truth.speed.size, made.truth.speed.size)
    assert np.abs(other.truth.speed[:n] - made.truth.speed[:n]).max() > 1.0
    assert_array_equal(other.scenario.route.grade, made.scenario.route.grade)


def test_sensor_effects_leave_the_drive_and_other_sensors_alone(made):
    quiet = simulate_car(short(effects=Effects().without("imu_noise", "imu_bias")))
    assert_array_equal(quiet.truth.speed, made.truth.speed)
    assert_array_equal(
        quiet.drive.signals["latitude"].values, made.drive.signals["latitude"].values
    )
    assert_array_equal(
        quiet.drive.signals["engine_load"].values, made.drive.signals["engine_load"].values
    )
    assert np.any(quiet.drive.signals["accel_x"].values != made.drive.signals["accel_x"].values)


def test_signals_are_sound(made):
    for name, s in made.drive.signals.items():
        assert name == s.name
        assert np.all(np.diff(s.time) > 0.0), name
        assert np.all(np.isfinite(s.values)), name
        quantity = QUANTITIES[name]
        assert s.values.min() >= quantity.low, name
        assert s.values.max() <= quantity.high, name


def test_values_are_polled_one_after_another(made):
    polled = [s for s in made.drive.signals.values() if QUANTITIES[s.name].table == "obd"]
    stamps = np.concatenate([s.time for s in polled])
    assert len(polled) == 8
    assert np.unique(stamps).size == stamps.size
    for s in polled:
        expected = 0.05 if s.name in ("ambient_temperature", "barometric_pressure") else 0.25
        if expected == 0.25:
            assert_allclose(np.median(np.diff(s.time)), expected, rtol=0.1)


def test_polled_values_are_quantised(made):
    signals = made.drive.signals
    for name, step in (
        ("vehicle_speed", 1 / 3.6),
        ("engine_speed", 0.25 * np.pi / 30),
        ("engine_load", 1 / 255),
    ):
        counts = signals[name].values / step
        assert_allclose(counts, np.round(counts), atol=1e-6)
        assert np.unique(np.round(counts)).size > 10


def test_rounding_down_reads_half_a_step_less():
    read = []
    for rounding in ("nearest", "down"):
        polling = Polling(fast=("vehicle_speed",), slow=(), rate=20.0, speed_rounding=rounding)
        read.append(simulate_car(short(polling=polling)).drive.signals["vehicle_speed"].values)
    nearest, down = read
    moving = nearest > 3.0
    assert_allclose((nearest - down)[moving].mean(), 0.5 / 3.6, rtol=0.2)


@pytest.mark.parametrize(
    ("name", "full"),
    [("engine_load", MIDSIZE.load_full), ("engine_torque", max(MIDSIZE.curve_torque))],
)
def test_noise_of_the_torque_reading_is_a_part_of_its_full_value(name, full):
    def read(noise):
        polling = Polling(
            fast=(name,), slow=(), rate=50.0, delay_spread=0.0, delay_jitter=0.0, torque_noise=noise
        )
        effects = Effects().without("obd_quantisation", "obd_jitter")
        return simulate_car(short(polling=polling, effects=effects)).drive.signals[name].values

    quiet, noisy = read(0.0), read(0.01)
    # Near its lowest a load is cut off at zero.
    above = quiet > 0.2 * full
    assert_allclose((noisy - quiet)[above].std(), 0.01 * full, rtol=0.1)
    assert abs((noisy - quiet)[above].mean()) < 0.01 * full * 4.0 / np.sqrt(above.sum())


def test_polled_values_are_late_by_the_delay():
    polling = Polling(
        fast=("vehicle_speed", "engine_speed"), slow=(), rate=20.0, delay=0.13, delay_spread=0.0
    )
    made = simulate_car(short(polling=polling, effects=Effects().without("obd_quantisation")))
    s, truth = made.drive.signals["vehicle_speed"], made.truth
    speed = s.values / polling.speed_scale
    inside = (s.time > 1.0) & (s.time < truth.time[-1] - 1.0)
    errors = [
        np.std(speed[inside] - np.interp(s.time[inside] - lag, truth.time, truth.speed))
        for lag in np.arange(0.0, 0.3, 0.01)
    ]
    assert_allclose(0.01 * np.argmin(errors), 0.13, atol=0.011)


def test_load_is_linear_in_gross_torque_without_effects_and_not_with_them():
    polling = Polling(fast=("engine_load",), slow=(), rate=20.0)

    def departure(effects):
        truth = simulate_car(short(polling=polling, effects=effects)).truth
        c0, c1, c2 = MIDSIZE.drag_torque
        w = truth.engine_speed
        gross = truth.engine_torque + c0 + c1 * w + c2 * w**2
        on = (truth.phase == 0) & (truth.fuel_flow > 0) & (gross > 20.0)
        ratio = truth.load[on] / gross[on]
        return ratio.std() / ratio.mean()

    world = replace(Effects.none(), traffic=1.0, driver_ripple=1.0)
    assert departure(world) < 1e-3  # friction is that of the step before
    assert departure(replace(world, load_nonlinearity=1.0)) > 0.01


def test_load_tops_out_where_the_car_says():
    # A driver in a hurry with a heavy load uses full throttle.
    made = simulate_car(
        short(
            route=flat_route(4000.0, limit=35.0),
            aggressiveness=3.0,
            payload=1200.0,
            sensors=Sensors(imu_rate=0.0),
        )
    )
    assert_allclose(made.truth.engine_torque.max(), max(MIDSIZE.curve_torque), rtol=0.02)
    assert_allclose(made.truth.load.max(), MIDSIZE.load_full, rtol=0.15)


def test_no_fixes_in_an_outage():
    made = simulate_car(short(sensors=Sensors(gnss_outages=((20.0, 50.0),))))
    time = made.drive.signals["latitude"].time
    assert not np.any((time >= 20.0) & (time < 50.0))
    assert np.any(time < 20.0)
    assert np.any(time > 50.0)


def test_fixes_err_by_what_is_stated():
    sensors = Sensors(imu_rate=0.0, gnss_rate=10.0, gnss_drift_time=(2.0, 2.0))
    effects = Effects().without("gnss_delay")
    made = simulate_car(short(sensors=sensors, effects=effects, duration=150.0))
    s = made.drive.signals
    time = s["latitude"].time
    north = (s["latitude"].values - np.interp(time, made.truth.time, made.truth.latitude)) * 6.37e6
    up = s["altitude"].values - np.interp(time, made.truth.time, made.truth.altitude)
    assert_allclose(north.std(), np.hypot(0.4, 2.2) / np.sqrt(2), rtol=0.3)
    assert_allclose(up.std(), np.hypot(0.8, 4.5), rtol=0.3)


def test_vibration_has_the_level_stated():
    scenario = short(route=flat_route(4000.0, limit=25.0), effects=Effects.only(imu_vibration=1.0))
    still = replace(scenario, sensors=Sensors(vibration=0.0), duration=100.0)
    made = simulate_car(still)
    s = made.drive.signals
    fast = np.interp(s["accel_z"].time, made.truth.time, made.truth.speed) > 24.5
    assert fast.sum() > 5000
    assert_allclose(s["accel_z"].values[fast].std(), 0.25, rtol=0.1)
    assert_allclose(s["gyro_y"].values[fast].std(), 0.006, rtol=0.1)


def test_lower_inertial_rate_and_no_sensor():
    made = simulate_car(short(sensors=Sensors(imu_rate=100.0, gnss_rate=0.0)))
    assert_allclose(made.drive.signals["accel_x"].period, 0.01, rtol=0.01)
    assert not made.drive.has("latitude")
    made = simulate_car(short(sensors=Sensors(imu_rate=0.0)))
    assert not made.drive.has("accel_x")


@pytest.mark.parametrize("format", ["csv", "parquet"])
def test_written_tables_hold_the_drive(made, tmp_path, format):
    made.write(tmp_path / "drive", format=format)
    read = pl.read_csv if format == "csv" else pl.read_parquet
    imu = read(tmp_path / "drive" / f"imu.{format}")
    assert imu.columns == [
        "time_s", "accel_x_mps2", "accel_y_mps2", "accel_z_mps2",
        "gyro_x_radps", "gyro_y_radps", "gyro_z_radps",
    ]  # fmt: skip
    obd = read(tmp_path / "drive" / f"obd.{format}")
    filled = sum(obd[c].is_not_null().cast(int) for c in obd.columns if c != "time_s")
    assert filled.min() == 1
    assert filled.max() == 1
    speed = obd["vehicle_speed_kmh"].drop_nulls().to_numpy()
    assert_allclose(speed, made.drive.signals["vehicle_speed"].values * 3.6, atol=1e-6)
    gnss = read(tmp_path / "drive" / f"gnss.{format}")
    assert_allclose(
        np.radians(gnss["latitude_deg"].to_numpy()),
        made.drive.signals["latitude"].values,
        atol=1e-9,
    )
    truth = read(tmp_path / "drive" / f"truth.{format}")
    assert_allclose(truth["mass_kg"].to_numpy(), made.truth.mass, atol=1e-6)
    assert "mass_kg = 1580.0" in (tmp_path / "drive" / "drive.toml").read_text()


@pytest.mark.parametrize("format", ["csv", "parquet"])
def test_written_drive_is_read_back(made, tmp_path, format):
    made.write(tmp_path / "car-short", format=format)
    back = read_drive(tmp_path / "car-short")
    assert set(back.signals) == set(made.drive.signals)
    for name, s in made.drive.signals.items():
        assert_allclose(back.signals[name].values, s.values, rtol=1e-9, atol=2e-9)
        assert_allclose(back.signals[name].time, s.time, atol=1e-9)
    for f in fields(made.drive.info):
        expected = getattr(made.drive.info, f.name)
        if isinstance(expected, float):
            expected = pytest.approx(expected, rel=1e-6)
        assert getattr(back.info, f.name) == expected, f.name


def test_drive_does_not_tell_the_truth_but_the_mass_at_the_start(made):
    assert made.drive.info.mass == 1580.0
    assert not made.drive.has("engine_torque")
    assert not made.drive.has("grade")
    assert not made.drive.has("gear")


def test_electric_car_reports_torque_and_brakes_with_its_motor():
    scenario = replace(make_scenario("electric", seed=3), duration=150.0, start_rest=3.0)
    made = simulate_car(scenario)
    torque = made.drive.signals["engine_torque"].values
    assert torque.max() > 50.0
    assert torque.min() < -20.0
    moving = made.truth.speed > 2.0
    ratio = made.truth.engine_speed[moving] / made.truth.speed[moving]
    assert_allclose(ratio, ELECTRIC.gearings[0], rtol=0.03)


def test_manual_gearbox_interrupts_the_torque():
    scenario = replace(make_scenario("compact", seed=3), duration=80.0, start_rest=3.0)
    truth = simulate_car(scenario).truth
    shifting = truth.phase == 1
    assert shifting.sum() > 10
    assert truth.traction_force[shifting].min() < 60.0
    assert COMPACT.shift_floor == 0.0
    smooth = replace(scenario, effects=Effects().without("shift_gap"))
    truth = simulate_car(smooth).truth
    upshift = (truth.phase == 1) & (truth.pedal > 0.3)
    assert upshift.sum() > 10
    assert truth.traction_force[upshift].min() > 200.0


def test_driving_looks_like_driving():
    truth = simulate_car(make_scenario("car-short", seed=11)).truth
    standing = truth.speed < 0.1
    assert np.mean(truth.speed[standing] == 0.0) > 0.97
    assert truth.speed.max() * 3.6 < 95.0
    assert -4.0 < truth.accel.min() < -1.0
    assert 1.2 < truth.accel.max() < 3.0
    assert 0.02 < np.mean(truth.speed < 0.1) < 0.4
    assert truth.engine_speed.max() < MIDSIZE.max_speed
    assert set(np.unique(truth.gear)) >= {1.0, 2.0, 3.0, 4.0, 5.0}
    per_distance = (truth.mass[0] - truth.mass[-1]) / truth.distance[-1]
    assert 4.0 < per_distance / 0.745 * 1e5 < 12.0  # litres per 100 km


def test_route_returns_to_its_height_over_mirrored_hills():
    route = jensen_route()
    assert_allclose(route.length, 83_000.0, rtol=0.02)
    assert abs(route.height[-1]) < 1.0
    n = route.grade.size // 2
    assert_allclose(route.grade[:n], -route.grade[::-1][:n], atol=1e-12)
    assert np.degrees(np.abs(route.grade).max()) > 2.5
    assert np.degrees(np.abs(route.grade).max()) < 5.5


def test_driving_the_route_ends_near_its_start():
    made = simulate_car(make_scenario("car-short", seed=1))
    truth = made.truth
    assert truth.distance[-1] > 8000.0
    north = (truth.latitude[-1] - truth.latitude[0]) * 6.37e6
    east = (truth.longitude[-1] - truth.longitude[0]) * 6.37e6 * np.cos(truth.latitude[0])
    assert np.hypot(north, east) < 1500.0
    assert abs(truth.altitude[-1] - truth.altitude[0]) < 1.0


def test_load_changes_while_the_car_stands_and_the_engine_idles():
    stops = (
        Loading(distance=300.0, duration=20.0, load=240.0),
        Loading(distance=700.0, duration=10.0, load=-90.0),
    )
    scenario = short(duration=200.0, loading=stops, effects=Effects().without("fuel_burn"))
    made = simulate_car(scenario)
    truth = made.truth
    changing = np.flatnonzero(np.diff(truth.mass) != 0.0)
    assert changing.size > 100
    assert np.all(truth.speed[changing] == 0.0)
    assert_allclose(truth.engine_speed[changing], MIDSIZE.idle_speed, rtol=0.01)
    assert set(np.round(truth.distance[changing], -1)) == {300.0, 700.0}
    assert_allclose(truth.mass[-1], 1580.0 + 150.0)
    assert_allclose(np.max(truth.mass), 1580.0 + 240.0)
    assert made.drive.info.mass == 1580.0


def test_a_light_beside_a_place_of_loading_is_not_waited_at_twice():
    scenario = short(sensors=Sensors(imu_rate=0.0, gnss_rate=0.0))
    route = scenario.route
    light = float(route.stops[0])
    always = replace(route, stop_chance=np.ones_like(route.stop_chance))
    loading = (Loading(distance=light + 20.0, duration=15.0, load=50.0),)
    truth = simulate_car(replace(scenario, route=always, loading=loading)).truth
    near = np.abs(truth.distance - light - 10.0) < 40.0
    stood = np.unique(np.round(truth.distance[near & (truth.speed == 0.0)]))
    assert_allclose(stood, light + 20.0, atol=3.0)


def test_car_loading_takes_240_kg_after_twelve_minutes():
    scenario = replace(make_scenario("car-loading", seed=4), duration=900.0)
    truth = simulate_car(replace(scenario, sensors=Sensors(imu_rate=0.0, gnss_rate=0.0))).truth
    loaded = truth.time[np.diff(truth.mass, append=truth.mass[-1]) > 0.1]
    assert 11 * 60 < loaded[0] < 14 * 60
    burnt = np.trapezoid(truth.fuel_flow, truth.time)
    assert_allclose(truth.mass[-1] - truth.mass[0], 240.0 - burnt, atol=0.05)


def test_a_quantity_named_twice_is_asked_twice():
    polling = Polling(fast=("engine_load", "vehicle_speed", "engine_load", "engine_speed"))
    signals = simulate_car(short(polling=polling, sensors=Sensors(imu_rate=0.0))).drive.signals
    assert_allclose(len(signals["engine_load"]), 2 * len(signals["vehicle_speed"]), atol=2)


def test_brake_switch_is_on_while_the_car_is_held():
    polling = Polling(fast=("vehicle_speed", "brake_switch"), slow=())
    made = simulate_car(short(polling=polling, sensors=Sensors(imu_rate=0.0)))
    switch = made.drive.signals["brake_switch"]
    assert np.all(switch.values[switch.time < 3.0] == 1.0)
    assert set(np.unique(switch.values)) == {0.0, 1.0}
    open_road = np.interp(switch.time, made.truth.time, made.truth.pedal) > 0.2
    assert switch.values[open_road].mean() < 0.05


def test_random_cars_drive():
    rng = np.random.default_rng(8)
    for _ in range(3):
        car = random_car(rng)
        assert 900.0 < car.mass < 2100.0
        truth = simulate_car(short(car=car, sensors=Sensors(imu_rate=0.0))).truth
        assert truth.speed.max() > 8.0


@pytest.fixture(scope="module", params=[0.0, 6000.0])
def bus(request):
    return simulate_car(make_scenario("bus", payload=request.param, seed=2))


def test_bus_brakes_when_du_2025_says(bus):
    truth = bus.truth
    assert_allclose(truth.mass[0], 7000.0 + bus.scenario.payload)
    assert_allclose(truth.time[-1], 180.0, atol=0.1)
    braking = (truth.brake_force > 2000.0) & (truth.time > 20.0)
    starts = truth.time[np.flatnonzero(np.diff(braking.astype(int)) == 1)]
    assert_allclose(starts, [115.3, 147.3], atol=0.4)
    cruising = (truth.time > 60.0) & (truth.time < 110.0)
    assert truth.speed[cruising].std() < 1.0
    assert truth.speed[truth.time < 35.0].max() > 15.0


def test_bus_interrupts_its_torque_for_every_shift(bus):
    truth = bus.truth
    changes = np.flatnonzero(np.diff(truth.gear) > 0)
    assert changes.size >= 4
    for k in changes[truth.time[changes] < 40.0]:
        shift = slice(k, k + 20)
        assert np.abs(truth.traction_force[shift]).min() < 0.05 * np.max(truth.traction_force)


def test_bus_sends_100_times_a_second_with_the_resolution_of_j1939(bus):
    signals = bus.drive.signals
    for name, step in (
        ("vehicle_speed", 1 / 256 / 3.6),
        ("engine_speed", 0.125 * np.pi / 30),
        ("engine_torque_fraction", 0.01),
    ):
        assert_allclose(np.median(np.diff(signals[name].time)), 0.01, rtol=0.05)
        counts = signals[name].values / step
        assert_allclose(counts, np.round(counts), atol=1e-6)
    assert_allclose(signals["accel_x"].period, 0.01, rtol=0.01)


def test_bus_tells_the_torque_of_its_flywheel_nearly(bus):
    truth, signals = bus.truth, bus.drive.signals
    told = signals["engine_torque_fraction"]
    reference = float(np.median(signals["reference_torque"].values))
    torque = np.interp(told.time, truth.time, truth.engine_torque)
    driving = np.interp(told.time, truth.time, truth.pedal) > 0.3
    driving &= np.interp(told.time, truth.time, truth.phase) == 0.0
    error = (told.values * reference - torque)[driving]
    # Cold friction and accessories are believed to reach the flywheel.
    assert 0.01 * reference < error.mean() < 0.12 * reference


def test_retarder_brakes_without_the_pedal():
    scenario = replace(
        make_scenario("bus", seed=3),
        brakings=(
            Braking(time=70.0, duration=3.0, decel=0.8),
            Braking(time=95.0, duration=3.0, decel=2.5),
        ),
        duration=110.0,
    )
    made = simulate_car(scenario)
    signals = made.drive.signals
    retarder, switch = signals["retarder_torque"], signals["brake_switch"]
    for start, pressed in ((70.0, False), (95.0, True)):
        during = (retarder.time > start + 1.5) & (retarder.time < start + 2.9)
        assert np.all(retarder.values[during] < -0.2)
        assert np.all(switch.at(retarder.time[during]) == float(pressed))
    cruise = (retarder.time > 60.0) & (retarder.time < 69.0)
    assert np.all(retarder.values[cruise] == 0.0)
    assert np.all(switch.at(retarder.time[cruise]) == 0.0)


def test_passengers_get_on_and_off_the_urban_bus():
    scenario = make_scenario("bus-urban", payload=710.0, seed=6)
    load = np.cumsum([710.0, *(stop.load for stop in scenario.loading)])
    assert load.min() >= 0.0
    assert load.max() <= 80 * 71.0
    assert len(scenario.loading) > 20
    assert any(stop.load < 0.0 for stop in scenario.loading)
    sensors = Sensors(imu_rate=0.0, gnss_rate=0.0)
    truth = simulate_car(replace(scenario, sensors=sensors, duration=600.0)).truth
    changing = np.diff(truth.mass) > 1.0
    assert np.all(truth.speed[:-1][changing] == 0.0)
    assert truth.mass.max() > BUS.mass + 800.0


def quiet(name, duration=None, **changes):
    sensors = Sensors(imu_rate=0.0, gnss_rate=0.0)
    return replace(make_scenario(name, seed=4), sensors=sensors, duration=duration, **changes)


def test_converter_slips_below_its_lock_up_and_stands_idling():
    truth = simulate_car(quiet("diesel", 700.0)).truth
    car = DIESEL_AUTOMATIC
    gearing = np.array(car.gearings)[truth.gear.astype(int) - 1]
    moving = truth.speed > 3.0
    ratio = gearing * truth.speed / truth.engine_speed
    locked = moving & (truth.phase == 0)
    open_converter = (truth.speed > 0.5) & (truth.phase == 2) & (truth.pedal > 0.1)
    assert_allclose(ratio[locked], 1.0, atol=0.05)
    assert locked.sum() > 3000
    assert open_converter.sum() > 100
    # A downshift may leave the turbine faster for an instant.
    assert np.quantile(ratio[open_converter], 0.95) < 1.0
    assert ratio[open_converter].min() < 0.5
    assert ratio[open_converter & moving].min() < 0.95
    assert truth.gear[locked].min() >= car.lock_gear
    standing = truth.speed == 0.0
    assert standing.sum() > 500
    assert_allclose(np.median(truth.engine_speed[standing]), car.idle_speed, rtol=0.01)


def test_converter_multiplies_torque_at_a_launch():
    scenario = quiet("diesel", 60.0, start_rest=4.0, effects=Effects.none())
    truth = simulate_car(replace(scenario, route=flat_route(3000.0))).truth
    start = np.flatnonzero(truth.speed > 0.3)[0]
    first = DIESEL_AUTOMATIC.gearings[0]
    assert truth.gear[start] == 1.0
    assert truth.traction_force[start] > 1.4 * first * truth.engine_torque[start]


def test_powershift_keeps_pulling_and_an_automated_box_does_not():
    least = {}
    for name in ("diesel", "truck"):
        truth = simulate_car(quiet(name, 60.0, start_rest=4.0, route=flat_route(3000.0))).truth
        upshifts = np.flatnonzero((np.diff(truth.gear) > 0) & (truth.pedal[1:] > 0.3))
        assert upshifts.size >= 2
        pulls = [truth.traction_force[k : k + 20].min() / truth.traction_force[k - 1]
                 for k in upshifts[:2]]  # fmt: skip
        least[name] = max(pulls)
    assert least["diesel"] > 0.3
    assert least["truck"] < 0.05


def test_truck_drives_like_a_truck():
    truth = simulate_car(quiet("truck", 2700.0, payload=9000.0)).truth
    assert_allclose(truth.mass[0], 18_000.0)
    assert 85.0 < truth.speed.max() * 3.6 < 97.0
    assert truth.accel.max() < 1.8
    assert truth.engine_speed.max() < TRUCK18.max_speed * 1.03
    assert truth.engine_speed.min() > 0.95 * TRUCK18.idle_speed
    assert set(np.unique(truth.gear)) >= {4.0, 6.0, 8.0, 10.0, 12.0}
    litres = np.trapezoid(truth.fuel_flow, truth.time) / 0.835 / truth.distance[-1] * 1e5
    assert 18.0 < litres < 42.0


def test_full_truck_slows_down_on_a_hill_and_holds_the_power_of_its_engine():
    up = flat_route(5000.0)
    up = replace(up, grade=np.where(np.arange(up.grade.size) > 1000, 0.06, 0.0))
    scenario = quiet("truck", 300.0, start_rest=2.0, payload=9000.0, route=up)
    truth = simulate_car(replace(scenario, effects=Effects.only())).truth
    steady = (truth.distance > 3000.0) & (truth.distance < 4500.0) & (truth.phase == 0)
    power = np.mean((truth.engine_torque * truth.engine_speed)[steady])
    # Weight lifted and rolled, and air at this speed, by an engine of at most 213 kW.
    speed = truth.speed[steady].mean()
    needed = 18_000 * 9.81 * (np.sin(0.06) + 0.0065) * speed + 0.5 * 1.2 * 5.5 * speed**3
    assert 9.0 < speed < 16.0
    assert needed < power < 1.08 * needed
    assert 140e3 < power < 215e3


def test_heavy_vehicles_broadcast_and_others_are_polled():
    assert usual_polling(TRUCK18).net_torque
    assert usual_polling(VAN).fast == ("vehicle_speed", "engine_speed", "engine_load", "throttle")
    assert "engine_torque" in usual_polling(ELECTRIC).fast
    assert "mass_air_flow" in usual_polling(MIDSIZE).fast
    signals = simulate_car(quiet("truck", 60.0)).drive.signals
    assert_allclose(np.median(np.diff(signals["engine_torque_fraction"].time)), 0.05, rtol=0.02)
    assert_allclose(np.median(np.diff(signals["vehicle_speed"].time)), 0.1, rtol=0.02)


def test_load_of_a_diesel_is_of_the_torque_there_is_at_that_speed():
    effects = replace(Effects(), load_nonlinearity=0.0, load_smoothing=0.0, warm_up=0.0)
    truth = simulate_car(quiet("van", 400.0, effects=effects)).truth
    full = np.interp(truth.engine_speed, VAN.curve_speed, VAN.curve_torque)
    pulling = (truth.phase == 0) & (truth.engine_torque > 50.0)
    share = (truth.engine_torque / full)[pulling]
    # Friction and accessories count on both sides.
    assert np.all(truth.load[pulling] > share - 0.01)
    assert_allclose(truth.load[pulling], share, atol=0.25)
    assert np.corrcoef(truth.load[pulling], share)[0, 1] > 0.99


def test_squat_of_a_van_grows_with_its_load():
    lean = []
    for payload in (0.0, 1400.0):
        effects = Effects.only(squat=1.0, traffic=1.0)
        truth = simulate_car(
            quiet("van", 120.0, payload=payload, effects=effects, route=flat_route(2000.0))
        ).truth
        lean.append((truth.accel @ truth.pitch) / (truth.accel @ truth.accel))
    assert_allclose(lean[1] / lean[0], 1.0 + 0.7 * 1400 / 2100, rtol=0.03)


@pytest.mark.parametrize(
    ("kind", "vehicle_class"),
    [
        ("petrol_manual", "car"),
        ("petrol_dct", "car"),
        ("petrol_cvt", "car"),
        ("petrol_hybrid", "car"),
        ("diesel_automatic", "car"),
        ("electric", "car"),
        ("van", "van"),
        ("truck", "truck"),
    ],
)
def test_random_vehicles_of_every_kind_drive(kind, vehicle_class):
    rng = np.random.default_rng(12)
    drawn = [random_vehicle(rng, kind) for _ in range(2)]
    assert drawn[0].mass != drawn[1].mass
    for car in drawn:
        assert car.kind == vehicle_class
        truth = simulate_car(short(car=car, sensors=Sensors(imu_rate=0.0, gnss_rate=0.0))).truth
        assert truth.speed.max() > 6.0
    if kind.startswith("petrol"):
        boxes = {"manual": "manual", "dct": "dual_clutch", "cvt": "stepless", "hybrid": "stepless"}
        wanted = boxes[kind.removeprefix("petrol_")]
        assert {car.transmission for car in drawn} == {wanted}


POWER_SPLIT, STEPLESS = (make_scenario(name).car for name in ("hybrid", "cvt"))


def test_a_power_split_moves_as_without_its_motor_and_loses_no_power():
    whole = short(duration=400.0, polling=usual_polling(POWER_SPLIT), car=POWER_SPLIT)
    made = simulate_car(whole)
    plain = simulate_car(
        replace(whole, car=replace(POWER_SPLIT, split=None), polling=usual_polling(STEPLESS))
    )
    truth, split, drive = made.truth, POWER_SPLIT.split, made.drive
    assert_array_equal(truth.speed, plain.truth.speed)
    assert_array_equal(truth.traction_force, plain.truth.traction_force)
    moving = truth.speed > 3.0
    stands = moving & (truth.engine_speed < 20.0)
    assert 0.05 < np.mean(stands) / np.mean(moving) < 0.95
    assert np.all(truth.engine_torque[stands & (truth.engine_speed == 0.0)] == 0.0)
    # What the wheels get is what engine and battery give, less the losses that were asked for.
    battery = drive.signals["battery_voltage"], drive.signals["battery_current"]
    given = np.nan_to_num(battery[0].at(truth.time) * battery[1].at(truth.time)) - split.auxiliary
    spun = split.engine_inertia * np.gradient(truth.engine_speed, truth.time)
    engine = (truth.engine_torque - spun) * truth.engine_speed
    electric = np.where(given > 0.0, given * split.efficiency, given / split.efficiency)
    braked = (plain.truth.brake_force - truth.brake_force) * np.maximum(truth.speed, 3.0)
    wheels = truth.traction_force * truth.speed / split.mechanical - braked
    steady = uniform_filter1d(wheels, 101)[moving], uniform_filter1d(engine + electric, 101)[moving]
    assert_allclose(*steady, atol=0.03 * np.abs(wheels).max())
    assert np.corrcoef(*steady)[0, 1] > 0.995
    with pytest.raises(ConfigError, match="battery_voltage"):
        simulate_car(short(polling=usual_polling(POWER_SPLIT)))


def test_named_vehicles_lack_what_random_ones_have():
    for name in SCENARIOS:
        made = make_scenario(name, payload=71.0, seed=3)
        assert (made.name, made.payload, made.seed) == (name, 71.0, 3)
        assert made.habits == Habits()
        assert made.car.spin_loss == made.car.load_curve == made.car.overrun_charge == 0.0
    rng, again = np.random.default_rng(3), np.random.default_rng(3)
    for kind in ("petrol_manual", "diesel_automatic", "van", "truck"):
        car = random_vehicle(rng, kind)
        torque = np.array(car.curve_torque)
        peak = int(np.argmax(torque))
        assert 0.2 < car.spin_loss / car.wheel_radius**2 * (100 / 3.6) ** 2 / car.mass < 0.6
        assert car.load_curve == 1.0
        assert car.cut_speed > 1.15 * car.idle_speed
        assert np.all(np.diff(torque[: peak + 1]) > 0.0)
        assert np.all(np.diff(torque[peak:]) < 0.0)
    drawn = [random_habits(rng) for _ in range(2)]
    assert drawn[0] != drawn[1]
    # The details come from a generator of their own.
    first = random_vehicle(again, "petrol_manual")
    same = np.random.default_rng(3)
    plain = random_car(same)
    while plain.transmission != "manual":
        plain = random_car(same)
    assert first.drag_area == plain.drag_area


def test_brake_switch_feels_a_light_foot():
    polling = Polling(fast=("vehicle_speed", "brake_switch"), slow=(), rate=20.0)
    habits = Habits(touch_rate=1.0, touch_strength=0.01, touch_time=2.0)
    quiet = Sensors(imu_rate=0.0, gnss_rate=0.0)
    shares = []
    for effects in (Effects(), Effects().without("light_braking")):
        made = simulate_car(short(polling=polling, sensors=quiet, habits=habits, effects=effects))
        switch = made.drive.signals["brake_switch"]
        moving = np.interp(switch.time, made.truth.time, made.truth.speed) > 3.0
        shares.append(switch.values[moving].mean())
    assert shares[0] > 1.5 * shares[1]


def test_every_scenario_is_described(weighbridge):
    assert set(ABOUT) == set(SCENARIOS)
    told = weighbridge("simulate", "--help").out
    assert set(SCENARIOS) <= set(re.findall(r"[a-z-]+", told))


@pytest.mark.parametrize("name", ["car-short", "truck"])
def test_a_payload_is_checked_against_the_limits_of_its_own_vehicle(name):
    empty = make_scenario(name).car.mass
    assert make_scenario(name, payload=0.6 * empty).mass == pytest.approx(1.6 * empty)
    with error(ConfigError, empty, 2.0 * empty):
        make_scenario(name, payload=2.0 * empty)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: make_scenario("lorry"), "lorry"),
        (lambda: make_scenario("car-short", without=["squad"]), "squad"),
        (lambda: make_scenario("car-short", mass=1600.0, payload=1.0), ""),
        (lambda: make_scenario("car-short", wind_from=270.0), "wind_from 270.0"),
        (lambda: make_scenario("car-short", mass=10.0), "1580.0 -1570.0"),
        (lambda: Effects(squat=-1.0), "squat"),
        (lambda: Effects(squat=float("nan")), "squat"),
        (lambda: Sensors(imu_rate=5.0), "imu_rate"),
        (lambda: Sensors(gnss_rate=99.0), "gnss_rate"),
        (lambda: Polling(rate=0.0), "0.2 100 0.0"),
        (lambda: Polling(speed_rounding="up"), "speed_rounding"),
        (lambda: Polling(fast=()), ""),
        (lambda: Polling(speed_step=0.0), "speed_step 0.0"),
        (lambda: Habits(foot_time=(0.5, 0.2)), "foot_time 0.5 0.2"),
        (lambda: Habits(touch_rate=-1.0), "touch_rate -1.0"),
        (lambda: Braking(time=5.0, duration=0.0, decel=1.0), "5.0 0.0 1.0"),
        (lambda: replace(BUS, launch_gear=9), "launch_gear"),
        (lambda: random_vehicle(np.random.default_rng(1), "tank"), "tank truck"),
        (lambda: replace(BUS, transmission="automatic"), "converter_capacity"),
        (lambda: replace(MIDSIZE, gear_ratios=(1.0, 2.0)), "gear_ratios"),
        (lambda: replace(MIDSIZE, mass=-1.0), "mass"),
        (lambda: replace(MIDSIZE, curve_torque=(1.0,)), "curve_speed"),
        (lambda: flat_route(10.0), "50 11.0"),
        (lambda: mixed_route(out=[("city", 500)], back=[("city", 900)]), "500 900"),
        (lambda: short(duration=1.0), "10 1.0"),
        (lambda: Loading(distance=300.0, duration=1.0, load=10.0), "5 7200 1.0"),
        (lambda: Loading(distance=300.0, duration=60.0, load=float("nan")), "300.0 nan"),
        (lambda: short(loading=(Loading(distance=9e4, duration=9.0, load=1.0),)), "8199 90000"),
        (
            lambda: short(
                loading=tuple(Loading(distance=d, duration=9.0, load=1.0) for d in (900.0, 500.0))
            ),
            "8199 900 500",
        ),
        (
            lambda: short(loading=(Loading(distance=900.0, duration=9.0, load=4e3),)),
            "1580.0 4000.0",
        ),
        (lambda: simulate_car(short(polling=Polling(fast=("altitude",)))), "altitude"),
    ],
)
def test_impossible_scenarios_are_refused(call, words):
    with error(ConfigError, words):
        call()


def test_unknown_format_is_refused(made, tmp_path):
    with pytest.raises(ConfigError, match="format must be"):
        made.write(tmp_path, format="xls")


@pytest.mark.parametrize("seed", [1234, 1999])
def test_any_seed_makes_a_route(seed):
    route = jensen_route(seed)
    assert np.isfinite(route.heading).all()
    assert route.heading.size == jensen_route(1).heading.size
