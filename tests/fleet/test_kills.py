"""Kills at random points of a fleet on a scheduler and workers started by hand."""

import contextlib
import json
import os
import random
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

import weighbridge as wb
from tests.fleet.fleets import compared, tiny_fleet
from weighbridge.fleet.store import Results

KILLS = int(os.environ.get("WEIGHBRIDGE_KILLS", "0"))
DRIVES = 120


class Cluster:
    """``dask scheduler`` and two times ``dask worker``, as docs/fleet.md starts them."""

    def __init__(self, home: Path) -> None:
        self.home = home
        self.number = 0
        self.workers: list[subprocess.Popen] = []
        self.scheduler: subprocess.Popen | None = None
        self.address = ""

    def start(self, workers: int = 2) -> str:
        if self.scheduler is None or self.scheduler.poll() is not None:
            self.stop()
            self.number += 1
            told = self.home / f"scheduler-{self.number}.json"
            self.scheduler = self._dask(
                "scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(told)
            )
            until = time.monotonic() + 60
            while time.monotonic() < until:
                # Written in place: it may be there in half.
                with contextlib.suppress(OSError, ValueError):
                    self.address = json.loads(told.read_text())["address"]
                    break
                time.sleep(0.05)
            self.file = told
        while len(self.workers) < workers:
            self.workers.append(
                self._dask(
                    "worker",
                    "--scheduler-file",
                    str(self.file),
                    "--nthreads",
                    "1",
                    "--no-dashboard",
                )
            )
        return self.address

    def _dask(self, *words: str) -> subprocess.Popen:
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *words],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def kill_worker(self) -> None:
        """Kill a process that weighs, which its nanny starts again."""
        (nanny,) = random.sample(self.workers, 1)
        for child in psutil.Process(nanny.pid).children(recursive=True):
            if "spawn_main" in " ".join(child.cmdline()):
                child.kill()
                return

    def stop(self) -> None:
        # Workers end with their nanny.
        for process in (*self.workers, self.scheduler):
            if process is not None:
                process.kill()
                process.wait()
        self.workers, self.scheduler = [], None


@pytest.fixture
def cluster(tmp_path):
    made = Cluster(tmp_path)
    yield made
    made.stop()


def words_of(address, drives, cars, results, *more):
    words = ["fleet", drives, "--vehicles", cars, "-o", results, "--scheduler", address, *more]
    return [str(word) for word in words]


def begun(*words):
    return subprocess.Popen(
        [sys.executable, "-m", "weighbridge", *words_of(*words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def rows_there(results: Path) -> int:
    return wb.fleet.read_drives(results).collect().height if results.exists() else 0


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.skipif(not KILLS, reason="takes minutes: WEIGHBRIDGE_KILLS=50 says how many kills")
def test_kills_at_random_points_lose_and_double_nothing(cluster, tmp_path):
    """Scheduler, worker or command is killed at a random point, and the command given again."""
    chosen = random.Random(20)
    drives, cars = tiny_fleet(tmp_path, DRIVES)
    expected, finished, killed, round_ = None, 0, {}, 0
    results = tmp_path / "results-0"
    while sum(killed.values()) < KILLS or rows_there(results) < DRIVES:
        process = begun(cluster.start(), drives, cars, results)
        there = rows_there(results)
        at = chosen.randint(there, DRIVES)
        wait_until(process, results, at, chosen.uniform(0.0, 0.2))
        what = chosen.choice(["command", "worker", "scheduler"])
        if sum(killed.values()) < KILLS and process.poll() is None:
            killed[what] = killed.get(what, 0) + 1
            {
                "command": process.kill,
                "worker": cluster.kill_worker,
                "scheduler": cluster.scheduler.kill,
            }[what]()
        out, err = process.communicate(timeout=300)
        frame = wb.fleet.read_drives(results).collect()
        assert frame.height == frame.unique("source").height, (what, out, err)
        assert set(frame["outcome"]) <= {"weighed"}, (what, out, err)
        if frame.height == DRIVES:
            expected = compared(frame) if expected is None else expected
            assert compared(frame).equals(expected)
            finished += 1
            if sum(killed.values()) < KILLS:
                round_ += 1
                results = tmp_path / f"results-{round_}"
    assert finished >= 1
    print(killed, finished)  # noqa: T201


def wait_until(process, results: Path, count: int, more: float) -> None:
    """Wait until so many rows are there, or the command ended, and a moment more."""
    folder = Results(results)
    until = time.monotonic() + 120
    gathered = 0
    if results.exists():
        gathered = rows_there(results) - len(folder.part_files())
    while process.poll() is None and time.monotonic() < until:
        if results.exists() and gathered + len(folder.part_files()) >= count:
            break
        time.sleep(0.01)
    time.sleep(more)


def test_a_scheduler_and_a_worker_started_by_hand(cluster, tmp_path, tiny, scheduler, weighbridge):
    """The worker and then the scheduler are killed, and the command given again."""
    drives, cars = tiny
    results = tmp_path / "results"
    process = begun(cluster.start(workers=1), drives, cars, results)
    wait_until(process, results, 8, 0.0)
    cluster.kill_worker()
    wait_until(process, results, 16, 0.0)
    cluster.scheduler.kill()
    _, err = process.communicate(timeout=120)
    assert (process.returncode, err.count("\n")) == (2, 1), err
    assert "the scheduler is gone" in err
    assert 0 < rows_there(results) < 40
    ran = weighbridge(*words_of(scheduler, drives, cars, results))
    assert (ran.code, ran.err) == (1, ""), ran.out
    assert "40 drives of 3 vehicles: 0 with a mass, 40 missing_signals" in ran.out
    assert rows_there(results) == 40


def test_a_scheduler_that_dies_while_a_fleet_learns_is_told(
    cluster, tmp_path, monkeypatch, scheduler, weighbridge
):
    """It is killed while a worker learns; the same command learns later."""
    drives, cars = tiny_fleet(tmp_path, 1, vehicles=1)
    under_way, fault = tmp_path / "under-way", tmp_path / "fault.py"
    fault.write_text(
        "import pathlib, time\n"
        "from weighbridge.fleet import learning\n"
        "def chosen(drives):\n"
        f"    pathlib.Path({str(under_way)!r}).touch()\n"
        "    time.sleep(60)\n"
        "learning.chosen = chosen\n"
    )
    tickets = tmp_path / "tickets.csv"
    tickets.write_text("vehicle,time,mass_kg\nvan0,2026-05-01T06:00:00Z,2500\n")
    learn = ("--tickets", tickets, "--learn", tmp_path / "learnt")
    results = tmp_path / "results"
    with monkeypatch.context() as patch:
        patch.setenv("DASK_DISTRIBUTED__WORKER__PRELOAD", str(fault))
        process = begun(cluster.start(workers=1), drives, cars, results, *learn)
    until = time.monotonic() + 120
    while not under_way.exists() and process.poll() is None and time.monotonic() < until:
        time.sleep(0.05)
    cluster.scheduler.kill()
    _, err = process.communicate(timeout=120)
    assert (process.returncode, err.count("\n")) == (2, 1), err
    assert "the scheduler is gone" in err
    assert not (results / "learnt.parquet").exists()
    ran = weighbridge(*words_of(scheduler, drives, cars, results, *learn))
    assert (ran.code, ran.err) == (1, ""), ran.out
    assert "van0: 1 drives with a ticket, not refined" in ran.out
