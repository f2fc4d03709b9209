"""A vehicle from papers, tyres and data sheet."""

import re
from pathlib import Path

import pytest
from tests.noted import error, named

from weighbridge import ConfigError, Vehicle
from weighbridge.vehicle import TORQUE_SOURCES, VEHICLE_CLASSES, Known, describe, save_vehicle

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def shown(weighbridge):
    """Return what the command says of a vehicle file, by its heads, and whether it can weigh."""

    def show(path):
        out = weighbridge("vehicle", "show", path).out
        told = re.findall(r"^([a-z]+) {2,}(\S.*(?:\n {6,}\S.*)*)", out, re.MULTILINE)
        texts = {head: " ".join(text.split()) for head, text in told}
        return texts, "next: weighbridge weigh" in out

    return show


def rolling_radius(size):
    return describe(Known(tyre=size)).vehicle.driveline.wheel_radius


@pytest.mark.parametrize(
    ("size", "circumference"),
    # Rolling circumferences of the ETRTO manual, as makers print them [m].
    [
        ("205/55 R16", 1.928),
        ("205/55R16 91V", 1.928),
        ("P205/55 ZR16", 1.928),
        ("315/80 R 22.5", 3.280),
        ("315/80 R22,5 156/150L", 3.280),
        ("195 R14 C", 2.058),
        ("195R14C", 2.058),
        ("11R22.5", 3.203),
        ("11 R 22,5 148/145L", 3.203),
    ],
)
def test_radius_of_a_tyre_size(size, circumference):
    assert 2.0 * 3.14159265 * rolling_radius(size) == pytest.approx(circumference, rel=0.005)


@pytest.mark.parametrize(
    ("size", "diameter"),
    # Overall diameters that makers print [mm]; those in inches state no height.
    [
        ("315/80 R22.5", 1076), ("12R22.5", 1085), ("10R22.5", 1020), ("11R24.5", 1104),
        ("10.00R20", 1053), ("11.00 R 20", 1085), ("12.00R20", 1125), ("31x10.50R15LT", 775),
    ],
)  # fmt: skip
def test_radius_of_a_truck_tyre_is_that_of_its_diameter(size, diameter):
    assert rolling_radius(size) == pytest.approx(3.05 * diameter / 2000.0 / 3.14159265, rel=0.03)


@pytest.mark.parametrize(
    "size",
    [
        "",
        "16",
        "11",
        "R22.5",
        "110R22.5",
        "11R99",
        "99x10R15",
        "205/55",
        "205/555 R16",
        "205/55 R99",
        "R16 205/55",
        "²",
    ],
)
def test_what_is_no_tyre_size_is_told(size):
    with error(ConfigError, size):
        rolling_radius(size)


@pytest.mark.parametrize("kind", VEHICLE_CLASSES)
def test_a_class_alone_makes_a_file_that_can_be_calibrated(shown, kind, tmp_path):
    made = describe(Known(kind=kind))
    path = tmp_path / "v.toml"
    save_vehicle(made.vehicle, path, made.origins)
    assert Vehicle.load(path) == made.vehicle
    assert not shown(path)[1]
    text = path.read_text()
    assert f"of {VEHICLE_CLASSES[kind].tyre}, usual for a {kind}" in text
    assert f"usual for a {kind}, std " in text
    # What nothing is known of is not written as if it were.
    assert "[torque]" not in text
    assert "speed_scale" not in text


def test_a_data_sheet_with_measured_torque_can_weigh(shown, tmp_path):
    made = describe(
        Known(
            kind="van", tare=2150.0, gross=3500.0, tyre="235/65 R16", torque="measured",
            gear_ratios=(4.0, 2.2, 1.4, 1.0), final_drive=3.9, drag_coefficient=0.34,
            frontal_area=3.8, layout="longitudinal",
        )
    )  # fmt: skip
    path = tmp_path / "v.toml"
    save_vehicle(made.vehicle, path, made.origins)
    loaded = Vehicle.load(path)
    assert loaded == made.vehicle
    told, weighs = shown(path)
    assert weighs
    assert loaded.driveline.gearings[0] == pytest.approx(
        4.0 * 3.9 / loaded.driveline.wheel_radius, rel=1e-3
    )
    assert loaded.road_load.drag_area == pytest.approx(0.34 * 3.8)
    assert "# efficiency: not given; taken as 0.930, std 0.020" in path.read_text()
    assert told["gears"].startswith("4 gears")
    assert "never calibrated" in told["worth"]


@pytest.mark.parametrize(
    ("known", "words"),
    [
        ({"tare": 3483.0, "gross": 2000.0}, "2000 3483"),
        ({"tare": 50.0}, "50 car 250 8000"),
        (
            {"kind": "lorry"},
            "lorry motorcycle racer quad car hybrid van bus truck",
        ),
        ({"gear_ratios": (1.0, 2.0)}, "must fall"),
        ({"gear_ratios": (2.0, -1.0)}, "must be positive"),
        ({"final_drive": 3.9}, "needs gear ratios"),
        ({"drag_coefficient": 0.3}, "belong together"),
        ({"reference_torque": 320.0}, "name percent"),
        ({"tyre": "winter"}, "winter"),
        ({"engine": "steam"}, "steam petrol diesel electric"),
        ({"torque": "guess"}, "guess percent"),
        ({"radius": 0.49, "tyre": "315/80 R22.5"}, "give the tyre or the radius"),
        ({"radius": 49.0}, "49 0.15 0.9"),
        ({"driven": "left"}, "left front rear all"),
    ],
)
def test_what_cannot_be_is_refused(known, words):
    with error(ConfigError, words):
        describe(Known(**known))


def test_all_that_cannot_be_is_told_at_once():
    wrong = {
        "tare": 50.0, "engine": "steam", "tyre": "winter", "driven": "left", "layout": "flat",
        "gear_ratios": (1.0, 2.0), "frontal_area": -2.0, "torque": "guess",
    }  # fmt: skip
    with pytest.raises(ConfigError) as refused:
        describe(Known(**wrong))
    told = str(refused.value).split("; ")
    for values in ("50 250 8000", "steam petrol", "winter", "left front", "flat", "1.0 2.0",
                   "-2.0", "guess percent"):  # fmt: skip
        assert sum(named(one, values) for one in told) == 1, (values, told)


def test_a_truck_by_radius_and_axles_weighs_by_data_sheet(shown, tmp_path):
    made = describe(Known(kind="truck", radius=0.49, driven="rear", torque="percent"))
    path = tmp_path / "v.toml"
    save_vehicle(made.vehicle, path, made.origins)
    loaded = Vehicle.load(path)
    assert (loaded.driveline.wheel_radius, loaded.driveline.driven) == (0.49, "rear")
    # No gears are given: engine and vehicle speed show them.
    assert not loaded.driveline.gearings
    told, weighs = shown(path)
    assert weighs
    assert re.search(r"\d+\.\d % of any mass", told["worth"])


@pytest.mark.parametrize("torque", ["load", "air_flow"])
def test_a_reading_that_is_no_torque_waits_for_a_calibration(shown, torque, tmp_path):
    vehicle = describe(Known(torque=torque, gear_ratios=(3.8, 2.1, 1.0), final_drive=4.0)).vehicle
    assert vehicle.torque.source == torque
    vehicle.save(tmp_path / "v.toml")
    told, weighs = shown(tmp_path / "v.toml")
    assert not weighs
    assert TORQUE_SOURCES[torque].title in told["torque"]


def test_the_engine_is_kept_in_the_file_and_told(shown, tmp_path):
    path = tmp_path / "v.toml"
    save_vehicle(describe(Known(engine="diesel")).vehicle, path)
    assert Vehicle.load(path).engine == "diesel"
    assert "diesel" in shown(path)[0]["vehicle"]
    path.write_text('[vehicle]\nengine = "steam"\n')
    with error(ConfigError, "v.toml 2 steam petrol diesel electric"):
        Vehicle.load(path)


def test_a_file_that_was_never_calibrated_says_so_throughout(shown):
    told, _ = shown(EXAMPLES / "j1939-truck" / "vehicle.toml")
    assert "never calibrated" in told["made"]
    assert "12.0 % of any mass" in told["worth"]
