import json
import os
import socket
import time
from threading import Event, Thread

import numpy as np
import pytest
from tests.noted import error

from weighbridge import ConfigError
from weighbridge.errors import SourceError
from weighbridge.live import Feed, parse_source
from weighbridge.live.sources.lines import LONGEST, LineReader, LinesSource


def read(*lines, arrived=100.0):
    reader = LineReader("lines:-")
    return reader, reader.read(b"".join(line + b"\n" for line in lines), arrived)


def test_line_of_an_inertial_sensor():
    _, rows = read(b'{"t": 5.0, "accel": [0.1, 0, -9.81], "gyro": [0, 0.01, -0.02]}')
    ((time_, values),) = rows
    assert time_ == 100.0
    assert values == {
        "accel_x": 0.1, "accel_y": 0.0, "accel_z": -9.81,
        "gyro_x": 0.0, "gyro_y": 0.01, "gyro_z": -0.02,
    }  # fmt: skip


def test_any_signal_with_its_unit():
    _, rows = read(
        b'{"vehicle_speed_kmh": 36, "engine_torque_nm": 120.5, "engine_torque_pct": 30}',
        b'{"t": null, "speed_mps": 4.2, "latitude_deg": 180, "gear": 3}',
    )
    assert rows[0][1] == pytest.approx(
        {"vehicle_speed": 10.0, "engine_torque": 120.5, "engine_torque_fraction": 0.3}
    )
    assert rows[1][1]["gnss_speed"] == 4.2
    assert rows[1][1]["gear"] == 3.0
    assert {t for t, _ in rows} == {100.0}


def test_stamps_keep_their_spacing():
    reader = LineReader("lines:-")
    times = []
    for k, late in enumerate((0.0, 0.08, 0.01, 0.3)):
        line = json.dumps({"t": 7.0 + 0.1 * k, "gear": 1}).encode() + b"\n"
        times += [t for t, _ in reader.read(line, 50.0 + 0.1 * k + late)]
    assert [t - times[0] for t in times] == pytest.approx([0.0, 0.1, 0.2, 0.3])


class Sender:
    """A sender with a clock of its own."""

    def __init__(self):
        self.reader = LineReader("lines:-")

    def host(self, stamp, arrived):
        """Instant by the host's clock of a line that it stamps so, and that arrives then [s]."""
        line = json.dumps({"t": stamp, "gear": 1}).encode() + b"\n"
        ((time, _),) = self.reader.read(line, arrived)
        return time


def test_clock_of_a_device_keeps_its_spacing():
    rng = np.random.default_rng(2)
    clock = Sender()
    stamps = 5000.0 + 0.1 * np.arange(600)
    late = rng.exponential(0.03, 600)
    late[::50] = 0.0
    host = [clock.host(s, 1.7e9 + s - 5000.0 + d) for s, d in zip(stamps, late, strict=True)]
    error = np.array(host) - 1.7e9 - (stamps - 5000.0)
    assert abs(error[1:]).max() < 1e-6 + late.max()
    assert np.ptp(error[100:]) < 1e-6


@pytest.mark.parametrize("jump", [-3600.0, 3600.0, -1.7e9])
def test_clock_of_a_device_that_is_set(jump):
    clock = Sender()
    error = []
    for k in range(1000):
        true = 1e6 + 0.02 * k
        error.append(clock.host(true + (jump if k >= 500 else 0.0), true + 0.01) - true)
    assert max(map(abs, error[:500])) < 0.02
    # Set back, it is believed after two seconds; set forward at once.
    assert max(map(abs, error[610:])) < 0.02


def test_one_false_stamp_does_no_lasting_harm():
    clock = Sender()
    error = []
    for k in range(1000):
        true = 1e6 + 0.02 * k
        error.append(clock.host(9e9 if k == 300 else true, true + 0.01) - true)
    assert max(map(abs, error[410:])) < 0.02


def test_clock_that_drifts_is_followed():
    clock = Sender()
    for k in range(20_000):
        true = 0.1 * k
        error = clock.host(true * (1.0 - 50e-6), true + 0.01) - true
    assert abs(error - 0.01) < 2e-3


@pytest.mark.parametrize(
    "line",
    [
        b"garbage", b"{", b"[1, 2]", b"12", b'{"accel": [1, 2]}', b'{"accel": 1}',
        b'{"accel": [1, 2, "x"]}', b'{"gear": "third"}', b'{"t": "noon", "gear": 1}',
        b'{"accel": [1, 2, NaN]}', b'{"gear": 1e999}', b'{"gear": true}', b"\xff\xfe",
        b"[" * 20_000, b'{"accel": [1, 2, ' + b"9" * 400 + b"]}",
    ],
)  # fmt: skip
def test_bad_lines_are_left_out_and_told_once(line, caplog):
    reader, rows = read(line, line, b'{"gear": 2}', line)
    assert [values for _, values in rows] == [{"gear": 2.0}]
    assert reader.bad == 3
    assert len(caplog.records) == 1


def test_unknown_signals_are_told_once_and_the_rest_is_taken(caplog):
    _, rows = read(*[b'{"gear": 2, "vehicle_sped_kmh": 3, "vehicle_speed": 3}'] * 5)
    assert [values for _, values in rows] == [{"gear": 2.0}] * 5
    told = [r.getMessage() for r in caplog.records]
    assert len(told) == 2
    assert "did you mean vehicle_speed_kmh?" in told[0]
    assert "carries no unit" in told[1]


def test_lines_in_pieces_and_without_end():
    reader = LineReader("lines:-")
    data = b'{"gear": 1}\n{"gear": 2}\n'
    rows = [row for k in range(len(data)) for row in reader.read(data[k : k + 1], 1.0)]
    assert [values["gear"] for _, values in rows] == [1.0, 2.0]
    for _ in range(100):
        reader.read(b"x" * LONGEST, 1.0)
    assert len(reader._text) <= LONGEST


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.bind(("127.0.0.1", 0))
        return opened.getsockname()[1]


def test_datagrams():
    port = free_port()
    with (
        Feed([parse_source(f"lines:udp:{port}")]) as feed,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        gears = []
        limit = time.monotonic() + 4.0
        while len(gears) < 4 and time.monotonic() < limit:
            sender.sendto(b'{"gear": 1}\n{"gear": 2}', ("127.0.0.1", port))
            gears += [g for block in feed.read(0.1) for g in block["gear"][1]]
        assert gears[:4] == [1.0, 2.0, 1.0, 2.0]


def test_port_in_use():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with error(SourceError, "127.0.0.1"):
            parse_source(f"lines:udp:{port}").run(lambda _: None, Event())


def test_loopback_is_bound_unless_a_host_is_named(monkeypatch):
    bound = []
    monkeypatch.setattr(
        "weighbridge.live.sources.lines._datagrams", lambda host, port: bound.append((host, port))
    )
    for text in ("lines:udp:5005", "lines:udp:0.0.0.0:5006"):
        with pytest.raises(AttributeError):
            parse_source(text)._open().__enter__()
    assert bound == [("127.0.0.1", 5005), ("0.0.0.0", 5006)]


class Standard:
    def __init__(self, number):
        self._number = number

    def fileno(self):
        return self._number


def test_standard_input_ends_with_its_sender(monkeypatch):
    reading, writing = os.pipe()
    monkeypatch.setattr("sys.stdin", Standard(reading))
    os.write(writing, b'{"gear": 1}\n{"gear": 2}\n')
    with Feed([parse_source("lines:-")]) as feed:
        gears = [g for block in feed.read(2.0) for g in block["gear"][1]]
        assert gears == [1.0, 2.0]
        assert not feed.ended
        os.close(writing)
        limit = time.monotonic() + 2.0
        while not feed.ended and time.monotonic() < limit:
            feed.read(0.05)
        assert feed.ended
    os.close(reading)


def test_stop_ends_standard_input_within_a_second(monkeypatch):
    reading, writing = os.pipe()
    monkeypatch.setattr("sys.stdin", Standard(reading))
    stop = Event()
    source = parse_source("lines:-")
    assert isinstance(source, LinesSource)
    thread = Thread(target=source.run, args=(lambda _: None, stop), daemon=True)
    thread.start()
    stop.set()
    thread.join(1.0)
    assert not thread.is_alive()
    os.close(reading)
    os.close(writing)


@pytest.mark.parametrize("text", ["lines:udp", "lines:tcp:1", "lines:udp:x", "lines:udp:70000"])
def test_places_that_cannot_be(text):
    with pytest.raises(ConfigError):
        parse_source(text)
