"""What an MDF file must hold before asammdf may see it.

asammdf follows links without looking whether they lead in a circle, and its compiled code takes
lengths and places from the file without comparing them with the data: a damaged file could end
the process or fill the memory. Links are checked here before the file is opened, and `guard` puts
a check of the arguments before each compiled function that reads samples.
"""

from __future__ import annotations

import functools
import math
import mmap
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from weighbridge.io.mdf_blocks import HEAD, ID_BLOCK, VLSD_CHANNEL, ZIPPED

# Cycles, bytes of a record and of its invalidation bits.
_GROUP: Final = struct.Struct("<8xQ8xII")
# Of MDF 3: the first data group; next, channel group, data, count of groups, bytes of an id; next,
# channel, bytes of a record, cycles; next.
_HEAD_3: Final = struct.Struct("<2s2xI")
_DATA_GROUP_3: Final = struct.Struct("<2s2xII4xIHH")
_CHANNEL_GROUP_3: Final = struct.Struct("<2s2xII8xHI")
_CHANNEL_3: Final = struct.Struct("<2s2xI")
# Dimensions of an array.
_ARRAY: Final = struct.Struct("<2xH")
# So many elements are taken however short the records are: of a group may be none.
_FEW: Final = 4096
_BYTE: Final = struct.Struct("<B")
# Room that values of variable length may take when all are as long as the longest, as a multiple
# of their data.
_ROOM: Final = 64
_DATA: Final = (b"##DT", b"##DV", b"##SD", b"##DZ", b"##RD", b"##RV", b"##DI")
_LISTS: Final = (b"##DL", b"##LD")
# Methods of packing that zlib undoes: as it is, and transposed.
_ZLIB: Final = (0, 1)
# Links of HD: file history, attachments, events.
_CHAINS: Final = ((1, b"##FH"), (3, b"##AT"), (4, b"##EV"))


class _Block(NamedTuple):
    at: int
    kind: bytes
    length: int
    links: tuple[int, ...]

    @property
    def body(self) -> int:
        return self.at + 24 + 8 * len(self.links)

    def link(self, number: int) -> int:
        """Where a link leads; 0 where the block has no such link."""
        return self.links[number] if number < len(self.links) else 0


class _Links:
    """Blocks of a file, each of which may be reached once.

    Of an unfinished file the lengths of the data are not final.
    """

    def __init__(self, raw: bytes | mmap.mmap, finished: bool) -> None:
        self.raw = raw
        self.size = len(raw)
        self.finished = finished
        self.seen: set[int] = set()

    def block(self, at: int, kinds: tuple[bytes, ...]) -> _Block:
        if at < ID_BLOCK or at + 24 > self.size:
            raise ValueError(f"a link leads to byte {at} of {self.size}")
        kind, length, count = HEAD.unpack_from(self.raw, at)
        if kind not in kinds:
            raise ValueError(f"there is no {kinds[0].decode()[2:]} block at byte {at}")
        end = at + (length if self.finished or kind not in _DATA else 24 + 8 * count)
        if length < 24 or count > (length - 24) // 8 or end > self.size:
            raise ValueError(f"the length of the block at byte {at} is wrong")
        if at in self.seen:
            raise ValueError(f"two links lead to the block at byte {at}")
        self.seen.add(at)
        return _Block(at, kind, length, struct.unpack_from(f"<{count}Q", self.raw, at + 24))

    def unpack(self, block: _Block, form: struct.Struct) -> tuple[Any, ...]:
        if block.body + form.size > block.at + block.length:
            raise ValueError(f"the block at byte {block.at} is too short")
        return form.unpack_from(self.raw, block.body)

    def chain(self, at: int, kinds: tuple[bytes, ...]) -> Iterator[_Block]:
        while at:
            block = self.block(at, kinds)
            yield block
            at = block.link(0)

    def channels(self, first: int, room: int) -> None:
        """Follow the channels of a group and those they are made of.

        Each element of an array becomes a channel; there may not be more than ``room``.
        """
        waiting = [(first, 1)] if first else []
        while waiting:
            at, count = waiting.pop()
            block = self.block(at, (b"##CN", b"##CA"))
            if block.kind == b"##CA":
                count *= self.elements(block)
                if count > room:
                    raise ValueError(f"the array at byte {at} does not fit in a record")
                waiting += [(block.link(0), count)] if block.link(0) else []
                continue
            waiting += [(block.link(0), count)] if block.link(0) else []
            waiting += [(block.link(1), count)] if block.link(1) else []
            (kind,) = self.unpack(block, _BYTE)
            at = block.link(5)
            # Values of variable length may also be records of a group in the same data.
            if kind == VLSD_CHANNEL and at and self.raw[at : at + 4] != b"##CG":
                self.data(at)

    def elements(self, array: _Block) -> int:
        """Elements of an array."""
        (dimensions,) = self.unpack(array, _ARRAY)
        sizes = struct.Struct(f"<16x{dimensions}Q")
        return math.prod(self.unpack(array, sizes))

    def data(self, at: int) -> tuple[int, bool]:
        """Bytes of the data that hang on a link when unpacked, and whether zlib can unpack them."""
        if not at:
            return 0, True
        block = self.block(at, (*_DATA, *_LISTS, b"##HL"))
        if block.kind == b"##HL":
            if not block.link(0):
                return 0, True
            block = self.block(block.link(0), _LISTS)
        if block.kind in _DATA:
            return self.content(block)
        total, plain = 0, True
        for part in (block, *self.chain(block.link(0), _LISTS)):
            for target in part.links[1:]:
                if target:
                    size, known = self.content(self.block(target, _DATA))
                    total, plain = total + size, plain and known
        return total, plain

    def content(self, block: _Block) -> tuple[int, bool]:
        """As `data`, of one block."""
        if block.kind != b"##DZ":
            return block.length - 24, True
        _, method, columns, size, packed = self.unpack(block, ZIPPED)
        if self.finished and block.body + ZIPPED.size + packed > block.at + block.length:
            raise ValueError(f"the length of the packed data at byte {block.at} is wrong")
        if method % 2 and not 0 < columns <= size:
            raise ValueError(f"the packed data at byte {block.at} have rows of {columns} bytes")
        return int(size), method in _ZLIB


def check_links(source: Path | bytes) -> bool:
    """Check that the blocks of an MDF file can be followed.

    Parameters
    ----------
    source : the file, or its bytes

    Returns
    -------
    Whether every group has just the data that it tells of. asammdf reads a large file with threads
    that compare nothing, unless it is given as a stream; so another one must be.

    Raises
    ------
    ValueError
        A link leads out of the file, to a wrong block or in a circle, or a length is wrong.

    References
    ----------
    ASAM MDF 4.1: the blocks HD, FH, AT, EV, DG, CG, CN, CA, DT, SD, DZ, DL and HL; MDF 3.3: HD,
    DG, CG and CN.
    """
    if isinstance(source, bytes):
        return _check(source)
    if source.stat().st_size <= ID_BLOCK:
        return True
    with (
        source.open("rb") as stream,
        mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as raw,
    ):
        return _check(raw)


def _check(raw: bytes | mmap.mmap) -> bool:
    if raw[:8] not in (b"MDF     ", b"UnFinMF "):
        return True
    if raw[8:9] != b"4":
        _check_three(raw)
        return True
    file = _Links(raw, finished=not struct.unpack_from("<H", raw, 60)[0])
    header = file.block(ID_BLOCK, (b"##HD",))
    for number, kind in _CHAINS:
        for _ in file.chain(header.link(number), (kind,)):
            pass
    exact = True
    for group in file.chain(header.link(0), (b"##DG",)):
        (id_size,) = file.unpack(group, _BYTE)
        told = 0
        found, plain = file.data(group.link(2))
        for channel_group in file.chain(group.link(1), (b"##CG",)):
            cycles, size, invalid = file.unpack(channel_group, _GROUP)
            told += cycles * (size + invalid)
            file.channels(channel_group.link(1), max(8 * min(size, found), _FEW))
        # Records of several groups are sorted, and counted anew.
        exact = exact and (bool(id_size) or (told == found and plain))
    return exact


def _check_three(raw: bytes | mmap.mmap) -> None:
    """`_check` of MDF 3, whose blocks have links of 4 bytes and tell the place of their data."""
    seen: set[int] = set()

    def fields(at: int, kind: bytes, form: struct.Struct) -> tuple[Any, ...]:
        if at + form.size > len(raw):
            raise ValueError(f"a link leads to byte {at} of {len(raw)}")
        name, *values = form.unpack_from(raw, at)
        if name != kind:
            raise ValueError(f"there is no {kind.decode()} block at byte {at}")
        if at in seen:
            raise ValueError(f"two links lead to the block at byte {at}")
        seen.add(at)
        return tuple(values)

    (group,) = fields(ID_BLOCK, b"HD", _HEAD_3)
    while group:
        group, channel_group, data, count, id_size = fields(group, b"DG", _DATA_GROUP_3)
        told = 0
        for _ in range(count):
            channel_group, channel, size, cycles = fields(channel_group, b"CG", _CHANNEL_GROUP_3)
            # Records of no size cost nothing in a file, yet a stamp each when read.
            told += cycles * (id_size + size or 1)
            while channel:
                (channel,) = fields(channel, b"CN", _CHANNEL_3)
        if told and data + told > len(raw):
            raise ValueError(f"{told} bytes of data from byte {data} on are more than there are")


def settle(group: Any) -> int:
    """Let a group of an open file have no more records than its data can hold; return how many.

    asammdf takes memory for as many as the group tells of.
    """
    told = group.channel_group
    size = int(told.samples_byte_nr)
    # Lists of columns hold the invalidation bits apart; MDF 3 has none.
    if not getattr(group, "uses_ld", False):
        size += int(getattr(told, "invalidation_bytes_nr", 0))
    if size and told.cycles_nr:
        held = sum(int(b.original_size) for b in group.get_data_blocks())
        told.cycles_nr = min(int(told.cycles_nr), held // size)
    return int(told.cycles_nr)


def guard() -> None:
    """Put a check of its arguments before each compiled function of asammdf that reads samples.

    Results stay the same; where bytes outside the data would be read, ValueError is raised.
    """
    from asammdf.blocks import mdf_v3, mdf_v4

    for module in (mdf_v3, mdf_v4):
        for name, check in _CHECKS.items():
            function = getattr(module, name, None)
            if function is not None and not hasattr(function, "__wrapped__"):
                setattr(module, name, _checked(function, check))


def _checked(function: Callable[..., Any], check: Callable[..., None]) -> Callable[..., Any]:
    @functools.wraps(function)
    def checked(*args: Any) -> Any:
        check(*args)
        return function(*args)

    return checked


def _check_bytes(data: bytes, record: int, place: int, count: int) -> None:
    if record and not 0 <= place <= place + count <= record:
        raise ValueError(f"bytes {place} to {place + count} stand outside records of {record}")


def _check_invalidation(_: bytes, size: int, place: int, *__: Any) -> None:
    if size > 0 and not 0 <= place < 8 * size:
        raise ValueError(f"invalidation bit {place} stands outside {size} bytes")


def _check_variable(data: bytes, offsets: Any) -> None:
    """Refuse places of values of variable length outside their data."""
    at = np.asarray(offsets)
    if at.size == 0:
        return
    if at.ndim != 1 or at.dtype.kind not in "iu":
        raise ValueError("places of values of variable length are no numbers")
    if int(at.min()) < 0 or int(at.max()) + 4 > len(data):
        raise ValueError("a value of variable length stands outside its data")
    raw = np.frombuffer(data, np.uint8)
    place = at.astype(np.int64)
    length = np.zeros(place.size, np.int64)
    for k in range(4):
        length |= raw[place + k].astype(np.int64) << (8 * k)
    if (place + 4 + length > len(data)).any():
        raise ValueError("a value of variable length stands outside its data")
    if int(length.max()) * length.size > _ROOM * max(len(data), 1 << 20):
        raise ValueError(f"a value of variable length claims {int(length.max())} bytes")


def _check_extract(data: bytes, _: bool, offsets: Any) -> None:
    if offsets is None:
        raise ValueError("values of variable length have no places")
    _check_variable(data, offsets)


def _check_longest(data: bytes, offsets: Any, count: int) -> None:
    _check_variable(data, offsets[:count])


_CHECKS: Final[dict[str, Callable[..., None]]] = {
    "get_channel_raw_bytes": _check_bytes,
    "get_invalidation_bits_array": _check_invalidation,
    "extract": _check_extract,
    "get_vlsd_max_sample_size": _check_longest,
}
