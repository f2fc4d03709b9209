"""A log format of another package: one file with its reader, one line that names it."""

import sys

import pytest
from numpy.testing import assert_allclose
from tests.noted import error
from tests.recipes import code, entry_points

from weighbridge import DriveError, read_drive
from weighbridge.io import all_formats

READER = code("bang_logs.py")
LINE = entry_points()["weighbridge.formats"].replace("FORMAT", "{name}")


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Install a distribution of one module into a folder of its own on the path."""
    site = tmp_path / "site"
    site.mkdir()
    monkeypatch.syspath_prepend(str(site))

    def put(module, name="FORMAT"):
        (site / "bang_logs.py").write_text(module)
        info = site / "bang_logs-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: bang-logs\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[weighbridge.formats]\n{LINE.format(name=name)}")
        sys.path_importer_cache.clear()

    yield put
    sys.modules.pop("bang_logs", None)


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "drive.bang"
    path.write_text("0.0!10.0\n0.1!11.0\n0.2!12.0\n")
    return path


def test_an_installed_package_adds_a_format(install, log):
    with pytest.raises(DriveError, match=r"'\.bang' cannot be read"):
        read_drive(log)
    install(READER)
    sys.path.insert(0, str(log.parent))
    try:
        assert_allclose(read_drive(log).signals["vehicle_speed"].values, [10.0, 11.0, 12.0])
        assert "Bang" in [f.name for f in all_formats()]
        # Its folder is a drive as well, and a name that it does not have stays unknown.
        assert read_drive(log.parent).has("vehicle_speed")
    finally:
        sys.path.remove(str(log.parent))


def test_a_signal_that_no_drive_can_hold_is_refused(install, log):
    install(READER.replace('"vehicle_speed"', '"motor_iq"'))
    with error(DriveError, "Bang motor_iq"):
        read_drive(log)


@pytest.mark.parametrize(
    ("module", "name", "said"),
    [
        (READER, "read", "is no weighbridge.io.format.Format"),
        ("raise RuntimeError('too old')", "FORMAT", "cannot be loaded (RuntimeError: too old)"),
    ],
)
def test_a_broken_package_is_told_and_the_rest_is_read(
    install, tmp_path, caplog, module, name, said
):
    install(module, name)
    (tmp_path / "obd.csv").write_text("time_s,vehicle_speed_kmh\n0,36\n1,36\n")
    sys.path.insert(0, str(tmp_path))
    try:
        assert read_drive(tmp_path / "obd.csv").has("vehicle_speed")
    finally:
        sys.path.remove(str(tmp_path))
    assert said in caplog.text
