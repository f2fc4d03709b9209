"""From a drive and a vehicle to sprung mass and inertias."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np

from weighbridge.arguments import check_path, check_text, check_type, suggestion
from weighbridge.checks import correct_drive, refuse_serious
from weighbridge.constants import GRAVITY
from weighbridge.errors import ConfigError
from weighbridge.estimators import changed, differences
from weighbridge.estimators.track import Status
from weighbridge.inertia import (
    AXES,
    METHODS,
    PARTS,
    UNKNOWN_FORCE_STD,
    InertiaSettings,
    InertiaTrack,
    Method,
    RideSamples,
    SuspensionCheck,
    check_suspension,
    estimate,
    integration_std,
    ride_samples,
)
from weighbridge.inertia.load_changes import believed_otherwise, jumps, load_changes
from weighbridge.inertia.ride_checks import (
    LEAST,
    LONGEST_PERIOD,
    NEEDED,
    check_response,
    check_signals,
    nothing_moves,
    ride_of,
)
from weighbridge.inertia.suspension import SHORTEST, attenuation, body_tilt, response, static_mass
from weighbridge.messages import Problem, phrase
from weighbridge.pipeline.given import (
    GivenDrive,
    GivenVehicle,
    as_drive,
    as_vehicle,
    home_of,
    mapping_of,
)
from weighbridge.results.inertia import TOO_WIDE, InertiaResult, LoadSegment
from weighbridge.signals import Drive, Floats
from weighbridge.vehicle import Ride, Vehicle

DEFAULT_METHOD: Final[Method] = "kalman-bucy"

WRONG_PART: Final = 0.5
"""A spring or damper off by more than this part is broken or not the file's [-]."""

WRONG_SHARE: Final = 0.05
"""Part of the accelerations' power that wrong parts may explain [-]."""

MOSTLY_CALM: Final = 0.3
"""Braking, starting and turning are believed up to this part of a ride [-]."""

STATIC_PART: Final = 0.04
"""Weight at rest and mass in motion may differ by this part of the mass [-]."""

HOPPING: Final = 0.0075
"""A ride sampled more slowly gets the note that faster is better [s]: at 100 Hz the axles' hop is
integrated to within 0.5 %, at 200 Hz to within 0.03 %."""

TILT: Final = 0.003
"""Angles of the body over its two axles may differ by so much [rad]: 5 mm over a track."""

TILT_PART: Final = 0.3
"""Or by this part of them: tyres give, and differently at front and rear [-]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Inertia(InertiaResult):
    """Sprung mass and inertias at the end of a drive, their uncertainty and the reason."""

    def report(self, path: str | Path) -> None:
        """Write a self-contained HTML report that opens offline."""
        from weighbridge.report.inertia_panels import write_inertia

        check_path("path", path)
        write_inertia(self, Path(path))


def estimate_inertia(
    drive: GivenDrive,
    vehicle: GivenVehicle,
    method: str = DEFAULT_METHOD,
    *,
    settings: InertiaSettings | Mapping[str, Any] | None = None,
) -> Inertia:
    """Estimate sprung mass, roll inertia and pitch inertia from the ride of a drive.

    Parameters
    ----------
    drive : with suspension travel and rate at four wheels, vertical velocity, roll rate
        and pitch rate; or the path or data frame that it is to be read from
    vehicle : with its suspension, ``[ride]`` of the vehicle file; or the path of that file
    method : name of the filter
    settings : of the filter, or what differs from its defaults by name

    Returns
    -------
    Inertia
        At the end of the drive; a drive that carries none has a status and a reason.

    Raises
    ------
    ConfigError
        The method or a setting is not known, or the vehicle file has no suspension.
    DriveError
        The data of the drive cannot be right, for example because of a wrong unit or sign.
    """
    check_text("method", method)
    kinds = (InertiaSettings, Mapping, type(None))
    check_type("settings", settings, kinds, "an InertiaSettings, or a dictionary of values")
    own = changed(InertiaSettings(), settings) if isinstance(settings, Mapping) else settings
    chosen: Method | None = next((m for m in METHODS if m == method), None)
    if chosen is None:
        raise ConfigError(f"unknown method {method!r}{suggestion(method, METHODS)}")
    home, vehicle = home_of(vehicle), as_vehicle(vehicle)
    return _estimate(as_drive(drive, mapping_of(vehicle, home)), vehicle, chosen, own)


def _estimate(
    drive: Drive, vehicle: Vehicle, chosen: Method, settings: InertiaSettings | None
) -> Inertia:
    ride = vehicle.ride
    if ride is None:
        raise ConfigError(
            f"the vehicle file of {vehicle.name} has no [ride] section: add its springs, dampers "
            "and axle distances, as in examples/ride-truck/vehicle.toml"
        )

    def nothing(
        status: Status,
        refusal: Problem,
        problems: tuple[Problem, ...] = (),
        track: InertiaTrack | None = None,
    ) -> Inertia:
        return Inertia(
            drive=drive, vehicle=vehicle, method=chosen, status=status, refusal=refusal,
            track=track, suspension=None, model_std=np.zeros(3), segments=(), problems=problems,
        )  # fmt: skip

    if lacking := drive.missing(NEEDED):
        listed = ", ".join(lacking)
        return nothing(Status.MISSING_SIGNALS, Problem.of("ride.missing", missing=listed))
    only = ride_of(drive)
    if nothing_moves(only):
        return nothing(
            Status.NOT_EXCITED,
            Problem.of("ride.still"),
        )
    corrected = correct_drive(only)
    found = [*corrected.problems, *check_signals(only)]
    refuse_serious(drive.name, found)
    samples = ride_samples(corrected)
    seen = response(samples, ride)
    found += check_response(seen) if seen is not None else ()
    refuse_serious(drive.name, found)
    problems = tuple(dict.fromkeys(found))
    if settings is not None and (own := differences(settings)):
        problems += (Problem.of("method.settings", method=chosen, own=own),)
    if not samples.period <= LONGEST_PERIOD:
        return nothing(
            Status.NOT_EXCITED,
            Problem.of("ride.slow", rate=1.0 / samples.period),
            problems,
        )
    if samples.duration < LEAST or seen is None:
        return nothing(
            Status.NOT_EXCITED,
            Problem.of("ride.short", duration=samples.duration, least=LEAST, needed=SHORTEST),
            problems,
        )
    track = estimate(samples, ride, chosen, settings)
    if not np.ptp(track.alpha, axis=0).any():
        return nothing(
            Status.NOT_EXCITED,
            Problem.of("ride.filter_stuck", method=chosen, other=DEFAULT_METHOD),
            problems,
            track,
        )
    return _judged(drive, vehicle, ride, samples, track, seen.slope, problems)


def _judged(
    drive: Drive,
    vehicle: Vehicle,
    ride: Ride,
    samples: RideSamples,
    track: InertiaTrack,
    average: Floats,
    problems: tuple[Problem, ...],
) -> Inertia:
    """Say what the estimate is worth; ``average`` is that of alpha over the whole ride."""
    believed = jumps(track)
    trouble = _trouble(track, believed)
    changes = load_changes(track, believed)
    check = _check(samples, ride, track, changes, average, bool(trouble))
    if check is None and not trouble and track.noise_factor > 1.0:
        trouble = Problem.of("ride.noisy_short", factor=track.noise_factor, needed=SHORTEST)
    common = UNKNOWN_FORCE_STD if ride.force_std is None else ride.force_std
    noisy = attenuation(samples, ride, track.noise_factor, np.asarray(track.alpha[-1]))
    std = np.hypot(np.hypot(common, noisy), integration_std(samples, ride))
    # Each with what it does to the interval, which is said where there is one.
    doubts: list[tuple[Problem, str]] = []
    if check is not None and check.off.any():
        std = np.hypot(std, float(np.max(np.abs(check.factor - 1.0))))
        doubts.append((Problem.of("ride.parts", parts=_parts(check)), phrase("interval_widened")))
    last = samples.between(changes[-1] if changes else -math.inf)
    carried, carried_std = static_mass(last, ride, GRAVITY)
    found = float(track.parameters[-1, 0])
    if abs(carried - found) > max(
        STATIC_PART * found, 4.0 * math.hypot(carried_std, float(track.stds[-1, 0]))
    ):
        # Were it the stiffness, the inertias would be as wrong as the mass.
        std = np.hypot(std, abs(carried / found - 1.0))
        note = Problem.of("ride.rest_and_motion", carried=carried, found=found)
        doubts.append((note, phrase("interval_holds_both")))
    status, refusal = _status(vehicle, track, check, trouble, [doubt for doubt, _ in doubts], std)
    weighed = status is Status.CONVERGED
    problems += _limits(samples, ride, track, check, weighed)
    problems += tuple(
        replace(p, text=f"{p.text}; {effect}") if weighed else p for p, effect in doubts
    )
    problems += _tilt_notes(last, ride)
    result = Inertia(
        drive=drive,
        vehicle=vehicle,
        method=track.method,
        status=status,
        refusal=refusal,
        track=track,
        suspension=check,
        model_std=std,
        segments=_segments(track, changes, std),
        problems=problems,
    )
    unknown = [
        AXES[k] for k in (1, 2) if status is Status.CONVERGED and math.isnan(result.values[k])
    ]
    if unknown:
        note = Problem.of("ride.axis_unknown", axes=" and the ".join(unknown))
        return _with_problem(result, note)
    if vehicle.gross is not None and result.mass > vehicle.gross:
        sure = "surely" if result.mass - 2.0 * result.std > vehicle.gross else "perhaps"
        return _with_problem(
            result, Problem.of("mass.above_permitted", sure=sure, gross=vehicle.gross)
        )
    return result


def _trouble(track: InertiaTrack, changes: tuple[float, ...]) -> Problem | None:
    """Say what no vehicle does, in the hypotheses that the filter came to believe."""
    pushed = float(np.mean(track.pushed.any(axis=1)))
    note = ""
    if len(changes) > max(3.0, 0.1 * float(track.time[-1] - track.time[0])):
        note = phrase("load_flickers", count=len(changes))
    elif pushed > MOSTLY_CALM:
        note = phrase("pushed_often", share=100.0 * pushed)
    return Problem.of("ride.trouble", note=note) if note else None


def _check(
    samples: RideSamples,
    ride: Ride,
    track: InertiaTrack,
    changes: tuple[float, ...],
    average: Floats,
    troubled: bool,
) -> SuspensionCheck | None:
    """Fit springs and dampers to the last load, or to the longest where that is too short."""
    if troubled:
        # Loads that come and go are no loads, and nobody brakes and turns all the time: then
        # only the whole ride can show which part is off.
        return check_suspension(samples, ride, average)
    edges = np.searchsorted(samples.time, (-np.inf, *changes, np.inf))
    longest = int(np.argmax(np.diff(edges)))
    pushed = np.asarray(track.pushed.any(axis=1))
    for k in (len(changes), longest):
        a, b = int(edges[k]), int(edges[k + 1])
        part = samples.between(samples.time[a], math.inf if k == len(changes) else changes[k])
        # A push that was taken for a jump of an inertia is one all the same.
        otherwise = believed_otherwise(track, a, b)
        check = check_suspension(
            part, ride, np.asarray(track.alpha[b - 1]), pushed[a:b] | otherwise
        )
        if check is not None:
            return check
    return None


def _limits(
    samples: RideSamples,
    ride: Ride,
    track: InertiaTrack,
    check: SuspensionCheck | None,
    weighed: bool,
) -> tuple[Problem, ...]:
    """Say what limits the result: the vehicle file, noise, the logger, a short ride."""
    note: list[Problem] = []
    if ride.force_std is None and weighed:
        note.append(Problem.of("ride.force_std_unknown", share=100.0 * UNKNOWN_FORCE_STD))
    if track.noise_factor > 1.0:
        note.append(
            Problem.of(
                "ride.noise",
                factor=track.noise_factor,
                widened=phrase("and_widened") if weighed else "",
            )
        )
    if samples.period > HOPPING:
        note.append(Problem.of("ride.hops", rate=1.0 / samples.period))
    if check is None:
        note.append(Problem.of("ride.unchecked", needed=SHORTEST))
    return tuple(note)


def _tilt_notes(samples: RideSamples, ride: Ride) -> tuple[Problem, ...]:
    """Return where front and rear springs contradict each other about how the body leans."""
    front, rear, std = body_tilt(samples, ride)
    if abs(front - rear) > max(TILT, TILT_PART * max(abs(front), abs(rear)), 4.0 * std):
        return (Problem.of("ride.tilt", front=1000.0 * front, rear=1000.0 * rear),)
    return ()


def _with_problem(result: Inertia, problem: Problem) -> Inertia:
    return replace(result, problems=(*result.problems, problem))


def _parts(check: SuspensionCheck) -> str:
    """Name the parts that act otherwise than the vehicle file says."""
    order = np.argsort(-check.off, kind="stable")[:4]
    named = [f"{PARTS[k]} {check.factor[k]:.2f}" for k in order if check.off[k] > 0.0]
    return ", ".join(named)


def _status(
    vehicle: Vehicle,
    track: InertiaTrack,
    check: SuspensionCheck | None,
    trouble: Problem | None,
    doubts: list[Problem],
    std: Floats,
) -> tuple[Status, Problem | None]:
    """Say whether the ride carries a mass, and why not."""
    mass, by_filter = float(track.parameters[-1, 0]), float(track.alpha_std[-1, 0])
    by_filter /= float(track.alpha[-1, 0])
    if check is not None and float(np.max(check.off)) > WRONG_PART:
        k = int(np.argmax(check.off))
        return Status.INCONSISTENT, Problem.of(
            "ride.part_wrong", part=PARTS[k], factor=check.factor[k]
        )
    if check is not None and float(np.max(check.misfit)) > WRONG_SHARE:
        k = int(np.argmax(check.misfit))
        return Status.INCONSISTENT, Problem.of(
            "ride.misfit",
            share=100.0 * check.misfit[k],
            axis=("heave", "roll", "pitch")[k],
            parts=_parts(check),
        )
    if trouble:
        return Status.INCONSISTENT, trouble
    if not by_filter <= TOO_WIDE:
        return Status.NOT_EXCITED, Problem.of("ride.wide", mass=mass, share=100.0 * by_filter)
    if not math.hypot(by_filter, float(std[0])) <= TOO_WIDE:
        return Status.INCONSISTENT, (
            doubts[0]
            if doubts
            else Problem.of("ride.noise_shifts", mass=mass, share=100.0 * float(std[0]))
        )
    low, high = vehicle.of_class.mass_range
    if not low < mass < high:
        return Status.INCONSISTENT, Problem.of(
            "ride.impossible", mass=mass, kind=vehicle.kind, low=low, high=high
        )
    return Status.CONVERGED, None


def _segments(
    track: InertiaTrack, changes: tuple[float, ...], std: Floats
) -> tuple[LoadSegment, ...]:
    edges = [float(track.time[0]), *changes, np.inf]
    found = []
    for start, end in pairwise(edges):
        k = min(int(np.searchsorted(track.time, end)), track.time.size) - 1
        values = track.parameters[k]
        relative = np.hypot(track.alpha_std[k] / track.alpha[k], std)
        known = relative <= TOO_WIDE
        found.append(
            LoadSegment(
                start=start,
                end=float(track.time[k]),
                values=np.where(known, values, np.nan),
                stds=np.where(known, values * relative, np.nan),
            )
        )
    return tuple(found)
