"""Jobs through a Dask cluster, a few at a time: a window slides over any number of them."""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import hashlib
import queue
import time
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

from weighbridge.errors import ConfigError, WeighbridgeError
from weighbridge.fleet.job import THERE, TRIES, Job, Receipt, fail_job, weigh_job
from weighbridge.fleet.schema import FAILED, UNREAD
from weighbridge.messages import Problem
from weighbridge.whole import lock_file

if TYPE_CHECKING:
    from distributed import Client, Future

PER_THREAD: Final = 4
"""Jobs in the cluster per thread: enough that none waits, few enough for the scheduler."""

_LEAST: Final = 8
_LOOK: Final = 0.02  # spent at a time on finding out how many jobs there are [s]
_TICK: Final = 0.2  # waited at most for a receipt [s]
_MEASURED: Final = 1.0  # between looks at the cluster's size [s]
_CANCELLED: Final = (asyncio.CancelledError, concurrent.futures.CancelledError)

WORKER_DIED: Final = (
    f"its worker ended {TRIES} times, probably for lack of memory: give workers more"
)
"""Why a job has no receipt."""


class SchedulerLost(WeighbridgeError):
    """The scheduler of a cluster is gone; what was weighed is kept."""

    def __init__(self) -> None:
        super().__init__(
            "the scheduler is gone; what was weighed is kept: give the same command again, with "
            "the address of the one that runs"
        )


@dataclass(slots=True)
class Count:
    """How far a run is.

    Attributes
    ----------
    found : jobs known so far; ``complete`` when there are no more
    done : receipts; of them ``there`` already, ``failed``, ``unread``
    drives, masses : weighed in this run, and those with a mass
    workers : connected to the scheduler; None while not known
    began : when, as of `time.monotonic` [s]
    """

    found: int = 0
    complete: bool = False
    done: int = 0
    there: int = 0
    failed: int = 0
    unread: int = 0
    drives: int = 0
    masses: int = 0
    workers: int | None = None
    began: float = field(default_factory=time.monotonic)

    def add(self, receipt: Receipt) -> None:
        """Count a receipt."""
        self.done += 1
        self.there += receipt.outcome == THERE
        self.failed += receipt.outcome == FAILED
        self.unread += receipt.outcome == UNREAD
        self.drives += receipt.drives
        self.masses += receipt.masses

    @property
    def rate(self) -> float:
        """Recordings weighed per second since the begin: what was there already costs no time."""
        return (self.done - self.there) / max(time.monotonic() - self.began, 1e-9)

    @property
    def left(self) -> float | None:
        """Time left [s], as if none of the rest were there already; None while not known."""
        rest = self.found - self.done
        if not self.complete or (rest and not self.rate):
            return None
        return rest / self.rate if rest else 0.0


def first_alone(job: Job) -> Receipt:
    """Weigh a job on a worker; the first of a machine compiles for all."""
    return compiled_once(lambda: weigh_job(job), lambda receipt: receipt.masses > 0)


def run_jobs(
    client: Client, jobs: Iterator[Job], tell: Callable[[Count], None] | None = None
) -> Count:
    """Weigh all jobs; return how it went.

    A job whose worker died is tried again when the others are done, alone, so that it takes no
    other with it; then it has a row that says so.

    Parameters
    ----------
    client : of the cluster
    jobs : pulled as they are needed, and to know how many there are
    tell : called with the count, often

    Raises
    ------
    SchedulerLost
        The scheduler is gone.
    ConfigError
        The cluster cannot run the job, or the folder of the results cannot be written to.
    """
    return _Run(client, jobs, tell).run()


class _Run:
    """One run: what is in the cluster, what waits, what came back."""

    def __init__(
        self, client: Client, jobs: Iterator[Job], tell: Callable[[Count], None] | None
    ) -> None:
        self._client = client
        self._jobs = jobs
        self._tell = tell
        self._waiting: list[Job] = []
        self._next = 0
        self._inside: dict[str, tuple[Future[Receipt], Job]] = {}
        self._ended: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._suspects: list[Job] = []
        self._name = uuid.uuid4().hex[:8]
        self._number = 0
        self._looked = -_MEASURED
        self._window = _LEAST
        self.count = Count()

    def run(self) -> Count:
        try:
            with scheduler_needed(self._client):
                while self._fill() or self._inside or not self.count.complete:
                    until = time.monotonic() + _LOOK
                    while time.monotonic() < until and self._find():
                        pass
                    self._collect(self._suspects)
                    self._reported()
                for job in self._suspects:
                    self._try_alone(job)
                    self._reported()
        finally:
            futures = [future for future, _ in self._inside.values()]
            if futures and self._client.status == "running":
                self._client.cancel(futures, force=True)
        return self.count

    def _fill(self) -> bool:
        """Submit what the window has room for; say whether jobs wait."""
        self._measure()
        while len(self._inside) < self._window and (job := self._pull()) is not None:
            self._submit(job)
        return self._next < len(self._waiting)

    def _pull(self) -> Job | None:
        until = time.monotonic() + _LOOK
        while self._next == len(self._waiting):
            if time.monotonic() > until or not self._find():
                return None
        job = self._waiting[self._next]
        self._next += 1
        if self._next >= 10_000:
            del self._waiting[: self._next]
            self._next = 0
        return job

    def _find(self) -> bool:
        """Find one more job, which waits unless its result is there; False where there is none."""
        if self.count.complete:
            return False
        job = next(self._jobs, None)
        if job is None:
            self.count.complete = True
            return False
        self.count.found += 1
        if job.there:
            self.count.add(weigh_job(job))
        else:
            self._waiting.append(job)
        return True

    def _measure(self) -> None:
        """Let the window follow the cluster's size."""
        now = time.monotonic()
        if now - self._looked < _MEASURED:
            return
        self._looked = now
        if self._client.status != "running":
            raise SchedulerLost
        workers = self._client.scheduler_info(n_workers=-1).get("workers", {})
        threads = sum(w.get("nthreads", 1) for w in workers.values())
        self.count.workers = len(workers)
        self._window = max(_LEAST, PER_THREAD * threads)

    def _submit(self, job: Job) -> Future[Receipt]:
        key = f"weigh-{self._name}-{self._number}"
        self._number += 1
        future = self._client.submit(first_alone, job, key=key, pure=False)
        self._inside[key] = future, job
        future.add_done_callback(lambda done: self._ended.put(done.key))
        return future

    def _collect(self, suspects: list[Job]) -> None:
        """Take the receipts that came; wait for one where nothing else is to do."""
        keys = []
        if self._inside:
            try:
                keys.append(self._ended.get(timeout=_TICK if self.count.complete else 0.001))
                while True:
                    keys.append(self._ended.get_nowait())
            except queue.Empty:
                pass
        ended = [self._inside.pop(key) for key in keys if key in self._inside]
        good = [(f, job) for f, job in ended if f.status == "finished"]
        receipts = self._client.gather([f for f, _ in good], errors="skip")
        if len(receipts) < len(good):
            # A worker died with a receipt: its job is done, and to be asked again.
            receipts = []
            for _, job in good:
                self._submit(job)
        for receipt in receipts:
            self.count.add(receipt)
        for future, job in ended:
            if future.status != "finished":
                self._judge(future, job, suspects)

    def _judge(self, future: Future[Receipt], job: Job, suspects: list[Job]) -> None:
        """Decide what becomes of a job that has no receipt."""
        from distributed.scheduler import KilledWorker

        if future.status in ("cancelled", "lost"):
            raise SchedulerLost
        error = future.exception()
        if isinstance(error, KilledWorker):
            suspects.append(job)
        elif isinstance(error, WeighbridgeError):
            raise error
        else:
            # What is wrong with a drive is a row: this is wrong with the cluster.
            why = str(error).strip().partition("\n")[0]
            raise ConfigError(
                f"the cluster cannot run weighbridge ({type(error).__name__}: {why}); scheduler "
                "and workers need the same packages as this command"
            )

    def _try_alone(self, job: Job) -> None:
        for _ in range(TRIES - 1):
            self._submit(job)
            again: list[Job] = []
            while self._inside:
                self._measure()
                self._collect(again)
                self._reported()
            if not again:
                return
        self.count.add(fail_job(job, Problem.of("fleet.worker_died", tries=TRIES)))

    def _reported(self) -> None:
        if self._tell is not None:
            self._tell(self.count)


@contextlib.contextmanager
def scheduler_needed(client: Client) -> Iterator[None]:
    """Raise `SchedulerLost` for whatever the block raises because the scheduler is gone."""
    try:
        yield
    except (OSError, *_CANCELLED) as error:
        if client.status == "running" and not _of_the_network(error):
            raise
        raise SchedulerLost from None


def _of_the_network(error: BaseException) -> bool:
    from distributed.comm.core import CommClosedError

    return isinstance(error, (CommClosedError, TimeoutError, ConnectionError, *_CANCELLED))


def plain(count: Count) -> dict[str, Any]:
    """Return a count for `progress.json`."""
    counted = {f.name: getattr(count, f.name) for f in fields(count) if f.name != "began"}
    return counted | {"rate_per_s": round(count.rate, 3), "left_s": count.left}


Result = TypeVar("Result")

_done: Final[list[bool]] = []


def compiled_once(work: Callable[[], Result], useful: Callable[[Result], bool]) -> Result:
    """Do the first work of a process, alone on its machine until the kernels are on the disk.

    Parameters
    ----------
    work : what compiles the kernels it needs
    useful : says whether it came far enough to have used them
    """
    if _done:
        return work()
    mark = _mark()
    if mark is None or mark.exists():
        _done.append(True)
        return work()
    with _alone(mark.with_suffix(".lock")):
        result = work()
        if useful(result):
            _done.append(True)
            with contextlib.suppress(OSError):
                mark.touch()
    return result


def _mark() -> Path | None:
    """File that says that the kernels of these sources are compiled for this processor."""
    import llvmlite.binding as llvm
    import numba

    from weighbridge.kernels import _jit, rls

    cache = getattr(rls.step, "_cache", None)
    place = getattr(cache, "_cache_path", None)
    if not place or not Path(place).is_dir():
        # Made with the first kernel that is written.
        if not place:
            return None
        with contextlib.suppress(OSError):
            Path(place).mkdir(parents=True, exist_ok=True)
    texts = (_jit.SOURCES, numba.__version__, llvm.get_host_cpu_name())
    name = hashlib.sha256("\n".join(texts).encode()).hexdigest()[:16]
    return Path(place) / f"fleet-{name}.compiled"


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Hold a lock; go on without where there can be none."""
    try:
        file = path.open("ab")
    except OSError:
        yield
        return
    with file:
        lock_file(file.fileno(), wait=True)
        yield
