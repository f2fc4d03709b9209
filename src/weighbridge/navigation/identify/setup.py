"""What a whole drive shows before its samples are folded: one record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from weighbridge.kernels.ins_model import Noise
from weighbridge.messages import Problem
from weighbridge.navigation.geodesy import LocalFrame
from weighbridge.navigation.identify.gain import Gain
from weighbridge.navigation.identify.remounting import Change, unsure
from weighbridge.navigation.rows import Clocks
from weighbridge.navigation.settings import NavigationSettings
from weighbridge.navigation.state import State
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle import Mounting


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """Sensor, delays, noise and start of the filter, found from a whole drive.

    Attributes
    ----------
    settings : noise levels and priors
    rate : of the nodes and of the motion [Hz]
    rot_bs : (3, 3) sensor to body axes
    clocks : delays and periods of the aiding signals
    noise : noise model of the filter
    start : state before the first sample
    given : the mounting given; None where there was none, or the sensor was moved since
    changes : of the mounting on the way
    moved_time, moved_var : (k,) instants [s] and (k, 2) variances of pitch and yaw by which the
        mounting may differ from then on [rad^2]
    gains : errors of the accelerometer's scale along the vehicle, one after another
    gain_axis : (3,) sensor axis along the vehicle that they hold for
    scale_std : relative, of that scale [-]
    origin : of the local frame; None without fixes
    has_height : fixes carry height
    has_wheel : the vehicle speed is that of the wheels
    use_squat : the drive shows the squat, or it was given: it is taken out of the grade
    specific_force_std : noise level of the specific force, of one row of the motion [m/s^2]
    notes : what was found and what is uncertain
    """

    settings: NavigationSettings
    rate: float
    rot_bs: Floats
    clocks: Clocks
    noise: Noise
    start: State
    given: Mounting | None
    changes: tuple[Change, ...]
    moved_time: Floats
    moved_var: Floats
    gains: tuple[Gain, ...] = ()
    gain_axis: Floats | None = None
    scale_std: float = 0.0
    origin: LocalFrame | None = None
    has_height: bool = False
    has_wheel: bool = True
    use_squat: bool = False
    specific_force_std: float = 0.1
    notes: tuple[Problem, ...] = ()

    @property
    def speed_delay(self) -> float:
        """Lateness of the vehicle speed [s]."""
        return self.clocks.speed_delay

    def corrected(self, time: Floats, accel: Floats, gyro: Floats) -> tuple[Floats, Floats]:
        """Correct the accelerometer's scale and turn samples back into the first mounting.

        Each sample by itself: any split of the samples gives the same.

        Parameters
        ----------
        time : (n,) [s]
        accel, gyro : (n, 3) in sensor axes
        """
        if self.gain_axis is not None:
            accel = scaled(time, accel, self.gains, self.gain_axis)
        for change in self.changes:
            accel, gyro = change.undone(time, accel), change.undone(time, gyro)
        return np.ascontiguousarray(accel), np.ascontiguousarray(gyro)

    def is_sure(self, time: Floats) -> Bools:
        """Return the instants (n,) at which the mounting is known: no change may be under way."""
        return np.asarray(~unsure(time, self.changes))


def scaled(time: Floats, accel: Floats, gains: tuple[Gain, ...], axis: Floats) -> Floats:
    """Divide the specific force along an axis (3,) by gains, one after another."""
    scale = np.ones(time.size)
    for gain in gains:
        scale /= gain.at(time)
    along = accel[:, 0] * axis[0] + accel[:, 1] * axis[1] + accel[:, 2] * axis[2]
    return np.asarray(accel + ((scale - 1.0) * along)[:, None] * axis)
