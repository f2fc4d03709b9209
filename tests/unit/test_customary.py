"""Pounds and feet for people; numbers inside and in files stay SI."""

import re

import numpy as np
import pytest
from tests.noted import noted
from tests.unit.test_report import MASS, Elements, make_weighing, written

from weighbridge import ConfigError, Problem
from weighbridge.customary import shown_amount, shown_in, shown_unit
from weighbridge.estimators.joint.possible import PossibleChange
from weighbridge.report import mass_figure

POUND = 0.45359237
"""Mass of a pound [kg] (NIST Special Publication 811, 2008, B.8)."""


def overload(mass):
    return Problem.of("mass.below_tare", mass=mass, tare=1400.0)


def test_amounts_are_those_of_nist_and_only_while_they_are_asked_for():
    with shown_in("us"):
        assert shown_unit("kg") == "lb"
        assert shown_amount(1000.0, "kg") == pytest.approx(2204.62, abs=0.01)
        assert shown_amount(np.array([100.0]), "km/h") == pytest.approx([62.137], abs=0.001)
        assert shown_amount(1.0, "m") == pytest.approx(3.28084, abs=1e-5)
        assert shown_amount(3.0, "min") == 3.0
    assert shown_unit("kg") == "kg"
    assert shown_amount(1000.0, "kg") == 1000.0


def test_no_other_system_is_taken():
    with pytest.raises(ConfigError, match=r"did you mean us\?"), shown_in("uss"):
        pass


def test_a_message_is_shown_in_pounds_and_written_in_kilograms():
    problem = overload(1300.0).at("drive 1")
    with shown_in("us"):
        assert [float(n) for n in re.findall(r"(\d+) lb", problem.shown)] == [2866.0, 3086.0]
        assert problem.shown.startswith("drive 1: ")
        assert problem.to_dict()["text"] == problem.text
        # Read from a file it has no values, and is shown as it was written.
        again = Problem.from_dict(problem.to_dict())
        assert again.shown == problem.text
        assert noted("no number").shown == "no number"
    assert problem.shown == problem.text
    assert "1300 kg" in problem.text


def test_a_part_of_a_message_is_shown_in_pounds():
    given = {"time": 60.0, "doubtful_time": 30.0, "none": 0.3}
    problem = PossibleChange(probability=0.6, difference=500.0, **given).note
    assert "500 kg" in problem.text
    with shown_in("us"):
        assert "1102 lb more" in problem.shown
        assert "kg" not in problem.shown


def test_a_report_in_pounds_names_no_kilogram(tmp_path):
    with shown_in("us"):
        page = Elements(written(tmp_path, [make_weighing()]))
        figure = mass_figure(make_weighing())
    assert f"{MASS / POUND:.0f} ± " in page.text
    assert " kg" not in page.text
    assert figure.layout.yaxis.title.text.endswith("[lb]")
    assert figure.layout.xaxis.title.text.endswith("[min]")
    low, high = figure.layout.yaxis.range
    assert low < MASS / POUND < high < 2.0 * MASS / POUND
    final = next(t for t in figure.data if (t.name or "").startswith("final mass"))
    assert np.allclose(final.y, MASS / POUND)
    assert final.name == f"final mass {MASS / POUND:.0f} lb"
