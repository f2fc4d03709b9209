"""Options of the commands: their words out of `options.toml`, and the names that they take."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import typer
from typer.core import TyperCommand, TyperOption

from weighbridge.data import toml_of

FORMATS: Final = ("parquet", "csv")
"""Formats of the tables of a drive."""

_WORDS: Final = toml_of("cli", "options.toml")


def option(name: str, **settings: Any) -> Any:
    """Return an option of a command, with its words of `options.toml`.

    Parameters
    ----------
    name : command and option, such as ``weigh --json``; the option alone where several share it
    settings : of `typer.Option`
    """
    command, _, wanted = name.rpartition(" ")
    for key, words in _WORDS[command or "every"].items():
        if wanted in key.split():
            flags = [part for part in key.split() if part.startswith("-")]
            settings.setdefault("metavar", " ".join(key.split()[len(flags) :]) or None)
            return typer.Option(*flags, help=words, **settings)
    raise KeyError(name)


def argument(name: str, **settings: Any) -> Any:
    """Return an argument of a command, likewise, such as ``convert OUT``."""
    command, _, key = name.rpartition(" ")
    return typer.Argument(help=_WORDS[command or "every"][key], **settings)


class ListsNames(TyperCommand):
    """A command whose help lists estimators or torque sources, read where help is asked for."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help page."""
        self.list_names()
        super().format_help(ctx, formatter)

    def list_names(self) -> None:
        """List the names in the help of ``--method`` and ``--torque`` that has no more words."""
        from weighbridge.estimators import ESTIMATORS
        from weighbridge.vehicle import TORQUE_SOURCES

        sources = ", ".join(f"{s.name} ({s.title})" for s in TORQUE_SOURCES.values())
        for key, names in {"--method": ESTIMATORS.names, "--torque": sources}.items():
            words = _WORDS["every"][key]
            for option in self.params:
                if isinstance(option, TyperOption) and option.help == words:
                    option.help = f"{words.removesuffix('.')}: {names}."


def _names(*tables: str, also: tuple[str, ...] = (), end: str = "") -> Callable[[str], list[str]]:
    """Return the completion of an option by the names of tables, imported when they are asked for.

    Parameters
    ----------
    tables : such as ``estimators:ESTIMATORS``, within this package
    also : further names
    end : behind each name
    """

    def found(incomplete: str) -> list[str]:
        from pkgutil import resolve_name

        named = (f"{n}{end}" for t in tables for n in resolve_name(f"weighbridge.{t}"))
        return [name for name in (*named, *also) if name.startswith(incomplete)]

    return found


method_names: Final = _names("estimators:ESTIMATORS")
source_names: Final = _names("vehicle:TORQUE_SOURCES")
class_names: Final = _names("vehicle:VEHICLE_CLASSES")
scenario_names: Final = _names("simulation.named:SCENARIOS", also=("ride",))
effect_names: Final = _names("simulation.scenario:Effects.__dataclass_fields__")
filter_names: Final = _names("inertia:METHODS")
paper_names: Final = _names("papers:PAPERS", also=("all",))
slice_names: Final = _names(
    *(f"benchmark.plan:{t}" for t in ("CLASSES", "EQUIPMENT", "CALIBRATIONS"))
)
source_kinds: Final = _names("live:SOURCES", end=":")
"""Completions for the shell."""


def one_of(*names: str) -> Callable[[str], list[str]]:
    """Return the completion of an option that takes one of these names."""
    return _names(also=names)
