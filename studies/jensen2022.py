"""Figures of studies/jensen2022.md: the 18 drives, other cars, recorded navigation, sensitivity.

Run from the checkout: ``python studies/jensen2022.py``, or with the names of some parts
(``drives``, ``warm``, ``cars``, ``maps``, ``recorded``), which alone are made anew. Recorded
drives lie in ``../shared/data`` and are not part of the project; without them their tables say so.
"""

from __future__ import annotations

import importlib.util
import math
import re
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, date, datetime
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import navigation as recorded
from scipy.stats import pearsonr

from weighbridge.calibration.run import run_calibration
from weighbridge.calibration.settings import CalibrationSettings
from weighbridge.papers import jensen2022 as paper
from weighbridge.papers import jensen2022_tables as tables
from weighbridge.papers.jensen2022_drives import Conditions, without_weather
from weighbridge.papers.jensen2022_found import found
from weighbridge.papers.jensen2022_judged import BAND
from weighbridge.papers.jensen2022_reproduction import Reproduction, perturbed
from weighbridge.pipeline.weighing import weigh
from weighbridge.simulation import MIDSIZE, make_scenario, random_car, simulate_car

HERE = Path(__file__).parent
CARS = (101, 102, 103, 104, 105, 106)
UNSEEN_CARS = range(173_000, 175_000, 100)
"""Seeds of the cars that the torque maps are compared on; nothing was chosen on them."""
LOADS = (0.0, 300.0)
"""Of the drives that each of them is weighed on [kg]."""


def degrees(angle: float) -> str:
    return f"{math.degrees(angle):.3f}°"


def drives_table(done: Reproduction) -> str:
    lines = [
        "| drive | kind | wind m/s from ° | true kg | paper's rules: worst % | inside % "
        "| mean % | pitch max ° | ours: worst % | at | inside % | mean % | mass kg ± 95 % "
        "| error % | pitch max ° | grade RMS ° | squat found ° |",
        "|" + "---|" * 17,
    ]
    for p, d in zip(done.printed, done.drives, strict=True):
        low, high = d.weighing.interval(0.95)
        row, squat = d.drive, d.balance.motion.squat or 0.0
        lines.append(
            f"| {row.number} | {row.kind} | {row.wind_speed:.0f} {math.degrees(row.wind_from):.0f} "
            f"| {d.true_mass:.0f} | {100 * p.worst:.2f} | {100 * p.inside:.0f} "
            f"| {100 * p.typical:+.2f} | {math.degrees(p.pitch_largest):.2f} "
            f"| {100 * d.worst:.2f} | {d.worst_at:.2f} | {100 * d.inside:.0f} "
            f"| {100 * d.typical:+.2f} | {d.weighing.mass:.0f} ± {0.5 * (high - low):.0f} "
            f"| {100 * d.error:+.2f} | {math.degrees(d.pitch_largest):.2f} "
            f"| {math.degrees(d.grade_rms):.3f} | {math.degrees(squat):.3f} |"
        )
    return "\n".join(lines)


def targets_table(done: Reproduction) -> str:
    count = len(done.drives)

    def inside(drives, name):
        return f"{sum(abs(getattr(d, name)) <= BAND for d in drives)} of {count}"

    def part(drives):
        return f"{100.0 * np.mean([d.inside for d in drives]):.1f} %"

    def largest(name):
        return max(getattr(d, name) for d in done.drives)

    error = np.array([d.error for d in done.drives])
    low_pitch = sum(d.pitch_rms <= math.radians(0.25) for d in done.drives)
    figures = {name: each.text for name, each in found(done).items()}
    rows = [
        ("running mass within ±5 % at every instant of the last two thirds, wind unknown",
         "≥ 16 of 18", inside(done.printed, "worst"), inside(done.drives, "worst")),
        ("part of the last two thirds within ±5 %", "", part(done.printed), part(done.drives)),
        ("mean of the running mass over the last two thirds within ±5 %", "",
         inside(done.printed, "typical"), inside(done.drives, "typical")),
        ("final mass within ±5 %", "", inside(done.printed, "error"),
         f"{inside(done.drives, 'error')}; RMS {100 * np.sqrt(np.mean(error**2)):.2f} %, worst "
         f"{100 * np.max(np.abs(error)):.2f} %"),
        ("95 % intervals that hold the truth", "", "none given",
         f"{sum(d.covered for d in done.drives)} of {count}"),
        ("gear ratios, worst", "≤ 1 % (paper 2 %)", figures["gears printed"],
         figures["gears ours"]),
        ("torque fit R², each row counted once", f"≥ 0.95 (paper {tables.PAPER_R_SQUARED})",
         figures["r2 printed"],
         f"{figures['r2 ours']} (with the fit's weights {done.calibration.rows.r_squared:.3f})"),
        ("largest error of the pitch; time within 1°", "below 1° (paper)",
         figures["pitch printed"], figures["pitch ours"]),
        ("largest error of the slope of the road; time within 1°", "", figures["slope printed"],
         figures["slope ours"]),
        ("slope, RMS error, worst drive", "≤ 0.35°",
         degrees(max(d.grade_rms for d in done.printed)), degrees(largest("grade_rms"))),
        ("pitch, RMS error", "≤ 0.25°", degrees(max(d.pitch_rms for d in done.printed)),
         f"{low_pitch} of {count}; worst {degrees(largest('pitch_rms'))}"),
    ]  # fmt: skip
    lines = ["| figure | target | the paper's own rules | ours |", "|---|---|---|---|"]
    lines += [f"| {a} | {b} | {c} | {d} |" for a, b, c, d in rows]
    return "\n".join(lines)


def parameters_table(done: Reproduction) -> str:
    car = done.car
    load, line = car.road_load, car.driveline
    road = (load.drag_area, load.rolling_coefficient, line.engine_inertia, line.wheel_inertia)
    std = (load.drag_area_std, load.rolling_coefficient_std, line.engine_inertia_std,
           line.wheel_inertia_std)  # fmt: skip
    true = (MIDSIZE.drag_area, MIDSIZE.rolling_coefficient, MIDSIZE.engine_inertia,
            MIDSIZE.wheel_inertia)  # fmt: skip
    lines = ["| parameter | found | std | simulated car | paper's car |", "|---|---|---|---|---|"]
    for k, (name, unit, theirs) in enumerate(
        zip(tables.ROAD, tables.ROAD_UNITS, tables.PAPER_ROAD, strict=True)
    ):
        held = f"{std[k]:.2g}" if std[k] else "bound"
        lines.append(
            f"| {name} [{unit or '-'}] | {road[k]:.4g} | {held} | {true[k]:.4g} | {theirs} |"
        )
    gears = ", ".join(
        f"{found * 30 / math.pi:.1f} ({100 * error:+.2f} %)"
        for found, error in zip(car.driveline.gearings, done.ratio_errors, strict=True)
    )
    return "\n".join(lines) + f"\n\nGearings in rpm per m/s: {gears}."


def other_cars(*, curved: bool) -> str:
    """Weigh cars drawn at random, each calibrated on one drive of its own."""
    lines = [
        "| car | gears found of | ratios, worst % | true kg | mass kg ± 95 % | error % | held |",
        "|---|---|---|---|---|---|---|",
    ]
    errors, held = [], 0
    for seed in CARS:
        car = random_car(np.random.default_rng(seed))
        load = float(np.random.default_rng(seed + 1).uniform(100.0, 350.0))
        known = replace(make_scenario("car-calibration", seed=seed), car=car)
        trip = replace(make_scenario("car", payload=load, seed=seed + 50), car=car)
        made = simulate_car(known)
        if car.electric:
            lines.append(f"| {seed} | electric | | | | left out: no load | |")
            continue
        vehicle = run_calibration(
            without_weather(made.drive),
            float(np.mean(made.truth.mass)),
            settings=CalibrationSettings(method="rls", curved=curved),
        ).vehicle
        loaded = simulate_car(trip)
        mass = float(np.mean(loaded.truth.mass))
        w = weigh(without_weather(loaded.drive), vehicle, method="rls")
        low, high = w.interval()
        found, true = np.array(vehicle.driveline.gearings), np.array(car.gearings)
        ratio = (
            f"{100 * np.max(np.abs(found / true - 1)):.2f}" if found.size == true.size else "other"
        )
        errors.append(w.mass / mass - 1.0)
        held += low <= mass <= high
        lines.append(
            f"| {seed}: {car.mass:.0f} kg, {car.transmission.replace('_', ' ')} "
            f"| {found.size} of {true.size} | {ratio} | {mass:.0f} "
            f"| {w.mass:.0f} ± {0.5 * (high - low):.0f} | {100 * errors[-1]:+.2f} "
            f"| {'yes' if low <= mass <= high else 'no'} |"
        )
    rms = 100 * float(np.sqrt(np.mean(np.square(errors))))
    return "\n".join(lines) + f"\n\nRMS error {rms:.2f} %, {held} of {len(errors)} intervals hold."


def both_maps(seed: int) -> dict[bool, list[tuple[float, float, float]]]:
    """Calibrate one car with the curved map and with the straight one, and weigh its drives.

    Returns
    -------
    found : error, its 95 % half width and R² of the fit of each drive [-]; by whether curved
    """
    car = random_car(np.random.default_rng(seed))
    known = simulate_car(replace(make_scenario("car-calibration", seed=seed), car=car))
    trips = [
        simulate_car(replace(make_scenario("car", payload=load, seed=seed + 50 + k), car=car))
        for k, load in enumerate(LOADS)
    ]
    found: dict[bool, list[tuple[float, float, float]]] = {}
    for curved in (True, False):
        fitted = run_calibration(
            without_weather(known.drive),
            float(np.mean(known.truth.mass)),
            settings=CalibrationSettings(method="rls", curved=curved),
        )
        found[curved] = []
        for trip in trips:
            true = float(np.mean(trip.truth.mass))
            w = weigh(without_weather(trip.drive), fitted.vehicle, method="rls")
            low, high = w.interval()
            error, width = w.mass / true - 1.0, 0.5 * (high - low) / true
            found[curved].append((error, width, fitted.rows.r_squared))
    return found


def maps_table() -> str:
    """Compare the two torque maps on cars that nothing was chosen on."""
    by_car = {seed: both_maps(seed) for seed in UNSEEN_CARS}
    lines = [
        "| torque map | drives | RMS error % | mean % | scatter % | worst % | ± 95 %, median "
        "| held | R² of the fit |",
        "|" + "---|" * 9,
    ]
    for curved, words in ((True, "curved"), (False, "straight, as eq. 49 prints")):
        error, width, r_squared = np.array([r for f in by_car.values() for r in f[curved]]).T
        lines.append(
            f"| {words} | {error.size} | {100 * np.sqrt(np.mean(error**2)):.2f} "
            f"| {100 * error.mean():+.2f} | {100 * error.std(ddof=1):.2f} "
            f"| {100 * np.max(np.abs(error)):.1f} | {100 * np.median(width):.1f} "
            f"| {np.count_nonzero(np.abs(error) <= width)} of {error.size} "
            f"| {r_squared.mean():.4f} |"
        )
    return "\n".join(lines) + "\n\n" + which_is_better(by_car)


def which_is_better(by_car: dict[int, dict[bool, list[tuple[float, float, float]]]]) -> str:
    """Compare size and scatter of the errors of the cars by both maps.

    References
    ----------
    Pitman 1939, A note on normal correlation: both variances are equal where sum and difference do
    not correlate.
    """

    def of_cars(size: Callable[[float], float]) -> np.ndarray:
        """Mean over each car's drives, curved and straight (cars, 2) [%]."""
        return 100.0 * np.array(
            [[np.mean([size(r[0]) for r in f[curved]]) for curved in (True, False)]
             for f in by_car.values()]
        )  # fmt: skip

    curved, straight = of_cars(abs).T
    gap = curved - straight
    mean = of_cars(float)
    chance = pearsonr(mean.sum(axis=1), mean[:, 0] - mean[:, 1]).pvalue
    scatter = mean.std(axis=0, ddof=1)
    return (
        f"Curved less straight, absolute error of a car's drives: {gap.mean():+.2f} ± "
        f"{gap.std(ddof=1) / np.sqrt(gap.size):.2f} % (one standard error); curved is better on "
        f"{np.count_nonzero(gap < 0.0)} of {gap.size} cars. The cars' mean errors scatter by "
        f"{scatter[0]:.2f} and {scatter[1]:.2f} %; if both maps scattered alike, the chance of "
        f"that would be {chance:.0e} (Pitman and Morgan)."
    )


def recorded_tables() -> str:
    if not recorded.DATA.is_dir():
        return "The recordings were not there when this page was made."
    lines = ["| recording | figure | target | measured |", "|---|---|---|---|"]
    folder = recorded.DATA / "comma2k19"
    for cut, text in ((None, "fixes throughout"), (20.0, "no fixes in the last 20 s")):
        drive, time, pitch, _ = recorded.load_comma(folder, gnss_cut=cut)
        motion = recorded.inertial_motion(drive)
        _, std = recorded.score(motion, time, pitch, "pitch")
        lines.append(f"| comma2k19, {text} | body pitch sd after 10 s | ≤ 0.15° | {std:.3f}° |")
    found = []
    for seed in range(6):
        drive, time, grade = recorded.load_rtk(recorded.DATA / "rtk-grade", seed=seed)
        motion = recorded.inertial_motion(drive)
        found.append(recorded.score(motion, time - motion.speed_delay, grade, "grade")[1])
    lines.append(
        f"| rtk-grade, 6 seeds of the added noise | grade sd | ≤ 0.40° "
        f"| {min(found):.3f}° to {max(found):.3f}° |"
    )
    lines.append(
        f"| rtk-grade | squat found | | {math.degrees(motion.squat or math.nan):.2f}"
        f" ± {math.degrees(motion.squat_std or math.nan):.2f}° per m/s² |"
    )
    return "\n".join(lines)


def beside_pyins() -> str:
    if importlib.util.find_spec("pyins") is None:
        return "`pip install python-ins` and run again for the comparison with pyins."
    result = recorded.compare_with_pyins()
    return "\n".join(
        ["| filter | body pitch RMS error |", "|---|---|"]
        + [f"| {name} | {value:.3f}° |" for name, value in result.items()]
    )


def sensitivity_figure(done: Reproduction) -> None:
    """Perturb wind, drag and rolling resistance of drive 7 (figs. 17 to 19)."""
    chosen = done.drives[tables.PERTURBED_DRIVE - 1]
    w = chosen.weighing
    minutes = (w.result.time - w.result.time[0]) / 60.0
    figure, axes = plt.subplots(3, 1, figsize=(9, 10), sharex=True, layout="constrained")
    direction = chosen.drive.wind_from
    panels = (
        ("constant wind from 320° at the vehicle put into the model",
         [(f"{v:.0f} m/s", {"wind_speed": v, "wind_from": direction}) for v in (0, 3, 6, 9)]),
        ("product of drag coefficient and frontal area",
         [(f"{100 * (f - 1):+.0f} %", {"drag": f}) for f in (0.85, 1.0, 1.15)]),
        ("rolling resistance coefficient",
         [(f"{100 * (f - 1):+.0f} %", {"rolling": f}) for f in (0.5, 1.0, 1.5)]),
    )  # fmt: skip
    for axis, (title, cases) in zip(axes, panels, strict=True):
        for label, case in cases:
            mass = perturbed(chosen.balance, w.vehicle, None, **case)
            axis.plot(minutes, mass, lw=1.2, label=label)
        axis.axhline(chosen.true_mass, color="k", lw=1)
        for side in (0.95, 1.05):
            axis.axhline(side * chosen.true_mass, color="k", lw=0.6, ls=":")
        axis.set(title=title, ylabel="mass [kg]", ylim=(1300, 2400))
        axis.legend(ncols=4, fontsize=8)
    axes[-1].set_xlabel("time [min]")
    folder = HERE / "figures"
    folder.mkdir(exist_ok=True)
    figure.savefig(folder / "jensen2022-sensitivity.png", dpi=90)
    plt.close(figure)


def masses_figure(done: Reproduction) -> None:
    """Running mass of all drives (figs. 11, 12, 14, 15)."""
    days = ((0, 3, "reference"), (3, 8, "load"), (8, 13, "tyre pressure"), (13, 18, "windows"))
    figure, axes = plt.subplots(4, 1, figsize=(9, 12), layout="constrained")
    for axis, (a, b, title) in zip(axes, days, strict=True):
        for d in done.drives[a:b]:
            r = d.weighing.result
            km = np.interp(r.time, r.balance.motion.time, r.balance.motion.distance) / 1e3
            (drawn,) = axis.plot(
                km, r.running_mass, lw=1.2, label=f"{d.drive.number}: {d.drive.kind}"
            )
            axis.axhline(d.true_mass, color=drawn.get_color(), lw=0.7, ls="--")
        for side in (0.95, 1.05):
            axis.axhline(side * 1578, color="k", lw=0.6, ls=":")
        axis.set(title=title, ylabel="mass [kg]", ylim=(1400, 2000))
        axis.legend(ncols=3, fontsize=8)
    axes[-1].set_xlabel("distance [km]; dashed: true mass, dotted: ±5 % of the empty car")
    folder = HERE / "figures"
    folder.mkdir(exist_ok=True)
    figure.savefig(folder / "jensen2022-masses.png", dpi=80)
    plt.close(figure)


def drives() -> dict[str, str]:
    """Reproduce the paper: tables and figures of the study."""
    return reproduction(paper.reproduce())


def reproduction(done: Reproduction) -> dict[str, str]:
    """Make of a reproduction what is shown of it; returns the tables of this page."""
    page = Path(tempfile.gettempdir()) / "jensen2022.html"
    paper.as_reproduced(done).write_report(page)
    sensitivity_figure(done)
    masses_figure(done)
    return {
        "targets": targets_table(done),
        "drives": drives_table(done),
        "parameters": parameters_table(done),
    }


def warm() -> dict[str, str]:
    """Drive the 18 drives with engine and tyres warm from the beginning."""
    conditions = Conditions(cold=0.0)
    figures = found(paper.reproduce(settings=paper.Settings(conditions=conditions)))
    lines = ["| warm from the beginning | the paper's own rules | ours |", "|---|---|---|"]
    lines += [
        f"| {words} | {figures[f'{name} printed'].text} | {figures[f'{name} ours'].text} |"
        for words, name in (
            ("drives within ±5 % at every instant of the last two thirds", "within"),
            ("drives 4-8, fig. 12", "load"),
            ("their mean error on the motorway", "passes load"),
            ("drives 14-18 on the motorway, fig. 15", "passes window"),
            ("fluctuation of drive 7 by wind in the model, fig. 17", "calm"),
        )
    ]
    return {"warm": "\n".join(lines)}


def cars() -> dict[str, str]:
    """Weigh other cars with the curved torque map and with the straight one."""
    return {"cars": other_cars(curved=True), "straight cars": other_cars(curved=False)}


def maps() -> dict[str, str]:
    """Compare the curved torque map and the straight one on unseen cars."""
    return {"maps": maps_table()}


def recordings() -> dict[str, str]:
    """Navigate by recorded sensors."""
    return {"recorded": recorded_tables(), "pyins": beside_pyins()}


PARTS = {"drives": drives, "warm": warm, "cars": cars, "maps": maps, "recorded": recordings}


def write_page(tables: dict[str, str]) -> None:
    """Put tables at their places in the template; those not made anew stay as the page has them."""
    page = HERE / "jensen2022.md"
    before = page.read_text(encoding="utf-8")
    text = (HERE / "jensen2022.template.md").read_text(encoding="utf-8")
    for name in re.findall(r"<!-- (.+) -->", text):
        table = tables.get(name) or tabled(before, name)
        begin, end = marks(name)
        text = text.replace(begin.strip(), f"{begin}{table}{end}")
    page.write_text(text, encoding="utf-8")


def marks(name: str) -> tuple[str, str]:
    """Return what stands before and after a table of the page."""
    return f"<!-- {name} -->\n", f"\n<!-- /{name} -->"


def tabled(page: str, name: str) -> str:
    """Return a table of a page."""
    begin, end = marks(name)
    return page.split(begin)[1].split(end)[0]


def dates(page: str, part: str, day: date) -> str:
    """Say when each part of the page was made, this one on that day."""
    known = dict(re.findall(r"(\w+): (\d{4}-\d\d-\d\d)", tabled(page, "made")))
    known[part] = day.isoformat()
    told = ", ".join(f"{name}: {known[name]}" for name in PARTS if name in known)
    return f"Parts of this page by the code of their day: {told}."


def main(names: list[str]) -> None:
    for name in names or list(PARTS):
        made = PARTS[name]()
        page = (HERE / "jensen2022.md").read_text(encoding="utf-8")
        write_page(made | {"made": dates(page, name, datetime.now(tz=UTC).date())})


if __name__ == "__main__":
    main(sys.argv[1:])
