"""MCAP and ROS bags, written by the libraries of the formats."""

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from weighbridge.errors import DriveError, MissingExtraError
from weighbridge.io import read_drive
from weighbridge.io.formats import format_of
from weighbridge.io.mapping import TimeColumn
from weighbridge.io.messages import open_bag

mcap = pytest.importorskip("mcap.writer")
rosbag1 = pytest.importorskip("rosbags.rosbag1")
rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

STORE = {
    1: typesys.get_typestore(typesys.Stores.ROS1_NOETIC),
    2: typesys.get_typestore(typesys.Stores.ROS2_HUMBLE),
}
START = 1_777_629_600
TIME = START + np.arange(100) * 0.1
LATE = 0.02
MAPPING = {"signals": {"vehicle_speed": {"column": "/car/speed.data", "unit": "kmh"}}}


def message(store, kind, t, k):
    """One message of a type, as its store makes it, stamped with the time of measuring."""
    types = store.types
    sec, part = divmod(t, 1.0)
    stamp = types["builtin_interfaces/msg/Time"](int(sec), round(part * 1e9))
    header = types["std_msgs/msg/Header"]
    seq = (k,) if len(header.__dataclass_fields__) > 3 else ()
    head = header(*seq, stamp, "imu")
    vector = types["geometry_msgs/msg/Vector3"]
    none = np.zeros(9)
    turning = np.zeros(9)
    match kind:
        case "sensor_msgs/msg/Imu":
            turn = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
            return types[kind](
                head, turn, none, vector(0.0, 0.0, 0.1), turning, vector(0.1, 0.2, 9.8 + k), none
            )
        case "sensor_msgs/msg/NavSatFix":
            fix = types["sensor_msgs/msg/NavSatStatus"](-1 if k < 10 else 0, 1)
            return types[kind](head, fix, 47.0 + 1e-5 * k, 11.0, 500.0, none, 0)
        case "geometry_msgs/msg/TwistStamped":
            twist = types["geometry_msgs/msg/Twist"](vector(10.0, 0.0, 0.0), vector(0.0, 0.0, 0.0))
            return types[kind](head, twist)
        case "std_msgs/msg/Float64":
            return types[kind](36.0 + k)
        case _:
            return types[kind](head, 2, 2, "mono8", 0, 2, np.zeros(4, np.uint8))


TOPICS = {
    "/imu/data": "sensor_msgs/msg/Imu",
    "/gps/fix": "sensor_msgs/msg/NavSatFix",
    "/car/twist": "geometry_msgs/msg/TwistStamped",
    "/car/speed": "std_msgs/msg/Float64",
    "/camera": "sensor_msgs/msg/Image",
}


def logged(t):
    return round((t + LATE) * 1e9)


def write_mcap(path, version):
    store = STORE[version]
    with path.open("wb") as file:
        writer = mcap.Writer(file, chunk_size=4096)
        writer.start("ros1" if version == 1 else "ros2")
        channels = {}
        for topic, kind in TOPICS.items():
            text, _ = store.generate_msgdef(kind, ros_version=version)
            name = kind.replace("/msg/", "/") if version == 1 else kind
            schema = writer.register_schema(name, f"ros{version}msg", text.encode())
            encoding = "ros1" if version == 1 else "cdr"
            channels[topic] = writer.register_channel(topic, encoding, schema)
        dump = store.serialize_ros1 if version == 1 else store.serialize_cdr
        for k, t in enumerate(TIME):
            for topic, kind in TOPICS.items():
                data = bytes(dump(message(store, kind, t, k), kind))
                writer.add_message(channels[topic], logged(t), data, logged(t))
        writer.finish()


def write_bag(path):
    with rosbag1.Writer(path) as bag:
        links = {n: bag.add_connection(n, k, typestore=STORE[1]) for n, k in TOPICS.items()}
        for k, t in enumerate(TIME):
            for topic, kind in TOPICS.items():
                data = STORE[1].serialize_ros1(message(STORE[1], kind, t, k), kind)
                bag.write(links[topic], logged(t), data)


def write_db3(folder):
    with rosbag2.Writer(folder, version=9) as bag:
        links = {n: bag.add_connection(n, k, typestore=STORE[2]) for n, k in TOPICS.items()}
        for k, t in enumerate(TIME):
            for topic, kind in TOPICS.items():
                data = STORE[2].serialize_cdr(message(STORE[2], kind, t, k), kind)
                bag.write(links[topic], logged(t), data)
    return next(folder.glob("*.db3"))


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bags")
    write_mcap(folder / "one.mcap", 1)
    write_mcap(folder / "two.mcap", 2)
    write_bag(folder / "one.bag")
    write_db3(folder / "two").rename(folder / "two.db3")
    return folder


NAMES = ("one.mcap", "two.mcap", "one.bag", "two.db3")


@pytest.mark.parametrize("name", NAMES)
def test_what_was_written_is_read(files, name):
    drive = read_drive(files / name, MAPPING)
    accel = drive.signals["accel_z"]
    assert_allclose(accel.values, 9.8 + np.arange(100))
    # Stamped when it was measured, not when it was logged; the drive counts from a full second.
    assert_allclose(accel.time, TIME - START, atol=1e-6)
    assert_allclose(drive.signals["gyro_z"].values, 0.1)
    # Without a fix there is no position.
    assert_allclose(np.degrees(drive.signals["latitude"].values), 47.0 + 1e-5 * np.arange(10, 100))
    assert_allclose(drive.signals["vehicle_speed"].values, (36.0 + np.arange(100)) / 3.6)
    assert_allclose(drive.signals["vehicle_speed"].time, TIME - START + LATE, atol=1e-6)
    assert drive.info.start_time == "2026-05-01T10:00:00+00:00"
    assert not any("/camera" in p.text for p in drive.problems)


@pytest.mark.parametrize("name", NAMES)
def test_without_a_mapping_sensors_are_read_and_the_rest_is_told(files, name):
    drive = read_drive(files / name)
    assert drive.has("accel_x", "gyro_x", "latitude")
    assert "'/car/twist.twist.linear.x'" in " ".join(p.text for p in drive.problems)
    draft = format_of(files / name).draft(files / name)
    assert [c.quantity for c in draft.known] == ["vehicle_speed"]


def test_units_of_ros_are_known(files):
    mapping = {"signals": {"vehicle_speed": {"column": "linear.x"}}}
    assert read_drive(files / "two.mcap", mapping).signals["vehicle_speed"].values[0] == 10.0


def test_what_an_imu_does_not_measure_is_left_out(tmp_path):
    store = STORE[2]
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = mcap.Writer(file)
        writer.start("ros2")
        kind = "sensor_msgs/msg/Imu"
        text, _ = store.generate_msgdef(kind, ros_version=2)
        channel = writer.register_channel(
            "/imu", "cdr", writer.register_schema(kind, "ros2msg", text.encode())
        )
        for k, t in enumerate(TIME):
            imu = message(store, kind, t, k)
            imu.angular_velocity_covariance[0] = -1.0
            writer.add_message(channel, logged(t), bytes(store.serialize_cdr(imu, kind)), 0)
        writer.finish()
    drive = read_drive(tmp_path / "a.mcap")
    assert drive.has("accel_x")
    assert not drive.has("gyro_x")


def test_json_of_foxglove(tmp_path):
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = mcap.Writer(file)
        writer.start()
        schema = writer.register_schema("foxglove.LocationFix", "jsonschema", b"{}")
        fix = writer.register_channel("/fix", "json", schema)
        car = writer.register_channel(
            "/car", "json", writer.register_schema("Car", "jsonschema", b"{}")
        )
        for k, t in enumerate(TIME):
            stamp = {"sec": int(t), "nsec": round(t % 1 * 1e9)}
            place = {
                "timestamp": stamp,
                "latitude": 47 + 1e-5 * k,
                "longitude": 11.0,
                "altitude": 5,
            }
            writer.add_message(fix, logged(t), json.dumps(place).encode(), logged(t))
            speed = {"state": {"v": 10.0 + k, "name": "x"}}
            writer.add_message(car, logged(t), json.dumps(speed).encode(), logged(t))
        writer.finish()
    mapping = {"signals": {"vehicle_speed": {"column": "/car.state.v", "unit": "mps"}}}
    drive = read_drive(tmp_path / "a.mcap", mapping)
    assert_allclose(drive.signals["vehicle_speed"].values, 10.0 + np.arange(100))
    assert_allclose(drive.signals["altitude"].time, TIME - START, atol=1e-6)


def json_and(path, name, text, stamp=None, **how):
    """Write 100 JSON messages, and before each of them one of a ROS 2 type."""
    with path.open("wb") as file:
        writer = mcap.Writer(file, **how)
        writer.start()
        other = writer.register_channel(
            "/other", "cdr", writer.register_schema(name, "ros2msg", text.encode())
        )
        car = writer.register_channel("/car", "json", writer.register_schema("Car", "", b""))
        for k, t in enumerate(TIME):
            writer.add_message(other, logged(t), b"\0\1\0\0" + bytes(8), logged(t))
            speed = {"vehicle_speed_mps": 10.0 + k}
            if stamp is not None:
                speed["timestamp"] = {"sec": int(t + stamp), "nsec": 0}
            writer.add_message(car, logged(t), json.dumps(speed).encode(), logged(t))
        writer.finish()


def told(drive):
    return " ".join(p.text for p in drive.problems)


def test_one_definition_that_cannot_be_parsed_costs_its_topic_alone(tmp_path):
    json_and(tmp_path / "a.mcap", "pkg/msg/Bad", "this is ( no definition\n")
    drive = read_drive(tmp_path / "a.mcap")
    assert_allclose(drive.signals["vehicle_speed"].values, 10.0 + np.arange(100))
    assert "topic '/other' cannot be decoded" in told(drive)


@pytest.mark.parametrize("leaf", ["float64 x", "string x"])
def test_types_nested_deep_do_not_multiply(tmp_path, leaf):
    parts = ["\n".join(f"T0 f{k}" for k in range(30))]
    for depth in range(8):
        below = "\n".join(f"T{depth + 1} f{k}" for k in range(30)) if depth < 7 else leaf
        parts.append(f"{'=' * 80}\nMSG: pkg/T{depth}\n{below}")
    json_and(tmp_path / "a.mcap", "pkg/msg/Top", "\n".join(parts) + "\n")
    drive = read_drive(tmp_path / "a.mcap")
    assert len(drive.signals["vehicle_speed"]) == 100
    # 64 fields are the most that are read of a message.
    assert "/other" not in told(drive)


def test_stamps_far_from_the_recorder_are_not_used_and_told(tmp_path):
    json_and(tmp_path / "near.mcap", "pkg/msg/A", "float64 x\n", stamp=-2.0)
    assert "stamps of" not in told(read_drive(tmp_path / "near.mcap"))
    json_and(tmp_path / "far.mcap", "pkg/msg/A", "float64 x\n", stamp=-20.0)
    drive = read_drive(tmp_path / "far.mcap")
    assert "stamps of '/car' are not all within 5 s" in told(drive)
    assert drive.info.start_time == "2026-05-01T10:00:00+00:00"


@pytest.mark.parametrize("packing", ["ZSTD", "LZ4", "NONE"])
def test_chunks_are_unpacked_and_bombs_refused_before(tmp_path, packing):
    path = tmp_path / "a.mcap"
    how = getattr(mcap.CompressionType, packing)
    json_and(path, "pkg/msg/A", "float64 x\n", compression=how, chunk_size=2048)
    assert len(read_drive(path).signals["vehicle_speed"]) == 100
    data = bytearray(path.read_bytes())
    at = 8
    while data[at] != 6:
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    size = at + 9 + 16
    honest = int.from_bytes(data[size : size + 8], "little")
    data[size : size + 8] = (2 << 30).to_bytes(8, "little")
    path.write_bytes(data)
    with pytest.raises(DriveError, match="more than 1 GB"):
        read_drive(path)
    # A chunk that says less than it has is not unpacked beyond that.
    data[size : size + 8] = (honest // 2).to_bytes(8, "little")
    path.write_bytes(data)
    drive = read_drive(path)
    assert 2 <= len(drive.signals["vehicle_speed"]) < 100
    assert "unpacks to another size than it says" in told(drive)


def test_a_recording_that_broke_off_is_read_to_there(files, tmp_path):
    whole = (files / "two.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    drive = read_drive(tmp_path / "cut.mcap", MAPPING)
    assert 20 < len(drive.signals["accel_z"]) < 80
    assert "the file breaks off" in " ".join(p.text for p in drive.problems)


@pytest.mark.parametrize(
    ("name", "package"), [("two.mcap", "mcap"), ("one.bag", "rosbags.rosbag1")]
)
def test_missing_package_names_the_extra(files, monkeypatch, name, package):
    monkeypatch.setitem(__import__("sys").modules, package, None)
    with pytest.raises(MissingExtraError, match=r"weighbridge\[ros\]"):
        read_drive(files / name)


@pytest.mark.parametrize("name", NAMES)
def test_no_recording_is_one_sentence(tmp_path, name):
    (tmp_path / name).write_bytes(b"nothing")
    with pytest.raises(DriveError, match="with messages that can be read"):
        read_drive(tmp_path / name)


@pytest.mark.parametrize("name", NAMES)
@settings(
    max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(part=st.floats(0.0, 1.0), at=st.floats(0.0, 1.0), junk=st.binary(min_size=0, max_size=16))
def test_damage_leaves_signals_or_one_sentence(files, assert_damage_is_told, name, part, at, junk):
    assert_damage_is_told(name, (files / name).read_bytes(), part, at, junk)


@pytest.mark.parametrize("packing", ["BZ2", "LZ4"])
def test_packed_bags_have_a_budget(tmp_path, monkeypatch, packing):
    path, kind, store = tmp_path / "one.bag", "std_msgs/msg/Float64", STORE[1]
    bag = rosbag1.Writer(path)
    bag.set_compression(bag.CompressionFormat[packing])
    data = store.serialize_ros1(store.types[kind](0.5), kind)
    with bag:
        link = bag.add_connection("/speed", kind, typestore=store)
        for k in range(2000):
            bag.write(link, 1_700_000_000_000_000_000 + k * 10_000_000, data)
    assert [c.name for c in open_bag(path, TimeColumn()).channels] == ["/speed.data"]
    monkeypatch.setattr("weighbridge.io.channels._MOST_UNPACKED", 8_000)
    monkeypatch.setattr("weighbridge.io.channels._MOST_TIMES", 0)
    with pytest.raises(DriveError, match="more than 1 GB"):
        open_bag(path, TimeColumn())
