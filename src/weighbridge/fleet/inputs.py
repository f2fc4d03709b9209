"""Which recordings there are: paths, patterns, URLs and tables of drives."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final, NamedTuple

from weighbridge.errors import DriveError
from weighbridge.fleet import remote, table
from weighbridge.fleet.names import is_drive_name, is_table_name
from weighbridge.fleet.store import is_results
from weighbridge.io.paths import partitions
from weighbridge.signals.catalogue import TABLES
from weighbridge.whole import PART

_WALK: Final = "**"


class Recording(NamedTuple):
    """One recording to weigh.

    Attributes
    ----------
    paths : of its folder or file, or the files of one drive; paths or URLs
    vehicle : id that a table of drives gives; None where the path has to give it
    kind : vehicle class that such a table gives
    start : begin that such a table gives, ISO 8601
    stamp : what the listing of a store says of its files, as of `remote.drives`
    """

    paths: tuple[str, ...]
    vehicle: str | None = None
    kind: str | None = None
    start: str | None = None
    stamp: str | None = None

    @property
    def source(self) -> str:
        """How results name it."""
        return ";".join(self.paths)


def refuse_missing(given: Iterable[str]) -> None:
    """Raise before the work where a path that is no pattern is not there.

    Raises
    ------
    DriveError
        Nothing is there of that name.
    """
    for text in given:
        if not (remote.is_url(text) or os.path.lexists(text) or glob.has_magic(text)):
            raise DriveError(f"{text}: no such file or folder")


def recordings(given: Iterable[str]) -> Iterator[Recording]:
    """Find recordings, one by one, as they are asked for; each once.

    A path that is there is that path, whatever letters its name has; any other with ``*``, ``?``
    or ``[`` is a pattern, in which ``**`` is any depth. A folder that holds tables is one drive,
    and so is each folder of a pattern that ends in a slash; in any other folder each log is one,
    and folders in it are looked into. A slash behind a folder's own name changes nothing.

    Parameters
    ----------
    given : paths, patterns, URLs, and tables of drives (see `weighbridge.fleet.table`)

    Raises
    ------
    DriveError
        Nothing is there of that name, or nothing that could be a drive.
    """
    seen: set[str] = set()
    for text in given:
        count = 0
        for found in _found(text):
            count += 1
            if found.source not in seen:
                seen.add(found.source)
                yield found
        if not count:
            raise DriveError(
                f"{text}: holds no drive: neither a folder with {', '.join(TABLES)} (CSV or "
                "Parquet) nor a log; name another place"
            )


def _found(text: str) -> Iterator[Recording]:
    if remote.is_url(text):
        for url, stamp in remote.drives(text, as_drive=_as_drive(text)):
            yield Recording((url,), stamp=stamp)
        return
    path = Path(text)
    if os.path.lexists(path):
        if path.is_file() and table.is_table(path):
            yield from (
                Recording(row.files, row.vehicle, row.kind, row.start) for row in table.rows(path)
            )
        else:
            yield from _of(path)
    else:
        refuse_missing([text])
        yield from _matching(text)


def _as_drive(text: str) -> bool:
    """Say whether each folder that matches is one drive; a shell adds slashes to names."""
    return glob.has_magic(text) and text.endswith(("/", os.sep))


def _matching(pattern: str) -> Iterator[Recording]:
    """Recordings of a pattern; one that ends in ``**`` is walked, so that the first comes soon."""
    base, _, last = pattern.rpartition("/")
    if last == _WALK:
        if base and os.path.lexists(base):
            roots = [base]
        elif base:
            roots = _globbed(base)
        else:
            roots = ["."]
        for root in roots:
            yield from _of(Path(root))
        return
    for match in _globbed(pattern):
        path = Path(match)
        if path.is_dir() or _is_drive_file(path):
            yield from _of(path, as_drive=_as_drive(pattern))


def _globbed(pattern: str) -> list[str]:
    return sorted(glob.glob(pattern, recursive=True))  # noqa: PTH207  (keeps a slash at the end)


def _of(path: Path, as_drive: bool = False) -> Iterator[Recording]:
    """Recordings at a path that is there: a drive, or those in a folder, in order of names."""
    if as_drive or not path.is_dir():
        yield Recording((str(path),))
        return
    try:
        with os.scandir(path) as entries:
            inside = sorted(entries, key=lambda e: e.name)
    except OSError as e:
        raise DriveError(f"{path} cannot be read: {e.strerror or e}") from None
    if is_results(path):
        return
    if any(is_table_name(e.name) for e in inside):
        yield Recording((str(path),))
        return
    if partitions([path.name]):
        # Files of one partition are parts of one table.
        files = [e.path for e in inside if _is_drive_file(Path(e.path))]
        if len(files) > 1:
            yield Recording(tuple(files))
            inside = [e for e in inside if e.is_dir()]
    for entry in inside:
        if entry.name.startswith(".") or entry.name.endswith(PART):
            continue
        if entry.is_dir():
            yield from _of(Path(entry.path))
        elif _is_drive_file(Path(entry.path)):
            yield Recording((entry.path,))


def _is_drive_file(path: Path) -> bool:
    return is_drive_name(path.name) and path.is_file()
