"""``weighbridge reproduce``: a published system against its paper's tables."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from weighbridge.cli.listed import argument, option, paper_names
from weighbridge.cli.progress import progress
from weighbridge.cli.results import Kind, Result, asked_for, inputs, refuse_results, write_json
from weighbridge.cli.terminal import complain, console, say
from weighbridge.cli.verbosity import say_written

if TYPE_CHECKING:
    from weighbridge.papers import Reproduced, Section


def reproduce(
    paper: Annotated[str, argument("reproduce PAPER", autocompletion=paper_names)] = "all",
    report: Annotated[Path | None, option("reproduce --report")] = None,
    seed: Annotated[int | None, option("reproduce --seed", min=0)] = None,
    json_path: Annotated[str | None, option("reproduce --json")] = None,
    changes: Annotated[list[str] | None, option("reproduce --set")] = None,
) -> None:
    """Reproduce a published system on simulated drives, and judge each printed value.

    The exit status is 1 if a value differs and no reason is given that a reader can check.

    Example: weighbridge reproduce jensen2022 --report jensen2022.html
    """
    from weighbridge import papers
    from weighbridge.arguments import check_choice
    from weighbridge.estimators import differences

    check_choice("paper", paper, (*papers.PAPERS, "all"))
    names = list(papers.PAPERS) if paper == "all" else [paper]
    settings = _settings(paper, changes or [])
    pages = _pages(report, names, every=paper == "all")
    written = dict.fromkeys([*pages.values(), *([report] if report is not None else [])])
    results = [Result("--report", page, _kind(page)) for page in written]
    refuse_results(inputs(), [*results, *asked_for(json=json_path)])
    aside = json_path == "-"
    tell = complain if aside else say
    every: list[Reproduced] = []
    for name in names:
        first = papers.seed_of(name) if seed is None else seed
        asked = (settings,) if settings is not None else ()
        with progress(f"reproducing {name}") as bar:
            done = papers.paper(name)(first, bar.tell, *asked)
        if changed := differences(settings) if settings is not None else "":
            done = replace(done, note=f"{done.note}; {changed}")
        if not aside:
            show(done)
        every.append(done)
        if name in pages:
            done.write_report(pages[name])
            say_written(pages[name], aside=aside)
    if report is not None and report not in pages.values():
        _write_items(report, [done.section for done in every])
        say_written(report, aside=aside)
    rows = [row for done in every for row in done.rows]
    if json_path is not None:
        text = json.dumps({"rows": [r.record() for r in rows]}, ensure_ascii=False, indent=1)
        if not write_json(json_path, text):
            say_written(json_path)
    reported = [f"{sum(r.verdict is v for r in rows)} {v}" for v in papers.Verdict]
    tell(f"{len(rows)} rows: {', '.join(reported)}")
    unaccounted = [row for row in rows if not row.accounted]
    for row in unaccounted:
        tell(f"differs without a reason, {row.paper}: {row.name}")
    if unaccounted:
        raise typer.Exit(1)


def _kind(page: Path) -> Kind:
    return "list of items" if page.suffix.lower() == ".md" else "report"


def _settings(paper: str, changes: list[str]) -> Any:
    """Settings of a paper's reproduction; None where nothing was asked for."""
    from weighbridge import papers
    from weighbridge.errors import ConfigError
    from weighbridge.estimators import changed, parsed

    if not changes:
        return None
    kind = papers.settings_of(paper) if paper != "all" else None
    if kind is None:
        raise ConfigError(
            f"--set {changes[0]}: {paper} has no settings to change; name one paper, such as "
            "jensen2022"
        )
    return changed(kind(), parsed(changes))


def _pages(report: Path | None, names: list[str], *, every: bool) -> dict[str, Path]:
    """Page of each paper; none for a list of items."""
    if report is None or report.suffix.lower() == ".md":
        return {}
    if not every:
        return {names[0]: report}
    return {name: report.with_stem(f"{report.stem}-{name}") for name in names}


def _write_items(report: Path, sections: list[Section]) -> None:
    """Write every item of the papers that have records, as Markdown or as a page."""
    from weighbridge.papers import document
    from weighbridge.report.study import write_study
    from weighbridge.whole import write_whole

    if report.suffix.lower() == ".md":
        write_whole(report, document(sections))
        return
    write_study("The papers, row by row", [section.table for section in sections], [], report)


def show(done: Reproduced) -> None:
    """Print the tables and the comparison with the paper."""
    from rich.table import Table

    screen = console()
    screen.width = max(130, screen.width)
    for shown in (*done.tables, done.comparison):
        table = Table(title=shown.title)
        for k, name in enumerate(shown.columns):
            # The widest column is replaced first, by lines: nothing of a table is cut off.
            table.add_column(name, justify="left" if k == 0 else "right", overflow="fold")
        for row in shown.rows:
            table.add_row(*row)
        screen.print(table)
