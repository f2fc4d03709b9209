"""Results written whole or not at all: a part beside the target, then one rename.

A process that is killed, or a disk that is full, leaves the old file as it was. What may
then lie beside it has `PART` in its name and is no drive.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import shutil
import stat
import sys
import tempfile
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import IO, Final

from weighbridge.errors import ConfigError, WeighbridgeError

PART: Final = ".weighbridge-part"
"""Ends the name of a folder that holds an unfinished result."""

REPLACING: Final = ".weighbridge-replacing-"
"""Begins the name of a folder that holds a drive's old tables while new ones take their place."""

# Characters of a result's name that the name of its part repeats: names end at 255 bytes.
_REPEATED: Final = 40

# Open files of a process, as /dev/stdout and /dev/fd/3 lead to.
_OPEN_FILES: Final = re.compile(r"/proc/(\d+)(?:/task/\d+)?/fd")

# As many links as Linux follows (path_resolution(7)).
_MOST_LINKS: Final = 40


def is_stream(path: str | Path) -> bool:
    """Say whether a path is a device, a pipe or an open file: written to, never replaced."""
    if _open_file(Path(path)) is not None:
        return True
    try:
        mode = os.stat(path).st_mode  # noqa: PTH116  (names that are no UTF-8 as well)
    except OSError:
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


@contextlib.contextmanager
def whole_file(path: str | Path, error: type[WeighbridgeError] = ConfigError) -> Iterator[Path]:
    """Give a path to write a file to; it takes its place when the block ends without an error.

    A link is followed and stays. A file that was there hands on its permissions. What
    `is_stream` is written to at the end of the block.

    Parameters
    ----------
    path : the file
    error : the exception to raise

    Raises
    ------
    WeighbridgeError
        Of the type given: it cannot be written. The old file is as it was.
    """
    path = Path(path)
    with _reported(path, error):
        if is_stream(path):
            with tempfile.TemporaryDirectory() as home:
                part = Path(home) / f"part{path.suffix}"
                yield part
                with part.open("rb") as source, _opened(path) as stream:
                    shutil.copyfileobj(source, stream)
            return
        target = _followed(path)
        refuse_unwritable(target)
        folder = _beside(target)
        try:
            part = folder / f"part{target.suffix}"
            yield part
            if target.exists():
                _inherit(part, target)
            _synced(part)
            part.replace(target)
            _synced(target.parent)
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def write_whole(path: str | Path, text: str, error: type[WeighbridgeError] = ConfigError) -> None:
    """Write a text file in UTF-8; see `whole_file`."""
    with whole_file(path, error) as part:
        part.write_text(text, encoding="utf-8", newline="\n")


@contextlib.contextmanager
def whole_folder(
    folder: str | Path, replaced: Collection[str], error: type[WeighbridgeError] = ConfigError
) -> Iterator[Path]:
    """Give a folder to write files to; they take their place when the block ends without an error.

    Parameters
    ----------
    folder : made where it is not there
    replaced : names of the files that go when the new ones come; others stay
    error : the exception to raise

    Raises
    ------
    WeighbridgeError
        Of the type given: it cannot be written. The old files are as they were.
    """
    folder = Path(folder)
    with _reported(folder, error):
        target = _followed(folder)
        if target.exists() and not target.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, "is a file; name a folder")
        fresh = not target.exists()
        if fresh:
            try:
                target.parent.mkdir(parents=True, exist_ok=True)
            except FileExistsError:
                raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR)) from None
            part = target.parent / _part_name(target)
            part.mkdir()
        else:
            part = target / _part_name(target)
            part.mkdir()
        try:
            yield part
            for file in part.iterdir():
                _synced(file)
            _synced(part)
            if fresh:
                part.rename(target)
            else:
                part = _swapped(part, target, replaced)
            _synced(target if not fresh else target.parent)
        finally:
            shutil.rmtree(part, ignore_errors=True)


def refuse_unwritable(target: Path) -> None:
    """Raise OSError where a file is a folder, a loop of links or protected against writing."""
    if target.is_symlink():
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, "is a folder; name a file in it")
    # A rename would replace what may not be written.
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


def refuse_unwritable_place(path: str | Path, error: type[WeighbridgeError] = ConfigError) -> None:
    """Raise before the work where nothing can be written beside a result.

    Parameters
    ----------
    path : the file that is to be written, or the folder that files go to; where folders are still
        to be made, the nearest one that exists counts
    error : the exception to raise

    Raises
    ------
    WeighbridgeError
        Of the type given: the disk or the folder is read-only.
    """
    path = Path(path)
    with _reported(path, error):
        target = _followed(path)
        if target.is_dir():
            target /= "file"
        while not target.parent.exists():
            target = target.parent
        _beside(target).rmdir()


def _swapped(part: Path, target: Path, replaced: Collection[str]) -> Path:
    """Move the old files away and the new ones in; return the folder that is left over.

    Old and new are never side by side. A process killed meanwhile leaves a folder that
    begins with `REPLACING`, by which a reader knows.
    """
    names = sorted({*replaced, *(file.name for file in part.iterdir())})
    for name in names:
        if (target / name).is_dir():
            raise IsADirectoryError(errno.EISDIR, f"{name} in it is a folder; remove it first")
    new = sorted(part.iterdir())
    marked = part.rename(target / f"{REPLACING}{secrets.token_hex(4)}")
    old = marked / "old"
    moved: list[tuple[Path, Path]] = []
    try:
        old.mkdir()
        for name in names:
            if os.path.lexists(target / name):
                moved.append((target / name, old / name))
                (target / name).replace(old / name)
        for file in new:
            moved.append((marked / file.name, target / file.name))
            (marked / file.name).replace(target / file.name)
        return marked.rename(target / _part_name(target))
    except BaseException:
        for source, place in reversed(moved):
            if os.path.lexists(place) and not os.path.lexists(source):
                place.replace(source)
        with contextlib.suppress(OSError):
            old.rmdir()
            marked.rename(part)
        raise


@contextlib.contextmanager
def _reported(path: Path, error: type[WeighbridgeError]) -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:
        # Nobody reads any more: no fault of the path.
        raise
    except OSError as e:
        raise error(f"{path} cannot be written: {e.strerror or e}") from None


def _followed(path: Path) -> Path:
    return Path(os.path.realpath(path))


def _part_name(target: Path) -> str:
    return f".{target.name[:_REPEATED]}-{secrets.token_hex(4)}{PART}"


def _beside(target: Path) -> Path:
    folder = target.parent / _part_name(target)
    folder.mkdir(mode=0o700)
    return folder


def _inherit(part: Path, target: Path) -> None:
    """Give a part the permissions, and where that is allowed the owner, of what it replaces."""
    old = target.stat()
    with contextlib.suppress(OSError, AttributeError):
        if (old.st_uid, old.st_gid) != (part.stat().st_uid, part.stat().st_gid):
            os.chown(part, old.st_uid, old.st_gid)
    part.chmod(stat.S_IMODE(old.st_mode))


def _synced(path: Path) -> None:
    """Bring a file or the names in a folder to the disk before a rename relies on them."""
    try:
        number = os.open(path, os.O_RDONLY)
    except PermissionError:
        # Windows opens no folders.
        return
    try:
        os.fsync(number)
    except OSError as e:
        # Some file systems cannot; a full disk is another matter.
        if e.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EBADF, errno.EROFS):
            raise
    finally:
        os.close(number)


def _open_file(path: Path) -> tuple[str, int] | None:
    """Process and number of an open file, for a path that leads to one."""
    step = Path(os.path.abspath(path))  # noqa: PTH100  (links are followed one by one)
    for _ in range(_MOST_LINKS):
        if (found := _OPEN_FILES.fullmatch(os.path.realpath(step.parent))) and step.name.isdigit():
            return found.group(1), int(step.name)
        if not step.is_symlink():
            break
        step = step.parent / step.readlink()
    return None


def _opened(path: Path) -> IO[bytes]:
    """Open a device, a pipe or an open file at the place it has come to."""
    found = _open_file(path)
    if found is not None and found[0] == str(os.getpid()):
        for text in (sys.stdout, sys.stderr):
            if text is not None:
                text.flush()
        return os.fdopen(os.dup(found[1]), "wb")
    return path.open("ab" if found is not None else "wb")


def lock_file(number: int, *, wait: bool = False) -> bool:
    """Lock an open file for this process; False where another one has it, unless it is waited for.

    Where the system has no such locks nothing is locked.
    """
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(number, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError:
        return False
    return True
