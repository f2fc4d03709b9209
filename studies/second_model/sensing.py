"""What sensors, control units and loggers make of the motion."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from .motion import COLUMNS, RATE, G
from .road import CITY, MOTORWAY, Surroundings
from .vehicle import Ecu, Vehicle

Columns = dict[str, np.ndarray]
AT = {name: k for k, name in enumerate(COLUMNS)}
EARTH = 6371e3


@dataclass(frozen=True, slots=True, kw_only=True)
class Logger:
    """What is recorded, and how.

    Attributes
    ----------
    mode : "polled", one value per row as answers come, or "rows", all values in each row
    rate : answers or rows per second [1/s]
    torque : "load", "nm", "percent", "indicated" (percent with friction in it) or None for what
        the vehicle has
    brake_switch, clutch_switch, throttle, gear, air_flow, retarder, ambient, battery : further
        columns
    imu_rate : [1/s], at most ``RATE``
    imu_quality : 1 for a phone or a cheap logger, 0 for a sensor without errors
    mount : "aligned" within some degrees, or "any"
    gnss : whether there is any
    gnss_speed : whether it gives speed and course
    late : time by which stamps may be late, at the most [s]
    delays : whether control units answer late
    """

    mode: str = "polled"
    rate: float = 18.0
    torque: str | None = None
    brake_switch: bool = False
    clutch_switch: bool = False
    throttle: bool = False
    gear: bool = False
    air_flow: bool = False
    retarder: bool = False
    ambient: bool = False
    battery: bool = False
    imu_rate: float = 100.0
    imu_quality: float = 1.0
    mount: str = "aligned"
    gnss: bool = True
    gnss_speed: bool = False
    late: float = 0.04
    delays: bool = True

    def __post_init__(self) -> None:
        if self.mode not in ("polled", "rows"):
            raise ValueError(f"mode must be polled or rows, got {self.mode!r}")
        if self.torque not in (None, "load", "nm", "percent", "indicated"):
            raise ValueError(f"torque {self.torque!r} is not known")
        if self.mount not in ("aligned", "any"):
            raise ValueError(f"mount must be aligned or any, got {self.mount!r}")
        if not 1.0 <= self.imu_rate <= RATE:
            raise ValueError(f"imu_rate must be in 1 to {RATE:g}, got {self.imu_rate}")


def _low_pass(values: np.ndarray, time: float) -> np.ndarray:
    q = np.exp(-1.0 / (RATE * max(time, 1e-4)))
    return lfilter([1.0 - q], [1.0, -q], values, zi=[values[0] * q])[0]


def _wander(rng: np.random.Generator, count: int, step: float, time: float) -> np.ndarray:
    """Gauss-Markov process of unit standard deviation."""
    q = np.exp(-step / time)
    white = rng.normal(size=count)
    white[0] /= np.sqrt(1.0 - q * q)
    return lfilter([np.sqrt(1.0 - q * q)], [1.0, -q], white)


def specific_force(out: np.ndarray, arm: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Specific force of the body, forward, left, up [m/s2].

    Parameters
    ----------
    out : (n, columns) motion
    arm : place of the sensor ahead of and above the centre of mass [m]
    """
    grade, pitch = out[:, AT["grade"]], out[:, AT["pitch"]]
    along = out[:, AT["accel"]] + G * np.sin(grade)
    up = G * np.cos(grade) + out[:, AT["heave_accel"]]
    spin = out[:, AT["pitch_accel"]]
    forward = along * np.cos(pitch) + up * np.sin(pitch) - arm[1] * spin
    upward = up * np.cos(pitch) - along * np.sin(pitch) + arm[0] * spin
    roll = out[:, AT["roll"]]
    side = out[:, AT["lateral_accel"]]
    left = side * np.cos(roll) + upward * np.sin(roll)
    upward = upward * np.cos(roll) - side * np.sin(roll)
    return np.column_stack([forward, left, upward])


def angular_rate(out: np.ndarray) -> np.ndarray:
    """Angular rate of the body about forward, left, up [rad/s].

    A turn on a grade is a roll rate as well, and a turn of a leaning body a pitch rate: the body's
    axes are not the vertical (Euler angles yaw, pitch, roll; Diebel 2006, eq. 75).

    Parameters
    ----------
    out : (n, columns) motion
    """
    roll, nose_up = out[:, AT["roll"]], out[:, AT["grade"]] + out[:, AT["pitch"]]
    roll_rate = np.gradient(roll) * RATE
    nose_rate, yaw_rate = out[:, AT["pitch_rate"]], out[:, AT["yaw_rate"]]
    return np.column_stack(
        [
            roll_rate + yaw_rate * np.sin(nose_up),
            yaw_rate * np.cos(nose_up) * np.sin(roll) - nose_rate * np.cos(roll),
            yaw_rate * np.cos(nose_up) * np.cos(roll) + nose_rate * np.sin(roll),
        ]
    )


def imu(out: np.ndarray, vehicle: Vehicle, logger: Logger, day_rng) -> Columns:
    """Accelerometer and gyroscope as mounted: x forward, y left, z up, if aligned."""
    rng, quality = day_rng, logger.imu_quality
    n = out.shape[0]
    u = rng.uniform
    arm = (u(-0.3, 1.2) * quality, u(-0.2, 0.4) * quality)
    force = specific_force(out, arm)
    rate = angular_rate(out)
    time = np.arange(n) / RATE
    speed = out[:, AT["speed"]]
    if quality > 0.0:
        # Vibration: engine order, aliased by the sampling, and structure-borne road noise.
        engine = out[:, AT["engine_speed"]]
        if vehicle.cylinders:
            order = vehicle.cylinders / 2.0
            phase = np.cumsum(engine) / RATE * order
            share = 0.3 + out[:, AT["indicated_torque"]] / max(vehicle.engine.full.max(), 1.0)
            hertz = engine * order / (2.0 * np.pi)
            size = u(0.1, 0.5) * quality * share / (1.0 + (hertz / 40.0) ** 2) ** 0.5
            for axis, part in ((0, 0.5), (1, 0.4), (2, 1.0)):
                force[:, axis] += part * size * np.sin(phase + axis)
                half = 0.3 * part * size
                force[:, axis] += half * np.sin(0.5 * phase + u(0.0, 6.0))
        rough = quality * u(0.05, 0.15) * np.sqrt(np.maximum(speed, 0.0))
        force += rough[:, None] * rng.normal(size=(n, 3)) * [0.6, 0.6, 1.0]
        rate += 0.01 * rough[:, None] * rng.normal(size=(n, 3))
    # Mounting: some degrees off, and a holder that gives way a little.
    if logger.mount == "any":
        turn = Rotation.random(rng=rng)
    else:
        turn = Rotation.from_euler(
            "xyz", quality * np.array([1.2, 1.2, 1.5]) * rng.normal(size=3), degrees=True
        )
    creep = quality * u(-0.15, 0.15) * (1.0 - np.exp(-time / 900.0))
    settle = Rotation.from_rotvec(np.outer(np.deg2rad(creep), [0.0, 1.0, 0.0]))
    force = turn.apply(settle.apply(force))
    rate = turn.apply(settle.apply(rate))
    # Sensor: bias, scale, cross-axis, drift with the warming case, noise.
    warm = u(3.0, 14.0) * (1.0 - np.exp(-time / u(500.0, 1200.0))) + 1.5 * _wander(
        rng, n, 1.0 / RATE, 600.0
    )
    skew = np.eye(3) + quality * (
        np.diag(rng.normal(0.0, 0.003, 3)) + rng.normal(0.0, 0.003, (3, 3)) * (1.0 - np.eye(3))
    )
    force = force @ skew.T
    force += quality * rng.normal(0.0, 0.15, 3)
    force += quality * np.outer(warm, rng.normal(0.0, 0.002, 3))
    rate += quality * rng.normal(0.0, np.deg2rad(0.3), 3)
    rate += quality * np.outer(warm, rng.normal(0.0, np.deg2rad(0.01), 3))
    force += quality * rng.normal(0.0, 0.02, (n, 3))
    rate += quality * rng.normal(0.0, np.deg2rad(0.07), (n, 3))
    if quality > 0.0:
        force = np.round(force / 0.0024) * 0.0024
        rate = np.round(rate / 0.00027) * 0.00027
    step = RATE / logger.imu_rate
    take = np.minimum((np.arange(int(n / step)) * step).astype(int), n - 1)
    stamps = (take + 1) / RATE
    if quality > 0.0:
        stamps = stamps + rng.normal(0.0, 0.0004, take.size)
        lost = np.zeros(take.size, dtype=bool)
        for _ in range(rng.poisson(take.size / 40000.0)):
            m = rng.integers(take.size)
            lost[m : m + rng.integers(1, 30)] = True
        take, stamps = take[~lost], stamps[~lost]
    table = {"time_s": stamps}
    for k, axis in enumerate("xyz"):
        table[f"accel_{axis}_mps2"] = force[take, k]
    for k, axis in enumerate("xyz"):
        table[f"gyro_{axis}_radps"] = rate[take, k]
    return table


def _believed(out: np.ndarray, ecu: Ecu, vehicle: Vehicle) -> np.ndarray:
    """Indicated torque as the control unit models it [N m]."""
    limit = np.maximum(out[:, AT["indicated_limit"]], 1.0)
    share = np.clip(out[:, AT["indicated_torque"]] / limit, -1.2, 1.2)
    speed = out[:, AT["engine_speed"]] / vehicle.engine.limit
    p = ecu.map_phase
    wave = np.sin(4.0 * speed + p[0]) * np.cos(3.0 * share + p[1]) + 0.6 * np.sin(
        9.0 * speed + p[2]
    ) * np.sin(6.0 * share + p[3])
    relative = ecu.scale * (1.0 + ecu.map_error * wave)
    relative += ecu.part_load * np.maximum(1.0 - np.abs(share) / 0.6, 0.0)
    relative -= ecu.rotor_fade * (1.0 - out[:, AT["rotor_warmth"]])
    return out[:, AT["indicated_torque"]] * relative


def _ecu_values(
    out: np.ndarray,
    vehicle: Vehicle,
    logger: Logger,
    air: float,
    rng,
    battery: np.ndarray | None,
) -> dict[str, np.ndarray]:
    """Values on the control units' side, before polling, on the motion's clock."""
    ecu, engine = vehicle.ecu, vehicle.engine
    kind = logger.torque or ecu.torque
    values: dict[str, np.ndarray] = {}
    speed = out[:, AT["speed"]]
    heard = speed * (1.0 + ecu.speed_slip * out[:, AT["slip"]])
    heard = heard * ecu.speed_scale * (1.0 - ecu.speed_growth * (speed / 40.0) ** 2)
    heard = _low_pass(heard, 0.1)
    heard = np.where(heard < 0.25, 0.0, heard)
    step = ecu.speed_step
    heard = np.floor(heard / step) if ecu.speed_floor else np.round(heard / step)
    values["vehicle_speed_kmh"] = heard * step * 3.6
    rpm = _low_pass(out[:, AT["engine_speed"]], 0.03) * 30.0 / np.pi
    rpm = rpm + (4.0 * rng.normal(size=rpm.size) if vehicle.cylinders else 0.0)
    values["engine_speed_rpm"] = np.maximum(np.round(rpm / ecu.rpm_step) * ecu.rpm_step, 0.0)

    believed = _believed(out, ecu, vehicle)
    if vehicle.kind in ("diesel", "van", "truck", "semi") and rng.random() < 0.12:
        # The particle filter burns itself clean: later injection, other fuel per torque.
        begin, span = rng.uniform(0.0, 0.7), rng.uniform(400.0, 800.0)
        burning = (
            np.abs(np.arange(speed.size) / RATE - begin * speed.size / RATE - span / 2) < span / 2
        )
        believed = believed * (1.0 + rng.uniform(0.02, 0.07) * burning)
    believed = believed + 0.004 * engine.full.max() * _wander(rng, speed.size, 1.0 / RATE, 0.15) * (
        believed > 1.0
    )
    believed = _low_pass(believed, ecu.smoothing)
    limit = np.maximum(out[:, AT["indicated_limit"]], 1.0)
    # Friction as the control unit has it: warm, and what it knows of the cold.
    cold = 1.0 + ecu.cold_known * engine.cold * (1.0 - out[:, AT["engine_warmth"]]) ** 1.5
    friction = ecu.friction_error * out[:, AT["warm_friction"]] * cold
    cut = _low_pass(out[:, AT["indicated_torque"]], ecu.smoothing) < 0.01 * limit
    if kind == "load":
        load = believed / _low_pass(limit, ecu.smoothing)
        load = np.where(cut, np.maximum(load, ecu.overrun_load), load)
        values["engine_load_pct"] = np.round(np.clip(load, 0.0, 1.0) * 255.0) / 2.55
    elif kind == "nm":
        if engine.heating == 0.0:
            sent = believed
            step_t = 0.5
        else:
            charge = 0.7 * engine.accessory / np.maximum(out[:, AT["engine_speed"]], 50.0)
            sent = believed - friction - charge
            step_t = 0.5 if ecu.reference_torque < 800.0 else 1.0
        values["engine_torque_nm"] = np.round(sent / step_t) * step_t
    else:
        reference = ecu.reference_torque
        percent = np.round(believed / reference * 100.0)
        drag = np.round(friction / reference * 100.0)
        if kind == "indicated":
            values["indicated_torque_pct"] = percent
        else:
            values["engine_torque_pct"] = percent - drag
        values["reference_torque_nm"] = np.full(speed.size, reference)
    if logger.throttle:
        values["throttle_pct"] = np.round((0.13 + 0.8 * out[:, AT["pedal"]]) * 255.0) / 2.55
    if logger.gear:
        values["gear"] = out[:, AT["gear"]]
    if logger.brake_switch:
        values["brake_switch"] = out[:, AT["brake_pedal"]]
    if logger.clutch_switch:
        values["clutch_switch"] = out[:, AT["clutch_open"]]
    if logger.air_flow and engine.heating > 0.0:
        ratio = 14.6 if vehicle.kind in ("small_petrol", "petrol", "petrol_dct") else 22.0
        flow = _low_pass(out[:, AT["fuel_rate"]], 0.1) * ratio * 1000.0 * ecu.scale
        values["mass_air_flow_gps"] = np.round(flow * 100.0) / 100.0
    if logger.retarder:
        values["retarder_torque_pct"] = -np.round(
            out[:, AT["engine_brake_torque"]] / max(engine.brake, 1.0) * 100.0
        )
    if logger.ambient:
        values["ambient_temperature_degc"] = np.full(speed.size, np.round(air))
    if logger.battery and engine.heating == 0.0:
        shaft = out[:, AT["indicated_torque"]] * out[:, AT["engine_speed"]]
        at_cell = np.where(shaft > 0.0, shaft / engine.efficiency, shaft * engine.efficiency)
        at_cell = at_cell + out[:, AT["accessory_power"]]
        used = np.cumsum(at_cell) / RATE / (180e6 if vehicle.kind == "electric_car" else 900e6)
        low, high = ecu.cell_voltage
        open_v = low + (high - low) * np.clip(0.8 - used, 0.0, 1.0)
        current = (
            open_v - np.sqrt(np.maximum(open_v**2 - 4.0 * ecu.resistance * at_cell, 1.0))
        ) / (2.0 * ecu.resistance)
        values["battery_voltage_v"] = np.round((open_v - ecu.resistance * current) * 4.0) / 4.0
        values["battery_current_a"] = np.round(current * 10.0) / 10.0
    if logger.battery and battery is not None and vehicle.hybrid is not None:
        volts = vehicle.hybrid.voltage * (1.0 - 0.08 * battery / vehicle.hybrid.motor_power)
        values["battery_voltage_v"] = np.round(volts * 4.0) / 4.0
        values["battery_current_a"] = np.round(battery / volts * 10.0) / 10.0
    return values


def obd(
    out: np.ndarray,
    vehicle: Vehicle,
    logger: Logger,
    air: float,
    rng,
    battery: np.ndarray | None = None,
) -> Columns:
    """Values as the logger has them: polled in turn, or row by row.

    ``battery`` is what that of a hybrid gives (n,) [W].
    """
    values = _ecu_values(out, vehicle, logger, air, rng, battery)
    n = out.shape[0]
    length = n / RATE
    u = rng.uniform
    delay = dict.fromkeys(values, 0.0)
    cycle = dict.fromkeys(values, 1.0 / RATE)
    for name in values:
        if logger.delays:
            cycle[name] = u(0.01, 0.1)
            slow = name in ("vehicle_speed_kmh", "engine_load_pct")
            delay[name] = u(0.05, 0.3) if slow else u(0.02, 0.15)
    if logger.mode == "rows":
        count = int(length * logger.rate)
        asked = np.arange(count) / logger.rate
    else:
        # One question after the other; some answers take longer, a few never come.
        gaps = (0.75 + 0.5 * rng.random(int(length * logger.rate * 1.3))) / logger.rate
        gaps = gaps + np.where(rng.random(gaps.size) < 0.005, u(0.05, 0.4, gaps.size), 0.0)
        asked = np.cumsum(gaps)
        asked = asked[asked < length - 0.05]
        count = asked.size
    stamps = asked
    if logger.late > 0.0:
        # Stamps are late by the queue's length, which wanders, and by a little more each.
        queue = 0.5 + 0.5 * np.tanh(_wander(rng, count, 1.0 / logger.rate, 20.0))
        stamps = asked + logger.late * queue * 0.6 + 0.2 * logger.late * rng.random(count)
        stamps = np.maximum.accumulate(stamps + 1e-6 * np.arange(count) / count)
    table: Columns = {"time_s": stamps}
    rare = ("reference_torque_nm", "ambient_temperature_degc")
    if logger.mode == "polled":
        often = [name for name in values if name not in rare]
        turn = np.arange(count) % len(often)
        which = np.array(often, dtype=object)[turn]
        for name in rare:
            if name in values:
                which[5 :: int(60 * logger.rate)] = name
        lost = rng.random(count) < 0.003
    for name, series in values.items():
        fresh = np.floor((asked - delay[name]) / cycle[name]) * cycle[name]
        rows = np.clip((fresh * RATE).astype(int), 0, n - 1)
        column = series[rows]
        if logger.mode == "polled":
            column = np.where((which == name) & ~lost, column, np.nan)
        table[name] = column
    if logger.mode == "polled":
        keep = ~lost
        table = {name: column[keep] for name, column in table.items()}
    return table


def gnss(
    out: np.ndarray, around: Surroundings, step: float, logger: Logger, start: float, rng
) -> Columns:
    """Positions once per second, with errors that last for minutes; ``start`` is the height."""
    u = rng.uniform
    n = out.shape[0]
    count = int(n / RATE)
    behind = u(0.05, 0.35)
    time = np.arange(count) + u(0.0, 1.0)
    rows = np.clip(((time - behind) * RATE).astype(int), 0, n - 1)
    place = out[rows, AT["distance"]] / step
    grid = np.arange(around.east.size)
    east = np.interp(place, grid, around.east)
    north = np.interp(place, grid, around.north)
    height = start + out[rows, AT["altitude"]]
    zone = around.zone[np.minimum(place.astype(int), around.zone.size - 1)]
    worse = np.where(zone == CITY, 1.8, np.where(zone == MOTORWAY, 0.8, 1.0))
    flat = u(1.0, 2.5)
    east = east + flat * worse * (
        _wander(rng, count, 1.0, 120.0) + 0.3 * _wander(rng, count, 1.0, 8.0)
    )
    north = north + flat * worse * (
        _wander(rng, count, 1.0, 120.0) + 0.3 * _wander(rng, count, 1.0, 8.0)
    )
    tall = u(1.8, 4.0)
    height = height + tall * worse * (
        _wander(rng, count, 1.0, 200.0) + 0.12 * _wander(rng, count, 1.0, 10.0)
    )
    height = height + rng.normal(0.0, 0.15, count) + u(-20.0, 45.0)
    seen = around.covered[np.minimum(place.astype(int), around.covered.size - 1)] == 0.0
    for _ in range(rng.poisson(count / 1200.0)):
        m = rng.integers(count)
        seen[m : m + rng.integers(3, 25)] = False
    lat0, lon0 = u(44.0, 58.0), u(-2.0, 18.0)
    table: Columns = {
        "time_s": time,
        "latitude_deg": lat0 + np.rad2deg(north / EARTH),
        "longitude_deg": lon0 + np.rad2deg(east / (EARTH * np.cos(np.deg2rad(lat0)))),
        "altitude_m": np.round(height, 1),
    }
    if logger.gnss_speed:
        speed = out[rows, AT["speed"]] + rng.normal(0.0, 0.06, count) * worse
        table["speed_mps"] = np.maximum(speed, 0.0)
        heading = np.arctan2(np.gradient(east), np.gradient(north))
        table["course_deg"] = np.rad2deg(heading) % 360.0
    return {name: column[seen] for name, column in table.items()}
