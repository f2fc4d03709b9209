"""Tables of studies/recorded.md: recorded drives weighed with data-sheet vehicles.

Run from the checkout: ``python studies/recorded.py``; it needs the extra ``studies``. The
recordings lie in ``../shared/data`` and are not part of the project.
"""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import polars as pl
from openpyxl import load_workbook

import weighbridge as wb
from weighbridge.balance import force_balance
from weighbridge.balance.averaging import windows
from weighbridge.balance.delay import estimate_torque_delay
from weighbridge.estimators import joint
from weighbridge.estimators.regression import regression
from weighbridge.io.candump import read_candump
from weighbridge.io.j1939 import decode_j1939
from weighbridge.kernels.rotation import euler_to_matrix
from weighbridge.navigation.select import find_motion
from weighbridge.signals import Signal
from weighbridge.signals.alignment import align
from weighbridge.vehicle.gear import detect_gearings

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


def bmw_i3() -> str:
    car = wb.Vehicle.load(EXAMPLE / "vehicle.toml")
    told = overview()
    lines = [
        "| trip | date | noted | min | used min | mass kg | ± sd within the trip kg "
        "| `rls` kg | offset m/s² |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    rows = []
    scale = car.provenance.mass_scale_std or 0.0
    for path in sorted((DATA / "bmw-i3").glob("Trip*.csv")):
        drive = wb.read_drive(path, EXAMPLE / "mapping.toml")
        if path.stem in FILLED:
            drive = without(drive, *FILLED[path.stem])
        when, note = told[path.stem]
        load = " ".join(found.group(0).split()) if (found := LOAD_NOTE.search(note)) else ""
        head = f"| {path.stem} | {when:%Y-%m-%d %H:%M} | {load} | {drive.duration / 60:.1f} |"
        w = wb.weigh(drive, car, method="joint")
        if w.status != "converged":
            lines.append(f"{head} | {w.reason} | | | |")
            continue
        other = wb.weigh(drive, car, method="rls").mass
        own = float(np.sqrt(max(w.std**2 - (scale * w.mass) ** 2, 0.0)))
        offset = next(n.split()[2] for n in w.warnings if n.startswith("accelerometer offset"))
        rows.append((path.stem, when, load, w.mass, own, other))
        lines.append(
            f"{head} {w.used_time / 60:.1f} | {w.mass:.0f} | {own:.0f} | {other:.0f} | {offset} |"
        )
    mass = np.array([row[3] for row in rows])
    low, high, middle = shortest(mass, 1.0 / 3.0)
    bare = [row[3] for row in rows if row[1].year == 2019 and row[1].month == 12]
    loaded = [row[3] for row in rows if row[2]]
    gain = float(np.mean(loaded) - np.mean(bare))
    gain_std = float(np.hypot(np.std(bare, ddof=1), np.std(loaded, ddof=1)) / np.sqrt(2.0))
    other = shortest(np.array([row[5] for row in rows]), 1.0 / 3.0)
    draw_trips(rows, low, high, middle)
    lines += [
        "",
        f"{mass.size} of {len(told)} trips of the table are there and weighed. The shortest "
        f"interval that holds a third of them runs from {low:.0f} to {high:.0f} kg, "
        f"{100 * (high - low) / middle:.1f} % of its median "
        f"(`rls`: {100 * (other[1] - other[0]) / other[2]:.1f} %). Median standard deviation "
        f"within a trip {np.median([row[4] for row in rows]):.0f} kg. The {len(loaded)} trips with "
        f"160 kg noted are {gain:.0f} ± {gain_std:.0f} kg heavier than the {len(bare)} of "
        "December, of which nothing is noted.",
    ]
    return "\n".join(lines)


def bmw_power() -> str:
    """Power of the motor beside that of the battery, and charge beside state of charge."""
    line = wb.Vehicle.load(EXAMPLE / "vehicle.toml").driveline
    driving, recuperating, charge = [], [], []
    for path in sorted((DATA / "bmw-i3").glob("Trip*.csv")):
        if path.stem in FILLED:
            continue
        table = pl.read_csv(path, separator=";", encoding="latin-1", infer_schema_length=None)
        speed, torque, volts, amps, soc, air, time = (
            table[name].cast(pl.Float64, strict=False).to_numpy()
            for name in (
                "Velocity [km/h]",
                "Motor Torque [Nm]",
                "Battery Voltage [V]",
                "Battery Current [A]",
                "SoC [%]",
                "AirCon Power [kW]",
                "Time [s]",
            )
        )
        heat = table["Heating Power CAN [kW]"].cast(pl.Float64, strict=False).to_numpy()
        motor = torque * speed / 3.6 * line.gearings[0]
        battery = -volts * amps - 1e3 * np.nan_to_num(air) - 1e3 * np.nan_to_num(heat)
        still = (speed < 0.4) & np.isfinite(battery)
        if np.count_nonzero(still) >= 200:
            battery -= float(np.median(battery[still]))
        # Seconds, so that what is sent at other instants weighs little.
        seconds = speed.size // 10 * 10
        motor, battery = (x[:seconds].reshape(-1, 10).mean(axis=1) for x in (motor, battery))
        known = np.isfinite(motor) & np.isfinite(battery)
        much = known & (motor > 8e3) & (motor < 30e3)
        back = known & (motor < -8e3) & (motor > -30e3)
        driving.append(motor[much].sum() / battery[much].sum())
        recuperating.append(battery[back].sum() / motor[back].sum())
        used = np.nansum(-amps[:-1] * np.diff(time)) / 3600.0
        charge.append(100.0 * used / (np.nanmax(soc) - soc[np.isfinite(soc)][-1]))
    told = [
        (np.median(values), *np.percentile(values, (10, 90)))
        for values in (driving, recuperating, charge)
    ]
    scale = float(np.sqrt(told[0][0] / told[1][0]))
    return (
        f"Motor torque times motor speed over battery power, 8 to 30 kW driving: median "
        f"{told[0][0]:.2f} of {len(driving)} trips, the middle eight tenths {told[0][1]:.2f} to "
        f"{told[0][2]:.2f}; battery over motor power recuperating: {told[1][0]:.2f}, "
        f"{told[1][1]:.2f} to {told[1][2]:.2f}. With losses alike both ways the reading is "
        f"{scale:.2f} of the torque. Charge per full state of charge: {told[2][0]:.1f}, "
        f"{told[2][1]:.1f} to {told[2][2]:.1f} A h, of a battery of 60 A h."
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
    axis.set_ylabel("mass kg, 95 % interval within the trip")
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
    view = w.result.balance.merged
    rows = view.usable
    force = (view.traction_force - view.drag_force - view.rotating_mass * view.accel)[rows]
    design = np.column_stack([view.accel[rows], np.ones(force.size)])
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
        f"{len(signals['reference_torque'])} broadcasts (SPN 544, transport protocol); net torque "
        f"{100 * torque.min():.0f} to {100 * torque.max():.0f} % of it, friction "
        f"{100 * extras['friction_torque'].values.min():.0f} to "
        f"{100 * extras['friction_torque'].values.max():.0f} %; speed {speed.min():.0f} to "
        f"{speed.max():.0f} km/h; {sum(found.summary.decoded.values())} frames of "
        f"{len(found.summary.decoded)} groups read, {len(found.summary.ignored)} groups not used.",
        "",
        f"`weigh` says `{w.status}`: {w.reason}.",
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
    told = []
    for ratio in known:
        nearest = ratios[np.argmin(np.abs(np.log(ratios / ratio)))]
        off = 100.0 * (nearest / ratio - 1.0)
        told.append(f"{nearest:.2f} ({off:+.1f} %)" if abs(off) < 5.0 else "–")
    return f"| {name} | {' | '.join(told)} | {ratios.size} |"


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
    told = [", ".join(f"{v:.0f}" for v in sorted(values)) for values in (rolling, standing)]
    return (
        "PID 62 below 1200 rpm with a coolant above 70 °C: rolling, the medians of "
        f"{len(rolling)} files are {told[0]} %; standing, of {len(standing)} files, {told[1]} %."
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
        lines.append(
            f"| {name} | {drive.duration:.0f} | {w.used_time:.0f} | {row[0]:.2f} "
            f"| {w.std / reference:.2f} | {row[1]:.2f} | {joint.std / reference:.2f} "
            f"| {row[2]:.2f} | {row[3]:.2f} | {forward} | {sd} |"
        )
    rows = np.array(table)
    full = rows[rows[:, 0] > 500.0]

    def agreement(values: np.ndarray) -> str:
        spread = 100.0 * np.std(values, ddof=1) / np.mean(values)
        return f"{np.mean(values):.2f} kg per N m, sd {spread:.1f} %"

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
        estimate_torque_delay(drive, car, motion)
        for (_, drive), motion in zip(long, motions, strict=True)
    ]
    delay = float(np.nanmedian(delays))
    lines = [
        "| file | delay of its own s | force on specific force | specific force on force "
        "| instrument: pressure × gearing | instrument: acceleration | by acceleration | by hills "
        "| part by acceleration |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    table = []
    for (name, drive), motion, own in zip(long, motions, delays, strict=True):
        view = force_balance(drive, car, motion, delay=delay).merged
        phi, y = regression(view, car)
        pressure = drive.signals["intake_pressure"].at(view.time) * view.gearing
        usable = view.usable & np.isfinite(phi) & np.isfinite(y) & np.isfinite(pressure)
        cut = windows(view.time, usable)
        time = cut.mean(view.time)
        f, force, p, a = (without_slow(time, cut.mean(x)) for x in (phi, y, pressure, view.accel))
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
        table.append(row)
        part = (a @ a) / (a @ a + hill @ hill)
        told = "–" if np.isnan(own) else f"{own:+.2f}"
        lines.append(
            f"| {name} | {told} | {' | '.join(f'{x:.2f}' for x in row)} | {100 * part:.0f} % |"
        )
    rows = np.array(table)
    spread = 100.0 * rows.std(axis=0, ddof=1) / rows.mean(axis=0)
    told = " | ".join(f"{m:.2f}, {s:.1f} %" for m, s in zip(rows.mean(0), spread, strict=True))
    weighed = np.array(
        [
            joint.estimate(force_balance(drive, car, motion, delay=delay), car).mass / reference
            for (_, drive), motion in zip(long, motions, strict=True)
        ]
    )
    lines += [
        f"| mean, sd | {delay:+.2f} (median) | {told} | |",
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
    lines += ["", f"`weigh` says `{w.status}`: {w.reason}."]
    return "\n".join(lines)


def main() -> None:
    page = (HERE / "recorded.template.md").read_text(encoding="utf-8")
    page = page.replace("<!-- bmw-i3 -->", bmw_i3())
    page = page.replace("<!-- bmw-power -->", bmw_power())
    page = page.replace("<!-- j1939-truck -->", j1939_truck())
    page = page.replace("<!-- clocks -->", clocks())
    page = page.replace("<!-- canedge -->", canedge())
    page = page.replace("<!-- canedge-regressions -->", canedge_regressions(canedge_drives()))
    page = page.replace("<!-- seat-leon -->", seat_leon())
    (HERE / "recorded.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
