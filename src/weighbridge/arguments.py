"""Arguments of a wrong type, refused in one sentence that says what was expected."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from numbers import Real
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.errors import ArgumentTypeError, ConfigError

# Letters of a word that may be a known one written wrong.
_LONGEST_WORD: Final = 100


def type_name(given: object) -> str:
    """Name what a caller gave, with the module of its type: ``pandas.Series``, ``int``."""
    return f"{type(given).__module__}.{type(given).__qualname__}".removeprefix("builtins.")


def is_frame(given: object) -> bool:
    """Say whether something is a data frame of pandas or polars."""
    home = type(given).__module__.partition(".")[0]
    return home in ("pandas", "polars") and type(given).__name__ == "DataFrame"


def check_type(name: str, given: object, kinds: type | tuple[type, ...], expected: str) -> None:
    """Refuse what is of none of the types.

    Parameters
    ----------
    name : of the argument
    given : its value
    kinds : types it may be of
    expected : in words, such as "a path as text or pathlib.Path"

    Raises
    ------
    ArgumentTypeError
        The sentence names the argument, what is expected and the type that came.
    """
    if not isinstance(given, kinds):
        raise ArgumentTypeError(f"{name} must be {expected}, got {_shown(given)}")


def check_text(name: str, given: object, *, optional: bool = False) -> None:
    """Refuse what is no text; see `check_type`."""
    if type(given) is not str and not (optional and given is None):
        check_type(name, given, str, "a text")


def check_number(name: str, given: object, *, optional: bool = False) -> None:
    """Refuse what is no number; see `check_type`."""
    if type(given) is float or (optional and given is None):
        return
    if isinstance(given, bool | np.bool_):
        raise ArgumentTypeError(f"{name} must be a number, got {_shown(given)}")
    check_type(name, given, Real, "a number")


def check_flag(name: str, given: object) -> None:
    """Refuse what is neither true nor false; see `check_type`."""
    check_type(name, given, (bool, np.bool_), "True or False")


def check_path(name: str, given: object) -> None:
    """Refuse what is no path; see `check_type`."""
    check_type(name, given, (str, Path), "a path, as text or pathlib.Path")
    if "\0" in str(given):
        raise ConfigError(
            f"{name} must be a path, and none has a zero character, got {given!r:.40}"
        )


def check_texts(name: str, given: object) -> None:
    """Refuse what is no series of texts; see `check_type`."""
    check_all(name, given, str, "texts")


def check_all(name: str, given: object, kind: type | tuple[type, ...], expected: str) -> None:
    """Refuse what is no series of such types; see `check_type`."""
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise ArgumentTypeError(f"{name} must be several {expected}, got {_shown(given)}")
    for one in given:
        check_type(f"each of {name}", one, kind, f"one of several {expected}")


def check_choice(name: str, given: object, known: Iterable[str]) -> None:
    """Refuse what is none of the known words.

    Parameters
    ----------
    name : of the argument
    given : its value
    known : words it may be

    Raises
    ------
    ConfigError
        The sentence names the argument, what it may be and what came, and a near miss.
    """
    if fault := choice_fault(name, given, known):
        raise ConfigError(fault)


def choice_fault(name: str, given: object, known: Iterable[str]) -> str:
    """Return the sentence of `check_choice`; empty where the value is a known word."""
    known = list(known)
    if given in known:
        return ""
    meant = near_miss(str(given), known)
    hint = f"; did you mean {meant}?" if meant else ""
    return f"{name} must be {either(known)}, got {given!r:.40}{hint}"


def either(words: Iterable[str]) -> str:
    """Write words as ``a, b or c``."""
    *most, last = words
    return f"{', '.join(most)} or {last}" if most else last


def suggestion(word: str, known: Iterable[str]) -> str:
    """Return ``; did you mean ...?`` for a near miss, or the known words."""
    known = list(known)
    meant = near_miss(word, known)
    return f"; did you mean {meant}?" if meant else f"; known are {', '.join(known)}"


def near_miss(word: str, known: Iterable[str]) -> str:
    """Return the known word that this one is nearly; empty where there is none."""
    if len(word) > _LONGEST_WORD:
        return ""
    lower = {k.lower(): k for k in known}
    near = difflib.get_close_matches(word.lower(), lower, n=1, cutoff=0.6)
    return lower[near[0]] if near else ""


def as_floats(name: str, given: object) -> NDArray[np.float64]:
    """Return numbers as an array of doubles; see `check_type` for what is none."""
    if isinstance(given, np.ndarray) and given.dtype == np.float64:
        return given
    try:
        array = np.asarray(given)
        if array.dtype.kind in "biuf":
            return array.astype(np.float64)
    except (TypeError, ValueError):
        pass
    raise ArgumentTypeError(f"{name} must be numbers, as an array or a list, got {_shown(given)}")


def _shown(given: Any) -> str:
    """A value that is short, else its type."""
    if given is None or isinstance(given, bool | int | float | str):
        return f"{given!r:.40}"
    return type_name(given)
