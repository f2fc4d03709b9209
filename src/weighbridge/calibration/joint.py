"""Torque model and road load by likelihood, as the joint estimator weighs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.balance.braking import retarder_unreported
from weighbridge.balance.delay import FARTHEST
from weighbridge.calibration.fitted import (
    Fitted,
    check_delay,
    fitted_rows,
    learnt_dragged,
    noted,
    ranges,
    rebalanced,
)
from weighbridge.calibration.inverse import (
    DriveRows,
    FitSettings,
    InverseFit,
    TooShort,
    fit,
    fit_with_gusts,
    log_likelihoods,
)
from weighbridge.calibration.problem import Problem
from weighbridge.calibration.recording import DelayedRows
from weighbridge.calibration.rls import fit_rls, refuse_diesel_air, refuse_nonsense
from weighbridge.calibration.self_weighing import (
    BY_JOINT,
    BY_SPEED_TORQUE,
    Weigher,
    self_weighed,
)
from weighbridge.estimators import joint
from weighbridge.estimators.joint.problem import UNMODELLED
from weighbridge.estimators.track import MassTrack
from weighbridge.limits import CERTAIN
from weighbridge.messages import Problem as Message
from weighbridge.messages import phrase, refused
from weighbridge.navigation import BY_SPEED
from weighbridge.results import DelaySearch
from weighbridge.signals import Floats
from weighbridge.signals.lag import STEP, beyond, lowest, parabola
from weighbridge.vehicle import Driveline, Provenance, RoadLoad, Timing, Vehicle

LAGS: Final = (0.0, 0.1, 0.2, 0.3, 0.4)
"""Time constants of the reading's smoothing that are tried [s]. Longer ones pass for the smoothness
of a polled speed: with up to 1.25 s, 2 Hz without an accelerometer went from 3 to 13 % RMS."""

USUAL_LAG: Final = 0.15
"""What a reading is smoothed by, before any drive has shown it [s]: a tenth of a second or two."""

LAG_SPREAD: Final = 0.08
"""Its standard deviation [s]."""

DELAYS: Final = tuple(STEP * k for k in range(-2, 7))
"""Sums of delay and lag among which the search begins [s]; it goes on beyond an end that fits
best."""

SHIFTS: Final = (-0.2, -0.1, 0.0, 0.1, 0.2)
"""Around the sum that fits best, those tried with each lag [s]."""

USUAL_DELAY: Final = 0.3
"""Sum of delay and lag where the drives do not show it [s]."""

STEPLESS_SPREAD: Final = 0.1
"""Standard deviation of that sum with a stepless gearbox, whose engine gains speed before it
pulls: a torque that is early looks like an engine of little inertia [s]. Without it, four
calibrations of the second model found 0.0 to 0.2 s and 0.01 to 0.12 kg m^2, where 0.17 to 0.21
are true."""

TIMING_WINDOW: Final = 0.6
"""Windows of the search [s]: shorter than those of the fit, for delay shows in what is fast."""

TIMING_SAMPLES: Final = 1.2
"""Samples of a slowly polled reading that they hold at least [-]; fewer left none at 1 Hz."""

MOST: Final = np.array([19.0, 0.09, np.inf, np.inf])
"""Drag area [m^2], rolling coefficient [-] and inertias that a vehicle file can hold, about."""

ROUGH_NOISE: Final = 0.05
"""Noise of the torque over the highest of the motion, until a fit has shown it [-]."""


def fit_joint(problem: Problem) -> Fitted:
    """Fit torque, road load, delay and lag by likelihood, then scale by weighing the drives."""
    return _fit(problem, BY_JOINT)


def fit_speed_torque(problem: Problem) -> Fitted:
    """Fit as `fit_joint` does, and scale by weighing as ``speed-torque-ekf`` does."""
    return _fit(problem, BY_SPEED_TORQUE)


def _fit(problem: Problem, weigher: Weigher) -> Fitted:
    """Fit by likelihood, then scale the torque by what the drives weigh.

    Where the drives are too short for it, or say of the road load what no vehicle has, the torque
    of eq. 48 is scaled in its place.

    Raises
    ------
    DriveError
        The drives cannot be weighed, or torque does not rise with its source.
    """
    try:
        fitted, cov = _likeliest(problem)
    except TooShort as short:
        return _as_it_is(problem, str(short), weigher)
    except _NoRoadLoad as strange:
        if problem.by_speed:
            # The torque of eq. 48 is worse still: noise of the motion and hills draw it.
            raise refused(
                "calibration.strange_road", strange=strange, help=_would_help(problem)
            ) from None
        return _as_it_is(problem, str(strange), weigher)
    return replace(fitted, vehicle=self_weighed(problem, fitted.vehicle, cov, weigher))


def _would_help(problem: Problem) -> str:
    """Name the signals that show hills and braking from resistance and that the drives lack."""
    drives = [recording.drive for recording in problem.recordings]
    lacked = [phrase("an_inertial_sensor")]
    if any(not (d.has("altitude") or d.has("grade")) for d in drives):
        lacked.append(phrase("gnss_heights"))
    if any(not d.has("brake_switch") for d in drives):
        lacked.append(phrase("a_brake_switch"))
    if any(retarder_unreported(d, problem.base) for d in drives):
        lacked.append(phrase("retarder_torque"))
    return " or ".join(lacked)


class _NoRoadLoad(Exception):
    """The fit makes a road load that no vehicle of the class has."""


def _as_it_is(problem: Problem, why: str, weigher: Weigher) -> Fitted:
    """Fit by eq. 48, and scale the torque alone."""
    fitted = fit_rls(problem)
    note = Message.of("calibration.scaled", why=why)
    vehicle = self_weighed(problem, noted(fitted.vehicle, note), None, weigher)
    return replace(fitted, vehicle=vehicle, notes=(*fitted.notes, note))


def _likeliest(problem: Problem) -> tuple[Fitted, Floats]:
    """Fit all but the last scale; the second value is the covariance of the fit."""
    rough = _rows(problem, USUAL_DELAY - USUAL_LAG, USUAL_LAG)
    settings = _settings(problem, _rough_noise(problem, rough))
    quick = replace(settings, window=_timing_window(problem), rounds=1)
    quick = replace(quick, torque_noise=_noise(problem, rough, quick))
    lags = _lags(problem)
    delay, lag, identified, search = find_timing(_Misfits(problem, quick, lags), lags)

    check_delay(problem, delay)
    timing = Timing(torque_delay=delay, torque_lag=lag)
    problem = _with_dragged(problem, timing, settings.prior[0])
    rows = _rows(problem, delay, lag)
    turning = np.concatenate([part.engine_speed[part.usable] for part in rows])
    noise = _noise(problem, rows, replace(settings, torque_noise=quick.torque_noise))
    settings = replace(settings, torque_noise=noise, knots=problem.knots(turning))
    given = _drive_rows(problem, rows)
    found = fit_with_gusts(given, settings)
    _refuse_strange(problem, found, rows, settings)
    first = replace(_with(problem.draft, found, settings), timing=timing)
    tracks = [
        joint.estimate(balance, first, load_changes=False) for balance in rebalanced(problem, first)
    ]
    shown = _as_shown(given, tracks, first)
    if any(one is not before for one, before in zip(shown, given, strict=True)):
        found = fit_with_gusts(shown, settings)
        _refuse_strange(problem, found, rows, settings)
    powers = [track.switched.power for track in tracks if track.switched is not None]
    vehicle = _with(problem.draft, found, settings)
    speeds, loads = ranges(problem, rows)
    vehicle = replace(
        vehicle,
        torque=replace(vehicle.torque, noise=noise, load_range=loads, speed_range=speeds),
        timing=replace(timing, torque_delay_std=search.std),
        provenance=Provenance(
            masses=tuple(problem.masses),
            switched_power=float(np.mean(powers)) if powers else None,
        ),
    )
    notes = () if identified else (Message.of("calibration.delay_unknown"),)
    for note in notes:
        vehicle = noted(vehicle, note)
    held = ("drag_area",) if found.road[0] <= 0.0 else ()
    return Fitted(vehicle=vehicle, rows=rows, search=search, held=held, notes=notes), found.cov


def _refuse_strange(
    problem: Problem, found: InverseFit, rows: Sequence[DelayedRows], settings: FitSettings
) -> None:
    """Refuse a torque that falls with its reading, and a road load that no vehicle has."""
    slope = _driven_slope(problem, found, rows)
    refuse_nonsense(problem, *slope)
    mean, std = settings.prior
    if np.any(np.abs(found.road - mean)[:2] > CERTAIN * std[:2]):
        refuse_diesel_air(problem, *slope)
        raise _NoRoadLoad(
            phrase(
                "strange_road", area=found.road[0], rolling=found.road[1], kind=problem.draft.kind
            )
        )


def _as_shown(
    drives: Sequence[DriveRows], tracks: Sequence[MassTrack], vehicle: Vehicle
) -> list[DriveRows]:
    """Let rows know what weighing by a first fit shows: accessories, and noise of hills.

    Noise of an accelerometer is a tenth of that and less. With it, 17 undamaged drives of the
    corpus went from 2.1 to 2.5 % RMS, and 8 foreign ones from 0.59 to 0.72 %.
    """
    shown = []
    for rows, track in zip(drives, tracks, strict=True):
        if track.switched is not None:
            rows = replace(rows, beside=track.switched.force(rows.table, vehicle))
        by_speed = rows.motion.source in BY_SPEED
        if by_speed and track.sizes is not None and track.filter_input is not None:
            noise = track.sizes.noise_information / track.filter_input.weight()
            rows = replace(rows, motion_noise=noise)
        shown.append(rows)
    return shown


def _rows(problem: Problem, delay: float, lag: float) -> tuple[DelayedRows, ...]:
    """Return the rows of whole balances at a delay and a lag [s]."""
    return tuple(r.rows(delay, lag) for r in problem.recordings)


def _timing_window(problem: Problem) -> float:
    """Length of the windows in which delay and lag are searched [s]."""
    periods = [r.source.carrier(r.drive).period for r in problem.recordings]
    return max(TIMING_WINDOW, TIMING_SAMPLES * max(periods))


def _drive_rows(problem: Problem, rows: Sequence[DelayedRows]) -> list[DriveRows]:
    """See rows as the fit reads them."""
    return [
        DriveRows(
            table=part.table,
            regressor=part.reading,
            engine_speed=part.engine_speed,
            usable=part.usable,
            mass=recording.mass,
            motion=recording.motion,
        )
        for recording, part in zip(problem.recordings, rows, strict=True)
    ]


def _settings(problem: Problem, noise: float) -> FitSettings:
    """State what is fitted and what is known before, with a noise of the torque [N m]."""
    prior = _prior(problem.draft, problem.base.driveline)
    named = replace(problem.draft.torque, source=problem.source.name, coefficients=(0.0, 1.0))
    area, rolling = (float(value) for value in prior[0][:2])
    known = RoadLoad(
        drag_area=area, rolling_coefficient=rolling, drag_area_std=0.0, rolling_coefficient_std=0.0
    )
    return FitSettings(
        source=problem.source,
        order=problem.order,
        curved=problem.curved,
        knots=(),
        bounds=problem.source.terms,
        torque_noise=noise,
        vehicle=replace(problem.draft, torque=named, road_load=known),
        prior=prior,
    )


def _rough_noise(problem: Problem, rows: Sequence[DelayedRows]) -> float:
    """Guess the noise of the torque from the torque that the motion takes [N m]."""
    taken = np.concatenate(
        [
            recording.mass * np.abs(part.table.specific_force / part.table.gearing)[part.usable]
            for recording, part in zip(problem.recordings, rows, strict=True)
        ]
    )
    if not taken.size:
        raise TooShort("no usable stretches of time; drive longer, with more starts")
    return ROUGH_NOISE * float(np.percentile(taken, 98.0))


def _noise(problem: Problem, rows: Sequence[DelayedRows], settings: FitSettings) -> float:
    """Find the noise of the torque by a quick fit [N m]."""
    quick = replace(settings, rounds=1, knots=())
    found = fit(_drive_rows(problem, rows), quick)
    return fitted_rows(_with(problem.draft, found, quick), problem, rows).residual_std


def _with_dragged(problem: Problem, timing: Timing, road: Floats) -> Problem:
    """Learn the reading of a dragged engine at the timing found, and let the drives know it."""
    seen = replace(
        problem.draft,
        torque=replace(problem.draft.torque, source=problem.source.name, coefficients=(0.0, 1.0)),
        road_load=RoadLoad(drag_area=float(road[0]), rolling_coefficient=float(road[1])),
        timing=timing,
        provenance=Provenance(masses=tuple(problem.masses)),
    )
    draft = replace(problem.draft, dragged=learnt_dragged(problem, seen))
    drives = tuple(r.with_draft(draft) for r in problem.recordings)
    return replace(problem, draft=draft, recordings=drives)


def _driven_slope(
    problem: Problem, found: InverseFit, rows: Sequence[DelayedRows]
) -> tuple[float, float]:
    """Slope of the torque over its reading at the mean reading and speed, and its std."""
    reading = np.concatenate(
        [r.reading[part.usable] for r, part in zip(problem.recordings, rows, strict=True)]
    )
    turning = np.concatenate([part.engine_speed[part.usable] for part in rows])
    slope = np.zeros(found.coefficients.size)
    slope[1] = 1.0
    if problem.curved:
        bent = 2 + problem.order
        slope[bent], slope[bent + 1] = np.mean(turning), 2.0 * np.mean(reading)
    cov = found.cov[: slope.size, : slope.size]
    return float(slope @ found.coefficients), float(np.sqrt(slope @ cov @ slope))


@dataclass(frozen=True, slots=True)
class _Misfits:
    """Negative log-likelihood of pairs of delay and lag, all by the same rows.

    Other rows would make other likelihoods: only those count that are usable at all.

    Attributes
    ----------
    problem, settings
    lags : that are tried, rising [s]
    """

    problem: Problem
    settings: FitSettings
    lags: Sequence[float]

    def __call__(self, pairs: Sequence[tuple[float, float]]) -> Floats:
        longest = self.lags[-1]
        drives = [list(r.search(pairs, longest, USUAL_LAG)) for r in self.problem.recordings]
        shared = [np.logical_and.reduce([rows.usable for rows in tried]) for tried in drives]
        misfits = np.empty(len(pairs))
        # Rows of one delay differ by their reading alone.
        nearly = np.array([round(delay, 9) for delay, _ in pairs])
        for delay in np.unique(nearly):
            of_delay = np.flatnonzero(nearly == delay)
            rows = [
                replace(tried[of_delay[0]], usable=use)
                for tried, use in zip(drives, shared, strict=True)
            ]
            readings = [[tried[k].reading for tried in drives] for k in of_delay]
            given = _drive_rows(self.problem, rows)
            misfits[of_delay] = np.negative(log_likelihoods(given, readings, self.settings))
        if self.problem.draft.driveline.stepless:
            totals = np.array([delay + lag for delay, lag in pairs])
            misfits += 0.5 * np.square(UNMODELLED * (totals - USUAL_DELAY) / STEPLESS_SPREAD)
        return misfits


def _prior(vehicle: Vehicle, known: Driveline) -> tuple[Floats, Floats]:
    """Road load and inertias of the class, and what the given vehicle file says of them."""
    mean, std = vehicle.of_class.road_prior(single_speed=vehicle.driveline.single_speed)
    for k, given, given_std in (
        (2, known.engine_inertia, known.engine_inertia_std),
        (3, known.wheel_inertia, known.wheel_inertia_std),
    ):
        mean[k] = mean[k] if given is None else given
        std[k] = std[k] if given_std is None else given_std
    return mean, std


def _lags(problem: Problem) -> Sequence[float]:
    """Return the lags to try: the usual one alone where the torque is too slow to show one [s].

    Between samples further apart than the longest lag the torque is no line. Passed through a lag
    at 1 Hz, it put the delays of 16 vehicles 0.14 s too early. So it is 0.06 s, by which the usual
    lag is longer than theirs.
    """
    periods = [r.source.carrier(r.drive).period for r in problem.recordings]
    return LAGS if max(periods) <= LAGS[-1] else (USUAL_LAG,)


def find_timing(
    misfits: Callable[[Sequence[tuple[float, float]]], Floats], given: Sequence[float] = LAGS
) -> tuple[float, float, bool, DelaySearch]:
    """Find delay and lag of least misfit: their sum first, then both, then the delay finely.

    Parameters
    ----------
    misfits : of pairs of delay and lag [s], all by the same rows
    given : lags to try, rising [s]

    Returns
    -------
    delay, lag : [s]
    identified : whether the drives show them
    search : what was tried of their sum, and the standard deviation of the delay
    """
    totals = np.array(DELAYS)
    scores = misfits([(float(t) - USUAL_LAG, USUAL_LAG) for t in totals])
    while int(np.argmin(scores)) in (0, totals.size - 1):
        more = beyond(totals, scores, FARTHEST)
        if not more.size:
            break
        totals = np.sort(np.concatenate([totals, more]))
        scores = misfits([(float(t) - USUAL_LAG, USUAL_LAG) for t in totals])
    # At the ends both sides have little in common, and little to disagree about.
    low = [k for k in range(1, totals.size - 1) if scores[k] <= min(scores[k - 1 : k + 2])]
    coarse = scores
    total = float(totals[min(low, key=lambda k: scores[k])]) if low else USUAL_DELAY

    tried = total + np.array(SHIFTS)
    pairs = [(float(t) - lag, lag) for lag in given for t in tried]
    by_lag = misfits(pairs).reshape(len(given), len(SHIFTS))
    lowest_at = [lowest(tried, each) for each in by_lag]
    lags = np.array(given)
    unusual = 0.5 * np.square(UNMODELLED * (lags - USUAL_LAG) / LAG_SPREAD)
    lag, _ = lowest(lags, np.array([misfit for _, misfit in lowest_at]) + unusual)
    delay = float(np.interp(lag, given, [where for where, _ in lowest_at])) - lag
    delays = np.asarray(delay + 0.03 * np.arange(-4, 5), dtype=np.float64)
    scores = misfits([(float(d), lag) for d in delays])
    best = int(np.clip(np.argmin(scores), 1, delays.size - 2))
    near = slice(best - 1, best + 2)
    delay = parabola(delays[near], scores[near]).at
    # The misfit is the logarithm of a likelihood. Over three of them its bend is rough.
    bend = parabola(delays, scores).bend
    search = DelaySearch(
        delay=totals,
        misfit=coarse - coarse.min(),
        std=float(UNMODELLED / np.sqrt(bend)) if bend > 0.0 else None,
    )
    return delay, lag, bool(low), search


def _with(draft: Vehicle, found: InverseFit, settings: FitSettings) -> Vehicle:
    """Return the draft with what was fitted."""
    bent = found.coefficients.size - len(settings.knots)
    straight = bent - 2 * settings.curved
    values = [float(w) for w in found.coefficients]
    stds = [float(s) for s in found.stds]
    # A quick fit, whose road load nobody keeps, may go beyond what a vehicle file can hold.
    road = np.clip(found.road, 0.0, MOST)
    return replace(
        draft,
        torque=replace(
            draft.torque,
            source=settings.source.name,
            coefficients=tuple(values[:straight]),
            coefficient_stds=tuple(stds[:straight]),
            curvature=tuple(values[straight:bent]),
            curvature_stds=tuple(stds[straight:bent]),
            knots=settings.knots,
            knot_slopes=tuple(values[bent:]),
        ),
        road_load=RoadLoad(
            drag_area=float(road[0]),
            rolling_coefficient=float(road[1]),
            drag_area_std=stds[-4],
            rolling_coefficient_std=stds[-3],
        ),
        driveline=replace(
            draft.driveline,
            engine_inertia=float(road[2]),
            engine_inertia_std=stds[-2],
            wheel_inertia=float(road[3]),
            wheel_inertia_std=stds[-1],
        ),
    )
