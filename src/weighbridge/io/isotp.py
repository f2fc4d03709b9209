"""ISO-TP (ISO 15765-2): messages put together from the frames that carry them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.io.frames import Frames
from weighbridge.signals import Bools, Floats

MESSAGE_LIMIT: Final = 256
"""Longer messages are not put together: no answer with measured values is [bytes]."""

# N_Cr, the longest wait for the next frame of a message, is 1 s (ISO 15765-2, timing).
_LONGEST_WAIT: Final = 1.0

_PCI_FIRST: Final = 1
_PCI_CONSECUTIVE: Final = 2


@dataclass(frozen=True, slots=True)
class Messages:
    """Messages of one sender on one bus.

    Attributes
    ----------
    time : (m,) when the first frame of each was on the bus [s]
    length : (m,) bytes
    data : (m, w) uint8, padded with zeros behind ``length``
    broken : messages begun whose frames are not all there
    frames : frames that were part of a message
    """

    time: Floats
    length: NDArray[np.int64]
    data: NDArray[np.uint8]
    broken: int
    frames: int


def join_messages(frames: Frames) -> Messages:
    """Put the messages of one sender together.

    A message is kept only where all its frames are there, in the order of
    their sequence numbers, each within one second of the one before.

    Parameters
    ----------
    frames : of one identifier on one bus, in the order of time

    Returns
    -------
    Messages
        In the order of time.
    """
    kind = frames.data[:, 0] >> 4
    present = frames.length > 0
    single = present & (kind == 0)
    first = present & (kind == _PCI_FIRST) & (frames.length >= 8)
    single_data, single_length = _single(frames, single)
    multi_data, multi_length, multi_at, begun = _multi(
        frames, first, present & (kind == _PCI_CONSECUTIVE)
    )
    at = np.concatenate([np.flatnonzero(single), multi_at])
    width = max(single_data.shape[1], multi_data.shape[1])
    data = np.concatenate(
        [np.pad(d, ((0, 0), (0, width - d.shape[1]))) for d in (single_data, multi_data)]
    )
    length = np.concatenate([single_length, multi_length])
    good = length > 0
    order = np.argsort(at[good], kind="stable")
    return Messages(
        time=frames.time[at[good][order]],
        length=length[good][order],
        data=data[good][order],
        broken=begun - multi_at.size,
        frames=int(np.count_nonzero(present & (kind <= _PCI_CONSECUTIVE))),
    )


def _single(frames: Frames, which: Bools) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Payloads of single frames; length 0 where the frame is shorter than it says."""
    data, size = frames.data[which], frames.length[which].astype(np.int64)
    length = (data[:, 0] & 0x0F).astype(np.int64)
    # CAN FD: a zero in the first byte says that the length is in the second.
    escaped = (length == 0) & (size > 8)
    length[escaped] = data[escaped, 1]
    start = np.where(escaped, 2, 1)
    length[start + length > size] = 0
    payload = data[:, 1:].copy()
    payload[escaped, :-1] = data[escaped, 2:]
    payload[np.arange(payload.shape[1]) >= length[:, None]] = 0
    return payload, length


def _multi(
    frames: Frames, first: Bools, consecutive: Bools
) -> tuple[NDArray[np.uint8], NDArray[np.int64], NDArray[np.int64], int]:
    """Payloads and lengths of whole multi-frame messages, where each begins, how many did."""
    at = np.flatnonzero(first)
    total = ((frames.data[at, 0] & 0x0F).astype(np.int64) << 8) | frames.data[at, 1]
    head = frames.length[at].astype(np.int64) - 2
    usable = (total > head) & (total <= MESSAGE_LIMIT)
    at, total, head = at[usable], total[usable], head[usable]
    if at.size == 0:
        return np.zeros((0, 7), np.uint8), np.zeros(0, np.int64), at, 0
    # Every consecutive frame belongs to the last message begun before it.
    rest = np.flatnonzero(consecutive)
    owner = np.searchsorted(at, rest) - 1
    rest, owner = rest[owner >= 0], owner[owner >= 0]
    # Any other first frame in between, even one not usable, ends a message.
    begun = np.cumsum(first)
    same = begun[rest] == begun[at[owner]]
    rest, owner = rest[same], owner[same]
    rank = np.arange(rest.size) - np.searchsorted(owner, owner)
    size = frames.length[rest].astype(np.int64) - 1
    before = np.where(rank == 0, at[owner], rest[np.maximum(np.arange(rest.size) - 1, 0)])
    in_turn = (frames.data[rest, 0] & 0x0F) == ((rank + 1) & 0x0F)
    in_time = frames.time[rest] - frames.time[before] <= _LONGEST_WAIT
    # All frames of a message but the last are as long as its first.
    full = head[owner] + 1
    start = head[owner] + rank * full
    needed = np.minimum(full, total[owner] - start)
    good = (needed > 0) & in_turn & in_time & (size >= needed)
    count = np.bincount(owner[good], minlength=at.size)
    whole = count == -((head - total) // (head + 1))
    payload = np.zeros((at.size, int(total.max())), np.uint8)
    begun_with = np.arange(int(head.max()))
    payload[:, : begun_with.size] = np.where(
        begun_with < head[:, None], frames.data[at, 2 : 2 + begun_with.size], 0
    )
    rows, columns = np.nonzero(good[:, None] & (np.arange(int(head.max()) + 1) < needed[:, None]))
    payload[owner[rows], start[rows] + columns] = frames.data[rest[rows], 1 + columns]
    return payload[whole], total[whole], at[whole], at.size
