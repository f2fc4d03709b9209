"""A night under one seed: everything around the scale fails in pairs, and what it says is judged.

Run from the checkout: ``python studies/night.py``, which writes ``studies/night.md``; with
``--seed N --hours H`` it prints one night and its digest. The real parts of live run on a clock
that is computed (``night_clock.py``): feed, sources, scale, session, keeper, recorder, outbox and
MQTT. The timetable is drawn by ``night_faults.py``, the devices are in ``night_world.py``.
"""

from __future__ import annotations

import argparse
import gc
import hashlib
import json
import logging
import math
import random
import resource
import shutil
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import polars as pl
from night_clock import Clock, Off, on_clock
from night_faults import APART, FORMS, Night, drawn
from night_mutants import SEEDS, TABLE
from night_world import (
    LOADS,
    SEED,
    Broker,
    Disk,
    Message,
    Played,
    World,
    marked,
    played,
    simulated,
)  # fmt: skip
from pages import filled

import weighbridge as wb
from weighbridge.errors import WeighbridgeError
from weighbridge.live import clock as live_clock
from weighbridge.live import keeper as live_keeper
from weighbridge.live import recorder as live_recorder
from weighbridge.live.checkpoint import unpacked
from weighbridge.live.feed import Feed
from weighbridge.live.keeper import Keeper
from weighbridge.live.outputs import Outputs
from weighbridge.live.outputs.lines import Lines
from weighbridge.live.outputs.mqtt import Mqtt, Outbox, parse_broker
from weighbridge.live.recordings import Recordings
from weighbridge.live.scale import LiveScale
from weighbridge.live.session import Session
from weighbridge.live.source import Samples
from weighbridge.live.sources.elm import ElmSource
from weighbridge.live.sources.lines import LinesSource
from weighbridge.live.sources.nmea import SentenceReader
from weighbridge.live.sources.receiver import ReceiverSource
from weighbridge.live.weighing import LiveStatus, LiveWeighing
from weighbridge.signals import LONGEST_STEP, DriveInfo

HERE = Path(__file__).parent

JUDGED, HOURS = 7417, 8.0
"""The night of the page, and driving in it [h]; nobody looked at it before."""

FARTHEST = 4.0
"""A mass that is `weighed` is never off by so many standard deviations [-]."""

PROOF = 15.0
"""A load that changed at a stop shows in the first windows driven with it: a mass of before that
is shown as `weighed` until so long after the vehicle moves is counted apart [s]."""

AGAIN = 600.0
"""After a fault it is `weighed` again within so long of driving [s]."""

MEMORY = 0.03
"""The memory of the last hour is not above that of the second by more [-]."""

SPEED = 300.0
"""Hours of driving in one of the processor."""

EVERY = 10.0
"""Between two weighings that are shown [s]."""

STATE = "car.state"
KEPT = 75.0
"""After a power cut the state is no older, if the disk did not fail [s]."""

LOST = 60.0
"""After a power cut no more is missing of a recording [s]."""


@cache
def vehicle() -> wb.Vehicle:
    """Calibrate the car on two drives of its own."""
    known = [simulated(load, SEED + 90 + k) for k, load in enumerate((0.0, 300.0))]
    masses = [k.scenario.mass for k in known]
    drives = [k.drive.without("mass_air_flow", "lambda_1") for k in known]
    return wb.calibrate(drives, mass=masses, vehicle=wb.Vehicle(name="night", tare=masses[0]))


@cache
def drives() -> list[Played]:
    """Simulate the drives that are played."""
    return [played(simulated(load, SEED + k)) for k, load in enumerate(LOADS)]


class Digest(logging.Handler):
    """A digest over all that was sent, written and said."""

    def __init__(self, root: Path, clock: Clock) -> None:
        super().__init__(logging.WARNING)
        self._root, self._clock = str(root), clock
        self._sum = hashlib.sha256()
        self.said: list[tuple[float, str]] = []

    def add(self, *what: object) -> None:
        """Take something in."""
        for each in what:
            data = each if isinstance(each, bytes) else repr(each).encode()
            # Sentences name files, and the folder has another name each time.
            self._sum.update(data.replace(self._root.encode(), b""))

    def emit(self, record: logging.LogRecord) -> None:
        """Take in what was said."""
        text = record.getMessage().replace(self._root, "")
        self.said.append((self._clock.now, text))
        self.add(self._clock.now, text)

    def hex(self) -> str:
        """Return it."""
        return self._sum.hexdigest()[:16]


class WrongError(BaseException):
    """Something is wrong, and who looks for it is in haste."""


@dataclass
class Judged:
    """What was seen of one night.

    Attributes
    ----------
    worst : farthest a mass that was `weighed` was off [std], when [s], and what was shown
    off : weighings that were too far off, by trip
    before : how long after the vehicle moved a mass of before the stop was shown as `weighed` [s]
    weighed : instants at which the status was `weighed` [s]
    shown : weighings in all
    wrong : sentences on what must not be
    memory : highest in each hour of the clock [MB]
    """

    worst: tuple[float, float, str] = (0.0, 0.0, "")
    off: Counter[int] = field(default_factory=Counter)
    before: list[float] = field(default_factory=list)
    weighed: list[float] = field(default_factory=list)
    shown: int = 0
    hasty: bool = False
    wrong: dict[str, list[str]] = field(default_factory=dict)
    memory: dict[int, float] = field(default_factory=dict)

    def blame(self, what: str, text: str) -> None:
        """Note what must not be; in haste that is the end."""
        self.wrong.setdefault(what, []).append(text)
        if self.hasty:
            raise WrongError(f"{what}: {text}")


class Watch:
    """An output that compares what is shown with the truth."""

    name = "watch"

    def __init__(self, world: World, judged: Judged) -> None:
        self._world, self._judged = world, judged

    def show(self, weighing: LiveWeighing) -> None:
        """Judge a weighing."""
        seen, now = self._judged, self._world.clock.now
        seen.shown += 1
        if weighing.status is not LiveStatus.WEIGHED:
            return
        seen.weighed.append(now)
        true = self._world.masses(now)
        far = min(abs(weighing.mass - m) for m in true) / weighing.std
        if far > FARTHEST and (late := self._world.moved(now)) < PROOF:
            seen.before.append(late)
            return
        if far > FARTHEST:
            seen.off[self._world.trip(now)] += 1
            if seen.off[self._world.trip(now)] == 1:
                shown = f"{weighing.mass:.0f} ± {weighing.std:.0f} kg for {true[0]:.0f} kg"
                late = f"{self._world.moved(now):.0f} s after the vehicle moved"
                seen.blame("off", f"at {now:.0f} s {shown}: {far:.1f} std, {late}")
        if far > seen.worst[0]:
            seen.worst = far, now, f"{weighing.mass:.0f} ± {weighing.std:.0f} for {true[0]:.0f} kg"

    def close(self) -> None:
        """Nothing was begun."""


class Run:
    """One night: a host that is turned on and off, and what it leaves.

    Parameters
    ----------
    night : its timetable
    root : an empty folder
    car : weighed by this vehicle file
    bases : drives that are played
    """

    def __init__(self, night: Night, root: Path, car: wb.Vehicle, bases: list[Played]) -> None:
        self.night, self.judged, self._car = night, Judged(), car
        self.clock = Clock()
        self.world = World(self.clock, night, bases)
        self.broker = Broker(self.world)
        self.digest = Digest(root, self.clock)
        self._root, self._life = root, 0
        self._folder = root / "0"
        self._folder.mkdir()
        self._disk = Disk(self.world, self._folder, STATE)
        self._session: Session | None = None
        self._mqtt: Mqtt | None = None
        self._stop: Any = None
        self._on = False
        self._taken: Counter[Message] = Counter()
        self._checkpoints: dict[str, int] = {}
        self._written = -1
        self._written_at = -math.inf
        self._parts: list[tuple[float, pl.DataFrame]] = []
        self._came: list[tuple[float, float]] = []
        self._booted = 0.0
        self._crashes = 0
        self.lives: list[str] = []

    # The host.

    def boot(self) -> None:
        """Start the program, as ``weighbridge live`` does."""
        self._on, self._life, self._booted = True, self._life + 1, self.clock.now
        self.clock.spawn(self._live, "main")

    def _live(self) -> None:
        while self._on:
            try:
                self._run()
            except WeighbridgeError as error:
                # The command ends with a sentence, and the service starts it again.
                self._mqtt = None
                self.digest.add(str(error).replace(str(self._root), ""))
            except Off:
                raise
            except Exception as failure:
                self._crashes += 1
                self._mqtt = None
                self.judged.blame(
                    "crash", f"at {self.clock.now:.0f} s {type(failure).__name__}: {failure}"
                )
                if self._crashes > 5:
                    raise
            else:
                return
            self.clock.wait(10.0)

    def _run(self) -> None:
        world, clock, folder = self.world, self.clock, self._folder
        self._mqtt = self._session = self._stop = None
        live_clock._course = live_clock._Course(world.date(), clock.now, 1.0)
        keeper = Keeper(folder / STATE)
        scale, found = keeper.restored(
            self._car, lateness=1.0, info=DriveInfo(), start=live_clock.now(), step=LONGEST_STEP
        )
        self.digest.add(found.replace(str(self._root), ""))
        if found:
            self.digest.said.append((clock.now, found.replace(str(self._root), "")))
        recorder = Recordings(folder / "trip", clock=clock.monotonic, date=world.date)
        sources = [
            ElmSource("elm:/dev/ttyUSB0", (world.adapter,)),
            ReceiverSource("nmea:/dev/ttyACM0", world.receiver, SentenceReader, "no fix"),
            LinesSource("lines:udp:5005", world.datagrams),
        ]
        broker = parse_broker("mqtt://broker:1883/fleet")
        lines = Lines(folder / "car.jsonl")
        mqtt = self._mqtt = Mqtt(broker, "night", folder / "car.outbox")
        with Outputs([lines, mqtt, Watch(world, self.judged)]) as outputs, Feed(sources) as feed:
            self._session = Session(
                feed=feed, scale=scale, outputs=outputs, period=EVERY, keeper=keeper,
                recorder=recorder, aside=True,
            )  # fmt: skip
            self._stop = self._threads.Event()
            try:
                self._session.run(self._stop)
            except WeighbridgeError as error:
                said = str(error).replace(str(self._root), "")
                self.judged.blame("crash", f"at {clock.now:.0f} s it ends with: {said}")
                raise
        self._on, self._mqtt = False, None

    def end(self) -> None:
        """Ask the program to end, and wait for it."""
        if self._on and self._stop is not None:
            self._stop.set()
            self.run(self.clock.now + 90.0)
            if self._on:
                self.judged.blame("crash", f"at {self.clock.now:.0f} s it does not end")
            self.off("end")

    def off(self, how: str) -> None:
        """Take the power away: the program is thrown away where it is.

        Parameters
        ----------
        how : "cut" loses what was not flushed, "kill" nothing that was written
        """
        self.lives.append(how)
        before, self._folder = self._folder, self._root / str(self._life)
        self._disk.limit(None)
        synchronous = 2
        if how == "cut":
            if self._mqtt is not None:
                synchronous = int(
                    self._mqtt._outbox._database.execute("PRAGMA synchronous").fetchone()[0]
                )
            self._disk.cut(self._folder, self._life, synchronous=synchronous)
        else:
            self._disk.copy(self._folder)
        if self._session is not None:
            # What it would still do on its way out, a host without power does not.
            self._session.scale._looking = None
            self._session.scale = self._session.recorder = self._session.keeper = None
            self._session.outputs = Outputs(())
        self.clock.power_off()
        for client in self.broker.clients:
            client.loop_stop()
        self.broker.clients.clear()
        if self._mqtt is not None:
            self._note_unsure(self._mqtt._outbox)
            self._mqtt._outbox.close()
        ran = self._on
        self._on, self._session, self._mqtt, self._stop = False, None, None, None
        gc.collect()
        shutil.rmtree(before)
        self._disk.anew(self._folder)
        self._look_at_disk(how, ran=ran)

    def _note_unsure(self, box: Outbox) -> None:
        """Note what was confirmed a moment ago, or could not be removed from a full disk."""
        for number, topic, payload in box._database.execute("SELECT * FROM messages"):
            message = marked(topic, payload)
            at = self.broker.confirmed.get(message, -math.inf)
            if number in box._removed or at > self.clock.now - 1.0:
                self.broker.unsure[message] += 1

    def run(self, until: float) -> None:
        """Let all run until an instant [s]."""
        while self.clock.now < until:
            at = min(until, 30.0 * (math.floor(self.clock.now / 30.0) + 1.0))
            for fault in self.night.faults:
                for edge in (fault.start, fault.end):
                    if fault.form == "full" and self.clock.now < edge < at:
                        at = edge
            self.clock.run(at)
            self._disk.limit(self.world.fails("disk", "full"))
            self._disk.look()
            hour = int(self.clock.now // 3600.0)
            self.judged.memory[hour] = max(self.judged.memory.get(hour, 0.0), _memory())
            for failure in self.clock.failures:
                if isinstance(failure, WrongError):
                    raise failure
                self.judged.blame("crash", f"a thread, at {at:.0f} s: {failure!r}")
            self.clock.failures.clear()

    # What is left on the disk.

    def _look_at_disk(self, how: str, *, ran: bool) -> None:
        """Judge what is left: the state, and what was recorded.

        Parameters
        ----------
        how : the host was turned off
        ran : the program ran until then
        """
        self._look_at_state(how, ran=ran)
        self._look_at_recordings(how, ran=ran)

    def _sound(self, seconds: float) -> bool:
        """Whether the program ran for so long [s] and the disk did not fail meanwhile."""
        start = self.clock.now - seconds
        return self._booted < start and not any(
            f.kind == "disk" and f.end > start and f.start < self.clock.now
            for f in self.night.faults
        )

    def _look_at_state(self, how: str, *, ran: bool) -> None:
        now, state = self.clock.now, self._folder / STATE
        if not state.exists():
            if self._written >= 0:
                self.judged.blame("state", f"after a {how} at {now:.0f} s there is none")
            return
        text = state.read_text(encoding="ascii", errors="replace")
        self.digest.add(text)
        try:
            unpacked(text, self._car)
        except WeighbridgeError as error:
            self.judged.blame("state", f"after a {how} at {now:.0f} s: {error}")
        number = self._checkpoints.get(_sum(text), -1)
        if number < self._written:
            self.judged.blame("state", f"after a {how} at {now:.0f} s it is none of the last")
        if ran and self._sound(150.0) and now - self._written_at > KEPT:
            self.judged.blame(
                "state", f"after a {how} at {now:.0f} s it is of {self._written_at:.0f} s"
            )

    def _look_at_recordings(self, how: str, *, ran: bool) -> None:
        """Compare the drives on the disk with the parts that were written."""
        now = self.clock.now
        parts, self._parts = self._parts, []
        came, self._came = self._came, []
        found: dict[str, list[float]] = {}
        pairs: dict[str, set[tuple[float, float]]] = {}
        for drive in sorted(self._folder.glob("trip*"), key=lambda p: (len(p.name), p.name)):
            try:
                read = wb.read_drive(drive) if any(drive.iterdir()) else None
            except WeighbridgeError as error:
                self.digest.add(str(error).replace(str(self._folder), ""))
                read = None
            if read is not None:
                start = _start(read)
                for name, s in sorted(read.signals.items()):
                    self.digest.add(name, s.time.tobytes(), s.values.tobytes())
                    stamps = (s.time + start).round(4).tolist()
                    found.setdefault(name, []).extend(stamps)
                    pairs.setdefault(name, set()).update(
                        zip(stamps, s.values.tolist(), strict=True)
                    )
            shutil.rmtree(drive)
        gone: Counter[str] = Counter()
        for zero, frame in parts:
            stamps = (frame["time_s"].to_numpy() + zero).round(4)
            for column in frame.columns:
                name = _name(column)
                if name is not None:
                    mine = stamps[frame[column].is_not_null().to_numpy()]
                    gone[name] += int(np.setdiff1d(mine, found.get(name, [])).size)
        for name, count in gone.items():
            if count:
                text = f"{count} samples of {name} that were written are gone"
                self.judged.blame("records", f"after a {how} at {now:.0f} s {text}")
        for name, stamps in found.items():
            if len(pairs[name]) < len(stamps):
                self.judged.blame("twice", f"after a {how} at {now:.0f} s: samples of {name}")
        due = [stamp for at, stamp in came if at < now - LOST]
        if ran and due and self._sound(now - self._booted - 1.0):
            last = max(found.get("accel_x", [-math.inf]))
            if last < due[-1] - 1.0:
                self.judged.blame(
                    "records",
                    f"after a {how} at {now:.0f} s {due[-1] + LOST - last:.0f} s are missing",
                )

    def _look_at_lines(self) -> None:
        """Read the JSON lines of the whole night."""
        path = self._folder / "car.jsonl"
        lines = path.read_bytes().splitlines() if path.exists() else []
        for k, line in enumerate(lines):
            self.digest.add(line)
            try:
                json.loads(line)
            except ValueError:
                self.judged.blame("lines", f"line {k} of {len(lines)} is torn: {line[:60]!r}")

    # The whole night.

    def go(self) -> None:
        """Let the night pass."""
        logger = logging.getLogger("weighbridge")
        logger.addHandler(self.digest)
        propagates, logger.propagate = logger.propagate, False
        spied = self._spied()
        for each in spied:
            each.start()
        try:
            with on_clock(self.clock, self.world.date) as self._threads, self._disk.in_use():
                chance = self.world.chance("threads")
                self.clock.lag = lambda name: (
                    chance.uniform(0.3, 6.0) if name == "look"
                    else chance.uniform(0.02, 0.5) if name.startswith("record") else 0.0
                )  # fmt: skip
                for at, what in self._plan():
                    self.run(at)
                    if what == "on" and not self._on:
                        self.boot()
                    elif what == "end":
                        self.end()
                    elif what in ("cut", "kill") and self._on:
                        self.off(what)
                    elif what == "clock set":
                        self.world.set_by = 0.0
                    elif what == "clock kept" and not self._on:
                        self._asleep = self.clock.now
                    elif what == "clock slept" and not self._on:
                        self.world.set_by -= self.clock.now - self._asleep
                self.run(self.night.trips[-1].end + 120.0)
                self._drain()
                self.end()
        finally:
            for each in reversed(spied):
                each.stop()
            logger.removeHandler(self.digest)
            logger.propagate = propagates
        self._look_at_lines()
        self._judge_messages()
        self._judge_times()

    def _drain(self) -> None:
        """Give the messages that wait time to be sent."""
        until = self.clock.now + 900.0
        while self.clock.now < until and self._mqtt is not None and self._mqtt.waiting:
            self.run(self.clock.now + 10.0)

    def _plan(self) -> list[tuple[float, str]]:
        """List when the host is turned on and off, and its clock set, in the order of time."""
        trips, plan = self.night.trips, [(self.clock.now + 1.0, "on")]
        for before, trip in pairwise(trips):
            chance = self.world.chance("host", trip.start)
            if trip.host == "stays":
                continue
            off = before.end + chance.uniform(10.0, 60.0)
            plan.append((off, "end" if trip.host == "ended" else chance.choice(("cut", "kill"))))
            on = trip.start + chance.uniform(-20.0, 20.0)
            plan += self._kept(off, on, chance)
            plan.append((on, "on"))
        for fault in self.night.faults:
            if fault.kind == "power":
                chance = self.world.chance("host", fault.start)
                plan.append((fault.start, fault.form))
                plan += self._kept(fault.start, fault.end, chance)
                plan.append((fault.end, "on"))
        return sorted(plan)

    @staticmethod
    def _kept(off: float, on: float, chance: random.Random) -> list[tuple[float, str]]:
        """Let a host without a battery for its clock go on where it ended, and be set later."""
        if chance.random() < 0.5:
            return []
        return [(off + 1e-3, "clock kept"), (on - 1e-3, "clock slept"),
                (on + chance.uniform(20.0, 200.0), "clock set")]  # fmt: skip

    def _spied(self) -> list[object]:
        """Note what the program says that it has taken or written; each call goes through."""
        put, checkpoint, record = Outbox.put, LiveScale.checkpoint, live_recorder.Recorder.put
        write, whole, taken = live_recorder.write_frame, live_keeper.write_whole, self._taken
        run = self

        def put_noted(box: Outbox, messages: list[tuple[str, bytes]]) -> None:
            if run.clock.powerless:
                return  # What it would do on its way out, a host without power does not.
            put(box, messages)
            taken.update(marked(topic, bytes(payload)) for topic, payload in messages)
            run.digest.add(run.clock.now, messages)

        def checkpoint_noted(scale: LiveScale) -> str:
            text = checkpoint(scale)
            run._checkpoints[_sum(text)] = len(run._checkpoints)
            run.digest.add(text)
            return text

        def whole_noted(path: Path, text: str) -> None:
            whole(path, text)
            run._written, run._written_at = run._checkpoints[_sum(text)], run.clock.now

        def write_noted(frame: pl.DataFrame, path: Path) -> None:
            write(frame, path)
            zero = run._session.recorder._recorder._zero if run._session else 0.0
            run._parts.append((zero or 0.0, frame))

        def record_noted(recorder: live_recorder.Recorder, samples: Samples) -> None:
            record(recorder, samples)
            if "accel_x" in samples:
                run._came.append((run.clock.now, float(samples["accel_x"][0][-1])))
                del run._came[:-200]

        return [
            patch.object(Outbox, "put", put_noted),
            patch.object(LiveScale, "checkpoint", checkpoint_noted),
            patch.object(live_recorder, "write_frame", write_noted),
            patch.object(live_recorder.Recorder, "put", record_noted),
            patch.object(live_keeper, "write_whole", whole_noted),
            patch("paho.mqtt.client.Client", self.broker.client),
            patch.object(tempfile, "tempdir", str(self._root)),
        ]

    # The judgement.

    def _judge_messages(self) -> None:
        heard: Counter[Message] = Counter()
        for at, message in self.broker.heard:
            topic = message[0]
            # What was put holds what is in it.
            self.digest.add(at, *message[:2])
            if topic.startswith("fleet/") and not topic.endswith("available"):
                heard[message] += 1
        for message, count in self._taken.items():
            if heard[message] < count:
                self.judged.blame(
                    "lost", f"{_of(message)}: taken {count} times, came {heard[message]} times"
                )
        for message, count in heard.items():
            if count > self._taken[message] + self.broker.unsure[message]:
                self.judged.blame(
                    "again",
                    f"{_of(message)}: taken {self._taken[message]} times, came {count} times",
                )

    def _judge_times(self) -> None:
        """Judge how soon it was weighed again after each pair of faults."""
        self.waits: list[float] = []
        seen = np.array(self.judged.weighed)
        faults = self.night.faults
        for k in range(0, len(faults), 2):
            end = max(f.end for f in faults[k : k + 2])
            until = faults[k + 2].start if k + 2 < len(faults) else math.inf
            driven = self.world.driven(end, min(until, self.night.trips[-1].end))
            later = seen[seen > end]
            wait = self.world.driven(end, float(later[0])) if later.size else math.inf
            if min(wait, driven) < AGAIN and wait > driven:
                continue
            self.waits.append(wait)
            if wait > AGAIN:
                self.judged.blame(
                    "again weighed", f"after {faults[k]}, {faults[k + 1]}: {wait:.0f} s"
                )


def _sum(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _of(message: Message) -> str:
    topic, at, _ = message
    return f"weighing of {at} s" if at else topic


def _start(drive: wb.Drive) -> float:
    """Return the instant of a drive's nought by the host's clock [s since 1970]."""
    from datetime import datetime

    text = drive.info.start_time
    return datetime.fromisoformat(text).timestamp() if text else 0.0


@cache
def _name(column: str) -> str | None:
    from weighbridge.io.columns import UnitlessColumnError, parse_column

    for table in (None, "gnss"):
        try:
            found = parse_column(column, table)
        except UnitlessColumnError:
            found = None
        if found is not None:
            return found[0].name
    return None


def _memory() -> float:
    """Memory of this process now [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 2**20


@dataclass(frozen=True)
class Result:
    """What one night showed."""

    night: Night
    judged: Judged
    digest: str
    seconds: float
    waits: list[float]
    lives: list[str]
    messages: int
    unsure: int
    said: list[tuple[float, str]]

    @property
    def speed(self) -> float:
        """Hours of driving in one of the processor."""
        return self.night.driven / self.seconds

    @property
    def growth(self) -> float:
        """Memory of the last whole hour over that of the second, less one [-]."""
        hours = sorted(self.judged.memory)
        if len(hours) < 4:
            return math.nan
        return self.judged.memory[hours[-2]] / self.judged.memory[hours[1]] - 1.0

    @property
    def holds(self) -> bool:
        """Whether nothing is wrong."""
        return not self.judged.wrong


def night(
    seed: int, hours: float, *, apart: float = APART, hasty: bool = False,
    car: wb.Vehicle | None = None, bases: list[Played] | None = None,
) -> Result:  # fmt: skip
    """Let one night pass.

    Parameters
    ----------
    seed
    hours : of driving
    apart : driving between two pairs of faults [s]
    hasty : end with the first that is wrong
    car, bases : the vehicle file and the drives; None for those of the study
    """
    car, bases = car or vehicle(), bases or drives()
    timetable = drawn(seed, hours, [b.length for b in bases], 1000.0, apart)
    with tempfile.TemporaryDirectory() as folder:
        begin = time.process_time()
        run = Run(timetable, Path(folder), car, bases)
        run.judged.hasty = hasty
        run.go()
        spent = time.process_time() - begin
    return Result(
        timetable, run.judged, run.digest.hex(), spent, run.waits, run.lives,
        len(run.broker.heard), sum(run.broker.unsure.values()), run.digest.said,
    )  # fmt: skip


def sentences(result: Result) -> str:
    """Say what one night showed, a line each."""
    wrong = result.judged.wrong
    memory = ", ".join(f"{m:.0f}" for _, m in sorted(result.judged.memory.items()))
    rows = [
        f"seed {result.night.seed}: {result.night.driven / 3600:.2f} h of driving, "
        f"{len(result.night.faults) // 2} pairs of faults, host off {len(result.lives)} times",
        f"farthest while weighed: {result.judged.worst[0]:.2f} std ({result.judged.worst[2]}) at "
        f"{result.judged.worst[1]:.0f} s; {len(result.judged.weighed)} of {result.judged.shown} "
        f"weighings weighed; {len(result.judged.before)} were of before a stop, until "
        f"{max(result.judged.before, default=0.0):.0f} s after the vehicle moved",
        f"messages at the broker: {result.messages}, not confirmed: {result.unsure}",
        f"weighed again after {', '.join(f'{w:.0f}' for w in sorted(result.waits))} s of driving",
        f"memory by the hour: {memory} MB, {100 * result.growth:+.1f} %",
        f"{result.speed:.0f} h of driving in one of the processor",
        f"digest {result.digest}",
    ]
    for what, texts in wrong.items():
        rows.append(f"WRONG {what}: {len(texts)}")
        rows += [f"  {t}" for t in texts[:6]]
    return "\n".join(rows)


def goals(result: Result, again: str) -> str:
    """Write the table of what was asked and what was found.

    Parameters
    ----------
    result : of the night
    again : digest of its replay; empty where it was not replayed
    """
    seen, wrong = result.judged, result.judged.wrong

    def free(*kinds: str) -> bool:
        return not set(kinds) & set(wrong)

    before = (
        f"{len(seen.before)} weighings, until {max(seen.before, default=0.0):.0f} s on the move"
    )
    longest = max(result.waits, default=math.nan) / 60.0
    hours = result.night.driven / 3600.0
    rows: list[tuple[str, str, str, bool | None]] = [
        ("driving in one night", "8 h", f"{hours:.1f} h", hours >= HOURS),
        ("pairs of faults", "", str(len(result.night.faults) // 2), None),
        ("times the host went off", "", str(len(result.lives)), None),
        ("digest of all that was sent, written and said", "of a replay the same",
         f"`{result.digest}`, {f'of a replay `{again}`' if again else 'not replayed as a whole'}",
         again == result.digest if again else None),
        ("driving in one hour of the processor", f"≥ {SPEED:.0f} h", f"{result.speed:.0f} h",
         result.speed >= SPEED),
        (f"`weighed` and more than {FARTHEST:g} std off", "never",
         f"{seen.off.total()} of {len(seen.weighed)}, the farthest {seen.worst[0]:.1f} std",
         free("off")),
        ("of before a stop and still `weighed` after it, counted apart", "", before, None),
        ("messages and written samples that were lost", "none",
         _count(wrong, "lost", "records"), free("lost", "records")),
        (f"that came twice, of {result.messages} messages ({result.unsure} were not confirmed)",
         "none", _count(wrong, "twice", "again"), free("twice", "again")),
        ("state file not whole, or too old", "never", _count(wrong, "state"), free("state")),
        ("memory of the last hour over that of the second", f"± {100 * MEMORY:.0f} %",
         f"{100 * result.growth:+.1f} %", abs(result.growth) <= MEMORY),
        (f"`weighed` again after a pair, longest of {len(result.waits)}, driving",
         f"≤ {AGAIN / 60:.0f} min", f"{longest:.1f} min", free("again weighed")),
        ("errors that end a thread or the session, torn lines", "none",
         _count(wrong, "crash", "lines"), free("crash", "lines")),
    ]  # fmt: skip
    lines = ["|what|goal|found|held|", "|---|---|---|---|"]
    for what, goal, found, held in rows:
        mark = "" if held is None else "yes" if held else "**no**"
        lines.append(f"|{what}|{goal}|{found}|{mark}|")
    return "\n".join(lines)


def _count(wrong: dict[str, list[str]], *kinds: str) -> str:
    return str(sum(len(wrong.get(k, ())) for k in kinds))


def mutants() -> str:
    """Tell which planted faults short nights have found."""
    if not TABLE.exists():
        return "They were not run."
    table = pl.read_csv(TABLE)
    missed = table.filter(pl.col("found by").is_null())["mutant"].to_list()
    lines = [
        f"`python studies/night_mutants.py` plants {len(table)} faults of one line, each in a copy "
        f"of the source, and lets up to {len(SEEDS)} short nights with many faults pass. "
        f"{len(table) - len(missed)} were found; ≥ 27 were asked for."
    ]  # fmt: skip
    lines += ["", "|planted|module|found by|", "|---|---|---|"]
    for name, path, by in table.rows():
        # Which night, and the rule that it broke.
        lines.append(f"|{name}|`{path}`|{':'.join(by.split(':')[:2]) if by else '**nothing**'}|")
    return "\n".join(lines)


def page(result: Result, again: str) -> str:
    """Fill the template."""
    texts = [f"- {what}: {t}" for what, all_of in result.judged.wrong.items() for t in all_of[:8]]
    values = {
        "goals": goals(result, again),
        "wrong": "Nothing else was wrong."
        if not texts
        else "What was wrong:\n\n" + "\n".join(texts),
        "drives": str(len(LOADS)),
        "loads": ", ".join(f"{load:.0f}" for load in LOADS),
        "length": f"{drives()[0].length / 60.0:.0f}",
        "judged": str(result.night.seed),
        "forms": "\n".join(f"| {kind} | {', '.join(forms)} |" for kind, forms in FORMS.items()),
        "mutants": mutants(),
    }
    return filled(HERE / "night.template.md", values)


def main() -> int:
    """Run one night, or write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, help="print this night alone")
    parser.add_argument("--hours", type=float, default=HOURS)
    parser.add_argument("--apart", type=float, default=APART, help="driving between two pairs [s]")
    parser.add_argument("--once", action="store_true", help="write the page without a replay")
    parser.add_argument("--said", action="store_true", help="print what the program said")
    asked = parser.parse_args()
    result = night(asked.seed or JUDGED, asked.hours, apart=asked.apart)
    if asked.said:
        for fault in result.night.faults:
            print(fault)
        for at, text in result.said:
            print(f"{at:9.1f} {text}")
    print(sentences(result), flush=True)
    if asked.seed is None:
        again = "" if asked.once else night(JUDGED, asked.hours, apart=asked.apart).digest
        text = page(result, again)
        (HERE / "night.md").write_text(text, encoding="utf-8")
    return 0 if result.holds else 1


if __name__ == "__main__":
    sys.exit(main())
