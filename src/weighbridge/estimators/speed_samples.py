"""Speed at even instants, and the forces that acted between them, of a force balance."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.balance import ForceBalance, law
from weighbridge.balance.instants import behind
from weighbridge.balance.table import ForceTable
from weighbridge.constants import GRAVITY
from weighbridge.estimators.joint.terms import RESISTANCE_STD, terms_of
from weighbridge.kernels import speed_torque_ekf as kernel
from weighbridge.signals import Bools, Floats, Ints
from weighbridge.vehicle import Vehicle

ROLLING_STD: Final = RESISTANCE_STD / GRAVITY
"""Standard deviation of the slow error of the rolling coefficient [-]: a fifth of a car's."""

GAP: Final = 1.5
"""Rows of the force further apart show no mean [s]; of slow polling, 2.5 of its periods."""


def sampled(
    balance: ForceBalance,
    vehicle: Vehicle,
    length: float,
    *,
    measured_grade: bool = True,
    measured_jacobian: bool = True,
    constant_errors: bool = True,
) -> tuple[Floats, kernel.Columns]:
    """Sample the speed every ``length`` [s], with the mean of the forces between.

    The speed is that recorded, on the clock of the motion, and as late as the torque: it passes
    through the first-order lag that the control unit smooths the torque with.

    Parameters
    ----------
    balance : best of a motion by speed; of another one the motion's own speed is taken
    vehicle
    length : between samples, at least that of the motion's clock [s]
    measured_grade : take the grade of the motion; level road otherwise
    measured_jacobian : hand on the measured acceleration, at which to linearise
    constant_errors : with `constant_columns`

    Returns
    -------
    time : (n,) of the samples [s]
    table : what `weighbridge.kernels.speed_torque_ekf.run` reads
    """
    motion, table = balance.motion, balance.table
    lag = vehicle.timing.torque_lag
    smooth, raw = motion.speed, motion.speed
    if motion.measured_speed is not None:
        raw = np.interp(motion.time, motion.measured_speed.time, motion.measured_speed.values)
    if lag > 0.0:
        smooth, raw = behind(smooth, motion.rate, lag), behind(raw, motion.rate, lag)
    every = slice(None, None, max(1, round(length * motion.rate)))
    time = motion.time[every]
    between = np.maximum(np.diff(time, prepend=time[0]), 1e-9)
    accel = np.diff(smooth[every], prepend=smooth[0]) / between
    known = _known(table)
    nothing = np.zeros(time.size)

    def mean(values: Floats) -> Floats:
        filled = np.where(known, np.nan_to_num(values), 0.0)
        return span_means(table.time, filled, time) if table.time.size > 1 else nothing

    period = float(np.median(np.diff(table.time))) if table.time.size > 1 else np.inf
    columns = [mean(c) for c in constant_columns(table, vehicle)] if constant_errors else []
    return time, kernel.Columns(
        length=np.diff(time, prepend=time[0]),
        speed=np.where(motion.valid[every], raw[every], np.nan),
        force=mean(np.asarray(table.traction_force - law.ratio_force(table, vehicle))),
        # White noise of the rows: its mean over a span falls with the rows in it.
        force_var=mean(table.force_std**2) * period / between,
        drag=mean(law.drag_factor(table, vehicle)),
        headwind=mean(table.air_speed - table.speed),
        rotating=mean(law.rotating_mass(vehicle, table.gearing)),
        grade=mean(table.grade) if measured_grade else nothing,
        accel=accel if measured_jacobian else np.full(time.size, np.nan),
        columns=np.ascontiguousarray(
            np.column_stack(columns) if columns else np.empty((time.size, 0))
        ),
        on=covered(table.time, known, time),
    )


def _known(table: ForceTable) -> Bools:
    return np.asarray(table.usable & np.isfinite(table.traction_force) & np.isfinite(table.gearing))


def constant_columns(table: ForceTable, vehicle: Vehicle) -> list[Floats]:
    """Columns (n,) of the errors of the force that last as long as the drive [N per unit].

    Drag area and friction of a cold start in the reading; of a data sheet offset of the torque and
    its growth with engine speed as well.
    """
    names = ("drag_area", "cold_torque", "torque_offset", "torque_growth")
    return [term.column(table, vehicle, 0.0) for term in terms_of(vehicle, names)]


def span_means(time: Floats, values: Floats, edges: Floats) -> Floats:
    """Average a line through values over the span before each edge; the first is 0.

    Parameters
    ----------
    time, values : (m,) rising, at least two; beyond its ends the line counts as 0
    edges : (n,) rising

    Returns
    -------
    (n,)
    """
    steps = np.diff(time)
    total = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * steps)))
    k = np.clip(np.searchsorted(time, edges, side="right") - 1, 0, time.size - 2)
    into = np.clip(edges - time[k], 0.0, steps[k])
    slope = (values[k + 1] - values[k]) / steps[k]
    whole = total[k] + values[k] * into + 0.5 * slope * into**2
    return np.concatenate(([0.0], np.diff(whole) / np.diff(edges)))


def covered(time: Floats, known: Bools, edges: Floats) -> Bools:
    """Whether every row of the force from before each span until after it is known (n,).

    Parameters
    ----------
    time, known : (m,) rows of the force
    edges : (n,) ends of the spans
    """
    if time.size < 2 or edges.size < 2:
        return np.zeros(edges.size, dtype=bool)
    first = np.searchsorted(time, np.concatenate((edges[:1], edges[:-1])), side="right") - 1
    last = np.searchsorted(time, edges, side="left")
    inside = (first >= 0) & (last < time.size)
    first, last = np.clip(first, 0, time.size - 1), np.clip(last, 0, time.size - 1)
    steps = np.diff(time)
    wide = np.concatenate(([0], np.cumsum(steps > max(GAP, 2.5 * float(np.median(steps))))))
    unknown = np.concatenate(([0], np.cumsum(~known)))
    whole = (unknown[last + 1] == unknown[first]) & (wide[last] == wide[first])
    whole[0] = False
    return np.asarray(inside & whole)


def span_of(time: Floats, edges: Floats) -> Ints:
    """Return the span that each instant lies in (m,): that which ends at this edge."""
    return np.asarray(np.minimum(np.searchsorted(edges, time, side="left"), edges.size - 1))
