"""Tables of named records, to which installed packages can add their own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, Protocol, TypeVar

from weighbridge.arguments import either
from weighbridge.errors import ConfigError


class Named(Protocol):
    """A record that knows the name it is found by."""

    @property
    def name(self) -> str:
        """Name in tables, files and options."""
        ...


Record = TypeVar("Record", bound=Named)


class Registry(Mapping[str, Record], Generic[Record]):
    """Records by their name: those of the program first, then those of other packages.

    Other packages are asked when a name is not the program's own, or when all names are asked
    for, and not before.

    Parameters
    ----------
    kind : class of the records
    group : entry points that name further records
    records : those of the program, in the order to show them
    """

    def __init__(self, kind: type[Record], group: str, records: tuple[Record, ...]) -> None:
        self._kind = kind
        self._group = group
        self._own = {record.name: record for record in records}
        self._all: dict[str, Record] | None = None

    @property
    def own(self) -> tuple[str, ...]:
        """Names of the program's own records, in order."""
        return tuple(self._own)

    @property
    def names(self) -> str:
        """All names in words: ``a, b or c``."""
        return either(self)

    def __getitem__(self, name: str) -> Record:
        own = self._own.get(name)
        return own if own is not None else self._known()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._known())

    def __len__(self) -> int:
        return len(self._known())

    def _known(self) -> dict[str, Record]:
        if self._all is None:
            found = dict(self._own)
            for point in entry_points(group=self._group):
                record = self._loaded(point)
                if found.setdefault(record.name, record) != record:
                    raise self._refusal(point, "there is one of that name; give it another")
            self._all = found
        return self._all

    def _loaded(self, point: EntryPoint) -> Record:
        """Load what an entry point names.

        Raises
        ------
        ConfigError
            It cannot be imported, or is no such record.
        """
        try:
            record = point.load()
        except Exception as error:  # what another package does wrong can be anything
            raise self._refusal(point, f"{error}; repair or remove that package") from error
        if not isinstance(record, self._kind):
            raise self._refusal(point, f"it is no {self._kind.__name__}, but {type(record)}")
        if record.name != point.name:
            raise self._refusal(point, f"its name is {record.name!r}; give both the same name")
        return record

    def _refusal(self, point: EntryPoint, why: str) -> ConfigError:
        package = point.dist.name if point.dist is not None else "an installed package"
        return ConfigError(
            f"entry point {point.name!r} of {package} in group {self._group} cannot be used: {why}"
        )
