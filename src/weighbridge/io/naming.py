"""What a foreign log's column is, distinguished from its name.

A name is taken apart into words, in any spelling (``EngineSpeed``, ``engine_speed``, ``Engine
speed [rpm]``), and held against what loggers call each quantity in several languages.
"""

from __future__ import annotations

import itertools
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from weighbridge.io.columns import UNKNOWN_UNIT, dimension_of, unit_refused, unit_suffix
from weighbridge.io.vocabulary import (
    AGAINST,
    ASPECTS,
    BARE,
    LONG,
    OF_ANOTHER,
    PHRASES,
    SILENT,
    TIME_PHRASES,
    WORDS,
    spelled,
    words_in,
)
from weighbridge.signals import QUANTITIES, UNITS

_BARE: Final = frozenset(
    ("current", "voltage", "speed", "torque", "power", "temperature", "pressure", "position",
     "angle", "load", "rate", "flow", "force", "level", "gear")
)  # fmt: skip
"""Words that are measured of many things, and name none by themselves at the end of a path."""


_ALONG: Final = ("long", "lon", "longitudinal", "forward", "fwd", "inline", "langs", "laengs")
_ACCEL_WORDS: Final = (
    "acc", "accel", "acceleration", "a", "g", "g force", "gforce", "accelerometer",
)  # fmt: skip


_MARK_OF_LIST: Final = re.compile(
    r"\s*[:\[(]?\s*\b(?:[A-Z]{2,4}\d{3,}|PID[_ ]?(?:0x)?[0-9A-F]{2,4}|0x[0-9A-Fa-f]{2,4})\b"
    r"\s*[\])]?\s*"
)
"""What a tester calls a value in its list: IDE00021, PR030, PID_0D."""

_LETTERS: Final = str.maketrans(
    {"ß": "ss", "ł": "l", "Ł": "L", "ı": "i", "ø": "o", "Ø": "O", "（": "(", "）": ")",
     "［": "[", "］": "]"}
)  # fmt: skip
"""Letters that are no letter with an accent, and brackets of another width."""


def _plain(text: str) -> str:
    """Return a text in small letters without accents."""
    parted = unicodedata.normalize("NFKD", text.translate(_LETTERS))
    kept = "".join(c for c in parted if not unicodedata.combining(c))
    return unicodedata.normalize("NFC", kept).lower()


def _phrases(quantity: str) -> tuple[str, ...]:
    """What loggers call a quantity in any language; its own name where nobody has one for it."""
    found = list(PHRASES.get(quantity, (quantity.replace("_", " "),)))
    if quantity == "engine_torque_fraction":
        # Its unit distinguishes it.
        found += _phrases("engine_torque")
    if quantity == "longitudinal_accel":
        found += [f"{way} {kind}" for way in _ALONG for kind in _ACCEL_WORDS]
    return tuple(map(_plain, found))


_WANTED: Final = {
    quantity: tuple(dict.fromkeys(frozenset(spelled(p.split())) for p in _phrases(quantity)))
    for quantity in QUANTITIES
}
"""The words of each quantity, spelled out."""

_WITH_WORD: Final = {
    quantity: {word: [p for p in phrases if word in p] for word in frozenset().union(*phrases)}
    for quantity, phrases in _WANTED.items()
}
"""The same by each of their words."""

_WITH_UNIT: Final = words_in("with unit")
"""Words that are a quantity only where the log states a unit of it."""

_NOT: Final = {
    q: frozenset(spelled(words)) | frozenset(map(_plain, words)) for q, words in AGAINST.items()
}

_TIMES: Final = frozenset(map(_plain, TIME_PHRASES))

_SHORTEST: Final = 3
"""Letters of a word at least that is in another one."""

_LONGEST: Final = 40
"""Letters of a word at most that is put together of others."""

_FIRST_SIGN: Final = "\u2e80"
"""From here on, a writing has no blanks between its words, and each sign may be a word."""

_VOCABULARY: Final = frozenset(
    word
    for words in (
        *(phrase.split() for quantity in QUANTITIES for phrase in _phrases(quantity)),
        *(time.split() for time in _TIMES),
        *AGAINST.values(),
        OF_ANOTHER,
        SILENT,
        *ASPECTS.values(),
        LONG,
    )
    for word in map(_plain, words)
    if len(word) >= _SHORTEST or word >= _FIRST_SIGN
)
"""Words of which others may be put together without a mark: gpsspeed."""

_BRAKES: Final = (
    "brak", "brk", "bped", "brems", "frein", "fren", "freio", "travao", "hamul", "brzd", "broms",
    "rempedaal", "тормоз", "制动", "刹车", *map(_plain, ("ブレーキ", "브레이크")),
)  # fmt: skip
"""Beginnings of words that have to do with brakes."""

_BARE_NAMES: Final = {
    _plain(word): [q for q, others in BARE.items() if word in others]
    for words in BARE.values()
    for word in words
}

_ENGINE: Final = frozenset(
    ("engine_speed", "engine_load", "engine_torque", "mass_air_flow", "engine_power",
     "battery_current", "accelerator_pedal")
)  # fmt: skip
"""Quantities of a table that the vehicle's control units fill."""

_RATE_WORDS: Final = ("rate", "velocity", "speed", "angular rate", "angular velocity")

_DIRECTIONS: Final[dict[str, frozenset[frozenset[str]]]] = {
    quantity: frozenset(
        frozenset(spelled((where, *what.split()))) for where in directions for what in kinds
    )
    for quantity, directions, kinds in (
        ("accel_x", _ALONG, _ACCEL_WORDS),
        ("accel_y", ("lat", "lateral", "transversal", "transverse"), _ACCEL_WORDS),
        ("accel_z", ("vert", "vertical", "up"), _ACCEL_WORDS),
        ("gyro_x", ("roll",), _RATE_WORDS),
        ("gyro_y", ("pitch",), _RATE_WORDS),
        ("gyro_z", ("yaw",), _RATE_WORDS),
    )
}
"""Words of the axes of an inertial sensor that is named by the vehicle's directions."""

_SYMBOLS: Final = {
    "n": "speed", "p": "pressure", "t": "temperature", "u": "voltage", "i": "current",
    "r": "position", "m": "torque", "mom": "torque",
}  # fmt: skip
"""Symbols of physics before a name, as racing teams write it: nEngine, pManifold, rThrottle."""

_OTHERWISE: Final[dict[str, str | None]] = {"gps": None, "ms": "mps"}
"""What a unit at the end of a name means where no quantity of that name has it: g/s may be the
satellites', and ms m/s."""

_WANTED_TOO: Final = frozenset(("engine_torque", "engine_torque_fraction", "gear"))
"""Quantities of which a log often has what is measured and what is wanted."""

_OF_VEHICLE: Final = (
    frozenset(("obd", "vehicle", "car", "wheel", "can", "ecu")) | ASPECTS["vehicle_speed"]
)
"""Words by which a speed is not that of satellites."""

_SIDES: Final = frozenset(("front", "rear", "left", "right"))

LEAST: Final = 0.66
"""Part of the words of a name that have to be those of a quantity [-]."""

_MARKS: Final = frozenset(("txt", "wgs84", "gear", "bool", "int", "float", "on/off", "0/1", "none"))
"""What is in brackets as a unit does, and is none."""

_UNIT: Final = re.compile(r"[\[({<]\s*([^\])}>]{0,20}?)\s*[\])}>]")
_PIPED: Final = re.compile(r'"?(?P<name>[^"|]+)"?\|"(?P<unit>[^"|]*)"(?:\|[^|]*)*$')
_WORD_WIDE: Final = re.compile(r"([a-z][a-z0-9]+)_w$")
"""A label of a control unit with the mark of 16 bits, as Bosch writes it: nmot_w."""

_SENDER: Final = re.compile(r"(?:(?<=[.:/])|^)([A-Za-z]{2,4})\d?_(?=[A-Za-z]+[A-Za-z_])")
"""A short mark before a name, or before the last part of a path."""

_PATH: Final = re.compile(r"[/.\\:](?![^\[(]*[\])])")
"""Parts the places of a name that is a path; not within brackets, where a unit may have it."""

_PID: Final = re.compile(r"(?:(?:S\d+_)?PID_[0-9A-Fa-f]{2,4}_|[0-9A-Fa-f]{2}-)(?=[A-Za-z])")
"""The number of an OBD-II parameter before its name: 0C-EngineRPM, S1_PID_0C_EngineRPM."""

_TAIL: Final = re.compile(r"[A-Za-z°%²/^]{2,8}\d?$")
_WORD: Final = re.compile(r"[a-z]+|[^\W\d_a-z]+|\d+")
_BUS: Final = re.compile(r"(?<![A-Za-z])(CAN|LIN|can|lin)\d+")
"""The number of a bus."""
_CAMEL: Final = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")


MOST_LETTERS: Final = 1000
"""A longer name is none [-]: the longest of the lists of headers has 90."""


@dataclass(frozen=True, slots=True)
class Named:
    """What a name says.

    Attributes
    ----------
    quantity : canonical name; empty where none is recognised
    unit : suffix of the unit that the name states; None where it states none
    score : part of the name's words that speak for it [-]
    misfit : why it is not the quantity that the name without its unit would be; empty where there
        is none
    """

    quantity: str
    unit: str | None
    score: float
    misfit: str = ""


def words_of(name: str) -> tuple[str, ...]:
    """Words of a name in small letters, without accents and without units in brackets."""
    plain = _UNIT.sub(lambda found: _kept(found.group(1)), _piped(name))
    plain = plain.replace("% ", " percent ")
    plain = _WORD_WIDE.sub(r"\1", plain)
    plain = _CAMEL.sub(" ", _BUS.sub(r"\1", plain))
    return tuple(part for word in _WORD.findall(_plain(plain)) for part in _parts_of(word))


@lru_cache(maxsize=4096)
def _parts_of(word: str) -> tuple[str, ...]:
    """Known words that a word is put together of, the fewest; itself where it is one or none."""
    if word >= _FIRST_SIGN:
        return _signs_of(word[:_LONGEST])
    if word[:3] == "gps" and len(word) == 4:
        return ("gps", word[3])
    if word in _VOCABULARY or not 2 * _SHORTEST <= len(word) <= _LONGEST:
        return (word,)
    for k in range(len(word) - _SHORTEST, _SHORTEST - 1, -1):
        head, tail = word[:k], word[k:]
        if head not in _VOCABULARY:
            continue
        parts = _parts_of(tail)
        if all(part in _VOCABULARY for part in parts):
            return (head, *parts)
    return (word,)


def _signs_of(word: str) -> tuple[str, ...]:
    """Words of a writing without blanks: as few unknown signs as can be, then as few words."""
    best: list[tuple[int, int, tuple[str, ...]]] = [(0, 0, ())]
    for end in range(1, len(word) + 1):
        unknown, count, parts = best[end - 1]
        ways = [(unknown + 1, count + 1, (*parts, word[end - 1]))]
        for begin in range(end):
            if word[begin:end] in _VOCABULARY:
                unknown, count, parts = best[begin]
                ways.append((unknown, count + 1, (*parts, word[begin:end])))
        best.append(min(ways, key=lambda way: way[:2]))
    return best[-1][2]


def _piped(name: str) -> str:
    """A name with its unit in brackets, where the log parts name, unit and range by bars.

    The number of an OBD-II parameter before it is left out, and its mark in the list of a tester.
    """
    name = name.translate(_LETTERS)
    if (number := _PID.match(name)) is not None:
        name = name[number.end() :]
    name = _MARK_OF_LIST.sub(" ", name).strip() or name
    found = _PIPED.match(name)
    return f"{found['name']} [{found['unit']}]" if found is not None else name


def _kept(bracketed: str) -> str:
    """What is in brackets, where it is a word and no unit."""
    word = bracketed.strip()
    plain = len(_WORD.findall(word.lower())) and word.lower() not in _MARKS
    reported = word.lower() == "gps" or unit_suffix(word) is None
    axis = word.lower() in ("x", "y", "z")
    return f" {word} " if axis or (plain and len(word) > 2 and reported) else " "


def unit_of(name: str) -> tuple[str | None, tuple[str, ...]]:
    """Unit that a name states in brackets or as its last word, and the words without it."""
    name = _piped(name)
    words = words_of(name)
    for found in reversed(_UNIT.findall(name)):
        suffix = unit_suffix(found)
        if suffix is not None:
            return suffix, words
    parts = name.strip("_").split("_")
    # A unit may be spelled out in several words, or its stroke be one of the marks: km_h.
    for count in (4, 3, 2, 1):
        tail = " ".join(parts[-count:])
        gone = len(words_of(tail))
        suffix = unit_suffix(tail)
        if suffix is None and count == 2:
            suffix = unit_suffix("/".join(parts[-2:]))
        if len(parts) > count and len(words) > gone and suffix is not None:
            return suffix, words[: len(words) - gone]
    humps = _CAMEL.sub(" ", parts[-1]).split()
    for count in (2, 1):
        tail = "".join(humps[-count:])
        if (
            len(humps) > count
            and (len(tail) > 2 or tail == "E7")
            and (suffix := unit_suffix(tail)) is not None
        ):
            return suffix, words[: len(words) - len(words_of(" ".join(humps[-count:])))]
    last = name.split()
    if len(last) > 1 and (suffix := unit_suffix(last[-1].strip("()[],;"))) is not None:
        gone = len(words_of(last[-1]))
        return suffix, words[: len(words) - gone] if gone else words
    # A name may be a unit of speed alone.
    whole = unit_suffix(name)
    return (whole if whole in ("mph", "kmh") else None), words


def recognise(name: str, unit: str | None = None) -> Named:
    """Recognise a column by its name.

    Parameters
    ----------
    name : as it is in the log
    unit : suffix of its unit, where the log states it elsewhere

    Returns
    -------
    Named
        With an empty quantity where nothing fits well enough.
    """
    if len(name) > MOST_LETTERS:
        return Named("", unit, 0.0)
    if unit_suffix(name) == "rpm":
        name = "rpm"
    stated, words = unit_of(name)
    known = unit is not None and not unit.startswith(UNKNOWN_UNIT)
    found = _recognised(name, words, unit if known else stated or unit)
    if not found.quantity and stated in _OTHERWISE:
        other = _recognised(name, words, _OTHERWISE[stated] or unit)
        return other if other.quantity else found
    return found


def _recognised(name: str, words: tuple[str, ...], stated: str | None) -> Named:
    """Recognise a column that states this unit; ``words`` are its name's without it."""
    # A last word may be a unit or part of the name, as in ENGINE_RPM.
    whole = frozenset(spelled(words_of(name)))
    readings = {frozenset(spelled(words)), whole} | _last_places(name)
    if words[:1] and words[0] in _SYMBOLS and any(len(w) > 1 for w in words[1:]):
        readings.add(frozenset(spelled((_SYMBOLS[words[0]], *words[1:]))))
    # The unit may be said twice, as in LOAD_PCT (%).
    readings |= {
        frozenset(w for w in said if len(w) < _SHORTEST or unit_suffix(w) != stated)
        for said in tuple(readings)
        if stated is not None
    }
    said_at_all = frozenset().union(*readings)
    best = Named("", stated, 0.0)
    # Revolutions per minute are no minimum.
    against = whole - _container(name) - ({"min"} if stated == "rpm" else set())
    for quantity, phrases in _WANTED.items():
        if _NOT.get(quantity, frozenset()) & against and whole not in phrases:
            continue
        if stated is not None and not _can_be(quantity, stated):
            continue
        aspects = ASPECTS.get(quantity, frozenset())
        near = {phrase for word in said_at_all for phrase in _WITH_WORD[quantity].get(word, ())}
        pairs = itertools.product(readings, near)
        score = max((_score(said, wanted, aspects) for said, wanted in pairs), default=0.0)
        if stated is not None and any(
            frozenset(said.split()) in readings for said in _WITH_UNIT.get(quantity, ())
        ):
            score = max(score, LEAST)
        if score > best.score:
            best = Named(quantity, stated, score)
    return best if best.score >= LEAST else Named("", stated, best.score)


def bare_quantities(name: str) -> frozenset[str]:
    """Quantities that a name may be which only says in what it is measured.

    So a voltage without more words may be that of the traction battery, a linear acceleration a
    sensor's with gravity, and what has to do with brakes their switch.
    """
    last = [part for part in _PATH.split(_piped(name)) if part.strip()][-1:]
    words = frozenset(spelled(unit_of(last[0])[1])) - SILENT if last else frozenset()
    words -= ASPECTS["battery_voltage"]
    words = frozenset(w for w in words if len(w) > 1) or words
    if len(words) == 1 and (found := _BARE_NAMES.get(next(iter(words)))):
        return frozenset(found)
    said = set(spelled(words_of(name)))
    axis = said & set("xyz")
    linear = "linear" in said and bool(said & {"acceleration", "accel"})
    if len(axis) == 1 and (linear or not said - axis - {"g", "axis"}):
        return frozenset((f"accel_{axis.pop()}",))
    if said in ({"gx"}, {"gy"}, {"gz"}):
        return frozenset((f"accel_{said.pop()[1]}",))
    braking = any(word.startswith(_BRAKES) for word in said) and not said & _NOT["brake_switch"]
    return frozenset(("brake_switch",) if braking else ())


def means_another(name: str, quantity: str) -> bool:
    """Whether a name has a word with which it is not that quantity, whatever its unit is."""
    words = frozenset(spelled(words_of(name)))
    return bool(words & (OF_ANOTHER | _NOT.get(quantity, frozenset())))


def is_time(name: str) -> bool:
    """Whether a column's name is that of a time."""
    _, words = unit_of(name)
    plain = " ".join(words_of(name))
    return bool({plain, " ".join(words)} & _TIMES)


def _can_be(quantity: str, unit: str) -> bool:
    q = QUANTITIES[quantity]
    if not q.suffix:
        return unit == "ratio" or unit.startswith(UNKNOWN_UNIT)
    return unit in UNITS and UNITS[unit].dimension == dimension_of(q)


def _container(name: str) -> frozenset[str]:
    """Words of a path that only say that all is of the vehicle."""
    inside = {word for part in _PATH.split(_piped(name))[:-1] for word in words_of(part)}
    return frozenset(inside & {"vehicle", "car"})


def _last_places(name: str) -> set[frozenset[str]]:
    """Words of the last parts of a name that is a path, where they alone name something."""
    parts = [part for part in _PATH.split(_piped(name)) if part.strip()]
    ends = [frozenset(spelled(words_of(" ".join(parts[-k:])))) for k in range(1, len(parts))]
    return {words for words in ends if any(len(w) > 1 for w in words - SILENT - _BARE)}


def _score(words: frozenset[str], phrase: frozenset[str], aspects: frozenset[str]) -> float:
    """Part of the words of a name that a phrase has; 0 where the name lacks one of the phrase's,
    or is that of a request, a bound or a state of it.

    Parameters
    ----------
    words, phrase : of the name and of what is looked for
    aspects : words that say nothing of this quantity
    """
    if (words - phrase) & OF_ANOTHER:
        return 0.0
    silent = SILENT | aspects
    core = phrase - silent or phrase - SILENT or phrase
    said = words - silent or words - SILENT or words
    # What is left of "current in" would name any current.
    needed = phrase if core <= _BARE else core
    if not (needed <= words and core <= said):
        return 0.0
    # A letter more, such as that of a channel, is half a word.
    return len(core) / (len(core) + sum(0.5 if len(w) == 1 else 1.0 for w in said - core))


def recognise_all(
    names: Sequence[str],
    units: Sequence[str | None] | None = None,
    *,
    misfits: bool = False,
) -> list[Named]:
    """Recognise the columns of one table together.

    A quantity is given once, to the name that fits best. A speed without more words is that of
    satellites where it stands beside a position and another column has the wheels' speed, or the
    table has no value of an engine. Accelerations and rates in all three directions of the
    vehicle are those of one inertial sensor.

    Parameters
    ----------
    names : of the columns
    units : suffixes of their units, where the log states them elsewhere
    misfits : whether it is to be reported of a name why its unit keeps it from being a quantity

    Returns
    -------
    One for each name.
    """
    names = _positions_by_pair(_without_root(without_senders(names)))
    found = [
        recognise(name, unit)
        for name, unit in zip(names, units or [None] * len(names), strict=True)
    ]
    found = _of_receiver(names, found)
    found = _speed_of_satellites(list(names), found)
    found = _axes_by_direction(names, found)
    best: dict[str, int] = {}
    words = [set(words_of(name)) for name in names]
    # What is measured comes before what may be wanted. Of names that say the same, the one without
    # more words: "TPS" before "TPS raw".
    order = [
        (named.quantity in _WANTED_TOO and bool(said & WORDS["measured"]), named.score, -len(said))
        for said, named in zip(words, found, strict=True)
    ]
    for k, named in enumerate(found):
        other = best.get(named.quantity)
        if other is None or order[k] > order[other]:
            best[named.quantity] = k
    for quantity, k in list(best.items()):
        if quantity and (other_name := _sibling(names, found, k)):
            why = f"not taken for {quantity}: {other_name!r} may be it as well"
            found[k] = Named("", found[k].unit, found[k].score, why)
    taken = {named.quantity for named in found}
    stated = units or [None] * len(names)
    return [
        Named(
            "",
            named.unit,
            named.score,
            named.misfit or (_misfit(name, unit, taken) if misfits else ""),
        )
        if not named.quantity
        else named
        if best[named.quantity] == k
        else Named("", named.unit, named.score)
        for k, (name, unit, named) in enumerate(zip(names, stated, found, strict=True))
    ]


def without_senders(names: Sequence[str]) -> list[str]:
    """Names of one log without the short mark of who sends them: MO_Drehzahl, ESP_v_Signal.

    It is no word, and stands before several names.
    """
    found = [_SENDER.search(name) for name in names]
    marks = [each.group(1) if each else "" for each in found]
    words = {word for phrases in PHRASES.values() for phrase in phrases for word in phrase.split()}
    known = _VOCABULARY | LONG.keys() | words
    return [
        name[: each.start()] + name[each.end() :]
        if each and mark.lower() not in known and marks.count(mark) > 1
        else name
        for name, mark, each in zip(names, marks, found, strict=True)
    ]


def _sibling(names: Sequence[str], found: Sequence[Named], place: int) -> str:
    """Name of a column that is the same on another side of the vehicle; empty where there is none.

    Of two motors, one on each axle, neither is the engine.
    """
    words = set(words_of(names[place]))
    if not words & _SIDES:
        return ""
    for name, named in zip(names, found, strict=True):
        others = set(words_of(name))
        alike = others != words and others - _SIDES == words - _SIDES and bool(others & _SIDES)
        if alike and named.quantity in ("", found[place].quantity):
            return name
    return ""


def _misfit(name: str, stated: str | None, taken: set[str]) -> str:
    """Say that a name would be a quantity's that is not taken, but for the unit it states."""
    for base, text in _without_unit(_piped(name), stated):
        quantity = _recognised(base, words_of(base), None)
        of_another = OF_ANOTHER | SILENT | _NOT.get(quantity.quantity, frozenset())
        if quantity.score < 1.0 or quantity.quantity in taken or of_another & set(words_of(text)):
            continue
        if QUANTITIES[quantity.quantity].suffix:
            return unit_refused(QUANTITIES[quantity.quantity], text)
    return ""


def _without_unit(name: str, stated: str | None) -> list[tuple[str, str]]:
    """Ways to part a name and its unit, each as the log writes them."""
    if stated is not None:
        return [(name, stated.removeprefix(UNKNOWN_UNIT))]
    if brackets := [found for found in _UNIT.finditer(name) if found.group(1)]:
        return [(name[: brackets[-1].start()] + name[brackets[-1].end() :], brackets[-1].group(1))]
    base, _, tail = name.rpartition("_")
    return [(base, tail)] if base and _TAIL.match(tail) else []


def _axes_by_direction(names: Sequence[str], found: list[Named]) -> list[Named]:
    """Take accelerations and rates along and about all three directions for one sensor's."""
    if any(n.quantity and QUANTITIES[n.quantity].stem.startswith("suspension") for n in found):
        return found
    axes: dict[str, int] = {}
    for k, (name, named) in enumerate(zip(names, found, strict=True)):
        said = frozenset(spelled(unit_of(name)[1])) - SILENT
        for quantity, spellings in _DIRECTIONS.items():
            if said in spellings and (named.unit is None or _can_be(quantity, named.unit)):
                axes.setdefault(quantity, k)
    taken = {n.quantity for n in found}
    rates = {f"gyro_{a}": names.index(f"g{a}") for a in "xyz" if f"g{a}" in names}
    if len(rates) == 3 and {"accel_x", "accel_y", "accel_z"} <= taken and "gyro_x" not in taken:
        # Beside ax, ay and az of an inertial sensor they are no accelerations.
        axes = rates
    elif axes.keys() != _DIRECTIONS.keys() or taken & {"accel_x", "gyro_x"}:
        return found
    at = {k: quantity for quantity, k in axes.items()}
    return [Named(at[k], n.unit, 1.0) if k in at else n for k, n in enumerate(found)]


def _between_positions(found: Sequence[Named], place: int) -> bool:
    """Whether the columns on both sides are of a receiver of satellites: a device has its own
    together.
    """
    beside = [found[k].quantity for k in (place - 1, place + 1) if 0 <= k < len(found)]
    return len(beside) == 2 and all(q and QUANTITIES[q].table == "gnss" for q in beside)


def _without_root(names: Sequence[str]) -> list[str]:
    """Names of one log without the first part of their paths, where all have the same one and it
    is no word of a quantity.
    """
    parts = [_PATH.split(name, maxsplit=1) for name in names]
    roots = {each[0] for each in parts}
    if len(names) < 2 or len(roots) > 1 or any(len(each) < 2 or not each[1] for each in parts):
        return list(names)
    known = set(words_of(roots.pop())) & _VOCABULARY
    return list(names) if known else [each[1] for each in parts]


def _positions_by_pair(names: Sequence[str]) -> list[str]:
    """Names of one log; of two that differ by latitude and longitude alone, no more than that."""
    if any(recognise(name).quantity in ("latitude", "longitude") for name in names):
        return list(names)
    words = [frozenset(spelled(words_of(name))) for name in names]
    for way, across in itertools.product(("latitude", "lat"), ("longitude", "lon", "long", "lng")):
        for k, said in enumerate(words):
            twin = said - {way} | {across}
            moves = said & {*_ACCEL_WORDS, *_RATE_WORDS, "force"}
            if way in said and len(said) > 1 and twin in words and not moves:
                pair = {k: way, words.index(twin): across}
                return [pair.get(j, name) for j, name in enumerate(names)]
    return list(names)


def _of_receiver(names: Sequence[str], found: list[Named]) -> list[Named]:
    """Read what has the same words before it as the position, and nothing of the vehicle has.

    So ``position.speed`` beside ``position.latitude`` is the receiver's.
    """
    at = {n.quantity: k for k, n in enumerate(found)}
    if not {"latitude", "longitude"} <= at.keys() or "gnss_speed" in at:
        return found
    words = [words_of(name) for name in names]
    pair = zip(words[at["latitude"]], words[at["longitude"]], strict=False)
    before = tuple(a for a, _ in itertools.takewhile(lambda both: both[0] == both[1], pair))
    inside = [bool(before) and w[: len(before)] == before for w in words]
    engine = any(here and n.quantity in _ENGINE for here, n in zip(inside, found, strict=True))
    if engine or not any(inside):
        return found
    read = list(found)
    for k, (name, here) in enumerate(zip(names, inside, strict=True)):
        if not here or found[k].quantity not in ("", "vehicle_speed"):
            continue
        stated, own = unit_of(name)
        rest = own[len(before) :]
        other = _recognised(" ".join(rest), rest, stated or found[k].unit)
        quantity = "gnss_speed" if other.quantity == "vehicle_speed" else other.quantity
        if quantity and QUANTITIES[quantity].table == "gnss":
            read[k] = Named(quantity, other.unit, other.score)
    return read


def _speed_of_satellites(names: list[str], found: list[Named]) -> list[Named]:
    quantities = {n.quantity for n in found}
    if "latitude" not in quantities or "gnss_speed" in quantities:
        return found
    speeds = [k for k, n in enumerate(found) if n.quantity == "vehicle_speed"]
    plain = [k for k in speeds if not _OF_VEHICLE & set(words_of(names[k]))]
    alone = len(plain) == len(speeds)
    if alone and quantities & _ENGINE:
        plain = [k for k in plain if _between_positions(found, k)]
    if not plain or (alone and len(plain) > 1):
        return found
    return [Named("gnss_speed", n.unit, n.score) if k in plain else n for k, n in enumerate(found)]
