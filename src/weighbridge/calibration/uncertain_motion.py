"""Was the accelerometer of a calibration right? What it reads wrong, every mass is off by."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from weighbridge.messages import Problem
from weighbridge.navigation import Motion

OPEN: Final = 1.0
"""Part of a gain that may be scale or squat that stays uncertain in every mass [-]. Accelerometers
6 % high showed gains of 1.043 and 1.057, and masses of a truck and a car were 8 % heavy: the squat
that a calibration finds beside such a gain takes the rest of the error."""


def gain_std(motions: Iterable[Motion]) -> float:
    """What uncertain gains of a calibration leave in every mass, relative, as std [-]."""
    return OPEN * float(np.mean([abs((m.uncertain_gain or 1.0) - 1.0) for m in motions]))


def uncertain_gains(names: Sequence[str], motions: Sequence[Motion]) -> list[Problem]:
    """Say in which drives of a calibration speed and accelerometer do not go together.

    Parameters
    ----------
    names, motions : of the drives
    """
    std = 100.0 * gain_std(motions)
    return [
        Problem.of("calibration.gain", drive=name, gain=motion.uncertain_gain, std=std)
        for name, motion in zip(names, motions, strict=True)
        if motion.uncertain_gain is not None
    ]
