"""One HTML page from weighings: the answer of each drive first, then why."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from weighbridge.customary import shown_unit
from weighbridge.errors import ConfigError
from weighbridge.estimators import Status
from weighbridge.report.answer import STATUS_TEXT, grade, overloaded, shown_reason, weighing_answer
from weighbridge.report.calibration_panels import calibration_facts, calibration_panels
from weighbridge.report.document import Page, write_document
from weighbridge.report.information_section import information_section
from weighbridge.report.markup import facts_list, html_table, remarks, text_table
from weighbridge.report.mass_section import mass_section
from weighbridge.report.methods_section import apart, methods_section
from weighbridge.report.residual_section import residual_section
from weighbridge.report.road_section import road_section
from weighbridge.report.slow_section import slow_section
from weighbridge.report.style import REACH, Panel, Section
from weighbridge.report.table import Table
from weighbridge.report.text import (
    duration,
    error,
    interval,
    kg,
    plus_minus,
    pounds,
    signed_kg,
    with_half,
)

if TYPE_CHECKING:
    from weighbridge.report.tiles import Tiles
    from weighbridge.results import Calibration
    from weighbridge.results.weighing import MassResult

log = logging.getLogger(__name__)


class Known(NamedTuple):
    """A known mass, and where it is from."""

    mass: float  # at the end of the drive [kg]
    said: str  # how it came about; empty where it was given as it is


def write_page(
    weighings: Sequence[MassResult],
    path: Path,
    *,
    calibration: Calibration | None,
    truth: Mapping[str, float],
    title: str | None,
    comparisons: Sequence[Sequence[MassResult]],
    tables: Sequence[Table],
    panels: Sequence[Panel] = (),
    tiles: Tiles | None = None,
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
    if panels:
        parts.append(page.place(panels))
    if len(weighings) > 1:
        parts.append(_summary(weighings, [known_mass(w, truth) for w in weighings]))
    for k, weighing in enumerate(weighings):
        compared = comparisons[k] if comparisons else ()
        known = known_mass(weighing, truth)
        sections = drive_sections(weighing, known.mass if known else None, compared, tiles)
        body = _drive(weighing, known, compared) + page.sections(sections, f"drive-{k + 1}-")
        parts.append(_folded(weighing, body, opened=k == 0) if len(weighings) > 1
                     else f"<main>{body}</main>")  # fmt: skip
    if calibration is not None:
        parts.append(_calibration(page, calibration, opened=not weighings))
    heading = title if title is not None else _title(weighings)
    write_document(heading, parts, page, path, tiles)
    log.info("report of %d drives written to %s", len(weighings), path)


def _title(weighings: Sequence[MassResult]) -> str:
    if not weighings:
        return "weighbridge: calibration"
    if len(weighings) == 1:
        return f"weighbridge: {weighings[0].drive.name}"
    return f"weighbridge: {len(weighings)} drives"


def known_mass(weighing: MassResult, truth: Mapping[str, float]) -> Known | None:
    """Find the true mass at the end of the drive; None where none is known.

    That of ``drive.toml`` is of its start: the fuel that some methods reckon with is taken off.
    """
    name = weighing.drive.name
    if name in truth:
        return Known(truth[name], "at the end of the drive, fuel burnt on the way taken off")
    mass, result = weighing.drive.info.mass, weighing.result
    if mass is None or weighing.load_changed:
        return None
    burnt = 0.0
    if result is not None and weighing.estimator.reckons_fuel:
        burnt = float(result.balance.table.fuel_burnt[-1])
    if not burnt > 0.0:
        return Known(mass, "")
    return Known(
        mass - burnt,
        f"{kg(mass)} at the start less {pounds(burnt):.1f} {shown_unit('kg')} of fuel burnt on the "
        "way",
    )


def _judged(
    weighing: MassResult, known: Known | None, comparison: Sequence[MassResult]
) -> tuple[str, ...]:
    """Hold a mass against the known one, and against those of other methods."""
    reported = []
    if known is not None:
        reported.append(_error_shown(weighing, known))
    if others := apart(weighing, comparison):
        named = ", ".join(f"{w.method} ({plus_minus(w)})" for w in others)
        reported.append(
            f"Does not fit: {named}. See the comparison of methods before you trust it."
        )
    return tuple(reported)


def _error_shown(weighing: MassResult, known: Known) -> str:
    low, high = weighing.interval(0.95)
    held = "holds it" if low <= known.mass <= high else "does not hold it"
    source = f" ({known.said})" if known.said else ""
    return (
        f"True mass {kg(known.mass)}{source}: the answer is "
        f"{error(weighing.mass, known.mass)} off; the interval {held}."
    )


def _summary(weighings: Sequence[MassResult], known: Sequence[Known | None]) -> str:
    """Table of all drives, with errors where any truth is known."""
    judged = any(k is not None for k in known)
    heads = [
        ("drive", ""), ("mass", "n"), ("95 % interval", "n"), ("payload", "n"),
        *([("true mass", "n"), ("error", "n")] if judged else []), ("result", ""),
    ]  # fmt: skip
    rows = []
    for weighing, truth in zip(weighings, known, strict=True):
        mass = truth.mass if truth is not None else None
        cells = [
            (weighing.drive.name, ""),
            (kg(weighing.mass), "n"),
            (interval(weighing), "n"),
            (signed_kg(weighing.payload), "n"),
        ]
        if judged:
            cells += [(kg(mass), "n"), (error(weighing.mass, mass), "n")]
        cells.append((_outcome(weighing), ""))
        rows.append(cells)
    reported = '<p class="lead screen">Open a drive to see and print it.</p>'
    over = [w.drive.name for w in weighings if overloaded(w)]
    alert = f'<p class="alert bad">Above the permitted mass: {escape(", ".join(over))}.</p>'
    return (alert if over else "") + html_table("All drives", heads, rows) + reported


def drive_sections(
    weighing: MassResult,
    known: float | None,
    comparison: Sequence[MassResult],
    tiles: Tiles | None = None,
) -> tuple[Section, ...]:
    """Return the parts of a drive's report, in the order to show them.

    Parameters
    ----------
    weighing : of the drive
    known : true mass [kg]; None where unknown
    comparison : the same drive by every method; empty where that was not asked for
    tiles : to draw maps over; None for none
    """
    return (
        mass_section(weighing, known),
        methods_section(weighing, comparison, known),
        information_section(weighing),
        slow_section(weighing, tiles),
        residual_section(weighing, comparison),
        road_section(weighing, tiles),
    )


def _drive(weighing: MassResult, known: Known | None, comparison: Sequence[MassResult]) -> str:
    """Answer, loads, warnings and facts of one drive."""
    return (
        weighing_answer(weighing, _judged(weighing, known, comparison))
        + _segments(weighing)
        + remarks([p.shown for p in weighing.problems])
        + _facts(weighing)
    )


def _folded(weighing: MassResult, body: str, *, opened: bool) -> str:
    """Put a drive of several under a heading that opens it."""
    brief = plus_minus(weighing) if _found(weighing) else STATUS_TEXT[weighing.status]
    return (
        f"<details{' open' if opened else ''}><summary><h2>{escape(weighing.drive.name)}</h2>"
        f'<span class="brief">{escape(brief)}</span></summary>{body}</details>'
    )


def _facts(weighing: MassResult) -> str:
    result = weighing.result
    facts = [
        ("status", STATUS_TEXT[weighing.status]),
        ("vehicle", weighing.vehicle.name),
        ("drive", weighing.drive.name),
        ("method", weighing.method),
        ("duration", duration(weighing.drive.duration)),
        ("used", duration(weighing.used_time)),
    ]
    if math.isfinite(weighing.maker_mass):
        facts.append(("reported by the vehicle itself, not used", kg(weighing.maker_mass)))
    if result is not None and _found(weighing):
        after = result.converged_at - weighing.drive.start
        facts.append(("settled within ± 5 % after", duration(after)))
    return facts_list(facts) + _details(weighing)


def _details(weighing: MassResult) -> str:
    """What only a specialist asks for, folded."""
    result = weighing.result
    if result is None or not _found(weighing) or not math.isfinite(result.bound_std):
        return ""
    bound = f"± {kg(REACH * result.bound_std)}"
    facts = facts_list([("Cramér-Rao bound: half the 95 % interval by noise alone", bound)])
    return f"<details><summary>Details</summary>{facts}</details>"


def _segments(weighing: MassResult) -> str:
    if len(weighing.segments) < 2:
        return ""
    start = weighing.drive.start
    low, high = weighing.interval(0.95)
    reach = 0.5 * (high - low) / weighing.std if weighing.std > 0.0 else REACH
    rows = [
        [
            (duration(max(s.start - start, 0.0)), "n"),
            (duration(s.end - start), "n"),
            (with_half(s.mass, reach * s.std) if math.isfinite(s.mass) else "too little", "n"),
        ]
        for s in weighing.segments
    ]  # fmt: skip
    heads = [("from", "n"), ("to", "n"), ("mass", "n")]
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
        f"{facts_list(calibration_facts(calibration))}"
        f"{page.place(calibration_panels(calibration))}</details>"
    )


def _found(weighing: MassResult) -> bool:
    return weighing.status is Status.CONVERGED and math.isfinite(weighing.mass)


def _outcome(weighing: MassResult) -> str:
    text = STATUS_TEXT[weighing.status]
    if _found(weighing):
        low, high = weighing.interval(0.95)
        half = 0.5 * (high - low)
        return f"{grade(weighing.mass, half)}: ± {100.0 * half / weighing.mass:.1f} %"
    return f"{text} ({shown_reason(weighing)})" if weighing.reason else text
