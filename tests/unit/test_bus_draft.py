"""Mappings drafted from MDF channels and from bus traffic by its DBC."""

import tomllib

import numpy as np
import pytest
from tests.noted import error, refused, says

from weighbridge import ConfigError, DriveError, read_drive
from weighbridge.fleet.vehicles import Vehicles
from weighbridge.io import draft_bus, format_of, load_dbcs, mapping_text

DBC = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 256 Motion: 8 A
 SG_ VehSpd : 0|16@1+ (0.01,0) [0|655] "km/h" A
 SG_ SpeedValid : 16|1@1+ (1,0) [0|1] "" A
BO_ 512 Engine: 8 A
 SG_ EngineSpeed : 0|16@1+ (0.25,0) [0|16000] "rpm" A
 SG_ EngineTorque : 16|16@1- (0.1,0) [-3000|3000] "Nm" A
 SG_ Secret : 32|8@1+ (1,0) [0|255] "" A
"""


@pytest.fixture
def logged(tmp_path):
    """Twenty seconds of two messages at 10 Hz as candump text, and their DBC."""
    lines = []
    for k in range(200):
        t = 1_700_000_000.0 + 0.1 * k
        speed, flag = 100 * k, int(k >= 20)
        torque = 10 * (k - 50)
        motion = speed.to_bytes(2, "little") + bytes([flag]) + bytes(5)
        engine = (4000 + 4 * k).to_bytes(2, "little") + torque.to_bytes(2, "little", signed=True)
        lines.append(f"({t:.6f}) can0 100#{motion.hex().upper()}")
        lines.append(f"({t + 0.01:.6f}) can0 200#{(engine + bytes(4)).hex().upper()}")
    log, dbc = tmp_path / "trip.log", tmp_path / "car.dbc"
    log.write_text("\n".join(lines) + "\n")
    dbc.write_text(DBC)
    return log, dbc


def test_signals_of_a_dbc_are_recognised_and_read_back(logged, tmp_path):
    log, dbc = logged
    draft = draft_bus(log, load_dbcs([str(dbc)]))
    taken = {c.quantity: (c.name, c.unit, c.valid) for c in draft.known}
    assert taken == {
        "vehicle_speed": ("Motion.VehSpd", "kmh", "SpeedValid"),
        "engine_speed": ("Engine.EngineSpeed", "rpm", ""),
        "engine_torque": ("Engine.EngineTorque", "nm", ""),
    }
    assert draft.known[0].rate == pytest.approx(10.0, rel=0.01)
    assert draft.duration == pytest.approx(19.9, abs=0.1)
    mapping = tmp_path / "map.toml"
    mapping.write_text(mapping_text([draft]), encoding="utf-8")
    assert tomllib.loads(mapping.read_text())["signals"]["vehicle_speed"]["valid"] == "SpeedValid"
    drive = read_drive(log, mapping, str(dbc))
    speed = drive.signals["vehicle_speed"]
    # The first two seconds are marked invalid.
    assert len(speed) == 180
    np.testing.assert_allclose(speed.values[[0, -1]], [20.0 / 3.6, 199.0 / 3.6])
    torque = drive.signals["engine_torque"].values
    np.testing.assert_allclose(torque[[0, -1]], [-50.0, 149.0])


def test_a_dbc_of_another_vehicle_is_told(logged):
    log, dbc = logged
    dbc.write_text(DBC.replace("256", "257").replace("512", "513"))
    with error(DriveError, "trip.log car.dbc"):
        draft_bus(log, load_dbcs([str(dbc)]))
    dbc.write_text(DBC.replace("VehSpd", "Q1").replace("EngineSpeed", "Q2").replace("Torque", "Q"))
    with error(DriveError, "trip.log"):
        draft_bus(log, load_dbcs([str(dbc)]))


def test_channels_of_an_mdf_are_drafted(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    time = np.arange(0.0, 30.0, 0.1)
    signals = [
        asammdf.Signal(20.0 + time, time, name="v_Fzg", unit="km/h"),
        asammdf.Signal(1000.0 + 10.0 * time, time, name="nMot", unit="1/min"),
        asammdf.Signal(time, time, name="Foo"),
    ]
    path = tmp_path / "trip.mf4"
    with asammdf.MDF() as file:
        file.append(signals)
        file.save(path)
    draft = format_of(path).draft(path)
    assert {c.quantity: c.unit for c in draft.known} == {
        "vehicle_speed": "kmh",
        "engine_speed": "rpm",
    }
    mapping = tmp_path / "map.toml"
    mapping.write_text(mapping_text([draft]), encoding="utf-8")
    speed = read_drive(path, mapping).signals["vehicle_speed"]
    np.testing.assert_allclose(speed.values, (20.0 + time) / 3.6)


def test_channels_of_an_mdf_that_are_not_known_are_reported_and_not_read(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    time = np.arange(0.0, 30.0, 0.1)
    path = tmp_path / "trip.mf4"
    with asammdf.MDF() as file:
        for length in (200, 300):
            speed = (20.0 + time)[:length]
            file.append([asammdf.Signal(speed, time[:length], name="vehicle_speed", unit="km/h")])
        file.append([asammdf.Signal(time, time, name="Foo")])
        file.append([asammdf.Signal(time, time, name="track.grade_rad")])
        file.save(path)
    drive = read_drive(path)
    assert drive.signals.keys() == {"vehicle_speed"}
    assert len(drive.signals["vehicle_speed"]) == 300
    told = {p.id: p.values for p in drive.problems}
    assert told["file.unknown"]["columns"] == "'Foo', 'track.grade_rad'"
    assert told["file.channel_twice"]["count"] == 2
    assert drive.units == {"vehicle_speed": "kmh"}


@pytest.fixture
def named(logged, tmp_path):
    """A mapping in a folder of its own that names the DBC beside the log."""
    log, dbc = logged
    home = tmp_path / "maps"
    home.mkdir()
    text = mapping_text([draft_bus(log, load_dbcs([str(dbc)]))], dbc=["../car.dbc"])
    mapping = home / "map.toml"
    mapping.write_text(text, encoding="utf-8")
    return mapping


def test_a_mapping_names_its_dbc_from_its_own_folder(logged, named):
    log, dbc = logged
    asked = read_drive(log, named, str(dbc))
    found = read_drive(log, named)
    assert set(found.signals) == set(asked.signals) >= {"vehicle_speed", "engine_torque"}
    for name, signal in asked.signals.items():
        np.testing.assert_array_equal(found.signals[name].values, signal.values)


def test_a_dbc_that_is_given_goes_before_that_of_the_mapping(logged, named, tmp_path):
    log, _ = logged
    half = tmp_path / "half.dbc"
    half.write_text(DBC.replace("(0.01,0)", "(0.005,0)"))
    whole = read_drive(log, named).signals["vehicle_speed"].values
    halved = read_drive(log, named, half).signals["vehicle_speed"].values
    np.testing.assert_allclose(halved, 0.5 * whole)


def test_a_dbc_of_the_mapping_is_for_one_bus_where_it_says_so(logged, named):
    log, _ = logged
    text = named.read_text()
    named.write_text(text.replace("../car.dbc", "0:../car.dbc"))
    assert read_drive(log, named).has("vehicle_speed")
    named.write_text(text.replace("../car.dbc", "5:../car.dbc"))
    with refused("bus.nothing_mapped") as told:
        read_drive(log, named)
    assert says(str(told.value), "on_other_bus", bus=5, remedy="0:car.dbc")


def test_a_dbc_of_the_mapping_that_is_not_there_is_told_with_its_line(logged, named):
    log, dbc = logged
    dbc.unlink()
    with pytest.raises(ConfigError, match=r"map\.toml, line 2: dbc names .*car\.dbc, which is no"):
        read_drive(log, named)


def test_a_fleet_weighs_anew_where_the_dbc_of_a_mapping_changed(logged, named, tmp_path):
    _, dbc = logged
    cars = tmp_path / "cars"
    cars.mkdir()
    (cars / "van.toml").write_text('[vehicle]\nname = "van"\nmapping = "../maps/map.toml"\n')
    before = Vehicles(cars).of(("van/trip.log",))
    assert Vehicles(cars).of(("van/trip.log",)).digest == before.digest
    # A worker in another folder finds it.
    assert before.mapping["dbc"] == [dbc.resolve().as_posix()]
    dbc.write_text(DBC.replace("(0.01,0)", "(0.02,0)"))
    assert Vehicles(cars).of(("van/trip.log",)).digest != before.digest


def test_values_that_are_none_are_told_and_left_out(logged, tmp_path):
    log, dbc = logged
    dbc.write_text(DBC.replace("[0|655]", "[0|150]") + 'VAL_ 512 EngineSpeed 4396 "SNA" ;\n')
    mapping = {
        "signals": {
            "vehicle_speed": {"column": "VehSpd"},
            "engine_speed": {"column": "EngineSpeed"},
        }
    }
    drive = read_drive(log, mapping, dbc)
    told = {p.signal: p.values["count"] for p in drive.problems if p.id == "file.sentinels"}
    assert told == {"vehicle_speed": 49, "engine_speed": 1}
    assert drive.signals["vehicle_speed"].values.max() == pytest.approx(150.0 / 3.6)


@pytest.mark.parametrize(
    ("texts", "numbers"),
    [
        (["P", "R", "N", "1st", "2nd", "3rd", "SNA"], [0, -1, 0, 1, 2, 3, None]),
        (["Neutral", "Gang 1", "Gang 2", "Gang 3", "Fehler"], [0, 1, 2, 3, None]),
        (["released", "pressed", "not available"], [0, 1, None]),
        (["released", "pressed", "NoDataExists"], [0, 1, None]),
    ],
)
def test_numbers_behind_texts_of_an_mdf_are_read(tmp_path, texts, numbers):
    asammdf = pytest.importorskip("asammdf")
    raw = np.arange(300) % len(texts)
    table = {f"val_{k}": k for k in range(len(texts))}
    table |= {f"text_{k}": text.encode() for k, text in enumerate(texts)}
    time = np.arange(300) / 10.0
    name = "gear" if len(texts) > 3 else "brake_switch"
    signals = [
        asammdf.Signal(raw.astype("u1"), time, name=name, conversion=table),
        asammdf.Signal(np.round(time), time, name="vehicle_speed", unit="km/h"),
    ]
    with asammdf.MDF() as file:
        file.append(signals)
        file.save(tmp_path / "t.mf4")
    drive = read_drive(tmp_path / "t.mf4")
    known = [numbers[k] for k in raw if numbers[k] is not None]
    assert drive.signals[name].values.tolist() == known
    lost = sum(numbers[k] is None for k in raw)
    assert [p.values["count"] for p in drive.problems if p.id == "file.sentinels"] == [lost]
