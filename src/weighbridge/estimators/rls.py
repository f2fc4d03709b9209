"""Recursive least squares on the longitudinal model (Jensen et al. 2022)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.balance import ForceBalance, Reason, force_balance
from weighbridge.balance.table import ForceTable
from weighbridge.constants import INDEPENDENT
from weighbridge.errors import ConfigError
from weighbridge.estimators.fit_std import Fitted, judged
from weighbridge.estimators.gate import GateSettings
from weighbridge.estimators.judging import consider_std, converged_at, segments
from weighbridge.estimators.regression import regression
from weighbridge.estimators.track import MassTrack
from weighbridge.kernels import rls as kernel
from weighbridge.navigation import PrintedFilterSettings, mounting_of, printed_motion
from weighbridge.signals import Bools, Drive, Floats, Ints, spread
from weighbridge.vehicle import Vehicle

NOISE_SHARE: Final = 2.0
"""What noise of the motion costs, see `weighbridge.estimators.noisy_motion.row_noise_std` [-]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RlsSettings(GateSettings):
    """Settings of filter and gate; the filter's defaults are the paper's.

    Attributes
    ----------
    forgetting : weight kept by the past at each row of a 4 Hz log [-]; at other
        rates it is changed so that the memory in seconds stays
    initial_mass : [kg]
    initial_gain : p(0) [s^4/m^2]
    gate : rows with a larger normalised innovation are left out, ``inf`` for none, as in the
        paper [-]
    settle_rows : rows before the gate closes
    wind_up_guard : nothing is forgotten where the gain would grow beyond its start; the paper
        has no such guard
    every_row : every row with rising speed and a gear, as the paper has it: those of shifts,
        curves, a slipping clutch and a dragged engine too
    printed : as the paper: the motion by its own filter, no lateness of the torque, every row, no
        gate, no guard; the mass is that of the filter at the end of the drive
    filter : of the motion with ``printed``
    """

    forgetting: float = 0.9995
    initial_mass: float = 1000.0
    initial_gain: float = 1000.0
    gate: float = 5.0
    settle_rows: int = 200
    wind_up_guard: bool = True
    every_row: bool = False
    printed: bool = False
    filter: PrintedFilterSettings = field(default_factory=PrintedFilterSettings)

    def __post_init__(self) -> None:
        GateSettings.__post_init__(self)
        if not 0.9 < self.forgetting <= 1.0:
            raise ConfigError(f"forgetting must be in (0.9, 1], got {self.forgetting}")
        if not self.initial_gain > 0.0:
            raise ConfigError(f"initial_gain must be positive, got {self.initial_gain}")
        if not self.gate > 0.0:
            raise ConfigError(f"gate must be positive, got {self.gate}")

    @property
    def effective(self) -> RlsSettings:
        """The same with what ``printed`` means."""
        if not self.printed:
            return self
        return replace(self, gate=math.inf, wind_up_guard=False, every_row=True)


_LEFT_OUT_SINCE: Final = (
    Reason.BRAKING,
    Reason.SHIFTING,
    Reason.CLUTCH_SLIPPING,
    Reason.OVERRUN,
    Reason.EXTRAPOLATED,
    Reason.CORNERING,
)
"""Reasons against a row that the paper does not know."""

PAPER_RATE: Final = 4.0
"""Rate at which the forgetting factor of the paper applies [Hz] (sec. 7.1)."""


def parameters(settings: RlsSettings, period: float) -> kernel.RlsParams:
    """Make the kernel's parameters for rows ``period`` apart [s]."""
    settings = settings.effective
    forgetting = settings.forgetting ** (PAPER_RATE * period)
    return kernel.RlsParams(
        forgetting=forgetting,
        cov_limit=np.array([settings.initial_gain if settings.wind_up_guard else np.inf]),
        gate=settings.gate,
        scale_rows=400.0,
        settle_rows=settings.settle_rows,
        block=INDEPENDENT,
    )


def estimate(
    balance: ForceBalance, vehicle: Vehicle, settings: RlsSettings | None = None
) -> MassTrack:
    """Weigh by recursive least squares, rows with rising speed only.

    The running mass is the paper's filter. The final answer is the least
    squares of all the rows it took, for the mass of a drive does not change
    unnoticed; its standard deviation comes from leaving out one minute-long
    block at a time, so that slow errors count as what they are. With ``printed``
    the answer is the paper's filter at the end.

    Parameters
    ----------
    balance, vehicle
    settings : the paper's when None

    References
    ----------
    Jensen et al. 2022, eqs. 4-9. Quenouille's jackknife over blocks: Künsch,
    Annals of Statistics 17, 1989.
    """
    settings = (settings or RlsSettings()).effective
    table = balance.table
    phi, y, row_reason = _rows(balance, vehicle, settings)
    valid = row_reason == 0
    _, theta, var, _, taken = kernel.run(
        _start(settings), table.time, phi[:, None], y, valid, parameters(settings, _period(table))
    )
    row_reason[valid & ~taken] = Reason.BAD_FIT
    used = row_reason == Reason.USED

    mass, spread, blocks = block_jackknife(table.time, phi, y, used)
    # Before the first row there is a start value, but no measurement.
    running = np.where(np.cumsum(used) > 0, theta[:, 0], np.nan)
    if settings.printed and used.any():
        mass = float(running[-1])
    slow = consider_std(balance, phi, used, vehicle)
    fitted = Fitted(
        mass=mass,
        scatter=spread,
        blocks=blocks,
        index=np.flatnonzero(used),
        influence=phi[used] / np.sum(phi[used] ** 2),
    )
    found = judged(balance, vehicle, used, phi, fitted, slow, NOISE_SHARE, settings)
    residual = np.where(used, y - phi * mass, np.nan)

    def part(rows: slice) -> tuple[float, float]:
        return block_jackknife(table.time[rows], phi[rows], y[rows], used[rows], 20.0)[:2]

    return MassTrack(
        method="rls",
        balance=balance,
        running_mass=running,
        running_std=np.hypot(np.sqrt(var), running * slow),
        residual=residual,
        row_reason=row_reason,
        mass=mass,
        std=found.std,
        systematic_std=found.systematic_std,
        degrees_of_freedom=found.degrees_of_freedom,
        bound_std=_bound(phi, residual, used),
        converged_at=converged_at(table.time, running, mass, used),
        status=found.status,
        reason=found.reason,
        segments=segments(balance, vehicle, phi, used, part, settings),
    )


def printed_balance(drive: Drive, vehicle: Vehicle, settings: RlsSettings) -> ForceBalance | None:
    """Balance a drive by the paper's own filter of the motion, no lateness of the torque.

    None where the settings do not ask for what is printed.
    """
    if not settings.printed:
        return None
    mounting = mounting_of(drive, vehicle.mounting, settings.filter)
    motion = printed_motion(drive, mounting, settings.filter)
    return force_balance(drive, vehicle, motion, delay=0.0, lag=0.0)


def run_in_turn(
    balances: Sequence[ForceBalance], vehicle: Vehicle, settings: RlsSettings | None = None
) -> tuple[Floats, ...]:
    """Running mass of drives one after another: the filter keeps what it has learnt.

    Parameters
    ----------
    balances : in the order driven
    vehicle
    settings : the paper's when None

    Returns
    -------
    (n,) of each drive [kg]

    References
    ----------
    Jensen et al. 2022, fig. 13.
    """
    settings = (settings or RlsSettings()).effective
    state, end, found = _start(settings), 0.0, []
    for balance in balances:
        table = balance.table
        phi, y, row_reason = _rows(balance, vehicle, settings)
        # Times go on as well: blocks of dependent rows end with them.
        time = table.time - table.time[0] + end
        end = float(time[-1]) + INDEPENDENT
        state, theta, *_ = kernel.run(
            state, time, phi[:, None], y, row_reason == 0, parameters(settings, _period(table))
        )
        found.append(np.asarray(theta[:, 0]))
    return tuple(found)


def _rows(
    balance: ForceBalance, vehicle: Vehicle, settings: RlsSettings
) -> tuple[Floats, Floats, NDArray[np.uint8]]:
    """Regressor and right-hand side (n,) of a drive, and why a row is not taken (n,)."""
    table = balance.table
    phi, y = regression(table, vehicle)
    reason = table.reason.copy()
    if settings.every_row:
        reason[np.isin(reason, _LEFT_OUT_SINCE)] = Reason.USED
    reason[(reason == 0) & (table.accel <= 0.0)] = Reason.NOT_ACCELERATING
    reason[(reason == 0) & ~(np.isfinite(phi) & np.isfinite(y))] = Reason.NO_MOTION
    return phi, y, reason


def _start(settings: RlsSettings) -> kernel.RlsState:
    """State before the first row."""
    start: kernel.RlsState = kernel.initial_state(  # type: ignore[no-untyped-call]
        [settings.initial_mass], [[settings.initial_gain]]
    )
    return start


def _period(table: ForceTable) -> float:
    """Time between rows [s]."""
    return float(np.median(np.diff(table.time))) if table.time.size > 1 else 1.0 / PAPER_RATE


def block_jackknife(
    time: Floats, phi: Floats, y: Floats, used: Bools, block: float = INDEPENDENT
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
    return jackknife(number, phi[used] * y[used], phi[used] ** 2)


def jackknife(number: Ints, cross: Floats, power: Floats) -> tuple[float, float, int]:
    """Ratio of two sums over rows, and its standard deviation by leaving out one block at a time.

    Parameters
    ----------
    number : (m,) block of each row, 0 and above
    cross, power : (m,) terms of both sums; blocks without power say nothing

    Returns
    -------
    ratio, std : NaN without blocks; ``std`` infinite below three
    blocks : number of blocks that say something
    """
    above, below = (np.bincount(number, terms).astype(np.float64) for terms in (cross, power))
    above, below = above[below > 0.0], below[below > 0.0]
    n = int(below.size)
    if n == 0:
        return float("nan"), float("inf"), 0
    ratio = float(above.sum() / below.sum())
    if n < 3:
        return ratio, float("inf"), n
    without = (above.sum() - above) / (below.sum() - below)
    return ratio, float(np.sqrt((n - 1) / n * np.sum((without - without.mean()) ** 2))), n


def _bound(phi: Floats, residual: Floats, used: Bools) -> float:
    """Cramér-Rao bound if the residuals were white and the model true [kg]."""
    if np.count_nonzero(used) < 3:
        return float("nan")
    noise = spread(residual[used])
    return noise / float(np.sqrt(np.sum(phi[used] ** 2)))
