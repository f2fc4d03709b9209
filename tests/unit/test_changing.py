"""A change of the torque's scale: launches show none, a real one is found beside them."""

import numpy as np
import pytest
from numba import config

from weighbridge.estimators.joint.changing import largest
from weighbridge.estimators.joint.problem import FilterInput, states_of
from weighbridge.estimators.joint.settings import JointSettings
from weighbridge.estimators.joint.terms import Sizes
from weighbridge.kernels import disturbance
from weighbridge.vehicle import Provenance, Vehicle

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
    states = states_of(
        Vehicle(provenance=Provenance(method="joint")), Sizes(MASS, 0.0), JointSettings()
    )
    std = np.array([MASS, 100.0, 100.0, 1e-3, 1e-3, 1e-3, 1e-3])
    rows = np.column_stack([phi, np.ones(WINDOWS), np.ones(WINDOWS), np.zeros((WINDOWS, 4))])
    return FilterInput(
        start=disturbance.initial_state(np.array([MASS, *6 * [0.0]]), np.diag(std**2), time[0]),
        params=states._replace(std=std).params(1.0, JointSettings(settle_windows=10)),
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
