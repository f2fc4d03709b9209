"""Wrong types through every public name: one sentence that says what was expected."""

import inspect

import numpy as np
import pandas as pd
import polars as pl
import pytest
from tests.noted import error

import weighbridge as wb
from weighbridge import CalibrationSettings, ConfigError
from weighbridge.papers.nguyen2024 import suspension_of
from weighbridge.signals import unit
from weighbridge.simulation import TRUCK, RideSensors
from weighbridge.vehicle import Driveline, TorqueModel

WRONG = (3, 2.5, None, object(), [1, 2], {"a": 1}, b"x", {3}, np.arange(3.0), "\0")

RIDE = suspension_of(TRUCK, RideSensors())

RESULTS = {
    "CoastDown", "Inertia", "LiveStatus", "LiveWeighing", "MassBound", "Segment", "Status",
    "Weighing", "WeighingRow",
}  # fmt: skip
"""What the functions return; nobody makes them."""

ERRORS = {"ConfigError", "DriveError", "MissingExtraError", "WeighbridgeError"}

RAW = ("object has no attribute", "unhashable", "not iterable", "not supported between")
"""Words of Python's own errors."""


@pytest.fixture(scope="module")
def calls(short_drive, short_car, tmp_path_factory):
    """Every public callable with arguments that are right; methods as ``Class.method``."""
    folder = tmp_path_factory.mktemp("drive")
    short_car.save(folder / "car.toml")
    drive = short_drive.drive.between(0.0, 300.0)
    speed = drive.signals["vehicle_speed"]
    frame = pl.DataFrame({"time_s": speed.time, "vehicle_speed_kmh": 3.6 * speed.values})
    frame.write_csv(folder / "obd.csv")
    inertias = wb.InertiaFilter(RIDE, 0.01)
    weighing, scale = wb.weigh(drive, short_car), wb.LiveScale(short_car)
    read = {"path": folder / "obd.csv", "mapping": None, "dbc": ()}
    block = {"vehicle_speed": (np.array([1.0]), np.array([2.0]))}
    time = np.arange(3.0)
    return {
        "weigh": (wb.weigh, {"drive": drive, "vehicle": short_car, "method": "rls",
                             "settings": {}, "mapping": None}),
        "compare": (wb.compare, {"weighing": weighing, "methods": ["rls"]}),
        "calibrate": (wb.calibrate, {"drives": drive, "mass": 1.0, "vehicle": None,
                                     "settings": None, "mapping": None}),
        "inspect_drive": (wb.inspect_drive, {"drive": drive, "vehicle": None}),
        "mass_bound": (wb.mass_bound, {"drive": drive, "vehicle": short_car, "power": 9e4,
                                       "power_std": 0.05}),
        "coast_down": (wb.coast_down, {"drive": drive, "there": [(1.0, 20.0), (30.0, 50.0)],
                                       "back": [(60.0, 80.0), (90.0, 110.0)],
                                       "vehicle": short_car}),
        "estimate_inertia": (wb.estimate_inertia, {"drive": drive, "vehicle": short_car,
                                                   "method": "kalman-bucy", "settings": None}),
        "InertiaSettings": (wb.InertiaSettings, of(wb.InertiaSettings())),
        "InertiaFilter": (wb.InertiaFilter, {"ride": RIDE, "period": 0.01, "settings": None}),
        "InertiaFilter.update": (inertias.update, {"time": 1.0, "travel": np.zeros(4),
                                                   "rate": np.zeros(4), "velocity": np.zeros(3)}),
        "InertiaFilter.interval": (inertias.interval, {"level": 0.9}),
        "read_drive": (wb.read_drive, read),
        "read_drives": (wb.read_drives, read),
        "read_frame": (wb.read_frame, {"frame": frame, "mapping": None, "name": "x"}),
        "to_frames": (wb.to_frames, {"drive": drive}),
        "with_elevation": (wb.with_elevation, {"drive": drive, "raster": folder / "none.tif"}),
        "CalibrationSettings": (wb.CalibrationSettings, of(wb.CalibrationSettings())),
        "Signal": (wb.Signal, of(speed)),
        "Signal.at": (speed.at, {"time": time}),
        "Signal.held": (speed.held, {"time": time}),
        "Signal.age": (speed.age, {"time": time}),
        "Drive": (wb.Drive, of(drive)),
        "Drive.between": (drive.between, {"start": 0.0, "end": 1.0}),
        "Drive.get": (drive.get, {"name": "gear"}),
        "Drive.missing": (drive.missing, {"names": ["gear"]}),
        "Drive.has": (drive.has, {"": "gear"}),
        "Drive.without": (drive.without, {"": "gear"}),
        "Drive.with_signals": (drive.with_signals, {"": speed}),
        "Drive.with_problems": (drive.with_problems, {"": wb.Problem("plugin.note", "")}),
        "DriveInfo": (wb.DriveInfo, of(wb.DriveInfo())),
        "Problem": (wb.Problem, of(wb.Problem("plugin.note", ""))),
        "Vehicle": (wb.Vehicle, of(short_car)),
        "Vehicle.load": (wb.Vehicle.load, {"path": folder / "car.toml"}),
        "Vehicle.save": (short_car.save, {"path": folder / "again.toml"}),
        "Weighing.interval": (weighing.interval, {"level": 0.9}),
        "Weighing.report": (weighing.report, {"path": folder / "r.html", "compare": False,
                                              "tiles": None}),
        "Weighing.write_track": (weighing.write_track, {"path": folder / "t.csv"}),
        "LiveScale": (wb.LiveScale, {"vehicle": short_car, "lateness": 1.0, "setup": None,
                                     "info": None, "step": 0.5}),
        "LiveScale.restore": (scale.restore, {"vehicle": short_car,
                                              "checkpoint": scale.checkpoint()}),
        "LiveScale.update": (scale.update, {"time": 1.0, "signal": "gear", "value": 1.0}),
        "LiveScale.update_block": (scale.update_block, {"samples": block}),
        "LiveWeighing.interval": (scale.weighing().interval, {"level": 0.9}),
        "LiveWeighing.above": (scale.weighing().above, {"limit": 0.9}),
    }  # fmt: skip


def of(made):
    """Arguments that make something anew."""
    return {name: getattr(made, name) for name in inspect.signature(type(made)).parameters}


def test_every_public_name_is_tried(calls):
    names = {name.partition(".")[0] for name in calls}
    modules = {name for name in wb.__all__ if inspect.ismodule(getattr(wb, name))}
    assert modules == {"fleet"}
    assert names | RESULTS | ERRORS | modules == set(wb.__all__)
    for name, (_, right) in calls.items():
        home, _, method = name.partition(".")
        tried = getattr(getattr(wb, home), method) if method else getattr(wb, home)
        takes = [p for p in inspect.signature(tried).parameters.values() if p.name != "self"]
        if "" not in right:
            assert {p.name for p in takes} == set(right), name


def test_wrong_types_are_one_sentence(calls):
    for name, (call, right) in calls.items():
        for argument in right:
            said = []
            for wrong in WRONG:
                given = {**right, argument: wrong}
                try:
                    call(*given.values()) if "" in given else call(**given)
                except wb.WeighbridgeError as error:
                    said.append(str(error))
                except Exception as error:
                    raise AssertionError(
                        f"{name}({argument}={wrong!r}): {type(error).__name__}: {error}"
                    ) from error
            # Numbers, a list or None may be right; the others never are.
            assert len(said) >= 4, f"{name}({argument}) takes anything"
            for text in said:
                assert "\n" not in text
                assert not any(raw in text for raw in RAW), f"{name}({argument}): {text}"


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda car: wb.weigh("x", car, mapping=3), "3"),
        (lambda car: wb.weigh("x", car, settings=3), "settings 3"),
        (lambda _: wb.read_drive(pl.DataFrame({"time_s": [0.0]})), "DataFrame read_frame"),
        (lambda _: wb.read_drive(pd.DataFrame({"time_s": [0.0]})), "DataFrame read_frame"),
        (lambda _: wb.read_drive({"imu": pl.DataFrame()}), "dict read_frame"),
        (lambda _: wb.read_drive(3), "path pathlib.Path 3"),
        (lambda _: wb.read_drive(["a", 3]), "path 3"),
        (lambda _: wb.to_frames("x"), "drive read_drive x"),
        (lambda _: wb.compare(None), "weighing weigh None"),
        (lambda _: wb.Vehicle.load(3), "path pathlib.Path 3"),
        (lambda _: wb.Signal("gear", ["a"], [1]), "gear"),
        (lambda _: wb.LiveScale(3), "int"),
        (lambda _: wb.DriveInfo(mass="1580"), "mass 1580"),
        (lambda _: wb.Vehicle(tare="1580"), "tare 1580"),
    ],
)
def test_the_sentence_says_what_was_expected(short_car, tmp_path, monkeypatch, call, words):
    (tmp_path / "x").mkdir()
    monkeypatch.chdir(tmp_path)
    with error(wb.ConfigError, words) as told:
        call(short_car)
    # Code that catches Python's own error goes on to work.
    assert isinstance(told.value, TypeError)


def test_a_mass_per_drive_by_name_is_refused(short_drive):
    with error(TypeError, "mass dict"):
        wb.calibrate(short_drive.drive, mass={"a": 1580.0})


def test_lists_make_a_signal():
    made = wb.Signal("vehicle_speed", [0, 1, 2], [10, 12.5, 13])
    assert made.time.dtype == made.values.dtype == np.float64
    assert made.at([0.5])[0] == 11.25
    with error(wb.ConfigError, "vehicle_speed (3,) (2,)"):
        wb.Signal("vehicle_speed", [0, 1, 2], [10, 12.5])


@pytest.mark.parametrize(
    ("given", "meant"),
    [("trck", "truck"), ("CAR", "car"), ("zeppelin", ""), ("x" * 5000, "")],
)
def test_a_word_that_is_nearly_right_is_named(given, meant):
    with error(wb.ConfigError, "car van truck") as found:
        wb.Vehicle(kind=given)
    assert str(found.value).endswith(f" {meant}?") == bool(meant)
    assert len(str(found.value)) < 170


@pytest.mark.parametrize(
    ("make", "meant"),
    [
        (lambda: wb.Vehicle(kind="trcuk"), "truck"),
        (lambda: Driveline(layout="transvers"), "transverse"),
        (lambda: CalibrationSettings(method="joit"), "joint"),
        (lambda: TorqueModel(source="persent"), "percent"),
        (lambda: unit("kmhh"), "kmh"),
    ],
)
def test_every_choice_names_what_was_meant(make, meant):
    with pytest.raises(ConfigError, match=rf"did you mean {meant}\?"):
        make()
