"""docs/troubleshooting.md has messages that the program says, and every status and reason."""

import ast
import re
from pathlib import Path

import pytest

import weighbridge
from weighbridge.balance import REASON_TEXT, Reason
from weighbridge.estimators import Status

HOME = Path(__file__).parents[2]
PAGE = (HOME / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
SOURCE = Path(weighbridge.__file__).parent
HEADS = {"the reason says", "message", "note", "reason"}


def strings(path):
    """Return the texts of a module, with ``…`` where values are put in; docstrings are none."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    left_out = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    left_out |= {id(v) for n in ast.walk(tree) if isinstance(n, ast.JoinedStr) for v in n.values}
    for node in ast.walk(tree):
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


TEXTS = "\n".join(text for path in sorted(SOURCE.rglob("*.py")) for text in strings(path))


@pytest.mark.parametrize("message", first_cells())
def test_a_message_of_the_page_is_said_by_the_program(message):
    for piece in message.split("…"):
        assert piece.strip() in TEXTS, piece


def test_every_status_has_a_heading():
    headings = set(re.findall(r"^### (\w+)$", PAGE, re.MULTILINE))
    assert {status.value for status in Status} <= headings


def test_every_reason_of_a_row_is_explained():
    assert {REASON_TEXT[r] for r in Reason if r is not Reason.USED} <= set(first_cells())


def test_every_reason_of_a_mass_that_is_none_is_explained():
    """What the gates of all methods say: the parts of sentences that hold for any drive."""
    judged = [
        text
        for name in ("judging.py", "joint/foreign.py", "joint/contradicted.py", "joint/changing.py")
        for text in strings(SOURCE / "estimators" / name)
        if len(text.split()) >= 8
    ]
    pieces = [p.strip() for cell in first_cells() for p in cell.split("…") if len(p.split()) > 2]
    assert len(judged) > 10
    for text in judged:
        assert any(piece in text for piece in pieces), text
