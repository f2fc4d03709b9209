"""The equations of Nguyen 2024, each computed as printed and by the code.

The paper's pitch is nose down, the code's nose up: printed values are turned by the sign of pitch.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Final

import numpy as np

from weighbridge.inertia import Method, accelerations, fixed_params
from weighbridge.kernels import kalman_bucy
from weighbridge.papers.claims import Found, same
from weighbridge.papers.nguyen2024_cases import (
    AS_PRINTED,
    PAPERS_SENSORS,
    Settings,
    judge,
    suspension_of,
)
from weighbridge.signals import Floats
from weighbridge.simulation import TRUCK, system

MASS, ROLL, PITCH = 5394.0, 4600.0, 19632.0
FRONT, REAR = 2.400, 1.685
T_F, T_R = 0.5 * 1.705, 0.5 * 1.495
SPRING: Final = np.diag([177_000.0, 177_000.0, 193_844.0, 193_844.0])
DAMPER: Final = np.diag([7733.0, 7733.0, 9804.0, 9804.0])
TYRE: Final = np.diag([493_211.0, 493_211.0, 986_422.0, 986_422.0])
UNSPRUNG: Final = (266.0, 427.0)
"""Table 1."""

BODY: Final = np.array(
    [[1.0, T_F, -FRONT], [1.0, -T_F, -FRONT], [1.0, T_R, REAR], [1.0, -T_R, REAR]]
)
AXLES: Final = np.array(
    [[1.0, 0.0, T_F, 0.0], [1.0, 0.0, -T_F, 0.0], [0.0, 1.0, 0.0, T_R], [0.0, 1.0, 0.0, -T_R]]
)
"""G_s and G_u of eq. 5."""

NOSE_UP: Final = np.array([1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0])
STEP: Final = 1e-3
"""Between samples [s]."""


def _inertias() -> Floats:
    """(7,) of M_1; the axles' roll inertias are not printed and taken from the code."""
    return np.array([MASS, ROLL, PITCH, *UNSPRUNG, *TRUCK.axle_inertia])


def _moved(z: Floats, rate: Floats, road: Floats) -> Floats:
    """Accelerations (7,) of eq. 1 with the forces of eq. 2."""
    body, axles = BODY @ z[:3], AXLES @ z[3:]
    body_rate, axle_rate = BODY @ rate[:3], AXLES @ rate[3:]
    f = np.diag(DAMPER) * (body_rate - axle_rate) + np.diag(SPRING) * (body - axles)
    u = np.diag(TYRE) * (axles - road)
    forces = np.array([
        -f.sum(),
        -(T_F * f[0] - T_F * f[1] + T_R * f[2] - T_R * f[3]),
        -(-FRONT * f[0] - FRONT * f[1] + REAR * f[2] + REAR * f[3]),
        f[0] + f[1] - u[0] - u[1],
        f[2] + f[3] - u[2] - u[3],
        T_F * (f[0] - f[1]) - T_F * (u[0] - u[1]),
        T_R * (f[2] - f[3]) - T_R * (u[2] - u[3]),
    ])  # fmt: skip
    return np.asarray(forces / _inertias())


def _model() -> dict[str, Found]:
    """Return eqs. 1 to 5: the simulated truck."""
    rng = np.random.default_rng(1)
    z, rate, road = 0.02 * rng.normal(size=7), 0.2 * rng.normal(size=7), 0.02 * rng.normal(size=4)
    a, b = system(TRUCK, None)
    state = np.concatenate([NOSE_UP * z, NOSE_UP * rate])
    ours = NOSE_UP * (a @ state + b[:, :4] @ road)[7:]
    relative = np.hstack([BODY, -AXLES])
    wheels = np.hstack([np.zeros((4, 3)), AXLES])
    inverse = 1.0 / _inertias()[:, None]
    stiffness = np.vstack(
        [BODY.T @ SPRING @ relative, -AXLES.T @ (SPRING @ relative - TYRE @ wheels)]
    )
    damping = np.vstack([BODY.T @ DAMPER @ relative, -AXLES.T @ DAMPER @ relative])
    excited = np.vstack([np.zeros((3, 4)), AXLES.T @ TYRE])
    turn = np.concatenate([NOSE_UP, NOSE_UP])
    matrix = np.zeros((14, 14))
    matrix[:7, 7:] = np.eye(7)
    matrix[7:, :7], matrix[7:, 7:] = -inverse * stiffness, -inverse * damping
    entered = np.vstack([np.zeros((7, 4)), inverse * excited])
    flat = turn[:, None] * a * turn
    spring, damper = accelerations(suspension_of(TRUCK, PAPERS_SENSORS))
    travel, speed = relative @ z, relative @ rate
    pushed = -NOSE_UP[:3] * (spring @ travel + damper @ speed)
    return {
        "eq 1": same(_moved(z, rate, road), ours),
        "eq 2": same(_moved(z, rate, road)[3:], ours[3:]),
        "eq 3": same(matrix @ np.concatenate([z, rate]) + entered @ road,
                     np.concatenate([rate, ours])),
        "eq 4": same(matrix, flat),
        "eq 5": same(entered, turn[:, None] * b[:, :4]),
        "eq 6": same(
            -(BODY.T @ SPRING @ travel + BODY.T @ DAMPER @ speed)
            / np.array([MASS, ROLL, PITCH]), pushed,
        ),
    }  # fmt: skip


def _stepped(method: Method, *, measured: bool) -> tuple[kalman_bucy.KalmanBucyState, Floats]:
    """Run two samples of one suspension travel: the state after them, and the acceleration."""
    settings = Settings()
    chosen = replace(
        AS_PRINTED, process_densities=settings.printed_process,
        noise_densities=settings.printed_noise,
    )  # fmt: skip
    params = fixed_params(suspension_of(TRUCK, PAPERS_SENSORS), STEP, method, chosen)
    travel, rate = np.array([0.01, -0.02, 0.015, 0.005]), np.array([0.1, -0.05, 0.02, 0.03])
    speed = np.array([0.02, -0.01, 0.03])
    start = kalman_bucy.initial_state(  # type: ignore[no-untyped-call]
        np.array([*speed, 2.0, 2.0, 2.0]), np.diag([1e-5, 1e-5, 1e-5, 0.2, 0.2, 0.2])
    )
    pushed = -(params.spring @ travel + params.damper @ rate)
    begun = start._replace(time=0.0, phi=np.vstack([pushed, pushed]))
    reading = speed + np.array([1e-3, -2e-3, 1e-3]) if measured else np.full(3, np.nan)
    return kalman_bucy.step(begun, STEP, travel, rate, reading, params), pushed


def _filter() -> dict[str, Found]:
    """Return eqs. 7 to 9."""
    speed = np.array([0.02, -0.01, 0.03])
    free, pushed = _stepped("printed", measured=False)
    updated, _ = _stepped("printed", measured=True)
    moving, _ = _stepped("extended", measured=True)
    settings = Settings()
    scale = np.array([MASS, ROLL, PITCH])
    process = np.array(settings.printed_process)
    process[3:] /= scale**2
    noise = np.array(settings.printed_noise)
    ahead = np.concatenate([speed + STEP * pushed / 2.0, np.full(3, 2.0)])
    # A step of the Riccati equation without A_02, in the limit of short steps.
    grown = np.array([1e-5] * 3 + [0.2] * 3) + STEP * process
    gain = grown[:3] / (grown[:3] + noise / STEP)
    after = ahead.copy()
    after[:3] += gain * np.array(speed + np.array([1e-3, -2e-3, 1e-3]) - ahead[:3])
    left = grown.copy()
    left[:3] *= 1.0 - gain
    return {
        "eq 7": same(ahead, free.mean),
        "eq 8": same(np.diag(grown), free.cov),
        "eq 9": same(
            np.concatenate([after, left]), np.concatenate([updated.mean, np.diag(updated.cov)])
        ),
        "eq 9 ours": same(after[3:], moving.mean[3:]),
    }


def _errors() -> dict[str, Found]:
    """Return eq. 10: both measures of error of a made track."""
    rng = np.random.default_rng(2)
    n = 50
    truth = np.array([MASS, ROLL, PITCH]) * np.ones((n, 3))
    found = truth * (1.0 + 0.05 * rng.normal(size=(n, 3)))
    speeds, slips = rng.normal(size=(n, 3)) + 3.0, 0.01 * rng.normal(size=(n, 3))
    made = SimpleNamespace(
        inertias=truth, velocities=speeds,
        scenario=SimpleNamespace(changes=((0.1, 1.0), (0.2, 1.0)), sensors=PAPERS_SENSORS),
    )  # fmt: skip
    track = SimpleNamespace(parameters=found, velocity=speeds + slips, time=np.arange(n) * 0.01)
    result = judge(made, track)  # type: ignore[arg-type]
    square = np.sqrt(np.sum((truth - found) ** 2, axis=0) / n)
    share = np.sum(np.abs((truth - found) / truth), axis=0) / n
    return {
        "eq 10": same(np.concatenate([square, share]), np.concatenate([result.rmse, result.mape]))
    }


def equations() -> dict[str, Found]:
    """Return every equation, by the names that the items ask for."""
    return _model() | _filter() | _errors()
