"""Was the accelerometer of a calibration right? What it reads wrong, every mass is off by."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from weighbridge.navigation.motion import Motion

OPEN: Final = 1.0
"""Part of a gain that may be scale or squat that is left open in every mass [-]. Accelerometers 6 %
high showed gains of 1.043 and 1.057, and masses of a truck and a car were 8 % heavy: the squat that
a calibration finds beside such a gain takes the rest of the error."""


def gain_std(motions: Iterable[Motion]) -> float:
    """What doubted gains of a calibration leave open in every mass, relative, as std [-]."""
    return OPEN * float(np.mean([abs((m.doubted_gain or 1.0) - 1.0) for m in motions]))


def doubted_gains(names: Sequence[str], motions: Sequence[Motion]) -> list[str]:
    """Say in which drives of a calibration speed and accelerometer do not go together.

    Parameters
    ----------
    names, motions : of the drives
    """
    std = 100.0 * gain_std(motions)
    return [
        f"in {name}, of the calibration, the accelerometer reads {motion.doubted_gain:.3f} times "
        "what the speed changes by along the vehicle, and gravity does not show it: the scale of "
        "that axis was off, or the lean of the body is not known so well; for it "
        f"{std:.1f} % of every mass, as standard deviation, are in the interval; calibrate again, "
        "with another sensor if you can"
        for name, motion in zip(names, motions, strict=True)
        if motion.doubted_gain is not None
    ]
