"""Tables of studies/recorded.md: recorded drives weighed with data-sheet vehicles.

Run from the checkout: ``python studies/recorded.py``. The recordings lie in
``../shared/data`` and are not part of the project.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import weighbridge as wb
from weighbridge.io.candump import read_candump
from weighbridge.io.j1939 import decode_j1939
from weighbridge.kernels.rotation import euler_to_matrix
from weighbridge.signals import Signal
from weighbridge.signals.alignment import align
from weighbridge.vehicle.gear import detect_gearings

HERE = Path(__file__).parent
DATA = HERE.parents[1] / "shared" / "data"
EXAMPLE = HERE.parent / "examples" / "bmw-i3"


def bmw_i3() -> str:
    car = wb.Vehicle.load(EXAMPLE / "vehicle.toml")
    lines = [
        "| trip | min | used min | mass kg | sd within the trip kg | offset m/s² | delay s |",
        "|---|---|---|---|---|---|---|",
    ]
    masses, spreads = [], []
    scale = car.provenance.mass_scale_std or 0.0
    for path in sorted((DATA / "bmw-i3").glob("Trip*.csv")):
        w = wb.weigh(wb.read_drive(path, EXAMPLE / "mapping.toml"), car)
        if w.status != "converged":
            lines.append(f"| {path.stem} | {w.drive.duration / 60:.1f} | | {w.reason} | | | |")
            continue
        own = float(np.sqrt(max(w.std**2 - (scale * w.mass) ** 2, 0.0)))
        masses.append(w.mass)
        spreads.append(own)
        offset = next(n.split()[2] for n in w.warnings if n.startswith("accelerometer offset"))
        lines.append(
            f"| {path.stem} | {w.drive.duration / 60:.1f} | {w.used_time / 60:.1f} | {w.mass:.0f} "
            f"| {own:.0f} | {offset} | {w.result.balance.force.delay:+.2f} |"
        )
    mass = np.sort(masses)
    third = int(np.ceil(mass.size / 3))
    widths = mass[third - 1 :] - mass[: mass.size - third + 1]
    best = int(np.argmin(widths))
    middle = float(np.median(mass[best : best + third]))
    lines += [
        "",
        f"{mass.size} of 24 trips weighed. Median {np.median(mass):.0f} kg; the shortest interval "
        f"that holds a third of the trips runs from {mass[best]:.0f} to "
        f"{mass[best + third - 1]:.0f} kg, {100 * widths[best] / middle:.1f} % of its median. "
        f"Median standard deviation within a trip {np.median(spreads):.0f} kg.",
    ]
    return "\n".join(lines)


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
    w = wb.weigh(wb.read_drive(path), car, method="rls")
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
    page = page.replace("<!-- j1939-truck -->", j1939_truck())
    page = page.replace("<!-- clocks -->", clocks())
    page = page.replace("<!-- canedge -->", canedge())
    page = page.replace("<!-- seat-leon -->", seat_leon())
    (HERE / "recorded.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
