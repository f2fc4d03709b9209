"""Tables of studies/recorded.md: recorded drives weighed with data-sheet vehicles.

Run from the checkout: ``python studies/recorded.py``, or ``python studies/recorded.py bmw`` for the
section of the BMW alone; it needs the extra ``studies``. The
recordings lie in ``../shared/data`` and are not part of the project.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from unittest.mock import patch

import matplotlib.pyplot as plt
import numpy as np
import polars as pl
from openpyxl import load_workbook

import weighbridge as wb
from weighbridge.balance import force_balance, windows
from weighbridge.balance.delay import estimate_torque_delay
from weighbridge.balance.law import force_on_mass
from weighbridge.estimators.joint import batch, estimate
from weighbridge.estimators.joint.problem import UNMODELLED
from weighbridge.estimators.joint.terms import TERMS
from weighbridge.estimators.regression import regression
from weighbridge.estimators.squat import SQUAT, ResidualSquat
from weighbridge.io.frame_text import read_candump
from weighbridge.io.j1939 import decode_j1939
from weighbridge.kernels.rotation import euler_to_matrix
from weighbridge.navigation.select import find_motion
from weighbridge.signals import Signal, align
from weighbridge.vehicle.gear import detect_gearings
from weighbridge.vehicle.power_balance import find_power_balance
from weighbridge.vehicle.torque_sources import TORQUE_SOURCES

HERE = Path(__file__).parent
DATA = HERE.parents[1] / "shared" / "data"
EXAMPLE = HERE.parent / "examples" / "bmw-i3"

LOAD_NOTE = re.compile(r"\+ *[0-9]+ *kg")
"""What the overview of the BMW's trips says of a load."""


FILLED = {"TripB02": (38.0, 200.0), "TripB34": (292.5, np.inf)}
"""Where the file repeats values or runs straight between two [s]; left out."""

PERSON = 75.0
"""Of one person on board [kg]."""

WITHIN = timedelta(days=1)


def overview() -> dict[str, tuple[datetime, str]]:
    """Date and note of each trip, from the data set's own table."""
    table = load_workbook(DATA / "bmw-i3" / "Overview.xlsx", data_only=True).active
    found = {}
    for row in table.iter_rows(min_row=2, values_only=True):
        if row[0]:
            when = datetime.strptime(str(row[1]).replace("_", "-"), "%Y-%m-%d-%H-%M-%S")
            found[str(row[0])] = (when, str(row[15] or "").strip())
    return found


def without(drive: wb.Drive, start: float, end: float) -> wb.Drive:
    """Leave out what a drive says between two instants [s]."""
    kept = {}
    for name, signal in drive.signals.items():
        rows = (signal.time < start) | (signal.time > end)
        kept[name] = Signal(name, signal.time[rows], signal.values[rows])
    return replace(drive, signals=kept)


def shortest(masses: np.ndarray, part: float) -> tuple[float, float, float]:
    """Shortest interval that holds a part of the masses, and the median of those [kg]."""
    mass = np.sort(masses)
    many = int(np.ceil(part * mass.size))
    widths = mass[many - 1 :] - mass[: mass.size - many + 1]
    best = int(np.argmin(widths))
    held = mass[best : best + many]
    return float(held[0]), float(held[-1]), float(np.median(held))


def trips() -> dict[str, wb.Drive]:
    """The BMW's trips without what was filled in."""
    found = {}
    for path in sorted((DATA / "bmw-i3").glob("Trip*.csv")):
        drive = wb.read_drive(path, EXAMPLE / "mapping.toml")
        gap = FILLED.get(path.stem)
        found[path.stem] = drive if gap is None else without(drive, *gap)
    return found


LOADED = ("TripB33", "TripB34")
DECEMBER = ("TripB02", "TripB03", "TripB05", "TripB06")
JANUARY = ("TripB11", "TripB13")
NOTED = 160.0
"""What the overview notes of `LOADED` [kg]."""

FIRST = 550.0
"""As long as the longer trip of which a load is noted [s]."""


def bmw_i3() -> str:
    car = wb.Vehicle.load(EXAMPLE / "vehicle.toml")
    trips = overview()
    lines = [
        "| trip | date | noted | min | used min | mass kg | 95 % interval ± % | noise kg "
        "| torque reads, by battery | `rls` kg | offset m/s² |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    rows = []
    reach = []
    for name, drive in trips().items():
        when, note = trips[name]
        load = " ".join(found.group(0).split()) if (found := LOAD_NOTE.search(note)) else ""
        head = f"| {name} | {when:%Y-%m-%d %H:%M} | {load} | {drive.duration / 60:.1f} |"
        w = wb.weigh(drive, car, method="joint")
        if w.status != "converged":
            lines.append(f"{head} | {w.reason} | | | | | |")
            continue
        other = wb.weigh(drive, car, method="rls").mass
        own = UNMODELLED * w.result.bound_std
        power = find_power_balance(drive, car)
        found = next(p.values["offset"] for p in w.problems if p.id == "motion.offset")
        offset = f"{found:+.3f}"
        rows.append((name, when, load, w.mass, own, other))
        reach.append(196.0 * w.std / w.mass)
        lines.append(
            f"{head} {w.used_time / 60:.1f} | {w.mass:.0f} | {reach[-1]:.1f} | {own:.0f} "
            f"| {power.scale:.3f} ± {power.noise_std:.3f} | {other:.0f} | {offset} |"
        )
    mass = np.array([row[3] for row in rows])
    low, high, middle = shortest(mass, 1.0 / 3.0)
    other = shortest(np.array([row[5] for row in rows]), 1.0 / 3.0)
    draw_trips(rows, low, high, middle)
    lines += [
        "",
        f"{mass.size} of {len(trips)} trips of the table are there and weighed. The shortest "
        f"interval that holds a third of them runs from {low:.0f} to {high:.0f} kg, "
        f"{100 * (high - low) / middle:.1f} % of its median "
        f"(`rls`: {100 * (other[1] - other[0]) / other[2]:.1f} %). The 95 % interval is "
        f"± {np.median(reach):.1f} % (median; {min(reach):.1f} to {max(reach):.1f} %).",
    ]
    return "\n".join(lines)


def gain(masses: dict[str, float], bare: tuple[str, ...]) -> tuple[float, float]:
    """Return what the loaded trips weigh more than others, and its standard deviation [kg].

    Both kinds scatter alike; of two trips alone too little is known.
    """
    empty, full = (np.array([masses[n] for n in names]) for names in (bare, LOADED))
    off = np.concatenate([empty - empty.mean(), full - full.mean()])
    scatter = float(np.sqrt(np.sum(off**2) / (off.size - 2)))
    return float(full.mean() - empty.mean()), scatter * float(
        np.sqrt(1.0 / empty.size + 1.0 / full.size)
    )


def bmw_loads() -> str:
    """What the noted load comes out as, and what of the model moves it."""
    car = wb.Vehicle.load(EXAMPLE / "vehicle.toml")
    as_read = replace(
        car, torque=replace(car.torque, scale_std=TORQUE_SOURCES["measured"].motor_scale_std)
    )
    drives = trips()

    inertias = {
        name: replace(TERMS[name], applies=lambda _: True)
        for name in ("engine_inertia", "wheel_inertia")
    }

    def usual_lean(*_):  # type: ignore[no-untyped-def]
        return ResidualSquat(*SQUAT)

    lines = [
        "| | narrowest third % | December kg | heavier than December kg | slope "
        "| heavier than December and 3 January kg | slope |",
        "|---|---|---|---|---|---|---|",
    ]

    def row(name: str, masses: dict[str, float]) -> str:
        low, high, middle = shortest(np.array(list(masses.values())), 1.0 / 3.0)
        cells = []
        for bare in (DECEMBER, DECEMBER + JANUARY):
            more, std = gain(masses, bare)
            cells.append(f"{more:.0f} ± {std:.0f} | {more / NOTED:.2f} ± {std / NOTED:.2f}")
        empty = np.mean([masses[n] for n in DECEMBER])
        third = f"{100 * (high - low) / middle:.1f}" if len(masses) > 10 else ""
        return f"| {name} | {third} | {empty:.0f} | {' | '.join(cells)} |"

    def weighed(vehicle: wb.Vehicle) -> dict[str, float]:
        return {n: wb.weigh(d, vehicle).mass for n, d in drives.items()}

    with (
        patch.dict(TERMS._own, inertias),
        patch.object(batch, "inertia_relative_std", lambda *_: 0.0),
        patch.object(batch, "residual_squat", usual_lean),
    ):
        lines.append(row("inertias estimated, usual lean, torque as read", weighed(as_read)))
    with patch.object(batch, "residual_squat", usual_lean):
        lines.append(row("inertias considered", weighed(as_read)))
    lines.append(row("and lean found against the wheels", weighed(as_read)))
    now = weighed(car)
    lines.append(row("and torque by battery power: `weigh`", now))
    short = {n: now[n] for n in LOADED}
    for name in DECEMBER + JANUARY:
        # Nothing of the first minutes of one trip is left behind its gap.
        most = FIRST + (FILLED[name][1] - FILLED[name][0] if name in FILLED else 0.0)
        part = without(drives[name], drives[name].start + most, np.inf)
        short[name] = wb.weigh(part, car).mass
    lines.append(row("the others' first nine minutes", short))
    return "\n".join(lines)


def bmw_regressions() -> str:
    """Plain regressions of force on specific force, without any state."""
    car = wb.Vehicle.load(EXAMPLE / "vehicle.toml")
    kinds = ("force on specific force", "specific force on force", "instrument: rate of the speed",
             "the same, driving", "the same, recuperating")  # fmt: skip
    found: dict[str, dict[str, float]] = {kind: {} for kind in kinds}
    for name, drive in trips().items():
        balance = wb.weigh(drive, car).result.balance
        table, motion = balance.table, balance.motion
        rate = np.gradient(motion.speed, motion.time)
        rolled = np.interp(table.time, motion.time, rate)
        force = force_on_mass(table, car)
        known = table.usable & np.isfinite(force) & np.isfinite(table.specific_force)
        for kind in kinds:
            driven = np.sign(table.traction_force)
            side = {"driving": driven > 0.0, "recuperating": driven < 0.0}.get(
                kind.rpartition(" ")[2], True
            )
            cut = windows(table.time, known & side)
            time = cut.mean(table.time)
            y, f, a = (
                without_slow(time, cut.mean(x)) for x in (force, table.specific_force, rolled)
            )
            found[kind][name] = {
                kinds[0]: (f @ y) / (f @ f),
                kinds[1]: (y @ y) / (f @ y),
            }.get(kind, (a @ y) / (a @ f))
    lines = [
        "| regression | narrowest third % | December kg | heavier than December kg | slope |",
        "|---|---|---|---|---|",
    ]
    for kind, masses in found.items():
        low, high, middle = shortest(np.array(list(masses.values())), 1.0 / 3.0)
        more, std = gain(masses, DECEMBER)
        lines.append(
            f"| {kind} | {100 * (high - low) / middle:.1f} "
            f"| {np.mean([masses[n] for n in DECEMBER]):.0f} | {more:.0f} ± {std:.0f} "
            f"| {more / NOTED:.2f} ± {std / NOTED:.2f} |"
        )
    return "\n".join(lines)


def bmw_power() -> str:
    """What battery power says of the torque, what the heater's meters say of the battery's."""
    car = wb.Vehicle.load(EXAMPLE / "vehicle.toml")
    found = [find_power_balance(drive, car) for drive in trips().values()]
    scale = np.array([f.scale for f in found])
    noise = np.array([f.noise_std for f in found])
    sure = noise < 0.01
    both = [100.0 * np.median([getattr(f, n) for f in found]) for n in ("driving", "recuperating")]
    heaters = []
    for path in sorted((DATA / "bmw-i3").glob("TripB*.csv")):
        table = pl.read_csv(path, separator=";", encoding="latin-1", infer_schema_length=None)

        def column(name: str, table: pl.DataFrame = table) -> np.ndarray:
            return table[name].cast(pl.Float64, strict=False).to_numpy()

        heater = column("Heater Voltage [V]") * column("Heater Current [A]")
        battery = -column("Battery Voltage [V]") * column("Battery Current [A]")
        still = (column("Velocity [km/h]") < 0.4) & np.isfinite(heater + battery)
        if np.count_nonzero(still) > 300 and np.std(heater[still]) > 1000.0:
            cooling = 1e3 * np.nan_to_num(column("AirCon Power [kW]"))
            terms = np.column_stack([heater, cooling, np.ones_like(heater)])[still]
            heaters.append(np.linalg.lstsq(terms, battery[still], rcond=None)[0][0])
    return (
        f"Of what changes within a minute the motor gives {both[0]:.0f} % of the battery's power "
        f"driving, and {both[1]:.0f} % comes back recuperating (medians of {len(found)} trips). "
        f"So the torque reads {np.mean(scale[sure]):.3f} of what it is, with a standard deviation "
        f"of {np.std(scale[sure], ddof=1):.3f} between {np.count_nonzero(sure)} trips, each known "
        f"to ± {np.median(noise[sure]):.3f} but for what all share (± "
        f"{np.median([f.std for f in found]):.3f}). Standing, the battery gives "
        f"{min(heaters):.2f} to {max(heaters):.2f} W per watt of the heater, which has meters of "
        f"its own ({len(heaters)} trips)."
    )


def draw_trips(
    rows: list[tuple[str, datetime, str, float, float, float]],
    low: float,
    high: float,
    middle: float,
) -> None:
    """Draw each trip's mass with its interval, in the order of the dates."""
    figure, axis = plt.subplots(figsize=(10, 5), constrained_layout=True)
    rows = sorted(rows, key=lambda row: row[1])
    at = np.arange(len(rows))
    mass, own = (np.array([row[k] for row in rows]) for k in (3, 4))
    axis.axhspan(low, high, color="tab:green", alpha=0.2, label="a third of the trips")
    for persons in range(4):
        axis.axhline(middle + persons * PERSON, color="0.6", ls="--", lw=0.8)
        text = "median of the third" if not persons else f"+ {persons * PERSON:.0f} kg"
        axis.annotate(text, (len(rows) - 0.4, middle + persons * PERSON), fontsize=8, va="bottom")
    noted = np.array([bool(row[2]) for row in rows])
    for which, colour, label in (
        (~noted, "tab:blue", "nothing noted"),
        (noted, "tab:red", "160 kg noted"),
    ):
        axis.errorbar(
            at[which], mass[which], 1.96 * own[which], fmt="o", ms=4, color=colour, label=label
        )
    days = [row[1].date() for row in rows]
    for k in range(1, len(rows)):
        if days[k] - days[k - 1] >= WITHIN:
            axis.axvline(k - 0.5, color="0.85", lw=0.8, zorder=0)
    axis.set_xticks(at, [f"{row[0][4:]}  {row[1]:%Y-%m-%d}" for row in rows], rotation=90)
    axis.set_xlim(-0.6, len(rows) + 3.5)
    axis.set_ylabel("mass kg, 95 % interval of its noise")
    axis.legend(loc="upper left")
    (HERE / "figures").mkdir(exist_ok=True)
    figure.savefig(HERE / "figures" / "bmw-i3.png", dpi=110)
    plt.close(figure)


def j1939_truck() -> str:
    """What 30 s of a truck's bus say, and what they cannot."""
    path = DATA / "j1939-truck" / "normal.log"
    found = decode_j1939(read_candump(path, None, None).frames)
    signals, extras = {s.name: s for s in found.signals}, found.summary.extras
    shaft, output = extras["input_shaft_speed"], extras["output_shaft_speed"]
    gear = signals["gear"].held(shaft.time)
    free = signals["clutch_switch"].held(shaft.time) == 0.0
    lines = [
        "| gear | announced ratio (SPN 526) | input over output shaft | off by |",
        "|---|---|---|---|",
    ]
    for number, ratio in ((2, 1.81), (3, 1.406), (4, 1.0)):
        rows = (gear == number) & free
        seen = float(np.median(shaft.values[rows] / output.values[rows]))
        lines.append(f"| {number} | {ratio:.3f} | {seen:.4f} | {100 * (seen / ratio - 1):+.2f} % |")
    torque = signals["engine_torque_fraction"].values
    speed = 3.6 * signals["vehicle_speed"].values
    car = wb.Vehicle.load(HERE.parent / "examples" / "j1939-truck" / "vehicle.toml")
    w = wb.weigh(wb.read_drive(path), car)
    table = w.result.balance.table
    rows = table.usable
    force = force_on_mass(table, car)[rows]
    design = np.column_stack([table.accel[rows], np.ones(force.size)])
    fit = np.linalg.lstsq(design, force, rcond=None)[0]
    # Six stretches of the log, each left out in turn: their spread is what the grade may do.
    parts = np.array_split(np.arange(force.size), 6)
    out = np.array(
        [
            np.linalg.lstsq(np.delete(design, p, 0), np.delete(force, p), rcond=None)[0][0]
            for p in parts
        ]
    )
    std = float(np.sqrt(5 / 6 * np.sum((out - out.mean()) ** 2)))
    reach = 2.571 * std  # Student, 5 degrees of freedom
    lines += [
        "",
        f"Reference torque {signals['reference_torque'].values[0]:.0f} N m in all "
        f"{len(signals['reference_torque'])} broadcasts (SPN 544, transport protocol). Net torque "
        f"{100 * torque.min():.0f} to {100 * torque.max():.0f} % of it, friction "
        f"{100 * extras['friction_torque'].values.min():.0f} to "
        f"{100 * extras['friction_torque'].values.max():.0f} %. Speed {speed.min():.0f} to "
        f"{speed.max():.0f} km/h; {sum(found.summary.decoded.values())} frames of "
        f"{len(found.summary.decoded)} groups read, {len(found.summary.ignored)} groups not used.",
        "",
        f"`weigh` says `{w.status}`:",
        "",
        f"```text\n{w.reason}\n```",
        "",
        "Force against acceleration by least squares, with a free constant that takes rolling "
        f"resistance and an even grade: {fit[0]:.0f} kg, 95 % interval "
        f"{max(fit[0] - reach, 0):.0f} to {fit[0] + reach:.0f} kg from six stretches left out in "
        f"turn; the constant is a grade of {100 * (fit[1] / fit[0] / 9.81 + 0.008):+.1f} %.",
    ]
    return "\n".join(lines)


def clocks() -> str:
    """Offsets found between sources of one logger, whose true offset is that of their lateness."""
    lines = [
        "| recording | s | offset of GNSS s | std s | correlation | refused |",
        "|---|---|---|---|---|---|",
    ]
    folder, example = DATA / "canedge-obd-imu-gnss", HERE.parent / "examples" / "canedge"
    found = []
    for path in sorted(folder.glob("*/*.MF4")):
        drive = wb.read_drive(path, example / "mapping.toml", dbc=folder / "canmod-gps.dbc")
        found.append((f"canedge {path.parent.name}/{path.stem.split('-')[0]}", drive))
    comma = HERE.parent / "examples" / "comma2k19" / "mapping.toml"
    found.append(("comma2k19", wb.read_drive(DATA / "comma2k19", comma)))
    offsets = []
    for name, drive in found:
        wheel, ground = drive.signals["vehicle_speed"], drive.signals["gnss_speed"]
        moved = Signal(ground.name, ground.time - 1234.5, ground.values)
        a = align(wheel, moved)
        lines.append(
            f"| {name} | {drive.duration:.0f} | {a.offset - 1234.5:+.3f} | {a.std:.3f} "
            f"| {a.correlation:.4f} | {a.refusal or 'no'} |"
        )
        if name.startswith("canedge") and drive.duration > 300.0:
            offsets.append((a.offset - 1234.5, a.std))
    values, stds = np.array(offsets).T
    lines += [
        "",
        f"The {values.size} canedge files longer than 5 min agree on {values.mean():+.3f} s with a "
        f"standard deviation of {values.std(ddof=1):.3f} s; their own standard deviations are "
        f"{stds.min():.3f} to {stds.max():.3f} s.",
    ]
    return "\n".join(lines)


CANEDGE = HERE.parent / "examples" / "canedge"
SEAT = HERE.parent / "examples" / "seat-leon"
# rpm per km/h of one radian per metre
RPM_PER_KMH = np.pi / 30.0 * 3.6


def canedge_drives() -> list[tuple[str, wb.Drive]]:
    folder = DATA / "canedge-obd-imu-gnss"
    found = []
    for path in sorted(folder.glob("*/*.MF4")):
        drive = wb.read_drive(path, CANEDGE / "mapping.toml", folder / "canmod-gps.dbc")
        found.append((f"{path.parent.name}/{path.stem.split('-')[0]}", drive))
    return found


def gear_line(name: str, drives: list[wb.Drive], known: tuple[float, ...]) -> str:
    """Gear ratios found in drives together, each beside the one known."""
    time, engine, speed = [], [], []
    for k, drive in enumerate(drives):
        rpm, wheels = drive.signals["engine_speed"], drive.signals["vehicle_speed"]
        inside = np.isfinite(wheels.at(rpm.time))
        time.append(rpm.time[inside] - rpm.time[0] + 1e5 * k)
        engine.append(rpm.values[inside])
        speed.append(wheels.at(rpm.time)[inside])
    found = detect_gearings(*map(np.concatenate, (time, engine, speed)), speed_step=1 / 3.6)
    ratios = found.gearings / RPM_PER_KMH
    shown = []
    for ratio in known:
        nearest = ratios[np.argmin(np.abs(np.log(ratios / ratio)))]
        off = 100.0 * (nearest / ratio - 1.0)
        shown.append(f"{nearest:.2f} ({off:+.1f} %)" if abs(off) < 5.0 else "–")
    return f"| {name} | {' | '.join(shown)} | {ratios.size} |"


def idle_line(drives: list[tuple[str, wb.Drive]]) -> str:
    """What PID 62 reads at idling speed with a warm engine, standing and rolling."""
    standing, rolling = [], []
    for _, drive in drives:
        torque, speed = drive.signals["engine_torque_fraction"], drive.signals["vehicle_speed"]
        time = torque.time
        engine = drive.signals["engine_speed"].at(time) * 30.0 / np.pi
        idle = (engine < 1200.0) & (drive.signals["coolant_temperature"].at(time) > 343.0)
        # Neither pulling away nor stopping.
        near = np.array([np.abs(speed.at(time + side)) for side in (-2.0, 0.0, 2.0)])
        for found, where in ((standing, (near < 0.3).all(0)), (rolling, (near > 1.0).all(0))):
            values = 100.0 * torque.values[idle & where & (torque.values > 0.0)]
            if values.size >= 20:
                found.append(float(np.median(values)))
    listed = [", ".join(f"{v:.0f}" for v in sorted(values)) for values in (rolling, standing)]
    return (
        "PID 62 below 1200 rpm with a coolant above 70 °C: rolling, the medians of "
        f"{len(rolling)} files are {listed[0]} %; standing, of {len(standing)} files, "
        f"{listed[1]} %."
    )


def canedge() -> str:
    """Eight MF4 files with OBD-II, IMU and GNSS: gear ratios, mounting, mass per torque."""
    drives = canedge_drives()
    long = [(name, drive) for name, drive in drives if drive.duration > 300.0]
    known = (134.0, 67.0, 44.75, 33.75, 27.25, 22.25)
    head = f"| file | {' | '.join(f'{k:g}' for k in known)} | peaks |"
    lines = [head, "|" + "---|" * (len(known) + 2)]
    for name, drive in long:
        lines.append(gear_line(name, [drive], known))
    lines.append(gear_line("all together", [drive for _, drive in long], known))

    car = wb.Vehicle.load(CANEDGE / "vehicle.toml")
    assert car.torque.reference_torque is not None
    reference = car.torque.reference_torque
    gross = replace(car, torque=replace(car.torque, coefficients=()))
    small = 0.8 * reference
    other = replace(
        car,
        torque=replace(
            car.torque, reference_torque=small, coefficients=(0.8 * car.torque.coefficients[0], 1.0)
        ),
    )
    lines += [
        "",
        "| file | s | used s | kg per N m | ± sd within the file | joint | ± sd | gross torque | "
        f"{small:.0f} N m | forward axis in the sensor's x, y, z | sd of roll, pitch, yaw ° |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    table = []
    for name, drive in drives:
        w = wb.weigh(drive, car, method="rls")
        if w.status != "converged" or w.result is None:
            lines.append(f"| {name} | {drive.duration:.0f} | | {w.status} | | | | | | | |")
            continue
        motion = w.result.balance.motion
        forward = ", ".join(f"{x:+.2f}" for x in euler_to_matrix(*motion.mounting)[0])
        sd = ", ".join(f"{x:.1f}" for x in np.degrees(motion.mounting_std))
        joint = wb.weigh(drive, car, method="joint")
        row = [
            w.mass / reference,
            joint.mass / reference,
            wb.weigh(drive, gross, method="rls").mass / reference,
            wb.weigh(drive, other, method="rls").mass / small,
        ]
        table.append((drive.duration, *row))
        by_rls = [f"{x:.2f}" if np.isfinite(x) else "none" for x in row[2:]]
        lines.append(
            f"| {name} | {drive.duration:.0f} | {w.used_time:.0f} | {row[0]:.2f} "
            f"| {w.std / reference:.2f} | {row[1]:.2f} | {joint.std / reference:.2f} "
            f"| {by_rls[0]} | {by_rls[1]} | {forward} | {sd} |"
        )
    rows = np.array(table)
    full = rows[rows[:, 0] > 500.0]

    def agreement(values: np.ndarray) -> str:
        known = values[np.isfinite(values)]
        spread = 100.0 * np.std(known, ddof=1) / np.mean(known)
        less = "" if known.size == values.size else f" ({known.size} files)"
        return f"{np.mean(known):.2f} kg per N m, sd {spread:.1f} %{less}"

    lines += [
        "",
        "Agreement of the files, mean and standard deviation:",
        "",
        f"| | {len(full)} files of nine minutes and more | all {len(rows)} that give a mass |",
        "|---|---|---|",
        *(
            f"| {what} | {agreement(full[:, k])} | {agreement(rows[:, k])} |"
            for k, what in enumerate(
                (
                    "`--method rls`",
                    "`--method joint`",
                    "`rls`, gross torque",
                    f"`rls`, {small:.0f} N m",
                ),
                start=1,
            )
        ),
        "",
        f"With {reference:.0f} N m the long files say {reference * np.min(full[:, 1]):.0f} to "
        f"{reference * np.max(full[:, 1]):.0f} kg by `rls` and "
        f"{reference * np.min(full[:, 2]):.0f} to {reference * np.max(full[:, 2]):.0f} kg by "
        "`joint`.",
        "",
        idle_line(drives),
    ]
    return "\n".join(lines)


SLOW = 30.0
"""What is slower than this is taken off both sides [s]."""


def without_slow(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Take the mean over `SLOW` around each row away."""
    first = np.searchsorted(time, time - 0.5 * SLOW)
    last = np.searchsorted(time, time + 0.5 * SLOW, side="right")
    total = np.concatenate(([0.0], np.cumsum(values)))
    return np.asarray(values - (total[last] - total[first]) / (last - first))


def canedge_regressions(drives: list[tuple[str, wb.Drive]]) -> str:
    """Four regressions of force and specific force, and what accelerations and hills weigh."""
    car = wb.Vehicle.load(CANEDGE / "vehicle.toml")
    reference = car.torque.reference_torque
    assert reference is not None
    long = [(name, drive) for name, drive in drives if drive.duration > 500.0]
    motions = [find_motion(drive, car) for _, drive in long]
    delays = [
        estimate_torque_delay(drive, car, motion, force_balance(drive, car, motion, delay=0.0))
        for (_, drive), motion in zip(long, motions, strict=True)
    ]
    delay = float(np.nanmedian(delays))
    lines = [
        "| file | delay of its own s | force on specific force | specific force on force "
        "| instrument: pressure × gearing | instrument: acceleration | by acceleration | by hills "
        "| part by acceleration |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    found = []
    for (name, drive), motion, own in zip(long, motions, delays, strict=True):
        table = force_balance(drive, car, motion, delay=delay).table
        phi, y = regression(table, car)
        pressure = drive.signals["intake_pressure"].at(table.time) * table.gearing
        usable = table.usable & np.isfinite(phi) & np.isfinite(y) & np.isfinite(pressure)
        cut = windows(table.time, usable)
        time = cut.mean(table.time)
        f, force, p, a = (without_slow(time, cut.mean(x)) for x in (phi, y, pressure, table.accel))
        hill = f - a
        apart = np.linalg.lstsq(np.column_stack([a, hill]), force, rcond=None)[0]
        row = np.array(
            [
                (f @ force) / (f @ f),
                (force @ force) / (f @ force),
                (p @ force) / (p @ f),
                (a @ force) / (a @ f),
                *apart,
            ]
        )
        row /= reference
        found.append(row)
        part = (a @ a) / (a @ a + hill @ hill)
        shown = "–" if np.isnan(own) else f"{own:+.2f}"
        lines.append(
            f"| {name} | {shown} | {' | '.join(f'{x:.2f}' for x in row)} | {100 * part:.0f} % |"
        )
    rows = np.array(found)
    spread = 100.0 * rows.std(axis=0, ddof=1) / rows.mean(axis=0)
    means = " | ".join(f"{m:.2f}, {s:.1f} %" for m, s in zip(rows.mean(0), spread, strict=True))
    weighed = np.array(
        [
            estimate(force_balance(drive, car, motion, delay=delay), car).mass / reference
            for (_, drive), motion in zip(long, motions, strict=True)
        ]
    )
    lines += [
        f"| mean, sd | {delay:+.2f} (median) | {means} | |",
        "",
        f"`joint` with the median delay for all of them: {', '.join(f'{x:.2f}' for x in weighed)}, "
        f"mean {weighed.mean():.2f} kg per N m, sd "
        f"{100 * weighed.std(ddof=1) / weighed.mean():.1f} %.",
    ]
    return "\n".join(lines)


def seat_leon() -> str:
    """Gear ratios from one parameter at a time; a mass is refused."""
    paths = sorted((DATA / "seat-leon-obd").glob("*.csv"))
    drives = [wb.read_drive(path, SEAT / "mapping.toml") for path in paths]
    known = (58.25, 37.25, 25.75, 20.25, 16.75)
    lines = [
        f"| recording | {' | '.join(f'{k:g}' for k in known)} | peaks |",
        "|" + "---|" * (len(known) + 2),
        *(gear_line(p.stem, [d], known) for p, d in zip(paths, drives, strict=True)),
        gear_line("all together", drives, known),
    ]
    w = wb.weigh(drives[0], wb.Vehicle.load(SEAT / "vehicle.toml"), method="rls")
    lines += ["", f"`weigh` says `{w.status}`:", "", f"```text\n{w.reason}\n```"]
    return "\n".join(lines)


PARTS: Mapping[str, Callable[[], str]] = {
    "bmw-i3": bmw_i3,
    "bmw-loads": bmw_loads,
    "bmw-regressions": bmw_regressions,
    "bmw-power": bmw_power,
    "j1939-truck": j1939_truck,
    "clocks": clocks,
    "canedge": canedge,
    "canedge-regressions": lambda: canedge_regressions(canedge_drives()),
    "seat-leon": seat_leon,
}
"""What stands in the template as ``<!-- name -->``."""

HEADING = re.compile(r"^(?=## )", re.MULTILINE)


def main(wanted: str = "") -> None:
    """Write the page; sections without a part whose name begins so stay as they are."""
    page = HERE / "recorded.md"
    written = {
        part.partition("\n")[0]: part
        for part in (HEADING.split(page.read_text(encoding="utf-8")) if wanted else ())
    }
    parts = HEADING.split((HERE / "recorded.template.md").read_text(encoding="utf-8"))
    for k, part in enumerate(parts):
        names = [name for name in PARTS if f"<!-- {name} -->" in part]
        if wanted and names and not any(name.startswith(wanted) for name in names):
            parts[k] = written[part.partition("\n")[0]]
            continue
        for name in names:
            parts[k] = parts[k].replace(f"<!-- {name} -->", PARTS[name]())
    page.write_text("".join(parts), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:2])
