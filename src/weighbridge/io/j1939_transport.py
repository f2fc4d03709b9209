"""The transport protocol of J1939: messages longer than a frame, in packets."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.io.frames import Frames, bits

# J1939-21 5.10.2.4: packets of one message come within T1 = 0.75 s (broadcast)
# or T2 = 1.25 s; a receiver that lags may ask again, so the longer one is taken.
PACKET_TIME: Final = 1.25


def assemble(control: Frames, data: Frames, wanted: int) -> tuple[Frames, int]:
    """Put messages of the transport protocol together (J1939-21, 5.10).

    Both ways look the same to a listener: an announcement by broadcast (BAM)
    or to one address (RTS), then packets of seven bytes under a number each.

    Returns
    -------
    messages : whole ones of the group ``wanted``; time of the last packet
    incomplete : number of those with parts missing
    """
    empty = Frames.empty()
    if not len(control):
        return empty, 0
    opens = np.isin(control.data[:, 0], (16, 32)) & (control.length == 8)
    ends = opens | (control.data[:, 0] == 255)
    number = bits(control.data, 40, 24)
    # Bus, sender and receiver; an abort may come from either end.
    pair = _pair(control)
    back = _pair(control, swapped=True)
    pair_data = _pair(data)
    whole: list[tuple[int, float, NDArray[np.uint8]]] = []
    incomplete = 0
    for k in np.flatnonzero(opens & (number == wanted)).tolist():
        size = int(control.data[k, 1]) | int(control.data[k, 2]) << 8
        packets = int(control.data[k, 3])
        if packets == 0 or size > 7 * packets:
            incomplete += 1
            continue
        later = np.flatnonzero(
            ends[k + 1 :] & ((pair[k + 1 :] == pair[k]) | (back[k + 1 :] == pair[k]))
        )
        end = float(control.time[k]) + PACKET_TIME * (packets + 1)
        if later.size:
            end = min(end, float(control.time[k + 1 + later[0]]))
        a, b = np.searchsorted(data.time, [control.time[k], end], side="left")
        rows = a + np.flatnonzero((pair_data[a:b] == pair[k]) & (data.length[a:b] == 8))
        sequence = data.data[rows, 0].astype(np.int64)
        rows, sequence = rows[sequence <= packets], sequence[sequence <= packets]
        # A packet sent again replaces the one before.
        places = np.full(packets + 1, -1)
        places[sequence] = rows
        if (places[1:] < 0).any():
            incomplete += 1
            continue
        body = data.data[places[1:], 1:8].reshape(-1)[:size]
        whole.append((k, float(data.time[places[1:].max()]), body))
    if not whole:
        return empty, incomplete
    width = max(body.size for *_, body in whole)
    picked = np.array([k for k, *_ in whole])
    joined = np.zeros((len(whole), width), dtype=np.uint8)
    for row, (*_, body) in zip(joined, whole, strict=True):
        row[: body.size] = body
    return (
        Frames(
            time=np.array([t for _, t, _ in whole]),
            channel=control.channel[picked],
            id=control.id[picked],
            extended=control.extended[picked],
            length=np.array([min(body.size, 255) for *_, body in whole], dtype=np.uint8),
            data=joined,
        ),
        incomplete,
    )


def _pair(frames: Frames, *, swapped: bool = False) -> NDArray[np.int64]:
    """Bus, sender and receiver of addressed frames as one number."""
    sender = (frames.id & 0xFF).astype(np.int64)
    receiver = (frames.id >> 8 & 0xFF).astype(np.int64)
    if swapped:
        sender, receiver = receiver, sender
    return frames.channel.astype(np.int64) << 16 | sender << 8 | receiver
