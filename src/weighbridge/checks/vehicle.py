"""Is a drive of one vehicle? Its gears, and its reference torque, do not change on the way."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.limits import MANY, STANDS
from weighbridge.messages import phrase
from weighbridge.signals import Drive, Floats, Problem
from weighbridge.signals.instants import instant
from weighbridge.vehicle import TorqueModel, Vehicle, detect_gearings, effective_gearing
from weighbridge.vehicle.gear import steady
from weighbridge.vehicle.reported_torque import SAME_REFERENCE, reference_torques

# Whoever changes vehicles takes longer than this [s], and the vehicle left stands.
_PAUSE: Final = 5.0
# The longest pauses only: where vehicles are changed, there is a long one.
_PAUSES: Final = 6

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
        noted, known = reported[0][0] if reported else None, model.reported_reference_torque
        if noted and known and abs(noted / known - 1.0) > SAME_REFERENCE:
            yield Problem.of(
                "torque.reference_changed",
                reference.name,
                serious=model.of_source.needs_reference,
                now=noted,
                known=known,
            )
        stated = model.reference_torque if known is None else None
        if noted and stated and abs(noted / stated - 1.0) > SAME_REFERENCE:
            yield Problem.of("torque.reference_file", reference.name, now=noted, stated=stated)
        return
    values = np.array([value for value, _ in reported])
    nearest = np.argmin(np.abs(reference.values[:, None] - values[None, :]), axis=1)
    once = bool(np.count_nonzero(np.diff(nearest)) < len(reported))
    which = " and ".join(
        phrase("reference_from", value=value, at=instant(time)) for value, time in reported
    )
    said = phrase("reference_is" if once else "reference_in_turn", which=which)
    unknown = not model.stated
    of_reference = model.of_source.needs_reference
    if (unknown or of_reference) and model.reference_torque is not None:
        yield Problem.of(
            "torque.references_taken", reference.name, said=said, taken=model.reference_torque
        )
        return
    guess = phrase("two_vehicles") if once else phrase("one_not_of_engine")
    split = phrase("split_or") if once else ""
    yield Problem.of(
        "torque.references",
        reference.name,
        serious=once or unknown or of_reference,
        said=said,
        guess=guess,
        split=split,
    )


def _check_gears(drive: Drive) -> Iterator[Problem]:
    """Compare the ratios of engine to vehicle speed before and after each long pause."""
    engine, speed = drive.get("engine_speed"), drive.get("vehicle_speed")
    if engine is None or speed is None or len(speed) < MANY or len(engine) < 2 * MANY:
        return
    time = engine.time
    wheels = np.where(speed.age(time) < 1.0, speed.at(time), np.nan)
    gearing = effective_gearing(engine.values, wheels)
    with np.errstate(invalid="ignore", divide="ignore"):
        moving = np.isfinite(gearing) & (wheels > _SLOW) & (gearing > 0.0)
        moving &= steady(time, gearing, _NEAR + 0.15 / np.maximum(wheels, 1.0))
    if np.count_nonzero(moving) < 2 * MANY:
        return
    for cut in _pauses(time, wheels):
        parts = [moving & (time < cut), moving & (time >= cut)]
        if min(np.count_nonzero(p) for p in parts) < MANY:
            continue
        if _in_common(*(gearing[p] for p in parts)) > _FOREIGN + 1.0 - _OWN:
            continue
        before, after = (_gears(time[p], engine.values[p], wheels[p], gearing[p]) for p in parts)
        if not _apart(before, after):
            continue
        own = (_on(gearing[parts[0]], before), _on(gearing[parts[1]], after))
        foreign = (_on(gearing[parts[0]], after), _on(gearing[parts[1]], before))
        if min(own) > _OWN and max(foreign) < _FOREIGN:
            yield Problem.of(
                "vehicle.two",
                "engine_speed",
                serious=True,
                start=cut,
                end=drive.end,
                at=instant(cut),
                own=100.0 * own[0],
                foreign=100.0 * foreign[0],
            )
            return


def _pauses(time: Floats, wheels: Floats) -> list[float]:
    """Middles of the longest times in which a vehicle could have been changed."""
    with np.errstate(invalid="ignore"):
        driving = time[wheels > STANDS]
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
    """Say whether two sets of gears cannot be of one gearbox.

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
