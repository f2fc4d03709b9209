"""What is simulated: car, load, road, weather, sensors, and every effect's size."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace

import numpy as np

from weighbridge.arguments import check_choice, suggestion
from weighbridge.errors import ConfigError
from weighbridge.simulation.car import SimulatedCar
from weighbridge.simulation.route import Route
from weighbridge.simulation.trailer import Trailer


@dataclass(frozen=True, slots=True, kw_only=True)
class Effects:
    """Size of every effect: 1 as vehicle, driver and road have it, 0 switched off.

    Attributes
    ----------
    gusts : gusts and the slow change of the wind; the mean wind is the scenario's
    warm_up : tyres and oil start cold
    tyre_speed : rolling resistance grows with speed
    tyre_temperature : rolling resistance falls with ambient temperature
    surface : rolling resistance differs from road to road
    yaw_drag : side wind raises the drag area
    cornering_drag : tyres drag in bends
    tyre_slip : driven wheels turn faster than the road passes
    side_slip : the rear axle drifts outwards in bends
    accessories : alternator and compressor load the engine
    driveline_loss : gearbox and axle lose torque
    torque_lag : torque follows the pedal late
    shift_gap : torque dips or is interrupted while the gear changes
    load_nonlinearity : the load reading bends away from the torque
    load_smoothing : the control unit smooths the load reading
    brake_drag : released brakes still hold a little
    fuel_burn : the fuel's mass is lost
    driver_ripple : foot and speed of the driver wander
    light_braking : the driver brakes lightly while the engine is dragged
    foot_switch : the foot takes time between accelerator and brake
    overrun_fuel : in overrun the fuel is cut late, and not at low engine speed
    spin_loss : gearbox and axle drag the more the faster they turn, most when cold
    load_curve : the load reading is of the torque there is at that engine speed
    drafting : others ahead shelter from the air
    traffic : others slow the driver down
    squat : the body pitches with the traction
    load_pitch : the body pitches with payload
    roll : the body rolls in bends
    roughness : the road shakes the body
    imu_noise, imu_bias, imu_bias_walk, imu_scale, imu_cross_axis, imu_lever,
    imu_mounting, imu_quantisation, imu_vibration, imu_jitter : errors of the
        inertial sensor
    gnss_white, gnss_correlated, gnss_delay : errors of the fixes
    obd_delay, obd_jitter, obd_quantisation, obd_speed_scale : errors of the
        polled values
    """

    gusts: float = 1.0
    warm_up: float = 1.0
    tyre_speed: float = 1.0
    tyre_temperature: float = 1.0
    surface: float = 1.0
    yaw_drag: float = 1.0
    cornering_drag: float = 1.0
    tyre_slip: float = 1.0
    side_slip: float = 1.0
    accessories: float = 1.0
    driveline_loss: float = 1.0
    torque_lag: float = 1.0
    shift_gap: float = 1.0
    load_nonlinearity: float = 1.0
    load_smoothing: float = 1.0
    brake_drag: float = 1.0
    fuel_burn: float = 1.0
    driver_ripple: float = 1.0
    light_braking: float = 1.0
    foot_switch: float = 1.0
    overrun_fuel: float = 1.0
    spin_loss: float = 1.0
    load_curve: float = 1.0
    drafting: float = 1.0
    traffic: float = 1.0
    squat: float = 1.0
    load_pitch: float = 1.0
    roll: float = 1.0
    roughness: float = 1.0
    imu_noise: float = 1.0
    imu_bias: float = 1.0
    imu_bias_walk: float = 1.0
    imu_scale: float = 1.0
    imu_cross_axis: float = 1.0
    imu_lever: float = 1.0
    imu_mounting: float = 1.0
    imu_quantisation: float = 1.0
    imu_vibration: float = 1.0
    imu_jitter: float = 1.0
    gnss_white: float = 1.0
    gnss_correlated: float = 1.0
    gnss_delay: float = 1.0
    obd_delay: float = 1.0
    obd_jitter: float = 1.0
    obd_quantisation: float = 1.0
    obd_speed_scale: float = 1.0

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ConfigError(f"effect {f.name} must be zero or positive, got {value}")

    @classmethod
    def none(cls) -> Effects:
        """Return a world without any of the effects."""
        return cls(**{f.name: 0.0 for f in fields(cls)})

    @classmethod
    def only(cls, **sizes: float) -> Effects:
        """Return a world with these effects alone."""
        return replace(cls.none(), **sizes)

    def without(self, *names: str) -> Effects:
        """Return these effects with some switched off.

        Raises
        ------
        ConfigError
            There is no effect of that name.
        """
        known = [f.name for f in fields(self)]
        for name in names:
            if name not in known:
                raise ConfigError(f"unknown effect {name!r}{suggestion(name, known)}")
        return replace(self, **dict.fromkeys(names, 0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensors:
    """Inertial sensor and GNSS receiver; error levels of low-cost parts.

    Attributes
    ----------
    imu_rate, gnss_rate : [Hz]; 0 to leave the sensor out
    mounting : (roll, pitch, yaw) of the rotation from sensor to body axes [rad]
    lever : sensor from the turning point at the rear axle, body axes [m]
    accel_noise, gyro_noise : white, per sample [m/s^2], [rad/s]
    accel_bias, gyro_bias : standard deviation at the start [m/s^2], [rad/s]
    accel_walk, gyro_walk : growth of the bias in one hour [m/s^2], [rad/s]
    scale, cross_axis : standard deviations [-]
    accel_step, gyro_step : quantisation [m/s^2], [rad/s]
    vibration : amplitude of engine vibration [m/s^2]
    road_vibration : of tyres and body at 8 to 60 Hz, at 25 m/s: accelerometer and
        gyro, root mean square of the worst axis [m/s^2], [rad/s]
    clock_jitter : of the time stamps [s]
    gnss_noise : white, horizontal and vertical [m]
    gnss_drift : correlated, horizontal and vertical [m]
    gnss_drift_time : correlation times [s]
    gnss_speed_noise : [m/s]
    gnss_delay : how old a fix is when its time is stamped [s]
    gnss_outages : (start, end) of times without fixes [s]

    Notes
    -----
    Noise and bias are those of consumer six-axis sensors such as the MPU-6050
    and BMI160 by their data sheets; GNSS errors are those of a single-frequency
    receiver, see Groves, Principles of GNSS, Inertial and Multisensor
    Integrated Navigation Systems, 2nd ed., 2013, ch. 9.
    """

    imu_rate: float = 200.0
    gnss_rate: float = 1.0
    mounting: tuple[float, float, float] = (0.021, -0.034, 0.042)
    lever: tuple[float, float, float] = (-0.45, 0.25, -0.15)
    accel_noise: float = 0.03
    gyro_noise: float = 9.0e-4
    accel_bias: float = 0.05
    gyro_bias: float = 6.0e-3
    accel_walk: float = 0.015
    gyro_walk: float = 2.0e-4
    scale: float = 0.003
    cross_axis: float = 0.003
    accel_step: float = 9.81 / 8192
    gyro_step: float = math.radians(250.0) / 32768
    vibration: float = 0.05
    road_vibration: tuple[float, float] = (0.25, 0.006)
    clock_jitter: float = 2.0e-4
    gnss_noise: tuple[float, float] = (0.4, 0.8)
    gnss_drift: tuple[float, float] = (2.2, 4.5)
    gnss_drift_time: tuple[float, float] = (80.0, 140.0)
    gnss_speed_noise: float = 0.08
    gnss_delay: float = 0.05
    gnss_outages: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        if not (self.imu_rate == 0.0 or 10.0 <= self.imu_rate <= 200.0):
            raise ConfigError(f"imu_rate must be 0 or in [10, 200] Hz, got {self.imu_rate}")
        if not 0.0 <= self.gnss_rate <= 20.0:
            raise ConfigError(f"gnss_rate must be in [0, 20] Hz, got {self.gnss_rate}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Polling:
    """How values are asked from the control units, one after another.

    Attributes
    ----------
    fast : quantities asked in every round; one named twice is asked twice
    slow : quantities of which one is asked in every tenth round
    rate : rounds per second [Hz]
    delay : how old a value is when its time is stamped, mean [s]
    delay_spread : from quantity to quantity [s]
    delay_jitter : from sample to sample [s]
    speed_scale : indicated over true speed [-]
    speed_rounding : "nearest" or "down" to whole steps
    speed_step, engine_speed_step : resolution of the two [km/h], [rpm]
    net_torque : torque percent is that at the flywheel, as from J1939, not the
        indicated one of OBD
    torque_noise : white noise of load and torque readings, before they are rounded,
        over their value at full torque [-]
    """

    fast: tuple[str, ...] = (
        "vehicle_speed",
        "engine_speed",
        "engine_load",
        "mass_air_flow",
        "lambda_1",
        "throttle",
    )
    slow: tuple[str, ...] = ("ambient_temperature", "barometric_pressure")
    rate: float = 4.0
    delay: float = 0.10
    delay_spread: float = 0.02
    delay_jitter: float = 0.012
    speed_scale: float = 1.008
    speed_rounding: str = "nearest"
    speed_step: float = 1.0
    engine_speed_step: float = 0.25
    net_torque: bool = False
    torque_noise: float = 0.0

    def __post_init__(self) -> None:
        if not 0.2 <= self.rate <= 100.0:
            raise ConfigError(f"poll rate must be in [0.2, 100] Hz, got {self.rate}")
        check_choice("speed_rounding", self.speed_rounding, ("nearest", "down"))
        for name in ("speed_step", "engine_speed_step"):
            if not getattr(self, name) > 0.0:
                raise ConfigError(f"{name} must be positive, got {getattr(self, name)}")
        if not 0.0 <= self.torque_noise <= 1.0:
            raise ConfigError(f"torque_noise must be in [0, 1], got {self.torque_noise}")
        if not self.fast:
            raise ConfigError("polling needs at least one fast quantity, got none")


@dataclass(frozen=True, slots=True, kw_only=True)
class Loading:
    """A stop at which the load changes, while the engine idles.

    Attributes
    ----------
    distance : along the route [m]
    duration : of the stop; the load changes evenly in the middle of it [s]
    load : taken on; negative where it is taken off [kg]
    """

    distance: float
    duration: float
    load: float

    def __post_init__(self) -> None:
        if not 5.0 <= self.duration <= 7200.0:
            raise ConfigError(f"a stop for loading must last 5 to 7200 s, got {self.duration}")
        if not (math.isfinite(self.distance) and math.isfinite(self.load)):
            raise ConfigError(
                "distance and load of a stop for loading must be numbers, "
                f"got {self.distance} m and {self.load} kg"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Braking:
    """Braking at a time, whatever the road is like.

    Attributes
    ----------
    time, duration : since the start [s]
    decel : wanted [m/s^2]
    """

    time: float
    duration: float
    decel: float

    def __post_init__(self) -> None:
        if not (self.time >= 0.0 and self.duration > 0.0 and 0.0 < self.decel <= 8.0):
            raise ConfigError(
                "a braking needs a time, a duration above 0 s and a deceleration in (0, 8] m/s^2, "
                f"got {self.time} s, {self.duration} s and {self.decel} m/s^2"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Habits:
    """What one driver does with the foot, and how near others are; as it stands, nothing of it.

    Attributes
    ----------
    least_braking : deceleration beyond that of the dragged engine from which the driver
        brakes, drawn evenly between two values for each braking [m/s^2]
    touch_rate : how often a foot off the accelerator touches the brake [1/s]
    touch_strength, touch_time : of such touches, means of exponential distributions
        [m/s^2], [s]
    foot_time : of the foot between the pedals, drawn evenly between two values [s]
    both_pedals : chance that the brake is still pressed when the driver accelerates [-]
    following : part of the way outside towns driven behind another vehicle [-]
    shelter : air drag saved there, drawn evenly between two values [-]
    """

    least_braking: tuple[float, float] = (0.3, 0.3)
    touch_rate: float = 0.0
    touch_strength: float = 0.0
    touch_time: float = 0.0
    foot_time: tuple[float, float] = (0.0, 0.0)
    both_pedals: float = 0.0
    following: float = 0.0
    shelter: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name, high in (("least_braking", 2.0), ("foot_time", 2.0), ("shelter", 0.8)):
            low, most = getattr(self, name)
            if not 0.0 <= low <= most <= high:
                raise ConfigError(f"{name} must rise within [0, {high:g}], got {low}, {most}")
        for name, high in (
            ("touch_rate", 5.0),
            ("touch_strength", 2.0),
            ("touch_time", 60.0),
            ("both_pedals", 1.0),
            ("following", 0.9),
        ):
            value = getattr(self, name)
            if not 0.0 <= value <= high:
                raise ConfigError(f"{name} must be in [0, {high:g}], got {value}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """One drive to be simulated.

    Attributes
    ----------
    name : becomes the drive's name
    car, route : what drives where
    payload : at the start, on the vehicle itself, beside driver and fuel [kg]
    trailer : behind it; None without
    loading : stops at which the load changes, rising in distance
    brakings : at times, beside those the road asks for
    seed : of driver, weather and sensors; the route keeps its own
    habits : of the driver
    effects, sensors, polling : see the classes
    wind_speed : mean at 10 m height [m/s]
    wind_from : direction it blows from, clockwise from north [rad]
    gust_std : relative to the mean wind [-]
    ambient_temperature : [K]
    pressure : of the air at the route's start [Pa]
    tyre_factor : of the rolling resistance, for tyre pressure [-]
    slip_factor : of the slip of the driven tyres, for their temperature and the surface [-]
    drag_area_addition : for open windows or a roof box [m^2]
    aggressiveness : of the driver, 1 usual [-]
    calibration : drive every gear, load and engine speed, not just as usual
    start_rest : standing before the start [s]
    duration : end after this time at the latest [s]; None for the whole route
    start_time : ISO 8601

    Notes
    -----
    Wind is reported at 10 m and acts on a car at about 1 m. By the logarithmic
    profile over open country with hedges, roughness length 0.1 m, the car sees
    ln(1 / 0.1) / ln(10 / 0.1) = 0.5 of it, a truck at 1.9 m 0.64, on country
    roads 0.85 and in cities half of that (exposure of the route).
    """

    name: str
    car: SimulatedCar
    route: Route
    payload: float = 0.0
    trailer: Trailer | None = None
    loading: tuple[Loading, ...] = ()
    brakings: tuple[Braking, ...] = ()
    seed: int = 0
    habits: Habits = field(default_factory=Habits)
    effects: Effects = field(default_factory=Effects)
    sensors: Sensors = field(default_factory=Sensors)
    polling: Polling = field(default_factory=Polling)
    wind_speed: float = 3.0
    wind_from: float = math.radians(250.0)
    gust_std: float = 0.25
    ambient_temperature: float = 283.15
    pressure: float = 101_325.0
    tyre_factor: float = 1.0
    slip_factor: float = 1.0
    drag_area_addition: float = 0.0
    aggressiveness: float = 1.0
    calibration: bool = False
    start_rest: float = 25.0
    duration: float | None = None
    start_time: str = "2021-03-05T10:30:00+01:00"

    def __post_init__(self) -> None:
        payload = self.payload
        for load in (0.0, *(stop.load for stop in self.loading)):
            payload += load
            if not -0.5 * self.car.mass < payload < 2.0 * self.car.mass:
                raise ConfigError(f"payload must suit a car of {self.car.mass} kg, got {payload}")
        places = [150.0, *(stop.distance for stop in self.loading), self.route.length - 50.0]
        if self.loading and min(np.diff(places)) < 20.0:
            raise ConfigError(
                "stops for loading must rise in distance, 20 m apart, and lie between 170 m and "
                f"70 m before the end of the route of {self.route.length:.0f} m, "
                f"got {', '.join(f'{x:g}' for x in places[1:-1])}"
            )
        for name, low, high in (
            ("wind_speed", 0.0, 40.0),
            ("wind_from", -2.0 * math.pi, 2.0 * math.pi),
            ("ambient_temperature", 223.0, 333.0),
            ("pressure", 6e4, 1.1e5),
            ("tyre_factor", 0.1, 5.0),
            ("slip_factor", 0.1, 5.0),
            ("aggressiveness", 0.3, 3.0),
            ("start_rest", 0.0, 3600.0),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ConfigError(f"{name} must be in [{low:g}, {high:g}], got {value}")
        if self.duration is not None and not self.duration >= 10.0:
            raise ConfigError(f"duration must be at least 10 s, got {self.duration}")

    @property
    def mass(self) -> float:
        """Mass at the start: car, driver, fuel, payload and trailer [kg]."""
        return self.car.mass + self.payload + (self.trailer.mass if self.trailer else 0.0)

    @property
    def carried(self) -> float:
        """What of it the vehicle's own wheels carry at the start [kg]."""
        hitch = self.trailer.hitch_load * self.trailer.mass if self.trailer else 0.0
        return self.car.mass + self.payload + hitch

    def streams(self) -> dict[str, np.random.Generator]:
        """Return a random stream for each part of the simulation, so that none moves another."""
        names = ("plan", "drive", "road", "imu", "gnss", "obd", "habits")
        children = np.random.SeedSequence(self.seed).spawn(len(names))
        return {n: np.random.default_rng(c) for n, c in zip(names, children, strict=True)}
