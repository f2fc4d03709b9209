"""Torque of engine or motor as a control unit reports it: in N m, or in percent of a reference."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.messages import refused
from weighbridge.signals import Drive, Floats, Signal
from weighbridge.vehicle.torque_source import TorqueConstants

SAME_REFERENCE: Final = 0.02
"""Reference torques that differ by less are one [-]."""


def reference_torques(reference: Signal) -> list[tuple[float, float]]:
    """Reference torques that a drive reports, each in a tenth of the samples or more.

    Parameters
    ----------
    reference : with at least one sample [N m]

    Returns
    -------
    Values [N m] with the time each was reported first [s], in the order of time
    """
    order = np.argsort(reference.values)
    ascending = reference.values[order]
    cuts = np.flatnonzero(np.diff(ascending) > SAME_REFERENCE * np.abs(ascending[:-1])) + 1
    groups = [g for g in np.split(order, cuts) if g.size >= 0.1 * order.size]
    found = [
        (float(np.median(reference.values[g])), float(reference.time[g].min())) for g in groups
    ]
    return sorted(found, key=lambda f: f[1])


def _reference(drive: Drive, time: Floats, model: TorqueConstants) -> Floats:
    """Return the torque that a percent torque is a part of, at stamps [N m].

    That of the log; where the log has several, that of the vehicle file, else the last one.
    """
    reference = drive.get("reference_torque")
    if reference is not None and len(reference):
        if len(reference_torques(reference)) < 2:
            return np.full(time.size, np.median(reference.values))
        if model.reference_torque is None:
            last = np.searchsorted(reference.time, time, side="right") - 1
            return np.asarray(reference.values[np.maximum(last, 0)])
    if model.reference_torque is None:
        raise refused("torque.no_reference", drive=drive.name)
    return np.full(time.size, model.reference_torque)


def torque_in_nm(drive: Drive, time: Floats, _: TorqueConstants) -> Floats:
    """Torque that a drive reports, at stamps (n,) [N m]."""
    return drive.signals["engine_torque"].at(time)


def torque_in_percent(drive: Drive, time: Floats, model: TorqueConstants) -> Floats:
    """Torque that a drive reports in percent, at stamps (n,) [N m]."""
    return drive.signals["engine_torque_fraction"].at(time) * _reference(drive, time, model)
