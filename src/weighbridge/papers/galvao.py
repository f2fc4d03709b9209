"""Galvão et al.: the mass of a small car from its speed alone, on simulated drives.

S. L. J. Galvão, R. M. Fontes, D. D. Santana, R. Requião: An Extended Kalman Filter
implementation for estimating the mass of passengers vehicles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.balance.speed_balance import speed_balance
from weighbridge.calibration import SpeedCalibration
from weighbridge.calibration.speed import calibrate_by_speed, speed_rows
from weighbridge.calibration.speed_fit import Nominal, SpeedRows, model_speed
from weighbridge.estimators.speed_ekf import (
    PRINTED,
    FilterRun,
    SpeedEkfSettings,
    mean_mass,
    run_filter,
)
from weighbridge.estimators.speed_torque_ekf import SpeedTorqueSettings
from weighbridge.papers.claims import Found, items_of, read_rows, same
from weighbridge.papers.galvao_bounds import SpeedSays, speed_says, speed_table
from weighbridge.papers.galvao_drives import (
    CAR,
    NOMINAL,
    easy_route,
    mass_of,
    scenario,
    with_grade,
)
from weighbridge.papers.galvao_equations import equations
from weighbridge.papers.galvao_torque import (
    BOUND,
    FROM_PRINTED_START,
    TorqueTrial,
    rank_correlation,
    slope,
    torque_figures,
    torque_table,
    torque_trial,
)
from weighbridge.papers.reproduced import Progress, Reproduced, rms
from weighbridge.report.study import write_study
from weighbridge.report.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    VERMILLION,
    Panel,
    band,
    blank,
    dots,
    line,
)
from weighbridge.report.table import Table
from weighbridge.signals import Bools, Floats, from_si
from weighbridge.simulation import (
    Scenario,
    simulate_car,
)
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.speed_model import SpeedSampling

if TYPE_CHECKING:
    from pathlib import Path

    import plotly.graph_objects as go

    from weighbridge.simulation import SimulatedDrive

LAST: Final = 200
"""Samples over which Table 2 gives the band."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Test:
    """One of the three drives.

    Attributes
    ----------
    number : 1 to 3
    mass : true mean [kg]
    balance : windows of the drive
    rows : the same with the true grade
    predicted : (n,) speed of the model one window ahead, with the true grade [m/s]
    ours, printed : runs of the filter started at the calibration's mass with a
        constant mass, and with start and noise as printed
    """

    number: int
    mass: float
    balance: ForceBalance
    rows: SpeedRows
    predicted: Floats
    ours: FilterRun
    printed: FilterRun

    def error(self, run: FilterRun) -> float:
        """Relative error of the mean mass of a run [-]."""
        return run.answer / self.mass - 1.0

    @property
    def superimposed(self) -> tuple[float, float]:
        """How far the model's speed is off, RMS [m/s], and the part of the speed it explains."""
        known = np.isfinite(self.predicted)
        left = (self.rows.speed - self.predicted)[known]
        part = 1.0 - np.var(left) / np.var(self.rows.speed[known])
        return float(np.sqrt(np.mean(left**2))), float(part)

    def band(self, run: FilterRun) -> float:
        """Widest half of the 95 % band over the last samples used [kg]."""
        return float(np.max(1.96 * run.std[run.used][-LAST:]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """Drives that the paper did not try, of one kind.

    Attributes
    ----------
    kind : what is different
    masses : true masses [kg]
    answers : of our settings [kg]
    pinned : of the filter that starts from nothing and knows the road to be level [kg]
    """

    kind: str
    masses: Floats
    answers: Floats
    pinned: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproduction:
    """All the figures of the study.

    Attributes
    ----------
    vehicle : with the speed model fitted to the first drive
    r_squared : of the fit
    tests : the three drives
    starts : masses the filter is started from, and where the second drive ends then, by ours and
        with noise as printed [kg]
    stated : masses the calibration is given, and what the second drive weighs then [kg], and R² of
        the fit
    trials : drives the paper did not try
    torque : the tests with the torque recorded
    says : what speed alone says in the tests
    """

    vehicle: Vehicle
    r_squared: float
    tests: tuple[Test, ...]
    starts: tuple[tuple[float, float, float], ...]
    stated: tuple[tuple[float, float, float], ...]
    trials: tuple[Trial, ...]
    torque: TorqueTrial
    says: SpeedSays


PAPER_WORST: Final = 0.0033
"""Largest error of Table 1 [-]."""

PAPER_BANDS: Final = (100.0, 200.0, 200.0)
"""Table 2 [kg]."""

LINE: Final = 0.5
"""Width of a line in a drawing of speeds up to 25 m/s [m/s]."""

CONVERGED: Final = 300.0
"""Time in which the paper's mass converges [s] (sec. 5.3)."""


def item_figures(done: Reproduction) -> dict[str, Found]:
    """Figures that the paper's items ask for."""
    found = equations() | of_tests(done.tests)
    return found | torque_figures(done.torque) | {"fig 4": _mean_mass()}


def of_tests(tests: Sequence[Test]) -> dict[str, Found]:
    """Figures of the three tests: figs. 7 to 15 and both tables."""
    found = {}
    for name, runs in (("", [t.ours for t in tests]), ("printed ", [t.printed for t in tests])):
        each = list(zip(tests, runs, strict=True))
        errors = [t.error(r) for t, r in each]
        bands = [t.band(r) for t, r in each]
        said = " / ".join(f"{100.0 * e:+.4f}" for e in errors)
        found[f"{name}errors"] = Found(
            f"errors {said} %", max(abs(e) for e in errors) <= PAPER_WORST
        )
        found[f"{name}bands"] = Found(
            f"± {' / '.join(f'{b:.0f}' for b in bands)} kg",
            all(b <= paper for b, paper in zip(bands, PAPER_BANDS, strict=True)),
        )
    for test in tests:
        late, end = _late_errors(test.printed, test)
        n = test.number
        found[f"late {n}"] = Found(f"{late:+.1f} %", abs(late) <= BOUND)
        found[f"end {n}"] = Found(f"{end:+.1f} %", abs(end) <= BOUND)
        off, explained = test.superimposed
        found[f"speed {n}"] = Found(
            f"off by {off:.2f} m/s RMS; R² of the speed {explained:.2f}", off <= LINE
        )
    return found


def _mean_mass() -> Found:
    """Average calm groups of a made course (fig. 4), step by step and by the code."""
    rng = np.random.default_rng(6)
    mass = 1100.0 + rng.normal(size=400) * np.repeat(rng.uniform(1.0, 30.0, 40), 10)
    last = mass[100:].reshape(10, 30)
    spread = np.sqrt(np.mean((last - last.mean(axis=1, keepdims=True)) ** 2, axis=1))
    return same(last[spread <= spread.mean()].mean(), mean_mass(mass, np.ones(400, dtype=bool)))


def _late_errors(run: FilterRun, test: Test) -> tuple[float, float]:
    """Error of the running mass after `CONVERGED` and at the end [%]."""
    time = test.balance.table.time[run.used]
    error = 100.0 * (run.mass[run.used] / test.mass - 1.0)
    return float(np.interp(time[0] + CONVERGED, time, error)), float(error[-1])


PAPER_MASSES: Final = (1092.07, 1095.58, 1092.02)
PAPER_ERRORS: Final = ("0.0069", "0.33", "0.0025")

PINNED: Final = SpeedEkfSettings(process_var=(0.1, 0.0, 1e-10))
"""The grade held level and the mass constant: the most that speed can say of the mass."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """What the paper varies of its filter.

    Attributes
    ----------
    printed : start, noise and mean as the paper prints them
    ours : those of ``speed-ekf``
    torque : those of ``speed-torque-ekf``, which has the torque recorded
    model : constants of the model of eq. 11
    sampling : of the speed: T_s, means or points, and the limits of on and off
    """

    printed: SpeedEkfSettings = PRINTED
    ours: SpeedEkfSettings = field(default_factory=SpeedEkfSettings)
    torque: SpeedTorqueSettings = FROM_PRINTED_START
    model: Nominal = NOMINAL
    sampling: SpeedSampling = field(default_factory=SpeedSampling)

    def fitted(self, known: SimulatedDrive, mass: float | None = None) -> SpeedCalibration:
        """Fit the model to a drive of known grade, with its mass or another [kg]."""
        return calibrate_by_speed(
            [with_grade(known)],
            [mass_of(known) if mass is None else mass],
            Vehicle(name=CAR.name),
            nominal=self.model,
            sampling=self.sampling,
        )


ITEMS: Final = items_of(read_rows("galvao")["items"])
"""In the paper's order; what is not the paper's is in the tables of the report."""

SEED: Final = 196_200
"""Of the road and the first drive; nothing was chosen on them and those after them."""

SETTINGS: Final = Settings
"""What ``weighbridge reproduce galvao --set`` changes."""

STARTS: Final = (800.0, 1092.0, 1500.0, 2000.0)
"""Masses the filter is started from, to see where it ends [kg]."""

STATED: Final = (900.0, 1092.0, 1400.0)
"""Masses stated to the calibration of one and the same drive [kg]."""

PAYLOADS: Final = (0.0, 100.0, 200.0, 300.0, 400.0)
"""Loads that the paper did not try [kg]."""


def weigh_three(
    seed: int, settings: Settings | None = None
) -> tuple[SpeedCalibration, tuple[SimulatedDrive, ...], tuple[Test, ...]]:
    """Drive one road three times, fit the model to the first drive and weigh all three."""
    route = easy_route(seed)
    drives = tuple(simulate_car(scenario(seed + k, route)) for k in range(3))
    settings = settings or Settings()
    fitted = settings.fitted(drives[0])
    tests = tuple(_test(k, made, fitted.vehicle, settings) for k, made in enumerate(drives, 1))
    return fitted, drives, tests


def reproduce(
    *, seed: int = SEED, progress: Progress | None = None, settings: Settings | None = None
) -> Reproduction:
    """Fit the model to the first of three drives, weigh all three, and try what they did not.

    Parameters
    ----------
    seed : of the road and the first drive; the other drives count on from it
    progress : called with steps done and steps in all
    settings : in place of the paper's and ours
    """
    total = 8
    settings = settings or Settings()
    fitted, drives, tests = weigh_three(seed, settings)
    vehicle = fitted.vehicle
    _tell(progress, 1, total)

    second = tests[1]
    starts = []
    for start in STARTS:
        ends = []
        for one in (settings.ours, settings.printed):
            run = run_filter(second.balance, vehicle, replace(one, initial_mass=start))
            ends.append(run.answer)
        starts.append((start, ends[0], ends[1]))
    stated = []
    for mass in STATED:
        other = settings.fitted(drives[0], mass)
        balance = speed_balance(drives[1].drive, other.vehicle)
        run = run_filter(balance, other.vehicle, settings.ours)
        stated.append((mass, run.answer, other.fit.r_squared))
    _tell(progress, 2, total)

    trials = []
    others = range(seed + 1, seed + 7)
    # Every load on every road, lest a road pass for a load.
    each = tuple(road for road in others[:3] for _ in PAYLOADS)
    for step, (kind, loads, traffic, roads) in enumerate(
        (
            ("same road and load, other days", (0.0,) * 6, False, (seed,)),
            ("other roads", (0.0,) * 6, False, others),
            ("traffic", (0.0,) * 6, True, (seed,)),
            ("other masses", PAYLOADS * 3, False, (seed,)),
            ("other masses, roads, traffic", PAYLOADS * 3, True, each),
        )
    ):
        routes = {road: easy_route(road) for road in roads}
        made = [
            scenario(
                seed + 100 * (step + 1) + k,
                routes[roads[k % len(roads)]],
                payload=load,
                traffic=traffic,
            )
            for k, load in enumerate(loads)
        ]
        trials.append(_trial(kind, made, vehicle, settings))
        _tell(progress, 3 + step, total)
    torque = torque_trial(seed, easy_route(seed), settings.torque)
    _tell(progress, total, total)
    return Reproduction(
        vehicle=vehicle,
        r_squared=fitted.fit.r_squared,
        tests=tests,
        starts=tuple(starts),
        stated=tuple(stated),
        trials=tuple(trials),
        torque=torque,
        says=speed_says(drives, seed),
    )


def _tell(progress: Progress | None, done: int, total: int) -> None:
    if progress:
        progress(done, total)


def _test(number: int, made: SimulatedDrive, vehicle: Vehicle, settings: Settings) -> Test:
    mass = mass_of(made)
    rows = speed_rows(with_grade(made), vehicle, mass, settings.sampling)
    balance = speed_balance(made.drive, vehicle)
    assert vehicle.speed_model is not None
    return Test(
        number=number,
        mass=mass,
        balance=balance,
        rows=rows,
        predicted=model_speed(rows, vehicle.speed_model),
        ours=run_filter(balance, vehicle, settings.ours),
        printed=run_filter(balance, vehicle, settings.printed),
    )


def _trial(kind: str, scenarios: Sequence[Scenario], vehicle: Vehicle, settings: Settings) -> Trial:
    masses, answers, pinned = [], [], []
    for chosen in scenarios:
        made = simulate_car(chosen)
        balance = speed_balance(made.drive, vehicle)
        ours = run_filter(balance, vehicle, settings.ours)
        free = run_filter(balance, vehicle, PINNED, flat=True)
        masses.append(mass_of(made))
        answers.append(ours.answer)
        pinned.append(float(free.mass[-1]))
    return Trial(
        kind=kind, masses=np.array(masses), answers=np.array(answers), pinned=np.array(pinned)
    )


def reproduced(
    seed: int, progress: Progress | None, settings: Settings | None = None
) -> Reproduced:
    """Reproduce the paper and put it beside its own figures; see `reproduce`."""
    done = reproduce(seed=seed, progress=progress, settings=settings)
    apart = ", on which nothing was chosen" if seed >= SEED else ""

    def write(tables: Sequence[Table], path: Path) -> None:
        write_study(
            "Galvão et al., reproduced on simulated drives",
            tables,
            [*(p for test in done.tests for p in _panels(test)), _mass_panel(done.trials[-2])],
            path,
        )

    figures = item_figures(done)
    return Reproduced(
        title="Galvão et al.",
        note=f"seeds from {seed}{apart}",
        tables=(
            tests_table(done),
            starts_table(done),
            trials_table(done),
            torque_table(done.torque),
            speed_table(done.says),
        ),
        rows=tuple(item.row("galvao", figures) for item in ITEMS),
        write_page=write,
    )


def tests_table(done: Reproduction) -> Table:
    """Put the three tests beside the paper's Tables 1 and 2."""
    rows = []
    for test, theirs, error, half in zip(
        done.tests, PAPER_MASSES, PAPER_ERRORS, PAPER_BANDS, strict=True
    ):
        rows.append(
            (
                f"Test {test.number:02d}",
                f"{theirs:.2f}",
                error,
                f"± {half:.0f}",
                f"{test.mass:.1f}",
                f"{test.ours.answer:.2f}",
                f"{100.0 * test.error(test.ours):+.4f}",
                f"± {test.band(test.ours):.0f}",
                f"{test.printed.answer:.0f}",
                f"{100.0 * test.error(test.printed):+.1f}",
                f"± {test.band(test.printed):.0f}",
            )
        )
    return Table(
        "Tables 1 and 2: the paper, ours started at the calibration's mass, and start and noise as "
        "printed",
        ("drive", "paper kg", "error %", "band kg", "true kg", "ours kg", "error %", "band kg",
         "printed kg", "error %", "band kg"),
        tuple(rows),
    )  # fmt: skip


def starts_table(done: Reproduction) -> Table:
    """Show what the answer is made of: the filter's start, and what the fit was given."""
    rows = [
        (f"filter started at {start:.0f} kg", f"{ours:.1f}", f"{printed:.0f}", "")
        for start, ours, printed in done.starts
    ]
    rows += [
        (f"calibration with {stated:.0f} kg", f"{ends:.1f}", "", f"{r_squared:.3f}")
        for stated, ends, r_squared in done.stated
    ]
    return Table(
        f"What Test 02, truly {done.tests[1].mass:.0f} kg, weighs",
        ("when", "ours kg", "noise as printed kg", "R² of the fit"),
        tuple(rows),
    )


def trials_table(done: Reproduction) -> Table:
    """Show what becomes of other loads, roads and traffic."""
    rows = []
    for trial in done.trials:
        loaded = float(np.ptp(trial.masses)) > 50.0
        found, std = slope(trial.masses, trial.answers)
        off = 100.0 * np.abs(trial.pinned / trial.masses - 1.0)
        rows.append(
            (
                trial.kind,
                str(trial.masses.size),
                f"{trial.masses.min():.0f}–{trial.masses.max():.0f}",
                f"{trial.answers.min():.0f}–{trial.answers.max():.0f}",
                f"{100.0 * rms(trial.answers / trial.masses - 1.0):.2f}",
                f"{found:+.4f} ± {std:.4f}" if loaded else "",
                f"{np.median(off):.0f}",
                f"{rank_correlation(trial.masses, trial.pinned):+.2f}" if loaded else "",
            )
        )
    return Table(
        "What the paper did not try: ours, and free: started from nothing, grade held level",
        ("drives", "n", "true kg", "ours kg", "RMS %", "ours per loaded", "free off, median %",
         "rank corr."),
        tuple(rows),
    )  # fmt: skip


def _panels(test: Test) -> list[Panel]:
    """Draw figs. 7 to 15 for one test: model speed, mass and error."""
    minutes = from_si(test.balance.table.time - test.balance.motion.time[0], "min")
    name = f"Test {test.number:02d}"
    used = test.ours.used
    speed = blank("Time [min]", "Speed [km/h]")
    line(speed, minutes, from_si(test.rows.speed, "kmh"), "measured, means", GREY)
    steps = np.isfinite(test.predicted)
    dots(speed, minutes[steps], from_si(test.predicted[steps], "kmh"), "model, one step ahead",
         VERMILLION, size=5)  # fmt: skip
    mass = blank("Time [min]", "Mass [kg]")
    _banded(mass, minutes, test.ours, used)
    line(mass, minutes[used], test.printed.mass[used], "start and noise as printed", ORANGE)
    ends = minutes[[0, -1]]
    line(mass, ends, np.full(2, test.mass), f"true mass {test.mass:.0f} kg", GREEN, dash="dash")
    error = blank("Time [min]", "Error of the running mass [%]")
    for run, label, colour in (
        (test.ours, "started at the calibration's mass", BLUE),
        (test.printed, "start and noise as printed", ORANGE),
    ):
        line(error, minutes[used], 100.0 * (run.mass[used] / test.mass - 1.0), label, colour)
    off, _ = test.superimposed
    return [
        Panel(
            title=f"{name}: model speed against measured speed (fig. {6 + test.number})",
            caption=f"One step ahead, with the true grade; off by {off:.2f} m/s RMS. "
            "The model was fitted to Test 01.",
            figure=speed,
        ),
        Panel(
            title=f"{name}: mass (fig. {8 + 2 * test.number})",
            caption="Both runs stay near where they were started; the band is the filter's own.",
            figure=mass,
        ),
        Panel(
            title=f"{name}: error of the mass (fig. {9 + 2 * test.number})",
            caption="From the printed start the error does not go away.",
            figure=error,
        ),
    ]


def _banded(figure: go.Figure, minutes: Floats, run: FilterRun, used: Bools) -> None:
    x, mass, half = minutes[used], run.mass[used], 1.96 * run.std[used]
    band(figure, x, mass - half, mass + half, "95 % band")
    line(figure, x, mass, "started at the calibration's mass", BLUE)


def _mass_panel(trial: Trial) -> Panel:
    """Draw what loaded drives weigh against what they are."""
    figure = blank("True mass [kg]", "Answer [kg]")
    dots(figure, trial.masses, trial.answers, "ours", BLUE, size=7)
    dots(figure, trial.masses, trial.pinned, "started from nothing, grade held level", PURPLE,
         size=7)  # fmt: skip
    ends = np.array([trial.masses.min(), trial.masses.max()])
    line(figure, ends, ends, "a scale would lie here", GREEN, dash="dash")
    figure.update_layout(yaxis_range=[0.0, 2.0 * float(trial.masses.max())])
    return Panel(
        title="The answer does not follow the load",
        caption="Other masses on the same road without traffic, weighed with the model of Test 01.",
        figure=figure,
        wide=True,
    )
