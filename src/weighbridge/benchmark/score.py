"""Score the masses that any program gives to the drives of a benchmark."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import polars as pl

from weighbridge.benchmark.make import TRUTH_COLUMNS
from weighbridge.benchmark.plan import LABELS
from weighbridge.errors import ConfigError
from weighbridge.io import PARSE_ERRORS, first_line

NORMAL_95: Final = 1.96
"""Half of the interval of 95 % of a normal distribution, in standard deviations [-]."""

LEVEL: Final = 0.95

SURE_OFF: Final = 0.03
SURE_STD: Final = 3.0
"""A mass is falsely sure that is off by more than both, in parts of it and in its standard
deviations."""

_NUMBERS: Final = ("mass_kg", "std_kg", "low_kg", "high_kg")


def read_truth(path: Path) -> pl.DataFrame:
    """Read the true masses of a benchmark.

    Raises
    ------
    ConfigError
        There is no such file, or it is no truth of a benchmark.
    """
    found = _read(path)
    lacking = [name for name in ("drive", "mass_kg", *LABELS) if name not in found.columns]
    if lacking:
        raise ConfigError(f"{path}: is no truth of a benchmark, {lacking[0]} is missing")
    return found.cast({"mass_kg": TRUTH_COLUMNS["mass_kg"]})


def read_results(path: Path, truth: pl.DataFrame) -> pl.DataFrame:
    """Read masses, one row a drive of the truth.

    Parameters
    ----------
    path : CSV with ``drive``, ``mass_kg`` and, where known, ``std_kg``, ``low_kg`` and ``high_kg``;
        other columns are not read
    truth : as of `read_truth`

    Raises
    ------
    ConfigError
        A column or a drive is missing, a drive is unknown or stands twice, or a number cannot be.
    """
    found = _read(path)
    for name in ("drive", "mass_kg"):
        if name not in found.columns:
            raise ConfigError(f"{path}: has no column {name}; its first line must name it")
    for name in _NUMBERS:
        if name not in found.columns:
            found = found.with_columns(pl.lit(None, pl.Float64).alias(name))
        elif wrong := _no_numbers(found, name):
            raise ConfigError(f"{path}: {name} of {wrong[0]} is {wrong[1]!r}; write a number > 0")
    known, given = truth["drive"].to_list(), found["drive"].to_list()
    if twice := [one for one in dict.fromkeys(given) if given.count(one) > 1]:
        raise ConfigError(f"{path}: {twice[0]} has several rows; write one")
    if unknown := [one for one in given if one not in set(known)]:
        raise ConfigError(f"{path}: {unknown[0]} is no drive of the truth; write its name as there")
    if lacking := [one for one in known if one not in set(given)]:
        raise ConfigError(
            f"{path}: {lacking[0]} has no row ({len(lacking)} drives in all); write one, with an "
            "empty mass for a refusal"
        )
    found = found.select("drive", pl.col(_NUMBERS).cast(pl.Float64))
    low, mass, high = (pl.col(name) for name in ("low_kg", "mass_kg", "high_kg"))
    crossed = found.filter((low > mass) | (high < mass) | low.is_null().xor(high.is_null()))
    if crossed.height:
        raise ConfigError(
            f"{path}: the interval of {crossed['drive'][0]} does not hold its mass; give low_kg "
            "below and high_kg above it, or neither"
        )
    return found


def score_masses(results: pl.DataFrame, truth: pl.DataFrame) -> pl.DataFrame:
    """Return the score of all drives, and by each of `LABELS`.

    Parameters
    ----------
    results : as of `read_results`
    truth : as of `read_truth`

    Returns
    -------
    One row a slice, the first of all drives: ``by`` and ``slice``; ``drives``; ``refused_pct``;
    ``rms_pct`` and ``mean_pct``, errors over the true mass; ``held_pct``, intervals of 95 % that
    hold the true mass; ``interval_score_pct``, mean interval score over the true mass;
    ``squared_error_over_variance``; ``falsely_sure``, masses more than 3 % and three standard
    deviations off. Null where nothing was given that it could be made from.

    References
    ----------
    Interval score: Gneiting and Raftery, J. Am. Stat. Assoc. 102, 2007, eq. 43.
    """
    true, mass, std = pl.col("true_kg"), pl.col("mass_kg"), pl.col("std_kg")
    joined = (
        truth.select("drive", *LABELS, true_kg="mass_kg")
        .join(results, on="drive", how="left")
        .with_columns(
            std_kg=pl.coalesce(std, (pl.col("high_kg") - pl.col("low_kg")) / (2.0 * NORMAL_95)),
            low=pl.coalesce(pl.col("low_kg"), mass - NORMAL_95 * std),
            high=pl.coalesce(pl.col("high_kg"), mass + NORMAL_95 * std),
            error=mass / true - 1.0,
        )
        .with_columns(
            scaled=(mass - true) / std,
            outside=pl.max_horizontal(pl.col("low") - true, true - pl.col("high"), 0.0),
        )
        .with_columns(
            interval=(pl.col("high") - pl.col("low") + 2.0 / (1.0 - LEVEL) * pl.col("outside"))
            / true
        )
    )
    # An interval without a mass is none.
    joined = joined.with_columns(
        pl.when(mass.is_not_null()).then(pl.col("low", "high", "interval", "scaled"))
    )
    sure = (pl.col("error").abs() > SURE_OFF) & (pl.col("scaled").abs() > SURE_STD)
    has_interval = pl.col("low").is_not_null()
    measures = {
        "drives": pl.len(),
        "refused_pct": 100.0 * mass.is_null().mean(),
        "rms_pct": 100.0 * pl.col("error").pow(2).mean().sqrt(),
        "mean_pct": 100.0 * pl.col("error").mean(),
        "held_pct": 100.0 * (pl.col("outside") == 0.0).filter(has_interval).mean(),
        "interval_score_pct": 100.0 * pl.col("interval").mean(),
        "squared_error_over_variance": pl.col("scaled").pow(2).mean(),
        "falsely_sure": pl.when(has_interval.any()).then(sure.sum()),
    }
    whole = joined.with_columns(by=pl.lit("all"), slice=pl.lit("all"))
    parts = [joined.with_columns(by=pl.lit(label), slice=pl.col(label)) for label in LABELS]
    rows = [one.group_by("by", "slice", maintain_order=True) for one in (whole, *parts)]
    return pl.concat([one.agg(**measures) for one in rows])


def _read(path: Path) -> pl.DataFrame:
    try:
        if path.suffix.lower() == ".parquet":
            return pl.read_parquet(path).cast(pl.String)
        return pl.read_csv(path, infer_schema=False)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from None
    except PARSE_ERRORS as error:
        raise ConfigError(f"{path}: is no table: {first_line(error)}") from None


def _no_numbers(found: pl.DataFrame, name: str) -> tuple[Any, Any] | None:
    """Drive and cell of the first that is neither empty nor a number that can be."""
    cell = pl.col(name).str.strip_chars()
    number = cell.cast(pl.Float64, strict=False)
    least = number > 0.0 if name in ("mass_kg", "std_kg") else number.is_not_nan()
    fine = cell.is_null() | (cell == "") | (number.is_finite() & least).fill_null(value=False)
    wrong = found.filter(~fine)
    return (wrong["drive"][0], wrong[name][0]) if wrong.height else None
