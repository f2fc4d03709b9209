"""Every log format, one record each: the only place that lists them.

A package of its own adds a format by an entry point of the group ``weighbridge.formats`` that
names a `weighbridge.io.format.Format`.
"""

from __future__ import annotations

import difflib
import logging
import sys
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from weighbridge.first_use import at_first_call
from weighbridge.io.format import Format, Takes, starts_with
from weighbridge.io.log import Log, Reader
from weighbridge.io.mapping import TableMapping

if TYPE_CHECKING:
    from weighbridge.io.draft import Draft

_logger = logging.getLogger(__name__)

GROUP: Final = "weighbridge.formats"
"""Entry points by which packages add formats."""

_HEAD: Final = 4096


def _of(path: str) -> Callable[..., Any]:
    """Return a function of a reader; the modules of the others are not imported for it."""
    return at_first_call(f"{__package__}.{path}")


draft_table: Final[Callable[..., Draft]] = _of("draft.draft_table")
"""Drafts the mapping of a table, whose columns may be named by hand."""


def _reader(opener: str) -> Reader:
    """Return the reader of a format of channels, by the name of what opens its files."""

    def read(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
        from weighbridge.io.channels import reader

        return reader(_of(opener))(path, table, mapping)

    return read


def _drafter(opener: str) -> Callable[[Path], Draft]:
    """Return what drafts the mapping of a format of channels, likewise."""

    def draft(path: Path) -> Draft:
        from weighbridge.io.channels import drafter

        return drafter(_of(opener))(path)

    return draft


def _frames(
    name: str,
    suffixes: tuple[str, ...],
    read: Reader,
    begins: Callable[[bytes], bool] | None = None,
    *,
    magic: bool = False,
    about: str = "CAN frames",
) -> Format:
    """Record of a format of raw CAN frames."""
    return Format(
        name=name, suffixes=suffixes, read=read, begins=begins, magic=magic, about=about,
        takes=Takes.CHANNELS, self_described=True, package="cantools", extra="can",
    )  # fmt: skip


FORMATS: Final[tuple[Format, ...]] = (
    Format(
        name="CSV",
        suffixes=(".csv", ".tsv", ".txt", ".msl"),
        read=_of("tabular.read_csv"),
        about="a table of text: canonical names, or those of a mapping",
        takes=Takes.TEXT,
        draft=draft_table,
    ),
    _frames(
        "table of CAN frames",
        (".csv", ".tsv", ".txt"),
        _of("frame_text.read_frame_table"),
        _of("frame_text.is_frame_table"),
        about="CAN frames, one a row under names, as python-can, SavvyCAN, CLX000, Kvaser and "
        "Vehicle Spy write them",
    ),
    Format(
        name="RaceChrono CSV v3",
        suffixes=(".csv",),
        read=_of("apps.read_racechrono"),
        begins=_of("apps.is_racechrono"),
        about="position, speeds and engine speed, by source",
        takes=Takes.PLAIN,
        draft=draft_table,
    ),
    Format(
        name="Torque Pro CSV",
        suffixes=(".csv",),
        read=_of("apps.read_torque_pro"),
        begins=_of("apps.is_torque_pro"),
        about="position, OBD values with the unit in their name",
        takes=Takes.PLAIN,
        draft=draft_table,
    ),
    Format(
        name="Sensor Logger CSV",
        suffixes=(".csv",),
        read=_of("apps.read_sensor_logger"),
        begins=_of("apps.is_sensor_logger"),
        about="total acceleration, rotation and location of a phone",
        takes=Takes.PLAIN,
        draft=draft_table,
    ),
    Format(
        name="Tesla Track Mode CSV",
        suffixes=(".csv",),
        read=_of("apps.read_track_mode"),
        begins=_of("apps.is_track_mode"),
        about="speed, position, accelerator, over all laps",
        takes=Takes.PLAIN,
        draft=draft_table,
    ),
    Format(
        name="long CSV",
        suffixes=(".csv", ".tsv", ".txt"),
        read=_reader("long_csv.open_long"),
        begins=_of("long_csv.is_long"),
        about="one row for each value, with its name, as Car Scanner writes it",
        takes=Takes.COLUMNS,
        draft=_drafter("long_csv.open_long"),
    ),
    Format(
        name="Haltech CSV",
        suffixes=(".csv",),
        read=_reader("apps.open_haltech"),
        begins=_of("apps.is_haltech"),
        about="channels of an engine's control unit, as NSP exports them",
        takes=Takes.CHANNELS,
        draft=_drafter("apps.open_haltech"),
    ),
    Format(
        name="grouped CSV",
        suffixes=(".csv", ".tsv", ".txt"),
        read=_of("grouped.read_grouped"),
        begins=_of("grouped.is_grouped"),
        about="several times side by side, each for the columns to its right, as VCDS writes them",
        takes=Takes.TEXT,
        draft=_of("grouped.draft_grouped"),
    ),
    Format(
        name="Parquet",
        suffixes=(".parquet", ".pq"),
        read=_of("tabular.read_pq"),
        begins=starts_with(b"PAR1"),
        magic=True,
        about="a table: canonical names, or those of a mapping",
        takes=Takes.COLUMNS,
        draft=draft_table,
    ),
    Format(
        name="MDF",
        suffixes=(".mf4", ".mdf"),
        read=_of("mdf.read_mdf"),
        begins=starts_with(b"MDF ", b"UnFinMF"),
        magic=True,
        about="measurement channels, and CAN frames of bus logging",
        takes=Takes.CHANNELS,
        draft=_of("mdf.draft"),
        package="asammdf",
        extra="mdf",
    ),
    _frames("BLF", (".blf",), _of("blf.read_blf"), starts_with(b"LOGG"), magic=True),
    _frames("ASC", (".asc",), _of("frame_text.read_asc")),
    _frames("TRC", (".trc",), _of("frame_text.read_trc")),
    _frames("candump", (".log",), _of("frame_text.read_candump")),
    _frames(
        "candump text",
        (".txt",),
        _of("frame_text.read_candump"),
        _of("frame_text.is_candump"),
        magic=True,
    ),
    _frames(
        "OVMS CRTD",
        (".crtd", ".log", ".txt"),
        _of("frame_text.read_crtd"),
        _of("frame_text.is_crtd"),
    ),
    _frames(
        "CanKing", (".txt", ".log"), _of("frame_text.read_canking"), _of("frame_text.is_canking")
    ),
    _frames(
        "BUSMASTER",
        (".log", ".txt"),
        _of("frame_text.read_busmaster"),
        _of("frame_text.is_busmaster"),
    ),
    Format(
        name="NMEA 0183",
        suffixes=(".nmea", ".ubx"),
        read=_of("nmea.read_nmea"),
        about="RMC, GGA, GNS, GST, VTG of any talker",
        takes=Takes.CLOCK,
        self_described=True,
        package="pynmea2",
        extra="position",
    ),
    Format(
        name="NMEA text",
        suffixes=(".txt", ".log"),
        read=_of("nmea.read_nmea"),
        begins=_of("nmea.is_nmea"),
        magic=True,
        about="the same, known by its first lines, which may begin with what an app writes",
        takes=Takes.CLOCK,
        self_described=True,
        package="pynmea2",
        extra="position",
    ),
    Format(
        name="GPX",
        suffixes=(".gpx",),
        read=_of("gpx.read_gpx"),
        about="track points with time",
        takes=Takes.CLOCK,
        self_described=True,
        package="gpxpy",
        extra="position",
    ),
    Format(
        name="VBOX",
        suffixes=(".vbo",),
        read=_of("vbo.read_vbo"),
        about="position, speed, height, brake trigger; CAN columns by a mapping",
        takes=Takes.CHANNELS,
        self_described=True,
    ),
    Format(
        name="NumPy",
        suffixes=(".npy",),
        read=_of("npy.read_npy"),
        begins=starts_with(b"\x93NUMPY"),
        magic=True,
        about="columns by number, with a mapping",
        takes=Takes.NUMBERS,
    ),
    Format(
        name="MATLAB",
        suffixes=(".mat",),
        read=_reader("matlab.open_mat"),
        begins=starts_with(b"MATLAB 5.0", b"MATLAB 7.3"),
        magic=True,
        about="arrays and structures, of any version",
        takes=Takes.NUMBERS,
        package="pymatreader",
        extra="mat",
        draft=_drafter("matlab.open_mat"),
    ),
    Format(
        name="HDF5",
        suffixes=(".h5", ".hdf5", ".hdf"),
        read=_reader("hdf5.open_hdf5"),
        begins=starts_with(b"\x89HDF\r\n\x1a\n"),
        magic=True,
        about="data sets in groups, tables",
        takes=Takes.NUMBERS,
        package="h5py",
        extra="hdf5",
        draft=_drafter("hdf5.open_hdf5"),
    ),
    Format(
        name="TDMS",
        suffixes=(".tdms",),
        read=_reader("tdms.open_tdms"),
        begins=starts_with(b"TDSm"),
        magic=True,
        about="channels and waveforms of LabVIEW",
        takes=Takes.NUMBERS,
        package="npTDMS",
        extra="tdms",
        draft=_drafter("tdms.open_tdms"),
    ),
    Format(
        name="MCAP",
        suffixes=(".mcap",),
        read=_reader("messages.open_mcap"),
        begins=starts_with(b"\x89MCAP0\r\n"),
        magic=True,
        about="Imu and NavSatFix of ROS 1, ROS 2 or JSON; numbers of other messages by a mapping",
        takes=Takes.CHANNELS,
        self_described=True,
        package="mcap",
        extra="ros",
        draft=_drafter("messages.open_mcap"),
    ),
    Format(
        name="ROS bag",
        suffixes=(".bag", ".db3"),
        read=_reader("messages.open_bag"),
        begins=starts_with(b"#ROSBAG V2.0"),
        about="Imu and NavSatFix of ROS 1 or ROS 2; numbers of other messages by a mapping",
        takes=Takes.CHANNELS,
        self_described=True,
        package="rosbags",
        extra="ros",
        draft=_drafter("messages.open_bag"),
    ),
    Format(
        name="openpilot",
        suffixes=("rlog", "rlog.bz2", "rlog.zst", "qlog", "qlog.bz2", "qlog.zst"),
        read=_reader("openpilot.open_openpilot"),
        about="speed, engine speed, pedals, inertial sensor, position; CAN frames with a DBC",
        takes=Takes.CHANNELS,
        self_described=True,
        package="pycapnp",
        extra="openpilot",
    ),
    Format(
        name="Tesla Fleet Telemetry JSON",
        # A .json is read where it is named: in a folder it is rather a result or a setting.
        suffixes=(".jsonl", ".ndjson"),
        read=_reader("json_lines.open_fleet_telemetry"),
        begins=_of("json_lines.is_fleet_telemetry"),
        magic=True,
        about="position; numbers by a mapping, for the protocol states no units",
        takes=Takes.CHANNELS,
        draft=_drafter("json_lines.open_fleet_telemetry"),
    ),
    Format(
        name="JSON lines",
        suffixes=(".jsonl", ".ndjson"),
        read=_reader("json_lines.open_json_lines"),
        begins=_of("json_lines.is_json_lines"),
        magic=True,
        about="one object a line: a value with its name, as OpenXC has it, or a row of values",
        takes=Takes.COLUMNS,
        draft=_drafter("json_lines.open_json_lines"),
    ),
)
"""The formats of this project; where several have one suffix, the first that recognises a file's
first bytes reads it, else the one that needs no recognising, else the last."""


def all_formats() -> tuple[Format, ...]:
    """All formats, those that packages add included."""
    return (*FORMATS, *_added(tuple(sys.path)))


def suffixes() -> tuple[str, ...]:
    """Ends of file names that are read, each once."""
    return tuple(dict.fromkeys(s for f in all_formats() for s in f.suffixes))


def is_log(path: Path) -> bool:
    """Return by its name whether a file is read as a log."""
    return any(f.ends(path.name) for f in all_formats())


_SHEET: Final = "it is a spreadsheet: save its sheet as CSV"
_PACKED: Final = "it is packed: unpack it first"
_TRACK: Final = "export the track as GPX"
_RACE: Final = "export it as CSV from Race Studio"
_FRAMES: Final = "it holds CAN frames in a maker's own form: save them as ASC, BLF or TRC"
_ENGINE: Final = "it is of an engine's control unit: export it as CSV from the tuner's program"
_TABLE: Final = "write its table as Parquet or CSV"

_REMEDIES: Final = {
    **dict.fromkeys((".xlsx", ".xls", ".xlsm", ".ods", ".numbers"), _SHEET),
    **dict.fromkeys((".zip", ".gz", ".7z", ".rar", ".tar", ".tgz", ".xz"), _PACKED),
    **dict.fromkeys((".fit", ".tcx", ".kml", ".kmz", ".igc"), _TRACK),
    **dict.fromkeys((".xrk", ".xrz", ".drk"), _RACE),
    **dict.fromkeys((".kmf", ".kme", ".vsb", ".cdr", ".rf64", ".tio", ".can"), _FRAMES),
    **dict.fromkeys(
        (".mlg", ".llg", ".lf3", ".hpl", ".dl", ".dlz", ".ftl", ".stf", ".daq", ".lg1"), _ENGINE
    ),
    **dict.fromkeys((".arrow", ".feather", ".avro", ".pkl", ".pickle", ".rds", ".sav"), _TABLE),
    **dict.fromkeys((".pcap", ".pcapng"), "write its CAN frames by candump -l, or as ASC"),
    **dict.fromkeys((".dat", ".erg", ".d97"), "save it as MDF (.mf4), as INCA and CANape do"),
    **dict.fromkeys((".rcz", ".rc1"), "export the session as CSV v3 from RaceChrono"),
    ".ulg": "turn its topics into CSV by ulog2csv",
    ".ld": "export it as CSV from i2",
    ".dbc": "it is the database of a bus and no log: give it by --dbc beside the log",
    ".toml": "it is no log: a vehicle file goes with --vehicle, a mapping with --mapping",
    ".html": "it is a report and no log",
    ".json": "write one row per instant as CSV, or one object per line as .jsonl",
    ".db": "export its table as CSV",
    ".sqlite": "export its table as CSV",
}
"""What helps with files that are no logs, or of formats that are not read, by suffix."""


def unreadable(path: Path) -> str:
    """Say of a file of no known format what helps, in a sentence.

    Parameters
    ----------
    path : the file
    """
    suffix = path.suffix.lower()
    remedy = _REMEDIES.get(suffix, "")
    if suffix not in _REMEDIES or suffix == ".dat":
        remedy = _of_text(path) or remedy
    near = difflib.get_close_matches(suffix, [s for s in suffixes() if s.startswith(".")], n=1)
    known = f"the nearest that is known is {near[0]}" if near and not remedy else ""
    reported = known or remedy or f"known are {', '.join(suffixes())}, and folders of tables"
    return f"{path}: logs of kind {path.suffix or 'without a suffix'!r} cannot be read; {reported}"


def _of_text(path: Path) -> str:
    """Say of a file of unknown suffix that is a text what helps; empty where it is none."""
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError:
        return ""
    printable = sum(byte >= 32 or byte in b"\t\r\n" for byte in head)
    lines = head.count(b"\n")
    if lines < 2 or printable < 0.98 * len(head):
        return ""
    return "it is a text: name it .csv where it is a table, .log where it holds CAN frames"


def format_of(path: Path) -> Format | None:
    """Format of a file, by its name and by its first bytes; None where it is not known.

    Parameters
    ----------
    path : a file that is there

    Raises
    ------
    OSError
        It cannot be opened.
    """
    known = [(f.ends(path.name), f) for f in all_formats()]
    longest = max(length for length, _ in known)
    named = [f for length, f in known if length == longest > 0]
    if len(named) == 1:
        return named[0]
    with path.open("rb") as file:
        head = file.read(_HEAD)
    among = named or [f for f in all_formats() if f.magic]
    for found in among:
        if found.begins is not None and found.begins(head):
            return found
    return next((f for f in named if f.begins is None), named[-1] if named else None)


@lru_cache(maxsize=4)
def _added(places: tuple[str, ...]) -> tuple[Format, ...]:
    """Formats of packages; ``places`` is where they are looked for."""
    from importlib.metadata import entry_points

    found = []
    for point in entry_points(group=GROUP):
        try:
            record = point.load()
        # A package of others may raise anything while it is imported.
        except Exception as e:
            _logger.warning(
                "log format %s cannot be loaded (%s: %s)", point.value, type(e).__name__, e
            )
            continue
        if isinstance(record, Format):
            found.append(record)
        else:
            _logger.warning("log format %s is no weighbridge.io.format.Format", point.value)
    return tuple(found)
