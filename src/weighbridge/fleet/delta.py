"""Results as Delta tables, for lakehouses that read those."""

from __future__ import annotations

from pathlib import Path

import polars as pl

from weighbridge.errors import ConfigError, MissingExtraError
from weighbridge.fleet.reading import collected, read_drives, read_segments


def write_delta(results: str | Path, place: str | Path) -> None:
    """Bring the rows of results into two Delta tables, ``drives`` and ``segments``.

    Rows that are there stay; new ones are added, and one that was weighed again replaces the old:
    each table changes in one commit.

    Parameters
    ----------
    results : folder that ``weighbridge fleet`` wrote
    place : folder or URL, such as ``s3://bucket/fleet``, of the two tables

    Raises
    ------
    MissingExtraError
        deltalake is not installed.
    ConfigError
        The results cannot be read, or the tables not be written.
    """
    try:
        import deltalake
        from deltalake.exceptions import DeltaError
    except ImportError:
        raise MissingExtraError("deltalake", "fleet-delta", "writing Delta tables") from None
    tables = (
        ("drives", read_drives(results), "target.source = new.source AND target.part = new.part"),
        (
            "segments",
            read_segments(results),
            "target.key = new.key AND target.part = new.part AND target.segment = new.segment",
        ),
    )
    for name, lazy, same in tables:
        frame = collected(lazy.with_columns(pl.col("date").cast(pl.String)), results)
        uri = f"{str(place).rstrip('/')}/{name}"
        try:
            if not deltalake.DeltaTable.is_deltatable(uri):
                deltalake.write_deltalake(uri, frame, partition_by=["date"])
                continue
            merge = deltalake.DeltaTable(uri).merge(
                frame, same, source_alias="new", target_alias="target"
            )
            changed = "new.weighed_at > target.weighed_at" if name == "drives" else "false"
            merge.when_matched_update_all(changed).when_not_matched_insert_all().execute()
        except (DeltaError, OSError) as error:
            raise ConfigError(f"{uri} cannot be written as a Delta table: {error}") from None
