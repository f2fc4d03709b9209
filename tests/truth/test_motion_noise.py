"""The noise of the motion that a drive is taken to have is that which it has."""

from dataclasses import replace

import numpy as np
import pytest

from weighbridge.balance import WINDOW, windows
from weighbridge.estimators.joint.slow_errors import motion_variance
from weighbridge.navigation import find_motion
from weighbridge.simulation import MIDSIZE, Scenario, short_route, simulate_car


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.5])
def test_noise_learnt_from_the_drive_is_that_of_its_windows(factor):
    """A quiet and a shaking sensor: 1 to 5 in the standard deviation."""
    made = Scenario(name="noise", car=MIDSIZE, route=short_route(), seed=812)
    sizes = {
        name: factor * getattr(made.effects, name)
        for name in ("imu_noise", "imu_vibration", "imu_jitter", "roughness")
    }
    made = simulate_car(replace(made, effects=replace(made.effects, **sizes)))
    motion = find_motion(made.drive)
    truth = np.interp(motion.time, made.truth.time, made.truth.specific_force)
    driven = motion.valid & (motion.speed > 2.0)
    cut = windows(motion.time, driven)
    # What changes from window to window: the rest is slow, and other states take it.
    error = np.diff(cut.mean(motion.specific_force - truth)) / np.sqrt(2.0)
    shown = 1.4826 * np.median(np.abs(error))
    assert np.sqrt(motion_variance(motion, WINDOW)) == pytest.approx(shown, rel=0.5)
