"""Roads drawn at random: hills, bends, limits, stops, unevenness, shelter."""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from .motion import Driver, Road

STEP = 2.0
PROFILE_STEP = 0.1
CITY, VILLAGE, RURAL, MOTORWAY = 0, 1, 2, 3


class Surroundings(NamedTuple):
    """What the sensors meet along the road, on the road's grid."""

    zone: np.ndarray  # CITY ... MOTORWAY
    covered: np.ndarray  # 1 in tunnels
    east: np.ndarray  # [m]
    north: np.ndarray  # [m]


def _wander(rng: np.random.Generator, count: int, length: float, std: float) -> np.ndarray:
    """Smooth random course with a given length and standard deviation."""
    q = np.exp(-STEP / length)
    white = rng.normal(size=count)
    once = lfilter([np.sqrt(1.0 - q * q)], [1.0, -q], white)
    twice = lfilter([1.0 - q], [1.0, -q], once)
    return std * twice / max(twice.std(), 0.3)


def make_road(
    length: float, style: str, heavy: bool, driver: Driver, drop: float, rng: np.random.Generator
) -> tuple[Road, Surroundings]:
    """Draw a road.

    Parameters
    ----------
    length : [m]
    style : of the drive
    heavy : truck or bus: gentler roads, lower limits
    driver : for speed in bends and braking
    drop : mass to be taken off over all stops [kg]
    rng : source of chance
    """
    u = rng.uniform
    count = int(length / STEP) + 2
    zone = np.empty(count, dtype=np.int64)
    limit = np.empty(count)
    curvature = np.zeros(count)
    stops: list[tuple[float, float, float, float]] = []
    shares = {
        "motorway": (0.05, 0.05, 0.90),
        "city": (1.0, 0.0, 0.0),
        "delivery": (0.85, 0.15, 0.0),
    }.get(style, (0.60, 0.32, 0.08))

    def stop(place: float, seconds: float, given_up: float) -> None:
        b = driver.decel * float(np.exp(0.35 * rng.normal()))
        free = u(8.0, 60.0) if u() < given_up else 0.0
        stops.append((place, seconds, min(max(b, 0.4), 3.0), free))

    def bend(i: int, radius: float, angle: float) -> int:
        steps = max(3, int(radius * abs(angle) / STEP))
        ramp = np.sin(np.linspace(0.0, np.pi, steps + 2)[1:-1])
        end = min(i + steps, count)
        curve = ramp / (ramp.sum() * STEP) * angle
        curvature[i:end] += curve[: end - i]
        return end

    i = 0
    while i < count:
        pick = rng.choice(3, p=np.array(shares) / np.sum(shares))
        stretch = u(*((1200, 4000), (2500, 9000), (6000, 20000))[pick])
        end = min(count, i + int(stretch / STEP))
        if pick == 0:
            zone[i:end], limit[i:end] = CITY, 50.0
            j = i
            while j < end:
                block = int((u(120, 420) if style != "delivery" else u(80, 280)) / STEP)
                k = min(j + block, end)
                limit[j:k] = rng.choice([30.0, 40.0, 50.0, 50.0, 50.0, 60.0])
                place = k * STEP - 4.0
                if style == "delivery" and u() < 0.5:
                    stop((j + 0.6 * (k - j)) * STEP, u(20.0, 90.0), 0.0)
                if u() < 0.55:
                    red = float(np.clip(np.exp(rng.normal(2.6, 0.8)), 2.0, 70.0))
                    stop(place, red if u() < 0.75 else u(1.0, 4.0), 0.3)
                if u() < 0.3:
                    k = bend(k, u(9.0, 18.0), rng.choice([-1.0, 1.0]) * u(1.2, 1.7))
                j = max(k, j + 1)
        elif pick == 1:
            zone[i:end] = RURAL
            limit[i:end] = 80.0 if heavy else rng.choice([80.0, 90.0, 100.0, 100.0])
            j = i
            while j < end:
                k = min(j + int(u(60, 500) / STEP), end)
                low = 200.0 if heavy else 80.0
                radius = float(np.exp(u(np.log(low), np.log(1100.0))))
                k = bend(k, radius, rng.choice([-1.0, 1.0]) * min(u(0.1, 1.3), 260.0 / radius))
                if u() < 0.06:
                    k = min(k, count - 1)
                    b = min(k + int(35 / STEP), count)
                    limit[k:b] = 27.0  # roundabout
                    if u() < 0.5:
                        stop(k * STEP - 2.0, u(0.5, 6.0), 0.4)
                    k = b
                j = max(k, j + 1)
            if end - i > 800 and u() < 0.8:
                m = i + int(u(0.25, 0.6) * (end - i))
                n = min(m + int(u(400, 1500) / STEP), end)
                zone[m:n], limit[m:n] = VILLAGE, 50.0
                if u() < 0.5:
                    stop(u(m, n) * STEP, u(3.0, 30.0), 0.3)
        else:
            zone[i:end] = MOTORWAY
            limit[i:end] = 85.0 if heavy else rng.choice([110.0, 120.0, 130.0, 130.0])
            limit[i : i + int(250 / STEP)] = 70.0
            limit[max(i, end - int(250 / STEP)) : end] = 60.0
            curvature[i:end] += _wander(rng, end - i, 400.0, 1.0 / 2500.0)
            if u() < 0.4:
                m = int(u(i, end))
                limit[m : m + int(u(800, 2500) / STEP)] = rng.choice([80.0, 100.0])
        i = end
    curvature = gaussian_filter1d(curvature, 1.5)
    fast = ((zone == RURAL) | (zone == MOTORWAY)).astype(float)

    # Hills: grade has parts of many lengths.
    hilly = float(np.exp(rng.normal(np.log(0.018), 0.45)))
    grade = np.zeros(count)
    for scale, part in ((30.0, 0.35), (120.0, 0.6), (500.0, 0.65), (2500.0, 0.45)):
        grade += _wander(rng, count, scale, hilly * part)
    soft = np.where(zone == MOTORWAY, 0.05, 0.07 if heavy else 0.10)
    soft = gaussian_filter1d(soft.astype(float), 60.0)
    grade = soft * np.tanh(grade / soft)
    grade = gaussian_filter1d(grade, 5.0)

    # Speed wanted: limits smoothed as drivers see them, bends, slowing down ahead.
    plan = limit / 3.6 * (1.0 + _wander(rng, count, 150.0, 0.05))
    plan = np.minimum(plan, np.sqrt(driver.lateral / np.maximum(np.abs(curvature), 1e-6)))
    plan = np.maximum(plan, 3.0)
    slow = driver.decel * np.exp(_wander(rng, count, 200.0, 0.3)) * 0.75
    square = plan**2
    for k in range(count - 2, -1, -1):
        square[k] = min(square[k], square[k + 1] + 2.0 * slow[k] * STEP)
    plan = np.sqrt(square)

    crossfall = np.clip(0.02 - curvature * 25.0, -0.06, 0.06)
    crossfall = gaussian_filter1d(crossfall + _wander(rng, count, 80.0, 0.006), 8.0)
    heading = (
        rng.uniform(0.0, 2.0 * np.pi) - np.concatenate([[0.0], np.cumsum(curvature)[:-1]]) * STEP
    )
    shelter = np.select([zone == CITY, zone == VILLAGE, zone == RURAL], [0.4, 0.5, 0.75], 0.95)
    shelter = np.clip(shelter * (1.0 + _wander(rng, count, 150.0, 0.3)), 0.1, 1.3)
    texture = 1.0 + _wander(rng, count, 700.0, 0.06)

    covered = np.zeros(count)
    for _ in range(rng.poisson(length / 12000.0)):
        m = int(u(0, count))
        covered[m : m + int(u(80, 1200) / STEP)] = 1.0

    # Unevenness: displacement density falls with the square of the wave number (ISO 8608, A to C).
    fine = int(length / PROFILE_STEP)
    rough = np.array([2.0, 2.6, 1.6, 1.0])[zone] * float(np.exp(rng.normal(0.0, 0.35)))
    at_fine = np.minimum((np.arange(fine) * PROFILE_STEP / STEP).astype(int), count - 1)
    n0, gd = 0.1, 16e-6
    white = rng.normal(size=fine) * rough[at_fine]
    slope = 2.0 * np.pi * n0 * np.sqrt(gd) * white / np.sqrt(2.0 * PROFILE_STEP)
    keep = np.exp(-2.0 * np.pi * 0.01 * PROFILE_STEP)
    profile = lfilter([PROFILE_STEP], [1.0, -keep], slope)

    stops.sort()
    apart: list[tuple[float, float, float, float]] = []
    for s in stops:
        if s[0] > 80.0 and (not apart or s[0] - apart[-1][0] > 25.0):
            apart.append(s)
    table = np.array(apart if apart else [(length * 2.0, 5.0, 1.0, 0.0)])
    dropped = np.zeros(table.shape[0])
    if drop > 0.0:
        full = np.flatnonzero((table[:, 3] == 0.0) & (table[:, 1] > 18.0))[:12]
        if full.size:
            dropped[full] = drop * rng.dirichlet(np.full(full.size, 2.0))
    road = Road(
        step=STEP,
        grade=grade,
        curvature=curvature,
        crossfall=crossfall,
        heading=heading,
        plan=plan,
        fast=fast,
        shelter=shelter,
        texture=texture,
        profile=profile,
        profile_step=PROFILE_STEP,
        stop_at=table[:, 0].copy(),
        stop_time=table[:, 1].copy(),
        stop_decel=table[:, 2].copy(),
        stop_release=table[:, 3].copy(),
        stop_drop=dropped,
    )
    east = np.concatenate([[0.0], np.cumsum(np.sin(heading) * STEP)[:-1]])
    north = np.concatenate([[0.0], np.cumsum(np.cos(heading) * STEP)[:-1]])
    return road, Surroundings(zone, covered, east, north)
