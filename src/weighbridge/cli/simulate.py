"""``weighbridge simulate``: a drive with known truth, or the drives of a fleet."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from weighbridge.cli.fleet import RunsDrives, Unnamed
from weighbridge.cli.listed import FORMATS, effect_names, one_of, scenario_names
from weighbridge.cli.progress import progress
from weighbridge.cli.results import inputs, refuse_folder, refuse_overwriting
from weighbridge.cli.terminal import say

app = typer.Typer(cls=RunsDrives, help="Simulate a drive, or the drives of a fleet.")


@app.command("run", cls=Unnamed, hidden=True)
def simulate(
    scenario: Annotated[
        str,
        typer.Argument(
            help="car, car-calibration, car-short, car-loading, highway, compact, "
            "compact-calibration, electric, bus, bus-urban, bus-calibration, diesel, "
            "diesel-calibration, cvt, cvt-calibration, hybrid, hybrid-calibration, van, "
            "van-calibration, truck, truck-calibration or ride; fleet has options of its own: "
            "weighbridge simulate fleet --help.",
            autocompletion=scenario_names,
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
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of all random numbers.")] = 1,
    wind: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option("--wind", help="Mean wind at 10 m height in m/s."),
    ] = None,
    wind_from: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option("--wind-from", help="Where wind comes from, degrees clockwise from north."),
    ] = None,
    without: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--without",
            help="Effect to switch off, such as squat; repeat it for more.",
            autocompletion=effect_names,
        ),
    ] = None,
    road: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--road",
            help="For ride: ISO 8608 class A to H; C by default.",
            autocompletion=one_of(*"ABCDEFGH"),
        ),
    ] = None,
    speed: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option("--speed", help="For ride: speed in km/h; 60 by default."),
    ] = None,
    table: Annotated[
        str,
        typer.Option("--format", help="Tables: csv or parquet.", autocompletion=one_of(*FORMATS)),
    ] = "parquet",
    force: Annotated[bool, typer.Option("--force", help="Write into an existing folder.")] = False,
) -> None:
    """Simulate a drive and write it as a folder of tables, with the true values.

    Example: weighbridge simulate car -o drive/ --mass 1700 --seed 7 --wind 5 --wind-from 270
    """
    from dataclasses import replace

    from weighbridge.arguments import check_choice
    from weighbridge.errors import ConfigError
    from weighbridge.signals import scalar_to_si
    from weighbridge.simulation import make_scenario, simulate_car

    refuse_folder(inputs(), output)
    refuse_overwriting(output, force, "folder")
    check_choice("--format", table, FORMATS)
    if scenario == "ride":
        if wind is not None or wind_from is not None or without:
            raise ConfigError("a ride knows no --wind, --wind-from and --without; leave them out")
        _simulate_ride(output, mass, seed, road, speed, table)
        return
    if road is not None or speed is not None:
        raise ConfigError(f"--road and --speed are for the scenario ride, not for {scenario}")
    chosen = make_scenario(scenario, seed=seed)
    if mass is not None:
        chosen = replace(chosen, payload=mass - chosen.car.mass)
    if wind is not None:
        chosen = replace(chosen, wind_speed=wind)
    if wind_from is not None:
        chosen = replace(chosen, wind_from=scalar_to_si(wind_from, "deg"))
    if without:
        chosen = replace(chosen, effects=chosen.effects.without(*without))
    with progress(f"simulating {scenario}", 1.2) as bar:
        bar.begin(f"simulating {scenario}")
        made = simulate_car(chosen, bar.within)
        bar.begin(f"writing {output}", 0.2)
        made.write(output, format=table)  # type: ignore[arg-type]
    minutes = made.drive.duration / 60.0
    say(f"{output}: {minutes:.1f} min, {made.truth.mass[0]:.0f} kg at the start")


@app.command()
def fleet(
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", help="Folder to write; it must not exist yet.", show_default=False
        ),
    ],
    vehicles: Annotated[int, typer.Option("--vehicles", help="Number of vehicles.")] = 50,
    days: Annotated[int, typer.Option("--days", help="Number of days.")] = 5,
    drives: Annotated[
        int, typer.Option("--drives", help="Number of drives per vehicle and day.")
    ] = 4,
    minutes: Annotated[
        float, typer.Option("--minutes", help="Length of a drive in minutes.")
    ] = 20.0,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of all random numbers.")] = 1,
    start: Annotated[str, typer.Option("--start", help="Date of the first day.")] = "2026-05-04",
    drift: Annotated[
        float,
        typer.Option(
            "--drift",
            help="Drift of the torque reading of every third vehicle, from the first to the "
            "last day, in %.",
        ),
    ] = 0.0,
    workers: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option("--workers", help="Processes; one per core by default."),
    ] = None,
) -> None:
    """Simulate days of trucks, vans, buses and cars: loads, overloads, trailers, broken sensors.

    Writes drives, vehicle files, drives.csv, tickets.csv of weighed departures and truth.csv.
    The same seed gives the same files, with any number of processes.

    Example: weighbridge simulate fleet -o fleet/ --vehicles 10 --days 2 --minutes 10
    """
    from weighbridge.simulation.fleet import FleetSettings
    from weighbridge.simulation.fleet_files import write_fleet

    settings = FleetSettings(
        vehicles=vehicles,
        days=days,
        drives=drives,
        minutes=minutes,
        seed=seed,
        start=start,
        drift=drift / 100.0,
    )
    with progress("simulating the drives") as bar:
        count = write_fleet(output, settings, workers=workers, tell=bar.tell)
    say(f"{output}: {count} drives of {vehicles} vehicles; weigh them with")
    say(f"  weighbridge fleet {output}/drives.csv --vehicles {output}/vehicles -o RESULTS")


def _simulate_ride(
    output: Path,
    mass: float | None,
    seed: int,
    road: str | None,
    speed: float | None,
    table: str,
) -> None:
    """Simulate and write the ride of a two-axle truck on a rough road."""
    from weighbridge.errors import ConfigError
    from weighbridge.signals import scalar_to_si
    from weighbridge.simulation import TRUCK, RideScenario, simulate_ride

    sprung = TRUCK.sprung_mass if mass is None else mass - sum(TRUCK.unsprung_mass)
    if not sprung > 0.0:
        raise ConfigError(f"--mass {mass}: axles and wheels alone are {sum(TRUCK.unsprung_mass)}")
    made = simulate_ride(
        RideScenario(
            vehicle=TRUCK.loaded(sprung / TRUCK.sprung_mass),
            road_class=road or "C",
            speed=scalar_to_si(60.0 if speed is None else speed, "kmh"),
            zero_mass=TRUCK.sprung_mass,
            seed=seed,
        )
    )
    made.write(output, format=table)  # type: ignore[arg-type]
    say(f"{output}: {made.drive.duration:.0f} s, {made.scenario.vehicle.mass:.0f} kg")
