"""The equations of Galvão et al., each computed as printed and by the code."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from weighbridge.calibration.speed_fit import (
    Nominal,
    SpeedRows,
    fit_speed_model,
    model_speed,
)
from weighbridge.constants import GRAVITY
from weighbridge.estimators.speed_ekf import PRINTED
from weighbridge.kernels import speed_ekf as kernel
from weighbridge.papers.claims import Found, same
from weighbridge.papers.galvao_drives import NOMINAL
from weighbridge.signals import Floats
from weighbridge.vehicle import SpeedModel

MASS: Final = 1092.0
SPEED: Final = 16.0
GRADE: Final = 0.012
STEP: Final = 7.0
GEAR, EFFICIENCY, RADIUS = 6.39, 0.90, 0.29
DENSITY, DRAG_COEFFICIENT, AREA = 1.22, 0.35, 2.15
ROLLING, ROTATING = 0.01, 71.0
P: Final = (0.4, -0.02, 0.05, 0.003, -0.2, 0.004, 3.1)
"""p1 to p7, of the size that a fit gives; the rest is from sec. 2.1."""

BETA: Final = math.atan(ROLLING)
A1, A2, A3 = GEAR * EFFICIENCY / RADIUS, DENSITY * DRAG_COEFFICIENT * AREA, GRAVITY / math.cos(BETA)
PHI1, PHI2 = 1.0 / MASS, math.sin(GRADE + BETA)
TORQUE: Final = P[6] * SPEED


def _params(corrections: tuple[float, ...] = P) -> kernel.SpeedEkfParams:
    return kernel.SpeedEkfParams(
        sample_time=STEP,
        force_gain=NOMINAL.force_gain,
        drag=NOMINAL.drag,
        gravity=NOMINAL.gravity,
        rotating_mass=NOMINAL.rotating_mass,
        corrections=np.array(corrections),
        process_var=np.array(PRINTED.process_var),
        speed_var=PRINTED.speed_var,
    )


STATE: Final = np.array([SPEED, PHI1, PHI2])
PLAIN: Final = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, P[6])
"""No corrections: the model of eq. 11 with the torque of eq. 18."""


def _printed_accel(state: Floats, a: tuple[float, float, float], torque: float) -> float:
    """Acceleration of eq. 11 [m/s^2]."""
    v, phi1, phi2 = state
    force = phi1 * (torque * a[0] - 0.5 * a[1] * v**2)
    return float((force - a[2] * phi2) / (1.0 + phi1 * ROTATING))


def _model() -> dict[str, Found]:
    """Return eqs. 1 to 12."""
    params = _params(PLAIN)
    accel, _ = kernel.acceleration(STATE, SPEED, params)
    coasting, _ = kernel.acceleration(STATE, SPEED, _params((0.0,) * 7))
    still = np.array([0.0, PHI1, PHI2])
    resting, _ = kernel.acceleration(still, 0.0, params)
    inertia = MASS + ROTATING
    traction = TORQUE * GEAR * EFFICIENCY / RADIUS
    air = 0.5 * DENSITY * DRAG_COEFFICIENT * AREA * SPEED**2
    climb, roll = MASS * GRAVITY * math.sin(GRADE), ROLLING * MASS * GRAVITY * math.cos(GRADE)
    level = kernel.acceleration(np.array([0.0, PHI1, math.sin(BETA)]), 0.0, params)[0]
    whole = traction - air - climb - roll
    y = math.atan(ROLLING)
    both = MASS * GRAVITY * math.sin(GRADE + y) / math.cos(y)
    rows = _rows(np.array([SPEED, SPEED]))
    stepped = model_speed(rows, _speed_model(PLAIN))[1]
    return {
        "eq 1": same(whole, inertia * float(accel), "N"),
        "eq 2": same(ROTATING * float(accel), whole - MASS * float(accel), "N"),
        "eq 3": same((whole - ROTATING * float(accel)) / MASS, float(accel), "m/s²"),
        "eq 4": same(traction, float(kernel.traction_force(SPEED, params)), "N"),
        "eq 5": same(air, inertia * float(resting - coasting), "N"),
        "eq 6": same(
            climb, -inertia * float(resting) - ROLLING * MASS * GRAVITY * math.cos(GRADE), "N"
        ),
        "eq 7": same(ROLLING * MASS * GRAVITY, -inertia * float(level), "N"),
        "eq 8": same(whole / inertia, float(accel), "m/s²"),
        "eq 9": same(climb + roll, -inertia * float(resting), "N"),
        "eq 10": same((traction - air - both) / inertia, float(accel), "m/s²"),
        "eq 11": same(_printed_accel(STATE, (A1, A2, A3), TORQUE), float(accel), "m/s²"),
        "eq 12": same(SPEED + STEP * whole / inertia, stepped, "m/s"),
    }


def _rows(speed: Floats) -> SpeedRows:
    return SpeedRows(
        name="rows",
        mass=MASS,
        speed=speed,
        grade=np.full(speed.size, GRADE),
        used=np.ones(speed.size, dtype=bool),
    )


def _speed_model(corrections: tuple[float, ...]) -> SpeedModel:
    return SpeedModel(
        mass=MASS, sample_time=STEP, force_gain=NOMINAL.force_gain, drag=NOMINAL.drag,
        rolling_coefficient=ROLLING, rotating_mass=ROTATING, corrections=corrections,
        scale_std=0.1,
    )  # fmt: skip


def _corrections() -> dict[str, Found]:
    """Return eqs. 15 to 18: a fit finds again the model that made its rows."""
    before = 12.0
    a = (A1 + P[0] + P[1] * before, A2 + P[2] + P[3] * before, A3 + P[4] + P[5] * before)
    torque = P[6] * before
    params = _params()
    accel, _ = kernel.acceleration(STATE, before, params)
    still = np.array([0.0, PHI1, PHI2])
    without, _ = kernel.acceleration(still, before, params)
    inertia = 1.0 + PHI1 * ROTATING
    rng = np.random.default_rng(4)
    speed = rng.uniform(8.0, 25.0, 400)
    grade = rng.normal(0.0, 0.01, 400)
    slope = np.sin(grade + BETA)
    slope = 0.5 * (slope[1:] + slope[:-1])
    after = [
        v + STEP * _printed_accel(
            np.array([v, PHI1, s]), (A1 + P[1] * v, A2 + P[2] + P[3] * v, A3 + P[4] + P[5] * v),
            P[6] * v,
        )
        for v, s in zip(speed[:-1], slope, strict=True)
    ]  # fmt: skip
    # Rows in pairs: each second one is what the model makes of the one before.
    pairs = [
        SpeedRows(name="pair", mass=MASS, speed=np.array([v, w]),
                  grade=np.array([g, g]), used=np.ones(2, dtype=bool))
        for v, w, g in zip(speed[:-1], after, np.arcsin(slope) - BETA, strict=True)
    ]  # fmt: skip
    nominal = Nominal(force_gain=A1, drag=A2, rolling_coefficient=ROLLING, rotating_mass=ROTATING)
    fit = fit_speed_model(pairs, nominal, STEP)
    stepped = [model_speed(p, _speed_model(fit.corrections))[1] for p in pairs[:40]]
    return {
        "eq 15": same(a[0] * torque, float(kernel.traction_force(before, params)), "N"),
        "eq 16": same(0.5 * PHI1 * a[1] * SPEED**2, inertia * float(without - accel), "m/s²"),
        "eq 17": same(
            a[2] * PHI2, PHI1 * a[0] * torque - inertia * float(without), "m/s²"
        ),
        "eq 18": same(np.array(after[:40]), np.array(stepped), "m/s"),
    }  # fmt: skip


def _filter() -> dict[str, Found]:
    """Return eqs. 13, 14 and 19 to 26: one step of the filter in matrices."""
    params = _params()
    before, measured = 15.2, 16.3
    rng = np.random.default_rng(5)
    mix = np.eye(3) + 0.1 * rng.normal(size=(3, 3))
    scale = np.diag(np.sqrt(PRINTED.process_var))
    cov = scale @ mix @ mix.T @ scale
    a = (A1 + P[0] + P[1] * before, A2 + P[2] + P[3] * before, A3 + P[4] + P[5] * before)
    torque = P[6] * before
    ahead = STATE + STEP * np.array([_printed_accel(STATE, a, torque), 0.0, 0.0])
    transition = np.eye(3)
    for k, width in enumerate((1e-3, 1e-7, 1e-4)):
        move = np.zeros(3)
        move[k] = width
        up, down = (_printed_accel(STATE + s * move, a, torque) for s in (1.0, -1.0))
        transition[0, k] += STEP * (up - down) / (2.0 * width)
    predicted = transition @ cov @ transition.T + np.diag(PRINTED.process_var)
    measure = np.array([[1.0, 0.0, 0.0]])
    spread = predicted[0, 0] + PRINTED.speed_var
    gain = predicted[:, :1] / spread
    after = ahead + gain[:, 0] * (measured - ahead[0])
    left = (np.eye(3) - gain @ measure) @ predicted
    state = kernel.SpeedEkfState(STATE.copy(), cov.copy(), before)
    ours, innovation, var = kernel.step(state, measured, True, params)
    begun = kernel.initial_state(1500.0, 0.01, params)  # type: ignore[no-untyped-call]
    root = np.sqrt(np.outer(np.diag(left), np.diag(left)))
    _, jacobian = kernel.acceleration(STATE, before, params)
    step = np.zeros(3)
    step[:] = STEP * np.asarray(jacobian) + np.array([1.0, 0.0, 0.0])
    tiny = np.abs(step / transition[0] - 1.0)
    return {
        "eq 13": same(ahead[0], measured - float(innovation), "m/s"),
        "eq 14": same(measured - ahead[0], float(innovation), "m/s"),
        "eq 19": same(after[1:], ours.x[1:]),
        "eq 20": same(measured - (measure @ ahead)[0], float(innovation), "m/s"),
        "eq 21": same(ahead[0], measured - float(innovation), "m/s"),
        "eq 22": _loose(spread, float(var), "m²/s²"),
        "eq 23": Found(
            f"{step[0]:.9g}", bool(tiny.max() < 1e-6), f"{transition[0, 0]:.9g}"
        ),
        "eq 24": _loose(gain[0, 0] * (measured - ahead[0]), float(ours.x[0] - ahead[0]), "m/s"),
        "eq 25": _loose(after[2], float(ours.x[2]), ""),
        "eq 26": _loose(float((left / root)[0, 2]), float((ours.cov / root)[0, 2]), ""),
        "start": same([1.0 / 1500.0, 0.01], begun.x[1:]),
    }  # fmt: skip


def _loose(printed: float, ours: float, unit: str) -> Found:
    """Compare where the derivative of eq. 23 is a difference quotient."""
    close = bool(abs(ours - printed) <= 1e-5 * abs(printed))
    return Found(f"{ours:.9g} {unit}".strip(), close, f"{printed:.9g} {unit}".strip())


def equations() -> dict[str, Found]:
    """Return every equation, by the names that the items ask for."""
    return _model() | _corrections() | _filter()
