"""Do cases in processes of their own, each under a limit of time and memory."""

from __future__ import annotations

import multiprocessing
import os
import resource
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, Final, TypeVar

LONGEST: Final = 60.0
"""A case that computes for longer hangs [s]."""
ASLEEP: Final = 5.0
"""So many times longer may it take by the clock on the wall: other work may share the processor."""
MOST: Final = 2e9
"""A case that takes more memory is stopped, with all the process holds [B]."""
HARD: Final = 4e9
"""Address space that a process can ask for beside what it has [B]."""
_LOOK: Final = 0.1

Job = TypeVar("Job")


@dataclass(frozen=True)
class Done:
    """What came of one job.

    Attributes
    ----------
    result : what the work returned; None where it was stopped or broke
    stopped : "hang", "memory", "died", or empty
    failure : text of what the work raised
    seconds, peak : time [s] and memory [B] it took
    """

    result: Any
    stopped: str = ""
    failure: str = ""
    seconds: float = 0.0
    peak: float = 0.0


class _Worker:
    """One process that does jobs of a list by their number."""

    def __init__(self, work: Callable[[Any], Any], jobs: Sequence[Any]) -> None:
        context = multiprocessing.get_context("fork")
        self.connection, theirs = context.Pipe()
        self.process: BaseProcess = context.Process(
            target=_serve, args=(theirs, work, jobs), daemon=True
        )
        self.process.start()
        theirs.close()
        self.number = -1
        self.begun = 0.0
        self.computed = 0.0
        self.peak = 0.0

    def give(self, number: int) -> None:
        self.number, self.begun, self.peak = number, time.monotonic(), 0.0
        self.computed = _computed(self.process.pid)
        self.connection.send(number)

    def stop(self) -> None:
        self.connection.close()
        self.process.kill()
        self.process.join()

    def looked_at(self, longest: float, most: float) -> str:
        """Return why the job must be stopped; empty if it need not."""
        self.peak = max(self.peak, _memory(self.process.pid, "VmRSS"))
        if self.peak > most:
            return "memory"
        waited = time.monotonic() - self.begun
        computed = _computed(self.process.pid) - self.computed
        return "hang" if computed > longest or waited > ASLEEP * longest else ""


def done_apart(
    work: Callable[[Job], Any],
    jobs: Sequence[Job],
    *,
    workers: int = 2,
    longest: float = LONGEST,
    most: float = MOST,
) -> Iterator[tuple[Job, Done]]:
    """Do jobs in forked processes; yield each as it is done, in any order.

    Parameters
    ----------
    work : is given one job; what it returns must be picklable
    longest, most : limits of time [s] and memory [B] of one job
    """
    rest = iter(range(len(jobs)))
    busy: list[_Worker] = []

    def next_job(worker: _Worker | None) -> None:
        number = next(rest, None)
        if number is None:
            if worker is not None:
                worker.stop()
            return
        worker = worker or _Worker(work, jobs)
        worker.give(number)
        busy.append(worker)

    for _ in range(min(workers, len(jobs))):
        next_job(None)
    while busy:
        ready = wait([w.connection for w in busy], timeout=_LOOK)
        for worker in tuple(busy):
            done, alive = _told(worker) if worker.connection in ready else (None, True)
            stopped = "" if done else worker.looked_at(longest, most)
            if stopped:
                seconds = time.monotonic() - worker.begun
                done, alive = Done(None, stopped, "", seconds, worker.peak), False
            if done is None:
                continue
            if done.peak > most and not done.stopped:
                done = Done(None, "memory", "", done.seconds, done.peak)
            busy.remove(worker)
            if not alive:
                worker.stop()
            yield jobs[worker.number], done
            next_job(worker if alive else None)


def _told(worker: _Worker) -> tuple[Done, bool]:
    """Take what a worker says; and whether it lives on."""
    seconds = time.monotonic() - worker.begun
    try:
        result, failure, peak = worker.connection.recv()
    except EOFError:
        worker.process.join()
        text = f"the process ended with status {worker.process.exitcode}"
        return Done(None, "died", text, seconds, worker.peak), False
    return Done(result, "", failure, seconds, peak), True


def _serve(connection: Connection, work: Callable[[Any], Any], jobs: Sequence[Any]) -> None:
    limit = int(_memory(None, "VmSize") + HARD)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    parent = os.getppid()
    while True:
        while not connection.poll(1.0):
            if os.getppid() != parent:
                return
        try:
            number = connection.recv()
        except EOFError:
            return
        _forget_peak()
        try:
            told = work(jobs[number]), ""
        except Exception as error:
            told = None, f"{type(error).__name__}: {error}"
        connection.send((*told, _memory(None, "VmHWM")))


def _memory(pid: int | None, field: str) -> float:
    """Return a figure of a process' memory [B]; 0 where the system does not tell."""
    status = Path("/proc") / (str(pid) if pid is not None else "self") / "status"
    try:
        lines = status.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return 0.0
    return next((1024.0 * float(x.split()[1]) for x in lines if x.startswith(f"{field}:")), 0.0)


def _computed(pid: int | None) -> float:
    """Return the time that a process has computed, by all its threads [s]; 0 if unknown."""
    try:
        text = (Path("/proc") / str(pid) / "stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return 0.0
    # After the name in brackets, which may hold blanks: fields 14 and 15 of proc(5).
    user, system = text.rsplit(")", 1)[1].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def _forget_peak() -> None:
    """Let the system count the highest memory anew."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        return
