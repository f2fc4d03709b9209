"""What a whole drive shows of accelerator and floor, by which each reading is judged alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.balance.floor import FEWEST_IN_BIN, SCATTER, Floor, find_floor
from weighbridge.limits import MOVES, SIGNIFICANT
from weighbridge.signals import Bools, Drive, Floats, Signal, spread
from weighbridge.vehicle import DraggedReading, Vehicle
from weighbridge.vehicle.torque import averaged

SLOWING: Final = 0.03
"""Force over weight that slows a vehicle so much that no foot is on the accelerator [-]."""

SETTLED: Final = 0.7
"""The motion has to slow for so long around a reading that is one of a dragged engine [s]."""

FARTHEST: Final = 0.15
"""Such readings over their floor, over the range of the reading, at most [-]: of a recorded car a
quarter of the braked readings lay within 0.04 of the floor and three quarters within 0.1."""

PUSHED: Final = 0.1
"""Reading that the motion asks for over its floor, over the range of the reading, above which a
low reading may be noise [-]."""

PUSHED_TIME: Final = 1.0
"""Time over which the motion shows whether the engine pushes the vehicle [s]."""

PRESSED: Final = 0.01
"""Position of the accelerator above its lowest from which a foot is on it [-]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What the motion asks of the reading, where it is clear of its floor.

    Attributes
    ----------
    slope, offset : of the reading over the torque that the motion takes [per N m], [-]
    noise : standard deviation that a reading has for itself
    """

    slope: float
    offset: float
    noise: float

    def at(self, torque: Floats) -> Floats:
        """Reading that a torque (n,) [N m] asks for."""
        return self.slope * torque + self.offset


@dataclass(frozen=True, slots=True, kw_only=True)
class FootSetup:
    """What holds all along a drive.

    Attributes
    ----------
    period : of the reading [s]
    by_motion : a motor that recuperates, judged by the motion alone
    floor : of the reading; None where none shows
    asked : what the motion asks of the reading; None where it cannot be seen
    least : torque below which a reading off its floor may be a dragged engine's [N m]; None
        where every such reading lies on its floor
    pedal : name of the signal of the accelerator; None where nothing gives it
    pedal_up : its position below which no foot is on it
    pedal_period : its period [s]
    ahead : time after a reading that may show it, as far as the motion is known [s]
    """

    period: float
    by_motion: bool
    floor: Floor | None
    asked: Asked | None
    least: float | None
    pedal: str | None
    pedal_up: float
    pedal_period: float
    ahead: float = math.inf

    @property
    def forward(self) -> bool:
        """Whether the rows are judged as the drive goes on, not of a whole drive."""
        return math.isfinite(self.ahead)

    def mean(self, values: Floats, time: Floats, ahead: float | None = None) -> Floats:
        """Mean over `PUSHED_TIME` at the stamps of the reading (n,), no further ``ahead``.

        Parameters
        ----------
        values : (n,) NaN where nothing is known
        time : (n,) [s]
        ahead : `FootSetup.ahead` when None [s]
        """
        ahead = self.ahead if ahead is None else ahead
        return averaged(values, self.period, PUSHED_TIME, time=time, ahead=ahead)


def identify_foot(
    drive: Drive, vehicle: Vehicle, source: Signal, need: Floats, torque: Floats
) -> FootSetup:
    """Find from a whole drive what `weighbridge.balance.foot.find_foot` judges its rows by.

    Parameters
    ----------
    drive, vehicle
    source : what the torque is made from
    need : (n,) force that the motion takes over weight, at the stamps of the source [-]; NaN
        where nothing measures the grade
    torque : (n,) torque of the engine that the motion takes [N m]; NaN without a gear
    """
    pedal = _pedal(drive, vehicle)
    single = vehicle.driveline.single_speed
    by_motion = single and bool(np.isfinite(need).any())
    turning, slowing = turning_at(drive, source), _slowing(source.time, need)
    floor = None if by_motion else _floor(vehicle, _driven(drive, source), turning, slowing)
    asked = least = None
    if floor is not None:
        level = floor.reading(turning)
        asked = _asked(source, level, floor.span, torque)
        if not single:
            if vehicle.dragged is not None:
                known, reach = Floor.of_vehicle(vehicle.dragged), vehicle.dragged.reach
            else:
                known, reach = floor, _reach(floor, (source.values - level)[slowing])
            dragged = np.maximum(known.reading(turning) + reach, level)
            least = _least(source, level, reach, dragged, torque)
    return FootSetup(
        period=source.period,
        by_motion=by_motion,
        floor=floor,
        asked=asked,
        least=least,
        pedal=pedal.name if pedal is not None else None,
        pedal_up=0.0 if pedal is None else float(np.percentile(pedal.values, 1.0)) + PRESSED,
        pedal_period=0.0 if pedal is None else pedal.period,
    )


def learn_dragged(
    drives: Sequence[Drive], sources: Sequence[Signal], needs: Sequence[Floats]
) -> DraggedReading | None:
    """Learn from several drives what the torque source reads while the engine is dragged.

    Parameters
    ----------
    drives
    sources : what the torque of each is made from
    needs : (n,) of each, force that the motion takes over weight, at the stamps of its source
        [-]; NaN where nothing measures the grade

    Returns
    -------
    DraggedReading
        None where the drives do not show it.
    """
    pairs = list(zip(drives, sources, strict=True))
    turning = [turning_at(drive, source) for drive, source in pairs]
    floor = find_floor(
        np.concatenate([_driven(drive, source) for drive, source in pairs]),
        np.concatenate(turning),
    )
    if floor is None:
        return None
    above = [
        (source.values - floor.at(np.nan_to_num(speed)))[_slowing(source.time, need)]
        for source, speed, need in zip(sources, turning, needs, strict=True)
    ]
    return DraggedReading(
        engine_speed=tuple(map(float, floor.engine_speed)),
        level=tuple(map(float, floor.level)),
        scatter=floor.scatter,
        span=floor.span,
        reach=_reach(floor, np.concatenate(above)),
    )


def turning_at(drive: Drive, source: Signal) -> Floats:
    """Engine speed at the stamps of the source (n,) [rad/s]; NaN where it is not reported."""
    engine = drive.get("engine_speed")
    return engine.at(source.time) if engine is not None else np.full(len(source), np.nan)


def near(time: Floats, flag: Bools, asked: Floats, margin: float, ahead: float = math.inf) -> Bools:
    """Whether a flagged sample lies within ``margin`` of each instant (n,).

    Parameters
    ----------
    time, flag : (m,) samples, rising [s]
    asked : (n,) [s]
    margin : [s]
    ahead : no later sample counts [s]
    """
    flagged = np.concatenate(([-np.inf], time[flag], [np.inf]))
    after = np.searchsorted(flagged, asked)
    later = flagged[after] - asked <= min(margin, ahead)
    return np.asarray(later | (asked - flagged[after - 1] <= margin))


def _driven(drive: Drive, source: Signal) -> Floats:
    """Readings of the source while the vehicle moves (n,), else NaN."""
    speed = drive.speed
    if speed is None:
        return source.values
    return np.where(np.nan_to_num(speed.at(source.time)) > MOVES, source.values, np.nan)


def _slowing(recorded: Floats, need: Floats) -> Bools:
    """Where the motion slows so long that no foot is on the accelerator (n,).

    The readings to both sides show the time between, however far apart they are.
    """
    slows = np.concatenate(([False], need < -SLOWING, [False]))
    beside = slows[:-2] & slows[2:]
    return beside & ~near(recorded, ~(need < -SLOWING), recorded, SETTLED)


def _floor(vehicle: Vehicle, driven: Floats, turning: Floats, slowing: Bools) -> Floor | None:
    """Floor of the drive, or of the vehicle file where that follows it; None where neither is."""
    if vehicle.driveline.single_speed:
        finite = driven[np.isfinite(driven)]
        span = float(np.percentile(np.abs(finite), 99.5)) if finite.size else 0.0
        return Floor(np.ones(1), np.zeros(1), SCATTER[0] * span, span) if span > 0.0 else None
    floor = find_floor(driven, turning)
    if vehicle.dragged is not None:
        learnt = Floor.of_vehicle(vehicle.dragged)
        floor = learnt.cut(driven) if floor is None else learnt.cut(driven).lifted(floor)
        floor = floor.raised((driven - floor.at(np.nan_to_num(turning)))[slowing])
    return floor


def _reach(floor: Floor, above: Floats) -> float:
    """How far above its floor the reading goes where the motion slows; 0 within its scatter.

    Parameters
    ----------
    floor
    above : (k,) readings over the floor where the engine is surely dragged
    """
    known = above[np.isfinite(above)]
    if known.size < FEWEST_IN_BIN:
        return 0.0
    shown = min(float(np.percentile(known, 90.0)), FARTHEST * floor.span)
    return shown if shown > SIGNIFICANT * floor.scatter else 0.0


def _least(
    source: Signal, level: Floats, reach: float, dragged: Floats, torque: Floats
) -> float | None:
    """Torque below which a reading off its floor may be a dragged engine's [N m].

    Parameters
    ----------
    source, level : reading and its floor (n,)
    reach : how far above it the reading of a dragged engine goes
    dragged : (n,) highest reading of a dragged engine
    torque : (n,) that the motion takes [N m]
    """
    if not reach > 0.0:
        return None
    clear = (source.values - level > 2.0 * reach) & np.isfinite(torque)
    if np.count_nonzero(clear) < 5 * FEWEST_IN_BIN:
        return None
    slope, offset = np.polyfit(source.values[clear], torque[clear], 1)
    if not slope > 0.0:
        return None
    return float(offset) + float(slope) * float(np.median(dragged))


def _asked(source: Signal, level: Floats, span: float, torque: Floats) -> Asked | None:
    """Find what the motion asks of the reading; None where too little is clear of the floor.

    Parameters are those of `_least`; ``span`` is the range of the reading.
    """
    taken = averaged(torque, source.period, PUSHED_TIME)
    clear = (source.values > level + PUSHED * span) & np.isfinite(taken)
    if np.count_nonzero(clear) < 5 * FEWEST_IN_BIN or not np.ptp(taken[clear]) > 0.0:
        return None
    slope, offset = np.polyfit(taken[clear], source.values[clear], 1)
    noise = _white_noise(source.values, clear)
    return Asked(slope=float(slope), offset=float(offset), noise=noise)


def _white_noise(values: Floats, clear: Bools) -> float:
    """Standard deviation of what clear samples have for themselves, beside their neighbours."""
    alone = (values[1:-1] - 0.5 * (values[:-2] + values[2:]))[clear[1:-1]]
    return spread(alone) / math.sqrt(1.5)


def _pedal(drive: Drive, vehicle: Vehicle) -> Signal | None:
    """Position of the accelerator; None where nothing gives it.

    The throttle of an engine may be the valve of its intake, which is never quite shut.
    """
    names = ("accelerator_pedal", "relative_pedal")
    for name in (*names, "throttle") if vehicle.driveline.single_speed else names:
        pedal = drive.get(name)
        if pedal is not None and len(pedal) > 1 and np.ptp(pedal.values) > 5.0 * PRESSED:
            return pedal
    return None
