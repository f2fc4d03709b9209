"""A simulated fleet: whole, the same again, and as its truth says."""

import filecmp
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from tests.noted import error

import weighbridge as wb
from weighbridge import ConfigError, DriveError
from weighbridge.fleet.inputs import recordings
from weighbridge.simulation import FleetSettings, plan_fleet
from weighbridge.simulation.fleet import FAULTS, with_fault, with_torque_scale
from weighbridge.simulation.fleet_files import _write_day, write_fleet

SMALL = FleetSettings(vehicles=2, days=1, drives=2, minutes=2.0, seed=169110)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Folder of four drives of two vehicles."""
    folder = tmp_path_factory.mktemp("fleet") / "fleet"
    assert write_fleet(folder, SMALL, workers=1) == 4
    return folder


def files(folder):
    return sorted(str(f.relative_to(folder)) for f in folder.rglob("*") if f.is_file())


@pytest.mark.slow
def test_two_processes_write_the_same_bytes(small, tmp_path):
    write_fleet(tmp_path / "again", SMALL, workers=2)
    assert files(tmp_path / "again") == files(small)
    _, other, failed = filecmp.cmpfiles(small, tmp_path / "again", files(small), shallow=False)
    assert (other, failed) == ([], [])


def test_drives_have_the_mass_of_the_truth_and_do_not_tell_it(small):
    truth = pl.read_csv(small / "truth.csv")
    assert truth["vehicle"].unique().sort().to_list() == ["truck001", "van002"]
    for row in truth.iter_rows(named=True):
        drive = wb.read_drive(small / row["files"])
        assert drive.info.mass is None
        assert drive.info.start_time == row["start"]
        assert 0.95 * row["tare_kg"] < row["mass_kg"]
    car = wb.Vehicle.load(small / "vehicles" / "truck001.toml")
    assert truth.filter(vehicle="truck001")["gross_kg"][0] == car.gross


def test_its_table_of_drives_is_one_that_fleet_reads(small):
    found = list(recordings([str(small / "drives.csv")]))
    assert [(r.vehicle, r.kind) for r in found[::2]] == [("truck001", "truck"), ("van002", "van")]
    assert all(wb.read_drive(r.paths[0]).duration > 110.0 for r in found)


def test_each_drive_begins_where_the_one_before_ended(small):
    first, second = (
        wb.read_drive(f).signals["latitude"].values for f in sorted(small.glob("drives/van002/*"))
    )
    # Some 10 m: both positions have the receiver's error.
    assert abs(first[-1] - second[0]) < 4e-6


def test_tickets_are_of_drives_and_rounded_to_the_scale(tmp_path):
    vehicles, (day, *_) = plan_fleet(replace(SMALL, drives=1))
    truth, tickets = _write_day(tmp_path, replace(day, tickets=(True,)))
    assert tickets[0]["mass_kg"] == pytest.approx(truth[0]["mass_kg"], abs=10.0)
    assert tickets[0]["mass_kg"] % 20.0 == 0.0
    assert len(vehicles) == 2


def test_a_stop_for_loading_is_two_legs_of_the_truth(tmp_path):
    _, (day, *_) = plan_fleet(replace(SMALL, drives=1, minutes=4.0))
    first, second = _write_day(tmp_path, replace(day, stops=(3000,), payloads=(0,)))[0]
    assert second["mass_kg"] - first["mass_kg"] == pytest.approx(3000.0, abs=1.0)
    assert first["end_s"] < second["start_s"] < second["end_s"]


def test_a_plan_of_more_vehicles_and_days_keeps_those_before():
    cars, days = plan_fleet(SMALL)
    more, longer = plan_fleet(replace(SMALL, vehicles=12, days=3))
    assert more[:2] == cars
    assert longer[0] == days[0]
    assert longer[3] == days[1]
    assert [v.id for v in more if not v.has_file] == ["car010"]


def test_a_large_plan_has_overloads_trailers_and_faults():
    _, days = plan_fleet(FleetSettings(vehicles=60, days=5, seed=169111))
    legs = [
        (d.vehicle, *x) for d in days for x in zip(d.payloads, d.trailers, d.faults, strict=True)
    ]
    room = [v.gross - v.car.mass for v, *_ in legs]
    over = sum(load > r for (_, load, _, _), r in zip(legs, room, strict=True)) / len(legs)
    assert 0.06 < over < 0.10
    assert {fault for *_, fault in legs} == {"", *FAULTS}
    assert {v.kind for v, _, trailer, _ in legs if trailer} == {"truck"}


def test_faults_are_in_the_drive(small):
    drive = wb.read_drive(small / "drives/truck001" / sorted(
        f.name for f in (small / "drives/truck001").iterdir())[0])  # fmt: skip
    assert "accel_x" not in with_fault(drive, "no inertial sensor").signals
    assert with_fault(drive, "cut short").duration < 61.0
    speed = with_fault(drive, "speed in mph").speed.values.max()
    assert speed == pytest.approx(drive.speed.values.max() / 1.609344)
    torque = with_fault(drive, "frozen torque").signals["engine_torque_fraction"].values
    assert len(set(torque[torque.size // 2 :])) == 1


def test_every_third_vehicle_reads_more_torque_from_day_to_day(small):
    plain = plan_fleet(replace(SMALL, vehicles=5, days=3))[1]
    days = plan_fleet(replace(SMALL, vehicles=5, days=3, drift=0.1))[1]
    scales = {
        d.vehicle.id: [e.torque_scale for e in days if e.vehicle.id == d.vehicle.id] for d in days
    }
    assert scales["van002"] == scales["car005"] == pytest.approx([1.0, 1.05, 1.1])
    assert scales["truck001"] == scales["truck003"] == scales["bus004"] == [1.0] * 3
    assert [replace(d, torque_scale=1.0) for d in days] == list(plain)
    drive = wb.read_drive(next((small / "drives/van002").iterdir()))
    read = drive.signals["engine_torque_fraction"].values
    more = with_torque_scale(drive, 1.1).signals["engine_torque_fraction"].values
    step = np.diff(np.unique(np.round(read, 9))).min()
    assert np.abs(more - 1.1 * read).max() <= 0.5 * step * (1 + 1e-6)
    assert np.abs(more / step - np.round(more / step)).max() < 1e-6


def test_a_broken_file_cannot_be_read(tmp_path):
    _, (day, *_) = plan_fleet(replace(SMALL, drives=1))
    ((row, *_), _) = _write_day(tmp_path, replace(day, faults=("broken file",)))
    with pytest.raises(DriveError, match="obd"):
        wb.read_drive(tmp_path / row["files"])


def test_nothing_is_overwritten_and_nothing_half_written(small, tmp_path, monkeypatch):
    before = files(small)
    with error(ConfigError, "fleet"):
        write_fleet(small, SMALL)
    assert files(small) == before

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("weighbridge.simulation.fleet_files._write_day", fail)
    with pytest.raises(ConfigError, match="No space left"):
        write_fleet(tmp_path / "fleet", SMALL, workers=1)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("field", "value", "word"),
    [
        ("vehicles", 0, "vehicles"),
        ("minutes", 1.0, "2 120 1"),
        ("start", "soon", "soon"),
        ("drift", 0.6, "-50 50 60"),
    ],
)
def test_impossible_fleets_are_refused(field, value, word):
    with error(ConfigError, word):
        plan_fleet(replace(SMALL, **{field: value}))
