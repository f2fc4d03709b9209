"""Pages of the reference: every public name, and every command with its options."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import Any, get_args

from typer.main import get_command

from weighbridge.cli.listed import ListsNames

GROUPS = {
    "Weigh": (
        "weigh", "compare", "calibrate", "inspect_drive", "Weighing", "WeighingRow", "Segment",
        "Status", "CalibrationSettings",
    ),
    "Vehicle": ("Vehicle",),
    "Drives": (
        "read_drive", "read_drives", "read_frame", "to_frames", "with_elevation", "Drive",
        "DriveInfo", "Signal", "Problem",
    ),
    "Live": ("LiveScale", "LiveWeighing", "LiveStatus"),
    "Inertia from the ride": ("estimate_inertia", "Inertia", "InertiaFilter", "InertiaSettings"),
    "Speed alone": ("mass_bound", "MassBound", "coast_down", "CoastDown"),
    "Errors": ("WeighbridgeError", "DriveError", "ConfigError", "MissingExtraError"),
}  # fmt: skip
"""Names of ``import weighbridge as wb``, in the order in which a reader meets them."""

MODULES = {
    "reference/fleet.md": ("Fleet", "weighbridge.fleet"),
    "reference/simulation.md": ("Simulation", "weighbridge.simulation"),
}
"""Pages by module: title, and the module whose ``__all__`` they hold."""

PARTS = {
    "weighbridge.io": (
        "FORMATS", "Format", "Takes", "read_drive", "read_drives", "read_frame", "read_table",
        "to_frames", "write_drive", "write_mdf", "write_table",
    ),
    "weighbridge.signals": (
        "QUANTITIES", "Bools", "Drive", "DriveInfo", "Floats", "Ints", "Problem", "Quantity",
        "Signal", "clean_columns", "scalar_to_si",
    ),
    "weighbridge.balance": (
        "REASON_TEXT", "ForceBalance", "ForceTable", "Reason", "force_balance",
    ),
    "weighbridge.estimators": ("ESTIMATORS", "Estimator", "MassTrack", "Segment", "Status"),
}  # fmt: skip
"""What packages of others build on, by its room; rooms hand out more to each other."""

RECORDS = (
    "weighbridge.vehicle.torque_source.TorqueSource",
    "weighbridge.vehicle.classes.VehicleClass",
    "weighbridge.live.sources.kind.SourceKind",
)
"""Records that a package of another may hand in, beside those of the modules."""

RECIPES = (
    "weighbridge.io.log.Log",
    "weighbridge.io.channels.Recording",
    "weighbridge.io.channels.reader",
    "weighbridge.io.channels.drafter",
    "weighbridge.vehicle.torque_sources.REPORTED",
    "weighbridge.vehicle.torque_sources.ROUGH",
    "weighbridge.estimators.regression.regression",
    "weighbridge.estimators.joint.terms.Term",
    "weighbridge.checks.Check",
    "weighbridge.estimators.gate.GateSettings",
    "weighbridge.estimators.judging.Evidence",
    "weighbridge.estimators.judging.judge",
    "weighbridge.estimators.judging.nothing",
    "weighbridge.estimators.judging.consider_std",
    "weighbridge.live.clock.now",
    "weighbridge.live.device_clock.DeviceClock",
    "weighbridge.live.sources.gathered.Gathered",
    "weighbridge.live.sources.gathered.BLOCK",
    "weighbridge.live.sources.links.serial_or_tcp",
    "weighbridge.inertia.ride_checks.ride_samples",
)
"""What the recipes of CONTRIBUTING.md and pages of the methods take besides."""


def groups() -> dict[str, tuple[str, ...]]:
    """Return `GROUPS`; public names that stand in none are in one of their own."""
    named = {name for names in GROUPS.values() for name in names} | {"fleet"}
    rest = tuple(n for n in import_module("weighbridge").__all__ if n not in named)
    return {**GROUPS, "Others": rest} if rest else GROUPS


def python_pages() -> dict[str, str]:
    """Return the pages of the Python reference by their place."""
    lines = ["# Python", "", "`import weighbridge as wb` gives these names as `wb.NAME`.", ""]
    for title, names in groups().items():
        lines += [f"## {title}", ""]
        for name in names:
            lines += _entry(f"weighbridge.{name}")
    pages = {"reference/python.md": "\n".join(lines)}
    for place, (title, module) in MODULES.items():
        lines = [f"# {title}", "", *_entries(module, import_module(module).__all__)]
        pages[place] = "\n".join(lines)
    lines = ["# Parts to build on", ""]
    for module, names in PARTS.items():
        lines += _entries(module, names)
    lines += ["## Records of entry points", ""]
    for name in RECORDS:
        lines += _entry(name)
    lines += ["## What recipes take besides", ""]
    for name in RECIPES:
        lines += _entry(name)
    pages["reference/parts.md"] = "\n".join(lines)
    return pages


def commands_page() -> str:
    """Return the page of all commands: use, what each does, its options."""
    from weighbridge.cli.main import app

    lines = ["# Commands", "", "`weighbridge COMMAND --help` says the same on a terminal.", ""]
    lines += [
        "Exit status: 0 a mass was found. 1 no mass can be found, and the reason is shown. "
        "2 bad input or wrong usage, in one line. 130 interrupted. 141 nobody reads on.",
        "",
    ]
    _tell(get_command(app), "weighbridge", lines)
    return "\n".join(lines)


def _entries(module: str, names: Iterable[str]) -> list[str]:
    lines = [f"## `{module}`", ""]
    for name in names:
        lines += _entry(f"{module}.{name}")
    return lines


def _entry(name: str) -> list[str]:
    return [f"::: {name}", "    options:", "      heading_level: 3", ""]


def _tell(command: Any, words: str, lines: list[str]) -> None:
    """Add a command and the commands below it to the lines of the page."""
    inside = getattr(command, "commands", None)
    if words != "weighbridge":
        own = getattr(command, "fallback", command)
        if isinstance(own, ListsNames):
            own.list_names()
        lines += [f"## {words}", "", _paragraphs(getattr(command, "help", "") or ""), ""]
        rows = [_row(p) for p in own.params if p.name != "help" and not p.hidden]
        if rows:
            lines += ["| argument or option | value | meaning |", "|---|---|---|", *rows, ""]
    for name, below in (inside or {}).items():
        if not getattr(below, "hidden", False):
            _tell(below, f"{words} {name}", lines)


def _paragraphs(text: str) -> str:
    """Set the help of a command; its example is a block."""
    parts = []
    for part in text.replace("\f", "\n\n").split("\n\n"):
        said = " ".join(part.split())
        if said.startswith("Example: "):
            said = f"    {said.removeprefix('Example: ')}"
        parts.append(said)
    return "\n\n".join(parts)


def _row(parameter: Any) -> str:
    """Return the row of an argument or an option."""
    said = " ".join((parameter.help or "").split())
    if not hasattr(parameter, "is_flag"):
        return f"| `{(parameter.metavar or parameter.name).upper()}` | | {_cell(said)} |"
    names = ", ".join(f"`{n}`" for n in (*parameter.opts, *parameter.secondary_opts))
    value = "" if parameter.is_flag else parameter.metavar or _kind(parameter)
    default = parameter.default
    if isinstance(default, str | int | float) and default != "" and not parameter.is_flag:
        said = f"{said} Otherwise {default}."
    return f"| {names} | {_cell(value)} | {_cell(said)} |"


def _kind(parameter: Any) -> str:
    """Return what the value of an option is, by its annotation."""
    kind = parameter.type_descriptor.annotation
    kind = (get_args(kind) or (kind,))[0]
    return {Path: "path", str: "text", float: "number", int: "whole number"}.get(kind, "")


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")
