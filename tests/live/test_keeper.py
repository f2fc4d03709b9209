"""The state of a scale on disk: whole, restored, set aside where it is damaged."""

import logging
import os
import time

import pytest

import weighbridge as wb
from tests.noted import named
from weighbridge import DriveInfo, Vehicle
from weighbridge.estimators.judging import STOP
from weighbridge.live import Keeper, clock
from weighbridge.signals import BEHIND, STEP
from weighbridge.vehicle import Driveline


@pytest.fixture(scope="module")
def car():
    return Vehicle(name="van", tare=2000.0, driveline=Driveline(gearings=(40.0, 20.0, 12.0)))


def restored(keeper, car, start=10.0, **more):
    return keeper.restored(car, lateness=1.0, info=DriveInfo(), start=start, **more)


def test_nothing_there_is_a_new_scale(car, tmp_path):
    scale, said = restored(Keeper(tmp_path / "car.state"), car)
    assert said == ""
    assert scale.weighing().driven == 0.0


def test_a_state_comes_back(car, tmp_path):
    keeper = Keeper(tmp_path / "car.state")
    scale = wb.LiveScale(car)
    for k in range(100):
        scale.update(0.1 * k, "vehicle_speed", 10.0)
    scale.finish()
    keeper.write(scale)
    again, _ = restored(keeper, car)
    assert again.weighing().driven == scale.weighing().driven > 0.0


def test_a_damaged_state_is_set_aside(car, tmp_path):
    path = tmp_path / "car.state"
    Keeper(path).write(wb.LiveScale(car))
    path.write_bytes(path.read_bytes()[:-10] + b"\x00\xff")
    scale, said = restored(Keeper(path), car)
    assert "damaged" in said
    assert "car.state.bad" in said
    assert not path.exists()
    assert (tmp_path / "car.state.bad").exists()
    assert scale.weighing().driven == 0.0


@pytest.mark.parametrize("start", [1.79e9 - 900.0, 1.79e9 - 90.0, 30.0])
@pytest.mark.parametrize("emulated", [True, False])
def test_a_state_that_is_later_than_its_samples_is_set_aside(car, tmp_path, start, emulated):
    """That of an emulated drive at five times the rate, or a replay of another drive."""
    path = tmp_path / "car.state"
    scale = wb.LiveScale(car)
    for k in range(100):
        scale.update(1.79e9 + 0.1 * k, "vehicle_speed", 10.0)
    with clock.at_rate(5.0 if emulated else 1.0):
        Keeper(path).write(scale)
    new, said = restored(Keeper(path), car, start, by_host=emulated)
    assert "later than those that come" in said
    assert "e+" not in said
    assert "set aside as car.state.bad" in said
    assert not path.exists()
    assert new.weighing().driven == 0.0
    for k in range(100):
        new.update(start + 0.1 * k, "vehicle_speed", 10.0)
    found = new.weighing()
    assert not found.notes
    speed = next(s for s in found.signals if s.name == "vehicle_speed")
    assert (speed.late, speed.unfit) == (0, 0)


@pytest.fixture
def host(monkeypatch):
    """A host whose date can be set, and whose programs can be started anew."""

    class Host:
        date = 1.79e9

        def start(self):
            course = clock._Course(time.time(), time.monotonic(), 1.0)
            monkeypatch.setattr(clock, "_course", course)

    made = Host()
    monkeypatch.setattr(time, "time", lambda: made.date)
    made.start()
    return made


@pytest.mark.parametrize("back", [30.0, 7200.0, 1.79e9 - 30.0])
def test_a_state_is_gone_on_from_where_the_hosts_clock_was_set_back(car, tmp_path, host, back):
    """A computer without a battery for its clock, after a power cut: an hour ago, or 1970."""
    path = tmp_path / "car.state"
    scale = wb.LiveScale(car)
    begin = clock.now()
    for k in range(1000):
        scale.update(begin + 0.1 * k, "vehicle_speed", 10.0)
    Keeper(path).write(scale)
    host.date -= back
    # The date alone moves nothing: the program that runs has a clock of its own.
    assert clock.now() == pytest.approx(begin, abs=60.0)
    host.start()
    start = clock.now()
    assert start == pytest.approx(begin - back, abs=60.0)
    again, said = restored(Keeper(path), car, start)
    assert "the clock was set back" in said
    assert "e+" not in said
    assert path.exists()
    before = again.weighing().driven
    assert before == scale.weighing().driven > 90.0
    for k in range(1000):
        again.update(start + 0.1 * k, "vehicle_speed", 10.0)
    found = again.weighing()
    speed = next(s for s in found.signals if s.name == "vehicle_speed")
    assert (speed.late, speed.unfit) == (0, 0)
    # A silence in motion counts for as long as the stages look back.
    assert 97.0 < found.driven - before <= 99.0 + BEHIND + 2.0 * STEP
    # The state holds the last seconds; what comes is put behind them as after a stop.
    assert again.recorded().duration == pytest.approx(BEHIND + STOP + 99.0, abs=2.0)


@pytest.mark.parametrize(("after", "goes_on"), [(3000.0, True), (4000.0, False), (90_000.0, False)])
def test_a_state_of_another_hour_is_not_gone_on_from(car, tmp_path, after, goes_on):
    scale = wb.LiveScale(car)
    for k in range(100):
        scale.update(1.79e9 + 0.1 * k, "vehicle_speed", 10.0)
    path = tmp_path / "car.state"
    Keeper(path).write(scale)
    again, said = restored(Keeper(path), car, 1.79e9 + after)
    assert (again.weighing().driven > 0.0) == goes_on
    assert ("load may have changed" in said) != goes_on
    assert path.exists()


def test_a_state_of_another_vehicle_is_set_aside(car, tmp_path):
    from dataclasses import replace

    path = tmp_path / "car.state"
    Keeper(path).write(wb.LiveScale(replace(car, tare=1400.0)))
    _, said = restored(Keeper(path), car)
    assert named(said, path, "car.state.bad")


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes everywhere")
def test_a_folder_that_is_closed_is_told_once_by_permission(car, tmp_path, caplog):
    tmp_path.chmod(0o500)
    _told_once(Keeper(tmp_path / "car.state"), car, caplog)
    tmp_path.chmod(0o700)


def test_a_folder_that_is_gone_is_told_once(car, tmp_path, caplog):
    folder = tmp_path / "gone"
    keeper = Keeper(folder / "car.state")
    _told_once(keeper, car, caplog)
    folder.mkdir()
    keeper.write(wb.LiveScale(car))
    assert "written again" in caplog.text
    assert (folder / "car.state").exists()


def _told_once(keeper, car, caplog):
    with caplog.at_level(logging.WARNING):
        keeper.write(wb.LiveScale(car))
        keeper.write(wb.LiveScale(car))
    assert caplog.text.count("is not written") == 1
