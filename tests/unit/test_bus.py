import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_dbc import write
from test_frames import make
from tests.noted import error, refused, says

from weighbridge import ConfigError
from weighbridge.io import load_dbcs, load_mapping
from weighbridge.io.bus import decode
from weighbridge.io.frames import Frames, join_frames


def obd_speed(count, period):
    return make(period * np.arange(count), 0x7E8, [bytes([3, 0x41, 0x0D, 50, 0, 0, 0, 0])] * count)


def truck(count, period):
    time = period * np.arange(count) + 0.003
    ccvs = make(time, 0x18FEF100, [bytes([0, 0, 60, 0, 0, 0, 0, 0])] * count, extended=True)
    eec1 = make(time, 0x0CF00400, [bytes([0, 0, 0, 0, 32, 0, 0, 0])] * count, extended=True)
    return join_frames([ccvs, eec1])


@pytest.mark.parametrize(("answers", "broadcasts", "expected"), [(20, 100, 60.0), (100, 20, 50.0)])
def test_of_two_protocols_the_fuller_one_stays(answers, broadcasts, expected):
    frames = join_frames([obd_speed(answers, 10 / answers), truck(broadcasts, 10 / broadcasts)])
    done = decode(frames, "x.log", None, ())
    assert_allclose(done.signals["vehicle_speed"].values, expected / 3.6)
    assert len(done.signals["vehicle_speed"]) == 100
    assert done.problems[-1].id == "bus.twice"
    assert done.problems[-1].values["few"] == 20
    assert done.problems[-1].values["many"] == 100


def test_message_on_two_buses_is_taken_from_one(tmp_path):
    path = write(tmp_path, 'BO_ 16 M: 8 X\n SG_ S : 0|8@1+ (1,0) [0|0] "km/h" X')
    mapping = load_mapping({"signals": {"vehicle_speed": {"column": "S"}}})[0]
    one = make(np.arange(30.0), 0x10, [b"\x24" + bytes(7)] * 30, channel=1)
    two = make(np.arange(20.0) + 0.5, 0x10, [b"\x48" + bytes(7)] * 20, channel=2)
    done = decode(join_frames([one, two]), "x.log", mapping, load_dbcs([path]))
    assert_allclose(done.signals["vehicle_speed"].values, 10.0)
    assert done.problems[0].id == "bus.several_buses"
    assert done.problems[0].values["bus"] == 1
    done = decode(join_frames([one, two]), "x.log", mapping, load_dbcs([f"2:{path}"]))
    assert_allclose(done.signals["vehicle_speed"].values, 20.0)


def test_signal_of_two_messages_must_be_named_with_its_message(tmp_path):
    signal = ' SG_ S : 0|8@1+ (1,0) [0|0] "km/h" X'
    path = write(tmp_path, f"BO_ 16 A: 8 X\n{signal}", f"BO_ 17 B: 8 X\n{signal}")
    frames = join_frames([make(np.arange(3.0), 0x10), make(np.arange(3.0), 0x11)])
    for column in ("S", "B.S"):
        mapping = load_mapping({"signals": {"vehicle_speed": {"column": column}}})[0]
        if column == "S":
            with error(ConfigError, "vehicle_speed S A.S B.S"):
                decode(frames, "x.log", mapping, load_dbcs([path]))
        else:
            assert len(decode(frames, "x.log", mapping, load_dbcs([path])).signals) == 1


def test_canonical_names_in_a_dbc_need_no_mapping(tmp_path):
    path = write(tmp_path, 'BO_ 16 M: 8 X\n SG_ engine_speed_rpm : 0|8@1+ (10,0) [0|0] "" X')
    frames = make(np.arange(3.0), 0x10, [b"\x5a" + bytes(7)] * 3)
    done = decode(frames, "x.log", None, load_dbcs([path]))
    assert_allclose(done.signals["engine_speed"].values, 900 * np.pi / 30)


def test_mapping_without_its_dbc_is_told():
    mapping = load_mapping({"signals": {"accel_x": {"column": "AccX", "unit": "mps2"}}})[0]
    done = decode(obd_speed(20, 0.5), "x.log", mapping, ())
    assert list(done.signals) == ["vehicle_speed"]
    (problem,) = done.lacking
    assert problem.signal == "accel_x"
    assert problem.serious
    assert problem.id == "file.column_missing"


@pytest.mark.parametrize(
    ("bus", "id", "values"),
    [
        ("", "message_not_in_log", {"message": "M"}),
        ("2:", "on_other_bus", {"bus": 2}),
    ],
)
def test_why_a_signal_of_a_dbc_is_not_there(tmp_path, bus, id, values):
    signal = ' SG_ S : 0|8@1+ (1,0) [0|0] "km/h" X'
    path = write(tmp_path, f"BO_ 16 M: 8 X\n{signal}", "BO_ 17 Other: 8 X")
    mapping = load_mapping({"signals": {"vehicle_speed": {"column": "S"}}})[0]
    frames = join_frames([obd_speed(20, 0.5), make(np.arange(9.0), 0x11, channel=1)])
    done = decode(frames, "x.log", mapping, load_dbcs([f"{bus}{path}"]))
    told = done.lacking[0].text
    assert says(told, id, **values)
    assert path.name in told
    assert says(told, "on_other_bus", remedy=f"1:{path.name}") == bool(bus)
    assert says(told, "none_in_log", messages="2 messages", database=path.name) == bool(bus)


def test_dbc_of_another_vehicle_is_told(tmp_path):
    path = write(tmp_path, 'BO_ 18 M: 8 X\n SG_ S : 0|8@1+ (1,0) [0|0] "km/h" X')
    mapping = load_mapping({"signals": {"gnss_speed": {"column": "S"}}})[0]
    done = decode(obd_speed(20, 0.5), "x.log", mapping, load_dbcs([f"1:{path}"]))
    assert says(done.lacking[0].text, "of_another_vehicle")
    assert says(done.problems[0].text, "of_another_vehicle")


def test_dbc_without_a_mapping_names_what_it_has(tmp_path):
    path = write(tmp_path, 'BO_ 16 M: 8 X\n SG_ Speedy : 0|8@1+ (1,0) [0|0] "km/h" X')
    frames = join_frames([obd_speed(20, 0.5), make(np.arange(9.0), 0x10)])
    done = decode(frames, "x.log", None, load_dbcs([path]))
    assert done.problems[0].id == "bus.no_names"
    assert any(line.endswith("not used: M (9): Speedy") for line in done.contents)


def test_nothing_known_and_nothing_at_all_are_told():
    with refused("bus.unknown", frames="3 frames: CAN 1 123 (3)"):
        decode(make(np.arange(3.0), 0x123), "x.log", None, ())
    with refused("bus.no_frames"):
        decode(Frames.empty(), "x.log", None, ())
