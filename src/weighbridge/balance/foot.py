"""Where the driver's foot is off the accelerator, so that it may be on the brake.

A driver brakes with the engine dragged. The reading then lies on its floor, the lowest
value it takes at that engine speed; how hard the brake works it does not say. So the rows on
the floor are left out, and those just beside them, where a foot is on its way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.kernels import two_states
from weighbridge.signals import Bools, Drive, Floats, Signal
from weighbridge.vehicle.model import DraggedReading, Vehicle
from weighbridge.vehicle.torque import averaged

BIN: Final = 1.12
"""Ratio of the engine speeds at the ends of a bin [-]."""

SLOWEST_ENGINE: Final = 30.0
"""Engine speed at which the first bin begins [rad/s]."""

FEWEST: Final = 12
"""Samples that a bin needs."""

LOW: Final = 2.0
"""Percentile of the readings in a bin near which its floor lies."""

SPREAD: Final = 0.05
"""Readings so near above that percentile, over the range of the reading, lie on the floor [-]."""

SHARE: Final = 0.06
"""Part of a bin's readings that lie on a floor; of an engine that was never dragged at that speed
fewer are so near its lowest reading [-]."""

HIGHEST: Final = 0.25
"""Floor over the highest reading, at most [-]: idling and dragged engines read a tenth or less."""

SLOPE: Final = 0.02
"""Rise of the floor from one bin to the next, over the range of the reading, at most [-]."""

SCATTER: Final = (0.012, 0.03)
"""Standard deviation of readings on the floor over the range of the reading, at least and at
most [-]."""

USUAL_LAG: Final = 0.3
"""Time constant of the smoothing by which control units report torque and load [s]."""

SHORTEST: Final = 0.2
"""Time between readings over which the smoothing is undone, at least [s]."""

SLOWING: Final = 0.03
"""Force over weight that slows a vehicle so much that no foot is on the accelerator [-]."""

SETTLED: Final = 0.7
"""The motion has to slow for so long around a reading that is one of a dragged engine [s]."""

FARTHEST: Final = 0.15
"""Such readings over their floor, over the range of the reading, at most [-]: of a recorded car a
quarter of the braked readings lay within 0.04 of the floor and three quarters within 0.1."""

DRIFT: Final = 0.03
"""A reading may drift by so much between drives, over its range [-]: by air, heat and what the
alternator takes."""

LEAST_DRAGGED: Final = 10.0
"""Percentile of the readings of a surely dragged engine on which its floor lies."""

BEYOND: Final = 3.0
"""Standard deviations of the floor within which a reading lies on it [-]."""

PUSHED_TIME: Final = 1.0
"""Time over which the motion tells whether the engine pushes the vehicle [s]."""

STAY: Final = 1.0
"""Mean time that a foot stays on a pedal [s]."""

ODDS: Final = (-5.0, 3.0)
"""Bounds of what one reading adds to the logarithm of the odds that the foot is off [-]."""

PROBABLE: Final = 0.3
"""Probability above which the foot counts as off the accelerator [-]."""

PUSHED: Final = 0.1
"""Reading that the motion asks for over its floor, over the range of the reading, above which a
low reading may be noise [-]."""

NOISE_REACH: Final = 3.0
"""Standard deviations of its noise by which a reading falls below what the motion asks for [-]."""

PRESSED: Final = 0.01
"""Position of the accelerator above its lowest from which a foot is on it [-]."""

MOVING: Final = 1.0
"""Speed above which a reading tells of a dragged engine [m/s]."""

WALKING: Final = 3.0
"""Speed from which a vehicle that stops has been driven [m/s]."""

STANDING: Final = 0.3
"""Speed below which it stands [m/s]."""

MARGIN: Final = 0.5
"""Samples nearer than this to one with the foot off may see the brake [s]."""

MOST_MARGIN: Final = 1.0
"""The same at most: slowly polled logs would have no rows left [s]."""

MARGIN_POLLS: Final = 2.0
"""The same in periods of the reading, where it is polled slowly [-]."""


@dataclass(frozen=True, slots=True)
class Floor:
    """Reading of a dragged engine over its speed.

    Attributes
    ----------
    engine_speed : (b,) middle of each bin, rising [rad/s]
    level : (b,) reading of the dragged engine
    scatter : standard deviation of such readings
    span : range of the reading from dragged to full
    """

    engine_speed: Floats
    level: Floats
    scatter: float
    span: float

    def at(self, engine_speed: Floats) -> Floats:
        """Floor at engine speeds (n,); at the ends that of the last bin."""
        return np.interp(engine_speed, self.engine_speed, self.level)

    @classmethod
    def of_vehicle(cls, known: DraggedReading) -> Floor:
        """Return the floor that a calibration has learnt."""
        return cls(np.array(known.engine_speed), np.array(known.level), known.scatter, known.span)

    def lifted(self, other: Floor) -> Floor:
        """Follow another floor where it lies a little higher, and its scatter where it is larger.

        A reading may drift, and another logger be noisier. Where the other floor lies far above,
        its drive did not drag the engine at that speed.
        """
        higher = other.at(self.engine_speed) - self.level
        near = (higher > 0.0) & (higher < DRIFT * self.span)
        return replace(
            self,
            level=self.level + np.where(near, higher, 0.0),
            scatter=max(self.scatter, other.scatter),
        )

    def raised(self, above: Floats) -> Floor:
        """Rise to what the engine reads where the motion shows that it is dragged.

        Parameters
        ----------
        above : (k,) readings over this floor there; NaN where unknown
        """
        known = above[np.isfinite(above)]
        if known.size < FEWEST:
            return self
        least = float(np.percentile(known, LEAST_DRAGGED))
        return replace(self, level=self.level + least) if least > DRIFT * self.span else self


def find_floor(reading: Floats, engine_speed: Floats) -> Floor | None:
    """Learn the floor of a reading over engine speed.

    Parameters
    ----------
    reading, engine_speed : (n,) while driving; NaN where unknown [rad/s]

    Returns
    -------
    Floor
        None where there are too few samples, or the engine was never dragged.
    """
    known = np.isfinite(reading) & np.isfinite(engine_speed) & (engine_speed > SLOWEST_ENGINE)
    if np.count_nonzero(known) < 5 * FEWEST:
        return None
    x, turning = reading[known], engine_speed[known]
    low, high = np.percentile(x, [1.0, 99.5])
    span = float(high - low)
    if not span > 0.0:
        return None
    bins = (np.log(turning / SLOWEST_ENGINE) / np.log(BIN)).astype(np.int64)
    count = int(bins.max()) + 1
    level = np.full(count, np.nan)
    rest = []
    for k in range(count):
        inside = x[bins == k]
        if inside.size < FEWEST:
            continue
        near = inside[inside <= np.percentile(inside, LOW) + SPREAD * span]
        if np.median(near) > HIGHEST * high:
            continue
        if near.size >= max(0.5 * FEWEST, SHARE * inside.size):
            level[k] = np.median(near)
            rest.append(near - level[k])
    middle = np.asarray(SLOWEST_ENGINE * BIN ** (np.arange(count) + 0.5), dtype=np.float64)
    shown = np.isfinite(level)
    if not shown.any():
        return None
    # Where an engine was never dragged its lowest readings are no floor: it does not rise
    # faster than the floors beside it allow.
    every = np.arange(count)
    steps = np.abs(every[:, None] - every[shown]) * SLOPE * span
    level = np.min(level[shown] + steps, axis=1)
    spread = 1.4826 * float(np.median(np.abs(np.concatenate(rest))))
    return Floor(middle, level, float(np.clip(spread, *np.multiply(SCATTER, span))), span)


@dataclass(frozen=True, slots=True)
class Foot:
    """Where the foot may be off the accelerator.

    Attributes
    ----------
    off : (n,)
    told : whether reading, pedal or motion tell it at all
    """

    off: Bools
    told: bool


def find_foot(drive: Drive, vehicle: Vehicle, source: Signal, need: Floats, torque: Floats) -> Foot:
    """Find where the foot may be off the accelerator.

    Two hidden states, dragged and pushing, of which a dragged engine reads its floor and a
    pushing one anything above: so the noise of a reading does not choose rows one by one.
    Where the position of the accelerator is told and it is pressed, no foot is on the brake.

    Parameters
    ----------
    drive, vehicle
    source : what the torque is made from
    need : (n,) force that the motion takes over weight, at the stamps of the source [-]; NaN
        where nothing measures the grade
    torque : (n,) torque of the engine that the motion takes [N m]; NaN without a gear
    """
    dragged = _dragged(drive, vehicle, source, need, torque)
    pedal = _pedal(drive, vehicle)
    if dragged is None:
        if pedal is None:
            return Foot(np.zeros(len(source), dtype=bool), told=False)
        # A pedal may be up because cruise control pushes.
        pushed = averaged(need, source.period, PUSHED_TIME) > 0.0
        return Foot(~_pressed(pedal, source.time) & ~pushed, told=True)
    pressed = np.zeros(len(source), bool) if pedal is None else _pressed(pedal, source.time)
    # The foot leaves the accelerator before a vehicle stops: a floor that shows it nowhere is none.
    told = pedal is not None or bool(dragged.any()) or not _stops(drive)
    return Foot(dragged & ~pressed, told=told)


def _stops(drive: Drive) -> bool:
    """Whether the vehicle comes to a stop from more than walking pace."""
    speed = drive.speed
    if speed is None:
        return False
    size = np.abs(speed.values)
    fast = size[(size > WALKING) | (size < STANDING)] > WALKING
    return bool(np.any(fast[:-1] & ~fast[1:]))


def _pressed(pedal: Signal, recorded: Floats) -> Bools:
    """Where the accelerator is surely pressed, so that the brake is not (n,).

    A pedal that is up tells less: cruise control pushes without a foot.
    """
    up = pedal.values <= float(np.percentile(pedal.values, 1.0)) + PRESSED
    margin = max(MARGIN, pedal.period)
    known = pedal.age(recorded) <= margin
    return np.asarray(known & ~near(pedal.time, up, recorded, margin))


def _dragged(
    drive: Drive, vehicle: Vehicle, source: Signal, need: Floats, torque: Floats
) -> Bools | None:
    """Where engine or motor may be dragged, by reading and motion; None where neither tells.

    Parameters are those of `find_foot`.
    """
    recorded = source.time
    known = vehicle.dragged
    turning = _turning(drive, source)
    driven = _driven(drive, source)
    slowing = _slowing(recorded, need)
    if vehicle.driveline.single_speed:
        # A motor that recuperates may be helped by the brake, and no floor tells where it ends.
        if np.isfinite(need).any():
            return np.asarray(~(averaged(need, source.period, PUSHED_TIME) > 0.0))
        finite = driven[np.isfinite(driven)]
        span = float(np.percentile(np.abs(finite), 99.5)) if finite.size else 0.0
        floor = Floor(np.ones(1), np.zeros(1), SCATTER[0] * span, span) if span > 0.0 else None
    else:
        floor = find_floor(driven, turning)
        if known is not None:
            learnt = Floor.of_vehicle(known)
            floor = learnt if floor is None else learnt.lifted(floor)
            floor = floor.raised((driven - floor.at(np.nan_to_num(turning)))[slowing])
    if floor is None:
        return None
    level = floor.at(np.nan_to_num(turning))
    # An engine brake reads far less than an engine that is dragged, and neither pushes.
    level = np.where(level < -HIGHEST * floor.span, 0.0, level)
    sharp, gain = unsmoothed(source)
    odds = np.maximum(
        _log_odds(source.values - level, floor.scatter, floor.span),
        _log_odds(sharp - level, gain * floor.scatter, floor.span),
    )
    odds = np.where(_noisy(source, level, floor.span, torque), ODDS[0], odds)
    off = two_states.posterior(odds, source.time, STAY) > PROBABLE
    margin = float(np.clip(MARGIN_POLLS * source.period, MARGIN, MOST_MARGIN))
    off = near(source.time, off, recorded, margin)
    if vehicle.driveline.single_speed:
        return off
    reach = _reach(floor, (source.values - level)[slowing])
    if known is not None:
        reach = max(reach, known.reach)
    return off | _untold(source, level, reach, torque)


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
    turning = [_turning(drive, source) for drive, source in pairs]
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


def _turning(drive: Drive, source: Signal) -> Floats:
    """Engine speed at the stamps of the source (n,) [rad/s]; NaN where it is not told."""
    engine = drive.get("engine_speed")
    return engine.at(source.time) if engine is not None else np.full(len(source), np.nan)


def _driven(drive: Drive, source: Signal) -> Floats:
    """Readings of the source while the vehicle moves (n,), else NaN."""
    speed = drive.speed
    if speed is None:
        return source.values
    return np.where(np.nan_to_num(speed.at(source.time)) > MOVING, source.values, np.nan)


def _slowing(recorded: Floats, need: Floats) -> Bools:
    """Where the motion slows so long that no foot is on the accelerator (n,)."""
    return ~near(recorded, ~(need < -SLOWING), recorded, SETTLED)


def _untold(source: Signal, level: Floats, reach: float, torque: Floats) -> Bools:
    """Where so little torque is taken that a reading off its floor may be a dragged engine's (n,).

    An engine without fuel cut burns its idle charge in overrun, and so reads above its floor what
    it also reads when it pushes a little. The motion tells these rows, not the reading.

    Parameters
    ----------
    source, level : reading and its floor (n,)
    reach : how far above it the reading of a dragged engine goes
    torque : (n,) that the motion takes [N m]
    """
    line = _torque_of(source, level, reach, torque) if reach > 0.0 else None
    if line is None:
        return np.zeros(len(source), dtype=bool)
    slope, offset = line
    least = offset + slope * (float(np.median(level)) + reach)
    taken = averaged(torque, source.period, PUSHED_TIME)
    return np.asarray(taken < least)


def _noisy(source: Signal, level: Floats, span: float, torque: Floats) -> Bools:
    """Where a reading may be as low as it is by noise alone, for the motion shows a push (n,).

    Without this the noise of a reading chooses rows: low ones pass for a dragged engine, high
    ones stay, and masses come out light.

    Parameters are those of `_untold`; ``span`` is the range of the reading.
    """
    taken = averaged(torque, source.period, PUSHED_TIME)
    clear = (source.values > level + PUSHED * span) & np.isfinite(taken)
    if np.count_nonzero(clear) < 5 * FEWEST or not np.ptp(taken[clear]) > 0.0:
        return np.zeros(len(source), dtype=bool)
    asked = np.polyval(np.polyfit(taken[clear], source.values[clear], 1), taken)
    pushes = ~near(source.time, ~(asked > level + PUSHED * span), source.time, SETTLED)
    return np.asarray(
        pushes & (asked - source.values < NOISE_REACH * _white_noise(source.values, clear))
    )


def _white_noise(values: Floats, clear: Bools) -> float:
    """Standard deviation of what clear samples have for themselves, beside their neighbours."""
    alone = (values[1:-1] - 0.5 * (values[:-2] + values[2:]))[clear[1:-1]]
    return 1.4826 * float(np.median(np.abs(alone))) / np.sqrt(1.5) if alone.size else 0.0


def _torque_of(
    source: Signal, level: Floats, reach: float, torque: Floats
) -> tuple[float, float] | None:
    """Slope and offset of the torque that the motion takes over a reading clear of its floor."""
    clear = (source.values - level > 2.0 * reach) & np.isfinite(torque)
    if np.count_nonzero(clear) < 5 * FEWEST:
        return None
    slope, offset = np.polyfit(source.values[clear], torque[clear], 1)
    return (float(slope), float(offset)) if slope > 0.0 else None


def _reach(floor: Floor, above: Floats) -> float:
    """How far above its floor the reading goes where the motion slows; 0 within its scatter.

    Parameters
    ----------
    floor
    above : (k,) readings over the floor where the engine is surely dragged
    """
    known = above[np.isfinite(above)]
    if known.size < FEWEST:
        return 0.0
    shown = min(float(np.percentile(known, 90.0)), FARTHEST * floor.span)
    return shown if shown > BEYOND * floor.scatter else 0.0


def _log_odds(above: Floats, scatter: Floats | float, span: float) -> Floats:
    """Logarithm of the odds that a dragged engine reads so far ``above`` its floor (n,)."""
    odds = np.log(span / (np.sqrt(2.0 * np.pi) * scatter))
    odds = odds - 0.5 * (np.maximum(above, 0.0) / scatter) ** 2
    return np.asarray(np.clip(np.nan_to_num(odds, nan=ODDS[0]), *ODDS))


def unsmoothed(reading: Signal) -> tuple[Floats, Floats]:
    """Undo the usual smoothing of a control unit: what was held since the sample before (n,).

    A foot that taps the brake leaves the accelerator for less time than the reading takes to
    fall to its floor.

    Returns
    -------
    values : (n,) constant input of a first-order lag of `USUAL_LAG` that leads from an earlier
        reading to this one; NaN where none is near
    gain : (n,) its noise over that of the reading [-]
    """
    time, values = reading.time, reading.values
    step = 1
    if len(reading) > 1 and reading.period > 0.0:
        step = max(1, round(SHORTEST / reading.period))
    sharp, gain = np.full(len(reading), np.nan), np.ones(len(reading))
    if len(reading) <= step:
        return sharp, gain
    kept = np.exp(-(time[step:] - time[:-step]) / USUAL_LAG)
    sharp[step:] = (values[step:] - kept * values[:-step]) / (1.0 - kept)
    gain[step:] = np.sqrt(1.0 + kept**2) / (1.0 - kept)
    return sharp, gain


def _pedal(drive: Drive, vehicle: Vehicle) -> Signal | None:
    """Position of the accelerator; None where nothing tells it.

    The throttle of an engine may be the valve of its intake, which is never quite shut.
    """
    names = ("accelerator_pedal", "relative_pedal")
    for name in (*names, "throttle") if vehicle.driveline.single_speed else names:
        pedal = drive.get(name)
        if pedal is not None and len(pedal) > 1 and np.ptp(pedal.values) > 5.0 * PRESSED:
            return pedal
    return None


def near(time: Floats, flag: Bools, asked: Floats, margin: float) -> Bools:
    """Whether a flagged sample lies within ``margin`` of each instant (n,).

    Parameters
    ----------
    time, flag : (m,) samples, rising [s]
    asked : (n,) [s]
    margin : [s]
    """
    flagged = time[flag]
    if flagged.size == 0:
        return np.zeros(asked.size, dtype=bool)
    after = np.searchsorted(flagged, asked)
    right = flagged[np.minimum(after, flagged.size - 1)]
    left = flagged[np.maximum(after - 1, 0)]
    return np.minimum(np.abs(right - asked), np.abs(asked - left)) <= margin
