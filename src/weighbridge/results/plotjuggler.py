"""A layout of PlotJuggler for a track: mass with its interval, force, residual and speed.

Elements and attributes are those that PlotJuggler 3 writes; plots stand one below the other.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final
from xml.etree import ElementTree as XML

import numpy as np

if TYPE_CHECKING:
    import polars as pl

LAYOUT_SUFFIX: Final = ".plotjuggler.xml"
"""What the name of a layout adds to that of its track."""

MARK: Final = "Layout of weighbridge for a track"
"""Begins a layout of ours, so that no other one is replaced."""

# Column, colour; by plot: style, columns.
_PLOTS: Final = (
    ("Lines", (("mass_kg", "#1f77b4"), ("low95_kg", "#9ecae1"), ("high95_kg", "#9ecae1"))),
    ("Lines", (("traction_force_n", "#d62728"),)),
    ("Dots", (("residual_n", "#ff7f0e"),)),
    ("Lines", (("speed_mps", "#2ca02c"),)),
)

# By suffix: what begins the name of a column, plugin that reads the file, its settings.
_READ: Final = {
    ".mcap": (
        "/track/",
        "DataLoad MCAP",
        (
            "parameters",
            {
                "use_timestamp": "0",
                "use_mcap_log_time": "1",
                "clamp_large_arrays": "0",
                "max_array_size": "500",
            },
        ),
    ),
    ".parquet": (
        "",
        "DataLoad Parquet",
        (
            "default",
            {"prevTimestamp": "time_s", "radioIndexChecked": "0", "parseDateTime": "0"},
        ),
    ),
}


def layout_of(track: Path) -> Path | None:
    """Return where the layout of a track lies; None where PlotJuggler does not read its format."""
    if track.suffix.lower() not in _READ:
        return None
    return track.with_name(track.name + LAYOUT_SUFFIX)


def layout(track: Path, table: pl.DataFrame, topics: tuple[str, ...] = ()) -> str:
    """Return the layout that opens a track.

    Parameters
    ----------
    track : the file, of a format that `layout_of` knows; it is named without its folder
    table : what it holds
    topics : of an MCAP, to be loaded
    """
    begins, plugin, (element, settings) = _READ[track.suffix.lower()]
    root = XML.Element("root", version="2.3.8")
    window = XML.SubElement(root, "tabbed_widget", {"parent": "main_window", "name": "Main Window"})
    tab = XML.SubElement(window, "Tab", containers="1", tab_name="mass")
    share = f"{1.0 / len(_PLOTS):.3f}"
    splitter = XML.SubElement(
        XML.SubElement(tab, "Container"),
        "DockSplitter",
        orientation="-",
        count=str(len(_PLOTS)),
        sizes=";".join([share] * len(_PLOTS)),
    )
    for style, curves in _PLOTS:
        area = XML.SubElement(splitter, "DockArea", name=curves[0][0])
        plot = XML.SubElement(
            area, "plot", mode="TimeSeries", style=style, flip_x="false", flip_y="false"
        )
        _add_range(plot, table, [name for name, _ in curves])
        XML.SubElement(plot, "limitY")
        for name, colour in curves:
            XML.SubElement(plot, "curve", name=f"{begins}{name}", color=colour)
    XML.SubElement(window, "currentTabIndex", index="0")
    XML.SubElement(root, "use_relative_time_offset", enabled="0")
    files = XML.SubElement(root, "previouslyLoaded_Datafiles")
    file = XML.SubElement(files, "fileInfo", filename=track.name, prefix="")
    if topics:
        settings = {**settings, "selected_topics": ";".join(topics)}
    XML.SubElement(XML.SubElement(file, "plugin", ID=plugin), element, settings)
    XML.indent(root)
    body = XML.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<!-- {MARK} -->\n{body}\n'


def _add_range(plot: XML.Element, table: pl.DataFrame, names: list[str]) -> None:
    """Show the whole drive, as high as the second half needs: a first mass has wide intervals."""
    values = table.select(names).to_numpy().astype(np.float64)
    values = values[values.shape[0] // 2 :]
    known = values[np.isfinite(values)]
    if not known.size:
        return
    time = table["time_s"]
    low, high = float(known.min()), float(known.max())
    room = 0.05 * (high - low) or 1.0
    sides = {"left": time[0], "right": time[-1], "bottom": low - room, "top": high + room}
    XML.SubElement(plot, "range", {side: f"{value:.6f}" for side, value in sides.items()})
