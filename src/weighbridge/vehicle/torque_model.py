"""How torque follows from what was recorded: model, timing, dragged engine, second signals."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from weighbridge.arguments import check_choice
from weighbridge.errors import ConfigError
from weighbridge.vehicle.possible import curve, not_negative, positive, within
from weighbridge.vehicle.torque_source import BatteryUse, TorqueSource
from weighbridge.vehicle.torque_sources import MEASURED, TORQUE_SOURCES

EARLIEST_TORQUE: Final = -1.0
"""Delay of the torque below which a vehicle file takes none [s]."""

LATEST_TORQUE: Final = 3.0
"""The same above [s]."""


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
    reported_reference_torque : what 100 % are, as the drives of the calibration reported it [N m]
    reading_step : step in which the drives of the calibration reported the reading [SI]; None where
        they showed none
    engine_efficiency : for "air_flow", shaft over fuel power [-]
    noise : standard deviation of the torque from this source [N m]
    scale_std : relative standard deviation of the scale of a torque that was never calibrated
        [-]; None for that of a data sheet
    load_range, speed_range : what the regression has seen; outside, torque is
        extrapolated and the sample left out ([-], [rad/s])
    charge : highest charge of an engine in the air of the calibration, see
        `weighbridge.vehicle.air.Air.charge` [-]; None where it is not known
    charge_exponent, charge_exponent_std : power of that charge with which the torque at one
        reading grows [-]; None for what is usual of the source
    battery : how that of a drive is read, for stages that see a part of it; in no file
    """

    source: str | None = None
    coefficients: tuple[float, ...] = ()
    coefficient_stds: tuple[float, ...] = ()
    curvature: tuple[float, ...] = ()
    curvature_stds: tuple[float, ...] = ()
    knots: tuple[float, ...] = ()
    knot_slopes: tuple[float, ...] = ()
    reference_torque: float | None = None
    reported_reference_torque: float | None = None
    reading_step: float | None = None
    engine_efficiency: float = 0.33
    noise: float | None = None
    scale_std: float | None = None
    load_range: tuple[float, float] | None = None
    speed_range: tuple[float, float] | None = None
    charge: float | None = None
    charge_exponent: float | None = None
    charge_exponent_std: float | None = None
    battery: BatteryUse | None = None

    def __post_init__(self) -> None:
        if self.source is not None:
            check_choice("torque source", self.source, TORQUE_SOURCES)
        source = self.of_source
        if source.needs_map and len(self.coefficients) == 1:
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
        curve("knots", self.knots, "knot_slopes", self.knot_slopes)
        for name in ("coefficients", "coefficient_stds", "curvature", "curvature_stds"):
            for w in getattr(self, name):
                within(f"one of {name}", w, -1e9, 1e9)
        for w in (*self.knots, *self.knot_slopes):
            within("one of knots and knot_slopes", w, -1e9, 1e9)
        positive("reference_torque", self.reference_torque)
        within("reference_torque", self.reference_torque, 1.0, 1e6, "N m")
        positive("reported_reference_torque", self.reported_reference_torque)
        within("reported_reference_torque", self.reported_reference_torque, 1.0, 1e6, "N m")
        positive("reading_step", self.reading_step)
        within("reading_step", self.reading_step, 1e-12, 1e9)
        positive("noise", self.noise)
        within("noise", self.noise, 1e-15, 1e6, "N m")
        not_negative("scale_std", self.scale_std)
        within("scale_std", self.scale_std, 0.0, 10.0)
        within("charge", self.charge, 0.2, 2.0)
        within("charge_exponent", self.charge_exponent, -3.0, 3.0)
        within("charge_exponent_std", self.charge_exponent_std, 0.0, 3.0)
        if not 0.0 < self.engine_efficiency <= 1.0:
            raise ConfigError(f"engine_efficiency must be in (0, 1], got {self.engine_efficiency}")
        within("engine_efficiency", self.engine_efficiency, 0.01, 1.0)

    @property
    def of_source(self) -> TorqueSource:
        """What its source is: that of a measured torque where none is stated."""
        return TORQUE_SOURCES[self.source or MEASURED]

    @property
    def in_thin_air(self) -> tuple[float, float]:
        """Power of the charge with which the torque grows, and its standard deviation [-]."""
        usual, std = self.of_source.charge_exponent
        if self.charge_exponent is None or std == 0.0:
            return usual, std
        known = self.charge_exponent_std
        return self.charge_exponent, std if known is None else known

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
        within("torque_delay_std", self.torque_delay_std, 0.0, 1_000.0, "s")
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
        curve("engine_speed", self.engine_speed, "level", self.level)
        positive("scatter", self.scatter)
        positive("span", self.span)
        not_negative("reach", self.reach)
        for value in (*self.engine_speed, *self.level, self.scatter, self.span, self.reach):
            within("a number of [dragged]", value, -1e9, 1e9)


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondSignalRelation:
    """How the reading that torque is made from goes with another signal of the same engine.

    With w the second signal and N the engine speed, both over the ends of their ranges, an engine
    reads ``c0 + c1 w + c2 w N + c3 w^2``, and a motor, by the power of its battery over its speed,
    ``c0 + c1 w + c2 / N``.

    Attributes
    ----------
    signal : name of the signal, as in `weighbridge.signals.QUANTITIES`
    coefficients : c0, c1 ... in the unit of the reading
    scatter : standard deviation of the reading about the relation, of means over seconds
    span : range of such means; the unit of both is that of the reading, as `regressor` in
        `weighbridge.vehicle.torque` has it: a share for load, else N m
    scale_std : by how much the scale of reading over second signal differs between drives [-]
    value_range : values of the second signal that the relation has seen, in its own SI unit
    speed_range : engine speeds that it has seen [rad/s]
    lag : by how much the reading is later than the second signal [s]; None where the drives were
        sampled too slowly
    pressure, temperature : of the ambient air [Pa], [K]; None where it was not known
    """

    signal: str
    coefficients: tuple[float, ...]
    scatter: float
    span: float
    scale_std: float
    value_range: tuple[float, float]
    speed_range: tuple[float, float]
    lag: float | None = None
    pressure: float | None = None
    temperature: float | None = None

    def __post_init__(self) -> None:
        check_choice("signal", self.signal, WITNESS_TERMS)
        many = WITNESS_TERMS[self.signal]
        if len(self.coefficients) != many:
            raise ConfigError(
                f"coefficients must be {many} numbers for {self.signal}, "
                f"got {len(self.coefficients)}"
            )
        for value in (*self.coefficients, *self.value_range, *self.speed_range):
            within("a number of a second signal of the engine", value, -1e9, 1e9)
        within("the upper end of speed_range", self.speed_range[1], 1.0, 1e5, "rad/s")
        for name in ("scatter", "span", "scale_std"):
            positive(name, getattr(self, name))
            within(name, getattr(self, name), 1e-15, 1e9)
        within("lag", self.lag, -60.0, 60.0, "s")
        within("pressure", self.pressure, 1e4, 2e5, "Pa")
        within("temperature", self.temperature, 150.0, 400.0, "K")


WITNESS_TERMS: Final[dict[str, int]] = {
    "mass_air_flow": 4,
    "absolute_load": 4,
    "intake_pressure": 4,
    "fuel_rate": 4,
    "engine_load": 4,
    "demanded_torque": 4,
    "battery_current": 3,
}
"""Signals that can be a second signal, and how many coefficients the relation to each has."""
