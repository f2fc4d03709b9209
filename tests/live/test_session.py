"""A recorded drive through feed, scale and outputs, as the command runs it."""

import copy
from dataclasses import replace
from threading import Event
from time import monotonic

import numpy as np
import pytest

import weighbridge as wb
from weighbridge import ConfigError, LiveScale
from weighbridge.errors import SourceError
from weighbridge.live import Alert, Feed, Keeper, Outputs, Recorder, Replay, Session, order


class Shown:
    name = "test"

    def __init__(self):
        self.weighings = []

    def show(self, weighing):
        self.weighings.append(weighing)

    def close(self):
        pass


@pytest.fixture
def minute(short):
    return short.between(short.start, short.start + 90.0)


def run(drive, scale, **more):
    shown = Shown()
    with Outputs([shown]) as outputs, Feed([Replay(drive, float("inf"))]) as feed:
        session = Session(feed=feed, scale=scale, outputs=outputs, **more)
        last = session.run(Event())
    return last, shown.weighings


def test_a_replay_is_weighed_as_its_samples(short, middle, half_driven, tmp_path):
    minute = short.between(np.nextafter(middle, np.inf), middle + 40.0)
    scale, direct = half_driven, copy.deepcopy(half_driven)
    keeper = Keeper(tmp_path / "car.state")
    last, shown = run(
        minute, scale, keeper=keeper, recorder=Recorder(tmp_path / "drive"), alerts=[Alert(9e4)]
    )
    direct.update_block({n: (s.time, s.values) for n, s in minute.signals.items()})
    direct.finish()
    assert last.mass == direct.weighing().mass
    assert last.mass > 0.0
    assert len(shown) >= 20
    assert (tmp_path / "car.state").exists()
    kept = wb.read_drive(tmp_path / "drive")
    assert {n: len(s) for n, s in kept.signals.items()} == {
        n: len(s) for n, s in minute.signals.items()
    }


@pytest.fixture
def moving(short):
    """A part that ends on the move."""
    fast = short.speed.time[short.speed.values > 5.0]
    return short.between(short.start, float(fast[fast < short.start + 90.0][-1]))


def test_sources_that_fall_silent_are_not_shown_as_alive(moving, weighing, setup, monkeypatch):
    """A terminal that says ok for minutes after the plug was pulled is wrong."""
    minute = moving
    at = [100.0]
    monkeypatch.setattr("weighbridge.live.session.now", lambda: at[0])
    scale = LiveScale(weighing.vehicle, setup=setup, info=minute.info)
    shown = Shown()
    with Outputs([shown]) as outputs, Feed([]) as feed:
        session = Session(feed=feed, scale=scale, outputs=outputs)
        scale.update_block({n: (s.time, s.values) for n, s in minute.signals.items()})
        session._show(due=True)
        at[0] += 2.0
        session._show(due=True)
        at[0] += 58.0
        session._show(due=True)
    first, soon, late = shown.weighings
    assert [s.age for s in first.signals] == [s.age for s in soon.signals]
    assert all(s.fresh for s in first.signals if s.needed)
    assert not any(s.fresh for s in late.signals if s.needed)
    assert late.age == pytest.approx(first.age + 60.0)
    assert "engine_load" in late.reason
    assert late.reason_id == "live.silent"


def test_a_parked_vehicle_is_weighed_to_its_last_sample_and_stays_so(
    minute, weighing, setup, monkeypatch
):
    """What could still have been late is weighed; silent signals are no fault."""
    assert minute.speed.values[-1] == 0.0
    at = [100.0]
    monkeypatch.setattr("weighbridge.live.session.now", lambda: at[0])
    scale = LiveScale(weighing.vehicle, setup=setup, info=minute.info)
    shown = Shown()
    with Outputs([shown]) as outputs, Feed([]) as feed:
        session = Session(feed=feed, scale=scale, outputs=outputs)
        scale.update_block({n: (s.time, s.values) for n, s in minute.signals.items()})
        for _ in range(4):
            session._show(due=True)
            at[0] += 1200.0
    first, *later = shown.weighings
    whole = LiveScale(weighing.vehicle, setup=setup, info=minute.info)
    whole.update_block({n: (s.time, s.values) for n, s in minute.signals.items()})
    whole.finish()
    assert not first.parked
    for w in later:
        assert w.parked
        assert not w.provisional
        assert (w.mass, w.std, w.status) == (
            whole.weighing().mass, whole.weighing().std, whole.weighing().status
        )  # fmt: skip
        assert w.reason_id != "live.silent"
        assert not any(s.fails for s in w.signals)


def test_the_last_weighing_is_shown_where_a_source_ends_all(minute, weighing, setup):
    class Wrong:
        name = "wrong"

        def run(self, put, stop):
            put({n: (s.time, s.values) for n, s in minute.signals.items()})
            raise ConfigError("it cannot be used as it was named")

    shown = Shown()
    scale = LiveScale(weighing.vehicle, setup=setup, info=minute.info)
    with Outputs([shown]) as outputs, Feed([Wrong()]) as feed, pytest.raises(ConfigError):
        Session(feed=feed, scale=scale, outputs=outputs).run(Event())
    assert shown.weighings
    assert not shown.weighings[-1].provisional


def test_a_lost_source_is_told_and_weighing_goes_on(minute, weighing, setup):
    class Lost:
        name = "gone"

        def run(self, put, stop):
            raise SourceError("gone: there is no such device")

    class Patient(Replay):
        def run(self, put, stop):
            super().run(put, stop)
            done.set()

    done, shown = Event(), Shown()
    scale = LiveScale(weighing.vehicle, setup=setup, info=minute.info)
    sources = [Lost(), Patient(minute, float("inf"))]
    with Outputs([shown]) as outputs, Feed(sources) as feed:
        session = Session(feed=feed, scale=scale, outputs=outputs)
        session.orders = lambda _: stop.set() if done.is_set() and scale.newest > 80.0 else None
        stop = Event()
        last = session.run(stop)
    assert last.mass > 0.0
    assert any("no such device" in note for note in shown.weighings[-1].notes)


def test_orders_of_a_person(weighing, setup, half_driven):
    untouched, scale = LiveScale(weighing.vehicle, setup=setup), half_driven
    assert "kg" not in order(untouched, "tare")
    assert "tare " in order(scale, "tare")
    assert "changed" in order(scale, "load")
    assert "no order: there are tare, load, end" in order(scale, "x")


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan")])
def test_a_replay_has_a_rate(minute, rate):
    with pytest.raises(ConfigError, match="--rate"):
        Replay(minute, rate)


def test_a_replay_at_a_rate_takes_its_time(minute):
    part = minute.between(minute.start, minute.start + 2.0)
    blocks, begun = [], monotonic()
    Replay(part, 10.0).run(lambda samples: blocks.append(samples), Event())
    assert monotonic() - begun >= 0.15
    count = {n: sum(len(b[n][0]) for b in blocks if n in b) for n in part.signals}
    assert count == {n: len(s) for n, s in part.signals.items()}


@pytest.mark.parametrize("start", [0.0, 17.3, 1.6e9 + 0.7])
def test_a_replay_leaves_no_sample_between_two_blocks(start):
    """Stamps of 10 Hz lie where blocks of 0.1 s meet, as far as numbers are exact."""
    time = start + 0.1 * np.arange(400)
    drive = wb.Drive("even", {"vehicle_speed": wb.Signal("vehicle_speed", time, time - start)})
    blocks = []
    Replay(drive, 1e6).run(blocks.append, Event())
    came = np.concatenate([b["vehicle_speed"][0] for b in blocks])
    np.testing.assert_array_equal(came, time)


def test_a_replay_does_not_wait_for_days_of_silence(minute):
    later = minute.with_signals(
        *(
            replace(s, time=np.where(s.time < minute.start + 45.0, s.time, s.time + 10 * 86_400.0))
            for s in minute.signals.values()
        )
    )
    blocks = []
    Replay(later, float("inf")).run(blocks.append, Event())
    assert len(blocks) < 100
    assert sum(len(b["accel_x"][0]) for b in blocks if "accel_x" in b) == len(
        minute.signals["accel_x"]
    )
