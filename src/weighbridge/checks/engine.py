"""Are torque and speed of the engine what their names say?"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from weighbridge.checks import windows
from weighbridge.checks.needed import needed, of_torque, show
from weighbridge.limits import CREEPS, SOME
from weighbridge.messages import phrase
from weighbridge.signals import Drive, Problem, Signal
from weighbridge.signals.correlation import correlation
from weighbridge.vehicle import Vehicle, friction_coefficients, idling, source_of
from weighbridge.vehicle.data_sheet import FRICTION_PRESSURE
from weighbridge.vehicle.gear import LOWEST_GEARING

# Engine speeds of an idle [rad/s], and coolant of an engine that is warm [K].
_IDLE: Final = (45.0, 135.0)
_WARM: Final = 343.0
# Idle over that of the calibration, between these: a cold engine has 1.5 at most [-].
_IDLES: Final = (0.6, 1.7)
# Torque at idle that alternator and pumps do not take [part of the reference torque].
_IDLE_TORQUE: Final = 0.03

# Signals of the battery have signs of their own.
_OF_BATTERY: Final = ("battery_current", "battery_power", "battery_voltage")
# Torque and gain of speed are compared over windows of so long [s].
_SIGN_WINDOW: Final = 1.0
# Correlation below which the torque has the other sign: -0.9 in a reversed one.
_AGAINST: Final = -0.5


def check_torque_sign(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find a torque that runs against the motion it makes: its sign was turned."""
    speed = drive.speed
    if speed is None or len(speed) < 20:
        return
    for name in sorted(needed(drive, vehicle) & of_torque()):
        s = drive.get(name)
        if s is None or len(s) < 20 or float(np.min(s.values)) >= 0.0 or name in _OF_BATTERY:
            continue
        at = windows.edges(
            max(s.time[0], speed.time[0]), min(s.time[-1], speed.time[-1]), _SIGN_WINDOW
        )
        force, full = windows.means(s, at)
        gained = np.diff(speed.at(at))
        moving = full & (speed.age(at[1:]) < 1.0) & (speed.at(at[1:]) > CREEPS)
        if np.count_nonzero(moving) < SOME:
            continue
        if correlation(force[moving], gained[moving]) < _AGAINST:
            yield Problem.of("torque.sign", name, serious=True)


def check_friction(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find friction of the engine in a torque that is taken for the one at its shaft."""
    torque = drive.get("engine_torque_fraction")
    if torque is None or (vehicle is not None and not source_of(vehicle).needs_reference):
        return
    if vehicle is not None and vehicle.torque.coefficients and vehicle.torque.coefficients[0] < 0.0:
        return
    idle = _idle_torque(drive, torque)
    remedy = _friction_remedy(drive, vehicle, idle)
    if drive.has("indicated_torque_fraction"):
        seen = phrase("idle_reading", idle=100.0 * idle) if idle is not None else ""
        yield Problem.of(
            "torque.indicated",
            "engine_torque_fraction",
            serious=vehicle is not None,
            seen=seen,
            remedy=remedy,
        )
    elif vehicle is not None and vehicle.provenance.torque_fitted:
        return
    elif idle is not None and idle > _IDLE_TORQUE:
        by_bus = drive.has("retarder_torque") or (vehicle is not None and vehicle.of_class.retarded)
        whose = phrase("percent_torque") if by_bus else "PID 62"
        yield Problem.of(
            "torque.friction",
            "engine_torque_fraction",
            idle=100.0 * idle,
            whose=whose,
            remedy=remedy,
        )


def _friction_remedy(drive: Drive, vehicle: Vehicle | None, idle: float | None) -> str:
    """Say what to write of the friction into a vehicle file."""
    reference = drive.get("reference_torque")
    if reference is not None and len(reference):
        full = float(np.median(reference.values))
    else:
        full = (vehicle.torque.reference_torque if vehicle is not None else None) or 0.0
    engine = drive.get("engine_speed")
    if idle is None or not full or engine is None or not len(engine):
        return phrase("friction_constant")
    turning = engine.values[(engine.values > _IDLE[0]) & (engine.values < _IDLE[1])]
    remedies = []
    for fuel in FRICTION_PRESSURE:
        w0, w2, w3 = friction_coefficients(idle * full, float(np.median(turning)), fuel)
        remedies.append(phrase("friction_of_fuel", w0=-w0, w2=-w2, w3=-w3, fuel=fuel))
    return phrase("friction_by_speed", remedies=" or ".join(remedies))


def _idle_torque(drive: Drive, torque: Signal) -> float | None:
    """Least torque of an engine that idles warm and standing; None where that was not seen."""
    engine, speed = drive.get("engine_speed"), drive.get("vehicle_speed")
    if engine is None or speed is None or not len(speed) or not len(engine):
        return None
    at = torque.time
    turning = engine.at(at)
    with np.errstate(invalid="ignore"):
        idle = (turning > _IDLE[0]) & (turning < _IDLE[1]) & (np.abs(speed.at(at)) < 0.3)
        # No pull-away just before or after.
        for side in (-2.0, 2.0):
            idle &= np.abs(speed.at(at + side)) < 0.3
        coolant = drive.get("coolant_temperature")
        if coolant is not None and len(coolant):
            idle &= coolant.at(at) > _WARM
    if np.count_nonzero(idle) < 20:
        return None
    # Fans, air conditioning and a gearbox in gear come and go.
    return float(np.percentile(torque.values[idle], 10.0))


def check_idle(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find an engine speed by another factor than in the calibration: the engine idles elsewhere.

    The ratios of a gearbox may look the same at twice the speed.
    """
    known = vehicle.driveline.idle_speed if vehicle is not None else 0.0
    engine, speed = drive.get("engine_speed"), drive.speed
    if not known > 0.0 or engine is None or speed is None or not (len(engine) and len(speed)):
        return
    idle = idling(engine.values, np.abs(speed.at(engine.time)))
    low, high = _IDLES
    if idle > 0.0 and not low < idle / known < high:
        yield Problem.of(
            "engine.idle",
            engine.name,
            serious=True,
            idle=show(engine.name, idle),
            known=show(engine.name, known),
            factor=idle / known,
        )


def check_engine_speed(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find an engine that would turn too slowly for the road speed."""
    engine, speed = drive.get("engine_speed"), drive.get("vehicle_speed")
    if engine is None or speed is None or not len(speed):
        return
    fast = speed.at(engine.time) > 10.0
    if np.count_nonzero(fast) < 20:
        return
    # Slower than any idle, and than the wheels, but turning: rad/s or revolutions per second.
    highest = float(np.max(engine.values[fast]))
    ratio = float(np.median(engine.values[fast] / speed.at(engine.time)[fast]))
    if 1.0 < highest < 62.0 and ratio < LOWEST_GEARING:
        yield Problem.of(
            "engine.speed_radians",
            "engine_speed",
            serious=True,
            value=show("engine_speed", highest),
        )
