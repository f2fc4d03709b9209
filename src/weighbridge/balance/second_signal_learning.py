"""What a calibration learns of the second signals of its torque reading."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from weighbridge.balance.disagreement import accepted_scales, difference, judged
from weighbridge.balance.second_signal import (
    SECOND_SIGNALS,
    Rows,
    SecondSignal,
    air_of,
    compare,
    lateness,
    means,
    ranges_of,
    rows_of,
)
from weighbridge.limits import MANY, SOME
from weighbridge.messages import Problem
from weighbridge.signals import Drive, Floats, robust_fit, spread
from weighbridge.vehicle import SecondSignalRelation, Vehicle, source_of

CLOSED: Final = 0.15
"""Part of the second signal's range, from its low end, where fuel is cut or the throttle closed
[-]: there air still passes, and the reading lies on its floor."""

FROM: Final = tuple(float(part) for part in np.arange(0.6, CLOSED - 0.01, -0.05))
"""Parts of the second signal's range, from its low end, from which the relation is tried [-]."""

OUTLYING: Final = 6.0
"""A mean so many usual scatters off the relation belongs to another state of the engine [-],"""

FINEST: Final = 0.005
"""where a scatter is at least this part of the reading's range [-]."""

STRAY: Final = 0.1
"""Where a larger part of the means is of another state, a second signal shows nothing [-]."""

SCATTERED: Final = 0.06
"""A second signal about whose relation the reading scatters by more than this part of its range is
none [-]: means of petrol engines and of a battery scattered by 0.01 to 0.03 in simulated and
recorded drives; load over air flow of two recorded diesels by 0.18 to 0.43."""

EXPLAINED: Final = 0.85
"""A second signal explains this part of the variance of the reading at least [-]: the recorded
petrol engine's 0.95, a battery's 0.89 and more, the diesels' 0.01 to 0.77."""

SCALE_STD: Final = 0.022
"""Standard deviation of the scale between drives of one vehicle, at least [-]: 67 recorded trips
of a petrol car (load by intake pressure, relations learnt on three others) had 0.96 to 1.035 in
19 of 20 pairs, 22 trips of an electric car by its battery 0.97 to 1.02."""


def learn_second_signals(
    drives: Sequence[Drive], vehicle: Vehicle
) -> tuple[tuple[SecondSignalRelation, ...], tuple[Problem, ...]]:
    """Learn from drives of known mass how the torque's reading goes with its second signals.

    Parameters
    ----------
    drives : of the calibration
    vehicle : with its torque source and gearings

    Returns
    -------
    relations : of the second signals that every drive has and that explain the reading well
    doubts : drives that contradict each other, one for each second signal
    """
    relations, doubts = [], []
    for second_signal in SECOND_SIGNALS:
        every = [rows_of(drive, vehicle, second_signal) for drive in drives]
        rows = [r for r in every if r is not None]
        if len(rows) < len(drives):
            continue
        airs = [air_of(drive, drive.start, drive.end) for drive in drives]
        doubt = contradiction(drives, rows, airs, second_signal, vehicle)
        if doubt is not None:
            doubts.append(doubt)
            continue
        if (relation := learn(rows, airs, second_signal)) is not None:
            relations.append(relation)
    return tuple(relations), tuple(doubts)


class _Followed(NamedTuple):
    """Means of a range in which the reading follows the second signal.

    Attributes
    ----------
    value_range : of the second signal [SI]
    columns, reading : (m, k), (m,) of the means
    found : (k,) coefficients
    """

    value_range: tuple[float, float]
    columns: Floats
    reading: Floats
    found: Floats

    def strays_below(self, columns: Floats, reading: Floats) -> bool:
        """Say whether the means that a lower begin of the range adds are of another state.

        Where the clutch is open or fuel is cut the engine breathes, and the reading lies on its
        floor.
        """
        span = float(np.ptp(np.percentile(self.reading, [2.0, 98.0])))
        scatter = spread(self.reading - self.columns @ self.found)
        added = columns[:, 1] < float(np.min(self.columns[:, 1]))
        off = np.abs(reading[added] - columns[added] @ self.found)
        stray = np.count_nonzero(off > OUTLYING * max(scatter, FINEST * span))
        return bool(stray > max(STRAY * off.size, 2))


def contradiction(
    drives: Sequence[Drive],
    rows: Sequence[Rows],
    airs: Sequence[tuple[float, float]],
    second_signal: SecondSignal,
    vehicle: Vehicle,
) -> Problem | None:
    """Say which drives of a calibration contradict each other; None if none.

    Parameters
    ----------
    drives
    rows, airs : of each, as of `learn`
    second signal, vehicle
    """
    source = vehicle.torque.of_source.name
    for i, first in enumerate(rows):
        relation = learn([first], [airs[i]], second_signal)
        if relation is None:
            continue
        for j, second in enumerate(rows):
            part = means(second, second_signal, ranges_of(relation))
            if i == j or part.time.size < SOME:
                continue
            accepted = accepted_scales(source, relation, airs[j])
            finding = judged(part, relation, accepted)
            if finding is not None and finding.verdict == "serious":
                reading = source_of(vehicle).signals[0]
                return Problem.of(
                    "calibration.drives_contradict",
                    first=drives[i].name,
                    second=drives[j].name,
                    witness=second_signal.signal,
                    reading=reading,
                    by=difference(finding),
                )
    return None


def learn(
    rows: Sequence[Rows], airs: Sequence[tuple[float, float]], second_signal: SecondSignal
) -> SecondSignalRelation | None:
    """Fit the relation to one second signal; None where it does not explain the reading.

    Parameters
    ----------
    rows : of each drive
    airs : pressure and temperature of the air of each drive [Pa], [K]; NaN where unknown
    second signal
    """
    value = np.concatenate([r.value[r.driving] for r in rows])
    turning = np.concatenate([r.turning[r.driving] for r in rows])
    if value.size < MANY:
        return None
    low, high = np.percentile(value, [1.0, 99.0])
    slow, fast = np.percentile(turning, [1.0, 99.0])
    speed_range = (float(0.95 * slow), float(1.05 * fast))
    best: _Followed | None = None
    for begin in [0.0] if second_signal.battery else FROM:
        ends = (float(low + begin * (high - low)), float(high + 0.05 * (high - low)))
        parts = [means(r, second_signal, (ends, speed_range)) for r in rows]
        reading = np.concatenate([p.reading for p in parts])
        columns = np.vstack([p.terms for p in parts])
        if reading.size < MANY:
            continue
        if best is not None and best.strays_below(columns, reading):
            break
        best = _Followed(ends, columns, reading, robust_fit(columns, reading)[0])
    if best is None:
        return None
    value_range, columns, reading, found = best
    predicted = columns @ found
    bottom, top = np.percentile(reading, [2.0, 98.0])
    span = float(top - bottom)
    scatter = spread(reading - predicted)
    if not span > 0.0 or scatter > SCATTERED * span:
        return None
    if 1.0 - float(np.var(reading - predicted)) / float(np.var(reading)) < EXPLAINED:
        return None
    own = compare(reading, predicted)
    known = [np.array(x) for x in zip(*airs, strict=True)]
    pressure, temperature = (float(np.mean(x)) if np.isfinite(x).all() else None for x in known)
    relation = SecondSignalRelation(
        signal=second_signal.signal,
        coefficients=tuple(map(float, found)),
        scatter=max(scatter, 1e-6 * span),
        span=span,
        scale_std=float(np.hypot(SCALE_STD * np.sqrt(1.0 + 1.0 / len(rows)), own.scale_std)),
        value_range=value_range,
        speed_range=speed_range,
        pressure=pressure,
        temperature=temperature,
    )
    found_lags = [lateness(r, second_signal, relation) for r in rows]
    lags = [lag for lag in found_lags if lag is not None and math.isfinite(lag)]
    return replace(relation, lag=float(np.median(lags))) if lags else relation
