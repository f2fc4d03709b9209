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
from weighbridge.estimators import SPEED_ALONE, Status
from weighbridge.report.calibration_panels import calibration_facts, calibration_panels
from weighbridge.report.drive_panels import drive_panels
from weighbridge.report.style import Panel
from weighbridge.signals.units import scalar_from_si

if TYPE_CHECKING:
    from weighbridge.pipeline.calibrating import Calibration
    from weighbridge.pipeline.weighing import Weighing

log = logging.getLogger(__name__)

NOTHING: Final = "–"

STATUS_TEXT: Final[dict[Status, str]] = {
    Status.CONVERGED: "mass found",
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
        drawn, absent = [], []
        for panel in panels:
            if panel.figure is None:
                absent.append(panel.absent)
                continue
            key = f"figure-{len(self.figures) + 1}"
            self.figures[key] = panel.figure.to_json(validate=False)
            height = int(panel.figure.layout.height)
            drawn.append(
                f"<figure{' class=wide' if panel.wide else ''}><h3>{escape(panel.title)}</h3>"
                f'<div class="plot" id="{key}" role="img" aria-label="{escape(panel.title)}" '
                f'style="min-height:{height}px"></div>'
                f"<figcaption>{escape(panel.caption)}</figcaption></figure>"
            )
        html = f'<div class="panels">{"".join(drawn)}</div>' if drawn else ""
        if absent:
            listed = " ".join(_sentence(text) for text in absent)
            html += f'<p class="absent">Left out: {escape(listed)}</p>'
        return html

    def data(self) -> str:
        """Return all figures as one JSON text that may stand inside a script element.

        Plotly writes every ``<`` as an escape, so no text can end the element.
        """
        body = ",".join(f"{json.dumps(k)}:{v}" for k, v in self.figures.items())
        return "{" + body + "}"


def write_page(
    weighings: Sequence[Weighing],
    path: Path,
    *,
    calibration: Calibration | None,
    truth: Mapping[str, float],
    title: str | None,
) -> None:
    """Write the page; see `weighbridge.report.write_report`."""
    if not weighings and calibration is None:
        raise ConfigError(f"{path}: no weighing and no calibration to report")
    page = Page()
    parts = []
    if len(weighings) > 1:
        parts.append(_summary(weighings, truth))
    for k, weighing in enumerate(weighings):
        parts.append(_drive(page, weighing, _truth(weighing, truth), alone=len(weighings) == 1,
                            opened=k == 0))  # fmt: skip
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
            *parts,
            "<footer>Made by weighbridge from data the vehicle recorded. For screening: not a "
            "legal-for-trade weighing. Masses are of all that rolls, with the 95 % interval."
            "</footer>",
            f'<script type="application/json" id="figures">{page.data()}</script>',
            f"<script>{get_plotlyjs()}</script>",
            f"<script>{here.joinpath('page.js').read_text(encoding='utf-8')}</script>",
            "</body></html>\n",
        ]
    )
    try:
        path.write_text(html, encoding="utf-8")
    except OSError as error:
        raise ConfigError(
            f"{path}: the report cannot be written ({error.strerror}); choose another file"
        ) from error


def _title(weighings: Sequence[Weighing]) -> str:
    if not weighings:
        return "weighbridge: calibration"
    if len(weighings) == 1:
        return f"weighbridge: {weighings[0].drive.name}"
    return f"weighbridge: {len(weighings)} drives"


def _truth(weighing: Weighing, truth: Mapping[str, float]) -> float | None:
    return truth.get(weighing.drive.name, weighing.drive.info.mass)


def _summary(weighings: Sequence[Weighing], truth: Mapping[str, float]) -> str:
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
            (_kg(weighing.mass), "n"),
            (_interval(weighing), "n"),
            (_signed_kg(weighing.payload), "n"),
        ]
        if judged:
            cells += [(_kg(known), "n"), (_error(weighing.mass, known), "n")]
        cells.append((_outcome(weighing), ""))
        rows.append(cells)
    return html_table("All drives", heads, rows)


def _drive(
    page: Page, weighing: Weighing, known: float | None, *, alone: bool, opened: bool
) -> str:
    """Answer, facts, warnings and figures of one drive."""
    body = _answer(weighing, known) + _facts(weighing, known)
    if weighing.warnings:
        told = "".join(f"<li>{escape(_sentence(w))}</li>" for w in weighing.warnings)
        body += f'<h3>What was found, mended or doubted</h3><ul class="warnings">{told}</ul>'
    body += _segments(weighing)
    body += page.place(drive_panels(weighing, known))
    if alone:
        return f"<main>{body}</main>"
    brief = _plus_minus(weighing) if _found(weighing) else STATUS_TEXT[weighing.status]
    return (
        f"<details{' open' if opened else ''}><summary><h2>{escape(weighing.drive.name)}</h2>"
        f'<span class="brief">{escape(brief)}</span></summary>{body}</details>'
    )


def _answer(weighing: Weighing, known: float | None) -> str:
    if _found(weighing):
        html = (
            f'<p class="answer good">{_plus_minus(weighing)} <small>95 % interval '
            f"{_interval(weighing)}</small></p>"
        )
        if known is not None:
            html += (
                f'<p class="why">True mass {_kg(known)}: the answer is '
                f"{_error(weighing.mass, known)} off.</p>"
            )
        return html
    reason = _sentence(weighing.reason) if weighing.reason else ""
    return (
        f'<p class="answer bad">{escape(_upper(STATUS_TEXT[weighing.status]))}</p>'
        f'<p class="why">{escape(reason)}</p>'
        f'<p class="why">{escape(_remedy(weighing))}</p>'
    )


def _remedy(weighing: Weighing) -> str:
    texts = SPEED_REMEDY_TEXT if weighing.method in SPEED_ALONE else REMEDY_TEXT
    return texts[weighing.status]


def _facts(weighing: Weighing, known: float | None) -> str:
    result = weighing.result
    unladen = weighing.vehicle.tare
    facts = [
        ("payload", "unknown without a tare" if unladen is None else _signed_kg(weighing.payload)),
        ("status", STATUS_TEXT[weighing.status]),
        ("vehicle", weighing.vehicle.name),
        ("drive", weighing.drive.name),
        ("method", weighing.method),
        ("duration", _time(weighing.drive.duration)),
        ("used", _time(weighing.used_time)),
    ]
    if unladen is not None:
        facts.insert(1, ("tare", _kg(unladen)))
    if known is not None:
        facts.insert(1, ("true mass", _kg(known)))
    if result is not None and _found(weighing):
        settled = result.converged_at - weighing.drive.start
        facts.append(("within 5 % for good after", _time(settled)))
        if math.isfinite(result.bound_std):
            facts.append(("Cramér-Rao bound", f"± {result.bound_std:.1f} kg (1 sd)"))
    return _list(facts)


def _segments(weighing: Weighing) -> str:
    if len(weighing.segments) < 2:
        return ""
    start = weighing.drive.start
    rows = [
        [
            (_time(max(s.start - start, 0.0)), "n"),
            (_time(s.end - start), "n"),
            (f"{s.mass:.0f} ± {s.std:.0f} kg" if math.isfinite(s.mass) else "too little", "n"),
        ]
        for s in weighing.segments
    ]
    heads = [("from", "n"), ("to", "n"), ("mass ± standard deviation", "n")]
    caption = "Mass between longer stops, where load can change"
    table = html_table("", heads, rows)
    return f"<details><summary>{caption} ({len(rows)})</summary>{table}</details>"


def _calibration(page: Page, calibration: Calibration, *, opened: bool) -> str:
    """Facts and figures of the calibration."""
    name = calibration.vehicle.name
    return (
        f"<details{' open' if opened else ''}><summary><h2>Calibration of {escape(name)}</h2>"
        f'<span class="brief">R² {calibration.fit.r_squared:.3f}</span></summary>'
        f"{_list(calibration_facts(calibration))}"
        f"{page.place(calibration_panels(calibration))}</details>"
    )


def html_table(
    caption: str,
    heads: Sequence[tuple[str, str]],
    rows: Sequence[Sequence[tuple[str, str]]],
) -> str:
    """Return a table of texts, each with its class ("n" for a number)."""

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


def _found(weighing: Weighing) -> bool:
    return weighing.status is Status.CONVERGED and math.isfinite(weighing.mass)


def _outcome(weighing: Weighing) -> str:
    text = STATUS_TEXT[weighing.status]
    return f"{text} ({weighing.reason})" if weighing.reason else text


def _plus_minus(weighing: Weighing) -> str:
    low, high = weighing.interval(0.95)
    if not math.isfinite(high - low):
        return _kg(weighing.mass)
    return f"{weighing.mass:.0f} ± {0.5 * (high - low):.0f} kg"


def _interval(weighing: Weighing) -> str:
    low, high = weighing.interval(0.95)
    return f"{low:.0f} to {high:.0f} kg" if math.isfinite(high - low) else NOTHING


def _kg(mass: float | None) -> str:
    return f"{mass:.0f} kg" if mass is not None and math.isfinite(mass) else NOTHING


def _signed_kg(mass: float) -> str:
    return f"{mass:+.0f} kg".replace("-", "−") if math.isfinite(mass) else NOTHING


def _error(mass: float, known: float | None) -> str:
    if known is None or not math.isfinite(mass):
        return NOTHING
    return f"{100.0 * (mass / known - 1.0):+.1f} %".replace("-", "−")


def _time(seconds: float) -> str:
    if not math.isfinite(seconds):
        return NOTHING
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{scalar_from_si(seconds, 'min'):.1f} min"


def _upper(text: str) -> str:
    return text[:1].upper() + text[1:]


def _sentence(text: str) -> str:
    """Give a fragment a capital and a full stop."""
    text = _upper(text.strip())
    return text if text.endswith((".", "!", "?")) else text + "."
