"""One recording to its rows: as `weigh` has them, and with a reason where there is none."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

import weighbridge as wb
from tests.fleet.fleets import compared, real_fleet, tiny_fleet
from tests.noted import error, named, noted
from weighbridge import ConfigError
from weighbridge.fleet.inputs import recordings
from weighbridge.fleet.job import THERE, Job, fail_job, weigh_job
from weighbridge.fleet.store import Results, part_path, read_parts
from weighbridge.fleet.vehicles import Vehicles


def jobs(home, drives, cars, **how):
    shelf, results = Vehicles(cars), Results.begun(home / "results")
    for recording in recordings([str(drives)]):
        assigned = shelf.of(recording.paths, recording.vehicle, recording.kind)
        yield Job(recording=recording, assigned=assigned, results=str(results.folder), **how)


def rows(job, receipt):
    return read_parts([part_path(Path(job.results), receipt.key)])


def test_the_row_is_that_of_weigh_to_the_last_bit(tmp_path, short_drive, short_car):
    drives, cars = real_fleet(tmp_path, short_drive.drive, short_car, 1)
    (job,) = jobs(tmp_path, drives, cars)
    (row,) = rows(job, weigh_job(job)).to_dicts()
    found = wb.weigh(job.recording.paths[0], cars / "car.toml")
    told = found.row
    numbers = {
        "mass_kg": told.mass, "std_kg": told.std, "payload_kg": told.payload,
        "duration_s": told.duration, "used_s": told.used_time, "bound_std_kg": told.bound_std,
        "converged_at_s": told.converged_at, "maker_mass_kg": told.maker_mass,
        "low95_kg": told.interval[0], "high95_kg": told.interval[1],
    }  # fmt: skip
    assert {n: row[n] for n in numbers} == {n: v if v == v else None for n, v in numbers.items()}
    for name in ("drive", "vehicle", "method", "status", "reason", "load_changed",
                 "trailer_connected"):  # fmt: skip
        assert row[name] == getattr(told, name), name
    assert row["start"] == datetime.fromisoformat(told.start)
    assert row["problem_ids"] == [p.id for p in told.problems]
    assert row["warnings"] == [p.text for p in told.problems]
    spans = [[s[n] for n in ("start_s", "end_s", "mass_kg", "std_kg")] for s in row["segments"]]
    assert spans == [[s.start, s.end, s.mass, s.std] for s in told.segments]
    assert row["freedom"] == found.result.degrees_of_freedom
    assert row["distance_km"] == pytest.approx(sum(s["distance_km"] for s in row["segments"]))
    (segment,) = row["segments"]
    assert segment["weighed_s"] == pytest.approx(row["used_s"], abs=1.0)
    assert row["unweighed_s"] == 0.0


def test_a_row_keeps_the_running_mass_at_set_instants_and_the_way_of_each_period(
    tmp_path, short_drive, short_car, monkeypatch
):
    monkeypatch.setattr("weighbridge.fleet.facts.CHECKS", (150.0, 60.0))
    monkeypatch.setattr("weighbridge.fleet.facts.PERIOD", 60.0)
    drives, cars = real_fleet(tmp_path, short_drive.drive, short_car, 1)
    (job,) = jobs(tmp_path, drives, cars)
    (row,) = rows(job, weigh_job(job)).to_dicts()
    found = wb.weigh(job.recording.paths[0], cars / "car.toml")
    speed = found.drive.speed
    k = next(k for k, v in enumerate(speed.values) if v > 1.0)
    track = found.track.drop_nulls("mass_kg")
    # It speeds up from a standstill: from half a metre per second on it moves.
    begin = speed.time[k - 1]
    first = track.filter(track["std_kg"] <= 0.1 * track["mass_kg"])["time_s"][0]
    assert row["first_mass_s"] == pytest.approx(first - begin, abs=1.0)
    assert 0.0 < row["systematic_std_kg"] < row["std_kg"]
    assert len(row["checked_kg"]) == int((found.drive.end - begin - 150.0) // 60.0) + 1
    for n, mass in enumerate(row["checked_kg"]):
        near = track.filter((track["time_s"] - begin - 150.0 - 60.0 * n).abs() < 1.5)
        # Weighed twice, a mass may differ by some 1e-5.
        assert ((near["mass_kg"] / mass - 1.0).abs() < 1e-4).any()
        assert ((near["std_kg"] / row["checked_std_kg"][n] - 1.0).abs() < 1e-2).any()
    for segment in row["segments"]:
        duration = segment["to_s"] - segment["from_s"]
        assert len(segment["period_km"]) == -(-duration // 60.0)
        assert sum(segment["period_km"]) == pytest.approx(segment["distance_km"])


def test_the_same_job_writes_the_same_row_again(tmp_path):
    drives, cars = tiny_fleet(tmp_path, 1)
    (job,) = jobs(tmp_path, drives, cars)
    receipt = weigh_job(job)
    first = rows(job, receipt)
    assert weigh_job(job)._replace(seconds=0.0) == receipt._replace(
        outcome=THERE, drives=0, seconds=0.0
    )
    part_path(Path(job.results), receipt.key).unlink()
    assert weigh_job(job).key == receipt.key
    assert compared(rows(job, receipt)).equals(compared(first))


def test_the_key_follows_content_vehicle_and_method_and_no_name(tmp_path):
    drives, cars = tiny_fleet(tmp_path, 1)
    (job,) = jobs(tmp_path, drives, cars)
    key = weigh_job(job).key
    place = Path(job.recording.paths[0])
    moved = place.rename(place.with_name("renamed"))
    (job,) = jobs(tmp_path, drives, cars)
    assert weigh_job(job)[:2] == (key, THERE)
    (job,) = jobs(tmp_path, drives, cars, method="rls")
    other = {key, weigh_job(job).key}
    car = cars / "van0.toml"
    car.write_text(car.read_text() + "\n")
    (job,) = jobs(tmp_path, drives, cars)
    other.add(weigh_job(job).key)
    with (moved / "obd.csv").open("a") as file:
        file.write("5,20\n")
    (job,) = jobs(tmp_path, drives, cars)
    other.add(weigh_job(job).key)
    other.add(weigh_job(replace(job, dbc_digest="of another database")).key)
    assert len(other) == 5


def test_keys_known_from_before_are_not_weighed_again(tmp_path):
    drives, cars = tiny_fleet(tmp_path, 2)
    one, two = jobs(tmp_path, drives, cars)
    key = weigh_job(one).key
    part_path(Path(one.results), key).unlink()
    known = tmp_path / "keys"
    known.write_text("".join(f"{one}\n" for one in sorted([key, "0" * 32, "f" * 32])))
    told = [weigh_job(job).outcome for job in jobs(tmp_path, drives, cars, known=str(known))]
    assert told == [THERE, "weighed"]
    assert two is not None


@pytest.mark.parametrize("other", [{"version": "0.0.1"}, {"format_version": 99}])
def test_a_job_of_another_version_is_refused_and_writes_nothing(tmp_path, other):
    drives, cars = tiny_fleet(tmp_path, 1)
    (job,) = jobs(tmp_path, drives, cars, **other)
    with error(ConfigError, "vm 0.3.0"):
        weigh_job(job)
    assert Results(Path(job.results)).part_files() == []


def test_a_bad_drive_is_a_row_with_its_reason(tmp_path):
    drives, cars = tiny_fleet(tmp_path, 1)
    (drives / "van0" / "trip-0000" / "obd.csv").write_text("time_s,vehicle_speed_kmh\n")
    (job,) = jobs(tmp_path, drives, cars)
    receipt = weigh_job(job)
    (row,) = rows(job, receipt).to_dicts()
    assert (row["outcome"], row["tries"], row["mass_kg"]) == ("unread", 1, None)
    assert named(row["reason"], "trip-0000 obd.csv")
    assert (row["vehicle_id"], row["tare_kg"]) == ("van0", 2000.0)
    assert weigh_job(job).outcome == THERE


def test_a_drive_that_is_gone_is_tried_three_times(tmp_path):
    drives, cars = tiny_fleet(tmp_path, 1)
    (job,) = jobs(tmp_path, drives, cars)
    place = Path(job.recording.paths[0])
    place.rename(tmp_path / "away")
    receipt = weigh_job(job)
    (row,) = rows(job, receipt).to_dicts()
    assert (row["outcome"], row["tries"]) == ("failed", 3)
    assert row["reason_id"] == "fleet.failed"
    assert fail_job(job, noted("its worker died")).key == receipt.key
    (tmp_path / "away").rename(place)
    assert weigh_job(job).outcome == "weighed"


def test_a_vehicle_without_a_file_is_weighed_as_its_class_and_says_so(
    tmp_path, short_drive, short_car
):
    drives, cars = real_fleet(tmp_path, short_drive.drive, short_car, 1)
    (cars / "car.toml").rename(cars / "another.toml")
    (job,) = jobs(tmp_path, drives, cars)
    (row,) = rows(job, weigh_job(job)).to_dicts()
    assert (row["vehicle_file"], row["vehicle_id"], row["vehicle_class"]) == (None, "car", "car")
    assert row["problem_ids"][0] == "vehicle.no_file"


def test_a_begin_that_the_table_of_drives_gives(tmp_path):
    drives, cars = tiny_fleet(tmp_path, 1)
    place = drives / "van0" / "trip-0000"
    (place / "drive.toml").unlink()
    (tmp_path / "drives.csv").write_text(
        f"files,vehicle,start\n{place},van2,2026-07-08T09:00:00Z\n"
    )
    (job,) = jobs(tmp_path, tmp_path / "drives.csv", cars)
    (row,) = rows(job, weigh_job(job)).to_dicts()
    assert row["start"] == datetime(2026, 7, 8, 9, tzinfo=UTC)
    assert (str(row["date"]), row["vehicle_id"]) == ("2026-07-08", "van2")


def test_the_truth_of_a_simulation_is_no_content(tmp_path):
    drives, cars = tiny_fleet(tmp_path, 1)
    (job,) = jobs(tmp_path, drives, cars)
    key = weigh_job(job).key
    place = Path(job.recording.paths[0])
    (place / "truth.csv").write_text("time_s,mass_kg\n0,1000\n")
    (job,) = jobs(tmp_path, drives, cars)
    assert weigh_job(job)[:2] == (key, THERE)
    lone = job.recording._replace(paths=(str(place / "obd.csv"),))
    assert weigh_job(replace(job, recording=lone)).key != key
