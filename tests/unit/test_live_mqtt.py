"""Weighings to a broker of MQTT that comes and goes."""

import asyncio
import json
import logging
import math
import sqlite3
import threading
import time
from contextlib import contextmanager
from dataclasses import replace

import pytest
from tests.noted import error
from tests.unit.made_weighings import drive, weighing

from weighbridge import ConfigError, LiveStatus, WeighbridgeError
from weighbridge.live import Alert, Mqtt, parse_broker

amqtt_broker = pytest.importorskip("amqtt.broker", reason="amqtt is not installed")
from amqtt.plugins.base import BasePlugin  # noqa: E402

pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


class Taken(BasePlugin):
    """Notes what the broker has taken, as (topic, payload, retained), in order of confirmation."""

    messages: list = []  # noqa: RUF012
    open: dict = {}  # noqa: RUF012

    async def on_mqtt_packet_received(self, *, packet, session=None):
        if type(packet).__name__ == "PublishPacket":
            told = packet.topic_name, bytes(packet.payload.data), packet.retain_flag
            self.open[session.client_id, packet.packet_id] = told

    async def on_mqtt_packet_sent(self, *, packet, session=None):
        if type(packet).__name__ == "PubackPacket":
            told = self.open.pop((session.client_id, packet.packet_id))
            self.messages.append(told)

    @classmethod
    def of(cls, topic):
        return [payload for t, payload, _ in cls.messages if t == topic]


@contextmanager
def broker(port=0):
    """Run a broker in a thread, which ends as one that crashes; yields its port."""
    loop = asyncio.new_event_loop()
    plugins = {
        "amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True},
        f"{__name__}.Taken": {},
    }
    config = {
        "listeners": {"default": {"type": "tcp", "bind": f"127.0.0.1:{port}"}},
        "plugins": plugins,
    }
    made = {}

    async def begin():
        made["broker"] = amqtt_broker.Broker(config, loop=loop)
        await made["broker"].start()
        server = next(iter(made["broker"]._servers.values()))
        return server.instance.sockets[0].getsockname()[1]

    async def crash():
        for server in made["broker"]._servers.values():
            server.instance.close()
        transports = list(loop._transports.values())
        for transport in transports:
            transport.pause_reading()
        # A confirmation is noted only after it was sent: what was read is confirmed and noted.
        end = loop.time() + 5.0
        while Taken.open and loop.time() < end:
            await asyncio.sleep(0.01)
        for transport in transports:
            transport.abort()
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()
    try:
        yield asyncio.run_coroutine_threadsafe(begin(), loop).result(20)
    finally:
        asyncio.run_coroutine_threadsafe(crash(), loop).result(20)
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


def until(true, seconds=30.0):
    """Wait for something that must come."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.01)


@pytest.fixture(autouse=True)
def nothing_taken():
    Taken.messages.clear()
    Taken.open.clear()
    logging.getLogger("amqtt").setLevel(logging.CRITICAL)
    logging.getLogger("transitions").setLevel(logging.CRITICAL)


def sender(port, folder, **kwargs):
    kwargs = {"period": 0.0, "pauses": (0.05, 0.2), **kwargs}
    place = parse_broker(f"mqtt://127.0.0.1:{port}/fleet")
    return Mqtt(place, "Delivery van", folder / "outbox.sqlite", **kwargs)


def lost(folder, name="outbox.sqlite"):
    """A sender whose broker is not there: all that it is shown waits."""
    return Mqtt(parse_broker("mqtt://127.0.0.1:1/fleet"), "Delivery van", folder / name, period=0.0)


def held(mqtt):
    """Instants of the weighings that wait."""
    waiting = mqtt._outbox.after(0, 9999)
    return [json.loads(m.payload)["time_s"] for m in waiting if m.topic == TOPIC]


def in_order(payloads):
    """Each once, in the order of its first coming."""
    return list(dict.fromkeys(payloads))


TOPIC = "fleet/delivery-van/weighing"


def test_weighings_go_to_their_topics_and_are_retained(tmp_path):
    with broker() as port:
        mqtt = sender(port, tmp_path)
        told = list(drive(300))
        for w in told:
            mqtt.show(w)
        until(lambda: mqtt.waiting == 0)
        mqtt.close()
        until(lambda: Taken.of("fleet/delivery-van/available")[-1:] == [b"offline"])
    found = [json.loads(p) for p in Taken.of(TOPIC)]
    assert [f["time_s"] for f in found] == [w.time for w in told]
    assert found[-1] == json.loads(json.dumps(told[-1].to_dict()))
    assert all(retained for *_, retained in Taken.messages)
    assert Taken.of("fleet/delivery-van/available")[0] == b"online"
    vss = Taken.of("fleet/delivery-van/Vehicle/CurrentOverallWeight")
    weighed = [w.status is LiveStatus.WEIGHED for w in told]
    assert vss == [
        f"{w.mass:.0f}".encode() if yes else b"" for w, yes in zip(told, weighed, strict=True)
    ]


def described(folder, sides=()):
    """Entities of the one message to Home Assistant, what they share filled in."""
    with broker() as port:
        mqtt = sender(port, folder, sides=sides)
        until(lambda: Taken.of("fleet/delivery-van/available"))
        mqtt.close()
    told = {t: json.loads(p) for t, p, _ in Taken.messages if t.startswith("homeassistant/") and p}
    ((topic, whole),) = told.items()
    assert topic == "homeassistant/device/weighbridge_delivery-van/config"
    shared = {k: v for k, v in whole.items() if k not in ("dev", "o", "cmps")}
    return whole, {k: {**shared, **e} for k, e in whole["cmps"].items()}


def test_home_assistant_is_told_of_one_device_in_one_message(tmp_path):
    whole, entities = described(tmp_path)
    assert whole["dev"]["ids"] == ["weighbridge_delivery-van"]
    assert whole["dev"]["name"] == "Delivery van"
    assert whole["o"]["name"] == "weighbridge"
    # Of an alert that nobody watches only the platform is named: that takes it back.
    assert [k for k, e in whole["cmps"].items() if e == {"p": "binary_sensor"}] == [
        "above",
        "below",
    ]
    shown = {k: e for k, e in entities.items() if "value_template" in e}
    assert list(shown) == [
        "mass", "std", "payload", "status", "progress", "overload", "kerb_change", "parked"
    ]  # fmt: skip
    assert len({e["unique_id"] for e in shown.values()}) == 8
    for entity in shown.values():
        assert entity["p"] in ("sensor", "binary_sensor")
        assert entity["state_topic"] == TOPIC
        assert entity["availability_topic"] == "fleet/delivery-van/available"
    old = [t for t, p, _ in Taken.messages if t.startswith("homeassistant/") and not p]
    assert "homeassistant/sensor/weighbridge_delivery-van/mass/config" in old


def test_the_templates_of_home_assistant_fit_a_weighing(tmp_path):
    jinja2 = pytest.importorskip("jinja2", reason="Home Assistant's templates are jinja2's")
    _, entities = described(tmp_path, sides=["above"])
    rendered = jinja2.Environment(autoescape=False).from_string

    def shown(key, w, field="value_template"):
        return rendered(entities[key][field]).render(value_json=json.loads(json.dumps(w.to_dict())))

    alert = Alert(2050.0)
    alert.look(weighing())
    w = weighing(
        alerts=(alert.state(weighing()),),
        parked=True,
        kerb=replace(weighing().kerb, change=210.0, std=50.0),
    )
    keys = ("mass", "status", "parked", "progress", "kerb_change")
    assert [shown(k, w) for k in keys] == ["2100.0", "weighed", "ON", "100.0", "210.0"]
    first = next(iter(drive(1)))
    assert [shown(k, first) for k in keys] == ["None", "learning", "OFF", "None", "None"]
    assert json.loads(shown("status", w, "json_attributes_template"))["advice"] == w.advice
    assert entities["above"]["device_class"] == "problem"
    assert [shown("above", told) for told in (w, replace(w, alerts=()))] == ["ON", "OFF"]
    # 2100 kg with a standard deviation of 25 kg is two of them above.
    assert w.to_dict()["alerts"] == [
        {
            "side": "above",
            "limit_kg": 2050.0,
            "active": True,
            "probability": pytest.approx(0.9772, abs=1e-4),
        }
    ]


def test_an_alert_is_sent_at_once(tmp_path):
    with broker() as port:
        pass
    mqtt = sender(port, tmp_path, sides=["above"], period=5.0)
    alert = Alert(2050.0)
    for w in (weighing(300.0, mass=2000.0), weighing(301.0), weighing(302.0)):
        alert.look(w)
        mqtt.show(replace(w, alerts=(alert.state(w),)))
    sent = [json.loads(m.payload) for m in mqtt._outbox.after(0, 99) if m.topic == TOPIC]
    mqtt.close()
    assert [w["alerts"][0]["active"] for w in sent] == [False, True]


@pytest.mark.parametrize("name", ["vehicle", "雪"])
def test_scales_of_vehicles_without_a_name_share_no_topic_and_keep_theirs(tmp_path, name):
    def node(folder, name):
        mqtt = Mqtt(parse_broker("mqtt://127.0.0.1:1/fleet"), name, tmp_path / folder / "box")
        mqtt.close()
        return mqtt._topics.weighing, json.loads(mqtt._topics.discovery()[-1][1])["dev"]

    one, other, again = node("a", name), node("b", name), node("a", name)
    assert one == again
    assert one[0] != other[0]
    assert one[1]["ids"] != other[1]["ids"]
    assert one[1]["name"] != other[1]["name"]
    assert one[0].startswith("fleet/vehicle-")
    assert node("c", "Truck 7")[0] == "fleet/truck-7/weighing"
    assert node("d", "Müller's Bus #3/+")[0] == "fleet/muller-s-bus-3/weighing"


def test_nothing_is_lost_while_the_broker_restarts_and_the_order_stays(tmp_path, caplog):
    with broker() as port:
        mqtt = sender(port, tmp_path)
        for w in drive(100):
            mqtt.show(w)
        until(lambda: len(Taken.of(TOPIC)) >= 20)
    # The broker is gone, in the middle of it.
    for w in drive(200, begin=100.0):
        mqtt.show(w)
    assert mqtt.waiting > 200
    with broker(port):
        for w in drive(100, begin=300.0):
            mqtt.show(w)
        until(lambda: mqtt.waiting == 0)
        mqtt.close()
    times = [json.loads(p)["time_s"] for p in in_order(Taken.of(TOPIC))]
    assert times == [float(k) for k in range(400)]
    assert mqtt.dropped == 0
    words = [r.getMessage() for r in caplog.records if "mqtt://" in r.getMessage()]
    assert len(words) == 2
    assert "messages wait until it is back" in words[0]
    assert "is back" in words[1]


def test_what_a_process_could_not_send_the_next_one_does(tmp_path):
    with broker() as port:
        pass
    mqtt = sender(port, tmp_path)
    for w in drive(50):
        mqtt.show(w)
    mqtt.close()
    with broker(port):
        later = sender(port, tmp_path)
        later.show(weighing(1000.0))
        until(lambda: later.waiting == 0)
        later.close()
    times = [json.loads(p)["time_s"] for p in in_order(Taken.of(TOPIC))]
    assert times == [*(float(k) for k in range(50)), 1000.0]


def test_beyond_the_limit_the_oldest_are_dropped_and_counted_and_told_once(tmp_path, caplog):
    with broker() as port:
        pass
    mqtt = sender(port, tmp_path, most=60)
    for w in drive(100):
        mqtt.show(w)
    assert (mqtt.waiting, mqtt.dropped) == (60, 140)
    with broker(port):
        until(lambda: mqtt.waiting == 0)
        mqtt.close()
    times = [json.loads(p)["time_s"] for p in in_order(Taken.of(TOPIC))]
    assert times == [float(k) for k in range(70, 100)]
    assert sum("the oldest are dropped" in r.getMessage() for r in caplog.records) == 1


def test_a_killed_connection_leaves_the_last_will(tmp_path):
    from amqtt.client import MQTTClient

    async def heard(port, kill):
        client = MQTTClient(config={"auto_reconnect": False})
        await client.connect(f"mqtt://127.0.0.1:{port}/")
        await client.subscribe([("fleet/delivery-van/available", 1)])
        kill()
        while True:
            message = await client.deliver_message(timeout_duration=20)
            if bytes(message.data) == b"offline":
                return

    sessions = []
    with broker() as port, pytest.MonkeyPatch.context() as patch:
        begin = Mqtt.__module__ + "._Session.begin"
        original = __import__(Mqtt.__module__, fromlist=["x"])._Session.begin
        patch.setattr(begin, lambda s: (sessions.append(s), original(s))[1])
        mqtt = sender(port, tmp_path, pauses=(60.0, 60.0))
        until(lambda: b"online" in Taken.of("fleet/delivery-van/available"))
        asyncio.run(heard(port, lambda: sessions[0]._client.socket().close()))
        mqtt.close()


def test_a_refused_password_is_told_without_the_password(tmp_path, caplog):
    place = parse_broker("mqtt://me:secret%20word@127.0.0.1:1")
    assert (place.user, place.password) == ("me", "secret word")
    mqtt = Mqtt(place, "van", tmp_path / "outbox.sqlite", pauses=(0.01, 0.01))
    until(lambda: caplog.records)
    mqtt.close()
    assert "mqtt://127.0.0.1:1" in caplog.text
    assert "secret" not in caplog.text + repr(place)


@pytest.mark.parametrize(
    ("url", "port", "tls", "prefix"),
    [
        ("mqtt://host", 1883, False, "weighbridge"),
        ("mqtts://host/", 8883, True, "weighbridge"),
        ("mqtt://[::1]:99/a/b/", 99, False, "a/b"),
    ],
)
def test_addresses_of_brokers(url, port, tls, prefix):
    found = parse_broker(url)
    assert (found.port, found.tls, found.prefix) == (port, tls, prefix)
    assert found.user is None


@pytest.mark.parametrize(
    "url", ["host", "http://u:pw@host", "mqtt://", "mqtt://h:pw@h:999999", "mqtt://h/a+b"]
)
def test_what_is_no_address_is_refused_without_a_password(url):
    with pytest.raises(ConfigError) as found:
        parse_broker(url)
    assert "pw" not in str(found.value)


def test_the_weight_by_vss_is_withdrawn_where_there_is_none(tmp_path):
    with broker() as port:
        pass
    mqtt = sender(port, tmp_path)
    mqtt.show(weighing(300.0, status=LiveStatus.INCONSISTENT))
    mqtt.show(weighing(310.0, mass=math.nan, std=math.nan))
    mqtt.show(weighing(320.0, mass=70_000.0))
    mqtt.show(weighing(330.0, mass=2100.4))
    topic = "fleet/delivery-van/Vehicle/CurrentOverallWeight"
    told = [m.payload for m in mqtt._outbox.after(0, 99) if m.topic == topic]
    mqtt.close()
    assert told == [b"", b"", b"", b"2100"]


def test_weighings_are_thinned_but_not_a_change_of_status(tmp_path):
    with broker() as port:
        pass
    mqtt = sender(port, tmp_path, period=5.0)
    for k in range(20):
        status = LiveStatus.INCONSISTENT if k == 12 else LiveStatus.WEIGHED
        mqtt.show(weighing(float(k), status=status))
    rows = [json.loads(m.payload)["time_s"] for m in mqtt._outbox.after(0, 99) if m.topic == TOPIC]
    assert rows == [0.0, 5.0, 10.0, 12.0, 13.0, 18.0]
    mqtt.close()


def test_the_last_weighing_is_sent_at_the_end_and_what_waits_for_nothing_new_once(tmp_path):
    with broker() as port:
        pass
    mqtt = sender(port, tmp_path, period=5.0)
    parked = [weighing(103.0, newest=104.0, parked=True, age=float(k)) for k in range(40)]
    for w in (weighing(100.0), weighing(101.0), *parked):
        mqtt.show(w)
    sent = [json.loads(m.payload) for m in mqtt._outbox.after(0, 99) if m.topic == TOPIC]
    assert [(w["time_s"], w["parked"]) for w in sent] == [(100.0, False), (103.0, True)]
    mqtt.show(weighing(104.5, newest=106.0, parked=True))
    mqtt.close()
    again = lost(tmp_path)
    assert held(again) == [100.0, 103.0, 104.5]
    again.close()


def test_before_the_first_mass_it_is_told_how_far_it_is(tmp_path):
    with broker() as port:
        pass
    mqtt = sender(port, tmp_path, period=5.0)
    for w in drive(60):
        mqtt.show(replace(w, time=math.nan))
    told = [json.loads(m.payload) for m in mqtt._outbox.after(0, 99) if m.topic == TOPIC]
    mqtt.close()
    assert len(told) == 12
    assert [w["progress_to_5"] for w in told] == [None] * 6 + [0.1] * 6
    assert all(w["signals"][0]["rate_hz"] == 200.0 and w["advice"] for w in told)


def test_an_outbox_has_one_owner(tmp_path):
    first = lost(tmp_path)
    with pytest.raises(ConfigError, match="is used by another weighbridge"):
        lost(tmp_path)
    first.show(weighing(1.0))
    first.close()
    second = lost(tmp_path)
    assert held(second)[0] == 1.0
    # One that was there before has it as well.
    with pytest.raises(ConfigError, match="end that one"):
        lost(tmp_path)
    second.close()


def test_a_damaged_outbox_is_set_aside(tmp_path, caplog):
    mqtt = lost(tmp_path)
    for w in drive(100):
        mqtt.show(w)
    mqtt.close()
    path = tmp_path / "outbox.sqlite"
    data = bytearray(path.read_bytes())
    data[100:30_000] = b"\xa5" * 29_900
    path.write_bytes(data)
    fresh = lost(tmp_path)
    fresh.show(weighing(1.0))
    assert held(fresh) == [1.0]
    fresh.close()
    assert (tmp_path / "outbox.sqlite.damaged").exists()
    assert "set aside" in caplog.text


def test_files_of_something_else_are_no_outbox(tmp_path):
    (tmp_path / "car.toml").write_text("[vehicle]\n" * 200)
    with error(ConfigError, "car.toml"):
        lost(tmp_path, "car.toml")
    assert (tmp_path / "car.toml").exists()
    with sqlite3.connect(tmp_path / "other") as other:
        other.execute("CREATE TABLE messages (a)")
    other.close()
    with error(ConfigError, "other"):
        lost(tmp_path, "other")
    with pytest.raises(ConfigError, match="cannot be used as an outbox"):
        lost(tmp_path, ".")


def test_what_was_taken_is_not_sent_again_where_the_disk_is_full(tmp_path):
    with broker() as port:
        pass
    mqtt = sender(port, tmp_path)
    for k in range(4):
        mqtt.show(weighing(float(k)))
    disk = mqtt._outbox._database
    disk.execute("PRAGMA query_only = 1")
    with broker(port):
        until(lambda: mqtt.waiting == 0)
        disk.execute("PRAGMA query_only = 0")
        mqtt.show(weighing(4.0))
        until(lambda: mqtt.waiting == 0)
        mqtt.close()
    assert [json.loads(p)["time_s"] for p in Taken.of(TOPIC)] == [0.0, 1.0, 2.0, 3.0, 4.0]
    again = lost(tmp_path)
    assert again.waiting == 0
    again.close()


def test_a_full_disk_is_told_and_weighing_goes_on(tmp_path):
    mqtt = lost(tmp_path)
    disk = mqtt._outbox._database
    pages = disk.execute("PRAGMA page_count").fetchone()[0]
    disk.execute(f"PRAGMA max_page_count = {pages + 2}")
    with error(WeighbridgeError, "outbox.sqlite"):
        mqtt.show(weighing(0.0, advice="x" * 100_000))
    assert mqtt.waiting == 0
    mqtt.show(weighing(1.0))
    assert held(mqtt) == [1.0]
    mqtt.close()
