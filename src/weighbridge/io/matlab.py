"""MATLAB ``.mat`` of any version: structures and arrays of numbers.

Version 7.3 is HDF5. Objects (tables, timetables, timeseries) are of a form that MathWorks does not
publish; `struct` of MATLAB turns them into structures.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from weighbridge.errors import DriveError, MissingExtraError
from weighbridge.io.channels import Recording
from weighbridge.io.mapping import TimeColumn
from weighbridge.io.quiet import first_line, quietly
from weighbridge.io.trees import Leaf, Tree, recording_of, unit_beside

# Structures within structures.
_DEEPEST: Final = 20


def open_mat(path: Path, time: TimeColumn) -> Recording:
    """Read a MATLAB file; see `weighbridge.io.channels.Opener`.

    Raises
    ------
    DriveError
        No MATLAB file, or cut off.
    MissingExtraError
        pymatreader or h5py is not installed.
    """
    try:
        import h5py  # noqa: F401  (what pymatreader reads version 7.3 with)
        from pymatreader import read_mat
    except ImportError:
        raise MissingExtraError("pymatreader", "mat", f"reading {path.name}") from None
    try:
        with warnings.catch_warnings(), quietly():
            # Of objects that it cannot read the library warns; they are missed by their names.
            warnings.simplefilter("ignore")
            held = read_mat(str(path))
    except OSError as e:
        if e.errno is not None and e.filename is not None:
            raise
        raise _damaged(path, e) from None
    # The libraries' errors on damaged files are of many kinds, down to MemoryError.
    except Exception as e:
        raise _damaged(path, e) from None
    found = recording_of(path, _tree(held, 0), time)
    if not found.channels:
        found.notes.append(
            "tables, timetables and timeseries are objects that only MATLAB reads: save their "
            "columns as arrays"
        )
    return found


def _damaged(path: Path, error: Exception) -> DriveError:
    reason = first_line(error) or type(error).__name__
    return DriveError(
        f"{path} is not a readable MATLAB file ({reason}); it may have been cut off: copy it again"
    )


def _tree(group: Mapping[str, Any], depth: int) -> Tree:
    """Groups and arrays of what the library hands over."""
    if depth > _DEEPEST:
        return {}
    unit = unit_beside(group)
    found: dict[str, Tree | Leaf] = {}
    for name, value in group.items():
        if str(name).startswith("__"):
            continue
        if isinstance(value, Mapping):
            found[str(name)] = _tree(value, depth + 1)
        elif isinstance(value, list) and value and all(isinstance(x, Mapping) for x in value):
            found[str(name)] = {_label(x, k): _tree(x, depth + 1) for k, x in enumerate(value)}
        else:
            leaf = _leaf(value, unit)
            if leaf is not None:
                found[str(name)] = leaf
    return found


def _label(element: Mapping[str, Any], index: int) -> str:
    """Name of an element of a list of structures: Simulink gives each signal a label."""
    label = element.get("label")
    return label if isinstance(label, str) and label else str(index)


def _leaf(value: Any, unit: str) -> Leaf | None:
    if isinstance(value, list) and all(isinstance(x, int | float) for x in value):
        value = np.array(value, dtype=np.float64)
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf" or value.size < 2:
        return None
    return Leaf(value, unit)
