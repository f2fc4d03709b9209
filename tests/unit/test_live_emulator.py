"""Emulated devices, heard by the sources that hear real ones."""

import datetime as dt
import math
import socket
import time
from contextlib import contextmanager
from threading import Event

import numpy as np
import pytest
from tests.noted import error
from tests.ports import free_ports

from weighbridge import ConfigError, Drive, DriveError, Signal
from weighbridge.errors import SourceError
from weighbridge.io import read_sentence
from weighbridge.io.obd import LENGTHS, PIDS, bytes_of, parameters_of, values_of
from weighbridge.live import Feed, Played, clock, devices, parse_source
from weighbridge.live.emulator import InertialLines, Sentences
from weighbridge.live.sources.elm import read_reply
from weighbridge.live.sources.lines import LineReader
from weighbridge.live.sources.schedule import supported_of

IMU = tuple(f"{kind}_{axis}" for kind in ("accel", "gyro") for axis in "xyz")


def ramp(name, low, high, period, end=60.0):
    stamps = np.arange(0.0, end + period / 2.0, period) + 1000.0
    return Signal(name, stamps, np.linspace(low, high, stamps.size))


def made(*left_out):
    """A minute of a car that speeds up evenly, south of the equator and west of Greenwich."""
    signals = (
        ramp("vehicle_speed", 0.0, 30.0, 0.2),
        ramp("engine_speed", 80.0, 400.0, 0.2),
        ramp("engine_load", 0.2, 0.8, 0.2),
        ramp("gear", 1.0, 4.0, 20.0),
        ramp("reference_torque", 300.0, 300.0, 30.0),
        ramp("latitude", math.radians(-33.99999), math.radians(-33.97), 1.0),
        ramp("longitude", math.radians(-70.60001), math.radians(-70.58), 1.0),
        ramp("altitude", -3.5, 300.0, 1.0),
        ramp("gnss_speed", 0.0, 30.0, 1.0),
        ramp("gnss_course", 6.2, 6.5, 1.0),
        ramp("gnss_accuracy", 2.0, 4.0, 1.0),
        *(ramp(name, -1.0 - k, 1.0 + k, 0.01) for k, name in enumerate(IMU)),
    )
    return Drive("made", {s.name: s for s in signals if s.name not in left_out})


@pytest.fixture(scope="module")
def drive():
    return made()


@contextmanager
def emulated(drive, rate=1.0):
    ports = free_ports()
    played = drive if isinstance(drive, Played) else Played(drive, rate)
    with devices(played, **ports, stop=Event()) as sources:
        yield sources, ports


@contextmanager
def talk(drive, rate=1.0):
    """Say commands to an emulated adapter, each answered up to its prompt."""
    with (
        emulated(drive, rate) as (_, ports),
        socket.create_connection(("127.0.0.1", ports["adapter"]), timeout=10.0) as link,
    ):

        def say(command):
            link.sendall(f"{command}\r".encode())
            answer = b""
            while not answer.endswith(b">"):
                answer += link.recv(4096)
            return answer.decode()

        yield say


@pytest.fixture(scope="module")
def standing(drive):
    """An adapter whose vehicle hardly moves."""
    with talk(drive, 1e-3) as say:
        yield say


def test_bytes_say_what_is_read_from_them():
    rng = np.random.default_rng(8)
    for number in sorted({p.number for p in PIDS}):
        for _ in range(20):
            raw = rng.integers(0, 256, LENGTHS[number], np.uint8).tobytes()
            values = values_of(number, raw)
            assert values_of(number, bytes_of(number, values)) == values
    assert bytes_of(0x0D, {"vehicle_speed": 100.4 / 3.6}) == b"\x64"
    assert bytes_of(0x0D, {"vehicle_speed": 400.0}) == b"\xff"
    assert bytes_of(0x62, {"engine_torque_fraction": -2.0}) == b"\x00"


def test_the_vehicle_waits_for_the_first_question(drive):
    played = Played(drive, 50.0)
    with talk(played) as say:
        for command in ("ATZ", "ATE0", "ATRV", "ATDPN", "0902"):
            say(command)
        time.sleep(0.05)
        assert played.time == 1000.0
        assert not played.begun.is_set()
        begun = time.monotonic()
        say("0100")
        asked = time.monotonic()
        time.sleep(0.2)
        least = time.monotonic() - asked
        passed = (played.time - 1000.0) / 50.0
        assert least <= passed <= time.monotonic() - begun
        before = played.time
        speed = values_of(0x0D, parameters_of(next(iter(said(say, "010D"))))[0x0D])["vehicle_speed"]
        assert before - 1.0 <= 1000.0 + 2.0 * speed <= played.time + 1.0
        time.sleep(1.2)
        assert played.ended
        assert "NO DATA" in say("010D")


def said(say, command):
    reply = read_reply(say(command).partition(">")[0], command)
    return [payload for payloads in reply.answers.values() for payload in payloads]


@pytest.mark.parametrize("headers", "01")
@pytest.mark.parametrize("spaces", "01")
@pytest.mark.parametrize("feeds", "01")
@pytest.mark.parametrize("echo", "01")
def test_answers_in_every_dress(standing, headers, spaces, feeds, echo):
    assert "ELM327 v1.5" in standing("ATZ")
    for switch in (f"ATH{headers}", f"ATS{spaces}", f"ATL{feeds}", f"at e{echo}"):
        assert standing(switch).endswith(">")
    shown = standing("010D")
    assert shown.startswith("010D\r") == (echo == "1")
    assert ("7E8" in shown) == (headers == "1")
    assert ("41 0D" in shown) == (spaces == "1")
    assert ("\r\n" in shown) == (feeds == "1")
    assert said(standing, "010D0C1") == [b"\x41\x0d\x00\x0c\x0b\xf0"]
    # Longer than a frame: load, gear, speed, engine speed and reference torque.
    (answer,) = said(standing, "0104A40D0C63")
    found = {}
    for number, raw in parameters_of(answer).items():
        found |= values_of(number, raw)
    assert found == pytest.approx(
        {
            "engine_load": 0.2, "gear": 1.0, "vehicle_speed": 0.0, "engine_speed": 80.0,
            "reference_torque": 300.0,
        },
        abs=0.03,
    )  # fmt: skip
    (lists,) = said(standing, "010060A0")
    found = {n for first, raw in parameters_of(lists).items() for n in supported_of(first, raw)}
    assert found >= {0x04, 0x0C, 0x0D, 0x63, 0xA4}
    assert not {0x05, 0x62} & found


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        ("ATI", "ELM327 v1.5"), ("ATRV", "14.1V"), ("ATDPN", "A6"), ("ATSP0", "OK"),
        ("ATAT1", "OK"), ("ATST64", "OK"), ("ATNONSENSE", "?"), ("HELLO", "?"), ("0", "?"),
        ("0105", "NO DATA"), ("0902", "NO DATA"), ("03", "NO DATA"), ("01", "NO DATA"),
    ],
)  # fmt: skip
def test_other_commands(standing, command, answer):
    standing("ATZ")
    standing("ATE0")
    assert standing(command) == f"{answer}\r\r>"
    assert standing("") == f"{answer}\r\r>"


def test_sentences_say_where_the_drive_was(drive):
    date = dt.datetime(2026, 12, 31, 23, 59, 50, 500_000, tzinfo=dt.UTC)
    sentences = Sentences(drive, date)
    texts = sentences.between(1000.0, 1020.0).decode().splitlines()
    assert len(texts) == 3 * 20
    parts = [sentences.between(a, a + 5.0) for a in (1000.0, 1005.0, 1010.0, 1015.0)]
    assert b"".join(parts).decode().splitlines() == texts
    for k, text in enumerate(texts):
        found, at = read_sentence(text), np.array([1001.0 + k // 3])
        truth = {n: float(drive.signals[n].at(at)[0]) for n in drive.signals}
        assert found.clock == pytest.approx((86_390.5 + 1 + k // 3) % 86_400.0)
        if found.kind == "GST":
            assert found.spread == pytest.approx(truth["gnss_accuracy"], abs=0.01)
            continue
        assert math.radians(found.place[0]) == pytest.approx(truth["latitude"], abs=1e-9)
        assert math.radians(found.place[1]) == pytest.approx(truth["longitude"], abs=1e-9)
        if found.kind == "RMC":
            assert found.motion[0] * 1852.0 / 3600.0 == pytest.approx(truth["gnss_speed"], abs=1e-3)
            course = math.degrees(truth["gnss_course"]) % 360.0
            assert found.motion[1] == pytest.approx(course, abs=0.01)
        else:
            assert found.place[2] == pytest.approx(truth["altitude"], abs=0.01)
    days = {read_sentence(t).day for t in texts if "RMC" in t}
    assert days == {20_818 * 86_400.0, 20_819 * 86_400.0}


def test_lines_say_what_the_sensor_felt(drive):
    lines = InertialLines(drive).between(1000.0, 1001.0)
    assert len(lines) == 100
    rows = LineReader("lines:-").read(b"".join(lines), 5.0)
    assert [values.keys() for _, values in rows] == [set(IMU)] * 100
    for name in IMU:
        np.testing.assert_allclose(
            [values[name] for _, values in rows], drive.signals[name].values[1:101], atol=6e-6
        )


def test_sources_hear_the_drive_at_its_rate(drive):
    rate = 6.0
    samples = {}
    with (
        clock.at_rate(rate),
        emulated(drive, rate) as (sources, _),
        Feed([parse_source(source) for source in sources]) as feed,
    ):
        limit = time.monotonic() + 12.0
        while time.monotonic() < limit and (samples.get("altitude", ([0.0], [0.0]))[1][-1] < 150.0):
            for block in feed.read(0.05):
                for name, (times, values) in block.items():
                    kept = samples.setdefault(name, ([], []))
                    kept[0].extend(times)
                    kept[1].extend(values)
    assert set(IMU) <= samples.keys()
    # All on one clock: what rises evenly in the drive rises as fast where it is heard, at once.
    slopes = {"vehicle_speed": 0.5, "gnss_speed": 0.5, "accel_x": 2.0 / 60.0}
    origins = []
    for name, slope in slopes.items():
        times, values = map(np.array, samples[name])
        moving = values > values[0]
        fitted, at_zero = np.polyfit(times[moving] - times[0], values[moving], 1)
        assert fitted == pytest.approx(slope, rel=0.05), name
        start = -1.0 if name == "accel_x" else 0.0
        origins.append(times[0] + (start - at_zero) / fitted)
    assert np.ptp(origins) < 1.0
    assert len(samples["accel_x"][0]) > 2000


def test_what_the_drive_has_not_is_not_emulated():
    with emulated(made("gyro_z", "latitude")) as (sources, ports):
        assert sources == [f"elm:tcp:127.0.0.1:{ports['adapter']}"]


@pytest.mark.parametrize(
    ("left_out", "said"),
    [
        (("vehicle_speed",), "made vehicle_speed OBD-II"),
        (("engine_speed", "engine_load"), "engine_speed engine_torque_fraction engine_load"),
    ],
)
def test_a_drive_without_an_engine_is_refused(left_out, said):
    with error(DriveError, said):
        Played(made(*left_out))


@pytest.mark.parametrize("rate", [0.0, -1.0, math.inf, math.nan])
def test_rates(drive, rate):
    with pytest.raises(ConfigError, match="--rate"):
        Played(drive, rate)


def test_a_port_in_use_is_told(drive):
    ports = free_ports()
    with (
        socket.create_server(("127.0.0.1", ports["adapter"])),
        error(SourceError, ports["adapter"]),
        devices(Played(drive), **ports, stop=Event()),
    ):
        pass


def test_the_clock_goes_on_without_a_jump():
    before, counter = clock.now(), time.monotonic()
    with clock.at_rate(10.0):
        assert clock.now() - before < 0.05
        time.sleep(0.1)
        fast = clock.now()
        assert fast - before == pytest.approx(10.0 * (time.monotonic() - counter), abs=0.1)
    assert 0.0 <= clock.now() - fast < 0.1
    time.sleep(0.05)
    assert clock.now() - fast < 0.5
