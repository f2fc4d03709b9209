"""Keeps the state of a scale on disk, so that a power cut costs a minute at most."""

from __future__ import annotations

import logging
from pathlib import Path
from time import monotonic
from typing import Final

from weighbridge.errors import ConfigError, WeighbridgeError
from weighbridge.live.scale import LiveScale
from weighbridge.signals import DriveInfo
from weighbridge.vehicle.model import Vehicle
from weighbridge.whole import write_whole

_LOG = logging.getLogger(__name__)

PERIOD: Final = 60.0
"""A checkpoint is written so often [s]."""


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
        self, vehicle: Vehicle, *, lateness: float, info: DriveInfo
    ) -> tuple[LiveScale, str]:
        """Return the scale of the checkpoint, or a new one; and one sentence on it.

        A checkpoint that cannot be used is set aside beside it, under a name that ends in
        ``.bad``.
        """
        new = LiveScale(vehicle, lateness=lateness, info=info)
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
        told = scale.weighing()
        if told.mass != told.mass:
            return scale, ""
        return scale, f"going on from {told.mass:.0f} kg ± {told.std:.0f} kg of the checkpoint"

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
