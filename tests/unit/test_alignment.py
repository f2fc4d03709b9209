"""Two clocks brought together by what both have recorded."""

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from weighbridge import Signal, read_drive
from weighbridge.constants import EARTH_RADIUS
from weighbridge.signals import align


def road_speed(time, seed=0):
    """A speed that never repeats: filtered noise on a fixed fine grid, at any instant."""
    rng = np.random.default_rng(seed)
    grid = np.arange(-2000.0, 8000.0, 0.5)
    rough = rng.normal(size=grid.size)
    kernel = np.exp(-np.arange(0, 80, 0.5) / 12.0)
    smooth = np.convolve(rough, kernel, mode="same")
    smooth = np.convolve(smooth, np.hanning(13) / np.hanning(13).sum(), mode="same")
    return 15.0 + 3.0 * np.interp(time, grid, smooth) / smooth.std()


def pair(offset, *, duration=600.0, other=(100.0, 500.0), seed=0, noise=0.1, step=1 / 3.6):
    """Wheel speed in whole km/h at 4 Hz, and speed over ground at 1 Hz on another clock."""
    rng = np.random.default_rng(seed + 1)
    t = np.arange(0.0, duration, 0.25)
    wheel = Signal("vehicle_speed", t, np.round(1.02 * road_speed(t, seed) / step) * step)
    g = np.arange(*other, 1.0)
    ground = road_speed(g, seed) + rng.normal(scale=noise, size=g.size)
    return wheel, Signal("gnss_speed", g - offset, ground)


@pytest.mark.parametrize("offset", [0.0, 12.345, -350.7, 1.6e9 + 0.25])
@pytest.mark.parametrize("seed", [0, 1])
def test_offset_is_found_within_its_uncertainty(offset, seed):
    found = align(*pair(offset, seed=seed))
    assert found.found
    assert abs(found.offset - offset) < 4.0 * found.std + 0.01
    assert 0.001 < found.std < 0.2
    assert found.correlation > 0.95
    assert found.overlap == pytest.approx(400.0, abs=3.0)


def test_uncertainty_is_that_of_many_drives():
    """Standardised errors of 40 drives: chi-square of 40 within its 99.8 % interval."""
    errors = []
    for seed in range(40):
        found = align(*pair(7.3, seed=seed, noise=0.5))
        assert found.found
        errors.append((found.offset - 7.3) / found.std)
    assert 17.9 < np.sum(np.square(errors)) < 73.4


def test_recordings_that_only_overlap_in_part():
    found = align(*pair(40.0, duration=500.0, other=(300.0, 900.0)))
    assert found.found
    assert abs(found.offset - 40.0) < 4.0 * found.std + 0.01


def test_gaps_in_both_do_not_move_it():
    wheel, ground = pair(-20.0)
    w = (wheel.time < 200) | (wheel.time > 240)
    g = (ground.time < 330) | (ground.time > 390)
    found = align(
        Signal("vehicle_speed", wheel.time[w], wheel.values[w]),
        Signal("gnss_speed", ground.time[g], ground.values[g]),
    )
    assert found.found
    assert abs(found.offset + 20.0) < 4.0 * found.std + 0.02


def test_reversed_signal_only_where_the_sign_is_open():
    wheel, ground = pair(3.0)
    turned = Signal("gnss_speed", ground.time, -ground.values)
    assert not align(wheel, turned).found
    found = align(wheel, turned, signed=False)
    assert found.found
    assert found.correlation < -0.9
    assert abs(found.offset - 3.0) < 4.0 * found.std + 0.01


def test_a_drive_that_repeats_itself_is_ambiguous():
    t = np.arange(0.0, 600.0, 0.25)
    wave = Signal("vehicle_speed", t, 15.0 + 5.0 * np.sin(2 * np.pi * t / 40.0))
    g = np.arange(100.0, 400.0, 1.0)
    found = align(wave, Signal("gnss_speed", g, 15.0 + 5.0 * np.sin(2 * np.pi * g / 40.0)))
    assert not found.found
    assert "two offsets fit alike" in found.refusal
    assert found.ambiguity > 0.5


def test_two_laps_of_one_round_are_ambiguous():
    lap = road_speed(np.arange(0.0, 300.0, 0.25))
    t = np.arange(0.0, 600.0, 0.25)
    both = Signal("vehicle_speed", t, np.concatenate([lap, lap]))
    found = align(both, Signal("gnss_speed", t[:800], lap[:800]))
    assert not found.found
    assert "two offsets fit alike" in found.refusal


@pytest.mark.parametrize(
    ("wheel", "ground", "why"),
    [
        (lambda s: s, lambda s: Signal(s.name, s.time, np.full(len(s), 9.0)), "does not change"),
        (lambda s: s, lambda s: Signal(s.name, s.time[:20], s.values[:20]), "30 s are needed"),
        (
            lambda s: s,
            lambda s: Signal(s.name, s.time, road_speed(s.time, 77)),
            "agree at no offset",
        ),
        (lambda s: s, lambda s: Signal(s.name, s.time * 500.0, s.values), "longer than a day"),
    ],
)
def test_refusals(wheel, ground, why):
    a, b = pair(5.0)
    found = align(wheel(a), ground(b))
    assert not found.found
    assert why in found.refusal


def test_constant_speed_with_noise_is_refused():
    rng = np.random.default_rng(3)
    t, g = np.arange(0.0, 600.0, 0.25), np.arange(0.0, 600.0, 1.0)
    a = Signal("vehicle_speed", t, 20.0 + rng.normal(scale=0.1, size=t.size))
    b = Signal("gnss_speed", g, 20.0 + rng.normal(scale=0.1, size=g.size))
    assert not align(a, b).found


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0.001, 50.0), st.floats(-1e6, 1e6)), min_size=0, max_size=60),
    st.lists(st.tuples(st.floats(0.001, 50.0), st.floats(-1e6, 1e6)), min_size=0, max_size=60),
)
def test_anything_gives_an_offset_or_a_reason(first, second):
    def made(rows):
        time = np.cumsum([r[0] for r in rows]) if rows else np.zeros(0)
        return Signal("vehicle_speed", time, np.array([r[1] for r in rows]))

    found = align(made(first), made(second))
    assert found.found == (found.refusal == "")
    assert not found.found or np.isfinite([found.offset, found.std]).all()


def test_repeated_speed_without_noise_is_ambiguous_too():
    t = np.arange(0.0, 600.0, 0.5)
    v = 15.0 + 8.0 * np.sin(2.0 * np.pi * t / 40.0)
    found = align(Signal("vehicle_speed", t, v), Signal("gnss_speed", t + 5000.0, v))
    assert "two offsets fit alike" in found.refusal


@pytest.mark.parametrize("held", [1, 4])
def test_turning_aligns_where_an_app_repeats_the_last_fix(tmp_path, held):
    """Fixes of once per second stand in each row of a log of four rows per second."""
    rng = np.random.default_rng(12)
    fixes = np.arange(0.0, 900.0, 1.0)
    turn = 0.05 * (road_speed(np.arange(0.0, 900.0, 0.02), 5) - 15.0)
    heading = np.cumsum(turn) * 0.02
    course = heading[::50] + np.deg2rad(rng.normal(0.0, 1.0, fixes.size))
    rows = np.repeat(np.arange(fixes.size), held)
    stamps = 1.7e9 + np.arange(rows.size) / held
    path = np.cumsum(10.0 * np.cos(course)) / EARTH_RADIUS
    time = np.arange(turn.size) * 0.02 + 4.0
    gyro = {
        f"gyro_{axis}_radps": part * turn + rng.normal(0.0, 0.02, turn.size)
        for axis, part in zip("xyz", (0.6, 0.0, 0.8), strict=True)
    }
    app = {
        "course_deg": np.rad2deg(np.mod(course, 2.0 * np.pi))[rows],
        "speed_mps": np.full(rows.size, 10.0),
        "latitude_deg": np.rad2deg(path[rows]),
    }
    pl.DataFrame({"time_s": stamps} | app).write_csv(tmp_path / "gnss.csv")
    pl.DataFrame({"time_s": time} | gyro).write_csv(tmp_path / "imu.csv")
    drive = read_drive(tmp_path)
    assert any(p.id == "clock.aligned" for p in drive.problems)
    late = drive.signals["gyro_x"].time[0] - drive.signals["gnss_speed"].time[0]
    assert abs(late) < 1.0
