"""Heights of a raster for a whole fleet."""

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

import weighbridge as wb
from tests.fleet.fleets import real_fleet
from weighbridge.fleet.job import weigh_job
from weighbridge.fleet.run import FleetSettings, prepared
from weighbridge.io import write_drive

pytestmark = pytest.mark.skipif(find_spec("rasterio") is None, reason="rasterio is not installed")


def ground_under(drive, path):
    """Write ground that rises by 60 m to the east, under all positions of a drive."""
    import rasterio
    from rasterio.transform import from_bounds

    lat, lon = (np.degrees(drive.signals[n].values) for n in ("latitude", "longitude"))
    around = (lon.min() - 0.01, lat.min() - 0.01, lon.max() + 0.01, lat.max() + 0.01)
    with rasterio.open(
        path, "w", driver="GTiff", width=50, height=50, count=1, dtype="float32",
        crs="EPSG:4326", transform=from_bounds(*around, 50, 50),
    ) as raster:  # fmt: skip
        raster.write(np.tile(np.linspace(0.0, 60.0, 50, dtype=np.float32), (50, 1)), 1)
    return path


@pytest.fixture
def fleet(brief_drive, short_car, tmp_path):
    """Return two drives without an inertial sensor, one of them elsewhere, and their vehicle."""
    imu = [n for n in brief_drive.signals if n.startswith(("accel", "gyro"))]
    drive = brief_drive.without(*imu)
    drives, cars = real_fleet(tmp_path, drive, short_car, 1)
    north = drive.signals["latitude"]
    moved = drive.with_signals(replace(north, values=north.values + np.radians(3.0)))
    write_drive(moved, drives / "car" / "elsewhere", "parquet")
    return drive, drives, cars


def test_drives_on_the_raster_have_its_heights_and_others_say_so(fleet, scheduler, tmp_path):
    drive, drives, cars = fleet
    ground = ground_under(drive, tmp_path / "ground.tif")

    def weighed(**how):
        given = {"scheduler": scheduler, **how}
        rows = wb.fleet.weigh_drives(f"{drives}/**", cars, tmp_path / "results", **given).collect()
        return {
            "elsewhere" if "elsewhere" in row["source"] else "on it": row
            for row in rows.iter_rows(named=True)
        }

    plain, by_raster = weighed(), weighed(elevation=ground)
    assert "altitude.raster" in by_raster["on it"]["problem_ids"]
    assert "altitude.no_raster" in by_raster["elsewhere"]["problem_ids"]
    assert by_raster["elsewhere"]["mass_kg"] == plain["elsewhere"]["mass_kg"]
    # Other hills are another mass.
    assert by_raster["on it"]["mass_kg"] != pytest.approx(plain["on it"]["mass_kg"], rel=5e-4)


def test_a_raster_that_a_worker_cannot_read_fails_and_is_tried_again(fleet, scheduler, tmp_path):
    drive, drives, cars = fleet
    ground = ground_under(drive, tmp_path / "ground.tif")
    with prepared(
        [f"{drives}/**"], cars, tmp_path / "results", FleetSettings(elevation=ground)
    ) as jobs:
        job = next(iter(jobs))
        ground.rename(tmp_path / "away.tif")
        assert weigh_job(job).outcome == "failed"
        (tmp_path / "away.tif").rename(ground)
        assert weigh_job(job).outcome == "weighed"


def test_a_raster_that_cannot_be_read_is_refused_before_any_drive(fleet, scheduler, tmp_path):
    _, drives, cars = fleet
    (tmp_path / "no.tif").write_text("heights")
    results = tmp_path / "results"
    with pytest.raises(wb.DriveError, match=r"no\.tif"):
        wb.fleet.weigh_drives(
            f"{drives}/**", cars, results, scheduler=scheduler, elevation=tmp_path / "no.tif"
        )
    assert not results.exists()
