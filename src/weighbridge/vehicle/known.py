"""A vehicle from what its owner knows: papers, tyres, data sheet."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, get_args

from weighbridge.arguments import choice_fault
from weighbridge.signals.tomlfile import Faults
from weighbridge.vehicle.classes import VEHICLE_CLASSES
from weighbridge.vehicle.data_sheet import RADIUS_STD, usual_efficiency
from weighbridge.vehicle.model import (
    Driveline,
    Driven,
    EngineKind,
    Layout,
    Provenance,
    RoadLoad,
    TorqueModel,
    Vehicle,
)
from weighbridge.vehicle.possible import positive, within
from weighbridge.vehicle.torque_sources import TORQUE_SOURCES
from weighbridge.vehicle.tyre import rolling_radius

RADII: Final = (0.15, 0.9)
"""Rolling radii of road vehicles, wide enough for any [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """What an owner may know; None where it is not known.

    Attributes
    ----------
    name : for people
    kind : name of its class
    engine : "petrol", "diesel" or "electric"
    tare : mass of the empty vehicle; of an EU registration document field G, driver of 75 kg and
        fuel included [kg]
    gross : permitted mass, field F.1 or F.2 [kg]
    tyre : size as on its side, such as ``205/55 R16``
    radius : rolling radius of the driven wheels, in place of the tyre [m]
    driven : which axles are: "front", "rear" or "all"
    gear_ratios : of the gears, falling; of an electric car 1 alone where ``final_drive`` has all
    final_drive : ratio behind the gearbox; 1 when None
    torque : how the drives have their torque, by the name of its source
    reference_torque : 100 % of a torque in percent [N m]
    drag_coefficient, frontal_area : [-], [m^2]
    layout : how the engine lies, "transverse" or "longitudinal"
    mapping : path of the mapping of its logs, as seen from the vehicle file
    """

    name: str = "vehicle"
    kind: str = "car"
    engine: EngineKind | None = None
    tare: float | None = None
    gross: float | None = None
    tyre: str | None = None
    radius: float | None = None
    driven: Driven | None = None
    gear_ratios: Sequence[float] = ()
    final_drive: float | None = None
    torque: str | None = None
    reference_torque: float | None = None
    drag_coefficient: float | None = None
    frontal_area: float | None = None
    layout: Layout | None = None
    mapping: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Described:
    """A vehicle and where its numbers come from.

    Attributes
    ----------
    vehicle
    origins : by section and field of the vehicle file, where a number is from and how sure it is
    """

    vehicle: Vehicle
    origins: dict[tuple[str, str], str]


def describe(known: Known) -> Described:
    """Make a vehicle of what is known, and of its class for the rest.

    Parameters
    ----------
    known

    Returns
    -------
    Described
        Its torque is that of the vehicle's control unit, or missing where only a calibration
        can find it.

    Raises
    ------
    ConfigError
        Values are impossible, or some are missing that others need: all of them are named.
    """
    _refuse(known)
    origins: dict[tuple[str, str], str] = {}
    driveline = _driveline(known, origins)
    torque = TorqueModel()
    if known.torque is not None:
        torque = TorqueModel(source=known.torque, reference_torque=known.reference_torque)
        origins["torque", "source"] = "given"
    vehicle = Vehicle(
        name=known.name,
        kind=known.kind,
        engine=known.engine,
        mapping=known.mapping,
        tare=known.tare,
        gross=known.gross,
        driveline=driveline,
        torque=torque,
        road_load=_road_load(known, origins),
        provenance=Provenance(notes=_notes(known)),
    )
    if driveline.efficiency is None:
        mean, std = usual_efficiency(vehicle)
        origins["driveline", "efficiency"] = f"not given; taken as {mean:.3f}, std {std:.3f}"
    return Described(vehicle=vehicle, origins=origins)


def _notes(known: Known) -> str:
    remarks = ["written by weighbridge vehicle new; nothing is calibrated"]
    if known.torque is not None and not TORQUE_SOURCES[known.torque].signed:
        remarks.append(f"torque by {known.torque.replace('_', ' ')}, which calibrate finds")
    return "; ".join(remarks)


def _refuse(known: Known) -> None:
    """Report all that is wrong at once."""
    faults = Faults()
    faults.said += _wrong_choices(known)
    if known.kind in VEHICLE_CLASSES:
        faults.said += _wrong_masses(known)
    faults.said += _wrong_gears(known)
    if known.radius is not None and known.tyre is not None:
        faults.said.append("a tyre has its rolling radius; give the tyre or the radius")
    with faults.gathered():
        within("radius", known.radius, *RADII, "m")
    if known.tyre is not None:
        with faults.gathered():
            rolling_radius(known.tyre)
    for name in ("drag_coefficient", "frontal_area", "reference_torque"):
        with faults.gathered():
            positive(name.replace("_", " "), getattr(known, name))
    if (known.drag_coefficient is None) != (known.frontal_area is None):
        faults.said.append("drag coefficient and frontal area belong together; give both or none")
    source = TORQUE_SOURCES.get(known.torque or "")
    if known.reference_torque is not None and not (source and source.needs_reference):
        faults.said.append(
            "a reference torque is that of a torque in percent; name percent as well"
        )
    faults.refuse()


def _wrong_choices(known: Known) -> Iterator[str]:
    for name, value, choice in (
        ("class", known.kind, tuple(VEHICLE_CLASSES)),
        ("engine", known.engine, get_args(EngineKind)),
        ("torque", known.torque, tuple(TORQUE_SOURCES)),
        ("driven", known.driven, get_args(Driven)),
        ("layout", known.layout, get_args(Layout)),
    ):
        if value is not None and (fault := choice_fault(name, value, choice)):
            yield fault


def _wrong_masses(known: Known) -> Iterator[str]:
    low, high = VEHICLE_CLASSES[known.kind].mass_range
    for name, mass in (("tare", known.tare), ("gross", known.gross)):
        if mass is not None and not low <= mass <= high:
            yield (
                f"{name} of {mass:g} kg: a {known.kind} has {low:.0f} to {high:.0f} kg; "
                "check the unit (1 lb is 0.4536 kg) and the class"
            )
    if known.tare is not None and known.gross is not None and known.gross <= known.tare:
        yield (
            f"gross of {known.gross:g} kg is not above the tare of {known.tare:g} kg; "
            "gross is the permitted mass, tare the empty one"
        )


def _wrong_gears(known: Known) -> Iterator[str]:
    if any(b >= a for a, b in pairwise(known.gear_ratios)):
        yield f"gear ratios must fall from first to last gear, got {list(known.gear_ratios)}"
    final = 1.0 if known.final_drive is None else known.final_drive
    if any(ratio <= 0.0 for ratio in (*known.gear_ratios, final)):
        yield "gear ratios and final drive must be positive"
    if known.final_drive is not None and not known.gear_ratios and known.engine != "electric":
        yield "a final drive needs gear ratios, such as 3.8,2.1,1.4,1.0"


def _radius(known: Known, origins: dict[tuple[str, str], str]) -> float:
    """Rolling radius [m]: given, else of the tyre, else of the usual one."""
    tyre = known.tyre or VEHICLE_CLASSES[known.kind].tyre
    origins["driveline", "wheel_radius"] = (
        "given"
        if known.radius is not None
        else f"of {tyre}, std {100.0 * RADIUS_STD:.1f} %"
        if known.tyre
        else f"of {tyre}, usual for a {known.kind}, std 6 %"
    )
    return known.radius if known.radius is not None else round(rolling_radius(tyre), 4)


def _driveline(known: Known, origins: dict[tuple[str, str], str]) -> Driveline:
    radius = _radius(known, origins)
    ratios = tuple(known.gear_ratios)
    if not ratios and known.engine == "electric" and known.final_drive is not None:
        ratios = (1.0,)
    factor = (known.final_drive or 1.0) / radius
    if ratios:
        origins["driveline", "gearings"] = "of ratios and rolling radius"
    single = known.engine == "electric" or len(ratios) == 1
    mean, std = VEHICLE_CLASSES[known.kind].road_prior(single_speed=single)
    for name, k in (("engine_inertia", 2), ("wheel_inertia", 3)):
        origins["driveline", name] = f"usual for a {known.kind}, std {std[k]:.2g}"
    return Driveline(
        gearings=tuple(round(ratio * factor, 3) for ratio in ratios),
        engine_inertia=float(mean[2]),
        wheel_inertia=float(mean[3]),
        wheel_radius=radius,
        layout=known.layout,
        driven=known.driven,
    )


def _road_load(known: Known, origins: dict[tuple[str, str], str]) -> RoadLoad:
    mean, std = VEHICLE_CLASSES[known.kind].road_prior(single_speed=False)
    area = float(mean[0])
    origins["road_load", "drag_area"] = f"usual for a {known.kind}, std {std[0]:.2g}"
    if known.drag_coefficient is not None and known.frontal_area is not None:
        area = round(known.drag_coefficient * known.frontal_area, 4)
        origins["road_load", "drag_area"] = "of drag coefficient and frontal area, given"
    origins["road_load", "rolling_coefficient"] = f"usual for a {known.kind}, std {std[1]:.2g}"
    return RoadLoad(drag_area=area, rolling_coefficient=float(mean[1]))
