"""A simulated car, calibrated and weighed once, for all tests of live weighing."""

import copy

import pytest

import weighbridge as wb
from weighbridge.pipeline.forward import forward_weigh, identify_forward
from weighbridge.simulation import MIDSIZE, Scenario, Sensors, short_route, simulate_car

SHORT = 240.0
"""Of the drives that are fed again and again [s]."""

PHONE = Sensors(imu_rate=100.0)
"""Inertial samples as often as of a phone: half of what there would be to feed."""


def simulated(name, payload, seed):
    """Return a drive through the town."""
    return simulate_car(
        Scenario(
            name=name, car=MIDSIZE, route=short_route(), payload=payload, sensors=PHONE, seed=seed
        )
    )


@pytest.fixture(scope="session")
def car():
    known = [simulated("known", load, 51_001 + k) for k, load in enumerate((0.0, 300.0))]
    masses = [m.scenario.mass for m in known]
    # A tare backs the masses; without one they are uncertain by 2.5 %.
    named = wb.Vehicle(name="known", tare=masses[0])
    return wb.calibrate([m.drive for m in known], mass=masses, vehicle=named)


@pytest.fixture(scope="session")
def loaded():
    return simulated("loaded", 250.0, 51_010)


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
def middle(short):
    """Return an instant in the short drive at which there is a mass."""
    return short.start + 165.0


@pytest.fixture(scope="session")
def _half_driven(short, middle, weighing, setup):
    scale = wb.LiveScale(weighing.vehicle, setup=setup, info=short.info)
    part = short.between(short.start, middle)
    scale.update_block({n: (s.time, s.values) for n, s in part.signals.items()})
    return scale


@pytest.fixture
def half_driven(_half_driven):
    """Return a scale that has heard the short drive up to its middle."""
    return copy.deepcopy(_half_driven)


@pytest.fixture(scope="session")
def forward(short, weighing, setup):
    return forward_weigh(short, setup)


@pytest.fixture(scope="session")
def brief(short):
    """Return what is fed in the smallest steps."""
    return short.between(short.start, short.start + 0.5 * SHORT)


@pytest.fixture(scope="session")
def forward_brief(brief, weighing, setup):
    return forward_weigh(brief, setup)
