"""Items of the papers, the rows that a run makes of them, and the page of the rows."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.noted import error

from weighbridge import ConfigError
from weighbridge.estimators import changed, differences, parsed
from weighbridge.papers import (
    PAPERS,
    Found,
    Item,
    Section,
    Verdict,
    document,
    du2025,
    galvao,
    items_of,
    jensen2022,
    jensen2022_found,
    jensen2022_reproduction,
    nguyen2024,
    settings_of,
)
from weighbridge.papers.claims import EXACT, Conditions, same
from weighbridge.papers.jensen2022_drives import without_weather
from weighbridge.simulation import make_scenario, simulate_car

PAGE = Path(__file__).parents[2] / "docs" / "papers.md"

EQUATIONS = {
    "du2025": du2025.equations,
    "galvao": galvao.equations,
    "jensen2022": jensen2022_found.equations,
    "nguyen2024": nguyen2024.equations,
}

NUMBERED = {
    "du2025": {"eq.": range(1, 35), "fig.": range(1, 8), "table": range(1, 3)},
    "galvao": {"eq.": range(1, 27), "fig.": range(1, 16), "table": range(1, 3)},
    "jensen2022": {
        "eq.": range(1, 52),
        "fig.": [*range(1, 20), "A.1", *(f"C.{n}" for n in range(1, 8))],
        "table": [*range(1, 7), "B.1"],
    },
    "nguyen2024": {"eq.": range(1, 11), "fig.": range(1, 7), "table": range(1, 3)},
}
"""What the papers number."""

RULE = Item(item="table 4", where="`gear.py`", printed="2 %", ours="{ratio} | {more}",
            tolerance="none")  # fmt: skip
EXCUSED = Item(item="fig. 11", what="worst", conditions=Conditions.OURS, where="`joint`",
               printed="±5 %", ours="{ratio}", tolerance="none", why="wind",
               check="weighbridge reproduce jensen2022")  # fmt: skip
DRAWN = Item(item="fig. 1", where="docs", why="a drawing")


def figures(*, agrees):
    return {"ratio": Found("3 %", agrees), "more": Found("1 %", True)}


def test_a_row_agrees_if_all_its_figures_do():
    good, bad = (RULE.row("a", figures(agrees=a)) for a in (True, False))
    assert (good.verdict, bad.verdict) == (Verdict.AGREES, Verdict.DIFFERS)
    assert good.ours == "3 % | 1 %"
    assert good.accounted
    assert not bad.accounted
    record = bad.record()
    assert record["verdict"] == "differs"
    assert record["paper"] == "a"


def test_a_difference_needs_a_reason_and_a_command():
    assert EXCUSED.row("a", figures(agrees=False)).accounted
    nothing = DRAWN.row("a", {})
    assert nothing.verdict is Verdict.NOT_REPRODUCIBLE
    assert nothing.accounted
    with error(ConfigError, "fig. 1"):
        Item(item="fig. 1", where="docs")
    with error(ConfigError, "fig. 1"):
        Item(item="fig. 1", where="docs", ours="{ratio}")


def test_a_run_that_shows_the_reason_of_a_difference_names_the_command():
    shown = Found(
        "3 %", False, why="1 % with f = 0.01", check="weighbridge reproduce b --set f=0.01"
    )
    row = RULE.row("b", {"ratio": shown, "more": Found("1 %", True)})
    assert (row.why, row.check, row.accounted) == (shown.why, shown.check, True)
    agreeing = RULE.row("b", {"ratio": replace(shown, agrees=True), "more": Found("1 %", True)})
    assert (agreeing.why, agreeing.check) == ("", "")


def test_an_equation_agrees_to_rounding_alone():
    assert same([1.0, 2.0], [1.0, 2.0 + 1e-10]).agrees
    apart = same([1.0, 2.0], [1.0, 2.0 + 1e-7], "N")
    assert not apart.agrees
    assert apart.printed == "2 N"
    assert not same(1.0, np.nan).agrees
    assert not same([1.0], [1.0, 1.0]).agrees


def test_bars_stay_in_their_cell_of_the_page():
    rows = tuple(i.row("a", figures(agrees=True)) for i in (RULE, EXCUSED, DRAWN))
    page = document([Section(title="A paper", note="seeds 5 to 6", rows=rows)])
    (line,) = (line for line in page.splitlines() if line.startswith("|table 4"))
    assert line.count("|") - line.count("\\|") == len(("row", "printed", "ours")) + 1
    assert "3 % \\| 1 %" in line
    assert "Seeds 5 to 6: agrees 2, differs 0, not reproducible 1." in page


@pytest.mark.parametrize("paper", PAPERS)
def test_every_numbered_equation_table_and_figure_has_a_row(paper):
    numbered = {i.item for i in items_of(paper) if i.item.split()[0] in ("eq.", "fig.", "table")}
    assert numbered == {f"{kind} {n}" for kind, some in NUMBERED[paper].items() for n in some}


@pytest.mark.parametrize("paper", PAPERS)
def test_a_check_is_a_command_that_changes_something(paper):
    for check in {i.check for i in items_of(paper) if i.check}:
        program, command, name, *options = check.split()
        assert (program, command, name) == ("weighbridge", "reproduce", paper)
        assert options[::2] == ["--set"] * (len(options) // 2)
        rows = [i for i in items_of(paper) if i.check == check]
        assert options or all(i.seen for i in rows if i.ours), check
        if options:
            assert differences(changed(settings_of(paper)(), parsed(options[1::2]))), check


@pytest.fixture(scope="module")
def equations():
    return {paper: made() for paper, made in EQUATIONS.items()}


@pytest.mark.parametrize("paper", PAPERS)
def test_the_code_computes_what_is_printed(paper, equations):
    departing = {i.names[0] for i in items_of(paper) if i.ours and i.conditions == "ours"}
    for name, found in equations[paper].items():
        assert found.agrees is (name not in departing), (paper, name, found)


PAPER_TITLES = {
    "du2025": "Du et al. 2025",
    "galvao": "Galvão et al.",
    "jensen2022": "Jensen et al. 2022",
    "nguyen2024": "Nguyen 2024",
}


@pytest.mark.parametrize("paper", PAPERS)
def test_the_page_has_the_rows_of_today(paper, equations):
    """`python studies/papers.py --check` compares every figure; here those that are quick."""
    page = part_of_the_page(paper)
    exact = exact_of(page)
    blank = {i: Found("", agrees=True) for item in items_of(paper) for i in item.names}
    for item in items_of(paper):
        row = item.row(paper, blank | equations[paper])
        if not item.ours:
            assert item.why in page, row.label
        elif not set(item.names) & set(equations[paper]):
            assert line_of(page, row.label) or row.label in exact
        elif row.verdict == "agrees" and item.tolerance == EXACT:
            assert row.label in exact
        else:
            assert line_of(page, row.label, *row.figures), row.label
            assert all(reason in page for reason in row.reasons if row.verdict == "differs")


def exact_of(page):
    """Labels of the items that agree to rounding, ranges written out."""
    found = []
    for label in re.findall(r"^- (.*)$", page, re.MULTILINE):
        kind, first, last = re.fullmatch(r"(.*?)(?: (\d+)–(\d+))?", label).groups()
        found += [f"{kind} {k}" for k in range(int(first), int(last) + 1)] if first else [label]
    return found


def part_of_the_page(paper):
    whole = PAGE.read_text(encoding="utf-8").split(f"\n## {PAPER_TITLES[paper]}\n")[1]
    return whole.split("\n## ")[0]


def line_of(page, label, *figures):
    """Find the line of a row, which has ″ for what it shares with the one above."""
    parts = label.split(", ")
    labels = (label, *(f"″, {', '.join(parts[k:])}" for k in range(1, len(parts))))
    cells = "".join(rf"(?:{re.escape(cell)}|″)\|" for cell in figures)
    named = "|".join(map(re.escape, labels))
    return re.search(rf"^\|(?:{named})\|{cells}", page, re.MULTILINE)


def test_a_row_repeats_nothing_of_the_one_above():
    rule = replace(RULE, what="RMSE, empty")
    rows = tuple(
        i.row("a", figures(agrees=True))
        for i in (rule, replace(rule, what="RMSE, full"), replace(rule, item="fig. 2"))
    )
    lines = Section(title="A paper", note="seed 5", rows=rows).markdown().splitlines()
    assert "|table 4, RMSE, empty|2 %|3 % \\| 1 %|" in lines
    assert "|″, full|″|″|" in lines
    assert "|fig. 2, RMSE, empty|″|″|" in lines


def test_a_page_says_a_reason_once():
    rule = replace(RULE, why="one reason; another", check="weighbridge reproduce galvao")
    rows = tuple(i.row("a", figures(agrees=False)) for i in (rule, replace(rule, item="table 5")))
    page = document([Section(title="A paper", note="seeds 5 to 6", rows=rows)])
    assert page.count("one reason") == page.count("`weighbridge reproduce galvao`") == 1
    assert page.count("|1,2,3|") == 1


def fresh_du2025():
    seeds = range(du2025.SEED, du2025.SEED + du2025.DRIVES)
    buses = [du2025.simulate(3000.0, seed, as_paper=True) for seed in seeds]
    drives = [du2025.judge("half-load", bus, du2025.known_bus()) for bus in buses]
    return du2025.our_rmse(drives, "ours")


def fresh_galvao():
    return galvao.of_tests(galvao.weigh_three(galvao.SEED)[2])


def fresh_jensen2022():
    made = simulate_car(make_scenario("car-calibration", seed=jensen2022.SEED))
    mass = float(np.mean(made.truth.mass))
    printed = jensen2022.Settings().printed
    car = jensen2022_reproduction.train(without_weather(made.drive), mass, printed)
    return jensen2022_found.of_fit("printed", car.vehicle, car.r_squared)


def fresh_nguyen2024():
    case = nguyen2024.cases.EXTENDED
    roads = nguyen2024.reproduce(cases=(case,))[0][case.name]
    return {f"{name} extended": f for name, f in nguyen2024.followed(roads).items()}


FRESH = {
    "du2025": fresh_du2025,
    "galvao": fresh_galvao,
    "jensen2022": fresh_jensen2022,
    "nguyen2024": fresh_nguyen2024,
}


@pytest.mark.parametrize("paper", PAPERS)
def test_rows_of_the_page_are_those_of_a_fresh_run(paper):
    """Rows that take seconds; `python studies/papers.py --check` compares all."""
    page, found = part_of_the_page(paper), FRESH[paper]()
    rows = [i.row(paper, found) for i in items_of(paper) if i.ours and set(i.names) <= set(found)]
    assert len(rows) >= 3
    assert [r.name for r in rows if not line_of(page, r.label, *r.figures)] == []


def commands():
    """Commands beside the rows of the page that differ, each once."""
    text = PAGE.read_text(encoding="utf-8")
    return list(dict.fromkeys(re.findall(r"^\d+\. `(weighbridge [^`]+)`", text, re.MULTILINE)))


def test_every_command_of_the_page_is_accepted():
    assert len(commands()) > 20
    for command in commands():
        _, _, paper, *options = command.split()
        given = changed(settings_of(paper)(), parsed(options[1::2]))
        assert not options or differences(given), command


def test_a_command_of_the_page_runs(weighbridge, monkeypatch, tmp_path):
    """The first of Nguyen 2024, on one road; all run with `pytest --long`."""
    monkeypatch.setitem(nguyen2024.reproduce.__kwdefaults__, "roads", 1)
    first = next(c for c in commands() if c.split()[2] == "nguyen2024")
    file = tmp_path / "rows.json"
    assert weighbridge(*first.split()[1:], "--json", file).code in (0, 1)
    rows = json.loads(file.read_text(encoding="utf-8"))["rows"]
    assert len(rows) == len(items_of("nguyen2024"))


def test_every_command_of_the_page_runs(weighbridge, tmp_path):
    for k, command in enumerate(commands()):
        file = tmp_path / f"rows-{k}.json"
        assert weighbridge(*command.split()[1:], "--json", file).code in (0, 1), command
        assert json.loads(file.read_text(encoding="utf-8"))["rows"], command
