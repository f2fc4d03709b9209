"""The equations of Jensen et al. 2022, each computed as printed and by the code.

Axes are north-east-down and forward-right-down, as in the code: the paper mixes them with
forward-left-up, and eqs. 20 and 43 have the scalar of a quaternion last, eq. 26 first.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import pymap3d

from weighbridge.balance import law
from weighbridge.calibration import build_rows, grid_search
from weighbridge.constants import (
    GRAVITY,
    PETROL_HEATING_VALUE,
    PETROL_STOICHIOMETRIC_RATIO,
)
from weighbridge.estimators import rls
from weighbridge.estimators.regression import regression
from weighbridge.kernels import ins_printed
from weighbridge.kernels import rls as least_squares
from weighbridge.kernels.rotation import (
    euler_to_matrix,
    euler_to_quaternion,
    quaternion_to_matrix,
)
from weighbridge.navigation import PrintedFilterSettings
from weighbridge.papers.claims import Found, same
from weighbridge.papers.jensen2022_reproduction import PrintedSettings
from weighbridge.papers.point import ACCEL, DENSITY, GRADE, SPEED, point_table
from weighbridge.signals import Floats
from weighbridge.vehicle import (
    Driveline,
    RoadLoad,
    TorqueModel,
    Vehicle,
    effective_gearing,
    predict_gear,
    torque_rows,
)
from weighbridge.vehicle.gear import ratio_density
from weighbridge.vehicle.torque_sources import air_flow_torque

MASS: Final = 1580.0
RADIUS: Final = 0.319
RATIOS: Final = (3.188, 2.190, 1.517, 1.057, 0.738, 0.557, 0.433)
AXLE: Final = 4.234
DRAG_AREA, ROLLING, ENGINE, WHEELS = 0.70, 0.008, 0.14, 7.0
"""Table 6."""
EFFICIENCY: Final = 0.93
G: Final = RATIOS[3] * AXLE / RADIUS
TORQUE: Final = 95.0
SEMI_MAJOR, SEMI_MINOR = 6_378_137.0, 6_356_752.3142

CAR: Final = Vehicle(
    name="Table 1",
    driveline=Driveline(
        gearings=tuple(r * AXLE / RADIUS for r in RATIOS),
        wheel_radius=RADIUS,
        efficiency=EFFICIENCY,
        engine_inertia=ENGINE,
        wheel_inertia=WHEELS,
    ),
    torque=TorqueModel(source="measured"),
    road_load=RoadLoad(drag_area=DRAG_AREA, rolling_coefficient=ROLLING),
)
TABLE: Final = point_table(TORQUE, G, EFFICIENCY)

PHI: Final = ACCEL + GRAVITY * ROLLING * math.cos(GRADE) + GRAVITY * math.sin(GRADE)
TURNING: Final = (WHEELS / RADIUS**2 + ENGINE * G**2) * ACCEL
DRAG: Final = 0.5 * DENSITY * DRAG_AREA * SPEED**2
Y: Final = EFFICIENCY * TORQUE * G - DRAG - TURNING
"""Eqs. 5 and 6 as printed."""


def _model() -> dict[str, Found]:
    """Return eqs. 1 to 9."""
    phi, y = (float(column[0]) for column in regression(TABLE, CAR))
    torque = (MASS * PHI + DRAG + TURNING) / (EFFICIENCY * G)
    pulled = MASS * law.mass_column(TABLE, CAR) + law.drag_force(TABLE, CAR)
    pulled = pulled + law.rotating_mass(CAR, TABLE.gearing) * TABLE.accel
    needed = pulled / law.traction_gain(CAR, TABLE.torque, TABLE.gearing)
    settings = PrintedSettings()
    forgetting, p0, m0 = settings.forgetting, settings.initial_gain, settings.initial_mass
    gain = (p0 - (p0 * PHI) ** 2 / (forgetting + PHI * p0 * PHI)) / forgetting
    residual = Y - PHI * m0
    start = least_squares.initial_state([m0], [[p0]])  # type: ignore[no-untyped-call]
    params = rls.parameters(settings.rls, 1.0 / rls.PAPER_RATE)
    state, innovation, _ = least_squares.step(start, 0.0, np.array([phi]), y, params)
    return {
        "eq 1": same(
            (MASS + WHEELS / RADIUS**2 + ENGINE * G**2) * ACCEL + DRAG
            + MASS * GRAVITY * (ROLLING * math.cos(GRADE) + math.sin(GRADE)),
            float(pulled[0]), "N",
        ),
        "eq 2": same(Y / PHI, y / phi, "kg"),
        "eq 3": same(torque, float(needed[0]), "N m"),
        "eq 4": same(PHI * MASS - Y, phi * MASS - y, "N"),
        "eq 5": same(PHI, phi, "m/s²"),
        "eq 6": same(Y, y, "N"),
        "eq 7": same(gain, float(state.cov[0, 0]), "s⁴/m²"),
        "eq 8": same(m0 + gain * PHI * residual, float(state.theta[0]), "kg"),
        "eq 9": same(residual, float(innovation), "N"),
    }  # fmt: skip


def _gears() -> dict[str, Found]:
    """Return eqs. 10, 11 and 50."""
    turns = G * SPEED * 30.0 / math.pi * 1.01
    engine, speed = np.array([turns * math.pi / 30.0]), np.array([SPEED])
    ours = effective_gearing(engine, speed)
    printed = np.abs(np.array(CAR.driveline.gearings) - turns / SPEED * math.pi / 30.0)
    rng = np.random.default_rng(1)
    ratios = rng.choice(CAR.driveline.gearings, 400) * (1.0 + 0.01 * rng.normal(size=400))
    grid, counts = ratio_density(ratios, np.ones(400))
    inside = (0.98 * grid[:, None] <= ratios) & (ratios <= 1.02 * grid[:, None])
    return {
        "eq 10": same(turns / SPEED * math.pi / 30.0, ours, "1/m"),
        "eq 11": same(
            1.0 + float(np.argmin(printed)),
            float(predict_gear(engine, speed, np.array(CAR.driveline.gearings))[0][0]),
        ),
        "eq 50": same(inside.sum(axis=1).astype(float), counts, "samples"),
    }  # fmt: skip


def _earth() -> dict[str, Found]:
    """Return eqs. 12 to 16."""
    flatness = (SEMI_MAJOR - SEMI_MINOR) / SEMI_MAJOR
    square = flatness * (2.0 - flatness)

    def printed(lat: float, lon: float, height: float) -> Floats:
        normal = SEMI_MAJOR / math.sqrt(1.0 - square * math.sin(lat) ** 2)
        flat = (height + normal) * math.cos(lat)
        up = (height + (1.0 - square) * normal) * math.sin(lat)
        return np.array([flat * math.cos(lon), flat * math.sin(lon), up])

    lat, lon = math.radians(55.95), math.radians(12.5)
    here, there = (lat, lon, 40.0), (lat + 1e-3, lon - 2e-3, 55.0)
    ours = np.array(pymap3d.geodetic2ecef(*there, deg=False))
    s, c, sl, cl = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    turn = np.array([[-s * cl, -s * sl, c], [-sl, cl, 0.0], [-c * cl, -c * sl, -s]])
    ned = turn @ (printed(*there) - printed(*here))
    found = pymap3d.geodetic2ned(*there, *here, deg=False)
    flat = float(np.hypot(ours[0], ours[1]))
    normal = SEMI_MAJOR / math.sqrt(1.0 - square * math.sin(there[0]) ** 2)
    as_printed = printed(*there)
    return {
        "eq 12": same(as_printed[0], ours[0], "m"),
        "eq 13": same(as_printed[1], ours[1], "m"),
        "eq 14": same(as_printed[2], ours[2], "m"),
        "eq 15": same(normal, flat / math.cos(there[0]) - 55.0, "m"),
        "eq 16": _close(ned, np.array(found), 1e-6, "m"),
    }


def _close(printed: Floats, ours: Floats, within: float, unit: str = "") -> Found:
    """Compare to an absolute difference: eq. 16 subtracts numbers of 6000 km."""
    k = int(np.argmax(np.abs(printed - ours)))
    text = [f"{x.flat[k]:.9g} {unit}".strip() for x in (ours, printed)]
    return Found(text[0], bool(np.max(np.abs(printed - ours)) <= within), text[1])


def _about(axis: int, angle: float) -> Floats:
    """Direction cosine matrix about one axis (3, 3)."""
    c, s = math.cos(angle), math.sin(angle)
    a, b = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[a, a] = turn[b, b] = c
    turn[a, b], turn[b, a] = -s, s
    return turn


def _skew(v: Floats) -> Floats:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


STEP: Final = 0.005
FORCE: Final = np.array([0.9, -0.3, -9.6])
RATE: Final = np.array([0.02, -0.05, 0.3])
FIX: Final = np.array([3.0, -2.0, 0.5])
MEASURED: Final = 12.4
"""One sample of the filter: its length [s], inertial values, fix [m] and vehicle speed [m/s]."""

ANGLES: Final = (0.02, 0.05, 0.4)
"""Roll, pitch and yaw before it [rad]."""


class _Node(NamedTuple):
    """State (16,), covariance (15, 15) and corrected specific force forward of a sample."""

    x: Floats
    cov: Floats
    force: float


def _start() -> _Node:
    """State and covariance before the sample."""
    x = np.zeros(ins_printed.STATES)
    x[0:3], x[3:6] = (1.0, -1.0, 0.2), (11.0, 4.0, -0.3)
    x[6:10] = euler_to_quaternion(*ANGLES)
    x[10:13], x[13:16] = (0.02, -0.01, 0.03), (1e-3, -2e-3, 5e-4)
    mix = np.random.default_rng(2).normal(size=(15, 15)) * 0.05 + np.eye(15)
    scale = np.sqrt(np.diag(PrintedFilterSettings().covariance()))
    return _Node(x, scale[:, None] * (mix @ mix.T) * scale, math.nan)


def _run(*, samples: int = 2, aided: bool = False, attitude: bool = False) -> _Node:
    """Run the kernel: the first sample has no length, a second one is `STEP` later."""
    x, cov, _ = _start()
    speed, fix = np.full(samples, np.nan), np.full(samples, -1, dtype=np.int64)
    if aided:
        speed[-1], fix[-1] = MEASURED, 0
    # Until a speed is measured the vehicle stands, and this noise of the constraints holds.
    noise = PrintedFilterSettings(attitude_term=attitude).noise._replace(still_std=1e12)
    shown = np.empty((samples, ins_printed.SHOWN))
    ins_printed.run(
        x, cov, STEP * np.arange(samples, dtype=np.float64), np.tile(FORCE, (samples, 1)),
        np.tile(RATE, (samples, 1)), ins_printed.PrintedAid(speed, fix, FIX[None, :]), noise, shown,
    )  # fmt: skip
    return _Node(x, cov, float(shown[-1, 0]))


def _matrix(q: Floats) -> Floats:
    rot = np.empty((3, 3))
    quaternion_to_matrix(np.ascontiguousarray(q), rot)
    return rot


def _by_26(q: Floats) -> Floats:
    """Rotation matrix of eq. 26 with the vector of eq. 20 first and the scalar last (3, 3)."""
    w, x, y, z = q
    n = 2.0 / float(q @ q)
    return np.array([
        [1.0 - n * (y * y + z * z), n * (x * y - z * w), n * (x * z + y * w)],
        [n * (x * y + z * w), 1.0 - n * (x * x + z * z), n * (y * z - x * w)],
        [n * (x * z - y * w), n * (y * z + x * w), 1.0 - n * (x * x + y * y)],
    ])  # fmt: skip


def _by_43(rot: Floats) -> Floats:
    """Quaternion of eq. 43, its scalar last (4,)."""
    r = 0.5 * math.sqrt(1.0 + float(np.trace(rot)))
    parts = (rot[2, 1] - rot[1, 2], rot[0, 2] - rot[2, 0], rot[1, 0] - rot[0, 1])
    return np.array([*(part / (4.0 * r) for part in parts), r])


class _Predicted(NamedTuple):
    """Eqs. 22 to 29 and 33 to 36 in matrices."""

    x: Floats
    cov: Floats
    force: Floats
    navigation: Floats
    accel: Floats
    noise: Floats


def _predicted(x: Floats, cov: Floats) -> _Predicted:
    force, rate = FORCE + x[10:13], RATE + x[13:16]
    rot = _by_26(x[6:10])
    navigation = rot @ force
    # Down is positive here, so that gravity adds where eq. 27 takes it off.
    accel = navigation + np.array([0.0, 0.0, GRAVITY])
    a, b, c = rate
    omega = np.array([[0.0, c, -b, a], [-c, 0.0, a, b], [b, -a, 0.0, c], [-a, -b, -c, 0.0]])
    size = float(np.linalg.norm(rate))
    half = 0.5 * STEP * size
    turn = math.cos(half) * np.eye(4) + math.sin(half) * omega / size
    after = x.copy()
    after[0:3] = x[0:3] + STEP * x[3:6] + 0.5 * STEP**2 * accel
    after[3:6] = x[3:6] + STEP * accel
    after[6:10] = np.roll(turn @ np.roll(x[6:10], -1), 1)
    move, enter = np.eye(15), np.zeros((15, 12))
    move[0:3, 3:6] = STEP * np.eye(3)
    move[3:6, 6:9] = STEP * _skew(navigation)
    move[3:6, 9:12], move[6:9, 12:15] = STEP * rot, -STEP * rot
    enter[3:6, 0:3], enter[6:9, 3:6] = STEP * rot, STEP * rot
    enter[9:, 6:] = np.eye(6)
    noise = np.diag(np.repeat(np.square([0.03, 1e-5, 1e-3, 1e-6]), 3))
    return _Predicted(
        after, move @ cov @ move.T + enter @ noise @ enter.T, force, navigation, accel, noise
    )


def _updated(x: Floats, cov: Floats, *, attitude: bool) -> tuple[Floats, Floats]:
    """Return errors and covariance after eqs. 37 to 40 and 44 to 47."""
    rot = _by_26(x[6:10])
    measure = np.zeros((6, 15))
    measure[0:3, 0:3], measure[3:6, 3:6] = np.eye(3), rot.T
    if attitude:
        measure[3:6, 6:9] = -rot.T @ _skew(x[3:6])
    spread = np.diag(np.square([2.0, 2.0, 5.0, 0.5, 5.0, 15.0]))
    gain = cov @ measure.T @ np.linalg.inv(measure @ cov @ measure.T + spread)
    off = np.concatenate([FIX - x[0:3], np.array([MEASURED, 0.0, 0.0]) - rot.T @ x[3:6]])
    return gain @ off, (np.eye(15) - gain @ measure) @ cov


def _prediction() -> dict[str, Found]:
    """Return eqs. 17 to 36."""
    x, cov, _ = _start()
    still = _run(samples=1)
    made, ours = _predicted(x, still.cov), _run()
    dcm = _about(2, ANGLES[2]) @ _about(1, ANGLES[1]) @ _about(0, ANGLES[0])
    q = np.array(euler_to_quaternion(*ANGLES))
    small = 1e-4 * np.array([0.3, -0.2, 0.5])
    turned = np.eye(3) - _skew(small)
    by_kernel = euler_to_matrix(*(-small)) @ dcm
    scale = np.sqrt(np.outer(np.diag(made.cov), np.diag(made.cov)))
    grown, true_grown = np.diag(still.cov - cov)[9:], np.diag(made.noise)[6:]
    speeds = ours.x[3:6] - x[3:6]
    return {
        "eq 17": same(dcm, euler_to_matrix(*ANGLES)),
        "eq 18": same(10.0, float(ins_printed.STATES - 6), "states"),
        "eq 19": same(np.concatenate([made.x[:10]]), ours.x[:10]),
        "eq 20": same(_by_43(dcm), np.roll(q, -1)),
        "eq 21": same(true_grown / grown, np.ones(6)),
        "eq 22": same(made.force[0], ours.force, "m/s²"),
        "eq 23": same(made.x[6:10], ours.x[6:10]),
        "eq 24": same(made.x[9], ours.x[9]),
        "eq 25": same(STEP * made.navigation[:2], speeds[:2], "m/s"),
        "eq 26": same(_by_26(q), _matrix(q)),
        "eq 27": same(STEP * made.accel, speeds, "m/s"),
        "eq 28": same(made.x[0:3], ours.x[0:3], "m"),
        "eq 29": same(made.x[3:6], ours.x[3:6], "m/s"),
        "eq 31": _close(turned @ dcm, by_kernel, 1e-8),
        "eq 32": same(15.0, float(ins_printed.ERRORS), "errors"),
        "eq 33": same(made.cov / scale, ours.cov / scale),
        "eq 34": same((made.cov / scale)[3:9, 9:], (ours.cov / scale)[3:9, 9:]),
        "eq 35": same(np.diag(made.cov) / np.diag(ours.cov), np.ones(15)),
        "eq 36": same(np.diag(made.cov)[9:], np.diag(ours.cov)[9:]),
    }


def _update() -> dict[str, Found]:
    """Return eqs. 30 and 37 to 47: one fix and one speed; ours has the attitude in eq. 46."""
    x, _, _ = _start()
    made = _predicted(x, _run(samples=1).cov)
    error, left = _updated(made.x, made.cov, attitude=False)
    own, own_left = _updated(made.x, made.cov, attitude=True)
    updated, ours = _run(aided=True), _run(aided=True, attitude=True)
    moved = updated.x - made.x
    turned = (np.eye(3) - _skew(error[6:9])) @ _by_26(made.x[6:10])
    scale = np.sqrt(np.outer(np.diag(left), np.diag(left)))
    corrected = made.x[0:6] + error[0:6]
    return {
        "eq 30": same(error[0:6], moved[0:6]),
        "eq 37": same(error[9:12], moved[10:13], "m/s²"),
        "eq 38": same(error[0:3], moved[0:3], "m"),
        "eq 39": same(error[3:6], moved[3:6], "m/s"),
        "eq 40": same(error[12:15], moved[13:16], "rad/s"),
        "eq 41": same(corrected[0:3], updated.x[0:3], "m"),
        "eq 42": same(corrected[3:6], updated.x[3:6], "m/s"),
        # A sequence of small angles and a rotation vector are the same to first order.
        "eq 43": _close(np.roll(_by_43(turned), 1), updated.x[6:10], 1e-5),
        "eq 44": same(left / scale, updated.cov / scale),
        "eq 45": same(corrected, updated.x[0:6]),
        "eq 46": same(error[0:6], moved[0:6]),
        "eq 46 ours": same(error[0:6], (ours.x - made.x)[0:6]),
        "eq 46 attitude": same(
            np.concatenate([own[0:6], (own_left / scale).ravel()]),
            np.concatenate([(ours.x - made.x)[0:6], (ours.cov / scale).ravel()]),
        ),
        "eq 47": same(np.diag(left) / np.diag(updated.cov), np.ones(15)),
    }


def _torque() -> dict[str, Found]:
    """Return eqs. 48, 49 and 51."""
    rng = np.random.default_rng(3)
    n = 400
    table = point_table(TORQUE, G, 1.0, rows=n)
    speed, accel = rng.uniform(5.0, 35.0, n), rng.uniform(0.0, 2.0, n)
    grade, gearing = rng.normal(0.0, 0.02, n), rng.choice(CAR.driveline.gearings, n)
    table = replace(
        table, speed=speed, accel=accel, grade=grade, gearing=gearing, air_speed=speed,
        specific_force=accel + GRAVITY * np.sin(grade), engine_speed=gearing * speed,
    )  # fmt: skip
    load = rng.uniform(0.1, 0.35, n)
    rows = build_rows(
        table, load, table.engine_speed, mass=MASS, wheel_radius=RADIUS, order=2, curved=False,
        rows=np.ones(n, dtype=bool),
    )  # fmt: skip
    axes = tuple(np.linspace(0.5 * v, 1.5 * v, 3) for v in (DRAG_AREA, ROLLING, ENGINE, WHEELS))
    *_, cost = grid_search(rows, np.ones(n), axes)
    turns = table.engine_speed
    basis = np.column_stack([np.ones(n), load, turns, turns**2])
    best = math.inf
    for drag in axes[0]:
        for rolling in axes[1]:
            for engine in axes[2]:
                for wheels in axes[3]:
                    force = (MASS + wheels / RADIUS**2 + engine * gearing**2) * accel
                    force += 0.5 * DENSITY * drag * speed**2
                    force += MASS * GRAVITY * (rolling * np.cos(grade) + np.sin(grade))
                    needed = force / gearing
                    left = needed - basis @ np.linalg.lstsq(basis, needed, rcond=None)[0]
                    best = min(best, float(left @ left))
    weights = np.array([-17.85, 964.0, 2.5e-3 * 30.0 / math.pi, -1.44e-6 * (30.0 / math.pi) ** 2])
    ours = torque_rows(load[:1], turns[:1], 2) @ weights
    rpm = turns[0] * 30.0 / math.pi
    flow, efficiency = 0.02, PrintedSettings().engine_efficiency
    fuel = PETROL_HEATING_VALUE / PETROL_STOICHIOMETRIC_RATIO
    printed = efficiency * flow * fuel * 30.0 / (math.pi * rpm)
    air = air_flow_torque(np.array([flow]), turns[:1], np.ones(1), efficiency)
    return {
        "eq 48": _close(np.array([best]), np.array([cost]), 1e-6 * best, "N² m²"),
        "eq 49": same(-17.85 + 9.64 * 100.0 * load[0] + 2.5e-3 * rpm - 1.44e-6 * rpm**2, ours,
                      "N m"),
        "eq 51": same(printed, air, "N m"),
    }  # fmt: skip


def equations() -> dict[str, Found]:
    """Return every equation, by the names that the items ask for."""
    return _model() | _gears() | _earth() | _prediction() | _update() | _torque()
