"""Where the driver's foot is off the accelerator, so that it may be on the brake.

A driver brakes with the engine dragged. The reading then lies on its floor, the lowest
value it takes at that engine speed; how hard the brake works it does not say. So the rows on
the floor are left out, and those just beside them, where a foot is on its way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.balance.foot_setup import (
    PUSHED,
    SETTLED,
    FootSetup,
    identify_foot,
    near,
    turning_at,
)
from weighbridge.kernels import two_states
from weighbridge.limits import DRIVES, SIGNIFICANT
from weighbridge.signals import Bools, Drive, Floats, Signal
from weighbridge.vehicle import Vehicle

USUAL_LAG: Final = 0.3
"""Time constant of the smoothing by which control units report torque and load [s]."""

SHORTEST: Final = 0.2
"""Time between readings over which the smoothing is undone, at least [s]."""

STAY: Final = 1.0
"""Mean time that a foot stays on a pedal [s]."""

ODDS: Final = (-5.0, 3.0)
"""Bounds of what one reading adds to the logarithm of the odds that the foot is off [-]."""

PROBABLE: Final = 0.3
"""Probability above which the foot counts as off the accelerator [-]."""

STANDING: Final = 0.3
"""Speed below which it stands [m/s]."""

MARGIN: Final = 0.5
"""Samples nearer than this to one with the foot off may see the brake [s]."""

MOST_MARGIN: Final = 1.0
"""The same at most: slowly polled logs would have no rows left [s]."""

MARGIN_POLLS: Final = 2.0
"""The same in periods of the reading, where it is polled slowly [-]."""


@dataclass(frozen=True, slots=True)
class Foot:
    """Where the foot may be off the accelerator.

    Attributes
    ----------
    off : (n,)
    observable : whether reading, pedal or motion show it at all
    """

    off: Bools
    observable: bool


def find_foot(
    drive: Drive,
    vehicle: Vehicle,
    source: Signal,
    need: Floats,
    torque: Floats,
    setup: FootSetup | None = None,
) -> Foot:
    """Find where the foot may be off the accelerator.

    Two hidden states, dragged and pushing, of which a dragged engine reads its floor and a
    pushing one anything above: so the noise of a reading does not choose rows one by one.
    Where the position of the accelerator is reported and it is pressed, no foot is on the brake.

    Parameters
    ----------
    drive, vehicle
    source : what the torque is made from
    need : (n,) force that the motion takes over weight, at the stamps of the source [-]; NaN
        where nothing measures the grade
    torque : (n,) torque of the engine that the motion takes [N m]; NaN without a gear
    setup : what holds all along the drive; found from this drive when None
    """
    if setup is None:
        setup = identify_foot(drive, vehicle, source, need, torque)
    pedal = drive.get(setup.pedal) if setup.pedal is not None else None
    dragged = _dragged(drive, vehicle, source, need, torque, setup)
    if dragged is None:
        if pedal is None:
            return Foot(np.zeros(len(source), dtype=bool), observable=False)
        # A pedal may be up because cruise control pushes.
        pushed = setup.mean(need, source.time) > 0.0
        return Foot(~_pressed(pedal, source.time, setup) & ~pushed, observable=True)
    pressed = np.zeros(len(source), bool) if pedal is None else _pressed(pedal, source.time, setup)
    # The foot leaves the accelerator before a vehicle stops: a floor that shows it nowhere is none.
    observable = pedal is not None or bool(dragged.any()) or not _stops(drive)
    return Foot(dragged & ~pressed, observable=observable)


def _stops(drive: Drive) -> bool:
    """Whether the vehicle comes to a stop from more than walking pace."""
    speed = drive.speed
    if speed is None:
        return False
    size = np.abs(speed.values)
    fast = size[(size > DRIVES) | (size < STANDING)] > DRIVES
    return bool(np.any(fast[:-1] & ~fast[1:]))


def _pressed(pedal: Signal, recorded: Floats, setup: FootSetup) -> Bools:
    """Where the accelerator is surely pressed, so that the brake is not (n,).

    A pedal that is up shows less: cruise control pushes without a foot.
    """
    margin = max(MARGIN, setup.pedal_period)
    known = pedal.age(recorded) <= margin
    up = near(pedal.time, pedal.values <= setup.pedal_up, recorded, margin, setup.ahead)
    return np.asarray(known & ~up)


def _dragged(
    drive: Drive,
    vehicle: Vehicle,
    source: Signal,
    need: Floats,
    torque: Floats,
    setup: FootSetup,
) -> Bools | None:
    """Where engine or motor may be dragged, by reading and motion; None where neither shows.

    Parameters are those of `find_foot`.
    """
    if setup.by_motion:
        # A motor that recuperates may be helped by the brake, and no floor shows where it ends.
        return np.asarray(~(setup.mean(need, source.time) > 0.0))
    floor = setup.floor
    if floor is None:
        return None
    recorded = source.time
    level = floor.reading(turning_at(drive, source))
    sharp, gain = unsmoothed(source, setup.period)
    odds = np.maximum(
        _log_odds(source.values - level, floor.scatter, floor.span),
        _log_odds(sharp - level, gain * floor.scatter, floor.span),
    )
    odds = np.where(_noisy(source, level, torque, setup), ODDS[0], odds)
    off = two_states.posterior(odds, recorded, STAY, setup.ahead) > PROBABLE
    margin = float(np.clip(MARGIN_POLLS * setup.period, MARGIN, MOST_MARGIN))
    off = near(recorded, off, recorded, margin, setup.ahead)
    # An engine without fuel cut burns its idle charge in overrun, and so reads above its floor
    # what it also reads when it pushes a little. The motion shows these rows, not the reading.
    if setup.least is None:
        return off
    return np.asarray(off | (setup.mean(torque, recorded) < setup.least))


def _noisy(source: Signal, level: Floats, torque: Floats, setup: FootSetup) -> Bools:
    """Where a reading may be as low as it is by noise alone, for the motion shows a push (n,).

    Without this the noise of a reading chooses rows: low ones pass for a dragged engine, high
    ones stay, and masses come out light.

    Parameters
    ----------
    source, level : reading and its floor (n,)
    torque : (n,) that the motion takes [N m]
    setup
    """
    if setup.asked is None or setup.floor is None:
        return np.zeros(len(source), dtype=bool)
    # Rows judge by the readings beside them: where the look ahead is limited, those have it all.
    until = -setup.ahead if setup.forward else math.inf
    asked = setup.asked.at(setup.mean(torque, source.time, until))
    clear = asked > level + PUSHED * setup.floor.span
    pushes = ~near(source.time, ~clear, source.time, SETTLED, 0.0 if setup.forward else math.inf)
    return np.asarray(pushes & (asked - source.values < SIGNIFICANT * setup.asked.noise))


def _log_odds(above: Floats, scatter: Floats | float, span: float) -> Floats:
    """Logarithm of the odds that a dragged engine reads so far ``above`` its floor (n,)."""
    odds = np.log(span / (np.sqrt(2.0 * np.pi) * scatter))
    odds = odds - 0.5 * (np.maximum(above, 0.0) / scatter) ** 2
    return np.asarray(np.clip(np.nan_to_num(odds, nan=ODDS[0]), *ODDS))


def unsmoothed(reading: Signal, period: float) -> tuple[Floats, Floats]:
    """Undo the usual smoothing of a control unit: what was held since the sample before (n,).

    A foot that taps the brake leaves the accelerator for less time than the reading takes to
    fall to its floor.

    Parameters
    ----------
    reading
    period : of the reading, usually [s]

    Returns
    -------
    values : (n,) constant input of a first-order lag of `USUAL_LAG` that leads from an earlier
        reading to this one; NaN where none is near
    gain : (n,) its noise over that of the reading [-]
    """
    time, values = reading.time, reading.values
    step = max(1, round(SHORTEST / period)) if period > 0.0 else 1
    sharp, gain = np.full(len(reading), np.nan), np.ones(len(reading))
    if len(reading) <= step:
        return sharp, gain
    kept = np.exp(-(time[step:] - time[:-step]) / USUAL_LAG)
    sharp[step:] = (values[step:] - kept * values[:-step]) / (1.0 - kept)
    gain[step:] = np.sqrt(1.0 + kept**2) / (1.0 - kept)
    return sharp, gain
