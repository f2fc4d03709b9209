"""Mapping TOML: what a foreign log's columns are called and how they are written.

::

    format_version = 1               # may be left out
    dbc = ["car.dbc", "2:imu.dbc"]   # of raw CAN logs, seen from this file's folder; 2: of bus 2

    [csv]                            # text tables only; may be left out
    separator = ";"                  # found in the header if not given
    encoding = "latin-1"             # UTF-8, else Latin-1, if not given
    decimal = ","
    skip_rows = 2                    # lines before the header
    skip_after_header = 1            # such as a line of units
    columns = ["t", "v"]             # names, for a file without a header
    missing = ["---"]                # cells that mean "no value"

    [time]
    column = "Time [ms]"
    unit = "ms"                      # else the brackets, else seconds
    format = "clock"                 # 17:58:02.288; or "iso"; or a pattern with %
    rate_hz = 10.0                   # column counts rows, so many a second; without column all rows
    offset_s = 0.5                   # added to every stamp
    align = true                     # find the offset to the drive's other files

    [signals.longitudinal_accel]     # a canonical name of the catalogue
    column = "Acc [g]"
    unit = "g"                       # else the brackets or the log's own unit
    factor = -1                      # value = factor * cell + offset, in that unit
    offset = 0.0
    optional = true                  # may be absent; else `weigh` refuses a drive without it
    valid = "AccValid"               # values count only where this signal is not 0; CAN only
    trusted = true                   # right as it is, whatever `inspect` says

A drive of several kinds of file has one ``[tables.NAME]`` per kind, with
``files = "pattern*.csv"`` and the same sections inside. A file that needs no
names, such as a GPX or one with canonical columns, may have ``[time]`` or ``[csv]`` alone.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, Final

from weighbridge.arguments import check_texts, check_type, suggestion
from weighbridge.errors import ConfigError, DriveError
from weighbridge.io.columns import bracketed_unit, dimension_of, suffixes_of, unit_suffix
from weighbridge.io.dbc import dbc_path, seen_from
from weighbridge.io.table import MOST_COLUMNS, TextFormat, column_list
from weighbridge.signals import QUANTITIES, UNITS, Floats, Problem, Quantity, to_si
from weighbridge.signals.tomlfile import Faults, Section, read_toml

FORMAT_VERSION: Final = 1
"""Version of the mapping file this program reads."""

UNKNOWN_RATE: Final = "unknown"
"""What a drafted mapping says of a rate that nobody knows yet."""

# What cells of numbers, ends of lines and quotes are made of.
_NO_SEPARATORS: Final = frozenset('0123456789.+-eE"\r\n\0')

# Text that any encoding of tables must keep.
_CELLS: Final = "time_s;speed,1.5\t-2e3|\n"

MappingSource = str | Path | Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeColumn:
    """Where the time stands and how it is written.

    Attributes
    ----------
    column : its name; None for a canonical time column or a log's own clock
    unit : suffix of its unit; None for the unit in the column's brackets, or seconds
    format : None for numbers, "clock", "iso" or a `strptime` format
    offset : added to every stamp [s]
    align : whether the clock differs from that of the drive's other files
    rate : rows per second where ``column`` counts rows, or every row counts [Hz]; None for a clock
    """

    column: str | None = None
    unit: str | None = None
    format: str | None = None
    offset: float = 0.0
    align: bool = False
    rate: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MappedSignal:
    """One foreign column: ``value = factor * cell + offset`` in ``unit``.

    Attributes
    ----------
    name : canonical name of the quantity
    column : what the log calls it
    unit : suffix of its unit; None for the one the log states
    factor : -1 for an axis that points the other way
    offset : in ``unit``, added after the factor
    optional : its absence is not worth a note
    valid : signal of the same CAN message that is 0 where the value does not count
    trusted : whether a person vouches for its values and unit
    """

    name: str
    column: str
    unit: str | None = None
    factor: float = 1.0
    offset: float = 0.0
    optional: bool = False
    valid: str | None = None
    trusted: bool = False

    @property
    def quantity(self) -> Quantity:
        """The quantity it is."""
        return QUANTITIES[self.name]


@dataclass(frozen=True, slots=True, kw_only=True)
class TableMapping:
    """How one kind of file is read.

    Attributes
    ----------
    files : file names it is for, as a pattern
    text : how text tables are written
    time : the time column
    signals : the columns; none where the file has names of its own or canonical ones
    source : the mapping's file, for messages
    dbc : DBC files that the mapping names for all its tables, as of `weighbridge.io.dbc.load_dbcs`
    """

    files: str
    text: TextFormat
    time: TimeColumn
    signals: tuple[MappedSignal, ...]
    source: str
    dbc: tuple[str, ...] = ()


def load_mapping(source: MappingSource) -> tuple[TableMapping, ...]:
    """Read a mapping from a TOML file or a dictionary of the same form.

    Returns
    -------
    One mapping per kind of file, the most special first.

    Raises
    ------
    ConfigError
        The file, keys or values cannot be used; all that is wrong is reported at once.
    """
    if isinstance(source, Mapping):
        check_texts("keys of mapping", source)
        root, home = Section(source, "mapping", {}), Path()
    else:
        check_type(
            "mapping", source, (str, Path), "the path of a mapping file, or a dictionary like one"
        )
        root, home = read_toml(Path(source)), Path(source).parent
    faults = Faults()
    version = root.count("format_version")
    if version not in (None, FORMAT_VERSION):
        root.fail(
            "format_version",
            f"is {version}, and this program reads {FORMAT_VERSION}: "
            "use the program's version that goes with the file",
        )
    dbc: tuple[str, ...] = ()
    with faults.gathered():
        dbc = _dbc(root, home)
    found: list[TableMapping] = []
    tables = root.section("tables")
    if tables is not None:
        for name in tables.data:
            with faults.gathered():
                section = tables.section(name)
                if section is not None:
                    found.append(_table(section, section.text("files") or f"{name}.*"))
    if tables is not None and "signals" not in root.data:
        for key in ("csv", "time"):
            if key in root.data:
                places = ", ".join(f"[tables.{name}.{key}]" for name in tables.data)
                with faults.gathered():
                    root.fail(key, f"stands beside [tables]: write it for each table, as {places}")
    if tables is None or "signals" in root.data:
        with faults.gathered():
            found.append(_table(root, "*"))
    with faults.gathered():
        root.done()
    faults.refuse()
    return tuple(replace(table, dbc=dbc) for table in found)


def named_dbcs(mappings: Sequence[TableMapping]) -> tuple[str, ...]:
    """Return the DBC files that a mapping names; none where there is no mapping."""
    return mappings[0].dbc if mappings else ()


def mapping_for(path: Path, mappings: tuple[TableMapping, ...]) -> TableMapping | None:
    """Return the first mapping whose pattern fits the file's name."""
    name = path.name.lower()
    return next((m for m in mappings if fnmatch(name, m.files.lower())), None)


def none_fits(folder: Path, files: Sequence[Path], mappings: Sequence[TableMapping]) -> DriveError:
    """Say that no table of a mapping is for a file of a folder.

    Parameters
    ----------
    folder : of a drive
    files : logs in it
    mappings : tables of one mapping
    """
    return DriveError(
        f"{folder}: no pattern in files of {mappings[0].source} "
        f"({column_list(m.files for m in mappings)}) fits a file there "
        f"({column_list(f.name for f in files)}); correct the patterns, or draft another mapping: "
        f"weighbridge map {shlex.quote(str(folder))}"
    )


def _dbc(root: Section, home: Path) -> tuple[str, ...]:
    """DBC files of the mapping, by paths that hold in the working folder."""
    named = tuple(seen_from(name, home) for name in root.texts("dbc") or ())
    for path in map(dbc_path, named):
        if not path.is_file():
            root.fail("dbc", f"names {path}, which is no file: put it there, or correct its name")
    return named


def _table(root: Section, files: str) -> TableMapping:
    faults = Faults()
    text, time = TextFormat(), TimeColumn()
    with faults.gathered():
        text = _text_format(root.section("csv"))
    with faults.gathered():
        time = _time(root.section("time"))
    section = root.section("signals")
    own_names = time == TimeColumn(offset=time.offset, align=time.align)
    reported = time != TimeColumn() or text != TextFormat() or bool(faults.said)
    alone = section is None and own_names and reported
    signals: list[MappedSignal] = []
    if not alone and (section is None or not section.data):
        with faults.gathered():
            root.fail(
                "signals",
                "is missing: name at least one column, such as "
                '[signals.vehicle_speed] column = "Speed", unit = "kmh"',
            )
    if section is not None:
        for name in section.data:
            with faults.gathered():
                signals.append(_signal(section, name))
    if root.path or alone:
        with faults.gathered():
            root.done()
    faults.refuse()
    return TableMapping(files=files, text=text, time=time, signals=tuple(signals), source=root.name)


def _text_format(section: Section | None) -> TextFormat:
    if section is None:
        return TextFormat()
    separator = section.text("separator")
    if separator is not None and (
        len(separator) != 1 or not separator.isascii() or separator in _NO_SEPARATORS
    ):
        section.fail(
            "separator",
            'must be one character such as ";" or "\\t": of ASCII, no quote, line end or part of a '
            f"number, got {separator!r:.40}",
        )
    decimal = section.text("decimal") or "."
    if decimal not in (".", ","):
        section.fail("decimal", f'must be "." or ",", got {decimal!r}')
    encoding = section.text("encoding")
    if encoding is not None and not _is_encoding(encoding):
        section.fail(
            "encoding",
            f"is not a text encoding: {encoding!r:.40}; try utf-8, latin-1 or cp1252",
        )
    fmt = TextFormat(
        separator=separator,
        encoding=encoding,
        decimal=decimal,
        skip_rows=section.count("skip_rows") or 0,
        skip_after_header=section.count("skip_after_header") or 0,
        columns=_column_names(section),
        missing=section.texts("missing") or (),
    )
    if fmt.decimal == "," and fmt.separator == ",":
        section.fail("decimal", "and separator cannot both be a comma")
    section.done()
    return fmt


def _is_encoding(name: str) -> bool:
    """Return whether text tables may be in an encoding; some of Python's take no text."""
    try:
        return _CELLS.encode(name).decode(name) == _CELLS
    except (LookupError, ValueError):
        return False


def _column_names(section: Section) -> tuple[str, ...]:
    names = section.texts("columns") or ()
    if len(names) > MOST_COLUMNS:
        section.fail("columns", f"must be {MOST_COLUMNS} names at most, got {len(names)}")
    return names


def _time(section: Section | None) -> TimeColumn:
    if section is None:
        return TimeColumn()
    written = section.text("unit")
    unit = None
    if written is not None:
        unit = unit_suffix(written)
        if unit is None or UNITS[unit].dimension != "s":
            section.fail("unit", f"{written!r} is no unit of time; use s, ms, us, ns or min")
    time = TimeColumn(
        column=section.text("column"),
        unit=unit,
        format=section.text("format"),
        offset=section.quantity("offset", "s") or 0.0,
        align=section.flag("align") or False,
        rate=_rate(section),
    )
    if time.rate is not None and (time.unit is not None or time.format is not None):
        key = "unit" if time.unit is not None else "format"
        section.fail(key, "stands beside rate_hz: a number of rows has none; remove one of the two")
    if time.format is not None and time.format not in ("clock", "iso") and "%" not in time.format:
        section.fail(
            "format",
            f'must be "clock" (17:58:02.288), "iso" (2026-01-31T17:58:02) or a pattern such as '
            f'"%d.%m.%Y %H:%M:%S%.f", got {time.format!r}',
        )
    section.done()
    return time


def _rate(section: Section) -> float | None:
    """Rows per second of a time that counts rows [Hz]."""
    if section.data.get("rate_hz") == UNKNOWN_RATE:
        section.fail(
            "rate_hz", "is not known yet: write how many rows the logger wrote per second, as 10.0"
        )
    rate = section.number("rate_hz")
    if rate is not None and rate <= 0.0:
        section.fail("rate_hz", f"must be more than 0 rows per second, got {rate:g}")
    return rate


def _signal(parent: Section, name: str) -> MappedSignal:
    if name not in QUANTITIES:
        parent.fail(name, f"is no quantity{suggestion(name, QUANTITIES)}")
    quantity = QUANTITIES[name]
    section = parent.section(name)
    if section is None:
        raise AssertionError(name)
    column = section.text("column")
    if column is None:
        section.fail("column", "is missing: give the name the log calls it")
    written = section.text("unit")
    unit: str | None = None
    if written is not None and written != "":
        unit = unit_suffix(written)
        if unit is None or UNITS[unit].dimension != dimension_of(quantity):
            allowed = ", ".join(suffixes_of(quantity)) or "none"
            section.fail("unit", f"{written!r} is no unit of {name}; use one of: {allowed}")
    factor = section.number("factor")
    if factor == 0.0:
        section.fail("factor", "must not be 0: that would make the signal constant")
    signal = MappedSignal(
        name=name,
        column=column,
        unit=unit,
        factor=1.0 if factor is None else factor,
        offset=section.number("offset") or 0.0,
        optional=section.flag("optional") or False,
        valid=section.text("valid"),
        trusted=section.flag("trusted") or False,
    )
    section.done()
    return signal


class UnnamedError(DriveError):
    """A log has names of its own, and no mapping says what they are.

    Attributes
    ----------
    what : what was read, without the remedy
    """

    def __init__(self, what: str, path: Path) -> None:
        super().__init__(f"{what}: {how_to_name(path)}")
        self.what = what


def how_to_name(path: Path) -> str:
    """Say how names of a log's own become known, with the command that does most of it.

    Parameters
    ----------
    path : of the log, or of the folder of a drive; of a data frame, its name
    """
    if not path.exists():
        return "name them by a mapping (mapping=)"
    return f"name them by a mapping: weighbridge map {shlex.quote(str(path))} -o map.toml"


def lacking(where: str, signal: MappedSignal, source: str, hint: str = "") -> Problem:
    """Report a signal that is named and not there.

    Parameters
    ----------
    where : the file, and what is named of it
    signal : the mapped signal
    source : the mapping
    hint : what may be meant, from a semicolon on
    """
    return Problem.of(
        "file.column_missing",
        signal.name,
        serious=True,
        where=where,
        column=signal.column,
        hint=hint,
        source=source,
    )


def in_si(values: Floats, suffix: str, signal: MappedSignal | None = None) -> Floats:
    """Values in SI of the unit that a suffix names, as a mapping scales them."""
    if signal is not None and (signal.factor != 1.0 or signal.offset != 0.0):
        values = values * signal.factor + signal.offset
    return to_si(values, suffix) if suffix else values


def resolved_unit(signal: MappedSignal, stated: str | None, source: str) -> str:
    """Unit suffix of a mapped signal: the mapping's, else the one the log states.

    Parameters
    ----------
    signal : the mapped signal
    stated : suffix of the unit that the log itself gives, if any

    Raises
    ------
    ConfigError
        Neither says one.
    """
    if not signal.quantity.suffix:
        return ""
    found = signal.unit or stated or bracketed_unit(signal.column)
    if found is None:
        raise ConfigError(
            f"{source}: signals.{signal.name} has no unit and column "
            f"{signal.column!r} states none; "
            f"add unit = one of: {', '.join(suffixes_of(signal.quantity))}"
        )
    if UNITS[found].dimension != dimension_of(signal.quantity):
        raise ConfigError(
            f"{source}: column {signal.column!r} is in {found!r}, which is no unit of "
            f"{signal.name}; "
            "map another quantity or state its unit"
        )
    return found
