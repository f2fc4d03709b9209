"""Accuracy of ``joint`` on drives of two simulators that share nothing with the estimators'.

Run from the checkout: ``python studies/other_simulators.py``, which prints the tables of
``accuracy.md``; ``foreign``, ``minutes``, ``makers``, ``forward`` or ``second`` prints one alone.
The first four need the foreign simulator's drives in ``../shared/data``; the second model's
drives are made on the way, in a folder that is removed.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import polars as pl
from second_model import make_drive, random_vehicle

import weighbridge as wb
from weighbridge.errors import WeighbridgeError
from weighbridge.pipeline.forward import forward_weigh, identify_forward
from weighbridge.signals import Drive, Signal

FOREIGN = Path(__file__).parents[2] / "shared" / "data" / "foreign-simulator"
VEHICLES = ("hatchback", "wagon")
CALIBRATIONS = {
    "three drives": ("calibration-1", "calibration-2", "calibration-3"),
    "one calm drive": ("calibration-1",),
    "one brisk drive": ("brisk-calibration",),
}
DRIVES = ("drive-1", "drive-2", "drive-3", "drive-4")

JUDGED = 9890
KINDS = (
    "small_petrol", "petrol", "petrol_dct", "petrol_automatic", "diesel", "van", "truck", "semi",
    "electric_car", "electric_bus",
)  # fmt: skip
CLASSES = {"van": "van", "truck": "truck", "semi": "truck", "electric_bus": "bus"}
LOADS = {
    "calibration-1": (0.0, "ordinary"),
    "calibration-2": (0.45, "ordinary"),
    "calibration-3": (0.9, "ordinary"),
    "brisk-calibration": (0.0, "brisk"),
}
WEIGHED = {
    "drive-1": (0.0, "ordinary"),
    "drive-2": (0.95, "ordinary"),
    "drive-3": (0.6, "motorway"),
    "drive-4": (0.8, "calm"),
    "drive-5": (0.3, "city"),
    "drive-6": (0.95, "brisk"),
}
DRIVER = 75.0
FIVE_MINUTES = 300.0

GNSS = ("latitude", "longitude", "altitude")
POLLED = ("vehicle_speed", "engine_speed", "engine_load", "engine_torque")
EQUIPMENT: dict[str, tuple[float, bool, bool]] = {
    "OBD at 1 Hz, IMU at 50 Hz, GNSS": (1.0, True, True),
    "OBD at 4 Hz, GNSS": (4.0, False, True),
    "OBD at 1 Hz, GNSS": (1.0, False, True),
    "OBD at 2 Hz alone": (2.0, False, False),
}


@dataclass(frozen=True)
class Weighed:
    """One drive: what was found and what it was [kg]; NaN where there is no mass."""

    mass: float
    std: float
    true: float

    @property
    def error(self) -> float:
        """Relative error [%]."""
        return 100.0 * (self.mass / self.true - 1.0)


def masses(folder: Path) -> tuple[float, float]:
    """Mass as a drive begins and ends [kg]."""
    mass = pl.read_parquet(folder / "truth.parquet")["mass_kg"]
    return float(mass[0]), float(mass[-1])


def weigh_all(
    root: Path,
    calibrations: Sequence[str],
    drives: Sequence[str],
    base: wb.Vehicle | None = None,
    seen: Callable[[Drive, Path], Drive] = lambda drive, _: drive,
) -> list[Weighed] | str:
    """Calibrate and weigh the drives of one vehicle; a sentence where it cannot be calibrated."""

    def read(name: str) -> Drive:
        return seen(wb.read_drive(root / name), root / name)

    try:
        known = [masses(root / name)[0] for name in calibrations]
        car = wb.calibrate([read(name) for name in calibrations], known, vehicle=base)
    except WeighbridgeError as refused:
        return str(refused)
    found = []
    for name in drives:
        try:
            weighing = wb.weigh(read(name), car)
            mass, std = weighing.mass, weighing.std
        except WeighbridgeError:
            mass, std = np.nan, np.nan
        found.append(Weighed(mass, std, masses(root / name)[1]))
    return found


def row(name: str, groups: Sequence[list[Weighed] | str]) -> str:
    """Write one line of a table: all drives of all vehicles."""
    lists = [g for g in groups if not isinstance(g, str)]
    every = [w for g in lists for w in g]
    got = [w for w in every if np.isfinite(w.mass)]
    if not got:
        return f"| {name} | 0 of {len(every)} | | | | | | |"
    error = np.array([w.error for w in got])
    scaled = np.array([(w.mass - w.true) / w.std for w in got])
    gains = [
        np.polyfit([w.true for w in g], [w.mass for w in g], 1)[0]
        for g in ([w for w in g if np.isfinite(w.mass)] for g in lists)
        if len(g) > 2
    ]
    told = np.median([196.0 * w.std / w.true for w in got])
    return (
        f"| {name} | {len(got)} of {len(every)} | {np.sqrt(np.mean(error**2)):.2f} "
        f"| {error.mean():+.2f} | {np.max(np.abs(error)):.2f} | ± {told:.1f} "
        f"| {np.mean(np.abs(scaled) < 1.96):.0%}, {np.mean(scaled**2):.2f} "
        f"| {', '.join(f'{g:.3f}' for g in gains)} |"
    )


HEAD = (
    "| {} | weighed | RMS % | mean % | worst % | interval, median % | intervals that hold, "
    "(error / std)² | gain of load |\n|---|---|---|---|---|---|---|---|"
)


def foreign() -> str:
    """Whole drives of the foreign simulator."""
    lines = [HEAD.format("calibrated on")]
    for name, calibrations in CALIBRATIONS.items():
        groups = [weigh_all(FOREIGN / v, calibrations, DRIVES) for v in VEHICLES]
        lines.append(row(name, groups))
        lines += [row(f"{name}, {v}", [g]) for v, g in zip(VEHICLES, groups, strict=True)]
    lines.append(
        row(
            "three others (drive-1 to drive-3)",
            [weigh_all(FOREIGN / v, DRIVES[:3], (*LOADS, "drive-4")) for v in VEHICLES],
        )
    )
    return "\n".join(lines)


def first_minutes(drive: Drive, folder: Path) -> Drive:
    """Cut a weighed drive off after five minutes of moving."""
    if not folder.name.startswith("drive"):
        return drive
    truth = pl.read_parquet(folder / "truth.parquet")
    time, speed = truth["time_s"].to_numpy(), truth["speed_mps"].to_numpy()
    moved = np.cumsum((speed > 0.5) * np.gradient(time))
    return drive.between(drive.start, float(time[np.searchsorted(moved, FIVE_MINUTES)]))


def minutes() -> str:
    """Drives of the foreign simulator that end after five minutes of moving."""
    lines = [HEAD.format("calibrated on")]
    for name, calibrations in CALIBRATIONS.items():
        groups = [
            weigh_all(FOREIGN / v, calibrations, DRIVES, seen=first_minutes) for v in VEHICLES
        ]
        lines.append(row(name, groups))
    return "\n".join(lines)


def thinned(rate: float, imu: bool, gnss: bool) -> Callable[[Drive, Path], Drive]:
    """Return what leaves a drive with OBD at ``rate`` [Hz] and the sensors that are there."""

    def thin(drive: Drive, _: Path) -> Drive:
        signals = {}
        for name, s in drive.signals.items():
            wanted = s.time
            if name in POLLED:
                wanted = np.arange(s.time[0], s.time[-1], 1.0 / rate)
            elif name in GNSS:
                if not gnss:
                    continue
            elif not imu:
                continue
            else:
                wanted = np.arange(s.time[0], s.time[-1], 0.02)
            at = np.unique(np.minimum(np.searchsorted(s.time, wanted), s.time.size - 1))
            signals[name] = Signal(name, s.time[at], s.values[at])
        return replace(drive, signals=signals)

    return thin


def makers() -> str:
    """Drives of the foreign simulator, thinned to makers' equipment; two calibration drives."""
    lines = [HEAD.format("equipment")]
    for name, given in EQUIPMENT.items():
        groups = [
            weigh_all(FOREIGN / v, CALIBRATIONS["three drives"][:2], DRIVES, seen=thinned(*given))
            for v in VEHICLES
        ]
        lines.append(row(name, groups))
    return "\n".join(lines)


def second() -> str:
    """Vehicles, drivers and roads of the second model, drawn with seeds nothing was tuned on."""
    lines = [HEAD.format("vehicle, calibration")]
    every: dict[str, list[list[Weighed] | str]] = {name: [] for name in CALIBRATIONS}
    for number, kind in enumerate(KINDS):
        vehicle = random_vehicle(kind, JUDGED + number)
        random = np.random.default_rng(13 * JUDGED + number)
        with tempfile.TemporaryDirectory() as made:
            for name, (part, style) in (LOADS | WEIGHED).items():
                part = float(np.clip(part + random.uniform(-0.05, 0.05), 0.0, 1.0)) if part else 0.0
                room = vehicle.gross - vehicle.tare - DRIVER
                make_drive(
                    Path(made) / name, vehicle, mass=vehicle.tare + DRIVER + part * room,
                    seed=int(random.integers(1 << 30)), style=style,
                )  # fmt: skip
            base = wb.Vehicle(name=kind, kind=CLASSES.get(kind, "car"))
            for name, calibrations in CALIBRATIONS.items():
                found = weigh_all(Path(made), calibrations, tuple(WEIGHED), base)
                every[name].append(found)
                if isinstance(found, str):
                    print(f"{kind}, {name}: {found}", file=sys.stderr)
                else:
                    lines.append(row(f"{kind}, {name}", [found]))
    return "\n".join([lines[0], *(row(f"all, {n}", g) for n, g in every.items()), *lines[1:]])


def forward() -> str:
    """Forward passes of the foreign drives beside what the smoother makes of them."""
    lines = [
        "| drive | true kg | smoothed, error % | forward at the end % | forward after 5 min % "
        "| forward over smoothed % |",
        "|---|---|---|---|---|---|",
    ]
    for vehicle in VEHICLES:
        root = FOREIGN / vehicle
        names = CALIBRATIONS["three drives"]
        car = wb.calibrate(
            [wb.read_drive(root / n) for n in names], [masses(root / n)[0] for n in names]
        )
        for name in DRIVES:
            weighing = wb.weigh(wb.read_drive(root / name), car)
            track = forward_weigh(weighing.drive, identify_forward(weighing))
            begun, true = masses(root / name)
            early = track.mass[np.searchsorted(track.time, track.time[0] + FIVE_MINUTES)]
            lines.append(
                f"| {vehicle}, {name} | {true:.0f} | {100.0 * (weighing.mass / true - 1.0):+.2f} "
                f"| {100.0 * (track.mass[-1] / true - 1.0):+.2f} "
                f"| {100.0 * (early / begun - 1.0):+.2f} "
                f"| {100.0 * (track.mass[-1] / weighing.mass - 1.0):+.2f} |"
            )
    return "\n".join(lines)


PARTS = {
    "foreign": foreign,
    "minutes": minutes,
    "makers": makers,
    "forward": forward,
    "second": second,
}


def main() -> None:
    asked = sys.argv[1:] or list(PARTS)
    for name in asked:
        print(f"### {name}\n\n{PARTS[name]()}\n", flush=True)


if __name__ == "__main__":
    main()
