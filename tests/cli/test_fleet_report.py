"""The page of a fleet: its answer, its data, and texts that would be more than text."""

import json
import re
from datetime import UTC, datetime
from pathlib import Path

import polars as pl
import pytest
from tests.fleet.made_rows import drive, segment, write_learnt
from tests.noted import named

from weighbridge.fleet.schema import PART
from weighbridge.fleet.store import Results, write_part

HOSTILE = '</script><img src=x onerror="alert(1)">\u202e'


@pytest.fixture
def results(tmp_path):
    """Results of three vehicles, one with a name that would be more than a name."""
    rows = [
        drive("a" * 32, mass=20000.0, std=500.0),
        drive("b" * 32, HOSTILE, mass=18200.0, std=500.0, warnings=[HOSTILE]),
        drive("c" * 32, "truck3", start="2026-05-04T09:00:00+00:00", mass=9000.0, std=400.0),
        drive("d" * 32, "truck3", start=None),
    ]
    folder = Results.begun(tmp_path / "results").folder
    inner = [f.name for f in PART["segments"].inner.fields]
    for row in rows:
        told = segment(
            row["key"], 0, 0.0, 1200.0, row["mass_kg"], row["std_kg"], period_km=[5.0] * 4
        )
        write_part(folder, row["key"], [row | {"segments": [{n: told[n] for n in inner}]}])
    return folder


def data_of(page):
    text = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    return json.loads(text.group(1))


def test_the_page_answers_who_when_and_how_sure(weighbridge, results, tmp_path):
    ran = weighbridge("fleet", "report", results, "-o", tmp_path / "fleet.html",
                      "--json", tmp_path / "fleet.json")  # fmt: skip
    assert ran.code == 0
    assert "1 leg at least 95 % sure, 1 likely" in ran.out
    assert "truck1 2026-05-04 06:00 UTC: 20000 ± 980 kg of 18000 kg, above 99.9 %" in ran.out
    page = (tmp_path / "fleet.html").read_text()
    first = page[: page.index("<nav")]
    assert "1 vehicle overloaded" in first
    assert '<span class="day">2026-05-04</span> 06:00' in first
    assert "20\u202f000 ±&nbsp;980" in first
    assert "1 sure, 0 likely" in first
    assert "0 sure, 1 likely" in first
    assert "of 3 legs that could be judged. 1 could not" in first
    data = data_of(page)
    assert data["legs"]["overload"][data["legs"]["mass_kg"].index(18200)] == pytest.approx(0.6554)
    told = json.loads((tmp_path / "fleet.json").read_text())
    assert [r["vehicle_id"] for r in told["overloads"]] == ["truck1", HOSTILE]
    assert told["totals"]["distance_km"] == 80.0
    (cause,) = told["unjudged"]
    assert (cause["prevents"], cause["count"], cause["vehicles"]) == ("mass", 1, ["truck3"])
    assert "mass, 1 leg of truck3" in ran.out
    assert "<td>mass</td>" in page[page.index('<section id="unjudged">') :]


def lesson(vehicle, **more):
    row = {"vehicle_id": vehicle, "drives": 5, "weighed": 5}
    return row | {"error_pct": 1.0, "error_std_pct": 5.0, "refined": f"{vehicle}.toml", **more}


def test_what_was_learnt_is_told_those_to_look_at_first(weighbridge, results, tmp_path):
    rows = [
        lesson("truck3", torque_drift_pct=2.0, torque_drift_std_pct=0.7, findings=""),
        lesson("gone", rolling_drift=float("nan"), rolling_drift_std=float("nan"), findings=""),
        lesson(
            "truck1", pitch_drift_deg=-0.4, pitch_drift_std_deg=0.1, findings="the pitch drifts"
        ),
        lesson(HOSTILE, contradicted=True, error_pct=12.0, findings="5 drives contradict the file"),
    ]
    write_learnt(results, rows)
    ran = weighbridge("fleet", "report", results, "-o", tmp_path / "fleet.html",
                      "--json", tmp_path / "fleet.json")  # fmt: skip
    assert ran.code == 0
    lines = ran.out.splitlines()
    at = lines.index(
        "learnt from the tickets of 4 vehicles: 1 contradicted by its drives, 1 drifts"
    )
    assert lines[at + 1].endswith('onerror="alert(1)">\\u202e: 5 drives contradict the file')
    assert lines[at + 2] == "  truck1: the pitch drifts"
    told = json.loads((tmp_path / "fleet.json").read_text())["learnt"]
    assert [(row["vehicle_id"], row["verdict"]) for row in told] == [
        (HOSTILE, "contradicted"),
        ("truck1", "drifts"),
        ("gone", "refined"),
        ("truck3", "refined"),
    ]
    shown = data_of((tmp_path / "fleet.html").read_text())["learnt"]
    assert shown["verdict"] == ["contradicted", "drifts", "refined"]
    assert shown["torque_drift_pct"] == [None, None, 2.0]


def test_corrections_are_told_and_who_seems_never_empty(weighbridge, results, tmp_path):
    common = {"drives": 0, "weighed": 0, "type": "truck", "factor_std": 0.015, "factor_legs": 9}
    rows = [
        common | {"vehicle_id": "truck1", "factor": 0.951, "factor_reason_id": "fleet.scale_empty",
                  "factor_reason": "by its empty runs"},
        common | {"vehicle_id": "truck3", "factor": 1.012, "factor_reason_id": "fleet.scale_wrong",
                  "factor_reason": "its lightest runs contradict its empty mass"},
    ]  # fmt: skip
    write_learnt(results, rows)
    ran = weighbridge("fleet", "report", results, "--json", tmp_path / "fleet.json")
    assert ran.code == 0
    assert "masses of 2 vehicles are corrected" in ran.out
    assert "by -4.9 to +1.2 %" in ran.out
    assert "truck3: its lightest runs contradict its empty mass" in ran.out
    assert "truck1: by its empty runs" not in ran.out
    assert "tickets of" not in ran.out
    told = json.loads((tmp_path / "fleet.json").read_text())["learnt"]
    assert [row["verdict"] for row in told] == ["never empty", "scaled"]


def test_a_damaged_file_of_what_was_learnt_is_named(weighbridge, results):
    (results / "learnt.parquet").write_bytes(b"PAR1")
    ran = weighbridge("fleet", "report", results)
    assert ran.code == 2
    assert named(ran.err, results / "learnt.parquet")


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_legs_are_written_as_a_table_with_the_interval_of_the_payload(
    weighbridge, results, tmp_path, suffix
):
    path = tmp_path / f"legs.{suffix}"
    for _ in range(2):
        assert weighbridge("fleet", "report", results, "--legs", path).code == 0
    read = {"csv": pl.read_csv, "parquet": pl.read_parquet}[suffix]
    rows = {row["key"][0]: row for row in read(path).to_dicts()}
    assert sorted(rows) == ["a", "b", "c", "d"]
    # The empty mass is 8000 kg; freedom is infinite, so that the interval is 1.96 times 500 kg.
    row = rows["a"]
    assert [row["payload_kg"], row["payload_low95_kg"], row["payload_high95_kg"]] == pytest.approx(
        [12000.0, 11020.0, 12980.0], abs=0.1
    )
    begun = "2026-05-04T06:00:00Z" if suffix == "csv" else datetime(2026, 5, 4, 6, tzinfo=UTC)
    assert (row["start"], rows["d"]["start"], rows["d"]["payload_kg"]) == (begun, None, None)


def test_legs_take_the_place_of_no_other_table(weighbridge, results, tmp_path):
    other = tmp_path / "mine.csv"
    other.write_text("leg,colour\n1,red\n")
    ran = weighbridge("fleet", "report", results, "--legs", other)
    assert ran.code == 2
    assert named(ran.err, other, "--legs")
    ran = weighbridge("fleet", "report", results, "--legs", tmp_path / "legs.xlsx")
    assert ran.code == 2
    assert named(ran.err, "legs.xlsx .csv .parquet")
    ran = weighbridge("fleet", "report", results, "--legs", results / "legs.csv")
    assert ran.code == 2
    assert named(ran.err, results / "legs.csv")
    assert other.read_text() == "leg,colour\n1,red\n"


def test_the_answer_tells_how_many_it_leaves_out(weighbridge, tmp_path):
    folder = Results.begun(tmp_path / "results").folder
    for k in range(13):
        row = drive(f"{k:032d}", f"truck{k:02d}", mass=21000.0, std=500.0)
        write_part(folder, row["key"], [row | {"segments": []}])
    told = weighbridge("fleet", "report", folder).out
    assert (told.count("\n  truck"), "and 3 more" in told) == (10, True)


def test_known_masses_outside_the_interval_are_told_everywhere(weighbridge, results, tmp_path):
    tickets = tmp_path / "tickets.csv"
    tickets.write_text(
        "vehicle,time,mass_kg\ntruck1,2026-05-04T06:05:00Z,18500\n"
        "truck3,2026-05-04T09:05:00Z,9300\n"
    )
    words = ("-o", tmp_path / "fleet.html", "--json", tmp_path / "fleet.json")
    ran = weighbridge("fleet", "report", results, "--tickets", tickets, *words)
    assert ran.code == 0
    assert "outside the 95 % interval: 1 of 2 known masses; by chance one in twenty is" in ran.out
    line = next(x for x in ran.out.splitlines() if x.startswith("  truck1: 1 of 1"))
    assert all(x in line for x in ("2026-05-04 06:00 UTC", "18500", "19020 to 20980", "+8.1 %"))
    told = json.loads((tmp_path / "fleet.json").read_text())
    assert [(r["vehicle_id"], r["outside"]) for r in told["outside"]] == [
        ("truck1", 1),
        ("truck3", 0),
    ]
    assert (told["totals"]["known_legs"], told["totals"]["outside"]) == (2, 1)
    page = (tmp_path / "fleet.html").read_text()
    assert "1 of 2 known masses" in page[: page.index("<nav")]
    section = page[page.index('<section id="outside">') :]
    assert "19\u202f020 to 20\u202f980" in section
    assert "outside the 95 %" not in weighbridge("fleet", "report", results).out


def test_texts_are_shown_and_never_obeyed(weighbridge, results, tmp_path):
    weighbridge("fleet", "report", results, "-o", tmp_path / "fleet.html")
    page = (tmp_path / "fleet.html").read_text()
    assert "<img" not in page
    assert "\u202e" not in page
    assert page.count("</script>") == 2
    assert "\\u202e" in data_of(page)["names"][data_of(page)["vehicles"]["warnings"].index(1)]
    assert not re.search(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", page)
    assert "default-src 'none'" in page


def test_results_and_inputs_are_not_overwritten(weighbridge, results, tmp_path):
    ran = weighbridge("fleet", "report", results, "-o", results / "fleet.html")
    assert ran.code == 2
    assert named(ran.err, results / "fleet.html")
    other = tmp_path / "tickets.csv"
    other.write_text("vehicle,time,mass_kg\n")
    ran = weighbridge("fleet", "report", results, "-o", other, "--tickets", other)
    assert (ran.code, other.read_text()) == (2, "vehicle,time,mass_kg\n")
    ran = weighbridge("fleet", "report", tmp_path)
    assert ran.code == 2
    assert named(ran.err, tmp_path)


def test_the_python_of_the_document_runs(results, tmp_path, monkeypatch):
    (tmp_path / "tickets.csv").write_text("vehicle,time,mass_kg\n")
    document = Path(__file__).parents[2] / "docs" / "fleet_figures.md"
    (code,) = re.findall(r"```python\n(.*?)```", document.read_text("utf-8"), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(code, names)
    assert names["found"].overloads.height == 2
    assert (tmp_path / "fleet.html").read_bytes().startswith(b"<!DOCTYPE html>")
