"""Arguments of a wrong type, refused in one sentence that says what was expected."""

from __future__ import annotations

from collections.abc import Iterable
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weighbridge.errors import ArgumentTypeError, ConfigError


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
