"""Roads to drive on: bends, hills, limits and places to stop, over distance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from scipy.ndimage import uniform_filter1d

from weighbridge.errors import ConfigError
from weighbridge.signals import Floats

STEP: Final = 1.0
"""Grid step of every route [m]."""

RoadKind = Literal["city", "hills", "country", "highway"]

_ALONG: Final = ("grade", "heading", "bank", "limit", "surface", "roughness", "exposure")
_LIMIT: Final = {"city": 50 / 3.6, "hills": 50 / 3.6, "country": 80 / 3.6, "highway": 110 / 3.6}
_GRADE_STD: Final = {"city": 0.010, "hills": 0.020, "country": 0.014, "highway": 0.009}
_GRADE_LENGTH: Final = {"city": 110.0, "hills": 110.0, "country": 160.0, "highway": 350.0}
_WANDER: Final = {"city": 0.0, "hills": 0.0, "country": 1.0, "highway": 0.25}
_EXPOSURE: Final = {"city": 0.5, "hills": 0.5, "country": 0.85, "highway": 1.0}
_BLOCK: Final = {"city": 380.0, "hills": 380.0, "country": 3800.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """A road over distance; the same whoever drives it.

    Attributes
    ----------
    name : for people
    grade : (n,) slope at every metre [rad]
    heading : (n,) direction of the road, clockwise from north, unwrapped [rad]
    bank : (n,) cross slope, right side down [rad]
    limit : (n,) speed limit [m/s]
    surface : (n,) factor of the rolling resistance [-]
    roughness : (n,) factor of the road's unevenness, amplitude [-]
    exposure : (n,) wind over wind in the open [-]
    stops : (k,) where one may have to stop [m]
    stop_chance : (k,) how likely one has to [-]
    latitude, longitude : of the start [rad]
    altitude : of the start [m]
    """

    name: str
    grade: Floats
    heading: Floats
    bank: Floats
    limit: Floats
    surface: Floats
    roughness: Floats
    exposure: Floats
    stops: Floats
    stop_chance: Floats
    latitude: float = math.radians(56.036)
    longitude: float = math.radians(12.606)
    altitude: float = 40.0

    def __post_init__(self) -> None:
        n = self.grade.size
        for name in _ALONG:
            if getattr(self, name).shape != (n,):
                raise ConfigError(f"{name} of a route must have the length of its grade, {n}")
        if n < 50:
            raise ConfigError(f"a route must be at least 50 m long, got {n * STEP} m")

    @property
    def length(self) -> float:
        """Length along the road [m]."""
        return float((self.grade.size - 1) * STEP)

    @property
    def height(self) -> Floats:
        """Height above the start at every metre [m]."""
        rise = np.sin(self.grade)
        return np.concatenate(([0.0], np.cumsum(0.5 * (rise[1:] + rise[:-1])) * STEP))

    @property
    def curvature(self) -> Floats:
        """Curvature at every metre, positive to the right [1/m]."""
        return np.asarray(np.gradient(self.heading, STEP))

    def cut(self, end: float) -> Route:
        """Return the first ``end`` metres of the route."""
        n = int(end / STEP) + 1
        keep = self.stops < end - 30.0
        along = {name: getattr(self, name)[:n] for name in _ALONG}
        return replace(self, stops=self.stops[keep], stop_chance=self.stop_chance[keep], **along)


def flat_route(length: float, *, limit: float = 80 / 3.6, heading: float = 0.0) -> Route:
    """Return a straight and level road [m], [m/s], [rad]."""
    n = int(length / STEP) + 1
    one = np.ones(n)
    values = {"grade": 0.0, "heading": heading, "bank": 0.0, "limit": limit}
    along: dict[str, Any] = {name: values.get(name, 1.0) * one for name in _ALONG}
    return Route(name="flat", stops=np.empty(0), stop_chance=np.empty(0), **along)


def _smooth(values: Floats, sigma: float, mode: str = "nearest") -> Floats:
    """Smooth with a bell of standard deviation ``sigma`` samples: a box, thrice."""
    width = max(1, round(2.0 * sigma))
    for _ in range(3):
        values = uniform_filter1d(values, width, mode=mode)
    return np.asarray(values)


def _turn(curvature: Floats, at: int, angle: float, radius: float) -> None:
    """Add a turn whose curvature rises and falls smoothly."""
    length = max(4, int(1.9 * abs(angle) * radius / STEP))
    a = min(max(0, at - length // 2), curvature.size)
    b = min(curvature.size, at - length // 2 + length)
    if b <= a:
        return
    shape = np.sin(np.linspace(0.0, math.pi, b - a)) ** 2
    if shape.sum() > 0:
        curvature[a:b] += angle * shape / (shape.sum() * STEP)


def _leg(
    segments: Sequence[tuple[RoadKind, float]], rng: np.random.Generator
) -> tuple[list[RoadKind], Floats, Floats, list[tuple[float, float]]]:
    """One direction: kind and bends at every metre, and the places to stop."""
    kinds: list[RoadKind] = []
    for kind, length in segments:
        kinds += [kind] * int(length / STEP)
    n = len(kinds)
    curvature = np.zeros(n)
    stops: list[tuple[float, float]] = []
    start = 0
    for index, (kind, length) in enumerate(segments):
        count = int(length / STEP)
        if kind == "highway":
            # Ramps in and out, long shallow bends between.
            for at in (start + 120, start + count - 120):
                _turn(curvature, at, float(rng.choice([-1, 1])) * 0.8, 70.0)
            x = start + 900.0
            while x < start + count - 900:
                angle = float(rng.normal(0.0, 0.22))
                _turn(curvature, int(x), angle, float(rng.uniform(900, 2500)))
                x += float(rng.uniform(900, 2200))
        elif kind == "country":
            x = start + 150.0
            while x < start + count - 150:
                angle = float(rng.normal(0.0, 0.45))
                radius = float(np.exp(rng.uniform(math.log(90), math.log(600))))
                _turn(curvature, int(x), angle, radius)
                x += float(rng.uniform(200, 700)) + abs(angle) * radius
            x = start + float(rng.uniform(800, 2000))
            while x < start + count - 300:
                stops.append((x, 0.35))
                if rng.random() < 0.4:
                    _turn(curvature, int(x + 14), float(rng.choice([-1, 1])) * math.pi / 2, 13.0)
                x += _BLOCK["country"] * float(rng.uniform(0.5, 1.5))
        else:
            side = float(rng.choice([-1, 1]))
            x = start + float(rng.uniform(150, 300))
            while x < start + count - 100:
                stops.append((x, 0.40))
                if rng.random() < 0.35:
                    _turn(curvature, int(x + 14), side * math.pi / 2, float(rng.uniform(9, 14)))
                    side = -side
                else:
                    _turn(curvature, int(x + 120), float(rng.normal(0.0, 0.15)), 120.0)
                x += _BLOCK[kind] * float(rng.uniform(0.6, 1.5))
        if index:
            stops.append((start - 8.0, 0.4))
        start += count
    return kinds, np.asarray(curvature), np.cumsum(curvature) * STEP, stops


def _hills(kinds: Sequence[str], rng: np.random.Generator, peak: float) -> Floats:
    """Grade of one direction, zero at both ends."""
    n = len(kinds)
    white = rng.standard_normal(n)
    grade = np.zeros(n)
    labels = np.asarray(kinds)
    for kind, std in _GRADE_STD.items():
        rough = _smooth(white, _GRADE_LENGTH[kind] / STEP, mode="wrap")
        rough *= std / rough.std()
        weight = _smooth((labels == kind).astype(float), 120.0 / STEP, mode="nearest")
        grade += weight * rough
    where = np.flatnonzero(labels == "hills")
    if where.size:
        # Pairs of steep hills, up and down the other side.
        at = float(where[0]) + 350.0
        while at + 900.0 < where[-1]:
            x = (np.arange(n) * STEP - at) / 420.0
            inside = (x > 0) & (x < 1)
            grade[inside] += (
                peak
                * float(rng.uniform(0.75, 1.0))
                * np.sin(2 * math.pi * x[inside])
                * np.sin(math.pi * x[inside])
            )
            at += float(rng.uniform(650, 1100))
    # Hills are tens of metres high, not hundreds: what has piled up is taken back.
    height = np.cumsum(grade) * STEP
    slow = _smooth(height, 1500.0 / STEP, mode="nearest")
    grade -= 0.9 * np.gradient(slow, STEP)
    s = np.arange(n) * STEP
    grade *= np.clip(s / 150.0, 0, 1) * np.clip((s[-1] - s) / 150.0, 0, 1)
    return np.asarray(np.clip(grade, -0.09, 0.09))


def mixed_route(
    seed: int = 1,
    *,
    out: Sequence[tuple[RoadKind, float]],
    back: Sequence[tuple[RoadKind, float]],
    heading: float = math.radians(200.0),
    peak_grade: float = 0.065,
    name: str = "mixed",
) -> Route:
    """Make a road out and back: the hills are the same in both directions.

    Parameters
    ----------
    seed : int
        Of the road; the driver has a seed of their own.
    out, back : sequence of (kind, length [m])
        Kinds are "city", "hills" (a city with steep hills), "country" and
        "highway"; both directions must be as long.
    heading : float
        First direction [rad].
    peak_grade : float
        Of the steep hills [rad].
    name : str

    Returns
    -------
    Route
        Its end is as high as its start.
    """
    total_out, total_back = sum(length for _, length in out), sum(length for _, length in back)
    if abs(total_out - total_back) > STEP:
        raise ConfigError(
            f"a route must be as long back as out, got {total_out} m and {total_back} m"
        )
    rng = np.random.default_rng(seed)
    kinds_out, bends_out, _, stops_out = _leg(out, rng)
    kinds_back, bends_back, _, stops_back = _leg(back, rng)
    n = len(kinds_out)
    kinds_back = (kinds_back + [kinds_back[-1]] * n)[:n]
    bends_back = np.resize(bends_back, n)
    grade_out = _hills(kinds_out, rng, peak_grade)
    white = _smooth(rng.standard_normal(n), 1500.0 / STEP, mode="nearest")
    weight = _smooth(np.array([_WANDER[k] for k in kinds_out]), 300.0 / STEP)
    wander = np.cumsum(weight * white * (1.2e-4 / max(white.std(), 1e-12))) * STEP
    # Both ways follow the same general direction, each with bends of its own, and
    # the road turns round where it ends.
    bends = np.cumsum(_smooth(np.concatenate((bends_out, bends_back)), 3.0)) * STEP
    bends -= _smooth(bends, 1200.0 / STEP, mode="nearest")
    s = np.arange(2 * n) * STEP
    turn = math.pi * 0.5 * (1.0 + np.tanh((s - n * STEP) / 9.0))
    course = heading + np.concatenate((wander, wander[::-1])) + bends + turn
    kinds = kinds_out + kinds_back
    labels = np.asarray(kinds)
    limit = np.array([_LIMIT[k] for k in kinds])
    # Country roads pass villages.
    for at in rng.uniform(0, s[-1], int(s[-1] / 6000)):
        inside = (labels == "country") & (np.abs(s - at) < 300.0)
        limit[inside] = 60 / 3.6
    surface = 1.0 + 0.06 * _patches(rng, s.size, 2500.0)
    roughness = np.exp(0.25 * np.clip(_patches(rng, s.size, 900.0), -2, 2)) * np.where(
        labels == "highway", 0.75, 1.0
    )
    curve = np.gradient(course, STEP)
    bank = 0.02 + np.clip(curve * limit**2 / 9.81 * 0.25, -0.05, 0.05)
    bank = _smooth(bank, 25.0)
    places = [*stops_out, *[(x + n * STEP, chance) for x, chance in stops_back]]
    places.sort()
    return Route(
        name=name,
        grade=np.concatenate((grade_out, -grade_out[::-1])),
        heading=np.asarray(course),
        bank=np.asarray(bank),
        limit=limit,
        surface=surface,
        roughness=roughness,
        exposure=_smooth(np.array([_EXPOSURE[k] for k in kinds]), 60.0),
        stops=np.array([x for x, _ in places]),
        stop_chance=np.array([c for _, c in places]),
    )


def _patches(rng: np.random.Generator, n: int, length: float) -> Floats:
    """Smooth noise of unit standard deviation."""
    rough = _smooth(rng.standard_normal(n), length / 2.5 / STEP, mode="nearest")
    return np.asarray((rough - rough.mean()) / max(float(rough.std()), 1e-12))


def jensen_route(seed: int = 1) -> Route:
    """Return a route like the test route of Jensen 2022, appendix A, 82 km."""
    return mixed_route(
        seed,
        out=[
            ("city", 1000),
            ("country", 15000),
            ("highway", 18000),
            ("city", 3000),
            ("hills", 4500),
        ],
        back=[
            ("hills", 4500),
            ("city", 3000),
            ("highway", 25500),
            ("country", 7500),
            ("city", 1000),
        ],
        name="city, country, highway and hills, 83 km",
    )


def straight_route(seed: int = 11, *, length: float = 5000.0, limit: float = 70 / 3.6) -> Route:
    """Return a straight road that undulates gently, 0.4 % in the mean [m], [m/s]."""
    rng = np.random.default_rng(seed)
    flat = flat_route(length, limit=limit)
    grade = 0.004 * _patches(rng, flat.grade.size, 700.0)
    return replace(
        flat,
        name="straight",
        grade=grade * np.clip(np.arange(grade.size) * STEP / 150.0, 0.0, 1.0),
        surface=1.0 + 0.03 * _patches(rng, flat.grade.size, 2500.0),
    )


def bus_route(seed: int = 12) -> tuple[Route, Floats]:
    """Return an urban bus line, out and back, 18 km, and where it stops [m]."""
    route = mixed_route(
        seed,
        out=[("city", 5000), ("hills", 1500), ("city", 2500)],
        back=[("city", 2500), ("hills", 1500), ("city", 5000)],
        heading=math.radians(70.0),
        peak_grade=0.045,
        name="urban bus line, 18 km",
    )
    rng = np.random.default_rng([seed, 1])
    places = np.cumsum(rng.uniform(380.0, 720.0, 60))
    return route, places[places < route.length - 200.0]


def short_route(seed: int = 2) -> Route:
    """Return a short mixed route, 8 km, for a quick look."""
    return mixed_route(
        seed,
        out=[("city", 900), ("hills", 1000), ("country", 2200)],
        back=[("country", 2200), ("city", 1900)],
        name="short, 8 km",
    )


def highway_route(seed: int = 3, *, length: float = 20000.0) -> Route:
    """Return a highway, out and back."""
    return mixed_route(
        seed,
        out=[("city", 600), ("highway", length)],
        back=[("highway", length), ("city", 600)],
        heading=math.radians(160.0),
        name="highway out and back",
    )


def hilly_route(seed: int = 4, *, length: float = 23000.0) -> Route:
    """Return country roads and hills, where every gear can be used."""
    half = length / 2
    return mixed_route(
        seed,
        out=[("city", 1000), ("country", half), ("hills", 4000), ("highway", half)],
        back=[("highway", half), ("hills", 4000), ("country", half), ("city", 1000)],
        heading=math.radians(30.0),
        name="country, hills and highway",
    )
