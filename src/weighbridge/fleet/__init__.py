"""Many drives of many vehicles: weighed in parallel, kept as tables, gone on with after a kill."""

from __future__ import annotations

from typing import TYPE_CHECKING

from weighbridge.first_use import at_first_use

if TYPE_CHECKING:
    from weighbridge.fleet.adapters import weigh_on_ray, weigh_on_spark
    from weighbridge.fleet.delta import write_delta
    from weighbridge.fleet.figures import speed_mass
    from weighbridge.fleet.legs import Limits
    from weighbridge.fleet.page import write_page
    from weighbridge.fleet.reading import read_drives, read_segments
    from weighbridge.fleet.reporting import FleetReport, report
    from weighbridge.fleet.run import weigh_drives

_HOMES = {
    "FleetReport": "weighbridge.fleet.reporting",
    "Limits": "weighbridge.fleet.legs",
    "read_drives": "weighbridge.fleet.reading",
    "read_segments": "weighbridge.fleet.reading",
    "speed_mass": "weighbridge.fleet.figures",
    "report": "weighbridge.fleet.reporting",
    "weigh_drives": "weighbridge.fleet.run",
    "weigh_on_ray": "weighbridge.fleet.adapters",
    "weigh_on_spark": "weighbridge.fleet.adapters",
    "write_delta": "weighbridge.fleet.delta",
    "write_page": "weighbridge.fleet.page",
}

__all__ = [
    "FleetReport",
    "Limits",
    "read_drives",
    "read_segments",
    "report",
    "speed_mass",
    "weigh_drives",
    "weigh_on_ray",
    "weigh_on_spark",
    "write_delta",
    "write_page",
]

__getattr__ = at_first_use(__name__, _HOMES)


def __dir__() -> list[str]:
    return sorted(__all__)
