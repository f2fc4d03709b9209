"""CAN frames out of the lines of text logs, one frame a line, by a table of what stands where."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import kernel

MOST_WORDS = 96
"""Words of a line that are looked at: 64 bytes, and what stands before and behind them."""

LETTER, REMARK, BLANK, CELL, ALONE = range(5)
"""What a letter is: part of a word, or one that begins lines without a frame; between words, the
end of a cell, or a word of its own."""

FRAME, NOTHING, STRANGE, UNSEEN = range(4)
"""What a line is: a frame, something else that belongs there, damaged, or not counted."""

WORDS, WORD, BASE64 = range(3)
"""How bytes are written: one a word or cell, all in one word, or in one word in base 64."""

LACKING = 999
"""Place of a word that no line has."""

MARKS = 5
"""Words by which a line is known, at most."""

(KIND, LEAST, BUS, IDENTIFIER, EXTENDED, SIZE, DATA, CODING, SKIP, MOST, MARK) = range(11)
"""Columns of `FrameForm.shapes`, where from the last on three describe each mark: its place, and
its first and last row of tags."""


class FrameForm(NamedTuple):
    """How lines are read.

    Attributes
    ----------
    letters : (256,) uint8
        What each letter is, see `LETTER`.
    shapes : (s, k) int64
        Forms of lines, the first that fits decides: kind of the line, words it has at least, places
        of the words, of which negative ones count from the end, how bytes are written, letters to
        skip before them, and the most bytes; then its marks.
    tags : (t,) int64, told : int
        First seven letters of words, in small letters, as one number; the first ``told`` of them
        are words by which an identifier has 29 bits.
    other : int
        What a line is that no shape fits.
    time : int
        Place of the stamp.
    time_words : int
        Words of the stamp.
    short : int
        Digits that an identifier of 11 bits has at most; 0 where they say nothing.
    base : int
        Of identifiers and bytes.
    cells, socketcan, coded, relative, dated : bool
        Words are cells of a table; identifiers have 3 or 8 digits and a flag for errors; lengths
        are codes of CAN FD; stamps count from the line before, or are dates and give no ``time``.
    """

    letters: np.ndarray
    shapes: np.ndarray
    tags: np.ndarray
    told: int
    other: int
    time: int
    time_words: int
    short: int
    base: int
    cells: bool
    socketcan: bool
    coded: bool
    relative: bool
    dated: bool


class FrameRows(NamedTuple):
    """Room for one frame a line, see `weighbridge.io.frames.Frames`."""

    time: np.ndarray  # (n,) float64 [s], NaN of what is no number and no time of day
    channel: np.ndarray  # (n,) int16, row of the bus's name
    identifier: np.ndarray  # (n,) uint32
    extended: np.ndarray  # (n,) bool
    length: np.ndarray  # (n,) uint8
    data: np.ndarray  # (n, 8 or 64) uint8
    stamp: np.ndarray  # (n, 2) int64, where the stamp begins and ends in the text


@kernel
def parse_frames(text, rows, buses, form, clock):
    """Read lines of frames.

    Parameters
    ----------
    text : (n,) uint8
        Whole lines.
    rows : FrameRows
        Zeros; filled from the first on.
    buses : (b, 2) int64
        Room for where the name of each bus begins and ends in ``text``.
    form : FrameForm
    clock : float
        Stamp of the line before ``text`` [s].

    Returns
    -------
    count, lines, strange, first : int
        Frames, lines that count, those that are no frames of any kind, and the number of the first
        of these.
    seen : int
        Rows of ``buses`` that were filled.
    longest : int
        Bytes of the longest frame; where they are more than ``rows`` has room for, that frame
        was left out.
    clock : float
        Stamp of the last line [s].
    """
    starts = np.empty(MOST_WORDS, np.int64)
    ends = np.empty(MOST_WORDS, np.int64)
    count = lines = strange = seen = longest = first_strange = line = 0
    at = 0
    while at < text.size:
        words, at = _words(text, at, form, starts, ends)
        line += 1
        if words == 0 or form.letters[text[starts[0]]] == REMARK:
            continue
        time, stamp_end = 0.0, 0
        place = form.time if form.time >= 0 else words + form.time
        timed = place >= 0 and place + form.time_words <= words
        if timed:
            stamp_end = ends[place + form.time_words - 1]
            time = _stamp(text, starts[place], stamp_end)
            clock = (clock + time if time >= 0.0 else clock) if form.relative else time
        shape = _shape(text, starts, ends, words, form)
        kind = form.other if shape < 0 else form.shapes[shape, KIND]
        if kind == UNSEEN:
            continue
        lines += 1
        if kind == FRAME:
            bus = size = -1
            if timed:
                bus = _bus(text, starts, ends, words, form.shapes[shape, BUS], buses, seen)
                kind, size = _frame(text, starts, ends, words, form, shape, rows, count)
            if bus < 0 or (kind == FRAME and (size < 0 or not (form.dated or time >= 0.0))):
                kind = STRANGE
            longest = max(longest, size)
            if kind == FRAME and size <= rows.data.shape[1]:
                rows.time[count] = clock
                rows.channel[count] = bus
                rows.length[count] = size
                rows.stamp[count, 0] = starts[place]
                rows.stamp[count, 1] = stamp_end
                seen = max(seen, bus + 1)
                count += 1
        if kind == STRANGE:
            strange += 1
            if not first_strange:
                first_strange = line
    return count, lines, strange, first_strange, seen, longest, clock


@kernel
def _shape(text, starts, ends, words, form):
    """Row of the first shape that a line has; -1 where it has none."""
    for s in range(form.shapes.shape[0]):
        shape = form.shapes[s]
        fits = words >= shape[LEAST]
        for m in range(MARKS):
            place = shape[MARK + 3 * m]
            if not fits or place == LACKING:
                break
            place = place if place >= 0 else words + place
            fits = place < words and _is_one_of(
                text, starts[place], ends[place], form.tags, shape[MARK + 3 * m + 1],
                shape[MARK + 3 * m + 2],
            )  # fmt: skip
        if fits:
            return s
    return -1


@kernel
def _frame(text, starts, ends, words, form, shape, rows, row):
    """Write identifier and bytes of one line; return its kind and the number of its bytes.

    The number is -1 where something cannot be read.
    """
    shape_of = form.shapes[shape]
    place = shape_of[IDENTIFIER]
    start, end = starts[place], ends[place]
    # Identifiers of 29 bits may end in x.
    extended = end > start + 1 and text[end - 1] | 32 == 120
    end -= extended
    digits = end - start
    identifier = _whole(text, start, end, form.base)
    if identifier < 0 or (form.socketcan and digits != 3 and digits != 8):
        return FRAME, -1
    if identifier > 0x1FFFFFFF:
        # An error of the bus is reported under an identifier with this flag.
        return NOTHING if form.socketcan and identifier & 0x20000000 else FRAME, -1
    told = shape_of[EXTENDED]
    if told < words:
        extended |= _is_one_of(text, starts[told], ends[told], form.tags, 0, form.told)
    rows.identifier[row] = identifier
    rows.extended[row] = extended or identifier > 0x7FF or 0 < form.short < digits
    size, place = -1, shape_of[SIZE]
    most, data = shape_of[MOST], shape_of[DATA]
    if place < words:
        size = _whole(text, starts[place], ends[place], 16 if most == 8 else 10)
        if size < 0 and not (form.cells and ends[place] == starts[place]):
            return FRAME, -1
        if form.coded and 8 < size < 16 and _decoded(size) == words - data:
            size = words - data
        size = min(size, most)
    elif place != LACKING and not form.cells:
        return FRAME, -1
    packed = shape_of[CODING] == WORD
    # What stands apart from the mark of candump's bytes is the direction.
    if data >= words or (form.socketcan and packed and starts[data] > ends[data - 1]):
        return FRAME, 0 if size <= 0 else -1
    if form.socketcan and text[starts[data]] == 82:  # R: a remote frame
        return NOTHING, -1
    begin = starts[data] + shape_of[SKIP]
    if shape_of[CODING] == BASE64:
        return FRAME, _base64(text, begin, ends[data], size, rows.data, row)
    end = ends[data] if packed else ends[words - 1]
    return FRAME, _bytes(text, begin, end, form, size, most, packed, rows.data, row)


@kernel
def _bytes(text, at, end, form, size, most, packed, data, row):
    """Write the bytes between two places; return how many, -1 where they are not ``size``.

    Two digits are a byte, and one alone between blanks. Where ``size`` is negative, bytes go on
    to the end or to the first empty cell. More than fit into ``data`` are counted alone.
    """
    width = data.shape[1]
    count = 0
    begin = at
    while count != size and count < most:
        cells = 0
        while at < end and (_is_gap(text[at], form) or (packed and text[at] in (45, 58))):
            cells += form.letters[text[at]] == CELL
            at += 1
        if at >= end or cells > 1 or (count == 0 and cells):
            break
        if text[at] == 48 and at + 1 < end and text[at + 1] | 32 == 120:  # 0x
            at += 2
        run = at
        while at < end and _digit(text[at]) < form.base:
            at += 1
        digits = at - run
        ended = at == end or _is_gap(text[at], form) or (packed and text[at] in (45, 58))
        if packed and at < end and text[at] == 95:  # a code of data length behind _
            ended, end = True, at
        step = 2 if packed and digits > 1 else max(digits, 1)
        lone = digits == 1 and ((packed and run == begin) or (size < 0 and not form.cells))
        if not ended or digits == 0 or digits % step or step > 3 or lone:
            return -1
        for k in range(run, at, step):
            value = _whole(text, k, k + step, form.base)
            if value > 255:
                return -1
            if count < width:
                data[row, count] = value
            count += 1
    if count > most or (size >= 0 and count < size) or (size < 0 and not form.cells and at < end):
        return -1
    count = min(count, size) if size >= 0 else count
    for k in range(count, width):
        data[row, k] = 0
    return count


@kernel
def _base64(text, start, end, size, data, row):
    """Write the bytes of a word in base 64 (RFC 4648); return how many, -1 where they are none."""
    width = data.shape[1]
    held = bits = count = 0
    for k in range(start, end):
        letter = np.int64(text[k])
        if 65 <= letter <= 90:
            value = letter - 65
        elif 97 <= letter <= 122:
            value = letter - 71
        elif 48 <= letter <= 57:
            value = letter + 4
        elif letter in (43, 47):
            value = 62 if letter == 43 else 63
        elif letter == 61 and end - k <= 2:
            break
        else:
            return -1
        held = (held << 6 | value) & 0xFFFF
        bits += 6
        if bits >= 8:
            bits -= 8
            if count < width:
                data[row, count] = held >> bits & 0xFF
            count += 1
    if (end - start) % 4 or count > 64 or 0 <= size != count:
        return -1
    for k in range(count, width):
        data[row, k] = 0
    return count


@kernel
def _decoded(code):
    """Bytes that a code of data length from 9 on means (ISO 11898-1)."""
    return 12 + 4 * (code - 9) if code <= 12 else 32 + 16 * (code - 13)


@kernel
def _bus(text, starts, ends, words, place, buses, seen):
    """Row of a bus's name; a new one is written behind those seen, -1 where none fits."""
    start = starts[place] if place < words else 0
    end = ends[place] if place < words else 0
    for k in range(seen):
        first = buses[k, 0]
        alike = buses[k, 1] - first == end - start
        for i in range(end - start):
            if not alike:
                break
            alike = text[first + i] == text[start + i]
        if alike:
            return k
    if seen == buses.shape[0]:
        return -1
    buses[seen, 0] = start
    buses[seen, 1] = end
    return seen


@kernel
def _words(text, at, form, starts, ends):
    """Find the words of the line at ``at``; return how many, and where the next line begins."""
    count = 0
    begin, end = -1, at
    while at < text.size and text[at] != 10:
        role = form.letters[text[at]]
        if role <= REMARK:
            begin = at if begin < 0 else begin
            end = at + 1
        elif not (form.cells and role == BLANK):
            if count < MOST_WORDS and (begin >= 0 or role == CELL):
                starts[count] = begin if begin >= 0 else at
                ends[count] = end if begin >= 0 else at
                count += 1
            if count < MOST_WORDS and role == ALONE:
                starts[count] = at
                ends[count] = at + 1
                count += 1
            begin = -1
        at += 1
    if count < MOST_WORDS and begin >= 0:
        starts[count] = begin
        ends[count] = end
        count += 1
    return count, at + 1


@kernel
def _is_gap(letter, form):
    return BLANK <= form.letters[letter] <= CELL


@kernel
def _is_one_of(text, start, end, tags, first, last):
    """Return whether a word is one of those tagged."""
    tag = 0
    for k in range(start, min(end, start + 7)):
        letter = np.int64(text[k])
        tag = tag << 8 | (letter + 32 if 65 <= letter <= 90 else letter)
    found = False
    for k in range(first, last):
        found |= tags[k] == tag
    return found


@kernel
def _digit(letter):
    """Value of a digit of up to base 16; 99 of anything else."""
    if 48 <= letter <= 57:
        return np.int64(letter) - 48
    value = np.int64(letter | 32) - 87
    return value if 10 <= value <= 15 else 99


@kernel
def _whole(text, start, end, base):
    """Number of digits alone, or of hexadecimal ones behind 0x; -1 for anything else."""
    if end - start > 2 and text[start] == 48 and text[start + 1] | 32 == 120:
        start += 2
        base = 16
    if end <= start or end - start > 10:
        return -1
    value = 0
    for k in range(start, end):
        digit = _digit(text[k])
        if digit >= base:
            return -1
        value = value * base + digit
    return value


@kernel
def _stamp(text, start, end):
    """Seconds of a number or of a time of day ``h:m:s``; NaN for anything else.

    Decimals stand behind a point, a comma or a third colon; those behind the nanosecond say
    nothing.
    """
    total = 0.0
    value = 0
    below = 1.0
    colons = 0
    point = False
    if end <= start or end - start > 40:
        return np.nan
    for k in range(start, end):
        letter = np.int64(text[k])
        if 48 <= letter <= 57:
            if not point or below < 1e9:
                value = value * 10 + letter - 48
                below *= 10.0 if point else 1.0
            if value > 10**17:
                return np.nan
        elif letter == 58 and not point and colons < 2:
            total = (total + value) * 60.0
            value = 0
            colons += 1
        elif letter in (44, 46, 58) and not point:
            total, value, point = total + value, 0, True
        else:
            return np.nan
    return total + value / below
