"""Drives and vehicles given as objects, paths or data frames, and how they show themselves."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.noted import error, noted

import weighbridge as wb
from weighbridge import ConfigError, Drive, DriveError, Signal, to_frames
from weighbridge.io import write_drive


@pytest.fixture(scope="module")
def saved(brief_drive, short_car, tmp_path_factory):
    folder = tmp_path_factory.mktemp("given")
    write_drive(brief_drive, folder / "drive", "parquet")
    short_car.save(folder / "car.toml")
    return folder


def test_paths_are_read(saved):
    vehicle, drive = saved / "car.toml", saved / "drive"
    by_hand = wb.weigh(wb.read_drive(drive), wb.Vehicle.load(vehicle))
    for of_paths in (str, Path):
        assert wb.weigh(of_paths(drive), of_paths(vehicle)).mass == by_hand.mass
        assert wb.inspect_drive(of_paths(drive), of_paths(vehicle)).drive.name == "drive"


def test_only_its_own_reader_and_method_are_imported_for_a_drive(saved):
    code = (
        "import sys, weighbridge as wb\n"
        f"print(wb.weigh({str(saved / 'drive')!r}, {str(saved / 'car.toml')!r}).status)\n"
        "other = ('io.mdf', 'io.naming', 'io.bus', 'io.draft', 'estimators.rls')\n"
        "print([name for name in other if f'weighbridge.{name}' in sys.modules])\n"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.splitlines() == ["converged", "[]"]


def test_a_path_is_calibrated_on(saved):
    path, quick = saved / "drive", wb.CalibrationSettings(method="rls")
    by_hand = wb.calibrate([wb.read_drive(path)], mass=1700.0, settings=quick)
    assert wb.calibrate(str(path), mass=1700.0, settings=quick) == by_hand


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_data_frames_go_out_and_come_back(brief_drive, short_car, library):
    frames = to_frames(brief_drive)
    if library == "pandas":
        frames = {table: frame.to_pandas() for table, frame in frames.items()}
    back = wb.read_frame(frames, name="back")
    assert list(back.signals) == list(brief_drive.signals)
    for name, signal in brief_drive.signals.items():
        np.testing.assert_array_equal(back.signals[name].time, signal.time)
        np.testing.assert_allclose(back.signals[name].values, signal.values, rtol=1e-12)
    assert wb.weigh(frames, short_car).mass == wb.weigh(back, short_car).mass


def test_drives_of_frames_are_numbered(brief_drive):
    frames, quick = to_frames(brief_drive), wb.CalibrationSettings(method="rls")
    for given, names in ((frames, ("frame",)), ([frames, frames], ("frame 1", "frame 2"))):
        made = wb.calibrate(given, mass=1700.0, settings=quick)
        assert made.provenance.drives == names


def test_an_index_is_a_column_and_dates_are_the_time():
    frame = pd.DataFrame({"vehicle_speed_kmh": [36.0, 72.0]})
    by_name = wb.read_frame(frame.set_index(pd.Index([5.0, 6.0], name="time_s")))
    assert by_name.signals["vehicle_speed"].time.tolist() == [5.0, 6.0]
    stamps = pd.to_datetime(["2026-03-01T10:00:00", "2026-03-01T10:00:02"])
    by_date = wb.read_frame(frame.set_index(stamps))
    assert by_date.signals["vehicle_speed"].values.tolist() == [10.0, 20.0]
    assert by_date.duration == 2.0
    assert by_date.info.start_time.startswith("2026-03-01T10:00:00")


@pytest.mark.parametrize(
    "index",
    [
        pd.Index([0.0, 1.0], name="time_s"),
        pd.to_datetime(["2026-03-01T10:00:00", "2026-03-01T10:00:02"]),
    ],
)
def test_an_index_and_a_column_of_one_name_are_refused(index):
    frame = pd.DataFrame({"time_s": [0.0, 1.0], "vehicle_speed_kmh": [36.0, 72.0]})
    with error(ConfigError, "frame time_s"):
        wb.read_frame(frame.set_index(index))


def test_columns_that_are_no_numbers_do_not_stop_the_others():
    frame = pd.DataFrame(
        {
            "time_s": [0.0, 1.0],
            "vehicle_speed_kmh": [36.0, np.nan],
            "mixed": pd.Series([1, "a"], dtype=object),
            "phasor": [1j, 2j],
            "text": ["a", "b"],
        }
    )
    drive = wb.read_frame(frame)
    assert drive.signals["vehicle_speed"].values.tolist() == [10.0]
    (found,) = [p for p in drive.problems if p.id == "file.no_plain_numbers"]
    assert found.values["columns"] == "'mixed', 'phasor'"


def test_a_mapping_names_columns_of_a_data_frame():
    frame = pd.DataFrame({"t": [0, 500], "Tacho": [36.0, 72.0]})
    mapping = {
        "time": {"column": "t", "unit": "ms"},
        "signals": {"vehicle_speed": {"column": "Tacho", "unit": "kmh"}},
    }
    speed = wb.read_frame(frame, mapping).signals["vehicle_speed"]
    assert speed.time.tolist() == [0.0, 0.5]
    assert speed.values.tolist() == [10.0, 20.0]


@pytest.mark.parametrize(
    ("given", "kind", "values"),
    [
        (pd.DataFrame({"speed": [1.0]}), DriveError, "frame speed"),
        (
            pd.DataFrame({"time_s": [0.0, 1.0], "x": [1.0, 2.0]}),
            DriveError,
            "frame vehicle_speed_kmh time_s x",
        ),
        (pd.DataFrame({"time_s": [], "vehicle_speed_kmh": []}), DriveError, "frame"),
        (pd.DataFrame([[1.0, 2.0]], columns=["time_s", "time_s"]), ConfigError, "frame time_s"),
        ([1.0, 2.0], ConfigError, "frame list"),
    ],
)
def test_frames_that_are_no_drive_are_one_sentence(given, kind, values):
    with error(kind, values):
        wb.read_frame(given)


@pytest.mark.parametrize("wrong", [3, None, np.zeros(3), {"a": 1}, b"drive"])
def test_what_is_neither_is_named(brief_drive, short_car, wrong):
    with error(ConfigError, "read_drive", type(wrong).__name__):
        wb.weigh(wrong, short_car)
    with error(ConfigError, type(wrong).__name__):
        wb.weigh(brief_drive, wrong)
    with error(ConfigError, "read_drive", type(wrong).__name__):
        wb.calibrate([brief_drive, wrong], mass=1700.0)


def test_what_calls_return_is_three_lines(brief_drive, short_car):
    weighing = wb.weigh(brief_drive, short_car)
    inspection = wb.inspect_drive(brief_drive)
    for shown in (brief_drive, weighing, short_car, inspection):
        lines = repr(shown).splitlines()
        assert len(lines) == 3
        assert max(map(len, lines)) <= 102
        assert shown._repr_html_().startswith("<div><strong>")
    assert f"{weighing.mass:.0f} kg" in repr(weighing)
    assert "calibrated" in repr(short_car)
    assert "never calibrated" in repr(wb.Vehicle())
    assert "best way: " in repr(inspection)
    assert "engine_load" in brief_drive._repr_html_()


def test_names_and_problems_cannot_act_on_terminal_or_page():
    drive = Drive(
        name="<b>\x1b[31m",
        signals={"vehicle_speed": Signal("vehicle_speed", np.zeros(1), np.ones(1))},
        problems=(noted("note"), noted("<script>bad</script>", serious=True)),
    )
    assert "\x1b" not in repr(drive)
    assert "2 problems, 1 serious: <script>" in repr(drive)
    page = drive._repr_html_()
    assert "<script>" not in page
    assert "<b>" not in page
    assert "\x1b" not in page


def test_the_public_names_are_all_there_and_nothing_else():
    assert set(wb.__all__) | {"__version__"} == set(dir(wb))
    for name in wb.__all__:
        assert getattr(wb, name).__doc__
    assert isinstance(to_frames(Drive(name="none", signals={})), dict)
