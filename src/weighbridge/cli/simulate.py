"""``weighbridge simulate``: a drive with known truth, or the drives of a fleet."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from weighbridge.cli.fleet import RunsDrives, Unnamed
from weighbridge.cli.listed import FORMATS, argument, effect_names, one_of, option, scenario_names
from weighbridge.cli.progress import progress
from weighbridge.cli.results import inputs, refuse_folder, refuse_overwriting
from weighbridge.cli.terminal import say

app = typer.Typer(cls=RunsDrives, help="Simulate a drive, or the drives of a fleet.")


@app.command("run", cls=Unnamed, hidden=True)
def simulate(
    scenario: Annotated[str, argument("simulate SCENARIO", autocompletion=scenario_names)],
    output: Annotated[Path, option("simulate --output")],
    mass: Annotated[float | None, option("simulate --mass")] = None,
    seed: Annotated[int, option("--seed", min=0)] = 1,
    wind: Annotated[float | None, option("simulate --wind")] = None,
    wind_from: Annotated[float | None, option("simulate --wind-from")] = None,
    without: Annotated[
        list[str] | None, option("simulate --without", autocompletion=effect_names)
    ] = None,
    road: Annotated[
        str | None, option("simulate --road", autocompletion=one_of(*"ABCDEFGH"))
    ] = None,
    speed: Annotated[float | None, option("simulate --speed")] = None,
    table: Annotated[str, option("simulate --format", autocompletion=one_of(*FORMATS))] = "parquet",
    force: Annotated[bool, option("simulate --force")] = False,
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
    output: Annotated[Path, option("simulate fleet --output")],
    vehicles: Annotated[int, option("simulate fleet --vehicles")] = 50,
    days: Annotated[int, option("simulate fleet --days")] = 5,
    drives: Annotated[int, option("simulate fleet --drives")] = 4,
    minutes: Annotated[float, option("--minutes")] = 20.0,
    seed: Annotated[int, option("--seed", min=0)] = 1,
    start: Annotated[str, option("simulate fleet --start")] = "2026-05-04",
    drift: Annotated[float, option("simulate fleet --drift")] = 0.0,
    workers: Annotated[int | None, option("simulate fleet --workers")] = None,
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
