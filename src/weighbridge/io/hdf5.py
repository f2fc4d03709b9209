"""HDF5: data sets of numbers in groups, units in their attributes."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.io.channels import Recording, check_unpacked
from weighbridge.io.libraries import importing, parsing
from weighbridge.io.mapping import TimeColumn
from weighbridge.io.table import MOST_COLUMNS
from weighbridge.io.trees import Leaf, Tree, recording_of

# Packed a thousandfold is what deflate can do; a set that promises more is none of a logger.
_MOST_PACKED: Final = 2000


def open_hdf5(path: Path, time: TimeColumn) -> Recording:
    """Read an HDF5 file; see `weighbridge.io.channels.Opener`.

    Raises
    ------
    DriveError
        No HDF5 file, cut off, with data outside it, or with more than it can hold.
    MissingExtraError
        h5py is not installed.
    """
    with importing("h5py", "hdf5", f"reading {path.name}"):
        import h5py
    size = path.stat().st_size
    root: dict[str, Any] = {}
    sets: dict[str, Any] = {}

    def take(place: str, node: Any) -> None:
        if not isinstance(node, h5py.Dataset):
            return
        if len(sets) == MOST_COLUMNS:
            raise DriveError(f"{path} has more than {MOST_COLUMNS} data sets; write those needed")
        if node.is_virtual or node.external:
            raise DriveError(f"{path}: {place} lies in another file; copy it into this one")
        if node.size is not None and node.size > _MOST_PACKED * size:
            raise DriveError(f"{path}: {place} promises {node.size} values in {size} bytes")
        sets[place] = node

    def read(place: str, node: Any) -> None:
        *groups, name = place.split("/")
        home = root
        for group in groups:
            home = home.setdefault(group, {})
        home.update(_leaves(name, node))

    with parsing(path, "HDF5 file"), h5py.File(path, "r") as file:
        # Links to other places are not followed.
        file.visititems(take)
        check_unpacked(path, sum(_bytes(node) for node in sets.values()))
        for place, node in sets.items():
            read(place, node)
    return recording_of(path, root, time)


def _is_read(node: Any) -> bool:
    numbers = node.dtype.names or node.dtype.kind in "biuf"
    return node.shape is not None and node.size >= 2 and bool(numbers)


def _bytes(node: Any) -> int:
    """Bytes that a data set takes once it is read."""
    return int(node.size) * int(node.dtype.itemsize) if _is_read(node) else 0


def _leaves(name: str, node: Any) -> dict[str, Tree | Leaf]:
    """Arrays of a data set: itself, or one for each field of a table."""
    if not _is_read(node):
        return {}
    if node.dtype.names:
        table = node[()]
        fields = {f: table[f] for f in node.dtype.names}
        return {name: {f: Leaf(np.asarray(x)) for f, x in fields.items() if x.dtype.kind in "biuf"}}
    return {name: Leaf(np.asarray(node[()]), _unit(node.attrs))}


def _unit(attributes: Any) -> str:
    for key in attributes:
        if key.lower() in ("unit", "units"):
            value = attributes[key]
            return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
    return ""
