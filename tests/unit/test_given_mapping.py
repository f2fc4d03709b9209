"""Paths are read as the vehicle file says."""

from dataclasses import replace
from pathlib import Path

import weighbridge as wb
from weighbridge import Vehicle
from weighbridge.io import to_frames
from weighbridge.pipeline.given import mapping_beside, mapping_of


def test_a_path_is_read_with_the_mapping_that_the_vehicle_file_names(
    tmp_path, short_drive, short_car
):
    frames = to_frames(short_drive.drive)
    own = frames["obd"].rename({"vehicle_speed_kmh": "Tacho"})
    folder = tmp_path / "own"
    folder.mkdir()
    own.write_parquet(folder / "obd.parquet")
    for table in ("imu", "gnss"):
        frames[table].write_parquet(folder / f"{table}.parquet")
    columns = ["engine_speed_rpm", "engine_load_pct"]
    lines = ["[tables.obd]", 'files = "obd.parquet"', "[tables.obd.signals]"]
    lines += ['vehicle_speed = { column = "Tacho", unit = "kmh" }']
    for column in columns:
        name, _, unit = column.rpartition("_")
        lines.append(f'{name} = {{ column = "{column}", unit = "{unit}" }}')
    (tmp_path / "map.toml").write_text("\n".join(lines))
    replace(short_car, mapping="map.toml").save(tmp_path / "car.toml")
    by_hand = wb.weigh(
        wb.read_drive(folder, tmp_path / "map.toml"), wb.Vehicle.load(tmp_path / "car.toml")
    )
    weighed = wb.weigh(folder, tmp_path / "car.toml")
    assert weighed.mass == by_hand.mass
    assert wb.inspect_drive(folder, tmp_path / "car.toml").drive.has("vehicle_speed")


def test_a_mapping_is_named_as_the_vehicle_file_sees_it(tmp_path, monkeypatch):
    (tmp_path / "files").mkdir()
    monkeypatch.chdir(tmp_path)
    assert mapping_beside(Path("map.toml"), Path("car.toml")) == "map.toml"
    named = mapping_beside(Path("map.toml"), Path("files/car.toml"))
    assert named == "../map.toml"
    car = Vehicle(mapping=named)
    assert mapping_of(car, Path("files/car.toml")).resolve() == (tmp_path / "map.toml").resolve()
