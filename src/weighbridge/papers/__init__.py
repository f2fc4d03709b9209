"""Reproductions of the published systems, each against its paper's own tables."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, Final

from weighbridge.papers.claims import Found, Item, Row, Section, Verdict, document
from weighbridge.papers.reproduced import Progress, Reproduced

PAPERS: Final[dict[str, str]] = {
    "du2025": "weighbridge.papers.du2025",
    "galvao": "weighbridge.papers.galvao",
    "jensen2022": "weighbridge.papers.jensen2022",
    "nguyen2024": "weighbridge.papers.nguyen2024",
}
"""Module of each paper that ``weighbridge reproduce`` knows; it has a function ``reproduced``
of a seed, a `Progress` and settings, ``ITEMS``, its equations, tables and figures as `Item`,
``SEED``, its first seed, and ``SETTINGS``, the class of the settings."""


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
    return int(import_module(PAPERS[name]).SEED)


def items_of(name: str) -> tuple[Item, ...]:
    """Return the equations, tables and figures of a paper."""
    return tuple(import_module(PAPERS[name]).ITEMS)


def settings_of(name: str) -> Any:
    """Return the settings class of a paper's reproduction."""
    return import_module(PAPERS[name]).SETTINGS


__all__ = [
    "PAPERS",
    "Found",
    "Item",
    "Progress",
    "Reproduced",
    "Row",
    "Section",
    "Verdict",
    "document",
    "items_of",
    "paper",
    "seed_of",
    "settings_of",
]
