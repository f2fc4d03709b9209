"""``weighbridge map``: from a foreign log to a mapping that reads it."""

import json
import math
import os
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.docs.logs import dongle_and_phone
from tests.noted import named, says

from weighbridge import read_drive


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


def test_a_dongle_and_a_phone_on_clocks_of_their_own(weighbridge, loaded, car, tmp_path):
    """As in docs/data.md: the app writes times of day, the phone seconds since its start."""
    trip, mapping = tmp_path / "trip", tmp_path / "map.toml"
    tables = {n: pl.read_parquet(loaded.folder / f"{n}.parquet") for n in ("obd", "imu", "gnss")}
    dongle_and_phone(tables, trip)
    assert weighbridge("map", trip, "-o", mapping).code == 0
    ran = weighbridge("weigh", trip, "--mapping", mapping, "--vehicle", car, "--json", "-")
    assert ran.code == 0, ran.err
    low, high = json.loads(ran.out)["interval95_kg"]
    assert low < loaded.mass < high
    told = json.loads(ran.out)["problems"]
    (moved,) = [p["text"] for p in told if p["id"] == "clock.aligned"]
    assert says(moved, "clock.aligned", group="elm327.csv")
    assert "-49989" in moved


def test_without_a_name_the_mapping_is_all_of_standard_output(weighbridge, foreign, tmp_path):
    ran = weighbridge("map", foreign / "auto.csv")
    (tmp_path / "printed.toml").write_text(ran.out, encoding="utf-8")
    assert "vehicle_speed" in read_drive(foreign / "auto.csv", tmp_path / "printed.toml").signals
    assert "Geschwindigkeit" in ran.err


def answers(monkeypatch, told):
    """Answer what is asked by what the question has in it; return the questions."""
    asked = []

    def prompt(question, *, default, err):
        assert err
        asked.append(question)
        assert asked.count(question) < 5, f"the answers to {question!r} are not taken"
        found = next((a for words, a in told.items() if words in question), default)
        return found.pop(0) if isinstance(found, list) else found

    monkeypatch.setattr("typer.prompt", prompt)
    return asked


def test_units_are_asked_for_where_asked_to(weighbridge, foreign, tmp_path, monkeypatch):
    asked = answers(monkeypatch, {"Geschwindigkeit": ["furlong", "mph"], "Motorlast": "none"})
    ran = weighbridge("map", foreign / "auto.csv", "-o", tmp_path / "m.toml", "--ask")
    assert ran.code == 0
    text = (tmp_path / "m.toml").read_text()
    assert 'unit = "mph"' in text
    assert "engine_load" not in text
    assert "'furlong' is none of them" in ran.err
    assert [q for q in asked if q.startswith("unit of Zeit")]


def nameless(folder):
    """Write a log of 20 Hz whose names tell nothing but the time."""
    rows = [f"{k / 20:.2f},{40 + 10 * math.sin(k / 50):.2f},{k % 7}" for k in range(2000)]
    path = folder / "x.csv"
    path.write_text("\n".join(["time_s,qwert,asdf", *rows]))
    return path


def test_columns_that_no_name_tells_are_asked_for(weighbridge, tmp_path, monkeypatch):
    log, mapping = nameless(tmp_path), tmp_path / "m.toml"
    assert "--ask asks what they are" in weighbridge("map", log).err
    asked = answers(monkeypatch, {"qwert, 30": "vehicle_speed", "qwert is vehicle_speed": "mph"})
    ran = weighbridge("map", log, "-o", mapping, "--ask")
    assert ran.code == 0, ran.err
    assert [question.split(",")[0] for question in asked if "what is it" in question] == [
        "qwert",
        "asdf",
    ]
    speed = read_drive(log, mapping).signals["vehicle_speed"].values
    assert speed.mean() == pytest.approx(40.0 * 0.44704, rel=0.02)
    assert "left out" not in ran.err


def test_no_answer_to_any_column_is_a_refusal(weighbridge, tmp_path, monkeypatch):
    answers(monkeypatch, {})
    ran = weighbridge("map", nameless(tmp_path), "-o", tmp_path / "m.toml", "--ask")
    assert ran.code == 2
    assert named(ran.err, "x.csv")
    assert not (tmp_path / "m.toml").exists()


def test_what_is_doubted_is_asked_for_and_nothing_else(weighbridge, tmp_path, monkeypatch):
    rows = (f"{k},{k / 5:.1f},{1.7e9 + k / 5:.1f},{9 + k % 7},48.1,11.5,900,30" for k in range(300))
    head = "n,Time (s),Unix time,Speed (km/h),Latitude (deg),Longitude (deg),RPM (rpm),Load (%)"
    (tmp_path / "x.csv").write_text("\n".join([head, *rows]))
    asked = answers(monkeypatch, {"the time": "Unix time", "Speed": "gnss_speed"})
    ran = weighbridge("map", tmp_path / "x.csv", "-o", tmp_path / "m.toml", "--ask")
    assert ran.code == 0
    assert len(asked) == 2
    assert "which column is the time (Unix time, Time (s))" in asked[0]
    assert "Speed (km/h), 9 to 15 kmh, is taken for vehicle_speed" in asked[1]
    text = (tmp_path / "m.toml").read_text()
    assert 'column = "Unix time"' in text
    assert "signals.gnss_speed" in text
    assert "doubtful" not in text
    assert "gnss_speed" in read_drive(tmp_path / "x.csv", tmp_path / "m.toml").signals


def test_a_log_without_a_clock_is_mapped_by_its_rate(weighbridge, tmp_path, monkeypatch):
    log, mapping = tmp_path / "x.csv", tmp_path / "m.toml"
    log.write_text("Index,Vehicle Speed (km/h)\n" + "".join(f"{k},{k % 9}\n" for k in range(300)))
    ran = weighbridge("map", log, "-o", mapping)
    assert ran.code == 0
    told = " ".join(ran.out.split())
    assert "300 of them, how many per second is not known" in told
    assert f"next: weighbridge map {log} -o {mapping} --force --rate HZ" in told
    refused = weighbridge("inspect", log, "--mapping", mapping)
    assert refused.code == 2
    assert "rate_hz is not known yet" in refused.err
    assert weighbridge("map", log, "--rate", "10", "-o", mapping, "--force").code == 0
    assert read_drive(log, mapping).signals["vehicle_speed"].duration == pytest.approx(29.9)
    asked = answers(monkeypatch, {"how many rows per second": ["many", "5"]})
    assert weighbridge("map", log, "--ask", "-o", mapping, "--force").code == 0
    assert len(asked) == 2
    assert "rate_hz = 5.0" in mapping.read_text()
    assert weighbridge("map", log, "--rate", "-1").code == 2


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
    assert named(weighbridge("map", tmp_path).err, tmp_path, ".csv")


def test_the_command_named_next_reads_one_of_several_drives(weighbridge, tmp_path):
    folders = [tmp_path / "a trip", tmp_path / "b trip"]
    for day, folder in enumerate(folders, 11):
        folder.mkdir()
        for name, column in (("obd", "Vehicle speed (km/h)"), ("gps", "Latitude (deg)")):
            rows = "".join(f"{k / 4},{40 + k % 9}\n" for k in range(300))
            (folder / f"{name}_202403{day}.csv").write_text(f"Time (s),{column}\n{rows}")
    mapping = tmp_path / "m.toml"
    ran = weighbridge("map", *folders, "-o", mapping)
    assert ran.code == 0
    command = f"weighbridge inspect '{folders[0]}' --mapping {mapping}"
    assert f"next: {command}" in " ".join(ran.out.split())
    for folder in folders:
        assert weighbridge("inspect", folder, "--mapping", mapping).code == 0
    assert "folder of its own" not in ran.out


def test_drives_beside_each_other_are_to_have_folders_of_their_own(weighbridge, tmp_path):
    for day in (11, 12):
        for name, column in (("obd", "Vehicle speed (km/h)"), ("gps", "Latitude (deg)")):
            rows = "".join(f"{k / 4},{40 + k % 9}\n" for k in range(300))
            (tmp_path / f"{name}_202403{day}.csv").write_text(f"Time (s),{column}\n{rows}")
    told = " ".join(weighbridge("map", tmp_path, "-o", tmp_path / "m.toml").out.split())
    assert "put the files of each into a folder of its own" in told


@pytest.fixture
def torqueless(tmp_path):
    time = np.arange(0.0, 20.0, 0.5)
    columns = {"zeit_s": time, "v_kmh": 2.0 * time, "rpm": 900.0 + 50.0 * time, "kx7": 5.0 * time}
    path = tmp_path / "day.parquet"
    pl.DataFrame(columns).write_parquet(path)
    return path


def test_a_log_of_which_no_column_is_a_torque_says_what_to_do(
    weighbridge, torqueless, tmp_path, monkeypatch
):
    mapping = tmp_path / "m.toml"
    told = " ".join(weighbridge("map", torqueless, "-o", mapping).err.split())
    assert "no column taken is a torque, a load or a power" in told
    asked = answers(monkeypatch, {"kx7, 0 to 97.5": "engine_torque_fraction", "kx7 is": "pct"})
    ran = weighbridge("map", torqueless, "-o", mapping, "--ask", "--force")
    assert ran.code == 0
    assert any(question.startswith("kx7, 0 to 97.5") for question in asked)
    assert "no column taken" not in ran.err
    read = read_drive(torqueless, mapping)
    assert read.signals["engine_torque_fraction"].values.max() == pytest.approx(0.975)


def test_a_folder_of_foreign_names_leads_to_a_mapping_of_the_folder(weighbridge, foreign):
    ran = weighbridge("inspect", foreign)
    assert ran.code == 2
    assert f"weighbridge map {foreign} -o map.toml" in " ".join(ran.err.split())
    (foreign / "phone.csv").unlink()
    alone = " ".join(weighbridge("inspect", foreign).err.split())
    assert f"weighbridge map {foreign / 'auto.csv'} -o map.toml" in alone


def test_columns_without_a_header_are_named_on_the_command_line(weighbridge, tmp_path):
    log, mapping = tmp_path / "x.csv", tmp_path / "m.toml"
    log.write_text("".join(f"{k % 9},{100 * k}\n" for k in range(300)))
    refused = weighbridge("map", log)
    assert refused.code == 2
    assert "--columns" in refused.err
    ran = weighbridge("map", log, "--columns", "Vehicle Speed (km/h), time_ms", "-o", mapping)
    assert ran.code == 0
    assert "300 rows in 30 s" in " ".join(ran.out.split())
    assert read_drive(log, mapping).signals["vehicle_speed"].duration == pytest.approx(29.9)
    pl.DataFrame({"rpm": [1.0]}).write_parquet(tmp_path / "x.parquet")
    refused = weighbridge("map", tmp_path / "x.parquet", "--columns", "rpm")
    assert named(refused.err, "x.parquet --columns")


@pytest.mark.parametrize("named", ["", "speed.npy"])
def test_arrays_are_told_to_have_no_names(weighbridge, tmp_path, named):
    np.save(tmp_path / "speed.npy", np.zeros(9))
    ran = weighbridge("map", tmp_path / named)
    assert ran.code == 2
    assert "NumPy arrays, which have no names" in ran.err


def test_on_a_terminal_the_last_line_names_the_questions(weighbridge, on_a_terminal, tmp_path):
    """Nothing is asked without --ask, and a script is not told of it."""
    log, mapping = tmp_path / "x.csv", tmp_path / "m.toml"
    log.write_text("Time,Speed,Load\n" + "".join(f"{k},{k % 9},{k % 90}\n" for k in range(300)))
    ran = weighbridge("map", log, "-o", mapping)
    assert ran.code == 0
    assert "states no unit" in ran.out
    assert "--ask" not in ran.out
    code, told = on_a_terminal("map", log, "-o", mapping, "--force")
    assert code == 0
    assert "to be asked about uncertain findings" in told.splitlines()[-1]
    assert "--force --ask" in told.splitlines()[-1]


def test_a_folder_of_frames_and_channels_takes_the_dbc_for_its_frames(weighbridge, tmp_path):
    golden = Path(__file__).parent.parent / "golden"
    folder, mapping = tmp_path / "drive", tmp_path / "map.toml"
    folder.mkdir()
    for name in ("can.mf4", "log.mf4"):
        shutil.copy(golden / name, folder / name)
    ran = weighbridge("map", folder, "--dbc", golden / "golden.dbc", "-o", mapping)
    assert ran.code == 0, ran.err
    assert "left out" not in ran.out
    text = mapping.read_text(encoding="utf-8")
    assert 'files = "can.mf4"' in text
    assert 'files = "log.mf4"' in text
    # Alone it is no log that a DBC is for.
    ran = weighbridge("map", folder / "log.mf4", "--dbc", golden / "golden.dbc")
    assert ran.code == 2
    assert named(ran.err, "log.mf4 --dbc")
