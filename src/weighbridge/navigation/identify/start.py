"""The first state of the navigation filter."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.kernels.ins_model import (
    BA,
    BG,
    E_ATT,
    E_BA,
    E_BG,
    E_LEVER,
    E_PITCH0,
    E_SCALE,
    E_SQUAT,
    E_V,
    E_YAW0,
    ERRORS,
    LAST,
    LEVER,
    PITCH0,
    SCALE,
    SQUAT,
    STATES,
    TIME,
    YAW0,
    P,
    Q,
    V,
)
from weighbridge.kernels.rotation import (
    euler_to_matrix,
    euler_to_quaternion,
    quaternions_to_euler,
    rotate_body,
    rotate_navigation,
)
from weighbridge.navigation.aiding import Fixes
from weighbridge.navigation.filter import Block, misfit, run, run_smoothed
from weighbridge.navigation.identify.alignment import Alignment
from weighbridge.navigation.settings import NavigationSettings
from weighbridge.navigation.state import State
from weighbridge.signals import Bools, Floats

if TYPE_CHECKING:
    from weighbridge.navigation.identify.setup import Setup

_LEVEL_TIME = 2.0
"""The first level is that of the first seconds [s]."""

_RECTIFIED = 120.0
"""Without rest, pitch and roll are taken to come back to where they were in so long [s]."""

_HEADINGS = 8
"""Headings tried at the start [-]: from below 60 degrees off the filter recovered in 10 of 10
drives, from 90 in 8, from 150 in none."""

_HEADING_STD = 0.4
"""Of the best of them [rad]: they lie 45 degrees apart."""

_BLIND_HEADING = 0.05
"""The same without GNSS, where any heading serves [rad]."""

_MOVED = 1.0
"""Travelled before a heading can show [m]."""

_BEFORE = 0.1
"""Headings are tried from so long before the first fix [s]."""

_FIRST_SPAN, _FIRST_WAY, _FIRST_FIXES = 60.0, 100.0, 5
"""They are judged over at least so long [s], so far [m] and so many fixes."""

_LONGEST_SPAN = 300.0
"""But no longer than that [s]."""

_ROUNDS = 2
"""Smoothings that refine the best heading [-]: a velocity that the smoother turns by 0.3 rad, to
first order, grows by 5 %."""


class Begin(NamedTuple):
    """Low-passed samples of a drive, in body axes, for its first state.

    Attributes
    ----------
    time : (n,) even [s]
    accel, gyro : (n, 3) [m/s^2, rad/s]
    speed : (n,) NaN where unknown [m/s]
    rest : (n,) the body rests
    """

    time: Floats
    accel: Floats
    gyro: Floats
    speed: Floats
    rest: Bools


def first_state(
    begin: Begin, aligned: Alignment, fixes: Fixes | None, settings: NavigationSettings,
    free_scale: bool,
) -> State:  # fmt: skip
    """Set the first state: level and speed from the first seconds, heading north.

    Parameters
    ----------
    begin : of the whole drive
    aligned : sensor axes and their uncertainty
    fixes : of GNSS
    settings : priors
    free_scale : the scale of the indicated speed is not known
    """
    x, std = np.zeros(STATES), np.zeros(ERRORS)
    known = np.isfinite(begin.speed) & np.isfinite(begin.accel).all(axis=1)
    x[TIME] = math.nan
    x[SCALE] = 1.0
    x[LAST : LAST + 3] = begin.gyro[int(np.argmax(np.isfinite(begin.gyro).all(axis=1)))]
    _set_constants(x, std, aligned, settings, free_scale)
    bias, bias_std = _gyro_bias(begin, known, aligned.yaw_rate_bias, settings)
    x[BG : BG + 3] = bias

    # level of the first seconds: what is left of specific force without what speed and
    # turning explain
    period = float(begin.time[1] - begin.time[0])
    place = int(np.argmax(known)) if known.any() else 0
    head = slice(place, place + max(4, round(_LEVEL_TIME / period)))
    f = np.nanmean(begin.accel[head], axis=0)
    v = begin.speed[head]
    rate = 0.0
    if np.isfinite(v).sum() > 3:
        ok = np.isfinite(v)
        rate = float(np.polyfit(begin.time[head][ok], v[ok], 1)[0])
    v0 = float(np.nan_to_num(begin.speed[place]))
    turn = float(np.nanmean(begin.gyro[head, 2]) - bias[2]) * v0
    pitch = math.asin(float(np.clip((f[0] - rate) / GRAVITY, -0.3, 0.3)))
    roll = math.asin(float(np.clip(-(f[1] - turn) / GRAVITY, -0.3, 0.3)))
    x[Q : Q + 4] = euler_to_quaternion(roll, pitch, 0.0)
    x[V] = v0
    if fixes is not None:
        x[P : P + 2] = fixes.ned[0, :2]
        before = begin.time < fixes.time[0]
        std[0:2] = 10.0 + float(np.nansum(begin.speed[before])) * period
        std[2] = 10.0
    else:
        std[0:3] = 0.1
    if fixes is None or not fixes.has_height:
        std[2] = 0.1
    std[E_V : E_V + 2] = 0.5 + 0.1 * v0
    std[E_V + 2] = 0.3 + 0.05 * v0
    std[E_ATT : E_ATT + 2] = 0.02 if v0 < 0.1 else 0.03
    std[E_BA : E_BA + 3] = settings.accel_bias_std
    std[E_BG : E_BG + 3] = bias_std
    heading_std = _BLIND_HEADING if fixes is None else _HEADING_STD
    return _unsure(State(x, np.diag(std**2)), heading_std**2)


def _set_constants(
    x: Floats, std: Floats, aligned: Alignment, settings: NavigationSettings, free_scale: bool
) -> None:
    """Set mounting, squat, scale of the speed and lever, and their standard deviations."""
    given = aligned.given
    x[SQUAT] = settings.squat
    std[E_SQUAT] = settings.squat_std
    if given is not None and given.squat is not None:
        x[SQUAT] = given.squat
        std[E_SQUAT] = max(given.squat_std or 0.0, 2e-4)
    coarse_std = settings.mounting_std if given is None else 0.0
    std[E_PITCH0] = math.hypot(aligned.tilt_std, coarse_std)
    std[E_YAW0] = math.hypot(aligned.yaw_std, coarse_std)
    std[E_SCALE] = settings.speed_scale_std if free_scale else 1e-6
    x[LEVER], std[E_LEVER] = settings.lever, settings.lever_std


def _gyro_bias(
    begin: Begin, known: Bools, yaw_rate_bias: float, settings: NavigationSettings
) -> tuple[Floats, Floats]:
    """Find the gyro's bias from rest, and its standard deviation.

    Else pitch and roll come back to where they were, and the yaw rate follows from lateral force.
    """
    period = float(begin.time[1] - begin.time[0])
    std = np.full(3, settings.gyro_bias_std)
    if begin.rest.sum() * period > 2.0:
        rest = begin.rest & known
        bias = np.median(begin.gyro[rest], axis=0) if rest.any() else np.zeros(3)
        std[:] = 0.002
        return bias, std
    window = known & (begin.time < begin.time[0] + _RECTIFIED)
    span = max(1.0, float(window.sum() * period))
    bias = np.mean(begin.gyro[window], axis=0) if window.any() else np.zeros(3)
    std[:2] = min(0.03, 0.003 + 0.1 / span)
    bias[2] = yaw_rate_bias if math.isfinite(yaw_rate_bias) else 0.0
    std[2] = 0.02
    return bias, std


def turned(state: State, angle: float, pivot: Floats) -> State:
    """Turn a state about the vertical axis through a point, as if the drive had begun so.

    Parameters
    ----------
    state : at a node
    angle : clockwise seen from above [rad]
    pivot : (3,) the point, north east down [m]
    """
    turn = euler_to_matrix(0.0, 0.0, angle)
    x = state.x.copy()
    x[P : P + 3] = pivot + turn @ (x[P : P + 3] - pivot)
    x[V : V + 3] = turn @ x[V : V + 3]
    rotate_navigation(x[Q : Q + 4], 0.0, 0.0, angle)
    whole = np.eye(ERRORS)
    for first in (0, E_V, E_ATT):
        whole[first : first + 3, first : first + 3] = turn
    return State(x, whole @ state.cov @ whole.T)


def with_heading(start: State, block: Block, setup: Setup, way: Floats, fixes: Fixes) -> State:
    """Turn a first state to the heading that explains the first fixes best.

    Where a recording begins shows no heading, and the filter, which is linear, recovers only from
    errors below some 60 degrees. So the drive is folded from several headings all around.

    Parameters
    ----------
    start : first state, of any heading
    block : samples and measurements of the drive
    setup : of the drive; its start is not read
    way : (m,) travelled up to each node [m]
    fixes : of GNSS, without their delay
    """
    time = block.time[block.nodes]
    moves = float(time[min(int(np.searchsorted(way, _MOVED)), time.size - 1)])
    begin = int(np.searchsorted(time, max(moves, float(fixes.time[0]) - _BEFORE)))
    if begin >= time.size:
        return start
    counted = np.searchsorted(fixes.time, time)
    shown = (
        (time >= time[begin] + _FIRST_SPAN)
        & (way >= way[begin] + _FIRST_WAY)
        & (counted >= counted[begin] + _FIRST_FIXES)
    ) | (time >= time[begin] + _LONGEST_SPAN)
    end = int(np.argmax(shown)) if shown.any() else time.size - 1
    head, first = block.part(0, int(block.nodes[begin]) + 1), int(block.nodes[begin]) + 1
    state, _ = run(start, head, setup)
    pivot = state.x[P : P + 3].copy()
    if fixes.time[0] > time[begin]:
        # What was driven before ends at the first fix, whichever the heading.
        start.x[P : P + 2] += fixes.ned[0, :2] - pivot[:2]
        state.x[P : P + 2] = pivot[:2] = fixes.ned[0, :2]
    part = block.part(first, int(block.nodes[end]) + 1)
    angles = 2.0 * math.pi / _HEADINGS * np.arange(_HEADINGS)
    misfits = np.array([misfit(turned(state, a, pivot), part, setup) for a in angles])
    best = int(np.argmin(misfits))
    weights = np.exp(-0.5 * (misfits - misfits[best]))
    away = np.mod(angles - angles[best] + math.pi, 2.0 * math.pi) - math.pi
    spread_var = float(np.sum(weights * away**2) / np.sum(weights))
    found = _unsure(turned(start, float(angles[best]), pivot), spread_var)
    for _ in range(_ROUNDS):
        _, nodes = run_smoothed(found, block.part(0, int(block.nodes[end]) + 1), setup)
        smoothed = nodes.states[0, Q : Q + 4]
        error = heading_of(smoothed) - heading_of(found.x[Q : Q + 4])
        found = turned(found, error, nodes.states[begin, P : P + 3])
    return found


def heading_of(quaternion: Floats) -> float:
    """Heading of an attitude quaternion (4,) [rad]."""
    angles = np.empty((1, 3))
    quaternions_to_euler(np.ascontiguousarray(quaternion[None]), angles)
    return float(angles[0, 2])


def _unsure(state: State, heading_var: float) -> State:
    """Make the heading of a first state uncertain, and its velocity with it."""
    along = np.zeros(ERRORS)
    along[E_ATT + 2] = 1.0
    along[E_V], along[E_V + 1] = -state.x[V + 1], state.x[V]
    return State(state.x, state.cov + heading_var * np.outer(along, along))


def restarted(rot_bs: Floats, start: State, end: State) -> tuple[Floats, State]:
    """Move the start to the constants a pass has found, uncertain as they were.

    The linearisation profits, and nothing is counted twice.

    Returns
    -------
    rot_bs : (3, 3) sensor to body axes
    start : in these axes
    """
    x, found = start.x.copy(), end.x
    # direction of travel in body axes is (1, yaw0, pitch0)
    turn = euler_to_matrix(0.0, float(found[PITCH0]), -float(found[YAW0]))
    x[SQUAT], x[SCALE], x[LEVER] = found[SQUAT], found[SCALE], found[LEVER]
    x[BG : BG + 3] = turn @ found[BG : BG + 3]
    x[BA : BA + 3] = turn @ found[BA : BA + 3]
    rotate_body(x[Q : Q + 4], 0.0, -float(found[PITCH0]), float(found[YAW0]))
    return turn @ rot_bs, State(x, start.cov)
