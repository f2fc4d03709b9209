"""Cars that can be simulated: what they physically are, not what is known of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from weighbridge.data import toml_of
from weighbridge.errors import ConfigError

RPM = math.pi / 30.0
"""One turn per minute [rad/s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerSplit:
    """Who gives what in a power split.

    Attributes
    ----------
    start_power : asked for, from which the engine runs [W]
    motor_power : largest of the motor, driving and braking [W]
    efficiency : of motor and inverter, one way [-]
    mechanical : of gears between both and the wheels [-]
    slowest, fastest : engine speed at no power and at the engine's largest [rad/s]
    engine_power : the engine's largest [W]
    engine_inertia : [kg m^2]
    auxiliary : power of the battery beside driving [W]
    voltage : of the battery at rest [V]
    """

    start_power: float = 7000.0
    motor_power: float = 50_000.0
    efficiency: float = 0.90
    mechanical: float = 0.96
    slowest: float = 105.0
    fastest: float = 420.0
    engine_power: float = 70_000.0
    engine_inertia: float = 0.17
    auxiliary: float = 450.0
    voltage: float = 210.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedCar:
    """The physics of one car, van, truck or bus.

    Attributes
    ----------
    name : for people
    kind : "car", "van", "truck" or "bus"
    mass : with driver and full tank, without payload [kg]
    engine : "petrol", "diesel" or "electric"
    transmission : "dual_clutch", "manual", "automatic" (torque converter and power
        shifts), "automated" (a clutch and interrupted torque), "stepless" (a torque converter
        and a variator) or "single"
    gear_ratios : gears 1..n; the first and the last of a stepless box [-]
    final_drive : [-]
    wheel_radius : effective rolling radius [m]
    engine_inertia : engine or motor with flywheel and clutch [kg m^2]
    wheel_inertia : all wheels with brakes and shafts [kg m^2]
    drag_area : C_d A with closed windows and no side wind [m^2]
    rolling_coefficient : warm, at 25 degC and walking pace [-]
    curve_speed, curve_torque : full load torque over speed [rad/s], [N m]
    idle_speed, max_speed : [rad/s]
    drag_torque : engine friction and pumping torque, coefficients of rising
        powers of engine speed in rad/s [N m]
    loss_constant, loss_slope : driveline torque loss at the engine side,
        ``constant + slope |torque|`` [N m], [-]
    torque_lag : first-order lag of the torque [s]
    shift_time, shift_floor : length of a shift [s], part of the torque kept [-]
    upshift, downshift : engine speeds of a calm driver or gearbox [rad/s]
    launch_gear : gear to pull away in
    gear_skip : gears that one shift may pass
    converter_capacity : torque of a converter's pump at stall over its squared
        speed; 0 where there is none [N m s^2/rad^2]
    stall_ratio : turbine over pump torque at stall [-]
    lock_gear, lock_speed : gear and turbine speed from which the converter is
        locked, [-], [rad/s]; of a stepless box in its first ratio
    economy_speed : lowest engine speed that a stepless box holds [rad/s]
    power_share : part of the highest torque at which it lets the engine give a power [-]
    ratio_lag : first-order lag of its ratio [s]
    ratio_bend : growth of its losses with the squared logarithm of the ratio over the middle [-]
    pump : torque of its pump over engine speed [N m s/rad]
    accessory_power, compressor_power : taken from the crank [W]
    load_full : reading of the calculated load at full torque [-]; a diesel's is
        of the torque there is at the engine speed of the moment (SAE J1979)
    load_curvature, load_speed_slope : how far the reading departs from a
        straight line in torque and with engine speed, relative [-]
    torque_curvature : how far a torque reading of the bus bends away from the
        torque at part load, relative [-]
    load_smoothing : first-order lag of the reading [s]
    regeneration : largest braking torque of an electric motor [N m]
    brake_rise, brake_fall : lags of the brakes [s]
    brake_drag : what released brakes still hold, fading within 15 s [N]
    retarder_force : largest braking force of a retarder, at the wheels; half of
        it is used without the pedal [N]
    top_speed : of a speed limiter [m/s]
    liveliness : of the driver in this vehicle, 1 in a car [-]
    wind_height : height of the middle of its front [m]
    yaw_drag : growth of the drag area with the squared sine of the flow angle [-]
    tyre_cooling : growth of rolling resistance per kelvin colder, ISO 28580 [1/K]
    warm_up_time : of tyres and oil [s]
    squat : pitch of the body per specific force along the road, without payload [rad per m/s^2]
    squat_load : growth of the squat with payload over empty mass [-]
    load_pitch : static pitch per payload, nose up [rad/kg]
    roll_gain : roll to the outside per lateral acceleration [rad per m/s^2]
    pitch_frequency, roll_frequency, heave_frequency : undamped, of the body [Hz]
    wheelbase, track : [m]
    spin_loss : drag torque of gearbox and axle at the wheels over wheel speed, warm
        [N m s/rad]
    overrun_charge : what still burns with the foot off the pedal before the fuel is cut,
        over the charge of idling [-]
    least_charge : air of a cycle that still burns, over that of full load, as the
        calculated load counts it until the fuel is cut [-]
    cut_delay, cut_speed : foot off the pedal until the fuel is cut [s], engine speed
        below which it is not [rad/s]
    load_curve : 1 where the calculated load is of all the torque there is at the engine
        speed of the moment, friction and accessories inside; 0 as ``load_full`` says [-]
    tyre_slip : wheel slip per traction over weight [-]
    side_slip : slip angle of the rear axle per lateral acceleration [rad per m/s^2]
    cylinders : of a four-stroke engine; 0 for a motor
    split : of a hybrid, whose engine turns apart from the wheels; None without a motor beside it

    Notes
    -----
    Typical values: rolling resistance, slip and cornering stiffness from
    Gillespie, Fundamentals of Vehicle Dynamics, 1992; friction torque from
    Heywood, Internal Combustion Engine Fundamentals, 1988, ch. 13.
    """

    name: str
    kind: str = "car"
    mass: float
    engine: Literal["petrol", "diesel", "electric"] = "petrol"
    transmission: Literal[
        "dual_clutch", "manual", "automatic", "automated", "stepless", "single"
    ] = "dual_clutch"
    gear_ratios: tuple[float, ...]
    final_drive: float
    wheel_radius: float
    engine_inertia: float
    wheel_inertia: float
    drag_area: float
    rolling_coefficient: float
    curve_speed: tuple[float, ...]
    curve_torque: tuple[float, ...]
    idle_speed: float
    max_speed: float
    drag_torque: tuple[float, float, float]
    loss_constant: float = 4.0
    loss_slope: float = 0.03
    torque_lag: float = 0.15
    shift_time: float = 0.35
    shift_floor: float = 0.5
    upshift: float = 1900 * RPM
    downshift: float = 1200 * RPM
    launch_gear: int = 1
    gear_skip: int = 1
    converter_capacity: float = 0.0
    stall_ratio: float = 1.0
    lock_gear: int = 1
    lock_speed: float = 0.0
    economy_speed: float = 1200 * RPM
    power_share: float = 0.8
    ratio_lag: float = 0.5
    ratio_bend: float = 0.0
    pump: float = 0.0
    accessory_power: float = 700.0
    compressor_power: float = 1500.0
    load_full: float = 0.35
    load_curvature: float = 0.06
    load_speed_slope: float = 0.05
    torque_curvature: float = 0.0
    load_smoothing: float = 0.15
    regeneration: float = 0.0
    brake_rise: float = 0.2
    brake_fall: float = 0.12
    brake_drag: float = 0.0
    retarder_force: float = 0.0
    top_speed: float = math.inf
    liveliness: float = 1.0
    wind_height: float = 1.0
    yaw_drag: float = 2.5
    tyre_cooling: float = 0.008
    warm_up_time: float = 600.0
    squat: float = math.radians(0.21)
    squat_load: float = 0.0
    load_pitch: float = 2.0e-5
    roll_gain: float = math.radians(0.40)
    pitch_frequency: float = 1.35
    roll_frequency: float = 1.6
    heave_frequency: float = 1.25
    wheelbase: float = 2.75
    track: float = 1.55
    spin_loss: float = 0.0
    overrun_charge: float = 0.0
    least_charge: float = 0.0
    cut_delay: float = 0.0
    cut_speed: float = 0.0
    load_curve: float = 0.0
    tyre_slip: float = 0.035
    side_slip: float = 0.0035
    cylinders: int = 4
    split: PowerSplit | None = None

    def __post_init__(self) -> None:
        for name in ("mass", "final_drive", "wheel_radius", "max_speed", "torque_lag"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ConfigError(f"{name} of a simulated car must be positive, got {value}")
        if not self.gear_ratios or list(self.gear_ratios) != sorted(self.gear_ratios, reverse=True):
            raise ConfigError(
                f"gear_ratios of a simulated car must fall from first to last, "
                f"got {self.gear_ratios}"
            )
        if len(self.curve_speed) != len(self.curve_torque) or len(self.curve_speed) < 2:
            raise ConfigError("curve_speed and curve_torque must be two or more pairs")
        if not 1 <= self.launch_gear <= len(self.gear_ratios):
            raise ConfigError(
                f"launch_gear must be one of {len(self.gear_ratios)} gears, got {self.launch_gear}"
            )
        if (self.transmission in ("automatic", "stepless")) != (self.converter_capacity > 0.0):
            raise ConfigError(
                "an automatic or stepless box has a converter_capacity above zero and others have "
                f"none, got {self.converter_capacity} for transmission {self.transmission!r}"
            )

    @property
    def gearings(self) -> tuple[float, ...]:
        """Effective gearing of each gear, engine angle over distance [1/m]."""
        return tuple(g * self.final_drive / self.wheel_radius for g in self.gear_ratios)

    @property
    def electric(self) -> bool:
        """Whether a motor drives it."""
        return self.engine == "electric"


def rpm(*values: float) -> tuple[float, ...]:
    """Return speeds in turns per minute as rad/s."""
    return tuple(v * RPM for v in values)


_TO_SI: Final[dict[str, Callable[[float], float]]] = {
    "_rpm": lambda value: value * RPM,
    "_deg": math.radians,
    "_kmh": lambda value: value / 3.6,
}
_LISTED: Final = toml_of("simulation", "vehicles.toml")


def listed_car(name: str) -> SimulatedCar:
    """Return a vehicle of `vehicles.toml`, which explains its keys."""
    given: dict[str, Any] = {}
    for key, value in _LISTED[name].items():
        unit = key[-4:]
        if unit in _TO_SI:
            key, turned = key.removesuffix(unit), _TO_SI[unit]
            value = list(map(turned, value)) if isinstance(value, list) else turned(value)
        given[key] = tuple(value) if isinstance(value, list) else value
    given["drag_area"] = given.pop("drag_coefficient") * given.pop("frontal_area")
    if "stall_torque" in given:
        given["converter_capacity"] = given.pop("stall_torque") / given.pop("stall_speed") ** 2
    return SimulatedCar(**given)


MIDSIZE: Final = listed_car("midsize")
"""The car of Jensen 2022, Table 1."""

COMPACT: Final = listed_car("compact")
"""A small car with a naturally aspirated engine and a manual gearbox."""

ELECTRIC: Final = listed_car("electric")
"""A car with one fixed gear whose control unit reports the motor torque."""


def random_car(rng: np.random.Generator) -> SimulatedCar:
    """Draw a plausible petrol car: light to heavy, manual or dual clutch.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    SimulatedCar
    """
    mass = float(rng.uniform(1050.0, 2000.0))
    manual = bool(rng.random() < 0.5)
    turbo = bool(rng.random() < 0.6)
    peak = mass * float(rng.uniform(0.17, 0.22) if turbo else rng.uniform(0.10, 0.12))
    displacement = peak / (160.0 if turbo else 95.0)  # [l]
    radius = float(rng.uniform(0.285, 0.285 + 0.06 * (mass - 900.0) / 1100.0))
    gears = 6 if manual else int(rng.choice([6, 7]))
    first = float(rng.uniform(14.0, 17.0)) / 4.0
    last = float(rng.uniform(2.1, 2.6) if turbo else rng.uniform(2.7, 3.1)) / 4.0
    step = np.linspace(0.0, 1.0, gears)
    # Steps between gears close up towards the top, as in real boxes.
    ratios = first * (last / first) ** (1.25 * step - 0.25 * step**2)
    top = float(rng.uniform(6000.0, 6600.0))
    if turbo:
        speeds = rpm(700.0, 1000.0, 1600.0, 4200.0, 5200.0, top)
        shape = (0.42, 0.62, 1.0, 1.0, 0.85, 0.66)
    else:
        speeds = rpm(700.0, 1000.0, 2000.0, 4000.0, 5200.0, top)
        shape = (0.5, 0.74, 0.89, 1.0, 0.94, 0.78)
    calm = float(rng.uniform(1.0, 1.25)) * (1.0 if turbo else 1.2)
    return SimulatedCar(
        name="random petrol car",
        mass=mass,
        transmission="manual" if manual else "dual_clutch",
        gear_ratios=tuple(float(r) for r in ratios),
        final_drive=4.0,
        wheel_radius=radius,
        engine_inertia=0.06 + 0.045 * displacement + float(rng.uniform(0.0, 0.03)),
        wheel_inertia=float(rng.uniform(0.85, 1.15)) * 5.2 * (mass / 1580.0) ** 1.2,
        drag_area=float(rng.uniform(0.27, 0.34)) * (2.0 + 0.35 * (mass - 1050.0) / 950.0),
        rolling_coefficient=float(rng.uniform(0.0075, 0.0100)),
        curve_speed=speeds,
        curve_torque=tuple(peak * part for part in shape),
        idle_speed=float(rng.uniform(700.0, 880.0)) * RPM,
        max_speed=top * RPM,
        drag_torque=(10.5 * displacement, 0.005 * displacement, 4.5e-5 * displacement),
        loss_constant=float(rng.uniform(2.0, 5.0)),
        loss_slope=float(rng.uniform(0.02, 0.04)),
        torque_lag=float(rng.uniform(0.12, 0.25) if turbo else rng.uniform(0.07, 0.12)),
        shift_time=float(rng.uniform(0.7, 1.1) if manual else rng.uniform(0.25, 0.5)),
        shift_floor=0.0 if manual else float(rng.uniform(0.3, 0.7)),
        upshift=1800.0 * calm * RPM,
        downshift=1150.0 * calm * RPM,
        accessory_power=float(rng.uniform(400.0, 900.0)),
        load_full=float(rng.choice([0.35, 0.8, 0.95, 1.0])),
        load_curvature=float(rng.uniform(-0.10, 0.10)),
        load_speed_slope=float(rng.uniform(-0.10, 0.10)),
        load_smoothing=float(rng.uniform(0.05, 0.25)),
        squat=math.radians(float(rng.uniform(0.14, 0.29))),
        load_pitch=float(rng.uniform(1.0e-5, 3.5e-5)),
        roll_gain=math.radians(float(rng.uniform(0.3, 0.55))),
        pitch_frequency=float(rng.uniform(1.2, 1.6)),
        tyre_slip=float(rng.uniform(0.025, 0.045)),
    )
