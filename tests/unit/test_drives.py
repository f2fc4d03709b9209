"""Kept drives are those that are simulated, to the last bit."""

from dataclasses import replace

import pytest
from numpy.testing import assert_array_equal
from tests.drives import Kept

from weighbridge.simulation import make_scenario, simulate_car


def scenario(seed=7):
    return replace(make_scenario("car-short", seed=seed), duration=40.0)


@pytest.mark.parametrize("damage", [None, b"cut off"])
def test_a_kept_drive_is_the_simulated_one(tmp_path, damage):
    kept = Kept(tmp_path)
    kept(scenario())
    (file,) = tmp_path.iterdir()
    if damage:
        file.write_bytes(damage)
    again, made = kept(scenario()), simulate_car(scenario())
    assert again.drive.info == made.drive.info
    for name, signal in made.drive.signals.items():
        assert_array_equal(again.drive.signals[name].time, signal.time)
        assert_array_equal(again.drive.signals[name].values, signal.values)
    assert_array_equal(again.truth.mass, made.truth.mass)


def test_another_recipe_is_another_drive(tmp_path):
    kept = Kept(tmp_path)
    first, second = kept(scenario(7)), kept(scenario(8))
    assert first.scenario.seed != second.scenario.seed
    assert len(list(tmp_path.iterdir())) == 2


def test_the_folder_does_not_outgrow_its_room(tmp_path):
    kept = Kept(tmp_path, room=1e3)
    assert kept(scenario()).drive.signals
    assert not list(tmp_path.iterdir())
