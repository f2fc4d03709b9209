"""All figures of a fleet at once: as frames, as JSON and as a page."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from weighbridge.errors import ConfigError
from weighbridge.fleet import figures, protocol
from weighbridge.fleet.learnt import read_learnt, with_factors
from weighbridge.fleet.legs import Limits, legs, load_changes, read_couplings, unjudged
from weighbridge.fleet.reading import collected, read_drives, read_segments
from weighbridge.fleet.tickets import read_tickets
from weighbridge.visible import visible_json
from weighbridge.whole import write_whole


def track(legs: pl.DataFrame, limits: Limits | None = None) -> pl.DataFrame:
    """Return the spans with one load: legs of a vehicle between which no change of load was found.

    The masses of a span are pooled. Their own errors average out, by their squares; the error of
    the vehicle file is common to all and stays.

    Parameters
    ----------
    legs : as of `weighbridge.fleet.legs.legs`; those without a mass or a date are left out
    limits : by which a trailer and an empty vehicle are found

    Returns
    -------
    polars.DataFrame
        ``vehicle_id``, ``start``, ``end`` [UTC], ``legs``, ``distance_km``, ``mass_kg``,
        ``std_kg``, ``payload_kg``, ``state`` (empty, loaded, trailer; null where the vehicle's
        masses are not known), in order of vehicle and time.
    """
    limits = limits or Limits()
    known = legs.filter(pl.col("mass_kg").is_not_null() & pl.col("start").is_not_null())
    begun = load_changes(legs).select("vehicle_id", pl.col("time").alias("start"), changed=True)
    known = known.join(begun, on=["vehicle_id", "start"], how="left", nulls_equal=True)
    shared = pl.col("shared_kg").fill_null(0.0)
    # Less than a kilogram of its own error would make one leg all that counts.
    own = (pl.col("std_kg").pow(2) - shared.pow(2)).clip(lower_bound=1.0)
    # A trailer that is known to come or go begins a span, too.
    before = pl.col("coupled").shift(1).over("vehicle_id")
    hitched = (pl.col("coupled") != before).fill_null(value=False)
    spans = (
        known.sort("vehicle_id", "start")
        .with_columns(
            weight=own.pow(-1),
            scale=shared / pl.col("mass_kg"),
            span=(pl.col("changed").fill_null(value=False) | hitched).cum_sum().over("vehicle_id"),
        )
        .group_by("vehicle_id", "span", maintain_order=True)
        .agg(
            pl.col("start").first(),
            pl.col("end").last(),
            pl.len().cast(pl.Int64).alias("legs"),
            pl.col("distance_km").sum(),
            mass_kg=(pl.col("weight") * pl.col("mass_kg")).sum() / pl.col("weight").sum(),
            own=pl.col("weight").sum().pow(-1),
            scale=(pl.col("weight") * pl.col("scale")).sum() / pl.col("weight").sum(),
            tare=pl.col("tare_kg").drop_nulls().last(),
            gross=pl.col("gross_kg").drop_nulls().last(),
            towed=pl.col("trailer").any(),
        )
    )
    payload = pl.col("mass_kg") - pl.col("tare")
    state = (
        pl.when(pl.col("towed"))
        .then(pl.lit("trailer"))
        .when(payload < limits.empty * (pl.col("gross") - pl.col("tare")))
        .then(pl.lit("empty"))
        .when(payload.is_not_null() & pl.col("gross").is_not_null())
        .then(pl.lit("loaded"))
    )
    return spans.select(
        "vehicle_id",
        "start",
        "end",
        "legs",
        "distance_km",
        "mass_kg",
        std_kg=(pl.col("own") + (pl.col("scale") * pl.col("mass_kg")).pow(2)).sqrt(),
        payload_kg=payload,
        state=state,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetReport:
    """What fleets ask.

    Attributes
    ----------
    limits : of overload, trailer and empty
    tolerance : of the verdicts [-]
    legs : one row per leg, see `weighbridge.fleet.legs.legs`
    changes : of the load, see `weighbridge.fleet.legs.load_changes`
    track : spans with one load, see `weighbridge.fleet.reporting.track`
    vehicles : one row each, see `weighbridge.fleet.figures.per_vehicle`
    totals : sums, see `weighbridge.fleet.figures.totals`
    unjudged : why legs were not judged, see `weighbridge.fleet.legs.unjudged`
    quality : what is wrong with the data, see `weighbridge.fleet.figures.quality`
    speed_mass : distance by speed and mass, see `weighbridge.fleet.figures.speed_mass`
    outside : known masses outside their intervals, see `weighbridge.fleet.protocol.outside`
    verdicts : of the protocol, see `weighbridge.fleet.protocol.verdicts`
    rfms : last masses, see `weighbridge.fleet.figures.rfms`
    learnt : from fleet and tickets, see `weighbridge.fleet.learnt.read_learnt`
    """

    limits: Limits
    tolerance: float
    legs: pl.DataFrame
    changes: pl.DataFrame
    track: pl.DataFrame
    vehicles: pl.DataFrame
    totals: dict[str, Any]
    unjudged: pl.DataFrame
    quality: pl.DataFrame
    speed_mass: pl.DataFrame
    outside: pl.DataFrame
    verdicts: pl.DataFrame
    rfms: pl.DataFrame
    learnt: pl.DataFrame

    @property
    def without_file(self) -> list[str | None]:
        """Vehicles without a file: their masses are those of a data sheet."""
        return self.vehicles.filter(~pl.col("has_file"))["vehicle_id"].sort().to_list()

    @property
    def overloads(self) -> pl.DataFrame:
        """Overloaded legs, the surest first."""
        reported = self.legs.filter(pl.col("level").is_in(["warn", "alarm"]))
        return reported.sort("overload", "mass_kg", descending=True, nulls_last=True)

    def to_dict(self) -> dict[str, Any]:
        """Return all but the legs, which `write_legs` writes, as plain values."""
        return {
            "limits": {**self.limits._asdict(), "tolerance": self.tolerance},
            "totals": self.totals,
            "vehicles_without_file": self.without_file,
            "vehicles": _rows(self.vehicles),
            "overloads": _rows(self.overloads),
            "load_changes": _rows(self.changes),
            "track": _rows(self.track),
            "unjudged": _rows(self.unjudged),
            "quality": _rows(self.quality),
            "speed_mass": _rows(self.speed_mass),
            "outside": _rows(self.outside),
            "verdicts": _rows(self.verdicts),
            "rfms": _rows(self.rfms),
            "learnt": _rows(self.learnt),
        }

    def to_json(self, path: str | Path) -> None:
        """Write `to_dict` as JSON.

        Raises
        ------
        ConfigError
            The file cannot be written.
        """
        text = json.dumps(self.to_dict(), ensure_ascii=False, indent=1)
        write_whole(path, visible_json(text) + "\n")

    def write_legs(self, path: str | Path) -> None:
        """Write the legs, one row each, as CSV or Parquet, by the suffix of ``path``.

        Instants of a CSV are ISO 8601 in UTC.

        Raises
        ------
        ConfigError
            The suffix is neither, or the file cannot be written.
        """
        from weighbridge.io.write import write_frame

        as_text = Path(path).suffix.lower() == ".csv"
        write_frame(_texts(self.legs) if as_text else self.legs, path, ConfigError)


def report(
    results: str | Path,
    *,
    limits: Limits | None = None,
    tickets: str | Path | None = None,
    couplings: str | Path | None = None,
    tolerance: float = protocol.TOLERANCE,
) -> FleetReport:
    """Work out the figures of a fleet.

    Parameters
    ----------
    results : folder that ``weighbridge fleet`` wrote
    limits : of overload, trailer and empty
    tickets : table of known masses, see `weighbridge.fleet.tickets.read_tickets`
    couplings : table of trailers, see `weighbridge.fleet.legs.read_couplings`
    tolerance : largest error that passes the protocol [-]

    Raises
    ------
    ConfigError
        The folder holds no results, a limit cannot be, or a table cannot be read or is damaged.
    """
    limits = limits or Limits()
    reported = [] if tickets is None else read_tickets(Path(tickets))
    drives, segments = (collected(read(results), results) for read in (read_drives, read_segments))
    coupled = [] if couplings is None else read_couplings(Path(couplings))
    learnt = read_learnt(results)
    rows = legs(drives, segments, limits, coupled, learnt)
    changes = load_changes(rows)
    vehicles = figures.per_vehicle(rows, changes)
    # Tickets may have made the factors: they are compared with what was weighed.
    known = protocol.known_masses(legs(drives, segments, limits, coupled), drives, reported)
    out = protocol.outside(known)
    return FleetReport(
        limits=limits,
        tolerance=tolerance,
        legs=rows,
        changes=changes,
        track=track(rows, limits),
        vehicles=vehicles,
        totals={
            **figures.totals(vehicles),
            "known_legs": int(out["known"].sum()),
            "outside": int(out["outside"].sum()),
        },
        unjudged=unjudged(rows),
        quality=figures.quality(drives),
        speed_mass=figures.speed_mass(*with_factors(drives, segments, learnt)),
        outside=out,
        verdicts=protocol.verdicts(known, tolerance),
        rfms=figures.rfms(rows),
        learnt=learnt,
    )


def _rows(frame: pl.DataFrame) -> list[dict[str, Any]]:
    return _texts(frame).to_dicts()


def _texts(frame: pl.DataFrame) -> pl.DataFrame:
    """Instants as ISO 8601, and null for what is no number."""
    instants = pl.selectors.datetime().dt.strftime("%Y-%m-%dT%H:%M:%SZ")
    return frame.with_columns(instants, pl.selectors.float().fill_nan(None))
