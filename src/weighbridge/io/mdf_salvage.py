"""What is left of an MDF 4 file that was cut off, as a file that can be read.

Blocks of ASAM MDF 4 point at each other. Where a file ends early, some point past its end: such
a link is cleared, a group of channels without all of its description is given up, and the rest
keeps the records of which every byte is there.
"""

from __future__ import annotations

import mmap
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from weighbridge.io.mdf_blocks import HEAD, ID_BLOCK, VLSD_CHANNEL, ZIPPED

_LINK: Final = struct.Struct("<Q")
# Record id, cycles, flags, bytes of a record and of its invalidation bits.
_GROUP: Final = struct.Struct("<QQH6xII")
# Type, byte offset and bits of a channel.
_CHANNEL: Final = struct.Struct("<B3xII")

_DATA: Final = (b"##DT", b"##DV", b"##DI", b"##SD", b"##DZ")
_DESCRIPTION: Final = (b"##CN", b"##CC", b"##CA", b"##SI", b"##TX", b"##MD")
# Links that may be cleared without changing what the values mean.
_SPARE: Final[dict[bytes, frozenset[int]]] = {
    b"##CG": frozenset((2, 3, 4, 5)),
    b"##CN": frozenset((3, 7, *range(8, 64))),
    b"##CC": frozenset((0, 2, 3)),
    b"##SI": frozenset((0, 1, 2)),
}
_CHANNEL_DATA: Final = 5
_VLSD_GROUP: Final = 0x1
_TRANSPOSED: Final = 1
_UNZIPPED_LIMIT: Final = 1 << 28


class Salvaged(NamedTuple):
    """A file that was cut off, made readable.

    Attributes
    ----------
    raw : its bytes, with links and counters mended
    kept : records that are whole
    told : records the file speaks of, as far as its groups are known
    unfinished : whether its logger never got to count its records
    """

    raw: bytes
    kept: int
    told: int
    unfinished: bool


class _LostError(Exception):
    """A block is not wholly in the file."""


class _DamagedError(Exception):
    """A file that was only to be looked at needs mending."""


class _Block(NamedTuple):
    at: int
    kind: bytes
    length: int
    links: tuple[int, ...]

    @property
    def body(self) -> int:
        return self.at + 24 + 8 * len(self.links)


@dataclass(slots=True)
class _File:
    """The bytes of a file; mended where they can be grown, else only looked at."""

    raw: bytearray | mmap.mmap
    size: int
    kept: int = 0
    told: int = 0
    damaged: bool = False
    known: set[int] = field(default_factory=set)

    def block(self, at: int, kinds: tuple[bytes, ...], *, whole: bool = True) -> _Block:
        """Read the header and the links of a block, and ask for all of it where ``whole``."""
        if at < ID_BLOCK or at + 24 > self.size:
            raise _LostError
        kind, length, count = HEAD.unpack_from(self.raw, at)
        if kind not in kinds or length < 24 or count > length // 8:
            raise _LostError
        if at + (length if whole else 24 + 8 * count) > self.size:
            raise _LostError
        return _Block(at, kind, length, struct.unpack_from(f"<{count}Q", self.raw, at + 24))

    def number(self, at: int, value: int) -> None:
        """Write a number of 8 bytes.

        Raises
        ------
        _DamagedError
            The file is only looked at.
        """
        if not isinstance(self.raw, bytearray):
            raise _DamagedError
        _LINK.pack_into(self.raw, at, value)
        self.damaged = True

    def link(self, block: _Block, link: int, target: int = 0) -> None:
        """Point a link elsewhere, or at nothing."""
        self.number(block.at + 24 + 8 * link, target)

    def append(self, kind: bytes, content: bytes) -> int:
        """Put a block at the end of the file; return where it stands."""
        if not isinstance(self.raw, bytearray):
            raise _DamagedError
        self.raw += bytes(-len(self.raw) % 8)
        at = len(self.raw)
        self.raw += HEAD.pack(kind, 24 + len(content), 0) + content
        return at


def salvage(path: Path) -> Salvaged | None:
    """Mend a copy of an MDF 4 file that was cut off.

    Parameters
    ----------
    path : the file; it is left as it is

    Returns
    -------
    None where nothing is missing, or where it is no MDF 4 file with a header.

    References
    ----------
    ASAM MDF 4.1: the blocks HD, DG, CG, CN, CC, DT, SD, DZ, DL and HL.
    """
    size = path.stat().st_size
    if size <= ID_BLOCK:
        return None
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as raw:
        if raw[:8] not in (b"MDF     ", b"UnFinMF ") or raw[8:9] != b"4":
            return None
        try:
            _mend(_File(raw, size))
        except _DamagedError:
            file = _File(bytearray(raw), size)
        else:
            return None
    _mend(file)
    return Salvaged(bytes(file.raw), file.kept, file.told, _is_unfinished(file))


def _is_unfinished(file: _File) -> bool:
    """Tell whether a file says itself that its counters and its last block are not final."""
    return bool(struct.unpack_from("<H", file.raw, 60)[0])


def _mend(file: _File) -> None:
    try:
        header = file.block(ID_BLOCK, (b"##HD",))
    except _LostError:
        return
    for k, target in enumerate(header.links[1:], 1):
        _spare(file, header, k, target)
    for group in _chain(file, header, 0, b"##DG"):
        if len(group.links) > 3:
            _spare(file, group, 3, group.links[3])
            _data_group(file, group)


def _chain(file: _File, owner: _Block, link: int, kind: bytes) -> Iterator[_Block]:
    """Blocks that follow each other; the link to one that is not there is cleared."""
    while link < len(owner.links) and (at := owner.links[link]):
        try:
            block = file.block(at, (kind,))
            if at in file.known:
                raise _LostError
        except _LostError:
            file.link(owner, link)
            return
        file.known.add(at)
        yield block
        owner, link = block, 0


def _spare(file: _File, owner: _Block, link: int, target: int) -> None:
    """Clear a link that points at nothing and is not needed."""
    if target:
        try:
            file.block(target, (bytes(file.raw[target : target + 4]),))
        except _LostError:
            file.link(owner, link)


def _data_group(file: _File, group: _Block) -> None:
    """Keep what is whole of the channel groups of one data group."""
    owner = file.damaged
    file.damaged = False
    channel_groups = list(_chain(file, group, 1, b"##CG"))
    cut, file.damaged = file.damaged, file.damaged or owner
    id_size = file.raw[group.body]
    if cut and id_size:
        # Records of unknown size cannot be told apart.
        file.link(group, 1)
        file.link(group, 2)
        return
    texts: dict[int, list[_Block]] = {}
    for cg in channel_groups:
        try:
            texts[cg.at] = _described(file, cg)
        except _LostError:
            _give_up(file, cg)
    if _is_unfinished(file):
        return
    if len(channel_groups) == 1:
        if channel_groups[0].at in texts:
            _sorted(file, group, channel_groups[0], id_size, texts[channel_groups[0].at])
    elif channel_groups and not _is_whole(file, group.links[2]):
        _unsorted(file, group, channel_groups, id_size)


def _give_up(file: _File, cg: _Block) -> None:
    _, cycles, flags, *_ = _GROUP.unpack_from(file.raw, cg.body)
    file.told += 0 if flags & _VLSD_GROUP else cycles
    file.link(cg, 1)
    _set_cycles(file, cg, 0)


def _set_cycles(file: _File, cg: _Block, cycles: int) -> None:
    file.number(cg.body + 8, cycles)


def _described(file: _File, cg: _Block) -> list[_Block]:
    """Check that all channels of a group are described; return those of variable length."""
    variable = []
    waiting = [(cg, k) for k in range(1, len(cg.links))]
    while waiting:
        owner, k = waiting.pop()
        target = owner.links[k]
        if not target:
            continue
        if k in _SPARE.get(owner.kind, ()):
            _spare(file, owner, k, target)
            continue
        if owner.kind == b"##CN" and k == _CHANNEL_DATA:
            if file.raw[owner.body] == VLSD_CHANNEL:
                variable.append(owner)
            continue
        block = file.block(target, _DESCRIPTION)
        if target not in file.known:
            file.known.add(target)
            waiting += [(block, j) for j in range(len(block.links))]
    return variable


def _pieces(file: _File, at: int) -> Iterator[_Block]:
    """Data blocks that hang on a link, one by one or in lists.

    Raises
    ------
    _LostError
        At the first that is not there at all.
    """
    if not at:
        return
    block = file.block(at, (*_DATA, b"##DL", b"##HL", b"##LD"), whole=False)
    if block.kind in _DATA:
        yield block
        return
    file.block(at, (block.kind,))
    seen = set()
    if block.kind == b"##HL":
        block = file.block(block.links[0], (b"##DL", b"##LD"))
    while block.at not in seen:
        seen.add(block.at)
        for target in block.links[1:]:
            if target:
                yield file.block(target, _DATA, whole=False)
        if not block.links[0]:
            return
        block = file.block(block.links[0], (b"##DL", b"##LD"))


def _is_whole(file: _File, at: int) -> bool:
    try:
        return all(b.at + b.length <= file.size for b in _pieces(file, at))
    except (_LostError, IndexError):
        return False


def _content(file: _File, at: int) -> bytes:
    """Data that hang on a link, up to the first byte that is missing."""
    parts = []
    try:
        for block in _pieces(file, at):
            content, whole = _plain(file, block)
            parts.append(content)
            if not whole:
                break
    except (_LostError, IndexError, struct.error):
        pass
    return b"".join(parts)


def _plain(file: _File, block: _Block) -> tuple[bytes, bool]:
    """Content of one data block, and whether it is all there."""
    end = block.at + block.length
    if block.kind != b"##DZ":
        return bytes(file.raw[block.body : min(end, file.size)]), end <= file.size
    _, kind, columns, size, packed = ZIPPED.unpack_from(file.raw, block.body)
    start = block.body + ZIPPED.size
    try:
        content = zlib.decompressobj().decompress(
            file.raw[start : min(start + packed, file.size)], min(size, _UNZIPPED_LIMIT) or 1
        )
    except zlib.error:
        return b"", False
    if len(content) < size and kind == _TRANSPOSED:
        return b"", False
    if kind == _TRANSPOSED and columns:
        lines = size // columns
        table = np.frombuffer(content[: lines * columns], np.uint8).reshape(columns, lines)
        content = table.T.tobytes() + content[lines * columns :]
    return content, len(content) >= size


def _sorted(file: _File, group: _Block, cg: _Block, id_size: int, variable: list[_Block]) -> None:
    """Keep the whole records of a data group that has one channel group."""
    _, cycles, _, samples, invalid = _GROUP.unpack_from(file.raw, cg.body)
    size = id_size + samples + invalid
    file.told += cycles
    broken = [cn for cn in variable if not _is_whole(file, cn.links[_CHANNEL_DATA])]
    if (not broken and _is_whole(file, group.links[2])) or size == 0:
        file.kept += cycles
        return
    content = _content(file, group.links[2])
    kept = min(cycles, len(content) // size)
    rows = np.frombuffer(content, np.uint8, kept * size).reshape(kept, size)
    for cn in broken:
        values = _content(file, cn.links[_CHANNEL_DATA])
        _, byte, bits = _CHANNEL.unpack_from(file.raw, cn.body)
        kept = min(kept, _within(rows[:, id_size + byte :][:, : (bits + 7) // 8], values))
        file.link(cn, _CHANNEL_DATA, file.append(b"##SD", values))
    file.link(group, 2, file.append(b"##DT", content[: kept * size]))
    _set_cycles(file, cg, kept)
    file.kept += kept


def _within(places: np.ndarray[tuple[int, int], np.dtype[np.uint8]], values: bytes) -> int:
    """How many records come before the first whose value of variable length is cut off."""
    at = np.zeros(len(places), np.int64)
    for k in range(min(places.shape[1], 7)):
        at |= places[:, k].astype(np.int64) << (8 * k)
    data = np.frombuffer(values, np.uint8)
    good = at + 4 <= data.size
    length = np.zeros(at.size, np.int64)
    for k in range(4):
        length[good] |= data[at[good] + k].astype(np.int64) << (8 * k)
    good &= at + 4 + length <= data.size
    return int(np.argmin(good)) if not good.all() else at.size


def _unsorted(file: _File, group: _Block, channel_groups: list[_Block], id_size: int) -> None:
    """Keep the whole records of a data group whose channel groups are mixed."""
    content = _content(file, group.links[2])
    sizes: dict[int, int] = {}
    counts: dict[int, int] = {}
    for cg in channel_groups:
        number, cycles, flags, samples, invalid = _GROUP.unpack_from(file.raw, cg.body)
        sizes[number] = -1 if flags & _VLSD_GROUP else samples + invalid
        counts[number] = 0
        file.told += 0 if flags & _VLSD_GROUP else cycles
    at = end = 0
    while at + id_size <= len(content):
        number = int.from_bytes(content[at : at + id_size], "little")
        size = sizes.get(number)
        at += id_size
        if size == -1:
            size = 4 + int.from_bytes(content[at : at + 4], "little")
        if size is None or at + size > len(content):
            break
        at = end = at + size
        counts[number] += 1
    file.link(group, 2, file.append(b"##DT", content[:end]))
    for cg in channel_groups:
        number, _, flags, *_ = _GROUP.unpack_from(file.raw, cg.body)
        _set_cycles(file, cg, counts[number])
        file.kept += 0 if flags & _VLSD_GROUP else counts[number]
