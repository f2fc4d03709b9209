"""Rows of results as the engine writes them, with the values that a test is about."""

import tempfile
from datetime import UTC, datetime
from pathlib import Path

import polars as pl

from weighbridge.fleet import FleetReport, report
from weighbridge.fleet.schema import DRIVES, PART, SEGMENTS
from weighbridge.fleet.store import Results, write_part


def drive(key, vehicle="truck1", *, start="2026-05-04T06:00:00+00:00", mass=None, std=None, **more):
    row = dict.fromkeys(DRIVES) | {
        "key": key,
        "part": 0,
        "source": f"drives/{key}",
        "drive": key,
        "outcome": "weighed",
        "status": "converged" if mass is not None else "not_excited",
        "reason": "" if mass is not None else "only 12 s could be used",
        "vehicle_id": vehicle,
        "vehicle_file": f"{vehicle}.toml",
        "vehicle_class": "truck",
        "tare_kg": 8000.0,
        "gross_kg": 18000.0,
        "start": None if start is None else datetime.fromisoformat(start),
        "mass_kg": mass,
        "std_kg": std,
        "systematic_std_kg": None if std is None else 0.8 * std,
        "freedom": float("inf"),
        "duration_s": 1200.0,
        "distance_km": 20.0,
        "moving_s": 1100.0,
        "warnings": [],
        "load_changed": False,
        "unweighed_s": 0.0,
        "first_mass_s": 60.0,
        "checked_kg": [],
        "checked_std_kg": [],
        "weighed_at": datetime(2026, 5, 6, tzinfo=UTC),
    }
    return row | more


def segment(key, number, start, end, mass, std, *, km=10.0, weighed=True, **more):
    row = dict.fromkeys(SEGMENTS) | {
        "key": key,
        "part": 0,
        "segment": number,
        "start_s": start if weighed else None,
        "end_s": end if weighed else None,
        "from_s": start,
        "to_s": end,
        "weighed_s": end - start if weighed else 0.0,
        "mass_kg": mass,
        "std_kg": std,
        "distance_km": km,
    }
    return row | more


def frames(drives, segments=()):
    return (
        pl.DataFrame(list(drives), schema={n: c.type for n, c in DRIVES.items()}, orient="row"),
        pl.DataFrame(list(segments), schema={n: c.type for n, c in SEGMENTS.items()}, orient="row"),
    )


def reported(drives, segments=(), **how) -> FleetReport:
    """Return the report on a folder of results with these rows."""
    inner = [f.name for f in PART["segments"].inner.fields]
    with tempfile.TemporaryDirectory() as home:
        folder = Results.begun(Path(home) / "results").folder
        for row in drives:
            own = [{n: s[n] for n in inner} for s in segments if s["key"] == row["key"]]
            write_part(folder, row["key"], [row | {"segments": own}])
        return report(folder, **how)


def write_learnt(folder, rows):
    """Write what a run learnt of vehicles into its results."""
    columns = report(folder).learnt.drop("drifts", "verdict").schema
    frame = pl.DataFrame(list(rows), schema=columns, orient="row")
    frame.write_parquet(Path(folder) / "learnt.parquet")
