"""VBOX: columns by their titles, units, clocks, damage."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import error

from weighbridge import ConfigError, DriveError, read_drive

TITLES = ("satellites", "time", "latitude", "longitude", "velocity kmh", "heading", "height")
NAMES = "sats time lat long velocity heading height"
# 52° 49' 18.4" N, 0° 40' 10.9" W: the example in Racelogic's guide to the channels.
ROW = "009 {time} +3169.30644 +00040.18165 036.000 090.00 +00152.58"


def vbo(*rows, titles=TITLES, names=NAMES, created="File created on 05/03/2021 at 12:00:00"):
    head = "\n".join([created, "", "[header]", *titles, "", "[column names]", names, "", "[data]"])
    return "\n".join([head, *rows, ""])


def row(time="120000.00", **changed):
    cells = dict(zip(NAMES.split(), ROW.format(time=time).split(), strict=True))
    return " ".join({**cells, **changed}.values())


def drive(tmp_path, text):
    path = tmp_path / "log.vbo"
    path.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
    return read_drive(path)


def test_one_row(tmp_path):
    found = drive(tmp_path, vbo(row()))
    values = {n: float(x.values[0]) for n, x in found.signals.items()}
    assert_allclose(np.degrees(values["latitude"]), 52 + 49 / 60 + 18.4 / 3600, atol=1e-5)
    assert_allclose(np.degrees(values["longitude"]), -(40 / 60 + 10.9 / 3600), atol=1e-5)
    assert values["gnss_speed"] == 10.0
    assert values["altitude"] == 152.58
    assert_allclose(values["gnss_course"], np.pi / 2)
    assert "brake_switch" not in values
    assert found.info.start_time == "2021-03-05T12:00:00+00:00"
    assert found.problems == ()


@pytest.mark.parametrize(
    ("title", "unit"),
    [("velocity kmh", 1 / 3.6), ("velocity knots", 1852 / 3600), ("Velocity mph", 0.44704)],
)
def test_unit_of_the_velocity_is_in_its_title(tmp_path, title, unit):
    titles = [t if not t.startswith("velocity") else title for t in TITLES]
    found = drive(tmp_path, vbo(row(), titles=titles))
    assert_allclose(found.signals["gnss_speed"].values, 36.0 * unit)
    assert found.problems == ()


@pytest.mark.parametrize("title", ["velocity", "velocity furlongs"])
def test_velocity_without_a_unit_is_a_serious_doubt(tmp_path, title):
    titles = [t if not t.startswith("velocity") else title for t in TITLES]
    found = drive(tmp_path, vbo(row(), titles=titles))
    assert [p.signal for p in found.problems if p.serious] == ["gnss_speed"]


def test_a_mapping_settles_the_unit(tmp_path):
    titles = [t if not t.startswith("velocity") else "velocity" for t in TITLES]
    (tmp_path / "log.vbo").write_text(vbo(row(), titles=titles))
    mapping = {"signals": {"gnss_speed": {"column": "velocity", "unit": "mps"}}}
    found = read_drive(tmp_path / "log.vbo", mapping)
    assert found.signals["gnss_speed"].values[0] == 36.0
    assert found.problems == ()


def test_flags_in_the_satellites(tmp_path):
    rows = [
        row("120000.00", sats="009"),
        row("120000.10", sats="201"),
        row("120000.20", sats="137"),
    ]
    found = drive(tmp_path, vbo(*rows))
    assert_array_equal(found.signals["brake_switch"].values, [0.0, 1.0, 0.0])
    assert len(found.signals["latitude"]) == 3


def test_rows_without_satellites_have_no_position(tmp_path):
    found = drive(tmp_path, vbo(row("120000.00", sats="128"), row("120001.00")))
    assert len(found.signals["latitude"]) == 1
    assert found.problems[0].id == "position.few_satellites"
    assert found.problems[0].values["count"] == 1
    assert found.problems[0].values["rows"] == 2
    assert found.problems[0].values["satellites"] == 3


def test_clock_runs_over_midnight_and_takes_the_nearest_day(tmp_path):
    rows = [row("235959.90"), row("000000.00"), row("000000.10")]
    # The logger's own clock is an hour ahead and already in the next day.
    found = drive(tmp_path, vbo(*rows, created="File created on 06/03/2021 @ 00:59"))
    assert_allclose(np.diff(found.signals["latitude"].time), 0.1, atol=1e-6)
    assert found.info.start_time == "2021-03-05T23:59:59+00:00"


@pytest.mark.parametrize("created", ["", "File created on 45/45/2021 at 10:00"])
def test_without_a_date_the_clock_is_the_time_of_day(tmp_path, created):
    found = drive(tmp_path, vbo(row("000010.00"), created=created))
    assert found.signals["latitude"].time[0] == 10.0
    assert found.info.start_time is None


def test_decimal_commas(tmp_path):
    text = vbo(row("120000.00"), row("120000.10")).replace(".", ",")
    found = drive(tmp_path, text)
    assert_allclose(np.diff(found.signals["latitude"].time), 0.1, atol=1e-6)
    assert_allclose(found.signals["altitude"].values, 152.58)


def test_cut_row_and_text_cell(tmp_path):
    found = drive(
        tmp_path, vbo(row("120000.00"), row("120001.00", height="---"), row("120002.00")[:30])
    )
    assert len(found.signals["latitude"]) == 2
    assert len(found.signals["altitude"]) == 1
    assert found.problems[0].id == "file.rows_cut"
    assert found.problems[0].values["count"] == 1
    assert found.problems[0].values["lines"] == "3 lines"


def test_accelerations_of_the_speed_are_no_specific_force(tmp_path):
    text = vbo(
        row() + " +0000.20",
        titles=(*TITLES, "Long accel g"),
        names=f"{NAMES} Longacc",
    )
    found = drive(tmp_path, text)
    assert "longitudinal_accel" not in found.signals
    assert "'longacc'" in found.problems[0].text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "log.vbo VBOX"),
        ("time,speed\n1,2\n", "log.vbo VBOX"),
        (vbo(), "log.vbo 7"),
        (vbo(row(), names="sats clock lat long velocity heading height"), "log.vbo time"),
        (vbo(row("x")), "log.vbo 1"),
    ],
)
def test_nothing_usable(tmp_path, text, said):
    with error(DriveError, said):
        drive(tmp_path, text)


WHOLE = vbo(*(row(f"1200{k:02d}.00") for k in range(10))).encode()


@settings(max_examples=80, deadline=None)
@given(st.integers(0, len(WHOLE)), st.binary(max_size=20), st.integers(0, 300))
def test_any_damage_leaves_signals_or_one_sentence(
    tmp_path_factory, assert_salvaged, at, junk, cut
):
    path = tmp_path_factory.mktemp("vbo") / "log.vbo"
    path.write_bytes(WHOLE[:at] + junk + WHOLE[at + cut :])
    assert_salvaged(path)


CAN_NAMES = f"{NAMES} rpm eng_trq"
CAN_TITLES = (*TITLES, "Engine speed", "Engine torque")


def can_drive(tmp_path, signals):
    path = tmp_path / "can.vbo"
    rows = (f"{row(f'12000{k}.00')} {3000 + k} {100 + k}" for k in range(3))
    path.write_text(vbo(*rows, titles=CAN_TITLES, names=CAN_NAMES))
    return read_drive(path, {"signals": signals})


def test_a_mapping_names_the_columns_of_a_can_module(tmp_path):
    found = can_drive(
        tmp_path,
        {
            "engine_speed": {"column": "RPM", "unit": "rpm"},
            "engine_torque": {"column": "Engine torque", "unit": "nm", "factor": 0.5},
        },
    )
    assert_allclose(found.signals["engine_speed"].values, np.pi / 30 * np.array([3000, 3001, 3002]))
    assert_array_equal(found.signals["engine_torque"].values, [50.0, 50.5, 51.0])
    assert "latitude" in found.signals
    assert found.problems == ()


def test_a_mapping_goes_before_a_known_column(tmp_path):
    signals = {"gnss_speed": {"column": "rpm", "unit": "kmh", "factor": 0.001}}
    assert_allclose(can_drive(tmp_path, signals).signals["gnss_speed"].values[0], 3.0 / 3.6)


def test_a_mapped_column_that_is_not_there_is_told(tmp_path):
    found = can_drive(tmp_path, {"engine_speed": {"column": "revs", "unit": "rpm"}})
    assert [p.signal for p in found.problems if p.serious] == ["engine_speed"]
    with error(ConfigError, "engine_speed rpm radps"):
        can_drive(tmp_path, {"engine_speed": {"column": "rpm"}})


def track(*, unit=1.0, east=1.0, heading=60.0, speed=20.0, rows=60, place=(-34.9, 138.6)):
    """Rows of a drive at a constant course, one a second, its position in minutes over ``unit``."""
    course = np.radians(heading)
    way = speed * np.arange(rows) / 6.371e6
    north = np.degrees(np.radians(place[0]) + way * np.cos(course))
    lon = np.degrees(np.radians(place[1]) + way * np.sin(course) / np.cos(np.radians(place[0])))
    return [
        row(
            f"12{k // 60:02d}{k % 60:02d}.00",
            lat=f"{60.0 * a / unit:+.7f}",
            long=f"{60.0 * east * b / unit:+.7f}",
            velocity=f"{3.6 * speed:.3f}",
            heading=f"{heading:.2f}",
        )
        for k, (a, b) in enumerate(zip(north, lon, strict=True))
    ]


@pytest.mark.parametrize("place", [(-34.9, 138.6), (1.3, 103.8), (0.02, 32.5), (51.5, 0.01)])
@pytest.mark.parametrize(
    ("unit", "east", "ids"),
    [
        (1.0, -1.0, []),
        (60.0, 1.0, ["position.degrees"]),
        (60.0, -1.0, ["position.degrees", "position.mirrored"]),
        (1.0, 1.0, ["position.mirrored"]),
    ],
)
def test_degrees_and_east_are_known_by_way_and_course(tmp_path, place, unit, east, ids):
    found = drive(tmp_path, vbo(*track(unit=unit, east=east, place=place)))
    assert [p.id for p in found.problems] == ids
    assert_allclose(np.degrees(found.signals["latitude"].values[0]), place[0], atol=1e-6)
    assert_allclose(np.degrees(found.signals["longitude"].values[0]), place[1], atol=1e-6)


def test_degrees_are_known_by_their_size_where_the_vehicle_stands(tmp_path):
    found = drive(tmp_path, vbo(*track(unit=60.0, speed=0.0, place=(48.1, 11.6))))
    assert [p.id for p in found.problems] == ["position.degrees"]
    assert_allclose(np.degrees(found.signals["latitude"].values[0]), 48.1, atol=1e-6)
