"""The look before a recording, and the recording, with sources made up."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from tests.noted import error
from tests.unit.test_recorder import second

from weighbridge import ConfigError, DriveError, Vehicle, read_drive
from weighbridge.cli import record
from weighbridge.live import Arrivals, Recorder, needs
from weighbridge.vehicle import TorqueModel


class Feed:
    """Hands over a second of samples at each reading, and ends after so many."""

    def __init__(self, seconds, without=(), error=""):
        self.seconds = seconds
        self.without = without
        self.error = error
        self.read_so_far = 0

    @property
    def ended(self):
        return self.read_so_far >= self.seconds

    def read(self, timeout):
        k = self.read_so_far
        self.read_so_far += 1
        t = np.array([k + 0.5])
        samples = {
            **second(k, rate=100, begin=0.0),
            **{f"gyro_{a}": (np.arange(100) / 100 + k, np.zeros(100)) for a in "xyz"},
            "engine_load": (t, t),
            "latitude": (t, t),
            "longitude": (t, t),
        }
        return [{n: s for n, s in samples.items() if not n.startswith(self.without)}]

    def states(self):
        return [SimpleNamespace(name="gpsd:here:1", error=self.error)]


def never():
    return False


def of(name, **kwargs):
    arrivals = Arrivals()
    feed = Feed(5, **kwargs)
    while not feed.ended:
        arrivals.add(feed.read(0.0))
    return next(arrivals.of(need) for need in needs() if need.name == name)


def test_rates_are_those_of_the_stamps():
    assert of("inertial sensor").rate == pytest.approx(100.0)
    assert of("position").rate == pytest.approx(1.0)
    # The slower of engine load and engine speed.
    assert of("torque").signals == ("engine_load", "engine_speed")
    assert of("torque").rate == pytest.approx(1.0)


def test_what_does_not_come_is_named():
    assert of("speed").lacking == ()
    assert of("position", without=("longitude",)).lacking == ("longitude",)
    assert of("inertial sensor", without=("gyro",)).lacking == ("gyro_x", "gyro_y", "gyro_z")
    assert of("torque", without=("engine_load",)).lacking


def test_samples_that_are_not_finite_do_not_come():
    arrivals = Arrivals()
    arrivals.add([{"vehicle_speed": (np.arange(3.0), np.full(3, np.nan))}])
    assert arrivals.names == ()
    assert np.isnan(arrivals.rate("vehicle_speed"))


def test_a_vehicle_needs_the_signals_of_its_own_torque():
    car = Vehicle(torque=TorqueModel(source="air_flow"))
    need = next(n for n in needs(car) if n.name == "torque")
    assert need.sets == (("mass_air_flow", "engine_speed"),)


def test_the_look_ends_when_all_has_come(capsys, monkeypatch):
    monkeypatch.setattr(record, "_LEAST_CHECK", 0.0)
    feed = Feed(1000)
    record.look(feed, needs(), 0.0)
    assert feed.read_so_far == 0
    record.look(feed, needs(), 600.0)
    assert feed.read_so_far == 1
    assert capsys.readouterr().err == ""


def test_without_a_terminal_what_does_not_come_is_told_and_the_recording_goes_on(capsys):
    record.look(Feed(20, ("latitude", "longitude"), "no answer"), needs(), 60.0)
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.splitlines() == [
        "gpsd:here:1: no answer",
        "no position (latitude, longitude) has come; the heading is uncertain",
    ]


@pytest.mark.parametrize("answer", [True, False])
def test_on_a_terminal_it_is_asked(monkeypatch, answer):
    asked = []
    monkeypatch.setattr(record.sys, "stdin", SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr(record.sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(record.typer, "confirm", lambda text, err: asked.append(text) or answer)
    feed = Feed(20, ("latitude", "gyro"))
    if answer:
        record.look(feed, needs(), 60.0)
    else:
        with error(ConfigError, "inertial sensor position"):
            record.look(feed, needs(), 60.0)
    assert asked == ["Record without inertial sensor, position?"]


def test_the_table_tells_what_comes_and_what_is_waited_for():
    from rich.console import Console

    arrivals = Arrivals()
    arrivals.add(Feed(1, ("latitude",)).read(0.0))
    screen = Console(width=80, record=True, file=open("/dev/null", "w"))  # noqa: SIM115, PTH123
    screen.print(record.arrival_table(needs(), arrivals))
    shown = screen.export_text()
    screen.file.close()
    assert re.search(r"position .* waiting .* latitude", shown)
    assert re.search(r"inertial sensor .* comes .* 100\.0 .* accel_x", shown)
    assert max(map(len, shown.splitlines())) <= 80


def test_a_recording_holds_what_came(tmp_path):
    arrived = record.run(Feed(90), Recorder(tmp_path / "drive"), never)
    drive = read_drive(tmp_path / "drive")
    assert drive.problems == ()
    assert len(drive.signals["accel_x"]) == 9000
    assert arrived.count == sum(len(s) for s in drive.signals.values())
    assert set(arrived.names) == set(drive.signals)


def test_a_recording_ends_when_asked_and_is_joined(tmp_path):
    feed = Feed(10**9)
    record.run(feed, Recorder(tmp_path / "drive"), lambda: feed.read_so_far >= 7)
    assert len(read_drive(tmp_path / "drive").signals["accel_x"]) == 700
    assert not list((tmp_path / "drive").glob("*.parts"))


def test_a_recording_ends_when_the_disk_is_full(tmp_path, monkeypatch):
    def full(*_):
        raise DriveError("the disk is full")

    monkeypatch.setattr("weighbridge.live.recorder.write_frame", full)
    recorder = Recorder(tmp_path / "drive", period=0.0)
    record.run(Feed(10**9), recorder, never)
    assert "the disk is full: recording has ended" in recorder.problem


def test_what_was_recorded_is_joined_when_a_source_fails(tmp_path):
    class Failing(Feed):
        def read(self, timeout):
            if self.read_so_far == 5:
                raise ConfigError("there is no such interface")
            return super().read(timeout)

    with pytest.raises(ConfigError, match="no such interface"):
        record.run(Failing(10), Recorder(tmp_path / "drive"), never)
    assert len(read_drive(tmp_path / "drive").signals["accel_x"]) == 500
