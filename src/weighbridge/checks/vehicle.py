"""Is a drive of one vehicle? Its gears, and its reference torque, do not change on the way."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.signals import Drive, Floats, Problem
from weighbridge.signals.instants import instant
from weighbridge.vehicle.gear import detect_gearings, effective_gearing, steady
from weighbridge.vehicle.model import TorqueModel, Vehicle
from weighbridge.vehicle.torque_sources import SAME_REFERENCE, reference_torques

# Whoever changes vehicles takes longer than this [s], and the vehicle left stands.
_PAUSE: Final = 5.0
_STANDS: Final = 0.5  # [m/s]
# The longest pauses only: where vehicles are changed, there is a long one.
_PAUSES: Final = 6
# Samples in gear enough to know the gears of a part.
_ENOUGH: Final = 150
# A gear's ratio is sharper than this [-].
_NEAR: Final = 0.02
# Parts of the samples that lie on the gears of their own part, and on those of the other one:
# six gears and their surroundings cover some 15 % of all ratios by chance.
_OWN: Final = 0.7
_FOREIGN: Final = 0.35
# Gears that both parts must show, and the part of a part's samples that shows one.
_GEARS: Final = 3
_SHOWN: Final = 0.02
# Samples below show slip of converter and clutch, and the steps of the speed [m/s].
_SLOW: Final = 4.0


def check_vehicle(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find a second vehicle in a drive by what is the same all the time in one."""
    yield from _check_reference(drive, vehicle)
    yield from _check_gears(drive)


def _check_reference(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find several reference torques, or another than that of the calibration."""
    reference = drive.get("reference_torque")
    if reference is None or len(reference) < 2:
        return
    reported = reference_torques(reference)
    model = TorqueModel() if vehicle is None else vehicle.torque
    if len(reported) < 2:
        told, known = reported[0][0] if reported else None, model.told_reference_torque
        if told and known and abs(told / known - 1.0) > SAME_REFERENCE:
            yield Problem(
                reference.name,
                f"reference_torque is {told:.0f} N m, and was {known:.0f} N m in the calibration: "
                "it is a constant of an engine, and a mass would be wrong by as much if the "
                "percentages are of the same torque as before; correct it where it is wrong, "
                "calibrate again where the engine is another or mapped anew, or name "
                "reference_torque in trusted of drive.toml where it is right",
                serious=model.of_source.needs_reference,
            )
        stated = model.reference_torque if known is None else None
        if told and stated and abs(told / stated - 1.0) > SAME_REFERENCE:
            yield Problem(
                reference.name,
                f"reference_torque is {told:.0f} N m in the drive, which was taken, and "
                f"{stated:.0f} N m in the vehicle file: the vehicle file is another vehicle's, or "
                "reference_torque_nm under [torque] is wrong",
            )
        return
    values = np.array([value for value, _ in reported])
    nearest = np.argmin(np.abs(reference.values[:, None] - values[None, :]), axis=1)
    once = bool(np.count_nonzero(np.diff(nearest)) < len(reported))
    which = " and ".join(f"{value:.0f} N m from {instant(time)}" for value, time in reported)
    said = (
        f"reference_torque is {which}{'' if once else ', in turn'}: it is a constant of an engine"
    )
    unknown = not model.stated
    of_reference = model.of_source.needs_reference
    if (unknown or of_reference) and model.reference_torque is not None:
        yield Problem(
            reference.name,
            f"{said}; the {model.reference_torque:.0f} N m of the vehicle file were taken all the "
            "time; split the recording if it holds two vehicles",
        )
        return
    guess = "so these are two vehicles" if once else "so one is not of the engine that is weighed"
    split = "split the recording where it changes, or " if once else ""
    yield Problem(
        reference.name,
        f"{said}, {guess}; {split}state the right one as reference_torque_nm under [torque] of "
        "the vehicle file",
        # In turn it says nothing of two vehicles, and only percent torque needs it.
        serious=once or unknown or of_reference,
    )


def _check_gears(drive: Drive) -> Iterator[Problem]:
    """Compare the ratios of engine to vehicle speed before and after each long pause."""
    engine, speed = drive.get("engine_speed"), drive.get("vehicle_speed")
    if engine is None or speed is None or len(speed) < _ENOUGH or len(engine) < 2 * _ENOUGH:
        return
    time = engine.time
    wheels = np.where(speed.age(time) < 1.0, speed.at(time), np.nan)
    gearing = effective_gearing(engine.values, wheels)
    with np.errstate(invalid="ignore", divide="ignore"):
        moving = np.isfinite(gearing) & (wheels > _SLOW) & (gearing > 0.0)
        moving &= steady(time, gearing, _NEAR + 0.15 / np.maximum(wheels, 1.0))
    if np.count_nonzero(moving) < 2 * _ENOUGH:
        return
    for cut in _pauses(time, wheels):
        parts = [moving & (time < cut), moving & (time >= cut)]
        if min(np.count_nonzero(p) for p in parts) < _ENOUGH:
            continue
        if _in_common(*(gearing[p] for p in parts)) > _FOREIGN + 1.0 - _OWN:
            continue
        before, after = (_gears(time[p], engine.values[p], wheels[p], gearing[p]) for p in parts)
        if not _apart(before, after):
            continue
        own = (_on(gearing[parts[0]], before), _on(gearing[parts[1]], after))
        foreign = (_on(gearing[parts[0]], after), _on(gearing[parts[1]], before))
        if min(own) > _OWN and max(foreign) < _FOREIGN:
            yield Problem(
                "engine_speed",
                f"the gears change at {instant(cut)}: {100.0 * own[0]:.0f} % of the samples before "
                f"lie on gears of their own and {100.0 * foreign[0]:.0f} % on those after, as with "
                "two vehicles in one recording; split it there if so",
            )
            return


def _pauses(time: Floats, wheels: Floats) -> list[float]:
    """Middles of the longest times in which a vehicle could have been changed."""
    with np.errstate(invalid="ignore"):
        driving = time[wheels > _STANDS]
    if driving.size < 2:
        return []
    length = np.diff(driving)
    longest = np.argsort(-length, kind="stable")[:_PAUSES]
    return [float(driving[k] + 0.5 * length[k]) for k in longest if length[k] > _PAUSE]


def _gears(time: Floats, engine_speed: Floats, wheels: Floats, gearing: Floats) -> Floats:
    """Gears that a part of a drive shows well; empty where it shows none."""
    try:
        found = detect_gearings(time, engine_speed, wheels, idle_speed=0.0).gearings
    except DriveError:
        return np.empty(0)
    return np.array([g for g in found if _on(gearing, np.array([g])) > _SHOWN])


def _in_common(before: Floats, after: Floats) -> float:
    """Part of the samples that two parts have in common, by the distribution of their ratios.

    Where it is large, samples of one part lie on gears of the other, whatever the gears are.
    """
    a, b = (np.rint(np.log(part) / _NEAR).astype(np.int64) for part in (before, after))
    least = min(a.min(), b.min())
    size = max(a.max(), b.max()) - least + 1
    shares = (np.bincount(part - least, minlength=size) / part.size for part in (a, b))
    return float(np.minimum(*shares).sum())


def _apart(a: Floats, b: Floats) -> bool:
    """Tell whether two sets of gears cannot be of one gearbox.

    Gears that one part never used lie beside those it used. Between the gears of one gearbox
    there are none of its own.
    """
    if min(a.size, b.size) < _GEARS:
        return False
    near = np.abs(np.log(a[:, None] / b[None, :])) < 1.5 * _NEAR
    between = [np.count_nonzero((x > y.min()) & (x < y.max())) for x, y in ((a, b), (b, a))]
    alike = np.count_nonzero(near.any(axis=1))
    return bool(min(between) >= _GEARS - 1 and alike <= 0.25 * min(a.size, b.size))


def _on(gearing: Floats, gears: Floats) -> float:
    """Part of the samples that lie on one of the gears."""
    near = np.abs(np.log(gearing[:, None] / gears[None, :])).min(axis=1)
    return float(np.mean(near < 1.5 * _NEAR))
