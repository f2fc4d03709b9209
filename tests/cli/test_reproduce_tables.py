"""What `weighbridge reproduce` prints."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from weighbridge.cli import reproduce
from weighbridge.papers import jensen2022, reproduced
from weighbridge.papers.claims import Item
from weighbridge.report.table import Table

LONG = "as in the paper, half-load, seed 777"
HEADS = ("drive", "true kg", "robust-rls %", "ekf %", "hybrid %", "RMSE robust-rls", "RMSE ekf",
         "RMSE hybrid", "best")  # fmt: skip
ROW = (LONG, "10000", "-0.57", "-0.17", "-0.16", "96", "37", "37", "robust-rls")


def made(good, like=True):
    """Return a reproduction with a table that is wider than any pipe."""
    return reproduced.Reproduced(
        title="a paper",
        tables=(Table("Drives", HEADS, (ROW,)),),
        comparisons=(reproduced.Comparison("RMSE of all", "1 kg", "2 kg", good, like),),
        write_page=lambda tables, path: None,
    )


def test_wide_tables_are_not_cut_off(capsys):
    reproduce.show(made(good=True))
    told = capsys.readouterr().out
    assert "…" not in told
    assert all(cell in told for cell in ROW[1:])


def test_what_is_behind_is_named_at_the_end(weighbridge, monkeypatch):
    for good, code in ((True, 0), (False, 1)):
        monkeypatch.setattr("weighbridge.papers.paper", lambda name, g=good: lambda *_: made(g))
        ran = weighbridge("reproduce", "galvao")
        assert ran.code == code
        assert ("behind, galvao: RMSE of all" in ran.out) is not good


def test_other_conditions_are_told_beside_the_figures():
    rows = [
        made(good, like).comparison.rows[0][-1] for like in (True, False) for good in (True, False)
    ]
    assert rows == ["", "behind", "other conditions", "behind, other conditions"]
    assert made(good=False, like=False).behind == ("RMSE of all (other conditions)",)


def test_a_sentence_of_the_paper_is_found_or_not():
    for so, verdict, behind in (
        (True, "", ()),
        (False, "not found", ("brakings (not found)",)),
    ):
        row = reproduced.Comparison("brakings", "fluctuate", "do not", so, claim=True)
        assert row.verdict == verdict
        assert replace(made(good=True), comparisons=(row,)).behind == behind


def test_a_page_begins_with_the_papers_figures(tmp_path):
    asked = []
    done = replace(made(good=False), write_page=lambda tables, path: asked.append((tables, path)))
    done.write_report(tmp_path / "page.html")
    ((first, second), path) = asked[0]
    assert first.columns == ("figure", "paper", "ours", "")
    assert first.rows == (("RMSE of all", "1 kg", "2 kg", "behind"),)
    assert second.title == "Drives"
    assert path == tmp_path / "page.html"


def test_jensens_page_begins_so_too(tmp_path, monkeypatch):
    given = {}
    nothing = SimpleNamespace(
        drives=(), calibration=None, seed=5, last_seed=6, settings=jensen2022.Settings()
    )
    monkeypatch.setattr(jensen2022, "reproduce", lambda **_: nothing)
    monkeypatch.setattr(jensen2022, "drives_table", lambda _: made(True).tables[0])
    monkeypatch.setattr(
        jensen2022, "parameters_table", lambda _: Table("Table 6", ("parameter",), ())
    )
    monkeypatch.setattr(jensen2022, "comparisons", lambda _: made(True).comparisons)
    monkeypatch.setattr(jensen2022, "figures", lambda _: {})
    monkeypatch.setattr("weighbridge.papers.jensen2022_figures.panels", lambda _: ())
    monkeypatch.setattr("weighbridge.report.write_report", lambda *_, **k: given.update(k))
    done = jensen2022.reproduced(5, None)
    done.write_report(tmp_path / "page.html")
    assert [t.columns[0] for t in given["tables"]] == ["figure", "drive", "parameter"]
    assert "seeds 5 to 6, not held out" in done.title


def test_a_report_as_markdown_has_the_items_of_every_paper_that_has_some(
    weighbridge, tmp_path, monkeypatch
):
    item = Item("eq. 1", "`law.py`", True, "", "1 kg", "{mass}", True)
    done = replace(made(good=True), title="A paper, seeds 5 to 6", figures={"mass": "2 kg"})
    monkeypatch.setattr("weighbridge.papers.paper", lambda _: lambda *_: done)
    monkeypatch.setattr(
        "weighbridge.papers.items_of", lambda name: (item,) if name == "galvao" else ()
    )
    page = tmp_path / "papers.md"
    assert weighbridge("reproduce", "all", "--report", page).code == 0
    text = page.read_text(encoding="utf-8")
    assert text.count("## A paper\n") == 1
    assert "seeds 5 to 6" in text
    assert "| eq. 1 | `law.py` | yes |  | 1 kg | 2 kg |" in text
    again = weighbridge("reproduce", "all", "--report", page)
    assert again.code == 0
    notes = tmp_path / "notes.md"
    notes.write_text("# Notes\n", encoding="utf-8")
    kept = weighbridge("reproduce", "all", "--report", notes)
    assert kept.code == 2
    assert "is there already and is no list of items" in kept.err
    html = tmp_path / "papers.html"
    assert weighbridge("reproduce", "all", "--report", html).code == 0
    assert "eq. 1" in html.read_text(encoding="utf-8")


def test_settings_reach_the_reproduction_by_name(weighbridge, monkeypatch):
    asked = []

    def paper(name):
        return lambda *given: asked.append((name, *given)) or made(good=True)

    monkeypatch.setattr("weighbridge.papers.paper", paper)
    words = ("--set", "printed.forgetting=0.998", "--set", "conditions.wind=0")
    ran = weighbridge("reproduce", "jensen2022", *words)
    assert ran.code == 0
    assert "printed.forgetting = 0.998, conditions.wind = 0" in " ".join(ran.out.split())
    ((name, seed, _, settings),) = asked
    assert (name, seed) == ("jensen2022", jensen2022.SEED)
    assert settings.printed.forgetting == 0.998
    assert settings.conditions.wind == 0.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("all", "--set", "rls.forgetting=0.99"), "all has no settings to change"),
        (("nguyen2024", "--set", "noise=1"), "there is no setting 'noise'"),
        (("jensen2022", "--set", "windows=1"), "there is no setting 'windows'"),
        (("jensen2022", "--set", "rls.forgetting=2"), "forgetting must be in"),
    ],
)
def test_settings_that_are_not_there_are_refused(weighbridge, words, said):
    ran = weighbridge("reproduce", *words)
    assert ran.code == 2
    assert said in ran.err
