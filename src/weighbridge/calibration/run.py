"""From drives of known mass to a vehicle file."""

from __future__ import annotations

import datetime
import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from weighbridge.arguments import check_type
from weighbridge.balance import ForceBalance, learn_second_signals
from weighbridge.calibration.charge import in_their_air
from weighbridge.calibration.fitted import Fitted, fitted_rows, noted, rebalanced
from weighbridge.calibration.joint import fit_joint, fit_speed_torque
from weighbridge.calibration.known_mass import (
    drag_finding,
    fuel_finding,
    questionable_masses,
    refuse_too_heavy,
    scale_by_mass,
    scale_finding,
    unbacked_scale,
    with_findings,
)
from weighbridge.calibration.printed import PrintedCar, calibrate_as_printed
from weighbridge.calibration.problem import Problem, checked, problem_of
from weighbridge.calibration.rls import fit_rls
from weighbridge.calibration.settings import CalibrationSettings
from weighbridge.calibration.speed import SpeedCalibration, calibrate_by_speed
from weighbridge.checks.steps import SAME, reading_step
from weighbridge.errors import ConfigError, WeighbridgeError
from weighbridge.estimators.gate import GATE
from weighbridge.estimators.judging import HIDDEN_BRAKE_STD
from weighbridge.messages import Problem as Message
from weighbridge.messages import phrase, refused
from weighbridge.navigation import BY_SPEED, without_accelerometer
from weighbridge.pipeline.given import (
    GivenDrive,
    GivenVehicle,
    as_drives,
    as_vehicle,
    home_of,
    mapping_of,
)
from weighbridge.results import Calibration
from weighbridge.signals import Drive
from weighbridge.vehicle import Driveline, Vehicle
from weighbridge.vehicle.fits import JOINT, RLS, SPEED_TORQUE_EKF
from weighbridge.vehicle.reported_torque import SAME_REFERENCE, reference_torques

if TYPE_CHECKING:
    from weighbridge.io.mapping import MappingSource

FITTERS: Final[dict[str, Callable[[Problem], Fitted]]] = {
    JOINT.name: fit_joint,
    RLS.name: fit_rls,
    SPEED_TORQUE_EKF.name: fit_speed_torque,
}
"""What fits the torque for each method."""

_LOG = logging.getLogger(__name__)

FEW_SAMPLES: Final = 2000
"""Fewer usable samples, some twenty minutes of driving, make a poor calibration."""

MASSES_APART: Final = 0.01
"""A mass given and one that a drive states differ by more, and a note says so [-]."""


FEW_IN_GEAR: Final = 5
"""Fewer samples name no gear: gearboxes show odd numbers while they shift."""


def calibrate(
    drives: GivenDrive | Sequence[GivenDrive],
    mass: float | Sequence[float] | None = None,
    *,
    vehicle: GivenVehicle | None = None,
    settings: CalibrationSettings | None = None,
    mapping: MappingSource | None = None,
) -> Vehicle:
    """Calibrate a vehicle from one or more drives of known mass.

    Parameters
    ----------
    drives : recorded drives of one vehicle, or the paths or data frames that they are to be read
        from; one, or a list of them
    mass : of all, or one for each, as the drive begins [kg]; from ``drive.toml`` when None
    vehicle : what is known already (class, wheel radius, gearings, tare), or the path of a vehicle
        file that says it
    settings : see `CalibrationSettings`
    mapping : for paths or data frames with names of their own: mapping TOML, or a dictionary of
        the same form; the one that ``vehicle`` names when None

    Raises
    ------
    DriveError, ConfigError
        A drive or an argument cannot be used; the sentence says why.
    """
    if settings is not None:
        check_type("settings", settings, CalibrationSettings, "a weighbridge.CalibrationSettings")
    base = as_vehicle(vehicle) if vehicle is not None else None
    known = as_drives(drives, mapping_of(base, home_of(vehicle)), mapping)
    if settings is not None and settings.grid:
        return run_training(known, mass, vehicle=base, settings=settings).vehicle
    if settings is not None and not settings.fit.torque:
        return run_speed_calibration(known, mass, vehicle=base).vehicle
    return run_calibration(known, mass, vehicle=base, settings=settings).vehicle


def run_training(
    drives: Drive | Sequence[Drive],
    mass: float | Sequence[float] | None = None,
    *,
    vehicle: Vehicle | None = None,
    settings: CalibrationSettings,
) -> PrintedCar:
    """As `calibrate` with ``grid``, keeping what was fitted.

    Raises
    ------
    ConfigError
        There are several drives.
    """
    drives, base, masses = checked(drives, mass, vehicle, "load")
    if len(drives) > 1:
        raise ConfigError(
            f"the training of Jensen 2022 is on one drive, got {len(drives)}: name one of them"
        )
    return calibrate_as_printed(drives[0], masses[0], base, settings.training)


def run_speed_calibration(
    drives: Drive | Sequence[Drive],
    mass: float | Sequence[float] | None = None,
    *,
    vehicle: Vehicle | None = None,
) -> SpeedCalibration:
    """As `calibrate` for the method "speed-ekf", keeping what was fitted."""
    drives, base, masses = checked(drives, mass, vehicle)
    return calibrate_by_speed(drives, masses, base)


def run_calibration(
    drives: Drive | Sequence[Drive],
    mass: float | Sequence[float] | None = None,
    *,
    vehicle: Vehicle | None = None,
    settings: CalibrationSettings | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Calibration:
    """As `calibrate`, keeping what the report shows; ``progress`` takes parts done of all."""
    settings = settings or CalibrationSettings()
    tell = progress or (lambda done, total: None)
    if not settings.fit.torque:
        raise ConfigError(f"method {settings.method} has no torque fit; use run_speed_calibration")
    problem = problem_of(drives, mass, vehicle, settings, progress=lambda k, n: tell(k, 3 * n))
    fitted = FITTERS[settings.method](problem)
    if (seen := in_their_air(problem, fitted.vehicle)) is not None:
        problem, fitted = seen, FITTERS[settings.method](seen)
    tell(5, 9)
    rows = fitted_rows(fitted.vehicle, problem, fitted.rows)
    recorded = [r.drive for r in problem.recordings]
    motions = {r.motion.source for r in problem.recordings}
    witnesses, contradictions = learn_second_signals(recorded, fitted.vehicle)
    done = replace(
        fitted.vehicle,
        torque=replace(
            fitted.vehicle.torque,
            reported_reference_torque=_stated_reference(recorded, problem),
            reading_step=_reading_step(recorded, problem),
        ),
        witnesses=witnesses or fitted.vehicle.witnesses,
        provenance=replace(
            fitted.vehicle.provenance,
            drives=tuple(drive.name for drive in recorded),
            date=datetime.date.today().isoformat(),
            r_squared=rows.r_squared,
            residual_std=rows.residual_std,
            samples=int(rows.time.size),
            motion=motions.pop() if len(motions) == 1 else None,
            unmeasured_grade=_unmeasured_grade(problem),
            torque_period=_torque_period(problem),
        ),
    )
    balances = tuple(rebalanced(problem, done))
    of_masses = _mass_findings(done, recorded, balances, problem)
    few, line = Message.of("calibration.few", samples=rows.time.size), done.driveline
    doubts = [
        *of_masses,
        *questionable_masses(done, balances, problem.masses),
    ]
    others: list[Message | None] = [
        *([few] if rows.time.size < FEW_SAMPLES else []),
        *_other_masses(recorded, problem.masses),
        *([unfound_gears(recorded, problem.gears.gearings.size)] if problem.gears else []),
        *([Message.of("gear.stepless")] if line.stepless and not problem.given.stepless else []),
        *doubts,
        *contradictions,
    ]
    notes = [note for note in (*others, *unbacked_scale(done)) if note is not None]
    done = _with_notes(done, balances, notes)
    done = with_findings(done, doubts)
    if problem.source.gearing is not None:
        done = _with_gears(done, problem.given)
    _refuse_useless(done)
    by_speed = None
    if any(r.motion.source not in BY_SPEED for r in problem.recordings):
        by_speed = _by_speed(drives, mass, vehicle, settings)
    done = replace(done, without_accelerometer=by_speed)
    _LOG.info(
        "%s: %s fit of %d drives, %d samples, R² %.4f",
        done.name, settings.method, len(recorded), rows.time.size, rows.r_squared,
    )  # fmt: skip
    return Calibration(
        vehicle=done,
        gears=problem.gears,
        balances=balances,
        rows=rows,
        search=fitted.search,
        held=fitted.held,
        problems=(*fitted.notes, *_balance_notes(balances), *notes),
    )


def _by_speed(
    drives: Drive | Sequence[Drive],
    mass: float | Sequence[float] | None,
    vehicle: Vehicle | None,
    settings: CalibrationSettings,
) -> Vehicle | None:
    """Calibrate by what the drives record beside their accelerometer; None where that fails."""
    every = [drives] if isinstance(drives, Drive) else drives
    left = [without_accelerometer(drive) for drive in every]
    try:
        return run_calibration(left, mass, vehicle=vehicle, settings=settings).vehicle
    except WeighbridgeError as error:
        _LOG.info("no calibration without the accelerometer: %s", error)
        return None


def _mass_findings(
    vehicle: Vehicle, drives: Sequence[Drive], balances: Sequence[ForceBalance], problem: Problem
) -> list[Message]:
    """Say what torque, drag and fuel show against the masses; refuse those above gross as well."""
    masses = problem.masses
    scale = scale_finding(vehicle, masses, problem.names)
    each = zip(drives, balances, masses, strict=True)
    fuel = [doubt for one in each if (doubt := fuel_finding(*one))]
    heavy = [scale] if scale and scale_by_mass(vehicle) > 1.0 else []
    refuse_too_heavy(vehicle, masses, [*heavy, *fuel])
    return [d for d in (scale, drag_finding(vehicle, masses), *fuel) if d is not None]


def _unmeasured_grade(problem: Problem) -> float:
    """What of the grade nothing has measured, over all drives [rad]."""
    left = [r.motion.unmeasured_grade for r in problem.recordings]
    return round(float(np.sqrt(np.mean(np.square(left)))), 5)


def _torque_period(problem: Problem) -> float:
    """From one sample of the torque to the next, the longest of all drives [s]."""
    return round(max(r.source.carrier(r.drive).period for r in problem.recordings), 6)


def _stated_reference(drives: Sequence[Drive], problem: Problem) -> float | None:
    """Return what all drives say that 100 % are [N m]; None where one says nothing, or another."""
    reported = [drive.get("reference_torque") for drive in drives]
    if not problem.source.needs_reference:
        return None
    said = [value for signal in reported if signal for value, _ in reference_torques(signal)]
    if len(said) != len(drives) or max(said) > (1.0 + SAME_REFERENCE) * min(said):
        return None
    return float(np.median(said))


def _reading_step(drives: Sequence[Drive], problem: Problem) -> float | None:
    """Return the step in which all drives show the torque's reading [SI]; None if they differ."""
    signals = [drive.get(problem.source.found(drive)[0]) for drive in drives]
    steps = [reading_step(signal.values) if signal else 0.0 for signal in signals]
    if not min(steps) > 0.0 or max(steps) > (1.0 + SAME) * min(steps):
        return None
    return float(f"{np.median(steps):.6g}")


def _with_notes(
    vehicle: Vehicle, balances: Sequence[ForceBalance], notes: Sequence[Message]
) -> Vehicle:
    """Note what is questioned of a calibration's drives, and count what is hidden in them."""
    for note in dict.fromkeys([*_balance_notes(balances), *notes]):
        vehicle = noted(vehicle, note)
    if not any(balance.brake_hidden for balance in balances):
        return vehicle
    made = vehicle.provenance
    std = float(np.hypot(made.mass_scale_std or 0.0, HIDDEN_BRAKE_STD))
    return replace(vehicle, provenance=replace(made, mass_scale_std=std))


def _balance_notes(balances: Sequence[ForceBalance]) -> list[Message]:
    return list(dict.fromkeys(note for balance in balances for note in balance.notes))


def _refuse_useless(vehicle: Vehicle) -> None:
    """Refuse a calibration with which no drive could be weighed.

    Raises
    ------
    DriveError
        It leaves more than the widest of `GATE` in every mass.
    """
    made = vehicle.provenance
    if made.mass_scale_std is not None and made.mass_scale_std > GATE.widest:
        raise refused(
            "calibration.useless",
            share=100.0 * made.mass_scale_std,
            notes=made.notes or phrase("no_notes"),
        )


def _with_gears(vehicle: Vehicle, given: Driveline) -> Vehicle:
    """Return a vehicle with the gears it has, not those that its torque is read behind."""
    line = replace(
        vehicle.driveline,
        gearings=given.gearings,
        gearing_stds=given.gearing_stds,
        engine_inertia=given.engine_inertia,
        engine_inertia_std=given.engine_inertia_std,
        idle_speed=given.idle_speed,
    )
    return replace(vehicle, driveline=line)


def unfound_gears(drives: Sequence[Drive], found: int) -> Message | None:
    """Say that gearboxes name more gears than ratios were found; None where they do not.

    Parameters
    ----------
    drives : of the calibration
    found : gearings that stand out from engine over vehicle speed
    """
    reported = [drive.signals["gear"].values for drive in drives if drive.has("gear")]
    if found < 2 or not reported:
        return None
    gears, counts = np.unique(np.round(np.concatenate(reported)), return_counts=True)
    named = int(np.count_nonzero((gears >= 1.0) & (counts >= FEW_IN_GEAR)))
    if named <= found:
        return None
    return Message.of("calibration.gears", named=named, found=found)


def _other_masses(drives: Sequence[Drive], masses: Sequence[float]) -> list[Message]:
    """Say where a mass that was given differs from the one its drive states."""
    return [
        Message.of("calibration.other_mass", drive=drive.name, stated=drive.info.mass, mass=kg)
        for drive, kg in zip(drives, masses, strict=True)
        if drive.info.mass is not None and abs(kg / drive.info.mass - 1.0) > MASSES_APART
    ]
