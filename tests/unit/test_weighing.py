"""The result of a weighing: fields, intervals, track, segments, and no mass without trust."""

import json
import math
import pickle
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from scipy.stats import t as student
from tests.noted import error, noted, refused
from tests.unit.test_balance import CAR, CLOCK, MASS, STAMPS, accel_at, drive, motion, weighable

from weighbridge import ConfigError, Drive, DriveInfo, Signal, Status, Weighing, weigh
from weighbridge.balance import force_balance
from weighbridge.estimators import ESTIMATORS
from weighbridge.estimators.judging import uncalibrated_std
from weighbridge.pipeline.weighing import without_mass
from weighbridge.vehicle import Provenance

TRACK_COLUMNS = [
    "time_s", "mass_kg", "std_kg", "used", "speed_mps", "accel_mps2", "specific_force_mps2",
    "grade_rad", "pitch_rad", "gear", "traction_force_n", "reason", "low95_kg", "high95_kg",
    "residual_n",
]  # fmt: skip

FIELDS = {
    "drive", "vehicle", "start", "method", "status", "reason", "reason_id", "mass_kg", "std_kg",
    "interval95_kg", "payload_kg", "duration_s", "used_s", "converged_at_s", "bound_std_kg",
    "maker_mass_kg", "trailer_connected", "segments", "problems", "warnings",
}  # fmt: skip


def weighing(vehicle=CAR, status=None, **changes):
    noise = np.random.default_rng(3).normal(scale=2.0, size=STAMPS.size)
    recorded = drive(torque=weighable() + noise)
    track = ESTIMATORS["rls"].track(force_balance(recorded, vehicle, motion(**changes)), vehicle)
    return Weighing(
        drive=recorded,
        vehicle=vehicle,
        seen=vehicle,
        method="rls",
        status=status or track.status,
        refusal=track.reason,
        result=track,
    )


@pytest.fixture(scope="module")
def good():
    return weighing(replace(CAR, tare=1400.0))


def test_fields_of_the_json(good):
    result = json.loads(good.to_json())
    assert set(result) == FIELDS
    assert result["status"] == "converged"
    assert result["reason"] == ""
    assert result["mass_kg"] == pytest.approx(MASS, rel=0.01)
    assert result["payload_kg"] == pytest.approx(result["mass_kg"] - 1400.0, abs=1e-5)
    assert result["interval95_kg"] == pytest.approx(list(good.interval(0.95)), abs=1e-5)
    assert result["duration_s"] == pytest.approx(STAMPS[-1] - STAMPS[0])
    assert result["used_s"] == pytest.approx(
        0.25 * np.count_nonzero(accel_at(STAMPS) > 0), rel=0.02
    )
    assert 0.0 <= result["converged_at_s"] < result["duration_s"]
    assert 0.0 < result["bound_std_kg"] < result["std_kg"]
    assert set(result["segments"][0]) == {"start_s", "end_s", "mass_kg", "std_kg"}
    assert "\n" not in good.to_json()


def test_a_failed_drive_has_the_same_fields(weighbridge, tmp_path):
    CAR.save(tmp_path / "car.toml")
    names = [tmp_path / f"{k}.csv" for k in range(2)]
    for name in names:
        name.write_text("time_s,vehicle_speed_kmh\n")
    ran = weighbridge("weigh", *names, "--vehicle", tmp_path / "car.toml", "--json", "-")
    for failed in map(json.loads, ran.out.splitlines()):
        assert set(failed) == FIELDS
        assert failed["status"] in set(Status)


@pytest.mark.parametrize("status", [Status.INCONSISTENT, Status.NOT_EXCITED])
def test_numbers_are_null_where_there_is_no_mass(status):
    none = weighing(status=status)
    result = json.loads(none.to_json())
    assert math.isnan(none.mass)
    assert result["interval95_kg"] == [None, None]
    assert all(result[k] is None for k in ("mass_kg", "std_kg", "payload_kg", "converged_at_s"))
    if status is Status.INCONSISTENT:
        assert result["segments"]
        assert all(s["mass_kg"] is None and s["std_kg"] is None for s in result["segments"])


def test_a_row_is_light_whatever_the_drive_holds(good):
    # A NaN is not equal to itself.
    reported = Signal("maker_mass", STAMPS, np.full(STAMPS.size, 1500.0))
    good = replace(good, drive=good.drive.with_signals(reported))
    row = pickle.dumps(good.row)
    assert len(row) < 5000 < len(pickle.dumps(good)) / 10
    assert pickle.loads(row) == good.row


def test_interval_is_students(good):
    low, high = good.interval(0.8)
    half = student.ppf(0.9, good.result.degrees_of_freedom) * good.std
    assert (low, high) == pytest.approx((good.mass - half, good.mass + half))
    assert good.interval(0.99)[0] < good.interval(0.95)[0] < low
    for level in (0.0, 1.0, 95.0):
        with pytest.raises(ConfigError, match="level"):
            good.interval(level)


def test_uncertainty_of_the_calibration_is_in_the_mass(good):
    known = {
        scale: weighing(replace(CAR, provenance=Provenance(mass_scale_std=scale)))
        for scale in (0.0, 0.02)
    }
    exact = known[0.0]
    assert known[0.02].std == pytest.approx(math.hypot(exact.std, 0.02 * exact.mass), rel=1e-6)
    # A file that was never calibrated leaves open torque, efficiency, radius and lean: 5 to 6 %.
    left = uncalibrated_std(CAR, good.result.balance.motion)
    assert 0.05 < left < 0.06
    # Drag and rolling resistance are less sure then as well.
    least = math.hypot(exact.std, left * exact.mass)
    assert least < good.std < 1.2 * least


def test_payload_needs_a_tare(good):
    assert good.payload == pytest.approx(good.mass - 1400.0)
    assert math.isnan(weighing().payload)


def test_track(good, tmp_path):
    track = good.track
    assert track.columns == TRACK_COLUMNS
    assert track.height == STAMPS.size
    assert track["used"].sum() == np.count_nonzero(good.result.used)
    reasons = set(track["reason"])
    assert reasons == {"", "not accelerating", "overrun"}
    for suffix, read in ((".csv", pl.read_csv), (".parquet", pl.read_parquet)):
        path = tmp_path / f"track{suffix}"
        good.write_track(path)
        back = read(path)
        assert back.columns == track.columns
        assert back["mass_kg"].to_list() == pytest.approx(track["mass_kg"].to_list())
    with pytest.raises(ConfigError, match=r"\.csv or \.parquet"):
        good.write_track(tmp_path / "track.xlsx")


def test_track_without_a_result():
    none = weigh(drive().without("engine_torque"), CAR)
    assert none.status is Status.MISSING_SIGNALS
    assert none.track.columns == TRACK_COLUMNS
    assert none.track.height == 0
    assert none.segments == ()
    assert set(none.to_dict()) == FIELDS


def test_segments_end_where_the_vehicle_stands():
    speed = np.where((CLOCK > 190.0) & (CLOCK < 220.0), 0.0, motion().speed)
    parts = weighing(speed=speed).segments
    assert len(parts) == 2
    assert parts[0].start == pytest.approx(STAMPS[0])
    assert parts[1].start == pytest.approx(220.0, abs=0.5)
    assert [p.mass for p in parts] == pytest.approx([MASS, MASS], rel=0.02)


def test_less_than_the_tare_is_inconsistent():
    light = weighing(replace(CAR, tare=2200.0))
    assert light.status is Status.INCONSISTENT
    assert light.reason_id == "mass.below_tare"
    assert math.isnan(light.mass)


def test_a_mass_the_class_cannot_have_is_inconsistent():
    bus = weighing(replace(CAR, kind="bus", torque=replace(CAR.torque, coefficients=(0.0, 0.5))))
    assert bus.status is Status.INCONSISTENT
    assert (bus.reason_id, bus.refusal.values["kind"]) == ("mass.impossible", "bus")


def test_another_torque_source_is_named():
    load = (
        drive()
        .without("engine_torque")
        .with_signals(
            Signal("engine_load", STAMPS, 0.4 + 0.2 * np.sin(STAMPS)),
            Signal("vehicle_speed", STAMPS, 10.0 + np.sin(0.1 * STAMPS)),
        )
    )
    found = weigh(load, CAR).refusal
    assert "load" in (found.values.get("other"), found.values.get("source"))


def test_method_and_serious_problems_are_refused():
    with error(ConfigError, "guess joint rls"):
        weigh(drive(), CAR, "guess")
    stuck = drive().with_signals(
        Signal("vehicle_speed", STAMPS, motion().speed[: STAMPS.size]),
        Signal("engine_torque", STAMPS, np.full(STAMPS.size, 50.0)),
    )
    with refused("range.stuck"):
        weigh(stuck, CAR)


def geared():
    turning = 10.0 * (15.0 + 3.0 * np.sin(0.2 * STAMPS))
    return drive(torque=weighable(), engine_speed=turning).with_signals(
        Signal("vehicle_speed", STAMPS, turning / 10.0)
    )


@pytest.mark.parametrize("method", ["joint", "rls", "robust-rls"])
def test_the_spread_that_a_warning_quotes_is_in_the_interval(method):
    recorded, found = geared(), []
    for scale in (0.0, 0.08):
        car = replace(CAR, torque=replace(CAR.torque, scale_std=scale))
        w = weigh(recorded, car, method)
        [said] = [text for text in w.problems if text.id == "vehicle.uncalibrated_std"]
        quoted = round(said.values["share"], 1)
        found.append((quoted, 100.0 * w.result.std / w.result.mass))
    (low, exact), (high, open_) = found
    assert low < exact
    assert high < open_
    assert high**2 - low**2 == pytest.approx(8.0**2, rel=0.02)
    assert open_**2 - exact**2 == pytest.approx(8.0**2, rel=0.02)


def test_a_vehicle_that_was_not_calibrated_is_told():
    recorded = geared()
    found = weigh(recorded, CAR)
    assert any(w.id == "vehicle.uncalibrated_std" for w in found.problems)
    assert found.mass == pytest.approx(MASS, rel=0.05)
    named = replace(CAR, provenance=Provenance(mass_scale_std=0.01))
    told = {w.id for w in weigh(recorded, named).problems}
    assert not told & {"vehicle.not_calibrated", "vehicle.uncalibrated", "vehicle.uncalibrated_std"}


def test_overload_is_told(brief_drive, short_car):
    def told(gross):
        found = weigh(brief_drive, replace(short_car, tare=None, gross=gross)).problems
        return [p for p in found if p.id == "mass.above_permitted"]

    own = weigh(brief_drive, short_car)
    for gross, word in (
        (own.mass - 3.0 * own.std, "surely"),
        (own.mass - 0.5 * own.std, "perhaps"),
    ):
        (problem,) = told(gross)
        assert (problem.values["sure"], problem.values["gross"]) == (word, gross)
    assert told(own.mass + own.std) == told(None) == []


@pytest.mark.parametrize(
    ("start_time", "begins"),
    [
        ("2025-06-10T08:00:00+02:00", "2025-06-10T06:00:10.500+00:00"),
        ("2025-06-10T08:00:00", "2025-06-10T08:00:10.500+00:00"),
        ("9999-12-31T23:59:59+00:00", None),
        ("this morning", None),
        (None, None),
    ],
)
def test_the_start_is_a_wall_clock_time(start_time, begins):
    time = 10.5 + np.arange(5.0)
    signals = {"vehicle_speed": Signal("vehicle_speed", time, time)}
    made = Drive("day part 2 of 3", signals, DriveInfo(start_time=start_time))
    none = without_mass(made, CAR, "rls", noted("why"))
    assert json.loads(none.to_json())["start"] == begins
