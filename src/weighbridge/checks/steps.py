"""Steps of the torque's reading: those in which the control unit sent it in the calibration?"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from weighbridge.checks.needed import show
from weighbridge.navigation.aiding import resolution
from weighbridge.signals import Drive, Floats, Problem
from weighbridge.vehicle.model import Vehicle

SAME: Final = 0.003
"""Steps that differ by less are the same [-]: what is written with few digits."""

FARTHEST: Final = 1.9
"""Steps this factor wider are those of another logger, which rounds more; as much finer, they are
no steps any more [-]."""

NEAR: Final = 0.1
"""Part of a step within which a value lies on it [-]: of any values a fifth do."""

OFF: Final = 0.5
"""Part of the values on the steps below which they are none of the values' [-]: false cells are
few."""

FEWEST: Final = 500
"""Fewer samples show no steps."""

POUND_FOOT: Final = 1.35581795
"""A pound-foot [N m]."""


def reading_step(values: Floats) -> float:
    """Step in which a reading was sent [SI], 0 where none shows."""
    return resolution(np.round(values, 9)) if values.size >= FEWEST else 0.0


def check_steps(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Compare the steps of the torque's reading with those of the calibration.

    A control unit sends whole steps. Where they are others, the reading was multiplied after it was
    sent: by the factor of a mapping, a DBC or an app, or by a unit. Where it lies between them, it
    was filtered or worked out anew. What the control unit itself reads wrong has steps as before.
    """
    known = None if vehicle is None else vehicle.torque.reading_step
    if vehicle is None or known is None:
        return
    name = vehicle.torque.of_source.found(drive)[0]
    signal = drive.get(name)
    if signal is None or len(signal) < FEWEST or _on_steps(signal.values, known) > OFF:
        return
    step = reading_step(signal.values)
    ratio = step / known
    before = f"{name} came in steps of {show(name, known)} in the calibration"
    if ratio < 1.0 / FARTHEST:
        yield Problem(
            name,
            f"{before}, and lies between them here: it was filtered, multiplied or worked out anew "
            "after it was sent, or another source tells it, and a mass may be wrong by as much; "
            "record it as in the calibration",
        )
    elif abs(ratio - 1.0) > SAME and ratio < FARTHEST:
        unit = _unit(ratio) if name == "engine_torque" else ""
        yield Problem(
            name,
            f"{before}, and comes in steps of {show(name, step)} here: it was multiplied by "
            f"{ratio:.3g} after it was sent{unit}, and a mass is wrong by about as much; correct "
            "its unit or factor in the mapping, or calibrate with the logger in use",
            serious=bool(unit),
        )


def _on_steps(values: Floats, step: float) -> float:
    """Part of the values that lie on the steps [-]; zeros lie on any."""
    place = values[values != 0.0] / step
    if place.size < FEWEST:
        return 1.0
    return float(np.mean(np.abs(place - np.rint(place)) < NEAR))


def _unit(ratio: float) -> str:
    """Which unit a torque is in or is taken for, in words; empty where it is none."""
    if abs(ratio * POUND_FOOT - 1.0) < SAME:
        return ", as pound-feet that are taken for N m are"
    if abs(ratio / POUND_FOOT - 1.0) < SAME:
        return ", as N m that are taken for pound-feet are"
    return ""
