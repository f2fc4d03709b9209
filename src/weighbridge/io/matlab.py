"""MATLAB ``.mat`` of any version: structures and arrays of numbers.

Version 7.3 is HDF5. Objects (tables, timetables, timeseries) are of a form that MathWorks does not
publish; `struct` of MATLAB turns them into structures.
"""

from __future__ import annotations

import warnings
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from weighbridge.io.channels import Recording, check_unpacked
from weighbridge.io.libraries import importing, parsing
from weighbridge.io.mapping import TimeColumn
from weighbridge.io.quiet import quietly
from weighbridge.io.trees import Leaf, Tree, recording_of, unit_beside
from weighbridge.messages import Problem

# Structures within structures.
_DEEPEST: Final = 20

# Version 5: a header, then elements of a type and a length; one type holds another, deflated
# (MathWorks, *MAT-File Format*).
_HEADER: Final = 128
_TAG: Final = 8
_MATRIX: Final = 14
_DEFLATED: Final = 15
_BLOCK: Final = 1 << 16


def open_mat(path: Path, time: TimeColumn) -> Recording:
    """Read a MATLAB file; see `weighbridge.io.channels.Opener`.

    Raises
    ------
    DriveError
        No MATLAB file, cut off, or one that unpacks to far more than it can hold.
    MissingExtraError
        pymatreader or h5py is not installed.
    """
    with importing("pymatreader", "mat", f"reading {path.name}"):
        import h5py
        from pymatreader import read_mat
    with parsing(path, "MATLAB file"):
        if h5py.is_hdf5(path):
            with h5py.File(path, "r") as file:
                _check_sets(path, file, h5py.Dataset)
        _check_deflated(path)
        with warnings.catch_warnings(), quietly():
            # Of objects that it cannot read the library warns; they are missed by their names.
            warnings.simplefilter("ignore")
            held = read_mat(str(path))
    found = recording_of(path, _tree(held, 0), time)
    if not found.channels:
        found.notes.append(Problem.of("file.matlab_objects"))
    return found


def _check_sets(path: Path, file: Any, kind: type) -> None:
    """Refuse what version 7.3 unpacks out of proportion."""
    size = 0

    def add(_: str, node: Any) -> None:
        nonlocal size
        if isinstance(node, kind):
            data: Any = node
            size += int(data.size or 0) * int(data.dtype.itemsize)

    file.visititems(add)
    check_unpacked(path, size)


def _check_deflated(path: Path) -> None:
    """Refuse what version 5 unpacks out of proportion: inflate it piece by piece and count."""
    size = 0
    with path.open("rb") as file:
        order: Literal["little", "big"] = "big" if file.read(_HEADER)[-2:] == b"MI" else "little"
        while len(tag := file.read(_TAG)) == _TAG:
            kind, length = int.from_bytes(tag[:4], order), int.from_bytes(tag[4:], order)
            if kind not in (_MATRIX, _DEFLATED):
                return
            after = file.tell() + length
            stream = zlib.decompressobj()
            while kind == _DEFLATED and length > 0 and not stream.eof:
                packed = file.read(min(_BLOCK, length))
                if not packed:
                    return
                length -= len(packed)
                try:
                    size += len(stream.decompress(packed))
                except zlib.error:
                    # What is damaged the library shows in its words.
                    return
                check_unpacked(path, size)
            file.seek(after)


def _tree(group: Mapping[str, Any], depth: int) -> Tree:
    """Groups and arrays of what the library hands over."""
    if depth > _DEEPEST:
        return {}
    if {"X", "Y"} <= group.keys() and (rasters := _rasters(group["X"], group["Y"])):
        return rasters
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


def _rasters(clocks: Any, signals: Any) -> Tree:
    """Groups of a recording of dSPACE ControlDesk: a clock each, and the signals that are on it.

    ``X`` holds the clocks, ``Y`` the signals with the number of their clock (dSPACE, *MAT file
    export of ControlDesk*).

    Parameters
    ----------
    clocks, signals : structures, or what they hold by name

    Returns
    -------
    Empty where they are no such recording.
    """
    found: dict[str, dict[str, Tree | Leaf]] = {}
    times = [_leaf(x.get("Data"), str(x.get("Unit", ""))) for x in _elements(clocks)]
    for signal in _elements(signals):
        leaf = _leaf(signal.get("Data"), str(signal.get("Unit", "")))
        number = signal.get("XIndex")
        if leaf is None or not isinstance(number, int) or not 1 <= number <= len(times):
            continue
        clock = times[number - 1]
        if clock is None:
            continue
        raster = found.setdefault(f"raster {number}", {"time": clock})
        raster[str(signal.get("Name", len(raster)))] = leaf
    return found


def _elements(structures: Any) -> list[dict[str, Any]]:
    """Elements of an array of structures, however the library hands it over."""
    if isinstance(structures, list):
        return [x for x in structures if isinstance(x, dict)]
    if not isinstance(structures, Mapping):
        return []
    names = structures.get("Name")
    if isinstance(names, str):
        return [dict(structures)]
    if not isinstance(names, list):
        return []
    return [
        {key: reported[k] for key, reported in structures.items() if len(reported) == len(names)}
        for k in range(len(names))
    ]


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
