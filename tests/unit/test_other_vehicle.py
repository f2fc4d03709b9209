"""A mass far from what its vehicle file allows is told: the file may be another vehicle's."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import weighbridge as wb
from weighbridge import Signal
from weighbridge.checks import check_drive
from weighbridge.vehicle import Known, describe


@pytest.fixture(scope="module")
def weighed(brief_drive, short_car):
    """Weigh the drive by its file, changed, without the masses that the calibration knew."""

    @cache
    def weigh(**changes):
        blank = replace(short_car.provenance, masses=())
        return wb.weigh(brief_drive, replace(short_car, provenance=blank, **changes))

    return weigh


def test_far_above_the_permitted_mass_another_vehicle_is_thought_of(weighed):
    mass = weighed().mass
    near = {p.id: p for p in weighed(gross=mass / 1.15).problems}
    assert near["mass.above_permitted"].values["sure"] == "surely"
    assert "mass.far_above_gross" not in near
    far = {p.id: p for p in weighed(gross=mass / 1.5).problems}
    assert far["mass.far_above_gross"].values["sure"] == "surely"
    assert far["mass.far_above_gross"].values["times"] == pytest.approx(1.5)


def test_beyond_what_a_trailer_explains_there_is_no_mass(weighed):
    found = weighed(gross=weighed().mass / 3.0)
    assert found.status is wb.Status.INCONSISTENT
    assert found.reason_id == "mass.above_gross"
    assert f"{found.refusal.values['times']:.1f}" == "3.0"


def test_a_mass_of_no_such_class_is_told(weighed, brief_drive, short_car):
    assert not any(text.id == "mass.beyond_class" for text in weighed().problems)
    told = next(p for p in weighed(kind="truck").problems if p.id == "mass.beyond_class")
    assert (told.values["kind"], told.values["low"], told.values["high"]) == ("truck", 3750, 120000)
    known = wb.weigh(brief_drive, replace(short_car, kind="truck")).problems
    assert not any(p.id == "mass.beyond_class" for p in known)


@pytest.mark.parametrize(("told", "known"), [(2500.0, 1), (401.0, 0)])
def test_another_reference_torque_than_that_of_the_file_is_told(short_drive, told, known):
    time = short_drive.drive.signals["vehicle_speed"].time
    drive = short_drive.drive.with_signals(
        Signal("reference_torque", time, np.full(time.size, told))
    )
    van = describe(Known(kind="van", torque="percent", reference_torque=400.0)).vehicle
    found = [p for p in check_drive(drive, van) if p.signal == "reference_torque"]
    assert len(found) == known
    assert all(p.id == "torque.reference_file" for p in found)
