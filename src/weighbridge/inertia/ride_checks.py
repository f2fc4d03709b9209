"""From a drive to the samples of its ride, and what cannot be so in them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.inertia.filter import RideSamples, longest_step
from weighbridge.inertia.suspension import Response
from weighbridge.signals import QUANTITIES, Bools, Drive, Floats, Problem

WHEELS: Final = ("fl", "fr", "rl", "rr")
TRAVELS: Final = tuple(f"suspension_travel_{w}" for w in WHEELS)
RATES: Final = tuple(f"suspension_rate_{w}" for w in WHEELS)
VELOCITIES: Final = ("vertical_velocity", "roll_rate", "pitch_rate")
NEEDED: Final = (*TRAVELS, *RATES, *VELOCITIES)
"""Signals of the ride."""

LONGEST_PERIOD: Final = 0.0175
"""Longest period of a ride that can be used [s]: less than five samples in one hop of an axle."""

LEAST: Final = 4.0
"""A ride of less is not looked at [s]: its signs and units cannot be checked, and the interval
is known to hold from two seconds on."""

UNIT: Final = 8.0
"""A velocity so many times what the forces of the suspension make of it is in another unit [-]:
no load changes a mass or an inertia by as much."""

ALWAYS: Final = 0.9
"""A signal that repeats one value for so much of a ride says nothing of it [-]."""

FROZEN: Final = 1.0
"""A suspension that repeats one value for so long while another moves is stuck [s]."""


def ride_of(drive: Drive) -> Drive:
    """Return the drive with the signals of its ride alone."""
    return replace(drive, signals={n: s for n, s in drive.signals.items() if n in NEEDED})


def ride_samples(drive: Drive) -> RideSamples:
    """Bring the signals of a ride onto one clock.

    The clock is that of the suspension signal with the most samples; others are
    interpolated. Where a suspension signal is missing for longer than a force can be
    integrated over, the row is left out; a missing velocity is NaN.

    Raises
    ------
    DriveError
        The signals share no time, or there is one sample of them.
    """
    inputs = [drive.signals[name] for name in (*TRAVELS, *RATES)]
    clock = max(inputs, key=len).time
    if clock.size < 2:
        why = "; ".join(p.text for p in drive.problems) or "record it again"
        raise DriveError(f"{drive.name}: one row of the ride is all that is left: {why}")
    longest = longest_step(float(np.median(np.diff(clock))))
    columns: dict[str, Floats] = {}
    for name in NEEDED:
        s = drive.signals[name]
        if s.time is clock or np.array_equal(s.time, clock):
            columns[name] = s.values
            continue
        values = s.at(clock)
        # Between samples far apart the line between them says nothing.
        after = np.clip(np.searchsorted(s.time, clock), 1, max(s.time.size - 1, 1))
        apart = s.time[np.minimum(after, s.time.size - 1)] - s.time[after - 1]
        exact = s.age(clock) == 0.0
        columns[name] = np.where((apart <= longest) | exact, values, np.nan)
    inputs_there = np.isfinite(np.column_stack([columns[n] for n in (*TRAVELS, *RATES)]))
    keep = inputs_there.all(axis=1)
    if np.count_nonzero(keep) < 2:
        raise DriveError(
            f"{drive.name}: travel and rate of the four wheels were never recorded together; "
            "write them on one clock"
        )

    def block(names: tuple[str, ...]) -> Floats:
        return np.ascontiguousarray(np.column_stack([columns[n][keep] for n in names]))

    return RideSamples(
        time=np.ascontiguousarray(clock[keep]),
        travel=block(TRAVELS),
        rate=block(RATES),
        velocity=block(VELOCITIES),
    )


def check_signals(drive: Drive) -> Iterator[Problem]:
    """Find values no suspension has, and sensors that are stuck."""
    for name in NEEDED:
        s, q = drive.signals[name], QUANTITIES[name]
        outside = int(np.count_nonzero((s.values < q.low) | (s.values > q.high)))
        if outside > 0.01 * len(s):
            yield Problem.of(
                "ride.unit",
                name,
                serious=True,
                count=outside,
                samples=len(s),
                low=q.low,
                high=q.high,
                unit=q.suffix,
                value=float(s.values[np.argmax(np.abs(s.values))]),
            )
    kinds = {
        "suspension travel": TRAVELS, "suspension rate": RATES, "velocity of the body": VELOCITIES
    }  # fmt: skip
    dead = [kind for kind, names in kinds.items() if _still(drive, names)]
    for kind in dead if len(dead) < len(kinds) else ():
        yield Problem.of(
            "ride.all_frozen", kinds[kind][0], serious=True, kind=kind, names=", ".join(kinds[kind])
        )
    for names in kinds.values():
        frozen = {name: _longest_still(drive, name) for name in names}
        if min(frozen.values()) > FROZEN:
            # The vehicle stands, or all of a kind are dead, which is reported above.
            continue
        for name, length in frozen.items():
            share = length / max(drive.signals[name].duration, 1e-9)
            if length > FROZEN:
                yield Problem.of("ride.frozen", name, serious=share > 0.2, length=length)


def nothing_moves(drive: Drive) -> bool:
    """Whether every signal of the ride repeats one value for nearly all of it."""
    return _still(drive, NEEDED)


def _still(drive: Drive, names: tuple[str, ...]) -> bool:
    """Whether each of the signals repeats one value for nearly all of the ride."""
    return all(_longest_still(drive, n) > ALWAYS * drive.signals[n].duration for n in names)


def _longest_still(drive: Drive, name: str) -> float:
    """Longest time for which a signal repeats one value [s]."""
    s = drive.signals[name]
    changed = np.concatenate(([True], s.values[1:] != s.values[:-1]))
    begins = s.time[changed]
    ends = np.append(s.time[np.flatnonzero(changed)[1:] - 1], s.time[-1])
    return float(np.max(ends - begins, initial=0.0))


def check_response(found: Response) -> Iterator[Problem]:
    """Find wrong signs, swapped wheels and wrong units by what must go together."""
    for k, wheel in enumerate(WHEELS):
        slope, row = float(found.rate_slope[k]), found.rate_correlation[k]
        travel, rate = TRAVELS[k], RATES[k]
        best = int(np.argmax(np.nan_to_num(row)))
        if best != k and row[best] > 0.9 and row[k] < 0.8:
            yield Problem.of("ride.swapped", travel, serious=True, other=RATES[best], rate=rate)
        elif slope < 0.0 and row[k] < -0.5:
            yield Problem.of("ride.rate_sign", rate, serious=True, travel=travel)
        elif row[k] > 0.5 and not 0.5 < slope < 2.0:
            yield Problem.of("ride.rate_scale", rate, serious=True, travel=travel, slope=slope)
        elif row[k] > 0.5 and not (slope <= 1.1 and slope / row[k] ** 2 >= 0.9):
            # Noise of the rate alone lowers the slope, by the square of the correlation.
            yield Problem.of("ride.rate_wheel", rate, travel=travel, wheel=wheel, slope=slope)
    turned = _turned(found)
    if turned.all():
        yield Problem.of("ride.springs_sign", TRAVELS[0], serious=True)
        return
    says = ("upwards", "with the right side down", "with the nose up")
    for name, wrong, positive in zip(VELOCITIES, turned, says, strict=True):
        if wrong:
            yield Problem.of("ride.force_sign", name, serious=True, positive=positive)
    yield from _units(found)


def _units(found: Response) -> Iterator[Problem]:
    """Find velocities in another unit than their names say."""
    sure = found.correlation > 0.5
    with np.errstate(invalid="ignore"):
        far = sure & ((found.slope > UNIT) | (found.slope < 1.0 / UNIT))
    if far.all():
        yield Problem.of(
            "ride.springs_scale",
            TRAVELS[0],
            serious=True,
            heave=found.slope[0],
            roll=found.slope[1],
            pitch=found.slope[2],
        )
        return
    for k, name in enumerate(VELOCITIES):
        if not far[k]:
            continue
        slope, unit = float(found.slope[k]), QUANTITIES[name].suffix
        likely = seems = ""
        if unit == "radps" and slope > UNIT:
            likely, seems = "it seems to be in degrees per second; ", "degrees"
        elif unit == "radps":
            likely = "it seems to be in radians per second, and read as degrees; "
            seems = "radians"
        yield Problem.of(
            "ride.force_scale", name, serious=True, slope=slope, likely=likely, seems=seems,
            unit=unit,
        )  # fmt: skip


def _turned(found: Response) -> Bools:
    return np.asarray((found.slope < 0.0) & (found.correlation < -0.5))
