"""The report: one page that answers first and then shows why; opens offline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from weighbridge.report.style import Panel
    from weighbridge.report.table import Table
    from weighbridge.results import Calibration
    from weighbridge.results.weighing import MassResult

__all__ = ["mass_figure", "write_report"]


def write_report(
    weighings: Sequence[MassResult],
    path: str | Path,
    *,
    calibration: Calibration | None = None,
    truth: Mapping[str, float] | None = None,
    title: str | None = None,
    comparisons: Sequence[Sequence[MassResult]] | None = None,
    tables: Sequence[Table] = (),
    panels: Sequence[Panel] = (),
    tiles: str | None = None,
) -> None:
    """Write one self-contained HTML page for one or many drives.

    Parameters
    ----------
    weighings : in the order to show them
    path : file to write; its folder must be there
    calibration : shows how the vehicle file came about
    truth : true mass at the end of each drive, by its name [kg]; where a drive is not named, the
        known mass of its ``drive.toml`` serves
    title : heading of the page; made from the drives when None
    comparisons : for each of ``weighings`` the same drive by every method, as of
        `weighbridge.compare`, to show side by side; none when None
    tables : to begin the page with
    panels : figures to follow the tables
    tiles : address of map tiles with ``{z}``, ``{x}`` and ``{y}``, to draw maps over; whoever opens
        the page then asks that server, which learns where the drive was. None: no request

    Raises
    ------
    ConfigError
        There is nothing to report, there are not as many comparisons as weighings, the tiles are no
        such address, or the file cannot be written.
    """
    from weighbridge.arguments import check_text
    from weighbridge.report.page import write_page
    from weighbridge.report.tiles import Tiles

    if tiles is not None:
        check_text("tiles", tiles)
    write_page(
        weighings,
        Path(path),
        calibration=calibration,
        truth=truth or {},
        title=title,
        comparisons=comparisons or (),
        tables=tables,
        panels=panels,
        tiles=Tiles(tiles) if tiles is not None else None,
    )


def mass_figure(weighing: MassResult, *, truth: float | None = None) -> go.Figure:
    """Return the mass with its band over time as a plotly figure.

    Parameters
    ----------
    weighing : of one drive
    truth : true mass at the end of the drive [kg]; as the simulation or the log states it when None

    Raises
    ------
    ConfigError
        Nothing was estimated, so there is no mass to draw.
    """
    from weighbridge.errors import ConfigError
    from weighbridge.report.mass_section import mass_panel
    from weighbridge.report.page import known_mass
    from weighbridge.report.style import in_shown_units

    known = known_mass(weighing, {} if truth is None else {weighing.drive.name: truth})
    panel = mass_panel(weighing, known.mass if known else None)
    if panel.figure is None:
        raise ConfigError(f"{weighing.drive.name}: {panel.absent}")
    in_shown_units(panel.figure)
    # The legend is one line above the figure, the title above that.
    panel.figure.update_layout(
        title={"text": panel.title, "x": 0.01, "y": 0.97, "yanchor": "top"}, margin_t=90
    )
    return panel.figure
