"""What the estimator adds to the standard deviation of the rows."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from weighbridge import Vehicle
from weighbridge.estimators import block_jackknife
from weighbridge.estimators.judging import MOTION_STD, consider_std
from weighbridge.vehicle import TORQUE_SOURCES, Provenance, TorqueModel

CAR = Vehicle(
    torque=TorqueModel(source="load", coefficients=(0.0, 900.0)),
    provenance=Provenance(mass_scale_std=0.0),
)


def test_a_cold_start_counts_by_its_share_of_the_information():
    time = np.arange(0.0, 3000.0, 1.0)
    phi = np.where(time < 600.0, 2.0, 1.0)
    every = np.ones(time.size, dtype=bool)
    share = 600 * 4.0 / (600 * 4.0 + 2400)
    balance = SimpleNamespace(
        table=SimpleNamespace(time=time),
        motion=SimpleNamespace(source="inertial", specific_force_scale_std=0.0),
        brake_hidden=False,
        coarse_std=0.0,
        air_std=0.0,
    )
    assert consider_std(balance, phi, every, CAR) == pytest.approx(
        share * TORQUE_SOURCES["load"].cold_std
    )
    first = time < 600.0
    assert consider_std(balance, phi, first, CAR) == pytest.approx(TORQUE_SOURCES["load"].cold_std)
    measured = replace(CAR, torque=TorqueModel(source="measured"))
    assert consider_std(balance, phi, first, measured) == pytest.approx(
        TORQUE_SOURCES["measured"].cold_std
    )
    balance.motion.source = "speed_grade"
    late = time >= 600.0
    assert consider_std(balance, phi, late, measured) > MOTION_STD["speed_grade"]


def test_jackknife_counts_blocks_not_rows():
    rng = np.random.default_rng(3)
    n, block, minutes = 240, 60.0, 400
    time = np.arange(n * minutes) * (block / n)
    phi = rng.uniform(0.2, 1.5, time.size)
    slow = np.repeat(rng.normal(0.0, 80.0, minutes), n)
    mass, std, blocks = block_jackknife(
        time, phi, 1500.0 * phi + slow, np.ones(time.size, dtype=bool)
    )
    assert blocks == minutes
    # One error a block: var = sum((sum phi)^2) / (sum phi^2)^2 * 80^2.
    sums = phi.reshape(minutes, n).sum(axis=1)
    expected = 80.0 * np.sqrt(np.sum(sums**2)) / np.sum(phi**2)
    assert std == pytest.approx(expected, rel=0.15)
    assert abs(mass - 1500.0) < 4.0 * expected


def test_fewer_than_three_blocks_say_nothing_of_the_spread():
    time = np.arange(0.0, 100.0, 0.25)
    _, std, blocks = block_jackknife(time, np.ones(400), np.ones(400), np.ones(400, dtype=bool))
    assert blocks == 2
    assert np.isinf(std)
