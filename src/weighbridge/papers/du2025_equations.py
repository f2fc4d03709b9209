"""The equations of Du et al. 2025, each computed as printed and by the code that weighs.

Every function below returns the printed value and that of the code, at the rows of
`weighbridge.papers.point`, for the bus of Table 1 at half load.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.optimize import minimize_scalar

from weighbridge.balance import ForceBalance, law
from weighbridge.constants import GRAVITY
from weighbridge.estimators import ekf, hybrid, robust_rls
from weighbridge.kernels import hybrid_mass, mass_ekf
from weighbridge.kernels import robust_rls as least_squares
from weighbridge.kernels.rotation import euler_to_matrix
from weighbridge.papers.claims import Found, same
from weighbridge.papers.du2025_bus import ROLLING_SPEED, data_sheet
from weighbridge.papers.du2025_methods import PRINTED
from weighbridge.papers.point import ACCEL, DENSITY, GRADE, SPEED, point_table
from weighbridge.signals import Floats
from weighbridge.vehicle import Vehicle

MASS: Final = 10_000.0
TORQUE: Final = 520.0
GEAR: Final = 2.13
AXLE, RADIUS, EFFICIENCY = 3.545, 0.49, 0.95
DRAG_AREA: Final = 0.69 * 7.9
ROLLING: Final = 0.0075
STEP: Final = 0.01
"""Time between two rows of the paper [s]."""

SMALL: Final = 5e-4
"""Largest relative difference by which small angles show at `GRADE` [-]."""


def _bus() -> Vehicle:
    sheet = data_sheet()
    road = replace(sheet.road_load, rolling_speed_coefficient=ROLLING_SPEED)
    return replace(sheet, road_load=road)


BUS: Final = _bus()
TABLE: Final = point_table(TORQUE, GEAR * AXLE / RADIUS, EFFICIENCY)
COEFFICIENT: Final = ROLLING + ROLLING_SPEED * SPEED
"""f of eq. 5 at the speed of the rows [-]."""

# Forces as printed, eqs. 2 to 5 [N].
TRACTION: Final = TORQUE * GEAR * AXLE * EFFICIENCY / RADIUS
DRAG: Final = 0.5 * 0.69 * DENSITY * 7.9 * SPEED**2
CLIMB: Final = MASS * GRAVITY * math.sin(GRADE)
ROLL: Final = MASS * GRAVITY * COEFFICIENT * math.cos(GRADE)


def _near(printed: float, ours: float, unit: str, within: float = SMALL) -> Found:
    """Compare where the paper has a small angle for its sine."""
    close = bool(abs(ours - printed) <= within * abs(printed))
    return Found(f"{ours:.6g} {unit}".strip(), close, f"{printed:.6g} {unit}".strip())


def _params() -> mass_ekf.MassEkfParams:
    settings = replace(PRINTED.ekf, gate=math.inf)
    return ekf.parameters(settings, BUS, STEP)


def _row(time: float, *, rotating: float = 0.0, grade: float = GRADE) -> mass_ekf.Row:
    return mass_ekf.Row(
        time, TRACTION, 0.5 * DENSITY * DRAG_AREA, 0.0, rotating, SPEED + 0.01, grade, True, False,
        math.nan,
    )  # fmt: skip


def _accel(mass: float, *, rotating: float = 0.0, grade: float = GRADE) -> tuple[float, ...]:
    """Acceleration of the Kalman filter's model and its derivatives."""
    row = _row(0.0, rotating=rotating)
    return tuple(mass_ekf.acceleration(SPEED, grade, mass, row, _params()))


def _model() -> dict[str, Found]:
    """Return eqs. 1 to 8."""
    gain = float(law.traction_gain(BUS, TABLE.torque, TABLE.gearing)[0])
    level, hill = _accel(MASS, grade=0.0)[0], _accel(MASS)[0]
    roll_level = MASS * GRAVITY * COEFFICIENT
    climbing = MASS * (level - hill) + roll_level - ROLL
    still = replace(TABLE, specific_force=np.zeros(2))
    rolling = MASS * float(law.mass_column(still, BUS)[0])
    steep = math.atan(0.08)
    return {
        "eq 1": same((TRACTION - (DRAG + CLIMB + ROLL)) / MASS, hill, "m/s²"),
        "eq 2": same(TRACTION, TORQUE * gain, "N"),
        "eq 3": same(DRAG, float(law.drag_force(TABLE, BUS)[0]), "N"),
        "eq 4": same(CLIMB, climbing, "N"),
        "eq 5": same(ROLL, rolling, "N"),
        "eq 6": _near(0.08, math.sin(steep), "", 0.004),
        "eq 7": _near(MASS * GRAVITY * (GRADE + COEFFICIENT), climbing + rolling, "N"),
        "eq 8": _near(
            TRACTION - DRAG - MASS * GRAVITY * (GRADE + COEFFICIENT), MASS * hill, "N"
        ),
    }  # fmt: skip


def _sensor() -> dict[str, Found]:
    """Return eqs. 9 to 12 and 14: what an accelerometer reads, and the force balance with it."""
    down = np.array([0.0, 0.0, -GRAVITY])
    along = ACCEL * np.array([math.cos(GRADE), 0.0, -math.sin(GRADE)])
    read = np.asarray(euler_to_matrix(0.0, GRADE, 0.0)).T @ (along + down)
    # A bend of 0.2 rad/s, the sensor 3 m ahead of the rear axle, which does not drift.
    turn, ahead = 0.2, 3.0
    bend = point_table(TORQUE, GEAR * AXLE / RADIUS, EFFICIENCY, rows=60)
    in_bend = GRAVITY * math.sin(GRADE) + ACCEL - turn * (turn * ahead)
    bend = replace(bend, heading=turn * bend.time, specific_force=np.full(60, in_bend))
    settings = robust_rls.RobustRlsFilter(sensor_ahead=ahead)
    taken = robust_rls.as_set(ForceBalance(motion=None, table=bend), BUS, settings)  # type: ignore[arg-type]
    straight = float(taken.balance.table.specific_force[30])
    reading = float(TABLE.specific_force[0])
    once, twice = (
        float(robust_rls.rows(TABLE, BUS, replace(PRINTED.ekf.start, count_grade_twice=c))[0][0])
        for c in (False, True)
    )
    phi = reading + (COEFFICIENT + GRADE) * GRAVITY
    resting = replace(BUS, driveline=replace(BUS.driveline, engine_inertia=0.0, wheel_inertia=0.0))
    y = float(law.force_on_mass(TABLE, resting)[0])
    return {
        "eq 9": _near(straight, in_bend + turn * (turn * ahead), "m/s²", 1e-6),
        "eq 10": same(GRAVITY * math.cos(GRADE), -read[2], "m/s²"),
        "eq 11": same(GRAVITY * math.sin(GRADE) + ACCEL, read[0], "m/s²"),
        "eq 12": _near(MASS * phi, MASS * twice, "N"),
        "eq 12 ours": _near(MASS * phi, MASS * once, "N"),
        "eq 14": _near(phi, twice, "m/s²"),
        "eq 14 ours": _near(phi, once, "m/s²"),
        "eq 14 y": same(TRACTION - DRAG, y, "N"),
    }


def _folded(settings: robust_rls.RobustRlsFilter, y: float) -> tuple[float, float, float]:
    """Fold one row into 9000 kg with P = 1e-3: mass, P and Huber's weight."""
    params = robust_rls.parameters(settings, STEP)
    start = least_squares.initial_state(9000.0, 1e3)  # type: ignore[no-untyped-call]
    state, weight = least_squares.fold(start._replace(windows=1), 0.8, y, params)
    return float(state.mass), 1.0 / float(state.information), float(weight)


def _least_squares() -> dict[str, Found]:
    """Return eqs. 13 and 15 to 20."""
    limit, p, phi, forgetting, theta = 500.0, 1e-3, 0.8, 0.999, 9000.0
    plain = replace(PRINTED.ekf.start, threshold_force=1e12, settle_windows=0)
    robust = replace(plain, threshold_force=limit)
    gain = p * phi / (forgetting + phi * p * phi)
    covariance = p * (1.0 - gain * phi) / forgetting
    off = 900.0
    mass, after, _ = _folded(plain, phi * theta + off)
    weighted, same_after, weight = _folded(robust, phi * theta + off)
    psi = limit / off

    def rho(r: float) -> float:
        return 0.5 * r * r if abs(r) <= limit else limit * abs(r) - 0.5 * limit**2

    slope = (rho(off + 1e-3) - rho(off - 1e-3)) / 2e-3
    rng = np.random.default_rng(1)
    phis = rng.uniform(0.2, 1.2, 4000)
    force = phis * theta + rng.normal(0.0, 200.0, 4000)
    force[::10] += 4000.0
    params = robust_rls.parameters(replace(robust, forgetting=1.0), STEP)
    begin = least_squares.initial_state(theta, 1.0)  # type: ignore[no-untyped-call]
    clock = STEP * np.arange(4000)
    course = least_squares.run(begin, clock, phis, force, np.ones(4000, dtype=bool), params)[1]
    least = minimize_scalar(
        lambda mass: sum(rho(r) for r in force - phis * mass), (8000.0, 9500.0)
    ).x
    return {
        "eq 13": same(theta, _folded(plain, phi * theta)[0], "kg"),
        "eq 15": same([theta + gain * off, covariance], [mass, after]),
        "eq 16": _near(float(least), float(course[-1]), "kg", 0.005),
        "eq 17": _near(slope, weight * off, "N", 1e-6),
        "eq 18": _near(slope / off, weight, "", 1e-6),
        "eq 19": same([psi, 1.0], [weight, _folded(robust, phi * theta + 499.0)[2]]),
        "eq 20": same([theta + gain * psi * off, covariance], [weighted, same_after]),
    }


def _kalman() -> dict[str, Found]:
    """Return eqs. 21 to 33, with rotating parts: delta is one and what they weigh over M."""
    rotating = float(law.rotating_mass(BUS, TABLE.gearing)[0])
    delta = 1.0 + rotating / MASS
    params = _params()
    blind = params._replace(speed_density=1e30, grade_density=1e30)
    start = mass_ekf.initial_state(MASS, 300.0**2, _row(0.0, rotating=rotating), params)
    x = np.array([SPEED, GRADE, MASS, 0.0])
    cov = np.diag([1e-4, 1e-6, 300.0**2, 0.0])
    cov[0, 2] = cov[2, 0] = 0.5
    start = start._replace(x=x.copy(), cov=cov.copy())
    row = _row(STEP, rotating=rotating)
    ahead = mass_ekf.step(start, row, blind)[0]
    updated = mass_ekf.step(start, row, params)[0]
    force = TORQUE * GEAR * AXLE * EFFICIENCY / (MASS * RADIUS)
    level = force - GRAVITY * COEFFICIENT - DRAG / MASS
    printed = (level - GRAVITY * GRADE) / delta
    ours, by_speed, by_grade, by_mass = _accel(MASS, rotating=rotating)
    jacobian = np.eye(3)
    jacobian[0] = (
        1.0 - 0.69 * 7.9 * DENSITY * SPEED * STEP / (delta * MASS),
        -GRAVITY * STEP / delta,
        (0.69 * 7.9 * DENSITY * SPEED**2 * RADIUS - 2.0 * TRACTION * RADIUS)
        / (2.0 * delta * MASS**2 * RADIUS) * STEP,
    )  # fmt: skip
    code = np.eye(3)
    code[0] += STEP * np.array([by_speed, by_grade, by_mass])
    noise = STEP * np.array([0.0, params.grade_walk, params.mass_walk])
    # What walks does so before the speed is predicted.
    predicted = code @ (cov[:3, :3] + np.diag(noise)) @ code.T
    predicted[0, 0] += STEP * params.accel_walk
    measure = np.eye(2, 3)
    spread = np.diag([params.speed_density, params.grade_density]) / STEP
    gain = predicted @ measure.T @ np.linalg.inv(measure @ predicted @ measure.T + spread)
    before = np.array([SPEED + STEP * ours, GRADE, MASS])
    innovation = np.array([row.speed, row.grade]) - measure @ before
    after, left = before + gain @ innovation, predicted - gain @ measure @ predicted
    rates = [(jacobian - np.eye(3))[0, k] / STEP for k in range(3)]
    states = int(np.count_nonzero(np.diag(mass_ekf.initial_state(MASS, 1.0, row, params).cov)))
    held = rotating / (MASS + rotating)
    scale = np.sqrt(np.outer(np.diag(left), np.diag(left)))
    return {
        "eq 21": same(3.0, float(states), "states"),
        "eq 22": _near(SPEED + STEP * printed, float(ahead.x[0]), "m/s"),
        "eq 23": _near(printed, ours, "m/s²", 0.01),
        "eq 24": same(before, ahead.x[:3]),
        "eq 25": same(before[1:], ahead.x[1:3]),
        "eq 26": same(measure @ before, [ahead.x[0], ahead.x[1]]),
        "eq 27": _near(
            float(STEP * (_accel(MASS + 1.0, rotating=rotating)[0] - ours)),
            STEP * by_mass, "m/s per kg", 1e-3,
        ),
        "eq 28": _near(rates[0], by_speed + GRAVITY * ROLLING_SPEED / delta, "1/s", 0.01),
        "eq 28 grade": _near(rates[1], by_grade, "m/s²"),
        "eq 28 mass": _near(rates[2], by_mass, "m/s² per kg", held + 0.01),
        "eq 29": same(before, ahead.x[:3]),
        "eq 30": same(predicted / scale, ahead.cov[:3, :3] / scale),
        "eq 31": same(gain @ innovation, updated.x[:3] - before),
        "eq 32": same(after, updated.x[:3]),
        "eq 33": same(left / scale, updated.cov[:3, :3] / scale),
    }  # fmt: skip


def _blend() -> dict[str, Found]:
    """Return eq. 34: one row given to both filters, blended by the speed."""
    params = hybrid.parameters(PRINTED, BUS, STEP)
    start = hybrid_mass.initial_state(least_squares.initial_state(9500.0, 1e3), params)  # type: ignore[no-untyped-call]
    kalman = mass_ekf.initial_state(10_400.0, 1e4, _row(0.0), params.ekf)
    start = start._replace(ekf=kalman, started=True)
    slow = _row(STEP)._replace(speed=params.blend_speed - 0.5)
    state, *_ = hybrid_mass.step(start, slow, 0.8, 7700.0, params)
    share = 1.0 / (1.0 + math.exp(-0.5 / params.blend_width))
    parts: Floats = np.array([state.rls.mass, state.ekf.x[2]])
    return {"eq 34": same(share * parts[0] + (1.0 - share) * parts[1], float(state.mass), "kg")}


def equations() -> dict[str, Found]:
    """Return every equation, by the names that the items ask for."""
    return _model() | _sensor() | _least_squares() | _kalman() | _blend()
