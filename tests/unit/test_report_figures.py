"""Figures of the report: what is marked, what stays inside, what is taken off, and how it packs."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.contrast import contrast
from tests.unit.test_report import (
    figures,
    make_calibration,
    make_weighing,
    numbers,
    over,
    table,
    written,
)
from tests.unit.test_report_sections import against, driven, launches, loaded_on_the_way
from tests.unit.test_weighing import weighing as weighed_by_rls

from weighbridge import compare
from weighbridge.balance import ForceBalance, Reason
from weighbridge.navigation.geodesy import LocalFrame
from weighbridge.report import mass_figure


def test_a_method_that_does_not_fit_is_marked_in_table_and_figure(tmp_path):
    w = weighed_by_rls()
    methods = [m for m in compare(w) if np.isfinite(m.mass)]
    far = next(m for m in methods if m.method == "hybrid")
    other = replace(far, result=replace(far.result, mass=1.3 * w.mass))
    html = written(tmp_path, [w], comparisons=[[w, other]])
    assert re.search(r"<tr class=marked><td[^>]*>hybrid</td>", html)
    assert html.count("class=marked") == 1
    assert list(table(html, "methods")) == ["rls", "hybrid"]
    (masses,) = over(html, "Mass [kg]")
    marks = {t["y"][0]: t["marker"]["symbol"] for t in masses["data"]}
    assert marks == {"rls": "circle", "hybrid": "x"}
    # Its residuals are of a mass that nobody believes: they are not drawn.
    drawn = {
        t.get("name")
        for f in figures(html).values()
        if "Residual" in f["layout"].get("yaxis", {}).get("title", {}).get("text", "")
        for t in f["data"]
    }
    assert drawn
    assert "hybrid" not in drawn


def test_torques_of_a_calibration_are_drawn_over_minutes(tmp_path):
    made = make_calibration(make_weighing())
    html = written(tmp_path, [], calibration=made)
    figure = next(
        f for f in figures(html).values() if "[min]" in f["layout"]["xaxis"]["title"]["text"]
    )
    last = max(np.nanmax(numbers(trace["x"])) for trace in figure["data"])
    assert last == pytest.approx(made.rows.time[-1] / 60.0, rel=0.02)


def test_methods_that_differ_by_less_than_both_intervals_fit(tmp_path):
    w = weighed_by_rls()
    half = 0.5 * float(np.diff(w.interval(0.95))[0])
    for shift, marked in ((1.35, 0), (1.48, 1)):
        moved = replace(w, method="ekf", result=replace(w.result, mass=w.mass + shift * half))
        html = written(tmp_path, [w], comparisons=[[w, moved]])
        assert html.count("class=marked") == marked


@pytest.fixture(scope="module")
def one_way_round():
    """Circles that begin towards the north-west: headings on both sides of north."""
    t = np.arange(0.0, 1800.0, 0.25)
    return driven(
        20.0 + 6.0 * np.sin(2.0 * np.pi * t / 60.0),
        heading=np.mod(2.0 * np.pi * (t / 240.0 - 0.1), 2.0 * np.pi),
        wind=(3.0, 0.0),
    )


def test_every_mean_of_the_residual_stays_inside_its_figure(tmp_path, one_way_round):
    w = one_way_round
    html = written(tmp_path, [w], comparisons=[compare(w)])
    for axis in ("Speed [km/h]", "Traction force [N]", "Gear [-]", "Heading [deg]"):
        for figure in over(html, axis, "Residual [N]"):
            low, high = figure["layout"]["yaxis"]["range"]
            for trace in figure["data"]:
                if "lines" in trace["mode"]:
                    assert low <= np.nanmin(numbers(trace["y"])), trace["name"]
                    assert np.nanmax(numbers(trace["y"])) <= high, trace["name"]
    figure, _, mean = against(html, "Heading [deg]")
    assert figure["layout"]["xaxis"]["range"] == [0.0, 360.0]
    x, y = numbers(mean["x"]), numbers(mean["y"])
    assert (x[0], x[-1]) == (0.0, 360.0)
    assert y[0] == y[-1]
    assert np.all(np.diff(x) > 0.0)


def test_headings_that_were_not_driven_leave_a_gap(tmp_path):
    speed = launches(80)
    half = speed.size // 2
    heading = np.where(np.arange(speed.size) < half, 0.0, np.radians(180.0))
    _, _, mean = against(written(tmp_path, [driven(speed, heading=heading)]), "Heading [deg]")
    x, y = numbers(mean["x"]), numbers(mean["y"])
    assert_allclose(x[np.isfinite(y)], [0.0, 180.0, 360.0])
    assert np.isnan(y).sum() == 2


def test_slow_forces_explain_the_mean_residual(tmp_path):
    """A rolling resistance above the file's is found, told, and taken off the residual."""
    t = np.arange(0.0, 1200.0, 0.25)
    even = 15.0 - 14.0 * np.cos(2.0 * np.pi * t / 100.0)
    w = driven(np.concatenate((launches(30), even)), extra=60.0)
    raw = float(np.nanmean(w.result.residual[w.result.used]))
    assert raw == pytest.approx(60.0, rel=0.15)
    html = written(tmp_path, [w])
    section = html[html.index('-residuals"><h3>') :]
    lead = re.search(r'<p class="lead">(.*?)</p>', section).group(1)
    whole, slow, left = (int(n.replace("−", "-")) for n in re.findall(r"([+−]?\d+) N", lead))
    assert whole == round(raw)
    assert abs(slow + left - whole) <= 1
    assert abs(left) <= 2
    # What is drawn is what is left.
    _, mean, with_slow = against(html, "Speed [km/h]")
    assert abs(np.nanmedian(numbers(mean["y"]))) < 15.0
    assert np.nanmedian(numbers(with_slow["y"])) == pytest.approx(raw, abs=20.0)


def test_each_load_of_a_drive_is_inside_the_figure_of_the_mass(tmp_path):
    w = loaded_on_the_way()
    figure = mass_figure(w)
    low, high = figure.layout.yaxis.range
    for segment in w.segments:
        assert low < segment.mass < high
    final = next(t for t in figure.data if t.name.startswith("final mass"))
    assert final.x[0] == pytest.approx((w.segments[-1].start - w.drive.start) / 60.0, rel=1e-3)
    # The slope is that of the last load alone.
    (fitted,) = over(written(tmp_path, [w]), "Specific force with rolling [m/s²]")
    x, y = (numbers(fitted["data"][0][axis]) for axis in "xy")
    assert_allclose(np.median(y[x > 0.7] / x[x > 0.7]), w.mass, rtol=0.03)


@pytest.mark.parametrize("metres", [30.0, 400.0, 9e3, 3e5])
def test_a_map_has_a_bar_of_a_round_length(tmp_path, metres):
    w = make_weighing(hours=0.1)
    motion = w.result.balance.motion
    way = np.zeros((motion.time.size, 3))
    way[:, 0] = np.linspace(0.0, metres, motion.time.size)
    balance = ForceBalance(
        motion=replace(motion, position=(LocalFrame(0.97, 0.2, 0.0), way)),
        table=w.result.balance.table,
    )
    html = written(tmp_path, [replace(w, result=replace(w.result, balance=balance))])
    figure = over(html, "East [km]")[0]
    bar = next(t for t in figure["data"] if t.get("name") == "scale")
    length = 1e3 * np.ptp(numbers(bar["x"]))
    assert 0.1 * metres < length <= 0.36 * max(metres, 50.0)
    leading = length / 10.0 ** np.floor(np.log10(1.0001 * length))
    assert min(abs(leading - n) for n in (1.0, 2.0, 5.0)) < 2e-3
    value, unit = figure["layout"]["annotations"][-1]["text"].split()
    assert float(value) * {"m": 1.0, "km": 1e3}[unit] == pytest.approx(length, rel=1e-4)
    north = [numbers(t["y"]).min() for t in figure["data"] if t is not bar]
    assert max(numbers(bar["y"])) < min(north)


@pytest.mark.parametrize("hours", [0.1, 2.0])
def test_a_gap_in_the_mass_is_no_line_and_a_peak_is_drawn(hours):
    """Of a short drive each sample is drawn, of a long one every thirtieth."""
    w = make_weighing(hours=hours)
    minutes = (w.result.time - w.drive.start) / 60.0
    begin, end = minutes[-1] * np.array([0.4, 0.5])
    mass = np.where((minutes > begin) & (minutes < end), np.nan, w.result.running_mass)
    mass[-50] = 3000.0
    drawn = mass_figure(replace(w, result=replace(w.result, running_mass=mass)))
    line = next(t for t in drawn.data if t.name == "running mass")
    x, y = np.asarray(line.x), np.asarray(line.y)
    (gap,) = np.flatnonzero(np.isnan(y))
    assert x[gap - 1] < begin + 1e-3
    assert x[gap + 1] > end - 1e-3
    assert np.nanmax(y) == pytest.approx(3000.0, rel=1e-4)


def variables(html):
    """Colours of the light and of the dark page."""
    blocks = re.findall(r":root \{(.*?)\}", html.replace("#fff;", "#ffffff;"), re.S)
    return [dict(re.findall(r"--(\w+): (#\w{6})\b", block)) for block in blocks]


def test_colours_have_the_contrast_of_wcag_aa(tmp_path):
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    one, w = weighed_by_rls(), make_weighing("every reason")
    reason = w.result.row_reason.copy()
    reason[2000 : 2000 + len(Reason)] = list(Reason)
    w = replace(w, result=replace(w.result, row_reason=reason))
    known = make_calibration(make_weighing())
    html = written(tmp_path, [one, w], calibration=known, comparisons=[compare(one), ()])
    light, dark, paper = variables(html)
    drawn = [t for f in figures(html).values() for t in f["data"]]
    used = [t.get(part, {}).get("color") for t in drawn for part in ("line", "marker")]
    series = {c for c in used if isinstance(c, str) and re.fullmatch(r"#\w{6}", c)}
    assert len(series) > len(Reason)
    for page in (light, dark, light | paper, dark | paper):
        for back in (page["paper"], page["card"]):
            for text in ("ink", "soft", "good", "fair", "bad", "link"):
                assert contrast(page[text], back) >= 4.5, text
            for colour in series:
                assert contrast(colour, back) >= 3.0, colour


def test_three_drives_with_methods_and_calibration_are_less_than_two_megabytes(tmp_path):
    w = [make_weighing(name, hours=1.5) for name in ("one", "two", "three")]
    html = written(
        tmp_path, w, calibration=make_calibration(w[0]),
        comparisons=[[x, replace(x, method="ekf"), replace(x, method="hybrid")] for x in w],
    )  # fmt: skip
    assert len(html.encode()) < 2_000_000


def test_no_trace_has_more_points_than_a_screen_shows(tmp_path):
    """A band goes there and back: twice the points of a line."""
    w = make_weighing(hours=4.0)
    html = written(tmp_path, [w], comparisons=[[w, replace(w, method="ekf")]])
    assert w.result.balance.table.time.size > 20_000
    points = [
        len(numbers(trace["x"]))
        for figure in figures(html).values()
        for trace in figure["data"]
        if trace.get("x") is not None
    ]
    assert 500 < max(points) < 5000


def test_a_page_packs_the_same_on_every_run(tmp_path):
    assert written(tmp_path, [make_weighing()]) == written(tmp_path, [make_weighing()])
