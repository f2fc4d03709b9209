"""How the experiment of Nguyen 2024 is read and run: cases, and what may be changed of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.errors import ConfigError
from weighbridge.inertia import InertiaSettings, InertiaTrack, Method
from weighbridge.signals import Floats
from weighbridge.simulation import RideSensors, RideVehicle, SimulatedRide
from weighbridge.vehicle import Ride
from weighbridge.vehicle.possible import positive


@dataclass(frozen=True, slots=True, kw_only=True)
class RideResult:
    """One run against its truth; arrays (3,) are of the three axes.

    Attributes
    ----------
    rmse : [kg], [kg m^2]
    mape : [-]
    settled, near : (3, 3) time after the start and each change (rows) from which the estimate
        stays within 5 % and within 10 % until the next change [s]
    velocity_rmse : [m/s], [rad/s]
    velocity_mape : [-]
    """

    rmse: Floats
    mape: Floats
    settled: Floats
    near: Floats
    velocity_rmse: Floats
    velocity_mape: Floats


def suspension_of(truck: RideVehicle, sensors: RideSensors, start: float = 1.0) -> Ride:
    """Say what is known of a simulated vehicle: all but its load.

    Parameters
    ----------
    truck
    sensors : whose noise is known
    start : where the estimate begins, over the truck's parameters [-]
    """
    vertical, roll, pitch = sensors.body_noise
    return Ride(
        front_stiffness=truck.stiffness[0],
        rear_stiffness=truck.stiffness[2],
        front_damping=truck.damping[0],
        rear_damping=truck.damping[2],
        front_track=truck.track[0],
        rear_track=truck.track[1],
        front_axle=truck.axle_distance[0],
        rear_axle=truck.axle_distance[1],
        front_unsprung=truck.unsprung_mass[0],
        rear_unsprung=truck.unsprung_mass[1],
        sprung_mass=start * truck.sprung_mass,
        roll_inertia=start * truck.roll_inertia,
        pitch_inertia=start * truck.pitch_inertia,
        force_std=0.0,
        travel_noise=sensors.travel_noise,
        rate_noise=sensors.rate_noise,
        vertical_velocity_noise=vertical,
        roll_rate_noise=roll,
        pitch_rate_noise=pitch,
    )


def judge(made: SimulatedRide, track: InertiaTrack) -> RideResult:
    """Compare a run with its truth, eq. 10."""
    error = track.parameters - made.inertias
    relative = np.abs(error / made.inertias)
    slip = track.velocity - made.velocities
    return RideResult(
        rmse=np.sqrt(np.mean(error**2, axis=0)),
        mape=np.mean(relative, axis=0),
        settled=_settled(made, track.time, relative, 0.05),
        near=_settled(made, track.time, relative, 0.10),
        velocity_rmse=np.sqrt(np.mean(slip**2, axis=0)),
        velocity_mape=np.mean(np.abs(slip / made.velocities), axis=0),
    )


def _settled(made: SimulatedRide, time: Floats, relative: Floats, band: float) -> Floats:
    """Time after the start and each change from which errors (n, 3) stay within a band (3, 3)."""
    edges = np.searchsorted(time, (0.0, *(t for t, _ in made.scenario.changes), np.inf))
    settled = np.zeros((3, 3))
    for k in range(3):
        a, b = edges[k], edges[k + 1]
        outside = relative[a:b] > band
        # Samples until the last one outside, that one counted.
        count = np.where(outside.any(axis=0), b - a - np.argmax(outside[::-1], axis=0), 0)
        settled[k] = count / made.scenario.sensors.rate
    return settled


CHANGES: Final = ((7.0, 1.5), (14.0, 0.5))
"""Times and factors on the nominal parameters, sec. 4 [s], [-]."""

DURATION: Final = 20.0
"""Chosen: the text names no end [s]."""

SPEED: Final = 60.0 / 3.6
"""Chosen: none is given, and so a truck goes on a road of class C [m/s]."""

START: Final = 2.0
"""Where the estimate begins, over the nominal parameters, sec. 4 [-]."""

SHAKE: Final = 1e-3
"""Process noise w of sec. 4, read as standard deviation of accelerations [m/s^2], [rad/s^2]."""

NOISE: Final = (1e-3, 1e-4, 1e-4)
"""Measurement noise v of sec. 4, read as standard deviation of a sample [m/s], [rad/s]."""

RATE: Final = 1000.0
"""Chosen, for Simulink's continuous time [Hz]."""

AS_PRINTED: Final = InertiaSettings(offset_std=0.0)
"""No offset of the sensors and no weight in them, as the paper's model has none."""


PAPERS_SENSORS: Final = RideSensors(rate=RATE, travel_noise=0.0, rate_noise=0.0, body_noise=NOISE)
"""The suspension is measured without noise: its signals are the simulation's own outputs."""


@dataclass(frozen=True, slots=True)
class Case:
    """One way to read and run the experiment.

    Attributes
    ----------
    name : for people
    method : filter
    settings : of the filter
    sensors : what is measured
    noise_scale : R over the printed one, with Q and R as densities; None for other Q and R
    """

    name: str
    method: Method = "kalman-bucy"
    settings: InertiaSettings = AS_PRINTED
    sensors: RideSensors = PAPERS_SENSORS
    noise_scale: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """What the paper varies, in each case that differs from its experiment elsewhere.

    Attributes
    ----------
    filter : of the paper's model
    body_noise : spectral densities of the body's measured rates, where a case has no others
        [m^2/s], [rad^2 s]
    printed_process, printed_noise : Q and R of the case that has them as printed
    speed : of the truck [m/s]
    start : where the estimates begin, over the nominal parameters [-]
    change_times, change_factors : when the parameters step [s], and to what of the nominal [-]
    shake : process noise, standard deviation of accelerations [m/s^2], [rad/s^2]
    """

    filter: InertiaSettings = AS_PRINTED
    body_noise: tuple[float, float, float] = NOISE
    printed_process: tuple[float, float, float, float, float, float] = (1.0,) * 6
    printed_noise: tuple[float, float, float] = (5e-5, 5e-4, 5e-4)
    speed: float = SPEED
    start: float = START
    change_times: tuple[float, float] = (CHANGES[0][0], CHANGES[1][0])
    change_factors: tuple[float, float] = (CHANGES[0][1], CHANGES[1][1])
    shake: float = SHAKE

    def __post_init__(self) -> None:
        for name in ("speed", "start"):
            positive(name, getattr(self, name))
        first, second = self.change_times
        if not 0.0 < first < second < DURATION:
            raise ConfigError(
                f"change_times must rise within the {DURATION:g} s of the run, "
                f"got {first:g} and {second:g}"
            )

    @property
    def changes(self) -> tuple[tuple[float, float], ...]:
        """Times and factors of the steps."""
        return tuple(zip(self.change_times, self.change_factors, strict=True))

    def of(self, case: Case) -> Case:
        """Return the case with these values in place of the paper's."""
        changed = case
        if case.settings == AS_PRINTED:
            changed = replace(changed, settings=self.filter)
        if case.sensors == PAPERS_SENSORS:
            sensors = replace(PAPERS_SENSORS, body_noise=self.body_noise)
            changed = replace(changed, sensors=sensors)
        if case.noise_scale is not None:
            noise = tuple(case.noise_scale * r for r in self.printed_noise)
            own = replace(AS_PRINTED, process_densities=self.printed_process, noise_densities=noise)
            changed = replace(changed, settings=own)
        return changed


PAPERS_CASE: Final = Case("inverse form, with hypotheses of jumps")

PRINTED_NOISE: Final = Case("extended, Q and R as printed", "extended", noise_scale=1.0)
"""Q = I, of which five are printed and six needed, and R, sec. 4, as spectral densities."""

LOWER_NOISE: Final = Case("extended, Q as printed, R a hundredth", "extended", noise_scale=0.01)
HIGHER_NOISE: Final = Case("extended, Q as printed, R a hundred times", "extended", noise_scale=1e2)
"""The lower R over Q, the faster and calmer by sec. 4.1."""

AS_VARIANCE: Final = Case(
    "with jumps, noise read as variance",
    sensors=replace(PAPERS_SENSORS, body_noise=(NOISE[0] ** 0.5, NOISE[1] ** 0.5, NOISE[2] ** 0.5)),
)

ORDINARY_SENSORS: Final = Case("with jumps, ordinary sensors at 500 Hz", sensors=RideSensors())

INVERSE: Final = Case("inverse form, one fixed process noise", "inverse")
EXTENDED: Final = Case("extended, one fixed process noise", "extended")
AS_IN_PRINT: Final = Case("as printed, A_02 = 0 and Q and R", "printed", noise_scale=1.0)

CASES: Final = (
    PAPERS_CASE,
    INVERSE,
    EXTENDED,
    PRINTED_NOISE,
    LOWER_NOISE,
    HIGHER_NOISE,
    AS_IN_PRINT,
    Case("with jumps, offsets of all sensors unknown", settings=InertiaSettings()),
    AS_VARIANCE,
    ORDINARY_SENSORS,
)
"""The paper's experiment first, then what changes with filter and noise."""
