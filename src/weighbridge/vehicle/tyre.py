"""Rolling radius of a tyre from what stands on its side."""

from __future__ import annotations

import math
import re
from typing import Final

from weighbridge.errors import ConfigError

ROLLING_CIRCUMFERENCE: Final = 3.05
"""Rolling circumference of a radial tyre at 60 km/h over its design diameter [-]: ETRTO Standards
Manual, General notes; a circle has pi, the loaded tyre 3 % less."""

FULL_SECTION: Final = 82.0
"""Height over width of a tyre that states none, such as 195 R14 C [%]."""

_INCH: Final = 0.0254

_METRIC: Final = re.compile(
    r"""^\s*(?:LT|P|C)?\s*
    (?P<width>\d{3})\s*
    (?:/\s*(?P<aspect>\d{2,3}))?\s*
    (?:Z?R|-)\s*
    (?P<rim>\d{2}(?:[.,]5)?)
    (?!\d)""",
    re.VERBOSE | re.IGNORECASE,
)
_LIMITS: Final = {"width": (125.0, 500.0), "aspect": (20.0, 100.0), "rim": (10.0, 26.0)}


def rolling_radius(size: str) -> float:
    """Return the effective rolling radius of a tyre size.

    Parameters
    ----------
    size : as on the tyre's side, such as ``205/55 R16``, ``205/55R16 91V``, ``315/80 R 22.5`` or
        ``195 R14 C``

    Returns
    -------
    Radius [m]; see `weighbridge.vehicle.data_sheet.RADIUS_STD` for how sure it is.

    Raises
    ------
    ConfigError
        The text is no tyre size.
    """
    found = _METRIC.match(size)
    if found is None:
        raise ConfigError(
            f"tyre size {size[:40]!r}: must be written as on the tyre's side, such as '205/55 R16'"
        )
    parts = {
        "width": float(found["width"]),
        "aspect": float(found["aspect"]) if found["aspect"] else FULL_SECTION,
        "rim": float(found["rim"].replace(",", ".")),
    }
    for name, (low, high) in _LIMITS.items():
        if not low <= parts[name] <= high:
            raise ConfigError(
                f"tyre size {size!r}: its {name} is {parts[name]:g}, and tyres have "
                f"{low:g} to {high:g}"
            )
    diameter = _INCH * parts["rim"] + 2e-3 * parts["width"] * parts["aspect"] / 100.0
    return ROLLING_CIRCUMFERENCE * diameter / (2.0 * math.pi)
