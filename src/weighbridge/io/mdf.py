"""ASAM MDF: measurement channels, each on the clock of its own group, and bus frames.

Raster functions of the library are not used: resampling would blur the delays
that a calibration has to find.
"""

from __future__ import annotations

import gc
import io
import logging
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any, Final

import numpy as np

from weighbridge.errors import DriveError, MissingExtraError
from weighbridge.io.channels import Channel, Recording, draft_of
from weighbridge.io.columns import UnitlessColumnError, parse_column, unit_suffix
from weighbridge.io.draft import Draft
from weighbridge.io.frames import Frames
from weighbridge.io.info import MDF_INFO_MARK, parse_info
from weighbridge.io.labels import physical_of
from weighbridge.io.log import Log
from weighbridge.io.mapping import (
    MappedSignal,
    TableMapping,
    UnnamedError,
    lacking,
    resolved_unit,
)
from weighbridge.io.mdf_bus import bus_frames
from weighbridge.io.mdf_repair import Repaired, corrected, guard, settle
from weighbridge.io.naming import recognise_all
from weighbridge.io.table import column_list
from weighbridge.messages import phrase
from weighbridge.signals import DriveInfo, Floats, Problem
from weighbridge.signals.cleaning import clean_columns
from weighbridge.signals.tomlfile import Faults
from weighbridge.signals.units import to_si

# Channel groups of bus logging (ASAM MDF 4, bus logging), not of measurements.
_BUS_PREFIXES: Final = ("CAN_", "LIN_", "FLX_", "ETH_", "MOST_")

# Calendars of Python end with the year 9999 [s since 1970].
_LAST_START: Final = 253_402_214_400.0

_Place = tuple[int, int]


def read_mdf(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read measurement channels and CAN frames of an MDF file; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        Not an MDF file, cut off, or neither a known channel nor a CAN frame.
    MissingExtraError
        asammdf is not installed.
    """
    with _file(path) as (file, kept):
        log = _read(file, path, table, mapping)
    if kept:
        log.problems.insert(0, _reported(log, kept))
    return log


def recording_of(path: Path) -> Recording:
    """Hand over the channels of an MDF file and its CAN frames, to draft a mapping.

    Only channels whose name is that of a quantity are read; of the others the name alone.

    Raises
    ------
    DriveError, MissingExtraError
        As of `read_mdf`.
    """
    with _file(path) as (file, kept):
        every, raw_bus = _channels(file)
        channels = {n: p for n, p in every.items() if not n.startswith(_BUS_PREFIXES)}
        found = Recording([], start=_start(file))
        if kept:
            found.notes.append(Problem.of("file.cut_off"))
        found.frames = _frames(file, path) if raw_bus else None
        places = [_longest(file, places) for places in channels.values()]
        units = [_unit_text(file, place) for place in places]
        named = recognise_all(list(channels), [unit_suffix(u) for u in units])
        for name, place, unit, known in zip(channels, places, units, named, strict=True):
            time, values = np.zeros(1), None
            if known.quantity:
                time, values = _samples(file, path, place)
            values = np.full(time.size, np.nan) if values is None else values
            found.channels.append(Channel(name, time, values, unit))
    return found


def draft(path: Path) -> Draft:
    """Draft the mapping of the measurement channels.

    Raises
    ------
    DriveError
        It has none, or none that is known by its name.
    """
    found = recording_of(path)
    if not found.channels and found.frames is not None:
        raise DriveError(
            f"{path} holds CAN frames only: give the DBC of their signals with --dbc; OBD-II and "
            "J1939 are read without one (weighbridge inspect shows)"
        )
    return draft_of(path, found)


@contextmanager
def _file(path: Path) -> Iterator[tuple[Any, str]]:
    """Open an MDF file, and say what is left of one that is damaged; empty of a whole one."""
    try:
        from asammdf import MDF
    except ImportError:
        raise MissingExtraError("asammdf", "mdf", f"reading {path.name}") from None
    try:
        saved = corrected(path)
    except ValueError as e:
        raise _unreadable(path, str(e)) from None
    with (
        warnings.catch_warnings(),
        # Of an unfinished file the library makes a copy, which it leaves behind if that fails.
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
    ):
        warnings.simplefilter("ignore")
        file, kept = _open(MDF, path, saved, folder)
        with file:
            reported = ""
            if saved is not None and saved.damaged:
                if not kept and not saved.unfinished:
                    of = saved.reported
                    records = f"of its {of} records none" if of else "nothing"
                    raise DriveError(
                        f"{path} ends early or is damaged, and {records} is whole; copy it again"
                    )
                reported = phrase("what_is_left")
                if saved.reported:
                    reported = phrase("kept_records", kept=kept, records=saved.reported)
            yield file, reported


def _reported(log: Log, kept: str) -> Problem:
    """Say what was salvaged of a file that was cut off."""
    clocks = [s.time for s in log.signals if len(s)]
    clocks += [log.frames.time] if log.frames is not None and len(log.frames) else []
    span = max((float(c[-1]) for c in clocks), default=0.0) - min(
        (float(c[0]) for c in clocks), default=0.0
    )
    return Problem.of("file.ends_short", file=log.path.name, kept=kept, length=span)


def _open(opener: Any, path: Path, saved: Repaired | None, folder: str) -> tuple[Any, int]:
    """Open the file and count its records; what the library raises becomes one sentence."""
    # The library reports damage with a traceback of its own, beside raising or not.
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)
    hook = sys.unraisablehook
    # A half-opened file complains on standard error once more when it is collected.
    sys.unraisablehook = lambda _: None
    reason = ""
    try:
        guard()
        source = path if saved is None else io.BytesIO(saved.raw)
        with redirect_stdout(io.StringIO()):
            file = opener(
                source,
                temporary_folder=folder,
                # Frames are sorted by identifier there, which takes long and is not used here.
                process_bus_logging=False,
            )
            return file, settle(file)
    # The library's errors are of many kinds, down to struct.error.
    except Exception as e:
        reason = _first_line(e)
    finally:
        if reason:
            gc.collect()
        sys.unraisablehook = hook
    raise _unreadable(path, reason)


def _unreadable(path: Path, reason: str) -> DriveError:
    return DriveError(
        f"{path} is not a readable MDF file ({reason}); it may have been cut off: copy it again"
    )


def _read(file: Any, path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    log = Log(path, start=_start(file), info=_info(file, path))
    channels, raw_bus = _channels(file)
    frames = _frames(file, path) if raw_bus else Frames.empty()
    wanted = (
        _mapped(log, channels, mapping, file) if mapping else _canonical(log, channels, table, file)
    )
    if len(frames):
        log.frames = frames
        # What is no channel may be a signal of the frames.
        log.problems.clear()
        log.lacking.clear()
    if not wanted and len(frames):
        return log
    if not wanted:
        if raw_bus:
            raise DriveError(
                f"{path} holds raw {raw_bus} bus frames and no CAN frame or measurement channel "
                "that is known; decode it to signals first"
            )
        names = column_list(channels) if channels else "no channels"
        hint = f"named in {mapping.source}" if mapping else "with a canonical name"
        raise UnnamedError(f"{path} has no channel {hint}; it has {names}", path)
    clocks: dict[int, list[tuple[str, Floats]]] = {}
    times: dict[int, Floats] = {}
    offset = mapping.time.offset if mapping else 0.0
    for name, (place, suffix, signal) in wanted.items():
        group = place[0]
        time, values = _samples(file, path, place)
        if values is None:
            log.problems.append(Problem.of("file.no_number", name, file=path.name))
            continue
        channel = file.groups[group].channels[place[1]]
        if channel.conversion is not None and (none := int(np.count_nonzero(np.isnan(values)))):
            log.problems.append(
                Problem.of(
                    "file.sentinels",
                    name,
                    file=path.name,
                    count=none,
                    values=values.size,
                    name=channel.name,
                )
            )
        if signal is not None and (signal.factor != 1.0 or signal.offset != 0.0):
            values = values * signal.factor + signal.offset
        times.setdefault(group, time + offset if offset else time)
        clocks.setdefault(group, []).append((name, to_si(values, suffix) if suffix else values))
        log.units[name] = suffix
    for group, columns in clocks.items():
        if times[group].size == 0:
            names = ", ".join(n for n, _ in columns)
            log.problems.append(Problem.of("file.no_samples", file=path.name, names=names))
            continue
        signals, problems = clean_columns(times[group], columns, path.name)
        log.signals += signals
        log.problems += problems
    return log


def _start(file: Any) -> float | None:
    """When the file's clock began [s since 1970]; None where it was not set, or to no date."""
    try:
        start = float(file.header.start_time.timestamp())
    except (AttributeError, OverflowError, OSError, ValueError):
        return None
    return start if 0.0 < start < _LAST_START else None


def _info(file: Any, path: Path) -> DriveInfo | None:
    """What is known of the drive, where `weighbridge.io.write.write_mdf` put it."""
    text = str(getattr(file.header, "description", "") or "")
    return parse_info(text, path.name) if text.startswith(MDF_INFO_MARK) else None


def _frames(file: Any, path: Path) -> Frames:
    try:
        return bus_frames(file)
    # The library's errors on damaged data are of many kinds.
    except Exception as e:
        raise DriveError(
            f"{path}: its bus frames cannot be read ({_first_line(e)}); "
            "the file may have been cut off: copy it again"
        ) from None


def _channels(file: Any) -> tuple[dict[str, list[_Place]], str]:
    """All measurement channels, and the name of the raw bus if one was logged."""
    found: dict[str, list[_Place]] = {}
    raw_bus = ""
    for g, group in enumerate(file.groups):
        master = file.masters_db.get(g)
        for c, channel in enumerate(group.channels):
            if c == master:
                continue
            if channel.name.startswith(_BUS_PREFIXES) and "Frame" in channel.name:
                if group.channel_group.cycles_nr:
                    raw_bus = raw_bus or channel.name.split("_", 1)[0]
                continue
            found.setdefault(channel.name, []).append((g, c))
    return found, raw_bus


def _longest(file: Any, places: list[_Place]) -> _Place:
    return max(places, key=lambda p: int(file.groups[p[0]].channel_group.cycles_nr))


_Wanted = dict[str, tuple[_Place, str, MappedSignal | None]]


def _canonical(
    log: Log, channels: dict[str, list[_Place]], table: str | None, file: Any
) -> _Wanted:
    wanted: _Wanted = {}
    for name, places in channels.items():
        place = _longest(file, places)
        stated = unit_suffix(_unit_text(file, place))
        try:
            found = parse_column(name, table, stated)
        except UnitlessColumnError as e:
            raise DriveError(f"{log.path}: channel {name!r} {e}") from None
        if found is None:
            continue
        quantity, suffix = found
        if quantity.name not in wanted:
            wanted[quantity.name] = (place, suffix, None)
            _note_choice(log, name, places)
    return wanted


def _mapped(
    log: Log, channels: dict[str, list[_Place]], mapping: TableMapping, file: Any
) -> _Wanted:
    wanted: _Wanted = {}
    faults = Faults()
    plain = {name.strip().casefold(): name for name in channels}
    for s in mapping.signals:
        name = s.column if s.column in channels else plain.get(s.column.strip().casefold())
        if name is None:
            if not s.optional:
                log.lacking.append(lacking(f"{log.path.name}: channel", s, mapping.source))
            continue
        place = _longest(file, channels[name])
        stated = unit_suffix(_unit_text(file, place))
        with faults.gathered():
            wanted[s.name] = (place, resolved_unit(s, stated, mapping.source), s)
        _note_choice(log, name, channels[name])
    faults.refuse()
    return wanted


def _note_choice(log: Log, name: str, places: list[_Place]) -> None:
    if len(places) > 1:
        log.problems.append(
            Problem.of("file.channel_twice", file=log.path.name, name=name, count=len(places))
        )


def _unit_text(file: Any, place: _Place) -> str:
    channel = file.groups[place[0]].channels[place[1]]
    if channel.unit:
        return str(channel.unit)
    conversion = channel.conversion
    return str(conversion.unit) if conversion is not None and conversion.unit else ""


def _samples(file: Any, path: Path, place: _Place) -> tuple[Floats, Floats | None]:
    """Time and physical values of one channel, samples marked invalid left out as NaN."""
    group = file.groups[place[0]]
    try:
        # asammdf does not come back from packed data of which no record is to be read.
        if not group.channel_group.cycles_nr:
            return np.empty(0), np.empty(0)
        found = file.get(group=place[0], index=place[1], ignore_invalidation_bits=True)
    except Exception as e:
        raise DriveError(
            f"{path}: channel group {place[0]} cannot be read ({_first_line(e)}); "
            "the file may have been cut off: copy it again"
        ) from None
    time = np.array(found.timestamps, dtype=np.float64)
    if found.samples.ndim != 1:
        return time, None
    if found.samples.dtype.kind in "SUO":
        values = _labelled(file, place, found.samples)
        if values is None:
            return time, None
    elif found.samples.dtype.kind in "biuf":
        values = np.array(found.samples, dtype=np.float64)
    else:
        return time, None
    if found.invalidation_bits is not None:
        values[np.asarray(found.invalidation_bits, dtype=bool)] = np.nan
    return time, values


def _labelled(file: Any, place: _Place, texts: np.ndarray) -> Floats | None:
    """Numbers of a channel whose conversion gives texts; None where it records texts."""
    raw = file.get(group=place[0], index=place[1], raw=True, ignore_invalidation_bits=True).samples
    if raw.ndim != 1 or raw.dtype.kind not in "biuf" or raw.size != texts.size:
        return None
    return physical_of(raw.astype(np.float64), texts)[0]


def _first_line(error: Exception) -> str:
    text = str(error).strip().split("\n", 1)[0]
    return text or type(error).__name__
