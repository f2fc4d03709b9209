"""Reproductions of the published systems, each against its paper's own tables."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Final

from weighbridge.papers.reproduced import Comparison, Progress, Reproduced

PAPERS: Final[dict[str, str]] = {
    "du2025": "weighbridge.papers.du2025",
    "galvao": "weighbridge.papers.galvao",
    "jensen2022": "weighbridge.papers.jensen2022",
    "nguyen2024": "weighbridge.papers.nguyen2024",
}
"""Module of each paper that ``weighbridge reproduce`` knows; it has a function ``reproduced``
of a seed and a `Progress`."""


def paper(name: str) -> Callable[[int, Progress | None], Reproduced]:
    """Return what reproduces the paper; its module is imported only now.

    Raises
    ------
    KeyError
        There is no such paper.
    """
    function: Callable[[int, Progress | None], Reproduced] = import_module(PAPERS[name]).reproduced
    return function


__all__ = ["PAPERS", "Comparison", "Progress", "Reproduced", "paper"]
