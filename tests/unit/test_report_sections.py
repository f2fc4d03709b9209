"""Sections of the report against truth: what weighed, wind, residuals, methods side by side."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import error
from tests.unit.test_report import GEARINGS, VEHICLE, Elements, figures, make_weighing, numbers
from tests.unit.test_weighing import weighing as weighed_by_rls

from weighbridge import ConfigError, Drive, DriveInfo, Signal, Status, Weighing, compare
from weighbridge.balance import ForceBalance, ForceTable, Reason
from weighbridge.balance.instants import WIND_AT_VEHICLE
from weighbridge.estimators import ESTIMATORS, joint
from weighbridge.navigation.geodesy import LocalFrame
from weighbridge.navigation.motion import Motion
from weighbridge.report import write_report
from weighbridge.report.information_section import (
    Manoeuvre,
    _net_gain,
    information_gained,
    information_section,
    manoeuvres,
)
from weighbridge.report.methods_section import method_style, methods_section
from weighbridge.report.residual_section import (
    WITH_SLOW,
    bin_width,
    binned,
    residual_section,
)
from weighbridge.report.slow_section import LONGEST_ARROW, slow_section, wind_at_vehicle
from weighbridge.report.style import band, blank
from weighbridge.vehicle.model import Provenance

MASS = 1500.0
CAR = replace(VEHICLE, provenance=Provenance(mass_scale_std=0.005, method="joint"))
RATE = 4.0


def driven(
    speed, *, grade=None, heading=None, wind=(0.0, 0.0), reported=(0.0, 0.0), load=None, extra=0.0
):
    """Weigh a car by joint from forces that obey Newton's law.

    ``wind`` and ``reported`` are what blows at the car from north and east [m/s]; ``load`` is
    added to the mass at each row, ``extra`` a force that always holds back [N].
    """
    rng = np.random.default_rng(8)
    n = speed.size
    time = np.arange(n) / RATE
    grade = np.zeros(n) if grade is None else grade
    heading = np.zeros(n) if heading is None else heading
    accel = np.gradient(speed, time)
    gear = np.clip(1 + (speed / 6.0).astype(np.int64), 1, 3)
    gearing = np.array(GEARINGS)[gear - 1]
    line, road = CAR.driveline, CAR.road_load
    rotating = line.wheel_inertia / line.wheel_radius**2 + line.engine_inertia * gearing**2
    specific = accel + 9.80665 * np.sin(grade)

    def against(air):
        return speed + air[0] * np.cos(heading) + air[1] * np.sin(heading)

    def drag(air):
        return 0.6 * road.drag_area * against(air) ** 2

    mass = MASS if load is None else MASS + load
    traction = (
        mass * (specific + 9.80665 * road.rolling_coefficient)
        + rotating * accel
        + drag(wind)
        + extra
        + rng.normal(scale=40.0, size=n)
    )
    reason = np.zeros(n, dtype=np.uint8)
    reason[traction < -200.0] = Reason.BRAKING
    reason[speed < 1.0] = Reason.STANDING
    nowhere = np.full(n, np.nan)
    north = np.cumsum(speed * np.cos(heading)) / RATE
    east = np.cumsum(speed * np.sin(heading)) / RATE
    motion = Motion(
        source="inertial",
        time=time,
        speed=speed,
        accel=accel,
        specific_force=specific,
        grade=grade,
        pitch=grade,
        roll=np.zeros(n),
        heading=heading,
        distance=np.cumsum(speed) / RATE,
        altitude=nowhere,
        position=(LocalFrame(0.9, 0.2, 0.0), np.column_stack([north, east, np.zeros(n)])),
        valid=np.ones(n, dtype=bool),
        specific_force_std=0.03,
        grade_std=np.full(n, 0.002),
        squat=0.0,
        squat_std=0.0,
    )
    table = ForceTable(
        time=time,
        traction_force=traction,
        force_std=np.full(n, 40.0),
        torque=traction / gearing,
        engine_speed=gearing * speed,
        speed=speed,
        accel=accel,
        specific_force=specific,
        grade=grade,
        pitch=grade,
        heading=heading,
        gear=gear,
        gearing=gearing,
        air_speed=against(reported),
        air_density=np.full(n, 1.2),
        fuel_burnt=np.zeros(n),
        reason=reason,
    )
    track = joint.estimate(ForceBalance(motion=motion, table=table), CAR)
    told = np.hypot(*reported) / WIND_AT_VEHICLE
    info = DriveInfo(wind_speed=told or None, wind_from=np.arctan2(reported[1], reported[0]))
    drive = Drive("driven", {"vehicle_speed": Signal("vehicle_speed", time, speed)}, info=info)
    return Weighing(
        drive=drive,
        vehicle=CAR,
        method="joint",
        status=track.status,
        refusal=track.reason,
        result=track,
    )


def launches(count=40, rest=4.0):
    """Starts to 28 km/h at 0.7 to 1.3 m/s^2, stops at 4 m/s^2, and short rests."""
    parts = []
    for rate in np.linspace(0.7, 1.3, count):
        up = np.arange(0.0, 7.8, rate / RATE)
        down = np.arange(7.8, 0.0, -4.0 / RATE)
        parts += [up, down, np.zeros(int(rest * RATE))]
    return np.concatenate(parts)


@pytest.fixture(scope="module")
def round_trip():
    """Drive circles fast, in wind from 320 degrees of which a report knows a part."""
    t = np.arange(0.0, 2400.0, 1.0 / RATE)
    wind = 5.0 * np.cos(np.radians(320.0)), 5.0 * np.sin(np.radians(320.0))
    return {
        share: driven(
            25.0 + 5.0 * np.sin(2.0 * np.pi * t / 60.0),
            heading=np.mod(2.0 * np.pi * t / 300.0, 2.0 * np.pi),
            wind=wind,
            reported=(share * wind[0], share * wind[1]),
        )
        for share in (0.0, 0.5)
    }


def test_launches_weigh_a_drive_of_launches():
    w = driven(launches())
    assert w.mass == pytest.approx(MASS, rel=0.01)
    gained = information_gained(w.result)
    assert gained.gain.sum() == pytest.approx(1.0)
    assert (gained.gain >= 0.0).all()
    assert gained.shares(gained.gain)[Manoeuvre.LAUNCH] > 0.9


def test_hills_weigh_a_drive_at_an_even_speed():
    t = np.arange(0.0, 1200.0, 1.0 / RATE)
    up_and_level = 0.05 * (np.sin(2.0 * np.pi * t / 120.0) > 0.0)
    w = driven(np.full(t.size, 15.0), grade=up_and_level)
    gained = information_gained(w.result)
    shares = gained.shares(gained.gain)
    assert shares.sum() == pytest.approx(1.0)
    # On the level between, the force that is no mass becomes known.
    assert shares[Manoeuvre.HILL] > 0.4
    assert shares[Manoeuvre.HILL] + shares[Manoeuvre.CRUISE] == pytest.approx(1.0, abs=0.01)
    minutes = gained.shares(gained.duration) / 60.0
    assert_allclose(minutes[[Manoeuvre.HILL, Manoeuvre.CRUISE]], 10.0, rtol=0.08)


def test_the_first_manoeuvre_that_holds_is_the_name():
    #        launch, after shift, late, slowing on a hill, hill down, cruise
    speed = np.array([5.0, 15.0, 15.0, 15.0, 15.0, 15.0])
    accel = np.array([1.0, 1.0, 1.0, -1.0, 0.0, 0.1])
    slope = np.array([0.05, 0.0, 0.0, 0.05, -0.03, 0.01])
    named = manoeuvres(np.arange(6.0) * 10.0, speed, accel, slope, np.array([7.0]))
    assert_array_equal(named, [0, 1, 2, 3, 4, 5])


def test_what_only_comes_back_after_a_dip_is_no_gain():
    information = np.array([1.0, 3.0, 0.5, 2.0, 4.0, 4.0, 1.0, 2.0])
    # From the record of 3 to that of 4: raised by 1.5 and 2 in two windows, 1 in all.
    expected = [1.0, 2.0, 0.0, 1.5 / 3.5, 2.0 / 3.5, 0.0, 0.0, 0.0]
    assert_allclose(_net_gain(information), expected)


def loaded_on_the_way():
    """Drive launches, stand a minute while 400 kg are loaded, and drive launches again."""
    leg = launches()
    speed = np.concatenate((leg, np.zeros(int(60.0 * RATE)), leg))
    return driven(speed, load=np.where(np.arange(speed.size) <= leg.size, 0.0, 400.0))


def test_information_is_counted_for_each_load():
    w = loaded_on_the_way()
    assert len(w.segments) == 2
    assert w.mass == pytest.approx(MASS + 400.0, rel=0.02)
    gained = information_gained(w.result)
    first = gained.time < w.segments[1].start
    assert gained.gain.sum() == pytest.approx(1.0)
    assert 0.3 < gained.gain[first].sum() < 0.7


def test_no_information_without_joint():
    section = information_section(make_weighing())
    assert not section.present
    assert "only the method joint" in section.absent
    lost = replace(make_weighing(), result=None, status=Status.MISSING_SIGNALS)
    assert not information_section(lost).missing


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_wind_has_the_sign_of_the_weather(round_trip, share):
    w = round_trip[share]
    wind = wind_at_vehicle(w.result.slow_errors, w.drive)
    assert_allclose(np.median(wind.north), 5.0 * np.cos(np.radians(320.0)), atol=1.0)
    assert_allclose(np.median(wind.east), 5.0 * np.sin(np.radians(320.0)), atol=1.0)
    # It comes from 320 degrees and goes to 140.
    assert_allclose(np.degrees(np.median(wind.blows_to)), 140.0, atol=12.0)
    panels = {p.title.split(",")[0]: p for p in slow_section(w).panels}
    assert "Wind from the north-west" in panels
    blew = next(p for title, p in panels.items() if title.startswith("How the wind blew"))
    tails = [(a.ax, a.ay) for a in blew.figure.layout.annotations if a.showarrow]
    assert 3 < len(tails) <= 12
    # Pixels count downwards: from the tail, right and down is south-east.
    assert_allclose([np.degrees(np.arctan2(-x, y)) for x, y in tails], 140.0, atol=25.0)
    assert max(np.hypot(x, y) for x, y in tails) == pytest.approx(LONGEST_ARROW)
    names = {t.name for t in panels["Wind from the north-west"].figure.data}
    assert ("reported, from east" in names) == (share > 0.0)


def test_residual_is_highest_driving_against_the_wind(round_trip):
    w = round_trip[0.0]
    panel = next(p for p in residual_section(w, ()).panels if "heading" in p.title)
    mean = next(t for t in panel.figure.data if t.name == WITH_SLOW)
    crest = float(mean.x[np.argmax(mean.y)])
    assert abs(crest - 320.0) <= 30.0
    # Drag of 30 m/s less that of 25 m/s, with the car's speed wandering around it.
    at_crest = 0.6 * 0.6 * ((25.0 + 5.0) ** 2 - 25.0**2)
    assert_allclose(max(mean.y), at_crest, rtol=0.2)
    # What the drive told of wind and slow forces is taken off: no crest is left.
    left = next(t for t in panel.figure.data if t.name == "mean and spread")
    assert max(np.abs(left.y)) < 0.1 * at_crest


def test_a_car_that_goes_one_way_tells_no_wind():
    w = driven(launches())
    panels = slow_section(w).panels
    assert any("does not show the wind" in p.title for p in panels)
    assert any("no wind on the map" in p.absent for p in panels)


def test_bins_agree_with_a_loop():
    rng = np.random.default_rng(2)
    x, y = rng.uniform(-25.0, 25.0, 4000), rng.normal(3.0, 2.0, 4000)
    centres, mean, std = binned(x, y, 10.0)
    assert_allclose(centres, [-25.0, -15.0, -5.0, 5.0, 15.0, 25.0][: centres.size])
    for centre, m, s in zip(centres, mean, std, strict=True):
        inside = y[(x >= centre - 5.0) & (x < centre + 5.0)]
        assert_allclose([m, s], [inside.mean(), inside.std(ddof=1)])
    assert_array_equal(binned(np.repeat([1.0, 2.0], 20), np.ones(40), 1.0, True)[0], [1.0, 2.0])


def test_rare_bins_have_no_mean():
    x = np.concatenate((np.full(5000, 1.0), np.full(9, 11.0), np.full(10, 21.0), np.full(12, 31.0)))
    assert_array_equal(binned(x, x, 10.0)[0], [5.0, 35.0])


def test_bins_are_wide_enough_for_the_range():
    assert bin_width(np.linspace(0.0, 60.0, 500), (5.0, 10.0, 20.0)) == 5.0
    assert bin_width(np.linspace(0.0, 130.0, 500), (5.0, 10.0, 20.0)) == 10.0
    assert bin_width(np.linspace(0.0, 9e5, 500), (5.0, 10.0, 20.0)) == 20.0


def test_one_gear_and_no_heading_are_said():
    w = make_weighing()
    table = w.result.balance.table
    balance = replace(w.result.balance, table=replace(table, gear=np.ones_like(table.gear)))
    panels = residual_section(replace(w, result=replace(w.result, balance=balance)), ()).panels
    told = " ".join(p.absent for p in panels)
    assert "there is only one gear" in told
    assert "the heading is not known" in told
    assert sum(p.figure is not None for p in panels) == 2


def test_comparison_gives_what_each_method_gives():
    w = weighed_by_rls()
    methods = compare(w)
    compared = [m for m in ESTIMATORS if ESTIMATORS[m].compared]
    assert [m.method for m in methods] == compared
    styles = [method_style(method) for method in compared]
    assert len(set(styles)) == len(styles)
    assert method_style("of another package") not in styles
    for other in (m for m in methods if not ESTIMATORS[m.method].speed_alone):
        alone = ESTIMATORS[other.method].track(w.result.balance, w.vehicle)
        assert (other.result.mass, other.result.std) == (alone.mass, alone.std)
    assert methods[1] is w
    assert methods[-1].result is None
    assert methods[-1].reason_id == "speed.none_of"


def test_joint_is_compared_without_an_accelerometer_too():
    by_joint = compare(weighed_by_rls(source="speed"))[0]
    assert by_joint.method == "joint"
    assert by_joint.result is not None


def test_methods_are_shown_with_their_intervals_or_why_not():
    w = weighed_by_rls()
    section = methods_section(w, compare(w), 1600.0)
    rows = {row[0]: row[1:] for row in section.table.rows}
    low, high = w.interval(0.95)
    assert rows["rls"][:2] == (f"{w.mass:.0f} kg", f"{low:.0f} to {high:.0f} kg")
    assert rows["rls"][3] == f"{100.0 * (w.mass / 1600.0 - 1.0):+.1f} %".replace("-", "−")
    assert "vehicle_speed" in rows["speed-ekf"][-1]
    masses = section.panels[0].figure
    mark = next(t for t in masses.data if t.y == ("rls",))
    assert rows["rls"][5] == "the answer"
    assert_allclose([mark.x[0] - mark.error_x.arrayminus[0], mark.x[0] + mark.error_x.array[0]],
                    [low, high])  # fmt: skip
    assert "speed-ekf" not in {t.y[0] for t in masses.data}


def links_and_ids(html):
    page = Elements(html)
    links = [link[1:] for link in page.attributes("href") if link.startswith("#")]
    return links, page.attributes("id"), page


@pytest.mark.parametrize("count", [1, 2])
def test_links_lead_to_the_sections_that_are_there(tmp_path, round_trip, count):
    path = tmp_path / "report.html"
    for weighing, has_joint in ((make_weighing(), False), (round_trip[0.0], True)):
        write_report([weighing] * count, path)
        html = path.read_text(encoding="utf-8")
        links, ids, page = links_and_ids(html)
        assert len(ids) == len(set(ids))
        assert set(links) <= set(ids)
        sections = [attrs["id"] for tag, attrs in page.tags if tag == "section"]
        assert links == sections
        for key in ("information", "slow"):
            assert any(link.endswith(key) for link in links) == has_joint
        assert not any(link.endswith("methods") for link in links)
        assert page.matched
        assert len(re.findall(r'<p class="lead">[^<]+\.</p>', html)) == len(sections)
        assert page.text.count("only the method joint keeps") == (0 if has_joint else count)


def test_page_with_a_comparison_shows_every_method(tmp_path):
    w = weighed_by_rls()
    w.report(tmp_path / "report.html", compare=True)
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    links, _, page = links_and_ids(html)
    assert "drive-1-methods" in links
    weighed = {m.method for m in compare(w) if m.status == "converged"}
    assert {"joint", "rls", "robust-rls", "hybrid"} <= weighed
    assert f"{len(weighed)} of {len(compare(w))} methods found a mass" in page.text
    drawn = {t.get("name") for f in figures(html).values() for t in f["data"]}
    assert weighed <= drawn


def test_comparisons_must_be_as_many_as_drives(tmp_path):
    with error(ConfigError, "r.html 1 2"):
        write_report([make_weighing()] * 2, tmp_path / "r.html", comparisons=[()])


def test_mass_of_the_start_does_not_judge_a_drive_whose_load_changed(tmp_path):
    w = loaded_on_the_way()
    w = replace(w, drive=replace(w.drive, info=replace(w.drive.info, mass=MASS)))
    write_report([w], tmp_path / "report.html")
    page = Elements((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "The load changed at a stop" in page.text
    assert "% off" not in page.text


def test_disturbance_keeps_its_unit_and_band(tmp_path, round_trip):
    w = round_trip[0.0]
    write_report([w], tmp_path / "report.html")
    drawn = figures((tmp_path / "report.html").read_text(encoding="utf-8"))
    forces = [f for f in drawn.values() if "Force against" in f["layout"]["yaxis"]["title"]["text"]]
    assert len(forces) == 2
    slow = w.result.slow_errors
    for figure, force, std in zip(
        forces,
        (slow.disturbance, slow.resistance),
        (slow.disturbance_std, slow.resistance_std),
        strict=True,
    ):
        area, middle = (numbers(trace["y"]) for trace in figure["data"])
        # There along the low edge, back along the high one.
        low, high = area[: area.size // 2], area[area.size // 2 :][::-1]
        assert_allclose(0.5 * (low + high), middle, atol=0.02)
        assert np.nanmax(middle) == pytest.approx(force.max(), rel=1e-4, abs=0.02)
        assert np.nanmedian(high - low) == pytest.approx(2 * 1.96 * np.median(std), rel=0.1)


def test_a_band_is_one_closed_area_for_each_stretch_that_is_known():
    """A gap in the grade once drew one wedge across the whole plot."""
    x = np.arange(8.0)
    low = np.array([1.0, 2.0, np.nan, 3.0, 4.0, 5.0, np.nan, np.nan])
    high = low + 10.0
    high[5] = np.nan
    figure = blank("x", "y")
    band(figure, x, low, high, "95 % band")
    (area,) = figure.data
    assert area.fill == "toself"
    gap = np.nan
    assert_array_equal(area.x, [0.0, 1.0, 1.0, 0.0, gap, 3.0, 4.0, 4.0, 3.0])
    assert_array_equal(area.y, [1.0, 2.0, 12.0, 11.0, gap, 3.0, 4.0, 14.0, 13.0])


def test_a_band_of_nothing_is_empty():
    figure = blank("x", "y")
    band(figure, np.arange(3.0), np.full(3, np.nan), np.ones(3), "95 % band")
    assert len(figure.data[0].x) == 0
