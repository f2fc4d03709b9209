"""Masses of a calibration that contradict each other, or that nothing backs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from weighbridge import Problem, Vehicle
from weighbridge.calibration import known_mass as module
from weighbridge.calibration import tared, with_findings
from weighbridge.calibration.known_mass import contradicting, unbacked_scale
from weighbridge.messages import phrase
from weighbridge.vehicle import TorqueModel

NAMES, MASSES = ("a", "b", "c"), (1600.0, 1800.0, 2000.0)
STDS = np.full(3, 0.006)


def test_masses_that_go_together_are_not_doubted():
    assert contradicting(NAMES, MASSES, np.array([1.02, 0.99, 0.98]), STDS) == []


def test_a_mass_somewhat_off_is_told():
    (found,) = contradicting(NAMES, MASSES, np.array([0.975, 1.05, 0.975]), STDS)
    assert found.id == "calibration.may_contradict"
    assert found.values["drive"] == "b"
    assert found.values["which"] == phrase("mass_of_several")


def test_what_scatters_is_no_contradiction():
    assert contradicting(NAMES, MASSES, np.array([0.975, 1.05, 0.975]), 5.0 * STDS) == []


def test_a_drive_that_was_not_weighed_is_left_out():
    ratios = np.array([0.99, np.nan, 1.01])
    assert contradicting(NAMES, MASSES, ratios, STDS) == []


def test_burnt_fuel_is_not_on_board_any_more(monkeypatch):
    burnt = (50.0, 100.0, 400.0)
    balances = [
        SimpleNamespace(motion=None, table=SimpleNamespace(fuel_burnt=np.array([0.0, kg])))
        for kg in burnt
    ]
    weighed = iter(np.subtract(MASSES, burnt))
    monkeypatch.setattr(
        module.joint,
        "estimate",
        lambda *_, **__: SimpleNamespace(mass=next(weighed), bound_std=5.0),
    )
    monkeypatch.setattr(module, "uncertain_gains", lambda *_: [])
    vehicle = SimpleNamespace(
        provenance=SimpleNamespace(drives=NAMES, fit=SimpleNamespace(refined=True)), gross=None
    )
    found = []
    monkeypatch.setattr(module, "contradicting", lambda *given: found.append(given) or [])
    assert module.questionable_masses(vehicle, balances, MASSES) == []
    np.testing.assert_allclose(found[0][2], 1.0)


def test_tare_and_gross_are_asked_for_where_only_the_mass_tells_the_scale():
    loads = Vehicle(torque=TorqueModel(source="load", coefficients=(0.0, 250.0)))
    (found,) = unbacked_scale(loads)
    assert found.id == "calibration.unbacked"
    text = found.text
    noted = replace(loads, provenance=replace(loads.provenance, notes=f"made of one drive; {text}"))
    car = tared(noted, 1500.0)
    assert car.tare == 1500.0
    assert phrase("masses_missing") in noted.provenance.notes
    assert phrase("masses_missing") not in car.provenance.notes
    assert phrase("gross_missing") in car.provenance.notes
    assert unbacked_scale(replace(loads, tare=1500.0)) == []
    told = Vehicle(torque=TorqueModel(source="measured", coefficients=(0.0, 0.95)))
    assert unbacked_scale(told) == []


def test_doubts_survive_the_vehicle_file(tmp_path):
    path = tmp_path / "car.toml"
    doubt = Problem.of("calibration.above_gross", drive="a", mass=1600.0, gross=1500.0)
    with_findings(Vehicle(), [doubt]).save(path)
    assert Vehicle.load(path).provenance.problems == (doubt,)
