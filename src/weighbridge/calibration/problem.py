"""From drives and masses as given to one problem that every fit of the torque reads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from numbers import Real

import numpy as np

from weighbridge.arguments import check_number, check_type
from weighbridge.balance.gear_fit import ENOUGH, ratio_apart, share_on_gears
from weighbridge.balance.hybrid import motor_helps
from weighbridge.calibration.inverse import knots_between
from weighbridge.calibration.known_mass import check_mass
from weighbridge.calibration.recording import Recording
from weighbridge.calibration.settings import CalibrationSettings
from weighbridge.checks import correct_drive, refuse_serious
from weighbridge.errors import ConfigError
from weighbridge.estimators.squat import pooled, squat_at
from weighbridge.limits import FEW, MANY
from weighbridge.messages import refused
from weighbridge.navigation import BY_SPEED, Motion, find_motion, with_squat, without_accelerometer
from weighbridge.signals import Drive, Floats
from weighbridge.vehicle import (
    TORQUE_SOURCES,
    Driveline,
    GearDetection,
    Mounting,
    TorqueModel,
    TorqueSource,
    Vehicle,
    VehicleClass,
    detect_gearings,
    find_engine_delay,
    gathered_delay,
    identify_air,
    idling,
    part_of_a_hybrid,
    sources_of,
    stepless_range,
)
from weighbridge.vehicle.as_read import as_read
from weighbridge.vehicle.gear import BESIDE


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """What is fitted, and to what.

    Attributes
    ----------
    recordings : the drives of known mass
    base : what is known of the vehicle, as its torque source sees it
    draft : the same with gears, source, second signals and mounting found, without a torque model
    given : driveline of the vehicle file given to the calibration
    gears : ratios found; None where they were given
    source : of the torque
    order, curved : of the torque regression
    grid : search the grid of Jensen 2022
    """

    recordings: tuple[Recording, ...]
    base: Vehicle
    draft: Vehicle
    given: Driveline
    gears: GearDetection | None
    source: TorqueSource
    order: int
    curved: bool

    @property
    def masses(self) -> list[float]:
        """Known mass of each drive as it begins [kg]."""
        return [r.mass for r in self.recordings]

    @property
    def names(self) -> str:
        """Names of the drives, for messages."""
        return ", ".join(r.drive.name for r in self.recordings)

    @property
    def by_speed(self) -> bool:
        """Whether a drive has no accelerometer."""
        return any(r.motion.source in BY_SPEED for r in self.recordings)

    def knots(self, turning: Floats) -> tuple[float, ...]:
        """Engine speeds at which the torque per reading may leave a straight line [rad/s].

        Parameters
        ----------
        turning : (n,) engine speeds of the usable rows [rad/s]
        """
        if self.draft.driveline.single_speed or turning.size < MANY:
            return ()
        slow, fast = np.percentile(turning, [1.0, 99.0])
        return knots_between(float(slow), float(fast))


def checked(
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
    corrected = [correct_drive(drive, known) for drive in drives]
    for drive in corrected:
        refuse_serious(drive.name, drive.problems)
    return corrected, base, masses


def problem_of(
    drives: Drive | Sequence[Drive],
    mass: float | Sequence[float] | None,
    vehicle: Vehicle | None,
    settings: CalibrationSettings,
    progress: Callable[[int, int], None] | None = None,
) -> Problem:
    """Check what was given, and find motion, gears and torque source of the drives.

    ``progress`` is informed of drives done of all.

    Raises
    ------
    DriveError, ConfigError
        A drive or a setting cannot be used.
    """
    drives, base, masses = checked(drives, mass, vehicle, settings.source)
    if settings.fit.by_speed:
        drives = [without_accelerometer(drive) for drive in drives]
    source = TORQUE_SOURCES[settings.source] if settings.source else best_source(drives, base)
    for drive in drives:
        if missing := source.lacking(drive):
            raise refused(
                "calibration.no_torque",
                drive=drive.name,
                missing=" and no ".join(missing),
                source=source.name,
            )
        why = source.refusal(drive, base.driveline.driven) or part_of_a_hybrid(base, source)
        if why:
            raise why.at(drive.name).error()
    given, base = base.driveline, _held(base, source)
    found = []
    for drive in drives:
        found.append(find_motion(drive, base))
        if progress is not None:
            progress(len(found), len(drives))
    if source.of_all_motors and _stepless(drives, found, None) is None:
        raise refused("hybrid.geared", title=source.title)
    motions, squat = _one_squat(found, masses, base.of_class)
    gears, draft = _draft(drives, motions, base, source)
    draft = replace(draft, mounting=_mounting(motions, base.mounting, squat))
    modelled = not source.signed
    order = settings.order if settings.order is not None else (2 if modelled else 0)
    if order and not modelled:
        raise ConfigError(
            f"order {order}: torque source {source.name!r} has an offset and a scale only; "
            "leave --order out"
        )
    recordings = tuple(
        Recording.of(*one, draft, source) for one in zip(drives, motions, masses, strict=True)
    )
    if (given.gearings or given.stepless) and source.gearing is None:
        _refuse_foreign_gears(recordings)
    for recording in recordings:
        if why := motor_helps(recording.drive, recording.balance(0.0), draft):
            raise why.at(recording.drive.name).error()
    return Problem(
        recordings=recordings,
        base=base,
        draft=draft,
        given=given,
        gears=gears,
        source=source,
        order=order,
        curved=settings.curved and modelled,
    )


def _charge(drives: Sequence[Drive], motions: Sequence[Motion]) -> float | None:
    """Mean charge of an engine in the air of the drives [-]; None where it is not known of each."""
    charges = []
    for drive, motion in zip(drives, motions, strict=True):
        air = identify_air(drive, motion.altitude)
        if not air.known:
            return None
        charges.append(np.mean(np.log(air.charge(motion.altitude))))
    return float(np.exp(np.mean(charges)))


def _refuse_foreign_gears(recordings: Sequence[Recording]) -> None:
    """Refuse gears that were given and are not those of the drives, as `weigh` would.

    Raises
    ------
    DriveError
        A drive's ratios of engine to vehicle speed lie elsewhere.
    """
    for recording in recordings:
        balance = recording.balance(0.0)
        share = share_on_gears(balance, recording.draft)
        if share is not None and share < ENOUGH:
            seen, expected = ratio_apart(balance, recording.draft)
            raise refused(
                "calibration.foreign_gears",
                drive=recording.drive.name,
                share=100.0 * share,
                seen=seen,
                expected=expected,
            )


def _held(base: Vehicle, source: TorqueSource) -> Vehicle:
    """See a vehicle as the source reads it; what turns before the wheels is not fitted there."""
    if source.gearing is None:
        return base
    seen = as_read(base, source)
    return replace(seen, driveline=replace(seen.driveline, engine_inertia_std=0.0))


def _draft(
    drives: Sequence[Drive], motions: Sequence[Motion], base: Vehicle, source: TorqueSource
) -> tuple[GearDetection | None, Vehicle]:
    """Find the gears, where they are not known, and let the source take the torque's place."""
    gears = None
    driveline = replace(base.driveline, efficiency=1.0, speed_scale=_speed_scale(motions, base))
    idle = base.driveline.idle_speed or None
    if not driveline.gearings and not driveline.stepless:
        driveline = replace(driveline, gearing_range=_stepless(drives, motions, idle))
    if not driveline.gearings and not driveline.stepless:
        gears = find_gears(drives, motions, idle_speed=idle)
        driveline = replace(
            driveline,
            gearings=tuple(float(g) for g in gears.gearings),
            gearing_stds=tuple(float(g) for g in gears.stds),
        )
    turning = all(len(drive.get("engine_speed") or ()) for drive in drives)
    if turning and not driveline.single_speed and not driveline.idle_speed:
        driveline = replace(driveline, idle_speed=_warm_idle(drives, motions))
    model = TorqueModel(
        source="measured" if source.needs_map else source.name,
        reference_torque=base.torque.reference_torque,
        engine_efficiency=base.torque.engine_efficiency,
        charge=_charge(drives, motions) if source.charge_exponent[0] else None,
    )
    # A floor is reported in the unit of its reading, and a second signal is one of it.
    same = base.torque.source == source.name
    return gears, replace(
        base,
        driveline=driveline,
        torque=model,
        dragged=base.dragged if same else None,
        witnesses=base.witnesses if same else (),
    )


def best_source(drives: Sequence[Drive], vehicle: Vehicle) -> TorqueSource:
    """Choose the torque source that all the drives have, the most direct first.

    Raises
    ------
    DriveError
        None of them has any.
    """
    for source in (*sources_of(vehicle), *TORQUE_SOURCES.values()):
        if not any(source.lacking(drive) for drive in drives):
            reference = vehicle.torque.reference_torque is not None or all(
                drive.has("reference_torque") for drive in drives
            )
            if reference or not source.needs_reference:
                return source
    raise refused("calibration.no_source", drives=", ".join(drive.name for drive in drives))


def find_gears(
    drives: Sequence[Drive], motions: Sequence[Motion], *, idle_speed: float | None = None
) -> GearDetection:
    """Find the gearings from all the drives together, as many as their gear signals show at most.

    Raises
    ------
    DriveError
        No engine speed, one that is too slow, or no ratio stands out.
    """
    for drive in drives:
        signal = drive.get("engine_speed")
        if signal is None or len(signal) < 30:
            raise refused("calibration.no_engine_speed", drive=drive.name)
        if signal.period >= BESIDE:
            raise refused(
                "calibration.slow_engine_speed", drive=drive.name, period=signal.period, most=BESIDE
            )
    found = detect_gearings(*_aligned(drives, motions), idle_speed=idle_speed)
    found = detect_gearings(*_aligned(drives, motions, found.gearings), idle_speed=idle_speed)
    reported = _reported_gears(drives)
    if not reported or found.gearings.size <= reported:
        return found
    # Ratios that were passed on the way from gear to gear have few samples.
    kept = np.sort(np.argsort(-found.counts, kind="stable")[:reported])
    return replace(
        found,
        gearings=found.gearings[kept],
        stds=found.stds[kept],
        counts=found.counts[kept],
    )


def _stepless(
    drives: Sequence[Drive], motions: Sequence[Motion], idle_speed: float | None
) -> tuple[float, float] | None:
    """Range of gearings of all the drives together; None where they show no stepless gearbox."""
    if not all(len(drive.get("engine_speed") or ()) for drive in drives):
        return None
    return stepless_range(*_aligned(drives, motions), idle_speed=idle_speed)


def _aligned(
    drives: Sequence[Drive], motions: Sequence[Motion], gearings: Floats | None = None
) -> tuple[Floats, Floats, Floats]:
    """Engine and vehicle speed of all drives, each brought together; gears may be unknown."""
    late = []
    for drive, motion in zip(drives, motions, strict=True):
        engine, seen = drive.signals["engine_speed"], (motion.time, motion.speed)
        late.append(
            gathered_delay(engine.time, engine.values, seen, motion.speed_delay)
            if gearings is None
            else find_engine_delay(engine.time, engine.values, seen, gearings, motion.speed_delay)
        )
    return _engine_and_speed(drives, motions, late)


def _reported_gears(drives: Sequence[Drive]) -> int:
    """Forward gears that the gear signals of the drives show together; 0 where one has none."""
    gears: set[float] = set()
    for drive in drives:
        signal = drive.get("gear")
        if signal is None:
            return 0
        value, count = np.unique(signal.values[signal.values > 0.0], return_counts=True)
        gears |= set(value[count >= FEW].tolist())
    return len(gears)


def _warm_idle(drives: Sequence[Drive], motions: Sequence[Motion]) -> float:
    """Lowest of the idle speeds of the drives, as a cold engine idles faster [rad/s]; 0 if none."""
    found = []
    for drive, motion in zip(drives, motions, strict=True):
        _, engine_speed, speed = _engine_and_speed([drive], [motion], [motion.speed_delay])
        found.append(idling(engine_speed, speed))
    return min((idle for idle in found if idle > 0.0), default=0.0)


def _engine_and_speed(
    drives: Sequence[Drive], motions: Sequence[Motion], late: Sequence[float]
) -> tuple[Floats, Floats, Floats]:
    """Instants of all drives [s], engine speed [rad/s] and speed of the vehicle there [m/s].

    ``late`` is by how much the engine speed of each drive is [s].
    """
    times, engine, speeds = [], [], []
    offset = 0.0
    for drive, motion, delay in zip(drives, motions, late, strict=True):
        signal = drive.signals["engine_speed"]
        instants = signal.time - delay
        inside = (instants >= motion.time[0]) & (instants <= motion.time[-1])
        times.append(instants[inside] + offset)
        engine.append(signal.values[inside])
        speeds.append(np.interp(instants[inside], motion.time, motion.speed))
        offset += float(signal.time[-1]) + 100.0
    return np.concatenate(times), np.concatenate(engine), np.concatenate(speeds)


def _name(drives: Sequence[Drive]) -> str:
    """Take the vehicle's name from the first drive that shows it."""
    return next((drive.info.vehicle for drive in drives if drive.info.vehicle), "vehicle")


def _masses(
    drives: Sequence[Drive], mass: float | Sequence[float] | None, base: Vehicle
) -> list[float]:
    if not drives:
        raise ConfigError("no drive to calibrate with")
    if mass is not None:
        kinds = (Real, list, tuple, np.ndarray)
        check_type("mass", mass, kinds, "a number of kg, or a list of one for each drive")
    if mass is None:
        known = [drive.info.mass for drive in drives]
    elif isinstance(mass, Sequence | np.ndarray):
        known = list(mass)
        if len(known) != len(drives):
            raise ConfigError(f"{len(known)} masses for {len(drives)} drives; give one for each")
    else:
        known = [mass] * len(drives)
    for drive, kg in zip(drives, known, strict=True):
        check_number("mass", kg, optional=True)
        if kg is None:
            raise ConfigError(
                f"{drive.name}: its mass is not known; give --mass, or mass_kg in its drive.toml"
            )
        check_mass(drive, kg, base)
    return [float(kg) for kg in known if kg is not None]


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
