"""Nguyen 2024: sprung mass, roll and pitch inertia of a truck from its ride, simulated.

Nguyen Tuan Anh: Real-time estimation of vehicle inertia parameters based on Kalman-Bucy
filter, Transport and Communications Science Journal 75(4), 2024, 1593-1603.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from weighbridge.inertia.filter import (
    AXES,
    InertiaTrack,
    RideSamples,
    estimate,
)
from weighbridge.inertia.ride_checks import ride_samples
from weighbridge.papers.nguyen2024_cases import (
    AS_IN_PRINT as AS_IN_PRINT,
)
from weighbridge.papers.nguyen2024_cases import (
    AS_PRINTED as AS_PRINTED,
)
from weighbridge.papers.nguyen2024_cases import (
    AS_VARIANCE as AS_VARIANCE,
)
from weighbridge.papers.nguyen2024_cases import (
    CASES as CASES,
)
from weighbridge.papers.nguyen2024_cases import (
    CHANGES as CHANGES,
)
from weighbridge.papers.nguyen2024_cases import (
    DURATION as DURATION,
)
from weighbridge.papers.nguyen2024_cases import (
    EXTENDED as EXTENDED,
)
from weighbridge.papers.nguyen2024_cases import (
    HIGHER_NOISE as HIGHER_NOISE,
)
from weighbridge.papers.nguyen2024_cases import (
    INVERSE as INVERSE,
)
from weighbridge.papers.nguyen2024_cases import (
    LOWER_NOISE as LOWER_NOISE,
)
from weighbridge.papers.nguyen2024_cases import (
    NOISE as NOISE,
)
from weighbridge.papers.nguyen2024_cases import (
    ORDINARY_SENSORS as ORDINARY_SENSORS,
)
from weighbridge.papers.nguyen2024_cases import (
    PAPERS_CASE as PAPERS_CASE,
)
from weighbridge.papers.nguyen2024_cases import (
    PAPERS_SENSORS as PAPERS_SENSORS,
)
from weighbridge.papers.nguyen2024_cases import (
    PRINTED_NOISE as PRINTED_NOISE,
)
from weighbridge.papers.nguyen2024_cases import (
    START as START,
)
from weighbridge.papers.nguyen2024_cases import (
    Case as Case,
)
from weighbridge.papers.nguyen2024_cases import (
    Settings as Settings,
)
from weighbridge.papers.nguyen2024_items import ITEMS as ITEMS
from weighbridge.papers.reproduced import Comparison, Progress, Reproduced
from weighbridge.report.table import Table
from weighbridge.signals import Floats
from weighbridge.simulation.ride import (
    TRUCK,
    RideScenario,
    RideSensors,
    RideVehicle,
    SimulatedRide,
    simulate_ride,
)
from weighbridge.vehicle.model import Ride

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

SEED: Final = 196_100
"""Of the first road; nothing was chosen on it and those after it."""

ROADS: Final = 20
"""Roads drawn; the paper has one."""

DRAWN: Final = (PAPERS_CASE.name, EXTENDED.name)
"""Cases of which figs. 5 and 6 are drawn: our filter, and beside it the paper's."""

FOLLOWED: Final = {
    "as printed": AS_IN_PRINT,
    "printed noise": PRINTED_NOISE,
    "extended": EXTENDED,
    "inverse": INVERSE,
    "ours": PAPERS_CASE,
}
"""Cases of which all that Table 2 and sec. 5 tell is listed, by the code of their figures."""

SETTINGS: Final = Settings
"""What ``weighbridge reproduce nguyen2024 --set`` changes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RideResult:
    """One run against its truth; arrays (3,) are of the three axes.

    Attributes
    ----------
    rmse : [kg], [kg m^2]
    mape : [-]
    settled, near : (3, 3) time after the start and each change (rows) from which the estimate
        stays within 5 % and within 10 % until the next change [s]
    velocity_rmse : [m/s], [rad/s]
    velocity_mape : [-]
    """

    rmse: Floats
    mape: Floats
    settled: Floats
    near: Floats
    velocity_rmse: Floats
    velocity_mape: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """A run that is drawn."""

    made: SimulatedRide
    track: InertiaTrack


def suspension_of(truck: RideVehicle, sensors: RideSensors, start: float = 1.0) -> Ride:
    """Say what is known of a simulated vehicle: all but its load.

    Parameters
    ----------
    truck
    sensors : whose noise is known
    start : where the estimate begins, over the truck's parameters [-]
    """
    vertical, roll, pitch = sensors.body_noise
    return Ride(
        front_stiffness=truck.stiffness[0],
        rear_stiffness=truck.stiffness[2],
        front_damping=truck.damping[0],
        rear_damping=truck.damping[2],
        front_track=truck.track[0],
        rear_track=truck.track[1],
        front_axle=truck.axle_distance[0],
        rear_axle=truck.axle_distance[1],
        front_unsprung=truck.unsprung_mass[0],
        rear_unsprung=truck.unsprung_mass[1],
        sprung_mass=start * truck.sprung_mass,
        roll_inertia=start * truck.roll_inertia,
        pitch_inertia=start * truck.pitch_inertia,
        force_std=0.0,
        travel_noise=sensors.travel_noise,
        rate_noise=sensors.rate_noise,
        vertical_velocity_noise=vertical,
        roll_rate_noise=roll,
        pitch_rate_noise=pitch,
    )


def simulate(seed: int, sensors: RideSensors, settings: Settings | None = None) -> SimulatedRide:
    """Simulate the paper's experiment, or that of the settings, on one road."""
    settings = settings or Settings()
    return simulate_ride(
        RideScenario(
            road_class="C",
            speed=settings.speed,
            duration=DURATION,
            changes=settings.changes,
            shake=settings.shake,
            sensors=sensors,
            seed=seed,
        )
    )


def run(case: Case, made: SimulatedRide, start: float = START) -> InertiaTrack:
    """Run the filter of a case from ``start`` times the nominal parameters."""
    ride = suspension_of(TRUCK, case.sensors, start)
    samples: RideSamples = ride_samples(made.drive)
    return estimate(samples, ride, case.method, case.settings)


def judge(made: SimulatedRide, track: InertiaTrack) -> RideResult:
    """Compare a run with its truth, eq. 10."""
    error = track.parameters - made.inertias
    relative = np.abs(error / made.inertias)
    slip = track.velocity - made.velocities
    return RideResult(
        rmse=np.sqrt(np.mean(error**2, axis=0)),
        mape=np.mean(relative, axis=0),
        settled=_settled(made, track.time, relative, 0.05),
        near=_settled(made, track.time, relative, 0.10),
        velocity_rmse=np.sqrt(np.mean(slip**2, axis=0)),
        velocity_mape=np.mean(np.abs(slip / made.velocities), axis=0),
    )


def _settled(made: SimulatedRide, time: Floats, relative: Floats, band: float) -> Floats:
    """Time after the start and each change from which errors (n, 3) stay within a band (3, 3)."""
    edges = np.searchsorted(time, (0.0, *(t for t, _ in made.scenario.changes), np.inf))
    settled = np.zeros((3, 3))
    for k in range(3):
        a, b = edges[k], edges[k + 1]
        outside = relative[a:b] > band
        # Samples until the last one outside, that one counted.
        count = np.where(outside.any(axis=0), b - a - np.argmax(outside[::-1], axis=0), 0)
        settled[k] = count / made.scenario.sensors.rate
    return settled


def reproduce(
    *,
    seed: int = SEED,
    roads: int = ROADS,
    cases: tuple[Case, ...] = CASES,
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
        panels.append(innovation_panel(shown[PAPERS_CASE.name].track))
        write_study("Nguyen 2024, reproduced on simulated rides", tables, panels, path)

    return Reproduced(
        title=f"Nguyen 2024, {ROADS} random roads of class C, seeds {seed} to {seed + ROADS - 1}"
        f"{apart}, median of the roads unless said",
        tables=(_table_2(results[PAPERS_CASE.name]), _cases_table(results)),
        comparisons=_comparisons(results),
        write_page=write,
        figures=_figures(results),
    )


def _titled(panel: Panel, case: str, caption: str) -> Panel:
    """Say by which filter a figure of the paper is."""
    return replace(panel, title=f"{panel.title}: {case}", caption=caption)


def _figures(results: dict[str, list[RideResult]]) -> dict[str, str]:
    """Figures that the paper's items ask for: mass / roll / pitch."""
    of_case = {
        "mape": PAPERS_CASE,
        "mape inverse": INVERSE,
        "mape extended": EXTENDED,
        "mape printed noise": PRINTED_NOISE,
        "mape lower noise": LOWER_NOISE,
        "mape higher noise": HIGHER_NOISE,
        "mape as printed": AS_IN_PRINT,
        "mape variance": AS_VARIANCE,
        "mape ordinary": ORDINARY_SENSORS,
    }
    followed = {
        f"{name} {code}": text
        for code, case in FOLLOWED.items()
        if case.name in results
        for name, text in _followed(results[case.name]).items()
    }
    return {
        **followed,
        **{
            name: f"{_three(100.0 * np.median(_each(results[case.name], 'mape'), axis=0))} %"
            for name, case in of_case.items()
            if case.name in results
        },
    }


def _followed(found: list[RideResult]) -> dict[str, str]:
    """RMSE, errors of the velocities and time to follow of a filter.

    Of the roads the median; of the times how often a parameter was later than in print.
    """
    near = _each(found, "near")[:, 1:]
    middle = {n: np.median(_each(found, n), axis=0)
              for n in ("rmse", "velocity_rmse", "velocity_mape")}  # fmt: skip
    return {
        "rmse": "{:.1f} kg / {:.1f} / {:.1f} kg m²".format(*middle["rmse"]),
        "velocity rmse": "{:.5f} m/s / {:.5f} / {:.5f} rad/s".format(*middle["velocity_rmse"]),
        "velocity mape": f"{_three(100.0 * middle['velocity_mape'])} %",
        "near": f"{np.median(near):.2f} s, {np.max(near):.2f} s at worst; "
        f"{np.count_nonzero(near > PAPER_TIME)} of {near.size} later than {PAPER_TIME:g} s",
    }


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


def _comparisons(results: dict[str, list[RideResult]]) -> tuple[Comparison, ...]:
    """Figures beside the paper's: its filter by one fixed Q first, then ours, which has none."""
    found = results[PAPERS_CASE.name]
    near = float(np.max(_each(found, "near")[:, 1:]))
    rows = []
    for case in FOLLOWED.values():
        if case is not PAPERS_CASE and (run := results.get(case.name)):
            rows += _usual(case.name, run)
    rows += _worst(found, "mape", "ours by hypotheses of jumps: MAPE", AXES, PAPER_MAPE)
    rows += _worst(found, "rmse", "ours: RMSE", AXES, PAPER_RMSE)
    rows.append(
        Comparison("ours: longest time after a change until within 10 % for good, all parameters",
                   f"{PAPER_TIME:g} s", f"{near:.2f} s", near <= PAPER_TIME, like_for_like=False)
    )  # fmt: skip
    rates = ("vertical velocity", "roll rate", "pitch rate")
    rows += _worst(found, "velocity_rmse", "ours: RMSE", rates, PAPER_VELOCITY_RMSE)
    for k, axis in enumerate(rates):
        usual = float(np.median(100.0 * _each(found, "velocity_mape")[:, k]))
        rows.append(
            Comparison(f"ours: MAPE of the {axis}, median road", f"{PAPER_VELOCITY_MAPE[k]} %",
                       f"{usual:.3f} %", usual <= PAPER_VELOCITY_MAPE[k], like_for_like=False)
        )  # fmt: skip
    return tuple(rows)


def _usual(name: str, run: list[RideResult]) -> list[Comparison]:
    """Compare a filter with a fixed Q on the median road with all of Table 2, and with sec. 5."""
    rows = []
    for words, field, theirs, scale, form, unit in (
        ("MAPE of mass, roll and pitch", "mape", PAPER_MAPE, 100.0, ".2f", " %"),
        ("RMSE of mass, roll and pitch", "rmse", PAPER_RMSE, 1.0, ".1f", ""),
        ("RMSE of the velocities", "velocity_rmse", PAPER_VELOCITY_RMSE, 1.0, ".5f", ""),
        ("MAPE of the velocities", "velocity_mape", PAPER_VELOCITY_MAPE, 100.0, ".2f", " %"),
    ):
        middle = scale * np.median(_each(run, field), axis=0)
        rows.append(
            Comparison(f"{words}, {name}, median road", _three(np.array(theirs), "g") + unit,
                       _three(middle, form) + unit, bool(np.all(middle <= theirs)))
        )  # fmt: skip
    near = _each(run, "near")[:, 1:]
    rows.append(
        Comparison(f"time after a change until within 10 % for good, {name}, median",
                   f"{PAPER_TIME:g} s", f"{np.median(near):.2f} s, {np.max(near):.2f} s at worst",
                   bool(np.median(near) <= PAPER_TIME))
    )  # fmt: skip
    return rows


def _worst(
    found: list[RideResult], name: str, title: str, axes: Sequence[str], theirs: Sequence[float]
) -> list[Comparison]:
    """Compare the worst road with print, axis by axis; ours has another model of the changes."""
    scale, form, unit = {
        "mape": (100.0, ".2f", " %"), "rmse": (1.0, ".1f", ""), "velocity_rmse": (1.0, ".5f", ""),
    }[name]  # fmt: skip
    worst = np.max(scale * _each(found, name), axis=0)
    return [
        Comparison(f"{title} of the {axis}, worst road", f"{paper}{unit}", f"{ours:{form}}{unit}",
                   bool(ours <= paper), like_for_like=False)
        for axis, paper, ours in zip(axes, theirs, worst, strict=True)
    ]  # fmt: skip
