"""Where results go: never over what is read, nor over what is no result of the same kind."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from weighbridge.cli.terminal import say_json
from weighbridge.errors import ConfigError, WeighbridgeError
from weighbridge.whole import is_stream, refuse_unwritable_place, write_whole

Kind = Literal[
    "report",
    "list of items",
    "JSON file",
    "track",
    "track of a ride",
    "layout",
    "table of legs",
    "table of masses",
    "vehicle file",
    "mapping",
    "MF4",
    "state",
]

# What a file of each kind shows at its beginning.
_BEGINS: Final[dict[Kind, re.Pattern[bytes]]] = {
    "report": re.compile(rb"\A\s*<(?:!doctype\s+html|html)\b", re.IGNORECASE),
    "list of items": re.compile(rb"\A# The papers, row by row\b"),
    "JSON file": re.compile(rb"\A\s*\{"),
    # Columns that no drive has and no truth; a Parquet file names them within its first page.
    # An MCAP names its writer.
    "track": re.compile(
        rb"\A[^\r\n]*\btime_s\b[^\r\n]*\bstd_kg\b|\A\x89MCAP0\r\n.{0,64}?weighbridge", re.DOTALL
    ),
    "track of a ride": re.compile(rb"\A[^\r\n]*\btime_s\b[^\r\n]*\bsprung_mass_std_kg\b"),
    "layout": re.compile(rb"\A[^\r\n]*[\r\n]+<!-- Layout of weighbridge for a track"),
    "table of legs": re.compile(rb"\A[^\r\n]*\bleg\b[^\r\n]*\bpayload_low95_kg\b"),
    "table of masses": re.compile(rb"\A[^\r\n]*\bdrive\b[^\r\n]*\bmass_kg\b"),
    "vehicle file": re.compile(
        rb"^[ \t]*\[[ \t]*(?:vehicle|driveline|torque|road_load|provenance)[ \t]*\]", re.MULTILINE
    ),
    "mapping": re.compile(rb"^[ \t]*\[[ \t]*(?:csv|time|signals|tables)\b", re.MULTILINE),
    "state": re.compile(rb'\A\{"weighbridge_checkpoint"'),
    "MF4": re.compile(rb"\A(?:MDF     |UnFinMF )"),
}

# Suffixes of tables, and of tracks beside the signals of their drive.
_TABLES: Final = (".csv", ".parquet")
_SUFFIXES: Final[dict[Kind, tuple[str, ...]]] = {
    "track": (*_TABLES, ".mcap", ".mf4"),
    "track of a ride": _TABLES,
    "table of legs": _TABLES,
    "table of masses": _TABLES,
}

# Bytes in which a file shows what it is.
_HEAD: Final = 65_536


@dataclass(frozen=True, slots=True)
class Result:
    """One file that a command is to write.

    Attributes
    ----------
    option : how it was asked for, such as ``--report``
    path : where it goes
    kind : what it is
    """

    option: str
    path: Path
    kind: Kind


@dataclass(frozen=True, slots=True)
class Inputs:
    """What a command reads.

    Attributes
    ----------
    drives : folders and logs
    files : vehicle file, mapping and databases
    """

    drives: tuple[Path, ...] = ()
    files: tuple[Path, ...] = ()

    def all(self) -> Iterator[Path]:
        """Yield every file that is read, or may be, tables of folders included."""
        yield from self.files
        for drive in self.drives:
            yield drive
            folder = drive if drive.is_dir() else None
            if folder is None and drive.suffix.lower() == ".npy":
                # Its times may are in an array beside it.
                folder = drive.parent
            if folder is not None:
                with contextlib.suppress(OSError):
                    yield from (f for f in folder.iterdir() if _may_be_read(f))


def inputs(
    drives: Sequence[Path] = (),
    vehicle: Path | None = None,
    mapping: Path | None = None,
    dbc: Sequence[str] | None = None,
) -> Inputs:
    """Gather what a command reads; a DBC may be written ``1:FILE``, or be named by the mapping."""
    files = [p for p in (vehicle, mapping) if p is not None]
    if dbc or mapping is not None:
        from weighbridge.io.dbc import dbc_path

        files += [dbc_path(name) for name in dbc or _dbcs_of(mapping)]
    return Inputs(tuple(drives), tuple(files))


def _dbcs_of(mapping: Path | None) -> tuple[str, ...]:
    """DBC files that a mapping names; none where it cannot be used, which its reader says."""
    from weighbridge.io import load_mapping
    from weighbridge.io.mapping import named_dbcs

    try:
        return named_dbcs(load_mapping(mapping)) if mapping is not None else ()
    except WeighbridgeError:
        return ()


def asked_for(
    *,
    track: Path | None = None,
    ride_track: Path | None = None,
    report: Path | None = None,
    json: str | None = None,
    legs: Path | None = None,
) -> list[Result]:
    """Gather the files that a command is to write; ``-`` is standard output."""
    found = []
    if legs is not None:
        found.append(Result("--legs", legs, "table of legs"))
    if track is not None:
        from weighbridge.results.plotjuggler import layout_of

        found.append(Result("--track", track, "track"))
        beside = layout_of(track)
        if beside is not None:
            found.append(Result("--track", beside, "layout"))
    if ride_track is not None:
        found.append(Result("--track", ride_track, "track of a ride"))
    if report is not None:
        found.append(Result("--report", report, "report"))
    if json is not None and json != "-":
        found.append(Result("--json", Path(json), "JSON file"))
    return found


def refuse_results(read: Inputs, results: Sequence[Result]) -> None:
    """Raise before the work where a result could not be written, or would replace what stays.

    Parameters
    ----------
    read : what the command reads
    results : what it is to write

    Raises
    ------
    ConfigError
        A result is an input, by any name or link; two are one file; or a file is there that is
        no earlier result of the same kind.
    """
    known = {place: path for path in read.all() if (place := _place(path)) is not None}
    asked: dict[object, Result] = {}
    for result in results:
        path = result.path
        suffixes = _SUFFIXES.get(result.kind)
        if suffixes is not None and path.suffix.lower() not in suffixes:
            raise ConfigError(
                f"{result.option} {path}: a {result.kind} is written as {' or '.join(suffixes)}"
            )
        refuse_missing_folder(path)
        if is_stream(path):
            continue
        refuse_unwritable_place(path)
        place = _place(path)
        if place is not None and place in known:
            raise ConfigError(_is_input(path, known[place], read))
        target = os.path.realpath(path)
        _refuse_new_table(read, path, Path(target))
        other = asked.get(target) or asked.get(place)
        if other is not None:
            raise ConfigError(
                f"{path}: {other.option} and {result.option} name the same file; name two"
            )
        asked[target] = result
        if place is not None:
            asked[place] = result
            if not _is_of_kind(path, result.kind):
                raise ConfigError(
                    f"{path}: is there already and is no {result.kind}; name another file for "
                    f"{result.option}, or remove this one"
                )


def write_json(path: str | None, text: str) -> bool:
    """Write JSON to a file, or print it where the path is -; show whether it was printed."""
    if path == "-":
        say_json(text)
        return True
    if path is not None:
        write_whole(path, text + "\n")
    return False


def refuse_folder(read: Inputs, folder: Path) -> None:
    """Raise before the work where a drive written to a folder would replace what is read.

    Raises
    ------
    ConfigError
        The folder is a file, the drive that is read, or holds it.
    """
    from weighbridge.io.write import DRIVE_FILES

    if folder.exists() and not folder.is_dir():
        raise ConfigError(f"{folder}: is a file; name a folder, or a file that ends in .mf4")
    refuse_unwritable_place(folder)
    place = _place(folder)
    if place is None:
        return
    for drive in read.drives:
        if _place(drive) == place:
            raise ConfigError(f"{folder}: is the drive itself; name another folder or file")
        homes = {_place(drive.absolute().parent), _place(drive.resolve().parent)}
        if not drive.is_dir() and place in homes:
            raise ConfigError(f"{folder}: holds {drive.name}, which is read; name another folder")
    known = {p: path for path in read.all() if (p := _place(path)) is not None}
    for name in sorted(DRIVE_FILES):
        at = _place(folder / name)
        if at is not None and at in known:
            raise ConfigError(f"{folder / name}: is {known[at]}, an input; name another folder")


def refuse_overwriting(path: Path, force: bool, what: str) -> None:
    """Raise where ``path`` exists and ``--force`` was not given."""
    if not force and not is_stream(path) and os.path.lexists(path):
        raise ConfigError(
            f"{path}: exists already; name another {what}, or give --force to replace it"
        )


def refuse_missing_folder(*outputs: Path | None) -> None:
    """Raise before the work where a result could not be written after it."""
    for path in outputs:
        if path is not None and not path.parent.is_dir():
            raise ConfigError(f"{path}: there is no folder {path.parent}; make it first")
        if path is not None and path.is_dir():
            raise ConfigError(f"{path}: is a folder; name a file in it")


def _refuse_new_table(read: Inputs, path: Path, target: Path) -> None:
    """Raise where a result would be read as a table of a drive from then on."""
    from weighbridge.io import is_log
    from weighbridge.signals.catalogue import TABLES

    if not is_log(target):
        return
    home = _place(target.parent)
    for drive in read.drives:
        if drive.is_dir() and _place(drive) == home:
            tables = any(f.stem.lower() in TABLES and _may_be_read(f) for f in drive.iterdir())
            if target.stem.lower() in TABLES or not tables:
                raise ConfigError(
                    f"{path}: would be read as a table of the drive {drive.name}; results must go "
                    "to another folder"
                )


def _is_input(path: Path, known: Path, read: Inputs) -> str:
    if _place(path.parent) in {_place(drive) for drive in read.drives}:
        return (
            f"{path}: is there already, in the folder of a drive that is read; results must "
            "go to another file"
        )
    name = "" if path == known else f" ({known})"
    return f"{path}: is an input{name}; results must go to another file"


def _place(path: Path) -> tuple[int, int] | None:
    """Device and inode: the same for every name of a file."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return None
    return found.st_dev, found.st_ino


def _may_be_read(path: Path) -> bool:
    from weighbridge.io import is_log

    return path.suffix.lower() == ".toml" or is_log(path)


def _is_of_kind(path: Path, kind: Kind) -> bool:
    """Say whether a file is empty or an earlier result of a kind."""
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
            if head[:4] == b"PAR1" and kind in _SUFFIXES:
                return _BEGINS[kind].search(_columns(path)) is not None
            if head[:4] == b"MDF " and kind == "track":
                return _has_track(path)
    except OSError:
        return False
    return not head or _BEGINS[kind].search(head) is not None


def _has_track(path: Path) -> bool:
    """Say whether an MF4 holds a track; not where it is damaged."""
    from asammdf import MDF

    from weighbridge.io import quietly

    try:
        with quietly(), MDF(path) as file:
            return "track.mass_kg" in file
    # Damaged files raise errors of many kinds.
    except Exception:
        return False


def _columns(path: Path) -> bytes:
    """Names of the columns of a Parquet file; none where it is damaged."""
    import polars as pl

    from weighbridge.io import PARSE_ERRORS, quietly

    try:
        with path.open("rb") as file, quietly():
            return ",".join(pl.read_parquet_schema(file)).encode()
    except (*PARSE_ERRORS, OSError):
        return b""
