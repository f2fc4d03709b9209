"""Do the masses of a calibration go together, with each other and with the permitted one?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.calibration.doubted_motion import doubted_gains
from weighbridge.errors import DriveError
from weighbridge.estimators import joint
from weighbridge.estimators.joint.problem import UNMODELLED
from weighbridge.signals import Floats
from weighbridge.vehicle.model import Vehicle
from weighbridge.vehicle.torque import source_of

DOUBTED: Final = 0.06
"""A drive that weighs so much more or less than the others by the file made of all is told [-]: of
nine simulated vehicles the farthest of three drives was 0.03 off, with one mass of three 20 % off
0.21 to 0.32."""

_BOTH_MISSING: Final = (
    "state tare_kg and gross_kg under [vehicle] of --vehicle, or --tare, so that they can be "
    "checked"
)
_GROSS_MISSING: Final = "state gross_kg under [vehicle] of --vehicle, so that they can be checked"

SURE: Final = 0.12
"""The same above which there is no calibration [-]."""

SIGNIFICANT: Final = 4.0
"""Standard deviations by which it has to be off as well [-]."""

OVER: Final = 1.02
"""Mass over the permitted one from which it is told [-]."""


def doubted_masses(
    vehicle: Vehicle, balances: Sequence[ForceBalance], masses: Sequence[float]
) -> list[str]:
    """Say which masses of a calibration are doubtful, or motions, one sentence each.

    Parameters
    ----------
    vehicle : calibrated; with the permitted mass, where it is known
    balances : of its drives
    masses : they were calibrated with [kg]

    Raises
    ------
    DriveError
        One mass contradicts the others.
    """
    names, gross = vehicle.provenance.drives, vehicle.gross
    contradictions = [
        f"{name} has {kg:.0f} kg by the calibration, above the permitted mass of {gross:.0f} kg: "
        "if that was not so, every mass is too heavy by as much; weigh it again"
        for name, kg in zip(names, masses, strict=True)
        if gross is not None and kg > OVER * gross
    ]
    contradictions += doubted_gains(names, [b.motion for b in balances])
    fit = vehicle.provenance.fit
    if fit is None or not fit.refined or len(masses) < 2:
        return contradictions
    tracks = [joint.estimate(b, vehicle, load_changes=False) for b in balances]
    left = np.array(masses) - np.array([float(b.table.fuel_burnt[-1]) for b in balances])
    ratios = np.array([t.mass for t in tracks]) / left
    stds = UNMODELLED * np.array([t.bound_std for t in tracks]) / left
    return contradictions + contradicting(names, masses, ratios, stds)


def refuse_too_heavy(vehicle: Vehicle, masses: Sequence[float], doubts: Sequence[str]) -> None:
    """Refuse masses that are too heavy by two signs: the permitted mass, and what the drives show.

    Parameters
    ----------
    vehicle : calibrated
    masses : it was calibrated with [kg]
    doubts : sentences that say that the masses are too heavy; a single sign is told and kept

    Raises
    ------
    DriveError
        Both are there.
    """
    gross = vehicle.gross
    if gross is None or not doubts or max(masses) <= OVER * gross:
        return
    name = vehicle.provenance.drives[int(np.argmax(masses))]
    raise DriveError(
        f"{name} has {max(masses):.0f} kg by the calibration, above the permitted mass of "
        f"{gross:.0f} kg, and {doubts[0]}; weigh it again, or correct gross_kg under [vehicle] of "
        "--vehicle"
    )


def contradicting(
    names: Sequence[str], masses: Sequence[float], ratios: Floats, stds: Floats
) -> list[str]:
    """Say which drive weighs otherwise than the others, by the file that was made of all.

    Parameters
    ----------
    names : of the drives
    masses : they were calibrated with [kg]
    ratios : weighed mass over it (n,) [-]; NaN where a drive was not weighed
    stds : standard deviations of the ratios (n,) [-]

    Raises
    ------
    DriveError
        It weighs otherwise by more than `SURE`.
    """
    known = np.flatnonzero(np.isfinite(ratios) & np.isfinite(stds) & (stds > 0.0))
    if known.size < 2:
        return []
    off = np.zeros(ratios.size)
    for k in known:
        others = known[known != k]
        weight = 1.0 / stds[others] ** 2
        mean = float(np.average(ratios[others], weights=weight))
        std = float(np.hypot(stds[k], 1.0 / np.sqrt(weight.sum())))
        apart = float(ratios[k]) / mean - 1.0
        off[k] = apart if abs(apart) > SIGNIFICANT * std else 0.0
    worst = int(np.argmax(np.abs(off)))
    if abs(off[worst]) <= DOUBTED:
        return []
    # Of two it may be either.
    which = "its mass, or another's," if known.size > 2 else "one of the two masses"
    text = (
        f"{names[worst]} weighs {100.0 * off[worst]:+.0f} % against its {masses[worst]:.0f} kg "
        f"where the others weigh right, by the file made of all: {which} is wrong, or its torque"
    )
    if abs(off[worst]) > SURE:
        raise DriveError(f"{text}; correct the mass, or leave the drive out")
    return [f"{text}, so that every mass may be off by a part of that; weigh it again"]


def unbacked_scale(vehicle: Vehicle) -> list[str]:
    """Ask for tare and permitted mass where nothing else backs the masses of a calibration.

    A torque in N m or percent has a scale of its own. What a load or an air flow is worth is told
    by the masses alone: times any factor, the fit is as good.
    """
    if source_of(vehicle).signed or vehicle.tare is not None or vehicle.gross is not None:
        return []
    return [
        f"the masses given alone say what {source_of(vehicle).title} is worth, and a wrong one "
        f"makes every mass wrong by as much: {_BOTH_MISSING}"
    ]


def tared(vehicle: Vehicle, tare: float) -> Vehicle:
    """Give a calibrated vehicle its mass without payload [kg]: its note no longer asks for it."""
    made = vehicle.provenance
    notes = made.notes and made.notes.replace(_BOTH_MISSING, _GROSS_MISSING)
    return replace(vehicle, tare=tare, provenance=replace(made, notes=notes))


def with_doubts(vehicle: Vehicle, doubts: Sequence[str]) -> Vehicle:
    """Keep in the vehicle file what is to be told of its masses at each weighing."""
    made = vehicle.provenance
    return replace(vehicle, provenance=replace(made, doubts=tuple(doubts)))
