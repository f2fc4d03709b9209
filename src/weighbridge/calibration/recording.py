"""Rows of one drive of known mass, at any delay and lag of its torque."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from weighbridge.balance import ForceBalance, force_balance
from weighbridge.balance.instants import (
    SLOWEST_GEARED,
    identify_engine_delay,
    in_band,
    lagged_motion,
    read_instants,
)
from weighbridge.balance.table import ForceTable
from weighbridge.kernels.first_order import first_order
from weighbridge.navigation import Motion
from weighbridge.signals import Bools, Drive, Floats, Signal
from weighbridge.vehicle import TorqueSource, Vehicle, air_density, identify_air, in_air
from weighbridge.vehicle.torque import DRAGGED_TIME, averaged

ANCHORS: Final = 0.4
"""Delays so far apart have a whole balance each [s]; those between take over what it says of
brakes, overrun and cornering, which last longer than half of it."""

FORGOTTEN: Final = 2.0
"""Time constants after which a lag has forgotten what came before [-]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayedRows:
    """Rows of a drive at one delay and lag.

    Attributes
    ----------
    table : (n,) rows; no vehicle is fitted yet, so its torque and traction are NaN
    reading : (n,) of the torque source, smoothed as the motion is
    engine_speed : (n,) [rad/s]
    usable : (n,) rows that a fit may take
    """

    table: ForceTable
    reading: Floats
    engine_speed: Floats
    usable: Bools


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A drive of known mass as a calibration sees it.

    Attributes
    ----------
    drive, motion
    slow : the motion `in_band`
    mass : known, as the drive begins [kg]
    draft : vehicle with gears and source, without a torque model
    reading : (n,) of the torque source at its stamps, in the air of the calibration
    floor : reading below which the engine may be dragged; minus infinity where none is
    driven : (n,) where the reading is above that of a dragged engine
    source : of the torque
    engine_delay : lateness of the engine speed [s]
    anchors : balances made so far, by delay and lag
    """

    drive: Drive
    motion: Motion
    slow: Motion
    mass: float
    draft: Vehicle
    source: TorqueSource
    reading: Floats
    floor: float
    driven: Bools
    engine_delay: float
    anchors: dict[tuple[float, float], ForceBalance] = field(default_factory=dict)

    @classmethod
    def of(
        cls, drive: Drive, motion: Motion, mass: float, draft: Vehicle, source: TorqueSource
    ) -> Recording:
        """See a drive by its torque source."""
        stamps = source.carrier(drive).time
        altitude = np.interp(stamps, motion.time, motion.altitude)
        exponent = replace(draft.torque, source=source.name, coefficients=(0.0, 1.0)).in_thin_air[0]
        share = in_air(draft.torque.charge, exponent, identify_air(drive, altitude), altitude)
        reading = share * source.reading(drive, stamps, draft.torque)
        floor = source.floor(reading)
        period = float(np.median(np.diff(stamps)))
        return cls(
            drive=drive,
            motion=motion,
            slow=in_band(motion, draft, period),
            mass=mass,
            draft=draft,
            source=source,
            reading=reading,
            floor=floor,
            driven=averaged(reading, period, DRAGGED_TIME) >= floor,
            engine_delay=identify_engine_delay(drive, draft, motion),
        )

    def with_draft(self, draft: Vehicle) -> Recording:
        """Return the same drive with another draft of the vehicle."""
        return replace(self, draft=draft, anchors={})

    def balance(self, delay: float, lag: float = 0.0) -> ForceBalance:
        """Balance the drive without a torque model, at a delay and a lag [s]."""
        stand_in = self.drive
        if self.source.needs_map:
            stamps = self.source.carrier(self.drive).time
            stand_in = stand_in.with_signals(Signal("engine_torque", stamps, self.reading))
        return force_balance(
            stand_in, self.draft, self.motion, delay=delay, lag=lag,
            signed=self.source.signed, engine_delay=self.engine_delay,
        )  # fmt: skip

    def rows(self, delay: float, lag: float = 0.0) -> DelayedRows:
        """Return the rows of a whole balance at a delay and a lag [s]."""
        balance = self.balance(delay, lag)
        table, engine_speed = balance.table, balance.table.engine_speed
        return DelayedRows(
            table=table,
            reading=self.reading,
            engine_speed=engine_speed,
            usable=self._complete(table, engine_speed),
        )

    def delayed(self, delay: float) -> DelayedRows:
        """Return rows at a delay [s], for a search: what detects brakes is not read anew."""
        return self._moved(self._anchor(delay, 0.0), self.slow, delay)

    def search(
        self, pairs: Sequence[tuple[float, float]], longest: float, anchor_lag: float
    ) -> Iterator[DelayedRows]:
        """Return rows at many delays and lags, all with the same noise of the motion.

        A lag takes noise out of the motion, and a longer one, which takes more, would seem to fit
        better. So the motion is passed through the longest lag whichever is tried, and the
        reading, which has been through the tried one, through what is left:
        ``(1 + L s) / (1 + L_0 s)``, a mean of the reading and of that behind the longest lag.
        Rows soon after such as are not usable are left out: the lag still knows of those.

        Parameters
        ----------
        pairs : delays and lags up to ``longest`` [s]
        longest : of the lags tried [s]
        anchor_lag : lag of the balances that detect brakes and overrun [s]
        """
        motion = lagged_motion(self.slow, longest)
        late = first_order(self.source.carrier(self.drive).time, self.reading, longest)
        moved: dict[float, DelayedRows] = {}
        for delay, lag in pairs:
            nearly = round(delay, 9)
            if nearly not in moved:
                rows = self._moved(self._anchor(delay, anchor_lag), motion, delay)
                settled = since(rows.table.time, ~rows.usable) > FORGOTTEN * longest
                moved[nearly] = replace(rows, usable=rows.usable & settled)
            share = lag / longest
            reading = share * self.reading + (1.0 - share) * late
            yield replace(moved[nearly], reading=reading)

    def _anchor(self, delay: float, lag: float) -> ForceBalance:
        """Return the balance at the nearest anchor of a delay [s]."""
        key = (ANCHORS * round(delay / ANCHORS), lag)
        if key not in self.anchors:
            self.anchors[key] = self.balance(*key)
        return self.anchors[key]

    def _moved(self, anchor: ForceBalance, motion: Motion, delay: float) -> DelayedRows:
        """Read motion, engine speed and gear where a delay puts the force samples."""
        drive, draft = self.drive, self.draft
        recorded = self.source.carrier(drive).time
        at = read_instants(drive, draft, motion, recorded, delay, engine_delay=self.engine_delay)
        nothing = np.full(recorded.size, np.nan)
        table = replace(
            anchor.table,
            **at.columns,
            traction_force=nothing,
            force_std=nothing,
            torque=nothing,
            air_density=air_density(drive, at.altitude),
        )
        engine_speed = at.columns["engine_speed"]
        usable = self._complete(table, engine_speed) & ~at.changing & ~at.slipping
        usable &= at.known & (table.speed >= SLOWEST_GEARED)
        return DelayedRows(
            table=table, reading=self.reading, engine_speed=engine_speed, usable=usable
        )

    def _complete(self, table: ForceTable, engine_speed: Floats) -> Bools:
        """Rows that nothing speaks against and that have all numbers."""
        return np.asarray(
            table.usable
            & self.driven
            & np.isfinite(table.specific_force)
            & np.isfinite(table.gearing)
            & np.isfinite(table.engine_accel)
            & np.isfinite(self.reading)
            & np.isfinite(engine_speed)
        )


def since(time: Floats, marked: Bools) -> Floats:
    """Time since the last marked row, or since the first row (n,) [s].

    Parameters
    ----------
    time : (n,) rising [s]
    marked : (n,)
    """
    last = np.maximum.accumulate(np.where(marked, np.arange(time.size), 0))
    return np.asarray(time - time[last])
