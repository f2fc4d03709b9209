"""A torque source, a vehicle class and an estimator of another package, from drive to mass."""

from dataclasses import replace

import pytest

import weighbridge as wb
from weighbridge.errors import ConfigError
from weighbridge.estimators import ESTIMATORS
from weighbridge.simulation import make_scenario, simulate_car
from weighbridge.vehicle.classes import VEHICLE_CLASSES
from weighbridge.vehicle.torque_sources import TORQUE_SOURCES

SOURCE = '''
"""Torque from the fuel rate."""

from weighbridge.vehicle.torque_sources import ROUGH_TERMS, TorqueSource


def reading(drive, time, _):
    speed = drive.signals["engine_speed"].at(time)
    return 43.0e6 * 745.0 * drive.signals["fuel_rate"].at(time) * 0.35 / speed.clip(min=50.0)


fuel = TorqueSource(
    name="fuel",
    signals=("fuel_rate", "engine_speed"),
    reading=reading,
    signed=False,
    floor=lambda _: 1.0,
    title="fuel rate",
    words="fuel rate and a usual efficiency",
    axis="Torque from fuel [N m]",
    terms=ROUGH_TERMS,
    scale_std=0.1,
    transfer_std=0.02,
    cold_std=0.05,
    cold_torque_std=0.04,
)
'''

CLASS = '''
"""Three-wheeled goods carriers."""

from weighbridge.vehicle.classes import VehicleClass

rickshaw = VehicleClass(
    name="rickshaw",
    mass_range=(300.0, 2_500.0),
    typical_mass=1400.0,
    emptied=100.0,
    loaded=2.5,
    heaviest=3.0,
    drag_area=(0.7, 0.2),
    rolling_coefficient=(0.012, 0.004),
    engine_inertia=(0.15, 0.06),
    wheel_inertia=(5.0, 1.0),
    drag_area_range=(0.3, 1.2),
    rolling_coefficient_range=(0.002, 0.03),
    engine_inertia_range=(0.02, 1.0),
    wheel_inertia_range=(2.0, 12.0),
    efficiency=(0.93, 0.03),
    tyre="205/55 R16",
    fastest=60.0,
    strongest=120.0,
)
'''

ESTIMATOR = '''
"""Median of force over specific force."""

import numpy as np

from weighbridge.estimators import Estimator, MassTrack, Status
from weighbridge.estimators.regression import regression


def estimate(balance, vehicle):
    phi, y = regression(balance.merged, vehicle)
    used = balance.merged.usable & np.isfinite(phi) & np.isfinite(y) & (phi > 0.5)
    ratio = y[used] / phi[used]
    mass = float(np.median(ratio))
    many = max(np.count_nonzero(used) / 100.0, 1.0)
    std = float(1.48 * np.median(np.abs(ratio - mass)) / np.sqrt(many))
    reason = balance.merged.reason.copy()
    reason[(reason == 0) & ~used] = 9
    every = np.full(used.size, mass)
    return MassTrack(
        method="median", balance=balance, running_mass=every, running_std=0.0 * every + std,
        residual=np.where(used, y - phi * mass, np.nan), reason=reason, mass=mass, std=std,
        degrees_of_freedom=float("inf"), bound_std=std, converged_at=float("nan"),
        status=Status.CONVERGED, why="", segments=(),
    )


median = Estimator(name="median", estimate=estimate, fits=("rls", "joint"))
'''

POINTS = """
[weighbridge.torque_sources]
fuel = fuel_source:fuel
[weighbridge.vehicle_classes]
rickshaw = rickshaw_class:rickshaw
[weighbridge.estimators]
median = median_estimator:median
"""

FILES = {"fuel_source": SOURCE, "rickshaw_class": CLASS, "median_estimator": ESTIMATOR}


TABLES = (TORQUE_SOURCES, VEHICLE_CLASSES, ESTIMATORS)


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Install a distribution: three modules, one line each."""
    for name, code in FILES.items():
        (tmp_path / f"{name}.py").write_text(code)
    info = tmp_path / "weighbridge_more-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: weighbridge-more\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(POINTS)
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
    return simulate_car(replace(scenario, polling=polling, duration=1500.0))


def test_a_package_adds_source_class_and_estimator(package, tmp_path):
    known, loaded = drive("car-calibration", 0.0, 900), drive("car", 250.0, 901)
    made = wb.calibrate(
        known.drive,
        float(known.truth.mass[0]),
        vehicle=wb.Vehicle(name="cart", kind="rickshaw"),
        settings=wb.CalibrationSettings(source="fuel"),
    )
    made.save(tmp_path / "cart.toml")
    cart = wb.Vehicle.load(tmp_path / "cart.toml")
    assert cart == made
    assert (cart.kind, cart.torque.source) == ("rickshaw", "fuel")

    ways = wb.inspect_drive(loaded.drive, cart).ways
    assert [w.name for w in ways if w.chosen] == ["IMU with speed and fuel rate"]
    truth = float(loaded.truth.mass[-1])
    weighed = wb.weigh(loaded.drive, cart)
    assert weighed.mass == pytest.approx(truth, rel=0.03)
    alone = wb.weigh(loaded.drive, cart, method="median")
    # It knows nothing of wind and of the errors of the grade.
    assert alone.mass == pytest.approx(truth, rel=0.08)
    every = {w.method: w for w in weighed.compare()}
    assert list(every)[-1] == "median"
    assert every["median"].mass == alone.mass
    weighed.report(tmp_path / "report.html", compare=True)
    assert "median" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_without_the_package_the_names_are_unknown():
    with pytest.raises(ConfigError, match="class must be car, van, bus or truck, got 'rickshaw'"):
        wb.Vehicle(kind="rickshaw")
    with pytest.raises(ConfigError, match="source must be one of measured"):
        wb.CalibrationSettings(source="fuel")
    assert "median" not in ESTIMATORS
