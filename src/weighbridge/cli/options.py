"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Optional

import typer

if TYPE_CHECKING:
    from weighbridge.signals import Drive

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

Whole = Annotated[
    bool,
    typer.Option("--whole", help="Take each recording as one drive, whatever it holds."),
]


def load(path: Path, mapping: Path | None, dbc: list[str] | None = None) -> Drive:
    """Read one drive."""
    from weighbridge.io import read_drive

    return read_drive(path, mapping, dbc or ())


def load_parts(
    path: Path, mapping: Path | None, dbc: list[str] | None, *, whole: bool
) -> list[Drive]:
    """Read the drives of one recording; one where it is to be taken as a whole."""
    from weighbridge.io import read_drives

    return [load(path, mapping, dbc)] if whole else read_drives(path, mapping, dbc or ())
