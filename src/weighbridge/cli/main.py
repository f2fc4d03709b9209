"""The command ``weighbridge``."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from weighbridge import __version__
from weighbridge.cli import (
    calibrate,
    convert,
    demo,
    inertia,
    inspect,
    reproduce,
    simulate,
    vehicle,
    weigh,
)
from weighbridge.errors import WeighbridgeError

app = typer.Typer(
    name="weighbridge",
    help="Weigh a road vehicle while it drives, from data it already has.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    epilog="Start with: weighbridge demo",
)

for _command in (demo.demo, inspect.inspect, calibrate.calibrate, weigh.weigh):
    app.command()(_command)
app.command()(inertia.inertia)
app.command()(simulate.simulate)
app.command()(convert.convert)
app.command()(reproduce.reproduce)
app.add_typer(vehicle.app, name="vehicle")


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"weighbridge {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """Weigh a road vehicle while it drives, from data it already has."""


def run() -> None:
    """Run the command line; a mistake of the caller is one line and exit status 2."""
    try:
        app()
    except WeighbridgeError as error:
        typer.echo(f"weighbridge: {error}", err=True)
        sys.exit(2)
