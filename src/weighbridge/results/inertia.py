"""Sprung mass and inertias of one ride, as data."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from weighbridge.estimators.track import Status
from weighbridge.inertia import InertiaTrack, Method, SuspensionCheck, inverse_interval
from weighbridge.messages import Explained
from weighbridge.results.writing import check_level, number, write_track
from weighbridge.signals import Drive, Floats, Problem
from weighbridge.signals.shown import in_html, plural
from weighbridge.vehicle import Ride, Vehicle
from weighbridge.visible import visible_json

if TYPE_CHECKING:
    import polars as pl

TOO_WIDE: Final = 0.15
"""Relative standard deviation above which a parameter is not known [-]."""

TRACK_COLUMNS: Final = (
    "time_s", "sprung_mass_kg", "sprung_mass_std_kg", "roll_inertia_kgm2",
    "roll_inertia_std_kgm2", "pitch_inertia_kgm2", "pitch_inertia_std_kgm2",
    "vertical_velocity_mps", "roll_rate_radps", "pitch_rate_radps",
    "nis_vertical", "nis_roll", "nis_pitch",
)  # fmt: skip
"""Columns of the track, as files carry them; nis is the squared innovation over its variance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadSegment:
    """Parameters between two changes of load.

    Attributes
    ----------
    start, end : [s]
    values, stds : (3,) sprung mass [kg], roll and pitch inertia [kg m^2], at its end
    """

    start: float
    end: float
    values: Floats
    stds: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class InertiaResult(Explained):
    """Sprung mass and inertias at the end of a drive, their uncertainty and the reason.

    Attributes
    ----------
    drive, vehicle : what it was made from
    method : name of the filter
    status : `Status`
    refusal : why there is no mass; None where there is
    track : the filter's parameters over time; None where nothing could be estimated
    suspension : each spring and damper against the vehicle file; None where the ride is
        too short to show
    model_std : (3,) relative standard deviation beside the filter's: of the vehicle
        file, of what does not fit, and of noise [-]
    segments : parameters between changes of load
    problems : what was corrected or is uncertain
    """

    drive: Drive
    vehicle: Vehicle
    method: Method
    status: Status
    refusal: Problem | None
    track: InertiaTrack | None
    suspension: SuspensionCheck | None
    model_std: Floats
    segments: tuple[LoadSegment, ...]
    problems: tuple[Problem, ...] = ()

    def _repr_html_(self) -> str:
        head = f"Inertia of {self.drive.name!r} by {self.method}, vehicle {self.vehicle.name!r}"
        found = f"{self.status}: {self.reason}"
        if math.isfinite(self.mass):
            low, high = self.mass_interval()
            found = f"{self.mass:.0f} kg, {low:.0f} to {high:.0f} kg with 95 % probability"
        return in_html((head, found, plural(len(self.warnings), "warning")))

    @property
    def ride(self) -> Ride:
        """The vehicle's suspension."""
        assert self.vehicle.ride is not None
        return self.vehicle.ride

    @property
    def values(self) -> Floats:
        """(3,) sprung mass [kg], roll and pitch inertia [kg m^2]; NaN where unknown."""
        if self.track is None or self.status is not Status.CONVERGED:
            return np.full(3, np.nan)
        return np.where(self._relative_std() <= TOO_WIDE, self.track.parameters[-1], np.nan)

    @property
    def stds(self) -> Floats:
        """(3,) their standard deviations; NaN where unknown."""
        return np.asarray(self.values * self._relative_std())

    def _relative_std(self) -> Floats:
        if self.track is None:
            return np.full(3, np.inf)
        by_filter = self.track.alpha_std[-1] / self.track.alpha[-1]
        return np.asarray(np.hypot(by_filter, self.model_std))

    def intervals(self, level: float = 0.95) -> tuple[Floats, Floats]:
        """(3,) bounds that hold the parameters with the probability ``level``.

        Raises
        ------
        ConfigError
            The level is not between 0 and 1.
        """
        check_level(level)
        known = np.isfinite(self.values)
        relative = np.where(known, self._relative_std(), np.nan)
        return inverse_interval(self.values, np.ones(3), relative, level)

    @property
    def mass(self) -> float:
        """Of all that rolls: sprung and unsprung mass [kg]; NaN where unknown."""
        return float(self.values[0]) + self.ride.front_unsprung + self.ride.rear_unsprung

    @property
    def std(self) -> float:
        """Standard deviation of the mass [kg]; NaN where unknown."""
        return float(self.stds[0])

    def mass_interval(self, level: float = 0.95) -> tuple[float, float]:
        """Bounds that hold the mass with the probability ``level`` [kg]; NaN where unknown.

        Raises
        ------
        ConfigError
            The level is not between 0 and 1.
        """
        low, high = self.intervals(level)
        unsprung = self.ride.front_unsprung + self.ride.rear_unsprung
        return float(low[0]) + unsprung, float(high[0]) + unsprung

    @property
    def axle_loads(self) -> tuple[float, float]:
        """What scales under front and rear axle would show on the level [kg]."""
        return self._axles(float(self.values[0]))

    def _axles(self, sprung: float) -> tuple[float, float]:
        """Axle loads of a sprung mass whose centre of gravity is the vehicle file's [kg]."""
        ride = self.ride
        base = ride.front_axle + ride.rear_axle
        return (
            sprung * ride.rear_axle / base + ride.front_unsprung,
            sprung * ride.front_axle / base + ride.rear_unsprung,
        )

    def axle_load_intervals(
        self, level: float = 0.95
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """Bounds that hold the front and the rear axle load with the probability ``level`` [kg].

        The centre of gravity is taken to be where the vehicle file has it.

        Raises
        ------
        ConfigError
            The level is not between 0 and 1.
        """
        low, high = (float(bound[0]) for bound in self.intervals(level))
        (front_low, rear_low), (front_high, rear_high) = self._axles(low), self._axles(high)
        return (front_low, front_high), (rear_low, rear_high)

    def payload_interval(self, level: float = 0.95) -> tuple[float, float]:
        """Bounds that hold the payload with the probability ``level`` [kg]; NaN where unknown.

        Raises
        ------
        ConfigError
            The level is not between 0 and 1.
        """
        low, high = self.mass_interval(level)
        tare = math.nan if self.vehicle.tare is None else self.vehicle.tare
        return low - tare, high - tare

    @property
    def payload(self) -> float:
        """Mass minus the vehicle's tare [kg]; NaN where either is unknown."""
        return self.mass - self.vehicle.tare if self.vehicle.tare is not None else math.nan

    @property
    def converged_at(self) -> float:
        """Time until all that is known stays within 5 % of the result [s]; NaN if never."""
        if self.track is None or not np.isfinite(self.values).any():
            return math.nan
        off = np.abs(self.track.parameters / self.values - 1.0) > 0.05
        late = np.flatnonzero(off.any(axis=1))
        at = self.track.time[late[-1] + 1] if late.size else self.track.time[0]
        return float(at) - self.drive.start

    def to_dict(self) -> dict[str, Any]:
        """Return what ``inertia --json`` prints: numbers, None where unknown."""
        low, high = self.intervals()
        lightest, heaviest = self.mass_interval()
        front, rear = self.axle_loads
        of_front, of_rear = self.axle_load_intervals()
        parts: dict[str, Any] = {}
        for k, name in enumerate(("sprung_mass_kg", "roll_inertia_kgm2", "pitch_inertia_kgm2")):
            stem, unit = name.rsplit("_", 1)
            parts[name] = number(self.values[k])
            parts[f"{stem}_std_{unit}"] = number(self.stds[k])
            parts[f"{stem}_interval95_{unit}"] = [number(low[k]), number(high[k])]
        return {
            "drive": self.drive.name,
            "vehicle": self.vehicle.name,
            "method": self.method,
            "status": str(self.status),
            "reason": self.reason,
            "reason_id": self.reason_id,
            **parts,
            "mass_kg": number(self.mass),
            "std_kg": number(self.std),
            "interval95_kg": [number(lightest), number(heaviest)],
            "axle_load_front_kg": number(front),
            "axle_load_front_interval95_kg": [number(bound) for bound in of_front],
            "axle_load_rear_kg": number(rear),
            "axle_load_rear_interval95_kg": [number(bound) for bound in of_rear],
            "payload_kg": number(self.payload),
            "payload_interval95_kg": [number(bound) for bound in self.payload_interval()],
            "duration_s": number(self.drive.duration),
            "converged_at_s": number(self.converged_at),
            "segments": [
                {
                    "start_s": number(s.start),
                    "end_s": number(s.end),
                    "sprung_mass_kg": number(s.values[0]),
                    "sprung_mass_std_kg": number(s.stds[0]),
                    "roll_inertia_kgm2": number(s.values[1]),
                    "roll_inertia_std_kgm2": number(s.stds[1]),
                    "pitch_inertia_kgm2": number(s.values[2]),
                    "pitch_inertia_std_kgm2": number(s.stds[2]),
                }
                for s in (self.segments if self.status is Status.CONVERGED else ())
            ],
            "problems": [p.to_dict() for p in self.problems],
            "warnings": list(self.warnings),
        }

    def to_json(self) -> str:
        """Return `to_dict` as one line of JSON."""
        return visible_json(json.dumps(self.to_dict(), ensure_ascii=False))

    @property
    def table(self) -> pl.DataFrame:
        """Parameters and velocities over time, one row per sample."""
        import polars as pl

        t = self.track
        if t is None:
            return pl.DataFrame(schema=dict.fromkeys(TRACK_COLUMNS, pl.Float64))
        values, stds = t.parameters, np.hypot(t.alpha_std / t.alpha, self.model_std)
        stds = stds * values
        columns = (
            t.time, values[:, 0], stds[:, 0], values[:, 1], stds[:, 1], values[:, 2], stds[:, 2],
            *t.velocity.T, *(t.innovation**2 / t.innovation_var).T,
        )  # fmt: skip
        return pl.DataFrame(dict(zip(TRACK_COLUMNS, columns, strict=True)), nan_to_null=True)

    def write_track(self, path: str | Path) -> None:
        """Write `table` as CSV or Parquet, by the suffix of ``path``.

        Raises
        ------
        ConfigError
            The suffix is neither.
        """
        write_track(self.table, path)
