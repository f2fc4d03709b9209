"""Options of the commands: their words out of `options.toml`, and the names that they take."""

from __future__ import annotations

from collections.abc import Callable, Iterable
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


class TellsMethods(TyperCommand):
    """A command whose help lists the estimators, read only where help is asked for."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help page."""
        from weighbridge.estimators import ESTIMATORS

        for option in self.params:
            if isinstance(option, TyperOption) and option.name == "method":
                option.help = f"Estimator: {ESTIMATORS.names}."
        super().format_help(ctx, formatter)


class TellsSources(TyperCommand):
    """A command whose help lists the torque sources, read only where help is asked for."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help page."""
        self.name_sources()
        super().format_help(ctx, formatter)

    def name_sources(self) -> None:
        """List the torque sources in the help of ``--torque``."""
        for option in self.params:
            if isinstance(option, TyperOption) and option.name == "torque":
                option.help = f"Torque source of the drives: {sources()}."


def sources() -> str:
    """Each torque source by its name, with what it is."""
    from weighbridge.vehicle import TORQUE_SOURCES

    return ", ".join(f"{source.name} ({source.title})" for source in TORQUE_SOURCES.values())


def method_names(incomplete: str) -> list[str]:
    """Estimators that begin so, for the completion of the shell."""
    from weighbridge.estimators import ESTIMATORS

    return _beginning(ESTIMATORS, incomplete)


def source_names(incomplete: str) -> list[str]:
    """Torque sources that begin so."""
    from weighbridge.vehicle import TORQUE_SOURCES

    return _beginning(TORQUE_SOURCES, incomplete)


def class_names(incomplete: str) -> list[str]:
    """Vehicle classes that begin so."""
    from weighbridge.vehicle import VEHICLE_CLASSES

    return _beginning(VEHICLE_CLASSES, incomplete)


def scenario_names(incomplete: str) -> list[str]:
    """Scenarios of the simulator that begin so."""
    from weighbridge.simulation.named import SCENARIOS

    return _beginning((*SCENARIOS, "ride"), incomplete)


def effect_names(incomplete: str) -> list[str]:
    """Effects of the simulator that begin so."""
    from dataclasses import fields

    from weighbridge.simulation.scenario import Effects

    return _beginning((f.name for f in fields(Effects)), incomplete)


def filter_names(incomplete: str) -> list[str]:
    """Filters of the ride that begin so."""
    from weighbridge.inertia import METHODS

    return _beginning(METHODS, incomplete)


def paper_names(incomplete: str) -> list[str]:
    """Papers that begin so."""
    from weighbridge.papers import PAPERS

    return _beginning((*PAPERS, "all"), incomplete)


def slice_names(incomplete: str) -> list[str]:
    """Slices of the benchmark that begin so."""
    from weighbridge.benchmark.plan import CALIBRATIONS, CLASSES, EQUIPMENT

    return _beginning((*CLASSES, *EQUIPMENT, *CALIBRATIONS), incomplete)


def source_kinds(incomplete: str) -> list[str]:
    """Kinds of live sources that begin so, with the colon behind them."""
    from weighbridge.live import SOURCES

    return _beginning((f"{name}:" for name in SOURCES), incomplete)


def one_of(*names: str) -> Callable[[str], list[str]]:
    """Return the completion of an option that takes one of these names."""
    return lambda incomplete: _beginning(names, incomplete)


def _beginning(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]
