"""Many drives of many vehicles: weighed in parallel, kept as tables, gone on with after a kill."""

from __future__ import annotations

from typing import TYPE_CHECKING

from weighbridge.first_use import at_first_uses

if TYPE_CHECKING:
    from weighbridge.fleet.adapters import weigh_on_ray as weigh_on_ray
    from weighbridge.fleet.adapters import weigh_on_spark as weigh_on_spark
    from weighbridge.fleet.delta import write_delta as write_delta
    from weighbridge.fleet.figures import speed_mass as speed_mass
    from weighbridge.fleet.legs import Limits as Limits
    from weighbridge.fleet.page import write_page as write_page
    from weighbridge.fleet.reading import read_drives as read_drives
    from weighbridge.fleet.reading import read_segments as read_segments
    from weighbridge.fleet.reporting import FleetReport as FleetReport
    from weighbridge.fleet.reporting import report as report
    from weighbridge.fleet.run import weigh_drives as weigh_drives

__getattr__, __dir__, __all__ = at_first_uses(
    __name__,
    {
        "adapters": "weigh_on_ray weigh_on_spark",
        "delta": "write_delta",
        "figures": "speed_mass",
        "legs": "Limits",
        "page": "write_page",
        "reading": "read_drives read_segments",
        "reporting": "FleetReport report",
        "run": "weigh_drives",
    },
)
