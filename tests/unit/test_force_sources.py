"""Force at wheels, power and battery: readings made of the truth of a simulated drive."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d
from tests.noted import refused

import weighbridge as wb
from weighbridge.papers.jensen2022_drives import without_weather
from weighbridge.simulation import make_scenario, random_vehicle, simulate_car, usual_polling
from weighbridge.vehicle import TORQUE_SOURCES, Driveline, TorqueModel

LATE = 0.08
"""Readings are as late as this [s]."""

TURNING = 0.2
"""Of the engine of a hybrid [kg m^2]."""

AUX, LOSS, METER = 700.0, 0.05, 360.0
"""Of the battery: beside driving [W], in proportion to power [-], and its voltage [V]."""


def read(made, rng):
    """Readings at 10 Hz with 1 % noise, made of the truth."""
    truth, radius = made.truth, made.scenario.car.wheel_radius
    time = np.arange(truth.time[0] + 0.2, truth.time[-1], 0.1)

    def signal(name, values):
        noise = 0.01 * np.percentile(np.abs(values), 99.0)
        at = np.interp(time - LATE, truth.time, values)
        return wb.Signal(name, time, at + noise * rng.standard_normal(time.size))

    power = truth.engine_torque * truth.engine_speed
    battery = power + LOSS * np.abs(power) + AUX
    found = (
        signal("traction_force", truth.traction_force),
        signal("wheel_torque_front", 0.6 * truth.traction_force * radius),
        signal("wheel_torque_rear", 0.4 * truth.traction_force * radius),
        signal("engine_power", power),
        signal("battery_current", -battery / METER),
        wb.Signal("battery_voltage", time, np.full(time.size, METER)),
    )
    return {s.name: s for s in found}


@pytest.fixture(scope="module")
def driven():
    """Return a car's drives, known and loaded, with their readings, by kind."""
    found = {}
    for k, (kind, duration) in enumerate((("petrol_dct", 800.0), ("electric", 1200.0))):
        rng = np.random.default_rng([71, k])
        car = random_vehicle(rng, kind)
        polling = replace(usual_polling(car), fast=("vehicle_speed", "engine_speed"), rate=5.0)
        drives = []
        for j, (name, load) in enumerate((("car-calibration", 0.0), ("car", 300.0))):
            scenario = make_scenario(name, payload=load, seed=810 + 10 * k + j)
            sensors = replace(scenario.sensors, imu_rate=50.0)
            made = simulate_car(
                replace(scenario, car=car, polling=polling, sensors=sensors, duration=duration)
            )
            drives.append((made, read(made, rng)))
        found[kind] = drives
    return found


def drive_of(drive, names, *, engine_speed):
    made, readings = drive
    plain = without_weather(made.drive)
    plain = plain if engine_speed else plain.without("engine_speed")
    return plain.with_signals(*(readings[name] for name in names))


CASES = [
    ("traction_force", "petrol_dct", ("traction_force",), False),
    ("wheel_torque", "petrol_dct", ("wheel_torque_front", "wheel_torque_rear"), True),
    ("power", "petrol_dct", ("engine_power",), True),
    ("power_by_speed", "electric", ("engine_power",), False),
    ("battery", "electric", ("battery_current", "battery_voltage"), False),
]


@pytest.mark.parametrize(("source", "kind", "names", "engine_speed"), CASES)
def test_each_source_weighs(driven, source, kind, names, engine_speed):
    known, loaded = (drive_of(d, names, engine_speed=engine_speed) for d in driven[kind])
    car = driven[kind][0][0].scenario.car
    line = Driveline(wheel_radius=car.wheel_radius)
    mass, truth = driven[kind][0][0].truth.mass[0], driven[kind][1][0].truth.mass[-1]
    made = wb.calibrate(known, float(mass), vehicle=wb.Vehicle(driveline=line))
    assert made.torque.source == source
    weighed = wb.weigh(loaded, made)
    assert weighed.mass == pytest.approx(truth, rel=0.03)
    assert abs(weighed.mass - truth) < 3.0 * weighed.std
    chosen = [w for w in wb.inspect_drive(loaded, made).ways if w.chosen]
    assert [w.torque for w in chosen] == [source]

    geared = tuple(car.gearings) if source == "power" else ()
    sheet = wb.Vehicle(driveline=replace(line, gearings=geared), torque=TorqueModel(source=source))
    alone = wb.weigh(loaded, sheet)
    assert abs(alone.mass - truth) < 3.0 * alone.std
    assert alone.std < 0.07 * truth


def test_a_sensor_at_the_hub_may_measure_the_brake(driven):
    made, readings = driven["petrol_dct"][1]
    truth, radius = made.truth, made.scenario.car.wheel_radius
    front, rear = readings["wheel_torque_front"], readings["wheel_torque_rear"]
    shafts = front.values + rear.values
    brake = radius * np.interp(front.time - LATE, truth.time, truth.brake_force)
    assert np.mean(brake > 100.0) > 0.05
    car = wb.Vehicle(
        driveline=Driveline(wheel_radius=radius), torque=TorqueModel(source="wheel_torque")
    )
    plain = without_weather(made.drive).without("brake_switch")
    told = [
        wb.weigh(plain.with_signals(wb.Signal("wheel_torque", front.time, values)), car)
        for values in (shafts, shafts - brake)
    ]
    assert told[1].mass == pytest.approx(told[0].mass, rel=0.005)
    assert abs(told[1].mass - truth.mass[-1]) < 2.0 * told[1].std
    with refused("torque.sign"):
        wb.weigh(plain.with_signals(wb.Signal("wheel_torque", front.time, -shafts)), car)


def test_an_axle_alone_is_weighed_only_where_no_other_is_driven(driven):
    drive = drive_of(driven["petrol_dct"][1], ("wheel_torque_front",), engine_speed=True)
    for driven_axle, why in (
        (None, "torque.driven_unknown"),
        ("all", "torque.other_axle"),
        ("rear", "torque.other_axle"),
    ):
        line = Driveline(driven=driven_axle)
        car = wb.Vehicle(driveline=line, torque=TorqueModel(source="wheel_torque"))
        weighed = wb.weigh(drive, car)
        assert weighed.status is wb.Status.MISSING_SIGNALS
        assert weighed.reason_id == why
        assert np.isnan(weighed.mass)
        with refused(why):
            wb.calibrate(drive, 1500.0, vehicle=wb.Vehicle(driveline=line))
    front = Driveline(driven="front")
    assert not TORQUE_SOURCES["wheel_torque"].refusal(drive, front.driven)


def test_one_wheel_of_an_axle_is_refused(driven):
    drive = drive_of(driven["petrol_dct"][1], (), engine_speed=True)
    wheel = driven["petrol_dct"][1][1]["wheel_torque_front"]
    drive = drive.with_signals(replace(wheel, name="wheel_torque_fl"))
    assert TORQUE_SOURCES["wheel_torque"].refusal(drive, "front").id == "torque.one_wheel"


def test_the_sign_of_the_current_does_not_matter(driven):
    names = ("battery_current", "battery_voltage")
    drive = drive_of(driven["electric"][1], names, engine_speed=False)
    amps = drive.signals["battery_current"]
    turned = drive.with_signals(replace(amps, values=-amps.values))
    source, time, model = TORQUE_SOURCES["battery"], amps.time, TorqueModel(source="battery")
    np.testing.assert_allclose(
        source.reading(drive, time, model), source.reading(turned, time, model)
    )


def test_a_power_is_over_the_speed_of_the_motion_not_a_late_reading(driven):
    names = ("battery_current", "battery_voltage")
    known, loaded = (drive_of(d, names, engine_speed=False) for d in driven["electric"])
    car = wb.calibrate(known, float(driven["electric"][0][0].truth.mass[0]))
    speed = loaded.signals["vehicle_speed"]
    late = loaded.with_signals(replace(speed, time=speed.time + 0.5))
    assert wb.weigh(late, car).mass == pytest.approx(wb.weigh(loaded, car).mass, rel=0.004)


def split(drive):
    """Let a motor and an engine that turns as it likes share the power of a drive."""
    made, _ = drive
    truth, time = made.truth, np.arange(made.truth.time[0] + 0.2, made.truth.time[-1], 0.2)

    def at(values):
        return np.interp(time - LATE, truth.time, values)

    power = truth.traction_force * truth.speed / 0.95
    asked = uniform_filter1d(np.maximum(power, 0.0), 150)
    on = uniform_filter1d((asked > 5e3).astype(float), 25) > 0.5
    engine = np.where(on, np.maximum(asked, 4e3), 0.0)
    turns = uniform_filter1d(np.where(on, 110.0 + 250.0 * (engine / 6e4) ** 0.7, 0.0), 25)
    step = float(np.median(np.diff(truth.time)))
    spun = TURNING * np.gradient(turns, step)
    torque = np.where(on, engine / np.maximum(turns, 60.0) + spun, 0.0)
    motor = power - torque * turns + spun * turns - at_brakes(truth)
    battery = np.where(motor > 0.0, motor / 0.92, motor * 0.92) + AUX
    hunting = np.where(turns > 60.0, 0.5 * np.sin(3.0 * truth.time), 0.0)
    signals = {
        "engine_torque": torque,
        "engine_speed": turns + hunting,
        "battery_current": battery / METER,
    }
    plain = without_weather(made.drive).without("engine_load", "throttle", "mass_air_flow")
    return plain.with_signals(
        *(wb.Signal(name, time, at(values)) for name, values in signals.items()),
        wb.Signal("battery_voltage", time, np.full(time.size, METER)),
    )


def at_brakes(truth):
    """Power that the motor takes in place of the brakes [W]."""
    return np.minimum(truth.brake_force * truth.speed, 2e4)


def test_engine_and_battery_together_weigh_a_power_split(driven):
    known, loaded = map(split, driven["petrol_dct"])
    mass, truth = (
        float(d[0].truth.mass[k]) for d, k in zip(driven["petrol_dct"], (0, -1), strict=True)
    )
    car = wb.calibrate(known, mass, vehicle=wb.Vehicle(kind="hybrid"))
    assert car.torque.source == "hybrid"
    weighed = wb.weigh(loaded, car)
    assert weighed.mass == pytest.approx(truth, rel=0.05)
    assert abs(weighed.mass - truth) < 2.0 * weighed.std
    assert [p.text for p in weighed.problems if p.id.startswith("frozen")] == []
    assert [w.torque for w in wb.inspect_drive(loaded, car).ways if w.chosen] == ["hybrid"]
    assert "hybrid" not in {w.torque for w in wb.inspect_drive(loaded).ways}
    # By the engine alone it would be something else.
    with refused("hybrid.battery"):
        wb.calibrate(known, mass, settings=wb.CalibrationSettings(source="measured"))


def test_a_hybrid_whose_engine_turns_with_the_wheels_is_refused(driven):
    made, _ = driven["petrol_dct"][0]
    geared = split(driven["petrol_dct"][0]).with_signals(made.drive.signals["engine_speed"])
    with refused("hybrid.geared"):
        wb.calibrate(geared, 1500.0, vehicle=wb.Vehicle(kind="hybrid"))
