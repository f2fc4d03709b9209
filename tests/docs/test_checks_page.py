"""The page of what is checked has each number with its meaning, and counts the corpus rightly."""

import ast

import polars as pl
import pytest
from website.checks import ROOMS, SOURCE, checks_page, counts, found_by, limits

from weighbridge.messages import catalogue


@pytest.fixture(scope="module")
def page():
    return checks_page()


def section(page, name):
    return page.partition(f"## {name}\n")[2].partition("\n## ")[0]


def test_every_number_of_the_rooms_has_its_meaning():
    without = [
        f"{path.relative_to(SOURCE)}: {name}"
        for room in ROOMS
        for path in (SOURCE / room).rglob("*.py")
        for text in [path.read_text(encoding="utf-8")]
        for name, _, meaning in limits(ast.parse(text), text)
        if not meaning
    ]
    assert without == []


def test_meanings_are_found_below_beside_and_above():
    text = """
# Two of a kind.
A: Final = 1.0
B: Final = (2.0, 3.0)

C: Final = 4.0
D: Final = 5.0
\"\"\"Both [s].\"\"\"

E = 6.0  # beside [m]
F: Final = G
H: Final = np.arange(3.0)
"""
    found = {name: (value, meaning) for name, value, meaning in limits(ast.parse(text), text)}
    assert found == {
        "A": ("1.0", "Two of a kind."),
        "B": ("(2.0, 3.0)", "Two of a kind."),
        "C": ("4.0", "Both [s]."),
        "D": ("5.0", "Both [s]."),
        "E": ("6.0", "beside [m]"),
        "H": ("np.arange(3.0)", ""),
    }


def test_ids_are_those_that_a_module_makes_else_names():
    makes = ast.parse(
        """
refused("speed.unit", ratio=1.0)
Problem.of("clock.moved" if a else "clock.stray", "obd")
Problem.of("frozen.signal", serious=True)
Problem.of("frozen.imu", serious=moving)
"""
    )
    names = ast.parse('NAMES = ("speed.unit", "imu.gravity", "none")')
    assert found_by([makes, names]) == [
        {
            "clock.moved": False,
            "clock.stray": False,
            "frozen.imu": False,
            "frozen.signal": True,
            "speed.unit": True,
        },
        {"imu.gravity": False},
    ]


def test_what_an_undamaged_drive_has_too_is_not_counted_for_a_damaged_one():
    table = pl.DataFrame(
        [
            ("a", "x y", 1500.0, True, None),
            ("b", "x", None, True, None),
            ("c", "x y z", None, False, "a"),
            ("d", "z", 1500.0, False, "a"),
            ("e", None, 1500.0, False, None),
        ],
        schema=["id", "problem_ids", "mass_kg", "sound", "reference"],
        orient="row",
    )
    sound, damaged = counts(table)
    assert sound == {"x": (2, 1), "y": (1, 0)}
    assert damaged == {"z": (2, 1)}
    assert (str(sound["x"]), str(sound["y"]), str(damaged["none"])) == ("2 (1)", "1", "0")


@pytest.mark.parametrize(
    ("module", "id"),
    [
        ("checks/correcting", "frozen.signal"),
        ("navigation/clock_drift", "clock.moved"),
        ("navigation/identify/rounds", "imu.scale_corrected"),
    ],
)
def test_the_examples_are_where_the_page_sends_its_readers(page, module, id):
    assert f"(#{module.replace('/', '')})" in page
    assert f"| `{id}` |" in section(page, module)


def test_what_the_corpus_found_is_on_the_page(page):
    """Beside what reading a file finds."""
    table = pl.read_csv(SOURCE.parents[1] / "studies" / "corpus" / "corpus.csv")
    found = {id for ids in table["problem_ids"] for id in (ids or "").split()}
    found = {id for id in found & set(catalogue()) if not id.startswith("file.")}
    found -= {"clock.not_aligned"}
    assert len(found) > 90
    assert {id for id in found if f"| `{id}` |" not in page} == set()
