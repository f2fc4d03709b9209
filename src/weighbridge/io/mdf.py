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
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.errors import DriveError
from weighbridge.io.channels import Channel, Recording, draft_of, log_of
from weighbridge.io.draft import Draft
from weighbridge.io.frames import EXTENDED_MASK, Frames, in_order
from weighbridge.io.info import MDF_INFO_MARK, parse_info
from weighbridge.io.labels import physical_of
from weighbridge.io.libraries import importing, reason_of, unreadable
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping, UnnamedError
from weighbridge.io.mdf_repair import Repaired, corrected, guard
from weighbridge.messages import phrase
from weighbridge.signals import DriveInfo, Floats, Problem

# Channel groups of bus logging (ASAM MDF 4, bus logging), not of measurements.
_BUS_PREFIXES: Final = ("CAN_", "LIN_", "FLX_", "ETH_", "MOST_")

# Calendars of Python end with the year 9999 [s since 1970].
_LAST_START: Final = 253_402_214_400.0

_DATA_FRAME: Final = "CAN_DataFrame"
_NUMBERS: Final = frozenset({"ID", "IDE", "DataLength", "DLC", "BusChannel"})
# Bytes that a data length code means (ISO 11898-1).
_DLC: Final = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64], np.uint8)

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
        found, raw_bus = _recording(file, path)
        try:
            log = log_of(path, found, table, mapping)
        except UnnamedError:
            if not raw_bus:
                raise
            raise DriveError(
                f"{path} holds raw {raw_bus} bus frames and no CAN frame or measurement channel "
                "that is known; decode it to signals first"
            ) from None
        log.info = _info(file, path)
    if kept:
        log.problems.insert(0, _reported(log, kept))
    return log


@contextmanager
def opened(path: Path) -> Iterator[Recording]:
    """Hand over the channels of an MDF file and its CAN frames while it is open.

    Raises
    ------
    DriveError, MissingExtraError
        As of `read_mdf`.
    """
    with _file(path) as (file, kept):
        found, _ = _recording(file, path)
        found.channels = [c for c in found.channels if not c.name.startswith(_BUS_PREFIXES)]
        if kept:
            found.notes.append(Problem.of("file.cut_off"))
        yield found


def draft(path: Path) -> Draft:
    """Draft the mapping of the measurement channels.

    Raises
    ------
    DriveError
        It has none, or none that is known by its name.
    """
    with opened(path) as found:
        if not found.channels and found.frames is not None:
            raise DriveError(
                f"{path} holds CAN frames only: give the DBC of their signals with --dbc; OBD-II "
                "and J1939 are read without one (weighbridge inspect shows)"
            )
        return draft_of(path, found)


@contextmanager
def _file(path: Path) -> Iterator[tuple[Any, str]]:
    """Open an MDF file, and say what is left of one that is damaged; empty of a whole one."""
    with importing("asammdf", "mdf", f"reading {path.name}"):
        from asammdf import MDF
    try:
        saved = corrected(path)
    except ValueError as e:
        raise unreadable(path, "MDF file", str(e)) from None
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
            groups = (g.channel_group for g in file.groups if g.channels)
            return file, sum(int(group.cycles_nr) for group in groups)
    # The library's errors are of many kinds, down to struct.error.
    except Exception as e:
        reason = reason_of(e)
    finally:
        if reason:
            gc.collect()
        sys.unraisablehook = hook
    raise unreadable(path, "MDF file", reason)


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


@contextmanager
def _reading(path: Path, what: str) -> Iterator[None]:
    try:
        yield
    # The library's errors on damaged data are of many kinds.
    except Exception as e:
        raise DriveError(
            f"{path}: {what} cannot be read ({reason_of(e)}); the file may have been cut off: "
            "copy it again"
        ) from None


def _bus_frames(file: Any, path: Path) -> Frames:
    """All CAN data frames of a file, in the order of time since its start."""
    parts = []
    with _reading(path, "its bus frames"):
        for g, group in enumerate(file.groups):
            if not group.channel_group.cycles_nr:
                continue
            for c, channel in enumerate(group.channels):
                # A frame is a structure of its fields; each of them is a channel, too.
                if channel.name.startswith(_DATA_FRAME) and "." not in channel.name:
                    found = file.get(group=g, index=c, ignore_invalidation_bits=True)
                    if found.samples.dtype.names:
                        parts.append(_frames(found.timestamps, found.samples))
                    break
    several = len(parts) > 1
    joined = in_order(parts)
    return joined.select(np.argsort(joined.time, kind="stable")) if several else joined


def _frames(time: NDArray[np.float64], samples: Any) -> Frames:
    fields = {name.rpartition(".")[2]: samples[name] for name in samples.dtype.names}
    count = time.size
    for name in _NUMBERS & fields.keys():
        if fields[name].shape != (count,) or fields[name].dtype.kind not in "biuf":
            raise ValueError(f"field {name} of the frames is no number")
    identifier = np.asarray(fields.get("ID", np.zeros(count)), np.uint32)
    extended = fields["IDE"] != 0 if "IDE" in fields else identifier > 0x7FF
    data = np.asarray(fields.get("DataBytes", np.zeros((count, 8))), np.uint8)
    data = data.reshape(count, -1)[:, :64]
    if data.shape[1] < 8:
        data = np.pad(data, ((0, 0), (0, 8 - data.shape[1])))
    if "DataLength" in fields:
        length = fields["DataLength"]
    elif "DLC" in fields:
        length = _DLC[np.minimum(fields["DLC"], 15)]
    else:
        length = np.full(count, 8)
    length = np.minimum(length, data.shape[1]).astype(np.uint8)
    if (length < data.shape[1]).any():
        data = np.where(np.arange(data.shape[1]) < length[:, None], data, 0).astype(np.uint8)
    return Frames(
        np.array(time, np.float64),
        np.asarray(fields.get("BusChannel", np.ones(count)), np.int16),
        identifier & np.uint32(EXTENDED_MASK),
        np.asarray(extended, np.bool_),
        length,
        np.ascontiguousarray(data),
    )


def _recording(file: Any, path: Path) -> tuple[Recording, str]:
    """Channels, which stay in the file until they are wanted, and the raw bus that was logged."""
    found = Recording([], start=_start(file), paths=False)
    raw_bus = ""
    clocks: dict[int, Floats] = {}
    for g, group in enumerate(file.groups):
        master = file.masters_db.get(g)
        count = int(group.channel_group.cycles_nr)
        for c, channel in enumerate(group.channels):
            if c == master:
                continue
            if channel.name.startswith(_BUS_PREFIXES) and "Frame" in channel.name:
                raw_bus = raw_bus or (channel.name.split("_", 1)[0] if count else "")
                continue
            unit = _unit_text(channel)
            load = partial(_loaded, file, path, (g, c), unit, clocks)
            length = np.broadcast_to(0.0, count)
            found.channels.append(Channel(channel.name, length, np.empty(0), unit, load=load))
    if raw_bus:
        frames = _bus_frames(file, path)
        found.frames = frames if len(frames) else None
    return found, raw_bus


def _loaded(
    file: Any, path: Path, place: _Place, unit: str, clocks: dict[int, Floats], quantity: str
) -> tuple[Channel, list[Problem]]:
    """Read a channel; those of one group share their clock."""
    time, values = _samples(file, path, place)
    channel = file.groups[place[0]].channels[place[1]]
    odd = []
    if values is None:
        values = np.empty(0)
    elif channel.conversion is not None and (none := int(np.count_nonzero(np.isnan(values)))):
        about: dict[str, Any] = {
            "file": path.name,
            "count": none,
            "values": values.size,
            "name": channel.name,
        }
        odd.append(Problem.of("file.sentinels", quantity, **about))
    return Channel(channel.name, clocks.setdefault(place[0], time), values, unit), odd


def _unit_text(channel: Any) -> str:
    if channel.unit:
        return str(channel.unit)
    conversion = channel.conversion
    return str(conversion.unit) if conversion is not None and conversion.unit else ""


def _samples(file: Any, path: Path, place: _Place) -> tuple[Floats, Floats | None]:
    """Time and physical values of one channel, samples marked invalid left out as NaN."""
    # asammdf does not come back from packed data of which no record is to be read.
    if not file.groups[place[0]].channel_group.cycles_nr:
        return np.empty(0), np.empty(0)
    with _reading(path, f"channel group {place[0]}"):
        found = file.get(group=place[0], index=place[1], ignore_invalidation_bits=True)
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
