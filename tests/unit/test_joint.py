"""What the joint estimator makes of its parts: load changes, fuel, noise, considered errors."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.noted import error, refused

import weighbridge as wb
from weighbridge import ConfigError, Signal
from weighbridge.balance import Reason, windows
from weighbridge.estimators import ESTIMATORS
from weighbridge.estimators.joint import forward as joint_forward
from weighbridge.estimators.joint.slow_errors import usable_rows
from weighbridge.estimators.joint.terms import design
from weighbridge.estimators.noisy_motion import too_low
from weighbridge.navigation import without_accelerometer
from weighbridge.simulation import MIDSIZE, Scenario, short_route, simulate_car
from weighbridge.vehicle import Driveline, TorqueModel

joint = ESTIMATORS["joint"]
BATCH = joint.estimate.__module__

LOADED = 400.0


@pytest.fixture(scope="module")
def made():
    return simulate_car(Scenario(name="joint", car=MIDSIZE, route=short_route(), seed=73))


@pytest.fixture(scope="module")
def car(made):
    return wb.calibrate([made.drive], mass=made.scenario.mass)


@pytest.fixture(scope="module")
def balance(made, car):
    return wb.weigh(made.drive, car).result.balance


def with_stops(balance, car, *, load, every=None, lean=0.0):
    """The drive with 300 s of loading at half of it, and then 25 s of rest every so many windows.

    ``lean`` is what the load adds to the accelerometer's reading [m/s^2].
    """
    table = balance.table
    rows, y = design(table, car)
    cut = windows(table.time, usable_rows(table, rows, y))
    count = cut.count.size
    first = np.array([cut.index[cut.window == k][0] for k in range(count)])
    middle = count // 2
    rest = np.zeros(table.time.size)
    rest[first[middle] :] += 300.0
    for k in range(middle + every, count, every) if every else ():
        rest[first[k] :] += 25.0
    after = np.arange(table.time.size) >= first[middle]
    return replace(
        balance,
        table=replace(
            table,
            time=table.time + rest,
            traction_force=table.traction_force + after * load * rows[:, 0],
            specific_force=table.specific_force + lean * after,
        ),
    )


@pytest.mark.parametrize("every", [None, 3, 6, 7, 20])
def test_a_load_is_found_however_often_the_vehicle_rests_afterwards(balance, car, every):
    before = joint.estimate(balance, car).mass
    found = joint.estimate(with_stops(balance, car, load=LOADED, every=every), car)
    assert found.mass == pytest.approx(before + LOADED, rel=0.02)
    assert found.segments[0].mass == pytest.approx(before, rel=0.02)


def test_a_known_mass_does_not_change(balance, car):
    held = joint.estimate(with_stops(balance, car, load=LOADED), car, load_changes=False)
    assert len(held.segments) == 1


def test_a_body_that_leans_with_its_load_costs_little(balance, car):
    leaning = with_stops(balance, car, load=LOADED, lean=0.1)
    upright = joint.estimate(with_stops(balance, car, load=LOADED), car).mass

    def off(settings):
        return abs(joint.estimate(leaning, car, settings).mass / upright - 1.0)

    assert off(None) < 0.8 * off(joint.settings(load_pitch_std=0.0))


def test_terms_are_picked_by_settings(balance, car):
    few = ("mass", "disturbance", "resistance", "drag_area")
    whole, part = (
        joint.estimate(balance, car),
        joint.estimate(balance, car, joint.settings(terms=few)),
    )
    assert set(part.slow_errors.found) == set(few[1:])
    assert not part.slow_errors.of("wind_north").value.any()
    assert part.mass == pytest.approx(whole.mass, rel=0.02)
    # What is taken for known leaves less open.
    assert part.bound_std < whole.bound_std
    for terms in (("resistance", "mass"), ("mass", "mass"), ()):
        with error(ConfigError, "begin with mass"):
            joint.settings(terms=terms)
    with error(ConfigError, "wind_north"):
        joint.settings(terms=("mass", "wind_nort"))


def test_torque_errors_that_act_through_the_gear_weigh_less_in_short_gears(
    balance, car, monkeypatch
):
    """Errors of 20 N m that last half a minute, drawn anew eight times."""
    table = balance.table
    gearing = np.nan_to_num(table.gearing)
    known = joint.estimate(balance, car).mass
    keep = np.exp(-np.gradient(table.time) / 30.0)

    def error(seed):
        white = np.random.default_rng(seed).normal(0.0, 20.0, table.time.size)
        wrong = np.zeros(table.time.size)
        for k in range(1, wrong.size):
            wrong[k] = keep[k] * wrong[k - 1] + np.sqrt(1.0 - keep[k] ** 2) * white[k]
        force = table.traction_force + gearing * wrong
        off = replace(balance, table=replace(table, traction_force=force))
        return joint.estimate(off, car, load_changes=False).mass / known - 1.0

    by_gear = np.array([error(seed) for seed in range(8)])
    monkeypatch.setattr(Driveline, "usual_gearing", 0.0)
    alike = np.array([error(seed) for seed in range(8)])
    assert np.sqrt(np.mean(by_gear**2)) < 0.85 * np.sqrt(np.mean(alike**2))


def test_each_segment_has_burnt_its_own_fuel(balance, car):
    loaded = with_stops(balance, car, load=LOADED)
    table = loaded.table
    burnt = 50.0 * (table.time - table.time[0]) / (table.time[-1] - table.time[0])
    dry = joint.estimate(loaded, car)
    wet = joint.estimate(
        replace(
            loaded,
            table=replace(
                table,
                traction_force=table.traction_force - burnt * design(table, car)[0][:, 0],
                fuel_burnt=table.fuel_burnt + burnt,
            ),
        ),
        car,
    )
    for a, b in zip(dry.segments, wet.segments, strict=True):
        lost = np.interp(a.end, table.time, burnt)
        assert_allclose(b.mass, a.mass - lost, atol=0.5)


def test_fuel_counts_in_a_calibration(made, car):
    """A fuel rate that is far too high: 200 kg are said to burn in the drive."""
    time = made.drive.signals["vehicle_speed"].time
    rate = np.full(time.size, 200.0 / 790.0 / (time[-1] - time[0]))
    # No engine burns so much; who vouches for it is believed.
    thirsty = replace(
        made.drive.with_signals(Signal("fuel_rate", time, rate)),
        info=replace(made.drive.info, trusted=("fuel_rate",)),
    )
    lighter = wb.calibrate([thirsty], mass=made.scenario.mass)
    told = wb.weigh(made.drive, lighter).mass
    assert told == pytest.approx(wb.weigh(made.drive, car).mass - 100.0, abs=40.0)


def test_what_noise_of_the_motion_takes_reaches_mass_and_interval(balance, car, monkeypatch):
    real = joint.estimate(balance, car)
    monkeypatch.setattr(f"{BATCH}.attenuation", lambda weight, *_: np.full(weight.size, 0.0))
    bare = joint.estimate(balance, car)
    monkeypatch.setattr(f"{BATCH}.attenuation", lambda weight, *_: np.full(weight.size, 0.1))
    much = joint.estimate(balance, car)
    assert bare.mass < real.mass < 1.02 * bare.mass
    assert much.mass + balance.table.fuel_burnt[-1] == pytest.approx(
        1.1 * (bare.mass + balance.table.fuel_burnt[-1])
    )
    assert much.std > 0.045 * much.mass


def test_what_the_fit_left_open_reaches_the_interval(balance, car, monkeypatch):
    real = joint.estimate(balance, car)
    monkeypatch.setattr(f"{BATCH}.fit_consider_std", lambda *_: 0.05)
    wide = joint.estimate(balance, car)
    assert wide.mass == real.mass
    assert wide.std > car.provenance.std_factor * 0.05 * wide.mass


def test_rows_that_are_no_numbers_are_left_out(balance, car):
    table = balance.table
    rows = np.flatnonzero(table.usable)[10:13]
    broken = table.specific_force.copy()
    broken[rows] = np.nan
    found = joint.estimate(replace(balance, table=replace(table, specific_force=broken)), car)
    assert np.isfinite(found.std)
    assert (found.row_reason[rows] == Reason.NO_MOTION).all()


def test_a_speed_model_leaves_the_torque_of_a_data_sheet_alone(made, car):
    torque = Signal("engine_torque", made.truth.time[::5], made.truth.engine_torque[::5])
    drive = made.drive.with_signals(torque)
    sheet = replace(
        car,
        torque=TorqueModel(source="measured"),
        witnesses=(),
        mounting=None,
        provenance=wb.Vehicle().provenance,
    )
    weighing = wb.weigh(drive, sheet)
    by_speed = replace(sheet, provenance=replace(sheet.provenance, method="speed-ekf"))
    assert_allclose(wb.weigh(drive, by_speed).mass, weighing.mass, rtol=1e-9)
    slow = weighing.result.slow_errors
    of_sheet = {"torque_offset", "torque_growth", "engine_inertia", "wheel_inertia"}
    assert of_sheet < set(slow.constants)


@pytest.mark.parametrize(("factor", "status"), [(1.3, "converged"), (3.5, "inconsistent")])
def test_a_mass_that_no_load_explains_is_refused(balance, car, factor, status):
    table = balance.table
    rows, _ = design(table, car)
    more = table.traction_force + (factor - 1.0) * 1580.0 * rows[:, 0]
    found = joint.estimate(replace(balance, table=replace(table, traction_force=more)), car)
    assert found.status == status
    if status == "inconsistent":
        assert found.reason.id in ("mass.too_heavy", "mass.above_gross")


def late_engine(made, late, names):
    recorded = [
        Signal(name, s.time + late, s.values)
        for name, s in made.drive.signals.items()
        if name in names
    ]
    return made.drive.with_signals(*recorded)


ENGINE = ("engine_load", "mass_air_flow")


def test_torque_ahead_of_its_motion_is_refused(made, car):
    with refused("clock.torque_apart") as told:
        wb.weigh(late_engine(made, -1.0, ENGINE), car)
    assert -3.0 < told.value.problem.values["by"] < 0.0


def test_torque_that_is_late_alone_is_refused(made, car):
    with refused("clock.torque_apart") as told:
        wb.weigh(late_engine(made, 1.5, ENGINE), car)
    assert 0.0 < told.value.problem.values["by"] < 3.0


@pytest.mark.parametrize(
    ("late", "id", "by"),
    [
        (-1.0, "clock.moved", "most"),
        (1.0, "torque.clock_moved", "by"),
        (1.5, "clock.moved", "most"),
    ],
)
def test_a_table_that_is_off_as_a_whole_is_moved_and_told(made, car, late, id, by):
    drive = late_engine(made, late, (*ENGINE, "engine_speed", "vehicle_speed"))
    found = wb.weigh(drive, car)
    usual = wb.weigh(made.drive, car)
    assert found.mass == pytest.approx(usual.mass, rel=0.01)
    moved = [p.values[by] for p in found.problems if p.id == id]
    assert moved == pytest.approx([abs(late)], abs=0.1)


def clock_moved(drive, vehicle):
    return [
        p.values["by"] for p in wb.weigh(drive, vehicle).problems if p.id == "torque.clock_moved"
    ]


@pytest.mark.parametrize(("std", "told"), [(0.01, [0.4]), (0.2, [])])
def test_a_clock_has_moved_by_more_than_the_calibration_leaves_open(made, car, std, told):
    known = replace(car, timing=replace(car.timing, torque_delay_std=std))
    assert clock_moved(late_engine(made, 0.4, ENGINE), known) == pytest.approx(told, abs=0.1)


def test_speeds_are_late_themselves_and_move_no_clock(made, car):
    late = late_engine(made, 0.4, ENGINE)
    assert clock_moved(late, car)
    with_one = replace(car, without_accelerometer=None)
    assert not clock_moved(without_accelerometer(late), with_one)


def forward(track, stops=1.0):
    """Fold the windows of a track into the forward filter, standing so many times as long."""
    *_, state = folded(track, stops)
    return state


def folded(track, stops=1.0, state=None, **sizes):
    """States after each window of a track from that on that ``state`` comes before."""
    given = track.filter_input
    setup = replace(joint_forward.identify_joint(given, track.sizes), **sizes)
    state = state or joint_forward.JointState()
    torque_var = given.noise / setup.fast**2 - setup.mass**2 * setup.motion_var
    for k in range(state.windows, given.time.size):
        state = joint_forward.step(
            state,
            joint_forward.Window(
                given.time[k], given.rows[k], given.y[k], torque_var[k], stops * given.stood[k]
            ),
            setup,
        )
        yield state


def test_forward_ends_where_the_smoother_does(balance, car):
    track = joint.estimate(balance, car, load_changes=False)
    state = forward(track, stops=0.0)
    end = track.mass + balance.table.fuel_burnt[-1]
    assert state.mass == pytest.approx(end, rel=1e-9)
    assert state.std(track.sizes) == pytest.approx(track.std, rel=1e-3)
    assert state.windows == track.filter_input.time.size


def test_forward_stays_between_its_hypotheses_of_the_load(balance, car):
    """Their spread is no noise that draws the mass down."""
    track = joint.estimate(with_stops(balance, car, load=LOADED), car)
    tried = [s for s in folded(track, attenuating_var=0.03) if s.load.open]
    assert len(tried) > 5
    for state in tried:
        both = state.load.same.x[0], state.load.changed.x[0]
        low = too_low(state.load.same.cov[0, 0] * 0.03 * (state.total - state.total_at_load))
        assert min(both) <= state.mass <= max(both) * (1.0 + low) * (1.0 + 1e-9)


@pytest.mark.parametrize("load", [0.0, LOADED])
def test_forward_goes_on_from_a_drive_weighed_as_a_whole(balance, car, load):
    loaded = with_stops(balance, car, load=load) if load else balance
    track = joint.estimate(loaded, car)
    given = track.filter_input
    setup = joint_forward.identify_joint(given, track.sizes)
    end = track.mass + balance.table.fuel_burnt[-1]
    whole = joint_forward.resumed(given, setup, np.inf)
    # What of each load is noise is told by the weights of its windows, as they come.
    assert whole.mass == pytest.approx(end, rel=3e-5)
    assert whole.std(track.sizes) == pytest.approx(track.std, rel=1e-3)
    nearly = joint_forward.resumed(given, setup, float(given.time[-6]))
    assert nearly.windows == given.time.size - 5
    *_, after = folded(track, stops=0.0, state=nearly)
    # The hypotheses of the load go on as one.
    assert after.mass == pytest.approx(end, rel=4e-4)
    assert after.windows == whole.windows
    assert joint_forward.resumed(given, setup, -np.inf) == joint_forward.JointState()


def test_forward_follows_a_load_that_changes_at_a_stop(balance, car):
    loaded = with_stops(balance, car, load=LOADED)
    track = joint.estimate(loaded, car)
    assert len(track.segments) > 1
    state = forward(track)
    assert state.mass == pytest.approx(track.mass + balance.table.fuel_burnt[-1], rel=0.003)
