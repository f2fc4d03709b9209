"""The timetable of a night: trips, stops and faults in pairs, all drawn from one seed.

It knows nothing of the program: what a fault does to a device is in ``night_world.py``.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from itertools import combinations

KINDS = ("clock", "adapter", "can", "gnss", "imu", "broker", "disk", "power")
FORMS = {
    "clock": ("host set back", "host set ahead", "sensor begins anew", "sensor jumps ahead",
              "receiver jumps"),
    "adapter": ("unplugged", "mute", "garbage", "begins anew", "slow"),
    "can": ("silent", "damaged frames", "some answers", "late answers"),
    "gnss": ("no fix", "held", "elsewhere", "damaged", "gone"),
    "imu": ("silent", "damaged lines", "out of order", "twice", "spikes"),
    "broker": ("refuses", "lost", "confirms nothing", "slow"),
    "disk": ("full", "fails to flush", "slow"),
    "power": ("cut", "kill"),
}  # fmt: skip
"""What can happen to each; a kill loses nothing that was written, a cut what was not flushed."""

LENGTHS = (2.0, 180.0)
"""A fault lasts so long, drawn evenly by its logarithm [s]."""

TOGETHER = 25.0
"""The second of a pair begins so much later at most [s]."""

APART = 960.0
"""So much is driven between the beginnings of two pairs [s]."""

LAST = 900.0
"""So much driving follows the last pair [s]."""


@dataclass(frozen=True, slots=True)
class Fault:
    """What fails, from when to when on the virtual clock [s], and a number for its size [-]."""

    kind: str
    form: str
    start: float
    end: float
    size: float

    def __str__(self) -> str:
        return f"{self.kind} {self.form} at {self.start:.0f} s for {self.end - self.start:.0f} s"


@dataclass(frozen=True, slots=True)
class Trip:
    """A drive that is played, and the stop before it.

    Attributes
    ----------
    base : which of the drives
    start, end : when its vehicle is switched on and off, on the virtual clock [s]
    host : before the trip the host "stays" on, is "ended" in order, or loses its power ("cut")
    """

    base: int
    start: float
    end: float
    host: str


@dataclass(frozen=True, slots=True)
class Night:
    """Trips and faults in the order of time."""

    seed: int
    trips: tuple[Trip, ...]
    faults: tuple[Fault, ...]

    @property
    def driven(self) -> float:
        """Time of all trips [s]."""
        return sum(t.end - t.start for t in self.trips)


def drawn(
    seed: int, hours: float, lengths: list[float], begin: float, apart: float = APART
) -> Night:
    """Draw a night.

    Parameters
    ----------
    seed
    hours : of driving
    lengths : of the drives that are played [s]
    begin : when it begins, on the virtual clock [s]
    apart : driving between two pairs of faults [s]
    """
    chance = random.Random(seed)
    trips: list[Trip] = []
    at, left = begin + 20.0, 3600.0 * hours
    order: list[int] = []
    while left > 0.0:
        order = order or chance.sample(range(len(lengths)), len(lengths))
        base = order.pop()
        host = "stays"
        if trips:
            host = chance.choices(("stays", "ended", "cut"), (0.5, 0.3, 0.2))[0]
            at += chance.uniform(60.0, 300.0) if host == "stays" else chance.uniform(120.0, 2400.0)
        length = lengths[base]
        trips.append(Trip(base, at, at + length, host))
        at += length
        left -= length
    faults = _pairs(chance, trips, apart)
    return Night(seed, tuple(trips), tuple(faults))


def _pairs(chance: random.Random, trips: list[Trip], apart: float) -> list[Fault]:
    """Draw pairs of faults, each pair of kinds once before any comes again."""
    total = sum(t.end - t.start for t in trips)
    span = max(total - LAST, 0.6 * total)
    count = max(int(span / apart), 1)
    room = span / count
    pairs: list[tuple[str, str]] = []
    faults = []
    for k in range(count):
        pairs = pairs or chance.sample(list(combinations(KINDS, 2)), 28)
        first, second = chance.sample(pairs.pop(), 2)
        at = _placed(trips, room * (k + chance.uniform(0.1, 0.4)))
        for kind, start in ((first, at), (second, at + chance.uniform(0.0, TOGETHER))):
            length = LENGTHS[0] * (LENGTHS[1] / LENGTHS[0]) ** chance.random()
            form = chance.choice(FORMS[kind])
            faults.append(Fault(kind, form, start, start + length, chance.random()))
    return sorted(faults, key=lambda f: f.start)


def _placed(trips: list[Trip], driven: float) -> float:
    """Return when so much was driven, on the virtual clock [s]."""
    for trip in trips:
        length = trip.end - trip.start
        if driven < length:
            return trip.start + driven
        driven -= length
    return trips[-1].end
