"""From drives of known mass to a vehicle file."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.balance import Reason, force_balance
from weighbridge.balance.delay import best_delay, delay_std
from weighbridge.balance.force_balance import dragged_reading
from weighbridge.balance.law import ROAD_PARAMETERS
from weighbridge.balance.table import ForceBalance
from weighbridge.balance.witness_learning import learn_witnesses
from weighbridge.calibration.grid import grid_search
from weighbridge.calibration.inverse import knots_between
from weighbridge.calibration.regression import (
    TorqueFit,
    TorqueRows,
    at_point,
    build_rows,
    driven_slope,
    fit,
    join_rows,
)
from weighbridge.checks import refuse_serious, settle_drive
from weighbridge.errors import ConfigError, DriveError
from weighbridge.estimators.judging import HIDDEN_BRAKE_STD, WIDEST, cold_share
from weighbridge.estimators.regression import regression
from weighbridge.estimators.rls import block_jackknife
from weighbridge.estimators.squat import pooled, squat_at
from weighbridge.navigation.motion import BY_SPEED, Motion, with_squat
from weighbridge.navigation.select import find_motion
from weighbridge.pipeline.doubted_masses import doubted_masses, unbacked_scale, with_doubts
from weighbridge.pipeline.given import (
    GivenDrive,
    GivenVehicle,
    as_drives,
    as_vehicle,
    home_of,
    mapping_of,
)
from weighbridge.pipeline.joint_calibrating import NOT_TOLD, BalanceAt, JointProblem, noted, refine
from weighbridge.pipeline.known_mass import check_mass, scale_doubt
from weighbridge.pipeline.speed_calibrating import SpeedCalibration, calibrate_by_speed
from weighbridge.results.calibration import Calibration
from weighbridge.signals import Bools, Drive, Floats, Signal
from weighbridge.vehicle.as_read import as_read
from weighbridge.vehicle.classes import VehicleClass
from weighbridge.vehicle.fits import FITS, JOINT, RLS, Fit
from weighbridge.vehicle.gear import GearDetection, detect_gearings
from weighbridge.vehicle.model import (
    Driveline,
    Mounting,
    Provenance,
    RoadLoad,
    Timing,
    TorqueModel,
    Vehicle,
)
from weighbridge.vehicle.torque import DRAGGED_TIME, averaged, source_of
from weighbridge.vehicle.torque_sources import TORQUE_SOURCES, TorqueSource

FEW_SAMPLES: Final = 2000
"""Fewer usable samples, some twenty minutes of driving, make a poor calibration."""

MASSES_APART: Final = 0.01
"""A mass given and one that a drive states differ by more, and a note says so [-]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationSettings:
    """How a calibration is made.

    Attributes
    ----------
    order : highest power of engine speed in the torque regression; 2 for load
        and air flow, 0 for measured torque when None
    source : torque source; the best the drives have when None
    grid : solve on the grid of Jensen 2022, Table 5, in place of the bounds
    curved : let the torque per load change with engine speed and load; off for
        the regression of eq. 49 as printed
    method : estimator the vehicle is calibrated for: "joint", "rls" by eq. 48, or
        "speed-ekf", which fits a model of the speed alone
    """

    order: int | None = None
    source: str | None = None
    grid: bool = False
    curved: bool = True
    method: str = JOINT.name

    def __post_init__(self) -> None:
        if self.order is not None and not 0 <= self.order <= 4:
            raise ConfigError(f"order must be between 0 and 4, got {self.order}")
        if self.source is not None and self.source not in TORQUE_SOURCES:
            raise ConfigError(f"source must be one of {TORQUE_SOURCES.names}, got {self.source!r}")
        if self.method not in FITS:
            *most, last = FITS
            raise ConfigError(f"method must be {', '.join(most)} or {last}, got {self.method!r}")
        if self.grid and self.fit != RLS:
            raise ConfigError("the grid of Jensen 2022 is of method rls; calibrate with that")

    @property
    def fit(self) -> Fit:
        """What is fitted."""
        return FITS[self.method]


def calibrate(
    drives: GivenDrive | Sequence[GivenDrive],
    mass: float | Sequence[float] | None = None,
    *,
    vehicle: GivenVehicle | None = None,
    settings: CalibrationSettings | None = None,
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

    Raises
    ------
    DriveError, ConfigError
        A drive or an argument cannot be used; the sentence says why.
    """
    base = as_vehicle(vehicle) if vehicle is not None else None
    known = as_drives(drives, mapping_of(base, home_of(vehicle)))
    if settings is not None and not settings.fit.torque:
        return run_speed_calibration(known, mass, vehicle=base).vehicle
    return run_calibration(known, mass, vehicle=base, settings=settings).vehicle


def run_speed_calibration(
    drives: Drive | Sequence[Drive],
    mass: float | Sequence[float] | None = None,
    *,
    vehicle: Vehicle | None = None,
) -> SpeedCalibration:
    """As `calibrate` for the method "speed-ekf", keeping what was fitted."""
    drives, base, masses = _checked(drives, mass, vehicle)
    return calibrate_by_speed(drives, masses, base)


def _checked(
    drives: Drive | Sequence[Drive],
    mass: float | Sequence[float] | None,
    vehicle: Vehicle | None,
    source: str | None = None,
) -> tuple[list[Drive], Vehicle, list[float]]:
    """List the drives, what is known of the vehicle, and the drives' masses; check them."""
    drives = [drives] if isinstance(drives, Drive) else list(drives)
    base = vehicle or Vehicle(name=_name(drives))
    masses = _masses(drives, mass, base)
    model = TorqueModel(reference_torque=base.torque.reference_torque)
    if source is not None:
        # Friction in the torque is no fault here: the fit finds it as an offset.
        model = replace(model, source=source, coefficients=(-1.0, 1.0))
    known = replace(base, torque=model, witnesses=())
    settled = [settle_drive(drive, known) for drive in drives]
    for drive in settled:
        refuse_serious(drive.name, drive.problems)
    return settled, base, masses


def run_calibration(
    drives: Drive | Sequence[Drive],
    mass: float | Sequence[float] | None = None,
    *,
    vehicle: Vehicle | None = None,
    settings: CalibrationSettings | None = None,
) -> Calibration:
    """As `calibrate`, keeping what the report shows."""
    settings = settings or CalibrationSettings()
    if not settings.fit.torque:
        raise ConfigError(f"method {settings.method} has no torque fit; use run_speed_calibration")
    drives, base, masses = _checked(drives, mass, vehicle, settings.source)
    source = TORQUE_SOURCES[settings.source] if settings.source else best_source(drives, base)
    for drive in drives:
        if missing := source.lacking(drive):
            raise DriveError(
                f"{drive.name}: no {' and no '.join(missing)}, "
                f"which torque source {source.name!r} needs"
            )
        if why := source.refusal(drive, base.driveline.driven):
            raise DriveError(f"{drive.name}: {why}")
    given, base = base.driveline, _held(base, source)
    found_motions = [find_motion(drive, base) for drive in drives]
    motions, squat = _one_squat(found_motions, masses, base.of_class)

    gears, draft = _draft(drives, motions, base, source)
    driveline = draft.driveline
    modelled = not source.signed
    order = settings.order if settings.order is not None else (2 if modelled else 0)
    if order and not modelled:
        raise ConfigError(
            f"order {order}: torque source {source.name!r} has an offset and a scale only; "
            "leave --order out"
        )
    curved = settings.curved and modelled
    low, high = _bounds(base, driveline)
    floors = [source.floor(source.carrier(drive).values) for drive in drives]

    def rows_at(delay: float) -> TorqueRows:
        return join_rows(
            [
                _drive_rows(d, m, draft, source, kg, delay, order, curved, floor)
                for d, m, kg, floor in zip(drives, motions, masses, floors, strict=True)
            ]
        )

    def misfit(delay: float) -> float:
        rows = rows_at(delay)
        if rows.target.size < 20 * rows.design.shape[1]:
            return float("nan")
        return fit(rows, low, high, iterations=3).residual_std

    delay = best_delay(misfit)
    found = bool(np.isfinite(delay))
    if not found:
        delay = base.timing.torque_delay or 0.0
    rows = rows_at(delay)
    fitted = fit(rows, low, high)
    _refuse_nonsense(drives, fitted, rows, source, curved)
    if settings.grid:
        if not base.of_class.jensen_grid or driveline.single_speed:
            raise ConfigError(
                "the grid of Jensen 2022 is for cars with gears; calibrate without --grid"
            )
        coefficients, road, _ = grid_search(rows, fitted.weight)
        fitted = at_point(rows, fitted, coefficients, road)
    spread = delay_std(misfit, delay, fitted.independent_rows) if found else float("nan")
    speeds, loads = _ranges(drives, motions, draft, source, delay, floors)
    finished = replace(
        draft,
        driveline=_fitted_driveline(driveline, fitted),
        torque=replace(
            _fitted_torque(fitted, source, curved),
            reference_torque=base.torque.reference_torque,
            engine_efficiency=base.torque.engine_efficiency,
            load_range=loads,
            speed_range=speeds,
        ),
        road_load=_fitted_road_load(fitted),
        mounting=_mounting(motions, base.mounting, squat),
        timing=Timing(
            torque_delay=delay if found else base.timing.torque_delay,
            torque_delay_std=spread if np.isfinite(spread) else None,
        ),
        provenance=Provenance(
            drives=tuple(drive.name for drive in drives),
            masses=tuple(masses),
            date=datetime.date.today().isoformat(),
            r_squared=fitted.r_squared,
            residual_std=fitted.residual_std,
            samples=int(rows.target.size),
            method=RLS.name,
            motion=motions[0].source if len({m.source for m in motions}) == 1 else None,
            notes=_notes(fitted, low < high, rows.target.size, found),
        ),
    )
    learnt = dragged_reading(drives, motions, finished)
    witnesses, contradictions = learn_witnesses(drives, finished)
    finished = replace(
        finished,
        dragged=learnt or finished.dragged,
        witnesses=witnesses or finished.witnesses,
    )
    balances = tuple(force_balance(d, finished, m) for d, m in zip(drives, motions, strict=True))
    scale, scale_std = _self_weighing(balances, finished, masses)
    finished = replace(
        finished,
        torque=finished.torque.scaled(scale),
        provenance=replace(
            finished.provenance,
            mass_scale_std=float(
                np.sqrt(
                    scale_std**2 + source.transfer_std**2 + _misfit_std(fitted, low < high) ** 2
                )
            ),
        ),
    )
    if settings.fit.refined:
        asked = JointProblem(
            balance_at=_balance_at(
                drives, motions, replace(draft, dragged=finished.dragged), source, floors
            ),
            masses=masses,
            order=order,
            curved=curved,
            knots=() if driveline.single_speed else _knots(drives, motions, draft, source, delay),
            torque_noise=fitted.residual_std,
            known=base.driveline,
            by_speed=any(m.source in BY_SPEED for m in motions),
        )
        finished = refine(
            finished,
            asked,
            lambda car: [force_balance(d, car, m) for d, m in zip(drives, motions, strict=True)],
        )
    balances = tuple(force_balance(d, finished, m) for d, m in zip(drives, motions, strict=True))
    doubt = scale_doubt(finished, masses, ", ".join(drive.name for drive in drives))
    doubts = [*([doubt] if doubt else []), *doubted_masses(finished, balances, masses)]
    others = [*_other_masses(drives, masses), *doubts, *contradictions]
    finished = _with_doubts(finished, balances, [*others, *unbacked_scale(finished)])
    finished = with_doubts(finished, doubts)
    if source.gearing is not None:
        finished = _with_gears(finished, given)
    _refuse_useless(finished)
    return Calibration(vehicle=finished, gears=gears, balances=balances, fit=fitted, rows=rows)


def _with_doubts(
    vehicle: Vehicle, balances: Sequence[ForceBalance], notes: Sequence[str]
) -> Vehicle:
    """Note what is doubted of a calibration's drives, and count what is hidden in them."""
    for note in dict.fromkeys([*(n for balance in balances for n in balance.notes), *notes]):
        vehicle = noted(vehicle, note)
    if not any(balance.brake_hidden for balance in balances):
        return vehicle
    made = vehicle.provenance
    std = float(np.hypot(made.mass_scale_std or 0.0, HIDDEN_BRAKE_STD))
    return replace(vehicle, provenance=replace(made, mass_scale_std=std))


def _refuse_useless(vehicle: Vehicle) -> None:
    """Refuse a calibration with which no drive could be weighed.

    Raises
    ------
    DriveError
        It leaves more than `WIDEST` in every mass.
    """
    made = vehicle.provenance
    if made.mass_scale_std is not None and made.mass_scale_std > WIDEST:
        raise DriveError(
            f"the calibration would leave {100.0 * made.mass_scale_std:.0f} % in every mass, as "
            f"standard deviation, with which no drive can be weighed ({made.notes or 'no notes'}); "
            "check that every sample was recorded, and calibrate on other or longer drives"
        )


def _held(base: Vehicle, source: TorqueSource) -> Vehicle:
    """See a vehicle as the source reads it; what turns before the wheels is not fitted there."""
    if source.gearing is None:
        return base
    seen = as_read(base, source)
    return replace(seen, driveline=replace(seen.driveline, engine_inertia_std=0.0))


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


def _draft(
    drives: Sequence[Drive], motions: Sequence[Motion], base: Vehicle, source: TorqueSource
) -> tuple[GearDetection | None, Vehicle]:
    """Find the gears, where they are not known, and let the source stand for the torque."""
    gears = None
    driveline = replace(base.driveline, efficiency=1.0, speed_scale=_speed_scale(motions, base))
    if not driveline.gearings:
        gears = find_gears(drives, motions, idle_speed=base.driveline.idle_speed or None)
        driveline = replace(
            driveline,
            gearings=tuple(float(g) for g in gears.gearings),
            gearing_stds=tuple(float(g) for g in gears.stds),
        )
    model = TorqueModel(
        source="measured" if source.needs_map else source.name,
        reference_torque=base.torque.reference_torque,
        engine_efficiency=base.torque.engine_efficiency,
    )
    # A floor is told in the unit of its reading, and a witness is one of it.
    same = base.torque.source == source.name
    return gears, replace(
        base,
        driveline=driveline,
        torque=model,
        dragged=base.dragged if same else None,
        witnesses=base.witnesses if same else (),
    )


def _bounds(base: Vehicle, driveline: Driveline) -> tuple[Floats, Floats]:
    """Bounds of the road parameters; equal where a parameter is known."""
    low, high = base.of_class.road_bounds
    if driveline.single_speed:
        # One gear cannot tell the inertias from the mass, nor rolling resistance from an
        # offset of the torque.
        road = replace(base, driveline=driveline).road
        low[1:] = high[1:] = (
            road.rolling_coefficient.value,
            road.engine_inertia.value,
            road.wheel_inertia.value,
        )
    return low, high


def _balance_at(
    drives: Sequence[Drive],
    motions: Sequence[Motion],
    draft: Vehicle,
    source: TorqueSource,
    floors: Sequence[float],
) -> BalanceAt:
    """Return what makes the rows of drive ``k`` at a delay and a lag."""

    def rows(k: int, delay: float, lag: float) -> tuple[ForceBalance, Floats, Bools]:
        balance, x = _draft_balance(drives[k], motions[k], draft, source, delay, lag)
        return balance, x, _finite(balance, x, floors[k])

    return rows


def best_source(drives: Sequence[Drive], vehicle: Vehicle) -> TorqueSource:
    """Choose the torque source that all the drives have, the most direct first.

    Raises
    ------
    DriveError
        None of them has any.
    """
    for source in TORQUE_SOURCES.values():
        if not any(source.lacking(drive) for drive in drives):
            reference = vehicle.torque.reference_torque is not None or all(
                drive.has("reference_torque") for drive in drives
            )
            if reference or not source.needs_reference:
                return source
    raise DriveError(
        f"{', '.join(drive.name for drive in drives)}: not every drive has engine_torque, "
        "engine_torque_fraction, engine_load or mass_air_flow; a calibration needs "
        "one of them and engine_speed"
    )


def find_gears(
    drives: Sequence[Drive], motions: Sequence[Motion], *, idle_speed: float | None = None
) -> GearDetection:
    """Find the gearings from all the drives together.

    Raises
    ------
    DriveError
        No engine speed, or no ratio stands out.
    """
    times, engine, speeds = [], [], []
    offset = 0.0
    for drive, motion in zip(drives, motions, strict=True):
        signal = drive.get("engine_speed")
        if signal is None or len(signal) < 30:
            raise DriveError(
                f"{drive.name}: no engine_speed, so no gear can be found; give gearings in the "
                "vehicle file"
            )
        instants = signal.time - motion.speed_delay
        inside = (instants >= motion.time[0]) & (instants <= motion.time[-1])
        times.append(instants[inside] + offset)
        engine.append(signal.values[inside])
        speeds.append(np.interp(instants[inside], motion.time, motion.speed))
        offset += float(signal.time[-1]) + 100.0
    return detect_gearings(
        np.concatenate(times),
        np.concatenate(engine),
        np.concatenate(speeds),
        idle_speed=idle_speed,
    )


def _name(drives: Sequence[Drive]) -> str:
    """Take the vehicle's name from the first drive that tells it."""
    return next((drive.info.vehicle for drive in drives if drive.info.vehicle), "vehicle")


def _masses(
    drives: Sequence[Drive], mass: float | Sequence[float] | None, base: Vehicle
) -> list[float]:
    if not drives:
        raise ConfigError("no drive to calibrate with")
    if mass is None:
        known = [drive.info.mass for drive in drives]
    elif isinstance(mass, Sequence):
        known = list(mass)
        if len(known) != len(drives):
            raise ConfigError(f"{len(known)} masses for {len(drives)} drives; give one for each")
    else:
        known = [mass] * len(drives)
    for drive, kg in zip(drives, known, strict=True):
        if kg is None:
            raise ConfigError(
                f"{drive.name}: its mass is not known; give --mass, or mass_kg in its drive.toml"
            )
        check_mass(drive, kg, base)
    return [float(kg) for kg in known if kg is not None]


def _other_masses(drives: Sequence[Drive], masses: Sequence[float]) -> list[str]:
    """Say where a mass that was given differs from the one its drive states."""
    return [
        f"{drive.name} states a mass of {drive.info.mass:.0f} kg and was calibrated with the "
        f"{kg:.0f} kg given"
        for drive, kg in zip(drives, masses, strict=True)
        if drive.info.mass is not None and abs(kg / drive.info.mass - 1.0) > MASSES_APART
    ]


def _finite(balance: ForceBalance, x: Floats, floor: float) -> Bools:
    view = balance.merged
    period = float(np.median(np.diff(view.time)))
    return np.asarray(
        view.usable
        & (averaged(x, period, DRAGGED_TIME) >= floor)
        & np.isfinite(view.specific_force)
        & np.isfinite(view.gearing)
        & np.isfinite(x)
        & np.isfinite(balance.merged.engine_speed)
    )


def _usable(balance: ForceBalance, x: Floats, floor: float) -> Bools:
    return _finite(balance, x, floor) & (balance.merged.accel > 0.0)


def _drive_rows(
    drive: Drive,
    motion: Motion,
    draft: Vehicle,
    source: TorqueSource,
    mass: float,
    delay: float,
    order: int,
    curved: bool,
    floor: float,
) -> TorqueRows:
    balance, x = _draft_balance(drive, motion, draft, source, delay)
    return build_rows(
        balance.merged,
        x,
        balance.merged.engine_speed,
        mass=mass,
        wheel_radius=draft.driveline.wheel_radius,
        order=order,
        curved=curved,
        rows=_usable(balance, x, floor),
    )


def _draft_balance(
    drive: Drive,
    motion: Motion,
    draft: Vehicle,
    source: TorqueSource,
    delay: float,
    lag: float = 0.0,
) -> tuple[ForceBalance, Floats]:
    """Balance without a torque model yet, and the torque source at its stamps."""
    stamps = source.carrier(drive).time
    x = source.reading(drive, stamps, draft.torque)
    stand_in = drive
    if source.needs_map:
        stand_in = drive.with_signals(Signal("engine_torque", stamps, x))
    balance = force_balance(stand_in, draft, motion, delay=delay, lag=lag, signed=source.signed)
    return balance, x


def _ranges(
    drives: Sequence[Drive],
    motions: Sequence[Motion],
    draft: Vehicle,
    source: TorqueSource,
    delay: float,
    floors: Sequence[float],
) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    """Engine speeds and loads that the regression has seen, a little widened."""
    if source.signed:
        return None, None
    speeds, loads = [], []
    for drive, motion, floor in zip(drives, motions, floors, strict=True):
        balance, x = _draft_balance(drive, motion, draft, source, delay)
        rows = _usable(balance, x, floor)
        speeds.append(balance.merged.engine_speed[rows])
        loads.append(x[rows])
    speed, load = np.concatenate(speeds), np.concatenate(loads)
    slow, fast = np.percentile(speed, [0.1, 99.9])
    high = float(np.max(load))
    return (float(0.95 * slow), float(1.05 * fast)), (float(min(floors)), 1.02 * high)


def _knots(
    drives: Sequence[Drive],
    motions: Sequence[Motion],
    draft: Vehicle,
    source: TorqueSource,
    delay: float,
) -> tuple[float, ...]:
    """Engine speeds at which the torque per reading may differ from a straight line [rad/s]."""
    turned = []
    for drive, motion in zip(drives, motions, strict=True):
        balance, x = _draft_balance(drive, motion, draft, source, delay)
        turned.append(balance.merged.engine_speed[_finite(balance, x, -np.inf)])
    speed = np.concatenate(turned)
    if speed.size < FEW_SAMPLES // 10:
        return ()
    slow, fast = np.percentile(speed, [1.0, 99.0])
    return knots_between(float(slow), float(fast))


def _speed_scale(motions: Sequence[Motion], base: Vehicle) -> float:
    known = [
        (m.speed_scale, m.speed_scale_std)
        for m in motions
        if m.speed_scale is not None and m.speed_scale_std is not None
    ]
    if not known:
        return base.driveline.speed_scale
    weight = np.array([1.0 / std**2 for _, std in known])
    return float(np.average([scale for scale, _ in known], weights=weight))


def _one_squat(
    motions: list[Motion], masses: Sequence[float], kind: VehicleClass
) -> tuple[list[Motion], tuple[float, float] | None]:
    """Take the same squat out of all drives: that of the vehicle, with its standard deviation."""
    found = pooled(motions, masses, kind)
    if found is None:
        return motions, None
    squat, std = found
    held = [
        with_squat(motion, squat_at(squat, mass, masses, kind), std)
        for motion, mass in zip(motions, masses, strict=True)
    ]
    return held, found


def _mounting(
    motions: Sequence[Motion], known: Mounting | None, squat: tuple[float, float] | None
) -> Mounting | None:
    for motion in motions:
        if motion.mounting is not None:
            roll, pitch, yaw = motion.mounting
            return Mounting(
                roll=roll,
                pitch=pitch,
                yaw=yaw,
                std=motion.mounting_std,
                squat=squat[0] if squat else None,
                squat_std=squat[1] if squat else None,
            )
    return known


def _self_weighing(
    balances: Sequence[ForceBalance], vehicle: Vehicle, masses: Sequence[float]
) -> tuple[float, float]:
    """Weigh the calibration drives: true over found mass, and its standard deviation.

    Noise in load and acceleration pulls the torque fit and the weighing in
    different directions; what they leave on the drives of known mass is taken
    out here.
    """
    time, phi, whole, rest, cold = [], [], [], [], []
    offset = 0.0
    for balance, mass in zip(balances, masses, strict=True):
        view = balance.merged
        x, target = regression(view, vehicle)
        used = (view.reason == Reason.USED) & (view.accel > 0.0)
        used &= np.isfinite(x) & np.isfinite(target)
        if not used.any():
            continue
        instants = view.time[used] - view.time[0]
        cold.append((float(np.sum(x[used] ** 2)), cold_share(view.time, x, used)))
        time.append(instants + offset)
        phi.append(x[used] * mass)
        whole.append(target[used])
        rest.append((view.traction_force - target)[used])
        offset += float(instants[-1]) + 1e3
    every = np.ones(sum(t.size for t in time), dtype=bool)
    joined = np.concatenate(time), np.concatenate(phi)
    found, std, _ = block_jackknife(*joined, np.concatenate(whole), every)
    resisted, _, _ = block_jackknife(*joined, np.concatenate(rest), every)
    weights, shares = np.array(cold).T
    warming = source_of(vehicle).cold_std * float(np.average(shares, weights=weights))
    return (1.0 + resisted) / (found + resisted), float(np.hypot(std / found, warming))


def _refuse_nonsense(
    drives: Sequence[Drive], fitted: TorqueFit, rows: TorqueRows, source: TorqueSource, curved: bool
) -> None:
    """Raise where torque does not rise with its source: nothing can be weighed by it."""
    slope, std = driven_slope(fitted, rows, curved=curved)
    if not slope > 3.0 * std:
        raise DriveError(
            f"{', '.join(drive.name for drive in drives)}: torque does not rise with its source "
            f"{source.signals[0]} ({slope:.3g} ± {std:.2g} N m per unit at the loads and engine "
            "speeds driven); check the signal, its unit and the known mass, or calibrate with "
            "another --torque"
        )


def _misfit_std(fitted: TorqueFit, free: Bools) -> float:
    """Relative uncertainty of every mass by what the fit did not explain or hold off bounds."""
    bounds = sum(
        open_ and name in fitted.at_bound
        for name, open_ in zip(ROAD_PARAMETERS[:2], free[:2], strict=True)
    )
    return float(np.hypot(0.3 * max(0.0, 1.0 - fitted.r_squared), 0.03 * bounds))


def _notes(fitted: TorqueFit, free: Bools, samples: int, delay_found: bool) -> str | None:
    """Say what a reader of the vehicle file should know of its making."""
    held = [
        name
        for name, open_ in zip(ROAD_PARAMETERS, free, strict=True)
        if open_ and name in fitted.at_bound
    ]
    notes = ["held by a bound: " + ", ".join(held)] if held else []
    if samples < FEW_SAMPLES:
        notes.append(f"made from {samples} samples only; poll faster, or drive longer")
    if not delay_found:
        notes.append(NOT_TOLD)
    return "; ".join(notes) or None


def _known(std: float) -> float | None:
    """Standard deviation of what was free; None for what a bound held."""
    return float(std) if std > 0.0 else None


def _fitted_driveline(known: Driveline, fitted: TorqueFit) -> Driveline:
    stds = np.sqrt(np.diag(fitted.cov))
    return replace(
        known,
        engine_inertia=float(fitted.road[2]),
        engine_inertia_std=_known(stds[-2]),
        wheel_inertia=float(fitted.road[3]),
        wheel_inertia_std=_known(stds[-1]),
    )


def _fitted_torque(fitted: TorqueFit, source: TorqueSource, curved: bool) -> TorqueModel:
    straight = fitted.coefficients.size - 2 * curved
    values = [float(w) for w in fitted.coefficients]
    stds = [float(w) for w in np.sqrt(np.diag(fitted.cov))[: fitted.coefficients.size]]
    return TorqueModel(
        source=source.name,
        coefficients=tuple(values[:straight]),
        coefficient_stds=tuple(stds[:straight]),
        curvature=tuple(values[straight:]),
        curvature_stds=tuple(stds[straight:]),
        noise=fitted.residual_std,
    )


def _fitted_road_load(fitted: TorqueFit) -> RoadLoad:
    stds = np.sqrt(np.diag(fitted.cov))
    return RoadLoad(
        drag_area=float(fitted.road[0]),
        rolling_coefficient=float(fitted.road[1]),
        drag_area_std=_known(stds[-4]),
        rolling_coefficient_std=_known(stds[-3]),
    )
