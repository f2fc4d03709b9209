"""Samples gathered for a moment, so that a block holds more than one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, Self

import numpy as np

from weighbridge.live.clock import now
from weighbridge.live.source import Samples

BLOCK: Final = 0.2
"""A block is handed over after so long: samples are shown that much later at most [s]."""

SLICE: Final = 0.1
"""A device is waited for so long, before it is looked whether to end [s]."""


class Gathered:
    """Single samples on their way into blocks; as a context it hands all over at its end.

    Parameters
    ----------
    put : takes the blocks
    """

    def __init__(self, put: Callable[[Samples], None]) -> None:
        self._put = put
        self._rows: dict[str, tuple[list[float], list[float]]] = {}
        self._begun = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.flush()

    def add(self, time: float, values: Mapping[str, float]) -> None:
        """Add values [SI] of one instant [s]; hand a block over where it is time."""
        if not self._rows:
            self._begun = now()
        for name, value in values.items():
            times, numbers = self._rows.setdefault(name, ([], []))
            times.append(time)
            numbers.append(value)
        self.flush(BLOCK)

    def flush(self, age: float = 0.0) -> None:
        """Hand over what is there, if it waited for ``age`` [s]."""
        if self._rows and now() - self._begun >= age:
            rows, self._rows = self._rows, {}
            self._put({name: (np.array(t), np.array(v)) for name, (t, v) in rows.items()})
