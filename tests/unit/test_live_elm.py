import os
import time
import tty
from threading import Event, Thread

import numpy as np
import pytest
from tests.noted import error

from weighbridge import ConfigError
from weighbridge.errors import SourceError
from weighbridge.live import Feed, parse_source
from weighbridge.live.sources.elm import read_reply, read_voltage

elmulator = pytest.importorskip("elmulator")
pytest.importorskip("serialx")

# What a car with a single control unit says, by the request without the count of answers.
CAR = {
    "0100": "7E806410010188000\r",
    "010D0C": "7E806410D320C1F40\r",
    "010411": "7E8054104801133\r",
    "010D": "7E803410D32\r",
    "010C": "7E804410C1F40\r",
    "0104": "7E803410480\r",
    "0111": "7E803411133\r",
}


def scenario(answers=CAR, setup=(), **more):
    """A scenario of an adapter; answers are given with a count of answers and without."""
    entries = [
        {"request": "ATZ", "response_chunks": ["\r\rELM327 v1.5\r\r>"], "echo": True},
        {"request": "ATDPN", "response_chunks": ["A6\r\r>"], "repeat": True},
        {"request": "ATRV", "response_chunks": ["13.9V\r\r>"], "repeat": True},
        *setup,
    ]
    for request, answer in answers.items():
        for command in (request, request + "1"):
            entries.append(
                {"request": command, "response_chunks": [answer + "\r>"], "repeat": True}
            )
    return elmulator.Scenario(elmulator.build_scenario("car", entries, **more))


class PtyAdapter:
    """An emulated adapter in a pseudo-terminal, at a path that stays when it is unplugged."""

    def __init__(self, path, described, **settings):
        self.commands = []
        self._path = path
        self._described = described
        self._settings = settings
        self.plug()

    def plug(self):
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self._path.unlink(missing_ok=True)
        self._path.symlink_to(os.ttyname(self._slave))
        self._gone = Event()
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def unplug(self):
        self._path.unlink()
        self._gone.set()
        self._thread.join()
        os.close(self._slave)
        os.close(self._master)

    def _run(self):
        talk = elmulator.Conversation(self._described, **self._settings)
        text = ""
        os.set_blocking(self._master, False)
        while not self._gone.is_set():
            try:
                text += os.read(self._master, 1024).decode()
            except BlockingIOError:
                time.sleep(0.001)
                continue
            *commands, text = text.split("\r")
            for command in filter(None, commands):
                self.commands.append(command)
                os.write(self._master, talk.send(command).encode())


@pytest.fixture
def adapter(tmp_path):
    made = PtyAdapter(tmp_path / "ttyUSB0", scenario())
    yield made
    if not made._gone.is_set():
        made.unplug()


def read_until(feed, condition, timeout=6.0):
    """Read a feed until a condition holds; return the samples that came."""
    samples = {}
    limit = time.monotonic() + timeout
    while not condition(samples) and time.monotonic() < limit:
        for block in feed.read(0.05):
            for name, (_, values) in block.items():
                samples.setdefault(name, []).extend(values)
    assert condition(samples)
    return samples


def test_car_in_a_pseudo_terminal(adapter):
    with Feed([parse_source(f"elm:{adapter._path}")]) as feed:
        samples = read_until(
            feed, lambda s: {"vehicle_speed", "engine_speed", "engine_load", "throttle"} <= s.keys()
        )
    assert samples["vehicle_speed"][0] == pytest.approx(50.0 / 3.6)
    assert samples["engine_speed"][0] == pytest.approx(2000.0 * np.pi / 30.0)
    assert samples["engine_load"][0] == pytest.approx(128.0 / 255.0)
    allowed = {"ATZ", "ATE0", "ATL0", "ATS0", "ATH1", "ATAT1", "ATSP0", "ATDPN", "ATRV"}
    assert all(c in allowed or (c.startswith("01") and len(c) <= 15) for c in adapter.commands)
    # Several parameters at once, and the adapter is told to wait for one answer.
    assert any(c == "010D0C1" for c in adapter.commands)


def test_car_over_tcp():
    stop, port = elmulator.serve_in_background(scenario())
    try:
        with Feed([parse_source(f"elm:tcp:127.0.0.1:{port}")]) as feed:
            samples = read_until(feed, lambda s: "vehicle_speed" in s)
    finally:
        stop()
    assert samples["vehicle_speed"][0] == pytest.approx(50.0 / 3.6)


def test_clone_that_echoes_without_headers_in_pieces():
    plain = {request: answer[5:] for request, answer in CAR.items()}
    described = scenario(plain, stream_split_bytes=3)
    stop, port = elmulator.serve_in_background(described, echo="on")
    try:
        with Feed([parse_source(f"elm:tcp:127.0.0.1:{port}")]) as feed:
            samples = read_until(feed, lambda s: {"vehicle_speed", "engine_speed"} <= s.keys())
    finally:
        stop()
    assert samples["engine_speed"][0] == pytest.approx(2000.0 * np.pi / 30.0)


def test_adapter_without_counts_and_several_parameters():
    entries = [
        {"request": request + "1", "response_chunks": ["?\r\r>"], "repeat": True} for request in CAR
    ]
    single = {k: v for k, v in CAR.items() if len(k) == 4}
    described = elmulator.build_scenario(
        "car",
        [
            {"request": "ATZ", "response_chunks": ["ELM327 v1.2\r\r>"]},
            {"request": "ATDPN", "response_chunks": ["6\r\r>"], "repeat": True},
            *entries,
            *(
                {"request": k, "response_chunks": [v + "\r>"], "repeat": True}
                for k, v in single.items()
            ),
        ],
    )
    stop, port = elmulator.serve_in_background(elmulator.Scenario(described))
    try:
        with Feed([parse_source(f"elm:tcp:127.0.0.1:{port}")]) as feed:
            samples = read_until(feed, lambda s: {"vehicle_speed", "engine_speed"} <= s.keys())
    finally:
        stop()
    assert samples["vehicle_speed"][0] == pytest.approx(50.0 / 3.6)


def test_unplugged_and_back(adapter, caplog):
    with Feed([parse_source(f"elm:{adapter._path}")], pauses=(0.05, 0.2)) as feed:
        read_until(feed, lambda s: "vehicle_speed" in s)
        adapter.unplug()
        read_until(feed, lambda s: not feed.states()[0].connected)
        assert "plug" in feed.states()[0].error
        read_until(feed, lambda s: feed.states()[0].restarts >= 2)
        adapter.plug()
        read_until(feed, lambda s: feed.states()[0].connected and "vehicle_speed" in s)
        assert feed.states()[0].restarts >= 2
        assert feed.states()[0].error == ""
    told = [r.getMessage() for r in caplog.records if r.name == Feed.__module__]
    assert len(told) == 2
    assert "back" in told[1]


def test_connection_that_breaks_off_is_made_anew():
    setup = [
        {"request": r, "response_chunks": [], "post_action": "disconnect", "prompt": False}
        for r in ("0111", "01111")
    ]
    answers = {k: v for k, v in CAR.items() if "11" not in k[2:]}
    stop, port = elmulator.serve_in_background(scenario(answers, setup))
    try:
        source = parse_source(f"elm:tcp:127.0.0.1:{port}")
        with Feed([source], pauses=(0.05, 0.2)) as feed:
            read_until(feed, lambda s: feed.states()[0].restarts >= 1 and "vehicle_speed" in s)
    finally:
        stop()


def test_silent_vehicle_is_told(tmp_path):
    quiet = PtyAdapter(tmp_path / "tty", scenario({"0100": "SEARCHING...\rUNABLE TO CONNECT\r"}))
    with Feed([parse_source(f"elm:{tmp_path / 'tty'}")]) as feed:
        read_until(feed, lambda s: "does not answer" in feed.states()[0].error)
    # One request alone: the next would come after 30 s.
    assert [c for c in quiet.commands if c.startswith("01")] == ["0100"]
    quiet.unplug()


def test_engine_that_starts_is_noticed_by_the_battery(tmp_path, monkeypatch):
    setup = [
        {"request": "0100", "response_chunks": ["UNABLE TO CONNECT\r\r>"]},
        {"request": "ATRV", "response_chunks": ["12.4V\r\r>"]},
        {"request": "ATRV", "response_chunks": ["12.4V\r\r>"]},
    ]
    described = elmulator.build_scenario(
        "car",
        [
            {"request": "ATZ", "response_chunks": ["ELM327 v1.5\r\r>"]},
            {"request": "ATDPN", "response_chunks": ["A6\r\r>"], "repeat": True},
            *setup,
            {"request": "ATRV", "response_chunks": ["14.1V\r\r>"]},
            *(
                {"request": k + suffix, "response_chunks": [v + "\r>"], "repeat": True}
                for k, v in CAR.items()
                for suffix in ("", "1")
            ),
        ],
    )
    monkeypatch.setattr("weighbridge.live.sources.polling._VOLTAGE_AT_REST", 0.2)
    adapter = PtyAdapter(tmp_path / "tty", elmulator.Scenario(described))
    with Feed([parse_source(f"elm:{tmp_path / 'tty'}")]) as feed:
        read_until(feed, lambda s: "vehicle_speed" in s)
    adapter.unplug()


def test_port_where_nothing_answers(monkeypatch):
    master, slave = os.openpty()
    tty.setraw(slave)
    source = parse_source(f"elm:{os.ttyname(slave)}@38400")
    monkeypatch.setattr("weighbridge.live.sources.elm._RESET", 0.1)
    with error(SourceError, os.ttyname(slave), "ELM327"):
        source.run(lambda _: None, Event())
    os.close(master)
    os.close(slave)


def test_port_that_is_not_there():
    with error(SourceError, "/dev/no_such_port"):
        parse_source("elm:/dev/no_such_port").run(lambda _: None, Event())


def test_adapter_that_says_only_garbage_is_set_up_anew_and_given_up(monkeypatch):
    class Link:
        def __init__(self):
            self.written = []
            self.waiting = b""

        def read(self, timeout):
            data, self.waiting = self.waiting, b""
            return data

        def write(self, data):
            self.written.append(data)
            self.waiting = b"OK\r\r>" if data.startswith(b"AT") else b"\xff\x80@@#\r\r>"

        def close(self):
            pass

    link = Link()
    source = parse_source("elm:x")
    source._links = (lambda: link,)
    monkeypatch.setattr("weighbridge.live.sources.polling.PROBE", 0.0)
    with error(SourceError, "elm:x"):
        source.run(lambda _: None, Event())
    assert link.written.count(b"ATZ\r") == 2
    assert sum(not command.startswith(b"AT") for command in link.written) == 10


@pytest.mark.parametrize(
    ("text", "command", "answers"),
    [
        ("7E8064100BE3EB811\r\r", "0100", {0x7E8: [b"\x41\x00\xbe\x3e\xb8\x11"]}),
        ("7E8 06 41 00 BE 3E B8 11\r\r", "0100", {0x7E8: [b"\x41\x00\xbe\x3e\xb8\x11"]}),
        ("SEARCHING...\r7E803410D32\r", "010D", {0x7E8: [b"\x41\x0d\x32"]}),
        ("SEARCHING...7E803410D32\r", "010D", {0x7E8: [b"\x41\x0d\x32"]}),
        ("010D\r410D32\r", "010D", {0: [b"\x41\x0d\x32"]}),
        ("18DAF11003410D32\r", "010D", {0x18DAF110: [b"\x41\x0d\x32"]}),
        (
            "7E803410D32\r7E903410D33\r",
            "010D",
            {0x7E8: [b"\x41\x0d\x32"], 0x7E9: [b"\x41\x0d\x33"]},
        ),
        # A long answer, with headers and without.
        (
            "7E81008410C1F400D32\r7E8210480AAAAAAAAAA\r",
            "010C0D04",
            {0x7E8: [b"\x41\x0c\x1f\x40\x0d\x32\x04\x80"]},
        ),
        (
            "008\r0:410C1F400D32\r1:0480AAAAAAAAAA\r",
            "010C0D04",
            {0: [b"\x41\x0c\x1f\x40\x0d\x32\x04\x80"]},
        ),
        # ISO 9141: three bytes of header and a sum; SAE J1850: a CRC.
        ("486B10410D3243\r", "010D", {0x10: [b"\x41\x0d\x32"]}),
        ("BUS INIT: ...OK\r486B10410D3243\r", "010D", {0x10: [b"\x41\x0d\x32"]}),
        ("\x007E803410D32\r\x00", "010D", {0x7E8: [b"\x41\x0d\x32"]}),
    ],
)
def test_replies(text, command, answers):
    reply = read_reply(text, command)
    assert reply.answers == answers
    assert reply.trouble == ""


def test_checksum_of_j1850():
    # The CRC worked out by hand from the polynomial x^8 + x^4 + x^3 + x^2 + 1.
    data = bytes.fromhex("486B10410D32")
    crc = 0xFF
    for byte in data:
        for bit in range(7, -1, -1):
            crc = (crc << 1) ^ (0x11D if ((crc >> 7) ^ (byte >> bit)) & 1 else 0)
    text = (data + bytes([crc & 0xFF ^ 0xFF])).hex().upper()
    assert read_reply(text + "\r", "010D").answers == {0x10: [b"\x41\x0d\x32"]}


@pytest.mark.parametrize(
    ("text", "trouble"),
    [
        ("NO DATA\r\r", "NO DATA"),
        ("SEARCHING...\rUNABLE TO CONNECT\r\r", "UNABLE TO CONNECT"),
        ("STOPPED\r", "STOPPED"),
        ("BUS ERROR\r", "BUS ERROR"),
        ("CAN ERROR\r", "CAN ERROR"),
        ("BUFFER FULL\r", "BUFFER FULL"),
        ("7E8 03 41 0D <RX ERROR\r", "RX ERROR"),
        ("BUS INIT: ...ERROR\r", "ERROR"),
        ("?\r", "?"),
        ("ERR94\r", "ERR"),
    ],
)
def test_troubles(text, trouble):
    reply = read_reply(text, "010D")
    assert reply.trouble == trouble
    assert reply.answers == {}


@pytest.mark.parametrize(
    "text",
    [
        "41 0\r",
        "7E8064100BE3E\r",
        "GARBAGE@@\r",
        "486B10410D3244\r",
        "1:0480\r",
        "7F8\r4Z\r",
        "\xff",
    ],
)
def test_garbage_gives_nothing(text):
    reply = read_reply(text, "010D")
    assert all(
        not payload[1:] or payload[0] == 0x41 for p in reply.answers.values() for payload in p
    )
    assert not any(len(payload) > 2 for p in reply.answers.values() for payload in p)


def test_adapter_that_began_anew_is_noticed():
    assert read_reply("\rLV RESET\r", "010D").restarted
    assert read_reply("\r\rELM327 v1.5\r", "010D").restarted


def test_voltage():
    assert read_voltage("12.6V\r") == 12.6
    assert read_voltage("ATRV\r13.9 V\r") == 13.9
    assert read_voltage("?\r") is None
    assert read_voltage("0.0V\r") is None


def test_low_battery_is_left_alone(tmp_path):
    setup = [{"request": "ATRV", "response_chunks": ["11.2V\r\r>"], "repeat": True}]
    described = elmulator.build_scenario(
        "car", [{"request": "ATZ", "response_chunks": ["ELM327 v1.5\r\r>"]}, *setup]
    )
    adapter = PtyAdapter(tmp_path / "tty", elmulator.Scenario(described))
    with Feed([parse_source(f"elm:{tmp_path / 'tty'}")]) as feed:
        read_until(feed, lambda _: "11.8 V" in feed.states()[0].error)
    adapter.unplug()
    assert not [c for c in adapter.commands if not c.startswith("AT")]


class Characteristic:
    def __init__(self, *properties):
        self.properties = properties


class Service:
    def __init__(self, uuid, *characteristics):
        self.uuid = uuid
        self.characteristics = characteristics


class BleAdapter:
    """Stands for a client of bleak, with an emulated adapter behind it."""

    services = (
        Service("00001800-0000-1000-8000-00805f9b34fb", Characteristic("read")),
        Service(
            "0000fff0-0000-1000-8000-00805f9b34fb",
            Characteristic("notify"),
            Characteristic("write-without-response"),
        ),
    )
    last = None

    def __init__(self, address, disconnected_callback, timeout):
        self.left = disconnected_callback
        self.talk = elmulator.Conversation(scenario())
        type(self).last = self

    async def connect(self):
        pass

    async def start_notify(self, characteristic, hear):
        assert "notify" in characteristic.properties
        self.hear = hear

    async def write_gatt_char(self, characteristic, data, response):
        assert not response
        if command := data.decode().strip():
            said = self.talk.send(command).encode()
            for k in range(0, len(said), 20):
                self.hear(None, bytearray(said[k : k + 20]))

    async def disconnect(self):
        pass


def test_bluetooth_adapter_lost_and_back(monkeypatch):
    bleak = pytest.importorskip("bleak")
    monkeypatch.setattr(bleak, "BleakClient", BleAdapter)
    with Feed([parse_source("elm:ble:AA:BB:CC:DD:EE:FF")], pauses=(0.05, 0.1)) as feed:
        samples = read_until(feed, lambda s: "vehicle_speed" in s)
        BleAdapter.last.left(None)
        read_until(feed, lambda s: feed.states()[0].restarts and "vehicle_speed" in s)
    assert samples["vehicle_speed"][0] == pytest.approx(50.0 / 3.6)


def test_bluetooth_device_that_is_no_adapter(monkeypatch):
    bleak = pytest.importorskip("bleak")
    monkeypatch.setattr(bleak, "BleakClient", BleAdapter)
    monkeypatch.setattr(BleAdapter, "services", BleAdapter.services[:1])
    with error(SourceError, "Bluetooth AA:BB:CC:DD:EE:FF ELM327"):
        parse_source("elm:ble:AA:BB:CC:DD:EE:FF").run(lambda _: None, Event())


@pytest.mark.parametrize(
    "text", ["elm:tcp:35000", "elm:tcp:host:none", "elm:ble:", "elm:/dev/x@fast"]
)
def test_places_that_cannot_be(text):
    with pytest.raises(ConfigError):
        parse_source(text)
