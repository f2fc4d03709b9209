"""Raw bus traffic: what every reader of CAN logs hands to the decoders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.signals import Floats, Problem
from weighbridge.signals.instants import instant
from weighbridge.signals.words import counted

EXTENDED_MASK = 0x1FFFFFFF
"""The 29 bits of an extended identifier."""


_COLUMNS: Final = ("time", "channel", "id", "extended", "length")


@dataclass(frozen=True, slots=True)
class Frames:
    """Data frames of one recording, of all its buses, in the order of time.

    Attributes
    ----------
    time : (n,) float64, when each was on the bus [s]
    channel : (n,) int16, the logger's bus number, as the log counts them
    id : (n,) uint32, identifier without flags
    extended : (n,) bool, whether the identifier has 29 bits
    length : (n,) uint8, data bytes
    data : (n, 8 to 64) uint8, padded with zeros behind ``length``
    """

    time: Floats
    channel: NDArray[np.int16]
    id: NDArray[np.uint32]
    extended: NDArray[np.bool_]
    length: NDArray[np.uint8]
    data: NDArray[np.uint8]

    def __len__(self) -> int:
        return int(self.time.size)

    @classmethod
    def empty(cls) -> Frames:
        """No frames."""
        return cls.room(0, 8)

    @classmethod
    def room(cls, count: int, width: int) -> Frames:
        """Room for so many frames, whose data are zeros of so many bytes."""
        return cls(
            np.empty(count), np.empty(count, np.int16), np.empty(count, np.uint32),
            np.empty(count, np.bool_), np.empty(count, np.uint8),
            np.zeros((count, width), np.uint8),
        )  # fmt: skip

    def select(self, which: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Frames:
        """Frames under a mask, a slice or indices."""
        return Frames(*(getattr(self, name)[which] for name in (*_COLUMNS, "data")))

    def counts(self, which: NDArray[np.bool_] | None = None) -> dict[tuple[int, int, bool], int]:
        """How often each (channel, id, extended) was seen, under a mask; the lowest first."""
        keys = self.keys() if which is None else self.keys()[which]
        keys, numbers = np.unique(keys, return_counts=True)
        return {
            (int(k) >> 33, (int(k) >> 1) & 0xFFFFFFFF, bool(k & 1)): int(n)
            for k, n in zip(keys, numbers, strict=True)
        }

    def keys(self) -> NDArray[np.int64]:
        """(n,) one number per frame: channel << 33 | id << 1 | extended."""
        return (
            (self.channel.astype(np.int64) << 33)
            | (self.id.astype(np.int64) << 1)
            | self.extended.astype(np.int64)
        )


def bits(
    data: NDArray[np.uint8], first: int, count: int, *, big_endian: bool = False
) -> NDArray[np.uint64]:
    """Whole numbers that stand in bytes.

    Parameters
    ----------
    data : (n, w) bytes; those behind the last read as zero
    first : bit, counted in the order in which bits are read
    count : bits of a number, 64 at most
    big_endian : whether the highest byte comes first

    Returns
    -------
    (n,)
    """
    begin, end = first // 8, (first + count + 7) // 8
    columns = [
        data[:, k].astype(np.uint64) if k < data.shape[1] else np.zeros(len(data), np.uint64)
        for k in range(begin, end)
    ]
    shift = first % 8
    if big_endian:
        columns.reverse()
        shift = 8 * end - (first + count)
    value = np.zeros(len(data), np.uint64)
    for k, column in enumerate(columns):
        place = 8 * k - shift
        value |= column << np.uint64(place) if place >= 0 else column >> np.uint64(-place)
    return value & np.uint64((1 << count) - 1)


def parameter_group(identifier: NDArray[np.uint32] | np.uint32) -> NDArray[np.uint32]:
    """Parameter group number of 29-bit identifiers of SAE J1939 (J1939-21, 5.2).

    Below PDU format 240 the low byte is a destination and no part of it.

    Parameters
    ----------
    identifier : (n,) without flags, or one of them

    Returns
    -------
    (n,) 18 bits
    """
    group = (identifier >> 8) & 0x3FFFF
    addressed = ((identifier >> 16) & 0xFF) < 240
    return np.asarray(np.where(addressed, group & 0x3FF00, group), dtype=np.uint32)


def in_order(parts: list[Frames]) -> Frames:
    """Frames one part after another, as they were written.

    The list is emptied meanwhile: an hour of a busy bus does not fit into memory twice.
    """
    parts[:] = [p for p in reversed(parts) if len(p)]
    if not parts:
        return Frames.empty()
    if len(parts) == 1:
        return parts.pop()
    joined = Frames.room(sum(map(len, parts)), max(p.data.shape[1] for p in parts))
    at = 0
    while parts:
        part = parts.pop()
        rows = slice(at, at + len(part))
        for name in _COLUMNS:
            getattr(joined, name)[rows] = getattr(part, name)
        joined.data[rows, : part.data.shape[1]] = part.data
        at = rows.stop
    return joined


def join_frames(parts: Sequence[Frames]) -> Frames:
    """Frames of several logs or buses as one, in the order of time."""
    joined = in_order(list(parts))
    if np.all(joined.time[1:] >= joined.time[:-1]):
        return joined
    return joined.select(np.argsort(joined.time, kind="stable"))


# What lies further behind is no frame that waited in a queue, but a clock set back [s].
_QUEUE: Final = 1.0
# No logger is silent that long and goes on in the same file [s].
_SILENCE: Final = 86400.0
# Counters of 32 bits, in microseconds, tens of them, and milliseconds [s].
_WRAPS: Final = tuple(2.0**32 * tick for tick in (1e-6, 1e-5, 1e-3))


def settle_clock(frames: Frames, source: str) -> tuple[Frames, list[Problem]]:
    """Bring frames into the order of time; correct a counter that wrapped, find a clock that was
    set.

    Parameters
    ----------
    frames : as they were written
    source : the file, for the problems' text

    Returns
    -------
    frames : in the order of time; where the clock was set, the longest part between
    problems : what was corrected or left out
    """
    problems = []
    time = frames.time
    finite = np.isfinite(time)
    if not finite.all():
        frames = frames.select(finite)
        problems.append(
            Problem.of(
                "clock.frames_without", source=source, frames=counted(int((~finite).sum()), "frame")
            )
        )
        time = frames.time
    if len(frames) < 2:
        return frames, problems
    step = np.diff(time)
    breaks = np.flatnonzero((step < -_QUEUE) | (step > _SILENCE))
    if breaks.size and breaks.size < 10_000:
        shift = np.zeros(time.size)
        cuts = []
        for k in breaks:
            wrap = next((w for w in _WRAPS if abs(step[k] + w) < 0.01 * w), None)
            if wrap is not None:
                shift[k + 1 :] += wrap
                at = instant(float(time[k]))
                problems.append(Problem.of("clock.wrapped", source=source, at=at))
            else:
                cuts.append(int(k) + 1)
        time = time + shift
        frames = replace(frames, time=time)
        if cuts:
            edges = [0, *cuts, time.size]
            lengths = np.diff(edges)
            best = int(np.argmax(lengths))
            kept = slice(edges[best], edges[best + 1])
            problems.append(
                Problem.of(
                    "clock.frames_jump",
                    source=source,
                    times=counted(len(cuts), "time"),
                    before=instant(float(time[cuts[0] - 1])),
                    after=instant(float(time[cuts[0]])),
                    count=time.size - int(lengths[best]),
                    frames=time.size,
                )
            )
            frames = frames.select(kept)
            time = frames.time
    elif breaks.size:
        problems.append(Problem.of("clock.frames_sorted", source=source))
    if np.all(time[1:] >= time[:-1]):
        return frames, problems
    return frames.select(np.argsort(time, kind="stable")), problems
