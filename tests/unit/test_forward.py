"""The forward pass: near the smoothed answer, and causal to the last bit."""

from dataclasses import fields, replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from tests.noted import error

import weighbridge as wb
from weighbridge import ConfigError, DriveError, Signal
from weighbridge.balance import WINDOW, ForceTable, Reason, force_balance, window_params
from weighbridge.balance import forward as rows
from weighbridge.estimators.judging import STOP
from weighbridge.kernels import window_means
from weighbridge.navigation import forward as navigation
from weighbridge.pipeline.forward import forward_weigh, identify_forward, lateness
from weighbridge.signals import STEP, recent, step_ends
from weighbridge.simulation import (
    MIDSIZE,
    TRUCK18,
    Scenario,
    Sensors,
    make_scenario,
    short_route,
    simulate_car,
)
from weighbridge.vehicle import TorqueModel

COLUMNS = tuple(f.name for f in fields(ForceTable) if f.name not in ("set_off", "ratio_rate"))


def driven(name, seed, car=MIDSIZE, **more):
    sensors = Sensors(imu_rate=50.0)
    return simulate_car(
        Scenario(name=name, car=car, route=short_route(), seed=seed, sensors=sensors, **more)
    )


def polled(drive):
    """Signals that come one after another from the bus."""
    own = ("accel", "gyro", "latitude", "longitude", "altitude", "gnss")
    return [s for s in drive.signals.values() if not s.name.startswith(own)]


@pytest.fixture(scope="module")
def made():
    return driven("forward", 42_001)


@pytest.fixture(scope="module")
def loaded():
    return driven("loaded", 42_002, payload=250.0)


@pytest.fixture(scope="module")
def weighing(made, loaded):
    drive = loaded.drive.between(loaded.drive.start, loaded.drive.start + 540.0)
    return wb.weigh(drive, wb.calibrate(made.drive, mass=made.scenario.mass))


@pytest.fixture(scope="module")
def setup(weighing):
    return identify_forward(weighing)


@pytest.fixture(scope="module")
def whole(weighing, setup):
    return forward_weigh(weighing.drive, setup)


def test_the_forward_pass_ends_near_the_smoothed_answer(weighing, whole):
    assert whole.mass[-1] == pytest.approx(weighing.mass, rel=0.01)
    assert whole.std[-1] == pytest.approx(weighing.std, rel=0.25)
    assert whole.state.windows > 50
    # What is left open falls as the drive goes on.
    assert whole.std[0] > 1.2 * whole.std[-1]


@pytest.mark.parametrize("part", [0.3, 0.62, 0.9])
def test_what_comes_later_changes_no_bit(weighing, setup, whole, part):
    drive = weighing.drive
    cut = drive.start + part * drive.duration
    begun = forward_weigh(drive.between(drive.start, cut), setup)
    count = begun.time.size
    assert count > 10
    assert_array_equal(begun.time, whole.time[:count])
    assert_array_equal(begun.mass, whole.mass[:count])
    assert_array_equal(begun.std, whole.std[:count])
    # Windows are known soon after they end.
    waiting = lateness(setup) + STEP + 2.0 * WINDOW
    assert count >= np.count_nonzero(whole.time < cut - waiting)
    assert lateness(setup) - setup.delay - setup.navigation.clocks.speed_delay < 1.01


def test_nor_in_a_truck_whose_torque_comes_slowly():
    """Its rows are means of the motion around them."""
    made = driven("slow", 42_003, TRUCK18, payload=4000.0, duration=600.0)
    slow = {s.name: replace(s, time=s.time[::3], values=s.values[::3]) for s in polled(made.drive)}
    drive = made.drive.with_signals(*slow.values())
    weighing = wb.weigh(
        drive, wb.calibrate(drive, mass=made.scenario.mass, vehicle=wb.Vehicle(kind="truck"))
    )
    table, motion = weighing.result.balance.table, weighing.result.balance.motion
    at = np.interp(table.time, motion.time, motion.specific_force)
    known = np.isfinite(table.specific_force)
    assert np.std((table.specific_force - at)[known]) > 0.02
    setup = identify_forward(weighing)
    whole = forward_weigh(drive, setup)
    begun = forward_weigh(drive.between(drive.start, drive.start + 300.0), setup)
    assert begun.time.size > 10
    assert_array_equal(begun.mass, whole.mass[: begun.time.size])


def test_a_drive_that_pauses_goes_on(weighing, setup):
    """Bus and sensor are silent for a while; what comes after is weighed as before."""
    drive = weighing.drive.between(0.0, weighing.drive.start + 0.6 * weighing.drive.duration)
    middle = drive.start + 0.3 * drive.duration
    gap = paused(drive)
    track = forward_weigh(gap, setup)
    assert track.mass[-1] == pytest.approx(weighing.mass, rel=0.02)
    assert not ((track.time > middle + 1.0) & (track.time < middle + 60.0)).any()
    assert (track.time > middle + 60.0).sum() > 20


@pytest.mark.parametrize("lost", [("engine_load",), ("accel_x",), ("vehicle_speed",)])
def test_a_signal_that_ends_adds_no_windows(weighing, setup, lost):
    drive = weighing.drive
    middle = drive.start + 0.5 * drive.duration
    drive = drive.between(drive.start, drive.start + 0.6 * drive.duration)
    cut = drive.with_signals(
        *(
            replace(s, time=s.time[s.time < middle], values=s.values[s.time < middle])
            for s in drive.signals.values()
            if s.name in lost
        )
    )
    track = forward_weigh(cut, setup)
    assert track.time.size > 20
    # GNSS goes on for the motion; a torque or an accelerometer nothing replaces.
    if lost != ("vehicle_speed",):
        assert track.time[-1] < middle + 3.0
    assert track.mass[-1] == pytest.approx(weighing.mass, rel=0.02)


def test_a_setup_needs_a_mass_by_joint_and_an_inertial_sensor(weighing):
    with error(ConfigError, "loaded rls"):
        identify_forward(wb.weigh(weighing.drive, weighing.vehicle, "rls"))
    blind = weighing.drive.without(*(f"{k}_{a}" for k in ("accel", "gyro") for a in "xyz"))
    with error(DriveError, "loaded accel_x gyro_x"):
        identify_forward(wb.weigh(blind, weighing.vehicle))


def with_torque(loaded, period):
    """The loaded drive with a torque that is told every ``period``, and what tells of the brake."""
    truth, rng = loaded.truth, np.random.default_rng(42_003)
    every = round(period / np.median(np.diff(truth.time)))
    time, torque = truth.time[::every].copy(), truth.engine_torque[::every].copy()
    torque = np.round(torque + rng.normal(0.0, 2.0, torque.size), 2)
    return time, torque, truth


def by_torque(weighing, drive, lag):
    """Weigh by a measured torque that is smoothed with a ``lag``, and by nothing beside it."""
    drive = drive.without("engine_load", "mass_air_flow")
    vehicle = weighing.vehicle
    vehicle = replace(
        vehicle,
        torque=TorqueModel(source="measured"),
        timing=replace(vehicle.timing, torque_delay=None, torque_lag=lag),
    )
    return wb.weigh(drive, vehicle)


def switched(weighing, loaded):
    """10 Hz with a brake switch; for half a minute of driving the logger filled its readings in."""
    time, torque, truth = with_torque(loaded, 0.1)
    fast = time[(np.interp(time, truth.time, truth.speed) > 8.0) & (time > time[0] + 150.0)]
    hole = (time > fast[0]) & (time < fast[0] + 30.0)
    torque[hole] = np.round(np.linspace(40.0, 70.0, np.count_nonzero(hole)), 2)
    pressed = (truth.brake_pedal[::20] > 0.0).astype(float)
    switch = Signal("brake_switch", truth.time[::20].copy(), pressed)
    drive = weighing.drive.with_signals(Signal("engine_torque", time, torque), switch)
    return by_torque(weighing, drive, 0.25)


def slow(weighing, loaded):
    """1 Hz with the position of the accelerator, and a silence of a minute in all signals."""
    time, torque, truth = with_torque(loaded, 1.0)
    pedal = Signal("accelerator_pedal", truth.time[::50].copy(), truth.pedal[::50].copy())
    drive = weighing.drive.with_signals(Signal("engine_torque", time, torque), pedal)
    return by_torque(weighing, paused(drive), 0.4)


def paused(drive):
    middle = drive.start + 0.3 * drive.duration
    return drive.with_signals(
        *(
            replace(s, time=s.time[keep], values=s.values[keep])
            for s in drive.signals.values()
            for keep in [(s.time < middle) | (s.time > middle + 60.0)]
        )
    )


def stepless(_, __):
    """A car whose ratio moves: engine and vehicle speed are read at instants of their own."""
    weighed = simulated("cvt", None)
    assert weighed.vehicle.driveline.stepless
    return weighed


def hybrid(_, __):
    """Engine and battery of a power split, over a vehicle speed that is read on its own."""
    weighed = simulated("hybrid", wb.Vehicle(kind="hybrid"))
    assert weighed.vehicle.torque.source == "hybrid"
    return weighed


def simulated(name, base):
    known, driven = (
        simulate_car(
            replace(
                make_scenario(name, payload=load, seed=42_004),
                sensors=Sensors(imu_rate=50.0),
                duration=700.0,
            )
        )
        for name, load in ((f"{name}-calibration", 0.0), (name, 180.0))
    )
    car = wb.calibrate(known.drive, mass=known.scenario.mass, vehicle=base)
    return wb.weigh(driven.drive, car)


def columns_of(table):
    return (*COLUMNS, *(("ratio_rate",) if table.ratio_rate is not None else ()))


def rows_by_steps(drive, setup):
    """All rows of a drive, as the stages find them step by step; and the whole motion."""
    motion, force = navigation.begin(setup.navigation, drive.start), rows.begin()
    parts, moved = [], []
    for until in step_ends(drive, setup.step):
        records = recent(drive, until, setup.step)
        motion, found = navigation.step(motion, records, until, setup.navigation)
        if found is not None:
            moved.append(found)
        if motion.motion is None or motion.motion.time.size < 2:
            continue
        force, table, new = rows.step(
            force, records, motion.motion, until, setup.vehicle, setup.delay, setup.force
        )
        if new.stop > new.start:
            parts.append({name: getattr(table, name)[new] for name in columns_of(table)})
    stepped = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return stepped, navigation.joined(moved)


@pytest.mark.parametrize(
    ("kind", "reasons"),
    [
        (None, {Reason.SHIFTING, Reason.OVERRUN}),
        (switched, {Reason.SHIFTING, Reason.BRAKING, Reason.NO_TORQUE}),
        (slow, {Reason.NO_MOTION, Reason.OVERRUN}),
        (stepless, {Reason.CLUTCH_SLIPPING}),
        (hybrid, {Reason.OVERRUN}),
    ],
    ids=["load", "switched", "slow", "stepless", "hybrid"],
)
def test_rows_of_a_whole_drive_are_those_of_the_stages(weighing, loaded, kind, reasons):
    """Given the setup, nothing but what came before a row and soon after it changes it."""
    weighed = weighing if kind is None else kind(weighing, loaded)
    setup, start = identify_forward(weighed), weighed.drive.start
    drive = weighed.drive.between(start, start + 400.0)
    stepped, motion = rows_by_steps(drive, setup)
    table = force_balance(drive, setup.vehicle, motion, delay=setup.delay, setup=setup.force).table
    count = stepped["time"].size
    assert 0 <= table.time.size - count <= 3.0 / setup.period
    for name in columns_of(table):
        assert_array_equal(getattr(table, name)[:count], stepped[name], err_msg=name)
    told = set(np.unique(table.reason).tolist())
    assert {Reason.USED, Reason.STANDING} | reasons < told


def test_windows_of_all_rows_at_once_are_those_of_the_stages(weighing, setup):
    """One call of the kernel over all rows, or one for every few: the same windows."""
    table = weighing.result.balance.table
    values = np.column_stack([table.time, table.traction_force])
    usable = table.usable & np.isfinite(values).all(axis=1)
    params = window_params(setup.period, long_gap=STOP)
    columns = (table.time, usable, table.moving, values)
    state, *whole = window_means.run(window_means.initial_state(2), *columns, params)
    parts, stepped = [], window_means.initial_state(2)
    for first in range(0, table.time.size, 7):
        part = (np.ascontiguousarray(c[first : first + 7]) for c in columns)
        stepped, *found = window_means.run(stepped, *part, params)
        parts.append(found)
    for at_once, bit_by_bit in zip(whole, zip(*parts, strict=True), strict=True):
        assert_array_equal(at_once, np.concatenate(bit_by_bit))
    assert whole[0].shape[0] > 50
    for a, b in zip(state, stepped, strict=True):
        assert_array_equal(a, b)
