"""Every position format holds the same drive; see make_position_logs.py."""

import sys
from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from weighbridge import read_drive

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from make_logs import GNSS_TIME, truth  # noqa: E402


@pytest.mark.parametrize("name", ["log.nmea", "log.gpx", "log.vbo"])
def test_position_log(name):
    drive = read_drive(HERE / name)
    assert drive.info.start_time == "2021-03-05T23:59:58+00:00"
    for quantity in ("latitude", "altitude", "gnss_speed"):
        signal = drive.signals[quantity]
        assert_allclose(signal.time, GNSS_TIME, atol=1e-6)
        assert_allclose(signal.values, truth(quantity, GNSS_TIME), rtol=1e-5, atol=1e-5)
    longitude = drive.signals["longitude"].values
    assert_allclose(longitude, -truth("longitude", GNSS_TIME), atol=1e-9)
    assert_allclose(drive.signals["gnss_course"].values, 0.0)
