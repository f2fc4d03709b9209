"""Compiled kernels are kept on disk, and made again when any kernel's source changes."""

import shutil
import subprocess
import sys
from pathlib import Path

from numba.core.caching import IndexDataCacheFile

import weighbridge
from weighbridge.kernels import _jit

SOURCE = Path(weighbridge.__file__).parent
CALL = """
import sys
sys.path.insert(0, sys.argv[1])
from weighbridge.kernels import called, caller
print(caller.outer(3.0), sum(caller.outer.stats.cache_hits.values()))
"""
CALLED = """from weighbridge.kernels._jit import kernel


@kernel
def inner(x):
    return {factor} * x
"""
CALLER = """from weighbridge.kernels import called
from weighbridge.kernels._jit import kernel


@kernel
def outer(x):
    return called.inner(x) + 1.0
"""


def install(folder):
    """Write a package of two kernels, one of which calls the other; return how it is run."""
    package = folder / "weighbridge"
    kernels = package / "kernels"
    kernels.mkdir(parents=True)
    for name in (
        "__init__.py",
        "first_use.py",
        "version.py",
        "constants.py",
        "kernels/__init__.py",
        "kernels/_jit.py",
    ):
        shutil.copy(SOURCE / name, package / name)
    (kernels / "caller.py").write_text(CALLER)

    def run(factor):
        (kernels / "called.py").write_text(CALLED.format(factor=factor))
        ran = subprocess.run(
            [sys.executable, "-B", "-c", CALL, folder], capture_output=True, text=True, check=True
        )
        value, hits = ran.stdout.split()
        return float(value), int(hits)

    return run


def test_installations_of_the_same_sources_share_a_folder(tmp_path, monkeypatch):
    """An edit of a kernel that is called is noticed, and each finds its own again."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kept"))
    checkout, wheel = install(tmp_path / "checkout"), install(tmp_path / "wheel")
    assert checkout(2.0) == (7.0, 0)
    assert wheel(2.0) == (7.0, 1)
    assert wheel(5.0) == (16.0, 0)
    # What the other sources need is still there.
    assert checkout(2.0) == (7.0, 1)
    assert not list((tmp_path / "wheel").rglob("*.nbc"))


def test_without_a_named_folder_it_is_in_the_users_cache(tmp_path, monkeypatch):
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "kept"))
    assert install(tmp_path / "checkout")(2.0) == (7.0, 0)
    assert list((tmp_path / "kept").rglob("*.nbc"))
    assert not list((tmp_path / "checkout").rglob("*.nbc"))


def test_processes_that_save_at_once_do_not_mix_signatures(tmp_path, monkeypatch):
    """The second process reads the index before the first has written it."""

    def files():
        return _jit._Files(str(tmp_path), "kernel", "stamp")

    files().save("for floats", "code for floats")
    with monkeypatch.context() as patch:
        patch.setattr(IndexDataCacheFile, "_load_index", lambda self: {})
        files().save("for integers", "code for integers")
    assert files().load("for integers") == "code for integers"
    # It is lost and compiled again; it is never the code of the other.
    assert files().load("for floats") is None
    files().save("for floats", "code for floats")
    assert files().load("for floats") == "code for floats"
    assert files().load("for integers") == "code for integers"


def test_every_kernel_lies_where_the_digest_looks():
    users = {p.parent for p in SOURCE.rglob("*.py") if "_jit import" in p.read_text()}
    assert users == {SOURCE / "kernels"}
