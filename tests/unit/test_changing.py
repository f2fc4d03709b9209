"""A change of the torque's scale: launches show none, a real one is found beside them."""

from dataclasses import replace

import numpy as np
import pytest
from numba import config

from weighbridge.estimators.joint.changing import in_place_of_loads, largest
from weighbridge.estimators.joint.problem import FilterInput
from weighbridge.estimators.joint.slow_errors import filter_params
from weighbridge.kernels import disturbance
from weighbridge.messages import phrase

pytestmark = pytest.mark.skipif(bool(config.DISABLE_JIT), reason="runs the filter many times")

MASS, NOISE, WINDOWS = 12_000.0, 400.0, 400


def truck(*, launch_error=0.0, late_scale=1.0, told=True):
    """Windows of a truck of 12 t that stops every ten windows; its launches may be wrong."""
    rng = np.random.default_rng(4)
    time = 3.0 * np.arange(WINDOWS)
    launch = np.arange(WINDOWS) % 10 == 5
    phi = np.where(launch, 0.9, rng.uniform(-0.2, 0.6, WINDOWS))
    force = MASS * phi + rng.normal(0.0, NOISE, WINDOWS)
    force += np.where(launch & (time > 300.0), launch_error, 0.0)
    traction = MASS * phi
    force = np.where(time > 500.0, late_scale, 1.0) * force
    std = np.array([MASS, 100.0, 100.0, 1e-3, 1e-3, 1e-3, 1e-3])
    rows = np.column_stack([phi, np.ones(WINDOWS), np.ones(WINDOWS), np.zeros((WINDOWS, 4))])
    return FilterInput(
        start=disturbance.initial_state(np.array([MASS, *6 * [0.0]]), np.diag(std**2), time[0]),
        params=filter_params(std, 5.0, 10),
        time=time,
        rows=np.ascontiguousarray(rows),
        y=force,
        noise=np.full(WINDOWS, NOISE**2),
        added=np.zeros((WINDOWS, 7)),
        stood=np.where(launch & told, 2.0, 0.0),
        odds=np.full(WINDOWS, np.nan),
        traction=traction,
    )


def test_launches_with_a_slipping_clutch_pass_for_no_change_of_scale():
    assert largest(truck(launch_error=-2000.0, told=False)).sure
    assert not largest(truck(launch_error=-2000.0)).sure


def test_a_change_of_scale_is_found_beside_the_launches():
    found = largest(truck(late_scale=0.8))
    assert found.sure
    assert found.change == pytest.approx(-0.2, abs=0.03)
    assert found.start == pytest.approx(500.0, abs=60.0)


def stopping(*, scale=1.0, load=0.0, stood=25.0):
    """Windows of a truck with air drag; between two stops its torque or its load is another."""
    given = truck()
    rng = np.random.default_rng(9)
    drag = 3000.0 + 2500.0 * np.sin(given.time / 60.0)
    between = (given.time > 400.0) & (given.time < 800.0)
    mass = np.where(between, 1.0 + load, 1.0) * MASS
    pull = mass * given.rows[:, 0] + drag
    force = np.where(between, scale, 1.0) * pull + rng.normal(0.0, NOISE, WINDOWS)
    begins = np.flatnonzero(np.diff(between.astype(int))) + 1
    added, still = np.zeros((WINDOWS, 7)), np.zeros(WINDOWS)
    added[begins, 0], still[begins] = (0.2 * MASS) ** 2, stood
    # What the estimator says of the traction, which follows the reading.
    apparent = np.where(between, (1.0 + load) * scale, 1.0) * MASS * given.rows[:, 0] + drag
    return replace(given, y=force - drag, added=added, stood=still, traction=apparent)


def test_a_scale_between_two_stops_is_told_where_loads_would_pass_for_it():
    found = in_place_of_loads(stopping(scale=0.85))
    assert found.gain > 5.0
    assert found.change == pytest.approx(-0.15, abs=0.03)
    assert found.start == pytest.approx(402.0)
    assert found.doubt.id == "load.scale_or_load"
    assert found.doubt.values["size"] == phrase("less", share=16.0)


def test_a_load_is_none_of_the_torque():
    found = in_place_of_loads(stopping(load=-0.15))
    assert found.gain < -5.0
    assert found.doubt is None


def test_where_somebody_had_the_time_to_load_nothing_is_told():
    assert in_place_of_loads(stopping(scale=0.85, stood=90.0)).doubt is None
    assert in_place_of_loads(truck()) is None
