"""Pages of the studies: templates, with figures in the places of their names."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path


def filled(template: Path, values: Mapping[str, str]) -> str:
    """Return a template with a value for each name in braces."""
    text = template.read_text(encoding="utf-8")
    for name, value in values.items():
        text = text.replace("{" + name + "}", value)
    return text
