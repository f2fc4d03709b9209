"""Two vehicles in one recording, and friction in a torque, are told; one car is left alone."""

from dataclasses import replace

import numpy as np
import pytest
from tests.noted import refused, says

from weighbridge import CalibrationSettings, Drive, DriveError, Signal, Vehicle, calibrate
from weighbridge.checks import check_drive
from weighbridge.messages import phrase
from weighbridge.vehicle import TORQUE_SOURCES, Driveline, Provenance, TorqueModel

SMALL = (42.6, 21.96, 14.04, 9.708, 7.634, 6.315)
LARGE = (50.5, 25.3, 16.9, 12.7, 9.0, 8.1)
AUTOMATIC = (36.0, 23.5, 16.0, 12.0, 10.1, 8.0, 6.8, 5.3)


def driven(gears, seed, *, top=34.0, low=0.0, duration=900.0, slip=0.0):
    """Polled speeds of a car that shifts with its speed, standing before and after."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, duration, 0.5)
    wave = 0.5 - 0.5 * np.cos(2 * np.pi * t / 150.0 + rng.uniform(-0.5, 0.5) * np.sin(t / 90.0))
    v = low + (top - low) * wave
    v *= np.clip(np.minimum(t, duration - t) / 20.0, 0.0, 1.0)
    shift = np.linspace(4.0, 30.0, len(gears) - 1)
    gear = np.searchsorted(shift, v)
    engine = np.maximum(v * np.array(gears)[gear], 85.0)
    engine *= 1.0 + slip * rng.uniform(0.0, 1.0, t.size) + rng.normal(0.0, 0.003, t.size)
    return t, np.round(v * 3.6) / 3.6, engine


def drive(*parts, pause=60.0):
    start, time, speed, engine = 0.0, [], [], []
    for t, v, n in parts:
        time.append(t + start)
        speed.append(v)
        engine.append(n)
        start += t[-1] + pause
    t = np.concatenate(time)
    return Drive(
        "made",
        {
            "vehicle_speed": Signal("vehicle_speed", t, np.concatenate(speed)),
            "engine_speed": Signal("engine_speed", t + 0.1, np.concatenate(engine)),
        },
    )


OTHERS = (
    "vehicle.two", "torque.references", "torque.references_taken", "torque.reference_changed",
)  # fmt: skip


def told(found, vehicle=None):
    return [p for p in check_drive(found, vehicle) if p.id in OTHERS]


@pytest.mark.parametrize(
    ("first", "second"), [(SMALL, LARGE), (LARGE, SMALL), (AUTOMATIC, LARGE), (SMALL, AUTOMATIC)]
)
@pytest.mark.parametrize("seed", [1, 2])
def test_gears_of_two_cars(first, second, seed):
    found = told(drive(driven(first, seed), driven(second, seed + 10)))
    assert len(found) == 1
    assert found[0].id == "vehicle.two"
    assert 880.0 < found[0].start < 990.0


@pytest.mark.parametrize("gears", [SMALL, LARGE, AUTOMATIC])
def test_one_car_twice_in_town_and_on_the_motorway(gears):
    town, motorway = driven(gears, 1, top=14.0), driven(gears, 2, low=24.0)
    assert told(drive(driven(gears, 3), driven(gears, 4))) == []
    assert told(drive(town, motorway)) == []
    assert told(drive(motorway, town)) == []


def test_a_stepless_gearbox_has_no_gears_to_compare():
    assert told(drive(driven(SMALL, 1), driven(SMALL, 2, slip=0.6))) == []


def test_reference_torque_that_changes():
    one = drive(driven(SMALL, 1))
    time = np.arange(0.0, 900.0, 5.0)
    values = np.where(time < 500.0, 250.0, 400.0)
    (problem,) = told(one.with_signals(Signal("reference_torque", time, values)))
    assert problem.serious
    assert problem.id == "torque.references"
    for value, at in ((250.0, "0 s"), (400.0, "500 s")):
        assert phrase("reference_from", value=value, at=at) in problem.values["said"]
    assert problem.values["split"]
    values[:] = 250.0
    values[7] = 65.0  # a frame that was disturbed
    assert told(one.with_signals(Signal("reference_torque", time, values))) == []


def test_two_reference_torques_in_turn_are_both_told_and_settled_by_the_vehicle_file():
    time = np.arange(0.0, 900.0, 5.0)
    values = np.where(np.arange(time.size) % 2, 2100.0, 1500.0)
    found = drive(driven(SMALL, 1)).with_signals(Signal("reference_torque", time, values))
    stated = Vehicle(torque=TorqueModel(source="percent", reference_torque=2100.0))
    lacking = Vehicle(torque=TorqueModel(source="percent"))
    load = Vehicle(torque=TorqueModel(source="load", coefficients=(0.0, 200.0)))
    for vehicle, expected in ((None, True), (lacking, True), (stated, False), (load, False)):
        (problem,) = told(found, vehicle)
        assert problem.serious is expected
        both = (("0 s", 1500.0), ("5 s", 2100.0))
        which = " and ".join(phrase("reference_from", value=v, at=at) for at, v in both)
        assert problem.values["said"] == phrase("reference_in_turn", which=which)
    known = Vehicle(torque=TorqueModel(reference_torque=2100.0))  # before its calibration
    assert [p.serious for p in told(found, known)] == [False]
    (problem,) = told(found)
    assert problem.id == "torque.references"


def test_a_reference_torque_that_is_not_that_of_the_calibration():
    time = np.arange(0.0, 900.0, 5.0)
    found = drive(driven(SMALL, 1)).with_signals(
        Signal("reference_torque", time, np.full(time.size, 2415.0))
    )

    def problems(source, reported):
        coefficients = (0.0, 1.0)
        return told(
            found,
            Vehicle(
                torque=TorqueModel(
                    source=source, coefficients=coefficients, reported_reference_torque=reported
                )
            ),
        )

    (problem,) = problems("percent", 2100.0)
    assert problem.serious
    assert problem.id == "torque.reference_changed"
    assert f"{problem.values['now']:.0f}" == "2415"
    assert f"{problem.values['known']:.0f}" == "2100"
    assert [p.serious for p in problems("measured", 2100.0)] == [False]
    assert problems("percent", 2400.0) == problems("percent", None) == []


def test_the_reference_torque_that_is_taken():
    time = np.arange(0.0, 900.0, 5.0)
    fraction = Signal("engine_torque_fraction", time, np.full(time.size, 0.5))
    values = np.where(time < 500.0, 1500.0, 2100.0)
    two = Signal("reference_torque", time, values)
    one = Signal("reference_torque", time, np.full(time.size, 1500.0))
    model = TorqueModel(source="percent")
    stated = TorqueModel(source="percent", reference_torque=2000.0)

    def taken(reference, model):
        found = Drive("made", {s.name: s for s in (fraction, reference)})
        return set(TORQUE_SOURCES["percent"].reading(found, np.array([0.0, 895.0]), model).tolist())

    assert taken(one, model) == taken(one, stated) == {750.0}
    assert taken(two, stated) == {1000.0}
    assert taken(two, model) == {750.0, 1050.0}


def idling(torque, coolant=363.0, **signals):
    t = np.arange(0.0, 300.0, 0.5)
    still = t < 100.0
    values = {
        "vehicle_speed": np.where(still, 0.0, 15.0),
        "engine_speed": np.where(still, 90.0, 200.0),
        "engine_torque_fraction": np.where(still, torque, 0.4),
        "coolant_temperature": np.full(t.size, coolant),
        **signals,
    }
    return Drive("made", {n: Signal(n, t, np.broadcast_to(v, t.shape)) for n, v in values.items()})


def car(source="percent", coefficients=()):
    return Vehicle(
        driveline=Driveline(gearings=SMALL),
        torque=TorqueModel(source=source, coefficients=coefficients, reference_torque=250.0),
    )


FRICTION = ("torque.friction", "torque.indicated")


def friction(found, vehicle=None):
    return [p for p in check_drive(found, vehicle) if p.id in FRICTION]


def test_friction_in_the_torque_shows_at_idle():
    for vehicle in (None, car(), car(coefficients=(0.0, 1.0))):
        (problem,) = friction(idling(0.07), vehicle)
        assert problem.id == "torque.friction"
        assert f"{problem.values['idle']:.0f}" == "7"
        assert not problem.serious
    assert friction(idling(0.07), car(coefficients=(-14.0, 1.0))) == []
    assert friction(idling(0.07), car("measured")) == []
    assert friction(idling(0.01)) == []
    assert friction(idling(0.07, coolant=300.0)) == []


def test_friction_is_told_by_the_bus_it_is_of_and_not_after_a_calibration():
    made = idling(0.07)
    assert friction(made, car())[0].id == "torque.friction"
    truck = replace(car(), kind="truck")
    for drive, vehicle in ((made, truck), (idling(0.07, retarder_torque=-0.1), None)):
        (problem,) = friction(drive, vehicle)
        assert problem.id == "torque.friction"
        assert problem.values["whose"] == phrase("percent_torque")
    fitted = Provenance(masses=(1500.0,), method="joint")
    assert fitted.torque_fitted
    assert friction(made, replace(truck, provenance=fitted)) == []


def test_indicated_torque_is_refused_until_its_friction_is_stated():
    found = idling(0.10, indicated_torque_fraction=0.1)
    (problem,) = friction(found, car())
    assert problem.serious
    assert problem.id == "torque.indicated"
    assert says(problem.text, "friction_by_speed")
    assert [p.serious for p in friction(found)] == [False]
    assert friction(found, car(coefficients=(-25.0, 1.0))) == []


def test_a_calibration_finds_the_friction_itself():
    found = idling(0.10, indicated_torque_fraction=0.1)
    for source in (None, "percent"):
        with pytest.raises(DriveError) as told:
            calibrate(found, 1500.0, vehicle=car(), settings=CalibrationSettings(source=source))
        assert told.value.problem.id not in FRICTION


def test_a_calibration_by_another_torque_passes_one_that_is_stuck():
    found = idling(0.10, engine_load=0.5, engine_torque=0.0)
    with refused("range.stuck", signal="engine_torque", value="0 nm"):
        calibrate(found, 1500.0, vehicle=car())
    with pytest.raises(DriveError) as told:
        calibrate(found, 1500.0, vehicle=car(), settings=CalibrationSettings(source="percent"))
    assert told.value.problem.id != "range.stuck"
