"""``weighbridge emulate``: devices that are not there, for trying ``live`` and ``record``."""

from __future__ import annotations

from pathlib import Path
from threading import Event
from typing import Annotated, Final

import typer

from weighbridge.cli.options import DbcPaths, MappingPath, load
from weighbridge.cli.terminal import complain, say

_GLANCE: Final = 0.2
_WITHOUT: Final = {
    "nmea": "no position: the drive has none",
    "lines": "no inertial sensor: the drive has none",
}


def emulate(
    drive: Annotated[Path, typer.Argument(help="Recorded or simulated drive.", show_default=False)],
    adapter: Annotated[
        int, typer.Option("--elm", min=1, max=65535, help="TCP port of the ELM327 adapter.")
    ] = 35000,
    receiver: Annotated[
        int, typer.Option("--nmea", min=1, max=65535, help="TCP port of the GNSS receiver.")
    ] = 10110,
    sensor: Annotated[
        int,
        typer.Option("--lines", min=1, max=65535, help="UDP port the inertial sensor sends to."),
    ] = 5005,
    rate: Annotated[
        float, typer.Option("--rate", help="1 as recorded, 5 fivefold; live needs the same.")
    ] = 1.0,
    mapping: MappingPath = None,
    dbc: DbcPaths = None,
) -> None:
    """Let a drive come out of an ELM327 adapter, a GNSS receiver and an inertial sensor.

    The vehicle begins to drive when the adapter is first asked. All ports are of this computer
    alone. Ctrl-C ends it.

    Example: weighbridge emulate drive/ --rate 5
    """
    from weighbridge.live.emulator.devices import devices
    from weighbridge.live.emulator.played import Played

    played = Played(load(drive, mapping, dbc), rate)
    stop = Event()
    with devices(played, adapter=adapter, receiver=receiver, sensor=sensor, stop=stop) as sources:
        for kind, words in _WITHOUT.items():
            if not any(source.startswith(kind) for source in sources):
                complain(words)
        say("weighbridge live --vehicle VEHICLE.toml" + _options(sources, rate))
        complain("the vehicle begins to drive when this is typed in another terminal")
        while not played.ended:
            if played.begun.wait(_GLANCE):
                stop.wait(_GLANCE)
        complain("the drive is over; end the other command with q or Ctrl-C")


def _options(sources: list[str], rate: float) -> str:
    words = "".join(f" --source {source}" for source in sources)
    return words if rate == 1.0 else f"{words} --rate {rate:g}"
