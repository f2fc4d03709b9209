"""The reference drive comes to what is in the repository; else the commit must show it."""

import polars as pl
import pytest
from make_reference import CAR, STATES, calibrated, states, weighing
from numpy.testing import assert_allclose

ANEW = "results changed; look at them and run python tests/golden/make_reference.py"
ROUNDING = {
    "mass_kg": 0.05,
    "std_kg": 0.02,
    "grade_rad": 5e-6,
    "speed_mps": 5e-4,
    "specific_force_mps2": 1e-4,
}
"""What other processors and libraries may make of the last digits."""


@pytest.fixture(scope="module")
def made():
    return weighing()


def test_states_are_those_of_the_repository(made):
    found, kept = states(made[1]), pl.read_csv(STATES)
    assert found.columns == kept.columns
    assert found.height == kept.height
    for name, tolerance in ROUNDING.items():
        assert_allclose(found[name], kept[name], rtol=0.0, atol=tolerance, err_msg=ANEW)


def test_the_calibration_is_that_of_the_repository(made):
    found, kept = calibrated(made[0]), pl.read_csv(CAR)
    assert found["name"].to_list() == kept["name"].to_list()
    assert_allclose(found["value"], kept["value"], rtol=1e-4, err_msg=ANEW)


def test_the_mass_is_right(made):
    low, high = made[1].interval(0.99)
    assert low < 1580.0 + 240.0 < high
