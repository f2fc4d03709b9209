"""``weighbridge map``: from a foreign log to a mapping that reads it."""

import os

import polars as pl
import pytest

from weighbridge.io import read_drive


@pytest.fixture
def foreign(loaded, tmp_path):
    """The tables of a simulated drive under names of their own, one per file, units unsaid."""
    folder = tmp_path / "phone"
    folder.mkdir()
    obd = pl.read_parquet(loaded.folder / "obd.parquet")
    obd.select(
        pl.col("time_s").alias("Zeit"),
        pl.col("vehicle_speed_kmh").alias("Geschwindigkeit"),
        pl.col("engine_speed_rpm").alias("Motordrehzahl"),
        pl.col("engine_load_pct").alias("Motorlast"),
        pl.lit("x").alias("Bemerkung"),
    ).write_csv(folder / "auto.csv", separator=";")
    imu = pl.read_parquet(loaded.folder / "imu.parquet")[::4]
    imu.select(
        (1000.0 * pl.col("time_s")).round().cast(pl.Int64).alias("timestamp"),
        *((pl.col(f"accel_{a}_mps2") / 9.80665).alias(f"accelerometerAcceleration{a.upper()}(G)")
          for a in "xyz"),
        *(pl.col(f"gyro_{a}_radps").alias(f"gyroRotation{a.upper()}(rad/s)") for a in "xyz"),
    ).write_csv(folder / "phone.csv")  # fmt: skip
    return folder


def test_from_foreign_tables_to_a_mass_in_three_commands(
    weighbridge, foreign, loaded, car, tmp_path
):
    mapping = tmp_path / "map.toml"
    ran = weighbridge("map", foreign, "-o", mapping)
    assert ran.code == 0
    assert "vehicle_speed" in ran.out
    assert "not taken: Bemerkung" in ran.out
    assert "states no unit" in ran.out
    assert f"next: weighbridge inspect {foreign} --mapping {mapping}" in " ".join(ran.out.split())
    assert weighbridge("inspect", foreign, "--mapping", mapping).code == 0
    ran = weighbridge("weigh", foreign, "--mapping", mapping, "--vehicle", car, "--json", "-")
    assert ran.code == 0
    drive, true = read_drive(foreign, mapping), read_drive(loaded.folder)
    for name in ("vehicle_speed", "engine_load", "gyro_z"):
        assert drive.signals[name].values.max() == pytest.approx(
            true.signals[name].values.max(), rel=0.05
        )


def test_without_a_name_the_mapping_is_all_of_standard_output(weighbridge, foreign, tmp_path):
    ran = weighbridge("map", foreign / "auto.csv")
    (tmp_path / "printed.toml").write_text(ran.out, encoding="utf-8")
    assert "vehicle_speed" in read_drive(foreign / "auto.csv", tmp_path / "printed.toml").signals
    assert "Geschwindigkeit" in ran.err


def test_units_are_asked_for_where_asked_to(weighbridge, foreign, tmp_path, monkeypatch):
    answers = iter(["mph", "furlong", "rpm", "pct"])
    monkeypatch.setattr("typer.prompt", lambda *_, **__: next(answers))
    ran = weighbridge("map", foreign / "auto.csv", "-o", tmp_path / "m.toml", "--ask")
    assert ran.code == 0
    assert 'unit = "mph"' in (tmp_path / "m.toml").read_text()


def test_what_is_no_table_is_one_sentence(weighbridge, tmp_path):
    for name, text in (("log.mf4", "MDF"), ("x.csv", "nothing here"), ("gone.csv", None)):
        path = tmp_path / name
        if text is not None:
            path.write_text(text)
        ran = weighbridge("map", path)
        assert ran.code == 2
        assert ran.err.count("\n") == 1
        assert name in ran.err


def test_an_input_is_never_overwritten(weighbridge, foreign):
    before = (foreign / "auto.csv").read_bytes()
    ran = weighbridge("map", foreign, "-o", foreign / "auto.csv", "--force")
    assert ran.code == 2
    assert (foreign / "auto.csv").read_bytes() == before


def test_a_pipe_named_like_a_table_is_no_table(weighbridge, tmp_path):
    os.mkfifo(tmp_path / "live.csv")
    done = weighbridge("map", tmp_path / "live.csv")
    assert done.code == 2
    assert "no plain file" in done.err
    assert "holds no table" in weighbridge("map", tmp_path).err
