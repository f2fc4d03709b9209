"""Vehicle files refined by tickets; drift, and files that their drives contradict."""

import shutil
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import dask
import numpy as np
import polars as pl
import pytest

import weighbridge as wb
from tests.fleet.fleets import real_fleet, tiny_drive
from tests.noted import error, named
from weighbridge import ConfigError
from weighbridge.fleet.learning import (
    MOST,
    Drift,
    Known,
    Lesson,
    chosen,
    drift,
    learn_vehicle,
    with_drift,
)
from weighbridge.fleet.tickets import Ticket, read_tickets, ticketed
from weighbridge.fleet.vehicles import Assigned

GOLDEN = Path(__file__).parents[1] / "golden"
NOON = datetime(2026, 5, 1, 12, tzinfo=UTC)


def tickets_at(path, *rows):
    lines = [f"{vehicle},{time},{mass}" for vehicle, time, mass in rows]
    path.write_text("\n".join(["vehicle,time,mass_kg", *lines]) + "\n")
    return path


def test_drives_that_contradict_their_file_refine_it(tmp_path, short_drive, short_car, scheduler):
    wrong = replace(short_car, torque=short_car.torque.scaled(1.2))
    drive = short_drive.drive
    part = drive.between(drive.start, drive.start + 450.0)
    drives, cars = real_fleet(tmp_path, part, wrong, 2)
    mass = float(short_drive.truth.mass[0])
    days = ("2026-05-01", "2026-05-02")
    tickets = tickets_at(tmp_path / "t.csv", *(("car", f"{d}T06:05:00Z", mass) for d in days))
    before = (cars / "car.toml").read_bytes()
    learnt, results = tmp_path / "learnt", tmp_path / "results"
    rows = wb.fleet.weigh_drives(
        drives, cars, results, scheduler=scheduler, learn=learnt, tickets=tickets
    )
    off = rows.collect()["mass_kg"] / mass - 1.0
    assert off.min() > 0.1
    (row,) = pl.read_parquet(results / "learnt.parquet").to_dicts()
    assert (row["vehicle_id"], row["drives"], row["refined"]) == ("car", 2, "car.toml")
    assert row["error_pct"] == pytest.approx(100.0 * off.mean(), abs=0.1)
    assert row["contradicted"]
    assert "too heavy" in row["findings"]
    (told,) = wb.fleet.report(results).to_dict()["learnt"]
    assert (told["verdict"], told["findings"]) == ("contradicted", row["findings"])
    pl.DataFrame([row]).rename({"findings": "told"}).write_parquet(results / "learnt.parquet")
    assert wb.fleet.report(results).to_dict()["learnt"] == [told]
    assert (cars / "car.toml").read_bytes() == before
    again = wb.weigh(drives / "car" / "trip-0", learnt / "car.toml")
    assert again.mass == pytest.approx(mass, rel=0.03)


def test_a_vehicle_that_kills_its_worker_loses_nothing_of_the_others(
    tmp_path, short_drive, short_car
):
    drives, cars = real_fleet(tmp_path, short_drive.drive, short_car, 1)
    mass = float(short_drive.truth.mass[0])
    rows = [("car", "2026-05-01T06:05:00Z", mass)]
    for number, name in enumerate(("deadly", "odd"), start=1):
        shutil.copy(cars / "car.toml", cars / f"{name}.toml")
        tiny_drive(drives / name / "trip", number)
        rows.append((name, f"2026-05-0{1 + number}T06:0{number}:00Z", mass))
    fault = tmp_path / "fault.py"
    fault.write_text(
        "import os, signal\n"
        "from weighbridge.fleet import learning\n"
        "real = getattr(learning.chosen, 'real', learning.chosen)\n"
        "def chosen(drives):\n"
        "    name = os.path.basename(os.path.dirname(drives[0].paths[0]))\n"
        "    if name == 'deadly':\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "    return {}['gone'] if name == 'odd' else real(drives)\n"
        "chosen.real = real\n"
        "learning.chosen = chosen\n"
    )
    how = {"learn": tmp_path / "learnt", "tickets": tickets_at(tmp_path / "t.csv", *rows)}
    with dask.config.set({"distributed.worker.preload": [str(fault)]}):
        wb.fleet.weigh_drives(drives, cars, tmp_path / "results", workers=2, **how)
    car, deadly, odd = pl.read_parquet(tmp_path / "results" / "learnt.parquet").to_dicts()
    assert (car["vehicle_id"], car["weighed"], car["refined"]) == ("car", 1, "car.toml")
    assert wb.Vehicle.load(tmp_path / "learnt" / "car.toml").torque is not None
    assert (deadly["vehicle_id"], deadly["drives"], deadly["refined"]) == ("deadly", 1, None)
    assert deadly["findings"].startswith("nothing was learnt: its worker ended 3 times")
    assert odd["findings"] == "nothing was learnt: KeyError: 'gone'"


def test_learning_never_writes_over_what_is_read(tiny, tmp_path, scheduler):
    drives, cars = tiny
    tickets = tickets_at(tmp_path / "t.csv")
    with error(ConfigError, "vehicles --learn"):
        wb.fleet.weigh_drives(drives, cars, tmp_path / "r", learn=cars, tickets=tickets)
    other = tmp_path / "other"
    other.mkdir()
    (other / "van1.toml").write_text("[letter]\ndear = 1\n")
    with pytest.raises(ConfigError, match=r"van1\.toml"):
        wb.fleet.weigh_drives(drives, cars, tmp_path / "r", learn=other, tickets=tickets)
    with error(ConfigError, "--learn --tickets"):
        wb.fleet.weigh_drives(drives, cars, tmp_path / "r", tickets=tickets)


def drive_row(key, hour, *, minutes=60, vehicle="van", changed=False):
    begin = NOON + timedelta(hours=hour)
    return {
        "key": key,
        "part": 0,
        "vehicle_id": vehicle,
        "start": begin,
        "unweighed_s": 0.0,
        "duration_s": 60.0 * minutes,
        "outcome": "weighed",
        "load_changed": changed,
    }


def matched(tickets, *rows):
    found = ticketed([Ticket(*t) for t in tickets], pl.LazyFrame(list(rows)))
    return dict(found.select("key", "ticket_kg").rows())


def test_a_ticket_is_of_the_nearest_drive_of_its_vehicle():
    rows = [drive_row("early", 0), drive_row("late", 3), drive_row("other", 0, vehicle="bus")]
    at = NOON + timedelta(hours=1, minutes=20)
    assert matched([("van", at, 3000.0)], *rows) == {"early": 3000.0}
    assert matched([("van", at + timedelta(hours=1), 3000.0)], *rows) == {"late": 3000.0}
    assert matched([("van", at + timedelta(hours=9), 3000.0)], *rows) == {}
    assert matched([("van", NOON - timedelta(minutes=61), 3000.0)], *rows) == {}
    assert matched([("van", NOON, 3000.0), ("van", at, 3100.0)], *rows) == {"early": 3000.0}


def test_the_ticket_of_a_drive_in_which_the_load_changed_is_of_no_neighbour():
    rows = [drive_row("a", 0, changed=True), drive_row("b", 1)]
    at = NOON + timedelta(minutes=55)
    assert matched([("van", at, 3000.0)], *rows) == {}
    assert matched([("van", at, 3000.0)], rows[1]) == {"b": 3000.0}
    assert matched([("van", at, 3000.0)], rows[1] | {"unweighed_s": 300.0}) == {}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("vehicle,time\nvan,2026-05-01\n", "tickets.csv vehicle time mass_kg"),
        ("vehicle,time,mass_kg\nvan,noon,3000\n", "tickets.csv row 2 noon 3000"),
        ("vehicle,time,mass_kg\nvan,2026-05-01,3\n", "tickets.csv row 2 van 3 kg"),
    ],
)
def test_impossible_tickets_are_told(tmp_path, text, told):
    path = tmp_path / "tickets.csv"
    path.write_text(text)
    with error(ConfigError, told):
        read_tickets(path)


def test_a_drift_is_the_slope_over_time_and_told_where_it_is_sure():
    days = [NOON + timedelta(days=k) for k in range(60)]
    noise = np.random.default_rng(1).normal(0.0, 0.1, 60)
    line = 0.5 * np.arange(60) / 30.0
    sure = drift(days, line + noise)
    assert sure.slope == pytest.approx(0.5, abs=4 * sure.std)
    # The textbook's standard error of a slope.
    spread = np.sum(np.square((np.arange(60) - 29.5) / 30.0))
    assert sure.std == pytest.approx(0.1 / np.sqrt(spread), rel=0.3)
    assert sure.sure
    assert not drift(days, noise).sure
    assert not drift(days[:3], line[:3]).sure
    assert not drift([NOON] * 9, noise[:9]).sure


def test_few_drives_are_chosen_over_all_masses():
    drives = [
        Known((f"{k}",), 0, NOON + timedelta(days=k), 1.0, 1.0, 1000.0 + k % 30) for k in range(90)
    ]
    found = chosen(drives)
    assert len(found) == MOST
    masses = sorted(k.known for k in found)
    assert (masses[0], masses[-1]) == (1000.0, 1029.0)
    assert [k.begin for k in found] == sorted(k.begin for k in found)
    assert chosen(drives[:3]) == drives[:3]


@pytest.mark.parametrize("per_month", [3.0, -3.0])
def test_a_file_refined_from_drives_that_drift_is_no_surer_than_the_drift(short_car, per_month):
    days = [NOON + timedelta(days=k) for k in range(60)]
    line = per_month * np.arange(60) / 30.0
    change = drift(days, line + np.random.default_rng(1).normal(0.0, 0.1, 60))
    before = 0.005
    car = replace(short_car, provenance=replace(short_car.provenance, mass_scale_std=before))
    refined = with_drift(car, change, days)
    left = refined.provenance.mass_scale_std
    # How far the scale of the last drive lies from their mean.
    last = 0.01 * abs(line[-1] - line.mean())
    assert left == pytest.approx(np.hypot(before, last), rel=0.03)
    assert left > 3.0 * before
    assert "the torque scale drifts by" in refined.provenance.notes
    assert with_drift(car, Drift(per_month, 1e3), days) is car
    assert with_drift(car, change, days[:1]) is car


def test_raw_logs_are_learnt_from_with_the_databases_of_the_fleet(tmp_path, short_car):
    known = Known((f"{GOLDEN / 'can.log'}",), 0, NOON, 1500.0, 30.0, 1500.0)
    car = Assigned(
        id="car", file="car.toml", vehicle=short_car, kind="car", mapping=None, digest=""
    )
    lesson = Lesson(assigned=car, drives=(known,), output=str(tmp_path))
    assert "engine_torque" in learn_vehicle(lesson)["findings"]
    lost = learn_vehicle(replace(lesson, dbc=(str(tmp_path / "lost.dbc"),)))["findings"]
    assert named(lost, "can.log --dbc lost.dbc")
