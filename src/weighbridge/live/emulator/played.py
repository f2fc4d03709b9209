"""A drive that is played: its instant, and what its control unit answers then."""

from __future__ import annotations

from threading import Event, Lock
from time import monotonic
from typing import Final

import numpy as np

from weighbridge.errors import ConfigError, DriveError
from weighbridge.io.obd import PIDS, bytes_of
from weighbridge.signals import Drive

# Held between two samples; anything else goes from one to the next in a straight line.
_STEPS: Final = frozenset(("gear", "gear_ratio"))
_LIST: Final = 0x20
_NEEDED: Final = (
    ("vehicle_speed",),
    ("engine_speed",),
    ("engine_torque_fraction", "engine_load", "mass_air_flow"),
)


class Played:
    """A drive on a clock of its own, which begins when the vehicle is first asked.

    Parameters
    ----------
    drive
    rate : seconds of the drive per second

    Attributes
    ----------
    begun : set once the vehicle was asked
    start, end : of the drive, on its clock [s]
    parameters : of OBD-II that the drive has (SAE J1979, service 01)

    Raises
    ------
    ConfigError
        The rate is not above 0 and finite.
    DriveError
        The drive lacks what a weighing by OBD-II needs.
    """

    def __init__(self, drive: Drive, rate: float = 1.0) -> None:
        if not 0.0 < rate < float("inf"):
            raise ConfigError(f"--rate {rate:g}: give 1 for as recorded, or 5 for fivefold")
        self.drive = drive
        self.start, self.end = drive.start, drive.end
        self.begun = Event()
        self._rate = rate
        self._lock = Lock()
        self._since = 0.0
        self._names = {
            number: [p.name for p in PIDS if p.number == number and drive.has(p.name)]
            for number in sorted({p.number for p in PIDS})
        }
        self.parameters = tuple(n for n, names in self._names.items() if names)
        lacking = [names for names in _NEEDED if not any(drive.has(name) for name in names)]
        if lacking:
            missing = " and no ".join(", ".join(names) for names in lacking)
            raise DriveError(
                f"{drive.name} has no {missing}, which an OBD-II adapter sends; "
                "give a drive that was recorded by OBD-II, or a simulated car"
            )

    def begin(self) -> None:
        """Let the drive begin now, unless it has."""
        with self._lock:
            if not self.begun.is_set():
                self._since = monotonic()
                self.begun.set()

    @property
    def time(self) -> float:
        """Instant of the drive, on its clock [s]; its start before it has begun."""
        if not self.begun.is_set():
            return self.start
        return self.start + self._rate * (monotonic() - self._since)

    @property
    def ended(self) -> bool:
        """Whether it is over."""
        return self.time > self.end

    def answer(self, number: int) -> bytes | None:
        """Bytes of a parameter at this moment; None for one that the vehicle has not."""
        if number % _LIST == 0:
            return self._list(number)
        names = self._names.get(number)
        return bytes_of(number, {n: self._value(n) for n in names}) if names else None

    def _value(self, name: str) -> float:
        signal = self.drive.signals[name]
        time = np.array([min(max(self.time, signal.time[0]), signal.time[-1])])
        return float((signal.held if name in _STEPS else signal.at)(time)[0])

    def _list(self, first: int) -> bytes | None:
        """Which of the next 32 parameters there are; the last bit says whether any are later."""
        if first and not any(number > first for number in self.parameters):
            return None
        bits = sum(
            1 << (_LIST - (number - first))
            for number in self.parameters
            if first < number <= first + _LIST
        )
        return (bits | any(number > first + _LIST for number in self.parameters)).to_bytes(4)
