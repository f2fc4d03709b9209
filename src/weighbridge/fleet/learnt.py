"""What the drives of known mass taught of each vehicle: a table of the results."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import polars as pl

from weighbridge.errors import ConfigError
from weighbridge.io.quiet import PARSE_ERRORS, first_line, quietly

LEARNT: Final = "learnt.parquet"
"""Its file, in the folder of the results."""

SURE: Final = 3.0
"""A drift is reported where it is so many standard deviations [-]."""

COLUMNS: Final[dict[str, Any]] = {
    "vehicle_id": pl.String,
    "drives": pl.Int32,
    "weighed": pl.Int32,
    "error_pct": pl.Float64,
    "error_std_pct": pl.Float64,
    "contradicted": pl.Boolean,
    "torque_drift_pct": pl.Float64,
    "torque_drift_std_pct": pl.Float64,
    "rolling_drift": pl.Float64,
    "rolling_drift_std": pl.Float64,
    "pitch_drift_deg": pl.Float64,
    "pitch_drift_std_deg": pl.Float64,
    "refined": pl.String,
    "findings": pl.String,
}
"""Columns of what was learnt of a vehicle: drives with a ticket, those with a mass, how far these
are from their tickets in the mean (positive: too heavy) and how far they may be; drifts per 30
days; name of the refined file, and sentences."""

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
        `COLUMNS`, ``drifts`` (whether a drift is sure) and ``verdict`` (contradicted, drifts, not
        refined, refined: the first that is so); no row where no run had tickets.

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
            rows = found.select(list(COLUMNS))
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
        .when(pl.col("refined").is_null()).then(pl.lit("not refined"))
        .otherwise(pl.lit("refined"))
    )  # fmt: skip
    rank = {"contradicted": 0, "drifts": 1, "not refined": 2, "refined": 3}
    return (
        rows.with_columns(contradicted, drifts=drifts.fill_null(value=False))
        .with_columns(verdict=verdict)
        .sort(pl.col("verdict").replace_strict(rank, return_dtype=pl.Int8), "vehicle_id")
    )
