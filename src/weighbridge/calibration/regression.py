"""Torque model and road load from drives of known mass, as one linear fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from weighbridge.balance.law import ROAD_PARAMETERS, reading_columns, road_columns
from weighbridge.balance.table import ForceTable
from weighbridge.constants import INDEPENDENT
from weighbridge.messages import refused
from weighbridge.signals import Bools, Floats, huber, spread


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueRows:
    """Rows of eq. 48: torque of the source against torque of the motion.

    Attributes
    ----------
    design : (n, p + 4) columns of the torque regression, then of
        `ROAD_PARAMETERS`, such that ``design @ parameters = target``
    target : (n,) torque that lifts and accelerates the known mass [N m]
    time : (n,) instants, several drives one after another [s]
    """

    design: Floats
    target: Floats
    time: Floats

    @property
    def block(self) -> Floats:
        """(n,) number of the block of dependent rows each row belongs to."""
        return np.floor(self.time / INDEPENDENT)


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueFit:
    """Optimum of eq. 48.

    Attributes
    ----------
    coefficients : (p,) w0, w1 ... of eq. 49, then the curvature if there is one
    road : (4,) `ROAD_PARAMETERS`
    cov : (p + 4, p + 4) their covariance, zero where a bound holds
    weight : (n,) what each row counted, in (0, 1]
    residual : (n,) [N m]
    r_squared : of source torque against torque of the motion, with the weights
        of the fit [-]
    residual_std : robust [N m]
    at_bound : names of the road parameters that a bound holds
    independent_rows : rows that would say as much if none depended on another
    """

    coefficients: Floats
    road: Floats
    cov: Floats
    weight: Floats
    residual: Floats
    r_squared: float
    residual_std: float
    at_bound: tuple[str, ...]
    independent_rows: float


def build_rows(
    table: ForceTable,
    regressor: Floats,
    engine_speed: Floats,
    *,
    mass: float,
    wheel_radius: float,
    order: int,
    curved: bool,
    rows: Bools,
) -> TorqueRows:
    """Write eq. 48 for the rows of one drive.

    Parameters
    ----------
    table : (n,) force table of the drive
    regressor : (n,) load [-], air-flow torque or measured torque [N m]
    engine_speed : (n,) [rad/s]
    mass : known mass [kg]
    wheel_radius : [m]
    order : highest power of engine speed in eq. 49
    curved : let the slope over load change with engine speed and load
    rows : (n,) which rows to take

    References
    ----------
    Jensen et al. 2022, eqs. 3, 48, 49, with the drivetrain efficiency at one.
    """
    gearing = table.gearing[rows]
    torque = reading_columns(
        np.ones(gearing.size), regressor[rows], engine_speed[rows], order=order, curved=curved
    )
    # Eq. 48 is the law over the gearing: torque on the left, what it moves on the right.
    road = road_columns(table, mass, wheel_radius)[rows] / gearing[:, None]
    return TorqueRows(
        design=np.hstack([torque, -road]),
        target=mass * table.specific_force[rows] / gearing,
        time=table.time[rows],
    )


def join_rows(parts: list[TorqueRows]) -> TorqueRows:
    """Put the rows of several drives under each other."""
    end = 0.0
    times = []
    for part in parts:
        first = float(part.time.min(initial=0.0))
        times.append(part.time - first + end)
        # Rows of two drives never share a block.
        end = (np.floor(times[-1].max(initial=0.0) / INDEPENDENT) + 2.0) * INDEPENDENT
    return TorqueRows(
        design=np.vstack([p.design for p in parts]),
        target=np.concatenate([p.target for p in parts]),
        time=np.concatenate(times),
    )


def fit(rows: TorqueRows, low: Floats, high: Floats, *, iterations: int = 12) -> TorqueFit:
    """Solve eq. 48 with bounds and a Huber loss.

    The problem is linear in all parameters, so its optimum is global and each
    reweighting costs one small solve.

    Parameters
    ----------
    rows : (n, p + 4) of the design
    low, high : (4,) bounds of `ROAD_PARAMETERS`
    iterations : at most, of reweighting

    Raises
    ------
    DriveError
        Too few rows.
    """
    n, width = rows.design.shape
    if n < 20 * width:
        raise refused("calibration.few_samples", count=n, parameters=width)
    scale = np.sqrt(np.mean(rows.design**2, axis=0))
    scale[scale == 0.0] = 1.0
    lower = np.concatenate([np.full(width - 4, -np.inf), low]) * scale
    upper = np.concatenate([np.full(width - 4, np.inf), high]) * scale
    # A parameter whose bounds coincide is known; lsq_linear wants an interval.
    upper[-4:] = np.maximum(upper[-4:], lower[-4:] + 1e-9 * (1.0 + lower[-4:]))
    design = rows.design / scale

    weight = np.ones(n)
    parameters = np.zeros(width)
    for _ in range(iterations):
        root = np.sqrt(weight)
        weighted = np.column_stack([design, rows.target]) * root[:, None]
        r = np.asarray(np.linalg.qr(weighted, mode="r"))
        solved = lsq_linear(r[:, :width], r[:, width], bounds=(lower, upper), method="bvls").x
        residual = rows.target - design @ solved
        weight = huber(residual, spread(residual))
        moved = np.max(np.abs(solved - parameters))
        parameters = solved
        if moved < 1e-9 * np.max(np.abs(solved)):
            break

    held = np.zeros(width, dtype=bool)
    margin = 1e-6 * (upper[-4:] - lower[-4:])
    held[-4:] = (parameters[-4:] <= lower[-4:] + margin) | (parameters[-4:] >= upper[-4:] - margin)
    cov, dependence = _sandwich(design, residual, weight, rows.block, ~held)
    cov = cov / np.outer(scale, scale)
    parameters = parameters / scale
    return TorqueFit(
        coefficients=parameters[:-4],
        road=parameters[-4:],
        cov=cov,
        weight=weight,
        residual=residual,
        r_squared=_r_squared(rows.target - rows.design[:, -4:] @ parameters[-4:], residual, weight),
        residual_std=spread(residual),
        at_bound=tuple(name for name, at in zip(ROAD_PARAMETERS, held[-4:], strict=True) if at),
        independent_rows=n / dependence,
    )


def driven_slope(fitted: TorqueFit, rows: TorqueRows, *, curved: bool) -> tuple[float, float]:
    """Slope of the torque over its source, mean of the loads and engine speeds driven.

    The coefficient of the source alone is the slope at zero load and zero engine speed,
    where no engine runs.

    Parameters
    ----------
    fitted, rows
    curved : the slope changes with engine speed and load

    Returns
    -------
    slope : [N m per unit of the source]
    std : its standard deviation
    """
    slope = np.zeros(fitted.coefficients.size)
    slope[1] = 1.0
    if curved:
        source = rows.design[:, 1]
        there = source != 0.0
        engine_speed = rows.design[there, slope.size - 2] / source[there]
        slope[-2] = float(np.average(engine_speed, weights=fitted.weight[there]))
        slope[-1] = 2.0 * float(np.average(source, weights=fitted.weight))
    cov = fitted.cov[: slope.size, : slope.size]
    return float(slope @ fitted.coefficients), float(np.sqrt(slope @ cov @ slope))


def _r_squared(torque: Floats, residual: Floats, weight: Floats) -> float:
    """Part of the torque of the motion that the source explains, with the fit's weights."""
    total = np.sum(weight * (torque - np.average(torque, weights=weight)) ** 2)
    return float(1.0 - np.sum(weight * residual**2) / total)


def _sandwich(
    design: Floats, residual: Floats, weight: Floats, block: Floats, free: Bools
) -> tuple[Floats, float]:
    """Covariance with rows of one block dependent (Liang and Zeger, Biometrika 73, 1986).

    The second value is how much larger its variances are than for independent rows.
    """
    cov = np.zeros((free.size, free.size))
    x = design[:, free]
    information = (x * weight[:, None]).T @ x
    score = x * (weight * residual)[:, None]
    order = np.argsort(block, kind="stable")
    starts = np.flatnonzero(np.diff(block[order], prepend=-1.0))
    sums = np.add.reduceat(score[order], starts, axis=0)
    bread = np.linalg.pinv(information, hermitian=True)
    correction = sums.shape[0] / max(sums.shape[0] - 1, 1)
    clustered = correction * bread @ (sums.T @ sums) @ bread
    independent = bread @ (score.T @ score) @ bread
    cov[np.ix_(free, free)] = clustered
    return cov, max(1.0, float(np.median(np.diag(clustered) / np.diag(independent))))
