"""Tables, facts and remarks of a page as HTML."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final

from weighbridge.report.table import Table
from weighbridge.report.text import prose, sentence

STACKED: Final = 4
"""Columns from which a table becomes one block per row on a telephone."""


def left_out(reasons: Sequence[str]) -> str:
    """Say what is not there and why; nothing where all is."""
    if not reasons:
        return ""
    listed = " ".join(sentence(text) for text in reasons)
    return f'<p class="absent">Left out: {prose(listed)}</p>'


def remarks(texts: Sequence[str]) -> str:
    """List findings and corrections; nothing where there are none."""
    if not texts:
        return ""
    noted = "".join(f"<li>{prose(sentence(text))}</li>" for text in dict.fromkeys(texts))
    return f'<h3>Findings and corrections</h3><ul class="warnings">{noted}</ul>'


def text_table(table: Table) -> str:
    """Return a table of texts: numbers to the right, the first column and sentences to the left."""
    # A cell of more than 24 letters is a sentence rather than a number with its unit.
    kinds = [
        "w" if any(len(row[k]) > 24 for row in table.rows) else "n" if k else ""
        for k in range(len(table.columns))
    ]
    return html_table(
        table.title,
        list(zip(table.columns, kinds, strict=True)),
        [list(zip(row, kinds, strict=True)) for row in table.rows],
        table.marked,
    )


def html_table(
    caption: str,
    heads: Sequence[tuple[str, str]],
    rows: Sequence[Sequence[tuple[str, str]]],
    marked: Sequence[int] = (),
) -> str:
    """Return a table of texts, each with its class ("n" for a number, "w" for words).

    Parameters
    ----------
    caption : above it; may be empty
    heads, rows : texts with their classes
    marked : indices of rows to mark
    """

    def cell(text: str, kind: str, label: str) -> str:
        named = f' data-label="{escape(label)}"' if label else ""
        return f"<td{f' class={kind}' if kind else ''}{named}>{prose(text)}</td>"

    head = "".join(
        f"<th scope=col{f' class={kind}' if kind else ''}>{escape(text)}</th>"
        for text, kind in heads
    )
    body = "".join(
        f"<tr{' class=marked' if k in marked else ''}>"
        + "".join(cell(*c, label) for c, (label, _) in zip(row, heads, strict=True))
        + "</tr>"
        for k, row in enumerate(rows)
    )
    stacked = " class=stacked" if len(heads) >= STACKED else ""
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(caption or "table")}">'
        f"<table{stacked}>{f'<caption>{escape(caption)}</caption>' if caption else ''}"
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def facts_list(facts: Sequence[tuple[str, str]]) -> str:
    """Return names with their values."""
    items = "".join(f"<div><dt>{escape(k)}</dt><dd>{escape(v)}</dd></div>" for k, v in facts)
    return f"<dl>{items}</dl>"
