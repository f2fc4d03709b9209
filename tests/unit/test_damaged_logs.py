"""Damaged files give a drive or one clear sentence: no traceback, no hang, no memory."""

import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from weighbridge.errors import WeighbridgeError
from weighbridge.io import read_drive

GOLDEN = Path(__file__).parents[1] / "golden"
LOGS = {s: (GOLDEN / f"can.{s}").read_bytes() for s in ("blf", "asc", "trc", "log", "csv", "mf4")}
TABLES = {
    name.rpartition("/")[2]: (GOLDEN / name).read_bytes()
    for name in ("csv/obd.csv", "parquet/obd.parquet", "log.mf4")
}
MAPPING = {"signals": {"altitude": {"column": "Height"}}}


def read(path, *naming):
    began = time.process_time()
    told, drive = "", None
    try:
        drive = read_drive(path, *naming)
    except WeighbridgeError as error:
        told = str(error)
    assert drive.signals if drive else 10 < len(told) < 1000
    assert "\n" not in told
    # No limit of speed: a reader that is led to read far more than is there. Time of this process,
    # as the machine may be busy with others.
    assert time.process_time() - began < 60.0


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


@pytest.mark.parametrize("suffix", LOGS)
@settings(
    max_examples=40,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(damage=damages())
def test_damaged_files(suffix, tmp_path, damage):
    path = tmp_path / f"log.{suffix}"
    path.write_bytes(damaged(LOGS[suffix], damage))
    read(path, MAPPING, GOLDEN / "golden.dbc")


@pytest.mark.parametrize("name", TABLES)
@settings(
    max_examples=25,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(damage=damages())
def test_damaged_tables(name, tmp_path, damage):
    path = tmp_path / name
    path.write_bytes(damaged(TABLES[name], damage))
    read(path)


@pytest.mark.parametrize("suffix", LOGS)
@settings(
    max_examples=15,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(content=st.one_of(st.binary(max_size=300), st.text(max_size=200).map(str.encode)))
def test_files_of_anything(suffix, tmp_path, content):
    path = tmp_path / f"log.{suffix}"
    path.write_bytes(content)
    read(path, MAPPING, GOLDEN / "golden.dbc")


def test_object_of_no_size_does_not_hang(tmp_path):
    raw = bytearray(LOGS["blf"])
    raw[144 + 8 : 144 + 12] = bytes(4)
    path = tmp_path / "log.blf"
    path.write_bytes(raw)
    read(path, MAPPING, GOLDEN / "golden.dbc")


def test_container_that_claims_much_takes_no_memory(tmp_path):
    raw = bytearray(LOGS["blf"])
    at = raw.index(b"LOBJ")
    raw[at + 24 : at + 28] = b"\xff" * 4
    path = tmp_path / "log.blf"
    path.write_bytes(raw)
    read(path, MAPPING, GOLDEN / "golden.dbc")


def test_channels_outside_their_records_do_not_end_the_process(tmp_path):
    raw = bytearray(LOGS["mf4"])
    at = raw.find(b"##CN")
    while at >= 0:
        body = at + 24 + 8 * int.from_bytes(raw[at + 16 : at + 24], "little")
        raw[body + 4 : body + 8] = (1 << 24).to_bytes(4, "little")
        at = raw.find(b"##CN", at + 1)
    path = tmp_path / "log.mf4"
    path.write_bytes(raw)
    with pytest.raises(WeighbridgeError, match="stands outside its records"):
        read_drive(path)
