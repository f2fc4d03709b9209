"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from weighbridge.cli.listed import argument, one_of, option
from weighbridge.cli.verbosity import show_in
from weighbridge.customary import SYSTEMS

if TYPE_CHECKING:
    from weighbridge.signals import Drive
    from weighbridge.vehicle import Vehicle

DrivePaths = Annotated[list[Path], argument("DRIVES")]
OneDrive = Annotated[Path, argument("DRIVE")]
JsonPath = Annotated[str | None, option("--json")]
MappingPath = Annotated[Path | None, option("--mapping")]
ReportPath = Annotated[Path | None, option("--report")]
DbcPaths = Annotated[list[str] | None, option("--dbc")]
Elevation = Annotated[Path | None, option("--elevation")]
SplitMb = Annotated[float | None, option("--split-mb", min=1.0)]
KeepDays = Annotated[float | None, option("--keep-days", min=1.0)]

Units = Annotated[str, option("--units", callback=show_in, autocompletion=one_of(*SYSTEMS))]

Whole = Annotated[bool, option("--whole")]


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
