"""What a live scale shows at one moment."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final, Literal

from scipy.special import ndtr, ndtri

from weighbridge.arguments import check_number
from weighbridge.messages import Explained, Problem
from weighbridge.results.writing import check_level

Side = Literal["above", "below"]
"""Of a limit."""

SILENT: Final = 3.0
"""A signal that has not come for so long may be silent [s]."""

SLOWEST: Final = 60.0
"""Signals that hardly change are asked for so seldom [s]."""


class LiveStatus(StrEnum):
    """What a live mass is worth."""

    LEARNING = "learning"
    WEIGHED = "weighed"
    INCONSISTENT = "inconsistent"


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalHealth:
    """How one signal comes in.

    Attributes
    ----------
    name : canonical name
    rate : samples per second lately [Hz]; 0 where none came
    age : since its newest sample, by the newest of all [s]; infinite where none came
    period : longest time between its last samples [s]; NaN where it came once or never
    late, unfit : samples dropped because they came too late, or were no finite number or an
        impossible instant
    needed : the scale cannot weigh without it
    rests : it came, and the vehicle is parked: that it is silent is no fault
    """

    name: str
    rate: float
    age: float
    period: float = math.nan
    late: int = 0
    unfit: int = 0
    needed: bool = False
    rests: bool = False

    @property
    def fresh(self) -> bool:
        """Whether it comes at all: not silent for `SILENT` and three of its periods.

        One that came once may be of the slowest, which come each `SLOWEST`.
        """
        period = self.period if math.isfinite(self.period) else SLOWEST
        return self.age <= max(SILENT, 3.0 * period)

    @property
    def fails(self) -> bool:
        """Whether it does not come although it should."""
        return not (self.fresh or self.rests)


@dataclass(frozen=True, slots=True, kw_only=True)
class AlertState:
    """How the watch over one limit stands.

    Attributes
    ----------
    limit : [kg]
    side : on which its case is
    active : the alert has begun, and not ended
    probability : of a mass on that side [-]; None where there is no mass
    """

    limit: float
    side: Side
    active: bool
    probability: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class KerbState:
    """What the tilt of the parked vehicle shows.

    Attributes
    ----------
    follows : the tilt follows the load; None while too few changes of load were weighed
    weighed : changes of load that the motion has weighed, by which it is learnt
    change, std : of the load since the vehicle stands [kg]; NaN where none is sure
    """

    follows: bool | None = None
    weighed: int = 0
    change: float = math.nan
    std: float = math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Interval that holds the change with 95 % probability [kg]."""
        half = float(ndtri(0.975)) * self.std
        return self.change - half, self.change + half

    def to_dict(self) -> dict[str, Any]:
        """Return what is written as JSON."""
        known = math.isfinite(self.change)
        return {
            "status": {None: "learning", True: "watching", False: "blind"}[self.follows],
            "weighed_changes": self.weighed,
            "change_kg": _known(self.change),
            "std_kg": _known(self.std),
            "interval95_kg": list(self.interval) if known else None,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveWeighing(Explained):
    """The mass at one moment of a drive, its uncertainty, and what would reduce it.

    Attributes
    ----------
    vehicle : its name
    time : instant it holds for, on the clock of the samples [s]; NaN before the first
    age : time from that instant to now [s]
    newest : instant of the newest sample of any signal [s]; NaN before the first
    status : ``learning`` until the mass is within 5 % with 95 % probability, ``weighed``, or
        ``inconsistent`` where the drive contradicts itself or the vehicle file
    refusal : why the status is not ``weighed``; None if it is
    parked : the vehicle stands and has stopped reporting: the mass stays as it was
    mass, std : [kg]; NaN where there is none
    tare, gross : of the vehicle file [kg]; None where it does not say
    tared : mass that the user has tared [kg]; None for ``tare``
    driven : time on the move so far [s]
    progress : part of the way to 2 % [-], 0 to 1: the variance that is allowed then over that now
    progress_to_5 : the same to 5 %, of what the last look at all records had where it showed no
        mass; NaN before the first look
    reach : half width of the 95 % interval over the mass that 4.5 h more of driving leave, nearly
        all of it by vehicle file and equipment [-]; NaN where unknown
    minutes_to_5, minutes_to_2 : of driving like until now until the interval of 95 % is as narrow
        as so many percent; 0 where it is, infinite beyond 4.5 h, NaN where unknown
    advice : which driving would help; empty where nothing more is needed
    look : part of the driving between two looks at all records that is done [-], 0 to 1; NaN where
        the mass does not wait for the next one
    provisional : the mass counts samples among which others may still come; the next one is made
        anew from the settled state
    kerb : what the tilt shows while the vehicle is parked
    alerts : limits that are watched, by the settled mass
    signals : health of each
    problems : what was found and what is uncertain
    """

    vehicle: str
    time: float
    age: float
    status: LiveStatus
    refusal: Problem | None
    mass: float
    std: float
    tare: float | None
    gross: float | None
    tared: float | None
    driven: float
    progress: float
    minutes_to_5: float
    minutes_to_2: float
    advice: str
    progress_to_5: float = math.nan
    parked: bool = False
    newest: float = math.nan
    reach: float = math.nan
    look: float = math.nan
    provisional: bool = False
    kerb: KerbState = KerbState()
    alerts: tuple[AlertState, ...] = ()
    signals: tuple[SignalHealth, ...] = ()
    problems: tuple[Problem, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Texts of the `problems`."""
        return self.warnings

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Interval that holds the mass with probability ``level``, between 0 and 1 [kg]."""
        check_level(level)
        half = float(ndtri(0.5 * (1.0 + level))) * self.std
        return self.mass - half, self.mass + half

    @property
    def payload(self) -> float | None:
        """Mass above the tare, or above what was set to nought [kg]; None where none is known."""
        nought = self.tared if self.tared is not None else self.tare
        return None if nought is None or math.isnan(self.mass) else self.mass - nought

    @property
    def overload(self) -> float | None:
        """Probability that the permitted mass is exceeded [-]; None where it is not known."""
        return self.above(self.gross)

    def above(self, limit: float | None) -> float | None:
        """Probability that the mass is above a limit [kg]; None where either is not known."""
        check_number("limit", limit, optional=True)
        if limit is None or not self.std > 0.0:
            return None
        return float(ndtr((self.mass - limit) / self.std))

    @property
    def share(self) -> float | None:
        """Mass over the permitted one [-]; None where it is not known."""
        return None if self.gross is None or math.isnan(self.mass) else self.mass / self.gross

    def to_dict(self) -> dict[str, Any]:
        """Return what is written as JSON; what is not known is None.

        Minutes that are infinite are None too: ``reach_percent`` is not below 5 or 2 then, and
        None or below where they are not known.
        """
        low, high = self.interval()
        return {
            "vehicle": self.vehicle,
            "time_s": _known(self.time),
            "age_s": _known(self.age),
            "status": str(self.status),
            "parked": self.parked,
            "reason": self.reason,
            "reason_id": self.reason_id,
            "mass_kg": _known(self.mass),
            "std_kg": _known(self.std),
            "interval95_kg": None if math.isnan(low) else [low, high],
            "payload_kg": self.payload,
            "tared_kg": self.tared,
            "permitted_kg": self.gross,
            "share_of_permitted": self.share,
            "overload_probability": self.overload,
            "alerts": [
                {
                    "side": a.side,
                    "limit_kg": a.limit,
                    "active": a.active,
                    "probability": a.probability,
                }
                for a in self.alerts
            ],
            "kerb": self.kerb.to_dict(),
            "driven_s": self.driven,
            "progress": self.progress,
            "progress_to_5": _known(self.progress_to_5),
            "look": _known(self.look),
            "provisional": self.provisional,
            "reach_percent": _known(100.0 * self.reach),
            "minutes_to_5_percent": _known(self.minutes_to_5),
            "minutes_to_2_percent": _known(self.minutes_to_2),
            "advice": self.advice,
            "signals": [
                {
                    "name": s.name,
                    "rate_hz": s.rate,
                    "age_s": _known(s.age),
                    "fresh": s.fresh,
                    "rests": s.rests,
                    "needed": s.needed,
                    "late": s.late,
                    "unfit": s.unfit,
                }
                for s in self.signals
            ],
            "problems": [p.to_dict() for p in self.problems],
            "notes": list(self.notes),
        }


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
