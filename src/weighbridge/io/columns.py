"""Canonical column names: a stem of the catalogue and a unit suffix."""

from __future__ import annotations

import difflib
import re
from typing import Final

from weighbridge.signals import QUANTITIES, Quantity
from weighbridge.signals.catalogue import TIME_COLUMN
from weighbridge.signals.units import UNITS

UNIT_TEXTS: Final[dict[str, str]] = {
    "km/h": "kmh", "kph": "kmh", "km/hr": "kmh", "kmph": "kmh", "mi/h": "mph", "m/s": "mps",
    "meters/second": "mps", "knots": "kn",
    "m/s^2": "mps2", "m/s²": "mps2", "m/s2": "mps2", "m/s/s": "mps2", "ms2": "mps2",
    "m/s**2": "mps2", "ms-2": "mps2", "ms^-2": "mps2", "gn": "g",
    "1/min": "rpm", "/min": "rpm", "rev/min": "rpm", "r/min": "rpm", "min-1": "rpm",
    "min^-1": "rpm",
    "rad/s": "radps", "deg/s": "degps", "°/s": "degps", "dps": "degps",
    "°": "deg", "degrees": "deg", "radians": "rad", "semicircles": "semicircle",
    **dict.fromkeys(("e7", "deg e7", "1e-7 deg", "1e-7 degrees", "deg*1e7", "deg * 1e7",
                     "1e-7°", "10^-7 deg", "degrees e7"), "dege7"),
    "lb-ft": "lbft", "lb ft": "lbft", "lb·ft": "lbft", "lbf-ft": "lbft", "lbf·ft": "lbft",
    "lbf ft": "lbft", "lbfft": "lbft", "ft-lb": "lbft", "ft lb": "lbft", "ft-lbs": "lbft",
    "ft·lb": "lbft", "ft-lbf": "lbft", "ft·lbf": "lbft", "ftlb": "lbft", "lbs-ft": "lbft",
    "mdps": "mdegps", "mdeg/s": "mdegps", "m°/s": "mdegps",
    "nm": "nm", "n m": "nm", "n·m": "nm", "n.m": "nm", "n*m": "nm",
    "%": "pct", "percent": "pct", "prozent": "pct", "proz": "pct", "-": "ratio", "1": "ratio",
    "°c": "degc", "℃": "degc", "c": "degc", "deg c": "degc", "celsius": "degc",
    "degree celsius": "degc",
    "°f": "degf", "℉": "degf", "f": "degf", "â°c": "degc", "â°": "deg",
    "g/s": "gps", "g/sec": "gps", "kg/s": "kgps",
    "l/h": "lph", "l/hr": "lph", "volt": "v", "volts": "v", "kilopascal": "kpa", "u/min": "rpm",
    "tr/min": "rpm", "tours/min": "rpm", "giri/min": "rpm", "r.p.m.": "rpm", "min⁻¹": "rpm",
    "omw/min": "rpm", "toeren/min": "rpm", "varv/min": "rpm", "obr/min": "rpm", "obr./min": "rpm",
    "ot/min": "rpm", "ot./min": "rpm", "dev/dk": "rpm", "d/dk": "rpm", "dev/dak": "rpm",
    "kg/h": "kgph", "kg/hr": "kgph", "lb/min": "lbpmin", "lbs/min": "lbpmin", "msec": "ms",
    "unit_minutinver": "rpm", "unit_kilometerperhour": "kmh", "unit_percent": "pct",
    "unit_newtometer": "nm", "unit_degrecelsi": "degc", "unit_volt": "v", "unit_amper": "a",
    "unit_meterperseconsquar": "mps2", "unit_degreofarc": "deg", "unit_secon": "s",
    "unit_kilogram": "kg", "kilogram": "kg", "kilograms": "kg",
    "sec": "s", "seconds": "s", "µs": "us", "μs": "us",
    **dict.fromkeys(("km/std", "km/u", "km/uur", "km/t", "km/tim", "km/sa", "km/saat", "km/hod",
                     "km/godz", "km/ora"), "kmh"),
    "км/ч": "kmh", "км/час": "kmh", "公里/小时": "kmh", "公里/时": "kmh", "千米/时": "kmh",
    "м/с": "mps", "м/с²": "mps2",
    "об/мин": "rpm", "об./мин": "rpm", "мин-1": "rpm", "转/分": "rpm", "转/分钟": "rpm",
    "回転/分": "rpm", "tpm": "rpm",
    "t/min": "rpm", "tr/mn": "rpm", "trs/min": "rpm", "rot/min": "rpm", "нм": "nm",
    "н·м": "nm", "牛米": "nm", "牛·米": "nm",
    "г/с": "gps", "кг/ч": "kgph", "л/ч": "lph", "кпа": "kpa", "бар": "bar", "кг": "kg",
    "квт": "kw", "вт": "w",
    "сек": "s", "с": "s", "мс": "ms", "秒": "s", "毫秒": "ms", "초": "s", "в": "v", "伏": "v",
    "安": "a",
    "град": "deg", "град.": "deg", "度": "deg", "м": "m", "米": "m", "per": "pct", "gm/s": "gps",
    "gm/sec": "gps",
}  # fmt: skip
"""Units as people and loggers write them, and the suffix each means."""

_TIMES: Final = re.compile(r"\s*[*•⋅∙x×]\s*")
"""Signs of a product."""

_SPELLED: Final = {
    "per": "/", "squared": "2",
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("kilometer", "kilometers", "kilometre", "kilometres"), "km"),
    **dict.fromkeys(("mile", "miles"), "mi"),
    **dict.fromkeys(("second", "seconds", "sec"), "s"),
    **dict.fromkeys(("hour", "hours", "hr"), "h"),
    **dict.fromkeys(("minute", "minutes"), "min"),
    **dict.fromkeys(("degree", "degrees"), "deg"),
    **dict.fromkeys(("radian", "radians"), "rad"),
    **dict.fromkeys(("revolution", "revolutions", "revs"), "rev"),
    **dict.fromkeys(("gram", "grams"), "g"),
    **dict.fromkeys(("kilogram", "kilograms"), "kg"),
    **dict.fromkeys(("pound", "pounds", "lbs"), "lb"),
    **dict.fromkeys(("liter", "liters", "litre", "litres"), "l"),
}  # fmt: skip
"""Words of units that are spelled out."""

UNKNOWN_UNIT: Final = "?"
"""Stands before a unit that a log states and nobody knows: no quantity is in it."""

# Letters of a name that may resemble a canonical one; comparing takes their square.
_LONGEST_NAME: Final = 200

_BRACKETED: Final = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]\s*$")

# Stems too general to be taken at their word outside their own table.
_GENERAL: Final = frozenset(q.stem for q in QUANTITIES.values() if q.stem != q.name) - {
    "engine_torque"
}


def dimension_of(quantity: Quantity) -> str:
    """Dimension of a quantity, as `weighbridge.signals.units` names it."""
    return UNITS[quantity.suffix].dimension if quantity.suffix else "-"


def suffixes_of(quantity: Quantity) -> list[str]:
    """Unit suffixes a quantity may be written in."""
    if not quantity.suffix:
        return []
    return [s for s, u in UNITS.items() if u.dimension == dimension_of(quantity)]


def unit_suffix(text: str) -> str | None:
    """Unit suffix for a unit as written by people, or None: ``km/h`` is ``kmh``.

    It may be spelled out: ``meters per second`` is ``mps``.
    """
    word = " ".join(text.strip().split()).lower()
    if word in UNITS:
        return word
    found = UNIT_TEXTS.get(word)
    word = " ".join(word.replace("_", " ").split())
    found = found or UNIT_TEXTS.get(word) or UNIT_TEXTS.get(_TIMES.sub("·", word))
    if found is None and " per " in word:
        short = "".join(_SPELLED.get(part, part) for part in word.split())
        return short if short in UNITS else UNIT_TEXTS.get(short)
    return found


def unit_refused(quantity: Quantity, text: str) -> str:
    """Say why a column whose name is a quantity's is not taken for it, by its unit.

    Parameters
    ----------
    quantity
    text : its unit as the log writes it
    """
    why = "is not known" if unit_suffix(text) is None else "measures something else"
    return (
        f"not taken for {quantity.name}: its unit {text!r} {why}; it can be in "
        f"{_either(suffixes_of(quantity))}"
    )


def stated_unit(text: str) -> str | None:
    """Unit suffix of a unit that a log states, after `UNKNOWN_UNIT` one that is not known; or None.

    Parameters
    ----------
    text : what is in a row or column of units; empty, or a mark such as - for none
    """
    word = text.strip().strip("[]()").strip()
    return (unit_suffix(word) or f"{UNKNOWN_UNIT}{word}") if word else None


def bracketed_unit(column: str) -> str | None:
    """Unit suffix in the brackets at the end of a name, as in ``Speed [km/h]``."""
    found = _BRACKETED.search(column)
    return unit_suffix(found.group(1)) if found else None


def time_unit(column: str) -> str | None:
    """Unit suffix of a canonical time column, or None where it is none."""
    name = column.strip().lower()
    if not name.startswith("time_"):
        return None
    found = UNITS.get(name.removeprefix("time_"))
    return name.removeprefix("time_") if found is not None and found.dimension == "s" else None


class UnitlessColumnError(ValueError):
    """A column has the name of a quantity, but no unit that it could be in."""


def parse_column(
    column: str, table: str | None, unit: str | None = None
) -> tuple[Quantity, str] | None:
    """Recognise a canonical column.

    Parameters
    ----------
    column : its name
    table : canonical table it is in; None where one file holds all
    unit : unit suffix known otherwise, for a name that carries none

    Returns
    -------
    The quantity and its unit suffix (empty for switches and counts), or None
    where the name is not canonical.

    Raises
    ------
    UnitlessColumnError
        The name is that of a quantity and the unit is missing or impossible.
    """
    name = column.strip().lower()
    candidates = [
        (stem, q)
        for q in QUANTITIES.values()
        for stem in {q.stem, q.name}
        if (name == stem or name.startswith(f"{stem}_"))
        and not (stem in _GENERAL and table != q.table)
    ]
    if not candidates:
        return None
    longest = max(len(stem) for stem, _ in candidates)
    candidates = [c for c in candidates if len(c[0]) == longest]
    ending = name[longest + 1 :]
    for _, q in candidates:
        if not q.suffix:
            if not ending:
                return q, ""
            continue
        suffix = ending or unit or ""
        if suffix in UNITS and UNITS[suffix].dimension == dimension_of(q):
            return q, suffix
    quantities = [q for _, q in candidates if q.suffix]
    if not quantities or "_" in ending:
        return None
    allowed = [f"{name[:longest]}_{s}" for q in quantities for s in suffixes_of(q)]
    said = f"ends in {ending!r}, which is not a unit it can be in" if ending else "carries no unit"
    raise UnitlessColumnError(f"{said}; name it {_either(allowed)}")


def _either(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"


def near_column(column: str) -> str | None:
    """Canonical column that an unknown name resembles, or None."""
    known = [q.column for q in QUANTITIES.values() if q.stem not in _GENERAL] + [TIME_COLUMN]
    name = column.strip().lower()
    if len(name) > _LONGEST_NAME:
        return None
    whole = [k for k in known if k.endswith(f"_{name}")]
    near = whole[:1] or difflib.get_close_matches(name, known, n=1, cutoff=0.75)
    return near[0] if near else None
