"""Layouts of ASAM MDF 4 blocks that reading, checking and salvaging share."""

from __future__ import annotations

import struct
from typing import Final

ID_BLOCK: Final = 64
"""Bytes before the first block."""

HEAD: Final = struct.Struct("<4s4xQQ")
"""Kind, bytes and number of links of a block."""

ZIPPED: Final = struct.Struct("<2sBxIQQ")
"""Of packed data: kind of block, method, columns, bytes before and after packing."""

VLSD_CHANNEL: Final = 1
"""Type of a channel whose values are of variable length."""
