"""Instants of a drive in words."""

from __future__ import annotations

import datetime as dt
from typing import Final

_DATES: Final = 1e8
"""From here on an instant is a date [s since 1970]: no drive lasts three years."""

_LAST: Final = 4e9
"""No computer shows a later date: the year 2096 [s since 1970]."""


def instant(time: float) -> str:
    """Write an instant of a drive: in seconds, or as a time of day where its clock has a date.

    Parameters
    ----------
    time : by the drive's clock [s]
    """
    return _of_day(time) if _DATES <= time < _LAST else f"{time:.6g} s"


def span(start: float, end: float) -> str:
    """Write two instants of a drive, as ``instant`` does."""
    if _DATES <= start <= end < _LAST:
        return f"{_of_day(start)} to {_of_day(end)}"
    return f"{start:.6g} to {end:.6g} s"


def _of_day(time: float) -> str:
    """Time of day where the computer is."""
    return f"{dt.datetime.fromtimestamp(time):%H:%M:%S}"
