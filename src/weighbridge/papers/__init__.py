"""Reproductions of the published systems, each against its paper's own tables."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, Final

from weighbridge.papers.claims import Item, Section
from weighbridge.papers.reproduced import Comparison, Progress, Reproduced

PAPERS: Final[dict[str, str]] = {
    "du2025": "weighbridge.papers.du2025",
    "galvao": "weighbridge.papers.galvao",
    "jensen2022": "weighbridge.papers.jensen2022",
    "nguyen2024": "weighbridge.papers.nguyen2024",
}
"""Module of each paper that ``weighbridge reproduce`` knows; it has a function ``reproduced``
of a seed and a `Progress`. What it may have besides: ``ITEMS``, its equations, tables and figures
as `Item`; ``SEED``, its first seed; ``SETTINGS``, a class of values, third argument."""

USUAL_SEED: Final = 777
"""First seed of a paper whose module names none."""


def paper(name: str) -> Callable[..., Reproduced]:
    """Return what reproduces the paper; its module is imported only now.

    Raises
    ------
    KeyError
        There is no such paper.
    """
    function: Callable[..., Reproduced] = import_module(PAPERS[name]).reproduced
    return function


def seed_of(name: str) -> int:
    """Return the first seed a paper is reproduced on where nobody names another."""
    return int(getattr(import_module(PAPERS[name]), "SEED", USUAL_SEED))


def items_of(name: str) -> tuple[Item, ...]:
    """Return the equations, tables and figures of a paper; none where it has no records yet."""
    return tuple(getattr(import_module(PAPERS[name]), "ITEMS", ()))


def settings_of(name: str) -> Any:
    """Return the settings class of a paper's reproduction; None where it has none."""
    return getattr(import_module(PAPERS[name]), "SETTINGS", None)


def section_of(name: str, done: Reproduced) -> Section:
    """Return the items of a paper with the figures of a run."""
    title, _, note = done.title.partition(", ")
    return Section(title=title, note=note, items=items_of(name), figures=done.figures)


__all__ = [
    "PAPERS",
    "Comparison",
    "Item",
    "Progress",
    "Reproduced",
    "items_of",
    "paper",
    "section_of",
    "seed_of",
    "settings_of",
]
