"""The vehicle: what people write in a vehicle file, checked once, in SI."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Literal, get_args

from weighbridge.arguments import check_all, check_choice, check_text, check_type
from weighbridge.errors import ConfigError
from weighbridge.signals.shown import in_html, in_lines, plural
from weighbridge.vehicle.classes import VEHICLE_CLASSES, VehicleClass
from weighbridge.vehicle.driveline import Driveline, Driven, Layout, Mounting, RoadLoad
from weighbridge.vehicle.possible import MASSES, positive, within
from weighbridge.vehicle.provenance import Provenance
from weighbridge.vehicle.ride import Ride
from weighbridge.vehicle.road import Road, known_value
from weighbridge.vehicle.speed_model import SpeedModel
from weighbridge.vehicle.torque_model import (
    EARLIEST_TORQUE,
    LATEST_TORQUE,
    WITNESS_TERMS,
    DraggedReading,
    SecondSignalRelation,
    Timing,
    TorqueModel,
)
from weighbridge.visible import visible

EngineKind = Literal["petrol", "diesel", "electric"]

_PARTS: Final[dict[str, tuple[type, bool]]] = {
    "driveline": (Driveline, False),
    "torque": (TorqueModel, False),
    "road_load": (RoadLoad, False),
    "mounting": (Mounting, True),
    "timing": (Timing, False),
    "dragged": (DraggedReading, True),
    "speed_model": (SpeedModel, True),
    "ride": (Ride, True),
    "provenance": (Provenance, False),
}
"""Parts of a vehicle by field: their type, and whether they may be None."""


_SHARED: Final = (
    "name", "kind", "type", "engine", "tare", "gross", "mapping", "speed_model", "ride"
)  # fmt: skip
"""Fields that no accelerometer changes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """Everything that is known about one vehicle; see ``VEHICLE.toml``.

    Attributes
    ----------
    name : for people
    kind : name of one of `weighbridge.vehicle.classes.VEHICLE_CLASSES`
    type : make and model; vehicles of a fleet with the same type share errors of their torque
    engine : "petrol", "diesel" or "electric"; None where it is not known
    tare : mass without payload [kg]
    gross : permitted mass [kg]
    mapping : path of a mapping TOML for its logs
    dragged : what the torque source reads without a foot on the accelerator; None where it was
        not calibrated, or its drives did not show it
    witnesses : how that source varies with a second signal of the engine
    speed_model : for ``--method speed-ekf``; None where it was not calibrated
    without_accelerometer : what its drives show where their accelerometer is left out, by which
        drives that record none are weighed; None where the calibration had none, or too little
    """

    name: str = "vehicle"
    kind: str = "car"
    type: str | None = None
    engine: EngineKind | None = None
    tare: float | None = None
    gross: float | None = None
    mapping: str | None = None
    driveline: Driveline = field(default_factory=Driveline)
    torque: TorqueModel = field(default_factory=TorqueModel)
    road_load: RoadLoad = field(default_factory=RoadLoad)
    mounting: Mounting | None = None
    timing: Timing = field(default_factory=Timing)
    dragged: DraggedReading | None = None
    witnesses: tuple[SecondSignalRelation, ...] = ()
    speed_model: SpeedModel | None = None
    ride: Ride | None = None
    provenance: Provenance = field(default_factory=Provenance)
    without_accelerometer: Vehicle | None = None

    def __post_init__(self) -> None:
        check_text("name", self.name)
        check_text("kind", self.kind)
        for name in ("type", "engine", "mapping"):
            check_text(name, getattr(self, name), optional=True)
        for name, (part, optional) in _PARTS.items():
            if not (optional and getattr(self, name) is None):
                check_type(name, getattr(self, name), part, f"a {part.__name__}")
        if self.without_accelerometer is not None:
            check_type("without_accelerometer", self.without_accelerometer, Vehicle, "a Vehicle")
        check_all("witnesses", self.witnesses, SecondSignalRelation, "SecondSignalRelation")
        check_choice("class", self.kind, VEHICLE_CLASSES)
        if self.engine is not None:
            check_choice("engine", self.engine, get_args(EngineKind))
        for name in ("tare", "gross"):
            positive(name, getattr(self, name))
            within(name, getattr(self, name), *MASSES, "kg")
        signals = [second_signal.signal for second_signal in self.witnesses]
        if len(set(signals)) < len(signals):
            raise ConfigError(f"each second signal may be named once, got {', '.join(signals)}")
        if self.mapping is not None and visible(self.mapping) != self.mapping:
            raise ConfigError(
                f"mapping must be a path without control characters, got {self.mapping!r}"
            )

    def __repr__(self) -> str:
        return in_lines(self._summary())

    def _repr_html_(self) -> str:
        return in_html(self._summary())

    def _summary(self) -> tuple[str, str, str]:
        """Name and masses, gears and torque, calibration."""
        masses = [
            f"{name} {mass:.0f} kg"
            for name, mass in (("tare", self.tare), ("permitted mass", self.gross))
            if mass is not None
        ]
        kind = f"{self.engine} {self.kind}" if self.engine is not None else self.kind
        gears = len(self.driveline.gearings)
        unknown = "stepless" if self.driveline.stepless else "gears not known"
        known = plural(gears, "gear") if gears else unknown
        made = self.provenance
        when = f" on {made.date}" if made.date else ""
        by = f"calibrated{when} by {plural(len(made.masses), 'drive')}"
        return (
            ", ".join([f"Vehicle {self.name!r}: {kind}", *masses]),
            f"{known}; torque by {self.torque.source}",
            by if made.masses else "never calibrated",
        )

    def by_speed(self) -> Vehicle:
        """Return the vehicle as a drive without an accelerometer is weighed; itself if unknown."""
        other = self.without_accelerometer
        if other is None:
            return self
        return replace(other, **{name: getattr(self, name) for name in _SHARED})

    @property
    def of_class(self) -> VehicleClass:
        """What vehicles of its class have in common."""
        return VEHICLE_CLASSES[self.kind]

    @property
    def road(self) -> Road:
        """Road load and inertias it is weighed with: as stated, else as usual for its class."""
        line, load = self.driveline, self.road_load
        stated = (
            (load.drag_area, load.drag_area_std),
            (load.rolling_coefficient, load.rolling_coefficient_std),
            (line.engine_inertia, line.engine_inertia_std),
            (line.wheel_inertia, line.wheel_inertia_std),
        )
        mean, std = self.of_class.road_prior(single_speed=line.single_speed)
        calibrated = self.provenance.mass_scale_std is not None
        return Road(
            *(
                known_value(*said, (float(m), float(s)), calibrated=calibrated)
                for said, m, s in zip(stated, mean, std, strict=True)
            )
        )

    @classmethod
    def load(cls, path: str | Path) -> Vehicle:
        """Read a vehicle file; see `weighbridge.vehicle.file.load_vehicle`."""
        from weighbridge.vehicle.file import load_vehicle

        return load_vehicle(path, cls)

    def save(self, path: str | Path) -> None:
        """Write a vehicle file; see `weighbridge.vehicle.file.save_vehicle`."""
        from weighbridge.vehicle.file import save_vehicle

        save_vehicle(self, path)


__all__ = [
    "EARLIEST_TORQUE",
    "LATEST_TORQUE",
    "WITNESS_TERMS",
    "DraggedReading",
    "Driveline",
    "Driven",
    "EngineKind",
    "Layout",
    "Mounting",
    "Provenance",
    "Ride",
    "RoadLoad",
    "SecondSignalRelation",
    "SpeedModel",
    "Timing",
    "TorqueModel",
    "Vehicle",
]
