"""``weighbridge reproduce``: a published system against its paper's tables."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Optional

import typer

from weighbridge.cli.results import Result, inputs, refuse_results
from weighbridge.cli.terminal import console, say

if TYPE_CHECKING:
    from weighbridge.papers import Reproduced


def reproduce(
    paper: Annotated[
        str, typer.Argument(help="du2025, galvao, jensen2022, nguyen2024 or all.")
    ] = "all",
    report: Annotated[
        Optional[Path],  # noqa: UP045  (typer reads the annotation at run time)
        typer.Option(
            "--report",
            help="Write a report with the paper's figures from our data; of all papers, the "
            "paper's name goes before the suffix.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the simulated drives.")] = 777,
) -> None:
    """Reproduce a published system on simulated drives; exits with 1 where we fall behind.

    Example: weighbridge reproduce jensen2022 --report jensen2022.html
    """
    from weighbridge import papers
    from weighbridge.errors import ConfigError

    if paper != "all" and paper not in papers.PAPERS:
        raise ConfigError(f"{paper}: known papers are {', '.join(papers.PAPERS)} and all")
    names = list(papers.PAPERS) if paper == "all" else [paper]
    pages: dict[str, Path] = {}
    if report is not None:
        for name in names:
            pages[name] = report if paper != "all" else report.with_stem(f"{report.stem}-{name}")
    refuse_results(inputs(), [Result("--report", page, "report") for page in pages.values()])
    behind: list[str] = []
    for name in names:
        done = papers.paper(name)(seed, _bar())
        show(done)
        behind += [f"{name}: {figure}" for figure in done.behind]
        if name in pages:
            done.write_report(pages[name])
            say(f"written: {pages[name]}")
    for figure in behind:
        say(f"behind, {figure}")
    if behind:
        raise typer.Exit(1)


def _bar() -> Any:
    """Show progress on a terminal, nothing in a pipe."""
    if not sys.stderr.isatty():
        return None

    def show_progress(done: int, total: int) -> None:
        end = "\n" if done == total else ""
        # Back to the begin of the line: a control character of ours.
        below = getattr(sys.stderr, "below", sys.stderr)
        print(f"\r{done} of {total} steps", end=end, file=below, flush=True)

    return show_progress


def show(done: Reproduced) -> None:
    """Print the tables and the comparison with the paper."""
    from rich.table import Table

    screen = console()
    screen.width = max(130, screen.width)
    for shown in (*done.tables, done.comparison):
        table = Table(title=shown.title)
        for k, name in enumerate(shown.columns):
            # The widest column gives way first, by lines: nothing of a table is cut off.
            table.add_column(name, justify="left" if k == 0 else "right", overflow="fold")
        for row in shown.rows:
            table.add_row(*row)
        screen.print(table)
