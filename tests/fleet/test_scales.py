"""Scales of a fleet's vehicles, found without tickets, through runs and reports."""

import copy
import math
import shutil
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import weighbridge as wb
from tests.fleet.fleets import tiny_drive
from tests.fleet.made_rows import drive
from weighbridge.fleet.kept import keep_legs
from weighbridge.fleet.scales import Weighed, find_scales
from weighbridge.fleet.store import Results, write_part
from weighbridge.fleet.vehicles import Vehicles
from weighbridge.vehicle import Known, describe

TARE, GROSS = 9000.0, 18000.0
BEGIN = datetime.fromisoformat("2026-05-04T06:00:00+00:00")
STATED = 0.05  # what the vehicle files leave of the scale [-]


def runs(seed, scale, *, count=20, empty=0.4, always=0.0):
    """True and weighed masses of a truck: some runs empty, the others with any load."""
    rng = np.random.default_rng(seed)
    load = rng.uniform(0.15, 0.95, count) * (GROSS - TARE - always)
    load[: round(empty * count)] = 0.0
    true = TARE + always + load
    return true, true * math.exp(scale) * (1.0 + rng.normal(0.0, 0.01, count))


class Fleet:
    """Vehicle files, results with rows as a run writes them, and one drive for a run to find."""

    def __init__(self, home):
        self.true = {}
        self.settle(home)
        self.cars.mkdir()

    def settle(self, home):
        self.cars, self.drives, self.results = home / "cars", home / "drives", home / "results"
        self.home = home

    def copied(self, home):
        """Return the same fleet in a folder that a test may change."""
        shutil.copytree(self.home, home)
        other = copy.copy(self)
        other.true = dict(self.true)
        other.settle(home)
        return other

    def add(
        self, name, true, weighed, *, kind="tipper", tare=TARE, gross=GROSS, stated=STATED,
        backwards=False,
    ):  # fmt: skip
        car = describe(Known(name=name, kind="truck", tare=tare, gross=gross, torque="percent"))
        replace(car.vehicle, type=kind).save(self.cars / f"{name}.toml")
        digest = Vehicles(self.cars).of((), name).digest
        folder = Results.begun(self.results).folder
        rows = list(enumerate(zip(true, weighed, strict=True)))
        for k, (known, mass) in rows[::-1] if backwards else rows:
            key, start = f"{name}-{k:03d}", BEGIN + timedelta(hours=3 * k)
            self.true[key] = known
            row = drive(
                key,
                name,
                start=start.isoformat(),
                mass=mass,
                std=math.hypot(STATED, 0.012) * mass,
                systematic_std_kg=None if stated is None else stated * mass,
                tare_kg=tare,
                gross_kg=gross,
                vehicle_digest=digest,
                date=start.date(),
            )
            write_part(folder, key, [row | {"segments": []}])

    def learn(self, scheduler, **how):
        """Run the command's function, which learns unless ``learn`` is None."""
        if not self.drives.exists():
            tiny_drive(self.drives / "other" / "trip", 1)
        wb.fleet.weigh_drives(
            self.drives, self.cars, self.results, scheduler=scheduler, kind="truck",
            **{"learn": self.home / "refined"} | how,
        )  # fmt: skip
        return self.told()

    def told(self):
        """Legs of the report with their true masses, and rows of what was learnt."""
        found = wb.fleet.report(self.results)
        true = pl.DataFrame(list(self.true.items()), schema=["key", "true"], orient="row")
        legs = found.legs.join(true, on="key").with_columns(
            error=pl.col("mass_kg") / pl.col("true") - 1.0,
            raw=pl.col("weighed_kg") / pl.col("true") - 1.0,
        )
        return legs, {row["vehicle_id"]: row for row in found.learnt.to_dicts()}


SCALES = (0.05, 0.06, 0.045, 0.055, 0.065, 0.05)


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """Six trucks of one type that weigh 5 % too heavy, and a seventh with a crane aboard."""
    made = Fleet(tmp_path_factory.mktemp("fleet"))
    for k, scale in enumerate(SCALES):
        made.add(f"truck{k}", *runs(k, scale))
    made.add("crane", *runs(9, 0.05, always=1300.0))
    return made


@pytest.fixture(scope="module")
def learnt_once(fleet, scheduler, tmp_path_factory):
    """The fleet of which a run has learnt; not to be changed."""
    taught = fleet.copied(tmp_path_factory.mktemp("learnt") / "fleet")
    taught.learn(scheduler)
    return taught


@pytest.fixture
def taught(learnt_once, tmp_path):
    """The fleet of which a run has learnt, in a folder of the test."""
    return learnt_once.copied(tmp_path / "fleet")


def test_masses_are_corrected_by_empty_runs_and_by_what_a_type_shares(fleet, tmp_path, scheduler):
    fleet = fleet.copied(tmp_path / "fleet")
    legs, learnt = fleet.learn(scheduler, learn=None)
    assert (len(learnt), legs["factor"].null_count()) == (0, legs.height)
    legs, learnt = fleet.learn(scheduler)
    trucks = legs.filter(pl.col("vehicle_id") != "crane")
    assert trucks["raw"].mean() > 0.05
    assert abs(trucks["error"].mean()) < 0.012
    each = trucks.group_by("vehicle_id").agg(pl.col("error").mean())
    assert each["error"].abs().max() < 0.02
    assert trucks["true"].is_between(trucks["low95_kg"], trucks["high95_kg"]).mean() > 0.9
    row = learnt["truck0"]
    assert (row["verdict"], row["type"], row["factor_legs"]) == ("scaled", "tipper", 20)
    assert row["factor_reason_id"] == "fleet.scale_empty"
    assert row["factor_std"] < 0.5 * STATED
    own = trucks.filter(pl.col("vehicle_id") == "truck0")
    assert own["mass_kg"].to_list() == pytest.approx((own["weighed_kg"] * row["factor"]).to_list())
    assert own["payload_kg"].to_list() == pytest.approx((own["mass_kg"] - TARE).to_list())
    # The tables of drives keep what was weighed; that of legs has what the report has.
    drives = pl.read_parquet(fleet.results / "drives", hive_partitioning=False)
    kept = pl.read_parquet(fleet.results / "legs", hive_partitioning=False)
    assert (
        dict(drives.select("key", "mass_kg").iter_rows()).items()
        >= dict(trucks.select("key", "weighed_kg").iter_rows()).items()
    )
    shown = wb.fleet.report(fleet.results).legs
    assert kept.sort("key").equals(shown.select(kept.columns).sort("key"))


def test_a_vehicle_that_is_never_empty_is_not_shifted_by_its_lightest_runs(learnt_once):
    legs, learnt = learnt_once.told()
    row = learnt["crane"]
    assert row["factor_reason_id"] in ("fleet.scale_wrong", "fleet.scale_never")
    assert row["verdict"] == "never empty"
    # Its lightest runs are 1300 kg heavier: taken as empty, they would make it 14 % too light.
    assert abs(legs.filter(pl.col("vehicle_id") == "crane")["error"].mean()) < 0.02


def test_transport_and_overload_are_those_of_the_corrected_masses(fleet, learnt_once):
    before = wb.fleet.report(fleet.results)
    after = wb.fleet.report(learnt_once.results)
    true = sum(1e-3 * (mass - TARE) * 20.0 for mass in fleet.true.values())
    assert before.totals["tkm"] > 1.1 * true
    assert after.totals["tkm"] == pytest.approx(true, rel=0.06)
    # What a type shares adds up as it is, all else by squares.
    way = pl.col("distance_km") * 1e-3
    sums = after.legs.filter(pl.col("tkm").is_not_null()).group_by("vehicle_id").agg(
        common=(way * pl.col("common_kg")).sum(),
        shared=(way * pl.col("shared_kg")).sum(),
        alone=(way**2 * (pl.col("std_kg") ** 2 - pl.col("shared_kg") ** 2)).sum(),
    )  # fmt: skip
    rest = (sums["shared"] ** 2 - sums["common"] ** 2 + sums["alone"]).sum()
    std = math.sqrt(sums["common"].sum() ** 2 + rest)
    assert after.totals["tkm_std"] == pytest.approx(std, rel=1e-6)
    assert std < 0.6 * before.totals["tkm_std"]
    heavier = before.legs.join(after.legs, on="key", suffix="_after").drop_nulls("overload")
    assert (heavier["overload"] >= heavier["overload_after"]).mean() > 0.9
    moved = after.speed_mass.filter(pl.col("mass_t") >= 18.0)["distance_km"].sum()
    assert moved <= before.speed_mass.filter(pl.col("mass_t") >= 18.0)["distance_km"].sum()


def test_the_order_of_rows_and_a_run_that_is_continued_change_nothing(fleet, tmp_path, scheduler):
    fleet = fleet.copied(tmp_path / "fleet")
    fleet.learn(scheduler)
    first = pl.read_parquet(fleet.results / "learnt.parquet")
    (tmp_path / "other").mkdir()
    other = Fleet(tmp_path / "other")
    other.add("crane", *runs(9, 0.05, always=1300.0), backwards=True)
    for k in reversed(range(6)):
        other.add(f"truck{k}", *runs(k, SCALES[k]), backwards=True)
    other.learn(scheduler)
    again = pl.read_parquet(other.results / "learnt.parquet")
    assert again.drop("vehicle_digest").equals(first.drop("vehicle_digest"))
    files = sorted((fleet.results / "legs").glob("*/*.parquet"))
    ages = [file.stat().st_mtime_ns for file in files]
    fleet.learn(scheduler)
    assert pl.read_parquet(fleet.results / "learnt.parquet").equals(first)
    assert [file.stat().st_mtime_ns for file in files] == ages
    # Killed before the legs were made anew: the next run makes them.
    before = pl.concat(pl.read_parquet(file, hive_partitioning=False) for file in files)
    (fleet.results / "learnt.parquet").unlink()
    keep_legs(Results.opened(fleet.results))
    shutil.rmtree(fleet.results / "legs")
    fleet.learn(scheduler)
    files = sorted((fleet.results / "legs").glob("*/*.parquet"))
    after = pl.concat(pl.read_parquet(file, hive_partitioning=False) for file in files)
    assert after.equals(before)


def test_known_masses_are_compared_with_what_was_weighed(learnt_once, tmp_path):
    fleet = learnt_once
    tickets = tmp_path / "tickets.csv"
    known, when = fleet.true["truck4-003"], BEGIN + timedelta(hours=9, minutes=5)
    tickets.write_text(f"vehicle,time,mass_kg\ntruck4,{when.isoformat()},{known:.0f}\n")
    (row,) = wb.fleet.report(fleet.results, tickets=tickets, tolerance=0.03).verdicts.to_dicts()
    worst = max(row[name] or 0.0 for name in ("worst_50", "worst_70", "worst_95"))
    legs, _ = fleet.told()
    assert worst == pytest.approx(legs.filter(pl.col("key") == "truck4-003")["raw"][0], abs=1e-4)


def test_one_ticket_of_another_vehicle_of_the_type_makes_it_better(tmp_path, scheduler):
    fleet = Fleet(tmp_path)
    for k in range(4):
        fleet.add(f"truck{k}", *runs(k, 0.05, empty=0.0))
    legs, alone = fleet.learn(scheduler)
    tickets = tmp_path / "tickets.csv"
    known, when = fleet.true["truck0-003"], BEGIN + timedelta(hours=9, minutes=5)
    tickets.write_text(f"vehicle,time,mass_kg\ntruck0,{when.isoformat()},{known:.0f}\n")
    better, taught = fleet.learn(scheduler, tickets=tickets)
    for name in ("truck0", "truck3"):
        assert taught[name]["factor_std"] < alone[name]["factor_std"]
        own = pl.col("vehicle_id") == name
        assert abs(better.filter(own)["error"].mean()) < abs(legs.filter(own)["error"].mean())
    assert taught["truck0"]["drives"] == 1


def test_a_ticket_for_each_drive_of_a_year_leaves_a_number():
    """By itself each makes other scales unlikely; together by more than a double can hold."""
    true, weighed = runs(1, 0.05, count=400)
    many = Weighed("many", "tipper", weighed, np.full(400, 0.003), true, STATED, TARE, GROSS, 200.0)
    other = many._replace(vehicle="other", known=np.full(400, math.nan))
    for scale in find_scales([many, other]):
        assert scale.factor == pytest.approx(math.exp(-0.05), abs=0.005)
        assert 0.0 < scale.std < 0.02


def test_what_was_learnt_is_written_anew_where_it_is_damaged(taught, scheduler):
    fleet = taught
    _, learnt = fleet.told()
    (fleet.results / "learnt.parquet").write_bytes(b"no table")
    _, again = fleet.learn(scheduler)
    assert again == learnt


def test_little_is_learnt_from_little(tmp_path, scheduler):
    fleet = Fleet(tmp_path)
    fleet.add("one", [TARE], [1.05 * TARE], kind="a")
    fleet.add("no tare", *runs(1, 0.05), kind="b", tare=None)
    fleet.add("no type", *runs(2, 0.05), kind=None)
    fleet.add("lost", [TARE] * 3, [math.nan] * 3, kind="c")
    fleet.add("unstated", *runs(1, 0.05), kind="e", stated=None)
    fleet.add("exact", *runs(1, 0.05), kind="f", stated=0.0)
    for k in range(3):
        fleet.add(f"loaded{k}", *runs(k + 3, 0.0, empty=0.0), kind="d")
    legs, learnt = fleet.learn(scheduler)
    assert learnt["no tare"]["factor"] == pytest.approx(1.0, abs=1e-6)
    assert learnt["no tare"]["factor_std"] == pytest.approx(STATED, rel=0.01)
    assert learnt["no tare"]["factor_reason_id"] == "fleet.scale_no_tare"
    assert learnt["no type"]["type"] == "truck"
    assert abs(legs.filter(pl.col("vehicle_id") == "no type")["error"].mean()) < 0.02
    assert not {"lost", "unstated"} & set(learnt)
    exact = learnt.pop("exact")
    assert (exact["factor"], exact["factor_std"]) == (1.0, 0.0)
    for row in learnt.values():
        assert 0.9 < row["factor"] < 1.1
        assert 0.0 < row["factor_common_std"] <= row["factor_std"] <= STATED * 1.001
    for k in range(3):
        assert learnt[f"loaded{k}"]["factor_reason_id"] == "fleet.scale_never"
        # Their lightest runs are 14 % above the empty mass.
        assert learnt[f"loaded{k}"]["factor"] == pytest.approx(1.0, abs=0.03)
        assert learnt[f"loaded{k}"]["factor_std"] > 0.8 * STATED


def test_a_factor_is_of_the_vehicle_file_that_it_was_learnt_of(taught, scheduler):
    fleet = taught
    legs, _ = fleet.told()
    assert legs["factor"].null_count() == 0
    # Weighed again with a file that calibration changed, before anything is learnt of it.
    fleet.add("truck1", *runs(1, 0.0), kind="calibrated")
    after, learnt = fleet.told()
    own = after.filter(pl.col("vehicle_id") == "truck1")
    assert learnt["truck1"]["factor"] < 0.97
    assert own["mass_kg"].equals(own["weighed_kg"])
    path = fleet.cars / "truck0.toml"
    path.write_text(path.read_text() + "# calibrated\n")
    # Its rows are those of the old file until its drives are weighed again.
    after, learnt = fleet.learn(scheduler)
    own = after.filter(pl.col("vehicle_id") == "truck0")
    assert own["factor"].null_count() == own.height
    assert own["mass_kg"].equals(own["weighed_kg"])
    assert "truck0" not in learnt


def test_what_an_earlier_version_learnt_is_read(taught):
    fleet = taught
    path = Path(fleet.results / "learnt.parquet")
    lacks = [n for n in pl.read_parquet(path).columns if n.startswith(("factor", "vehicle_d"))]
    pl.read_parquet(path).drop(*lacks, "type").write_parquet(path)
    legs, learnt = fleet.told()
    assert len(learnt) == 7
    assert legs["mass_kg"].equals(legs["weighed_kg"])
    assert legs["factor"].null_count() == legs.height
