"""The page of live's figures is the one that `studies/live.py` fills."""

import re
from pathlib import Path

HOME = Path(__file__).parents[2]


def test_the_page_is_its_template_with_figures():
    template = (HOME / "studies" / "live.template.md").read_text(encoding="utf-8")
    pattern = re.sub(r"\\\{\w+\\\}", ".+?", re.escape(template))
    page = (HOME / "docs" / "live_figures.md").read_text(encoding="utf-8")
    assert re.fullmatch(pattern, page, re.DOTALL)
    numbers = [line for line in page.splitlines() if line.startswith("|the first mass|")]
    assert len(numbers) == 2
