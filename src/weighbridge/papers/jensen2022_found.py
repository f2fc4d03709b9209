"""Figures of the reproduction of Jensen et al. 2022, each judged against the printed one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.signal import find_peaks
from scipy.stats import gaussian_kde

from weighbridge.calibration import TABLE_5
from weighbridge.estimators import RlsSettings, run_in_turn
from weighbridge.navigation import PrintedFilterSettings
from weighbridge.papers.claims import Found, same
from weighbridge.papers.jensen2022_drives import TABLE_B1
from weighbridge.papers.jensen2022_equations import equations
from weighbridge.papers.jensen2022_judged import BAND, ONE_DEGREE, DriveResult, joined, within
from weighbridge.papers.jensen2022_reproduction import (
    TYRE_RADIUS,
    PrintedSettings,
    Reproduction,
    gradient_figures,
)
from weighbridge.papers.jensen2022_tables import (
    PAPER_R_SQUARED,
    ROAD_UNITS,
    degrees,
    fitted,
    highways,
    in_turn,
    passes,
    percent,
    perturbations,
    pitch,
    slope,
    truth,
    unweighted,
    ways,
    with_units,
)
from weighbridge.signals import Floats, from_si, scalar_from_si, scalar_to_si
from weighbridge.simulation import MIDSIZE
from weighbridge.vehicle import Vehicle

PEAKS: Final = (0.0, 50.0, 80.0, 110.0)
"""Of the speed in fig. 4 [km/h]."""

STEPS: Final = (0.05, 0.002, 0.02)
"""Of the grid of Table 5, by C_d A, C_r and I_e."""

DAYS: Final = {
    "ref": (1, 2, 3),
    "load": (4, 5, 6, 7, 8),
    "tyre": (9, 10, 11, 12, 13),
    "window": (14, 15, 16, 17, 18),
}
"""Drives of figs. 11, 12, 14 and 15."""

SETTLED: Final = 600.0
"""The running mass of fig. 16 is judged after so long [s]."""


def found(done: Reproduction) -> dict[str, Found]:
    """Every figure that `weighbridge.papers.jensen2022.ITEMS` asks for."""
    each = equations() | _given() | _car(done) | _sample(done) | gradient_figures(done.gradient)
    both = (("printed", done.printed), ("ours", done.drives))
    for way, drives in both:
        each |= {f"{name} {way}": f for name, f in _drives(drives).items()}
    for way, drives, car, rls in ways(done):
        each |= {f"{k} {way}": v for k, v in _memory(done, drives, car, rls).items()}
        each |= {f"{k} {way}": v for k, v in _perturbed(done, drives, car, rls).items()}
        each |= {f"{k} {way}": v for k, v in _highway(done, way, car, rls).items()}
    return each


def _given() -> dict[str, Found]:
    """What the paper gives: Tables 1, 2, 3, 5 and B.1."""
    ratios = (3.188, 2.190, 1.517, 1.057, 0.738, 0.557, 0.433)
    gearings = np.array(ratios) * 4.234 / MIDSIZE.wheel_radius
    s, axes = PrintedFilterSettings(), PrintedSettings().axes
    grid = [(0.30, 1.00, 15), (0.002, 0.030, 15), (0.02, 1.00, 50), (2.0, 12.0, 11)]
    assert len(TABLE_5) == len(axes)
    payloads = [0.0] * 4 + [125.0] * 2 + [240.0] * 2 + [0.0] * 10
    bars = [0.0] * 8 + [0.5] * 2 + [-0.5] * 2 + [0.0] * 6
    windows = [0.0] * 14 + [1.0] * 2 + [2.0] * 2
    celsius = [3.0, 4.0, 3.0, 4.0, 4.0, 4.0, 4.0, 4.0, 5.0, 6.0, 6.0, 6.0, 6.0] + [3.0] * 5
    return {
        "table 1": _near(
            np.array([1580.0, *gearings, 0.319]),
            np.array([MIDSIZE.mass, *MIDSIZE.gearings, TYRE_RADIUS]), 0.02,
        ),
        "table 2": same(
            np.array([2.0, 0.5, 5e-3, 1e-2, 0.005, 0.0008]),
            np.array([s.position_std, s.velocity_std, s.tilt_std, s.yaw_std, s.accel_bias_start,
                      s.gyro_bias_start]),
        ),
        "table 3": same(
            np.array([0.03, 1e-5, 1e-3, 1e-6, 2.0, 5.0, 0.5, 5.0, 15.0]),
            np.array([s.accel_std, s.gyro_std, s.accel_bias_std, s.gyro_bias_std,
                      s.horizontal_std, s.vertical_fix_std, s.speed_std, s.lateral_std,
                      s.vertical_std]),
        ),
        "table 5": same(
            np.concatenate([np.linspace(*g) for g in grid]), np.concatenate(axes)
        ),
        "table B1": same(
            np.array([*payloads, *bars, *windows, *celsius]),
            np.array([*(d.payload for d in TABLE_B1), *(d.bar for d in TABLE_B1),
                      *(float(d.windows) for d in TABLE_B1),
                      *(round(d.temperature - 273.15, 6) for d in TABLE_B1)]),
        ),
    }  # fmt: skip


def _near(printed: Floats, ours: Floats, part: float) -> Found:
    """Compare values that need not be the same to the last digit."""
    off = float(np.max(np.abs(ours / printed - 1.0)))
    return Found(f"{percent(off)} apart at most", off <= part, f"{printed.size} values")


def _car(done: Reproduction) -> dict[str, Found]:
    """Tables 4 and 6 and the torque fits, both ways."""
    each = {}
    for way, errors, car in (
        ("printed", done.printed_ratio_errors, done.printed_car.vehicle),
        ("ours", done.ratio_errors, done.car),
    ):
        off = float(np.max(np.abs(errors)))
        gears = ", ".join(f"{scalar_from_si(g, 'rpm'):.1f}" for g in car.driveline.gearings)
        each[f"gears {way}"] = Found(f"{gears} rpm s/m; {percent(off)} at most", off <= 0.02)
    each |= of_fit("printed", done.printed_car.vehicle, done.printed_car.r_squared)
    each |= of_fit("control", done.control.vehicle, done.control.r_squared)
    each |= of_fit("ours", done.car, unweighted(done.calibration))
    if done.loads:
        for way, torques in (("printed", done.printed_loads), ("ours", done.loads)):
            r_squared = joined(torques).r_squared
            each[f"r2 loads {way}"] = Found(f"{r_squared:.3f}", r_squared >= 0.95)
    return each


def of_fit(way: str, car: Vehicle, r_squared: float) -> dict[str, Found]:
    """Table 6 and the torque fit of one training."""
    values, true = fitted(car), truth()
    close = all(
        abs(v - t) <= step * 1.001 for v, t, step in zip(values[:3], true[:3], STEPS, strict=True)
    )
    return {
        f"road {way}": Found(f"{road(values)}; truly {road(true)}", close),
        f"wheels {way}": _wheels(car),
        f"r2 {way}": Found(f"{r_squared:.3f}", r_squared >= PAPER_R_SQUARED - 0.005),
    }


def road(values: tuple[float, float, float, float]) -> str:
    """Write C_d A, C_r, I_e and I_w with their units."""
    forms = (".2f", ".4f", ".2f", ".1f")
    return with_units([f"{x:{form}}" for x, form in zip(values, forms, strict=True)], ROAD_UNITS)


def _wheels(car: Vehicle) -> Found:
    """I_w alone: within two steps of the true one."""
    value, true = fitted(car)[3], truth()[3]
    return Found(f"{value:.1f} kg m²; truly {true:.1f}", abs(value - true) <= 2.0)


def _sample(done: Reproduction) -> dict[str, Found]:
    """Figs. 4 and 9: what drive 1 recorded."""
    drive, torques = done.sample.drive, done.sample.torques
    load, throttle = (100.0 * float(np.max(drive.signals[n].values))
                      for n in ("engine_load", "throttle"))  # fmt: skip
    grade = float(np.mean(done.printed[0].balance.motion.grade))
    linear = float(np.corrcoef(torques.load, torques.air)[0, 1])
    over = torques.air_over_source
    speed = from_si(drive.signals["vehicle_speed"].values, "kmh")
    along = np.arange(-20.0, 160.0)
    density = gaussian_kde(speed, bw_method=0.1)(along)
    peaks = np.abs(along[find_peaks(density, prominence=0.02 * float(density.max()))[0]])
    return {
        "load max": Found(f"{load:.0f} %", abs(load - 35.0) <= 10.0),
        "throttle max": Found(f"{throttle:.0f} %", abs(throttle - 90.0) <= 15.0),
        "speed peaks": Found(
            ", ".join(f"{p:.0f}" for p in peaks) + " km/h",
            all(np.min(np.abs(peaks - p)) <= 5.0 for p in PEAKS),
        ),
        "grade mean": Found(f"{degrees(grade)}°", abs(grade) <= scalar_to_si(0.25, "deg")),
        "load air": Found(f"correlation {linear:.3f}", linear >= 0.95),
        "air": Found(f"{over:.2f} times", 1.0 < over <= 1.1),
    }


def _drives(drives: Sequence[DriveResult]) -> dict[str, Found]:
    """Figs. 10 to 12, 14 and 15, and sec. 7.2, one way."""
    total, inside = len(drives), within(drives)
    part = float(np.mean([d.inside for d in drives]))
    worst = max(drives, key=lambda d: d.worst)
    lean = np.concatenate([d.balance.motion.pitch for d in drives[:3]])
    low, high = from_si(np.quantile(lean, [0.001, 0.999]), "deg")
    each = {
        "within": Found(
            f"{inside} of {total}; {100.0 * part:.1f} % of the time; worst "
            f"{percent(worst.worst)} (drive {worst.drive.number})",
            inside >= total - 2,
        ),
        "hills": Found(f"{low:+.1f} to {high:+.1f}°", abs(low + 3.0) <= 1.0 >= abs(high - 3.0)),
        "pitch": Found(pitch(drives), max(d.pitch_largest for d in drives) < ONE_DEGREE),
        "slope": Found(slope(drives), max(d.grade_largest for d in drives) < ONE_DEGREE),
    }
    for name, numbers in DAYS.items():
        day = [d for d in drives if d.drive.number in numbers]
        if len(day) < len(numbers):
            continue
        typical = np.array([d.typical for d in day])
        said = (
            f"{within(day)} of {len(day)} within; worst {percent(max(d.worst for d in day))}; "
            f"means {', '.join(f'{100.0 * e:+.1f}' for e in typical)} %"
        )
        apart = float(np.ptp(typical))
        each[name] = Found(said, within(day) >= len(day) - 1 if name == "ref" else apart <= BAND)
        if name == "load":
            masses = np.array([(1.0 + d.typical) * d.true_mass for d in day])
            light, heavy = masses[1:3].mean() - masses[0], masses[3:5].mean() - masses[0]
            less, more = (day[k].true_mass - day[0].true_mass for k in (1, 3))
            each["loads"] = Found(
                f"{light:+.0f} kg for {less:.0f}, {heavy:+.0f} kg for {more:.0f}",
                abs(light / less - 1.0) < 0.5 > abs(heavy / more - 1.0),
            )
        if name in ("load", "window"):
            there, back = passes(day)
            into = name == "window"
            each[f"passes {name}"] = Found(
                f"southward {there:+.1f}, northward {back:+.1f} %",
                there > back if into else there < back,
            )
    return each


def _memory(
    done: Reproduction, drives: Sequence[DriveResult], car: Vehicle, rls: RlsSettings
) -> dict[str, Found]:
    """Fig. 13: how restless and how late the running mass is with each forgetting factor."""
    loaded = [d for d in drives if 4 <= d.drive.number <= 8]
    courses = in_turn(done, drives, car, rls)
    if len(loaded) < 2:
        return {}
    restless, ends = [], []
    for masses in courses.values():
        restless.append(float(np.mean([np.std(m[m.size // 2 :]) for m in masses])))
        ends.append([m[-1] / d.true_mass - 1.0 for m, d in zip(masses, loaded, strict=True)])
    late = [float(np.max(np.abs(e))) for e in ends]
    texts = [
        f"± {r:.0f} kg; end of drive {100.0 * min(e):+.1f} to {100.0 * max(e):+.1f} %"
        for r, e in zip(restless, ends, strict=True)
    ]
    agrees = (
        restless[0] > 1.5 * restless[1],
        restless[0] > restless[1] > restless[2],
        restless[2] < restless[1] and late[2] > late[1],
    )
    return {f"memory{k}": Found(t, a) for k, (t, a) in enumerate(zip(texts, agrees, strict=True))}


def _perturbed(
    done: Reproduction, drives: Sequence[DriveResult], car: Vehicle, rls: RlsSettings
) -> dict[str, Found]:
    """Figs. 17 to 19: how far each perturbation moves the running mass, at most."""
    each, most = {}, {}
    for kind, cases in perturbations(done, drives, car, rls).items():
        neutral, unit = (cases[0.0], " m/s") if kind == "wind" else (cases[1.0], " times")
        part = slice(neutral.size // 3, None)
        moved = {
            value: 100.0 * furthest(mass[part] / neutral[part] - 1.0)
            for value, mass in cases.items()
            if mass is not neutral
        }
        said = ", ".join(f"{value:g}{unit}: {x:+.1f} %" for value, x in moved.items())
        each[kind], most[kind] = Found(said, True), max(map(abs, moved.values()))
        if kind == "wind":
            restless = {v: float(np.std(mass[part])) for v, mass in cases.items()}
            each["calm"] = Found(
                ", ".join(f"{v:g}{unit}: ± {x:.0f} kg" for v, x in restless.items()),
                list(restless.values())[1] < restless[0.0],
            )
    least = {"wind": 1.5 * most["drag"], "drag": 1.0, "rolling": 5.0}
    return each | {k: replace(each[k], agrees=most[k] >= x) for k, x in least.items()}


def _highway(done: Reproduction, way: str, car: Vehicle, rls: RlsSettings) -> dict[str, Found]:
    """Fig. 16: running mass on the highway in high and low wind, by direction."""
    each = {}
    for wind in ("high", "low"):
        trips = highways(done, way, wind)
        if not trips:
            continue
        masses = run_in_turn([h.balance for h in trips], car, rls)
        errors = np.concatenate([m / h.true_mass for m, h in zip(masses, trips, strict=True)])
        along = np.concatenate([h.balance.table.direction(0) for h in trips])
        table = trips[0].balance.table
        late = slice(int(np.searchsorted(table.time - table.time[0], SETTLED)), None)
        errors, along = 100.0 * (errors[late] - 1.0), along[late]
        north, south = errors[along > 0.5].mean(), errors[along < -0.5].mean()
        each[wind] = Found(
            f"{errors.min():+.1f} to {errors.max():+.1f} %; mean northward {north:+.1f}, "
            f"southward {south:+.1f} %",
            bool(north - south >= 5.0 if wind == "high" else abs(north - south) <= 2.0),
        )
    return each


def furthest(values: Floats) -> float:
    """Value that is furthest from zero."""
    return float(values[np.argmax(np.abs(values))])
