"""GPX: track points with time; speed and course where an app writes them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.io.libraries import importing
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping, in_si
from weighbridge.io.understood import Lines, text_of
from weighbridge.signals import Problem

# Latitude, longitude and the like in the order of the columns below, with their units.
_COLUMNS: Final = (
    ("latitude", "deg"),
    ("longitude", "deg"),
    ("altitude", "m"),
    ("gnss_speed", "mps"),
    ("gnss_course", "deg"),
    ("hdop", ""),
)


_ROOT: Final = re.compile(r"<gpx\b[^<>]*>")
_POINT: Final = re.compile(r"(?=<trkpt\b)")
_END: Final = "</trkpt>"
_OPEN_TAG: Final = re.compile(r"<[^<>]*(?:<|$)")
_END_OF_FILE: Final = "</gpx>"


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
    with importing("gpxpy", "position", f"reading {path.name}"):
        import gpxpy
        import gpxpy.gpx
    data = path.read_bytes()
    if b"<!ENTITY" in data or b"<!DOCTYPE" in data:
        raise DriveError(
            f"{path} declares XML entities, which GPX has no use for and which can be made to "
            "fill any memory; remove its <!DOCTYPE …>"
        )
    text = text_of(data)

    def points_of(text: str) -> list[Any]:
        """Return the track points of a whole GPX text; a ValueError says why there are none."""
        try:
            tracks = gpxpy.parse(text).tracks
        except gpxpy.gpx.GPXException as e:
            raise ValueError(str(e)) from None
        return [p for track in tracks for part in track.segments for p in part.points]

    log = Log(path, absolute=True)
    try:
        points = points_of(text)
    except ValueError as e:
        points, damage = _salvaged(text, points_of)
        if not points:
            raise DriveError(
                f"{path} is not a readable GPX file ({str(e).strip().splitlines()[0][:120]}); "
                "it may have been cut off: export it again"
            ) from None
        log.problems += damage.problems("file.rows_cut", path)
        if _END_OF_FILE not in text:
            log.problems.append(Problem.of("file.points_break_off", file=path.name))
    rows = [_row(p) for p in points if p.time is not None]
    if not rows:
        what = f"{len(points)} track points, none of them with a time" if points else "no track"
        raise DriveError(f"{path} has {what}; export the recording itself, not a planned route")
    if len(rows) < len(points):
        log.problems.append(
            Problem.of("clock.points_without", file=path.name, count=len(points) - len(rows))
        )
    cells = np.array(rows, dtype=np.float64)
    cells[np.abs(cells[:, 1]) > 90.0, 1] = math.nan
    cells[np.abs(cells[:, 2]) > 180.0, 2] = math.nan
    time = cells[:, 0] + (mapping.time.offset if mapping else 0.0)
    columns = [
        (name, in_si(cells[:, k], unit))
        for k, (name, unit) in enumerate(_COLUMNS, start=1)
        if np.isfinite(cells[:, k]).any()
    ]
    log.take(time, columns)
    return log


def _salvaged(text: str, points_of: Callable[[str], list[Any]]) -> tuple[list[Any], Lines]:
    """Read the track points of a damaged file that are whole, and count the others.

    Parameters
    ----------
    text : of the file
    points_of : reads a whole GPX text, or raises a ValueError
    """
    head, *blocks = _POINT.split(text)
    opened = _ROOT.search(head)
    root = opened.group() if opened is not None else "<gpx>"
    if blocks and _END_OF_FILE not in text and _END not in blocks[-1]:
        blocks.pop()

    def line_of(part: str) -> int:
        at = text.find(part)
        return text.count("\n", 0, at + len(part) - len(part.lstrip())) + 1

    damage = Lines("track point")
    damage.add(b"", len(blocks), 0, 0)
    points: list[Any] = []
    # Parts that hold a damaged point are halved until it stands alone.
    parts = [blocks] if blocks else []
    while parts:
        part = parts.pop()
        whole = "".join(block[: block.find(_END) + len(_END)] for block in part)
        try:
            if any(_END not in block for block in part):
                raise ValueError
            points += points_of(f"{root}<trk><trkseg>{whole}</trkseg></trk></gpx>")
        except ValueError:
            half = len(part) // 2
            if half:
                parts += [part[half:], part[:half]]
            else:
                damage.add(b"", 0, 1, line_of(part[0]))
    # Between the points stand whole tags, and no end of a point.
    for block in blocks:
        rest = block[block.find(_END) + len(_END) :] if _END in block else ""
        if _END in rest or _OPEN_TAG.search(rest):
            damage.add(b"", 1, 1, line_of(rest))
    return points, damage


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
