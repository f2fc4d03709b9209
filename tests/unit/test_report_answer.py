"""The first block of a report: what it weighs, how sure that is, what would help."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.test_report import MASS, VEHICLE, Elements, make_weighing, written

from weighbridge import Status, Vehicle
from weighbridge.vehicle import Provenance, TorqueModel

REACH = 1.959963985
"""Standard deviations of half a 95 % interval."""


def weighed(std, systematic=math.nan, vehicle=VEHICLE, method="joint", **changed):
    """Return a weighing of 1500 kg with a normal error."""
    w = make_weighing()
    result = replace(
        w.result, std=std, systematic_std=systematic, degrees_of_freedom=math.inf, **changed
    )
    return replace(w, vehicle=vehicle, seen=vehicle, result=result, method=method)


def block(tmp_path, weighing, **options):
    html = written(tmp_path, [weighing], **options)
    shown = html[html.index('<div class="verdict') : html.index("<h3>")]
    return shown.replace("\u00a0", " ")


@pytest.mark.parametrize(
    ("share", "name"), [(0.019, "fine"), (0.0487, "good"), (0.099, "fair"), (0.24, "rough")]
)
def test_the_grade_is_that_of_the_interval(tmp_path, share, name):
    html = block(tmp_path, weighed(share * MASS / REACH))
    assert f'<div class="verdict {name}">' in html
    assert f'<p class="answer {name}">1500 ± {share * MASS:.0f} kg' in html
    assert f"{name}: ± " in html


def test_a_rough_mass_is_not_green(tmp_path):
    html = written(tmp_path, [weighed(0.24 * MASS / REACH)])
    style = re.search(r"<style>(.*?)</style>", html, re.S).group(1)
    green = re.findall(r"([^{}]*)\{[^{}]*--grade: var\(--good\)", style)
    assert len(green) == 1
    assert "rough" not in green[0]
    assert "fair" not in green[0]
    assert "converged" in html


def test_payload_and_permitted_mass_have_the_same_interval(tmp_path):
    page = Elements(block(tmp_path, weighed(30.0, vehicle=replace(VEHICLE, gross=1600.0))))
    half = REACH * 30.0
    assert f"+100 ± {half:.0f} kg" in page.text
    low, high = 100.0 * (MASS - half) / 1600.0, 100.0 * (MASS + half) / 1600.0
    assert f"94 % of 1600 kg, within it: {low:.0f} to {high:.0f} %" in page.text


def test_a_report_of_several_drives_begins_with_the_overloaded_ones(tmp_path):
    both = [weighed(30.0, vehicle=replace(VEHICLE, gross=gross)) for gross in (1600.0, 1400.0)]
    drives = [
        replace(w, drive=replace(w.drive, name=name))
        for w, name in zip(both, ("light", "heavy"), strict=True)
    ]
    html = written(tmp_path, drives)
    first = re.search(r'<p class="alert bad">(.*?)</p>', html)
    assert first.group(1).endswith(": heavy.")
    assert first.start() < html.index("<table")
    assert 'class="alert bad"' not in written(tmp_path, [drives[0], drives[0]])


@pytest.mark.parametrize(
    ("gross", "verdict"),
    [(1600.0, "within it"), (1520.0, "perhaps above"), (1480.0, "likely above"), (1400.0, "above")],
)
def test_an_overload_is_said_as_sure_as_it_is(tmp_path, gross, verdict):
    html = block(tmp_path, weighed(50.0 / REACH, vehicle=replace(VEHICLE, gross=gross)))
    assert re.search(rf"of {gross:.0f} kg, {verdict}( it)?:", html)
    assert ('class="bar over"' in html) == (gross < 1500.0)
    assert ('class="alert bad"' in html) == (gross < 1500.0)
    # 1542 kg is not exceeded with 95 % probability.
    assert ("58 kg, 95 %" in html) == (gross == 1600.0)


def test_what_is_not_in_the_vehicle_file_is_asked_for(tmp_path):
    html = block(tmp_path, weighed(30.0, vehicle=replace(VEHICLE, tare=None)))
    assert "add tare_kg to the vehicle file" in html
    assert "add gross_kg to the vehicle file" in html


def test_the_vehicle_file_says_what_it_leaves_open(tmp_path):
    sheet = replace(VEHICLE, torque=TorqueModel(source="measured"))
    made = Provenance(drives=("a", "b"), masses=(1500.0, 1700.0), mass_scale_std=0.01)
    fitted = replace(VEHICLE, provenance=made)
    by_sheet, by_drives = (
        block(tmp_path, weighed(60.0, systematic=20.0, vehicle=car)) for car in (sheet, fitted)
    )
    assert "leaves ± 2.0 %" in by_drives
    assert "leaves ± 2.0 %" not in by_sheet
    assert "leaves ± " in by_sheet


def test_advice_goes_to_what_leaves_most_open(tmp_path):
    whole = f"of the ± {REACH * 60.0:.0f} kg"
    by_drive = block(tmp_path, weighed(60.0, systematic=20.0))
    own = REACH * math.sqrt(60.0**2 - 20.0**2)
    assert f"± {own:.0f} {whole}" in by_drive
    w = weighed(60.0, systematic=55.0)
    assert f"± {REACH * 55.0:.0f} {whole}" in block(tmp_path, w)
    motion = replace(w.result.balance.motion, source="speed")
    blind = replace(w.result, balance=replace(w.result.balance, motion=motion))
    assert "accelerometer" in block(tmp_path, replace(w, result=blind))
    assert "accelerometer" not in block(tmp_path, w)
    assert whole not in block(tmp_path, weighed(10.0, systematic=9.0))


def test_a_drive_without_a_mass_says_what_would_help(tmp_path):
    w = make_weighing(status=Status.NOT_EXCITED, why="the road was too flat")
    page = Elements(block(tmp_path, w))
    assert "No mass: the drive says too little" in page.text
    assert "The road was too flat." in page.text
    assert "more starts" in page.text
    assert " ± " not in page.text


def test_a_vehicle_that_was_never_calibrated_is_to_be_calibrated(tmp_path):
    raw = Vehicle(name="raw")
    why = "run weighbridge calibrate --method joint"
    w = replace(
        make_weighing(status=Status.MISSING_SIGNALS, why=why), vehicle=raw, result=None
    )  # fmt: skip
    html = block(tmp_path, w)
    page = Elements(html)
    assert "Calibrate the vehicle on a drive with a mass from a scale" in page.text
    assert "Record the missing signals" not in page.text
    assert '<span class="option">--method</span> joint' in html
    calibrated = replace(w, vehicle=VEHICLE)
    assert "Record the missing signals" in Elements(block(tmp_path, calibrated)).text


def test_the_true_mass_is_explained_by_the_fuel(tmp_path):
    w = weighed(30.0, segments=())
    table = w.result.balance.table
    burnt = np.linspace(0.0, 4.0, table.time.size)
    balance = replace(w.result.balance, table=replace(table, fuel_burnt=burnt))
    info = replace(w.drive.info, mass=1504.0)
    w = replace(w, result=replace(w.result, balance=balance), drive=replace(w.drive, info=info))
    html = block(tmp_path, w)
    assert "True mass 1500 kg (1504 kg at the start less 4.0 kg of fuel burnt on the way)" in html
    assert "+0.0 % off; the interval holds it." in html
    assert "does not hold it" in block(tmp_path, w, truth={w.drive.name: 1700.0})


def test_methods_that_contradict_the_answer_are_named(tmp_path):
    w = weighed(20.0)
    other = replace(w, method="rls", result=replace(w.result, mass=MASS + 80.0))
    fitting = replace(w, method="ekf", result=replace(w.result, mass=MASS + 40.0))
    html = block(tmp_path, w, comparisons=[(w, other, fitting)])
    assert f"Does not fit: rls (1580 ± {REACH * 20.0:.0f} kg)." in html
    assert "Does not fit" not in block(tmp_path, w, comparisons=[(w, fitting)])


def test_all_that_has_plus_or_minus_is_of_95_percent(tmp_path):
    w = weighed(30.0)
    page = Elements(written(tmp_path, [w]))
    # A part of the drive with a standard deviation of 20 kg, a bound of 2 kg.
    assert f"1490 ± {REACH * 20.0:.0f} kg" in page.text
    assert f"± {REACH * 2.0:.0f} kg" in page.text
    assert "1 sd" not in page.text
