"""``VEHICLE.toml``: written for people, read with care.

One table says what every key is, in which unit it is written and which field
it fills; loading, saving and the comments all follow it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, Literal

import tomlkit
from tomlkit.items import Table

from weighbridge.errors import ConfigError
from weighbridge.signals.tomlfile import Section, exact_text, read_toml
from weighbridge.vehicle.model import (
    FORMAT_VERSION,
    WITNESS_TERMS,
    DraggedReading,
    Driveline,
    Mounting,
    Provenance,
    Ride,
    RoadLoad,
    SpeedModel,
    Timing,
    TorqueModel,
    Vehicle,
    WitnessRelation,
)
from weighbridge.whole import write_whole

Kind = Literal["text", "texts", "number", "numbers", "count"]


@dataclass(frozen=True, slots=True)
class _Key:
    """One key: ``stem_suffix`` + ``tail``, or the stem alone for a bare number."""

    stem: str
    field: str
    comment: str
    kind: Kind = "number"
    suffix: str = ""
    tail: str = ""
    pair: bool = False

    @property
    def name(self) -> str:
        return (f"{self.stem}_{self.suffix}" if self.suffix else self.stem) + self.tail


_PER_MPS2: Final = "_per_mps2"

# A comment that does not fit behind its key goes above it.
_LINE: Final = 90

_VEHICLE: Final = (
    _Key("name", "name", "for people", "text"),
    _Key("class", "kind", "such as car, van, bus or truck", "text"),
    _Key("tare", "tare", "mass without payload; the payload is counted from it", suffix="kg"),
    _Key("gross", "gross", "permitted mass", suffix="kg"),
    _Key("mapping", "mapping", "mapping TOML of its logs, seen from this file's folder", "text"),
)

_WITNESS: Final = (
    _Key(
        "coefficients",
        "coefficients",
        "reading = c0 + c1 w + c2 w N + c3 w^2, by a battery c0 + c1 w + c2 / N; w and N as parts "
        "of the upper ends of their ranges",
        "numbers",
    ),
    _Key("scatter", "scatter", "standard deviation about it; a share for load, else N m"),
    _Key("span", "span", "range of the reading"),
    _Key("scale_std", "scale_std", "by how much its scale differs between drives"),
    _Key("value_range", "value_range", "w it has seen, in SI", "numbers", pair=True),
    _Key("speed_range", "speed_range", "N it has seen", "numbers", "rpm", pair=True),
    _Key("blur", "blur", "by how much the reading is smoother than w", suffix="s"),
    _Key("lag", "lag", "by how much it is later than w", suffix="s"),
    _Key("unexplained", "unexplained", "part of its variance that w leaves"),
    _Key("pressure", "pressure", "of the air on the drives", suffix="kpa"),
    _Key("temperature", "temperature", "of the air on the drives", suffix="degc"),
)

_SECTIONS: Final[dict[str, tuple[type[Any], tuple[_Key, ...]]]] = {
    "driveline": (
        Driveline,
        (
            _Key(
                "gearings_per_m",
                "gearings",
                "engine radians per metre travelled, gear by gear: ratio * final drive / radius",
                "numbers",
            ),
            _Key("gearing_stds_per_m", "gearing_stds", "their standard deviations", "numbers"),
            _Key(
                "engine_inertia", "engine_inertia", "all that turns with the engine", suffix="kgm2"
            ),
            _Key(
                "engine_inertia_std",
                "engine_inertia_std",
                "its standard deviation; 0 where a bound held it",
                suffix="kgm2",
            ),
            _Key("wheel_inertia", "wheel_inertia", "all wheels together", suffix="kgm2"),
            _Key(
                "wheel_inertia_std",
                "wheel_inertia_std",
                "its standard deviation; 0 where a bound held it",
                suffix="kgm2",
            ),
            _Key("wheel_radius", "wheel_radius", "effective rolling radius", suffix="m"),
            _Key("driven", "driven", "which axles are: front, rear or all", "text"),
            _Key("layout", "layout", "of a car or van: transverse or longitudinal", "text"),
            _Key(
                "efficiency",
                "efficiency",
                "wheel over engine power; 1 where torque was calibrated at the wheels",
            ),
            _Key("speed_scale", "speed_scale", "indicated over true speed"),
            _Key("idle_speed", "idle_speed", "0 for a motor that stands", suffix="rpm"),
        ),
    ),
    "torque": (
        TorqueModel,
        (
            _Key("source", "source", "how torque is found, such as load or measured", "text"),
            _Key(
                "coefficients",
                "coefficients",
                "in SI; load: w0, w1 per load, w2, w3 ... per power of engine speed; "
                "measured and percent: offset, scale, then powers of engine speed",
                "numbers",
            ),
            _Key("coefficient_stds", "coefficient_stds", "their standard deviations", "numbers"),
            _Key("curvature", "curvature", "of load * engine speed and of load^2", "numbers"),
            _Key("curvature_stds", "curvature_stds", "their standard deviations", "numbers"),
            _Key("knots", "knots", "engine speeds of a correction of w1", "numbers", "rpm"),
            _Key("knot_slopes", "knot_slopes", "the correction there", "numbers"),
            _Key(
                "reference_torque",
                "reference_torque",
                "100 % torque, where the drive does not say it",
                suffix="nm",
            ),
            _Key("engine_efficiency", "engine_efficiency", "shaft over fuel power, for air_flow"),
            _Key("noise", "noise", "standard deviation of the torque", suffix="nm"),
            _Key("scale_std", "scale_std", "of a torque never calibrated: how sure its scale is"),
            _Key("load_range", "load_range", "loads the fit has seen", "numbers", "pct", pair=True),
            _Key(
                "speed_range",
                "speed_range",
                "engine speeds the fit has seen",
                "numbers",
                "rpm",
                pair=True,
            ),
        ),
    ),
    "road_load": (
        RoadLoad,
        (
            _Key("drag_area", "drag_area", "drag coefficient times frontal area", suffix="m2"),
            _Key("rolling_coefficient", "rolling_coefficient", "rolling resistance over weight"),
            _Key(
                "rolling_speed_coefficient_s_per_m",
                "rolling_speed_coefficient",
                "what is added to it per m/s of speed",
            ),
            _Key("drag_area_std", "drag_area_std", "its standard deviation", suffix="m2"),
            _Key("rolling_coefficient_std", "rolling_coefficient_std", "its standard deviation"),
        ),
    ),
    "mounting": (
        Mounting,
        (
            _Key(
                "roll",
                "roll",
                "sensor to body axes (forward, right, down): about x first",
                suffix="deg",
            ),
            _Key("pitch", "pitch", "then about y", suffix="deg"),
            _Key("yaw", "yaw", "then about z", suffix="deg"),
            _Key("std", "std", "standard deviations of the three", "numbers", "deg"),
            _Key(
                "squat",
                "squat",
                "nose-up lean of the body per forward acceleration",
                suffix="deg",
                tail=_PER_MPS2,
            ),
            _Key("squat_std", "squat_std", "its standard deviation", suffix="deg", tail=_PER_MPS2),
        ),
    ),
    "timing": (
        Timing,
        (
            _Key("torque_delay", "torque_delay", "how late torque or load is stamped", suffix="s"),
            _Key("torque_delay_std", "torque_delay_std", "its standard deviation", suffix="s"),
            _Key("torque_lag", "torque_lag", "time constant of its smoothing", suffix="s"),
        ),
    ),
    "dragged": (
        DraggedReading,
        (
            _Key(
                "engine_speed",
                "engine_speed",
                "engine dragged, no foot on the accelerator: at these speeds",
                "numbers",
                "rpm",
            ),
            _Key(
                "level",
                "level",
                "it reads so little: a share for load and percent, else N m, kg/s",
                "numbers",
            ),
            _Key("scatter", "scatter", "standard deviation of such readings"),
            _Key("span", "span", "range of the reading up to the highest"),
            _Key("reach", "reach", "how far above the level idle charge may lift it"),
        ),
    ),
    "speed_model": (
        SpeedModel,
        (
            _Key("mass", "mass", "known mass of the fit; the filter starts there", suffix="kg"),
            _Key("sample_time", "sample_time", "windows of the speed's means", suffix="s"),
            _Key("force_gain_per_m", "force_gain", "a1, traction force per engine torque"),
            _Key("drag_kg_per_m", "drag", "a2, air density times drag area"),
            _Key("rolling_coefficient", "rolling_coefficient", "f_r, rolling resistance / weight"),
            _Key("rotating_mass", "rotating_mass", "m_r of wheels and driveline", suffix="kg"),
            _Key("corrections", "corrections", "p1 to p7 of the fit, in SI", "numbers"),
            _Key("r_squared", "r_squared", "part of the speed's changes that the fit explains"),
            _Key("samples", "samples", "windows of the fit", "count"),
            _Key("scale_std", "scale_std", "part of any mass found so, as standard deviation"),
        ),
    ),
    "ride": (
        Ride,
        (
            _Key(
                "front_stiffness",
                "front_stiffness",
                "of the spring at each front wheel",
                suffix="npm",
            ),
            _Key(
                "rear_stiffness", "rear_stiffness", "of the spring at each rear wheel", suffix="npm"
            ),
            _Key(
                "front_damping", "front_damping", "of the damper at each front wheel", suffix="nspm"
            ),
            _Key("rear_damping", "rear_damping", "of the damper at each rear wheel", suffix="nspm"),
            _Key("front_track", "front_track", "between the front wheels", suffix="m"),
            _Key("rear_track", "rear_track", "between the rear wheels", suffix="m"),
            _Key(
                "front_axle",
                "front_axle",
                "from the centre of gravity to the front axle",
                suffix="m",
            ),
            _Key(
                "rear_axle", "rear_axle", "from the centre of gravity to the rear axle", suffix="m"
            ),
            _Key("front_unsprung", "front_unsprung", "front axle and its wheels", suffix="kg"),
            _Key("rear_unsprung", "rear_unsprung", "rear axle and its wheels", suffix="kg"),
            _Key("sprung_mass", "sprung_mass", "roughly; an estimate begins here", suffix="kg"),
            _Key("roll_inertia", "roll_inertia", "of the sprung mass, roughly", suffix="kgm2"),
            _Key("pitch_inertia", "pitch_inertia", "of the sprung mass, roughly", suffix="kgm2"),
            _Key(
                "zero_mass",
                "zero_mass",
                "sprung mass with which the travel sensors read zero at rest",
                suffix="kg",
            ),
            _Key(
                "force_std",
                "force_std",
                "part by which all springs and dampers together may be off",
            ),
            _Key(
                "travel_noise", "travel_noise", "of one sample, as standard deviation", suffix="m"
            ),
            _Key("rate_noise", "rate_noise", "of one sample", suffix="mps"),
            _Key(
                "vertical_velocity_noise", "vertical_velocity_noise", "of one sample", suffix="mps"
            ),
            _Key("roll_rate_noise", "roll_rate_noise", "of one sample", suffix="radps"),
            _Key("pitch_rate_noise", "pitch_rate_noise", "of one sample", suffix="radps"),
        ),
    ),
    "provenance": (
        Provenance,
        (
            _Key("drives", "drives", "drives of the calibration", "texts"),
            _Key("masses", "masses", "their known masses", "numbers", "kg"),
            _Key("date", "date", "of the calibration", "text"),
            _Key("r_squared", "r_squared", "of the torque fit"),
            _Key("residual_std", "residual_std", "of the torque fit", suffix="nm"),
            _Key("samples", "samples", "used by the fit", "count"),
            _Key("method", "method", "what was fitted: joint, rls or speed-ekf", "text"),
            _Key("motion", "motion", "how the motion of the drives was found", "text"),
            _Key(
                "mass_scale_std",
                "mass_scale_std",
                "part of any mass weighed with this file, as standard deviation",
            ),
            _Key(
                "fit_cov",
                "fit_cov",
                "what the fit leaves open beside that part, lower triangle in SI: coefficients, "
                "curvature, knot slopes, drag area, rolling coefficient, engine and wheel inertia",
                "numbers",
            ),
            _Key("notes", "notes", "free text", "text"),
            _Key("doubts", "doubts", "of its masses, told at each weighing", "texts"),
        ),
    ),
}


def load_vehicle(path: str | Path) -> Vehicle:
    """Read a vehicle file.

    Parameters
    ----------
    path : the TOML file; a mapping it names is looked for beside it

    Returns
    -------
    Vehicle

    Raises
    ------
    ConfigError
        A key is unknown, a value impossible, a unit missing, or the file's
        version another one; the message names file, line, value and remedy.
    """
    path = Path(path)
    root = read_toml(path)
    _check_version(root)
    sections: dict[str, Any] = {}
    for name, (build, keys) in _SECTIONS.items():
        section = root.section(name)
        if section is None:
            continue
        values = {key.field: value for key in keys if (value := _value(section, key)) is not None}
        if name == "driveline":
            _alternative_gearings(section, values)
        elif name == "road_load":
            _alternative_drag(section, values)
        elif name == "provenance":
            section.count("format_version")
        section.done()
        _refuse_gaps(section, build, keys, values)
        sections[name] = _built(build, section, values)
    sections["witnesses"] = _witnesses(root)
    section = root.section("vehicle") or Section({}, root.name, root.lines, ("vehicle",))
    values = {key.field: value for key in _VEHICLE if (value := _value(section, key)) is not None}
    section.done()
    root.done()
    vehicle: Vehicle = _built(Vehicle, section, {**values, **sections})
    return vehicle


def _witnesses(root: Section) -> tuple[WitnessRelation, ...]:
    """Read what other signals of the engine say of the torque's reading."""
    every = root.section("witnesses")
    if every is None:
        return ()
    found = []
    for signal in WITNESS_TERMS:
        section = every.section(signal)
        if section is None:
            continue
        values = {
            key.field: value for key in _WITNESS if (value := _value(section, key)) is not None
        }
        section.done()
        values["signal"] = signal
        _refuse_gaps(section, WitnessRelation, _WITNESS, values)
        found.append(_built(WitnessRelation, section, values))
    every.done()
    return tuple(found)


def save_vehicle(
    vehicle: Vehicle, path: str | Path, origins: Mapping[tuple[str, str], str] | None = None
) -> None:
    """Write a vehicle file, with a comment to every key.

    `load_vehicle` gives the same vehicle back to the last bit.

    Parameters
    ----------
    vehicle
    path : the file
    origins : by section and field, where a number is from, for its comment; what has none and is
        as without a file is left out

    Raises
    ------
    ConfigError
        The file cannot be written.
    """
    path = Path(path)
    document = tomlkit.document()
    document.add(tomlkit.comment("A vehicle for weighbridge; every key carries its unit."))
    document.add("vehicle", _table(_VEHICLE, vehicle))
    for name, (_, keys) in _SECTIONS.items():
        part = getattr(vehicle, name)
        if part is None:
            continue
        origin = None
        if origins is not None:
            origin = {field: text for (of, field), text in origins.items() if of == name}
        table = _table(keys, part, origin)
        if name == "provenance":
            version = tomlkit.item(FORMAT_VERSION)
            version.comment("of this file")
            table.add("format_version", version)
        if len(table):
            document.add(name, table)
    if vehicle.witnesses:
        every = tomlkit.table(is_super_table=True)
        for witness in vehicle.witnesses:
            every.add(witness.signal, _table(_WITNESS, witness))
        document.add("witnesses", every)
    write_whole(path, tomlkit.dumps(document))


def _refuse_gaps(
    section: Section, build: type[Any], keys: tuple[_Key, ...], values: Mapping[str, Any]
) -> None:
    """Refuse a section that lacks a key without a default."""
    needed = {
        f.name for f in fields(build) if f.default is MISSING and f.default_factory is MISSING
    }
    lacking = [key.name for key in keys if key.field in needed - values.keys()]
    if lacking:
        section.fail("", f"lacks {', '.join(lacking)}; calibrate writes the whole section")


def _check_version(root: Section) -> None:
    section = root.section("provenance")
    version = section.count("format_version") if section is not None else None
    if section is not None and version not in (None, FORMAT_VERSION):
        section.fail(
            "format_version",
            f"is {version}, and this program reads version {FORMAT_VERSION}: "
            "calibrate again, or use the program the file was written with",
        )


def _value(section: Section, key: _Key) -> Any:
    match key.kind:
        case "text":
            return section.text(key.stem)
        case "texts":
            return section.texts(key.stem)
        case "count":
            return section.count(key.stem)
        case "number":
            if key.suffix:
                return section.quantity(key.stem, key.suffix, key.tail)
            return section.number(key.stem)
    values = (
        section.quantities(key.stem, key.suffix, key.tail)
        if key.suffix
        else section.numbers(key.stem)
    )
    if values is not None and key.pair and not (len(values) == 2 and values[0] <= values[1]):
        section.fail(_written(section, key), "must be two numbers, the lower first")
    if values is not None and key.field == "std" and len(values) != 3:
        section.fail(_written(section, key), f"must be three numbers, got {len(values)}")
    return values


def _written(section: Section, key: _Key) -> str:
    """Key as it stands in the file, in whichever unit."""
    return next(
        (k for k in section.data if k == key.name or k.startswith(f"{key.stem}_")), key.name
    )


def _alternative_gearings(section: Section, values: dict[str, Any]) -> None:
    """Accept data-sheet ratios: gear_ratios, final_drive and wheel_radius."""
    ratios = section.numbers("gear_ratios")
    final_drive = section.number("final_drive")
    if ratios is None:
        if final_drive is not None:
            section.fail("final_drive", "needs gear_ratios, such as [3.8, 2.1, 1.4, 1.0]")
        return
    if "gearings" in values:
        section.fail("gear_ratios", "says the same as gearings_per_m; keep one of them")
    if "wheel_radius" not in values:
        section.fail("gear_ratios", "needs wheel_radius_m, such as 0.31")
    factor = (1.0 if final_drive is None else final_drive) / (values["wheel_radius"] or math.nan)
    if not (factor > 0.0 and all(r > 0.0 for r in ratios)):
        section.fail("gear_ratios", "final_drive and wheel radius must be positive")
    if any(b >= a for a, b in pairwise(ratios)):
        section.fail("gear_ratios", f"must fall from first to last gear, got {list(ratios)}")
    values["gearings"] = tuple(r * factor for r in ratios)


def _alternative_drag(section: Section, values: dict[str, Any]) -> None:
    """Accept drag_coefficient and frontal_area_m2 for their product."""
    coefficient = section.number("drag_coefficient")
    area = section.quantity("frontal_area", "m2")
    if coefficient is None and area is None:
        return
    if coefficient is None:
        section.fail("frontal_area_m2", "needs drag_coefficient, such as 0.30")
    if area is None:
        section.fail("drag_coefficient", "needs frontal_area_m2, such as 2.2")
    if "drag_area" in values:
        section.fail("drag_coefficient", "says the same as drag_area_m2; keep one of them")
    values["drag_area"] = coefficient * area


def _built(build: type[Any], section: Section, values: Mapping[str, Any]) -> Any:
    """Make the part; what its own checks refuse is told with the key's line."""
    try:
        return build(**values)
    except ConfigError as e:
        message = str(e)
        keys = {Vehicle: _VEHICLE, WitnessRelation: _WITNESS}.get(build) or _SECTIONS[
            section.path[-1]
        ][1]
        said = [
            k
            for key in sorted(keys, key=lambda k: len(k.stem), reverse=True)
            for k in section.data
            if k.startswith(key.stem)
            and (key.field in message or key.stem in message or key.field.rstrip("s") in message)
        ]
        if not said:
            raise ConfigError(f"{section.where()}: [{'.'.join(section.path)}] {message}") from None
        shown = str(section.data[said[0]])
        raise ConfigError(
            f"{section.where(said[0])}: {'.'.join(section.path)}.{said[0]} = {shown}: {message}"
        ) from None


def _table(keys: tuple[_Key, ...], part: Any, origins: Mapping[str, str] | None = None) -> Table:
    table = tomlkit.table()
    usual = {f.name: f.default for f in fields(part)}
    for key in keys:
        value = getattr(part, key.field)
        origin = (origins or {}).get(key.field)
        if value is None or (isinstance(value, tuple) and not value):
            if origin is not None:
                table.add(tomlkit.comment(f"{key.name}: {origin}"))
            continue
        if origins is not None and origin is None and value == usual[key.field]:
            continue
        item = _item(key, value)
        comment = "; ".join(filter(None, (key.comment, origin)))
        if len(item.as_string()) + len(key.name) + len(comment) < _LINE:
            item.comment(comment)
        else:
            table.add(tomlkit.comment(comment))
        table.add(key.name, item)
    return table


def _item(key: _Key, value: Any) -> Any:
    match key.kind:
        case "number":
            return tomlkit.value(exact_text(value, key.suffix or "ratio"))
        case "numbers":
            texts = (exact_text(v, key.suffix or "ratio") for v in value)
            return tomlkit.value(f"[{', '.join(texts)}]")
        case "texts":
            return tomlkit.item(list(value))
    return tomlkit.item(value)
