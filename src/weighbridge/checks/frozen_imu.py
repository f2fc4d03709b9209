"""Did an axis of the inertial sensor stop to read on the way, or is it at its limit?"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from weighbridge.checks.false_samples import BESIDE, piled
from weighbridge.messages import phrase
from weighbridge.navigation.frozen import frozen_stretches
from weighbridge.signals import Drive, Problem, Signal
from weighbridge.signals.catalogue import IMU_SIGNALS
from weighbridge.signals.instants import instant
from weighbridge.vehicle import Vehicle

_REPORTED: Final = 5.0
"""Frozen for less in all is left out without a note [s]."""

_LEAST: Final = 120.0
"""What is left must be as long to show how the sensor sits and what moved [s]."""


def check_frozen(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Name the frozen stretches of the inertial axes, which navigation leaves out.

    Serious only where too little is left.
    """
    speed = drive.speed
    alike: dict[bytes, list[str]] = {}
    for name in IMU_SIGNALS:
        s = drive.get(name)
        if s is None or len(s) < 50 or s.duration < 20.0 or not np.any(s.values != s.values[0]):
            continue
        stretches = frozen_stretches(s, speed)
        if float(np.sum(stretches[:, 1] - stretches[:, 0])) >= _REPORTED:
            alike.setdefault(np.round(stretches).tobytes(), []).append(name)
    for names in alike.values():
        yield _reported(names, drive.signals[names[0]], speed)


def _reported(names: list[str], axis: Signal, speed: Signal | None) -> Problem:
    """Report axes that froze together, such as ``axis``, or a gyro that is at its limit again."""
    stretches = frozen_stretches(axis, speed)
    lengths = stretches[:, 1] - stretches[:, 0]
    total = float(lengths.sum())
    k = int(np.argmax(lengths))
    left = axis.duration - total
    too_little = left < min(_LEAST, 0.5 * axis.duration)
    repeated = np.abs(axis.values[axis.time.searchsorted(stretches[:, 0])])
    limit = float(np.abs(axis.values).max())
    if axis.name in IMU_SIGNALS[3:] and (repeated == limit).all():
        return Problem.of(
            "imu.gyro_clipped",
            axis.name,
            start=stretches[0, 0],
            end=stretches[-1, 1],
            serious=too_little,
            limit=limit,
            count=lengths.size,
            total=total,
        )
    whole = set(names) == set(IMU_SIGNALS)
    return Problem.of(
        "frozen.imu_all" if too_little else "frozen.imu",
        names[0],
        start=stretches[0, 0],
        end=stretches[-1, 1],
        serious=too_little,
        who=phrase("frozen_sensor")
        if whole
        else phrase(
            "frozen_axes",
            axes=", ".join(names),
            verb="repeats" if len(names) == 1 else "repeat",
        ),
        longest=lengths[k],
        at=instant(stretches[k, 0]),
        more=phrase("frozen_more", count=lengths.size, total=total) if lengths.size > 1 else "",
        left=left,
    )


def check_limit(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find an accelerometer whose range is too small for the drive: samples pile up at an end.

    Of 1050 axes of undamaged and recorded drives none is found. Cut at 1 m/s^2, 69 of 72 are, where
    3 to 25 % of the samples are lost and masses come out up to 24 % too heavy. Spikes of one value
    have no others beside them.
    """
    for name in IMU_SIGNALS[:3]:
        s = drive.get(name)
        if s is None:
            continue
        for lowest in (True, False):
            marked = piled(s, lowest=lowest)
            if not marked.any() or marked.all():
                continue
            gap = np.abs(s.values[~marked] - s.values[marked][0])
            if gap.min() < BESIDE * gap.max():
                yield Problem.of(
                    "imu.clipped",
                    name,
                    serious=True,
                    limit=float(s.values[marked][0]),
                    share=100.0 * float(np.mean(marked)),
                )
