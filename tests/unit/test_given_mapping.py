"""Paths are read as the vehicle file says."""

from dataclasses import replace

import pandas as pd
import pytest
from tests.noted import error

import weighbridge as wb
from weighbridge import to_frames


def test_a_path_is_read_with_the_mapping_that_the_vehicle_file_names(
    tmp_path, brief_drive, short_car
):
    frames = to_frames(brief_drive)
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


OWN = {
    "vehicle_speed_kmh": "VCU_VehSpd",
    "engine_speed_rpm": "ECM_EngSpd",
    "engine_load_pct": "ECM_Load",
    "latitude_deg": "GNSS_Latitude",
    "longitude_deg": "GNSS_Longitude",
    "altitude_m": "GNSS_Altitude",
    **{f"accel_{a}_mps2": f"IMU_Accel{a.upper()}" for a in "xyz"},
    **{f"gyro_{a}_radps": f"IMU_Rate{a.upper()}" for a in "xyz"},
}


def own_frames(drive):
    """Tables of a drive under foreign names, and one flat mapping for all, as `map` writes it."""
    tables = to_frames(drive)
    kept = {k: [c for c in f.columns if c in OWN or c == "time_s"] for k, f in tables.items()}
    frames = {k: f.select(kept[k]).rename(OWN, strict=False) for k, f in tables.items()}
    named = [c for columns in kept.values() for c in columns if c != "time_s"]
    signals = {}
    for column in named:
        name, _, unit = column.rpartition("_")
        signals[name] = {"column": OWN[column], "unit": unit}
    return frames, {"signals": signals}


def test_a_flat_mapping_is_for_all_frames_without_a_word(brief_drive):
    frames, mapping = own_frames(brief_drive)
    assert len(frames) == 3
    drive = wb.read_frame(frames, mapping)
    assert set(drive.signals) == set(mapping["signals"])
    assert not [p for p in drive.problems if p.id == "file.column_missing"]


def test_a_mapping_of_files_is_for_frames_by_their_columns(brief_drive):
    frames, flat = own_frames(brief_drive)
    tables = {}
    for table, frame in frames.items():
        there = {n: s for n, s in flat["signals"].items() if s["column"] in frame.columns}
        tables[f"of_{table}"] = {"files": f"2026-*_{table}.csv", "signals": there}
    drive = wb.read_frame(frames, {"tables": tables})
    assert set(drive.signals) == set(flat["signals"])
    assert not [p for p in drive.problems if p.id == "file.column_missing"]


def test_what_no_frame_has_is_told_once(brief_drive):
    frames, mapping = own_frames(brief_drive)
    mapping["signals"]["gear"] = {"column": "TCU_GearAct"}
    told = [p for p in wb.read_frame(frames, mapping).problems if p.id == "file.column_missing"]
    assert [p.signal for p in told] == ["gear"]


def test_frames_are_read_with_the_mapping_that_the_vehicle_file_names(
    tmp_path, brief_drive, short_car
):
    frames, mapping = own_frames(brief_drive)
    lines = [
        f'[signals.{name}]\ncolumn = "{s["column"]}"\nunit = "{s["unit"]}"'
        for name, s in mapping["signals"].items()
    ]
    (tmp_path / "map.toml").write_text("\n".join(lines))
    short_car.save(tmp_path / "car.toml")
    replace(short_car, mapping="map.toml").save(tmp_path / "named.toml")
    weighed = wb.weigh(frames, tmp_path / "named.toml")
    for given in (mapping, str(tmp_path / "map.toml")):
        assert wb.weigh(frames, tmp_path / "car.toml", mapping=given).mass == weighed.mass
    # Canonical names need none.
    assert wb.weigh(to_frames(brief_drive), tmp_path / "named.toml").mass == pytest.approx(
        weighed.mass, rel=0.02
    )


def test_a_mapping_for_a_drive_that_is_read_is_refused(brief_drive, short_car):
    with error(wb.ConfigError, "car-short read_drive"):
        wb.weigh(brief_drive, short_car, mapping="map.toml")
    with error(wb.ConfigError, "car-short read_drive"):
        wb.calibrate(brief_drive, mass=1500.0, mapping="map.toml")


@pytest.mark.parametrize("line", [0, None])
def test_a_mapping_outside_of_its_section_is_told_where_it_belongs(tmp_path, short_car, line):
    path = tmp_path / "car.toml"
    short_car.save(path)
    lines = path.read_text().splitlines()
    lines.insert(len(lines) if line is None else line, 'mapping = "map.toml"')
    path.write_text("\n".join(lines))
    with pytest.raises(wb.ConfigError, match=r"mapping belongs into \[vehicle\]: move the line"):
        wb.Vehicle.load(path)


def test_the_index_of_asammdf_is_the_time():
    index = pd.Index([0.0, 0.5], name="timestamps")
    frame = pd.DataFrame({"VCU_VehSpd": [36.0, 72.0]}, index=index)
    mapping = {"signals": {"vehicle_speed": {"column": "VCU_VehSpd", "unit": "kmh"}}}
    assert wb.read_frame(frame, mapping).signals["vehicle_speed"].time.tolist() == [0.0, 0.5]
