"""What the site is made of: links, reference, settings that keep it on the reader's machine."""

import ast
import re
import textwrap
import tomllib
from importlib import import_module
from pathlib import Path

import latex2mathml.converter
import pytest
from website import docstrings, hooks, links, reference

HOME = Path(__file__).parents[2]


def test_every_public_name_is_in_the_reference():
    page = reference.python_pages()["reference/python.md"]
    for name in set(import_module("weighbridge").__all__) - {"fleet"}:
        assert f"::: weighbridge.{name}\n" in page
    assert "Others" not in reference.groups()


def imported(code: str) -> set[str]:
    """Return the names that Python code imports from the package."""
    return {
        f"{node.module}.{name.name}"
        for node in ast.walk(ast.parse(textwrap.dedent(code)))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("weighbridge")
        for name in node.names
    }


def codes(page: Path) -> list[str]:
    """Return the blocks of Python of a page."""
    return re.findall(r"^ *```python\n(.*?)^ *```", page.read_text("utf-8"), re.M | re.S)


def test_what_pages_import_is_in_the_reference():
    pages = "\n".join(reference.python_pages().values())
    told = set(re.findall(r"^::: (\S+)$", pages, re.MULTILINE))
    extension = sorted((HOME / "examples" / "extension").glob("*.py"))
    found = {path.name: imported(path.read_text("utf-8")) for path in extension}
    assert len(set().union(*found.values())) >= 15
    for page in links.pages():
        found[page.name] = set().union(*map(imported, codes(page)))
    for name, names in found.items():
        assert names <= told, name
    for name in told:
        module, _, last = name.rpartition(".")
        assert hasattr(import_module(module), last), name


def test_every_command_is_in_the_reference():
    page = reference.commands_page()
    for words in ("weigh", "calibrate", "vehicle new", "fleet report", "live", "record"):
        assert f"## weighbridge {words}\n" in page
    assert "| `--vehicle` | path |" in page


@pytest.mark.parametrize(
    ("place", "given", "expected"),
    [
        ("index.md", "[a](../studies/x.md)", "`a`"),
        ("files.md", "[a](../studies/accuracy.md#b)", "[a](studies/accuracy.md#b)"),
        ("methods/joint.md", "[a](../files.md)", "[a](../files.md)"),
        ("studies/accuracy.md", "[a](../docs/files.md)", "[a](../files.md)"),
        ("contributing.md", "[a](docs/glossary.md)", "[a](glossary.md)"),
        ("files.md", "[a](../CONTRIBUTING.md)", "[a](contributing.md)"),
        ("files.md", "[a](../src/weighbridge/io/read.py)", "`a`"),
        ("files.md", "[a](https://example.org/b)", "[a](https://example.org/b)"),
        ("files.md", "`[a](../LICENSE)`", "`[a](../LICENSE)`"),
    ],
)
def test_a_link_of_the_repository_becomes_one_of_the_site(place, given, expected):
    assert links.relinked(given, place) == expected


def test_words_behind_a_name_are_no_type():
    text = (
        "Do it.\n\nParameters\n----------\nmass : that rolls [kg]\n\n"
        "Returns\n-------\nx : (n,) [m]\n"
    )
    told = docstrings.reworded(text)
    assert "mass\n    that rolls [kg]\n" in told
    assert "x :\n    (n,) [m]" in told


def test_a_sentence_that_is_returned_is_no_type():
    text = (
        "Do it.\n\nReturns\n-------\nOne of each, in\ntheir order.\n\nRaises\n------\nE\n    Why.\n"
    )
    told = docstrings.reworded(text)
    assert "-------\n:\n    One of each, in their order.\n\nRaises\n------\nE\n    Why." in told


def test_a_toml_of_the_pages_is_one():
    found = 0
    for page in (HOME / "docs").rglob("*.md"):
        for block in re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
            tomllib.loads(block)
            found += 1
    assert found >= 3


METHODS = sorted((HOME / "docs" / "methods").glob("*.md"))


@pytest.mark.parametrize("page", METHODS, ids=lambda p: p.stem)
def test_formulas_are_written_so_that_site_and_repository_show_them(page):
    """A fence of ``math``, or dollars: between them a backslash before a mark is lost elsewhere."""
    text = page.read_text(encoding="utf-8")
    shown = re.findall(r"^```math\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    prose = re.sub(r"^ *```.*?^ *```$|`[^`\n]+`", "", text, flags=re.MULTILINE | re.DOTALL)
    inline = re.findall(r"\$([^$]+)\$", prose)
    assert len(shown) >= 1
    assert not re.search(r"\$\$|\\[(\[]|½", prose)
    for formula in inline:
        assert not re.search(r"\\[^A-Za-z]", formula), formula
        assert formula == formula.strip()
    for formula in (*shown, *inline):
        assert "<math" in latex2mathml.converter.convert(formula)
        assert formula.isascii(), formula


def test_the_theme_asks_no_host():
    text = (HOME / "mkdocs.yml").read_text(encoding="utf-8")
    assert "font: false" in text
    assert "http" not in text


def test_the_reference_of_commands_names_the_torque_sources():
    rows = [r for r in reference.commands_page().splitlines() if r.startswith("| `--torque`")]
    assert len(rows) == 2
    for row in rows:
        assert "wheel_torque (torque at the wheels)" in row
        assert "battery (" in row


def test_sentences_of_an_output_may_wrap_and_drawings_may_not():
    line = '<span id="__span-0-{}"><a href="#"></a>{}\n</span>'.format
    told = [line(1, "a note"), line(2, "│ a │"), line(3, "mass   12 kg"), line(4, "x" * 150)]
    page = '<div class="language-text highlight"><pre><code>{}</code></pre></div>'.format
    shown = hooks.outputs(page("".join(told)), "files.md")
    assert shown.count('class="said"') == 2
    assert '1" class="said"' in shown
    assert '4" class="said"' in shown
    assert "wide" not in shown
    assert "data-search-exclude" not in shown
    wide = hooks.outputs(page(line(1, "│" * 120)), "tutorials/ticket.md")
    assert 'highlight wide"><pre data-search-exclude>' in wide
    assert "wide wider" in hooks.outputs(page(line(1, "│" * 140)), "files.md")
