"""The table of formats: how a file finds its reader, and what of a mapping is refused."""

import re
import tomllib
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.noted import error

from weighbridge import ConfigError, DriveError, read_drive
from weighbridge.io import FORMATS, Takes, format_of, is_log

NAMED = {"signals": {"vehicle_speed": {"column": "v", "unit": "kmh"}}, "time": {"column": "t"}}


def test_every_record_is_whole():
    assert len({f.name for f in FORMATS}) == len(FORMATS)
    for record in FORMATS:
        assert record.about
        assert record.suffixes
        assert all(s == s.lower() for s in record.suffixes)
        assert bool(record.package) == bool(record.extra)


def test_of_formats_with_one_suffix_at_most_one_needs_no_recognising():
    for suffix in {s for f in FORMATS for s in f.suffixes}:
        alike = [f for f in FORMATS if suffix in f.suffixes]
        assert sum(f.begins is None for f in alike) <= 1, suffix


ROOT = Path(__file__).parents[2]
WORDS = {
    Takes.TEXT: "all",
    Takes.PLAIN: "plain",
    Takes.COLUMNS: "columns",
    Takes.NUMBERS: "numbers",
    Takes.CHANNELS: "signals",
    Takes.CLOCK: "clock",
}


def test_the_page_of_formats_says_what_the_table_says():
    page = (ROOT / "docs/formats.md").read_text(encoding="utf-8")
    rows = [[c.strip() for c in line.split("|")[1:-1]] for line in page.splitlines()]
    told = {row[0]: row for row in rows if len(row) == 7}
    assert set(told) - {"format", "---"} == {f.name for f in FORMATS}
    for record in FORMATS:
        _, names, _, extra, mapping, drafted, tried = told[record.name]
        written = re.findall(r"`([^`]+)`", names)
        assert all(any(s.endswith(w) for w in written) for s in record.suffixes), record.name
        assert extra.split(" ")[0].strip("`") == record.extra, record.name
        assert mapping == WORDS[record.takes], record.name
        assert drafted == ("yes" if record.draft is not None else ""), record.name
        assert tried


def test_every_extra_is_there_and_tested():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    extras = project["project"]["optional-dependencies"]
    used = {f.extra for f in FORMATS} - {""}
    assert used <= extras.keys()
    assert used <= set(re.findall(r"\w+", extras["formats"][0]))
    assert "weighbridge[formats]" in extras["dev"]


def test_content_decides_where_the_name_says_nothing(tmp_path):
    path = tmp_path / "trip.dat"
    pl.DataFrame({"time_s": [0.0, 1.0], "vehicle_speed_kmh": [36.0, 36.0]}).write_parquet(path)
    assert format_of(path).name == "Parquet"
    assert read_drive(path).has("vehicle_speed")
    path.write_text("neither")
    with pytest.raises(DriveError, match=r"'\.dat' cannot be read"):
        read_drive(path)


@pytest.mark.parametrize("name", ["rlog", "rlog.bz2", "route--0--rlog.zst", "a_QLOG", "0.rlog"])
def test_a_name_without_a_dot_is_a_word_of_its_own(tmp_path, name):
    assert format_of(tmp_path / name).name == "openpilot"
    (tmp_path / f"ca{name}").write_bytes(b"")
    assert is_log(tmp_path / f"ca{name}") == ("--" in name or "_" in name or "0." in name)


def test_a_suffix_alone_is_no_name(tmp_path):
    assert not is_log(tmp_path / ".csv")
    assert is_log(tmp_path / "A.CSV")


@pytest.mark.parametrize(
    ("name", "mapping", "said"),
    [
        ("log.gpx", NAMED, "GPX column rate_hz [time]"),
        ("log.gpx", {"signals": NAMED["signals"]}, "GPX [signals]"),
        ("log.vbo", NAMED, "VBOX column"),
        ("log.mf4", {**NAMED, "time": {"column": "x"}}, "MDF column"),
        ("log.parquet", {**NAMED, "csv": {"decimal": ","}}, "Parquet [csv"),
        ("log.gpx", {"csv": {"decimal": ","}}, "GPX [csv] offset_s"),
    ],
)
def test_a_mapping_is_used_or_refused(tmp_path, name, mapping, said):
    (tmp_path / name).write_bytes(b"")
    with error(ConfigError, name, said):
        read_drive(tmp_path / name, mapping)


def test_a_mapping_for_all_files_is_for_those_that_can_use_it(tmp_path):
    rows = "".join(f"{1577836800 + k},36\n" for k in range(3))
    (tmp_path / "a.csv").write_text(f"t,v\n{rows}")
    points = "".join(
        f'<trkpt lat="1.{k}" lon="2"><time>2020-01-01T00:00:0{k}Z</time></trkpt>' for k in range(3)
    )
    (tmp_path / "b.gpx").write_text(f"<gpx><trk><trkseg>{points}</trkseg></trk></gpx>")
    with error(ConfigError, "b.gpx GPX rate_hz"):
        read_drive(tmp_path / "b.gpx", NAMED)
    drive = read_drive(tmp_path, NAMED)
    np.testing.assert_array_equal(drive.signals["vehicle_speed"].values, 10.0)
    assert drive.has("latitude")
    named = {"tables": {"all": {"files": "*.*", **NAMED}}}
    with error(ConfigError, "b.gpx GPX [time]"):
        read_drive(tmp_path, named)
