"""Fixtures shared by all tests."""

import contextlib
import ctypes
import functools
import gc
import os
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

# Before Numba is imported: compiled kernels are shared by all checkouts with the same sources.
os.environ.setdefault(
    "NUMBA_CACHE_DIR",
    str(Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "weighbridge"),
)

# As the command line does: threads of BLAS wait for each other longer than they work.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Workers return what they have freed: threads of the table readers each keep a heap of their own.
os.environ.setdefault("MALLOC_ARENA_MAX", "1")

import numpy as np
import pytest

import weighbridge as wb
from tests.order import guards, is_long, longest_first, starts_processes

if TYPE_CHECKING:
    from weighbridge.simulation import SimulatedDrive

# Programs that tests start need not compile all they import, each time.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# A script that starts the tests in the background lets them ignore interruptions, which some test.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

WORKER = "PYTEST_XDIST_WORKER" in os.environ


def _keep_drives() -> None:
    from tests.drives import keep_drives

    keep_drives(Path(os.environ["NUMBA_CACHE_DIR"]))


def _make_commands_once() -> None:
    """Let the command line keep its commands, which typer makes anew for each that is run."""
    import typer.main

    typer.main.get_command = functools.cache(typer.main.get_command)


# The process that hands the tests out simulates nothing, and needs no compiler in its memory.
if WORKER:
    _keep_drives()
    _make_commands_once()

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


class Ran(NamedTuple):
    """How a command ended."""

    code: int
    out: str
    err: str


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option for tests that are left out otherwise."""
    parser.addoption("--long", action="store_true", help="run the tests of tests/long.toml too")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Keep drives and commands where no worker runs the tests."""
    if not (WORKER or session.config.getoption("numprocesses", None)):
        _keep_drives()
        _make_commands_once()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave long tests out, unless asked for or named; begin with the longest files."""
    listed, long = guards(), []
    for item in items:
        if is_long(item.nodeid.removeprefix("tests/"), listed):
            item.add_marker("long")
            long.append(item)
    wanted = config.option.long or "long" in config.option.markexpr
    if long and not wanted and not any("::" in arg for arg in config.args):
        config.hook.pytest_deselected(items=long)
        items[:] = [item for item in items if item not in set(long)]
    for item in items:
        if starts_processes(item):
            item.fixturenames.insert(0, "turn")
    longest_first(items)


def pytest_collection_finish() -> None:
    """Search for garbage seldom, and not in what was collected, which stays to the end."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Give memory back after each file: drives that its functions keep, and what glibc holds."""
    if nextitem is None or nextitem.path != item.path:
        own = (item.module.__name__, "tests", "studies")
        for kept in vars(item.module).values():
            if hasattr(kept, "cache_clear") and kept.__module__.startswith(own):
                kept.cache_clear()
        # Another C library may know no such call.
        with contextlib.suppress(AttributeError):
            ctypes.CDLL(None).malloc_trim(0)


@pytest.fixture(scope="session")
def short_drive() -> "SimulatedDrive":
    """Return a short drive of a petrol car with 120 kg on board."""
    from weighbridge import simulation

    return simulation.simulate_car(simulation.make_scenario("car-short", payload=120.0, seed=61))


@pytest.fixture(scope="session")
def brief_drive(short_drive) -> wb.Drive:
    """Return what was recorded in the first minutes of the short drive."""
    return short_drive.drive.between(0.0, 420.0)


@pytest.fixture(scope="session")
def short_car(short_drive) -> wb.Vehicle:
    """Return the car as the short drive calibrates it."""
    return wb.calibrate([short_drive.drive], mass=float(short_drive.truth.mass[0]))


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the recorded drives; skips where they are not."""
    if not SHARED_DATA.is_dir():
        pytest.skip("recorded drives are not here: no folder ../shared/data beside the checkout")
    return SHARED_DATA


@pytest.fixture(scope="session")
def foreign_simulator(shared_data: Path) -> Path:
    """Folder of another simulator's drives, by vehicle; skips where they are not."""
    path = shared_data / "foreign-simulator"
    if not path.is_dir():
        pytest.skip("the drives of another simulator are not here")
    return path


@pytest.fixture
def weighbridge(capsys, monkeypatch) -> Callable[..., Ran]:
    """Run the command line in this process, error handling included."""
    from weighbridge import cli

    def run(*words: object) -> Ran:
        monkeypatch.setattr(sys, "argv", ["weighbridge", *(str(w) for w in words)])
        capsys.readouterr()
        code = 0
        try:
            cli.run()
        except SystemExit as leaving:
            code = leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
        return Ran(code, *capsys.readouterr())

    return run


@pytest.fixture(scope="session")
def assert_salvaged() -> Callable[[Path], None]:
    """Check that a damaged log leaves sound signals or one sentence."""

    def check(path: Path) -> None:
        said, found = "one sentence", {}
        try:
            found = wb.read_drive(path).signals
        except wb.DriveError as e:
            said = str(e)
        assert len(said.splitlines()) == 1
        for one in found.values():
            assert np.isfinite(one.values).all()
            assert (np.diff(one.time) > 0.0).all()

    return check


@pytest.fixture(scope="session")
def assert_damage_is_told(
    tmp_path_factory, assert_salvaged
) -> Callable[[str, bytes, float, float, bytes], None]:
    """Cut a log off, write junk over a part of what is left, and check how it is read."""

    def check(name: str, whole: bytes, part: float, at: float, junk: bytes) -> None:
        cut = bytearray(whole[: int(part * len(whole))])
        place = int(at * len(cut))
        cut[place : place + len(junk)] = junk
        path = tmp_path_factory.mktemp("cut") / name
        path.write_bytes(cut)
        assert_salvaged(path)

    return check


@pytest.fixture(scope="module")
def turn(tmp_path_factory):
    """Wait until no other worker runs a file whose processes take much memory."""
    with (tmp_path_factory.getbasetemp().parent / "turn").open("w") as file:
        # Windows has no such lock.
        with contextlib.suppress(ImportError):
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX)
        yield


@pytest.fixture(scope="module")
def chromium(turn):
    """Headless Chromium of playwright, one for a file of tests."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("no Chromium is installed")
    with sync_api.sync_playwright() as play:
        started = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture
def browser(chromium):
    """Browser without a page of an earlier test; skips where none is installed."""
    yield chromium
    for context in chromium.contexts:
        context.close()
