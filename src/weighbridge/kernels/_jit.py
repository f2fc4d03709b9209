"""The one decorator of all compiled kernels."""

import contextlib
import hashlib
from pathlib import Path

import numba
from numba import njit
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    UserWideCacheLocator,
)
from numba.core.runtime.nrt import rtsys
from numba.misc.appdirs import AppDirs


def _sources() -> str:
    """Digest of all that kernels are made of: they call each other, and no other module's code."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for path in (*sorted(here.glob("*.py")), here.parent / "constants.py"):
        digest.update(path.read_bytes())
    return digest.hexdigest()


SOURCES = _sources()
"""Kernels in the disk cache that were made of other sources are compiled again: numba alone
notices edits of a function's own file, and not of those it calls."""


class _ByContent(UserWideCacheLocator):
    """Folder named by the sources, in NUMBA_CACHE_DIR or else in the user's cache folder.

    Checkouts and wheels of the same kernels share it, and each environment of ``uvx`` finds it.
    """

    def __init__(self, py_func, py_file):
        super().__init__(py_func, py_file)
        own = AppDirs("weighbridge", appauthor=False).user_cache_dir
        name = f"weighbridge_{SOURCES[:16]}_numba_{numba.__version__}"
        self._cache_path = str(Path(numba.config.CACHE_DIR or own) / name)


class _Place(CompileResultCacheImpl):
    """As numba places a kernel, but for a named folder."""

    def __init__(self, function):
        self._locator_classes = [_ByContent, *CompileResultCacheImpl._locator_classes]
        super().__init__(function)


class _Files(IndexDataCacheFile):
    """Files of one kernel, which several processes may write at once.

    Numba numbers compiled signatures. Two processes that save at once would give two signatures
    one number, and the index would lead to the wrong code. Here a digest names the file.
    """

    def save(self, key, data):
        """Save a compiled kernel; what is lost beside another process is compiled again."""
        overloads = self._load_index()
        if key not in overloads:
            digest = hashlib.sha256(self._dump(key)).digest()
            overloads[key] = self._data_name(int.from_bytes(digest[:8], "big"))
        self._save_data(overloads[key], data)
        self._save_index(overloads)


class _Cache(FunctionCache):
    """Disk cache whose damage, or a full disk, costs a compilation and no more."""

    _impl_class = _Place

    def __init__(self, function):
        super().__init__(function)
        self._cache_file = _Files(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=SOURCES,
        )

    def load_overload(self, sig, target_context):
        """Load a compiled kernel; None where its file cannot be read."""
        try:
            # Without numba's registries, which a compilation loads, and which take longer than all
            # kernels of a weighing.
            rtsys.initialize(target_context)
            return self._load_overload(sig, target_context)
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
    compiled = njit(error_model="numpy", nogil=True, no_cfunc_wrapper=True, **options)

    def decorate(function):
        dispatcher = compiled(function)
        if hasattr(dispatcher, "enable_caching"):
            # No folder that can be written to: compile each time.
            with contextlib.suppress(RuntimeError, OSError):
                dispatcher._cache = _Cache(function)
        return dispatcher

    return decorate


kernel = _decorator()
"""Compile; division by zero gives ``inf`` compiled or not; threads may share."""

contracted_kernel = _decorator(fastmath={"contract"})
"""As `kernel`, with products and sums fused; the same expression gives the same bits."""

_FAST = {"reassoc", "contract", "arcp", "nsz"}

fast_kernel = _decorator(fastmath=_FAST)
"""As `kernel`, with sums free to be reordered; NaN keeps its meaning."""

inlined_kernel = _decorator(forceinline=True)
"""As `kernel`, put in the place of its call: for small steps of a loop whose arguments
hold many arrays, which a call would count references of."""

inlined_fast_kernel = _decorator(fastmath=_FAST, forceinline=True)
"""As `fast_kernel`, put in the place of its call."""

spliced_kernel = _decorator(inline="always")
"""As `inlined_kernel`, put in before compiling and never compiled alone: for the one call of a long
step."""
