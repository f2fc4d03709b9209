"""Where the work is done: processes of this machine, or a Dask cluster at an address."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

from weighbridge.errors import ConfigError, MissingExtraError
from weighbridge.visible import visible

if TYPE_CHECKING:
    from distributed import Client

_CONNECT: Final = 5.0  # wait for a scheduler [s]

_LEAST_MEMORY: Final = 100_000_000  # of a worker: it needs more to begin [B]

_CLOSE: Final = 30.0  # wait for workers to end [s]

_KEPT: Final = 64 * 1024 * 1024  # memory that a worker keeps for its next arrays [B]

SETTINGS: Final[dict[str, Any]] = {
    # A drive whose worker dies is tried again alone, see `weighbridge.fleet.engine`.
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.work-stealing": False,
    # Results are on the disk: there is nothing to spill, and no use in waiting for memory.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    # One thread each: as many workers as cores weigh at once.
    "distributed.nanny.pre-spawn-environ.OMP_NUM_THREADS": 1,
    "distributed.nanny.pre-spawn-environ.OPENBLAS_NUM_THREADS": 1,
    "distributed.nanny.pre-spawn-environ.MKL_NUM_THREADS": 1,
    "distributed.nanny.pre-spawn-environ.POLARS_MAX_THREADS": 1,
    # Dask's own 65 kB makes each array come from the system anew, which doubles the time.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": _KEPT,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": _KEPT,
}
"""Settings of Dask for a cluster of this machine; docs/fleet.md has those of others."""


def check_cluster(scheduler: str | None, workers: int | None, memory: str | None) -> None:
    """Raise where a cluster cannot be; see `connected`.

    Raises
    ------
    MissingExtraError
        Dask is not installed.
    ConfigError
        The address is none, or a number is impossible.
    """
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise MissingExtraError("distributed", "fleet", "weighing a fleet") from None
    if scheduler is not None:
        if workers is not None or memory is not None:
            raise ConfigError(
                "workers and their memory are those of the scheduler's cluster; leave them out"
            )
        _check_address(scheduler)
    if workers is not None and workers < 1:
        raise ConfigError(f"workers must be 1 or more, got {workers}")
    if memory is not None:
        _check_memory(memory)


def _check_address(scheduler: str) -> None:
    """Raise what Dask reports with a traceback, after it waited for nothing."""
    from distributed.comm.addressing import parse_address, parse_host_port
    from distributed.comm.registry import backends

    try:
        scheme, place = parse_address(scheduler)
        known = scheme in backends
        if known and scheme != "inproc":
            host, _ = parse_host_port(place)
            known = bool(host)
    except ValueError:
        known = False
    if not known:
        raise ConfigError(
            f"scheduler must be an address such as tcp://10.0.0.5:8786, got {visible(scheduler)!r}"
        )


def _check_memory(memory: str) -> None:
    from distributed.worker_memory import parse_memory_limit

    try:
        limit = parse_memory_limit(memory, 1, logger=logging.getLogger(__name__))
    except (ValueError, OverflowError, TypeError):
        raise ConfigError(
            f"memory must be a size such as '1 GB', got {visible(memory)!r}"
        ) from None
    if limit is not None and limit < _LEAST_MEMORY:
        raise ConfigError(
            f"memory must be {_LEAST_MEMORY / 1e6:.0f} MB or more, or no worker starts, got "
            f"{visible(memory)!r}"
        )


@contextlib.contextmanager
def connected(scheduler: str | None, workers: int | None, memory: str | None) -> Iterator[Client]:
    """Give a client of a cluster; one of this machine ends with the block.

    Parameters
    ----------
    scheduler : address, such as ``tcp://10.0.0.5:8786``; None for workers of this machine
    workers : their number; None for one per core
    memory : limit of each, such as ``"1 GB"``; None for its share of the machine's

    Raises
    ------
    MissingExtraError
        Dask is not installed.
    ConfigError
        Nobody answers at the address, or a number is impossible.
    """
    check_cluster(scheduler, workers, memory)
    with _quiet():
        yield from _client(scheduler, workers, memory)


def _client(scheduler: str | None, workers: int | None, memory: str | None) -> Iterator[Client]:
    import dask
    from distributed import Client, LocalCluster

    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=_CONNECT, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise ConfigError(
                f"no Dask scheduler answers at {scheduler} ({error}); start one: dask scheduler"
            ) from None
        with contextlib.closing(client):
            yield client
        return
    with dask.config.set(SETTINGS):
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            memory_limit=memory or "auto",
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
        )
        try:
            with contextlib.closing(Client(cluster, set_as_default=False)) as client:
                yield client
        finally:
            # What was weighed is on the disk; a worker that does not end in time ends with us.
            with contextlib.suppress(TimeoutError):
                cluster.close(timeout=_CLOSE)


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep Dask's own log off the terminal: what it means for a drive is in its row."""
    known = logging.root.manager.loggerDict.items()
    loggers = [
        logger
        for name, logger in list(known)
        if name.partition(".")[0] == "distributed" and isinstance(logger, logging.Logger)
    ]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
