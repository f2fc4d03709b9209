"""Way, stops and time on the move of a drive that is simple enough to count by hand."""

import numpy as np
import pytest

from weighbridge import Drive, Signal
from weighbridge.fleet.facts import Travel

CLOCK = np.arange(0.0, 900.0)
STANDS = ((0.0, 60.0), (300.0, 400.0), (600.0, 660.0), (840.0, 899.0))


@pytest.fixture
def travel():
    speed = np.full(CLOCK.size, 10.0)
    for begin, end in STANDS:
        speed[int(begin) : int(end) + 1] = 0.0
    return Travel(Drive("van", {"vehicle_speed": Signal("vehicle_speed", CLOCK, speed)}))


def test_every_stop_is_found(travel):
    # Half a step earlier and later the speed is already that of driving.
    np.testing.assert_allclose(travel.stops(), STANDS, atol=1.0)


def test_time_on_the_move_is_that_between_stops(travel):
    standing = sum(end - begin for begin, end in STANDS)
    assert travel.moving_time(0.0, 899.0) == pytest.approx(899.0 - standing, abs=2.0 * len(STANDS))
    assert travel.moving_time(310.0, 390.0) == 0.0
