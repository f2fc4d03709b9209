"""Nguyen 2024: sprung mass, roll and pitch inertia of a truck from its ride, simulated.

Nguyen Tuan Anh: Real-time estimation of vehicle inertia parameters based on Kalman-Bucy
filter, Transport and Communications Science Journal 75(4), 2024, 1593-1603.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from weighbridge.inertia import AXES, InertiaTrack, RideSamples, estimate, ride_samples
from weighbridge.papers import nguyen2024_cases as cases
from weighbridge.papers.claims import Found, items_of, listed, read_rows, same
from weighbridge.papers.nguyen2024_cases import Case, Settings
from weighbridge.papers.nguyen2024_cases import RideResult as RideResult
from weighbridge.papers.nguyen2024_cases import judge as judge
from weighbridge.papers.nguyen2024_cases import suspension_of as suspension_of
from weighbridge.papers.nguyen2024_equations import equations
from weighbridge.papers.reproduced import Progress, Reproduced
from weighbridge.report.table import Table
from weighbridge.signals import Floats
from weighbridge.simulation import TRUCK, RideScenario, RideSensors, SimulatedRide, simulate_ride

if TYPE_CHECKING:
    from pathlib import Path

    from weighbridge.report.style import Panel

PAPER_RMSE: Final = (509.4, 566.7, 1829.5)
PAPER_MAPE: Final = (4.18, 3.29, 3.51)
PAPER_VELOCITY_RMSE: Final = (0.007, 0.014, 0.012)
PAPER_VELOCITY_MAPE: Final = (3.50, 1.21, 0.851)
"""Table 2; masses, inertias and percent."""

PAPER_TIME: Final = 0.5
"""Until within 10 % of the changed parameters, sec. 5 [s]."""

_ROWS: Final = read_rows("nguyen2024")


def _of_each() -> Iterator[dict[str, str]]:
    """Yield what Table 2 and sec. 5 state, by each filter."""
    for filter_ in _ROWS["filters"]:
        code, words = filter_.pop("code"), filter_.pop("words")
        for row in _ROWS["of_each"]:
            yield {
                **filter_,
                **row,
                "what": f"{row['what']}, {words}",
                "ours": f"{{{row['ours']} {code}}}",
                "why": listed(filter_["why"], row.get("why", "")),
            }


ITEMS: Final = (*items_of(_ROWS["items"]), *items_of(_of_each()))
"""In the paper's order; mass / roll / pitch, median of the roads unless said."""

SEED: Final = 196_100
"""Of the first road; nothing was chosen on it and those after it."""

ROADS: Final = 20
"""Roads drawn; the paper has one."""

DRAWN: Final = (cases.PAPERS_CASE.name, cases.EXTENDED.name)
"""Cases of which figs. 5 and 6 are drawn: our filter, and beside it the paper's."""

FOLLOWED: Final = {
    "as printed": cases.AS_IN_PRINT,
    "printed noise": cases.PRINTED_NOISE,
    "extended": cases.EXTENDED,
    "inverse": cases.INVERSE,
    "ours": cases.PAPERS_CASE,
}
"""Cases of which all that Table 2 and sec. 5 state is listed, by the code of their figures."""

SETTINGS: Final = Settings
"""What ``weighbridge reproduce nguyen2024 --set`` changes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """A run that is drawn."""

    made: SimulatedRide
    track: InertiaTrack


def simulate(seed: int, sensors: RideSensors, settings: Settings | None = None) -> SimulatedRide:
    """Simulate the paper's experiment, or that of the settings, on one road."""
    settings = settings or Settings()
    return simulate_ride(
        RideScenario(
            road_class="C",
            speed=settings.speed,
            duration=cases.DURATION,
            changes=settings.changes,
            shake=settings.shake,
            sensors=sensors,
            seed=seed,
        )
    )


def run(case: Case, made: SimulatedRide, start: float = cases.START) -> InertiaTrack:
    """Run the filter of a case from ``start`` times the nominal parameters."""
    ride = suspension_of(TRUCK, case.sensors, start)
    samples: RideSamples = ride_samples(made.drive)
    return estimate(samples, ride, case.method, case.settings)


def reproduce(
    *,
    seed: int = SEED,
    roads: int = ROADS,
    cases: tuple[Case, ...] = cases.CASES,
    progress: Progress | None = None,
    settings: Settings | None = None,
) -> tuple[dict[str, list[RideResult]], dict[str, Shown]]:
    """Run all cases on random roads.

    Parameters
    ----------
    seed : of the first road; the others count on from it
    roads : how many
    cases : what to run
    progress : called with runs done and runs in all
    settings : in place of the paper's

    Returns
    -------
    results : by the case's name, one per road
    shown : those of `DRAWN` on the first road, by the case's name
    """
    results: dict[str, list[RideResult]] = {case.name: [] for case in cases}
    shown: dict[str, Shown] = {}
    settings = settings or Settings()
    cases = tuple(map(settings.of, cases))
    for number in range(roads):
        for k, case in enumerate(cases):
            made = simulate(seed + number, case.sensors, settings)
            track = run(case, made, settings.start)
            results[case.name].append(judge(made, track))
            if number == 0 and case.name in DRAWN:
                shown[case.name] = Shown(made=made, track=track)
            if progress:
                progress(number * len(cases) + k + 1, roads * len(cases))
    return results, shown


def reproduced(
    seed: int, progress: Progress | None, settings: Settings | None = None
) -> Reproduced:
    """Reproduce the paper and put it beside its own figures; see `reproduce`."""
    results, shown = reproduce(seed=seed, progress=progress, settings=settings)
    apart = ", on which nothing was chosen" if seed >= SEED else ""

    def write(tables: Sequence[Table], path: Path) -> None:
        from weighbridge.report.inertia_panels import (
            innovation_panel,
            parameter_panels,
            velocity_panels,
        )
        from weighbridge.report.study import write_study

        panels: list[Panel] = []
        for name, run in shown.items():
            six = parameter_panels(run.track, np.zeros(3), truth=run.made.inertias)
            five = velocity_panels(run.track, run.made.velocities, "true")
            panels += [_titled(p, name, f"Figure 6 of the paper. {p.caption}") for p in six]
            panels += [_titled(p, name, "Figure 5 of the paper, five seconds.") for p in five]
        panels.append(innovation_panel(shown[cases.PAPERS_CASE.name].track))
        write_study("Nguyen 2024, reproduced on simulated rides", tables, panels, path)

    figures = _figures(results)
    return Reproduced(
        title="Nguyen 2024",
        note=f"{ROADS} random roads of class C, seeds {seed} to {seed + ROADS - 1}{apart}, median "
        "of the roads unless said",
        tables=(_table_2(results[cases.PAPERS_CASE.name]), _cases_table(results)),
        rows=tuple(item.row("nguyen2024", figures) for item in ITEMS),
        write_page=write,
    )


def _titled(panel: Panel, case: str, caption: str) -> Panel:
    """Say by which filter a figure of the paper is."""
    return replace(panel, title=f"{panel.title}: {case}", caption=caption)


def _figures(results: dict[str, list[RideResult]]) -> dict[str, Found]:
    """Figures that the paper's items ask for: mass / roll / pitch."""
    found = equations()
    for code, case in FOLLOWED.items():
        found |= {f"{name} {code}": f for name, f in followed(results[case.name]).items()}
    by_noise = [
        100.0 * np.median(_each(results[case.name], "mape"), axis=0)
        for case in (cases.HIGHER_NOISE, cases.PRINTED_NOISE, cases.LOWER_NOISE)
    ]
    falls = bool(np.all(np.diff(by_noise, axis=0) < 0.0))
    found["sections"] = Found("; ".join(f"{_three(each)} %" for each in by_noise), falls)
    printed = (5394.0, 4600.0, 19_632.0, 266.0, 427.0, 7733.0, 9804.0, 177_000.0, 193_844.0,
               493_211.0, 986_422.0, 2.400, 1.685, 1.705, 1.495)  # fmt: skip
    car = TRUCK
    ours = (*car.inertias, *car.unsprung_mass, *car.damping[::2], *car.stiffness[::2],
            *car.tyre_stiffness[::2], *car.axle_distance, *car.track)  # fmt: skip
    found["table 1"] = same(np.array(printed), np.array(ours))
    return found


def followed(found: list[RideResult]) -> dict[str, Found]:
    """What Table 2 and sec. 5 state of a filter: of the roads the median."""
    near = _each(found, "near")[:, 1:]
    mape, rmse, velocity_rmse, velocity_mape = (
        np.median(_each(found, n), axis=0)
        for n in ("mape", "rmse", "velocity_rmse", "velocity_mape")
    )
    return {
        "mape": _below(f"{_three(100.0 * mape)} %", 100.0 * mape, PAPER_MAPE),
        "rmse": _below("{:.1f} kg / {:.1f} / {:.1f} kg m²".format(*rmse), rmse, PAPER_RMSE),
        "velocity rmse": _below("{:.5f} m/s / {:.5f} / {:.5f} rad/s".format(*velocity_rmse),
                                velocity_rmse, PAPER_VELOCITY_RMSE),
        "velocity mape": _below(f"{_three(100.0 * velocity_mape)} %", 100.0 * velocity_mape,
                                PAPER_VELOCITY_MAPE),
        "near": Found(
            f"{np.median(near):.2f} s, {np.max(near):.2f} s at worst; "
            f"{np.count_nonzero(near > PAPER_TIME)} of {near.size} later",
            bool(np.median(near) <= PAPER_TIME),
        ),
    }  # fmt: skip


def _below(text: str, values: Floats, printed: Sequence[float]) -> Found:
    """Judge values that may not be above print."""
    return Found(text, bool(np.all(values <= np.array(printed))))


def _three(values: Floats, form: str = ".2f") -> str:
    return " / ".join(f"{v:{form}}" for v in values)


def _each(found: list[RideResult], name: str) -> Floats:
    return np.array([getattr(r, name) for r in found])


def _table_2(found: list[RideResult]) -> Table:
    rows = []
    for label, name, theirs, scale, form in (
        ("RMSE kg, kg m²", "rmse", PAPER_RMSE, 1.0, ".1f"),
        ("MAPE %", "mape", PAPER_MAPE, 100.0, ".2f"),
        ("RMSE of the velocities m/s, rad/s", "velocity_rmse", PAPER_VELOCITY_RMSE, 1.0, ".6f"),
        ("MAPE of the velocities %", "velocity_mape", PAPER_VELOCITY_MAPE, 100.0, ".2f"),
    ):
        values = scale * _each(found, name)
        for k, axis in enumerate(AXES if "velocity" not in name else ("vertical", "roll", "pitch")):
            rows.append(
                (
                    f"{label}: {axis}",
                    f"{theirs[k]:g}",
                    f"{np.median(values[:, k]):{form}}",
                    f"{np.max(values[:, k]):{form}}",
                )
            )
    return Table(
        f"Table 2 of the paper, {len(found)} roads", ("", "paper", "median", "worst"), tuple(rows)
    )


def _cases_table(results: dict[str, list[RideResult]]) -> Table:
    rows = []
    for name, found in results.items():
        mape = 100.0 * _each(found, "mape")
        slip = np.median(_each(found, "velocity_rmse"), axis=0)
        part = 100.0 * np.median(_each(found, "velocity_mape"), axis=0)
        rows.append(
            (
                name,
                _three(np.median(mape, axis=0)),
                _three(np.max(mape, axis=0)),
                _three(np.max(_each(found, "near"), axis=(0, 2))),
                _three(slip, ".5f"),
                _three(part),
            )
        )
    return Table(
        "Filters and readings: mass / roll / pitch; from the start / first / second change",
        ("filter and reading", "median MAPE %", "worst MAPE %", "10 % for good after s",
         "median RMSE of the velocities m/s, rad/s", "median MAPE of the velocities %"),
        tuple(rows),
    )  # fmt: skip
