import re
import time
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from weighbridge import ConfigError, MissingExtraError
from weighbridge.errors import SourceError
from weighbridge.live import SOURCES, Feed, parse_source
from weighbridge.live.clock import now


def block(k):
    return {"vehicle_speed": (np.array([float(k)]), np.array([10.0]))}


class Script:
    """A source that does what a list says: blocks to put, errors to raise, waits."""

    def __init__(self, *steps, name="script", patient=False):
        self.name = name
        self.steps = list(steps)
        self.trouble = ""
        self.patient = patient
        self.runs = []

    def run(self, put, stop):
        self.runs.append(time.monotonic())
        while self.steps and not stop.is_set():
            step = self.steps.pop(0)
            if isinstance(step, BaseException):
                raise step
            if isinstance(step, Event):
                while not step.wait(0.02) and not stop.is_set():
                    pass
            elif callable(step):
                step(self)
            else:
                put(step)


def drain(feed, timeout=3.0):
    blocks = []
    limit = time.monotonic() + timeout
    while not feed.ended and time.monotonic() < limit:
        blocks += feed.read(0.05)
    return blocks


def test_feed_ends_with_its_sources():
    with Feed([Script(block(1), block(2)), Script(block(3), name="other")]) as feed:
        blocks = drain(feed)
        assert feed.ended
        assert sorted(float(b["vehicle_speed"][0][0]) for b in blocks) == [1.0, 2.0, 3.0]
        assert [s.ended for s in feed.states()] == [True, True]
        assert feed.read(10.0) == []


def test_nothing_within_the_timeout_is_an_empty_list():
    hold = Event()
    with Feed([Script(hold)]) as feed:
        assert feed.read(0.01) == []
        state = feed.states()[0]
        assert (state.connected, state.error, state.restarts) == (False, "no sample yet", 0)


def test_oldest_blocks_are_dropped_and_counted(caplog):
    with Feed([Script(*map(block, range(10)))], most=4) as feed:
        limit = time.monotonic() + 2.0
        while not feed.states()[0].ended and time.monotonic() < limit:
            time.sleep(0.01)
        assert [float(b["vehicle_speed"][0][0]) for b in feed.read(1.0)] == [6.0, 7.0, 8.0, 9.0]
        assert feed.dropped == 6
    assert sum("faster" in r.getMessage() for r in caplog.records) == 1


def test_patient_source_loses_nothing():
    with Feed([Script(*map(block, range(50)), patient=True)], most=4) as feed:
        assert len(drain(feed)) == 50
        assert feed.dropped == 0


def test_lost_source_is_tried_again_with_growing_pauses(caplog):
    hold = Event()
    source = Script(
        block(1), SourceError("gone"), SourceError("gone"), SourceError("gone"), block(2), hold
    )
    with Feed([source], pauses=(0.05, 0.1)) as feed:
        blocks = []
        limit = time.monotonic() + 3.0
        while len(blocks) < 2 and time.monotonic() < limit:
            blocks += feed.read(0.02)
        state = feed.states()[0]
        assert state.connected
        assert state.error == ""
        assert state.restarts == 3
        assert state.since <= now()
    pauses = np.diff(source.runs)
    assert pauses[0] >= 0.05
    assert (pauses[1:] >= 0.1).all()
    assert [r.getMessage() for r in caplog.records] == ["script: gone", "script is back"]


@pytest.mark.parametrize(
    ("name", "error", "lost", "back"),
    [
        ("nmea:tcp:127.0.0.1:10110", "gone", "nmea 127.0.0.1:10110: gone", "nmea 127.0.0.1:10110"),
        ("nmea:tcp:127.0.0.1:1", "127.0.0.1:1 closed the connection",
         "nmea: 127.0.0.1:1 closed the connection", "nmea 127.0.0.1:1"),
        ("elm:/dev/ttyUSB0", "no answer", "elm /dev/ttyUSB0: no answer", "elm /dev/ttyUSB0"),
        ("lines:udp:5005", "no sample yet", "lines udp:5005: no sample yet", "lines udp:5005"),
        ("script", "it is gone", "script: it is gone", "script"),
    ],
)  # fmt: skip
def test_a_trouble_names_its_source_once_as_when_it_is_back(name, error, lost, back, caplog):
    source = Script(block(1), SourceError(error), block(2), Event())
    source.name = name
    with Feed([source], pauses=(0.05, 0.1)) as feed:
        limit = time.monotonic() + 3.0
        while len(caplog.records) < 2 and time.monotonic() < limit:
            feed.read(0.02)
    assert [r.getMessage() for r in caplog.records] == [lost, f"{back} is back"]


def test_lost_source_says_why():
    with Feed([Script(block(1), SourceError("unplugged"))], pauses=(5.0, 5.0)) as feed:
        limit = time.monotonic() + 2.0
        while feed.states()[0].error != "unplugged" and time.monotonic() < limit:
            feed.read(0.02)
        state = feed.states()[0]
        assert not state.connected
        assert state.error == "unplugged"


def test_trouble_of_a_source_that_goes_on_is_shown(caplog):
    hold, end = Event(), Event()

    def trouble(source):
        source.trouble = "bus silent"

    def fine(source):
        source.trouble = ""

    source = Script(block(1), trouble, hold, fine, block(2), end)
    with Feed([source]) as feed:
        limit = time.monotonic() + 2.0
        while feed.states()[0].error != "bus silent" and time.monotonic() < limit:
            feed.read(0.02)
        assert feed.states()[0].error == "bus silent"
        hold.set()
        while not feed.states()[0].connected and time.monotonic() < limit:
            feed.read(0.02)
        assert feed.states()[0].connected
        assert feed.states()[0].restarts == 0
    assert [r.getMessage() for r in caplog.records] == ["script: bus silent", "script is back"]


@pytest.mark.parametrize("failure", [ConfigError("wrong"), MissingExtraError("x", "live", "it")])
def test_what_does_not_mend_itself_is_raised(failure):
    with Feed([Script(failure)]) as feed, pytest.raises(type(failure)):
        feed.read(5.0)


def test_close_ends_all_at_once():
    feed = Feed([Script(Event(), name=str(k)) for k in range(5)])
    begun = time.monotonic()
    feed.close()
    assert time.monotonic() - begun < 1.5
    assert all(s.ended for s in feed.states())


def test_kinds_of_sources_are_told():
    for kind in SOURCES.values():
        assert kind.form.startswith(kind.name + ":")
        assert kind.about
        assert "\n" not in kind.about
    assert {k.name for k in SOURCES.values() if k.asks} == {"obd", "elm"}
    with pytest.raises(ConfigError, match="can, j1939"):
        parse_source("bogus:x")


def test_sources_of_the_documentation_can_be_named():
    text = (Path(__file__).parents[2] / "docs" / "live.md").read_text(encoding="utf-8")
    named = re.findall(r"`--source ([a-z0-9]+:[^`]+)`", text)
    named = [t for t in named if "INTERFACE" not in t and "…" not in t]
    assert {t.partition(":")[0] for t in named} == set(SOURCES)
    for source in named:
        assert parse_source(source).name == source
