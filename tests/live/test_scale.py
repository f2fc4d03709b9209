"""A live scale beside the forward pass of the recorded drive, whatever the way samples come."""

import copy
import re
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest

import weighbridge as wb
from tests.live.conftest import PHONE
from tests.noted import error
from weighbridge import ConfigError, LiveStatus
from weighbridge.balance import WINDOW
from weighbridge.estimators.judging import STOP
from weighbridge.live.on_the_move import REST, OnTheMove
from weighbridge.live.records import LATENESS
from weighbridge.pipeline.forward import (
    begin,
    forward_weigh,
    identify_forward,
    lateness,
    resume,
    step,
    with_open,
)
from weighbridge.signals import LONGEST_STEP, QUANTITIES, STEP, recent, step_ends
from weighbridge.simulation import MIDSIZE, Loading, Scenario, short_route, simulate_car


def blocks(drive, edges):
    """Samples of a drive between one edge and the next."""
    for a, b in pairwise(edges):
        part = drive.between(a, b)
        yield {n: (s.time, s.values) for n, s in part.signals.items()}


def fed(scale, drive, edges):
    for block in blocks(drive, edges):
        scale.update_block(block)
    scale.finish()
    return scale.weighing()


def even(drive, length):
    return np.append(np.arange(drive.start, drive.end, length), drive.end + 1.0)


def test_steps_of_four_seconds_end_where_those_of_one_do(brief, weighing, setup):
    """A drive does not end with a whole step: what is left is weighed as well."""
    ends = []
    for length in (STEP, LONGEST_STEP):
        scale = wb.LiveScale(
            weighing.vehicle, setup=replace(setup, step=length), info=weighing.drive.info
        )
        ends.append(fed(scale, brief, [brief.start, brief.end + 1.0]))
    assert ends[1].time == ends[0].time
    assert ends[1].mass == pytest.approx(ends[0].mass, rel=1e-3)
    assert ends[1].std == pytest.approx(ends[0].std, rel=1e-2)


def test_live_is_the_forward_pass_to_the_last_bit(brief, weighing, setup, forward_brief):
    late, lengths = 0.9, (0.4, 7.0, 0.9, 2.3, 0.7, 21.0, 1.1)
    edges = [brief.start]
    while edges[-1] < brief.end:
        edges.append(edges[-1] + lengths[len(edges) % len(lengths)])
    edges.append(edges[-1] + 1.0)
    rng = np.random.default_rng(11)
    scale = wb.LiveScale(weighing.vehicle, setup=setup, info=weighing.drive.info)
    held = {}
    for block in blocks(brief, edges):
        # Some samples come with the next block, just not too late; within a block any order.
        newest = max((t[-1] for t, _ in block.values()), default=-np.inf)
        now, held, before = {}, {}, held
        for name, (time, values) in block.items():
            order = rng.permutation(time.size)
            hold = (rng.random(time.size) < 0.3) & (time > newest - late)
            now[name] = time[order][~hold[order]], values[order][~hold[order]]
            held[name] = time[order][hold[order]], values[order][hold[order]]
        scale.update_block(before)
        scale.update_block(now)
    scale.update_block(held)
    scale.finish()
    told = scale.weighing()
    assert not told.provisional
    assert not any(s.late or s.unfit for s in told.signals)
    assert told.mass == forward_brief.state.mass - scale._state.force.fuel
    assert told.std == forward_brief.std[-1]


def test_single_samples_are_blocks_of_one(short, middle, half_driven):
    part = short.between(np.nextafter(middle, np.inf), middle + 10.0)
    single, whole = half_driven, copy.deepcopy(half_driven)
    samples = sorted(
        (t, n, v)
        for n, s in part.signals.items()
        for t, v in zip(s.time.tolist(), s.values.tolist(), strict=True)
    )
    before = single.weighing().mass
    for time, name, value in samples:
        single.update(time, name, value)
    single.finish()
    assert single.weighing().mass == fed(whole, part, [part.start, part.end + 1.0]).mass != before
    assert single.checkpoint() == whole.checkpoint()


@pytest.mark.parametrize("step", [0.25, LONGEST_STEP])
def test_other_steps_are_those_of_the_setup(brief, weighing, step):
    setup = identify_forward(weighing, step)
    forward = forward_weigh(brief, setup)
    scale = wb.LiveScale(weighing.vehicle, setup=setup, info=weighing.drive.info)
    told = fed(scale, brief, even(brief, 3.0))
    assert told.std == forward.std[-1]
    assert told.mass == forward.state.mass - scale._state.force.fuel


def test_a_bus_three_seconds_late_is_weighed_soon(short, car):
    """The whole table is moved, in the stages as in what is looked at."""

    def told(drive):
        scale, first = wb.LiveScale(car, info=drive.info, step=LONGEST_STEP), np.inf
        for block in blocks(drive, even(drive, 4.0)):
            scale.update_block(block)
            now = scale.weighing()
            assert now.status is not LiveStatus.INCONSISTENT
            if np.isfinite(now.mass):
                first = min(first, now.driven)
        before = now.mass
        scale.finish()
        return first, before, scale.weighing()

    late = short.with_signals(
        *(
            replace(s, time=s.time + 3.0)
            for s in short.signals.values()
            if QUANTITIES[s.name].table == "obd"
        )
    )
    first, before, end = told(short)
    first_late, before_late, end_late = told(late)
    # A look or two later: the clock takes 90 s of records.
    assert first_late <= first + 35.0
    assert end_late.mass == pytest.approx(end.mass, abs=end.std)
    assert before_late == pytest.approx(before, abs=end.std)
    assert any(p.id == "clock.moved" for p in end_late.problems)


def test_a_step_that_rounds_is_refused(car):
    with pytest.raises(ConfigError, match=r"0\.25, 0\.5, 1"):
        wb.LiveScale(car, step=0.3)


def test_the_settled_mass_is_as_old_as_lateness_look_ahead_and_step(looked_at, setup):
    """Samples come in blocks of 0.1 s, as from a source."""
    ages = np.array([a for a in looked_at.ages if np.isfinite(a)])[100:]
    # A torque reading, and so a row, comes a tenth of a second after the one before.
    row = 1.5 * setup.period
    assert np.percentile(ages, 99.0) < LATENESS + lateness(setup) + STEP + row
    assert np.percentile(ages, 1.0) > LATENESS


class LookedAt(NamedTuple):
    """A drive as it comes in blocks of 0.1 s: what is shown of it each second, and what settles.

    ``ages`` are those of the settled mass at each third block [s].
    """

    shown: list
    settled: np.ndarray
    ages: list


def looked_at_each_second(scale, drive, late=0.0):
    """Of ``late`` [s], a third of the samples come so much later than the others."""
    rng, held, shown, settled, shown_at = np.random.default_rng(7), {}, [], [], -np.inf
    ages = []
    for k, block in enumerate(blocks(drive, even(drive, 0.1))):
        before, held, now = held, {}, {}
        for name, (time, values) in block.items():
            hold = (rng.random(time.size) < 1.0 / 3.0) & (late > 0.0)
            now[name], held[name] = (time[~hold], values[~hold]), (time[hold], values[hold])
        scale.update_block(now)
        scale.update_block(before)
        if k % 3 == 0:
            ages.append(scale.weighing().age)
        if scale._state is None or not scale._state.joint.windows:
            continue
        if not settled or scale._state.force.time > settled[-1][0]:
            joint = with_open(scale._state, scale._setup)
            std = joint.std(scale._setup.joint)
            settled.append((scale._state.force.time, joint.mass - scale._state.force.fuel, std))
        if scale.newest - shown_at >= 1.0:
            shown_at = scale.newest
            shown.append(scale.weighing(ahead=True))
    return LookedAt(shown, np.array(settled), ages)


@pytest.fixture(scope="module")
def looked_at(brief, weighing, setup):
    scale = wb.LiveScale(weighing.vehicle, setup=setup, info=weighing.drive.info)
    return looked_at_each_second(scale, brief)


def test_the_provisional_mass_is_young_and_near_the_settled_one(looked_at):
    shown, settled, _ = looked_at
    told = [w for w in shown if np.isfinite(w.mass) and w.time <= settled[-1, 0]]
    assert len(told) > 60
    assert all(w.provisional for w in told)
    assert np.percentile([w.age for w in told], 99.0) <= LATENESS + 0.2
    known, std = (np.interp([w.time for w in told], settled[:, 0], settled[:, k]) for k in (1, 2))
    assert np.array([w.std for w in told]) == pytest.approx(std, rel=0.1)
    far = np.array([(w.mass - m) / w.std for w, m in zip(told, known, strict=True)])
    assert np.sqrt(np.mean(far**2)) < 0.05
    assert np.abs(far).max() < 0.5


def test_the_provisional_mass_waits_for_no_late_sample(brief, weighing, setup):
    """A third of the samples come 0.1 s late: it is no older, and within a standard deviation."""
    scale = wb.LiveScale(weighing.vehicle, setup=setup, info=weighing.drive.info)
    shown, settled, _ = looked_at_each_second(scale, brief, late=0.1)
    told = [w for w in shown if np.isfinite(w.mass) and w.time <= settled[-1, 0]]
    assert np.percentile([w.age for w in told], 99.0) <= LATENESS + 0.2
    known = np.interp([w.time for w in told], settled[:, 0], settled[:, 1])
    far = np.array([(w.mass - m) / w.std for w, m in zip(told, known, strict=True)])
    assert np.abs(far).max() < 0.5


def test_a_look_ahead_leaves_no_trace(short, middle, half_driven):
    """The states of two scales are the same to the last letter; one of them is looked at."""
    kept, part = [], short.between(middle, middle + 15.0)
    for looks in (False, True):
        scale = copy.deepcopy(half_driven)
        for block in blocks(part, even(part, 0.5)):
            scale.update_block(block)
            if looks:
                scale.weighing(ahead=True)
        assert scale.weighing(ahead=True).mass != scale.weighing().mass
        kept.append(scale.checkpoint())
    assert kept[0] == kept[1]


def test_an_open_window_that_is_full_counts_as_the_whole_one(brief, weighing, setup):
    """Of one that has fewer rows the noise is larger, so that it moves the mass less."""
    state, whole = begin(setup, brief.start), 0
    for until in np.arange(brief.start, brief.end, 0.125):
        after, _ = step(state, recent(brief, until), until, setup)
        if state.windows.stood >= STOP:
            assert with_open(state, setup) == state.joint
        elif after.joint.windows > state.joint.windows:
            whole += 1
            full = replace(setup, period=WINDOW / state.windows.rows)
            told = with_open(state, full)
            assert told.mass == pytest.approx(after.joint.mass, rel=1e-12)
            assert told.var == pytest.approx(after.joint.var, rel=1e-12)
            less = with_open(state, replace(setup, period=0.5 * full.period))
            assert less.var > told.var
        state = after
    assert whole > 5


def test_a_scale_learns_and_weighs(car, loaded):
    scale = wb.LiveScale(car, info=loaded.drive.info, step=LONGEST_STEP)
    drive = loaded.drive.between(loaded.drive.start, loaded.drive.start + 380.0)
    statuses = []
    for block in blocks(drive, even(drive, 5.0)):
        scale.update_block(block)
        statuses.append(scale.weighing().status)
    scale.finish()
    told = scale.weighing()
    assert statuses[0] is LiveStatus.LEARNING
    assert told.status is LiveStatus.WEIGHED
    # At the end all records are weighed as those of a recorded drive are.
    assert told.mass == pytest.approx(wb.weigh(drive, car).mass, rel=0.001)
    low, high = told.interval()
    assert low < loaded.scenario.mass < high
    assert told.progress > 0.3
    assert all(s.fresh for s in told.signals if s.needed)


def test_a_first_mass_is_shown_before_it_counts_as_weighed(car, loaded):
    scale = wb.LiveScale(car, info=loaded.drive.info, step=LONGEST_STEP)
    begin = loaded.drive.start
    part = loaded.drive.between(begin, begin + 150.0)
    first, before = None, []
    for block in blocks(part, even(part, 5.0)):
        scale.update_block(block)
        told = scale.weighing()
        if first is None:
            before.append(told.progress_to_5)
        if first is None and np.isfinite(told.mass):
            first = told
    assert first is not None
    assert first.driven < 90.0
    assert first.status is LiveStatus.LEARNING
    assert first.reason_id.startswith(("motion.", "live.wide"))
    low, high = first.interval()
    assert low < loaded.scenario.mass < high
    assert high - low < 0.31 * first.mass
    # The way to 5 %: nothing is known before the first look.
    assert np.isnan(before[0])
    assert before[-1] == pytest.approx((0.1 * first.mass / (high - low)) ** 2)
    same = wb.LiveScale(car, info=loaded.drive.info, step=LONGEST_STEP)
    for block in blocks(part, even(part, 37.0)):
        same.update_block(block)
    assert same.weighing().mass == told.mass


def test_looks_are_frequent_until_there_is_a_mass():
    move, at = OnTheMove(), []
    for _ in range(600):
        move.go_on(1.0, moved=True)
        if move.is_due:
            at.append(move.driven)
            move.looks(weighed=len(at) > 4)
    assert at == [30.0, 45.0, 60.0, 75.0, 90.0, 135.0, 203.0, 305.0, 458.0]
    move.look_soon(90.0)
    for _ in range(100):
        move.go_on(1.0, moved=True)
        if move.is_due:
            at.append(move.driven)
            move.looks(weighed=True)
    assert at[9:] == [630.0, 645.0, 668.0]
    assert move.rested == 0.0


def test_a_checkpoint_loses_nothing(short, weighing, forward, half_driven):
    scale = half_driven
    rest = scale.newest
    saved = scale.checkpoint()
    assert len(saved) < 3e6
    again = wb.LiveScale.restore(weighing.vehicle, saved)
    assert again.weighing().mass == scale.weighing().mass
    assert again.weighing().status is LiveStatus.LEARNING
    assert again.weighing().reason_id == "live.no_sample"
    told = fed(again, short, [np.nextafter(rest, np.inf), short.end + 1.0])
    assert told.std == forward.std[-1]
    assert told.mass == forward.state.mass - again._state.force.fuel


@pytest.mark.parametrize(
    "damage",
    [
        lambda b: b[: len(b) // 2],
        lambda b: b.replace('"d"', '"x"', 1),
        lambda b: re.sub(r'checkpoint": \d+', 'checkpoint": 99', b, count=1),
        lambda b: "\xff" + b,
        lambda b: "",
    ],
)
def test_a_damaged_checkpoint_is_refused(weighing, half_driven, damage):
    saved = half_driven.checkpoint()
    assert damage(saved) != saved
    with pytest.raises(ConfigError):
        wb.LiveScale.restore(weighing.vehicle, damage(saved))


def test_a_checkpoint_of_another_vehicle_is_refused(weighing, setup):
    saved = wb.LiveScale(weighing.vehicle, setup=setup, info=weighing.drive.info).checkpoint()
    with error(ConfigError):
        wb.LiveScale.restore(replace(weighing.vehicle, tare=1000.0), saved)


def test_a_silence_of_hours_costs_no_steps(short, middle, half_driven, setup, forward):
    """After five hours without a sample the mass stays, and memory and time do not grow."""
    gap = 5 * 3600.0

    def later(than):
        return short.with_signals(
            *(
                replace(s, time=np.where(s.time < than, s.time, s.time + gap))
                for s in short.signals.values()
            )
        )

    # An hour is the farthest that a stamp may lie ahead; then the clock is taken to have jumped.
    told = fed(half_driven, later(middle), [middle + 1.0, short.end + gap + 1.0])
    # The load may have changed meanwhile, so a few windows tell less than they do without a stop.
    assert abs(told.mass - forward.mass[-1]) < forward.std[-1]
    direct = forward_weigh(later(short.start + 120.0), setup)
    assert abs(direct.mass[-1] - forward.mass[-1]) < 2.0 * direct.std[-1]
    assert direct.std[-1] > forward.std[-1]


def test_a_silence_after_the_state_was_kept_is_survived(short, middle, half_driven, forward):
    """An adapter is unplugged for half a minute; a slow signal had nothing open just before."""
    gone = middle + 10.0
    scale = half_driven
    scale.update(scale.newest, "ambient_temperature", 20.0)
    for block in blocks(short, even(short.between(middle, gone), 0.5)):
        scale.update_block(block)
        scale.checkpoint()
    for block in blocks(short, even(short.between(gone + 30.0, short.end), 0.5)):
        scale.update_block(block)
    scale.finish()
    assert abs(scale.weighing().mass - forward.mass[-1]) < forward.std[-1]


def test_a_clock_that_jumps_is_brought_back(short, middle, half_driven, forward):
    """From 1970 to the date in mid-drive: time goes on, and it is said once."""
    scale, jump = half_driven, 1.7e9
    for block in blocks(short, even(short.between(middle, short.end), 0.5)):
        scale.update_block({n: (t + jump, v) for n, (t, v) in block.items()})
    scale.finish()
    told = scale.weighing()
    assert told.mass == pytest.approx(forward.mass[-1], rel=0.01)
    assert [p.id for p in told.problems].count("live.clock_jumps") == 1


def test_unfit_and_late_samples_are_counted(middle, half_driven):
    scale = half_driven
    scale.update(middle - 10.0, "vehicle_speed", 3.0)
    scale.update(middle + 10.0, "vehicle_speed", float("nan"))
    speed = next(s for s in scale.weighing().signals if s.name == "vehicle_speed")
    assert (speed.late, speed.unfit) == (1, 1)
    with error(ConfigError, "warp_factor weighbridge.signals.catalogue"):
        scale.update(1.0, "warp_factor", 9.0)


def test_a_signal_that_stays_away_is_named(short, weighing):
    scale = wb.LiveScale(weighing.vehicle)
    part = short.between(short.start, short.start + 60.0)
    told = fed(scale, part.without("engine_load"), even(part, 5.0))
    assert told.status is LiveStatus.LEARNING
    assert np.isnan(told.mass)
    assert "engine_load" in told.reason


def test_a_parked_vehicle_keeps_its_mass_while_it_is_asked_each_30_s(weighing, setup, short):
    """The adapter asks a vehicle that is off one request each 30 s; the sensor goes on."""
    stands = float(short.speed.time[short.speed.values == 0.0][-1])
    part = short.between(short.start, stands)
    scale = wb.LiveScale(weighing.vehicle, setup=setup, info=short.info)
    scale.update_block({n: (s.time, s.values) for n, s in part.signals.items()})
    before = scale.weighing()
    assert not before.parked
    time = np.arange(stands + 0.02, stands + 100.0, 0.02)
    seen = []
    for first in range(0, time.size, 250):
        now = time[first : first + 250]
        block = {
            n: (now, np.full(now.size, s.values[-1]))
            for n, s in part.signals.items()
            if n.startswith(("accel_", "gyro_"))
        }
        asked = np.arange(stands + 30.0, now[-1], 30.0)
        asked = asked[asked >= now[0]]
        if asked.size:
            block["vehicle_speed"] = asked, np.zeros(asked.size)
        scale.update_block(block)
        seen.append(scale.weighing())
    assert all(w.parked for w in seen)
    assert {w.status for w in seen} == {before.status}
    assert all(w.mass == pytest.approx(before.mass, rel=0.01) for w in seen)
    assert not any(s.fails for w in seen for s in w.signals)
    # It drives off, and the torque does not come: that is a fault again.
    off = time[-1] + np.arange(0.1, 6.0, 0.1)
    scale.update_block({"vehicle_speed": (off, np.linspace(0.0, 8.0, off.size))})
    gone = scale.weighing()
    assert not gone.parked
    assert gone.reason_id == "live.silent" or "not come" in gone.reason


def test_what_never_came_is_a_fault_of_a_vehicle_that_stands_too(weighing, setup, short):
    still = short.speed.time[short.speed.values == 0.0]
    stands = float(still[still < short.start + 100.0][-1])
    part = short.without("engine_load").between(short.start, stands)
    scale = wb.LiveScale(weighing.vehicle, setup=setup, info=short.info)
    scale.update_block({n: (s.time, s.values) for n, s in part.signals.items()})
    parked = scale.weighing(60.0)
    assert parked.parked
    assert [s.name for s in parked.signals if s.fails] == ["engine_load"]


def test_a_signal_that_comes_each_30_s_is_not_silent(car):
    scale = wb.LiveScale(car)

    def health(silence=0.0):
        return {s.name: s for s in scale.weighing(silence).signals}

    for k in range(100):
        scale.update(float(k), "vehicle_speed", 20.0)
        if k % 30 == 5:
            scale.update(float(k), "ambient_temperature", 290.0)
        assert k < 5 or health()["ambient_temperature"].fresh, k
    found = health(100.0)
    assert not found["ambient_temperature"].fresh
    assert not found["vehicle_speed"].fresh
    assert found["ambient_temperature"].rate == pytest.approx(1.0 / 30.0)


def test_a_change_of_load_forgets_the_learned_mass_and_its_records(car, loaded):
    """Records of the load before are neither shown nor weighed again."""
    scale = wb.LiveScale(car, info=loaded.drive.info)
    part = loaded.drive.between(loaded.drive.start, loaded.drive.start + 150.0)
    for block in blocks(part, even(part, 20.0)):
        scale.update_block(block)
    assert scale.weighing().mass > 0.0
    scale.load_changed()
    assert np.isnan(scale.weighing().mass)
    assert scale.recorded().signals["accel_x"].duration < 1.0


@pytest.fixture(scope="module")
def delivered():
    """Simulate a car that takes 400 kg on in two minutes on its way."""
    route = short_route()
    made = simulate_car(
        Scenario(
            name="more", car=MIDSIZE, route=route, payload=100.0, sensors=PHONE, seed=51_011,
            loading=(Loading(distance=0.45 * route.length, duration=120.0, load=500.0),),
        )
    )  # fmt: skip
    return made, made.drive.between(made.drive.start, made.drive.start + 640.0)


@pytest.mark.parametrize("equipment", ["setup", "learnt", "no inertial sensor"])
def test_after_a_stop_the_mass_of_before_is_as_unsure_as_its_load(
    car, weighing, setup, delivered, equipment
):
    """While the vehicle stands the mass stays; on the move it holds the new load at once."""
    made, part = delivered
    if equipment == "no inertial sensor":
        part = part.without(*(n for n in part.signals if n.startswith(("accel_", "gyro_"))))
    scale = wb.LiveScale(
        car, info=made.drive.info, step=LONGEST_STEP,
        setup=replace(setup, step=LONGEST_STEP) if equipment == "setup" else None,
    )  # fmt: skip
    speed, new = part.speed, made.scenario.mass + 400.0
    seen = []
    for edge, block in zip(even(part, 4.0)[1:], blocks(part, even(part, 4.0)), strict=False):
        scale.update_block(block)
        moves = speed.held(np.array([edge]))[0] > 1.0
        seen.append((edge, bool(moves), scale.weighing(), scale.weighing(ahead=True)))
    kept = wb.LiveScale.restore(car, scale.checkpoint())
    assert (kept._move.rested, kept._move.anew) == (scale._move.rested, scale._move.anew)
    assert (scale._move.anew > 0.0) == (equipment == "no inertial sensor")
    stands = [k for k, (_, moves, *_) in enumerate(seen) if not moves]
    stop = max(np.split(stands, np.flatnonzero(np.diff(stands) > 1) + 1), key=len)
    stood = [seen[k][2] for k in stop[2:]]
    after = [w for _, moves, *both in seen[stop[-1] + 1 :] if moves for w in both]
    assert all(w.std < 0.08 * w.mass for w in stood)
    # In the first step samples may still be late.
    settled, _ = soon = after[2:4]
    assert settled.std > 0.15 * settled.mass
    assert all(w.std > 0.08 * w.mass for w in soon)
    assert all(w.status is LiveStatus.LEARNING for w in soon)
    assert all(w.reason_id in {"live.after_stop", "live.wide"} for w in soon)
    assert all(abs(w.mass - new) < 4.0 * w.std for w in after[2:])
    assert after[-1].mass == pytest.approx(new, rel=0.06)
    assert after[-1].std < 0.09 * new


def test_a_look_soon_after_a_stop_leaves_the_other_load_on_trial(car, delivered):
    made, part = delivered
    speed = part.speed
    stands = speed.time[speed.values == 0.0]
    off = float(stands[stands < part.start + 450.0][-1])
    soon = part.between(part.start, off + 20.0)
    weighing = wb.weigh(soon, car)
    assert not weighing.load_changed
    setup = identify_forward(weighing, LONGEST_STEP)
    state = resume(weighing, soon.end, setup)
    assert state.joint.load.open
    new = made.scenario.mass + 400.0
    assert abs(state.joint.mass - new) < 4.0 * state.joint.std(setup.joint)
    for until in step_ends(part, LONGEST_STEP):
        if until > soon.end:
            seen = recent(part, until, LONGEST_STEP)
            state, running = step(state, seen, until, setup)
            assert all(np.abs(running.mass - new) < 4.0 * running.std)
    assert state.joint.mass == pytest.approx(new, rel=0.03)


def test_a_change_of_load_is_found_on_the_way(car, delivered):
    """The records tell the stop at which it did, and minutes are counted from there."""
    made, part = delivered
    scale = wb.LiveScale(car, info=made.drive.info, step=LONGEST_STEP)
    told = fed(scale, part, even(part, 20.0))
    low, high = told.interval()
    assert low < made.scenario.mass + 500.0 < high
    assert high - low < 0.2 * told.mass
    assert scale._move.this_load < 0.7 * told.driven


def test_a_mass_that_is_too_wide_is_not_told(weighing, setup, short):
    """The first stretches leave a mass of any size."""
    narrow = replace(setup.joint.settings, widest=0.05)
    sizes = replace(setup.joint, settings=narrow)
    setup = replace(setup, joint=sizes)
    scale = wb.LiveScale(weighing.vehicle, setup=setup, info=weighing.drive.info)
    part = short.between(short.start, short.start + 90.0)
    seen = []
    for block in blocks(part, even(part, 2.0)):
        scale.update_block(block)
        seen.append((scale._state.joint, scale.weighing()))
    wide = [told for joint, told in seen if joint.windows and np.isnan(told.mass)]
    assert wide
    assert all(told.reason_id == "live.too_wide" for told in wide)
    assert all(t.std < 0.05 * t.mass for _, t in seen if np.isfinite(t.mass))


def test_a_scale_looks_at_its_records_when_the_vehicle_stands(car, loaded):
    scale = wb.LiveScale(car, info=loaded.drive.info, step=LONGEST_STEP)
    part = loaded.drive.between(loaded.drive.start, loaded.drive.start + 400.0)
    for block in blocks(part, even(part, LONGEST_STEP)):
        scale.update_block(block)
        if scale._move.driven > scale._move.looked_at + 62.0:
            break
    looked, end = scale._move.looked_at, scale.newest
    assert scale._move.driven > looked + 60.0
    rest = np.arange(0.1, REST + 5.0, 0.1)
    scale.update_block(
        {
            n: (end + rest, np.full(rest.size, 0.0 if n == "vehicle_speed" else s.values[-1]))
            for n, s in part.signals.items()
        }
    )
    assert scale._move.looked_at == scale._move.driven > looked


def test_tare_and_change_of_load(weighing, setup, half_driven):
    with pytest.raises(ConfigError):
        wb.LiveScale(weighing.vehicle, setup=setup).tare()
    scale = half_driven
    scale.tare()
    assert scale.weighing().payload == 0.0
    scale.load_changed()
    assert np.isnan(scale.weighing().mass)
