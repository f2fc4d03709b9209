"""What the benchmark is made of: slices, the vehicles of each, and their drives."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.arguments import check_choice
from weighbridge.errors import ConfigError
from weighbridge.simulation.car import SimulatedCar
from weighbridge.simulation.named import TORQUE_POLLING, usual_polling
from weighbridge.simulation.route import RoadKind, Route, mixed_route
from weighbridge.simulation.scenario import Scenario, Sensors
from weighbridge.simulation.vehicles import VehicleKind, random_habits, random_vehicle

CLASSES: Final[dict[str, tuple[VehicleKind, ...]]] = {
    "car": ("petrol_manual", "petrol_dct", "diesel_automatic"),
    "electric": ("electric",),
    "van": ("van",),
    "truck": ("truck",),
    "bus": ("bus",),
}
"""Kinds of vehicles of each class; slices take them in turn."""

EQUIPMENT: Final = {
    "imu-50hz": "inertial sensor at 50 Hz, GNSS at 1 Hz, vehicle bus as usual",
    "imu-10hz": "inertial sensor at 10 Hz, GNSS at 1 Hz, vehicle bus as usual",
    "no-imu": "GNSS at 1 Hz, vehicle bus as usual",
    "obd-1hz": "inertial sensor at 50 Hz, GNSS at 1 Hz, vehicle bus at 1 Hz",
}
"""What records a drive."""

CALIBRATIONS: Final = {"three": 3, "one": 1, "sheet": 0}
"""Drives of known mass beside the data sheet of a vehicle."""

ROUTES: Final[dict[str, tuple[tuple[RoadKind, float], ...]]] = {
    "country": (("city", 0.05), ("country", 0.95)),
    "town": (("city", 0.8), ("hills", 0.2)),
    "highway": (("city", 0.05), ("highway", 0.95)),
    "mixed": (("city", 0.15), ("country", 0.35), ("hills", 0.1), ("highway", 0.4)),
}
"""Roads of the drives to weigh, as parts of the way out; calibrations are driven on the last."""

LABELS: Final = ("class", "equipment", "calibration", "route")
"""Columns by which the score is split."""

_ROOM: Final = {"car": 0.3, "electric": 0.3, "van": 0.65, "truck": 0.85, "bus": 0.7}
"""Largest load over the empty mass [-]: 2.1, 3.5, 18 and 12 t of the named vehicles."""

_KNOWN_LOADS: Final = (0.0, 0.5, 0.9)
"""Loads of the calibrations over the largest [-]."""

_FASTEST: Final = 38.0
"""No drive is longer than at this speed all the time [m/s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchmarkSettings:
    """How large a benchmark is; the same settings give the same drives.

    Attributes
    ----------
    seed : of everything random
    vehicles : of each slice of class, equipment and calibration
    drives : to weigh, of each vehicle
    minutes : length of a drive
    only : names of classes, equipment or calibrations; no vehicle without one of each kind named

    Raises
    ------
    ConfigError
        A number is out of its range, or a name is none of a slice.
    """

    seed: int = 1
    vehicles: int = 1
    drives: int = 4
    minutes: float = 20.0
    only: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, high in (("vehicles", 99), ("drives", 99)):
            value = getattr(self, name)
            if not 1 <= value <= high:
                raise ConfigError(f"{name} must be 1 to {high}, got {value}")
        if not 5.0 <= self.minutes <= 60.0:
            raise ConfigError(f"minutes must be 5 to 60, got {self.minutes:g}")
        for name in self.only:
            check_choice("--only", name, (*CLASSES, *EQUIPMENT, *CALIBRATIONS))


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedVehicle:
    """One vehicle of the benchmark.

    Attributes
    ----------
    name : of its folder
    of_class, equipment, calibration : its slice
    kind : of `random_vehicle`
    car : as simulated
    seed : of its drives
    settings
    """

    name: str
    of_class: str
    equipment: str
    calibration: str
    kind: VehicleKind
    car: SimulatedCar
    seed: int
    settings: BenchmarkSettings

    @property
    def gross(self) -> float:
        """Permitted mass [kg]."""
        return 10.0 * math.ceil((1.0 + _ROOM[self.of_class]) * self.car.mass / 10.0)

    def routes(self) -> dict[str, str]:
        """Road of each drive to weigh, by the name of the drive."""
        roads = itertools.cycle(ROUTES)
        return {f"drive-{k + 1}": next(roads) for k in range(self.settings.drives)}

    def known(self) -> list[Scenario]:
        """Draw the drives of known mass."""
        loads = _KNOWN_LOADS[: CALIBRATIONS[self.calibration]]
        return [
            self._scenario(f"calibration-{k + 1}", "mixed", part, 1000 + k)
            for k, part in enumerate(loads)
        ]

    def weighed(self) -> list[Scenario]:
        """Draw the drives to weigh."""
        return [
            self._scenario(name, route, None, k)
            for k, (name, route) in enumerate(self.routes().items())
        ]

    def _scenario(self, name: str, route: str, part: float | None, number: int) -> Scenario:
        rng = np.random.default_rng([self.seed, number])
        if part is None:
            part = float(rng.uniform(0.0, 1.0))
        seconds = 60.0 * self.settings.minutes
        polling = TORQUE_POLLING if self.by_percent else usual_polling(self.car)
        if self.equipment == "obd-1hz":
            polling = replace(polling, rate=1.0)
        made = Scenario(
            name=name,
            car=self.car,
            route=_road(rng, route, seconds * min(_FASTEST, self.car.top_speed)),
            payload=part * _ROOM[self.of_class] * self.car.mass,
            seed=int(rng.integers(2**31)),
            habits=random_habits(rng),
            sensors=Sensors(imu_rate=_IMU_RATE[self.equipment]),
            polling=polling,
            wind_speed=float(rng.uniform(0.0, 10.0)),
            wind_from=float(rng.uniform(0.0, 2.0 * math.pi)),
            ambient_temperature=float(rng.uniform(268.0, 303.0)),
            aggressiveness=float(rng.uniform(0.8, 1.25)),
            duration=seconds,
        )
        return replace(made, effects=replace(made.effects, warm_up=float(rng.uniform(0.0, 1.0))))

    @property
    def by_percent(self) -> bool:
        """Whether it sends its engine's torque in percent: no other reading weighs uncalibrated."""
        combustion = not self.car.electric
        return combustion and self.calibration == "sheet" and self.of_class not in ("truck", "bus")


def plan(settings: BenchmarkSettings) -> Iterator[PlannedVehicle]:
    """Draw the vehicles of a benchmark, each by itself: others do not change it."""
    for number in range(settings.vehicles):
        for names in itertools.product(CLASSES, EQUIPMENT, CALIBRATIONS):
            if not all(
                _wanted(settings.only, name, of) for name, of in zip(names, _SLICES, strict=True)
            ):
                continue
            of_class, equipment, calibration = names
            place = [list(of).index(name) for name, of in zip(names, _SLICES, strict=True)]
            kinds = CLASSES[of_class]
            kind = kinds[(number + place[1] + place[2]) % len(kinds)]
            rng = np.random.default_rng([settings.seed, number, *place])
            yield PlannedVehicle(
                name=f"{of_class}-{equipment}-{calibration}-{number + 1}",
                of_class=of_class,
                equipment=equipment,
                calibration=calibration,
                kind=kind,
                car=random_vehicle(rng, kind),
                seed=int(rng.integers(2**31)),
                settings=settings,
            )


_SLICES: Final[tuple[Mapping[str, object], ...]] = (CLASSES, EQUIPMENT, CALIBRATIONS)

_IMU_RATE: Final = {"imu-50hz": 50.0, "imu-10hz": 10.0, "no-imu": 0.0, "obd-1hz": 50.0}


def _wanted(only: tuple[str, ...], name: str, of: Mapping[str, object]) -> bool:
    """Whether a name is among those asked for, or none of its kind is."""
    asked = [one for one in only if one in of]
    return not asked or name in asked


def _road(rng: np.random.Generator, name: str, length: float) -> Route:
    """Draw a road out and back, at least as long as a drive."""
    out = [(kind, float(round(0.5 * part * length))) for kind, part in ROUTES[name]]
    return mixed_route(
        int(rng.integers(2**31)),
        out=out,
        back=out[::-1],
        heading=float(rng.uniform(0.0, 2.0 * math.pi)),
        name=name,
    )
