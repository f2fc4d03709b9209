"""Half an hour of a night of `studies/night.py`: faults in pairs, stops and power cuts."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "studies"))

pytest.importorskip("greenlet")
pytest.importorskip("paho.mqtt.client")

from night import night
from night_world import played

SEED, HOURS, APART = 52, 0.15, 50.0


@pytest.fixture(scope="module")
def bases(loaded):
    """Return a drive that ends where it is slowest after some minutes."""
    later = loaded.drive.between(300.0, 420.0).speed
    part = loaded.drive.between(loaded.drive.start, float(later.time[np.argmin(later.values)]))
    return [played(replace(loaded, drive=part))]


@pytest.fixture(scope="module")
def result(car, bases):
    return night(SEED, HOURS, apart=APART, car=car, bases=bases)


def test_what_it_says_sends_and_writes_is_right(result):
    assert {f.kind for f in result.night.faults} >= {"power", "disk", "broker"}
    assert len(result.lives) >= 2
    assert result.judged.weighed
    assert result.messages > 50
    assert result.judged.wrong == {}


def test_it_is_the_same_to_the_byte_again(result, car, bases):
    again = night(SEED, HOURS, apart=APART, car=car, bases=bases)
    assert again.digest == result.digest
