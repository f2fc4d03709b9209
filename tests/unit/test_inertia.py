"""Sprung mass and inertias from drives, whole and spoiled."""

import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from numpy.testing import assert_allclose
from tests.noted import error, refused, says
from tests.unit.test_report import unpacked

from weighbridge import (
    ConfigError,
    Drive,
    InertiaFilter,
    InertiaSettings,
    Signal,
    Vehicle,
    estimate_inertia,
    read_drive,
)
from weighbridge.inertia import (
    RideSamples,
    check_suspension,
    estimate,
    integration_std,
    inverse_interval,
    ride_samples,
)
from weighbridge.papers.nguyen2024 import suspension_of
from weighbridge.simulation import TRUCK, RideScenario, RideSensors, simulate_ride

SENSORS = RideSensors(rate=250.0)
RIDE = replace(suspension_of(TRUCK, SENSORS), zero_mass=TRUCK.sprung_mass, force_std=0.01)
CAR = Vehicle(name="truck", kind="truck", tare=6087.0, ride=RIDE)
LIGHT = replace(
    TRUCK, sprung_mass=1400.0, roll_inertia=600.0, pitch_inertia=2100.0, unsprung_mass=(90.0, 90.0),
    stiffness=(3e4, 3e4, 2.8e4, 2.8e4), damping=(2.5e3,) * 4, track=(1.5, 1.5),
    axle_distance=(1.2, 1.5),
)  # fmt: skip
"""A car: the same turn pushes its small inertias harder."""
LIGHT_CAR = Vehicle(name="car", ride=replace(suspension_of(LIGHT, SENSORS), force_std=0.01))


def simulated(vehicle=TRUCK, factor=1.3, sensors=SENSORS, seed=11, **more):
    more = {"duration": 14.0, "zero_mass": TRUCK.sprung_mass, **more}
    return simulate_ride(
        RideScenario(vehicle=vehicle.loaded(factor), sensors=sensors, seed=seed, **more)
    )


@pytest.fixture(scope="module")
def made():
    return simulated()


@pytest.fixture(scope="module")
def found(made):
    return estimate_inertia(made.drive, CAR)


def changed(drive: Drive, **columns) -> Drive:
    """Replace values of signals by a function of them."""
    return drive.with_signals(
        *(Signal(n, drive.signals[n].time, f(drive.signals[n].values)) for n, f in columns.items())
    )


def test_ride_gives_the_three_parameters(made, found):
    true = made.inertias[-1]
    low, high = found.intervals()

    assert found.status == "converged"
    assert found.warnings == ()
    assert_allclose(found.values, true, rtol=0.02)
    assert np.all((low < true) & (true < high))
    assert found.converged_at < 2.0


def test_an_interval_holds_as_much_as_it_says():
    """Of inverses of normal values, counted; and without an upper end where zero is among them."""
    rng = np.random.default_rng(5)
    alpha = rng.normal(1.0, 0.1, 100_000)
    low, high = inverse_interval(np.array([1500.0]), np.ones(1), np.array([0.1]), 0.9)
    assert np.mean(1500.0 / alpha < low) == pytest.approx(0.05, abs=0.003)
    assert np.mean(1500.0 / alpha > high) == pytest.approx(0.05, abs=0.003)
    _, high = inverse_interval(np.array([1500.0]), np.ones(1), np.array([0.7]), 0.9)
    assert np.isinf(high)


def test_axle_loads_balance_about_the_centre_of_gravity(found):
    front, rear = found.axle_loads
    assert_allclose(front + rear, found.mass)
    assert_allclose((front - 266.0) * 2.4, (rear - 427.0) * 1.685)
    assert_allclose(found.payload, found.mass - 6087.0)


def test_intervals_of_axle_loads_and_payload_are_those_of_the_mass(found):
    lightest, heaviest = found.mass_interval()
    front, rear = found.axle_load_intervals()
    assert_allclose((front[0] + rear[0], front[1] + rear[1]), (lightest, heaviest))
    assert front[0] < found.axle_loads[0] < front[1]
    assert rear[0] < found.axle_loads[1] < rear[1]
    assert_allclose(found.payload_interval(), (lightest - 6087.0, heaviest - 6087.0))


def test_settings_by_name_are_those_of_the_filter(made):
    given = {"process_densities": [1.0] * 6, "noise_densities": [5e-5, 5e-4, 5e-4]}
    told = estimate_inertia(made.drive, CAR, "extended", settings=given)
    usual = estimate_inertia(made.drive, CAR, "extended")
    assert any(text.id == "method.settings" for text in told.problems)
    # A density of 1 kg²/s lets the mass move by a kilogram in a second.
    off = [abs(w.track.parameters[-1, 0] / made.inertias[-1, 0] - 1.0) for w in (told, usual)]
    assert off[0] > 0.03 > 1.5 * off[1]
    with error(ConfigError, "noise_densities 3 1.0"):
        estimate_inertia(made.drive, CAR, settings={"noise_densities": [1.0]})
    with error(ConfigError, "jumprate jump_rate"):
        estimate_inertia(made.drive, CAR, settings={"jumprate": 1.0})


def test_a_filter_fed_sample_by_sample_ends_where_the_ride_does(made):
    samples = ride_samples(made.drive)
    live = InertiaFilter(RIDE, samples.period)
    for row in zip(samples.time, samples.travel, samples.rate, samples.velocity, strict=True):
        live.update(*row)
    whole = estimate(samples, RIDE, settings=InertiaSettings())
    assert np.array_equal(live.parameters, whole.parameters[-1])
    low, high = live.interval()
    assert np.all((low < live.parameters) & (live.parameters < high))
    with error(ConfigError, "0.0"):
        InertiaFilter(RIDE, 0.0)


def test_json_and_track_say_the_same(found, tmp_path):
    told = json.loads(found.to_json())
    found.write_track(tmp_path / "track.csv")
    table = pl.read_csv(tmp_path / "track.csv")

    assert told["status"] == "converged"
    assert_allclose(told["sprung_mass_kg"], table["sprung_mass_kg"][-1], rtol=1e-6)
    assert_allclose(told["pitch_inertia_std_kgm2"], table["pitch_inertia_std_kgm2"][-1], rtol=1e-6)
    assert told["mass_kg"] == pytest.approx(told["sprung_mass_kg"] + 693.0)
    with pytest.raises(ConfigError, match=r"\.csv or \.parquet"):
        found.write_track(tmp_path / "track.txt")


def test_braking_and_turning_are_no_load():
    pushes = ((4.0, 6.0, -2.5, 0.0), (8.0, 10.5, 0.0, 2.0))
    ride = simulated(manoeuvres=pushes, seed=15)
    told = estimate_inertia(ride.drive, CAR)
    error = told.track.parameters / ride.inertias - 1.0

    assert told.status == "converged"
    assert len(told.segments) == 1
    assert np.max(np.abs(error[told.track.time > 2.5])) < 0.1
    assert told.track.pushed[:, 1:].any(axis=0).all()
    assert not told.track.pushed[:, 0].any()


def test_a_turn_that_sets_in_hard_is_no_load():
    ride = simulated(manoeuvres=((3.0, 5.5, -9.0, 0.0), (7.0, 11.0, 2.0, 5.0)), seed=23,
                     vehicle=LIGHT, duration=16.0)  # fmt: skip
    told = estimate_inertia(ride.drive, LIGHT_CAR)
    # What was taken for a jump moved no mass.
    assert np.isfinite(told.track.jumped).any()
    assert told.status == "converged"
    assert len(told.segments) == 1
    assert told.suspension is not None
    assert not told.suspension.off.any()
    assert_allclose(told.values, ride.inertias[-1], rtol=0.02)


def test_load_changes_are_found():
    ride = simulated(factor=1.0, zero_mass=None, changes=((6.0, 1.5),), seed=12)
    told = estimate_inertia(ride.drive, replace(CAR, ride=replace(RIDE, zero_mass=None)))

    assert len(told.segments) == 2
    assert told.segments[1].start == pytest.approx(6.0, abs=0.3)
    assert_allclose(told.segments[0].values, TRUCK.inertias, rtol=0.03)
    assert_allclose(told.segments[1].values, 1.5 * TRUCK.inertias, rtol=0.03)


@pytest.mark.parametrize("method", ["inverse", "extended"])
def test_fixed_noise_filters_come_near(made, method):
    told = estimate_inertia(made.drive, CAR, method)
    assert told.status == "converged"
    assert_allclose(told.values, made.inertias[-1], rtol=0.1)


def test_common_error_of_springs_and_dampers_stays_in_the_interval(made, found):
    unsure = estimate_inertia(made.drive, replace(CAR, ride=replace(RIDE, force_std=None)))
    assert_allclose(unsure.values, found.values)
    assert unsure.std == pytest.approx(0.05 * unsure.values[0], rel=0.05)
    assert any(p.id == "ride.force_std_unknown" for p in unsure.problems)


def test_missing_signals_are_named(made):
    told = estimate_inertia(made.drive.without("pitch_rate", "suspension_rate_rl"), CAR)
    assert told.status == "missing_signals"
    assert told.reason_id == "ride.missing"
    assert "pitch_rate" in told.reason
    assert "suspension_rate_rl" in told.reason
    assert json.loads(told.to_json())["sprung_mass_kg"] is None


def test_vehicle_without_suspension_is_refused(made):
    with error(ConfigError, "truck [ride]"):
        estimate_inertia(made.drive, replace(CAR, ride=None))
    with error(ConfigError, "kalman kalman-bucy"):
        estimate_inertia(made.drive, CAR, "kalman")


def test_wrong_signs_are_refused(made):
    for name in ("vertical_velocity", "roll_rate", "pitch_rate"):
        with refused("ride.force_sign", signal=name):
            estimate_inertia(changed(made.drive, **{name: np.negative}), CAR)
    with refused("ride.rate_sign", signal="suspension_rate_fr"):
        estimate_inertia(changed(made.drive, suspension_rate_fr=np.negative), CAR)
    compression = {n: np.negative for n in made.drive.signals if n.startswith("suspension")}
    with refused("ride.springs_sign"):
        estimate_inertia(changed(made.drive, **compression), CAR)


def test_wrong_units_are_refused(made):
    travels = [n for n in made.drive.signals if n.startswith("suspension_travel")]
    with refused("ride.unit", signal="suspension_travel_fl"):
        estimate_inertia(changed(made.drive, **{n: lambda v: 1e3 * v for n in travels}), CAR)


@pytest.mark.parametrize("name", ["roll_rate", "pitch_rate"])
def test_degrees_under_the_name_of_radians_are_named(made, name):
    spoiled = changed(made.drive, **{name: np.degrees})
    with refused("ride.force_scale", signal=name, seems="degrees"):
        estimate_inertia(spoiled, CAR)
    spoiled = changed(made.drive, **{name: np.radians})
    with refused("ride.force_scale", signal=name, seems="radians"):
        estimate_inertia(spoiled, CAR)


def test_millimetres_of_the_whole_suspension_are_named(made):
    signals = [n for n in made.drive.signals if n.startswith("suspension")]
    spoiled = changed(made.drive, **dict.fromkeys(signals, lambda v: 0.01 * v))
    with refused("ride.springs_scale"):
        estimate_inertia(spoiled, CAR)


def test_swapped_wheels_are_refused(made):
    s = made.drive.signals
    swapped = made.drive.with_signals(
        replace(s["suspension_travel_fl"], values=s["suspension_travel_rr"].values),
        replace(s["suspension_travel_rr"], values=s["suspension_travel_fl"].values),
    )
    with refused("ride.swapped", signal="suspension_travel_fl", other="suspension_rate_rr"):
        estimate_inertia(swapped, CAR)


def test_stuck_sensor_is_refused(made):
    with refused("ride.frozen", signal="suspension_travel_rl"):
        estimate_inertia(changed(made.drive, suspension_travel_rl=np.zeros_like), CAR)


def test_suspension_without_a_signal_is_refused(made):
    still = {n: np.zeros_like for n in made.drive.signals if "travel" in n}
    with refused("ride.all_frozen", kind="suspension travel"):
        estimate_inertia(changed(made.drive, **still), CAR)


def test_a_ride_without_motion_is_told_plainly(made):
    told = estimate_inertia(changed(made.drive, **dict.fromkeys(made.drive.signals, np.zeros_like)),
                            CAR)  # fmt: skip
    assert told.status == "not_excited"
    assert told.reason_id == "ride.still"
    assert told.warnings == ()
    assert told.track is None


def test_a_quarter_of_a_second_is_no_ride(made):
    for seconds, status in ((0.25, "not_excited"), (3.5, "not_excited"), (4.5, "converged")):
        count = round(seconds * SENSORS.rate) + 1
        short = {n: Signal(n, s.time[:count], s.values[:count])
                 for n, s in made.drive.signals.items()}  # fmt: skip
        told = estimate_inertia(replace(made.drive, signals=short), CAR)
        assert told.status == status
        assert (told.reason_id == "ride.short") is (status == "not_excited")


def test_the_filter_as_printed_is_said_not_to_move(made):
    told = estimate_inertia(made.drive, CAR, "printed")
    assert told.status == "not_excited"
    assert (told.reason_id, told.refusal.values["method"]) == ("ride.filter_stuck", "printed")
    assert not any(says(w, "and_widened") for w in told.warnings)


def test_slow_recording_is_no_ride(made):
    slow = {n: Signal(n, s.time[::10], s.values[::10]) for n, s in made.drive.signals.items()}
    told = estimate_inertia(replace(made.drive, signals=slow), CAR)
    assert told.status == "not_excited"
    assert told.reason_id == "ride.slow"
    assert f"{told.refusal.values['rate']:.3g}" == "25"


def test_signals_on_other_clocks_and_gaps_are_taken(made):
    rng = np.random.default_rng(3)
    torn = {}
    for n, s in made.drive.signals.items():
        keep = rng.random(len(s)) > 0.02
        keep &= ~((s.time > 5.0) & (s.time < 6.5))
        keep[0] = True
        # Halfway between the others' samples, where the mean of two neighbours is near enough.
        shift = 0.5 * s.period if n == "roll_rate" else 0.0
        values = s.values + shift * np.gradient(s.values, s.time)
        torn[n] = Signal(n, s.time[keep] + shift, values[keep])
    told = estimate_inertia(replace(made.drive, signals=torn), CAR)
    assert told.status == "converged"
    assert_allclose(told.values, made.inertias[-1], rtol=0.05)


def test_damaged_table_is_read_as_far_as_it_goes(made, tmp_path):
    made.write(tmp_path, format="csv")
    path = tmp_path / "ride.csv"
    table = pl.read_csv(path)
    table = pl.concat([table[:1000], table[900:]])
    table = table.with_columns(
        pl.when(pl.int_range(pl.len()) % 97 == 0)
        .then(None)
        .otherwise(pl.col("pitch_rate_radps"))
        .alias("pitch_rate_radps")
    )
    table.write_csv(path)
    told = estimate_inertia(read_drive(tmp_path), CAR)
    assert_allclose(told.values, made.inertias[-1], rtol=0.03)
    assert any(w.id == "clock.backwards" for w in told.problems)


def test_smooth_road_is_no_weighing(made):
    still = {
        n: (lambda v, k=k: 1e-4 * np.random.default_rng(k).normal(size=v.size))
        for k, n in enumerate(made.drive.signals)
    }
    told = estimate_inertia(changed(made.drive, **still), CAR)
    assert told.status != "converged"
    assert np.isnan(told.mass)


def locked(factor):
    damping = (factor * TRUCK.damping[0], *TRUCK.damping[1:])
    return simulated(replace(TRUCK, damping=damping))


@pytest.mark.parametrize("factor", [0.05, 20.0])
def test_broken_damper_is_named(factor):
    told = estimate_inertia(locked(factor).drive, CAR)
    assert told.status == "inconsistent"
    assert (told.reason_id, told.refusal.values["part"]) == ("ride.part_wrong", "front left damper")


def test_parts_are_found_by_the_heave_where_nothing_is_calm():
    ride = simulated(sensors=replace(SENSORS, travel_factor=(0.7, 1.0, 1.0, 1.0)))
    samples = ride_samples(ride.drive)
    alpha = TRUCK.inertias / ride.inertias[-1]
    told = check_suspension(samples, RIDE, alpha, np.ones(samples.time.size, dtype=bool))
    # What the sensor makes of the part is the inverse of its factor.
    assert told.factor[0] == pytest.approx(1.0 / 0.7, rel=0.1)
    assert np.argmax(told.off[:4]) == 0
    assert np.all(told.misfit[1:] == 0.0)


def test_broken_part_is_named_though_the_load_changes_at_the_end():
    damping = (0.05 * TRUCK.damping[0], *TRUCK.damping[1:])
    ride = simulated(replace(TRUCK, damping=damping), changes=((12.0, 1.5),), seed=16)
    told = estimate_inertia(ride.drive, CAR)
    assert told.status == "inconsistent"
    assert (told.reason_id, told.refusal.values["part"]) == ("ride.part_wrong", "front left damper")


def test_short_ride_is_not_believed_beyond_its_check():
    ride = simulated(duration=6.0)
    told = estimate_inertia(ride.drive, CAR)
    assert told.status == "converged"
    assert any(w.id == "ride.unchecked" for w in told.problems)
    noisy = simulated(sensors=replace(SENSORS, travel_noise=2e-3), duration=6.0)
    told = estimate_inertia(noisy.drive, CAR)
    assert told.status == "inconsistent"
    assert told.reason_id == "ride.noisy_short"


def test_one_offset_sensor_is_told_by_the_lean(made, found):
    ride = simulated(sensors=replace(SENSORS, travel_offset=(0.0, 0.0, 0.0, 0.01)))
    told = estimate_inertia(ride.drive, replace(CAR, ride=replace(RIDE, zero_mass=None)))
    assert_allclose(told.values, found.values, rtol=1e-3)
    assert len(told.warnings) == 1
    assert told.problems[0].id == "ride.tilt"


def test_soft_springs_are_told_and_widen_the_interval():
    ride = simulated(replace(TRUCK, stiffness=tuple(0.9 * np.array(TRUCK.stiffness))))
    told = estimate_inertia(ride.drive, CAR)
    low, high = told.intervals()
    assert any(p.id == "ride.parts" and "damper" in p.values["parts"] for p in told.problems)
    assert low[0] < ride.inertias[-1, 0] < high[0]


def test_offset_sensors_change_nothing_in_motion_and_are_told(found):
    ride = simulated(sensors=replace(SENSORS, travel_offset=(0.012, 0.012, 0.012, 0.012)))
    told = estimate_inertia(ride.drive, CAR)
    assert_allclose(told.values, found.values, rtol=1e-3)
    assert any(p.id in ("ride.tilt", "ride.rest_and_motion") for p in told.problems)
    blind = estimate_inertia(ride.drive, replace(CAR, ride=replace(RIDE, zero_mass=None)))
    assert blind.warnings == ()


def test_noisy_sensors_are_told():
    ride = simulated(sensors=replace(SENSORS, travel_noise=2e-3, rate_noise=5e-2))
    told = estimate_inertia(ride.drive, CAR)
    assert told.track.noise_factor >= 4.0
    assert any(w.id == "ride.noise" for w in told.problems)


def test_overload_is_told(made):
    told = estimate_inertia(made.drive, replace(CAR, gross=7000.0))
    found = next(p for p in told.problems if p.id == "mass.above_permitted")
    assert (found.values["sure"], found.values["gross"]) == ("surely", 7000.0)


def test_interval_of_the_mass_is_that_of_the_sprung_mass_and_the_axles(found):
    low, high = found.intervals(0.9)
    lightest, heaviest = found.mass_interval(0.9)
    assert lightest - low[0] == pytest.approx(266.0 + 427.0)
    assert heaviest - high[0] == pytest.approx(266.0 + 427.0)
    assert lightest < found.mass < heaviest


def test_what_is_refused_has_no_interval_to_widen():
    told = estimate_inertia(locked(20.0).drive, CAR)
    assert told.status == "inconsistent"
    for text in (told.reason, *told.warnings):
        assert not any(says(text, name) for name in ("interval_widened", "and_widened"))


def test_slow_sampling_integrates_a_hop_to_less_and_the_interval_knows_it(found):
    for hz in (100.0, 200.0):
        time = np.arange(0.0, 20.0, 1.0 / hz)
        force = np.exp(2j * np.pi * 12.0 * time)
        steps = (5.0 * force[2:] + 8.0 * force[1:-1] - force[:-2]) / (12.0 * hz)
        exact = np.diff(force[1:]) / (2j * np.pi * 12.0)
        lost = 1.0 - np.abs(steps).mean() / np.abs(exact).mean()
        assert lost > 0.0
        # A ride of that frequency alone, of all four wheels: only the heave moves.
        hopping = RideSamples(
            time=time,
            travel=0.01 * np.repeat(force.real[:, np.newaxis], 4, axis=1),
            rate=np.zeros((time.size, 4)),
            velocity=np.zeros((time.size, 3)),
        )
        told = integration_std(hopping, CAR.ride)
        assert told[0] == pytest.approx(lost, rel=1e-3)
    assert np.all(found.model_std >= integration_std(ride_samples(found.drive), found.ride))


def test_a_still_ride_has_no_loss():
    still = RideSamples(
        time=np.arange(100.0) / 100.0, travel=np.zeros((100, 4)), rate=np.zeros((100, 4)),
        velocity=np.zeros((100, 3)),
    )  # fmt: skip
    assert np.all(integration_std(still, CAR.ride) == 0.0)


def test_report_opens_offline(found, tmp_path):
    found.report(tmp_path / "ride.html")
    text = (tmp_path / "ride.html").read_text(encoding="utf-8")
    assert "Sprung mass" in text
    assert text.index('class="answer ') < text.index("At the end of the drive")
    assert "front left spring" in unpacked(text, "figures")
    assert "http://" not in text.split("<script>")[0]
