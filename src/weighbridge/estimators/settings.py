"""Settings of an estimator by their names: from a keyword, a text or a command's option."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Any, Final

from weighbridge.arguments import suggestion, type_name
from weighbridge.errors import ConfigError

WORD: Final = re.compile(r"(?!(true|false|nan|inf)$)[a-z][a-z_-]*")
"""A choice, which a command has without quotes."""

LIST: Final = re.compile(r"[^\[\],\"]+(,[^\[\],\"]+)+")
"""Numbers or words with commas between them, which a command has without brackets."""


def changed(settings: Any, given: Mapping[str, object]) -> Any:
    """Return settings with some values changed; they check themselves.

    Parameters
    ----------
    settings : a frozen dataclass of numbers, switches, choices, tuples of numbers or words and
        settings within; in place of None a number is taken: another part of vehicle or drive
        gives it
    given : new values by name; ``ekf.start.threshold`` names one of settings within

    Raises
    ------
    ConfigError
        A name is unknown, or a value is of another type or out of its range.
    """
    for name, value in given.items():
        settings = _with(settings, name, name.split("."), value)
    return settings


def differences(settings: Any) -> str:
    """Name what differs from the defaults: ``forgetting = 0.999``; empty where nothing does."""
    usual = _values(type(settings)())
    changed = {k: v for k, v in _values(settings).items() if v != usual[k]}
    return ", ".join(f"{k} = {_written(v)}" for k, v in changed.items())


def _written(value: Any) -> str:
    """Write a value as a command has it."""
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)


def parsed(texts: Sequence[str]) -> dict[str, object]:
    """Read values as a command has them: ``name=value``, the value as in TOML or one word.

    Raises
    ------
    ConfigError
        A text is not of that form, or a name stands twice.
    """
    found: dict[str, object] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value) or "\n" in value:
            raise ConfigError(f"{text!r}: write NAME=VALUE, such as forgetting=0.999")
        if name in found:
            raise ConfigError(f"{name} is set twice; give it once")
        if WORD.fullmatch(value):
            found[name] = value
            continue
        words = [word.strip() for word in value.split(",")]
        if len(words) > 1 and all(map(WORD.fullmatch, words)):
            found[name] = words
            continue
        whole = f"[{value}]" if LIST.fullmatch(value) else value
        try:
            found[name] = tomllib.loads(f"value = {whole}")["value"]
        except tomllib.TOMLDecodeError:
            raise ConfigError(
                f"{text!r}: a number, true, false, a word, or several with commas, is expected "
                "after ="
            ) from None
    return found


def _with(settings: Any, whole: str, path: list[str], value: object) -> Any:
    first, *rest = path
    known = [f.name for f in dataclasses.fields(settings)]
    if first not in known:
        raise ConfigError(f"there is no setting {whole!r}{suggestion(whole, _values(settings))}")
    old = getattr(settings, first)
    if dataclasses.is_dataclass(old) and rest:
        return dataclasses.replace(settings, **{first: _with(old, whole, rest, value)})
    if rest:
        raise ConfigError(f"setting {first} has none within, got {whole!r}")
    return dataclasses.replace(settings, **{first: _like(old, whole, value)})


def _values(settings: Any, before: str = "") -> dict[str, Any]:
    """Every setting by its whole name, those within settings too."""
    found: dict[str, Any] = {}
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name)
        if dataclasses.is_dataclass(value):
            found |= _values(value, f"{before}{field.name}.")
        else:
            found[before + field.name] = value
    return found


def _like(old: Any, name: str, value: Any) -> Any:
    """Return a value of the type of the one it replaces."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if isinstance(old, bool):
        fits, wanted = isinstance(value, bool), "true or false"
    elif isinstance(old, StrEnum):
        choices = [choice.value for choice in type(old)]
        fits, wanted = value in choices, f"one of {', '.join(choices)}"
        value = type(old)(value) if fits else value
    elif isinstance(old, int):
        fits, wanted = number and value == int(value), "a whole number"
        value = int(value) if fits else value
    elif isinstance(old, tuple) and old and isinstance(old[0], str):
        value = [value] if isinstance(value, str) else value
        fits = isinstance(value, list | tuple) and all(isinstance(v, str) for v in value)
        wanted = "words with commas"
        value = tuple(value) if fits else value
    elif isinstance(old, tuple):
        # An empty one says that there may be numbers; the settings know how many.
        fits = isinstance(value, list | tuple) and (not old or len(value) == len(old))
        fits = fits and all(isinstance(v, int | float) for v in value)
        wanted = f"{len(old) or ''} numbers with commas".strip()
        value = tuple(map(float, value)) if fits else value
    elif dataclasses.is_dataclass(old):
        fits, wanted = isinstance(value, type(old)), f"one of {', '.join(_values(old, f'{name}.'))}"
    else:
        fits, wanted = number, "a number"
        value = float(value) if fits else value
    if not fits:
        got = repr(value) if isinstance(value, int | float | str) else type_name(value)
        raise ConfigError(f"setting {name} takes {wanted}, got {got}")
    return value
