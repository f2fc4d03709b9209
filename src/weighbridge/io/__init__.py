"""Drives in files: read them, write them."""

from weighbridge.io.format import Format, Takes
from weighbridge.io.formats import FORMATS
from weighbridge.io.read import read_drive, read_drives, read_table
from weighbridge.io.read_frames import read_frame
from weighbridge.io.write import to_frames, write_drive, write_mdf, write_table

__all__ = [
    "FORMATS",
    "Format",
    "Takes",
    "read_drive",
    "read_drives",
    "read_frame",
    "read_table",
    "to_frames",
    "write_drive",
    "write_mdf",
    "write_table",
]
