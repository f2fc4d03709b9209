"""Inertial navigation on a small drive made from closed forms."""

import math
from dataclasses import dataclass

import numpy as np
import pymap3d
import pytest
from numba import config
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation
from tests.noted import refused

from weighbridge import Drive, Signal, Vehicle
from weighbridge.constants import GRAVITY
from weighbridge.kernels.lowpass import lowpass_even, lowpass_resample
from weighbridge.navigation import find_motion
from weighbridge.navigation.geodesy import LocalFrame
from weighbridge.navigation.rows import place_nodes
from weighbridge.vehicle import Driveline, Mounting

SQUAT = 0.004


@dataclass(frozen=True)
class Truth:
    time: np.ndarray
    speed: np.ndarray
    accel: np.ndarray
    grade: np.ndarray
    pitch: np.ndarray
    heading: np.ndarray


def simulate(
    *,
    mounting=(0.0, 0.0, 0.0),
    seed=0,
    duration=400.0,
    delay=0.12,
    squat=SQUAT,
    scale=0.98,
    rest=10.0,
    bias=(0.05, -0.04, 0.08),
    gyro_bias=(0.004, -0.003, 0.005),
):
    """Make a drive over hills and bends with stops, and its truth, at 100 Hz."""
    if config.DISABLE_JIT:
        pytest.skip("a whole drive takes minutes without the compiler")
    rng = np.random.default_rng(seed)
    dt = 0.01
    t = np.arange(0.0, duration, dt)
    moving = np.clip((t - rest) / 4.0, 0.0, 1.0)
    moving = moving * moving * (3.0 - 2.0 * moving)
    speed = moving * np.clip(13.0 + 7.0 * np.sin(t / 19.0) + 5.0 * np.sin(t / 6.3 + 1.0), 0.0, None)
    width = 101
    speed = np.convolve(np.pad(speed, width // 2, mode="edge"), np.hanning(width), "valid")
    speed /= np.hanning(width).sum()
    speed[t < rest - 1.0] = 0.0
    accel = np.gradient(speed, dt)
    s = np.cumsum(speed) * dt
    grade = 0.04 * np.sin(2 * np.pi * s / 700.0) + 0.015 * np.sin(2 * np.pi * s / 260.0 + 1.0)
    heading = 0.7 + 0.9 * np.sin(2 * np.pi * s / 500.0)
    pitch = grade + squat * accel
    velocity = speed[:, None] * np.column_stack(
        [np.cos(grade) * np.cos(heading), np.cos(grade) * np.sin(heading), -np.sin(grade)]
    )
    ned = np.cumsum(velocity, axis=0) * dt
    attitude = Rotation.from_euler("ZYX", np.column_stack([heading, pitch, 0.0 * t]))
    accel_n = np.gradient(velocity, dt, axis=0)
    force = attitude.inv().apply(accel_n - [0.0, 0.0, GRAVITY])
    rate = np.zeros((t.size, 3))
    rate[1:] = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / dt
    to_sensor = Rotation.from_euler("ZYX", mounting[::-1]).inv()
    force = to_sensor.apply(force) + bias + rng.normal(scale=0.04, size=force.shape)
    rate = to_sensor.apply(rate) + gyro_bias + rng.normal(scale=0.002, size=rate.shape)
    signals = {}
    for i, a in enumerate("xyz"):
        signals[f"accel_{a}"] = Signal(f"accel_{a}", t, force[:, i])
        signals[f"gyro_{a}"] = Signal(f"gyro_{a}", t, rate[:, i])
    obd = np.arange(0.5, duration - 1.0, 0.2)
    shown = scale * np.interp(obd - delay, t, speed)
    signals["vehicle_speed"] = Signal("vehicle_speed", obd, np.round(shown * 3.6) / 3.6)
    fix = np.arange(0.3, duration - 0.5, 1.0)
    at = np.column_stack([np.interp(fix, t, ned[:, i]) for i in range(3)])
    at += rng.normal(size=at.shape) * [1.5, 1.5, 2.5]
    lat, lon, alt = pymap3d.ned2geodetic(*at.T, 0.98, 0.17, 60.0, deg=False)
    for name, values in (("latitude", lat), ("longitude", lon), ("altitude", alt)):
        signals[name] = Signal(name, fix, np.asarray(values))
    return Drive("hills", signals), Truth(t, speed, accel, grade, pitch, heading)


def _error(motion, truth, of, skip=15.0):
    keep = (motion.time > skip) & motion.valid
    return (getattr(motion, of) - np.interp(motion.time, truth.time, getattr(truth, of)))[keep]


@pytest.fixture(scope="module")
def hills():
    return simulate()


@pytest.fixture(scope="module")
def hills_motion(hills):
    return find_motion(hills[0])


def test_motion_is_found(hills, hills_motion):
    _, truth = hills
    m = hills_motion
    assert m.source == "inertial"
    assert np.all(m.valid[20:-20])
    assert np.degrees(np.std(_error(m, truth, "grade"))) < 0.2
    assert abs(np.degrees(np.mean(_error(m, truth, "grade")))) < 0.25
    assert np.std(_error(m, truth, "speed")) < 0.1
    assert np.std(_error(m, truth, "accel")) < 0.06
    assert abs(np.mean(_error(m, truth, "accel"))) < 0.01
    turned = np.angle(np.exp(1j * _error(m, truth, "heading")))
    assert np.degrees(np.std(turned)) < 2.0
    assert abs(m.distance[-1] - np.sum(truth.speed) * 0.01) < 0.01 * m.distance[-1]


def test_constants_are_found(hills_motion):
    m = hills_motion
    assert abs(m.squat - SQUAT) < 3.0 * m.squat_std + 2e-4
    assert m.squat_std < 0.001
    assert abs(m.speed_scale - 0.98) < 0.005
    assert abs(m.speed_delay - 0.12) < 0.03
    assert all(abs(a) < math.radians(1.0) for a in m.mounting)


def test_specific_force_is_acceleration_and_gravity(hills_motion):
    m = hills_motion
    expected = m.accel + GRAVITY * np.sin(m.grade)
    assert_allclose(m.specific_force[m.valid], expected[m.valid], atol=1e-12)


def test_even_clock_and_shapes(hills_motion):
    m = hills_motion
    assert_allclose(np.diff(m.time), 0.05, atol=1e-9)
    assert m.rate == pytest.approx(20.0)
    for name in ("speed", "accel", "specific_force", "grade", "pitch", "roll", "heading",
                 "distance", "altitude", "valid", "grade_std"):  # fmt: skip
        assert getattr(m, name).shape == m.time.shape
    assert m.position[1].shape == (m.time.size, 3)


@pytest.mark.parametrize(
    "degrees",
    [(0, -90, 0), (180, 0, 0), (90, 0, 45), (180, -7, 185), (10, 80, -100), (-90, 5, 170)],
)
def test_any_mounting_is_found(degrees):
    mounting = tuple(math.radians(d) for d in degrees)
    drive, truth = simulate(mounting=mounting, duration=240.0, seed=3)
    m = find_motion(drive)
    found = Rotation.from_euler("ZYX", m.mounting[::-1])
    off = found * Rotation.from_euler("ZYX", mounting[::-1]).inv()
    assert np.degrees(off.magnitude()) < 1.2
    assert np.degrees(np.std(_error(m, truth, "grade"))) < 0.3


def test_given_mounting_and_squat_are_kept():
    drive, truth = simulate(mounting=(0.0, 0.0, 0.3), duration=120.0)
    given = Mounting(yaw=0.3, std=(0.002, 0.002, 0.005), squat=SQUAT, squat_std=1e-4)
    m = find_motion(drive, Vehicle(mounting=given))
    assert_allclose(m.mounting, (0.0, 0.0, 0.3), atol=math.radians(0.6))
    assert m.squat == pytest.approx(SQUAT, abs=3e-4)
    assert np.degrees(np.std(_error(m, truth, "grade"))) < 0.25


def test_mirrored_axes_are_refused(hills):
    drive, _ = hills
    y = drive.signals["accel_y"]
    mirrored = drive.with_signals(Signal("accel_y", y.time, -y.values))
    with refused("imu.axes_mirrored"):
        find_motion(mirrored)


@pytest.mark.parametrize("factor", [1.0 / 1.609344, 1.609344, 3.6])
def test_speed_in_a_wrong_unit_is_refused(hills, factor):
    drive, _ = hills
    s = drive.signals["vehicle_speed"]
    wrong = drive.with_signals(Signal("vehicle_speed", s.time, s.values * factor))
    # a speed wrong by much also makes the gyro look wrong: either sentence names a unit
    with refused("speed.unit_of_accel"):
        find_motion(wrong)


def test_wrong_units_are_refused_with_a_known_mounting_too(hills):
    drive, _ = hills
    y = drive.signals["accel_y"]
    mirrored = drive.with_signals(Signal("accel_y", y.time, -y.values))
    with refused("imu.axes_mirrored"):
        find_motion(mirrored, Vehicle(mounting=Mounting()))


def test_known_mounting_serves_a_short_drive():
    drive, truth = simulate(duration=45.0)
    short = drive.between(0.0, 17.0)
    with refused("motion.too_little"):
        find_motion(short)
    m = find_motion(short, Vehicle(mounting=Mounting(std=(0.005, 0.005, 0.01))))
    assert m.squat is None
    assert np.degrees(np.abs(_error(m, truth, "pitch", skip=11.0)).max()) < 1.0


def test_standing_still_is_refused():
    drive, _ = simulate(duration=60.0, rest=100.0)
    with refused("motion.too_little"):
        find_motion(drive)


def test_without_gnss(hills):
    drive, truth = hills
    m = find_motion(drive.without("latitude", "longitude", "altitude"))
    assert np.all(np.isnan(m.heading))
    assert np.all(np.isnan(m.altitude))
    assert m.speed_scale is None
    assert any(note.id == "gnss.none" for note in m.notes)
    assert np.degrees(np.std(_error(m, truth, "grade"))) < 0.35


def test_without_vehicle_speed(hills):
    drive, truth = hills
    m = find_motion(drive.without("vehicle_speed"))
    assert m.speed_scale is None
    assert np.std(_error(m, truth, "speed")) < 0.5
    assert np.degrees(np.std(_error(m, truth, "grade"))) < 0.5


def test_gnss_outage(hills):
    drive, truth = hills
    cut = []
    for name in ("latitude", "longitude", "altitude"):
        s = drive.signals[name]
        keep = (s.time < 150.0) | (s.time > 270.0)
        cut.append(Signal(name, s.time[keep], s.values[keep]))
    m = find_motion(drive.with_signals(*cut))
    inside = (m.time > 150.0) & (m.time < 270.0)
    error = m.grade - np.interp(m.time, truth.time, truth.grade)
    assert np.degrees(np.std(error[inside])) < 0.35


def test_gnss_outliers_are_refused(hills, hills_motion):
    drive, _ = hills
    s = drive.signals["altitude"]
    values = s.values.copy()
    values[50::60] += 200.0
    m = find_motion(drive.with_signals(Signal("altitude", s.time, values)))
    assert np.degrees(np.abs(m.grade - hills_motion.grade).max()) < 0.25


def test_filter_believes_a_lasting_jump(hills):
    drive, _ = hills
    s = drive.signals["altitude"]
    jumped = np.where(s.time > 200.0, s.values + 300.0, s.values)
    m = find_motion(drive.with_signals(Signal("altitude", s.time, jumped)))
    assert abs(m.altitude[-200] - m.altitude[m.time.searchsorted(190.0)]) > 200.0


def test_gap_of_the_inertial_sensor(hills):
    drive, truth = hills
    cut = []
    for kind in ("accel", "gyro"):
        for a in "xyz":
            s = drive.signals[f"{kind}_{a}"]
            keep = (s.time < 200.0) | (s.time > 206.0)
            cut.append(Signal(s.name, s.time[keep], s.values[keep]))
    m = find_motion(drive.with_signals(*cut))
    gap = (m.time > 200.5) & (m.time < 205.5)
    assert not m.valid[gap].any()
    assert np.isfinite(m.specific_force).all()
    after = (m.time > 215.0) & (m.time < 390.0)
    error = m.grade - np.interp(m.time, truth.time, truth.grade)
    assert np.degrees(np.std(error[after])) < 0.3


@pytest.mark.parametrize("fault", [math.nan, math.inf])
def test_samples_that_are_no_numbers_are_left_out(hills, hills_motion, fault):
    drive, _ = hills
    spoilt = []
    for name, at in (("accel_x", [5000, 9001]), ("gyro_y", [7000])):
        s = drive.signals[name]
        values = s.values.copy()
        values[at] = fault
        spoilt.append(Signal(name, s.time, values))
    m = find_motion(drive.with_signals(*spoilt))
    assert np.abs(m.speed - hills_motion.speed).max() < 0.05
    assert np.degrees(np.abs(m.grade - hills_motion.grade).max()) < 0.05


def test_jitter_of_the_inertial_clock(hills):
    drive, truth = hills
    rng = np.random.default_rng(5)
    t = drive.signals["accel_x"].time
    jitter = t + rng.uniform(-0.003, 0.003, t.size)
    moved = [Signal(f"{k}_{a}", jitter, drive.signals[f"{k}_{a}"].values)
             for k in ("accel", "gyro") for a in "xyz"]  # fmt: skip
    m = find_motion(drive.with_signals(*moved))
    assert np.degrees(np.std(_error(m, truth, "grade"))) < 0.25


@pytest.mark.parametrize("delay", [-0.2, 0.0, 0.5])
def test_delay_of_the_speed_is_found(delay):
    drive, _ = simulate(duration=240.0, delay=delay, seed=2)
    assert find_motion(drive).speed_delay == pytest.approx(delay, abs=0.03)


def test_lowpass_keeps_slow_and_stops_what_would_fold():
    rng = np.random.default_rng(1)
    t = np.sort(rng.uniform(0.0, 40.0, 8000))
    grid = np.arange(10, 700) / 20.0
    out, weight = np.empty((grid.size, 2)), np.empty(grid.size)
    values = np.column_stack([np.sin(2 * np.pi * 1.0 * t), np.sin(2 * np.pi * 19.0 * t)])
    lowpass_resample(t, values, grid[0], 0.05, 0, 3.0, out, weight)
    inner = slice(10, -10)
    assert np.abs(out[inner, 0] - np.sin(2 * np.pi * grid[inner])).max() < 0.05
    assert np.std(out[inner, 1]) < 0.1


def test_lowpass_response_on_an_even_clock():
    t = np.arange(0.0, 60.0, 0.005)
    grid = np.arange(100, 1000) / 20.0
    for hertz, low, high in (
        (2.0, 0.97, 1.01),
        (4.0, 0.9, 1.02),
        (12.5, 0.0, 0.06),
        (19.0, 0.0, 0.01),
    ):
        y = np.exp(2j * np.pi * hertz * t)
        out = np.empty((grid.size, 2))
        lowpass_resample(
            t, np.column_stack([y.real, y.imag]), grid[0], 0.05, 0, 3.0, out,
            np.empty(grid.size),
        )  # fmt: skip
        gain = np.abs(np.mean((out[:, 0] + 1j * out[:, 1]) * np.exp(-2j * np.pi * hertz * grid)))
        assert low <= gain <= high, hertz


def test_lowpass_on_an_even_clock_knows_neither_gaps_nor_what_lies_beyond_a_silence():
    rng = np.random.default_rng(4)
    values, reach, share = rng.normal(size=(60, 2)), 6, 0.05
    good, anew = rng.uniform(size=60) > 0.2, np.zeros(60, dtype=bool)
    anew[25] = True
    out = lowpass_even(values, good, anew, share, reach)
    window = np.hanning(2 * reach + 3)[1:-1] * np.sinc(2.0 * share * np.arange(-reach, reach + 1))
    for first, last in ((0, 25), (25, 60)):
        counts = good[first:last].astype(float)
        for c in range(2):
            sums = np.convolve(counts * values[first:last, c], window, "same")
            kept = sums / np.convolve(counts, window, "same")
            expected = np.where(good[first:last], kept, values[first:last, c])
            assert_allclose(out[first:last, c], expected, atol=1e-12)


def test_local_frame_both_ways():
    frame = LocalFrame(0.9, -2.0, 35.0)
    lat = np.array([0.9, 0.9001, 0.8995])
    lon = np.array([-2.0, -2.0002, -1.9999])
    alt = np.array([35.0, 80.0, 10.0])
    ned = frame.to_ned(lat, lon, alt)
    assert_allclose(ned[0], 0.0, atol=1e-9)
    # one ten-thousandth of a radian of latitude is a ten-thousandth of the meridian's radius
    a, e2 = 6378137.0, 6.69437999014e-3
    radius = a * (1.0 - e2) / (1.0 - e2 * math.sin(0.9) ** 2) ** 1.5
    assert abs(ned[1, 0] - 1e-4 * radius) < 1.0
    back = frame.to_geodetic(ned)
    for got, want in zip(back, (lat, lon, alt), strict=True):
        assert_allclose(got, want, atol=1e-8, rtol=1e-9)


def test_nodes_hold_each_fix_and_both_sides_of_a_gap():
    time = np.concatenate([np.arange(0.0, 5.0, 0.01), np.arange(8.0, 12.0, 0.01)])
    nodes = place_nodes(time, np.array([1.234, 9.876]), 20.0, 0.5)
    chosen = time[nodes]
    for instant in (1.234, 9.876):
        assert np.abs(chosen - instant).min() <= 0.0051
    assert 499 in nodes
    assert 500 in nodes
    assert np.all(np.diff(nodes) > 0)
    assert np.diff(chosen[chosen < 4.9]).max() < 0.0501


def test_one_position_does_not_show_the_scale_of_the_speed():
    drive, _ = simulate(duration=120.0, seed=6)
    vehicle = Vehicle(driveline=Driveline(speed_scale=1.05))
    first = [drive.signals[name] for name in ("latitude", "longitude")]
    single = drive.with_signals(*(Signal(s.name, s.time[:1], s.values[:1]) for s in first))
    without = find_motion(drive.without("latitude", "longitude"), vehicle)
    assert_array_equal(find_motion(single, vehicle).speed, without.speed)
    fast = without.speed > 5.0
    ratio = find_motion(single).speed[fast] / without.speed[fast]
    assert np.median(ratio) > 1.02
