"""The second model keeps the laws of physics and drives as people do."""

import sys
from functools import lru_cache
from pathlib import Path

import numba
import numpy as np
import polars as pl
import pytest
from numpy.testing import assert_allclose

from weighbridge import read_drive

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "studies"))

from second_model import VARIANTS, Logger, make_drive, random_variant, random_vehicle, simulate
from second_model.gearboxes import hybridised
from second_model.motion import RATE, G
from second_model.sensing import AT, imu
from second_model.vehicle import KINDS as EVERY_KIND

pytestmark = pytest.mark.skipif(
    numba.config.DISABLE_JIT, reason="half a million steps need compiled code"
)

KINDS = ("petrol", "diesel", "semi", "electric_car")


# Tests of a kind follow each other, so that one drive is held at a time.
@lru_cache(maxsize=1)
def driven(kind, style="ordinary"):
    # The lock-up of this automatic gearbox once chattered, and lost a third of the power.
    vehicle = random_vehicle(kind, 106 if kind == "petrol_automatic" else 3)
    mass = 0.5 * (vehicle.tare + vehicle.gross)
    return vehicle, simulate(vehicle, mass=mass, seed=5, duration=900.0, style=style, warm=1.0)


def columns(motion, *names):
    return [motion.out[:, AT[name]] for name in names]


def share_that_moves(vehicle, mass):
    return vehicle.body.coupled_share * np.maximum(0.0, mass[0] - vehicle.body.reference_mass)


@pytest.mark.parametrize("kind", KINDS, scope="module")
def test_energy_closes(kind):
    vehicle, motion = driven(kind)
    speed, height, mass = columns(motion, "speed", "altitude", "mass")
    names = ("traction_force", "coupled_force", "brake_force", "drag_force", "rolling_force")
    forces = columns(motion, *names)
    traction, coupled, *losses = (np.trapezoid(f * speed) / RATE for f in forces)
    rigid = mass - share_that_moves(vehicle, mass)
    kinetic = 0.5 * (rigid[-1] + vehicle.body.wheel_mass) * speed[-1] ** 2
    potential = np.sum(0.5 * (rigid[1:] + rigid[:-1]) * G * np.diff(height))
    spent = np.trapezoid(np.abs(forces[0]) * speed) / RATE
    assert abs(traction + coupled - sum(losses) - kinetic - potential) < 1e-3 * spent


@pytest.mark.parametrize("kind", KINDS, scope="module")
def test_a_perfect_accelerometer_reads_acceleration_and_gravity(kind):
    vehicle, motion = driven(kind)
    table = imu(motion.out, vehicle, Logger(imu_quality=0.0), np.random.default_rng(1))
    speed, height, distance, pitch, roll = columns(
        motion, "speed", "altitude", "distance", "pitch", "roll"
    )
    left, up = table["accel_y_mps2"], table["accel_z_mps2"]
    upright = left * np.sin(roll) + up * np.cos(roll)
    along = table["accel_x_mps2"] * np.cos(pitch) - upright * np.sin(pitch)
    # Gravity from the height gained per distance, not from the grade the model used.
    climb = np.diff(height, prepend=0.0) / np.maximum(np.diff(distance, prepend=30.0), 1e-9)
    moving = speed > 0.5
    accel = np.diff(speed, prepend=0.0) * RATE
    assert_allclose((along - accel - G * climb)[moving], 0.0, atol=0.02)


@pytest.mark.parametrize("kind", KINDS, scope="module")
def test_a_perfect_gyroscope_turns_the_vertical_as_a_rigid_body_does(kind):
    vehicle, motion = driven(kind)
    table = imu(motion.out, vehicle, Logger(imu_quality=0.0), np.random.default_rng(1))
    rate = np.column_stack([table[f"gyro_{axis}_radps"] for axis in "xyz"])
    grade, pitch, roll, yaw_rate = columns(motion, "grade", "pitch", "roll", "yaw_rate")
    tilt = grade + pitch
    # Forward, left, up: what an accelerometer at rest reads, over gravity.
    vertical = np.column_stack(
        [np.sin(tilt), np.sin(roll) * np.cos(tilt), np.cos(roll) * np.cos(tilt)]
    )
    turned = np.cumsum(np.cross(vertical, rate), axis=0) / RATE
    assert_allclose(turned - turned[0], vertical - vertical[0], atol=0.003)
    # Without turns on grades the vertical would be lost.
    assert np.abs(np.cumsum(yaw_rate * np.sin(tilt)) / RATE).max() > 0.008
    rolled = np.gradient(roll) * RATE * np.sin(tilt)
    assert_allclose(np.sum(rate * vertical, axis=1), yaw_rate + rolled, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS, scope="module")
def test_engine_and_wheels_turn_by_the_gear(kind):
    vehicle, motion = driven(kind)
    speed, gear, engine, slipping = columns(motion, "speed", "gear", "engine_speed", "clutch_open")
    rows = (gear > 0) & (slipping == 0.0) & (speed > 5.0)
    ratio = engine[rows] / speed[rows] * vehicle.body.radius
    off = ratio / vehicle.box.ratios[gear[rows].astype(int) - 1]
    assert np.median(off) == pytest.approx(1.0, abs=0.02)
    assert np.quantile(np.abs(off - 1.0), 0.95) < 0.06
    assert engine.max() < 1.1 * vehicle.engine.limit


def seconds(motion, *names):
    """Rows by name, cut into seconds, of which those are kept that are driven in one gear."""
    rows = round(RATE)
    wanted = {name: motion.out[:, AT[name]] for name in ("gear", "speed", "clutch_open", *names)}
    for name in ("engine_speed", "input_speed"):
        wanted[name] = motion.out[:, AT[name]]
        wanted["gain_of_" + name] = np.diff(wanted[name], prepend=wanted[name][0]) * RATE
    blocks = {name: x[: x.size // rows * rows].reshape(-1, rows) for name, x in wanted.items()}
    gear = blocks["gear"]
    keep = (gear.min(axis=1) == gear.max(axis=1)) & (gear.min(axis=1) > 0)
    keep &= blocks["speed"].min(axis=1) > 3.0
    return {name: block[keep] for name, block in blocks.items()}


@pytest.mark.parametrize("kind", EVERY_KIND, scope="module")
def test_torque_of_the_engine_arrives_at_the_wheels(kind):
    vehicle, motion = driven(kind)
    side = ("clutch_torque", "pump_torque", "turbine_torque", "gearbox_loss")
    x = seconds(motion, "engine_torque", "traction_force", "slip", *side)
    full = vehicle.engine.full.max()
    idle = x["engine_speed"].min(axis=1) < 0.6 * vehicle.engine.idle
    # Before clutch and converter: what turns the engine faster does not go through them.
    left = x["engine_torque"] - x["clutch_torque"] - x["pump_torque"]
    left = np.mean(left - vehicle.engine.inertia * x["gain_of_engine_speed"], axis=1)[~idle]
    assert np.quantile(np.abs(left), 0.98) < 0.01 * full
    assert abs(np.mean(left)) < 0.001 * full
    # Behind them: what is not lost reaches the shafts. These may store some of it for a while.
    given = x["clutch_torque"] + x["turbine_torque"] - x["gearbox_loss"]
    given = given - vehicle.box.inertia * x["gain_of_input_speed"]
    power = x["traction_force"] * x["speed"]
    left = np.mean(given * x["input_speed"] - power * (1.0 + x["slip"]), axis=1)
    most = np.quantile(power, 0.99)
    assert np.quantile(np.abs(left), 0.98) < 0.01 * most
    assert abs(np.mean(left)) < 0.001 * most
    # Neither adds power, and the converter multiplies torque as far as it can.
    faster = x["engine_speed"] - x["input_speed"]
    assert np.mean(x["clutch_torque"] * faster, axis=1).min() > -1e-3 * most
    pump, turbine = x["pump_torque"], x["turbine_torque"]
    assert np.all(turbine * x["input_speed"] <= pump * x["engine_speed"] + 1e-3 * most)
    assert np.all(np.abs(turbine) <= vehicle.box.converter_ratio * np.abs(pump) + 1e-9)
    assert np.all(np.abs(turbine) >= np.abs(pump) - 1e-9)
    assert (np.abs(pump).max() > 0.1 * full) == (
        kind in ("diesel", "petrol_automatic", "petrol_cvt")
    )


@pytest.mark.parametrize("kind", EVERY_KIND, scope="module")
def test_high_gears_lose_little_power(kind):
    vehicle, motion = driven(kind)
    x = seconds(motion, "engine_torque", "traction_force")
    inertia = vehicle.engine.inertia + vehicle.box.inertia
    torque = x["engine_torque"] - inertia * x["gain_of_engine_speed"]
    given = np.mean(torque * x["engine_speed"], axis=1)
    taken = np.mean(x["traction_force"] * x["speed"], axis=1)
    variator = kind == "petrol_cvt"
    gear = np.full(given.size, vehicle.box.ratios.size) if variator else x["gear"][:, 0]
    loaded = np.mean(x["engine_torque"], axis=1) > 0.3 * np.quantile(x["engine_torque"], 0.99)
    loaded &= x["clutch_open"].max(axis=1) == 0.0
    high = 0
    for k in range(1, vehicle.box.ratios.size + 1):
        rows = loaded & (gear == k)
        lower = k > 1 and 2 * k <= vehicle.box.ratios.size
        if lower or np.count_nonzero(rows) < 15:
            continue
        low, middle, top = np.quantile(taken[rows] / given[rows], [0.1, 0.5, 0.9])
        assert (0.75 if variator else 0.85) < middle < 0.97
        assert low > (0.65 if variator else 0.80)
        assert top < 1.0
        high += 1
    assert high > 0


@pytest.mark.parametrize("variant", ["power_split", "parallel_hybrid", "mild_hybrid"])
def test_engine_and_battery_of_a_hybrid_give_what_moves_it(variant):
    vehicle = random_variant(variant, 7)
    m = simulate(vehicle, mass=vehicle.tare + 200.0, seed=5, duration=900.0)
    out, battery = hybridised(m.out, vehicle, np.random.default_rng(1))
    h, at = vehicle.hybrid, {name: out[:, k] for name, k in AT.items()}
    before = {name: m.out[:, k] for name, k in AT.items()}
    if variant == "power_split":
        power = before["traction_force"] * before["speed"] / h.mechanical
        inertia = vehicle.engine.inertia * np.gradient(at["engine_speed"]) * RATE
        by_engine = (at["engine_torque"] - inertia) * at["engine_speed"]
    else:
        power = before["engine_torque"] * before["engine_speed"]
        by_engine = at["engine_torque"] * at["engine_speed"]
    saved = (before["brake_force"] - at["brake_force"]) * before["speed"]
    electric = battery - at["accessory_power"] + h.efficiency * saved
    electric = np.where(electric > 0.0, electric * h.efficiency, electric / h.efficiency)
    whole = np.convolve(by_engine + electric - power, np.full(500, 1.0 / 500.0), "valid")
    assert np.quantile(np.abs(whole), 0.95) < 0.03 * np.quantile(np.abs(power), 0.99)
    assert np.all(at["speed"] == before["speed"])
    # Neither is idle all along.
    assert np.quantile(np.abs(electric), 0.9) > 1500.0
    assert np.quantile(by_engine, 0.95) > 5000.0
    assert np.mean(at["engine_speed"][at["speed"] > 1.0] < 20.0) < 0.7


def test_a_worn_clutch_slips_where_it_pulls():
    worn, new = random_variant("slipping_clutch", 4603), random_vehicle("petrol", 4603)
    assert worn.box.capacity < new.engine.full.max()
    share = []
    for vehicle in (worn, new):
        out = simulate(vehicle, mass=vehicle.tare + 200.0, seed=5, duration=900.0).out
        pulls = (out[:, AT["pedal"]] > 0.7) & (out[:, AT["speed"]] > 8.0)
        share.append(np.mean(out[pulls, AT["clutch_open"]]))
    assert share[0] > share[1] + 0.1


def test_two_speeds_shift_and_hub_motors_turn_as_the_wheels():
    assert set(VARIANTS) >= {"two_speed_electric", "hub_motors"}
    out = simulate(random_variant("two_speed_electric", 7), mass=1900.0, seed=5).out
    assert set(np.unique(out[:, AT["gear"]])) >= {1.0, 2.0}
    hub = random_variant("hub_motors", 7)
    out = simulate(hub, mass=1900.0, seed=5).out
    fast = out[:, AT["speed"]] > 10.0
    ratio = out[fast, AT["engine_speed"]] / out[fast, AT["speed"]]
    assert np.median(ratio) == pytest.approx(1.0 / hub.body.radius, rel=0.03)


def test_city_traffic_looks_like_city_traffic():
    vehicle, motion = driven("petrol", "city")
    speed, accel, brake, gear, torque, mass = columns(
        motion, "speed", "accel", "brake_force", "gear", "engine_torque", "mass"
    )
    moving = speed > 0.3
    assert 15.0 < 3.6 * speed.mean() < 35.0
    assert 0.05 < np.mean(~moving) < 0.45
    assert 0.05 < np.mean(brake[moving] > 0.03 * mass[moving]) < 0.3
    low, high = np.quantile(accel[moving], [0.01, 0.99])
    assert -3.5 < low < -1.0
    assert 1.0 < high < 3.5
    assert np.abs(accel).max() < 8.0
    assert torque.max() < 1.02 * vehicle.engine.full.max()
    shifts = np.count_nonzero(np.diff(gear[gear > 0]))
    assert 2.0 < shifts / 15.0 < 12.0
    assert np.all(np.diff(mass) <= 0.0)
    assert 0.1 < mass[0] - mass[-1] < 2.0


def test_a_folder_reads_back(tmp_path):
    vehicle = random_vehicle("truck", 1)
    logger = Logger(brake_switch=True, gnss_speed=True)
    truth = make_drive(
        tmp_path, vehicle, mass=9000.0, seed=3, duration=120.0, logger=logger, warm=1.0
    )
    drive = read_drive(tmp_path)
    assert drive.problems == ()
    assert drive.info.mass == 9000.0
    wanted = {"vehicle_speed", "engine_speed", "engine_torque_fraction", "reference_torque"}
    wanted |= {"brake_switch", "accel_x", "gyro_z", "latitude", "gnss_speed"}
    assert wanted <= drive.signals.keys()
    speed = drive.signals["vehicle_speed"]
    true = np.interp(speed.time, truth["time_s"], truth["speed_mps"])
    assert np.std(speed.values - true) < 0.6
    assert pl.read_parquet(tmp_path / "truth.parquet").equals(truth)


def test_the_same_seed_gives_the_same_drive():
    vehicle = random_vehicle("small_petrol", 2)
    one, two, other = (
        simulate(vehicle, mass=1200.0, seed=seed, duration=60.0).out for seed in (4, 4, 5)
    )
    np.testing.assert_array_equal(one, two)
    assert not np.array_equal(one, other)


def test_bad_orders_are_refused():
    with pytest.raises(ValueError, match="kind"):
        random_vehicle("boat", 1)
    vehicle = random_vehicle("petrol", 1)
    with pytest.raises(ValueError, match="style"):
        simulate(vehicle, mass=1500.0, seed=1, style="wild")
    with pytest.raises(ValueError, match="mass"):
        simulate(vehicle, mass=100.0, seed=1)
