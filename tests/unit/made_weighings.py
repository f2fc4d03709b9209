"""Weighings made up: a drive of a van that is learnt, weighed, and once contradicts itself."""

import math
from collections.abc import Iterator
from dataclasses import replace

from tests.noted import noted

import weighbridge as wb
from weighbridge import LiveStatus, LiveWeighing

EMPTY = wb.LiveScale(wb.Vehicle()).weighing()
"""Before the first sample."""

NAMES = (
    *(f"accel_{a}" for a in "xyz"), *(f"gyro_{a}" for a in "xyz"), "vehicle_speed",
    "engine_speed", "engine_torque_fraction", "latitude", "longitude", "altitude", "gnss_speed",
)  # fmt: skip


def health(*, silent: tuple[str, ...] = ()) -> tuple[object, ...]:
    return tuple(
        replace(
            EMPTY.signals[0],
            name=name,
            rate=0.0 if name in silent else 200.0 if "l_" in name or "o_" in name else 5.0,
            age=math.inf if name in silent else 0.1,
            needed=name in ("vehicle_speed", "engine_torque_fraction"),
        )
        for name in NAMES
    )


def rests() -> tuple[object, ...]:
    """Signals of a vehicle that is parked."""
    return tuple(replace(s, rests=True, age=999.0) for s in health())


def weighing(time: float = 300.0, **changed: object) -> LiveWeighing:
    """One weighing of a van of 2100 kg, 1800 kg empty, 2400 kg permitted."""
    values: dict[str, object] = {
        "vehicle": "Delivery van",
        "time": time,
        "age": 1.0,
        "newest": time + 1.0,
        "status": LiveStatus.WEIGHED,
        "refusal": None,
        "mass": 2100.0,
        "std": 25.0,
        "tare": 1800.0,
        "gross": 2400.0,
        "tared": None,
        "driven": time,
        "progress": 0.85,
        "progress_to_5": 1.0,
        "minutes_to_5": 0.0,
        "minutes_to_2": 3.0,
        "advice": "Speed up firmly from a stop, in second or third gear.",
        "signals": health(),
        "problems": (),
    }
    return replace(EMPTY, **{**values, **changed})


def drive(seconds: int = 600, begin: float = 0.0) -> Iterator[LiveWeighing]:
    """One weighing a second: nothing for a minute, then a mass that settles."""
    for k in range(seconds):
        if k < 60:
            yield weighing(
                begin + k,
                status=LiveStatus.LEARNING,
                refusal=noted("The vehicle has hardly moved."),
                mass=math.nan,
                std=math.nan,
                progress=0.0,
                progress_to_5=math.nan if k < 30 else 0.1,
                minutes_to_5=math.nan,
                minutes_to_2=math.nan,
            )
            continue
        std = 400.0 / math.sqrt(k - 50.0)
        mass = 2100.0 + 0.8 * std * math.sin(0.02 * k)
        learnt = 1.96 * std > 0.05 * mass
        yield weighing(
            begin + k,
            status=LiveStatus.LEARNING if learnt else LiveStatus.WEIGHED,
            refusal=noted("The interval is wider than 5 %.") if learnt else None,
            mass=mass,
            std=std,
            progress=min(1.0, (0.02 * mass / (1.96 * std)) ** 2),
            progress_to_5=min(1.0, (0.05 * mass / (1.96 * std)) ** 2),
            minutes_to_5=5.0 if learnt else 0.0,
            minutes_to_2=30.0,
        )
