"""ASAM MDF bus logging: the CAN frames of an MF4, as arrays."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.io.frames import EXTENDED_MASK, Frames, in_order

_DATA_FRAME: Final = "CAN_DataFrame"
_NUMBERS: Final = frozenset({"ID", "IDE", "DataLength", "DLC", "BusChannel"})
# Bytes that a data length code means (ISO 11898-1).
_DLC: Final = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64], np.uint8)


def bus_frames(file: Any) -> Frames:
    """All CAN data frames of an open MDF file.

    Parameters
    ----------
    file : `asammdf.MDF`

    Returns
    -------
    Frames
        In the order of the file, group after group; time since its start.
    """
    parts = []
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
