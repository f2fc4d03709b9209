"""Questions of newcomers lead to the page that answers them: by the search, and from the README."""

import os
import re
import tomllib
from pathlib import Path

import pytest
from website.links import on_site, relinked

HOME = Path(__file__).parents[2]
QUESTIONS = tomllib.loads((Path(__file__).parent / "questions.toml").read_text())["question"]
FOUND = """[...document.querySelectorAll('.md-search-result__item')].map(item =>
    [...item.querySelectorAll(':scope > a')].map(link => link.href.replace(/\\?h=[^#]*/, '')))"""
"""The links of each result that are in sight: its page, then headings on it."""
LINK = re.compile(r"\]\(([^)#\s]+\.md)(?:#[^)\s]*)?\)")


@pytest.mark.slow
def test_the_first_three_results_of_the_search_have_the_page_that_answers(site, browser):
    missed = []
    page = browser.new_page()
    # The index is loaded once: a browser keeps that of each page that was left.
    page.goto(f"{(site / 'index.html').as_uri()}?q=mass")
    page.wait_for_selector(".md-search-result__meta:not(:has-text('Type'))")
    search = page.locator(".md-search__input")
    for question in QUESTIONS:
        answer = (site / question["answer"]).with_suffix(".html").as_uri()
        heading = f"{answer}#{question['heading']}" if "heading" in question else ""
        for words in (question["asked"], question["short"], *question.get("also", ())):
            search.fill("")
            page.wait_for_selector(".md-search-result__meta:has-text('Type')", state="attached")
            search.fill(words)
            search.press("End")  # The search begins with a key.
            page.wait_for_selector(".md-search-result__meta:not(:has-text('Type'))")
            first = page.evaluate(FOUND)[:3]
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
