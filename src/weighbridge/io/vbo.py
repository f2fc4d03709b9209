"""VBOX ``.vbo``: Racelogic's text log of GNSS at up to 100 Hz.

Facts of the format from Racelogic, *VBO File Format* (support pages): the
titles under ``[header]`` carry the units, ``[column names]`` the columns;
latitude and longitude in minutes, north and **west** positive, but some other
loggers write degrees, east positive; time of day in
UTC as HHMMSS.ss; the number of satellites is raised by 64 while the brake
trigger is on and by 128 with differential correction.
"""

from __future__ import annotations

import datetime as dt
import re
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl

from weighbridge.errors import DriveError
from weighbridge.io.log import Log
from weighbridge.io.mapping import MappedSignal, TableMapping, in_si, lacking, resolved_unit
from weighbridge.io.table import DAY, column_list, unwrapped
from weighbridge.io.understood import Lines, number_of, text_of
from weighbridge.io.way import way_ratio
from weighbridge.signals import Bools, Floats, Problem, to_si

_CREATED: Final = re.compile(
    r"created on (\d{1,2})/(\d{1,2})/(\d{4})(?:\s*(?:@|at)\s*(\d{1,2}):(\d{2}))?", re.IGNORECASE
)
_SPEED_UNITS: Final = {
    "kmh": "kmh", "km/h": "kmh", "kph": "kmh", "knots": "kn", "kts": "kn", "mph": "mph",
    "m/s": "mps", "ms": "mps",
}  # fmt: skip
_BRAKE: Final = 64

_PLACES: Final = ("lat", "long")

# Degrees, north and east positive, of minutes, north and west positive.
_MINUTES: Final = (1.0 / 60.0, -1.0 / 60.0)

# Rows in motion to east or west by which the sign of the longitude is judged.
_COURSES: Final = 20

# Fewer satellites than these give no position (Racelogic counts four for one with height).
_SATELLITES: Final = 3


def read_vbo(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read a VBOX log; see `weighbridge.io.log.Reader`.

    The accelerations in it are differences of its speed and say nothing of
    the road's slope, so they are not taken for specific force. A mapping names
    the columns of CAN modules, by the short name or by the title, and goes
    before the columns known.

    Raises
    ------
    DriveError
        Not a VBOX log, or one without rows.
    ConfigError
        The mapping gives a column no unit that it could be in.
    """
    text = text_of(path.read_bytes())
    head, sections = _sections(text)
    names = [n.lower() for n in " ".join(sections.get("column names", [])).split()]
    if not names or "data" not in sections:
        raise DriveError(
            f"{path} is no VBOX log: it has no [column names] and [data]; export it as .vbo again"
        )
    log = Log(path)
    cells = _cells(log, sections["data"], len(names))
    places = {name: k for k, name in reversed(list(enumerate(names)))}
    if "time" not in places:
        raise DriveError(f"{path} has no column 'time'; it has {column_list(names)}")
    clock = cells[:, places["time"]]
    seconds = np.floor(clock / 1e4) * 3600.0 + np.floor(clock / 1e2) % 100.0 * 60.0 + clock % 1e2
    seconds[~((clock >= 0.0) & (clock < 240000.0))] = np.nan
    time, log.absolute = _dated(unwrapped(seconds), head)
    if mapping:
        time = time + mapping.time.offset

    used = {"time", "sats"}
    columns: list[tuple[str, Floats]] = []
    for signal, place in _mapped(log, mapping, names, sections.get("header", [])):
        suffix = resolved_unit(signal, None, mapping.source if mapping else "")
        used.add(names[place])
        columns.append((signal.name, in_si(cells[:, place], suffix, signal)))
    taken = {name for name, _ in columns}
    fixed = np.ones(clock.size, dtype=bool)
    if "sats" in places:
        fixed, brake = _satellites(log, cells[:, places["sats"]])
        # Without a wire to the brake the flag is never set, and says nothing.
        if brake.any() and "brake_switch" not in taken:
            columns.append(("brake_switch", brake))

    def take(column: str, name: str, unit: str, factor: float = 1.0) -> None:
        if column in places and name not in taken:
            used.add(column)
            values = np.where(fixed, factor * cells[:, places[column]], np.nan)
            columns.append((name, to_si(values, unit)))

    speed_unit = _speed_unit(log, sections.get("header", []), names, mapping)
    speed = to_si(cells[:, places["velocity"]], speed_unit) if "velocity" in places else None
    factors = _MINUTES
    if {"lat", "long"} <= places.keys() and not {"latitude", "longitude"} & taken:
        latitude, longitude = (np.where(fixed, cells[:, places[c]], np.nan) for c in _PLACES)
        course = np.radians(cells[:, places["heading"]]) if "heading" in places else None
        factors = _degrees_of(log, time, latitude, longitude, speed, course)
    take("lat", "latitude", "deg", factors[0])
    take("long", "longitude", "deg", factors[1])
    take("height", "altitude", "m")
    take("heading", "gnss_course", "deg")
    take("velocity", "gnss_speed", speed_unit)
    if ignored := [n for n in names if n not in used]:
        log.problems.append(
            Problem.of("file.ignored", file=path.name, columns=column_list(ignored))
        )
    log.take(time, columns)
    return log


def _satellites(log: Log, cells: Floats) -> tuple[Bools, Floats]:
    """Which rows have enough satellites for a fix, and the brake's flag."""
    sats = np.nan_to_num(cells).astype(np.int64)
    fixed = np.asarray((sats % _BRAKE) >= _SATELLITES)
    if not fixed.all():
        log.problems.append(
            Problem.of(
                "position.few_satellites",
                file=log.path.name,
                count=int(np.count_nonzero(~fixed)),
                rows=fixed.size,
                satellites=_SATELLITES,
            )
        )
    return fixed, ((sats // _BRAKE) % 2).astype(np.float64)


def _degrees_of(
    log: Log,
    time: Floats,
    latitude: Floats,
    longitude: Floats,
    speed: Floats | None,
    course: Floats | None,
) -> tuple[float, float]:
    """Factors that make degrees, north and east positive, of what a log has for its positions."""
    factors = _MINUTES
    if _in_degrees(time, latitude, longitude, speed):
        factors = (1.0, 1.0)
        log.problems.append(Problem.of("position.degrees", file=log.path.name))
    if course is not None and _mirrored(factors[0] * latitude, factors[1] * longitude, course):
        factors = (factors[0], -factors[1])
        east = "east" if factors[1] > 0.0 else "west"
        log.problems.append(
            Problem.of("position.mirrored", "longitude", file=log.path.name, positive=east)
        )
    return factors


def _in_degrees(time: Floats, latitude: Floats, longitude: Floats, speed: Floats | None) -> bool:
    """Whether positions are in degrees, not minutes: by the way they cover, else by their size.

    Minutes as small as degrees are lie in the sea off Ghana.
    """
    north, east = np.abs(latitude), np.abs(longitude)
    known = np.isfinite(north) & np.isfinite(east)
    if not known.any() or np.median(north[known]) > 90.0 or np.median(east[known]) > 180.0:
        return False
    if speed is not None:
        ratio = way_ratio(time, speed, time, np.radians(latitude), np.radians(longitude))
        if ratio > 0.0:
            return bool(ratio < 60.0**0.5)
    return True


def _mirrored(latitude: Floats, longitude: Floats, course: Floats) -> bool:
    """Whether positions go west where the course is east [deg], [rad]."""
    north = np.diff(latitude)
    east = np.diff(longitude) * np.cos(np.radians(latitude[1:]))
    used = np.isfinite(north + east + course[1:]) & (np.hypot(north, east) > 0.0)
    used &= np.abs(np.sin(course[1:])) > 0.3
    if np.count_nonzero(used) < _COURSES:
        return False
    agrees = np.sign(east[used]) == np.sign(np.sin(course[1:][used]))
    return bool(np.mean(agrees) < 0.2)


def _mapped(
    log: Log, mapping: TableMapping | None, names: list[str], titles: list[str]
) -> list[tuple[MappedSignal, int]]:
    """Columns that a mapping names, the speed apart of which it shows the unit alone."""
    found = []
    by_title = [t.lower() for t in titles] if len(titles) == len(names) else []
    for signal in mapping.signals if mapping else ():
        wanted = signal.column.strip().lower()
        if signal.name == "gnss_speed" and wanted == "velocity":
            continue
        place = next((x.index(wanted) for x in (names, by_title) if wanted in x), None)
        if place is not None:
            found.append((signal, place))
        elif not signal.optional and mapping is not None:
            log.lacking.append(lacking(f"{log.path.name}: column", signal, mapping.source))
    return found


def _sections(text: str) -> tuple[str, dict[str, list[str]]]:
    """Lines before the first bracket, and the lines of each bracketed section."""
    head, sections, current = "", dict[str, list[str]](), ""
    for line in text.splitlines():
        plain = line.strip()
        if plain.startswith("[") and plain.endswith("]"):
            current = plain[1:-1].strip().lower()
            sections.setdefault(current, [])
        elif not current:
            head += f"{plain}\n"
        elif plain:
            sections[current].append(plain)
    return head, sections


def _cells(log: Log, lines: list[str], width: int) -> Floats:
    """Data rows of the full width as numbers; NaN where a cell is none."""
    rows = [r for r in (line.split() for line in lines) if len(r) == width]
    if not rows:
        raise DriveError(f"{log.path} has no row of {width} values under [data]; record it again")
    if lost := len(lines) - len(rows):
        strange = next(line for line in lines if len(line.split()) != width)
        read = Lines()
        read.add(b"", len(lines), lost, number_of(log.path, strange))
        log.problems += read.problems("file.rows_cut", log.path)
    flat = pl.Series([cell for row in rows for cell in row], dtype=pl.String)
    if not flat.str.contains(".", literal=True).any():
        flat = flat.str.replace(",", ".", literal=True)
    # The parser of numbers takes no plus sign.
    numbers = flat.str.strip_prefix("+").cast(pl.Float64, strict=False)
    return numbers.to_numpy().astype(np.float64).reshape(-1, width)


def _dated(time: Floats, head: str) -> tuple[Floats, bool]:
    """Count from 1970 where the file shows its date.

    The date may be of another zone than the times, which are UTC: of the days
    around it the one that puts the first row nearest to it is taken.
    """
    found = _CREATED.search(head)
    finite = time[np.isfinite(time)]
    if found is None or finite.size == 0:
        return time, False
    day, month, year = (int(g) for g in found.groups()[:3])
    try:
        midnight = dt.datetime(year, month, day, tzinfo=dt.UTC).timestamp()
    except ValueError:
        return time, False
    hour, minute = (int(g) if g is not None else 12 for g in found.groups()[3:])
    created = midnight + 3600.0 * hour + 60.0 * minute
    first = midnight + float(finite[0])
    return time + midnight + DAY * round((created - first) / DAY), True


def _speed_unit(log: Log, titles: list[str], names: list[str], mapping: TableMapping | None) -> str:
    """Unit of the velocity: by the mapping, else by the title in its place or that says so."""
    if "velocity" not in names:
        return "kmh"
    mapped = next((s for s in mapping.signals if s.name == "gnss_speed"), None) if mapping else None
    if mapped is not None and mapped.unit is not None:
        return mapped.unit
    title = ""
    if len(titles) == len(names):
        title = titles[names.index("velocity")].lower()
    if not title.startswith("velocity"):
        title = next((t.lower() for t in titles if t.lower().startswith("velocity")), "")
    unit = _SPEED_UNITS.get(title.removeprefix("velocity").strip(" ()[]"))
    if unit is None:
        log.problems.append(
            Problem.of(
                "speed.unit_missing",
                "gnss_speed",
                serious=True,
                file=log.path.name,
                title=title or "no title",
            )
        )
        return "kmh"
    return unit
