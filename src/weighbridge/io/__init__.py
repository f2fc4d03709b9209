"""Drives in files: read them, write them."""

from weighbridge.io.read import READERS, read_drive, read_table
from weighbridge.io.write import write_drive, write_mdf, write_table

__all__ = ["READERS", "read_drive", "read_table", "write_drive", "write_mdf", "write_table"]
