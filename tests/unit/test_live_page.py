"""The page of live weighings: what it hands out, what it refuses, that it does not grow."""

import contextlib
import http.client
import json
import math
import re
import threading
from dataclasses import replace
from importlib.resources import files

import pytest
from tests.noted import error, noted
from tests.unit.made_weighings import NAMES, drive, rests, weighing

from weighbridge import ConfigError
from weighbridge.live import Alert, Page
from weighbridge.live.outputs.page import MOST, WINDOW, History

pytest.importorskip("starlette", reason="starlette is not installed")
pytest.importorskip("uvicorn", reason="uvicorn is not installed")

STATIC = files("weighbridge.live.outputs") / "static"


@pytest.fixture
def page():
    with contextlib.closing(Page(port=0)) as served:
        yield served


@pytest.fixture(scope="module")
def still():
    """A page that is told nothing."""
    with contextlib.closing(Page(port=0)) as served:
        yield served


def port_of(page):
    return int(page.name.rstrip("/").rpartition(":")[2])


def ask(page, path="/", method="GET", host=None, headers=()):
    connection = http.client.HTTPConnection("127.0.0.1", port_of(page), timeout=20)
    connection.putrequest(method, path, skip_host=True)
    connection.putheader("Host", host or f"127.0.0.1:{port_of(page)}")
    for name, value in headers:
        connection.putheader(name, value)
    connection.endheaders()
    return connection, connection.getresponse()


def got(page, *args, **kwargs):
    connection, response = ask(page, *args, **kwargs)
    body = response.read().decode()
    connection.close()
    return response.status, dict(response.getheaders()), body


def news(response):
    """What the stream tells next."""
    while True:
        line = response.readline().decode()
        assert line, "the stream has ended"
        if line.startswith("data: "):
            return json.loads(line.removeprefix("data: "))


# What is handed out


def test_everything_the_page_names_is_there_and_nothing_of_others(still):
    status, headers, body = got(still)
    assert status == 200
    assert headers["content-type"] == "text/html; charset=utf-8"
    named = re.findall(r'(?:href|src)="([^"]+)"', body)
    assert len(named) == 5
    for path in named:
        assert got(still, f"/{path}")[0] == 200, path
    for name in ("index.html", "page.css", "page.js"):
        assert "//" not in re.sub(r"(?m)//.*$", "", (STATIC / name).read_text("utf-8")), name
    assert "style=" not in body
    assert not re.search(r"<script>|\son\w+=", body)


def test_a_strict_policy_is_in_every_answer(still):
    for path in ("/", "/page.js", "/nothing", "/uplot/uPlot.min.css"):
        headers = got(still, path)[1]
        policy = headers["content-security-policy"]
        assert policy.startswith("default-src 'none'; script-src 'self'; style-src 'self'")
        assert "unsafe" not in policy
        assert "form-action 'none'" in policy
        assert headers["x-content-type-options"] == "nosniff"
        assert "access-control-allow-origin" not in headers
        assert "server" not in headers


def test_the_plot_library_has_its_licence_and_version_beside_it():
    assert "The MIT License" in (STATIC / "uplot" / "LICENSE").read_text()
    version = re.search(r"uPlot (\S+),", (STATIC / "uplot" / "README.md").read_text())[1]
    assert f"(v{version})" in (STATIC / "uplot" / "uPlot.iife.min.js").read_text()[:100]


def test_files_beside_the_page_are_not_handed_out(still):
    for path in ("/uplot/LICENSE", "/../page.py", "/%2e%2e/page.py", "/uplot/", "/index.html"):
        assert got(still, path)[0] == 404, path


# What is refused


@pytest.mark.parametrize(
    "method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "CONNECT", "TRACE"]
)
@pytest.mark.parametrize("path", ["/", "/events", "/tare", "/page.js"])
def test_no_request_but_get_is_answered(still, method, path):
    status, headers, _ = got(still, path, method)
    assert status == 405
    assert headers["allow"] == "GET, HEAD"


def test_no_route_takes_anything_but_get():
    from weighbridge.live.outputs.page import _Newest, make_app

    app = make_app(_Newest(), "127.0.0.1", ())
    assert len(app.routes) == 7
    for route in app.routes:
        assert route.methods == {"GET", "HEAD"}


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "192.168.1.5", "[::2]"]
)
def test_a_name_that_is_not_this_machine_is_refused(still, host):
    for path in ("/", "/events"):
        assert got(still, path, host=host)[0] == 421


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:1", "127.0.0.1", "[::1]:8765"])
def test_names_of_this_machine_are_answered(still, host):
    assert got(still, host=host)[0] == 200


def test_two_names_are_refused(still):
    assert got(still, headers=[("Host", "evil.example")])[0] in (400, 421)


def test_on_every_address_addresses_and_own_names_are_answered_and_others_not():
    with contextlib.closing(Page("0.0.0.0", 0, names=("van.home",))) as named:
        for host in ("192.168.1.5", "[fe80::1]:80", "van.home:8765", "localhost"):
            assert got(named, host=host)[0] == 200, host
        assert got(named, host="evil.example")[0] == 421


# Uvicorn leaves a socket that could not be bound to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_port_that_is_taken_is_told_in_a_sentence(still):
    with error(ConfigError, "127.0.0.1"):
        Page(port=port_of(still))
    with error(ConfigError, "203.0.113.7:0"):
        Page("203.0.113.7", 0)


# What is told


def test_the_stream_tells_the_newest_weighing_and_the_points_so_far(page):
    told = list(drive(300))
    for w in told[:200]:
        page.show(w)
    connection, response = ask(page, "/events")
    assert response.getheader("content-type").startswith("text/event-stream")
    first = news(response)
    assert first["weighing"] == json.loads(json.dumps(told[199].to_dict()))
    assert first["points"]["fresh"]
    assert first["points"]["time"] == [float(k) for k in range(200)]
    assert first["points"]["mass"][:60] == [None] * 60
    for w in told[200:]:
        page.show(w)
    times = []
    while not times or times[-1] != 299.0:
        found = news(response)
        assert not found["points"]["fresh"]
        times += found["points"]["time"]
    assert times == [float(k) for k in range(200, 300)]
    connection.close()


def test_closing_ends_the_streams_and_the_thread():
    page = Page(port=0)
    page.show(weighing())
    connection, response = ask(page, "/events")
    news(response)
    page.close()
    assert not page._thread.is_alive()
    assert "data:" not in response.read().decode()
    connection.close()


# What does not grow


def test_points_are_bounded_by_the_window_and_evenly_spaced():
    history, one = History(), weighing()
    for k in range(36_000):
        history.add(replace(one, time=0.1 * k))
        assert len(history) <= MOST
    found = history.since(0)
    assert len(found["time"]) == MOST
    assert found["time"][-1] == pytest.approx(3599.0)
    gaps = [b - a for a, b in zip(found["time"], found["time"][1:], strict=False)]
    assert min(gaps) > 0.99
    assert max(gaps) < 1.01


def test_points_older_than_the_window_go():
    history = History()
    history.add(weighing(0.0))
    history.add(weighing(WINDOW + 5.0))
    assert history.since(0)["time"] == [WINDOW + 5.0]


def test_pages_told_bit_by_bit_and_at_once_hold_the_same():
    history = History(window=50.0, most=50)
    held, number = [], 0
    # The clock begins anew once.
    for k, time in enumerate([*range(300), *range(10, 90)]):
        history.add(weighing(float(time)))
        if k % 7 == 0 or k == 379:
            told = history.since(number)
            held = [*([] if told["fresh"] else held), *told["time"]]
            held = [t for t in held if t >= held[-1] - 50.0][-50:]
            number = history.number
    assert held == history.since(0)["time"]
    assert held[-1] == 89.0


def test_a_weighing_without_a_time_adds_no_point():
    history = History()
    history.add(weighing(math.nan))
    assert history.since(0) == {"fresh": True, "time": [], "mass": [], "low": [], "high": []}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_two_hours_of_replay_do_not_let_the_page_grow(page, browser):
    context = browser.new_context(viewport={"width": 390, "height": 844})
    tab = context.new_page()
    wrong, asked = [], []
    tab.on("console", lambda m: wrong.append(m.text))
    tab.on("pageerror", lambda e: wrong.append(str(e)))
    tab.on("request", lambda r: asked.append(r.url))
    told = iter(drive(7201))
    page.show(next(told))
    tab.goto(page.name)
    session = context.new_cdp_session(tab)
    sizes = []
    for hour in (1, 2):
        for k in range(3600):
            page.show(next(told))
            # So that the page takes it in some hundred pieces.
            if k % 60 == 0:
                threading.Event().wait(0.02)
        driven = "60 min" if hour == 1 else "2.0 h"
        while tab.inner_text("#driven") != driven:
            tab.wait_for_timeout(100)
        session.send("HeapProfiler.collectGarbage")
        points = tab.evaluate("document.documentElement.dataset.points")
        elements = tab.evaluate("document.querySelectorAll('*').length")
        heap = session.send("Runtime.getHeapUsage")["usedSize"]
        sizes.append((int(points), elements, heap))
    assert [s[0] for s in sizes] == [MOST, MOST]
    assert sizes[0][1] == sizes[1][1]
    assert sizes[1][2] < 1.2 * sizes[0][2]
    assert 2000 < int(tab.inner_text("#mass")) < 2200
    assert tab.evaluate("document.documentElement.scrollWidth") == 390
    assert wrong == []
    assert {url.removeprefix(page.name) for url in asked} <= {
        "", "events", "page.js", "page.css", "icon.svg", "uplot/uPlot.iife.min.js",
        "uplot/uPlot.min.css",
    }  # fmt: skip


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_names_that_are_markup_are_shown_as_text(page, browser):
    page.show(weighing(vehicle="<img src=x onerror=alert(1)>", problems=(noted("<b>bold</b>"),)))
    tab = browser.new_page()
    tab.goto(page.name)
    tab.wait_for_selector("#notes li")
    assert tab.inner_text("#vehicle") == "<img src=x onerror=alert(1)>"
    assert tab.inner_text("#notes li") == "<b>bold</b>"
    assert tab.query_selector("#vehicle img") is None


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_the_chart_begins_with_a_mass_and_a_missing_limit_is_explained(page, browser):
    page.show(weighing(mass=math.nan, std=math.nan, gross=None))
    tab = browser.new_page()
    tab.goto(page.name)
    tab.wait_for_function("document.getElementById('mass').textContent === '–'")
    tab.wait_for_selector("#no-points")
    assert tab.query_selector("canvas") is None
    assert "no permitted mass in the vehicle file" in tab.inner_text("#no-limit")
    assert not tab.is_visible("#overload")
    page.show(weighing(time=301.0, tared=2150.0))
    tab.wait_for_selector("canvas")
    assert not tab.is_visible("#no-points")
    assert tab.inner_text("#payload-name") == "Payload since the tare"
    assert tab.inner_text("#payload") == "−50 kg"
    assert tab.is_visible("#overload")


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_before_a_mass_a_phone_shows_signals_and_the_way_to_5_percent_and_then_folds(page, browser):
    nothing = {"mass": math.nan, "std": math.nan, "progress": 0.0}
    page.show(weighing(**nothing, progress_to_5=0.4))
    tab = browser.new_page(viewport={"width": 390, "height": 844})
    tab.goto(page.name)
    tab.wait_for_selector("#signals tr")
    assert tab.inner_text("#learnt") == "40 %"
    assert "± 5 %" in tab.inner_text("#wanted")
    assert not tab.is_visible("#parked")
    page.show(weighing(301.0, parked=True, signals=rests()))
    tab.wait_for_selector("#signals tr", state="hidden")
    assert tab.inner_text("#learnt") == "85 %"
    assert "± 2 %" in tab.inner_text("#wanted")
    assert tab.is_visible("#parked")
    assert tab.inner_text("#signals-brief") == f"0 of {len(NAMES)} come"
    assert tab.evaluate("document.documentElement.scrollWidth") == 390


def test_a_settled_weighing_that_is_a_little_older_clears_no_chart():
    history = History()
    for time in (100.0, 101.0, 99.5, 102.0):
        history.add(weighing(time))
    assert history.since(0)["time"] == [100.0, 101.0, 102.0]
    history.add(weighing(10.0))
    assert history.since(0)["time"] == [10.0]


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize("width", [390, 1280])
def test_an_active_alert_stands_above_the_mass(page, browser, width):
    told = Alert(2000.0).state(weighing())
    states = [replace(told, active=active, probability=0.98) for active in (True, False)]
    page.show(weighing(gross=2000.0, alerts=(states[0],)))
    tab = browser.new_page(viewport={"width": width, "height": 844})
    tab.goto(page.name)
    tab.wait_for_selector("#alert:not([hidden])")
    assert "2000 kg" in tab.inner_text("#alert")
    assert "98 %" in tab.inner_text("#alert")
    bottom = "id => document.getElementById(id).getBoundingClientRect()"
    assert tab.evaluate(f"({bottom})('alert').bottom <= ({bottom})('mass').top")
    assert tab.evaluate("document.documentElement.scrollWidth") == width
    page.show(weighing(time=301.0, gross=2000.0, alerts=(states[1],)))
    tab.wait_for_selector("#alert", state="hidden")
