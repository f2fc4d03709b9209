"""Modules and entry points of `examples/extension`, which the recipes in CONTRIBUTING.md name."""

import tomllib
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "examples" / "extension"


def code(name: str) -> str:
    """Return the text of a module."""
    return (PACKAGE / name).read_text(encoding="utf-8")


def entry_points() -> dict[str, str]:
    """Return the line of each entry point, by its group."""
    project = tomllib.loads((PACKAGE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return {
        group: f"{name} = {target}"
        for group, points in project["entry-points"].items()
        for name, target in points.items()
    }
