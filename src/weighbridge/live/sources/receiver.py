"""GNSS receivers that send by themselves, on a serial line, over TCP or by gpsd."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from threading import Event
from time import monotonic
from typing import Final, Protocol

from weighbridge.live.clock import now
from weighbridge.live.source import Samples
from weighbridge.live.sources.gathered import BLOCK, SLICE, Gathered
from weighbridge.live.sources.links import Link
from weighbridge.live.sources.lock import device_lock

SILENT: Final = 5.0
"""A receiver that sends nothing with a fix for so long has a trouble [s]."""


class FixReader(Protocol):
    """Turns the bytes of a receiver into fixes."""

    def read(self, data: bytes, arrived: float) -> list[tuple[float, dict[str, float]]]:
        """Return instants [s] and values [SI] of what is whole now.

        Parameters
        ----------
        data : what came
        arrived : when, by the host's clock [s]
        """
        ...


class ReceiverSource:
    """Listens to a receiver.

    Parameters
    ----------
    name : as on the command line
    open_link : opens the way to it
    make_reader : makes what reads its bytes
    no_fix : why no fix may come, one sentence
    shared : others may listen to it as well, as to gpsd
    """

    def __init__(
        self,
        name: str,
        open_link: Callable[[], Link],
        make_reader: Callable[[], FixReader],
        no_fix: str,
        *,
        shared: bool = False,
    ) -> None:
        self.name = name
        self.trouble = ""
        self._open = open_link
        self._make_reader = make_reader
        self._no_fix = no_fix
        self._shared = shared

    def run(self, put: Callable[[Samples], None], stop: Event) -> None:
        """Hand over fixes until asked to stop; see `weighbridge.live.source.Source.run`."""
        self.trouble = ""
        with nullcontext() if self._shared else device_lock(self.name):
            link = self._open()
            try:
                self._listen(link, put, stop)
            finally:
                self.trouble = ""
                link.close()

    def _listen(self, link: Link, put: Callable[[Samples], None], stop: Event) -> None:
        reader = self._make_reader()
        heard = monotonic()
        fixed = heard
        with Gathered(put) as gathered:
            while not stop.is_set():
                data = link.read(SLICE)
                if data:
                    heard = monotonic()
                for time, values in reader.read(data, now()):
                    # The geometry of the satellites is known without a fix.
                    if values.keys() != {"hdop"}:
                        fixed, self.trouble = monotonic(), ""
                    gathered.add(time, values)
                gathered.flush(BLOCK)
                if monotonic() - fixed > SILENT:
                    self.trouble = self._no_fix
                    if monotonic() - heard > SILENT and not self._shared:
                        self.trouble = (
                            f"the receiver sent nothing for {SILENT:g} s; check cable and rate"
                        )
