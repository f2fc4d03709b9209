"""A car with a stepless gearbox: its ratio is measured, and its engine gains speed by itself."""

from dataclasses import replace

import numpy as np
import pytest
from tests.noted import refused

import weighbridge as wb
from weighbridge import Vehicle
from weighbridge.balance import force_balance
from weighbridge.calibration import run_calibration
from weighbridge.limits import LOCKED
from weighbridge.navigation import find_motion
from weighbridge.pipeline.forward import forward_weigh, identify_forward
from weighbridge.simulation import Sensors, make_scenario, simulate_car
from weighbridge.vehicle import Driveline


def drive(payload, seed, name="cvt-calibration"):
    scenario = make_scenario(name, payload=payload, seed=seed)
    return simulate_car(replace(scenario, sensors=Sensors(imu_rate=50.0), duration=700.0))


@pytest.fixture(scope="module")
def known():
    return [drive(0.0, 1), drive(350.0, 2)]


@pytest.fixture(scope="module")
def done(known):
    return run_calibration([m.drive for m in known], [m.scenario.mass for m in known])


@pytest.fixture(scope="module")
def calibrated(done):
    return done.vehicle


def test_it_is_calibrated_and_weighed(known, done, calibrated):
    assert "gear.stepless" in {p.id for p in done.problems}
    low, high = calibrated.driveline.gearing_range
    assert calibrated.driveline.gearings == ()
    ends = known[0].scenario.car.gearings
    assert 0.98 * ends[1] < low < 1.05 * ends[1]
    assert high < 1.03 * ends[0]
    assert calibrated.driveline.engine_inertia == pytest.approx(0.15, rel=0.15)
    made = drive(180.0, 3, "cvt")
    weighed = wb.weigh(made.drive, calibrated)
    assert weighed.status == "converged"
    assert weighed.mass == pytest.approx(made.truth.mass[-1], rel=0.03)
    assert abs(weighed.mass - made.truth.mass[-1]) < 2.5 * weighed.std


@pytest.mark.parametrize("delay", [0.0, 2.5])
def test_gears_stay_gears_where_the_engine_speed_is_noisy_or_late(short_drive, delay):
    engine = short_drive.drive.signals["engine_speed"]
    noise = np.random.default_rng(1).standard_normal(len(engine)) * (0.02 if delay == 0.0 else 0.0)
    seen = replace(engine, time=engine.time + delay, values=engine.values * (1.0 + noise))
    mass = float(short_drive.truth.mass[0])
    made = wb.calibrate(
        short_drive.drive.with_signals(seen), mass, settings=wb.CalibrationSettings(method="rls")
    )
    assert not made.driveline.stepless
    assert len(made.driveline.gearings) > 2


def test_ratio_and_rate_of_its_engine_are_those_of_the_simulation(known):
    made = known[0]
    car, truth = made.scenario.car, made.truth
    known_car = Vehicle(driveline=Driveline(gearing_range=(car.gearings[1], car.gearings[0])))
    known_car = replace(known_car, torque=replace(known_car.torque, source="percent"))
    motion = find_motion(made.drive, known_car)
    table = force_balance(made.drive, known_car, motion, delay=0.1).table
    assert np.all(table.speed[table.usable] >= LOCKED)
    gearing = np.interp(table.time, truth.time, truth.engine_speed / np.maximum(truth.speed, 0.1))
    rate = np.interp(table.time, truth.time, np.gradient(truth.engine_speed, truth.time))
    use = table.usable & np.isfinite(table.engine_accel)
    assert np.median(np.abs(table.gearing / gearing - 1.0)[use]) < 0.01
    spun = (table.gearing * table.engine_accel)[use]
    assert np.corrcoef(spun, rate[use])[0, 1] > 0.95
    # Far from what a fixed gear would make of it.
    assert np.corrcoef((table.gearing * table.accel)[use], rate[use])[0, 1] < 0.6


def test_a_live_scale_has_the_mass_of_the_whole_drive(calibrated):
    made = drive(180.0, 3, "cvt")
    weighed = wb.weigh(made.drive, calibrated)
    setup = identify_forward(weighed)
    whole = forward_weigh(weighed.drive, setup)
    assert whole.mass[-1] == pytest.approx(weighed.mass, rel=0.01)
    assert whole.std[-1] == pytest.approx(weighed.std, rel=0.25)


def test_a_ratio_that_comes_later_than_the_torque_is_found(calibrated):
    late = 0.15
    made = drive(180.0, 3, "cvt")
    engine = made.drive.signals["engine_speed"]
    moved = made.drive.with_signals(replace(engine, time=engine.time + late))
    found = [
        wb.weigh(one, calibrated).result.slow_errors.constants["ratio_lateness"]
        for one in (made.drive, moved)
    ]
    (before, _), (after, std) = found
    assert after - before == pytest.approx(late, abs=2.5 * std)
    assert after - before > 0.5 * late


def test_ratios_beyond_those_of_the_calibration_are_another_vehicles(calibrated):
    line = replace(calibrated.driveline, gearing_range=(20.0, 60.0))
    weighed = wb.weigh(drive(180.0, 3, "cvt").drive, replace(calibrated, driveline=line))
    assert weighed.status == "inconsistent"
    assert weighed.reason_id == "gear.foreign"


def with_motor(made):
    """Let a motor drive alone at low power: the engine stands, and a battery gives the power."""
    truth, drive = made.truth, made.drive
    power = truth.engine_torque * truth.engine_speed
    alone = (power < 2e4).astype(float)

    def unless(name):
        s = drive.signals[name]
        return wb.Signal(
            name, s.time, np.where(np.interp(s.time, truth.time, alone) > 0.5, 0.0, s.values)
        )

    volts = wb.Signal("battery_voltage", truth.time, np.full(truth.time.size, 210.0))
    amps = wb.Signal("battery_current", truth.time, power * alone / 210.0)
    return drive.with_signals(unless("engine_speed"), unless("engine_torque_fraction")), (
        volts,
        amps,
    )


def test_a_motor_that_drives_alone_shows_a_hybrid(known, calibrated):
    drive, _ = with_motor(known[0])
    assert wb.weigh(drive, calibrated).reason_id == "hybrid.engine_stands"
    with refused("hybrid.engine_stands"):
        wb.calibrate([drive], known[0].scenario.mass)


def test_a_battery_that_drives_beside_the_engine_shows_a_hybrid(known, calibrated):
    made = known[0]
    _, battery = with_motor(made)
    weighed = wb.weigh(made.drive.with_signals(*battery), calibrated)
    assert weighed.reason_id == "hybrid.battery"
    small = [battery[0], wb.Signal("battery_current", battery[1].time, 0.05 * battery[1].values)]
    assert wb.weigh(made.drive.with_signals(*small), calibrated).reason_id is None


def test_so_does_one_whose_engine_never_idles(known, calibrated):
    """It stands wherever the car creeps, so that no idle speed is known."""
    made, truth = known[0], known[0].truth
    _, battery = with_motor(made)
    engine = made.drive.signals["engine_speed"]
    slow = np.interp(engine.time, truth.time, truth.speed) < 8.0
    stands = replace(engine, values=np.where(slow, 0.0, engine.values))
    never = replace(calibrated, driveline=replace(calibrated.driveline, idle_speed=0.0))
    weighed = wb.weigh(made.drive.with_signals(stands, *battery), never)
    assert weighed.reason_id == "hybrid.battery"


def test_of_a_hybrid_the_torque_of_the_engine_is_a_part(known, calibrated):
    weighed = wb.weigh(known[0].drive, replace(calibrated, kind="hybrid"))
    assert weighed.status == "missing_signals"
    assert weighed.reason_id == "hybrid.part"
    with refused("hybrid.part"):
        wb.calibrate([known[0].drive], known[0].scenario.mass, vehicle=Vehicle(kind="hybrid"))
