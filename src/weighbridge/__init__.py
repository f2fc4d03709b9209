"""A software weighbridge: the mass of a road vehicle, weighed while it drives.

>>> import weighbridge as wb
>>> car = wb.calibrate("known/", mass=1580.0)
>>> w = wb.weigh("drive/", car)
>>> w.mass, w.interval(0.95), w.status
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from weighbridge.first_use import at_first_uses
from weighbridge.version import VERSION

__version__ = VERSION

if TYPE_CHECKING:
    from weighbridge import fleet as fleet
    from weighbridge.calibration import CalibrationSettings as CalibrationSettings
    from weighbridge.calibration import calibrate as calibrate
    from weighbridge.errors import ConfigError as ConfigError
    from weighbridge.errors import DriveError as DriveError
    from weighbridge.errors import MissingExtraError as MissingExtraError
    from weighbridge.errors import WeighbridgeError as WeighbridgeError
    from weighbridge.estimators import Segment as Segment
    from weighbridge.estimators import Status as Status
    from weighbridge.inertia import InertiaFilter as InertiaFilter
    from weighbridge.inertia import InertiaSettings as InertiaSettings
    from weighbridge.io import read_drive as read_drive
    from weighbridge.io import read_drives as read_drives
    from weighbridge.io import read_frame as read_frame
    from weighbridge.io import to_frames as to_frames
    from weighbridge.io.elevation import with_elevation as with_elevation
    from weighbridge.live import LiveScale as LiveScale
    from weighbridge.live import LiveStatus as LiveStatus
    from weighbridge.live import LiveWeighing as LiveWeighing
    from weighbridge.pipeline.inertia import Inertia as Inertia
    from weighbridge.pipeline.inertia import estimate_inertia as estimate_inertia
    from weighbridge.pipeline.inspection import inspect_drive as inspect_drive
    from weighbridge.pipeline.speed_bounds import CoastDown as CoastDown
    from weighbridge.pipeline.speed_bounds import MassBound as MassBound
    from weighbridge.pipeline.speed_bounds import coast_down as coast_down
    from weighbridge.pipeline.speed_bounds import mass_bound as mass_bound
    from weighbridge.pipeline.weighing import Weighing as Weighing
    from weighbridge.pipeline.weighing import compare as compare
    from weighbridge.pipeline.weighing import weigh as weigh
    from weighbridge.results.row import WeighingRow as WeighingRow
    from weighbridge.signals import Drive as Drive
    from weighbridge.signals import DriveInfo as DriveInfo
    from weighbridge.signals import Problem as Problem
    from weighbridge.signals import Signal as Signal
    from weighbridge.vehicle import Vehicle as Vehicle

__getattr__, _, __all__ = at_first_uses(
    __name__,
    {
        "calibration": "CalibrationSettings calibrate",
        "errors": "ConfigError DriveError MissingExtraError WeighbridgeError",
        "estimators": "Segment Status",
        "fleet": "fleet",
        "inertia": "InertiaFilter InertiaSettings",
        "io": "read_drive read_drives read_frame to_frames",
        "io.elevation": "with_elevation",
        "live": "LiveScale LiveStatus LiveWeighing",
        "pipeline.inertia": "Inertia estimate_inertia",
        "pipeline.inspection": "inspect_drive",
        "pipeline.speed_bounds": "CoastDown MassBound coast_down mass_bound",
        "pipeline.weighing": "Weighing compare weigh",
        "results.row": "WeighingRow",
        "signals": "Drive DriveInfo Problem Signal",
        "vehicle": "Vehicle",
    },
)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
