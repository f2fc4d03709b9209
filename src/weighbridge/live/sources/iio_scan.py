"""What a buffer of Linux' industrial I/O holds: scans of elements, each laid out as its type says.

The ABI is the kernel's ``Documentation/ABI/testing/sysfs-bus-iio``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.signals import Ints

TIMESTAMP: Final = "in_timestamp"
"""The element that says when a scan was taken [ns]."""

_TYPE: Final = re.compile(r"(be|le):([su])(\d+)/(\d+)(?:X(\d+))?>>(\d+)")
_SIZES: Final = (8, 16, 32, 64)


@dataclass(frozen=True, slots=True, kw_only=True)
class ElementType:
    """How one element is stored.

    Attributes
    ----------
    big : whether the highest byte comes first
    signed : whether it is in two's complement
    bits : that mean something
    stored : bits that it takes: 8, 16, 32 or 64
    repeat : how many such values it has
    shift : to the right, before the bits are taken
    """

    big: bool
    signed: bool
    bits: int
    stored: int
    repeat: int
    shift: int

    @property
    def size(self) -> int:
        """Bytes that it takes."""
        return self.stored // 8 * self.repeat


def read_type(text: str) -> ElementType:
    """Read a type such as ``le:s12/16>>4``.

    Raises
    ------
    ValueError
        It is none.
    """
    text = text.strip()
    found = _TYPE.fullmatch(text)
    if found is None:
        raise ValueError(f"{text!r:.40} is no type such as le:s16/16>>0")
    bits, stored, shift = int(found[3]), int(found[4]), int(found[6])
    repeat = int(found[5] or 1)
    if stored not in _SIZES or not 0 < bits <= stored - shift or not 0 < repeat <= 64:
        raise ValueError(f"{text!r:.40} is a type that cannot be")
    return ElementType(
        big=found[1] == "be",
        signed=found[2] == "s",
        bits=bits,
        stored=stored,
        repeat=repeat,
        shift=shift,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Element:
    """One element of a scan, such as ``in_accel_x``; ``index`` says its place in the order."""

    name: str
    index: int
    type: ElementType


class Scan:
    """Layout of a scan: the elements by their index, each aligned to its own size.

    Parameters
    ----------
    elements : those that are enabled

    Attributes
    ----------
    size : bytes of a scan, so that every element of the next one is aligned as well
    """

    def __init__(self, elements: Iterable[Element]) -> None:
        self._elements = {e.name: e for e in sorted(elements, key=lambda e: e.index)}
        offsets: list[int] = []
        end, widest = 0, 1
        for element in self._elements.values():
            size = element.type.size
            begin = -(-end // size) * size
            offsets.append(begin)
            end, widest = begin + size, max(widest, size)
        self.size = -(-end // widest) * widest
        self._dtype = np.dtype(
            {
                "names": list(self._elements),
                "formats": [_storage(e.type) for e in self._elements.values()],
                "offsets": offsets,
                "itemsize": self.size,
            }
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Elements in their order."""
        return tuple(self._elements)

    def decode(self, data: bytes) -> dict[str, Ints]:
        """Raw values (n,) by element of n whole scans; elements of several values are left out."""
        rows = np.frombuffer(data, self._dtype)
        return {
            name: _integers(rows[name], e.type)
            for name, e in self._elements.items()
            if e.type.repeat == 1
        }


def _storage(kind: ElementType) -> tuple[str, tuple[int, ...]]:
    shape = (kind.repeat,) if kind.repeat > 1 else ()
    return f"{'>' if kind.big else '<'}u{kind.stored // 8}", shape


def _integers(stored: NDArray[np.unsignedinteger], kind: ElementType) -> Ints:
    """Take the bits that mean something, and their sign."""
    unused = 64 - kind.bits
    raw = (stored.astype(np.uint64) >> np.uint64(kind.shift)) << np.uint64(unused)
    if kind.signed:
        return raw.view(np.int64) >> np.int64(unused)
    return (raw >> np.uint64(unused)).astype(np.int64)
