"""Does more data hurt? Masses of cars and vans by what is recorded. Run me.

    python studies/car_equipment.py

Twelve cars and vans of the second model are recorded once, by a dongle of 4 readings of each signal
per second, a receiver with heights at 1 Hz, and an inertial sensor of 100 Hz of a phone. Each
recording is thinned: every n-th sample stays, as of a slower logger without a filter. Each vehicle
is calibrated on three of its drives, thinned alike, and weighed on three others. It fills
``car_equipment.template.md``. The seeds are used nowhere else, and nothing was tuned on them.
"""

from __future__ import annotations

import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from datetime import datetime
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from other_simulators import CLASSES, DRIVER
from pages import filled
from second_model import Logger, make_drive, random_vehicle
from truck_fleet import Results

import weighbridge as wb
from weighbridge.errors import WeighbridgeError
from weighbridge.signals import Drive, Signal
from weighbridge.signals.catalogue import IMU_SIGNALS

HERE: Final = Path(__file__).parent
KINDS: Final = ("small_petrol", "petrol", "petrol_dct", "petrol_automatic", "diesel", "van")
CARS: Final = [(kind, seed) for seed in (8841, 8842) for kind in KINDS]
KNOWN: Final = (0.0, 0.9, 0.45)
WEIGHED: Final = (0.1, 0.6, 0.95)
"""Payloads over the largest [-]."""

LOGGER: Final = Logger(mode="rows", rate=4.0, imu_rate=100.0)
GNSS: Final = ("latitude", "longitude", "altitude")


class Equipment(NamedTuple):
    """Samples per second of the dongle and of the inertial sensor, which may be missing [Hz]."""

    dongle: float
    sensor: float

    @property
    def name(self) -> str:
        sensor = f"inertial sensor {self.sensor:g} Hz" if self.sensor else "no inertial sensor"
        return f"OBD {self.dongle:g} Hz, {sensor}"


EQUIPMENT: Final = [
    Equipment(dongle, sensor)
    for dongle in (4.0, 1.0)
    for sensor in (0.0, 5.0, 10.0, 20.0, 50.0, 100.0)
]


def thinned(drive: Drive, equipment: Equipment) -> Drive:
    """Keep every n-th sample of the dongle and of the inertial sensor."""

    def every(name: str) -> int:
        if name in IMU_SIGNALS:
            return round(LOGGER.imu_rate / equipment.sensor)
        return 1 if name in GNSS else round(LOGGER.rate / equipment.dongle)

    kept = drive if equipment.sensor else drive.without(*IMU_SIGNALS)
    parts = ((n, s.time[:: every(n)], s.values[:: every(n)]) for n, s in kept.signals.items())
    return kept.with_signals(*(Signal(*part) for part in parts))


def weighed(kind: str, seed: int) -> dict[Equipment, Results]:
    """Masses of one vehicle by each equipment."""
    vehicle = random_vehicle(kind, seed)
    base = wb.Vehicle(name=kind, kind=CLASSES.get(kind, "car"), tare=round(vehicle.tare))
    found = {}
    with tempfile.TemporaryDirectory() as folder:

        def made(k: int, load: float) -> tuple[Drive, float]:
            room = vehicle.gross - vehicle.tare - DRIVER
            mass = vehicle.tare + DRIVER + load * room
            path, at = Path(folder) / str(k), 100 * seed + 10_000 * KINDS.index(kind) + k
            make_drive(path, vehicle, mass=mass, seed=at, style="ordinary", logger=LOGGER)
            (path / "drive.toml").unlink()
            return wb.read_drive(path).without("gnss_speed", "gnss_course"), mass

        known = [made(k, load) for k, load in enumerate(KNOWN)]
        others = [made(k, load) for k, load in enumerate(WEIGHED, 10)]
    for equipment in EQUIPMENT:
        results = found[equipment] = Results()
        try:
            car = wb.calibrate(
                [thinned(d, equipment) for d, _ in known], [kg for _, kg in known], vehicle=base
            )
        except WeighbridgeError as error:
            results.refused.append(f"{kind} {seed}, {equipment.name}: {error}")
            car = None
        for drive, mass in others:
            w = wb.weigh(thinned(drive, equipment), car) if car is not None else None
            results.error.append(w.mass / mass - 1.0 if w else float("nan"))
            results.std.append(w.std / mass if w else float("nan"))
    return found


def beside(of: dict[Equipment, Results], less: Equipment, more: Equipment) -> str:
    """Say how masses by more data compare with those by less."""
    error = np.abs([of[e].error for e in (less, more)])
    std = np.array([of[e].std for e in (less, more)])
    both = np.isfinite(error).all(axis=0)
    rms = 100.0 * np.sqrt(np.mean(error[:, both] ** 2, axis=1))
    wider = int(np.sum(std[1, both] > 1.02 * std[0, both]))
    return (
        f"| {less.name} | {more.name} | {both.sum()} | {rms[0]:.1f} → {rms[1]:.1f} % | "
        f"{100.0 * np.median(std[1, both] / std[0, both] - 1.0):+.0f} % | {wider} |"
    )


def main() -> None:
    """Write the page."""
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(weighed, *zip(*CARS, strict=True)))
    of = {e: sum((f[e] for f in found), Results()) for e in EQUIPMENT}
    none = {e.dongle: e for e in EQUIPMENT if not e.sensor}
    pairs = [(none[e.dongle], e) for e in EQUIPMENT if e.sensor]
    pairs += [(e._replace(dongle=1.0), e) for e in EQUIPMENT if e.dongle > 1.0]
    values = {
        "rows": "\n".join(of[e].row(e.name) for e in EQUIPMENT),
        "beside": "\n".join(beside(of, *pair) for pair in pairs),
        "each": "\n".join(
            f[e].row(f"{kind} {seed}, {e.name}")
            for (kind, seed), f in zip(CARS, found, strict=True)
            for e in EQUIPMENT
        ),
        "refused": "\n".join(f"- {why}" for e in EQUIPMENT for why in of[e].refused)
        or "No calibration was refused.",
        "date": f"{datetime.now():%d %B %Y}".lstrip("0"),
    }
    text = filled(HERE / "car_equipment.template.md", values)
    (HERE / "car_equipment.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
