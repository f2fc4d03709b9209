"""``weighbridge inertia``: sprung mass, roll and pitch inertia from the ride."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from weighbridge.cli.listed import filter_names, option
from weighbridge.cli.options import (
    DbcPaths,
    JsonPath,
    MappingPath,
    OneDrive,
    ReportPath,
    chosen_mapping,
    load,
)
from weighbridge.cli.results import asked_for, inputs, refuse_results, write_json
from weighbridge.cli.terminal import say

if TYPE_CHECKING:
    from weighbridge.pipeline.inertia import Inertia


def inertia(
    drive: OneDrive,
    vehicle: Annotated[Path, option("inertia --vehicle")],
    method: Annotated[str, option("inertia --method", autocompletion=filter_names)] = "kalman-bucy",
    settings: Annotated[list[str] | None, option("inertia --set")] = None,
    json_path: JsonPath = None,
    track: Annotated[Path | None, option("inertia --track")] = None,
    report: ReportPath = None,
    mapping: MappingPath = None,
    dbc: DbcPaths = None,
) -> None:
    """Estimate sprung mass, roll and pitch inertia from the ride of a vehicle.

    Needs suspension travel and rate at four wheels and the body's vertical, roll and pitch
    velocity. Exit status: 0 if the ride gave a mass, 1 if it did not.

    Example: weighbridge inertia ride/ --vehicle truck.toml --report ride.html
    """
    from weighbridge.estimators import parsed
    from weighbridge.pipeline.inertia import estimate_inertia
    from weighbridge.vehicle import Vehicle

    changes = parsed(settings or ())
    car = Vehicle.load(vehicle)
    chosen = chosen_mapping(car, vehicle, mapping)
    refuse_results(
        inputs([drive], vehicle, chosen, dbc),
        asked_for(ride_track=track, report=report, json=json_path),
    )
    found = estimate_inertia(load(drive, chosen, dbc), car, method, settings=changes)
    if track is not None:
        found.write_track(track)
    if report is not None:
        found.report(report)
    if not write_json(json_path, found.to_json()):
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
        say(f"mass {found.mass:.0f} kg, {_between(found.mass_interval())}")
        for axle, load_, interval in zip(
            ("front", "rear"), found.axle_loads, found.axle_load_intervals(), strict=True
        ):
            say(f"{axle} axle {load_:.0f} kg, {_between(interval)}")
        if found.vehicle.tare is not None:
            say(
                f"payload {found.payload:.0f} kg over a tare of {found.vehicle.tare:.0f} kg, "
                f"{_between(found.payload_interval())}"
            )
        if len(found.segments) > 1:
            from weighbridge.signals.instants import span

            say("the load changed:")
            for s in found.segments:
                when = span(round(s.start, 1), round(s.end, 1))
                say(f"  {when}: sprung mass {s.values[0]:.0f} kg")
    else:
        say(f"{name}: no mass ({found.status}): {found.reason}")
    for warning in found.warnings:
        say(f"  note: {warning}")


def _between(interval: tuple[float, float]) -> str:
    low, high = interval
    return f"95 % between {low:.0f} and {high:.0f} kg"
