"""Which samples of a live stream are taken, one by one and in blocks."""

import math

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from weighbridge import DriveInfo
from weighbridge.live.records import BACK, FARTHEST, Records

NEWEST = 100.0
LATENESS = 1.0


def taken(samples, *, whole):
    """Records after samples of one signal, and what they hold of it."""
    records = Records(LATENESS)
    for time, value in samples:
        if whole:
            records.add_block({"vehicle_speed": (np.array([time]), np.array([value]))})
        else:
            records.add("vehicle_speed", time, value)
    counts = (records.late, records.unfit, records.jumps, records.newest, records.oldest)
    records.seal(math.inf)
    signal = records.drive(DriveInfo()).signals.get("vehicle_speed")
    return counts, signal.time if signal is not None else np.empty(0)


@pytest.mark.parametrize(
    ("time", "value", "fate"),
    [
        (NEWEST + 1.0, 3.0, "taken"),
        (NEWEST - LATENESS, 3.0, "taken"),
        (math.nextafter(NEWEST - LATENESS, 0.0), 3.0, "late"),
        (NEWEST - LATENESS - BACK + 0.1, 3.0, "late"),
        (NEWEST - LATENESS - BACK, 3.0, "unfit"),
        (math.nextafter(NEWEST + FARTHEST, 0.0), 3.0, "taken"),
        (NEWEST + FARTHEST, 3.0, "unfit"),
        (NEWEST + 1.0, math.nan, "unfit"),
        (NEWEST + 1.0, math.inf, "unfit"),
        (math.nan, 3.0, "unfit"),
        (math.inf, 3.0, "unfit"),
        (-math.inf, 3.0, "unfit"),
    ],
)
def test_one_rule_takes_single_samples_and_blocks(time, value, fate):
    samples = [(NEWEST, 3.0), (time, value)]
    alone, times = taken(samples, whole=False)
    late, unfit, *_ = alone
    assert (sum(late.values()), sum(unfit.values())) == (fate == "late", fate == "unfit")
    assert times.size == 1 + (fate == "taken")
    together, of_blocks = taken(samples, whole=True)
    assert alone == together
    assert_array_equal(times, of_blocks)


@pytest.mark.parametrize(("time", "fits"), [(9.9e9, True), (1e10, False), (-1e10, False)])
def test_the_first_stamp_is_an_instant_that_a_clock_can_tell(time, fits):
    for whole in (False, True):
        (_, unfit, *_), times = taken([(time, 3.0)], whole=whole)
        assert times.size == fits
        assert bool(unfit) == (not fits)


def test_what_is_sealed_takes_no_earlier_sample():
    records = Records(LATENESS)
    records.add("vehicle_speed", NEWEST, 3.0)
    records.seal(NEWEST + 5.0)
    records.add("vehicle_speed", NEWEST + 4.0, 3.0)
    assert records.late == {"vehicle_speed": 1}
    records.add("vehicle_speed", NEWEST + 5.0, 3.0)
    assert records.newest == NEWEST + 5.0


def test_a_look_at_what_waits_leaves_nothing_behind():
    """A slow signal has no open sample when the state is kept, and then all fall silent."""
    records = Records(LATENESS)
    records.add("ambient_temperature", NEWEST, 20.0)
    records.seal(NEWEST + 1.0)
    assert records.last(10.0)["ambient_temperature"][0].size == 1
    assert records.waiting_from == math.inf


def test_a_value_that_is_asked_for_seldom_has_its_rate():
    records = Records(lateness=200.0)
    records.add_block({"vehicle_speed": (np.arange(0.0, 100.0, 0.2), np.ones(500))})
    records.add_block({"ambient_temperature": (np.array([5.0, 35.0, 65.0]), np.full(3, 290.0))})
    records.seal(99.0)
    assert records.rate("ambient_temperature", 10.0) == pytest.approx(1.0 / 30.0)
    assert records.rate("vehicle_speed", 10.0) == pytest.approx(5.0, rel=0.05)
    assert records.rate("altitude", 10.0) == 0.0
