"""Raw MF4 files of a CANedge: OBD-II, IMU and GNSS of one car; a Seat Leon's OBD-II tables."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.noted import refused

import weighbridge as wb
from weighbridge import DriveError
from weighbridge.checks import check_drive
from weighbridge.kernels.rotation import euler_to_matrix
from weighbridge.signals import LONGEST_STEP
from weighbridge.vehicle import detect_gearings

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
CANEDGE, SEAT = EXAMPLES / "canedge", EXAMPLES / "seat-leon"
RPM_PER_KMH = np.pi / 30.0 * 3.6


@pytest.fixture(scope="module")
def folder(shared_data):
    return shared_data / "canedge-obd-imu-gnss"


@pytest.fixture(scope="module")
def drives(folder):
    return {
        f"{p.parent.name[-3:]}/{p.name[7]}": wb.read_drive(
            p, CANEDGE / "mapping.toml", folder / "canmod-gps.dbc"
        )
        for p in sorted(folder.glob("*/*.MF4"))
    }


@pytest.fixture(scope="module")
def long(drives):
    return {n: d for n, d in drives.items() if d.duration > 500.0}


def ratios(drives):
    """Gear ratios found in drives together [rpm per km/h]."""
    clocks, engine, speed = [], [], []
    for k, drive in enumerate(drives):
        rpm = drive.signals["engine_speed"]
        wheels = drive.signals["vehicle_speed"].at(rpm.time)
        known = np.isfinite(wheels)
        clocks.append(rpm.time[known] - rpm.time[0] + 1e5 * k)
        engine.append(rpm.values[known])
        speed.append(wheels[known])
    found = detect_gearings(*map(np.concatenate, (clocks, engine, speed)), speed_step=1 / 3.6)
    return found.gearings / RPM_PER_KMH


def nearest(found, wanted):
    return found[np.argmin(np.abs(np.log(found / wanted)))]


def test_every_file_is_read_whole(drives):
    assert len(drives) == 8
    for drive in drives.values():
        assert drive.has(
            "accel_x", "gyro_z", "latitude", "altitude", "gnss_speed", "vehicle_speed",
            "engine_speed", "engine_torque_fraction", "throttle", "intake_pressure",
        )  # fmt: skip
        assert drive.info.start_time.startswith("2021-07-26T")
        assert abs(drive.signals["accel_x"].period - 0.01) < 2e-4
        assert 1.9 < len(drive.signals["engine_speed"]) / drive.duration < 2.1
        assert 0.95 < np.median(drive.signals["intake_pressure"].values) / 3e4 < 4.0
        # The buses are those the README of the recordings names.
        assert any("CAN 1 7E8, OBD-II answers" in line for line in drive.contents)
        assert any("gnss_imu" in line for line in drive.contents)


def test_gnss_and_wheels_agree(long):
    for drive in long.values():
        ground = drive.signals["gnss_speed"]
        wheels = drive.signals["vehicle_speed"].at(ground.time)
        assert abs(np.nanmedian(wheels - ground.values)) < 0.6


def test_files_of_a_session_are_one_drive(folder, drives):
    whole = wb.read_drive(folder / "00000164", CANEDGE / "mapping.toml", folder / "canmod-gps.dbc")
    parts = [d for n, d in drives.items() if n.startswith("164/")]
    assert whole.duration > 2000.0
    for name in ("accel_x", "engine_speed", "latitude"):
        assert len(whole.signals[name]) == sum(len(d.signals[name]) for d in parts)
    assert "4 more" not in whole.contents[0]
    assert "and 3 more" in whole.contents[0]


def test_six_gear_ratios(long):
    found = ratios(long.values())
    for known in (134.0, 67.0, 44.75, 33.75, 27.25, 22.25):
        assert abs(nearest(found, known) / known - 1.0) < 0.02


def test_mounting_and_mass_per_torque(long):
    car = wb.Vehicle.load(CANEDGE / "vehicle.toml")
    per_torque = []
    for name in ("164/2", "165/2", "165/3"):
        w = wb.weigh(long[name], car, method="rls")
        assert w.status == "converged"
        per_torque.append(w.mass / car.torque.reference_torque)
        # The sensor's x axis stands upright, and its y axis points to the rear.
        rotation = euler_to_matrix(*w.result.balance.motion.mounting)
        assert abs(rotation[2, 0]) > 0.98
        assert rotation[0, 1] < -0.95
    assert 5.4 < np.median(per_torque) < 6.6
    assert np.std(per_torque, ddof=1) / np.mean(per_torque) < 0.06


def test_percent_torque_needs_a_reference(long):
    car = wb.Vehicle.load(CANEDGE / "vehicle.toml")
    none = replace(car, torque=replace(car.torque, reference_torque=None))
    with refused("torque.no_reference"):
        wb.weigh(long["164/2"], none, method="rls")


def test_reading_is_a_hundred_times_real_time(folder):
    path = folder / "00000164" / "00000002-60FE415D.MF4"
    best = np.inf
    for _ in range(2):
        began = time.perf_counter()
        drive = wb.read_drive(path, CANEDGE / "mapping.toml", folder / "canmod-gps.dbc")
        best = min(best, time.perf_counter() - began)
    assert drive.duration / best > 100.0


def test_wrong_dbc_leaves_the_answers_and_says_so(folder, shared_data):
    path = folder / "00000164" / "00000005-60FEB5A8.MF4"
    truck = shared_data / "j1939-truck" / "CSS-Electronics-SAE-J1939-DEMO.dbc"
    drive = wb.read_drive(path, CANEDGE / "mapping.toml", truck)
    assert drive.has("engine_speed")
    assert not drive.has("accel_x")
    assert any(p.id == "bus.absent" for p in drive.problems)


@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_cut_off_mf4_is_salvaged_or_refused_in_one_sentence(folder, tmp_path, share):
    raw = (folder / "00000164" / "00000005-60FEB5A8.MF4").read_bytes()
    cut = tmp_path / "cut.MF4"
    cut.write_bytes(raw[: int(share * len(raw))])
    try:
        drive = wb.read_drive(cut)
    except DriveError as error:
        told = str(error)
    else:
        told = f"{drive.duration:.0f} s"
        assert 0.5 * share * 45 < drive.duration <= 45
    assert "\n" not in told


def test_truck_by_its_dbc_agrees_with_our_table(shared_data):
    folder = shared_data / "j1939-truck"
    mapping = {
        "signals": {
            "vehicle_speed": {"column": "WheelBasedVehicleSpeed"},
            "engine_speed": {"column": "EngineSpeed"},
        }
    }
    own = wb.read_drive(folder / "normal.log")
    by_dbc = wb.read_drive(
        folder / "normal.log", mapping, folder / "CSS-Electronics-SAE-J1939-DEMO.dbc"
    )
    for name in ("vehicle_speed", "engine_speed"):
        # Two senders give the speed, and one of them says that it has none.
        np.testing.assert_allclose(by_dbc.signals[name].values, own.signals[name].values, rtol=1e-9)
        np.testing.assert_array_equal(by_dbc.signals[name].time, own.signals[name].time)


def test_seat_leon_has_five_ratios_and_no_mass(shared_data):
    paths = sorted((shared_data / "seat-leon-obd").glob("*.csv"))
    drives = [wb.read_drive(p, SEAT / "mapping.toml") for p in paths]
    found = ratios(drives)
    for known in (58.25, 37.25, 25.75, 20.25, 16.75):
        assert abs(nearest(found, known) / known - 1.0) < 0.01
    w = wb.weigh(drives[0], wb.Vehicle.load(SEAT / "vehicle.toml"), method="rls")
    assert w.status == "missing_signals"
    assert "engine_torque" in w.reason


@pytest.mark.parametrize("part", [0.9, 0.7])
def test_what_is_whole_of_a_file_that_was_cut_off(folder, drives, tmp_path, part):
    path = folder / "00000164" / "00000001-60FE3F04.MF4"
    raw = path.read_bytes()
    cut = tmp_path / path.name
    cut.write_bytes(raw[: int(part * len(raw))])
    drive = wb.read_drive(cut, CANEDGE / "mapping.toml", folder / "canmod-gps.dbc")
    assert drive.problems[0].id == "file.ends_short"
    assert drive.duration > 80.0
    whole = drives["164/1"].signals
    for name, signal in drive.signals.items():
        n = len(signal)
        np.testing.assert_array_equal(signal.time, whole[name].time[:n])
        np.testing.assert_array_equal(signal.values, whole[name].values[:n])


def test_a_file_without_the_bytes_of_its_frames_is_refused(folder, tmp_path):
    raw = (folder / "00000164" / "00000001-60FE3F04.MF4").read_bytes()
    cut = tmp_path / "cut.mf4"
    cut.write_bytes(raw[: len(raw) // 3])
    with pytest.raises(DriveError, match="of its 65296 records none is whole"):
        wb.read_drive(cut, CANEDGE / "mapping.toml", folder / "canmod-gps.dbc")


@pytest.mark.parametrize("axis", "xyz")
def test_a_mirrored_axis_of_the_gyro_is_found(long, axis):
    name = f"gyro_{axis}"
    for drive in long.values():
        assert not any(p.serious for p in check_drive(drive))
        turned = replace(drive.signals[name], values=-drive.signals[name].values)
        found = [p for p in check_drive(drive.with_signals(turned)) if p.serious]
        assert found, drive.name


def test_a_log_is_weighed_live_as_it_is_as_a_whole(long):
    """The mass on the way, before all records are looked at once more, and that at the end."""
    drive, car = next(iter(long.values())), wb.Vehicle.load(CANEDGE / "vehicle.toml")
    low, high = wb.weigh(drive, car).interval(0.95)
    scale = wb.LiveScale(car, info=drive.info, step=LONGEST_STEP)
    for start in np.arange(drive.start, drive.end, 1.0):
        part = drive.between(start, start + 1.0)
        scale.update_block({n: (s.time, s.values) for n, s in part.signals.items()})
    before = scale.weighing()
    scale.finish()
    for told in (before, scale.weighing()):
        assert all(s.fresh for s in told.signals if s.needed)
        assert sum(s.late + s.unfit for s in told.signals) == 0
        live_low, live_high = told.interval()
        assert live_low < high
        assert low < live_high
