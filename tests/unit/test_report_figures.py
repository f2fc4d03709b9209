"""Figures of the report: what is marked, what stays inside, what is taken off, and how it packs."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.contrast import contrast
from tests.unit.test_report import (
    MASS,
    figures,
    make_calibration,
    make_weighing,
    numbers,
    written,
)
from tests.unit.test_report_sections import driven, launches, loaded_on_the_way
from tests.unit.test_weighing import weighing as weighed_by_rls

from weighbridge import compare
from weighbridge.balance import Reason
from weighbridge.report.calibration_panels import GEAR_COLOURS, sequence_panel
from weighbridge.report.document import packed
from weighbridge.report.maps import positions, track_map
from weighbridge.report.mass_section import fit_panel, mass_panel
from weighbridge.report.methods_section import METHOD_STYLES, methods_section
from weighbridge.report.residual_section import WITH_SLOW, residual_section, slow_force
from weighbridge.report.style import REACH, REASON_STYLE
from weighbridge.report.thinning import LINE_POINTS, single


def test_a_method_that_does_not_fit_is_marked_in_table_and_figure(tmp_path):
    w = weighed_by_rls()
    methods = [m for m in compare(w) if np.isfinite(m.mass)]
    far = next(m for m in methods if m.method == "hybrid")
    other = replace(far, result=replace(far.result, mass=1.3 * w.mass))
    section = methods_section(w, [w, other], None)
    assert section.table.marked == (1,)
    assert [row[5] for row in section.table.rows] == ["the answer", "does not fit"]
    marks = {t.y[0]: t.marker.symbol for t in section.panels[0].figure.data}
    assert marks == {"rls": "circle", "hybrid": "x"}
    assert "1 does not fit" in section.panels[0].title
    names = [t.name for t in section.panels[1].figure.data]
    assert names == ["rls", "hybrid (does not fit)"]
    html = written(tmp_path, [w], comparisons=[[w, other]])
    assert re.search(r"<tr class=marked><td[^>]*>hybrid</td>", html)
    assert html.count("class=marked") == 1
    # Its residuals are of a mass that nobody believes: they are not drawn.
    drawn = {t.name for p in residual_section(w, [w, other]).panels if p.figure
             for t in p.figure.data}  # fmt: skip
    assert "hybrid" not in drawn


def test_torques_of_a_calibration_are_drawn_over_minutes():
    made = make_calibration(make_weighing())
    figure = sequence_panel(made).figure
    last = max(np.nanmax(np.asarray(trace.x, float)) for trace in figure.data)
    assert last == pytest.approx(made.rows.time[-1] / 60.0, rel=0.02)


def test_methods_that_differ_by_less_than_both_intervals_fit():
    w = weighed_by_rls()
    half = 0.5 * float(np.diff(w.interval(0.95))[0])
    for shift, marked in ((1.35, ()), (1.48, (1,))):
        moved = replace(w, method="ekf", result=replace(w.result, mass=w.mass + shift * half))
        assert methods_section(w, [w, moved], None).table.marked == marked


@pytest.fixture(scope="module")
def one_way_round():
    """Circles that begin towards the north-west: headings on both sides of north."""
    t = np.arange(0.0, 1800.0, 0.25)
    return driven(
        20.0 + 6.0 * np.sin(2.0 * np.pi * t / 60.0),
        heading=np.mod(2.0 * np.pi * (t / 240.0 - 0.1), 2.0 * np.pi),
        wind=(3.0, 0.0),
    )


def test_every_mean_of_the_residual_stays_inside_its_figure(one_way_round):
    w = one_way_round
    for panel in residual_section(w, compare(w)).panels:
        if panel.figure is None:
            continue
        low, high = panel.figure.layout.yaxis.range
        for trace in panel.figure.data:
            if "lines" in trace.mode:
                assert low <= np.nanmin(numbers(trace.y)), trace.name
                assert np.nanmax(numbers(trace.y)) <= high, trace.name
    figure = panel.figure
    assert list(figure.layout.xaxis.range) == [0.0, 360.0]
    mean = next(t for t in figure.data if t.name == WITH_SLOW)
    assert mean.x[0] == 0.0
    assert mean.x[-1] == 360.0
    assert mean.y[0] == mean.y[-1]
    assert np.all(np.diff(mean.x) > 0.0)


def test_headings_that_were_not_driven_leave_a_gap():
    speed = launches(80)
    half = speed.size // 2
    heading = np.where(np.arange(speed.size) < half, 0.0, np.radians(180.0))
    panels = residual_section(driven(speed, heading=heading), ()).panels
    panel = next(p for p in panels if "heading" in p.title)
    mean = next(t for t in panel.figure.data if t.name == WITH_SLOW)
    assert_allclose(mean.x[np.isfinite(mean.y)], [0.0, 180.0, 360.0])
    assert np.isnan(mean.y).sum() == 2


def test_slow_forces_explain_the_mean_residual():
    """A rolling resistance above the file's is found, told, and taken off the residual."""
    t = np.arange(0.0, 1200.0, 0.25)
    even = 15.0 - 14.0 * np.cos(2.0 * np.pi * t / 100.0)
    w = driven(np.concatenate((launches(30), even)), extra=60.0)
    table = w.result.balance.table
    force = slow_force(w.result, w.vehicle)
    assert force.shape == table.time.shape
    known = w.result.used & np.isfinite(w.result.residual)
    raw, left = w.result.residual[known], (w.result.residual - force)[known]
    assert np.mean(raw) == pytest.approx(60.0, rel=0.15)
    assert abs(np.mean(left)) < 2.0
    lead = residual_section(w, ()).lead
    told = [int(n.replace("−", "-")) for n in re.findall(r"([+−]?\d+) N", lead)]
    assert told == [round(np.mean(raw)), round(np.mean(force[known])), round(np.mean(left))]
    assert not slow_force(make_weighing().result, make_weighing().vehicle).any()


def test_each_load_of_a_drive_is_inside_the_figure_of_the_mass():
    w = loaded_on_the_way()
    figure = mass_panel(w, None).figure
    low, high = figure.layout.yaxis.range
    for segment in w.segments:
        assert low < segment.mass < high
    final = next(t for t in figure.data if t.name.startswith("final mass"))
    assert final.x[0] == pytest.approx((w.segments[-1].start - w.drive.start) / 60.0, rel=1e-3)
    # The slope is that of the last load alone.
    dots = fit_panel(w).figure.data[0]
    assert_allclose(np.median(dots.y[dots.x > 0.7] / dots.x[dots.x > 0.7]), w.mass, rtol=0.03)


@pytest.mark.parametrize("metres", [30.0, 400.0, 9e3, 3e5])
def test_a_map_has_a_bar_of_a_round_length(metres):
    track = positions(make_weighing(hours=0.1))
    scale = metres / 1e3 / max(np.ptp(track.east), np.ptp(track.north))
    track = replace(track, east=scale * track.east, north=scale * track.north)
    figure = track_map(track)
    bar = next(t for t in figure.data if t.name == "scale")
    length = 1e3 * (bar.x[1] - bar.x[0])
    assert 0.1 * metres < length <= 0.36 * max(metres, 50.0)
    leading = length / 10.0 ** np.floor(np.log10(1.0001 * length))
    assert min(abs(leading - n) for n in (1.0, 2.0, 5.0)) < 1e-3
    said = figure.layout.annotations[-1].text
    value, unit = said.split()
    assert float(value) * {"m": 1.0, "km": 1e3}[unit] == pytest.approx(length)


def variables(html):
    """Colours of the light and of the dark page."""
    blocks = re.findall(r":root \{(.*?)\}", html.replace("#fff;", "#ffffff;"), re.S)
    return [dict(re.findall(r"--(\w+): (#\w{6})\b", block)) for block in blocks]


def test_colours_have_the_contrast_of_wcag_aa(tmp_path):
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    html = written(tmp_path, [make_weighing()])
    light, dark, paper = variables(html)
    series = {c for c, _ in METHOD_STYLES} | {c for c, _ in REASON_STYLE.values()}
    series |= set(GEAR_COLOURS)
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
    assert w.result.balance.table.time.size > 10 * LINE_POINTS
    points = [
        len(numbers(trace["x"]))
        for figure in figures(html).values()
        for trace in figure["data"]
        if trace.get("x") is not None
    ]
    assert LINE_POINTS / 2 < max(points) <= 2 * LINE_POINTS + 10


def test_a_page_packs_the_same_on_every_run():
    assert packed("figures") == packed("figures")
    assert packed("figures") != packed("figure")


def test_numbers_keep_sixteen_bits():
    rng = np.random.default_rng(6)
    values = rng.normal(scale=1e3, size=5000) * 10.0 ** rng.integers(-8, 8, 5000)
    assert_allclose(single(values), values, rtol=2.0**-16)
    assert not np.any(single(values).view(np.uint32) & 0xFF)
    special = np.array([np.nan, np.inf, -np.inf, 0.0, MASS])
    np.testing.assert_array_equal(single(special), special.astype(np.float32))


def test_every_kind_of_sample_has_its_own_mark():
    assert len(set(REASON_STYLE.values())) == len(Reason)
    assert pytest.approx(1.96, abs=1e-3) == REACH
