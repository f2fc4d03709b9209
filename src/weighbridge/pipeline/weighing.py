"""From a drive and a vehicle to a mass."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from weighbridge.arguments import check_flag, check_path, check_text, check_type
from weighbridge.balance import ForceBalance, force_balance
from weighbridge.balance.bandwidth import smoothed_torque
from weighbridge.balance.circumference import on_its_tyres
from weighbridge.balance.delay import clock_shift, estimate_torque_delay, far_shift
from weighbridge.balance.gear_fit import ENOUGH, foreign_part, share_on_gears
from weighbridge.balance.gear_scale import scale_contradiction
from weighbridge.balance.speed_balance import SPEEDS, speed_balance
from weighbridge.balance.torque_drift import steadied
from weighbridge.errors import ConfigError, DriveError, WeighbridgeError
from weighbridge.estimators import ESTIMATORS, MassTrack, Status, joint
from weighbridge.estimators.joint.changing import largest
from weighbridge.estimators.joint.contradicted import contradicted
from weighbridge.estimators.joint.foreign import of_another
from weighbridge.estimators.judging import lacks_accelerometer
from weighbridge.estimators.settings import differences
from weighbridge.estimators.squat import of_vehicle
from weighbridge.navigation.motion import Motion
from weighbridge.navigation.select import identify_motion, without_accelerometer
from weighbridge.pipeline.given import (
    GivenDrive,
    GivenVehicle,
    as_drive,
    as_vehicle,
    home_of,
    mapping_of,
)
from weighbridge.results.weighing import MassResult
from weighbridge.signals import Drive
from weighbridge.vehicle.as_read import as_read
from weighbridge.vehicle.data_sheet import wheel_efficiency
from weighbridge.vehicle.model import Vehicle
from weighbridge.vehicle.power_balance import by_power
from weighbridge.vehicle.torque import source_of
from weighbridge.vehicle.torque_sources import TORQUE_SOURCES

if TYPE_CHECKING:
    from weighbridge.io.mapping import MappingSource

DEFAULT_METHOD = "joint"
"""Estimator used unless one is named."""


CLOCKS_APART = 0.6
"""Torque later by so much than in the calibration is another clock [s]: in simulated drives of one
vehicle it differed by less than 0.1 s, and masses are 8 to 12 % light at 1 s."""

ONE_TABLE: Final = 0.4
"""Lateness of speed and torque that differs by less is that of their table [s]: speeds are late by
0 to 0.4 s where their clock is right."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Weighing(MassResult):
    """The mass of one drive, how sure it is, and why; shows itself, and other methods beside it."""

    def compare(self) -> tuple[Weighing, ...]:
        """Weigh the same drive by every method, this one included, see `compare`."""
        return compare(self)

    def report(self, path: str | Path, *, compare: bool = False) -> None:
        """Write a self-contained HTML report that opens offline.

        Parameters
        ----------
        path : file to write
        compare : weigh by every other method too, and show them side by side
        """
        from weighbridge.report import write_report

        check_path("path", path)
        check_flag("compare", compare)
        write_report([self], path, comparisons=[self.compare()] if compare else None)

    def plot(self) -> Any:
        """Return a plotly figure of the mass over time."""
        from weighbridge.report import mass_figure

        return mass_figure(self)


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
        Without a mass, but with a reason, where the data cannot carry one.

    Raises
    ------
    ConfigError
        The method is not known, or has no such setting.
    DriveError
        What the drive says cannot be so, such as a wrong unit.
    """
    check_text("method", method)
    if settings is not None:
        check_type("settings", settings, Mapping, "a dictionary of values by name")
    if method not in ESTIMATORS:
        raise ConfigError(f"unknown method {method!r}; known are {', '.join(ESTIMATORS)}")
    chosen = ESTIMATORS[method].settings_of(settings) if settings else None

    from weighbridge.checks import mend_drive, refuse_serious

    home, vehicle = home_of(vehicle), as_vehicle(vehicle)
    drive = mend_drive(as_drive(drive, mapping_of(vehicle, home), mapping), vehicle)
    refuse_serious(drive.name, drive.problems)
    return weigh_checked(drive, vehicle, method, chosen)


def weigh_checked(drive: Drive, vehicle: Vehicle, method: str, settings: Any = None) -> Weighing:
    """Weigh as `weigh` does, from a drive that was checked and a known method.

    ``settings`` are those of the estimator; its defaults when None.
    """
    warnings = tuple(p.text for p in drive.problems)
    alone = ESTIMATORS[method].speed_alone
    seen = without_accelerometer(drive) if ESTIMATORS[method].by_speed else drive
    if not alone:
        vehicle = as_read(vehicle)
    lacking = no_speed(drive) if alone else what_is_missing(drive, vehicle)
    if lacking:
        return without_mass(drive, vehicle, method, lacking, warnings)
    if alone:
        balance = speed_balance(drive, vehicle)
        warnings += balance.motion.notes
    else:
        vehicle, found = by_power(seen, vehicle)
        balance, notes = torque_balance(seen, vehicle)
        vehicle, tyres = on_its_tyres(balance, vehicle)
        if tyres:
            balance, notes = torque_balance(seen, vehicle)
            notes = (tyres, *notes)
        warnings += found + notes + vehicle.provenance.doubts
        warnings += fitted_for_another(vehicle, method)
    return weigh_balance(drive, vehicle, method, balance, warnings, settings=settings)


def weigh_balance(
    drive: Drive,
    vehicle: Vehicle,
    method: str,
    balance: ForceBalance,
    warnings: tuple[str, ...] = (),
    joined: MassTrack | None = None,
    settings: Any = None,
) -> Weighing:
    """Weigh from forces and motion that are found already.

    Parameters
    ----------
    drive, vehicle, method : as of `weigh`
    balance : forces and motion
    warnings : what is known of the drive
    joined : what ``joint`` makes of the balance, which judges the other methods; None to find it
    settings : of the estimator; its defaults when None
    """
    estimator = ESTIMATORS[method]
    result = estimator.track(balance, vehicle, settings)
    if settings is not None and (own := differences(settings)):
        warnings += (f"{method} was run with {own}, not with its defaults",)
    if not estimator.speed_alone:
        warnings += uncalibrated(vehicle, result)
    status, reason = result.status, result.reason
    share = None if estimator.speed_alone else share_on_gears(balance, vehicle)
    if share is not None and share < ENOUGH:
        status = Status.INCONSISTENT
        reason = (
            f"only {100.0 * share:.0f} % of the steady ratios of engine to vehicle speed lie at a "
            f"gearing of {vehicle.name}: the vehicle file is another vehicle's, or its gearings "
            "are wrong; calibrate this vehicle"
        )
    elif not estimator.speed_alone and (
        why := scale_contradiction(balance, vehicle)
        or foreign_part(balance, vehicle)
        or _smoothed(drive, vehicle, balance)
    ):
        status, reason = Status.INCONSISTENT, why
    if status is Status.CONVERGED and not estimator.speed_alone:
        if result.filter_input is not None:
            joined = result
        joined = joined or joint.estimate(balance, vehicle)
        refused, doubt = of_another(vehicle, joined)
        change = largest(joined.filter_input) if joined.filter_input is not None else None
        if change is not None and change.sure:
            status, reason = Status.INCONSISTENT, change.text
        elif refused:
            status, reason = Status.INCONSISTENT, doubt
        elif why := contradicted(result, joined):
            status, reason = Status.INCONSISTENT, why
        else:
            possible = result.possible_change
            doubts = (
                doubt,
                change.doubt if change is not None else "",
                possible.note if possible is not None else "",
            )
            warnings += tuple(d for d in doubts if d)
    return Weighing(
        drive=drive,
        vehicle=vehicle,
        method=method,
        status=status,
        reason=reason,
        result=result,
        warnings=warnings + overload(vehicle, result) + below_tare(vehicle, result),
        settings=settings,
    )


def _smoothed(drive: Drive, vehicle: Vehicle, balance: ForceBalance) -> str:
    """Say that the torque was smoothed, unless a person vouches for it."""
    trusted = set(source_of(vehicle).found(drive)) & set(drive.info.trusted)
    return "" if trusted else smoothed_torque(balance, vehicle)


def without_mass(
    drive: Drive, vehicle: Vehicle, method: str, reason: str, warnings: tuple[str, ...] = ()
) -> Weighing:
    """Say why a method could not be tried."""
    return Weighing(
        drive=drive,
        vehicle=vehicle,
        method=method,
        status=Status.MISSING_SIGNALS,
        reason=reason,
        result=None,
        warnings=warnings,
    )


def compare(weighing: Weighing) -> tuple[Weighing, ...]:
    """Weigh a drive that has been weighed by one method by all the others too.

    The drive is not checked again, and forces and motion, which cost most, are
    taken over.

    Parameters
    ----------
    weighing : of the drive, by any method

    Returns
    -------
    One by each of `weighbridge.estimators.ESTIMATORS`, in their order; a method that could not be
    tried says why
    """
    check_type("weighing", weighing, Weighing, "what weigh returns")
    found: dict[str, Weighing] = {weighing.method: weighing}
    for method in ESTIMATORS:
        if method not in found:
            joint = found.get(DEFAULT_METHOD)
            found[method] = _by(weighing, method, joint.result if joint is not None else None)
    return tuple(found[method] for method in ESTIMATORS)


def _by(weighing: Weighing, method: str, joined: MassTrack | None) -> Weighing:
    """Weigh by another method."""
    drive, vehicle, done = weighing.drive, weighing.vehicle, weighing.result
    try:
        if done is None or _another_balance(weighing, method):
            return weigh_checked(drive, vehicle, method)
        warnings = fitted_for_another(vehicle, method)
        return weigh_balance(drive, vehicle, method, done.balance, warnings, joined)
    except WeighbridgeError as error:
        return without_mass(drive, vehicle, method, str(error))


def _another_balance(weighing: Weighing, method: str) -> bool:
    """Whether a method needs another balance than that of a weighing."""
    made, other = weighing.estimator, ESTIMATORS[method]
    if made.speed_alone or other.speed_alone:
        return True
    if made.by_speed == other.by_speed:
        return False
    drive = weighing.drive
    return len(without_accelerometer(drive).signals) < len(drive.signals)


def torque_balance(drive: Drive, vehicle: Vehicle) -> tuple[ForceBalance, tuple[str, ...]]:
    """Balance measured or modelled torque against the best motion the drive allows.

    Returns
    -------
    balance
    notes : what was found or doubted, one sentence each

    Raises
    ------
    DriveError
        Torque and motion are on clocks that differ.
    """
    found, navigation = identify_motion(drive, vehicle)
    motion = of_vehicle(found, vehicle)
    delay = vehicle.timing.torque_delay
    drive, drifted = steadied(drive, vehicle, motion, delay or 0.0)
    notes = motion.notes + drifted
    if delay is None:
        delay = estimate_torque_delay(drive, vehicle, motion)
        if math.isfinite(delay):
            notes += (f"torque delay {delay:+.2f} s found from this drive",)
        else:
            delay = 0.0
            notes += ("the drive does not show how late its torque is; taken as 0 s",)
    elif vehicle.provenance.torque_fitted:
        later = _other_clock(drive, vehicle, motion, delay)
        if later:
            delay += later
            notes += (
                f"torque is {_later(later)} against the motion than in the calibration; "
                "its clock was moved by that",
            )
    balance = replace(force_balance(drive, vehicle, motion, delay=delay), navigation=navigation)
    if behind := far_shift(balance, vehicle):
        raise DriveError(
            f"{drive.name}: its torque lies {_later(-behind)} than the motion it makes, though "
            "speed and accelerometer were put together: the clock of the speed or of the torque "
            "alone is off, and the mass would be wrong; record all signals of the bus by one clock"
        )
    return balance, notes + other_equipment(vehicle, motion) + balance.notes


def uncalibrated(vehicle: Vehicle, result: MassTrack) -> tuple[str, ...]:
    """Say what a file that no calibration made leaves open in the interval; nothing if one did."""
    if vehicle.provenance.mass_scale_std is not None:
        return ()
    fit = vehicle.provenance.fit
    made = "not made by a calibration"
    if fit is not None and not fit.torque:
        made = f"calibrated for {fit.name} alone"
    text = f"the vehicle file of {vehicle.name} was {made}"
    if not (math.isfinite(result.systematic_std) and result.mass > 0.0):
        return (text,)
    return (
        f"{text}: for errors of its torque, rolling radius, efficiency (taken as "
        f"{wheel_efficiency(vehicle):.2f}) and inertias, and of the equipment, such as the lean of "
        f"the body, {100.0 * result.systematic_std / result.mass:.1f} % of the mass, as standard "
        "deviation, are in the interval",
    )


def other_equipment(vehicle: Vehicle, motion: Motion) -> tuple[str, ...]:
    """Say where the calibration had an accelerometer and the drive has none; nothing if not."""
    if not lacks_accelerometer(vehicle, motion):
        return ()
    return (
        f"the vehicle file of {vehicle.name} was made with an accelerometer, and this drive has "
        "none that can be used: masses come out 3 to 14 % light; calibrate on drives without it",
    )


def _other_clock(drive: Drive, vehicle: Vehicle, motion: Motion, delay: float) -> float:
    """By how much the torque of a drive is later than in the calibration [s]; 0 where it is not.

    Raises
    ------
    DriveError
        The clocks of torque and motion are `CLOCKS_APART` or more off, and not those of speed
        and motion by as much.
    """
    later = clock_shift(drive, vehicle, motion, delay)
    # As late as the speed beside it: the whole table is, and the shift brings all of it back.
    of_table = motion.speed_delay > CLOCKS_APART and abs(motion.speed_delay - later) < ONE_TABLE
    if abs(later) > CLOCKS_APART and not of_table:
        raise DriveError(
            f"{drive.name}: its torque lies {_later(later)} against the motion than in "
            "the calibration, so that the clocks of its tables differ, "
            "and the mass would be wrong; give offset_s, or align = true, under [time] in a mapping"
        )
    return later


def _later(by: float) -> str:
    return f"{abs(by):.1f} s {'later' if by > 0.0 else 'earlier'}"


def fitted_for_another(vehicle: Vehicle, method: str) -> tuple[str, ...]:
    """Say where the torque was fitted for an estimator that needs another; nothing if not."""
    fit, fits = vehicle.provenance.fit, ESTIMATORS[method].fits
    if fit is None or not fit.torque or fit.name in fits:
        return ()
    return (
        f"the vehicle file of {vehicle.name} was calibrated for {fit.name}, with which {method} "
        f"masses come out several percent light; calibrate again for {fits[0]}, or weigh with "
        f"--method {fit.name}",
    )


def overload(vehicle: Vehicle, result: MassTrack) -> tuple[str, ...]:
    """Say in a sentence whether a mass is above the permitted one; nothing if not."""
    gross = vehicle.gross
    if gross is None or result.status is not Status.CONVERGED or result.mass <= gross:
        return ()
    sure = "surely" if result.mass - 2.0 * result.std > gross else "perhaps"
    return (f"{sure} above the permitted mass of {gross:.0f} kg",)


def below_tare(vehicle: Vehicle, result: MassTrack) -> tuple[str, ...]:
    """Say in a sentence whether a mass is below the empty one; nothing if not."""
    tare = vehicle.tare
    if tare is None or result.status is not Status.CONVERGED or result.mass >= tare:
        return ()
    if result.mass + 2 * result.std > tare:
        return (
            f"the payload of {result.mass - tare:.0f} kg is below nothing, within the uncertainty",
        )
    return (
        f"the payload is {result.mass - tare:.0f} kg, which is below nothing: tank and driver's "
        f"seat are empty, or the tare of {tare:.0f} kg, the vehicle file or the torque is wrong",
    )


def what_is_missing(drive: Drive, vehicle: Vehicle) -> str:
    """Say which signals a drive lacks for this vehicle; empty if none."""
    source = source_of(vehicle)
    missing = source.lacking(drive)
    if not (drive.has("vehicle_speed") or drive.has("gnss_speed")) and not drive.has("latitude"):
        missing.append("vehicle_speed")
    if not vehicle.driveline.single_speed and not drive.has("engine_speed"):
        missing.append("engine_speed")
    if not missing:
        return source.refusal(drive, vehicle.driveline.driven)
    fit = vehicle.provenance.fit
    if fit is not None and not fit.torque and not vehicle.driveline.gearings:
        return (
            f"the vehicle file of {vehicle.name} was calibrated for {fit.name} alone and knows "
            f"neither gears nor torque: calibrate without --method {fit.name} to weigh by torque"
        )
    names = " and ".join(dict.fromkeys(missing))
    sentence = f"the drive has no {names}, which torque source {source.name!r} needs"
    others = [s for s in TORQUE_SOURCES.values() if s != source and not s.lacking(drive)]
    if others and drive.has("vehicle_speed"):
        if not others[0].signed and not vehicle.provenance.masses:
            return (
                f"the vehicle file of {vehicle.name} was never calibrated, and only a drive of "
                f"known mass tells what {others[0].title} is worth: weighbridge calibrate DRIVE "
                f"--torque {others[0].name} --mass KG --vehicle FILE -o CALIBRATED"
            )
        return (
            f"{sentence}; it has {' and '.join(others[0].found(drive))}: weigh it with a vehicle "
            f"file of torque source {others[0].name!r} "
            f"(weighbridge calibrate --torque {others[0].name})"
        )
    return f"{sentence}; nothing can be weighed"


def no_speed(drive: Drive) -> str:
    """Say that a drive has no speed, which is all some methods need; empty if it has."""
    if any(drive.has(name) for name in SPEEDS):
        return ""
    return f"the drive has no {' and no '.join(SPEEDS)}, of which this method needs one"
