"""The page of a fleet in a browser: filter, sort and figures, on a desk and on a telephone."""

from datetime import datetime, timedelta

import pytest

import weighbridge as wb
from tests.fleet.made_rows import drive, segment, write_learnt
from weighbridge.fleet.schema import PART
from weighbridge.fleet.store import Results, write_part

LONG = "a vehicle whose name is far longer than a telephone is wide, and has_no_place_to_break_" * 2

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Page of sixty legs of three vehicles; their payloads are 5000, 5010, … 5590 kg."""
    home = tmp_path_factory.mktemp("page")
    folder = Results.begun(home / "results").folder
    inner = [f.name for f in PART["segments"].inner.fields]
    begin = datetime.fromisoformat("2026-05-04T06:00:00+00:00")
    for k in range(60):
        key, start = f"{k:032d}", (begin + timedelta(hours=k)).isoformat()
        mass = 13000.0 + 10.0 * k if k % 30 else 21000.0 + k
        row = drive(key, ("truck1", "truck2", LONG)[k % 3], start=start, mass=mass, std=500.0,
                    warnings=["the clock of a signal jumps " + "x" * 150])  # fmt: skip
        told = segment(key, 0, 0.0, 1200.0, mass, 500.0, period_km=[5.0] * 4)
        write_part(folder, key, [row | {"segments": [{n: told[n] for n in inner}]}])
    learnt = {
        "vehicle_id": "truck2", "drives": 4, "weighed": 4, "error_pct": 12.34, "error_std_pct": 4.0,
        "contradicted": True, "refined": "truck2.toml", "findings": "4 drives contradict the file",
        "factor": 0.961, "factor_std": 0.015, "factor_reason": "its empty runs show it",
    }  # fmt: skip
    write_learnt(folder, [learnt])
    path = home / "fleet.html"
    wb.fleet.write_page(wb.fleet.report(folder), path)
    return path


@pytest.fixture(params=[1280, 390], ids=["desk", "telephone"])
def tab(request, browser, page):
    """Tab with the page; it must say nothing wrong and ask for nothing."""
    width = request.param
    context = browser.new_context(
        viewport={"width": width, "height": 844}, has_touch=width < 500, is_mobile=width < 500
    )
    opened = context.new_page()
    wrong, asked = [], []
    opened.on("console", lambda m: wrong.append(m.text))
    opened.on("pageerror", lambda e: wrong.append(str(e)))
    opened.on("request", lambda r: asked.append(r.url))
    opened.goto(page.as_uri())
    opened.wait_for_selector("body[data-ready]")
    yield opened
    assert (wrong, asked) == ([], [page.as_uri()])
    context.close()


def column(tab, key, name):
    """Return the texts of a column of a table, as shown."""
    heads = [text.split(" ↕")[0] for text in tab.locator(f"#{key} th").all_inner_texts()]
    cells = tab.locator(f"#{key} tbody td:nth-child({1 + heads.index(name)})").all_inner_texts()
    return [cell.replace("\u202f", "").replace("\u00a0", " ") for cell in cells]


def test_a_table_sorts_and_filters(tab):
    legs = tab.locator("#legs")
    told = legs.locator(".note")
    assert told.inner_text() == "20 of 60"
    # Newest first, with the payload's ± in sight.
    assert column(tab, "legs", "payload, kg")[:2] == ["5590 ± 980", "5580 ± 980"]
    head = legs.get_by_role("button", name="payload, kg")
    head.click()
    assert column(tab, "legs", "payload, kg")[:3] == ["13030 ± 980", "13000 ± 980", "5590 ± 980"]
    head.click()
    assert column(tab, "legs", "payload, kg")[:2] == ["5010 ± 980", "5020 ± 980"]
    assert legs.locator("th[aria-sort=ascending]").count() == 1
    legs.get_by_role("searchbox").fill("TRUCK2 05-05")
    assert told.inner_text() == "8 of 8"
    assert set(column(tab, "legs", "vehicle")) == {"truck2"}
    legs.get_by_role("searchbox").fill("")
    legs.get_by_role("button", name="Show more").click()
    assert told.inner_text() == "60 of 60"
    assert not legs.get_by_role("button", name="Show more").is_visible()


def test_a_vehicle_has_its_history_by_a_click(tab):
    tab.locator("#learnt td button", has_text="truck2").click()
    assert tab.locator("#history select option:checked").inner_text() == "truck2"
    assert tab.locator("#history p.note").inner_text() == "20 legs, 0 without a mass"
    inked = "c => c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some(x => x > 0)"
    assert tab.locator("#history canvas").evaluate(inked)
    assert column(tab, "learnt", "mean error, %") == ["+12.3 ± 7.8"]
    assert column(tab, "learnt", "masses changed, %") == ["-3.9 ± 2.9"]
    sentences = ["4 drives contradict the file; its empty runs show it"]
    assert column(tab, "learnt", "what was found") == sentences


def test_nothing_scrolls_sideways_but_tables_in_their_frames(tab):
    width = tab.viewport_size["width"]
    assert tab.evaluate("document.documentElement.scrollWidth") == width
    beyond = tab.evaluate(
        "[...document.querySelectorAll('body *')].filter(e => !e.closest('.scroll table') &&"
        " e.getBoundingClientRect().right > innerWidth + 1).map(e => e.tagName + e.className)"
    )
    assert beyond == []
