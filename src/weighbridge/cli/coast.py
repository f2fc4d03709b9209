"""``weighbridge coast``: drag over mass from coast-downs in opposite directions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from weighbridge.cli.listed import option
from weighbridge.cli.options import DbcPaths, JsonPath, MappingPath, OneDrive, chosen_mapping, load
from weighbridge.cli.results import asked_for, inputs, refuse_results, write_json
from weighbridge.cli.terminal import say


def coast(
    drive: OneDrive,
    there: Annotated[list[str], option("coast --there")],
    back: Annotated[list[str], option("coast --back")],
    vehicle: Annotated[Path | None, option("coast --vehicle")] = None,
    json_path: JsonPath = None,
    mapping: MappingPath = None,
    dbc: DbcPaths = None,
) -> None:
    """Find drag area over mass from coast-downs out of gear in opposite directions.

    Needs a speed, and a grade (from a map) or heights, but no torque. It does not give a mass.
    Wind along the road cancels between the two directions. Exit status: 0.

    Example: weighbridge coast run/ --there 10:40 --there 200:230 --back 90:120 --back 300:330
    """
    from weighbridge.pipeline.speed_bounds import coast_down
    from weighbridge.vehicle import Vehicle

    car = Vehicle.load(vehicle) if vehicle is not None else None
    chosen = chosen_mapping(car, vehicle, mapping)
    spans = [[_span(option, text) for text in texts]
             for option, texts in (("--there", there), ("--back", back))]  # fmt: skip
    refuse_results(inputs([drive], vehicle, chosen, dbc), asked_for(json=json_path))
    read = load(drive, chosen, dbc)
    found = coast_down(read, *spans, vehicle=car)
    if not write_json(json_path, found.to_json(read.name)):
        low, high = found.interval()
        say(
            f"{read.name}: drag area over mass {1e6 * found.drag_over_mass:.0f} mm²/kg, 95 % "
            f"between {1e6 * low:.0f} and {1e6 * high:.0f} mm²/kg"
        )
        low, high = found.rolling_interval()
        say(
            f"rolling resistance coefficient {found.rolling:.4f}, 95 % between {low:.4f} and "
            f"{high:.4f}, driveline drag taken in; a coast-down shows no mass"
        )


def _span(option: str, text: str) -> tuple[float, float]:
    """Read two instants [s].

    Raises
    ------
    ConfigError
        They are no two numbers.
    """
    from weighbridge.errors import ConfigError

    first, _, last = text.partition(":")
    try:
        return float(first), float(last)
    except ValueError:
        raise ConfigError(
            f"{option} {text}: give two instants in seconds, such as {option} 10:40"
        ) from None
