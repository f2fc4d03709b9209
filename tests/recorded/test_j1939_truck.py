"""Thirty seconds of a truck, J1939: figures that the log itself announces or that physics gives."""

import re
from pathlib import Path

import cantools
import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.noted import refused

import weighbridge as wb
from weighbridge.balance.law import force_on_mass
from weighbridge.io.frame_text import read_candump
from weighbridge.io.frames import Frames
from weighbridge.io.j1939 import decode_j1939

EXAMPLE = Path(__file__).parents[2] / "examples" / "j1939-truck"


@pytest.fixture(scope="module")
def truck(shared_data):
    path = shared_data / "j1939-truck" / "normal.log"
    if not path.is_file():
        pytest.skip(f"no {path.name} in j1939-truck of the recorded drives")
    return path


@pytest.fixture(scope="module")
def decoded(truck):
    frames = read_candump(truck, None, None).frames
    assert isinstance(frames, Frames)
    return decode_j1939(frames)


def test_reference_torque_from_the_broadcast(truck):
    drive = wb.read_drive(truck)
    assert set(drive.signals["reference_torque"].values) == {1109.0}


def test_speeds_agree_with_the_database_of_the_makers_of_the_log(truck, decoded):
    """The DBC, read by cantools, frame by frame; the parsing is done here once more."""
    database = cantools.database.load_file(truck.parent / "CSS-Electronics-SAE-J1939-DEMO.dbc")
    expected = {"engine_speed": [], "vehicle_speed": []}
    ours = {s.name: s for s in decoded.signals}
    for line in truck.read_text().splitlines():
        found = re.match(r"\s*\(([\d.]+)\)\s+can0\s+([0-9A-F]{8})\s+\[8\]\s+(.*)", line)
        if found is None:
            continue
        body = bytes.fromhex(found.group(3))
        if found.group(2)[2:] == "F00400":
            value = database.get_message_by_name("EEC1").decode(body)["EngineSpeed"]
            expected["engine_speed"].append(value * np.pi / 30)
        elif found.group(2)[2:] == "FEF100":
            value = database.get_message_by_name("CCVS1").decode(body)["WheelBasedVehicleSpeed"]
            expected["vehicle_speed"].append(value / 3.6)
    for name, values in expected.items():
        assert len(values) > 250
        assert_allclose(ours[name].values, values, rtol=1e-12)


def test_gear_ratios_are_those_announced(decoded):
    """Input over output shaft, gear by gear, against the data-sheet ratios."""
    signals = {s.name: s for s in decoded.signals}
    shaft, output = (
        decoded.summary.extras["input_shaft_speed"],
        decoded.summary.extras["output_shaft_speed"],
    )
    gear = signals["gear"].held(shaft.time)
    free = signals["clutch_switch"].held(shaft.time) == 0.0
    for number, ratio in ((2, 1.81), (3, 1.406), (4, 1.0)):
        rows = (gear == number) & free
        assert np.count_nonzero(rows) > 100
        assert_allclose(np.median(shaft.values[rows] / output.values[rows]), ratio, rtol=0.005)
    told = np.unique(decoded.summary.extras["gear_ratio"].values)
    assert_allclose(told, [1.0, 1.406, 1.81], rtol=1e-9)


def test_net_torque_is_less_than_the_indicated_one_and_negative_when_let_off(decoded):
    signals = {s.name: s for s in decoded.signals}
    net = signals["engine_torque_fraction"]
    gross = decoded.summary.extras["actual_torque"]
    lost = gross.values - net.at(gross.time)
    assert 0.09 < lost.min() < lost.max() < 0.15
    assert 0.25 < net.values.max() < 0.40
    assert net.values.min() < 0.0
    assert signals["brake_switch"].values.max() == 0.0


def test_what_was_and_was_not_decoded_is_counted(truck, decoded):
    summary = decoded.summary
    assert summary.decoded["EEC1"] == 1499
    assert summary.decoded["EC1"] == 6
    assert summary.incomplete == 0
    lines = [x for x in truck.read_text().splitlines() if x.strip()]
    transported = summary.decoded["EC1"]
    assert sum(summary.decoded.values()) - transported + sum(summary.ignored.values()) == len(lines)


def test_thirty_seconds_give_no_mass_but_a_reason(truck):
    weighing = wb.weigh(wb.read_drive(truck), wb.Vehicle.load(EXAMPLE / "vehicle.toml"), "rls")
    assert weighing.status == "not_excited"
    assert weighing.reason_id == "motion.few_rows"
    assert np.isnan(weighing.mass)


def test_the_force_grows_with_acceleration_as_with_a_truck_of_some_tonnes(truck):
    """Force against acceleration with a free constant, so that an even grade cannot matter."""
    car = wb.Vehicle.load(EXAMPLE / "vehicle.toml")
    table = wb.weigh(wb.read_drive(truck), car, "rls").result.balance.table
    rows = table.usable
    force = force_on_mass(table, car)[rows]
    design = np.column_stack([table.accel[rows], np.ones(force.size)])
    (mass, rest), *_ = np.linalg.lstsq(design, force, rcond=None)
    assert 4000.0 < mass < 12000.0
    assert abs(rest / mass / 9.81) < 0.05


def test_without_friction_the_vehicle_file_must_state_it(truck, tmp_path):
    lines = truck.read_text().splitlines(keepends=True)
    log = tmp_path / "lacking.log"
    log.write_text("".join(line for line in lines if "18FEDF00" not in line))
    drive = wb.read_drive(log)
    assert drive.has("indicated_torque_fraction")
    example = EXAMPLE / "vehicle.toml"
    with refused("torque.indicated"):
        wb.weigh(drive, wb.Vehicle.load(example))
    stated = tmp_path / "stated.toml"
    source = 'source = "percent"'
    stated.write_text(
        example.read_text().replace(source, f"{source}\ncoefficients = [-130.0, 1.0]")
    )
    assert wb.weigh(drive, wb.Vehicle.load(stated)).status == "not_excited"
