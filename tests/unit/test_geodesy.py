"""The local frame of the navigation."""

import numpy as np
import pymap3d
import pytest

from weighbridge.navigation.geodesy import LocalFrame

FRAME = LocalFrame(np.radians(56.0), np.radians(12.5), 30.0)


def test_there_and_back():
    rng = np.random.default_rng(1)
    lat = FRAME.latitude + rng.uniform(-0.008, 0.008, 50)
    lon = FRAME.longitude + rng.uniform(-0.014, 0.014, 50)
    alt = rng.uniform(-20.0, 300.0, 50)
    back = FRAME.to_geodetic(FRAME.to_ned(lat, lon, alt))
    # A tenth of a metre at 50 km: the Earth taken as a sphere on the way back.
    assert back[0] == pytest.approx(lat, abs=1e-7)
    assert back[1] == pytest.approx(lon, abs=1e-7)
    assert back[2] == pytest.approx(alt)


def test_near_the_origin_it_is_the_tangent_frame():
    lat = FRAME.latitude + np.array([1e-5, -2e-5])
    lon = FRAME.longitude + np.array([3e-5, 1e-5])
    alt = np.array([31.0, 28.0])
    expected = pymap3d.geodetic2ned(
        lat, lon, alt, FRAME.latitude, FRAME.longitude, FRAME.altitude, deg=False
    )
    assert FRAME.to_ned(lat, lon, alt) == pytest.approx(np.column_stack(expected), abs=0.01)


def test_a_level_road_stays_level_far_away():
    lat = FRAME.latitude + np.linspace(0.0, 0.005, 100)
    ned = FRAME.to_ned(lat, np.full(100, FRAME.longitude), np.full(100, 30.0))
    assert ned[-1, 0] > 30_000.0
    assert np.abs(ned[:, 2]).max() == 0.0
