"""HDF5: data sets of numbers in groups, units in their attributes."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from weighbridge.errors import DriveError, MissingExtraError
from weighbridge.io.channels import Recording
from weighbridge.io.mapping import TimeColumn
from weighbridge.io.quiet import first_line
from weighbridge.io.table import MOST_COLUMNS
from weighbridge.io.trees import Leaf, Tree, recording_of

# Packed a thousandfold is what deflate can do; a set that promises more is none of a logger.
_MOST_PACKED: Final = 2000


def open_hdf5(path: Path, time: TimeColumn) -> Recording:
    """Read an HDF5 file; see `weighbridge.io.channels.Opener`.

    Raises
    ------
    DriveError
        No HDF5 file, cut off, or with data outside it.
    MissingExtraError
        h5py is not installed.
    """
    try:
        import h5py
    except ImportError:
        raise MissingExtraError("h5py", "hdf5", f"reading {path.name}") from None
    size = path.stat().st_size
    root: dict[str, Any] = {}
    count = 0

    def take(place: str, node: Any) -> None:
        nonlocal count
        if not isinstance(node, h5py.Dataset):
            return
        count += 1
        if count > MOST_COLUMNS:
            raise DriveError(f"{path} has more than {MOST_COLUMNS} data sets; write those needed")
        if node.is_virtual or node.external:
            raise DriveError(f"{path}: {place} lies in another file; copy it into this one")
        if node.size is not None and node.size > _MOST_PACKED * size:
            raise DriveError(f"{path}: {place} promises {node.size} values in {size} bytes")
        *groups, name = place.split("/")
        home = root
        for group in groups:
            home = home.setdefault(group, {})
        leaves = _leaves(name, node)
        home.update(leaves)

    try:
        with h5py.File(path, "r") as file:
            # Links to other places are not followed.
            file.visititems(take)
    except DriveError:
        raise
    # The library's errors on damaged files are of many kinds.
    except Exception as e:
        reason = first_line(e) or type(e).__name__
        raise DriveError(
            f"{path} is not a readable HDF5 file ({reason}); it may have been cut off: copy it "
            "again"
        ) from None
    return recording_of(path, root, time)


def _leaves(name: str, node: Any) -> dict[str, Tree | Leaf]:
    """Arrays of a data set: itself, or one for each field of a table."""
    if node.shape is None or node.size < 2:
        return {}
    if node.dtype.names:
        table = node[()]
        fields = {f: table[f] for f in node.dtype.names}
        return {name: {f: Leaf(np.asarray(x)) for f, x in fields.items() if x.dtype.kind in "biuf"}}
    if node.dtype.kind not in "biuf":
        return {}
    return {name: Leaf(np.asarray(node[()]), _unit(node.attrs))}


def _unit(attributes: Any) -> str:
    for key in attributes:
        if key.lower() in ("unit", "units"):
            value = attributes[key]
            return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
    return ""
