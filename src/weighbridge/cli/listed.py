"""Help of ``--torque``: the torque sources there are, those of other packages included."""

from __future__ import annotations

from typing import Any

from typer.core import TyperCommand, TyperOption


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
    from weighbridge.vehicle.torque_sources import TORQUE_SOURCES

    return ", ".join(f"{source.name} ({source.title})" for source in TORQUE_SOURCES.values())
