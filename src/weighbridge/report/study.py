"""One HTML page of tables and figures, for what is not a weighing."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from weighbridge.report.document import Page, write_document
from weighbridge.report.markup import text_table
from weighbridge.report.style import Panel
from weighbridge.report.table import Table


def write_study(
    title: str, tables: Sequence[Table], panels: Sequence[Panel], path: Path, *, answer: str = ""
) -> None:
    """Write tables and figures as one page that opens offline.

    Parameters
    ----------
    title : heading of the page
    tables : come first, after the answer
    panels : figures, after the tables
    path : of the page
    answer : HTML above all else

    Raises
    ------
    ConfigError
        The file cannot be written.
    """
    page = Page()
    parts = [text_table(table) for table in tables]
    body = "".join(parts) + page.place(panels)
    write_document(title, [f"<main>{answer}{body}</main>"], page, path)
