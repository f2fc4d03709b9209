"""The load may have changed at a stop after which too little was driven to find it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from weighbridge.estimators import ESTIMATORS
from weighbridge.estimators.joint.load_stops import change_odds
from weighbridge.estimators.joint.possible import PossibleChange, averaged, enough_windows
from weighbridge.estimators.joint.problem import UNMODELLED, FilterInput, states_of
from weighbridge.estimators.joint.terms import Sizes
from weighbridge.kernels import disturbance
from weighbridge.vehicle import Provenance, Vehicle

MASS, WINDOWS, NOISE = 3000.0, 240, 100.0
SETTINGS = ESTIMATORS["joint"].settings()
STATES = states_of(Vehicle(provenance=Provenance(method="joint")), Sizes(MASS, 0.0), SETTINGS)
STATES = STATES._replace(std=np.array([MASS, 20.0, 30.0, 1e-3, 1e-3, 1e-3, 1e-3]))


def van(change, *, at=120, every=12, stood=12.0, seed=0):
    """Windows of a van that stops every so many windows and unloads at one of the stops."""
    rng = np.random.default_rng(seed)
    k = np.arange(WINDOWS)
    mass = MASS + change * (k >= at)
    phi = rng.uniform(-0.2, 0.7, WINDOWS)
    rest = np.where((k % every == 0) & (k > 0), stood, 0.0)
    time = 3.0 * k + np.cumsum(rest)
    return FilterInput(
        start=disturbance.initial_state(
            np.array([MASS, *6 * [0.0]]), np.diag(STATES.std**2), time[0]
        ),
        params=STATES.params(1.0, SETTINGS)._replace(jump_rows=0),
        time=time,
        rows=np.column_stack([phi, np.ones(WINDOWS), phi, np.zeros((WINDOWS, 4))]),
        y=mass * phi + rng.normal(0.0, NOISE, WINDOWS),
        noise=np.full(WINDOWS, NOISE**2),
        added=np.zeros((WINDOWS, 7)),
        stood=rest,
        odds=change_odds(rest),
        traction=mass * phi,
    )


def unaveraged(given):
    return averaged(replace(given, odds=np.full(WINDOWS, np.nan)), STATES, SETTINGS, UNMODELLED)[0]


def std(state):
    return UNMODELLED * float(np.sqrt(state.cov[0, 0]))


def test_a_change_that_was_not_found_is_in_the_interval():
    true = MASS - 240.0
    errors, before = [], []
    for seed in range(12):
        given = van(-240.0, seed=seed)
        state, _, possible = averaged(given, STATES, SETTINGS, UNMODELLED)
        same = unaveraged(given)
        errors.append((state.x[0] - true) / std(state))
        before.append((same.x[0] - true) / std(same))
        assert abs(state.x[0] - true) < abs(same.x[0] - true)
        assert 0.0 < possible.probability < 1.0
    assert np.mean(np.square(before)) > 4.0
    assert np.mean(np.square(errors)) < 2.0


def test_a_change_that_is_likely_is_told_with_its_stop():
    given = van(-500.0, seed=1)
    *_, possible = averaged(given, STATES, SETTINGS, UNMODELLED)
    assert possible.probability > 0.9
    assert possible.time == pytest.approx(given.time[120], abs=1.0)
    # The mass without a change at that stop has followed half of the way.
    assert -400.0 < possible.difference < -100.0
    note = possible.note
    assert note.id == "load.possible"
    assert f"{given.time[120]:.0f} s" in note.values["found"]


def test_stops_without_a_change_widen_little():
    for seed in range(12):
        given = van(0.0, seed=seed, every=40)
        state, _, possible = averaged(given, STATES, SETTINGS, UNMODELLED)
        same = unaveraged(given)
        assert abs(state.x[0] - same.x[0]) < std(same)
        assert std(same) < std(state) < 1.7 * std(same)
        assert possible.probability < 0.5
    assert not possible.note


def test_where_nothing_can_be_told_nothing_is_changed():
    given = van(0.0)
    late = replace(given, odds=np.where(np.arange(WINDOWS) == 232, 1.0, np.nan))
    assert enough_windows(SETTINGS) > WINDOWS - 232
    for none in (late, replace(given, odds=np.full(WINDOWS, np.nan))):
        state, _, possible = averaged(none, STATES, SETTINGS, UNMODELLED)
        assert possible is None
        assert_array_equal(state.x, unaveraged(given).x)


def test_a_change_found_that_the_rest_denies_is_averaged_away():
    shares, errors = [], []
    for seed in range(12):
        true = van(0.0, seed=seed, every=40, stood=60.0)
        found = true.added.copy()
        found[120, [0, 2]] = (SETTINGS.change_std * MASS) ** 2, 1.0
        state, same, possible = averaged(replace(true, added=found), STATES, SETTINGS, UNMODELLED)
        errors.append((abs(state.x[0] - MASS), abs(same.x[0] - MASS)))
        assert errors[-1][0] < 2.0 * std(state)
        assert possible.doubtful_time == true.time[120]
        shares.append(possible.none)
    averaged_error, found_error = np.mean(errors, axis=0)
    assert averaged_error < 0.8 * found_error
    assert np.median(shares) > 0.4
    sure = van(-600.0, seed=1, every=40, stood=60.0)
    *_, possible = averaged(replace(sure, added=found), STATES, SETTINGS, UNMODELLED)
    assert possible.none < 1e-3


def test_a_change_found_that_may_be_none_is_told():
    note = PossibleChange(math.nan, 0.0, 1492.0, 0.38).note
    assert note.id == "load.possible"
    assert "38 %" in note.values["found"]


def test_a_stop_at_which_a_change_was_found_is_not_tried_again():
    given = van(-500.0, seed=1)
    found = given.added.copy()
    found[120, 0] = (SETTINGS.change_std * MASS) ** 2
    *_, possible = averaged(replace(given, added=found), STATES, SETTINGS, UNMODELLED)
    assert possible.probability < 0.6
    assert possible.time != given.time[120]
