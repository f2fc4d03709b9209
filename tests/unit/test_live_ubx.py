import math
import os
import socket
import time
import tty

import pytest
from tests.unit.test_live_gnss import gga, rmc

from weighbridge.live import Feed, parse_source
from weighbridge.live.sources.ubx import UbxReader

pyubx2 = pytest.importorskip("pyubx2")

PLACE = {"latitude", "longitude", "gnss_accuracy", "altitude"}
MOTION = {"gnss_speed", "gnss_course"}


def nav_pvt(milliseconds, **changed):
    """A message as a receiver on the way to the south-west sends it."""
    said = {
        "iTOW": milliseconds, "fixType": 3, "gnssFixOk": 1, "numSV": 14, "lat": 48.1173,
        "lon": -11.5167, "height": 592_300, "hMSL": 545_400, "hAcc": 1_850, "vAcc": 2_600,
        "velN": -8_000, "velE": -6_000, "velD": 350, "gSpeed": 10_000, "sAcc": 120,
    }  # fmt: skip
    return pyubx2.UBXMessage("NAV", "NAV-PVT", pyubx2.GET, **(said | changed)).serialize()


def satellites():
    """A message that is not read, with the header of one that is inside it."""
    return pyubx2.UBXMessage(
        "RXM", "RXM-SFRBX", pyubx2.GET, payload=b"\xb5b\x01\x07\x5c\x00" + bytes(2)
    ).serialize()


def test_messages_in_pieces_among_others():
    reader = UbxReader()
    data = b"\xb5b\x01" + satellites() + nav_pvt(1000) + satellites() + nav_pvt(1100) + b"\n"
    rows = []
    for k in range(len(data)):
        rows += reader.read(data[k : k + 1], 500.0 + 1e-3 * k)
    assert [values.keys() for _, values in rows] == [PLACE | MOTION] * 2
    assert rows[1][0] - rows[0][0] == pytest.approx(0.1)
    values = rows[0][1]
    assert values["latitude"] == pytest.approx(math.radians(48.1173))
    assert values["longitude"] == pytest.approx(math.radians(-11.5167))
    assert values["altitude"] == pytest.approx(545.4)
    assert values["gnss_accuracy"] == pytest.approx(1.85)
    assert values["gnss_speed"] == pytest.approx(10.0)
    assert values["gnss_course"] == pytest.approx(math.radians(180.0) + math.atan(0.75))


def test_messages_of_older_receivers_are_shorter():
    old = pyubx2.UBXMessage(0x01, 0x07, pyubx2.GET, payload=nav_pvt(1000)[6:90]).serialize()
    ((_, values),) = UbxReader().read(old, 1.0)
    assert values["gnss_speed"] == pytest.approx(10.0)


@pytest.mark.parametrize("byte", [2, 4, 12, 60, 98, 99])
def test_a_damaged_message_costs_no_other(byte):
    bad = bytearray(nav_pvt(2000))
    bad[byte] ^= 0x21
    reader = UbxReader()
    rows = reader.read(nav_pvt(1000) + bytes(bad) + nav_pvt(3000, hMSL=300_000), 100.0)
    assert [values["altitude"] for _, values in rows] == pytest.approx([545.4, 300.0])


@pytest.mark.parametrize("kept", [5, 7, 50, 99])
def test_a_truncated_message_costs_no_other(kept):
    reader = UbxReader()
    cut = nav_pvt(2000, hMSL=200_000)[:kept]
    rows = reader.read(nav_pvt(1000) + cut + nav_pvt(3000, hMSL=300_000), 100.0)
    rows += reader.read(nav_pvt(4000, hMSL=400_000), 101.0)
    assert [values["altitude"] for _, values in rows] == pytest.approx([545.4, 300.0, 400.0])


@pytest.mark.parametrize(
    ("changed", "names"),
    [
        ({"fixType": 0}, set()),
        ({"fixType": 1}, set()),
        ({"fixType": 5}, set()),
        ({"gnssFixOk": 0}, set()),
        ({"fixType": 2}, PLACE - {"altitude"} | MOTION),
        ({"fixType": 4}, PLACE | MOTION),
        ({"invalidLlh": 1}, MOTION),
        ({"velN": 0, "velE": 0}, PLACE | {"gnss_speed"}),
    ],
)
def test_what_a_fix_tells(changed, names):
    rows = UbxReader().read(nav_pvt(1000, **changed), 1.0)
    assert {name for _, values in rows for name in values} == names


def test_fixes_keep_their_spacing_over_the_end_of_the_week():
    reader = UbxReader()
    late = (0.1, 0.3, 0.12, 0.25)
    stamps = (604_799_000, 604_799_500, 0, 500)
    times = [
        reader.read(nav_pvt(stamp), 500.0 + 0.5 * k + late[k])[0][0]
        for k, stamp in enumerate(stamps)
    ]
    assert [t - times[0] for t in times] == pytest.approx([0.0, 0.5, 1.0, 1.5])
    assert times[0] == pytest.approx(500.1)


def test_a_clock_that_is_set_back_is_believed_after_two_seconds():
    reader = UbxReader()
    times = []
    for k in range(60):
        stamp = 300_000_000 + 100 * k - (50_000 if k >= 20 else 0)
        times.append(reader.read(nav_pvt(stamp), 500.0 + 0.1 * k)[0][0])
    assert times[-1] == pytest.approx(500.0 + 5.9)


def test_sentences_count_where_no_message_comes():
    reader = UbxReader()
    assert len(reader.read(rmc("123519.00") + gga("123519.00"), 10.0)) == 2
    mixed = nav_pvt(1000) + rmc("123520.00") + gga("123520.00")
    ((_, values),) = reader.read(mixed, 11.0)
    assert values["latitude"] == pytest.approx(math.radians(48.1173))
    # Between two messages they do not, and when messages stay away they do again.
    assert reader.read(rmc("123521.00"), 12.0) == []
    assert len(reader.read(rmc("123530.00"), 21.0)) == 1


def test_receiver_in_a_pseudo_terminal(monkeypatch):
    pytest.importorskip("serialx")
    master, slave = os.openpty()
    tty.setraw(slave)
    source = parse_source(f"ubx:{os.ttyname(slave)}")
    monkeypatch.setattr(f"{type(source).__module__}.SILENT", 0.4)
    with Feed([source]) as feed:
        limit = time.monotonic() + 5.0
        samples = {}
        k = 0
        while len(samples.get("altitude", ())) < 5 and time.monotonic() < limit:
            data = nav_pvt(1000 + 100 * k)
            damaged = data[:20] + b"\xff" + data[21:] if k % 2 else b""
            os.write(master, rmc(f"12350{k // 10}.{k % 10}0") + damaged + data + satellites())
            k += 1
            for block in feed.read(0.1):
                for name, (_, values) in block.items():
                    samples.setdefault(name, []).extend(values)
        assert samples.keys() == PLACE | MOTION
        assert samples["altitude"] == pytest.approx([545.4] * len(samples["altitude"]))
        while "no fix" not in feed.states()[0].error and time.monotonic() < limit:
            os.write(master, nav_pvt(1000 + 100 * k, fixType=0))
            k += 1
            feed.read(0.05)
        assert "no fix, or sends no UBX message NAV-PVT" in feed.states()[0].error
        while "sent nothing" not in feed.states()[0].error and time.monotonic() < limit:
            feed.read(0.05)
        assert "sent nothing" in feed.states()[0].error
    os.close(master)
    os.close(slave)


@pytest.mark.parametrize(("kind", "data"), [("ubx", nav_pvt(1000)), ("nmea", gga("123519.00"))])
def test_receiver_over_tcp(kind, data):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with Feed([parse_source(f"{kind}:tcp:127.0.0.1:{port}")], pauses=(0.05, 0.1)) as feed:
            for _ in range(2):
                client, _ = server.accept()
                client.sendall(data)
                limit = time.monotonic() + 3.0
                found = set()
                while "latitude" not in found and time.monotonic() < limit:
                    found |= {name for block in feed.read(0.05) for name in block}
                assert "latitude" in found
                # Lost, and found again.
                client.close()
