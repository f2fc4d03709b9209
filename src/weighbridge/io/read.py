"""Read a drive: a folder of tables, one file, or several files that belong together."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from weighbridge.errors import ConfigError, DriveError
from weighbridge.io import tabular
from weighbridge.io.clocks import settle_clocks, shift_clock
from weighbridge.io.dbc import Database, DbcSource, load_dbcs
from weighbridge.io.filled_positions import true_fixes
from weighbridge.io.format import Format, Takes
from weighbridge.io.formats import format_of, is_log, suffixes, unreadable
from weighbridge.io.frames import Frames, join_frames, settle_clock
from weighbridge.io.info import FILE_NAME as INFO_NAME
from weighbridge.io.info import read_info
from weighbridge.io.log import Log
from weighbridge.io.mapping import (
    MappingSource,
    TableMapping,
    UnnamedError,
    how_to_name,
    load_mapping,
    mapping_for,
    named_dbcs,
    none_fits,
)
from weighbridge.io.parquet import read_parquet
from weighbridge.io.parts import part_folders, read_parts
from weighbridge.io.paths import given_paths, is_folder
from weighbridge.io.quiet import PARSE_ERRORS, first_line
from weighbridge.io.repeats import joined_signal, settle_repeats
from weighbridge.io.table import read_text, start_text
from weighbridge.signals import (
    NO_DRIVE,
    QUANTITIES,
    Drive,
    DriveInfo,
    Floats,
    Problem,
    Signal,
    numbered,
    parted,
)
from weighbridge.signals.catalogue import TABLES
from weighbridge.visible import visible
from weighbridge.whole import REPLACING

_logger = logging.getLogger(__name__)

DrivePath = str | Path | Sequence[str | Path]


# The dates that logs of one recording begin with are rounded, to a second in some ASC [s].
_ROUNDING: Final = 1.0

TRUTH_NAME: Final = "truth"
"""Table of a simulated drive's truth: never read as a signal."""


def read_drive(
    path: DrivePath,
    mapping: MappingSource | None = None,
    dbc: DbcSource | Sequence[DbcSource] = (),
) -> Drive:
    """Read one drive, each signal on its own clock and in SI.

    Parameters
    ----------
    path : a folder of the tables ``imu``, ``obd``, ``gnss``, ``ride`` (CSV or
        Parquet, with or without ``drive.toml``), one file, or several files
        that belong to one drive
    mapping : mapping TOML, or a dictionary of the same form, for files whose
        columns have other names or units than the canonical ones, and for the
        signals of a DBC
    dbc : one or several DBC files for raw bus logs; ``1:file.dbc`` is for bus 1 alone; those that
        the mapping names when none is given

    Returns
    -------
    Drive
        Its ``problems`` list what was left out.

    Raises
    ------
    DriveError
        The path does not exist, a file cannot be read, or a column cannot be
        understood.
    ConfigError
        The mapping cannot be used.
    """
    name, logs, info, mappings, databases = _opened(path, mapping, dbc)
    return joined_drive(name, logs, info, mappings, databases)


def read_drives(
    path: DrivePath,
    mapping: MappingSource | None = None,
    dbc: DbcSource | Sequence[DbcSource] = (),
) -> list[Drive]:
    """Read the drives of a recording, such as a file of a whole day or several joined drives.

    A drive ends where nothing is recorded for 5 minutes, where the vehicle means 10, where
    speed, position or coolant jump as no vehicle's do, and where a table's clock begins anew.

    Parameters
    ----------
    path, mapping, dbc : as of `read_drive`

    Returns
    -------
    In order; one where there is one alone. Of several each is named ``NAME part 1 of 3``, and
    parts in which the vehicle hardly moves are left out.

    Raises
    ------
    DriveError, ConfigError
        As of `read_drive`.
    """
    name, logs, info, mappings, databases = _opened(path, mapping, dbc)
    if len(logs) == 1 and logs[0].pieces:
        pieces = [joined_drive(name, [log], info, mappings, databases) for log in logs[0].pieces]
        parts = [part for piece in pieces for part in parted(piece)]
        return list(numbered(visible(name), parts, "clocks that begin anew"))
    return list(parted(joined_drive(name, logs, info, mappings, databases)))


_Opened = tuple[str, list[Log], DriveInfo, tuple[TableMapping, ...], tuple[Database, ...]]


def _opened(
    path: DrivePath, mapping: MappingSource | None, dbc: DbcSource | Sequence[DbcSource]
) -> _Opened:
    """Name of a drive, its files, and what they are read with."""
    if not isinstance(path, str | Path):
        path = given_paths("path", path)
    mappings = load_mapping(mapping) if mapping is not None else ()
    asked = given_paths("dbc", [dbc] if isinstance(dbc, str | Path) else dbc)
    databases = load_dbcs(asked or named_dbcs(mappings))
    info = DriveInfo()
    if not isinstance(path, str | Path):
        paths = [Path(p) for p in path]
        if not paths:
            raise DriveError("no file was given: name a folder or at least one file")
        if len(paths) > 1:
            name = f"{paths[0].stem}+{len(paths) - 1}"
            logs = _read_files([(p, None) for p in paths], mappings)
            return name, logs, info, mappings, databases
        path = paths[0]
    path = Path(path)
    if is_folder(path):
        logs, info = _read_folder(path, mappings)
        return path.resolve().name, logs, info, mappings, databases
    return path.stem, _read_files([(path, None)], mappings), info, mappings, databases


def read_table(path: str | Path) -> dict[str, Floats]:
    """Read all columns of a CSV or Parquet table as they are, such as a truth table.

    Parameters
    ----------
    path : the file

    Returns
    -------
    (n,) values by column name; NaN where a cell is empty

    Raises
    ------
    DriveError
        No such file, or not a table of numbers.
    """
    path = Path(path)
    if is_folder(path) or not path.is_file():
        raise DriveError(f"{path}: no such file")
    raw = read_parquet(path) if path.suffix.lower() in (".parquet", ".pq") else read_text(path)
    return {name: raw.numbers(i)[0] for i, name in enumerate(raw.names)}


def _read_folder(folder: Path, mappings: tuple[TableMapping, ...]) -> tuple[list[Log], DriveInfo]:
    try:
        inside = sorted(folder.iterdir())
    except OSError as e:
        raise DriveError(f"{folder} cannot be read: {e.strerror or e}") from None
    unfinished = next((f for f in inside if f.name.startswith(REPLACING)), None)
    if unfinished is not None:
        raise DriveError(
            f"{folder}: the program was stopped while it replaced this drive; the drive before is "
            f"in {unfinished / 'old'}, the new one here and in {unfinished}: keep the tables of "
            "one of them and remove that folder"
        )
    logs_there = [f for f in inside if is_log(f)]
    for f in logs_there:
        if f.stem.lower() in TABLES and not f.is_file():
            kind = "a folder" if f.is_dir() else "a link that leads nowhere, or a device"
            raise DriveError(f"{f} is {kind}: a table is one file; put it there, or remove this")
    files = [f for f in logs_there if f.is_file()]
    files = [f for f in files if f.stem.lower() != TRUTH_NAME]
    info_path = folder / INFO_NAME
    if info_path in inside and not info_path.is_file():
        raise DriveError(f"{info_path} is no file: put the file there, or remove this")
    info = read_info(info_path) if info_path in inside else DriveInfo()
    parts = [read_parts(where, table) for table, where in part_folders(folder).items()]
    tables: dict[str, Path] = {}
    for f in files:
        table = f.stem.lower()
        if table in TABLES and not mapping_for(f, mappings):
            if table in tables:
                raise DriveError(
                    f"{folder} has {tables[table].name} and {f.name}; keep one of them"
                )
            tables[table] = f
    if tables and not mappings:
        others = [f for f in files if f not in tables.values() and _self_described(f)]
        known = [*((f, t) for t, f in tables.items()), *((f, None) for f in others)]
        return _read_known(folder, known, (), files) + parts, info
    if not files and not parts:
        raise DriveError(
            f"{folder} holds no drive: it needs at least one of "
            f"{', '.join(f'{t}.csv' for t in TABLES)} (or .parquet), "
            f"or one log ({', '.join(suffixes())})"
        )
    if mappings:
        there = files
        files = [
            f
            for f in there
            if f.stem.lower() in TABLES or mapping_for(f, mappings) or _self_described(f)
        ]
        if not files and not parts:
            raise none_fits(folder, there, mappings)
    else:
        there = files
    return _read_known(folder, [(f, None) for f in files], mappings, there) + parts, info


def _read_known(
    folder: Path,
    known: Sequence[tuple[Path, str | None]],
    mappings: tuple[TableMapping, ...],
    there: Sequence[Path],
) -> list[Log]:
    """Read the files of a folder that can be read, and report others there that look like logs."""
    try:
        logs = _read_files(known, mappings)
    except UnnamedError as error:
        if mappings or len(there) == 1:
            raise
        # One mapping is for all files of the folder.
        raise DriveError(f"{error.what}: {how_to_name(folder)}") from None
    source = mappings[0].source if mappings else ""
    others = [f for f in there if f not in {path for path, _ in known}]
    if logs and others:
        from weighbridge.io.left_out import left_out

        logs[0].problems += left_out(folder, others, source)
    return logs


def _read_files(
    files: Sequence[tuple[Path, str | None]], mappings: tuple[TableMapping, ...]
) -> list[Log]:
    """Read the files of one drive, each with the canonical table it is known to be."""
    known = [(path, table, _format(path)) for path, table in files]
    pairs = [(path, form, m) for path, _, form in known if (m := mapping_for(path, mappings))]
    for path, form, mapping in pairs:
        section = form.unusable(mapping)
        # What a mapping for all files says may be meant for another of them.
        others = (f for p, f, m in pairs if m is mapping and p != path)
        if section and not (mapping.files == "*" and any(not f.unusable(mapping) for f in others)):
            raise ConfigError(
                f"{mapping.source}: {path.name} is {form.name}, which has no use for {section}; "
                f"it takes {form.takes.value}: remove the rest, or give it another [tables] section"
            )
    return [_read_file(path, table, form, mappings) for path, table, form in known]


def _format(path: Path) -> Format:
    """Format of a file.

    Raises
    ------
    DriveError
        No plain file, or of no format that is known.
    """
    if is_folder(path):
        raise DriveError(f"{path} is a folder; give it alone, or name files only")
    if not path.is_file():
        raise DriveError(f"{path} is no file: a device or a pipe cannot be read as a drive")
    try:
        found = format_of(path)
    except OSError as e:
        raise DriveError(f"{path} cannot be read: {e.strerror or e}") from None
    if found is None:
        raise DriveError(unreadable(path))
    return found


def _self_described(path: Path) -> bool:
    return _format(path).self_described


def _read_file(
    path: Path, table: str | None, form: Format, mappings: tuple[TableMapping, ...]
) -> Log:
    if table is None and path.stem.lower() in TABLES:
        table = path.stem.lower()
    mapping = mapping_for(path, mappings)
    if mappings and mapping is None and table is None and not form.self_described:
        raise DriveError(
            f"{path}: no [tables] section of {mappings[0].source} has a pattern "
            "in files that fits its name"
        )
    names = mapping is not None and bool(mapping.signals or form.self_described)
    read = form.read
    if form.takes is Takes.PLAIN and names:
        read = tabular.read_csv
    # A mapping that names nothing may still show how a text table is written.
    taken = mapping if names or form.takes is Takes.TEXT else None
    try:
        log = read(path, table, taken)
    except OSError as e:
        raise DriveError(f"{path} cannot be read: {e.strerror or e}") from None
    except PARSE_ERRORS as e:
        raise DriveError(f"{path} cannot be read ({first_line(e)}); copy it again") from None
    if unknown := next((s.name for s in log.signals if s.name not in QUANTITIES), ""):
        raise DriveError(
            f"{path}: the reader of {form.name} hands over {unknown!r}, which is no signal of "
            "weighbridge.signals.QUANTITIES; correct its name in that package"
        )
    if mapping is not None:
        log.align = mapping.time.align
        log.placed = mapping.time.offset != 0.0
        if not names:
            shift_clock(log, mapping.time.offset)
        if log.frames is not None:
            log.frames = replace(log.frames, time=log.frames.time + mapping.time.offset)
    _logger.debug("%s: %d signals", path, len(log.signals))
    return log


def joined_drive(
    name: str,
    logs: list[Log],
    info: DriveInfo,
    mappings: tuple[TableMapping, ...],
    databases: tuple[Database, ...],
) -> Drive:
    """Join what several files hold into one drive, on one clock.

    Parameters
    ----------
    name : of the drive
    logs : what was read of each file
    info : what is known besides the signals
    mappings, databases : what the files were read with

    Raises
    ------
    DriveError
        They hold no samples.
    """
    if info == DriveInfo():
        info = next((log.info for log in logs if log.info is not None), info)
    trusted = (s.name for m in mappings for s in m.signals if s.trusted)
    info = replace(info, trusted=tuple(dict.fromkeys((*info.trusted, *trusted))))
    _share_clock(logs)
    contents = _decode_frames(logs, mappings, databases)
    problems = [p for log in logs for p in log.problems]
    parts: dict[str, list[tuple[Log, Signal]]] = {}
    problems += settle_clocks(logs)
    problems += settle_repeats(logs)
    info = _rebase(logs, info)
    for log in logs:
        for s in log.signals:
            parts.setdefault(s.name, []).append((log, s))
    problems += [replace(p, serious=p.signal not in parts) for log in logs for p in log.lacking]
    if not parts:
        files = ", ".join(log.path.name for log in logs)
        why = f" ({problems[0].text})" if problems else ""
        raise DriveError(
            f"{name} holds no samples: every table ({files}) is empty{why}; record it again"
        )
    joined: dict[tuple[int, ...], Floats] = {}
    signals = {n: p[0][1] if len(p) == 1 else joined_signal(n, p, joined) for n, p in parts.items()}
    signals, filled = true_fixes(signals)
    problems += filled
    drive = Drive(
        name=visible(name),
        signals=signals,
        info=info,
        problems=tuple(problems),
        contents=contents,
        units={n: u for log in logs for n, u in log.units.items() if n in signals},
    )
    _logger.info("%s: %d signals over %.0f s", name, len(signals), drive.duration)
    return drive


def _share_clock(logs: Sequence[Log]) -> None:
    """Let clocks count from 1970 where all files show when theirs began.

    A file of measurement channels alone keeps its own clock, as its makers know it.
    """
    if len(logs) == 1 and logs[0].frames is None:
        return
    if not all(log.absolute or log.start is not None for log in logs):
        return
    for log in logs:
        if log.absolute or log.start is None:
            continue
        shift_clock(log, log.start)
        if log.frames is not None:
            log.frames = replace(log.frames, time=log.frames.time + log.start)
        log.absolute = True


def _decode_frames(
    logs: list[Log], mappings: tuple[TableMapping, ...], databases: tuple[Database, ...]
) -> tuple[str, ...]:
    """Turn the raw frames of all files into signals of the first; return what they held."""
    raw = [log for log in logs if log.frames is not None]
    if not raw:
        return ()
    if len({log.absolute for log in raw}) > 1:
        other = next(log for log in raw if not log.absolute)
        raise DriveError(
            f"{other.path.name} counts seconds and the other logs have dates: "
            "give files of one logger, or read them as drives of their own"
        )
    parts = []
    for log in raw:
        frames, problems = settle_clock(log.frames or Frames.empty(), log.path.name)
        log.frames = None
        log.problems += problems
        parts.append((log, frames))
    parts.sort(key=lambda p: float(p[1].time[0]) if len(p[1]) else 0.0)
    for (log_a, a), (log_b, b) in pairwise(parts):
        if _overlap(a, b) > _ROUNDING and set(a.counts()) & set(b.counts()):
            raise DriveError(
                f"{log_a.path} and {log_b.path} hold the same frames at the same time; read them "
                "as drives of their own, or leave one out"
            )
    first = parts[0][0]
    name = first.path.name + (f" and {len(parts) - 1} more" if len(parts) > 1 else "")
    mapping = next((m for log in raw if (m := mapping_for(log.path, mappings))), None)
    joined = join_frames([frames for _, frames in parts])
    known = {s.name for log in logs for s in log.signals}
    from weighbridge.io.bus import decode

    try:
        found = decode(joined, name, mapping, databases)
    except DriveError as error:
        if not known:
            raise
        first.problems.append(replace(Problem.from_error(error), serious=False))
        return ()
    first.units |= found.units
    first.problems += found.problems
    first.lacking += found.lacking
    for signal in found.signals.values():
        if signal.name in known:
            first.problems.append(
                Problem.of("bus.of_another_table", signal.name, file=name, values=len(signal))
            )
        else:
            first.signals.append(signal)
    return tuple(found.contents)


def _overlap(a: Frames, b: Frames) -> float:
    """How long both of two recordings ran, the earlier one first; 0 where one is too short [s]."""
    if not (len(a) and len(b)):
        return 0.0
    both = float(min(a.time[-1], b.time[-1]) - b.time[0])
    span = float(min(a.time[-1] - a.time[0], b.time[-1] - b.time[0]))
    return math.inf if 0.0 <= 0.5 * span < both else both


def _begin(time: Floats) -> float:
    """First stamp of the recording that the middle stamp of a clock is in [s]."""
    with np.errstate(over="ignore"):
        jumps = np.flatnonzero(np.diff(time[: time.size // 2 + 1]) > NO_DRIVE)
    return float(time[jumps[-1] + 1 if jumps.size else 0])


def _rebase(logs: Sequence[Log], info: DriveInfo) -> DriveInfo:
    """Count from the drive's first full second where clocks count from 1970."""
    filled = [log for log in logs if log.signals]
    absolute = [log for log in filled if log.absolute]
    if not absolute:
        return info
    start = float(math.floor(min(_begin(s.time) for log in absolute for s in log.signals)))
    for log in absolute:
        shift_clock(log, -start)
    return info if info.start_time is not None else replace(info, start_time=start_text(start))
