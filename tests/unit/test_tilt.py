"""Change of load by the tilt of a parked vehicle, beside springs that are known."""

import numpy as np
import pytest
from kerb_model import CAR, RATE, Forces, random_vehicle, stand

from weighbridge.estimators import tilt
from weighbridge.estimators.tilt import Learnt, TiltMap

PITCH = 0.1
"""Of a vehicle by a load as heavy as itself [rad]."""

AXIS = np.array([1.0, 0.0, 0.0])


def learnt(changes, *, pitch=PITCH, places=(1.0,), seed=1):
    """Map of a vehicle whose pitch follows its load, by places of it."""
    rng = np.random.default_rng(seed)
    stops = [
        Learnt(pitch * x * places[k % len(places)] + rng.normal(0.0, 3e-4), 1e-8, x, 0.01**2)
        for k, x in enumerate(changes)
    ]
    return TiltMap(tuple(stops))


CHANGES = (0.2, -0.15, 0.1, 0.0, -0.1, 0.25, -0.2, 0.0, 0.12, -0.18)


def seen(tilts, seconds=None):
    """A stop with a pitch [rad] for each second."""
    now = tilt.begin(0.0)
    for k, pitch in enumerate(tilts, start=1):
        now = tilt.step(now, float(k), 9.81 * np.array([np.sin(pitch), 0.0, -np.cos(pitch)]))
    return now


def test_a_change_is_read_with_its_sign_and_size():
    map_ = learnt(CHANGES)
    for change in (0.15, -0.15):
        found = map_.read(PITCH * change, 1e-8, 60.0)
        assert found.sure
        assert found.change == pytest.approx(change, abs=2.0 * found.std)
        assert found.std < 0.05


@pytest.mark.parametrize("pitch", [0.0, 3e-4, -6e-4])
def test_what_the_body_does_without_a_load_is_no_change(pitch):
    assert not learnt(CHANGES).read(pitch, 1e-8, 60.0).sure


def test_nothing_is_read_before_two_changes_were_weighed():
    map_ = learnt((0.2, 0.0, 0.01))
    assert map_.follows is None
    assert map_.read(0.02, 1e-8, 60.0) is None
    assert learnt((0.2, 0.0, -0.2)).read(0.02, 1e-8, 60.0) is not None


def test_a_suspension_that_levels_itself_is_left_alone():
    map_ = learnt(CHANGES, pitch=0.002)
    assert map_.follows is False
    assert map_.read(0.02, 1e-8, 60.0) is None


def test_a_load_that_lies_elsewhere_each_time_has_a_wider_interval():
    same, other = learnt(CHANGES), learnt(CHANGES, places=(1.0, 0.5, 1.5))
    narrow, wide = (m.read(0.02, 1e-8, 60.0) for m in (same, other))
    assert wide.std > 2.0 * narrow.std
    assert abs(wide.change - 0.2) < 2.0 * wide.std


def test_a_sensor_that_was_moved_shows_no_load():
    assert learnt(CHANGES).read(0.1, 1e-8, 60.0) is None


def test_who_leans_for_a_moment_does_not_tilt_it():
    still, leant = [0.0] * 40, [0.0] * 32 + [0.02] * 8
    assert tilt.tilt(seen(leant), AXIS).pitch == pytest.approx(tilt.tilt(seen(still), AXIS).pitch)
    loaded = tilt.tilt(seen([0.0] * 25 + [0.02] * 15), AXIS)
    assert loaded.pitch == pytest.approx(0.02, rel=0.01)


def test_a_launch_does_not_count():
    now = seen([0.0] * 6 + [0.01] * 2 + [0.05] * 2)
    assert tilt.tilt(now, AXIS, ends=True).pitch == pytest.approx(0.01, rel=0.01)


def test_a_short_stop_shows_nothing():
    assert tilt.tilt(seen([0.0] * 5), AXIS, ends=True) is None


def put(kg, place, *, levels=False, seconds=200.0, seed=7_900):
    """A car of the study's model with a load for good: pitch before and after [rad]."""
    car = random_vehicle(CAR, seed, levels=levels)
    time = np.arange(-3.0, seconds, 1.0 / RATE)
    n = time.size
    f = Forces(time, np.zeros((n, 2)), np.zeros(n), np.zeros(n), np.zeros(n))
    f.put(20.0, kg, place, 0.0)
    pitch = stand(car, 0.0, f, np.random.default_rng(1)).pitch
    return pitch[: int(10 * RATE)].mean(), pitch[-int(10 * RATE) :].mean()


def test_the_model_tilts_by_what_cars_do():
    """200 kg over the rear axle of a car: some 14 mrad."""
    changes = [np.subtract(*put(200.0, 1.0, seed=s)[::-1]) for s in range(7_900, 7_920)]
    assert 0.009 < np.median(changes) < 0.019
    between = [np.subtract(*put(200.0, 0.5, seed=s)[::-1]) for s in range(7_900, 7_920)]
    assert abs(np.median(between)) < 0.004


def test_the_model_levels_itself():
    before, after = put(200.0, 1.0, levels=True)
    assert abs(after - before) < 0.004
