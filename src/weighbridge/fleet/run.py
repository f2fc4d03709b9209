"""A fleet from recordings to rows: `weigh_drives`."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from weighbridge.arguments import suggestion
from weighbridge.errors import ConfigError
from weighbridge.fleet.bucket import Bucket, Folder, kept_at, place_of_results
from weighbridge.fleet.engine import Count, plain, run_jobs
from weighbridge.fleet.inputs import Recording, recordings, refuse_missing
from weighbridge.fleet.job import Job, seen_of
from weighbridge.fleet.kept import keep_legs
from weighbridge.fleet.keys import file_digest, stamp, text_digest
from weighbridge.fleet.learning import learn_fleet, refuse_output
from weighbridge.fleet.names import some
from weighbridge.fleet.remote import is_url, was_url
from weighbridge.fleet.store import KEYS, Results
from weighbridge.fleet.tickets import read_tickets
from weighbridge.fleet.vehicles import Vehicles
from weighbridge.io.elevation import refuse_raster

if TYPE_CHECKING:
    import polars as pl

_REPORTED: Final = 2.0  # between writings of how far the run is [s]
_GATHER: Final = 5_000  # receipts between gatherings of their parts
_SEND: Final = 60.0  # at most between sendings of results behind a URL [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetSettings:
    """How a fleet is weighed.

    Attributes
    ----------
    method, settings : as of `weighbridge.weigh`
    kind : class of vehicles without a file; None for a car, if another vehicle has one
    mapping : for all logs; None for the one that each vehicle file names
    dbc : databases of raw CAN logs
    elevation : raster of heights, see `weighbridge.with_elevation`; None for the receivers'
    whole : take each recording as one drive
    scheduler : address of a Dask cluster; None for workers of this machine
    workers : their number; None for one per core
    memory : limit of each, such as ``"1 GB"``
    learn : folder for refined vehicle files; None to learn nothing
    tickets : table of known masses; None to learn the scales of the vehicles alone
    """

    method: str = "joint"
    settings: Mapping[str, object] = field(default_factory=dict)
    kind: str | None = None
    mapping: Path | None = None
    dbc: tuple[str, ...] = ()
    elevation: Path | None = None
    whole: bool = False
    scheduler: str | None = None
    workers: int | None = None
    memory: str | None = None
    learn: Path | None = None
    tickets: Path | None = None

    def __post_init__(self) -> None:
        from weighbridge.estimators import ESTIMATORS

        if self.method not in ESTIMATORS:
            raise ConfigError(
                f"unknown method {self.method!r}{suggestion(self.method, ESTIMATORS)}"
            )
        if self.learn is None and self.tickets is not None:
            raise ConfigError(
                "--tickets refine vehicle files: name a folder for these, too, --learn DIR"
            )
        if self.settings:
            ESTIMATORS[self.method].settings_of(self.settings)


def weigh_drives(
    drives: str | Path | Iterable[str | Path],
    vehicles: str | Path,
    results: str | Path,
    *,
    method: str = "joint",
    settings: Mapping[str, object] | None = None,
    kind: str | None = None,
    mapping: str | Path | None = None,
    dbc: Sequence[str] = (),
    elevation: str | Path | None = None,
    whole: bool = False,
    scheduler: str | None = None,
    workers: int | None = None,
    memory: str | None = None,
    learn: str | Path | None = None,
    tickets: str | Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> pl.LazyFrame:
    """Weigh many drives in parallel; go on where an earlier run ended.

    Parameters
    ----------
    drives : paths, patterns such as ``"drives/**"``, URLs, or tables of drives
    vehicles : folder of vehicle files, each named after its vehicle
    results : folder that is written to, seen by all workers; or a URL such as
        ``"s3://bucket/results"``, which a folder of this machine is sent to
    method, settings : as of `weighbridge.weigh`
    kind : class of vehicles without a file, whose data sheet is used; None for a car, if another
        vehicle of the fleet has a file
    mapping : for all logs; None for the one that each vehicle file names
    dbc : databases of raw CAN logs
    elevation : raster of heights, see `weighbridge.with_elevation`; None for the receivers', which
        drives outside of it keep
    whole : take each recording as one drive
    scheduler : address of a Dask cluster; None for workers of this machine
    workers, memory : number and limit of the workers of this machine
    learn : folder for refined vehicle files; legs are corrected by what the fleet shows of the
        scale of each vehicle. What was learnt is in ``learnt.parquet`` of the results
    tickets : table of drives of known mass, which refine vehicle files
    progress : called with recordings done and found

    Returns
    -------
    One row per drive, see `weighbridge.fleet.schema.DRIVES`; a drive that cannot be weighed has
    its reason there

    Raises
    ------
    ConfigError
        An argument, a vehicle file or the folder of the results cannot be used.
    DriveError
        Nothing is there of a name.
    """
    from weighbridge.fleet.reading import read_drives

    given = [drives] if isinstance(drives, str | Path) else list(drives)
    how = FleetSettings(
        method=method,
        settings=dict(settings or {}),
        kind=kind,
        mapping=None if mapping is None else Path(mapping),
        dbc=tuple(dbc),
        elevation=None if elevation is None else Path(elevation),
        whole=whole,
        scheduler=scheduler,
        workers=workers,
        memory=memory,
        learn=None if learn is None else Path(learn),
        tickets=None if tickets is None else Path(tickets),
    )
    reported = None if progress is None else lambda count: progress(count.done, count.found)
    place = place_of_results(results)
    run_fleet([str(one) for one in given], Path(vehicles), place, how, reported)
    return read_drives(place.folder)


def run_fleet(
    given: Sequence[str],
    vehicles: Path,
    results: Folder,
    how: FleetSettings,
    tell: Callable[[Count], None] | None = None,
) -> Count:
    """Weigh recordings into results; see `weigh_drives`.

    However it ends, what was weighed is in the results.

    Parameters
    ----------
    given, vehicles, how : as of `weigh_drives`
    results : as of `weighbridge.fleet.bucket.place_of_results`
    tell : called with how far the run is
    """
    from weighbridge.fleet.cluster import check_cluster, connected

    check_cluster(how.scheduler, how.workers, how.memory)
    folder = results.folder
    with kept_at(results, how.scheduler), prepared(given, vehicles, folder, how) as jobs:
        teller = _Teller(Results(folder), tell, results)
        try:
            with connected(how.scheduler, how.workers, how.memory) as client:
                count = run_jobs(client, jobs, teller)
                if how.learn is not None:
                    teller.settle()
                    shelf = Vehicles(vehicles, how.kind, how.mapping)
                    learn_fleet(
                        client,
                        folder,
                        shelf,
                        how.tickets,
                        how.learn,
                        whole=how.whole,
                        dbc=how.dbc,
                        elevation=_whole_name(how.elevation),
                    )
                return count
        finally:
            teller.ended()


@contextlib.contextmanager
def prepared(
    given: Sequence[str], vehicles: Path, folder: Path, how: FleetSettings
) -> Iterator[Iterator[Job]]:
    """Give the jobs of recordings; gather what was weighed when the block ends, however it does.

    Parameters
    ----------
    given, vehicles, folder, how : as of `run_fleet`

    Raises
    ------
    ConfigError, DriveError
        As of `weigh_drives`.
    """
    shelf = Vehicles(vehicles, how.kind, how.mapping)
    if how.learn is not None:
        refuse_output(how.learn, shelf)
    if how.tickets is not None:
        read_tickets(how.tickets)
    refuse_missing(given)
    found = recordings(given)
    found = chain([next(found)], found)
    if how.kind is None:
        found = _with_a_file(found, shelf, vehicles)
    if was_url(folder):
        raise ConfigError(
            f"{folder}: results go to a folder here; mount the store, or copy them there"
        )
    databases = _dbc_digest(how.dbc)
    if how.elevation is not None:
        refuse_raster(how.elevation)
    results = Results.begun(folder)
    with results.locked():
        results.clean()
        results.gather()
        results.settle()
        known = _known_file(results)
        try:
            yield _jobs_of(found, shelf, results, how, known, databases)
        finally:
            results.gather()
            results.settle()
            keep_legs(results)
            if known is not None:
                known.unlink(missing_ok=True)


def _with_a_file(found: Iterator[Recording], shelf: Vehicles, folder: Path) -> Iterator[Recording]:
    """Raise where no vehicle of the fleet has a file, and no table says its class.

    Raises
    ------
    ConfigError
        So it is: the folder is another fleet's.
    """
    seen = []
    names: dict[str | None, None] = {}
    for recording in found:
        seen.append(recording)
        assigned = shelf.of(recording.paths, recording.vehicle, recording.kind)
        if assigned.vehicle is not None or recording.kind is not None:
            return chain(seen, found)
        names[assigned.id] = None
    files = [path.stem for path in shelf.files]
    raise ConfigError(
        f"{folder}: no vehicle of the fleet has a file there: the drives are of "
        f"{some(names)}, the files of {some(files) if files else 'none'}; name the folder of their "
        "files, or weigh all by the data sheet of a class: --class car"
    )


def _jobs_of(
    found: Iterable[Recording],
    shelf: Vehicles,
    results: Results,
    how: FleetSettings,
    known: Path | None,
    databases: str,
) -> Iterator[Job]:
    folder = str(results.folder.resolve())
    seen = results.seen()
    for recording in found:
        job = Job(
            recording=_whole_path(recording),
            assigned=shelf.of(recording.paths, recording.vehicle, recording.kind),
            results=folder,
            method=how.method,
            settings=how.settings,
            dbc=how.dbc,
            dbc_digest=databases,
            elevation=_whole_name(how.elevation),
            elevation_stamp="" if how.elevation is None else stamp([how.elevation]) or "",
            whole=how.whole,
            known=None if known is None else str(known.resolve()),
        )
        mark = seen_of(job, _stamp(job.recording))
        at = seen.searchsorted(mark) if mark is not None else len(seen)
        yield replace(job, seen=mark, there=bool(at < len(seen) and seen[at] == mark))


def _stamp(recording: Recording) -> str | None:
    """What shows, without reading, whether the files of a recording have changed."""
    if any(is_url(path) for path in recording.paths):
        return recording.stamp
    return stamp([Path(path) for path in recording.paths])


def _dbc_digest(paths: Sequence[str]) -> str:
    try:
        return text_digest(file_digest(Path(path)) for path in paths)
    except OSError as error:
        raise ConfigError(f"{error.filename}: cannot be read ({error.strerror})") from None


def _whole_name(path: Path | None) -> str | None:
    return None if path is None else str(path.resolve())


def _whole_path(recording: Recording) -> Recording:
    """Return a recording by paths that hold in any working folder."""
    import os

    paths = (p if is_url(p) else os.path.abspath(p) for p in recording.paths)  # noqa: PTH100
    return recording._replace(paths=tuple(paths))


def _known_file(results: Results) -> Path | None:
    """Write the keys that are there already for the workers; None where none is."""
    keys = results.known_keys()
    if not keys:
        return None
    from weighbridge.whole import write_whole

    path = results.folder / f".{time.time_ns()}{KEYS}"
    write_whole(path, "".join(f"{key}\n" for key in keys))
    return path


class _Teller:
    """Writes how far a run is, gathers parts now and then, and reports to whoever asked."""

    def __init__(
        self, results: Results, tell: Callable[[Count], None] | None, place: Folder
    ) -> None:
        self._results = results
        self._place = place
        self._every = _SEND if isinstance(place, Bucket) else math.inf
        self._sent = time.monotonic()
        self._tell = tell
        self._last = -_REPORTED
        self._count = Count()
        self._gathered = 0
        self._gathering: Future[None] | None = None
        self._beside = ThreadPoolExecutor(1)

    def __call__(self, count: Count) -> None:
        self._count = count
        if self._tell is not None:
            self._tell(count)
        if time.monotonic() - self._last >= _REPORTED:
            self._last = time.monotonic()
            self._write(ended=False)
            new = count.done - self._gathered
            if new >= _GATHER or (new and self._last - self._sent >= self._every):
                self._gather()

    def settle(self) -> None:
        """Wait for the gathering, and leave the rows that count."""
        if self._gathering is not None:
            self._gathering.result()
        self._results.gather()
        self._results.settle()

    def ended(self) -> None:
        """Wait for the gathering, and say that the run is over."""
        self._beside.shutdown()
        self._write(ended=True)

    def _gather(self) -> None:
        """Gather beside the run; a failure is raised by the next."""
        if self._gathering is not None:
            if not self._gathering.done():
                return
            self._gathering.result()
        self._gathered = self._count.done
        self._sent = self._last
        self._gathering = self._beside.submit(self._flush)

    def _flush(self) -> None:
        self._results.gather()
        self._place.send(last=False)

    def _write(self, *, ended: bool) -> None:
        reported: dict[str, Any] = plain(self._count) | {"ended": ended, "at": time.time()}
        with contextlib.suppress(ConfigError):
            self._results.write_progress(reported)
