"""Do the masses of a calibration go together, with each other and with the permitted one?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.calibration.uncertain_motion import uncertain_gains
from weighbridge.estimators import joint
from weighbridge.estimators.joint.problem import UNMODELLED
from weighbridge.messages import Problem, phrase, refused
from weighbridge.signals import Floats
from weighbridge.vehicle import Vehicle, source_of

UNCERTAIN: Final = 0.06
"""A drive that weighs so much more or less than the others, by the file made of all, is reported
[-]: of nine simulated vehicles the farthest of three drives was 0.03 off, with one mass of three
20 % off 0.21 to 0.32."""

SIGNIFICANT: Final = 4.0
"""Standard deviations by which it has to be off as well [-]."""

OVER: Final = 1.02
"""Mass over the permitted one from which it is reported [-]."""


def questionable_masses(
    vehicle: Vehicle, balances: Sequence[ForceBalance], masses: Sequence[float]
) -> list[Problem]:
    """Say which masses of a calibration are uncertain, or motions.

    Parameters
    ----------
    vehicle : calibrated; with the permitted mass, where it is known
    balances : of its drives
    masses : they were calibrated with [kg]
    """
    names, gross = vehicle.provenance.drives, vehicle.gross
    contradictions = [
        Problem.of("calibration.above_gross", drive=name, mass=kg, gross=gross)
        for name, kg in zip(names, masses, strict=True)
        if gross is not None and kg > OVER * gross
    ]
    contradictions += uncertain_gains(names, [b.motion for b in balances])
    fit = vehicle.provenance.fit
    if fit is None or not fit.refined or len(masses) < 2:
        return contradictions
    tracks = [joint.estimate(b, vehicle, load_changes=False) for b in balances]
    left = np.array(masses) - np.array([float(b.table.fuel_burnt[-1]) for b in balances])
    ratios = np.array([t.mass for t in tracks]) / left
    stds = UNMODELLED * np.array([t.bound_std for t in tracks]) / left
    return contradictions + contradicting(names, masses, ratios, stds)


def refuse_too_heavy(vehicle: Vehicle, masses: Sequence[float], doubts: Sequence[Problem]) -> None:
    """Refuse masses that are too heavy by two signs: the permitted mass, and what the drives show.

    Parameters
    ----------
    vehicle : calibrated
    masses : it was calibrated with [kg]
    doubts : that say that the masses are too heavy; a single sign is reported and kept

    Raises
    ------
    DriveError
        Both are there.
    """
    gross = vehicle.gross
    if gross is None or not doubts or max(masses) <= OVER * gross:
        return
    name = vehicle.provenance.drives[int(np.argmax(masses))]
    raise refused(
        "calibration.too_heavy", drive=name, mass=max(masses), gross=gross, doubt=doubts[0].text
    )


def contradicting(
    names: Sequence[str], masses: Sequence[float], ratios: Floats, stds: Floats
) -> list[Problem]:
    """Say which drive weighs otherwise than the others, by the file that was made of all.

    Parameters
    ----------
    names : of the drives
    masses : they were calibrated with [kg]
    ratios : weighed mass over it (n,) [-]; NaN where a drive was not weighed
    stds : standard deviations of the ratios (n,) [-]
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
    if abs(off[worst]) <= UNCERTAIN:
        return []
    # Of two it may be either.
    return [
        Problem.of(
            "calibration.may_contradict",
            drive=names[worst],
            off=100.0 * off[worst],
            mass=masses[worst],
            which=phrase("mass_of_several" if known.size > 2 else "mass_of_two"),
        )
    ]


def unbacked_scale(vehicle: Vehicle) -> list[Problem]:
    """Ask for tare and permitted mass where nothing else backs the masses of a calibration.

    A torque in N m or percent has a scale of its own. What a load or an air flow is worth comes
    by the masses alone: times any factor, the fit is as good.
    """
    if source_of(vehicle).signed or vehicle.tare is not None or vehicle.gross is not None:
        return []
    return [
        Problem.of(
            "calibration.unbacked",
            source=source_of(vehicle).title,
            missing=phrase("masses_missing"),
        )
    ]


def tared(vehicle: Vehicle, tare: float) -> Vehicle:
    """Give a calibrated vehicle its mass without payload [kg]: its note no longer asks for it."""
    made = vehicle.provenance
    notes = made.notes and made.notes.replace(phrase("masses_missing"), phrase("gross_missing"))
    return replace(vehicle, tare=tare, provenance=replace(made, notes=notes))


def with_findings(vehicle: Vehicle, doubts: Sequence[Problem]) -> Vehicle:
    """Keep in the vehicle file what is to be reported of its masses at each weighing."""
    made = vehicle.provenance
    return replace(vehicle, provenance=replace(made, doubts=tuple(d.line for d in doubts)))
