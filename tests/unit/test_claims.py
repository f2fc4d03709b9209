"""Items of a paper and the table that is made of them."""

from pathlib import Path

import pytest

from weighbridge.errors import ConfigError
from weighbridge.papers import PAPERS, items_of
from weighbridge.papers.claims import NOT_REPRODUCED, Item, markdown, tables

PAGE = Path(__file__).parents[2] / "docs" / "papers.md"

LAW = Item("eq. 1", "`law.py`", True, "", "", "", True)
RATIO = Item("table 4", "`gear.py`", False, "steady rows", "2 %", "{ratio} | {unmade}", True)
BETTER = Item("fig. 11", "`joint`", False, "wind found", "±5 %", "worst {worst}", False)


def test_like_conditions_come_first_and_others_apart():
    like, other = tables("A paper", (BETTER, LAW, RATIO), {"ratio": "0.2 %", "worst": "1 %"})
    assert [row[0] for row in like.rows] == ["eq. 1", "table 4"]
    assert [row[0] for row in other.rows] == ["fig. 11"]
    assert like.rows[1][-1] == "0.2 % | not run"
    assert other.rows[0][-1] == "worst 1 %"
    assert "conditions of the paper" in like.title


def test_a_table_of_nothing_is_left_out():
    (like,) = tables("A paper", (LAW,), {})
    assert len(like.rows) == 1


def test_markdown_keeps_bars_in_their_cell():
    (like,) = tables("A paper", (RATIO,), {"ratio": "0.2 %"})
    row = markdown(like).splitlines()[-1]
    assert row.count(" | ") == 5
    assert "0.2 % \\| not run" in row


def test_a_departure_must_be_said():
    with pytest.raises(ConfigError, match=r"eq\. 7: say what departs"):
        Item("eq. 7", "`rls.py`", False, "", "", "", True)


def test_the_page_lists_every_item_of_today_with_a_figure_of_a_run():
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    rows = [
        line.removeprefix("| ").removesuffix(" |").split(" | ") for line in lines if "| " in line
    ]
    rows = [row for row in rows if row[0] not in ("paper", "---")]
    items = [
        item
        for name in PAPERS
        for kind in (True, False)
        for item in items_of(name)
        if item.like_for_like is kind
    ]
    wanted = [
        [i.paper_item, i.where, "yes" if i.as_printed else "no", i.departure, i.printed]
        for i in items
    ]
    assert [row[:5] for row in rows] == wanted
    for item, row in zip(items, rows, strict=True):
        assert NOT_REPRODUCED not in row[5]
        assert bool(row[5].strip()) is bool(item.ours), item.paper_item
