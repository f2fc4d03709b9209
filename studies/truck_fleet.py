"""How good are masses of trucks as fleets log them? Run me.

    python studies/truck_fleet.py

Four trucks and four semi-trailers of the second model log speed, engine speed, torque in percent,
gear, retarder and brake, and a position with its height at 1 Hz: at 5 Hz, at 5 Hz with true
heights, at 1 Hz, and at both rates with an inertial sensor of 50 Hz. Each is calibrated on three
drives of half an hour with known masses, and weighed on four others, once by that file and once by
data sheet. It fills ``truck_fleet.template.md``. The seeds are used nowhere else, and nothing was
tuned on them.
"""

from __future__ import annotations

import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Final

import numpy as np
from pages import filled
from second_model import Logger, Vehicle, make_drive, random_vehicle

import weighbridge as wb
from weighbridge.errors import WeighbridgeError
from weighbridge.signals import Drive, Signal
from weighbridge.vehicle.known import Known, describe

HERE: Final = Path(__file__).parent
TRUCKS: Final = [(kind, seed) for seed in range(7721, 7725) for kind in ("truck", "semi")]
KNOWN: Final = (0.2, 0.9, 0.5)
WEIGHED: Final = (0.05, 0.35, 0.7, 0.95)
"""Payloads over the largest [-]."""

LOGGER: Final = Logger(
    mode="rows", rate=5.0, torque="percent", brake_switch=True, retarder=True, gear=True,
    throttle=True, imu_rate=50.0,
)  # fmt: skip
SLOW: Final = replace(LOGGER, rate=1.0)

SURVEYED: Final = "5 Hz, heights of a survey"

RECORDED: Final = {
    "5 Hz": (LOGGER, False),
    SURVEYED: (LOGGER, False),
    "1 Hz": (SLOW, False),
    "5 Hz, inertial sensor of 50 Hz": (LOGGER, True),
    "1 Hz, inertial sensor of 50 Hz": (SLOW, True),
}
"""Logger, and whether the inertial sensor is recorded."""


@dataclass(frozen=True)
class Results:
    """Masses of some drives.

    Attributes
    ----------
    error, std : error and reported standard deviation of each drive, over the true mass [-]; NaN
        where it has no mass
    refused : why a calibration gave no file
    """

    error: list[float] = field(default_factory=list)
    std: list[float] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)

    def __add__(self, other: Results) -> Results:
        return Results(self.error + other.error, self.std + other.std, self.refused + other.refused)

    def row(self, name: str) -> str:
        """Row of the table, in percent."""
        error, std = 100.0 * np.array([self.error, self.std])
        have = np.isfinite(error)
        weighed = f"| {name} | {have.sum()} of {have.size} | "
        if not have.any():
            return weighed + "– | – | – | – |"
        error, std = error[have], std[have]
        return weighed + (
            f"{np.sqrt(np.mean(error**2)):.1f} % | {error.mean():+.1f} % | "
            f"{np.abs(error).max():.1f} % | {std.min():.1f}–{std.max():.1f} % | "
            f"{100.0 * np.mean(np.abs(error) < 1.96 * std):.0f} % |"
        )


def drive(
    truck: Vehicle,
    seed: int,
    load: float,
    home: Path,
    logger: Logger = LOGGER,
    *,
    with_imu: bool = False,
    surveyed: bool = False,
) -> tuple[Drive, float]:
    """One drive, and its mass [kg]; with the true heights in place of the receiver's."""
    mass = truck.tare + load * (truck.gross - truck.tare)
    folder = home / str(seed)
    truth = make_drive(folder, truck, mass=mass, seed=seed, style="ordinary", logger=logger)
    (folder / "drive.toml").unlink()
    if not with_imu:
        (folder / "imu.parquet").unlink()
    beside = ("gnss_speed", "gnss_course", "hdop", "gnss_accuracy")
    read = wb.read_drive(folder).without(*beside)
    if surveyed:
        fixes = read.signals["altitude"].time
        ground = np.interp(fixes, truth["time_s"].to_numpy(), truth["altitude_m"].to_numpy())
        read = read.with_signals(Signal("altitude", fixes, ground))
    return read, mass


def weighed(kind: str, seed: int, recorded: str) -> tuple[Results, Results]:
    """Masses of one truck: by its calibration, and by data sheet alone."""
    truck = random_vehicle(kind, seed)
    papers = Known(kind="truck", tare=round(truck.tare), gross=round(truck.gross), torque="percent")
    base = describe(papers).vehicle
    logger, with_imu = RECORDED[recorded]
    calibrated, by_papers = Results(), Results()
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)

        def made(k: int, load: float) -> tuple[Drive, float]:
            return drive(
                truck,
                100 * seed + k,
                load,
                home,
                logger,
                with_imu=with_imu,
                surveyed=recorded == SURVEYED,
            )

        known = [made(k, load) for k, load in enumerate(KNOWN)]
        try:
            car = wb.calibrate([d for d, _ in known], [kg for _, kg in known], vehicle=base)
        except WeighbridgeError as error:
            calibrated.refused.append(f"{kind} {seed}, {recorded}: {error}")
            car = None
        for k, load in enumerate(WEIGHED, 10):
            one, mass = made(k, load)
            for results, file in ((calibrated, car), (by_papers, base)):
                w = wb.weigh(one, file) if file is not None else None
                results.error.append(w.mass / mass - 1.0 if w else float("nan"))
                results.std.append(w.std / mass if w else float("nan"))
    return calibrated, by_papers


def main() -> None:
    """Write the page."""
    jobs = [(kind, seed, recorded) for recorded in RECORDED for kind, seed in TRUCKS]
    with ProcessPoolExecutor(2) as pool:
        found = dict(zip(jobs, pool.map(weighed, *zip(*jobs, strict=True)), strict=True))
    rows, each, refused = [], [], []
    for recorded in RECORDED:
        for n, by in enumerate(("calibrated", "by data sheet")):
            of = {job: found[job][n] for job in jobs if job[2] == recorded}
            rows.append(sum(of.values(), Results()).row(f"{recorded}, {by}"))
        each += [found[job][0].row(f"{job[0]} {job[1]}, {recorded}") for job in of]
        refused += [f"- {why}" for job in of for why in found[job][0].refused]
    values = {
        "rows": "\n".join(rows),
        "each": "\n".join(each),
        "refused": "\n".join(refused) or "No calibration was refused.",
        "date": f"{datetime.now():%d %B %Y}".lstrip("0"),
    }
    text = filled(HERE / "truck_fleet.template.md", values)
    (HERE / "truck_fleet.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
