"""A vehicle file by a weighbridge ticket, beside the one that the drive was weighed with."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from weighbridge.calibration import calibrate
from weighbridge.errors import WeighbridgeError
from weighbridge.pipeline.weighing import weigh
from weighbridge.signals import Drive
from weighbridge.vehicle import Vehicle

_WORSE: Final = 1.2
"""A file that leaves so many times as much in every mass is the worse one [-]."""

_FAR: Final = 3.0
"""A mass so many standard deviations off the ticket contradicts it [-]."""


class Ticketed(NamedTuple):
    """What a ticket made of a vehicle.

    Attributes
    ----------
    vehicle : calibrated by the drive; None where the one before is the better one
    reported : one sentence
    """

    vehicle: Vehicle | None
    reported: str


def calibrated_by_ticket(drive: Drive, ticket: float, before: Vehicle) -> Ticketed:
    """Calibrate a vehicle by one drive, and compare what both files leave in every mass.

    A vehicle that contradicts the ticket is replaced by one that leaves more.

    Parameters
    ----------
    drive : of that load
    ticket : its mass by a weighbridge [kg]
    before : vehicle that it was weighed with

    Raises
    ------
    WeighbridgeError
        The drive calibrates nothing.
    """
    after = calibrate([drive], mass=ticket, vehicle=before)
    new, (mass, std, old) = _left(drive, after)[2], _left(drive, before)
    if math.isnan(mass) or abs(mass - ticket) > _FAR * std:
        said = "no mass" if math.isnan(mass) else f"{mass:.0f} ± {1.96 * std:.0f} kg"
        return Ticketed(after, f"the vehicle file before says {said} of this drive{_percent(new)}")
    if not new <= _WORSE * old:
        return Ticketed(
            None,
            f"made of this drive alone it would leave{_percent(new) or ' no mass'}, the vehicle "
            f"file before{_percent(old)}, and its {mass:.0f} ± {1.96 * std:.0f} kg agree with the "
            "ticket: keep that, or drive half an hour or more with starts and hills",
        )
    return Ticketed(after, f"it leaves{_percent(new)} in every mass, the one before{_percent(old)}")


def _percent(share: float) -> str:
    return f" ± {196.0 * share:.1f} %" if math.isfinite(share) else ""


def _left(drive: Drive, vehicle: Vehicle) -> tuple[float, float, float]:
    """Mass, its standard deviation [kg], and the share that no driving takes away [-]."""
    try:
        weighing = weigh(drive, vehicle)
    except WeighbridgeError:
        return math.nan, math.nan, math.nan
    if weighing.result is None or not math.isfinite(weighing.mass):
        return math.nan, math.nan, math.nan
    return weighing.mass, weighing.std, weighing.result.systematic_std / weighing.mass
