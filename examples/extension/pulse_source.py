"""A live source: a counter of wheel pulses on a serial port or a socket."""

from time import monotonic

from weighbridge.live.clock import now
from weighbridge.live.device_clock import DeviceClock
from weighbridge.live.sources.gathered import BLOCK, Gathered
from weighbridge.live.sources.kind import SourceKind
from weighbridge.live.sources.links import serial_or_tcp
from weighbridge.signals import scalar_to_si

BAUD = 115_200
SILENT = 5.0  # [s]
WRAP = 2**32 * 1e-3  # its counter of milliseconds begins anew [s]


class PulseSource:
    """A counter of wheel pulses: its milliseconds, a comma, km/h, and the end of the line."""

    def __init__(self, name, open_link):
        self.name = name
        self.trouble = ""
        self._open = open_link

    def run(self, put, stop):
        """Deliver samples until ``stop`` is set."""
        gathered, clock, text = Gathered(put), DeviceClock(WRAP), b""
        link = self._open()
        heard = monotonic()
        try:
            while not stop.is_set():
                *lines, text = (text + link.read(0.1)).split(b"\n")
                text = text[-100:]
                for line in lines:
                    try:
                        stamp, speed = map(float, line.split(b","))
                    except ValueError:
                        continue
                    heard, self.trouble = monotonic(), ""
                    values = {"vehicle_speed": scalar_to_si(speed, "kmh")}
                    gathered.add(clock.host(1e-3 * stamp, now()), values)
                gathered.flush(BLOCK)
                if monotonic() - heard > SILENT:
                    self.trouble = f"the counter sent nothing for {SILENT:g} s; check its cable"
            gathered.flush()
        finally:
            link.close()


def make(text, options):
    """Return the source of what follows the colon of its name."""
    return PulseSource(f"pulses:{text}", serial_or_tcp("pulses", text, BAUD))


pulses = SourceKind(
    name="pulses",
    form="pulses:PATH[@BAUD] or pulses:tcp:HOST:PORT",
    about="takes the speed from a counter of wheel pulses",
    make=make,
    package="serialx",
)
