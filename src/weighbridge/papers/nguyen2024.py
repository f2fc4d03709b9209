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
    Method,
    RideSamples,
    estimate,
)
from weighbridge.inertia.ride_checks import ride_samples
from weighbridge.inertia.settings import InertiaSettings
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

CHANGES: Final = ((7.0, 1.5), (14.0, 0.5))
"""Times and factors on the nominal parameters, sec. 4 [s], [-]."""

DURATION: Final = 20.0
"""Chosen: the text names no end [s]."""

SPEED: Final = 60.0 / 3.6
"""Chosen: none is given, and so a truck goes on a road of class C [m/s]."""

START: Final = 2.0
"""Where the estimate begins, over the nominal parameters, sec. 4 [-]."""

SHAKE: Final = 1e-3
"""Process noise w of sec. 4, read as standard deviation of accelerations [m/s^2], [rad/s^2]."""

NOISE: Final = (1e-3, 1e-4, 1e-4)
"""Measurement noise v of sec. 4, read as standard deviation of a sample [m/s], [rad/s]."""

RATE: Final = 1000.0
"""Chosen, for Simulink's continuous time [Hz]."""

PAPER_RMSE: Final = (509.4, 566.7, 1829.5)
PAPER_MAPE: Final = (4.18, 3.29, 3.51)
PAPER_VELOCITY_RMSE: Final = (0.007, 0.014, 0.012)
PAPER_VELOCITY_MAPE: Final = (3.50, 1.21, 0.851)
"""Table 2; masses, inertias and percent."""

SEED: Final = 196_100
"""Of the first road; nothing was chosen on it and those after it."""

ROADS: Final = 20
"""Roads drawn; the paper has one."""

AS_PRINTED: Final = InertiaSettings(offset_std=0.0)
"""No offset of the sensors and no weight in them, as the paper's model has none."""


PAPERS_SENSORS: Final = RideSensors(rate=RATE, travel_noise=0.0, rate_noise=0.0, body_noise=NOISE)
"""The suspension is measured without noise: its signals are the simulation's own outputs."""


@dataclass(frozen=True, slots=True)
class Case:
    """One way to read and run the experiment.

    Attributes
    ----------
    name : for people
    method : filter
    settings : of the filter
    sensors : what is measured
    """

    name: str
    method: Method = "kalman-bucy"
    settings: InertiaSettings = AS_PRINTED
    sensors: RideSensors = PAPERS_SENSORS


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """What the paper varies, in each case that differs from its experiment elsewhere.

    Attributes
    ----------
    filter : of the paper's model
    body_noise : spectral densities of the body's measured rates, where a case has no others
        [m^2/s], [rad^2 s]
    """

    filter: InertiaSettings = AS_PRINTED
    body_noise: tuple[float, float, float] = NOISE

    def of(self, case: Case) -> Case:
        """Return the case with these values in place of the paper's."""
        changed = case
        if case.settings == AS_PRINTED:
            changed = replace(changed, settings=self.filter)
        if case.sensors == PAPERS_SENSORS:
            sensors = replace(PAPERS_SENSORS, body_noise=self.body_noise)
            changed = replace(changed, sensors=sensors)
        return changed


SETTINGS: Final = Settings
"""What ``weighbridge reproduce nguyen2024 --set`` changes."""

PAPERS_CASE: Final = Case("inverse form, with hypotheses of jumps")

PRINTED_NOISE: Final = Case(
    "extended, Q and R as printed",
    "extended",
    InertiaSettings(
        offset_std=0.0, process_densities=(1.0,) * 6, noise_densities=(5e-5, 5e-4, 5e-4)
    ),
)
"""Q = I, of which five are printed and six needed, and R, sec. 4, as spectral densities."""

AS_VARIANCE: Final = Case(
    "with jumps, noise read as variance",
    sensors=replace(PAPERS_SENSORS, body_noise=(NOISE[0] ** 0.5, NOISE[1] ** 0.5, NOISE[2] ** 0.5)),
)

ORDINARY_SENSORS: Final = Case("with jumps, ordinary sensors at 500 Hz", sensors=RideSensors())

INVERSE: Final = Case("inverse form, one fixed process noise", "inverse")
EXTENDED: Final = Case("extended, one fixed process noise", "extended")
AS_IN_PRINT: Final = Case("as printed, A_02 = 0", "printed")

CASES: Final = (
    PAPERS_CASE,
    INVERSE,
    EXTENDED,
    PRINTED_NOISE,
    AS_IN_PRINT,
    Case("with jumps, offsets of all sensors unknown", settings=InertiaSettings()),
    AS_VARIANCE,
    ORDINARY_SENSORS,
)
"""The paper's experiment first, then what changes with filter and noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RideResult:
    """One run against its truth; arrays (3,) are of the three axes.

    Attributes
    ----------
    rmse : [kg], [kg m^2]
    mape : [-]
    settled : (3, 3) time after the start and each change (rows) from which the estimate
        stays within 5 % until the next change [s]
    velocity_rmse : [m/s], [rad/s]
    velocity_mape : [-]
    """

    rmse: Floats
    mape: Floats
    settled: Floats
    velocity_rmse: Floats
    velocity_mape: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """The run that is drawn."""

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


def simulate(seed: int, sensors: RideSensors) -> SimulatedRide:
    """Simulate the paper's experiment on one road."""
    return simulate_ride(
        RideScenario(
            road_class="C",
            speed=SPEED,
            duration=DURATION,
            changes=CHANGES,
            shake=SHAKE,
            sensors=sensors,
            seed=seed,
        )
    )


def run(case: Case, made: SimulatedRide) -> InertiaTrack:
    """Run the filter of a case."""
    ride = suspension_of(TRUCK, case.sensors, START)
    samples: RideSamples = ride_samples(made.drive)
    return estimate(samples, ride, case.method, case.settings)


def judge(made: SimulatedRide, track: InertiaTrack) -> RideResult:
    """Compare a run with its truth, eq. 10."""
    error = track.parameters - made.inertias
    relative = np.abs(error / made.inertias)
    edges = np.searchsorted(track.time, (0.0, *(t for t, _ in CHANGES), np.inf))
    settled = np.zeros((3, 3))
    for k in range(3):
        a, b = edges[k], edges[k + 1]
        outside = relative[a:b] > 0.05
        # Samples until the last one outside, that one counted.
        count = np.where(outside.any(axis=0), b - a - np.argmax(outside[::-1], axis=0), 0)
        settled[k] = count / made.scenario.sensors.rate
    slip = track.velocity - made.velocities
    return RideResult(
        rmse=np.sqrt(np.mean(error**2, axis=0)),
        mape=np.mean(relative, axis=0),
        settled=settled,
        velocity_rmse=np.sqrt(np.mean(slip**2, axis=0)),
        velocity_mape=np.mean(np.abs(slip / made.velocities), axis=0),
    )


def reproduce(
    *,
    seed: int = SEED,
    roads: int = ROADS,
    cases: tuple[Case, ...] = CASES,
    progress: Progress | None = None,
    settings: Settings | None = None,
) -> tuple[dict[str, list[RideResult]], Shown]:
    """Run all cases on random roads.

    Parameters
    ----------
    seed : of the first road; the others count on from it
    roads : how many
    cases : what to run; the first is drawn
    progress : called with runs done and runs in all
    settings : in place of the paper's

    Returns
    -------
    results : by the case's name, one per road
    shown : the first case on the first road
    """
    results: dict[str, list[RideResult]] = {case.name: [] for case in cases}
    first = None
    settings = settings or Settings()
    cases = tuple(map(settings.of, cases))
    for number in range(roads):
        for k, case in enumerate(cases):
            made = simulate(seed + number, case.sensors)
            track = run(case, made)
            results[case.name].append(judge(made, track))
            first = first or Shown(made=made, track=track)
            if progress:
                progress(number * len(cases) + k + 1, roads * len(cases))
    assert first is not None
    return results, first


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

        panels = [
            replace(panel, caption=f"Figure 6 of the paper. {panel.caption}")
            for panel in parameter_panels(shown.track, np.zeros(3), truth=shown.made.inertias)
        ]
        panels += [
            replace(panel, caption="Figure 5 of the paper, five seconds of it.")
            for panel in velocity_panels(shown.track, shown.made.velocities, "true")
        ]
        panels.append(innovation_panel(shown.track))
        write_study("Nguyen 2024, reproduced on simulated rides", tables, panels, path)

    return Reproduced(
        title=f"Nguyen 2024, {ROADS} random roads of class C, seeds {seed} to {seed + ROADS - 1}"
        f"{apart}, median of the roads unless said",
        tables=(_table_2(results[PAPERS_CASE.name]), _cases_table(results)),
        comparisons=_comparisons(results[PAPERS_CASE.name]),
        write_page=write,
        figures=_figures(results),
    )


def _figures(results: dict[str, list[RideResult]]) -> dict[str, str]:
    """Figures that the paper's items ask for: mass / roll / pitch."""
    found = results[PAPERS_CASE.name]

    def three(values: Floats, form: str = ".2f") -> str:
        return " / ".join(f"{v:{form}}" for v in np.median(values, axis=0))

    of_case = {
        "mape": PAPERS_CASE,
        "mape inverse": INVERSE,
        "mape extended": EXTENDED,
        "mape printed noise": PRINTED_NOISE,
        "mape as printed": AS_IN_PRINT,
        "mape variance": AS_VARIANCE,
        "mape ordinary": ORDINARY_SENSORS,
    }
    settled = float(np.max(_each(found, "settled")[:, 1:]))
    return {
        **{
            name: f"{three(100.0 * _each(results[case.name], 'mape'))} %"
            for name, case in of_case.items()
            if case.name in results
        },
        "rmse": f"{three(_each(found, 'rmse'), '.1f')}",
        "velocity rmse": three(_each(found, "velocity_rmse"), ".5f"),
        "velocity mape": f"{three(100.0 * _each(found, 'velocity_mape'))} %",
        "settled": f"{settled:.2f} s at worst",
    }


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
        settled = _each(found, "settled")
        rows.append(
            (
                name,
                " / ".join(f"{v:.2f}" for v in np.median(mape, axis=0)),
                " / ".join(f"{v:.2f}" for v in np.max(mape, axis=0)),
                " / ".join(f"{v:.2f}" for v in np.max(settled, axis=(0, 2))),
            )
        )
    return Table(
        "Filters and readings: mass / roll / pitch; from the start / first / second change",
        ("filter and reading", "median MAPE %", "worst MAPE %", "5 % for good after s"),
        tuple(rows),
    )


def _comparisons(found: list[RideResult]) -> tuple[Comparison, ...]:
    mape, rmse = 100.0 * _each(found, "mape"), _each(found, "rmse")
    settled = float(np.max(_each(found, "settled")[:, 1:]))
    slip, slip_part = _each(found, "velocity_rmse"), 100.0 * _each(found, "velocity_mape")
    rows = []
    for k, axis in enumerate(AXES):
        rows.append(
            Comparison(f"MAPE of the {axis}, worst road", f"{PAPER_MAPE[k]} %",
                       f"{np.max(mape[:, k]):.2f} %", bool(np.max(mape[:, k]) <= 1.0))
        )  # fmt: skip
    for k, axis in enumerate(AXES):
        worst = float(np.max(rmse[:, k]))
        rows.append(
            Comparison(f"RMSE of the {axis}, worst road", f"{PAPER_RMSE[k]}",
                       f"{worst:.1f}", worst <= PAPER_RMSE[k])
        )  # fmt: skip
    rows.append(
        Comparison("longest time after a change until within 5 % for good, all parameters",
                   "0.5 s, within 10 %", f"{settled:.2f} s", settled <= 0.3)
    )  # fmt: skip
    for k, axis in enumerate(("vertical velocity", "roll rate", "pitch rate")):
        worst = float(np.max(slip[:, k]))
        rows.append(
            Comparison(f"RMSE of the {axis}, worst road", f"{PAPER_VELOCITY_RMSE[k]}",
                       f"{worst:.5f}", worst <= PAPER_VELOCITY_RMSE[k])
        )  # fmt: skip
    for k, axis in enumerate(("vertical velocity", "roll rate", "pitch rate")):
        middle = float(np.median(slip_part[:, k]))
        rows.append(
            Comparison(f"MAPE of the {axis}, median road", f"{PAPER_VELOCITY_MAPE[k]} %",
                       f"{middle:.3f} %", middle <= PAPER_VELOCITY_MAPE[k])
        )  # fmt: skip
    return tuple(rows)
