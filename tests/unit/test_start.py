"""Where a recording begins shows nothing: any cut of a drive has the motion of the drive."""

import numpy as np
import pytest

from weighbridge import DriveError, Signal
from weighbridge.navigation import find_motion

FIXES = ("latitude", "longitude", "altitude")
LENGTH = 200.0


def speed_error(motion, truth) -> float:
    """Largest error of the speed where the vehicle moves, relative."""
    true = np.interp(motion.time, truth.time, truth.speed)
    moving = motion.valid & (true > 10.0)
    return float(np.max(np.abs(motion.speed[moving] / true[moving] - 1.0)))


def heading_error(motion, truth) -> float:
    """Root mean square error of the heading where the vehicle moves [rad]."""
    true = np.interp(motion.time, truth.time, np.unwrap(truth.heading))
    moving = motion.valid & (np.interp(motion.time, truth.time, truth.speed) > 10.0)
    error = np.angle(np.exp(1j * (motion.heading - true)))
    return float(np.sqrt(np.mean(error[moving] ** 2)))


def thinned(drive, step, late=0.0):
    """Keep every so many fixes, from some time after the start on, and no speed by GNSS."""
    kept = []
    for name in FIXES:
        s = drive.signals[name]
        there = s.time >= drive.start + late
        kept.append(Signal(name, s.time[there][::step], s.values[there][::step]))
    return drive.without("gnss_speed", "gnss_course").with_signals(*kept)


@pytest.mark.parametrize("begin", [100.0, 525.0, 574.0])
@pytest.mark.parametrize(("step", "late"), [(1, 0.0), (5, 0.0), (10, 0.0), (2, 60.0)])
def test_a_drive_that_begins_at_speed_has_its_motion(short_drive, begin, step, late):
    start = short_drive.drive.start + begin
    motion = find_motion(thinned(short_drive.drive.between(start, start + LENGTH), step, late))
    assert speed_error(motion, short_drive.truth) < 0.03
    assert heading_error(motion, short_drive.truth) < 0.03
    assert motion.speed_scale == pytest.approx(1.008, abs=0.004)


def test_a_first_fix_that_is_far_off_does_not_turn_the_drive(short_drive):
    start = short_drive.drive.start + 525.0
    cut = thinned(short_drive.drive.between(start, start + LENGTH), 1)
    latitude = cut.signals["latitude"]
    values = latitude.values.copy()
    values[0] += 110.0 / 6.37e6
    motion = find_motion(cut.with_signals(Signal("latitude", latitude.time, values)))
    assert speed_error(motion, short_drive.truth) < 0.03


def of_another_place(drive):
    """Mirror the way: its bends are others than the gyro's."""
    longitude = drive.signals["longitude"]
    mirrored = 2.0 * longitude.values[0] - longitude.values
    return drive.with_signals(Signal("longitude", longitude.time, mirrored))


def test_positions_that_fit_no_motion_are_left_out(short_drive):
    drive = short_drive.drive.without("gnss_speed", "gnss_course")
    motion = find_motion(of_another_place(drive))
    assert motion.notes[0].id in ("gnss.contradicts", "gnss.scale")
    assert motion.speed_scale is None
    own = find_motion(drive)
    np.testing.assert_allclose(
        motion.speed / own.speed_scale, own.speed, atol=0.02 * float(np.max(own.speed))
    )


def test_without_another_speed_such_a_drive_has_no_motion(short_drive):
    drive = of_another_place(short_drive.drive).without("vehicle_speed", "gnss_course")
    with pytest.raises(DriveError) as refused:
        find_motion(drive)
    assert refused.value.problem.id in ("gnss.contradicts", "gnss.scale")
