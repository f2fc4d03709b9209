import time
from threading import Event, Thread

import numpy as np
import pytest
from tests.noted import error
from tests.simulated_ecu import SimulatedEcu

from weighbridge import ConfigError
from weighbridge.errors import SourceError
from weighbridge.io.frames import Frames
from weighbridge.io.obd import LENGTHS, PIDS, decode_obd, parameters_of, values_of
from weighbridge.live import Feed, parse_source
from weighbridge.live.sources import schedule as schedule_module
from weighbridge.live.sources.schedule import Request, Schedule, Vigil, packed, supported_of

CAR = {
    0x04: b"\x80",
    0x0B: b"\x40",
    0x0C: b"\x1f\x40",
    0x0D: b"\x32",
    0x10: b"\x04\x00",
    0x11: b"\x33",
    0x33: b"\x64",
    0x46: b"\x3c",
    0x62: b"\x9b",
    0x63: b"\x01\x90",
}


def source_on(channel):
    return parse_source(f"obd:virtual:{channel}")


def is_request(identifier, extended, data):
    """Say whether a frame asks for one to six parameters of service 01, and does nothing else."""
    known = (0x18DB33F1, 0x18DA10F1) if extended else (0x7DF, *range(0x7E0, 0x7E8))
    return identifier in known and len(data) == 8 and 2 <= data[0] <= 7 and data[1] == 0x01


def gather(source, until, timeout=4.0):
    """Run a source until the samples are enough; return them, and how long it took to end."""
    samples = {}

    def put(block):
        for name, (times, values) in block.items():
            have = samples.setdefault(name, ([], []))
            have[0].extend(times)
            have[1].extend(values)

    stop = Event()
    thread = Thread(target=source.run, args=(put, stop), daemon=True)
    thread.start()
    limit = time.monotonic() + timeout
    while not until(samples) and time.monotonic() < limit:
        time.sleep(0.01)
    stop.set()
    thread.join(1.0)
    assert not thread.is_alive()
    return samples


def requests(ecu):
    return [(m.arbitration_id, m.is_extended_id, bytes(m.data)) for m in ecu.heard]


def test_car_is_asked_and_only_by_requests_of_service_01(request):
    with SimulatedEcu(request.node.name, CAR) as ecu:
        samples = gather(
            source_on(request.node.name),
            lambda s: "reference_torque" in s and len(s.get("vehicle_speed", ([],))[0]) > 20,
        )
    assert samples["vehicle_speed"][1][0] == pytest.approx(50.0 / 3.6)
    assert samples["engine_speed"][1][0] == pytest.approx(2000.0 * np.pi / 30.0)
    assert samples["engine_torque_fraction"][1][0] == pytest.approx(0.30)
    assert samples["reference_torque"][1][0] == 400.0
    assert samples["ambient_temperature"][1][0] == pytest.approx(293.15)
    assert len(samples["ambient_temperature"][1]) == 1
    assert ecu.heard
    assert all(is_request(*r) for r in requests(ecu))
    assert {r[0] for r in requests(ecu)} == {0x7DF, 0x7E0}


def test_requests_keep_their_rate(request):
    with SimulatedEcu(request.node.name, CAR) as ecu:
        gather(source_on(request.node.name), lambda s: len(ecu.heard) > 40)
        sent = np.array([m.timestamp for m in ecu.heard])
    assert sent.size > 40
    # One in 20 ms at most; the stamps of a busy host scatter.
    assert (sent[-1] - sent[0]) / (sent.size - 1) >= 0.9 / 50.0


def test_car_with_29_bits(request):
    with SimulatedEcu(request.node.name, CAR, extended=True) as ecu:
        samples = gather(source_on(request.node.name), lambda s: "vehicle_speed" in s)
    assert samples["vehicle_speed"][1][0] == pytest.approx(50.0 / 3.6)
    assert all(is_request(*r) for r in requests(ecu))
    assert {r[0] for r in requests(ecu)} == {0x7DF, 0x18DB33F1, 0x18DA10F1}


def test_unsupported_parameters_are_not_asked_for(request):
    few = {0x0C: b"\x1f\x40", 0x0D: b"\x32", 0x04: b"\x80"}
    with SimulatedEcu(request.node.name, few) as ecu:
        gather(source_on(request.node.name), lambda s: len(ecu.heard) > 15)
    asked = {n for _, _, data in requests(ecu) for n in data[2 : 1 + data[0]]}
    assert asked == {0x00, 0x0C, 0x0D, 0x04}


def test_unit_that_answers_one_parameter_at_a_time(request):
    with SimulatedEcu(request.node.name, CAR, alone=True) as ecu:
        samples = gather(
            source_on(request.node.name),
            lambda s: {"vehicle_speed", "engine_speed", "throttle"} <= s.keys(),
        )
    assert samples["throttle"][1][0] == pytest.approx(0.2)
    assert all(is_request(*r) for r in requests(ecu))


def test_gearbox_is_asked_for_what_it_alone_has(request):
    gearbox = {0x0D: b"\x00", 0xA4: b"\x03\x30\x04\x00"}
    with (
        SimulatedEcu(request.node.name, CAR),
        SimulatedEcu(request.node.name, gearbox, unit=1) as second,
    ):
        samples = gather(
            source_on(request.node.name), lambda s: "gear" in s and "vehicle_speed" in s
        )
    assert samples["gear"][1][0] == 3.0
    assert set(samples["vehicle_speed"][1]) == {50.0 / 3.6}
    assert any(r[0] == 0x7E1 for r in requests(second))


def test_long_answer_gets_no_flow_control(request):
    # A unit that answers more than was asked begins a long message; it is left alone.
    with SimulatedEcu(request.node.name, CAR) as ecu:
        ecu._reply = lambda parameters, reply=ecu._reply: (
            reply(parameters) if parameters[0] % 0x20 == 0 else reply([0x0C, 0x0D, 0x04, 0x11])
        )
        gather(source_on(request.node.name), lambda s: len(ecu.heard) > 8, timeout=3.0)
    assert len(ecu.heard) > 8
    assert all(is_request(*r) for r in requests(ecu))


def test_silent_vehicle_is_asked_seldom_and_comes_back(request, monkeypatch):
    monkeypatch.setattr(schedule_module, "NO_ANSWER", 0.3)
    source = source_on(request.node.name)
    monkeypatch.setattr("weighbridge.live.sources.polling.PROBE", 0.6)
    with SimulatedEcu(request.node.name, CAR) as ecu, Feed([source]) as feed:

        def wait(condition):
            limit = time.monotonic() + 4.0
            while not condition() and time.monotonic() < limit:
                feed.read(0.02)
            assert condition()

        wait(lambda: feed.states()[0].connected)
        ecu.silent = True
        wait(lambda: not feed.states()[0].connected)
        assert "does not answer" in feed.states()[0].error
        asked = len(ecu.heard)
        begun = time.monotonic()
        wait(lambda: len(ecu.heard) > asked)
        # Both forms of the identifier once, then silence again.
        while time.monotonic() - begun < 1.0:
            feed.read(0.05)
        assert len(ecu.heard) - asked <= 4
        ecu.silent = False
        wait(lambda: feed.states()[0].connected)
        assert feed.states()[0].restarts == 0
    assert all(is_request(*r) for r in requests(ecu))


def test_standing_vehicle_is_asked_one_request_at_a_time(request, monkeypatch):
    monkeypatch.setattr(schedule_module, "STANDING", 0.3)
    still = CAR | {0x0C: b"\x00\x00", 0x0D: b"\x00"}
    source = source_on(request.node.name)
    monkeypatch.setattr("weighbridge.live.sources.polling.PROBE", 0.4)
    with SimulatedEcu(request.node.name, still) as ecu:
        counts = []

        def until(_):
            if source.trouble and not counts:
                assert "engine off" in source.trouble
                counts.append((time.monotonic(), len(ecu.heard)))
            if (
                len(counts) == 1
                and time.monotonic() - counts[0][0] > 1.0
                and len(ecu.heard) > counts[0][1]
            ):
                counts.append((time.monotonic(), len(ecu.heard)))
                ecu.values = dict(CAR)
            return len(counts) == 2 and len(ecu.heard) - counts[1][1] > 10

        gather(source, until)
    assert len(counts) == 2
    assert counts[1][1] - counts[0][1] <= 1 + (counts[1][0] - counts[0][0]) / 0.4
    assert len(ecu.heard) - counts[1][1] > 10


def test_second_owner_of_the_bus_is_refused(request):
    with SimulatedEcu(request.node.name, CAR):
        done = []

        def until(samples):
            if samples and not done:
                ended = Event()
                ended.set()
                with error(SourceError, "obd:virtual:test_second_owner_of_the_bus_is_refused"):
                    source_on(request.node.name).run(lambda _: None, ended)
                done.append(True)
            return bool(done)

        gather(source_on(request.node.name), until)
        assert done


def test_listen_only_refuses_what_asks():
    with error(ConfigError, "obd:virtual:x --listen-only"):
        parse_source("obd:virtual:x", listen_only=True)
    with error(ConfigError, "elm:/dev/ttyUSB0 --listen-only"):
        parse_source("elm:/dev/ttyUSB0", listen_only=True)


def test_answer_means_what_recorded_answers_mean():
    rng = np.random.default_rng(3)
    for number in sorted({p.number for p in PIDS}):
        raw = rng.integers(0, 256, LENGTHS[number], dtype=np.uint8)
        raw[0] |= 3
        answer = bytes([0x41, number, *raw])
        if len(answer) > 7:
            continue
        data = np.zeros((2, 8), np.uint8)
        data[:, 0] = len(answer)
        data[:, 1 : 1 + len(answer)] = np.frombuffer(answer, np.uint8)
        frames = Frames(
            np.array([0.0, 1.0]),
            np.zeros(2, np.int16),
            np.full(2, 0x7E8, np.uint32),
            np.zeros(2, bool),
            np.full(2, 8, np.uint8),
            data,
        )
        recorded = {s.name: s.values[0] for s in decode_obd(frames).signals}
        assert values_of(number, parameters_of(answer)[number]) == pytest.approx(recorded)
        assert recorded


def test_answer_that_is_cut_off_gives_what_is_whole():
    assert parameters_of(b"\x41\x0d\x32\x0c\x1f") == {0x0D: b"\x32"}
    assert parameters_of(b"\x41\x0d\x32\xff\x00") == {0x0D: b"\x32"}
    assert parameters_of(b"\x7f\x01\x12") == {}
    assert parameters_of(b"") == {}


def test_lists_of_parameters():
    # The example of SAE J1979: BE 3E B8 11.
    assert supported_of(0x00, b"\xbe\x3e\xb8\x11") == {
        0x01, 0x03, 0x04, 0x05, 0x06, 0x07, 0x0B, 0x0C, 0x0D, 0x0E, 0x0F,
        0x11, 0x13, 0x14, 0x15, 0x1C, 0x20,
    }  # fmt: skip
    assert supported_of(0x20, b"\x80\x00\x00\x01") == {0x21, 0x40}


def test_answers_of_packed_requests_fit_into_one_frame():
    groups = packed(sorted(schedule_module.SELDOM), together=True)
    assert sorted(n for g in groups for n in g) == sorted(schedule_module.SELDOM)
    assert any(len(g) > 1 for g in groups)
    assert all(1 + sum(1 + LENGTHS[n] for n in g) <= 7 for g in groups)
    assert packed([0x0D, 0x0C], together=False) == [(0x0D,), (0x0C,)]


def test_four_parameters_at_most_are_asked_in_turn():
    schedule = Schedule({0x7E8: set(LENGTHS)}, together=False)
    assert [r.parameters for r in schedule.fast] == [(0x0D,), (0x0C,), (0x62,), (0x11,)]
    asked = [schedule.next(0.001 * k) for k in range(1000)]
    fast = sum(r in schedule.fast for r in asked)
    assert fast >= 970
    assert {n for r in asked for n in r.parameters} >= {0x63, 0x33, 0x46, 0x10}


def test_parameter_that_is_never_answered_is_dropped():
    schedule = Schedule({0x7E8: {0x0C, 0x0D, 0x11}}, together=False)
    for k in range(60):
        request = schedule.next(0.1 * k)
        schedule.note(request, [n for n in request.parameters if n != 0x11])
    assert Request(0x7E8, (0x11,)) not in schedule.fast
    assert len(schedule.fast) == 2


@pytest.mark.parametrize("together", [False, True])
def test_a_parameter_that_was_answered_is_asked_again_after_damage(together):
    """A cable in trouble loses many answers of one request, and few of the others."""
    schedule = Schedule({0x7E8: {0x0C, 0x0D, 0x04, 0x11}}, together=together)
    before = schedule.fast
    for k in range(20):
        request = schedule.next(0.1 * k)
        schedule.note(request, request.parameters)
    for k in range(200):
        request = schedule.next(2.0 + 0.1 * k)
        lost = 0x0D in request.parameters or k % 3 == 0
        schedule.note(request, request.parameters[1:] if lost else request.parameters)
    assert schedule.fast == before


def test_silent_vehicle_loses_no_parameter():
    schedule = Schedule({0x7E8: {0x0C, 0x0D}}, together=False)
    for k in range(60):
        schedule.note(schedule.next(0.1 * k), [])
    assert len(schedule.fast) == 2


def test_vigil():
    vigil = Vigil(0.0)
    for k in range(3):
        assert vigil.why_asleep(4.0) == vigil.why_asleep(6.0) == ""
        vigil.note(1.0 + k, {}, answered=False)
    assert vigil.why_asleep(4.0) == ""
    assert "answer" in vigil.why_asleep(6.0)
    vigil.rested(40.0)
    vigil.note(46.0, {}, answered=False)
    # One answer was waited for, and the host stood still meanwhile.
    assert vigil.why_asleep(46.0) == ""
    running = {"engine_speed": 90.0, "vehicle_speed": 0.0}
    vigil.note(100.0, running, answered=True)
    stopped = {"engine_speed": 0.0, "vehicle_speed": 0.0}
    for k in range(100, 400):
        vigil.note(float(k), stopped, answered=True)
    assert vigil.why_asleep(279.0) == ""
    assert "engine off" in vigil.why_asleep(400.0)
    vigil.voltage(400.0, 13.9)
    assert vigil.why_asleep(401.0) == ""
    vigil.voltage(401.0, 11.5)
    assert "11.8 V" in vigil.why_asleep(401.0)
