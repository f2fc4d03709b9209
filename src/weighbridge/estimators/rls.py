"""Recursive least squares on the longitudinal model (Jensen et al. 2022)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.balance import ForceBalance, Reason
from weighbridge.balance.force_balance import MergedView
from weighbridge.constants import GRAVITY
from weighbridge.errors import ConfigError
from weighbridge.estimators.track import MassTrack, Segment, Status
from weighbridge.kernels import rls as kernel
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle.model import MASS_RANGE, TorqueSource, Vehicle

BLOCK: Final = 60.0
"""Rows nearer than this share wind, grade and torque errors [s]."""

LIGHTEST: Final = 0.85
"""Below this part of the tare no error of the calibration explains the mass [-]."""

STOP: Final = 20.0
"""A standstill this long may change the load [s]."""

WARMING: Final = 600.0
"""Time in which engine and tyres warm [s]."""

COLD_STD: Final[dict[TorqueSource, float]] = {
    "measured": 0.02,
    "percent": 0.02,
    "load": 0.05,
    "air_flow": 0.05,
}
"""Standard deviation of a mass made from the first `WARMING` alone, relative [-]. Load and
air flow count the friction of a cold engine as traction: simulated cold drives of 13
minutes came out 5 to 8 % heavy, and right when warm. Measured torque leaves the tyres, a
fifth more rolling resistance."""

UNCALIBRATED_STD: Final = 0.06
"""Relative standard deviation of masses by a vehicle file that was never calibrated and
does not say how sure it is [-]: torque and efficiency 4 %, rolling radius 2 %, lean of the
accelerometer 3 %."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RlsSettings:
    """Settings of the filter; the defaults are the paper's.

    Attributes
    ----------
    forgetting : weight kept by the past at each row of a 4 Hz log [-]; at other
        rates it is changed so that the memory in seconds stays
    initial_mass : [kg]
    initial_gain : p(0) [s^4/m^2]
    gate : rows with a larger normalised innovation are left out [-]
    settle_rows : rows before the gate closes
    """

    forgetting: float = 0.9995
    initial_mass: float = 1000.0
    initial_gain: float = 1000.0
    gate: float = 5.0
    settle_rows: int = 200

    def __post_init__(self) -> None:
        if not 0.9 < self.forgetting <= 1.0:
            raise ConfigError(f"forgetting must be in (0.9, 1], got {self.forgetting}")
        if not self.initial_gain > 0.0:
            raise ConfigError(f"initial_gain must be positive, got {self.initial_gain}")


PAPER_RATE: Final = 4.0
"""Rate at which the forgetting factor of the paper applies [Hz] (sec. 7.1)."""


def regression(view: MergedView, vehicle: Vehicle) -> tuple[Floats, Floats]:
    """Regressor and right-hand side of the mass (Jensen 2022, eqs. 5, 6).

    The two terms ``v' + g sin(grade)`` of eq. 5 are the specific force along
    the road.

    Returns
    -------
    phi : (n,) [m/s^2]
    y : (n,) [N]
    """
    rolling = vehicle.road_load.rolling_coefficient
    phi = view.specific_force + GRAVITY * rolling * np.cos(view.grade)
    y = view.traction_force - view.drag_force - view.rotating_mass * view.accel
    return phi, y


def parameters(settings: RlsSettings, period: float) -> kernel.RlsParams:
    """Make the kernel's parameters for rows ``period`` apart [s]."""
    forgetting = settings.forgetting ** (PAPER_RATE * period)
    return kernel.RlsParams(
        forgetting=forgetting,
        cov_limit=np.array([settings.initial_gain]),
        gate=settings.gate,
        scale_rows=400.0,
        settle_rows=settings.settle_rows,
        block=BLOCK,
    )


def estimate(
    balance: ForceBalance, vehicle: Vehicle, settings: RlsSettings | None = None
) -> MassTrack:
    """Weigh by recursive least squares, rows with rising speed only.

    The running mass is the paper's filter. The final answer is the least
    squares of all the rows it took, for the mass of a drive does not change
    unnoticed; its standard deviation comes from leaving out one minute-long
    block at a time, so that slow errors count as what they are.

    Parameters
    ----------
    balance, vehicle
    settings : the paper's when None

    References
    ----------
    Jensen et al. 2022, eqs. 4-9. Quenouille's jackknife over blocks: Künsch,
    Annals of Statistics 17, 1989.
    """
    settings = settings or RlsSettings()
    view = balance.merged
    phi, y = regression(view, vehicle)
    reason = view.reason.copy()
    reason[(reason == 0) & (view.accel <= 0.0)] = Reason.NOT_ACCELERATING
    valid = (reason == 0) & np.isfinite(phi) & np.isfinite(y)
    period = float(np.median(np.diff(view.time))) if view.time.size > 1 else 1.0 / PAPER_RATE
    state = kernel.initial_state(  # type: ignore[no-untyped-call]
        [settings.initial_mass], [[settings.initial_gain]]
    )
    state, theta, var, _, taken = kernel.run(
        state, view.time, phi[:, None], y, valid, parameters(settings, period)
    )
    reason[valid & ~taken] = Reason.BAD_FIT
    used = reason == Reason.USED

    mass, spread, blocks = block_jackknife(view.time, phi, y, used)
    slow = consider_std(view.time, phi, used, vehicle)
    std = float(np.hypot(spread, mass * slow))
    residual = np.where(used, y - phi * mass, np.nan)
    running = theta[:, 0]
    status, why = judge(view, vehicle, used, mass, std, blocks)
    return MassTrack(
        method="rls",
        balance=balance,
        running_mass=running,
        running_std=np.sqrt(var),
        residual=residual,
        reason=reason,
        mass=mass,
        std=std,
        degrees_of_freedom=float(max(blocks - 1, 1)),
        bound_std=_bound(phi, residual, used),
        converged_at=_converged_at(view.time, running, mass, used),
        status=status,
        why=why,
        segments=_segments(view, phi, y, used),
    )


def block_jackknife(
    time: Floats, phi: Floats, y: Floats, used: Bools, block: float = BLOCK
) -> tuple[float, float, int]:
    """Least squares of ``y`` on ``phi`` and its standard deviation by blocks of time.

    Returns
    -------
    slope, std : NaN without rows; ``std`` infinite below three blocks
    blocks : number of blocks with rows
    """
    if not used.any():
        return float("nan"), float("inf"), 0
    number = ((time[used] - time[used][0]) // block).astype(np.int64)
    cross = np.bincount(number, phi[used] * y[used])
    power = np.bincount(number, phi[used] ** 2)
    cross, power = cross[power > 0.0], power[power > 0.0]
    slope = float(cross.sum() / power.sum())
    if power.size < 3:
        return slope, float("inf"), int(power.size)
    without = (cross.sum() - cross) / (power.sum() - power)
    n = power.size
    std = float(np.sqrt((n - 1) / n * np.sum((without - without.mean()) ** 2)))
    return slope, std, int(n)


def consider_std(time: Floats, phi: Floats, used: Bools, vehicle: Vehicle) -> float:
    """Relative standard deviation that no row of this drive can take away [-].

    What the calibration left open, and the cold start: engine and tyres that
    are not warm yet make a vehicle seem heavy, by as much as `COLD_STD` where
    all that was learnt is from the first `WARMING` of driving.
    """
    scale = vehicle.provenance.mass_scale_std
    if scale is None:
        scale = UNCALIBRATED_STD
    if not used.any():
        return scale
    power = phi[used] ** 2
    moving = time[used]
    early = float(np.sum(power[moving < moving[0] + WARMING]) / np.sum(power))
    return float(np.hypot(scale, early * COLD_STD[vehicle.torque.source]))


def judge(
    view: MergedView, vehicle: Vehicle, used: Bools, mass: float, std: float, blocks: int
) -> tuple[Status, str]:
    """Say whether the rows carry a mass, and why not."""
    count = int(np.count_nonzero(used))
    if count < 50 or blocks < 3:
        told, share = np.unique(view.reason[view.reason != 0], return_counts=True)
        most = Reason(int(told[np.argmax(share)])).text if told.size else "too short"
        return Status.NOT_EXCITED, (
            f"only {count} usable samples with rising speed in {blocks} minute(s); "
            f"most of the others: {most}"
        )
    if not np.isfinite(std) or std > 0.15 * abs(mass):
        return Status.NOT_EXCITED, (
            f"the drive says {mass:.0f} kg give or take {std:.0f} kg, which is no weighing; "
            "more starts and hills are needed"
        )
    low, high = MASS_RANGE[vehicle.kind]
    if not low < mass < high:
        return Status.INCONSISTENT, (
            f"least squares end at {mass:.0f} kg, and a {vehicle.kind} has between {low:.0f} and "
            f"{high:.0f} kg; check the vehicle file's class and gearings and the torque's sign "
            "and scale"
        )
    if vehicle.tare is not None and mass + 3.0 * std < LIGHTEST * vehicle.tare:
        return Status.INCONSISTENT, (
            f"least squares end at {mass:.0f} kg, less than the tare of {vehicle.tare:.0f} kg; "
            "check that the vehicle file is this vehicle's, and the torque's scale"
        )
    return Status.CONVERGED, ""


def _bound(phi: Floats, residual: Floats, used: Bools) -> float:
    """Cramér-Rao bound if the residuals were white and the model true [kg]."""
    if np.count_nonzero(used) < 3:
        return float("nan")
    noise = 1.4826 * float(np.median(np.abs(residual[used])))
    return noise / float(np.sqrt(np.sum(phi[used] ** 2)))


def _converged_at(time: Floats, running: Floats, mass: float, used: Bools) -> float:
    off = np.abs(running - mass) > 0.05 * abs(mass)
    if not used.any() or not np.isfinite(mass) or off[-1]:
        return float("nan")
    last = np.flatnonzero(off)
    return float(time[last[-1] + 1]) if last.size else float(time[used][0])


def _segments(view: MergedView, phi: Floats, y: Floats, used: Bools) -> tuple[Segment, ...]:
    """Weigh between standstills of `STOP` or longer."""
    time = view.time
    if time.size < 2:
        return ()
    moving = np.nan_to_num(view.speed) > 0.5
    starts = np.flatnonzero(np.diff(np.concatenate(([False], moving))) & moving)
    edges = [0]
    for k in starts:
        before = np.flatnonzero(moving[:k])
        if before.size and time[k] - time[before[-1]] >= STOP:
            edges.append(int(k))
    segments = []
    for a, b in zip(edges, [*edges[1:], time.size], strict=True):
        part = slice(a, b)
        if not moving[part].any():
            continue
        mass, std, _ = block_jackknife(time[part], phi[part], y[part], used[part], 20.0)
        known = np.isfinite(std) and std < 0.15 * mass
        segments.append(
            Segment(
                start=float(time[a]),
                end=float(time[b - 1]),
                mass=mass if known else float("nan"),
                std=std if known else float("nan"),
            )
        )
    return tuple(segments)
