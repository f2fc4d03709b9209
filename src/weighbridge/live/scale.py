"""A scale that is fed while the vehicle drives."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from weighbridge.arguments import as_floats, check_text, check_type
from weighbridge.errors import ConfigError
from weighbridge.estimators.joint import JointSettings
from weighbridge.estimators.joint.load_stops import SHORTEST_BY_SPEED, unfollowed_std
from weighbridge.estimators.judging import STOP
from weighbridge.live.arrival import health_of, is_parked, needed_signals
from weighbridge.live.checkpoint import packed, refuse_absurd, unpacked
from weighbridge.live.clock import pace
from weighbridge.live.kerb import Kerb, Weighed, stands
from weighbridge.live.learning import LONGEST, Learned, known_mass
from weighbridge.live.looking import Look, Step
from weighbridge.live.on_the_move import FIRST, OnTheMove, moves
from weighbridge.live.outlook import (
    NO_STOP,
    Outlook,
    UnfollowedStop,
    by_tilt,
    doubts,
    of_before,
    outlook,
)
from weighbridge.live.records import LATENESS, Records
from weighbridge.live.source import Samples
from weighbridge.live.weighing import LiveStatus, LiveWeighing, SignalHealth
from weighbridge.messages import Problem, phrase
from weighbridge.navigation.forward import forward_axis
from weighbridge.pipeline import forward
from weighbridge.pipeline.forward import ForwardSetup, ForwardState
from weighbridge.pipeline.given import GivenVehicle, as_vehicle
from weighbridge.signals import BEHIND, STEP, Drive, DriveInfo, Floats, recent
from weighbridge.signals.recent import FEWEST_SAMPLES, first_instant, last_instant

_LOG = logging.getLogger(__name__)

RENEWED: Final = 60.0
"""A clock that begins anew no later after a silence belongs to it [s]."""


class LiveScale:
    """Weigh a vehicle from samples while they arrive.

    The first minutes are weighed as a whole, again and again, until they show mounting, delays and
    noise; from then on each step is weighed by the forward stages
    (`weighbridge.pipeline.forward`), and all that came is still looked at now and then, by the
    checks of a recorded drive. With a ``setup`` nothing is learnt, and the mass is to the last bit
    that of `weighbridge.pipeline.forward.forward_weigh` over the same samples. Samples are taken as
    they come: what the checks of a recorded drive leave out or move is noticed when they are
    looked at.

    Parameters
    ----------
    vehicle : as of `weighbridge.calibrate` or a vehicle file
    lateness : by which a sample may be older than the newest [s]; later ones are counted and
        dropped
    setup : of `weighbridge.pipeline.forward.identify_forward`
    info : what is known beside the samples, such as wind and temperature
    step : in which samples are weighed [s], one of `weighbridge.signals.recent.STEPS`: shorter ones
        show it sooner and cost more; that of ``setup`` where there is one

    Attributes
    ----------
    kept_at : pace of the clock when the state was kept that it goes on from
    looks_aside : look at all records in a thread beside; what is shown does not wait for it

    Notes
    -----
    One thread feeds a scale. A step takes milliseconds, one in which it looks at all records a
    second or two. Where it looks aside, the mass is that of before until the look has ended, and
    then the same to the last bit as that of a scale that waits; `finish` ends the thread.
    """

    def __init__(
        self,
        vehicle: GivenVehicle,
        *,
        lateness: float = LATENESS,
        setup: ForwardSetup | None = None,
        info: DriveInfo | None = None,
        step: float = STEP,
    ) -> None:
        if setup is not None:
            check_type("setup", setup, ForwardSetup, "a ForwardSetup")
        if info is not None:
            check_type("info", info, DriveInfo, "a weighbridge.DriveInfo")
        forward.check_step(step)
        self.vehicle = as_vehicle(vehicle)
        self.info = info or DriveInfo()
        self._records = Records(lateness)
        self._learns = setup is None
        self._setup = setup
        self._every = step if setup is None else setup.step
        self._state: ForwardState | None = None
        self._learned: Learned | None = None
        self._next: float | None = None
        self._move = OnTheMove()
        self._kerb = Kerb()
        self._since = self._kept_from = -math.inf
        self._tared: float | None = None
        self._anew = -math.inf
        self._kept_to = math.nan
        self.kept_at = 1.0
        self.looks_aside = False
        self._looking: Look | None = None
        self._came: tuple[str, ...] = ()
        self._needed = needed_signals(self.vehicle, ())

    def update(self, time: float | Floats, signal: str, value: float | Floats) -> None:
        """Take one sample of a signal, or several.

        Parameters
        ----------
        time : instant, or instants (n,) [s]
        signal : canonical name, see `weighbridge.signals.catalogue`
        value : or values (n,), in SI

        Raises
        ------
        ConfigError
            There is no such signal, or times and values differ in number.
        """
        check_text("signal", signal)
        if isinstance(time, float | int) and isinstance(value, float | int):
            self._records.add(signal, float(time), float(value))
        else:
            pair = np.atleast_1d(as_floats("time", time)), np.atleast_1d(as_floats("value", value))
            self._records.add_block({signal: pair})
        if self._next is None or self._records.watermark >= self._next:
            self._advance()

    def update_block(self, samples: Samples) -> None:
        """Take samples of several signals that came together, whatever time they span.

        Parameters
        ----------
        samples : by canonical name, instants (n,) [s] and values (n,) in SI
        """
        check_type("samples", samples, Mapping, "a dictionary of (instants, values) by signal")
        for name, pair in samples.items():
            check_type(f"samples of {name!r}", pair, tuple, "a pair of arrays, instants and values")
        self._records.add_block(
            {
                name: (as_floats(f"instants of {name!r}", time), as_floats(f"{name!r}", values))
                for name, (time, values) in samples.items()
            }
        )
        self._advance()

    def finish(self) -> None:
        """Take it that no more samples come: weigh what still waits for late ones.

        Where the scale learns, all records are looked at once more.
        """
        if not math.isfinite(self._records.newest):
            return
        last = last_instant(self._records.newest)
        try:
            self._advance(self._records.newest)
            if self._next is not None and (length := last - self._next + self._every) > 0.0:
                self._records.seal(last)
                self._step(last, length)
                self._next = first_instant(last, self._every)
        finally:
            self._take(wait=True)
        move = self._move
        if self._learns and move.driven > max(move.looked_at, FIRST) and self._next is not None:
            self._learn(self._records.drive(self.info), last)
            self._take(wait=True)

    def __del__(self) -> None:
        if (look := getattr(self, "_looking", None)) is not None:
            look.end()

    def checkpoint(self) -> str:
        """Return all that the scale goes on from, for `restore`, as text."""
        content = {
            "setup": self._setup,
            "state": self._state,
            "next": self._next,
            "driven": self._move.driven,
            "driven_this_load": self._move.this_load,
            "rested": self._move.rested,
            "driven_until_rest": self._move.anew,
            "kerb": self._kerb,
            "since": self._since,
            "tared": self._tared,
            "learns": self._learns,
            "pace": pace(),
            "lateness": self._records.lateness,
            "step": self._every,
            "info": self.info,
            "learned": None if self._learned is None else self._learned.answer(),
            "samples": self._records.last(self._behind + 2.0 * self._every),
        }
        return packed(content, self.vehicle)

    @classmethod
    def restore(cls, vehicle: GivenVehicle, checkpoint: str) -> LiveScale:
        """Go on from a checkpoint of the same vehicle file.

        Parameters
        ----------
        vehicle : as it was then
        checkpoint : of `checkpoint`

        Raises
        ------
        ConfigError
            The checkpoint is damaged, of another version or vehicle file, or holds a mass that
            no vehicle has.
        """
        vehicle = as_vehicle(vehicle)
        content = unpacked(checkpoint, vehicle)
        try:
            scale = cls(
                vehicle, lateness=content["lateness"], info=content["info"], step=content["step"]
            )
            scale._setup, scale._state = content["setup"], content["state"]
            scale._next, scale._learned = content["next"], content["learned"]
            scale._move = OnTheMove(
                content["driven"], content["driven_this_load"], rested=content["rested"],
                anew=content["driven_until_rest"],
            )  # fmt: skip
            scale._kerb = content["kerb"]
            scale._since, scale._tared = content["since"], content["tared"]
            scale._learns, scale.kept_at = content["learns"], content["pace"]
            scale._records.add_block(content["samples"])
            scale._kept_to = scale.newest
            if scale._next is not None:
                scale._records.seal(scale._next - scale._every)
                scale._kept_from = scale._next - scale._every
        except (KeyError, TypeError, AttributeError) as error:
            raise ConfigError(f"the checkpoint is not used: {error}") from None
        scale._move.begin_anew()
        refuse_absurd(scale._state, scale._setup)
        return scale

    @property
    def newest(self) -> float:
        """Instant of the newest sample [s]; -inf before the first."""
        return self._records.newest

    def recorded(self) -> Drive:
        """Samples that are kept as a drive: the last `LONGEST` seconds where the scale learns."""
        return self._records.drive(self.info)

    def tare(self) -> float:
        """Set the mass of this moment to nought, for the payload; return it [kg].

        Raises
        ------
        ConfigError
            There is no mass yet.
        """
        mass = self.weighing().mass
        if math.isnan(mass):
            raise ConfigError("nothing is weighed yet: drive on before the scale is tared")
        self._tared = mass
        return mass

    def take_over(self, other: LiveScale) -> None:
        """Take over what holds for any load: what was set to nought, and how the vehicle tilts."""
        self._tared = other._tared
        self._kerb.map = other._kerb.map

    def clock_set_back(self, start: float) -> None:
        """Put samples from an earlier instant on [s] behind the newest, as after a stop."""
        self._records.follow(start, STOP)

    def load_changed(self) -> None:
        """Report that the load has changed: earlier samples say nothing about the new one.

        What is known of sensors and noise stays, and so does a contradiction.
        """
        self._take(wait=True)
        if self._state is not None:
            self._state = forward.unloaded(self._state)
        if self._learned is not None and not self._learned.inconsistent:
            self._learned = None
        self._forget(self._records.newest)
        self._move.this_load = 0.0
        self._since = self._records.newest
        self._move.begin_anew()

    def renew(self) -> None:
        """Report that the clock of a device starts again, as of one that was turned on again.

        Where all signals were silent before, the vehicle may have been driven and loaded
        meanwhile: what comes is weighed as a new drive. Where others went on it is the same drive.
        """
        records = self._records
        if not records.newest - records.resumed < RENEWED:
            return
        self._take(wait=True)
        self._learned = None
        self._move = OnTheMove()
        self._kerb.begin_anew()
        self._since = self._kept_from = self._anew = records.resumed
        if self._learns:
            self._setup = self._state = None
        elif self._setup is not None:
            self._state = forward.begin(self._setup, records.resumed)
        records.cut(records.resumed)
        self._next = first_instant(records.resumed, self._every)

    def weighing(self, silence: float = 0.0, *, ahead: bool = False) -> LiveWeighing:
        """Return the mass as it is known now, and what would make it surer.

        The mass is the settled one, of which nothing changes any more: that of the forward stages
        over all samples that can no longer be late. With ``ahead`` it is provisional: what came
        since is weighed on a copy of the state, with less to look ahead and the open window as it
        is. The copy is thrown away. Nothing that is settled, kept or learnt depends on it.

        Parameters
        ----------
        silence : time since any sample came last [s]; who feeds the scale knows it
        ahead : for showing: a mass that is `weighbridge.pipeline.forward.HURRY` and the lateness
            younger, and costs a step of the stages
        """
        self._take()
        state = self._ahead() if ahead else self._state
        mass, std, floor, at = known_mass(state, self._setup, self._learned)
        parked, health = self._health(silence)
        stop = self._unfollowed_stop(state)
        found = self._outlook(mass, std, floor, health, state, stop, parked=parked)
        newest = self._records.newest
        learned, kerb = self._learned, self._kerb.state()
        return LiveWeighing(
            vehicle=self.vehicle.name,
            time=at,
            age=newest + silence - at if math.isfinite(at) else math.nan,
            newest=newest if math.isfinite(newest) else math.nan,
            status=found.status,
            parked=parked,
            refusal=found.reason,
            mass=mass,
            std=math.hypot(std, mass * stop.std),
            tare=self.vehicle.tare,
            gross=self.vehicle.gross,
            tared=self._tared,
            driven=self._move.driven,
            progress=found.progress,
            progress_to_5=found.progress_to_5,
            reach=found.reach,
            minutes_to_5=found.minutes_to_5,
            minutes_to_2=found.minutes_to_2,
            advice=found.advice,
            look=self._look(state),
            provisional=state is not self._state,
            kerb=kerb,
            signals=health,
            problems=(
                *self._doubts(mass),
                *by_tilt(kerb),
                *(learned.problems if learned is not None else ()),
            ),
        )

    def _doubts(self, mass: float) -> tuple[Problem, ...]:
        return doubts(
            self._records,
            driven=self._move.driven,
            anew=self._anew,
            driven_since=self._driven_since(),
            goes_on=self._is_of_before(mass),
        )

    def _driven_since(self) -> float:
        """Time on the move since all signals were silent the last time [s]."""
        waits = self._next is not None and self._records.resumed >= self._next - self._every
        return 0.0 if waits else self._move.driven - self._move.before

    def _is_of_before(self, mass: float) -> bool:
        """Whether a mass is of a load that was there before all signals were silent."""
        return math.isfinite(mass) and self._since < self._records.resumed

    def _unfollowed_stop(self, state: ForwardState | None) -> UnfollowedStop:
        """Return the longest stop since what the mass is made of, and what it leaves open.

        A stop that is no longer than the vehicle has stood by now, but for the look ahead, is this
        one: the mass is that with which it came.
        """
        now = self._move.stood
        if self._setup is not None and state is not None and state.joint.windows:
            stood, by_speed = forward.unfollowed_stop(state, moved=now == 0.0), False
            settings = self._setup.joint.settings
        else:
            stood, by_speed, settings = self._move.rested, True, JointSettings()
        if now > 0.0 and stood <= now + self._every + self._records.lateness:
            return NO_STOP
        std = unfollowed_std(stood, settings.change_std, by_speed=by_speed)
        return UnfollowedStop(stood, std)

    def _ahead(self) -> ForwardState | None:
        """State after all samples that came, to look at alone; see `forward.looked_ahead`."""
        state, setup, records = self._state, self._setup, self._records
        if state is None or setup is None or not state.joint.windows:
            return state
        seen = records.so_far(self.info, self._behind + self._every)
        return forward.looked_ahead(state, seen, records.newest, setup)

    @property
    def _behind(self) -> float:
        """Time before a step in which it reads the records, too [s]."""
        return BEHIND + (0.0 if self._setup is None else self._setup.reach)

    def _goes_on(self) -> bool:
        """Whether the mass is that of the forward stages, which each second of driving makes."""
        state = self._state
        reported = self._learned is None or not self._learned.inconsistent
        return (
            reported and self._setup is not None and state is not None and state.joint.windows > 0
        )

    def _look(self, state: ForwardState | None) -> float:
        """Part of the driving until the next look that is done [-]; NaN where nothing waits."""
        if not self._learns or (self._goes_on() and forward.too_wide(state, self._setup) == 0.0):
            return math.nan
        return 1.0 if self._looking is not None else self._move.part

    def _outlook(
        self,
        mass: float,
        std: float,
        floor: float,
        health: tuple[SignalHealth, ...],
        state: ForwardState | None,
        stop: UnfollowedStop,
        *,
        parked: bool,
    ) -> Outlook:
        learned = self._learned
        if learned is not None and learned.inconsistent:
            return Outlook(status=LiveStatus.INCONSISTENT, reason=learned.refusal)
        silent = [s.name for s in health if s.needed and s.fails]
        reason = learned.refusal if learned is not None else None
        if reason is not None and self._learns:
            left = self._to_look()
            again = phrase("looked_at_after", left=left) if left else phrase("looked_at_now")
            reason = replace(reason, text=f"{reason.text}; {again}")
        if wide := forward.too_wide(state, self._setup):
            reason = Problem.of("live.too_wide", share=196.0 * wide)
        waits = self._learns and not self._goes_on()
        since = self._move.driven - self._move.looked_at if waits else 0.0
        return outlook(
            mass,
            std,
            floor,
            driven=self._move.this_load - since,
            reason=reason,
            silent=silent,
            first=FIRST,
            std_found=math.nan if learned is None else learned.std_found,
            stop=stop,
            unproved=self._unproved(mass, state, parked=parked),
            since=since,
            wait=self._to_look() if waits else 0.0,
        )

    def _to_look(self) -> float:
        """Time on the move until the next look [s]; 0 while one goes on."""
        return 0.0 if self._looking is not None else self._move.left

    def _unproved(self, mass: float, state: ForwardState | None, *, parked: bool) -> Problem | None:
        if self.newest == self._kept_to:
            return Problem.of("live.no_sample")
        if state is None and self._learned is not None and self._learned.early is not None:
            return self._learned.early
        if parked:
            # Only driving shows another load.
            return None
        return of_before(
            self._records, driven_since=self._driven_since(), goes_on=self._is_of_before(mass)
        )

    def _advance(self, until: float | None = None) -> None:
        """Take the steps that the samples so far complete."""
        self._take()
        end = self._records.watermark if until is None else until
        if self._next is None:
            oldest = self._records.oldest
            if not end >= oldest:
                return
            self._next = first_instant(oldest, self._every)
            self._since = max(self._since, oldest)
            if self._setup is not None and self._state is None:
                self._state = forward.begin(self._setup, oldest)
        while self._next <= end:
            self._records.seal(self._next)
            if self._records.newest_sealed >= self._next - self._every - self._behind:
                self._step(self._next, self._every)
                self._next += self._every
            else:
                # Nothing came for long: on to the next sample.
                self._next = first_instant(self._records.waiting_from, self._every)

    def _step(self, until: float, length: float) -> None:
        drive = self._records.drive(self.info)
        seen = recent(drive, until, length + self._behind - BEHIND)
        moved = moves(seen, until)
        still = stands(seen, until)
        if not still and self._kerb.stand is not None:
            # The mass of the stop is that of a look that goes on, if one does.
            self._take(wait=True)
        if until - length <= self._records.resumed < until:
            self._move.before = self._move.driven
        stood = self._move.stood
        self._move.go_on(length, moved=moved)
        if moved and stood >= SHORTEST_BY_SPEED and not self._goes_on():
            self._move.look_soon(stood)
        if self._setup is not None and self._state is not None:
            self._state, _ = forward.step(self._state, seen, until, self._setup)
        self._tilt(seen, until, length, still=still)
        if self._looking is not None:
            self._looking.steps.append(Step(until, seen, length if moved else 0.0))
        keep = self._behind + 2.0 * self._every
        if self._learns:
            keep += LONGEST
            if self._move.is_due:
                self._learn(drive, until)
        self._forget(until - keep)

    def _tilt(self, seen: Drive, until: float, length: float, *, still: bool) -> None:
        """Follow the tilt of the vehicle while it stands."""
        state, setup = self._state, self._setup
        axis = None
        if state is not None and setup is not None:
            axis = forward_axis(state.motion, setup.navigation)
        if not still:
            self._kerb.move(length, axis)
            return
        weighed = None
        if self._goes_on() and self._looking is None:
            mass, std, floor, _ = known_mass(state, setup, self._learned)
            if math.isfinite(mass):
                weighed = Weighed(mass, max(std**2 - (floor * mass) ** 2, 0.0))
        self._kerb.stay(seen, until, length, forward=axis, mass=weighed)

    def _forget(self, before: float) -> None:
        self._kept_from = max(self._kept_from, before)
        self._records.forget(before, FEWEST_SAMPLES)

    def _learn(self, drive: Drive, until: float) -> None:
        """Look at all that is kept."""
        self._take(wait=True)
        mass, std, _, _ = known_mass(self._state, self._setup, self._learned)
        self._move.looks(weighed=math.isfinite(mass))
        self._looking = Look(
            drive=drive, kept_from=self._kept_from, until=until, step=self._every,
            mass=mass, std=std,
        )  # fmt: skip
        self._looking.begin(self.vehicle, aside=self.looks_aside)
        self._take(wait=not self.looks_aside)

    def _take(self, *, wait: bool = False) -> None:
        """Go on from what a look has found, where it shows more than is known."""
        look = self._looking
        if look is None or (look.goes_on and not wait):
            return
        self._looking = None
        self._learned = learned = look.found()
        why = "" if learned.refusal is None else learned.refusal.text
        _LOG.info("looked at %.0f s: %.0f kg %s", look.drive.duration, learned.mass, why)
        if learned.inconsistent:
            # Fewer records, as after a restart, show no contradiction; the mass stays wrong.
            self._setup = self._state = None
        if math.isnan(learned.mass):
            return
        if learned.early is None and (self._setup is None or look.tells_more(self._since)):
            self._setup, self._state = learned.setup, look.state()
        if learned.since > max(look.drive.start, self._since):
            # The load has changed on the way.
            self._since = learned.since
            self._move.this_load, self._move.rested = look.driven_since(learned.since), 0.0

    def _health(self, silence: float) -> tuple[bool, tuple[SignalHealth, ...]]:
        """Whether the vehicle is parked, and how each signal comes."""
        came = self._records.names()
        if came != self._came:
            self._came, self._needed = came, needed_signals(self.vehicle, came)
        parked = is_parked(self._records, self._needed, silence)
        return parked, health_of(self._records, self._needed, silence, parked=parked)
