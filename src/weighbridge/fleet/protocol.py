"""Verdicts on vehicles by the protocol for on-board weighing, from drives of known mass.

Regulation (EU) 2019/1213: a dynamic system has a first weight at the latest 15 minutes after the
vehicle starts to move and a new one every 10 minutes (Annex I, point 4.1); it is tried with loads
of 45 to 55, 65 to 75 and 90 to 100 % of the technically permissible mass (Annex IV, point 5).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import polars as pl

from weighbridge.errors import ConfigError
from weighbridge.fleet.schema import CHECKS
from weighbridge.fleet.tickets import Ticket, with_tickets

BANDS: Final = ((0.45, 0.55), (0.65, 0.75), (0.90, 1.00))
"""Loads of the test, over the permissible mass [-]."""

TOLERANCE: Final = 0.05
"""Largest error of a weight that passes, unless another is asked for [-]."""


def known_masses(
    legs: pl.DataFrame, drives: pl.DataFrame, tickets: Sequence[Ticket] = ()
) -> pl.DataFrame:
    """Return the legs whose mass is known: by a ticket, else by the drive itself at its begin.

    Which leg a ticket is of: `weighbridge.fleet.tickets.with_tickets`.

    Parameters
    ----------
    legs : as of `weighbridge.fleet.legs.legs`
    drives : as of `read_drives`, collected
    tickets : as of `weighbridge.fleet.tickets.read_tickets`

    Returns
    -------
    polars.DataFrame
        The legs with ``known_kg``, ``error`` (of the mass, relative; null without a mass), and
        the running masses of the drive where its load did not change.
    """
    kept = drives.select(
        "key", "part", "known_mass_kg", "load_changed", "first_mass_s", "checked_kg", "duration_s"
    ).rename({"duration_s": "drive_s"})
    rows = legs.join(kept, on=["key", "part"], how="left")
    known: pl.Expr = pl.when(pl.col("leg") == 0).then("known_mass_kg")
    if tickets:
        place = ["key", "part", "leg"]
        found = with_tickets(legs, tickets).select(*place, "ticket_kg")
        rows = rows.join(found, on=place, how="left")
        known = pl.coalesce("ticket_kg", known)
    return (
        rows.with_columns(known_kg=known)
        .filter(pl.col("known_kg").is_not_null())
        .with_columns(error=pl.col("mass_kg") / pl.col("known_kg") - 1.0)
    )


def outside(known: pl.DataFrame) -> pl.DataFrame:
    """Compare known masses with the intervals that were shown.

    Of intervals of 95 % one known mass in twenty lies outside by chance.

    Parameters
    ----------
    known : as of `known_masses`

    Returns
    -------
    polars.DataFrame
        One row per vehicle with a leg of known mass and an interval, most outside first:
        ``vehicle_id``, ``known`` (such legs), ``outside`` (whose known mass is not in the
        interval), and of the one farthest from it, relative to the half interval: ``worst_start``,
        ``worst_known_kg``, ``worst_low95_kg``, ``worst_high95_kg``, ``worst_error`` (of the mass,
        relative); null where none is outside.
    """
    low, high, true = pl.col("low95_kg"), pl.col("high95_kg"), pl.col("known_kg")
    reported = known.filter(low.is_not_null() & high.is_not_null()).with_columns(
        out=(true < low) | (true > high),
        far=((true - pl.col("mass_kg")) / (0.5 * (high - low))).abs(),
    )
    worst = pl.col("start", "known_kg", "low95_kg", "high95_kg", "error")
    return (
        reported.group_by("vehicle_id", maintain_order=True)
        .agg(
            pl.len().cast(pl.Int64).alias("known"),
            pl.col("out").sum().cast(pl.Int64).alias("outside"),
            worst.filter("out")
            .sort_by(pl.col("far").filter("out"), descending=True)
            .first()
            .name.prefix("worst_"),
            pl.col("far").max(),
        )
        .sort("outside", "far", "vehicle_id", descending=[True, True, False])
        .drop("far")
    )


def verdicts(known: pl.DataFrame, tolerance: float = TOLERANCE) -> pl.DataFrame:
    """Judge each vehicle that has drives of known mass.

    Parameters
    ----------
    known : as of `known_masses`
    tolerance : largest error that passes [-]

    Returns
    -------
    polars.DataFrame
        ``vehicle_id``, ``verdict`` (passed, failed, incomplete), ``why``, ``legs`` (of known
        mass), and for each load ``legs_50``, ``worst_50`` (largest error, with its sign), and so
        on for 70 and 95; ``late`` (drives without a value after 15 min, or without a new one).

    Raises
    ------
    ConfigError
        The tolerance is not in (0, 1).
    """
    if not 0.0 < tolerance < 1.0:
        raise ConfigError(f"tolerance must be in (0, 1), got {tolerance:g}")
    names = [f"{100.0 * (low + high) / 2.0:.0f}" for low, high in BANDS]
    rows = []
    judged = known.filter(pl.col("gross_kg").is_not_null())
    for (vehicle,), own in judged.group_by("vehicle_id", maintain_order=True):
        row: dict[str, Any] = {"vehicle_id": vehicle, "legs": own.height, "late": 0}
        share = own["known_kg"] / own["gross_kg"]
        wrong, missing = [], []
        for name, (low, high) in zip(names, BANDS, strict=True):
            within = own.filter((share >= low) & (share <= high))
            worst, late = _band(within)
            row |= {f"legs_{name}": within.height, f"worst_{name}": worst}
            row["late"] += late
            if not within.height:
                missing.append(f"{100 * low:.0f} to {100 * high:.0f} %")
            elif late or worst is None or abs(worst) > tolerance:
                wrong.append(f"{100 * low:.0f} to {100 * high:.0f} %")
        row["verdict"] = "failed" if wrong else "incomplete" if missing else "passed"
        row["why"] = "; ".join(
            [f"outside ± {100 * tolerance:g} % or late at loads of {', '.join(wrong)}"]
            * bool(wrong)
            + [f"no known mass at loads of {', '.join(missing)}"] * bool(missing)
        )
        rows.append(row)
    schema: dict[str, Any] = {
        "vehicle_id": pl.String,
        "verdict": pl.String,
        "why": pl.String,
        "legs": pl.Int64,
        **{
            f"{kind}_{n}": t
            for n in names
            for kind, t in (("legs", pl.Int64), ("worst", pl.Float64))
        },
        "late": pl.Int64,
    }
    return pl.DataFrame(rows, schema=schema, orient="row").sort("vehicle_id")


def _band(rows: pl.DataFrame) -> tuple[float | None, int]:
    """Largest error of all values of the legs of one load, and how many drives were late."""
    errors: list[float] = []
    late = 0
    for row in rows.iter_rows(named=True):
        first = row["first_mass_s"]
        values = [] if row["load_changed"] else list(row["checked_kg"] or [])
        if row["error"] is None or first is None or first > CHECKS[0] or None in values:
            late += 1
        if row["error"] is not None:
            errors.append(row["error"])
        errors += [value / row["known_kg"] - 1.0 for value in values if value is not None]
    return (max(errors, key=abs) if errors else None), late
