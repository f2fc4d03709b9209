"""Figures of studies/galvao.md: what speed alone says of the mass.

Run from the checkout: ``python studies/galvao.py``. Recorded drives lie in
``../shared/data`` and are not part of the project; without them their table says so.
``python studies/galvao.py tuning`` prints the transfer error that set the interval. ``alone`` makes
all but the tables of speed and torque anew, which take an hour and a half, ``torque`` those alone,
and names of their parts (``own``, ``second``, ``sheets``, ``levels``, ``electric``, ``recorded``)
these parts.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
from scipy.optimize import least_squares
from scipy.stats import norm

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import speed_torque

import weighbridge as wb
from weighbridge.balance.speed_balance import kernel_parameters, speed_balance, window_means
from weighbridge.calibration.speed import calibrate_by_speed, speed_rows
from weighbridge.calibration.speed_fit import SpeedRows
from weighbridge.estimators.speed_ekf import SpeedEkfSettings, mean_mass, run_filter, start_share
from weighbridge.papers import galvao as paper
from weighbridge.papers.claims import Verdict
from weighbridge.papers.galvao import item_figures
from weighbridge.report.table import Table
from weighbridge.simulation import Route, jensen_route, mixed_route, random_car, simulate_car
from weighbridge.vehicle.model import Vehicle
from weighbridge.vehicle.speed_model import SpeedSampling

HERE = Path(__file__).parent
DATA = HERE.parents[1] / "shared" / "data"
EXAMPLE = HERE.parent / "examples" / "bmw-i3"
SEED = 4242
OTHER_SEEDS = (5242, 6242, 7242, 8242, 9242)
TUNING, JUDGING = 5_000, 81_000
CARS, DRIVES = 8, 8
LARGEST_LOAD = 0.35
"""Of the car's mass [-]."""
SPEED_EKF = wb.CalibrationSettings(method="speed-ekf")


def markdown(table: Table) -> str:
    lines = [f"| {' | '.join(table.columns)} |", "|" + "---|" * len(table.columns)]
    return "\n".join(lines + [f"| {' | '.join(row)} |" for row in table.rows])


def comparison_table(done: paper.Reproduction) -> str:
    found = item_figures(done)
    rows = [item.row("galvao", found) for item in paper.ITEMS]
    lines = ["| paper | what | printed | ours | |", "|---|---|---|---|---|"]
    lines += [
        f"| {r.item} | {r.what} | {r.printed} | {r.ours} | {r.verdict} |"
        for r in rows
        if r.item.startswith(("fig.", "table")) and r.verdict is not Verdict.NOT_REPRODUCIBLE
    ]
    return "\n".join(lines)


def furthest(errors: Iterable[float]) -> float:
    """Return the error that is farthest from nothing, with its sign."""
    return max(errors, key=abs)


def other_roads() -> str:
    """Repeat the experiment on other roads."""
    lines = [
        "| road and seeds of its drives | R² of the fit | largest error % | widest band kg "
        "| largest error % as printed | widest band as printed kg |",
        "|" + "---|" * 6,
    ]
    for seed in OTHER_SEEDS:
        fitted, _, tests = paper.weigh_three(seed)
        lines.append(
            f"| {seed} to {seed + 2} | {fitted.fit.r_squared:.2f} "
            f"| {100 * furthest(t.error(t.ours) for t in tests):+.4f} "
            f"| ± {max(t.band(t.ours) for t in tests):.0f} "
            f"| {100 * furthest(t.error(t.printed) for t in tests):+.0f} "
            f"| ± {max(t.band(t.printed) for t in tests):.0f} |"
        )
    return "\n".join(lines)


def corrected_gravity() -> str:
    """Tell a3 as the fit corrects it, and the bands beside the errors, from 1500 kg as printed."""
    lines = [
        "| road | a3 at 10, 50 and 90 % of the speeds, m/s² | errors as printed % "
        "| bands as printed ± % | largest error over its 95 % band |",
        "|---|---|---|---|---|",
    ]
    for seed in (SEED, *OTHER_SEEDS):
        fitted, _, tests = paper.weigh_three(seed)
        model = fitted.vehicle.speed_model
        params = kernel_parameters(model, (0.0, 0.0, 0.0), 0.0)
        speeds = tests[0].balance.table.speed[tests[0].ours.used]
        at = np.percentile(speeds, [10.0, 50.0, 90.0])
        gravity = params.gravity + params.corrections[4] + params.corrections[5] * at
        errors = [100.0 * t.error(t.printed) for t in tests]
        bands = [100.0 * t.band(t.printed) / t.mass for t in tests]
        ratio = max(abs(e) / b for e, b in zip(errors, bands, strict=True))
        lines.append(
            f"| {seed} | {', '.join(f'{g:+.1f}' for g in gravity)} "
            f"| {', '.join(f'{e:+.0f}' for e in errors)} | {', '.join(f'{b:.0f}' for b in bands)} "
            f"| {ratio:.1f} |"
        )
    return "\n".join(lines)


def chance_of_print() -> str:
    """Tell how likely errors as small as the printed ones are under the printed bands."""
    true = 1092.0
    chances = []
    for mass, band in zip(paper.PAPER_MASSES, paper.PAPER_BANDS, strict=True):
        chances.append(float(2.0 * norm.cdf(1.96 * abs(mass - true) / band) - 1.0))
    errors = ", ".join(f"{abs(m - true):.2f}" for m in paper.PAPER_MASSES)
    bands = ", ".join(f"{b:.0f}" for b in paper.PAPER_BANDS)
    return (
        f"errors of {errors} kg under 95 % bands of ± {bands} kg. If the bands hold, their chance "
        f"is {np.prod(chances):.0e}."
    )


def readings() -> str:
    """Try other readings of what the paper prints, all from 1500 kg."""
    printed = paper.PRINTED
    squared = tuple(q * q for q in printed.process_var)
    held = (0.1, 1e-10, 1e-10)
    cases = (
        ("as printed, 7 s", printed, 7.0, False),
        ("as printed, 3.5 s", printed, 3.5, False),
        ("as printed, 1 s: 200 samples are the last 3 minutes", printed, 1.0, False),
        ("Q is standard deviations", replace(printed, process_var=squared), 7.0, False),
        ("slope held", replace(printed, process_var=held), 7.0, False),
        ("slope held, Q of the mass 100 times",
         replace(printed, process_var=(0.1, 1e-8, 1e-10)), 7.0, False),
        ("slope held, nothing known of the mass", replace(paper.PINNED, initial_mass=1500.0), 7.0,
         True),
    )  # fmt: skip
    three = [paper.weigh_three(seed)[1] for seed in OTHER_SEEDS]
    base = Vehicle(name=paper.CAR.name)
    lines = ["| reading | median error % | nearest % | farthest % |", "|---|---|---|---|"]
    for name, settings, length, flat in cases:
        errors = []
        for drives in three:
            vehicle = calibrate_by_speed(
                [paper.with_grade(drives[0])], [paper.mass_of(drives[0])], base,
                nominal=paper.NOMINAL, sample_time=length,
            ).vehicle  # fmt: skip
            for made in drives:
                balance = speed_balance(made.drive, vehicle)
                run = run_filter(balance, vehicle, settings, flat=flat)
                mass = mean_mass(run.mass, run.used)
                errors.append(100.0 * (mass / paper.mass_of(made) - 1.0))
        lines.append(
            f"| {name} | {np.median(errors):+.1f} | {min(errors, key=abs):+.2f} "
            f"| {furthest(errors):+.1f} |"
        )
    return "\n".join(lines)


def courses(route: Route, seed: int) -> list[SpeedRows]:
    """Drive one road three times; means of 7 s with the true grade."""
    made = [simulate_car(paper.scenario(seed + k, route)) for k in range(3)]
    base = Vehicle(name=paper.CAR.name)
    return [speed_rows(paper.with_grade(m), base, paper.mass_of(m), SpeedSampling()) for m in made]


def city_road(seed: int) -> Route:
    """Return streets of a city as easy as the country road: low grades, few bends, no stops."""
    long = ("city", 30_000.0)
    made = mixed_route(seed, out=[long], back=[long], name="city road, few bends, low grades")
    return replace(
        made,
        grade=0.35 * made.grade,
        heading=0.3 * made.heading,
        stop_chance=0.0 * made.stop_chance,
    )


def model_accel(c, before, speed, slope, phi1):
    """Eq. 11 with six coefficients: torque by speed and its square, a2, p4, a3, p6."""
    drag, gravity = c[2] + c[3] * before, c[4] + c[5] * before
    force = c[0] * before + c[1] * before**2 - 0.5 * drag * speed**2
    inertia = 1.0 + phi1 * paper.NOMINAL.rotating_mass
    accel = (phi1 * force - gravity * slope) / inertia
    by_mass = (force - accel * paper.NOMINAL.rotating_mass) / inertia
    return accel, np.array([-phi1 * drag * speed / inertia, by_mass, -gravity / inertia])


def fit_steps(rows: SpeedRows, lag: int, free: tuple[int, ...]) -> np.ndarray:
    """Fit the coefficients ``free`` to the change of speed; the others stay nominal."""
    c = np.array([0.0, 0.0, paper.NOMINAL.drag, 0.0, paper.NOMINAL.gravity, 0.0])
    if 5 not in free and 4 in free:  # the grade is left out altogether
        c[4], free = 0.0, tuple(k for k in free if k != 4)
    now, after = slice(1, -1), slice(2, None)
    v, before = rows.speed[now], rows.speed[1 - lag : -1 - lag]
    slope = np.sin(rows.grade + np.arctan(paper.NOMINAL.rolling_coefficient))
    slope = 0.5 * (slope[now] + slope[after])
    phi1 = 1.0 / rows.mass
    parts = [phi1 * before, phi1 * before**2, -0.5 * phi1 * v**2, -0.5 * phi1 * before * v**2,
             -slope, -slope * before]  # fmt: skip
    design = np.column_stack(parts)
    target = (1.0 + phi1 * paper.NOMINAL.rotating_mass) * (rows.speed[after] - v) / 7.0
    good = rows.used[:-2] & rows.used[now] & rows.used[after] & np.isfinite(slope)
    left = (target - design @ c)[good]
    chosen = list(free)
    c[chosen] += np.linalg.lstsq(design[good][:, chosen], left, rcond=None)[0]
    return c


def fit_course(rows: SpeedRows, lag: int) -> np.ndarray:
    """Fit all coefficients to the whole course: the model runs on its own speed."""
    slope = np.nan_to_num(np.sin(rows.grade + np.arctan(paper.NOMINAL.rolling_coefficient)))
    slope = 0.5 * (slope[:-1] + slope[1:])
    size = np.array([20.0, 1.0, 1.0, 0.1, 5.0, 0.5])

    def off(q: np.ndarray) -> np.ndarray:
        x, out = rows.speed[0], np.zeros(rows.speed.size)
        for k in range(rows.speed.size - 1):
            if not rows.used[k]:
                x = rows.speed[k]
            accel, _ = model_accel(
                q * size, rows.speed[max(k - lag, 0)], x, slope[k], 1.0 / rows.mass
            )
            x = float(np.clip(x + 7.0 * accel, 0.0, 60.0))
            if rows.used[k] and rows.used[k + 1]:
                out[k + 1] = x - rows.speed[k + 1]
        return out

    return least_squares(off, fit_steps(rows, lag, (0, 1, 3, 4, 5)) / size, max_nfev=60).x * size


def printed_filter(rows: SpeedRows, c: np.ndarray, lag: int) -> float:
    """Run eqs. 13 to 26 from 1500 kg as printed; the mean mass [kg]."""
    q = np.diag(paper.PRINTED.process_var)
    x, cov = np.array([rows.speed[0], 1.0 / 1500.0, 0.01]), q.copy()
    mass, used = np.full(rows.speed.size, 1500.0), np.zeros(rows.speed.size, dtype=bool)
    for k in range(1 + lag, rows.speed.size):
        used[k] = rows.used[k - 1 - lag : k + 1].all()
        if not used[k]:
            x[0], cov[0, :], cov[:, 0] = rows.speed[k], 0.0, 0.0
            cov[0, 0] = q[0, 0]
        else:
            accel, slopes = model_accel(c, rows.speed[k - 1 - lag], x[0], x[2], x[1])
            transition = np.eye(3)
            transition[0] += 7.0 * slopes
            x = x + np.array([7.0 * accel, 0.0, 0.0])
            cov = transition @ cov @ transition.T + q
            gain = cov[:, 0] / (cov[0, 0] + paper.PRINTED.speed_var)
            x = x + gain * (rows.speed[k] - x[0])
            cov = cov - np.outer(gain, cov[0])
        mass[k] = 1.0 / x[1]
    return mean_mass(mass, used)


def other_models() -> str:
    """Fit the model in other ways that the print allows; filter, noise and start as printed."""
    every = (0, 1, 3, 4, 5)
    cases = (
        ("as printed", 0, lambda r: fit_steps(r, 0, every)),
        ("a3 not corrected", 0, lambda r: fit_steps(r, 0, (0, 1, 3))),
        ("grade left out", 0, lambda r: fit_steps(r, 0, (0, 1, 3, 4))),
        ("torque from one sample earlier", 1, lambda r: fit_steps(r, 1, (0, 1, 2, 3, 4, 5))),
        ("torque earlier, a3 not corrected", 1, lambda r: fit_steps(r, 1, (0, 1, 2, 3))),
        ("torque earlier, grade left out", 1, lambda r: fit_steps(r, 1, (0, 1, 2, 3, 4))),
        ("fitted to the whole course", 0, lambda r: fit_course(r, 0)),
        ("torque earlier, whole course", 1, lambda r: fit_course(r, 1)),
    )
    lines = [
        "| fit of the model | road | median error % | nearest % | best road's worst drive % |",
        "|---|---|---|---|---|",
    ]
    for place, road in (("country", paper.easy_route), ("city", city_road)):
        drives = [courses(road(seed), seed) for seed in OTHER_SEEDS]
        for name, lag, fit in cases:
            off = []
            for three in drives:
                c = fit(three[0])
                off.append([100.0 * (printed_filter(r, c, lag) / r.mass - 1.0) for r in three])
            every = np.ravel(off)
            lines.append(
                f"| {name} | {place} | {np.median(every):+.1f} | {min(every, key=abs):+.2f} "
                f"| {min(map(furthest, off), key=abs):+.1f} |"
            )
    return "\n".join(lines)


def sampling() -> str:
    """Compare means over 7 s and single readings with the true speed; try other lengths."""
    made = simulate_car(paper.scenario(SEED, paper.easy_route(SEED)))
    speed, truth = made.drive.signals["vehicle_speed"], made.truth
    motion = speed_balance(made.drive, paper.weigh_three(SEED)[0].vehicle).motion
    true = np.interp(motion.time - paper.Polling().delay, truth.time, truth.speed)
    off = window_means(motion, motion.speed, 7.0) - window_means(motion, true, 7.0)
    late = np.interp(speed.time - paper.Polling().delay, truth.time, truth.speed)
    fast = speed.values > 5.0
    lines = [
        f"A mean over 7 s of readings in whole km/h at 4 Hz is off by {np.nanstd(off):.3f} m/s, a "
        f"single reading by {np.std((speed.values - late)[fast]):.3f} m/s. The paper's R is that "
        "of 0.010 m/s.",
        "",
        "| sample time s | samples used | R² of the fit | largest error % |",
        "|---|---|---|---|",
    ]
    base = Vehicle(name=paper.CAR.name)
    others = [simulate_car(paper.scenario(SEED + k, paper.easy_route(SEED))) for k in (1, 2)]
    for length in (1.0, 3.5, 7.0, 14.0):
        fitted = calibrate_by_speed(
            [paper.with_grade(made)], [paper.mass_of(made)], base,
            nominal=paper.NOMINAL, sample_time=length,
        )  # fmt: skip
        errors, used = [], 0
        for drive in (made, *others):
            run = run_filter(speed_balance(drive.drive, fitted.vehicle), fitted.vehicle)
            errors.append(mean_mass(run.mass, run.used) / paper.mass_of(drive) - 1.0)
            used = int(np.count_nonzero(run.used))
        lines.append(
            f"| {length:g} | {used} | {fitted.fit.r_squared:.2f} | {100 * furthest(errors):+.4f} |"
        )
    return "\n".join(lines)


def transfer(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors, standard deviations and shares of the start of loaded drives of other cars.

    Every car is calibrated empty on one country road and weighed with loads on
    other roads, half of them city, highway and hills with traffic.
    """
    errors, stds, shares = [], [], []
    for number in range(CARS):
        first = seed + 100 * number
        rng = np.random.default_rng(first)
        car = random_car(rng)
        known = simulate_car(paper.scenario(first, paper.easy_route(first), car=car))
        vehicle = wb.calibrate(
            paper.with_grade(known), mass=paper.mass_of(known), settings=SPEED_EKF
        )
        for k in range(1, DRIVES + 1):
            road = paper.easy_route(first + k) if k % 2 else jensen_route(first + k)
            load = float(rng.uniform(0.0, LARGEST_LOAD * car.mass))
            made = simulate_car(
                paper.scenario(first + k, road, car=car, payload=load, traffic=k % 2 == 0)
            )
            w = wb.weigh(made.drive, vehicle, method="speed-ekf")
            mass = paper.mass_of(made)
            errors.append(w.result.mass / mass - 1.0)
            stds.append(w.result.std / mass)
            shares.append(start_share(w.result.balance, vehicle, SpeedEkfSettings()))
            assert w.status != "converged", w.to_json()
    return np.array(errors), np.array(stds), np.array(shares)


def transfer_text(seed: int) -> str:
    errors, stds, shares = transfer(seed)
    held = int(np.count_nonzero(np.abs(errors) < 1.96 * stds))
    return (
        f"{errors.size} drives of {CARS} cars with loads to {100 * LARGEST_LOAD:.0f} % of the "
        f"car: RMS error {100 * np.sqrt(np.mean(errors**2)):.1f} %, mean "
        f"{100 * errors.mean():+.1f} %, from {100 * errors.min():+.1f} to "
        f"{100 * errors.max():+.1f} %. The intervals, which are not given out, would hold in "
        f"{held}. The start makes {100 * shares.min():.0f} to {100 * shares.max():.0f} % of the "
        f"answers. None is called a mass."
    )


def bmw_i3() -> str:
    """Weigh 24 recorded trips by their speed column alone."""
    if not DATA.is_dir():
        return "The recordings were not there when this page was made."
    car = wb.Vehicle.load(EXAMPLE / "vehicle.toml")
    paths = sorted((DATA / "bmw-i3").glob("Trip*.csv"))
    drives = [wb.read_drive(path, EXAMPLE / "mapping.toml") for path in paths]
    known = drives[0].without("engine_torque", "longitudinal_accel", "throttle")
    told = (1270.0, 1580.0)
    fitted = {
        mass: wb.calibrate(known, mass=mass, vehicle=car, settings=SPEED_EKF) for mass in told
    }
    lines = [
        "| trip | min | samples used | given 1270 kg | given 1580 kg | follows the start by "
        "| as printed, from 1500 kg | from nothing, grade level | status |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    ends = []
    for drive in drives:
        alone = drive.without(*(name for name in drive.signals if name != "vehicle_speed"))
        row = [drive.name, f"{drive.duration / 60:.1f}"]
        found = {m: wb.weigh(alone, v, method="speed-ekf") for m, v in fitted.items()}
        first = found[told[0]]
        balance, vehicle = first.result.balance, fitted[told[0]]
        printed = run_filter(balance, vehicle, paper.PRINTED)
        free = run_filter(balance, vehicle, paper.PINNED, flat=True)
        share = start_share(balance, vehicle, SpeedEkfSettings())
        ends.append([found[m].result.mass for m in told])
        row += [
            str(int(np.count_nonzero(printed.used))),
            *(f"{found[m].result.mass:.0f}" for m in told),
            f"{100 * share:.0f} %",
            f"{mean_mass(printed.mass, printed.used):.0f}",
            f"{free.mass[-1]:.0f}",
            str(first.status),
        ]
        lines.append(f"| {' | '.join(row)} |")
    r_squared = fitted[told[0]].speed_model.r_squared
    a, b = np.array(ends).T
    lines += [
        "",
        f"The fit to {drives[0].name} explains {100 * r_squared:.0f} % of the changes of speed. "
        f"Given 1270 kg of that trip, the filter ends between {a.min():.0f} and {a.max():.0f} kg; "
        f"given 1580 kg, between {b.min():.0f} and {b.max():.0f} kg. "
        f"{sum(1 for _ in drives)} trips, none of which `weigh` calls weighed.",
    ]
    return "\n".join(lines)


def figure(done: paper.Reproduction) -> None:
    """Draw figs. 10, 12 and 14."""
    drawn, axes = plt.subplots(1, 3, figsize=(12, 3.6), sharey=True, layout="constrained")
    for axis, test in zip(axes, done.tests, strict=True):
        used = test.ours.used
        minutes = (test.balance.table.time - test.balance.motion.time[0])[used] / 60.0
        for run, colour, label in (
            (test.ours, "tab:blue", "started at the calibration's mass"),
            (test.printed, "tab:orange", "start and noise as printed"),
        ):
            mass, half = run.mass[used], 1.96 * run.std[used]
            axis.fill_between(minutes, mass - half, mass + half, color=colour, alpha=0.2, lw=0)
            axis.plot(minutes, mass, color=colour, lw=1.4, label=label)
        axis.axhline(test.mass, color="k", ls="--", lw=1, label="true mass")
        axis.set(title=f"Test {test.number:02d}", xlabel="time [min]", ylim=(800, 2300))
    axes[0].set_ylabel("mass [kg], 95 % band of the filter")
    axes[0].legend(fontsize=8)
    folder = HERE / "figures"
    folder.mkdir(exist_ok=True)
    drawn.savefig(folder / "galvao-masses.png", dpi=80)
    plt.close(drawn)


TORQUE = ("own", "second", "sheets", "levels", "electric", "recorded")
"""Parts of the study of speed and recorded torque."""


def marks(name: str) -> tuple[str, str]:
    """Return what stands before and after the table of a part."""
    return f"<!-- torque {name} -->\n", f"<!-- /torque {name} -->"


def between(page: str, name: str) -> str:
    """Return the table of a part that a page has; nothing where it has none."""
    begin, end = marks(name)
    return page.split(begin)[1].split(end)[0] if begin in page else ""


def with_table(page: str, name: str, table: str) -> str:
    """Put the table of a part at its place."""
    begin, end = marks(name)
    before, rest = page.split(begin)
    return f"{before}{begin}{table}{end}{rest.split(end)[1]}"


def torque_table(name: str) -> str:
    """Weigh by speed and recorded torque, and by joint without an accelerometer."""
    rows = speed_torque.parts("judging")[name]()
    return f"{rows}\n" if name == "recorded" else f"{speed_torque.HEAD}\n{rows}\n"


def renew_torque(out: Path, names: Iterable[str]) -> None:
    """Make parts of speed and torque anew; each is written as soon as it is made."""
    for name in names:
        table = torque_table(name)
        out.write_text(with_table(out.read_text(encoding="utf-8"), name, table), encoding="utf-8")


def main() -> None:
    out, asked = HERE / "galvao.md", sys.argv[1:]
    if asked == ["tuning"]:
        print(transfer_text(TUNING))
        return
    if asked and set(asked) <= {*TORQUE, "torque"}:
        renew_torque(out, TORQUE if "torque" in asked else asked)
        return
    done = paper.reproduce(seed=SEED)
    figure(done)
    page = (HERE / "galvao.template.md").read_text(encoding="utf-8")
    for name, text in (
        ("comparison", comparison_table(done)),
        ("tests", markdown(paper.tests_table(done))),
        ("starts", markdown(paper.starts_table(done))),
        ("trials", markdown(paper.trials_table(done))),
        ("roads", other_roads()),
        ("gravity", corrected_gravity()),
        ("chance", chance_of_print()),
        ("readings", readings()),
        ("models", other_models()),
        ("sampling", sampling()),
        ("transfer", transfer_text(JUDGING)),
        ("bmw-i3", bmw_i3()),
    ):
        page = page.replace(f"<!-- {name} -->", text)
    before = out.read_text(encoding="utf-8")
    for name in TORQUE:
        page = with_table(page, name, between(before, name))
    out.write_text(page, encoding="utf-8")
    if asked != ["alone"]:
        renew_torque(out, TORQUE)


if __name__ == "__main__":
    main()
