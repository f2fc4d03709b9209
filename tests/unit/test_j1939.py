"""J1939: parameters from hand-written frames, transport protocol, what is not available."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from weighbridge.io.frames import Frames, join_frames
from weighbridge.io.j1939 import SPNS, decode_j1939, is_j1939, parameter_group


def frames(*rows, channel=0, extended=True):
    """Frames of (time, identifier, "hex bytes")."""
    data = np.zeros((len(rows), 8), np.uint8)
    length = np.zeros(len(rows), np.uint8)
    for k, (_, _, text) in enumerate(rows):
        body = bytes.fromhex(text)
        data[k, : len(body)] = list(body)
        length[k] = len(body)
    return Frames(
        time=np.array([r[0] for r in rows], float),
        channel=np.full(len(rows), channel, np.int16),
        id=np.array([r[1] for r in rows], np.uint32),
        extended=np.full(len(rows), extended),
        length=length,
        data=data,
    )


def signals(*rows):
    return {s.name: s for s in decode_j1939(frames(*rows)).signals}


def value(rows, name):
    found = signals(*rows)[name]
    assert len(found) == 1
    return float(found.values[0])


# What is read: raw values worked out by hand from resolution and offset in J1939-71.


@pytest.mark.parametrize(
    ("identifier", "text", "name", "expected"),
    [
        (0x0CF00400, "FF FF FF 68 13 FF FF FF", "engine_speed", 621.0 * np.pi / 30),  # 4968 / 8
        (0x0CF00300, "FF 7D FF FF FF FF FF FF", "throttle", 0.5),  # 125 * 0.4 %
        (0x0CF00300, "FF FF 32 FF FF FF FF FF", "engine_load", 0.5),
        (0x18FEF100, "FF 80 32 FF FF FF FF FF", "vehicle_speed", 50.5 / 3.6),  # 12928 / 256
        (0x18F00503, "FF FF FF 81 FF FF FF FF", "gear", 4.0),
        (0x18F00503, "FF FF FF 7D FF FF FF FF", "gear", 0.0),
        (0x18F00503, "FF FF FF 7C FF FF FF FF", "gear", -1.0),
        (0x18F00503, "FF FF FF FB FF FF FF FF", "gear", 0.0),  # park
        (0x18F0000F, "FF 4B FF FF FF FF FF FF", "retarder_torque", -0.5),
        (0x18F0000F, "FF 4B FF FF FF FF FF FF", "brake_switch", 1.0),
        (0x18F0000F, "FF 7D FF FF FF FF FF FF", "brake_switch", 0.0),
        (0x18FEF100, "FF FF FF 10 FF FF FF FF", "brake_switch", 1.0),
        (0x18FEF100, "FF FF FF 40 FF FF FF FF", "clutch_switch", 1.0),
        (0x18F0010B, "40 FF FF FF FF FF FF FF", "brake_switch", 1.0),  # EBS brake switch
        (0x18F0010B, "C0 32 FF FF FF FF FF FF", "brake_switch", 1.0),  # pedal at 20 %
        (0x18F0010B, "C0 00 FF FF FF FF FF FF", "brake_switch", 0.0),
        (0x0CF00203, "FC FF FF FF FF FF FF FF", "clutch_switch", 1.0),  # driveline open
        (0x0CF00203, "DD FF FF FF FF FF FF FF", "clutch_switch", 1.0),  # shift in process
        (0x0CF00203, "CD FF FF FF FF FF FF FF", "clutch_switch", 0.0),
        (0x18FEF500, "C8 FF FF A0 24 FF FF FF", "barometric_pressure", 100e3),
        (0x18FEF200, "64 00 FF FF FF FF FF FF", "fuel_rate", 5e-3 / 3600.0),  # 5 L/h
        (0x18FEF500, "FF FF FF A0 24 FF FF FF", "ambient_temperature", 293.15),  # 9376 / 32 - 273
    ],
)
def test_one_parameter(identifier, text, name, expected):
    assert_allclose(value([(1.0, identifier, text)], name), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("identifier", "text", "name"),
    [
        (0x0CF00400, "FF FF FF FF FF FF FF FF", "engine_speed"),
        (0x0CF00400, "FF FF FF 00 FE FF FF FF", "engine_speed"),  # error
        (0x0CF00400, "FF FF FF 00", "engine_speed"),  # cut off
        (0x18FEF100, "FF 00 FB FF FF FF FF FF", "vehicle_speed"),  # parameter specific
        (0x18F00503, "FF FF FF FE FF FF FF FF", "gear"),
        (0x18FEF100, "FF FF FF 20 FF FF FF FF", "brake_switch"),  # error
        (0x18FEF100, "FF FF FF 30 FF FF FF FF", "brake_switch"),  # not available
    ],
)
def test_codes_that_are_no_values_are_left_out(identifier, text, name):
    assert name not in signals((1.0, identifier, text))


def test_net_torque_is_actual_less_friction_less_parasitic_losses():
    rows = [
        (0.0, 0x18FEDF00, "87 FF FF FF 7F FF FF FF"),  # friction 10 %, parasitic 2 %
        (0.1, 0x0CF00400, "FF FF AF 68 13 FF FF FF"),  # actual 50 %
        (0.2, 0x18FEDF00, "89 FF FF FF 7F FF FF FF"),  # friction 12 %
    ]
    assert_allclose(value(rows, "engine_torque_fraction"), 0.50 - 0.11 - 0.02)


def test_parasitic_losses_that_are_not_known_count_nothing():
    rows = [
        (0.0, 0x18FEDF00, "87 FF FF FF 00 FF FF FF"),  # -125 %
        (0.1, 0x0CF00400, "FF FF AF 68 13 FF FF FF"),
    ]
    assert_allclose(value(rows, "engine_torque_fraction"), 0.40)


def test_torque_without_friction_is_told_and_marked_as_the_indicated_one():
    found = decode_j1939(frames((0.1, 0x0CF00400, "FF FF AF 68 13 FF FF FF")))
    assert "EEC3" in found.summary.problems[0].text
    values = {s.name: s.values for s in found.signals}
    assert_allclose(values["indicated_torque_fraction"], 0.50)
    assert_allclose(values["engine_torque_fraction"], 0.50)


def test_torque_far_from_any_friction_is_left_out():
    rows = [
        (0.0, 0x18FEDF00, "87 FF FF FF FF FF FF FF"),
        (0.1, 0x0CF00400, "FF FF AF 68 13 FF FF FF"),
        (60.0, 0x0CF00400, "FF FF AF 68 13 FF FF FF"),
    ]
    found = decode_j1939(frames(*rows))
    torque = next(s for s in found.signals if s.name == "engine_torque_fraction")
    assert_array_equal(torque.time, [0.1])
    (problem,) = found.summary.problems
    assert problem.id == "torque.friction_apart"
    assert (problem.values["count"], problem.values["values"]) == (1, 2)


def test_any_brake_marks_the_sample():
    rows = [
        (0.0, 0x18FEF100, "FF FF FF 00 FF FF FF FF"),
        (1.0, 0x18F0000F, "FF 7D FF FF FF FF FF FF"),
        (2.0, 0x18F0000F, "FF 4B FF FF FF FF FF FF"),
        (3.0, 0x18FEF100, "FF FF FF 00 FF FF FF FF"),
        (4.0, 0x18F0000F, "FF 7D FF FF FF FF FF FF"),
    ]
    brake = signals(*rows)["brake_switch"]
    assert_array_equal(brake.held(np.arange(5.0)), [0, 0, 1, 1, 0])


def test_brakes_told_by_several_in_one_breath_are_a_clock_without_gaps():
    on = np.array([30, 31, 32, 70])  # the retarder alone, from frame to frame
    rows = []
    for k in range(100):
        retarder = "4B" if k in on else "7D"
        rows += [
            (0.1 * k, 0x18FEF100, "FF FF FF 00 FF FF FF FF"),
            (0.1 * k + 0.001, 0x18F0010B, "C0 00 FF FF FF FF FF FF"),
            (0.1 * k + 0.002, 0x18F0000F, f"FF {retarder} FF FF FF FF FF FF"),
        ]
    # The first two fall silent, the retarder goes on.
    rows += [(10.0 + 0.1 * k, 0x18F0000F, "FF 7D FF FF FF FF FF FF") for k in range(50)]
    brake = signals(*rows)["brake_switch"]
    steps = np.diff(brake.time)
    assert_allclose(np.median(steps), 0.1, rtol=0.05)
    assert steps.max() < 0.3
    assert_allclose(brake.time[-1], 14.9)
    told = np.isin(np.arange(100), on).astype(float)
    assert_array_equal(brake.held(0.1 * np.arange(100) + 0.003), told)


def test_the_sender_with_most_values_is_taken():
    rows = [(t, 0x18FEF100, "FF 00 32 FF FF FF FF FF") for t in (0.0, 0.1)]
    rows += [(t, 0x18FEF131, "FF 00 33 FF FF FF FF FF") for t in (0.2, 0.3, 0.4)]
    found = decode_j1939(frames(*rows))
    assert_allclose(found.signals[0].values, 51 / 3.6)


def two_buses(second):
    one = [(0.1 * k, 0x0CF00400, "FF FF FF 68 13 FF FF FF") for k in range(20)]
    two = [(0.1 * k + 0.01, 0x0CF00400, second) for k in range(15)]
    speed = [(0.1 * k + 0.02, 0x18FEF100, "FF 00 32 FF FF FF FF FF") for k in range(30)]
    rows = join_frames([frames(*one, channel=2), frames(*sorted(two + speed), channel=5)])
    return decode_j1939(rows)


def test_a_gateway_to_a_second_bus_is_no_second_vehicle():
    found = two_buses("FF FF FF 70 13 FF FF FF")
    assert found.summary.problems == []
    assert [len(s) for s in found.signals if s.name == "engine_speed"] == [20]
    assert [len(s) for s in found.signals if s.name == "vehicle_speed"] == [30]


def test_two_engines_on_two_buses_are_a_serious_doubt():
    found = two_buses("FF FF FF 68 26 FF FF FF")
    assert [p.signal for p in found.summary.problems if p.serious] == ["engine_speed"]
    assert found.summary.problems[0].id == "bus.two_vehicles"


def test_group_of_addressed_and_of_broadcast_identifiers():
    ids = np.array([0x0CF00400, 0x1CECFF00, 0x1CEB0321, 0x18FEE300, 0x19FEE300], np.uint32)
    assert parameter_group(ids).tolist() == [0xF004, 0xEC00, 0xEB00, 0xFEE3, 0x1FEE3]


def test_counts_of_what_was_decoded_and_ignored():
    rows = [(0.0, 0x0CF00400, "FF FF FF 68 13 FF FF FF"), (0.1, 0x18FEE900, "00" * 8)] * 2
    rows = [(k * 0.1, i, t) for k, (_, i, t) in enumerate(rows)]
    summary = decode_j1939(frames(*rows)).summary
    assert summary.decoded == {"EEC1": 2}
    assert summary.ignored == {0xFEE9: 2}


def test_traffic_is_recognised_by_two_known_groups():
    eec1 = (0.0, 0x0CF00400, "00" * 8)
    ccvs = (0.1, 0x18FEF100, "00" * 8)
    obd = (0.2, 0x18DAF110, "00" * 8)
    assert is_j1939(frames(eec1, ccvs))
    assert not is_j1939(frames(eec1, obd))
    assert not is_j1939(frames(eec1, ccvs, extended=False))
    assert not is_j1939(Frames.empty())


def test_odometer_that_disagrees_with_the_speed_is_told():
    speed = [(float(t), 0x18FEF100, "FF 00 32 FF FF FF FF FF") for t in range(0, 100)]  # 50 km/h
    half = [
        (0.5, 0x18FEC100, "00 00 00 00 FF FF FF FF"),
        (98.5, 0x18FEC100, "88 00 00 00 FF FF FF FF"),  # 136 * 5 m
    ]
    speed = [(0.5 * t, i, x) for t, (_, i, x) in enumerate(speed * 2)]
    both = sorted(speed + half)
    problems = decode_j1939(frames(*both)).summary.problems
    assert any(p.id == "speed.odometer" for p in problems)
    half[1] = (98.5, 0x18FEC100, "10 01 00 00 FF FF FF FF")  # 272 * 5 m: 98 s at 13.9 m/s
    both = sorted(speed + half)
    assert decode_j1939(frames(*both)).summary.problems == []


def test_the_mass_of_the_combination_is_the_maker_s_mass():
    rows = [
        (0.0, 0x18FE7003, "84 03 00 00 FF FF FF FF"),  # 900 * 10 kg alone; no combination yet
        (1.0, 0x18FE7003, "84 03 D0 07 FF FF FF FF"),  # 2000 * 10 kg together
        (2.0, 0x18FE7003, "84 03 D1 07 FF FF FF FF"),
        (3.0, 0x18FE7003, "84 03 FF FF FF FF FF FF"),
    ]
    assert_array_equal(signals(*rows)["maker_mass"].values, [20000.0, 20010.0])
    # Of a vehicle that reports itself alone.
    alone = decode_j1939(frames(rows[0], rows[3]))
    (found,) = alone.signals
    assert (found.name, found.values.tolist()) == ("maker_mass", [9000.0, 9000.0])
    assert decode_j1939(frames((0.0, 0x18FE7003, "FF FF 00 00 FF FF FF FF"))).signals == []


def test_axle_weights_the_vehicle_reports_are_told_and_not_taken():
    rows = [
        (0.1, 0x18FEEA31, "00 20 4E FF FF FF FF FF"),  # 20000 * 0.5 kg
        (0.2, 0x18FEEA31, "10 10 27 FF FF FF FF FF"),  # 10000 * 0.5 kg
    ]
    found = decode_j1939(frames(*rows))
    told = {p.id: p.values["mass"] for p in found.summary.problems}
    assert told == {"mass.axles_reported": 15000.0}
    assert found.signals == []


# Engine configuration over the transport protocol: 39 bytes, reference torque 1109 N m.

EC1 = bytes(range(1, 20)) + (1109).to_bytes(2, "little") + bytes(range(22, 40))


def packets(body, identifier, start, step=0.05):
    body = body.ljust(-(-len(body) // 7) * 7, b"\xff")
    return [
        (start + step * k, identifier, bytes([k + 1, *body[7 * k : 7 * k + 7]]).hex())
        for k in range(len(body) // 7)
    ]


def announce(time, identifier, control=0x20, size=39, number=6, pgn=0xFEE3):
    text = bytes([control, *size.to_bytes(2, "little"), number, 0xFF, *pgn.to_bytes(3, "little")])
    return (time, identifier, text.hex())


def reference(*rows):
    found = decode_j1939(frames(*sorted(rows)))
    torque = {s.name: s for s in found.signals}.get("reference_torque")
    return (None if torque is None else torque.values.tolist()), found.summary


def test_engine_configuration_by_broadcast():
    values, summary = reference(announce(0.0, 0x1CECFF00), *packets(EC1, 0x1CEBFF00, 0.05))
    assert values == [1109.0]
    assert summary.incomplete == 0
    assert summary.decoded["EC1"] == 1


def test_engine_configuration_to_one_address_with_a_packet_asked_for_twice():
    request = announce(0.0, 0x18EC2100, control=0x10)
    clear = (0.02, 0x18EC0021, "11 06 01 FF FF E3 FE 00")
    body = packets(EC1, 0x18EB2100, 0.05)
    wrong = (0.051, 0x18EB2100, "03" + "EE" * 7)
    again = (0.5, 0x18EB2100, body[2][2])
    values, _ = reference(request, clear, wrong, *body, again)
    assert values == [1109.0]


def test_two_messages_at_once_do_not_mix():
    other = bytes(39)
    rows = [announce(0.0, 0x1CECFF00), *packets(EC1, 0x1CEBFF00, 0.05)]
    rows += [announce(0.01, 0x1CECFF03), *packets(other, 0x1CEBFF03, 0.06)]
    values, _ = reference(*rows)
    assert values == [1109.0]


@pytest.mark.parametrize("lost", range(6))
def test_a_lost_packet_leaves_the_message_out(lost):
    body = packets(EC1, 0x1CEBFF00, 0.05)
    del body[lost]
    values, summary = reference(announce(0.0, 0x1CECFF00), *body)
    assert values is None
    assert summary.incomplete == 1
    assert any(p.id == "bus.packets_lost" for p in summary.problems)


def test_packets_may_be_slow_but_not_for_ever():
    """A broadcast has up to 0.2 s between packets (J1939-21, 5.10.2.4)."""
    slow = packets(EC1, 0x1CEBFF00, 0.2, step=0.2)
    assert reference(announce(0.0, 0x1CECFF00), *slow)[0] == [1109.0]
    late = packets(EC1, 0x1CEBFF00, 20.0)
    values, summary = reference(announce(0.0, 0x1CECFF00), *late)
    assert values is None
    assert summary.incomplete == 1


def test_an_aborted_message_is_left_out():
    abort = (0.12, 0x18EC0021, "FF 01 FF FF FF E3 FE 00")
    body = packets(EC1, 0x18EB2100, 0.05)
    values, summary = reference(announce(0.0, 0x18EC2100, control=0x10), abort, *body)
    assert values is None
    assert summary.incomplete == 1


@pytest.mark.parametrize("number", [0, 5])
def test_an_announcement_that_cannot_be_is_left_out(number):
    values, summary = reference(
        announce(0.0, 0x1CECFF00, number=number), *packets(EC1, 0x1CEBFF00, 0.05)
    )
    assert values is None
    assert summary.incomplete == 1


def test_a_reference_torque_of_zero_is_none():
    nothing = EC1[:19] + bytes(2) + EC1[21:]
    values, _ = reference(announce(0.0, 0x1CECFF00), *packets(nothing, 0x1CEBFF00, 0.05))
    assert values is None


def test_a_message_of_another_group_is_no_engine_configuration():
    values, summary = reference(
        announce(0.0, 0x1CECFF00, pgn=0xFECA), *packets(EC1, 0x1CEBFF00, 0.05)
    )
    assert values is None
    assert summary.incomplete == 0


def test_buses_do_not_mix_in_transport():
    body = packets(EC1, 0x1CEBFF00, 0.05)
    one = frames(announce(0.0, 0x1CECFF00), *body[:3])
    two = frames(*body[3:], channel=1)
    found = decode_j1939(join_frames([one, two]))
    assert found.signals == []
    assert found.summary.incomplete == 1


# Anything at all


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(
                [s.pgn << 8 for s in SPNS] + [0xECFF00, 0xEBFF00, 0xEC2100, 0xEB2100, 0xEC0021]
            ),
            st.binary(max_size=8),
        ),
        max_size=40,
    )
)
def test_any_bytes_decode_to_finite_values_on_rising_clocks(rows):
    found = decode_j1939(
        frames(*[(0.1 * (k // 2), i | 0x18000000, b.hex()) for k, (i, b) in enumerate(rows)])
    )
    for s in found.signals:
        assert len(s) > 0
        assert np.isfinite(s.values).all()
        assert (np.diff(s.time) > 0).all()
