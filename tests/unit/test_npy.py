"""NumPy arrays by a mapping."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import error

from weighbridge import ConfigError, DriveError, WeighbridgeError, read_drive

TIME = np.arange(10.0, 15.0, 0.5)


def mapping(column="speed_t.npy", value="0", **time):
    return {
        "tables": {
            "speed": {
                "files": "speed_v.npy",
                "time": {"column": column, **time} if column else time,
                "signals": {"vehicle_speed": {"column": value, "unit": "kmh"}},
            }
        }
    }


def folder(path, values=None, time=TIME):
    np.save(path / "speed_v.npy", np.arange(10.0)[:, None] if values is None else values)
    np.save(path / "speed_t.npy", time)
    np.save(path / "other.npy", np.zeros(3))
    return path


def test_values_with_times_beside_them(tmp_path):
    speed = read_drive(folder(tmp_path), mapping()).signals["vehicle_speed"]
    assert_array_equal(speed.time, TIME)
    assert_allclose(speed.values, np.arange(10.0) / 3.6)


def test_a_flat_array_and_times_in_milliseconds(tmp_path):
    found = folder(tmp_path, np.arange(10, dtype=np.int16), 1000 * TIME[:, None])
    speed = read_drive(found, mapping(unit="ms", offset_s=1.0)).signals["vehicle_speed"]
    assert_allclose(speed.time, TIME + 1.0)


def test_time_in_a_column(tmp_path):
    found = folder(tmp_path, np.column_stack([np.arange(10.0), TIME]))
    assert_array_equal(read_drive(found, mapping("1")).signals["vehicle_speed"].time, TIME)


@pytest.mark.parametrize(
    ("change", "kind", "said"),
    [
        ({"column": "missing.npy"}, DriveError, "missing.npy"),
        ({"column": "other.npy"}, DriveError, "other.npy 3 speed_v.npy 10"),
        ({"column": None, "unit": "s"}, ConfigError, "[time]"),
        ({"value": "1"}, ConfigError, "speed_v.npy 0 1"),
        ({"value": "speed"}, ConfigError, "speed_v.npy 0 speed"),
        ({"column": "-1"}, ConfigError, "speed_v.npy 0 -1"),
    ],
)
def test_a_mapping_that_does_not_fit(tmp_path, change, kind, said):
    with error(kind, said):
        read_drive(folder(tmp_path), mapping(**change))


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (np.zeros((2, 2, 2)), "speed_v.npy 3"),
        (np.array(["a", "b"]), "speed_v.npy <U1"),
        (np.array(4.0), "speed_v.npy 0"),
    ],
)
def test_arrays_that_are_no_table(tmp_path, values, said):
    with error(DriveError, said):
        read_drive(folder(tmp_path, values), mapping())


def test_without_a_mapping_an_array_has_no_names(tmp_path):
    with error(DriveError, "speed_v.npy [time]"):
        read_drive(folder(tmp_path) / "speed_v.npy")


def test_objects_are_not_unpickled(tmp_path):
    np.save(folder(tmp_path) / "speed_v.npy", np.array([{}, {}]), allow_pickle=True)
    with error(DriveError, "speed_v.npy NumPy"):
        read_drive(tmp_path, mapping())


def test_a_header_that_promises_too_much(tmp_path):
    path = folder(tmp_path) / "speed_v.npy"
    data = path.read_bytes()
    path.write_bytes(data.replace(b"(10, 1)", b"(9" + b"9" * 9 + b", 1)", 1))
    with error(DriveError, "speed_v.npy NumPy"):
        read_drive(tmp_path, mapping())


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 208), st.binary(max_size=20), st.integers(0, 100))
def test_any_damage_leaves_signals_or_one_sentence(tmp_path_factory, at, junk, cut):
    found = folder(tmp_path_factory.mktemp("npy"))
    whole = (found / "speed_v.npy").read_bytes()
    (found / "speed_v.npy").write_bytes(whole[:at] + junk + whole[at + cut :])
    said = "one sentence"
    try:
        read_drive(found, mapping())
    except WeighbridgeError as e:
        said = str(e)
    assert len(said.splitlines()) == 1


def test_rows_at_a_rate_and_a_counter(tmp_path):
    speed = read_drive(folder(tmp_path), mapping(None, rate_hz=2.0)).signals["vehicle_speed"]
    assert_array_equal(speed.time, 0.5 * np.arange(10))
    found = folder(tmp_path, np.column_stack([np.arange(10.0), 7 + np.arange(10)]))
    speed = read_drive(found, mapping("1", rate_hz=2.0)).signals["vehicle_speed"]
    assert_array_equal(speed.time, 3.5 + 0.5 * np.arange(10))
