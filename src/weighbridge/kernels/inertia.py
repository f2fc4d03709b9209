"""Kalman-Bucy filter of sprung mass and inertias, with hypotheses of when they jumped.

The sprung mass, its roll inertia and its pitch inertia obey, each for itself,

    v' = alpha phi + beta,   alpha' = 0,   beta' = 0

with the velocity v, the known acceleration phi = f / p0 of the reference parameter p0
under the suspension force or moment f, alpha = p0 / p, and an offset beta of sensors and
weight. It is linear in (v, alpha, beta), so between two samples it is integrated exactly,
whatever the rate, and the covariance stays positive definite.
"""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import kernel
from weighbridge.kernels.inertia_hypothesis import (
    VELOCITY_STD,
    correct,
    forget_velocity,
    integral,
    predict,
    within,
)

AXES = 3


class InertiaParams(NamedTuple):
    """What stays the same from sample to sample.

    Attributes
    ----------
    spring, damper : (3, 4) acceleration of each axis per travel and per rate of each
        wheel, of the reference parameters [1/s^2], [1/s], and for the rotations over m
    push_var : (3,) variance of phi from the noise of the suspension sensors
    noise_var : (3,) of the measured velocities [m^2/s^2], [rad^2/s^2]
    alpha_drift, beta_drift : growth of the variance of alpha and beta with time [1/s],
        [m^2/s^5]
    jump_std : standard deviation of alpha after a jump, relative to before it [-]
    beta_std : (3,) of beta at the start and after a jump [m/s^2], [rad/s^2]
    lowest, highest : bounds of alpha, outside of which no vehicle is [-]
    jump_rate : changes of load expected per time [1/s]
    spawn : time between two hypotheses of a change [s]; infinite to allow none
    push_drift : (3,) growth of the variance of beta with time while the vehicle brakes,
        starts or turns; 0 where that does not move the axis [rad^2/s^5]
    push_rate : beginnings and ends of that expected per time [1/s]
    longest : step between samples above which velocities are unknown [s]
    """

    spring: np.ndarray
    damper: np.ndarray
    push_var: np.ndarray
    noise_var: np.ndarray
    alpha_drift: float
    beta_drift: float
    jump_std: float
    beta_std: np.ndarray
    lowest: float
    highest: float
    jump_rate: float
    spawn: float
    push_drift: np.ndarray
    push_rate: float
    longest: float


class InertiaState(NamedTuple):
    """All hypotheses of the three axes.

    Attributes
    ----------
    time : of the last sample [s]
    phi : (2, 3) at the last sample and the one before
    old_step : between them [s]; 0 where there is none
    next_spawn, next_turn : (3,) when the next hypothesis of a change of load, and of a
        push that begins or ends, is due [s]
    count : (3,) hypotheses in use
    cause : (3, m) of each: LOAD changed, a push of braking or turning BEGAN or ENDED
    born : (3, m) when that was [s], rising
    loaded : (3, m) when each says the load changed last [s]
    weight : (3, m) logarithm of its probability, the largest 0
    mean : (3, m, 3) v, alpha, beta
    cov : (3, m, 3, 3) their covariance
    """

    time: float
    phi: np.ndarray
    old_step: float
    next_spawn: np.ndarray
    next_turn: np.ndarray
    count: np.ndarray  # type: ignore[assignment]
    cause: np.ndarray
    born: np.ndarray
    loaded: np.ndarray
    weight: np.ndarray
    mean: np.ndarray
    cov: np.ndarray


class InertiaSample(NamedTuple):
    """What is known after one sample.

    Attributes
    ----------
    alpha, alpha_std : (3,) inverse parameters over those of the reference [-]
    beta : (3,) offset [m/s^2], [rad/s^2]
    velocity : (3,) [m/s], [rad/s]
    innovation, innovation_var : (3,) of the likeliest hypothesis [m/s], [rad/s] and their
        squares; NaN where nothing was measured
    impulse : (3,) change of phi's integral since the sample before [m/s], [rad/s]; NaN
        where it is unknown
    jumped : (3,) when the likeliest hypothesis says the load changed last [s]
    pushed : (3,) whether it says that braking, starting or turning goes on
    """

    alpha: np.ndarray
    alpha_std: np.ndarray
    beta: np.ndarray
    velocity: np.ndarray
    innovation: np.ndarray
    innovation_var: np.ndarray
    impulse: np.ndarray
    jumped: np.ndarray
    pushed: np.ndarray


LOAD, BEGAN, ENDED = 0, 1, 2
"""Causes of a hypothesis; without any it is as if the load had changed before the start."""

TURN = 8.0
"""Pushes take longer than changes of load: so many times ``spawn`` is between two hypotheses."""

NEGLIGIBLE = np.log(1e-3)
"""Hypotheses less likely than this, over the likeliest, are left out of the answer. A jump just
supposed knows nothing yet: however unlikely, its spread would count."""


def initial_state(alpha_std, params, hypotheses):
    """Start with alpha = 1 and its standard deviation (3,) at no time yet."""
    mean = np.zeros((AXES, hypotheses, 3))
    cov = np.zeros((AXES, hypotheses, 3, 3))
    mean[:, :, 1] = 1.0
    cov[:, :, 0, 0] = VELOCITY_STD**2
    cov[:, :, 1, 1] = np.asarray(alpha_std)[:, np.newaxis] ** 2
    cov[:, :, 2, 2] = params.beta_std[:, np.newaxis] ** 2
    return InertiaState(
        np.nan,
        np.full((2, AXES), np.nan),
        0.0,
        np.full(AXES, -np.inf),
        np.full(AXES, -np.inf),
        np.ones(AXES, dtype=np.int64),
        np.full((AXES, hypotheses), LOAD, dtype=np.int64),
        np.full((AXES, hypotheses), -np.inf),
        np.full((AXES, hypotheses), -np.inf),
        np.zeros((AXES, hypotheses)),
        mean,
        cov,
    )


@kernel
def make_room(j, count, time, cause, born, loaded, weight, mean, cov):
    """Drop the less likely of two hypotheses of one cause whose ages differ least in proportion."""
    least, at, beside = np.inf, 0, 1
    for i in range(count - 1):
        k = i + 1
        while k < count and cause[j, k] != cause[j, i]:
            k += 1
        if k == count:
            continue
        # The one from before the start is older than all by any measure.
        age = min(time - born[j, i], 1e9)
        ratio = age / max(time - born[j, k], 1e-9)
        if ratio < least:
            least, at, beside = ratio, i, k
    drop, kept = at, beside
    if weight[j, at] >= weight[j, beside]:
        drop, kept = beside, at
    # What the dropped one believed goes to its neighbour: both say nearly the same.
    weight[j, kept] += np.log1p(np.exp(weight[j, drop] - weight[j, kept]))
    for i in range(drop, count - 1):
        cause[j, i] = cause[j, i + 1]
        born[j, i] = born[j, i + 1]
        loaded[j, i] = loaded[j, i + 1]
        weight[j, i] = weight[j, i + 1]
        mean[j, i] = mean[j, i + 1]
        cov[j, i] = cov[j, i + 1]
    return count - 1


@kernel
def likeliest(weight, count):
    """Index of the largest weight."""
    best = 0
    for i in range(1, count):
        if weight[i] > weight[best]:
            best = i
    return best


@kernel
def suppose(j, why, log_rate, slip, time, count, cause, born, loaded, weight, mean, cov, params):
    """Add the hypothesis that something changes now, from the likeliest one.

    ``slip`` is what the velocity may be off by, for the change came a moment earlier or
    later than supposed [m/s], [rad/s].
    """
    if count == born.shape[1]:
        count = make_room(j, count, time, cause, born, loaded, weight, mean, cov)
    best = likeliest(weight[j], count)
    cause[j, count] = why
    born[j, count] = time
    loaded[j, count] = loaded[j, best]
    weight[j, count] = weight[j, best] + log_rate
    mean[j, count] = mean[j, best]
    cov[j, count] = cov[j, best]
    if why == LOAD:
        loaded[j, count] = time
        for i in range(3):
            if i != 1:
                cov[j, count, 1, i] = 0.0
                cov[j, count, i, 1] = 0.0
        cov[j, count, 0, 0] += slip * slip
        cov[j, count, 1, 1] += (params.jump_std * mean[j, best, 1]) ** 2
        # Another load has another weight.
        if params.beta_std[j] > 0.0:
            for i in range(2):
                cov[j, count, 2, i] = 0.0
                cov[j, count, i, 2] = 0.0
            cov[j, count, 2, 2] += params.beta_std[j] ** 2
    return count + 1


@kernel
def accelerations(travel, rate, spring, damper):
    """(3,) acceleration of the reference parameters under the suspension's forces."""
    phi = np.zeros(AXES)
    for j in range(AXES):
        for w in range(4):
            phi[j] -= spring[j, w] * travel[w] + damper[j, w] * rate[w]
    return phi


@kernel
def impulses(phi, old_step, length, longest):
    """Integrate accelerations over the step from the sample before.

    Parameters
    ----------
    phi : (3, 3) float64
        At this sample, the one before and the one before that.
    old_step, length : float
        Between the older two and the newer two [s].
    longest : float
        Step above which nothing is known [s].

    Returns
    -------
    impulse : (3,)
        NaN where it is unknown.
    unsure : (3,)
        What the parabola adds to the chord, which neither knows.
    """
    impulse, unsure = np.full(AXES, np.nan), np.zeros(AXES)
    if length > 0.0 and length <= longest:
        for j in range(AXES):
            known_step = old_step if np.isfinite(phi[2, j]) else 0.0
            impulse[j] = integral(phi[2, j], phi[1, j], phi[0, j], known_step, length)
            unsure[j] = impulse[j] - 0.5 * length * (phi[0, j] + phi[1, j])
    return impulse, unsure


@kernel
def predict_all(j, count, cause, mean, cov, impulse, unsure, measured, length, params):
    """Integrate all hypotheses of one axis over a step; over one of unknown impulse, forget.

    A velocity forgotten starts from the one ``measured``, where there is one.
    """
    if not np.isfinite(impulse):
        if not length <= 0.0:
            for i in range(count):
                held = measured if np.isfinite(measured) else mean[j, i, 0]
                forget_velocity(mean[j, i], cov[j, i], held)
        return
    push_var = params.push_var[j] * length * length + unsure * unsure
    for i in range(count):
        var = mean[j, i, 1] * mean[j, i, 1] * push_var
        drift = params.push_drift[j] if cause[j, i] == BEGAN else params.beta_drift
        predict(mean[j, i], cov[j, i], impulse, length, var, params.alpha_drift, drift)


@kernel
def correct_all(weight, mean, cov, measured, noise_var):
    """Fold a measured velocity into all hypotheses of one axis, and weigh them by it.

    Parameters
    ----------
    weight : (c,) float64
    mean, cov : (c, 3), (c, 3, 3) float64
    measured, noise_var : float
        Velocity and the variance of its noise [m/s], [rad/s] and their squares.

    Returns
    -------
    innovation, innovation_var : float
        Of the likeliest hypothesis before.
    """
    best = likeliest(weight, weight.size)
    innovation = measured - mean[best, 0]
    innovation_var = cov[best, 0, 0] + noise_var
    top = -np.inf
    for i in range(weight.size):
        e, var = correct(mean[i], cov[i], measured, noise_var)
        weight[i] -= 0.5 * (np.log(var) + e * e / var)
        top = max(top, weight[i])
    for i in range(weight.size):
        weight[i] -= top
    return innovation, innovation_var


@kernel
def answer(weight, mean, cov, best):
    """Mean and standard deviation of alpha by one hypothesis; its spread has in it what
    the others say.
    """
    total, spread = 0.0, 0.0
    for i in range(weight.size):
        if weight[i] > NEGLIGIBLE:
            p = np.exp(weight[i])
            off = mean[i, 1] - mean[best, 1]
            total += p
            spread += p * (cov[i, 1, 1] + off * off)
    return mean[best, 1], np.sqrt(spread / total)


@kernel
def suppose_changes(
    j, time, apart, phi, next_spawn, next_turn, count, cause, born, loaded, weight, mean, cov,
    params,
):  # fmt: skip
    """Add the hypotheses whose turn it is, that the load changes or a push begins or ends."""
    if time >= next_spawn[j]:
        log_rate = np.log(params.jump_rate * params.spawn)
        change = params.jump_std * mean[j, likeliest(weight[j], count), 1] * phi
        slip = change * apart / np.sqrt(12.0)
        # A literal would be compiled on its own.
        count = suppose(
            j, np.int64(LOAD), log_rate, slip, time, count, cause, born, loaded, weight, mean,
            cov, params,
        )  # fmt: skip
        next_spawn[j] = time + params.spawn
    if params.push_drift[j] > 0.0 and time >= next_turn[j]:
        log_rate = np.log(min(params.push_rate * TURN * params.spawn, 0.5))
        goes_on = cause[j, likeliest(weight[j], count)] == BEGAN
        count = suppose(
            j, ENDED if goes_on else BEGAN, log_rate, 0.0, time, count, cause, born, loaded,
            weight, mean, cov, params,
        )  # fmt: skip
        next_turn[j] = time + TURN * params.spawn
    return count


@kernel
def step(state, time, travel, rate, velocity, params):
    """Fold one sample in.

    Parameters
    ----------
    state : InertiaState
    time : float
        After the sample before [s].
    travel, rate : (4,) float64
        Of the suspension at the wheels, positive in extension [m], [m/s].
    velocity : (3,) float64
        Measured vertical velocity up, roll rate right side down and pitch rate nose up
        [m/s], [rad/s]; NaN where it was not measured.
    params : InertiaParams

    Returns
    -------
    state : InertiaState
    sample : InertiaSample

    References
    ----------
    Nguyen 2024, eqs. 6-9, in inverse parameters; Andersson, Adaptive forgetting in recursive
    identification through multiple models, Int. J. Control 42(5), 1985, for the hypotheses.
    """
    length = time - state.time
    phi = np.empty((3, AXES))
    phi[0] = accelerations(travel, rate, params.spring, params.damper)
    phi[1:] = state.phi
    impulse, unsure = impulses(phi, state.old_step, length, params.longest)
    known = np.isfinite(impulse[0])

    next_spawn, next_turn = state.next_spawn.copy(), state.next_turn.copy()
    count, cause = state.count.copy(), state.cause.copy()
    born, loaded, weight = state.born.copy(), state.loaded.copy(), state.weight.copy()
    mean, cov = state.mean.copy(), state.cov.copy()
    alpha, alpha_std, beta = np.empty(AXES), np.empty(AXES), np.empty(AXES)
    speed, jumped = np.empty(AXES), np.empty(AXES)
    pushed = np.zeros(AXES, dtype=np.bool_)
    innovation, innovation_var = np.full(AXES, np.nan), np.full(AXES, np.nan)
    for j in range(AXES):
        measured, n = velocity[j], count[j]
        predict_all(j, n, cause, mean, cov, impulse[j], unsure[j], measured, length, params)
        if np.isfinite(measured):
            innovation[j], innovation_var[j] = correct_all(
                weight[j, :n], mean[j, :n], cov[j, :n], measured, params.noise_var[j]
            )
        if params.spawn < np.inf:
            # A change is at most half the time between two hypotheses from the nearest: one
            # millisecond of another load is more than a quiet velocity forgives.
            apart = max(params.spawn, length) if known else params.spawn
            count[j] = suppose_changes(
                j, time, apart, phi[0, j], next_spawn, next_turn, count[j], cause, born, loaded,
                weight, mean, cov, params,
            )  # fmt: skip

        n = count[j]
        best = likeliest(weight[j], n)
        speed[j], beta[j] = mean[j, best, 0], mean[j, best, 2]
        middle, std = answer(weight[j, :n], mean[j, :n], cov[j, :n], best)
        alpha[j], alpha_std[j] = within(middle, std, params.lowest, params.highest)
        jumped[j] = loaded[j, best]
        pushed[j] = cause[j, best] == BEGAN
    return (
        InertiaState(
            time, phi[:2].copy(), length if known else 0.0, next_spawn, next_turn, count, cause,
            born, loaded, weight, mean, cov,
        ),
        InertiaSample(
            alpha, alpha_std, beta, speed, innovation, innovation_var, impulse, jumped, pushed
        ),
    )  # fmt: skip


@kernel
def run(state, time, travel, rate, velocity, params):
    """Apply ``step`` to each sample; see there.

    Parameters
    ----------
    state : InertiaState
    time : (n,) float64
    travel, rate : (n, 4) float64
    velocity : (n, 3) float64
    params : InertiaParams

    Returns
    -------
    state : InertiaState
        After the last sample.
    samples : InertiaSample
        Arrays (n, 3).
    """
    n = time.size
    alpha, alpha_std, beta = np.empty((n, AXES)), np.empty((n, AXES)), np.empty((n, AXES))
    speed, innovation = np.empty((n, AXES)), np.empty((n, AXES))
    innovation_var = np.empty((n, AXES))
    impulse, jumped = np.empty((n, AXES)), np.empty((n, AXES))
    pushed = np.zeros((n, AXES), dtype=np.bool_)
    for k in range(n):
        state, s = step(state, time[k], travel[k], rate[k], velocity[k], params)
        alpha[k], alpha_std[k], beta[k] = s.alpha, s.alpha_std, s.beta
        speed[k], innovation[k], innovation_var[k] = s.velocity, s.innovation, s.innovation_var
        impulse[k], jumped[k], pushed[k] = s.impulse, s.jumped, s.pushed
    return state, InertiaSample(
        alpha, alpha_std, beta, speed, innovation, innovation_var, impulse, jumped, pushed
    )
