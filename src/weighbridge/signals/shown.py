"""Drives and results as a person sees them in a terminal or a notebook."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence

from weighbridge.visible import cut, visible

WIDEST = 100
"""Characters of a line."""


def in_lines(lines: Sequence[str]) -> str:
    """Join lines for a terminal: control characters visible, each cut to `WIDEST`."""
    return "\n  ".join(_short(visible(line)) for line in lines if line)


def in_html(lines: Sequence[str]) -> str:
    """Join lines for a notebook: the first as a heading, text escaped."""
    first, *others = (html.escape(visible(cut(line))) for line in lines if line)
    rest = "".join(f"<br>{line}" for line in others)
    return f"<div><strong>{first}</strong>{rest}</div>"


def plural(count: int, word: str) -> str:
    """Count things: ``1 signal``, ``3 signals``."""
    return f"{count} {word}" if count == 1 else f"{count} {word}s"


def at_rate(period: float) -> str:
    """Samples per second, of a median period [s]; empty where it is not known."""
    return f"{1.0 / period:.3g} Hz" if math.isfinite(period) and period > 0.0 else ""


def _short(line: str) -> str:
    return line if len(line) <= WIDEST else line[: WIDEST - 1].rstrip() + "…"
