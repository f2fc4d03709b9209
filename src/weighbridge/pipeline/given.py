"""What a caller gives: a drive, a vehicle, or where they lie."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from weighbridge.arguments import is_frame, type_name
from weighbridge.errors import ArgumentTypeError, ConfigError
from weighbridge.signals import Drive
from weighbridge.vehicle import Vehicle

if TYPE_CHECKING:
    from weighbridge.io.mapping import MappingSource
    from weighbridge.io.read_frames import Frame

GivenDrive: TypeAlias = "Drive | str | Path | Frame | Mapping[str, Frame]"
"""A drive, a path for `read_drive`, or data frames for `read_frame`."""

GivenVehicle: TypeAlias = Vehicle | str | Path
"""A vehicle, or the path of a vehicle file."""


def mapping_of(
    vehicle: Vehicle | None, home: Path | None, asked: Path | None = None
) -> Path | None:
    """Return the mapping asked for, else the one that a vehicle file names, beside itself.

    Parameters
    ----------
    vehicle : None where there is none
    home : path of its file; None where it is not known, and the name stays as it is
    asked : None where no mapping was
    """
    if asked is not None:
        return asked
    if vehicle is None or vehicle.mapping is None:
        return None
    named = Path(vehicle.mapping)
    return named if named.is_absolute() or home is None else home.parent / named


def dbcs_beside(dbc: Sequence[str], home: Path) -> list[str]:
    """DBC files of a command as a file at ``home`` names them: seen from its folder, bus kept."""
    from weighbridge.io.dbc import dbc_path, with_path

    return [with_path(name, Path(mapping_beside(dbc_path(name), home))) for name in dbc]


def mapping_beside(mapping: Path, home: Path) -> str:
    """Path of a mapping as a vehicle file names it: seen from that file's folder where it can be.

    Parameters
    ----------
    mapping : as a command was given it
    home : path of the vehicle file
    """
    whole = mapping.resolve()
    try:
        return Path(os.path.relpath(whole, home.parent.resolve())).as_posix()
    except ValueError:
        # On another drive of the machine.
        return whole.as_posix()


def home_of(given: GivenVehicle | None) -> Path | None:
    """Return the path of a vehicle file that was given by it."""
    return Path(given) if isinstance(given, str | Path) else None


def as_drive(
    given: GivenDrive,
    named: Path | None = None,
    asked: MappingSource | None = None,
    name: str = "frame",
) -> Drive:
    """Return a drive, read where it is a path or a table.

    Parameters
    ----------
    given
    named : mapping that the vehicle file names
    asked : mapping that the caller gives, which goes before it
    name : of a drive that data frames make

    Raises
    ------
    ConfigError
        It is neither, or a mapping is given for a drive that is read already.
    DriveError
        It cannot be read.
    """
    mapping = asked if asked is not None else named
    if isinstance(given, Drive):
        if asked is not None:
            raise ConfigError(
                f"{given.name}: the drive is read already; give mapping to read_drive or "
                "read_frame, or the path or the data frames here"
            )
        return given
    if isinstance(given, str | Path):
        from weighbridge.io import read_drive

        return read_drive(given, mapping)
    from weighbridge.io.read_frames import read_frame

    if is_frame(given) or (
        isinstance(given, Mapping) and given and all(map(is_frame, given.values()))
    ):
        # Data frames with canonical names need no mapping, wherever the vehicle file was copied to.
        there = asked is not None or (named is not None and named.is_file())
        return read_frame(given, mapping if there else None, name=name)
    raise ArgumentTypeError(
        f"a drive is expected, got {type_name(given)}: give what read_drive returns, the path of a "
        "folder or file, or data frames"
    )


def as_drives(
    given: GivenDrive | Sequence[GivenDrive],
    named: Path | None = None,
    asked: MappingSource | None = None,
) -> list[Drive]:
    """Return one or several drives, as of `as_drive`; those of data frames are numbered."""
    if isinstance(given, list | tuple):
        return [as_drive(one, named, asked, f"frame {k}") for k, one in enumerate(given, 1)]
    return [as_drive(given, named, asked)]


def as_vehicle(given: GivenVehicle) -> Vehicle:
    """Return a vehicle, read where it is a path.

    Raises
    ------
    ArgumentTypeError
        It is neither.
    ConfigError
        The file cannot be used.
    """
    if isinstance(given, Vehicle):
        return given
    if isinstance(given, str | Path):
        return Vehicle.load(given)
    raise ArgumentTypeError(
        f"a vehicle is expected, got {type_name(given)}: give what calibrate returns, or the path "
        "of a vehicle file"
    )
