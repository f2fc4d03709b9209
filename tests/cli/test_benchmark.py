"""The open benchmark: made, weighed and scored by its commands."""

import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest
from tests.noted import named
from website import running

import weighbridge as wb
from weighbridge import Problem, cli
from weighbridge.benchmark.plan import CALIBRATIONS, BenchmarkSettings, plan

TRUCK, BY_SHEET = "truck-imu-50hz-one-1", "truck-imu-50hz-sheet-1"
OPTIONS = (
    "--only", "truck", "--only", "imu-50hz", "--only", "one", "--only", "sheet",
    "--drives", "1", "--minutes", "6",
)  # fmt: skip


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Return a benchmark of two trucks, one with a drive of known mass."""
    folder = tmp_path_factory.mktemp("bench") / "bench"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            sys, "argv", ["weighbridge", "benchmark", "make", "-o", str(folder), *OPTIONS]
        )
        with pytest.raises(SystemExit) as leaving:
            cli.run()
    assert leaving.value.code in (0, None)
    return folder


def test_the_command_of_its_page_scores(weighbridge, bench, monkeypatch):
    (bench / "RESULTS.csv").write_text(
        f"drive,mass_kg\n{TRUCK}/drive-1,9000\n{BY_SHEET}/drive-1,\n"
    )
    page = (bench / "README.md").read_text()
    (command,) = re.findall(r"`weighbridge (benchmark score [^`]*)`", page)
    monkeypatch.chdir(bench)
    ran = weighbridge(*command.split())
    (bench / "RESULTS.csv").unlink()
    assert ran.code == 0
    assert ran.out.splitlines()[1].split()[:2] == ["all", "2"]


@pytest.fixture
def scored(weighbridge, tmp_path):
    """Score masses of the four drives of two vans, all of 1000 kg."""

    def score(text, *options):
        truth = ["drive,mass_kg,class,equipment,calibration,route"]
        truth += [f"{d},1000,van,no-imu,one,{'town' if d in 'ab' else 'hills'}" for d in "abcd"]
        (tmp_path / "truth.csv").write_text("\n".join(truth) + "\n")
        (tmp_path / "mine.csv").write_text(text)
        return weighbridge("benchmark", "score", tmp_path / "mine.csv", *options)

    return score


def slices(ran):
    (one,) = json.loads(ran.out)
    return {(row["by"], row["slice"]): row for row in one["slices"]}


def test_what_is_made_states_no_mass_but_that_of_calibrations(bench):
    truth = pl.read_csv(bench / "truth.csv")
    masses = dict(truth.select("drive", "mass_kg").iter_rows())
    assert pl.read_csv(bench / "drives.csv")["drive"].to_list() == list(masses)
    assert list(masses) == [f"{TRUCK}/drive-1", f"{BY_SHEET}/drive-1"]
    for name in masses:
        drive = wb.read_drive(bench / name)
        assert drive.info.mass is None
        assert drive.info.wind_speed is None
        assert drive.duration == pytest.approx(360.0, abs=2.0)
        assert drive.signals["accel_x"].period == pytest.approx(0.02, rel=0.01)
    car = wb.Vehicle.load(bench / TRUCK / "vehicle.toml")
    # The calibration is driven empty; a scale is as exact as a kilogram.
    known = wb.read_drive(bench / TRUCK / "calibration-1").info.mass
    assert known == pytest.approx(car.tare, abs=1.5)
    assert not (bench / BY_SHEET / "calibration-1").exists()
    assert all(car.tare < kg < 1.86 * car.tare for d, kg in masses.items() if TRUCK in d)
    text = "".join(p.read_text() for p in bench.rglob("*.toml")) + (bench / "README.md").read_text()
    assert not any(f"{kg:.0f}" in text for kg in masses.values())
    assert "CC0" in (bench / "LICENSE").read_text()


def test_an_interrupted_benchmark_goes_on_and_becomes_the_same(weighbridge, bench, tmp_path):
    part = tmp_path / "part"
    truth = pl.read_csv(bench / "truth.csv")
    whole = {f.relative_to(bench): f.read_bytes() for f in bench.rglob("*") if f.is_file()}
    for name, content in whole.items():
        (part / name).parent.mkdir(parents=True, exist_ok=True)
        (part / name).write_bytes(content)
    # Killed after the last vehicle was written, and before its truth.
    truth.head(1).write_csv(part / "truth.csv")
    (part / BY_SHEET / "drive-1" / "imu.parquet").write_bytes(b"")
    stays = (part / TRUCK / "vehicle.toml").stat().st_mtime_ns
    assert weighbridge("benchmark", "make", "-o", part, *OPTIONS).code == 0
    again = {f.relative_to(part): f.read_bytes() for f in part.rglob("*") if f.is_file()}
    assert again == whole
    assert (part / TRUCK / "vehicle.toml").stat().st_mtime_ns == stays
    assert weighbridge("benchmark", "make", "-o", part, *OPTIONS, "--seed", "2").code == 2
    assert weighbridge("benchmark", "make", "-o", part / TRUCK, *OPTIONS).code == 2
    (part / "truth.csv").write_text("drive,mass_kg\nx,heavy\n")
    assert "truth.csv" in weighbridge("benchmark", "make", "-o", part, *OPTIONS).err
    assert weighbridge("benchmark", "make", "-o", tmp_path / "x", "--only", "tram").code == 2


def test_a_vehicle_is_the_same_in_every_benchmark_of_a_seed():
    whole = BenchmarkSettings()
    every = {v.name: v for v in plan(whole)}
    assert len(every) == 5 * 4 * 3
    assert sum(len(v.routes()) + CALIBRATIONS[v.calibration] for v in every.values()) == 320
    few = list(plan(replace(whole, only=("bus", "car", "no-imu"))))
    assert {(v.of_class, v.equipment) for v in few} == {("bus", "no-imu"), ("car", "no-imu")}
    assert all(v.car == every[v.name].car and v.seed == every[v.name].seed for v in few)
    assert all(v.seed != every[v.name].seed for v in plan(replace(whole, seed=2)))


def test_a_drive_that_cannot_be_weighed_is_a_refusal_with_its_reason(weighbridge, bench, tmp_path):
    results = bench / "rls.csv"
    (bench / TRUCK / "drive-1" / "obd.parquet").rename(tmp_path / "obd.parquet")
    assert weighbridge("benchmark", "run", bench, "--method", "rls", "-o", results).code == 0
    (tmp_path / "obd.parquet").rename(bench / TRUCK / "drive-1" / "obd.parquet")
    refused, weighed = pl.read_csv(results).to_dicts()
    assert refused["mass_kg"] is None
    assert refused["reason"]
    true = pl.read_csv(bench / "truth.csv")["mass_kg"][1]
    assert weighed["low_kg"] < true < weighed["high_kg"]
    assert weighed["mass_kg"] == pytest.approx(true, rel=0.15)
    rows = slices(weighbridge("benchmark", "score", results, "--json", "-"))
    assert rows["all", "all"]["refused_pct"] == 50.0
    assert rows["calibration", "sheet"]["held_pct"] == 100.0
    assert weighbridge("benchmark", "run", bench, "--method", "no", "-o", results).code == 2
    assert weighbridge("benchmark", "run", tmp_path, "-o", results).code == 2


def test_methods_weigh_for_themselves_whatever_joint_finds(
    weighbridge, bench, tmp_path, monkeypatch
):
    def contradicted(track, joined):
        return Problem.of("method.contradicted", method="rls", mass=1.0, joint_mass=2.0)

    drives = pl.read_csv(bench / "drives.csv")
    drives.tail(1).write_csv(bench / "drives.csv")
    monkeypatch.setattr("weighbridge.pipeline.hypotheses.contradicted", contradicted)
    rows = {}
    for method in ("rls", "holm-ekf"):
        results = tmp_path / f"{method}.csv"
        assert weighbridge("benchmark", "run", bench, "--method", method, "-o", results).code == 0
        (rows[method],) = pl.read_csv(results).to_dicts()
    drives.write_csv(bench / "drives.csv")
    assert rows["rls"]["mass_kg"] != rows["holm-ekf"]["mass_kg"]
    car = wb.Vehicle.load(bench / BY_SHEET / "vehicle.toml")
    for method, row in rows.items():
        found = wb.weigh(bench / BY_SHEET / "drive-1", car, method)
        assert found.reason_id == "method.contradicted"
        assert row["mass_kg"] == pytest.approx(found.result.mass, abs=0.01)


def test_scores_are_those_by_hand(scored):
    mine = "drive,mass_kg,std_kg\na,1010,10\nb,940,10\nc,,\nd,1000,20\n"
    rows = slices(scored(mine, "--json", "-"))
    every = rows["all", "all"]
    assert every["drives"] == 4
    assert every["refused_pct"] == 25.0
    assert every["rms_pct"] == pytest.approx(100.0 * ((0.01**2 + 0.06**2) / 3.0) ** 0.5)
    assert every["mean_pct"] == pytest.approx(-5.0 / 3.0)
    assert every["held_pct"] == pytest.approx(200.0 / 3.0)
    assert every["squared_error_over_variance"] == pytest.approx((1.0 + 36.0) / 3.0)
    assert every["falsely_sure"] == 1
    # Widths, and 40 kg for each kilogram by which an interval misses: 1000 - 959.6 of b.
    widths = (39.2, 39.2 + 40.0 * 40.4, 78.4)
    assert every["interval_score_pct"] == pytest.approx(100.0 * sum(widths) / 3.0 / 1000.0)
    assert rows["route", "hills"]["refused_pct"] == 50.0
    assert rows["route", "town"]["rms_pct"] > rows["route", "hills"]["rms_pct"] == 0.0
    assert rows["class", "van"] | {"by": "all", "slice": "all"} == every


def test_intervals_of_any_shape_and_masses_alone_are_scored(scored):
    lopsided = "drive,mass_kg,low_kg,high_kg\na,1040,990,1100\nb,1000,990,1010\nc,,,\nd,,,\n"
    every = slices(scored(lopsided, "--json", "-"))["all", "all"]
    assert every["held_pct"] == 100.0
    assert every["interval_score_pct"] == pytest.approx(100.0 * (110.0 + 20.0) / 2.0 / 1000.0)
    alone = slices(scored("drive,mass_kg\na,1010\nb,990\nc,1010\nd,\n", "--json", "-"))
    assert alone["all", "all"]["rms_pct"] == pytest.approx(1.0)
    assert alone["all", "all"]["held_pct"] is None
    assert alone["all", "all"]["falsely_sure"] is None
    ran = scored("drive,mass_kg\na,1010\nb,990\nc,1010\nd,\n")
    assert ran.code == 0
    assert next(row for row in ran.out.splitlines() if row.startswith("town")).split()[1:4] == [
        "2", "0", "1.00",
    ]  # fmt: skip


GOOD = "drive,mass_kg\na,1\nb,1\nc,1\nd,1\n"


@pytest.mark.parametrize(
    ("text", "values"),
    [
        (GOOD.replace("mass_kg", "mass"), "mass_kg"),
        (GOOD.replace("d,1\n", ""), "d"),
        (GOOD.replace("d,1", "e,1"), "e"),
        (GOOD + "a,1\n", "a"),
        (GOOD.replace("b,1", "b,-1"), "'-1'"),
        (GOOD.replace("b,1", "b,heavy"), "'heavy'"),
        (GOOD.replace("b,1", "b,inf"), "'inf'"),
        ("drive,mass_kg,low_kg,high_kg\na,9,10,11\nb,,,\nc,,,\nd,,,\n", "a low_kg high_kg"),
        ("drive,mass_kg,low_kg,high_kg\na,9,8,\nb,,,\nc,,,\nd,,,\n", "a low_kg high_kg"),
        ("", "CSV"),
    ],
)
def test_what_cannot_be_scored_is_one_sentence(scored, text, values):
    ran = scored(text)
    assert ran.code == 2
    assert ran.out == ""
    assert named(ran.err, "mine.csv", values)


def test_the_method_of_the_page_weighs_as_its_page_says(weighbridge, tmp_path, monkeypatch):
    """The block of bash in docs/benchmark.md, and the program that it runs."""
    home = Path(__file__).parents[2]
    blocks = running.blocks(home / "docs" / "benchmark.md")
    (commands,) = [block.code for block in blocks if block.language == "bash"]
    monkeypatch.chdir(tmp_path)
    for line in commands.splitlines():
        if line.startswith("python "):
            place = line.removeprefix("python ")
            exec(compile((home / place).read_text("utf-8"), place, "exec"), {})
        else:
            ran = weighbridge(*line.split()[1:])
            assert ran.code == 0
    compared = {row.split()[0]: row.split()[1:] for row in ran.out.splitlines()[1:]}
    assert compared["joint"][:2] == compared["mine"][:2] == ["2", "0"]
    assert float(compared["joint"][2]) < float(compared["mine"][2]) < 25.0
