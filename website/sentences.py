"""Counts the words of sentences; ``python -m website.sentences PAGE...`` tells the long ones."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

MOST = 25
"""Words of the longest sentence."""
MOST_IN_A_CELL = 40
"""Words of the longest cell of a table."""

_FENCE = re.compile(r"^ *```.*?^ *```[ ]*$", re.MULTILINE | re.DOTALL)
_FORMULA = re.compile(r"\$[^$]+\$")
_ITEM = re.compile(r"^ *(?:[-*+] |\d+\. |#+ |\?\?\? |!!! |> )", re.MULTILINE)
_LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)(?:\{[^}]*\})?")
_END = re.compile(r"(?<=[.!?:])(?:\*\*|[)\"])*\s+(?=[\"(*`\[]*[A-ZÄÖÜ0-9`…])")


def sentences(text: str) -> Iterator[str]:
    """Yield the sentences of the paragraphs and items of a page, without tables and code.

    A sentence ends at ``. ! ?`` or a colon before a capital, a digit or code, and with its
    paragraph or item. Code in a line counts as one word.
    """
    text = _FENCE.sub("\n\n", text)
    text = re.sub(r"<[^>]+>", " ", text)
    text = "\n".join("" if line.lstrip().startswith("|") else line for line in text.splitlines())
    text = re.sub(r"^    [^-*\d\s].*$", "", text, flags=re.MULTILINE)
    text = _plain(_ITEM.sub("\n\n", text))
    for paragraph in re.split(r"\n\s*\n", text):
        flat = " ".join(paragraph.split())
        flat = re.sub(r"\b(al|e\.g|i\.e|etc|sec|eq|eqs|fig|figs|vs|ed|ch|no)\.", r"\1", flat)
        yield from (part for part in _END.split(flat) if part.strip())


def cells(text: str) -> Iterator[str]:
    """Yield the cells of the tables of a page. Code and formulas count as one word."""
    for line in _FENCE.sub("", text).splitlines():
        if line.lstrip().startswith("|"):
            yield from (c.strip() for c in re.split(r"(?<!\\)\|", _plain(line)) if c.strip())


def length(sentence: str) -> int:
    """Return the number of words; numbers and symbols alone are none."""
    return sum(any(c.isalpha() for c in word) for word in sentence.split())


def long_ones(text: str) -> list[str]:
    """Return the sentences and the cells of a page that have too many words."""
    told = [s for s in sentences(text) if length(s) > MOST]
    return told + [cell for cell in cells(text) if length(cell) > MOST_IN_A_CELL]


def _plain(text: str) -> str:
    """Return a text with its links as words, code and formulas as one word each."""
    return _FORMULA.sub("X", re.sub(r"`[^`\n]+`", "X", _LINK.sub(r"\1", text)))


if __name__ == "__main__":
    for name in sys.argv[1:]:
        for sentence in long_ones(Path(name).read_text(encoding="utf-8")):
            print(f"{name}: {length(sentence)} words: {sentence}")
