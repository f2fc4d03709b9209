"""How the inertial sensor sits in the vehicle, found from the drive."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.errors import DriveError
from weighbridge.messages import Problem, refused
from weighbridge.signals import Bools, Floats, huber

_LOG = logging.getLogger(__name__)

_CORRELATION = 8.0
"""Neighbouring half-second samples share grade and camber: the regression has
this many times fewer independent samples than rows [-]."""


class TooLittleMotionError(DriveError):
    """The drive moves too little to show the mounting; one that is given may serve."""


@dataclass(frozen=True, slots=True)
class CoarseMounting:
    """The mounting as gravity, acceleration and turning show it.

    Attributes
    ----------
    rot_bs : (3, 3) sensor to body axes
    yaw_std : standard deviation of the forward direction [rad]
    tilt_std : of the level [rad]
    forward_gain, forward_gain_std : specific force per rate of change of the
        speed [-]; 1 plus a little squat where units fit, less where the steps of a
        coarse speed are as large as its changes
    forward_gain_most : the same by regression of the rate on the force, which the
        noise of the force draws up instead [-]
    yaw_rate_bias : gyro bias about the body's z axis that lateral force shows
        [rad/s]; NaN where it does not
    """

    rot_bs: Floats
    yaw_std: float
    tilt_std: float
    forward_gain: float
    forward_gain_std: float
    forward_gain_most: float
    yaw_rate_bias: float


def coarse_mounting(
    accel: Floats, gyro: Floats, speed: Floats, period: float, resting: Bools
) -> CoarseMounting:
    """Find the mounting, whatever it is, by one regression of specific force.

    In sensor axes and on average over road and time,
    ``f = c0 + c1 dv/dt + c2 v yaw_rate + c3 v``: ``c0`` is minus gravity, ``c1`` the
    forward axis, ``c2`` the right axis, and ``c3`` minus the right axis times the bias
    of the yaw rate. The yaw rate is the rate about ``c0``, so two rounds are made.

    Parameters
    ----------
    accel, gyro : (n, 3) low-passed, on an even clock; NaN in gaps
    speed : (n,) on the same clock; NaN where unknown [m/s]
    period : of the clock [s]
    resting : (n,) vehicle at rest

    Raises
    ------
    TooLittleMotionError
        The drive holds too little acceleration.
    DriveError
        Gravity or turning do not fit the units, or the axes are swapped or
        mirrored.
    """
    ok = np.isfinite(accel).all(axis=1) & np.isfinite(gyro).all(axis=1)
    if ok.sum() < 10:
        raise refused("imu.overlap", overlap=ok.sum() * period)
    gravity = np.median(accel[ok], axis=0)
    down = -gravity / np.linalg.norm(gravity)
    rest_gyro = np.median(gyro[resting & ok], axis=0) if (resting & ok).sum() >= 4 else None
    bias = rest_gyro if rest_gyro is not None else np.zeros(3)

    f, w, a, v = _moving_rows(accel, gyro - bias, speed, period)
    fit = _regressed(f, w, a, v, down, free_bias=rest_gyro is None)
    coef, std, weight = fit.coef, fit.std, fit.weight
    down = -coef[0] / np.linalg.norm(coef[0])

    forward = coef[1] - down * (coef[1] @ down)
    right = coef[2] - down * (coef[2] @ down)
    _check_axes(forward, right, down, std)
    w1, w2 = 1.0 / std[1] ** 2, 1.0 / std[2] ** 2
    if std[2] > 0.35 or np.linalg.norm(right) < 3.0 * std[2]:
        w2 = 0.0
    axis = w1 * forward + w2 * np.cross(right, down)
    yaw_std = 1.0 / math.sqrt(w1 + w2)
    if yaw_std > 0.3 or np.linalg.norm(axis) / (w1 + w2) < 3.0 * yaw_std:
        raise Problem.of("motion.no_forward", serious=True, std=math.degrees(yaw_std)).error(
            TooLittleMotionError
        )
    axis /= np.linalg.norm(axis)
    rot = np.vstack([axis, np.cross(down, axis), down])
    yaw_bias = float("nan")
    if rest_gyro is None and std[3] < 0.1:
        yaw_bias = -float(coef[3] @ rot[1])
    _LOG.debug("coarse mounting %s, yaw std %.1f deg", rot, math.degrees(yaw_std))
    return CoarseMounting(
        rot_bs=rot,
        yaw_std=yaw_std,
        tilt_std=float(std[0]) / GRAVITY + 0.01,
        forward_gain=float(np.linalg.norm(forward)),
        forward_gain_std=float(std[1]),
        forward_gain_most=_most_gain(f @ axis, a, weight),
        yaw_rate_bias=yaw_bias,
    )


def _moving_rows(
    accel: Floats, gyro: Floats, speed: Floats, period: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """Force, angular rate, rate of change of the speed and speed of the moving vehicle.

    The speed's change over two periods stands against the force averaged over the same time.
    """
    smooth_accel = (accel[:-2] + 2.0 * accel[1:-1] + accel[2:]) / 4.0
    smooth_gyro = (gyro[:-2] + 2.0 * gyro[1:-1] + gyro[2:]) / 4.0
    rate = (speed[2:] - speed[:-2]) / (2.0 * period)
    v = (speed[:-2] + 2.0 * speed[1:-1] + speed[2:]) / 4.0
    rows = (
        np.isfinite(smooth_accel).all(axis=1)
        & np.isfinite(smooth_gyro).all(axis=1)
        & np.isfinite(rate)
        & (np.abs(rate) < 8.0)
        & (v > 1.0)
    )
    if rows.sum() * period < 8.0:
        raise Problem.of("motion.too_little", serious=True, moving=rows.sum() * period).error(
            TooLittleMotionError
        )
    return smooth_accel[rows], smooth_gyro[rows], rate[rows], v[rows]


class _Fit(NamedTuple):
    """Regression of the force: coefficients (4, 3), their stds (4,), weights of the rows (n,)."""

    coef: Floats
    std: Floats
    weight: Floats


def _regressed(
    f: Floats, w: Floats, a: Floats, v: Floats, down: Floats, *, free_bias: bool
) -> _Fit:
    """Regress force on acceleration and turning, robustly; the yaw rate is that about ``down``.

    Without ``free_bias`` the yaw rate has none, and the last coefficient is left zero.
    """
    coef, std = np.zeros((4, 3)), np.full(4, np.inf)
    weight = np.ones(a.size)
    for _ in range(3):
        turn = v * (w @ down)
        design = np.column_stack([np.ones_like(a), a, turn, v])
        if not free_bias:
            design = design[:, :3]
        weight = np.ones(a.size)
        for _ in range(3):
            weighted = (design * weight[:, None]).T
            info = np.linalg.inv(weighted @ design + 1e-9 * np.eye(design.shape[1]))
            sol = info @ (weighted @ f)
            res = f - design @ sol
            size = np.linalg.norm(res, axis=1)
            weight = huber(size, float(np.median(size)), 1.5)
        # gravity where rest says it: not tilted by the mean grade of the rows
        down = -(sol[0]) / np.linalg.norm(sol[0])
        coef[: sol.shape[0]] = sol
        noise = float(np.sqrt(np.sum(weight[:, None] * res**2) / (2.0 * weight.sum())))
        info = np.linalg.inv((design * weight[:, None]).T @ design + 1e-9 * np.eye(design.shape[1]))
        std[: sol.shape[0]] = noise * np.sqrt(np.diag(info) * _CORRELATION)
    return _Fit(coef, std, weight)


def _most_gain(force: Floats, rate: Floats, weight: Floats) -> float:
    """Force per rate where all the noise is in the force; infinite where they do not fit."""
    force = force - np.average(force, weights=weight)
    rate = rate - np.average(rate, weights=weight)
    common = float(np.average(force * rate, weights=weight))
    return float(np.average(force**2, weights=weight)) / common if common > 0.0 else math.inf


def _check_axes(forward: Floats, right: Floats, down: Floats, std: Floats) -> None:
    """Refuse axes that do not form a right-handed set."""
    size = float(np.linalg.norm(right))
    if std[2] * 6.0 > max(size, 1e-9) or std[1] * 6.0 > float(np.linalg.norm(forward)):
        return
    along = float(np.cross(down, forward) @ right) / float(np.linalg.norm(forward))
    if along < -0.5 * size:
        raise refused("imu.axes_mirrored")
