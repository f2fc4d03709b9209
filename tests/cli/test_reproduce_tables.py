"""What `weighbridge reproduce` prints."""

import json
from dataclasses import replace
from types import SimpleNamespace

import pytest
from tests.noted import named

from weighbridge.papers import Found, Item, Reproduced, seed_of

LONG = "as in the paper, half-load, seed 777"
HEADS = ("drive", "true kg", "robust-rls %", "ekf %", "hybrid %", "RMSE robust-rls", "RMSE ekf",
         "RMSE hybrid", "best")  # fmt: skip
ROW = (LONG, "10000", "-0.57", "-0.17", "-0.16", "96", "37", "37", "robust-rls")


def row(*, agrees, check=""):
    item = Item(
        item="table 2", what="RMSE of all", where="`law.py`", printed="1 kg", ours="{mass}",
        tolerance="not above print", why="another simulator", check=check,
    )  # fmt: skip
    return item.row("galvao", {"mass": Found("2 kg", agrees)})


def made(*rows):
    """Return a reproduction with a table that is wider than any pipe."""
    return Reproduced(
        title="A paper",
        note="seeds 5 to 6",
        tables=(SimpleNamespace(title="Drives", columns=HEADS, rows=(ROW,), marked=()),),
        rows=rows or (row(agrees=True),),
        write_page=lambda tables, path: None,
    )


def test_wide_tables_are_not_cut_off(weighbridge, monkeypatch):
    monkeypatch.setattr("weighbridge.papers.paper", lambda _: lambda *_: made())
    told = weighbridge("reproduce", "galvao").out
    assert "…" not in told
    assert all(cell in told for cell in ROW[1:])


@pytest.mark.parametrize(
    ("one", "code"),
    [
        (row(agrees=True), 0),
        (row(agrees=False), 1),
        (row(agrees=False, check="weighbridge reproduce galvao"), 0),
    ],
)
def test_the_exit_status_is_that_of_the_verdicts(weighbridge, monkeypatch, one, code):
    monkeypatch.setattr("weighbridge.papers.paper", lambda _: lambda *_: made(one))
    ran = weighbridge("reproduce", "galvao")
    assert ran.code == code
    assert ("galvao: table 2, RMSE of all, as printed" in ran.out) is bool(code)


def test_json_has_every_row(weighbridge, tmp_path, monkeypatch):
    rows = (row(agrees=True), row(agrees=False, check="weighbridge reproduce galvao"))
    monkeypatch.setattr("weighbridge.papers.paper", lambda _: lambda *_: made(*rows))
    file = tmp_path / "rows.json"
    assert weighbridge("reproduce", "galvao", "--json", file).code == 0
    found = json.loads(file.read_text(encoding="utf-8"))["rows"]
    assert [r["verdict"] for r in found] == ["agrees", "differs"]
    assert set(found[0]) == {
        "paper", "item", "what", "conditions", "printed", "ours", "tolerance", "verdict", "why",
        "check", "seen", "where",
    }  # fmt: skip
    shown = weighbridge("reproduce", "galvao", "--json", "-")
    assert json.loads(shown.out)["rows"] == found


def test_a_page_begins_with_the_papers_figures(tmp_path):
    asked = []
    done = replace(made(), write_page=lambda tables, path: asked.append((tables, path)))
    done.write_report(tmp_path / "page.html")
    ((first, second), path) = asked[0]
    assert len(first.columns) == len(first.rows[0])
    assert first.rows[0][:2] == ("table 2", "RMSE of all")
    assert second.title == "Drives"
    assert path == tmp_path / "page.html"


def test_a_report_as_markdown_has_the_rows_of_every_paper(weighbridge, tmp_path, monkeypatch):
    monkeypatch.setattr("weighbridge.papers.paper", lambda _: lambda *_: made())
    page = tmp_path / "papers.md"
    assert weighbridge("reproduce", "all", "--report", page).code == 0
    text = page.read_text(encoding="utf-8")
    assert text.count("## A paper\n") == 4
    assert "Seeds 5 to 6" in text
    assert "|table 2, RMSE of all|1 kg|2 kg|" in text
    again = weighbridge("reproduce", "all", "--report", page)
    assert again.code == 0
    notes = tmp_path / "notes.md"
    notes.write_text("# Notes\n", encoding="utf-8")
    kept = weighbridge("reproduce", "all", "--report", notes)
    assert kept.code == 2
    assert named(kept.err, notes, "--report")
    html = tmp_path / "papers.html"
    assert weighbridge("reproduce", "all", "--report", html).code == 0
    assert "RMSE of all" in html.read_text(encoding="utf-8")


def test_settings_reach_the_reproduction_by_name(weighbridge, monkeypatch):
    asked = []

    def paper(name):
        return lambda *given: asked.append((name, *given)) or made()

    monkeypatch.setattr("weighbridge.papers.paper", paper)
    words = ("--set", "printed.forgetting=0.998", "--set", "conditions.wind=0")
    ran = weighbridge("reproduce", "jensen2022", *words)
    assert ran.code == 0
    assert "printed.forgetting = 0.998, conditions.wind = 0" in " ".join(ran.out.split())
    ((name, seed, _, settings),) = asked
    assert (name, seed) == ("jensen2022", seed_of("jensen2022"))
    assert settings.printed.forgetting == 0.998
    assert settings.conditions.wind == 0.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("all", "--set", "rls.forgetting=0.99"), "--set rls.forgetting=0.99 all"),
        (("nguyen2024", "--set", "noise=1"), "noise body_noise"),
        (("jensen2022", "--set", "windows=1"), "windows winds"),
        (("jensen2022", "--set", "rls.forgetting=2"), "0.9 1 2.0"),
    ],
)
def test_settings_that_are_not_there_are_refused(weighbridge, words, said):
    ran = weighbridge("reproduce", *words)
    assert ran.code == 2
    assert named(ran.err, said)
