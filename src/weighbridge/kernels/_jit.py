"""The one decorator of all compiled kernels."""

from pathlib import Path

from numba import njit

# Numba does not notice edits in other files, so a disk cache would go stale
# while the package is developed in place; an installed package never changes.
INSTALLED = "site-packages" in Path(__file__).parts

kernel = njit(error_model="numpy", nogil=True, cache=INSTALLED)
"""Compile; division by zero gives ``inf`` compiled or not; threads may share."""

fast_kernel = njit(
    error_model="numpy",
    nogil=True,
    cache=INSTALLED,
    fastmath={"reassoc", "contract", "arcp", "nsz"},
)
"""As `kernel`, with sums free to be reordered; NaN keeps its meaning."""

inlined_kernel = njit(error_model="numpy", nogil=True, cache=INSTALLED, forceinline=True)
"""As `kernel`, put in the place of its call: for small steps of a loop whose arguments
hold many arrays, which a call would count references of."""
