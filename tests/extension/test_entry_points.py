"""What another package adds to a weighing: torque source, class, estimator, term and check."""

from dataclasses import replace

import numpy as np
import pytest
from tests.recipes import code, entry_points

import weighbridge as wb
from weighbridge import ConfigError
from weighbridge.checks import CHECKS, check_drive
from weighbridge.estimators import ESTIMATORS
from weighbridge.estimators.joint.terms import TERMS
from weighbridge.signals import Signal
from weighbridge.simulation import make_scenario, simulate_car
from weighbridge.vehicle import TORQUE_SOURCES, VEHICLE_CLASSES

FILES = {
    "fuel_source": code("fuel_source.py"),
    "heat_check": code("heat_check.py"),
    "rickshaw_class": code("rickshaw_class.py"),
    "median_estimator": code("median_estimator.py"),
    "mud_term": code("mud_term.py"),
}
TRIED_ELSEWHERE = {"weighbridge.formats", "weighbridge.sources"}
POINTS = {group: line for group, line in entry_points().items() if group not in TRIED_ELSEWHERE}

TABLES = (TORQUE_SOURCES, VEHICLE_CLASSES, ESTIMATORS, TERMS, CHECKS)


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Install a distribution: five modules, one line each."""
    for name, text in FILES.items():
        (tmp_path / f"{name}.py").write_text(text)
    info = tmp_path / "weighbridge_more-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: weighbridge-more\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "".join(f"[{group}]\n{line}\n" for group, line in POINTS.items())
    )
    monkeypatch.syspath_prepend(tmp_path)
    for table in TABLES:
        monkeypatch.setattr(table, "_all", None)


def drive(name, payload, seed):
    """Simulate a drive that tells the fuel rate and no other torque."""
    scenario = make_scenario(name, payload=payload, seed=seed, without=("warm_up",))
    polling = replace(
        scenario.polling,
        fast=("vehicle_speed", "engine_speed", "fuel_rate"),
        slow=("ambient_temperature", "barometric_pressure"),
    )
    return simulate_car(replace(scenario, polling=polling, duration=800.0))


def test_a_package_adds_source_class_and_estimator(package, tmp_path):
    known, loaded = drive("car-calibration", 0.0, 900), drive("car-short", 250.0, 901)
    made = wb.calibrate(
        known.drive,
        float(known.truth.mass[0]),
        vehicle=wb.Vehicle(name="cart", kind="rickshaw"),
        settings=wb.CalibrationSettings(source="fuel"),
    )
    made.save(tmp_path / "cart.toml")
    cart = wb.Vehicle.load(tmp_path / "cart.toml")
    assert cart.driveline.gearings == pytest.approx(made.driveline.gearings, rel=1e-3)
    assert (cart.kind, cart.torque.source) == ("rickshaw", "fuel")

    ways = wb.inspect_drive(loaded.drive, cart).ways
    assert [w.name for w in ways if w.chosen] == ["IMU with speed and fuel rate"]
    truth = float(loaded.truth.mass[-1])
    weighed = wb.weigh(loaded.drive, cart)
    assert weighed.mass == pytest.approx(truth, rel=0.03)
    alone = wb.weigh(loaded.drive, cart, method="median")
    # It knows nothing of wind and of the errors of the grade.
    assert alone.mass == pytest.approx(truth, rel=0.08)
    few = wb.weigh(loaded.drive, cart, method="median", settings={"least": 1.0})
    assert few.result.used.sum() < alone.result.used.sum()
    every = {w.method: w for w in wb.compare(weighed)}
    assert list(every)[-1] == "median"
    assert every["median"].mass == alone.mass
    weighed.report(tmp_path / "report.html", compare=True)
    assert "median" in (tmp_path / "report.html").read_text(encoding="utf-8")


def in_mud(drive, vehicle, drag):
    """Let the motor of one gear pull against so much [N s/m] more."""
    torque = drive.signals["engine_torque"]
    speed = drive.signals["vehicle_speed"].at(torque.time)
    more = drag * np.nan_to_num(speed) / vehicle.driveline.gearings[0]
    return drive.with_signals(Signal("engine_torque", torque.time, torque.values + more))


def test_a_package_adds_a_term(package, tmp_path):
    made = [simulate_car(make_scenario("electric", payload=p, seed=904 + p)) for p in (0, 250)]
    car = wb.calibrate(made[0].drive, float(made[0].truth.mass[0]))
    muddy, truth = in_mud(made[1].drive, car, 30.0), float(made[1].truth.mass[-1])
    blind = wb.weigh(muddy, car)
    seen = wb.weigh(muddy, car, settings={"terms": [*TERMS.own, "mud"]})
    assert blind.reason_id == "vehicle.foreign"
    assert seen.mass == pytest.approx(truth, rel=0.03)
    drag = seen.result.slow_errors.of("mud").value
    assert np.mean(drag) == pytest.approx(30.0, abs=10.0)
    seen.report(tmp_path / "report.html")
    assert "Drag of mud" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_a_package_adds_a_check(package):
    made = drive("car-short", 0.0, 905).drive
    time = np.arange(made.start, made.end, 5.0)
    hot = 363.15 + 40.0 * ((time > time[10]) & (time < time[20]))
    warm = made.with_signals(Signal("coolant_temperature", time, hot))
    (found,) = [p for p in check_drive(warm) if p.id == "engine.hot"]
    assert (found.start, found.end) == pytest.approx((time[11], time[19]))
    assert "engine.hot" not in {p.id for p in check_drive(made)}


def test_without_the_package_the_names_are_unknown():
    with pytest.raises(ConfigError, match=r"class must be .*, van, bus or truck, got 'rickshaw'"):
        wb.Vehicle(kind="rickshaw")
    with pytest.raises(ConfigError, match="source must be measured"):
        wb.CalibrationSettings(source="fuel")
    assert "median" not in ESTIMATORS
    assert "heat" not in CHECKS
