"""A drive that comes out of devices with clocks of their own, with no port and no waiting."""

import datetime as dt

import numpy as np

from weighbridge.live.emulator import InertialLines, Sentences
from weighbridge.live.sources.lines import LineReader
from weighbridge.live.sources.nmea import SentenceReader
from weighbridge.signals import QUANTITIES

TICK = 0.05
"""What came is handed over so often [s]."""

HOST = 1.79e9
"""The host's clock at the beginning [s]."""


class Senders:
    """An adapter, a receiver and a sensor, heard by one host.

    The adapter's answers are stamped by the host. The sensor sends by UDP: the host does not notice
    that its sender is another one. The receiver is heard over a connection that begins anew.
    """

    def __init__(self):
        self.lines = LineReader("lines:udp:5005")
        self.now = HOST

    def play(self, drive, start, end, put):
        """Let a part of a drive come, its clocks as of a device that was just turned on."""
        bus = [s for s in drive.signals.values() if QUANTITIES[s.name].table == "obd"]
        inertial = InertialLines(drive)
        date = dt.datetime.fromtimestamp(self.now, dt.UTC)
        fixes = Sentences(drive.between(start, end), date)
        sentences = SentenceReader()
        begun = self.now
        for k in range(round((end - start) / TICK)):
            before, time = start + k * TICK, start + (k + 1) * TICK
            self.now = begun + time - start
            rows = self.lines.read(b"".join(inertial.between(before, time)), self.now)
            rows += sentences.read(fixes.between(before, time), self.now)
            for s in bus:
                first, last = s.time.searchsorted([before, time], side="right")
                rows += [
                    (begun + float(s.time[j]) - start, {s.name: float(s.values[j])})
                    for j in range(first, last)
                ]
            for samples in _blocks(rows):
                put(samples)

    def nothing(self, seconds):
        """Let nothing come for a while."""
        self.now += seconds


def _blocks(rows):
    """One block for each source."""
    found = {}
    for time, values in rows:
        for name, value in values.items():
            block = found.setdefault(QUANTITIES[name].table, {}).setdefault(name, ([], []))
            block[0].append(time)
            block[1].append(value)
    for block in found.values():
        yield {name: (np.array(t), np.array(v)) for name, (t, v) in block.items()}
