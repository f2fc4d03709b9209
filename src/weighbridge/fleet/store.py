"""A folder of results: part files as workers write them, and the tables they are gathered into.

::

    RESULTS/fleet.json                              marks the folder; format version
    RESULTS/parts/ab/abcd….arrow                    one recording each, named after its key
    RESULTS/parts/ab/abcd…-0123….found              one place with a recording that has its result
    RESULTS/drives/day=2026-05-01/drives-0000.parquet
    RESULTS/segments/day=2026-05-01/segments-0000.parquet
    RESULTS/legs/day=2026-05-01/legs-0000.parquet   made of the two, see `weighbridge.fleet.kept`
    RESULTS/seen/0123….parquet                      recordings that need not be read again
    RESULTS/superseded.keys                         results that were, and count no more
    RESULTS/progress.json                           how far the last run is, for `fleet status`

Every file comes by one rename, so that a kill at any instant leaves whole files. A part is removed
after its rows are in the tables; a row that is in both is the same row, by ``key`` and ``part``.
When a run begins and when it ends, the tables are settled: they keep the rows that count. A place
holds one recording, and a recording counts once for a vehicle.

A place is the path or URL of a recording. What was found there last is what it holds. A recording
that lies at two places of one vehicle is a copy; at places of two vehicles it counts for both, and
both say so. One that is gone from a place, and was found at another, was moved.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import secrets
import time
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import polars as pl
from numpy.typing import NDArray

from weighbridge.errors import ConfigError
from weighbridge.fleet import remote
from weighbridge.fleet.keys import text_digest
from weighbridge.fleet.names import some
from weighbridge.fleet.schema import (
    DAY,
    DRIVES,
    FAILED,
    FORMAT_VERSION,
    PART,
    READABLE,
    SEEN,
    UNKNOWN_DATE,
    drives_of,
    segments_of,
)
from weighbridge.messages import Problem
from weighbridge.whole import PART as UNFINISHED
from weighbridge.whole import lock_file, whole_file, write_whole

HEAD: Final = ("key", "source", "copies", "content", "vehicle_id", "outcome", "weighed_at")
"""Columns of the table of drives that decide which of its rows count."""

_STATE: Final = ("source", "copies", "also_vehicles")

FOUND: Final[dict[str, Any]] = {
    "key": pl.String(),
    "place": pl.String(),
    "at": DRIVES["weighed_at"].type,
    "seen": SEEN["seen"],
}
"""Columns of places at which a run found a recording that has its result already."""

COPIED: Final = "fleet.copied"
SHARED: Final = "fleet.shared"
_NOTES: Final = (SHARED, COPIED)


def is_there(place: str) -> bool:
    """Say whether something is at a place still; true where that cannot be found out."""
    if os.path.lexists(place):
        return True
    return all(
        remote.exists(path) if remote.is_url(path) else os.path.lexists(path)
        for path in place.split(";")
    )


def standing(
    heads: pl.DataFrame, found: pl.DataFrame, there: Callable[[str], bool] | None = None
) -> pl.DataFrame:
    """Return the results that count, and where their recordings are.

    Parameters
    ----------
    heads : rows of `HEAD`, any number for each key
    found : rows of `FOUND`
    there : says whether a place still has something; None to take all places as they are

    Returns
    -------
    polars.DataFrame
        A row for each key that counts: ``key``, ``source``, ``copies``, ``also_vehicles``,
        ``notes`` and ``note_ids``.
    """
    heads = heads.unique("key", keep="first", maintain_order=True)
    own = heads.select(
        "key",
        pl.concat_list("source", pl.col("copies").fill_null([])).alias("place"),
        pl.col("weighed_at").alias("at"),
    ).explode("place")
    about = heads.select("key", "content", "vehicle_id", "weighed_at", failed=_failed())
    places = pl.concat([own, found.select(own.columns)]).join(about, on="key")
    # A try that failed says nothing of what is there: an earlier result stays.
    good = ~pl.col("failed")
    places = (
        places.filter(good | ~good.any().over("place", "vehicle_id"))
        .sort("at", "key", nulls_last=False)
        .unique("place", keep="last", maintain_order=True)
    )
    if there is not None:
        places = places.filter(~_moved(places, there))
    # The last result of a recording is that of all its places within the vehicle.
    same = pl.coalesce("content", "key"), pl.col("vehicle_id")
    places = places.sort("weighed_at", "key", nulls_last=False).with_columns(
        key=pl.col("key").last().over(*same)
    )
    keys = (
        places.sort("place")
        .group_by("key", maintain_order=True)
        .agg(pl.col("place"), pl.col("content", "vehicle_id").first())
    )
    all_of = pl.col("vehicle_id").unique().over("content", mapping_strategy="join")
    also = pl.when(pl.col("content").is_not_null()).then(all_of)
    keys = keys.with_columns(
        source=pl.col("place").list.first(),
        copies=pl.col("place").list.slice(1),
        also_vehicles=also.fill_null([])
        .list.set_difference(pl.concat_list("vehicle_id"))
        .list.sort(),
    )
    return _noted(keys.select("key", *_STATE))


def counted(rows: pl.LazyFrame, stand: pl.DataFrame) -> pl.LazyFrame:
    """Return the rows of drives that count, with their places and the notes about these.

    Parameters
    ----------
    rows : of drives
    stand : as of `standing`
    """
    # Notes of before are first in their lists.
    old = pl.col("problem_ids").list.eval(pl.element().is_in(_NOTES)).list.sum().fill_null(0)
    noted = pl.col("notes").list.len() > 0
    kept = {
        name: pl.when(noted)
        .then(pl.concat_list(notes, pl.col(name).fill_null([]).list.slice(old)))
        .otherwise(pl.col(name).list.slice(old))
        for name, notes in (("warnings", "notes"), ("problem_ids", "note_ids"))
    }
    return (
        rows.drop(_STATE, strict=False)
        .join(stand.lazy(), on="key", how="inner", maintain_order="left")
        .with_columns(**kept)
        .select(list(DRIVES))
    )


def _failed() -> pl.Expr:
    return (pl.col("outcome") == FAILED).fill_null(value=False)


def _moved(places: pl.DataFrame, there: Callable[[str], bool]) -> pl.Series:
    """Return which places have lost their recording to another."""
    several = (pl.len().over("content") > 1) & pl.col("content").is_not_null()
    asked = places.select("place", "content", several=several)
    gone = [few and not there(place) for place, _, few in asked.iter_rows()]
    left = pl.Series("gone", gone, pl.Boolean)
    return asked.with_columns(gone=left).select(
        moved=pl.col("gone") & (~pl.col("gone")).any().over("content")
    )["moved"]


def _noted(keys: pl.DataFrame) -> pl.DataFrame:
    """Add the notes of recordings that lie at several places."""
    notes, ids = [], []
    for _, _, copies, also in keys.iter_rows():
        own = []
        if also:
            own.append(Problem.of(SHARED, vehicles=some(also)))
        if copies:
            own.append(Problem.of(COPIED, count=len(copies), places=some(copies)))
        notes.append([problem.text for problem in own])
        ids.append([problem.id for problem in own])
    texts = pl.List(pl.String())
    return keys.with_columns(pl.Series("notes", notes, texts), pl.Series("note_ids", ids, texts))


MARK: Final = "fleet.json"
PROGRESS: Final = "progress.json"
PARTS: Final = "parts"
KEYS: Final = "-known.keys"
KEY_WIDTH: Final = 33
"""Bytes of a key in the file of the keys that are known, with the end of its line."""

_SEEN: Final = "seen"
_LOCK: Final = ".lock"
_SUFFIX: Final = ".arrow"
_FOUND: Final = ".found"
_SUPERSEDED: Final = "superseded.keys"
_PLACE: Final = 16  # letters of the digest of a place

TABLES: Final = MappingProxyType({"drives": drives_of, "segments": segments_of})
"""Tables of the results, and how they are made of parts."""

FULL: Final = 100_000
"""Rows of one file of a table, about: later rows of the date begin another."""

_GATHERED: Final = 5_000
"""Parts that are read at once; some 50 MB."""


def is_results(folder: Path) -> bool:
    """Say whether a folder holds results of a fleet."""
    return (folder / MARK).is_file()


def part_path(folder: Path, key: str) -> Path:
    """Where the part of a key goes."""
    return folder / PARTS / key[:2] / f"{key}{_SUFFIX}"


def place_of(key: str, source: str) -> str:
    """Return a key with a place, as the list of known keys has it."""
    return f"{key} {text_digest([source])[:_PLACE]}"


def write_found(folder: Path, key: str, source: str, seen: int | None) -> None:
    """Note that a recording with a result was found at a place.

    Parameters
    ----------
    folder : of the results
    key : of the result
    source : the place
    seen : as of `SEEN`

    Raises
    ------
    ConfigError
        The folder cannot be written to.
    """
    name = f"{place_of(key, source).replace(' ', '-')}{_FOUND}"
    path = part_path(folder, key).with_name(name)
    if not path.exists():
        now = datetime.now(UTC).isoformat()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as e:
            raise ConfigError(f"{path} cannot be written: {e.strerror or e}") from None
        entry = {"key": key, "place": source, "at": now, "seen": seen}
        write_whole(path, json.dumps(entry) + "\n")


def read_found(folder: Path) -> pl.DataFrame:
    """Return the places that `write_found` noted, columns as of `FOUND`."""
    rows = []
    for path in (folder / PARTS).glob(f"*/*{_FOUND}"):
        # One that is settled meanwhile, or spoilt, is found again by the next run.
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            said = json.loads(path.read_text(encoding="utf-8"))
            at = datetime.fromisoformat(said["at"])
            rows.append((said["key"], said["place"], at, said.get("seen")))
    return pl.DataFrame(rows, schema=FOUND, orient="row")


def write_part(folder: Path, key: str, rows: Sequence[dict[str, Any]]) -> None:
    """Write the rows of one recording, whole or not at all.

    Raises
    ------
    ConfigError
        The folder cannot be written to.
    """
    path = part_path(folder, key)
    part = path.with_name(f".{key}-{secrets.token_hex(4)}{UNFINISHED}")
    frame = pl.DataFrame(rows, schema=PART, orient="row")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Not as `whole_file`: a rename that a power cut takes back costs one drive, weighed again.
        with part.open("wb") as file:
            frame.write_ipc(file)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as e:
        raise ConfigError(f"{path} cannot be written: {e.strerror or e}") from None


def read_parts(paths: Sequence[Path]) -> pl.DataFrame:
    """Read part files; those that were gathered meanwhile are left out.

    Raises
    ------
    ConfigError
        A file is damaged.
    """
    frames = []
    for path in paths:
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            continue
        with _whole(path):
            frames.append(timed(pl.read_ipc(io.BytesIO(data)).lazy()).collect())
    return pl.concat([pl.DataFrame(schema=PART), *frames], how="diagonal")


def timed(rows: pl.LazyFrame) -> pl.LazyFrame:
    """Return rows of drives with their begin as an instant; it was a text until version 3."""
    if rows.collect_schema().get("start") != pl.String:
        return rows
    return rows.with_columns(pl.col("start").str.to_datetime(time_unit="us", time_zone="UTC"))


class Results:
    """A folder of results.

    Parameters
    ----------
    folder : as of `opened` or `begun`
    version : of its tables
    """

    def __init__(self, folder: Path, version: int = FORMAT_VERSION) -> None:
        self.folder = folder
        self.version = version

    @classmethod
    def opened(cls, folder: Path) -> Results:
        """Return the results that a folder holds.

        Raises
        ------
        ConfigError
            It holds none, or those of another version.
        """
        if not is_results(folder):
            raise ConfigError(
                f"{folder}: holds no results of weighbridge fleet; name such a folder"
            )
        try:
            version = json.loads((folder / MARK).read_text(encoding="utf-8")).get("format_version")
        except (OSError, ValueError, AttributeError) as error:
            raise ConfigError(f"{folder / MARK} cannot be read: {error}") from None
        if version not in READABLE:
            raise _of_version(folder, version)
        return cls(folder, version)

    @classmethod
    def begun(cls, folder: Path) -> Results:
        """Return the results in a folder, which is made where it is not there.

        Raises
        ------
        ConfigError
            The folder holds something else, or cannot be written to.
        """
        if is_results(folder):
            found = cls.opened(folder)
            if found.version != FORMAT_VERSION:
                raise _of_version(folder, found.version)
            return found
        try:
            folder.mkdir(parents=True, exist_ok=True)
            there = [f.name for f in folder.iterdir() if not f.name.endswith(UNFINISHED)]
        except OSError as e:
            raise ConfigError(f"{folder} cannot be written: {e.strerror or e}") from None
        if there:
            raise ConfigError(
                f"{folder}: is there and holds no results of weighbridge fleet; name an empty or "
                "new folder"
            )
        write_whole(folder / MARK, json.dumps({"format_version": FORMAT_VERSION}) + "\n")
        return cls(folder)

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other runs out; the lock goes with the process, however it ends.

        Raises
        ------
        ConfigError
            Another run writes here.
        """
        with (self.folder / _LOCK).open("ab") as file:
            if not lock_file(file.fileno()):
                raise ConfigError(
                    f"{self.folder}: another run of weighbridge fleet writes here; wait for it, or "
                    "name another folder"
                )
            yield

    @property
    def running(self) -> bool:
        """Whether a run holds the lock."""
        try:
            with (self.folder / _LOCK).open("rb") as file:
                return not lock_file(file.fileno())
        except OSError:
            return False

    def part_files(self) -> list[Path]:
        """List the parts that are not gathered, or not removed, yet."""
        return sorted((self.folder / PARTS).glob(f"*/*{_SUFFIX}"))

    def table_files(self, table: str) -> list[Path]:
        """List the files of a table."""
        # Until version 3 partitions were named date.
        return sorted((self.folder / table).glob("da*=*/*.parquet"))

    def check(self) -> None:
        """Read all tables and parts.

        Raises
        ------
        ConfigError
            A file is damaged.
        """
        for table in TABLES:
            for path in self.table_files(table):
                read_table(path, None)
        for path in self.part_files():
            read_parts([path])

    def clean(self) -> None:
        """Remove what killed writers left."""
        import shutil

        for left in self.folder.glob(f"**/.*{UNFINISHED}"):
            if left.is_dir():
                shutil.rmtree(left, ignore_errors=True)
            else:
                left.unlink(missing_ok=True)
        for left in self.folder.glob(f".*{KEYS}"):
            left.unlink(missing_ok=True)

    def known_keys(self) -> list[str]:
        """Keys that need not be weighed again, in order: all but those of drives that failed.

        All parts are gathered.
        """
        return self._good()["key"].unique().sort().to_list()

    def seen(self) -> NDArray[np.int64]:
        """What need not be read again, in order, see `SEEN`: results that stand at their places.

        All parts are gathered, and the tables settled.
        """
        held = [
            place_of(key, place)
            for key, source, copies in self._good()
            .select("key", "source", "copies")
            .unique("key")
            .iter_rows()
            for place in (source, *(copies or ()))
        ]
        files = sorted((self.folder / _SEEN).glob("*.parquet"))
        empty = pl.DataFrame(schema=SEEN)
        all_of = pl.concat([empty, *(read_table(path, list(SEEN)) for path in files)])
        rows = all_of.unique("held", keep="last", maintain_order=True)
        rows = rows.filter(pl.col("held").is_in(pl.Series(held, dtype=pl.String).implode()))
        if len(files) > 1 or rows.height < all_of.height:
            self._add_seen(rows)
            for path in files:
                path.unlink(missing_ok=True)
        return rows["seen"].sort().to_numpy()

    def _good(self) -> pl.DataFrame:
        return self._heads().filter(pl.col("outcome") != FAILED)

    def _add_seen(self, rows: pl.DataFrame) -> None:
        """Keep what was seen; a kill before its source is removed leaves it twice."""
        if rows.is_empty():
            return
        home = self.folder / _SEEN
        home.mkdir(exist_ok=True)
        write_table(home / f"{time.time_ns():020d}.parquet", rows.select(list(SEEN)))

    def superseded(self) -> set[str]:
        """Keys of results that counted once, and that no run will bring back by itself."""
        try:
            return set((self.folder / _SUPERSEDED).read_text(encoding="ascii").split())
        except FileNotFoundError:
            return set()
        except (OSError, ValueError) as error:
            raise ConfigError(f"{self.folder / _SUPERSEDED} cannot be read: {error}") from None

    def _heads(self) -> pl.DataFrame:
        files = self.table_files("drives")
        empty = pl.DataFrame(schema={name: PART[name] for name in HEAD})
        return pl.concat([empty, *(read_table(path, list(HEAD)) for path in files)])

    def settle(self, there: Callable[[str], bool] = is_there) -> None:
        """Keep the rows that count, where all parts are gathered: see `standing`.

        A kill at any instant leaves what the next call settles.

        Parameters
        ----------
        there : says whether a place still has something

        Raises
        ------
        ConfigError
            The folder cannot be written to. Nothing is lost.
        """
        found = read_found(self.folder)
        stand = standing(self._heads(), found, there)
        state = ["source", "copies", "also_vehicles"]
        dead: set[str] = set()
        stale: list[Path] = []
        for path in self.table_files("drives"):
            rows = read_table(path, ["key", *state])
            now = rows.select("key").join(stand, on="key", how="left", maintain_order="left")
            gone = now.filter(pl.col("source").is_null())["key"]
            dead |= set(gone)
            was = rows.with_columns(pl.col(state[1:]).fill_null([]))
            if gone.len() or not was.equals(now.select("key", *state)):
                stale.append(path)
        if dead:
            keys = sorted(self.superseded() | dead)
            write_whole(self.folder / _SUPERSEDED, "\n".join(keys) + "\n")
            # Segments first: a drive that is left brings the rest here again.
            for path in self.table_files("segments"):
                if not dead.isdisjoint(read_table(path, ["key"])["key"]):
                    rows = read_table(path, None)
                    write_table(path, rows.filter(~pl.col("key").is_in(dead)))
        for path in stale:
            write_table(path, counted(read_table(path, None).lazy(), stand).collect())
        self._add_seen(_held(found, "place"))
        for path in (self.folder / PARTS).glob(f"*/*{_FOUND}"):
            path.unlink(missing_ok=True)

    def gather(self) -> None:
        """Bring the rows of all parts into the tables, and remove the parts.

        Raises
        ------
        ConfigError
            The folder cannot be written to. Nothing is lost.
        """
        parts = self.part_files()
        for k in range(0, len(parts), _GATHERED):
            some = parts[k : k + _GATHERED]
            rows = read_parts(some).unique(["key", "part"], keep="first", maintain_order=True)
            for table, made in TABLES.items():
                for (day,), own in made(rows).partition_by("date", as_dict=True).items():
                    self._add(table, day, own)
            self._add_seen(_held(rows.filter(pl.col("part") == 0), "source"))
            for path in some:
                path.unlink(missing_ok=True)

    def _add(self, table: str, day: Any, rows: pl.DataFrame) -> None:
        """Add to the last file of a date what none of its files has."""
        home = self.folder / table / f"{DAY}={UNKNOWN_DATE if day is None else day.isoformat()}"
        files = sorted(home.glob("*.parquet"))
        by: list[str] = [n for n in ("key", "part", "segment") if n in rows.columns]
        last = read_table(files[-1], None) if files else None
        if last is not None and last.height >= FULL:
            last = None
        number = len(files) if last is None else len(files) - 1
        for path in files[:number]:
            rows = rows.join(read_table(path, by), on=by, how="anti")
        if rows.is_empty():
            return
        if last is not None:
            # A drive that failed, and fails again, has a new row.
            rows = pl.concat([last.join(rows, on=by, how="anti"), rows])
        home.mkdir(parents=True, exist_ok=True)
        write_table(home / f"{table}-{number:04d}.parquet", rows.sort(by))

    def write_progress(self, progress: dict[str, Any]) -> None:
        """Write how far a run is."""
        write_whole(self.folder / PROGRESS, json.dumps(progress) + "\n")

    def read_progress(self) -> dict[str, Any]:
        """Return how far the last run came; empty where that is not known."""
        try:
            found = json.loads((self.folder / PROGRESS).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return found if isinstance(found, dict) else {}


def _held(rows: pl.DataFrame, place: str) -> pl.DataFrame:
    """Return the rows of `SEEN` of results with their places."""
    kept = rows.filter(pl.col("seen").is_not_null())
    held = [place_of(*row) for row in kept.select("key", place).iter_rows()]
    return kept.select(pl.Series("held", held, pl.String), "seen")


def _of_version(folder: Path, version: object) -> ConfigError:
    return ConfigError(
        f"{folder}: results of format {version}, and this program writes {FORMAT_VERSION}; "
        "name another folder"
    )


def check_end(path: Path) -> None:
    """Raise where a file of a table was cut off, as its end shows.

    Raises
    ------
    ConfigError
        It was cut off.
    """
    with path.open("rb") as file, _whole(path):
        pl.read_parquet_schema(file)


def write_table(path: Path, rows: pl.DataFrame) -> None:
    """Write a file of a table; one without rows stays, as a reader may be about to open it."""
    # By way of the memory: a full disk is reported as one, which polars does not.
    data = io.BytesIO()
    rows.write_parquet(data, compression="zstd")
    with whole_file(path) as part:
        part.write_bytes(data.getbuffer())


def read_table(path: Path, names: list[str] | None) -> pl.DataFrame:
    """Read columns of a file of a table; all where none is named.

    Raises
    ------
    ConfigError
        It is damaged.
    """
    with path.open("rb") as file, _whole(path):
        return pl.read_parquet(file, columns=names, hive_partitioning=False)


@contextlib.contextmanager
def _whole(path: Path) -> Iterator[None]:
    """Report a damaged file, and what to remove so that its drives are weighed again."""
    try:
        yield
    except (pl.exceptions.PolarsError, OSError) as error:
        why = str(error).partition("\n")[0]
        date = [path.parents[2] / table / path.parent.name for table in TABLES]
        gone = [path] if path.suffix == _SUFFIX else date
        raise ConfigError(
            f"{path}: is damaged ({why}); remove {' and '.join(map(str, gone))}, and give the "
            "command of the run again, which weighs what is missing"
        ) from None
