"""Where a live mass goes: terminal, JSON lines, MQTT, a local page."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import ExitStack
from typing import Protocol

from weighbridge.errors import WeighbridgeError
from weighbridge.live.weighing import LiveWeighing

_logger = logging.getLogger(__name__)


class Output(Protocol):
    """One place that weighings go to.

    Attributes
    ----------
    name : what a person calls it
    """

    name: str

    def show(self, weighing: LiveWeighing) -> None:
        """Take the newest weighing; it may be left out where the place takes fewer.

        Raises
        ------
        WeighbridgeError
            It cannot be written. A later one may be.
        """
        ...

    def close(self) -> None:
        """Finish what was begun."""
        ...


class Outputs:
    """Several outputs; the failure of one stops neither the others nor the weighing.

    Parameters
    ----------
    outputs : closed with this
    """

    def __init__(self, outputs: Sequence[Output]) -> None:
        self._outputs = tuple(outputs)
        self._failed: set[int] = set()

    def show(self, weighing: LiveWeighing) -> None:
        """Hand a weighing to each; a failure is logged once, and so is its end."""
        for k, output in enumerate(self._outputs):
            try:
                output.show(weighing)
            except WeighbridgeError as error:
                if k not in self._failed:
                    _logger.warning("%s", error)
                self._failed.add(k)
            else:
                if k in self._failed:
                    _logger.warning("%s is written again", output.name)
                self._failed.discard(k)

    def close(self) -> None:
        """Close each."""
        with ExitStack() as stack:
            for output in self._outputs:
                stack.callback(output.close)

    def __enter__(self) -> Outputs:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
