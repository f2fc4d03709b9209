"""``weighbridge demo``: the whole way on simulated drives, needing nothing."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from weighbridge.cli.listed import option
from weighbridge.cli.options import Units
from weighbridge.cli.progress import progress
from weighbridge.cli.results import Result, inputs, refuse_results
from weighbridge.cli.terminal import console, say
from weighbridge.cli.verbosity import quiet
from weighbridge.customary import shown_amount, shown_unit

if TYPE_CHECKING:
    from weighbridge.pipeline.weighing import Weighing

LOADS = (0.0, 125.0, 240.0)
"""Payloads of the weighing drives [kg] (Jensen 2022, Table B.1)."""
DURATION = 1500.0
"""Of each simulated drive [s]: the first minutes of a route that has all kinds of road."""

PERMITTED = 2060.0
"""Permitted mass that the vehicle file states [kg]: 1.3 times the empty one, as of midsize cars."""


def demo(
    output: Annotated[Path, option("demo --output")] = Path("weighbridge-demo.html"),
    seed: Annotated[int, option("--seed", min=0)] = 7,
    units: Units = "si",
    open_report: Annotated[bool, option("demo --open/--no-open")] = True,
) -> None:
    """Simulate a calibration drive and three loaded drives, weigh them, write a report.

    Example: weighbridge demo --no-open -o demo.html
    """
    from dataclasses import replace

    from weighbridge.calibration import run_calibration
    from weighbridge.pipeline.weighing import DEFAULT_METHOD, weigh
    from weighbridge.report import write_report
    from weighbridge.simulation import make_scenario, simulate_car

    refuse_results(inputs(), [Result("--output", output, "report")])
    weighed: list[tuple[Weighing, float]] = []
    comparisons: list[tuple[Weighing, ...]] = []
    # Shares of the work: a calibration takes twice as long as what is done with each drive.
    with progress("demo", 5 + 3 * len(LOADS)) as bar:
        bar.begin("simulating a drive of known mass", 2)
        shorter = replace(make_scenario("car-calibration", seed=seed), duration=DURATION)
        known = simulate_car(shorter, bar.within)
        bar.begin("calibrating by it", 2)
        calibration = run_calibration(known.drive, float(known.truth.mass[0]), progress=bar.within)
        car = replace(
            calibration.vehicle,
            name="simulated midsize car",
            tare=known.scenario.car.mass,
            gross=PERMITTED,
        )
        for k, load in enumerate(LOADS, 1):
            name = f"{shown_amount(load, 'kg'):+.0f} {shown_unit('kg')}"
            bar.begin(f"simulating a drive with {name}")
            chosen = make_scenario("car", payload=load, seed=seed + k)
            chosen = replace(chosen, name=name, duration=DURATION)
            made = simulate_car(chosen, bar.within)
            bar.begin(f"weighing it by {DEFAULT_METHOD}")
            weighed.append((weigh(made.drive, car), float(made.truth.mass[-1])))
            bar.begin("weighing it by every method")
            comparisons.append(weighed[-1][0].compare())
        bar.begin("writing the report")
        write_report(
            [w for w, _ in weighed],
            output,
            calibration=calibration,
            truth={w.drive.name: mass for w, mass in weighed},
            title="weighbridge demo: a simulated car, weighed three times",
            comparisons=comparisons,
        )
    _show(weighed)
    if not quiet():
        say("true mass: at the end of the drive, fuel burnt on the way taken off")
        say("known beside the recordings: the wind, by a weather report")
        say(f"report: {output}")
    if open_report and sys.stdout.isatty():
        import webbrowser

        webbrowser.open(output.resolve().as_uri())


def _show(weighed: list[tuple[Weighing, float]]) -> None:
    from rich.table import Table

    table = Table()
    unit = shown_unit("kg")
    for name in ("drive", f"true {unit}", f"mass {unit}", "95 % from", "to", "error %"):
        table.add_column(name, justify="right")
    for w, truth in weighed:
        masses = (shown_amount(mass, "kg") for mass in (truth, w.mass, *w.interval(0.95)))
        error = 100.0 * (w.mass / truth - 1.0)
        table.add_row(w.drive.name, *(f"{mass:.0f}" for mass in masses), f"{error:+.2f}")
    console().print(table)
