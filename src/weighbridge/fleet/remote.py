"""Recordings behind a URL, by fsspec: found, and brought to a folder of this machine."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from weighbridge.errors import DriveError, MissingExtraError
from weighbridge.fleet.keys import text_digest
from weighbridge.fleet.names import is_drive_name, is_table_name
from weighbridge.visible import visible

_URL: Final = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")


_HOME: Final = "weighbridge-"

_VERSION: Final = (
    "ETag", "etag", "md5Hash", "generation", "content_md5", "LastModified", "last_modified",
    "updated", "mtime", "created", "ino",
)  # fmt: skip
"""What the listings of stores say of a file that changes with its content."""


def is_url(text: str) -> bool:
    """Say whether a text is a URL and no path."""
    return _URL.match(text) is not None


def was_url(path: Path) -> bool:
    """Say whether a path was made of a URL, of which it keeps one slash."""
    return re.match(r"[A-Za-z][A-Za-z0-9+.-]+:/", path.as_posix()) is not None


def drives(url: str, *, as_drive: bool) -> Iterator[tuple[str, str | None]]:
    """Find recordings behind a URL, which may be a pattern; the rules are those of paths.

    Parameters
    ----------
    url : such as ``s3://bucket/drives/**``
    as_drive : each folder that a pattern matches is one drive, whatever is in it

    Returns
    -------
    The URL of each, and its stamp: the digest of what the listing says of its files, which changes
    with their content; None where it says too little

    Raises
    ------
    DriveError
        The store cannot be asked.
    MissingExtraError
        fsspec, or what it needs for this kind of URL, is not installed.
    """
    files, root = opened_store(url)
    try:
        # What changed since an earlier listing of this process counts, too.
        files.invalidate_cache()
        if _is_pattern(root) and not files.exists(root):
            found = sorted(files.glob(root))
            if as_drive:
                for path in found:
                    if files.isdir(path):
                        yield files.unstrip_protocol(path.rstrip("/")), _stamp(_find(files, path))
                return
            below = {f: reported for path in found for f, reported in _find(files, path).items()}
        else:
            below = _find(files, root)
    except Exception as error:  # each store has errors of its own
        raise DriveError(f"{url} cannot be listed: {error}") from None
    for path, inside in _grouped(sorted(below)):
        yield files.unstrip_protocol(path), _stamp({file: below[file] for file in inside})


def _find(files: Any, path: str) -> dict[str, Mapping[str, Any]]:
    """Files below a path, and what the store says of each."""
    return dict(files.find(path, detail=True))


def _stamp(files: Mapping[str, Mapping[str, Any]]) -> str | None:
    """Digest of what a store says of files; None where it does not say when one changed."""
    reported = []
    for path, about in sorted(files.items()):
        version = [(name, str(about[name])) for name in _VERSION if about.get(name) is not None]
        if not version:
            return None
        reported += [path, repr((about.get("size"), version))]
    return text_digest(reported) if reported else None


def exists(url: str) -> bool:
    """Say whether something is behind a URL; true where the store cannot be asked."""
    try:
        files, path = opened_store(url)
        return bool(files.exists(path))
    except Exception:  # each store has errors of its own
        return True


def home() -> tempfile.TemporaryDirectory[str]:
    """Return a folder of this machine for what is brought; it goes with the block."""
    return tempfile.TemporaryDirectory(prefix=_HOME)


def by_url(text: str, urls: Sequence[str]) -> str:
    """Name what was brought as the store has it: nobody finds it under its path of then.

    Parameters
    ----------
    text : of a message
    urls : that the message is about
    """
    if not is_url(urls[0]):
        return text
    above = _parent(urls[0].rstrip("/"))
    folder = Path(tempfile.gettempdir())
    for begin in {str(folder / _HOME), str(folder.resolve() / _HOME)}:
        text = re.sub(rf"{re.escape(begin)}\w+", lambda _: above, text)
    return text


def fetch(urls: Sequence[str], folder: Path) -> list[Path]:
    """Bring a recording to a folder; return its paths there.

    Raises
    ------
    OSError
        It is not there, or the store fails.
    """
    brought = []
    for url in urls:
        files, path = opened_store(url)
        name = path.rstrip("/").rpartition("/")[2]
        target = folder / name
        if files.isdir(path):
            target.mkdir()
            inside = [f for f in files.find(path) if f != path]
            for file in inside:
                local = target / file[len(path.rstrip("/")) + 1 :]
                local.parent.mkdir(parents=True, exist_ok=True)
                files.get_file(file, str(local))
        else:
            files.get_file(path, str(target))
        brought.append(target)
    return brought


def opened_store(url: str, purpose: str = "reading") -> tuple[Any, str]:
    """Return the file system of a URL, and the path in it.

    Parameters
    ----------
    url : of any kind that fsspec knows
    purpose : what it is for, in the words of an error

    Raises
    ------
    DriveError
        The URL is none.
    MissingExtraError
        fsspec, or what it needs for this kind of URL, is not installed.
    """
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise MissingExtraError("fsspec", "fleet", f"{purpose} {visible(url)}") from None
    try:
        files, path = url_to_fs(url)
    except ImportError as error:
        package = error.name or getattr(error.__cause__, "name", None)
        if package is None:
            raise DriveError(f"{visible(url)} cannot be read: {error}") from None
        extra = "s3" if package == "s3fs" else None
        raise MissingExtraError(package, extra, f"{purpose} {visible(url)}") from None
    except ValueError as error:
        raise DriveError(f"{url}: {error}") from None
    return files, path


def _is_pattern(text: str) -> bool:
    return any(letter in text for letter in "*?[")


def _grouped(files: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Folders that hold tables, and other logs, in order; each with its files."""
    folders = {_parent(f) for f in files if is_table_name(_name(f)) and _name(f)}
    found: dict[str, list[str]] = {}
    for file in files:
        home = _parent(file)
        part_of = home if home in folders else _parent(home)
        if home in folders or (home.endswith(".parts") and part_of in folders):
            found.setdefault(part_of, []).append(file)
        elif is_drive_name(_name(file)):
            found[file] = [file]
    yield from found.items()


def _parent(path: str) -> str:
    return path.rpartition("/")[0]


def _name(path: str) -> str:
    return path.rpartition("/")[2]
