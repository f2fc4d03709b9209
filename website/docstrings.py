"""Docstrings as the reference shows them: what a name means is no type."""

from __future__ import annotations

import re
from typing import Any

import griffe

_SECTION = re.compile(
    r"^(Parameters|Attributes|Other Parameters|Returns|Yields)\n-{3,}\n", re.MULTILINE
)
_HEADING = re.compile(r"^[A-Z][A-Za-z ]+\n-{3,}$", re.MULTILINE)
_ENTRY = re.compile(r"^(\w[\w, *]*?) : (.*)$", re.MULTILINE)


def reworded(text: str) -> str:
    """Set the words behind ``name :`` under the name; types come from the signature.

    Parameters
    ----------
    text : docstring in numpy's style whose entries read ``name : words [unit]``
    """
    parts, at = [], 0
    for begin in _SECTION.finditer(text):
        following = _HEADING.search(text, begin.end())
        end = following.start() if following else len(text)
        inside = text[begin.end() : end]
        if begin[1] in ("Returns", "Yields"):
            inside = _returned(inside)
        else:
            inside = _ENTRY.sub(r"\1\n    \2", inside)
        parts += [text[at : begin.end()], inside]
        at = end
    return "".join(parts) + text[at:]


def _returned(text: str) -> str:
    """Set what is returned under a colon alone; sentences without a type or name are one entry."""
    lines = text.strip("\n").splitlines()
    words = " ".join(line.strip() for line in lines)
    if " " in words and " : " not in words and all(line[:1].strip() for line in lines):
        return f":\n    {words}\n\n"
    return _ENTRY.sub(r"\1 :\n    \2", text)


class Words(griffe.Extension):
    """Rewords every docstring as it is loaded."""

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        """Reword the docstring of an object."""
        if obj.docstring:
            obj.docstring.value = reworded(obj.docstring.value)
