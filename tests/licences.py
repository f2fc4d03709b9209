"""Licences of the packages that the program and its extras need, as their metadata state them.

``python -m tests.licences`` writes docs/licences.md anew.
"""

from __future__ import annotations

import re
import tomllib
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "licences.md"
OF_OTHERS = {"formats", "dev", "docs", "studies"}
"""Extras that are made of others, or not for users."""

READ = {
    "numba": "BSD-2-Clause",
    "pymap3d": "BSD-2-Clause",
    "pymatreader": "BSD-2-Clause",
    "rasterio": "BSD-3-Clause",
    "s3fs": "BSD-3-Clause",
    "scipy": "BSD-3-Clause",
}
"""Where the metadata leave the kind of BSD licence open: as read in the licence file."""

CLASSIFIERS = {
    "MIT License": "MIT",
    "Apache Software License": "Apache-2.0",
    "GNU Lesser General Public License v3 or later (LGPLv3+)": "LGPL-3.0-or-later",
}
TEXTS = {"MIT": "MIT", "BSD-2-Clause": "BSD-2-Clause", "Apache License, Version 2.0": "Apache-2.0"}

HEAD = """# Licences

The licence of weighbridge is MIT (`LICENSE`). The packages that it needs have licences of their
own. They are named here by their [SPDX](https://spdx.org/licenses/) identifiers, as the packages
state them. A test compares this page with the packages that are installed; `python -m
tests.licences` writes it.

A package that needs further packages is not followed. `pip install pip-licenses` lists those.

|package|licence|needed by|
|---|---|---|
"""

TAIL = """
The packages under the LGPL are in extras. They are installed beside the program and imported; no
code of theirs is in it.

## In the package itself

|what|licence|where|
|---|---|---|
|uPlot|MIT|the page of `weighbridge live`: `live/outputs/static/uplot/`|
|plotly.js|MIT|the reports, which hold a copy: `report/plotly/`|
"""


def needed() -> dict[str, list[str]]:
    """Extras that need each package; an empty name is the program itself."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = {"": project["dependencies"], **project["optional-dependencies"]}
    found: dict[str, list[str]] = {}
    for extra, lines in wanted.items():
        if extra not in OF_OTHERS:
            for line in lines:
                found.setdefault(Requirement(line).name.lower(), []).append(extra)
    return dict(sorted(found.items(), key=lambda item: ("" not in item[1], item[0].lower())))


def licence(name: str) -> str:
    """SPDX expression of an installed package."""
    stated = metadata.metadata(name)
    expression = stated.get("License-Expression")
    if expression:
        return expression
    if name in READ:
        return READ[name]
    prefix = "License :: OSI Approved :: "
    kinds = [c.removeprefix(prefix) for c in stated.get_all("Classifier") or ()]
    for kind in kinds:
        if kind in CLASSIFIERS:
            return CLASSIFIERS[kind]
    return TEXTS[stated["License"]]


def page() -> str:
    """Write the page, of the packages that are installed."""
    rows = (
        f"|{name}|{licence(name)}|"
        + ("every command" if "" in extras else ", ".join(f"`{e}`" for e in extras))
        + "|\n"
        for name, extras in needed().items()
    )
    return HEAD + "".join(rows) + TAIL


def identifiers(expression: str) -> list[str]:
    """SPDX identifiers of an expression, the main one first."""
    return re.findall(r"\b(?!(?:AND|OR|WITH)\b)[A-Za-z0-9.+-]+", expression)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
