"""What the shape of the torque reading leaves open of a mass."""

import numpy as np
import pytest

from weighbridge import weigh
from weighbridge.estimators.torque_shape import (
    KNOTS,
    ORDINARY,
    SHAPE_STD,
    shape_columns,
    shape_std,
)

MASS = 1600.0


@pytest.fixture(scope="module")
def weighed(brief_drive, short_car):
    return weigh(brief_drive, short_car).result


def moved(torque, accel):
    """Mass that a unit of the error at each knot adds, by least squares of force on motion [-]."""
    near = np.maximum(0.0, 1.0 - np.abs(torque[:, None] - KNOTS) / (KNOTS[1] - KNOTS[0]))
    accel = accel - accel.mean()
    full = 2.0 * MASS * np.ptp(accel) / np.ptp(torque)
    return full * accel @ near / (accel @ accel) / MASS


def driven(low, high):
    """A drive whose torque goes to and fro between two parts of the highest."""
    torque = np.linspace(low, high, 400)
    return moved(torque, MASS * (torque - torque.mean()))


def test_ordinary_torques_weigh_as_the_calibration_did():
    mean, spread = ORDINARY
    often = np.exp(-0.5 * ((KNOTS - mean) / spread) ** 2)
    assert shape_std((KNOTS - mean) * often, ()) < 1e-6
    assert shape_std(often, ()) < 1e-6


def test_torques_used_as_in_the_calibration_leave_nothing():
    use = driven(0.1, 0.9)
    assert shape_std(use, use) < 1e-6
    assert shape_std(driven(0.5, 0.7), use) > SHAPE_STD


def test_few_torques_leave_more_open_than_many():
    many, few = shape_std(driven(-0.1, 0.8), ()), shape_std(driven(0.5, 0.7), ())
    assert few > 2.0 * many
    assert few > SHAPE_STD


def test_no_torque_leaves_nothing(weighed, short_car):
    assert not shape_columns(weighed.balance.table, short_car, 0.0).any()


def test_an_equal_error_at_all_torques_is_a_force_of_the_engine(weighed, short_car):
    table, highest = weighed.balance.table, 150.0
    columns = shape_columns(table, short_car, highest)
    torque, gearing = np.nan_to_num(table.torque), np.nan_to_num(table.gearing)
    pulling = (torque > 0.0) & (torque < highest)
    np.testing.assert_allclose(
        columns[pulling].sum(axis=1),
        highest * gearing[pulling] * short_car.driveline.efficiency,
        rtol=1e-9,
    )
