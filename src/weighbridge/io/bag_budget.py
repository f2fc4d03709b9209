"""A bag of ROS 1 may not unpack to more than a file can hold, whatever it says of itself."""

from __future__ import annotations

import bz2
from collections.abc import Callable
from pathlib import Path
from typing import Any

from weighbridge.io.channels import check_unpacked, most_unpacked


def bound_chunks(path: Path, bag: Any) -> None:
    """Let the chunks of an open ROS 1 bag unpack to `most_unpacked` in all.

    A chunk beyond raises `DriveError` when it is reached.
    """
    sizes: dict[int, int] = {}

    def bounded(place: int, unpack: Callable[[bytes, int], bytes]) -> Callable[[bytes], bytes]:
        def decompress(data: bytes) -> bytes:
            # A chunk may be read again, where its messages lie among those of others.
            others = sum(size for at, size in sizes.items() if at != place)
            found = unpack(data, most_unpacked(path) - others + 1)
            sizes[place] = len(found)
            check_unpacked(path, others + len(found))
            return found

        return decompress

    known = {bz2.decompress: _bz2, _library_lz4(): _lz4}
    for place, chunk in bag.chunks.items():
        if chunk.decompressor in known:
            unpack = bounded(place, known[chunk.decompressor])
            bag.chunks[place] = chunk._replace(decompressor=unpack)


def _library_lz4() -> Callable[[bytes], bytes]:
    from lz4.frame import decompress  # type: ignore[import-untyped]

    found: Callable[[bytes], bytes] = decompress
    return found


def _bz2(data: bytes, most: int) -> bytes:
    return bz2.BZ2Decompressor().decompress(data, max_length=most)


def _lz4(data: bytes, most: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor

    return bytes(LZ4FrameDecompressor().decompress(data, max_length=most))
