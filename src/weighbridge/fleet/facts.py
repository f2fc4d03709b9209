"""Rows of the results: what `weigh` answers, where was driven, and spans with one mass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any, Final, NamedTuple

import numpy as np

from weighbridge.balance.wheel_slip import wheel_slip
from weighbridge.estimators.joint.drag_area import shown_drag_area
from weighbridge.estimators.joint.load_stops import SHORTEST
from weighbridge.fleet.schema import CHECKS, PERIOD
from weighbridge.fleet.trailers import SHOWN
from weighbridge.pipeline.weighing import Weighing
from weighbridge.results.row import WeighingRow
from weighbridge.signals import Drive, Floats
from weighbridge.vehicle import Vehicle

_GAP: Final = 10.0  # speeds farther apart say nothing of the way between [s]
_STILL: Final = 0.5  # slower, the vehicle stands [m/s]


class Travel:
    """Way, time in motion and positions of a drive."""

    def __init__(self, drive: Drive) -> None:
        speed = drive.speed
        self._time = np.zeros(1) if speed is None or not len(speed) else speed.time
        values = np.zeros(1) if speed is None or not len(speed) else speed.values
        step = np.diff(self._time)
        near = step <= _GAP
        middle = 0.5 * (values[1:] + values[:-1])
        self._way = np.concatenate([[0.0], np.cumsum(np.where(near, middle * step, 0.0))])
        moving = near & (middle > _STILL)
        self._moving = np.concatenate([[0.0], np.cumsum(np.where(moving, step, 0.0))])
        self._still = ~moving
        moved = np.flatnonzero(moving)
        self.begin = float(self._time[moved[0]]) if moved.size else None
        self._position = drive.get("latitude"), drive.get("longitude")
        self._known = speed is not None and len(speed) > 1

    def moving_time(self, start: float, end: float) -> float:
        """Return the time in motion within a span [s]."""
        return float(np.diff(np.interp([start, end], self._time, self._moving))[0])

    def stops(self) -> Floats:
        """Return the stops in which the load can change: begin and end (m, 2) [s].

        A gap of the speed counts as one, for what happened in it is not known.
        """
        edges = np.flatnonzero(np.diff(np.concatenate([[False], self._still, [False]])))
        found = self._time[edges].reshape(-1, 2)
        return np.asarray(found[found[:, 1] - found[:, 0] >= SHORTEST])

    def periods(self, start: float, end: float) -> list[float]:
        """Return the way in each `PERIOD` of a span of time [km]; empty where it is not known."""
        if not self._known or end <= start:
            return []
        edges = np.append(np.arange(start, end, PERIOD), end)
        way: list[float] = np.diff(1e-3 * np.interp(edges, self._time, self._way)).tolist()
        return way

    def between(self, start: float, end: float) -> dict[str, Any]:
        """Return the columns of a span of time [s]."""
        ends = np.array([start, end])
        way = np.diff(np.interp(ends, self._time, self._way))[0]
        found: dict[str, Any] = {
            "distance_km": 1e-3 * float(way) if self._known else None,
            "moving_s": self.moving_time(start, end) if self._known else None,
        }
        for name, signal in zip(("latitude", "longitude"), self._position, strict=True):
            for k, edge in enumerate(("start", "end")):
                value = None
                if signal is not None and len(signal):
                    at = np.interp(ends[k], signal.time, signal.values)
                    value = float(np.degrees(at))
                found[f"{edge}_{name}_deg"] = value
        return found


_FIRST: Final = 0.1  # a running mass counts from this standard deviation on [-]

_NUMBERS: Final = {
    "mass_kg": "mass",
    "std_kg": "std",
    "payload_kg": "payload",
    "duration_s": "duration",
    "used_s": "used_time",
    "converged_at_s": "converged_at",
    "bound_std_kg": "bound_std",
    "maker_mass_kg": "maker_mass",
}
"""Columns that hold a number of `WeighingRow`, and its field there."""


def answer(row: WeighingRow) -> dict[str, Any]:
    """Return the columns that hold what `weigh` says, to the last bit."""
    return {
        "drive": row.drive,
        "vehicle": row.vehicle,
        "start": instant_of(row.start),
        "date": _date(row.start),
        "method": row.method,
        "status": str(row.status),
        "reason": row.reason,
        "reason_id": row.reason_id,
        "low95_kg": _number(row.interval[0]),
        "high95_kg": _number(row.interval[1]),
        "warnings": list(row.warnings),
        "problem_ids": [p.id for p in row.problems],
        "trailer_connected": row.trailer_connected,
        **{column: _number(getattr(row, field)) for column, field in _NUMBERS.items()},
        "segments": [
            {
                "segment": number,
                "start_s": s.start,
                "end_s": s.end,
                "mass_kg": _number(s.mass),
                "std_kg": _number(s.std),
            }
            for number, s in enumerate(row.segments)
        ],
    }


def row_of(weighed: Weighing) -> dict[str, Any]:
    """Return a row with its segments: what `weigh` says, and where and how far was driven."""
    drive = weighed.drive
    found = answer(weighed.row)
    travel = Travel(drive)
    spans = spans_of(weighed, travel)
    bare = [span for span in spans if span.segment is None]
    result = weighed.result
    return {
        **found,
        "segments": _segments(found["segments"], spans, travel),
        "unweighed_s": sum(span.end - span.start for span in bare),
        **of_vehicle(weighed.vehicle),
        **travel.between(drive.start, drive.end),
        **_running(weighed, travel.begin, bare),
        "load_changed": weighed.load_changed,
        "freedom": None if result is None else float(result.degrees_of_freedom),
        "systematic_std_kg": None if result is None else _number(float(result.systematic_std)),
        **_beside(weighed),
        "known_mass_kg": drive.info.mass,
        "signals": sorted(drive.signals),
    }


def _beside(weighed: Weighing) -> dict[str, Any]:
    """Return what shows a trailer beside the mass: drag area and slip of the driven wheels."""
    result = weighed.result
    area, slip = shown_drag_area(result), None
    if result is not None and result.mass > 0.0:
        slip = wheel_slip(result.balance.table, result.mass, weighed.drive)
    found = (*(area or (None,) * 2), *(slip or (None,) * 5))
    return dict(zip(SHOWN, found, strict=True))


def of_vehicle(vehicle: Vehicle) -> dict[str, Any]:
    """Return the columns that a vehicle file says."""
    return {
        "vehicle_class": vehicle.kind,
        "tare_kg": vehicle.tare,
        "gross_kg": vehicle.gross,
    }


def _segments(
    reported: Sequence[dict[str, Any]], spans: Sequence[Span], travel: Travel
) -> list[dict[str, Any]]:
    """Return a row per span: the segment of `weigh`, and how far its mass reaches."""
    rows = []
    for number, span in enumerate(spans):
        found = {} if span.segment is None else reported[span.segment]
        edges = span.start, span.end
        row = {"from_s": span.start, "to_s": span.end, "weighed_s": span.weighed}
        row |= travel.between(*edges) | {"period_km": travel.periods(*edges)}
        empty = dict.fromkeys(("start_s", "end_s", "mass_kg", "std_kg"))
        rows.append(empty | found | row | {"segment": number})
    return rows


def _running(weighed: Weighing, begin: float | None, bare: Sequence[Span]) -> dict[str, Any]:
    """Return when the running mass came, and what it was at the instants of `CHECKS`.

    Parameters
    ----------
    weighed
    begin : instant of the first motion [s]; None where there is none
    bare : spans that were not weighed; none of their instants has a mass
    """
    result = weighed.result
    if result is None or begin is None:
        return {"first_mass_s": None, "checked_kg": [], "checked_std_kg": []}
    came = result.time[result.running_std <= _FIRST * result.running_mass]
    marks = np.arange(begin + CHECKS[0], weighed.drive.end, CHECKS[1])
    at = np.searchsorted(result.time, marks, side="right") - 1
    for span in bare:
        at[(marks >= span.start) & (marks <= span.end)] = -1
    found = {
        name: [_number(float(values[k])) if k >= 0 else None for k in at]
        for name, values in (
            ("checked_kg", result.running_mass),
            ("checked_std_kg", result.running_std),
        )
    }
    return {"first_mass_s": max(float(came[0]) - begin, 0.0) if came.size else None, **found}


def instant_of(start: str | None) -> datetime | None:
    """Return a text of ISO 8601 as an instant in UTC, which is its zone where it names none."""
    if start is None:
        return None
    found = datetime.fromisoformat(start)
    return (found if found.tzinfo is not None else found.replace(tzinfo=UTC)).astimezone(UTC)


def _date(start: str | None) -> Any:
    found = instant_of(start)
    return None if found is None else found.date()


def _number(value: float) -> float | None:
    return None if math.isnan(value) else float(value)


LEAST: Final = 20.0
"""Time in motion without a usable force after which a load is not known [s]: less is parking."""


class Span(NamedTuple):
    """A span of a drive.

    Attributes
    ----------
    start, end : [s]
    segment : number of the segment of the weighing whose mass stands here; None where none does
    weighed : time of the rows that its mass is made of [s]
    """

    start: float
    end: float
    segment: int | None
    weighed: float


def spans_of(weighed: Weighing, travel: Travel) -> list[Span]:
    """Part a drive into the spans of its segments and those that were not weighed, in order.

    Parameters
    ----------
    weighed
    travel : of its drive

    Returns
    -------
    Empty where the weighing has no segments. A drive without a mass has the spans of its segments.
    """
    result, segments = weighed.result, weighed.segments
    if result is None or not segments:
        return []
    used = result.time[result.used]
    step = float(np.median(np.diff(result.time))) if result.time.size > 1 else 0.0
    begins = [weighed.drive.start, *(s.start for s in segments[1:])]
    ends = [*begins[1:], weighed.drive.end]
    gaps = []
    if used.size and math.isfinite(weighed.mass):
        stops = travel.stops()
        first, last = _before(stops, float(used[0])), _after(stops, float(used[-1]))
        gaps = [(begins[0], first), (last, ends[-1])]
        if weighed.load_changed:
            gaps += [(_after(stops, _last(used, edge)), edge) for edge in begins[1:]]
    bare = [(a, b) for a, b in gaps if b > a and travel.moving_time(a, b) >= LEAST]
    found = [Span(a, b, None, 0.0) for a, b in bare]
    for number, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        begin = max([begin, *(b for a, b in bare if a <= begin < b)])
        end = min([end, *(a for a, b in bare if a < end <= b)])
        rows = np.diff(np.searchsorted(used, (begin, end)))[0]
        found.append(Span(begin, end, number, step * float(rows)))
    return sorted(found, key=lambda span: span.start)


def _last(used: Floats, edge: float) -> float:
    """Last usable row before an instant [s]."""
    return float(used[max(int(np.searchsorted(used, edge)) - 1, 0)])


def _before(stops: Floats, instant: float) -> float:
    """When the vehicle last drove off after a stop before an instant [s]; -inf where it did not."""
    return float(np.max(stops[stops[:, 0] < instant, 1], initial=-math.inf))


def _after(stops: Floats, instant: float) -> float:
    """When the vehicle first drives off after a stop behind an instant [s]; inf where not."""
    return float(np.min(stops[stops[:, 1] > instant, 1], initial=math.inf))
