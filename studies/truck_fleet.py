"""How good are masses of trucks that log no accelerometer? Run me.

    python studies/truck_fleet.py

Eight trucks of the second model log speed, engine speed, torque in percent, gear, retarder and
brake at 5 Hz, and a position with its height at 1 Hz. Each is calibrated on three drives of half
an hour with known masses, and weighed on four others, once by that file and once by data sheet.
The seeds are used nowhere else, and nothing was tuned on them.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from second_model import Logger, Vehicle, make_drive, random_vehicle

import weighbridge as wb
from weighbridge.signals import Drive
from weighbridge.vehicle.known import Known, describe

TRUCKS: Final = range(7401, 7409)
KNOWN: Final = (0.2, 0.9, 0.5)
WEIGHED: Final = (0.05, 0.35, 0.7, 0.95)
"""Payloads over the largest [-]."""

LOGGER: Final = Logger(
    mode="rows", rate=5.0, torque="percent", brake_switch=True, retarder=True, gear=True,
    throttle=True,
)  # fmt: skip


class Result(NamedTuple):
    """One mass: error and told standard deviation over the true mass [-]; NaN where refused."""

    error: float
    std: float


def drive(truck: Vehicle, seed: int, load: float, home: Path) -> tuple[Drive, float]:
    """One drive without accelerometer, and its mass [kg]."""
    mass = truck.tare + load * (truck.gross - truck.tare)
    folder = home / str(seed)
    make_drive(folder, truck, mass=mass, seed=seed, style="ordinary", logger=LOGGER)
    for left_out in (*folder.glob("imu*"), *folder.glob("drive.toml")):
        left_out.unlink()
    beside = ("gnss_speed", "gnss_course", "hdop", "gnss_accuracy")
    return wb.read_drive(folder).without(*beside), mass


def weighed(seed: int) -> tuple[list[Result], list[Result]]:
    """Masses of one truck: by its calibration, and by data sheet alone."""
    truck = random_vehicle("truck", seed)
    papers = Known(kind="truck", tare=round(truck.tare), gross=round(truck.gross), torque="percent")
    base = describe(papers).vehicle
    with tempfile.TemporaryDirectory() as home:
        made = [drive(truck, 100 * seed + k, load, Path(home)) for k, load in enumerate(KNOWN)]
        car = wb.calibrate([d for d, _ in made], [kg for _, kg in made], vehicle=base)
        found: tuple[list[Result], list[Result]] = ([], [])
        for k, load in enumerate(WEIGHED, 10):
            recorded, mass = drive(truck, 100 * seed + k, load, Path(home))
            for results, file in zip(found, (car, base), strict=True):
                w = wb.weigh(recorded, file)
                results.append(Result(w.mass / mass - 1.0, w.std / mass))
    return found


def told(name: str, results: list[Result]) -> str:
    """One line on some results, in percent."""
    error, std = 100.0 * np.array(results).T
    have = np.isfinite(error)
    error, std = error[have], std[have]
    return (
        f"{name}: {error.size} of {have.size} weighed, RMS {np.sqrt(np.mean(error**2)):.1f} %, "
        f"worst {np.abs(error).max():.1f} %, told ± {std.min():.1f}-{std.max():.1f} %, "
        f"{100.0 * np.mean(np.abs(error) < 1.96 * std):.0f} % within the interval"
    )


def main() -> None:
    """Print one line a truck and two over all."""
    calibrated: list[Result] = []
    by_papers: list[Result] = []
    for seed in TRUCKS:
        own, papers = weighed(seed)
        calibrated += own
        by_papers += papers
        sys.stdout.write(told(f"truck {seed}", own) + "\n")
    sys.stdout.write(told("calibrated", calibrated) + "\n")
    sys.stdout.write(told("data sheet", by_papers) + "\n")


if __name__ == "__main__":
    main()
