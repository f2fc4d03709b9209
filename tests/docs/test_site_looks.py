"""The site on a desktop and a phone, in light and dark: what is wide, hidden, or glares."""

import io

import numpy as np
import pytest

DESKTOP, PHONE = {"width": 1280, "height": 800}, {"width": 390, "height": 844}
CUT = """[...document.querySelectorAll(
    '.md-content :is(pre > code, .equation, .md-typeset__scrollwrap)')]
    .filter(box => box.clientWidth && box.scrollWidth > box.clientWidth + 1)
    .map(box => box.innerText.trim().split('\\n')[0])"""
UNDER_THE_ICON = """[...document.querySelectorAll('.md-content .highlight')].flatMap(block => {
    const icon = block.querySelector('.md-code__nav').getBoundingClientRect();
    const text = document.createRange();
    text.selectNodeContents(block.querySelector('code'));
    return [...text.getClientRects()].filter(line => icon.width && line.width > 1 &&
        line.right > icon.left && line.top < icon.bottom && line.bottom > icon.top)
        .map(() => block.innerText);
})"""

DRESSED = """[...document.querySelectorAll('.md-content .highlight')].every(
        block => block.querySelector('.md-code__nav')) &&
    [...document.querySelectorAll('.md-content table:not([class])')].every(
        table => table.closest('.md-typeset__scrollwrap'))"""
"""Icons stand on code and frames around tables, which the script of the page adds."""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def tabs(chromium):
    """One tab a scheme for all places: to open one takes longer than to look at a page."""
    return {scheme: chromium.new_page(color_scheme=scheme) for scheme in ("light", "dark")}


@pytest.fixture
def opened(tabs, site):
    def open_(place, viewport, scheme="light"):
        page = tabs[scheme]
        page.set_viewport_size(viewport)
        page.goto((site / place).as_uri(), wait_until="load")
        page.wait_for_function(DRESSED)
        return page

    return open_


@pytest.mark.parametrize(
    "place",
    ["start.html", "formats.html", "methods/index.html", "methods/joint.html", "concepts/way.html",
     "tutorials/own-csv.html", "tutorials/canedge-dbc.html", "questions.html"],
)  # fmt: skip
def test_nothing_is_cut_on_a_desktop(opened, place):
    page = opened(place, DESKTOP)
    assert page.evaluate(CUT) == []


@pytest.mark.parametrize("place", ["index", "joint", "jensen2022", "galvao"])
def test_equations_fit_a_phone(opened, place):
    page = opened(f"methods/{place}.html", PHONE)
    widths = "[...document.querySelectorAll('.equation')].map(e => e.scrollWidth - e.clientWidth)"
    found = page.evaluate(widths)
    assert len(found) >= 2
    assert max(found) <= 1
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]


def test_the_edge_of_what_scrolls_fades_until_its_end_is_seen(opened):
    page = opened("formats.html", PHONE)
    table = page.locator(".md-typeset__scrollwrap").nth(1)
    mask = "box => getComputedStyle(box).maskImage"
    assert "gradient" in table.evaluate(mask)
    table.evaluate("box => box.scrollTo(box.scrollWidth, 0)")
    page.wait_for_timeout(200)
    assert table.evaluate(mask) == "none"
    assert page.locator(".md-typeset__scrollwrap").first.evaluate(mask) == "none"


@pytest.mark.parametrize("place", ["start.html", "tutorials/j1939-truck.html"])
def test_no_command_is_under_the_icon_that_copies_it(opened, place):
    page = opened(place, PHONE)
    assert page.locator(".language-bash").count() >= 3
    assert page.evaluate(UNDER_THE_ICON) == []


def test_names_in_tables_break_behind_underscores_alone(opened):
    page = opened("files.html", PHONE)
    codes = page.locator("td code", has_text="wheel_torque_nm")
    assert codes.first.inner_text() == "wheel_torque_nm"
    assert codes.first.evaluate("code => getComputedStyle(code).wordBreak") == "normal"
    assert codes.first.locator("wbr").count() == 2


@pytest.mark.parametrize(
    ("place", "picture"),
    [("concepts/why.html", "img[src$='slope.svg']"), ("index.html", "img[src$='report.png']")],
)
@pytest.mark.parametrize(("scheme", "least", "most"), [("light", 200, 255), ("dark", 0, 80)])
def test_pictures_are_as_dark_as_the_page(opened, place, picture, scheme, least, most):
    image = pytest.importorskip("PIL.Image")
    page = opened(place, DESKTOP, scheme)
    shot = page.locator(picture).screenshot()
    assert least <= np.median(np.asarray(image.open(io.BytesIO(shot)).convert("L"))) <= most


def test_the_questions_begin_on_the_first_screen(opened):
    page = opened("index.html", DESKTOP)
    first = page.locator("table tbody tr").first.bounding_box()
    assert first["y"] + first["height"] < DESKTOP["height"]
    assert "pytest" not in page.inner_text(".md-content")


def test_the_search_leaves_out_code_that_makes_data_and_outputs(site):
    index = (site / "search" / "search_index.js").read_text(encoding="utf-8")
    assert "Draft a mapping" in index
    assert "Vector__XXX" not in index
    assert "jitter ms" not in index
