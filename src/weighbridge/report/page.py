"""One HTML page from weighings: text and tables here, figures from the panels."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Final

from plotly.offline import get_plotlyjs

from weighbridge.errors import ConfigError
from weighbridge.estimators import Status
from weighbridge.report.calibration_panels import calibration_facts, calibration_panels
from weighbridge.report.information_section import information_section
from weighbridge.report.mass_section import mass_section
from weighbridge.report.methods_section import methods_section
from weighbridge.report.residual_section import residual_section
from weighbridge.report.road_section import road_section
from weighbridge.report.slow_section import slow_section
from weighbridge.report.style import Panel, Section
from weighbridge.report.table import Table
from weighbridge.report.text import (
    capital,
    duration,
    error,
    interval,
    kg,
    plus_minus,
    sentence,
    signed_kg,
)
from weighbridge.visible import shown_json, visible, visible_text
from weighbridge.whole import write_whole

if TYPE_CHECKING:
    from weighbridge.results.calibration import Calibration
    from weighbridge.results.weighing import MassResult

log = logging.getLogger(__name__)

STATUS_TEXT: Final[dict[Status, str]] = {
    Status.CONVERGED: "converged",
    Status.NOT_EXCITED: "no mass: the drive says too little",
    Status.INCONSISTENT: "no mass: the data contradict each other",
    Status.MISSING_SIGNALS: "no mass: signals are missing",
}

REMEDY_TEXT: Final[dict[Status, str]] = {
    Status.CONVERGED: "",
    Status.NOT_EXCITED: "A mass shows only while the vehicle speeds up or climbs under its own "
    "power. A longer drive with more starts, firm accelerations and hills would help; the "
    "excluded samples below show where this one was lost.",
    Status.INCONSISTENT: "Force and motion do not fit one mass. Check the units of speed and "
    "torque, the gear ratios and wheel radius of the vehicle file, and whether the file belongs "
    "to this vehicle.",
    Status.MISSING_SIGNALS: "Record the missing signals, or use a vehicle file whose torque source "
    "the drive has; weighbridge inspect lists what is there and what it allows.",
}

SPEED_REMEDY_TEXT: Final[dict[Status, str]] = {
    Status.CONVERGED: "",
    Status.NOT_EXCITED: "No drive helps, however long or hilly: with torque in proportion to "
    "speed, force and mass drop out together, and the mass of the calibration comes back. "
    "Record torque or engine load beside the speed, calibrate and weigh with method joint.",
    Status.INCONSISTENT: "The speeds of this drive are not like those of the calibration. Check "
    "the unit of the speed and whether the vehicle file belongs to this vehicle; for a mass, "
    "record torque or engine load.",
    Status.MISSING_SIGNALS: "Record the speed of the vehicle or of GNSS; weighbridge inspect lists "
    "what is there and what it allows.",
}
"""The same where speed alone was weighed by."""


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
            self.figures[key] = panel.figure.to_json(validate=False)
            height = int(panel.figure.layout.height)
            drawn.append(
                f"<figure{' class=wide' if panel.wide else ''}><h4>{escape(panel.title)}</h4>"
                f'<div class="plot" id="{key}" role="img" aria-label="{escape(panel.title)}" '
                f'style="min-height:{height}px"></div>'
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
        """Return all figures as one JSON text that may stand inside a script element.

        Plotly writes every ``<`` as an escape, so no text can end the element.
        """
        body = ",".join(f"{json.dumps(k)}:{shown_json(v)}" for k, v in self.figures.items())
        return "{" + body + "}"


def write_page(
    weighings: Sequence[MassResult],
    path: Path,
    *,
    calibration: Calibration | None,
    truth: Mapping[str, float],
    title: str | None,
    comparisons: Sequence[Sequence[MassResult]],
    tables: Sequence[Table],
) -> None:
    """Write the page; see `weighbridge.report.write_report`."""
    if not weighings and calibration is None:
        raise ConfigError(f"{path}: no weighing and no calibration to report")
    if len(comparisons) not in (0, len(weighings)):
        raise ConfigError(
            f"{path}: {len(comparisons)} comparisons for {len(weighings)} weighings; give one each"
        )
    page = Page()
    parts = [text_table(table) for table in tables]
    if len(weighings) > 1:
        parts.append(_summary(weighings, truth))
    for k, weighing in enumerate(weighings):
        compared = comparisons[k] if comparisons else ()
        known = _truth(weighing, truth)
        body = _drive(weighing, known) + page.sections(
            drive_sections(weighing, known, compared), f"drive-{k + 1}-"
        )
        parts.append(_folded(weighing, body, opened=k == 0) if len(weighings) > 1
                     else f"<main>{body}</main>")  # fmt: skip
    if calibration is not None:
        parts.append(_calibration(page, calibration, opened=not weighings))
    heading = title if title is not None else _title(weighings)
    write_document(heading, parts, page, path)
    log.info("report of %d drives written to %s", len(weighings), path)


def write_document(heading: str, parts: Sequence[str], page: Page, path: Path) -> None:
    """Put parts of HTML and the figures they place into one file that opens offline.

    Raises
    ------
    ConfigError
        The file cannot be written.
    """
    here = files(__package__)
    # Texts of files are shown, never obeyed: no control character turns a line round.
    heading = visible(heading)
    html = "".join(
        [
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            # No address is ever asked for anything: icon, styles and scripts are inside.
            '<link rel="icon" href="data:,">',
            f"<title>{escape(heading)}</title>",
            f"<style>{here.joinpath('page.css').read_text(encoding='utf-8')}</style>",
            f"</head><body><h1>{escape(heading)}</h1>",
            "<noscript><p>The figures need JavaScript; the tables do not.</p></noscript>",
            *map(visible_text, parts),
            "<footer>Made by weighbridge from data the vehicle recorded. For screening: not a "
            "legal-for-trade weighing. Masses are of all that rolls, with the 95 % interval."
            "</footer>",
            f'<script type="application/json" id="figures">{page.data()}</script>',
            f"<script>{get_plotlyjs()}</script>",
            f"<script>{here.joinpath('page.js').read_text(encoding='utf-8')}</script>",
            "</body></html>\n",
        ]
    )
    write_whole(path, html)


def _title(weighings: Sequence[MassResult]) -> str:
    if not weighings:
        return "weighbridge: calibration"
    if len(weighings) == 1:
        return f"weighbridge: {weighings[0].drive.name}"
    return f"weighbridge: {len(weighings)} drives"


def _truth(weighing: MassResult, truth: Mapping[str, float]) -> float | None:
    """True mass at the end of the drive [kg].

    That of ``drive.toml`` is of its start: the fuel that some methods reckon with is taken off.
    """
    mass = None if weighing.load_changed else weighing.drive.info.mass
    result = weighing.result
    if mass is not None and result is not None and weighing.estimator.reckons_fuel:
        mass -= float(result.balance.table.fuel_burnt[-1])
    return truth.get(weighing.drive.name, mass)


def _summary(weighings: Sequence[MassResult], truth: Mapping[str, float]) -> str:
    """Table of all drives, with errors where any truth is known."""
    truths = [_truth(w, truth) for w in weighings]
    judged = any(t is not None for t in truths)
    heads = [
        ("drive", ""), ("mass", "n"), ("95 % interval", "n"), ("payload", "n"),
        *([("true mass", "n"), ("error", "n")] if judged else []), ("result", ""),
    ]  # fmt: skip
    rows = []
    for weighing, known in zip(weighings, truths, strict=True):
        cells = [
            (weighing.drive.name, ""),
            (kg(weighing.mass), "n"),
            (interval(weighing), "n"),
            (signed_kg(weighing.payload), "n"),
        ]
        if judged:
            cells += [(kg(known), "n"), (error(weighing.mass, known), "n")]
        cells.append((_outcome(weighing), ""))
        rows.append(cells)
    return html_table("All drives", heads, rows)


def drive_sections(
    weighing: MassResult, known: float | None, comparison: Sequence[MassResult]
) -> tuple[Section, ...]:
    """Return the parts of a drive's report, in the order to show them.

    Parameters
    ----------
    weighing : of the drive
    known : true mass [kg]; None where unknown
    comparison : the same drive by every method; empty where that was not asked for
    """
    return (
        mass_section(weighing, known),
        methods_section(comparison, known),
        information_section(weighing),
        slow_section(weighing),
        residual_section(weighing, comparison),
        road_section(weighing),
    )


def _drive(weighing: MassResult, known: float | None) -> str:
    """Answer, facts, warnings and segments of one drive."""
    body = _answer(weighing, known) + _facts(weighing, known)
    if weighing.warnings:
        noted = "".join(f"<li>{escape(sentence(w))}</li>" for w in weighing.warnings)
        body += f'<h3>What was found, mended or doubted</h3><ul class="warnings">{noted}</ul>'
    return body + _segments(weighing)


def _folded(weighing: MassResult, body: str, *, opened: bool) -> str:
    """Put a drive of several under a heading that opens it."""
    brief = plus_minus(weighing) if _found(weighing) else STATUS_TEXT[weighing.status]
    return (
        f"<details{' open' if opened else ''}><summary><h2>{escape(weighing.drive.name)}</h2>"
        f'<span class="brief">{escape(brief)}</span></summary>{body}</details>'
    )


def _answer(weighing: MassResult, known: float | None) -> str:
    if _found(weighing):
        html = (
            f'<p class="answer good">{plus_minus(weighing)} <small>95 % interval '
            f"{interval(weighing)}</small></p>"
        )
        if known is not None:
            html += (
                f'<p class="why">True mass {kg(known)}: the answer is '
                f"{error(weighing.mass, known)} off.</p>"
            )
        return html
    reason = sentence(weighing.reason) if weighing.reason else ""
    return (
        f'<p class="answer bad">{escape(capital(STATUS_TEXT[weighing.status]))}</p>'
        f'<p class="why">{escape(reason)}</p>'
        f'<p class="why">{escape(_remedy(weighing))}</p>'
    )


def _remedy(weighing: MassResult) -> str:
    texts = SPEED_REMEDY_TEXT if weighing.estimator.speed_alone else REMEDY_TEXT
    return texts[weighing.status]


def _facts(weighing: MassResult, known: float | None) -> str:
    result = weighing.result
    unladen = weighing.vehicle.tare
    facts = [
        ("payload", "unknown without a tare" if unladen is None else signed_kg(weighing.payload)),
        ("status", STATUS_TEXT[weighing.status]),
        ("vehicle", weighing.vehicle.name),
        ("drive", weighing.drive.name),
        ("method", weighing.method),
        ("duration", duration(weighing.drive.duration)),
        ("used", duration(weighing.used_time)),
    ]
    if unladen is not None:
        facts.insert(1, ("tare", kg(unladen)))
    if known is not None:
        facts.insert(1, ("true mass", kg(known)))
    if result is not None and _found(weighing):
        after = result.converged_at - weighing.drive.start
        facts.append(("within 5 % for good after", duration(after)))
        if math.isfinite(result.bound_std):
            facts.append(("Cramér-Rao bound", f"± {result.bound_std:.1f} kg (1 sd)"))
    return _list(facts)


def _segments(weighing: MassResult) -> str:
    if len(weighing.segments) < 2:
        return ""
    start = weighing.drive.start
    rows = [
        [
            (duration(max(s.start - start, 0.0)), "n"),
            (duration(s.end - start), "n"),
            (f"{s.mass:.0f} ± {s.std:.0f} kg" if math.isfinite(s.mass) else "too little", "n"),
        ]
        for s in weighing.segments
    ]
    heads = [("from", "n"), ("to", "n"), ("mass ± standard deviation", "n")]
    if weighing.load_changed:
        return html_table("The load changed at a stop", heads, rows)
    caption = "Mass between longer stops, where load can change"
    table = html_table("", heads, rows)
    return f"<details><summary>{caption} ({len(rows)})</summary>{table}</details>"


def _calibration(page: Page, calibration: Calibration, *, opened: bool) -> str:
    """Facts and figures of the calibration."""
    name = calibration.vehicle.name
    return (
        f"<details{' open' if opened else ''}><summary><h2>Calibration of {escape(name)}</h2>"
        f'<span class="brief">R² {calibration.rows.r_squared:.3f}</span></summary>'
        f"{_list(calibration_facts(calibration))}"
        f"{page.place(calibration_panels(calibration))}</details>"
    )


def left_out(reasons: Sequence[str]) -> str:
    """Say what is not there and why; nothing where all is."""
    if not reasons:
        return ""
    listed = " ".join(sentence(text) for text in reasons)
    return f'<p class="absent">Left out: {escape(listed)}</p>'


def text_table(table: Table) -> str:
    """Return a table of texts: numbers to the right, the first column and sentences to the left."""
    kinds = [
        "w" if any(_wordy(row[k]) for row in table.rows) else "n" if k else ""
        for k in range(len(table.columns))
    ]
    return html_table(
        table.title,
        list(zip(table.columns, kinds, strict=True)),
        [list(zip(row, kinds, strict=True)) for row in table.rows],
    )


def _wordy(cell: str) -> bool:
    """Whether a cell is a sentence rather than a number with its unit."""
    return len(cell) > 24


def html_table(
    caption: str,
    heads: Sequence[tuple[str, str]],
    rows: Sequence[Sequence[tuple[str, str]]],
) -> str:
    """Return a table of texts, each with its class ("n" for a number, "w" for words)."""

    def cell(tag: str, text: str, kind: str) -> str:
        return f"<{tag}{f' class={kind}' if kind else ''}>{escape(text)}</{tag}>"

    head = "".join(cell("th", text, kind) for text, kind in heads)
    body = "".join(f"<tr>{''.join(cell('td', t, k) for t, k in row)}</tr>" for row in rows)
    return (
        f'<div class="scroll"><table>{f"<caption>{escape(caption)}</caption>" if caption else ""}'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _list(facts: Sequence[tuple[str, str]]) -> str:
    items = "".join(f"<div><dt>{escape(k)}</dt><dd>{escape(v)}</dd></div>" for k, v in facts)
    return f"<dl>{items}</dl>"


def _found(weighing: MassResult) -> bool:
    return weighing.status is Status.CONVERGED and math.isfinite(weighing.mass)


def _outcome(weighing: MassResult) -> str:
    text = STATUS_TEXT[weighing.status]
    return f"{text} ({weighing.reason})" if weighing.reason else text
