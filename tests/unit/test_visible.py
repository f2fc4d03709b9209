"""Texts of files that are shown: nothing acts, nothing is endless."""

import json
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weighbridge import DriveError, Problem, read_drive
from weighbridge.visible import (
    LONGEST,
    cut,
    plain_json,
    shown_json,
    visible,
    visible_json,
    visible_text,
)

ACTING = [
    chr(c) for c in (*range(0x20), *range(0x7F, 0xA0), 0x200E, 0x202E, 0x2066, 0x061C, 0x2028)
]
ANY = st.text(st.characters(), max_size=30)


@pytest.mark.parametrize("character", ACTING)
def test_what_acts_is_escaped(character):
    assert character not in visible(f"a{character}b")
    assert visible(f"a{character}b").isprintable()


def test_letters_of_all_kinds_stay():
    for text in ("Škoda Fabia 1,4 · 55 kW", "比亚迪", "שלום", "🚗👩‍🔧", "Ca² ± 3 °"):
        assert visible(text) == text


def test_bytes_of_names_that_are_no_utf8():
    assert visible(b"dr\xe9ve".decode("utf-8", "surrogateescape")) == "dr\\xe9ve"


def test_lines_and_tabulators_of_pages_stay():
    assert visible_text("a\n\tb\x1b") == "a\n\tb\\x1b"
    assert visible("a\nb") == "a\\nb"


@given(ANY)
def test_json_means_the_same(text):
    written = json.dumps({"a": text}, ensure_ascii=False)
    for safe in (visible_json(written), plain_json(written)):
        assert json.loads(safe) == {"a": text}
        assert not any(unicodedata.category(c) in ("Cc", "Cs") for c in safe)
    assert plain_json(written).isascii()


@given(ANY)
def test_json_of_figures_shows_escapes(text):
    for ascii_only in (True, False):
        found = json.loads(shown_json(json.dumps({"a": text}, ensure_ascii=ascii_only)))["a"]
        assert not any(c in found for c in ACTING if c not in "\n\t")
        if text.isprintable():
            assert found == text


def test_long_messages_say_how_much_is_left_out():
    short, long = "x" * LONGEST, "begin" + "x" * 10_000_000 + "end"
    assert cut(short) == short
    said = cut(long)
    assert len(said) <= LONGEST
    assert said.startswith("begin")
    assert said.endswith("end")
    kept = len(said) - len(" … (9998142 characters left out) … ")
    assert f"({len(long) - kept} characters left out)" in said
    assert cut(said) == said


def test_a_message_that_quotes_an_endless_cell_is_cut_where_it_is_made():
    cell = "x" * 1_000_000
    said = Problem.of("file.cells_text", "x", count=1, filled=9, name="x", example=cell, row=1).text
    assert said == cut(said) == str(DriveError(said))
    assert len(str(DriveError(cell))) < LONGEST + 60
    assert "characters left out" in said


def test_an_endless_cell_is_short_in_json_too(tmp_path):
    rows = "".join(f"{k},{k}\n" for k in range(30))
    (tmp_path / "x.csv").write_text(f"time_s,vehicle_speed_kmh\n{rows}30,{'z' * 5_000_000}\n")
    drive = read_drive(tmp_path / "x.csv")
    assert any(p.id == "file.cells_text" for p in drive.problems)
    assert all(len(p.text) < LONGEST + 60 for p in drive.problems)
