"""``weighbridge convert``: any drive as a canonical folder or one MF4."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from weighbridge.cli.listed import FORMATS, argument, one_of, option
from weighbridge.cli.options import (
    DbcPaths,
    MappingPath,
    load,
)
from weighbridge.cli.results import (
    Result,
    inputs,
    refuse_folder,
    refuse_overwriting,
    refuse_results,
)
from weighbridge.cli.terminal import say
from weighbridge.cli.verbosity import say_written
from weighbridge.errors import ConfigError, DriveError


def convert(
    drive: Annotated[Path, argument("convert DRIVE")],
    out: Annotated[Path, argument("convert OUT")],
    table_format: Annotated[
        str, option("convert --format", autocompletion=one_of(*FORMATS))
    ] = "parquet",
    mapping: MappingPath = None,
    dbc: DbcPaths = None,
    force: Annotated[bool, option("convert --force")] = False,
) -> None:
    """Write a drive with canonical names and units: a folder of tables, or one MF4.

    Example: weighbridge convert log.mf4 drive/ --dbc car.dbc --mapping car.toml
    """
    from weighbridge.arguments import check_choice

    check_choice("--format", table_format, FORMATS)
    if out.exists() and drive.exists() and out.samefile(drive):
        raise ConfigError(f"{out}: is the drive itself; name another folder or file")
    read = inputs([drive], None, mapping, dbc)
    whole = out.suffix.lower() == ".mf4"
    if out.suffix and not whole and not out.is_dir():
        raise ConfigError(f"{out}: drives are written as a folder or as .mf4, not {out.suffix!r}")
    if not whole:
        refuse_folder(read, out)
    refuse_overwriting(out, force, "folder or file")
    if whole:
        refuse_results(read, [Result("OUT", out, "MF4")])
    recorded = load(drive, mapping, dbc)
    serious = next((p for p in recorded.problems if p.serious), None)
    if serious is not None:
        # A canonical drive carries no questions: a mass would be made of it without a word.
        raise DriveError(f"{drive}: not converted, {serious.text}")
    if whole:
        from weighbridge.io import write_mdf

        write_mdf(recorded, out)
    else:
        from weighbridge.io import write_drive

        write_drive(recorded, out, table_format)  # type: ignore[arg-type]
    for line in recorded.contents:
        say(f"  {line}")
    for problem in recorded.problems:
        say(f"  note: {problem.text}")
    say_written(f"{out}, {len(recorded.signals)} signals")
