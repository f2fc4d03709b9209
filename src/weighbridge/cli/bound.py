"""``weighbridge bound``: at most so heavy, by speed, grade and the engine's full power."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from weighbridge.cli.listed import option
from weighbridge.cli.options import DbcPaths, JsonPath, MappingPath, OneDrive, chosen_mapping, load
from weighbridge.cli.results import asked_for, inputs, refuse_results, write_json
from weighbridge.cli.terminal import say


def bound(
    drive: OneDrive,
    vehicle: Annotated[Path, option("bound --vehicle")],
    power: Annotated[float, option("bound --power")],
    power_std: Annotated[float, option("bound --power-std")] = 5.0,
    json_path: JsonPath = None,
    mapping: MappingPath = None,
    dbc: DbcPaths = None,
) -> None:
    """Find an upper bound of the mass from speed, grade and the engine's full power.

    Needs a speed, and a grade (from a map) or heights, but no torque. An upper bound is not a
    weighing, because nothing shows that the engine gave its full power.
    Exit status: 0 if there is a bound, 1 if no climb or start is hard enough.

    Example: weighbridge bound climb/ --vehicle car.toml --power 60
    """
    from weighbridge.pipeline.speed_bounds import mass_bound
    from weighbridge.vehicle import Vehicle

    car = Vehicle.load(vehicle)
    chosen = chosen_mapping(car, vehicle, mapping)
    refuse_results(inputs([drive], vehicle, chosen, dbc), asked_for(json=json_path))
    read = load(drive, chosen, dbc)
    found = mass_bound(read, car, 1e3 * power, power_std=0.01 * power_std)
    if not write_json(json_path, found.to_json(read.name)):
        say(f"{read.name}: {found.reason}")
        if found.windows:
            say(
                f"at full power from {found.start:.0f} s on it would be {found.nearest:.0f} kg, "
                f"95 % between {found.nearest - 1.96 * found.nearest_std:.0f} and "
                f"{found.nearest + 1.96 * found.nearest_std:.0f} kg; "
                f"{found.windows} windows of the drive bound the mass"
            )
    if not found.windows:
        raise typer.Exit(1)
