from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_frames import make, split
from tests.noted import has, refused

from weighbridge.io.bus import decode
from weighbridge.io.frames import join_frames
from weighbridge.io.obd import LENGTHS, PIDS, decode_obd
from weighbridge.signals import QUANTITIES, UNITS, from_si


def answers(payloads, identifier=0x7E8, start=0.0, **rest):
    """Frames of answers half a second apart."""
    data, time = [], []
    for k, payload in enumerate(payloads):
        parts = [bytes([len(payload)]) + payload] if len(payload) < 8 else split(payload)
        data += [p.ljust(8, b"\0") for p in parts]
        time += [start + 0.5 * k + 0.01 * j for j in range(len(parts))]
    return make(time, identifier, data, extended=identifier > 0x7FF, **rest)


def value(found, name):
    signal = next(s for s in found.signals if s.name == name)
    suffix = QUANTITIES[name].suffix
    return from_si(signal.values, suffix) if suffix else signal.values


# Worked by hand from the scalings of SAE J1979.
@pytest.mark.parametrize(
    ("payload", "name", "expected"),
    [
        ("41 04 80", "engine_load", 100 * 128 / 255),
        ("41 05 7B", "coolant_temperature", 83.0),
        ("41 0B 64", "intake_pressure", 100.0),
        ("41 0C 1A F8", "engine_speed", 1726.0),
        ("41 0D 32", "vehicle_speed", 50.0),
        ("41 0F 41", "intake_temperature", 25.0),
        ("41 10 07 D0", "mass_air_flow", 20.0),
        ("41 11 FF", "throttle", 100.0),
        ("41 1F 01 02", "run_time", 258.0),
        ("41 2F 80", "fuel_level", 100 * 128 / 255),
        ("41 33 65", "barometric_pressure", 101.0),
        ("41 34 80 00 80 00", "lambda_1", 1.0),
        ("41 42 36 B0", "module_voltage", 14.0),
        ("41 43 00 FF", "absolute_load", 100.0),
        ("41 44 40 00", "commanded_lambda", 0.5),
        ("41 45 33", "relative_throttle", 20.0),
        ("41 46 3C", "ambient_temperature", 20.0),
        ("41 47 33", "throttle_b", 20.0),
        ("41 49 33", "accelerator_pedal", 20.0),
        ("41 4C 33", "commanded_throttle", 20.0),
        ("41 5A 33", "relative_pedal", 20.0),
        ("41 5C 82", "oil_temperature", 90.0),
        ("41 5E 00 64", "fuel_rate", 5.0),
        ("41 61 AF", "demanded_torque", 50.0),
        ("41 62 73", "engine_torque_fraction", -10.0),
        ("41 63 01 90", "reference_torque", 400.0),
        ("41 64 87 91 9B A5 E1", "torque_point_4", 100.0),
        ("41 A4 03 30 08 98", "gear", 3.0),
        ("41 A4 03 30 08 98", "gear_ratio", 2.2),
        ("41 A6 00 12 D6 87", "odometer", 123456.7),
    ],
)
def test_scalings(payload, name, expected):
    found = decode_obd(answers([bytes.fromhex(payload)] * 3))
    assert_allclose(value(found, name), expected, rtol=1e-12)


def test_gear_counts_only_where_it_is_supported():
    found = decode_obd(answers([bytes.fromhex("41A402300898")] * 3))
    assert [s.name for s in found.signals] == ["gear_ratio"]


def test_table_fits_the_catalogue():
    for p in PIDS:
        assert p.name in QUANTITIES
        assert p.first + p.count <= LENGTHS[p.number]
        if p.unit:
            assert UNITS[p.unit].dimension == UNITS[QUANTITIES[p.name].suffix].dimension


def test_several_parameters_in_one_answer_share_its_time():
    payload = bytes.fromhex("41 0C 1A F8 0D 32 62 AF 63 01 90 11 33")
    found = decode_obd(answers([payload] * 4))
    for name, expected in (
        ("engine_speed", 1726.0),
        ("vehicle_speed", 50.0),
        ("engine_torque_fraction", 50.0),
        ("reference_torque", 400.0),
        ("throttle", 20.0),
    ):
        assert_allclose(value(found, name), expected)
    assert all(s.time is not None and len(s) == 4 for s in found.signals)
    assert_allclose(found.signals[0].time, [0.0, 0.5, 1.0, 1.5])


def test_eleven_and_twenty_nine_bits_and_several_units():
    standard = answers([bytes([0x41, 0x0D, 10 + k]) for k in range(6)])
    engine = answers([bytes.fromhex("410C1AF8")] * 4, 0x18DAF110, 0.2)
    gearbox = answers([bytes([0x41, 0x0D, 12 + k]) for k in range(3)], 0x18DAF118, 0.3)
    request = make([0.0, 0.5], 0x18DB33F1, [b"\2\1\x0d\0\0\0\0\0"] * 2, extended=True)
    frames = join_frames([standard, engine, gearbox, request])
    found = decode_obd(frames)
    assert_allclose(value(found, "vehicle_speed"), 10 + np.arange(6))
    assert_allclose(value(found, "engine_speed"), 1726.0)
    assert found.used.all()
    assert [c.split(",")[0] for c in found.contents] == [
        "CAN 1 7E8", "CAN 1 18DAF110", "CAN 1 18DAF118",
    ]  # fmt: skip
    assert (found.problems[0].id, found.problems[0].values["names"]) == (
        "bus.answered_twice",
        "vehicle_speed (3 for 6)",
    )


def drive_answers(seconds, identifier, start, speed=50):
    """Engine and vehicle speed in every answer, two a second."""
    payloads = [bytes([0x41, 0x0C, 0x1A, k % 250, 0x0D, speed]) for k in range(2 * seconds)]
    return answers(payloads, identifier, start)


def test_answers_that_change_from_11_to_29_bits_are_read_on():
    before, after = drive_answers(60, 0x7E8, 100.0), drive_answers(45, 0x18DAF110, 160.0, 60)
    found = decode_obd(join_frames([before, after]))
    for name in ("vehicle_speed", "engine_speed"):
        signal = next(s for s in found.signals if s.name == name)
        assert_allclose(signal.time, np.concatenate([before.time, after.time]))
    assert_allclose(value(found, "vehicle_speed"), np.repeat([50.0, 60.0], [120, 90]))
    (problem,) = found.problems
    assert problem.id == "bus.filled_in"
    assert f"{problem.values['first']:.0f}" == "60"
    assert f"{problem.values['last']:.0f}" == "104"
    assert problem.id == "bus.filled_in"
    assert found.used.all()


def test_answers_in_both_lengths_at_once_are_taken_once():
    found = decode_obd(
        join_frames([drive_answers(60, 0x7E8, 0.0), drive_answers(60, 0x18DAF110, 0.1)])
    )
    assert [len(s) for s in found.signals] == [120, 120]
    assert (found.problems[0].id, found.problems[0].values["other"]) == (
        "bus.answered_twice",
        "CAN 1 18DAF110",
    )


def test_what_is_asked_seldom_of_two_units_is_no_silence():
    payloads = [bytes([0x41, 0x05, 0x7B])] * 30
    one, other = answers(payloads), answers(payloads, 0x7E9)
    slow = [replace(f, time=f.time * 120.0 + 30.0 * k) for k, f in enumerate((one, other))]
    (signal,) = decode_obd(join_frames(slow)).signals
    assert len(signal) == 30


def test_missing_parts_cost_that_answer_only():
    payload = bytes.fromhex("41 0C 1A F8 0D 32 62 AF 63 01 90")
    frames = answers([payload] * 5)
    keep = np.ones(len(frames), bool)
    keep[3] = False
    found = decode_obd(frames.select(keep))
    assert_allclose(found.signals[0].time, [0.0, 1.0, 1.5, 2.0])
    assert (found.problems[0].id, found.problems[0].values["answers"]) == (
        "bus.answers_lost",
        "1 answer",
    )


def test_cut_answer_gives_what_stood_before():
    found = decode_obd(answers([bytes.fromhex("41 0D 32 0C 1A")] * 3))
    assert [s.name for s in found.signals] == ["vehicle_speed"]
    assert (found.problems[0].id, found.problems[0].values["answers"]) == (
        "bus.answers_cut",
        "3 answers",
    )


def test_identification_numbers_are_counted_and_never_kept():
    vin = [b"\x49\x02\x01" + text for text in (b"WVWZZZ1KZ8W000001", b"WVWZZZ1KZ8W000002")]
    speed = [b"\x41\x0d\x32"] * 3
    found = decode_obd(answers([vin[0], *speed]))
    assert found.problems == []
    found = decode_obd(answers([vin[0], *speed, vin[1], *speed]))
    assert found.problems[0].serious
    assert found.problems[0].id == "vehicle.several_vins"
    assert found.problems[0].values["vehicles"] == 2
    assert "WVWZZZ" not in repr(found)


def test_two_vehicles_at_once_are_a_serious_doubt():
    one = answers([bytes([0x41, 0x0D, 50])] * 30)
    two = answers([bytes([0x41, 0x0D, 90])] * 20, channel=2, start=0.1)
    found = decode_obd(join_frames([one, two]))
    assert any(p.serious and p.id == "vehicle.two_units" for p in found.problems)


def test_other_services_alone_are_no_obd_drive():
    frames = answers([b"\x62\xf4\x0d\x32"] * 5)
    found = decode_obd(frames)
    assert found.signals == []
    assert not found.used.any()
    with refused("bus.diagnosis_only") as told:
        decode(frames, "log", None, ())
    assert "5 answers of other services" in told.value.problem.values["diagnosis"]


def test_full_scales_of_its_own_are_told():
    flow, speed = bytes.fromhex("41 10 80 40"), bytes.fromhex("41 0D 32")
    usual, other = bytes.fromhex("41 50 00 00 00 00"), bytes.fromhex("41 50 40 00 00 00")
    assert decode_obd(answers([flow, speed, usual])).problems == []
    assert decode_obd(answers([speed, other])).problems == []
    (told,) = decode_obd(answers([flow, speed, other])).problems
    assert has([told], "bus.full_scales", names="mass_air_flow")


def test_what_cannot_be_used_has_a_known_length():
    said = decode_obd(answers([bytes.fromhex("41 41 00 07 E5 E5 0D 32")] * 3))
    assert said.problems == []
    assert_allclose(value(said, "vehicle_speed"), 50.0)


def test_lists_of_supported_parameters_that_change_are_told():
    one, other = bytes.fromhex("41 00 BE 3E B8 11"), bytes.fromhex("41 00 98 3B 80 13")
    speed = bytes.fromhex("41 0D 32")
    (told,) = decode_obd(answers([one, speed, other])).problems
    assert has([told], "bus.two_lists", ways=2)
    assert decode_obd(answers([one, speed, one])).problems == []
