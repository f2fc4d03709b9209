"""Numbers as the report prints them."""

from __future__ import annotations

import math
import re
from html import escape
from typing import TYPE_CHECKING, Final

from weighbridge.customary import shown_amount, shown_unit
from weighbridge.signals import scalar_from_si

if TYPE_CHECKING:
    from weighbridge.results.weighing import MassResult

NOTHING: Final = "–"
"""Where there is no number."""

_OPTION: Final = re.compile(r"(?<!\S)--[a-z][a-z-]*")


def amount(value: float, unit: str, form: str = ".0f") -> str:
    """Print a value in the unit that is shown in place of this one."""
    return f"{shown_amount(value, unit):{form}} {shown_unit(unit)}".replace("-", "−")


def kg(mass: float | None) -> str:
    """Print a mass."""
    if mass is None or not math.isfinite(mass):
        return NOTHING
    return f"{round(pounds(mass))} {shown_unit('kg')}".replace("-", "−")


def pounds(mass: float) -> float:
    """Return a mass in the unit that is shown in place of kg."""
    return shown_amount(mass, "kg")


def signed_kg(mass: float) -> str:
    """Print a difference of masses."""
    if not math.isfinite(mass):
        return NOTHING
    return f"{pounds(mass):+.0f} {shown_unit('kg')}".replace("-", "−")


def between(low: float, high: float, word: str = "to") -> str:
    """Print two masses with one unit."""
    return f"{pounds(low):.0f} {word} {kg(high)}"


def interval(weighing: MassResult) -> str:
    """Print the 95 % interval."""
    low, high = weighing.interval(0.95)
    return between(low, high) if math.isfinite(high - low) else NOTHING


def with_half(mass: float, half: float) -> str:
    """Print a mass with half its 95 % interval; alone where that is not known."""
    if not math.isfinite(half):
        return kg(mass)
    return f"{pounds(mass):.0f} ± {kg(half)}"


def plus_minus(weighing: MassResult) -> str:
    """Print the mass with half its 95 % interval."""
    low, high = weighing.interval(0.95)
    return with_half(weighing.mass, 0.5 * (high - low))


def error(mass: float, known: float | None) -> str:
    """Print the error of a mass against the true one."""
    if known is None or not math.isfinite(mass):
        return NOTHING
    return f"{100.0 * (mass / known - 1.0):+.1f} %".replace("-", "−")


def duration(seconds: float) -> str:
    """Print a time."""
    if not math.isfinite(seconds):
        return NOTHING
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{scalar_from_si(seconds, 'min'):.1f} min"


def capital(text: str) -> str:
    """Give a text a capital."""
    return text[:1].upper() + text[1:]


def prose(text: str) -> str:
    """Return a text as HTML; options of commands, such as ``--mass``, are not broken."""
    return _OPTION.sub(r'<span class="option">\g<0></span>', escape(text))


def sentence(text: str) -> str:
    """Give a fragment a capital and a full stop."""
    text = capital(text.strip())
    return text if text.endswith((".", "!", "?")) else text + "."
