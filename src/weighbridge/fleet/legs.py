"""Legs: the spans of drives with one load each, and what was loaded between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import polars as pl
from scipy.special import stdtr, stdtrit

from weighbridge.errors import ConfigError
from weighbridge.fleet.couplings import Coupling, with_couplings
from weighbridge.fleet.learnt import with_factors
from weighbridge.fleet.schema import LEGS
from weighbridge.fleet.trailers import SHOWN, with_trailers
from weighbridge.fleet.unjudged import with_causes
from weighbridge.messages import Problem
from weighbridge.signals import Floats

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
