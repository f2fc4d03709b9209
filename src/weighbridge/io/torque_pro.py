"""Torque Pro track logs: OBD-II values and the phone's position, about once a second.

Names as the app writes them in English; each value's unit is in the last
brackets of its name. The time is the phone's, in its zone. Its acceleration
(``G(x)`` …) is left out: signs and what ``G(calibrated)`` leaves out are not
documented.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from weighbridge.errors import DriveError
from weighbridge.io.columns import bracketed_unit, unit_suffix
from weighbridge.io.log import Log
from weighbridge.io.mapping import MappedSignal, TableMapping, TimeColumn
from weighbridge.io.table import TextFormat, column_list, read_text
from weighbridge.io.tabular import read_mapped
from weighbridge.signals import QUANTITIES
from weighbridge.signals.units import UNITS

TIME_FORMAT: Final = "%d-%b-%Y %H:%M:%S%.f"

# Beginning of a column's name up to its unit, quantity, unit where the name has none.
_KNOWN: Final = (
    ("longitude", "longitude", "deg"),
    ("latitude", "latitude", "deg"),
    ("gps speed", "gnss_speed", None),
    ("horizontal dilution of precision", "hdop", ""),
    ("altitude", "altitude", "m"),
    ("bearing", "gnss_course", "deg"),
    ("speed (obd)", "vehicle_speed", None),
    ("engine rpm", "engine_speed", "rpm"),
    ("engine load", "engine_load", "pct"),
    ("throttle position(manifold)", "throttle", "pct"),
    ("mass air flow rate", "mass_air_flow", None),
    ("intake manifold pressure", "intake_pressure", None),
    ("ambient air temp", "ambient_temperature", None),
)

_WORDS: Final = {"meters/second": "mps"}


def is_torque_pro(head: bytes) -> bool:
    """Return whether a file begins as Torque Pro's track logs do."""
    names = [c.strip().lower() for c in head.split(b"\n", 1)[0].split(b",")]
    return names[:2] == [b"gps time", b"device time"]


def read_torque_pro(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read a Torque Pro track log; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        No column is known, or the time is in another language or form.
    """
    text = TextFormat(separator=",", missing=("-", "∞"))
    raw = read_text(path, text)
    found: dict[str, MappedSignal] = {}
    for name in raw.names:
        plain = " ".join(name.lower().split())
        for start, quantity, unit in _KNOWN:
            rest = plain.removeprefix(start).strip()
            if not plain.startswith(start) or (rest and not rest.startswith("(")):
                continue
            stated = _WORDS.get(rest.strip("() ")) or bracketed_unit(name) or unit
            if stated is None:
                stated = unit_suffix(rest.strip("() "))
            if quantity in found or not _fits(quantity, stated):
                continue
            found[quantity] = MappedSignal(
                name=quantity, column=name, unit=stated or None, optional=True
            )
    if not found:
        raise DriveError(
            f"{path} has no column of Torque Pro that is known; it has {column_list(raw.names)}: "
            "name them in a mapping file"
        )
    own = TableMapping(
        files="*",
        text=text,
        time=TimeColumn(column=raw.names[1], format=TIME_FORMAT),
        signals=tuple(found.values()),
        source="Torque Pro",
    )
    return read_mapped(raw, own)


def _fits(quantity: str, unit: str | None) -> bool:
    wanted = QUANTITIES[quantity].suffix
    if not wanted:
        return True
    return unit in UNITS and UNITS[unit].dimension == UNITS[wanted].dimension
