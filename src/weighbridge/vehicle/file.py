"""``VEHICLE.toml``: written for people, read with care.

One table says what every key is, in which unit it is written and which field
it fills; loading, saving and the comments all follow it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, replace
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, Final, Protocol, TypeVar

import tomlkit
from tomlkit.items import Table

from weighbridge.arguments import check_path
from weighbridge.errors import ConfigError
from weighbridge.signals.tomlfile import Faults, Section, read_toml, shortened
from weighbridge.vehicle.file_keys import SECTIONS, VEHICLE_KEYS, WITNESS_KEYS, Key
from weighbridge.vehicle.rounding import covariance_texts, rounded_texts
from weighbridge.vehicle.torque_model import WITNESS_TERMS, SecondSignalRelation
from weighbridge.whole import write_whole

FORMAT_VERSION: Final = 1
"""Version of the vehicle file this program writes and reads."""

_OTHER: Final = "without_accelerometer"
"""Field of a vehicle, and super-section of a file."""

# A comment that does not fit behind its key goes above it.
_LINE: Final = 90


Made = TypeVar("Made")


class Written(Protocol):
    """A vehicle, as a file holds it: a field for each of its sections and keys."""

    @property
    def witnesses(self) -> tuple[SecondSignalRelation, ...]:
        """How the torque's reading goes with other signals of the engine."""
        ...

    @property
    def without_accelerometer(self) -> Written | None:
        """What the same drives show where their accelerometer is left out."""
        ...


def load_vehicle(path: str | Path, build: type[Made]) -> Made:
    """Read a vehicle file.

    Parameters
    ----------
    path : the TOML file; a mapping it names is looked for beside it
    build : what is made of it, such as `weighbridge.vehicle.model.Vehicle`

    Raises
    ------
    ConfigError
        A key is unknown, a value impossible, a unit missing, or the file's
        version another one; the message names file, line, value and remedy of
        each fault.
    """
    check_path("path", path)
    path = Path(path)
    root = read_toml(path)
    _check_version(root)
    _refuse_lost_mapping(root)
    faults = Faults()
    sections = _parts(root, faults)
    beside = root.section(_OTHER)
    other = _parts(beside, faults) if beside is not None else None
    section = root.section("vehicle") or Section({}, root.name, root.lines, ("vehicle",))
    values = _values(section, VEHICLE_KEYS, faults)
    for read in (section, root, *([beside] if beside is not None else [])):
        with faults.gathered():
            read.done()
    faults.refuse()
    if other is not None:
        sections[_OTHER] = _built(build, section, {**values, **other})
    made: Made = _built(build, section, {**values, **sections})
    return made


def _parts(root: Section, faults: Faults) -> dict[str, Any]:
    """Read the sections of a vehicle; faults are gathered."""
    sections: dict[str, Any] = {}
    for name, (part, keys) in SECTIONS.items():
        section = root.section(name)
        if section is None:
            continue
        reported = len(faults.said)
        values = _values(section, keys, faults)
        with faults.gathered():
            if name == "driveline":
                _alternative_gearings(section, values)
            elif name == "road_load":
                _alternative_drag(section, values)
            elif name == "provenance":
                section.count("format_version")
        with faults.gathered():
            section.done()
        if len(faults.said) > reported:
            continue
        with faults.gathered():
            _refuse_gaps(section, part, keys, values)
            sections[name] = _built(part, section, values)
    with faults.gathered():
        sections["witnesses"] = _witnesses(root)
    return sections


def _values(section: Section, keys: Sequence[Key], faults: Faults) -> dict[str, Any]:
    """Values of the keys that a section has, by their fields; faults are gathered."""
    values = {}
    for key in keys:
        names = (key, replace(key, stem=key.earlier)) if key.earlier else (key,)
        for named in names:
            with faults.gathered():
                if (value := _value(section, named)) is not None:
                    values[key.field] = value
    return values


def _refuse_lost_mapping(root: Section) -> None:
    """Say where the mapping of a vehicle's logs belongs, where it is in another section."""
    remedy = "belongs into [vehicle]: move the line there"
    if "mapping" in root.data:
        root.fail("mapping", remedy)
    for name, data in root.data.items():
        if isinstance(data, dict) and name != "vehicle":
            _refuse_lost_mapping(Section(data, root.name, root.lines, (*root.path, name)))


def _witnesses(root: Section) -> tuple[SecondSignalRelation, ...]:
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
            key.field: value for key in WITNESS_KEYS if (value := _value(section, key)) is not None
        }
        for old in ("blur_s", "unexplained"):
            section.number(old)
        section.done()
        values["signal"] = signal
        _refuse_gaps(section, SecondSignalRelation, WITNESS_KEYS, values)
        found.append(_built(SecondSignalRelation, section, values))
    every.done()
    return tuple(found)


def save_vehicle(
    vehicle: Written,
    path: str | Path,
    origins: Mapping[tuple[str, str], str] | None = None,
    *,
    exact: bool = False,
) -> None:
    """Write a vehicle file, with a comment to every key and the covariance at its end.

    Numbers are rounded to their uncertainty (`weighbridge.vehicle.rounding`); masses that are
    weighed with the file stay within a hundredth of their standard deviation.

    Parameters
    ----------
    vehicle
    path : the file
    origins : by section and field, where a number is from, for its comment; what has none and is
        as without a file is left out
    exact : write every number so that `load_vehicle` gives it back to the last bit

    Raises
    ------
    ConfigError
        The file cannot be written.
    """
    check_path("path", path)
    path = Path(path)
    document = tomlkit.document()
    document.add(tomlkit.comment("A vehicle for weighbridge; every key carries its unit."))
    document.add("vehicle", _table(VEHICLE_KEYS, vehicle, exact=True))
    _add_parts(document, vehicle, origins, exact=exact)
    if vehicle.without_accelerometer is not None:
        beside = tomlkit.table(is_super_table=True)
        _add_parts(beside, vehicle.without_accelerometer, None, exact=exact)
        document.add(tomlkit.nl())
        document.add(tomlkit.comment("For drives that record no accelerometer: the same drives,"))
        document.add(tomlkit.comment("calibrated without theirs."))
        document.add(_OTHER, beside)
    write_whole(path, tomlkit.dumps(document))


def _add_parts(
    document: tomlkit.TOMLDocument | Table,
    vehicle: Written,
    origins: Mapping[tuple[str, str], str] | None,
    *,
    exact: bool,
) -> None:
    """Add the sections of a vehicle to a document, or to a table in it."""
    for name, (_, keys) in SECTIONS.items():
        if name == "provenance" and vehicle.witnesses:
            every = tomlkit.table(is_super_table=True)
            for second_signal in vehicle.witnesses:
                every.add(second_signal.signal, _table(WITNESS_KEYS, second_signal, exact=exact))
            document.add("witnesses", every)
        part = getattr(vehicle, name)
        if part is None:
            continue
        origin = None
        if origins is not None:
            origin = {field: text for (of, field), text in origins.items() if of == name}
        table = tomlkit.table()
        if name == "provenance":
            version = tomlkit.item(FORMAT_VERSION)
            version.comment("of this file")
            table.add("format_version", version)
        _table(keys, part, origin, exact=exact, table=table)
        if len(table):
            document.add(name, table)


def _refuse_gaps(
    section: Section, build: type[Any], keys: tuple[Key, ...], values: Mapping[str, Any]
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


def _value(section: Section, key: Key) -> Any:
    match key.kind:
        case "text":
            return section.text(key.stem)
        case "texts":
            return section.texts(key.stem)
        case "count":
            return section.count(key.stem)
        case "triangle":
            return section.numbers(key.stem)
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


def _written(section: Section, key: Key) -> str:
    """Key as it is in the file, in whichever unit."""
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
        if any(key.startswith("wheel_radius") for key in section.data):
            return
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
    """Make the part; what its own checks refuse is reported with the key's line."""
    try:
        return build(**values)
    except ConfigError as e:
        message = str(e)
        said_of = {"vehicle": VEHICLE_KEYS, "witnesses": WITNESS_KEYS}
        name = next(part for part in section.path if part != _OTHER)
        keys = said_of.get(name) or SECTIONS[name][1]
        said = [
            k
            for key in sorted(keys, key=lambda k: len(k.stem), reverse=True)
            for k in section.data
            if k.startswith(key.stem)
            and (key.field in message or key.stem in message or key.field.rstrip("s") in message)
        ]
        if not said:
            raise ConfigError(f"{section.where()}: [{'.'.join(section.path)}] {message}") from None
        shown = shortened(section.data[said[0]])
        raise ConfigError(
            f"{section.where(said[0])}: {'.'.join(section.path)}.{said[0]} = {shown}: {message}"
        ) from None


def _table(
    keys: tuple[Key, ...],
    part: Any,
    origins: Mapping[str, str] | None = None,
    *,
    exact: bool,
    table: Table | None = None,
) -> Table:
    """Add the keys of a part to a table."""
    table = tomlkit.table() if table is None else table
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
        item = _item(key, part, exact=exact)
        comment = "; ".join(filter(None, (key.comment, origin)))
        if len(item.as_string()) + len(key.name) + len(comment) < _LINE:
            item.comment(comment)
        else:
            table.add(tomlkit.comment(comment))
        table.add(key.name, item)
    return table


def _item(key: Key, part: Any, *, exact: bool) -> Any:
    value = getattr(part, key.field)
    if key.kind == "triangle":
        numbers = iter(covariance_texts(value, exact=exact))
        rows = [", ".join(islice(numbers, k)) for k in range(1, math.isqrt(2 * len(value)) + 1)]
        return tomlkit.value("[\n  " + ",\n  ".join(rows) + ",\n]")
    if key.kind in ("number", "numbers"):
        texts = rounded_texts(key, part, exact=exact)
        return tomlkit.value(texts[0] if key.kind == "number" else f"[{', '.join(texts)}]")
    return tomlkit.item(list(value) if key.kind == "texts" else value)
