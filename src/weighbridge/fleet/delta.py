"""Results as Delta tables, for lakehouses that read those."""

from __future__ import annotations

from pathlib import Path

import polars as pl

from weighbridge.errors import ConfigError, MissingExtraError
from weighbridge.fleet.reading import collected, read_drives, read_segments
from weighbridge.fleet.store import Results


def write_delta(results: str | Path, place: str | Path) -> None:
    """Bring the rows of results into two Delta tables, ``drives`` and ``segments``.

    New rows are added, changed ones replaced, and those that count no more in these results are
    removed. Rows of other results stay. Each table changes in one commit.

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
    opened = Results.opened(Path(results))
    for name, lazy in (("drives", read_drives(results)), ("segments", read_segments(results))):
        frame = collected(lazy, results)
        uri = f"{str(place).rstrip('/')}/{name}"
        try:
            if not deltalake.DeltaTable.is_deltatable(uri):
                deltalake.write_deltalake(uri, frame, partition_by=["date"])
                continue
            table = deltalake.DeltaTable(uri)
            there = {field.name for field in table.schema().fields}
            if lacking := set(frame.columns) - there:
                raise ConfigError(
                    f"{uri}: is a Delta table of another version of weighbridge (it lacks "
                    f"{', '.join(sorted(lacking))}); name another place"
                )
            # A row without a number takes away all drives of its key.
            gone = sorted(opened.superseded() - set(frame["key"]))
            new = pl.concat([frame, pl.DataFrame({"key": gone})], how="diagonal_relaxed")
            columns = {column: f"new.{column}" for column in frame.columns}
            changed = " OR ".join(
                f"(new.{column} IS DISTINCT FROM target.{column})"
                for column in ("source", "copies", "also_vehicles", "weighed_at")
                if column in columns
            )
            (
                table.merge(
                    new,
                    "target.key = new.key AND (new.part IS NULL OR target.part = new.part)"
                    + " AND (new.part IS NULL OR target.segment = new.segment)"
                    * (name == "segments"),
                    source_alias="new",
                    target_alias="target",
                )
                .when_matched_delete("new.part IS NULL")
                .when_matched_update(columns, changed or "false")
                .when_not_matched_insert(columns, "new.part IS NOT NULL")
                .execute()
            )
        except (DeltaError, OSError) as error:
            raise ConfigError(f"{uri} cannot be written as a Delta table: {error}") from None
