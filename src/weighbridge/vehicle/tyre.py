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
"""One inch [m]."""

_METRIC: Final = re.compile(
    r"""^\s*(?:LT|P|C)?\s*
    (?P<width>\d{3}|\d{2}(?=\s*/))\s*
    (?:/\s*(?P<aspect>\d{2,3}))?\s*
    (?:Z?R|-)\s*
    (?P<rim>\d{2}(?:[.,]5)?)
    (?!\d)""",
    re.VERBOSE | re.IGNORECASE,
)
_INCHES: Final = re.compile(
    r"""^\s*
    (?:(?P<diameter>\d{2}(?:[.,]\d{1,2})?)\s*[xX×]\s*)?
    (?P<width>\d{1,2}(?:[.,]\d{1,2})?)\s*
    (?:R|-)\s*
    (?P<rim>\d{2}(?:[.,]5)?)
    (?!\d)""",
    re.VERBOSE | re.IGNORECASE,
)
"""Width in inches: ``11R22.5``, ``10.00R20``, and ``31x10.50R15`` with the diameter before it."""

_INCH_HEIGHT: Final = (1.06, 0.86)
"""Height over width of a tyre in inches [-]: of flat rims, such as 10.00 R 20, and of rims that
end in a half, such as 11 R 22.5. Makers print diameters of 1053 mm for the first and 1050 mm for
the second (Pirelli, truck size conversions); other sizes are within 2.5 % in radius."""

_LIMITS: Final = {"width": (125.0, 500.0), "aspect": (20.0, 107.0), "rim": (8.0, 26.0)}

_NARROWEST: Final = 60.0
"""Width of a tyre of motorcycles, at least, which all state their height [mm]."""


def rolling_radius(size: str) -> float:
    """Return the effective rolling radius of a tyre size.

    Parameters
    ----------
    size : as on the tyre's side, such as ``205/55 R16``, ``205/55R16 91V``, ``315/80 R 22.5``,
        ``195 R14 C``, or in inches ``11R22.5``, ``10.00R20`` or ``31x10.50R15``

    Returns
    -------
    Radius [m]; see `weighbridge.vehicle.data_sheet.RADIUS_STD` for how sure it is.

    Raises
    ------
    ConfigError
        The text is no tyre size.
    """
    found = _METRIC.match(size) or _INCHES.match(size)
    if found is None:
        raise ConfigError(
            f"tyre size {size[:40]!r}: must be written as on the tyre's side, such as "
            "'205/55 R16', '315/80 R22.5' or '11R22.5'"
        )
    parts = _parts({name: text.replace(",", ".") for name, text in found.groupdict("").items()})
    for name, (low, high) in _LIMITS.items():
        if name == "width" and found.groupdict().get("aspect"):
            low = _NARROWEST
        if not low <= parts[name] <= high:
            raise ConfigError(
                f"tyre size {size!r}: its {name} is {parts[name]:g}, and tyres have "
                f"{low:g} to {high:g}"
            )
    diameter = _INCH * parts["rim"] + 2e-3 * parts["width"] * parts["aspect"] / 100.0
    return ROLLING_CIRCUMFERENCE * diameter / (2.0 * math.pi)


def _parts(said: dict[str, str]) -> dict[str, float]:
    """Width [mm], height over width [%] and rim [in] of a size, metric or in inches."""
    rim, width = float(said["rim"]), float(said["width"])
    if "aspect" in said:
        aspect = float(said["aspect"]) if said["aspect"] else FULL_SECTION
        return {"width": width, "aspect": aspect, "rim": rim}
    aspect = 100.0 * _INCH_HEIGHT[rim % 1.0 > 0.0]
    if said["diameter"]:
        aspect = 50.0 * (float(said["diameter"]) - rim) / width
    return {"width": 1e3 * _INCH * width, "aspect": aspect, "rim": rim}
