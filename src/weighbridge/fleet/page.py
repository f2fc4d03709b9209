"""The page of a fleet: first who was overloaded, when and how sure; then all the rest.

Texts and the first tables are HTML, so that it can be read and printed without scripts. The data
of all legs stand once in the page, column by column; a script of the page draws from them.
"""

from __future__ import annotations

import json
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import polars as pl

from weighbridge.data import text_of
from weighbridge.fleet.names import some
from weighbridge.report.text import NOTHING
from weighbridge.visible import visible
from weighbridge.whole import write_whole

if TYPE_CHECKING:
    from weighbridge.fleet.reporting import FleetReport

_FIRST: Final = 12  # rows of the list on the first screen
_LONGEST: Final = 200  # characters of a sentence of the data's quality
_POLICY: Final = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
)
_SECTIONS: Final = (
    ("overloads", "Overloads", "Legs whose mass is likely above the permitted one."),
    ("vehicles", "Vehicles", "Choose one for its history."),
    ("history", "History of a vehicle", "Mass of each leg with its 95 % interval."),
    ("legs", "Legs", "Spans with one load, with 95 % intervals; below zero a payload is none."),
    ("map", "Where loads changed", "Each mark is a stop; no map is loaded from the net."),
    ("quality", "Data quality", "What keeps drives from being weighed, and what is uncertain."),
    (
        "learnt",
        "Learnt from the fleet",
        "Factors by which masses are corrected, vehicle files that tickets contradict, and what "
        "drifts in 30 days.",
    ),
    ("verdicts", "Known masses", "Verdicts by the loads of Regulation (EU) 2019/1213, Annex IV."),
)


def write_page(report: FleetReport, path: str | Path, title: str = "weighbridge: fleet") -> None:
    """Write the page: one HTML file that opens offline.

    Parameters
    ----------
    report : as of `weighbridge.fleet.reporting.report`
    path : an HTML file; replaced where it is there
    title : heading

    Raises
    ------
    ConfigError
        The file cannot be written.
    """
    write_whole(path, page(report, title))


def page(report: FleetReport, title: str) -> str:
    """Return the page as HTML.

    Parameters
    ----------
    report
    title : heading; shown, never obeyed
    """
    style = text_of("report", "page.css") + text_of("fleet", "page.css")
    title = escape(visible(title))
    links = "".join(f'<a href="#{key}">{name}</a>' for key, name, _ in _SECTIONS)
    # Nothing can end the element that holds the data: every < in it is an escape.
    data = json.dumps(_data(report), ensure_ascii=False, separators=(",", ":"))
    data = data.replace("<", "\\u003c")
    parts = [
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f'<link rel="icon" href="data:,"><title>{title}</title><style>{style}</style></head>',
        f"<body><h1>{title}</h1>",
        _answer(report),
        _facts(report),
        f'<nav aria-label="Sections">{links}<a href="#unjudged">Not judged</a>'
        '<a href="#outside">Outside the interval</a>'
        '<a href="#speeds">Speed and mass</a></nav>',
        "<noscript><p>Without JavaScript only the lists above and the last table are shown.</p>"
        "</noscript>",
        *(
            f'<section id="{key}"><h3>{name}</h3><p class="lead">{lead}</p><div class="body">'
            "</div></section>"
            for key, name, lead in _SECTIONS
        ),
        _unjudged(report),
        _outside(report),
        _speeds(report),
        "<footer>Made by weighbridge from data the vehicles recorded. For screening: not a "
        "legal-for-trade weighing. Times are UTC.</footer>",
        f'<script type="application/json" id="data">{data}</script>',
        f"<script>{text_of('fleet', 'page.js')}</script></body></html>\n",
    ]
    return "".join(parts)


def _answer(report: FleetReport) -> str:
    """Say who was overloaded, when and how sure."""
    reported = report.overloads
    alarms, limits = reported.filter(pl.col("level") == "alarm"), report.limits
    unsure = reported.height - alarms.height
    sure = f"{100 * limits.alarm:g} % sure"
    if alarms.height:
        who = _count(alarms["vehicle_id"].n_unique(), "vehicle")
        head = f'<p class="answer bad">{who} overloaded <small>{sure}</small></p>'
        rest = f"{_count(alarms.height, 'leg')} at least {sure}"
    else:
        head = f'<p class="answer good">No overload that is {sure}</p>'
        rest = "no leg"
    # One row per vehicle, its surest leg: one that is always overloaded shall hide no other.
    alarm = pl.col("level") == "alarm"
    first = reported.with_columns(
        sure=alarm.sum().over("vehicle_id"), likely=(~alarm).sum().over("vehicle_id")
    ).unique("vehicle_id", keep="first", maintain_order=True)
    judged = report.legs["level"].is_not_null().sum()
    why = (
        f"{rest}, {unsure} more likely than {100 * limits.warn:g} %, of {judged} legs that could "
        f"be judged. {report.legs.height - judged} could not: no mass, or no permitted mass "
        '(<a href="#unjudged">why</a>).'
    )
    rows = "".join(
        f'<tr class="{row["level"]}"><td>{_text(row["vehicle_id"])}</td>'
        f"<td class=n>{_when(row['start'])}</td>"
        f"<td class=n>{_number(row['mass_kg'])} ±&nbsp;{_number(row['high95_kg'] - row['mass_kg'])}"
        f"</td><td class=n>{_number(row['permitted_kg'])}</td>"
        f"<td class=n>{how_sure(row['overload'])}{_towing(row)}</td>"
        f"<td class=n>{row['sure']} sure, {row['likely']} likely</td></tr>"
        for row in first.head(_FIRST).iter_rows(named=True)
    )
    table = (
        '<div class="scroll"><table id="first"><thead><tr><th>vehicle<th class=n>when, UTC'
        "<th class=n>mass, kg<th class=n>permitted, kg<th class=n>how sure<th class=n>legs</tr>"
        f"</thead><tbody>{rows}</tbody></table></div>"
    )
    more = first.height - _FIRST
    link = f'<p><a href="#overloads">and {_count(more, "more vehicle")}</a></p>' if more > 0 else ""
    note = '<p class="lead">A trailer counts as load unless a table of couplings names it.</p>'
    why = f'<p class="why">{why[:1].upper() + why[1:]}</p>'
    return head + why + (table + link + note if rows else "")


def _facts(report: FleetReport) -> str:
    t = report.totals
    facts = (
        ("vehicles", f"{t['vehicles']}"),
        ("without a vehicle file", _without(report.without_file)),
        ("drives, legs", f"{t['drives']}, {t['legs']}"),
        ("driven", f"{_number(t['distance_km'])} km"),
        ("with a known mass", _share(t["known_share"])),
        ("transported", f"{_number(t['tkm'])} ± {_number(1.96 * t['tkm_std'])} t·km"),
        ("driven empty", _share(t["empty_share"])),
        ("load changes", f"{t['changes']}"),
        ("outside the interval", f"{t['outside']} of {t['known_legs']} known masses"),
        ("legs with a trailer?", f"{t['trailer_legs']}"),
    )
    items = "".join(f"<div><dt>{k}</dt><dd>{v}</dd></div>" for k, v in facts)
    return f"<dl>{items}</dl>"


def _unjudged(report: FleetReport) -> str:
    """Table of the causes for which legs were not judged, the worst first."""
    if report.unjudged.is_empty():
        return '<section id="unjudged"><h3>Not judged</h3><p>All legs were judged.</p></section>'
    rows = "".join(
        f"<tr><td>{row['prevents']}</td><td class=w>{escape(_cut(row['example'] or NOTHING))}</td>"
        f"<td class=n>{row['count']}</td><td class=n>{_share(row['share'])}</td>"
        f"<td class=n>{_number(row['distance_km'])}</td>"
        f"<td>{_text(some(row['vehicles']))}</td></tr>"
        for row in report.unjudged.iter_rows(named=True)
    )
    return (
        '<section id="unjudged"><h3>Not judged</h3><p class="lead">Legs of which mass, overload or '
        'payload is not known, and why. What prevents a mass comes first.</p><div class="scroll">'
        "<table><thead><tr><th>not known<th class=w>why<th class=n>legs<th class=n>of all"
        f"<th class=n>km<th>vehicles</tr></thead><tbody>{rows}</tbody></table></div></section>"
    )


def _outside(report: FleetReport) -> str:
    """Table of vehicles with known masses: how many lie outside the intervals, and the worst."""
    rows = "".join(
        f"<tr><td>{_text(row['vehicle_id'])}</td>"
        f"<td class=n>{row['outside']} of {row['known']}</td>"
        + (
            f"<td class=n>{_when(row['worst_start'])}</td>"
            f"<td class=n>{_number(row['worst_known_kg'])}</td>"
            f"<td class=n>{_number(row['worst_low95_kg'])} to "
            f"{_number(row['worst_high95_kg'])}</td>"
            f"<td class=n>{100.0 * row['worst_error']:+.1f}</td></tr>"
            if row["outside"]
            else f"<td class=n>{NOTHING}</td>" * 4 + "</tr>"
        )
        for row in report.outside.iter_rows(named=True)
    )
    none = "" if rows else "<p>No leg has both a known mass and an interval.</p>"
    table = (
        '<div class="scroll"><table><thead><tr><th>vehicle<th class=n>outside<th class=n>worst, UTC'
        "<th class=n>known, kg<th class=n>95 % interval, kg<th class=n>error, %</tr></thead>"
        f"<tbody>{rows}</tbody></table></div>"
    )
    return (
        '<section id="outside"><h3>Outside the interval</h3><p class="lead">Legs whose known mass '
        "(ticket or drive.toml) lies outside the 95 % interval. By chance it is one "
        f"in twenty.</p>{none or table}</section>"
    )


def _speeds(report: FleetReport) -> str:
    """Table of distance by average speed and average total mass."""
    rows = report.speed_mass
    speeds = sorted(rows["speed_kmh"].drop_nulls().unique())
    masses: list[float | None] = sorted(rows["mass_t"].drop_nulls().unique())
    masses += [None] * bool(rows["mass_t"].null_count())
    cells = {(r["mass_t"], r["speed_kmh"]): r["distance_km"] for r in rows.iter_rows(named=True)}
    head = "".join(f"<th class=n>{speed:g}</th>" for speed in speeds)
    body = "".join(
        f"<tr><th class=n>{'unknown' if mass is None else f'{mass:g}'}</th>"
        + "".join(f"<td class=n>{cells.get((mass, s), 0.0):.0f}</td>" for s in speeds)
        + "</tr>"
        for mass in masses
    )
    return (
        '<section id="speeds"><h3>Speed and mass</h3><p class="lead">Kilometres by average speed '
        "[km/h, from] and average total mass [t, from] of periods of 5 min, the kind of table that "
        "Regulation (EU) 2025/2161 has a vehicle keep.</p>"
        f'<div class="scroll"><table><thead><tr><th class=n>t \\ km/h</th>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div></section>"
    )


def _data(report: FleetReport) -> dict[str, Any]:
    """Columns that the script draws from; a vehicle is its row in ``vehicles``."""
    ids = report.vehicles["vehicle_id"].to_list()
    number = {name: k for k, name in enumerate(ids)}

    def columns(frame: pl.DataFrame, digits: dict[str, int]) -> dict[str, list[Any]]:
        found: dict[str, list[Any]] = {"v": [number[name] for name in frame["vehicle_id"]]}
        for name, places in digits.items():
            column = frame[name]
            if isinstance(column.dtype, pl.Datetime):
                found[name] = column.dt.epoch("s").to_list()
            elif column.dtype.is_float():
                rounded = column.fill_nan(None).round(places)
                found[name] = (rounded.cast(pl.Int64) if places == 0 else rounded).to_list()
            elif column.dtype == pl.String:
                found[name] = [None if x is None else _cut(x) for x in column]
            else:
                found[name] = column.to_list()
        return found

    vehicles = columns(
        report.vehicles,
        {"vehicle_class": 0, "tare_kg": 0, "gross_kg": 0, "drives": 0, "distance_km": 0,
         "known_share": 3, "tkm": 0, "tkm_std": 0, "mean_payload_kg": 0, "mean_payload_std_kg": 0,
         "empty_share": 3,
         "alarms": 0, "warnings": 0, "worst_overload": 4, "changes": 0, "last_kg": 0,
         "last_std_kg": 0, "last_time": 0, "has_file": 0},
    )  # fmt: skip
    return {
        "names": [NOTHING if name is None else _cut(name) for name in ids],
        "vehicles": vehicles,
        "legs": columns(
            report.legs,
            {"start": 0, "duration_s": 0, "distance_km": 1, "mass_kg": 0, "low95_kg": 0,
             "high95_kg": 0, "payload_kg": 0, "permitted_kg": 0, "overload": 4, "level": 0,
             "trailer": 0, "coupled": 0},
        ),
        "changes": columns(
            report.changes,
            {"time": 0, "latitude_deg": 5, "longitude_deg": 5, "before_kg": 0, "after_kg": 0,
             "change_kg": 0, "std_kg": 0, "kind": 0},
        ),
        "track": columns(report.track, {"start": 0, "end": 0, "mass_kg": 0, "state": 0}),
        "quality": columns(
            report.quality, {"kind": 0, "example": 0, "drives": 0, "share": 3, "last": 0}
        ),
        # The drives of one may have been removed since.
        "learnt": columns(
            report.learnt.filter(pl.col("vehicle_id").is_in(ids)).with_columns(
                change_pct=100.0 * (pl.col("factor") - 1.0),
                change_std_pct=100.0 * pl.col("factor_std"),
                findings=pl.concat_str(
                    pl.col("findings", "factor_reason").replace("", None),
                    separator="; ",
                    ignore_nulls=True,
                )
            ),
            {"verdict": 0, "change_pct": 1, "change_std_pct": 1, "drives": 0, "error_pct": 1,
             "error_std_pct": 1, "torque_drift_pct": 1, "torque_drift_std_pct": 1,
             "rolling_drift": 5, "rolling_drift_std": 5,
             "pitch_drift_deg": 2, "pitch_drift_std_deg": 2, "findings": 0},
        ),
        "verdicts": columns(
            report.verdicts,
            {"verdict": 0, "why": 0, "legs": 0, "worst_50": 4, "worst_70": 4, "worst_95": 4,
             "late": 0},
        ),
    }  # fmt: skip


def _cut(text: str) -> str:
    text = visible(text)
    return text if len(text) <= _LONGEST else text[:_LONGEST].rpartition(" ")[0] + " …"


def _without(vehicles: list[str | None]) -> str:
    """How many vehicles have no file, and the first of them."""
    return f"{len(vehicles)}" + (f": {_text(some(vehicles))}" if vehicles else "")


def _text(text: str | None) -> str:
    return NOTHING if text is None else escape(visible(text))


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"


def _when(time: Any) -> str:
    if time is None:
        return NOTHING
    return f'<span class="day">{time:%Y-%m-%d}</span> {time:%H:%M}'


def _number(value: float) -> str:
    """Write a number with its thousands apart, where no line may break it."""
    return f"{value:,.0f}".replace(",", "\u202f")


def how_sure(probability: float) -> str:
    """Return a probability in percent; nothing measured is sure, so that none is 100 %."""
    percent = 100.0 * probability
    return "above 99.9 %" if percent > 99.9 else f"{percent:.1f} %"


def _towing(leg: dict[str, Any]) -> str:
    """Return a trailer that is known, or probable by mass, drag area and slip."""
    return ", with trailer" if leg["coupled"] else ", trailer?" if leg["trailer"] else ""


def _share(share: float | None) -> str:
    return NOTHING if share is None else f"{100.0 * share:.1f} %"
