"""Stops at which the load may change."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.balance.table import ForceTable
from weighbridge.estimators.judging import STOP
from weighbridge.signals import Floats

CHANGE_ODDS: Final = -3.0
"""Logarithm of the odds that the load changes at a stop of `STOP`: one stop in twenty, for
most are at traffic lights."""

SHORTEST: Final = 8.0
"""In shorter stops no load changes [s]: a parcel is handed out in ten. Of 68 drives of two other
simulators, without a change of load, one was said to have one, with `STOP` in its place three."""

SHORTEST_BY_SPEED: Final = 60.0
"""The same without an accelerometer [s]: grades from heights err for minutes, which passes for a
change. Of eight simulated hours of a truck, without a change of load, two were said to have one by
`SHORTEST`, and the mass of one missed its interval; none with a minute."""

CHANGE_RISE: Final = 1.6
"""Growth of that logarithm with the logarithm of the standstill: at two minutes it is even."""

OPENED: Final = 3.0
"""Nobody gets on or off so soon after the vehicle stands [s]."""

LOADED: Final = 0.01
"""Part of the mass that a second beyond `OPENED` loads or unloads [1/s]: a passenger in 1.6 s
through each of three doors of a bus of 13 t."""

MOST_LOADED: Final = 0.3
"""Part of the mass that a whole stop loads or unloads [-]."""


def stood_before(table: ForceTable, time: Floats) -> Floats:
    """How long the vehicle stood between each window and the one before it (m,) [s].

    A gap in the log counts as standing: what happened in it is not known. Of several stops
    between two windows the longest shows.

    Parameters
    ----------
    table
    time : (m,) instants of the windows [s]
    """
    standing = ~table.moving
    gap = np.diff(table.time, append=table.time[-1])
    # Rows near in time count for the time until the next; a long gap counts as itself.
    still = np.cumsum(np.where(standing | (gap > STOP), gap, 0.0))
    moved = np.flatnonzero(~standing)
    stood = np.zeros(time.size)
    if moved.size < 2:
        return stood
    rest = still[moved[1:] - 1] - np.where(moved[:-1] > 0, still[moved[:-1] - 1], 0.0)
    at = np.searchsorted(time, table.time[moved[1:]])
    within = (at > 0) & (at < time.size) & (rest > 0.0)
    np.maximum.at(stood, at[within], rest[within])
    return stood


def change_odds(stood: Floats, *, by_speed: bool = False) -> Floats:
    """Logarithm of the odds that the load changed between each window and the one before it.

    NaN where the vehicle did not stand `SHORTEST` between them.

    Parameters
    ----------
    stood : (m,) how long it stood there [s]
    by_speed : no accelerometer measures the motion, and it is `SHORTEST_BY_SPEED`
    """
    odds = np.full(stood.size, np.nan)
    stops = stood >= (SHORTEST_BY_SPEED if by_speed else SHORTEST)
    odds[stops] = CHANGE_ODDS + CHANGE_RISE * np.log(stood[stops] / STOP)
    return odds


def unfollowed_std(stood: float, change_std: float, *, by_speed: bool = False) -> float:
    """Relative standard deviation of a mass of before a stop, by a change of load there [-].

    Parameters
    ----------
    stood : how long the vehicle stood [s]; nothing that followed is in the mass yet
    change_std : of a change of load over the mass [-]
    by_speed : as of `change_odds`
    """
    if stood < (SHORTEST_BY_SPEED if by_speed else STOP):
        return 0.0
    odds = float(change_odds(np.array([stood]), by_speed=by_speed)[0])
    return change_std / float(np.sqrt(1.0 + np.exp(-odds)))


def unseen_std(stood: Floats, boarding_std: float) -> float:
    """Relative standard deviation by loads that change where no change is looked for [-].

    Without an accelerometer, stops shorter than `SHORTEST_BY_SPEED` are not looked at. A load that
    wanders from stop to stop differs at the end from that of the whole drive by a third of its
    variance.

    Parameters
    ----------
    stood : (m,) how long the vehicle stood before each window [s]
    boarding_std : of the change at one stop [-]
    """
    stops = np.count_nonzero((stood >= SHORTEST) & (stood < SHORTEST_BY_SPEED))
    return boarding_std * float(np.sqrt(stops / 3.0))


def loadable(stood: Floats) -> Floats:
    """Part of the mass that a stop loads or unloads (m,) [-].

    Parameters
    ----------
    stood : (m,) how long the vehicle stood [s]
    """
    return np.minimum(LOADED * np.maximum(stood - OPENED, 0.0), MOST_LOADED)
