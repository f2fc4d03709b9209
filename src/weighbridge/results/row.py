"""The answer of one weighing without its arrays."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

from weighbridge.estimators import Segment, Status
from weighbridge.messages import Explained, Problem
from weighbridge.results.writing import number
from weighbridge.visible import visible_json


@dataclass(frozen=True, slots=True, kw_only=True)
class WeighingRow(Explained):
    """What `MassResult` says in numbers and words; a few hundred bytes where that holds arrays.

    Attributes
    ----------
    drive, vehicle : names
    start : wall-clock time at which the drive begins, ISO 8601 in UTC; None where it has no date
    method : name of the estimator
    status, refusal, problems, segments : as of `MassResult`
    mass, std : [kg]; NaN where there is no mass
    interval : holds the mass with 95 % probability [kg]
    payload : mass minus the vehicle's tare [kg]; NaN where either is unknown
    duration, used_time, converged_at : of the drive, of the rows used, until the mass stays [s]
    bound_std : Cramer-Rao bound of the drive [kg]
    maker_mass : that the vehicle itself reports, shown and never used [kg]; NaN without one
    trailer_connected : whether the vehicle reports a trailer; None where it does not say
    load_changed : whether the load changed between segments; else they are legs of a drive
    """

    drive: str
    vehicle: str
    method: str
    status: Status
    refusal: Problem | None = None
    start: str | None = None
    mass: float = math.nan
    std: float = math.nan
    interval: tuple[float, float] = (math.nan, math.nan)
    payload: float = math.nan
    duration: float = math.nan
    used_time: float = math.nan
    converged_at: float = math.nan
    bound_std: float = math.nan
    maker_mass: float = math.nan
    trailer_connected: bool | None = None
    segments: tuple[Segment, ...] = ()
    problems: tuple[Problem, ...] = ()
    load_changed: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Return what ``weigh --json`` prints: numbers, None where there is no mass."""
        return {
            "drive": self.drive,
            "vehicle": self.vehicle,
            "start": self.start,
            "method": self.method,
            "status": str(self.status),
            "reason": self.reason,
            "reason_id": self.reason_id,
            "mass_kg": number(self.mass),
            "std_kg": number(self.std),
            "interval95_kg": [number(bound) for bound in self.interval],
            "payload_kg": number(self.payload),
            "duration_s": number(self.duration),
            "used_s": number(self.used_time),
            "converged_at_s": number(self.converged_at),
            "bound_std_kg": number(self.bound_std),
            "maker_mass_kg": number(self.maker_mass),
            "trailer_connected": self.trailer_connected,
            "segments": [
                {
                    "start_s": number(s.start),
                    "end_s": number(s.end),
                    "mass_kg": number(s.mass),
                    "std_kg": number(s.std),
                }
                for s in self.segments
            ],
            "problems": [p.to_dict() for p in self.problems],
            "warnings": list(self.warnings),
        }

    def to_json(self) -> str:
        """Return `to_dict` as one line of JSON."""
        return visible_json(json.dumps(self.to_dict(), ensure_ascii=False))


def unread_row(drive: str, vehicle: str, method: str, refusal: Problem | None) -> WeighingRow:
    """Return the row of a drive that could not be used at all."""
    return WeighingRow(
        drive=drive,
        vehicle=vehicle,
        method=method,
        status=Status.INCONSISTENT,
        refusal=refusal,
    )
