"""``weighbridge weigh``: from drives and a vehicle file to masses."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from weighbridge.cli.listed import method_names, option
from weighbridge.cli.options import (
    DbcPaths,
    DrivePaths,
    Elevation,
    MappingPath,
    ReportPath,
    Units,
    Whole,
    chosen_mapping,
    load_parts,
)
from weighbridge.cli.progress import Bar, progress
from weighbridge.cli.results import asked_for, inputs, refuse_results, write_json
from weighbridge.cli.terminal import console, say, say_notes, shown
from weighbridge.cli.verbosity import say_written
from weighbridge.customary import shown_amount, shown_unit
from weighbridge.whole import is_stream

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from weighbridge.messages import Problem
    from weighbridge.pipeline.weighing import Weighing
    from weighbridge.results.row import WeighingRow
    from weighbridge.signals import Drive
    from weighbridge.vehicle import Vehicle

# Width of the table where no terminal gives one: a reason needs room.
_WIDTH = 160

# Narrower, reasons stand below the table, and durations are left out.
_ROOMY = 110

# Time that a comparison and a report take, in weighings of the drive.
_COMPARING = 1.5
_REPORTING = 0.3

# Warnings of one drive that are printed below a table of several.
_NOTED = 3


def weigh(
    drives: DrivePaths,
    vehicle: Annotated[Path, option("--vehicle")],
    method: Annotated[str, option("--method", autocompletion=method_names)] = "joint",
    changes: Annotated[list[str] | None, option("weigh --set")] = None,
    json_path: Annotated[str | None, option("weigh --json")] = None,
    track: Annotated[Path | None, option("weigh --track")] = None,
    report: ReportPath = None,
    compare: Annotated[bool, option("weigh --compare")] = False,
    tiles: Annotated[str | None, option("weigh --tiles")] = None,
    units: Units = "si",
    whole: Whole = False,
    mapping: MappingPath = None,
    dbc: DbcPaths = None,
    elevation: Elevation = None,
) -> None:
    """Weigh a vehicle from one or more drives.

    A recording of several drives (such as a file of a whole day) is split at pauses of 5 minutes,
    at stops of 10 minutes and at jumps. Each drive is weighed.
    Exit status: 0 if every drive gave a mass, 1 if one did not.

    Example: weighbridge weigh drive-1/ drive-2/ --vehicle car.toml --report weighed.html
    """
    from weighbridge.errors import ConfigError
    from weighbridge.estimators import parsed
    from weighbridge.results.plotjuggler import layout_of
    from weighbridge.vehicle import Vehicle

    if track is not None and len(drives) > 1:
        raise ConfigError("--track takes one drive; weigh them one by one, or use --json")
    if tiles is not None:
        from weighbridge.report.tiles import Tiles

        if report is None:
            raise ConfigError("--tiles draws maps of a report; name it with --report FILE.html")
        Tiles(tiles)
    if track is not None:
        from weighbridge.io.write import require_writer

        require_writer(track)
    car = Vehicle.load(vehicle)
    chosen = chosen_mapping(car, vehicle, mapping)
    refuse_results(
        inputs(drives, vehicle, chosen, dbc), asked_for(track=track, report=report, json=json_path)
    )
    settings = parsed(changes or [])
    shares = 1.0 + _COMPARING * compare + _REPORTING * (report is not None)
    with progress("weighing", len(drives) * shares) as bar:
        given = partial(load_parts, mapping=chosen, dbc=dbc, whole=whole, elevation=elevation)
        whole_wanted = compare or report is not None or track is not None
        rows: list[WeighingRow] = []
        failed: list[tuple[str, Problem]] = []
        weighed: list[Weighing] = []
        for found in _weighed(drives, given, car, method, settings, bar, alone=track is not None):
            if isinstance(found, tuple):
                failed.append(found)
                continue
            rows.append(found.row)
            weighed += [found] if whole_wanted else []
        bar.total = len(drives) + len(weighed) * (shares - 1.0)
        compared = []
        for w in weighed if compare else []:
            bar.begin(f"weighing {w.drive.name} by every method", _COMPARING)
            compared.append(w.compare())
        if track is not None:
            weighed[0].write_track(track)
        if report is not None:
            from weighbridge.report import write_report

            if not weighed:
                raise ConfigError(f"--report {report}: none of the drives could be read")
            bar.begin("writing the report", len(weighed) * _REPORTING)
            write_report(weighed, report, comparisons=compared, tiles=tiles)
    lines = [row.to_json() for row in rows] + [
        _failure(name, why, car, method) for name, why in failed
    ]
    if not write_json(json_path, "\n".join(lines)):
        _show(rows, failed, compared, car)
    layout = layout_of(track) if track is not None else None
    _tell_written([json_path, track, layout, report], beside_json=json_path == "-")
    if failed:
        raise typer.Exit(2)
    if any(row.status != "converged" for row in rows):
        raise typer.Exit(1)


def _weighed(
    drives: list[Path],
    given: Callable[[Path], list[Drive]],
    car: Vehicle,
    method: str,
    settings: dict[str, object],
    bar: Bar,
    *,
    alone: bool,
) -> Iterator[Weighing | tuple[str, Problem]]:
    """Weigh every drive of the recordings, one by one; of one that cannot be, its name and why.

    ``given`` reads the drives of a recording, and ``alone`` refuses one of several.
    """
    from weighbridge.errors import ConfigError, WeighbridgeError
    from weighbridge.messages import Problem
    from weighbridge.pipeline.weighing import weigh as weigh_drive

    for path in drives:
        bar.begin(f"weighing {path.name}")
        try:
            parts = given(path)
        except WeighbridgeError as error:
            if len(drives) == 1:
                raise
            yield path.name, Problem.from_error(error)
            continue
        if alone and len(parts) > 1:
            raise ConfigError(
                f"--track takes one drive, and {path} holds {len(parts)}: use --json, or --whole "
                "to take them as one"
            )
        for k, drive in enumerate(parts):
            bar.within(k, len(parts))
            try:
                yield weigh_drive(drive, car, method, settings=settings)
            except WeighbridgeError as error:
                if len(drives) == len(parts) == 1:
                    raise
                yield drive.name if len(parts) > 1 else path.name, Problem.from_error(error)


def _tell_written(paths: list[str | Path | None], *, beside_json: bool) -> None:
    """Name the files that were written, out of the way of JSON on standard output."""
    for path in paths:
        if path is not None and str(path) != "-" and not is_stream(path):
            say_written(path, aside=beside_json)


def _failure(name: str, why: Problem, car: Vehicle, method: str) -> str:
    """Write the JSON object of a drive that could not be read, with the fields of the others."""
    from weighbridge.results.row import unread_row
    from weighbridge.visible import visible

    return unread_row(visible(name), car.name, method, why).to_json()


def _show(
    rows: list[WeighingRow],
    failed: list[tuple[str, Problem]],
    compared: list[tuple[Weighing, ...]],
    car: Vehicle,
) -> None:
    screen = console()
    if not screen.is_terminal:
        screen.width = _WIDTH
    narrow = screen.width < _ROOMY
    if len(rows) == 1 and not failed:
        _show_one(rows[0], car, screen)
    else:
        screen.print(result_table(rows, failed, car, narrow=narrow))
        if narrow:
            for line in reason_lines(rows, failed):
                screen.print(shown(line), highlight=False)
        say_notes(warning_lines(rows), screen)
    for methods in compared:
        screen.print(method_table(methods, narrow=narrow))
        without = [w for w in methods if w.status != "converged"]
        for w in without if narrow else ():
            screen.print(shown(f"{w.method}: no mass: {_reason(w.row)}"), highlight=False)
        if note := made_for(methods):
            say_notes([note], screen)


def _show_one(row: WeighingRow, car: Vehicle, screen: Console) -> None:
    from weighbridge.report.text import between, kg, with_half

    if row.status == "converged":
        low, high = row.interval
        say(f"{row.drive}: {kg(row.mass)}, 95 % between {between(low, high, 'and')}")
        if car.tare is not None:
            say(f"payload {kg(row.payload)} over a tare of {kg(car.tare)}")
        if row.load_changed:
            loads = ", then ".join(with_half(s.mass, 1.96 * s.std) for s in row.segments)
            say(f"the load changed: {loads}")
        minutes = row.used_time / 60.0
        say(f"from {minutes:.1f} min of {row.duration / 60.0:.1f} min, method {row.method}")
    else:
        say(f"{row.drive}: no mass ({row.status}): {_reason(row)}")
    if row.maker_mass == row.maker_mass:
        say(f"the vehicle itself reports {kg(row.maker_mass)}, which is not used")
    say_notes([p.shown for p in row.problems], screen)


def method_table(methods: tuple[Weighing, ...], *, narrow: bool = False) -> Table:
    """One row a method: its mass of one drive, or why there is none.

    A ``narrow`` one has the status alone, and no payload.
    """
    table = _table(narrow=narrow)
    table.title = shown(methods[0].drive.name)
    table.add_column("method", no_wrap=True)
    kept = 3 if narrow else 4
    _add_outcome_columns(table, kept, narrow=narrow)
    for w in methods:
        table.add_row(w.method, *_numbers(w.row)[:kept], _outcome(w.row, narrow=narrow))
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


def _numbers(row: WeighingRow) -> list[str]:
    """Mass, interval and payload; empty where there is none."""
    shown = (shown_amount(x, "kg") for x in (row.mass, *row.interval, row.payload))
    return [f"{x:.0f}" if x == x else "" for x in shown]


def _table(*, narrow: bool) -> Table:
    """Make an empty table; a narrow one spends no room on lines between the columns."""
    from rich import box
    from rich.table import Table

    if narrow:
        return Table(title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    return Table(title_justify="left")


def _add_outcome_columns(table: Table, kept: int, *, narrow: bool) -> None:
    """Add the first columns of numbers, and the outcome; a heading may break, a number may not."""
    unit = shown_unit("kg")
    for name in (f"mass {unit}", "95 % from", "to", f"payload {unit}")[:kept]:
        widest = max(map(len, name.split()))
        table.add_column(name, justify="right", min_width=max(widest, 5), no_wrap=not narrow)
    table.add_column("status" if narrow else "status or reason", no_wrap=narrow)


def _outcome(row: WeighingRow, *, narrow: bool) -> str:
    if narrow or row.status == "converged":
        return str(row.status)
    return shown(f"{row.status}: {_reason(row)}")


def _reason(row: WeighingRow) -> str:
    return "" if row.refusal is None else row.refusal.shown


def warning_lines(rows: list[WeighingRow]) -> list[str]:
    """Warnings of several drives, one line each: what all share once, at most `_NOTED` of each.

    How a recording was parted is not repeated: the names of its drives say it.
    """
    if not rows:
        return []
    said = [{p.shown: p for p in r.problems} for r in rows]
    shared = set.intersection(*map(set, said)) if len(rows) > 1 else set()
    lines = [f"every drive: {text}" for text in said[0] if text in shared]
    for row, texts in zip(rows, said, strict=True):
        own = [t for t, p in texts.items() if t not in shared and p.id != "file.part"]
        lines += [f"{row.drive}: {text}" for text in own[:_NOTED]]
        if len(own) > _NOTED:
            lines.append(f"{row.drive}: {len(own) - _NOTED} more, see --json")
    return lines


def reason_lines(rows: list[WeighingRow], failed: list[tuple[str, Problem]]) -> list[str]:
    """Say why drives have no mass, for a table that has no room for it."""
    without = [r for r in rows if r.status != "converged"]
    return [f"{r.drive}: no mass ({r.status}): {_reason(r)}" for r in without] + [
        why.text if name in why.text else f"{name}: {why.text}" for name, why in failed
    ]


def result_table(
    rows: list[WeighingRow],
    failed: list[tuple[str, Problem]],
    car: Vehicle,
    *,
    narrow: bool = False,
) -> Table:
    """One row a drive: its mass, or why there is none.

    A ``narrow`` one has the status alone, and not how long the drive was.
    """
    from weighbridge.vehicle import by_data_sheet
    from weighbridge.vehicle.description import worth

    table = _table(narrow=narrow)
    if rows and by_data_sheet(car):
        table.title = shown(f"{car.name} {worth(car)}")
    times = () if narrow else ("min", "used")
    table.add_column("drive", overflow="fold")
    for name in times:
        table.add_column(name, justify="right", no_wrap=True)
    _add_outcome_columns(table, 4, narrow=narrow)
    for row in rows:
        minutes = [f"{t / 60.0:.1f}" for t in (row.duration, row.used_time)]
        cells = (*minutes[: len(times)], *_numbers(row), _outcome(row, narrow=narrow))
        table.add_row(shown(row.drive), *cells)
    for name, why in failed:
        outcome = "unreadable" if narrow else shown(f"unreadable: {why.text}")
        table.add_row(shown(name), *[""] * (len(times) + 4), outcome)
    return table
