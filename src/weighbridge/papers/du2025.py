"""Du et al. 2025: bus mass by robust least squares, Kalman filter and their blend.

J. Du, Q. Wang, X. Yuan: Estimating bus mass using a hybrid approach: integrating
forgetting factor recursive least squares with the extended Kalman filter,
Sensors 25(6), 2025, 1741.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.calibration.run import run_calibration
from weighbridge.estimators import MassTrack, ekf, hybrid, robust_rls
from weighbridge.papers.du2025_bus import LOADS, data_sheet, known_bus, simulate
from weighbridge.papers.reproduced import Comparison, Progress, Reproduced
from weighbridge.pipeline.weighing import weigh
from weighbridge.report.style import BLUE, GREEN, GREY, ORANGE, VERMILLION, Panel, blank, line
from weighbridge.report.table import Table
from weighbridge.signals import Floats
from weighbridge.signals.units import from_si, scalar_from_si
from weighbridge.vehicle.data_sheet import wheel_efficiency
from weighbridge.vehicle.model import (
    Vehicle,
)

if TYPE_CHECKING:
    from pathlib import Path

    from weighbridge.simulation import SimulatedDrive

METHODS: Final = ("robust-rls", "ekf", "hybrid")

PAPER_RMSE: Final = {
    "no-load": (324.73, 299.26, 273.84),
    "half-load": (589.27, 389.16, 100.95),
    "full-load": (718.43, 275.46, 228.91),
}
"""Table 2, in the order of `METHODS` [kg]."""

PAPER_TIME: Final = {
    "no-load": (9.2, 12.3, 12.5),
    "half-load": (9.0, 13.1, 13.6),
    "full-load": (9.4, 12.9, 13.7),
}
"""Table 2, computing time [s]."""

CONVERGED: Final = 21.0
"""From when the paper's least squares count as converged [s] (sec. 4.2)."""

BAND: Final = 0.10
"""Largest relative error after convergence that the paper states [-]."""

DRIVES: Final = 3
"""Drives judged at each load."""

CALIBRATION_SEED: Final = 1_000_000
"""Added to the seed of the judged drives for those of the calibration."""

CALIBRATION_DRIVES: Final = 2
"""Drives of known mass at each load that the bus is calibrated on."""

COLOURS: Final = dict(zip(METHODS, (ORANGE, GREEN, BLUE), strict=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How the paper's experiment is done.

    Attributes
    ----------
    count_grade_twice : in the regressor, as eq. 14 is printed
    """

    count_grade_twice: bool = False

    @property
    def estimators(self) -> dict[str, Callable[[ForceBalance, Vehicle], MassTrack]]:
        """The three methods with these settings."""
        least = robust_rls.RobustRlsSettings(count_grade_twice=self.count_grade_twice)
        kalman = ekf.EkfSettings(start=least)
        return {
            "robust-rls": partial(robust_rls.estimate, settings=least),
            "ekf": partial(ekf.estimate, settings=kalman),
            "hybrid": partial(hybrid.estimate, settings=hybrid.HybridSettings(ekf=kalman)),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveResult:
    """How one drive went, by method.

    Attributes
    ----------
    load : of `LOADS`
    seed : of the drive
    true_mass : mean over the drive [kg]
    tracks : of each method
    rmse : of the running mass from the first one told [kg]
    late_rmse : the same from `CONVERGED` [kg]
    worst : largest relative error of the running mass from `CONVERGED` [-]
    held : part of the instants from `CONVERGED` whose 95 % interval holds the truth [-]
    seconds : computing time of each method, forces and motion given [s]
    twice_rmse : of robust-rls with the grade counted twice [kg]
    """

    load: str
    seed: int
    true_mass: float
    tracks: dict[str, MassTrack]
    rmse: dict[str, float]
    late_rmse: dict[str, float]
    worst: dict[str, float]
    held: dict[str, float]
    seconds: dict[str, float]
    twice_rmse: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproduction:
    """All the figures.

    Attributes
    ----------
    drives : as in the paper, the bus known
    road : with all effects, the bus calibrated on other drives
    sheet : of the latter the first at each load, with the data sheet alone
    vehicle : as calibrated
    """

    drives: tuple[DriveResult, ...]
    road: tuple[DriveResult, ...]
    sheet: tuple[DriveResult, ...]
    vehicle: Vehicle


def judge(load: str, made: SimulatedDrive, vehicle: Vehicle) -> DriveResult:
    """Weigh one drive by all methods and compare with the truth."""
    mass = float(np.mean(made.truth.mass))
    weighed = weigh(made.drive, vehicle, "hybrid").result
    if weighed is None:
        raise RuntimeError(f"{load}, seed {made.scenario.seed}: nothing was weighed")
    balance = weighed.balance
    tracks: dict[str, MassTrack] = {}
    rmse, late_rmse, worst, held, seconds = {}, {}, {}, {}, {}
    for name, estimate in Settings().estimators.items():
        begin = time.perf_counter()
        track = estimate(balance, vehicle)
        seconds[name] = time.perf_counter() - begin
        tracks[name] = track
        error = track.running_mass - mass
        settled = track.time >= made.drive.start + CONVERGED
        late = error[settled]
        held[name] = float(np.mean(np.abs(late) < 1.96 * track.running_std[settled]))
        rmse[name] = _rms(error[np.isfinite(error)])
        late_rmse[name] = _rms(late)
        worst[name] = float(np.max(np.abs(late))) / mass
    twice = Settings(count_grade_twice=True).estimators["robust-rls"](balance, vehicle)
    error = twice.running_mass - mass
    return DriveResult(
        load=load,
        seed=made.scenario.seed,
        true_mass=mass,
        tracks=tracks,
        rmse=rmse,
        late_rmse=late_rmse,
        worst=worst,
        held=held,
        seconds=seconds,
        twice_rmse=_rms(error[np.isfinite(error)]),
    )


def reproduce(
    *, seed: int = 777, drives: int = DRIVES, progress: Progress | None = None
) -> Reproduction:
    """Weigh the bus as in the paper, and on the road.

    Parameters
    ----------
    seed : of the judged drives, counting on from it; those of the calibration
        are `CALIBRATION_SEED` further
    drives : judged at each load
    progress : called with steps done and steps in all
    """
    total = len(LOADS) * (CALIBRATION_DRIVES + 2 * drives) + 1
    done = 0

    def step() -> None:
        nonlocal done
        done += 1
        if progress:
            progress(done, total)

    known = []
    for k in range(CALIBRATION_DRIVES):
        for number, payload in enumerate(LOADS.values()):
            far = CALIBRATION_SEED + seed + len(LOADS) * k + number
            known.append(simulate(payload, far, as_paper=False))
            step()
    vehicle = run_calibration(
        [m.drive for m in known],
        [float(np.mean(m.truth.mass)) for m in known],
        vehicle=data_sheet(),
    ).vehicle
    vehicle = replace(vehicle, name="bus of Du 2025, calibrated")
    step()
    as_paper: list[DriveResult] = []
    road: list[DriveResult] = []
    sheet: list[DriveResult] = []
    for number, (load, payload) in enumerate(LOADS.items()):
        for k in range(drives):
            number_seed = seed + drives * number + k
            made = simulate(payload, number_seed, as_paper=True)
            if not as_paper:
                # The first call compiles, or loads what was compiled, and is not timed.
                judge(load, made, known_bus())
            as_paper.append(judge(load, made, known_bus()))
            step()
            made = simulate(payload, number_seed, as_paper=False)
            road.append(judge(load, made, vehicle))
            if k == 0:
                sheet.append(judge(load, made, data_sheet()))
            step()
    return Reproduction(
        drives=tuple(as_paper), road=tuple(road), sheet=tuple(sheet), vehicle=vehicle
    )


def cell(drives: tuple[DriveResult, ...], load: str, method: str, name: str) -> Floats:
    """Return one figure of a cell of Table 2, drive by drive."""
    return np.array([getattr(d, name)[method] for d in drives if d.load == load])


def reproduced(seed: int, progress: Progress | None) -> Reproduced:
    """Reproduce the paper and put it beside its own figures; see `reproduce`."""
    done = reproduce(seed=seed, progress=progress)

    def write(tables: Sequence[Table], path: Path) -> None:
        from weighbridge.report.study import write_study

        write_study("Du et al. 2025, reproduced on simulated drives", tables, panels(done), path)

    return Reproduced(
        title="Du et al. 2025",
        tables=(
            _cells(done.drives, "Table 2 as in the paper, the bus known"),
            _cells(done.road, "Table 2 with all effects, the bus calibrated on other drives"),
            _drives_table(done),
            _settings_table(done),
            _vehicle_table(done),
        ),
        comparisons=_comparisons(done),
        write_page=write,
    )


def _cells(drives: tuple[DriveResult, ...], title: str) -> Table:
    rows = []
    for load, theirs in PAPER_RMSE.items():
        for method, paper, paper_time in zip(METHODS, theirs, PAPER_TIME[load], strict=True):
            every = cell(drives, load, method, "late_rmse")
            rows.append(
                (
                    f"{load}, {method}",
                    f"{paper:.0f}",
                    f"{every.mean():.0f}",
                    f"{every.max():.0f}",
                    f"{cell(drives, load, method, 'rmse').mean():.0f}",
                    f"{100.0 * cell(drives, load, method, 'worst').max():.1f}",
                    f"{paper_time:.1f}",
                    f"{cell(drives, load, method, 'seconds').mean():.3f}",
                )
            )
    return Table(
        f"{title}: RMSE from 21 s on, of {len(drives) // len(LOADS)} drives each",
        ("load, method", "paper kg", "mean kg", "worst kg", "from first mass kg", "largest error %",
         "paper s", "ours s"),
        tuple(rows),
    )  # fmt: skip


def _drives_table(done: Reproduction) -> Table:
    rows = []
    kinds = {"as in the paper": done.drives, "all effects": done.road, "data sheet": done.sheet}
    for kind, d in ((kind, d) for kind, drives in kinds.items() for d in drives):
        final = [d.tracks[m].mass for m in METHODS]
        best = min(METHODS, key=lambda m, d=d: d.late_rmse[m])  # type: ignore[misc]
        rows.append(
            (
                f"{kind}, {d.load}, seed {d.seed}",
                f"{d.true_mass:.0f}",
                *(f"{100.0 * (m / d.true_mass - 1.0):+.2f}" for m in final),
                *(f"{d.late_rmse[m]:.0f}" for m in METHODS),
                best,
            )
        )
    return Table(
        "Drives: final mass, running mass, and which method came out best",
        ("drive", "true kg", *(f"{m} %" for m in METHODS), *(f"RMSE {m}" for m in METHODS),
         "best"),
        tuple(rows),
    )  # fmt: skip


def _settings_table(done: Reproduction) -> Table:
    rows = []
    chosen = Settings()
    for f in fields(Settings):
        rows.append((f.name, str(getattr(chosen, f.name))))
    for load in LOADS:
        once = cell(done.road, load, "robust-rls", "rmse").mean()
        twice = np.mean([d.twice_rmse for d in done.road if d.load == load])
        rows.append(
            (
                f"{load}: RMSE of robust-rls, all effects, grade once | twice",
                f"{once:.0f} | {twice:.0f} kg",
            )
        )
    least, kalman = robust_rls.RobustRlsSettings(), ekf.EkfSettings()
    rows += [(f"robust-rls {f.name}", f"{getattr(least, f.name)}") for f in fields(least)]
    rows += [
        (f"ekf {f.name}", f"{getattr(kalman, f.name):g}")
        for f in fields(kalman)
        if f.name != "start"
    ]
    both = hybrid.HybridSettings()
    rows += [
        ("hybrid h(v), half at", f"{scalar_from_si(both.blend_speed, 'kmh'):.1f} km/h"),
        ("hybrid h(v), width", f"{scalar_from_si(both.blend_width, 'kmh'):.1f} km/h"),
    ]
    return Table("Settings", ("setting", "value"), tuple(rows))


def _vehicle_table(done: Reproduction) -> Table:
    sheet, car = data_sheet(), done.vehicle
    offset, scale, *_ = car.torque.coefficients
    return Table(
        "Vehicle",
        ("parameter", "data sheet", "calibrated"),
        (
            ("torque offset N m", "0", f"{offset:.1f}"),
            ("torque scale, efficiency in it", f"{wheel_efficiency(sheet):.3f}", f"{scale:.3f}"),
            ("engine inertia kg m²", f"{sheet.road.engine_inertia.value:.2f}",
             f"{car.road.engine_inertia.value:.2f}"),
            ("drag area m²", f"{sheet.road.drag_area.value:.2f}",
             f"{car.road.drag_area.value:.2f}"),
            ("rolling coefficient", f"{sheet.road.rolling_coefficient.value:.4f}",
             f"{car.road.rolling_coefficient.value:.4f}"),
        ),
    )  # fmt: skip


def _comparisons(done: Reproduction) -> tuple[Comparison, ...]:
    out = []
    for load, theirs in PAPER_RMSE.items():
        for method, paper in zip(METHODS, theirs, strict=True):
            every = cell(done.drives, load, method, "late_rmse")
            out.append(
                Comparison(
                    f"RMSE, {load}, {method}",
                    f"{paper:.0f} kg",
                    f"{every.mean():.0f} kg, worst drive {every.max():.0f} kg",
                    bool(every.mean() < paper),
                )
            )
    for load, theirs in PAPER_RMSE.items():
        mean = float(cell(done.drives, load, "hybrid", "late_rmse").mean())
        out.append(
            Comparison(
                f"hybrid, {load}, half of the paper's RMSE",
                f"{0.5 * theirs[2]:.0f} kg",
                f"{mean:.0f} kg",
                mean <= 0.5 * theirs[2],
            )
        )
    for name, drives in (("", done.drives), (", with all effects", done.road)):
        largest = max(max(d.worst.values()) for d in drives)
        out.append(
            Comparison(f"largest error from 21 s on, all methods and drives{name}",
                       "below 10 %", f"{100.0 * largest:.1f} %", largest < BAND)
        )  # fmt: skip
        means = {m: float(np.mean([d.late_rmse[m] for d in drives])) for m in METHODS}
        order = sorted(METHODS, key=lambda m, means=means: means[m])  # type: ignore[misc]
        out.append(
            Comparison(f"order of merit, mean RMSE of all drives{name}",
                       "hybrid, ekf, robust-rls",
                       ", ".join(f"{m} {means[m]:.0f} kg" for m in order), True)
        )  # fmt: skip
    seconds = {m: float(np.mean([d.seconds[m] for d in done.drives])) for m in METHODS}
    theirs_time = np.mean([PAPER_TIME[load] for load in LOADS], axis=0)
    out.append(
        Comparison("computing time of a drive, " + ", ".join(METHODS),
                   ", ".join(f"{t:.1f}" for t in theirs_time) + " s",
                   ", ".join(f"{seconds[m]:.3f}" for m in METHODS) + " s", True)
    )  # fmt: skip
    return tuple(out)


def panels(done: Reproduction) -> tuple[Panel, ...]:
    """Draw figs. 4 to 7 of the paper from our data."""
    drawn = []
    first = {d.load: d for d in reversed(done.drives)}
    for number, load in enumerate(LOADS):
        d = first[load]
        drawn.append(
            mass_panel(
                d.tracks,
                f"Fig. {5 + number}{'a' if number == 0 else ''}: mass, {load}",
                f"Running mass of the three methods, seed {d.seed}; true mass "
                f"{d.true_mass:.0f} kg, dotted at 10 % of it.",
                true_mass=d.true_mass,
            )
        )
    empty = first["no-load"].tracks["hybrid"].balance
    drawn += motion_panels(empty)
    drawn.append(share_panel())
    for d in done.road[:: max(1, len(done.road) // len(LOADS))]:
        drawn.append(
            mass_panel(
                d.tracks,
                f"With all effects: mass, {d.load}",
                f"The same as figs. 5 to 7 on a simulated road, the bus calibrated; seed {d.seed}.",
                true_mass=d.true_mass,
            )
        )
    return tuple(drawn)


def mass_panel(
    tracks: dict[str, MassTrack], title: str, caption: str, *, true_mass: float | None = None
) -> Panel:
    """Draw the running masses of some methods."""
    figure = blank("time s", "mass kg")
    for name, track in tracks.items():
        rows = slice(None, None, max(1, track.time.size // 1500))
        line(figure, track.time[rows], track.running_mass[rows], name, COLOURS.get(name, GREY))
    if true_mass is not None:
        ends = [float(x) for x in next(iter(tracks.values())).time[[0, -1]]]
        line(figure, ends, [true_mass, true_mass], "true", VERMILLION, dash="dash")
        for factor in (1.0 - BAND, 1.0 + BAND):
            level = factor * true_mass
            line(figure, ends, [level, level], "10 %", GREY, dash="dot", showlegend=factor < 1.0)
        figure.update_layout(yaxis_range=[0.8 * true_mass, 1.2 * true_mass])
    return Panel(title=title, caption=caption, figure=figure)


def motion_panels(balance: ForceBalance) -> list[Panel]:
    """Draw torque, speed and acceleration of a drive."""
    table = balance.table
    rows = slice(None, None, max(1, table.time.size // 1500))
    drawn = []
    for letter, name, unit, values in (
        ("b", "Engine torque", "N m", table.torque),
        ("c", "Speed", "km/h", from_si(table.speed, "kmh")),
        ("d", "Acceleration", "m/s²", table.accel),
    ):
        figure = blank("time s", f"{name.lower()} {unit}", height=300)
        line(figure, table.time[rows], values[rows], name.lower(), BLUE)
        drawn.append(
            Panel(title=f"Fig. 5{letter}: {name.lower()}", caption="No-load.", figure=figure)
        )
    return drawn


def share_panel() -> Panel:
    """Draw h(v)."""
    from weighbridge.kernels.hybrid_mass import share_of_rls

    both = hybrid.HybridSettings()
    speed = np.linspace(0.0, 25.0, 126)
    share = [share_of_rls(v, both.blend_speed, both.blend_width) for v in speed]
    figure = blank("speed km/h", "share of the least squares", height=300)
    line(figure, from_si(speed, "kmh"), share, "h(v)", BLUE)
    return Panel(
        title="Fig. 4: h(v)",
        caption="Our logistic curve; the paper's is only drawn.",
        figure=figure,
    )


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if np.size(values) else float("nan")
