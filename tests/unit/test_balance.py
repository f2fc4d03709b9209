"""Forces against motion on a small made-up drive, by hand."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import refused

from weighbridge import Drive, DriveInfo, Signal, Vehicle
from weighbridge.balance import Reason, force_balance
from weighbridge.balance.law import drag_force, rotating_mass
from weighbridge.estimators import ESTIMATORS
from weighbridge.navigation import Motion
from weighbridge.vehicle import Driveline, RoadLoad, Timing, TorqueModel

END = 400.0
CLOCK = np.arange(0.0, END, 0.1)
STAMPS = np.arange(1.0, END - 2.0, 0.25)
GEARINGS = (20.0, 10.0)
MASS = 1500.0
CAR = Vehicle(
    driveline=Driveline(
        gearings=GEARINGS, engine_inertia=0.2, wheel_inertia=4.0, wheel_radius=0.3, efficiency=0.9
    ),
    road_load=RoadLoad(drag_area=0.6, rolling_coefficient=0.01),
    timing=Timing(torque_delay=0.0),
)


def speed_at(time):
    return 15.0 + 3.0 * np.sin(0.2 * time)


def accel_at(time):
    return 0.6 * np.cos(0.2 * time)


def motion(**changes):
    n = CLOCK.size
    nothing = np.full(n, np.nan)
    made = Motion(
        source="inertial",
        time=CLOCK,
        speed=speed_at(CLOCK),
        accel=accel_at(CLOCK),
        specific_force=0.7 + accel_at(CLOCK),
        grade=np.zeros(n),
        pitch=np.zeros(n),
        roll=np.zeros(n),
        heading=nothing,
        distance=np.cumsum(speed_at(CLOCK)) * 0.1,
        altitude=np.zeros(n),
        valid=np.ones(n, dtype=bool),
        specific_force_std=0.05,
        grade_std=np.full(n, 0.01),
    )
    return replace(made, **changes)


def signal(name, values, time=STAMPS):
    return Signal(name, time, np.broadcast_to(np.asarray(values, dtype=float), time.shape).copy())


def drive(*more, torque=50.0, engine_speed=None, info=None):
    """Drive in second gear unless the engine speed says otherwise."""
    turning = 10.0 * speed_at(STAMPS) if engine_speed is None else engine_speed
    signals = (signal("engine_torque", torque), signal("engine_speed", turning), *more)
    return Drive("d", {s.name: s for s in signals}, info or DriveInfo())


def between(a, b):
    return (a <= STAMPS) & (b >= STAMPS)


def reasons(*args, vehicle=CAR, **changes):
    return force_balance(drive(*args), vehicle, motion(**changes)).table.reason


def test_every_row_of_a_plain_drive_may_be_used():
    assert_array_equal(reasons(), Reason.USED)


def test_standing_and_no_motion():
    slow = np.where((CLOCK > 100.0) & (CLOCK < 120.0), 0.5, speed_at(CLOCK))
    assert_array_equal(reasons(speed=slow)[between(101, 119)], Reason.STANDING)
    valid = (CLOCK < 200.0) | (CLOCK > 220.0)
    found = reasons(valid=valid)
    assert_array_equal(found[between(201, 219)], Reason.NO_MOTION)
    assert_array_equal(found[between(0, 199)], Reason.USED)


def test_no_motion_beyond_its_ends():
    table = force_balance(drive(), CAR, motion(), delay=3.0).table
    assert_array_equal(table.reason[STAMPS < 3.0], Reason.NO_MOTION)


def test_braking_by_its_switch_and_unseen():
    pressed = signal("brake_switch", between(100, 110))
    found = reasons(pressed)
    assert_array_equal(found[between(100, 110)], Reason.BRAKING)
    assert_array_equal(found[~between(99, 111)], Reason.USED)
    hard = np.where((CLOCK > 100.0) & (CLOCK < 110.0), -3.0, 0.7 + accel_at(CLOCK))
    assert_array_equal(reasons(specific_force=hard)[between(101, 109)], Reason.BRAKING)


def test_a_retarder_brakes_with_and_without_a_brake_switch():
    retarder = signal("retarder_torque", -0.3 * between(100, 110))
    switch = signal("brake_switch", between(200, 210))
    alone, both = reasons(retarder), reasons(retarder, switch)
    inside = (STAMPS > 100.5) & (STAMPS < 109.5)
    assert (alone[inside] == Reason.BRAKING).all()
    assert (both[inside] == Reason.BRAKING).all()
    assert (both[(STAMPS > 200.5) & (STAMPS < 209.5)] == Reason.BRAKING).all()
    assert not (both[(STAMPS > 120.0) & (STAMPS < 190.0)] == Reason.BRAKING).any()


def test_shifting_and_clutch():
    first = np.where(STAMPS < 200.0, 20.0, 10.0) * speed_at(STAMPS)
    table = force_balance(drive(engine_speed=first), CAR, motion()).table
    assert_array_equal(table.gear[STAMPS < 200.0], 1)
    assert_array_equal(table.gear[STAMPS >= 200.0], 2)
    assert_array_equal(table.reason[between(199.7, 200.2)], Reason.SHIFTING)
    assert_array_equal(table.reason[~between(199, 201)], Reason.USED)
    slipping = np.where(between(100, 120), 13.0, 10.0) * speed_at(STAMPS)
    table = force_balance(drive(engine_speed=slipping), CAR, motion()).table
    assert_array_equal(table.reason[between(101, 119)], Reason.CLUTCH_SLIPPING)
    pedal = signal("clutch_switch", between(300, 310))
    assert_array_equal(reasons(pedal)[between(300, 310)], Reason.CLUTCH_SLIPPING)


def test_a_measured_gear_is_believed():
    # Neutral where the recorder says 0, whatever the ratio.
    gear = signal("gear", np.where(between(100, 120), 0.0, 2.0))
    table = force_balance(drive(gear), CAR, motion()).table
    assert_array_equal(table.gear[between(101, 119)], 0)
    assert_array_equal(table.reason[between(101, 119)], Reason.CLUTCH_SLIPPING)
    assert_array_equal(table.reason[~between(99, 121)], Reason.USED)


def test_load_outside_the_model_and_engine_speed_that_ends():
    model = TorqueModel(source="load", coefficients=(0.0, 100.0, 0.01), load_range=(0.2, 0.8))
    car = replace(CAR, torque=model, driveline=Driveline(gearings=(10.0,)))
    load = np.where(between(100, 110), 0.1, np.where(between(200, 210), 0.9, 0.5))
    turning = Signal("engine_speed", STAMPS[:1200], 10.0 * speed_at(STAMPS[:1200]))
    recorded = Drive("d", {"engine_load": signal("engine_load", load), "engine_speed": turning})
    found = force_balance(recorded, car, motion()).table.reason
    assert_array_equal(found[between(101, 109)], Reason.OVERRUN)
    assert_array_equal(found[between(201, 209)], Reason.EXTRAPOLATED)
    assert_array_equal(found[1200:], Reason.NO_TORQUE)
    assert_array_equal(found[between(0, 99)], Reason.USED)


def waving(time):
    """Torque in slow waves through zero; where it is below, a foot may be on the brake."""
    return 80.0 * np.sin(2.0 * np.pi * time / 60.0)


def waved(**changes):
    """Return the motion that such torque, geared by ten, gives 1500 kg on the flat."""
    resisted = 0.01 * 9.80665 * 1500.0 + 0.5 * 1.2 * 0.6 * speed_at(CLOCK) ** 2
    turning = 4.0 / 0.09 + 0.2 * 100.0
    force = 10.0 * waving(CLOCK) - resisted
    return motion(specific_force=force / (1500.0 + turning), **changes)


@pytest.mark.parametrize("source", ["inertial", "speed"])
def test_noise_of_the_torque_does_not_choose_its_rows(source):
    noise = np.random.default_rng(3).normal(0.0, 10.0, STAMPS.size)
    wave = waving(STAMPS)
    recorded = Drive("d", {"engine_torque": signal("engine_torque", wave + noise)})
    electric = replace(CAR, driveline=replace(CAR.driveline, gearings=(10.0,)))
    found = force_balance(recorded, electric, waved(source=source)).table.reason
    used = found == Reason.USED
    assert_array_equal(np.isin(found[wave < -40.0], (Reason.OVERRUN, Reason.BRAKING)), True)
    assert np.count_nonzero(used) > 0.4 * STAMPS.size
    if source == "inertial":
        quiet = Drive("d", {"engine_torque": signal("engine_torque", wave)})
        assert_array_equal(force_balance(quiet, electric, waved()).table.reason, found)
    assert abs(np.mean(noise[used])) < 3.0 * 10.0 / np.sqrt(np.count_nonzero(used))


def test_a_foot_on_the_accelerator_is_not_on_the_brake():
    electric = replace(CAR, driveline=replace(CAR.driveline, gearings=(10.0,)))
    wave = waving(STAMPS)
    dragging = wave < -40.0
    pedal = np.where(STAMPS < 200.0, 0.2, 0.0)
    told = {"engine_torque": signal("engine_torque", wave), "throttle": signal("throttle", pedal)}
    found = force_balance(Drive("d", told), electric, waved()).table.reason
    assert_array_equal(found[dragging & (STAMPS < 199.0)], Reason.USED)
    assert_array_equal(found[dragging & (STAMPS > 201.0)], Reason.OVERRUN)
    # With an engine the throttle may be the valve of the intake, open at idle.
    geared = force_balance(drive(signal("throttle", pedal), torque=wave), CAR, waved()).table
    assert_array_equal(geared.reason[dragging], Reason.OVERRUN)


@pytest.mark.parametrize("slope", [0.0, 0.05])
def test_a_torque_that_runs_straight_for_long_was_filled_in(slope):
    fast = np.arange(1.0, END - 2.0, 0.1)
    torque = 50.0 + np.cumsum(np.random.default_rng(4).normal(0.0, 1.0, fast.size)) * 0.3
    gap = (fast > 100.0) & (fast < 130.0)
    torque[gap] = torque[gap][0] + slope * np.arange(np.count_nonzero(gap))
    car = replace(CAR, driveline=Driveline(gearings=(10.0,)))
    recorded = Drive("d", {"engine_torque": Signal("engine_torque", fast, torque)})
    found = force_balance(recorded, car, motion()).table.reason
    inside = (fast > 101.0) & (fast < 129.0)
    assert_array_equal(found[inside], Reason.NO_TORQUE)
    assert not np.any(found[~gap] == Reason.NO_TORQUE)


def test_driveline_loses_power_both_ways():
    pulling = force_balance(drive(torque=50.0), CAR, motion()).table
    assert_allclose(pulling.traction_force, 0.9 * 50.0 * 10.0)
    dragging = force_balance(drive(torque=-50.0), CAR, motion()).table
    assert_allclose(dragging.traction_force, -50.0 * 10.0 / 0.9)


def test_rotating_mass_and_drag():
    table = force_balance(drive(), CAR, motion()).table
    assert_allclose(rotating_mass(CAR, table.gearing), 4.0 / 0.09 + 0.2 * 100.0)
    assert_allclose(
        drag_force(table, CAR), 0.5 * table.air_density * 0.6 * speed_at(table.time) ** 2, rtol=1e-3
    )


def test_delay_shifts_torque_against_motion():
    late = drive(torque=50.0 + 10.0 * np.sin(0.5 * (STAMPS - 0.6)))
    side = force_balance(late, CAR, motion(), delay=0.6).table
    assert_allclose(side.time, STAMPS - 0.6)
    assert_allclose(side.torque, 50.0 + 10.0 * np.sin(0.5 * side.time), atol=1e-9)
    by_file = replace(CAR, timing=Timing(torque_delay=0.6))
    assert_allclose(force_balance(late, by_file, motion()).table.time, side.time)


@pytest.mark.parametrize(("heading", "part"), [(0.0, 1.0), (np.pi, -1.0), (np.pi / 2.0, 0.0)])
def test_headwind_from_the_north(heading, part):
    info = DriveInfo(wind_speed=8.0, wind_from=0.0)
    table = force_balance(drive(info=info), CAR, motion(heading=np.full(CLOCK.size, heading))).table
    # Of the wind at 10 m, at 1 m over a roughness length of 0.1 m, by the logarithmic profile.
    air = table.speed + part * 8.0 * np.log(1.0 / 0.1) / np.log(10.0 / 0.1)
    assert_allclose(drag_force(table, CAR), 0.5 * table.air_density * 0.6 * air**2, rtol=1e-9)


def test_wind_of_unknown_direction_is_no_wind():
    still = force_balance(drive(), CAR, motion()).table
    unknown = force_balance(
        drive(info=DriveInfo(wind_speed=8.0, wind_from=0.0)), CAR, motion()
    ).table
    assert_allclose(drag_force(unknown, CAR), drag_force(still, CAR))


def test_missing_torque_is_told():
    with refused("torque.missing"):
        force_balance(drive().without("engine_torque"), CAR, motion())


def weighable():
    """Make the torque that moves 1500 kg."""
    table = force_balance(drive(), CAR, motion()).table
    moved = MASS * table.specific_force + rotating_mass(CAR, table.gearing) * table.accel
    needed = moved + MASS * 9.81 * 0.01 + drag_force(table, CAR)
    return needed / 10.0 * np.where(needed > 0.0, 1.0 / 0.9, 0.9)


def test_weighing_takes_rising_speed_only():
    track = ESTIMATORS["rls"].track(force_balance(drive(torque=weighable()), CAR, motion()), CAR)
    assert track.mass == pytest.approx(MASS, rel=1e-3)
    falling = track.balance.table.accel <= 0.0
    assert np.isin(track.row_reason[falling], (Reason.NOT_ACCELERATING, Reason.OVERRUN)).all()
    assert_array_equal(track.row_reason[~falling], Reason.USED)


def test_an_outlier_is_a_bad_fit():
    rising = np.flatnonzero((accel_at(STAMPS) > 0.3) & (STAMPS > 300.0))[5]
    torque = weighable() + np.random.default_rng(1).normal(scale=0.5, size=STAMPS.size)
    torque[rising] += 400.0
    track = ESTIMATORS["rls"].track(force_balance(drive(torque=torque), CAR, motion()), CAR)
    # So sharp a fall behind it may be a foot that leaves the accelerator as well.
    assert track.row_reason[rising] in (Reason.BAD_FIT, Reason.OVERRUN)
    assert track.mass == pytest.approx(MASS, rel=0.01)
