"""Which vehicle a drive is of: by a column, a folder's name or a file's, else its class's."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, Final, NamedTuple

from weighbridge.arguments import check_choice
from weighbridge.errors import ConfigError
from weighbridge.fleet.keys import file_digest, text_digest
from weighbridge.io import load_mapping
from weighbridge.io.dbc import dbc_path, with_path
from weighbridge.io.mapping import named_dbcs
from weighbridge.io.naming import words_of
from weighbridge.io.paths import partitions
from weighbridge.messages import Problem, phrase
from weighbridge.pipeline.given import mapping_of
from weighbridge.signals import Drive
from weighbridge.vehicle import TORQUE_SOURCES, VEHICLE_CLASSES, Known, Vehicle, describe

_VEHICLE_KEYS: Final = frozenset(
    ("vehicle", "asset", "truck", "car", "bus", "van", "vin", "device", "unit", "registration",
     "plate", "fahrzeug")
)  # fmt: skip
"""Words of a partition's key that make its value the id of a vehicle."""

# After its id a file's name goes on with anything but a letter or a digit: truck17_2025-06-11.
_BEHIND: Final = re.compile(r"[^A-Za-z0-9]")


@dataclass(frozen=True, slots=True, kw_only=True)
class Assigned:
    """The vehicle that a drive is weighed as.

    Attributes
    ----------
    id : by which it was found; None where nothing gives it
    file : name of its file; None where its class's data sheet is in
    vehicle : of the file; None for the data sheet, which asks the drive for its torque
    kind : name of its class
    mapping : what its logs are read with; None for canonical ones
    digest : of file and mapping, and of the DBC files that the mapping names
    mapping_file : its path; None where there is none
    """

    id: str | None
    file: str | None
    vehicle: Vehicle | None
    kind: str
    mapping: Mapping[str, Any] | None
    digest: str
    mapping_file: str | None = None

    def as_vehicle(self, drive: Drive) -> Vehicle:
        """Return the vehicle; that of a data sheet with the best torque that the drive shows."""
        if self.vehicle is not None:
            return self.vehicle
        reported = (s for s in TORQUE_SOURCES.values() if s.signed and not s.lacking(drive))
        source = next(reported, None)
        known = Known(
            name=self.id or self.kind,
            kind=self.kind,
            torque=source.name if source is not None else None,
        )
        return describe(known).vehicle

    @property
    def note(self) -> Problem | None:
        """Say that no file was found; None where one was."""
        if self.vehicle is not None:
            return None
        whose = (
            phrase("vehicle_called", id=self.id) if self.id is not None else phrase("this_drive")
        )
        return Problem.of("vehicle.no_file", whose=whose, kind=self.kind)


class _MappingFile(NamedTuple):
    """What a mapping file says, to be sent to a worker that may not see the file.

    The DBC files that it names are sent by their whole paths, and are seen by all workers.

    Attributes
    ----------
    said : None where there is no mapping
    digests : of the file and of the DBC files that it names
    path : of the file
    """

    said: Mapping[str, Any] | None = None
    digests: tuple[str, ...] = ("",)
    path: str | None = None


class Vehicles:
    """The vehicle files of a folder, each read once, by the name of the file.

    Parameters
    ----------
    folder : of vehicle files; ``ID.toml`` is that of the vehicle ID
    kind : class of a vehicle without a file; None for a car
    mapping : for all logs; None for the one that each vehicle file names

    Raises
    ------
    ConfigError
        No folder, no such class, or a file that cannot be used.
    """

    def __init__(self, folder: Path, kind: str | None = None, mapping: Path | None = None) -> None:
        if not folder.is_dir():
            raise ConfigError(f"{folder}: no such folder of vehicle files")
        kind = "car" if kind is None else kind
        check_choice("class", kind, VEHICLE_CLASSES)
        self._kind = kind
        self._mapping = mapping
        self.files = tuple(
            f for f in sorted(folder.glob("*.toml")) if f.is_file() and _is_vehicle(f)
        )
        self._mappings: dict[Path, _MappingFile] = {}
        self._known = {path.stem: self._read(path) for path in self.files}
        self._sheets: dict[tuple[str | None, str], Assigned] = {}

    def __len__(self) -> int:
        return len(self._known)

    def of(
        self, paths: tuple[str, ...], given: str | None = None, kind: str | None = None
    ) -> Assigned:
        """Return the vehicle of a recording.

        The id is the one given, else the name of the nearest folder that a vehicle file is named
        after, or the value of a partition such as ``vehicle=17``, else what the file's name begins
        with.

        Parameters
        ----------
        paths : of the recording, paths or URLs
        given : id of the vehicle, from a table of drives
        kind : class, where no file is found

        Raises
        ------
        ConfigError
            No such class.
        """
        if given is not None:
            found = self._known.get(given)
            return found if found is not None else self._sheet(given, kind)
        path = PurePosixPath(paths[0].replace("\\", "/"))
        folders = [p.name for p in path.parents]
        parts = partitions(folders)
        for name in (path.name, path.stem, *folders, *parts.values()):
            if name in self._known:
                return self._known[name]
        for key, value in parts.items():
            if _VEHICLE_KEYS & set(words_of(key)):
                return self._sheet(value, kind)
        for name in (path.name, path.parent.name):
            begun = [i for i in self._known if name.startswith(i) and _BEHIND.match(name, len(i))]
            if begun:
                return self._known[max(begun, key=len)]
        named = (name for name in folders if name and not partitions([name]))
        return self._sheet(path.parent.name and next(named, None), kind)

    def _read(self, path: Path) -> Assigned:
        vehicle = Vehicle.load(path)
        mapping = self._mapping_file(mapping_of(vehicle, path, self._mapping))
        return Assigned(
            id=path.stem,
            file=path.name,
            vehicle=vehicle,
            kind=vehicle.kind,
            mapping=mapping.said,
            digest=text_digest([file_digest(path), *mapping.digests]),
            mapping_file=mapping.path,
        )

    def _mapping_file(self, path: Path | None) -> _MappingFile:
        """Read a mapping once, however many vehicles name it."""
        if path is None:
            return _MappingFile()
        if path not in self._mappings:
            self._mappings[path] = _read_mapping(path)
        return self._mappings[path]

    def _sheet(self, name: str | None, kind: str | None) -> Assigned:
        kind = kind or self._kind
        check_choice("class", kind, VEHICLE_CLASSES)
        if (name, kind) not in self._sheets:
            mapping = self._mapping_file(self._mapping)
            self._sheets[name, kind] = Assigned(
                id=name,
                file=None,
                vehicle=None,
                kind=kind,
                mapping=mapping.said,
                digest=text_digest([kind, *mapping.digests]),
            )
        return self._sheets[name, kind]


def _read_mapping(path: Path) -> _MappingFile:
    """Read a mapping file.

    Raises
    ------
    ConfigError
        It cannot be used.
    """
    import tomllib

    dbc = named_dbcs(load_mapping(path))
    said = tomllib.loads(path.read_text(encoding="utf-8"))
    if dbc:
        said["dbc"] = [with_path(name, dbc_path(name).resolve()) for name in dbc]
    digests = tuple(file_digest(p) for p in (path, *map(dbc_path, dbc)))
    return _MappingFile(said, digests, str(path.resolve()))


def _is_vehicle(path: Path) -> bool:
    """Distinguish a vehicle file from a mapping beside it."""
    import tomllib

    try:
        with path.open("rb") as file:
            return not ({"csv", "time", "signals", "tables"} & set(tomllib.load(file)))
    except (OSError, ValueError):
        return True
