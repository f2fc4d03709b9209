"""Damaged files give a drive or one clear sentence: no traceback, no hang, no memory."""

import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.noted import error

from weighbridge import WeighbridgeError, read_drive

GOLDEN = Path(__file__).parents[1] / "golden"
LOGS = {s: (GOLDEN / f"can.{s}").read_bytes() for s in ("blf", "asc", "trc", "log", "csv", "mf4")}
TABLES = {
    name.rpartition("/")[2]: (GOLDEN / name).read_bytes()
    for name in ("csv/obd.csv", "parquet/obd.parquet", "log.mf4")
}
NAMING = ({"signals": {"altitude": {"column": "Height"}}}, GOLDEN / "golden.dbc")


def fault(path, *naming):
    """Say what is wrong with how a file is read; empty where it gives signals or one sentence."""
    began = time.process_time()
    told, drive = "", None
    try:
        drive = read_drive(path, *naming)
    except WeighbridgeError as error:
        told = str(error)
    # No limit of speed: a reader that is led to read far more than is there. Time of this process,
    # as the machine may be busy with others.
    if time.process_time() - began > 60.0:
        return "it took more than a minute"
    if drive is not None:
        return "" if drive.signals else "a drive without signals"
    clear = 10 < len(told) < 1000 and "\n" not in told
    return "" if clear else f"not one sentence: {told!r}"


@st.composite
def damages(draw):
    """Where a file is cut, and which bytes of it are changed, removed or repeated."""
    cut = draw(st.one_of(st.just(1.0), st.floats(0.0, 1.0)))
    edit = st.tuples(
        st.sampled_from(("change", "remove", "repeat", "insert")),
        st.floats(0.0, 1.0),
        st.binary(min_size=1, max_size=8),
    )
    return cut, draw(st.lists(edit, max_size=6))


def damaged(raw, damage):
    cut, edits = damage
    for kind, where, content in edits:
        at = int(where * len(raw))
        match kind:
            case "change":
                raw = raw[:at] + content + raw[at + len(content) :]
            case "remove":
                raw = raw[:at] + raw[at + 7 * len(content) :]
            case "repeat":
                raw = raw[:at] + raw[max(at - 50 * len(content), 0) :]
            case "insert":
                raw = raw[:at] + content + raw[at:]
    return raw[: int(cut * len(raw))]


class Child:
    """A process that reads files, so that what ends it does not end the tests.

    It may take 2 GB more than when it began, where the system can limit that.
    """

    CODE = """
import pathlib, sys
sys.path.insert(0, sys.argv[1])
from test_damaged_logs import NAMING, fault
try:
    import resource
    taken = int(pathlib.Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + (1 << 31), resource.RLIM_INFINITY))
except (ImportError, OSError):
    pass
print("ready", flush=True)
for line in sys.stdin:
    try:
        count, _, path = line[:-1].partition(" ")
        print(repr(fault(pathlib.Path(path), *NAMING[: int(count)])), flush=True)
    except BaseException as error:
        print(repr(error).replace(chr(10), " "), flush=True)
"""

    def __init__(self):
        self.process = None

    def fault(self, path, *naming):
        """Return `fault` as the process found it, or how the process ended."""
        assert naming in ((), NAMING)
        if self.process is None or self.process.poll() is not None:
            self.process = subprocess.Popen(
                [sys.executable, "-X", "faulthandler", "-c", self.CODE, str(Path(__file__).parent)],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            )  # fmt: skip
            assert self.process.stdout.readline() == "ready\n"
        hang = threading.Timer(90.0, self.process.kill)
        hang.start()
        try:
            print(len(naming), path, file=self.process.stdin, flush=True)
            told = self.process.stdout.readline()
        finally:
            hang.cancel()
        if not told:
            return f"the process ended with {self.process.wait()}"
        return "" if told == "''\n" else told

    def end(self):
        if self.process is not None:
            self.process.kill()
            self.process.communicate()


@pytest.fixture(scope="module")
def child():
    found = Child()
    yield found
    found.end()


@pytest.fixture
def fault_of(child):
    """MF4 is read by compiled code that is not ours and was not made for damaged files."""
    return lambda path, *naming: (child.fault if path.suffix == ".mf4" else fault)(path, *naming)


@pytest.mark.parametrize("suffix", LOGS)
@settings(
    max_examples=12,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(damage=damages())
def test_damaged_files(suffix, fault_of, tmp_path, damage):
    path = tmp_path / f"log.{suffix}"
    path.write_bytes(damaged(LOGS[suffix], damage))
    assert fault_of(path, *NAMING) == ""


@pytest.mark.parametrize("name", TABLES)
@settings(
    max_examples=12,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(damage=damages())
def test_damaged_tables(name, fault_of, tmp_path, damage):
    path = tmp_path / name
    path.write_bytes(damaged(TABLES[name], damage))
    assert fault_of(path) == ""


@pytest.mark.parametrize("suffix", LOGS)
@settings(
    max_examples=10,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(content=st.one_of(st.binary(max_size=300), st.text(max_size=200).map(str.encode)))
def test_files_of_anything(suffix, fault_of, tmp_path, content):
    path = tmp_path / f"log.{suffix}"
    path.write_bytes(content)
    assert fault_of(path, *NAMING) == ""


def test_object_of_no_size_does_not_hang(tmp_path):
    raw = bytearray(LOGS["blf"])
    raw[144 + 8 : 144 + 12] = bytes(4)
    path = tmp_path / "log.blf"
    path.write_bytes(raw)
    assert fault(path, *NAMING) == ""


def test_container_that_claims_much_takes_no_memory(tmp_path):
    raw = bytearray(LOGS["blf"])
    at = raw.index(b"LOBJ")
    raw[at + 24 : at + 28] = b"\xff" * 4
    path = tmp_path / "log.blf"
    path.write_bytes(raw)
    assert fault(path, *NAMING) == ""


def test_channels_outside_their_records_do_not_end_the_process(tmp_path):
    raw = bytearray(LOGS["mf4"])
    at = raw.find(b"##CN")
    while at >= 0:
        body = at + 24 + 8 * int.from_bytes(raw[at + 16 : at + 24], "little")
        raw[body + 4 : body + 8] = (1 << 24).to_bytes(4, "little")
        at = raw.find(b"##CN", at + 1)
    path = tmp_path / "log.mf4"
    path.write_bytes(raw)
    with error(WeighbridgeError, "log.mf4 160"):
        read_drive(path)
