"""Simulated drives are kept on disk: a recipe is simulated once for all workers and runs."""

import contextlib
import functools
import hashlib
import os
import pickle
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa

import weighbridge
from weighbridge import simulation
from weighbridge.simulation import Scenario, SimulatedDrive
from weighbridge.simulation import simulate_car as simulate

SOURCES = Path(weighbridge.__file__).parent
ROOMS = ("simulation", "signals", "vehicle", "kernels")
"""What a simulated drive is made of."""

UNUSED = 86_400.0
"""After which drives of other sources are thrown away [s]."""

ROOM = 2e9
"""Of all drives that are kept [B]; the others are simulated each time."""


def _digest() -> str:
    digest = hashlib.sha256(np.__version__.encode())
    files = [path for room in ROOMS for path in (SOURCES / room).rglob("*.py")]
    for path in sorted((*files, SOURCES / "constants.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _packed(data: bytes) -> bytes:
    packed = pa.Codec("zstd", compression_level=1).compress(data, asbytes=True)
    return len(data).to_bytes(8, "big") + packed


def _unpacked(data: bytes) -> bytes:
    return pa.Codec("zstd").decompress(data[8:], int.from_bytes(data[:8], "big"), asbytes=True)


class Kept:
    """`simulate_car`, with a folder of what it returned before."""

    def __init__(self, folder: Path, room: float = ROOM) -> None:
        self.folder, self.room = folder, room

    def __call__(
        self, scenario: Scenario, progress: Callable[[int, int], None] | None = None
    ) -> SimulatedDrive:
        """Return the drive of a scenario, its arrays the caller's own."""
        recipe = pickle.dumps(scenario)
        path = self.folder / f"{hashlib.sha256(recipe).hexdigest()[:24]}.drive"
        # Cut off, or of another Python: it is simulated again.
        with contextlib.suppress(Exception):
            drive, truth = pickle.loads(_unpacked(path.read_bytes()))
            return SimulatedDrive(scenario=scenario, drive=drive, truth=truth)
        made = simulate(scenario, progress)
        with contextlib.suppress(OSError):
            self._keep(path, _packed(pickle.dumps((made.drive, made.truth))))
        return made

    def _keep(self, path: Path, data: bytes) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        if sum(p.stat().st_size for p in self.folder.iterdir()) + len(data) > self.room:
            return
        # Another worker may write the same drive: the last one stays, whole.
        handle, name = tempfile.mkstemp(dir=self.folder)
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        Path(name).replace(path)


def keep_drives(cache: Path) -> None:
    """Let ``weighbridge.simulation.simulate_car`` keep what it returns, for modules imported later.

    Tests of the simulation itself import it from ``weighbridge.simulation.simulate``.
    """
    folder = cache / f"drives_{_digest()}"
    for old in cache.glob("drives_*"):
        if old != folder and time.time() - old.stat().st_mtime > UNUSED:
            shutil.rmtree(old, ignore_errors=True)
    kept = Kept(folder)

    @functools.wraps(simulate)
    def simulate_car(*args, **named):
        return kept(*args, **named)

    simulation.simulate_car = simulate_car
