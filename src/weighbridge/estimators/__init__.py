"""Estimators of the mass, one per file, each with its paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from weighbridge.balance import ForceBalance
from weighbridge.errors import ConfigError
from weighbridge.estimators.settings import changed, differences, parsed
from weighbridge.estimators.track import MassTrack, Segment, Status
from weighbridge.first_use import at_first_call, at_first_use
from weighbridge.registry import Registry
from weighbridge.signals import Drive
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.fits import JOINT, RLS, SPEED_EKF, SPEED_TORQUE_EKF

if TYPE_CHECKING:
    from weighbridge.estimators.joint.contradicted import contradicted
    from weighbridge.estimators.rls import RlsSettings, block_jackknife, run_in_turn


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimator:
    """How a mass is estimated, and what is to know of it.

    Attributes
    ----------
    name : of the method
    estimate : makes a track of a balance and a vehicle; takes ``settings`` as third argument,
        where it has any
    settings : makes its usual settings, such as their class; None where it has none
    fits : names of the calibrations whose torque it weighs right with, the best first; other
        torques bias its masses
    speed_alone : it needs a speed and no torque, and takes a balance of
        `weighbridge.balance.speed_balance`
    by_speed : it weighs without an accelerometer, and takes a balance of a motion by speed whatever
        the drive holds
    segments_are_loads : the load changes between its segments; else they are legs of a drive
    reckons_fuel : its mass is that at the end of the drive, fuel burnt taken off; else that of
        the whole drive
    slow_errors : it estimates wind, resistance and their like beside the mass, which its residual
        still holds
    compared : a comparison of the methods has it; else it weighs where it is named alone
    own_balance : makes the balance that its settings ask for, of a drive, a vehicle and them; None
        where they take the usual one
    """

    name: str
    estimate: Callable[..., MassTrack]
    settings: Callable[[], Any] | None = None
    fits: tuple[str, ...]
    speed_alone: bool = False
    by_speed: bool = False
    segments_are_loads: bool = False
    reckons_fuel: bool = False
    slow_errors: bool = False
    compared: bool = True
    own_balance: Callable[[Drive, Vehicle, Any], ForceBalance | None] | None = None

    def settings_of(self, given: Mapping[str, object]) -> Any:
        """Return settings with some values changed, see `weighbridge.estimators.settings.changed`.

        Raises
        ------
        ConfigError
            The method has no settings, a name is unknown or a value cannot be used.
        """
        if self.settings is None:
            raise ConfigError(f"method {self.name} has no settings, got {', '.join(given)}")
        return changed(self.settings(), given)

    def track(self, balance: ForceBalance, vehicle: Vehicle, settings: Any = None) -> MassTrack:
        """Estimate, with the default settings when None."""
        if settings is None:
            return self.estimate(balance, vehicle)
        return self.estimate(balance, vehicle, settings)


def _of(path: str) -> Callable[..., Any]:
    """Return a function of an estimator; the modules of the others are not imported for it."""
    return at_first_call(f"{__name__}.{path}")


_ANY_TORQUE: Final = (RLS.name, JOINT.name)

ESTIMATORS: Final = Registry(
    Estimator,
    "weighbridge.estimators",
    (
        Estimator(
            name="joint",
            estimate=_of("joint.batch.estimate"),
            settings=_of("joint.settings.JointSettings"),
            fits=(JOINT.name,),
            segments_are_loads=True,
            reckons_fuel=True,
            slow_errors=True,
        ),
        Estimator(
            name="rls",
            estimate=_of("rls.estimate"),
            settings=_of("rls.RlsSettings"),
            fits=_ANY_TORQUE,
            own_balance=_of("rls.printed_balance"),
        ),
        Estimator(
            name="robust-rls",
            estimate=_of("robust_rls.estimate"),
            settings=_of("robust_rls.RobustRlsSettings"),
            fits=_ANY_TORQUE,
        ),
        Estimator(
            name="ekf",
            estimate=_of("ekf.estimate"),
            settings=_of("ekf.EkfSettings"),
            fits=_ANY_TORQUE,
        ),
        Estimator(
            name="hybrid",
            estimate=_of("hybrid.estimate"),
            settings=_of("hybrid.HybridSettings"),
            fits=_ANY_TORQUE,
        ),
        Estimator(
            name="speed-torque-ekf",
            estimate=_of("speed_torque_ekf.estimate"),
            settings=_of("speed_torque_ekf.SpeedTorqueSettings"),
            fits=(SPEED_TORQUE_EKF.name,),
            by_speed=True,
        ),
        Estimator(
            name="speed-ekf",
            estimate=_of("speed_ekf.estimate"),
            settings=_of("speed_ekf.SpeedEkfSettings"),
            fits=(SPEED_EKF.name,),
            speed_alone=True,
        ),
        Estimator(
            name="vahidi-rls",
            estimate=_of("vahidi.estimate"),
            settings=_of("vahidi.VahidiSettings"),
            fits=_ANY_TORQUE,
            compared=False,
        ),
        Estimator(
            name="holm-ekf",
            estimate=_of("holm.estimate"),
            settings=_of("holm.HolmSettings"),
            fits=_ANY_TORQUE,
            compared=False,
        ),
        Estimator(
            name="ritter-batch",
            estimate=_of("ritter.estimate"),
            settings=_of("ritter.RitterSettings"),
            fits=_ANY_TORQUE,
            compared=False,
        ),
        Estimator(
            name="fathy-events",
            estimate=_of("fathy.estimate"),
            settings=_of("fathy.FathySettings"),
            fits=_ANY_TORQUE,
            compared=False,
        ),
    ),
)
"""Every method of `weighbridge weigh`, in the order to show them."""

__getattr__ = at_first_use(
    __name__,
    {
        "RlsSettings": "weighbridge.estimators.rls",
        "block_jackknife": "weighbridge.estimators.rls",
        "contradicted": "weighbridge.estimators.joint.contradicted",
        "run_in_turn": "weighbridge.estimators.rls",
    },
)

__all__ = [
    "ESTIMATORS",
    "Estimator",
    "MassTrack",
    "RlsSettings",
    "Segment",
    "Status",
    "block_jackknife",
    "changed",
    "contradicted",
    "differences",
    "parsed",
    "run_in_turn",
]
