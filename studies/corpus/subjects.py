"""Vehicles of the corpus, each with drives of known mass; made once and kept by recipe."""

from __future__ import annotations

import hashlib
import os
import pickle
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl
from accuracy_drives import FULL, bare, scenario
from fault_subjects import KINDS as OWN_KINDS
from fault_subjects import polling
from second_model import VARIANTS, Logger, make_drive, random_variant
from second_model import Vehicle as SecondVehicle
from second_model import random_vehicle as second_vehicle

import weighbridge as wb
from weighbridge.papers.jensen2022_drives import without_weather
from weighbridge.signals import Drive
from weighbridge.simulation import SimulatedCar, random_vehicle, simulate_car
from weighbridge.vehicle.known import Known, describe
from weighbridge.vehicle.model import Vehicle

ROOT: Final = Path(__file__).parents[2]
SHARED: Final = ROOT.parent / "shared"
SOURCES: Final = (
    *sorted((ROOT / "src/weighbridge/simulation").glob("*.py")),
    *sorted((ROOT / "src/weighbridge/signals").glob("*.py")),
    *sorted((ROOT / "src/weighbridge/vehicle").glob("*.py")),
    *sorted((ROOT / "studies/second_model").glob("*.py")),
    ROOT / "studies/accuracy_drives.py",
    ROOT / "studies/fault_subjects.py",
    Path(__file__),
)
SEED: Final = 5200
"""Of vehicles and drives. The corpus keeps the program honest while it changes, so it is looked at;
figures on accuracy are made on other seeds."""

DURATION: Final = 1200.0
IMU_RATE: Final = 100.0
SECOND_KINDS: Final = (
    "small_petrol", "petrol", "petrol_dct", "petrol_automatic", "diesel", "van", "truck", "semi",
    "electric_car", "electric_bus",
)  # fmt: skip
GEARBOXES: Final = {
    "stepless": ("petrol_cvt", Logger()),
    "slipping clutch": ("slipping_clutch", Logger()),
    "two speeds": ("two_speed_electric", Logger()),
    "hub motors": ("hub_motors", Logger()),
    "retarder recorded": ("truck", Logger(torque="percent", retarder=True)),
    "power split": ("power_split", Logger()),
    "power split with battery": ("power_split", Logger(battery=True)),
    "parallel hybrid": ("parallel_hybrid", Logger()),
    "mild hybrid": ("mild_hybrid", Logger()),
}
"""Vehicles of the second model by their gearbox, and what records them; dual clutches, automatics
and single gears are among `SECOND_KINDS`."""

CLASSES: Final = {"van": "van", "truck": "truck", "semi": "truck", "electric_bus": "bus"}


@dataclass(frozen=True)
class Subject:
    """One vehicle with its drives.

    Attributes
    ----------
    base : what is known of it before a calibration
    known : drives of a calibration, with the mass at their start [kg]
    drives : drives to weigh by name, with the mass at their end [kg]
    limits : tare and gross mass [kg]; None where not known
    other : drive of another vehicle of the kind; None without
    papers : vehicle file by data sheet alone; None without
    mean : mean mass of the first of ``drives`` [kg]
    """

    base: Vehicle | None
    known: tuple[tuple[Drive, float], ...]
    drives: dict[str, tuple[Drive, float]]
    limits: tuple[float, float] | None = None
    other: Drive | None = None
    papers: Vehicle | None = None
    mean: float = float("nan")


def _own(name: str) -> Subject:
    """Make a vehicle of our simulator."""
    number = list(OWN_KINDS).index(name)
    kind = OWN_KINDS[name]
    rng = np.random.default_rng([SEED, number])
    car, another = random_vehicle(rng, kind), random_vehicle(rng, kind)

    def made(part: float, seed: int, car: SimulatedCar) -> tuple[Drive, float, float, float]:
        load = part * FULL[car.kind] * car.mass
        drawn = scenario(car, rng, load=load, seed=seed, polling=polling(car))
        sensors = replace(drawn.sensors, imu_rate=IMU_RATE, gnss_outages=())
        whole = simulate_car(replace(drawn, duration=DURATION, sensors=sensors))
        drive, mass = without_weather(whole.drive), whole.truth.mass
        info = replace(drive.info, mass=None, vehicle=None)
        return replace(drive, info=info), float(mass[0]), float(mass[-1]), float(np.mean(mass))

    first = 1000 * SEED + 100 * number
    known = [made(part, first + k, car) for k, part in enumerate((0.0, 0.5, 0.9))]
    weighed = made(float(rng.uniform(0.1, 0.8)), first + 10, car)
    other = made(float(rng.uniform(0.1, 0.8)), first + 11, another)
    return Subject(
        base=bare(car),
        known=tuple((drive, begun) for drive, begun, _, _ in known),
        drives={"drive": (weighed[0], weighed[2])},
        limits=(car.mass, 1.05 * (1.0 + FULL[car.kind]) * car.mass),
        other=other[0],
        mean=weighed[3],
    )


def _second(kind: str) -> Subject:
    """Make a vehicle of the second model."""
    number = SECOND_KINDS.index(kind)
    heavy = kind in ("truck", "semi")
    logger = Logger(torque="percent") if heavy else Logger()
    return _driven(second_vehicle(kind, SEED + number), number, logger)


def _of_gearbox(name: str) -> Subject:
    """Make a vehicle of the second model with a gearbox of a kind."""
    kind, logger = GEARBOXES[name]
    number = len(SECOND_KINDS) + list(GEARBOXES).index(name)
    draw = random_variant if kind in VARIANTS else second_vehicle
    return _driven(draw(kind, SEED + number), number, logger)


def _driven(vehicle: SecondVehicle, number: int, logger: Logger) -> Subject:
    """Drive a vehicle of the second model; ``number`` is that of its seeds."""
    kind = vehicle.kind
    heavy = kind in ("truck", "semi")
    room = vehicle.gross - vehicle.tare - 75.0
    plan = {
        "calibration-1": (0.05, "ordinary"),
        "calibration-2": (0.8, "ordinary"),
        "ordinary": (0.5, "ordinary"),
        "motorway": (0.95, "motorway"),
    }
    made = {}
    with tempfile.TemporaryDirectory() as home:
        for k, (name, (part, style)) in enumerate(plan.items()):
            folder = Path(home) / name
            mass = vehicle.tare + 75.0 + part * room
            truth = make_drive(
                folder, vehicle, mass=mass, seed=1000 * SEED + 10 * number + k, style=style,
                duration=DURATION, logger=logger,
            )["mass_kg"]  # fmt: skip
            (folder / "drive.toml").unlink()
            drive = replace(wb.read_drive(folder), name=f"{kind} {name}")
            made[name] = drive, float(truth[0]), float(truth[-1])
    papers = None
    if heavy:
        papers = describe(
            Known(kind="truck", tare=vehicle.tare, gross=vehicle.gross, torque="percent")
        ).vehicle
    return Subject(
        base=Vehicle(name=kind, kind=CLASSES.get(kind, "car")),
        known=tuple((made[n][0], made[n][1]) for n in ("calibration-1", "calibration-2")),
        drives={n: (made[n][0], made[n][2]) for n in ("ordinary", "motorway")},
        papers=papers,
    )


def _foreign(name: str) -> Subject:
    """Read a vehicle of the foreign simulator."""
    home = SHARED / "data" / "foreign-simulator" / name

    def read(drive: str) -> tuple[Drive, float, float]:
        mass = pl.read_parquet(home / drive / "truth.parquet")["mass_kg"]
        return wb.read_drive(home / drive), float(mass[0]), float(mass[-1])

    known = [read(f"calibration-{k}") for k in (1, 2)]
    weighed = {n: read(n) for n in ("drive-1", "drive-2", "drive-3", "drive-4")}
    return Subject(
        base=None,
        known=tuple((drive, begun) for drive, begun, _ in known),
        drives={n: (drive, ended) for n, (drive, _, ended) in weighed.items()},
    )


def _foreign_truck() -> Subject:
    """Read the truck of the foreign simulator."""
    home = SHARED / "data" / "foreign-truck"
    mass = dict(pl.read_csv(home / "masses.csv").iter_rows())
    papers = Vehicle.load(home / "vehicle.toml")
    return Subject(
        base=papers,
        known=tuple((wb.read_drive(home / n), mass[n]) for n in sorted(mass) if n[0] == "c"),
        drives={n: (wb.read_drive(home / n), mass[n]) for n in sorted(mass) if n[0] == "d"},
        papers=papers,
    )


MADE: Final[dict[str, Callable[[], Subject]]] = {
    **{f"own {name}": lambda name=name: _own(name) for name in OWN_KINDS},
    **{f"second {kind}": lambda kind=kind: _second(kind) for kind in SECOND_KINDS},
}
"""Subjects that are simulated, and kept."""

MADE_BY_GEARBOX: Final[dict[str, Callable[[], Subject]]] = {
    f"gearbox {name}": lambda name=name: _of_gearbox(name) for name in GEARBOXES
}
"""Those of `GEARBOXES`, which are seen through fewer equipments."""

READ: Final[dict[str, Callable[[], Subject]]] = {
    "foreign hatchback": lambda: _foreign("hatchback"),
    "foreign wagon": lambda: _foreign("wagon"),
    "foreign truck": _foreign_truck,
}
"""Subjects that are read from recorded data."""


@cache
def folder() -> Path:
    """Where made subjects are kept; those of other sources are removed."""
    digest = hashlib.sha256()
    for path in SOURCES:
        digest.update(path.read_bytes())
    home = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "weighbridge-corpus"
    here = home / digest.hexdigest()[:16]
    here.mkdir(parents=True, exist_ok=True)
    for old in home.iterdir():
        if old != here:
            shutil.rmtree(old, ignore_errors=True)
    return here


@lru_cache(maxsize=1)
def subject(name: str) -> Subject:
    """Return a subject by its name."""
    if name in READ:
        return READ[name]()
    path = folder() / f"{name.replace(' ', '-')}.pickle"
    if not path.exists():
        made = (MADE | MADE_BY_GEARBOX)[name]()
        part = path.with_suffix(f".{os.getpid()}")
        part.write_bytes(pickle.dumps(made, pickle.HIGHEST_PROTOCOL))
        part.replace(path)
    return pickle.loads(path.read_bytes())


def absent(name: str) -> str:
    """Say why a subject cannot be had; empty where it can."""
    if name in MADE | MADE_BY_GEARBOX or (SHARED / "data" / "foreign-truck").is_dir():
        return ""
    return "recorded drives are not here: no folder ../shared/data beside the checkout"
