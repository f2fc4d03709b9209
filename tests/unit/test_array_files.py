"""MATLAB, HDF5 and TDMS: written by other libraries, drafted, read, damaged."""

import datetime as dt
import tomllib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.io import savemat
from tests.noted import error

from weighbridge import ConfigError, DriveError, MissingExtraError, read_drive
from weighbridge.io import channels, format_of, mapping_text

h5py = pytest.importorskip("h5py")
nptdms = pytest.importorskip("nptdms")
pytest.importorskip("pymatreader")

FAST = np.arange(500) * 0.01
SLOW = np.arange(50) * 0.1
SPEED = 20.0 + SLOW
ACCEL = 9.81 + np.sin(FAST)
START = dt.datetime(2026, 5, 1, 10, tzinfo=dt.UTC)


def write_mat5(path):
    savemat(
        path,
        {
            "imu": {"time": FAST, "acc_z": ACCEL, "acc_x": 0.1 + 0 * FAST, "acc_y": 0 * FAST},
            "can": {
                "t_ms": 1000 * SLOW,
                "vehicle_speed": {"Data": 3.6 * SPEED, "Units": "km/h"},
                "EngineSpeed": {"Data": 1500 + SLOW, "Units": "rpm"},
            },
            "comment": "a drive",
        },
        oned_as="column",
    )


def write_mat73(path):
    """Write arrays as MATLAB's version 7.3: HDF5 behind 512 bytes of text, columns first."""

    def put(group, name, values):
        data = group.create_dataset(name, data=np.atleast_2d(values).astype(float))
        data.attrs["MATLAB_class"] = np.bytes_("double")

    with h5py.File(path, "w", userblock_size=512) as file:
        imu = file.create_group("imu")
        imu.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in (("time", FAST), ("acc_x", 0.1 + 0 * FAST), ("acc_y", 0 * FAST)):
            put(imu, name, values)
        put(imu, "acc_z", ACCEL)
        put(file, "time", SLOW)
        put(file, "vehicle_speed_kmh", 3.6 * SPEED)
        put(file, "EngineSpeed_rpm", 1500 + SLOW)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def write_hdf5(path):
    with h5py.File(path, "w") as file:
        imu = file.create_group("imu")
        imu["timestamp"] = START.timestamp() + FAST
        imu["accel"] = np.stack([0.1 + 0 * FAST, 0 * FAST, ACCEL], axis=1)
        file["can/Time"] = ((START.timestamp() + SLOW) * 1e6).astype(np.int64)
        file["can/vehicle_speed"] = 3.6 * SPEED
        file["can/vehicle_speed"].attrs["unit"] = "km/h"
        table = np.zeros(50, [("EngineSpeed", "f8"), ("name", "S4")])
        table["EngineSpeed"] = 1500 + SLOW
        file["can/engine"] = table


def write_tdms(path):
    def wave(name, values, step, unit):
        properties = {
            "wf_start_time": START.replace(tzinfo=None),
            "wf_start_offset": 0.0,
            "wf_increment": step,
            "unit_string": unit,
        }
        return nptdms.ChannelObject("Messung", name, values, properties)

    with nptdms.TdmsWriter(path) as file:
        file.write_segment(
            [
                wave("vehicle_speed", 3.6 * SPEED, 0.1, "km/h"),
                wave("Engine Speed", 1500 + SLOW, 0.1, "rpm"),
                wave("Acc X", 0.1 + 0 * FAST, 0.01, "m/s²"),
                wave("Acc Y", 0 * FAST, 0.01, "m/s²"),
                wave("Acc Z", ACCEL, 0.01, "m/s²"),
            ]
        )


WRITERS = {
    "five.mat": write_mat5,
    "seven.mat": write_mat73,
    "log.h5": write_hdf5,
    "log.tdms": write_tdms,
}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arrays")
    for name, write in WRITERS.items():
        write(folder / name)
    return folder


def recording(path):
    return format_of(path).draft(path).columns


def mapped(path, tmp_path):
    mapping = tmp_path / "map.toml"
    mapping.write_text(mapping_text([format_of(path).draft(path)]), encoding="utf-8")
    return read_drive(path, mapping)


@pytest.mark.parametrize("name", ["five.mat", "seven.mat", "log.tdms"])
def test_from_file_to_signals(files, tmp_path, name):
    drive = mapped(files / name, tmp_path)
    speed, accel = drive.signals["vehicle_speed"], drive.signals["accel_z"]
    assert_allclose(speed.values, SPEED)
    assert_allclose(speed.time, SLOW, atol=1e-6)
    assert_allclose(accel.values, ACCEL)
    assert_allclose(accel.time, FAST, atol=1e-6)
    assert_allclose(drive.signals["engine_speed"].values, (1500 + SLOW) * np.pi / 30)


def test_hdf5_with_columns_tables_and_two_clocks(files, tmp_path):
    path = files / "log.h5"
    drive = read_drive(
        path,
        {
            "signals": {
                "accel_z": {"column": "imu/accel.2", "unit": "mps2"},
                "vehicle_speed": {"column": "VEHICLE_SPEED"},
                "engine_speed": {"column": "can/engine/EngineSpeed", "unit": "rpm"},
            }
        },
    )
    assert drive.info.start_time == START.isoformat()
    assert_allclose(drive.signals["accel_z"].values, ACCEL)
    assert_allclose(drive.signals["accel_z"].time, FAST, atol=1e-6)
    assert_allclose(drive.signals["vehicle_speed"].values, SPEED)
    assert_allclose(drive.signals["engine_speed"].time, SLOW, atol=1e-5)


def test_a_cut_tdms_is_read_without_a_word_on_the_terminal(files, tmp_path, caplog):
    path = tmp_path / "cut.tdms"
    path.write_bytes((files / "log.tdms").read_bytes()[:-40])
    assert read_drive(path).signals
    assert not [r for r in caplog.records if r.name.startswith("nptdms")]


def test_start_of_a_waveform_is_kept(files, tmp_path):
    assert mapped(files / "log.tdms", tmp_path).info.start_time == START.isoformat()


def test_columns_of_other_lengths_are_told(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"time_s": SLOW, "vehicle_speed_kmh": SPEED, "odd": np.ones(7)})
    drive = read_drive(path)
    assert_allclose(drive.signals["vehicle_speed"].values, SPEED / 3.6)
    assert drive.problems[0].id == "file.clockless"


def test_a_time_that_is_not_there_is_refused(files):
    mapping = {
        "time": {"column": "clock"},
        "signals": {"vehicle_speed": {"column": "VehicleSpeed"}},
    }
    with error(ConfigError, "five.mat [time] clock"):
        read_drive(files / "five.mat", mapping)
    mapping["time"] = {"column": "t_ms", "format": "iso"}
    with error(ConfigError, "five.mat MATLAB [time]"):
        read_drive(files / "five.mat", mapping)


def test_without_a_mapping_the_next_step_is_named(tmp_path):
    savemat(tmp_path / "a.mat", {"time": SLOW, "v": SPEED})
    with error(DriveError, "a.mat v"):
        read_drive(tmp_path / "a.mat")


@pytest.mark.parametrize("name", WRITERS)
def test_canonical_names_need_no_mapping(files, name):
    assert_allclose(read_drive(files / name).signals["vehicle_speed"].values, SPEED)


def test_hdf5_of_other_files_or_more_than_it_can_hold(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("speed", (10**12,), chunks=(1000,), dtype="f8", compression="gzip")
    with error(DriveError, "a.h5 speed 1000000000000 1400"):
        read_drive(tmp_path / "a.h5")
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file.create_dataset("speed", (10,), dtype="f8", external=[("/etc/passwd", 0, 80)])
    with error(DriveError, "b.h5 speed"):
        read_drive(tmp_path / "b.h5")


def test_what_unpacks_out_of_proportion_is_refused_before(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for k in range(80):
            # Never written: 100 kB of index at most, 16 MB of zeros each.
            file.create_dataset(f"s{k}", (2 << 20,), chunks=(1 << 16,), dtype="f8")
        file.create_dataset("own", data=np.zeros(20_000))
    with error(DriveError, "a.h5 1 GB"):
        read_drive(tmp_path / "a.h5")
    with h5py.File(tmp_path / "b.mat", "w", userblock_size=512) as file:
        file.create_dataset("x", (1 << 28,), chunks=(1 << 20,), dtype="f8", compression="gzip")
    with (tmp_path / "b.mat").open("r+b") as file:
        head = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
        file.write(head)
    with error(DriveError, "b.mat 2147483648 1 GB"):
        read_drive(tmp_path / "b.mat")


def test_a_deflated_matrix_is_counted_before_it_is_read(tmp_path, monkeypatch):
    path = tmp_path / "c.mat"
    savemat(path, {"time": FAST, "acc_x": ACCEL, "x": np.zeros(1 << 20)}, do_compression=True)
    assert path.stat().st_size < 1 << 17
    assert recording(path)
    monkeypatch.setattr(channels, "_MOST_UNPACKED", 1 << 20)
    with error(DriveError, "c.mat 1 GB"):
        recording(path)


@pytest.mark.parametrize(
    ("name", "package", "extra"),
    [
        ("five.mat", "pymatreader", "mat"),
        ("log.h5", "h5py", "hdf5"),
        ("log.tdms", "nptdms", "tdms"),
    ],
)
def test_missing_package_names_the_extra(files, monkeypatch, name, package, extra):
    monkeypatch.setitem(__import__("sys").modules, package, None)
    with pytest.raises(MissingExtraError, match=rf"weighbridge\[{extra}\]"):
        read_drive(files / name)


@pytest.mark.parametrize("name", WRITERS)
@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(part=st.floats(0.0, 1.0), at=st.floats(0.0, 1.0), junk=st.binary(min_size=0, max_size=16))
def test_damage_leaves_signals_or_one_sentence(files, assert_damage_is_told, name, part, at, junk):
    assert_damage_is_told(name, (files / name).read_bytes(), part, at, junk)


def test_arrays_without_a_time_are_read_by_a_rate(tmp_path):
    path = tmp_path / "drive.mat"
    savemat(path, {"speed": 3.6 * SPEED, "n": 7.0 + np.arange(SLOW.size)}, oned_as="column")
    signals = {"vehicle_speed": {"column": "speed", "unit": "kmh"}}
    with pytest.raises(DriveError, match="no channels"):
        read_drive(path, {"signals": signals})
    for time, start in (({"rate_hz": 10.0}, 0.0), ({"rate_hz": 10.0, "column": "n"}, 0.7)):
        speed = read_drive(path, {"time": time, "signals": signals}).signals["vehicle_speed"]
        assert_allclose(speed.time, start + SLOW)
        assert_allclose(speed.values, SPEED)


@pytest.mark.parametrize("even", [False, True])
def test_a_recording_of_dspace(tmp_path, even):
    """Clocks in X, signals in Y with the number of theirs, as ControlDesk exports them."""
    path = tmp_path / "exp.mat"
    other = SLOW if even else FAST

    def array(elements):
        kind = [(name, object) for name in elements[0]]
        return np.array([tuple(e.values()) for e in elements], dtype=kind).reshape(1, -1)

    clocks = [
        {"Name": "Slow", "Data": SLOW, "Unit": "s"},
        {"Name": "Fast", "Data": other, "Unit": "s"},
    ]
    signals = [
        {"Name": "VehicleSpeed", "Data": 3.6 * SPEED, "Unit": "km/h", "XIndex": 1},
        {"Name": "EngineSpeed", "Data": 900.0 + np.arange(other.size), "Unit": "rpm", "XIndex": 2},
    ]
    savemat(path, {"exp": {"X": array(clocks), "Y": array(signals), "Description": "a drive"}})
    found = format_of(path).draft(path)
    drive = read_drive(path, tomllib.loads(mapping_text([found])))
    assert_allclose(drive.signals["vehicle_speed"].time, SLOW)
    assert_allclose(drive.signals["vehicle_speed"].values, SPEED)
    assert_allclose(drive.signals["engine_speed"].time, other)
