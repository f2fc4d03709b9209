"""Drives in files: read them, write them."""

from weighbridge.io.bus_draft import draft_bus
from weighbridge.io.dbc import load_dbcs
from weighbridge.io.draft import Draft, draft
from weighbridge.io.format import Format, Takes
from weighbridge.io.formats import FORMATS, format_of, formats, is_log
from weighbridge.io.isotp import join_messages
from weighbridge.io.mapping import load_mapping
from weighbridge.io.mapping_text import mapping_text
from weighbridge.io.nmea import Sentence, UnfitSentenceError, read_sentence
from weighbridge.io.parts import join_parts
from weighbridge.io.quiet import PARSE_ERRORS, first_line, quietly
from weighbridge.io.read import read_drive, read_drives, read_table
from weighbridge.io.read_frames import read_frame
from weighbridge.io.stream import DbcStream, J1939Stream, ObdStream, Stream
from weighbridge.io.write import to_frames, write_drive, write_mdf, write_table

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
    "draft",
    "draft_bus",
    "first_line",
    "format_of",
    "formats",
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
