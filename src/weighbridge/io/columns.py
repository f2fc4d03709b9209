"""Canonical column names: a stem of the catalogue and a unit suffix."""

from __future__ import annotations

import difflib
import re
from typing import Final

from weighbridge.io.vocabulary import SPELLED_UNITS, UNIT_TEXTS
from weighbridge.signals import QUANTITIES, UNITS, Quantity
from weighbridge.signals.catalogue import TIME_COLUMN

_TIMES: Final = re.compile(r"\s*[*•⋅∙x×]\s*")
"""Signs of a product."""

UNKNOWN_UNIT: Final = "?"
"""Stands before a unit that a log states and nobody knows: no quantity is in it."""

# Letters of a name that may resemble a canonical one; comparing takes their square.
_LONGEST_NAME: Final = 200

_BRACKETED: Final = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]\s*$")

# Stems too general to be taken at their word outside their own table.
_GENERAL: Final = frozenset(q.stem for q in QUANTITIES.values() if q.stem != q.name) - {
    "engine_torque"
}


def dimension_of(quantity: Quantity) -> str:
    """Dimension of a quantity, as `weighbridge.signals.units` names it."""
    return UNITS[quantity.suffix].dimension if quantity.suffix else "-"


def suffixes_of(quantity: Quantity) -> list[str]:
    """Unit suffixes a quantity may be written in."""
    if not quantity.suffix:
        return []
    return [s for s, u in UNITS.items() if u.dimension == dimension_of(quantity)]


def unit_suffix(text: str) -> str | None:
    """Unit suffix for a unit as written by people, or None: ``km/h`` is ``kmh``.

    It may be spelled out: ``meters per second`` is ``mps``.
    """
    word = " ".join(text.strip().split()).lower()
    if word in UNITS:
        return word
    found = UNIT_TEXTS.get(word)
    word = " ".join(word.replace("_", " ").split())
    found = found or UNIT_TEXTS.get(word) or UNIT_TEXTS.get(_TIMES.sub("·", word))
    if found is None and " per " in word:
        short = "".join(SPELLED_UNITS.get(part, part) for part in word.split())
        return short if short in UNITS else UNIT_TEXTS.get(short)
    return found


def unit_refused(quantity: Quantity, text: str) -> str:
    """Say why a column whose name is a quantity's is not taken for it, by its unit.

    Parameters
    ----------
    quantity
    text : its unit as the log writes it
    """
    why = "is not known" if unit_suffix(text) is None else "measures something else"
    return (
        f"not taken for {quantity.name}: its unit {text!r} {why}; it can be in "
        f"{_either(suffixes_of(quantity))}"
    )


def stated_unit(text: str) -> str | None:
    """Unit suffix of a unit that a log states, after `UNKNOWN_UNIT` one that is not known; or None.

    Parameters
    ----------
    text : what is in a row or column of units; empty, or a mark such as - for none
    """
    word = text.strip().strip("[]()").strip()
    return (unit_suffix(word) or f"{UNKNOWN_UNIT}{word}") if word else None


def bracketed_unit(column: str) -> str | None:
    """Unit suffix in the brackets at the end of a name, as in ``Speed [km/h]``."""
    found = _BRACKETED.search(column)
    return unit_suffix(found.group(1)) if found else None


def time_unit(column: str) -> str | None:
    """Unit suffix of a canonical time column, or None where it is none."""
    name = column.strip().lower()
    if not name.startswith("time_"):
        return None
    found = UNITS.get(name.removeprefix("time_"))
    return name.removeprefix("time_") if found is not None and found.dimension == "s" else None


class UnitlessColumnError(ValueError):
    """A column has the name of a quantity, but no unit that it could be in."""


def parse_column(
    column: str, table: str | None, unit: str | None = None
) -> tuple[Quantity, str] | None:
    """Recognise a canonical column.

    Parameters
    ----------
    column : its name
    table : canonical table it is in; None where one file holds all
    unit : unit suffix known otherwise, for a name that carries none

    Returns
    -------
    The quantity and its unit suffix (empty for switches and counts), or None
    where the name is not canonical.

    Raises
    ------
    UnitlessColumnError
        The name is that of a quantity and the unit is missing or impossible.
    """
    name = column.strip().lower()
    candidates = [
        (stem, q)
        for q in QUANTITIES.values()
        for stem in {q.stem, q.name}
        if (name == stem or name.startswith(f"{stem}_"))
        and not (stem in _GENERAL and table != q.table)
    ]
    if not candidates:
        return None
    longest = max(len(stem) for stem, _ in candidates)
    candidates = [c for c in candidates if len(c[0]) == longest]
    ending = name[longest + 1 :]
    for _, q in candidates:
        if not q.suffix:
            if not ending:
                return q, ""
            continue
        suffix = ending or unit or ""
        if suffix in UNITS and UNITS[suffix].dimension == dimension_of(q):
            return q, suffix
    quantities = [q for _, q in candidates if q.suffix]
    if not quantities or "_" in ending:
        return None
    allowed = [f"{name[:longest]}_{s}" for q in quantities for s in suffixes_of(q)]
    said = f"ends in {ending!r}, which is not a unit it can be in" if ending else "carries no unit"
    raise UnitlessColumnError(f"{said}; name it {_either(allowed)}")


def _either(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"


def near_column(column: str) -> str | None:
    """Canonical column that an unknown name resembles, or None."""
    known = [q.column for q in QUANTITIES.values() if q.stem not in _GENERAL] + [TIME_COLUMN]
    name = column.strip().lower()
    if len(name) > _LONGEST_NAME:
        return None
    whole = [k for k in known if k.endswith(f"_{name}")]
    near = whole[:1] or difflib.get_close_matches(name, known, n=1, cutoff=0.75)
    return near[0] if near else None
