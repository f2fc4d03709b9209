"""``weighbridge fleet``: thousands of drives, weighed in parallel."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from typer.core import TyperCommand, TyperGroup

from weighbridge.cli import fleet_report
from weighbridge.cli.listed import argument, class_names, method_names, option
from weighbridge.cli.options import DbcPaths, Elevation, MappingPath, Whole
from weighbridge.cli.progress import time_text
from weighbridge.cli.terminal import complain, console, say, shown
from weighbridge.cli.verbosity import say_written, watched

if TYPE_CHECKING:
    from weighbridge.fleet.engine import Count

_RUN: Final = "run"

_NO_WORKER: Final = "no worker is connected to the scheduler: start one there, dask worker ADDRESS"
_PATIENCE: Final = 10.0  # without a worker until that is reported [s]


class RunsDrives(TyperGroup):
    """A group whose first word may be a drive: what is no command of it is run."""

    @property
    def fallback(self) -> Any:
        """The command that is meant where none is named."""
        return self.commands[_RUN]

    def parse_args(self, ctx: Any, args: list[str]) -> Any:
        """Put the name of the command in front where none is.

        A word that is nearly a command and no path is refused.
        """
        if not args or args[0] not in self.commands:
            from weighbridge.arguments import near_miss

            word = args[0] if args else ""
            meant = near_miss(word, set(self.commands) - {_RUN}) if word.isalpha() else ""
            if meant and not Path(word).exists():
                ctx.fail(f"No such command {word!r}. Did you mean {meant!r}?")
            args = [_RUN, *args]
        return super().parse_args(ctx, args)


class Unnamed(TyperCommand):
    """The command of a group that is run without its name, which no usage line shows."""

    def format_usage(self, ctx: Any, formatter: Any) -> None:
        """Write the usage line under the name of the group."""
        group = ctx if ctx.parent is None else ctx.parent
        formatter.write_usage(group.command_path, " ".join(self.collect_usage_pieces(ctx)))


app = typer.Typer(cls=RunsDrives, help="Weigh the drives of a fleet in parallel.")
app.command()(fleet_report.report)


@app.command(_RUN, cls=Unnamed, hidden=True)
def run(
    drives: Annotated[list[str], argument("fleet DRIVES")],
    vehicles: Annotated[Path, option("fleet --vehicles")],
    results: Annotated[str, option("fleet --output")],
    scheduler: Annotated[str | None, option("fleet --scheduler")] = None,
    workers: Annotated[int | None, option("fleet --workers")] = None,
    memory: Annotated[str | None, option("fleet --memory")] = None,
    kind: Annotated[str | None, option("fleet --class", autocompletion=class_names)] = None,
    method: Annotated[str, option("--method", autocompletion=method_names)] = "joint",
    changes: Annotated[list[str] | None, option("fleet --set")] = None,
    learn: Annotated[Path | None, option("fleet --learn")] = None,
    tickets: Annotated[Path | None, option("--tickets")] = None,
    whole: Whole = False,
    mapping: MappingPath = None,
    dbc: DbcPaths = None,
    elevation: Elevation = None,
) -> None:
    """Weigh the drives of a fleet in parallel, and continue an earlier run.

    Exit status: 0 if every drive has a mass, 1 if one has none, 2 if one could not be read.
    `weighbridge fleet status RESULTS` shows how far a run is. `weighbridge fleet report RESULTS`
    shows which vehicles were overloaded.

    Example: weighbridge fleet 'drives/**' --vehicles vehicles/ -o results/
    """
    from weighbridge.estimators import parsed
    from weighbridge.fleet.bucket import place_of_results
    from weighbridge.fleet.run import FleetSettings, run_fleet

    how = FleetSettings(
        method=method,
        settings=parsed(changes or []),
        kind=kind,
        mapping=mapping,
        dbc=tuple(dbc or ()),
        elevation=elevation,
        whole=whole,
        scheduler=scheduler,
        workers=workers,
        memory=memory,
        learn=learn,
        tickets=tickets,
    )
    began = time.monotonic()
    place = place_of_results(results)
    with _progress() as tell:
        count = run_fleet(drives, vehicles, place, how, tell)
    found = _summary(place.folder)
    _say_run(count, time.monotonic() - began)
    _say_summary(found)
    if learn is not None:
        _say_learnt(place.folder, learn)
    say_written(results)
    if found["unread"] or found["failed"]:
        raise typer.Exit(2)
    if found["masses"] < found["drives"]:
        raise typer.Exit(1)


@app.command()
def status(
    results: Annotated[str, argument("RESULTS")],
) -> None:
    """Show how far a run is: drives weighed, drives without a mass and why, and the time left.

    Example: weighbridge fleet status results/
    """
    from weighbridge.fleet.bucket import brought
    from weighbridge.fleet.store import Results

    folder = brought(results)
    opened = Results.opened(folder)
    progress = opened.read_progress()
    if opened.running:
        left = progress.get("left_s")
        of = f" of {progress.get('found', '?')}" + (
            "" if progress.get("complete") else " found so far"
        )
        rest = "" if left is None else f", {time_text(left)} left"
        rate = progress.get("rate_per_s", 0)
        say(f"running: {progress.get('done', 0)}{of} recordings, {rate:.1f}/s{rest}")
        if progress.get("workers") == 0:
            say(f"  {_NO_WORKER}")
    elif progress and not (
        progress.get("complete") and progress.get("done") == progress.get("found")
    ):
        say(
            f"stopped after {progress.get('done', 0)} of {progress.get('found', '?')} recordings: "
            "give the same command again to go on"
        )
    else:
        say("no run is under way")
    _say_summary(_summary(folder))


def _summary(folder: Path) -> dict[str, Any]:
    """Count the rows of the results by what came of them."""
    import polars as pl

    from weighbridge.fleet.legs import unjudged, with_causes
    from weighbridge.fleet.reading import collected, read_drives

    rows = read_drives(folder).select(
        "key", "outcome", "status", "reason_id", "reason", "mass_kg", "tare_kg", "gross_kg",
        "distance_km", "vehicle_id", "vehicle_file", "copies", "also_vehicles",
    )  # fmt: skip
    frame = collected(rows, folder)
    has_file = pl.col("vehicle_file").is_not_null().any()
    vehicles = frame.group_by("vehicle_id").agg(has_file=has_file)
    recordings = frame.unique("key")
    without = frame.filter((pl.col("outcome") == "weighed") & pl.col("mass_kg").is_null())
    return {
        "drives": frame.height,
        "vehicles": vehicles.height,
        "without_file": vehicles.filter(~pl.col("has_file"))["vehicle_id"].sort().to_list(),
        "copies": int(recordings["copies"].list.len().sum()),
        "shared": recordings.filter(pl.col("also_vehicles").list.len() > 0).height,
        "masses": int(frame["mass_kg"].is_not_null().sum()),
        "unread": frame.filter(pl.col("outcome") == "unread").height,
        "failed": frame.filter(pl.col("outcome") == "failed").height,
        "status": dict(without["status"].value_counts(sort=True).iter_rows()),
        "unjudged": unjudged(with_causes(frame, "gross_kg")),
    }


def _say_run(count: Count, seconds: float) -> None:
    new = count.done - count.there
    rate = f", {new / seconds:.2f}/s" if new else ""
    there = f", {count.there} were there already" if count.there else ""
    say(f"{new} recordings weighed in {time_text(seconds)}{rate}{there}")


def _say_summary(found: dict[str, Any]) -> None:
    say(
        f"{found['drives']} drives of {found['vehicles']} vehicles: {found['masses']} with a mass"
        + "".join(f", {count} {name}" for name, count in found["status"].items())
        + "".join(f", {found[name]} {name}" for name in ("unread", "failed") if found[name])
    )
    fleet_report.say_without_file(found["without_file"], found["vehicles"])
    if found["copies"]:
        say(
            f"{_count(found['copies'], 'copy', 'copies')} of recordings of the same vehicle: each "
            "recording counts once"
        )
    if found["shared"]:
        say(
            f"{_count(found['shared'], 'recording')} also under another vehicle: counted for each, "
            "right for one at most"
        )
    fleet_report.say_unjudged(found["unjudged"], found["drives"], "drive")


def _count(number: int, word: str, words: str | None = None) -> str:
    return f"{number} {word if number == 1 else words or word + 's'}"


def _say_learnt(results: Path, learn: Path) -> None:
    from weighbridge.fleet.learnt import read_learnt

    learnt = read_learnt(results)
    fleet_report.say_scales(learnt)
    for row in learnt.filter(learnt["drives"] > 0).iter_rows(named=True):
        refined = f"refined: {learn / row['refined']}" if row["refined"] else "not refined"
        say(f"{row['vehicle_id']}: {row['drives']} drives with a ticket, {refined}")
        if row["findings"]:
            say(f"  {row['findings']}")


def _lonely() -> Callable[[Count], None]:
    """Return what says once that no worker is there to do the work."""
    reported, since = False, time.monotonic()

    def tell(count: Count) -> None:
        nonlocal reported, since
        if count.workers != 0:
            since = time.monotonic()
        elif not reported and time.monotonic() - since > _PATIENCE:
            reported = True
            complain(f"weighbridge: {_NO_WORKER}")

    return tell


@contextmanager
def _progress() -> Iterator[Callable[[Count], None]]:
    """Show a bar with rate and time left on a terminal; in a pipe, only what must be reported."""
    lonely = _lonely()
    if not watched():
        yield lonely
        return
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (TextColumn("weighing"), BarColumn(), TextColumn("{task.fields[text]}"))
    with Progress(*columns, console=console(stderr=True), transient=True) as bar:
        task = bar.add_task("weighing", total=None, text="")

        def tell(count: Count) -> None:
            lonely(count)
            left = "" if count.left is None else f", {time_text(count.left)} left"
            of = f"{count.found}" + ("" if count.complete else "+")
            bad = f", {count.failed + count.unread} bad" if count.failed + count.unread else ""
            bar.update(
                task,
                total=count.found if count.complete else None,
                completed=count.done,
                text=shown(f"{count.done}/{of}, {count.rate:.1f}/s{left}{bad}"),
            )

        try:
            yield tell
        except KeyboardInterrupt:
            bar.stop()
            complain("stopping; what was weighed is kept: give the same command again to go on")
            raise
