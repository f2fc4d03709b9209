"""``weighbridge convert``: any drive as a canonical folder or one MF4."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from weighbridge.cli.options import (
    DbcPaths,
    MappingPath,
    load,
    refuse_missing_folder,
    refuse_overwriting,
)
from weighbridge.errors import ConfigError, DriveError

if TYPE_CHECKING:
    from weighbridge.signals import Drive


def convert(
    drive: Annotated[
        Path,
        typer.Argument(
            help="Drive: a folder of tables or of logs (joined by time), or one log.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path, typer.Argument(help="Folder to write, or a file .mf4.", show_default=False)
    ],
    table_format: Annotated[
        str, typer.Option("--format", help="Tables of a folder: parquet or csv.")
    ] = "parquet",
    mapping: MappingPath = None,
    dbc: DbcPaths = None,
    force: Annotated[bool, typer.Option("--force", help="Replace what is there.")] = False,
) -> None:
    """Write a drive with canonical names and units: a folder of tables, or one MF4.

    Example: weighbridge convert log.mf4 drive/ --dbc car.dbc --mapping car.toml
    """
    if table_format not in ("parquet", "csv"):
        raise ConfigError(f"--format {table_format}: must be parquet or csv")
    if out.resolve() == drive.resolve():
        raise ConfigError(f"{out}: is the drive itself; name another folder or file")
    refuse_overwriting(out, force, "folder or file")
    recorded = load(drive, mapping, dbc)
    serious = next((p for p in recorded.problems if p.serious), None)
    if serious is not None:
        # A canonical drive carries no doubts: a mass would be made of it without a word.
        raise DriveError(f"{drive}: not converted, {serious.text}")
    if out.suffix.lower() == ".mf4":
        from weighbridge.io import write_mdf

        refuse_missing_folder(out)
        write_mdf(recorded, out)
    elif out.suffix and not out.is_dir():
        raise ConfigError(f"{out}: drives are written as a folder or as .mf4, not {out.suffix!r}")
    else:
        _write_folder(recorded, out, table_format)
    for line in recorded.contents:
        typer.echo(f"  {line}")
    for problem in recorded.problems:
        typer.echo(f"  note: {problem.text}")
    typer.echo(f"written: {out}, {len(recorded.signals)} signals")


def _write_folder(drive: Drive, folder: Path, table_format: str) -> None:
    from weighbridge.io import write_drive
    from weighbridge.io.info import FILE_NAME
    from weighbridge.signals.catalogue import TABLES

    if folder.is_file():
        raise ConfigError(f"{folder}: is a file; name a folder, or a file that ends in .mf4")
    # A table that is left of another drive would be read with this one.
    for table in TABLES:
        for suffix in ("csv", "parquet", "pq"):
            (folder / f"{table}.{suffix}").unlink(missing_ok=True)
    (folder / FILE_NAME).unlink(missing_ok=True)
    write_drive(drive, folder, table_format)  # type: ignore[arg-type]
