"""``weighbridge simulate``: a drive with known truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from weighbridge.cli.options import refuse_overwriting


def simulate(
    scenario: Annotated[
        str,
        typer.Argument(
            help="car, car-calibration, car-short, car-loading, highway, compact, "
            "compact-calibration, electric, bus, bus-urban, bus-calibration, diesel, "
            "diesel-calibration, van, van-calibration, truck or truck-calibration.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder to write.", show_default=False)
    ],
    mass: Annotated[
        Optional[float],  # noqa: UP045  (typer reads the annotation at run time)
        typer.Option("--mass", help="Mass at the start in kg; the empty car's by default."),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of everything random.")] = 1,
    wind: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option("--wind", help="Mean wind at 10 m height in m/s."),
    ] = None,
    wind_from: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option("--wind-from", help="Where it blows from, degrees clockwise from north."),
    ] = None,
    without: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option("--without", help="Effect to switch off, such as squat; repeatable."),
    ] = None,
    table: Annotated[str, typer.Option("--format", help="csv or parquet.")] = "parquet",
    force: Annotated[bool, typer.Option("--force", help="Write into an existing folder.")] = False,
) -> None:
    """Simulate a drive and write it as a folder of tables, with its truth.

    Example: weighbridge simulate car -o drive/ --mass 1700 --seed 7 --wind 5 --wind-from 270
    """
    from dataclasses import replace

    from weighbridge.errors import ConfigError
    from weighbridge.signals.units import scalar_to_si
    from weighbridge.simulation import make_scenario, simulate_car

    refuse_overwriting(output, force, "folder")
    if table not in ("csv", "parquet"):
        raise ConfigError(f"--format {table}: must be csv or parquet")
    chosen = make_scenario(scenario, seed=seed)
    if mass is not None:
        chosen = replace(chosen, payload=mass - chosen.car.mass)
    if wind is not None:
        chosen = replace(chosen, wind_speed=wind)
    if wind_from is not None:
        chosen = replace(chosen, wind_from=scalar_to_si(wind_from, "deg"))
    if without:
        chosen = replace(chosen, effects=chosen.effects.without(*without))
    made = simulate_car(chosen)
    made.write(output, format=table)  # type: ignore[arg-type]
    minutes = made.drive.duration / 60.0
    typer.echo(f"{output}: {minutes:.1f} min, {made.truth.mass[0]:.0f} kg at the start")
