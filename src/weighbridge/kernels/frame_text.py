"""CAN frames out of the lines of text logs: words separated by blanks, one frame a line."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import kernel

MOST_WORDS = 84
"""Words of a line that are looked at: 64 bytes, and what stands before and behind them."""

_NEWLINE, _RETURN, _BLANK, _TAB = 10, 13, 32, 9
_NOTHING = -1
_REMOTE = -2


class TraceColumns(NamedTuple):
    """Where the words of a line of a TRC log stand; -1 for what its version lacks.

    ``kinds`` are the first two letters, as ``256 * first + second``, of the types of lines that
    hold a data frame; empty where every line does. ``size`` is a code of data length where
    ``coded``. Lines begin with their number and a bracket where ``numbered``; stamps are
    in ``unit`` [s].
    """

    time: int
    bus: int
    kind: int
    identifier: int
    size: int
    data: int
    coded: bool
    numbered: bool
    unit: float
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
    count, strange, first : int
        Frames, lines of frames that cannot be read, and the number of the first of these.
    clock : float
        Stamp of the last line [s].
    """
    starts = np.empty(MOST_WORDS, np.int64)
    ends = np.empty(MOST_WORDS, np.int64)
    base = 10 if decimal else 16
    count = strange = first_strange = line = 0
    at = 0
    while at < text.size:
        words, at = _words(text, at, starts, ends)
        line += 1
        if strange and not first_strange:
            first_strange = line - 1
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
    if strange and not first_strange:
        first_strange = line
    return count, strange, first_strange, clock


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
    """Read lines of a TRC log.

    Parameters
    ----------
    text : (n,) uint8
        Whole lines.
    rows : FrameRows
        Zeros; filled from the first on.
    columns : TraceColumns

    Returns
    -------
    count, strange, first : int
        Frames, lines of frames that cannot be read, and the number of the first of these.
    """
    starts = np.empty(MOST_WORDS, np.int64)
    ends = np.empty(MOST_WORDS, np.int64)
    count = strange = first_strange = line = 0
    at = 0
    while at < text.size:
        words, at = _words(text, at, starts, ends)
        line += 1
        if strange and not first_strange:
            first_strange = line - 1
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
        if columns.numbered and text[ends[0] - 1] != 41:  # )
            strange += 1
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
        rows.time[count] = columns.unit * stamp
        rows.channel[count] = min(bus, 32000)
        rows.identifier[count] = identifier & 0x1FFFFFFF
        rows.extended[count] = letters > 4
        rows.length[count] = size
        count += 1
    if strange and not first_strange:
        first_strange = line
    return count, strange, first_strange


@kernel
def parse_candump(text, rows, buses):
    """Read lines of candump, as ``candump -l`` writes them or as a terminal shows them.

    Parameters
    ----------
    text : (n,) uint8
        Whole lines.
    rows : FrameRows
        Zeros; filled from the first on. The channel is a row of ``buses``.
    buses : (b, 2) int64
        Room for where the name of each interface begins and ends in ``text``.

    Returns
    -------
    count, lines, strange, first : int
        Frames, lines that are not empty, those that are no frames of any kind, and the number of
        the first of these.
    seen : int
        Rows of ``buses`` that were filled.
    longest : int
        Bytes of the longest frame; where they are more than ``rows`` has room for, that frame
        was left out.
    """
    starts = np.empty(MOST_WORDS, np.int64)
    ends = np.empty(MOST_WORDS, np.int64)
    count = lines = strange = seen = longest = first_strange = line = 0
    at = 0
    while at < text.size:
        words, at = _words(text, at, starts, ends)
        line += 1
        if strange and not first_strange:
            first_strange = line - 1
        if words == 0:
            continue
        lines += 1
        if words < 3 or text[starts[0]] != 40 or text[ends[0] - 1] != 41:  # ( )
            strange += 1
            continue
        # Digits behind the nanosecond say nothing.
        stamp = _real(text, starts[0] + 1, min(ends[0] - 1, starts[0] + 19))
        bus = _interface(text, starts[1], ends[1], buses, seen)
        place = 2
        # candump -x tells the direction and two flags before the identifier.
        if words > 5 and ends[2] - starts[2] == 2 and text[starts[2] + 1] == 88:  # RX, TX
            place = 5
        end = starts[place]
        while end < ends[place] and text[end] != 35:  # #
            end += 1
        digits = end - starts[place]
        identifier = _whole(text, starts[place], end, 16)
        if not stamp >= 0.0 or bus < 0 or identifier < 0 or (digits != 3 and digits != 8):
            strange += 1
            continue
        if end < ends[place]:
            size = _packed(text, end + 1, ends[place], rows.data, count)
        else:
            size = _spaced(text, starts, ends, words, place + 1, rows.data, count)
        longest = max(longest, size)
        if size == _NOTHING:
            strange += 1
        if size < 0 or size > rows.data.shape[1]:
            continue
        seen = max(seen, bus + 1)
        # An error of the bus is told under an identifier with this flag.
        if identifier & 0x20000000 and digits == 8:
            continue
        rows.time[count] = stamp
        rows.channel[count] = bus
        rows.identifier[count] = identifier & 0x1FFFFFFF
        rows.extended[count] = digits == 8
        rows.length[count] = size
        count += 1
    if strange and not first_strange:
        first_strange = line
    return count, lines, strange, first_strange, seen, longest


@kernel
def _interface(text, start, end, buses, seen):
    """Row of an interface's name; a new one is written behind those seen, -1 where none fits."""
    for k in range(seen):
        first = buses[k, 0]
        if buses[k, 1] - first != end - start:
            continue
        alike = True
        for i in range(end - start):
            if text[first + i] != text[start + i]:
                alike = False
                break
        if alike:
            return k
    if seen == buses.shape[0]:
        return _NOTHING
    buses[seen, 0] = start
    buses[seen, 1] = end
    return seen


@kernel
def _packed(text, start, end, data, row):
    """Bytes of ``DEADBEEF`` or, with CAN FD's flags, ``#1DEADBEEF``; -2 of a remote frame."""
    if start < end and text[start] == 82:  # R
        return _REMOTE
    if start < end and text[start] == 35:
        start += 2
        if start > end or _whole(text, start - 1, start, 16) < 0:
            return _NOTHING
    # A code of data length above 8 may stand behind.
    for k in range(start, end):
        if text[k] == 95:  # _
            end = k
            break
    size = (end - start) // 2
    if size < 0 or size > 64 or (end - start) % 2:
        return _NOTHING
    for k in range(min(size, data.shape[1])):
        value = _whole(text, start + 2 * k, start + 2 * k + 2, 16)
        if value < 0:
            return _NOTHING
        data[row, k] = value
    for k in range(size, data.shape[1]):
        data[row, k] = 0
    return size


@kernel
def _spaced(text, starts, ends, words, place, data, row):
    """Bytes of ``[4]  DE AD BE EF``; -2 of a remote frame."""
    if words <= place or text[starts[place]] != 91 or text[ends[place] - 1] != 93:  # [ ]
        return _NOTHING
    size = _whole(text, starts[place] + 1, ends[place] - 1, 10)
    first = place + 1
    # remote request
    if words > first and ends[first] - starts[first] == 6 and text[starts[first]] == 114:
        return _REMOTE
    if size < 0 or size > 64 or words < first + size:
        return _NOTHING
    if size > data.shape[1]:
        return size
    return size if _bytes(text, starts, ends, words, first, size, 16, data, row) else _NOTHING


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
    if end <= start or end - start > 18:
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
