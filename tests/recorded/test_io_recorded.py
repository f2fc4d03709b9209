"""Reading and judging recorded drives: no false alarms, and wrong units are found on them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from weighbridge import Drive, Signal, read_drive
from weighbridge.checks import check_drive

BMW_MAPPING = Path(__file__).resolve().parents[2] / "examples" / "bmw-i3" / "mapping.toml"
SEAT_MAPPING = {
    "time": {"column": "Time", "format": "clock"},
    "signals": {
        "vehicle_speed": {"column": "Vehicle Speed Sensor [km/h]"},
        "engine_speed": {"column": "Engine RPM [RPM]"},
        "mass_air_flow": {"column": "Air Flow Rate from Mass Flow Sensor [g/s]"},
        "intake_pressure": {"column": "Intake Manifold Absolute Pressure [kPa]"},
    },
}
RTK_MAPPING = {
    "csv": {"columns": ["a", "b", "c", "d", "e", "f", "t"]},
    "time": {"column": "t", "unit": "ms"},
    "signals": {
        **{f"accel_{x}": {"column": c, "unit": "g"} for x, c in zip("xyz", "abc", strict=True)},
        **{f"gyro_{x}": {"column": c, "unit": "deg/s"} for x, c in zip("xyz", "def", strict=True)},
    },
}


def scaled(drive, **factors):
    return drive.with_signals(
        *(
            replace(drive.signals[name], values=drive.signals[name].values * factor)
            for name, factor in factors.items()
        )
    )


def serious(drive):
    return [p for p in check_drive(drive) if p.serious]


@pytest.fixture(scope="module")
def bmw(shared_data):
    files = sorted((shared_data / "bmw-i3").glob("*.csv"))
    assert len(files) == 24
    return [read_drive(f, BMW_MAPPING) for f in files]


def test_all_bmw_trips_are_read_without_loss(bmw):
    names = {
        "vehicle_speed",
        "engine_torque",
        "longitudinal_accel",
        "altitude",
        "battery_current",
        "battery_voltage",
        "throttle",
        "ambient_temperature",
    }
    for drive in bmw:
        assert set(drive.signals) == names
        assert drive.problems == ()
        assert drive.signals["engine_torque"].period == pytest.approx(0.1)
    assert len(bmw[0].signals["vehicle_speed"]) == 10090
    assert bmw[0].duration == pytest.approx(1008.9)


def test_bmw_trips_raise_no_alarm(bmw):
    assert {d.name: serious(d) for d in bmw if serious(d)} == {}


def test_cut_of_one_bmw_trip_is_noted(bmw):
    drive = next(d for d in bmw if d.name == "TripB02")
    assert any(p.id == "clock.splices" for p in check_drive(drive))


@pytest.mark.parametrize("factor", [0.621371, 1.609344, 1 / 3.6])
def test_wrong_speed_unit_is_found_on_bmw_trips(bmw, factor):
    found = sum(bool(serious(scaled(d, vehicle_speed=factor))) for d in bmw)
    # The accelerometer alone has to tell; a short trip with few changes may not suffice.
    assert found >= 22


def test_seat_logs_by_time_of_day(shared_data):
    for file in sorted((shared_data / "seat-leon-obd").glob("*.csv")):
        drive = read_drive(file, SEAT_MAPPING)
        assert len(drive.signals["vehicle_speed"]) > 10_000
        assert 800.0 < drive.duration < 5000.0
        assert not any(p.serious for p in drive.problems)
        assert serious(drive) == []


@pytest.fixture(scope="module")
def hills(shared_data):
    """The rtk-grade drive: IMU by mapping, GNSS from RTKLIB's text, clocks brought together."""
    folder = shared_data / "rtk-grade"
    imu = read_drive(folder / "imu_1934.csv", RTK_MAPPING)
    rows = np.array(
        [
            [sum(float(x) * s for x, s in zip(c[1].split(":"), (3600, 60, 1), strict=True))]
            + [float(x) for x in c[2:]]
            for c in map(str.split, (folder / "gnss_1934_sf.pos").read_text().splitlines())
            if not c[0].startswith("%")
        ]
    )
    # The two clocks differ by an unknown constant: the yaw rate tells it.
    time = rows[:, 0] - rows[0, 0] + imu.start

    def joined(offset):
        t = time + offset
        return imu.with_signals(
            Signal("latitude", t, np.radians(rows[:, 1])),
            Signal("longitude", t, np.radians(rows[:, 2])),
            Signal("altitude", t, rows[:, 3]),
            Signal("gnss_speed", t, np.hypot(rows[:, 14], rows[:, 15])),
        )

    edges = np.arange(time[0], time[-1], 2.0)
    north, east = (np.diff(np.interp(edges, time, np.radians(rows[:, k]))) for k in (1, 2))
    east *= np.cos(np.radians(rows[0, 1]))
    turn, middle = np.diff(np.unwrap(np.arctan2(east, north))), edges[1:-1]
    fast = 6.37e6 * np.hypot(north, east) > 8.0
    bend = (np.abs(turn) > 0.1) & fast[1:] & fast[:-1]

    def agreement(offset):
        yaw = imu.signals["gyro_z"].at(middle + offset)
        return np.corrcoef(np.nan_to_num(yaw[bend]), turn[bend])[0, 1]

    return joined(min(np.arange(-10.0, 10.0, 0.5), key=agreement))


def test_inertial_drive_raises_no_alarm(hills):
    assert serious(hills) == []


@pytest.mark.parametrize(
    ("factor", "names", "id"),
    [
        (1 / 9.81, ("accel_x", "accel_y", "accel_z"), "imu.accel_in_g"),
        (180 / np.pi, ("gyro_x", "gyro_y", "gyro_z"), "imu.gyro_degrees"),
        (np.pi / 180, ("gyro_x", "gyro_y", "gyro_z"), "imu.gyro_unit"),
        (0.621371, ("gnss_speed",), "speed.unit"),
        (np.pi / 180, ("latitude", "longitude"), "position.radians"),
        (-1.0, ("accel_x", "accel_y", "accel_z"), "imu.gyro_against_course"),
        (-1.0, ("accel_x",), "imu.axes_swapped"),
    ],
)
def test_wrong_units_and_signs_are_found_on_it(hills, factor, names, id):
    assert any(p.id == id for p in serious(scaled(hills, **dict.fromkeys(names, factor))))


def test_swapped_axes_are_found_on_it(hills):
    x, y = hills.signals["accel_x"], hills.signals["accel_y"]
    swapped = hills.with_signals(replace(x, name="accel_y"), replace(y, name="accel_x"))
    assert any(p.id == "imu.axes_swapped" for p in serious(swapped))


def test_phone_in_a_car_raises_no_alarm(shared_data):
    folder = shared_data / "comma2k19"

    def load(name):
        return np.load(folder / f"processed_log_{name}.npy")

    def made(name, time, values):
        keep = np.concatenate(([True], np.diff(time) > 0.0))
        return Signal(name, time[keep], np.ascontiguousarray(values[keep], dtype=float))

    fixes, fix_time = load("GNSS_live_gnss_ublox_value"), load("GNSS_live_gnss_ublox_t")
    signals = [
        *(
            made(f"{kind}_{a}", load(f"{topic}_t"), load(f"{topic}_value")[:, k])
            for kind, topic in (("accel", "IMU_accelerometer"), ("gyro", "IMU_gyro"))
            for k, a in enumerate("xyz")
        ),
        made("vehicle_speed", load("CAN_speed_t"), load("CAN_speed_value")[:, 0]),
        made("latitude", fix_time, np.radians(fixes[:, 0])),
        made("longitude", fix_time, np.radians(fixes[:, 1])),
        made("gnss_speed", fix_time, fixes[:, 2]),
    ]
    assert serious(Drive("comma", {s.name: s for s in signals})) == []
