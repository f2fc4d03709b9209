"""The moving mean, beside the filter of SciPy."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.ndimage import uniform_filter1d

from weighbridge.signals import moving_mean


@pytest.mark.parametrize("samples", [1, 2, 7, 50, 1000])
@pytest.mark.parametrize("width", [1, 2, 3, 60, 101])
@pytest.mark.parametrize(
    ("beyond", "mode"), [("constant", "constant"), ("edge", "nearest"), ("symmetric", "reflect")]
)
def test_moving_mean_is_that_of_scipy_to_the_last_bit(samples, width, beyond, mode):
    values = np.random.default_rng(samples).normal(3.0, 2.0, (3, samples))
    found = moving_mean(values, width, beyond)
    assert_array_equal(found, uniform_filter1d(values, width, axis=1, mode=mode))
    assert_array_equal(moving_mean(values[0], width, beyond), found[0])


def test_nothing_has_no_mean():
    assert moving_mean(np.empty(0), 5, "symmetric").size == 0
