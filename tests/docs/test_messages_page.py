"""docs/troubleshooting.md has messages that the program says, and every status and reason."""

import ast
import re
from pathlib import Path

from website.messages import messages_page

import weighbridge
from weighbridge import Status
from weighbridge.balance import REASON_TEXT, Reason
from weighbridge.messages import catalogue

HOME = Path(__file__).parents[2]
PAGE = (HOME / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
SOURCE = Path(weighbridge.__file__).parent
HEADS = {"the reason says", "message", "note", "reason"}


def strings(path):
    """Return the texts of a module, with ``…`` where values are put in; docstrings are none."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    left_out = {id(n.value) for n in nodes if isinstance(n, ast.Expr)}
    left_out |= {id(v) for n in nodes if isinstance(n, ast.JoinedStr) for v in n.values}
    for node in nodes:
        if id(node) in left_out:
            continue
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield " ".join(node.value.split())
        elif isinstance(node, ast.JoinedStr):
            parts = [v.value if isinstance(v, ast.Constant) else "…" for v in node.values]
            yield " ".join("".join(map(str, parts)).split())


def first_cells():
    """Return the messages of the page: the first cells of its tables."""
    rows = re.findall(r"^\| (.+?) \|", PAGE, re.MULTILINE)
    return [row for row in rows if row not in HEADS and not row.startswith("---")]


ID = re.compile(r"`([a-z]+\.[a-z0-9_]+)`")


def test_a_message_of_the_page_is_one_of_the_program():
    """By its ids; errors of files and arguments have none."""
    named = {id for message in first_cells() for id in ID.findall(message)}
    assert len(named) > 50
    assert named <= set(catalogue())


def test_every_status_has_a_heading():
    headings = set(re.findall(r"^### (\w+)$", PAGE, re.MULTILINE))
    assert {status.value for status in Status} <= headings


def test_every_reason_of_a_row_is_explained():
    assert {REASON_TEXT[r] for r in Reason if r is not Reason.USED} <= set(first_cells())


def test_every_reason_of_a_mass_that_is_none_is_explained():
    """What the gates of all methods say."""
    explained = {id for cell in first_cells() for id in ID.findall(cell)}
    gates = ("judging.py", "joint/foreign.py", "joint/contradicted.py", "joint/changing.py")
    judged = {
        text
        for name in gates
        for text in strings(SOURCE / "estimators" / name)
        if text in catalogue()
    }
    assert len(judged) > 10
    assert judged <= explained


def test_the_page_by_id_has_every_message():
    page = messages_page()
    for id in catalogue():
        row = next(line for line in page.splitlines() if line.startswith(f"| `{id}` |"))
        assert row.count(" | ") == 3
