"""Which OBD-II parameters are asked for, when, and when none are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from weighbridge.io.obd import LENGTHS
from weighbridge.signals import scalar_to_si

_SPEED, _ENGINE_SPEED, _LOAD, _TORQUE = 0x0D, 0x0C, 0x04, 0x62
_THROTTLE, _PRESSURE, _AIR_FLOW = 0x11, 0x0B, 0x10

# Of each row the first that the vehicle has is asked for in turn.
_FAST: Final = (
    (_SPEED,),
    (_ENGINE_SPEED,),
    (_TORQUE, _LOAD, _AIR_FLOW),
    (_THROTTLE, _PRESSURE),
)

SELDOM: Final[dict[int, float]] = {
    _LOAD: 1.0, _AIR_FLOW: 1.0, _PRESSURE: 1.0, _THROTTLE: 1.0, 0x34: 1.0, 0x44: 1.0, 0x5E: 1.0,
    0xA4: 1.0, 0x42: 10.0, 0x05: 30.0, 0x0F: 30.0, 0x46: 30.0, 0x33: 30.0, 0x63: 60.0, 0x64: 60.0,
}  # fmt: skip
"""Parameters asked for seldom, and how far apart [s]."""

PROBE: Final = 30.0
"""A vehicle at rest is asked one request in so long at most [s]."""

NO_ANSWER: Final = 5.0
"""A vehicle that answers nothing for so long has its ignition off [s],"""

_UNANSWERED: Final = 3
"""and so many requests in a row: a host that stood still itself has asked fewer."""

STANDING: Final = 180.0
"""A vehicle that stands with its engine off for so long may have its ignition off [s]."""

LOW_VOLTAGE: Final = 11.8
"""A battery of 12 V below this is not to be drained further [V]."""

LOW_BATTERY: Final = f"the battery has less than {LOW_VOLTAGE:g} V"

CHARGING: Final = 13.2
"""A battery of 12 V above this is charged: the vehicle is on [V]."""

# An answer that fits into one CAN frame needs no flow control: 7 bytes with the service.
_ONE_FRAME: Final = 7
# A request has 6 parameters at most (ISO 15031-5).
_MOST_TOGETHER: Final = 6
# Several at once that were never answered in whole, and so often in part, are asked one by one.
_MOST_PARTIAL: Final = 3
# Never answered and so often left unanswered in a row, a parameter is not asked for again.
_MOST_MISSES: Final = 5
# An engine turns faster than this when it runs, a vehicle moves faster [rad/s, m/s].
_RUNS: Final = scalar_to_si(200.0, "rpm")
_MOVES: Final = 0.5


class Request(NamedTuple):
    """Parameters asked of one control unit at once."""

    unit: int
    parameters: tuple[int, ...]


def packed(parameters: Iterable[int], *, together: bool) -> list[tuple[int, ...]]:
    """Put parameters together whose answer fits into one frame; each alone if not ``together``."""
    groups: list[list[int]] = []
    for number in parameters:
        group = next((g for g in groups if together and _fits([*g, number])), None)
        if group is None:
            groups.append([number])
        else:
            group.append(number)
    return [tuple(g) for g in groups]


def _fits(group: Sequence[int]) -> bool:
    return (
        len(group) <= _MOST_TOGETHER
        and 1 + sum(1 + LENGTHS[number] for number in group) <= _ONE_FRAME
    )


def supported_of(first: int, raw: bytes) -> set[int]:
    """Parameters that an answer to PID 00, 20, 40 … lists (SAE J1979)."""
    bits = int.from_bytes(raw)
    return {first + 1 + k for k in range(32) if bits >> (31 - k) & 1}


class Schedule:
    """Requests in the order they are sent.

    Parameters
    ----------
    supported : parameters that each control unit has; of two that have one the lower is asked
    together : whether several may be asked at once, as on CAN
    """

    def __init__(self, supported: Mapping[int, set[int]], *, together: bool) -> None:
        self._owner = {n: unit for unit in sorted(supported, reverse=True) for n in supported[unit]}
        self._together = together
        self._misses: dict[int, int] = {}
        self._partial: dict[Request, int] = {}
        self._there: set[int] = set()
        self._whole: set[Request] = set()
        self._turn = 0
        self._seldom_last = False
        self._arrange()

    @property
    def fast(self) -> list[Request]:
        """Requests that are sent in turn."""
        return self._fast

    @property
    def empty(self) -> bool:
        """Whether the vehicle has nothing that is asked for."""
        return not self._fast and not self._due

    def next(self, time: float) -> Request | None:
        """Return what to ask now; None where nothing is due.

        Parameters
        ----------
        time : by any clock that only rises [s]
        """
        overdue = [r for r, due in self._due.items() if due <= time]
        if overdue and not (self._seldom_last and self._fast):
            request = min(overdue, key=lambda r: self._due[r])
            self._due[request] = time + min(SELDOM[n] for n in request.parameters)
            self._seldom_last = True
            return request
        self._seldom_last = False
        if not self._fast:
            return None
        self._turn = (self._turn + 1) % len(self._fast)
        return self._fast[self._turn]

    def note(self, request: Request, answered: Iterable[int]) -> None:
        """Learn from an answer: what is never answered is not asked for again.

        What was answered before, and is not now, was lost on the way.
        """
        there = set(answered)
        missing = [n for n in request.parameters if n not in there]
        self._there |= there
        for number in there:
            self._misses[number] = 0
        if not missing:
            self._whole.add(request)
        if request in self._whole:
            return
        # Some control units answer the first of several, or nothing.
        if len(request.parameters) > 1:
            self._partial[request] = self._partial.get(request, 0) + 1
            if self._partial[request] >= _MOST_PARTIAL:
                self._together = False
                self._arrange()
            return
        # While nothing is answered at all, it is the vehicle that is silent.
        for number in missing:
            self._misses[number] = self._misses.get(number, 0) + 1
            often = number not in self._there and self._misses[number] >= _MOST_MISSES
            if often and any(m == 0 for m in self._misses.values()):
                self._owner.pop(number, None)
                self._arrange()

    def _arrange(self) -> None:
        fast = [next((n for n in row if n in self._owner), None) for row in _FAST]
        chosen = [n for n in fast if n is not None]
        seldom = [n for n in SELDOM if n in self._owner and n not in chosen]
        self._fast = self._requests(chosen)
        spells = sorted(set(SELDOM.values()))
        self._due = {
            request: 0.0
            for spell in spells
            for request in self._requests([n for n in seldom if SELDOM[n] == spell])
        }
        self._turn = 0

    def _requests(self, parameters: Sequence[int]) -> list[Request]:
        units = dict.fromkeys(self._owner[n] for n in parameters)
        return [
            Request(unit, group)
            for unit in units
            for group in packed(
                [n for n in parameters if self._owner[n] == unit], together=self._together
            )
        ]


class Vigil:
    """Reports from the answers whether the vehicle is on.

    Parameters
    ----------
    time : when it begins, by a clock that only rises [s]

    Attributes
    ----------
    silent : whether it answers nothing
    low : whether its battery is low
    """

    def __init__(self, time: float) -> None:
        self.silent = False
        self.low = False
        self._answered = time
        self._unanswered = 0
        self._alive = time

    def note(self, time: float, values: Mapping[str, float], *, answered: bool) -> None:
        """Take what one answer said [SI]; nothing where none came."""
        self._unanswered = 0 if answered else self._unanswered + 1
        if answered:
            self._answered = time
        if values.get("engine_speed", 0.0) > _RUNS or values.get("vehicle_speed", 0.0) > _MOVES:
            self._alive = time
        if "module_voltage" in values:
            self.voltage(time, values["module_voltage"])

    def voltage(self, time: float, volts: float) -> None:
        """Take the voltage of the battery [V]."""
        self.low = volts < LOW_VOLTAGE
        if volts > CHARGING:
            self._alive = time

    def rested(self, time: float) -> None:
        """Begin to count the vehicle's silence anew: it was not asked meanwhile."""
        self._answered = time
        self._unanswered = 0

    def why_asleep(self, time: float) -> str:
        """Why the vehicle is not to be asked now; empty where it may be."""
        self.silent = time - self._answered > NO_ANSWER and self._unanswered >= _UNANSWERED
        if self.low:
            return LOW_BATTERY
        if self.silent:
            return "the vehicle does not answer"
        if time - self._alive > STANDING:
            return "the vehicle stands with its engine off"
        return ""
