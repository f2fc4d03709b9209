"""A fleet: drives per second and core, scaling, overhead, first row, memory, straight lines.

Run on a quiet machine with an installed package: ``pip install ".[fleet]" && python
benchmarks/fleet.py [PART ...]``; parts are rate, overhead, first, lines. Seeds 169000 to 169003 of
the own simulator. Every drive has content of its own: tables from a pool and a ``drive.toml``.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl
import psutil

import weighbridge as wb
from weighbridge.fleet.store import Results
from weighbridge.io.write import write_drive
from weighbridge.signals import Drive, Signal
from weighbridge.simulation import make_scenario, simulate_car
from weighbridge.vehicle.known import Known, describe

# Stands for a drive that takes 0.2 s to weigh; read by the workers as they start.
FIXED = """
import time
from weighbridge.fleet import job
from weighbridge.fleet.schema import WEIGHED
def fixed(given, paths):
    until = time.process_time() + 0.2
    while time.process_time() < until:
        pass
    return [job._row(given, WEIGHED, "")]
job._weighed = fixed
"""


class Ran(NamedTuple):
    """One run of the command: wall time, time to the first row [s], peak memory of all [MB]."""

    seconds: float
    first: float
    memory: float


def run(drives: Path, cars: Path, results: Path, workers: int, stop_at: int = 0, **extra) -> Ran:
    """Run the command; measure it from its start, with all processes that it starts."""
    words = [f"{drives}/**", "--vehicles", str(cars), "-o", str(results), "--workers", str(workers)]
    begin, first, peak = time.perf_counter(), 0.0, 0.0
    child = subprocess.Popen(
        [sys.executable, "-m", "weighbridge", "fleet", *words],
        stdout=subprocess.DEVNULL,
        env=os.environ | extra,
    )
    watched = psutil.Process(child.pid)
    while child.poll() is None:
        parts = len(Results(results).part_files()) if not first or stop_at else 1
        if parts and not first:
            first = time.perf_counter() - begin
        if stop_at and parts >= stop_at:
            child.send_signal(2)
            stop_at = 0
        total = 0
        for process in (watched, *watched.children(recursive=True)):
            try:
                total += process.memory_info().rss
            except psutil.Error:
                continue
        peak = max(peak, total / 1e6)
        time.sleep(0.05)
    return Ran(time.perf_counter() - begin, first, peak)


def rate(results: Path) -> float:
    """Rows per second between the first row and the last."""
    times = wb.fleet.read_drives(results).collect()["weighed_at"].sort()
    return (len(times) - 1) / (times[-1] - times[0]).total_seconds()


def processor_time() -> float:
    """Processor time of all processes that ended, with theirs [s]."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def thinned(drive: Drive, rate: float) -> Drive:
    """Twenty minutes of a drive, each signal at most at so many values per second."""
    part = drive.between(drive.start + 600.0, drive.start + 1800.0)
    slow = []
    for signal in part.signals.values():
        step = max(1, round(1.0 / (rate * signal.period)))
        count = len(signal) // step
        means = (
            x[: count * step].reshape(count, step).mean(axis=1)
            for x in (signal.time, signal.values)
        )
        slow.append(Signal(signal.name, *means))
    return part.with_signals(*slow)


def pool(home: Path) -> tuple[Path, Path]:
    """Return the folder of vehicle files, and that of the two drives all others are made of."""
    cars, drives = home / "cars", home / "pool"
    cars.mkdir()
    known = simulate_car(make_scenario("car-calibration", seed=169000))
    wb.calibrate([known.drive], mass=float(known.truth.mass.mean())).save(cars / "car.toml")
    made = simulate_car(make_scenario("car", seed=169003, payload=150.0))
    write_drive(made.drive, drives / "long", "parquet")
    write_drive(thinned(made.drive, 10.0), drives / "short", "parquet")
    return cars, drives


def copies(source: Path, home: Path, count: int) -> Path:
    """Make drives of their own content from the tables of one."""
    for k in range(count):
        folder = home / "car" / f"{k:06d}"
        folder.mkdir(parents=True)
        for table in source.glob("*.parquet"):
            (folder / table.name).symlink_to(table)
        day = f"2026-05-{1 + k % 28:02d}T06:00:00Z"
        (folder / "drive.toml").write_text(f'start_time = "{day}"\nnotes = "{k}"\n')
    return home


def tiny(home: Path, count: int) -> tuple[Path, Path]:
    """Make drives of a few samples, which are read and refused within milliseconds."""
    cars = home / "cars"
    cars.mkdir(parents=True)
    describe(Known(name="van", kind="van", torque="percent")).vehicle.save(cars / "car.toml")
    rows = "time_s,vehicle_speed_kmh\n0,10\n1,11\n2,12\n3,13\n"
    for k in range(count):
        folder = home / "drives" / "car" / f"{k:06d}"
        folder.mkdir(parents=True)
        (folder / "obd.csv").write_text(rows + f"4,{k / 1000}\n")
    return home / "drives", cars


def say(what: str, value: str) -> None:
    print(f"{what:<66}{value}", flush=True)


def rates(home: Path) -> None:
    """Drives per second and core, and what a second worker adds."""
    cars, drives = pool(home)
    # Kernels are compiled before.
    run(copies(drives / "short", home / "warm", 2), cars, home / "warm-results", 1)
    for name, count, target in (("short", 60, 10.0), ("long", 16, 2.0)):
        source = copies(drives / name, home / name, count)
        found = {}
        for workers in (1, 2):
            results = home / f"{name}-{workers}"
            ran = run(source, cars, results, workers)
            found[workers] = rate(results)
            what = f"{name} drives, {workers} worker(s): drives/s and core (target {target:g})"
            say(what, f"{found[workers] / workers:.2f}, {ran.memory:.0f} MB in all")
        say("  2 workers over 1 (target 1.7)", f"{found[2] / found[1]:.2f} x")


def overhead(home: Path) -> None:
    """What the engine adds to drives of 0.2 s."""
    (home / "fixed.py").write_text(FIXED)
    preload = {"DASK_DISTRIBUTED__WORKER__PRELOAD": str(home / "fixed.py")}
    spent = {}
    for count in (50, 350):
        drives, cars = tiny(home / f"fixed-{count}", count)
        before = processor_time()
        run(drives, cars, home / f"fixed-results-{count}", 1, **preload)
        spent[count] = processor_time() - before
    each = 1.0 / rate(home / "fixed-results-350")
    say("engine, drives of 0.2 s, 1 worker (target 5 %)", f"{500.0 * each - 100.0:+.1f} %")
    each = (spent[350] - spent[50]) / 300
    say("  in processor time of all processes", f"{500.0 * each - 100.0:+.1f} %")


def first(home: Path) -> None:
    """Time from the command to the first row, of 100 000 drives."""
    drives, cars = tiny(home / "many", 100_000)
    ran = run(drives, cars, home / "many-results", 2, stop_at=50)
    say("first row of 100 000 queued drives (target 5 s)", f"{ran.first:.1f} s")


def lines(home: Path, most: int) -> None:
    """Time and memory over the number of drives."""
    for count in (10, 100, 1000, 10_000):
        if count > most:
            break
        drives, cars = tiny(home / f"line-{count}", count)
        before = processor_time()
        ran = run(drives, cars, home / f"line-results-{count}", 2)
        spent = processor_time() - before
        whole = wb.fleet.read_drives(home / f"line-results-{count}")
        rows = whole.select(pl.len()).collect().item()
        say(
            f"{rows} tiny drives, 2 workers",
            f"{ran.seconds:.1f} s, processors {spent:.1f} s, {ran.memory:.0f} MB, "
            f"{rate_text(home, count)}",
        )


def rate_text(home: Path, count: int) -> str:
    """Drives per second once all runs."""
    return f"{rate(home / f'line-results-{count}'):.0f} drives/s"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", default=["rate", "overhead", "first", "lines"])
    parser.add_argument("--most", type=int, default=10_000, help="drives of the longest line")
    given = parser.parse_args()
    np.seterr(all="ignore")
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        if "rate" in given.parts:
            rates(home)
        if "overhead" in given.parts:
            overhead(home)
        if "first" in given.parts:
            first(home)
        if "lines" in given.parts:
            lines(home, given.most)


if __name__ == "__main__":
    main()
