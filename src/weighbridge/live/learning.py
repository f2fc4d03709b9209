"""What a drive so far shows of sensors and noise, by which it is weighed on."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from weighbridge.errors import DriveError, WeighbridgeError
from weighbridge.estimators import Status
from weighbridge.messages import Problem
from weighbridge.pipeline import forward
from weighbridge.pipeline.forward import ForwardSetup, ForwardState
from weighbridge.pipeline.weighing import Weighing, weigh
from weighbridge.signals import Drive
from weighbridge.vehicle import Vehicle

LONGEST: Final = 2700.0
"""No more of it is kept and looked at [s]."""

EARLY: Final = {
    "fewest_rows": 20,
    "fewest_blocks": 2,
    "least_time": 10.0,
    "widest": 0.0765,
}
"""What a mass needs to be shown before `weighbridge.estimators.gate.GATE` lets it through: an
interval of at most 15 % to both sides. Of ten drives of another simulator, never tuned on, seven
had one after 60 s on the move, 3.8 % RMS off, and all intervals held."""


@dataclass(frozen=True, slots=True)
class Learned:
    """What the records until an instant show.

    Attributes
    ----------
    until : that instant [s]
    since : instant from which the load is what was weighed [s]
    setup : by which the drive is weighed on; None where no forward pass is possible
    state : of a forward pass, at ``until``
    mass, std : of these records as a whole [kg]; NaN where they carry none
    floor : part of ``std`` that no driving takes away, relative to the mass [-]
    inconsistent : the records contradict themselves or the vehicle file
    refusal : why there is no mass; None where there is one
    early : what the mass still lacks to count as weighed; None where it lacks nothing
    std_found : ``std`` over the mass, also of a mass that is not shown [-]; infinite without one
    problems : what was found and what is uncertain
    """

    until: float
    since: float = math.nan
    setup: ForwardSetup | None = None
    state: ForwardState | None = None
    mass: float = math.nan
    std: float = math.nan
    floor: float = 0.0
    inconsistent: bool = False
    refusal: Problem | None = None
    problems: tuple[Problem, ...] = ()
    early: Problem | None = None
    std_found: float = math.inf

    def answer(self) -> Learned:
        """Return what they show of the mass alone, without what the stages go on from."""
        return replace(self, setup=None, state=None)


def known_mass(
    state: ForwardState | None, setup: ForwardSetup | None, learned: Learned | None
) -> tuple[float, float, float, float]:
    """Mass, its standard deviation, what no driving takes away of it, and its instant.

    Parameters
    ----------
    state, setup : of the stages
    learned : of all records, the last time they were looked at
    """
    nothing = math.nan, math.nan, 0.0, math.nan
    if learned is not None and learned.inconsistent:
        return nothing
    if state is not None and setup is not None and state.joint.windows:
        if forward.too_wide(state, setup) > 0.0:
            return nothing
        floor = setup.joint.systematic_std
        mass = state.joint.mass - state.force.fuel
        return mass, state.joint.std(setup.joint), floor, state.force.time
    if learned is not None and math.isfinite(learned.mass):
        return learned.mass, learned.std, learned.floor, learned.until
    return nothing


def learn(drive: Drive, vehicle: Vehicle, until: float, step: float) -> Learned:
    """Weigh what was recorded so far as a whole, and set up the stages to go on from it.

    Parameters
    ----------
    drive : records from the beginning, or the last `LONGEST` seconds of them, up to ``until``
    vehicle
    until : instant up to which they are complete [s]
    step : in which later records are taken [s]
    """
    try:
        weighing = weigh(drive, vehicle)
    except WeighbridgeError as error:
        return Learned(until=until, refusal=Problem.from_error(error), inconsistent=True)
    early = weighing.refusal if weighing.status is Status.NOT_EXCITED else None
    if early is not None:
        weighing = _early(drive, vehicle)
    inconsistent = weighing.status is Status.INCONSISTENT and early is None
    if weighing.result is None or not math.isfinite(weighing.mass):
        return Learned(
            until=until,
            refusal=early or weighing.refusal,
            inconsistent=inconsistent,
            problems=weighing.problems,
            std_found=_std_found(weighing),
        )
    setup, state = (None, None) if early is not None else _set_up(weighing, until, step)
    return Learned(
        until=until,
        since=weighing.segments[-1].start if weighing.load_changed else drive.start,
        setup=setup,
        state=state,
        mass=weighing.mass,
        std=weighing.std,
        floor=_floor(weighing),
        early=early,
        problems=weighing.problems,
        std_found=_std_found(weighing),
    )


def _early(drive: Drive, vehicle: Vehicle) -> Weighing:
    """Weigh by what a first mass needs."""
    weighing = weigh(drive, vehicle, settings=EARLY)
    kept = tuple(p for p in weighing.problems if p.id != "method.settings")
    return replace(weighing, problems=kept)


def _set_up(
    weighing: Weighing, until: float, step: float
) -> tuple[ForwardSetup | None, ForwardState | None]:
    """Set up the stages; all records so far, as they were corrected, are one step of theirs.

    Without an inertial sensor, or where it was left out, there are no stages.
    """
    try:
        setup = forward.identify_forward(weighing, step)
    except DriveError:
        return None, None
    return setup, forward.resume(weighing, until, setup)


def _floor(weighing: Weighing) -> float:
    result = weighing.result
    assert result is not None
    left = result.systematic_std
    return left / weighing.mass if math.isfinite(left) else 0.0


def _std_found(weighing: Weighing) -> float:
    """Relative standard deviation of what was found [-], whether it is shown or not."""
    result = weighing.result
    if result is None or not result.mass > 0.0:
        return math.inf
    return result.std / result.mass
