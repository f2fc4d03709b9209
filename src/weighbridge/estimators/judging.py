"""What all estimators answer the same way: status, slow uncertainty, segments."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.balance import ForceBalance, Reason, windows
from weighbridge.balance.table import ForceTable
from weighbridge.estimators.gate import GATE, GateSettings
from weighbridge.estimators.track import MassTrack, Segment, Status
from weighbridge.messages import Problem, phrase
from weighbridge.navigation import BY_SPEED, Motion, MotionSource
from weighbridge.signals import Bools, Floats
from weighbridge.signals.student import student_quantile
from weighbridge.vehicle import Vehicle, scale_std, source_of

SLOW_TORQUE: Final = 1.5
"""Rows further apart are reported, where stretches of them are too short [s]: of a van's torque
every 1 s most rows were used, every 2 s a third, every 3 s none."""

STOP: Final = 20.0
"""A standstill this long may change the load [s]."""

WARMING: Final = 600.0
"""Time in which engine and tyres warm [s]."""

OTHER_METHOD_STD: Final = 0.06
"""Relative standard deviation of masses that the joint estimator makes with a torque that
was fitted for rls [-]: that fit is drawn by the noise of the reading, the joint
estimator is not; simulated vehicles came out 4 to 8 % light."""

SQUAT_STD: Final = 0.03
"""Relative standard deviation of masses by an accelerometer that leans with the body, where
no calibration took that up [-]: recorded cars leaned by 2 to 5 % of the mass."""

HIDDEN_BRAKE_STD: Final = 0.03
"""Relative standard deviation of a mass where nothing shows the brake [-]: ordinary drives of
another simulator had 1.7 % RMS, 3 % at worst, before their braked rows were found, and cruises
whose few starts are all that weighs more."""

TOWING: Final = 2.5
"""A mass over the permitted one that neither an overload nor a trailer explains [-]: a truck of
18 t draws 40 t, a van of 3.5 t as much again."""

USUAL_SLOPE: Final = 1.2
"""Relative change of a mass per relative change of its torque [-]: what road loads take is not
scaled."""

LIGHTEST: Final = 0.95
"""Least mass of an empty vehicle over its tare [-]: tank and driver's seat may be empty."""

MOTION_STD: Final[dict[MotionSource, float]] = {
    "inertial": 0.0,
    "longitudinal_accel": 0.01,
    "speed_grade": 0.08,
    "speed": 0.08,
}
"""Relative standard deviation of a mass by how the motion was found [-]. Acceleration from
a polled speed is smoothed and late, and grade from GNSS height noisy: simulated drives
weighed so by the published methods, with vehicle files made with an inertial sensor, came out 9 to
15 % light."""

UNMODELLED_STD: Final = 0.04
"""Relative standard deviation that wind, hills and tyres add to the mass of one stretch
between two stops, over which they do not average [-]."""


def consider_std(balance: ForceBalance, phi: Floats, used: Bools, vehicle: Vehicle) -> float:
    """Relative standard deviation that no row of this drive can take away [-].

    Uncertainty of the calibration, how the motion was found, and the cold
    start: engine and tyres that are not warm yet make a vehicle seem heavy, by
    as much as `TorqueSource.cold_std` where all that was learnt is from the first `WARMING`
    of driving.
    """
    share = cold_share(balance.table.time, phi, used)
    cold = share * source_of(vehicle).cold_std
    return float(np.hypot(calibration_std(balance, vehicle), cold))


def calibration_std(balance: ForceBalance, vehicle: Vehicle) -> float:
    """Relative standard deviation by what the calibration left open and by the motion [-].

    A vehicle file that was never calibrated leaves open what a data sheet does not say.
    """
    scale = vehicle.provenance.mass_scale_std
    if scale is None:
        scale = uncalibrated_std(vehicle, balance.motion)
    hidden = HIDDEN_BRAKE_STD if balance.brake_hidden else 0.0
    motion = balance.motion
    moved = math.hypot(MOTION_STD[motion.source], motion.specific_force_scale_std)
    return math.hypot(scale, moved, hidden, balance.coarse_std, USUAL_SLOPE * balance.air_std)


def lacks_accelerometer(vehicle: Vehicle, motion: Motion) -> bool:
    """Whether the vehicle file was made with an accelerometer and the drive has none."""
    made = vehicle.provenance
    with_one = made.torque_fitted and made.motion not in (None, *BY_SPEED)
    return with_one and motion.source in BY_SPEED


RATES_APART: Final = 2.2
"""Times as often is another rate of the torque [-]: 5 Hz with a file of 10 Hz moves the masses of
a truck by 1 to 2 %, 2 Hz by 3 to 9 %."""


def sampled_otherwise(vehicle: Vehicle, balance: ForceBalance) -> float | None:
    """Time between two torques of a drive, if the calibration had another [s]; else None.

    Only of vehicles that hills slow down, and where neither had an accelerometer: samples that are
    further apart show less well how much of the motion is noise.
    """
    made, time = vehicle.provenance, balance.table.time
    alike = made.motion in BY_SPEED and balance.motion.source in BY_SPEED
    if made.torque_period is None or not (alike and vehicle.of_class.underpowered):
        return None
    now = float(np.median(np.diff(time))) if time.size > 1 else made.torque_period
    return None if 1.0 / RATES_APART < now / made.torque_period < RATES_APART else now


def grade_apart(vehicle: Vehicle, motion: Motion) -> float:
    """How much surer or less sure the grade of a drive is than that of the calibration [rad].

    0 where either had an accelerometer, or nothing was fitted.
    """
    made = vehicle.provenance
    known = made.unmeasured_grade if made.torque_fitted and made.motion in BY_SPEED else None
    if known is None or motion.source not in BY_SPEED:
        return 0.0
    return abs(motion.unmeasured_grade - known)


def uncalibrated_std(vehicle: Vehicle, motion: Motion) -> float:
    """Relative standard deviation by what a data sheet leaves open [-]."""
    holds_squat = motion.source not in BY_SPEED and motion.squat is None
    return float(np.hypot(scale_std(vehicle), SQUAT_STD if holds_squat else 0.0))


def cold_share(time: Floats, phi: Floats, used: Bools, start: float | None = None) -> float:
    """Part of the information that the used rows of the first `WARMING` hold [-].

    ``start`` is when the vehicle set off; the first used row when None [s].
    """
    if not used.any():
        return 0.0
    power = phi[used] ** 2
    moving = time[used]
    begin = moving[0] if start is None else start
    return float(np.sum(power[moving < begin + WARMING]) / np.sum(power))


LITTLE: Final = 60.0
"""Time of used rows below which a wide interval is due to it [s]: two time constants of the
disturbance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What an estimator has made of a drive, for `judge`.

    Attributes
    ----------
    table : the rows
    used : (n,) those the mass is made from
    phi : (n,) regressor of the mass [m/s^2]
    mass, std : [kg]
    blocks : stretches of time that say something of their own
    systematic_std : part of ``std`` that the vehicle file leaves, whatever the drive [kg]
    degrees_of_freedom : behind ``std``
    motion : of the rows; shows why few of them count
    gate : what a mass needs
    """

    table: ForceTable
    used: Bools
    phi: Floats
    mass: float
    std: float
    blocks: int
    systematic_std: float = 0.0
    degrees_of_freedom: float = float("inf")
    motion: Motion | None = None
    gate: GateSettings = GATE

    @property
    def slow_speed(self) -> str:
        """What a slow speed spoils, where it shows starts and hills enough; else empty."""
        speed = self.motion.recorded_speed if self.motion is not None else None
        return (
            speed.slow_text if speed is not None and speed.spread >= self.gate.least_spread else ""
        )

    @property
    def half_width(self) -> float:
        """Half of the interval of 95 % [kg]."""
        freedom = max(self.degrees_of_freedom, 1.0)
        return student_quantile(freedom, 0.975) * self.std

    @property
    def drive_std(self) -> float:
        """Standard deviation by the drive itself [kg]."""
        return float(np.sqrt(max(self.std**2 - self.systematic_std**2, 0.0)))

    @property
    def used_time(self) -> float:
        """Time of the used rows [s]."""
        time = self.table.time
        return float(np.count_nonzero(self.used) * np.median(np.diff(time)))

    @property
    def spread(self) -> float:
        """Standard deviation of the regressor, of means over `windows` of used rows [m/s^2]."""
        cut = windows(self.table.time, self.used & np.isfinite(self.phi))
        return float(np.std(cut.mean(self.phi))) if cut.count.size else 0.0


def judge(found: Evidence, vehicle: Vehicle) -> tuple[Status, Problem | None]:
    """Say whether the rows carry a mass, and why not: the same gate for every method.

    A mass needs rows (count, stretches and time of them), an interval that is narrow enough,
    specific force that varies, and a size that the vehicle can have.
    """
    for check in (_enough_rows, _narrow_enough, _possible, _long_enough, _excited, _plausible):
        status, reason = check(found, vehicle)
        if status is not Status.CONVERGED:
            return status, reason
    return Status.CONVERGED, None


_PASSED: Final = (Status.CONVERGED, None)


def _most_of_the_others(table: ForceTable, used: Bools) -> str:
    """Why most rows that were not used were not, in words."""
    reasons, share = np.unique(table.reason[table.reason != 0], return_counts=True)
    alone = np.count_nonzero(table.usable & ~used)
    if reasons.size and share.max() >= alone:
        return Reason(int(reasons[np.argmax(share)])).text
    apart = float(np.median(np.diff(table.time))) if table.time.size > 1 else 0.0
    slow = phrase("slow_torque", period=apart)
    return Reason.TOO_SHORT.text + (slow if apart > SLOW_TORQUE else "")


def _enough_rows(found: Evidence, _: Vehicle) -> tuple[Status, Problem | None]:
    table, count = found.table, int(np.count_nonzero(found.used))
    if count >= found.gate.fewest_rows and found.blocks >= found.gate.fewest_blocks:
        return _PASSED
    most = _most_of_the_others(table, found.used)
    return Status.NOT_EXCITED, Problem.of(
        "motion.few_rows",
        count=count,
        stretches=found.blocks,
        cause=found.slow_speed or phrase("most_of_others", most=most),
    )


def _narrow_enough(found: Evidence, vehicle: Vehicle) -> tuple[Status, Problem | None]:
    mass, half_width = found.mass, found.half_width
    if np.isfinite(half_width) and half_width <= 1.96 * found.gate.widest * abs(mass):
        return _PASSED
    low, high = vehicle.of_class.mass_range
    if mass + half_width < low or mass - half_width > high:
        return _possible(found, vehicle)
    cause = found.slow_speed or phrase("more_starts")
    if not found.slow_speed and found.used_time < LITTLE:
        cause = phrase("drive_longer", used=found.used_time)
    elif not found.slow_speed and found.systematic_std > found.drive_std:
        cause = phrase("left_open", share=100.0 * found.systematic_std / abs(mass))
    return Status.NOT_EXCITED, Problem.of(
        "motion.wide",
        mass=mass,
        low=max(mass - half_width, 0.0),
        high=mass + half_width,
        cause=cause,
    )


def _possible(found: Evidence, vehicle: Vehicle) -> tuple[Status, Problem | None]:
    low, high = vehicle.of_class.mass_range
    if low < found.mass < high:
        return _PASSED
    return Status.INCONSISTENT, Problem.of(
        "mass.impossible", mass=found.mass, kind=vehicle.kind, low=low, high=high
    )


def _long_enough(found: Evidence, _: Vehicle) -> tuple[Status, Problem | None]:
    least = found.gate.least_time
    if found.used_time >= least:
        return _PASSED
    return Status.NOT_EXCITED, Problem.of(
        "motion.short",
        used=found.used_time,
        least=least,
        cause=found.slow_speed or phrase("only_longer"),
    )


def _excited(found: Evidence, _: Vehicle) -> tuple[Status, Problem | None]:
    spread, least = found.spread, found.gate.least_spread
    if spread >= least:
        return _PASSED
    if found.slow_speed:
        return Status.NOT_EXCITED, Problem.of(
            "motion.slow_speed", spread=spread, least=least, cause=found.slow_speed
        )
    return Status.NOT_EXCITED, Problem.of("motion.not_excited", spread=spread, least=least)


def _plausible(found: Evidence, vehicle: Vehicle) -> tuple[Status, Problem | None]:
    """Whether most of the interval lies between the empty mass and the heaviest load."""
    mass, std = found.mass, found.std
    lightest = vehicle.tare or min(vehicle.provenance.masses, default=None)
    if lightest is not None and mass - std > vehicle.of_class.heaviest * lightest:
        return Status.INCONSISTENT, Problem.of(
            "mass.too_heavy",
            mass=mass,
            times=vehicle.of_class.heaviest,
            lightest=lightest,
            kind=vehicle.kind,
        )
    gross = vehicle.gross
    if lightest is None and gross is not None and mass - 2.0 * std > TOWING * gross:
        return Status.INCONSISTENT, Problem.of(
            "mass.above_gross", mass=mass, times=mass / gross, gross=gross, kind=vehicle.kind
        )
    if vehicle.tare is None:
        return _PASSED
    emptied = vehicle.tare - vehicle.of_class.emptied
    if mass + std < LIGHTEST * vehicle.tare or mass + 2.0 * std < emptied:
        return Status.INCONSISTENT, Problem.of("mass.below_tare", mass=mass, tare=vehicle.tare)
    return _PASSED


def converged_at(time: Floats, running: Floats, mass: float, used: Bools) -> float:
    """When the running mass stays within 5 % of the final one for good [s]; NaN if never."""
    off = np.abs(running - mass) > 0.05 * abs(mass)
    if not used.any() or not np.isfinite(mass) or off[-1]:
        return float("nan")
    last = np.flatnonzero(off)
    return float(time[last[-1] + 1]) if last.size else float(time[used][0])


def segments(
    balance: ForceBalance,
    vehicle: Vehicle,
    phi: Floats,
    used: Bools,
    weigh_part: Callable[[slice], tuple[float, float]],
    gate: GateSettings = GATE,
) -> tuple[Segment, ...]:
    """Weigh between standstills of `STOP` or longer.

    Parameters
    ----------
    balance, vehicle
    phi : (n,) regressor of the mass [m/s^2]
    used : (n,)
    weigh_part : mass and standard deviation of some rows by their scatter alone [kg]
    gate : a segment that is less sure than its ``widest`` has no mass
    """
    table = balance.table
    slow = consider_std(balance, phi, np.zeros_like(used), vehicle)
    low, high = vehicle.of_class.mass_range
    begin = float(table.time[used][0]) if used.any() else 0.0
    time = table.time
    if time.size < 2:
        return ()
    moving = table.moving
    starts = np.flatnonzero(np.diff(np.concatenate(([False], moving))) & moving)
    edges = [0]
    for k in starts:
        before = np.flatnonzero(moving[:k])
        if before.size and time[k] - time[before[-1]] >= STOP:
            edges.append(int(k))
    found = []
    for a, b in zip(edges, [*edges[1:], time.size], strict=True):
        part = slice(a, b)
        if not moving[part].any():
            continue
        mass, std = weigh_part(part)
        cold = cold_share(time[part], phi[part], used[part], begin)
        spread = (slow, UNMODELLED_STD, cold * source_of(vehicle).cold_std)
        std = float(np.sqrt(std**2 + np.sum(np.square(spread)) * mass**2))
        known = np.isfinite(std) and std < gate.widest * mass and low < mass < high
        found.append(
            Segment(
                start=float(time[a]),
                end=float(time[b - 1]),
                mass=mass if known else float("nan"),
                std=std if known else float("nan"),
            )
        )
    return tuple(found)


def nothing(
    method: str,
    balance: ForceBalance,
    vehicle: Vehicle,
    row_reason: NDArray[np.uint8],
    stretches: int,
    gate: GateSettings = GATE,
) -> MassTrack:
    """Return the track of a drive that has too few usable rows for any estimate."""
    table = balance.table
    unknown = np.full(table.time.size, np.nan)
    used = row_reason == Reason.USED
    none = Evidence(
        table=table,
        used=np.zeros_like(used),
        phi=unknown,
        mass=float("nan"),
        std=float("inf"),
        blocks=stretches,
        motion=balance.motion,
        gate=gate,
    )
    _, reason = judge(none, vehicle)
    return MassTrack(
        method=method,
        balance=balance,
        running_mass=unknown,
        running_std=unknown,
        residual=unknown,
        row_reason=row_reason,
        mass=float("nan"),
        std=float("inf"),
        degrees_of_freedom=float("inf"),
        bound_std=float("nan"),
        converged_at=float("nan"),
        status=Status.NOT_EXCITED,
        reason=reason,
        segments=(),
    )
