"""Heights of an elevation raster in place of the receiver's."""

import json
from importlib.util import find_spec

import numpy as np
import polars as pl
import pytest

import weighbridge as wb

# It takes 30 MB: only the process that runs these tests has it.
pytestmark = pytest.mark.skipif(find_spec("rasterio") is None, reason="rasterio is not installed")

LAT, LON = 50.0, 8.0


def ground(latitude, longitude):
    """Heights that are linear in both, so that bilinear values are exact [m]."""
    return 300.0 + 900.0 * (latitude - LAT) - 700.0 * (longitude - LON)


def written(path, *, crs="EPSG:4326", units=None, scale=1.0, nodata=None, cells=900):
    """Write a raster of 0.2 by 0.2 degrees about the place, or of 20 by 20 km in metres."""
    import rasterio
    from rasterio.transform import from_origin
    from rasterio.warp import transform

    if crs in ("EPSG:4326", None):
        size = 0.2 / cells
        origin = from_origin(LON - 0.1, LAT + 0.1, size, size)
    else:
        (east,), (north,) = transform("EPSG:4326", crs, [LON], [LAT])
        size = 20_000.0 / cells
        origin = from_origin(east - 10_000.0, north + 10_000.0, size, size)
    column, row = np.meshgrid(np.arange(cells) + 0.5, np.arange(cells) + 0.5)
    x, y = origin.c + origin.a * column, origin.f + origin.e * row
    if crs not in ("EPSG:4326", None):
        lon, lat = transform(crs, "EPSG:4326", x.ravel(), y.ravel())
        x, y = np.array(lon).reshape(x.shape), np.array(lat).reshape(y.shape)
    values = (ground(y, x) / scale).astype(np.float32)
    if nodata is not None:
        values[: cells // 2] = nodata
    profile = {"driver": "GTiff", "count": 1, "dtype": "float32", "nodata": nodata}
    with rasterio.open(
        path, "w", width=cells, height=cells, crs=crs, transform=origin, **profile
    ) as raster:
        raster.write(values, 1)
        if units:
            raster.units = (units,)
    return path


def driven(**changes):
    """Positions along a diagonal, with a receiver whose heights wander."""
    time = np.arange(600.0)
    lat, lon = LAT + 1e-4 * (time - 300.0), LON + 5e-5 * time
    height = ground(lat, lon) + 4.0 * np.sin(time / 40.0)
    values = {"latitude": np.radians(lat), "longitude": np.radians(lon), "altitude": height}
    signals = {n: wb.Signal(n, time, v) for n, v in (values | changes).items()}
    return wb.Drive("trip", signals), ground(lat, lon)


@pytest.mark.parametrize(
    ("how", "within"),
    [
        ({}, 1e-3),
        ({"crs": "EPSG:32632"}, 0.02),
        ({"units": "US survey foot", "scale": 1200.0 / 3937.0}, 1e-3),
        ({"units": "ft", "scale": 0.3048}, 1e-3),
    ],
)
def test_heights_are_those_of_the_raster_at_each_fix(tmp_path, how, within):
    drive, true = driven()
    seen = wb.with_elevation(drive, written(tmp_path / "ground.tif", **how))
    assert np.abs(seen.signals["altitude"].values - true).max() < within
    (problem,) = seen.problems
    assert problem.id == "altitude.raster"
    assert problem.values["share"] == 100.0


def test_fixes_without_ground_or_far_above_it_have_no_height(tmp_path):
    drive, true = driven()
    high = drive.signals["altitude"].values.copy()
    high[100:130] += 60.0  # a bridge over a valley
    drive, _ = driven(altitude=high)
    seen = wb.with_elevation(drive, written(tmp_path / "half.tif", nodata=-9999.0))
    time = seen.signals["altitude"].time
    # The northern half holds no data.
    assert time.max() <= 300.0
    assert not np.any((time >= 100.0) & (time < 130.0))
    assert (
        np.abs(seen.signals["altitude"].values - np.interp(time, np.arange(600.0), true)).max()
        < 0.01
    )


def test_what_cannot_be_read_is_named_with_a_remedy(tmp_path):
    drive, _ = driven()
    raster = written(tmp_path / "ground.tif", cells=50)
    far, _ = driven(latitude=np.radians(np.full(600, 10.0)))
    with pytest.raises(wb.DriveError, match=r"ground\.tif.*trip.*latitude 10"):
        wb.with_elevation(far, raster)
    with pytest.raises(wb.DriveError, match="positions"):
        wb.with_elevation(drive.without("latitude"), raster)
    (tmp_path / "no.tif").write_text("heights")
    with pytest.raises(wb.DriveError, match=r"no\.tif"):
        wb.with_elevation(drive, tmp_path / "no.tif")
    written(tmp_path / "nowhere.tif", crs=None, cells=50)
    with pytest.raises(wb.DriveError, match="coordinate system"):
        wb.with_elevation(drive, tmp_path / "nowhere.tif")


def test_weigh_takes_a_raster_and_says_so(tmp_path, changed, car, weighbridge):
    import rasterio
    from rasterio.transform import from_origin

    folder = changed(imu=None)
    fixes = pl.read_parquet(folder / "gnss.parquet")
    low, high = fixes["latitude_deg"].min(), fixes["latitude_deg"].max()
    left, right = fixes["longitude_deg"].min(), fixes["longitude_deg"].max()
    size = max(high - low, right - left) / 50
    rising = np.tile(np.linspace(0.0, 60.0, 60, dtype=np.float32), (60, 1))
    path = tmp_path / "rising.tif"
    with rasterio.open(
        path, "w", driver="GTiff", width=60, height=60, count=1, dtype="float32",
        crs="EPSG:4326", transform=from_origin(left - 4 * size, high + 4 * size, size, size),
    ) as raster:  # fmt: skip
        raster.write(rising, 1)
    words = ["weigh", folder, "--vehicle", car, "--json", "-"]
    by_receiver, by_raster = (
        json.loads(weighbridge(*words, *more).out) for more in ([], ["--elevation", path])
    )
    assert "altitude.raster" in [p["id"] for p in by_raster["problems"]]
    # Other hills are another mass.
    assert abs(by_raster["mass_kg"] / by_receiver["mass_kg"] - 1.0) > 0.002


def test_the_raster_is_read_for_calibrations_too(tmp_path, known, weighbridge):
    raster = written(tmp_path / "elsewhere.tif", cells=50)
    words = ["calibrate", known.folder, "-o", tmp_path / "car.toml", "--elevation", raster]
    ran = weighbridge(*words)
    assert ran.code == 2
    assert "elsewhere.tif" in ran.err
