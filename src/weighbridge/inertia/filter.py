"""Sprung mass, roll inertia and pitch inertia from the ride, by Kalman-Bucy filters.

Nguyen, Real-time estimation of vehicle inertia parameters based on Kalman-Bucy filter,
Transport and Communications Science Journal 75(4), 2024. The method ``kalman-bucy`` is the
inverse form with hypotheses of jumps; ``inverse``, ``extended`` and ``printed`` are the
paper's filter with one fixed process noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from scipy.special import ndtri

from weighbridge.arguments import as_floats, check_number, check_type, suggestion
from weighbridge.errors import ConfigError
from weighbridge.inertia.settings import InertiaSettings
from weighbridge.kernels import inertia as kernel
from weighbridge.kernels import kalman_bucy
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle import Ride

Method = Literal["kalman-bucy", "inverse", "extended", "printed"]
METHODS: Final[tuple[Method, ...]] = ("kalman-bucy", "inverse", "extended", "printed")
"""Filters by name."""

AXES: Final = ("sprung mass", "roll inertia", "pitch inertia")

HYPOTHESES: Final = 32
"""Of what changed last and when, kept in mind for each parameter."""

_LONGEST: Final = 0.012
"""Longest step over which the suspension force is integrated [s]: an axle hops at some 12 Hz,
and a seventh of its period is still a smooth piece."""

_FORMS: Final = {
    "printed": kalman_bucy.PRINTED,
    "extended": kalman_bucy.EXTENDED,
    "inverse": kalman_bucy.INVERSE,
}

_GAIN: Final = 10.0
"""A larger noise must raise the logarithm of the likelihood by so much to be believed."""

_NOISIEST: Final = 64.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RideSamples:
    """The ride, on one clock.

    Attributes
    ----------
    time : (n,) rising [s]
    travel, rate : (n, 4) of the suspension front left, front right, rear left, rear
        right, positive in extension [m], [m/s]
    velocity : (n, 3) vertical up [m/s], roll right side down and pitch nose up [rad/s];
        NaN where it was not measured
    """

    time: Floats
    travel: Floats
    rate: Floats
    velocity: Floats

    @property
    def period(self) -> float:
        """Median time between samples [s]; NaN below two samples."""
        return float(np.median(np.diff(self.time))) if self.time.size > 1 else math.nan

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return float(self.time[-1] - self.time[0]) if self.time.size else 0.0

    def between(self, begin: float, end: float = math.inf) -> RideSamples:
        """Return the samples from ``begin`` on and before ``end`` [s]."""
        part = slice(*np.searchsorted(self.time, (begin, end)))
        return RideSamples(
            time=self.time[part], travel=self.travel[part], rate=self.rate[part],
            velocity=self.velocity[part],
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class InertiaTrack:
    """The parameters over time; columns are sprung mass, roll and pitch inertia.

    Attributes
    ----------
    method : name of the filter
    time : (n,) [s]
    reference : (3,) the vehicle file's parameters [kg], [kg m^2]
    alpha, alpha_std : (n, 3) reference over parameter, as known at each sample and not
        later [-]
    velocity : (n, 3) vertical, roll and pitch velocity [m/s], [rad/s]
    offset : (n, 3) constant acceleration of offsets and weight [m/s^2], [rad/s^2]
    innovation, innovation_var : (n, 3) measured less predicted velocity, and the variance
        it should have; NaN where it is not known
    jumped : (n, 3) when each parameter jumped last [s]; -inf for never
    pushed : (n, 3) whether braking, starting or turning goes on
    noise_factor : standard deviation of the suspension signals over that of the vehicle
        file, as the innovations have it [-]
    """

    method: Method
    time: Floats
    reference: Floats
    alpha: Floats
    alpha_std: Floats
    velocity: Floats
    offset: Floats
    innovation: Floats
    innovation_var: Floats
    jumped: Floats
    pushed: Bools
    noise_factor: float

    @property
    def parameters(self) -> Floats:
        """(n, 3) sprung mass [kg], roll and pitch inertia [kg m^2]."""
        return np.asarray(self.reference / self.alpha)

    @property
    def stds(self) -> Floats:
        """(n, 3) their standard deviations by the filter alone."""
        return np.asarray(self.parameters * self.alpha_std / self.alpha)

    @property
    def log_likelihood(self) -> float:
        """Of the velocities, each by those before it."""
        var = self.innovation_var
        terms = np.log(var) + self.innovation**2 / var
        return float(-0.5 * np.nansum(terms))

    def interval(self, level: float = 0.95) -> tuple[Floats, Floats]:
        """(n, 3) bounds that hold the parameters by the filter alone.

        They lie evenly about the inverse parameter, as the filter is linear in it.
        """
        return inverse_interval(self.reference, self.alpha, self.alpha_std, level)


def inverse_interval(
    reference: Floats, alpha: Floats, alpha_std: Floats, level: float
) -> tuple[Floats, Floats]:
    """Bounds of ``reference / alpha``; the upper one infinite where alpha may be zero."""
    reach = float(ndtri(0.5 + 0.5 * level)) * alpha_std
    with np.errstate(divide="ignore"):
        high = np.where(alpha > reach, reference / np.maximum(alpha - reach, 0.0), np.inf)
    return np.asarray(reference / (alpha + reach)), high


def corners(ride: Ride) -> Floats:
    """(4, 3) height of the body above each wheel per heave, roll and pitch."""
    a, b = 0.5 * ride.front_track, 0.5 * ride.rear_track
    front, rear = ride.front_axle, ride.rear_axle
    return np.array([[1.0, a, front], [1.0, -a, front], [1.0, b, -rear], [1.0, -b, -rear]])


def stiffness(ride: Ride) -> Floats:
    """(4,) of the springs [N/m]."""
    return np.repeat((ride.front_stiffness, ride.rear_stiffness), 2)


def damping(ride: Ride) -> Floats:
    """(4,) of the dampers [N s/m]."""
    return np.repeat((ride.front_damping, ride.rear_damping), 2)


def reference(ride: Ride) -> Floats:
    """(3,) sprung mass, roll and pitch inertia of the vehicle file."""
    return np.array([ride.sprung_mass, ride.roll_inertia, ride.pitch_inertia])


def body_noise(ride: Ride) -> Floats:
    """(3,) standard deviation of one sample of the velocities."""
    return np.array([ride.vertical_velocity_noise, ride.roll_rate_noise, ride.pitch_rate_noise])


def push_var(ride: Ride) -> Floats:
    """(3,) variance of the reference's acceleration from the suspension sensors' noise."""
    spring, damper = accelerations(ride)
    return np.asarray(
        np.sum((spring * ride.travel_noise) ** 2 + (damper * ride.rate_noise) ** 2, axis=1)
    )


def accelerations(ride: Ride) -> tuple[Floats, Floats]:
    """(3, 4) acceleration of the reference per travel and per rate at each wheel."""
    arms = corners(ride).T / reference(ride)[:, np.newaxis]
    return np.ascontiguousarray(arms * stiffness(ride)), np.ascontiguousarray(arms * damping(ride))


def longest_step(period: float) -> float:
    """Step above which velocities count as unknown [s]."""
    return max(_LONGEST, 1.5 * period)


def jump_params(
    ride: Ride, period: float, settings: InertiaSettings, noise_factor: float = 1.0
) -> kernel.InertiaParams:
    """Put together what the filter with jumps reads."""
    spring, damper = accelerations(ride)
    low, high = settings.range
    push = settings.push_drift if settings.offset_std > 0.0 else 0.0
    return kernel.InertiaParams(
        spring=spring,
        damper=damper,
        push_var=push_var(ride) * noise_factor**2,
        noise_var=body_noise(ride) ** 2,
        alpha_drift=settings.drift**2,
        beta_drift=settings.offset_drift**2 if settings.offset_std > 0.0 else 0.0,
        jump_std=settings.jump_std,
        beta_std=np.full(3, settings.offset_std),
        lowest=1.0 / high,
        highest=1.0 / low,
        jump_rate=settings.jump_rate,
        spawn=settings.spawn,
        push_drift=np.array([0.0, 1.0, 1.0]) * push**2,
        push_rate=settings.push_rate,
        longest=longest_step(period),
    )


def jump_state(params: kernel.InertiaParams, settings: InertiaSettings) -> kernel.InertiaState:
    """Start the filter with jumps."""
    start_std = np.full(3, settings.start_std)
    state: kernel.InertiaState = kernel.initial_state(  # type: ignore[no-untyped-call]
        start_std, params, HYPOTHESES
    )
    return state


class InertiaFilter:
    """Sample by sample, as they come: what a whole ride gives, to the last bit.

    Parameters
    ----------
    ride : the vehicle's suspension, `Vehicle.ride`
    period : between samples, roughly [s]
    settings : of the filter

    Raises
    ------
    ConfigError
        The period is not positive.
    """

    def __init__(self, ride: Ride, period: float, settings: InertiaSettings | None = None) -> None:
        check_type("ride", ride, Ride, "the ride of a weighbridge.Vehicle")
        check_number("period", period)
        kinds = (InertiaSettings, type(None))
        check_type("settings", settings, kinds, "a weighbridge.InertiaSettings")
        if not 0.0 < period < math.inf:
            raise ConfigError(f"period must be a positive number of seconds, got {period}")
        chosen = settings or InertiaSettings()
        self.reference = reference(ride)
        self.params = jump_params(ride, period, chosen)
        self.state = jump_state(self.params, chosen)
        self._alpha = np.ones(3)
        self._alpha_std = np.full(3, chosen.start_std)

    def update(
        self, time: float, travel: Floats, rate: Floats, velocity: Floats
    ) -> kernel.InertiaSample:
        """Fold one sample in.

        Parameters
        ----------
        time : after the sample before [s]
        travel, rate : (4,) of the suspension front left, front right, rear left, rear right,
            positive in extension [m], [m/s]
        velocity : (3,) vertical up [m/s], roll right side down and pitch nose up [rad/s]; NaN
            where it was not measured

        Returns
        -------
        InertiaSample
            What the filter knows of this sample; ``alpha`` is the vehicle file's parameters
            over those found.

        Raises
        ------
        ConfigError
            There are more or fewer values.
        """
        check_number("time", time)
        given = {"travel": (travel, 4), "rate": (rate, 4), "velocity": (velocity, 3)}
        measured = [_several(name, values, count) for name, (values, count) in given.items()]
        self.state, sample = kernel.step(self.state, float(time), *measured, self.params)
        self._alpha, self._alpha_std = sample.alpha, sample.alpha_std
        return sample  # type: ignore[no-any-return]

    @property
    def parameters(self) -> Floats:
        """(3,) sprung mass [kg], roll and pitch inertia [kg m^2] as known by now."""
        return np.asarray(self.reference / self._alpha)

    def interval(self, level: float = 0.95) -> tuple[Floats, Floats]:
        """(3,) bounds that hold them by the filter alone; the file's ``force_std`` is not in them.

        Raises
        ------
        ConfigError
            The level is not between 0 and 1.
        """
        check_number("level", level)
        if not 0.0 < level < 1.0:
            raise ConfigError(f"level must be between 0 and 1, got {level}")
        return inverse_interval(self.reference, self._alpha, self._alpha_std, level)


def _several(name: str, values: object, count: int) -> Floats:
    """Values of one sample as an array of doubles."""
    array = as_floats(name, values)
    if array.shape != (count,):
        raise ConfigError(f"{name} must be {count} numbers, got an array of shape {array.shape}")
    return array


def estimate(
    samples: RideSamples,
    ride: Ride,
    method: Method = "kalman-bucy",
    settings: InertiaSettings | None = None,
) -> InertiaTrack:
    """Estimate the parameters over a ride.

    With ``kalman-bucy`` the noise of the suspension signals is raised, by powers of two,
    as long as the innovations become likelier.

    Raises
    ------
    ConfigError
        The method is not known.
    """
    if method not in METHODS:
        raise ConfigError(f"unknown method {method!r}{suggestion(method, METHODS)}")
    chosen = settings or InertiaSettings()
    if method != "kalman-bucy":
        return _run_fixed(samples, ride, method, chosen)
    best = run_filter(samples, ride, chosen)
    while best.noise_factor < _NOISIEST:
        louder = run_filter(samples, ride, chosen, noise_factor=2.0 * best.noise_factor)
        if louder.log_likelihood < best.log_likelihood + _GAIN:
            break
        best = louder
    return best


def run_filter(
    samples: RideSamples, ride: Ride, settings: InertiaSettings, *, noise_factor: float = 1.0
) -> InertiaTrack:
    """Run the filter with jumps once over all samples."""
    params = jump_params(ride, samples.period, settings, noise_factor)
    _, found = kernel.run(
        jump_state(params, settings),
        samples.time,
        samples.travel,
        samples.rate,
        samples.velocity,
        params,
    )
    unknown = np.isnan(found.impulse)
    return InertiaTrack(
        method="kalman-bucy",
        time=samples.time,
        reference=reference(ride),
        alpha=found.alpha,
        alpha_std=found.alpha_std,
        velocity=found.velocity,
        offset=found.beta,
        innovation=np.where(unknown, np.nan, found.innovation),
        innovation_var=np.where(unknown, np.nan, found.innovation_var),
        jumped=found.jumped,
        pushed=found.pushed,
        noise_factor=noise_factor,
    )


def fixed_params(
    ride: Ride, period: float, method: Method, settings: InertiaSettings
) -> kalman_bucy.KalmanBucyParams:
    """Put together what the filters with one fixed process noise read."""
    spring, damper = accelerations(ride)
    low, high = settings.range
    bounds = (1.0 / high, 1.0 / low) if method == "inverse" else (low, high)
    of_velocity, of_parameter = settings.process
    process = np.repeat((of_velocity, of_parameter), 3)
    if settings.process_densities:
        process = np.array(settings.process_densities)
        process[3:] /= reference(ride) ** 2
    noise = np.array(settings.noise_densities or body_noise(ride) ** 2 * period)
    return kalman_bucy.KalmanBucyParams(
        spring=spring,
        damper=damper,
        process=np.diag(process),
        noise=noise,
        lowest=bounds[0],
        highest=bounds[1],
        longest=longest_step(period),
        form=_FORMS[method],
    )


def _run_fixed(
    samples: RideSamples, ride: Ride, method: Method, settings: InertiaSettings
) -> InertiaTrack:
    params = fixed_params(ride, samples.period, method, settings)
    travel = samples.travel
    if settings.offset_std > 0.0:
        # These filters know no offset: the travel counts from its mean.
        travel = travel - np.mean(travel, axis=0)
    start = np.repeat((settings.start_velocity_std**2, settings.start_std**2), 3)
    if settings.start_variances:
        start = np.array(settings.start_variances)
        start[3:] /= reference(ride) ** 2
    begin = kalman_bucy.initial_state(  # type: ignore[no-untyped-call]
        np.repeat((0.0, 1.0), 3), np.diag(start)
    )
    _, mean, std = kalman_bucy.run(
        begin,
        samples.time,
        travel,
        samples.rate,
        samples.velocity,
        params,
    )
    q, q_std = mean[:, 3:], std[:, 3:]
    inverse = method == "inverse"
    nothing = np.full_like(q, np.nan)
    return InertiaTrack(
        method=method,
        time=samples.time,
        reference=reference(ride),
        alpha=q if inverse else 1.0 / q,
        alpha_std=q_std if inverse else q_std / q**2,
        velocity=mean[:, :3],
        offset=np.zeros_like(q),
        innovation=nothing,
        innovation_var=nothing,
        jumped=np.full_like(q, -np.inf),
        pushed=np.zeros(q.shape, dtype=bool),
        noise_factor=1.0,
    )
