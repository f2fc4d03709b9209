"""Torque from what a drive recorded, against numbers worked out by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.noted import error, refused

from weighbridge import ConfigError, Drive, Signal, Vehicle
from weighbridge.vehicle import TORQUE_SOURCES, TorqueModel, engine_torque, reading_of, torque_rows

TIME = np.arange(5.0)
SPEED = np.array([100.0, 150.0, 200.0, 250.0, 700.0])


def drive(**values):
    return Drive("d", {k: Signal(k, TIME, np.asarray(v, dtype=float)) for k, v in values.items()})


def torque(recorded, **model):
    vehicle = Vehicle(torque=TorqueModel(**model))
    return engine_torque(recorded, vehicle, SPEED, TIME)


def test_measured_torque_is_taken_as_it_is():
    values = [10.0, -20.0, 30.0, 0.0, 5.0]
    found = torque(drive(engine_torque=values), source="measured")
    assert_allclose(found.torque, values)
    assert not found.extrapolated.any()
    assert not found.overrun.any()


def test_measured_torque_with_offset_and_scale():
    recorded = drive(engine_torque=[0.0, 100.0, 200.0, 0.0, 0.0])
    found = torque(recorded, source="measured", coefficients=(5.0, 0.9))
    assert_allclose(found.torque, [5.0, 95.0, 185.0, 5.0, 5.0])


def test_percent_torque_takes_the_drives_reference_before_the_files():
    percent = drive(engine_torque_fraction=[0.1] * 5)
    assert_allclose(torque(percent, source="percent", reference_torque=300.0).torque, 30.0)
    both = drive(engine_torque_fraction=[0.1] * 5, reference_torque=[2000.0] * 5)
    assert_allclose(torque(both, source="percent", reference_torque=300.0).torque, 200.0)
    with refused("torque.no_reference"):
        torque(percent, source="percent")


def test_load_by_the_regression_of_eq_49():
    load = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
    recorded = drive(engine_load=load, engine_speed=SPEED)
    model = {"source": "load", "load_range": (0.2, 0.8), "speed_range": (120.0, 600.0)}
    found = torque(recorded, coefficients=(-20.0, 300.0, 0.05, -1e-4), **model)
    assert_allclose(found.torque, -20.0 + 300.0 * load + 0.05 * SPEED - 1e-4 * SPEED**2)
    assert found.overrun.tolist() == [True, False, False, False, False]
    assert found.extrapolated.tolist() == [True, False, False, False, True]
    bent = torque(recorded, coefficients=(-20.0, 300.0), curvature=(0.1, 50.0), **model)
    assert_allclose(bent.torque, -20.0 + 300.0 * load + 0.1 * load * SPEED + 50.0 * load**2)


@pytest.mark.parametrize("curvature", [(), (0.1, 50.0), (0.1, -60.0)])
def test_the_reading_of_a_torque_gives_that_torque(curvature):
    load = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
    recorded = drive(engine_load=load, engine_speed=SPEED)
    model = TorqueModel(
        source="load", coefficients=(-20.0, 300.0, 0.05, -1e-4), curvature=curvature
    )
    found = engine_torque(recorded, Vehicle(torque=model), SPEED, TIME)
    assert_allclose(reading_of(found.torque, SPEED, model), load)
    assert_allclose(reading_of(load, SPEED, TorqueModel()), load)


def test_air_flow_torque_by_hand():
    def found(mass_air_flow=0.0147, engine_speed=150.0, **more):
        values = {"mass_air_flow": mass_air_flow, "engine_speed": engine_speed, **more}
        recorded = drive(**{name: [value] * 5 for name, value in values.items()})
        return torque(recorded, source="air_flow", engine_efficiency=1.0 / 3.0).torque

    # 14.7 g/s of air carry 1 g/s of petrol, 45 kW; a third of it at 150 rad/s is 100 N m.
    assert_allclose(found(), 100.0)
    # Twice the air for the same petrol.
    assert_allclose(found(lambda_1=2.0), 50.0)
    # An engine that stands has no finite torque of flow over speed.
    assert np.isfinite(found(mass_air_flow=0.01, engine_speed=0.0)).all()


def test_columns_of_the_regression():
    rows = torque_rows(np.array([0.5]), np.array([10.0]), 2, curved=True)
    assert_allclose(rows, [[1.0, 0.5, 10.0, 100.0, 5.0, 0.25]])


def test_lowest_load_is_just_above_the_dragged_engine():
    load = np.concatenate((np.full(200, 0.05), np.linspace(0.2, 0.9, 800)))
    lowest = TORQUE_SOURCES["load"].floor
    assert lowest(load) == pytest.approx(0.06)
    assert lowest(np.array([np.nan])) == 0.0


@pytest.mark.parametrize("source", ["measured", "percent", "load", "air_flow"])
def test_what_is_missing_is_named(source):
    coefficients = (0.0, 1.0) if source == "load" else ()
    with refused("torque.missing", source=source):
        torque(drive(throttle=[0.5] * 5), source=source, coefficients=coefficients)


KNOTS = (120.0, 180.0, 260.0)


def test_parts_of_the_knots_add_up_to_one_and_end_flat():
    turning = np.array([50.0, 120.0, 150.0, 200.0, 900.0])
    parts = torque_rows(np.ones(5), turning, 0, knots=KNOTS)[:, -3:]
    assert_allclose(parts.sum(axis=1), 1.0)
    assert_allclose(parts[0], [1.0, 0.0, 0.0])
    assert_allclose(parts[2], [0.5, 0.5, 0.0])
    assert_allclose(parts[4], [0.0, 0.0, 1.0])


def test_a_map_with_knots_is_undone_by_its_reading():
    model = TorqueModel(
        source="load", coefficients=(-12.0, 160.0, -0.03), curvature=(0.05, -20.0),
        knots=KNOTS, knot_slopes=(8.0, -5.0, 12.0),
    )  # fmt: skip
    load = np.array([0.1, 0.3, 0.5, 0.8, 0.95])
    recorded = drive(engine_load=load, engine_speed=SPEED)
    made, more = (
        engine_torque(recorded, Vehicle(torque=m), SPEED, TIME).torque
        for m in (model, model.scaled(1.1))
    )
    assert_allclose(reading_of(made, SPEED, model), load, rtol=1e-9)
    assert_allclose(more, 1.1 * made)


@pytest.mark.parametrize(
    ("knots", "slopes", "said"),
    [
        ((120.0, 180.0), (1.0,), "knot_slopes 2 1"),
        ((180.0, 120.0), (1.0, 2.0), "knots 180.0 120.0"),
    ],
)
def test_knots_that_cannot_be_are_refused(knots, slopes, said):
    with error(ConfigError, said):
        TorqueModel(knots=knots, knot_slopes=slopes)
