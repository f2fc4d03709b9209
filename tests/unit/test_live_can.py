import shutil
import time
from pathlib import Path
from threading import Event, Thread

import numpy as np
import pytest
from tests.noted import error
from tests.simulated_ecu import SimulatedEcu
from tests.unit.test_stream import truck_rows

from weighbridge import ConfigError
from weighbridge.errors import SourceError
from weighbridge.live import Feed, parse_source

can = pytest.importorskip("can")

GOLDEN = Path(__file__).parents[1] / "golden"
MAPPING = {"signals": {"accel_x": {"column": "Sensor.Forward"}}}


@pytest.fixture
def bus(request):
    opened = can.Bus(interface="virtual", channel=request.node.name)
    yield opened
    opened.shutdown()


def frame(identifier, text, *, extended=True):
    return can.Message(arbitration_id=identifier, is_extended_id=extended, data=bytes.fromhex(text))


def read_until(feed, condition, each=lambda: None, timeout=4.0):
    samples = {}
    limit = time.monotonic() + timeout
    while not condition(samples) and time.monotonic() < limit:
        each()
        for block in feed.read(0.05):
            for name, (_, values) in block.items():
                samples.setdefault(name, []).extend(values)
    assert condition(samples)
    return samples


def test_signals_of_a_database_and_foreign_answers(bus, request):
    def send():
        bus.send(frame(2566853172 & 0x1FFFFFFF, "01 E8 03 00 00 00 00 00"))
        bus.send(frame(0x7E8, "03 41 0D 32 00 00 00 00", extended=False))
        bus.send(frame(0x123, "01", extended=False))

    source = parse_source(
        f"can:virtual:{request.node.name}", dbc=[GOLDEN / "golden.dbc"], mapping=MAPPING
    )
    with Feed([source]) as feed:
        samples = read_until(feed, lambda s: len(s) == 2, send)
    assert samples["accel_x"][0] == pytest.approx(1.0)
    assert samples["vehicle_speed"][0] == pytest.approx(50.0 / 3.6)
    # Nothing but what this test sent was on the bus.
    assert bus.recv(0.0) is None


def test_a_mapping_names_the_database_of_a_bus(bus, request, tmp_path):
    shutil.copy(GOLDEN / "golden.dbc", tmp_path)
    mapping = tmp_path / "map.toml"
    mapping.write_text('dbc = "golden.dbc"\n' + '[signals.accel_x]\ncolumn = "Sensor.Forward"\n')
    source = parse_source(f"can:virtual:{request.node.name}", mapping=mapping)
    acceleration = frame(2566853172 & 0x1FFFFFFF, "01 E8 03 00 00 00 00 00")
    with Feed([source]) as feed:
        samples = read_until(feed, lambda s: "accel_x" in s, lambda: bus.send(acceleration))
    assert samples["accel_x"][0] == pytest.approx(1.0)


def test_truck_is_heard_and_nothing_is_sent(bus, request):
    rows = truck_rows()
    sent = iter(rows)

    def send():
        for _, (_, identifier, text) in zip(range(40), sent, strict=False):
            bus.send(frame(identifier, text))

    with Feed([parse_source(f"j1939:virtual:{request.node.name}", listen_only=True)]) as feed:
        read_until(feed, lambda _: True)
        time.sleep(0.2)
        samples = read_until(feed, lambda s: "reference_torque" in s, send)
    assert set(samples["reference_torque"]) == {2000.0}
    assert samples["engine_speed"][0] == pytest.approx(621.0 * np.pi / 30.0)
    assert bus.recv(0.0) is None


def test_silent_bus_is_told_and_comes_back(bus, request, monkeypatch, caplog):
    source = parse_source(f"j1939:virtual:{request.node.name}")
    monkeypatch.setattr(f"{type(source).__module__}.SILENT", 0.3)
    speed = frame(0x18FEF100, "FF 00 32 00 FF FF FF FF")
    with Feed([source]) as feed:
        read_until(feed, lambda s: "vehicle_speed" in s, lambda: bus.send(speed))
        read_until(feed, lambda _: not feed.states()[0].connected)
        assert "no frame" in feed.states()[0].error
        read_until(feed, lambda _: feed.states()[0].connected, lambda: bus.send(speed))
        assert feed.states()[0].restarts == 0
    told = [r for r in caplog.records if r.name == Feed.__module__]
    assert len(told) == 2


def test_interface_that_is_lost_is_opened_anew(request, monkeypatch):
    opened = []

    class Bus:
        def __init__(self):
            opened.append(self)
            self.left = 3

        def recv(self, timeout):
            self.left -= 1
            if self.left < 0:
                raise OSError("No such device")
            message = frame(0x18FEF100, "FF 00 32 00 FF FF FF FF")
            message.timestamp = time.time()
            return message

        def shutdown(self):
            self.left = -99

    monkeypatch.setattr(can, "Bus", lambda **_: Bus())
    with Feed([parse_source("j1939:socketcan:can0")], pauses=(0.02, 0.1)) as feed:
        read_until(feed, lambda s: len(opened) >= 3)
        assert feed.states()[0].restarts >= 2
    assert all(bus.left == -99 for bus in opened)


def test_what_is_asked_of_the_interface(monkeypatch):
    asked = []

    def bus(**settings):
        asked.append(settings)
        raise can.CanInitializationError("not there")

    monkeypatch.setattr(can, "Bus", bus)
    for text in ("can:slcan:/dev/ttyACM0@500000", "can:socketcan:can1"):
        with error(SourceError, text):
            parse_source(text, listen_only=True).run(lambda _: None, Event())
    assert asked[0]["bitrate"] == 500000
    assert asked[0]["listen_only"]
    assert not asked[0]["receive_own_messages"]
    assert "listen_only" not in asked[1]
    assert "bitrate" not in asked[1]


@pytest.mark.parametrize(
    "text", ["can:can0", "can:socketcan:", "can:virtual:x@fast", "canbus:x", "can", "obd:", ""]
)
def test_places_that_cannot_be(text):
    with pytest.raises(ConfigError):
        parse_source(text)


def test_interface_that_no_one_knows():
    with error(ConfigError, "can:no_such_thing:can0 python-can"):
        parse_source("can:no_such_thing:can0").run(lambda _: None, Event())


@pytest.mark.parametrize("text", ["can:virtual:{}", "j1939:virtual:{}", "obd:virtual:{}"])
def test_stop_ends_a_source_within_a_second(text, request):
    stop = Event()
    source = parse_source(text.format(request.node.name))
    thread = Thread(target=source.run, args=(lambda _: None, stop), daemon=True)
    with SimulatedEcu(request.node.name, {0x0D: b"\x00"}) as ecu:
        thread.start()
        time.sleep(0.2)
        stop.set()
        thread.join(1.0)
        assert not thread.is_alive()
        if not text.startswith("obd"):
            assert ecu.heard == []
