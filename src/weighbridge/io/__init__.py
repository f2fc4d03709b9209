"""Drives in files: read them, write them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from weighbridge.first_use import at_first_use

if TYPE_CHECKING:
    from weighbridge.io.bus_draft import draft_bus
    from weighbridge.io.dbc import load_dbcs
    from weighbridge.io.draft import Draft
    from weighbridge.io.format import Format, Takes
    from weighbridge.io.formats import FORMATS, all_formats, draft_table, format_of, is_log
    from weighbridge.io.isotp import join_messages
    from weighbridge.io.mapping import load_mapping
    from weighbridge.io.mapping_toml import mapping_text
    from weighbridge.io.nmea import Sentence, UnfitSentenceError, read_sentence
    from weighbridge.io.parts import join_parts
    from weighbridge.io.quiet import PARSE_ERRORS, first_line, quietly
    from weighbridge.io.read import read_drive, read_drives, read_table
    from weighbridge.io.read_frames import read_frame
    from weighbridge.io.stream import DbcStream, J1939Stream, ObdStream, Stream
    from weighbridge.io.write import to_frames, write_drive, write_mdf, write_table

_HOMES = {
    "FORMATS": "weighbridge.io.formats",
    "PARSE_ERRORS": "weighbridge.io.quiet",
    "DbcStream": "weighbridge.io.stream",
    "Draft": "weighbridge.io.draft",
    "Format": "weighbridge.io.format",
    "J1939Stream": "weighbridge.io.stream",
    "ObdStream": "weighbridge.io.stream",
    "Sentence": "weighbridge.io.nmea",
    "Stream": "weighbridge.io.stream",
    "Takes": "weighbridge.io.format",
    "UnfitSentenceError": "weighbridge.io.nmea",
    "all_formats": "weighbridge.io.formats",
    "draft_bus": "weighbridge.io.bus_draft",
    "draft_table": "weighbridge.io.formats",
    "first_line": "weighbridge.io.quiet",
    "format_of": "weighbridge.io.formats",
    "is_log": "weighbridge.io.formats",
    "join_messages": "weighbridge.io.isotp",
    "join_parts": "weighbridge.io.parts",
    "load_dbcs": "weighbridge.io.dbc",
    "load_mapping": "weighbridge.io.mapping",
    "mapping_text": "weighbridge.io.mapping_toml",
    "quietly": "weighbridge.io.quiet",
    "read_drive": "weighbridge.io.read",
    "read_drives": "weighbridge.io.read",
    "read_frame": "weighbridge.io.read_frames",
    "read_sentence": "weighbridge.io.nmea",
    "read_table": "weighbridge.io.read",
    "to_frames": "weighbridge.io.write",
    "write_drive": "weighbridge.io.write",
    "write_mdf": "weighbridge.io.write",
    "write_table": "weighbridge.io.write",
}

__all__ = [
    "FORMATS",
    "PARSE_ERRORS",
    "DbcStream",
    "Draft",
    "Format",
    "J1939Stream",
    "ObdStream",
    "Sentence",
    "Stream",
    "Takes",
    "UnfitSentenceError",
    "all_formats",
    "draft_bus",
    "draft_table",
    "first_line",
    "format_of",
    "is_log",
    "join_messages",
    "join_parts",
    "load_dbcs",
    "load_mapping",
    "mapping_text",
    "quietly",
    "read_drive",
    "read_drives",
    "read_frame",
    "read_sentence",
    "read_table",
    "to_frames",
    "write_drive",
    "write_mdf",
    "write_table",
]

__getattr__ = at_first_use(__name__, _HOMES)
