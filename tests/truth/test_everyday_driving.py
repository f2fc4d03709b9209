"""Foot, losses, fuelling and company on the road against their closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numba import config
from numpy.testing import assert_allclose

from weighbridge.kernels.simulated_driver import (
    ACCELERATOR,
    CHANCES,
    ON_BRAKE,
    Foot,
    move_foot,
)
from weighbridge.simulation import (
    MIDSIZE,
    VAN,
    Braking,
    Effects,
    Habits,
    Scenario,
    flat_route,
    jensen_route,
    random_habits,
    random_vehicle,
    usual_polling,
)
from weighbridge.simulation.longitudinal import SPIN_COLD, _driver, simulate_trajectory
from weighbridge.simulation.sensing import engine_load

GRAVITY = 9.81
DENSITY = 101_325.0 / (287.05 * 293.15)

RECORDED = {(-4.0, -2.0): 0.33, (-2.0, -1.0): 0.17, (-1.0, 0.0): 0.08, (0.0, 1.0): 0.06}
"""Share of the rows with the brake on, by the force needed in percent of the weight: a recorded
car with a brake switch, 20 115 s at 1 Hz, ten drivers."""

RECORDED_ABOVE_FLOOR = {4.0: 0.27, 10.0: 0.78}
"""Share of the braked rows whose load is within so many points of its floor."""

RECORDED_BOTH = 31 / 2000
"""Share of the braked rows with the accelerator pressed."""


def drive(scenario):
    random = scenario.streams()
    return simulate_trajectory(scenario, random["plan"], random["drive"], random["habits"])


def flat(effects, *, car=MIDSIZE, length=4000.0, limit=25.0, duration=180.0, **changes):
    return Scenario(
        name="flat",
        car=car,
        route=flat_route(length, limit=limit),
        seed=3,
        effects=effects,
        ambient_temperature=293.15,
        start_rest=2.0,
        duration=duration,
        **{"wind_speed": 0.0, **changes},
    )


def gearing_of(car, made):
    return np.array(car.gearings)[made.gear.astype(int) - 1]


@pytest.mark.parametrize("warm_up", [0.0, 1.0])
def test_spin_loss_grows_with_speed_and_falls_with_warmth(warm_up):
    car = replace(MIDSIZE, spin_loss=0.1, warm_up_time=120.0)
    effects = Effects.only(spin_loss=1.0, warm_up=warm_up, traffic=1.0)
    made = drive(flat(effects, car=car))
    moving = (made.phase == 0) & (made.speed > 3.0)
    gearing = gearing_of(car, made)
    given = gearing * made.engine_torque - gearing**2 * car.engine_inertia * made.accel
    cold = SPIN_COLD * warm_up * np.exp(-made.time / 120.0)
    expected = 0.1 / car.wheel_radius**2 * made.speed * (1.0 + cold)
    # Cold oil also raises the constant loss, which is switched off here.
    assert moving.sum() > 20_000
    assert expected[moving].max() > 20.0
    assert_allclose((given - made.traction_force)[moving], expected[moving], atol=1e-6)


def test_side_wind_raises_the_drag_with_the_squared_sine_of_its_angle():
    effects = Effects.only(yaw_drag=1.0)
    made = drive(flat(effects, wind_speed=12.0, wind_from=0.5 * math.pi))
    fast = made.speed > 8.0
    across = 12.0 * math.log(1.0 / 0.1) / math.log(10.0 / 0.1)
    flow = np.hypot(made.speed, across)
    area = 0.27 * 2.2 * (1.0 + MIDSIZE.yaw_drag * (across / flow) ** 2)
    expected = 0.5 * DENSITY * area * flow * made.speed
    assert_allclose(made.drag_force[fast], expected[fast], rtol=1e-6)
    alone = 0.5 * DENSITY * 0.27 * 2.2 * made.speed**2
    assert (made.drag_force / np.maximum(alone, 1.0))[fast].max() > 1.3


def test_another_vehicle_ahead_shelters_from_the_air():
    habits = Habits(following=0.5, shelter=(0.2, 0.2))
    effects = Effects.only(drafting=1.0, traffic=1.0)
    scenario = flat(effects, length=60_000.0, limit=30.0, duration=1800.0, habits=habits)
    made = drive(scenario)
    rows = made.speed > 10.0
    part = made.drag_force[rows] / (0.5 * DENSITY * 0.27 * 2.2 * made.speed[rows] ** 2)
    assert_allclose([part.min(), part.max()], [0.8, 1.0], rtol=1e-6)
    # Half of the way, of which there are some ten stretches; little lies between.
    assert 0.25 < np.mean(part < 0.801) < 0.75
    assert np.mean((part > 0.801) & (part < 0.999)) < 0.1
    alone = drive(replace(scenario, effects=replace(effects, traffic=0.0)))
    rows = alone.speed > 10.0
    assert_allclose(
        alone.drag_force[rows], 0.5 * DENSITY * 0.27 * 2.2 * alone.speed[rows] ** 2, rtol=1e-6
    )


@pytest.mark.parametrize("car", [MIDSIZE, VAN])
def test_load_is_full_at_full_torque_of_every_engine_speed(car):
    """The reading is 1 where nothing more can be had, friction and accessories inside."""
    speed = np.linspace(car.curve_speed[0], car.curve_speed[-1], 16)
    # Peaked: an arch over the whole range.
    x = (speed - speed.mean()) / (speed[-1] - speed.mean())
    arch = tuple(float(t) for t in max(car.curve_torque) * (1.0 - 0.4 * x**2))
    car = replace(car, curve_speed=tuple(map(float, speed)), curve_torque=arch, load_full=0.8,
                  load_curve=1.0, compressor_power=0.0)  # fmt: skip

    def readings(effects):
        scenario = flat(effects, car=car, limit=45.0, aggressiveness=3.0, payload=1500.0)
        made = drive(scenario)
        c = car.drag_torque
        w = np.maximum(made.engine_speed, 0.8 * car.idle_speed)
        friction = c[0] + c[1] * w + c[2] * w**2
        gross = np.interp(w, car.curve_speed, car.curve_torque) + friction
        share = (made.engine_torque + friction) / gross
        rows = (made.phase == 0) & (made.fuel_flow > 0.0) & (made.speed > 3.0)
        return engine_load(scenario, made)[rows] / 0.8, share[rows]

    effects = Effects.only(load_curve=1.0, traffic=1.0)
    load, share = readings(effects)
    assert share.max() > 0.999
    assert np.ptp(share) > 0.5
    # Friction is that of the step before.
    assert_allclose(load, np.maximum(share, 0.03), atol=2e-3)
    if car.engine == "petrol":
        load, share = readings(replace(effects, load_curve=0.0))
        assert load[share > 0.999].min() < 0.9
    load, share = readings(replace(effects, accessories=1.0))
    # Full torque and the usual alternator are a full load, a loaded one more.
    assert_allclose(load[share > 0.999].mean(), 1.0, atol=0.02)


def test_fuel_burns_in_overrun_until_it_is_cut():
    charge, delay = 0.8, 2.0
    car = replace(
        MIDSIZE,
        overrun_charge=charge,
        cut_delay=delay,
        cut_speed=1.3 * MIDSIZE.idle_speed,
        least_charge=0.15,
        load_full=1.0,
    )
    effects = Effects.only(overrun_fuel=1.0)
    braking = Braking(time=60.0, duration=5.0, decel=1.0)
    scenario = flat(effects, car=car, duration=68.0, brakings=(braking,))
    made = drive(scenario)
    load = engine_load(scenario, made)
    dragged = (made.time > 61.5) & (made.time < 65.0)
    w = made.engine_speed
    c = car.drag_torque
    friction = c[0] + c[1] * w + c[2] * w**2
    before = dragged & (made.time < 60.0 + delay)
    after = dragged & (made.time > 60.0 + delay + 2.0)
    assert np.all(made.phase[dragged] == 0)
    assert w[dragged].min() > 1.5 * car.idle_speed
    # The charge of idling is shared by more cycles.
    kept = 1.0 - charge * car.idle_speed / w
    assert_allclose(made.engine_torque[before], -(friction * kept)[before], rtol=0.06)
    assert_allclose(made.engine_torque[after], -friction[after], rtol=0.02)
    assert np.all(made.fuel_flow[before] > 0.0)
    assert np.all(made.fuel_flow[after] == 0.0)
    assert_allclose(load[before], 0.15, atol=1e-3)
    assert_allclose(load[after], 0.03, atol=1e-3)
    plain = drive(replace(scenario, effects=Effects.none()))
    rows = (plain.time > 61.5) & (plain.time < 65.0)
    assert np.all(plain.fuel_flow[rows] == 0.0)


def gaps(made):
    """Seconds with neither pedal before each braking, and after it until the accelerator."""
    brake, accelerator = made.brake_pedal > 0.0, made.pedal > 0.0
    moving = made.speed > 2.0
    before, after = [], []
    pressed = np.flatnonzero(np.diff(brake.astype(int)) == 1) + 1
    released = np.flatnonzero(np.diff(brake.astype(int)) == -1) + 1
    for k in pressed[moving[pressed]]:
        last = np.flatnonzero(accelerator[:k])
        before.append(made.time[k] - made.time[last[-1]])
    for k in released[moving[released]]:
        following = np.flatnonzero(accelerator[k:])
        if following.size:
            after.append(following[0] * 0.005)
    return np.array(before), np.array(after)


def test_the_foot_takes_its_time_between_the_pedals():
    habits = Habits(foot_time=(0.4, 0.4))
    brakings = tuple(Braking(time=t, duration=4.0, decel=1.5) for t in (40.0, 60.0, 80.0, 100.0))
    effects = Effects.only(foot_switch=1.0)
    scenario = flat(effects, habits=habits, brakings=brakings, limit=20.0)
    before, after = gaps(drive(scenario))
    assert before.size >= 4
    assert after.size >= 4
    # A step of 5 ms either way; a lifted foot may wait before it brakes.
    assert_allclose(before.min(), 0.4, atol=0.011)
    # Then the engine has to come out of its drag.
    assert 0.389 < after.min() < 0.46
    made = drive(scenario)
    moving = (made.pedal == 0.0) & (made.brake_pedal == 0.0) & (made.speed > 5.0)
    assert moving.sum() > 4 * 2 * 70
    assert np.median(made.brake_force[moving]) < 50.0
    before, after = gaps(drive(replace(scenario, effects=Effects.none())))
    assert before.min() < 0.011
    assert after.min() < 0.2


def test_touches_have_rate_length_and_strength_of_the_driver():
    """A foot that is off the accelerator and does not need the brake: on and off are drawn."""
    rate, strength, time, step = 0.2, 0.15, 3.0, 0.05
    habits = Habits(touch_rate=rate, touch_strength=strength, touch_time=time)
    driver = _driver(flat(Effects.only(light_braking=1.0), habits=habits))
    rows = np.random.default_rng(5).random((60_000, CHANCES))
    foot = Foot(ACCELERATOR, 0.0, 0.3, 0.0, 0.0, 0.0)
    pressed, touches = np.zeros(rows.shape[0], dtype=bool), []
    for k, row in enumerate(rows):
        before = foot
        foot = move_foot(driver, foot, row, step, False, 0.0, -0.2, True, False, 10.0, step)
        pressed[k] = foot.place == ON_BRAKE
        if pressed[k] and before.place == ACCELERATOR:
            touches.append(foot.touch)
    starts = np.count_nonzero(np.diff(pressed.astype(int)) == 1)
    # Counting has an error of one over the square root; a touch ends with the next step.
    assert starts > 300
    assert_allclose(starts / (np.count_nonzero(~pressed) * step), rate, rtol=0.15)
    assert_allclose(np.count_nonzero(pressed) * step / starts, time, rtol=0.15)
    assert_allclose([np.mean(touches), np.std(touches)], strength, rtol=0.15)
    # Where the driver plainly wants to accelerate, the brake is left alone.
    for row in rows[:2000]:
        foot = move_foot(driver, foot, row, step, False, 0.8, -0.2, False, False, 10.0, step)
    assert foot.place == ACCELERATOR
    quiet = _driver(flat(Effects.none(), habits=habits))
    for row in rows[:2000]:
        foot = move_foot(quiet, foot, row, step, False, 0.0, -0.2, True, False, 10.0, step)
        assert foot.place == ACCELERATOR


def test_a_touch_slows_the_vehicle_by_its_strength():
    # One driver, one strength: touches of half a minute whenever the foot is lifted.
    habits = Habits(touch_rate=5.0, touch_strength=0.3, touch_time=60.0, foot_time=(0.3, 0.3))
    scenario = flat(Effects.only(light_braking=1.0), limit=20.0, duration=120.0, habits=habits)
    made = drive(scenario)
    inertia = scenario.mass + MIDSIZE.wheel_inertia / MIDSIZE.wheel_radius**2
    held = (made.brake_pedal > 0.0) & (made.speed > 5.0) & (made.time > 10.0)
    steady = held & (np.abs(np.gradient(made.brake_force)) < 0.1) & (made.brake_force > 20.0)
    steady &= made.phase == 0
    gearing = gearing_of(MIDSIZE, made)
    moved = inertia + MIDSIZE.engine_inertia * gearing**2
    dragged = gearing * made.engine_torque - made.drag_force - made.rolling_force
    assert steady.sum() > 200
    expected = dragged - made.brake_force
    assert_allclose((moved * made.accel)[steady], expected[steady], atol=1e-3)
    assert np.all(made.engine_torque[steady] < 0.0)
    assert np.quantile(made.brake_force[steady], 0.9) / inertia > 0.1


def braked_rows(scenario):
    """Read a drive at 1 Hz as a logger would: force needed over the weight [%], whether braked,
    load above its floor at that engine speed [points], both pedals pressed.
    """
    made = drive(scenario)
    k = np.arange(200, made.time.size - 200, 200)
    kmh = np.round(made.speed * 3.6)
    accel = (kmh[k + 200] - kmh[k - 200]) / 3.6 / 2.0
    grid = np.arange(scenario.route.grade.size)
    grade = np.interp(made.distance[k], grid, scenario.route.grade)
    weight = made.mass[k] * GRAVITY
    resisting = made.drag_force[k] + made.rolling_force[k]
    needed = 100.0 * (accel / GRAVITY + np.sin(grade) + resisting / weight)
    load = 100.0 * engine_load(scenario, made)[k]
    moving = made.speed[k] > 1.0
    bins = (made.engine_speed[k] * 30.0 / math.pi // 250).astype(int)
    floor = np.zeros(k.size)
    for b in np.unique(bins[moving]):
        floor[bins == b] = np.quantile(load[(bins == b) & moving], 0.02)
    braked = made.brake_pedal[k] > 0.0
    both = braked & (made.pedal[k] > 0.01)
    return np.stack((needed, braked, load - floor, both))[:, moving]


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="hours of driving need the compiler")
def test_random_drivers_brake_as_often_as_recorded_ones():
    def shares(*without, drivers=2):
        rows = []
        for number in range(drivers):
            rng = np.random.default_rng([77, number])
            car = random_vehicle(rng, ("petrol_manual", "petrol_dct")[number % 2])
            scenario = Scenario(
                name="ordinary",
                car=car,
                route=jensen_route(int(rng.integers(1000, 2000))),
                payload=0.15 * car.mass,
                seed=number,
                habits=random_habits(np.random.default_rng([number, 41])),
                polling=usual_polling(car),
                effects=Effects().without(*without),
                duration=2400.0,
            )
            rows.append(braked_rows(scenario))
        needed, braked, above, both = np.concatenate(rows, axis=1)
        on = braked > 0.0
        return (
            on.mean(),
            [on[(needed >= low) & (needed < high)].mean() for low, high in RECORDED],
            [np.mean(above[on] <= points) for points in RECORDED_ABOVE_FLOOR],
            both.sum() / on.sum(),
        )

    total, found, floor, both = shares(drivers=4)
    assert_allclose(total, 0.17, rtol=0.3)
    ratio = np.array(found) / list(RECORDED.values())
    assert 0.55 < ratio.min() < ratio.max() < 1.8
    assert 0.5 < both / RECORDED_BOTH < 2.0
    ratio = np.array(floor) / list(RECORDED_ABOVE_FLOOR.values())
    assert 0.5 < ratio.min() < ratio.max() < 2.0
    _, found, _, both = shares("light_braking")
    assert found[1] < 0.5 * RECORDED[-2.0, -1.0]
    assert found[2] < 0.3 * RECORDED[-1.0, 0.0]
    assert found[3] < 0.3 * RECORDED[0.0, 1.0]
    assert both < 0.3 * RECORDED_BOTH
    _, _, floor, _ = shares("overrun_fuel")
    assert floor[0] > 2.5 * RECORDED_ABOVE_FLOOR[4.0]
