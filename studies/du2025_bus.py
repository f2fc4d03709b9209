"""Buses for studies/du2025.py: the paper's experiment, a city, bends and the second model."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import polars as pl
from second_model import make_drive, random_vehicle

import weighbridge as wb
from weighbridge.balance import ForceBalance
from weighbridge.calibration.run import run_calibration
from weighbridge.calibration.settings import CalibrationSettings
from weighbridge.estimators import MassTrack, hybrid, robust_rls
from weighbridge.estimators.hybrid import Blend
from weighbridge.papers import du2025 as paper
from weighbridge.papers import du2025_bus
from weighbridge.papers.du2025_methods import FORMS, METHODS, PAPER_RMSE, PRINTED, Settings
from weighbridge.report.table import Table
from weighbridge.signals import Floats, scalar_to_si
from weighbridge.simulation import make_scenario, simulate_car
from weighbridge.vehicle.model import Vehicle

SEED, DRIVES = paper.SEED, 7
CITY = 3
"""City drives of each kind, from `SEED`."""
OPPOSITE = 8
"""Drives at each load of the table of opposite signs."""
SECOND = range(9970, 9975)
SETTLED = 60.0
"""From when a running mass is judged in a city or by the second model, after the first [s]."""
FAST = scalar_to_si(40.0, "kmh")
SENSOR_AHEAD = 4.0
"""Of the accelerometer in the drives with bends, ahead of the rear axle [m]."""


@dataclass(frozen=True)
class Curves:
    """Running masses of one drive, thinned, to be drawn."""

    title: str
    time: Floats
    masses: dict[str, Floats]
    true: tuple[Floats, Floats] | None
    middle: float

    @classmethod
    def of(
        cls, title: str, tracks: Mapping[str, MassTrack], mass: float, *, drawn: bool = True
    ) -> Curves:
        """Take the tracks of Du's methods; ``drawn``: the mass is the true one."""
        track = tracks["ekf"]
        rows = slice(None, None, max(1, track.time.size // 1500))
        masses = {m: tracks[m].running_mass[rows] for m in METHODS}
        true = (track.time[[0, -1]], np.array([mass, mass])) if drawn else None
        return cls(title, track.time[rows], masses, true, mass)

    def draw(self, axis: plt.Axes) -> None:
        for name, mass in self.masses.items():
            axis.plot(self.time, mass, label=name, lw=1)
        if self.true is not None:
            axis.plot(*self.true, "k--", lw=1, label="true")
        axis.set_ylim(0.8 * self.middle, 1.2 * self.middle)
        axis.set_title(self.title)


@dataclass(frozen=True)
class Part:
    """What one part of the study makes: its tables by place, and curves."""

    tables: dict[str, str]
    curves: Curves | None = None


def lines_of(table: Table) -> str:
    """Return a table as Markdown."""
    rows = [table.columns, ("---",) * len(table.columns), *table.rows]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def bus() -> Part:
    """Do the paper's experiment: as printed, by our filters, with all effects; each blend."""
    done = paper.reproduce(seed=SEED, drives=DRIVES)
    half = next(d for d in done.road if d.load == "half-load")
    title = "bus on a straight road, half-load, all effects"
    return Part(
        {
            "printed": lines_of(paper.printed_table(done)),
            "bus": ours(done),
            "blends": lines_of(paper.blend_table(done)),
            "errors": errors(done),
            "early": early(),
        },
        Curves.of(title, half.tracks, half.true_mass),
    )


def ours(done: paper.Reproduction) -> str:
    """Table 2 by our filters."""
    lines = [
        "| load, method | paper RMSE kg | same drives, mean kg | worst kg | below the paper's "
        "| largest error % | all effects, mean kg | worst kg | below the paper's "
        "| largest error % | 95 % interval holds % |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for load, theirs in PAPER_RMSE.items():
        for method, rmse in zip(METHODS, theirs, strict=True):
            row = f"| {load}, {method} | {rmse:.0f} "
            for drives in (done.drives, done.road):
                every = paper.cell(drives, load, method, "late_rmse")
                worst = paper.cell(drives, load, method, "worst").max()
                row += (
                    f"| {every.mean():.0f} | {every.max():.0f} | {np.sum(every < rmse)} "
                    f"| {100 * worst:.1f} "
                )
            held = paper.cell(done.road, load, method, "held").mean()
            lines.append(row + f"| {100 * held:.0f} |")
    return "\n".join(lines)


def errors(done: paper.Reproduction) -> str:
    """How alike the errors of the two filters are, which a blend lives on."""
    lines = [
        "| drives | robust-rls, mean error kg | ekf, mean error kg | correlation "
        "| of opposite sign % | best constant share |",
        "|---|---|---|---|---|---|",
    ]
    for name, drives in (("as in the paper", done.drives), ("all effects", done.road)):
        for load in du2025_bus.LOADS:
            pairs = [late_errors(d) for d in drives if d.load == load]
            lines.append(likeness(f"{name}, {load}", pairs))
    return "\n".join(lines)


def late_errors(d: paper.DriveResult) -> tuple[Floats, Floats]:
    """Errors of both filters from the paper's 21 s on [kg]."""
    late = d.tracks["ekf"].time >= d.tracks["ekf"].time[0] + paper.CONVERGED
    first, second = (d.tracks[m].running_mass[late] - d.true_mass for m in METHODS[:2])
    return first, second


def likeness(name: str, pairs: Iterable[tuple[Floats, Floats]]) -> str:
    """One row of `errors`."""
    pairs = list(pairs)
    first, second = (np.concatenate(x) for x in zip(*pairs, strict=True))
    alike = np.mean(first * second) / np.sqrt(np.mean(first**2) * np.mean(second**2))
    shares = np.linspace(-1.0, 1.0, 41)
    found = [np.mean([paper.rms(s * a + (1.0 - s) * b) for a, b in pairs]) for s in shares]
    return (
        f"| {name} | {first.mean():+.0f} | {second.mean():+.0f} | {alike:.2f} "
        f"| {100.0 * np.mean(first * second < 0.0):.0f} | {shares[int(np.argmin(found))]:+.2f} |"
    )


def early() -> str:
    """When the least squares stay within 10 %, with and without braking at 12 s."""
    lines = [
        "| load | as printed, braking at 12 s | without | ours, braking at 12 s | without |",
        "|---|---|---|---|---|",
    ]
    vehicle = du2025_bus.known_bus()
    for load, payload in du2025_bus.LOADS.items():
        cells = []
        for printed in (True, False):
            settings = Settings(as_printed=printed, printed=FORMS[-1].of(PRINTED))
            estimate = settings.estimators["robust-rls"]
            for braking in (True, False):
                found = []
                for seed in range(SEED, SEED + 5):
                    made = du2025_bus.simulate(payload, seed, as_paper=True, early_braking=braking)
                    balance = wb.weigh(made.drive, vehicle, method="robust-rls").result.balance
                    mass = float(np.mean(made.truth.mass))
                    track = estimate(balance, vehicle)
                    found.append(paper.steady_from(track, mass, made.drive.start))
                cells.append(f"{np.mean(found):.1f} ({np.max(found):.1f})")
        lines.append(f"| {load} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def opposite() -> Part:
    """Run both filters as printed, told a rolling coefficient ever nearer to the tyres'."""
    vehicle = du2025_bus.known_bus()
    blends = (Blend.SPEED, Blend.SHARE, Blend.INNOVATIONS)
    lines = [
        "| f, load | robust-rls, mean error kg | ekf, mean error kg | correlation | of opposite "
        "sign % | best constant share | robust-rls RMSE kg | ekf | "
        + " | ".join(f"blend {b.value}" for b in blends)
        + " |",
        "|---" * 11 + "|",
    ]
    balances = {}
    for load, payload in du2025_bus.LOADS.items():
        for seed in range(SEED, SEED + OPPOSITE):
            made = du2025_bus.simulate(payload, seed, as_paper=True)
            weighed = wb.weigh(made.drive, vehicle, method="robust-rls").result
            balances[load, seed] = weighed.balance, float(np.mean(made.truth.mass))
    for rolling in (0.005, 0.0065, 0.0075, None):
        form = replace(FORMS[-1], rolling=rolling)
        chosen = Settings(as_printed=True, printed=form.of(PRINTED))
        least = chosen.estimators["hybrid"].keywords["settings"]
        for load in du2025_bus.LOADS:
            found = []
            for seed in range(SEED, SEED + OPPOSITE):
                balance, mass = balances[load, seed]
                late = balance.table.time >= balance.table.time[0] + paper.CONVERGED
                tracks = [chosen.estimators[m](balance, vehicle) for m in METHODS[:2]]
                tracks += [
                    hybrid.estimate(balance, vehicle, replace(least, blend=b)) for b in blends
                ]
                found.append([t.running_mass[late] - mass for t in tracks])
            name = "of the tyres" if rolling is None else f"{rolling:g}"
            row = likeness(f"{name}, {load}", [(f[0], f[1]) for f in found])
            means = [np.mean([paper.rms(f[k]) for f in found]) for k in range(5)]
            lines.append(row + " " + " | ".join(f"{x:.0f}" for x in means) + " |")
    return Part({"opposite": "\n".join(lines)})


@cache
def calibrated() -> Vehicle:
    """Return the bus of `paper.reproduce`, calibrated on six straight drives."""
    known = []
    for k in range(paper.CALIBRATION_DRIVES):
        for number, payload in enumerate(du2025_bus.LOADS.values()):
            far = paper.CALIBRATION_SEED + SEED + len(du2025_bus.LOADS) * k + number
            known.append(du2025_bus.simulate(payload, far, as_paper=False))
    masses = [float(np.mean(m.truth.mass)) for m in known]
    drives = [m.drive for m in known]
    return run_calibration(drives, masses, vehicle=du2025_bus.data_sheet()).vehicle


def city_drive(payload: float, seed: int, ahead: float | None = None):
    """Drive a quarter of an hour of the bus line with a load that stays."""
    made = make_scenario("bus-urban", payload=min(payload, 5600.0), seed=seed)
    made = replace(
        made,
        loading=tuple(replace(stop, load=0.0) for stop in made.loading),
        payload=payload,
        duration=900.0,
    )
    if ahead is not None:
        made = replace(made, sensors=replace(made.sensors, lever=(ahead, 0.25, -0.15)))
    return simulate_car(made)


def settled_errors(track: MassTrack, time: Floats, mass: Floats) -> Floats:
    """Errors of a running mass from `SETTLED` after the first one told [kg]."""
    told = np.isfinite(track.running_mass)
    late = told & (track.time >= track.time[np.argmax(told)] + SETTLED)
    return np.asarray(track.running_mass[late] - np.interp(track.time[late], time, mass))


def blended(balance: ForceBalance, vehicle: Vehicle) -> dict[str, MassTrack]:
    """Both filters, and the hybrid by each blend."""
    tracks = {m: e(balance, vehicle) for m, e in Settings().estimators.items() if m != "hybrid"}
    for blend in Blend:
        tracks[blend.value] = Settings(blend=blend).estimators["hybrid"](balance, vehicle)
    return tracks


HEAD = "| {} | " + " | ".join((*METHODS[:2], *(f"blend {b.value}" for b in Blend))) + " |"


def rms_row(name: str, found: list[dict[str, Floats]], places: int = 0) -> str:
    """One row of RMS, the mean of drives, by filter and blend."""
    means = [np.mean([paper.rms(f[key]) for f in found]) for key in found[0]]
    return f"| {name} | " + " | ".join(f"{x:.{places}f}" for x in means) + " |"


def city() -> Part:
    """Weigh a bus in a city, where h(v) is between nothing and one."""
    vehicle = calibrated()
    lines = [HEAD.format("load"), "|---" * 9 + "|"]
    alike = [
        "| drives | robust-rls, mean error kg | ekf, mean error kg | correlation "
        "| of opposite sign % | best constant share | driving below 40 km/h % "
        "| mean share h(v) driving |",
        "|---" * 8 + "|",
    ]
    for load, payload in du2025_bus.LOADS.items():
        found, slow, share = [], [], []
        for seed in range(SEED, SEED + CITY):
            made = city_drive(payload, seed)
            balance = wb.weigh(made.drive, vehicle, method="hybrid").result.balance
            tracks = blended(balance, vehicle)
            truth = made.truth
            found.append({k: settled_errors(t, truth.time, truth.mass) for k, t in tracks.items()})
            table = balance.table
            speed = table.speed[table.moving]
            slow.append(np.mean(speed < FAST))
            usual = hybrid.HybridSettings()
            h = 1.0 / (1.0 + np.exp((speed - usual.blend_speed) / usual.blend_width))
            share.append(np.mean(h))
        lines.append(rms_row(load, found))
        row = likeness(load, [(f["robust-rls"], f["ekf"]) for f in found])
        alike.append(f"{row} {100.0 * np.mean(slow):.0f} | {np.mean(share):.2f} |")
    return Part({"city": "\n".join(lines), "alike": "\n".join(alike)})


def bends() -> Part:
    """Weigh with a sensor ahead of the rear axle, its reading in bends taken off or not."""
    vehicle = calibrated()
    lines = [
        "| half-load, seed | sensor ahead m | RMS of the term in bends m/s² | most m/s² "
        "| robust-rls, not taken off kg | taken off kg | ekf, not taken off kg |",
        "|---" * 7 + "|",
    ]
    for seed in range(SEED, SEED + CITY):
        for ahead in (-0.45, SENSOR_AHEAD):
            made = city_drive(3000.0, seed, ahead)
            balance = wb.weigh(made.drive, vehicle, method="robust-rls").result.balance
            table = balance.table
            off = robust_rls.RobustRlsSettings(sensor_ahead=ahead)
            taken = robust_rls.as_set(balance, vehicle, off).balance.table
            term = np.abs(taken.specific_force - table.specific_force)[table.usable]
            bend = term[term > 0.02] if np.any(term > 0.02) else np.zeros(1)
            cells = []
            for estimate in (
                Settings().estimators["robust-rls"],
                lambda b, v, off=off: robust_rls.estimate(b, v, off),
                Settings().estimators["ekf"],
            ):
                track = estimate(balance, vehicle)
                error = settled_errors(track, made.truth.time, made.truth.mass)
                cells.append(f"{paper.rms(error):.0f} ({error.mean():+.0f})")
            lines.append(
                f"| {seed} | {ahead:g} | {paper.rms(bend):.2f} | {term.max():.2f} | "
                + " | ".join(cells)
                + " |"
            )
    return Part({"bends": "\n".join(lines)})


def second_bus(seed: int) -> dict[str, dict[str, Floats]]:
    """Calibrate one of the second model's buses and weigh it at each load.

    Returns
    -------
    Errors of the running mass [%] by filter and blend, by load; no load where it was refused.
    """
    made = random_vehicle("electric_bus", seed)
    room = made.gross - made.tare - 75.0
    found = {}
    with tempfile.TemporaryDirectory() as home:

        def go(part: float, number: int) -> tuple[wb.Drive, Floats, Floats]:
            folder = Path(home) / f"{number}-{part:g}"
            mass = made.tare + 75.0 + part * room
            make_drive(folder, made, mass=mass, seed=number, duration=1200.0)
            true = pl.read_parquet(folder / "truth.parquet", columns=["time_s", "mass_kg"])
            return wb.read_drive(folder), true["time_s"].to_numpy(), true["mass_kg"].to_numpy()

        far = paper.CALIBRATION_SEED + 10 * seed
        known = [go(part, far + k) for k, part in enumerate((0.0, 0.5, 0.9))]
        bus = wb.calibrate(
            [k[0] for k in known],
            [float(k[2][0]) for k in known],
            vehicle=wb.Vehicle(name="electric bus", kind="bus"),
            settings=CalibrationSettings(method="rls"),
        )
        for part, load in zip((0.0, 0.5, 1.0), du2025_bus.LOADS, strict=True):
            drive, time, mass = go(part, seed)
            result = wb.weigh(drive, bus, method="hybrid").result
            if result is None:
                continue
            tracks = blended(result.balance, bus)
            found[load] = {
                name: 100.0 * settled_errors(track, time, mass) / mass[0]
                for name, track in tracks.items()
            }
    return found


def second_table(buses: Sequence[dict[str, dict[str, Floats]]]) -> str:
    """One row a load, and one of all."""
    lines = [HEAD.format("load, % of the mass"), "|---" * (3 + len(Blend)) + "|"]
    every = []
    for load in du2025_bus.LOADS:
        found = [bus[load] for bus in buses if load in bus]
        every += found
        if found:
            lines.append(rms_row(f"{load}, {len(found)} drives", found, places=1))
    refused = len(du2025_bus.LOADS) * len(buses) - len(every)
    lines.append(rms_row(f"all, {refused} refused", every, places=1))
    return "\n".join(lines)


def second() -> Part:
    """Weigh the second model's buses: nothing was tuned on them."""
    return Part({"second": second_table([second_bus(seed) for seed in SECOND])})


def urban() -> Part:
    """Errors of the running mass before each change of load."""
    vehicle = calibrated()
    errors: dict[str, list[Floats]] = {m: [] for m in (*METHODS, "speed")}
    held: dict[str, list[Floats]] = {m: [] for m in errors}
    curves = None
    for seed in range(SEED, SEED + CITY):
        made = simulate_car(make_scenario("bus-urban", payload=1400.0, seed=seed))
        truth = made.truth
        balance = wb.weigh(made.drive, vehicle, method="hybrid").result.balance
        changes = np.flatnonzero(np.abs(np.diff(truth.mass)) > 0.05)
        # A change of load takes many steps of the truth: its first one ends a stretch.
        ends = changes[np.concatenate(([True], np.diff(changes) > 20))]
        tracks = {m: e(balance, vehicle) for m, e in Settings().estimators.items()}
        tracks["speed"] = Settings(blend=Blend.SPEED).estimators["hybrid"](balance, vehicle)
        for method, track in tracks.items():
            at = np.searchsorted(track.time, truth.time[ends])
            off = track.running_mass[at] / truth.mass[ends] - 1.0
            half = 1.96 * track.running_std[at] / truth.mass[ends]
            told = np.isfinite(off)
            errors[method].append(off[told])
            held[method].append((np.abs(off) < half)[told])
        if curves is None:
            curves = replace(
                Curves.of("bus in a city", tracks, float(np.mean(truth.mass))),
                true=(truth.time[::20], truth.mass[::20]),
            )
    lines = [
        "| method | stretches | mean error % | RMS % | 95 % of them within % | worst % "
        "| 95 % interval holds % |",
        "|---|---|---|---|---|---|---|",
    ]
    for method, parts in errors.items():
        off = 100.0 * np.concatenate(parts)
        name = "hybrid, blend speed" if method == "speed" else method
        lines.append(
            f"| {name} | {off.size} | {off.mean():+.1f} | {np.sqrt(np.mean(off**2)):.1f} "
            f"| {np.percentile(np.abs(off), 95):.1f} | {np.abs(off).max():.1f} "
            f"| {100.0 * np.mean(np.concatenate(held[method])):.0f} |"
        )
    return Part({"urban": "\n".join(lines)}, curves)
