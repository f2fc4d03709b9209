"""The file of a page: figures collected, data and plot library packed inside, nothing outside."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Sequence
from functools import cache
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Final

from weighbridge.data import text_of
from weighbridge.report.markup import left_out, text_table
from weighbridge.report.style import Panel, Section, in_shown_units
from weighbridge.visible import shown_json, visible, visible_text
from weighbridge.whole import write_whole

if TYPE_CHECKING:
    from weighbridge.report.tiles import Tiles

POLICY: Final = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
)
"""What a browser lets the page load: nothing but what is in it; a server of tiles comes behind."""


class Page:
    """Collects the figures of a page and places them."""

    def __init__(self) -> None:
        self.figures: dict[str, str] = {}

    def place(self, panels: Sequence[Panel]) -> str:
        """Return the HTML of the panels and keep their data for the end of the page."""
        absent = tuple(p.absent for p in panels if p.figure is None and p.absent)
        return self.figures_of(panels) + left_out(absent)

    def figures_of(self, panels: Sequence[Panel]) -> str:
        """Return the HTML of the panels that have a figure."""
        drawn = []
        for panel in panels:
            if panel.figure is None:
                continue
            key = f"figure-{len(self.figures) + 1}"
            self.figures[key] = in_shown_units(panel.figure).to_json(validate=False)
            height = int(panel.figure.layout.height)
            drawn.append(
                f"<figure{' class=wide' if panel.wide else ''}><h4>{escape(panel.title)}</h4>"
                f'<div class="plot" id="{key}" tabindex="0" role="group" '
                f'aria-label="{escape(panel.title)}" style="min-height:{height}px"></div>'
                f"<figcaption>{escape(panel.caption)}</figcaption></figure>"
            )
        return f'<div class="panels">{"".join(drawn)}</div>' if drawn else ""

    def sections(self, sections: Sequence[Section], prefix: str) -> str:
        """Return the HTML of the sections that have something to show, with links to them.

        Parameters
        ----------
        sections
        prefix : of their anchors, another for each drive of the page
        """
        shown = [s for s in sections if s.present]
        links = "".join(f'<a href="#{prefix}{s.key}">{escape(s.title)}</a>' for s in shown)
        parts = [f'<nav aria-label="Sections">{links}</nav>']
        for section in shown:
            table = text_table(section.table) if section.table is not None else ""
            parts.append(
                f'<section id="{prefix}{section.key}"><h3>{escape(section.title)}</h3>'
                f'<p class="lead">{escape(section.lead)}</p>{table}'
                f"{self.figures_of(section.panels)}{left_out(section.missing)}</section>"
            )
        gone = tuple(text for s in sections if not s.present for text in s.missing)
        return "".join(parts) + left_out(gone)

    def data(self) -> str:
        """Return all figures as one JSON text."""
        body = ",".join(f"{json.dumps(k)}:{shown_json(v)}" for k, v in self.figures.items())
        return "{" + body + "}"


def write_document(
    heading: str, parts: Sequence[str], page: Page, path: Path, tiles: Tiles | None = None
) -> None:
    """Put parts of HTML and the figures they place into one file that opens offline.

    Parameters
    ----------
    heading : title of the page
    parts : HTML, in order
    page : what placed the figures
    path : file to write
    tiles : server that the page may load pictures from; None for none

    Raises
    ------
    ConfigError
        The file cannot be written.
    """
    # Texts of files are shown, never obeyed: no control character turns a line round.
    heading = visible(heading)
    html = "".join(
        [
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{_policy(tiles)}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            # No address is ever asked for anything: icon, styles and scripts are inside.
            '<link rel="icon" href="data:,">',
            f"<title>{escape(heading)}</title>",
            f"<style>{text_of('report', 'page.css')}</style>",
            f"</head><body><h1>{escape(heading)}</h1>",
            "<noscript><p>The figures need JavaScript; the tables do not.</p></noscript>"
            '<p id="old" hidden>The figures need a browser of 2023 or later.</p>',
            *map(visible_text, parts),
            "<footer>Made by weighbridge from data the vehicle recorded. For screening: not a "
            "legal-for-trade weighing. Masses are of all that rolls; every ± and every interval "
            f"holds the value with 95 % probability.{_asked(tiles)}</footer>",
            f'<script type="text/plain" id="figures">{packed(page.data())}</script>',
            f'<script type="text/plain" id="library">{_library()}</script>' if page.figures else "",
            f"<script>{text_of('report', 'page.js')}</script>",
            "</body></html>\n",
        ]
    )
    write_whole(path, html)


def _policy(tiles: Tiles | None) -> str:
    return POLICY if tiles is None else f"{POLICY} {tiles.origin}"


def _asked(tiles: Tiles | None) -> str:
    """Say which server the page asks; empty where it asks none."""
    return "" if tiles is None else f" This page asks {escape(tiles.origin)} for map tiles."


def packed(text: str) -> str:
    """Compress a text for a page: gzip, written as base64, the same on every run."""
    return base64.b64encode(gzip.compress(text.encode("utf-8"), 9, mtime=0)).decode("ascii")


@cache
def _library() -> str:
    """The plot library with the traces that figures use, packed."""
    return packed(text_of("report", "plotly/plotly-basic.min.js"))
