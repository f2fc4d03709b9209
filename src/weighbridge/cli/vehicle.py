"""``weighbridge vehicle``: a vehicle file from what an owner knows, and what a file says."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Optional

import typer

from weighbridge.cli.listed import ListsNames, argument, class_names, one_of, option, source_names
from weighbridge.cli.options import MappingPath
from weighbridge.cli.results import Result, inputs, refuse_overwriting, refuse_results
from weighbridge.cli.terminal import console, say, shown
from weighbridge.cli.verbosity import say_written

if TYPE_CHECKING:
    from weighbridge.vehicle import Vehicle

app = typer.Typer(no_args_is_help=True, help="Write a vehicle file, or explain an existing one.")

_Text = Optional[str]  # noqa: UP045  (typer reads the annotation at run time)
_Number = Optional[float]  # noqa: UP045


@app.command(cls=ListsNames)
def new(
    output: Annotated[Path, option("--output")],
    kind: Annotated[str, option("vehicle --class", autocompletion=class_names)] = "car",
    name: Annotated[str, option("vehicle --name")] = "vehicle",
    engine: Annotated[
        str | None,
        option("vehicle --engine", autocompletion=one_of("petrol", "diesel", "electric")),
    ] = None,
    tare: Annotated[float | None, option("vehicle --tare")] = None,
    gross: Annotated[float | None, option("vehicle --gross")] = None,
    tyre: Annotated[str | None, option("vehicle --tyre")] = None,
    radius: Annotated[float | None, option("vehicle --radius")] = None,
    driven: Annotated[
        str | None, option("vehicle --driven", autocompletion=one_of("front", "rear", "all"))
    ] = None,
    gear_ratios: Annotated[str | None, option("vehicle --gear-ratios")] = None,
    final_drive: Annotated[float | None, option("vehicle --final-drive")] = None,
    torque: Annotated[str | None, option("--torque", autocompletion=source_names)] = None,
    reference_torque: Annotated[float | None, option("vehicle --reference-torque")] = None,
    drag_coefficient: Annotated[float | None, option("vehicle --drag-coefficient")] = None,
    frontal_area: Annotated[float | None, option("vehicle --frontal-area")] = None,
    layout: Annotated[
        str | None, option("vehicle --layout", autocompletion=one_of("transverse", "longitudinal"))
    ] = None,
    mapping: MappingPath = None,
    force: Annotated[bool, option("--force")] = False,
) -> None:
    """Write a vehicle file from what an owner knows; other values are usual ones of the class.

    Example: weighbridge vehicle new --class van --tare 2150 --gross 3500 --tyre "235/65 R16"
    -o van.toml
    """
    from weighbridge.pipeline.given import mapping_beside
    from weighbridge.signals.tomlfile import Faults
    from weighbridge.vehicle import Known, describe, save_vehicle

    refuse_results(inputs(mapping=mapping), [Result("--output", output, "vehicle file")])
    refuse_overwriting(output, force, "vehicle file")
    faults = Faults()
    ratios: tuple[float, ...] = ()
    with faults.gathered():
        ratios = _ratios(gear_ratios)
    unread = bool(faults.said)
    known = Known(
        name=name,
        kind=kind,
        engine=engine,  # type: ignore[arg-type]
        tare=tare,
        gross=gross,
        tyre=tyre,
        radius=radius,
        driven=driven,  # type: ignore[arg-type]
        gear_ratios=ratios,
        # Without the ratios nothing is to be said of what belongs to them.
        final_drive=None if unread else final_drive,
        torque=torque,
        reference_torque=reference_torque,
        drag_coefficient=drag_coefficient,
        frontal_area=frontal_area,
        layout=layout,  # type: ignore[arg-type]
        mapping=mapping_beside(mapping, output) if mapping is not None else None,
    )
    with faults.gathered():
        made = describe(known)
    faults.refuse()
    save_vehicle(made.vehicle, output, made.origins)
    _print(output, made.vehicle)
    say_written(output)


@app.command()
def show(
    path: Annotated[Path, argument("vehicle PATH")],
) -> None:
    """Explain in words what a vehicle file says, and how good it is.

    Example: weighbridge vehicle show car.toml
    """
    from weighbridge.vehicle import Vehicle

    _print(path, Vehicle.load(path))


def _ratios(text: str | None) -> tuple[float, ...]:
    from weighbridge.errors import ConfigError

    if text is None:
        return ()
    try:
        return tuple(float(part) for part in text.replace(",", " ").split())
    except ValueError:
        raise ConfigError(
            f"--gear-ratios {text}: must be numbers, such as 3.77,2.09,1.32,0.98,0.78"
        ) from None


def _print(path: Path, vehicle: Vehicle) -> None:
    from rich.table import Table

    from weighbridge.vehicle import by_data_sheet
    from weighbridge.vehicle.description import can_weigh, tell

    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    for heading, sentence in tell(vehicle):
        table.add_row(heading, shown(sentence))
    console().print(table)
    weighs = can_weigh(vehicle)
    read = "".join(f" --dbc {dbc}" for dbc in _dbcs(path, vehicle))
    if weighs:
        say(f"next: weighbridge weigh DRIVE --vehicle {path}{read}")
    if not weighs or by_data_sheet(vehicle):
        lead = "better" if weighs else "next"
        say(
            f"{lead}: weighbridge calibrate DRIVE --mass KG --vehicle {path}{read} "
            "-o calibrated.toml"
        )


def _dbcs(path: Path, vehicle: Vehicle) -> list[str]:
    """DBC files that the calibration was given, as a command names them from here."""
    from weighbridge.io.dbc import seen_from

    return [shlex.quote(shown(seen_from(dbc, path.parent))) for dbc in vehicle.provenance.dbc]
