"""``weighbridge record``: samples of live sources as a drive."""

from __future__ import annotations

import contextlib
import select
import sys
from collections.abc import Callable
from pathlib import Path
from threading import Event
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Final

import typer

from weighbridge.cli.listed import option, source_kinds
from weighbridge.cli.options import (
    DbcPaths,
    KeepDays,
    MappingPath,
    SplitMb,
)
from weighbridge.cli.progress import in_place
from weighbridge.cli.terminal import complain, console, ended_by_signals
from weighbridge.cli.verbosity import notice, say_written, watched
from weighbridge.errors import ConfigError, DriveError

if TYPE_CHECKING:
    from rich.table import Table

    from weighbridge.live import Arrivals, Feed, Need, Recorder, Recordings

_WAIT: Final = 0.25
"""How long samples are waited for at once [s]."""

_LEAST_CHECK: Final = 3.0
"""So long signals are looked at for their rate, also where all have come [s]."""

_REPORTED: Final = 60.0
"""Without a terminal a line comes so often [s]."""


def record(
    source: Annotated[list[str], option("record --source", autocompletion=source_kinds)],
    output: Annotated[Path, option("record --output")],
    vehicle: Annotated[Path | None, option("record --vehicle")] = None,
    mapping: MappingPath = None,
    dbc: DbcPaths = None,
    listen_only: Annotated[bool, option("record --listen-only")] = False,
    check: Annotated[float, option("record --check", min=0.0)] = 20.0,
    duration: Annotated[float | None, option("record --duration", min=0.0)] = None,
    split_mb: SplitMb = None,
    keep_days: KeepDays = None,
) -> None:
    """Record live sources as a drive, after a check that all signals arrive.

    After a power cut less than the last minute is missing. Ctrl-C ends the recording.

    Example: weighbridge record --source elm:/dev/ttyUSB0 --source gpsd:localhost:2947 -o drive/
    """
    from weighbridge.live import Feed, Recorder, needs, parse_source
    from weighbridge.live.recordings import recordings
    from weighbridge.signals import DriveInfo
    from weighbridge.vehicle import Vehicle

    car = Vehicle.load(vehicle) if vehicle is not None else None
    sources = [
        parse_source(s, dbc=tuple(dbc or ()), mapping=mapping, listen_only=listen_only)
        for s in source
    ]
    info = DriveInfo(vehicle=car.name if car is not None else None)
    recorder: Recorder | Recordings
    if split_mb is None and keep_days is None:
        recorder = Recorder(output, info)
    else:
        recorder = recordings(output, info, split_mb=split_mb, keep_days=keep_days)
    with recorder, Feed(sources) as feed:
        look(feed, needs(car), check)
        until = monotonic() + duration if duration is not None else float("inf")
        stop = Event()
        with ended_by_signals(stop):
            arrived = run(feed, recorder, lambda: stop.is_set() or monotonic() >= until)
    if recorder.problem:
        raise DriveError(recorder.problem)
    if not arrived.count:
        raise DriveError(f"{output}: nothing was recorded, no sample came; check the sources")
    folders = [output] if isinstance(recorder, Recorder) else recorder.folders
    to = f" to {folders[-1]}" if len(folders) > 1 else ""
    say_written(f"{folders[0]}{to}, {len(arrived.names)} signals, {arrived.count} samples")


def look(feed: Feed, wanted: tuple[Need, ...], seconds: float) -> None:
    """Wait until all that is needed arrives; ask on a terminal, show elsewhere, what does not.

    Raises
    ------
    ConfigError
        The person at the terminal wants no drive without it.
    DriveError
        Nothing came at all, and nobody is there to ask.
    """
    from weighbridge.live import Arrivals

    if not seconds:
        return
    arrivals = Arrivals()
    begun = monotonic()
    with in_place() as draw:
        while not feed.ended and monotonic() - begun < seconds:
            arrivals.add(feed.read(_WAIT))
            draw(lambda: arrival_table(wanted, arrivals))
            whole = not any(arrivals.of(need).lacking for need in wanted)
            if whole and monotonic() - begun >= min(_LEAST_CHECK, seconds):
                break
    asked = sys.stdin.isatty() and sys.stderr.isatty()
    if not arrivals.count and not asked:
        lost = [f"{state.name}: {state.error}" for state in feed.states() if state.error]
        raise DriveError(
            f"no sample came within {seconds:g} s ({'; '.join(lost)}); check the sources, or give "
            "--check 0 to wait for them"
        )
    missing = [found for need in wanted if (found := arrivals.of(need)).lacking]
    for state in feed.states():
        if state.error:
            complain(f"{state.name}: {state.error}")
    for found in missing:
        such = "such as " if len(found.need.sets) > 1 else ""
        names = ", ".join(found.lacking)
        complain(f"no {found.need.name} ({such}{names}) has come; {found.need.why}")
    if missing and asked:
        names = ", ".join(found.need.name for found in missing)
        if not _confirmed(f"Record without {names}?"):
            raise ConfigError(f"not recorded: {names} did not come; check the sources")


def _confirmed(question: str) -> bool:
    """Ask a person; Ctrl-C ends it at once, whichever thread the system shows it."""
    try:
        waiting = [sys.stdin.fileno()]
    except (AttributeError, OSError, ValueError):
        waiting = []
    if sys.platform == "win32" or not waiting:
        return typer.confirm(question, err=True)
    sys.stderr.write(f"{question} [y/N]: ")
    sys.stderr.flush()
    while not select.select(waiting, [], [], _WAIT)[0]:
        pass
    return sys.stdin.readline().strip().lower() in ("y", "yes")


def run(feed: Feed, recorder: Recorder | Recordings, ended: Callable[[], bool]) -> Arrivals:
    """Record until it is ended, the sources have no more or the disk is full; show how it goes."""
    from weighbridge.live import Arrivals

    arrivals = Arrivals()
    begun = reported = monotonic()
    screen = console(stderr=True)
    try:
        with screen.status("recording") if watched() else contextlib.nullcontext() as line:
            while not (ended() or feed.ended or recorder.problem):
                blocks = feed.read(_WAIT)
                for samples in blocks:
                    recorder.put(samples)
                recorder.tick()
                arrivals.add(blocks)
                if line is not None:
                    line.update(_reported(feed, arrivals, monotonic() - begun))
                elif monotonic() - reported >= _REPORTED:
                    reported = monotonic()
                    notice(_reported(feed, arrivals, reported - begun))
    finally:
        recorder.close()
    return arrivals


def _reported(feed: Feed, arrivals: Arrivals, seconds: float) -> str:
    minutes, rest = divmod(int(seconds), 60)
    text = f"recording {minutes}:{rest:02d}, {arrivals.count} samples of {len(arrivals.names)} "
    lost = [f"{state.name}: {state.error}" for state in feed.states() if state.error]
    return "; ".join((f"{text}signals, Ctrl-C ends", *lost))


def arrival_table(wanted: tuple[Need, ...], arrivals: Arrivals) -> Table:
    """Lay out what is needed, whether it comes and how fast."""
    from rich.table import Table

    table = Table(title="Before recording: what arrives", title_justify="left")
    table.add_column("needed", no_wrap=True)
    table.add_column("", no_wrap=True)
    table.add_column("Hz", justify="right", no_wrap=True)
    table.add_column("signals")
    for need in wanted:
        found = arrivals.of(need)
        rate = f"{found.rate:.1f}" if found.rate == found.rate else ""
        state = "[yellow]waiting[/]" if found.lacking else "[green]comes[/]"
        names = ", ".join(found.lacking or found.signals)
        table.add_row(need.name, state, rate, names)
    return table
