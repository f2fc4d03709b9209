"""Three axes of one quantity, as they were recorded: one column each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from weighbridge.signals import Bools, Floats


@dataclass(frozen=True, slots=True)
class Axes:
    """Columns of three axes; rows are put together only where they are asked for.

    A copy of a day's samples at 200 Hz by rows would take 400 MB.

    Attributes
    ----------
    x, y, z : (n,) each in one piece
    """

    x: Floats
    y: Floats
    z: Floats

    def __getitem__(self, rows: slice | Bools) -> Floats:
        """Return rows (k, 3), in one piece."""
        return np.column_stack([column[rows] for column in self.columns])

    @property
    def columns(self) -> tuple[Floats, Floats, Floats]:
        """The three columns."""
        return self.x, self.y, self.z

    @property
    def size(self) -> int:
        """Number of rows."""
        return self.x.size

    def kept(self, keep: Bools) -> Axes:
        """Return the rows that are marked (n,)."""
        return Axes(*(column[keep] for column in self.columns))

    @classmethod
    def of(cls, rows: Floats) -> Axes:
        """Take rows (n, 3) apart."""
        return cls(*(np.ascontiguousarray(column) for column in rows.T))
