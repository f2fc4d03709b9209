"""Questions of newcomers lead to the page that answers them: by the search, and from the README."""

import os
import re
import tomllib
from pathlib import Path

import pytest
from website.links import on_site, relinked

HOME = Path(__file__).parents[2]
QUESTIONS = tomllib.loads((Path(__file__).parent / "questions.toml").read_text())["question"]
SEARCH = """async words => {
    const input = document.querySelector('.md-search__input');
    const meta = document.querySelector('.md-search-result__meta');
    // Emptied first, so that what is found is none of the words before.
    for (const text of ['', words]) {
        input.value = text;
        input.dispatchEvent(new KeyboardEvent('keyup'));
        while (meta.textContent.includes('Type') === (text !== ''))
            await new Promise(resolve => setTimeout(resolve, 1));
    }
    return [...document.querySelectorAll('.md-search-result__item')].slice(0, 3).map(item =>
        [...item.querySelectorAll(':scope > a')].map(link => link.href.replace(/\\?h=[^#]*/, '')));
}"""
"""Types words; returns the links of each of three results: its page, then headings on it."""
LINK = re.compile(r"\]\(([^)#\s]+\.md)(?:#[^)\s]*)?\)")


@pytest.mark.slow
def test_the_first_three_results_of_the_search_have_the_page_that_answers(site, browser):
    missed = []
    page = browser.new_page()
    # The index is loaded once: a browser keeps that of each page that was left.
    page.goto(f"{(site / 'index.html').as_uri()}?q=mass")
    page.wait_for_selector(".md-search-result__meta:not(:has-text('Type'))")
    for question in QUESTIONS:
        answer = (site / question["answer"]).with_suffix(".html").as_uri()
        heading = f"{answer}#{question['heading']}" if "heading" in question else ""
        for words in (question["asked"], question["short"], *question.get("also", ())):
            first = page.evaluate(SEARCH, words)
            there = [links for links in first if links[0].partition("#")[0] == answer]
            if not there or (heading and heading not in there[0]):
                missed.append((words, [[h.removeprefix(site.as_uri()) for h in k] for k in first]))
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
