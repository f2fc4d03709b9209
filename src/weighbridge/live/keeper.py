"""Keeps the state of a scale on disk, so that a power cut costs a minute at most."""

from __future__ import annotations

import logging
import math
from pathlib import Path
from time import monotonic
from typing import Final

from weighbridge.errors import ConfigError, WeighbridgeError
from weighbridge.live.scale import LiveScale
from weighbridge.signals import STEP, DriveInfo
from weighbridge.signals.instants import instant
from weighbridge.vehicle import Vehicle
from weighbridge.whole import write_whole

_LOG = logging.getLogger(__name__)

PERIOD: Final = 60.0
"""A checkpoint is written so often [s]."""

OLDEST: Final = 3600.0
"""The load may well have changed since a checkpoint that is older [s]."""

_AHEAD: Final = 1.0  # stamps of a device run ahead of the host's by less [s]


class Keeper:
    """Writes the checkpoints of a scale to one file, whole or not at all.

    Parameters
    ----------
    path : of the file
    period : between two of them, by the host's clock [s]
    """

    def __init__(self, path: Path, period: float = PERIOD) -> None:
        self.path = path
        self._period = period
        self._written = monotonic()
        self._failed = False

    def restored(
        self, vehicle: Vehicle, *, lateness: float, info: DriveInfo, start: float,
        step: float = STEP, by_host: bool = True,
    ) -> tuple[LiveScale, str]:  # fmt: skip
        """Return the scale of the checkpoint, or a new one; and one sentence on it.

        A checkpoint that cannot be used is set aside beside it, under a name that ends in
        ``.bad``. Of one that is older than the samples by more than `OLDEST`, what was set to
        nought and how the vehicle tilts is taken over, and nothing else; likewise of one that is
        later, unless the host's clock was set back: then it is gone on from, behind its newest
        sample.

        Parameters
        ----------
        vehicle
        lateness : of a new scale [s]
        info : of a new scale
        start : instant from which samples come [s]
        step : of a new scale [s]
        by_host : whether ``start`` is of the host's clock, which a power cut may set back
        """
        new = LiveScale(vehicle, lateness=lateness, info=info, step=step)
        try:
            data = self.path.read_text(encoding="ascii", errors="replace")
        except FileNotFoundError:
            return new, ""
        except OSError as error:
            return new, f"{self.path}: the checkpoint cannot be read: {error.strerror}"
        try:
            scale = LiveScale.restore(vehicle, data)
        except ConfigError as error:
            return new, f"{self.path}: {error}{self._set_aside()}"
        after = start - scale.newest
        if after < -_AHEAD and by_host and scale.kept_at == 1.0:
            scale.clock_set_back(start)
            return scale, f"{self.path}: {_set_back(scale.newest, start)}"
        if not -_AHEAD <= after <= OLDEST and math.isfinite(after):
            new.take_over(scale)
            return new, f"{self.path}: {self._of_another_time(scale.newest, start)}"
        reported = scale.weighing()
        if reported.mass != reported.mass:
            return scale, ""
        low, high = reported.interval()
        return scale, (
            f"going on from {reported.mass:.0f} ± {0.5 * (high - low):.0f} kg of the checkpoint: "
            "press l where the load has changed since"
        )

    def _of_another_time(self, newest: float, start: float) -> str:
        """Say why a checkpoint is not gone on from."""
        if newest < start:
            hours = (start - newest) / 3600.0
            return f"it is {hours:.0f} h old, and the load may have changed: weighed anew"
        return (
            f"it holds samples until {instant(newest)}, later than those that come from "
            f"{instant(start)} on: of an emulated or another drive"
            f"{self._set_aside()}"
        )

    def _set_aside(self) -> str:
        aside = self.path.with_name(self.path.name + ".bad")
        try:
            self.path.replace(aside)
        except OSError:
            return ""
        return f"; it was set aside as {aside.name}"

    def look(self, scale: LiveScale) -> None:
        """Write a checkpoint if one is due."""
        if monotonic() - self._written >= self._period:
            self.write(scale)

    def write(self, scale: LiveScale) -> None:
        """Write a checkpoint now; a disk that is full or gone is logged once and tried again."""
        self._written = monotonic()
        try:
            write_whole(self.path, scale.checkpoint())
        except (OSError, WeighbridgeError) as error:
            if not self._failed:
                _LOG.warning("%s: the checkpoint is not written: %s", self.path, error)
            self._failed = True
            return
        if self._failed:
            _LOG.warning("%s: checkpoints are written again", self.path)
        self._failed = False


def _set_back(newest: float, start: float) -> str:
    """Say that a checkpoint of a later clock is gone on from."""
    return (
        f"it holds samples until {instant(newest)}, later than the clock's {instant(start)}: the "
        "clock was set back, and nobody knows for how long; going on behind them, and the mass is "
        "that of before until the vehicle was driven: press l where the load has changed"
    )
