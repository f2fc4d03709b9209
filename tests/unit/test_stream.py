"""Traffic decoded part by part is what the same traffic decoded at once is."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.unit.test_j1939 import frames

from weighbridge import ConfigError
from weighbridge.io import DbcStream, J1939Stream, ObdStream, load_dbcs, load_mapping
from weighbridge.io.bus import decode
from weighbridge.io.frame_text import read_candump
from weighbridge.io.j1939 import SPNS, decode_j1939

GOLDEN = Path(__file__).parents[1] / "golden"
MAPPING = {
    "signals": {
        "accel_x": {"column": "Sensor.Forward", "valid": "Valid"},
        "accel_y": {"column": "Lateral", "valid": "Valid"},
        "altitude": {"column": "Height"},
    }
}


def in_parts(stream, traffic, sizes):
    """Samples of a stream that is given traffic in parts."""
    samples = {}
    begin = 0
    k = 0
    while begin < len(traffic):
        end = begin + sizes[k % len(sizes)]
        k += 1
        for name, (times, values) in stream.step(traffic.select(slice(begin, end))).items():
            have = samples.setdefault(name, ([], []))
            have[0].extend(times)
            have[1].extend(values)
        begin = end
    return {name: (np.array(t), np.array(v)) for name, (t, v) in samples.items()}


@pytest.fixture(scope="module")
def traffic():
    return read_candump(GOLDEN / "can.log", None, None).frames


@pytest.mark.parametrize("sizes", [(1,), (2, 3, 7), (1000,)])
def test_databases_and_answers(traffic, sizes):
    databases = load_dbcs([GOLDEN / "golden.dbc"])
    (mapping,) = load_mapping(MAPPING)
    whole = decode(traffic, "can.log", mapping, databases).signals
    found = in_parts(ObdStream(), traffic, sizes)
    found |= in_parts(DbcStream(databases, mapping, "can:x"), traffic, sizes)
    assert found.keys() == whole.keys()
    for name, signal in whole.items():
        time, values = found[name]
        # Before the engine answers for the first time, another control unit may have.
        more = time.size - len(signal)
        assert more in ((0, 1) if sizes == (1,) and name in ("throttle", "vehicle_speed") else (0,))
        assert_array_equal(time[more:], signal.time)
        assert_allclose(values[more:], signal.values, rtol=1e-12)


def test_filters_pass_what_is_decoded(traffic):
    databases = load_dbcs([GOLDEN / "golden.dbc"])
    (mapping,) = load_mapping(MAPPING)
    for stream in (ObdStream(), DbcStream(databases, mapping, "can:x")):
        wanted = np.zeros(len(traffic), bool)
        for identifier, mask, extended in stream.filters():
            wanted |= (traffic.extended == extended) & ((traffic.id & mask) == (identifier & mask))
        assert 0 < np.count_nonzero(wanted) < len(traffic)
        some = in_parts(stream, traffic.select(wanted), (1000,))
        whole = decode(traffic, "can.log", mapping, databases).signals
        assert some
        assert all(times.size == len(whole[name]) for name, (times, _) in some.items())


def test_database_without_a_signal_that_is_wanted_is_refused():
    databases = load_dbcs([GOLDEN / "golden.dbc"])
    with pytest.raises(ConfigError, match="mapping"):
        DbcStream(databases, None, "can:x")
    (mapping,) = load_mapping({"signals": {"vehicle_speed": {"column": "Spd", "unit": "km/h"}}})
    with pytest.raises(ConfigError, match="Spd"):
        DbcStream(databases, mapping, "can:x")


def truck_rows():
    """Ten seconds of a truck, with an engine configuration in packets."""
    rows = []
    body = bytearray(b"\xff" * 39)
    body[19:21] = (2000).to_bytes(2, "little")
    body = bytes(body).ljust(42, b"\xff")
    for k in range(100):
        t = 0.1 * k
        rows.append((t + 0.001, 0x0CF00400, f"FF FF {0x90 + k % 16:02X} 68 13 FF FF FF"))
        rows.append((t + 0.002, 0x18FEF100, f"FF {k:02X} 32 00 FF FF FF FF"))
        # Another control unit says a speed of its own, seldom.
        if k % 10 == 5:
            rows.append((t + 0.003, 0x18FEF127, "FF 00 10 00 FF FF FF FF"))
        if k % 2 == 0:
            rows.append((t + 0.004, 0x18F0000F, f"FF {0x4B if k >= 50 else 0x7D:02X}" + " FF" * 6))
        if k % 5 == 0:
            rows.append((t + 0.0005, 0x18FEDF00, "87 FF FF FF 7F FF FF FF"))
    rows.append((3.0, 0x1CECFF00, "20 27 00 06 FF E3 FE 00"))
    for packet in range(6):
        part = body[7 * packet : 7 * packet + 7]
        rows.append((3.05 + 0.05 * packet, 0x1CEBFF00, f"{packet + 1:02X}" + part.hex()))
    return sorted(rows)


@pytest.mark.parametrize("size", [1, 7, 64])
def test_truck(size):
    traffic = frames(*truck_rows())
    whole = {s.name: s for s in decode_j1939(traffic).signals}
    found = in_parts(J1939Stream(), traffic, (size,))
    assert found.keys() == whole.keys()
    for name in ("engine_speed", "vehicle_speed", "engine_torque_fraction", "reference_torque"):
        assert_allclose(found[name][0], whole[name].time)
        assert_allclose(found[name][1], whole[name].values)
    assert set(found["reference_torque"][1]) == {2000.0}
    assert set(found["vehicle_speed"][1]) == set(whole["vehicle_speed"].values)
    # The retarder brakes from 5 s on; the brake's own switch says nothing against it.
    time, on = found["brake_switch"]
    assert not on[time < 5.0].any()
    assert on[time > 5.1].all()


def test_torque_without_friction_waits_for_it():
    rows = [(0.1 * k, 0x0CF00400, "FF FF AF 68 13 FF FF FF") for k in range(80)]
    found = in_parts(J1939Stream(), frames(*rows), (5,))
    assert_allclose(found["indicated_torque_fraction"][1], 0.5)
    assert found["engine_torque_fraction"][0].min() > 5.0


def test_sender_that_falls_silent_is_replaced():
    rows = [(0.1 * k, 0x18FEF100, "FF 00 32 00 FF FF FF FF") for k in range(50)]
    rows += [(0.1 * k + 0.05, 0x18FEF127, "FF 00 10 00 FF FF FF FF") for k in range(200)]
    time, speed = in_parts(J1939Stream(), frames(*sorted(rows)), (10,))["vehicle_speed"]
    assert_allclose(speed[time < 5.0], 50.0 / 3.6)
    assert_allclose(speed[time > 10.1], 16.0 / 3.6)


def test_filters_pass_every_parameter():
    filters = J1939Stream().filters()
    for spn in SPNS:
        if spn.byte > 8 or spn.pgn == 0xFEE3:
            continue
        identifier = 0x18000000 | spn.pgn << 8 | 0x27
        assert any((identifier & mask) == (i & mask) for i, mask, _ in filters), spn
    # The packets of an engine configuration to everyone, and to one.
    assert any((0x1CECFF00 & mask) == (i & mask) for i, mask, _ in filters)
    assert any((0x1CEB2700 & mask) == (i & mask) for i, mask, _ in filters)
