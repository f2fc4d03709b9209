import time
from threading import Event, Thread

import pytest
from tests.noted import error

from weighbridge import ConfigError
from weighbridge.errors import SourceError
from weighbridge.live import Feed, parse_source
from weighbridge.live.sources.iio import IioSource


@pytest.fixture
def devices(tmp_path):
    """Devices as the kernel shows them: a barometer, and an inertial sensor."""
    (tmp_path / "iio:device0").mkdir()
    (tmp_path / "iio:device0" / "name").write_text("bmp280\n")
    imu = tmp_path / "iio:device1"
    imu.mkdir()
    files = {
        "name": "icm20602", "in_accel_scale": "0.000598", "in_accel_x_raw": "100",
        "in_accel_y_raw": "-200", "in_accel_z_raw": "-16400", "in_anglvel_scale": "0.001064",
        "in_anglvel_x_raw": "10", "in_anglvel_y_raw": "0", "in_anglvel_z_raw": "-10",
        "in_accel_z_offset": "-4",
    }  # fmt: skip
    for name, text in files.items():
        (imu / name).write_text(text + "\n")
    return tmp_path


@pytest.mark.parametrize("name", ["icm20602", "iio:device1"])
def test_readings(devices, name):
    with Feed([IioSource(name, 200.0, devices)]) as feed:
        samples = {}
        limit = time.monotonic() + 3.0
        while len(samples.get("accel_x", [])) < 20 and time.monotonic() < limit:
            for block in feed.read(0.1):
                for signal, (_, values) in block.items():
                    samples.setdefault(signal, []).extend(values)
    assert samples.keys() == {f"{kind}_{axis}" for kind in ("accel", "gyro") for axis in "xyz"}
    assert samples["accel_x"][0] == pytest.approx(0.0598)
    assert samples["accel_z"][0] == pytest.approx(-16404 * 0.000598)
    assert samples["gyro_z"][0] == pytest.approx(-0.01064)


def test_values_are_read_anew(devices):
    with Feed([IioSource("icm20602", 200.0, devices)]) as feed:
        feed.read(1.0)
        (devices / "iio:device1" / "in_accel_x_raw").write_text("500\n")
        limit = time.monotonic() + 2.0
        seen = set()
        while 500 * 0.000598 not in seen and time.monotonic() < limit:
            seen |= {float(v) for block in feed.read(0.1) for v in block["accel_x"][1]}
    assert 500 * 0.000598 in seen


def test_sensor_that_is_not_there(devices, tmp_path):
    with pytest.raises(SourceError, match="bmp280, icm20602"):
        IioSource("mpu6050", devices=devices).run(lambda _: None, Event())
    with pytest.raises(SourceError, match="none"):
        IioSource("mpu6050", devices=tmp_path / "nowhere").run(lambda _: None, Event())
    with pytest.raises(SourceError, match="neither"):
        IioSource("bmp280", devices=devices).run(lambda _: None, Event())


def test_sensor_that_fails_is_lost(devices):
    (devices / "iio:device1" / "in_accel_x_raw").write_text("I/O error\n")
    with error(SourceError, "iio:icm20602"):
        IioSource("icm20602", 500.0, devices).run(lambda _: None, Event())


def test_scale_that_is_no_number(devices):
    (devices / "iio:device1" / "in_accel_scale").write_text("?\n")
    with error(SourceError, "iio:device1/in_accel_scale"):
        IioSource("icm20602", devices=devices).run(lambda _: None, Event())


def test_stop_ends_it_within_a_second(devices):
    stop = Event()
    source = IioSource("icm20602", 1.0, devices)
    thread = Thread(target=source.run, args=(lambda _: None, stop), daemon=True)
    thread.start()
    stop.set()
    thread.join(1.0)
    assert not thread.is_alive()


def test_rates():
    assert parse_source("iio:icm20602@200").name == "iio:icm20602@200"
    for text in ("iio:icm20602@0", "iio:icm20602@5000", "iio:icm20602@x"):
        with pytest.raises(ConfigError):
            parse_source(text)
