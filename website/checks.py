"""The page of what is checked: how often each thing is found, what is done then, and the limits."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import polars as pl

from website.links import HOME
from website.messages import shown
from weighbridge.messages import catalogue

SOURCE = HOME / "src" / "weighbridge"
CORPUS = HOME / "studies" / "corpus" / "corpus.csv"
ROOMS = (
    "signals", "checks", "navigation", "vehicle",
    "balance", "estimators", "calibration", "pipeline",
)  # fmt: skip
"""Rooms that a weighing passes through."""

_HEAD = """# What is checked

Each section is a module of the program. Its first table has what the module finds, by the id of
the [message](messages.md), and what is done then. The last columns count pairs of drive and
vehicle of the corpus, on which every change to the program is tried:

- **sound**: it was found, although the drive is undamaged. Drives that lack a signal are sound,
  too, so that a note on what is lacking is found often.
- **damaged**: it was found in a damaged drive, and not in the same drive undamaged.
- In brackets: how many of these pairs have no mass. Other checks may have had a part in it.

The other table of a section has the numbers by which the module decides, with their units, and
where they come from. Modules that find nothing themselves have this table alone. Numbers that many
modules share are in [limits](#limits).

Three examples:

- An engine speed that freezes for ten seconds: [checks/frozen](#checksfrozen) finds it, and
  [checks/correcting](#checkscorrecting) says so.
- A clock of the bus that jumps by two seconds: [navigation/clock_drift](#navigationclock_drift),
  by the lags of [navigation/clock_lag](#navigationclock_lag).
- An accelerometer that reads ten percent too much:
  [navigation/identify/rounds](#navigationidentifyrounds), by the numbers of
  [navigation/identify/gain](#navigationidentifygain).
"""


class Counts(NamedTuple):
    """Pairs of the corpus in which a message was found, and those of them without a mass."""

    found: int = 0
    refused: int = 0

    def __str__(self) -> str:
        return f"{self.found} ({self.refused})" if self.refused else str(self.found)


def checks_page() -> str:
    """Return the page."""
    table = pl.read_csv(CORPUS)
    many = int(table["sound"].sum())
    sound, damaged = counts(table)
    lines = [
        _HEAD,
        f"The corpus has {many} sound and {table.height - many} damaged pairs. Its drives were",
        "looked at while the limits were chosen: these counts are no claim about other drives.",
        "",
    ]
    shared = (SOURCE / "constants.py", SOURCE / "limits.py")
    rooms = sorted(path for room in ROOMS for path in (SOURCE / room).rglob("*.py"))
    texts = {path: path.read_text(encoding="utf-8") for path in (*shared, *rooms)}
    found = found_by([ast.parse(text) for text in texts.values()])
    for (path, text), ids in zip(texts.items(), found, strict=True):
        tree = ast.parse(text)
        rows = [f"| `{n}` | {v} | {marked(why)} |" for n, v, why in limits(tree, text)]
        if not (ids or rows):
            continue
        opening = (ast.get_docstring(tree) or "").partition("\n\n")[0]
        lines += [f"## {path.relative_to(SOURCE).with_suffix('').as_posix()}", ""]
        lines += [marked(" ".join(opening.split())), ""]
        if ids:
            lines += ["| id | found | what is done | sound | damaged |", "|---|---|---|---|---|"]
        for id, serious in ids.items():
            parts = catalogue()[id]
            pairs = [sound[id], damaged[id]]
            always = any(p.found for p in pairs) and all(p.found == p.refused for p in pairs)
            done = parts.get("effect", "no mass" if serious or always else "said with the mass")
            row = (f"`{id}`", shown(parts["text"]), shown(done), str(sound[id]), str(damaged[id]))
            lines.append(f"| {' | '.join(row)} |")
        if rows:
            lines += [""] if ids else []
            lines += ["| number | value | what it is, and its source |", "|---|---|---|", *rows]
        lines.append("")
    return "\n".join(lines)


def counts(table: pl.DataFrame) -> tuple[defaultdict[str, Counts], defaultdict[str, Counts]]:
    """Count the sound and the damaged pairs of a table of the corpus by what was found in them."""
    rows = table.select("id", "problem_ids", "mass_kg", "sound", "reference").rows()
    found = {id: set((ids or "").split()) for id, ids, *_ in rows}
    sound, damaged = defaultdict(Counts), defaultdict(Counts)
    for id, _, mass, undamaged, reference in rows:
        of, known = (sound, set()) if undamaged else (damaged, found.get(reference, set()))
        for one in found[id] - known:
            of[one] = Counts(of[one].found + 1, of[one].refused + (mass is None))
    return sound, damaged


def found_by(modules: Sequence[ast.Module]) -> list[dict[str, bool]]:
    """Return the ids that each module makes messages of, and whether each surely ends a weighing.

    An id that no module makes a message of by name belongs to those that name it, in a table say.
    """
    made = [_made_by(tree) for tree in modules]
    known = {id for ids in made for id in ids}
    named = [
        {c.value for c in ast.walk(tree) if isinstance(c, ast.Constant) and c.value in catalogue()}
        for tree in modules
    ]
    return [
        dict(sorted((dict.fromkeys(ids - known, False) | own).items()))
        for ids, own in zip(named, made, strict=True)
    ]


def _made_by(tree: ast.Module) -> dict[str, bool]:
    found: dict[str, bool] = {}
    for call in ast.walk(tree):
        if not (isinstance(call, ast.Call) and call.args):
            continue
        name = ast.unparse(call.func)
        if name not in ("refused", "Problem.of", "Message.of"):
            continue
        serious = name == "refused" or any(
            k.arg == "serious" and ast.unparse(k.value) == "True" for k in call.keywords
        )
        for part in ast.walk(call.args[0]):
            if isinstance(part, ast.Constant) and part.value in catalogue():
                found[part.value] = found.get(part.value, True) and serious
    return found


def limits(tree: ast.Module, text: str) -> Iterator[tuple[str, str, str]]:
    """Return name, value, and meaning of the numbers that a module assigns outside of functions.

    The meaning is the text below a number, or the comment beside or above it. Numbers that follow
    each other share it.
    """
    lines, shared = text.splitlines(), ""
    for node, after in zip(tree.body, [*tree.body[1:], None], strict=True):
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        if not _is_number(node.value):
            continue
        beside = lines[node.end_lineno - 1].partition("  # ")[2]
        above = _comment(lines, node.lineno - 1)
        if above or not lines[node.lineno - 2].strip():
            shared = above or _text_below(tree.body, node)
        names = [ast.unparse(t) for t in getattr(node, "targets", None) or [node.target]]
        meaning = _text_of(after) or "; ".join(filter(None, (shared, beside)))
        yield ", ".join(names), ast.unparse(node.value), " ".join(meaning.split())


def _is_number(node: ast.expr) -> bool:
    """Whether an expression is a number, a tuple of them, or made from them by NumPy or math."""
    parts = list(ast.walk(node))
    names = {ast.unparse(p) for p in parts if isinstance(p, ast.Name)}
    numbers = [p.value for p in parts if isinstance(p, ast.Constant)]
    kinds = {type(number) for number in numbers}
    return bool(numbers) and kinds <= {int, float} and names <= {"np", "math", "float", "range"}


def _text_of(node: ast.stmt | None) -> str:
    """Return a text that stands alone; empty of anything else."""
    alone = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    return str(node.value.value) if alone else ""


def _text_below(body: list[ast.stmt], first: ast.stmt) -> str:
    """Return the text below assignments that follow each other without an empty line."""
    rest = body[body.index(first) :]
    for node, after in pairwise(rest):
        if text := _text_of(after):
            return text
        if after.lineno > node.end_lineno + 1:
            break
    return ""


def marked(text: str) -> str:
    """Return a text in which names in backticks are code, and nothing else is a mark."""
    return "`".join(part if k % 2 else shown(part) for k, part in enumerate(text.split("`")))


def _comment(lines: list[str], number: int) -> str:
    """Return the comment that ends above a line."""
    first = number
    while first and lines[first - 1].startswith("#"):
        first -= 1
    return " ".join(line.lstrip("# ") for line in lines[first:number])
