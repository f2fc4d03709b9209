"""From a drive and a vehicle to sprung mass and inertias."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np

from weighbridge.arguments import check_path, check_text, check_type
from weighbridge.checks import mend_drive, refuse_serious
from weighbridge.constants import GRAVITY
from weighbridge.errors import ConfigError
from weighbridge.estimators.settings import changed, differences
from weighbridge.estimators.track import Status
from weighbridge.inertia.filter import (
    AXES,
    METHODS,
    InertiaTrack,
    Method,
    RideSamples,
    estimate,
)
from weighbridge.inertia.integration import integration_std
from weighbridge.inertia.load_changes import believed_otherwise, jumps, load_changes
from weighbridge.inertia.ride_checks import (
    LEAST,
    LONGEST_PERIOD,
    NEEDED,
    check_response,
    check_signals,
    nothing_moves,
    ride_of,
    ride_samples,
)
from weighbridge.inertia.settings import UNKNOWN_FORCE_STD, InertiaSettings
from weighbridge.inertia.suspension import (
    PARTS,
    SHORTEST,
    SuspensionCheck,
    attenuation,
    body_tilt,
    check_suspension,
    response,
    static_mass,
)
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
from weighbridge.vehicle.model import Ride, Vehicle

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
"""A ride sampled more slowly is told that faster is better [s]: at 100 Hz the axles' hop is
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
        raise ConfigError(f"unknown method {method!r}; known are {', '.join(METHODS)}")
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

    def nothing(status: Status, reason: str, warnings: tuple[str, ...] = ()) -> Inertia:
        return Inertia(
            drive=drive, vehicle=vehicle, method=chosen, status=status, reason=reason, track=None,
            suspension=None, model_std=np.zeros(3), segments=(), warnings=warnings,
        )  # fmt: skip

    if lacking := drive.missing(NEEDED):
        listed = ", ".join(lacking)
        return nothing(
            Status.MISSING_SIGNALS, f"the drive has no {listed}, which a ride is made of"
        )
    only = ride_of(drive)
    if nothing_moves(only):
        return nothing(
            Status.NOT_EXCITED,
            "every signal of the ride repeats one value: the vehicle stood, or nothing was "
            "measured; drive at 20 km/h or more while recording",
        )
    mended = mend_drive(only)
    problems = [*mended.problems, *check_signals(only)]
    refuse_serious(drive.name, problems)
    samples = ride_samples(mended)
    seen = response(samples, ride)
    problems += check_response(seen) if seen is not None else ()
    refuse_serious(drive.name, problems)
    warnings = tuple(dict.fromkeys(p.text for p in problems))
    if settings is not None and (own := differences(settings)):
        warnings += (f"{chosen} was run with {own}, not with its defaults",)
    if not samples.period <= LONGEST_PERIOD:
        return nothing(
            Status.NOT_EXCITED,
            f"the ride is sampled {1.0 / samples.period:.3g} times per second, and axles hop 10 to "
            "15 times: record it at 100 Hz or more",
            warnings,
        )
    if samples.duration < LEAST or seen is None:
        return nothing(
            Status.NOT_EXCITED,
            f"the ride lasts {samples.duration:.3g} s, and without {LEAST:.0f} s in one piece the "
            f"signs and units of its signals cannot be checked: record {SHORTEST:.0f} s or more",
            warnings,
        )
    track = estimate(samples, ride, chosen, settings)
    if not np.ptp(track.alpha, axis=0).any():
        return nothing(
            Status.NOT_EXCITED,
            f"the filter {chosen} never moves: the covariance of velocities and parameters that it "
            "starts with, zero, stays zero, and the vehicle file's parameters come back; use "
            f"{DEFAULT_METHOD}",
            warnings,
        )
    return _judged(drive, vehicle, ride, samples, track, seen.slope, warnings)


def _judged(
    drive: Drive,
    vehicle: Vehicle,
    ride: Ride,
    samples: RideSamples,
    track: InertiaTrack,
    average: Floats,
    warnings: tuple[str, ...],
) -> Inertia:
    """Say what the estimate is worth; ``average`` is that of alpha over the whole ride."""
    believed = jumps(track)
    trouble = _trouble(track, believed)
    changes = load_changes(track, believed)
    check = _check(samples, ride, track, changes, average, bool(trouble))
    if check is None and not trouble and track.noise_factor > 1.0:
        trouble = (
            f"the ride fits as if the suspension signals had {track.noise_factor:.2g} times the "
            "noise of the vehicle file, and is too short to tell noise from wrong springs and "
            f"dampers: record more than {SHORTEST:.0f} s of one load"
        )
    common = UNKNOWN_FORCE_STD if ride.force_std is None else ride.force_std
    noisy = attenuation(samples, ride, track.noise_factor, np.asarray(track.alpha[-1]))
    std = np.hypot(np.hypot(common, noisy), integration_std(samples, ride))
    # Each with what it does to the interval, which is said where there is one.
    doubts: list[tuple[str, str]] = []
    if check is not None and check.off.any():
        std = np.hypot(std, float(np.max(np.abs(check.factor - 1.0))))
        doubts.append((_told(check), "the interval is widened"))
    last = samples.between(changes[-1] if changes else -math.inf)
    carried, carried_std = static_mass(last, ride, GRAVITY)
    found = float(track.parameters[-1, 0])
    if abs(carried - found) > max(
        STATIC_PART * found, 4.0 * math.hypot(carried_std, float(track.stds[-1, 0]))
    ):
        # Were it the stiffness, the inertias would be as wrong as the mass.
        std = np.hypot(std, abs(carried / found - 1.0))
        note = (
            f"at rest the springs carry {carried:.0f} kg, in motion the sprung mass is "
            f"{found:.0f} kg: a travel sensor is offset, zero_mass_kg is not the mass with which "
            "they read zero, or the stiffness is wrong"
        )
        doubts.append((note, "the interval holds both"))
    status, reason = _status(vehicle, track, check, trouble, [text for text, _ in doubts], std)
    weighed = status is Status.CONVERGED
    warnings += _limits(samples, ride, track, check, weighed)
    warnings += tuple(f"{text}; {effect}" if weighed else text for text, effect in doubts)
    warnings += _tilt_notes(last, ride)
    result = Inertia(
        drive=drive,
        vehicle=vehicle,
        method=track.method,
        status=status,
        reason=reason,
        track=track,
        suspension=check,
        model_std=std,
        segments=_segments(track, changes, std),
        warnings=warnings,
    )
    unknown = [
        AXES[k] for k in (1, 2) if status is Status.CONVERGED and math.isnan(result.values[k])
    ]
    if unknown:
        note = f"the ride says too little about the {' and the '.join(unknown)}"
        return _with_warning(result, note)
    if vehicle.gross is not None and result.mass > vehicle.gross:
        sure = "surely" if result.mass - 2.0 * result.std > vehicle.gross else "perhaps"
        return _with_warning(result, f"{sure} above the permitted mass of {vehicle.gross:.0f} kg")
    return result


def _trouble(track: InertiaTrack, changes: tuple[float, ...]) -> str:
    """Say what no vehicle does, in the hypotheses that the filter came to believe."""
    pushed = float(np.mean(track.pushed.any(axis=1)))
    note = ""
    if len(changes) > max(3.0, 0.1 * float(track.time[-1] - track.time[0])):
        note = f"the load seems to change {len(changes)} times"
    elif pushed > MOSTLY_CALM:
        note = f"the vehicle seems to brake or turn {100.0 * pushed:.0f} % of the time"
    return note and f"{note}: springs, dampers or sensors are not those of the vehicle file"


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
        # only the whole ride can tell which part is off.
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
) -> tuple[str, ...]:
    """Say what limits the result: the vehicle file, noise, the logger, a short ride."""
    note = []
    if ride.force_std is None and weighed:
        note.append(
            "the vehicle file does not say how sure its springs and dampers are (force_std): "
            f"{100.0 * UNKNOWN_FORCE_STD:.0f} % is in the interval"
        )
    if track.noise_factor > 1.0:
        note.append(
            f"the ride fits as if the suspension signals had {track.noise_factor:.2g} times the "
            "noise of the vehicle file: the sensors are noisier, or springs and dampers are not "
            f"the file's{'; the interval is widened' if weighed else ''}"
        )
    if samples.period > HOPPING:
        note.append(
            f"sampled at {1.0 / samples.period:.0f} Hz, axles that hop are hardly seen; "
            "200 Hz or more is better"
        )
    if check is None:
        note.append(
            f"springs and dampers could not be checked one by one, which takes {SHORTEST:.0f} s "
            "of one load: a broken one would not be told"
        )
    return tuple(note)


def _tilt_notes(samples: RideSamples, ride: Ride) -> tuple[str, ...]:
    """Tell where front and rear springs contradict each other about how the body leans."""
    front, rear, std = body_tilt(samples, ride)
    if abs(front - rear) > max(TILT, TILT_PART * max(abs(front), abs(rear)), 4.0 * std):
        return (
            f"on average the body leans by {1e3 * front:.0f} mrad to the right over the front axle "
            f"and by {1e3 * rear:.0f} mrad over the rear axle: a travel sensor is offset; the "
            "parameters do not suffer from it",
        )
    return ()


def _with_warning(result: Inertia, text: str) -> Inertia:
    return replace(result, warnings=(*result.warnings, text))


def _told(check: SuspensionCheck) -> str:
    """Name the parts that act otherwise than the vehicle file says."""
    order = np.argsort(-check.off, kind="stable")[:4]
    named = [f"{PARTS[k]} {check.factor[k]:.2f}" for k in order if check.off[k] > 0.0]
    return (
        f"against the others these act otherwise than the vehicle file says: {', '.join(named)} "
        "times its value; check springs, dampers and their sensors"
    )


def _status(
    vehicle: Vehicle,
    track: InertiaTrack,
    check: SuspensionCheck | None,
    trouble: str,
    doubts: list[str],
    std: Floats,
) -> tuple[Status, str]:
    """Say whether the ride carries a mass, and why not."""
    mass, by_filter = float(track.parameters[-1, 0]), float(track.alpha_std[-1, 0])
    by_filter /= float(track.alpha[-1, 0])
    if check is not None and float(np.max(check.off)) > WRONG_PART:
        k = int(np.argmax(check.off))
        return Status.INCONSISTENT, (
            f"the {PARTS[k]} acts {check.factor[k]:.2f} times as the vehicle file says: it is "
            "locked, broken or another one, or its sensor is wrong"
        )
    if check is not None and float(np.max(check.misfit)) > WRONG_SHARE:
        k = int(np.argmax(check.misfit))
        return Status.INCONSISTENT, (
            "springs and dampers of the vehicle file do not fit the ride: others explain "
            f"{100.0 * check.misfit[k]:.0f} % more of the {('heave', 'roll', 'pitch')[k]}; "
            f"{_told(check)}"
        )
    if trouble:
        return Status.INCONSISTENT, trouble
    if not by_filter <= TOO_WIDE:
        return Status.NOT_EXCITED, (
            f"the ride says {mass:.0f} kg give or take {100.0 * by_filter:.0f} %, which is no "
            "weighing; a longer or rougher road, or quieter sensors, would help"
        )
    if not math.hypot(by_filter, float(std[0])) <= TOO_WIDE:
        return Status.INCONSISTENT, (
            doubts[0]
            if doubts
            else f"the sprung mass seems to be {mass:.0f} kg, but noise of the suspension signals "
            f"may shift it by {100.0 * float(std[0]):.0f} %: a rougher road or quieter sensors "
            "would help"
        )
    low, high = vehicle.of_class.mass_range
    if not low < mass < high:
        return Status.INCONSISTENT, (
            f"the sprung mass is {mass:.0f} kg, and a {vehicle.kind} has between {low:.0f} and "
            f"{high:.0f} kg; check the class and the [ride] section of the vehicle file"
        )
    return Status.CONVERGED, ""


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
