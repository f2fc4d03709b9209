"""Clocks of recorded sources, moved by a known offset and found again."""

from pathlib import Path

import numpy as np
import pytest

from weighbridge import Signal, read_drive
from weighbridge.signals import align

EXAMPLES = Path(__file__).parents[2] / "examples"
MOVED = 1234.5


def lateness(drive):
    """Offset of speed over ground to wheel speed beyond what it was moved by."""
    ground = drive.signals["gnss_speed"]
    moved = Signal(ground.name, ground.time - MOVED, ground.values)
    found = align(drive.signals["vehicle_speed"], moved)
    assert found.found, found.refusal
    return found.offset - MOVED, found.std


def test_files_of_one_logger_agree_on_the_lateness_of_gnss(shared_data):
    """Each file on its own; their spread is to be what they say themselves, within chi-square."""
    folder = shared_data / "canedge-obd-imu-gnss"
    paths = sorted(folder.glob("*/*.MF4"))
    if not paths:
        pytest.skip("no MF4 in canedge-obd-imu-gnss of the recorded drives")
    mapping = EXAMPLES / "canedge" / "mapping.toml"
    found = []
    for path in paths:
        drive = read_drive(path, mapping, dbc=folder / "canmod-gps.dbc")
        if drive.duration > 300.0:
            found.append(lateness(drive))
    offset, std = np.array(found).T
    assert offset.size == 6
    # GNSS is late, by less than half a second.
    assert ((offset < -0.2) & (offset > -0.5)).all()
    assert std.max() < 0.05
    mean = np.average(offset, weights=1.0 / std**2)
    assert np.sum(((offset - mean) / std) ** 2) < 15.1  # 99 % of chi-square with 5


def test_arrays_of_comma2k19_through_their_mapping(shared_data):
    if not (shared_data / "comma2k19").is_dir():
        pytest.skip("no comma2k19 in the recorded drives")
    drive = read_drive(shared_data / "comma2k19", EXAMPLES / "comma2k19" / "mapping.toml")
    assert drive.problems == ()
    assert len(drive.signals["accel_x"]) == 6256
    assert len(drive.signals["vehicle_speed"]) == 4974
    assert len(drive.signals["latitude"]) == 579
    # Forward-right-down at rest reads -g; the segment is nearly level.
    assert abs(np.median(drive.signals["accel_z"].values) + 9.8) < 0.3
    offset, std = lateness(drive)
    assert -0.5 < offset < 0.0
    assert std < 0.05
    # The wheels read 0.991 of the true speed (README of the recordings).
    wheel, ground = drive.signals["vehicle_speed"], drive.signals["gnss_speed"]
    shifted = wheel.at(ground.time + offset)
    good = np.isfinite(shifted)
    assert np.median(shifted[good] / ground.values[good]) == pytest.approx(0.991, abs=0.004)
