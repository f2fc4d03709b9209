"""The vehicle: what people write in a vehicle file, checked once, in SI."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Literal

from weighbridge.errors import ConfigError
from weighbridge.vehicle.classes import VEHICLE_CLASSES, VehicleClass
from weighbridge.vehicle.fits import FITS, Fit
from weighbridge.vehicle.road import Road, known_value
from weighbridge.vehicle.torque_source import TorqueSource
from weighbridge.vehicle.torque_sources import MEASURED, TORQUE_SOURCES
from weighbridge.visible import visible

FORMAT_VERSION: Final = 1
"""Version of the vehicle file this program writes and reads."""

Layout = Literal["transverse", "longitudinal"]
Driven = Literal["front", "rear", "all"]


# Angles are written from -180 to 180 or from 0 to 360 degrees [rad].
_TURN: Final = 2.0 * math.pi + 1e-9


_MASSES: Final = (10.0, 1_000_000.0)
"""Masses that may stand in a vehicle file, of any class and with any payload [kg]."""


def _curve(x_name: str, x: tuple[float, ...], y_name: str, y: tuple[float, ...]) -> None:
    """Refuse a curve with other counts of ``x`` and ``y``, or whose ``x`` does not rise."""
    if len(y) != len(x):
        raise ConfigError(f"{y_name} must be as many as {x_name}, {len(x)}, got {len(y)}")
    if any(b <= a for a, b in itertools.pairwise(x)):
        raise ConfigError(f"{x_name} must rise, got {x}")


def _positive(name: str, value: float | None) -> None:
    if value is not None and not (math.isfinite(value) and value > 0.0):
        raise ConfigError(f"{name} must be a positive number, got {value}")


def _not_negative(name: str, value: float | None) -> None:
    if value is not None and not (math.isfinite(value) and value >= 0.0):
        raise ConfigError(f"{name} must be zero or positive, got {value}")


def _within(name: str, value: float | None, low: float, high: float, unit: str = "") -> None:
    """Refuse what no vehicle has, wide enough for any: its powers would be no numbers."""
    if value is not None and not low <= value <= high:
        raise ConfigError(
            f"{name} must be between {low:g} and {high:g}{' ' * bool(unit)}{unit}, got {value:g}"
        )


EARLIEST_TORQUE: Final = -1.0
"""Delay of the torque below which a vehicle file takes none [s]."""

LATEST_TORQUE: Final = 3.0
"""The same above [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Driveline:
    """Constants of one driveline.

    Attributes
    ----------
    gearings : effective gearing ``G = i_t i_d / r`` of gears 1..n, engine angle
        per distance travelled; one value for a single-speed vehicle [1/m]
    gearing_stds : standard deviations of the gearings, same length or empty [1/m]
    engine_inertia, engine_inertia_std : all that turns with the engine or motor
        and its standard deviation [kg m^2]; None where it is not stated, see `Vehicle.road`
    wheel_inertia, wheel_inertia_std : all wheels and what turns with them [kg m^2], likewise
    wheel_radius : effective rolling radius [m]
    layout : how the engine of a car or van lies, "transverse" or "longitudinal"; None where
        it is not known
    driven : which axles are: "front", "rear" or "all"; None where it is not known
    efficiency : wheel over engine power when driving, in (0, 1] [-]; 1 where the
        torque was calibrated at the wheels; None for that of such drivelines, see
        `weighbridge.vehicle.data_sheet.wheel_efficiency`
    speed_scale : indicated over true vehicle speed [-]
    idle_speed : engine idle speed [rad/s]; 0 where it is unknown or the motor stands
    """

    gearings: tuple[float, ...] = ()
    gearing_stds: tuple[float, ...] = ()
    engine_inertia: float | None = None
    engine_inertia_std: float | None = None
    wheel_inertia: float | None = None
    wheel_inertia_std: float | None = None
    wheel_radius: float = 0.31
    layout: Layout | None = None
    driven: Driven | None = None
    efficiency: float | None = None
    speed_scale: float = 1.0
    idle_speed: float = 0.0

    def __post_init__(self) -> None:
        for g in self.gearings:
            _positive("a gearing", g)
            _within("a gearing", g, 0.01, 10_000.0, "per m")
        if list(self.gearings) != sorted(self.gearings, reverse=True):
            raise ConfigError(f"gearings must fall from first to last gear, got {self.gearings}")
        if self.gearing_stds and len(self.gearing_stds) != len(self.gearings):
            raise ConfigError("gearing_stds must be as many as gearings")
        _not_negative("engine_inertia", self.engine_inertia)
        _not_negative("wheel_inertia", self.wheel_inertia)
        _within("engine_inertia", self.engine_inertia, 0.0, 10_000.0, "kg m^2")
        _within("wheel_inertia", self.wheel_inertia, 0.0, 10_000.0, "kg m^2")
        _within("engine_inertia_std", self.engine_inertia_std, 0.0, 10_000.0, "kg m^2")
        _within("wheel_inertia_std", self.wheel_inertia_std, 0.0, 10_000.0, "kg m^2")
        _positive("wheel_radius", self.wheel_radius)
        _within("wheel_radius", self.wheel_radius, 0.05, 3.0, "m")
        _not_negative("idle_speed", self.idle_speed)
        _within("idle_speed", self.idle_speed, 0.0, 1_000.0, "rad/s")
        if self.layout not in (None, "transverse", "longitudinal"):
            raise ConfigError(f"layout must be transverse or longitudinal, got {self.layout!r}")
        if self.driven not in (None, "front", "rear", "all"):
            raise ConfigError(f"driven must be front, rear or all, got {self.driven!r}")
        if self.efficiency is not None and not 0.0 < self.efficiency <= 1.0:
            raise ConfigError(f"efficiency must be in (0, 1], got {self.efficiency}")
        _within("efficiency", self.efficiency, 0.05, 1.0)
        if not 0.8 <= self.speed_scale <= 1.2:
            raise ConfigError(f"speed_scale must be in [0.8, 1.2], got {self.speed_scale}")

    @property
    def single_speed(self) -> bool:
        """Whether there is one fixed gear."""
        return len(self.gearings) == 1


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueModel:
    """How the torque of engine or motor follows from what was recorded.

    Attributes
    ----------
    source : name of one of `weighbridge.vehicle.torque_sources.TORQUE_SOURCES`; None where it is
        not stated, and a measured torque is read
    coefficients : w0, w1 (per unit of load or of air flow torque), then w2, w3 ...
        of rising powers of engine speed in rad/s; for measured and percent
        torque (offset [N m], scale [-]), empty meaning (0, 1), then as well powers of
        engine speed, such as friction that is still in the reading
    coefficient_stds : their standard deviations, same length or empty
    curvature : of load times engine speed [N m s/rad] and of load squared [N m];
        empty for the regression of eq. 49 as printed
    curvature_stds : their standard deviations, same length or empty
    knots : rising engine speeds between which a correction of the torque per load or torque
        read is interpolated; empty for none [rad/s]
    knot_slopes : that correction at the knots, in the unit of w1
    reference_torque : for "percent" where the drive does not carry it [N m]
    engine_efficiency : for "air_flow", shaft over fuel power [-]
    noise : standard deviation of the torque from this source [N m]
    scale_std : relative standard deviation of the scale of a torque that was never calibrated
        [-]; None for that of a data sheet
    load_range, speed_range : what the regression has seen; outside, torque is
        extrapolated and the sample left out ([-], [rad/s])
    """

    source: str | None = None
    coefficients: tuple[float, ...] = ()
    coefficient_stds: tuple[float, ...] = ()
    curvature: tuple[float, ...] = ()
    curvature_stds: tuple[float, ...] = ()
    knots: tuple[float, ...] = ()
    knot_slopes: tuple[float, ...] = ()
    reference_torque: float | None = None
    engine_efficiency: float = 0.33
    noise: float | None = None
    scale_std: float | None = None
    load_range: tuple[float, float] | None = None
    speed_range: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.source is not None and self.source not in TORQUE_SOURCES:
            raise ConfigError(f"torque source must be {TORQUE_SOURCES.names}, got {self.source!r}")
        source = self.of_source
        if source.needs_map and len(self.coefficients) < 2:
            raise ConfigError(
                f"torque source {self.source!r} needs at least two coefficients: "
                "run weighbridge calibrate"
            )
        if source.signed and len(self.coefficients) == 1:
            raise ConfigError(
                f"torque source {self.source!r} takes two coefficients, offset and scale, and "
                "powers of engine speed behind them, or none, got 1"
            )
        if self.coefficient_stds and len(self.coefficient_stds) != len(self.coefficients):
            raise ConfigError("coefficient_stds must be as many as coefficients")
        if len(self.curvature) not in (0, 2):
            raise ConfigError(f"curvature must be two numbers or none, got {self.curvature}")
        if self.curvature_stds and len(self.curvature_stds) != len(self.curvature):
            raise ConfigError("curvature_stds must be as many as curvature")
        _curve("knots", self.knots, "knot_slopes", self.knot_slopes)
        for name in ("coefficients", "coefficient_stds", "curvature", "curvature_stds"):
            for w in getattr(self, name):
                _within(f"one of {name}", w, -1e9, 1e9)
        for w in (*self.knots, *self.knot_slopes):
            _within("one of knots and knot_slopes", w, -1e9, 1e9)
        _positive("reference_torque", self.reference_torque)
        _within("reference_torque", self.reference_torque, 1.0, 1e6, "N m")
        _positive("noise", self.noise)
        _within("noise", self.noise, 1e-15, 1e6, "N m")
        _not_negative("scale_std", self.scale_std)
        _within("scale_std", self.scale_std, 0.0, 10.0)
        if not 0.0 < self.engine_efficiency <= 1.0:
            raise ConfigError(f"engine_efficiency must be in (0, 1], got {self.engine_efficiency}")
        _within("engine_efficiency", self.engine_efficiency, 0.01, 1.0)

    @property
    def of_source(self) -> TorqueSource:
        """What its source is: that of a measured torque where none is stated."""
        return TORQUE_SOURCES[self.source or MEASURED]

    @property
    def stated(self) -> bool:
        """Whether anything is said of the torque beside what 100 % of it are."""
        return replace(self, reference_torque=None) != TorqueModel()

    def scaled(self, scale: float) -> TorqueModel:
        """Return the model that gives ``scale`` times the torque."""
        return replace(
            self,
            coefficients=tuple(scale * w for w in self.coefficients),
            coefficient_stds=tuple(scale * s for s in self.coefficient_stds),
            curvature=tuple(scale * w for w in self.curvature),
            curvature_stds=tuple(scale * s for s in self.curvature_stds),
            knot_slopes=tuple(scale * s for s in self.knot_slopes),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadLoad:
    """Air drag and rolling resistance.

    Attributes
    ----------
    drag_area : drag coefficient times frontal area C_d A [m^2]; None where it is not stated, see
        `Vehicle.road`
    rolling_coefficient : rolling resistance coefficient C_r [-], likewise; at standstill
        where it grows with speed
    rolling_speed_coefficient : its growth with speed [s/m]
    drag_area_std, rolling_coefficient_std : their standard deviations; None where not stated
    """

    drag_area: float | None = None
    rolling_coefficient: float | None = None
    rolling_speed_coefficient: float = 0.0
    drag_area_std: float | None = None
    rolling_coefficient_std: float | None = None

    def __post_init__(self) -> None:
        if self.drag_area is not None and not 0.0 <= self.drag_area < 20.0:
            raise ConfigError(f"drag_area must be in [0, 20) m^2, got {self.drag_area}")
        rolling = self.rolling_coefficient
        if rolling is not None and not 0.0 <= rolling < 0.1:
            raise ConfigError(f"rolling_coefficient must be in [0, 0.1), got {rolling}")
        if not 0.0 <= self.rolling_speed_coefficient < 0.002:
            raise ConfigError(
                "rolling_speed_coefficient must be in [0, 0.002) s/m, "
                f"got {self.rolling_speed_coefficient}"
            )
        _within("drag_area_std", self.drag_area_std, 0.0, 1_000.0, "m^2")
        _within("rolling_coefficient_std", self.rolling_coefficient_std, 0.0, 10.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mounting:
    """How the inertial sensor sits in the vehicle.

    Attributes
    ----------
    roll, pitch, yaw : of the rotation from sensor to body axes (forward, right,
        down), ``x_b = Rz(yaw) Ry(pitch) Rx(roll) x_s`` [rad]
    std : standard deviations of the three [rad]
    squat : pitch of the body per forward acceleration k [rad per m/s^2]
    squat_std : its standard deviation
    """

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    std: tuple[float, float, float] | None = None
    squat: float | None = None
    squat_std: float | None = None

    def __post_init__(self) -> None:
        for name in ("roll", "pitch", "yaw"):
            _within(name, getattr(self, name), -_TURN, _TURN, "rad")
        for std in self.std or ():
            _within("one of std", std, 0.0, _TURN, "rad")
        _within("squat", self.squat, -1.0, 1.0, "rad per m/s^2")
        _within("squat_std", self.squat_std, 0.0, 1.0, "rad per m/s^2")


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """How late each source is: stamp minus the instant the value was true.

    Attributes
    ----------
    torque_delay, torque_delay_std : of torque or engine load [s]; None: to be
        found from the drive
    torque_lag : time constant of the first-order smoothing of torque or load by
        the control unit [s]
    """

    torque_delay: float | None = None
    torque_delay_std: float | None = None
    torque_lag: float = 0.0

    def __post_init__(self) -> None:
        delay = self.torque_delay
        if delay is not None and not EARLIEST_TORQUE <= delay <= LATEST_TORQUE:
            raise ConfigError(
                f"torque_delay must be in [{EARLIEST_TORQUE:g}, {LATEST_TORQUE:g}] s, got {delay}"
            )
        _within("torque_delay_std", self.torque_delay_std, 0.0, 1_000.0, "s")
        if not 0.0 <= self.torque_lag <= 3.0:
            raise ConfigError(f"torque_lag must be in [0, 3] s, got {self.torque_lag}")


@dataclass(frozen=True, slots=True, kw_only=True)
class DraggedReading:
    """What the torque source reads while the engine is dragged, its floor over engine speed.

    Attributes
    ----------
    engine_speed : rising [rad/s]
    level : the floor there, in the unit of the reading
    scatter : standard deviation of readings on the floor
    span : range of the reading from dragged to full
    reach : how far above the floor a dragged engine may read, because it burns idle charge
    """

    engine_speed: tuple[float, ...]
    level: tuple[float, ...]
    scatter: float
    span: float
    reach: float = 0.0

    def __post_init__(self) -> None:
        if not self.level:
            raise ConfigError("level must be one number at least, got none")
        _curve("engine_speed", self.engine_speed, "level", self.level)
        _positive("scatter", self.scatter)
        _positive("span", self.span)
        _not_negative("reach", self.reach)
        for value in (*self.engine_speed, *self.level, self.scatter, self.span, self.reach):
            _within("a number of [dragged]", value, -1e9, 1e9)


@dataclass(frozen=True, slots=True, kw_only=True)
class WitnessRelation:
    """How the reading that torque is made from goes with another signal of the same engine.

    With w the witness and N the engine speed, both over the ends of their ranges, an engine reads
    ``c0 + c1 w + c2 w N + c3 w^2``, and a motor, by the power of its battery over its speed,
    ``c0 + c1 w + c2 / N``.

    Attributes
    ----------
    signal : name of the signal, as in `weighbridge.signals.QUANTITIES`
    coefficients : c0, c1 ... in the unit of the reading
    scatter : standard deviation of the reading about the relation, of means over seconds
    span : range of such means; the unit of both is that of the reading, as `regressor` in
        `weighbridge.vehicle.torque` has it: a share for load, else N m
    scale_std : by how much the scale of reading over witness differs between drives [-]
    value_range : values of the witness that the relation has seen, in its own SI unit
    speed_range : engine speeds that it has seen [rad/s]
    blur, lag : time constant by which the reading is smoother than the witness, and by how much
        it is later [s]; None where the drives were sampled too slowly to tell
    unexplained : part of the variance of single readings that is left then [-]
    pressure, temperature : of the ambient air [Pa], [K]; None where it was not known
    """

    signal: str
    coefficients: tuple[float, ...]
    scatter: float
    span: float
    scale_std: float
    value_range: tuple[float, float]
    speed_range: tuple[float, float]
    blur: float | None = None
    lag: float | None = None
    unexplained: float | None = None
    pressure: float | None = None
    temperature: float | None = None

    def __post_init__(self) -> None:
        if self.signal not in WITNESS_TERMS:
            raise ConfigError(
                f"signal must be one of {', '.join(WITNESS_TERMS)}, got {self.signal!r}"
            )
        many = WITNESS_TERMS[self.signal]
        if len(self.coefficients) != many:
            raise ConfigError(
                f"coefficients must be {many} numbers for {self.signal}, "
                f"got {len(self.coefficients)}"
            )
        for value in (*self.coefficients, *self.value_range, *self.speed_range):
            _within("a number of a witness", value, -1e9, 1e9)
        _within("the upper end of speed_range", self.speed_range[1], 1.0, 1e5, "rad/s")
        for name in ("scatter", "span", "scale_std"):
            _positive(name, getattr(self, name))
            _within(name, getattr(self, name), 1e-15, 1e9)
        _not_negative("blur", self.blur)
        _within("blur", self.blur, 0.0, 60.0, "s")
        _within("lag", self.lag, -60.0, 60.0, "s")
        _within("unexplained", self.unexplained, 0.0, 1.0)
        _within("pressure", self.pressure, 1e4, 2e5, "Pa")
        _within("temperature", self.temperature, 150.0, 400.0, "K")


WITNESS_TERMS: Final[dict[str, int]] = {
    "mass_air_flow": 4,
    "absolute_load": 4,
    "intake_pressure": 4,
    "fuel_rate": 4,
    "engine_load": 4,
    "demanded_torque": 4,
    "battery_current": 3,
}
"""Signals that can be a witness, and how many coefficients the relation to each has."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedModel:
    """Model of ``--method speed-ekf``, in which torque is proportional to speed.

    Attributes
    ----------
    mass : known mass of the drive it was fitted to; the filter starts there [kg]
    sample_time : length of the windows over which speed is averaged [s]
    force_gain : a1, traction force per engine torque [1/m]
    drag : a2, air density times drag area [kg/m]
    rolling_coefficient : f_r; a3 and the angle beta follow from it [-]
    rotating_mass : m_r, what the rotating parts weigh like [kg]
    corrections : p1 to p7 of the fit, in SI
    r_squared : part of the speed's changes that the fit explains [-]
    samples : windows of the fit
    scale_std : relative standard deviation that the model leaves in every mass [-]

    References
    ----------
    Galvão et al., An Extended Kalman Filter implementation for estimating the mass
    of passengers vehicles, eqs. 10-18.
    """

    mass: float
    sample_time: float = 7.0
    force_gain: float
    drag: float
    rolling_coefficient: float = 0.010
    rotating_mass: float
    corrections: tuple[float, ...]
    r_squared: float | None = None
    samples: int | None = None
    scale_std: float

    def __post_init__(self) -> None:
        for name in ("mass", "force_gain", "scale_std"):
            _positive(name, getattr(self, name))
        for name in ("drag", "rotating_mass"):
            _not_negative(name, getattr(self, name))
        _within("mass", self.mass, *_MASSES, "kg")
        _within("rotating_mass", self.rotating_mass, 0.0, _MASSES[1], "kg")
        _within("force_gain", self.force_gain, 1e-6, 1e6, "per m")
        _within("drag", self.drag, 0.0, 1e3, "kg/m")
        _within("scale_std", self.scale_std, 1e-15, 1e3)
        if not 1.0 <= self.sample_time <= 60.0:
            raise ConfigError(f"sample_time must be in [1, 60] s, got {self.sample_time}")
        if not 0.0 <= self.rolling_coefficient < 0.1:
            raise ConfigError(
                f"rolling_coefficient must be in [0, 0.1), got {self.rolling_coefficient}"
            )
        if len(self.corrections) != 7 or not all(math.isfinite(p) for p in self.corrections):
            raise ConfigError(
                f"corrections must be seven numbers, p1 to p7, got {len(self.corrections)}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Ride:
    """Suspension of a two-axle vehicle, and the sensors of its ride.

    Attributes
    ----------
    front_stiffness, rear_stiffness : of the springs at each wheel [N/m]
    front_damping, rear_damping : of the dampers at each wheel [N s/m]
    front_track, rear_track : between left and right wheel [m]
    front_axle, rear_axle : distance from the centre of gravity of the sprung mass [m]
    front_unsprung, rear_unsprung : mass of axle and wheels [kg]
    sprung_mass, roll_inertia, pitch_inertia : roughly, where an estimate begins [kg],
        [kg m^2]
    zero_mass : sprung mass with which the travel sensors read zero at rest [kg]; None
        where it is not known
    force_std : relative standard deviation of what all springs and dampers have in
        common [-]; None where it is not known
    travel_noise, rate_noise : of one sample of a suspension sensor [m], [m/s]
    vertical_velocity_noise : of one sample [m/s]
    roll_rate_noise, pitch_rate_noise : of one sample [rad/s]
    """

    front_stiffness: float = math.nan
    rear_stiffness: float = math.nan
    front_damping: float = math.nan
    rear_damping: float = math.nan
    front_track: float = math.nan
    rear_track: float = math.nan
    front_axle: float = math.nan
    rear_axle: float = math.nan
    front_unsprung: float = math.nan
    rear_unsprung: float = math.nan
    sprung_mass: float = math.nan
    roll_inertia: float = math.nan
    pitch_inertia: float = math.nan
    zero_mass: float | None = None
    force_std: float | None = None
    travel_noise: float = 2e-4
    rate_noise: float = 5e-3
    vertical_velocity_noise: float = 5e-3
    roll_rate_noise: float = 2e-3
    pitch_rate_noise: float = 2e-3

    def __post_init__(self) -> None:
        for name, (low, high, unit) in RIDE_RANGE.items():
            value = getattr(self, name)
            if math.isnan(value):
                raise ConfigError(
                    f"{name} is missing: the ride needs it, between {low:g} and {high:g} {unit}"
                )
            if not low <= value <= high:
                raise ConfigError(
                    f"{name} must be between {low:g} and {high:g} {unit}, got {value:g}"
                )
        _positive("zero_mass", self.zero_mass)
        if self.force_std is not None and not 0.0 <= self.force_std < 1.0:
            raise ConfigError(f"force_std must be in [0, 1), got {self.force_std}")
        for name in ("vertical_velocity_noise", "roll_rate_noise", "pitch_rate_noise"):
            _positive(name, getattr(self, name))
        for name in ("travel_noise", "rate_noise"):
            _not_negative(name, getattr(self, name))


RIDE_RANGE: Final[dict[str, tuple[float, float, str]]] = {
    "front_stiffness": (2e3, 5e6, "N/m"),
    "rear_stiffness": (2e3, 5e6, "N/m"),
    "front_damping": (0.0, 5e5, "N s/m"),
    "rear_damping": (0.0, 5e5, "N s/m"),
    "front_track": (0.3, 5.0, "m"),
    "rear_track": (0.3, 5.0, "m"),
    "front_axle": (0.1, 20.0, "m"),
    "rear_axle": (0.1, 20.0, "m"),
    "front_unsprung": (1.0, 1e4, "kg"),
    "rear_unsprung": (1.0, 1e4, "kg"),
    "sprung_mass": (50.0, 1e5, "kg"),
    "roll_inertia": (5.0, 1e6, "kg m^2"),
    "pitch_inertia": (5.0, 1e7, "kg m^2"),
}
"""What the ride of a road vehicle needs, and between which values it can be: from a light
quadricycle to an overloaded two-axle truck."""


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
    mass_scale_std : relative standard deviation that the calibration leaves in
        every mass weighed with it [-]
    fit_cov : covariance of what was fitted, once the scale of every mass is known: lower
        triangle, row by row, of torque coefficients, curvature, slopes at the knots, drag area,
        rolling coefficient, engine and wheel inertia; empty where it is not known
    notes : free text
    doubts : of the masses of the calibration, told at each weighing
    """

    drives: tuple[str, ...] = ()
    masses: tuple[float, ...] = ()
    date: str | None = None
    r_squared: float | None = None
    residual_std: float | None = None
    samples: int | None = None
    method: str | None = None
    motion: str | None = None
    mass_scale_std: float | None = None
    fit_cov: tuple[float, ...] = ()
    notes: str | None = None
    doubts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        _not_negative("mass_scale_std", self.mass_scale_std)
        _within("mass_scale_std", self.mass_scale_std, 0.0, 1e3)
        for mass in self.masses:
            _within("one of masses", mass, *_MASSES, "kg")
        size = math.isqrt(2 * len(self.fit_cov))
        if size * (size + 1) != 2 * len(self.fit_cov):
            raise ConfigError(
                "fit_cov must be the lower triangle of a square, 1, 3, 6, 10 ... numbers, "
                f"got {len(self.fit_cov)}"
            )
        if self.method is not None and self.method not in FITS:
            *most, last = FITS
            raise ConfigError(f"method must be {', '.join(most)} or {last}, got {self.method!r}")

    @property
    def fit(self) -> Fit | None:
        """What was fitted; None where nothing was, or the file does not say it."""
        return FITS[self.method] if self.method is not None else None

    @property
    def torque_fitted(self) -> bool:
        """Whether a calibration has fitted the torque to drives of known mass."""
        return bool(self.masses) if self.fit is None else self.fit.torque


@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """All that is known of one vehicle; see ``VEHICLE.toml``.

    Attributes
    ----------
    name : for people
    kind : name of one of `weighbridge.vehicle.classes.VEHICLE_CLASSES`
    tare : mass without payload [kg]
    gross : permitted mass [kg]
    mapping : path of a mapping TOML for its logs
    dragged : what the torque source reads without a foot on the accelerator; None where it was
        not calibrated, or its drives did not show it
    witnesses : how that source goes with other signals of the engine, those alone that tell
    speed_model : for ``--method speed-ekf``; None where it was not calibrated
    """

    name: str = "vehicle"
    kind: str = "car"
    tare: float | None = None
    gross: float | None = None
    mapping: str | None = None
    driveline: Driveline = field(default_factory=Driveline)
    torque: TorqueModel = field(default_factory=TorqueModel)
    road_load: RoadLoad = field(default_factory=RoadLoad)
    mounting: Mounting | None = None
    timing: Timing = field(default_factory=Timing)
    dragged: DraggedReading | None = None
    witnesses: tuple[WitnessRelation, ...] = ()
    speed_model: SpeedModel | None = None
    ride: Ride | None = None
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        if self.kind not in VEHICLE_CLASSES:
            raise ConfigError(f"class must be {VEHICLE_CLASSES.names}, got {self.kind!r}")
        for name in ("tare", "gross"):
            _positive(name, getattr(self, name))
            _within(name, getattr(self, name), *_MASSES, "kg")
        signals = [witness.signal for witness in self.witnesses]
        if len(set(signals)) < len(signals):
            raise ConfigError(f"a witness must stand once, got {', '.join(signals)}")
        if self.mapping is not None and visible(self.mapping) != self.mapping:
            raise ConfigError(
                f"mapping must be a path without control characters, got {self.mapping!r}"
            )

    @property
    def of_class(self) -> VehicleClass:
        """What vehicles of its class have in common."""
        return VEHICLE_CLASSES[self.kind]

    @property
    def road(self) -> Road:
        """Road load and inertias it is weighed with: as stated, else as usual for its class."""
        line, load = self.driveline, self.road_load
        stated = (
            (load.drag_area, load.drag_area_std),
            (load.rolling_coefficient, load.rolling_coefficient_std),
            (line.engine_inertia, line.engine_inertia_std),
            (line.wheel_inertia, line.wheel_inertia_std),
        )
        mean, std = self.of_class.road_prior(single_speed=line.single_speed)
        calibrated = self.provenance.mass_scale_std is not None
        return Road(
            *(
                known_value(*said, (float(m), float(s)), calibrated=calibrated)
                for said, m, s in zip(stated, mean, std, strict=True)
            )
        )

    @classmethod
    def load(cls, path: str | Path) -> Vehicle:
        """Read a vehicle file; see `weighbridge.vehicle.file.load_vehicle`."""
        from weighbridge.vehicle.file import load_vehicle

        return load_vehicle(path)

    def save(self, path: str | Path) -> None:
        """Write a vehicle file; see `weighbridge.vehicle.file.save_vehicle`."""
        from weighbridge.vehicle.file import save_vehicle

        save_vehicle(self, path)
