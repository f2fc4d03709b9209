"""What the drafts of several files of one drive or logger say together."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from weighbridge.io.draft import Draft, known_quantities
from weighbridge.io.draft_column import DraftColumn, gyro_checked
from weighbridge.io.draft_unit import NEAR, SLOWEST, SPEEDS
from weighbridge.io.file_patterns import file_patterns, undated
from weighbridge.io.naming import words_of
from weighbridge.io.table import column_list
from weighbridge.io.vocabulary import WORDS, words_in
from weighbridge.signals import UNITS


def merged(drafts: Sequence[Draft]) -> Draft | None:
    """Return one draft for files that read alike; None where they differ.

    A unit that no file states is the one that the file with the largest values shows.

    Parameters
    ----------
    drafts : of the files
    """
    first = drafts[0]
    if any(_layout(one) != _layout(first) for one in drafts[1:]):
        return None
    together = zip(*(one.columns for one in drafts), strict=True)
    questions = dict.fromkeys(question for one in drafts for question in one.questions)
    columns = gyro_checked(tuple(map(_widest, together)))
    alike = tuple(path for one in drafts for path in (one.path, *one.alike))[1:]
    return replace(first, columns=columns, questions=tuple(questions), alike=alike)


def kinds(drafts: Sequence[Draft], others: Sequence[Path] = ()) -> list[Draft]:
    """Return one draft for each kind of file, where patterns of names distinguish the kinds.

    Parameters
    ----------
    drafts : of the files
    others : files beside them that no draft is of

    Returns
    -------
    In the order of their first files; ``drafts`` where names do not distinguish the kinds.
    """
    beside = [path.name for path in others]
    # Vehicles whose files read alike may have names that only show each of them from the others.
    for group in (_layout, _layout_and_name):
        found = [joined for each in _grouped(drafts, group) if (joined := merged(each)) is not None]
        alone = len(found) == 1 and not others
        if alone or file_patterns([kind.names for kind in found], beside):
            return found
    return list(drafts)


def _grouped(drafts: Sequence[Draft], by: Callable[[Draft], object]) -> list[list[Draft]]:
    """Put together what has the same key, in the order of the first of each."""
    groups: list[tuple[object, list[Draft]]] = []
    for one in drafts:
        key = by(one)
        group = next((g for other, g in groups if other == key), None)
        if group is None:
            groups.append((key, [one]))
        else:
            group.append(one)
    return [group for _, group in groups]


def _layout_and_name(one: Draft) -> tuple[object, ...]:
    return _layout(one), undated(one.path.name)


def _layout(one: Draft) -> tuple[object, ...]:
    """What files have to share for one mapping: all but units that were found from values."""
    columns = tuple((c.name, c.quantity, c.valid, c.stated and c.unit) for c in one.columns)
    time = (one.time, one.time_unit, one.time_format, str(one.row_rate))
    return one.path.suffix, one.text, time, columns


def _widest(columns: Sequence[DraftColumn]) -> DraftColumn:
    """One column of all files: its unit is shown by the largest values."""
    reported = max(columns, key=lambda c: max(abs(c.low), abs(c.high)))
    if not reported.quantity:
        return reported
    return replace(
        reported,
        low=min(c.low for c in columns),
        high=max(c.high for c in columns),
        count=sum(c.count for c in columns),
    )


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


_SENSORS: Final = {
    "accelerometer": ("accel_x", "accel_y", "accel_z", "longitudinal_accel"),
    "gyroscope": ("gyro_x", "gyro_y", "gyro_z"),
    "engine_speed": ("engine_speed",),
}
"""What a drive is weighed by, and its quantities."""

_WITHOUT_GRAVITY: Final = WORDS["without_gravity"] | WORDS["calculated"]
"""Words of an acceleration that has no gravity in it."""

_SHOWN: Final = 4
"""Columns named at most."""


def missing(drafts: Sequence[Draft]) -> Iterator[str]:
    """Say of which sensor no column was taken, though columns that were not taken look like it.

    Parameters
    ----------
    drafts : of all files of a drive
    """
    known = known_quantities(drafts)
    left = [(one, c.name) for one in drafts for c in one.columns if not c.quantity]
    for sensor, words in words_in("sensors").items():
        quantities = _SENSORS[sensor]
        if known & set(quantities):
            continue
        alike = [(one, name) for one, name in left if set(words) & set(words_of(name))]
        if not alike:
            continue
        names = column_list(dict.fromkeys(name for _, name in alike), _SHOWN)
        of = f"no column of {alike[0][0].path.name} was taken for the {sensor.replace('_', ' ')}"
        if all(_WITHOUT_GRAVITY & set(words_of(name)) for _, name in alike):
            yield f"{of}: {names} have no gravity in them; record the raw accelerometer"
            continue
        yield (
            f"{of}, though {names} may be its: if so, name it in the mapping as "
            f"{' or '.join(quantities[:3])}, with its unit"
        )
