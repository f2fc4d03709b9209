"""A software weighbridge: the mass of a road vehicle, weighed while it drives.

>>> import weighbridge as wb
>>> car = wb.calibrate("known/", mass=1580.0)
>>> w = wb.weigh("drive/", car)
>>> w.mass, w.interval(0.95), w.status
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from weighbridge.first_use import at_first_use
from weighbridge.version import VERSION

__version__ = VERSION

if TYPE_CHECKING:
    from weighbridge import fleet
    from weighbridge.calibration import CalibrationSettings, calibrate
    from weighbridge.errors import ConfigError, DriveError, MissingExtraError, WeighbridgeError
    from weighbridge.estimators import Segment, Status
    from weighbridge.inertia import InertiaFilter, InertiaSettings
    from weighbridge.io import read_drive, read_drives, read_frame, to_frames
    from weighbridge.io.elevation import with_elevation
    from weighbridge.live import LiveScale, LiveStatus, LiveWeighing
    from weighbridge.pipeline.inertia import Inertia, estimate_inertia
    from weighbridge.pipeline.inspection import inspect_drive
    from weighbridge.pipeline.speed_bounds import CoastDown, MassBound, coast_down, mass_bound
    from weighbridge.pipeline.weighing import Weighing, compare, weigh
    from weighbridge.results.row import WeighingRow
    from weighbridge.signals import Drive, DriveInfo, Problem, Signal
    from weighbridge.vehicle import Vehicle

_HOMES = {
    "CoastDown": "weighbridge.pipeline.speed_bounds",
    "MassBound": "weighbridge.pipeline.speed_bounds",
    "coast_down": "weighbridge.pipeline.speed_bounds",
    "mass_bound": "weighbridge.pipeline.speed_bounds",
    "CalibrationSettings": "weighbridge.calibration",
    "ConfigError": "weighbridge.errors",
    "Drive": "weighbridge.signals",
    "DriveError": "weighbridge.errors",
    "DriveInfo": "weighbridge.signals",
    "Inertia": "weighbridge.pipeline.inertia",
    "InertiaFilter": "weighbridge.inertia",
    "InertiaSettings": "weighbridge.inertia",
    "LiveScale": "weighbridge.live",
    "LiveStatus": "weighbridge.live",
    "LiveWeighing": "weighbridge.live",
    "MissingExtraError": "weighbridge.errors",
    "Problem": "weighbridge.signals",
    "Segment": "weighbridge.estimators",
    "Signal": "weighbridge.signals",
    "Status": "weighbridge.estimators",
    "Vehicle": "weighbridge.vehicle",
    "Weighing": "weighbridge.pipeline.weighing",
    "WeighbridgeError": "weighbridge.errors",
    "calibrate": "weighbridge.calibration",
    "compare": "weighbridge.pipeline.weighing",
    "estimate_inertia": "weighbridge.pipeline.inertia",
    "fleet": "weighbridge.fleet",
    "inspect_drive": "weighbridge.pipeline.inspection",
    "read_drive": "weighbridge.io",
    "read_drives": "weighbridge.io",
    "read_frame": "weighbridge.io",
    "to_frames": "weighbridge.io",
    "WeighingRow": "weighbridge.results.row",
    "weigh": "weighbridge.pipeline.weighing",
    "with_elevation": "weighbridge.io.elevation",
}

__all__ = [
    "CalibrationSettings",
    "CoastDown",
    "ConfigError",
    "Drive",
    "DriveError",
    "DriveInfo",
    "Inertia",
    "InertiaFilter",
    "InertiaSettings",
    "LiveScale",
    "LiveStatus",
    "LiveWeighing",
    "MassBound",
    "MissingExtraError",
    "Problem",
    "Segment",
    "Signal",
    "Status",
    "Vehicle",
    "WeighbridgeError",
    "Weighing",
    "WeighingRow",
    "calibrate",
    "coast_down",
    "compare",
    "estimate_inertia",
    "fleet",
    "inspect_drive",
    "mass_bound",
    "read_drive",
    "read_drives",
    "read_frame",
    "to_frames",
    "weigh",
    "with_elevation",
]

__getattr__ = at_first_use(__name__, _HOMES)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
