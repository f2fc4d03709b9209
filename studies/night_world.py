"""The world around the program in a night: vehicle, adapter, receiver, sensor, broker and disk.

Each device fails as the timetable of ``night_faults.py`` says. Its laws are written from the data
sheets, apart from the program's own emulator.
"""

from __future__ import annotations

import errno
import hashlib
import json
import math
import os
import random
import resource
import shutil
import stat
import struct
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import reduce
from operator import xor
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from night_clock import Clock
from night_faults import Fault, Night

from weighbridge.errors import SourceError
from weighbridge.simulation import (
    MIDSIZE,
    Effects,
    Scenario,
    Sensors,
    SimulatedDrive,
    short_route,
    simulate_car,
)

EPOCH = 1.79e9
"""True date at the clock's nought [s since 1970]."""

IMU_RATE = 25.0
"""Samples of the inertial sensor [Hz], sent in datagrams of `BURST` [s]."""

BIAS = {
    "accel_x": 0.04, "accel_y": -0.06, "accel_z": 0.05,
    "gyro_x": 5e-3, "gyro_y": -4e-3, "gyro_z": 6e-3,
}  # fmt: skip
"""Of the sensor, the same in all drives [m/s^2, rad/s]."""

BURST = 1.0
BUS_RATE = 10.0
"""The vehicle has a new value so often [Hz]; the adapter is asked less often."""

ANSWER = 0.25
"""An adapter answers after so long [s]: a clone on Bluetooth."""

LOADS = (40.0, 320.0, 180.0, 460.0)
SEED = 73_100
"""Payloads of the drives that are played [kg], and the seed of the first."""


@dataclass(frozen=True)
class Played:
    """A drive as the devices send it.

    Attributes
    ----------
    length : [s]
    moves : instant from which the vehicle moves [s]
    truth : instants [s] and mass [kg]
    imu : ends of the sensor's lines
    bus : bytes of each parameter (SAE J1979), at `BUS_RATE`
    fixes : latitude [deg], longitude [deg], height [m], speed [kn] and course [deg], each second
    """

    length: float
    moves: float
    truth: tuple[Any, Any]
    imu: list[str]
    bus: dict[int, list[bytes]]
    fixes: list[tuple[float, ...]]

    def mass(self, at: float) -> float:
        """Return the mass after so long [kg, s]."""
        return float(np.interp(at, *self.truth))

    def fix(self, at: float) -> tuple[float, ...]:
        """Return the fix after so long, between those of the drive [s]."""
        second = min(int(at), len(self.fixes) - 2)
        part = min(at - second, 1.0)
        before, after = self.fixes[second], self.fixes[second + 1]
        turn = (after[4] - before[4] + 180.0) % 360.0 - 180.0
        straight = (a + part * (b - a) for a, b in zip(before[:4], after[:4], strict=True))
        return (*straight, before[4] + part * turn)


def simulated(payload: float, seed: int) -> SimulatedDrive:
    """Simulate a drive through a town, which the devices play."""
    from dataclasses import replace

    scenario = Scenario(
        name=f"night-{seed}", car=MIDSIZE, route=short_route(), payload=payload,
        sensors=Sensors(imu_rate=IMU_RATE), seed=seed,
        effects=replace(Effects(), imu_bias=0.0),
    )  # fmt: skip
    return simulate_car(replace(scenario, polling=replace(scenario.polling, rate=BUS_RATE)))


def played(made: SimulatedDrive) -> Played:
    """Turn a drive into what devices send."""
    drive = made.drive
    length = math.floor(drive.duration)
    at = np.arange(0.0, length, 1.0 / IMU_RATE)
    axes = [np.interp(at, (s := drive.signals[name]).time, s.values) + BIAS[name] for name in BIAS]
    imu = [
        f'"accel":[{a:.4f},{b:.4f},{c:.4f}],"gyro":[{d:.5f},{e:.5f},{f:.5f}]}}\n'
        for a, b, c, d, e, f in zip(*axes, strict=True)
    ]
    grid = np.arange(0.0, length, 1.0 / BUS_RATE)

    def held(name: str, scale: float, size: int, offset: float = 0.0) -> list[bytes]:
        s = drive.signals[name]
        index = np.clip(s.time.searchsorted(grid, side="right") - 1, 0, None)
        raw = np.clip(np.round(scale * (s.values[index] + offset)), 0, 256**size - 1)
        return [int(v).to_bytes(size) for v in raw]

    bus = {
        0x04: held("engine_load", 255.0, 1),
        0x0C: held("engine_speed", 4.0 * 30.0 / math.pi, 2),
        0x0D: held("vehicle_speed", 3.6, 1),
        0x11: held("throttle", 255.0, 1),
        0x33: held("barometric_pressure", 1e-3, 1),
        0x46: held("ambient_temperature", 1.0, 1, 40.0 - 273.15),
    }
    seconds = np.arange(0.0, length)
    columns = []
    for name, scale in (("latitude", 180.0 / math.pi), ("longitude", 180.0 / math.pi),
                        ("altitude", 1.0), ("gnss_speed", 3600.0 / 1852.0),
                        ("gnss_course", 180.0 / math.pi)):  # fmt: skip
        s = drive.signals[name]
        index = np.clip(s.time.searchsorted(seconds), 0, len(s) - 1)
        columns.append((scale * s.values[index]).tolist())
    speed = drive.speed
    moves = float(speed.time[np.argmax(speed.values > 0.5)])
    return Played(
        float(length), moves, (made.truth.time, made.truth.mass), imu, bus,
        list(zip(*columns, strict=True)),
    )  # fmt: skip


class World:
    """All devices, on a clock, as a timetable says.

    Parameters
    ----------
    clock
    night : trips and faults
    bases : drives that are played
    """

    def __init__(self, clock: Clock, night: Night, bases: list[Played]) -> None:
        self.clock, self.night, self.bases = clock, night, bases
        self._starts = [t.start for t in night.trips]
        self._faults: dict[str, list[Fault]] = {}
        for fault in night.faults:
            self._faults.setdefault(fault.kind, []).append(fault)
        self._begins = self._places()
        self.set_by = 0.0

    def fails(self, kind: str, form: str) -> Fault | None:
        """Return the fault of a form that goes on now."""
        now = self.clock.now
        for fault in self._faults.get(kind, ()):
            if fault.form == form and fault.start <= now < fault.end:
                return fault
        return None

    def begun(self, kind: str, form: str, at: float) -> list[Fault]:
        """Return faults of a form that have begun until an instant [s]."""
        return [f for f in self._faults.get(kind, ()) if f.form == form and f.start <= at]

    def chance(self, *what: object) -> random.Random:
        """Return a source of chance of its own for each event."""
        return random.Random(f"{self.night.seed} {what}")

    def trip(self, at: float) -> int:
        """Return the trip that has begun last; -1 before the first."""
        return bisect_right(self._starts, at) - 1

    def played(self, at: float) -> tuple[Played, float, bool]:
        """Return what is played, how far it has come [s], and whether the ignition is on."""
        k = max(self.trip(at), 0)
        trip, base = self.night.trips[k], self.bases[self.night.trips[k].base]
        since = at - trip.start
        on = -10.0 <= since < base.length
        if not on and k + 1 < len(self._starts) and at > self._starts[k + 1] - 10.0:
            return self.bases[self.night.trips[k + 1].base], 0.0, True
        return base, min(max(since, 0.0), base.length - 0.5), on

    def masses(self, at: float) -> tuple[float, ...]:
        """Return the masses that can be right at an instant [kg]: two where it was just loaded."""
        k = self.trip(at)
        trips = self.night.trips
        if k < 0:
            return (self.bases[trips[0].base].mass(0.0),)
        base = self.bases[trips[k].base]
        found = (base.mass(at - trips[k].start),)
        if k and self.moved(at) < 0.0:
            before = self.bases[trips[k - 1].base]
            found = (*found, before.mass(before.length))
        return found

    def moved(self, at: float) -> float:
        """Return how long ago the vehicle of the last trip has begun to move [s]."""
        trip = self.night.trips[max(self.trip(at), 0)]
        return at - trip.start - self.bases[trip.base].moves

    def driven(self, start: float, end: float) -> float:
        """Return the time of trips between two instants [s]."""
        return sum(max(min(end, t.end) - max(start, t.start), 0.0) for t in self.night.trips)

    def date(self) -> float:
        """Return the date that the host believes [s since 1970]."""
        now = self.clock.now
        steps = [
            -1.0 * (3.0 + 9000.0 * f.size**4) for f in self.begun("clock", "host set back", now)
        ]
        steps += [2.0 + 9000.0 * f.size**4 for f in self.begun("clock", "host set ahead", now)]
        return EPOCH + now + sum(steps) + self.set_by

    def _places(self) -> list[tuple[float, float, float, float]]:
        """Return where each trip begins: where the last one ended, as its vehicle stood there.

        Latitude [deg], longitude [deg], height [m], and by how much all courses are turned [deg].
        """
        places: list[tuple[float, float, float, float]] = []
        end = (*self.bases[self.night.trips[0].base].fixes[0][:3], 0.0, 0.0)
        for trip in self.night.trips:
            fixes = self.bases[trip.base].fixes
            places.append((*end[:3], end[4] - fixes[0][4] if places else 0.0))
            end = _placed(fixes[-1], fixes[0], places[-1])
        return places

    # The inertial sensor.

    def datagram(self, number: int) -> bytes:
        """Return what the sensor sends in a burst; empty where it sends nothing."""
        begin = number * BURST
        if self.fails("imu", "silent") is not None:
            return b""
        anew = self.begun("clock", "sensor begins anew", begin)
        if anew and begin < anew[-1].start + 0.2 * (anew[-1].end - anew[-1].start):
            return b""
        zero = anew[-1].start if anew else 0.0
        ahead = sum(
            1.0 + 5000.0 * f.size**3 for f in self.begun("clock", "sensor jumps ahead", begin)
            if f.start >= zero
        )  # fmt: skip
        base, since, _ = self.played(begin)
        first = round(since * IMU_RATE)
        count = round(BURST * IMU_RATE)
        lines = []
        trip = self.night.trips[max(self.trip(begin), 0)]
        drives = trip.start <= begin < trip.end
        for k in range(count):
            stamp = begin - zero + ahead + k / IMU_RATE
            row = first + k if drives else k % round(IMU_RATE)
            lines.append(f'{{"t":{stamp:.3f},{base.imu[min(row, len(base.imu) - 1)]}')
        if self.fails("imu", "damaged lines") is not None:
            chance = self.chance("line", number)
            lines = [x[: chance.randrange(len(x))] + "\n" if chance.random() < 0.4 else x
                     for x in lines]  # fmt: skip
        if self.fails("imu", "spikes") is not None:
            chance = self.chance("spike", number)
            lines = [x.replace('"accel":[', '"accel":[79.2,79.2,-79.2],"x":[')
                     if chance.random() < 0.02 else x for x in lines]  # fmt: skip
        if self.fails("imu", "out of order") is not None:
            self.chance("order", number).shuffle(lines)
        if self.fails("imu", "twice") is not None:
            lines = [*lines, *lines]
        return "".join(lines).encode()

    @contextmanager
    def datagrams(self) -> Iterator[Callable[[], bytes]]:
        """Open the port that the sensor sends to."""
        number = math.ceil(self.clock.now / BURST)

        def read() -> bytes:
            nonlocal number
            # A burst is sent when it is whole, and is on its way for 10 ms.
            due = (number + 1) * BURST + 0.01
            if due > self.clock.now + 0.1:
                self.clock.wait(0.1)
                return b""
            self.clock.wait(due - self.clock.now)
            data = self.datagram(number)
            number += 1
            return data

        yield read

    # The receiver.

    def fix(self, number: int) -> bytes:
        """Return the sentences of one second."""
        at = float(number)
        if (fault := self.fails("gnss", "held")) is not None:
            at = float(math.floor(fault.start))
        base, since, _ = self.played(at)
        trip = max(self.trip(at), 0)
        row = base.fix(since)
        drives = self.night.trips[trip].start <= at < self.night.trips[trip].end
        latitude, longitude, height, speed, course = _placed(row, base.fixes[0], self._begins[trip])
        if not drives:
            speed = 0.0
        if self.fails("gnss", "elsewhere") is not None:
            latitude += 0.05
        date = EPOCH + number
        if (fault := self.fails("clock", "receiver jumps")) is not None:
            date += 7200.0 * (fault.size - 0.5)
        seconds = date % 86_400.0
        clock = f"{seconds // 3600:02.0f}{seconds % 3600 // 60:02.0f}{seconds % 60:06.3f}"
        sides = "NS"[latitude < 0], "EW"[longitude < 0]
        place = f"{_angle(latitude, 2)},{sides[0]},{_angle(longitude, 3)},{sides[1]}"
        valid = self.fails("gnss", "no fix") is None
        marks, motion = ("VA"[valid], "NA"[valid]), f"{speed:.3f},{course % 360.0:.2f}"
        texts = [
            f"GPRMC,{clock},{marks[0]},{place},{motion},151126,,,{marks[1]}",
            f"GPGGA,{clock},{place},{int(valid)},09,1.0,{height:.2f},M,0.0,M,,",
        ]
        data = b"".join(f"${t}*{reduce(xor, t.encode()):02X}\r\n".encode() for t in texts)
        if self.fails("gnss", "damaged") is not None:
            chance, spoilt = self.chance("fix", number), bytearray(data)
            for _ in range(chance.randrange(4)):
                spoilt[chance.randrange(len(spoilt))] = chance.randrange(256)
            data = bytes(spoilt)
        return data

    def receiver(self) -> Receiver:
        """Open the line to the receiver."""
        return Receiver(self)

    def adapter(self) -> Adapter:
        """Open the line to the adapter."""
        return Adapter(self)


def _placed(
    fix: tuple[float, ...], first: tuple[float, ...], place: tuple[float, float, float, float]
) -> tuple[float, ...]:
    """Turn and move a fix of a drive, whose first one is put at a place; see `World._places`."""
    turn, wide = math.radians(place[3]), math.cos(math.radians(first[0]))
    north, east = fix[0] - first[0], wide * (fix[1] - first[1])
    return (
        place[0] + math.cos(turn) * north - math.sin(turn) * east,
        place[1] + (math.sin(turn) * north + math.cos(turn) * east) / wide,
        place[2] + fix[2] - first[2],
        fix[3],
        fix[4] + place[3],
    )


def _angle(value: float, digits: int) -> str:
    degrees, minutes = divmod(abs(value) * 60.0, 60.0)
    return f"{int(degrees):0{digits}d}{minutes:09.6f}"


class Receiver:
    """The line to a receiver; see `weighbridge.live.sources.links.Link`."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._look()
        self._number = math.ceil(world.clock.now)

    def read(self, timeout: float) -> bytes:
        self._look()
        due = self._number + 0.15
        now = self._world.clock.now
        if due > now + timeout:
            self._world.clock.wait(timeout)
            return b""
        self._world.clock.wait(due - now)
        self._number += 1
        return self._world.fix(self._number - 1)

    def close(self) -> None:
        pass

    def _look(self) -> None:
        if self._world.fails("gnss", "gone") is not None:
            raise SourceError("serial port /dev/ttyACM0 is gone (no such device)")


class Adapter:
    """The line to an ELM327 (its data sheet: echo, headers, spaces; words for trouble)."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._answers: list[tuple[float, bytes]] = []
        self._said = b""
        self._opened = world.clock.now
        self._before = b"NO DATA\r\r>"
        self._reset()
        self._look()

    def read(self, timeout: float) -> bytes:
        self._look()
        clock = self._world.clock
        if not self._answers or self._answers[0][0] > clock.now + timeout:
            if timeout > 0.0:
                clock.wait(timeout)
            return b""
        at, data = self._answers.pop(0)
        clock.wait(at - clock.now)
        self._look()
        return data

    def write(self, data: bytes) -> None:
        self._look()
        self._said += data
        while b"\r" in self._said:
            command, _, self._said = self._said.partition(b"\r")
            self._hear(command.decode("ascii"))

    def close(self) -> None:
        pass

    def _reset(self) -> None:
        self._on = {"E": True, "H": False, "S": True, "L": False}

    def _look(self) -> None:
        if self._world.fails("adapter", "unplugged") is not None:
            raise SourceError("serial port /dev/ttyUSB0 is gone (no such device)")

    def _hear(self, command: str) -> None:
        world, now = self._world, self._world.clock.now
        for fault in world.begun("adapter", "begins anew", now):
            if fault.start > self._opened:
                self._opened = now
                self._reset()
                self._answers = [(now + 0.2, b"\r\rELM327 v1.5\r\r>")]
                return
        if not command or world.fails("adapter", "mute") is not None:
            return
        chance = world.chance("answer", now)
        delay = ANSWER * chance.uniform(0.7, 1.5)
        if (fault := world.fails("adapter", "slow")) is not None:
            delay += 0.3 + 2.0 * fault.size
        if command == "ATZ":
            delay += 0.8
        data = self._reply(command, chance)
        if world.fails("adapter", "garbage") is not None and chance.random() < 0.5:
            data = bytes(chance.choice(b"0123456789ABCDEF \r?\xff\x00") for _ in range(12)) + b"\r>"
        self._answers.append((now + delay, data))

    def _reply(self, command: str, chance: random.Random) -> bytes:
        echo = f"{command}\r" if self._on["E"] else ""
        if command.startswith("AT"):
            return f"{echo}{self._set(command[2:])}\r\r>".encode()
        world = self._world
        text = "NO DATA"
        numbers = bytes.fromhex(command[2 : len(command) - len(command) % 2])
        base, since, on = world.played(world.clock.now)
        if on and world.fails("can", "silent") is None:
            index = min(int(since * BUS_RATE), len(base.bus[0x04]) - 1)
            if world.fails("can", "some answers") is not None:
                numbers = numbers[:1]
            said = b"\x41"
            for number in numbers:
                value = _lists(number, base.bus) or (
                    base.bus[number][index] if number in base.bus else b"")  # fmt: skip
                said += bytes([number]) + value if value else b""
            if len(said) > 1:
                text = self._shown(said)
            if world.fails("can", "damaged frames") is not None and chance.random() < 0.6:
                text = chance.choice(
                    (text[: chance.randrange(len(text))], f"{text} <DATA ERROR", "CAN ERROR",
                     "BUFFER FULL", "STOPPED")
                )  # fmt: skip
        answer = f"{echo}{text}\r\r>".encode()
        if world.fails("can", "late answers") is not None:
            answer, self._before = self._before, answer
        return answer

    def _set(self, words: str) -> str:
        if words == "Z":
            self._reset()
            return "\r\rELM327 v1.5"
        if words == "RV":
            return "14.1V" if self._world.played(self._world.clock.now)[2] else "12.5V"
        if words == "DPN":
            return "A6"
        if words[0] in self._on and words[1:] in ("0", "1"):
            self._on[words[0]] = words[1:] == "1"
        return "OK"

    def _shown(self, said: bytes) -> str:
        gap = " " if self._on["S"] else ""
        data = (bytes([len(said)]) + said) if self._on["H"] else said
        text = gap.join(f"{byte:02X}" for byte in data)
        return f"7E8{gap}{text}" if self._on["H"] else text


def _lists(number: int, bus: dict[int, list[bytes]]) -> bytes:
    """Return which of the next 32 parameters there are; empty for what is no list."""
    if number % 32:
        return b""
    bits = sum(1 << (32 - (n - number)) for n in bus if number < n <= number + 32)
    return (bits | any(n > number + 32 for n in bus)).to_bytes(4)


Message = tuple[str, str, bytes]
"""Topic of a message, the instant of a weighing in it [s], and a digest of it."""


def marked(topic: str, payload: bytes) -> Message:
    """Return a message in short, so that the memory of a night is not that of its messages."""
    at = str(json.loads(payload)["time_s"]) if topic.endswith("weighing") else ""
    return topic, at, hashlib.blake2b(payload, digest_size=16).digest()


class Broker:
    """A broker, seen through the client of paho: what it has received outlives all connections.

    Attributes
    ----------
    heard : messages in the order in which they came, each with its instant [s]
    unsure : those whose confirmation did not reach the client, or was not yet on its disk
    confirmed : when the client last learnt that a message came [s]
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self.heard: list[tuple[float, Message]] = []
        self.unsure: Counter[Message] = Counter()
        self.published = 0
        self.confirmed: dict[Message, float] = {}
        self.clients: list[Client] = []

    def client(self, *_: object, **__: object) -> Client:
        """Return a new client."""
        self.clients = [c for c in self.clients if c.up]
        self.clients.append(Client(self._world, self))
        return self.clients[-1]


class Client:
    """One connection, by the part of paho's interface that the program uses."""

    def __init__(self, world: World, broker: Broker) -> None:
        self._world, self._broker = world, broker
        self._mid = 0
        self._open: dict[int, Message] = {}
        self.up = False
        self._number = 0
        self.connect_timeout = 5.0
        self.on_connect: Any = None
        self.on_disconnect: Any = None
        self.on_publish: Any = None

    def will_set(self, *_: object, **__: object) -> None:
        pass

    def connect(self, *_: object) -> None:
        self._world.clock.wait(0.05)
        if self._world.fails("broker", "refuses") is not None:
            raise ConnectionRefusedError(errno.ECONNREFUSED, "Connection refused")
        self.up = True
        for fault in self._world.night.faults:
            # A connection is lost where the fault begins.
            ends = fault.kind == "broker" and fault.form in ("lost", "refuses")
            if ends and fault.start > self._world.clock.now:
                self._world.clock.call(fault.start, self._lose)

    def loop_start(self) -> None:
        def answered() -> None:
            if self.up:
                self.on_connect(self, None, None, _Reason(), None)

        self._world.clock.call(self._world.clock.now + 0.05, answered)

    def loop_stop(self) -> None:
        self.up = False
        self.forget()

    def disconnect(self) -> None:
        self.up = False

    def publish(self, topic: str, payload: bytes, qos: int, retain: bool) -> _Published:
        self._mid += 1
        mid = self._mid
        message = marked(topic, bytes(payload))
        clock, world = self._world.clock, self._world
        if self.up:
            self._broker.published += 1
            chance = world.chance("publish", self._broker.published)
            way = 0.02 + (3.0 * chance.random() if world.fails("broker", "slow") else 0.0)
            self._number += 1
            self._open[mid] = message
            silent = world.fails("broker", "confirms nothing") is not None
            # TCP keeps the order: nothing arrives before what was sent before.
            self._last = max(getattr(self, "_last", 0.0), clock.now + way)
            clock.call(self._last, lambda: self._arrive(mid, silent))
        return _Published(mid, clock, self._open)

    def _arrive(self, mid: int, silent: bool) -> None:
        if not self.up or mid not in self._open:
            return
        self._broker.heard.append((self._world.clock.now, self._open[mid]))
        if silent:
            return
        self._world.clock.call(self._world.clock.now + 0.02, lambda: self._confirm(mid))

    def _confirm(self, mid: int) -> None:
        if self.up and mid in self._open:
            self._broker.confirmed[self._open.pop(mid)] = self._world.clock.now
            self.on_publish(self, None, mid, None, None)

    def _lose(self) -> None:
        if self.up:
            self.up = False
            self.forget()
            self.on_disconnect(self, None, None, None, None)

    def forget(self) -> None:
        """Note what was sent and not confirmed: it may have come, and will be sent again."""
        self._broker.unsure.update(self._open.values())
        self._open.clear()


class _Reason:
    is_failure = False


class _Published:
    def __init__(self, mid: int, clock: Clock, waits: dict[int, tuple[str, bytes]]) -> None:
        self.mid = mid
        self._clock, self._waits = clock, waits

    def wait_for_publish(self, timeout: float) -> None:
        until = self._clock.now + timeout
        while self.mid in self._waits and self._clock.now < until:
            self._clock.wait(0.05)


class Disk:
    """A folder on a real disk: what a power cut leaves of it, and a disk that is full or failing.

    A file or a name that was flushed stays; so does what is older than `SETTLED`. Of what is
    younger chance decides: a new file may be there or not, whole, cut off or empty, as POSIX
    allows; a rename is whole, but may not have happened yet.

    A disk that is full is a limit on the size of files, which the kernel enforces: Python, SQLite
    and the writer of tables meet true errors.
    """

    SETTLED = 35.0

    def __init__(self, world: World, root: Path, state: str) -> None:
        self._world, self.root, self._state = world, root, state
        self.kept: bytes | None = None
        self._flushed: dict[int, tuple[int, int]] = {}
        self._named: dict[str, dict[str, int]] = {}
        self._looked: list[tuple[float, dict[str, tuple[int, int, int]]]] = []
        self._fsync = os.fsync

    @contextmanager
    def in_use(self) -> Iterator[None]:
        """Watch what is flushed."""
        with patch.object(os, "fsync", self._flush):
            try:
                yield
            finally:
                self.limit(None)

    def limit(self, full: Fault | None) -> None:
        """Let the disk be full, to the last byte or with room for small files, or not."""
        hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
        room = hard if full is None else int(full.size * 3.0) * 2000
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, hard))

    def look(self) -> None:
        """Note what is there: after a while the system has written it."""
        now = self._world.clock.now
        self._looked.append((now, self._all()))
        while len(self._looked) > 1 and self._looked[1][0] <= now - self.SETTLED:
            self._looked.pop(0)

    def _all(self) -> dict[str, tuple[int, int, int]]:
        found = {}
        for path in self.root.rglob("*"):
            s = path.stat()
            if stat.S_ISREG(s.st_mode):
                found[str(path.relative_to(self.root))] = (s.st_ino, s.st_size, s.st_mtime_ns)
        return found

    def _flush(self, number: int) -> None:
        if self._world.fails("disk", "fails to flush") is not None:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        if (fault := self._world.fails("disk", "slow")) is not None:
            self._world.clock.wait(3.0 * fault.size)
        path, s = str(Path(f"/proc/self/fd/{number}").readlink()), os.fstat(number)
        if not stat.S_ISDIR(s.st_mode):
            self._flushed[s.st_ino] = s.st_size, s.st_mtime_ns
            return
        names = {e.name: e.inode() for e in os.scandir(path)}
        self._named[path] = names
        state = self.root / self._state
        if Path(path) == self.root and state.exists():
            s = state.stat()
            if self._flushed.get(s.st_ino) == (s.st_size, s.st_mtime_ns):
                self.kept = state.read_bytes()

    def cut(self, to: Path, number: int, *, synchronous: int) -> None:
        """Leave in another folder what a power cut leaves of this one.

        Parameters
        ----------
        to : that folder
        number : of the cut, by which chance is drawn
        synchronous : as SQLite is set: from 2 on it flushes each commit
        """
        self.copy(to)
        old = {}
        for at, seen in self._looked:
            if at <= self._world.clock.now - self.SETTLED:
                old = seen
        for name, (inode, size, changed) in self._all().items():
            if ".outbox" in name or old.get(name) == (inode, size, changed):
                continue
            chance = self._world.chance("cut", number, name)
            path, place = to / name, (self.root / name).parent
            flushed = self._flushed.get(inode) == (size, changed)
            named = self._named.get(str(place), {}).get(Path(name).name) == inode
            known = named or (name in old and old[name][0] == inode)
            if not known and chance.random() < 0.5:
                if name == self._state and self.kept is not None:
                    path.write_bytes(self.kept)
                else:
                    path.unlink()
                continue
            if not flushed:
                least = min(old[name][1], size) if name in old and old[name][0] == inode else 0
                os.truncate(path, least + chance.randrange(size - least + 1))
        wal = to / "car.outbox-wal"
        if synchronous < 2 and wal.exists():
            _shorten(wal, self._world.chance("log", number))

    def anew(self, root: Path) -> Disk:
        """Return the same disk when the host is on again: what is there is on it."""
        self.root, self.kept = root, None
        self._flushed.clear()
        self._named.clear()
        self._looked = [(-math.inf, self._all())]
        state = root / self._state
        if state.exists():
            self.kept = state.read_bytes()
        return self

    def copy(self, to: Path) -> None:
        """Leave all in another folder, as the end of the process does."""
        shutil.copytree(self.root, to)


def _shorten(wal: Path, chance: random.Random) -> None:
    """Cut a log of SQLite off behind a frame: without a flush each commit nothing more is sure.

    Frames that were already taken over into the database were flushed before, and stay.
    """
    data = wal.read_bytes()
    if len(data) < 32:
        return
    page = struct.unpack(">I", data[8:12])[0]
    salt, frame, count = data[16:24], 24 + page, 0
    while data[32 + count * frame + 8 : 32 + count * frame + 16] == salt:
        count += 1
    if count < 1000:
        os.truncate(wal, 32 + frame * chance.randrange(count + 1))
