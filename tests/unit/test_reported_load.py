"""What a vehicle says of its own load: read, shown beside the mass, and never used for it."""

import json

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.io import write_drive


def told(drive, mass, trailer, period=10.0):
    """The drive with a mass [kg] and a trailer's bit as functions of the part driven, 0 to 1."""
    # From before the first stamp of the drive to behind its last: the drive stays as long.
    time = np.arange(drive.start - 25.0, drive.end + 25.0, period)
    part = (time - drive.start) / drive.duration
    return drive.with_signals(
        wb.Signal("maker_mass", time, mass(part)),
        wb.Signal("trailer_connected", time, trailer(part)),
    )


def constant(value):
    return lambda part: np.full(part.size, value)


@pytest.fixture(scope="module")
def alone(short_drive, short_car):
    return wb.weigh(short_drive.drive, short_car)


@pytest.fixture(scope="module")
def beside(short_drive, short_car):
    # The maker's estimate begins at a default, and has a value in error.
    drive = told(
        short_drive.drive,
        lambda part: np.select([part < 0.05, (part > 0.5) & (part < 0.55)], [1000.0, 5e5], 1900.0),
        constant(1.0),
    )
    return wb.weigh(drive, short_car)


def test_a_mass_is_the_same_to_the_last_bit_whatever_the_maker_says(alone, beside):
    with_it, without = beside.to_dict(), alone.to_dict()
    own = ("maker_mass_kg", "trailer_connected", "problems", "warnings")
    assert {k: v for k, v in with_it.items() if k not in own} == {
        k: v for k, v in without.items() if k not in own
    }
    assert (beside.mass, beside.std) == (alone.mass, alone.std)
    assert beside.track.equals(alone.track, null_equal=True)
    for one, other in zip(beside.compare(), alone.compare(), strict=True):
        assert (one.method, str(one.mass), str(one.std)) == (
            other.method, str(other.mass), str(other.std)
        )  # fmt: skip


def test_a_calibration_does_not_use_it_either(short_drive, short_car):
    drive = told(short_drive.drive, constant(5000.0), constant(1.0))
    again = wb.calibrate([drive], mass=float(short_drive.truth.mass[0]))
    assert again.driveline == short_car.driveline
    assert again.torque == short_car.torque


def test_the_maker_s_mass_is_the_median_of_the_time_weighed(alone, beside):
    assert beside.maker_mass == beside.row.maker_mass == 1900.0
    assert beside.to_dict()["maker_mass_kg"] == 1900.0
    assert np.isnan(alone.maker_mass)
    assert alone.to_dict()["maker_mass_kg"] is None


def test_a_trailer_that_the_vehicle_reports_is_noted(alone, beside, short_drive, short_car):
    assert beside.trailer_connected is True
    assert alone.trailer_connected is None
    noted = {p.id for p in beside.problems} - {p.id for p in alone.problems}
    assert noted == {"mass.with_trailer"}
    without = wb.weigh(told(short_drive.drive, constant(1900.0), constant(0.0)), short_car)
    assert without.to_dict()["trailer_connected"] is False
    assert {p.id for p in without.problems} == {p.id for p in alone.problems}


def test_it_is_read_from_files_and_shown(short_drive, short_car, weighbridge, tmp_path):
    folder, car, page = tmp_path / "drive", tmp_path / "car.toml", tmp_path / "drive.html"
    drive = told(short_drive.drive, constant(18_340.0), constant(1.0))
    write_drive(drive, folder, "csv")
    head = (folder / "obd.csv").read_text().splitlines()[0]
    assert {"maker_mass_kg", "trailer_connected"} <= set(head.split(","))
    short_car.save(car)
    ran = weighbridge("weigh", folder, "--vehicle", car, "--report", page)
    assert "the vehicle itself reports 18340 kg, which is not used" in ran.out
    assert "reported by the vehicle itself, not used" in page.read_text(encoding="utf-8")
    found = weighbridge("weigh", folder, "--vehicle", car, "--json", "-").out
    assert json.loads(found)["maker_mass_kg"] == 18_340.0


def test_a_recording_is_split_at_the_stop_at_which_a_trailer_was_coupled(short_drive, tmp_path):
    drive = short_drive.drive
    speed = drive.speed
    stops = speed.time[speed.values < 0.5]
    inner = stops[(stops > drive.start + 120.0) & (stops < drive.end - 120.0)]
    assert inner.size
    place = (float(inner[-1]) + 4.0 - drive.start) / drive.duration

    def parts(trailer, name):
        write_drive(told(drive, constant(1900.0), trailer, period=1.0), tmp_path / name, "csv")
        return wb.read_drives(tmp_path / name)

    # The vehicle notices 4 s after it drove off.
    first, second = parts(lambda part: (part > place).astype(float), "coupled")
    assert first.speed.time[-1] <= inner[-1] < second.speed.time[0]
    assert first.signals["trailer_connected"].values.max() == 0.0
    assert second.signals["trailer_connected"].values.mean() > 0.9
    (whole,) = parts(constant(1.0), "towing")
    # A bad contact of 30 s.
    shaken = 30.0 / drive.duration
    (whole,) = parts(lambda part: (np.abs(part - place) > shaken / 2).astype(float), "contact")
    assert whole.duration == pytest.approx(drive.duration + 50.0, abs=2.0)
