"""Items of a paper and the table that is made of them."""

import pytest

from weighbridge.errors import ConfigError
from weighbridge.papers.claims import Item, markdown, tables

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
