"""Drives of speed and grade alone: climbs at full power, coast-downs both ways."""

import math

import numpy as np

from weighbridge import Drive, Signal, Vehicle
from weighbridge.vehicle import Driveline, RoadLoad

G, DENSITY, AREA, ROLLING, RADIUS = 9.80665, 1.225, 0.66, 0.011, 0.3
CAR = Vehicle(
    driveline=Driveline(wheel_radius=RADIUS, wheel_inertia=2.0),
    road_load=RoadLoad(
        drag_area=AREA, drag_area_std=0.02, rolling_coefficient=ROLLING,
        rolling_coefficient_std=0.001,
    ),
)  # fmt: skip
TURNING = 2.0 / RADIUS**2


def made(speed, grade, rate=10.0, seed=0):
    rng = np.random.default_rng(seed)
    time = np.arange(speed.size) / rate
    return Drive(
        name="climb",
        signals={
            "vehicle_speed": Signal(
                "vehicle_speed", time, speed + rng.normal(scale=0.03, size=speed.size)
            ),
            "grade": Signal("grade", time[::10], grade[::10]),
            "altitude": Signal("altitude", time[::10], np.zeros(time[::10].size)),
        },
    )


def climb(mass, power, *, throttle=1.0, seed=0, seconds=240.0):
    """Climb and level in turn, at a part of the full power wherever it is not too fast."""
    dt = 0.1
    n = int(seconds / dt)
    speed, grade = np.empty(n), np.empty(n)
    v, way = 8.0, 0.0
    for k in range(n):
        grade[k] = 0.03 * (1.0 + math.sin(way / 250.0))
        asked = throttle * power / max(v, 3.0) if v < 28.0 else 0.0
        resisting = 0.5 * DENSITY * AREA * v * v
        resisting += mass * G * (math.sin(grade[k]) + ROLLING * math.cos(grade[k]))
        v = max(v + dt * (asked - resisting) / (mass + TURNING), 0.5)
        way += v * dt
        speed[k] = v
    return made(speed, grade, seed=seed)


def coasting(mass, wind, *, runs=3, seed=3):
    """Coast from 30 m/s to 10 m/s out of gear, there and back; between them the speed rises."""
    dt, parts, spans = 0.1, [], ([], [])
    rng = np.random.default_rng(seed)
    now = 0.0
    for run in range(2 * runs):
        way = 1.0 if run % 2 == 0 else -1.0
        v, course = 30.0, []
        while v > 10.0:
            air = v + way * wind
            force = 0.5 * DENSITY * AREA * air * abs(air) + mass * G * ROLLING
            v -= dt * force / (mass + TURNING)
            course.append(v)
        up = np.linspace(course[-1], 30.0, 150)
        spans[run % 2].append((now + 2.0, now + dt * len(course) - 2.0))
        parts += [np.array(course), up]
        now += dt * (len(course) + up.size)
    speed = np.concatenate(parts)
    time = dt * np.arange(speed.size)
    read = speed + rng.normal(scale=0.03, size=speed.size)
    signals = (
        Signal("vehicle_speed", time, read),
        Signal("grade", time[::10], rng.normal(scale=0.001, size=time[::10].size)),
        Signal("altitude", time[::10], np.zeros(time[::10].size)),
    )
    return Drive(name="coast", signals={s.name: s for s in signals}), *spans
