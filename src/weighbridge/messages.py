"""Every sentence about data, by its id: what was found, what it does to the mass, what to do."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.resources import files
from typing import Any, Final, TypeVar

from weighbridge.arguments import check_flag, check_number, check_text, check_type
from weighbridge.customary import US, shown_amount, shown_unit
from weighbridge.errors import ConfigError, DriveError, WeighbridgeError
from weighbridge.visible import cut

_Error = TypeVar("_Error", bound=DriveError)

_ID: Final = re.compile(r"[a-z]+\.[a-z0-9_]+")

_FIELD: Final = r"\{(\w+)(?::[^{}]*)?\}"
_AMOUNTS: Final = re.compile(
    rf"({_FIELD}(?:(?: to | ± | and | or |–){_FIELD})*) ({'|'.join(map(re.escape, US))})(?![\w/²])"
)
"""Numbers of a message with the unit behind them."""


@dataclass(frozen=True, slots=True)
class Problem:
    """A finding about a drive: a fault that was corrected, a note beside a mass, or a refusal.

    Attributes
    ----------
    id : of the message, such as ``clock.step``; the first word is the area
    text : one sentence with the value and the remedy
    signal : name of the signal, or empty for the whole drive
    start, end : where in the drive [s]; None for all of it
    serious : a mass could be wrong because of it, so `weigh` refuses the drive
    values : what the sentence quotes, by name

    The text is cut to what a screen shows: what it quotes of a file may be endless.
    """

    id: str
    text: str
    signal: str = ""
    start: float | None = None
    end: float | None = None
    serious: bool = False
    values: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)

    def __post_init__(self) -> None:
        check_text("id of a problem", self.id)
        check_text("text of a problem", self.text)
        check_text("signal of a problem", self.signal)
        check_number("start of a problem", self.start, optional=True)
        check_number("end of a problem", self.end, optional=True)
        check_flag("serious", self.serious)
        check_type("values of a problem", self.values, Mapping, "a dictionary of values by name")
        if _ID.fullmatch(self.id) is None:
            raise ConfigError(
                f"id of a problem must be an area and a name, such as clock.step, got {self.id!r}"
            )
        object.__setattr__(self, "text", cut(self.text))

    @classmethod
    def of(
        cls,
        id: str,
        signal: str = "",
        /,
        *,
        start: float | None = None,
        end: float | None = None,
        serious: bool = False,
        **values: Any,
    ) -> Problem:
        """Return the message of the catalogue, with these values in it.

        Parameters
        ----------
        id, signal, start, end, serious : as of the class
        values : what the sentence quotes, by the names that the catalogue uses
        """
        text = _written(_form(id), signal=signal, start=start, end=end, **values)
        return cls(id, text, signal, _rounded(start), _rounded(end), bool(serious), _plain(values))

    @property
    def shown(self) -> str:
        """The text in the units that people chose, see `weighbridge.customary`.

        A message that was read from a file has lost its values, and stays as it is.
        """
        form = _form(self.id) if self.id in catalogue() else ""
        others = _in_shown_units(form, self.values)
        if others is None:
            return self.text
        form, values = others
        named = {"signal": self.signal, "start": self.start, "end": self.end}
        written = _written(_form(self.id), **{**named, **self.values})
        return self.text.replace(written, _written(form, **{**named, **values}))

    @classmethod
    def from_error(cls, error: Exception) -> Problem:
        """Return the message of an error that ends a weighing."""
        known = error.problem if isinstance(error, WeighbridgeError) else None
        if isinstance(known, Problem):
            return replace(known, serious=True)
        return cls.of("file.unusable", error=str(error), serious=True)

    def error(self, kind: type[_Error] = DriveError) -> _Error:  # type: ignore[assignment]
        """Return it as the error that ends a weighing, of a kind of `DriveError`."""
        error = kind(self.text)
        error.problem = self
        return error

    def at(self, source: str, signal: str = "") -> Problem:
        """Return the message with the file it is about before it."""
        return replace(self, text=f"{source}: {self.text}", signal=signal or self.signal)

    @property
    def line(self) -> str:
        """Return it as a vehicle file keeps it: id, colon, text."""
        return f"{self.id}: {self.text}"

    @classmethod
    def from_line(cls, line: str) -> Problem:
        """Return what `line` gave; a text without an id is of a file of before."""
        id, colon, text = line.partition(": ")
        if colon and id in catalogue():
            return cls(id, text)
        return cls.of("calibration.doubt", doubt=line)

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        return {
            "id": self.id,
            "signal": self.signal,
            "from_s": self.start,
            "to_s": self.end,
            "text": self.text,
        }

    @classmethod
    def from_dict(cls, record: Mapping[str, Any]) -> Problem:
        """Return what `to_dict` wrote."""
        return cls(
            record["id"],
            record["text"],
            record["signal"],
            record["from_s"],
            record["to_s"],
        )


class Explained:
    """A result with what was found: its ``refusal``, None where there is none, and `problems`."""

    __slots__ = ()
    refusal: Problem | None
    problems: tuple[Problem, ...]

    @property
    def reason(self) -> str:
        """Why there is no mass, one sentence; empty where there is."""
        return "" if self.refusal is None else self.refusal.text

    @property
    def reason_id(self) -> str | None:
        """Id of that sentence; None where there is a mass."""
        return None if self.refusal is None else self.refusal.id

    @property
    def warnings(self) -> tuple[str, ...]:
        """Texts of the `problems`."""
        return tuple(p.text for p in self.problems)


def _form(id: str) -> str:
    """Return a message of the catalogue with its fields in braces."""
    message = catalogue()[id]
    return "; ".join(message[part] for part in PARTS if part in message)


def _written(form: str, /, **values: Any) -> str:
    return form.format_map(values)


def _in_shown_units(form: str, values: Mapping[str, Any]) -> tuple[str, dict[str, Any]] | None:
    """Return a form and its values in the units that are shown; None where nothing changes."""
    changed: dict[str, Any] = {}

    def turned(found: re.Match[str]) -> str:
        fields, unit = found[1], found[found.re.groups]
        names = re.findall(_FIELD, fields)
        if shown_unit(unit) == unit or not all(_is_number(values.get(n)) for n in names):
            return found[0]
        changed.update({n: shown_amount(values[n], unit) for n in names})
        return f"{fields} {shown_unit(unit)}"

    form = _AMOUNTS.sub(turned, form)
    for name, value in values.items():
        if isinstance(value, Phrase):
            others = _in_shown_units(value.form, value.values)
            if others is not None:
                changed[name] = _written(others[0], **others[1])
    return (form, {**values, **changed}) if changed else None


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


PARTS: Final = ("text", "effect", "remedy")
"""Parts of a message: what was found, what it does to the mass, what to do."""


def refused(id: str, signal: str = "", /, **values: Any) -> DriveError:
    """Return the error of a drive that cannot be weighed, with a message of the catalogue."""
    return Problem.of(id, signal, serious=True, **values).error()


class Phrase(str):
    """A part of a sentence, with what it was made of.

    Attributes
    ----------
    form : of the catalogue, with its fields in braces
    values : of the fields
    """

    form: str
    values: Mapping[str, Any]


def phrase(name: str, /, **values: Any) -> Phrase:
    """Return a part of a sentence, which several messages may share, with these values in it."""
    form = _phrases()[name]
    made = Phrase(form.format_map(values))
    made.form, made.values = form, values
    return made


@cache
def catalogue() -> dict[str, dict[str, str]]:
    """Return the messages by id, as ``messages.toml`` has them: each with its `PARTS`."""
    areas = {area: names for area, names in _read().items() if area != "phrase"}
    return {
        f"{area}.{name}": parts for area, names in areas.items() for name, parts in names.items()
    }


@cache
def _phrases() -> dict[str, str]:
    return dict(_read()["phrase"])


@cache
def _read() -> dict[str, Any]:
    # Read when the first message is needed: most drives need none.
    import tomllib

    return tomllib.loads(files("weighbridge").joinpath("messages.toml").read_text(encoding="utf-8"))


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values without numbers of NumPy, which no record should keep."""
    return {k: v.item() if hasattr(v, "item") else v for k, v in values.items()}


def _rounded(time: float | None) -> float | None:
    return None if time is None else round(float(time), 6)
