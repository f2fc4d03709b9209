"""``weighbridge inertia``: sprung mass, roll and pitch inertia from the ride."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Optional

import typer

from weighbridge.cli.options import (
    DbcPaths,
    MappingPath,
    ReportPath,
    load,
)
from weighbridge.cli.results import asked_for, inputs, refuse_results
from weighbridge.cli.terminal import say, say_json

if TYPE_CHECKING:
    from weighbridge.pipeline.inertia import Inertia


def inertia(
    drive: Annotated[
        Path, typer.Argument(help="Drive: folder of tables, or log file.", show_default=False)
    ],
    vehicle: Annotated[
        Path,
        typer.Option("--vehicle", help="Vehicle file with its suspension.", show_default=False),
    ],
    method: Annotated[
        str,
        typer.Option(
            "--method",
            help="kalman-bucy, or with one fixed process noise inverse, extended, printed.",
        ),
    ] = "kalman-bucy",
    json_path: Annotated[
        Optional[str],  # noqa: UP045  (typer reads the annotation at run time)
        typer.Option("--json", help="Write a JSON object to a file, or - for here."),
    ] = None,
    track: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--track", help="Write the parameters over time: .csv or .parquet."),
    ] = None,
    report: ReportPath = None,
    mapping: MappingPath = None,
    dbc: DbcPaths = None,
) -> None:
    """Estimate sprung mass, roll and pitch inertia from how a vehicle rides.

    Needs suspension travel and rate at four wheels and the body's vertical, roll and pitch
    velocity. Exits with 0 where the ride gave a mass, with 1 where it could not.

    Example: weighbridge inertia ride/ --vehicle truck.toml --report ride.html
    """
    from weighbridge.pipeline.given import mapping_of
    from weighbridge.pipeline.inertia import estimate_inertia
    from weighbridge.vehicle.model import Vehicle
    from weighbridge.whole import write_whole

    car = Vehicle.load(vehicle)
    chosen = mapping_of(car, vehicle, mapping)
    refuse_results(
        inputs([drive], vehicle, chosen, dbc), asked_for(track=track, report=report, json=json_path)
    )
    found = estimate_inertia(load(drive, chosen, dbc), car, method)
    if track is not None:
        found.write_track(track)
    if report is not None:
        found.report(report)
    if json_path == "-":
        say_json(found.to_json())
    else:
        if json_path is not None:
            write_whole(json_path, found.to_json() + "\n")
        _show(found)
    if found.status != "converged":
        raise typer.Exit(1)


def _show(found: Inertia) -> None:
    name = found.drive.name
    if found.status == "converged":
        low, high = found.intervals()
        for k, (what, unit) in enumerate(
            (("sprung mass", "kg"), ("roll inertia", "kg m²"), ("pitch inertia", "kg m²"))
        ):
            if found.values[k] == found.values[k]:
                say(
                    f"{name}: {what} {found.values[k]:.0f} {unit}, "
                    f"95 % between {low[k]:.0f} and {high[k]:.0f} {unit}"
                )
        front, rear = found.axle_loads
        lightest, heaviest = found.mass_interval()
        say(
            f"mass {found.mass:.0f} kg, 95 % between {lightest:.0f} and {heaviest:.0f} kg: "
            f"front axle {front:.0f} kg, rear axle {rear:.0f} kg"
        )
        if found.vehicle.tare is not None:
            say(f"payload {found.payload:.0f} kg over a tare of {found.vehicle.tare:.0f} kg")
        if len(found.segments) > 1:
            say("the load changed:")
            for s in found.segments:
                say(f"  {s.start:.1f} to {s.end:.1f} s: sprung mass {s.values[0]:.0f} kg")
    else:
        say(f"{name}: no mass ({found.status}): {found.reason}")
    for warning in found.warnings:
        say(f"  note: {warning}")
