"""Plausibility checks: every wrong unit is found, and a sane drive raises no alarm.

The drives are made here from closed forms: a car in bends and over a hill,
with noise, a tilted sensor and quantised speed.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.noted import refused

from weighbridge import (
    Drive,
    DriveError,
    DriveInfo,
    Signal,
    Vehicle,
    inspect_drive,
    read_drive,
    weigh,
)
from weighbridge.checks import check_drive, correct_drive
from weighbridge.messages import phrase
from weighbridge.signals import UNITS
from weighbridge.vehicle import Driveline, TorqueModel

GEARINGS = (45.0, 26.0, 17.5, 13.0, 10.5)
CAR = Vehicle(
    driveline=Driveline(gearings=GEARINGS),
    torque=TorqueModel(source="load", coefficients=(0.0, 200.0)),
)


@cache
def make_drive(seed=1, mounting=(0.02, -0.1, 0.6), duration=900.0, bends=1.0, loop=None):
    """Drive 15 min at 3 to 27 m/s through bends, at 48 degrees north; 10 to 11 min by ``loop``."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, duration, 0.02)
    v = 15.0 + 8.0 * np.sin(2 * np.pi * t / 60.0) + 4.0 * np.sin(2 * np.pi * t / 17.0)
    a = np.gradient(v, t)
    yaw_rate = 0.08 * np.sin(2 * np.pi * t / 40.0) + 0.03 * np.sin(2 * np.pi * t / 23.0) + 0.005
    yaw_rate *= np.where((t > 600.0) & (t < 660.0), loop or bends, bends)
    course = 0.7 + np.cumsum(yaw_rate) * 0.02
    grade = 0.03 * np.sin(2 * np.pi * t / 200.0)
    body = np.column_stack((a + 9.81 * grade, v * yaw_rate, np.full_like(t, -9.81)))
    rate = np.column_stack((np.zeros_like(t), np.gradient(grade, t), yaw_rate))
    # Sensor axes: the inverse of sensor to body.
    turn = Rotation.from_euler("xyz", mounting).inv()
    force = turn.apply(body) + rng.normal(0.0, 0.3, body.shape)
    rates = turn.apply(rate) + rng.normal(0.0, 0.005, body.shape) + [0.01, -0.02, 0.005]
    obd, gnss = slice(0, None, 13), slice(0, None, 50)
    north = np.cumsum(v * np.cos(course)) * 0.02
    east = np.cumsum(v * np.sin(course)) * 0.02
    gear = np.searchsorted([6.0, 11.0, 16.0, 21.0], v)
    tg = t[gnss]
    signals = [
        *(Signal(f"accel_{x}", t, force[:, k].copy()) for k, x in enumerate("xyz")),
        *(Signal(f"gyro_{x}", t, rates[:, k].copy()) for k, x in enumerate("xyz")),
        Signal("vehicle_speed", t[obd], np.round(v[obd] * 3.6) / 3.6),
        Signal("engine_speed", t[obd], (v * np.array(GEARINGS)[gear])[obd]),
        Signal("engine_load", t[obd], 0.4 + 0.3 * np.sin(t[obd])),
        Signal(
            "latitude", tg, np.radians(48.0) + (north[gnss] + rng.normal(0, 1, tg.size)) / 6.371e6
        ),
        Signal(
            "longitude",
            tg,
            np.radians(11.0)
            + (east[gnss] + rng.normal(0, 1, tg.size)) / 6.371e6 / np.cos(np.radians(48.0)),
        ),
        Signal("altitude", tg, 500.0 + np.cumsum(v * grade)[gnss] * 0.02),
        Signal("gnss_speed", tg, np.abs(v[gnss] + rng.normal(0, 0.1, tg.size))),
        Signal("gnss_course", tg, np.mod(course[gnss], 2 * np.pi)),
    ]
    return Drive("made", {s.name: s for s in signals})


@pytest.fixture(scope="module")
def sane():
    return make_drive()


def scaled(drive, **factors):
    return drive.with_signals(
        *(
            replace(drive.signals[name], values=drive.signals[name].values * factor)
            for name, factor in factors.items()
        )
    )


def renamed(drive, **names):
    moved = {new: replace(drive.signals[old], name=new) for old, new in names.items()}
    return replace(drive, signals={**drive.signals, **moved})


def serious(drive, vehicle=None):
    return [p for p in check_drive(drive, vehicle) if p.serious]


def only(drive, vehicle=None):
    """The one thing a person is told first."""
    found = serious(drive, vehicle)
    assert found, "no serious problem was found"
    assert "\n" not in found[0].text
    return found[0]


IMU = {f"{kind}_{a}": 1.0 for kind in ("accel", "gyro") for a in "xyz"}
ACCEL = ("accel_x", "accel_y", "accel_z")
GYRO = ("gyro_x", "gyro_y", "gyro_z")
GNSS = ("latitude", "longitude", "altitude", "gnss_speed", "gnss_course")


# No false alarms


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("mounting", [(0.0, 0.0, 0.0), (np.pi, 0.0, 0.3), (1.5, 0.2, -2.0)])
def test_sane_drive_in_any_mounting(seed, mounting):
    assert check_drive(make_drive(seed, mounting), CAR) == ()


@pytest.mark.parametrize(
    "lacking",
    [GNSS, ("gnss_speed",), ACCEL + GYRO, ("latitude",), ("vehicle_speed", "engine_speed"), GYRO],
)
def test_sane_drive_that_lacks_signals(sane, lacking):
    assert check_drive(sane.without(*lacking), CAR) == ()


def test_speedometer_that_reads_four_percent_high(sane):
    assert check_drive(scaled(sane, vehicle_speed=1.04)) == ()


def test_drive_in_one_gear_and_stepless_gearbox(sane):
    engine = sane.signals["engine_speed"]
    stepless = replace(engine, values=np.linspace(120.0, 260.0, len(engine)))
    assert serious(sane.without(*GNSS, *ACCEL).with_signals(stepless), CAR) == []


# Wrong units


def test_accelerometer_in_g(sane):
    assert only(scaled(sane, **dict.fromkeys(ACCEL, 1 / 9.81))).id == "imu.accel_in_g"


def test_accelerometer_in_metres_under_g(sane):
    assert only(scaled(sane, **dict.fromkeys(ACCEL, 9.81))).id == "imu.accel_in_mps2"


def test_accelerometer_without_gravity(sane):
    z = sane.signals["accel_z"]
    flat = make_drive(mounting=(0.0, 0.0, 0.0))
    z = replace(flat.signals["accel_z"], values=flat.signals["accel_z"].values + 9.81)
    assert only(flat.with_signals(z)).id == "imu.no_gravity"


def test_gyro_in_degrees(sane):
    fast = scaled(sane, **dict.fromkeys(GYRO, 180 / np.pi))
    assert only(fast).id == "imu.gyro_degrees"


def spiky(drive, value):
    """Single samples of the gyro that no car turns at."""
    hit = np.random.default_rng(3).random(len(drive.signals["gyro_x"])) < 0.004
    return drive.with_signals(
        *(replace(s, values=np.where(hit, value, s.values)) for s in map(drive.signals.get, GYRO))
    )


def test_a_few_spikes_of_a_gyro_are_no_other_unit(sane):
    assert serious(spiky(sane, 8.0)) == []
    fast = scaled(sane, **dict.fromkeys(GYRO, 180 / np.pi))
    assert only(spiky(fast, 400.0)).id == "imu.gyro_degrees"


def test_a_gyro_that_stays_at_zero_is_stuck(sane):
    still = scaled(sane, **dict.fromkeys(GYRO, 0.0))
    found = only(still)
    assert (found.id, found.signal) == ("range.stuck", "gyro_x")


def test_a_speed_that_runs_against_the_positions_is_of_another_drive(sane):
    speed = sane.signals["vehicle_speed"]
    other = Signal(speed.name, speed.time, -0.05 * speed.values)
    found = serious(sane.with_signals(other).without("gnss_speed"))
    assert any(p.id == "speed.against" for p in found)


def test_slow_gyro_in_degrees_is_seen_against_the_course():
    # A road of wide bends: too slow to stand out by itself.
    gentle = make_drive(bends=0.4)
    assert check_drive(gentle) == ()
    problem = only(scaled(gentle, **dict.fromkeys(GYRO, 180 / np.pi)))
    assert problem.id == "imu.gyro_unit"


def test_gyro_in_radians_under_degrees(sane):
    found = only(scaled(sane, **dict.fromkeys(GYRO, np.pi / 180)))
    assert (found.id, found.values["unit"]) == ("imu.gyro_unit", "rad/s")


def test_positions_that_scatter_do_not_judge_the_unit_of_a_gyro():
    # A motorway, one loop of a ramp, and two minutes of fixes that are 10 m off.
    drive = make_drive(bends=0.02, loop=1.5)
    lost = [drive.signals[name] for name in ("latitude", "longitude")]
    noise = np.random.default_rng(2).normal(0.0, 10.0 / 6.371e6, (2, len(lost[0])))
    noise *= (lost[0].time > 100.0) & (lost[0].time < 220.0)
    scattered = drive.with_signals(
        *(replace(s, values=s.values + n) for s, n in zip(lost, noise, strict=True))
    )
    assert not any(p.id == "imu.gyro_unit" for p in check_drive(scattered))
    wrong = scaled(scattered, **dict.fromkeys(GYRO, np.pi / 180))
    assert any(p.id == "imu.gyro_unit" for p in check_drive(wrong))


MPH_UNDER_KMH = 0.621371
KMH_UNDER_MPH = 1.609344


@pytest.mark.parametrize(
    ("factor", "unit", "suffix"),
    [
        (MPH_UNDER_KMH, "mph", "kmh"),
        (KMH_UNDER_MPH, "kmh", "mph"),
        (1 / 3.6, "mps", "kmh"),
        (3.6, "kmh", "mps"),
    ],
)
@pytest.mark.parametrize(
    "lacking",
    [
        (),
        ("gnss_speed",),
        ("gnss_speed", "latitude"),
        ("gnss_speed", "latitude", *ACCEL),
        ("gnss_speed", "latitude", "engine_speed"),
    ],
    ids=["gnss_speed", "positions", "gears", "gears alone", "acceleration"],
)
def test_speed_in_another_unit_is_found_by_any_source(sane, factor, unit, suffix, lacking):
    problem = only(scaled(sane, vehicle_speed=factor).without(*lacking), CAR)
    assert (problem.id, problem.signal) == ("speed.unit", "vehicle_speed")
    pair = phrase("speed_unit_pair", unit=unit, stem="vehicle_speed", suffix=suffix)
    assert pair in problem.values["texts"]


@pytest.mark.parametrize("factor", [MPH_UNDER_KMH, 1 / 3.6])
def test_speed_of_an_electric_car_is_judged_by_its_accelerometer(sane, factor):
    rng = np.random.default_rng(8)
    t = np.arange(0.0, 900.0, 0.1)
    v = 15.0 + 8.0 * np.sin(2 * np.pi * t / 60.0) + 4.0 * np.sin(2 * np.pi * t / 17.0)
    force = 1.03 * np.gradient(v, t) + 9.81 * 0.03 * np.sin(t / 30.0) + rng.normal(0.0, 0.1, t.size)
    accel = Signal("longitudinal_accel", t, force)
    right = Drive("e", {"vehicle_speed": Signal("vehicle_speed", t, v), accel.name: accel})
    assert check_drive(right) == ()
    assert only(scaled(right, vehicle_speed=factor)).values["source"] == "the acceleration"


def test_gnss_speed_in_another_unit(sane):
    problem = only(scaled(sane, gnss_speed=1 / 3.6))
    assert problem.signal == "gnss_speed"
    pair = phrase("speed_unit_pair", unit="mps", stem="speed", suffix="kmh")
    assert pair in problem.values["texts"]


def test_positions_in_radians(sane):
    problem = only(scaled(sane, latitude=np.pi / 180, longitude=np.pi / 180))
    assert problem.id == "position.radians"


def test_latitude_and_longitude_swapped(sane):
    problem = only(renamed(sane, latitude="longitude", longitude="latitude"))
    assert problem.id == "position.swapped"
    lacking = sane.without("gnss_course")
    turned = only(renamed(lacking, latitude="longitude", longitude="latitude"))
    assert turned.id == "position.swapped"


def test_load_as_a_part_of_one(sane):
    problem = only(scaled(sane, engine_load=0.01))
    assert (problem.id, problem.values["column"]) == ("range.ratio", "engine_load")


def with_torque(drive, highest):
    t = np.arange(0.0, 900.0, 0.5)
    values = 0.5 * highest * (1.0 + np.sin(t / 7.0))
    return drive.with_signals(
        Signal("engine_torque_fraction", t, values),
        Signal("reference_torque", t[:2], np.array([400.0, 400.0])),
    )


PERCENT = replace(CAR, torque=TorqueModel(source="percent"))


@pytest.mark.parametrize("highest", [0.0080, 0.0100, 0.0107, 0.0130])
def test_torque_from_zero_to_one_under_percent(sane, highest):
    drive = with_torque(sane, highest)
    for vehicle in (None, PERCENT):
        problem = only(drive, vehicle)
        assert problem.values["highest"] == pytest.approx(100 * highest)
        assert problem.id == "range.ratio"
    with pytest.raises(DriveError, match="engine_torque_ratio"):
        weigh(drive, PERCENT)
    assert serious(with_torque(sane, 100.0 * highest)) == []


def test_what_a_person_vouches_for_is_told_and_not_refused(sane):
    drive = with_torque(sane, 0.0107)
    trusted = replace(drive, info=DriveInfo(trusted=("engine_torque_fraction",)))
    assert [p.id for p in check_drive(trusted, PERCENT)] == ["range.ratio"]
    assert serious(trusted, PERCENT) == []


def test_small_percentages_of_a_vehicle_that_stands_are_no_doubt(sane):
    still = scaled(with_torque(sane, 0.0107), vehicle_speed=0.0).without(*GNSS)
    assert not any(p.id == "range.ratio" for p in check_drive(still))


@pytest.mark.parametrize("name", ["engine_load", "throttle", "accelerator_pedal"])
def test_only_the_percentage_that_is_used_is_serious(sane, name):
    t = sane.signals["engine_load"].time
    small = Signal(name, t, 0.005 + 0.005 * np.sin(t / 7.0))
    found = [p for p in check_drive(sane.with_signals(small), CAR) if p.signal == name]
    assert [p.serious for p in found] == [name == "engine_load"]


def test_load_in_percent_under_a_ratio(sane):
    found = only(scaled(sane, engine_load=100.0))
    assert (found.id, found.signal) == ("range.outside", "engine_load")
    assert (found.values["low"], found.values["high"]) == ("0 pct", "102 pct")


def test_newton_metres_under_percent(sane):
    t = np.arange(0.0, 900.0, 0.5)
    wrong = Signal("engine_torque_fraction", t, 0.01 * (120.0 + 100.0 * np.sin(t / 7.0)))
    found = only(sane.with_signals(wrong))
    assert (found.id, found.signal) == ("range.outside", "engine_torque_fraction")


def test_engine_speed_in_radians(sane):
    problem = only(scaled(sane, engine_speed=np.pi / 30))
    assert problem.id == "engine.speed_radians"


def test_a_motor_in_the_hub_turns_slowly(sane):
    speed = sane.signals["vehicle_speed"]
    hub = Signal("engine_speed", speed.time, speed.values / 0.33)
    assert "engine.speed_radians" not in {p.id for p in serious(sane.with_signals(hub))}


def test_time_in_milliseconds(sane):
    late = {n: replace(s, time=s.time * 1e3) for n, s in sane.signals.items()}
    problem = only(replace(sane, signals=late))
    assert problem.id == "clock.milliseconds"


def test_time_in_seconds_under_milliseconds(sane):
    late = {n: replace(s, time=s.time * 1e-3) for n, s in sane.signals.items()}
    problem = only(replace(sane, signals=late))
    assert problem.id == "clock.seconds"


@pytest.mark.parametrize("said", ["kmh", "mph", "mps", "kn"])
@pytest.mark.parametrize("meant", ["kmh", "mph", "mps", "kn"])
def test_advice_about_a_unit_is_never_followed_by_its_opposite(sane, said, meant):
    """Whoever declares what was advised has a right speed, or reads of a factor at once."""
    factor = UNITS[said].factor / UNITS[meant].factor
    if abs(np.log(factor)) < 0.2:
        return
    declared = replace(scaled(sane, vehicle_speed=factor), units={"vehicle_speed": said})
    found = only(declared, CAR)
    if found.id == "speed.unit":
        assert found.values["alike"] == meant
    else:
        assert found.id == "speed.factor"
        assert found.values["factor"] == pytest.approx(1.0 / factor, rel=0.05)


def test_a_speed_that_fits_no_unit_is_given_a_factor(sane):
    declared = replace(scaled(sane, vehicle_speed=1.0 / 0.447), units={"vehicle_speed": "kmh"})
    found = only(declared, CAR)
    assert found.id == "speed.factor"
    assert found.values["factor"] == pytest.approx(0.447, rel=0.02)
    alone = replace(scaled(sane.without(*ALONE), vehicle_speed=3.6), units={"vehicle_speed": "kmh"})
    assert only(alone).id == "speed.factor_doubtful"


ALONE = (*ACCEL, *GYRO, *GNSS)


@pytest.mark.parametrize("factor", [3.6, 3.6 / 1.609])
def test_a_speed_that_only_its_own_course_and_the_engine_can_doubt(sane, factor):
    found = scaled(sane.without(*ALONE), vehicle_speed=factor)
    assert only(found).id == "speed.unit_doubtful"
    trusted = replace(found, info=DriveInfo(trusted=("vehicle_speed",)))
    assert serious(trusted) == []
    assert serious(sane.without(*ALONE)) == []


def rolling(top, accel, engine=None):
    """A vehicle that starts, holds its top speed and stops, again and again."""
    t = np.arange(0.0, 900.0, 0.5)
    ramp = top / accel
    phase = t % (2.0 * ramp + 60.0)
    v = np.clip(np.minimum(phase, 2.0 * ramp + 40.0 - phase) * accel, 0.0, top)
    signals = [Signal("vehicle_speed", t, v)]
    if engine is not None:
        signals.append(Signal("engine_speed", t, np.maximum(v * engine, 80.0)))
    return Drive("made", {s.name: s for s in signals})


def first_words(name):
    """Words of a phrase before its first value."""
    values = dict.fromkeys(("top", "change", "power", "gearing", "window"), 0.0)
    return phrase(name, **values).partition("0")[0]


@pytest.mark.parametrize(
    ("top", "accel", "engine", "why", "value"),
    [
        (23.6, 0.3, 5.0, "speed_too_fast", "306"),  # a truck on the motorway
        (16.0, 1.2, None, "speed_power", ""),  # a bus in town
        (16.0, 3.4, None, "speed_grip", ""),
        (14.0, 0.5, 8.0, "speed_gear", "2.2"),  # a car that saves fuel
    ],
)
def test_kilometres_an_hour_under_metres_a_second(top, accel, engine, why, value):
    true = rolling(top, accel, engine)
    assert serious(true) == []
    found = only(scaled(true, vehicle_speed=3.6))
    assert found.id == "speed.unit_doubtful"
    assert found.values["why"].startswith(first_words(why))
    assert value in found.values["why"]


def test_trucks_are_judged_by_what_trucks_do():
    fast = rolling(50.0, 0.5)
    assert serious(fast, CAR) == []
    assert only(fast, replace(CAR, kind="truck")).id == "speed.unit_doubtful"


def test_a_speed_over_ground_alone_is_judged_too():
    t = np.arange(0.0, 900.0, 1.0)
    v = rolling(16.0, 1.2).signals["vehicle_speed"].at(t)
    drive = Drive("made", {"gnss_speed": Signal("gnss_speed", t, v)})
    assert serious(drive) == []
    found = only(scaled(drive, gnss_speed=3.6))
    assert (found.id, found.values["stem"]) == ("speed.unit_doubtful", "speed")


# Axes


def test_two_axes_swapped(sane):
    swap = {"accel_x": "accel_y", "accel_y": "accel_x", "gyro_x": "gyro_y", "gyro_y": "gyro_x"}
    assert only(renamed(sane, **swap)).id == "imu.axes_swapped"


def test_axes_of_the_accelerometer_alone_swapped(sane):
    swapped = renamed(sane, accel_x="accel_y", accel_y="accel_x")
    assert only(swapped).id == "imu.axes_swapped"
    upright = renamed(sane, accel_z="accel_y", accel_y="accel_z")
    assert only(upright).id == "imu.axes_differ"


def test_one_axis_with_the_wrong_sign(sane):
    assert only(scaled(sane, accel_y=-1.0).without(*GNSS)).id == "imu.axes_swapped"


def quiet_motorway(seed):
    """Five minutes on an even, straight road, whose pitch and roll are below the gyro's noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 310.0, 0.1)
    noise = rng.normal(size=(7, time.size))
    accel = 0.3 * np.sin(0.3 * time) + 0.2 * np.sin(0.9 * time)
    speed = 33.0 + 0.1 * np.cumsum(accel)
    force = (accel + 0.2 * noise[0], 0.2 * noise[1], 9.81 + 0.2 * noise[2])
    signals = {f"accel_{a}": f for a, f in zip("xyz", force, strict=True)}
    signals |= {f"gyro_{a}": 0.02 * n for a, n in zip("xyz", noise[3:6], strict=True)}
    signals["vehicle_speed"] = speed + 0.02 * noise[6]
    return Drive(name="quiet", signals={n: Signal(n, time, v) for n, v in signals.items()})


def test_chance_mirrors_no_axis_of_a_quiet_motorway():
    assert [
        k for k in range(60) if any(p.id.startswith("imu.") for p in check_drive(quiet_motorway(k)))
    ] == []


def test_accelerometer_that_reads_gravity_instead_of_specific_force(sane):
    problem = only(scaled(sane, **dict.fromkeys(ACCEL, -1.0)))
    assert problem.id == "imu.gyro_against_course"


def test_speed_counted_backwards(sane):
    assert only(scaled(sane, vehicle_speed=-1.0).without(*GNSS)).id == "range.outside"


# Stuck, standing, apart


@pytest.mark.parametrize("name", ["accel_y", "gyro_x", "vehicle_speed", "engine_load"])
def test_constant_signal(sane, name):
    s = sane.signals[name]
    stuck = replace(s, values=np.full(len(s), s.values[0]))
    found = [p for p in serious(sane.with_signals(stuck)) if p.signal == name]
    assert any(p.id == "range.stuck" for p in found)


def test_a_road_due_north_is_no_stuck_longitude():
    t = np.arange(0.0, 600.0, 1.0)
    v = 12.0 + 5.0 * np.sin(t / 20.0)
    signals = [
        Signal("latitude", t, np.radians(48.0) + np.cumsum(v) / 6.371e6),
        Signal("longitude", t, np.full(t.size, np.radians(11.0))),
        Signal("gnss_speed", t, v),
        Signal("gnss_course", t, np.zeros(t.size)),
    ]
    drive = Drive("made", {s.name: s for s in signals})
    assert serious(drive) == []
    found = only(drive.without("gnss_course"))
    assert (found.id, found.signal, found.values["value"]) == ("range.stuck", "longitude", "11 deg")


@pytest.mark.parametrize("name", ["latitude", "longitude"])
def test_a_stuck_position_against_the_course(sane, name):
    s = sane.signals[name]
    stuck = sane.with_signals(replace(s, values=np.full(len(s), s.values[0])))
    assert any((p.id, p.signal) == ("range.stuck", name) for p in serious(stuck))


def test_only_what_the_torque_source_needs_is_serious(sane):
    load = sane.signals["engine_load"]
    stuck = with_torque(sane, 0.9).with_signals(replace(load, values=np.full(len(load), 0.5)))
    for vehicle, expected in ((PERCENT, False), (CAR, True), (None, False)):
        found = [p for p in check_drive(stuck, vehicle) if p.signal == "engine_load"]
        assert [p.serious for p in found] == [expected]
    assert serious(stuck.without("engine_torque_fraction")) != []
    # Its reference torque may come with a vehicle file, or load may have to do.
    assert serious(stuck.without("reference_torque")) != []


def test_sensor_that_froze_on_the_way(sane):
    s = sane.signals["accel_x"]
    values = s.values.copy()
    values[1000:1500] = values[1000]
    (note,) = check_drive(sane.with_signals(replace(s, values=values)))
    assert not note.serious
    assert note.id == "frozen.imu"
    assert note.values["at"] == "20 s"
    assert f"{note.values['longest']:.1f}" == "10.0"
    values[1000:20000] = values[1000]
    (note,) = check_drive(sane.with_signals(replace(s, values=values)))
    assert note.id == "frozen.imu"
    assert f"{note.values['longest']:.1f}" == "380.0"
    values[1000:] = values[1000]
    found = serious(sane.with_signals(replace(s, values=values)))
    assert any(p.id == "frozen.imu_all" for p in found)


@pytest.mark.parametrize(
    ("level", "until", "expected"),
    [(0.5, 1500, "frozen.imu"), (1.0, 1500, "imu.gyro_clipped"), (1.0, None, "imu.gyro_clipped")],
)
def test_a_gyro_that_repeats_a_value_is_at_its_limit_only_where_that_is_the_highest(
    sane, level, until, expected
):
    s = sane.signals["gyro_z"]
    values = s.values.copy()
    held = level * float(np.abs(values).max())
    values[1000:until] = held
    if until:
        values[3000:3500] = held
    (note,) = [
        p for p in check_drive(sane.with_signals(replace(s, values=values))) if p.signal == "gyro_z"
    ]
    assert note.id == expected
    # What is left is too little to show how the sensor sits.
    assert note.serious == (until is None)


def test_an_hour_of_standstill_is_a_note():
    t = np.arange(0.0, 3600.0, 0.1)
    rng = np.random.default_rng(0)
    still = Drive(
        "still",
        {
            "vehicle_speed": Signal("vehicle_speed", t, np.zeros(t.size)),
            "engine_torque": Signal("engine_torque", t, np.zeros(t.size)),
            **{
                f"accel_{a}": Signal(f"accel_{a}", t, rng.normal(g, 0.01, t.size))
                for a, g in (("x", 0.0), ("y", 0.0), ("z", -9.81))
            },
        },
    )
    (note,) = check_drive(still)
    assert not note.serious
    assert note.id == "speed.stands"
    assert f"{note.values['duration']:.0f}" == "3600"


def test_a_long_stop_and_a_cut_are_notes():
    t = np.arange(0.0, 2000.0, 0.1)
    v = np.where(t < 500.0, 10.0 + 5.0 * np.sin(t / 20.0), 0.0)
    v = np.where(t > 1500.0, 10.0 * (1.0 - np.exp(-(t - 1500.0) / 10.0)), v)
    notes = check_drive(Drive("d", {"vehicle_speed": Signal("vehicle_speed", t, v)}))
    assert [n.serious for n in notes] == [False, False]
    assert notes[0].id == "speed.standstill"
    assert notes[0].values["at"] == "500 s"
    assert f"{notes[0].values['minutes']:.0f}" == "17"
    assert notes[1].id == "speed.jumps"


def test_values_out_of_range(sane):
    s = sane.signals["vehicle_speed"]
    few, many = s.values.copy(), s.values.copy()
    few[5] = 200.0
    many[::20] = 200.0
    (note,) = [
        p
        for p in check_drive(sane.with_signals(replace(s, values=few)))
        if p.values.get("count") == 1
    ]
    assert not note.serious
    assert (note.values["value"], note.values["at"]) == ("720 kmh", "1.3 s")
    found = serious(sane.with_signals(replace(s, values=many)))
    assert any(p.values.get("low") == "-28.8 kmh" for p in found)


def test_tables_of_different_clocks(sane):
    late = [replace(s, time=s.time + 1e6) for n, s in sane.signals.items() if n in GNSS]
    problem = only(sane.with_signals(*late))
    assert problem.id == "clock.apart"


def test_clock_that_jumps_a_day(sane):
    s = sane.signals["vehicle_speed"]
    time = s.time.copy()
    time[-10:] += 1e9
    settled = correct_drive(Drive("d", {s.name: replace(s, time=time)}))
    assert not any(p.serious for p in settled.problems)
    assert settled.duration < 1000.0
    assert settled.problems[0].id == "clock.jump_cut"
    assert f"{settled.problems[0].values['by']:.6g}" == "1e+09"
    assert settled.problems[0].values["rows"] == "10 of obd"
    assert settled.problems[0].id == "clock.jump_cut"


def shifted(drive, names, after, by):
    moved = [drive.signals[n] for n in names]
    return drive.with_signals(
        *(replace(s, time=np.where(s.time > after, s.time + by, s.time)) for s in moved)
    )


@pytest.mark.parametrize("by", [120.0, 3600.0, 18000.0])
def test_clock_set_forward_by_less_than_a_day_is_a_note(sane, by):
    (note,) = check_drive(shifted(sane, sane.signals, 400.0, by), CAR)
    assert not note.serious
    assert (note.id, note.start, note.values["length"]) == (
        "clock.pause", pytest.approx(400.0, abs=0.5), pytest.approx(by, abs=0.5),
    )  # fmt: skip
    assert note.values["why"] == phrase("pause_moving")
    assert note.id == "clock.pause"


def test_pauses_while_the_vehicle_stands_are_told_once():
    once = rolling(14.0, 0.5).signals["vehicle_speed"]
    speed = once.values * np.clip((900.0 - once.time) / 30.0 - 0.5, 0.0, 1.0)
    time = np.concatenate([once.time + 1000.0 * k for k in range(3)])
    s = Signal("vehicle_speed", time, np.tile(speed, 3))
    (note,) = check_drive(Drive("made", {s.name: s}))
    assert (note.id, note.values["at"]) == ("clock.pause", "899.5 s")
    assert note.values["several"] == phrase("times_longest", count=2)
    assert note.values["why"] == phrase("pause_standing")


def test_one_table_that_pauses_is_told(sane):
    cut = {n: s for n, s in sane.signals.items() if n in GNSS}
    kept = [
        replace(s, time=s.time[(s.time < 300.0) | (s.time > 420.0)],
                values=s.values[(s.time < 300.0) | (s.time > 420.0)])
        for s in cut.values()
    ]  # fmt: skip
    # As far apart as the vehicle went: a tunnel, and no word.
    assert list(check_drive(sane.with_signals(*kept), CAR)) == []
    # The same without a speed to tell the way by.
    blind = Drive("made", {s.name: s for s in (*kept, sane.signals["accel_x"])})
    (note,) = [p for p in check_drive(blind, CAR) if p.id == "clock.table_pause"]
    assert note.values["at"] == "299 s"
    assert f"{note.values['length']:.0f}" == "122"


def test_a_clock_of_gnss_that_was_set_forward_is_no_tunnel(sane):
    late = [
        replace(s, time=np.where(s.time < 300.0, s.time, s.time + 120.0))
        for n, s in sane.signals.items()
        if n in GNSS
    ]
    assert any(p.id == "clock.table_pause" for p in check_drive(sane.with_signals(*late), CAR))


def test_weigh_refuses_a_serious_problem(sane):
    with refused("speed.unit", stem="vehicle_speed", alike="mph"):
        weigh(scaled(sane, vehicle_speed=MPH_UNDER_KMH), CAR)


def test_wrong_header_is_found_from_file_to_sentence(tmp_path, sane):
    from weighbridge.io import write_drive

    write_drive(sane, tmp_path, "csv")
    text = (tmp_path / "obd.csv").read_text(encoding="utf-8")
    assert "vehicle_speed_kmh" in text
    (tmp_path / "obd.csv").write_text(
        text.replace("vehicle_speed_kmh", "vehicle_speed_mph"), encoding="utf-8"
    )
    pair = phrase("speed_unit_pair", unit="kmh", stem="vehicle_speed", suffix="mph")
    assert pair in only(read_drive(tmp_path)).values["texts"]


# Inspection


def test_report_of_a_signal():
    time = np.array([0.0, 1.0, 2.0, 3.0, 20.0, 21.0])
    drive = Drive("d", {"vehicle_speed": Signal("vehicle_speed", time, np.arange(6.0))})
    (report,) = inspect_drive(drive).signals
    assert report.count == 6
    assert report.rate == pytest.approx(5 / 21)
    assert report.period == 1.0
    assert report.gaps == 1
    assert report.longest_gap == 17.0
    assert report.jitter == 0.0
    assert (report.low, report.high) == pytest.approx((0.0, 18.0))
    assert report.unit == "kmh"


def test_ways_follow_from_signals(sane):
    found = inspect_drive(sane, CAR)
    assert found.problems == ()
    assert [s.name for s in found.signals][:2] == ["accel_x", "accel_y"]
    possible = [w for w in found.ways if w.possible and w.torque != "speed"]
    assert {w.torque for w in possible} == {"load"}
    assert {w.motion for w in possible} == {"inertial", "speed_grade", "speed"}
    (chosen,) = (w for w in found.ways if w.chosen)
    assert chosen.motion == "inertial"
    air = next(w for w in found.ways if (w.motion, w.torque) == ("inertial", "air_flow"))
    assert air.needs == ("mass_air_flow",)


def test_drive_without_torque_has_no_way(sane):
    found = inspect_drive(sane.without("engine_load"))
    *with_torque, by_speed = found.ways
    assert not any(w.possible for w in with_torque)
    assert not any(w.chosen for w in found.ways)
    assert all(w.needs for w in with_torque)
    assert by_speed.torque == "speed"
    assert by_speed.possible


def test_drive_without_speed_has_no_way_at_all(sane):
    found = inspect_drive(sane.without("vehicle_speed", "gnss_speed", "latitude", "longitude"))
    assert not any(w.possible for w in found.ways)
    assert found.ways[-1].needs == ("vehicle_speed",)


def test_what_to_expect_follows_the_rate_of_the_torque():
    drive = make_drive()
    fast = Signal("engine_load", np.arange(0.0, 800.0, 0.25), np.full(3200, 0.3))
    speed = Signal("engine_speed", fast.time, np.full(3200, 200.0))
    slow = [every_fourth(s) for s in (fast, speed)]
    best = [
        inspect_drive(drive.with_signals(*signals), CAR).ways[0].accuracy
        for signals in ((fast, speed), slow)
    ]
    assert best == ["0.5–3.3 %", "1–3.3 %"]


def every_fourth(signal):
    return Signal(signal.name, signal.time[::4], signal.values[::4])


def retarded(sign, trusted=()):
    """A drive whose retarder works every now and then."""
    t = np.arange(0.0, 900.0, 0.2)
    works = sign * np.clip(np.sin(t / 30.0) - 0.8, 0.0, None)
    drive = make_drive().with_signals(Signal("retarder_torque", t, works))
    return replace(drive, info=DriveInfo(trusted=frozenset(trusted)))


def test_a_retarder_that_counts_braking_positive_is_refused_until_it_is_turned():
    assert only(retarded(1.0)).signal == "retarder_torque"
    assert only(retarded(1.0)).id == "retarder.sign"
    assert serious(retarded(-1.0)) == []
    assert serious(retarded(1.0, trusted=["retarder_torque"])) == []
    assert serious(retarded(0.0)) == []
