"""The tutorials run as they stand, and say what they show."""

import nbformat
import pytest
from nbclient import NotebookClient
from website import notebooks, running

TUTORIALS = notebooks.tutorials()
TOLERANCE = 0.03


@pytest.mark.slow
@pytest.mark.parametrize("page", TUTORIALS, ids=lambda p: p.stem)
def test_a_tutorial_says_what_it_shows(page, tmp_path):
    shown = 0
    for block, said in running.run(page, tmp_path):
        if block.output is not None:
            assert running.agrees(block.output, said, TOLERANCE), said
            shown += 1
    assert shown >= 2


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda p: p.stem)
def test_a_notebook_has_the_code_and_the_output_of_its_page(page):
    made = nbformat.reads(notebooks.notebook(page), as_version=4)
    cells = [c for c in made.cells if c.cell_type == "code"]
    blocks = running.blocks(page)
    assert cells[0].source == notebooks.FIRST.rstrip()
    assert len(cells) == 1 + len(blocks)
    for cell, block in zip(cells[1:], blocks, strict=True):
        if block.language == "bash":
            typed = [line for line in cell.source.splitlines() if not line.startswith("!weigh")]
            assert typed in ([], ["!cat map.toml"])
        assert cell.source.replace("!", "").split() == block.code.replace("\\\n", "").split()
        assert [o.text for o in cell.outputs] == ([block.output] if block.output else [])


@pytest.mark.slow
def test_a_notebook_runs_alone_and_says_what_it_shows(tmp_path):
    """As a reader has it: the file in an empty folder, run by the kernel of Jupyter.

    The others have the cells of their pages, which run.
    """
    (page,) = (page for page in TUTORIALS if page.stem == "electric")
    made = nbformat.reads(notebooks.notebook(page), as_version=4)
    shown = ["".join(o.text for o in cell.get("outputs", ())) for cell in made.cells]
    place = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(made, timeout=600, kernel_name="python3", resources=place).execute()
    compared = 0
    for cell, before in zip(made.cells, shown, strict=True):
        printed = [o for o in cell.get("outputs", ()) if o.output_type == "stream"]
        said = "".join(o.text for o in printed)
        assert "\x1b" not in said
        if before:
            assert running.agrees(before, said, TOLERANCE), said
            compared += 1
    assert compared >= 2


@pytest.mark.parametrize(
    ("shown", "said", "agrees"),
    [
        ("mass 1000 kg", "mass 1010 kg", True),
        ("mass 1000 kg", "mass 1100 kg", False),
        ("mass 1000 kg", "mass 1000 lb", False),
        ("mass 1000 kg, payload 200 kg", "mass 1017 kg, payload 217 kg", True),
        ("mass 1000 kg, payload 200 kg", "mass 1000 kg, payload 240 kg", False),
        ("mass 1000 kg, drag 0.60 m²", "mass 1000 kg, drag 0.80 m²", False),
        ("mass 1000 kg, share 20 %", "mass 1000 kg, share 23 %", False),
        ("error -0.2 %, 95 % from -1.4 %", "error 0.1 %, 95 % from -1.9 %", True),
        ("a 1\n...\nc 3", "a 1\nb 2\nb 2\nc 3", True),
        ("a 1\n...\nc 3", "a 1\nb 2", False),
        ("a 1\n...", "a 1\nb 2", True),
        ("a 1", "a 1\nb 2", False),
        ("a 1\nb 2", "a 1", False),
    ],
)
def test_a_page_agrees_with_the_same_words_and_close_numbers(shown, said, agrees):
    assert running.agrees(shown, said, 0.03) is agrees
