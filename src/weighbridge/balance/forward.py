"""The force side step by step: each row from what is known soon after it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from weighbridge.balance.force_balance import ForceState, force_balance
from weighbridge.errors import DriveError
from weighbridge.vehicle import Burnt

if TYPE_CHECKING:
    from weighbridge.balance.table import ForceSetup, ForceTable
    from weighbridge.navigation import Motion
    from weighbridge.signals import Drive
    from weighbridge.vehicle import Vehicle


def begin() -> ForceState:
    """Return the state before the first row."""
    return ForceState(burnt=None, lagged=None)


def step(
    state: ForceState,
    records: Drive,
    motion: Motion,
    until: float,
    vehicle: Vehicle,
    delay: float,
    setup: ForceSetup,
) -> tuple[ForceState, ForceTable | None, slice]:
    """Find the rows that became known since the last step.

    They are those that `weighbridge.balance.force_balance` finds of a whole drive with the same
    setup and the whole motion, to the last bit.

    Parameters
    ----------
    state : before it
    records : those of `weighbridge.signals.recent.recent`, up to ``until``
    motion : of the last seconds, as far as it is known
    until : instant up to which records are complete [s]
    vehicle
    delay : lateness of the torque [s]
    setup : of a whole drive, with a finite ``ahead``

    Returns
    -------
    state : after it
    table : rows of the last seconds; None without a torque
    new : those of them that became known
    """
    try:
        balance = force_balance(records, vehicle, motion, delay=delay, setup=setup, since=state)
    except DriveError:
        # No torque came for long: the rows go on with the next one.
        return state, None, slice(0, 0)
    table, state = balance.table, state._replace(lagged=balance.lagged)
    late = max(delay, setup.engine_delay)
    horizon = min(float(motion.time[-1]) - setup.ahead, until - late - setup.readings_ahead)
    first, last = map(int, table.time.searchsorted([state.time, horizon], side="right"))
    if last <= first:
        return state, table, slice(0, 0)
    columns = (table.time, balance.fuel_flow, table.fuel_burnt)
    state = state._replace(burnt=Burnt(*(float(c[last - 1]) for c in columns if c is not None)))
    return state, table, slice(first, last)
