"""What the drives of known mass taught of each vehicle: a table of the results."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import polars as pl

from weighbridge.errors import ConfigError
from weighbridge.fleet.schema import TAUGHT
from weighbridge.io import PARSE_ERRORS, first_line, quietly

LEARNT: Final = "learnt.parquet"
"""Its file, in the folder of the results."""

SURE: Final = 3.0
"""A drift is reported where it is so many standard deviations [-]."""

COLUMNS: Final[dict[str, Any]] = {name: column.type for name, column in TAUGHT.items()}
"""Columns of the table."""

EARLIER: Final = "told"
"""Name of the findings in a table of earlier versions."""

_DRIFTS: Final = (
    ("torque_drift_pct", "torque_drift_std_pct"),
    ("rolling_drift", "rolling_drift_std"),
    ("pitch_drift_deg", "pitch_drift_std_deg"),
)


def read_learnt(results: str | Path) -> pl.DataFrame:
    """Return what the last run with tickets learnt: one row per vehicle, those to look at first.

    Parameters
    ----------
    results : folder that ``weighbridge fleet`` wrote

    Returns
    -------
    polars.DataFrame
        `COLUMNS`, ``drifts`` (whether a drift is sure) and ``verdict`` (contradicted, drifts, never
        empty, not refined, refined, scaled: the first that is so); no row where nothing was learnt.

    Raises
    ------
    ConfigError
        The file is damaged.
    """
    path = Path(results) / LEARNT
    try:
        with path.open("rb") as file, quietly():
            found = pl.read_parquet(file)
            if EARLIER in found.columns:
                found = found.rename({EARLIER: "findings"})
            # Tables of earlier versions lack columns.
            empty = pl.DataFrame(schema=COLUMNS)
            rows = pl.concat([empty, found], how="diagonal_relaxed").select(list(COLUMNS))
    except FileNotFoundError:
        rows = pl.DataFrame(schema=COLUMNS)
    except (*PARSE_ERRORS, OSError) as error:
        raise ConfigError(
            f"{path}: is damaged ({first_line(error)}); remove it, and give the command with "
            "--learn again"
        ) from None
    drifts = pl.any_horizontal(
        (pl.col(value).abs() > SURE * pl.col(std)) & pl.col(value).is_not_nan()
        for value, std in _DRIFTS
    )
    contradicted = pl.col("contradicted").fill_null(value=False)
    verdict = (
        pl.when(contradicted).then(pl.lit("contradicted"))
        .when("drifts").then(pl.lit("drifts"))
        .when(pl.col("factor_reason_id").is_in(["fleet.scale_wrong", "fleet.scale_never"]))
        .then(pl.lit("never empty"))
        .when(pl.col("refined").is_not_null()).then(pl.lit("refined"))
        .when(pl.col("drives") > 0).then(pl.lit("not refined"))
        .otherwise(pl.lit("scaled"))
    )  # fmt: skip
    order = ("contradicted", "drifts", "never empty", "not refined", "refined", "scaled")
    rank = {name: number for number, name in enumerate(order)}
    return (
        rows.with_columns(contradicted, drifts=drifts.fill_null(value=False))
        .with_columns(verdict=verdict)
        .sort(pl.col("verdict").replace_strict(rank, return_dtype=pl.Int8), "vehicle_id")
    )


def with_factors(
    drives: pl.DataFrame, segments: pl.DataFrame, learnt: pl.DataFrame | None = None
) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Multiply masses by the factors of their vehicles.

    A factor holds for drives that were weighed with the vehicle file that it was learnt of.

    Parameters
    ----------
    drives, segments : as of `weighbridge.fleet.read_drives` and `read_segments`, collected
    learnt : as of `read_learnt`

    Returns
    -------
    drives, segments
        Their ``mass_kg``, ``std_kg`` and ``systematic_std_kg`` are corrected, ``weighed_kg`` and
        ``weighed_std_kg`` are as they were. ``factor`` is null where none was learnt, and
        ``common_kg`` is the part of ``systematic_std_kg`` that vehicles share.
    """
    names = ["vehicle_id", "vehicle_digest", "factor", "type", "factor_std", "factor_common_std"]
    found = pl.DataFrame(schema={name: COLUMNS[name] for name in names})
    if learnt is not None:
        found = learnt.select(names).drop_nulls(names[:3])
    none, std = pl.col("factor").is_null(), pl.col("std_kg")
    mass = pl.col("mass_kg").fill_nan(None)
    own = (std.pow(2) - (pl.col("share") * mass).pow(2)).clip(0.0)
    total = pl.col("factor") * (own + (pl.col("factor_std") * mass).pow(2)).sqrt()
    both = {
        "weighed_kg": mass,
        "weighed_std_kg": std,
        "mass_kg": pl.when(none).then(mass).otherwise(pl.col("factor") * mass),
        "std_kg": pl.when(none).then(std).otherwise(total),
    }
    shared = pl.col("systematic_std_kg")
    drives = drives.with_columns(share=shared / mass)
    drives = drives.join(found, on=names[:2], how="left", maintain_order="left")
    of = drives.select("key", "part", "share", *names[2:])
    segments = segments.join(of, on=["key", "part"], how="left", maintain_order="left")
    drives = drives.with_columns(**both).with_columns(
        systematic_std_kg=pl.when(none).then(shared).otherwise(pl.col("factor_std") * mass),
        common_kg=pl.when(none).then(shared).otherwise(pl.col("factor_common_std") * mass),
    )
    segments = segments.with_columns(**both)
    return drives.drop("share", *names[4:]), segments.drop("share", *names[2:])
