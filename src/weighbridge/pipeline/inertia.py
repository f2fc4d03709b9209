"""From a drive and a vehicle to sprung mass and inertias."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from weighbridge.checks import refuse_serious, settle_drive
from weighbridge.constants import GRAVITY
from weighbridge.errors import ConfigError
from weighbridge.estimators.inertia import (
    AXES,
    METHODS,
    InertiaSettings,
    InertiaTrack,
    Method,
    RideSamples,
    believed_otherwise,
    estimate,
    integration_std,
    inverse_interval,
    jumps,
    load_changes,
)
from weighbridge.estimators.suspension import (
    PARTS,
    SHORTEST,
    SuspensionCheck,
    attenuation,
    check_suspension,
    lean,
    response,
    static_mass,
)
from weighbridge.estimators.track import Status
from weighbridge.pipeline.given import (
    GivenDrive,
    GivenVehicle,
    as_drive,
    as_vehicle,
    home_of,
    mapping_of,
)
from weighbridge.pipeline.results import check_level, number, write_track
from weighbridge.pipeline.ride_checks import (
    LEAST,
    NEEDED,
    SLOWEST,
    check_response,
    check_signals,
    nothing_moves,
    ride_of,
    ride_samples,
)
from weighbridge.signals import Drive, Floats
from weighbridge.vehicle.model import Ride, Vehicle
from weighbridge.visible import visible_json

if TYPE_CHECKING:
    import polars as pl

DEFAULT_METHOD: Final[Method] = "kalman-bucy"

UNKNOWN_FORCE_STD: Final = 0.05
"""Relative standard deviation of what all springs and dampers have in common where the vehicle
file does not say [-]: chosen, for data-sheet values of springs (some 3 %) and dampers
(some 10 %), of which springs carry most of the force."""

TOO_WIDE: Final = 0.15
"""Relative standard deviation above which a parameter is not known [-]."""

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

LEAN: Final = 0.003
"""Angles of the body over its two axles may differ by so much [rad]: 5 mm over a track."""

LEAN_PART: Final = 0.3
"""Or by this part of them: tyres give, and differently at front and rear [-]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadSegment:
    """Parameters between two changes of load.

    Attributes
    ----------
    start, end : [s]
    values, stds : (3,) sprung mass [kg], roll and pitch inertia [kg m^2], at its end
    """

    start: float
    end: float
    values: Floats
    stds: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Inertia:
    """Sprung mass and inertias at the end of a drive, how sure they are, and why.

    Attributes
    ----------
    drive, vehicle : what it was made from
    method : name of the filter
    status : `Status`
    reason : why there is no mass, one sentence; empty where there is
    track : the filter's parameters over time; None where nothing could be estimated
    suspension : each spring and damper against the vehicle file; None where the ride is
        too short to tell
    model_std : (3,) relative standard deviation beside the filter's: of the vehicle
        file, of what does not fit, and of noise [-]
    segments : parameters between changes of load
    warnings : what was mended or doubted, one sentence each
    """

    drive: Drive
    vehicle: Vehicle
    method: Method
    status: Status
    reason: str
    track: InertiaTrack | None
    suspension: SuspensionCheck | None
    model_std: Floats
    segments: tuple[LoadSegment, ...]
    warnings: tuple[str, ...] = ()

    @property
    def ride(self) -> Ride:
        """The vehicle's suspension."""
        assert self.vehicle.ride is not None
        return self.vehicle.ride

    @property
    def values(self) -> Floats:
        """(3,) sprung mass [kg], roll and pitch inertia [kg m^2]; NaN where unknown."""
        if self.track is None or self.status is not Status.CONVERGED:
            return np.full(3, np.nan)
        return np.where(self._relative_std() <= TOO_WIDE, self.track.parameters[-1], np.nan)

    @property
    def stds(self) -> Floats:
        """(3,) their standard deviations; NaN where unknown."""
        return np.asarray(self.values * self._relative_std())

    def _relative_std(self) -> Floats:
        if self.track is None:
            return np.full(3, np.inf)
        by_filter = self.track.alpha_std[-1] / self.track.alpha[-1]
        return np.asarray(np.hypot(by_filter, self.model_std))

    def intervals(self, level: float = 0.95) -> tuple[Floats, Floats]:
        """(3,) bounds that hold the parameters with the probability ``level``.

        Raises
        ------
        ConfigError
            The level is not between 0 and 1.
        """
        check_level(level)
        known = np.isfinite(self.values)
        relative = np.where(known, self._relative_std(), np.nan)
        return inverse_interval(self.values, np.ones(3), relative, level)

    @property
    def mass(self) -> float:
        """Of all that rolls: sprung and unsprung mass [kg]; NaN where unknown."""
        return float(self.values[0]) + self.ride.front_unsprung + self.ride.rear_unsprung

    @property
    def std(self) -> float:
        """Standard deviation of the mass [kg]; NaN where unknown."""
        return float(self.stds[0])

    def mass_interval(self, level: float = 0.95) -> tuple[float, float]:
        """Bounds that hold the mass with the probability ``level`` [kg]; NaN where unknown.

        Raises
        ------
        ConfigError
            The level is not between 0 and 1.
        """
        low, high = self.intervals(level)
        unsprung = self.ride.front_unsprung + self.ride.rear_unsprung
        return float(low[0]) + unsprung, float(high[0]) + unsprung

    @property
    def axle_loads(self) -> tuple[float, float]:
        """What scales under front and rear axle would show on the level [kg]."""
        ride, sprung = self.ride, float(self.values[0])
        base = ride.front_axle + ride.rear_axle
        return (
            sprung * ride.rear_axle / base + ride.front_unsprung,
            sprung * ride.front_axle / base + ride.rear_unsprung,
        )

    @property
    def payload(self) -> float:
        """Mass minus the vehicle's tare [kg]; NaN where either is unknown."""
        return self.mass - self.vehicle.tare if self.vehicle.tare is not None else math.nan

    @property
    def converged_at(self) -> float:
        """Time until all that is known stays within 5 % of the result [s]; NaN if never."""
        if self.track is None or not np.isfinite(self.values).any():
            return math.nan
        off = np.abs(self.track.parameters / self.values - 1.0) > 0.05
        late = np.flatnonzero(off.any(axis=1))
        at = self.track.time[late[-1] + 1] if late.size else self.track.time[0]
        return float(at) - self.drive.start

    def to_dict(self) -> dict[str, Any]:
        """Return what ``inertia --json`` prints: numbers, None where unknown."""
        low, high = self.intervals()
        lightest, heaviest = self.mass_interval()
        front, rear = self.axle_loads
        parts: dict[str, Any] = {}
        for k, name in enumerate(("sprung_mass_kg", "roll_inertia_kgm2", "pitch_inertia_kgm2")):
            stem, unit = name.rsplit("_", 1)
            parts[name] = number(self.values[k])
            parts[f"{stem}_std_{unit}"] = number(self.stds[k])
            parts[f"{stem}_interval95_{unit}"] = [number(low[k]), number(high[k])]
        return {
            "drive": self.drive.name,
            "vehicle": self.vehicle.name,
            "method": self.method,
            "status": str(self.status),
            "reason": self.reason,
            **parts,
            "mass_kg": number(self.mass),
            "std_kg": number(self.std),
            "interval95_kg": [number(lightest), number(heaviest)],
            "axle_load_front_kg": number(front),
            "axle_load_rear_kg": number(rear),
            "payload_kg": number(self.payload),
            "duration_s": number(self.drive.duration),
            "converged_at_s": number(self.converged_at),
            "segments": [
                {
                    "start_s": number(s.start),
                    "end_s": number(s.end),
                    "sprung_mass_kg": number(s.values[0]),
                    "sprung_mass_std_kg": number(s.stds[0]),
                    "roll_inertia_kgm2": number(s.values[1]),
                    "roll_inertia_std_kgm2": number(s.stds[1]),
                    "pitch_inertia_kgm2": number(s.values[2]),
                    "pitch_inertia_std_kgm2": number(s.stds[2]),
                }
                for s in (self.segments if self.status is Status.CONVERGED else ())
            ],
            "warnings": list(self.warnings),
        }

    def to_json(self) -> str:
        """Return `to_dict` as one line of JSON."""
        return visible_json(json.dumps(self.to_dict(), ensure_ascii=False))

    @property
    def table(self) -> pl.DataFrame:
        """Parameters and velocities over time, one row per sample."""
        import polars as pl

        t = self.track
        if t is None:
            return pl.DataFrame(schema=dict.fromkeys(TRACK_COLUMNS, pl.Float64))
        values, stds = t.parameters, np.hypot(t.alpha_std / t.alpha, self.model_std)
        stds = stds * values
        columns = (
            t.time, values[:, 0], stds[:, 0], values[:, 1], stds[:, 1], values[:, 2], stds[:, 2],
            *t.velocity.T, *(t.innovation**2 / t.innovation_var).T,
        )  # fmt: skip
        return pl.DataFrame(dict(zip(TRACK_COLUMNS, columns, strict=True)), nan_to_null=True)

    def write_track(self, path: str | Path) -> None:
        """Write `table` as CSV or Parquet, by the suffix of ``path``.

        Raises
        ------
        ConfigError
            The suffix is neither.
        """
        write_track(self.table, path)

    def report(self, path: str | Path) -> None:
        """Write a self-contained HTML report that opens offline."""
        from weighbridge.report.inertia_panels import write_inertia

        write_inertia(self, Path(path))


TRACK_COLUMNS: Final = (
    "time_s", "sprung_mass_kg", "sprung_mass_std_kg", "roll_inertia_kgm2",
    "roll_inertia_std_kgm2", "pitch_inertia_kgm2", "pitch_inertia_std_kgm2",
    "vertical_velocity_mps", "roll_rate_radps", "pitch_rate_radps",
    "nis_vertical", "nis_roll", "nis_pitch",
)  # fmt: skip
"""Columns of the track, as files carry them; nis is the squared innovation over its variance."""


def estimate_inertia(
    drive: GivenDrive,
    vehicle: GivenVehicle,
    method: str = DEFAULT_METHOD,
    *,
    settings: InertiaSettings | None = None,
) -> Inertia:
    """Estimate sprung mass, roll inertia and pitch inertia from the ride of a drive.

    Parameters
    ----------
    drive : with suspension travel and rate at four wheels, vertical velocity, roll rate
        and pitch rate; or the path or data frame that it is to be read from
    vehicle : with its suspension, ``[ride]`` of the vehicle file; or the path of that file
    method : name of the filter
    settings : of the filter

    Returns
    -------
    Inertia
        At the end of the drive; a drive that carries none has a status and a reason.

    Raises
    ------
    ConfigError
        The method is not known, or the vehicle file has no suspension.
    DriveError
        What the drive says cannot be so, such as a wrong unit or sign.
    """
    chosen: Method | None = next((m for m in METHODS if m == method), None)
    if chosen is None:
        raise ConfigError(f"unknown method {method!r}; known are {', '.join(METHODS)}")
    home, vehicle = home_of(vehicle), as_vehicle(vehicle)
    return _estimate(as_drive(drive, mapping_of(vehicle, home)), vehicle, chosen, settings)


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
    settled = settle_drive(only)
    problems = [*settled.problems, *check_signals(only)]
    refuse_serious(drive.name, problems)
    samples = ride_samples(settled)
    seen = response(samples, ride)
    problems += check_response(seen) if seen is not None else ()
    refuse_serious(drive.name, problems)
    warnings = tuple(dict.fromkeys(p.text for p in problems))
    if not samples.period <= SLOWEST:
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
    std = np.hypot(np.hypot(common, noisy), integration_std(samples.period))
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
        told = (
            f"at rest the springs carry {carried:.0f} kg, in motion the sprung mass is "
            f"{found:.0f} kg: a travel sensor is offset, zero_mass_kg is not the mass with which "
            "they read zero, or the stiffness is wrong"
        )
        doubts.append((told, "the interval holds both"))
    status, reason = _status(vehicle, track, check, trouble, [text for text, _ in doubts], std)
    weighed = status is Status.CONVERGED
    warnings += _limits(samples, ride, track, check, weighed)
    warnings += tuple(f"{text}; {effect}" if weighed else text for text, effect in doubts)
    warnings += _leaning(last, ride)
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
        told = f"the ride says too little about the {' and the '.join(unknown)}"
        return _with_warning(result, told)
    if vehicle.gross is not None and result.mass > vehicle.gross:
        sure = "surely" if result.mass - 2.0 * result.std > vehicle.gross else "perhaps"
        return _with_warning(result, f"{sure} above the permitted mass of {vehicle.gross:.0f} kg")
    return result


def _trouble(track: InertiaTrack, changes: tuple[float, ...]) -> str:
    """Say what no vehicle does, in the hypotheses that the filter came to believe."""
    pushed = float(np.mean(track.pushed.any(axis=1)))
    told = ""
    if len(changes) > max(3.0, 0.1 * float(track.time[-1] - track.time[0])):
        told = f"the load seems to change {len(changes)} times"
    elif pushed > MOSTLY_CALM:
        told = f"the vehicle seems to brake or turn {100.0 * pushed:.0f} % of the time"
    return told and f"{told}: springs, dampers or sensors are not those of the vehicle file"


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
    told = []
    if ride.force_std is None and weighed:
        told.append(
            "the vehicle file does not say how sure its springs and dampers are (force_std): "
            f"{100.0 * UNKNOWN_FORCE_STD:.0f} % is in the interval"
        )
    if track.noise_factor > 1.0:
        told.append(
            f"the ride fits as if the suspension signals had {track.noise_factor:.2g} times the "
            "noise of the vehicle file: the sensors are noisier, or springs and dampers are not "
            f"the file's{'; the interval is widened' if weighed else ''}"
        )
    if samples.period > HOPPING:
        told.append(
            f"sampled at {1.0 / samples.period:.0f} Hz, axles that hop are hardly seen; "
            "200 Hz or more is better"
        )
    if check is None:
        told.append(
            f"springs and dampers could not be checked one by one, which takes {SHORTEST:.0f} s "
            "of one load: a broken one would not be told"
        )
    return tuple(told)


def _leaning(samples: RideSamples, ride: Ride) -> tuple[str, ...]:
    """Tell where front and rear springs contradict each other about how the body leans."""
    front, rear, std = lean(samples, ride)
    if abs(front - rear) > max(LEAN, LEAN_PART * max(abs(front), abs(rear)), 4.0 * std):
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
