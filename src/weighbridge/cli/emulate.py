"""``weighbridge emulate``: devices that are not there, for trying ``live`` and ``record``."""

from __future__ import annotations

from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated, Final

from weighbridge.cli.listed import argument, option
from weighbridge.cli.options import DbcPaths, MappingPath, load
from weighbridge.cli.progress import in_place
from weighbridge.cli.terminal import say
from weighbridge.cli.verbosity import notice

if TYPE_CHECKING:
    from weighbridge.live import Played

_GLANCE: Final = 0.2
_WITHOUT: Final = {
    "nmea": "no position: the drive has none",
    "lines": "no inertial sensor: the drive has none",
}


def emulate(
    drive: Annotated[Path, argument("emulate DRIVE")],
    adapter: Annotated[int, option("emulate --elm", min=1, max=65535)] = 35000,
    receiver: Annotated[int, option("emulate --nmea", min=1, max=65535)] = 10110,
    sensor: Annotated[int, option("emulate --lines", min=1, max=65535)] = 5005,
    rate: Annotated[float, option("emulate --rate")] = 1.0,
    mapping: MappingPath = None,
    dbc: DbcPaths = None,
) -> None:
    """Play a drive as an ELM327 adapter, a GNSS receiver and an inertial sensor would send it.

    The drive starts with the first request to the adapter. All ports are open on this computer
    only. Ctrl-C ends it.

    Example: weighbridge emulate drive/ --rate 5
    """
    from weighbridge.live import Played, devices

    played = Played(load(drive, mapping, dbc), rate)
    stop = Event()
    with devices(played, adapter=adapter, receiver=receiver, sensor=sensor, stop=stop) as sources:
        for kind, words in _WITHOUT.items():
            if not any(source.startswith(kind) for source in sources):
                notice(words)
        live = ["weighbridge live --vehicle VEHICLE.toml", *(f"--source {s}" for s in sources)]
        say(" ".join(live if rate == 1.0 else [*live, f"--rate {rate:g}"]))
        notice("the vehicle begins to drive when this is typed in another terminal")
        with in_place() as draw:
            while not played.ended:
                if played.begun.wait(_GLANCE):
                    draw(lambda: progress_text(played))
                    stop.wait(_GLANCE)
        notice("the drive is over; end the other command with q or Ctrl-C")


def progress_text(played: Played) -> str:
    """Write the time of the drive, in minutes and seconds, and its share of the whole."""
    whole = played.end - played.start
    done = min(max(played.time - played.start, 0.0), whole)
    share = 100.0 * done / whole if whole > 0.0 else 100.0
    return f"driven {_clock(done)} of {_clock(whole)} min, {share:.0f} %"


def _clock(seconds: float) -> str:
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"
