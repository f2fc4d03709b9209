"""CSV of phone apps: recognised by their first line, read by their own names and units."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import error, has

from weighbridge import DriveError, read_drive


def write(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def texts(drive):
    return " | ".join(p.text for p in drive.problems)


# RaceChrono CSV v3

CHRONO = """This file is created using RaceChrono Pro v10.1.3 ( http://racechrono.com/ ).
Format,3
Session title,"Test"
Created,04/08/2026,13:14
Note,"two
lines"

timestamp,fragment_id,latitude,longitude,speed,speed,speed,rpm,bearing,accuracy,x_acc
unix time,,deg,deg,m/s,m/s,km/h,rpm,deg,m,G
,,100: gps,100: gps,100: gps,calc,200: obd,200: obd,100: gps,100: gps,101: acc
1785849363.0,0,44.8,11.2,10.0,9.9,36,850,90,3.5,0.01
1785849363.1,0,44.9,11.2,10.5,,,,90,3.5,0.02
1785849363.2,0,,,,,39.6,900,,,
"""


def test_racechrono(tmp_path):
    drive = read_drive(write(tmp_path / "session.csv", CHRONO))
    assert_allclose(drive.signals["gnss_speed"].values, [10.0, 10.5])
    assert_allclose(drive.signals["vehicle_speed"].values, [10.0, 11.0])
    assert_allclose(drive.signals["vehicle_speed"].time, [0.0, 0.2], atol=1e-6)
    assert_allclose(drive.signals["engine_speed"].values * 30 / np.pi, [850, 900])
    assert_allclose(np.degrees(drive.signals["latitude"].values), [44.8, 44.9])
    assert_allclose(drive.signals["gnss_course"].values, np.pi / 2)
    assert drive.signals["gnss_accuracy"].values[0] == 3.5
    assert "accel_x" not in drive.signals
    assert "x_acc (acc)" in texts(drive)
    assert drive.info.start_time == "2026-08-04T13:16:03+00:00"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("Format,3", "Format,2", "session.csv RaceChrono v2 v3"),
        ("timestamp,", "Time (s),", "session.csv"),
        (
            CHRONO[CHRONO.index("timestamp") :],
            "timestamp,a\nunix time,\n,\n1,2\n",
            "session.csv timestamp a",
        ),
    ],
)
def test_racechrono_of_another_kind(tmp_path, old, new, said):
    with error(DriveError, said):
        read_drive(write(tmp_path / "session.csv", CHRONO.replace(old, new)))


def test_racechrono_in_a_unit_not_known_is_told(tmp_path):
    drive = read_drive(write(tmp_path / "s.csv", CHRONO.replace("m/s,m/s,km/h", "m/s,m/s,furlong")))
    assert "vehicle_speed" not in drive.signals
    assert "'furlong'" in texts(drive)


def test_a_mapping_reads_an_app_as_a_plain_table(tmp_path):
    mapping = {
        "csv": {"skip_rows": 7, "skip_after_header": 2},
        "time": {"column": "timestamp"},
        "signals": {"longitudinal_accel": {"column": "x_acc", "unit": "g"}},
    }
    drive = read_drive(write(tmp_path / "session.csv", CHRONO), mapping)
    assert_allclose(drive.signals["longitudinal_accel"].values, [0.0980665, 0.196133])


# Torque Pro

TORQUE = """GPS Time, Device Time, Longitude, Latitude,GPS Speed (Meters/second), \
Horizontal Dilution of Precision, Altitude, Bearing, G(x),Engine RPM(rpm),Speed (OBD)(km/h),\
Engine Load(%),Mass Air Flow Rate(g/s)
Sun Oct 05 14:22:01 GMT 2025,05-Oct-2025 14:22:01.100,-118.1,34.2,10,4.0,500,90,0.1,2100,36,50,12.5
Sun Oct 05 14:22:02 GMT 2025,05-Oct-2025 14:22:02.100,-118.1,34.2,11,4.0,501,90,0.1,-,37,-,12.5
Sun Oct 05 14:22:03 GMT 2025,05-Oct-2025 14:22:03.100,-,-,-,-,-,-,0.1,2200,39.6,60,-
"""


def test_torque_pro(tmp_path):
    drive = read_drive(write(tmp_path / "trackLog.csv", TORQUE))
    assert_allclose(drive.signals["vehicle_speed"].values * 3.6, [36, 37, 39.6])
    assert_allclose(drive.signals["vehicle_speed"].time, [0.1, 1.1, 2.1], atol=1e-6)
    assert_allclose(drive.signals["engine_speed"].values * 30 / np.pi, [2100, 2200])
    assert_allclose(drive.signals["engine_load"].values, [0.5, 0.6])
    assert_allclose(drive.signals["mass_air_flow"].values, 0.0125)
    assert_allclose(drive.signals["gnss_speed"].values, [10, 11])
    assert_allclose(np.degrees(drive.signals["longitude"].values), -118.1)
    assert_array_equal(drive.signals["altitude"].values, [500, 501])
    assert drive.info.start_time == "2025-10-05T14:22:01+00:00"
    assert not any(p.serious for p in drive.problems)


def test_torque_pro_in_miles_and_restarted(tmp_path):
    text = TORQUE.replace("Speed (OBD)(km/h)", "Speed (OBD)(mph)")
    rows = text.splitlines(keepends=True)
    drive = read_drive(write(tmp_path / "log.csv", "".join([*rows[:3], rows[0], rows[3]])))
    assert_allclose(drive.signals["vehicle_speed"].values / 0.44704, [36, 37, 39.6])
    assert len(drive.signals["engine_speed"]) == 2


def test_torque_pro_in_another_language_names_the_time(tmp_path):
    text = TORQUE.replace("Oct-2025", "Okt.-2025")
    with pytest.raises(DriveError, match=r"05-Okt\.-2025"):
        read_drive(write(tmp_path / "log.csv", text))


def test_torque_pro_without_known_columns(tmp_path):
    with error(DriveError, "log.csv Torque Pro"):
        read_drive(write(tmp_path / "log.csv", "GPS Time, Device Time,Foo(bar)\n1,2,3\n"))


# Sensor Logger


def sensor_folder(path):
    t = 1698501144401773000
    rows = "".join(f"{t + k * 10**7},{0.01 * k},9.81,0.5,0.1\n" for k in range(5))
    for name in ("TotalAcceleration", "Gyroscope", "Accelerometer", "Gravity"):
        write(path / f"{name}.csv", f"time,seconds_elapsed,z,y,x\n{rows}")
    write(
        path / "Location.csv",
        "time,seconds_elapsed,bearingAccuracy,speedAccuracy,verticalAccuracy,horizontalAccuracy,"
        "speed,bearing,altitude,longitude,latitude\n"
        f"{t},0,0,0,1.7,15.1,-1,-1,214.2,11.0,48.0\n{t + 10**9},1,0,0,1.7,15.1,5,90,214.2,11,48\n",
    )
    write(path / "metadata.csv", "version,device name,platform\n3,Phone,android\n")
    write(path / "Annotation.csv", f"time,seconds_elapsed,text\n{t},0,start\n")
    return path


def test_sensor_logger(tmp_path):
    drive = read_drive(sensor_folder(tmp_path))
    assert_allclose(drive.signals["accel_z"].values, 9.81)
    assert_allclose(drive.signals["accel_x"].values, 0.1)
    assert_allclose(drive.signals["gyro_y"].values, 0.5)
    assert_allclose(np.diff(drive.signals["accel_z"].time), 0.01, atol=1e-6)
    assert_array_equal(drive.signals["gnss_speed"].values, [5.0])
    assert_allclose(drive.signals["gnss_course"].values, [np.pi / 2])
    assert len(drive.signals["latitude"]) == 2
    assert drive.info.start_time == "2023-10-28T13:52:24+00:00"
    assert has(drive.problems, "file.no_gravity", file="Accelerometer.csv")


def test_sensor_logger_without_total_acceleration_has_none(tmp_path):
    (sensor_folder(tmp_path) / "TotalAcceleration.csv").unlink()
    assert "accel_x" not in read_drive(tmp_path).signals


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from([CHRONO.encode(), TORQUE.encode()]),
    st.integers(0, 900),
    st.binary(max_size=20),
    st.integers(0, 100),
)
def test_any_damage_leaves_signals_or_one_sentence(
    tmp_path_factory, assert_salvaged, whole, at, junk, cut
):
    path = tmp_path_factory.mktemp("apps") / "log.csv"
    path.write_bytes(whole[:at] + junk + whole[at + cut :])
    assert_salvaged(path)
