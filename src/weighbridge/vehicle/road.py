"""Road load and inertias of a vehicle: each a value that knows how sure it is and where it is from.

Physics reads value and standard deviation; the origin is for people.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from weighbridge.vehicle.classes import Usual


class Origin(StrEnum):
    """Where a value is from."""

    GIVEN = "given"
    CLASS = "class"
    FITTED = "fitted"


@dataclass(frozen=True, slots=True)
class Value:
    """A number that knows how sure it is.

    Attributes
    ----------
    value, std : in one unit; ``std`` is 0 where a calibration held the value
    origin : stated, usual for the class, or fitted by a calibration
    """

    value: float
    std: float
    origin: Origin


@dataclass(frozen=True, slots=True)
class Road:
    """What resists a vehicle beside its mass.

    Attributes
    ----------
    drag_area : C_d A [m^2]
    rolling_coefficient : C_r [-]
    engine_inertia : all that turns with engine or motor [kg m^2]
    wheel_inertia : all wheels and what turns with them [kg m^2]
    """

    drag_area: Value
    rolling_coefficient: Value
    engine_inertia: Value
    wheel_inertia: Value


def known_value(
    stated: float | None, stated_std: float | None, usual: Usual, *, calibrated: bool
) -> Value:
    """Choose between what a vehicle file states and what is usual for its class.

    A value that is stated without a standard deviation is as unsure as its class: catalogue values
    are those of another body, another tyre. A calibration that gives none has held the value, and
    counts that in the scale it leaves in every mass.

    Parameters
    ----------
    stated, stated_std : of the vehicle file; None where it does not say
    usual : mean and standard deviation of the class
    calibrated : the file says what a calibration leaves in every mass
    """
    mean, spread = usual
    if stated is None:
        return Value(mean, spread if stated_std is None else stated_std, Origin.CLASS)
    if calibrated:
        return Value(stated, stated_std or 0.0, Origin.FITTED)
    return Value(stated, spread if stated_std is None else stated_std, Origin.GIVEN)
