"""Faults of torque, load and engine speed: mended where the rest can tell, else no mass."""

from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter
from tests.noted import noted, refused

import weighbridge as wb
from weighbridge import Drive, Signal, Status, Vehicle
from weighbridge.checks import check_drive, correct_drive
from weighbridge.errors import DriveError
from weighbridge.estimators import ESTIMATORS, contradicted
from weighbridge.estimators.joint import changing
from weighbridge.navigation import without_accelerometer
from weighbridge.pipeline.weighing import weigh_balance
from weighbridge.signals import QUANTITIES, Problem
from weighbridge.simulation import make_scenario, simulate_car
from weighbridge.vehicle import DraggedReading, Driveline, TorqueModel

joint = ESTIMATORS["joint"]

SOURCE = {"car": "engine_load", "truck": "engine_torque_fraction", "electric": "engine_torque"}
STEPS = {"car": 1.0 / 255.0, "truck": 0.01, "electric": 0.5}
"""In which each control unit sends it [SI]."""
MADE_BY = {"car": "car-calibration", "truck": "truck-calibration", "electric": "electric"}


FOOT = 0.3048


def as_sent(kind, change):
    """Return a change that the control unit itself makes: it sends its steps all the same."""
    return lambda t, x: np.round(change(t, x) / STEPS[kind]) * STEPS[kind]


class Fleet:
    """Simulated vehicles with their files and one drive each."""

    def __init__(self):
        self.made, self.files, self.undamaged = {}, {}, {}
        for kind, name in MADE_BY.items():
            known = self.simulated(name, 900, 1500.0)
            car = known.scenario.car
            bare = Vehicle(kind=car.kind, driveline=Driveline(wheel_radius=car.wheel_radius))
            mass = float(known.truth.mass[0])
            self.files[kind] = wb.calibrate([known.drive], mass=mass, vehicle=bare)
            self.made[kind] = self.simulated(kind, 2, 1200.0)

    @staticmethod
    def simulated(name, seed, duration):
        made = make_scenario(name, payload=200.0, seed=seed)
        sensors = replace(made.sensors, imu_rate=50.0)
        return simulate_car(replace(made, duration=duration, sensors=sensors))

    def drive(self, kind):
        return self.made[kind].drive

    def mass(self, kind):
        return float(self.made[kind].truth.mass[-1])

    def weigh(self, kind, drive, method="joint"):
        return wb.weigh(drive, self.files[kind], method)

    def weighed(self, kind):
        """Weigh the drive as it is, once."""
        if kind not in self.undamaged:
            self.undamaged[kind] = self.weigh(kind, self.drive(kind))
        return self.undamaged[kind]

    def weigh_alone(self, kind, drive, method="joint"):
        """Weigh by a file without witnesses of the torque's reading."""
        return wb.weigh(drive, replace(self.files[kind], witnesses=()), method)


@pytest.fixture(scope="module")
def fleet():
    return Fleet()


def with_signal(drive, name, change):
    s = drive.signals[name]
    return drive.with_signals(Signal(name, s.time, change(s.time - drive.start, s.values.copy())))


def frozen_from(begin):
    def change(t, x):
        x[t >= begin] = x[np.argmax(t >= begin)]
        return x

    return change


def right(fleet, kind, weighing):
    assert weighing.status is Status.CONVERGED, weighing.reason
    assert weighing.mass == pytest.approx(fleet.mass(kind), rel=0.035)
    assert abs(weighing.mass - fleet.mass(kind)) < 2.6 * weighing.std


@pytest.mark.parametrize("kind", SOURCE)
def test_an_undamaged_drive_is_left_as_it_is(fleet, kind):
    drive = fleet.drive(kind)
    kept = correct_drive(drive, fleet.files[kind])
    assert kept.problems == ()
    assert all(np.array_equal(kept.signals[n].values, s.values) for n, s in drive.signals.items())
    right(fleet, kind, fleet.weighed(kind))


@pytest.mark.parametrize("kind", SOURCE)
@pytest.mark.parametrize("name", ["torque", "engine_speed", "vehicle_speed"])
def test_a_signal_that_freezes_is_weighed_by_the_rest(fleet, kind, name):
    name = SOURCE[kind] if name == "torque" else name
    damaged = with_signal(fleet.drive(kind), name, frozen_from(600.0))
    found = fleet.weigh(kind, damaged)
    assert any((p.id, p.signal) == ("frozen.signal", name) for p in found.problems)
    right(fleet, kind, found)


def test_a_dragged_engine_in_whole_percent_is_not_frozen(fleet):
    # Downhill for a minute: speed and engine speed change, drag rounds to one value.
    drive = fleet.drive("truck")
    reading = drive.signals["engine_torque_fraction"]
    time = reading.time - drive.start
    downhill = (time > 600.0) & (time < 660.0)
    speed = 15.0 + 6.0 * np.sin((time - 600.0) / 8.0)
    lowest, highest = reading.values.min(), reading.values.max()

    def held_at(part):
        value = lowest + part * (highest - lowest)
        steady = drive.with_signals(
            Signal(reading.name, reading.time, np.where(downhill, value, reading.values)),
            Signal(
                "vehicle_speed",
                reading.time,
                np.where(downhill, speed, drive.signals["vehicle_speed"].at(reading.time)),
            ),
        )
        return len(reading) - len(correct_drive(steady).signals[reading.name])

    assert held_at(0.04) == 0
    assert held_at(0.08) > 100


@pytest.mark.parametrize(("value", "left_out"), [(0.0, False), (60.0, True)])
def test_an_engine_that_stands_has_no_torque_to_freeze(fleet, value, left_out):
    # A hybrid drives by its motor for a minute; or the bus falls silent, and only speed goes on.
    drive = fleet.drive("truck").without("engine_torque_fraction", "reference_torque")
    time = np.arange(drive.start + 1.0, drive.end - 1.0, 0.2)
    alone = (time > 600.0) & (time < 660.0)
    torque = np.where(alone, value, 100.0 + 80.0 * np.sin(time))
    turning = np.where(alone, 0.0, 150.0 + 20.0 * np.sin(0.3 * time))
    speed = 15.0 + 6.0 * np.sin(time / 8.0)
    names = ("engine_torque", "engine_speed", "vehicle_speed")
    made = [Signal(n, time, v) for n, v in zip(names, (torque, turning, speed), strict=True)]
    kept = correct_drive(Drive("alone", {s.name: s for s in made}))
    assert (len(kept.signals["engine_torque"]) < time.size - 100) == left_out


def test_a_level_the_reading_comes_back_to_is_not_frozen(fleet):
    # Overrun through the gears: the control unit tells one value above its lowest each time.
    drive = fleet.drive("truck")
    reading = drive.signals["engine_torque_fraction"]
    time = reading.time - drive.start
    coast = np.where((time > 300.0) & (time % 100.0 < 12.0), time // 100.0, 0.0).astype(int)
    moving = Signal("vehicle_speed", reading.time, 15.0 + 3.0 * np.sin(time))
    turning = Signal("engine_speed", reading.time, 10.0 * moving.values)

    def marked(value):
        held = Signal(reading.name, reading.time, np.where(coast > 0, value, reading.values))
        kept = correct_drive(Drive("coasts", {s.name: s for s in (held, moving, turning)}))
        return len(reading) - len(kept.signals[reading.name])

    span = np.ptp(reading.values)
    assert marked(reading.values.min() + 0.08 * span) == 0
    assert marked(reading.values.min() + (0.08 + 0.01 * coast) * span) > 100


def without_quick_changes(span):
    def change(t, x):
        return uniform_filter1d(x, round(span / np.median(np.diff(t))))

    return change


@pytest.mark.parametrize("kind", ["car", "truck"])
def test_a_torque_that_is_smoothed_gives_no_mass(fleet, kind):
    smoothed = with_signal(fleet.drive(kind), SOURCE[kind], without_quick_changes(6.0))
    for method in ("joint", "rls", "robust-rls", "ekf", "hybrid"):
        found = fleet.weigh_alone(kind, smoothed, method)
        assert found.status is Status.INCONSISTENT
        assert found.reason_id == "torque.smoothed"
        assert np.isnan(found.mass)


@pytest.mark.parametrize("kind", ["car", "truck", "electric"])
def test_a_smoothed_torque_is_found_without_an_inertial_sensor(fleet, kind):
    inertial = [n for n in fleet.drive(kind).signals if n.startswith(("accel_", "gyro_"))]
    drive = fleet.drive(kind).without(*inertial)
    assert fleet.weigh_alone(kind, drive).status is Status.CONVERGED
    smoothed = with_signal(drive, SOURCE[kind], without_quick_changes(6.0))
    assert fleet.weigh_alone(kind, smoothed).reason_id == "torque.smoothed"


def test_a_torque_through_a_filter_of_seconds_is_found(fleet):
    def filtered(t, x):
        share = 1.0 - np.exp(-float(np.median(np.diff(t))) / 1.6)
        return lfilter([share], [1.0, share - 1.0], x, zi=[(1.0 - share) * x[0]])[0]

    slow = with_signal(fleet.drive("car"), SOURCE["car"], filtered)
    reading = slow.signals[SOURCE["car"]]
    slow = slow.with_signals(replace(reading, time=reading.time - 0.9))
    assert fleet.weigh_alone("car", slow).reason_id == "torque.smoothed"


@pytest.fixture(scope="module", params=["car", "truck", "electric"])
def once_a_second(fleet, request):
    """One drive without an inertial sensor, its bus once a second, and a file from such a one."""
    kind = request.param

    def thinned(drive):
        # The air flow would show it by itself.
        beside = ("accel_", "gyro_", "mass_air_flow")
        bus = drive.without(*(n for n in drive.signals if n.startswith(beside)))
        wanted = np.arange(bus.start + 1.0, bus.end - 1.0)
        kept = []
        for s in bus.signals.values():
            at = np.searchsorted(s.time, wanted, side="right") - 1
            at = np.unique(at[at >= 0])
            kept.append(Signal(s.name, s.time[at], s.values[at]))
        return bus.with_signals(*kept)

    known = fleet.simulated(MADE_BY[kind], 900, 1500.0)
    bare = Vehicle(
        kind=known.scenario.car.kind,
        driveline=Driveline(wheel_radius=known.scenario.car.wheel_radius),
    )
    mass = float(known.truth.mass[0])
    file = wb.calibrate([thinned(known.drive)], mass=mass, vehicle=bare)
    return kind, thinned(fleet.drive(kind)), file


@pytest.mark.parametrize("span", [2.0, 4.0])
def test_a_torque_once_a_second_that_is_smoothed_gives_no_mass(fleet, once_a_second, span):
    kind, drive, vehicle = once_a_second
    found = wb.weigh(drive, vehicle)
    assert abs(found.mass / fleet.mass(kind) - 1.0) < max(0.05, 3.0 * found.std / found.mass)

    def filtered(t, x):
        share = 1.0 - np.exp(-1.0 / span)
        return lfilter([share], [1.0, share - 1.0], x, zi=[(1.0 - share) * x[0]])[0]

    slow = with_signal(drive, SOURCE[kind], as_sent(kind, filtered))
    try:
        reason = wb.weigh(slow, vehicle).reason_id
    except wb.DriveError as error:
        reason = error.problem.id
    assert reason in ("torque.slower", "clock.torque_apart")


def test_a_noisy_accelerometer_is_not_taken_for_a_smoothed_torque(fleet):
    rng = np.random.default_rng(5)
    drive = with_signal(
        fleet.drive("car"), "accel_x", lambda t, x: x + rng.normal(0.0, 2.4, x.size)
    )
    right(fleet, "car", fleet.weigh_alone("car", drive))


def test_a_sensor_that_is_too_noisy_is_left_out(fleet):
    drive = fleet.drive("electric")
    rng = np.random.default_rng(11)
    for name in ("accel_x", "accel_y", "accel_z"):
        values = drive.signals[name].values
        shaken = values + rng.normal(0.0, 3.0, values.size)
        drive = drive.with_signals(replace(drive.signals[name], values=shaken))
    found, less = fleet.weigh("electric", drive), without_accelerometer(drive)
    assert found.mass == fleet.weigh("electric", less).mass
    assert found.problems[0].id == "imu.left_out"
    assert abs(found.mass - fleet.mass("electric")) < 1.96 * found.std


def test_a_torque_of_the_other_sign_is_blamed_on_nothing_else(fleet):
    drive = fleet.drive("electric")
    turned = with_signal(drive, SOURCE["electric"], lambda t, x: -x)
    with refused("torque.sign"):
        fleet.weigh_alone("electric", turned)


def test_a_change_of_scale_that_is_likely_and_not_sure_is_told():
    change = changing.ScaleChange(900.0, 900.0, 0.15, 0.01, 6.4)
    assert not change.sure
    assert change.doubt.id == "load.change_doubtful"
    assert f"{change.doubt.values['change']:+.0f}" == "+15"
    assert replace(change, gain=2.0).doubt is None
    assert replace(change, gain=20.0).doubt is None
    assert replace(change, change=0.04).doubt is None
    by_stops = replace(change, gain=-2.0, over_one=20.0)
    assert by_stops.doubt.id == "load.change_or_stop"
    assert replace(by_stops, change=0.04).doubt is None
    assert replace(by_stops, over_one=6.0).doubt is None


@pytest.mark.parametrize("kind", SOURCE)
def test_a_torque_averaged_over_half_a_second_is_weighed(fleet, kind):
    averaged = with_signal(fleet.drive(kind), SOURCE[kind], without_quick_changes(0.5))
    right(fleet, kind, fleet.weigh(kind, averaged))


def test_a_signal_that_ends_is_told(fleet):
    drive = fleet.drive("car")
    s = drive.signals["engine_load"]
    kept = s.time < drive.start + 600.0
    found = fleet.weigh("car", drive.with_signals(Signal(s.name, s.time[kept], s.values[kept])))
    assert any(w.id == "file.ends_early" for w in found.problems)
    right(fleet, "car", found)


@pytest.mark.parametrize("kind", SOURCE)
@pytest.mark.parametrize("ramp", [False, True])
def test_torque_whose_scale_changes_while_driving_gives_no_mass(fleet, kind, ramp):
    def change(t, x):
        return x * (1.0 - 0.25 * (np.clip((t - 500.0) / 700.0, 0.0, 1.0) if ramp else t > 500.0))

    damaged = with_signal(fleet.drive(kind), SOURCE[kind], as_sent(kind, change))
    found = fleet.weigh_alone(kind, damaged)
    assert found.status is Status.INCONSISTENT
    assert found.reason_id == "load.change_moving"
    assert np.isnan(found.mass)


@pytest.mark.parametrize("method", ["rls", "robust-rls", "ekf", "hybrid"])
def test_every_method_obeys_a_scale_that_changes(fleet, method):
    def change(t, x):
        return x * np.where(t > 500.0, 1.25, 1.0)

    damaged = with_signal(fleet.drive("truck"), SOURCE["truck"], as_sent("truck", change))
    found = fleet.weigh("truck", damaged, method)
    assert np.isnan(found.mass)
    weighed = {w.method: w for w in fleet.weigh("truck", damaged).compare()}
    assert np.isnan(weighed[method].mass)


@pytest.mark.parametrize("method", ["joint", "rls", "robust-rls", "ekf", "hybrid"])
def test_air_flow_shows_a_load_that_is_scaled(fleet, method):
    (witness,) = fleet.files["car"].witnesses
    assert witness.signal == "mass_air_flow"
    damaged = with_signal(fleet.drive("car"), "engine_load", as_sent("car", lambda _, x: 0.8 * x))
    with refused("torque.witness", scale=pytest.approx(0.8, abs=0.005)):
        fleet.weigh("car", damaged, method)


def test_a_load_that_changes_at_stops_is_no_change_of_scale(fleet):
    made = make_scenario("car-loading", payload=0.0, seed=3)
    sensors = replace(made.sensors, imu_rate=50.0)
    drive = simulate_car(replace(made, duration=1500.0, sensors=sensors))
    found = fleet.weigh("car", drive.drive)
    assert found.status is Status.CONVERGED
    assert len(found.segments) == 2


def test_engine_speed_of_twice_the_idle_is_refused(fleet):
    """In a gearbox of many even steps it fits another gear as well."""
    for kind in ("car", "truck"):
        with refused("engine.idle"):
            fleet.weigh(kind, with_signal(fleet.drive(kind), "engine_speed", lambda t, x: 2.0 * x))


@pytest.mark.parametrize("scale", [1.41, 0.7])
def test_engine_speed_a_gear_step_off_gives_no_mass(fleet, scale):
    damaged = with_signal(fleet.drive("car"), "engine_speed", lambda t, x: x * scale)
    for method in ("joint", "rls"):
        found = fleet.weigh_alone("car", damaged, method)
        assert found.status is Status.INCONSISTENT
        assert "gearing" in found.reason
    if scale > 1.0:
        told = float(found.reason.partition(" is ")[2].partition(" times")[0])
        assert told == pytest.approx(scale, rel=0.015)


@pytest.mark.parametrize("kind", ["car", "truck"])
def test_a_speed_whose_unit_changes_without_gnss_is_weighed_by_a_part_or_refused(fleet, kind):
    gnss = ("gnss_speed", "gnss_course", "latitude", "longitude", "altitude", "gnss_accuracy")
    blind = fleet.drive(kind).without(*gnss)
    right(fleet, kind, fleet.weigh(kind, blind))
    speed = blind.signals["vehicle_speed"]
    begins = [b for b in (450.0, 600.0, 750.0, 900.0) if speed.at(blind.start + b) > 6.0]
    assert len(begins) >= 2
    for begin, factor in product(begins, (1.609344, 1.0 / 1.609344)):
        change = partial(rescaled, begin, factor)
        found = weighed_or_refused(fleet, kind, with_signal(blind, "vehicle_speed", change))
        if isinstance(found, Problem):
            assert found.id in ("speed.jumps", "speed.unit", "speed.unit_of_accel")
        else:
            assert any(p.id == "clock.splices" for p in found.problems)
            right(fleet, kind, found)


def weighed_or_refused(fleet, kind, drive):
    """Weighing of a drive, or the problem by which it is refused."""
    try:
        return fleet.weigh(kind, drive)
    except DriveError as error:
        return error.problem


def rescaled(begin, factor, time, values):
    return np.where(time > begin, values / factor, values)


@pytest.mark.parametrize("kind", ["truck", "electric"])
@pytest.mark.parametrize(("part", "full"), [(0.03, False), (0.1, True)])
def test_dropouts_and_full_scale_are_left_out(fleet, kind, part, full):
    rng = np.random.default_rng(4)

    def change(t, x):
        level = (1.0 if kind == "truck" else 1.05 * x.max()) if full else 0.0
        return np.where(rng.random(x.size) < part, level, x)

    found = fleet.weigh(kind, with_signal(fleet.drive(kind), SOURCE[kind], change))
    assert any(w.id == "torque.dropouts" for w in found.problems)
    right(fleet, kind, found)


@pytest.mark.parametrize("kind", SOURCE)
def test_a_torque_renewed_once_a_second(fleet, kind):
    def change(t, x):
        first = np.concatenate(([True], np.diff(np.floor(t)) > 0.0))
        return x[np.maximum.accumulate(np.where(first, np.arange(t.size), 0))]

    found = fleet.weigh(kind, with_signal(fleet.drive(kind), SOURCE[kind], change))
    assert any(w.id == "range.repeats" for w in found.problems)
    right(fleet, kind, found)


@pytest.mark.parametrize("change", [np.abs, lambda x: np.maximum(x, 0.0)])
def test_a_torque_that_lost_its_sign(fleet, change):
    damaged = with_signal(fleet.drive("truck"), SOURCE["truck"], lambda t, x: change(x))
    found = fleet.weigh("truck", damaged)
    assert any(w.id == "torque.sign_lost" for w in found.problems)
    right(fleet, "truck", found)


@pytest.mark.parametrize("kind", ["car", "truck"])
def test_a_reading_that_is_cut_off(fleet, kind):
    damaged = with_signal(
        fleet.drive(kind), SOURCE[kind], lambda t, x: np.minimum(x, 0.7 * x.max())
    )
    found = fleet.weigh(kind, damaged)
    assert any(w.id == "torque.cut_off" for w in found.problems)
    right(fleet, kind, found)


def test_cells_out_of_range_are_left_out(fleet):
    rng = np.random.default_rng(6)
    damaged = with_signal(
        fleet.drive("truck"),
        SOURCE["truck"],
        lambda t, x: np.where(rng.random(x.size) < 0.005, 1e6, x),
    )
    found = fleet.weigh("truck", damaged)
    assert any(w.id == "range.outside" for w in found.problems)
    right(fleet, "truck", found)


def test_a_reading_with_shifts_and_full_load_is_no_fault():
    time = np.arange(0.0, 400.0, 0.2)
    load = 0.5 + 0.3 * np.sin(time / 7.0)
    shifts = np.flatnonzero(np.diff(np.floor(time / 9.0))) + 1
    load[shifts] = 0.0
    speed = 15.0 + np.sin(time / 11.0)
    engine = 13.0 * speed * (1.0 + 0.3 * (np.floor(time / 9.0) % 2))
    signals = {
        n: Signal(n, time, x)
        for n, x in (("engine_load", load), ("engine_speed", engine), ("vehicle_speed", speed))
    }

    def dropouts(signals):
        kept = correct_drive(Drive("shifts", signals)).signals["engine_load"].time
        return np.setdiff1d(time, kept)

    assert dropouts(signals).size == 0
    steady = {**signals, "engine_speed": Signal("engine_speed", time, 13.0 * speed)}
    assert np.array_equal(dropouts(steady), time[shifts])
    gentle = Signal("engine_load", time, np.minimum(load, 0.6))

    def found(*highest):
        model = TorqueModel(source="load", load_range=(0.0, *highest) if highest else None)
        drive = correct_drive(
            Drive("gentle", {**signals, gentle.name: gentle}), Vehicle(torque=model)
        )
        assert drive.signals["engine_load"].values.max() < 0.6
        return {p.id for p in drive.problems}

    assert "torque.cut_off" in found(1.0)
    # A calibration ended there too, or was none: the torque is at the end of its reading, or above.
    for highest in ((0.61,), ()):
        assert "torque.at_limit" in found(*highest)
        assert "torque.cut_off" not in found(*highest)


def test_what_a_person_vouches_for_stays(fleet):
    damaged = with_signal(fleet.drive("electric"), "engine_torque", frozen_from(600.0))
    trusted = replace(damaged, info=replace(damaged.info, trusted=("engine_torque",)))
    kept = correct_drive(trusted, fleet.files["electric"])
    assert len(kept.signals["engine_torque"]) == len(damaged.signals["engine_torque"])


def test_indicated_speed_lies_on_the_gears_too(fleet):
    result = fleet.weighed("electric").result
    vehicle = fleet.files["electric"]
    line = replace(vehicle.driveline, speed_scale=1.07)
    table = result.balance.table
    indicated = replace(result.balance, table=replace(table, speed=1.07 * table.speed))
    drive, known = fleet.drive("electric"), replace(vehicle, driveline=line)
    foreign = weigh_balance(drive, vehicle, "joint", indicated)
    assert foreign.reason_id == "gear.foreign"
    assert foreign.refusal.values["share"] < 10.0
    unknown = replace(vehicle, driveline=Driveline())
    for car in (known, unknown):
        assert weigh_balance(drive, car, "joint", indicated).reason_id != "gear.foreign"


def test_a_speed_ten_percent_off_is_not_in_miles():
    even = (104.1, 81.33, 63.21, 49.14, 38.78, 30.11, 22.86, 17.79, 13.83, 10.77, 8.47, 6.62)
    uneven = (58.14, 30.01, 17.42, 11.48, 9.09, 7.81)
    time = np.arange(0.0, 600.0, 0.5)
    speed = 13.0 - 12.0 * np.cos(time / 60.0)

    def told(gears, scale):
        gear = np.searchsorted(np.linspace(2.0, 20.0, len(gears) - 1), speed)
        signals = {
            "vehicle_speed": Signal("vehicle_speed", time, scale * speed),
            "engine_speed": Signal("engine_speed", time, speed * np.array(gears)[gear]),
        }
        truck = Vehicle(kind="truck", driveline=Driveline(gearings=gears))
        return [p for p in check_drive(Drive("x", signals), truck) if p.id.startswith("speed.")]

    assert told(even, 1.1) == []
    assert told(uneven, 1.1) == []
    assert any(
        p.id == "speed.unit" and "mph" in p.values["texts"] for p in told(uneven, 1.0 / 1.609344)
    )


def test_lighter_than_all_of_the_calibration_is_told_without_a_tare(fleet):
    mass = fleet.weighed("truck").mass

    def told(lightest, **known):
        masses = replace(fleet.files["truck"].provenance, masses=(lightest * mass,))
        problems = weighed_anew(fleet, "truck", provenance=masses, **known).problems
        return [p for p in problems if p.id == "mass.lighter_than_known"]

    (note,) = told(1.25)
    assert f"{note.values['below']:.0f}" == "20"
    assert told(1.1) == []
    assert told(1.25, tare=0.9 * mass) == []


def weighed_anew(fleet, kind, **changes):
    """Weigh the drive as it is by its file with other values."""
    vehicle, balance = replace(fleet.files[kind], **changes), fleet.weighed(kind).result.balance
    return weigh_balance(fleet.drive(kind), vehicle, "joint", balance)


def test_a_payload_below_nothing_is_told_or_refused(fleet):
    own = fleet.weighed("truck")
    for stds, id in (
        (3.0, "mass.payload_negative"), (1.5, "mass.payload_zero"), (0.9, None), (-0.1, None),
    ):  # fmt: skip
        found = weighed_anew(fleet, "truck", tare=own.mass + stds * own.std)
        assert found.status is Status.CONVERGED
        told = [p for p in found.problems if p.id.startswith("mass.payload")]
        assert [p.id for p in told] == [id] * bool(id)
        assert all(p.values["payload"] == pytest.approx(-stds * own.std) for p in told)
    found = weighed_anew(fleet, "truck", tare=own.mass + 9.0 * own.std)
    assert found.status is Status.INCONSISTENT


def test_the_change_is_found_where_it_is(fleet):
    def change(t, x):
        return x * np.where(t > 500.0, 0.8, 1.0)

    drive = with_signal(fleet.drive("truck"), SOURCE["truck"], change)
    found = changing.largest(fleet.weigh("truck", drive).result.filter_input)
    assert found.sure
    assert found.change == pytest.approx(-0.2, abs=0.05)
    assert found.start - drive.start == pytest.approx(500.0, abs=60.0)
    clean = changing.largest(fleet.weighed("truck").result.filter_input)
    assert not clean.sure
    balance = fleet.weighed("truck").result.balance
    assert joint.estimate(balance, fleet.files["truck"]).filter_input.stood.max() > 0.0


def test_a_sign_that_was_never_seen_is_not_missed():
    time = np.arange(0.0, 300.0, 0.2)
    torque = Signal("engine_torque_fraction", time, 0.3 + 0.29 * np.sin(time / 5.0))
    dragged = DraggedReading(engine_speed=(100.0,), level=(0.0,), scatter=0.01, span=0.8)
    vehicle = Vehicle(
        kind="truck",
        torque=TorqueModel(source="percent", reference_torque=2000.0),
        dragged=dragged,
    )
    drive = Drive("x", {torque.name: torque})
    assert len(correct_drive(drive, vehicle).signals[torque.name]) == time.size
    negative = replace(dragged, level=(-0.09,))
    left = correct_drive(drive, replace(vehicle, dragged=negative)).signals[torque.name]
    assert left.values.min() > 0.09


@pytest.mark.parametrize("kind", SOURCE)
def test_coarse_steps_widen_the_interval(fleet, kind):
    def change(t, x):
        step = 0.08 * np.ptp(x)
        return np.floor(x / step) * step

    own = fleet.weighed(kind)
    found = fleet.weigh(kind, with_signal(fleet.drive(kind), SOURCE[kind], change))
    assert own.result.balance.coarse_std == 0.0
    assert any(w.id == "torque.coarse" for w in found.problems)
    if found.status is Status.CONVERGED:
        assert found.std > 1.5 * own.std
        assert abs(found.mass - fleet.mass(kind)) < 2.6 * found.std


def later_and_later(drive, name, seconds):
    s = drive.signals[name]
    grown = seconds * (s.time - drive.start) / drive.duration
    return drive.with_signals(Signal(name, s.time + grown, s.values))


@pytest.mark.parametrize("kind", ["car", "electric"])
def test_torque_that_comes_later_and_later_is_brought_back(fleet, kind):
    drive = later_and_later(fleet.drive(kind), SOURCE[kind], 3.0)

    weighing = fleet.weigh_alone(kind, drive)

    right(fleet, kind, weighing)
    assert any(p.id == "torque.late_drift" for p in weighing.problems)


@pytest.mark.parametrize("kind", ["car", "truck", "electric"])
def test_torque_that_keeps_its_lag_is_left_alone(fleet, kind):
    assert not any(p.id.startswith("torque.late") for p in fleet.weighed(kind).problems)


def test_torque_whose_lag_wanders_is_refused(fleet):
    drive = fleet.drive("electric")
    s = drive.signals["engine_torque"]
    late = np.interp(
        s.time - drive.start, [0, 300, 310, 600, 610, 900, 910, 1200], [0, 0, 2, 2] * 2
    )
    order = np.argsort(s.time + late, kind="stable")
    wandering = drive.with_signals(Signal(s.name, (s.time + late)[order], s.values[order]))

    with refused("torque.late_wanders"):
        fleet.weigh("electric", wandering)


def test_method_that_joint_contradicts_gives_no_mass(fleet):
    rows = fleet.weigh("electric", fleet.drive("electric"), "rls").result
    joined = fleet.weighed("electric").result

    assert contradicted(rows, joined) is None
    heavier = replace(rows, mass=1.3 * joined.mass)
    assert contradicted(heavier, joined).id == "method.contradicted"
    impossible = replace(joined, status=Status.INCONSISTENT, reason=noted("it is no car's"))
    assert contradicted(rows, impossible).values["reason"] == "it is no car's"
    vague = replace(joined, std=0.4 * joined.mass)
    assert contradicted(heavier, vague) is None


@pytest.mark.parametrize(("method", "noise"), [("rls", 2.0), ("robust-rls", 2.0)])
def test_rows_that_are_mostly_noise_carry_no_mass(fleet, method, noise):
    rng = np.random.default_rng(5)
    drive = with_signal(
        fleet.drive("car"), "accel_x", lambda t, x: x + noise * rng.standard_normal(x.size)
    )

    assert fleet.weigh_alone("car", fleet.drive("car"), method).status is Status.CONVERGED
    weighing = fleet.weigh_alone("car", drive, method)

    assert weighing.status is not Status.CONVERGED
    assert "nois" in weighing.reason


def test_a_motor_torque_cut_off_at_either_end_is_weighed_by_the_rest(fleet):
    torque = fleet.drive("electric").signals["engine_torque"].values
    assert not any(p.id == "torque.at_limit" for p in fleet.weighed("electric").problems)
    for cut in ((-np.inf, 0.4), (0.1, np.inf)):
        low, high = (part * torque.max() for part in cut)
        damaged = with_signal(
            fleet.drive("electric"), "engine_torque", lambda t, x, a=low, b=high: np.clip(x, a, b)
        )
        found = fleet.weigh_alone("electric", damaged)
        assert any(p.id == "torque.at_limit" for p in found.problems)
        assert (
            found.status is not Status.CONVERGED
            or abs(found.mass / fleet.mass("electric") - 1.0) < 0.03
        )


@pytest.mark.parametrize("late", [4.0, -3.0])
@pytest.mark.parametrize("kind", ["car", "truck"])
def test_a_speed_that_alone_is_seconds_late_gives_no_mass(fleet, kind, late):
    drive = fleet.drive(kind)
    speed = drive.signals["vehicle_speed"]
    moved = drive.with_signals(replace(speed, time=speed.time + late))
    if late < 0.0:
        with refused("clock.torque_apart"):
            fleet.weigh_alone(kind, moved)
    else:
        assert np.isnan(fleet.weigh_alone(kind, moved).mass)


def test_a_trip_of_another_vehicle_behind_a_pause_gives_no_mass(fleet):
    drive = fleet.drive("car")
    middle = drive.start + 0.5 * drive.duration
    paused = drive.with_signals(
        *(
            replace(s, time=np.where(s.time > middle, s.time + 200.0, s.time))
            for s in drive.signals.values()
        )
    )
    right(fleet, "car", fleet.weigh("car", paused))
    engine = paused.signals["engine_speed"]
    other = np.where(engine.time > middle, 150.0 * (engine.values / 150.0) ** 0.7, engine.values)
    with refused("vehicle.two"):
        fleet.weigh_alone("car", paused.with_signals(replace(engine, values=other)))


@pytest.mark.parametrize("scale", [1.04, 0.96])
@pytest.mark.parametrize("kind", SOURCE)
def test_tyres_of_another_circumference_are_found_and_corrected(fleet, kind, scale):
    drive = fleet.drive(kind)
    for name in ("vehicle_speed", "engine_speed"):
        drive = with_signal(drive, name, lambda _, x: x / scale)
    highest = np.inf if kind == "electric" else 1.0
    reads = as_sent(kind, lambda _, x: np.minimum(x * scale, highest))
    drive = with_signal(drive, SOURCE[kind], reads)
    weighing = fleet.weigh_alone(kind, drive)
    found = next(p for p in weighing.problems if p.id == "tyres.changed")
    assert found.values["size"] == ("larger" if scale > 1.0 else "smaller")
    right(fleet, kind, weighing)


@pytest.mark.parametrize("kind", ["car", "truck"])
def test_an_engine_speed_or_a_speed_that_alone_is_off_is_no_tyre(fleet, kind):
    for name in ("vehicle_speed", "engine_speed"):
        drive = with_signal(fleet.drive(kind), name, lambda _, x: 0.97 * x)
        assert not any(w.id == "tyres.changed" for w in fleet.weigh_alone(kind, drive).problems)


@pytest.mark.parametrize("kind", ["car", "truck"])
def test_a_table_that_is_a_second_late_as_a_whole_is_moved(fleet, kind):
    drive = fleet.drive(kind)
    bus = [s for s in drive.signals.values() if QUANTITIES[s.name].table == "obd"]
    late = drive.with_signals(*(replace(s, time=s.time + 1.0) for s in bus))
    weighing = fleet.weigh_alone(kind, late)
    assert any(w.id == "torque.clock_moved" for w in weighing.problems)
    right(fleet, kind, weighing)
    torque = drive.signals[SOURCE[kind]]
    with refused("clock.torque_apart"):
        fleet.weigh_alone(kind, drive.with_signals(replace(torque, time=torque.time + 1.0)))


def bent_above(part, less):
    def change(_, x):
        knee = part * np.percentile(x, 99.0)
        return np.where(x > knee, knee + (1.0 - less) * (x - knee), x)

    return change


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        ("electric", bent_above(0.33, 0.5)),
        ("truck", bent_above(0.5, 0.23)),
        ("car", bent_above(0.5, 0.3)),
    ],
)
def test_a_torque_that_reads_otherwise_at_its_top_makes_no_mass(fleet, kind, change):
    """Another motor, another map of the engine: by no witness."""
    found = fleet.weigh_alone(kind, with_signal(fleet.drive(kind), SOURCE[kind], change))
    assert found.status is Status.INCONSISTENT
    assert found.reason_id in ("torque.bent", "load.change_moving")


@pytest.mark.parametrize("kind", SOURCE)
def test_a_torque_that_reads_too_low_throughout_bends_no_more_than_an_undamaged_one(fleet, kind):
    """The scale of the reading is the mass's, and no bend of it."""
    low = with_signal(fleet.drive(kind), SOURCE[kind], as_sent(kind, lambda _, x: 0.93 * x))
    bends = [
        joint.estimate(fleet.weigh_alone(kind, d).result.balance, fleet.files[kind]).bend
        for d in (fleet.drive(kind), low)
    ]
    assert all(abs(b.part) < 0.09 for b in bends)
    assert bends[0].part == pytest.approx(bends[1].part, abs=0.03)


def test_a_bend_that_a_person_vouches_for_is_weighed(fleet):
    drive = with_signal(fleet.drive("truck"), SOURCE["truck"], bent_above(0.5, 0.23))
    trusted = replace(drive, info=replace(drive.info, trusted=(SOURCE["truck"],)))
    assert fleet.weigh_alone("truck", trusted).status is Status.CONVERGED


def test_without_an_accelerometer_no_bend_is_looked_for(fleet):
    drive = without_accelerometer(fleet.drive("car"))
    found = fleet.weigh_alone("car", drive)
    assert found.result.bend is None
    assert found.reason_id != "torque.bent"


def held(t, x):
    """For 10 s of every 35 s the reading repeats a value."""
    for begin in range(60, 1150, 35):
        within = (t >= begin) & (t < begin + 10)
        x[within] = x[np.argmax(within)]
    return x


@pytest.mark.parametrize("kind", ["car", "truck"])
def test_a_torque_that_is_held_now_and_then_is_left_out_there(fleet, kind):
    found = fleet.weigh_alone(kind, with_signal(fleet.drive(kind), SOURCE[kind], held))
    assert any(w.id == "frozen.signal" for w in found.problems)
    assert found.status is not Status.CONVERGED or abs(found.mass - fleet.mass(kind)) < (
        2.0 * found.std
    )


@pytest.mark.parametrize(
    ("kind", "factor"),
    [
        ("car", 1.0 / FOOT),
        ("truck", 1.0 / FOOT),
        ("electric", 1.0 / FOOT),
        ("car", FOOT),
        ("electric", -1.0),
    ],
)
def test_heights_in_another_unit_are_named_by_what_hills_take(fleet, kind, factor):
    inertial = [n for n in fleet.drive(kind).signals if n.startswith(("accel_", "gyro_"))]
    drive = fleet.drive(kind).without(*inertial)
    assert fleet.weigh(kind, drive).status == "converged"
    wrong = with_signal(drive, "altitude", lambda t, x: factor * x)
    found = fleet.weigh(kind, wrong)
    assert found.reason_id == "altitude.scale"
    # Noise of the heights is in the ratio too.
    assert found.refusal.values["ratio"] == pytest.approx(factor, rel=0.25)
    vouched = replace(wrong, info=replace(wrong.info, trusted=("altitude",)))
    assert fleet.weigh(kind, vouched).reason_id != "altitude.scale"
