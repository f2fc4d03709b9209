"""Where the numbers of a vehicle file come from."""

from __future__ import annotations

import math
from dataclasses import dataclass

from weighbridge.arguments import check_choice
from weighbridge.errors import ConfigError
from weighbridge.messages import Problem
from weighbridge.vehicle.fits import FITS, Fit
from weighbridge.vehicle.possible import MASSES, not_negative, positive, within


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """Where the numbers come from.

    Attributes
    ----------
    drives : names of the drives of the calibration
    masses : their known masses [kg]
    date : ISO 8601 date
    r_squared : of the torque fit [-]
    residual_std : of the torque fit [N m]
    samples : samples used
    method : what the drives were fitted for: the torque of "joint" or "rls", or the speed
        model of "speed-ekf" alone; None where nothing was
    motion : how the motion of the drives was found, as `weighbridge.navigation.Motion.source`
    unmeasured_grade : what of the grade nothing had measured in the drives, as standard deviation
        [rad]; None where it is not known
    torque_period : from one sample of the torque to the next in the drives [s]; None where it is
        not known
    mass_scale_std : relative standard deviation that the calibration leaves in
        every mass weighed with it [-]
    std_factor : scatter of parts of the calibration's drives over what the filter says of it [-];
        None where it is not known
    highest_torque : of the drives [N m]; None where it is not known
    torque_use : how far an error of the torque of one ``highest_torque``, at each of the knots of
        `weighbridge.estimators.torque_shape`, moved their masses, relative [-]; empty where it is
        not known
    switched_power : of an accessory that went on and off in the drives [W]; None where none showed
    fit_cov : covariance of what was fitted, once the scale of every mass is known: lower
        triangle, row by row, of torque coefficients, curvature, slopes at the knots, drag area,
        rolling coefficient, engine and wheel inertia; empty where it is not known
    dbc : DBC files that the drives were read with and no mapping names, seen from the file's folder
    notes : free text
    doubts : findings about the masses of the calibration, repeated at each weighing: each the
        id of its message, a colon and its text
    """

    drives: tuple[str, ...] = ()
    masses: tuple[float, ...] = ()
    date: str | None = None
    r_squared: float | None = None
    residual_std: float | None = None
    samples: int | None = None
    method: str | None = None
    motion: str | None = None
    unmeasured_grade: float | None = None
    torque_period: float | None = None
    mass_scale_std: float | None = None
    std_factor: float | None = None
    highest_torque: float | None = None
    torque_use: tuple[float, ...] = ()
    switched_power: float | None = None
    fit_cov: tuple[float, ...] = ()
    dbc: tuple[str, ...] = ()
    notes: str | None = None
    doubts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        not_negative("unmeasured_grade", self.unmeasured_grade)
        within("unmeasured_grade", self.unmeasured_grade, 0.0, 1.0, "rad")
        positive("torque_period", self.torque_period)
        not_negative("mass_scale_std", self.mass_scale_std)
        within("mass_scale_std", self.mass_scale_std, 0.0, 1e3)
        positive("std_factor", self.std_factor)
        within("std_factor", self.std_factor, 0.1, 100.0)
        positive("highest_torque", self.highest_torque)
        positive("switched_power", self.switched_power)
        within("switched_power", self.switched_power, 1.0, 1e6, "W")
        for mass in self.masses:
            within("one of masses", mass, *MASSES, "kg")
        size = math.isqrt(2 * len(self.fit_cov))
        if size * (size + 1) != 2 * len(self.fit_cov):
            raise ConfigError(
                "fit_cov must be the lower triangle of a square, 1, 3, 6, 10 ... numbers, "
                f"got {len(self.fit_cov)}"
            )
        if self.method is not None:
            check_choice("method", self.method, FITS)

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Return ``doubts`` as messages; those of files of before have no id of their own."""
        return tuple(Problem.from_line(line) for line in self.doubts)

    @property
    def fit(self) -> Fit | None:
        """What was fitted; None where nothing was, or the file does not say it."""
        return FITS[self.method] if self.method is not None else None

    @property
    def torque_fitted(self) -> bool:
        """Whether a calibration has fitted the torque to drives of known mass."""
        return bool(self.masses) if self.fit is None else self.fit.torque
