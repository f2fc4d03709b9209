"""TOML files that people write: every fault is reported with its line and a remedy."""

from __future__ import annotations

import contextlib
import math
import re
import tomllib
from collections.abc import Iterator, Mapping
from decimal import Context, Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, NoReturn

from weighbridge.arguments import suggestion
from weighbridge.errors import ConfigError, WeighbridgeError
from weighbridge.signals.units import UNITS, Unit, unit

_HEADER: Final = re.compile(r"^\s*\[\[?([^\[\]]+)\]\]?\s*(?:#.*)?$")
_KEY: Final = re.compile(r"""^\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*[\w"'-]+)*)\s*=""")

_PART_OF_KEY: Final = re.compile(r"""\.\s*[\w"'-]""")
_NO_KEY: Final = re.compile(r"""[^\w"'\-.\s]+""")

_TYPES: Final[dict[type, str]] = {
    bool: "true or false",
    int: "a number",
    float: "a number",
    Decimal: "a number",
    str: "text",
    list: "a list",
    dict: "a section",
}


LARGEST: Final = 30
"""Power of ten that no number of a file may reach: no quantity in any unit does, and its powers
stay doubles."""

SMALLEST: Final = -340
"""Power of ten below which no number of a file but 0 may be: doubles end at -324, and units take
their part."""

_LARGEST_BITS: Final = int(LARGEST * math.log2(10.0))
"""The same in bits."""

# Digits that are read: 800 show any double from its neighbour, exactly written (IEEE 754).
_MOST_DIGITS: Final = 1000

MOST_COUNTED: Final = 1_000_000_000
"""Most that a file may count: samples of a fit, lines to skip."""

LONGEST_FILE: Final = 4_000_000
"""Bytes of a TOML file that a person wrote: some hundred times those of the longest seen."""

# Levels of sections and lists that are in use are three; the library calls itself for each.
_DEEPEST: Final = 100

# So many unknown keys are named; a screen shows no more.
_SAID: Final = 20
# Texts in brackets of a message.
_SHOWN: Final = 40


def _split(key: str) -> tuple[str, ...]:
    return tuple(part.strip().strip("\"'") for part in key.split("."))


def key_lines(text: str) -> dict[tuple[str, ...], int]:
    """Find the line, from 1, of every section and key that has a line of its own."""
    lines: dict[tuple[str, ...], int] = {}
    section: tuple[str, ...] = ()
    for number, line in enumerate(text.splitlines(), start=1):
        if header := _HEADER.match(line):
            section = _split(header.group(1))
            lines.setdefault(section, number)
        elif key := _KEY.match(line):
            lines.setdefault((*section, *_split(key.group(1))), number)
    return lines


class Section:
    """One table of a TOML file, whose keys are taken one by one.

    Parameters
    ----------
    data : the table, numbers as `Decimal` or int
    name : what the file is called in messages
    lines : line of every key, see `key_lines`
    path : keys that lead to this table
    error : the exception to raise
    """

    def __init__(
        self,
        data: Mapping[str, Any],
        name: str,
        lines: Mapping[tuple[str, ...], int],
        path: tuple[str, ...] = (),
        error: type[WeighbridgeError] = ConfigError,
    ) -> None:
        self.data = data
        self.name = name
        self.lines = lines
        self.path = path
        self.error = error
        self._known: list[str] = []

    def where(self, key: str = "") -> str:
        """Say where a key is: file, line and section."""
        full = (*self.path, key) if key else self.path
        for n in range(len(full), 0, -1):
            if full[:n] in self.lines:
                return f"{self.name}, line {self.lines[full[:n]]}"
        return self.name

    def fail(self, key: str, text: str) -> NoReturn:
        """Raise the file's error for a key, of which `done` says no more."""
        self._known.append(key)
        label = ".".join((*self.path, key)) if key else ".".join(self.path)
        raise self.error(f"{self.where(key)}: {label} {text}")

    def _take(self, key: str) -> Any:
        self._known.append(key)
        return self.data.get(key)

    def _wrong_type(self, key: str, wanted: str, value: Any) -> NoReturn:
        kind = _TYPES.get(type(value), type(value).__name__)
        shown = f" ({shortened(value)})" if not isinstance(value, dict) else ""
        self.fail(key, f"must be {wanted}, not {kind}{shown}")

    def section(self, key: str) -> Section | None:
        """Return a table inside this one, or None where it is absent."""
        value = self._take(key)
        if value is None:
            return None
        if not isinstance(value, dict):
            self._wrong_type(key, "a section", value)
        return Section(value, self.name, self.lines, (*self.path, key), self.error)

    def text(self, key: str) -> str | None:
        """Return text; a TOML date or time counts as its ISO 8601 text."""
        value = self._take(key)
        if value is None or isinstance(value, str):
            return value
        if not hasattr(value, "isoformat"):
            self._wrong_type(key, 'text in "quotes"', value)
        return str(value.isoformat())

    def texts(self, key: str) -> tuple[str, ...] | None:
        """Return a list of texts."""
        value = self._take(key)
        if value is None:
            return None
        if isinstance(value, str):
            return (value,)
        if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
            self._wrong_type(key, "a list of texts", value)
        return tuple(value)

    def flag(self, key: str) -> bool | None:
        """Return true or false."""
        value = self._take(key)
        if value is not None and not isinstance(value, bool):
            self._wrong_type(key, "true or false", value)
        return value

    def count(self, key: str) -> int | None:
        """Return a whole number, zero or more."""
        value = self._take(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int):
            self._wrong_type(key, "a whole number", value)
        if not 0 <= value <= MOST_COUNTED:
            self.fail(key, f"must be from 0 to {MOST_COUNTED}, got {shortened(value)}")
        return value

    def _exact(self, key: str, value: Any) -> Fraction:
        if isinstance(value, bool) or not isinstance(value, int | float | Decimal):
            self._wrong_type(key, "a number", value)
        self._refuse_size(key, value)
        return Fraction(value)

    def _refuse_size(self, key: str, value: int | float | Decimal) -> None:
        """Refuse what no double holds, before a fraction of it fills the memory."""
        if isinstance(value, int):
            # Bits of a number of LARGEST decimal places.
            if value.bit_length() > _LARGEST_BITS:
                self.fail(key, f"must be below 1e{LARGEST}, got {shortened(value)}")
            return
        if not math.isfinite(value):
            self.fail(key, f"must be a finite number, got {value}")
        if value and not SMALLEST <= Decimal(value).adjusted() < LARGEST:
            self.fail(key, f"must be 0 or from 1e{SMALLEST} to 1e{LARGEST}, got {shortened(value)}")
        if isinstance(value, Decimal) and len(value.as_tuple().digits) > _MOST_DIGITS:
            self.fail(key, f"has {len(value.as_tuple().digits)} digits; {_MOST_DIGITS} are enough")

    def number(self, key: str) -> float | None:
        """Return a finite number without a unit."""
        value = self._take(key)
        return None if value is None else float(self._exact(key, value))

    def numbers(self, key: str) -> tuple[float, ...] | None:
        """Return a list of finite numbers without a unit."""
        value = self._take(key)
        if value is None:
            return None
        if not isinstance(value, list):
            self._wrong_type(key, "a list of numbers", value)
        return tuple(float(self._exact(key, v)) for v in value)

    def _measured(self, stem: str, suffix: str, tail: str) -> tuple[str, Any, Unit] | None:
        """Find the one key ``stem_{unit}{tail}`` in a unit of the right dimension."""
        canonical = f"{stem}_{suffix}{tail}"
        self._known.append(canonical)
        dimension = unit(suffix).dimension
        found = []
        for key, value in self.data.items():
            if key.startswith(f"{stem}_") and key.endswith(tail):
                u = UNITS.get(key[len(stem) + 1 : len(key) - len(tail)].lower())
                if u is not None and u.dimension == dimension:
                    found.append((key, value, u))
        if stem in self.data and not found:
            self.fail(stem, f"carries no unit; write it as {canonical}")
        if len(found) > 1:
            self.fail(found[1][0], f"says the same as {found[0][0]}; keep one of them")
        if not found:
            return None
        self._known.append(found[0][0])
        return found[0]

    def quantity(self, stem: str, suffix: str, tail: str = "") -> float | None:
        """Return the number under ``stem_{unit}`` in SI, any unit of the dimension.

        The conversion is exact and rounds once, so that what was saved is
        loaded again to the last bit.
        """
        found = self._measured(stem, suffix, tail)
        if found is None:
            return None
        key, value, u = found
        return _si(self._exact(key, value), u)

    def quantities(self, stem: str, suffix: str, tail: str = "") -> tuple[float, ...] | None:
        """Return the list under ``stem_{unit}`` in SI; see `quantity`."""
        found = self._measured(stem, suffix, tail)
        if found is None:
            return None
        key, value, u = found
        if not isinstance(value, list):
            self._wrong_type(key, "a list of numbers", value)
        return tuple(_si(self._exact(key, v), u) for v in value)

    def done(self) -> None:
        """Refuse keys that nobody asked for, all of them at once."""
        faults = Faults(self.error)
        known = dict.fromkeys(self._known)
        unknown = [key for key in self.data if key not in known]
        for key in unknown[:_SAID]:
            with faults.gathered():
                self.fail(key, f"is not known{suggestion(key, known)}")
        faults.refuse()


class Faults:
    """What is wrong with one file, gathered and reported at once.

    Parameters
    ----------
    error : the exception that is gathered, and raised for all
    """

    def __init__(self, error: type[WeighbridgeError] = ConfigError) -> None:
        self.error = error
        self.said: list[str] = []

    @contextlib.contextmanager
    def gathered(self) -> Iterator[None]:
        """Keep an error that is raised inside for `refuse`."""
        try:
            yield
        except self.error as error:
            self.said.append(str(error))

    def refuse(self) -> None:
        """Raise one error that shows all that was gathered; nothing where there is none."""
        if self.said:
            raise self.error("; ".join(self.said))


def _rational(number: float) -> Fraction:
    """Read a unit's factor as the simple fraction it means, as 1/100 for 0.01."""
    simple = Fraction(number).limit_denominator(1_000_000)
    return simple if float(simple) == number else Fraction(number)


def _si(value: Fraction, u: Unit) -> float:
    return float(value * _rational(u.factor) + _rational(u.offset))


def exact_text(value: float, suffix: str) -> str:
    """Write an SI value in a file's unit, in the fewest digits that load back exactly."""
    u = unit(suffix)
    inside = Fraction(value)
    outside = (inside - _rational(u.offset)) / _rational(u.factor)
    for digits in range(1, 40):
        text = _decimal(outside, digits)
        if _si(Fraction(Decimal(text)), u) == value:
            return text
    return _decimal(outside, 40)


def rounded_text(
    value: float, suffix: str, *, digits: int | None = None, step: float | None = None
) -> str:
    """Write an SI value in a file's unit, rounded; no longer than `exact_text`.

    Parameters
    ----------
    value : in SI
    suffix : of the unit
    digits : significant ones to keep
    step : power of ten to round to instead, in the file's unit
    """
    exact = exact_text(value, suffix)
    number = Decimal(exact)
    place = math.floor(math.log10(step)) if step is not None else number.adjusted() + 1
    if digits is not None:
        place -= digits
    exponent = number.as_tuple().exponent
    if number == 0 or (isinstance(exponent, int) and exponent >= place):
        return exact
    rounded = number.quantize(Decimal(1).scaleb(place), context=Context(prec=60))
    return _decimal(Fraction(rounded), max(rounded.adjusted() - place + 1, 1))


def _decimal(value: Fraction, digits: int) -> str:
    """Round to significant digits, as a TOML float."""
    context = Context(prec=digits)
    number = context.divide(Decimal(value.numerator), Decimal(value.denominator))
    small = number == 0 or -6 <= number.adjusted() <= 15
    text = f"{number:f}" if small else f"{number:e}"
    if "e" in text.lower():
        mantissa, exponent = text.lower().split("e")
        return f"{mantissa if '.' in mantissa else mantissa + '.0'}e{int(exponent)}"
    return text if "." in text else f"{text}.0"


def read_toml(path: Path, error: type[WeighbridgeError] = ConfigError) -> Section:
    """Read a TOML file that a person wrote.

    Raises
    ------
    WeighbridgeError
        Of the type given: no such file, a device or a pipe, not text, or not TOML.
    """
    try:
        # To open a pipe that nobody writes to would wait without end.
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise error(f"{path} is a device or a pipe; name a file")
        with path.open("rb") as file:
            content = file.read(LONGEST_FILE + 1)
    except FileNotFoundError:
        raise error(f"{path}: no such file") from None
    except (OSError, ValueError) as e:
        reason = (e.strerror or e) if isinstance(e, OSError) else e
        raise error(f"{path} cannot be read: {reason}") from None
    if len(content) > LONGEST_FILE:
        raise error(
            f"{path} is longer than {LONGEST_FILE / 1e6:.0f} MB: it is no file that a person "
            "wrote; name another one"
        )
    try:
        text = content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as e:
        line = e.object[: e.start].count(b"\n") + 1
        raise error(f"{path} is not UTF-8 (line {line}): save it as UTF-8") from None
    return Section(parse_toml(text, str(path), error), str(path), key_lines(text), (), error)


def parse_toml(text: str, name: str, error: type[WeighbridgeError]) -> dict[str, Any]:
    """Parse TOML, numbers with a point as `Decimal`.

    Parameters
    ----------
    text : the file
    name : what it is called in messages
    error : the exception to raise

    Raises
    ------
    WeighbridgeError
        Of the type given: it is no TOML, or nested without end.
    """
    for number, line in enumerate(text.splitlines(), start=1):
        if line.count(".") > _DEEPEST and _dots(line) > _DEEPEST:
            raise error(
                f"{name}, line {number}: a key of more than {_DEEPEST} parts; sections are nested "
                "three deep at most"
            )
    try:
        return tomllib.loads(text, parse_float=Decimal)
    except tomllib.TOMLDecodeError as e:
        raise error(f"{name} is not valid TOML: {e}") from None
    except RecursionError:
        raise error(f"{name} is nested too deep; remove brackets inside brackets") from None
    except ValueError as e:
        # Python reads no whole number of more than some thousand digits.
        raise error(f"{name} holds a number that cannot be read ({e})") from None


def _dots(line: str) -> int:
    """Parts of the longest key in a line: the library's time grows with their square."""
    return max(len(_PART_OF_KEY.findall(piece)) for piece in _NO_KEY.split(line))


_DECIMAL: Final = re.compile(r"Decimal\('([^']*)'\)")
"""A number in a list, as Python writes it."""


def shortened(value: Any) -> str:
    """Text of a value, the first of it where it is long; no list inside lists is followed."""
    if isinstance(value, int) and value.bit_length() > _LARGEST_BITS:
        return f"one of {int(value.bit_length() * math.log10(2.0)) + 1} digits"
    try:
        text = str(value)
    except RecursionError:
        return "nested too deep"
    text = _DECIMAL.sub(r"\1", text)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]} …"
