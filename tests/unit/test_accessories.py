"""A compressor that the engine drives on and off: found by its steps, taken out of the mass."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.balance.law import accessory_column
from weighbridge.calibration import joint as joint_fit
from weighbridge.estimators import ESTIMATORS
from weighbridge.navigation import BY_SPEED
from weighbridge.pipeline.forward import forward_weigh, identify_forward
from weighbridge.simulation import (
    MIDSIZE,
    Scenario,
    Sensors,
    make_scenario,
    short_route,
    simulate_car,
)

POWER = 2800.0
SUMMER = 305.0


def drive(power, seed, payload=0.0):
    return simulate_car(
        Scenario(
            name="summer",
            car=replace(MIDSIZE, compressor_power=power),
            route=short_route(),
            ambient_temperature=SUMMER,
            payload=payload,
            sensors=Sensors(imu_rate=50.0),
            seed=seed,
        )
    )


def calibrated(made):
    return wb.calibrate([d.drive for d in made], mass=[d.scenario.mass for d in made])


@pytest.fixture(scope="module")
def switched():
    return [drive(POWER, 4101), drive(POWER, 4106, payload=300.0)]


@pytest.fixture(scope="module")
def car(switched):
    return calibrated(switched)


@pytest.fixture(scope="module")
def made():
    return drive(POWER, 4102, payload=200.0)


@pytest.fixture(scope="module")
def weighing(made, car):
    return wb.weigh(made.drive, car)


def test_the_power_and_its_times_are_found(weighing):
    found = weighing.result.switched
    assert found.power == pytest.approx(POWER, rel=0.25)
    # The simulator's compressor is on for 40 s of 70.
    truly = (found.time - weighing.drive.start) % 70.0 < 40.0
    assert np.mean((found.on > 0.5) == truly) > 0.85


def test_the_calibration_keeps_the_power_of_the_vehicle(car, weighing, made, tmp_path):
    shown = car.provenance.switched_power
    assert shown == pytest.approx(POWER, rel=0.25)
    car.save(tmp_path / "car.toml")
    kept = wb.Vehicle.load(tmp_path / "car.toml")
    assert kept.provenance.switched_power == pytest.approx(shown, rel=1e-5)
    other = replace(car, provenance=replace(car.provenance, switched_power=2.0 * POWER))
    pulled = wb.weigh(made.drive, other).result.switched
    assert pulled is None or pulled.power > 1.1 * weighing.result.switched.power


def test_nothing_is_found_where_nothing_is_switched(car):
    plain = wb.weigh(drive(0.0, 4103, payload=200.0).drive, car)
    assert plain.status == "converged"
    assert plain.result.switched is None


def test_without_an_accelerometer_hills_may_look_alike(made, car):
    imu = [n for n in made.drive.signals if n.startswith(("accel_", "gyro_"))]
    blind = wb.weigh(made.drive.without(*imu), car)
    assert blind.result.balance.motion.source in BY_SPEED
    assert blind.result.switched is None


def test_a_motor_has_no_such_load():
    scenario = replace(make_scenario("electric", seed=4104), sensors=Sensors(imu_rate=50.0))
    made = simulate_car(replace(scenario, duration=500.0))
    file = wb.calibrate([made.drive], mass=made.scenario.mass)
    table = wb.weigh(made.drive, file).result.balance.table
    assert np.nan_to_num(table.torque).any()
    assert not accessory_column(table, file).any()


def test_the_interval_is_narrower_than_that_of_a_scale_that_takes_it_for_noise(
    weighing, monkeypatch
):
    monkeypatch.setattr(f"{ESTIMATORS['joint'].estimate.__module__}.find_switched", lambda *_: None)
    blind = wb.weigh(weighing.drive, weighing.vehicle)
    assert weighing.result.bound_std < 0.75 * blind.result.bound_std
    assert weighing.result.sizes.slow < 0.75 * blind.result.sizes.slow


def test_a_calibration_knows_what_was_switched(switched, car, monkeypatch):
    """What the compressor takes, four sevenths of the time, is no torque that the engine lacks."""
    monkeypatch.setattr(joint_fit, "_as_shown", lambda rows, *_: rows)
    blind = calibrated(switched)
    offset, blindly = (f.torque.coefficients[0] for f in (car, blind))
    turning = np.median(switched[0].drive.signals["engine_speed"].values)
    assert offset - blindly > 0.7 * 4.0 / 7.0 * POWER / turning


def test_it_is_taken_out_on_the_way_too(made, weighing):
    setup = identify_forward(weighing)
    assert setup.joint.switched_power == weighing.result.switched.power
    blind = replace(setup, joint=replace(setup.joint, switched_power=0.0))
    truth, errors = made.scenario.mass, []
    for each in (setup, blind):
        track = forward_weigh(weighing.drive, each)
        assert (track.state.switch is None) == (each is blind)
        late = track.time > weighing.drive.start + 300.0
        errors.append(np.sqrt(np.mean((track.mass[late] - truth) ** 2)) / truth)
    assert errors[0] < 0.01
    assert errors[0] < 0.5 * errors[1]


def test_live_takes_it_out_as_the_forward_pass_does(made, weighing):
    """To the last bit, in blocks of three seconds, with a checkpoint on the way."""
    setup = identify_forward(weighing)
    drive = weighing.drive
    part = drive.between(drive.start, drive.start + 240.0)
    track = forward_weigh(part, setup)
    assert track.state.switch is not None
    scale = wb.LiveScale(weighing.vehicle, setup=setup, info=drive.info)
    edges = np.append(np.arange(part.start, part.end, 3.0), part.end + 1.0)
    for first, last in pairwise(edges):
        block = part.between(first, last)
        scale.update_block({n: (s.time, s.values) for n, s in block.signals.items()})
        if first <= part.start + 150.0 < last:
            scale = wb.LiveScale.restore(weighing.vehicle, scale.checkpoint())
            assert scale._state.joint.switch is not None
    scale.finish()
    told = scale.weighing()
    assert told.std == track.std[-1]
    assert told.mass == track.state.mass - scale._state.force.fuel


def test_the_report_shows_it(weighing, tmp_path):
    weighing.report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert f"{weighing.result.switched.power / 1e3:.1f} kW" in page
