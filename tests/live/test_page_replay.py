"""The page in a browser while an hour of driving is replayed as fast as it goes."""

import contextlib
import itertools
import threading
from dataclasses import replace

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.live import Page
from weighbridge.live.outputs.page import MOST
from weighbridge.signals import LONGEST_STEP

pytest.importorskip("starlette", reason="starlette is not installed")
pytest.importorskip("uvicorn", reason="uvicorn is not installed")

STOP = 300.0
"""Between two drives [s]."""


def hour(car, drive):
    """Weighings of two drives, one each second, then those of the second at later times."""
    scale, span = wb.LiveScale(car, info=drive.info, step=LONGEST_STEP), drive.duration + STOP
    for shift in (0.0, span):
        told = []
        for start in np.arange(drive.start, drive.end, 1.0):
            part = drive.between(start, start + 1.0)
            scale.update_block({n: (s.time + shift, s.values) for n, s in part.signals.items()})
            told.append(scale.weighing())
            yield told[-1]
    for later in itertools.count(span, span):
        for w in told:
            yield replace(w, time=w.time + later, newest=w.newest + later)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_an_hour_of_replay_does_not_let_the_page_grow(car, loaded, browser, monkeypatch):
    monkeypatch.setattr("weighbridge.live.outputs.page._GLANCE", 0.02)
    context = browser.new_context(viewport={"width": 390, "height": 844})
    tab, wrong, sizes = context.new_page(), [], []
    tab.on("console", lambda m: wrong.append(m.text))
    tab.on("pageerror", lambda e: wrong.append(str(e)))
    with contextlib.closing(Page(port=0)) as page:
        tab.goto(page.name)
        session = context.new_cdp_session(tab)
        told = hour(car, loaded.drive)
        for k in range(3600):
            weighing = next(told)
            page.show(weighing)
            if k % 60 == 0:
                threading.Event().wait(0.02)
            if k % 900 < 899:
                continue
            mass = f"{weighing.mass:.0f}"
            while tab.inner_text("#mass") != mass:
                tab.wait_for_timeout(100)
            session.send("HeapProfiler.collectGarbage")
            points = tab.evaluate("document.documentElement.dataset.points")
            elements = tab.evaluate("document.querySelectorAll('*').length")
            heap = session.send("Runtime.getHeapUsage")["usedSize"]
            sizes.append((int(points), elements, heap))
        assert tab.evaluate("document.documentElement.scrollWidth") == 390
    assert wrong == []
    # The window is full after half an hour; notes of what is looked at come and go.
    points, elements, heaps = zip(*sizes, strict=True)
    assert max(points) <= MOST
    assert points[-1] < 1.2 * points[1]
    assert elements[-1] < elements[0] + 20
    assert heaps[-1] < 1.2 * heaps[0]
