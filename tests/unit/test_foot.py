"""Rows on which the foot may be on the brake, on made-up drives whose braking is known."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from weighbridge import Drive, Signal, Vehicle
from weighbridge.balance import Reason, force_balance
from weighbridge.balance.floor import Floor, find_floor
from weighbridge.constants import GRAVITY
from weighbridge.kernels import two_states
from weighbridge.navigation import Motion
from weighbridge.vehicle import DraggedReading, Driveline, RoadLoad, Timing, TorqueModel

END = 1200.0
CLOCK = np.arange(0.0, END, 0.05)
STAMPS = np.arange(1.0, END - 2.0, 0.25)
MASS, GEARING, FULL = 1500.0, 10.0, 150.0
DRAGGED, FLOOR = -25.0, 0.08


def foot(time):
    """1 where the accelerator is pressed: 16 of every 20 s."""
    return ((time % 20.0) < 16.0).astype(float)


def braked(time):
    """Force of the brake [N]: light, in the middle of every other dragged stretch."""
    phase = time % 40.0
    return np.where((phase > 16.8) & (phase < 19.5), 300.0, 0.0)


def torque_of(time, part=None):
    pushing = 20.0 + 60.0 * (0.5 + 0.5 * np.sin(0.31 * time)) if part is None else part
    return np.where(foot(time) > 0.5, pushing, DRAGGED)


def load_of(time):
    """PID 04 of `torque_of`, with the floor of a dragged engine."""
    return np.where(foot(time) > 0.5, FLOOR + torque_of(time) / FULL, FLOOR)


CAR = Vehicle(
    tare=MASS,
    driveline=Driveline(
        gearings=(2.0 * GEARING, GEARING), engine_inertia=0.0, wheel_inertia=0.0, efficiency=1.0
    ),
    road_load=RoadLoad(drag_area=0.0, rolling_coefficient=0.01),
    timing=Timing(torque_delay=0.0),
)


def motion(braking=True, lag=0.0):
    """What torque and brake make of the vehicle on the flat."""
    force = GEARING * torque_of(CLOCK) - MASS * GRAVITY * 0.01
    accel = (force - (braked(CLOCK) if braking else 0.0)) / MASS
    zeros, nothing = np.zeros(CLOCK.size), np.full(CLOCK.size, np.nan)
    return Motion(
        source="inertial", time=CLOCK, speed=np.full(CLOCK.size, 15.0), accel=accel,
        specific_force=accel, grade=zeros, pitch=zeros, roll=zeros, heading=nothing,
        distance=15.0 * CLOCK, altitude=zeros,
        valid=np.ones(CLOCK.size, dtype=bool), specific_force_std=0.05, grade_std=zeros + 0.01,
    )  # fmt: skip


def recorded(**values):
    signals = {"engine_speed": np.full(STAMPS.size, 150.0), "vehicle_speed": 15.0 + 0.0 * STAMPS}
    signals |= values
    return Drive(
        "d", {n: Signal(n, STAMPS, np.asarray(v, dtype=float)) for n, v in signals.items()}
    )


def reasons(drive, car=CAR, **balance):
    return force_balance(drive, car, motion(), **balance).table.reason


def near(mask, reach):
    """Return the stamps within a time of a marked one."""
    marked = STAMPS[mask]
    after = np.clip(np.searchsorted(marked, STAMPS), 1, marked.size - 1)
    distance = np.minimum(np.abs(STAMPS - marked[after - 1]), np.abs(STAMPS - marked[after]))
    return distance <= reach


LOADED = replace(CAR, torque=TorqueModel(source="load", coefficients=(-FULL * FLOOR, FULL)))
DRAGS = DraggedReading(
    engine_speed=(100.0, 150.0, 250.0), level=(FLOOR, FLOOR, FLOOR), scatter=0.01, span=0.8
)


@pytest.mark.parametrize("source", ["measured", "load"])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_no_row_is_braked_and_most_that_push_are_used(source, noise):
    random = np.random.default_rng(5)
    read = torque_of(STAMPS) if source == "measured" else load_of(STAMPS)
    read = read + noise * np.ptp(read) * random.standard_normal(read.size)
    name = "engine_torque" if source == "measured" else "engine_load"
    used = reasons(recorded(**{name: read}), CAR if source == "measured" else LOADED) == Reason.USED
    assert not np.any(used & (braked(STAMPS) > 0.0))
    pushing = foot(STAMPS) > 0.5
    assert np.count_nonzero(used & pushing) > 0.85 * np.count_nonzero(pushing)


def test_a_brake_switch_leaves_the_dragged_rows_of_a_torque():
    switch = (braked(STAMPS) > 0.0).astype(float)
    found = reasons(recorded(engine_torque=torque_of(STAMPS), brake_switch=switch))
    away = ~near(switch > 0.5, 0.35)
    assert np.all(found[switch > 0.5] == Reason.BRAKING)
    assert np.all(found[away & (foot(STAMPS) < 0.5)] == Reason.USED)


def test_a_truck_without_a_signal_of_its_retarder_leaves_its_dragged_rows():
    """A retarder slows a truck by its lever while the brake switch is off."""
    switch = 0.0 * STAMPS
    truck = replace(CAR, kind="truck", tare=None)
    torque = torque_of(STAMPS)
    untold = recorded(engine_torque=torque, brake_switch=switch)
    told = recorded(engine_torque=torque, brake_switch=switch, retarder_torque=0.0 * STAMPS)
    dragged = foot(STAMPS) < 0.5
    assert np.all(reasons(untold, truck)[dragged] == Reason.OVERRUN)
    assert np.all(reasons(told, truck)[dragged] == Reason.USED)
    assert np.all(reasons(untold, CAR)[dragged] == Reason.USED)


@pytest.mark.parametrize("late", [None, 8.0])
def test_a_brake_switch_that_misses_hard_braking_is_not_believed(late):
    """Dead, or late: the floor of the torque tells where the foot may be on the brake then."""
    hard = np.where((CLOCK % 40.0 > 16.8) & (CLOCK % 40.0 < 19.5), 3000.0, 0.0)
    accel = (GEARING * torque_of(CLOCK) - MASS * GRAVITY * 0.01 - hard) / MASS
    moved = replace(motion(), specific_force=accel, accel=accel)
    on = np.interp(STAMPS - (late or 0.0), CLOCK, hard) > 0.0
    switch = np.zeros(STAMPS.size) if late is None else on.astype(float)
    balance = force_balance(
        recorded(engine_torque=torque_of(STAMPS), brake_switch=switch), CAR, moved
    )
    assert balance.switch_dead
    assert any(note.id == "brake.switch_dead" for note in balance.notes)
    braked = np.interp(STAMPS, CLOCK, hard) > 0.0
    assert not np.any(balance.table.usable & braked)
    true = force_balance(
        recorded(engine_torque=torque_of(STAMPS), brake_switch=braked.astype(float)), CAR, moved
    )
    assert not true.switch_dead


def test_a_pressed_accelerator_is_no_brake_and_a_pedal_that_is_up_may_be_cruise_control():
    pressed = np.where(STAMPS < 0.5 * END, 0.45, 0.15)
    read = torque_of(STAMPS)
    found = reasons(recorded(engine_torque=read, accelerator_pedal=pressed))
    first = STAMPS < 0.5 * END - 2.0
    assert np.all(found[first] != Reason.OVERRUN)
    off = foot(STAMPS) < 0.5
    assert np.all(found[off & (STAMPS > 0.5 * END)] != Reason.USED)
    up = 0.15 + 0.0 * STAMPS
    up[::200] = 0.6
    steering = reasons(recorded(engine_torque=read, accelerator_pedal=up))
    assert np.mean(steering[~off] == Reason.USED) > 0.85


def test_smoothing_holds_a_brake_that_was_let_go():
    hard = np.where((STAMPS % 20.0 > 17.0) & (STAMPS % 20.0 < 17.5), 1.0, 0.0)
    drive = recorded(engine_torque=np.full(STAMPS.size, 30.0), brake_switch=hard)
    slowed = np.where((CLOCK % 20.0 > 17.0) & (CLOCK % 20.0 < 17.5), -3.0, 0.1)
    moved = replace(motion(), specific_force=slowed, accel=slowed)
    after = (STAMPS % 20.0 > 18.0) & (STAMPS % 20.0 < 18.6)
    assert np.all(force_balance(drive, CAR, moved, lag=0.4).table.reason[after] != Reason.USED)
    assert np.all(force_balance(drive, CAR, moved, lag=0.0).table.reason[after] == Reason.USED)


def test_a_foot_that_taps_the_brake_is_found_through_the_smoothing():
    lag, fine = 0.3, np.arange(0.0, END, 0.01)
    tapped = (fine % 30.0 > 10.0) & (fine % 30.0 < 10.4)
    dragged = tapped | ((fine % 30.0 > 20.0) & (fine % 30.0 < 23.0))
    held = np.where(dragged, FLOOR, 0.45)
    read = np.empty_like(held)
    read[0] = held[0]
    keep = np.exp(-0.01 / lag)
    for k in range(1, held.size):
        read[k] = keep * read[k - 1] + (1.0 - keep) * held[k]
    drive = recorded(engine_load=np.interp(STAMPS, fine, read))
    source = drive.signals["engine_load"]
    # The smoothed reading stays far off its floor.
    assert np.min(source.values[(STAMPS % 30.0 > 9.0) & (STAMPS % 30.0 < 12.0)]) > FLOOR + 0.08
    found = force_balance(drive, LOADED, motion(braking=False), lag=lag).table.reason
    assert not np.any(found[(STAMPS % 30.0 > 10.0) & (STAMPS % 30.0 < 10.4)] == Reason.USED)
    assert not np.any(found[(STAMPS % 30.0 > 3.0) & (STAMPS % 30.0 < 8.0)] == Reason.OVERRUN)


def test_idle_charge_in_overrun_reads_above_the_floor():
    """Half of the dragged stretches read 0.09 above the floor, as light pushing does."""
    high = (STAMPS % 40.0) < 20.0
    dragged = foot(STAMPS) < 0.5
    read = load_of(STAMPS) + 0.09 * (high & dragged)
    made = motion(braking=False)
    slowed = made.specific_force - 0.02 * GRAVITY * (foot(CLOCK) < 0.5)
    moved = replace(made, specific_force=slowed, accel=slowed)
    found = force_balance(recorded(engine_load=read), LOADED, moved).table.reason
    assert not np.any(found[~near(~dragged, 0.6) & high] == Reason.USED)
    assert np.mean(found[~dragged] == Reason.USED) > 0.85


def test_where_nothing_tells_of_the_brake_that_is_said():
    random = np.random.default_rng(4)
    no_floor = random.uniform(0.4, 1.0, STAMPS.size)
    up = np.where(foot(STAMPS) > 0.5, 0.5, 0.1)
    slowed = np.where(foot(CLOCK) > 0.5, 0.5, -0.6)
    moved = replace(motion(), specific_force=slowed, accel=slowed)

    def balance(**values):
        return force_balance(recorded(engine_load=no_floor, **values), LOADED, moved)

    assert balance().brake_hidden
    assert not balance(brake_switch=1.0 - foot(STAMPS)).brake_hidden
    by_pedal = balance(accelerator_pedal=up)
    assert not by_pedal.brake_hidden
    assert not np.any(by_pedal.table.usable & (foot(STAMPS) < 0.5))
    # A vehicle that never slows is not braked.
    even = force_balance(recorded(engine_load=no_floor), LOADED, replace(
        motion(), specific_force=0.2 + 0.0 * CLOCK, accel=0.2 + 0.0 * CLOCK))  # fmt: skip
    assert not even.brake_hidden
    assert not force_balance(recorded(engine_load=load_of(STAMPS)), LOADED, moved).brake_hidden


def test_a_drive_that_shows_no_floor_has_that_of_the_vehicle_file():
    """A cruise on which the engine is dragged for a twentieth of the time, and braked."""
    dragged = (STAMPS % 40.0) > 38.0
    read = np.where(dragged, FLOOR + 0.01, 0.3 + 0.05 * np.sin(0.7 * STAMPS))
    slowed = np.where(CLOCK % 40.0 > 38.0, -0.6, 0.1) + 0.05 * np.sin(0.37 * CLOCK)
    moved = replace(motion(), specific_force=slowed, accel=slowed)
    rare = recorded(engine_load=read, engine_speed=150.0 + 9.0 * np.sin(0.11 * STAMPS))
    rare = rare.with_signals(*(Signal(s.name, s.time[::4], s.values[::4])
                               for s in rare.signals.values()))  # fmt: skip
    alone = force_balance(rare, LOADED, moved)
    assert alone.brake_hidden
    known = force_balance(rare, replace(LOADED, dragged=DRAGS), moved)
    assert not known.brake_hidden
    found = known.table.reason
    assert not np.any(found[dragged[::4]] == Reason.USED)
    assert np.mean(found[~dragged[::4]] == Reason.OVERRUN) < 0.15


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_reading_that_has_risen_far_is_found_by_the_motion(noise):
    """Without noise its lowest value shows it, too."""
    car = replace(LOADED, dragged=DRAGS)
    noise = noise * np.random.default_rng(8).standard_normal(STAMPS.size)
    risen = recorded(engine_load=load_of(STAMPS) + 0.12 + noise)
    off = foot(STAMPS) < 0.5
    need = np.where(foot(CLOCK) < 0.5, -0.5, 0.5)
    moved = replace(motion(), specific_force=need, accel=need)
    found = force_balance(risen, car, moved)
    assert not found.brake_hidden
    assert np.mean(found.table.reason[off] != Reason.USED) > 0.8


def test_a_noisy_reading_chooses_no_rows_where_the_engine_surely_pushes():
    asked = 0.3 + 0.1 * np.sin(0.31 * STAMPS)
    noise = 0.08 * np.random.default_rng(6).standard_normal(STAMPS.size)
    read = np.where(foot(STAMPS) > 0.5, asked + noise, FLOOR)
    found = reasons(recorded(engine_load=read), LOADED)
    beside = near(foot(STAMPS) < 0.5, 2.5)
    assert np.mean(found[~beside] == Reason.OVERRUN) < 0.02


def test_an_engine_brake_does_not_hide_a_dragged_engine():
    braking = (STAMPS % 20.0) > 18.0
    read = np.where(braking, -120.0, torque_of(STAMPS))
    found = reasons(recorded(engine_torque=read))
    assert not np.any((found == Reason.USED) & (foot(STAMPS) < 0.5))


def test_two_states_equal_the_sum_over_all_paths():
    random = np.random.default_rng(7)
    time = np.cumsum(random.uniform(0.1, 0.6, 8))
    ratio = random.normal(0.0, 1.5, 8)
    stay = 1.3
    total, first = 0.0, np.zeros(8)
    for path in range(2**8):
        bits = np.array([(path >> k) & 1 for k in range(8)])
        change = 0.5 * (1.0 - np.exp(-2.0 * np.diff(time) / stay))
        moves = np.where(bits[1:] != bits[:-1], change, 1.0 - change)
        weight = 0.5 * np.prod(moves) * np.exp(np.sum(ratio[bits == 1]))
        total += weight
        first += weight * bits
    assert_allclose(two_states.posterior(ratio, time, stay, np.inf), first / total, rtol=1e-9)


def test_the_floor_is_that_of_engine_speeds_at_which_it_was_dragged():
    random = np.random.default_rng(2)
    turning = random.uniform(100.0, 400.0, 8000)
    dragged = (random.random(8000) < 0.2) & (turning < 250.0)
    read = np.where(dragged, 0.05 + 1e-4 * turning, random.uniform(0.25, 1.0, 8000))
    floor = find_floor(read + 0.004 * random.standard_normal(8000), turning)
    assert_allclose(floor.at(np.array([120.0, 200.0])), [0.062, 0.07], atol=0.012)
    # Never dragged at 380 rad/s: lowest readings there are no floor.
    assert floor.at(np.array([380.0]))[0] < 0.2
    assert find_floor(random.uniform(0.4, 1.0, 8000), turning) is None


def test_the_floor_of_the_file_follows_a_small_drift_alone():
    file = Floor(np.array([100.0, 200.0, 300.0]), np.array([0.05, 0.05, 0.05]), 0.01, 0.8)
    drive = Floor(np.array([100.0, 200.0, 300.0]), np.array([0.06, 0.04, 0.2]), 0.01, 0.8)
    assert_allclose(file.lifted(drive).level, [0.06, 0.05, 0.05])
