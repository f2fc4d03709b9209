"""Files of one logger that read alike, such as one a day: one mapping for all of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from weighbridge.io.draft import Draft
from weighbridge.io.draft_column import DraftColumn, gyro_checked
from weighbridge.io.file_patterns import file_patterns, undated


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
