"""``weighbridge reproduce``: a published system against its paper's tables."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Optional

import typer

from weighbridge.cli.options import refuse_missing_folder

if TYPE_CHECKING:
    from weighbridge.papers.jensen2022 import Reproduction


def reproduce(
    paper: Annotated[str, typer.Argument(help="jensen2022, or all.")] = "all",
    report: Annotated[
        Optional[Path],  # noqa: UP045  (typer reads the annotation at run time)
        typer.Option("--report", help="Write a report with the paper's figures from our data."),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the simulated drives.")] = 777,
) -> None:
    """Reproduce a published system on simulated drives; exits with 1 where we fall behind.

    Example: weighbridge reproduce jensen2022 --report jensen2022.html
    """
    from weighbridge.errors import ConfigError

    if paper not in ("jensen2022", "all"):
        raise ConfigError(f"{paper}: known papers are jensen2022 and all")
    refuse_missing_folder(report)
    from weighbridge.papers import jensen2022

    bar = _bar()
    done = jensen2022.reproduce(seed=seed, progress=bar)
    behind = show(done)
    if report is not None:
        from weighbridge.report import write_report

        write_report(
            [d.weighing for d in done.drives],
            report,
            calibration=done.calibration,
            truth={d.weighing.drive.name: d.true_mass for d in done.drives},
            title="Jensen et al. 2022, reproduced on simulated drives",
        )
        typer.echo(f"written: {report}")
    if behind:
        raise typer.Exit(1)


def _bar() -> Any:
    """Show progress on a terminal, nothing in a pipe."""
    if not sys.stderr.isatty():
        return None

    def show_progress(done: int, total: int) -> None:
        end = "\n" if done == total else ""
        print(f"\r{done} of {total} drives", end=end, file=sys.stderr, flush=True)  # noqa: T201

    return show_progress


def show(done: Reproduction) -> list[str]:
    """Print the tables; return what falls behind the paper."""
    from rich.console import Console
    from rich.table import Table

    from weighbridge.papers import jensen2022 as paper
    from weighbridge.signals.units import scalar_from_si, scalar_to_si

    def degrees(angle: float) -> str:
        return f"{scalar_from_si(angle, 'deg'):.3f}"

    console = Console(width=max(130, Console().width))
    drives = Table(title="Drives of Table B.1, wind unknown | with the weather report of the day")
    for name in ("drive", "kind", "true kg", "mass kg", "± 95 %", "error %", "worst %"):
        drives.add_column(name, justify="left" if name == "kind" else "right", no_wrap=True)
    for name in ("| mass kg", "error %", "worst %", "grade °", "pitch °"):
        drives.add_column(name, justify="right", no_wrap=True)
    for d, known in zip(done.drives, done.informed, strict=True):
        low, high = d.weighing.interval(0.95)
        drives.add_row(
            str(d.drive.number),
            d.drive.kind,
            f"{d.true_mass:.0f}",
            f"{d.weighing.mass:.0f}",
            f"{0.5 * (high - low):.0f}",
            f"{100.0 * d.error:+.2f}",
            f"{100.0 * d.worst:.2f}",
            f"{known.weighing.mass:.0f}",
            f"{100.0 * known.error:+.2f}",
            f"{100.0 * known.worst:.2f}",
            degrees(d.grade_rms),
            degrees(d.pitch_rms),
        )
    console.print(drives)

    with_outage, without = done.outage_grade_rms
    grade = max(d.grade_rms for d in done.drives)
    pitch = max(d.pitch_std for d in done.drives)
    ratio = float(max(abs(done.ratio_errors)))
    r_squared = done.calibration.fit.r_squared
    inside, informed = paper.within(done.drives), paper.within(done.informed)
    total = len(done.drives)
    covered = sum(d.covered for d in done.drives)
    final = max(abs(d.error) for d in done.drives)
    rows = (
        ("drives within ±5 % at every instant of the last two thirds",
         "generally within", f"{inside} of {total}", inside >= total - 2),
        ("the same, with the weather report of the day", "", f"{informed} of {total}", True),
        ("largest error of a drive's final mass", "", f"{100.0 * final:.2f} %", final <= 0.05),
        ("largest gear ratio error", "2 %", f"{100.0 * ratio:.2f} %", ratio <= 0.01),
        ("torque fit R²", f"{paper.PAPER_R_SQUARED}", f"{r_squared:.3f}", r_squared >= 0.95),
        ("largest grade RMS error", "at most 1°", f"{degrees(grade)}°",
         grade <= scalar_to_si(0.35, "deg")),
        ("largest body pitch RMS error, constant lean under load aside", "at most 1°",
         f"{degrees(pitch)}°", pitch <= scalar_to_si(0.25, "deg")),
        ("grade RMS in 120 s without fixes | with them", "",
         f"{degrees(with_outage)}° | {degrees(without)}°",
         with_outage - without <= scalar_to_si(0.3, "deg")),
        ("95 % intervals that hold the truth", "", f"{covered} of {total}", covered >= total - 3),
    )  # fmt: skip
    table = Table(title="Jensen et al. 2022", title_justify="left")
    for name in ("figure", "paper", "ours", ""):
        table.add_column(name)
    for name, theirs, ours, good in rows:
        table.add_row(name, theirs, ours, "" if good else "behind")
    console.print(table)
    return [name for name, _, _, good in rows if not good]
