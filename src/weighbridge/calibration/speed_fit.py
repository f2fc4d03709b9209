"""Corrections of the speed model from drives of known mass and grade (Galvão et al.)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.messages import refused
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle import SpeedModel

FEWEST: Final = 40
"""Fewer steps between windows do not settle five coefficients."""

WORST_CONDITION: Final = 1e7
"""Of the scaled design; above, speed and grade hardly change [-]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedRows:
    """Windows of one drive of known mass and grade.

    Attributes
    ----------
    name : of the drive
    mass : [kg]
    speed, grade : (n,) means [m/s], [rad]
    used : (n,) neither braked nor slow, and known
    """

    name: str
    mass: float
    speed: Floats
    grade: Floats
    used: Bools


@dataclass(frozen=True, slots=True, kw_only=True)
class Nominal:
    """Constants of the model before its corrections.

    Attributes
    ----------
    force_gain : a1, gear ratios times efficiency over wheel radius [1/m]
    drag : a2, air density times drag area [kg/m]
    rolling_coefficient : f_r [-]
    rotating_mass : m_r [kg]
    """

    force_gain: float
    drag: float
    rolling_coefficient: float
    rotating_mass: float

    @property
    def gravity(self) -> float:
        """Constant a3 of eq. 11 [m/s^2]."""
        return GRAVITY / math.cos(math.atan(self.rolling_coefficient))


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedFit:
    """What was fitted, for the vehicle file and the figures.

    Attributes
    ----------
    corrections : p1 to p7, in SI
    r_squared : part of the speed's changes that the model explains [-]
    residual_std : of the acceleration [m/s^2]
    samples : steps of the fit
    """

    corrections: tuple[float, ...]
    r_squared: float
    residual_std: float
    samples: int


def fit_speed_model(rows: Sequence[SpeedRows], nominal: Nominal, sample_time: float) -> SpeedFit:
    """Fit p1 to p7 by least squares on the change of speed from window to window.

    With torque ``p7 v`` the model of eqs. 11 and 15-18 is linear in five sums of
    the seven: speed, its square and its cube over the mass, and the slope alone
    and times speed. So there is one global optimum, and two of the seven are
    free: those with the least relative change of a1 and a2 are taken.

    Parameters
    ----------
    rows : of each drive
    nominal : model before its corrections
    sample_time : of the windows [s]

    Raises
    ------
    DriveError
        There are too few windows, or speed and grade hardly change in them.
    """
    designs, targets, weights = [], [], []
    beta = math.atan(nominal.rolling_coefficient)
    for drive in rows:
        phi1 = 1.0 / drive.mass
        slope = np.sin(drive.grade + beta)
        # A change between two means belongs to both windows.
        slope = 0.5 * (slope[:-1] + slope[1:])
        v = drive.speed[:-1]
        steps = drive.used[:-1] & drive.used[1:] & np.isfinite(slope)
        design = np.column_stack([phi1 * v, phi1 * v**2, phi1 * v**3, -slope, -slope * v])
        target = (1.0 + phi1 * nominal.rotating_mass) * np.diff(drive.speed) / sample_time
        designs.append(design[steps])
        targets.append(target[steps])
        weights.append(v[steps])
    design, target = np.concatenate(designs), np.concatenate(targets)
    names = ", ".join(drive.name for drive in rows)
    if target.size < FEWEST:
        raise refused(
            "calibration.few_steps", drives=names, count=target.size, step=sample_time, least=FEWEST
        )
    scale = np.sqrt(np.mean(design**2, axis=0))
    scaled = design / np.where(scale > 0.0, scale, 1.0)
    if not np.linalg.cond(scaled) < WORST_CONDITION:
        raise refused("calibration.speed_steady", drives=names)
    c = np.linalg.lstsq(scaled, target, rcond=None)[0] / scale
    residual = target - design @ c
    return SpeedFit(
        corrections=_least_change(c, nominal, float(np.mean(np.concatenate(weights)))),
        r_squared=float(1.0 - np.var(residual) / np.var(target)),
        residual_std=float(np.std(residual)),
        samples=int(target.size),
    )


def _least_change(c: Floats, nominal: Nominal, speed: float) -> tuple[float, ...]:
    """Split the five coefficients into p1 to p7.

    Only (a1 + p1) p7 shows, so p1 is 0; of p2 p7 - p3 / 2, which both multiply
    the square of the speed, each takes the part that changes a1 at the mean
    ``speed`` [m/s] and a2 least, relative to what they are.
    """
    a1, a2 = nominal.force_gain, nominal.drag
    p7 = c[0] / a1
    short = c[1] + 0.5 * a2
    by_torque, by_drag = a1 * p7 / speed, -0.5 * a2
    size = by_torque**2 + by_drag**2
    p2 = short * by_torque / size * a1 / speed
    p3 = short * by_drag / size * a2
    if size == 0.0:
        p2, p3 = 0.0, -2.0 * short
    return tuple(float(p) for p in (0.0, p2, p3, -2.0 * c[2], c[3] - nominal.gravity, c[4], p7))


def model_speed(rows: SpeedRows, model: SpeedModel) -> Floats:
    """Predict each window's speed from the measured one before and the known grade.

    Parameters
    ----------
    rows : windows of one drive
    model : fitted

    Returns
    -------
    (n,) [m/s]; NaN for the first window and after one that was not used
    """
    p = model.corrections
    v = rows.speed[:-1]
    slope = np.sin(rows.grade + math.atan(model.rolling_coefficient))
    slope = 0.5 * (slope[:-1] + slope[1:])
    gravity = GRAVITY / math.cos(math.atan(model.rolling_coefficient)) + p[4] + p[5] * v
    force = (model.force_gain + p[0] + p[1] * v) * p[6] * v
    force -= 0.5 * (model.drag + p[2] + p[3] * v) * v**2
    accel = (force / rows.mass - gravity * slope) / (1.0 + model.rotating_mass / rows.mass)
    ahead = np.where(rows.used[:-1] & rows.used[1:], v + model.sample_time * accel, np.nan)
    return np.concatenate(([np.nan], ahead))
