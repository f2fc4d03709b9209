"""``weighbridge map``: describe a foreign log without writing TOML by hand."""

from __future__ import annotations

import difflib
import shlex
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from weighbridge.cli.listed import argument, option
from weighbridge.cli.options import DbcPaths
from weighbridge.cli.progress import each
from weighbridge.cli.results import Result, inputs, refuse_overwriting, refuse_results
from weighbridge.cli.terminal import complain, console, say, shown
from weighbridge.cli.verbosity import notice, quiet, say_written

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from rich.console import Console

    from weighbridge.io import Draft
    from weighbridge.io.dbc import Database
    from weighbridge.io.draft_column import DraftColumn
    from weighbridge.io.draft_time import DraftTime

_NONE = "none"
"""Answer that leaves a column out."""


def asked(found: Draft, *, torque: bool = True) -> Draft:
    """Ask about a draft: its time, then each column whose meaning or unit is not sure.

    Where no column is known by its name, or none of the log shows a torque, each is asked about.

    Where nobody answers, what was drafted stays, with its questions.

    Parameters
    ----------
    found
    torque : some column of the log shows one
    """
    from weighbridge.io.draft import timed

    try:
        if found.times:
            time = _asked_time(found)
            found = found if time is found.times[0] else timed(found, time)
        nameless = not found.known or not torque
        for name in [c.name for c in found.columns]:
            columns = {c.name: c for c in found.columns}
            taken = {c.quantity for c in found.known if c.name != name}
            if nameless:
                columns[name] = _asked_meaning(columns[name], taken)
            columns[name] = _asked_unit(_asked_quantity(columns[name], taken))
            found = replace(found, columns=tuple(columns.values()))
    except typer.Abort:
        pass
    return found


def _asked_time(found: Draft) -> DraftTime:
    """Ask which column is the time, and its unit or rate, where the log leaves that open."""
    time = found.times[0]
    if len(found.times) > 1:
        names = [t.column for t in found.times]
        name = _answer(f"which column is the time ({_listed(names)})", names, time.column)
        if name != time.column:
            time = next(t for t in found.times if t.column == name)
    if time.guessed:
        units = ["s", "ms", "us", "ns", "min"]
        unit = _answer(f"unit of {shown(time.column)} ({_listed(units)})", units, time.unit)
        time = _in_unit(time, unit)
    if time.row_rate is not None and not time.row_rate > 0.0:
        time = _asked_rate(time)
    return time


def _in_unit(time: DraftTime, unit: str) -> DraftTime:
    from weighbridge.signals import UNITS

    seconds = time.seconds * (UNITS[unit].factor / UNITS[time.unit].factor)
    return replace(time, unit=unit, seconds=seconds, questions=[], guessed=False)


def _asked_rate(time: DraftTime) -> DraftTime:
    what = f"{shown(time.column)} counts rows" if time.column else "no column is a time"
    while True:
        reported = _prompt(f"{what}; how many rows per second (0 if you do not know)", "0")
        try:
            rate = float(reported.replace(",", "."))
        except ValueError:
            complain(f"{reported!r} is no number")
            continue
        if rate == 0.0:
            return time
        if 0.0 < rate < float("inf"):
            return replace(time, row_rate=rate, questions=[])
        complain(f"{reported!r} is no rate")


def _asked_meaning(column: DraftColumn, taken: set[str]) -> DraftColumn:
    """Ask what a column is where no name of the log shows any."""
    from weighbridge.signals import QUANTITIES

    if column.quantity or not column.count:
        return column
    reported = _answer(
        f"{shown(column.name)}, {column.low:.4g} to {column.high:.4g}; what is it (a quantity of "
        f"docs/files.md such as vehicle_speed, or {_NONE})",
        [*(q for q in QUANTITIES if q not in taken), _NONE],
        _NONE,
    )
    if reported == _NONE:
        return column
    return replace(column, quantity=reported, unit=QUANTITIES[reported].suffix, question="")


def _asked_quantity(column: DraftColumn, taken: set[str]) -> DraftColumn:
    """Ask what a column is, where its name or its values leave that open."""
    from weighbridge.io.columns import suffixes_of
    from weighbridge.signals import QUANTITIES

    if not column.quantity or not column.unsure:
        return column
    free = [q for q in QUANTITIES if q not in taken]
    why = f" ({shown(column.question)})" if column.question else ""
    reported = _answer(
        f"{shown(column.name)}, {column.low:.4g} to {column.high:.4g} {column.unit}, is taken for "
        f"{column.quantity}{why}; what is it (a quantity of docs/files.md, or {_NONE})",
        [*free, _NONE],
        column.quantity,
    )
    if reported == _NONE:
        return replace(column, quantity="", question="")
    if reported == column.quantity:
        # The unit is another question.
        return replace(column, unsure=False, question="" if column.stated else column.question)
    allowed = suffixes_of(QUANTITIES[reported])
    unit = column.unit if column.unit in allowed else QUANTITIES[reported].suffix
    stated = column.stated and column.unit in allowed
    return replace(column, quantity=reported, unit=unit, stated=stated, question="", unsure=False)


def _asked_unit(column: DraftColumn) -> DraftColumn:
    """Ask for the unit of a column whose log states none."""
    from weighbridge.io.columns import suffixes_of
    from weighbridge.signals import QUANTITIES

    if not column.quantity or column.stated or not column.unit:
        return column
    allowed = suffixes_of(QUANTITIES[column.quantity])
    reported = _answer(
        f"{shown(column.name)} is {column.quantity}, {column.low:.4g} to {column.high:.4g};"
        f" unit ({_listed(allowed)}, or {_NONE} to leave it out)",
        [*allowed, _NONE],
        column.unit,
    )
    if reported == _NONE:
        return replace(column, quantity="", question="")
    return replace(column, unit=reported, stated=True, question="")


def _listed(words: Sequence[str]) -> str:
    return ", ".join(map(shown, words))


def _answer(question: str, allowed: Sequence[str], usual: str) -> str:
    """Ask until the answer is one of those allowed."""
    while True:
        reported = _prompt(question, usual)
        if reported in allowed:
            return reported
        near = difflib.get_close_matches(reported, allowed, n=1)
        complain(f"{reported!r} is none of them" + (f"; did you mean {near[0]!r}?" if near else ""))


def _prompt(question: str, usual: str) -> str:
    return str(typer.prompt(question, default=usual, err=True)).strip()


_NO_TORQUE = (
    "  no column taken is a torque, a load or a power, without which nothing can be weighed. "
    "If one that is not taken is, type the command again with --ask, which asks; or name it in the "
    "mapping, as engine_torque, engine_torque_fraction, engine_load or engine_power"
)

_ARRAYS = (
    "NumPy arrays, which have no names that map could know: write their mapping by hand, columns "
    "by number, as examples/comma2k19/mapping.toml does; docs/formats.md says how"
)


_SHOWN = 12
"""Columns that are not taken, named at most."""


def map_log(
    logs: Annotated[list[Path], argument("map LOGS")],
    output: Annotated[Path | None, option("map --output")] = None,
    ask: Annotated[bool, option("map --ask")] = False,
    rate: Annotated[float | None, option("map --rate")] = None,
    columns: Annotated[str | None, option("map --columns")] = None,
    force: Annotated[bool, option("--force")] = False,
    dbc: DbcPaths = None,
) -> None:
    """Draft the mapping of a log: its separator, time, columns and units.

    Files of the same form, such as one per day, get one mapping that fits other days too.
    For raw CAN logs it finds the meaning of the signals of a DBC.

    Example: weighbridge map trip.csv -o map.toml
    """
    from weighbridge.errors import DriveError
    from weighbridge.io import mapping_text
    from weighbridge.io.drafts import kinds, with_compared_speeds
    from weighbridge.whole import whole_file

    if output is not None:
        refuse_results(inputs(logs, dbc=dbc), [Result("--output", output, "mapping")])
        refuse_overwriting(output, force, "mapping")
    names = [name.strip() for name in columns.split(",")] if columns is not None else []
    drafts, refused = _drafts(_files(logs, dbc or [], names), ask)
    drafts = with_compared_speeds(kinds(drafts, tuple(refused)))
    drafts = _settled(drafts, rate, ask)
    if nameless := [found for found in drafts if not found.known]:
        raise DriveError(f"{nameless[0].path}: no column of it was named; nothing was written")
    screen = console(stderr=output is None)
    if output is not None or not quiet():
        for found in drafts:
            _show(found, screen)
    _tell_lacking(drafts, refused)
    text = mapping_text(drafts, tuple(refused), _named_dbcs(dbc or [], output))
    again = _again(logs, columns, dbc or [], output)
    to_ask = _to_ask(drafts, again) if not ask else ""
    if output is None:
        sys.stdout.write(text)
        if to_ask:
            notice(to_ask)
        return
    with whole_file(output) as part:
        part.write_text(text, encoding="utf-8")
    say_written(output)
    if not quiet():
        _say_next(drafts, logs, output, again)
        if to_ask:
            say(to_ask)


def _tell_lacking(drafts: list[Draft], refused: dict[Path, str]) -> None:
    """Report files that were left out, and what no column was taken for."""
    from weighbridge.io.draft import tells_torque
    from weighbridge.io.drafts import missing

    for sentence in refused.values():
        notice(f"  left out: {sentence}")
    if not tells_torque(*drafts):
        notice(_NO_TORQUE)
    for sentence in missing(drafts):
        notice(f"  {shown(sentence)}")


def _say_next(drafts: list[Draft], logs: list[Path], output: Path, again: list[str]) -> None:
    """Say what to type next; ``again`` is the command that was typed."""
    if any(found.rate_unknown for found in drafts):
        say(f"next: {shlex.join([*again, '--rate', 'HZ'])}")
        return
    drive = logs[0] if len(drafts) == 1 else _drive(logs)
    if drive.is_dir() and drive not in drafts[0].path.parents[:1]:
        # A folder of partitions is no drive itself.
        drive = drafts[0].path.parent
    if _drives_beside_each_other(drafts):
        say(f"if {drive} holds several drives, put the files of each into a folder of its own")
    words = ["weighbridge", "inspect", drive, "--mapping", output]
    say(f"next: {shlex.join(map(str, words))}")


def _again(logs: list[Path], columns: str | None, dbc: list[str], output: Path | None) -> list[str]:
    """Words of the command that was typed, replacing what it wrote."""
    words = ["weighbridge", "map", *map(str, logs)]
    words += ["--columns", columns] if columns is not None else []
    words += [word for path in dbc for word in ("--dbc", path)]
    return words + (["-o", str(output), "--force"] if output is not None else [])


def _to_ask(drafts: list[Draft], again: list[str]) -> str:
    """Say how to be asked, to a person at a terminal and where something is uncertain."""
    questionable = any(found.all_questions for found in drafts)
    if not (questionable and sys.stdin.isatty() and sys.stdout.isatty()):
        return ""
    return f"or, to be asked about uncertain findings: {shlex.join([*again, '--ask'])}"


def _named_dbcs(dbc: list[str], output: Path | None) -> list[str]:
    """DBC files as the mapping names them: seen from its folder, or from here where it is shown."""
    from weighbridge.pipeline.given import dbcs_beside

    return dbcs_beside(dbc, output if output is not None else Path("map.toml"))


def _drafts(
    files: list[tuple[Path, Callable[[Path], Draft]]], ask: bool
) -> tuple[list[Draft], dict[Path, str]]:
    """Draft the mapping of each file; say why where that cannot be.

    Where no column of any file is known by its name, ``ask`` keeps them all: a person may know.
    """
    from weighbridge.errors import DriveError
    from weighbridge.io.draft import UnknownColumnsError

    drafts: list[Draft] = []
    unknown: list[Draft] = []
    refused: dict[Path, str] = {}
    for path, draft in each(files, "reading", lambda file: file[0].name):
        try:
            drafts.append(draft(path))
        except UnknownColumnsError as error:
            refused[path] = str(error)
            unknown.append(error.found)
        except DriveError as error:
            refused[path] = str(error)
    if ask and not drafts:
        drafts = unknown
        refused = {p: why for p, why in refused.items() if p not in {d.path for d in unknown}}
    if not drafts:
        raise DriveError("; ".join(refused.values()))
    return drafts, refused


def _files(
    logs: list[Path], dbc: list[str], names: list[str]
) -> list[tuple[Path, Callable[[Path], Draft]]]:
    """Files named, those of folders included, each with what drafts its mapping."""
    from weighbridge.errors import DriveError
    from weighbridge.io import all_formats, format_of, is_log, load_dbcs
    from weighbridge.io.formats import unreadable
    from weighbridge.io.paths import partitions

    databases = load_dbcs(list(dbc))

    drafted = tuple(
        dict.fromkeys(s for f in all_formats() if f.draft is not None for s in f.suffixes)
    )
    found = []
    for path in logs:
        if path.is_dir():
            inside = sorted(p for p in path.iterdir() if p.is_file() and is_log(p))
            if not inside and partitions(p.name for p in path.iterdir() if p.is_dir()):
                # The files of a table's partitions are alike.
                inside = sorted(p for p in path.rglob("*") if p.is_file() and is_log(p))
            drafts = ((p, _draft(p, databases, names, beside=True)) for p in inside)
            there = [(p, draft) for p, draft in drafts if draft is not None]
            if not there:
                _refuse_arrays(path, path.iterdir())
                raise DriveError(f"{path}: holds no table ({', '.join(drafted)})")
            found += there
        elif not path.is_file():
            raise DriveError(f"{path}: {'no plain file' if path.exists() else 'no such file'}")
        elif (draft := _draft(path, databases, names)) is None:
            _refuse_arrays(path, [path])
            if format_of(path) is None:
                raise DriveError(unreadable(path))
            raise DriveError(
                f"{path}: map drafts mappings of tables ({', '.join(drafted)}), and of CAN logs "
                "by their DBC (--dbc FILE); other logs are read as they are: weighbridge inspect "
                "shows what they hold"
            )
        else:
            found.append((path, draft))
    return found


def _refuse_arrays(path: Path, files: Iterable[Path]) -> None:
    """Refuse a log or folder that holds NumPy arrays; they have no names that map could know."""
    from weighbridge.errors import DriveError

    if any(file.suffix.lower() == ".npy" for file in files):
        raise DriveError(f"{path}: holds {_ARRAYS}")


def _draft(
    path: Path, databases: tuple[Database, ...], names: list[str], *, beside: bool = False
) -> Callable[[Path], Draft] | None:
    """What drafts the mapping of a file; None where it is read as it is.

    The DBC of a folder may be that of other files ``beside`` it: without frames it is not asked.
    """
    from weighbridge.errors import DriveError
    from weighbridge.io import draft_bus, draft_table, format_of
    from weighbridge.io.bus_draft import NoFramesError

    try:
        form = format_of(path)
    except OSError as error:
        raise DriveError(f"{path} cannot be read: {error.strerror or error}") from None
    if form is None:
        return None
    if databases and form.holds_frames:
        channels = form.draft if beside else None

        def by_frames(log: Path) -> Draft:
            try:
                return draft_bus(log, databases)
            except NoFramesError:
                if channels is None:
                    raise
                return channels(log)

        return by_frames
    if names and form.draft is not draft_table:
        raise DriveError(f"{path} names what it holds itself; leave out --columns")
    if names:
        return lambda log: draft_table(log, names)
    return form.draft


def _settled(drafts: list[Draft], rate: float | None, ask: bool) -> list[Draft]:
    """Give the drafts what the user states, and ask for the rest where that is wanted."""
    from weighbridge.cli.map import asked
    from weighbridge.errors import ConfigError

    if rate is not None:
        if not 0.0 < rate < float("inf"):
            raise ConfigError(f"--rate must be more than 0 rows per second, got {rate:g}")
        drafts = [_rated(found, rate) for found in drafts]
    if not ask:
        return drafts
    from weighbridge.io.draft import tells_torque

    torque = tells_torque(*drafts)
    return [asked(found, torque=torque) for found in drafts]


def _rated(found: Draft, rate: float) -> Draft:
    """State the rate of a draft whose time counts rows; a clock stays one."""
    from weighbridge.io.draft import timed

    counted = [time for time in found.times if time.row_rate is not None]
    if not counted:
        return found
    return timed(found, replace(counted[0], row_rate=rate, questions=[]))


def _drive(logs: list[Path]) -> Path:
    """Path of one drive: a folder named, else that of the files."""
    return next((path for path in logs if path.is_dir()), logs[0].parent)


def _drives_beside_each_other(drafts: list[Draft]) -> bool:
    """Whether one folder has several files of each kind, which may be those of several drives."""
    places = {path.parent for found in drafts for path in (found.path, *found.alike)}
    return len(places) == 1 and len(drafts) > 1 and all(found.files > 1 for found in drafts)


def _show(found: Draft, screen: Console) -> None:
    """Print what a file seems to be, and what is uncertain."""
    from rich.table import Table

    taken = found.time_format or found.time_unit or "date"
    clock = f"time '{shown(found.time)}' ({taken})" if found.time else "a clock of its own"
    if found.row_rate is not None:
        clock = f"rows counted by '{shown(found.time)}'" if found.time else "rows counted"
    more = f" and {found.files - 1} that read alike" if found.files > 1 else ""
    table = Table(
        title=f"{shown(found.path.name)}{more}: {clock}, {_length(found)}",
        title_justify="left",
    )
    table.add_column("column", overflow="fold")
    # On a narrow screen the log's own names are broken, not the quantities.
    for heading in ("is", "unit"):
        table.add_column(heading, no_wrap=True)
    for heading in ("lowest", "median", "highest", "values", "Hz"):
        table.add_column(heading, justify="right")
    for column in found.known:
        unit = column.unit + ("" if column.stated or not column.unit else " ?")
        values = (f"{x:.4g}" for x in (column.low, column.usual, column.high))
        rate = f"{column.rate:.3g}" if column.rate > 0.0 else "-"
        table.add_row(shown(column.name), column.quantity, unit, *values, str(column.count), rate)
    screen.print(table)
    others = [c.name for c in found.columns if not (c.quantity or c.question) and c.name.strip()]
    if others:
        more = f" and {len(others) - _SHOWN} more" if len(others) > _SHOWN else ""
        names = ", ".join(shown(n) for n in others[:_SHOWN])
        screen.print(f"  not taken: {names}{more}", highlight=False)
    for question in found.all_questions:
        screen.print(f"  uncertain: {shown(question)}", highlight=False)


def _length(found: Draft) -> str:
    """How many rows there are, and how long they last."""
    if found.rate_unknown:
        return f"{found.rows} of them, how many per second is not known"
    rows = f"{found.rows} rows in " if found.rows else ""
    return f"{rows}{found.duration:.0f} s"
