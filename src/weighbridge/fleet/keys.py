"""Digests: the same content, vehicle, method and version have the same key, wherever they lie."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

from weighbridge.io import is_log
from weighbridge.io.parts import SUFFIX as PARTS
from weighbridge.io.read import TRUTH_NAME
from weighbridge.signals.catalogue import TABLES

_BLOCK: Final = 1 << 20
_SIZE: Final = 16  # 128 bits: two of a billion drives are alike by chance once in 10^20


def text_digest(texts: Iterable[str]) -> str:
    """Return the digest of texts, in order."""
    found = hashlib.blake2b(digest_size=_SIZE)
    for text in texts:
        data = text.encode("utf-8", "surrogateescape")
        found.update(len(data).to_bytes(8, "little"))
        found.update(data)
    return found.hexdigest()


def file_digest(path: Path) -> str:
    """Return the digest of a file's content, read in blocks."""
    found = hashlib.blake2b(digest_size=_SIZE)
    _add(found, path)
    return found.hexdigest()


def content_digest(paths: Sequence[Path]) -> str:
    """Return the digest of what a recording is read from.

    Folders and files may be moved and renamed; the names of tables count, as they say what is in
    them.

    Parameters
    ----------
    paths : a folder, a file, or the files of one drive

    Raises
    ------
    OSError
        A file is not there or cannot be read.
    """
    found = hashlib.blake2b(digest_size=_SIZE)
    for name, path in sorted(_named(paths)):
        label = name.encode("utf-8", "surrogateescape")
        found.update(len(label).to_bytes(8, "little"))
        found.update(label)
        found.update(path.stat().st_size.to_bytes(8, "little"))
        _add(found, path)
    return found.hexdigest()


def stamp(paths: Sequence[Path]) -> str | None:
    """Return the digest of what changes with the content of a recording, without reading it.

    Parameters
    ----------
    paths : as of `content_digest`

    Returns
    -------
    Of names, sizes, times and numbers of the same files; None where one cannot be asked
    """
    reported = []
    try:
        for name, path in sorted(_named(paths)):
            found = path.stat()
            # The time of change and the number of the file show a copy with the old times.
            reported += [
                name,
                repr((found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_ino)),
            ]
    except OSError:
        return None
    return text_digest(reported) if reported else None


def _named(paths: Sequence[Path]) -> Iterable[tuple[str, Path]]:
    """Each file that a reader opens, under a name that outlives a move."""
    for place in paths:
        if place.is_dir():
            for path in place.iterdir():
                if path.name.endswith(PARTS) and path.is_dir():
                    yield from ((f"{path.name}/{f.name}", f) for f in path.iterdir())
                elif _is_read(path):
                    yield path.name, path
        else:
            lone = len(paths) == 1 and place.stem.lower() not in TABLES
            yield place.suffix.lower() if lone else place.name, place
            if place.suffix.lower() == ".npy":
                # Its times may are in an array beside it.
                yield from ((f.name, f) for f in place.parent.glob("*.npy") if f.name != place.name)


def _is_read(path: Path) -> bool:
    if path.stem.lower() == TRUTH_NAME or not path.is_file():
        return False
    return path.suffix.lower() == ".toml" or is_log(path)


def _add(found: hashlib.blake2b, path: Path) -> None:
    with path.open("rb", buffering=0) as file:
        block = bytearray(_BLOCK)
        view = memoryview(block)
        while count := file.readinto(block):
            found.update(view[:count])
