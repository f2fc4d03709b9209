"""NMEA 0183: sentences, clocks, damage."""

from functools import reduce

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import has

from weighbridge import DriveError, MissingExtraError, read_drive
from weighbridge.messages import phrase

# The example of the RMC sentence in the standard's own tables: 48°07.038' N, 11°31.000' E.
PLACE = "4807.038,N,01131.000,E"


def s(body, checksum=None):
    found = f"{reduce(lambda a, b: a ^ b, body.encode()):02X}"
    return f"${body}*{found if checksum is None else checksum}\r\n"


def rmc(clock="123519", place=PLACE, speed="022.4", course="084.4", date="230394", status="A"):
    return s(f"GPRMC,{clock},{status},{place},{speed},{course},{date},003.1,W")


def gga(clock="123519", place=PLACE, quality=1, hdop="0.9", height="545.4"):
    return s(f"GNGGA,{clock},{place},{quality},08,{hdop},{height},M,46.9,M,,")


def drive(tmp_path, text, name="log.nmea"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
    return read_drive(path)


def test_position_speed_course_height_and_accuracy(tmp_path):
    gst = s("GNGST,123519,1.0,,,,3.0,4.0,5.0")
    found = drive(tmp_path, rmc() + gga() + gst)
    values = {n: float(x.values[0]) for n, x in found.signals.items()}
    assert_allclose(np.degrees(values["latitude"]), 48.1173, atol=1e-7)
    assert_allclose(np.degrees(values["longitude"]), 11.516667, atol=1e-6)
    assert values["altitude"] == 545.4
    assert values["hdop"] == 0.9
    assert values["gnss_accuracy"] == 5.0
    assert_allclose(values["gnss_speed"], 22.4 * 1852 / 3600)
    assert_allclose(np.degrees(values["gnss_course"]), 84.4)
    assert found.info.start_time == "1994-03-23T12:35:19+00:00"
    assert found.problems == ()


def test_south_and_west_are_negative(tmp_path):
    found = drive(tmp_path, rmc(place="4807.038,S,01131.000,W"))
    assert found.signals["latitude"].values[0] < 0.0
    assert found.signals["longitude"].values[0] < 0.0


def test_gns_of_several_systems_and_speed_of_vtg(tmp_path):
    gns = s(f"GNGNS,123519.50,{PLACE},AAN,12,0.8,600.5,46.9,,")
    vtg = s("GNVTG,54.7,T,34.4,M,005.5,N,036.0,K,A")
    found = drive(tmp_path, gns + vtg)
    assert_allclose(found.signals["gnss_speed"].values, [10.0])
    assert found.signals["altitude"].values[0] == 600.5
    assert found.signals["gnss_speed"].time[0] == found.signals["altitude"].time[0]


def test_date_comes_after_midnight_has_passed(tmp_path):
    text = (
        gga("235959") + rmc("235959", date="281299") + gga("000000") + rmc("000000", date="291299")
    )
    found = drive(tmp_path, text)
    assert_array_equal(found.signals["altitude"].time, [0.0, 1.0])
    assert_array_equal(found.signals["gnss_speed"].time, [0.0, 1.0])
    assert found.info.start_time == "1999-12-28T23:59:59+00:00"


def test_clock_without_date_runs_over_midnight(tmp_path):
    found = drive(tmp_path, gga("235958") + gga("235959") + gga("000000.5"))
    assert_allclose(np.diff(found.signals["altitude"].time), [1.0, 1.5])
    assert found.info.start_time is None


def test_a_wrong_date_at_the_start_is_outvoted(tmp_path):
    text = rmc("120000", date="060180")
    text += "".join(rmc(f"1200{k:02d}", date="050321") for k in range(1, 9))
    found = drive(tmp_path, text)
    assert found.info.start_time == "2021-03-05T12:00:00+00:00"
    assert_allclose(np.diff(found.signals["latitude"].time), 1.0)


def test_recordings_of_three_days_keep_their_dates(tmp_path):
    text = "".join(rmc("120000", date=f"{d:02d}0321") + gga("120001") for d in (5, 6, 9))
    found = drive(tmp_path, text)
    assert_allclose(np.diff(found.signals["altitude"].time), [86400.0, 3 * 86400.0])


def test_without_a_fix_nothing_is_taken(tmp_path):
    found = drive(tmp_path, rmc(status="V") + gga(quality=0) + gga("123520"))
    assert len(found.signals["latitude"]) == 1
    assert has(found.problems, "file.sentences", count=2, reason="without a fix")


def test_wrong_and_missing_checksums(tmp_path):
    bare = rmc("123521").split("*")[0] + "\r\n"
    wrong = rmc("123520").replace("*", "0*")
    found = drive(tmp_path, rmc() + wrong + bare)
    assert len(found.signals["latitude"]) == 2
    counts = [p.values["count"] for p in found.problems if p.id == "file.sentences"]
    assert counts == [1, 1]
    assert has(found.problems, "file.sentences", count=1, reason=phrase("no_checksum"))


def test_binary_between_sentences_and_broken_lines(tmp_path):
    ubx = b"\xb5\x62\x01\x07\x5c\x00" + bytes(range(92)) + b"\x12\x34"
    broken = rmc("123520").encode()[:25]
    text = ubx + rmc().encode() + ubx + broken + rmc("123521").encode()
    found = drive(tmp_path, text, "log.ubx")
    assert len(found.signals["latitude"]) == 2
    assert has(found.problems, "file.sentences", reason="damaged")


def test_position_that_cannot_be_is_left_out(tmp_path):
    found = drive(tmp_path, rmc(place="9907.038,N,01131.000,E") + rmc("123520"))
    assert len(found.signals["latitude"]) == 1


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (b"", "no NMEA sentence"),
        (b"\xff\xfe\x00 nothing \x80", "no NMEA sentence"),
        (s("GPGSV,1,1,00").encode(), "turn RMC and GGA on"),
        (rmc(status="V").encode(), "without a fix"),
        (rmc().encode()[:30], "1 damaged"),
    ],
)
def test_nothing_usable(tmp_path, text, said):
    with pytest.raises(DriveError, match=said):
        drive(tmp_path, text)


def test_missing_package_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pynmea2", None)
    with pytest.raises(MissingExtraError, match=r"weighbridge\[position\]"):
        drive(tmp_path, rmc())


def test_mapping_moves_the_clock_and_need_not_name_the_file(tmp_path):
    (tmp_path / "log.nmea").write_text(gga("000010"))
    (tmp_path / "obd.csv").write_text("t,v\n0,36\n20,36\n")
    mapping = {
        "tables": {
            "gps": {"files": "*.nmea", "time": {"offset_s": 5.0}},
            "obd": {
                "files": "obd.csv",
                "time": {"column": "t"},
                "signals": {"vehicle_speed": {"column": "v", "unit": "kmh"}},
            },
        }
    }
    assert read_drive(tmp_path, mapping).signals["altitude"].time[0] == 15.0
    del mapping["tables"]["gps"]
    assert read_drive(tmp_path, mapping).signals["altitude"].time[0] == 10.0


WHOLE = b"".join((gga(f"1235{k:02d}") + rmc(f"1235{k:02d}")).encode() for k in range(10))


@settings(max_examples=80, deadline=None)
@given(
    st.integers(0, len(WHOLE)),
    st.binary(max_size=30),
    st.integers(0, 200),
)
def test_any_damage_leaves_signals_or_one_sentence(
    tmp_path_factory, assert_salvaged, at, junk, cut
):
    path = tmp_path_factory.mktemp("nmea") / "log.nmea"
    path.write_bytes(WHOLE[:at] + junk + WHOLE[at + cut :])
    assert_salvaged(path)


@pytest.mark.parametrize(
    ("before", "after"), [("NMEA,", ",1614938400000"), ("2021-03-05 10:00:00 ", ""), ("", "")]
)
@pytest.mark.parametrize("name", ["phone.txt", "phone.log", "phone.nmea"])
def test_what_an_app_writes_around_sentences(tmp_path, before, after, name):
    lines = [f"{before}{gga(f'1235{k:02d}').strip()}{after}\n" for k in range(20)]
    found = drive(tmp_path, "".join(lines), name)
    assert len(found.signals["latitude"]) == 20
    assert not found.problems
