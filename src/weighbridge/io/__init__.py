"""Drives in files: read them, write them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from weighbridge.first_use import at_first_uses

if TYPE_CHECKING:
    from weighbridge.io.bus_draft import draft_bus as draft_bus
    from weighbridge.io.dbc import load_dbcs as load_dbcs
    from weighbridge.io.draft import Draft as Draft
    from weighbridge.io.format import Format as Format
    from weighbridge.io.format import Takes as Takes
    from weighbridge.io.formats import FORMATS as FORMATS
    from weighbridge.io.formats import all_formats as all_formats
    from weighbridge.io.formats import draft_table as draft_table
    from weighbridge.io.formats import format_of as format_of
    from weighbridge.io.formats import is_log as is_log
    from weighbridge.io.isotp import join_messages as join_messages
    from weighbridge.io.mapping import load_mapping as load_mapping
    from weighbridge.io.mapping_toml import mapping_text as mapping_text
    from weighbridge.io.nmea import Sentence as Sentence
    from weighbridge.io.nmea import UnfitSentenceError as UnfitSentenceError
    from weighbridge.io.nmea import read_sentence as read_sentence
    from weighbridge.io.parts import join_parts as join_parts
    from weighbridge.io.quiet import PARSE_ERRORS as PARSE_ERRORS
    from weighbridge.io.quiet import first_line as first_line
    from weighbridge.io.quiet import quietly as quietly
    from weighbridge.io.read import read_drive as read_drive
    from weighbridge.io.read import read_drives as read_drives
    from weighbridge.io.read import read_table as read_table
    from weighbridge.io.read_frames import read_frame as read_frame
    from weighbridge.io.stream import DbcStream as DbcStream
    from weighbridge.io.stream import J1939Stream as J1939Stream
    from weighbridge.io.stream import ObdStream as ObdStream
    from weighbridge.io.stream import Stream as Stream
    from weighbridge.io.write import to_frames as to_frames
    from weighbridge.io.write import write_drive as write_drive
    from weighbridge.io.write import write_mdf as write_mdf
    from weighbridge.io.write import write_table as write_table

__getattr__, __dir__, __all__ = at_first_uses(
    __name__,
    {
        "bus_draft": "draft_bus",
        "dbc": "load_dbcs",
        "draft": "Draft",
        "format": "Format Takes",
        "formats": "FORMATS all_formats draft_table format_of is_log",
        "isotp": "join_messages",
        "mapping": "load_mapping",
        "mapping_toml": "mapping_text",
        "nmea": "Sentence UnfitSentenceError read_sentence",
        "parts": "join_parts",
        "quiet": "PARSE_ERRORS first_line quietly",
        "read": "read_drive read_drives read_table",
        "read_frames": "read_frame",
        "stream": "DbcStream J1939Stream ObdStream Stream",
        "write": "to_frames write_drive write_mdf write_table",
    },
)
