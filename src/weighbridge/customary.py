"""Units in which people read results: SI and km/h, or those of the United States.

Numbers inside the program, and in files, are not touched: only what is shown passes here.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from contextvars import ContextVar
from typing import Final, NamedTuple, TypeVar

Amount = TypeVar("Amount")

SYSTEMS: Final = ("si", "us")
"""Systems of units that a person may choose."""


class Unit(NamedTuple):
    """A unit that is shown in place of another."""

    name: str
    per: float  # of the unit that it replaces


US: Final = {
    "kg": Unit("lb", 1.0 / 0.45359237),
    "m": Unit("ft", 1.0 / 0.3048),
    "km": Unit("mi", 1.0 / 1.609344),
    "km/h": Unit("mph", 1.0 / 1.609344),
    "m/s": Unit("mph", 3.6 / 1.609344),
    "m/s²": Unit("ft/s²", 1.0 / 0.3048),
    "N": Unit("lbf", 1.0 / 4.4482216152605),
    "N m": Unit("lbf ft", 1.0 / (4.4482216152605 * 0.3048)),
}
"""By the unit that each replaces (NIST Special Publication 811, 2008, B.8)."""

_chosen: ContextVar[str] = ContextVar("units", default=SYSTEMS[0])


@contextlib.contextmanager
def shown_in(system: str) -> Iterator[None]:
    """Let results be shown in a system of `SYSTEMS`.

    Raises
    ------
    ConfigError
        There is no such system.
    """
    # The command begins without what arguments need.
    from weighbridge.arguments import check_choice

    check_choice("units", system, SYSTEMS)
    before = _chosen.set(system)
    try:
        yield
    finally:
        _chosen.reset(before)


def shown_unit(unit: str) -> str:
    """Return the name of the unit that is shown in place of this one."""
    return _shown(unit).name


def shown_amount(amount: Amount, unit: str) -> Amount:
    """Return a number, or an array, in the unit that is shown in place of this one."""
    per = _shown(unit).per
    return amount if per == 1.0 else amount * per  # type: ignore[operator, return-value]


def _shown(unit: str) -> Unit:
    same = Unit(unit, 1.0)
    return US.get(unit, same) if _chosen.get() == "us" else same
