"""Looks at all records that go on beside the stages."""

import math
from threading import Event, Timer
from threading import enumerate as enumerate_threads

import numpy as np
import pytest

import weighbridge as wb
from tests.live.test_scale import blocks, even, fed
from tests.live.test_session import Shown
from weighbridge import LiveStatus
from weighbridge.live import Feed, Outputs, Replay, Session, looking
from weighbridge.signals import LONGEST_STEP


@pytest.fixture
def held(monkeypatch):
    """Looks in a thread beside end no sooner than this is set."""
    free, look = Event(), looking.Look._caught

    def waiting(self, vehicle):
        assert free.wait(60.0)
        look(self, vehicle)

    monkeypatch.setattr(looking.Look, "_caught", waiting)
    yield free
    free.set()


@pytest.fixture(scope="module")
def minutes(loaded):
    """Looks after 30 s on the move, then each 15 s until there is a mass, and then less often."""
    return loaded.drive.between(loaded.drive.start, loaded.drive.start + 320.0)


def aside(car, drive):
    scale = wb.LiveScale(car, info=drive.info, step=LONGEST_STEP)
    scale.looks_aside = True
    return scale


def halves(drive):
    return blocks(drive, even(drive, 0.5))


def merged(parts):
    """One block of all that is left."""
    together = {}
    for block in parts:
        for name, pair in block.items():
            together.setdefault(name, []).append(pair)
    return {n: tuple(np.concatenate(c) for c in zip(*p, strict=True)) for n, p in together.items()}


def look_of(scale, parts, driven, held):
    """Feed parts, no look held, until so long on the move [s]; return the next look, held."""
    held.set()
    while scale._move.driven < driven or scale._looking is not None:
        scale.update_block(next(parts))
        scale._take(wait=True)
    held.clear()
    while scale._looking is None:
        scale.update_block(next(parts))
    return scale._looking


def test_what_is_found_beside_is_what_is_found_in_between(car, minutes, held):
    """Each look is held for two steps of the stages."""
    minutes = minutes.between(minutes.start, minutes.start + 250.0)
    waited, scale, taken = aside(car, minutes), aside(car, minutes), []
    waited.looks_aside = False
    for block in halves(minutes):
        waited.update_block(block)
        scale.update_block(block)
        if scale._looking is not None and len(scale._looking.steps) >= 2:
            held.set()
            scale._take(wait=True)
            held.clear()
            taken.append((scale.weighing().mass, waited.weighing().mass))
    held.set()
    waited.finish()
    scale.finish()
    found = [a == b for a, b in taken if math.isfinite(b)]
    assert len(found) > 1
    assert all(found)
    told, same = scale.weighing(), waited.weighing()
    assert (told.mass, told.std, told.time, told.driven, told.minutes_to_2) == (
        same.mass, same.std, same.time, same.driven, same.minutes_to_2,
    )  # fmt: skip


def test_the_mass_goes_on_while_a_look_does(car, minutes, held):
    scale, parts, told = aside(car, minutes), halves(minutes), []
    look = look_of(scale, parts, 220.0, held)
    for _ in range(20):
        scale.update_block(next(parts))
        told.append(scale.weighing(ahead=True))
    assert scale._looking is look
    held.set()
    assert max(t.age for t in told) < 1.2
    assert len({t.mass for t in told}) == 20


def test_the_bar_is_full_while_the_first_look_goes_on(car, minutes, held):
    scale = aside(car, minutes)
    look_of(scale, halves(minutes), 0.0, held)
    told = scale.weighing()
    held.set()
    assert told.look == 1.0
    assert told.status is LiveStatus.LEARNING
    assert told.reason_id == "live.first_look"


def test_the_next_look_waits_for_the_one_before(car, minutes, held):
    scale, parts = aside(car, minutes), halves(minutes)
    first = look_of(scale, parts, 0.0, held)
    scale._move.look_at = scale._move.driven
    held.set()
    scale._learn(scale.recorded(), first.until)
    assert not first.goes_on
    assert scale._looking is not first


def test_a_change_of_load_forgets_what_a_look_finds(car, minutes, held):
    scale = aside(car, minutes)
    look = look_of(scale, halves(minutes), 100.0, held)
    held.set()
    scale.load_changed()
    assert look.found().mass > 0.0
    assert math.isnan(scale.weighing().mass)
    assert scale._setup is look.found().setup


def test_a_new_drive_leaves_behind_what_a_look_finds(car, minutes, held):
    scale = aside(car, minutes)
    look = look_of(scale, halves(minutes), 100.0, held)
    scale._records.resumed = scale.newest
    held.set()
    scale.renew()
    assert not look.goes_on
    assert look.found().mass > 0.0
    assert math.isnan(scale.weighing().mass)
    assert scale._setup is None


def test_a_checkpoint_is_written_while_a_look_goes_on(car, minutes, held):
    """It holds what the stages know, and what is found later hangs on neither."""
    scale, parts = aside(car, minutes), halves(minutes)
    look = look_of(scale, parts, 120.0, held)
    for _ in range(4):
        scale.update_block(next(parts))
    kept = scale.checkpoint()
    assert scale._looking is look
    again = wb.LiveScale.restore(car, kept)
    assert again.weighing().mass == scale.weighing().mass > 0.0
    held.set()
    scale.update_block(rest := merged(parts))
    scale.finish()
    again.update_block(rest)
    assert again.weighing().mass == pytest.approx(scale.weighing().mass, rel=0.02)


def test_no_look_outlives_its_scale(car, minutes, held):
    """Neither one that is finished nor one that is let go."""
    ended = []
    for last in (lambda scale: scale.finish(), lambda scale: None):
        scale = aside(car, minutes)
        look = look_of(scale, halves(minutes), 0.0, held)
        Timer(0.3, held.set).start()
        last(scale)
        del scale
        ended.append(not look.goes_on)
    assert ended == [True, True]
    assert not [t for t in enumerate_threads() if t.name == "look"]


def test_a_look_that_fails_is_told_to_who_feeds(car, minutes, monkeypatch):
    def fails(*of):
        raise MemoryError("no room")

    monkeypatch.setattr(looking, "learn", fails)
    part = minutes.between(minutes.start, minutes.start + 120.0)
    with pytest.raises(MemoryError, match="no room"):
        fed(aside(car, part), part, even(part, 0.5))


@pytest.mark.parametrize("beside", [True, False])
def test_a_session_of_a_vehicle_shows_on_while_it_looks(car, minutes, held, beside):
    """A look beside is held until the session has shown five weighings more."""
    part = minutes.between(minutes.start, minutes.start + 140.0)
    scale, after = wb.LiveScale(car, info=part.info), []

    class Watch(Shown):
        def show(self, weighing):
            if weighing.look == 1.0:
                after.append(weighing.driven)
            if len(after) == 5:
                held.set()

    with Outputs([Watch()]) as outputs, Feed([Replay(part, math.inf)]) as feed:
        Session(feed=feed, scale=scale, outputs=outputs, aside=beside).run(Event())
    assert (len(after) >= 5) == beside
