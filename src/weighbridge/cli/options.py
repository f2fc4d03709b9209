"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Optional

import typer

from weighbridge.errors import ConfigError

if TYPE_CHECKING:
    from weighbridge.signals import Drive
    from weighbridge.vehicle.model import Vehicle

DrivePaths = Annotated[
    list[Path],
    typer.Argument(
        help="Drives, each for itself: a folder of tables, a folder of logs that are one drive "
        "(joined by time), or one log.",
        show_default=False,
    ),
]
MappingPath = Annotated[
    Optional[Path],  # noqa: UP045  (typer reads the annotation at run time)
    typer.Option("--mapping", help="TOML that names foreign columns, units and signs."),
]
ReportPath = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option("--report", help="Write a self-contained HTML report."),
]
DbcPaths = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option(
        "--dbc",
        help="DBC of raw CAN logs; repeat it for more, write 1:FILE for bus 1 alone.",
        metavar="FILE",
    ),
]


def mapping_for(mapping: Path | None, vehicle: Vehicle | None, home: Path | None) -> Path | None:
    """Return the mapping asked for, else the one the vehicle file names beside itself."""
    if mapping is not None or vehicle is None or vehicle.mapping is None:
        return mapping
    named = Path(vehicle.mapping)
    return named if named.is_absolute() or home is None else home.parent / named


def load(path: Path, mapping: Path | None, dbc: list[str] | None = None) -> Drive:
    """Read one drive."""
    from weighbridge.io import read_drive

    return read_drive(path, mapping, dbc or ())


def refuse_overwriting(path: Path, force: bool, what: str) -> None:
    """Raise where ``path`` exists and ``--force`` was not given."""
    if path.exists() and not force:
        raise ConfigError(
            f"{path}: exists already; name another {what}, or give --force to replace it"
        )


def refuse_results(
    inputs: list[Path],
    *,
    track: Path | None,
    report: Path | None,
    json_path: str | None,
) -> None:
    """Raise before the work where a result could not be written, or would replace an input.

    Parameters
    ----------
    inputs : files and folders that are read
    track, report, json_path : where results go; None, or - for standard output
    """
    if track is not None and track.suffix.lower() not in (".csv", ".parquet"):
        raise ConfigError(f"--track {track}: a track is written as .csv or .parquet")
    outputs = (track, report, Path(json_path) if json_path and json_path != "-" else None)
    refuse_missing_folder(*outputs)
    known = {path.resolve() for path in inputs}
    for output in outputs:
        if output is None:
            continue
        if output.resolve() in known:
            raise ConfigError(f"{output}: is an input; results must go to another file")
        # A table of a drive's folder, or what else may be one.
        if output.exists() and output.resolve().parent in known and _may_be_read(output):
            raise ConfigError(
                f"{output}: is there already, in the folder of a drive that is read; results must "
                "go to another file"
            )


def _may_be_read(path: Path) -> bool:
    from weighbridge.io import READERS

    return path.suffix.lower() in (*READERS, ".toml")


def refuse_missing_folder(*outputs: Path | None) -> None:
    """Raise before the work where a result could not be written after it."""
    for path in outputs:
        if path is not None and not path.parent.is_dir():
            raise ConfigError(f"{path}: there is no folder {path.parent}; make it first")
        if path is not None and path.is_dir():
            raise ConfigError(f"{path}: is a folder; name a file in it")
