"""What is said beside a mass: about the vehicle file, its limits, and what a drive lacks."""

from __future__ import annotations

import math
from typing import Final

from weighbridge.balance.speed_balance import SPEEDS
from weighbridge.estimators import ESTIMATORS, MassTrack, Status
from weighbridge.estimators.judging import grade_apart, lacks_accelerometer
from weighbridge.navigation.motion import Motion
from weighbridge.signals import Drive
from weighbridge.vehicle.data_sheet import wheel_efficiency
from weighbridge.vehicle.model import Vehicle
from weighbridge.vehicle.torque import source_of
from weighbridge.vehicle.torque_sources import TORQUE_SOURCES


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


GRADES_APART: Final = 0.003
"""Grades known better or worse than in the calibration by so much are told [rad]."""


def other_equipment(vehicle: Vehicle, motion: Motion) -> tuple[str, ...]:
    """Say where calibration and drive had another accelerometer or grade; nothing if not."""
    if grade_apart(vehicle, motion) > GRADES_APART:
        now, then = motion.unmeasured_grade, vehicle.provenance.unmeasured_grade or 0.0
        return (
            f"the grade is known to {100.0 * now:.1f} % in this drive and was to "
            f"{100.0 * then:.1f} % in the calibration of {vehicle.name}: masses come out some "
            f"percent {'light' if now > then else 'heavy'}; calibrate on drives like this one",
        )
    if not lacks_accelerometer(vehicle, motion):
        return ()
    return (
        f"the vehicle file of {vehicle.name} was made with an accelerometer, and this drive has "
        "none that can be used: masses come out 3 to 14 % light; calibrate on drives without it",
    )


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


def beside_speed(drive: Drive) -> tuple[str, ...]:
    """Say in a sentence what a speed beside a grade does tell; nothing without a grade."""
    if not (drive.has("grade") or drive.has("altitude")):
        return ()
    return (
        "speed and grade bound the mass from above by the engine's full power (weighbridge bound "
        "--power KW), and coasting both ways tells the drag over it (weighbridge coast)",
    )


FAR_ABOVE: Final = 1.25
"""Above so much of the permitted mass a trailer is as likely as a load, as of legs of a fleet, or
the vehicle file another's [-]."""

SMALL: Final = 4.0
"""The usual mass of a class over that of its lightest vehicles [-]: cars of 0.4 t and trucks of
3.7 t."""


def overload(vehicle: Vehicle, result: MassTrack) -> tuple[str, ...]:
    """Say in a sentence whether a mass is above the permitted one; nothing if not."""
    gross = vehicle.gross
    if gross is None or result.status is not Status.CONVERGED or result.mass <= gross:
        return ()
    sure = "surely" if result.mass - 2.0 * result.std > gross else "perhaps"
    text = f"{sure} above the permitted mass of {gross:.0f} kg"
    if result.mass - 2.0 * result.std <= FAR_ABOVE * gross:
        return (text,)
    return (
        f"{text}, {result.mass / gross:.1f} times it: a trailer, a gross overload, or the vehicle "
        f"file is another vehicle's; check that this was {vehicle.name}",
    )


def beyond_class(vehicle: Vehicle, result: MassTrack) -> tuple[str, ...]:
    """Say in a sentence whether a mass is far from those of the class; nothing if not.

    Where the vehicle file states tare or permitted mass, or was calibrated, those tell more.
    """
    known = (vehicle.tare, vehicle.gross, *vehicle.provenance.masses)
    if any(mass is not None for mass in known) or result.status is not Status.CONVERGED:
        return ()
    of_class = vehicle.of_class
    low, high = of_class.typical_mass / SMALL, of_class.typical_mass * of_class.heaviest
    if low <= result.mass + 2.0 * result.std and result.mass - 2.0 * result.std <= high:
        return ()
    return (
        f"{result.mass:.0f} kg is far from the usual masses of the class {of_class.name}, "
        f"{low:.0f} to {high:.0f} kg: the vehicle file is another vehicle's, or of the "
        "wrong class; state tare_kg and gross_kg under [vehicle], so that it can be checked",
    )


def below_tare(vehicle: Vehicle, result: MassTrack) -> tuple[str, ...]:
    """Say in a sentence whether a mass is below the empty one; nothing if not by its std."""
    tare = vehicle.tare
    if tare is None or result.status is not Status.CONVERGED or result.mass + result.std > tare:
        return ()
    if result.mass + 2 * result.std > tare:
        return (
            f"the payload of {result.mass - tare:.0f} kg is below nothing, within the uncertainty",
        )
    return (
        f"the payload is {result.mass - tare:.0f} kg, which is below nothing: tank and driver's "
        f"seat are empty, or the tare of {tare:.0f} kg, the vehicle file or the torque is wrong",
    )


LIGHTER: Final = 0.9
"""Masses below so much of the lightest of the calibration are told, where no tare is stated [-]."""


def lighter_than_known(vehicle: Vehicle, result: MassTrack) -> tuple[str, ...]:
    """Say in a sentence whether a mass is far below all of the calibration; nothing if not.

    Where the vehicle file states its tare, that tells more.
    """
    masses = vehicle.provenance.masses
    if vehicle.tare is not None or not masses or result.status is not Status.CONVERGED:
        return ()
    lightest = min(masses)
    if result.mass + 2.0 * result.std >= LIGHTER * lightest:
        return ()
    below = 100.0 * (1.0 - result.mass / lightest)
    return (
        f"the mass is {below:.0f} % below the {lightest:.0f} kg of the lightest drive of the "
        "calibration: if no load was in that drive, the torque or load reads too low now; state "
        "tare_kg under [vehicle] of the vehicle file, so that it can be checked",
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
