"""Files of a drive's folder that were not read, though they look like logs of it."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import pyarrow as pa
import pyarrow.parquet as pq

from weighbridge.errors import DriveError
from weighbridge.io.draft_text import HEAD_LINES, text_format
from weighbridge.io.naming import recognise_all
from weighbridge.io.table import head
from weighbridge.io.understood import cells
from weighbridge.messages import phrase
from weighbridge.signals import Problem

_FEWEST: Final = 2
"""Columns of a table that are known by their names, from which on it looks like a log."""

_OWN: Final = ("std_kg", "sprung_mass_std_kg", "payload_low95_kg")
"""Columns of results of ours, which no log has."""


def left_out(folder: Path, files: Sequence[Path], mapping: str) -> Iterator[Problem]:
    """Report tables that no one has described.

    Parameters
    ----------
    folder : of the drive
    files : in it, that were not read
    mapping : the mapping that the others were read with; empty for none
    """
    for path in files:
        if not _looks_like_a_log(path):
            continue
        why = phrase("no_pattern_fits", mapping=mapping) if mapping else phrase("names_of_its_own")
        yield Problem.of("file.not_read", file=path.name, why=why, folder=shlex.quote(str(folder)))


def _looks_like_a_log(path: Path) -> bool:
    """Whether the header of a table names quantities; a result of ours, or no table, does not."""
    try:
        if path.suffix.lower() in (".parquet", ".pq"):
            names = list(pq.read_schema(path).names)
        elif path.suffix.lower() in (".csv", ".txt", ".tsv"):
            text, _ = text_format(path)
            lines = head(path, HEAD_LINES)
            names = cells(lines[text.skip_rows], text.separator or ",")
        else:
            # An array is one of many, and which are of use the mapping says.
            return path.suffix.lower() != ".npy"
    except (DriveError, OSError, pa.ArrowException):
        return False
    if set(names) & set(_OWN):
        return False
    known = {named.quantity for named in recognise_all(names)} - {""}
    return len(known) >= _FEWEST
