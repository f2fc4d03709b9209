"""Whether the speeds of the wheels and of satellites agree, as drafts of a log have them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from weighbridge.io.draft import Draft
from weighbridge.io.draft_column import DraftColumn
from weighbridge.io.draft_unit import NEAR, SLOWEST, SPEEDS
from weighbridge.signals.units import UNITS


def with_compared_speeds(drafts: Sequence[Draft]) -> list[Draft]:
    """Question the unit of a speed that is another unit's multiple of the satellites' speed.

    Parameters
    ----------
    drafts : of the files of one drive or logger
    """
    ground = _only(drafts, "gnss_speed")
    speed = _only(drafts, "vehicle_speed")
    if ground is None or speed is None:
        return list(drafts)
    meant = _meant(speed, ground)
    if meant is None:
        return list(drafts)
    if not speed.stated:
        reported = replace(
            speed,
            unit=meant,
            question=f"states no unit; taken as {meant}, as {ground.name!r} shows",
        )
        return _with(drafts, speed, reported)
    ratio = _si(speed.high, speed) / _si(ground.high, ground)
    question = (
        f"reads {ratio:.2f} times the speed of {ground.name!r}, as {meant} under {speed.unit} "
        f'would: write unit = "{meant}" for it, if {ground.name!r} is in {ground.unit}'
    )
    reported = replace(
        speed, question=f"{speed.question}; {question}" if speed.question else question, unsure=True
    )
    return _with(drafts, speed, reported)


def _with(drafts: Sequence[Draft], old: DraftColumn, new: DraftColumn) -> list[Draft]:
    return [
        replace(one, columns=tuple(new if c is old else c for c in one.columns)) for one in drafts
    ]


def _only(drafts: Sequence[Draft], quantity: str) -> DraftColumn | None:
    """Return the column of a quantity; None where there is none, or several differ."""
    found = [c for one in drafts for c in one.columns if c.quantity == quantity]
    return found[0] if len(found) == 1 else None


def _si(value: float, column: DraftColumn) -> float:
    return value * UNITS[column.unit].factor


def _meant(speed: DraftColumn, ground: DraftColumn) -> str | None:
    """Unit that a speed seems to be in; None where the one it is taken for fits.

    Highest and median have to show the same, so that neither a spike nor a stop decides.
    """
    pairs = [
        (_si(a, speed), _si(b, ground))
        for a, b in ((speed.high, ground.high), (speed.usual, ground.usual))
    ]
    if min(b for _, b in pairs) < SLOWEST or min(a for a, _ in pairs) <= 0.0:
        return None
    for unit in SPEEDS:
        if unit == speed.unit:
            continue
        factor = UNITS[speed.unit].factor / UNITS[unit].factor
        if all(abs(a / b / factor - 1.0) < NEAR for a, b in pairs):
            return unit
    return None
