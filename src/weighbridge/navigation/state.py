"""The state of the navigation filter."""

from __future__ import annotations

from typing import NamedTuple

from weighbridge.kernels.ins_model import TIME
from weighbridge.signals import Floats


class State(NamedTuple):
    """All that the filter needs to go on.

    Attributes
    ----------
    x : (47,) filter state, see `weighbridge.kernels.ins_model`
    cov : (20, 20) covariance of its errors
    """

    x: Floats
    cov: Floats

    @property
    def time(self) -> float:
        """Instant of the last sample [s]; NaN before the first."""
        return float(self.x[TIME])
