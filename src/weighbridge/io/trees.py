"""Files of named arrays in groups (MATLAB, HDF5, TDMS): which array is the time of which.

The time of an array is one beside it, or in a group above, that is called a time and is as long.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from weighbridge.errors import ConfigError
from weighbridge.io.channels import Channel, Recording
from weighbridge.io.columns import time_unit, unit_suffix
from weighbridge.io.draft_time import guessed_time_unit
from weighbridge.io.mapping import TimeColumn
from weighbridge.io.naming import is_time, unit_of
from weighbridge.io.table import column_list, since_1970
from weighbridge.messages import Problem
from weighbridge.signals import UNITS, Floats

# Names of what a group holds that is called by the group's own name.
_CONTENTS: Final = frozenset(("data", "value", "values"))
_UNIT_KEYS: Final = frozenset(("unit", "units"))

# Simulink calls the times of its outputs so.
_TIMES: Final = frozenset(("tout", "time", "t"))

# Columns of an array that are channels of their own; a wider one is a picture or a spectrum.
_MOST_COLUMNS: Final = 32


@dataclass(frozen=True, slots=True)
class Leaf:
    """One array.

    Attributes
    ----------
    values : (n,), (n, k) or (k, n), of numbers or dates
    unit : as the file states it; empty where it does not
    time : (n,) its own clock [s]; None where another array holds it
    """

    values: NDArray[Any]
    unit: str = ""
    time: Floats | None = None


Tree: TypeAlias = "Mapping[str, Tree | Leaf]"


@dataclass(frozen=True, slots=True)
class _Clock:
    name: str
    seconds: Floats
    absolute: bool
    unit: str


def recording_of(path: Path, tree: Tree, time: TimeColumn) -> Recording:
    """Make channels of a tree of arrays.

    Parameters
    ----------
    path : the file, for messages
    tree : groups by name, and arrays
    time : what a mapping says of the time: its ``column`` is an array's name, or its place with
        ``/`` between the groups

    Raises
    ------
    ConfigError
        The mapping names a time that is not there.
    """
    found = Recording([])
    clockless: list[str] = []
    clocks: list[_Clock] = []
    even: dict[int, Floats] = {}
    for name, leaf, near in _leaves(tree, "", (), time, found, clocks):
        if leaf.time is not None:
            found.channels.append(Channel(name, leaf.time, leaf.values, leaf.unit))
            continue
        clock = next((c for c in near if c.seconds.size == leaf.values.size), None)
        if clock is None and time.rate is not None and time.column is None:
            count = leaf.values.size
            rows = even.setdefault(count, np.arange(count) / time.rate)
            found.channels.append(Channel(name, rows, leaf.values, leaf.unit))
        elif clock is None:
            clockless.append(name)
        else:
            found.channels.append(Channel(name, clock.seconds, leaf.values, leaf.unit))
    if time.column is not None and not clocks:
        raise ConfigError(
            f"{path.name}: [time] column {time.column!r} of the mapping is no array of rising "
            f"numbers in it; it has {column_list([*clockless, *(c.name for c in found.channels)])}"
        )
    if clocks:
        best = max(clocks, key=lambda c: c.seconds.size)
        names = {c.name.rsplit("/", 1)[-1] for c in clocks}
        # Where groups call their times differently, each is found by its own name.
        found.time = time.column or (names.pop() if len(names) == 1 else "")
        found.time_unit = best.unit if found.time and best.unit else ""
        found.absolute = all(c.absolute for c in clocks)
    if clockless:
        found.notes.append(Problem.of("file.clockless", names=column_list(clockless, 6)))
    return found


def _leaves(
    tree: Tree,
    prefix: str,
    above: tuple[_Clock, ...],
    time: TimeColumn,
    found: Recording,
    clocks: list[_Clock],
) -> Iterator[tuple[str, Leaf, tuple[_Clock, ...]]]:
    """Arrays of a group and those below, without the times, each with the clocks near it."""
    arrays = {n: x for n, x in tree.items() if isinstance(x, Leaf)}
    here = []
    for name, leaf in arrays.items():
        if _is_clock(f"{prefix}{name}", name, time):
            clock = _clock(f"{prefix}{name}", leaf, time, found)
            here += [clock] if clock is not None else []
    near = (*here, *above)
    clocks += here
    taken = {c.name for c in here}
    content = [n for n in arrays if n.lower() in _CONTENTS]
    for name, leaf in arrays.items():
        place = f"{prefix}{name}"
        if place in taken:
            continue
        if content == [name] and prefix:
            place = prefix.removesuffix("/")
        for k, column in enumerate(_columns(leaf.values)):
            many = leaf.values.squeeze().ndim > 1
            yield (f"{place}.{k}" if many else place), Leaf(column, leaf.unit, leaf.time), near
    for name, below in tree.items():
        if not isinstance(below, Leaf):
            yield from _leaves(below, f"{prefix}{name}/", near, time, found, clocks)


def _is_clock(place: str, name: str, time: TimeColumn) -> bool:
    if time.column is not None:
        return time.column.casefold() in (place.casefold(), name.casefold())
    if time.rate is not None:
        return False
    return name.lower() in _TIMES or is_time(name) or time_unit(name) is not None


def _clock(place: str, leaf: Leaf, time: TimeColumn, found: Recording) -> _Clock | None:
    """Read an array as a time; None where it cannot be one."""
    values = leaf.values.squeeze()
    if values.ndim != 1 or values.size < 2:
        return None
    if values.dtype.kind == "M":
        seconds = values.astype("datetime64[us]").astype(np.int64) * 1e-6
        return _Clock(place, np.where(np.isnat(values), np.nan, seconds), True, "")
    if values.dtype.kind not in "iuf":
        return None
    numbers = values.astype(np.float64)
    known = numbers[np.isfinite(numbers)]
    if known.size < 2 or known[-1] <= known[0]:
        return None
    name = place.rsplit("/", 1)[-1]
    stated = unit_suffix(leaf.unit) or unit_of(name)[0] or time_unit(name)
    if time.rate is not None:
        return _Clock(place, numbers / time.rate, False, "")
    unit = time.unit or (stated if stated and UNITS[stated].dimension == "s" else None)
    if unit is None:
        unit, doubt = guessed_time_unit(name, known)
        found.notes += [doubt] if doubt is not None else []
    seconds = numbers * UNITS[unit].factor
    return _Clock(place, seconds, since_1970(seconds), unit)


def _columns(values: NDArray[Any]) -> list[Floats]:
    """Channels of an array of numbers: itself, or its columns where it is longer than wide."""
    if values.dtype.kind not in "biuf":
        return []
    values = values.squeeze()
    if values.ndim == 1:
        return [values.astype(np.float64)]
    if values.ndim != 2:
        return []
    rows = values if values.shape[0] >= values.shape[1] else values.T
    if rows.shape[1] > _MOST_COLUMNS:
        return []
    return [np.ascontiguousarray(rows[:, k], dtype=np.float64) for k in range(rows.shape[1])]


def unit_beside(group: Mapping[str, Any]) -> str:
    """Unit that a text beside an array states; empty for none."""
    for key, value in group.items():
        if key.lower() in _UNIT_KEYS and isinstance(value, str):
            return value.strip()
    return ""
