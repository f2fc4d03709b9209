"""A two-axle vehicle that bounces, rolls and pitches on a rough road: 7 degrees of freedom.

Nguyen, Real-time estimation of vehicle inertia parameters based on Kalman-Bucy filter,
Transport and Communications Science Journal 75(4), 2024, eqs. 1-5 and Table 1, with the
pitch turned to nose up.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, get_args

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.special import k1

from weighbridge.arguments import check_choice
from weighbridge.constants import GRAVITY
from weighbridge.errors import ConfigError
from weighbridge.io.write import TableFormat, write_drive
from weighbridge.kernels import ride as kernel
from weighbridge.signals import Drive, DriveInfo, Floats, Signal

ROUGHNESS: Final[dict[str, float]] = {c: 16e-6 * 4.0**k for k, c in enumerate("ABCDEFGH")}
"""Geometric mean of the displacement spectrum at 0.1 cycles/m, by class [m^3] (ISO 8608,
annex B, table for G_d(n_0))."""

REFERENCE: Final = 0.1
"""Reference spatial frequency n_0 [cycles/m]."""

BAND: Final = (0.011, 2.83)
"""Spatial frequencies of the standard [cycles/m]; the road has no others."""

_STEP: Final = 0.05
"""Distance between points of the profile [m]: seven to the shortest wave of `BAND`."""


@dataclass(frozen=True, slots=True)
class RideRoad:
    """Height of two tracks along the road.

    Attributes
    ----------
    left, right : height over distance [m]
    length : distance for which they are drawn; they repeat after it [m]
    """

    left: CubicSpline
    right: CubicSpline
    length: float


def coherence(frequency: Floats, track: float) -> Floats:
    """Cross spectrum of two parallel tracks over the spectrum of one [-].

    For an isotropic surface whose spectrum falls with the square of the
    frequency it is ``x K_1(x)`` with ``x = 2 pi n b``.

    Parameters
    ----------
    frequency : (n,) spatial frequency, above zero [cycles/m]
    track : distance between the tracks [m]

    References
    ----------
    Kamash and Robson, The application of isotropy in road surface modelling,
    Journal of Sound and Vibration 57(1), 1978.
    """
    x = 2.0 * math.pi * np.asarray(frequency) * track
    return np.asarray(x * k1(x))


def draw_road(
    road_class: str, length: float, track: float, random: np.random.Generator
) -> RideRoad:
    """Draw a road of one class.

    Both tracks have the spectrum ``G(n) = G(n_0) (n / n_0)^-2`` over `BAND`
    and Gaussian heights.

    Parameters
    ----------
    road_class : "A" (very good) to "H"
    length : at least so long [m]
    track : distance between left and right wheels [m]
    random : where it is drawn from

    Raises
    ------
    ConfigError
        There is no such class.
    """
    check_choice("road class", road_class.upper(), ROUGHNESS)
    roughness = ROUGHNESS[road_class.upper()]
    # Two of the longest waves at least, for the spectrum to have lines there.
    points = math.ceil(max(length, 2.0 / BAND[0]) / _STEP)
    frequency = np.fft.rfftfreq(points, _STEP)
    inside = (frequency >= BAND[0]) & (frequency <= BAND[1])
    n = np.asarray(frequency[inside], dtype=np.float64)
    # Variance of a line of the one-sided spectrum, carried by two Gaussians.
    amplitude = np.sqrt(roughness * (n / REFERENCE) ** -2.0 / (points * _STEP))
    likeness = coherence(n, track)
    lines = amplitude * (random.normal(size=(2, n.size)) + 1j * random.normal(size=(2, n.size)))
    mean = np.sqrt(0.5 * (1.0 + likeness)) * lines[0]
    half = np.sqrt(0.5 * (1.0 - likeness)) * lines[1]
    tracks = []
    for chosen in (mean + half, mean - half):
        spectrum = np.zeros(frequency.size, dtype=complex)
        spectrum[inside] = 0.5 * points * chosen
        height = np.fft.irfft(spectrum, points)
        grid = np.arange(points + 1) * _STEP
        tracks.append(CubicSpline(grid, np.append(height, height[0]), bc_type="periodic"))
    return RideRoad(tracks[0], tracks[1], points * _STEP)


log = logging.getLogger(__name__)

WHEELS: Final = ("fl", "fr", "rl", "rr")
"""Order of the four wheels everywhere."""

INPUTS: Final = (
    *(f"suspension_travel_{w}" for w in WHEELS),
    *(f"suspension_rate_{w}" for w in WHEELS),
)
OUTPUTS: Final = ("vertical_velocity", "roll_rate", "pitch_rate")

SETTLING: Final = 6.0
"""Time on the road before the recording begins: ten periods of the body [s]."""

ONSET: Final = 0.4
"""Time in which a manoeuvre begins and ends [s]: a brake's rise and a quick turn of the wheel."""

_LONGEST_STEP: Final = 5e-4
"""Step of the simulation at most [s]: the shortest wave of a road lasts 25 at 100 km/h."""

Four = tuple[float, float, float, float]
_ONES: Final = (1.0, 1.0, 1.0, 1.0)
_ZEROS: Final = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class RideVehicle:
    """Masses, springs and dampers of a vehicle with two solid axles.

    Attributes
    ----------
    sprung_mass : [kg]
    roll_inertia, pitch_inertia : of the sprung mass about its centre [kg m^2]
    unsprung_mass : front and rear [kg]
    axle_inertia : in roll, front and rear [kg m^2]
    stiffness, damping : of the suspension at each wheel [N/m], [N s/m]
    tyre_stiffness : at each wheel [N/m]
    axle_distance : of front and rear axle from the centre of gravity [m]
    track : between left and right wheel, front and rear [m]
    """

    sprung_mass: float
    roll_inertia: float
    pitch_inertia: float
    unsprung_mass: tuple[float, float]
    axle_inertia: tuple[float, float]
    stiffness: Four
    damping: Four
    tyre_stiffness: Four
    axle_distance: tuple[float, float]
    track: tuple[float, float]

    @property
    def mass(self) -> float:
        """Sprung and unsprung mass [kg]."""
        return self.sprung_mass + sum(self.unsprung_mass)

    @property
    def corners(self) -> Floats:
        """(4, 3) height of the body above each wheel per heave, roll and pitch."""
        (front, rear), (a, b) = self.axle_distance, (0.5 * t for t in self.track)
        return np.array([[1, a, front], [1, -a, front], [1, b, -rear], [1, -b, -rear]])

    @property
    def axles(self) -> Floats:
        """(4, 4) height of each wheel per heave and roll of the two axles."""
        a, b = (0.5 * t for t in self.track)
        return np.array([[1, 0, a, 0], [1, 0, -a, 0], [0, 1, 0, b], [0, 1, 0, -b]])

    @property
    def inertias(self) -> Floats:
        """(3,) sprung mass, roll and pitch inertia."""
        return np.array([self.sprung_mass, self.roll_inertia, self.pitch_inertia])

    def loaded(self, factor: float) -> RideVehicle:
        """Return the vehicle with all three sprung parameters times ``factor``."""
        return replace(
            self,
            sprung_mass=factor * self.sprung_mass,
            roll_inertia=factor * self.roll_inertia,
            pitch_inertia=factor * self.pitch_inertia,
        )


TRUCK: Final = RideVehicle(
    sprung_mass=5394.0,
    roll_inertia=4600.0,
    pitch_inertia=19632.0,
    unsprung_mass=(266.0, 427.0),
    # Not printed: wheels at the ends and a light tube between them have a radius of gyration of
    # 0.8 of half the track.
    axle_inertia=(266.0 * (0.8 * 0.8525) ** 2, 427.0 * (0.8 * 0.7475) ** 2),
    stiffness=(177000.0, 177000.0, 193844.0, 193844.0),
    damping=(7733.0, 7733.0, 9804.0, 9804.0),
    tyre_stiffness=(493211.0, 493211.0, 986422.0, 986422.0),
    axle_distance=(2.400, 1.685),
    track=(1.705, 1.495),
)
"""The truck of Table 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RideSensors:
    """What the logger records; noise is white from sample to sample.

    Attributes
    ----------
    rate : of all signals [Hz]
    travel_noise, rate_noise : of each suspension sensor [m], [m/s]
    body_noise : of vertical, roll and pitch velocity [m/s], [rad/s]
    travel_offset : added at each wheel [m]
    travel_factor : on travel and its rate at each wheel [-]
    """

    rate: float = 500.0
    travel_noise: float = 2e-4
    rate_noise: float = 5e-3
    body_noise: tuple[float, float, float] = (5e-3, 2e-3, 2e-3)
    travel_offset: Four = _ZEROS
    travel_factor: Four = _ONES


@dataclass(frozen=True, slots=True, kw_only=True)
class RideScenario:
    """One ride to simulate.

    Attributes
    ----------
    vehicle : at the start
    road_class : "A" to "H"
    speed : [m/s]
    duration : [s]
    changes : times and factors: from each time on, the sprung parameters are those
        of ``vehicle`` times the factor [s], [-]
    zero_mass : sprung mass with which the travel sensors read zero at rest [kg]; None
        where they read zero at the equilibrium of every load, as in the paper
    manoeuvres : begin, end, forward and rightward acceleration of braking, starting and
        turning, each reached within `ONSET` [s], [m/s^2]
    height : of the sprung mass's centre above the road, on which they act [m]
    shake : standard deviation of a random acceleration of every degree of freedom,
        held over a step [m/s^2], [rad/s^2]
    sensors : what is recorded
    seed : of road and noise
    """

    vehicle: RideVehicle = TRUCK
    road_class: str = "C"
    speed: float = 60.0 / 3.6
    duration: float = 60.0
    changes: tuple[tuple[float, float], ...] = ()
    zero_mass: float | None = None
    manoeuvres: tuple[tuple[float, float, float, float], ...] = ()
    height: float = 1.2
    shake: float = 0.0
    sensors: RideSensors = field(default_factory=RideSensors)
    seed: int = 1

    def __post_init__(self) -> None:
        for name in ("speed", "duration"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ConfigError(f"{name} of a ride must be positive, got {value}")
        if not 20.0 <= self.sensors.rate <= 10_000.0:
            raise ConfigError(
                f"rate of a ride's sensors must be in [20, 10000] Hz, got {self.sensors.rate}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedRide:
    """A ride with its truth.

    Attributes
    ----------
    scenario : what was simulated
    drive : what was recorded
    time : (n,) of the samples [s]
    inertias : (n, 3) true sprung mass, roll and pitch inertia [kg], [kg m^2]
    inputs : (n, 8) true travel and rate at the wheels [m], [m/s]
    velocities : (n, 3) true vertical, roll and pitch velocity [m/s], [rad/s]
    """

    scenario: RideScenario
    drive: Drive
    time: Floats
    inertias: Floats
    inputs: Floats
    velocities: Floats

    def write(self, folder: Path, *, format: TableFormat = "parquet") -> None:
        """Write ``ride`` and ``truth`` tables and ``drive.toml`` into a folder."""
        check_choice("format", format, get_args(TableFormat))
        columns = {
            "time_s": self.time,
            "sprung_mass_kg": self.inertias[:, 0],
            "roll_inertia_kgm2": self.inertias[:, 1],
            "pitch_inertia_kgm2": self.inertias[:, 2],
            "vertical_velocity_mps": self.velocities[:, 0],
            "roll_rate_radps": self.velocities[:, 1],
            "pitch_rate_radps": self.velocities[:, 2],
        }
        write_drive(self.drive, folder, format, truth=columns)


def system(
    vehicle: RideVehicle, zero_mass: float | None, height: float = 0.0
) -> tuple[Floats, Floats]:
    """State space of the vehicle on a road.

    Parameters
    ----------
    vehicle
    zero_mass, height : see `RideScenario`

    Returns
    -------
    a : (14, 14) of the state (heave, roll, pitch, two axles' heave, two axles' roll, and
        their rates)
    b : (14, 7) of the road under the four wheels, of a constant one for the weight, and of
        forward and rightward acceleration

    References
    ----------
    Nguyen 2024, eqs. 4 and 5.
    """
    body, axles = vehicle.corners, vehicle.axles
    relative = np.hstack((body, -axles))
    wheels = np.hstack((np.zeros((4, 3)), axles))
    suspension, damper = np.diag(vehicle.stiffness), np.diag(vehicle.damping)
    tyre = np.diag(vehicle.tyre_stiffness)
    stiffness = relative.T @ suspension @ relative + wheels.T @ tyre @ wheels
    damping = relative.T @ damper @ relative
    mass = np.concatenate((vehicle.inertias, vehicle.unsprung_mass, vehicle.axle_inertia))
    a = np.zeros((14, 14))
    a[:7, 7:] = np.eye(7)
    a[7:, :7] = -stiffness / mass[:, np.newaxis]
    a[7:, 7:] = -damping / mass[:, np.newaxis]
    b = np.zeros((14, 7))
    b[7:, :4] = wheels.T @ tyre / mass[:, np.newaxis]
    if zero_mass is not None:
        b[7, 4] = -GRAVITY * (vehicle.sprung_mass - zero_mass) / vehicle.sprung_mass
    # Tyres push at the road: the body's nose rises when starting, its left side sinks in a
    # right-hand turn.
    b[8, 6] = -vehicle.sprung_mass * height / vehicle.roll_inertia
    b[9, 5] = vehicle.sprung_mass * height / vehicle.pitch_inertia
    return a, b


def discrete(a: Floats, b: Floats, step: float) -> tuple[Floats, Floats, Floats]:
    """Exact step of ``x' = a x + b q`` where q is linear in time within it.

    Returns
    -------
    transition : (n, n)
    old, new : (n, w) of q at the start and at the end of the step

    References
    ----------
    Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Automat.
    Contr. 23(3), 1978.
    """
    n, w = b.shape
    block = np.zeros((n + 2 * w, n + 2 * w))
    block[:n, :n] = a * step
    block[:n, n : n + w] = b * step
    block[n : n + w, n + w :] = np.eye(w)
    whole = expm(block)
    constant, slope = whole[:n, n : n + w], whole[:n, n + w :]
    return whole[:n, :n], constant - slope, slope


def simulate_ride(scenario: RideScenario) -> SimulatedRide:
    """Simulate one ride.

    The rear wheels run over what the front wheels ran over, later by wheelbase
    over speed; both axles use the mean of the two tracks.

    Returns
    -------
    SimulatedRide
        The same for the same scenario, to the last bit.

    Raises
    ------
    ConfigError
        There is no such road class.
    """
    sensors, truck = scenario.sensors, scenario.vehicle
    seeds = np.random.SeedSequence(scenario.seed).spawn(3)
    road_random, shake_random, noise_random = (np.random.default_rng(s) for s in seeds)
    every = max(1, math.ceil(1.0 / (sensors.rate * _LONGEST_STEP)))
    step = 1.0 / (sensors.rate * every)
    samples = round(scenario.duration * sensors.rate) + 1
    warm = round(SETTLING * sensors.rate) * every
    rows = warm + (samples - 1) * every + 1
    time = (np.arange(rows) - warm) * step

    heights = _heights(scenario, rows, step, road_random)
    heights[:, 5:] = _pushes(scenario, rows, step, warm)
    factors = np.array([1.0, *(f for _, f in scenario.changes)])
    begins = np.array([t for t, _ in scenario.changes])
    # A change on a sample holds from that sample on, whatever the last bit of its time.
    part = np.searchsorted(begins, time + 0.5 * step, side="right")
    systems = [system(truck.loaded(f), scenario.zero_mass, scenario.height) for f in factors]
    steps = [discrete(a, b, step) for a, b in systems]
    push = np.zeros((rows, 14))
    if scenario.shake > 0.0:
        push[:, 7:] = scenario.shake * step * shake_random.normal(size=(rows, 7))
    a0, b0 = systems[0]
    transition, old_road, new_road = (np.ascontiguousarray([s[k] for s in steps]) for k in range(3))
    states = kernel.run(
        np.linalg.solve(a0, -b0[:, 4]),
        transition,
        old_road,
        new_road,
        part.astype(np.int64),
        heights,
        push,
        every,
    )[warm // every :]

    relative = np.hstack((truck.corners, -truck.axles))
    inputs = np.hstack((states[:, :7] @ relative.T, states[:, 7:] @ relative.T))
    velocities = np.ascontiguousarray(states[:, 7:10])
    clock = np.arange(samples) / sensors.rate
    recorded = _seen(inputs, velocities, sensors, noise_random)
    info = DriveInfo(
        vehicle="two-axle truck (simulated)",
        mass=truck.mass if not scenario.changes else None,
        notes=f"simulated, road class {scenario.road_class.upper()}, "
        f"{3.6 * scenario.speed:.0f} km/h, seed {scenario.seed}",
    )
    signals = {
        name: Signal(name, clock, np.ascontiguousarray(recorded[:, k]))
        for k, name in enumerate((*INPUTS, *OUTPUTS))
    }
    log.info("simulated a ride of %.0f s on class %s", scenario.duration, scenario.road_class)
    return SimulatedRide(
        scenario=scenario,
        drive=Drive("ride", signals, info),
        time=clock,
        inertias=truck.inertias * factors[part[warm::every], np.newaxis],
        inputs=inputs,
        velocities=velocities,
    )


def _heights(scenario: RideScenario, rows: int, step: float, random: np.random.Generator) -> Floats:
    """(n, 7) of the road under the four wheels [m]; ones in the other columns."""
    truck = scenario.vehicle
    wheelbase = sum(truck.axle_distance)
    road = draw_road(
        scenario.road_class,
        scenario.speed * (rows * step) + wheelbase,
        0.5 * sum(truck.track),
        random,
    )
    under_front = scenario.speed * np.arange(rows) * step + wheelbase
    heights = np.ones((rows, 7))
    for wheel, behind in enumerate((0.0, 0.0, wheelbase, wheelbase)):
        track = road.right if wheel % 2 else road.left
        heights[:, wheel] = track(under_front - behind)
    return heights


def _pushes(scenario: RideScenario, rows: int, step: float, warm: int) -> Floats:
    """(n, 2) forward and rightward acceleration [m/s^2]."""
    time = (np.arange(rows) - warm) * step
    found = np.zeros((rows, 2))
    for begin, end, forward, rightward in scenario.manoeuvres:
        share = np.interp(time, (begin, begin + ONSET, end, end + ONSET), (0.0, 1.0, 1.0, 0.0))
        found += share[:, np.newaxis] * (forward, rightward)
    return found


def _seen(
    inputs: Floats, velocities: Floats, sensors: RideSensors, random: np.random.Generator
) -> Floats:
    """(n, 11) what the sensors say."""
    noise = np.repeat((sensors.travel_noise, sensors.rate_noise), 4)
    factor = np.tile(sensors.travel_factor, 2)
    offset = np.concatenate((sensors.travel_offset, np.zeros(4)))
    seen = factor * inputs + offset + noise * random.normal(size=inputs.shape)
    body = velocities + np.array(sensors.body_noise) * random.normal(size=velocities.shape)
    return np.hstack((seen, body))
