"""Questions of newcomers lead to the page that answers them: by the search, and from the README."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from urllib.parse import quote

import pytest
from website.links import on_site, relinked

HOME = Path(__file__).parents[2]
QUESTIONS = tomllib.loads((Path(__file__).parent / "questions.toml").read_text())["question"]
FOUND = (
    "[...document.querySelectorAll('.md-search-result__item')].map(i => i.querySelector('a').href)"
)
LINK = re.compile(r"\]\(([^)#\s]+\.md)(?:#[^)\s]*)?\)")


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--quiet", "-d", str(folder)],
        cwd=HOME,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        check=True,
    )
    return folder


@pytest.mark.slow
def test_the_first_three_results_of_the_search_have_the_page_that_answers(site, browser):
    missed = []
    page = browser.new_page()
    for question in QUESTIONS:
        for words in (question["asked"], question["short"]):
            page.goto(f"{(site / 'index.html').as_uri()}?q={quote(words)}")
            page.wait_for_selector(".md-search-result__item", state="attached")
            first = [href.partition("?")[0] for href in page.evaluate(FOUND)[:3]]
            answer = (site / question["answer"]).with_suffix(".html").as_uri()
            if not any(href.partition("#")[0] == answer for href in first):
                missed.append((words, [href.removeprefix(site.as_uri()) for href in first]))
    assert missed == []


@pytest.mark.parametrize("question", QUESTIONS, ids=lambda q: q["short"])
def test_the_readme_leads_to_the_answer_in_two_steps(question):
    readme = (HOME / "README.md").read_text(encoding="utf-8")
    near = {on_site(target) for target in LINK.findall(readme)} - {None}
    there = set(near)
    for place in near:
        source = HOME / "docs" / place
        if source.is_file():
            text = relinked(source.read_text(encoding="utf-8"), place)
            below = Path(place).parent
            there |= {os.path.normpath(below / target) for target in LINK.findall(text)}
    assert question["answer"] in there
