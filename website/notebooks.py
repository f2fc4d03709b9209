"""Tutorials as Jupyter notebooks."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

from website.links import HOME
from website.running import BLOCK

FIRST = """\
import os
import sys

os.environ["PATH"] = os.path.dirname(sys.executable) + os.pathsep + os.environ["PATH"]
os.environ.update(COLUMNS="110", TTY_COMPATIBLE="0")
"""
"""Lets the commands of a notebook be those of its Python, and print as on the page."""

_FOLDED = re.compile(r'^\?\?\? \w+ "(.*)"\n', re.MULTILINE)


def tutorials() -> list[Path]:
    """Return the pages that are notebooks, too."""
    return [p for p in sorted((HOME / "docs" / "tutorials").glob("*.md")) if p.stem != "index"]


def notebook(page: Path) -> str:
    """Return the notebook of a tutorial: its text, its code and the output that it shows."""
    text = _FOLDED.sub(r"**\1**\n", page.read_text(encoding="utf-8"))
    cells, at = [new_code_cell(FIRST.rstrip())], 0
    for found in BLOCK.finditer(text):
        _add_text(cells, text[at : found.start()])
        code = textwrap.dedent(found["code"]).rstrip()
        if found["language"] == "bash":
            lines = re.sub(r"\\\n\s*", "", code).splitlines()
            code = "\n".join(f"!{line}" for line in lines)
        cell = new_code_cell(code)
        if found["output"]:
            shown = textwrap.dedent(found["output"])
            cell.outputs = [new_output("stream", name="stdout", text=shown)]
        cells.append(cell)
        at = found.end()
    _add_text(cells, text[at:])
    for number, cell in enumerate(cells):
        cell.id = f"{page.stem}-{number}"
    made = new_notebook(cells=cells, metadata={"language_info": {"name": "python"}})
    nbformat.validate(made)
    return nbformat.writes(made)


def _add_text(cells: list[nbformat.NotebookNode], text: str) -> None:
    """Add a cell of text; links to other pages become their words, for a notebook stands alone."""
    text = re.sub(r"\[([^\]]+)\]\((?!https?:)[^)]+\)(?:\{[^}]*\})?", r"\1", text)
    text = textwrap.dedent(text.strip("\n")).strip()
    if text:
        cells.append(new_markdown_cell(text))
