"""Messages that wait on disk until somebody has taken them."""

from __future__ import annotations

import logging
import secrets
import sqlite3
from pathlib import Path
from threading import Lock
from typing import Final, NamedTuple

from weighbridge.errors import ConfigError, WeighbridgeError

_logger = logging.getLogger(__name__)

MOST: Final = 50_000
"""Messages that wait at most: some 30 hours of weighings each 5 s, 100 MB."""

_TABLE: Final = """
CREATE TABLE IF NOT EXISTS messages (
    number INTEGER PRIMARY KEY AUTOINCREMENT, topic TEXT NOT NULL, payload BLOB NOT NULL
)"""


_HEAD: Final = b"SQLite format 3\0"

# Marks a file of SQLite as an outbox: "wbob".
_MARK: Final = 0x77626F62


class Message(NamedTuple):
    """A message that waits.

    ``number`` rises in the order in which messages were put in.
    """

    number: int
    topic: str
    payload: bytes


class Outbox:
    """A queue in a file of SQLite; it outlives the process. Threads may share it.

    Beyond ``most`` messages the oldest are dropped and counted. A file that is damaged is set
    aside and a new one begun.

    Parameters
    ----------
    path : the file
    most : messages that wait at most

    Attributes
    ----------
    own : a few letters and digits that hardly any other outbox has; they stay with the file

    Raises
    ------
    ConfigError
        It cannot be opened, or another process has it.
    """

    def __init__(self, path: str | Path, most: int = MOST) -> None:
        self.path = Path(path)
        self.dropped = 0
        self._most = most
        self._lock = Lock()
        self._removed: set[int] = set()
        try:
            self._database = self._opened()
        except sqlite3.OperationalError as error:
            raise self._failure(error) from None
        except sqlite3.DatabaseError:
            self._database = self._begun_anew()
        self.own = f"{self._database.execute('PRAGMA user_version').fetchone()[0]:06x}"
        self._count = int(self._database.execute("SELECT count(*) FROM messages").fetchone()[0])

    def __len__(self) -> int:
        return self._count - len(self._removed)

    def put(self, messages: list[tuple[str, bytes]]) -> None:
        """Append messages, given as topic and payload.

        Raises
        ------
        WeighbridgeError
            The disk is full or gone; none of them was taken.
        """
        with self._lock:
            self._remove()
            over = max(self._count + len(messages) - self._most, 0)
            try:
                with self._database as d:
                    d.executemany("INSERT INTO messages (topic, payload) VALUES (?, ?)", messages)
                    if over:
                        d.execute(
                            "DELETE FROM messages WHERE number IN "
                            "(SELECT number FROM messages ORDER BY number LIMIT ?)",
                            (over,),
                        )
            except sqlite3.Error as error:
                raise WeighbridgeError(
                    f"{self.path} cannot be written ({error}): messages are lost until there is "
                    "room on the disk; weighing goes on"
                ) from None
            self._count += len(messages) - over
            if over and not self.dropped:
                _logger.warning(
                    "%s: more than %d messages wait for the broker; the oldest are dropped",
                    self.path,
                    self._most,
                )
            self.dropped += over

    def after(self, number: int, most: int) -> list[Message]:
        """Return the oldest messages behind ``number``, at most so many."""
        with self._lock:
            rows = self._database.execute(
                "SELECT number, topic, payload FROM messages WHERE number > ? "
                "ORDER BY number LIMIT ?",
                (number, most + len(self._removed)),
            )
            left = [Message(*row) for row in rows if row[0] not in self._removed]
            return left[:most]

    def remove(self, numbers: list[int]) -> None:
        """Remove messages that were taken; where the disk is full, when it has room again."""
        with self._lock:
            self._removed.update(numbers)
            self._remove()

    def _remove(self) -> None:
        if not self._removed:
            return
        try:
            with self._database as d:
                removed = d.executemany(
                    "DELETE FROM messages WHERE number = ?", [(n,) for n in self._removed]
                )
        except sqlite3.Error:
            return
        self._count -= removed.rowcount
        self._removed.clear()

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._database.close()

    def _opened(self) -> sqlite3.Connection:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        database = sqlite3.connect(self.path, timeout=1.0, check_same_thread=False)
        try:
            # One owner: two senders would send everything twice.
            database.execute("PRAGMA locking_mode = EXCLUSIVE")
            self._refuse_foreign(database)
            database.execute("PRAGMA journal_mode = WAL")
            # Each commit is flushed: a power cut loses nothing that was taken, and nothing that was
            # confirmed is sent again.
            database.execute("PRAGMA synchronous = FULL")
            database.execute("BEGIN EXCLUSIVE")
            database.execute(f"PRAGMA application_id = {_MARK}")
            database.execute(_TABLE)
            if database.execute("PRAGMA user_version").fetchone()[0] == 0:
                database.execute(f"PRAGMA user_version = {1 + secrets.randbelow(0xFFFFFF)}")
            database.commit()
            if database.execute("PRAGMA quick_check").fetchone()[0] != "ok":
                raise sqlite3.DatabaseError("damaged")
        except BaseException:
            database.close()
            raise
        return database

    def _refuse_foreign(self, database: sqlite3.Connection) -> None:
        mark = database.execute("PRAGMA application_id").fetchone()[0]
        tables = database.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        if tables and mark != _MARK:
            raise ConfigError(f"{self.path} is a database of something else; name another outbox")

    def _begun_anew(self) -> sqlite3.Connection:
        with self.path.open("rb") as file:
            head = file.read(len(_HEAD))
        if head.strip(b"\0") and head != _HEAD:
            raise ConfigError(f"{self.path} is no outbox; name another file")
        aside = self.path.with_name(f"{self.path.name}.damaged")
        try:
            self.path.replace(aside)
            for end in ("-wal", "-shm"):
                self.path.with_name(self.path.name + end).unlink(missing_ok=True)
            _logger.warning("%s is damaged: it was set aside as %s", self.path, aside.name)
            return self._opened()
        except (OSError, sqlite3.Error) as error:
            raise self._failure(error) from None

    def _failure(self, error: Exception) -> ConfigError:
        if "locked" in str(error):
            return ConfigError(
                f"{self.path} is used by another weighbridge: end that one, or name another outbox"
            )
        return ConfigError(f"{self.path} cannot be used as an outbox ({error}); name another file")
