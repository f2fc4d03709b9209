"""A live scale at the kerb: its mass is that of the motion, and beside it stands what tilts."""

import copy
import math

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.estimators.tilt import Learnt, TiltMap
from weighbridge.live.kerb import LIGHTS, Kerb, Weighed
from weighbridge.signals import Drive, Signal

PROVED = 120.0
"""On the move, after which a mass of before a silence counts without a report [s]."""

PITCH = 0.1
RATE = 20.0
STOPS = ((0.2, 2e-4), (-0.15, -3e-4), (0.1, 1e-4), (0.0, 3e-4), (-0.1, 0.0), (0.2, -2e-4))
MAP = TiltMap(tuple(Learnt(PITCH * x + beside, 1e-8, x, 1e-4) for x, beside in STOPS))


def gravity(pitch):
    """Specific force along forward, right, down of a vehicle at rest (n, 3) [m/s^2]."""
    return 9.81 * np.column_stack([np.sin(pitch), 0.0 * pitch, -np.cos(pitch)])


def standing(scale, start, pitch, rot_bs):
    """Let the scale stand, with a pitch for each sample."""
    time = start + np.arange(pitch.size) / RATE
    force = gravity(pitch) @ rot_bs
    samples = {f"accel_{a}": (time, force[:, k].copy()) for k, a in enumerate("xyz")}
    samples |= {f"gyro_{a}": (time, np.zeros(time.size)) for a in "xyz"}
    samples["vehicle_speed"] = (time[::4], np.zeros(time[::4].size))
    scale.update_block(samples)
    return scale.weighing()


@pytest.fixture
def parked(half_driven, setup):
    scale = half_driven
    scale._kerb.map = MAP
    pitch = np.concatenate([np.full(int(30 * RATE), 0.004), np.full(int(40 * RATE), 0.016)])
    before = scale.weighing().mass
    told = standing(scale, scale.newest + 1.0, pitch, setup.navigation.rot_bs)
    return scale, before, told


def test_a_load_at_the_kerb_is_reported_beside_the_mass(parked):
    _, before, told = parked
    assert told.kerb.follows
    assert told.kerb.change == pytest.approx(0.12 * before, abs=2.0 * told.kerb.std)
    assert told.mass == pytest.approx(before, rel=0.01)
    shown = told.to_dict()
    assert shown["kerb"]["status"] == "watching"
    assert shown["kerb"]["change_kg"] == told.kerb.change
    assert shown["kerb"]["interval95_kg"][0] > 0.0
    assert "live.by_tilt" in [p.id for p in told.problems]


def test_a_scale_that_was_restored_goes_on_with_the_tilt(parked, weighing):
    scale, _, told = parked
    again = wb.LiveScale.restore(weighing.vehicle, scale.checkpoint())
    assert again.weighing().kerb == told.kerb
    assert again.checkpoint() == scale.checkpoint()


def test_an_old_state_leaves_how_the_vehicle_tilts(parked, weighing):
    scale, *_ = parked
    new = wb.LiveScale(weighing.vehicle)
    new.take_over(scale)
    assert new.weighing().kerb.weighed == scale.weighing().kerb.weighed == 5
    assert math.isnan(new.weighing().kerb.change)


def test_the_mass_does_not_depend_on_what_tilts(half_driven, setup):
    with_map, without = half_driven, copy.deepcopy(half_driven)
    with_map._kerb.map = MAP
    pitch = np.repeat([0.004, 0.016], int(30 * RATE))
    start = with_map.newest + 1.0
    told = [standing(s, start, pitch, setup.navigation.rot_bs) for s in (with_map, without)]
    assert math.isfinite(told[0].kerb.change)
    assert math.isnan(told[1].kerb.change)
    assert told[1].to_dict()["kerb"] == {
        "status": "learning", "weighed_changes": 0, "change_kg": None, "std_kg": None,
        "interval95_kg": None,
    }  # fmt: skip
    assert told[0].mass == told[1].mass
    assert told[0].std == told[1].std


class Trip:
    """Stops of a vehicle, and the move between them, in steps of a second."""

    def __init__(self):
        self.kerb, self.now = Kerb(), 0.0

    def stop(self, pitches, mass):
        axis = np.array([1.0, 0.0, 0.0])
        for pitch in pitches:
            self.now += 1.0
            time = self.now - 1.0 + np.arange(10) / 10.0
            force = gravity(np.full(10, pitch))
            signals = {f"accel_{a}": force[:, k] for k, a in enumerate("xyz")}
            seen = Drive("seen", {n: Signal(n, time, v) for n, v in signals.items()})
            self.kerb.stay(seen, self.now, 1.0, forward=axis, mass=Weighed(mass, 100.0))

    def move(self, seconds):
        for _ in range(int(seconds)):
            self.now += 1.0
            self.kerb.move(1.0, np.array([1.0, 0.0, 0.0]))


def loaded(change, seconds=2.0 * LIGHTS):
    half = int(seconds / 2)
    return [0.0] * half + [PITCH * change] * half


def test_it_learns_from_what_the_motion_weighs_after_each_stop():
    trip, mass = Trip(), 1500.0
    for change in (0.2, -0.1, 0.15, -0.2):
        trip.stop(loaded(change), mass)
        trip.move(PROVED + 10.0)
        mass *= 1.0 + change
    trip.stop([0.0] * 70, mass)
    trip.move(1.0)
    state = trip.kerb.state()
    assert (state.weighed, state.follows) == (4, True)
    assert [s.change for s in trip.kerb.map.stops] == pytest.approx([0.2, -0.1, 0.15, -0.2])
    trip.stop(loaded(0.1), mass)
    assert trip.kerb.state().change == pytest.approx(0.1 * mass, rel=0.5)
    # When the motion has weighed it, the tilt no longer counts.
    trip.move(PROVED + 1.0)
    assert math.isnan(trip.kerb.state().change)


def test_stops_between_which_nothing_was_weighed_count_as_one():
    trip = Trip()
    trip.stop(loaded(0.1), 1500.0)
    trip.move(PROVED / 2.0)
    trip.stop(loaded(0.05), 1500.0)
    trip.move(PROVED + 1.0)
    trip.stop(loaded(0.0), 1725.0)
    trip.move(1.0)
    (one,) = trip.kerb.map.stops
    assert one.change == pytest.approx(0.15)
    assert one.pitch == pytest.approx(0.15 * PITCH, rel=0.01)


def test_a_traffic_light_is_no_stop_at_the_kerb():
    trip = Trip()
    trip.stop(loaded(0.2), 1500.0)
    for _ in range(4):
        trip.move(PROVED / 3.0)
        trip.stop([0.0] * 30, 1800.0)
    trip.move(10.0)
    assert trip.kerb.map.stops == ()
    trip.stop(loaded(0.0), 1800.0)
    trip.move(1.0)
    assert [s.change for s in trip.kerb.map.stops] == pytest.approx([0.2])
