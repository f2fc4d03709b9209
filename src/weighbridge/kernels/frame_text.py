"""CAN frames out of the lines of text logs: words separated by blanks, one frame a line."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import kernel

MOST_WORDS = 84
"""Words of a line that are looked at: 64 bytes, and what stands before and behind them."""

_NEWLINE, _RETURN, _BLANK, _TAB = 10, 13, 32, 9
_NOTHING = -1


class TraceColumns(NamedTuple):
    """Where the words of a line of a TRC log stand; -1 for what its version lacks.

    ``kinds`` are the first two letters, as ``256 * first + second``, of the types of lines that
    hold a data frame; empty where every line does. ``size`` is a code of data length where
    ``coded``.
    """

    time: int
    bus: int
    kind: int
    identifier: int
    size: int
    data: int
    coded: bool
    kinds: np.ndarray  # (k,) int64


class FrameRows(NamedTuple):
    """Room for one frame a line, see `weighbridge.io.frames.Frames`."""

    time: np.ndarray  # (n,) float64 [s]
    channel: np.ndarray  # (n,) int16
    identifier: np.ndarray  # (n,) uint32
    extended: np.ndarray  # (n,) bool
    length: np.ndarray  # (n,) uint8
    data: np.ndarray  # (n, 8 or 64) uint8


@kernel
def parse_asc(text, rows, decimal, relative, clock):
    """Read lines of a Vector ASC log.

    Parameters
    ----------
    text : (n,) uint8
        Whole lines.
    rows : FrameRows
        Zeros; filled from the first on.
    decimal : bool
        Identifiers and bytes are decimal, not hexadecimal.
    relative : bool
        Stamps count from the line before.
    clock : float
        Stamp of the line before ``text`` [s].

    Returns
    -------
    count, strange : int
        Frames, and lines of frames that cannot be read.
    clock : float
        Stamp of the last line [s].
    """
    starts = np.empty(MOST_WORDS, np.int64)
    ends = np.empty(MOST_WORDS, np.int64)
    base = 10 if decimal else 16
    count = strange = 0
    at = 0
    while at < text.size:
        words, at = _words(text, at, starts, ends)
        if words < 3:
            continue
        stamp = _real(text, starts[0], ends[0])
        if not stamp >= 0.0:
            continue
        clock = clock + stamp if relative else stamp
        bus, place, first, size = _asc_places(text, starts, ends, words, base)
        if place < 0:
            strange += bus
            continue
        # Identifiers of 29 bits end in x.
        end = ends[place] - 1
        extended = text[end] | 32 == 120
        identifier = _whole(text, starts[place], end if extended else end + 1, base)
        if identifier < 0 or not _bytes(
            text, starts, ends, words, first, size, base, rows.data, count
        ):
            strange += 1
            continue
        rows.time[count] = clock
        rows.channel[count] = min(bus, 32000)
        rows.identifier[count] = identifier & 0x1FFFFFFF
        rows.extended[count] = extended
        rows.length[count] = size
        count += 1
    return count, strange, clock


@kernel
def _asc_places(text, starts, ends, words, base):
    """Find bus, place of the identifier and of the first byte, and length of a line of ASC.

    ``time bus identifier[x] Rx d length bytes``, and with CAN FD
    ``time CANFD bus Rx identifier[x] [name] brs esi code length bytes``.
    Where the place is -1, the line is no data frame; the bus is then 1 if it should be one.
    """
    bus = _whole(text, starts[1], ends[1], 10)
    if bus >= 0:
        if words < 5 or not _is_direction(text, starts[3], ends[3]) or text[starts[4]] | 32 == 114:
            return 0, -1, 0, 0
        if words < 6 or text[starts[4]] | 32 != 100:
            return 1, -1, 0, 0
        return bus, 2, 6, min(_whole(text, starts[5], ends[5], base), 8)
    # CANFD begins with C and has five letters; error frames with e.
    if (
        text[starts[1]] != 67
        or ends[1] - starts[1] != 5
        or words < 5
        or not _is_direction(text, starts[3], ends[3])
        or (text[starts[4]] | 32 == 101 and ends[4] - starts[4] == 10)
    ):
        return 0, -1, 0, 0
    bus = _whole(text, starts[2], ends[2], 10)
    named = 0 if words > 5 and _whole(text, starts[5], ends[5], 10) >= 0 else 1
    if bus < 0 or words < 9 + named:
        return 1, -1, 0, 0
    size = _whole(text, starts[8 + named], ends[8 + named], 10)
    if size == 0:
        return 0, -1, 0, 0
    return bus, 4, 9 + named, size


@kernel
def parse_trace(text, rows, columns):
    """Read lines of a PEAK TRC log.

    Parameters
    ----------
    text : (n,) uint8
        Whole lines.
    rows : FrameRows
        Zeros; filled from the first on.
    columns : TraceColumns

    Returns
    -------
    count, strange : int
        Frames, and lines of frames that cannot be read.
    """
    starts = np.empty(MOST_WORDS, np.int64)
    ends = np.empty(MOST_WORDS, np.int64)
    count = strange = 0
    at = 0
    while at < text.size:
        words, at = _words(text, at, starts, ends)
        if words == 0 or text[starts[0]] == 59:  # ;
            continue
        if columns.kind >= 0 and words > columns.kind:
            place = starts[columns.kind]
            kind = 256 * np.int64(text[place])
            if ends[columns.kind] - place == 2:
                kind += np.int64(text[place + 1])
            if not np.any(columns.kinds == kind):
                # Errors, status, remote frames.
                continue
        told = words - columns.data
        if told > 0 and text[starts[columns.data]] == 82:  # RTR: a remote frame
            continue
        if told < 0:
            strange += 1
            continue
        stamp = _real(text, starts[columns.time], ends[columns.time])
        size = _whole(text, starts[columns.size], ends[columns.size], 10)
        bus = 1
        if columns.bus >= 0:
            bus = _whole(text, starts[columns.bus], ends[columns.bus], 10)
        if columns.coded and 8 < size < 16 and _decoded(size) == told:
            size = told
        place = columns.identifier
        letters = ends[place] - starts[place]
        identifier = _whole(text, starts[place], ends[place], 16)
        if columns.kind < 0 and identifier == 0xFFFFFFFF:
            # Version 1.0 tells of the bus under an identifier of ones.
            continue
        if (
            not stamp >= 0.0
            or bus < 0
            or identifier < 0
            or not _bytes(text, starts, ends, words, columns.data, size, 16, rows.data, count)
        ):
            strange += 1
            continue
        rows.time[count] = 1e-3 * stamp
        rows.channel[count] = min(bus, 32000)
        rows.identifier[count] = identifier & 0x1FFFFFFF
        rows.extended[count] = letters > 4
        rows.length[count] = size
        count += 1
    return count, strange


@kernel
def _decoded(code):
    """Bytes that a code of data length from 9 on stands for (ISO 11898-1)."""
    return 12 + 4 * (code - 9) if code <= 12 else 32 + 16 * (code - 13)


@kernel
def _bytes(text, starts, ends, words, first, size, base, data, row):
    """Write the bytes of one frame; False where they are not all there."""
    width = data.shape[1]
    if size < 0 or size > width or words < first + size:
        return False
    for k in range(size):
        value = _whole(text, starts[first + k], ends[first + k], base)
        if value < 0 or value > 255:
            return False
        data[row, k] = value
    for k in range(size, width):
        data[row, k] = 0
    return True


@kernel
def _words(text, at, starts, ends):
    """Find the words of the line at ``at``; return how many, and where the next line begins."""
    count = 0
    inside = False
    while at < text.size:
        letter = text[at]
        if letter == _NEWLINE:
            break
        if letter in (_BLANK, _TAB, _RETURN):
            if inside:
                ends[count] = at
                count += 1
                inside = False
        elif not inside:
            if count == MOST_WORDS:
                while at < text.size and text[at] != _NEWLINE:
                    at += 1
                break
            starts[count] = at
            inside = True
        at += 1
    if inside:
        ends[count] = at
        count += 1
    return count, at + 1


@kernel
def _whole(text, start, end, base):
    """Number of digits alone, below 2**40; -1 for anything else."""
    if end <= start or end - start > 10:
        return _NOTHING
    value = 0
    for k in range(start, end):
        letter = np.int64(text[k])
        if 48 <= letter <= 57:
            digit = letter - 48
        else:
            digit = (letter | 32) - 87
            if digit < 10 or digit > 15:
                return _NOTHING
        if digit >= base:
            return _NOTHING
        value = value * base + digit
    return value


@kernel
def _real(text, start, end):
    """Number with or without decimals behind a point or a comma; NaN for anything else."""
    value = 0
    below = 1.0
    fraction = False
    if end - start > 18:
        return np.nan
    for k in range(start, end):
        letter = np.int64(text[k])
        if 48 <= letter <= 57:
            value = value * 10 + letter - 48
            if fraction:
                below *= 10.0
        elif (letter == 46 or letter == 44) and not fraction:
            fraction = True
        else:
            return np.nan
    return value / below


@kernel
def _is_direction(text, start, end):
    """Tell whether a word is Rx or Tx, or begins so as TxRq does."""
    return end - start >= 2 and (text[start] == 82 or text[start] == 84) and text[start + 1] == 120
