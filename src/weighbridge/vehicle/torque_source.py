"""What there is to say of a source of torque."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple, Protocol

import numpy as np

from weighbridge.messages import Problem
from weighbridge.signals import Drive, Floats, Signal


class BatteryUse(NamedTuple):
    """How the battery of a drive is read.

    Attributes
    ----------
    sign : with which its power drives [-]
    rest : power that it gives beside driving [W]
    """

    sign: float
    rest: float


class TorqueConstants(Protocol):
    """What a vehicle file may say of a reading, see `weighbridge.vehicle.model.TorqueModel`."""

    @property
    def reference_torque(self) -> float | None:
        """Torque of 100 % [N m]."""
        ...

    @property
    def engine_efficiency(self) -> float:
        """Shaft over fuel power [-]."""
        ...

    @property
    def battery(self) -> BatteryUse | None:
        """How the battery of the drive is read; None to find it from the drive."""
        ...


Reading = Callable[[Drive, Floats, TorqueConstants], Floats]
"""What torque is (nearly) proportional to (n,), at recorded stamps (n,) [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueTerms:
    """Standard deviations of the terms of a torque, over the highest torque of the drives [-].

    Attributes
    ----------
    offset : torque at no reading
    growth : for each power of engine speed, at a typical one
    speed_growth : torque at the highest reading that grows with engine speed
    bend : of the highest reading squared
    knot : of the smooth correction at the highest reading
    """

    offset: float
    growth: float
    speed_growth: float
    bend: float
    knot: float


def _no_refusal(drive: Drive, driven: str | None) -> Problem | None:
    return None


def _no_floor(values: Floats) -> float:
    return -np.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueSource:
    """How torque is found from what a drive recorded, and how well.

    Attributes
    ----------
    name : in vehicle files and options
    signals : what a drive must hold; the first carries the clock
    others : sets of signals that do instead, the better first
    steady : those of them that may stay the same for long whatever the vehicle does, such as a gear
        or a voltage: they do not count as frozen then
    combined : makes the signal that carries the torque of several; None where the first of a set
        does
    gearing : angle of the reading's shaft per distance travelled [1/m] by rolling radius [m]: what
        is read behind the gearbox needs none of its gears; None for the engine's shaft
    before_motor : the reading holds what the motor's own inertia takes, where ``gearing`` is given
    over_speed : of a power over vehicle speed: that speed as recorded (n,) [m/s] at stamps (n,)
    of_all_motors : the reading holds engine and motor of a hybrid
    efficiency : slope of wheel force over reading where nothing was calibrated, and its standard
        deviation [-]; None for that of the driveline
    by_radius : the force depends on the rolling radius
    refusal : says why a drive has no mass by it, of a vehicle whose driven axles are
        "front", "rear", "all" or unknown; empty where it has one
    reading : what torque is proportional to [N m], or a share where ``needs_map``
    signed : the reading is a torque as the vehicle computed it, which shows what a dragged engine
        takes, and can be weighed by without a calibration; else it is only roughly torque, bends
        with engine speed and load, and says nothing in overrun
    needs_map : the reading is no torque, and means nothing without the coefficients of a
        calibration
    needs_reference : the reading is a part of a reference torque
    floor : least reading that says something, from the readings of a drive (n,); where it is not
        given, each says something
    title : in a few words, of the ways to weigh a drive
    words : what a vehicle file that uses it says of it
    axis, axis_suffix : title of an axis of readings, and the suffix of its unit; empty for SI
    terms : what is known of its terms before any drive
    scale_std, motor_scale_std : of the scale of a reading that was never calibrated, and that of
        an electric motor with one gear where it is another [-]
    transfer_std : what a calibration by eq. 48 loses on other drives, relative to the mass [-]
    between_std, motor_between_std : how far masses of one vehicle scatter from drive to drive by
        what the reading does not show, and those of an electric motor with one gear where it is
        another, relative [-]; a fit by likelihood adds it to what all sources leave
    cold_std : of a mass made from a cold start alone, relative [-]
    cold_torque_std : of the friction torque of the cold in the reading, over the highest torque [-]
    expected : what the source adds to the expected error of a mass [%]
    limit : what limits it, where ``expected`` is not 0
    charge_exponent : power of the highest charge, `weighbridge.vehicle.air.Air.charge`, with which
        the torque at one reading grows, and its standard deviation [-]
    """

    name: str
    signals: tuple[str, ...]
    others: tuple[tuple[str, ...], ...] = ()
    steady: tuple[str, ...] = ()
    combined: Callable[[Drive], Signal] | None = None
    gearing: Callable[[float], float] | None = None
    before_motor: bool = False
    over_speed: Callable[[Drive, Floats], Floats] | None = None
    of_all_motors: bool = False
    efficiency: tuple[float, float] | None = None
    by_radius: bool = True
    refusal: Callable[[Drive, str | None], Problem | None] = _no_refusal
    reading: Reading
    signed: bool
    needs_map: bool = False
    needs_reference: bool = False
    floor: Callable[[Floats], float] = _no_floor
    title: str
    words: str
    axis: str
    axis_suffix: str = ""
    terms: TorqueTerms
    scale_std: float
    motor_scale_std: float | None = None
    transfer_std: float
    between_std: float = 0.0
    motor_between_std: float | None = None
    cold_std: float
    cold_torque_std: float
    expected: float = 0.0
    limit: str = ""
    charge_exponent: tuple[float, float] = (0.0, 0.0)

    @property
    def of_one_engine(self) -> bool:
        """Whether it reads one engine or motor, before what a second one adds."""
        return (self.gearing is None or self.before_motor) and not self.of_all_motors

    def between(self, *, single_speed: bool) -> float:
        """Scatter of masses from drive to drive by the reading, relative [-].

        Parameters
        ----------
        single_speed : an electric motor with one gear
        """
        if single_speed and self.motor_between_std is not None:
            return self.motor_between_std
        return self.between_std

    def found(self, drive: Drive) -> tuple[str, ...]:
        """Signals of a drive that torque is made from; those it should hold where it lacks any."""
        return next((s for s in (self.signals, *self.others) if drive.has(*s)), self.signals)

    def lacking(self, drive: Drive) -> list[str]:
        """Name the signals that a drive lacks."""
        return drive.missing(self.found(drive))

    def carrier(self, drive: Drive) -> Signal:
        """Signal whose clock carries the torque, of a drive that lacks nothing."""
        if self.combined is not None:
            return self.combined(drive)
        return drive.signals[self.found(drive)[0]]


REPORTED_TERMS: Final = TorqueTerms(
    offset=0.05, growth=0.02, speed_growth=0.03, bend=0.05, knot=0.012
)
"""Of a reported torque: the maker has modelled it to a few percent of the full-load torque."""

ROUGH_TERMS: Final = TorqueTerms(offset=0.15, growth=0.10, speed_growth=0.30, bend=0.15, knot=0.08)
"""Of a reading that is only roughly torque: friction and accessories are a tenth of the full-load
torque and grow with speed (Heywood, 1988, ch. 13); the full-load curve is smooth."""

MOTOR_BETWEEN_STD: Final = 0.006
"""Of a motor's torque that is reported, see `TorqueSource.between_std`. A magnet loses 0.1 % per
kelvin, and the inverter allows for it roughly. Twelve electric cars of the second model (seeds 9400
to 9411), calibrated by one drive of two kinds: errors of 1.2 and 1.4 % RMS where 1.0 % was
reported."""

REPORTED: Final = partial(
    TorqueSource,
    signed=True,
    terms=REPORTED_TERMS,
    scale_std=0.04,
    transfer_std=0.005,
    cold_std=0.02,
    cold_torque_std=0.012,
)
"""A source of torque that a control unit reports; what differs is given with its name."""

ROUGH: Final = partial(
    TorqueSource,
    signed=False,
    terms=ROUGH_TERMS,
    scale_std=0.06,
    cold_std=0.05,
    cold_torque_std=0.04,
)
"""A source whose reading is only roughly torque; what differs is given with its name."""
