"""Numbers as the report prints them."""

from __future__ import annotations

import math
import re
from html import escape
from typing import TYPE_CHECKING, Final

from weighbridge.signals.units import scalar_from_si

if TYPE_CHECKING:
    from weighbridge.results.weighing import MassResult

NOTHING: Final = "–"
"""Where there is no number."""

_OPTION: Final = re.compile(r"(?<!\S)--[a-z][a-z-]*")


def kg(mass: float | None) -> str:
    """Print a mass."""
    if mass is None or not math.isfinite(mass):
        return NOTHING
    return f"{round(mass)} kg".replace("-", "−")


def signed_kg(mass: float) -> str:
    """Print a difference of masses."""
    return f"{mass:+.0f} kg".replace("-", "−") if math.isfinite(mass) else NOTHING


def interval(weighing: MassResult) -> str:
    """Print the 95 % interval."""
    low, high = weighing.interval(0.95)
    return f"{low:.0f} to {high:.0f} kg" if math.isfinite(high - low) else NOTHING


def plus_minus(weighing: MassResult) -> str:
    """Print the mass with half its 95 % interval."""
    low, high = weighing.interval(0.95)
    if not math.isfinite(high - low):
        return kg(weighing.mass)
    return f"{weighing.mass:.0f} ± {0.5 * (high - low):.0f} kg"


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
