"""National Instruments TDMS: channels in groups, waveforms with a clock of their own.

The properties ``wf_start_time``, ``wf_start_offset``, ``wf_increment`` and ``unit_string`` are
those that LabVIEW writes.
"""

from __future__ import annotations

import logging
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.io.channels import Recording
from weighbridge.io.libraries import importing, parsing
from weighbridge.io.mapping import TimeColumn
from weighbridge.io.trees import Leaf, recording_of
from weighbridge.signals import Floats


def open_tdms(path: Path, time: TimeColumn) -> Recording:
    """Read a TDMS file; see `weighbridge.io.channels.Opener`.

    Raises
    ------
    DriveError
        No TDMS file, or cut off before its first values.
    MissingExtraError
        npTDMS is not installed.
    """
    with importing("npTDMS", "tdms", f"reading {path.name}"):
        from nptdms import TdmsFile
        from nptdms.log import log_manager
    log_manager.set_level(logging.CRITICAL)
    starts: set[bool] = set()
    clocks: dict[tuple[float, float, int], Floats] = {}
    tree: dict[str, Any] = {}
    with parsing(path, "TDMS file"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for group in TdmsFile.read(path).groups():
            here = tree.setdefault(group.name, {})
            for channel in group.channels():
                leaf, dated = _leaf(channel, time, clocks)
                here[channel.name] = leaf
                starts |= {dated} if leaf.time is not None else set()
    if starts == {True, False}:
        raise DriveError(
            f"{path}: some of its waveforms have a start time and others none; name the time of "
            "all as column in [time] of a mapping"
        )
    found = recording_of(path, tree, time)
    found.absolute = found.absolute or starts == {True}
    return found


def _leaf(
    channel: Any, time: TimeColumn, clocks: dict[tuple[float, float, int], Floats]
) -> tuple[Leaf, bool]:
    """Values of a channel, with the clock of a waveform, and whether that counts from 1970.

    Waveforms of one start and step share their clock.
    """
    values = np.asarray(channel[:])
    reported = channel.properties
    unit = str(reported.get("unit_string", ""))
    step = reported.get("wf_increment")
    if time.column is not None or not isinstance(step, float) or step <= 0.0:
        return Leaf(values, unit), False
    start = reported.get("wf_start_time")
    begin = float(reported.get("wf_start_offset", 0.0))
    dated = isinstance(start, np.datetime64) and not np.isnat(start)
    if dated:
        begin += float(np.datetime64(start, "us").astype(np.int64)) * 1e-6
    key = (begin, step, int(values.size))
    if key not in clocks:
        clocks[key] = begin + step * np.arange(values.size, dtype=np.float64)
    return Leaf(values, unit, clocks[key]), dated
