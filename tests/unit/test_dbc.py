"""The columns taken out with numpy are those cantools decodes frame by frame."""

import cantools
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from test_frames import make
from tests.noted import error

from weighbridge import ConfigError
from weighbridge.io import load_dbcs
from weighbridge.io.dbc import Found, find_signal, message_frames, physical


def text(*messages):
    return 'VERSION ""\nBS_:\nBU_:\n' + "\n".join(messages) + "\n"


def write(folder, *messages, name="a.dbc"):
    path = folder / name
    path.write_text(text(*messages))
    return path


def test_bits_of_every_place_order_and_sign(tmp_path):
    rng = np.random.default_rng(5)
    contents = [bytes(row) for row in rng.integers(0, 256, (20, 8), dtype=np.uint8)]
    frames = make(np.arange(20.0), 0x10, contents)
    for k in range(150):
        length = int(rng.integers(1, 65))
        place = int(rng.integers(0, 65 - length))
        big, sign = k % 2, "-+"[k // 2 % 2]
        start = 8 * (place // 8) + 7 - place % 8 if big else place
        row = f' SG_ S : {start}|{length}@{1 - big}{sign} (0.25,-3) [0|0] "" X'
        path = write(tmp_path, f"BO_ 16 M: 8 X\n{row}")
        (database,) = load_dbcs([path])
        values, at = physical(
            frames, find_signal("S", [database], [message_frames(frames, database)])[0]
        )
        reference = cantools.database.load_file(path)
        expected = [reference.decode_message(16, c)["S"] for c in contents]
        assert_allclose(values, expected, rtol=1e-15)
        assert_array_equal(at, np.arange(20))


def test_floats(tmp_path):
    path = write(
        tmp_path,
        'BO_ 16 M: 8 X\n SG_ S : 0|32@1- (1,0) [0|0] "" X\n SG_ T : 39|32@0- (2,0) [0|0] "" X',
        "SIG_VALTYPE_ 16 S : 1;\nSIG_VALTYPE_ 16 T : 1;",
    )
    content = np.array([1.5], "<f4").tobytes() + np.array([-2.25], ">f4").tobytes()
    frames = make([0.0], 0x10, [content])
    (database,) = load_dbcs([path])
    carried = [message_frames(frames, database)]
    got = [physical(frames, find_signal(n, [database], carried)[0])[0][0] for n in "ST"]
    assert got == [1.5, -4.5]


def test_multiplexers_within_multiplexers(tmp_path):
    path = write(
        tmp_path,
        "BO_ 16 M: 8 X\n"
        ' SG_ Outer M : 0|4@1+ (1,0) [0|0] "" X\n'
        ' SG_ Inner m1M : 4|4@1+ (1,0) [0|0] "" X\n'
        ' SG_ Deep m2 : 8|8@1+ (1,0) [0|0] "" X\n'
        ' SG_ Flat m0 : 8|8@1+ (1,0) [0|0] "" X',
        "SG_MUL_VAL_ 16 Inner Outer 1-1;\nSG_MUL_VAL_ 16 Deep Inner 2-3;\n"
        "SG_MUL_VAL_ 16 Flat Outer 0-0;",
    )
    heads = [0x00, 0x01, 0x21, 0x31, 0x20, 0x22]
    frames = make(
        np.arange(6.0), 0x10, [bytes([h, 10 + k]) + bytes(6) for k, h in enumerate(heads)]
    )
    (database,) = load_dbcs([path])
    carried = [message_frames(frames, database)]
    deep, at = physical(frames, find_signal("Deep", [database], carried)[0])
    assert_array_equal(deep, [12, 13])
    assert_array_equal(at, [2, 3])
    assert_array_equal(physical(frames, find_signal("Flat", [database], carried)[0])[0], [10, 14])


def test_short_frames_carry_no_value(tmp_path):
    path = write(tmp_path, 'BO_ 16 M: 8 X\n SG_ S : 8|16@1+ (1,0) [0|0] "" X')
    frames = make([0.0, 1.0], 0x10, [b"\1\2", b"\1\2\3"])
    (database,) = load_dbcs([path])
    found = find_signal("M.S", [database], [message_frames(frames, database)])[0]
    assert_array_equal(physical(frames, found)[1], [1])


def test_identifiers_of_11_and_29_bits_are_apart(tmp_path):
    path = write(
        tmp_path,
        'BO_ 16 A: 8 X\n SG_ S : 0|8@1+ (1,0) [0|0] "" X',
        'BO_ 2147483664 B: 8 X\n SG_ S : 0|8@1+ (1,0) [0|0] "" X',
    )
    frames = make([0.0, 1.0], 0x10, [b"\1", b"\2"], extended=True)
    (database,) = load_dbcs([path])
    assert list(message_frames(frames, database)) == ["B"]
    both = find_signal("S", [database], [{"A": np.array([0]), "B": np.array([1])}])
    assert [f.message.name for f in both] == ["A", "B"]
    assert isinstance(both[0], Found)


def test_j1939_message_is_known_whoever_sends_it(tmp_path):
    path = write(
        tmp_path,
        'BO_ 2566844926 CCVS: 8 X\n SG_ Speed : 8|16@1+ (0.00390625,0) [0|250] "km/h" X',
        'BA_DEF_ "ProtocolType" STRING ;\nBA_DEF_DEF_ "ProtocolType" "";\n'
        'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'
        'BA_DEF_DEF_ "VFrameFormat" "";\nBA_ "VFrameFormat" BO_ 2566844926 3;\n'
        'BA_ "ProtocolType" "J1939";',
    )
    contents = [bytes([0, 0, 50]) + bytes(5), b"\xff" * 8, bytes([0, 0, 251]) + bytes(5)]
    frames = make(np.arange(3.0), 0x0CFEF127, contents, extended=True)
    (database,) = load_dbcs([path])
    carried = message_frames(frames, database)
    assert list(carried) == ["CCVS"]
    # From 0xFB00 on the sender says that it has no value.
    values, at = physical(frames, find_signal("Speed", [database], [carried])[0])
    assert_array_equal(values, [50.0])
    assert_array_equal(at, [0])


def test_files_that_are_no_dbc_are_refused(tmp_path):
    with error(ConfigError, "--dbc none.dbc"):
        load_dbcs([tmp_path / "none.dbc"])
    (tmp_path / "bad.dbc").write_text("this is no DBC")
    with error(ConfigError, "--dbc bad.dbc"):
        load_dbcs([tmp_path / "bad.dbc"])
    assert load_dbcs([f"3:{write(tmp_path, 'BO_ 16 M: 8 X')}"])[0].channel == 3


def one(tmp_path, signal, raw, *more):
    """Values of one signal of a DBC, of these raw ones in 16 bits."""
    path = write(tmp_path, f"BO_ 16 M: 8 X\n SG_ S : 0|16@1+ {signal} X\n", *more)
    (database,) = load_dbcs([path])
    frames = make(np.arange(float(len(raw))), 0x10, [int(r).to_bytes(2, "little") for r in raw])
    carried = [message_frames(frames, database)]
    return physical(frames, find_signal("S", [database], carried)[0])[0]


@pytest.mark.parametrize("text", ["SNA", "Signal_not_available", "Fehler", "Init", "invalid value"])
def test_a_value_that_is_named_none_is_none(tmp_path, text):
    named = f'VAL_ 16 S 700 "{text}" 0 "standing" 1 "no error" ;\n'
    values = one(tmp_path, '(0.5,0) [0|0] "km/h"', [0, 1, 700, 3], named)
    assert_array_equal(values, [0.0, 0.5, np.nan, 1.5])


def test_a_value_beyond_the_declared_range_is_none(tmp_path):
    raw = [0, 200, 400, 401, 402, 65534, 65535]
    values = one(tmp_path, '(0.5,-10) [-10|190] "rpm"', raw)
    assert_array_equal(values, [-10.0, 90.0, 190.0, *[np.nan] * 4])


def test_a_range_that_most_values_leave_is_not_believed(tmp_path):
    raw = [*range(100, 200), 65535]
    values = one(tmp_path, '(0.5,0) [0|20] "km/h"', raw)
    assert_array_equal(values, [*(0.5 * np.arange(100, 200)), np.nan])


@pytest.mark.parametrize(
    "wrong",
    [
        'VAL_ 17 Other 1 "Open" 0 "Closed" ;\n',
        'VAL_ 16 T 1 "a; b" ;\n',
        "SIG_VALTYPE_ 99 Foo : 1;\n",
        'BA_ "Unknown" 5;\n',
    ],
)
def test_a_statement_about_nothing_is_left_out_and_told(tmp_path, wrong):
    path = write(tmp_path, f'BO_ 16 M: 8 X\n SG_ S : 0|16@1+ (1,0) [0|9] "" X\n\n{wrong}')
    (database,) = load_dbcs([path])
    assert [m.name for m in database.messages] == ["M"]
    (note,) = database.notes
    assert note.id == "bus.dbc_part"
    assert "line 7" in note.text
