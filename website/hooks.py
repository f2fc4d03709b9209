"""Events of mkdocs: pages from outside docs/, the reference, equations, notebooks."""

from __future__ import annotations

import html as markup
import re
import sys
from pathlib import Path
from typing import Any

import latex2mathml.converter
from mkdocs.structure.files import File, Files

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from website import checks, links, messages, notebooks, reference

_DISPLAY = re.compile(r'<div class="arithmatex">\\\[(.*?)\\\]</div>', re.DOTALL)
_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
_OUTPUT = re.compile(r'<div class="language-text highlight"><pre>(.*?)</pre></div>', re.DOTALL)
_LINE = re.compile(r'(<span id="__span-[\d-]+")>((?:<a [^>]*></a>)?)([^\n]*)(?=\n</span>)')
_DRAWN = re.compile(r"[\u2500-\u259f]|^ {3,}\S|\S {2,}\S")
_CELL = re.compile(r"<t[dh][ >].*?</t[dh]>", re.DOTALL)
_CODE = re.compile(r"<code>[^<]*</code>")
_JOINT = re.compile(r"(?<=[^\W_]_)(?=[^\W_])")

_LONG, _LONGEST = 102, 128
"""Signs of the longest line that fits a page in the usual size of code, and in the smaller one."""

_WEIGHTS = (
    *((name, 3.0) for name in ("start", "record", "data", "files", "accuracy", "troubleshooting")),
    *((name, 3.0) for name in ("live", "fleet.")),
    ("questions", 2.0),
    ("studies/recorded", 1.0),
    *((f"{folder}/", 3.0) for folder in ("howto", "tutorials", "concepts")),
    *((name, 0.3) for name in ("changelog", "studies/", "reference/", "licence")),
)
"""How much more a page counts in the search than others, by the begin of its place."""


_NUMBERS = ("papers.md", "reference/checks.md")
"""Pages that the search leaves out."""


def on_files(files: Files, config: Any) -> Files:
    """Add what does not lie in docs/."""
    made: dict[str, str] = {
        **reference.python_pages(),
        "reference/commands.md": reference.commands_page(),
        "reference/messages.md": messages.messages_page(),
        "reference/checks.md": checks.checks_page(),
        "licence.md": "# Licence\n\n" + (links.HOME / "LICENSE").read_text(encoding="utf-8"),
        **{
            f"downloads/{page.stem}.ipynb": notebooks.notebook(page)
            for page in notebooks.tutorials()
        },
    }
    for place, text in made.items():
        files.append(File.generated(config, place, content=text))
    for place, source in links.outside_pages().items():
        files.append(File.generated(config, place, abs_src_path=str(source)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Turn links of the repository into those of the site; offer the notebook; weigh for search."""
    place = page.file.src_uri
    weight = next((w for begin, w in _WEIGHTS if place.startswith(begin)), 1.0)
    # Thousands of numbers are no words to search for, and lunr confuses some of them.
    page.meta.setdefault("search", {"exclude": True} if place in _NUMBERS else {"boost": weight})
    if place.startswith("tutorials/") and not place.endswith("index.md"):
        name = Path(place).stem
        offer = f"\n\n[Download as a notebook](../downloads/{name}.ipynb){{ .md-button }}\n"
        markdown = markdown.rstrip() + offer
    return markdown if place.startswith("reference/") else links.relinked(markdown, place)


def on_page_content(html: str, page: Any, config: Any, files: Files) -> str:
    """Write equations as MathML, which browsers draw without a script."""

    def drawn(found: re.Match[str], display: str) -> str:
        source = found[1].replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")
        return latex2mathml.converter.convert(source, display=display)

    html = outputs(html, page.file.src_uri)
    if page.file.src_uri.startswith("tutorials/"):
        # Else the code that makes data fills the first screen of what a search finds.
        begin = '<details class="example"'
        html = html.replace(begin, f"{begin} data-search-exclude")
    html = _DISPLAY.sub(lambda found: f'<div class="equation">{drawn(found, "block")}</div>', html)
    return _INLINE.sub(lambda found: drawn(found, "inline"), html)


def on_post_page(output: str, page: Any, config: Any) -> str:
    """Let names in tables break behind an underscore, and nowhere else."""

    def cell(found: re.Match[str]) -> str:
        return _CODE.sub(lambda code: _JOINT.sub("<wbr>", code[0]), found[0])

    return _CELL.sub(cell, output)


def outputs(html: str, place: str) -> str:
    """Return a page whose outputs may wrap what is said, but not what is drawn.

    Parameters
    ----------
    html : of the page
    place : of the page
    """
    return _OUTPUT.sub(lambda found: _output(found[1], place), html)


def _output(inside: str, place: str) -> str:
    longest = 0

    def line(found: re.Match[str]) -> str:
        nonlocal longest
        begin, anchor, said = found.groups()
        if not _DRAWN.search(said):
            return f'{begin} class="said">{anchor}{said}'
        longest = max(longest, len(markup.unescape(said)))
        return found[0]

    inside = _LINE.sub(line, inside)
    size = (" wide" if longest > _LONG else "") + (" wider" if longest > _LONGEST else "")
    # Outputs of tutorials hold numbers of one run, which nobody searches.
    skip = " data-search-exclude" if place.startswith(("tutorials/", "start")) else ""
    return f'<div class="language-text highlight{size}"><pre{skip}>{inside}</pre></div>'
