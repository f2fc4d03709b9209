"""What a fit of the torque gives, whichever its method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from weighbridge.balance import ForceBalance, force_balance
from weighbridge.balance.force_balance import dragged_reading
from weighbridge.balance.law import drag_force, mass_column, rotating_force
from weighbridge.calibration.problem import Problem
from weighbridge.calibration.recording import DelayedRows, Recording
from weighbridge.messages import Problem as Message
from weighbridge.messages import refused
from weighbridge.results import DelaySearch, FittedRows
from weighbridge.signals import Floats
from weighbridge.vehicle import DraggedReading, Vehicle
from weighbridge.vehicle.model import EARLIEST_TORQUE, LATEST_TORQUE
from weighbridge.vehicle.torque import torque_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """A vehicle and the rows that it was fitted to.

    Attributes
    ----------
    vehicle
    rows : of each drive
    search : of the delay
    held : names of the road parameters that lie on a bound
    notes : what is uncertain in the fit
    """

    vehicle: Vehicle
    rows: tuple[DelayedRows, ...]
    search: DelaySearch
    held: tuple[str, ...] = ()
    notes: tuple[Message, ...] = ()


def noted(vehicle: Vehicle, message: Message) -> Vehicle:
    """Add a note for readers of the vehicle file, once."""
    note = message.text
    notes = vehicle.provenance.notes
    if notes is not None and note in notes:
        return vehicle
    notes = f"{notes}; {note}" if notes else note
    return replace(vehicle, provenance=replace(vehicle.provenance, notes=notes))


def check_delay(problem: Problem, delay: float) -> None:
    """Refuse a delay of the torque that no logger has, and say how to correct it.

    Raises
    ------
    DriveError
        No vehicle file takes it: torque and motion are on two clocks.
    """
    if EARLIEST_TORQUE <= delay <= LATEST_TORQUE:
        return
    signal = problem.source.signals[0]
    side = "early" if delay < 0.0 else "late"
    raise refused(
        "calibration.torque_clock",
        drives=problem.names,
        reading=signal,
        delay=abs(delay),
        side=side,
        earliest=-EARLIEST_TORQUE,
        latest=LATEST_TORQUE,
        by=-delay,
    )


def known_std(std: float) -> float | None:
    """Standard deviation of what was free; None for what a bound held."""
    return float(std) if std > 0.0 else None


def rebalanced(problem: Problem, vehicle: Vehicle) -> list[ForceBalance]:
    """Balance every drive with a vehicle."""
    return [
        force_balance(r.drive, vehicle, r.motion, engine_delay=r.engine_delay)
        for r in problem.recordings
    ]


def learnt_dragged(problem: Problem, vehicle: Vehicle) -> DraggedReading | None:
    """Learn what the source reads while the engine is dragged; as known where nothing shows."""
    drives = [r.drive for r in problem.recordings]
    motions = [r.motion for r in problem.recordings]
    return dragged_reading(drives, motions, vehicle) or vehicle.dragged


def ranges(
    problem: Problem, rows: Sequence[DelayedRows]
) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    """Engine speeds and loads that the fit has seen, a little widened."""
    if problem.source.signed:
        return None, None
    pulling = [part.usable & (part.table.accel > 0.0) for part in rows]
    speed = np.concatenate([p.engine_speed[use] for p, use in zip(rows, pulling, strict=True)])
    load = np.concatenate(
        [r.reading[use] for r, use in zip(problem.recordings, pulling, strict=True)]
    )
    slow, fast = np.percentile(speed, [0.1, 99.9])
    floor = min(r.floor for r in problem.recordings)
    lowest = floor if np.isfinite(floor) else float(np.min(load))
    return (float(0.95 * slow), float(1.05 * fast)), (lowest, 1.02 * float(np.max(load)))


def torques(vehicle: Vehicle, recording: Recording, rows: DelayedRows) -> tuple[Floats, Floats]:
    """Torque that a vehicle makes of the reading, and that the motion of the mass takes.

    Parameters
    ----------
    vehicle : with torque model, road load and inertias
    recording, rows : a drive at the vehicle's delay and lag

    Returns
    -------
    (n,), (n,) of all rows [N m]
    """
    table, model = rows.table, vehicle.torque
    torque = torque_of(model, recording.reading, rows.engine_speed)
    mass = recording.mass - table.fuel_burnt
    taken = mass * mass_column(table, vehicle) + drag_force(table, vehicle)
    taken += rotating_force(table, vehicle)
    return torque, np.asarray(taken / table.gearing)


def fitted_rows(vehicle: Vehicle, problem: Problem, rows: Sequence[DelayedRows]) -> FittedRows:
    """Put the fit's rows of all drives under each other, by the vehicle given."""
    parts: dict[str, list[Floats]] = {
        name: [] for name in ("time", "drive", "reading", "engine_speed", "source", "motion")
    }
    end = 0.0
    for k, (recording, part) in enumerate(zip(problem.recordings, rows, strict=True)):
        use = part.usable
        source, motion = torques(vehicle, recording, part)
        time = part.table.time[use] - part.table.time[0] + end
        end = float(time.max(initial=end)) + 60.0
        columns = (time, np.full(time.size, k), recording.reading[use], part.engine_speed[use],
                   source[use], motion[use])  # fmt: skip
        for name, values in zip(parts, columns, strict=True):
            parts[name].append(values)
    joined = {name: np.concatenate(values) for name, values in parts.items()}
    return FittedRows(
        time=joined["time"],
        drive=joined["drive"].astype(np.int64),
        reading=joined["reading"],
        engine_speed=joined["engine_speed"],
        source_torque=joined["source"],
        motion_torque=joined["motion"],
    )
