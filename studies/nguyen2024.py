"""Sprung mass and inertias from simulated rides: the paper's experiment, coverage, faults.

Run from the checkout: ``python studies/nguyen2024.py``.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.special import ndtr

from weighbridge.inertia.filter import (
    body_noise,
    corners,
    damping,
    estimate,
    inverse_interval,
    push_var,
    stiffness,
)
from weighbridge.inertia.integration import integration_std
from weighbridge.inertia.ride_checks import ride_samples
from weighbridge.inertia.settings import InertiaSettings
from weighbridge.papers import nguyen2024 as paper
from weighbridge.pipeline.inertia import estimate_inertia
from weighbridge.signals import Drive
from weighbridge.simulation import TRUCK, RideScenario, RideSensors, simulate_ride
from weighbridge.vehicle.model import Vehicle

HERE = Path(__file__).parent

# Judged here alone; the filter was made with seeds below 200, the roads of 9000 to 9029, and
# random rides of 1, 21, 41, 43 and 9001. An earlier table of seeds 12000 up had been looked at.
FIRST_SEED = 182_000
EXPERIMENTS = 30
ROADS = 100
SETTLED = 2.0
CLASSES = "ABCDE"
EMPTY = TRUCK.sprung_mass


def table(heads, rows) -> str:
    lines = [f"| {' | '.join(heads)} |", "|" + "---|" * len(heads)]
    return "\n".join(lines + [f"| {' | '.join(row)} |" for row in rows])


def three(values, form=".2f") -> str:
    return " / ".join(f"{v:{form}}" for v in values)


def experiment() -> tuple[str, str]:
    results, _ = paper.reproduce(seed=FIRST_SEED, roads=EXPERIMENTS)
    rows = []
    for name, found in results.items():
        mape = 100.0 * np.array([r.mape for r in found])
        settled = np.array([r.settled for r in found])
        rows.append(
            (
                name,
                three(np.median(mape, axis=0)),
                three(np.max(mape, axis=0)),
                three(np.max(settled, axis=(0, 2))),
                f"{np.sum(settled[:, 1:] > 0.3)} of {settled[:, 1:].size}",
            )
        )
    cases = table(
        ("filter and reading", "median MAPE %, mass / roll / pitch", "worst MAPE %",
         "longest until within 5 % for good, start / first / second change, s",
         "later than 0.3 s after a change"),
        rows,
    )  # fmt: skip
    best = results[paper.cases.PAPERS_CASE.name]
    rows = []
    for label, name, theirs, scale, form in (
        ("RMSE kg, kg m²", "rmse", paper.PAPER_RMSE, 1.0, ".0f"),
        ("MAPE %", "mape", paper.PAPER_MAPE, 100.0, ".2f"),
        ("RMSE of velocities m/s, rad/s", "velocity_rmse", paper.PAPER_VELOCITY_RMSE, 1.0, ".5f"),
        ("MAPE of velocities %", "velocity_mape", paper.PAPER_VELOCITY_MAPE, 100.0, ".2f"),
    ):
        values = scale * np.array([getattr(r, name) for r in best])
        rows.append(
            (label, three(theirs, "g"), three(np.median(values, axis=0), form),
             three(np.max(values, axis=0), form))
        )  # fmt: skip
    return table(("", "paper", "ours, median of 30 roads", "worst"), rows), cases


def fixed_noise() -> str:
    """Scan the fixed process noise of the filters without jumps."""
    made = [paper.simulate(FIRST_SEED + k, paper.cases.PAPERS_SENSORS) for k in range(5)]
    rows = []
    for method in ("inverse", "extended"):
        for density in (1e-4, 1e-3, 1e-2, 1e-1, 1.0):
            case = paper.Case("", method, InertiaSettings(offset_std=0.0, process=(1e-6, density)))
            found = [paper.judge(m, paper.run(case, m)) for m in made]
            quiet = [
                np.std((paper.run(case, m).parameters / m.inertias)[(m.time > 4) & (m.time < 7)],
                       axis=0)
                for m in made
            ]  # fmt: skip
            rows.append(
                (method, f"{density:g}", three(100 * np.mean([r.mape for r in found], axis=0)),
                 three(100 * np.mean(quiet, axis=0)))
            )  # fmt: skip
    return table(
        ("form", "density of the parameters' process noise, 1/s", "MAPE %",
         "scatter between the changes %"), rows,
    )  # fmt: skip


def bounds() -> str:
    """Say how closely 0.3 s after a change can tell the parameters at best.

    The Cramer-Rao bound, for an estimator that knows when the load changed, and the
    velocities at that moment.
    """
    rows = []
    for case in (paper.cases.PAPERS_CASE, paper.cases.AS_VARIANCE, paper.cases.ORDINARY_SENSORS):
        sensors = case.sensors
        ride = paper.suspension_of(TRUCK, sensors)
        body, push, step = body_noise(ride), np.sqrt(push_var(ride)), 1.0 / sensors.rate
        count = round(0.3 * sensors.rate)
        sample = np.arange(1, count + 1)
        stds = []
        for k in range(EXPERIMENTS):
            made = paper.simulate(FIRST_SEED + k, sensors)
            force = -np.hstack((made.inputs[:, :4] * stiffness(ride),
                                made.inputs[:, 4:] * damping(ride)))  # fmt: skip
            accel = force @ np.vstack((corners(ride), corners(ride))) / made.inertias
            for at, factor in paper.cases.CHANGES:
                first = np.searchsorted(made.time, at - 0.5 * step)
                after = cumulative_trapezoid(accel[first : first + count + 1], dx=step, axis=0)
                for j in range(3):
                    walk = (push[j] * step / factor) ** 2 * np.minimum.outer(sample, sample)
                    noise = walk + body[j] ** 2 * np.eye(count)
                    stds.append(1.0 / np.sqrt(after[:, j] @ np.linalg.solve(noise, after[:, j])))
        outside = 2.0 * np.sum(ndtr(-0.05 / np.array(stds)))
        rows.append((case.name, f"{100 * np.median(stds):.2f}", f"{100 * np.max(stds):.1f}",
                     f"{outside:.0f} of {len(stds)}"))  # fmt: skip
    return table(
        ("reading", "median least standard deviation %", "worst",
         "expected outside 5 % after 0.3 s"), rows,
    )  # fmt: skip


def draw(rng, k, **more) -> RideScenario:
    sensors = more.pop("sensors", RideSensors())
    return RideScenario(
        vehicle=more.pop("vehicle", TRUCK).loaded(rng.uniform(0.8, 1.6)),
        road_class=str(rng.choice(list(CLASSES))),
        speed=rng.uniform(20.0, 100.0) / 3.6,
        duration=more.pop("duration", 20.0),
        zero_mass=EMPTY,
        sensors=sensors,
        seed=FIRST_SEED + k,
        **more,
    )


def coverage() -> tuple[str, str]:
    """Hold the running interval against the truth at every instant after settling."""
    by_rate = []
    by_class: dict[str, list] = {c: [] for c in CLASSES}
    for hz in (100.0, 200.0, 500.0, 1000.0):
        sensors = RideSensors(rate=hz)
        ride = paper.suspension_of(TRUCK, sensors)
        rng = np.random.default_rng(FIRST_SEED)
        held, final, width = [], [], []
        for k in range(ROADS):
            scenario = draw(rng, k, sensors=sensors)
            made = simulate_ride(scenario)
            samples = ride_samples(made.drive)
            track = estimate(samples, ride)
            late = track.time > SETTLED
            # As in `weighbridge inertia`, with what the logger's rate costs.
            std = np.hypot(track.alpha_std, track.alpha * integration_std(samples, ride))
            low, high = inverse_interval(track.reference, track.alpha, std, 0.95)
            inside = ((low <= made.inertias) & (made.inertias <= high))[late]
            held.append(np.mean(inside, axis=0))
            final.append(track.parameters[-1] / made.inertias[-1] - 1.0)
            width.append(std[-1] / track.alpha[-1])
            if hz == 500.0:
                by_class[scenario.road_class].append((held[-1], final[-1], width[-1]))
        by_rate.append(
            (f"{hz:.0f} Hz", three(100 * np.mean(held, axis=0), ".1f"),
             f"{100 * np.mean(held):.1f}", three(100 * np.sqrt(np.mean(np.square(final), axis=0))),
             three(100 * np.median(width, axis=0)))
        )  # fmt: skip
    rows = []
    for c, found in by_class.items():
        held, final, width = (np.array([f[i] for f in found]) for i in range(3))
        rows.append(
            (c, str(len(found)), f"{100 * np.mean(held):.1f}",
             three(100 * np.sqrt(np.mean(np.square(final), axis=0))),
             three(100 * np.median(width, axis=0)))
        )  # fmt: skip
    heads = ("instants held %, mass / roll / pitch", "together %", "RMS error after 20 s %",
             "median standard deviation %")  # fmt: skip
    return (
        table(("sampled at", *heads), by_rate),
        table(("class, at 500 Hz", "roads", "instants held %", *heads[2:]), rows),
    )


def faults() -> str:
    c, d = np.array(TRUCK.stiffness), np.array(TRUCK.damping)

    def truck(**parts):
        return {"vehicle": replace(TRUCK, **{k: tuple(v) for k, v in parts.items()})}

    def sensors(**parts):
        return {"sensors": RideSensors(**parts)}

    pushes = ((8.0, 11.0, -3.0, 0.0), (14.0, 18.0, 1.0, 0.0), (20.0, 24.0, 0.0, 2.5))
    busy = tuple(
        (2.0 + 4.0 * k, 3.5 + 4.0 * k, (1.0, -2.0)[k % 2], (2.0, 0.0, 0.0)[k % 3]) for k in range(7)
    )
    cases = {
        "none": {},
        "braking 3 m/s², starting 1 m/s², a turn of 2.5 m/s²": {"manoeuvres": pushes},
        "braking or turning every 4 s": {"manoeuvres": busy},
        "springs 10 % softer": truck(stiffness=0.9 * c),
        "front springs 10 % softer": truck(stiffness=c * [0.9, 0.9, 1, 1]),
        "springs and dampers 10 % softer": truck(stiffness=0.9 * c, damping=0.9 * d),
        "noise of travel and rate × 3": sensors(travel_noise=6e-4, rate_noise=1.5e-2),
        "noise of travel × 10": sensors(travel_noise=2e-3),
        "noise of rate × 10": sensors(rate_noise=5e-2),
        "one travel sensor 10 mm off": sensors(travel_offset=(0.01, 0.0, 0.0, 0.0)),
        "all travel sensors 10 mm off": sensors(travel_offset=(0.01,) * 4),
        "all travel sensors 20 mm off": sensors(travel_offset=(0.02,) * 4),
        "travel and rate of one wheel × 0.8": sensors(travel_factor=(0.8, 1.0, 1.0, 1.0)),
        "one damper locked (× 20)": truck(damping=d * [20, 1, 1, 1]),
        "one damper × 4": truck(damping=d * [4, 1, 1, 1]),
        "one damper without oil (× 0.05)": truck(damping=d * [0.05, 1, 1, 1]),
        "the same, 8 s of ride": {**truck(damping=d * [0.05, 1, 1, 1]), "duration": 8.0},
        "one damper locked, 8 s of ride": {**truck(damping=d * [20, 1, 1, 1]), "duration": 8.0},
        "no fault, 8 s of ride": {"duration": 8.0},
    }
    known = paper.suspension_of(TRUCK, RideSensors())
    car = Vehicle(name="truck", kind="truck", ride=replace(known, zero_mass=EMPTY))
    blind = replace(car, ride=known)
    rows = []
    for name, parts in cases.items():
        rng = np.random.default_rng(FIRST_SEED + 1)
        errors, held, reach, warned, refused, blind_held = [], [], [], 0, 0, []
        count = 20
        for k in range(count):
            made = simulate_ride(draw(rng, 500 + k, **{"duration": 30.0, **parts}))
            found = estimate_inertia(Drive("ride", made.drive.signals), car)
            true = made.inertias[-1]
            refused += found.status != "converged"
            warned += found.status != "converged" or bool(found.warnings)
            if found.status == "converged":
                low, high = found.intervals()
                errors.append(found.values / true - 1.0)
                held.append((low <= true) & (true <= high))
                reach.append(1.96 * found.stds / found.values)
            unaided = estimate_inertia(Drive("ride", made.drive.signals), blind)
            if unaided.status == "converged":
                low, high = unaided.intervals()
                blind_held.append((low <= true) & (true <= high))
        rms = three(100 * np.sqrt(np.nanmean(np.square(errors), axis=0)), ".1f") if errors else ""
        rows.append(
            (name, f"{refused}", f"{warned - refused}", rms,
             three(100 * np.nanmedian(reach, axis=0), ".1f") if reach else "",
             f"{np.sum(held)} of {np.size(held)}" if held else "",
             f"{np.sum(blind_held)} of {np.size(blind_held)}" if blind_held else "")
        )  # fmt: skip
    return table(
        ("what is wrong, 20 rides of 30 s unless said", "refused", "weighed with a warning",
         "RMS error %, mass / roll / pitch", "median ± 95 %", "intervals that hold",
         "the same without zero_mass_kg"),
        rows,
    )  # fmt: skip


def main() -> None:
    page = (HERE / "nguyen2024.template.md").read_text(encoding="utf-8")
    # The longest first, two at a time.
    with ProcessPoolExecutor(2) as pool:
        started = [pool.submit(f) for f in (experiment, faults, coverage, fixed_noise, bounds)]
        (table_2, cases), faulty, (rates, classes), fixed, least = (f.result() for f in started)
    for name, text in (
        ("table2", table_2),
        ("cases", cases),
        ("bounds", least),
        ("fixed", fixed),
        ("rates", rates),
        ("classes", classes),
        ("faults", faulty),
    ):
        page = page.replace(f"<!-- {name} -->", text)
    (HERE / "nguyen2024.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
