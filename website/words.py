"""Finds words that a reader cannot know; ``python -m website.words`` lists them."""

from __future__ import annotations

import ast
import inspect
import re
import sys
import tomllib
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from website import links

HOME = Path(__file__).parents[1]
SOURCE = HOME / "src" / "weighbridge"
INSTEAD: dict[str, str] = tomllib.loads(
    (HOME / "website" / "words.toml").read_text(encoding="utf-8")
)
"""Expressions of private words, with what to write in their place."""

_PRIVATE = re.compile(
    rf"(?<![.\w])(?:{'|'.join(f'(?:{word})' for word in INSTEAD)})\b", re.IGNORECASE
)
_CODE = re.compile(r"``[^`]+``|`[^`\n]+`|\]\([^)\s]*\)|https?://\S+")
_VALUE = re.compile(r"\{[^{}\n]*\}|^\[[^\]\n]*\]$", re.MULTILINE)
_NAMES = re.compile(r"^[\w, *]+ : ", re.MULTILINE)


def private_words(text: str) -> list[tuple[int, str]]:
    """Return line and word of each private word of a text; code between backticks is left out."""
    plain = _CODE.sub(lambda code: re.sub(r"[^\n]", " ", code[0]), text)
    return [(plain.count("\n", 0, m.start()) + 1, m[0]) for m in _PRIVATE.finditer(plain)]


def pages() -> Iterator[tuple[str, str]]:
    """Yield place and text of what people read: pages of the site, messages, pages of results."""
    shown = (p for p in SOURCE.rglob("*") if p.suffix in (".toml", ".html", ".js", ".css"))
    examples = (HOME / "examples").rglob("*.toml")
    for path in sorted({*links.pages(), *examples, *shown}):
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".toml":
            text = _VALUE.sub("", text)
        yield path.relative_to(HOME).as_posix(), text


def sentences() -> Iterator[tuple[str, str]]:
    """Yield place and text of the literals of the program that have a blank: its sentences."""
    for path in sorted(SOURCE.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        described = set()
        # What holds a docstring comes before it.
        for node in ast.walk(tree):
            if isinstance(body := getattr(node, "body", None), list):
                described |= {id(line.value) for line in body if isinstance(line, ast.Expr)}
            if not isinstance(node, ast.Constant) or id(node) in described:
                continue
            if isinstance(node.value, str) and " " in node.value:
                yield f"{path.relative_to(HOME).as_posix()}:{node.lineno}", node.value


def references() -> Iterator[tuple[str, str]]:
    """Yield place and text of the reference: commands, numbers, docstrings of public names."""
    from website import checks, reference

    yield "weighbridge --help", reference.commands_page()
    yield "reference/checks.md", checks.checks_page()
    for page in reference.python_pages().values():
        for name in re.findall(r"^::: (\S+)", page, re.MULTILINE):
            home, _, last = name.rpartition(".")
            public = getattr(import_module(home), last)
            yield from _docstrings(name, public)


def found() -> Iterator[tuple[str, int, str]]:
    """Yield place, line and word of each private word that a user may read."""
    for source in (pages, sentences, references):
        for place, text in source():
            for line, word in private_words(text):
                yield place, line, word


def _docstrings(name: str, public: Any) -> Iterator[tuple[str, str]]:
    if not callable(public):
        return
    yield name, _described(public)
    if inspect.isclass(public):
        for inner, member in vars(public).items():
            of = (
                member.fget if isinstance(member, property) else getattr(member, "__func__", member)
            )
            if not inner.startswith("_") and inspect.isfunction(of):
                yield f"{name}.{inner}", _described(of)


def _described(public: Any) -> str:
    """Return a docstring without the names of its parameters and attributes."""
    return _NAMES.sub("", inspect.getdoc(public) or "")


if __name__ == "__main__":
    sys.path.insert(0, str(HOME))
    for place, line, word in found():
        print(f"{place}:{line}: {word}")
