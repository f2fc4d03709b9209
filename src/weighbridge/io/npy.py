"""NumPy arrays named in a mapping: columns by number, the time in a column or an array beside.

::

    [tables.imu]
    files = "accelerometer_value.npy"

    [tables.imu.time]
    column = "accelerometer_t.npy"   # an array beside the file, or the number of a column

    [tables.imu.signals.accel_x]
    column = "0"
    unit = "mps2"
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from weighbridge.errors import ConfigError, DriveError
from weighbridge.io.libraries import parsing
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping, in_si, resolved_unit
from weighbridge.signals import UNITS, Floats


def read_npy(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the columns of one array; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        Not an array of numbers, or without a mapping for it.
    ConfigError
        The mapping names a column or a time array that is not there.
    """
    if mapping is None or not mapping.signals:
        raise DriveError(
            f"{path}: an array has no names; name its columns by number in a mapping file, "
            "and under [time] the array that holds its times"
        )
    values = _load(path)
    if values.ndim == 1:
        values = values[:, None]
    if values.ndim != 2:
        raise DriveError(f"{path} has {values.ndim} dimensions; rows and columns are needed")
    source = mapping.source
    column = mapping.time.column
    rate = mapping.time.rate
    if column is None and rate is None:
        raise ConfigError(
            f"{source}: set column in [time] for {path.name}, to the array beside it that holds "
            "its times or to the number of a column; or rate_hz where its rows are even"
        )
    if column is None:
        time = np.arange(float(len(values)))
    elif column.lower().endswith(".npy"):
        time = _load(path.parent / column)
        if time.shape not in ((len(values),), (len(values), 1)):
            raise DriveError(
                f"{path.parent / column} holds {' x '.join(map(str, time.shape))} values and "
                f"{path.name} {len(values)} rows; name the array that goes with it"
            )
        time = time.reshape(-1)
    else:
        time = _column(values, column, path, f"{source}: [time] column")
    factor = UNITS[mapping.time.unit or "s"].factor if rate is None else 1.0 / rate
    time = time * factor + mapping.time.offset
    columns = []
    for s in mapping.signals:
        cells = _column(values, s.column, path, f"{source}: signals.{s.name} column")
        columns.append((s.name, in_si(cells, resolved_unit(s, None, source), s)))
    log = Log(path)
    log.take(time, columns)
    return log


def _load(path: Path) -> Floats:
    if not path.is_file():
        raise DriveError(f"{path}: no such file")
    with parsing(path, "NumPy array"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        # Mapped, a header that promises more than the file holds cannot fill the memory.
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "biuf":
        raise DriveError(f"{path} holds {getattr(array, 'dtype', 'several arrays')}, not numbers")
    return np.array(array, dtype=np.float64)


def _column(values: Floats, name: str, path: Path, where: str) -> Floats:
    if name.strip().isdecimal() and int(name) < values.shape[1]:
        return values[:, int(name)]
    raise ConfigError(f"{where} = {name!r}: {path.name} has the columns 0 to {values.shape[1] - 1}")
