"""Code and entry points of the recipes in CONTRIBUTING.md."""

import re
from pathlib import Path

GUIDE = (Path(__file__).parents[1] / "CONTRIBUTING.md").read_text(encoding="utf-8")


def code(name: str) -> str:
    """Return the block of Python whose first line names a file."""
    (found,) = re.findall(rf"```python\n# {re.escape(name)}\n(.*?)```", GUIDE, re.DOTALL)
    return found


def entry_points() -> dict[str, str]:
    """Return the entry points that the recipes write into pyproject.toml, by their group."""
    blocks = re.findall(
        r'```toml\n\[project\.entry-points\."([\w.]+)"\]\n(\w+) = "([\w:]+)"\n```', GUIDE
    )
    return {group: f"{name} = {target}" for group, name, target in blocks}
