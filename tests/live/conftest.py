"""A simulated car, calibrated and weighed once, for all tests of live weighing."""

import pytest

import weighbridge as wb
from weighbridge.pipeline.forward import forward_weigh, identify_forward
from weighbridge.simulation import MIDSIZE, Scenario, short_route, simulate_car

SHORT = 240.0
"""Of the drives that are fed again and again [s]."""


@pytest.fixture(scope="session")
def car():
    known = [
        simulate_car(
            Scenario(name="known", car=MIDSIZE, route=short_route(), payload=load, seed=51_001 + k)
        )
        for k, load in enumerate((0.0, 300.0, 100.0))
    ]
    return wb.calibrate([m.drive for m in known], mass=[m.scenario.mass for m in known])


@pytest.fixture(scope="session")
def loaded():
    return simulate_car(
        Scenario(name="loaded", car=MIDSIZE, route=short_route(), payload=250.0, seed=51_010)
    )


@pytest.fixture(scope="session")
def weighing(car, loaded):
    return wb.weigh(loaded.drive, car)


@pytest.fixture(scope="session")
def setup(weighing):
    return identify_forward(weighing)


@pytest.fixture(scope="session")
def short(weighing):
    return weighing.drive.between(weighing.drive.start, weighing.drive.start + SHORT)


@pytest.fixture(scope="session")
def forward(short, weighing, setup):
    return forward_weigh(short, setup)
