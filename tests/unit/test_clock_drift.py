"""Clocks that drift, jump or are set wrong against each other: mended, or refused."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from tests.noted import refused

import weighbridge as wb
from weighbridge.balance import force_balance
from weighbridge.checks import correct_drive
from weighbridge.messages import phrase
from weighbridge.navigation import find_motion
from weighbridge.signals import QUANTITIES
from weighbridge.simulation import MIDSIZE, Scenario, Sensors, jensen_route, simulate_car

LENGTH = 1500.0


@pytest.fixture(scope="module")
def made():
    scenario = Scenario(name="clocks", car=MIDSIZE, route=jensen_route(3), seed=91)
    return simulate_car(replace(scenario, duration=LENGTH, sensors=Sensors(imu_rate=50.0)))


@pytest.fixture(scope="module")
def car(made):
    return wb.calibrate([made.drive], mass=made.scenario.mass)


@pytest.fixture(scope="module")
def mass(made, car):
    return wb.weigh(made.drive, car).mass


def retimed(drive, tables, change):
    """Change the stamps of tables; signals that share a clock go on sharing one."""
    clocks = {}
    for s in drive.signals.values():
        if QUANTITIES[s.name].table in tables:
            clocks.setdefault(id(s.time), change(s.time))
    return drive.with_signals(
        *(replace(s, time=clocks[id(s.time)]) for s in drive.signals.values()
          if id(s.time) in clocks)
    )  # fmt: skip


def without_inertial(drive, gaps):
    """Take the rows of the inertial sensor out of some times."""
    imu = [s for s in drive.signals.values() if QUANTITIES[s.name].table == "imu"]
    time = imu[0].time
    keep = np.logical_and.reduce([(time < a) | (time > b) for a, b in gaps])
    rest = time[keep]
    return drive.with_signals(*(replace(s, time=rest, values=s.values[keep]) for s in imu))


def lateness(drive, true):
    """Lateness of the vehicle speed before and after the middle of a drive, against the true one.

    The lag at which its samples lie nearest to the true speed [s].
    """
    found, speed = drive.signals["vehicle_speed"], true.signals["vehicle_speed"]
    lags = np.arange(-2.5, 2.5, 0.01)
    for part in (found.time < 650.0, found.time > 750.0):
        time, values = found.time[part], found.values[part]
        off = [np.nanmean((speed.at(time - lag) - values) ** 2) for lag in lags]
        yield lags[np.argmin(off)]


def counted(period, share, seed=1):
    """Stamps of a logger that counts rows, and loses some of them."""
    lost = np.sort(np.random.default_rng(seed).uniform(0, LENGTH, int(LENGTH / period * share)))
    return lambda t: t - 0.98 * period * np.searchsorted(lost, t)


def test_sound_clocks_are_left_to_the_last_bit(made):
    mended = correct_drive(made.drive)
    assert mended.problems == made.drive.problems
    for name, s in made.drive.signals.items():
        assert mended.signals[name].time is s.time


@pytest.mark.parametrize(
    ("tables", "change"),
    [
        ({"imu"}, lambda t: t * (1.0 + 1e-3)),
        ({"imu"}, lambda t: t * (1.0 - 4e-4)),
        ({"imu"}, lambda t: t * 0.99),
        ({"obd"}, lambda t: t * (1.0 + 2e-3)),
        ({"obd"}, lambda t: t + 2.0 * (t > 700.0)),
        ({"obd"}, lambda t: t - 2.0 * (t < 900.0)),
        ({"imu"}, counted(0.02, 1e-3)),
        ({"obd"}, counted(0.25, 1e-3)),
        ({"obd"}, lambda t: t + 1.2 * np.sin(np.pi * t / LENGTH)),
        ({"obd"}, lambda t: t + np.interp(t, [0, 400, 800, 1100, 1500], [0, 0.2, 0, 0.6, 0.9])),
        ({"obd"}, lambda t: t + 18.0),
        ({"obd"}, lambda t: t - 600.0),
        ({"obd"}, lambda t: t + 0.4),
        ({"imu", "gnss"}, lambda t: t + 0.4),
    ],
    ids=[
        "imu+1000ppm", "imu-400ppm", "imu-1%", "obd+2000ppm", "step", "step-back", "imu-rows-lost",
        "obd-rows-lost", "wander", "bends", "18s", "-600s", "0.4s", "-0.4s",
    ],
)  # fmt: skip
def test_clocks_that_part_are_brought_together(made, car, mass, tables, change):
    told = wb.weigh(retimed(made.drive, tables, change), car)
    assert told.mass == pytest.approx(mass, rel=0.01)
    assert any(p.id in ("clock.moved", "torque.clock_moved") for p in told.problems)


@pytest.mark.parametrize("late", [-3.0, -1.8, 1.0, 2.0])
def test_a_table_seconds_off_is_moved_in_a_drive_of_minutes(made, car, late):
    short = made.drive.between(300.0, 520.0)
    told = wb.weigh(retimed(short, {"imu"}, lambda t: t + late), car)
    assert told.mass == pytest.approx(wb.weigh(short, car).mass, rel=0.01)
    assert [p.id for p in told.problems].count("clock.moved") == 1


@pytest.mark.parametrize("start", np.arange(100.0, LENGTH - 130.0, 130.0))
def test_no_table_of_a_short_drive_is_moved_whose_clock_is_right(made, start):
    for length in (60.0, 95.0, 125.0):
        assert not correct_drive(made.drive.between(start, start + length)).shifts


@pytest.mark.parametrize(
    ("tables", "change"),
    [
        ({"obd"}, lambda t: t + 18.0),
        ({"obd"}, lambda t: t + 2.0 * (t > 700.0)),
        ({"obd"}, lambda t: t * (1.0 + 2e-3)),
        ({"imu"}, lambda t: t * 0.99),
    ],
    ids=["18s", "step", "obd+2000ppm", "imu-1%"],
)
def test_a_drive_says_how_its_last_stamps_were_moved(made, tables, change):
    drive = retimed(made.drive, tables, change)
    moved = correct_drive(drive)
    (shift,) = moved.shifts.values()
    for name in ("vehicle_speed", "accel_x"):
        if QUANTITIES[name].table in moved.shifts:
            late = drive.signals[name].time[-50:]
            assert shift.onto(late) == pytest.approx(moved.signals[name].time[-50:], abs=1e-6)
    assert not correct_drive(made.drive).shifts


def test_an_inertial_clock_of_its_own_is_the_one_that_is_moved(made):
    mended = correct_drive(retimed(made.drive, {"imu"}, lambda t: t * (1.0 + 1e-3)))
    assert mended.signals["vehicle_speed"].time is made.drive.signals["vehicle_speed"].time
    found = mended.problems[-1]
    assert (found.id, found.values["table"]) == ("clock.moved", "obd and gnss")
    (slope,) = re.findall(r"-?\d+(?= ppm)", found.values["what"])
    assert float(slope) == pytest.approx(-1000.0, abs=50.0)
    moved = mended.signals["accel_x"].time - made.drive.signals["accel_x"].time
    assert np.abs(moved).max() < 0.15


def test_a_bus_whose_clock_jumps_about_gives_no_mass(made, car):
    """Set by several seconds every two minutes, as by a network in bad order."""
    jumps = np.random.default_rng(4).uniform(-4.0, 4.0, 100)
    drive = retimed(made.drive, {"obd"}, lambda t: np.sort(t + jumps[(t // 120.0).astype(int)]))
    with refused("clock.torque_apart"):
        wb.weigh(drive, car)


def test_rows_about_a_step_are_left_out(made):
    drive = retimed(made.drive, {"obd"}, lambda t: t + 2.0 * (t > 700.0))
    settled = correct_drive(drive)
    assert any(
        p.id == "clock.moved" and p.values["what"].startswith(phrase("clock_jumps", several="+2.0"))
        for p in settled.problems
    )
    speed = settled.signals["vehicle_speed"]
    assert len(speed) > 0.8 * len(made.drive.signals["vehicle_speed"])
    before, after = lateness(settled, made.drive)
    assert abs(after - before) < 0.2


def test_clocks_seconds_apart_are_no_swapped_axes(made):
    settled = correct_drive(retimed(made.drive, {"obd", "gnss"}, lambda t: t + 40.0))
    assert not any(p.serious for p in settled.problems)
    assert any(p.id == "clock.moved" and "+39.9" in p.values["what"] for p in settled.problems)
    assert_array_equal(
        settled.signals["engine_load"].values, made.drive.signals["engine_load"].values
    )


def without_imu(drive):
    return drive.without(*(n for n in drive.signals if QUANTITIES[n].table == "imu"))


def gnss_lateness(drive):
    """By how much the speed over ground is later than the vehicle speed [s]."""
    ground, speed = drive.signals["gnss_speed"], drive.signals["vehicle_speed"]
    lags = np.arange(-3.0, 3.0, 0.02)
    off = [np.nanmean((speed.at(ground.time - lag) - ground.values) ** 2) for lag in lags]
    return lags[np.argmin(off)]


@pytest.mark.parametrize("late", [-20.0, -3.0, 1.5, 7.0])
def test_without_an_inertial_sensor_gnss_is_moved_onto_the_bus(made, late):
    bare = without_imu(made.drive)
    known = gnss_lateness(bare)
    mended = correct_drive(retimed(bare, ("gnss",), lambda t: t + late))
    (note,) = [p for p in mended.problems if p.id == "clock.moved"]
    told = re.search(r"the clock of gnss is ([-+.0-9]+) s off against that of obd", note.text)
    assert float(told[1]) == pytest.approx(late, abs=0.3)
    assert gnss_lateness(mended) == pytest.approx(known, abs=0.2)


def test_without_an_inertial_sensor_a_drift_of_gnss_is_taken_out(made):
    bare = without_imu(made.drive)
    mended = correct_drive(retimed(bare, ("gnss",), lambda t: 1.004 * t))
    later = mended.signals["gnss_speed"].time - bare.signals["gnss_speed"].time
    assert np.ptp(later) < 0.3
    assert any(p.id == "clock.moved" for p in mended.problems)


def test_without_an_inertial_sensor_sound_clocks_are_left_to_the_last_bit(made):
    bare = without_imu(made.drive)
    mended = correct_drive(bare)
    assert mended.problems == bare.problems
    for name, signal in bare.signals.items():
        assert_array_equal(mended.signals[name].time, signal.time)


def test_gnss_that_hardly_shows_its_clock_is_moved_by_all_of_the_drive(made):
    # Speed over ground as noisy as that between fixes: no piece shows the lag alone.
    bare = without_imu(made.drive)
    ground = bare.signals["gnss_speed"]
    noise = np.random.default_rng(3).normal(0.0, 1.2, len(ground))
    noisy = bare.with_signals(replace(ground, values=np.abs(ground.values + noise)))
    mended = correct_drive(retimed(noisy, ("gnss",), lambda t: t + 5.0))
    moved = mended.signals["gnss_speed"].time - ground.time
    assert np.max(np.abs(moved)) < 0.5


def test_in_minutes_gnss_is_moved_though_its_pieces_differ_a_little(made):
    short = without_imu(made.drive).between(300.0, 700.0)
    mended = correct_drive(retimed(short, ("gnss",), lambda t: t + 5.0 + 0.5 * (t > 500.0)))
    moved = mended.signals["gnss_speed"].time - short.signals["gnss_speed"].time
    assert np.max(np.abs(moved)) < 0.6


def inertial_as(drive, change, start=500.0, end=800.0):
    """Put what ``change`` makes of the samples before a time in the place of those in it."""
    return drive.with_signals(
        *(
            replace(s, values=np.where((s.time > start) & (s.time < end), change(s), s.values))
            for s in drive.signals.values()
            if QUANTITIES[s.name].table == "imu"
        )
    )


def test_an_inertial_sensor_that_froze_is_left_out_and_not_the_bus(made, car, mass):
    frozen = inertial_as(made.drive, lambda s: s.at(np.full(len(s), 500.0)))
    told = wb.weigh(frozen, car)
    assert told.mass == pytest.approx(mass, rel=0.02)
    (note,) = [w for w in told.problems if w.id == "frozen.imu"]
    assert note.end - note.start == pytest.approx(300.0, abs=1.0)
    ids = {w.id for w in told.problems}
    assert not ids & {"clock.moved", "imu.lean"}


@pytest.mark.parametrize("gnss", [True, False])
def test_an_inertial_sensor_that_goes_on_as_at_rest_does_no_harm(made, car, mass, gnss):
    rng = np.random.default_rng(92)

    def resting(s):
        noise = 0.03 if s.name.startswith("accel") else 0.002
        return np.mean(s.values) + noise * rng.normal(size=len(s))

    drive = made.drive
    if not gnss:
        drive = drive.without(*(n for n in drive.signals if QUANTITIES[n].table == "gnss"))
    told = wb.weigh(inertial_as(drive, resting, 450.0, 950.0), car)
    assert told.mass == pytest.approx(mass, rel=0.025)


def in_turns(drive, on, period):
    """Keep the rows of the bus of the first ``on`` of each ``period`` seconds."""
    return drive.with_signals(
        *(
            replace(s, time=s.time[keep], values=s.values[keep])
            for s in drive.signals.values()
            if QUANTITIES[s.name].table == "obd"
            for keep in [s.time % period < on]
        )
    )


@pytest.mark.parametrize(("on", "period"), [(10.0, 20.0), (30.0, 60.0)])
def test_a_bus_that_is_recorded_in_turns_has_a_sound_clock(made, car, mass, on, period):
    told = wb.weigh(in_turns(made.drive, on, period), car)
    assert told.mass == pytest.approx(mass, rel=0.025)
    assert not any(w.id == "clock.moved" for w in told.problems)


def test_a_step_of_a_clock_that_is_recorded_in_turns_is_found(made):
    late = retimed(in_turns(made.drive, 10.0, 20.0), {"obd"}, lambda t: t + 2.0 * (t > 700.0))
    settled = correct_drive(late)
    assert any(
        p.id == "clock.moved" and p.values["what"].startswith(phrase("clock_jumps", several="+"))
        for p in settled.problems
    )
    before, after = lateness(settled, made.drive)
    assert abs(after - before) < 0.4


def test_a_gap_of_the_inertial_sensor_leaks_no_zeros(made, car):
    """A lag passes on what stood in the gap; what is valid behind it must not hold any of that."""
    gaps = [(at, at + 2.0) for at in np.arange(200.0, 1300.0, 50.0)]
    whole, gapped = (
        force_balance(drive, car, find_motion(drive), lag=0.3).table
        for drive in (made.drive, without_inertial(made.drive, gaps))
    )
    behind = np.logical_or.reduce([(whole.time > b) & (whole.time < b + 2.0) for _, b in gaps])
    off = (gapped.specific_force - whole.specific_force)[behind]
    off = off[np.isfinite(off)]
    assert off.size > 50
    assert np.sqrt(np.mean(off**2)) < 0.1
