"""Files of one logger that read alike, such as one a day: one mapping for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from weighbridge.io.draft import Draft
from weighbridge.io.draft_column import DraftColumn, gyro_checked


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
    return replace(first, columns=columns, doubts=tuple(doubts), files=len(drafts))


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
