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

pytestmark = pytest.mark.slow


def opened(browser, site, place, viewport, scheme="light"):
    page = browser.new_page(viewport=viewport, color_scheme=scheme)
    page.goto((site / place).as_uri(), wait_until="load")
    page.wait_for_timeout(200)
    return page


@pytest.mark.parametrize(
    "place",
    ["start.html", "formats.html", "methods/index.html", "methods/joint.html", "concepts/way.html",
     "tutorials/own-csv.html", "tutorials/canedge-dbc.html", "questions.html"],
)  # fmt: skip
def test_nothing_is_cut_on_a_desktop(site, browser, place):
    page = opened(browser, site, place, DESKTOP)
    assert page.evaluate(CUT) == []
    page.close()


@pytest.mark.parametrize("place", ["index", "joint", "jensen2022", "galvao"])
def test_equations_fit_a_phone(site, browser, place):
    page = opened(browser, site, f"methods/{place}.html", PHONE)
    widths = "[...document.querySelectorAll('.equation')].map(e => e.scrollWidth - e.clientWidth)"
    found = page.evaluate(widths)
    assert len(found) >= 2
    assert max(found) <= 1
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    page.close()


def test_the_edge_of_what_scrolls_fades_until_its_end_is_seen(site, browser):
    page = opened(browser, site, "formats.html", PHONE)
    table = page.locator(".md-typeset__scrollwrap").nth(1)
    mask = "box => getComputedStyle(box).maskImage"
    assert "gradient" in table.evaluate(mask)
    table.evaluate("box => box.scrollTo(box.scrollWidth, 0)")
    page.wait_for_timeout(200)
    assert table.evaluate(mask) == "none"
    assert page.locator(".md-typeset__scrollwrap").first.evaluate(mask) == "none"
    page.close()


@pytest.mark.parametrize("place", ["start.html", "tutorials/j1939-truck.html"])
def test_no_command_is_under_the_icon_that_copies_it(site, browser, place):
    page = opened(browser, site, place, PHONE)
    assert page.locator(".language-bash").count() >= 3
    assert page.evaluate(UNDER_THE_ICON) == []
    page.close()


def test_names_in_tables_break_behind_underscores_alone(site, browser):
    page = opened(browser, site, "files.html", PHONE)
    codes = page.locator("td code", has_text="wheel_torque_nm")
    assert codes.first.inner_text() == "wheel_torque_nm"
    assert codes.first.evaluate("code => getComputedStyle(code).wordBreak") == "normal"
    assert codes.first.locator("wbr").count() == 2
    page.close()


@pytest.mark.parametrize(
    ("place", "picture"),
    [("concepts/why.html", "img[src$='slope.svg']"), ("index.html", "img[src$='report.png']")],
)
@pytest.mark.parametrize(("scheme", "least", "most"), [("light", 200, 255), ("dark", 0, 80)])
def test_pictures_are_as_dark_as_the_page(site, browser, place, picture, scheme, least, most):
    image = pytest.importorskip("PIL.Image")
    page = opened(browser, site, place, DESKTOP, scheme)
    shot = page.locator(picture).screenshot()
    page.close()
    assert least <= np.median(np.asarray(image.open(io.BytesIO(shot)).convert("L"))) <= most


def test_the_questions_begin_on_the_first_screen(site, browser):
    page = opened(browser, site, "index.html", DESKTOP)
    first = page.locator("table tbody tr").first.bounding_box()
    assert first["y"] + first["height"] < DESKTOP["height"]
    assert "pytest" not in page.inner_text(".md-content")
    page.close()


def test_the_search_leaves_out_code_that_makes_data_and_outputs(site):
    index = (site / "search" / "search_index.js").read_text(encoding="utf-8")
    assert "Draft a mapping" in index
    assert "Vector__XXX" not in index
    assert "jitter ms" not in index
