"""A clock that never jumps, for samples that carry no instant of their own."""

from __future__ import annotations

import time

_BEGUN = time.time() - time.monotonic()


def now() -> float:
    """Return the time since 1970 as it was when the process began, counted on evenly [s].

    A host that sets its clock on the way does not move it.
    """
    return _BEGUN + time.monotonic()
