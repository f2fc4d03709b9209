"""Pages are written in short sentences, and the README is short."""

from pathlib import Path

import pytest
from website.sentences import MOST, MOST_IN_A_CELL, cells, length, long_ones, sentences

HOME = Path(__file__).parents[2]
PAGES = sorted(
    page.relative_to(HOME).as_posix()
    for page in (
        HOME / "README.md",
        HOME / "CONTRIBUTING.md",
        *(HOME / "docs").rglob("*.md"),
        *(HOME / "studies").glob("*.md"),
    )
)


@pytest.mark.parametrize("page", PAGES)
def test_no_sentence_is_too_long(page):
    assert long_ones((HOME / page).read_text(encoding="utf-8")) == []


def test_the_readme_fits_two_screens():
    lines = (HOME / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 90


def test_sentences_of_paragraphs_items_and_titles_are_told_apart():
    text = (
        "# A title\n\nOne two three. Four `five six` (seven) eight!\n\n- nine ten\n- eleven\n\n"
        "```bash\nno words here\n```\n\n| no | words |\n|---|---|\n\n"
        "See [twelve](thirteen.md): A b.\n"
    )
    assert [length(s) for s in sentences(text)] == [2, 3, 4, 2, 1, 2, 2]


def test_a_long_cell_is_seen():
    cell = " ".join(["word"] * MOST_IN_A_CELL)
    assert long_ones(f"| a | {cell} |\n|---|---|\n| `code of {cell}` | b |\n") == []
    assert long_ones(f"| a | {cell} more |\n") == [f"{cell} more"]
    assert list(cells("text | no\n| one `a b` | $x + y$ |\n")) == ["one X", "X"]


def test_a_long_sentence_is_seen_across_lines():
    words = " ".join(["word"] * MOST)
    assert long_ones(f"{words}.\n") == []
    assert len(long_ones(f"Short one. {words}\nand more of it.\n")) == 1
