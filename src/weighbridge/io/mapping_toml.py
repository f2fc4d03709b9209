"""A drafted mapping as the text of a TOML file, with what is questionable in its comments."""

from __future__ import annotations

import glob
from collections.abc import Sequence
from pathlib import Path

import tomlkit
from tomlkit.items import Table

from weighbridge.io.draft import Draft
from weighbridge.io.draft_column import DraftColumn
from weighbridge.io.file_patterns import file_patterns
from weighbridge.io.mapping import UNKNOWN_RATE
from weighbridge.io.table import TextFormat
from weighbridge.signals import QUANTITIES
from weighbridge.visible import visible


def mapping_text(
    drafts: Sequence[Draft], others: Sequence[Path] = (), dbc: Sequence[str] = ()
) -> str:
    """Write a mapping: at the top level for one kind of file, else one table for each.

    Parameters
    ----------
    drafts : of the files, one for each kind
    others : files beside them that the mapping is not for
    dbc : DBC files of raw CAN logs, seen from the mapping's folder
    """
    document = tomlkit.document()
    document.add(tomlkit.comment("How to read this log: a mapping for weighbridge."))
    if dbc:
        document.add("dbc", list(dbc))
    if len(drafts) == 1 and not others:
        for name, part in _sections(drafts[0]).items():
            document.add(name, part)
        return tomlkit.dumps(document)
    tables = tomlkit.table(is_super_table=True)
    patterns = file_patterns([one.names for one in drafts], [path.name for path in others])
    patterns = patterns or [glob.escape(one.path.name) for one in drafts]
    for k, (one, pattern) in enumerate(zip(drafts, patterns, strict=True), 1):
        table = tomlkit.table()
        table.add("files", pattern)
        for name, part in _sections(one).items():
            table.add(name, part)
        tables.add(f"table_{k}", table)
    document.add("tables", tables)
    return tomlkit.dumps(document)


def _sections(one: Draft) -> dict[str, Table]:
    found = {"csv": _csv(one.text), "time": _time(one), "signals": _signals(one)}
    return {name: table for name, table in found.items() if len(table)}


def _csv(text: TextFormat) -> Table:
    table = tomlkit.table()
    usual = TextFormat()
    if text.separator is not None:
        table.add("separator", text.separator)
    for key in ("decimal", "skip_rows", "skip_after_header"):
        value = getattr(text, key)
        if value != getattr(usual, key):
            table.add(key, value)
    if text.columns:
        table.add("columns", list(text.columns))
    return table


def _time(one: Draft) -> Table:
    table = tomlkit.table()
    for question in one.questions:
        table.add(tomlkit.comment(visible(question)))
    if one.time:
        table.add("column", one.time)
    if one.time_unit:
        table.add("unit", one.time_unit)
    if one.time_format:
        table.add("format", one.time_format)
    if one.row_rate is not None:
        table.add("rate_hz", UNKNOWN_RATE if one.rate_unknown else one.row_rate)
    return table


def _signals(one: Draft) -> Table:
    table = tomlkit.table(is_super_table=True)
    for column in one.known:
        table.add(column.quantity, _signal(column))
    return table


def _signal(column: DraftColumn) -> Table:
    table = tomlkit.table()
    quantity = QUANTITIES[column.quantity]
    seen = f"{quantity.meaning}; {column.low:.4g} to {column.high:.4g}"
    table.add(tomlkit.comment(visible(f"{seen} {column.unit}".rstrip())))
    if column.question:
        table.add(tomlkit.comment(visible(f"uncertain: {column.question}")))
    table.add("column", column.name)
    if column.unit:
        table.add("unit", column.unit)
    if column.valid:
        table.add("valid", column.valid)
    return table
