"""Spans of a drive that have a load of their own: weighed, or driven without a usable force.

A torque that freezes leaves nothing to weigh by. The mass from before stands until the next stop at
which the load can change; from there on none is known.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from weighbridge.fleet.travel import Travel
from weighbridge.pipeline.weighing import Weighing
from weighbridge.signals import Floats

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
