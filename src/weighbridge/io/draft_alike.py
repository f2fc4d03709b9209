"""Files of one logger that read alike, such as one a day: one mapping for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from weighbridge.io.draft import Draft
from weighbridge.io.draft_column import DraftColumn, gyro_checked
from weighbridge.io.file_patterns import file_patterns


def merged(drafts: Sequence[Draft]) -> Draft | None:
    """Return one draft for files that read alike; None where they differ.

    A unit that no file states is the one that the file with the largest values tells.

    Parameters
    ----------
    drafts : of the files
    """
    first = drafts[0]
    if any(_layout(one) != _layout(first) for one in drafts[1:]):
        return None
    together = zip(*(one.columns for one in drafts), strict=True)
    doubts = dict.fromkeys(doubt for one in drafts for doubt in one.doubts)
    columns = gyro_checked(tuple(map(_widest, together)))
    alike = tuple(path for one in drafts for path in (one.path, *one.alike))[1:]
    return replace(first, columns=columns, doubts=tuple(doubts), alike=alike)


def kinds(drafts: Sequence[Draft], others: Sequence[Path] = ()) -> list[Draft]:
    """Return one draft for each kind of file, where patterns of names tell the kinds apart.

    Parameters
    ----------
    drafts : of the files
    others : files beside them that no draft is of

    Returns
    -------
    In the order of their first files; ``drafts`` where names do not tell the kinds apart.
    """
    groups: list[list[Draft]] = []
    for one in drafts:
        known = (g for g in groups if _layout(g[0]) == _layout(one))
        group = next(known, None)
        if group is None:
            groups.append([one])
        else:
            group.append(one)
    found = [joined for group in groups if (joined := merged(group)) is not None]
    names = [kind.names for kind in found]
    alone = len(found) == 1 and not others
    apart = alone or file_patterns(names, [path.name for path in others])
    return found if apart else list(drafts)


def _layout(one: Draft) -> tuple[object, ...]:
    """What files have to share for one mapping: all but units that were found from values."""
    columns = tuple((c.name, c.quantity, c.valid, c.stated and c.unit) for c in one.columns)
    time = (one.time, one.time_unit, one.time_format, str(one.row_rate))
    return one.path.suffix, one.text, time, columns


def _widest(columns: Sequence[DraftColumn]) -> DraftColumn:
    """One column of all files: its unit is told by the largest values."""
    told = max(columns, key=lambda c: max(abs(c.low), abs(c.high)))
    if not told.quantity:
        return told
    return replace(
        told,
        low=min(c.low for c in columns),
        high=max(c.high for c in columns),
        count=sum(c.count for c in columns),
    )
