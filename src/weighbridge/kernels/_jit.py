"""The one decorator of all compiled kernels."""

import contextlib
from pathlib import Path

from numba import njit
from numba.core.caching import FunctionCache

# Numba does not notice edits in other files, so a disk cache would go stale
# while the package is developed in place; an installed package never changes.
INSTALLED = "site-packages" in Path(__file__).parts


class _Cache(FunctionCache):
    """Disk cache whose damage, or a full disk, costs a compilation and no more."""

    def load_overload(self, sig, target_context):
        """Load a compiled kernel; None where its file cannot be read."""
        try:
            return super().load_overload(sig, target_context)
        # A file cut off is a pickle cut off, whose errors are of many kinds.
        except Exception:
            with contextlib.suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig, data):
        """Save a compiled kernel where that can be done."""
        # Beside a full disk: an index cut off, which is read before it is written.
        with contextlib.suppress(Exception):
            super().save_overload(sig, data)


def _decorator(**options):
    compiled = njit(error_model="numpy", nogil=True, **options)

    def decorate(function):
        dispatcher = compiled(function)
        if INSTALLED and hasattr(dispatcher, "enable_caching"):
            # No folder that can be written to: compile each time.
            with contextlib.suppress(RuntimeError, OSError):
                dispatcher._cache = _Cache(function)
        return dispatcher

    return decorate


kernel = _decorator()
"""Compile; division by zero gives ``inf`` compiled or not; threads may share."""

fast_kernel = _decorator(fastmath={"reassoc", "contract", "arcp", "nsz"})
"""As `kernel`, with sums free to be reordered; NaN keeps its meaning."""

inlined_kernel = _decorator(forceinline=True)
"""As `kernel`, put in the place of its call: for small steps of a loop whose arguments
hold many arrays, which a call would count references of."""
