"""The report in a browser: it draws without a request, on a desk, a telephone and paper."""

import re

import pytest
from tests.unit.test_report import make_calibration, make_weighing

from weighbridge.report import write_report

PAPER_WIDTH, PAPER_HEIGHT = (int((mm - 20) / 25.4 * 96) for mm in (210, 297))
"""A4 within margins of 10 mm [px]."""
SHOWN = "[...document.querySelectorAll('.plot')].filter(p => !p.closest('details:not([open])'))"


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    drives = [make_weighing("one"), make_weighing("two")]
    write_report(drives, path, calibration=make_calibration(drives[0]))
    return path


def opened(browser, report, width, **options):
    context = browser.new_context(viewport={"width": width, "height": 844}, **options)
    tab = context.new_page()
    told = {"wrong": [], "asked": []}
    tab.on("console", lambda m: told["wrong"].append(m.text))
    tab.on("pageerror", lambda e: told["wrong"].append(str(e)))
    tab.on("request", lambda r: told["asked"].append(r.url))
    tab.goto(report.as_uri())
    tab.locator(".plot").first.scroll_into_view_if_needed()
    tab.wait_for_selector(".plot .main-svg")
    return tab, told


pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]


@pytest.mark.parametrize("width", [1280, 390])
def test_figures_are_drawn_when_seen_and_nothing_is_asked_for(browser, report, width):
    tab, told = opened(browser, report, width, has_touch=width < 500)
    shown = tab.evaluate(f"{SHOWN}.map(p => p.id)")
    first = tab.evaluate("document.querySelectorAll('.plot[data-drawn]').length")
    assert 0 < first < len(shown)
    for key in shown:
        tab.locator(f"#{key}").scroll_into_view_if_needed()
        tab.wait_for_selector(f"#{key} .main-svg")
    assert tab.evaluate("document.querySelectorAll('.plot[data-drawn]').length") == len(shown)
    assert tab.evaluate("document.documentElement.scrollWidth") == width
    assert [url for url in told["asked"] if not url.startswith(("file:", "data:", "blob:"))] == []
    assert told["wrong"] == []


def test_paper_has_one_page_for_the_answer_and_at_most_six_more(browser, report):
    tab, told = opened(browser, report, 1280)
    pdf = tab.pdf(format="A4", prefer_css_page_size=False)
    assert 2 <= len(re.findall(rb"/Type\s*/Page[^s]", pdf)) <= 7
    # What is folded is not printed; what is open is drawn whole.
    assert tab.evaluate(f"{SHOWN}.filter(p => !p.dataset.drawn).length") == 0
    folded = "document.querySelectorAll('details:not([open]) .plot[data-drawn]').length"
    assert tab.evaluate(folded) == 0
    assert told["wrong"] == []


def test_the_first_page_of_paper_has_the_answer_and_the_first_figure(browser, report):
    tab, _ = opened(browser, report, PAPER_WIDTH)
    tab.emulate_media(media="print")
    tab.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    tab.wait_for_selector(".plot[data-drawn=paper]")
    first = "document.querySelector('nav + section')"
    assert tab.evaluate(f"getComputedStyle({first}).breakBefore") == "auto"
    bottom = "document.querySelector('figure').getBoundingClientRect().bottom + scrollY"
    assert tab.evaluate(bottom) <= PAPER_HEIGHT


def test_keys_move_zoom_and_reset_a_figure(browser, report):
    tab, _ = opened(browser, report, 1280)
    place = tab.locator(".plot").first
    place.focus()
    reach = "document.querySelector('.plot').layout.xaxis.range.map(Number)"
    low, high = tab.evaluate(reach)
    tab.keyboard.press("+")
    tab.wait_for_timeout(100)
    nearer = tab.evaluate(reach)
    assert nearer[1] - nearer[0] == pytest.approx((high - low) / 1.5)
    tab.keyboard.press("ArrowRight")
    tab.wait_for_timeout(100)
    assert tab.evaluate(reach)[0] > nearer[0]
    tab.keyboard.press("0")
    tab.wait_for_timeout(100)
    assert tab.evaluate(reach) == pytest.approx([low, high])


def test_the_dark_setting_changes_text_and_paper(browser, report):
    tab, _ = opened(browser, report, 1280, color_scheme="dark")
    colour = "getComputedStyle(document.querySelector('.plot .xtick text')).fill"
    dark = tab.evaluate(colour)
    tab.emulate_media(color_scheme="light")
    tab.wait_for_timeout(200)
    assert tab.evaluate(colour) != dark
