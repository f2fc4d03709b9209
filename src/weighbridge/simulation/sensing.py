"""What the sensors and the control units make of a drive."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy import signal as dsp
from scipy.spatial.transform import Rotation

from weighbridge.constants import (
    EARTH_RADIUS,
    GRAVITY,
    PETROL_STOICHIOMETRIC_RATIO,
    STANDARD_TEMPERATURE,
    TEMPERATURE_LAPSE,
)
from weighbridge.errors import ConfigError
from weighbridge.kernels.simulated_driveline import DRIVING
from weighbridge.signals import QUANTITIES, Floats, Signal, scalar_to_si
from weighbridge.simulation.hybrid import volts_and_amps
from weighbridge.simulation.longitudinal import DT

if TYPE_CHECKING:
    from weighbridge.simulation.body import Pose
    from weighbridge.simulation.car import SimulatedCar
    from weighbridge.simulation.longitudinal import Trajectory
    from weighbridge.simulation.scenario import Scenario

_LOAD_STEP = 1.0 / 255.0

# Of fuel [kg/m^3]: middle of EN 228 and of EN 590.
_DENSITY = {"petrol": 748.0, "diesel": 833.0, "electric": 833.0}


def body_motion(pose: Pose) -> tuple[Floats, Floats]:
    """Find what an ideal inertial sensor at the rear axle reads.

    Parameters
    ----------
    pose : Pose

    Returns
    -------
    specific_force, rate : (3, n) float64
        Body axes forward, right, down [m/s^2], [rad/s].
    """
    accel_n = np.gradient(pose.velocity_n, DT, axis=1)
    accel_n[2] -= GRAVITY
    sr, cr = np.sin(pose.roll), np.cos(pose.roll)
    sp, cp = np.sin(pose.pitch), np.cos(pose.pitch)
    sy, cy = np.sin(pose.heading), np.cos(pose.heading)
    ahead = cy * accel_n[0] + sy * accel_n[1]
    across = -sy * accel_n[0] + cy * accel_n[1]
    down = accel_n[2]
    tilted = sp * ahead + cp * down
    force = np.empty_like(accel_n)
    force[0] = cp * ahead - sp * down
    force[1] = cr * across + sr * tilted
    force[2] = -sr * across + cr * tilted
    roll_rate = np.gradient(pose.roll, DT)
    pitch_rate = np.gradient(pose.pitch, DT)
    yaw_rate = np.gradient(pose.heading, DT)
    rate = np.empty_like(accel_n)
    rate[0] = roll_rate - sp * yaw_rate
    rate[1] = cr * pitch_rate + sr * cp * yaw_rate
    rate[2] = -sr * pitch_rate + cr * cp * yaw_rate
    return force, rate


def simulate_imu(
    scenario: Scenario, drive: Trajectory, pose: Pose, rng: np.random.Generator
) -> list[Signal]:
    """Sample the inertial sensor.

    Parameters
    ----------
    scenario : Scenario
    drive : Trajectory
    pose : Pose
    rng : numpy.random.Generator

    Returns
    -------
    list of Signal
        accel_x .. gyro_z, sensor axes.
    """
    sensors, effects = scenario.sensors, scenario.effects
    force, rate = body_motion(pose)
    lever = np.array(sensors.lever) * effects.imu_lever
    if np.any(lever):
        lever_column = lever[:, None]
        turning = np.gradient(rate, DT, axis=1)
        force += np.cross(turning, lever_column, axis=0)
        force += np.cross(rate, np.cross(rate, lever_column, axis=0), axis=0)
    time = drive.time
    _shake(scenario, drive, force, rate, rng)
    stride = max(1, round(1.0 / (DT * sensors.imu_rate)))
    if stride > 1:
        count = time.size // stride
        force = force[:, : count * stride].reshape(3, count, stride).mean(axis=2)
        rate = rate[:, : count * stride].reshape(3, count, stride).mean(axis=2)
        time = time[: count * stride].reshape(count, stride).mean(axis=1)
    mounting = np.array(sensors.mounting) * effects.imu_mounting
    turn = Rotation.from_euler("ZYX", mounting[::-1]).as_matrix().T
    count = time.size
    hours = np.sqrt(DT * stride / 3600.0)
    signals = []
    stamps = time
    if effects.imu_jitter > 0.0:
        spread = sensors.clock_jitter * effects.imu_jitter
        limit = 0.4 * DT * stride
        stamps = time + np.clip(spread * rng.standard_normal(count), -limit, limit)
        stamps[0] = max(stamps[0], 0.0)
    for kind, values, noise, bias, walk, step in (
        ("accel", force, sensors.accel_noise, sensors.accel_bias, sensors.accel_walk,
         sensors.accel_step),
        ("gyro", rate, sensors.gyro_noise, sensors.gyro_bias, sensors.gyro_walk,
         sensors.gyro_step),
    ):  # fmt: skip
        error = np.diag(1.0 + effects.imu_scale * sensors.scale * rng.standard_normal(3))
        cross = effects.imu_cross_axis * sensors.cross_axis * rng.standard_normal((3, 3))
        np.fill_diagonal(cross, 0.0)
        read = ((error + cross) @ turn) @ values
        read += (effects.imu_bias * bias * rng.standard_normal(3))[:, None]
        for axis, name in enumerate("xyz"):
            row = read[axis]
            if effects.imu_bias_walk > 0.0:
                drift = np.cumsum(rng.standard_normal(count))
                row = row + effects.imu_bias_walk * walk * hours * drift
            if effects.imu_noise > 0.0:
                row = row + effects.imu_noise * noise * rng.standard_normal(count)
            if effects.imu_quantisation > 0.0:
                row = np.round(row / step) * step
            signals.append(Signal(f"{kind}_{name}", stamps, row))
    return signals


def _shake(
    scenario: Scenario, drive: Trajectory, force: Floats, rate: Floats, rng: np.random.Generator
) -> None:
    """Add vibration of engine and road to specific force and angular rate (3, n), in place."""
    sensors, effects = scenario.sensors, scenario.effects
    if effects.imu_vibration > 0.0 and scenario.car.cylinders:
        # A four-stroke engine fires half as often per turn as it has cylinders.
        order = scenario.car.cylinders / 2.0
        phase = np.cumsum(drive.engine_speed) * (DT * order)
        strength = (sensors.vibration * effects.imu_vibration) * (
            0.3 + 0.7 * np.clip(drive.pedal, 0.0, 1.0)
        )
        for axis, (share, shift) in enumerate(((0.6, 0.3), (0.5, 1.9), (1.0, 0.0))):
            force[axis] += share * strength * np.sin(phase + shift)
    if effects.imu_vibration > 0.0:
        # Shaking of what the sensor sits on, not of the body as a whole.
        band = dsp.butter(2, (8.0, 60.0), btype="band", fs=1.0 / DT, output="sos")
        gain = 1.0 / np.sqrt((60.0 - 8.0) * 2.0 * DT)  # the share of white noise passed
        level = effects.imu_vibration * gain * np.sqrt(drive.speed / 25.0)
        for values, worst in zip((force, rate), sensors.road_vibration, strict=True):
            for axis, share in enumerate((0.6, 0.7, 1.0) if values is force else (0.7, 1.0, 0.3)):
                shaking = dsp.sosfilt(band, rng.standard_normal(drive.time.size))
                values[axis] += share * worst * level * shaking


def _gauss_markov(n: int, dt: float, time: float, rng: np.random.Generator) -> Floats:
    """Correlated noise of unit standard deviation."""
    c = math.exp(-dt / time)
    white = rng.standard_normal(n)
    white[1:] *= math.sqrt(1.0 - c * c)
    return np.asarray(dsp.lfilter([1.0], [1.0, -c], white))


def simulate_gnss(
    scenario: Scenario, drive: Trajectory, pose: Pose, rng: np.random.Generator
) -> list[Signal]:
    """Take fixes.

    Parameters
    ----------
    scenario : Scenario
    drive : Trajectory
    pose : Pose
    rng : numpy.random.Generator

    Returns
    -------
    list of Signal
        latitude, longitude, altitude, gnss_speed, gnss_course, gnss_accuracy.
    """
    sensors, effects = scenario.sensors, scenario.effects
    period = 1.0 / sensors.gnss_rate
    time = np.arange(0.3 * period, drive.time[-1], period)
    n = time.size
    # A fix describes the instant before it is stamped.
    where = np.maximum(time - effects.gnss_delay * sensors.gnss_delay, 0.0) / DT

    def at(values: Floats) -> Floats:
        return np.interp(where, np.arange(values.size), values)

    def error(level: int) -> Floats:
        white = effects.gnss_white * sensors.gnss_noise[level] * rng.standard_normal(n)
        drift = _gauss_markov(n, period, sensors.gnss_drift_time[level], rng)
        return np.asarray(white + effects.gnss_correlated * sensors.gnss_drift[level] * drift)

    # Horizontal errors are stated for both axes together.
    north, east, up = (error(level) for level in (0, 0, 1))
    north, east = north / math.sqrt(2.0), east / math.sqrt(2.0)
    latitude, altitude = at(pose.latitude), at(pose.altitude) + up
    # A few metres: the mean Earth radius is exact enough for an error.
    longitude = at(pose.longitude) + east / (EARTH_RADIUS * np.cos(latitude))
    latitude = latitude + north / EARTH_RADIUS
    noise = effects.gnss_white * sensors.gnss_speed_noise
    v_north = at(pose.velocity_n[0]) + noise * rng.standard_normal(n)
    v_east = at(pose.velocity_n[1]) + noise * rng.standard_normal(n)
    accuracy = math.hypot(sensors.gnss_noise[0], sensors.gnss_drift[0])
    accuracy_m = np.round(accuracy * (1.0 + 0.25 * np.abs(_gauss_markov(n, period, 60.0, rng))), 1)
    keep = np.ones(n, dtype=bool)
    for start, end in sensors.gnss_outages:
        keep &= (time < start) | (time >= end)
    values = {
        "latitude": latitude,
        "longitude": longitude,
        "altitude": altitude,
        "gnss_speed": np.hypot(v_north, v_east),
        "gnss_course": np.mod(np.arctan2(v_east, v_north), 2.0 * math.pi),
        "gnss_accuracy": accuracy_m,
    }
    return [Signal(name, time[keep], row[keep]) for name, row in values.items()]


def _smooth(values: Floats, lag: float) -> Floats:
    """First-order lag of a control unit [s]."""
    if lag <= 0.0:
        return values
    c = math.exp(-DT / lag)
    return np.asarray(dsp.lfilter([1.0 - c], [1.0, -c], values, zi=[c * values[0]])[0])


def engine_load(scenario: Scenario, drive: Trajectory) -> Floats:
    """Find the calculated load the control unit reports, before quantisation.

    Parameters
    ----------
    scenario : Scenario
    drive : Trajectory

    Returns
    -------
    (n,) float64
        Only roughly linear in torque: it bends with torque and engine speed,
        counts what friction and accessories take, and is smoothed [-].
    """
    car, effects = scenario.car, scenario.effects
    c = np.array(car.drag_torque)
    peak = max(car.curve_torque)
    top = peak + c[0] + c[1] * 200.0 + c[2] * 200.0**2
    if car.engine == "diesel":
        # Of the torque there is at that engine speed (SAE J1979).
        w = drive.engine_speed
        top = np.interp(w, car.curve_speed, car.curve_torque) + c[0] + c[1] * w + c[2] * w * w
    size = car.load_curve * effects.load_curve
    if size > 0.0:
        # As the control unit knows the engine: with its friction and usual accessories.
        w = np.maximum(drive.engine_speed, 0.8 * car.idle_speed)
        full = np.interp(w, car.curve_speed, car.curve_torque) + c[0] + c[1] * w + c[2] * w * w
        full += car.accessory_power * effects.accessories / w
        top = top + size * (full - top)
    part = drive.gross_torque / top
    bend = effects.load_nonlinearity * car.load_curvature * 2.0 * part * (1.0 - part)
    slope = effects.load_nonlinearity * car.load_speed_slope
    load = (part + bend) * (1.0 + slope * (drive.engine_speed / car.max_speed - 0.35))
    # Air still passes a closed throttle.
    least = np.maximum(0.03, effects.overrun_fuel * car.least_charge * drive.uncut)
    load = car.load_full * np.maximum(load, least)
    load = _smooth(load, car.load_smoothing * effects.load_smoothing)
    return np.asarray(np.clip(load, 0.0, 1.0))


def _retarder_fade(drive: Trajectory) -> Floats:
    """Part of a retarder's force there is: none below walking pace."""
    return np.clip((drive.speed - 1.5) / 3.0, 0.0, 1.0)


def _retarder(scenario: Scenario, drive: Trajectory) -> Floats:
    """Braking force of the retarder [N]: it works before the brakes do."""
    most = scenario.car.retarder_force * _retarder_fade(drive)
    braking = np.where(drive.brake_force > 1.5 * scenario.car.brake_drag, drive.brake_force, 0.0)
    return np.minimum(braking, most)


def _net_fraction(scenario: Scenario, drive: Trajectory) -> Floats:
    """Torque at the flywheel as a part of the reference torque, as read from J1939.

    The control unit reports the indicated torque it believes in, which bends away
    from the true one at part load, and the friction of the warm engine without its
    accessories, each in percent (SAE J1939-71, SPN 513 and 514).
    """
    car, effects = scenario.car, scenario.effects
    reference = round(max(car.curve_torque))
    part = drive.gross_torque / reference
    bend = 2.0 * car.torque_curvature * effects.load_nonlinearity
    reported = part * (1.0 + bend * (1.0 - part))
    reported = _smooth(reported, car.load_smoothing * effects.load_smoothing)
    c = car.drag_torque
    friction = c[0] + c[1] * drive.engine_speed + c[2] * drive.engine_speed**2
    return np.asarray(reported - np.round(friction / reference, 2))


def _values(scenario: Scenario, drive: Trajectory, name: str, pose: Pose) -> tuple[Floats, float]:
    """Value of a quantity every 5 ms, and its quantisation step; SI."""
    car, polling, effects = scenario.car, scenario.polling, scenario.effects
    peak = max(car.curve_torque)
    friction = (
        car.drag_torque[0]
        + car.drag_torque[1] * drive.engine_speed
        + car.drag_torque[2] * drive.engine_speed**2
    )
    if name == "vehicle_speed":
        scale = 1.0 + effects.obd_speed_scale * (polling.speed_scale - 1.0)
        return drive.speed * scale, scalar_to_si(polling.speed_step, "kmh")
    if name == "engine_speed":
        return drive.engine_speed, scalar_to_si(polling.engine_speed_step, "rpm")
    if name == "engine_load":
        return engine_load(scenario, drive), _LOAD_STEP
    if name == "engine_torque":
        # Motor torque is computed from currents, a little off at part load.
        off = 0.02 * effects.load_nonlinearity * (1.0 - np.abs(drive.engine_torque) / peak)
        return drive.engine_torque * (1.0 - off), 0.5
    if name == "engine_torque_fraction" and polling.net_torque:
        return _net_fraction(scenario, drive), 0.01
    if name == "engine_torque_fraction":
        # Indicated torque, friction and accessories included (SAE J1979).
        return (drive.engine_torque + friction + drive.accessory_torque) / peak, 0.01
    if name == "reference_torque":
        return np.full(drive.time.size, round(peak)), 1.0
    if name in ("mass_air_flow", "lambda_1"):
        burning = drive.fuel_flow > 0.0
        rich = 1.0 - 0.12 * np.clip((drive.pedal - 0.85) / 0.15, 0.0, 1.0)
        mixture = np.where(burning, rich, 1.999)
        if name == "lambda_1":
            return _smooth(mixture, 0.15), 2.0 / 65536.0
        air = np.where(
            burning,
            drive.fuel_flow * PETROL_STOICHIOMETRIC_RATIO * rich,
            4.0e-5 * drive.engine_speed * peak / 320.0,
        )
        return _smooth(air * (1.0 + 0.02 * effects.load_nonlinearity), 0.1), 1.0e-5
    if name == "fuel_rate":
        density = _DENSITY[scenario.car.engine]
        return drive.fuel_flow / density, scalar_to_si(0.05, "lph")
    if name == "throttle":
        return 0.13 + 0.75 * np.clip(drive.pedal, 0.0, 1.0) ** 0.8, _LOAD_STEP
    if name == "ambient_temperature":
        heat = 2.0 * np.exp(-drive.speed / 4.0)
        return scenario.ambient_temperature + _smooth(heat, 60.0), 1.0
    if name == "barometric_pressure":
        rise = pose.altitude - scenario.route.altitude
        # Hydrostatic atmosphere with the standard lapse rate, ISO 2533.
        fall = (1.0 - TEMPERATURE_LAPSE * rise / STANDARD_TEMPERATURE) ** 5.256
        return scenario.pressure * fall, 1000.0
    if name == "gear":
        return drive.gear, 1.0
    if name == "retarder_torque":
        return -_retarder(scenario, drive) / max(car.retarder_force, 1.0), 0.01
    if name == "brake_switch":
        held = (drive.speed < 0.05) & (drive.pedal <= 0.0)
        # Released brakes are not felt by the pedal; half of a retarder has a lever.
        by_lever = 0.5 * car.retarder_force * _retarder_fade(drive)
        touched = drive.brake_force > np.maximum(max(20.0, 1.5 * car.brake_drag), by_lever)
        if scenario.habits.touch_rate * effects.light_braking > 0.0 and car.retarder_force == 0.0:
            # A light foot works the switch before the brakes bite.
            touched |= drive.brake_pedal > 0.0
        return (touched | held).astype(np.float64), 1.0
    if name == "clutch_switch":
        return (drive.phase != DRIVING).astype(np.float64), 1.0
    if name in ("battery_voltage", "battery_current"):
        if car.split is None or drive.battery_power is None:
            raise ConfigError(f"{name} can be polled of a hybrid only, not of {car.name!r}")
        volts, amps = volts_and_amps(drive.battery_power, car.split)
        return (volts, 0.5) if name == "battery_voltage" else (amps, 0.1)
    raise KeyError(name)


POLLABLE = (
    "vehicle_speed", "engine_speed", "engine_load", "engine_torque", "engine_torque_fraction",
    "reference_torque", "mass_air_flow", "lambda_1", "throttle", "ambient_temperature",
    "barometric_pressure", "gear", "brake_switch", "clutch_switch", "retarder_torque",
    "fuel_rate", "battery_voltage", "battery_current",
)  # fmt: skip
"""Quantities the simulated control units can be asked for."""


_FULL_TORQUE: Final[dict[str, Callable[[SimulatedCar], float]]] = {
    "engine_load": lambda car: car.load_full,
    "engine_torque": lambda car: max(car.curve_torque),
    "engine_torque_fraction": lambda car: 1.0,
}
"""What the readings of torque are at full torque."""


def simulate_polling(
    scenario: Scenario, drive: Trajectory, pose: Pose, rng: np.random.Generator
) -> list[Signal]:
    """Ask the control units for one value after another.

    Parameters
    ----------
    scenario : Scenario
    drive : Trajectory
    pose : Pose
    rng : numpy.random.Generator

    Returns
    -------
    list of Signal
        Each on its own stamps; no two share one.
    """
    polling, effects = scenario.polling, scenario.effects
    fast, slow = polling.fast, polling.slow
    slots = len(fast) + (1 if slow else 0)
    gap = 1.0 / (polling.rate * slots)
    total = int((drive.time[-1] - 0.5) / gap)
    stamps: Floats = 0.2 + gap * np.arange(total, dtype=np.float64)
    if effects.obd_jitter > 0.0:
        # An answer is never overtaken by the next.
        wobble = 0.25 * gap * rng.standard_normal(total) * effects.obd_jitter
        stamps = stamps + np.clip(wobble, -0.45 * gap, 0.45 * gap)
    slot = np.arange(total) % slots
    turn = np.arange(total) // slots
    signals = []
    for name in dict.fromkeys((*fast, *slow)):
        mine = np.isin(slot, [k for k, other in enumerate(fast) if other == name])
        if name in slow:
            # The spare slot of every tenth round, one slow quantity after another.
            spare = (slot == len(fast)) & (turn % 10 == 0)
            mine |= spare & (turn // 10 % len(slow) == slow.index(name))
        time = stamps[mine]
        values, step = _values(scenario, drive, name, pose)
        delay = effects.obd_delay * np.maximum(
            0.0,
            polling.delay
            + polling.delay_spread * rng.standard_normal()
            + polling.delay_jitter * effects.obd_jitter * rng.standard_normal(time.size),
        )
        if step == 1.0 and name in ("gear", "brake_switch", "clutch_switch"):
            row = values[np.clip(((time - delay) / DT).astype(int), 0, values.size - 1)]
        else:
            row = np.interp(time - delay, drive.time, values)
        if polling.torque_noise > 0.0 and name in _FULL_TORQUE:
            full = _FULL_TORQUE[name](scenario.car)
            row = row + polling.torque_noise * full * rng.standard_normal(time.size)
            if name == "engine_load":
                row = np.clip(row, 0.0, 1.0)
        if effects.obd_quantisation > 0.0:
            row = _quantise(row, name, step, down=polling.speed_rounding == "down")
        signals.append(Signal(name, time, row))
    return signals


def _quantise(values: Floats, name: str, step: float, *, down: bool) -> Floats:
    """Round to steps counted in the unit of the file."""
    offset = scalar_to_si(0.0, QUANTITIES[name].suffix) if QUANTITIES[name].suffix else 0.0
    counts = (values - offset) / step
    counts = np.floor(counts + 1e-9) if name == "vehicle_speed" and down else np.round(counts)
    return np.asarray(counts * step + offset)
