import contextlib
import json
import math
import os
import socket
import time
import tty
from threading import Event, Thread

import pytest

from weighbridge import ConfigError
from weighbridge.io import UnfitSentenceError, read_sentence
from weighbridge.live import Feed, parse_source
from weighbridge.live.sources.nmea import SentenceReader


def sentence(text):
    check = 0
    for byte in text.encode():
        check ^= byte
    return f"${text}*{check:02X}\r\n".encode()


def rmc(clock, speed="022.4"):
    return sentence(f"GPRMC,{clock},A,4807.038,N,01131.000,E,{speed},084.4,230394,003.1,W")


def gga(clock):
    return sentence(f"GPGGA,{clock},4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,")


def test_sentences_in_pieces_between_garbage():
    reader = SentenceReader()
    data = b"\xb5\x62\x01\x07" + rmc("123519.00") + b"$GPXXX,1\r\n" + gga("123519.00") + b"\x00\n"
    rows = []
    for k in range(len(data)):
        rows += reader.read(data[k : k + 1], 1000.0 + 0.001 * k)
    assert [sorted(values) for _, values in rows] == [
        ["gnss_course", "gnss_speed"],
        ["altitude", "hdop", "latitude", "longitude"],
    ]
    assert rows[0][1]["gnss_speed"] == pytest.approx(22.4 * 1852.0 / 3600.0)
    assert rows[1][1]["latitude"] == pytest.approx(math.radians(48.0 + 7.038 / 60.0))
    assert rows[1][1]["altitude"] == 545.4
    # Both are of one epoch: one instant.
    assert rows[0][0] == rows[1][0]


def test_epochs_keep_their_spacing_over_midnight():
    reader = SentenceReader()
    late = (0.1, 0.3, 0.12, 0.25)
    clocks = ("235959.00", "235959.50", "000000.00", "000000.50")
    times = [
        reader.read(rmc(clock), 500.0 + 0.5 * k + late[k])[0][0] for k, clock in enumerate(clocks)
    ]
    assert [t - times[0] for t in times] == pytest.approx([0.0, 0.5, 1.0, 1.5])


def test_speed_of_vtg_counts_where_there_is_no_rmc():
    reader = SentenceReader()
    rows = reader.read(gga("123519.00") + sentence("GPVTG,054.7,T,034.4,M,005.5,N,036.0,K,A"), 1.0)
    assert rows[1][1]["gnss_speed"] == pytest.approx(10.0)
    assert rows[1][0] == rows[0][0]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("GPRMC,123519,V,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W", "fix"),
        ("GPGGA,123519,4807.038,N,01131.000,E,0,08,0.9,545.4,M,46.9,M,,", "fix"),
        ("GPRMC,123519,A,4807.038", "damaged"),
    ],
)
def test_sentences_that_tell_nothing(text, why):
    with pytest.raises(UnfitSentenceError, match=why):
        read_sentence(sentence(text).decode().strip())


def test_wrong_checksum():
    text = rmc("123519.00").decode().strip()
    with pytest.raises(UnfitSentenceError, match="checksum"):
        read_sentence(text[:-2] + "00")


def test_receiver_in_a_pseudo_terminal(monkeypatch):
    pytest.importorskip("serialx")
    master, slave = os.openpty()
    tty.setraw(slave)
    source = parse_source(f"nmea:{os.ttyname(slave)}")
    monkeypatch.setattr(f"{type(source).__module__}.SILENT", 0.3)
    with Feed([source]) as feed:
        limit = time.monotonic() + 4.0
        found = set()
        k = 0
        while not {"gnss_speed", "latitude"} <= found and time.monotonic() < limit:
            clock = f"1235{k // 10:02d}.{k % 10}0"
            os.write(master, rmc(clock) + gga(clock))
            k += 1
            found |= {name for block in feed.read(0.1) for name in block}
        assert {"gnss_speed", "latitude"} <= found
        while feed.states()[0].connected and time.monotonic() < limit:
            feed.read(0.05)
        assert "sent nothing" in feed.states()[0].error
    os.close(master)
    os.close(slave)


class Gpsd:
    """Answers as gpsd does, to one client after another."""

    def __init__(self):
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.socket.settimeout(0.05)
        self.port = self.socket.getsockname()[1]
        self.asked = b""
        self.reports = []
        self.hang_up = Event()
        self.stop = Event()
        self.thread = Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        while not self.stop.is_set():
            try:
                client, _ = self.socket.accept()
            except TimeoutError:
                continue
            client.sendall(b'{"class":"VERSION","release":"3.25"}\n')
            client.settimeout(0.02)
            self.hang_up.clear()
            while not self.stop.is_set() and not self.hang_up.is_set():
                # The client may go while reports are on their way to it.
                with contextlib.suppress(OSError):
                    self.asked += client.recv(1024)
                with contextlib.suppress(OSError):
                    for report in self.reports:
                        client.sendall(json.dumps(report).encode() + b"\n")
            client.close()
        self.socket.close()


TPV = {
    "class": "TPV", "mode": 3, "time": "2026-01-31T17:58:02.200Z", "lat": 48.0, "lon": 11.5,
    "altHAE": 600.0, "altMSL": 553.0, "speed": 13.9, "track": 90.0, "eph": 2.5,
}  # fmt: skip


def test_gpsd_lost_and_back(monkeypatch):
    server = Gpsd()
    server.reports = [TPV, {"class": "SKY", "hdop": 0.8}]
    source = parse_source(f"gpsd:127.0.0.1:{server.port}")
    monkeypatch.setattr(f"{type(source).__module__}.SILENT", 0.3)
    with Feed([source], pauses=(0.05, 0.1)) as feed:
        samples = {}

        def wait(condition):
            limit = time.monotonic() + 4.0
            while not condition() and time.monotonic() < limit:
                for block in feed.read(0.05):
                    samples.update({n: v[-1] for n, (_, v) in block.items()})
            assert condition()

        wait(lambda: len(samples) == 7)
        assert b'?WATCH={"enable":true,"json":true}' in server.asked
        assert samples["altitude"] == 553.0
        assert samples["gnss_course"] == pytest.approx(math.pi / 2.0)
        server.hang_up.set()
        wait(lambda: feed.states()[0].restarts >= 1 and feed.states()[0].connected)
        server.reports = [TPV | {"mode": 1}]
        wait(lambda: "no fix" in feed.states()[0].error)
    server.stop.set()
    server.thread.join()


def heard(reports):
    """Samples of reports of gpsd."""
    server = Gpsd()
    server.reports = reports
    found, ended = {}, Event()

    def put(block):
        for name, (times, values) in block.items():
            kept = found.setdefault(name, ([], []))
            kept[0].extend(times)
            kept[1].extend(values)
        if len(found["gnss_speed"][0]) >= 2:
            ended.set()

    parse_source(f"gpsd:127.0.0.1:{server.port}").run(put, ended)
    server.stop.set()
    server.thread.join()
    return found


def late():
    """Reports of each 10 ms that come each 20."""
    for k in range(100):
        time.sleep(0.02)
        yield TPV | {"time": f"2026-01-31T17:58:02.{200 + 10 * k:03d}Z"}


def test_reports_of_gpsd():
    found = heard(late())
    times, speeds = found["gnss_speed"]
    assert speeds[:2] == [13.9, 13.9]
    assert times[1] - times[0] == pytest.approx(0.01, abs=1e-5)
    flat = heard([[1], {"class": "TPV", "mode": 1}, TPV | {"mode": 2}])
    assert flat.keys() == found.keys() - {"altitude"}
    assert "latitude" not in heard([TPV | {"lat": None}, TPV | {"lat": "x"}])


@pytest.mark.parametrize(
    "text",
    ["gpsd:2947", "gpsd:host:x", "nmea:@9600", "gpsd:host:0", "nmea:tcp:10110", "ubx:tcp:host:0"],
)
def test_places_that_cannot_be(text):
    with pytest.raises(ConfigError):
        parse_source(text)
