"""MDF files that are damaged or were cut off, made safe to read with what of them is whole.

asammdf follows links without looking whether they lead in a circle, and its compiled code takes
lengths and places from the file without comparing them with the data: a damaged file could end the
process or fill the memory. So blocks are followed here first. A link that leads nowhere is cleared,
a group of channels without all of its description is given up, and the rest keeps the records of
which every byte is there.
"""

from __future__ import annotations

import functools
import math
import mmap
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

_ID_BLOCK: Final = 64
_HEAD: Final = struct.Struct("<4s4xQQ")
_LINK: Final = struct.Struct("<Q")
_BYTE: Final = struct.Struct("<B")
# Record id, cycles, flags, bytes of a record and of its invalidation bits.
_GROUP: Final = struct.Struct("<QQH6xII")
# Type, bit and byte offset, bits, flags and place of the invalidation bit of a channel.
_CHANNEL: Final = struct.Struct("<B2xBIIII")
# Method of packing, columns, bytes before and after it.
_ZIPPED: Final = struct.Struct("<2xBxIQQ")
# Of MDF 3: next data group, channel group, data, count of groups, bytes of an id; next group,
# channel, bytes of a record, cycles; length, next channel, first bit, bits.
_HEAD_3: Final = struct.Struct("<2s2xI")
_DATA_GROUP_3: Final = struct.Struct("<2s2xII4xIHH")
_CHANNEL_GROUP_3: Final = struct.Struct("<2s2xII8xHI")
_CHANNEL_3: Final = struct.Struct("<2sHI178xHH")
# Bytes before the first bit, in channels of this length.
_MORE_3: Final = (228, struct.Struct("<226xH"))
_DATA: Final = (b"##DT", b"##DV", b"##DI", b"##SD", b"##DZ", b"##RD", b"##RV")
_LISTS: Final = (b"##DL", b"##LD")
_DESCRIPTION: Final = (b"##CN", b"##CC", b"##CA", b"##SI", b"##TX", b"##MD")
# Links that may be cleared without changing what the values mean.
_SPARE: Final[dict[bytes, frozenset[int]]] = {
    b"##CG": frozenset((2, 3, 4, 5)),
    b"##CN": frozenset((3, 7, *range(8, 64))),
    b"##CC": frozenset((0, 2, 3)),
    b"##SI": frozenset((0, 1, 2)),
}
# Types of channels: values of variable length; those without a place in a record.
_VLSD, _VIRTUAL = 1, (3, 6)
_CHANNEL_DATA: Final = 5
_VLSD_GROUP: Final = 0x1
_HAS_INVALIDATION: Final = 0x2
_UNZIPPED_LIMIT: Final = 1 << 28
# Elements of an array that are taken however short the records are: of a group may be none.
_FEW: Final = 4096
# Room that values of variable length may take when all are as long as the longest, as a multiple
# of their data.
_ROOM: Final = 64


class Mended(NamedTuple):
    """A file that is safe to read.

    Attributes
    ----------
    raw : its bytes, with links and counters mended
    kept, told : records that are whole, and those that the file speaks of as far as its groups are
        known
    damaged : whether something had to be mended
    unfinished : whether its logger never got to count its records
    """

    raw: bytes
    kept: int
    told: int
    damaged: bool
    unfinished: bool


class _LostError(Exception):
    """A block is not wholly in the file, or not what it should be."""


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


def mended(path: Path) -> Mended | None:
    """Check an MDF file, and mend a copy of it where it is damaged.

    Returns
    -------
    None where it can be read as it is, and where it is no MDF file. asammdf reads a large file with
    threads that compare nothing, unless it is given as a stream: so a file whose groups have other
    data than they tell of is given back as well.

    Raises
    ------
    ValueError
        It is of MDF 3 and damaged.

    References
    ----------
    ASAM MDF 4.1: the blocks HD, DG, CG, CN, CA, CC, DT, SD, DZ, DL and HL; MDF 3.3: HD, DG, CG, CN.
    """
    if path.stat().st_size <= _ID_BLOCK:
        return None
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as raw:
        if raw[:8] not in (b"MDF     ", b"UnFinMF "):
            return None
        if raw[8:9] != b"4":
            _check_three(raw)
            return None
        file = _File(raw)
        file.follow()
        if not file.damaged and file.exact:
            return None
        return Mended(bytes(file.raw), file.kept, file.told, file.damaged, file.unfinished)


class _File:
    """The bytes of a file, copied where something has to be mended."""

    def __init__(self, raw: mmap.mmap) -> None:
        self.raw: mmap.mmap | bytearray = raw
        self.size = len(raw)
        # The counters and the length of the last block are not final.
        self.unfinished = bool(struct.unpack_from("<H", raw, 60)[0])
        self.kept = self.told = 0
        self.exact = True
        # Whether a chain of blocks ended early.
        self.cut = False
        self.seen: set[int] = set()

    @property
    def damaged(self) -> bool:
        return isinstance(self.raw, bytearray)

    def follow(self) -> None:
        """Follow all blocks from the header on."""
        try:
            header = self.block(_ID_BLOCK, b"##HD")
        except _LostError:
            self.copy()
            return
        for k in range(1, len(header.links)):
            if header.links[k]:
                kind = bytes(self.raw[header.links[k] : header.links[k] + 4])
                for _ in self.chain(header, k, kind):
                    pass
        for group in self.chain(header, 0, b"##DG"):
            if len(group.links) > 3:
                self.spare(group, 3)
                self.data_group(group)

    def copy(self) -> bytearray:
        self.raw = self.raw if isinstance(self.raw, bytearray) else bytearray(self.raw)
        return self.raw

    def block(self, at: int, *kinds: bytes, whole: bool = True) -> _Block:
        """Read the header and the links of a block, and ask for all of it where ``whole``."""
        if not _ID_BLOCK <= at <= self.size - 24:
            raise _LostError
        kind, length, count = _HEAD.unpack_from(self.raw, at)
        end = at + (length if whole else 24 + 8 * count)
        if kind not in kinds or length < 24 or end > self.size:
            raise _LostError
        if count > (length - 24 if whole else self.size) // 8:
            raise _LostError
        return _Block(at, kind, length, struct.unpack_from(f"<{count}Q", self.raw, at + 24))

    def once(self, at: int, *kinds: bytes, whole: bool = True) -> _Block:
        """As `block`, of one that no other link leads to."""
        block = self.block(at, *kinds, whole=whole)
        if at in self.seen:
            raise _LostError
        self.seen.add(at)
        return block

    def unpack(self, block: _Block, form: struct.Struct) -> tuple[Any, ...]:
        if block.body + form.size > min(block.at + block.length, self.size):
            raise _LostError
        return form.unpack_from(self.raw, block.body)

    def link(self, block: _Block, link: int, target: int = 0) -> None:
        """Point a link elsewhere, or at nothing."""
        _LINK.pack_into(self.copy(), block.at + 24 + 8 * link, target)

    def append(self, kind: bytes, content: bytes) -> int:
        """Put a block at the end of the file; return where it stands."""
        raw = self.copy()
        raw += bytes(-len(raw) % 8)
        at = len(raw)
        raw += _HEAD.pack(kind, 24 + len(content), 0) + content
        return at

    def chain(self, owner: _Block, link: int, kind: bytes) -> Iterator[_Block]:
        """Blocks that follow each other; the link to one that is not there is cleared."""
        while at := owner.link(link):
            try:
                block = self.once(at, kind)
            except _LostError:
                self.link(owner, link)
                self.cut = True
                return
            yield block
            owner, link = block, 0

    def spare(self, owner: _Block, link: int) -> None:
        """Clear a link that points at nothing and is not needed."""
        if at := owner.link(link):
            try:
                self.block(at, bytes(self.raw[at : at + 4]))
            except _LostError:
                self.link(owner, link)

    def data_group(self, group: _Block) -> None:
        """Keep what is whole of the channel groups of one data group."""
        (id_size,) = _BYTE.unpack_from(self.raw, group.body)
        self.cut = False
        waiting = list(self.chain(group, 1, b"##CG"))
        if self.cut and id_size:
            # Records of unknown size cannot be told apart.
            self.link(group, 1)
            self.link(group, 2)
            return
        parts, whole = self.pieces(group.link(2))
        if self.unfinished:
            if not whole:
                self.link(group, 2)
            whole = True
        held = sum(self.plain(part)[0] for part in parts)
        sizes, variable = {}, {}
        for cg in waiting:
            number, cycles, flags, samples, invalid = self.unpack(cg, _GROUP)
            try:
                room = max(8 * min(samples, held), _FEW)
                variable[cg.at] = self.described(cg, samples, invalid, room)
            except _LostError:
                self.told += 0 if flags & _VLSD_GROUP else cycles
                self.link(cg, 1)
                _LINK.pack_into(self.copy(), cg.body + 8, 0)
            sizes[number] = (cg, -1 if flags & _VLSD_GROUP else samples + invalid, cycles)
        if self.unfinished:
            return
        if len(waiting) == 1 and waiting[0].at in variable:
            self.sorted(group, waiting[0], parts, whole, variable[waiting[0].at])
        elif len(waiting) > 1 and not whole:
            self.unsorted(group, id_size, parts, sizes)

    def described(self, cg: _Block, samples: int, invalid: int, room: int) -> list[_Block]:
        """Check that all channels of a group are described; return those of variable length.

        Each element of an array becomes a channel; there may not be more than ``room``.
        """
        variable = []
        waiting = [(cg, k, 1) for k in range(1, len(cg.links))]
        while waiting:
            owner, k, count = waiting.pop()
            if not owner.links[k]:
                continue
            if k in _SPARE.get(owner.kind, ()):
                self.spare(owner, k)
                continue
            if owner.kind == b"##CN" and k == _CHANNEL_DATA:
                # Values of variable length may also be records of a group in the same data.
                if self.unpack(owner, _BYTE)[0] == _VLSD:
                    variable.append(owner)
                continue
            block = self.block(owner.links[k], *_DESCRIPTION)
            if block.at in self.seen:
                if block.kind in (b"##CN", b"##CA"):
                    raise _LostError
                continue
            self.seen.add(block.at)
            if block.kind == b"##CA":
                (dimensions,) = self.unpack(block, struct.Struct("<2xH"))
                count *= math.prod(self.unpack(block, struct.Struct(f"<16x{dimensions}Q")))
                if count > room:
                    raise _LostError
            elif block.kind == b"##CN":
                kind, bit, byte, bits, flags, invalidation = self.unpack(block, _CHANNEL)
                inside = kind in _VIRTUAL or byte + (bit + bits + 7) // 8 <= samples
                if not inside or (flags & _HAS_INVALIDATION and invalidation >= 8 * invalid):
                    raise _LostError
            waiting += [(block, j, count) for j in range(len(block.links))]
        return variable

    def pieces(self, at: int) -> tuple[list[_Block], bool]:
        """Data blocks that hang on a link, up to the first that is not there; whether all are."""
        found: list[_Block] = []
        if not at:
            return found, True
        try:
            block = self.once(at, *_DATA, *_LISTS, b"##HL", whole=False)
            if block.kind in _DATA:
                found.append(block)
            elif block.kind == b"##HL" and block.link(0):
                block = self.once(block.link(0), *_LISTS)
            while block.kind in _LISTS:
                block = self.block(block.at, *_LISTS)
                for target in block.links[1:]:
                    if target:
                        found.append(self.once(target, *_DATA, whole=False))
                if not block.link(0):
                    break
                block = self.once(block.link(0), *_LISTS)
        except _LostError:
            return found, False
        return found, all(b.at + b.length <= self.size and self.plain(b)[2] for b in found)

    def plain(self, block: _Block) -> tuple[int, bool, bool]:
        """Bytes of one data block when unpacked, whether zlib unpacks it, and whether it may be."""
        if block.kind != b"##DZ":
            return block.length - 24, True, True
        if block.body + _ZIPPED.size > self.size:
            return 0, True, False
        method, columns, size, packed = _ZIPPED.unpack_from(self.raw, block.body)
        sound = block.body + _ZIPPED.size + packed <= block.at + block.length
        return size, method < 2, sound and (method % 2 == 0 or 0 < columns <= size)

    def content(self, parts: list[_Block]) -> bytes:
        """Data of blocks, up to the first byte that is missing."""
        found = []
        for block in parts:
            size, known, _ = self.plain(block)
            data = bytes(self.raw[block.body : min(block.at + block.length, self.size)])
            if block.kind == b"##DZ":
                head, packed = data[: _ZIPPED.size], data[_ZIPPED.size :]
                try:
                    method, columns, _, _ = _ZIPPED.unpack(head)
                    limit = min(size, _UNZIPPED_LIMIT) or 1
                    data = zlib.decompressobj().decompress(packed, limit) if known else b""
                except (zlib.error, struct.error):
                    break
                if method % 2 and columns:
                    if len(data) < size:
                        break
                    lines = size // columns
                    table = np.frombuffer(data[: lines * columns], np.uint8)
                    rest = data[lines * columns :]
                    data = table.reshape(columns, lines).T.tobytes() + rest
            found.append(data)
            if len(data) < size:
                break
        return b"".join(found)

    def sorted(
        self, group: _Block, cg: _Block, parts: list[_Block], whole: bool, variable: list[_Block]
    ) -> None:
        """Keep the whole records of a data group that has one channel group."""
        (id_size,) = _BYTE.unpack_from(self.raw, group.body)
        _, cycles, _, samples, invalid = self.unpack(cg, _GROUP)
        size = id_size + samples + invalid
        self.told += cycles
        strings = [(cn, *self.pieces(cn.links[_CHANNEL_DATA])) for cn in variable]
        told = [self.plain(part) for part in parts]
        held = sum(n for n, *_ in told)
        if (whole and all(w for *_, w in strings) and held >= cycles * size) or size == 0:
            self.kept += cycles
            self.exact &= held == cycles * size and all(known for _, known, _ in told)
            return
        content = self.content(parts)
        kept = min(cycles, len(content) // size)
        rows = np.frombuffer(content, np.uint8, kept * size).reshape(kept, size)
        for cn, those, sound in strings:
            if not sound:
                values = self.content(those)
                _, _, byte, bits, *_ = self.unpack(cn, _CHANNEL)
                at = _places(rows[:, id_size + byte :][:, : (bits + 7) // 8])
                good = _inside(np.frombuffer(values, np.uint8), at)[0]
                kept = min(kept, int(np.argmin(good)) if not good.all() else at.size)
                self.link(cn, _CHANNEL_DATA, self.append(b"##SD", values))
        self.link(group, 2, self.append(b"##DT", content[: kept * size]))
        _LINK.pack_into(self.copy(), cg.body + 8, kept)
        self.kept += kept

    def unsorted(
        self,
        group: _Block,
        id_size: int,
        parts: list[_Block],
        sizes: dict[int, tuple[_Block, int, int]],
    ) -> None:
        """Keep the whole records of a data group whose channel groups are mixed."""
        content = self.content(parts)
        counts = dict.fromkeys(sizes, 0)
        at = end = 0
        while at + id_size <= len(content):
            number = int.from_bytes(content[at : at + id_size], "little")
            _, size, _ = sizes.get(number, (None, None, 0))
            at += id_size
            if size == -1:
                size = 4 + int.from_bytes(content[at : at + 4], "little")
            if size is None or at + size > len(content):
                break
            at = end = at + size
            counts[number] += 1
        self.link(group, 2, self.append(b"##DT", content[:end]))
        for number, (cg, size, cycles) in sizes.items():
            _LINK.pack_into(self.copy(), cg.body + 8, counts[number])
            self.told += 0 if size == -1 else cycles
            self.kept += 0 if size == -1 else counts[number]


def _places(columns: np.ndarray[Any, np.dtype[np.uint8]]) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Numbers of up to 7 bytes, the lowest first."""
    found = np.zeros(len(columns), np.int64)
    for k in range(min(columns.shape[1], 7)):
        found |= columns[:, k].astype(np.int64) << (8 * k)
    return found


def _inside(
    data: np.ndarray[Any, np.dtype[np.uint8]], at: np.ndarray[Any, np.dtype[np.int64]]
) -> tuple[np.ndarray[Any, np.dtype[np.bool_]], int]:
    """Which values of variable length stand within their data, and the length of the longest."""
    good = (at >= 0) & (at <= data.size - 4)
    place = np.where(good, at, 0)
    length = _places(data[place[:, None] + np.arange(4)]) if good.any() else np.zeros_like(at)
    return good & (at + 4 + length <= data.size), int(length.max(initial=0))


def _check_three(raw: mmap.mmap) -> None:
    """Check MDF 3, whose blocks have links of 4 bytes and tell the place of their data."""
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

    (group,) = fields(_ID_BLOCK, b"HD", _HEAD_3)
    while group:
        group, channel_group, data, count, id_size = fields(group, b"DG", _DATA_GROUP_3)
        told = 0
        for _ in range(count):
            channel_group, channel, size, cycles = fields(channel_group, b"CG", _CHANNEL_GROUP_3)
            # Records of no size cost nothing in a file, yet a stamp each when read.
            told += cycles * (id_size + size or 1)
            while channel:
                at = channel
                length, channel, first, bits = fields(at, b"CN", _CHANNEL_3)
                if length >= _MORE_3[0] and at + length <= len(raw):
                    first += 8 * _MORE_3[1].unpack_from(raw, at)[0]
                if first + bits > 8 * size:
                    raise ValueError(f"a channel stands outside records of {size} bytes")
        if told and data + told > len(raw):
            raise ValueError(f"{told} bytes of data from byte {data} on are more than there are")


def guard() -> None:
    """Check places of values of variable length before asammdf's compiled functions take them.

    Results stay the same; where bytes outside the data would be read, ValueError is raised.
    """
    from asammdf.blocks import mdf_v3, mdf_v4

    for module in (mdf_v3, mdf_v4):
        for name, place in (("extract", 2), ("get_vlsd_max_sample_size", 1)):
            function = getattr(module, name, None)
            if function is not None and not hasattr(function, "__wrapped__"):
                setattr(module, name, _checked(function, place))


def _checked(function: Callable[..., Any], place: int) -> Callable[..., Any]:
    @functools.wraps(function)
    def checked(data: bytes, *args: Any) -> Any:
        offsets = args[place - 1]
        at = np.asarray(offsets if place == 2 else offsets[: args[1]])
        if offsets is None or at.ndim != 1 or (at.size and at.dtype.kind not in "iu"):
            raise ValueError("values of variable length have no places")
        good, longest = _inside(np.frombuffer(data, np.uint8), at.astype(np.int64))
        if not good.all():
            raise ValueError("a value of variable length stands outside its data")
        if longest * at.size > _ROOM * max(len(data), 1 << 20):
            raise ValueError(f"a value of variable length claims {longest} bytes")
        return function(data, *args)

    return checked
