"""Figures of a fleet against numbers worked out by hand."""

import math
from datetime import UTC, datetime

import pytest
from scipy.stats import t as student

from tests.fleet.made_rows import drive, frames, reported, segment
from tests.noted import error
from weighbridge import ConfigError
from weighbridge.fleet import Limits, speed_mass


def at(hour, minute=0):
    return f"2026-05-04T{hour:02d}:{minute:02d}:00+00:00"


def test_a_leg_has_payload_interval_and_probability_of_overload():
    (leg,) = reported([drive("a", mass=18500.0, std=500.0, freedom=6.0)]).legs.to_dicts()
    assert leg["payload_kg"] == 10500.0
    assert leg["overload"] == pytest.approx(student.cdf(1.0, 6.0))
    assert leg["high95_kg"] - leg["mass_kg"] == pytest.approx(2.447 * 500.0, abs=1.0)
    assert (leg["level"], leg["trailer"], leg["empty"]) == ("warn", False, False)
    assert leg["tkm"] == pytest.approx(10.5 * 20.0)
    assert leg["start"] == datetime(2026, 5, 4, 6, tzinfo=UTC)


@pytest.mark.parametrize(
    ("mass", "level"), [(17990.0, "ok"), (18010.0, "warn"), (18817.0, "warn"), (18828.0, "alarm")]
)
def test_two_thresholds_part_the_levels(mass, level):
    assert reported([drive("a", mass=mass, std=500.0)]).legs["level"].to_list() == [level]


def test_what_cannot_be_judged_is_not_called_well():
    bare = drive("b", mass=9000.0, std=400.0, gross_kg=None, tare_kg=None)
    rows = reported([drive("a"), bare]).legs
    assert rows["level"].to_list() == [None, None]
    assert rows["overload"].null_count() == 2
    assert rows["payload_kg"].null_count() == 2


def test_legs_of_a_drive_that_was_not_weighed_to_its_end():
    drives = [
        drive("a", mass=17000.0, std=500.0, unweighed_s=400.0),
        drive("b", start=at(9), mass=16000.0, std=500.0, load_changed=True, unweighed_s=300.0),
    ]
    segments = [
        segment("a", 0, 5.0, 605.0, None, None, km=4.0),
        segment("a", 1, 605.0, 805.0, 17500.0, 600.0, km=6.0),
        segment("a", 2, 805.0, 1205.0, None, None, km=9.0, weighed=False),
        segment("b", 0, 5.0, 605.0, 12000.0, 400.0),
        segment("b", 1, 605.0, 905.0, None, None, weighed=False),
        segment("b", 2, 905.0, 1205.0, 16000.0, 500.0),
    ]
    found = reported(drives, segments)
    rows = found.legs.sort("key", "leg")
    assert rows["leg"].to_list() == [0, 1, 0, 1, 2]
    assert rows["mass_kg"].to_list() == [17000.0, None, 12000.0, None, 16000.0]
    assert rows["std_kg"].to_list() == [500.0, None, 400.0, None, 500.0]
    assert rows["distance_km"].to_list() == [10.0, 9.0, 10.0, 10.0, 10.0]
    assert rows["duration_s"].to_list() == [800.0, 400.0, 600.0, 300.0, 300.0]
    assert rows["start"].dt.minute().to_list() == [0, 13, 0, 10, 15]
    (change,) = found.changes.filter(within_drive=True).to_dicts()
    assert (change["before_kg"], change["after_kg"], change["stop_s"]) == (12000.0, 16000.0, 300)


def test_a_known_trailer_has_the_permitted_mass_of_both(tmp_path):
    drives = [
        drive(f"{hour}", start=at(hour), mass=20000.0, std=500.0, gross_kg=18000.0)
        for hour in (6, 8, 10)
    ]
    other = drive("other", "truck2", start=at(8), mass=20000.0, std=500.0, gross_kg=18000.0)
    couplings = tmp_path / "couplings.csv"
    couplings.write_text(f"vehicle,start,end,permitted_kg\ntruck1,{at(7)},{at(9)},28000\n")
    found = reported([*drives, other], couplings=couplings)
    rows = found.legs.sort("vehicle_id", "start")
    assert rows["permitted_kg"].to_list() == [18000.0, 28000.0, 18000.0, 18000.0]
    assert rows["coupled"].to_list() == rows["trailer"].to_list() == [False, True, False, False]
    assert rows["level"].to_list() == ["alarm", "ok", "alarm", "alarm"]
    assert rows["gross_kg"].unique().to_list() == [18000.0]
    spans = found.track.sort("vehicle_id", "start")
    assert spans["state"].to_list() == ["loaded", "trailer", "loaded", "loaded"]


def test_a_table_of_couplings_is_read_and_its_mistakes_are_told(tmp_path):
    path = tmp_path / "couplings.csv"
    head = "vehicle,start,end,permitted_kg\n"
    path.write_text(head + "truck1,2026-05-04T07:00:00,,28000\n")
    rows = [drive("a"), drive("b", start=at(8)), drive("c", start="2096-05-04T06:00:00+00:00")]
    found = reported(rows, couplings=path).legs.sort("start")
    assert found["permitted_kg"].to_list() == [18000.0, 28000.0, 28000.0]
    for line, told in (
        ("truck1,noon,,28000", "noon"),
        ("truck1,2026-05-04T07:00:00,2026-05-04T06:00:00,28000", "2026-05-04T06:00:00"),
        ("truck1,2026-05-04T07:00:00,,28", "28"),
    ):
        path.write_text(head + line + "\n")
        with error(ConfigError, "couplings.csv row 2", told):
            reported(rows, couplings=path)
    path.write_text("vehicle,start\n")
    with error(ConfigError, "couplings.csv end"):
        reported(rows, couplings=path)


def test_a_load_that_changed_is_two_legs_and_others_one():
    told = [
        segment("a", 0, 5.0, 605.0, 12000.0, 400.0),
        segment("a", 1, 605.0, 1205.0, 9000.0, 300.0),
    ]
    changed = reported([drive("a", mass=9000.0, std=300.0, load_changed=True)], told).legs
    assert changed["mass_kg"].to_list() == [12000.0, 9000.0]
    assert changed["start"].to_list()[1] == datetime(2026, 5, 4, 6, 10, tzinfo=UTC)
    # Both share the error of the vehicle file, a part of the mass.
    assert changed["shared_kg"].to_list() == pytest.approx([320.0, 240.0])
    same = reported([drive("a", mass=9000.0, std=300.0)], told).legs
    assert same["mass_kg"].to_list() == [9000.0]


def test_a_change_between_drives_needs_more_than_its_own_error():
    # Own parts: 0.6 of the standard deviations, 240 kg each; together 339 kg.
    def changes(second):
        first = drive("a", mass=12000.0, std=400.0)
        then = drive("b", start=at(7), mass=second, std=400.0, start_latitude_deg=51.0)
        return reported([first, then]).changes

    assert changes(12600.0).height == 0
    (found,) = changes(12700.0).to_dicts()
    assert found["std_kg"] == pytest.approx(math.hypot(240.0, 240.0, 320.0 / 12700.0 * 700.0))
    assert (found["kind"], found["stop_s"], found["latitude_deg"]) == ("loaded", 2400, 51.0)
    assert changes(9000.0)["kind"].to_list() == ["unloaded"]
    assert changes(28000.0)["kind"].to_list() == ["trailer on"]


def test_legs_between_changes_are_one_span_of_the_track():
    rows = [
        drive("a", mass=8200.0, std=400.0),
        drive("b", start=at(7), mass=8500.0, std=500.0),
        drive("c", start=at(8)),
        drive("d", start=at(9), mass=14000.0, std=400.0),
        drive("e", "truck2", mass=28000.0, std=400.0),
        drive("f", "truck3", mass=9000.0, std=400.0, gross_kg=None),
    ]
    first, second, third, fourth = reported(rows).track.to_dicts()
    # Own parts 240 and 300 kg: weights 1 and 0.64.
    assert first["mass_kg"] == pytest.approx((8200.0 + 0.64 * 8500.0) / 1.64)
    shared = (320.0 / 8200.0 + 0.64 * 400.0 / 8500.0) / 1.64 * first["mass_kg"]
    assert first["std_kg"] == pytest.approx(math.hypot(240.0 / math.sqrt(1.64), shared))
    assert (first["legs"], first["distance_km"], first["state"]) == (2, 40.0, "empty")
    assert (first["start"], first["end"]) == (
        datetime(2026, 5, 4, 6, tzinfo=UTC),
        datetime(2026, 5, 4, 7, 20, tzinfo=UTC),
    )
    assert (second["legs"], second["state"], second["payload_kg"]) == (1, "loaded", 6000.0)
    assert (third["vehicle_id"], third["state"]) == ("truck2", "trailer")
    assert fourth["state"] is None


@pytest.mark.parametrize(("kind", "shared"), [("truck", [20.0]), ("bus", [12.0, 8.0])])
def test_sums_of_a_vehicle_and_of_all(kind, shared):
    rows = [
        drive("a", mass=13000.0, std=500.0),
        drive("b", start=at(8), mass=8200.0, std=500.0, distance_km=10.0),
        drive("c", start=at(9)),
        drive("d", "truck2", mass=20000.0, std=500.0, vehicle_class=kind),
    ]
    found = reported(rows)
    first, second = found.vehicles.to_dicts()
    assert (first["distance_km"], first["known_km"]) == (50.0, 30.0)
    assert first["known_share"] == pytest.approx(0.6)
    assert first["tkm"] == pytest.approx(5.0 * 20.0 + 0.2 * 10.0)
    # 400 kg on all of 30 km, 300 kg on each part by itself.
    assert first["tkm_std"] == pytest.approx(math.hypot(0.4 * 30.0, 0.3 * 20.0, 0.3 * 10.0))
    # The mean over 30 km: 400 kg in common, 300 kg on two thirds and on one.
    assert first["mean_payload_kg"] == pytest.approx(5000.0 * 2 / 3 + 200.0 / 3)
    assert first["mean_payload_std_kg"] == pytest.approx(math.hypot(400.0, 200.0, 100.0))
    assert first["empty_share"] == pytest.approx(10.0 / 30.0)
    assert (first["last_kg"], first["changes"], first["drives"]) == (8200.0, 1, 3)
    assert (second["alarms"], second["worst_overload"]) == (1, pytest.approx(0.99997, abs=1e-5))
    sums = found.totals
    # Files of one class err alike, those of two do not.
    assert sums["tkm_std"] == pytest.approx(math.hypot(*shared, 6.0, 3.0, 6.0))
    assert (sums["vehicles"], sums["alarms"], sums["distance_km"]) == (2, 1, 70.0)


def test_without_an_empty_mass_nothing_is_said_of_what_was_carried():
    unknown = drive("a", mass=9000.0, std=300.0, tare_kg=None)
    rows = [unknown, drive("b", "truck2", mass=9000.0, std=1.0)]
    found = reported(rows)
    assert found.vehicles["tkm"].to_list() == [None, pytest.approx(20.0)]
    assert found.vehicles["tkm_std"].to_list()[0] is None
    assert found.totals["tkm"] == pytest.approx(20.0)


def test_sentences_that_differ_in_numbers_are_one_problem():
    rows = [drive(k, warnings=[f"delay +0.0{n} s found"]) for n, k in enumerate("abc")]
    rows.append(drive("d", mass=9000.0, std=300.0, warnings=["the tank leaks"]))
    found = reported(rows).quality
    assert found.select("kind", "drives", "share").rows() == [
        ("no mass", 3, 0.75),
        ("warning", 3, 0.75),
        ("warning", 1, 0.25),
    ]


def test_rfms_has_the_last_mass_in_whole_kilograms():
    rows = [drive("b", start=at(8), mass=9000.4, std=300.0), drive("a", mass=12000.0, std=300.0)]
    assert reported(rows).rfms.rows() == [("truck1", "2026-05-04T08:20:00Z", 9000)]


def test_distance_by_speed_and_mass():
    told = [
        segment("a", 0, 0.0, 450.0, 11000.0, 300.0, km=7.0, period_km=[2.0, 5.0]),
        segment("b", 0, 0.0, 300.0, None, None, km=4.0, period_km=[4.0]),
    ]
    rows = [drive("a", mass=12500.0, std=300.0), drive("b", "truck2")]
    found = speed_mass(*frames(rows, told))
    # 2 km in 5 min are 24 km/h, 5 km in 2.5 min 120 km/h; the drive's mass, not the segment's.
    assert found.rows() == [
        (20.0, 12.0, 2.0, pytest.approx(1 / 12)),
        (90.0, 12.0, 5.0, pytest.approx(1 / 24)),
        (40.0, None, 4.0, pytest.approx(1 / 12)),
    ]
    assert speed_mass(*frames(rows, told), by_vehicle=True)["vehicle_id"].n_unique() == 2
    with error(ConfigError, "speeds 10.0 20.0"):
        speed_mass(*frames(rows, told), speeds=(10.0, 20.0))


def test_a_ticket_belongs_to_the_leg_under_way_or_the_nearest_within_an_hour(tmp_path):
    rows = [drive("a", mass=12000.0, std=300.0), drive("b", start=at(7), mass=9000.0, std=300.0)]
    tickets = tmp_path / "tickets.csv"

    def errors(*rest):
        tickets.write_text("\n".join(["vehicle,time,mass_kg", ",".join(rest), ""]))
        return reported(rows, tickets=tickets).outside["worst_error"].to_list()

    of_first, of_second = [pytest.approx(0.2)], [pytest.approx(-0.1)]
    assert errors("truck1", at(6, 10), "10000") == of_first
    assert errors("truck1", at(6, 25), "10000") == of_first
    assert errors("truck1", at(6, 45), "10000") == of_second
    assert errors("truck1", at(5, 5), "10000") == of_first
    assert errors("truck1", at(4, 55), "10000") == []
    assert errors("truck1", at(9), "10000") == []
    assert errors("van9", at(6, 10), "10000") == []


def test_verdicts_need_all_three_loads_within_the_tolerance():
    def verdict(errors, **more):
        loads = (9000.0, 12600.0, 17100.0)
        rows = [
            drive(str(k), start=at(6 + k), mass=m * (1.0 + e), std=300.0, known_mass_kg=m, **more)
            for k, (m, e) in enumerate(zip(loads, errors, strict=False))
        ]
        return reported(rows).verdicts.to_dicts()[0]

    assert verdict((0.04, -0.04, 0.01))["verdict"] == "passed"
    failed = verdict((0.04, -0.06, 0.01))
    assert (failed["verdict"], failed["worst_70"]) == ("failed", pytest.approx(-0.06))
    assert "65 to 75 %" in failed["why"]
    assert verdict((0.04, -0.04))["verdict"] == "incomplete"
    # A first mass after 15 minutes, a check without one, a running mass far off.
    assert verdict((0.0, 0.0, 0.0), first_mass_s=901.0)["late"] == 3
    assert verdict((0.0, 0.0, 0.0), checked_kg=[None])["verdict"] == "failed"
    assert verdict((0.0, 0.0, 0.0), checked_kg=[9450.0])["worst_50"] == pytest.approx(0.05)


def test_known_masses_outside_the_interval_are_counted_and_the_worst_is_named():
    told = [("a", 9000.0, 9100.0), ("b", 9000.0, 9700.0), ("c", 9000.0, 8100.0), ("d", None, 9e3)]
    rows = [
        *(
            drive(key, start=at(6 + k), mass=mass, std=300.0 if mass else None, known_mass_kg=kg)
            for k, (key, mass, kg) in enumerate(told)
        ),
        drive("e", "van9", mass=2000.0, std=50.0, known_mass_kg=2010.0),
        drive("f", "van8", mass=2000.0, std=50.0),
    ]
    first, second = reported(rows).outside.to_dicts()
    # 1.96 standard deviations are 588 kg.
    assert (first["vehicle_id"], first["known"], first["outside"]) == ("truck1", 3, 2)
    assert first["worst_known_kg"] == 8100.0
    assert first["worst_low95_kg"] == pytest.approx(9000.0 - 588.0, abs=1.0)
    assert first["worst_error"] == pytest.approx(9000.0 / 8100.0 - 1.0)
    assert first["worst_start"] == datetime(2026, 5, 4, 8, tzinfo=UTC)
    assert (second["vehicle_id"], second["known"], second["outside"]) == ("van9", 1, 0)
    assert second["worst_known_kg"] is None


@pytest.mark.parametrize(
    "limits", [Limits(warn=0.99), Limits(alarm=1.0), Limits(empty=-0.1), Limits(trailer=1.0)]
)
def test_impossible_limits_are_refused(limits):
    with pytest.raises(ConfigError, match="got"):
        reported([drive("a")], limits=limits)


def test_what_was_not_judged_is_ranked_by_what_it_prevents():
    lone = {"vehicle_file": None, "gross_kg": None, "tare_kg": None}
    rows = [
        drive("a", mass=9000.0, std=300.0),
        drive("b", "car7", mass=1500.0, std=100.0, **lone),
        drive("c", "car8", mass=1500.0, std=100.0, **lone),
        drive("d", "car8", reason_id="torque.none", reason="none", **lone),
        drive("e", "van1", mass=2500.0, std=100.0, tare_kg=None, distance_km=None),
        drive("f", "van2", mass=2500.0, std=100.0, gross_kg=None, tare_kg=None),
        drive("g", "van1", reason_id="speed.none", reason="11 s"),
        drive("h", "van2", reason_id="speed.none", reason="12 s"),
    ]
    found = reported(rows).unjudged
    assert found.select("prevents", "reason_id", "count", "vehicles").rows() == [
        ("mass", "speed.none", 2, ["van1", "van2"]),
        ("mass", "torque.none", 1, ["car8"]),
        ("overload", "fleet.no_file", 2, ["car7", "car8"]),
        ("overload", "fleet.no_permitted", 1, ["van2"]),
        ("payload", "fleet.no_tare", 1, ["van1"]),
    ]
    assert found["share"].sum() == pytest.approx(7 / 8)
    assert found["distance_km"].to_list() == [40.0, 20.0, 40.0, 20.0, 0.0]
    assert found["example"][0] == "11 s"


def test_results_without_a_mass_give_empty_figures():
    found = reported([drive("a")])
    assert found.rfms.is_empty()
    assert found.track.is_empty()
    assert found.totals["known_share"] == 0.0
