"""Do the intervals hold that power of the motor and of the battery give? Run me.

    python studies/electric_power.py --seed 9033000 --cars 5 --minutes 20

Simulated electric cars tell motor power over vehicle speed (``power_by_speed``) or battery
voltage and current (``battery``). Each car has losses, meters and a heater of its own.
It is weighed with a data sheet's vehicle file, and after calibrations on one and two drives.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from accuracy_drives import compile_all, final_mass, scenario, shared_out

import weighbridge as wb
from weighbridge.papers.jensen2022_drives import without_weather
from weighbridge.simulation import SimulatedDrive, random_vehicle, simulate_car, usual_polling
from weighbridge.vehicle.model import Driveline, TorqueModel, Vehicle

LOADS: Final = (0.0, 250.0, 120.0, 330.0, 60.0)
"""Payloads; the first two drives are those of the calibrations [kg]."""

NAMES: Final = {
    "power_by_speed": ("engine_power",),
    "battery": ("battery_current", "battery_voltage"),
}


class Powertrain(NamedTuple):
    """What a car's power meters say and where power goes.

    Attributes
    ----------
    standing : lost whenever it is on [W]
    per_speed : lost with motor speed [W s/rad]
    switched : lost in proportion to shaft power, driving or recuperating [-]
    copper : lost per torque squared, as part of the power at the highest torque [-]
    one_way : part of the copper's loss that falls on driving; the rest on recuperating [-]
    meter : reading over truth of the battery's power [-]
    reported : the same of the motor's power that the control unit reports [-]
    zero : offset of the current [A]
    rate : of the readings [Hz]
    late : lateness of the readings [s]
    """

    standing: float
    per_speed: float
    switched: float
    copper: float
    one_way: float
    meter: float
    reported: float
    zero: float
    rate: float
    late: float


class Result(NamedTuple):
    """One weighing."""

    source: str
    file: str
    error: float
    std: float
    inside: bool


def drawn(rng: np.random.Generator) -> Powertrain:
    """Draw what differs from car to car; meters as good as `BATTERY.scale_std` takes them."""

    def between(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    return Powertrain(
        standing=between(200.0, 700.0),
        per_speed=between(0.2, 0.8),
        switched=between(0.01, 0.03),
        copper=between(0.02, 0.06),
        one_way=between(0.4, 0.6),
        meter=1.0 + 0.015 * float(rng.standard_normal()),
        reported=1.0 + 0.03 * float(rng.standard_normal()),
        zero=0.5 * float(rng.standard_normal()),
        rate=float(rng.choice([2.0, 5.0, 10.0])),
        late=between(0.0, 0.3),
    )


def with_power(made: SimulatedDrive, train: Powertrain, rng: np.random.Generator) -> wb.Drive:
    """Give a drive the readings that its powertrain makes, in place of its torque."""
    truth = made.truth
    time = np.arange(truth.time[0] + 0.5, truth.time[-1], 1.0 / train.rate)
    torque = np.interp(time - train.late, truth.time, truth.engine_torque)
    speed = np.interp(time - train.late, truth.time, truth.engine_speed)
    shaft = torque * speed
    most = float(np.max(np.abs(truth.engine_torque)))
    usual = float(np.percentile(np.abs(shaft), 99.0))
    way = 2.0 * np.where(torque >= 0.0, train.one_way, 1.0 - train.one_way)
    heater = rng.uniform(0.0, 2500.0) * np.exp(-(time - time[0]) / rng.uniform(200.0, 900.0))
    cycle = rng.uniform(0.0, 400.0) * (np.sin(2.0 * np.pi * time / rng.uniform(60, 300)) > 0.0)
    battery = (
        shaft
        + train.standing
        + train.per_speed * speed
        + train.switched * np.abs(shaft)
        + way * train.copper * usual * (torque / most) ** 2
        + heater
        + cycle
    )
    volts = 370.0 - 0.00012 * battery
    amps = train.meter * battery / volts + train.zero
    amps += 0.3 * rng.standard_normal(time.size)
    power = train.reported * shaft + 0.005 * usual * rng.standard_normal(time.size)
    drive = without_weather(made.drive)
    names = [n for n in drive.signals if n.startswith(("engine", "reference"))]
    return drive.without(*names).with_signals(
        wb.Signal("battery_current", time, np.round(amps, 1)),
        wb.Signal("battery_voltage", time, np.round(volts, 1)),
        wb.Signal("engine_power", time, np.round(power, -2)),
    )


def of_car(seed: int, duration: float) -> list[Result]:
    """Weigh the drives [s] of one car by each source and vehicle file."""
    rng = np.random.default_rng([seed, 5])
    car = random_vehicle(rng, "electric")
    train = drawn(rng)
    polling = replace(usual_polling(car), fast=("vehicle_speed",), rate=10.0)
    made = [
        simulate_car(
            replace(
                scenario(car, rng, load=load, seed=seed + k, polling=polling), duration=duration
            )
        )
        for k, load in enumerate(LOADS)
    ]
    drives = [with_power(m, train, rng) for m in made]
    found: list[Result] = []
    for source, kept in NAMES.items():
        others = [n for names in NAMES.values() for n in names if n not in kept]
        seen = [d.without(*others) for d in drives]
        masses = [float(m.truth.mass[0]) for m in made]
        line = Driveline(wheel_radius=car.wheel_radius)
        files = {"data sheet": wb.Vehicle(driveline=line, torque=TorqueModel(source=source))}
        for count in (1, 2):
            base = Vehicle(driveline=line)
            try:
                files[f"{count} drives"] = wb.calibrate(seen[:count], masses[:count], vehicle=base)
            except wb.WeighbridgeError as error:
                print(f"car {seed}, {source}, {count} drives: {error}", file=sys.stderr)
        for name, file in files.items():
            for drive, truth in zip(seen[2:], made[2:], strict=True):
                found += _weighed(source, name, drive, file, final_mass(truth))
    return found


def _weighed(source: str, name: str, drive: wb.Drive, file: Vehicle, true: float) -> list[Result]:
    try:
        w = wb.weigh(drive, file)
    except wb.WeighbridgeError as error:
        print(f"{source}, {name}: {error}", file=sys.stderr)
        return [Result(source, name, math.nan, math.nan, False)]
    low, high = w.interval(0.95)
    return [Result(source, name, w.mass / true - 1.0, w.std / true, low < true < high)]


def main() -> None:
    """Print a table: errors, standard deviations and how many intervals hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=161_000, help="of the first car")
    parser.add_argument("--cars", type=int, default=10)
    parser.add_argument("--minutes", type=float, default=25.0, help="length of a drive")
    given = parser.parse_args()
    compile_all()
    seeds = range(given.seed, given.seed + 100 * given.cars, 100)
    rows = [
        r for part in shared_out([(of_car, (s, 60.0 * given.minutes)) for s in seeds]) for r in part
    ]
    print("| source | vehicle file | masses | mean error | RMS | mean std | worst / std | held |")
    print("|---|---|---|---|---|---|---|---|")
    for source in NAMES:
        for name in ("data sheet", "1 drives", "2 drives"):
            part = [r for r in rows if (r.source, r.file) == (source, name)]
            there = [r for r in part if math.isfinite(r.error)]
            if not there:
                print(f"| {source} | {name} | 0 of {len(part)} | | | | | |")
                continue
            error, std = (np.array([getattr(r, key) for r in there]) for key in ("error", "std"))
            print(
                f"| {source} | {name} | {len(there)} of {len(part)} | {100 * error.mean():+.1f} % "
                f"| {100 * np.sqrt(np.mean(error**2)):.1f} % | {100 * std.mean():.1f} % "
                f"| {np.max(np.abs(error) / std):.1f} "
                f"| {100 * np.mean([r.inside for r in there]):.0f} % |"
            )


if __name__ == "__main__":
    main()
