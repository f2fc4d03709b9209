"""``weighbridge fleet report``: who was overloaded, what was carried, and how good the data are."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from weighbridge.cli.listed import argument, option
from weighbridge.cli.results import Inputs, asked_for, refuse_results
from weighbridge.cli.terminal import say
from weighbridge.cli.verbosity import say_written

if TYPE_CHECKING:
    import polars as pl

    from weighbridge.fleet.reporting import FleetReport

_REPORTED: Final = 10  # legs in the answer, and vehicles of what was learnt


def report(
    results: Annotated[str, argument("RESULTS")],
    page: Annotated[Path | None, option("fleet report --output")] = None,
    json: Annotated[str | None, option("fleet report --json")] = None,
    legs: Annotated[Path | None, option("fleet report --legs")] = None,
    tickets: Annotated[Path | None, option("--tickets")] = None,
    couplings: Annotated[Path | None, option("fleet report --couplings")] = None,
    warn: Annotated[float, option("fleet report --warn")] = 0.5,
    alarm: Annotated[float, option("fleet report --alarm")] = 0.95,
    tolerance: Annotated[float, option("fleet report --tolerance")] = 0.05,
) -> None:
    """Report overloaded vehicles, transport, changes of load, and how good the data are.

    Example: weighbridge fleet report results/ -o fleet.html --tickets tickets.csv
    """
    from weighbridge.errors import ConfigError
    from weighbridge.fleet.bucket import brought
    from weighbridge.fleet.legs import Limits
    from weighbridge.fleet.page import write_page
    from weighbridge.fleet.reporting import report as figures

    if json == "-":
        raise ConfigError("--json -: name a file; standard output has the summary")
    read = Inputs(files=tuple(path for path in (tickets, couplings) if path is not None))
    refuse_results(read, asked_for(report=page, json=json, legs=legs))
    folder = brought(results)
    for path in (page, None if json is None else Path(json), legs):
        if path is not None and path.resolve().is_relative_to(folder.resolve()):
            raise ConfigError(f"{path}: is within the results; name a file elsewhere")
    found = figures(
        folder,
        limits=Limits(warn=warn, alarm=alarm),
        tickets=tickets,
        couplings=couplings,
        tolerance=tolerance,
    )
    if page is not None:
        write_page(found, page)
    if json is not None:
        found.to_json(json)
    if legs is not None:
        found.write_legs(legs)
    _say_answer(found, alarm)
    _say_outside(found.outside)
    _say_learnt(found.learnt)
    for written in (page, json, legs):
        if written is not None:
            say_written(written)


def _say_answer(found: FleetReport, alarm: float) -> None:
    """Say who was overloaded, surest first; ``alarm`` is the probability that is sure."""
    from weighbridge.fleet.page import how_sure

    t = found.totals
    say(f"{t['drives']} drives of {t['vehicles']} vehicles, {t['distance_km']:.0f} km")
    say_without_file(found.without_file, t["vehicles"])
    sure = "1 leg" if t["alarms"] == 1 else f"{t['alarms']} legs"
    say(f"overloaded: {sure} at least {100 * alarm:g} % sure, {t['warnings']} likely")
    for row in found.overloads.head(_REPORTED).iter_rows(named=True):
        when = "no time" if row["start"] is None else f"{row['start']:%Y-%m-%d %H:%M} UTC"
        say(
            f"  {row['vehicle_id']} {when}: {row['mass_kg']:.0f} ± "
            f"{row['high95_kg'] - row['mass_kg']:.0f} kg of {row['permitted_kg']:.0f} kg, "
            f"{how_sure(row['overload'])}"
        )
    more = found.overloads.height - _REPORTED
    if more > 0:
        say(f"  and {more} more, surest first: -o fleet.html has all")
    say_unjudged(found.unjudged, t["legs"], "leg")


def say_unjudged(causes: pl.DataFrame, of: int, word: str) -> None:
    """Say what was not judged, ranked by what it prevents and how often.

    Parameters
    ----------
    causes : as of `weighbridge.fleet.legs.unjudged`
    of : rows in all
    word : what a row is
    """
    from weighbridge.fleet.names import some

    if causes.is_empty():
        return
    say(f"not judged: {causes['count'].sum()} of {of} {word}s, by what is not known")
    for row in causes.head(_REPORTED).iter_rows(named=True):
        count = f"{row['count']} {word}{'' if row['count'] == 1 else 's'}"
        say(f"  {row['prevents']}, {count} of {some(row['vehicles'])}: {row['example']}")
    more = causes.height - _REPORTED
    if more > 0:
        say(f"  and {more} more causes: weighbridge fleet report -o fleet.html has all")


def say_without_file(without: list[str | None], vehicles: int) -> None:
    """Say how many vehicles have no file, and the first of them."""
    from weighbridge.fleet.names import some

    if without:
        say(
            f"{len(without)} of {vehicles} vehicles without a file, weighed by the data sheet of "
            f"a class, roughly: {some(without)}"
        )


def _say_outside(outside: pl.DataFrame) -> None:
    """Say how many known masses lie outside their interval, and which is the worst."""
    if outside.is_empty():
        return
    known, out = int(outside["known"].sum()), int(outside["outside"].sum())
    of = "1 known mass" if known == 1 else f"{known} known masses"
    say(f"outside the 95 % interval: {out} of {of}; by chance one in twenty is")
    questionable = outside.filter(outside["outside"] > 0)
    for row in questionable.head(_REPORTED).iter_rows(named=True):
        when = "" if row["worst_start"] is None else f" {row['worst_start']:%Y-%m-%d %H:%M} UTC"
        say(
            f"  {row['vehicle_id']}: {row['outside']} of {row['known']}, worst{when}: known "
            f"{row['worst_known_kg']:.0f} kg, 95 % interval {row['worst_low95_kg']:.0f} to "
            f"{row['worst_high95_kg']:.0f} kg ({100.0 * row['worst_error']:+.1f} %)"
        )
    more = questionable.height - _REPORTED
    if more > 0:
        say(f"  and {more} more: -o fleet.html has all")


def _say_learnt(learnt: pl.DataFrame) -> None:
    """Report vehicles whose drives of known mass contradict their file, or that drift."""
    say_scales(learnt)
    learnt = learnt.filter(learnt["drives"] > 0)
    if learnt.is_empty():
        return
    of = "1 vehicle" if learnt.height == 1 else f"{learnt.height} vehicles"
    contradicted, drifts = learnt["contradicted"].sum(), learnt["drifts"].sum()
    say(
        f"learnt from the tickets of {of}: {contradicted} contradicted by "
        f"{'its' if contradicted == 1 else 'their'} drives, "
        f"{drifts} {'drifts' if drifts == 1 else 'drift'}"
    )
    questionable = learnt.filter(learnt["contradicted"] | learnt["drifts"])
    for row in questionable.head(_REPORTED).iter_rows(named=True):
        say(f"  {row['vehicle_id']}: {row['findings']}")
    more = questionable.height - _REPORTED
    if more > 0:
        say(f"  and {more} more: -o fleet.html has all")


def say_scales(learnt: pl.DataFrame) -> None:
    """Say by how much masses are corrected, and which vehicles seem never to be empty.

    Parameters
    ----------
    learnt : as of `weighbridge.fleet.learnt.read_learnt`
    """
    scaled = learnt.filter(learnt["factor"].is_not_null())
    if scaled.is_empty():
        return
    of = "1 vehicle" if scaled.height == 1 else f"{scaled.height} vehicles"
    changes = [100.0 * (factor - 1.0) for factor in scaled["factor"]]
    say(
        f"masses of {of} are corrected by what the fleet shows of their scale: by "
        f"{min(changes):+.1f} to {max(changes):+.1f} %"
    )
    never = scaled.filter(scaled["verdict"] == "never empty")
    for row in never.head(_REPORTED).iter_rows(named=True):
        say(f"  {row['vehicle_id']}: {row['factor_reason']}")
    more = never.height - _REPORTED
    if more > 0:
        say(f"  and {more} more that are never empty: -o fleet.html has all")
