"""Positions filled in between fixes, as a table on one clock has them."""

import numpy as np
import polars as pl
import pytest
from numpy.testing import assert_allclose

import weighbridge as wb

EARTH = 6.37e6


def driven(time):
    """Position of a drive with bends and hills, standing from 200 to 240 s [rad]."""
    along = 12.0 * np.where(time < 200.0, time, np.maximum(time - 40.0, 200.0))
    north = along + 300.0 * np.sin(along / 400.0)
    return np.column_stack((0.85 + north / EARTH, 0.2 + 150.0 * np.cos(along / 250.0) / EARTH))


FIXES = np.concatenate((np.arange(3.3, 100.0), np.arange(160.3, 400.0)))
"""One a second, none for a minute."""


def filled(rate, seed=1):
    """Lay the fixes on a clock of a rate [Hz], whose stamps jitter, by straight lines."""
    noise = np.random.default_rng(seed)
    time = np.arange(0.0, 420.0, 1.0 / rate)
    time = time + noise.uniform(0.0, 0.3 / rate, time.size)
    at = driven(FIXES)
    return time, np.column_stack([np.interp(time, FIXES, at[:, k]) for k in range(2)])


def table(time, position, **more):
    """Read such positions as a table on one clock."""
    degrees = np.degrees(position)
    columns = {"time_s": time, "latitude_deg": degrees[:, 0], "longitude_deg": degrees[:, 1]}
    return wb.read_frame(pl.DataFrame(columns | more), name="table")


@pytest.mark.parametrize("rate", [20.0, 100.0, 400.0])
def test_only_the_fixes_are_taken(rate):
    time, position = filled(rate)
    fixes = table(time, position).signals["latitude"].time
    moved = (FIXES < 200.0) | (FIXES > 241.0)
    nearest = np.min(np.abs(fixes[:, None] - FIXES[None, moved]), axis=0)
    assert nearest.max() < 1.5 / rate + 0.006
    # Neither the minute that was filled nor what stands before the first and after the last fix.
    assert not np.any((fixes > 101.0) & (fixes < 159.0))
    assert fixes[0] > 3.0
    assert fixes[-1] < 401.0
    # A stop shows no bends, and its positions are right.
    assert np.diff(fixes[(fixes > 195.0) & (fixes < 245.0)]).max() < 2.1
    assert fixes.size == pytest.approx(FIXES.size, abs=4)


def test_a_drive_says_in_one_sentence_what_was_left_out():
    time, position = filled(100.0)
    height = np.interp(time, FIXES, 200.0 + 20.0 * np.sin(FIXES / 30.0))
    drive = table(time, position, altitude_m=height)
    (found,) = [p for p in drive.problems if p.id == "position.filled"]
    assert found.values["period"] == pytest.approx(1.0, rel=1e-3)
    assert " 61 s" in found.values["more"]
    assert len(drive.signals["altitude"]) == len(drive.signals["latitude"]) < 350
    there = drive.signals["latitude"]
    assert_allclose(there.values, np.interp(there.time, FIXES, driven(FIXES)[:, 0]), atol=1e-12)


@pytest.mark.parametrize("kind", ["noisy", "rounded", "held", "slow"])
def test_positions_that_were_recorded_stay(kind):
    time = np.arange(0.0, 300.0, 1.0 if kind == "slow" else 0.1)
    position = driven(time)
    if kind == "noisy":
        position += np.random.default_rng(2).normal(0.0, 0.01 / EARTH, position.shape)
    elif kind == "rounded":
        position = np.radians(np.round(np.degrees(position), 7))
    elif kind == "held":
        position = driven(np.floor(time))
    drive = table(time, position)
    assert not any(p.id == "position.filled" for p in drive.problems)
    assert_allclose(drive.signals["latitude"].time, time)
    assert_allclose(drive.signals["latitude"].values, position[:, 0], atol=1e-12)
