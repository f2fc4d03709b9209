"""GPX: track points with time; speed and course where an app writes them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

import numpy as np

from weighbridge.errors import DriveError, MissingExtraError
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping
from weighbridge.signals import Problem
from weighbridge.signals.cleaning import clean_columns
from weighbridge.signals.units import to_si

# Latitude, longitude and the like in the order of the columns below, with their units.
_COLUMNS: Final = (
    ("latitude", "deg"),
    ("longitude", "deg"),
    ("altitude", "m"),
    ("gnss_speed", "mps"),
    ("gnss_course", "deg"),
    ("hdop", ""),
)


def read_gpx(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the tracks of a GPX file; see `weighbridge.io.log.Reader`.

    Speed is in m/s and course in degrees, in GPX 1.0 itself and in the
    extensions of GPX 1.1 (Garmin TrackPointExtension v2).

    Raises
    ------
    DriveError
        No GPX file, or no point with a time.
    MissingExtraError
        gpxpy is not installed.
    """
    try:
        import gpxpy
        import gpxpy.gpx
    except ImportError:
        raise MissingExtraError("gpxpy", "position", f"reading {path.name}") from None
    data = path.read_bytes()
    if b"<!ENTITY" in data or b"<!DOCTYPE" in data:
        raise DriveError(
            f"{path} declares XML entities, which GPX has no use for and which can be made to "
            "fill any memory; remove its <!DOCTYPE …>"
        )
    text, salvaged = _text(data)
    try:
        gpx = gpxpy.parse(text)
    except (gpxpy.gpx.GPXException, ValueError) as e:
        raise DriveError(
            f"{path} is not a readable GPX file ({str(e).strip().splitlines()[0][:120]}); "
            "it may have been cut off: export it again"
        ) from None
    points = [p for track in gpx.tracks for part in track.segments for p in part.points]
    rows = [_row(p) for p in points if p.time is not None]
    if not rows:
        what = f"{len(points)} track points, none of them with a time" if points else "no track"
        raise DriveError(f"{path} has {what}; export the recording itself, not a planned route")
    log = Log(path, absolute=True)
    if salvaged:
        log.problems.append(Problem.of("file.points_break_off", file=path.name))
    if len(rows) < len(points):
        log.problems.append(
            Problem.of("clock.points_without", file=path.name, count=len(points) - len(rows))
        )
    cells = np.array(rows, dtype=np.float64)
    cells[np.abs(cells[:, 1]) > 90.0, 1] = math.nan
    cells[np.abs(cells[:, 2]) > 180.0, 2] = math.nan
    time = cells[:, 0] + (mapping.time.offset if mapping else 0.0)
    columns = [
        (name, to_si(cells[:, k], unit) if unit else cells[:, k])
        for k, (name, unit) in enumerate(_COLUMNS, start=1)
        if np.isfinite(cells[:, k]).any()
    ]
    log.signals, problems = clean_columns(time, columns, path.name)
    log.problems += problems
    return log


def _text(data: bytes) -> tuple[str, bool]:
    """Decode, and close a file that broke off after a whole track point."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    text = text.replace("\x00", "")
    if "</gpx>" in text or "</trkpt>" not in text:
        return text, False
    end = text.rindex("</trkpt>") + len("</trkpt>")
    return text[:end] + "</trkseg></trk></gpx>", True


def _row(point: Any) -> tuple[float, ...]:
    speed, course = point.speed, point.course
    for extension in point.extensions:
        for element in extension.iter():
            tag = str(element.tag).rsplit("}", 1)[-1].lower()
            if tag == "speed" and speed is None:
                speed = _number(element.text)
            elif tag == "course" and course is None:
                course = _number(element.text)
    return (
        point.time.timestamp(),
        _number(point.latitude),
        _number(point.longitude),
        _number(point.elevation),
        _number(speed),
        _number(course),
        _number(point.horizontal_dilution),
    )


def _number(value: Any) -> float:
    try:
        return math.nan if value is None else float(value)
    except (TypeError, ValueError):
        return math.nan
