"""The table that every estimator reads: forces and motion, one row per force sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.balance.coarse import coarse_note
from weighbridge.balance.filled import Fill
from weighbridge.balance.foot_setup import FootSetup
from weighbridge.limits import STANDS
from weighbridge.messages import Problem
from weighbridge.navigation import Motion
from weighbridge.signals import Bools, Floats, Ints
from weighbridge.vehicle import Air
from weighbridge.vehicle.air import dynamic_pressure

if TYPE_CHECKING:
    from weighbridge.navigation.identify.setup import Setup

UNKNOWN_AIR: Final = 0.02
"""What the air leaves uncertain of the torque is reported from here on [-]."""


class Reason(IntEnum):
    """Why a sample is not usable; 0 where it is."""

    USED = 0
    STANDING = 1
    NO_MOTION = 2
    NO_TORQUE = 3
    BRAKING = 4
    SHIFTING = 5
    CLUTCH_SLIPPING = 6
    OVERRUN = 7
    EXTRAPOLATED = 8
    NOT_ACCELERATING = 9
    BAD_FIT = 10
    TOO_SHORT = 11
    CORNERING = 12

    @property
    def text(self) -> str:
        """The reason in words."""
        return REASON_TEXT[self]


REASON_TEXT: Final[dict[Reason, str]] = {
    Reason.USED: "",
    Reason.STANDING: "standing",
    Reason.NO_MOTION: "no motion data",
    Reason.NO_TORQUE: "no torque data",
    Reason.BRAKING: "braking",
    Reason.SHIFTING: "shifting",
    Reason.CLUTCH_SLIPPING: "clutch slipping",
    Reason.OVERRUN: "overrun",
    Reason.EXTRAPOLATED: "outside torque model",
    Reason.NOT_ACCELERATING: "not accelerating",
    Reason.BAD_FIT: "bad fit",
    Reason.TOO_SHORT: "too short a stretch",
    Reason.CORNERING: "cornering hard",
}
"""Every reason as tables and reports print it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceTable:
    """Forces at the instants they were computed in the vehicle, and the motion there.

    What follows from it by the parameters of a vehicle is in `weighbridge.balance.law`.

    Attributes
    ----------
    time : (n,) instants, delay taken off, rising [s]
    traction_force : (n,) at the wheels, before the rotating parts are accelerated [N]; NaN
        without torque
    force_std : (n,) noise of one traction force, as standard deviation [N]
    torque : (n,) of engine or motor [N m]
    engine_speed : (n,) [rad/s]
    speed, accel, specific_force, grade, pitch, heading : (n,) of `Motion`, whose noise is its
        ``specific_force_std``
    gear : (n,) 1..n, 0 for none
    gearing : (n,) [1/m]; NaN without a gear
    air_speed : (n,) against the air, with the reported wind [m/s]
    air_density : (n,) [kg/m^3]
    fuel_burnt : (n,) since the first row, as far as the drive shows it [kg]
    reason : (n,) `Reason` why a sample is not usable
    set_off : instant at which the vehicle first moved; found from the rows when None [s]
    ratio_rate : (n,) how fast the logarithm of the gearing rises [1/s]; None where gears hold it
    """

    time: Floats
    traction_force: Floats
    force_std: Floats
    torque: Floats
    engine_speed: Floats
    speed: Floats
    accel: Floats
    specific_force: Floats
    grade: Floats
    pitch: Floats
    heading: Floats
    gear: Ints
    gearing: Floats
    air_speed: Floats
    air_density: Floats
    fuel_burnt: Floats
    reason: NDArray[np.uint8]
    set_off: float | None = None
    ratio_rate: Floats | None = None

    @property
    def first_moved(self) -> float:
        """Instant at which the vehicle first moved, or that of the first row [s]."""
        if self.set_off is not None:
            return self.set_off
        moving = np.flatnonzero(self.moving)
        return float(self.time[moving[0]] if moving.size else self.time[0])

    @property
    def engine_accel(self) -> Floats:
        """Rate of the engine speed over the gearing (n,) [m/s^2]: of the vehicle, in a gear."""
        if self.ratio_rate is None:
            return self.accel
        return np.asarray(self.accel + self.ratio_rate * self.speed)

    @property
    def moving(self) -> Bools:
        """Rows at which the vehicle does not stand (n,)."""
        return np.asarray(np.nan_to_num(self.speed) > STANDS)

    @property
    def usable(self) -> Bools:
        """Rows without a reason against them."""
        return np.asarray(self.reason == Reason.USED)

    @property
    def dynamic_pressure(self) -> Floats:
        """Of the air against the vehicle (n,) [Pa]; negative where it blows from behind."""
        return dynamic_pressure(self.air_density, self.air_speed)

    def direction(self, part: int) -> Floats:
        """North part of the direction driven, or east (part 1) (n,) [-]; zero where unknown."""
        known = np.isfinite(self.heading)
        heading = np.where(known, self.heading, 0.0)
        return np.where(known, (np.cos, np.sin)[part](heading), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSetup:
    """What a whole drive shows of its force side, by which each row can be found alone.

    Attributes
    ----------
    foot : accelerator and floor of the reading
    switch_dead : the brake switch contradicts the motion and is not used
    gears : number of the vehicle file's gear as the gearbox reports it
    engine_delay : lateness of the engine speed [s]
    air : temperature and pressure
    air_std : what the air leaves uncertain of the torque [-]
    full_torque : torque of the engine that the drive hardly exceeds [N m]
    torque_noise : of one torque [N m]
    fill : how readings that a logger filled in would look; None where they cannot be seen
    periods : median time between samples of each signal [s]
    """

    foot: FootSetup
    switch_dead: bool
    gears: Mapping[int, int]
    engine_delay: float
    air: Air
    air_std: float
    full_torque: float
    torque_noise: float
    fill: Fill | None
    periods: Mapping[str, float]

    @property
    def ahead(self) -> float:
        """How far past a row the motion may show it [s]; infinite for a whole drive."""
        return self.foot.ahead

    @property
    def readings_ahead(self) -> float:
        """How far past a row the readings may show it [s]: rows beside it look on from there."""
        return 2.0 * self.foot.ahead


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceBalance:
    """Newton's law along the road: the table, and the motion it was read from.

    Attributes
    ----------
    table, motion
    brake_hidden : the vehicle slows, and no switch, accelerator or floor of the reading shows it
        where it is braked
    switch_dead : the brake switch contradicts the motion and is not used
    retarder_unreported : a retarder may slow the vehicle, unseen in the drive
    coarse_std : standard deviation by steps of the torque's reading, relative to the mass [-]
    wheel_speed : (n,) speed of the wheels as recorded, at the instants of the rows [m/s]; None for
        stages that go forward, and without one
    air_std : the same by other air than that of the calibration, relative to the torque [-]
    setup : what a whole drive shows of its force side; None but for stages that go forward
    delay : lateness of the torque, which is off its instants [s]
    navigation : what the motion was found by; None where it was not from an inertial sensor
    lagged, fuel_flow : the motion, smoothed as the torque is, and the fuel of each row (n,) [kg/s];
        None but for stages that go forward
    """

    table: ForceTable
    motion: Motion
    brake_hidden: bool = False
    switch_dead: bool = False
    retarder_unreported: bool = False
    coarse_std: float = 0.0
    air_std: float = 0.0
    wheel_speed: Floats | None = None
    setup: ForceSetup | None = None
    delay: float = 0.0
    navigation: Setup | None = None
    lagged: Motion | None = None
    fuel_flow: Floats | None = None

    @property
    def notes(self) -> tuple[Problem, ...]:
        """What is uncertain."""
        ids = (("brake.hidden", self.brake_hidden), ("brake.switch_dead", self.switch_dead))
        notes = [Problem.of(id) for id, so in ids if so]
        if self.air_std > UNKNOWN_AIR:
            notes.append(Problem.of("torque.air", share=100.0 * self.air_std))
        return (*notes, *coarse_note(self.coarse_std))
