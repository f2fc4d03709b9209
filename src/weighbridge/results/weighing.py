"""The mass of one drive, as data: what report, tables and commands read."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from weighbridge.balance import REASON_TEXT, Reason
from weighbridge.estimators import ESTIMATORS, Estimator, MassTrack, Segment, Status
from weighbridge.messages import Explained
from weighbridge.results.reported import maker_mass, trailer_connected
from weighbridge.results.row import WeighingRow
from weighbridge.results.writing import check_level, write_track
from weighbridge.signals import Drive, Problem
from weighbridge.signals.shown import in_html, in_lines, plural
from weighbridge.signals.student import student_quantile
from weighbridge.vehicle import Vehicle

if TYPE_CHECKING:
    import polars as pl

TRACK_COLUMNS: Final = (
    "time_s",
    "mass_kg",
    "std_kg",
    "used",
    "speed_mps",
    "accel_mps2",
    "specific_force_mps2",
    "grade_rad",
    "pitch_rad",
    "gear",
    "traction_force_n",
    "reason",
    "low95_kg",
    "high95_kg",
    "residual_n",
)
"""Columns of the track, as files carry them."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class MassResult(Explained):
    """The mass of one drive, how sure it is, and why.

    Attributes
    ----------
    drive, vehicle : what it was made from
    seen : the vehicle as the drive shows it, by which it was weighed
    method : name of the estimator
    status : `Status`
    refusal : why there is no mass; None where there is
    result : the estimator's track; None where nothing could be estimated
    problems : what was corrected or is uncertain
    settings : of the estimator; None for its defaults
    """

    drive: Drive
    vehicle: Vehicle
    seen: Vehicle
    method: str
    status: Status
    refusal: Problem | None
    result: MassTrack | None
    problems: tuple[Problem, ...] = ()
    settings: object | None = None

    def __repr__(self) -> str:
        return in_lines(self._summary())

    def _repr_html_(self) -> str:
        return in_html(self._summary())

    def _summary(self) -> tuple[str, str, str]:
        """What was weighed, the mass or why there is none, rows and warnings."""
        head = f"Weighing of {self.drive.name!r} by {self.method}, vehicle {self.vehicle.name!r}"
        low, high = self.interval()
        mass = f"{self.status}: {self.reason}"
        if math.isfinite(self.mass):
            payload = f", payload {self.payload:.0f} kg" if math.isfinite(self.payload) else ""
            mass = f"{self.mass:.0f} kg, {low:.0f} to {high:.0f} kg with 95 % probability{payload}"
        used = f"{self.used_time:.0f} of {self.drive.duration:.0f} s used"
        doubts = plural(len(self.warnings), "warning")
        return head, mass, f"{used}; {doubts}{': ' + self.warnings[0] if self.warnings else ''}"

    @property
    def estimator(self) -> Estimator:
        """What its method is."""
        return ESTIMATORS[self.method]

    @property
    def mass(self) -> float:
        """Mass [kg]; NaN where there is none."""
        return self.result.mass if self.result and self.status is Status.CONVERGED else math.nan

    @property
    def std(self) -> float:
        """Standard deviation of the mass [kg]; NaN where there is none."""
        return self.result.std if self.result and self.status is Status.CONVERGED else math.nan

    @property
    def payload(self) -> float:
        """Mass minus the vehicle's tare [kg]; NaN where either is unknown."""
        return self.mass - self.vehicle.tare if self.vehicle.tare is not None else math.nan

    @property
    def maker_mass(self) -> float:
        """Mass that the vehicle itself reports, median of the rows weighed [kg]; NaN without one.

        It is shown beside `mass`, which does not use it.
        """
        return maker_mass(self.drive, self.result)

    @property
    def trailer_connected(self) -> bool | None:
        """Whether the vehicle reports a trailer for most of the rows weighed; None if unknown."""
        return trailer_connected(self.drive, self.result)

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Interval that holds the mass with the probability ``level`` [kg].

        Raises
        ------
        ConfigError
            The level is not between 0 and 1.
        """
        check_level(level)
        if self.result is None or not math.isfinite(self.mass):
            return math.nan, math.nan
        reach = student_quantile(self.result.degrees_of_freedom, 0.5 + 0.5 * level) * self.std
        return self.mass - reach, self.mass + reach

    @property
    def used_time(self) -> float:
        """Time of the rows the mass was made from [s]."""
        if self.result is None or self.result.time.size < 2:
            return 0.0
        return float(np.count_nonzero(self.result.used) * np.median(np.diff(self.result.time)))

    @property
    def converged_at(self) -> float:
        """Time from the start until the running mass stays at the result [s]; NaN if never."""
        if self.result is None or self.status is not Status.CONVERGED:
            return math.nan
        return self.result.converged_at - self.drive.start

    @property
    def segments(self) -> tuple[Segment, ...]:
        """Mass between stops, where load can change; NaN where the drive carries no mass."""
        found = self.result.segments if self.result else ()
        if self.status is not Status.CONVERGED:
            return tuple(replace(s, mass=math.nan, std=math.nan) for s in found)
        return found

    @property
    def load_changed(self) -> bool:
        """Whether segments are loads separated, not just legs of a drive."""
        result = self.result
        return self.estimator.segments_are_loads and result is not None and len(result.segments) > 1

    @property
    def track(self) -> pl.DataFrame:
        """The mass over time with what it was made from, one row per force sample."""
        import polars as pl

        if self.result is None:
            return pl.DataFrame(schema=dict.fromkeys(TRACK_COLUMNS, pl.Float64))
        r, table = self.result, self.result.balance.table
        reach = student_quantile(r.degrees_of_freedom, 0.975) * r.running_std
        texts = np.array([REASON_TEXT[Reason(k)] for k in range(len(Reason))])
        columns = (
            r.time,
            r.running_mass,
            r.running_std,
            r.used,
            table.speed,
            table.accel,
            table.specific_force,
            table.grade,
            table.pitch,
            table.gear,
            table.traction_force,
            texts[r.row_reason],
            r.running_mass - reach,
            r.running_mass + reach,
            r.residual,
        )
        return pl.DataFrame(dict(zip(TRACK_COLUMNS, columns, strict=True)), nan_to_null=True)

    @property
    def row(self) -> WeighingRow:
        """The answer without arrays: to keep, to send, to collect by the thousand."""
        return WeighingRow(
            drive=self.drive.name,
            vehicle=self.vehicle.name,
            start=self.drive.began,
            method=self.method,
            status=self.status,
            refusal=self.refusal,
            mass=self.mass,
            std=self.std,
            interval=self.interval(0.95),
            payload=self.payload,
            duration=self.drive.duration,
            used_time=self.used_time,
            converged_at=self.converged_at,
            bound_std=self.result.bound_std if self.result else math.nan,
            maker_mass=self.maker_mass,
            trailer_connected=self.trailer_connected,
            segments=self.segments,
            problems=self.problems,
            load_changed=self.load_changed,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return what ``weigh --json`` prints: numbers, None where there is no mass."""
        return self.row.to_dict()

    def to_json(self) -> str:
        """Return `to_dict` as one line of JSON."""
        return self.row.to_json()

    def write_track(self, path: str | Path) -> None:
        """Write the track, by the suffix of ``path`` as CSV, Parquet, MCAP or MF4.

        MCAP and MF4 hold the signals of the drive too, as they were weighed, each on its own
        clock. Beside MCAP and Parquet a layout of PlotJuggler is written.

        Raises
        ------
        ConfigError
            The suffix is another one, or the file cannot be written.
        DriveError
            MCAP or MF4 cannot be written.
        MissingExtraError
            The package that writes MCAP or MF4 is not installed.
        """
        write_track(self.track, path, self.drive)
