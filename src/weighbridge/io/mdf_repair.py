"""MDF files that are damaged or were cut off, made safe to read with what of them is whole.

asammdf follows links without looking whether they lead in a circle, and its compiled code takes
lengths and places from the file without comparing them with the data: a damaged file could end the
process or fill the memory. So blocks are followed here first. A link that leads nowhere is cleared,
a group of channels without all of its description is given up, and the rest keeps the records of
which every byte is there.
"""

from __future__ import annotations

import contextlib
import functools
import io
import math
import mmap
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from weighbridge.io.frames import bits

_ID_BLOCK: Final = 64
_HEAD: Final = struct.Struct("<4s4xQQ")
_LINK: Final = struct.Struct("<Q")
_BYTE: Final = struct.Struct("<B")
# Cycles, flags, bytes of a record and of its invalidation bits.
_GROUP: Final = struct.Struct("<8xQH6xII")
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
# A file that says that its counters, and the bytes of its values of variable length, are not final.
_UNCOUNTED: Final = 0x1 | 0x20
# Elements of an array that are taken however short the records are: of a group may be none.
_FEW: Final = 4096
# Room that values of variable length may take when all are as long as the longest, as a multiple
# of their data.
_ROOM: Final = 64


class Repaired(NamedTuple):
    """A file that is safe to read.

    Attributes
    ----------
    raw : its bytes, with links corrected
    reported : records that it speaks of, as far as its groups are known
    damaged : whether something had to be corrected
    unfinished : whether its logger never got to count its records
    """

    raw: bytes
    reported: int
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


def corrected(path: Path) -> Repaired | None:
    """Check an MDF file, and correct a copy of it where it is damaged.

    Returns
    -------
    None where it can be read as it is, and where it is no MDF file. asammdf reads a large file with
    threads that compare nothing, unless it is given as a stream: so a file whose groups have other
    data than they report is given back as well.

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
        damaged = isinstance(file.raw, bytearray)
        if not damaged and file.exact:
            return None
        return Repaired(bytes(file.raw), file.reported, damaged, bool(file.flags))


class _File:
    """The bytes of a file, copied where something has to be corrected."""

    def __init__(self, raw: mmap.mmap) -> None:
        self.raw: mmap.mmap | bytearray = raw
        self.size = len(raw)
        (self.flags,) = struct.unpack_from("<H", raw, 60)
        self.reported = 0
        self.exact = True
        # Whether a chain of blocks ended early.
        self.cut = False
        self.seen: set[int] = set()

    def follow(self) -> None:
        """Follow all blocks from the header on."""
        with contextlib.suppress(_LostError):
            header = self.block(_ID_BLOCK, b"##HD")
            for k in range(1, len(header.links)):
                kind = bytes(self.raw[header.links[k] : header.links[k] + 4])
                for _ in self.chain(header, k, kind):
                    pass
            for group in self.chain(header, 0, b"##DG"):
                if len(group.links) > 3:
                    self.spare(group, 3)
                    self.data_group(group)
            if isinstance(self.raw, bytearray):
                # asammdf counts the records that are left.
                self.raw[:8] = b"UnFinMF "
                struct.pack_into("<H", self.raw, 60, self.flags | _UNCOUNTED)
            return
        self.copy()

    def copy(self) -> bytearray:
        self.raw = self.raw if isinstance(self.raw, bytearray) else bytearray(self.raw)
        return self.raw

    def block(self, at: int, *kinds: bytes, whole: bool = True, anew: bool = True) -> _Block:
        """Read the header and the links of a block.

        Parameters
        ----------
        at, kinds : where it stands, and what it may be
        whole : whether all of it must be there
        anew : whether no other link may lead to it
        """
        if not _ID_BLOCK <= at <= self.size - 24 or (anew and at in self.seen):
            raise _LostError
        kind, length, count = _HEAD.unpack_from(self.raw, at)
        end = at + (length if whole else 24 + 8 * count)
        if kind not in kinds or length < 24 + 8 * count or end > self.size:
            raise _LostError
        self.seen.add(at)
        return _Block(at, kind, length, struct.unpack_from(f"<{count}Q", self.raw, at + 24))

    def unpack(self, block: _Block, form: struct.Struct) -> tuple[Any, ...]:
        if block.body + form.size > min(block.at + block.length, self.size):
            raise _LostError
        return form.unpack_from(self.raw, block.body)

    def link(self, block: _Block, link: int, content: bytes = b"", kind: bytes = b"##DT") -> None:
        """Let a link lead to a new block at the end of the file; to nothing without a content."""
        raw = self.copy()
        raw += bytes(-len(raw) % 8)
        _LINK.pack_into(raw, block.at + 24 + 8 * link, len(raw) if content else 0)
        raw += _HEAD.pack(kind, 24 + len(content), 0) + content if content else b""

    def chain(self, owner: _Block, link: int, kind: bytes) -> Iterator[_Block]:
        """Blocks that follow each other; the link to one that is not there is cleared."""
        while at := owner.link(link):
            try:
                block = self.block(at, kind)
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
                self.block(at, bytes(self.raw[at : at + 4]), anew=False)
            except _LostError:
                self.link(owner, link)

    def data_group(self, group: _Block) -> None:
        """Keep what is whole of the channel groups of one data group."""
        (id_size,) = _BYTE.unpack_from(self.raw, group.body)
        self.cut = False
        channel_groups = list(self.chain(group, 1, b"##CG"))
        parts, whole = self.pieces(group.link(2))
        if (self.cut and id_size) or (self.flags and not whole):
            # Records of unknown size cannot be distinguished.
            self.link(group, 1)
            self.link(group, 2)
            return
        held = sum(self.plain(part)[0] for part in parts)
        reported = size = 0
        strings: list[tuple[_Block, list[_Block], bool]] = []
        for cg in channel_groups:
            cycles, flags, samples, invalid = self.unpack(cg, _GROUP)
            size = id_size + samples + invalid
            reported += 0 if flags & _VLSD_GROUP else cycles * size
            self.reported += 0 if flags & _VLSD_GROUP else cycles
            try:
                strings += self.described(cg, samples, invalid, max(8 * min(samples, held), _FEW))
            except _LostError:
                self.link(cg, 1)
        if self.flags:
            return
        if whole and all(sound for *_, sound in strings):
            if held < reported:
                self.copy()
            self.exact &= bool(id_size) or (
                held == reported and all(self.plain(part)[1] for part in parts)
            )
            return
        content = self.content(parts)
        if len(channel_groups) == 1 and size:
            kept = len(content) // size
            rows = np.frombuffer(content, np.uint8, kept * size).reshape(kept, size)
            for cn, those, _ in strings:
                values = self.content(those)
                _, _, byte, bits, *_ = self.unpack(cn, _CHANNEL)
                at = _places(rows[:, id_size + byte :][:, : (bits + 7) // 8])
                good = _inside(np.frombuffer(values, np.uint8), at)[0]
                kept = min(kept, int(np.argmin(good)) if not good.all() else at.size)
                self.link(cn, _CHANNEL_DATA, values, b"##SD")
            content = content[: kept * size]
        self.link(group, 2, content)

    def described(
        self, cg: _Block, samples: int, invalid: int, room: int
    ) -> list[tuple[_Block, list[_Block], bool]]:
        """Check that all channels of a group are described; return those of variable length.

        Each element of an array becomes a channel; there may not be more than ``room``.
        """
        variable = []
        waiting = [(cg, k, 1) for k in range(1, len(cg.links))]
        while waiting:
            owner, k, count = waiting.pop()
            at = owner.links[k]
            if k in _SPARE.get(owner.kind, ()):
                self.spare(owner, k)
                continue
            if owner.kind == b"##CN" and k == _CHANNEL_DATA:
                # Values of variable length may also be records of a group in the same data.
                grouped = self.raw[at : at + 4] == b"##CG"
                if at and self.unpack(owner, _BYTE)[0] == _VLSD and not grouped:
                    variable.append((owner, *self.pieces(at)))
                continue
            if not at or (at in self.seen and self.raw[at : at + 4] not in (b"##CN", b"##CA")):
                continue
            block = self.block(at, *_DESCRIPTION)
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
        try:
            while at:
                block = self.block(at, *_DATA, *_LISTS, b"##HL", whole=False)
                if block.kind in _DATA:
                    found.append(block)
                    break
                self.block(at, block.kind, anew=False)
                for target in block.links[1:] if block.kind in _LISTS else ():
                    if target:
                        found.append(self.block(target, *_DATA, whole=False))
                at = block.link(0)
        except _LostError:
            return found, False
        ends = (b.at + (b.length if not self.flags else 24) for b in found)
        return found, max(ends, default=0) <= self.size and all(self.plain(b)[2] for b in found)

    def plain(self, block: _Block) -> tuple[int, bool, bool]:
        """Bytes of one data block when unpacked, whether zlib unpacks it, and whether it may be."""
        if block.kind != b"##DZ":
            return block.length - 24, True, True
        try:
            method, columns, size, packed = self.unpack(block, _ZIPPED)
        except _LostError:
            return 0, True, False
        sound = block.body + _ZIPPED.size + packed <= block.at + block.length
        return size, method < 2, sound and (method % 2 == 0 or 0 < columns <= size)

    def content(self, parts: list[_Block]) -> bytes:
        """Data of blocks, up to the first byte that is missing."""
        from asammdf.blocks.v4_blocks import DataZippedBlock

        found = []
        for block in parts:
            size, _, sound = self.plain(block)
            raw = bytes(self.raw[block.at : block.at + block.length])
            data = raw[block.body - block.at :]
            if block.kind == b"##DZ":
                try:
                    packed = DataZippedBlock(
                        address=0, stream=io.BytesIO(raw), file_limit=len(raw), mapped=False
                    )
                    data = bytes(packed.data) if sound else b""
                # The library's errors on damaged data are of many kinds.
                except Exception:
                    break
            found.append(data)
            if len(data) != size:
                break
        return b"".join(found)


def _places(columns: np.ndarray[Any, np.dtype[np.uint8]]) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Numbers of up to 7 bytes, the lowest first."""
    return bits(columns, 0, 8 * min(columns.shape[1], 7)).astype(np.int64)


def _inside(
    data: np.ndarray[Any, np.dtype[np.uint8]], at: np.ndarray[Any, np.dtype[np.int64]]
) -> tuple[np.ndarray[Any, np.dtype[np.bool_]], int]:
    """Which values of variable length stand within their data, and the length of the longest."""
    good = (at >= 0) & (at <= data.size - 4)
    place = np.where(good, at, 0)
    length = _places(data[place[:, None] + np.arange(4)]) if good.any() else np.zeros_like(at)
    return good & (at + 4 + length <= data.size), int(length.max(initial=0))


def _check_three(raw: mmap.mmap) -> None:
    """Check MDF 3, whose blocks have links of 4 bytes and show the place of their data."""
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
        reported = 0
        for _ in range(count):
            channel_group, channel, size, cycles = fields(channel_group, b"CG", _CHANNEL_GROUP_3)
            # Records of no size cost nothing in a file, yet a stamp each when read.
            reported += cycles * (id_size + size or 1)
            while channel:
                at = channel
                length, channel, first, bits = fields(at, b"CN", _CHANNEL_3)
                if length >= _MORE_3[0] and at + length <= len(raw):
                    first += 8 * _MORE_3[1].unpack_from(raw, at)[0]
                if first + bits > 8 * size:
                    raise ValueError(f"a channel stands outside records of {size} bytes")
        if reported and data + reported > len(raw):
            raise ValueError(
                f"{reported} bytes of data from byte {data} on are more than there are"
            )


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
