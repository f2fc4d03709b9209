"""``weighbridge weigh``: from drives and a vehicle file to masses."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Optional

import typer

from weighbridge.cli.options import (
    DbcPaths,
    DrivePaths,
    MappingPath,
    ReportPath,
    Whole,
    load_parts,
)
from weighbridge.cli.results import asked_for, inputs, refuse_results
from weighbridge.cli.terminal import complain, console, say, say_json, shown
from weighbridge.whole import is_stream

if TYPE_CHECKING:
    from rich.table import Table

    from weighbridge.pipeline.weighing import Weighing
    from weighbridge.vehicle.model import Vehicle

# Width of the table where no terminal gives one: a reason needs room.
_WIDTH = 160

# Warnings of one drive that are printed below a table of several.
_NOTED = 3


_VehiclePath = Annotated[
    Path, typer.Option("--vehicle", help="Vehicle file, as of calibrate.", show_default=False)
]
_Method = Annotated[str, typer.Option("--method", help="Estimator.")]
_Changes = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option(
        "--set",
        help="Change a setting of the estimator, such as forgetting=0.999; repeat it for more.",
        metavar="NAME=VALUE",
    ),
]
_Json = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option("--json", help="Write one JSON object per drive to a file, or - for here."),
]
_Track = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option("--track", help="Write the mass over time: .csv or .parquet. One drive."),
]
_Compare = Annotated[
    bool,
    typer.Option(
        "--compare", help="Weigh by every method; show them side by side, in the report too."
    ),
]


def weigh(
    drives: DrivePaths,
    vehicle: _VehiclePath,
    method: _Method = "joint",
    changes: _Changes = None,
    json_path: _Json = None,
    track: _Track = None,
    report: ReportPath = None,
    compare: _Compare = False,
    whole: Whole = False,
    mapping: MappingPath = None,
    dbc: DbcPaths = None,
) -> None:
    """Weigh a vehicle from one or more drives.

    A recording of several drives (a day's file, a splice) is parted, and each is weighed: it
    parts at pauses of 5 minutes, stops of 10, and jumps.
    Exits with 0 where every drive gave a mass, with 1 where one could not.

    Example: weighbridge weigh drive-1/ drive-2/ --vehicle car.toml --report weighed.html
    """
    from weighbridge.errors import ConfigError
    from weighbridge.estimators.settings import parsed
    from weighbridge.pipeline.given import mapping_of
    from weighbridge.vehicle.model import Vehicle
    from weighbridge.whole import write_whole

    if track is not None and len(drives) > 1:
        raise ConfigError("--track takes one drive; weigh them one by one, or use --json")
    car = Vehicle.load(vehicle)
    chosen = mapping_of(car, vehicle, mapping)
    refuse_results(
        inputs(drives, vehicle, chosen, dbc), asked_for(track=track, report=report, json=json_path)
    )
    weighed, failed = _weighed(
        drives,
        car,
        method,
        parsed(changes or []),
        chosen,
        dbc,
        whole=whole,
        alone=track is not None,
    )
    compared = [w.compare() for w in weighed] if compare else []
    if track is not None:
        weighed[0].write_track(track)
    if report is not None:
        from weighbridge.report import write_report

        if not weighed:
            raise ConfigError(f"--report {report}: none of the drives could be read")
        write_report(weighed, report, comparisons=compared)
    lines = [w.to_json() for w in weighed] + [
        _failure(name, why, car, method) for name, why in failed
    ]
    if json_path == "-":
        say_json("\n".join(lines))
    else:
        if json_path is not None:
            write_whole(json_path, "\n".join(lines) + "\n")
        _show(weighed, failed, compared)
    _tell_written([json_path, track, report], beside_json=json_path == "-")
    if failed:
        raise typer.Exit(2)
    if any(w.status != "converged" for w in weighed):
        raise typer.Exit(1)


def _weighed(
    drives: list[Path],
    car: Vehicle,
    method: str,
    settings: dict[str, object],
    mapping: Path | None,
    dbc: list[str] | None,
    *,
    whole: bool,
    alone: bool,
) -> tuple[list[Weighing], list[tuple[str, str]]]:
    """Weigh every drive of the recordings; name those that could not be, and why.

    ``alone`` refuses a recording of several drives.
    """
    from weighbridge.errors import ConfigError, WeighbridgeError
    from weighbridge.pipeline.weighing import weigh as weigh_drive

    weighed: list[Weighing] = []
    failed: list[tuple[str, str]] = []
    for path in _progress(drives):
        try:
            parts = load_parts(path, mapping, dbc, whole=whole)
        except WeighbridgeError as error:
            if len(drives) == 1:
                raise
            failed.append((path.name, str(error)))
            continue
        if alone and len(parts) > 1:
            raise ConfigError(
                f"--track takes one drive, and {path} holds {len(parts)}: use --json, or --whole "
                "to take them as one"
            )
        for drive in parts:
            try:
                weighed.append(weigh_drive(drive, car, method, settings=settings))
            except WeighbridgeError as error:
                if len(drives) == len(parts) == 1:
                    raise
                failed.append((drive.name if len(parts) > 1 else path.name, str(error)))
    return weighed, failed


def _tell_written(paths: list[str | Path | None], *, beside_json: bool) -> None:
    """Name the files that were written, out of the way of JSON on standard output."""
    for path in paths:
        if path is not None and str(path) != "-" and not is_stream(path):
            (complain if beside_json else say)(f"written: {path}")


def _progress(drives: list[Path]) -> Any:
    """Show a bar on a terminal while several drives are weighed."""
    if len(drives) == 1 or not sys.stderr.isatty():
        return drives
    from rich.progress import track

    return track(drives, description="weighing", console=console(stderr=True), transient=True)


def _failure(name: str, why: str, car: Vehicle, method: str) -> str:
    """Write the JSON object of a drive that could not be read, with the fields of the others."""
    from weighbridge.results.row import unread_row
    from weighbridge.visible import visible

    return unread_row(visible(name), car.name, method, why).to_json()


def _show(
    weighed: list[Weighing],
    failed: list[tuple[str, str]],
    compared: list[tuple[Weighing, ...]],
) -> None:
    screen = console()
    if not screen.is_terminal:
        screen.width = _WIDTH
    if len(weighed) == 1 and not failed:
        _show_one(weighed[0])
    else:
        screen.print(result_table(weighed, failed))
        for line in warning_lines(weighed):
            screen.print(f"  note: {shown(line)}", no_wrap=True, overflow="ellipsis")
    for methods in compared:
        screen.print(method_table(methods))
        if note := made_for(methods):
            say(f"  note: {note}")


def _show_one(w: Weighing) -> None:
    if w.status == "converged":
        low, high = w.interval(0.95)
        say(f"{w.drive.name}: {w.mass:.0f} kg, 95 % between {low:.0f} and {high:.0f} kg")
        if w.vehicle.tare is not None:
            say(f"payload {w.payload:.0f} kg over a tare of {w.vehicle.tare:.0f} kg")
        if w.load_changed:
            loads = ", then ".join(f"{s.mass:.0f} ± {1.96 * s.std:.0f} kg" for s in w.segments)
            say(f"the load changed: {loads}")
        minutes = w.used_time / 60.0
        say(f"from {minutes:.1f} min of {w.drive.duration / 60.0:.1f} min, method {w.method}")
    else:
        say(f"{w.drive.name}: no mass ({w.status}): {w.reason}")
    for warning in w.warnings:
        say(f"  note: {warning}")


def method_table(methods: tuple[Weighing, ...]) -> Table:
    """One row a method: its mass of one drive, or why there is none."""
    from rich.table import Table

    table = Table(title=shown(methods[0].drive.name), title_justify="left")
    table.add_column("method", no_wrap=True)
    for name in ("mass kg", "95 % from", "to", "payload kg"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("status or reason")
    for w in methods:
        table.add_row(w.method, *_numbers(w), _outcome(w))
    return table


def made_for(methods: tuple[Weighing, ...]) -> str:
    """Say which of the methods were run with a file made for another; empty where none was."""
    from weighbridge.estimators import ESTIMATORS

    fit = methods[0].vehicle.provenance.fit
    if fit is None or not fit.torque:
        return ""
    found = [w.method for w in methods if w.result is not None]
    others = [name for name in found if fit.name != ESTIMATORS[name].fits[0]]
    others = [name for name in others if not ESTIMATORS[name].speed_alone]
    if not others:
        return ""
    return (
        f"the vehicle file was calibrated for {fit.name}: {', '.join(others)} "
        f"{'were' if len(others) > 1 else 'was'} run with the torque of another method, which may "
        f"shift their masses; trust {fit.name}"
    )


def _numbers(w: Weighing) -> list[str]:
    """Mass, interval and payload; empty where there is none."""
    return [f"{x:.0f}" if x == x else "" for x in (w.mass, *w.interval(0.95), w.payload)]


def _outcome(w: Weighing) -> str:
    return str(w.status) if w.status == "converged" else shown(f"{w.status}: {w.reason}")


def warning_lines(weighed: list[Weighing]) -> list[str]:
    """Warnings of several drives, one line each: what all share once, at most `_NOTED` of each.

    How a recording was parted is not repeated: the names of its drives say it.
    """
    if not weighed:
        return []
    shared = set.intersection(*(set(w.warnings) for w in weighed)) if len(weighed) > 1 else set()
    lines = [
        f"every drive: {text}" for text in dict.fromkeys(weighed[0].warnings) if text in shared
    ]
    for w in weighed:
        parted = f"{w.drive.name.rsplit(' part ', 1)[0]} holds "
        own = [t for t in w.warnings if t not in shared and not t.startswith(parted)]
        lines += [f"{w.drive.name}: {text}" for text in own[:_NOTED]]
        if len(own) > _NOTED:
            lines.append(f"{w.drive.name}: {len(own) - _NOTED} more, told by --json")
    return lines


def result_table(weighed: list[Weighing], failed: list[tuple[str, str]]) -> Table:
    """One row a drive: its mass, or why there is none."""
    from rich.table import Table

    from weighbridge.vehicle.data_sheet import by_data_sheet
    from weighbridge.vehicle.telling import worth

    table = Table(title_justify="left")
    if weighed and by_data_sheet(weighed[0].vehicle):
        car = weighed[0].vehicle
        table.title = shown(f"{car.name} {worth(car)}")
    table.add_column("drive", no_wrap=True)
    table.add_column("min", justify="right")
    table.add_column("used", justify="right")
    for name in ("mass kg", "95 % from", "to", "payload kg"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("status or reason")
    for w in weighed:
        table.add_row(
            shown(w.drive.name),
            f"{w.drive.duration / 60.0:.1f}",
            f"{w.used_time / 60.0:.1f}",
            *_numbers(w),
            _outcome(w),
        )
    for name, why in failed:
        table.add_row(shown(name), "", "", "", "", "", "", shown(f"unreadable: {why}"))
    return table
