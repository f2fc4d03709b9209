"""``weighbridge doctor``: what is installed, and what is missing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from weighbridge.cli.listed import option
from weighbridge.cli.results import Result, inputs, refuse_results, write_json
from weighbridge.cli.terminal import console, say, shown
from weighbridge.cli.verbosity import say_written

if TYPE_CHECKING:
    from rich.table import Table

    from weighbridge.cli.installation import Extra, Installation, KernelCache


def doctor(
    json_path: Annotated[str | None, option("doctor --json")] = None,
) -> None:
    """Show what is installed: versions, extras, compiled kernels, and what is missing.

    A missing extra is not a fault. Exit status: 0 if there is no fault, 1 if there is one.

    Example: weighbridge doctor --json -
    """
    from weighbridge.cli.installation import examine

    if json_path is not None and json_path != "-":
        refuse_results(inputs(), [Result("--json", Path(json_path), "JSON file")])
    found = examine()
    text = json.dumps(found.as_dict(), indent=2, ensure_ascii=False)
    if not write_json(json_path, text):
        _show(found)
        if json_path is not None:
            say_written(json_path)
    if found.amiss:
        raise typer.Exit(1)


def _show(found: Installation) -> None:
    screen = console(highlight=False)
    say(f"weighbridge {found.version} in {found.folder}")
    say(f"Python {found.python} ({found.implementation}), {found.system}, {found.cores} cores")
    packages = (f"{p.name} {p.installed or 'missing'}" for p in found.packages)
    screen.print(shown(f"packages: {', '.join(packages) or 'not known, as it is not installed'}"))
    screen.print(_cache_text(found.cache), markup=False, soft_wrap=True)
    screen.print(extra_table(found))
    if found.missing:
        names = ",".join(name for name in found.missing if name != "formats")
        line = f'for all that is missing: pip install "weighbridge[{names}]"'
        # A line to copy stays one line.
        screen.print(line, markup=False, soft_wrap=True)
    for fault in found.amiss:
        screen.print(f"[bold red]amiss[/]: {shown(fault)}", soft_wrap=True)
    if not found.amiss:
        say("nothing is amiss")


def _cache_text(cache: KernelCache) -> str:
    if cache.folder is None:
        return "compiled kernels: not kept"
    more = "the rest are compiled when first used"
    if not cache.compiled:
        more = "the first run compiles, which takes a minute or two"
    can = "can" if cache.writable else "cannot"
    return (
        f"compiled kernels: {cache.compiled} of {cache.kernels}, {1e-6 * cache.size:.1f} MB in "
        f"{cache.folder}, which {can} be written to; {more}"
    )


def _lacking(extra: Extra) -> str:
    """Say what keeps an extra from working."""
    missing = [package.name for package in extra.packages if package.installed is None]
    others = [p.reported for p in extra.packages if p.installed is not None and not p.fits]
    return "; ".join([*([f"missing: {', '.join(missing)}"] if missing else []), *others])


def extra_table(found: Installation) -> Table:
    """One row an extra: what it is for, whether it is there, and how it comes."""
    from rich.table import Table

    table = Table()
    table.add_column("extra", no_wrap=True)
    table.add_column("for")
    table.add_column("state")
    for extra in found.extras:
        state = "[green]there[/]" if extra.fits else f"[yellow]{shown(_lacking(extra))}[/]"
        table.add_row(extra.name, extra.purpose, state)
    return table
