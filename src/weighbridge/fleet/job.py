"""The one function that weighs a recording of a fleet: on this machine, on Dask, Ray or Spark."""

from __future__ import annotations

import bisect
import contextlib
import socket
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

from weighbridge.errors import ConfigError, WeighbridgeError
from weighbridge.fleet import remote
from weighbridge.fleet.inputs import Recording
from weighbridge.fleet.keys import content_digest, text_digest
from weighbridge.fleet.schema import FAILED, FORMAT_VERSION, UNREAD, WEIGHED
from weighbridge.fleet.store import KEY_WIDTH, part_path, write_found, write_part
from weighbridge.fleet.vehicles import Assigned
from weighbridge.messages import Problem
from weighbridge.signals import Drive
from weighbridge.version import VERSION
from weighbridge.visible import visible

TRIES: Final = 3
"""How often a drive is tried where the machine fails, and not the data."""

_SEEN: Final = 15  # letters of a digest that a whole number of 64 bits holds

_PAUSE: Final = 0.2  # before the second try; twice as long before the third [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """All that a worker has to know of one recording.

    Attributes
    ----------
    recording, assigned : what is weighed, and as which vehicle
    results : folder of the results, seen by all workers
    method, settings : as of `weigh`
    dbc : databases of raw CAN logs, seen by all workers
    dbc_digest : of their content
    elevation : raster of heights, seen by all workers; None for those of the receivers
    elevation_stamp : by which a change of that file shows
    whole : take the recording as one drive
    known : file of the keys that are there already, in order, one a line; None where none is
    seen : digest of the recording's files as they were listed, and of how they are weighed, to know
        them again without reading; None where the listing does not show whether they change
    there : the results have it already
    version, format_version : of weighbridge and of the tables, where the job was made
    """

    recording: Recording
    assigned: Assigned
    results: str
    method: str = "joint"
    settings: Mapping[str, object] = field(default_factory=dict)
    dbc: tuple[str, ...] = ()
    dbc_digest: str = ""
    elevation: str | None = None
    elevation_stamp: str = ""
    whole: bool = False
    known: str | None = None
    seen: int | None = None
    there: bool = False
    version: str = VERSION
    format_version: int = FORMAT_VERSION


class Receipt(NamedTuple):
    """What a worker reports of a recording; its rows are in the part file.

    Attributes
    ----------
    key : of the part
    outcome : weighed, unread or failed; ``there`` where the results have it already
    drives, masses : drives of the recording, and those with a mass
    seconds : that it took
    """

    key: str
    outcome: str
    drives: int
    masses: int
    seconds: float


THERE: Final = "there"
"""Outcome of a recording that the results have already."""


def weigh_job(job: Job) -> Receipt:
    """Weigh one recording and write its part file.

    The same job writes the same rows, wherever and however often it runs. Nothing is raised for a
    drive: what goes wrong is a row with the reason.

    Parameters
    ----------
    job

    Raises
    ------
    ConfigError
        The folder of the results cannot be written to, or the job was made by another version.
    """
    if job.there:
        return Receipt("", THERE, 0, 0, 0.0)
    _refuse_other_version(job)
    begin = time.perf_counter()
    rows: list[dict[str, Any]] = []
    key, tries = "", 1
    content: str | None = None
    for tries in range(1, TRIES + 1):
        try:
            with local_paths(job.recording) as paths:
                content = _content(job, content_digest(paths))
                key = _key(job, content)
                if _is_there(job, key):
                    return Receipt(key, THERE, 0, 0, time.perf_counter() - begin)
                rows = _weighed(job, paths)
            break
        except Exception as error:
            if isinstance(error, WeighbridgeError) and not _of_the_machine(error):
                key = key or failed_key(job)
                rows = [_row(job, UNREAD, Problem.from_error(error))]
                break
            key = failed_key(job)
            failed = Problem.of("fleet.failed", tries=tries, error=named_error(error))
            rows = [_row(job, FAILED, failed)]
            if tries < TRIES:
                time.sleep(_PAUSE * tries)
    if rows[0]["outcome"] == FAILED:
        content = None
    elif part_path(Path(job.results), key).exists():
        # A copy of it was weighed at the same time.
        write_found(Path(job.results), key, visible(job.recording.source), job.seen)
        return Receipt(key, THERE, 0, 0, time.perf_counter() - begin)
    reported = {"content": content, "seen": job.seen}
    return _written(job, key, [row | reported for row in rows], tries, begin)


def fail_job(job: Job, reason: Problem) -> Receipt:
    """Write the row of a recording that no worker could finish.

    Parameters
    ----------
    job
    reason : why
    """
    begin = time.perf_counter()
    return _written(job, failed_key(job), [_row(job, FAILED, reason)], TRIES, begin)


def _refuse_other_version(job: Job) -> None:
    """Raise where this worker would write rows that the command does not expect."""
    if (job.version, job.format_version) != (VERSION, FORMAT_VERSION):
        raise ConfigError(
            f"the worker on {socket.gethostname()} has weighbridge {VERSION} (tables of format "
            f"{FORMAT_VERSION}), the command {job.version} (format {job.format_version}): install "
            "the same version on both"
        )


def failed_key(job: Job) -> str:
    """Key of a recording whose content nobody could read: of its name."""
    return _key(job, text_digest(["no content", *job.recording.paths]))


def _content(job: Job, digest: str) -> str:
    """Digest of what a recording holds, and of when it began where only a table says that."""
    start = job.recording.start
    return digest if start is None else text_digest([digest, start])


def _key(job: Job, content: str) -> str:
    settings = sorted((name, repr(value)) for name, value in job.settings.items())
    return text_digest(
        [
            content,
            repr(job.assigned.id),
            job.assigned.digest,
            VERSION,
            str(FORMAT_VERSION),
            job.method,
            repr(settings),
            repr(job.whole),
            repr(job.recording.start),
            job.dbc_digest,
            *((job.elevation_stamp,) if job.elevation is not None else ()),
        ]
    )


def _is_there(job: Job, key: str) -> bool:
    """Say whether a recording has its result; note the place where it was found."""
    there = part_path(Path(job.results), key).exists()
    if not there and (job.known is None or not _is_known(Path(job.known), key)):
        return False
    write_found(Path(job.results), key, visible(job.recording.source), job.seen)
    return True


def _is_known(path: Path, key: str) -> bool:
    """Look for a key in a file of sorted ones, without reading it whole."""
    wanted = f"{key}\n".encode("ascii")
    with path.open("rb") as file:

        def line(number: int) -> bytes:
            file.seek(number * KEY_WIDTH)
            return file.read(KEY_WIDTH)

        lines = range(path.stat().st_size // KEY_WIDTH)
        at = bisect.bisect_left(lines, wanted, key=line)
        return at < len(lines) and line(at) == wanted


def seen_of(job: Job, stamp: str | None) -> int | None:
    """Return by what a recording is known again where it is weighed in the same way.

    Parameters
    ----------
    job
    stamp : of its files; None where there is none
    """
    if stamp is None:
        return None
    digest = text_digest([visible(job.recording.source), stamp, _key(job, "")])
    return int(digest[:_SEEN], 16)


@contextlib.contextmanager
def local_paths(recording: Recording) -> Iterator[list[Path]]:
    """Give the paths of a recording on this machine; what was brought there goes again."""
    if not any(remote.is_url(path) for path in recording.paths):
        yield [Path(path) for path in recording.paths]
        return
    with remote.home() as home:
        yield remote.fetch(recording.paths, Path(home))


def drives_of(
    paths: list[Path],
    mapping: Mapping[str, Any] | None,
    dbc: tuple[str, ...],
    *,
    whole: bool,
    elevation: str | None = None,
) -> list[Drive]:
    """Read the drives that a recording holds; all of it as one drive where it is ``whole``.

    Heights are those of the raster ``elevation``, where it is given and has any.
    """
    from weighbridge.io import read_drive, read_drives

    given: Path | list[Path] = paths[0] if len(paths) == 1 else paths
    drives = [read_drive(given, mapping, dbc)] if whole else read_drives(given, mapping, dbc)
    return drives if elevation is None else [_by_raster(drive, elevation) for drive in drives]


def _by_raster(drive: Drive, elevation: str) -> Drive:
    """Take a drive's heights from a raster; the receiver's, with a word, outside of it."""
    from weighbridge.io.elevation import NoHeightsError, with_elevation

    try:
        return with_elevation(drive, elevation)
    except NoHeightsError as error:
        return drive.with_problems(Problem.of("altitude.no_raster", why=str(error)))


def _weighed(job: Job, paths: list[Path]) -> list[dict[str, Any]]:
    """Weigh each drive of a recording, as the command ``weigh`` does."""
    from weighbridge.fleet.facts import row_of
    from weighbridge.pipeline.weighing import weigh

    drives = drives_of(
        paths, job.assigned.mapping, job.dbc, whole=job.whole, elevation=job.elevation
    )
    if job.recording.start is not None:
        begun = job.recording.start
        drives = [
            d if d.info.start_time else replace(d, info=replace(d.info, start_time=begun))
            for d in drives
        ]
    rows = []
    for drive in drives:
        try:
            vehicle = job.assigned.as_vehicle(drive)
            weighed = weigh(drive, vehicle, job.method, settings=job.settings or None)
            row = _row(job, WEIGHED) | row_of(weighed)
            urls = job.recording.paths
            row["reason"] = remote.by_url(row["reason"], urls)
            row["warnings"] = [remote.by_url(text, urls) for text in row["warnings"]]
        except WeighbridgeError as error:
            row = _row(job, UNREAD, Problem.from_error(error)) | {
                "drive": drive.name,
                **_begin(drive.began),
            }
        if (note := job.assigned.note) is not None:
            row["warnings"] = [note.text, *row["warnings"]]
            row["problem_ids"] = [note.id, *row["problem_ids"]]
        rows.append(row)
    return rows


def _begin(began: str | None) -> dict[str, Any]:
    if began is None:
        return {}
    from weighbridge.fleet.facts import instant_of

    start = instant_of(began)
    return {"start": start, "date": None if start is None else start.date()}


def _row(job: Job, outcome: str, reason: Problem | None = None) -> dict[str, Any]:
    """Return the row of a drive that has no answer (yet)."""
    from weighbridge.fleet.facts import answer, of_vehicle
    from weighbridge.results.row import unread_row

    assigned = job.assigned
    path = Path(job.recording.paths[0])
    name = path.name if len(job.recording.paths) == 1 else path.stem
    vehicle = assigned.vehicle
    called = vehicle.name if vehicle is not None else assigned.id or assigned.kind
    if reason is not None:
        text = remote.by_url(reason.text, job.recording.paths)
        reason = replace(reason, text=visible(text))
    row = answer(unread_row(visible(name), called, job.method, reason))
    return {
        **row,
        **_begin(job.recording.start),
        **(of_vehicle(vehicle) if vehicle is not None else {"vehicle_class": assigned.kind}),
        "source": visible(job.recording.source),
        "copies": [],
        "also_vehicles": [],
        "outcome": outcome,
        "vehicle_id": assigned.id,
        "vehicle_file": assigned.file,
        "vehicle_digest": assigned.digest,
    }


def _written(job: Job, key: str, rows: list[dict[str, Any]], tries: int, begin: float) -> Receipt:
    now = datetime.now(UTC)
    for number, row in enumerate(rows):
        row |= {
            "key": key,
            "part": number,
            "parts": len(rows),
            "tries": tries,
            "weighed_at": now,
            "version": VERSION,
        }
    write_part(Path(job.results), key, rows)
    outcomes = {row["outcome"] for row in rows}
    outcome = next(o for o in (FAILED, UNREAD, WEIGHED) if o in outcomes)
    masses = sum(row["mass_kg"] is not None for row in rows)
    return Receipt(key, outcome, len(rows), masses, time.perf_counter() - begin)


def _of_the_machine(error: BaseException | None) -> bool:
    """Say whether an error of the system, such as a network that is gone, is behind another."""
    while error is not None:
        if isinstance(error, OSError):
            return True
        error = error.__cause__ or error.__context__
    return False


def named_error(error: Exception) -> str:
    """Say what an error says, with the kind of one that is not asked to users."""
    return str(error) if isinstance(error, WeighbridgeError) else f"{type(error).__name__}: {error}"
