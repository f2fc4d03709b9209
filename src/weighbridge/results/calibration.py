"""A calibration as data, for terminal, file and report."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.signals import Floats, Ints, Problem, huber, scalar_from_si, spread
from weighbridge.vehicle import GearDetection, Vehicle


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedRows:
    """Rows of a calibration by the vehicle that was saved.

    Attributes
    ----------
    time : (n,) instants, the drives one after another [s]
    drive : (n,) number of the drive of each row
    reading : (n,) of the torque source, in its unit
    engine_speed : (n,) [rad/s]
    source_torque : (n,) what the vehicle's torque model makes of the reading [N m]
    motion_torque : (n,) what the motion of the known mass takes by the vehicle's road load [N m]
    """

    time: Floats
    drive: Ints
    reading: Floats
    engine_speed: Floats
    source_torque: Floats
    motion_torque: Floats

    @property
    def residual(self) -> Floats:
        """Torque of the motion less that of the source (n,) [N m]."""
        return self.motion_torque - self.source_torque

    @property
    def residual_std(self) -> float:
        """Robust standard deviation of the residual [N m]."""
        return spread(self.residual)

    @property
    def r_squared(self) -> float:
        """Part of the motion's torque that the source explains, by Huber's weights [-]."""
        weight = huber(self.residual, self.residual_std)
        centred = self.motion_torque - np.average(self.motion_torque, weights=weight)
        return float(1.0 - np.sum(weight * self.residual**2) / np.sum(weight * centred**2))


@dataclass(frozen=True, slots=True, kw_only=True)
class DelaySearch:
    """How well the drives fit at the delays that were tried.

    Attributes
    ----------
    delay : (k,) rising, delay and lag together [s]
    misfit : (k,) negative log-likelihood above that of the best [-]
    std : of the delay found, by the curvature of the misfit there [s]; None where it is flat
    """

    delay: Floats
    misfit: Floats
    std: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """A calibrated vehicle and what it was made from.

    Attributes
    ----------
    vehicle : the result, as it is saved
    gears : ratios found; None where they were given
    balances : of each drive, with the calibrated vehicle
    rows : of the fit, by the calibrated vehicle
    search : of the delay of the torque
    held : names of the road parameters that lie on a bound
    problems : what is uncertain in the calibration
    """

    vehicle: Vehicle
    gears: GearDetection | None
    balances: tuple[ForceBalance, ...]
    rows: FittedRows
    search: DelaySearch
    held: tuple[str, ...]
    problems: tuple[Problem, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Texts of the `problems`."""
        return tuple(p.text for p in self.problems)

    @property
    def figures(self) -> list[Figure]:
        """Numbers of the vehicle saved, as terminal and report show them."""
        return list(_figures(self.vehicle, self.held))


@dataclass(frozen=True, slots=True)
class Figure:
    """One number of a calibration in words.

    Attributes
    ----------
    name : with its unit
    value : printed
    std : its standard deviation, printed; empty where there is none
    """

    name: str
    value: str
    std: str = ""


def _figures(vehicle: Vehicle, held: tuple[str, ...]) -> Iterator[Figure]:
    made, line, road = vehicle.provenance, vehicle.driveline, vehicle.road_load
    torque, timing, mounting = vehicle.torque, vehicle.timing, vehicle.mounting
    yield Figure("known mass (kg)", ", ".join(f"{kg:.0f}" for kg in made.masses))
    stds = line.gearing_stds or (None,) * len(line.gearings)
    for k, (gearing, std) in enumerate(zip(line.gearings, stds, strict=True), 1):
        yield _figure(f"gearing {k} (rad/m)", gearing, std, 3)
    for key, name, value, std, digits in (
        ("drag_area", "drag area C_d A (m²)", road.drag_area, road.drag_area_std, 3),
        (
            "rolling_coefficient",
            "rolling coefficient C_r",
            road.rolling_coefficient,
            road.rolling_coefficient_std,
            4,
        ),
        ("engine_inertia", "engine inertia (kg m²)", line.engine_inertia,
         line.engine_inertia_std, 3),
        ("wheel_inertia", "wheel inertia (kg m²)", line.wheel_inertia, line.wheel_inertia_std, 2),
    ):  # fmt: skip
        if value is not None:
            found = _figure(name, value, std, digits)
            yield Figure(name, found.value, "at its limit") if key in held else found
    for k, (w, std) in enumerate(zip(torque.coefficients, torque.coefficient_stds, strict=True)):
        yield Figure(f"torque w{k}", f"{w:.5g}", f"{std:.2g}")
    names = ("torque of load times engine speed", "torque of load squared")
    for name, w, std in zip(names, torque.curvature, torque.curvature_stds, strict=False):
        yield Figure(name, f"{w:.5g}", f"{std:.2g}")
    if timing.torque_delay is not None:
        yield _figure("torque delay (s)", timing.torque_delay, timing.torque_delay_std, 3)
    if timing.torque_lag:
        yield _figure("torque lag (s)", timing.torque_lag, None, 2)
    yield _figure("speed scale, indicated / true", line.speed_scale, None, 4)
    if mounting is not None and mounting.squat is not None:
        squat, std = mounting.squat, mounting.squat_std or 0.0
        yield _figure(
            "squat (° per m/s²)", scalar_from_si(squat, "deg"), scalar_from_si(std, "deg"), 3
        )
    if torque.noise is not None:
        yield _figure("torque noise (N m)", torque.noise, None, 1)
    if made.r_squared is not None and made.residual_std is not None:
        yield _figure("torque fit R²", made.r_squared, None, 4)
        yield _figure("torque fit residual (N m)", made.residual_std, None, 1)
    yield Figure("samples", str(made.samples))
    if made.mass_scale_std is not None:
        yield _figure("left in every mass (%)", 100.0 * made.mass_scale_std, None, 2)


def _figure(name: str, value: float, std: float | None, digits: int) -> Figure:
    return Figure(name, f"{value:.{digits}f}", f"{std:.{digits}f}" if std else "")
