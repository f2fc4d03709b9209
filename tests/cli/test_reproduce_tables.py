"""What `weighbridge reproduce` prints."""

from dataclasses import replace
from types import SimpleNamespace

from weighbridge.cli import reproduce
from weighbridge.papers import jensen2022, reproduced
from weighbridge.report.table import Table

LONG = "as in the paper, half-load, seed 777"
HEADS = ("drive", "true kg", "robust-rls %", "ekf %", "hybrid %", "RMSE robust-rls", "RMSE ekf",
         "RMSE hybrid", "best")  # fmt: skip
ROW = (LONG, "10000", "-0.57", "-0.17", "-0.16", "96", "37", "37", "robust-rls")


def made(good):
    """Return a reproduction with a table that is wider than any pipe."""
    return reproduced.Reproduced(
        title="a paper",
        tables=(Table("Drives", HEADS, (ROW,)),),
        comparisons=(reproduced.Comparison("RMSE of all", "1 kg", "2 kg", good),),
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
    nothing = SimpleNamespace(drives=(), calibration=None)
    monkeypatch.setattr(jensen2022, "reproduce", lambda **_: nothing)
    monkeypatch.setattr(jensen2022, "_drives_table", lambda _: made(True).tables[0])
    monkeypatch.setattr(jensen2022, "_comparisons", lambda _: made(True).comparisons)
    monkeypatch.setattr("weighbridge.report.write_report", lambda *_, **k: given.update(k))
    jensen2022.reproduced(1, None).write_report(tmp_path / "page.html")
    assert [t.columns[0] for t in given["tables"]] == ["figure", "drive"]
