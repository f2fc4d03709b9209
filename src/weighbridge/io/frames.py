"""Raw bus traffic: what every reader of CAN logs hands to the decoders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from weighbridge.signals import Floats

EXTENDED_MASK = 0x1FFFFFFF
"""The 29 bits of an extended identifier."""


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
        return cls(
            np.empty(0),
            np.empty(0, np.int16),
            np.empty(0, np.uint32),
            np.empty(0, np.bool_),
            np.empty(0, np.uint8),
            np.empty((0, 8), np.uint8),
        )

    def select(self, which: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Frames:
        """Frames under a mask, a slice or indices."""
        return Frames(
            self.time[which],
            self.channel[which],
            self.id[which],
            self.extended[which],
            self.length[which],
            self.data[which],
        )

    def counts(self) -> dict[tuple[int, int, bool], int]:
        """How often each (channel, id, extended) was seen, the lowest first."""
        keys, numbers = np.unique(self.keys(), return_counts=True)
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


def join_frames(parts: Sequence[Frames]) -> Frames:
    """Frames of several logs or buses as one, in the order of time."""
    parts = [p for p in parts if len(p)]
    if not parts:
        return Frames.empty()
    if len(parts) == 1:
        joined = parts[0]
    else:
        width = max(p.data.shape[1] for p in parts)
        joined = Frames(
            np.concatenate([p.time for p in parts]),
            np.concatenate([p.channel for p in parts]),
            np.concatenate([p.id for p in parts]),
            np.concatenate([p.extended for p in parts]),
            np.concatenate([p.length for p in parts]),
            np.concatenate([np.pad(p.data, ((0, 0), (0, width - p.data.shape[1]))) for p in parts]),
        )
    if np.all(joined.time[1:] >= joined.time[:-1]):
        return joined
    return joined.select(np.argsort(joined.time, kind="stable"))
