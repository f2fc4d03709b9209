"""Extended Kalman filter of speed, mass and an unmeasured grade (Holm 2011)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from weighbridge.balance import ForceBalance, Reason
from weighbridge.estimators import ekf, robust_rls
from weighbridge.estimators.judging import nothing
from weighbridge.estimators.track import MassTrack
from weighbridge.estimators.unmeasured_grade import (
    FEWEST_ROWS,
    UnmeasuredGradeSettings,
    blocks_of,
    finish,
    settled_rows,
)
from weighbridge.kernels import mass_ekf as kernel
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.possible import positive

METHOD = "holm-ekf"


@dataclass(frozen=True, slots=True, kw_only=True)
class HolmSettings(UnmeasuredGradeSettings):
    """Settings of filter and gate; the noise levels are chosen.

    Attributes
    ----------
    graded : the grade is measured, as by the inclination sensor of the second filter of the thesis
    start_mass : [kg]; tare or usual mass of the class when None
    start_std : of that, relative [-]
    speed_noise : error of the speed that stays for a second [m/s]
    grade_noise : error of a measured grade that stays for a second [rad]
    accel_walk : what unknown forces do to the speed in one second, over mass [m/s]
    grade_walk : change of the slope of the road in one second [rad]
    mass_walk : change of the mass in one second, relative [-]
    """

    graded: bool = False
    start_mass: float | None = None
    start_std: float = 0.5
    speed_noise: float = 0.01
    grade_noise: float = 0.004
    accel_walk: float = 0.1
    grade_walk: float = 0.003
    mass_walk: float = 1e-4

    def __post_init__(self) -> None:
        UnmeasuredGradeSettings.__post_init__(self)
        for name in (
            "start_mass", "start_std", "speed_noise", "grade_noise", "accel_walk", "grade_walk",
            "mass_walk",
        ):  # fmt: skip
            positive(name, getattr(self, name))


def estimate(
    balance: ForceBalance, vehicle: Vehicle, settings: HolmSettings | None = None
) -> MassTrack:
    """Weigh by the filter of `weighbridge.estimators.ekf`, to which nothing shows the grade.

    The mass and its standard deviation are the filter's last ones.

    Parameters
    ----------
    balance, vehicle
    settings : the defaults when None

    References
    ----------
    Holm, Vehicle Mass and Road Grade Estimation using Kalman Filter, LiTH-ISY-EX--11/4491--SE,
    Linköping, 2011. Its abstract states that less than 5 % is often achieved within five minutes,
    and 2 % with an inclination sensor.
    """
    settings = settings or HolmSettings()
    rows = settled_rows(balance, vehicle, settings)
    if rows.taken.size < FEWEST_ROWS:
        return nothing(METHOD, balance, vehicle, rows.reason, 0, settings)
    filter_settings = ekf.EkfFilter(
        speed_noise=settings.speed_noise,
        grade_noise=settings.grade_noise,
        accel_walk=settings.accel_walk,
        grade_walk=settings.grade_walk,
        mass_walk=settings.mass_walk,
        load_walk=settings.mass_walk,
        grade_offset=0.0,
        offset_walk=0.0,
        jacobian_window=0.0,
    )
    driven = rows.reason == Reason.USED
    columns = ekf.columns(balance, vehicle, driven, filter_settings)
    grade = columns.grade if settings.graded else np.full(rows.time.size, np.nan)
    columns = columns._replace(grade=grade, driven=driven)
    params = ekf.parameters(filter_settings, vehicle, robust_rls.row_period(rows.time))
    start = settings.start_mass or vehicle.tare or vehicle.of_class.typical_mass
    begin = int(rows.taken[0])
    state = kernel.initial_state(
        start, (settings.start_std * start) ** 2, kernel.row_at(columns, begin), params
    )
    _, masses, variances, _, _ = kernel.run(state, columns, begin, params)

    def mass_of(part: slice, block: float) -> tuple[float, float, int]:
        known = np.flatnonzero(driven[part])
        if not known.size:
            return float("nan"), float("inf"), 0
        last = (part.start or 0) + int(known[-1])
        count = int(np.unique(blocks_of(rows.time[part], block)[known]).size)
        return float(masses[last]), float(np.sqrt(variances[last])), count

    return finish(
        METHOD,
        balance,
        vehicle,
        rows,
        settings,
        running=masses,
        running_std=np.sqrt(variances),
        mass_of=mass_of,
    )
