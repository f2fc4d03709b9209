"""The tables of a fleet's results: every column, its type and what it is. The only place that
lists them.

A row of `DRIVES` is one drive, a row of `SEGMENTS` one segment of it, a row of `LEGS` one load.
They belong together by ``key`` and ``part``. Numbers are null where there is none.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import polars as pl

FORMAT_VERSION: Final = 7
"""Version of the tables; part of every key, so that another one weighs anew."""

READABLE: Final = (2, 3, 4, 5, 6, FORMAT_VERSION)
"""Versions that can be read. Before 7, rows lack what the vehicle reports of its load. Before 6,
they lack drag area and wheel slip. Before 5, they lack the digest of the vehicle file. Before 4, a
recording was known by its content alone and ``start`` was a text; tables of 2 lack ids of messages.
"""

DAY: Final = "day"
"""Name of the partitions: no column of the tables has it, so that no reader finds two types."""

UNKNOWN_DATE: Final = "unknown"
"""Partition of drives without a date. Hive's own name for null makes pandas fail."""


PERIOD: Final = 300.0
"""Length of the periods of a segment whose distances are kept [s]."""

CHECKS: Final = (900.0, 600.0)
"""The running mass is kept this long after the vehicle first moves, and again every so long [s]
(Regulation (EU) 2019/1213, Annex I, point 4.1)."""


class Column(NamedTuple):
    """One column: its type and what it is."""

    type: pl.DataType
    about: str


_TEXT: Final = pl.String()
_NUMBER: Final = pl.Float64()
_NUMBERS: Final = pl.List(pl.Float64())
_COUNT: Final = pl.Int32()
_TIME: Final = pl.Datetime("us", "UTC")

DRIVES: Final[dict[str, Column]] = {
    "key": Column(_TEXT, "digest of the recording's content, vehicle, method and version"),
    "content": Column(_TEXT, "digest of the content, and of a begin that a table gives"),
    "part": Column(_COUNT, "which drive of its recording, from 0"),
    "parts": Column(_COUNT, "drives that its recording holds"),
    "date": Column(pl.Date(), "day of the start in UTC; the partition ``day`` has it, too"),
    "source": Column(_TEXT, "path or URL of the recording, as it was found"),
    "copies": Column(pl.List(pl.String()), "other places of the vehicle with the same recording"),
    "also_vehicles": Column(
        pl.List(pl.String()), "other vehicles with the same recording: it counts for each"
    ),
    "outcome": Column(_TEXT, "weighed, unread (bad data) or failed (three tries; tried again)"),
    "vehicle_id": Column(_TEXT, "id by which its vehicle file was found"),
    "vehicle_file": Column(_TEXT, "name of that file; null where the class's data sheet was used"),
    "vehicle_digest": Column(_TEXT, "digest of that file and its mapping"),
    "vehicle_class": Column(_TEXT, "car, van, bus, truck, motorcycle …"),
    "tare_kg": Column(_NUMBER, "mass of the empty vehicle, of its file"),
    "gross_kg": Column(_NUMBER, "permitted mass, of its file"),
    "drive": Column(_TEXT, "name; from here to warnings as `weighbridge weigh` has it"),
    "vehicle": Column(_TEXT, "name in the vehicle file"),
    "start": Column(_TIME, "begin, in UTC"),
    "method": Column(_TEXT, "estimator"),
    "status": Column(_TEXT, "converged, not_excited, inconsistent or missing_signals"),
    "reason": Column(_TEXT, "why there is no mass; empty where there is"),
    "reason_id": Column(_TEXT, "id of that message; null where there is a mass"),
    "mass_kg": Column(_NUMBER, "mass"),
    "std_kg": Column(_NUMBER, "its standard deviation"),
    "low95_kg": Column(_NUMBER, "lower end of the 95 % interval"),
    "high95_kg": Column(_NUMBER, "upper end of it"),
    "payload_kg": Column(_NUMBER, "mass minus tare"),
    "duration_s": Column(_NUMBER, "first to last stamp"),
    "used_s": Column(_NUMBER, "time of the rows that the mass is made of"),
    "converged_at_s": Column(_NUMBER, "from the start until the mass stays at the result"),
    "bound_std_kg": Column(_NUMBER, "Cramér-Rao bound of the drive"),
    "maker_mass_kg": Column(_NUMBER, "mass that the vehicle itself reports; not used"),
    "trailer_connected": Column(
        pl.Boolean(), "the vehicle reports a trailer; null if it does not say"
    ),
    "warnings": Column(
        pl.List(pl.String()), "what was corrected or is uncertain, one sentence each"
    ),
    "problem_ids": Column(pl.List(pl.String()), "ids of these messages, in their order"),
    "load_changed": Column(pl.Boolean(), "the load changed between segments"),
    "unweighed_s": Column(_NUMBER, "time of its segments without a usable force"),
    "freedom": Column(_NUMBER, "degrees of freedom of the mass (Student's t); infinite is normal"),
    "distance_km": Column(_NUMBER, "driven, from the speed"),
    "moving_s": Column(_NUMBER, "time in which the vehicle moved"),
    "systematic_std_kg": Column(_NUMBER, "part of std_kg that all drives of the vehicle share"),
    "drag_area_m2": Column(_NUMBER, "C_d A above the vehicle file's, as this drive alone shows it"),
    "drag_area_std_m2": Column(_NUMBER, "its standard deviation"),
    "slip": Column(_NUMBER, "slip of the driven wheels per traction over the weight"),
    "slip_std": Column(_NUMBER, "its standard deviation"),
    "late_s": Column(_NUMBER, "how much later the GNSS speed is than that of the engine"),
    "late_std_s": Column(_NUMBER, "its standard deviation"),
    "slip_late": Column(_NUMBER, "correlation of the errors of slip and late_s"),
    "first_mass_s": Column(_NUMBER, "from the first motion to a running mass within 10 %, 1 std"),
    "checked_kg": Column(_NUMBERS, "running mass 15 min after the first motion, then every 10 min"),
    "checked_std_kg": Column(_NUMBERS, "its standard deviations; null where there was none yet"),
    "known_mass_kg": Column(_NUMBER, "mass that the drive itself states (drive.toml)"),
    "start_latitude_deg": Column(_NUMBER, "first position"),
    "start_longitude_deg": Column(_NUMBER, ""),
    "end_latitude_deg": Column(_NUMBER, "last position"),
    "end_longitude_deg": Column(_NUMBER, ""),
    "signals": Column(pl.List(pl.String()), "signals that the drive has"),
    "tries": Column(_COUNT, "how often it was tried"),
    "weighed_at": Column(_TIME, "when this row was made"),
    "version": Column(_TEXT, "of weighbridge"),
}
"""One row per drive."""

SEGMENTS: Final[dict[str, Column]] = {
    "key": Column(_TEXT, "as of the drive"),
    "part": Column(_COUNT, "as of the drive"),
    "segment": Column(_COUNT, "which segment, in order of time, from 0"),
    "date": Column(pl.Date(), "as of the drive"),
    "vehicle_id": Column(_TEXT, "as of the drive"),
    "start_s": Column(
        _NUMBER,
        "begin as in `weigh`, on the drive's clock; null where no force was usable from a "
        "stop on at which the load could change",
    ),
    "end_s": Column(_NUMBER, "end as in `weigh`"),
    "mass_kg": Column(_NUMBER, "mass; null where none was weighed"),
    "std_kg": Column(_NUMBER, "its standard deviation"),
    "from_s": Column(_NUMBER, "from here on the mass stands; all segments fill the drive"),
    "to_s": Column(_NUMBER, "until here it stands: the next segment, or the end of the drive"),
    "weighed_s": Column(_NUMBER, "time of the rows in it that the mass is made of"),
    "distance_km": Column(_NUMBER, "driven from from_s to to_s"),
    "moving_s": Column(_NUMBER, "time in which the vehicle moved"),
    "period_km": Column(_NUMBERS, "driven in each 5 min of it, the last one cut short"),
    "start_latitude_deg": Column(_NUMBER, "position at from_s, where the load was changed"),
    "start_longitude_deg": Column(_NUMBER, ""),
    "end_latitude_deg": Column(_NUMBER, "position at to_s"),
    "end_longitude_deg": Column(_NUMBER, ""),
}
"""One row per segment: the mass between stops at which load can change."""

LEGS: Final[dict[str, Column]] = {
    **{name: Column(DRIVES[name].type, "as of the drive") for name in ("key", "part")},
    "leg": Column(_COUNT, "which leg, in order of time, from 0; a number may be left out"),
    **{
        name: Column(DRIVES[name].type, "as of the drive")
        for name in ("date", "vehicle_id", "vehicle_file", "vehicle_class", "source", "drive",
                     "outcome", "status")
    },
    "start": Column(_TIME, "begin of the leg, in UTC"),
    "end": Column(_TIME, "its end, in UTC"),
    "duration_s": Column(_NUMBER, "from begin to end"),
    "distance_km": Column(_NUMBER, "driven, from the speed"),
    "moving_s": Column(_NUMBER, "time in which the vehicle moved"),
    "mass_kg": Column(_NUMBER, "mass; null where none is known"),
    "std_kg": Column(_NUMBER, "its standard deviation"),
    "shared_kg": Column(_NUMBER, "part of std_kg that all legs of the vehicle share"),
    "common_kg": Column(_NUMBER, "part of shared_kg that vehicles of its type or class share"),
    "weighed_kg": Column(_NUMBER, "mass as of the drive, before the factor"),
    "weighed_std_kg": Column(_NUMBER, "its standard deviation"),
    "maker_mass_kg": Column(_NUMBER, "mass that the vehicle itself reports, as of the drive"),
    "type": Column(_TEXT, "vehicles of it share common_kg; null if no factor is learnt"),
    "factor": Column(_NUMBER, "mass_kg over weighed_kg, learnt from the fleet; null if none is"),
    "freedom": DRIVES["freedom"],
    "low95_kg": Column(_NUMBER, "lower end of the 95 % interval"),
    "high95_kg": Column(_NUMBER, "upper end of it"),
    "tare_kg": DRIVES["tare_kg"],
    "payload_kg": Column(_NUMBER, "mass minus tare"),
    "payload_low95_kg": Column(_NUMBER, "lower end of its 95 % interval; the tare is exact"),
    "payload_high95_kg": Column(_NUMBER, "upper end of it"),
    "gross_kg": DRIVES["gross_kg"],
    "permitted_kg": Column(_NUMBER, "permitted mass, of both where a table names a trailer"),
    "coupled": Column(pl.Boolean(), "a table of couplings or the vehicle itself names a trailer"),
    "trailer_probability": Column(_NUMBER, "of a trailer; 1 if coupled, null if not known"),
    "trailer": Column(pl.Boolean(), "coupled, or the probability of a trailer is high"),
    "overload": Column(_NUMBER, "probability that the mass is above the permitted one"),
    "level": Column(_TEXT, "ok, warn (likely) or alarm (sure); null where overload is"),
    "empty": Column(pl.Boolean(), "payload below a tenth of the permitted one"),
    "tkm": Column(_NUMBER, "payload times distance; a payload below zero counts as zero"),
    "prevents": Column(_TEXT, "what is not known: mass, overload or payload; null where all is"),
    "reason_id": Column(_TEXT, "id of the message that says why"),
    "reason": Column(_TEXT, "that message"),
    **{name: Column(_NUMBER, "position") for name in (
        "start_latitude_deg", "start_longitude_deg", "end_latitude_deg", "end_longitude_deg")},
}  # fmt: skip
"""One row per leg: a span with one load, its payload and its overload."""

WEIGHED: Final = "weighed"
UNREAD: Final = "unread"
FAILED: Final = "failed"
"""Outcomes: of a drive that `weigh` answers, of one that it refuses, of one tried in vain."""

_OF_DRIVE: Final = ("key", "part", "date", "vehicle_id")
_INNER: Final = tuple(name for name in SEGMENTS if name not in _OF_DRIVE)

SEEN: Final[dict[str, pl.DataType]] = {"held": pl.String(), "seen": pl.Int64()}
"""Columns of what a run need not read again: the key of a result with a digest of its place, and a
digest of its files as a run saw them and of how they were weighed."""

PART: Final[dict[str, pl.DataType]] = {
    **{name: column.type for name, column in DRIVES.items()},
    "seen": SEEN["seen"],
    "segments": pl.List(pl.Struct({name: SEGMENTS[name].type for name in _INNER})),
}
"""Columns of a part file, as workers write it: the drives of one recording, segments within."""


def drives_of(parts: pl.DataFrame) -> pl.DataFrame:
    """Return the rows of `DRIVES` that part files hold."""
    return parts.select(list(DRIVES))


def segments_of(parts: pl.DataFrame) -> pl.DataFrame:
    """Return the rows of `SEGMENTS` that part files hold."""
    rows = parts.select(*_OF_DRIVE, "segments").explode("segments")
    return rows.filter(pl.col("segments").is_not_null()).unnest("segments").select(list(SEGMENTS))
