"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Optional

import typer

from weighbridge.cli.listed import one_of
from weighbridge.cli.verbosity import show_in
from weighbridge.customary import SYSTEMS

if TYPE_CHECKING:
    from weighbridge.signals import Drive
    from weighbridge.vehicle import Vehicle

DrivePaths = Annotated[
    list[Path],
    typer.Argument(
        help="One or more drives. A drive is a folder of tables, a folder of logs of one "
        "drive (joined by time), or one log.",
        show_default=False,
    ),
]
OneDrive = Annotated[
    Path, typer.Argument(help="Drive: folder of tables, or log file.", show_default=False)
]
JsonPath = Annotated[
    Optional[str],  # noqa: UP045  (typer reads the annotation at run time)
    typer.Option("--json", help="Write a JSON object to a file, or - for standard output."),
]
MappingPath = Annotated[
    Optional[Path],  # noqa: UP045  (typer reads the annotation at run time)
    typer.Option(
        "--mapping",
        help="Mapping: a TOML file that gives the meaning, unit and sign of each column.",
    ),
]
ReportPath = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option("--report", help="Write a self-contained HTML report."),
]
DbcPaths = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option(
        "--dbc",
        help="DBC for raw CAN logs; repeat it for more files; write 1:FILE for bus 1 only.",
        metavar="FILE",
    ),
]
Elevation = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option(
        "--elevation",
        help="Elevation raster (GeoTIFF) that gives the heights in place of the receiver.",
        metavar="FILE.tif",
    ),
]
SplitMb = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        "--split-mb",
        min=1.0,
        help="Go on in a new folder where the recording has so many MB: trip, trip-2 and so on.",
    ),
]
KeepDays = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        "--keep-days",
        min=1.0,
        help="Remove folders of this recording that were last written so many days ago.",
    ),
]

Units = Annotated[
    str,
    typer.Option(
        "--units",
        help="What people read: si, or us for pounds, feet and miles. Files stay SI.",
        callback=show_in,
        autocompletion=one_of(*SYSTEMS),
    ),
]

Whole = Annotated[
    bool,
    typer.Option("--whole", help="Treat each recording as one drive; do not split it."),
]


def chosen_mapping(vehicle: Vehicle | None, home: Path | None, asked: Path | None) -> Path | None:
    """Return the mapping asked for, else the one that the vehicle file names.

    Raises
    ------
    ConfigError
        The one that the vehicle file names is not there.
    """
    from weighbridge.errors import ConfigError
    from weighbridge.pipeline.given import mapping_of

    found = mapping_of(vehicle, home, asked)
    if asked is None and found is not None and not found.exists():
        raise ConfigError(
            f"{home}: the mapping that it names, {found}, is not there: put it there, give "
            "--mapping FILE, or leave out the line mapping"
        )
    return found


def load(path: Path, mapping: Path | None, dbc: list[str] | None = None) -> Drive:
    """Read one drive."""
    from weighbridge.io import read_drive

    return read_drive(path, mapping, dbc or ())


def load_parts(
    path: Path,
    mapping: Path | None,
    dbc: list[str] | None,
    *,
    whole: bool,
    elevation: Path | None = None,
) -> list[Drive]:
    """Read the drives of one recording; one where it is to be taken as a whole."""
    from weighbridge.io import read_drives

    drives = [load(path, mapping, dbc)] if whole else read_drives(path, mapping, dbc or ())
    if elevation is None:
        return drives
    from weighbridge.io.elevation import with_elevation

    return [with_elevation(drive, elevation) for drive in drives]
