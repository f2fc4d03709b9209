"""How often is a change of load found by the tilt of a parked vehicle? Run me.

    python studies/kerb.py

Vehicles of ``kerb_model`` stand at the kerb, 18 times each. The motion weighs the change of load of
each stop afterwards, with a standard deviation of `WEIGHED_STD`. From the third stop on it is
judged what `weighbridge.estimators.tilt` reports, second by second. The same is asked at the stops
of recorded drives in ``../shared/data``, by the maps of simulated cars. It fills
``kerb.template.md``. Nothing was tuned on the seeds of `JUDGED`; ``--tuning`` takes others, and
prints the table only.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from kerb_model import CAR, RATE, TRUCK, VAN, Stop, random_vehicle, stops
from pages import filled

import weighbridge as wb
from weighbridge.estimators import tilt
from weighbridge.estimators.tilt import Learnt, TiltChange, TiltMap
from weighbridge.live.kerb import STANDS

HERE: Final = Path(__file__).parent
DATA: Final = HERE.parents[1] / "shared" / "data"
EXAMPLES: Final = HERE.parent / "examples"

KINDS: Final = {
    "cars": (CAR, False, 20),
    "vans": (VAN, False, 20),
    "trucks": (TRUCK, False, 10),
    "cars that level themselves": (CAR, True, 10),
    "vans that level themselves": (VAN, True, 10),
}
"""Class, whether the rear axle levels itself, and how many vehicles."""

JUDGED: Final = 7000
TUNED: Final = 100
"""First seeds."""

LOADED: Final = 8
QUIET: Final = 8
"""Stops that are judged of each vehicle, with and without a change of load."""

LEARNT: Final = 2
"""Stops before them."""

WEIGHED_STD: Final = 0.015
"""Standard deviation of a change by the motion [-]."""

SOON: Final = 30.0
"""A change is to be reported within so long [s]."""

FORWARD: Final = np.array([1.0, 0.0, 0.0])
MAPS: Final = 5
"""Cars by whose maps the recorded stops are read."""

SHORTEST: Final = 10.0
"""Recorded stops that count [s]."""


@dataclass(frozen=True)
class Judged:
    """What was reported at one stop.

    Attributes
    ----------
    change : true, relative [-]; 0 at a quiet stop
    people : the load was people
    in_time : what was reported last before `SOON` was over; None for nothing
    false : something was reported at a quiet stop
    """

    change: float
    people: bool
    in_time: TiltChange | None
    false: bool


def reported(
    means: np.ndarray, map_: TiltMap, seconds: np.ndarray
) -> tuple[list[tuple[float, TiltChange]], tilt.Tilt | None]:
    """Give what is reported second by second, and the tilt at the end.

    Parameters
    ----------
    means : (n, 3) mean specific force of each second [m/s^2]
    map_ : of the vehicle
    seconds : (n,) since the vehicle stands, at the end of each [s]
    """
    stand, found = tilt.begin(0.0), []
    for second, mean in zip(seconds, means, strict=True):
        stand = tilt.step(stand, float(second), mean)
        now = tilt.tilt(stand, FORWARD)
        change = None if now is None else map_.read(now.pitch, now.var, now.stood)
        if change is not None and change.sure:
            found.append((float(second), change))
    last = tilt.tilt(stand, FORWARD, ends=True)
    change = None if last is None else map_.read(last.pitch, last.var, last.stood)
    if change is not None and change.sure:
        found.append((float(seconds[-1]), change))
    return found, last


def judged(stop: Stop, mass: float, found: list[tuple[float, TiltChange]]) -> Judged:
    """Compare what was reported with the truth."""
    loaded = np.isfinite(stop.load_end)
    in_time = [c for at, c in found if not loaded or at <= stop.load_end + SOON]
    return Judged(
        change=stop.net / mass if loaded else 0.0,
        people="people" in stop.what,
        in_time=in_time[-1] if in_time else None,
        false=bool(found) and not loaded,
    )


def vehicle(kind: str, seed: int, *, levels: bool) -> tuple[list[Judged], TiltMap]:
    """Let a vehicle stand, learn and report."""
    rng = np.random.default_rng([seed, 5])
    car, map_ = random_vehicle(kind, seed, levels=levels), TiltMap()
    results = []
    for k, (stop, mass) in enumerate(stops(car, seed, LOADED, QUIET)):
        length = int(stop.time[-1])
        second = stop.time.astype(int)
        sums = [np.bincount(second, stop.accel[:, a])[:length] for a in range(3)]
        found, last = reported(np.column_stack(sums) / RATE, map_, np.arange(length) + 1.0)
        if k >= LEARNT:
            results.append(judged(stop, mass, found))
        if last is not None:
            change = stop.net / mass if np.isfinite(stop.load_end) else 0.0
            by_motion = change + WEIGHED_STD * rng.normal()
            map_ = map_.with_stop(Learnt(last.pitch, last.var, by_motion, WEIGHED_STD**2))
    return results, map_


@dataclass
class Class:
    """All of one row.

    Attributes
    ----------
    stops : judged
    maps : of the vehicles after their last stop
    """

    stops: list[Judged] = field(default_factory=list)
    maps: list[TiltMap] = field(default_factory=list)

    def row(self, name: str) -> str:
        loads = [s for s in self.stops if s.change]
        quiet = [s for s in self.stops if not s.change]
        found = [s for s in loads if s.in_time]
        right = [s for s in found if s.in_time.change * s.change > 0.0]
        many = [s for s in loads if abs(s.change) >= 0.15]
        many_right = [s for s in right if abs(s.change) >= 0.15]
        error = np.array([s.in_time.change / s.change - 1.0 for s in right])
        holds = [abs(s.in_time.change - s.change) < 1.96 * s.in_time.std for s in found]
        false = sum(s.false for s in quiet)
        follow = sum(m.follows is True for m in self.maps)
        sizes = "– | – | –"
        if error.size:
            rms = 100.0 * np.sqrt((error**2).mean())
            within = int(np.count_nonzero(np.abs(error) < 0.15))
            sizes = f"{within} of {error.size} | {rms:.0f} % | {sum(holds)} of {len(holds)}"
        return (
            f"| {name} | {follow} of {len(self.maps)} | {len(right)} of {len(loads)} "
            f"| {len(many_right)} of {len(many)} | {len(found) - len(right)} | {sizes} "
            f"| {false} of {len(quiet)} |"
        )


def recorded() -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Give the stops of recorded drives.

    Yields
    ------
    source : name of the recording
    means : (n, 3) mean specific force of each second along forward, right, down [m/s^2]
    seconds : (n,) since it stands [s]
    """
    for path in sorted((DATA / "bmw-i3").glob("Trip*.csv")):
        drive = wb.read_drive(path, EXAMPLES / "bmw-i3" / "mapping.toml")
        along = drive.signals["longitudinal_accel"]
        # One axis is recorded; gravity is nearly all of the rest.
        accel = np.column_stack([along.values, 0.0 * along.values, 0.0 * along.values - 9.81])
        yield from _stops(path.parent.name, drive, along.time, accel)
    folder = DATA / "canedge-obd-imu-gnss"
    for path in sorted(folder.glob("*/*.MF4")):
        drive = wb.read_drive(
            path, EXAMPLES / "canedge" / "mapping.toml", folder / "canmod-gps.dbc"
        )
        if "accel_x" not in drive.signals:
            continue
        x, y, z = (drive.signals[f"accel_{a}"] for a in "xyz")
        # Forward is near the sensor's -y.
        accel = np.column_stack([-y.at(x.time), x.values, z.at(x.time)])
        yield from _stops("canedge-obd-imu-gnss", drive, x.time, accel)


def _stops(
    source: str, drive: wb.Drive, time: np.ndarray, accel: np.ndarray
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    assert drive.speed is not None
    still = (drive.speed.held(time) <= STANDS) & np.isfinite(accel).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]])))
    for first, end in edges.reshape(-1, 2):
        length = int(time[end - 1] - time[first])
        if length < SHORTEST:
            continue
        second = np.minimum((time[first:end] - time[first]).astype(int), length)
        count = np.bincount(second, minlength=length + 1)[:length]
        sums = [np.bincount(second, a, minlength=length + 1)[:length] for a in accel[first:end].T]
        have = count >= 3
        means = np.column_stack(sums)[have] / count[have, None]
        yield source, means, (np.arange(length) + 1.0)[have]


def of_recorded(maps: list[TiltMap]) -> dict[str, str]:
    """Count what is reported at recorded stops, and how far the pitch changes there."""
    pitch: dict[str, list[float]] = {}
    lengths, reports = [], 0
    for source, means, seconds in recorded():
        last = None
        for map_ in maps:
            found, last = reported(means, map_, seconds)
            reports += bool(found)
        pitch.setdefault(source, []).append(np.nan if last is None else 1e3 * last.pitch)
        lengths.append(float(seconds[-1]))
    changes = np.abs(np.concatenate([np.array(p) for p in pitch.values()]))
    changes = changes[np.isfinite(changes)]
    return {
        "recorded_bmw": str(len(pitch["bmw-i3"])),
        "recorded_canedge": str(len(pitch["canedge-obd-imu-gnss"])),
        "recorded_length": f"{np.median(lengths):.0f}",
        "recorded_median": f"{np.median(changes):.1f}",
        "recorded_ninety": f"{np.percentile(changes, 90):.1f}",
        "recorded_most": f"{changes.max():.1f}",
        "recorded_maps": str(len(maps)),
        "recorded_reads": str(len(maps) * len(lengths)),
        "recorded_false": str(reports),
    }


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tuning", action="store_true", help="other seeds; print the table only")
    given = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    rows, made = [], {}
    for name, (kind, levels, many) in KINDS.items():
        made[name] = Class()
        first = TUNED if given.tuning else JUDGED
        for seed in range(first, first + many):
            results, map_ = vehicle(kind, seed, levels=levels)
            made[name].stops += results
            made[name].maps.append(map_)
        rows.append(made[name].row(name))
        print(rows[-1], flush=True)
    if given.tuning:
        return
    cars = made["cars"]
    with_people = [s for s in cars.stops if s.change and s.people]
    goods = [s for s in cars.stops if s.change and not s.people]
    quiet = [s for c in made.values() for s in c.stops if not s.change]
    values = {
        "rows": "\n".join(rows),
        "people": f"{sum(s.in_time is not None for s in with_people)} of {len(with_people)}",
        "goods": f"{sum(s.in_time is not None for s in goods)} of {len(goods)}",
        "false": str(sum(s.false for s in quiet)),
        "quiet": str(len(quiet)),
        **of_recorded([m for m in cars.maps if m.follows][:MAPS]),
    }
    text = filled(HERE / "kerb.template.md", values)
    (HERE / "kerb.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
