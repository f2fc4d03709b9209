"""Legs: the spans of drives with one load each, what was loaded between, what was not judged."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl
from scipy.special import stdtr, stdtrit

from weighbridge.errors import ConfigError
from weighbridge.fleet.learnt import with_factors
from weighbridge.fleet.schema import LEGS
from weighbridge.fleet.tickets import POSSIBLE, instant_of, rows_of
from weighbridge.fleet.trailers import SHOWN, with_trailers
from weighbridge.messages import Problem
from weighbridge.signals import Floats

COUPLINGS: Final = ("vehicle", "start", "end", "permitted_kg")
"""Columns of a table of couplings: id of the vehicle, when its trailer was coupled and uncoupled
(UTC where no zone is named; an empty end is none yet), permitted mass of vehicle and trailer."""

_TIME: Final = pl.Datetime("us", "UTC")
_NEVER: Final = datetime(9999, 1, 1, tzinfo=UTC)


class Coupling(NamedTuple):
    """A trailer behind a vehicle: from when to when, permitted mass of both [kg]."""

    vehicle: str
    start: datetime
    end: datetime
    permitted: float


def read_couplings(path: Path) -> list[Coupling]:
    """Read a table of couplings, CSV or Parquet, see `COUPLINGS`.

    Raises
    ------
    ConfigError
        It cannot be read, lacks a column, or a row is impossible.
    """
    return [_coupling(cells, where) for where, cells in rows_of(path, COUPLINGS)]


def _coupling(cells: tuple[Any, ...], where: str) -> Coupling:
    vehicle, start, end, permitted = cells
    try:
        begun, ended = instant_of(start), _NEVER if end in (None, "") else instant_of(end)
        mass = float(permitted)
    except (TypeError, ValueError):
        raise ConfigError(
            f"{where}: start {start!r}, end {end!r} and permitted_kg {permitted!r} must be dates "
            "and times such as 2026-05-01T06:30:00Z and kilograms"
        ) from None
    if not begun < ended:
        raise ConfigError(f"{where}: end {end!r} is not after start {start!r}")
    if vehicle is None or not POSSIBLE[0] <= mass <= POSSIBLE[1]:
        raise ConfigError(f"{where}: vehicle {vehicle!r} with {mass:g} kg is no permitted mass")
    return Coupling(str(vehicle), begun, ended, mass)


def with_couplings(legs: pl.DataFrame, couplings: Sequence[Coupling]) -> pl.DataFrame:
    """Add the permitted mass of each leg, and whether a trailer was coupled at its middle.

    A trailer that the vehicle reports is coupled, too. Without a row of the table nobody knows what
    both may have.

    Parameters
    ----------
    legs : with the columns ``vehicle_id``, ``start``, ``end`` [UTC], ``gross_kg`` and
        ``trailer_connected``
    couplings : of a vehicle, the one that began last counts

    Returns
    -------
    The legs, in their order, with ``permitted_kg`` and ``coupled``
    """
    known = pl.DataFrame(
        couplings,
        schema={
            "vehicle_id": pl.String,
            "_start": _TIME,
            "_end": _TIME,
            "_permitted": pl.Float64,
        },
        orient="row",
    ).sort("_start")
    reported = pl.col("trailer_connected").fill_null(value=False)
    middle = pl.col("start") + (pl.col("end") - pl.col("start")) / 2
    rows = legs.with_row_index("_row").with_columns(_middle=middle)
    found = (
        rows.drop_nulls(["_middle", "vehicle_id"])
        .select("_row", "vehicle_id", "_middle")
        .sort("_middle")
        .join_asof(
            known, left_on="_middle", right_on="_start", by="vehicle_id", check_sortedness=False
        )
        .filter(pl.col("_middle") < pl.col("_end"))
        .select("_row", "_permitted")
    )
    return (
        rows.join(found, on="_row", how="left", maintain_order="left")
        .with_columns(
            permitted_kg=pl.when(reported & pl.col("_permitted").is_null())
            .then(None)
            .otherwise(pl.coalesce("_permitted", "gross_kg")),
            coupled=pl.col("_permitted").is_not_null() | reported,
        )
        .drop("_row", "_middle", "_permitted")
    )


PREVENTED: Final = ("mass", "overload", "payload")
"""What may not be known of a leg, the worst first: each also prevents those behind it."""


def with_causes(rows: pl.DataFrame, permitted: str) -> pl.DataFrame:
    """Add what is not known of each row first of `PREVENTED`, and why.

    Parameters
    ----------
    rows : with ``mass_kg``, ``tare_kg``, ``gross_kg``, ``vehicle_file``, ``reason`` and
        ``reason_id``
    permitted : column of the permitted mass

    Returns
    -------
    polars.DataFrame
        The rows with ``prevents``, ``reason_id`` and ``reason``; null where all is known.
    """
    lacks = (
        ("mass", pl.col("mass_kg").is_null(), None),
        (
            "overload",
            pl.col(permitted).is_null() & pl.col("vehicle_file").is_null(),
            Problem.of("fleet.no_file"),
        ),
        (
            "overload",
            pl.col(permitted).is_null() & pl.col("gross_kg").is_not_null(),
            Problem.of("fleet.trailer_reported"),
        ),
        ("overload", pl.col(permitted).is_null(), Problem.of("fleet.no_permitted")),
        ("payload", pl.col("tare_kg").is_null(), Problem.of("fleet.no_tare")),
    )
    found = {name: pl.lit(None, pl.String) for name in ("prevents", "reason_id", "reason")}
    for what, lacking, problem in reversed(lacks):
        reported = {
            "prevents": pl.lit(what),
            "reason_id": pl.col("reason_id") if problem is None else pl.lit(problem.id),
            "reason": pl.col("reason") if problem is None else pl.lit(problem.text),
        }
        found = {n: pl.when(lacking).then(reported[n]).otherwise(found[n]) for n in found}
    return rows.with_columns(**found)


def unjudged(rows: pl.DataFrame) -> pl.DataFrame:
    """Return the causes for which legs or drives were not judged, ranked.

    Parameters
    ----------
    rows : as of `with_causes`, with ``vehicle_id`` and ``distance_km``

    Returns
    -------
    polars.DataFrame
        ``prevents`` (in the order of `PREVENTED`), ``reason_id``, ``example`` (a sentence),
        ``count`` (of rows; most frequent first), ``share`` (of all rows), ``distance_km``,
        ``vehicles`` (their ids).
    """
    rank = {name: number for number, name in enumerate(PREVENTED)}
    return (
        rows.filter(pl.col("prevents").is_not_null())
        .group_by("prevents", "reason_id")
        .agg(
            pl.col("reason").sort().first().alias("example"),
            pl.len().cast(pl.Int64).alias("count"),
            (pl.len() / max(rows.height, 1)).alias("share"),
            pl.col("distance_km").sum(),
            pl.col("vehicle_id").unique().sort().alias("vehicles"),
        )
        .sort(
            pl.col("prevents").replace_strict(rank, return_dtype=pl.Int32),
            "count",
            "reason_id",
            descending=[False, True, False],
        )
    )


SURE: Final = 1.959964
"""Standard deviations of a change of load that is reported: 95 % of a normal distribution."""

_POSITION: Final = tuple(
    f"{edge}_{axis}_deg" for edge in ("start", "end") for axis in ("latitude", "longitude")
)
_OF_DRIVE: Final = (
    "key", "part", "date", "source", "drive", "outcome", "vehicle_id", "vehicle_file",
    "vehicle_class", "tare_kg", "gross_kg", "status", "reason_id", "reason", "freedom", "type",
    "factor", "vehicle_digest", "maker_mass_kg", "trailer_connected", *SHOWN,
)  # fmt: skip
_MASS: Final = ("mass_kg", "std_kg", "weighed_kg", "weighed_std_kg")
_OF_LEG: Final = (*_MASS, "distance_km", "moving_s", *_POSITION)


class Limits(NamedTuple):
    """What counts as overload, as a trailer and as empty.

    Attributes
    ----------
    warn, alarm : least probabilities that the mass is above the permitted one
    empty : payload below this part of the permitted payload is none [-]
    trailer : least probability of a trailer that is reported, where no coupling is known; of 175
        legs of trucks without one that the law was tuned on, the highest had 0.76
    """

    warn: float = 0.5
    alarm: float = 0.95
    empty: float = 0.1
    trailer: float = 0.8


def check_limits(limits: Limits) -> None:
    """Raise where limits cannot be.

    Raises
    ------
    ConfigError
        A probability is not in (0, 1), warn is above alarm, or another is out of range.
    """
    if not 0.0 < limits.warn <= limits.alarm < 1.0:
        raise ConfigError(
            f"warn and alarm are probabilities, warn the lower, such as 0.5 and 0.95; "
            f"got {limits.warn:g} and {limits.alarm:g}"
        )
    if not 0.0 <= limits.empty < 1.0:
        raise ConfigError(f"empty must be in [0, 1) of the permitted payload, got {limits.empty:g}")
    if not 0.0 < limits.trailer < 1.0:
        raise ConfigError(f"trailer must be in (0, 1), a probability, got {limits.trailer:g}")


def legs(
    drives: pl.DataFrame,
    segments: pl.DataFrame,
    limits: Limits | None = None,
    couplings: Sequence[Coupling] = (),
    learnt: pl.DataFrame | None = None,
) -> pl.DataFrame:
    """Return one row per leg, in order of vehicle and time.

    A drive whose load changed has a leg for each load, any other is one leg. A drive without a mass
    is a leg without one. So is the part of a drive that was not weighed, from a stop on.

    Parameters
    ----------
    drives, segments : as of `read_drives` and `read_segments`, collected
    limits : as of `Limits`
    couplings : of trailers, where the fleet knows them
    learnt : as of `weighbridge.fleet.learnt.read_learnt`, whose factors masses are multiplied by

    Returns
    -------
    polars.DataFrame
        See `weighbridge.fleet.schema.LEGS`.

    Raises
    ------
    ConfigError
        The limits cannot be.
    """
    limits = limits or Limits()
    check_limits(limits)
    drives, segments = with_factors(drives, segments, learnt)
    drive_scale = pl.col("systematic_std_kg") / pl.col("mass_kg")
    common = pl.col("common_kg") / pl.col("mass_kg")
    kept: list[str | pl.Expr] = [
        *_OF_DRIVE, "start", drive_scale.alias("scale"), common.alias("common"),
    ]  # fmt: skip
    changed = pl.col("load_changed").fill_null(value=False)
    several = changed | (pl.col("unweighed_s") > 0.0).fill_null(value=False)
    whole = drives.filter(~several).select(
        *kept, *_OF_LEG, "duration_s", pl.lit(0, pl.Int32).alias("leg")
    )
    of = drives.filter(several).select(
        *kept, changed.alias("changed"),
        *(pl.col(name).alias(f"drive_{name}") for name in _MASS),
    )  # fmt: skip
    split = of.join(segments, on=["key", "part"]).pipe(_parted).select(whole.columns)
    found = pl.concat([whole, split]).with_columns(
        end=pl.col("start") + _seconds(pl.col("duration_s")),
        shared_kg=(pl.col("scale") * pl.col("mass_kg")).clip(upper_bound=pl.col("std_kg")),
        common_kg=(pl.col("common") * pl.col("mass_kg")).clip(upper_bound=pl.col("std_kg")),
        payload_kg=pl.col("mass_kg") - pl.col("tare_kg"),
    )
    found = with_trailers(with_couplings(found.drop("scale", "common"), couplings))
    found = _judged(found, limits)
    found = with_causes(found, "permitted_kg").select(list(LEGS))
    return found.sort("vehicle_id", "start", "source", "leg", nulls_last=True)


def _parted(rows: pl.DataFrame) -> pl.DataFrame:
    """Make legs of the segments of drives: one per load, and one per span that was not weighed."""
    bare = pl.col("start_s").is_null()
    unknown = Problem.of("fleet.not_driven_out")
    drive = ["key", "part"]
    rows = rows.sort(*drive, "segment").with_columns(
        leg=pl.when(pl.col("changed")).then("segment").otherwise(bare.rle_id().over(drive)),
        offset=pl.col("from_s") - pl.col("from_s").min().over(drive),
        duration_s=pl.col("to_s") - pl.col("from_s"),
        reason_id=pl.when(bare).then(pl.lit(unknown.id)).otherwise("reason_id"),
        reason=pl.when(bare).then(pl.lit(unknown.text)).otherwise("reason"),
        # One load has the mass of its drive, whatever its segments have.
        **{
            name: pl.when(pl.col("changed") | bare).then(name).otherwise(f"drive_{name}")
            for name in _MASS
        },
    )
    summed, last = ("distance_km", "moving_s", "duration_s"), _POSITION[2:]
    first = [n for n in rows.columns if n not in (*drive, "leg", *summed, *last)]
    return (
        rows.group_by(*drive, "leg", maintain_order=True)
        .agg(pl.col(first).first(), pl.col(summed).sum(), pl.col(last).last())
        .with_columns(
            pl.col("leg").cast(pl.Int32), start=pl.col("start") + _seconds(pl.col("offset"))
        )
    )


def _judged(rows: pl.DataFrame, limits: Limits) -> pl.DataFrame:
    """Add interval, probability of overload and what follows from the limits."""
    mass, std, permitted, freedom = (
        rows[name].fill_null(float("nan")).to_numpy()
        for name in ("mass_kg", "std_kg", "permitted_kg", "freedom")
    )
    reach = std * stdtrit(freedom, 0.975)
    with np.errstate(divide="ignore", invalid="ignore"):
        overload = stdtr(freedom, (mass - permitted) / std)
    room = pl.col("gross_kg") - pl.col("tare_kg")
    level = (
        pl.when(pl.col("overload") >= limits.alarm)
        .then(pl.lit("alarm"))
        .when(pl.col("overload") >= limits.warn)
        .then(pl.lit("warn"))
        .when(pl.col("overload").is_not_null())
        .then(pl.lit("ok"))
    )
    return rows.with_columns(
        low95_kg=_column(mass - reach),
        high95_kg=_column(mass + reach),
        overload=_column(overload),
    ).with_columns(
        level=level,
        payload_low95_kg=pl.col("low95_kg") - pl.col("tare_kg"),
        payload_high95_kg=pl.col("high95_kg") - pl.col("tare_kg"),
        trailer=pl.col("coupled") | (pl.col("trailer_probability") >= limits.trailer),
        empty=pl.col("payload_kg") < limits.empty * room,
        tkm=1e-3 * pl.col("payload_kg").clip(lower_bound=0.0) * pl.col("distance_km"),
    )


def load_changes(rows: pl.DataFrame) -> pl.DataFrame:
    """Return where and when the load of a vehicle changed between two of its legs.

    What both masses share, an error of the vehicle file, moves their difference by as much of it
    as the difference is of the mass. Within a drive the estimator distinguishes both loads; between
    drives a change is reported from `SURE` standard deviations on.

    Parameters
    ----------
    rows : as of `legs`

    Returns
    -------
    polars.DataFrame
        ``vehicle_id``, ``time`` [UTC], ``stop_s``, ``latitude_deg``, ``longitude_deg``,
        ``before_kg``, ``after_kg``, ``change_kg``, ``std_kg``, ``within_drive``, ``kind``
        (loaded, unloaded, trailer on, trailer off).
    """
    known = rows.filter(pl.col("mass_kg").is_not_null() & pl.col("start").is_not_null())
    own = (pl.col("std_kg").pow(2) - pl.col("shared_kg").fill_null(0.0).pow(2)).clip(0.0)
    known = known.sort("vehicle_id", "start").with_columns(own=own)
    before = {
        f"old_{name}": pl.col(name).shift(1).over("vehicle_id")
        for name in ("mass_kg", "own", "end", "key", "part", "trailer",
                     "end_latitude_deg", "end_longitude_deg")
    }  # fmt: skip
    change = pl.col("mass_kg") - pl.col("old_mass_kg")
    scale = pl.col("shared_kg").fill_null(0.0) / pl.col("mass_kg")
    pairs = known.with_columns(**before).filter(pl.col("old_mass_kg").is_not_null())
    pairs = pairs.with_columns(
        change_kg=change,
        change_std=(pl.col("own") + pl.col("old_own") + (scale * change).pow(2)).sqrt(),
        within_drive=(pl.col("key") == pl.col("old_key")) & (pl.col("part") == pl.col("old_part")),
    )
    found = pairs.filter(
        pl.col("within_drive") | (pl.col("change_kg").abs() > SURE * pl.col("change_std"))
    )
    towed = (pl.col("trailer") != pl.col("old_trailer")).fill_null(value=False)
    more = pl.col("change_kg") > 0.0
    kind = (
        pl.when(towed & more).then(pl.lit("trailer on"))
        .when(towed).then(pl.lit("trailer off"))
        .when(more).then(pl.lit("loaded"))
        .otherwise(pl.lit("unloaded"))
    )  # fmt: skip
    return found.select(
        "vehicle_id",
        pl.col("start").alias("time"),
        (pl.col("start") - pl.col("old_end")).dt.total_seconds().alias("stop_s"),
        pl.coalesce("start_latitude_deg", "old_end_latitude_deg").alias("latitude_deg"),
        pl.coalesce("start_longitude_deg", "old_end_longitude_deg").alias("longitude_deg"),
        pl.col("old_mass_kg").alias("before_kg"),
        pl.col("mass_kg").alias("after_kg"),
        "change_kg",
        pl.col("change_std").alias("std_kg"),
        "within_drive",
        kind.alias("kind"),
    )


def _seconds(value: pl.Expr) -> pl.Expr:
    return (1e6 * value).cast(pl.Int64).cast(pl.Duration("us"))


def _column(values: Floats) -> pl.Series:
    return pl.Series(values).fill_nan(None)
