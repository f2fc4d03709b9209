"""Sections of the report against truth: what weighed, wind, residuals, methods side by side."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.noted import error
from tests.unit.test_report import (
    GEARINGS,
    VEHICLE,
    Elements,
    figures,
    make_weighing,
    numbers,
    over,
    table,
    written,
)
from tests.unit.test_weighing import weighing as weighed_by_rls

from weighbridge import ConfigError, Drive, DriveInfo, Signal, Weighing, compare
from weighbridge.balance import ForceBalance, ForceTable, Reason
from weighbridge.customary import shown_in
from weighbridge.estimators import ESTIMATORS
from weighbridge.navigation import Motion
from weighbridge.navigation.geodesy import LocalFrame
from weighbridge.report import write_report
from weighbridge.vehicle import Provenance

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
    forces = ForceTable(
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
    track = ESTIMATORS["joint"].track(ForceBalance(motion=motion, table=forces), CAR)
    # A vehicle feels half of the wind that a weather station measures 10 m high.
    told = np.hypot(*reported) / 0.5
    info = DriveInfo(wind_speed=told or None, wind_from=np.arctan2(reported[1], reported[0]))
    drive = Drive("driven", {"vehicle_speed": Signal("vehicle_speed", time, speed)}, info=info)
    return Weighing(
        drive=drive,
        vehicle=CAR,
        seen=CAR,
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


def shares(html):
    """Return information and time of each manoeuvre [%], and its minutes."""
    return {
        name: tuple(float(cell.rstrip(" %")) for cell in (row[0], row[1], row[3]))
        for name, row in table(html, "information").items()
    }


def test_launches_weigh_a_drive_of_launches(tmp_path):
    w = driven(launches())
    assert w.mass == pytest.approx(MASS, rel=0.01)
    gained = shares(written(tmp_path, [w]))
    assert sum(g[0] for g in gained.values()) == pytest.approx(100.0, abs=2.0)
    assert gained["launch"][0] > 90.0


def test_hills_weigh_a_drive_at_an_even_speed(tmp_path):
    t = np.arange(0.0, 1200.0, 1.0 / RATE)
    up_and_level = 0.05 * (np.sin(2.0 * np.pi * t / 120.0) > 0.0)
    gained = shares(written(tmp_path, [driven(np.full(t.size, 15.0), grade=up_and_level)]))
    # On the level between, the force that is no mass becomes known.
    assert gained["hill"][0] > 40.0
    assert gained["hill"][0] + gained["cruise"][0] == pytest.approx(100.0, abs=1.0)
    assert_allclose([gained["hill"][2], gained["cruise"][2]], 10.0, rtol=0.08)


def test_each_manoeuvre_has_its_minutes(tmp_path):
    # Ten times up in a third gear for 20 s, down without brakes for 32 s, and 28 s in between.
    up, down = np.arange(14.0, 22.0, 0.4 / RATE), np.arange(22.0, 14.0, -0.25 / RATE)
    even = np.full(int(28.0 * RATE), 14.0)
    gained = shares(written(tmp_path, [driven(np.tile(np.concatenate((up, down, even)), 10))]))
    assert set(gained) <= {"acceleration", "slowing", "cruise"}
    assert_allclose(
        [gained[name][2] for name in ("acceleration", "slowing", "cruise")],
        [200.0 / 60.0, 320.0 / 60.0, 280.0 / 60.0],
        atol=0.5,
    )
    # The third gear is in from 12 m/s on; what follows within 5 s is after a shift.
    rise = np.arange(9.0, 21.0, 0.4 / RATE)
    shifted = shares(written(tmp_path, [driven(np.tile(np.concatenate((rise, rise[::-1])), 12))]))
    assert shifted["after a shift"][2] == pytest.approx(12 * 5.0 / 60.0, abs=0.3)


def loaded_on_the_way():
    """Drive launches, stand a minute while 400 kg are loaded, and drive launches again."""
    leg = launches()
    speed = np.concatenate((leg, np.zeros(int(60.0 * RATE)), leg))
    return driven(speed, load=np.where(np.arange(speed.size) <= leg.size, 0.0, 400.0))


def test_information_is_counted_for_each_load(tmp_path):
    w = loaded_on_the_way()
    assert len(w.segments) == 2
    assert w.mass == pytest.approx(MASS + 400.0, rel=0.02)
    (figure,) = over(written(tmp_path, [w]), "Time since start [min]", "± [kg]")
    bars = [t for t in figure["data"] if t["type"] == "bar"]
    minute = np.concatenate([numbers(t["x"]) for t in bars])
    gain = np.concatenate([numbers(t["y"]) for t in bars])
    assert gain.min() >= 0.0
    assert gain.sum() == pytest.approx(100.0, abs=0.1)
    assert 30.0 < gain[minute < w.segments[1].start / 60.0].sum() < 70.0
    # Of the bound above the bars all is inside the figure but the first leap.
    bound = next(numbers(t["y"]) for t in figure["data"] if t["type"] != "bar")
    low, high = (10.0**end for end in figure["layout"]["yaxis"]["range"])
    assert low < bound.min() < 1.5 * low
    assert np.percentile(bound, 97.0) < high < 1.5 * np.percentile(bound, 98.0)


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_wind_has_the_sign_of_the_weather(tmp_path, round_trip, share):
    html = written(tmp_path, [round_trip[share]])
    (figure,) = over(html, "Time since start [min]", "Wind at the vehicle [m/s]")
    solid = [t for t in figure["data"] if "fill" not in t and t["line"].get("dash") != "dash"]
    north, east = (np.median(numbers(t["y"])) for t in solid)
    assert_allclose(north, 5.0 * np.cos(np.radians(320.0)), atol=1.0)
    assert_allclose(east, 5.0 * np.sin(np.radians(320.0)), atol=1.0)
    dashed = [t for t in figure["data"] if t["line"].get("dash") == "dash"]
    assert_allclose([numbers(t["y"])[0] for t in dashed],
                    [2.5 * np.cos(np.radians(320.0)), 2.5 * np.sin(np.radians(320.0))]
                    if share else [], atol=1e-3)  # fmt: skip
    maps = over(html, "East [km]")
    blew = next(f for f in maps if any(t.get("name") == "wind" for t in f["data"]))
    tails = [(a["ax"], a["ay"]) for a in blew["layout"]["annotations"] if a["showarrow"]]
    assert 3 < len(tails) <= 12
    # It comes from 320 degrees and goes to 140. Pixels count downwards: from the tail, right and
    # down is south-east.
    assert_allclose([np.degrees(np.arctan2(-x, y)) for x, y in tails], 140.0, atol=25.0)
    assert 30.0 < max(np.hypot(x, y) for x, y in tails) < 60.0


def against(html, axis):
    """Return the mean of the residual and what it is with slow forces, over such an axis."""
    (figure,) = over(html, axis, "Residual [N]")
    mean = next(t for t in figure["data"] if "error_y" in t)
    slow = next(t for t in figure["data"] if t.get("line", {}).get("dash") == "dash")
    return figure, mean, slow


def test_sentences_of_forces_and_wind_are_in_pounds_and_miles(tmp_path, round_trip):
    units = r"\d (?:N m|N|kg|km/h|m/s|km|m)(?![\w/²])"
    si = Elements(written(tmp_path, [round_trip[0.0]])).text
    with shown_in("us"):
        us = Elements(written(tmp_path, [round_trip[0.0]])).text
    assert len(re.findall(units, si)) > 8
    assert re.findall(units, us) == []
    (wind,) = re.findall(r"up to ([\d.]+) m/s", si)
    (mph,) = re.findall(r"up to ([\d.]+) mph", us)
    assert float(mph) == pytest.approx(float(wind) * 3600.0 / 1609.344, abs=0.15)


def test_residual_is_highest_driving_against_the_wind(tmp_path, round_trip):
    _, left, slow = against(written(tmp_path, [round_trip[0.0]]), "Heading [deg]")
    means = numbers(slow["y"])
    crest = float(numbers(slow["x"])[np.argmax(means)])
    assert abs(crest - 320.0) <= 30.0
    # Drag of 30 m/s less that of 25 m/s, with the car's speed wandering around it.
    at_crest = 0.6 * 0.6 * ((25.0 + 5.0) ** 2 - 25.0**2)
    assert_allclose(max(means), at_crest, rtol=0.2)
    # What the drive told of wind and slow forces is taken off: no crest is left.
    assert max(np.abs(numbers(left["y"]))) < 0.1 * at_crest


def test_a_car_that_goes_one_way_tells_no_wind(tmp_path):
    html = written(tmp_path, [driven(launches())])
    assert not any(
        a["showarrow"] for f in figures(html).values() for a in f["layout"].get("annotations", ())
    )


def test_means_of_the_residual_are_those_of_their_bins(tmp_path):
    w = make_weighing(hours=1.0)
    known, table = np.isfinite(w.result.residual), w.result.balance.table
    # A bin of 15 samples, which is less than 0.2 % of them.
    fast = np.where(np.arange(table.time.size) < np.flatnonzero(known)[15], 42.0, table.speed)
    balance = replace(w.result.balance, table=replace(table, speed=fast))
    w = replace(w, result=replace(w.result, balance=balance))
    (figure,) = over(written(tmp_path, [w]), "Speed [km/h]", "Residual [N]")
    mean = next(t for t in figure["data"] if "error_y" in t)
    centres = numbers(mean["x"])
    speed, left = 3.6 * fast[known], w.result.residual[known]
    # At most 14 bins of a round width, and none of less than 10 samples or 0.2 % of them.
    width = np.diff(centres)[0]
    assert width in (5.0, 10.0)
    assert np.diff(np.percentile(speed, [0.5, 99.5])) / width <= 14.0
    for centre, m, s in zip(
        centres, numbers(mean["y"]), numbers(mean["error_y"]["array"]), strict=True
    ):
        inside = left[(speed >= centre - 0.5 * width) & (speed < centre + 0.5 * width)]
        assert inside.size >= max(10, 0.002 * left.size)
        assert_allclose([m, s], [inside.mean(), inside.std(ddof=1)], rtol=1e-4)


def test_one_gear_and_no_heading_leave_two_figures(tmp_path):
    w = make_weighing()
    known = w.result.balance.table
    balance = replace(w.result.balance, table=replace(known, gear=np.ones_like(known.gear)))
    for shown, count in ((w, 3), (replace(w, result=replace(w.result, balance=balance)), 2)):
        drawn = figures(written(tmp_path, [shown])).values()
        axes = [f["layout"].get("yaxis", {}).get("title", {}).get("text") for f in drawn]
        assert axes.count("Residual [N]") == count


def test_comparison_gives_what_each_method_gives():
    w = weighed_by_rls()
    methods = compare(w)
    compared = [m for m in ESTIMATORS if ESTIMATORS[m].compared]
    assert [m.method for m in methods] == compared
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


def test_methods_are_shown_with_their_intervals_or_why_not(tmp_path):
    w = weighed_by_rls()
    html = written(tmp_path, [w], comparisons=[compare(w)], truth={w.drive.name: 1600.0})
    rows = table(html, "methods")
    low, high = w.interval(0.95)
    assert rows["rls"][:2] == [f"{w.mass:.0f} kg", f"{low:.0f} to {high:.0f} kg"]
    assert rows["rls"][3] == f"{100.0 * (w.mass / 1600.0 - 1.0):+.1f} %".replace("-", "−")
    assert "vehicle_speed" in rows["speed-ekf"][-1]
    (masses,) = over(html, "Mass [kg]")
    marks = {t["y"][0]: t for t in masses["data"]}
    assert "speed-ekf" not in marks
    x, reach = numbers(marks["rls"]["x"])[0], marks["rls"]["error_x"]
    ends = [x - numbers(reach["arrayminus"])[0], x + numbers(reach["array"])[0]]
    assert_allclose(ends, [low, high], rtol=1e-6)
    tracks = next(f for f in over(html, "Time since start [min]")
                  if {"rls", "hybrid"} <= {t.get("name") for t in f["data"]})  # fmt: skip
    styles = {t["name"]: (t["line"]["color"], t["line"].get("dash")) for t in tracks["data"]
              if t.get("name") in marks}  # fmt: skip
    assert len(set(styles.values())) == len(marks)


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
    for figure, name in zip(forces, ("disturbance", "resistance"), strict=True):
        force, std, _ = slow.of(name)
        area, middle = (numbers(trace["y"]) for trace in figure["data"])
        # There along the low edge, back along the high one.
        low, high = area[: area.size // 2], area[area.size // 2 :][::-1]
        assert_allclose(0.5 * (low + high), middle, atol=0.02)
        assert np.nanmax(middle) == pytest.approx(force.max(), rel=1e-4, abs=0.02)
        assert np.nanmedian(high - low) == pytest.approx(2 * 1.96 * np.median(std), rel=0.1)


def test_a_band_is_one_closed_area_for_each_stretch_that_is_known(tmp_path):
    """A gap in the grade once drew one wedge across the whole plot."""
    w = make_weighing()
    known = w.result.balance
    hidden = (known.table.time > 600.0) & (known.table.time < 900.0)
    grade = np.where(hidden, np.nan, known.motion.grade)
    motion = replace(known.motion, grade=grade)
    balance = replace(known, motion=motion, table=replace(known.table, grade=grade))
    w = replace(w, result=replace(w.result, balance=balance))
    road = next(f for f in over(written(tmp_path, [w]), "Distance [km]")
                if any(t.get("fill") == "toself" for t in f["data"]))  # fmt: skip
    area = next(t for t in road["data"] if t.get("fill") == "toself")
    x, y = numbers(area["x"]), numbers(area["y"])
    (gap,) = np.flatnonzero(np.isnan(x))
    for side in (x[:gap], x[gap + 1 :]):
        half = side.size // 2
        assert_allclose(side[:half], side[half:][::-1])
    # No width but there and back: the band is 1.96 standard deviations to each side.
    half = gap // 2
    width = y[:gap][half:][::-1] - y[:gap][:half]
    assert_allclose(width, 2.0 * 1.96 * 0.4, rtol=0.02)
    assert x[:gap].max() < x[gap + 1 :].min()
