"""What the navigation filter knows: its states, its measurement rows and its noise.

Filter state, one flat array so that a step allocates nothing:

======  =====================================================================
0:3     position, north east down of a fixed origin [m]
3:6     velocity, north east down [m/s]
6:10    attitude quaternion, body to navigation, scalar first
10:13   accelerometer bias [m/s^2]
13:16   gyro bias [rad/s]
16      pitch of the body axes over the direction of travel, mounting [rad]
17      yaw from the body's x axis to the direction of travel, mounting [rad]
18      squat: further pitch of the body per specific force along the road [rad per m/s^2]
19      indicated over true vehicle speed [-]
20      distance of the sensor ahead of the axle that does not slip sideways [m]
21      specific force along the body, bias removed, low-passed [m/s^2]
22, 23  rows of GNSS and of vehicle speed refused in succession [-]
24:27   last angular rate, body axes [rad/s]
27:30   its noise power density by axis, from differences of neighbours
30:33   last angular rate, bias removed [rad/s]
33:46   time, sum of ``f_n dt`` and sum of ``rot dt`` since the last node
46      time of the last sample [s]; NaN before the first
======  =====================================================================

Error state (20): position, velocity, attitude (rotation vector in navigation
axes: ``rot_true = exp([theta x]) rot``), accelerometer bias, gyro bias, then
the five constants 16..20. The first 15 are the paper's (Jensen 2022, sec. 5);
the constants are what its method takes as known.
"""

from typing import NamedTuple

import numpy as np

STATES = 47
SHOWN = 24
"""Part of the filter state that a run keeps for each node."""
ERRORS = 20
MEASUREMENTS = 13
ROWS = 11
"""Most scalar rows one node can process."""

P, V, Q, BA, BG, PITCH0, YAW0, SQUAT, SCALE, LEVER, FORCE, LOST_GNSS, LOST_SPEED = (
    0, 3, 6, 10, 13, 16, 17, 18, 19, 20, 21, 22, 23,
)  # fmt: skip
LAST, PSD, RATE, TRANSITION, TIME = 24, 27, 30, 33, 46
"""Places in the filter state."""

E_P, E_V, E_ATT, E_BA, E_BG, E_PITCH0, E_YAW0, E_SQUAT, E_SCALE, E_LEVER = (
    0, 3, 6, 9, 12, 15, 16, 17, 18, 19,
)  # fmt: skip
"""Places in the error state."""

(
    Z_SPEED, Z_SPEED_VAR, Z_STILL, Z_N, Z_E, Z_D, Z_HVAR, Z_VVAR, Z_VN, Z_VE, Z_VEL_VAR,
    Z_PITCH_MOVED, Z_YAW_MOVED,
) = range(MEASUREMENTS)  # fmt: skip
"""Places in a measurement vector; NaN where there is none. ``Z_STILL`` is 0 when
moving, 1 when the wheels stand, 2 when the body rests too. The last two are variances
of pitch and yaw by which the mounting may have changed since the last node [rad^2]."""


class Noise(NamedTuple):
    """Noise model of the filter.

    Attributes
    ----------
    gravity : [m/s^2]
    accel_psd : of specific force [(m/s^2)^2/Hz]
    gyro_psd : of angular rate [(rad/s)^2/Hz]
    gyro_share : part of the power of sample-to-sample differences of the rate taken
        as white noise on top [-]: 1 is right for white noise, less for
        vibration that the sensor follows
    accel_bias_psd : random walk of the accelerometer bias [(m/s^2)^2/s]
    gyro_bias_psd : random walk of the gyro bias [(rad/s)^2/s]
    lateral_std : lateral velocity of the body at rest speed [m/s]
    lateral_slip_std : further, per speed [-]
    lateral_turn_std : further, per yaw rate: side slip [m]
    vertical_std : vertical velocity of the body, heave [m/s]
    vertical_slope_std : further, per speed [-]
    constraint_time : correlation time of the constraint errors [s]
    still_std : velocity of a standing body [m/s]
    rest_rate_std : angular rate of a body at rest [rad/s]
    gate : normalised innovation squared above which a row is refused [-]
    patience : refusals in succession after which a row is believed again [-]
    force_time : time constant of the low-passed specific force [s]
    constraints : 1 with the non-holonomic rows, 0 without
    """

    gravity: float
    accel_psd: float
    gyro_psd: float
    gyro_share: float
    accel_bias_psd: float
    gyro_bias_psd: float
    lateral_std: float
    lateral_slip_std: float
    lateral_turn_std: float
    vertical_std: float
    vertical_slope_std: float
    constraint_time: float
    still_std: float
    rest_rate_std: float
    gate: float
    patience: float
    force_time: float
    constraints: float


class Samples(NamedTuple):
    """Inertial samples and the measurements at their nodes.

    Attributes
    ----------
    time : (n,) stamps [s]
    accel : (n, 3) specific force, sensor axes [m/s^2]
    gyro : (n, 3) angular rate, sensor axes [rad/s]
    nodes : (m,) int64, samples after which covariance and measurements are processed, rising
    z : (m, 13) their measurement vectors
    """

    time: np.ndarray
    accel: np.ndarray
    gyro: np.ndarray
    nodes: np.ndarray
    z: np.ndarray


class Rows(NamedTuple):
    """Rows of the nodes, as they were processed.

    One node long, it is the work space of a run; longer, it keeps each node for the
    backward pass.

    Attributes
    ----------
    h, ph : (m, 220) rows and covariance times row, one after another
    innovation, innovation_var : (m, 11)
    row_count : (m,) int64, rows processed
    transition : (m, 13) time, sum of ``f_n dt`` and sum of ``rot dt`` up to the node
    cov : (m, 400) after the node's rows; (0, 400) in a work space
    """

    h: np.ndarray
    ph: np.ndarray
    innovation: np.ndarray
    innovation_var: np.ndarray
    row_count: np.ndarray
    transition: np.ndarray
    cov: np.ndarray


def new_rows(nodes: int = 1) -> Rows:
    """Return a work space, or with more than one node a log of so many."""
    return Rows(
        np.zeros((nodes, ROWS * ERRORS)),
        np.zeros((nodes, ROWS * ERRORS)),
        np.zeros((nodes, ROWS)),
        np.zeros((nodes, ROWS)),
        np.zeros(nodes, np.int64),
        np.zeros((nodes, 13)),
        np.zeros((nodes if nodes > 1 else 0, ERRORS * ERRORS)),
    )
