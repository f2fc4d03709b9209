"""Tables and figures in numbers of the reproduction of Jensen et al. 2022."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.signal import find_peaks
from scipy.stats import gaussian_kde

from weighbridge.estimators.rls import RlsSettings, run_in_turn
from weighbridge.papers.jensen2022_gradient import gradient_figures
from weighbridge.papers.jensen2022_judged import BAND, DriveResult, joined, within
from weighbridge.papers.jensen2022_reproduction import (
    HighwayResult,
    Reproduction,
    perturbed,
)
from weighbridge.papers.reproduced import Comparison, rms
from weighbridge.report.table import Table
from weighbridge.results.calibration import Calibration
from weighbridge.signals import Floats
from weighbridge.signals.units import from_si, scalar_from_si, scalar_to_si
from weighbridge.simulation import MIDSIZE
from weighbridge.vehicle.model import Vehicle

PAPER_R_SQUARED: Final = 0.972
"""Of the torque fit (Table 6)."""

PAPER_ROAD: Final = ("0.70", "0.008", "0.14", "7.0")
"""C_d A, C_r, I_e and I_w in `ROAD_UNITS`, as Table 6 prints them."""

PAPER_WEIGHTS: Final = ("-17.85", "9.64", "2.5e-3", "-1.44e-6")
"""w0 to w3 in `WEIGHT_UNITS`, as Table 6 prints them."""

ROAD: Final = ("C_d A", "C_r", "I_e", "I_w")
"""Names of the road parameters."""

ROAD_UNITS: Final = ("m²", "", "kg m²", "kg m²")
"""Of the road parameters; C_r has none."""

WEIGHT_UNITS: Final = ("N m", "N m/%", "N m/rpm", "N m/rpm²", "N m/rpm³", "N m/rpm⁴")
"""Of the coefficients of eq. 49: load in percent, engine speed in rpm."""

PERTURBED_DRIVE: Final = 7
"""Drive of figs. 17-19: the captions say 6 with 240 kg, which by Table B.1 is 7."""

HIGHWAY_SPEED: Final = 25.0
"""Faster is on the highway [m/s]."""

SETTLED: Final = 600.0
"""The running mass of fig. 16 is judged after so long [s]."""


def drives_table(done: Reproduction) -> Table:
    """One row a drive: by the paper's rules, by ours, and by ours with the weather report."""
    rows = []
    for print_, d, known in zip(done.printed, done.drives, done.informed, strict=True):
        low, high = d.weighing.interval(0.95) if d.weighing is not None else (0.0, 0.0)
        rows.append(
            (
                f"{d.drive.number}  {d.drive.kind}",
                f"{d.true_mass:.0f}",
                f"{100.0 * print_.worst:.2f}",
                f"{100.0 * print_.inside:.0f}",
                degrees(print_.pitch_largest),
                f"| {100.0 * d.worst:.2f}",
                f"{100.0 * d.inside:.0f}",
                f"{d.track.mass:.0f} ± {0.5 * (high - low):.0f}",
                f"{100.0 * d.error:+.2f}",
                degrees(d.pitch_largest),
                f"| {100.0 * known.worst:.2f}",
                f"{100.0 * known.error:+.2f}",
            )
        )
    return Table(
        "Drives of Table B.1: the paper's own rules | ours, wind unknown | ours with the weather "
        "report (worst and inside: running mass in the last two thirds)",
        ("drive", "true kg", "worst %", "inside ±5 %", "pitch max °", "| worst %", "inside ±5 %",
         "mass kg ± 95 %", "error %", "pitch max °", "| worst %", "error %"),
        tuple(rows),
    )  # fmt: skip


def comparisons(done: Reproduction) -> tuple[Comparison, ...]:
    """Our figures beside the paper's: first by its rules under like conditions, then ours."""
    by_print, ours = within(done.printed), within(done.drives)
    informed, total = within(done.informed), len(done.drives)
    covered = sum(d.covered for d in done.drives)
    final = max(abs(d.error) for d in done.drives)
    without, with_fixes = done.outage_grade_rms
    ratio = _largest(done.ratio_errors)
    near = (total - 2, f"generally within ±{100.0 * BAND:.0f} %")
    return (
        Comparison("drives within ±5 % at every instant of the last two thirds, paper's rules",
                   near[1], f"{by_print} of {total}", by_print >= near[0]),
        Comparison("the same, ours", near[1], f"{ours} of {total}", ours >= near[0]),
        Comparison("the same, ours with the weather report", "",
                   f"{informed} of {total}", True, like_for_like=False),
        Comparison("largest gear ratio error, paper's rules", "2 %",
                   percent(_largest(done.printed_ratio_errors)),
                   _largest(done.printed_ratio_errors) <= 0.02),
        Comparison("the same, ours", "2 %", percent(ratio), ratio <= 0.02),
        Comparison("torque fit R², unweighted, paper's rules", f"{PAPER_R_SQUARED}",
                   f"{done.printed_car.r_squared:.3f}",
                   done.printed_car.r_squared >= PAPER_R_SQUARED - 5e-4),
        Comparison("the same, ours", f"{PAPER_R_SQUARED}",
                   f"{unweighted(done.calibration):.3f}",
                   unweighted(done.calibration) >= PAPER_R_SQUARED - 5e-4),
        Comparison("largest error of the pitch, paper's rules", "below 1°",
                   pitch(done.printed), _most(done.printed) < scalar_to_si(1.0, "deg")),
        Comparison("the same, ours", "below 1°", pitch(done.drives),
                   _most(done.drives) < scalar_to_si(1.0, "deg")),
        Comparison("largest error of the road's slope, ours", "", slope(done.drives), True),
        Comparison("largest error of a drive's final mass, ours", "", percent(final), True),
        Comparison("95 % intervals that hold the truth, ours", "",
                   f"{covered} of {total}", covered >= total - 3),
        Comparison("grade RMS in 120 s without fixes | with them, ours", "",
                   f"{degrees(without)}° | {degrees(with_fixes)}°",
                   without - with_fixes <= scalar_to_si(0.3, "deg")),
    )  # fmt: skip


def figures(done: Reproduction) -> dict[str, str]:
    """Every figure that `weighbridge.papers.jensen2022_items.ITEMS` may name."""
    last = max(done.printed, key=lambda d: d.worst)
    found = {
        "seeds": f"{done.seed}-{done.last_seed}",
        "ratio_printed": percent(_largest(done.printed_ratio_errors)),
        "ratio_ours": percent(_largest(done.ratio_errors)),
        "gears_printed": _gears(done.printed_car.vehicle),
        "gears_ours": _gears(done.car),
        "speed_peaks": _peaks(done),
        "hills_printed": _hills(done.printed),
        "hills_ours": _hills(done.drives),
        "r2_printed": f"{done.printed_car.r_squared:.3f}",
        "r2_ours": f"{unweighted(done.calibration):.3f}",
        "r2_weighted": f"{done.calibration.rows.r_squared:.3f}",
        "road_printed": _road(done.printed_car.vehicle),
        "road_ours": _road(done.car),
        "road_true": _road_values(_truth()),
        "weights_printed": weights(done.printed_car.vehicle),
        "weights_ours": weights(done.car),
        "pitch_printed": pitch(done.printed),
        "pitch_ours": pitch(done.drives),
        "slope_printed": slope(done.printed),
        "slope_ours": slope(done.drives),
        "air_printed": f"{done.sample.torques.air_over_source:.3f}",
        "within_printed": f"{within(done.printed)} of {len(done.printed)}",
        "within_ours": f"{within(done.drives)} of {len(done.drives)}",
        "within_informed": f"{within(done.informed)} of {len(done.informed)}",
        "inside_printed": _inside(done.printed),
        "inside_ours": _inside(done.drives),
        "worst_printed": f"{percent(last.worst)} (drive {last.drive.number})",
        "final_ours": f"RMS {percent(rms(np.array([d.error for d in done.drives])))}",
        "load_max": _highest(done, "engine_load"),
        "throttle_max": _highest(done, "throttle"),
        "grade_mean": f"{degrees(float(np.mean(done.printed[0].balance.motion.grade)))}°",
        "load_air": f"{np.corrcoef(done.sample.torques.load, done.sample.torques.air)[0, 1]:.3f}",
    }
    if done.loads:
        found["r2_loads_printed"] = f"{joined(done.printed_loads).r_squared:.3f}"
        found["r2_loads_ours"] = f"{joined(done.loads).r_squared:.3f}"
    for name, numbers in (
        ("ref", (1, 2, 3)),
        ("load", (4, 5, 6, 7, 8)),
        ("tyre", (9, 10, 11, 12, 13)),
        ("window", (14, 15, 16, 17, 18)),
    ):
        for way, drives in (("printed", done.printed), ("ours", done.drives)):
            found[f"{name}_{way}"] = _day([d for d in drives if d.drive.number in numbers])
    for way, drives in (("printed", done.printed), ("ours", done.drives)):
        found[f"loads_{way}"] = _loads(drives)
        for name, numbers in (("load", (4, 5, 6, 7, 8)), ("window", (14, 15, 16, 17, 18))):
            found[f"passes_{name}_{way}"] = passes([d for d in drives if d.drive.number in numbers])
    for way, drives, car, rls in ways(done):
        found |= {f"{k}_{way}": v for k, v in _memory(done, drives, car, rls).items()}
        found |= {f"{k}_{way}": v for k, v in _perturbed(done, drives, car, rls).items()}
        found |= {f"{k}_{way}": v for k, v in _highway(done, way, car, rls).items()}
    found |= gradient_figures(done.gradient)
    for wind in ("high", "low"):
        errors = [h.joint / h.true_mass - 1.0 for h in done.highways if h.trip.wind == wind]
        found[f"{wind}_joint"] = ", ".join(f"{100.0 * e:+.1f}" for e in errors) + " %"
    return found


def ways(
    done: Reproduction,
) -> tuple[tuple[str, tuple[DriveResult, ...], Vehicle, RlsSettings], ...]:
    """The two ways of weighing: name, drives, vehicle and settings of the filter."""
    return (
        ("printed", done.printed, done.printed_car.vehicle, done.settings.printed.rls),
        ("ours", done.drives, done.car, done.settings.rls),
    )


def in_turn(
    done: Reproduction, drives: Sequence[DriveResult], car: Vehicle, rls: RlsSettings
) -> dict[float, tuple[Floats, ...]]:
    """Running mass of drives 4-8 one after another, by forgetting factor (fig. 13)."""
    loaded = [d for d in drives if 4 <= d.drive.number <= 8]
    return {
        f: run_in_turn([d.balance for d in loaded], car, replace(rls, forgetting=f))
        for f in done.settings.forgettings
        if loaded
    }


def perturbations(
    done: Reproduction, drives: Sequence[DriveResult], car: Vehicle, rls: RlsSettings
) -> dict[str, dict[float, Floats]]:
    """Running mass of the loaded drive with a perturbed model, by kind and size (figs. 17-19)."""
    chosen = next((d for d in drives if d.drive.number == PERTURBED_DRIVE), drives[0])
    wind_from, balance = chosen.drive.wind_from, chosen.balance
    s = done.settings
    return {
        "wind": {v: perturbed(balance, car, rls, wind_speed=v, wind_from=wind_from)
                 for v in s.winds},
        "drag": {f: perturbed(balance, car, rls, drag=f) for f in s.drags},
        "rolling": {f: perturbed(balance, car, rls, rolling=f) for f in s.rollings},
    }  # fmt: skip


def highways(done: Reproduction, way: str, wind: str) -> tuple[HighwayResult, ...]:
    """Trips of one wind by one way of weighing (fig. 16)."""
    every = done.printed_highways if way == "printed" else done.highways
    return tuple(h for h in every if h.trip.wind == wind)


def unweighted(calibration: Calibration) -> float:
    """R² of a torque fit with each row counted once, as the paper's [-]."""
    rows = calibration.rows
    total = np.sum((rows.motion_torque - np.mean(rows.motion_torque)) ** 2)
    return float(1.0 - np.sum((rows.motion_torque - rows.source_torque) ** 2) / total)


def _memory(
    done: Reproduction, drives: Sequence[DriveResult], car: Vehicle, rls: RlsSettings
) -> dict[str, str]:
    """How restless and how late the running mass is with each forgetting factor."""
    found = {}
    loaded = [d for d in drives if 4 <= d.drive.number <= 8]
    for k, (_, masses) in enumerate(in_turn(done, drives, car, rls).items()):
        ends = [m[-1] / d.true_mass - 1.0 for m, d in zip(masses, loaded, strict=True)]
        restless = [np.std(m[m.size // 2 :]) for m in masses]
        found[f"memory{k}"] = (
            f"± {np.mean(restless):.0f} kg; end of drive "
            f"{100.0 * min(ends):+.1f} to {100.0 * max(ends):+.1f} %"
        )
    return found


def _perturbed(
    done: Reproduction, drives: Sequence[DriveResult], car: Vehicle, rls: RlsSettings
) -> dict[str, str]:
    """How far each perturbation moves the running mass after the first third, at most."""
    found = {}
    for kind, cases in perturbations(done, drives, car, rls).items():
        neutral, unit = (cases[0.0], " m/s") if kind == "wind" else (cases[1.0], " times")
        part = slice(neutral.size // 3, None)
        moved = [
            f"{value:g}{unit}: {100.0 * _furthest(mass[part] / neutral[part] - 1.0):+.1f} %"
            for value, mass in cases.items()
            if mass is not neutral
        ]
        found[kind] = ", ".join(moved)
        if kind == "wind":
            found["calm"] = ", ".join(
                f"{value:g}{unit}: ± {np.std(mass[part]):.0f} kg" for value, mass in cases.items()
            )
    return found


def _highway(done: Reproduction, way: str, car: Vehicle, rls: RlsSettings) -> dict[str, str]:
    """Running mass on the highway in high and low wind: range, and mean error by direction."""
    found = {}
    for wind in ("high", "low"):
        trips = highways(done, way, wind)
        if not trips:
            continue
        masses = run_in_turn([h.balance for h in trips], car, rls)
        errors = np.concatenate([m / h.true_mass for m, h in zip(masses, trips, strict=True)])
        north = np.concatenate([h.balance.table.direction[0] for h in trips])
        table = trips[0].balance.table
        late = slice(int(np.searchsorted(table.time - table.time[0], SETTLED)), None)
        errors, north = 100.0 * (errors[late] - 1.0), north[late]
        found[wind] = (
            f"{errors.min():+.1f} to {errors.max():+.1f} %; mean northward "
            f"{errors[north > 0.5].mean():+.1f}, southward {errors[north < -0.5].mean():+.1f} %"
        )
    return found


def _day(drives: Sequence[DriveResult]) -> str:
    """How the drives of one day went."""
    if not drives:
        return "not driven"
    means = ", ".join(f"{100.0 * d.typical:+.1f}" for d in drives)
    return (
        f"{within(drives)} of {len(drives)} within; worst {percent(max(d.worst for d in drives))}; "
        f"means {means} %"
    )


def passes(drives: Sequence[DriveResult]) -> str:
    """Mean error of the running mass on the motorway, southward and northward."""
    south, north = [np.empty(0)], [np.empty(0)]
    for d in drives:
        table = d.balance.table
        off = 100.0 * (d.track.running_mass / d.true_mass - 1.0)
        fast = (table.speed > HIGHWAY_SPEED) & np.isfinite(off)
        along, _ = table.direction
        south.append(off[fast & (along < -0.5)])
        north.append(off[fast & (along > 0.5)])
    there, back = np.concatenate(south), np.concatenate(north)
    if not (there.size and back.size):
        return "not driven"
    return f"southward {there.mean():+.1f}, northward {back.mean():+.1f} %"


def _loads(drives: Sequence[DriveResult]) -> str:
    """Mass found above the unloaded drive of the day, for both loads of fig. 12."""
    found = {d.drive.number: (1.0 + d.typical) * d.true_mass for d in drives}
    said = []
    for numbers, load in (((5, 6), 125), ((7, 8), 240)):
        if 4 in found and all(n in found for n in numbers):
            more = np.mean([found[n] for n in numbers]) - found[4]
            said.append(f"{more:+.0f} kg for {load}")
    return ", ".join(said) or "not driven"


def _peaks(done: Reproduction) -> str:
    """Speeds at which the density of the vehicle speed of drive 1 has a peak (fig. 4)."""
    speed = from_si(done.sample.drive.signals["vehicle_speed"].values, "kmh")
    along = np.arange(-20.0, 160.0)
    density = gaussian_kde(speed, bw_method=0.1)(along)
    peaks, _ = find_peaks(density, prominence=0.02 * float(density.max()))
    return ", ".join(f"{abs(along[k]):.0f}" for k in peaks) + " km/h"


def _hills(drives: Sequence[DriveResult]) -> str:
    """Steepest pitch down and up of drives 1-3, but for a thousandth of the time each (fig. 10)."""
    pitch = np.concatenate([d.balance.motion.pitch for d in drives[:3]])
    low, high = from_si(np.quantile(pitch, [0.001, 0.999]), "deg")
    return f"{low:+.1f} to {high:+.1f}°"


def _gears(car: Vehicle) -> str:
    """Gearings in turns per minute over metres per second, as in table 4."""
    gears = ", ".join(f"{scalar_from_si(g, 'rpm'):.1f}" for g in car.driveline.gearings)
    return f"{gears} rpm s/m"


def _inside(drives: Sequence[DriveResult]) -> str:
    return f"{100.0 * float(np.mean([d.inside for d in drives])):.1f} %"


def _most(drives: Sequence[DriveResult]) -> float:
    return max(d.pitch_largest for d in drives)


def pitch(drives: Sequence[DriveResult]) -> str:
    """Largest error of the pitch, and the share of time within a degree."""
    share = float(np.mean([d.pitch_within for d in drives]))
    return f"{degrees(_most(drives))}°; {100.0 * share:.2f} % within 1°"


def slope(drives: Sequence[DriveResult]) -> str:
    """The same of the slope of the road."""
    share = float(np.mean([d.grade_within for d in drives]))
    largest = max(d.grade_largest for d in drives)
    return f"{degrees(largest)}°; {100.0 * share:.2f} % within 1°"


def _highest(done: Reproduction, name: str) -> str:
    signal = done.sample.drive.get(name)
    return "not recorded" if signal is None else f"{100.0 * float(np.max(signal.values)):.0f} %"


def _road(car: Vehicle) -> str:
    """C_d A, C_r, I_e and I_w of a vehicle."""
    return _road_values(_fitted(car))


def _road_values(values: tuple[float, float, float, float]) -> str:
    forms = (".2f", ".4f", ".2f", ".1f")
    return with_units([f"{x:{form}}" for x, form in zip(values, forms, strict=True)], ROAD_UNITS)


def _fitted(car: Vehicle) -> tuple[float, float, float, float]:
    road, line = car.road, car.driveline
    return (
        road.drag_area.value,
        road.rolling_coefficient.value,
        line.engine_inertia or 0.0,
        line.wheel_inertia or 0.0,
    )


def _truth() -> tuple[float, float, float, float]:
    """C_d A, C_r, I_e and I_w of the simulated car."""
    car = MIDSIZE
    return car.drag_area, car.rolling_coefficient, car.engine_inertia, car.wheel_inertia


def parameters_table(done: Reproduction) -> Table:
    """Table 6: the paper's car, both fits to the simulated one, and what that one truly has."""
    found = [
        [f"{w:.3g}" for w in _in_papers_units(car)] for car in (done.printed_car.vehicle, done.car)
    ]
    fits = (_fitted(done.printed_car.vehicle), _fitted(done.car), _truth())
    rows = [
        (f"{name} {unit}".strip(), theirs, *(f"{fit[k]:{form}}" for fit in fits))
        for k, (name, unit, theirs, form) in enumerate(
            zip(ROAD, ROAD_UNITS, PAPER_ROAD, (".3f", ".4f", ".3f", ".1f"), strict=True)
        )
    ]
    rows += [
        (f"w{k} {unit}", theirs, found[0][k], found[1][k], "")
        for k, (unit, theirs) in enumerate(zip(WEIGHT_UNITS, PAPER_WEIGHTS, strict=False))
        if all(k < len(each) for each in found)
    ]
    rows.append(
        ("R², each row counted once", f"{PAPER_R_SQUARED}", f"{done.printed_car.r_squared:.3f}",
         f"{unweighted(done.calibration):.3f}", "")
    )  # fmt: skip
    return Table(
        "Table 6: the paper's is another car; the simulated one has no torque of this form",
        ("parameter", "paper's car", "paper's rules", "ours", "truly, simulated car"),
        tuple(rows),
    )


def _in_papers_units(car: Vehicle) -> list[float]:
    rpm = scalar_to_si(1.0, "rpm")
    scales = (1.0, 0.01, *(rpm**k for k in range(1, 5)))
    return [w * s for w, s in zip(car.torque.coefficients, scales, strict=False)]


def weights(car: Vehicle) -> str:
    """w0 to w3 of eq. 49 in the paper's units: load in percent, engine speed in rpm."""
    return with_units([f"{w:.3g}" for w in _in_papers_units(car)], WEIGHT_UNITS)


def with_units(values: Sequence[str], units: Sequence[str]) -> str:
    """Write values with their units, one after another."""
    return ", ".join(f"{value} {unit}".strip() for value, unit in zip(values, units, strict=False))


def _furthest(values: Floats) -> float:
    return float(values[np.argmax(np.abs(values))])


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values)))


def percent(part: float) -> str:
    """A part as "1.23 %"."""
    return f"{100.0 * part:.2f} %"


def degrees(angle: float) -> str:
    """An angle [rad] in degrees."""
    return f"{scalar_from_si(angle, 'deg'):.3f}"
