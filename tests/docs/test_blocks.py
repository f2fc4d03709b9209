"""Every block of code on the site runs in a test, or is listed with the reason why not."""

import json
import re
import tomllib
from pathlib import Path

import pytest
from tests.docs import logs
from website import links, running
from website.links import HOME

FENCE = re.compile(r"^ *```(\w*)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
NO_CODE = {"text", "math"}
PAGES = links.pages()
MADE = {
    ("docs/data.md",): logs.own_data,
    ("docs/fleet.md", "docs/fleet_figures.md"): logs.fleet,
    ("docs/live.md",): lambda folder: None,
    ("docs/questions.md",): lambda folder: None,
}
"""Pages that run here, one after the other in one folder, and what makes the logs they name."""

ELSEWHERE = {
    ("README.md", "bash"): "tests/cli/test_documents.py",
    ("README.md", "python"): "tests/cli/test_documents.py",
    ("docs/benchmark.md", "bash"): "tests/cli/test_benchmark.py",
    ("docs/fleet_queries.md", "sql"): "tests/fleet/test_tables.py",
    ("docs/loggers.md", "bash"): "tests/recorded/test_loggers.py",
    ("docs/methods/nguyen2024.md", "python"): "tests/cli/test_documents.py",
    ("docs/simulation.md", "python"): "tests/cli/test_documents.py",
}
"""Blocks by page and language that another test runs."""

WHOLE = {p.relative_to(HOME).as_posix() for p in running.pages()}
WHOLE |= {f"docs/{name}" for name in running.OWN_DRIVES}.union(*MADE)
"""Pages whose blocks run all, here, in tests/cli/test_documents.py or test_tutorials.py."""


def code(page: Path) -> list[tuple[str, str]]:
    """Language and first line of each block of code."""
    text = page.read_text(encoding="utf-8")
    return [(m[1], m[2].lstrip().partition("\n")[0]) for m in FENCE.finditer(text)]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(HOME).as_posix())
def test_a_block_runs_or_is_listed(page):
    name = page.relative_to(HOME).as_posix()
    left_out = running.not_run(page)
    for language, begins in code(page):
        if language in NO_CODE or begins in left_out:
            continue
        if language in ("toml", "json"):
            assert (name, language) in ELSEWHERE or name.startswith("docs/"), begins
        elif (name, language) not in ELSEWHERE:
            assert language in ("bash", "python"), f"{begins}: {language} is run by nothing"
            assert name in WHOLE, begins


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(HOME).as_posix())
def test_commands_stand_in_fences(page):
    """An indented block has no language, and would be run by nothing."""
    prose = FENCE.sub("", page.read_text(encoding="utf-8"))
    assert not re.findall(r"^    (?:weighbridge|pip|import|wb\.|sudo) .*$", prose, re.MULTILINE)


def test_what_is_listed_is_there_and_says_why():
    listed = tomllib.loads(running.NOT_RUN.read_text(encoding="utf-8"))["block"]
    for row in listed:
        assert row["begins"] in {begins for _, begins in code(HOME / row["page"])}, row
        assert len(row["reason"].split()) >= 3
    assert len({(row["page"], row["begins"]) for row in listed}) == len(listed)


@pytest.mark.parametrize(("page", "language"), ELSEWHERE, ids=str)
def test_the_test_that_runs_a_page_names_it(page, language):
    text = (HOME / ELSEWHERE[page, language]).read_text(encoding="utf-8")
    assert Path(page).name in text or "rglob" in text
    assert language in {kind for kind, _ in code(HOME / page)}


def test_a_json_of_the_pages_is_one():
    found = 0
    for page in PAGES:
        for language, block in FENCE.findall(page.read_text(encoding="utf-8")):
            if language == "json":
                found += len([json.loads(line) for line in block.splitlines()])
    assert found >= 3


@pytest.mark.slow
@pytest.mark.parametrize("pages", MADE, ids=lambda pages: pages[0])
def test_pages_run_on_logs_of_the_readers_own(pages, tmp_path):
    MADE[pages](tmp_path)
    for page in pages:
        assert list(running.run(HOME / page, tmp_path))
