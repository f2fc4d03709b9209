"""A folder of several loggers: what is advised, what is left unread, what two of them have."""

import numpy as np
import pytest
from tests.noted import error, has, says
from tests.unit.test_alignment import road_speed

from weighbridge import DriveError, read_drive

T = np.arange(0.0, 600.0, 0.5)
SPEED = road_speed(T)
FOREIGN = "Time (s),Speed (km/h),Engine RPM (rpm)"
AXES = "Time (s),ax (m/s^2),ay (m/s^2),az (m/s^2)"


def table(path, head, *columns, time=T):
    rows = np.column_stack([time, *columns])
    path.write_text("\n".join([head, *(",".join(f"{x:.6f}" for x in row) for row in rows)]) + "\n")
    return path


def obd(path, head=FOREIGN):
    return table(path, head, 3.6 * SPEED, 100.0 * SPEED)


def phone(path, time=T):
    zero = np.zeros(time.size)
    return table(path, AXES, zero, zero, zero + 9.81, time=time)


def test_foreign_tables_of_canonical_files_are_mapped_as_a_folder(tmp_path):
    obd(tmp_path / "obd.csv")
    phone(tmp_path / "imu.csv")
    with pytest.raises(DriveError, match=f"weighbridge map {tmp_path} -o map.toml"):
        read_drive(tmp_path)


def test_a_table_with_its_own_names_beside_canonical_ones_is_told(tmp_path):
    obd(tmp_path / "obd.csv", "time_s,vehicle_speed_kmh,engine_speed_rpm")
    phone(tmp_path / "phone.csv")
    (tmp_path / "notes.txt").write_text("tyres pumped up\nleft at eight\n")
    table(tmp_path / "track.csv", "time_s,mass_kg,std_kg,speed_mps,gear", *(4 * [SPEED]))
    (told,) = read_drive(tmp_path).problems
    assert has([told], "file.not_read", file="phone.csv", folder=str(tmp_path))


def test_a_table_that_no_pattern_fits_is_told(tmp_path):
    obd(tmp_path / "dongle.csv")
    phone(tmp_path / "phone.csv")
    mapping = {
        "tables": {
            "obd": {
                "files": "dongle*",
                "time": {"column": "Time (s)", "unit": "s"},
                "signals": {"vehicle_speed": {"column": "Speed (km/h)", "unit": "kmh"}},
            }
        }
    }
    told = read_drive(tmp_path, mapping).problems[0]
    assert has([told], "file.not_read", file="phone.csv")
    assert says(told.text, "no_pattern_fits", mapping="mapping")


def gps(path, lateness=0.0, speed=SPEED, **more):
    names = ["gnss_speed_mps", *more]
    columns = [np.interp(T - lateness, T, speed), *more.values()]
    return table(path, ",".join(["time_s", *names]), *columns)


def test_of_two_receivers_in_one_drive_one_is_taken(tmp_path):
    rich = gps(tmp_path / "rich.csv", 0.3, gnss_course_deg=np.zeros(T.size))
    poor = gps(tmp_path / "poor.csv")
    drive = read_drive([poor, rich])
    assert np.allclose(drive.signals["gnss_speed"].values, np.interp(T - 0.3, T, SPEED))
    (told,) = drive.problems
    assert has([told], "file.repeated", first="rich.csv", second="poor.csv", names="gnss_speed")


@pytest.mark.parametrize("case", ["another drive", "a part of it", "the vehicle's own"])
def test_what_may_be_two_drives_is_refused(tmp_path, case):
    first = gps(tmp_path / "a.csv")
    if case == "another drive":
        second = gps(tmp_path / "b.csv", speed=road_speed(T, 9))
    elif case == "a part of it":
        late = T + 300.0
        second = table(tmp_path / "b.csv", "time_s,gnss_speed_mps", road_speed(late), time=late)
    else:
        names = "time_s,vehicle_speed_kmh,engine_speed_rpm"
        first, second = obd(tmp_path / "a.csv", names), obd(tmp_path / "b.csv", names)
    with error(DriveError, "a.csv b.csv 599.5"):
        read_drive([first, second])


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("trip.xlsx", "save its sheet as CSV"),
        ("trip.csv.gz", "unpack it first"),
        ("trip.KML", "export the track as GPX"),
        ("trip.ld", "export it as CSV from i2"),
        ("car.dbc", "give it by --dbc"),
        ("car.toml", "a vehicle file goes with --vehicle"),
        ("trip.odd", "known are .csv"),
    ],
)
def test_a_file_that_is_not_read_is_answered_with_what_helps(tmp_path, name, remedy):
    (tmp_path / name).write_bytes(b"x" * 100)
    with pytest.raises(DriveError, match=f"cannot be read; .*{remedy}"):
        read_drive(tmp_path / name)
