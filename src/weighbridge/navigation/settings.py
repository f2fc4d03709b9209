"""Settings of the inertial navigation, from sensor specifications and the physics of cars."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final

from weighbridge.constants import GRAVITY
from weighbridge.errors import ConfigError
from weighbridge.kernels.ins_model import Noise

RATE: Final = 20.0
"""Of the nodes and of the motion [Hz]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigationSettings:
    """Noise levels and priors of the filter.

    Densities hold at any sample rate. The defaults are those of consumer MEMS
    sensors in a road vehicle with vibration and scale errors included, wider
    than tables 2 and 3 of Jensen 2022, whose values are per 5 ms sample.

    Attributes
    ----------
    accel_density : of specific force [m/s^2/sqrt(Hz)]
    gyro_density : of angular rate [rad/s/sqrt(Hz)]
    gyro_share : part of the power of sample-to-sample differences of the
        angular rate taken as noise on top: a rattling sensor [-]
    accel_bias_walk : [m/s^2/sqrt(s)]
    gyro_bias_walk : [rad/s/sqrt(s)]
    accel_bias_std : before the drive [m/s^2]
    gyro_bias_std : before the drive, where it does not begin at rest [rad/s]
    gnss_horizontal_std, gnss_vertical_std : of fixes without their own
        accuracy [m] (table 3)
    gnss_velocity_std : [m/s]
    height_range : how far from its start a drive without heights may lead up
        or down [m]
    gnss_time : correlation time of GNSS errors [s]; faster fixes weigh less
    speed_std : of the vehicle speed beside its resolution [m/s]
    speed_slip_std : further, per speed [-]
    lateral_std, lateral_slip_std, lateral_turn_std : error of the lateral
        constraint: constant [m/s], per speed [-], per yaw rate [m]
    lever, lever_std : the sensor ahead of the rear axle before the drive [m]
    vertical_std, vertical_slope_std : error of the vertical constraint:
        heave [m/s], per speed [-]
    body_pitch_std : the body's own pitching on bumps, which no grade is [rad]
    blind_grade_std : what a drive without heights leaves in the grade: errors of
        the sensor's axes pass for it [rad]
    hill_std : height between start and end of a drive of one kilometre; grows
        with the root of the distance [m]
    constraint_time : correlation time of constraint and wheel speed errors [s]
    mounting_std : of pitch and yaw after the coarse alignment [rad]
    squat, squat_std : pitch of the body per specific force before the drive
        [rad per m/s^2]; road cars lie near 0.0025 to 0.005
    squat_found_std : below this standard deviation the drive has shown its squat
    speed_scale_std : of indicated over true speed before the drive [-]
    gate : normalised innovation squared above which a row is refused [-]
    patience : refusals in succession before the filter questions itself [-]
    smooth : go backward over the drive after going forward
    max_gap : inertial samples further apart leave a gap [s]
    """

    accel_density: float = 0.005
    gyro_density: float = 2e-4
    gyro_share: float = 0.1
    accel_bias_walk: float = 3e-4
    gyro_bias_walk: float = 1e-5
    accel_bias_std: float = 0.15
    gyro_bias_std: float = 0.01
    gnss_horizontal_std: float = 2.0
    gnss_vertical_std: float = 5.0
    gnss_velocity_std: float = 0.3
    height_range: float = 100.0
    gnss_time: float = 1.0
    speed_std: float = 0.1
    speed_slip_std: float = 0.003
    lateral_std: float = 0.1
    lateral_slip_std: float = 0.01
    lateral_turn_std: float = 0.5
    lever: float = 1.0
    lever_std: float = 1.5
    vertical_std: float = 0.08
    vertical_slope_std: float = 0.004
    body_pitch_std: float = 0.0017
    blind_grade_std: float = 0.008
    hill_std: float = 10.0
    constraint_time: float = 0.3
    mounting_std: float = 0.035
    squat: float = 0.0035
    squat_std: float = 0.0025
    squat_found_std: float = 0.001
    speed_scale_std: float = 0.03
    gate: float = 20.0
    patience: float = 10.0
    smooth: bool = True
    max_gap: float = 0.5

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not value >= 0.0:
                raise ConfigError(f"{item.name} must be zero or positive, got {value}")

    def noise(self, *, constraints: bool = True) -> Noise:
        """Return the filter's noise model."""
        return Noise(
            gravity=GRAVITY,
            accel_psd=self.accel_density**2,
            gyro_psd=self.gyro_density**2,
            gyro_share=self.gyro_share,
            accel_bias_psd=self.accel_bias_walk**2,
            gyro_bias_psd=self.gyro_bias_walk**2,
            lateral_std=self.lateral_std,
            lateral_slip_std=self.lateral_slip_std,
            lateral_turn_std=self.lateral_turn_std,
            vertical_std=self.vertical_std,
            vertical_slope_std=self.vertical_slope_std,
            constraint_time=self.constraint_time,
            still_std=0.02,
            rest_rate_std=0.002,
            gate=self.gate,
            patience=self.patience,
            force_time=0.15,
            constraints=1.0 if constraints else 0.0,
        )
