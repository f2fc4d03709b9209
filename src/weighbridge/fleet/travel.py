"""Way, motion, stops and places of a drive."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from weighbridge.estimators.joint.load_stops import SHORTEST
from weighbridge.fleet.schema import PERIOD
from weighbridge.signals import Drive, Floats

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
