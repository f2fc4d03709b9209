"""The buffer of an inertial sensor: a made-up tree of sysfs, and a pipe as its device file."""

import os
import struct
import time
from threading import Event, Thread

import numpy as np
import pytest
from tests.noted import error

from weighbridge.errors import SourceError
from weighbridge.live import Feed
from weighbridge.live.sources.iio import Element, IioSource, Scan, read_type

AXES = tuple(f"in_{kind}_{axis}" for kind in ("accel", "anglvel") for axis in "xyz")
BEFORE = {
    "buffer/enable": "0", "buffer/length": "2", "buffer/watermark": "1",
    "sampling_frequency": "50", "current_timestamp_clock": "realtime",
    "trigger/current_trigger": "",
}  # fmt: skip


def tree(home, *, timestamp=True, trigger="icm20602-dev1"):
    """A sensor whose third and last channel is a temperature, with types as drivers have them."""
    imu = home / "sys" / "iio:device1"
    for folder in ("scan_elements", "buffer", "trigger"):
        (imu / folder).mkdir(parents=True)
    files = {
        "name": "icm20602", "in_accel_scale": "0.001", "in_anglvel_scale": "0.002",
        "in_accel_z_offset": "10", "sampling_frequency_available": "25 50 100 250 500",
        **{f"{axis}_raw": "7" for axis in AXES}, **BEFORE,
    }  # fmt: skip
    types = dict.fromkeys(AXES[:3], "be:s16/16>>0") | dict.fromkeys(AXES[3:], "le:s12/16>>4")
    types |= {"in_temp": "le:u10/16>>0"}
    types |= {"in_timestamp": "le:s64/64>>0"} if timestamp else {}
    for index, (name, kind) in enumerate(types.items()):
        files |= {
            f"scan_elements/{name}_en": "1" if name == "in_accel_x" else "0",
            f"scan_elements/{name}_index": str(index),
            f"scan_elements/{name}_type": kind,
        }
    for name, text in files.items():
        (imu / name).write_text(text + "\n")
    if trigger:
        (home / "sys" / "trigger0").mkdir()
        (home / "sys" / "trigger0" / "name").write_text("bmp280-dev0\n")
        (home / "sys" / "trigger1").mkdir()
        (home / "sys" / "trigger1" / "name").write_text(trigger + "\n")
    (home / "dev").mkdir()
    os.mkfifo(home / "dev" / "iio:device1")
    return imu


def settings(imu):
    return {
        str(p.relative_to(imu)): p.read_text().strip()
        for p in sorted([*(imu / "scan_elements").glob("*_en"), *(imu / n for n in BEFORE)])
    }


def scan(k, stamp):
    """Six axes of 2 bytes, 4 bytes that align the stamp to 8, and the stamp [ns]."""
    accel = struct.pack(">3h", k, -k, -9810)
    gyro = struct.pack("<3H", *((value & 0xFFF) << 4 | 0xA for value in (k, -k, -2048)))
    return accel + gyro + bytes(4) + struct.pack("<q", stamp)


@pytest.fixture
def imu(tmp_path):
    return tree(tmp_path)


def source(home, rate=200.0):
    return IioSource("icm20602", rate, home / "sys", home / "dev")


class Sensor:
    """Sends scans into the pipe at 200 Hz while the buffer is on; the kernel's part."""

    def __init__(self, home, imu, most=10**9, make=scan):
        self._imu = imu
        self._most = most
        self._make = make
        self.during = {}
        self._stop = Event()
        self._file = os.open(home / "dev" / "iio:device1", os.O_RDWR)
        self._thread = Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join()
        os.close(self._file)

    def _run(self):
        k = 0
        while not self._stop.wait(0.005):
            if (self._imu / "buffer/enable").read_text().strip() == "1" and k < self._most:
                self.during = self.during or settings(self._imu)
                data = self._make(k, 5_000_000_000 + 5_000_000 * k)
                # A scan comes in two pieces, as a pipe may hand it over.
                os.write(self._file, data[:7])
                os.write(self._file, data[7:])
                k += 1


def gather(feed, count, timeout=5.0):
    samples = {}
    limit = time.monotonic() + timeout
    while len(samples.get("accel_x", ([], []))[0]) < count and time.monotonic() < limit:
        for block in feed.read(0.1):
            for name, (times, values) in block.items():
                kept = samples.setdefault(name, ([], []))
                kept[0].extend(times)
                kept[1].extend(values)
    return samples


def test_scans_are_read_and_the_sensor_is_left_as_it_was(tmp_path, imu, caplog):
    before = settings(imu)
    with Sensor(tmp_path, imu) as sensor:
        with Feed([source(tmp_path)]) as feed:
            samples = gather(feed, 100)
        assert settings(imu) == before
    assert samples.keys() == {f"{kind}_{axis}" for kind in ("accel", "gyro") for axis in "xyz"}
    time, x = map(np.array, samples["accel_x"])
    assert len(x) >= 100
    # The counter of the sensor comes back, scaled, without a gap, at 200 Hz by its own stamps.
    np.testing.assert_allclose(x, 0.001 * np.arange(len(x)), atol=1e-12)
    # The first stamp waits for its reader.
    np.testing.assert_allclose(np.diff(time)[1:], 0.005, atol=2e-3)
    assert (time[-1] - time[0]) / (len(x) - 1) == pytest.approx(0.005, rel=0.02)
    np.testing.assert_allclose(samples["accel_y"][1], -x, atol=1e-12)
    np.testing.assert_allclose(samples["accel_z"][1], -9.8, atol=1e-12)
    np.testing.assert_allclose(samples["gyro_x"][1], 2.0 * x, atol=1e-12)
    np.testing.assert_allclose(samples["gyro_y"][1], -2.0 * x, atol=1e-12)
    np.testing.assert_allclose(samples["gyro_z"][1], -4.096, atol=1e-12)
    assert sensor.during == before | {
        **{f"scan_elements/{axis}_en": "1" for axis in AXES},
        "scan_elements/in_timestamp_en": "1", "buffer/enable": "1", "buffer/length": "256",
        "current_timestamp_clock": "monotonic", "sampling_frequency": "250",
        "trigger/current_trigger": "icm20602-dev1",
    }  # fmt: skip
    assert "buffer" not in caplog.text


def test_others_elements_stay_enabled_and_are_passed_over(tmp_path, imu):
    (imu / "scan_elements/in_temp_en").write_text("1\n")
    (imu / "scan_elements/in_temp_index").write_text("3\n")
    for k, axis in enumerate(AXES[3:]):
        (imu / f"scan_elements/{axis}_index").write_text(f"{4 + k}\n")

    def make(k, stamp):
        data = scan(k, stamp)
        return data[:6] + b"\xff\x03" + data[6:12] + bytes(2) + data[16:]

    with Sensor(tmp_path, imu, make=make), Feed([source(tmp_path)]) as feed:
        samples = gather(feed, 20)
    np.testing.assert_allclose(samples["gyro_x"][1], 2.0 * np.array(samples["accel_x"][1]))
    assert (imu / "scan_elements/in_temp_en").read_text() == "1\n"


def test_without_stamps_it_is_the_arrival(tmp_path):
    imu = tree(tmp_path, timestamp=False)
    with (
        Sensor(tmp_path, imu, make=lambda k, _: scan(k, 0)[:12]),
        Feed([source(tmp_path)]) as feed,
    ):
        samples = gather(feed, 100)
    times, x = samples["accel_x"]
    np.testing.assert_allclose(x, 0.001 * np.arange(len(x)), atol=1e-12)
    assert (times[-1] - times[0]) / len(times) == pytest.approx(0.005, rel=0.5)


def test_a_buffer_that_was_left_on_is_used_and_turned_off(tmp_path, imu):
    (imu / "buffer/enable").write_text("1\n")
    with Sensor(tmp_path, imu), Feed([source(tmp_path)]) as feed:
        assert gather(feed, 5)
    assert (imu / "buffer/enable").read_text() == "0\n"


def unplugged(home, imu):
    (home / "dev" / "iio:device1").unlink()


def unbuffered(home, imu):
    (imu / "buffer/enable").unlink()


def unknown_type(home, imu):
    (imu / "scan_elements/in_accel_x_type").write_text("le:s16/24>>0\n")


def no_gyro(home, imu):
    (imu / "scan_elements/in_anglvel_z_en").unlink()


def no_index(home, imu):
    (imu / "scan_elements/in_temp_en").write_text("1\n")
    (imu / "scan_elements/in_temp_index").write_text("none\n")


def no_trigger(home, imu):
    """All is as it should be, but nothing comes."""


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (unplugged, "iio:device1: No such file"),
        (unbuffered, "enable: No such file"),
        (unknown_type, "'le:s16/24>>0'"),
        (no_gyro, "in_anglvel_z_en: No such file"),
        (no_index, "none"),
        (no_trigger, " 0.3 s"),
    ],
)
def test_without_a_buffer_values_are_read_one_by_one(
    tmp_path, imu, caplog, monkeypatch, spoil, why
):
    monkeypatch.setattr(f"{IioSource.__module__}.SILENT", 0.3)
    spoil(tmp_path, imu)
    before = {p: p.read_text() for p in imu.rglob("*") if p.is_file()}
    reading = source(tmp_path)
    for _ in range(2):
        with Feed([reading]) as feed:
            samples = gather(feed, 5)
        assert samples["accel_x"][1][:5] == pytest.approx([0.007] * 5)
        assert {p: p.read_text() for p in imu.rglob("*") if p.is_file()} == before
    # Once, although it was begun twice.
    (told,) = [r.getMessage() for r in caplog.records if r.name == IioSource.__module__]
    assert why in told


def test_a_sensor_that_falls_silent_or_goes_is_lost(tmp_path, imu, monkeypatch):
    monkeypatch.setattr(f"{IioSource.__module__}.SILENT", 0.3)
    before = settings(imu)
    with (
        Sensor(tmp_path, imu, most=20),
        error(SourceError, "iio:icm20602 0.3"),
    ):
        source(tmp_path).run(lambda _: None, Event())
    assert settings(imu) == before
    sensor = Sensor(tmp_path, imu)
    gone = Thread(target=lambda: (time.sleep(0.5), sensor.__exit__()))
    sensor.__enter__()
    gone.start()
    with pytest.raises(SourceError, match="gone"):
        source(tmp_path).run(lambda _: None, Event())
    gone.join()
    assert settings(imu) == before


@pytest.mark.parametrize(
    ("kind", "stored", "value"),
    [
        ("le:s12/16>>4", b"\xf0\xff", -1),
        ("le:s12/16>>4", b"\x0f\x80", -2048),
        ("le:s12/16>>4", b"\xf3\x7f", 2047),
        ("be:s12/16>>4", b"\x80\x0f", -2048),
        ("le:s12/16>>0", b"\xff\xf7", 2047),
        ("le:u12/16>>4", b"\xf3\xff", 4095),
        ("be:s16/16>>0", b"\xff\xfe", -2),
        ("le:s20/32>>12", b"\xff\x1f\x00\x80", -524287),
        ("be:u24/32>>8", b"\x01\x02\x03\xff", 0x010203),
        ("le:s8/8>>0", b"\x80", -128),
        ("le:u1/8>>7", b"\x80", 1),
        ("le:s64/64>>0", struct.pack("<q", -(2**63)), -(2**63)),
        ("le:s64/64>>0", struct.pack("<q", 1_790_000_000_123_456_789), 1_790_000_000_123_456_789),
    ],
)
def test_types(kind, stored, value):
    one = Scan([Element(name="in_accel_x", index=0, type=read_type(kind))])
    assert one.size == len(stored)
    assert one.decode(stored * 2)["in_accel_x"].tolist() == [value, value]


@pytest.mark.parametrize(
    "text",
    ["", "s16/16>>0", "le:s16/16", "le:s17/16>>0", "le:s16/16>>1", "le:s0/16>>0", "le:f3/8>>0"],
)
def test_types_that_cannot_be(text):
    with pytest.raises(ValueError, match="type"):
        read_type(text)


def test_elements_are_aligned_to_their_size():
    layout = Scan(
        Element(name=name, index=index, type=read_type(kind))
        for name, index, kind in (
            ("in_timestamp", 9, "le:s64/64>>0"),
            ("in_accel_x", 2, "le:s16/16>>0"),
            ("in_temp", 0, "le:u8/8>>0"),
            ("in_rot_quaternion", 4, "le:s16/16X4>>0"),
        )
    )
    assert layout.names == ("in_temp", "in_accel_x", "in_rot_quaternion", "in_timestamp")
    assert layout.size == 24
    data = struct.pack("<Bxh4x4hq", 200, -5, 1, 2, 3, 4, 77)
    found = layout.decode(data)
    assert {name: values.tolist() for name, values in found.items()} == {
        "in_temp": [200],
        "in_accel_x": [-5],
        "in_timestamp": [77],
    }
    # At the end of a scan there is room, so that the next is aligned as well.
    assert (
        Scan(
            Element(name=n, index=k, type=read_type(t))
            for k, (n, t) in enumerate((("a", "le:s32/32>>0"), ("b", "le:s16/16>>0")))
        ).size
        == 8
    )
