"""Changes of the inertial sensor's mounting during a drive, found by gravity, speed and turning.

Averaged over some time the sensor's pitch is that of the road, its roll that of the camber, and
what it feels horizontally is the rate of change of the speed ahead and speed times yaw rate to the
right. A mounting that changes shows as a step or ramp of what differs from that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.constants import GRAVITY
from weighbridge.limits import DRIVES
from weighbridge.messages import Problem, phrase
from weighbridge.navigation.even import Even
from weighbridge.navigation.identify.steps import SIDE, Step, fitted
from weighbridge.signals import Bools, Floats, Signal
from weighbridge.signals.instants import instant, span

_SPAN: Final = 4
"""Coarse periods over which the speed's change is compared [-]: shorter has its steps."""

_BLOCK: Final = 20.0
"""Rows are averaged over so long [s]."""

_HILL: Final = 60.0
"""Heights show the grade over so long on both sides [s]; over less, their drift is larger."""

_HILL_WAY: Final = 300.0
"""and over so much way [m]."""

_LIKE: Final = 3.0
"""Neighbouring blocks share hills and bends: so many count as one [-]."""

_SURE: Final = 36.0
"""Squared error that a change must explain, over its variance [-]: six standard deviations."""

_LEAST: Final = (math.radians(2.5), math.radians(0.8), math.radians(6.0))
"""Smaller changes of roll, pitch and yaw do not matter to a mass or are the road's [rad]: six
simulated vehicles came out less than their standard deviation off at 1 deg of pitch, 5 deg of
roll and 10 deg of yaw."""

_FLOOR: Final = (math.radians(0.3), math.radians(0.15), math.radians(3.0))
"""No block shows roll, pitch and yaw better than so [rad]."""

_MOST_CHANGES: Final = 8
"""More changes in one drive are a device that lies loose, and are not followed."""

_JUMP_STD: Final = (0.02, 0.05)
"""Standard deviation of pitch and yaw of a mounting found by blocks [rad]."""

_CREEP_STD: Final = 0.003
"""The same each `_BLOCK` of a slow change [rad]."""

_PITCH: Final = 1
_YAW: Final = 2
"""Places among roll, pitch and yaw."""

Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class Change:
    """One change of mounting.

    Attributes
    ----------
    kind : 0 roll, 1 pitch, 2 yaw
    start, end : while it took place or may have [s]
    axis : (3,) about which measured vectors are turned back, unit, sensor axes
    angle : by which [rad]
    slow : it creeps from ``start`` to ``end``; else it is a step, which lies between them
    """

    kind: int
    start: float
    end: float
    axis: Floats
    angle: float
    slow: bool

    def share(self, time: Floats) -> Floats:
        """Part (n,) of the change that is over at the instants [-]."""
        if self.slow:
            return np.clip((time - self.start) / (self.end - self.start), 0.0, 1.0)
        return np.asarray(time >= 0.5 * (self.start + self.end), dtype=np.float64)

    def undone(self, time: Floats, vectors: Floats) -> Floats:
        """Turn vectors (n, 3) in sensor axes back into the axes before the change."""
        angle = (self.angle * self.share(time))[:, None]
        u = self.axis
        along = (vectors[:, 0] * u[0] + vectors[:, 1] * u[1] + vectors[:, 2] * u[2])[:, None] * u
        return np.asarray(
            along + np.cos(angle) * (vectors - along) + np.sin(angle) * np.cross(u, vectors)
        )


@dataclass(frozen=True, slots=True)
class _Rows:
    """What force, speed and turning say, every coarse period.

    Attributes
    ----------
    time : (n,) [s]
    tilt : (n, 2) roll and pitch by gravity, less the road's where heights show it [rad];
        NaN where unknown
    felt : (n,) horizontal specific force, ahead + 1j right [m/s^2]
    shown : (n,) the same by speed and yaw rate
    moving : (n,) fast enough for a block
    """

    time: Floats
    tilt: Floats
    felt: Complexes
    shown: Complexes
    moving: Bools


def find_changes(
    coarse: Even, speed: Signal, rot_bs: Floats, altitude: Signal | None
) -> list[Change]:
    """Find steps and slow changes of the mounting, the surest first.

    Parameters
    ----------
    coarse : inertial samples on a clock of about half a second
    speed : without its delay
    rot_bs : (3, 3) sensor to body axes, of the whole drive
    altitude : heights; without them only steps that are no hill for sure are found
    """
    changes: list[Change] = []
    values = coarse.values
    v = np.interp(coarse.time, speed.time, speed.values)
    v[speed.age(coarse.time) > max(2.0, 2.0 * speed.period)] = np.nan
    slope = _slope(coarse.time, v, altitude)
    while len(changes) < _MOST_CHANGES:
        rows = _rows(coarse.time, values, v, rot_bs, slope)
        found = _surest(rows, rot_bs)
        if found is None:
            break
        if altitude is None and (found.slow or _seen_by_gyro(coarse.time, values, found)):
            break
        changes.append(found)
        values = undo(coarse.time, values, [found])
    return changes


def undo(time: Floats, values: Floats, changes: Sequence[Change]) -> Floats:
    """Turn inertial samples (n, 6) back into the axes before the changes."""
    for change in changes:
        values = np.hstack([change.undone(time, values[:, :3]), change.undone(time, values[:, 3:])])
    return values


def unsure(time: Floats, changes: Sequence[Change]) -> Bools:
    """Mark the instants (n,) at which a step may or may not have happened."""
    marked = np.zeros(time.size, dtype=bool)
    for change in changes:
        if not change.slow:
            marked |= (time > change.start) & (time < change.end)
    return marked


def openings(time: Floats, changes: Sequence[Change]) -> tuple[Floats, Floats]:
    """Instants (k,) at which the mounting is open again, and variances (k, 2) of pitch and yaw.

    Parameters
    ----------
    time : (n,) of the drive [s]
    """
    at: list[Floats] = [np.empty(0)]
    var: list[Floats] = [np.empty((0, 2))]
    for change in changes:
        if change.slow:
            steps = np.arange(change.start - _HILL, change.end + _HILL, _BLOCK)
            at.append(steps)
            var.append(np.full((steps.size, 2), _CREEP_STD**2))
        else:
            at.append(np.array([change.end]))
            var.append(np.square(_JUMP_STD)[None, :])
    instants, variances = np.concatenate(at), np.vstack(var)
    order = np.argsort(instants)
    within = (instants[order] > time[0]) & (instants[order] < time[-1])
    return instants[order][within], variances[order][within]


def remounting_notes(changes: Sequence[Change], start: float, end: float) -> list[Problem]:
    """Say in sentences what changed when in a drive from ``start`` to ``end`` [s]."""
    texts = []
    for change in sorted(changes, key=lambda c: c.start):
        size = f"{math.degrees(abs(change.angle)):.1f} deg"
        if change.slow:
            first, last = max(change.start, start), min(change.end, end)
            when = phrase("slowly_from", span=span(round(first), round(last)))
        else:
            when = phrase("at_instant", at=instant(round(0.5 * (change.start + change.end))))
        texts.append(
            Problem.of("imu.moved", start=change.start, end=change.end, size=size, when=when)
        )
    return texts


def _slope(time: Floats, speed: Floats, altitude: Signal | None) -> Floats:
    """Grade (n,) of the road by heights around each instant; 0 without them [rad]."""
    if altitude is None or len(altitude) < 10:
        return np.zeros(time.size)
    period = float(time[1] - time[0])
    way = np.cumsum(np.nan_to_num(speed)) * period
    before, after = time - _HILL, time + _HILL
    rise = np.interp(after, altitude.time, altitude.values) - np.interp(
        before, altitude.time, altitude.values
    )
    length = np.interp(after, time, way) - np.interp(before, time, way)
    return np.asarray(rise / np.maximum(length, _HILL_WAY))


def _rows(time: Floats, values: Floats, speed: Floats, rot_bs: Floats, slope: Floats) -> _Rows:
    force, rate = values[:, :3] @ rot_bs.T, values[:, 3:] @ rot_bs.T
    lost = ~(np.isfinite(values).all(axis=1) & np.isfinite(speed))
    v = np.nan_to_num(speed)
    standing = ~lost & (v < 0.05)
    bias = float(np.median(rate[standing, 2])) if standing.sum() >= 8 else 0.0
    turning = np.where(lost, 0.0, v * (rate[:, 2] - bias))
    period = float(time[1] - time[0])

    def mean(y: Floats) -> Floats:
        total = np.concatenate(([0.0], np.cumsum(0.5 * (y[1:] + y[:-1]))))
        return np.asarray((total[_SPAN:] - total[:-_SPAN]) / _SPAN)

    holes = np.concatenate(([0], np.cumsum(lost)))
    whole = holes[_SPAN + 1 :] == holes[: -_SPAN - 1]
    ahead = (v[_SPAN:] - v[:-_SPAN]) / (_SPAN * period)
    force = np.where(lost[:, None], 0.0, force)
    felt = mean(force[:, 0]) + 1j * mean(force[:, 1])
    shown = ahead + 1j * mean(turning)
    middle = slice(_SPAN // 2, time.size - _SPAN + _SPAN // 2)
    rest = (felt - shown) / GRAVITY
    tilt = np.column_stack([rest.imag, rest.real - slope[middle]])
    return _Rows(
        time=time[middle],
        tilt=np.where(whole[:, None], tilt, np.nan),
        felt=felt,
        shown=shown,
        moving=whole & (mean(v) > DRIVES),
    )


def _surest(rows: _Rows, rot_bs: Floats) -> Change | None:
    """Find the surest change of one angle; None where none is sure."""
    moving = np.flatnonzero(rows.moving)
    if moving.size < 4:
        return None
    number = ((rows.time[moving] - rows.time[moving[0]]) / _BLOCK).astype(np.int64)
    count = np.bincount(number)
    enough = 2 * count >= 0.5 * _BLOCK / (rows.time[1] - rows.time[0])
    if enough.sum() < 2 * SIDE:
        return None

    def means(y: Floats) -> Floats:
        return np.asarray(np.bincount(number, weights=y)[enough] / count[enough])

    at = means(rows.time[moving])
    felt, shown = rows.felt[moving], rows.shown[moving]
    place = np.cumsum(enough) - 1
    near = enough[number]
    own = place[number[near]]
    felt_off = felt[near] - (means(felt.real) + 1j * means(felt.imag))[own]
    shown_off = shown[near] - (means(shown.real) + 1j * means(shown.imag))[own]
    product = felt_off * np.conj(shown_off)
    size = np.bincount(own, weights=np.abs(shown_off) ** 2)
    turned = np.bincount(own, weights=product.real) + 1j * np.bincount(own, weights=product.imag)
    usual = max(float(np.median(size)), 1e-6)
    even = np.ones(at.size)
    best: tuple[int, Step] | None = None
    sureness = _SURE
    for k, (y, weight) in enumerate(
        (
            (means(rows.tilt[moving, 0]), even),
            (means(rows.tilt[moving, 1]), even),
            (np.angle(turned * np.conj(turned.sum())), np.minimum(size / usual, 4.0)),
        )
    ):
        found = fitted(at, y, weight, _FLOOR[k], like=_LIKE)
        if abs(found.size) >= _LEAST[k] and found.sureness > sureness:
            sureness, best = found.sureness, (k, found)
    if best is None:
        return None
    k, step = best
    center, length, angle = step.center, step.length, step.size
    axis = rot_bs[k]
    turn = angle if k == _PITCH else -angle
    if length > 0.0:
        return Change(k, center - 0.5 * length, center + 0.5 * length, axis, turn, True)
    start, end = _instant(rows, k, center, angle)
    return Change(k, start, end, axis, turn, False)


def _instant(rows: _Rows, k: int, center: float, angle: float) -> tuple[float, float]:
    """Find within rows when a step took place: earliest and latest instant [s]."""
    near = np.flatnonzero(np.abs(rows.time - center) < 2.0 * _BLOCK)
    near = near[np.isfinite(rows.tilt[near, 0])]
    if near.size < 8:
        return center - _BLOCK, center + _BLOCK
    if k == _YAW:
        felt = rows.felt[near] - rows.felt[near].mean()
        shown = rows.shown[near] - rows.shown[near].mean()
        error = np.abs(felt[None, :] - np.exp(1j * np.array([[0.0], [angle]])) * shown) ** 2
    else:
        y = rows.tilt[near, k]
        low = np.percentile(y, 10.0 if angle > 0.0 else 90.0)
        far = np.abs(rows.time[near] - center) > _BLOCK
        before, after = far & (rows.time[near] < center), far & (rows.time[near] > center)
        if before.sum() >= 4 and after.sum() >= 4:
            low = 0.5 * (np.median(y[before]) + np.median(y[after]) - angle)
        error = (y[None, :] - np.array([[low], [low + angle]])) ** 2
    # Error of all rows where the step lies between one row and the next.
    cost = np.concatenate(([0.0], np.cumsum(error[0] - error[1])))
    least = int(np.argmin(cost))
    variance = float(np.mean(np.concatenate((error[0, :least], error[1, least:]))))
    may = np.flatnonzero(cost - cost[least] < 2.0 * _SPAN * variance)
    first = float(rows.time[near[max(int(may[0]) - 1, 0)]])
    last = float(rows.time[near[min(int(may[-1]), near.size - 1)]])
    margin = 0.5 * _SPAN * float(rows.time[1] - rows.time[0])
    return first - margin, last + margin


def _seen_by_gyro(time: Floats, values: Floats, change: Change) -> bool:
    """Say whether the gyro turned as far as the accelerometer tilted, as it does on a hill."""
    if change.kind == _YAW:
        return False
    middle, reach = 0.5 * (change.start + change.end), 0.5 * (change.end - change.start) + 4.0
    near = (np.abs(time - middle) < reach) & np.isfinite(values).all(axis=1)
    usual = np.isfinite(values).all(axis=1)
    rate = values[:, 3:] @ change.axis
    turned = float(np.sum(rate[near] - np.median(rate[usual]))) * float(time[1] - time[0])
    return abs(turned - change.angle) < 0.5 * abs(change.angle)
