"""Values that stand still while the vehicle goes on: torque, engine speed, vehicle speed.

A bus that fell silent, or a logger that writes its last value on, leaves readings that look
sound. They are separated from a steady drive by what else changes meanwhile, and left out.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.limits import DRIVES
from weighbridge.signals import Bools, Drive, Floats, Signal
from weighbridge.signals.runs import Runs, runs_of
from weighbridge.vehicle.gear import STANDS

SHORTEST: Final[dict[str, float]] = {"engine_speed": 10.0, "vehicle_speed": 20.0}
"""Runs of one value below may be a steady drive [s]."""

SHORTEST_TORQUE: Final = 20.0
"""The same of torque, load and air flow [s]: cruise control on the level holds a rounded load
so long, and loaded trucks climb at full load for minutes, which is shown by the rest."""

HELD: Final = 8.0
"""Shorter runs of torque, load and air flow count from here on [s] where there are"""

FEWEST_HELD: Final = 5
"""so many of them at least that cannot have lasted: a source that holds its value now and then.
Undamaged recordings of twelve vehicles had two at most."""

ACROSS: Final = 4.0
"""Acceleration is that of the speed over this time [s]."""

VARIES: Final = 0.4
"""Range of acceleration that one torque does not make [m/s^2]: 4 % of grade."""

EXTREME: Final = (-0.8, 0.4, 8.0)
"""Least and greatest acceleration [m/s^2] and range of speed [m/s] that no torque at its
lowest, at zero or at its highest makes: coasting and full load last long."""

DRAGGED: Final = 0.05
"""Part of its range above its lowest up to which a reading may be a dragged engine's [-]: drag goes
with speed and warmth, by up to 0.035 in four undamaged vehicles of the second model."""

LEVEL_RUNS: Final = 3
"""Runs at one value from which on it is a level of the reading, such as that of a dragged engine,
and no value that was held by chance."""

REVS: Final = 1.3
"""Highest over lowest engine speed that one torque does not outlast [-]."""

IN_GEAR: Final = 1.15
"""Highest over lowest vehicle speed that one engine speed does not outlast in gear [-]."""


IDLING: Final = 1.25
"""Engine speed over that at standstill below which it may idle on its own [-]."""

SHIFTED: Final = 1.6
"""Highest over lowest engine speed that no two gears explain at one speed [-]."""

APART: Final = 3.0
"""Range of the speed over ground while the vehicle speed stands still [m/s]."""


def frozen(drive: Drive, name: str) -> Bools:
    """Mark the samples of a signal that repeat a value which cannot have lasted.

    Parameters
    ----------
    drive
    name : of torque, load, engine speed or vehicle speed

    Returns
    -------
    (n,) the first of each run is not marked
    """
    signal = drive.signals[name]
    marked = np.zeros(len(signal), dtype=bool)
    if len(signal) < 20:
        return marked
    runs = runs_of(signal)
    shortest = SHORTEST.get(name, SHORTEST_TORQUE)
    least = min(shortest, SHORTEST.get(name, HELD))
    candidates = np.flatnonzero((runs.duration >= least) & (runs.length >= 8)).tolist()
    if name not in SHORTEST:
        candidates = [k for k in candidates if not _rests(drive, signal, _part(runs, k))]
    values, counts = np.unique(signal.values[runs.first[candidates]], return_counts=True)
    levels = frozenset(values[counts >= LEVEL_RUNS].tolist())
    impossible = [k for k in candidates if _impossible(drive, signal, _part(runs, k), levels)]
    if len(impossible) >= FEWEST_HELD:
        # What is known to hold its value has held the others too.
        impossible = candidates
    else:
        impossible = [k for k in impossible if runs.duration[k] >= shortest]
    for k in impossible:
        part = _part(runs, k)
        marked[part.start + 1 : part.stop] = True
    return marked


def _part(runs: Runs, k: int) -> slice:
    return slice(int(runs.first[k]), int(runs.first[k] + runs.length[k]))


def _rests(drive: Drive, torque: Signal, part: slice) -> bool:
    """Whether the engine stands meanwhile, without torque, as that of a hybrid does."""
    # What it reads then may be less than nothing.
    if torque.values[part.start] > DRAGGED * np.max(torque.values):
        return False
    engine = _of(drive, "engine_speed", torque.time[part])
    known = engine[np.isfinite(engine)]
    return bool(known.size and np.median(known) < STANDS)


def _impossible(drive: Drive, signal: Signal, part: slice, levels: frozenset[float]) -> bool:
    """Whether a value cannot have lasted; coasting and full load come back to their ``levels``."""
    time, value = signal.time[part], float(signal.values[part.start])
    grid = np.linspace(time[0], time[-1], max(int((time[-1] - time[0]) / 1.0), 8))
    if signal.name == "vehicle_speed":
        return _speed_frozen(drive, grid, value)
    speed = _speed(drive, grid)
    if signal.name == "engine_speed":
        moving = speed[speed > DRIVES]
        idle = _idle(drive, signal)
        return bool(
            value > max(IDLING * idle, STANDS)
            and moving.size >= 5
            and moving.max() > IN_GEAR * moving.min()
        )
    known = np.isfinite(speed)
    if np.count_nonzero(known) < 8:
        return False
    step = max(int(ACROSS / (grid[1] - grid[0])), 1)
    accel = (speed[step:] - speed[:-step]) / (grid[step:] - grid[:-step])
    accel = accel[np.isfinite(accel)]
    if not accel.size:
        return False
    lowest, highest = float(signal.values.min()), float(signal.values.max())
    if value in (0.0, highest, *levels) or value <= lowest + DRAGGED * (highest - lowest):
        low, high, reach = EXTREME
        return bool(accel.min() < low and accel.max() > high and np.ptp(speed[known]) > reach)
    engine = _of(drive, "engine_speed", grid)
    engine = engine[(engine > 30.0) & (speed > DRIVES)]
    revs = engine.size >= 5 and engine.max() > REVS * engine.min()
    return bool((np.ptp(accel) > VARIES or revs) and np.nanmax(speed) > DRIVES)


def _speed_frozen(drive: Drive, grid: Floats, value: float) -> bool:
    ground = _of(drive, "gnss_speed", grid)
    ground = ground[np.isfinite(ground)]
    if ground.size > 0.5 * grid.size:
        return bool(np.ptp(ground) > APART and np.max(np.abs(ground - value)) > APART)
    engine = _of(drive, "engine_speed", grid)
    engine = engine[engine > 30.0]
    return bool(value > DRIVES and engine.size >= 5 and engine.max() > SHIFTED * engine.min())


def _speed(drive: Drive, at: Floats) -> Floats:
    """Speed of the vehicle, by GNSS where it has no other; NaN where unknown (n,) [m/s]."""
    own = _of(drive, "vehicle_speed", at)
    return np.where(np.isfinite(own), own, _of(drive, "gnss_speed", at))


def _of(drive: Drive, name: str, at: Floats) -> Floats:
    signal = drive.get(name)
    if signal is None or not len(signal):
        return np.full(at.size, np.nan)
    return np.where(signal.age(at) < 2.0, signal.at(at), np.nan)


def _idle(drive: Drive, engine: Signal) -> float:
    """Engine speed at standstill [rad/s]; 0 where it was not seen."""
    standing = np.abs(_speed(drive, engine.time)) < 0.3
    turning = engine.values[standing & (engine.values > 30.0)]
    return float(np.median(turning)) if turning.size >= 10 else 0.0
