"""Live weighing: share of a core, time of a step, age of what is shown, memory over a day.

Run with an installed package, whose compiled code is cached: ``pip install . && python
benchmarks/live.py``; ``--hours 24`` replays a day for the memory. The yardstick is openpilot, whose
``locationd``, ``paramsd`` and ``torqued`` may take 25, 9 and 5 % of a core (its
``selfdrive/test/test_onroad.py``).
"""

from __future__ import annotations

import argparse
import math
import os
import resource
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

import weighbridge as wb
from weighbridge.live.replay import BLOCK, FASTEST_BLOCK
from weighbridge.signals import LONGEST_STEP, Drive
from weighbridge.simulation import make_scenario, simulate_car

OPENPILOT = 25.0 + 9.0 + 5.0
"""Of a core, all that weighs, steers and learns there [%]."""


def made(seed: int, name: str = "car", bus: float = 4.0) -> tuple[Drive, float]:
    """Simulate a drive with a 200 Hz inertial sensor; return it and its mass.

    ``bus`` is how often all values of the bus are asked for [Hz].
    """
    scenario = make_scenario(name, seed=seed)
    scenario = replace(scenario, polling=replace(scenario.polling, rate=bus))
    return simulate_car(scenario).drive, scenario.mass


def blocks(drive: Drive, length: float, shift: float = 0.0):
    """Samples of a drive in blocks of so long [s], stamps moved by ``shift``."""
    for start, end in pairwise(drive.start + np.arange(0.0, drive.duration + 2.0 * length, length)):
        part = drive.between(start, end)
        yield {n: (s.time + shift, s.values) for n, s in part.signals.items()}


def replayed(car: wb.Vehicle, drive: Drive) -> None:
    """Feed a drive as ``weighbridge live --replay`` does as fast as it goes, shown each second."""
    scale = wb.LiveScale(car, info=drive.info, step=LONGEST_STEP)
    parts = list(blocks(drive, FASTEST_BLOCK))
    begin, wall = time.process_time(), time.perf_counter()
    for samples in parts:
        scale.update_block(samples)
        scale.weighing()
    spent, wall = time.process_time() - begin, time.perf_counter() - wall
    print(f"{'replay of ' + f'{drive.duration / 60:.0f} min, real time':<44}"
          f"{drive.duration / wall:8.0f} x")  # fmt: skip
    print(f"{'the same by processor time':<44}{drive.duration / spent:8.0f} x")


def on_the_way(car: wb.Vehicle, drive: Drive, every: float = 1.0) -> None:
    """Feed a drive as sources do, and show it: processor time, and the age of each mass shown."""
    scale = wb.LiveScale(car, info=drive.info)
    parts, shown_at, looked = list(blocks(drive, BLOCK)), -np.inf, 0.0
    shown, settled = [], []
    begin = time.process_time()
    for samples in parts:
        scale.update_block(samples)
        if scale.newest - shown_at < every:
            continue
        shown_at = scale.newest
        settled.append(scale.weighing().age)
        before = time.process_time()
        told = scale.weighing(ahead=True)
        if told.provisional:
            looked += time.process_time() - before
            shown.append(told.age)
    core = 100.0 * (time.process_time() - begin) / drive.duration
    print(f"{'share of a core, all that it learns included':<44}{core:8.2f} %")
    print(f"{'of it to look ahead once a second':<44}{100.0 * looked / drive.duration:8.2f} %")
    print(f"{'the same over the budgets of openpilot':<44}{core / OPENPILOT:8.3f} x")
    for name, ages in (("of what is shown", shown), ("of the settled mass", settled)):
        known = np.array(ages)[np.isfinite(ages)]
        print(f"{f'age {name}, least, median and 99 %':<44}{known.min():8.2f} s "
              f"{np.median(known):.2f} s {np.percentile(known, 99.0):.2f} s")  # fmt: skip


class Waiting(NamedTuple):
    """By wall clock: between two weighings, and their ages when shown and replaced [s]."""

    stalls: list[float]
    ages: list[float]
    replaced: list[float]


def by_wall_clock(car: wb.Vehicle, drive: Drive, *, aside: bool, every: float = 1.0) -> None:
    """Feed a drive as sources do, in its own time, and tell what a person sees who has a watch.

    Blocks come when they are over. One thread takes them in turn. It waits while it looks at all
    records, or with ``aside`` goes on meanwhile, as ``weighbridge live`` does in a vehicle.
    """
    scale = wb.LiveScale(car, info=drive.info)
    scale.looks_aside = aside
    due, begin = drive.start, time.perf_counter()
    seen = shown = told_for = math.nan
    waiting = Waiting([], [], [])
    for k, samples in enumerate(blocks(drive, BLOCK)):
        time.sleep(max(0.0, begin + (k + 1) * BLOCK - time.perf_counter()))
        scale.update_block(samples)
        if scale.newest < due:
            continue
        due = scale.newest + every
        told = scale.weighing(ahead=True)
        seen, shown = shown, drive.start + time.perf_counter() - begin
        if math.isfinite(seen):
            waiting.stalls.append(shown - seen - every)
        if math.isfinite(told.time):
            waiting.ages.append(shown - told.time)
        if math.isfinite(told_for):
            waiting.replaced.append(shown - told_for)
        told_for = told.time
    scale.finish()
    print(f"by a watch, looks {'beside' if aside else 'in between'}, median, 99 % and most")
    for what, values in (
        ("longer than a second between two weighings shown", waiting.stalls),
        ("age of a weighing when it is shown", waiting.ages),
        ("age of a weighing when the next one takes its place", waiting.replaced),
    ):
        if values:
            low, high, most = np.percentile(values, [50.0, 99.0, 100.0])
            print(f"  {what:<52}{low:8.2f} s {high:.2f} s {most:.2f} s")


def sample_by_sample(car: wb.Vehicle, drive: Drive, span: float = 300.0) -> None:
    """Feed one sample at a time: what each takes."""
    part = drive.between(drive.start, drive.start + span)
    samples = sorted(
        (t, n, v)
        for n, s in part.signals.items()
        for t, v in zip(s.time.tolist(), s.values.tolist(), strict=True)
    )
    scale = wb.LiveScale(car, info=drive.info)
    taken = np.empty(len(samples))
    for k, (at, name, value) in enumerate(samples):
        begin = time.perf_counter()
        scale.update(at, name, value)
        taken[k] = time.perf_counter() - begin
    print(f"{'one sample, median':<44}{1e6 * np.median(taken):8.1f} us")
    for part_of in (99.0, 99.9, 100.0):
        print(f"{f'one sample, {part_of:g} %':<44}{1e3 * np.percentile(taken, part_of):8.2f} ms")


def a_day(car: wb.Vehicle, drive: Drive, hours: float) -> None:
    """Replay drives one after another with stops between them: memory each hour."""
    scale = wb.LiveScale(car, info=drive.info)
    told, shift, next_hour, begin = [], 0.0, 3600.0, time.perf_counter()
    while shift < 3600.0 * hours:
        for samples in blocks(drive, 10.0, shift):
            scale.update_block(samples)
            scale.weighing()
        shift += drive.duration + 600.0
        if shift >= next_hour:
            told.append((shift / 3600.0, current_memory()))
            next_hour += 3600.0
    wall = time.perf_counter() - begin
    for at, memory in told:
        print(f"  after {at:4.1f} h {memory:8.0f} MB, {scale.weighing().status}")
    print(f"{'memory at the end over that after two hours':<44}"
          f"{told[-1][1] / told[min(1, len(told) - 1)][1]:8.2f} x")  # fmt: skip
    print(f"{'replay of it all, real time':<44}{shift / wall:8.0f} x")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(f"{'peak memory':<44}{peak:8.0f} MB")


def current_memory() -> float:
    """Memory of this process now [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 2**20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=0.0)
    parser.add_argument("--bus", type=float, default=4.0, help="rate of the bus [Hz]")
    parser.add_argument(
        "--watch", type=float, default=12.0, help="twice so long in real time [min]"
    )
    parser.add_argument("--scenario", default="car", help="such as car-short")
    asked = parser.parse_args()
    known, mass = made(61, asked.scenario, asked.bus)
    car = wb.calibrate(known, mass=mass)
    drive, _ = made(62, asked.scenario, asked.bus)
    print(f"load of the machine{os.getloadavg()[0]:8.1f}")
    watched = drive.between(drive.start, drive.start + 60.0 * asked.watch)
    for aside in (False, True):
        by_wall_clock(car, watched, aside=aside)
    replayed(car, drive)
    replayed(car, drive)
    on_the_way(car, drive)
    sample_by_sample(car, drive)
    if asked.hours > 0.0:
        a_day(car, drive, asked.hours)


if __name__ == "__main__":
    main()
