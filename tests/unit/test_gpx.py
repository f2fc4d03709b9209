"""GPX: track points, what apps add, damage."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import error, refused, says

from weighbridge import DriveError, MissingExtraError, read_drive

POINT = '<trkpt lat="{lat}" lon="{lon}"><ele>{ele}</ele><time>{time}</time>{more}</trkpt>'


def point(second=0, lat=48.0, lon=-11.0, ele=500.0, more=""):
    return POINT.format(
        lat=lat, lon=lon, ele=ele, time=f"2021-03-05T10:00:{second:02d}Z", more=more
    )


def gpx(*points, version="1.1", segments=1):
    size = max(-(-len(points) // segments), 1)
    parts = [points[k : k + size] for k in range(0, len(points), size)] or [()]
    body = "".join(f"<trkseg>{''.join(p)}</trkseg>" for p in parts)
    name = f"http://www.topografix.com/GPX/{version.replace('.', '/')}"
    return f'<gpx version="{version}" creator="t" xmlns="{name}"><trk>{body}</trk></gpx>'


def drive(tmp_path, text):
    path = tmp_path / "log.gpx"
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8"))
    return read_drive(path)


def test_positions_times_and_height(tmp_path):
    found = drive(tmp_path, gpx(point(0), point(2, lat=48.1, ele=510.0)))
    assert_array_equal(found.signals["latitude"].time, [0.0, 2.0])
    assert_allclose(np.degrees(found.signals["latitude"].values), [48.0, 48.1])
    assert_allclose(np.degrees(found.signals["longitude"].values), -11.0)
    assert_array_equal(found.signals["altitude"].values, [500.0, 510.0])
    assert found.info.start_time == "2021-03-05T10:00:00+00:00"
    assert "gnss_speed" not in found.signals


def test_speed_and_course_of_gpx_1_0(tmp_path):
    found = drive(
        tmp_path, gpx(point(more="<course>90</course><speed>12.5</speed>"), version="1.0")
    )
    assert found.signals["gnss_speed"].values[0] == 12.5
    assert_allclose(found.signals["gnss_course"].values[0], np.pi / 2)


@pytest.mark.parametrize("prefix", ["v2:", "gpxtpx:", ""])
def test_speed_in_extensions(tmp_path, prefix):
    space = f'xmlns{":" + prefix[:-1] if prefix else ""}="http://example.org/v2"'
    more = (
        f"<extensions><{prefix}TrackPointExtension {space}><{prefix}speed>9.5</{prefix}speed>"
        f"</{prefix}TrackPointExtension></extensions>"
    )
    assert drive(tmp_path, gpx(point(more=more))).signals["gnss_speed"].values[0] == 9.5


def test_segments_are_one_drive_and_points_without_time_are_told(tmp_path):
    bare = '<trkpt lat="1" lon="2"/>'
    found = drive(tmp_path, gpx(point(0), point(1), bare, point(30), segments=2))
    assert_array_equal(found.signals["latitude"].time, [0.0, 1.0, 30.0])
    assert found.problems[0].id == "clock.points_without"
    assert found.problems[0].values["count"] == 1


def test_zone_of_the_time_counts(tmp_path):
    local = point(0).replace("10:00:00Z", "12:00:05+02:00")
    found = drive(tmp_path, gpx(point(0), local))
    assert_array_equal(found.signals["latitude"].time, [0.0, 5.0])


def test_a_file_that_breaks_off_is_salvaged(tmp_path):
    text = gpx(*(point(k) for k in range(20)))
    found = drive(tmp_path, text[: int(0.7 * len(text))])
    assert 10 <= len(found.signals["latitude"]) < 20
    assert [p.id for p in found.problems] == ["file.points_break_off"]


@pytest.mark.parametrize(
    "torn",
    [
        point(7)[:50],
        point(7)[30:],
        point(7, lat="north"),
        point(7).replace("</ele>", "</el"),
        "\x07<junk",
    ],
)
def test_a_damaged_point_costs_itself_and_is_told(tmp_path, torn):
    points = [point(k) + "\n" for k in range(20)]
    found = drive(tmp_path, gpx(*points[:7], torn + "\n", *points[8:]))
    assert 18 <= len(found.signals["latitude"]) <= 19
    (problem,) = found.problems
    assert (problem.id, problem.values["count"]) == ("file.rows_cut", 1)
    assert "line 8" in problem.values["example"] or "line 7" in problem.values["example"]


def test_latin_1_text(tmp_path):
    text = gpx(point()).replace("<trk>", "<trk><name>Höhe</name>")
    assert len(drive(tmp_path, text.encode("latin-1")).signals["latitude"]) == 1


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "log.gpx GPX"),
        ("time,lat\n1,2\n", "log.gpx GPX"),
        (gpx(), "log.gpx"),
        (gpx('<trkpt lat="1" lon="2"/>'), "log.gpx 1"),
        (gpx(point(lat="48,5")), "log.gpx GPX"),
        (gpx(point(lat="north")), "log.gpx GPX"),
        (
            '<!DOCTYPE g [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>' + gpx(point()),
            "XML <!DOCTYPE",
        ),
    ],
)
def test_nothing_usable(tmp_path, text, said):
    with error(DriveError, said):
        drive(tmp_path, text)


def test_missing_package_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "gpxpy", None)
    with pytest.raises(MissingExtraError, match=r"weighbridge\[position\]"):
        drive(tmp_path, gpx(point()))


WHOLE = gpx(*(point(k) for k in range(10))).encode()


@settings(max_examples=80, deadline=None)
@given(st.integers(0, len(WHOLE)), st.binary(max_size=20), st.integers(0, 300))
def test_any_damage_leaves_signals_or_one_sentence(
    tmp_path_factory, assert_salvaged, at, junk, cut
):
    path = tmp_path_factory.mktemp("gpx") / "log.gpx"
    path.write_bytes(WHOLE[:at] + junk + WHOLE[at + cut :])
    assert_salvaged(path)


def test_a_track_beside_canonical_tables_is_read(tmp_path):
    (tmp_path / "gnss.csv").write_text("time_s,speed_mps\n0,1\n1,2\n")
    (tmp_path / "track.gpx").write_text(gpx(point(0), point(1)))
    with refused("clock.nothing_shared") as told:
        read_drive(tmp_path)
    why = told.value.problem.values["why"]
    assert says(why, "dates_and_counts", dated="track.gpx", counted="gnss.csv")
    (tmp_path / "gnss.csv").rename(tmp_path / "other.csv")
    assert "latitude" in read_drive(tmp_path / "track.gpx").signals
