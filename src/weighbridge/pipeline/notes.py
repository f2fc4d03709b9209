"""What is said beside a mass: about the vehicle file, its limits, and what a drive lacks."""

from __future__ import annotations

import math
from typing import Any, Final

from weighbridge.balance import ForceBalance
from weighbridge.balance.speed_balance import SPEEDS
from weighbridge.estimators import ESTIMATORS, MassTrack, Status
from weighbridge.estimators.judging import grade_apart, lacks_accelerometer, sampled_otherwise
from weighbridge.messages import Problem, phrase
from weighbridge.results.reported import trailer_connected
from weighbridge.signals import Drive
from weighbridge.vehicle import Vehicle, part_of_a_hybrid, source_of, sources_of, wheel_efficiency
from weighbridge.vehicle.data_sheet import needs_calibration


def uncalibrated(vehicle: Vehicle, result: MassTrack) -> tuple[Problem, ...]:
    """Say what a file that no calibration made leaves uncertain; nothing if one did."""
    if vehicle.provenance.mass_scale_std is not None:
        return ()
    fit = vehicle.provenance.fit
    fitted = fit is not None and not fit.torque
    made = phrase("calibrated_alone", fit=fit.name) if fit and fitted else phrase("not_calibrated")
    about: dict[str, Any] = {"vehicle": vehicle.name, "made": made}
    if not (math.isfinite(result.systematic_std) and result.mass > 0.0):
        return (Problem.of("vehicle.uncalibrated", **about),)
    share = 100.0 * result.systematic_std / result.mass
    efficiency = wheel_efficiency(vehicle)
    return (Problem.of("vehicle.uncalibrated_std", **about, efficiency=efficiency, share=share),)


def towing(drive: Drive, result: MassTrack | None) -> tuple[Problem, ...]:
    """Say that the vehicle reports a trailer, for its mass is in the one weighed; else nothing."""
    if trailer_connected(drive, result):
        return (Problem.of("mass.with_trailer", "trailer_connected"),)
    return ()


UNBACKED_STD: Final = 0.025
"""What masses of a calibration that nothing backs leave uncertain of a mass, relative [-]: chosen,
as if three of a hundred were wrong by 15 %."""


def unbacked(vehicle: Vehicle) -> tuple[Problem, ...]:
    """Say that nothing backs the masses of a calibration; nothing where something does.

    A torque in N m or percent has a scale of its own, and tare and permitted mass bound what the
    drives weighed. What a load or an air flow is worth the masses alone say.
    """
    fit = vehicle.provenance.fit
    if fit is None or not fit.torque or not vehicle.provenance.masses or source_of(vehicle).signed:
        return ()
    if vehicle.tare is not None or vehicle.gross is not None:
        return ()
    return (Problem.of("mass.unbacked", source=source_of(vehicle).title, vehicle=vehicle.name),)


GRADES_APART: Final = 0.003
"""Grades known better or worse than in the calibration by so much are reported [rad]."""


def other_equipment(vehicle: Vehicle, balance: ForceBalance) -> tuple[Problem, ...]:
    """Say where calibration and drive were recorded otherwise; nothing if not.

    That is with another accelerometer, grade or rate of the torque.
    """
    motion, made = balance.motion, vehicle.provenance
    notes = []
    period = sampled_otherwise(vehicle, balance)
    if period is not None:
        then = made.torque_period
        notes.append(Problem.of("torque.other_rate", now=period, then=then, vehicle=vehicle.name))
    if grade_apart(vehicle, motion) > GRADES_APART:
        grade, known = motion.unmeasured_grade, made.unmeasured_grade or 0.0
        notes.append(
            Problem.of(
                "motion.grade_apart",
                now=100.0 * grade,
                then=100.0 * known,
                vehicle=vehicle.name,
                word="light" if grade > known else "heavy",
            )
        )
    if lacks_accelerometer(vehicle, motion):
        notes.append(Problem.of("motion.no_accelerometer", vehicle=vehicle.name))
    return tuple(notes)


def fitted_for_another(vehicle: Vehicle, method: str) -> tuple[Problem, ...]:
    """Say where the torque was fitted for an estimator that needs another; nothing if not."""
    fit, fits = vehicle.provenance.fit, ESTIMATORS[method].fits
    if fit is None or not fit.torque or fit.name in fits:
        return ()
    return (
        Problem.of(
            "vehicle.fitted_for", vehicle=vehicle.name, fit=fit.name, method=method, other=fits[0]
        ),
    )


def beside_speed(drive: Drive) -> tuple[Problem, ...]:
    """Say what a speed beside a grade does show; nothing without a grade."""
    if not (drive.has("grade") or drive.has("altitude")):
        return ()
    return (Problem.of("speed.bounds"),)


FAR_ABOVE: Final = 1.25
"""Above so much of the permitted mass a trailer is as likely as a load, or the vehicle file
another's [-]."""

SMALL: Final = 4.0
"""The usual mass of a class over that of its lightest vehicles [-]: cars of 0.4 t and trucks of
3.7 t."""


def overload(vehicle: Vehicle, result: MassTrack) -> tuple[Problem, ...]:
    """Say whether a mass is above the permitted one; nothing if not."""
    gross = vehicle.gross
    if gross is None or result.status is not Status.CONVERGED or result.mass <= gross:
        return ()
    sure = "surely" if result.mass - 2.0 * result.std > gross else "perhaps"
    found: dict[str, Any] = {"sure": sure, "gross": gross, "mass": result.mass}
    if result.mass - 2.0 * result.std <= FAR_ABOVE * gross:
        return (Problem.of("mass.above_permitted", **found),)
    return (
        Problem.of(
            "mass.far_above_gross", **found, times=result.mass / gross, vehicle=vehicle.name
        ),
    )


def beyond_class(vehicle: Vehicle, result: MassTrack) -> tuple[Problem, ...]:
    """Say whether a mass is far from those of the class; nothing if not.

    Where the vehicle file states tare or permitted mass, or was calibrated, those show more.
    """
    known = (vehicle.tare, vehicle.gross, *vehicle.provenance.masses)
    if any(mass is not None for mass in known) or result.status is not Status.CONVERGED:
        return ()
    of_class = vehicle.of_class
    low, high = of_class.typical_mass / SMALL, of_class.typical_mass * of_class.heaviest
    if low <= result.mass + 2.0 * result.std and result.mass - 2.0 * result.std <= high:
        return ()
    return (
        Problem.of("mass.beyond_class", mass=result.mass, kind=of_class.name, low=low, high=high),
    )


def below_tare(vehicle: Vehicle, result: MassTrack) -> tuple[Problem, ...]:
    """Say whether a mass is below the empty one; nothing if not by its std."""
    tare = vehicle.tare
    if tare is None or result.status is not Status.CONVERGED or result.mass + result.std > tare:
        return ()
    if result.mass + 2 * result.std > tare:
        return (Problem.of("mass.payload_zero", payload=result.mass - tare),)
    return (Problem.of("mass.payload_negative", payload=result.mass - tare, tare=tare),)


LIGHTER: Final = 0.9
"""Masses below so much of the lightest of the calibration are noted without a tare [-]."""


def lighter_than_known(vehicle: Vehicle, result: MassTrack) -> tuple[Problem, ...]:
    """Say whether a mass is far below all of the calibration; nothing if not.

    Where the vehicle file states its tare, that shows more.
    """
    masses = vehicle.provenance.masses
    if vehicle.tare is not None or not masses or result.status is not Status.CONVERGED:
        return ()
    lightest = min(masses)
    if result.mass + 2.0 * result.std >= LIGHTER * lightest:
        return ()
    below = 100.0 * (1.0 - result.mass / lightest)
    return (Problem.of("mass.lighter_than_known", below=below, lightest=lightest),)


def what_is_missing(drive: Drive, vehicle: Vehicle) -> Problem | None:
    """Say which signals a drive lacks for this vehicle; None if none."""
    source = source_of(vehicle)
    if needs_calibration(vehicle):
        return Problem.of(
            "vehicle.not_calibrated", vehicle=vehicle.name, title=source.title, source=source.name
        )
    if (one := part_of_a_hybrid(vehicle, source)) is not None:
        return one
    missing = source.lacking(drive)
    if not (drive.has("vehicle_speed") or drive.has("gnss_speed")) and not drive.has("latitude"):
        missing.append("vehicle_speed")
    if not vehicle.driveline.single_speed and not drive.has("engine_speed"):
        missing.append("engine_speed")
    if not missing:
        return source.refusal(drive, vehicle.driveline.driven)
    fit = vehicle.provenance.fit
    if fit is not None and not fit.torque and not vehicle.driveline.gearings:
        return Problem.of("vehicle.no_torque_fit", vehicle=vehicle.name, fit=fit.name)
    names = " and ".join(dict.fromkeys(missing))
    others = [s for s in sources_of(vehicle) if s != source and not s.lacking(drive)]
    if others and drive.has("vehicle_speed"):
        if not others[0].signed and not vehicle.provenance.masses:
            return Problem.of(
                "vehicle.not_calibrated",
                vehicle=vehicle.name,
                title=others[0].title,
                source=others[0].name,
            )
        return Problem.of(
            "torque.other_source",
            missing=names,
            source=source.name,
            found=" and ".join(others[0].found(drive)),
            other=others[0].name,
        )
    return Problem.of("torque.missing_signals", missing=names, source=source.name)


def no_speed(drive: Drive) -> Problem | None:
    """Say that a drive has no speed, which is all some methods need; None if it has."""
    if any(drive.has(name) for name in SPEEDS):
        return None
    return Problem.of("speed.none_of", missing=" and no ".join(SPEEDS))
