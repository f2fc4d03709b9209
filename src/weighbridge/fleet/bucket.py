"""Results behind a URL: a folder of this machine that is brought from there, and sent there.

A run works on the folder; after each gathering the files that changed are sent. Each object of a
store is whole or old, and the order makes a kill between two of them harmless: segments come
before the drives that count them, files that grew before those that lost rows, and at last
``sent.json``, which lists what the store has. What a kill left is sent by the next run, on any
machine: it brings the store's files unless its own folder was the last to send. The table of legs
is made anew from the others.
"""

from __future__ import annotations

import contextlib
import json
import logging
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from weighbridge.errors import ConfigError
from weighbridge.fleet.keys import file_digest, text_digest
from weighbridge.fleet.remote import is_url, opened_store
from weighbridge.fleet.store import MARK, PARTS, PROGRESS, is_results
from weighbridge.visible import visible
from weighbridge.whole import PART as UNFINISHED
from weighbridge.whole import lock_file, write_whole

SENT: Final = "sent.json"
"""List of the files that a store has, with a name that each sending changes."""

_LOG: Final = logging.getLogger(__name__)

# What is sent in this order; all else before it.
_ORDER: Final = ("segments", "drives", "legs", MARK, PROGRESS)

_LOCAL: Final = ("localhost", "127.0.0.1", "[::1]", "inproc:")


class AnotherRunError(ConfigError):
    """Another run of this machine sends to the same place."""


class Folder:
    """Results in a folder, which nothing is sent from."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def send(self, *, last: bool = True) -> None:
        """Leave the results where they are."""


class Bucket(Folder):
    """Results behind a URL.

    Parameters
    ----------
    url : such as ``s3://bucket/results``

    Raises
    ------
    DriveError, MissingExtraError
        The URL is none, or a package that it needs is not installed.
    """

    def __init__(self, url: str) -> None:
        from numba.misc.appdirs import AppDirs

        self.url = url.rstrip("/")
        self._files, root = opened_store(self.url, "writing")
        self._root = root.rstrip("/")
        cache = Path(AppDirs("weighbridge", appauthor=False).user_cache_dir)
        self._home = cache / "fleet" / text_digest([self.url])
        super().__init__(self._home / "results")
        self._there: dict[str, Any] = {}
        self._digests: dict[Path, tuple[tuple[int, int], str]] = {}

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other runs of this machine out.

        Raises
        ------
        AnotherRunError
            So it is.
        """
        self._home.mkdir(parents=True, exist_ok=True)
        with (self._home / ".lock").open("ab") as file:
            if not lock_file(file.fileno()):
                raise AnotherRunError(
                    f"{self.url}: another run of weighbridge fleet writes there; wait for it, or "
                    "name another place"
                )
            yield

    def bring(self) -> None:
        """Bring the results of the store to the folder, unless it was the last to send there.

        Raises
        ------
        ConfigError
            The store cannot be asked, or holds something else.
        """
        with self._asking("read"):
            self._there = self._listed()
            own = self._home / SENT
            if own.is_file() and json.loads(own.read_text()) == self._there:
                return
            there = self._files.find(self._root) if self._files.exists(self._root) else []
            names = sorted(path[len(self._root) + 1 :] for path in there)
            if names and MARK not in names and SENT not in names:
                raise ConfigError(
                    f"{self.url}: is there and holds no results of weighbridge fleet; name an "
                    "empty or new place"
                )
            part = self._home / f"brought{UNFINISHED}"
            shutil.rmtree(part, ignore_errors=True)
            for name in names:
                if name.partition("/")[0] not in ("legs", SENT, ""):
                    target = part / name
                    target.parent.mkdir(parents=True, exist_ok=True)
                    self._files.get_file(f"{self._root}/{name}", str(target))
            part.mkdir(parents=True, exist_ok=True)
            if MARK in names and (self.folder / PARTS).is_dir():
                # What was weighed here and never gathered.
                shutil.copytree(self.folder / PARTS, part / PARTS)
            shutil.rmtree(self.folder, ignore_errors=True)
            part.rename(self.folder)
            if names:
                write_whole(own, json.dumps(self._there))

    def claim(self) -> None:
        """Name this folder as the one that sends from now on.

        Raises
        ------
        ConfigError
            The store cannot be written to.
        """
        with self._asking("written"):
            self._list(self._there.get("files", {}))

    def send(self, *, last: bool = True) -> None:
        """Send the files that changed since the last sending.

        Parameters
        ----------
        last : where the store fails, raise; else log it, for the next sending makes up for it

        Raises
        ------
        ConfigError
            Another run sent there meanwhile, or the store failed. What was weighed is kept in
            the folder.
        """
        if not is_results(self.folder):
            return
        if self._listed_or_none(last) != self._there.get("sending"):
            raise ConfigError(
                f"{self.url}: another run of weighbridge fleet wrote there meanwhile; wait for it "
                "and give the command again"
            )
        try:
            with self._asking("written"):
                self._send()
        except ConfigError as error:
            if last:
                raise
            _LOG.warning("%s", error)

    def _send(self) -> None:
        was: dict[str, list[Any]] = self._there.get("files", {})
        now = {
            path.relative_to(self.folder).as_posix(): [self._digest(path), path.stat().st_size]
            for path in sorted(self.folder.rglob("*"))
            if path.is_file() and not self._is_own(path)
        }
        changed = [name for name, what in now.items() if was.get(name) != what]

        def grown(name: str) -> int:
            return int(now[name][1] - was.get(name, ["", 0])[1])

        for name in sorted(changed, key=lambda name: (_turn(name), -grown(name))):
            self._put(name, (self.folder / name).read_bytes())
        for name in was.keys() - now.keys():
            with contextlib.suppress(FileNotFoundError):
                self._files.rm_file(f"{self._root}/{name}")
        if changed or was.keys() - now.keys():
            self._list(now)

    def _list(self, files: dict[str, list[Any]]) -> None:
        listing = {"sending": secrets.token_hex(8), "files": files}
        self._put(SENT, json.dumps(listing).encode())
        self._there = listing
        write_whole(self._home / SENT, json.dumps(listing))

    def _put(self, name: str, data: bytes) -> None:
        self._files.pipe_file(f"{self._root}/{name}", data)

    def _listed(self) -> dict[str, Any]:
        """Return what the store says that it has; empty where it has nothing."""
        self._files.invalidate_cache()
        try:
            found = json.loads(self._files.cat_file(f"{self._root}/{SENT}"))
        except FileNotFoundError:
            return {}
        return found if isinstance(found, dict) else {}

    def _listed_or_none(self, last: bool) -> Any:
        """Name of the last sending; that of our own where the store fails for a moment."""
        try:
            with self._asking("read"):
                return self._listed().get("sending")
        except ConfigError:
            if last:
                raise
            return self._there.get("sending")

    def _is_own(self, path: Path) -> bool:
        """Whether a file is of this machine alone: parts, locks, what is unfinished."""
        names = path.relative_to(self.folder).parts
        return names[0] == PARTS or any(name.startswith(".") for name in names)

    def _digest(self, path: Path) -> str:
        about = path.stat()
        version = (about.st_size, about.st_mtime_ns)
        known = self._digests.get(path)
        if known is None or known[0] != version:
            known = self._digests[path] = (version, file_digest(path))
        return known[1]

    @contextlib.contextmanager
    def _asking(self, what: str) -> Iterator[None]:
        """Say in one line what a store failed at."""
        try:
            yield
        except ConfigError:
            raise
        except Exception as error:  # each store has errors of its own
            why = str(error).partition("\n")[0] or type(error).__name__
            kept = (
                f"; what was weighed is kept in {self.folder}: give the command again"
                if is_results(self.folder)
                else ""
            )
            raise ConfigError(f"{self.url}: cannot be {what} ({visible(why)}){kept}") from None


def _turn(name: str) -> int:
    first = name.partition("/")[0]
    return _ORDER.index(first) if first in _ORDER else -1


def place_of_results(place: str | Path) -> Folder:
    """Return the results at a place: a folder, or a URL such as ``s3://bucket/results``.

    Raises
    ------
    DriveError, MissingExtraError
        As of `Bucket`.
    """
    text = str(place)
    if not isinstance(place, str) or not is_url(text):
        return Folder(Path(place))
    if text.startswith("file://"):
        return Folder(Path(text.removeprefix("file://")))
    return Bucket(text)


def brought(place: str) -> Path:
    """Return the folder of results to read: of a URL, what the store has, or a run here writes.

    Parameters
    ----------
    place : as of `place_of_results`

    Raises
    ------
    ConfigError
        The store cannot be read, or holds no results.
    DriveError, MissingExtraError
        As of `Bucket`.
    """
    results = place_of_results(place)
    if isinstance(results, Bucket):
        with contextlib.suppress(AnotherRunError), results.locked():
            results.bring()
        if not is_results(results.folder):
            raise ConfigError(f"{place}: holds no results of weighbridge fleet; name such a place")
    return results.folder


@contextlib.contextmanager
def kept_at(results: Folder, scheduler: str | None = None) -> Iterator[Folder]:
    """Bring results from their place, and send them there when the block ends, however it does.

    Parameters
    ----------
    results : as of `place_of_results`
    scheduler : address of a cluster; its workers must see the folder

    Raises
    ------
    ConfigError
        The place cannot be read or written, another run writes there, or the cluster is on
        other machines.
    """
    if not isinstance(results, Bucket):
        yield results
        return
    if scheduler is not None and not any(name in scheduler for name in _LOCAL):
        raise ConfigError(
            f"{results.url}: workers of {scheduler} do not see the folder of this machine that "
            "results are sent from; name a folder that all see, and copy it to the store"
        )
    with results.locked():
        results.bring()
        results.claim()
        try:
            yield results
        finally:
            results.send()
