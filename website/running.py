"""Runs the code of a page, and writes what it says under it.

``python -m website.running`` runs all tutorials and renews their outputs; with names of
pages, those alone. A block of `bash` holds commands of weighbridge, one a line; a block
of `python` shares its names with the others of the page. A block of `text` right behind
one of them is its output. A line ``...`` in it stands for lines that are left out. Blocks that
`not_run.toml` lists are passed over.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
import tempfile
import textwrap
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from website.links import HOME

BLOCK = re.compile(
    r"^(?P<indent> *)```(?P<language>bash|python)\n(?P<code>.*?)^ *```\n"
    r"(?:\n(?P=indent)```text\n(?P<output>.*?)^ *```\n)?",
    re.MULTILINE | re.DOTALL,
)
"""A block of code, and its output where one follows."""
WIDTH = 110
"""Columns of the terminal on the pages."""

NOT_RUN = Path(__file__).with_name("not_run.toml")
"""Lists the blocks that nothing runs as they stand, by page and first line, with the reason."""
OWN_DRIVES = ("command.md", "record.md", "report.md", "methods/galvao.md", "methods/du2025.md")
"""Pages of docs/ without outputs, for the reader's own drives: `empty/`, `loaded/`, `car.toml`."""


class Block(NamedTuple):
    """A block of code on a page.

    Attributes
    ----------
    language : bash or python
    code, output : what stands there; no output where the page shows none
    start, end : of the output's text in the page; both 0 without one
    indent : spaces before the block
    """

    language: str
    code: str
    output: str | None
    start: int
    end: int
    indent: str


def pages() -> list[Path]:
    """Return the pages whose code is run with its output."""
    docs = HOME / "docs"
    return [
        docs / "start.md",
        *sorted(docs.glob("tutorials/*.md")),
        *sorted(docs.glob("howto/*.md")),
    ]


def blocks(page: Path) -> list[Block]:
    """Return the blocks of a page, in its order."""
    found = []
    for m in BLOCK.finditer(page.read_text(encoding="utf-8")):
        shown = m["output"]
        output = None if shown is None else textwrap.dedent(shown)
        where = (0, 0) if shown is None else m.span("output")
        found.append(Block(m["language"], textwrap.dedent(m["code"]), output, *where, m["indent"]))
    return found


def not_run(page: Path) -> dict[str, str]:
    """Return the reasons of the blocks of a page that nothing runs, by their first line."""
    listed = tomllib.loads(NOT_RUN.read_text(encoding="utf-8"))["block"]
    name = page.relative_to(HOME).as_posix()
    return {row["begins"]: row["reason"] for row in listed if row["page"] == name}


def run(page: Path, folder: Path) -> Iterator[tuple[Block, str]]:
    """Run the blocks of a page in a folder and yield each with what it said.

    The folder has the project's `examples`. Blocks of `not_run` are left out.

    Raises
    ------
    RuntimeError
        If a command ends with another exit status than 0 or 1.
    """
    names: dict[str, Any] = {}
    left_out = not_run(page)
    if not (folder / "examples").exists():
        (folder / "examples").symlink_to(HOME / "examples")
    for block in blocks(page):
        if block.code.partition("\n")[0] in left_out:
            continue
        before = Path.cwd()
        os.chdir(folder)
        try:
            said = _python(block.code, names) if block.language == "python" else _bash(block.code)
        finally:
            os.chdir(before)
        yield block, "\n".join(line.rstrip() for line in said.rstrip().splitlines())


def agrees(shown: str, said: str, tolerance: float) -> bool:
    """Tell whether a page shows what was said: the same words, and numbers within a tolerance.

    Another processor rounds otherwise: numbers may differ by a part `tolerance` of
    themselves or by as much in absolute terms, whichever is more. A number of kilograms may
    differ by that part of the greatest one shown, since a payload is a difference of masses, and
    those of a line with percents by 1.
    Lines of ``...`` stand for any number of lines.
    """
    return _found(shown, said, tolerance) is not None


def renew(page: Path, folder: Path) -> None:
    """Run a page and write its outputs anew; a line of ``...`` stays where the others are found."""
    text, shift = page.read_text(encoding="utf-8"), 0
    for block, said in run(page, folder):
        if block.output is None:
            continue
        lines = _found(block.output, said, float("inf")) if "..." in block.output else None
        if lines is None and "..." in block.output:
            print(f"the lines around ... were not found again: {block.code}")
        fresh = textwrap.indent("\n".join(lines or [said]) + "\n", block.indent)
        text = text[: block.start + shift] + fresh + text[block.end + shift :]
        shift += len(fresh) - (block.end - block.start)
    page.write_text(text, encoding="utf-8")


def renew_all(chosen: list[Path]) -> None:
    """Renew pages, each in an empty folder; how-to pages in the one that `docs/start.md` leaves."""
    started = [p for p in chosen if p.name == "start.md" or p.parent.name == "howto"]
    if started:
        with tempfile.TemporaryDirectory() as folder:
            start = HOME / "docs" / "start.md"
            for page in [start, *(p for p in started if p != start)]:
                print(page.relative_to(HOME))
                renew(page, Path(folder))
    for page in chosen:
        if page not in started:
            print(page.relative_to(HOME))
            with tempfile.TemporaryDirectory() as folder:
                renew(page, Path(folder))


def _found(shown: str, said: str, tolerance: float) -> list[str] | None:
    """Return the lines shown, as they were said now; none where one of them was not said."""
    rows = [row for row in said.splitlines() if row.strip()]
    heaviest = max((abs(_number(kg)) for kg in _MASS.findall(shown)), default=0.0)
    found, at, skips = [], 0, False
    for line in (row for row in shown.splitlines() if row.strip()):
        if line.strip() == "...":
            found.append(line)
            skips = True
            continue
        while skips and at < len(rows) and not _alike(line, rows[at], tolerance, heaviest):
            at += 1
        if at >= len(rows) or not _alike(line, rows[at], tolerance, heaviest):
            return None
        found.append(rows[at])
        at, skips = at + 1, False
    return found if skips or at == len(rows) else None


_RULES = re.compile(r"[━─┏┓┳┡┩╇└┘┴]+")
_NUMBER = re.compile(r"[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_MASS = re.compile(rf"({_NUMBER.pattern}) kg\b")


def _number(text: str) -> float:
    return float(text.replace("−", "-"))


def _alike(a: str, b: str, tolerance: float, heaviest: float) -> bool:
    if _RULES.sub(" ", _NUMBER.sub("#", a)).split() != _RULES.sub(" ", _NUMBER.sub("#", b)).split():
        return False
    masses = {match.start(1) for match in _MASS.finditer(a)}
    least = 1.0 if "%" in a else tolerance
    for left, right in zip(_NUMBER.finditer(a), _NUMBER.findall(b), strict=True):
        x, y = _number(left[0]), _number(right)
        greatest = max(1.0, abs(x), abs(y), heaviest if left.start() in masses else 0.0)
        if abs(x - y) > max(least, tolerance * greatest):
            return False
    return True


def _python(code: str, names: dict[str, Any]) -> str:
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        exec(compile(code, "page", "exec"), names)
    return said.getvalue()


def _bash(code: str) -> str:
    lines = code.replace("\\\n", " ").splitlines()
    return "".join(_command(_words(line)) for line in lines)


def _words(line: str) -> list[str]:
    """Split a line as a shell does; a word with ``*`` outside quotes stands for files."""
    words = []
    for word in shlex.split(line, comments=True, posix=False):
        pattern = "*" in word and word[0] not in "\"'"
        words += (pattern and sorted(map(str, Path().glob(word)))) or shlex.split(word)
    return words


def _command(words: list[str]) -> str:
    """Run a command of weighbridge in this process; a fleet, which starts others, in its own."""
    if not words or words[:2] == ["pip", "install"]:
        return ""
    if words[0] == "cat":
        return "".join(Path(name).read_text(encoding="utf-8") for name in words[1:])
    if words[0] != "weighbridge":
        raise RuntimeError(f"{words[0]} is no command of weighbridge")
    if words[1] == "fleet" and words[2] not in ("report", "status"):
        python = [sys.executable, "-m", "weighbridge", *words[1:]]
        variables = {**os.environ, "COLUMNS": str(WIDTH)}
        ran = subprocess.run(python, capture_output=True, text=True, env=variables, check=False)
        said, code = ran.stdout + ran.stderr, ran.returncode
    else:
        said, code = _in_process(words)
    if code not in (0, 1):
        raise RuntimeError(f"{' '.join(words)} ended with {code}: {said}")
    return said


def _in_process(words: list[str]) -> tuple[str, int]:
    from weighbridge.cli import main

    said, code, before = io.StringIO(), 0, (sys.argv, os.environ.get("COLUMNS"))
    sys.argv = words
    os.environ["COLUMNS"] = str(WIDTH)
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            main.run()
    except SystemExit as leaving:
        code = leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
    finally:
        sys.argv = before[0]
        if before[1] is None:
            del os.environ["COLUMNS"]
        else:
            os.environ["COLUMNS"] = before[1]
    return said.getvalue(), code


if __name__ == "__main__":
    renew_all([Path(p).resolve() for p in sys.argv[1:]] or pages())
