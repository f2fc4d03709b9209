"""What `weighbridge reproduce` prints."""

from weighbridge.cli import reproduce
from weighbridge.papers import reproduced
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
        write_report=lambda path: None,
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
