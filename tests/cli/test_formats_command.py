"""``inspect``, ``map`` and ``convert`` on logs of every kind that other libraries write."""

import numpy as np
import polars as pl
import pytest
from tests.noted import named

from weighbridge import read_drive

TIME = np.arange(0.0, 60.0, 0.1)
SPEED = 60.0 + 20.0 * np.sin(0.1 * TIME)


def mat(path):
    scipy_io = pytest.importorskip("scipy.io")
    pytest.importorskip("pymatreader")
    scipy_io.savemat(
        path, {"Zeit": TIME, "Geschwindigkeit_kmh": SPEED, "Motordrehzahl": 30 * SPEED}
    )


def hdf5(path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file["can/time"] = TIME
        file["can/Vehicle Speed"] = SPEED
        file["can/Vehicle Speed"].attrs["unit"] = "km/h"
        file["can/Engine Speed"] = 30 * SPEED


def tdms(path):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as file:
        channel = nptdms.ChannelObject
        file.write_segment(
            [
                channel("CAN", "Time", TIME),
                channel("CAN", "Vehicle Speed", SPEED, {"unit_string": "km/h"}),
                channel("CAN", "Engine Speed", 30 * SPEED, {"unit_string": "rpm"}),
            ]
        )


def scanner_long(path):
    rows = (
        f'"{t + 0.01 * k:.2f}";"{name}";"{v:.6f}";"{unit}";\n'
        for t, s in zip(TIME, SPEED, strict=True)
        for k, (name, v, unit) in enumerate(
            (("Vehicle speed", s, "km/h"), ("Engine RPM", 30 * s, "rpm"))
        )
    )
    path.write_text('"SECONDS";"PID";"VALUE";"UNITS";\n' + "".join(rows))


def scanner_wide(path):
    names = ("time", "Vehicle speed (km/h)", "Engine RPM (rpm)", "Engine RPM x1000 (rpm)")
    rows = (
        f"10:00:{t:06.3f},{s:.6f},{30 * s:.6f},{0.03 * s:.6f}\n"
        for t, s in zip(TIME, SPEED, strict=True)
    )
    path.write_text(",".join(names) + "\n" + "".join(rows))


def obd_fusion(path):
    names = ("Time (sec)", "Engine RPM (RPM)", "Vehicle Speed (km/h)", "Boost (psi)")
    rows = (f"{t:.2f},{30 * s:.6f},{s:.6f},0\n" for t, s in zip(TIME, SPEED, strict=True))
    path.write_text(", ".join(names) + "\n" + "".join(rows))


WRITERS = {
    "log.mat": mat,
    "log.h5": hdf5,
    "log.tdms": tdms,
    "long.csv": scanner_long,
    "wide.csv": scanner_wide,
    "fusion.csv": obd_fusion,
}


@pytest.mark.parametrize("name", WRITERS)
def test_from_a_log_to_a_drive_in_three_commands(weighbridge, tmp_path, name):
    log, mapping, out = tmp_path / name, tmp_path / "map.toml", tmp_path / "drive"
    WRITERS[name](log)
    ran = weighbridge("map", log, "-o", mapping)
    assert ran.code == 0
    assert "vehicle_speed" in ran.out
    ran = weighbridge("inspect", log, "--mapping", mapping)
    assert ran.code == 0
    assert "engine_speed" in ran.out
    assert weighbridge("convert", log, out, "--mapping", mapping).code == 0
    drive = read_drive(out)
    np.testing.assert_allclose(drive.signals["vehicle_speed"].values * 3.6, SPEED, atol=1e-5)
    revs = drive.signals["engine_speed"].values * 30 / np.pi
    np.testing.assert_allclose(revs, 30 * SPEED, rtol=1e-6)
    assert pl.read_parquet(out / "obd.parquet").height >= TIME.size


def test_a_mapping_that_cannot_be_used_is_one_line(weighbridge, tmp_path):
    (tmp_path / "log.gpx").write_text("<gpx></gpx>")
    mapping = tmp_path / "map.toml"
    mapping.write_text('[signals.vehicle_speed]\ncolumn = "v"\nunit = "kmh"\n')
    ran = weighbridge("inspect", tmp_path / "log.gpx", "--mapping", mapping)
    assert ran.code == 2
    assert named(ran.err, "log.gpx GPX [signals]")
