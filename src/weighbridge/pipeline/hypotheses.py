"""What else may explain a drive: each hypothesis refuses it, widens its interval, or neither."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, NamedTuple

from weighbridge.balance import ForceBalance, height_scale, shaken
from weighbridge.balance.bandwidth import LONGEST_PERIOD, smoothed_torque
from weighbridge.balance.delay import added_lag
from weighbridge.balance.gear_fit import ENOUGH, ratio_apart, share_on_gears
from weighbridge.balance.gear_scale import scale_contradiction
from weighbridge.balance.hybrid import motor_helps
from weighbridge.estimators import MassTrack, Status, contradicted, joint
from weighbridge.estimators.gate import GATE
from weighbridge.estimators.joint.bend import bent
from weighbridge.estimators.joint.changing import largest
from weighbridge.estimators.joint.foreign import of_another
from weighbridge.estimators.joint.slow_errors import motion_variance, with_variance
from weighbridge.messages import Problem
from weighbridge.navigation import BY_SPEED
from weighbridge.pipeline.notes import UNBACKED_STD, unbacked
from weighbridge.signals import Drive
from weighbridge.vehicle import Vehicle, source_of
from weighbridge.vehicle.torque import source_signal

ALTERED: Final = ("torque.steps_filtered",)
"""Findings that the torque's reading was altered after it was sent."""

ALTERED_STD: Final = 0.05
"""What that leaves uncertain of a mass, relative [-]: five such readings (scaled from mid-drive
on, or bent by a power of 1.2) were 3 to 6 % off, and the check found none of 300 undamaged
drives."""

ALTERED_RARELY_STD: Final = 0.13
"""The same of a torque that comes too rarely to show quick changes, relative [-]: one that is
smoothed by 1 s may pass. Of 60 such drives of fifteen vehicles with a torque once a second, the 45
that were weighed were 13 % too light in the mean, 15 % RMS."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A drive, and the mass that is to be judged.

    Attributes
    ----------
    drive, vehicle
    balance : forces and motion
    track : by the method asked for
    joined : by ``joint``, which judges the other methods; None where it is not found yet
    problems : what is known of the drive
    """

    drive: Drive
    vehicle: Vehicle
    balance: ForceBalance
    track: MassTrack
    joined: MassTrack | None = None
    problems: tuple[Problem, ...] = ()

    @property
    def trusted(self) -> set[str]:
        """Signals that a person vouches for."""
        return set(self.drive.info.trusted)

    @property
    def by_joint(self) -> MassTrack:
        """The track by ``joint``."""
        assert self.joined is not None
        return self.joined


class Verdict(NamedTuple):
    """What a hypothesis says of a mass.

    Attributes
    ----------
    refusal : it is sure, and there is no mass
    doubt : it is possible, a note beside the mass
    std : what it leaves uncertain of the mass, relative [-]
    """

    refusal: Problem | None = None
    doubt: Problem | None = None
    std: float = 0.0


def _gears_of_another(case: Case) -> Problem | None:
    share = share_on_gears(case.balance, case.vehicle)
    if share is None or share >= ENOUGH:
        return None
    seen, expected = ratio_apart(case.balance, case.vehicle)
    name = case.vehicle.name
    return Problem.of(
        "gear.foreign", share=100.0 * share, vehicle=name, seen=seen, expected=expected
    )


def _motor_beside_engine(case: Case) -> Problem | None:
    return motor_helps(case.drive, case.balance, case.vehicle)


def _gear_scale(case: Case) -> Problem | None:
    return scale_contradiction(case.balance, case.vehicle)


def _shaken_sensor(case: Case) -> Problem | None:
    return shaken(case.drive, case.balance.motion)


def _height_unit(case: Case) -> Problem | None:
    signal = "grade" if case.drive.has("grade") else "altitude"
    if signal in case.trusted:
        return None
    return height_scale(case.balance, case.vehicle, signal, case.drive.units.get(signal))


def _smoothed_torque(case: Case) -> Problem | None:
    balance, vehicle, track = case.balance, case.vehicle, case.track
    if set(source_of(vehicle).found(case.drive)) & case.trusted:
        return None
    motion = balance.motion
    if motion.source in BY_SPEED and track.status is not Status.CONVERGED:
        # A calm drive has no quick changes.
        return None
    if track.sizes is not None:
        motion = with_variance(motion, track.sizes.motion_var)
    quick = smoothed_torque(
        track.balance,
        vehicle,
        beside=0.0 if track.switched is None else track.switched.force(balance.table, vehicle),
        noise=partial(motion_variance, motion),
    )
    return quick or _slower_torque(case)


def _slower_torque(case: Case) -> Problem | None:
    """Say that a torque that comes too rarely to show quick changes follows more slowly."""
    vehicle, balance = case.vehicle, case.track.balance
    known = vehicle.provenance.torque_fitted and vehicle.timing.torque_delay is not None
    if not known or balance.setup is None or not _rarely(case):
        return None
    added, source = added_lag(case.drive, vehicle, balance), source_of(vehicle).name
    return Problem.of("torque.slower", added=added, source=source) if added else None


def _rarely(case: Case) -> bool:
    """Whether the torque comes too rarely to show quick changes."""
    return source_signal(case.drive, case.vehicle).period > LONGEST_PERIOD


def _scale_changes(case: Case) -> Verdict:
    given = case.by_joint.filter_input
    change = largest(given) if given is not None else None
    if change is None:
        return Verdict()
    if change.sure:
        return Verdict(change.refusal(case.balance.motion.source))
    return Verdict(doubt=change.doubt, std=change.doubt_std)


def _another_vehicle(case: Case) -> Verdict:
    refused, why = of_another(case.vehicle, case.by_joint)
    return Verdict(why) if refused else Verdict(doubt=why)


def _bent_reading(case: Case) -> Verdict:
    return Verdict(bent(case.by_joint.bend, case.drive, case.vehicle))


def _contradicted(case: Case) -> Verdict:
    return Verdict(contradicted(case.track, case.by_joint))


def _load_changes(case: Case) -> Verdict:
    possible = case.track.possible_change
    return Verdict(doubt=possible.note if possible is not None else None)


def _altered_reading(case: Case) -> Verdict:
    if not any(p.id in ALTERED for p in case.problems):
        return Verdict()
    return Verdict(std=ALTERED_RARELY_STD if _rarely(case) else ALTERED_STD)


def _unbacked_scale(case: Case) -> Verdict:
    return Verdict(std=UNBACKED_STD if unbacked(case.vehicle) else 0.0)


OF_BALANCE: Final[tuple[Callable[[Case], Problem | None], ...]] = (
    _gears_of_another,
    _motor_beside_engine,
    _gear_scale,
    _shaken_sensor,
    _height_unit,
    _smoothed_torque,
)
"""By force and motion alone, whether or not a mass was found."""

OF_MASS: Final[tuple[Callable[[Case], Verdict], ...]] = (
    _scale_changes,
    _another_vehicle,
    _bent_reading,
    _contradicted,
    _load_changes,
    _altered_reading,
    _unbacked_scale,
)
"""Beside a mass that was found."""


def refused_by_balance(case: Case) -> Problem | None:
    """Why force and motion cannot carry a mass by the vehicle file; None where they may."""
    return next((why for ask in OF_BALANCE if (why := ask(case)) is not None), None)


def weighed_against(case: Case) -> tuple[MassTrack, Problem | None, tuple[Problem, ...]]:
    """Weigh a mass against all else that may explain its drive.

    Parameters
    ----------
    case : of a mass that was found

    Returns
    -------
    track : widened by what the hypotheses leave uncertain
    refusal : why there is no mass; None where there is
    doubts : notes of what is possible
    """
    if case.joined is None:
        case = replace(case, joined=joint.estimate(case.balance, case.vehicle))
    verdicts = []
    for ask in OF_MASS:
        verdicts.append(verdict := ask(case))
        if verdict.refusal is not None:
            return case.track, verdict.refusal, ()
    track = case.track.doubted(math.hypot(*(v.std for v in verdicts)))
    doubts = [v.doubt for v in verdicts if v.doubt is not None]
    wide = [v.doubt for v in verdicts if v.doubt is not None and v.std > 0.0]
    if wide and track.std > GATE.widest * track.mass:
        doubts.remove(wide[0])
        return track, wide[0], tuple(doubts)
    return track, None, tuple(doubts)
