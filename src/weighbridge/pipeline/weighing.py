"""From a drive and a vehicle to a mass."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from weighbridge.arguments import check_flag, check_path, check_text, check_type, suggestion
from weighbridge.balance import ForceBalance
from weighbridge.balance.speed_balance import speed_balance
from weighbridge.errors import ConfigError, DriveError, WeighbridgeError
from weighbridge.estimators import ESTIMATORS, MassTrack, Status, differences
from weighbridge.messages import Problem
from weighbridge.navigation import BY_SPEED, without_accelerometer
from weighbridge.pipeline.given import (
    GivenDrive,
    GivenVehicle,
    as_drive,
    as_vehicle,
    home_of,
    mapping_of,
)
from weighbridge.pipeline.hypotheses import Case, refused_by_balance, weighed_against
from weighbridge.pipeline.notes import (
    below_tare,
    beside_speed,
    beyond_class,
    fitted_for_another,
    lighter_than_known,
    no_speed,
    overload,
    towing,
    unbacked,
    uncalibrated,
    what_is_missing,
)
from weighbridge.pipeline.setup import identify
from weighbridge.results.weighing import MassResult
from weighbridge.signals import Drive
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.as_read import as_read

if TYPE_CHECKING:
    from weighbridge.io.mapping import MappingSource

_LOG = logging.getLogger(__name__)

DEFAULT_METHOD = "joint"
"""Estimator used unless one is named."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Weighing(MassResult):
    """The mass of one drive, its uncertainty and reason; writes its report and compares methods."""

    def compare(self) -> tuple[Weighing, ...]:
        """Weigh the same drive by every method, this one included, see `compare`."""
        return compare(self)

    def report(self, path: str | Path, *, compare: bool = False, tiles: str | None = None) -> None:
        """Write a self-contained HTML report that opens offline.

        Parameters
        ----------
        path : file to write
        compare : weigh by every other method too, and show them side by side
        tiles : address of map tiles to draw maps over, see `weighbridge.report.write_report`
        """
        from weighbridge.report import write_report

        check_path("path", path)
        check_flag("compare", compare)
        compared = [self.compare()] if compare else None
        write_report([self], path, comparisons=compared, tiles=tiles)

    def plot(self, *, truth: float | None = None) -> Any:
        """Return a plotly figure of the mass over time, with title and legend.

        Parameters
        ----------
        truth : true mass at the end of the drive [kg], to draw beside it; that of ``drive.toml``,
            less the fuel burnt, when None

        Raises
        ------
        ConfigError
            Nothing was estimated, so there is no mass to draw.
        """
        from weighbridge.report import mass_figure

        return mass_figure(self, truth=truth)


def weigh(
    drive: GivenDrive,
    vehicle: GivenVehicle,
    method: str = DEFAULT_METHOD,
    *,
    settings: Mapping[str, object] | None = None,
    mapping: MappingSource | None = None,
) -> Weighing:
    """Weigh a vehicle from one drive.

    Parameters
    ----------
    drive : as of `read_drive`, or the path or data frames that it is to be read from
    vehicle : as of `calibrate` or `Vehicle.load`, or the path of a vehicle file
    method : name of an estimator in `weighbridge.estimators.ESTIMATORS`
    settings : values of its settings that differ from their defaults, by name, such as
        ``{"forgetting": 0.999}``; the settings class of the estimator lists them
    mapping : for a path or data frames with names of their own: mapping TOML, or a dictionary of
        the same form; the one that the vehicle file names when None

    Returns
    -------
    Weighing
        Without a mass, but with a reason, if the data do not allow one.

    Raises
    ------
    ConfigError
        The method is not known, or has no such setting.
    DriveError
        The data of the drive cannot be right, for example because of a wrong unit.
    """
    _refuse_unknown(method)
    if settings is not None:
        check_type("settings", settings, Mapping, "a dictionary of values by name")
    chosen = ESTIMATORS[method].settings_of(settings) if settings else None

    from weighbridge.checks import correct_drive, refuse_serious

    home, vehicle = home_of(vehicle), as_vehicle(vehicle)
    drive = correct_drive(as_drive(drive, mapping_of(vehicle, home), mapping), vehicle)
    refuse_serious(drive.name, drive.problems)
    found = weigh_checked(drive, vehicle, method, chosen)
    kg = (found.mass, found.std)
    _LOG.info("%s: %.0f kg, std %.1f kg, %s by %s", drive.name, *kg, found.status, method)
    return found


def _refuse_unknown(method: str) -> None:
    check_text("method", method)
    if method not in ESTIMATORS:
        raise ConfigError(f"unknown method {method!r}{suggestion(method, ESTIMATORS)}")


def weigh_checked(drive: Drive, vehicle: Vehicle, method: str, settings: Any = None) -> Weighing:
    """Weigh as `weigh` does, from a drive that was checked and a known method.

    Where a slow or noisy inertial sensor leaves the mass unsure, ``joint`` weighs the drive without
    it as well. Their errors are only partly the same, so the mean counts, by their uncertainty.

    Parameters
    ----------
    drive, vehicle, method : as of `weigh`
    settings : of the estimator; its defaults when None
    """
    found = _weigh_all(drive, vehicle, method, settings)
    with_it = found.result
    if method != DEFAULT_METHOD or fitted_for_another(vehicle, method):
        return found
    if with_it is None or not _unsure(found):
        return found
    if with_it.balance.motion.source in BY_SPEED:
        return found
    try:
        left = _weigh_all(without_accelerometer(drive), vehicle, method, settings)
    except DriveError:
        return found
    without = left.result
    if without is None or left.status is not Status.CONVERGED:
        return found
    if found.status is Status.CONVERGED:
        alike = 1.0 if vehicle.without_accelerometer is None else ALIKE
        joined = with_it.joined(without, alike)
        if joined is with_it:
            return found
        if joined is not without:
            noted = [p for p in found.problems if p not in _of_mass(found.seen, with_it)]
            twice = Problem.of("imu.weighed_twice", mass=left.mass, half=1.96 * left.std)
            problems = (*noted, twice, *_of_mass(found.seen, joined))
            return replace(found, result=joined, problems=problems)
    why = Problem.of("imu.left_out", mass=with_it.mass, half=1.96 * with_it.std)
    noted = [*found.problems, *([found.refusal] if found.refusal else [])]
    of_sensor = (p for p in noted if p.id.startswith("imu.") and p not in left.problems)
    return replace(left, problems=(why, *of_sensor, *left.problems))


NOISY: Final = ("motion.wide", "imu.noise", "gear.drift")
"""Reasons for no mass that an inertial sensor may be to blame for: its noise, or that it is at its
limit in bends, so that the motion drifts off the gears."""

UNSURE_STD: Final = 0.025
"""Standard deviation of a mass, beside what else may explain the drive, from which one without the
inertial sensor is asked for too [-]: that is 3 to 5 %, and has no weight beside a surer one."""

ALIKE: Final = 0.7
"""Correlation of the errors of the two masses [-]: of 330 drives it was 0.0 to 0.8 by kind of
vehicle and equipment. A high one moves a sure mass little. A file that was not calibrated without
the sensor has the same errors in both: the surer one counts."""


def _unsure(found: Weighing) -> bool:
    """Whether a mass is lacking or wide, perhaps by the inertial sensor."""
    result = found.result
    if result is None or not math.isfinite(result.mass):
        return False
    if found.status is Status.CONVERGED:
        return result.own_std > UNSURE_STD * result.mass
    return found.reason_id in NOISY


def _weigh_all(drive: Drive, vehicle: Vehicle, method: str, settings: Any) -> Weighing:
    """Weigh by all signals of a drive."""
    problems = drive.problems
    alone = ESTIMATORS[method].speed_alone
    seen = without_accelerometer(drive) if ESTIMATORS[method].by_speed else drive
    given = vehicle
    if not alone:
        vehicle = as_read(vehicle)
    lacking = no_speed(drive) if alone else what_is_missing(drive, vehicle)
    if lacking:
        return without_mass(drive, given, method, lacking, problems)
    own = ESTIMATORS[method].own_balance
    balance = own(drive, vehicle, settings) if own and settings is not None else None
    if balance is not None:
        problems += vehicle.provenance.problems + unbacked(vehicle)
    elif alone:
        balance = speed_balance(drive, vehicle)
        problems += balance.motion.notes + beside_speed(drive)
    else:
        setup = identify(seen, vehicle)
        vehicle, balance = setup.vehicle, setup.balance
        problems += setup.notes + vehicle.provenance.problems
        problems += fitted_for_another(vehicle, method) + unbacked(vehicle)
    found = weigh_balance(drive, vehicle, method, balance, problems, settings=settings)
    return replace(found, vehicle=given)


def weigh_balance(
    drive: Drive,
    vehicle: Vehicle,
    method: str,
    balance: ForceBalance,
    problems: tuple[Problem, ...] = (),
    joined: MassTrack | None = None,
    settings: Any = None,
) -> Weighing:
    """Weigh from forces and motion that are found already.

    Parameters
    ----------
    drive, method : as of `weigh`
    vehicle : as the drive shows it
    balance : forces and motion
    problems : what is known of the drive
    joined : what ``joint`` makes of the balance, which judges the other methods; None to find it
    settings : of the estimator; its defaults when None
    """
    estimator = ESTIMATORS[method]
    result = estimator.track(balance, vehicle, settings)
    if settings is not None and (own := differences(settings)):
        problems += (Problem.of("method.settings", method=method, own=own),)
    if not estimator.speed_alone:
        problems += uncalibrated(vehicle, result)
    status, reason = result.status, result.reason
    case = Case(
        drive=drive, vehicle=vehicle, balance=balance, track=result, problems=problems,
        joined=result if result.filter_input is not None else joined,
    )  # fmt: skip
    if not estimator.speed_alone and (why := refused_by_balance(case)):
        status, reason = Status.INCONSISTENT, why
    elif status is Status.CONVERGED and not estimator.speed_alone:
        result, why, doubts = weighed_against(case)
        problems += doubts
        if why is not None:
            status, reason = Status.INCONSISTENT, why
    if status is Status.CONVERGED:
        problems += towing(drive, result)
    return Weighing(
        drive=drive,
        vehicle=vehicle,
        seen=vehicle,
        method=method,
        status=status,
        refusal=reason,
        result=result,
        problems=(*problems, *_of_mass(vehicle, result)),
        settings=settings,
    )


def _of_mass(vehicle: Vehicle, result: MassTrack) -> tuple[Problem, ...]:
    """Say what is unlikely of a mass."""
    return (
        *overload(vehicle, result),
        *beyond_class(vehicle, result),
        *below_tare(vehicle, result),
        *lighter_than_known(vehicle, result),
    )


def without_mass(
    drive: Drive, vehicle: Vehicle, method: str, reason: Problem, problems: tuple[Problem, ...] = ()
) -> Weighing:
    """Say why a method could not be tried."""
    return Weighing(
        drive=drive,
        vehicle=vehicle,
        seen=vehicle,
        method=method,
        status=Status.MISSING_SIGNALS,
        refusal=reason,
        result=None,
        problems=problems,
    )


def compare(weighing: Weighing, methods: Sequence[str] | None = None) -> tuple[Weighing, ...]:
    """Weigh a drive with other methods, after it was weighed with one.

    The drive is not checked again, and forces and motion, which cost most, are
    taken over.

    Parameters
    ----------
    weighing : of the drive, by any method
    methods : to weigh with; when None those of `weighbridge.estimators.ESTIMATORS` that are
        ``compared``, in their order, and that of ``weighing``

    Returns
    -------
    One by each method; one that could not be tried says why

    Raises
    ------
    ConfigError
        A method is not known.
    """
    check_type("weighing", weighing, Weighing, "what weigh returns")
    found: dict[str, Weighing] = {weighing.method: weighing}
    if methods is None:
        methods = [m for m, e in ESTIMATORS.items() if e.compared or m == weighing.method]
    check_type("methods", methods, Sequence, "a list of names")
    for method in methods:
        _refuse_unknown(method)
    for method in methods:
        if method not in found:
            joint = found.get(DEFAULT_METHOD)
            found[method] = _by(weighing, method, joint.result if joint is not None else None)
    return tuple(found[method] for method in methods)


def _by(weighing: Weighing, method: str, joined: MassTrack | None) -> Weighing:
    """Weigh by another method."""
    drive, vehicle, done = weighing.drive, weighing.vehicle, weighing.result
    try:
        if done is None or _another_balance(weighing, method):
            return weigh_checked(drive, vehicle, method)
        seen = weighing.seen
        notes = fitted_for_another(seen, method)
        found = weigh_balance(drive, seen, method, done.balance, notes, joined)
        return replace(found, vehicle=vehicle)
    except WeighbridgeError as error:
        return without_mass(drive, vehicle, method, Problem.from_error(error))


def _another_balance(weighing: Weighing, method: str) -> bool:
    """Whether a method needs another balance than that of a weighing."""
    made, other = weighing.estimator, ESTIMATORS[method]
    if made.own_balance and weighing.settings is not None:
        return True
    if made.speed_alone or other.speed_alone:
        return True
    if made.by_speed == other.by_speed:
        return False
    drive = weighing.drive
    return len(without_accelerometer(drive).signals) < len(drive.signals)
