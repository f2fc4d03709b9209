"""Compiled kernels are kept on disk, and made again when any kernel's source changes."""

import shutil
import subprocess
import sys
from pathlib import Path

import weighbridge

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


def test_an_edit_of_a_called_kernel_is_noticed(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    package = tmp_path / "weighbridge"
    kernels = package / "kernels"
    kernels.mkdir(parents=True)
    for name in (
        "__init__.py",
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
            [sys.executable, "-c", CALL, tmp_path], capture_output=True, text=True, check=True
        )
        value, hits = ran.stdout.split()
        return float(value), int(hits)

    assert run(2.0) == (7.0, 0)
    assert run(2.0) == (7.0, 1)
    assert run(5.0) == (16.0, 0)


def test_every_kernel_lies_where_the_digest_looks():
    users = {p.parent for p in SOURCE.rglob("*.py") if "_jit import" in p.read_text()}
    assert users == {SOURCE / "kernels"}
